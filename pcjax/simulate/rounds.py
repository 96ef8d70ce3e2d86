"""What is compiled: a block of lanes, taken some way through their trials."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Key

from pcjax.geometry import where
from pcjax.model.scenario import Scenario, World
from pcjax.physics.state import RUNNING, State
from pcjax.physics.step import begin
from pcjax.simulate.cloud import Cloud
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.lanes import Lanes, lane_axes
from pcjax.simulate.relaxation import NOWHERE, Excursion
from pcjax.simulate.track import Track


class Trials(eqx.Module):
    """What a call of a compiled program knows of its lanes' trials.

    Attributes:
        scenarios: a batch; every leaf has the lanes as its first axis, but for those that all lanes
            share, which have none.
        worlds: their kinematics, in the same form.
        keys: the trials'.
        last_period: the last one that a trial may begin.
        starts: where they start, if not at the scenarios' starts.
    """

    scenarios: Scenario
    worlds: World
    keys: Key[Array, " lanes"]
    last_period: Int[Array, ""]
    starts: Cloud | None

    @property
    def count(self) -> int:
        """Draws in a period."""
        return self.scenarios.drive.targets_per_period

    def begun(self, lanes: Lanes) -> Lanes:
        """The lanes, of which those whose trial is about to begin are at its start."""
        fresh = (lanes.state.status == RUNNING) & (lanes.period < 0)

        def first(scenario: Scenario, key: jax.Array, start: Cloud | None) -> State:
            if start is None:
                return begin(scenario, start_draws(key, scenario.draws_for_start))
            return start.state_in(scenario)

        axes = lane_axes(self.scenarios), 0, 0
        states = jax.vmap(first, in_axes=axes)(self.scenarios, self.keys, self.starts)
        state = where(fresh, replace(states, clock=lanes.state.clock), lanes.state)
        none = jnp.zeros_like(lanes.time)
        return lanes._replace(
            period=jnp.where(fresh, 0, lanes.period),
            time=jnp.where(fresh, 0.0, lanes.time),
            # All lanes share the clock.
            state=replace(state, clock=lanes.state.clock),
            excursion=where(fresh, Excursion(none + NOWHERE, none, none), lanes.excursion),
        )

    def draws(self, period: Int[Array, " lanes"]) -> Float[Array, "lanes targets"]:
        """Of the drives' targets in a period; before the first, those that the starts know."""
        drawn = jax.vmap(period_draws, (0, 0, None))(self.keys, jnp.maximum(period, 0), self.count)
        if self.starts is None:
            return drawn
        return jnp.where((period < 0)[:, None], self.starts.draws, drawn)

    def profiles(
        self,
        before: Float[Array, "lanes targets"],
        draws: Float[Array, "lanes targets"],
        first: Bool[Array, " lanes"] | bool,
    ) -> Any:
        """The drives' motions in a period."""
        drives = self.scenarios.drive
        first = jnp.broadcast_to(jnp.asarray(first) & (self.starts is None), draws.shape[:1])
        return jax.vmap(
            lambda drive, *drawn: drive.profile(*drawn), in_axes=(lane_axes(drives), 0, 0, 0)
        )(drives, before, draws, first)


@runtime_checkable
class Program(Protocol):
    """An engine as it is compiled: a pytree, whose numbers are traced."""

    def run(self, trials: Trials, lanes: Lanes) -> Lanes:
        """Takes lanes some way through their trials.

        Arguments:
            trials: what is known of them.
            lanes: those with another status than RUNNING, and those at the end of their last
                period, stay as they are.
        """
        ...


@runtime_checkable
class TrackedProgram(Program, Protocol):
    """One that can tell where trials were on their way."""

    def track(self, trials: Trials, lanes: Lanes) -> tuple[Lanes, Track]:
        """As `run`, and where the lanes were."""
        ...


class Tracked(eqx.Module):
    """A program that runs and tracks by one and the same code."""

    def advanced(
        self, trials: Trials, lanes: Lanes, *, tracked: bool
    ) -> tuple[Lanes, Track | None]:
        """What `run` gives, and what `track` gives beside it if they are tracked."""
        raise NotImplementedError

    def run(self, trials: Trials, lanes: Lanes) -> Lanes:
        """Takes lanes some way through their trials."""
        return self.advanced(trials, lanes, tracked=False)[0]

    def track(self, trials: Trials, lanes: Lanes) -> tuple[Lanes, Track]:
        """As `run`, and where the lanes were."""
        lanes, track = self.advanced(trials, lanes, tracked=True)
        assert track is not None
        return lanes, track


def advance_block(
    *,
    program: Program,
    stacked: Scenario,
    seed: jax.Array,
    last_period: jax.Array,
    cloud: Cloud | None,
    lanes: Lanes,
) -> Lanes:
    """One call of the program for a block of lanes."""
    return program.run(_trials_of(stacked, seed, last_period, cloud, lanes), lanes)


def track_block(
    *,
    program: TrackedProgram,
    stacked: Scenario,
    seed: jax.Array,
    last_period: jax.Array,
    cloud: Cloud | None,
    lanes: Lanes,
) -> tuple[Lanes, Track]:
    """As `advance_block`, and where the lanes were."""
    return program.track(_trials_of(stacked, seed, last_period, cloud, lanes), lanes)


def _trials_of(
    stacked: Scenario,
    seed: jax.Array,
    last_period: jax.Array,
    cloud: Cloud | None,
    lanes: Lanes,
) -> Trials:
    scenarios = jax.tree.map(lambda leaf: leaf[lanes.condition] if leaf.ndim else leaf, stacked)
    axes = lane_axes(scenarios)
    worlds = jax.vmap(lambda scenario: scenario.world(), in_axes=(axes,))(scenarios)
    worlds = replace(worlds, drive=scenarios.drive)  # with what all lanes share as one number
    starts = None if cloud is None else jax.tree.map(lambda leaf: leaf[lanes.trial], cloud)
    keys = jax.vmap(trial_key, (None, 0))(seed, lanes.trial)
    return Trials(scenarios, worlds, keys, last_period, starts)


def roll(
    program: Program,
    stacked: Scenario,
    seed: jax.Array,
    periods: int,
    lanes: Lanes,
) -> Lanes:
    """Runs lanes to their ends, or through that many periods, within one compiled program.

    `run` is faster, since here a block waits for its slowest trial. This one can be differentiated,
    forwards, with respect to every leaf of `stacked`.

    Arguments:
        program: of an engine, for the drive's periods.
        stacked: the conditions, every leaf with the conditions as its first axis.
        seed: trial i depends on (seed, i) alone.
        periods: of the drive.
        lanes: from `Lanes.fresh`.
    """

    def going(lanes: Lanes) -> jax.Array:
        over = (lanes.period >= periods - 1) & (lanes.time >= stacked.drive.period)
        return jnp.any((lanes.state.status == RUNNING) & ~over)

    def advance(lanes: Lanes) -> Lanes:
        return advance_block(
            program=program,
            stacked=stacked,
            seed=seed,
            last_period=jnp.asarray(periods - 1, jnp.int32),
            cloud=None,
            lanes=lanes,
        )

    return jax.lax.while_loop(going, advance, lanes)
