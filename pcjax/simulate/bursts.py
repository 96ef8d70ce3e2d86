"""What engines that leap from event to event share: bursts of leaps, each lane at its own time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from pcjax.geometry import Scalar
from pcjax.model.scenario import World
from pcjax.physics.state import INVALID, RUNNING, State
from pcjax.simulate.batch import LaneEngine
from pcjax.simulate.lanes import Lanes, lane_axes
from pcjax.simulate.relaxation import Excursion, Layer

DRIFT = 4e-4
"""How far, in contact radii, taking gravity as constant for a while may lead the object astray."""


class LeapingEngine(LaneEngine):
    """An engine that leaps from event to event.

    Arguments:
        burst: leaps between two looks at whose period is over.
        rounds: bursts in one call.
        budget: leaps in one period after which a trial ends as INVALID.
        goal_layer: see `LaneEngine`.
    """

    burst: int = eqx.field(default=8, static=True)
    rounds: int = eqx.field(default=8, static=True)
    budget: int = eqx.field(default=10_000, static=True)

    bursts: ClassVar[type[Bursts]]

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s."""
        return np.asarray(lanes.period) * period + np.asarray(lanes.time, float)

    def program(self, period: float) -> Bursts:
        """What is compiled; the same for every period."""
        return self.bursts(self.budget, self.goal_layer, self.burst, self.rounds)


class Bursts(eqx.Module):
    """Leaps, a burst at a time; see `LeapingEngine`.

    A subclass says how a leap goes. What leaps has `position`, `velocity`, `time`, `leaps` and
    `status`, as `pcjax.simulate.leaping.Flight` has them.
    """

    budget: Int[Array, ""] | int
    goal_layer: Scalar | None
    burst: int = eqx.field(static=True)
    rounds: int = eqx.field(static=True)

    leap: ClassVar[Callable[..., Any]]
    """From a world, a drive's profile, an interval and a flight to the flight after the leap."""

    def taken_off(self, state: State, time: Array, leaps: Array) -> Any:
        """Flights from lanes' states, times in the period and leaps taken in it."""
        raise NotImplementedError

    def landed(self, state: State, flights: Any) -> State:
        """The states of flights, but for their status and leaps."""
        raise NotImplementedError

    def run(self, worlds: World, profiles: Any, lanes: Lanes) -> Lanes:
        """Takes each trial `burst` leaps further, at most to the end of its period."""
        intervals = jax.vmap(
            lambda world: world.drive.steady_interval(DRIFT * world.contact_radius),
            in_axes=(lane_axes(worlds),),
        )(worlds)

        state = lanes.state
        layers = Layer.all_of(worlds, self.goal_layer)
        if layers is not None:
            worlds = replace(worlds, goal=jax.vmap(Layer.farthest_goal)(layers))

        each = jax.vmap(type(self).leap, in_axes=(lane_axes(worlds), 0, 0, 0))

        def one(carry: tuple[Any, Excursion], _: None) -> tuple[tuple[Any, Excursion], None]:
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

        leaps = jnp.where(lanes.time == 0, 0, state.steps)
        flights = self.taken_off(state, lanes.time, leaps)
        (flights, excursions), _ = jax.lax.scan(one, (flights, lanes.excursion), length=self.burst)
        spent = (flights.leaps >= self.budget) & (flights.status == RUNNING)
        state = replace(
            self.landed(state, flights),
            steps=flights.leaps,
            status=jnp.where(spent, INVALID, flights.status),
        )
        return lanes._replace(time=flights.time, state=state, excursion=excursions)
