"""`step` against an independent plain-NumPy simulator: same starts, same targets, 64 bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pcjax.model.bodies.circle import Circle
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import PASSED
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from tests.helpers import path_of
from tests.reference import simulator

pytestmark = pytest.mark.usefixtures("x64")

TRIALS = 4


def reference(
    scenario: Scenario, hand: HandDesign, trial: int, periods: int, direction: str
) -> dict:
    """The same trial by the reference, its geometry built by the reference too."""
    angles = hand.angles
    if direction == "eoen":
        angles = tuple((*finger[:-1], -finger[-1]) for finger in angles)
    limbs = simulator.hand_limbs(hand.palm_length, hand.lengths, angles)
    counts = [len(finger) for finger in hand.lengths]
    key = trial_key(0, trial)
    start = scenario.start(start_draws(key, 3))
    draws = np.array([period_draws(key, k, 2) for k in range(periods)])
    return simulator.simulate(
        limbs,
        simulator.goal_line(limbs, *counts),
        scenario.body.radius,
        scenario.law.restitution,
        scenario.law.resting_speed,
        np.array([float(start.x), float(start.y)]),
        (2 * draws - 1) * math.pi / 6,
        steps=periods * 10_000,
    )


@pytest.mark.parametrize(
    ("direction", "degrees", "radius"),
    [("does", 10.0, 25.0), ("does", 40.0, 5.0), ("eoen", 20.0, 25.0)],
)
def test_trajectories_agree(direction: str, degrees: float, radius: float) -> None:
    hand = box_hand(math.radians(degrees))
    scenario = {"does": does, "eoen": eoen}[direction](hand, Circle(radius))
    agreed = []
    for trial in range(TRIALS):
        mine = path_of(scenario, trial, 2)
        other = reference(scenario, hand, trial, 2, direction)
        n = len(other["positions"])
        got = np.stack([mine.position.x, mine.position.y], 1)[:n]
        apart = np.abs(got - other["positions"]).max(axis=1) > 1e-6
        agreed.append(int(np.argmax(apart)) if apart.any() else n)
    # Thousands of steps to 1e-6; a trial that meets a round end may part earlier, since each such
    # meeting multiplies any difference.
    assert sorted(agreed)[TRIALS // 2] >= 10_000, agreed
    assert min(agreed) >= 3_000, agreed


def test_escape_steps_agree() -> None:
    # A shallow hand with a wide gap, so that most trials end within a few periods.
    hand = box_hand(0.0, gap_width=380.0, fingertip_length=30.0, side_length=200.0)
    scenario = does(hand, Circle(25.0))
    periods = 6
    same, ended = 0, 0
    for trial in range(6):
        mine = path_of(scenario, trial, periods)
        passed = int(mine.status[-1]) == PASSED
        step = int(mine.steps[-1]) if passed else None
        other = reference(scenario, hand, trial, periods, "does")["escape_step"]
        same += step == other
        ended += other is not None
    assert ended >= 3
    assert same >= 5
