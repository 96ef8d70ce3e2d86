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

from pcjax.geometry import Scalar, Vec, where
from pcjax.model.scenario import World
from pcjax.physics.state import INVALID, RUNNING, State
from pcjax.simulate.batch import LaneEngine
from pcjax.simulate.lanes import Lanes, lane_axes
from pcjax.simulate.relaxation import Excursion, Layer
from pcjax.simulate.rounds import Tracked, Trials
from pcjax.simulate.track import Track


class LeapingEngine(LaneEngine):
    """An engine that leaps from event to event.

    Arguments:
        burst: leaps between two looks at what follows a period's stretch.
        rounds: bursts in one call.
        budget: leaps in one period after which a trial ends as INVALID.
        drift: how far, in contact radii, taking gravity as simpler than it is for a while may lead
            the object astray.
        goal_layer: see `LaneEngine`.
    """

    burst: int = eqx.field(default=4, static=True)
    rounds: int = eqx.field(default=16, static=True)
    budget: int = eqx.field(default=10_000, static=True)
    drift: float = eqx.field(default=4e-4, static=True)

    bursts: ClassVar[type[Bursts]]
    tracks = True

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s."""
        return np.asarray(lanes.period) * period + np.asarray(lanes.time, float)

    def program(self, period: float) -> Bursts:
        """What is compiled; the same for every period."""
        return self.bursts(self.budget, self.drift, self.goal_layer, self.burst, self.rounds)


class Bursts(Tracked):
    """Leaps, a burst at a time; see `LeapingEngine`.

    A subclass says how a leap goes. What leaps has `position`, `velocity`, `time`, `leaps` and
    `status`, as `pcjax.simulate.leaping.Flight` has them.
    """

    budget: Int[Array, ""] | int
    drift: Scalar
    goal_layer: Scalar | None
    burst: int = eqx.field(static=True)
    rounds: int = eqx.field(static=True)

    leap: ClassVar[Callable[..., Any]]
    """From a world, a stretch and a flight to the flight after the leap."""

    def stretch(self, world: World, profile: Any, time: Scalar) -> tuple[Any, Scalar]:
        """What a leap has to know of the stretch of a period that begins at `time`, s; and when
        that ends."""
        raise NotImplementedError

    def taken_off(self, state: State, time: Array, leaps: Array) -> Any:
        """Flights from lanes' states, times in the period and leaps taken in it."""
        raise NotImplementedError

    def landed(self, state: State, flights: Any) -> State:
        """The states of flights, but for their status and leaps."""
        raise NotImplementedError

    @staticmethod
    def seen_from_hand(world: World, stretch: Any, before: Any, flight: Any) -> Vec:
        """The velocity as seen from the hand after a leap."""
        return flight.velocity

    def advanced(
        self, trials: Trials, lanes: Lanes, *, tracked: bool
    ) -> tuple[Lanes, Track | None]:
        """Each trial `burst` times `rounds` leaps further, or at its end; and where each leap ended
        if they are tracked.

        What follows a trial's stretch is known before the stretch is over, so that the next one
        begins within a burst.
        """
        worlds, last_period = trials.worlds, trials.last_period
        end = worlds.drive.period
        layers = Layer.all_of(worlds, self.goal_layer)
        if layers is not None:
            worlds = replace(worlds, goal=jax.vmap(Layer.farthest_goal)(layers))
        axes = lane_axes(worlds)
        each = jax.vmap(type(self).leap, in_axes=(axes, 0, 0))
        stretches = jax.vmap(self.stretch, in_axes=(axes, 0, 0))

        def move(stretch: Any, flights: Any, excursions: Excursion) -> tuple[Any, Excursion]:
            moved = each(worlds, stretch, flights)
            if layers is None:
                return moved, excursions
            time = moved.time - flights.time
            excursions = jax.vmap(Layer.follow_leap)(
                layers, excursions, flights.position, moved.position, moved.velocity, time
            )
            status = jax.vmap(Layer.verdict)(layers, moved.status, excursions)
            return replace(moved, status=status), excursions

        seen = jax.vmap(type(self).seen_from_hand, in_axes=(axes, 0, 0, 0))

        def round(carry: tuple[Any, ...], _: None) -> tuple[tuple[Any, ...], Track | None]:
            flights, excursions, period, draws, profile, stretch, until = carry
            ahead = trials.draws(period + 1)
            profile_ahead = trials.profiles(draws, ahead, False)
            ends = until >= end
            then = where(ends, profile_ahead, profile), jnp.where(ends, 0.0, until)
            stretch_after, until_after = stretches(worlds, *then)

            def one(carry: tuple[Any, ...], _: None) -> tuple[tuple[Any, ...], Track | None]:
                flights, excursions, goes_on = carry
                over = (flights.time >= until) & (flights.status == RUNNING) & ~goes_on
                over = over & (~ends | (period < last_period))
                goes_on = goes_on | over
                anew = over & ends
                flights = replace(
                    flights,
                    time=jnp.where(anew, 0.0, flights.time),
                    leaps=jnp.where(anew, 0, flights.leaps),
                )
                excursions = excursions.with_first_over(anew & (period == 0))
                now = where(goes_on, stretch_after, stretch)
                moved, excursions = move(now, flights, excursions)
                if not tracked:
                    return (moved, excursions, goes_on), None
                which = period + (goes_on & ends).astype(period.dtype)
                velocity = seen(worlds, now, flights, moved)
                point = Track(which, moved.time, moved.position, velocity)
                return (moved, excursions, goes_on), point

            begin = flights, excursions, jnp.zeros_like(ends)
            (flights, excursions, goes_on), track = jax.lax.scan(one, begin, length=self.burst)
            anew = goes_on & ends
            after = (
                flights,
                excursions,
                period + anew.astype(period.dtype),
                where(anew[:, None], ahead, draws),
                where(anew, profile_ahead, profile),
                where(goes_on, stretch_after, stretch),
                jnp.where(goes_on, until_after, until),
            )
            return after, track

        lanes = trials.begun(lanes)
        period, state = lanes.period, lanes.state
        draws = trials.draws(period)
        profile = trials.profiles(trials.draws(period - 1), draws, period == 0)
        flights = self.taken_off(state, lanes.time, state.steps)
        carry = flights, lanes.excursion, period, draws, profile
        carry = *carry, *stretches(worlds, profile, lanes.time)
        first = Track(period, lanes.time, state.position, state.velocity)
        carry, track = jax.lax.scan(round, carry, length=self.rounds)
        flights, excursions, period, *_ = carry
        spent = (flights.leaps >= self.budget) & (flights.status == RUNNING)
        state = replace(
            self.landed(state, flights),
            steps=flights.leaps,
            status=jnp.where(spent, INVALID, flights.status),
        )
        lanes = lanes._replace(period=period, time=flights.time, state=state, excursion=excursions)
        return lanes, None if track is None else jax.tree.map(_in_one_row, first, track)


def _in_one_row(first: Array, later: Array) -> Array:
    """What came first, and then the leaps of all bursts."""
    return jnp.concatenate([first[None], later.reshape(-1, *first.shape)])
