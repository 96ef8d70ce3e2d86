"""The engine that leaps from event to event, for convex bodies in a hand that stays put."""

from __future__ import annotations

from dataclasses import replace

import equinox as eqx
from jaxtyping import Array

from pcjax.model.scenario import Scenario
from pcjax.physics.state import State
from pcjax.simulate.bursts import Bursts, LeapingEngine
from pcjax.simulate.engine import register_engine
from pcjax.simulate.tumbling import Tumble, tumble


class ConvexBursts(Bursts):
    """Leaps of a convex body."""

    leap = tumble

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
    """The engine that leaps from event to event, for convex bodies in a hand that a wrist tilts.

    Its arguments are those of `LeapingEngine`.
    """

    budget: int = eqx.field(default=20_000, static=True)

    bursts = ConvexBursts
    noun = "the engine for convex bodies"
    summary = "from event to event, for a convex body, with friction, in a hand that a wrist tilts"
    preference = -1

    @classmethod
    def obstacle(cls, scenario: Scenario) -> str | None:
        """Why it does not apply to a scenario; None where it does."""
        if not (scenario.drive.steady_in_between and scenario.body.convex):
            return "it knows a convex body in a hand that a wrist tilts"
        if scenario.law.smoothing is not None:
            return "it knows hard contact only, and this one is smoothed"
        return None

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """1.5 ms to 300 s."""
        return 1.5e-3 * max_steps / 300_000
