"""The engine that leaps from event to event, for a circle in a hand that stays put."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from pcjax.geometry import Scalar
from pcjax.model.checking import gap_of
from pcjax.model.scenario import Scenario, World
from pcjax.physics.contact.circle import move_circle
from pcjax.physics.contact.table import registered_contact
from pcjax.physics.state import INVALID, RUNNING
from pcjax.simulate.batch import LaneEngine
from pcjax.simulate.engine import register_engine
from pcjax.simulate.lanes import Lanes, lane_axes
from pcjax.simulate.leaping import Flight, leap
from pcjax.simulate.relaxation import Excursion, Layer

DRIFT = 4e-4
"""How far, in radii, taking gravity as constant for a while may lead the circle astray."""

_LEAST_CLEARANCE = 1e-4
"""Difference between gap and object, in diameters, that there has to be."""


@register_engine("event")
class EventDriven(LaneEngine):
    """The engine that leaps from event to event, for a circle in a hand that a wrist tilts.

    Arguments:
        burst: leaps between two looks at whose period is over.
        rounds: bursts in one call.
        budget: leaps in one period after which a trial ends as INVALID.
        goal_layer: see `LaneEngine`.
    """

    burst: int = eqx.field(default=8, static=True)
    rounds: int = eqx.field(default=8, static=True)
    budget: int = eqx.field(default=10_000, static=True)

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
        diameter = 2 * float(scenario.body.radius)
        clearance = gap_of(scenario) - diameter
        if abs(clearance) < _LEAST_CLEARANCE * diameter:
            return (
                f"the gap differs from the object's diameter by {clearance:.2g}, too little for a "
                "contact on either side"
            )
        return None

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """0.18 ms to 600 s."""
        return 0.18e-3 * max_steps / 600_000

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s."""
        return np.asarray(lanes.period) * period + np.asarray(lanes.time, float)

    def program(self, period: float) -> LeapingProgram:
        """What is compiled; the same for every period."""
        return LeapingProgram(self.budget, self.goal_layer, self.burst, self.rounds)


class LeapingProgram(eqx.Module):
    """Leaps, a burst at a time; see `EventDriven`."""

    budget: Int[Array, ""] | int
    goal_layer: Scalar | None
    burst: int = eqx.field(static=True)
    rounds: int = eqx.field(static=True)

    def run(self, worlds: World, profiles: Any, lanes: Lanes) -> Lanes:
        """Takes each trial `burst` leaps further, at most to the end of its period."""
        drives = worlds.drive
        intervals = jax.vmap(
            lambda drive, drift: drive.steady_interval(drift), in_axes=(lane_axes(drives), 0)
        )(drives, DRIFT * worlds.body.radius)

        excursions, state = lanes.excursion, lanes.state
        layers = Layer.all_of(worlds, self.goal_layer)
        if layers is not None:
            worlds = replace(worlds, goal=jax.vmap(Layer.farthest_goal)(layers))

        each = jax.vmap(leap, in_axes=(lane_axes(worlds), 0, 0, 0))

        def one(carry: tuple[Flight, Excursion], _: None) -> tuple[tuple[Flight, Excursion], None]:
            flights, excursions = carry
            moved = each(worlds, profiles, intervals, flights)
            if layers is not None:
                time = moved.time - flights.time
                excursions = jax.vmap(Layer.follow_leap)(
                    layers, excursions, flights.position, moved.position, moved.velocity, time
                )
                moved = replace(
                    moved, status=jax.vmap(Layer.verdict)(layers, moved.status, excursions)
                )
            return (moved, excursions), None

        flights = Flight(
            state.position,
            state.velocity,
            lanes.time,
            jnp.where(lanes.time == 0, 0, state.steps),
            state.status,
        )
        (flights, excursions), _ = jax.lax.scan(one, (flights, excursions), length=self.burst)
        spent = (flights.leaps >= self.budget) & (flights.status == RUNNING)
        state = replace(
            state,
            position=flights.position,
            velocity=flights.velocity,
            steps=flights.leaps,
            status=jnp.where(spent, INVALID, flights.status),
        )
        return lanes._replace(time=flights.time, state=state, excursion=excursions)
