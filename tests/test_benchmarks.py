"""The baselines play the same game as pcjax, so that comparing their speed is fair."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks import numba_loop
from benchmarks.growth import chain_hand
from benchmarks.inputs import as_arrays
from pcjax.model.bodies.circle import Circle
from pcjax.model.presets import box_hand
from pcjax.model.scenario import does

mujoco_scene = pytest.importorskip("benchmarks.mujoco_scene", exc_type=ImportError)

WIDE = does(box_hand(0.0, gap_width=300.0), Circle(25.0))


def test_mujoco_agrees() -> None:
    # The same 16 starts and targets in another engine, to 50 s. Paired; |z| < 4 has a false alarm
    # of 6e-5, and 25 steps (0.05 %) of bias are allowed for MuJoCo's soft contacts.
    trials, limit = 16, 50_000
    inputs = as_arrays(WIDE, trials=trials, max_steps=limit)
    plain = numba_loop.escape_steps(**inputs, max_steps=limit, dtype=np.float64)
    theirs = mujoco_scene.escape_steps(**inputs, max_steps=limit)
    difference = (np.minimum(plain, limit) - np.minimum(theirs, limit)).astype(float)
    assert np.mean(plain <= limit) > 0.1
    assert abs(difference.mean()) < 4 * difference.std(ddof=1) / math.sqrt(trials) + 15
    assert np.corrcoef(plain, theirs)[0, 1] > 0.8


def test_mujoco_in_python_is_the_same_as_its_rollout() -> None:
    limit = 12_000  # past the first change of targets
    inputs = as_arrays(WIDE, trials=2, max_steps=limit)
    rolled, stepped = (
        mujoco_scene.escape_steps(**inputs, max_steps=limit, in_python=in_python)
        for in_python in (False, True)
    )
    assert (rolled == stepped).all()


def test_mujoco_has_about_the_restitution_of_the_paper() -> None:
    # At all speeds and wherever in a step the impact falls; what is along the limb stays.
    limbs = np.array([[-250.0, 0.0, 250.0, 0.0]])
    scene = mujoco_scene.scene(limbs, radius=25.0, restitution=0.1, dt=0.001)
    speeds = np.repeat([3.0, 10.0, 80.0], 20)
    states = np.zeros((60, 5))
    states[:, 2] = 25.001 + speeds * 0.001 * np.tile(np.linspace(0.01, 0.99, 20), 3)
    states[:, 3:] = np.stack([np.full(60, 3.0), -speeds], axis=1)
    after = mujoco_scene.rollouts(scene)(states, np.zeros((60, 200, 2)))[:, -1]
    assert after[:, 3] == pytest.approx(3.0)
    assert np.all(np.abs(after[:, 4] / speeds - 0.093) < 0.011)


def test_mujoco_damping_of_a_spring_that_does_not_pull() -> None:
    # Critically damped, x = -v t exp(-w t): its force is zero at w t = 2, at speed v exp(-2).
    assert mujoco_scene.damping_ratio(math.exp(-2)) == pytest.approx(1.0)
    # Without damping nothing is lost; a little, over half a period: exp(-pi z).
    assert mujoco_scene.damping_ratio(0.99) == pytest.approx(-math.log(0.99) / math.pi, rel=0.01)


@pytest.mark.parametrize("limbs", range(3, 9))
def test_a_chain_hand_is_the_box_hand_in_more_pieces(limbs: int) -> None:
    chain, box = chain_hand(limbs, 200.0), box_hand(math.radians(10))
    assert len(chain.lengths[0]) == limbs
    for ours, theirs in zip(chain.finger(0)[-2:], box.finger(0)[-2:], strict=True):
        for end in ("start", "end"):
            a, b = getattr(ours, end), getattr(theirs, end)
            assert (float(a.x), float(a.y)) == pytest.approx((float(b.x), float(b.y)), abs=1e-3)


@pytest.mark.parametrize("limbs", [1, 2, 3])
def test_a_chain_hand_has_the_gap_that_is_asked_for(limbs: int) -> None:
    tips = [chain_hand(limbs, 200.0).finger(i)[min(limbs, 2) - 1].end for i in (0, 1)]
    assert float(tips[1].x - tips[0].x) == pytest.approx(200.0, abs=1e-3)
    assert [float(tip.y) for tip in tips] == pytest.approx([500.0, 500.0], abs=1e-3)
