"""Batches: a trial depends on (seed, trial) alone, whoever runs beside it."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

import pcjax.simulate.batch as batch
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import INVALID, PASSED
from pcjax.simulate.batch import run, usual_block
from pcjax.simulate.outcomes import LIMIT, Outcomes
from pcjax.simulate.stepping import Stepping, trajectory

ENGINE = Stepping(0.02)
LIMIT_STEPS = 60_000


def conditions() -> list[Scenario]:
    wide = box_hand(0.1, gap_width=300.0)
    return [does(wide, Circle(25.0)), eoen(wide, Circle(5.0)), does(box_hand(0.3), Circle(15.0))]


def outcomes(scenarios: list[Scenario] | None = None, **changes: object) -> Outcomes:
    settings = {"trials": 150, "max_steps": LIMIT_STEPS, "engine": ENGINE}
    settings |= {"block": 128, "workers": 1} | changes
    return run(scenarios or conditions(), **settings)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def usual() -> Outcomes:
    return outcomes()


def test_every_trial_has_an_outcome(usual: Outcomes) -> None:
    assert set(np.unique(usual.status)) <= {PASSED, LIMIT, INVALID}
    assert np.all((usual.steps >= 1) & (usual.steps <= LIMIT_STEPS))
    assert np.all(usual.steps[usual.status == LIMIT] == LIMIT_STEPS)
    assert not np.any(usual.status == INVALID)
    assert 0.1 < np.mean(usual.status == PASSED) < 0.9


@pytest.mark.parametrize(
    "changes",
    [{"block": 64}, {"block": 1024}, {"workers": 2}, {"workers": 3, "block": 64}],
    ids=str,
)
def test_block_size_and_workers_change_nothing(usual: Outcomes, changes: dict) -> None:
    other = outcomes(**changes)
    np.testing.assert_array_equal(other.steps, usual.steps)
    np.testing.assert_array_equal(other.status, usual.status)


def test_chunk_size_changes_nothing(usual: Outcomes, monkeypatch: pytest.MonkeyPatch) -> None:
    import pcjax.simulate.stepping as stepping

    monkeypatch.setattr(stepping, "_CHUNK", 25)
    other = outcomes()
    np.testing.assert_array_equal(other.steps, usual.steps)


def test_number_of_trials_and_order_of_conditions_change_nothing(usual: Outcomes) -> None:
    fewer = outcomes(conditions()[::-1], trials=40)
    np.testing.assert_array_equal(fewer.steps[::-1], usual.steps[:, :40])


def test_a_longer_limit_extends_the_same_trials(usual: Outcomes) -> None:
    longer = outcomes(max_steps=95_500)
    np.testing.assert_array_equal(np.minimum(longer.steps, LIMIT_STEPS), usual.steps)
    assert longer.steps.max() == 95_500


def test_seeds_differ(usual: Outcomes) -> None:
    assert np.mean(outcomes(seed=1).steps != usual.steps) > 0.3


def test_the_settings_of_an_accelerator_change_nothing(
    usual: Outcomes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its blocks, its compiler options and one thread for each device, on the processor: trials
    are the same but for rounding."""

    class Pretended:
        platform = "gpu"

        def __init__(self, device: Any):
            self.device = device

    devices, default = jax.local_devices(), jax.default_device
    blocks = []

    def block(trials: int, platform: str) -> int:
        blocks.append((platform, usual_block(trials, platform)))
        return blocks[-1][1]

    with monkeypatch.context() as patch:
        patch.setattr(jax, "local_devices", lambda: [Pretended(device) for device in devices])
        patch.setattr(jax, "default_device", lambda one: default(one.device))
        patch.setattr(batch, "usual_block", block)
        other = outcomes(block=None, workers=None)
    assert blocks == [("gpu", 1024)]
    assert usual_block(10**7, "gpu") == 65_536
    np.testing.assert_array_equal(other.status, usual.status)
    assert np.mean(np.abs(other.steps - usual.steps) <= 2) > 0.95


