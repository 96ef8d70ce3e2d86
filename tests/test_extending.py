"""Drives and bodies from outside the package: they run like those inside it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from jaxtyping import Array

import pcjax
from pcjax.components import quantity
from pcjax.geometry import Flag, Scalar, Vec
from pcjax.model.drives.wrist import TiltProfile
from pcjax.model.motion import Motion
from pcjax.model.scenario import World
from pcjax.physics.contact.circle import meet_limbs
from pcjax.physics.contact.table import register_contact
from pcjax.physics.state import State, judge
from pcjax.simulate.choose import choose_engine

pytestmark = pytest.mark.usefixtures("quick_programs")

RUN: dict[str, Any] = {"trials": 64, "max_steps": 60_000, "dt": 0.04, "direction": "does"}


class OwnWrist(pcjax.Drive):
    """The wrist as somebody else's class."""

    wrist: pcjax.WristTilt
    period: float = quantity("time", "between draws", default=10.0, key="period", static=True)

    targets_per_period = 2

    def profile(self, before: Array, draws: Array, first: Flag) -> TiltProfile:
        return self.wrist.profile(before, draws, first)

    def fly(
        self, profile: TiltProfile, position: Vec, velocity: Vec, time: Scalar, dt: Scalar
    ) -> Motion:
        return self.wrist.fly(profile, position, velocity, time, dt)

    def top_speed(self, reach: float) -> float:
        return self.wrist.top_speed(reach)


class Bare(pcjax.Body):
    """A circle as somebody else's class, without a function that moves it."""

    radius: Scalar = quantity("length", "of the circle", low=0, above=True, key="radius")

    @property
    def width(self) -> Scalar:
        return 2 * self.radius


class OwnCircle(Bare):
    """And with one."""


@register_contact(OwnCircle)
def move_own_circle(
    body: OwnCircle, world: World, state: State, free: Motion, dt: Scalar, barrier: Scalar
) -> State:
    travel = free.position - state.position
    safe = travel.dot(travel) < body.radius * body.radius
    return judge(world, state, meet_limbs(world, free, dt, barrier), safe)


def test_own_drive_and_body_give_the_same_trials_as_those_of_the_package() -> None:
    hand = pcjax.box_hand(0.0)
    theirs = pcjax.evaluate(hand, pcjax.Circle(25.0), **RUN)
    own = pcjax.evaluate(hand, OwnCircle(25.0), drive=OwnWrist(pcjax.WristTilt()), **RUN)
    np.testing.assert_array_equal(own.dataset.escape_step, theirs.dataset.escape_step)
    np.testing.assert_array_equal(own.dataset.status, theirs.dataset.status)
    assert 0 < theirs.status("does")["passed"] < 64


def test_automatic_engine_steps_for_what_the_event_driven_one_does_not_know() -> None:
    hand = pcjax.box_hand(0.0)
    for scenario in (
        pcjax.does(hand, OwnCircle(25.0)),
        pcjax.does(hand, pcjax.Circle(25.0), OwnWrist(pcjax.WristTilt())),
    ):
        assert choose_engine("auto", None, scenario).name == "stepping"
        with pytest.raises(ValueError, match="event-driven engine cannot run this"):
            choose_engine("event", None, scenario)


def test_results_name_every_number_of_an_own_drive() -> None:
    drive = OwnWrist(pcjax.WristTilt(gravity=5.0))
    result = pcjax.evaluate(pcjax.box_hand(0.0), OwnCircle(25.0), drive=drive, **RUN)
    numbers = json.loads(result.dataset.attrs["parameters"])["does"]
    assert numbers["drive.period"] == 10.0
    assert numbers["drive.wrist.gravity"] == 5.0


def test_a_body_that_nothing_moves_says_so() -> None:
    with pytest.raises(TypeError, match="how a Bare moves"):
        pcjax.trajectory(pcjax.does(pcjax.box_hand(), Bare(25.0)))
