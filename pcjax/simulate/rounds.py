"""What is compiled: a block of lanes, taken through some of their periods."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp

from pcjax.geometry import where
from pcjax.model.scenario import Scenario
from pcjax.physics.state import RUNNING
from pcjax.physics.step import begin
from pcjax.simulate.cloud import Cloud
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.lanes import Lanes, Program, lane_axes
from pcjax.simulate.relaxation import NOWHERE, Excursion


def advance_block(
    *,
    program: Program,
    stacked: Scenario,
    seed: jax.Array,
    last_period: jax.Array,
    cloud: Cloud | None,
    lanes: Lanes,
) -> Lanes:
    """One call of the program's `rounds` for a block of lanes."""
    scenarios = jax.tree.map(lambda leaf: leaf[lanes.condition] if leaf.ndim else leaf, stacked)
    axes = lane_axes(scenarios)
    worlds = jax.vmap(lambda scenario: scenario.world(), in_axes=(axes,))(scenarios)
    worlds = replace(worlds, drive=scenarios.drive)  # with what all lanes share as one number
    starts = None if cloud is None else jax.tree.map(lambda leaf: leaf[lanes.trial], cloud)

    def next_period(scenario: Scenario, lane: Lanes, start: Cloud | None) -> tuple[Lanes, Any]:
        drive = scenario.drive
        over = (lane.time >= drive.period) & (lane.period < last_period)
        over = over & (lane.state.status == RUNNING)
        period = lane.period + over.astype(lane.period.dtype)
        key = trial_key(seed, lane.trial)
        fresh = over & (period == 0)
        if start is None:
            state = begin(scenario, start_draws(key, scenario.draws_for_start))
        else:
            state = start.state_in(scenario)
        none = jnp.zeros_like(lane.time)
        first = state, Excursion(none + NOWHERE, none, none)
        state, excursion = where(fresh, first, (lane.state, lane.excursion))
        ends_first = over & (period == 1)
        peak = jnp.where(ends_first, excursion.peak, excursion.first_peak)
        lane = lane._replace(
            period=period,
            time=jnp.where(over, 0.0, lane.time),
            state=replace(state, clock=lane.state.clock),  # which stays the same for all lanes
            excursion=replace(excursion, first_peak=peak),
        )
        before = period_draws(key, jnp.maximum(period - 1, 0), drive.targets_per_period)
        draws = period_draws(key, period, drive.targets_per_period)
        if start is not None:
            before = jnp.where(period == 0, start.draws, before)
        return lane, drive.profile(before, draws, (period == 0) & (start is None))

    def round(_: Any, lanes: Lanes) -> Lanes:
        each = lane_axes(lanes)
        begun = jax.vmap(next_period, in_axes=(axes, each, 0), out_axes=(each, 0))
        lanes, profiles = begun(scenarios, lanes, starts)
        return program.run(worlds, profiles, lanes)

    if program.rounds == 1:
        return round(0, lanes)
    return jax.lax.fori_loop(0, program.rounds, round, lanes)


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
