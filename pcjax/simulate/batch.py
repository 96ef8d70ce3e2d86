"""Many trials of many conditions: lanes in blocks of one size, refilled as trials end.

One compiled program advances a block of lanes by a period or more of the drive. A lane is one trial
of any one condition; between calls, lanes that have ended give their place to trials that wait.
Worker threads (one per core, or one per accelerator) share one supply of waiting trials, so all
cores stay busy and nobody waits for the slowest trial. What a trial does depends on
(seed, trial number, condition) alone, never on its neighbours in the block.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from pcjax.checks import check_count
from pcjax.compiling import roomy_size
from pcjax.components import shared_leaves, unfixed
from pcjax.model.scenario import Scenario
from pcjax.progress import progress_bar
from pcjax.simulate.cloud import Cloud
from pcjax.simulate.engine import Engine, How
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.outcomes import Outcomes
from pcjax.simulate.room import with_room
from pcjax.simulate.rounds import Program
from pcjax.simulate.track import Follower
from pcjax.simulate.workers import Ledger, advance_for, crew_of, work

_BLOCK = {"cpu": 1024}
_BLOCK_ON_ACCELERATOR = 65_536
"""Lanes per block. On a CPU a block's arrays have to fit in a core's cache; an accelerator needs
enough lanes to fill it."""

_SMALLEST_BLOCK = 64

_FEWEST_CONDITIONS = 64


def usual_block(trials: int, platform: str) -> int:
    """Lanes in the blocks of a worker that has so many trials to run on such a device.

    A CPU fills its blocks, one after the other; an accelerator takes one as fast as its quarter.
    """
    largest = _BLOCK.get(platform, _BLOCK_ON_ACCELERATOR)
    block = min(largest, roomy_size(trials, _SMALLEST_BLOCK))
    if platform == "cpu" and block > trials:
        block = max(block // 4, _SMALLEST_BLOCK)
    return block


def run(
    scenarios: Sequence[Scenario],
    *,
    trials: int,
    first: int = 0,
    max_steps: int,
    seed: int = 0,
    engine: Engine,
    precision: int = 32,
    block: int | None = None,
    workers: int | None = None,
    progress: bool = False,
    cloud: Cloud | None = None,
    keep_final: bool = False,
    follower: Follower | None = None,
) -> Outcomes:
    """Runs trials `first` to `first + trials - 1` of every scenario.

    Arguments:
        scenarios: conditions. Those of equal structure (numbers of limbs, kind of drive, period)
            share one compiled program; their numbers may differ.
        trials: trials per condition.
        first: number of the first; 0 with a cloud.
        max_steps: limit in steps of 0.001 s, whatever step the engine takes.
        seed: trial i depends on (seed, i) alone.
        engine: how a trial is run.
        precision: 32 or 64 bits.
        block: lanes per block; chosen for the device unless given.
        workers: threads on a CPU; one per core unless given.
        progress: whether to show a bar on stderr (where that is a terminal).
        cloud: where trials start instead of at the scenarios' starts, one place for each trial.
        keep_final: whether to keep where each trial was in the end.
        follower: who is told where the trials are on their way.

    Raises:
        ValueError: a count out of range, objects of which only some have an orientation, or a
            follower where the engine does not tell.
    """
    oriented = scenarios[0].body.oriented
    outcomes = Outcomes.blank(
        len(scenarios),
        trials,
        max_steps,
        watched=oriented,
        relaxed=engine.relaxed,
        final=keep_final,
    )
    check_count("seed", seed, 0, 2**32 - 1)
    check_count("first", first, 0, 2**31 - 1 - trials)
    if precision not in (32, 64):
        raise ValueError(f"precision is {precision!r}: it has to be 32 or 64 (bits)")
    if any(scenario.body.oriented != oriented for scenario in scenarios):
        raise ValueError(
            "some of the objects have an orientation and others have not: run them one after the "
            "other"
        )
    if follower is not None and not engine.tracks:
        raise ValueError(f"{engine.noun} does not tell where its trials are on their way")
    how = How(first, seed, precision, block, workers, progress, cloud, follower)
    engine.fill(outcomes, scenarios, how)
    return outcomes


class LaneEngine(Engine):
    """An engine that is a compiled program for blocks of lanes.

    Arguments:
        goal_layer: half width of the layer that the goal is spread over, in depths of the channel
            (see `relaxation`); None for the exact goal.
    """

    goal_layer: float | None = eqx.field(default=None, static=True, kw_only=True)

    @property
    def relaxed(self) -> bool:
        """Whether the goal is spread over a layer."""
        return self.goal_layer is not None

    def program(self, period: float) -> Program:
        """What is compiled, for periods of `period` seconds."""
        raise NotImplementedError

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s, for periods of `period` seconds."""
        raise NotImplementedError

    def fill(self, outcomes: Outcomes, scenarios: Sequence[Scenario], how: How) -> None:
        """Runs lanes in blocks, refilled as trials end."""
        self._fill(outcomes, with_room(scenarios), how)

    def _fill(self, outcomes: Outcomes, scenarios: Sequence[Scenario], how: How) -> None:
        loose = [unfixed(scenario) for scenario in scenarios]
        shared: dict[Any, Any] = {}
        kinds: dict[Any, list[int]] = {}
        for k, scenario in enumerate(loose):
            leaves, structure = jax.tree.flatten(scenario)
            if structure not in shared:
                shared[structure] = shared_leaves(scenario)
            which = jax.tree.leaves(shared[structure])
            common = tuple(itertools.compress(leaves, which))
            kinds.setdefault((structure, common), []).append(k)
        if len(kinds) > 1:
            for chosen in kinds.values():
                part = outcomes.of(chosen)
                self._fill(part, [scenarios[k] for k in chosen], how)
                outcomes.put(chosen, part)
            return
        dtype = np.float32 if how.precision == 32 else np.float64
        # The compiled program depends on how many conditions there are: of a few numbers only.
        spare = roomy_size(len(scenarios), _FEWEST_CONDITIONS) - len(scenarios)
        filled = [*scenarios, *[scenarios[0]] * spare]
        loose += loose[:1] * spare

        def stack(is_shared: bool, *leaves: Any) -> np.ndarray:
            return np.asarray(leaves[0] if is_shared else leaves, dtype)

        stacked = jax.tree.map(stack, shared[jax.tree.structure(loose[0])], *loose)
        period = scenarios[0].drive.period
        program = self.program(period)
        devices = jax.local_devices()
        platform = devices[0].platform
        crew = crew_of(devices, how.workers)
        total = outcomes.steps.size
        block = how.block
        if block is None:
            block = usual_block(-(-total // len(crew)), platform)
        check_count("block", block, 1, 2**24)
        seconds = functools.partial(self.seconds, period=period)
        ledger = Ledger(filled, seconds, outcomes, how.first)
        advance = functools.partial(
            advance_for(platform, how.follower is not None),
            program=jax.tree.map(
                lambda n: np.int32(n) if isinstance(n, int) else dtype(n), program
            ),
            stacked=stacked,
            seed=np.uint32(how.seed),
            last_period=np.int32(ledger.last_period),
            cloud=jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), how.cloud),
        )
        with (
            progress_bar(total=total, desc="trials", unit="trial", shown=how.progress) as bar,
            ThreadPoolExecutor(len(crew)) as pool,
        ):
            ledger.on_end = bar.update
            jobs = [
                pool.submit(
                    work, ledger, advance, block, dtype, how.precision, device, how.follower
                )
                for device in crew
            ]
            try:
                done, _ = wait(jobs, return_when=FIRST_EXCEPTION)
            finally:
                ledger.stopped.set()
            for job in done:
                job.result()
