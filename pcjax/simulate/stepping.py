"""Trials by fixed steps: `lax.scan` over `step`. At the paper's dt this is the reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Int, Integer

from pcjax.components import quantity
from pcjax.geometry import Scalar, Vec, where
from pcjax.model.scenario import Scenario, World
from pcjax.physics.contact.rod import move_stick
from pcjax.physics.contact.table import registered_contact
from pcjax.physics.state import PAPER_DT, PASSED, RUNNING, State
from pcjax.physics.step import advance, begin, by_leaps
from pcjax.simulate.batch import LaneEngine
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.engine import register_engine
from pcjax.simulate.lanes import Lanes, lane_axes
from pcjax.simulate.relaxation import Layer
from pcjax.simulate.rounds import Tracked, Trials
from pcjax.simulate.track import Track

_CHUNK = 50
"""Steps between two looks at whether anybody in the batch is still under way."""

SHORTEST_STEP, LONGEST_STEP = 1e-6, 0.2
"""Bounds of the solver's step, s."""


_AUTO_TRAVEL = 0.5
"""Share of the radius that a step may cover at the speed of a fall through the whole hand."""


class FixedSteps(LaneEngine):
    """An engine that takes steps of one length, a whole number of chunks of 50 in a period of the
    drive.

    Arguments:
        goal_layer: see `LaneEngine`.
    """

    tracks = True

    @classmethod
    def obstacle(cls, scenario: Scenario) -> str | None:
        """Why it does not apply to a scenario; None where it does."""
        leaps = by_leaps(scenario.body, scenario.law)
        if scenario.law.smoothing is not None and leaps:
            return "smoothed contact is for a circle or a stick without friction and drag"
        thin = isinstance(scenario.hand.thickness, Tracer) or float(scenario.hand.thickness) == 0
        if registered_contact(scenario.body) is move_stick and not leaps and not thin:
            return "it knows the stick in a hand without thickness, and engine 'convex' in any"
        return None

    def steps_wanted(self, period: float) -> float:
        """How many steps a period of `period` seconds should have at least."""
        raise NotImplementedError

    def steps_per_period(self, period: float) -> int:
        """Steps in one period of the drive."""
        return _CHUNK * math.ceil(self.steps_wanted(period) / _CHUNK - 1e-9)

    def step_taken(self, period: float) -> float:
        """The step taken, s."""
        return period / self.steps_per_period(period)

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s."""
        return np.asarray(lanes.state.steps) * self.step_taken(period) - np.asarray(lanes.lag)

    def program(self, period: float) -> SteppingProgram:
        """What is compiled, for periods of `period` seconds."""
        chunks = self.steps_per_period(period) // _CHUNK
        return SteppingProgram(self.step_taken(period), chunks, self.goal_layer, _CHUNK)

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """2.5 ms for a circle and 5 ms for what turns, to 300 s by its usual step."""
        seconds, usual = (5e-3, 0.01) if scenario.body.oriented else (2.5e-3, 0.02)
        finer = usual / self.step_taken(scenario.drive.period)
        return seconds * finer * max_steps / 300_000


@register_engine("stepping")
class Stepping(FixedSteps):
    """The engine that takes steps of a given length.

    Arguments:
        dt: the step asked for, s. The step taken is the largest one not above it that divides a
            period of the drive into a whole number of chunks of 50 steps.
        goal_layer: see `LaneEngine`.

    Raises:
        ValueError: a step outside [1e-6, 0.2] s.
    """

    dt: float = quantity(
        "time",
        "the solver's step",
        default=PAPER_DT,
        low=SHORTEST_STEP,
        high=LONGEST_STEP,
        key="dt",
        static=True,
    )

    noun = "stepping"
    summary = "fixed steps, for everything"
    preference = 0

    @classmethod
    def suited(cls, scenarios: Sequence[Scenario]) -> Stepping:
        """With a step that is safe in all of these."""
        return cls(min(map(safe_step, scenarios)))

    def steps_wanted(self, period: float) -> float:
        """As many as `dt` asks for."""
        return period / self.dt


def safe_step(scenario: Scenario) -> float:
    """A step in which a fall through the whole hand covers a modest share of the radius.

    Raises:
        ValueError: that is a shorter step than there may be.
    """
    hand, drive = scenario.hand, scenario.drive
    reach = float(hand.palm_length) + max(float(sum(ls)) for ls in hand.lengths)
    speed = drive.top_speed(reach)
    radius = float(scenario.contact_radius)
    if _AUTO_TRAVEL * radius < SHORTEST_STEP * speed:
        raise ValueError(
            f"the radius {float(scenario.body.radius):g} is too small for a hand of {reach:g} "
            f"under gravity: the object would need steps below {SHORTEST_STEP:g} s"
        )
    longest = min(drive.longest_step, scenario.body.longest_step)
    return min(longest, _AUTO_TRAVEL * radius / max(speed, 1e-9))


class SteppingProgram(Tracked):
    """Steps of one length, as many as a period has.

    Arguments:
        dt: the step, s.
        chunks: how often `chunk` steps make a period.
        goal_layer: see `LaneEngine`.
        chunk: steps between two looks at whether anybody is still under way.
    """

    dt: Scalar
    chunks: Int[Array, ""] | int
    goal_layer: Scalar | None
    chunk: int = eqx.field(static=True)

    def advanced(
        self, trials: Trials, lanes: Lanes, *, tracked: bool
    ) -> tuple[Lanes, Track | None]:
        """A batch of trials, each at the end of a period, after the next one; and where they were
        at equal intervals of it if they are tracked."""
        over = (lanes.time >= trials.scenarios.drive.period) & (lanes.period < trials.last_period)
        over = over & (lanes.state.status == RUNNING)
        period = lanes.period + over.astype(lanes.period.dtype)
        lanes = trials.begun(lanes)
        lanes = lanes._replace(
            period=period,
            time=jnp.where(over, 0.0, lanes.time),
            excursion=lanes.excursion.with_first_over(over & (period == 1)),
        )
        profiles = trials.profiles(trials.draws(period - 1), trials.draws(period), period == 0)
        places = None
        if tracked:
            places = jax.tree.map(
                lambda start: jnp.broadcast_to(start, (self._rows, *start.shape)),
                lanes.state.position,
            )
        return self._through_period(trials.worlds, profiles, lanes, places)

    def _through_period(
        self, worlds: World, profiles: Any, lanes: Lanes, places: Vec | None
    ) -> tuple[Lanes, Track | None]:
        """
        Arguments:
            places: where the lanes are at the points of their track, to be filled in; None for
                none.
        """
        dt = jnp.asarray(self.dt, jnp.result_type(worlds.body.radius))
        states = lanes.state
        axes = lane_axes(states)
        step_all = jax.vmap(
            lambda world, profile, state: advance(world, profile, state, dt),
            in_axes=(lane_axes(worlds), 0, axes),
            out_axes=axes,
        )

        excursions = lanes.excursion
        layers = Layer.all_of(worlds, self.goal_layer)
        if layers is not None:
            worlds = replace(worlds, goal=jax.vmap(Layer.farthest_goal)(layers))

        def one(carry: tuple[Any, ...], _: None) -> tuple[tuple[Any, ...], None]:
            states, excursions, places = carry
            moved = step_all(worlds, profiles, states)
            if layers is not None:
                time = jnp.where(states.status == RUNNING, dt, 0.0)
                excursions = jax.vmap(Layer.follow)(layers, excursions, moved.position, time)
                moved = replace(
                    moved, status=jax.vmap(Layer.verdict)(layers, moved.status, excursions)
                )
            if places is not None:
                # The last step that writes into a row is that of the row's time.
                row = self._row_of(moved.clock)
                places = jax.tree.map(
                    lambda rows, now: rows.at[row].set(now), places, moved.position
                )
            return (moved, excursions, places), None

        def chunk(carry: tuple[Any, ...]) -> tuple[Any, ...]:
            count, *rest = carry
            rest, _ = jax.lax.scan(one, tuple(rest), length=self.chunk)
            return count + 1, *rest

        def unfinished(carry: tuple[Any, ...]) -> Array:
            count, states, *_ = carry
            return (count < self.chunks) & jnp.any(states.status == RUNNING)

        zero = jnp.zeros((), jnp.int32)
        carry = zero, states, excursions, places
        _, states, excursions, places = jax.lax.while_loop(unfinished, chunk, carry)
        after = lanes._replace(
            state=with_clock_at_zero(states),
            excursion=excursions,
            time=jnp.broadcast_to(worlds.drive.period, lanes.time.shape).astype(lanes.time.dtype),
            lag=jax.vmap(lag_of, in_axes=(lane_axes(worlds), axes, None))(worlds, states, dt),
        )
        return after, None if places is None else self._track_of(lanes, after, places, dt)

    def _track_of(self, before: Lanes, after: Lanes, places: Vec, dt: Scalar) -> Track:
        """Where the lanes were in a period, from their places at its points."""
        rows = jnp.arange(self._rows, dtype=jnp.int32)
        middle, last = (2 * rows + 1) * self.chunks // 2, self.chunk * self.chunks
        time = jnp.where(rows < self._rows - 1, middle, last)[:, None].astype(after.lag.dtype) * dt
        state = after.state
        end = (state.steps - after.period * last).astype(time.dtype) * dt - after.lag
        # The points after a trial's end are where it was then.
        places = where(time >= end, state.position - state.velocity * after.lag, places)
        time = jnp.minimum(time, end)
        first = Track(before.period, before.time, before.state.position, None)
        rest = Track(jnp.broadcast_to(after.period, time.shape), time, places, None)
        return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), first, rest)

    @property
    def _rows(self) -> int:
        """Points of a track in a period: the middles of `chunk` equal parts of it, up to half a
        step before, and its end."""
        return self.chunk + 1

    def _row_of(self, clock: Array) -> Array:
        """The first point that is not before so many steps."""
        return (2 * clock + self.chunks - 1) // (2 * self.chunks)


def with_clock_at_zero(states: State) -> State:
    """The states at the start of a new period."""
    return replace(states, clock=jnp.zeros((), jnp.int32))


def lag_of(world: World, state: State, dt: Scalar) -> Scalar:
    """Seconds since the goal line was crossed in the last step; 0 for one that did not pass."""
    speed = world.goal.beyond(state.position + state.velocity) - world.goal.beyond(state.position)
    lag = world.goal.beyond(state.position) / jnp.maximum(speed, 1e-12)
    return jnp.where(state.status == PASSED, jnp.clip(lag, 0.0, dt * (1 - 1e-6)), 0.0)


def check_can_step(scenario: Scenario) -> None:
    """
    Raises:
        ValueError: steps cannot run the scenario. Traced values are not looked at.
    """
    obstacle = Stepping.obstacle(scenario)
    if obstacle:
        raise ValueError(f"{Stepping.noun} cannot run this: {obstacle}")


def trajectory(
    scenario: Scenario,
    *,
    seed: Integer[Array, ""] | int = 0,
    trial: Integer[Array, ""] | int = 0,
    periods: int = 1,
    dt: float = PAPER_DT,
) -> State:
    """One trial, step by step: the state after each step, stacked along a first axis.

    Differentiable with respect to every leaf of the scenario, in forward and reverse mode.

    Arguments:
        scenario: the condition.
        seed, trial: which experiment; the same as trial `trial` of `pcjax.evaluate(seed=seed)`.
        periods: how many periods of the drive to run (10 s each in the paper).
        dt: the step, s.

    Returns:
        `State` whose leaves have shape (periods * steps per period,).

    Raises:
        ValueError: steps cannot run the scenario.

    Examples:
        >>> import pcjax
        >>> scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> path = pcjax.trajectory(scenario, seed=0, trial=3, dt=0.02)
        >>> path.position.x.shape
        (500,)
        >>> bool((path.position.y > 24.9).all())  # never below the palm
        True
    """
    check_can_step(scenario)
    drive = scenario.drive
    engine = Stepping(dt)
    key = trial_key(seed, trial)
    world = scenario.world()
    step_taken = engine.step_taken(drive.period)

    def period(carry: tuple[State, Array], k: Array) -> tuple[tuple[State, Array], State]:
        state, before = carry
        draws = period_draws(key, k, drive.targets_per_period)
        profile = drive.profile(before, draws, k == 0)

        def one(state: State, _: None) -> tuple[State, State]:
            state = advance(world, profile, state, step_taken)
            return state, state

        state, states = jax.lax.scan(
            one, with_clock_at_zero(state), length=engine.steps_per_period(drive.period)
        )
        return (state, draws), states

    start = begin(scenario, start_draws(key, scenario.draws_for_start))
    blank = jnp.zeros(drive.targets_per_period)
    _, states = jax.lax.scan(period, (start, blank), jnp.arange(periods))
    return jax.tree.map(lambda leaf: leaf.reshape(-1), states)
