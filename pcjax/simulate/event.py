"""The engine that leaps from event to event, for a circle in a hand that stays put."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from jaxtyping import Array

from pcjax.geometry import NEVER, Scalar
from pcjax.model.scenario import Scenario, World
from pcjax.physics.contact.circle import move_circle
from pcjax.physics.contact.table import registered_contact
from pcjax.physics.state import State
from pcjax.simulate.bursts import Bursts, LeapingEngine
from pcjax.simulate.engine import register_engine
from pcjax.simulate.leaping import Flight, leap


class CircleBursts(Bursts):
    """Leaps of a circle."""

    def stretch(self, world: World, profile: Any, time: Scalar) -> tuple[Any, Scalar]:
        """Gravity as it swings, and how long a leap may be while it does."""
        drift = self.drift * world.contact_radius
        swing = world.drive.swing(profile, time, drift)
        # A relaxed goal takes the acceleration of a leap as constant.
        longest = NEVER if self.goal_layer is None else world.drive.steady_interval(drift)
        return (swing, longest + 0.0 * time), swing.until

    @staticmethod
    def leap(world: World, stretch: Any, flight: Flight) -> Flight:
        """The flight after one leap."""
        swing, longest = stretch
        return leap(world, swing, longest, flight)

    def taken_off(self, state: State, time: Array, leaps: Array) -> Flight:
        """Flights from lanes' states."""
        return Flight(state.position, state.velocity, time, leaps, state.status)

    def landed(self, state: State, flights: Flight) -> State:
        """The states of flights."""
        return replace(state, position=flights.position, velocity=flights.velocity)


@register_engine("event")
class EventDriven(LeapingEngine):
    """The engine that leaps from event to event, for a circle in a hand that a wrist tilts.

    Its arguments are those of `LeapingEngine`.
    """

    bursts = CircleBursts

    noun = "the event-driven engine"
    summary = "from event to event, for a circle in a hand that a wrist tilts"
    preference = 20

    @classmethod
    def obstacle(cls, scenario: Scenario) -> str | None:
        """Why it does not apply to a scenario; None where it does."""
        circle = registered_contact(scenario.body) is move_circle
        if not (scenario.drive.steady_in_between and circle):
            return "it knows a circle in a hand that a wrist tilts"
        if scenario.law.smoothing is not None:
            return "it knows hard contact only, and this one is smoothed"
        if scenario.law.friction is not None or scenario.law.drag is not None:
            return "it knows motion without friction and drag"
        return None

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """0.05 ms to 600 s."""
        return 0.05e-3 * max_steps / 600_000
