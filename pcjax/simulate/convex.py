"""The engine that leaps from event to event, for convex bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
from jaxtyping import Array

from pcjax.geometry import Scalar, Vec
from pcjax.model.scenario import Scenario, World
from pcjax.physics.state import State
from pcjax.physics.step import by_leaps
from pcjax.physics.tumbling.flight import Tumble
from pcjax.physics.tumbling.leap import tumble
from pcjax.simulate.bursts import Bursts, LeapingEngine
from pcjax.simulate.engine import register_engine


class ConvexBursts(Bursts):
    """Leaps of a convex body."""

    def stretch(self, world: World, profile: Any, time: Scalar) -> tuple[Any, Scalar]:
        """A whole period."""
        drive = world.drive
        interval = drive.steady_interval(self.drift * world.contact_radius)
        return (profile, interval + 0.0 * time), drive.period + 0.0 * time

    @staticmethod
    def leap(world: World, stretch: Any, flight: Tumble) -> Tumble:
        """The flight after one leap."""
        profile, interval = stretch
        return tumble(world, profile, interval, flight)

    @staticmethod
    def seen_from_hand(world: World, stretch: Any, before: Tumble, flight: Tumble) -> Vec:
        """The velocity as seen from the hand, as it was carried in the leap."""
        profile, interval = stretch
        carry = world.drive.leg(profile, before.time, interval).carry
        if carry is None:
            return flight.velocity
        return flight.velocity - carry.twist(flight.time).at(flight.position)

    def taken_off(self, state: State, time: Array, leaps: Array) -> Tumble:
        """Flights from lanes' states."""
        return Tumble(
            state.position,
            state.velocity,
            state.angle,
            state.spin,
            time,
            leaps,
            state.status,
            state.watch.penetration,
        )

    def landed(self, state: State, flights: Tumble) -> State:
        """The states of flights."""
        return replace(
            state,
            position=flights.position,
            velocity=flights.velocity,
            angle=flights.angle,
            spin=flights.spin,
            watch=replace(state.watch, penetration=flights.deepest),
        )


@register_engine("convex")
class ConvexLeaps(LeapingEngine):
    """The engine that leaps from event to event, for convex bodies, in whatever moves the hand.

    Its arguments are those of `LeapingEngine`.
    """

    budget: int = eqx.field(default=20_000, static=True)

    bursts = ConvexBursts
    noun = "the engine for convex bodies"
    summary = "from event to event, for all convex bodies, with friction, whatever moves the hand"
    preference = 10

    @classmethod
    def preference_for(cls, scenario: Scenario) -> float | None:
        """Behind those that know a circle without friction."""
        own = super().preference_for(scenario)
        needed = by_leaps(scenario.body, scenario.law) or scenario.body.oriented
        return own if own is None or needed else -1

    @classmethod
    def obstacle(cls, scenario: Scenario) -> str | None:
        """Why it does not apply to a scenario; None where it does."""
        if not scenario.body.convex:
            return "it knows convex bodies"
        if scenario.law.smoothing is not None:
            return "it knows hard contact only, and this one is smoothed"
        return None

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """1 ms to 300 s in a hand that stays put, 3 ms in one that is carried about."""
        usual = 1e-3 if scenario.drive.steady_in_between else 3e-3
        return usual * max_steps / 300_000