def test_several_devices_change_nothing(usual: Outcomes, tmp_path: Path) -> None:
    script = (
        "import sys, json, jax\n"
        "sys.path.insert(0, '.')\n"
        "import tests.test_batch as t\n"
        "assert len(jax.local_devices()) == 2\n"
        "print(json.dumps(t.outcomes(workers=2).steps.tolist()))\n"
    )
    env = os.environ | {"XLA_FLAGS": "--xla_force_host_platform_device_count=2"}
    root = Path(__file__).parent.parent
    done = subprocess.run(
        [sys.executable, "-c", script], env=env, cwd=root, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(np.array(json.loads(done.stdout)), usual.steps)


def test_same_trials_as_the_step_by_step_trajectory(usual: Outcomes) -> None:
    # 60 s; 32-bit arithmetic on both sides, but other compiled programs: trials may part after
    # many impacts, so most, not all, have to agree.
    scenario = conditions()[0]
    follow = jax.jit(lambda trial: trajectory(scenario, trial=trial, periods=6, dt=0.02))
    same = 0
    for trial in range(20):
        end = jax.tree.map(lambda leaf: leaf[-1], follow(trial))
        steps = int(end.steps) * 20 if int(end.status) == PASSED else LIMIT_STEPS
        same += abs(steps - int(usual.steps[0, trial])) < 20
    assert same >= 17


def test_precisions_run_the_same_experiments() -> None:
    one, two = outcomes(precision=32), outcomes(precision=64)
    correlation = np.corrcoef(one.steps.ravel(), two.steps.ravel())[0, 1]
    assert correlation > 0.9
    early = two.steps < 20_000
    np.testing.assert_allclose(one.steps[early], two.steps[early], atol=2)


def test_paper_step_counts_whatever_the_solvers_step() -> None:
    coarse = outcomes(engine=Stepping(0.02), precision=64)
    fine = outcomes(engine=Stepping(0.002), precision=64)
    # index 1 of 450 paired trials: 3 s.e. of the mean difference
    difference = (coarse.steps - fine.steps).astype(float).ravel()
    assert abs(difference.mean()) < 3 * difference.std() / math.sqrt(difference.size) + 5
    early = fine.steps < 20_000
    assert np.median(np.abs(difference[early.ravel()])) <= 2


def test_fast_small_objects_end_as_invalid_and_are_counted() -> None:
    hand = box_hand(0.1)
    result = outcomes([does(hand, Circle(0.5))], engine=Stepping(0.2), trials=64)
    assert np.mean(result.status == INVALID) > 0.9


def test_conditions_of_unequal_structure_run_as_if_each_were_alone() -> None:
    other = HandDesign(500.0, ((500.0,), (500.0,)), ((1.5,), (1.5,)))
    mixed = [does(box_hand(), Circle(25.0)), does(other, Circle(25.0))]
    together = outcomes(mixed)
    alone = [outcomes([scenario]) for scenario in mixed]
    np.testing.assert_array_equal(together.steps, np.concatenate([a.steps for a in alone]))
    np.testing.assert_array_equal(together.status, np.concatenate([a.status for a in alone]))


def test_objects_with_an_orientation_and_others_do_not_run_together() -> None:
    hand = box_hand()
    with pytest.raises(ValueError, match="some of the objects have an orientation"):
        outcomes([does(hand, Circle(25.0)), does(hand, Stick(25.0))])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"trials": 0}, "trials is 0"),
        ({"max_steps": 0}, "max_steps is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"precision": 16}, "precision is 16"),
        ({"trials": 2.5}, "whole number"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_bad_counts_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        outcomes(**changes)


def test_interrupt_stops_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch, "wait", interrupt)
    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        outcomes(trials=100_000, max_steps=600_000, workers=2)
    assert threading.active_count() == before


def test_any_number_of_limbs_and_asymmetric_fingers() -> None:
    right = math.pi / 2
    hand = HandDesign(
        500.0,
        ((300.0, 200.0, 100.0, 80.0), (500.0, 120.0, 60.0)),
        ((right, 0.1, right - 0.2, 1.2), (right, right, 0.4)),
    )
    result = outcomes([does(hand, Circle(20.0)), eoen(hand, Circle(20.0))], trials=100)
    assert not np.any(result.status == INVALID)
    assert np.any(result.status == PASSED)
