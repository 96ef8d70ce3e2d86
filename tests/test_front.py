"""Trade-offs: which designs no other one beats, and how they are found."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pcjax
from pcjax.design.belief import Batch, Belief
from pcjax.design.checkpoint import Progress
from pcjax.design.front import _FrontSearch, trade_off, unbeaten
from pcjax.design.outcome import Settings
from pcjax.design.space import design_space
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task
from pcjax.view.front import plot_front
from pcjax.words import InputWarning

pytestmark = pytest.mark.usefixtures("quick_programs")

TASK = Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
SPACE = design_space(
    pcjax.box_hand(0.0), {"fingertip_angle_deg": (-30.0, 0.0), "fingertip_length": (25, 175)}, 50.0
)
FEW = Settings(iterations=2, accept_trials=60)


def test_unbeaten_points_are_those_of_the_definition() -> None:
    aims = np.random.default_rng(0).integers(0, 6, (60, 2)).astype(float)
    expected = [
        not any((other >= one).all() and (other > one).any() for other in aims) for one in aims
    ]
    np.testing.assert_array_equal(unbeaten(aims), expected)


class Known(_FrontSearch):
    """Two aims, x and 1 - x^2, less the distance from the line y = 0.3: that line is the front."""

    def try_out(self, at: np.ndarray, round: int) -> tuple[Batch, int]:
        rng, count = np.random.default_rng([self.seed, round, 7]), self.trials(round)
        off = np.abs(at[:, 1] - 0.3)
        aims = np.stack([at[:, 0] - off, 1 - at[:, 0] ** 2 - off], axis=1)
        noise = np.eye(len(at)) / (100 * count)
        logs = aims * [1.0, -1.0] + rng.standard_normal(aims.shape) / math.sqrt(100 * count)
        return Batch(at, logs, np.stack([noise, noise]), count), 0


@pytest.mark.parametrize("seed", range(3))
def test_a_known_front_is_found_from_end_to_end(seed: int) -> None:
    search = Known(Surrogate(TASK, trials=1000), SPACE.holding(TASK), seed)
    belief, state = Belief(search.surrogate), Progress([[]], [[-20.0, 150.0]], [])
    for _ in range(12):
        state = search.round(belief, state)
    front = belief.at[unbeaten(search.aims(belief.each_mean(belief.at)))]
    assert np.max(np.abs(front[:, 1] - 0.3)) < 0.05
    x = np.sort(front[:, 0])
    assert x[0] < 0.25  # there 1 - x^2 is flat
    assert x[-1] > 0.95
    assert np.max(np.diff(x)) < 0.25


def test_a_front_is_exact_on_unseen_trials_and_sorted() -> None:
    found = trade_off(Surrogate(TASK, trials=80), SPACE, FEW)
    values = np.array([[aim.value for aim in member.aims] for member in found.members])
    assert (np.diff(values[:, 0]) > 0).all()
    assert (np.diff(values[:, 1]) > 0).all()  # harder to escape from, and harder to enter
    member = found.members[0]
    hand = SPACE.hand(member.design)
    same = pcjax.evaluate(hand, pcjax.Circle(25.0), trials=60, max_steps=20_000, seed=0x30000000)
    assert member.aims[0].value == pytest.approx(same.indices("does")["index1"].value, rel=1e-6)
    assert member.aims[1].value == pytest.approx(same.indices("eoen")["index1"].value, rel=1e-6)
    assert member.aims[0].low < member.aims[0].value < member.aims[0].high
    figure = plot_front((found, SPACE, Surrogate(TASK)))
    axis, *hands = figure.axes
    assert "less is better" in axis.get_ylabel()
    drawn = [hand.get_title() for hand in hands if hand.get_title()]
    assert drawn == [str(k + 1) for k in range(len(found.members))][: len(drawn)]


def test_a_front_whose_aims_the_trials_cannot_tell_is_refused() -> None:
    """Of two objects by index 2, with no trial that lasts."""
    small = replace(TASK, body=pcjax.Circle(5.0), max_steps=2_000_000)
    both = Surrogate(replace(small, also=(small,)), objective="index2", trials=8)
    with pytest.raises(ValueError, match="no design has both aims"):
        trade_off(both, SPACE, replace(FEW, accept_trials=8))


def test_a_given_hand_that_is_not_allowed_is_compared_as_it_is() -> None:
    space = pcjax.design_space(pcjax.box_hand(), {"fingertip_length": (20.0, 60.0)}, 50.0)
    with pytest.warns(InputWarning, match="outside 20 to 60"):
        found = trade_off(Surrogate(TASK, trials=40), space, FEW)
    assert not found.moved
    assert found.start.design == pytest.approx([100])


def test_two_objects_are_two_aims() -> None:
    task = replace(TASK, also=(replace(TASK, body=pcjax.Circle(40.0)),))
    found = trade_off(Surrogate(task, trials=40), SPACE, FEW)
    assert found.larger == (True, True)
    values = np.array([[aim.value for aim in member.aims] for member in found.members])
    assert unbeaten(values).all()


@pytest.mark.parametrize(
    "task",
    [
        replace(TASK, directions=("does",)),
        replace(TASK, also=(TASK, TASK)),
    ],
)
def test_one_aim_or_three_are_refused(task: Any) -> None:
    with pytest.raises(ValueError, match="two aims"):
        trade_off(Surrogate(task), SPACE, FEW)


def test_the_command_prints_a_front(capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    from pcjax.cli import main

    line = "optimize --front --iterations 2 --trials 40 --accept-trials 60 --max-steps 20_000"
    main([*line.split(), "--json", "--plot", str(tmp_path / "front.png")])
    told = json.loads(capsys.readouterr().out)
    assert len(told["front"]) >= 1
    assert told["undefined"] == told["invalid"] == 0
    assert not told["interrupted"]
    assert set(told["front"][0]["aims"]) == {"DoEs by index1", "EoEn by index1"}
    assert told["start"]["parameters"]["fingertip_angle_deg"] == pytest.approx(10)
    assert (tmp_path / "front.png").stat().st_size > 10_000
    main(line.split())
    table = capsys.readouterr().out.splitlines()
    assert table[0].split()[-3:] == ["EoEn", "by", "index1"]
    assert sum(row.startswith("start ") for row in table) == 1


def test_a_search_that_is_interrupted_at_once_has_no_front(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(_FrontSearch, "try_out", interrupted)
    with pytest.raises(KeyboardInterrupt):
        trade_off(Surrogate(TASK), SPACE, FEW)
