"""Many trials of many conditions: lanes in blocks of one size, refilled as trials end.

One compiled program advances a block of lanes by a period or more of the drive. A lane is one trial
of any one condition; between calls, lanes that have ended give their place to trials that wait.
Worker threads (one per core, or one per accelerator) share one supply of waiting trials, so all
cores stay busy and nobody waits for the slowest trial. What a trial does depends on
(seed, trial number, condition) alone, never on its neighbours in the block.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float32, Int32, UInt8
from tqdm.auto import tqdm

from pcjax.checks import check_count
from pcjax.engines.cloud import Cloud
from pcjax.engines.draws import period_draws, start_draws, trial_key
from pcjax.engines.lanes import Engine, Lanes, with_progress, with_states
from pcjax.engines.relaxation import NOWHERE, Progress
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import Scenario
from pcjax.physics.step import INVALID, PAPER_DT, PASSED, RUNNING, begin
from pcjax.planar import Vec

LIMIT = 3
"""Status of a trial that reached the step limit."""

STATUS_NAMES = {PASSED: "passed", LIMIT: "limit", INVALID: "invalid"}
"""What a trial can end as: through the goal, still there at the limit, or gone wrong."""

_BLOCK = {"cpu": 1024}
_BLOCK_ON_ACCELERATOR = 65_536
"""Lanes per block. On a CPU a block's arrays have to fit in a core's cache; an accelerator needs
enough lanes to fill it."""

_SMALLEST_BLOCK = 64

_FEWEST_CONDITIONS = 16

_COMPILER_OPTIONS = {
    # Each worker thread runs its own block; XLA splitting small kernels among threads costs more
    # than it brings.
    "cpu": {"xla_cpu_multi_thread_eigen": False, "xla_cpu_prefer_vector_width": 512},
}


@dataclass(frozen=True)
class Outcomes:
    """How every trial of every condition ended.

    Attributes:
        steps: the paper's step (of 0.001 s) in which the trial ended, at most `max_steps`.
        status: PASSED, LIMIT or INVALID (`STATUS_NAMES`).
        max_steps: the step limit.
        watch: for sticks, what `Watch` keeps of each trial.
        progress: where the goal is relaxed, the `Progress` of each trial: mark, first, held.
        final: if kept, where each trial was in the end: x, y, vx, vy.
    """

    steps: Int32[np.ndarray, "conditions trials"]
    status: UInt8[np.ndarray, "conditions trials"]
    max_steps: int
    watch: Float32[np.ndarray, "conditions trials 3"] | None = None
    progress: Float[np.ndarray, "conditions trials 3"] | None = None
    final: Float[np.ndarray, "conditions trials 4"] | None = None

    def put(self, conditions: Sequence[int], part: Outcomes) -> None:
        """Fills in the outcomes of some conditions, which were run on their own."""
        for name in ("steps", "status", "watch", "progress", "final"):
            whole = getattr(self, name)
            if whole is not None:
                whole[conditions] = getattr(part, name)

    @classmethod
    def blank(
        cls,
        conditions: int,
        trials: int,
        max_steps: int,
        *,
        watched: bool = False,
        relaxed: bool = False,
        final: bool = False,
    ) -> Outcomes:
        """Outcomes to be filled in.

        Arguments:
            watched: whether with a `watch`.
            relaxed: whether with `progress`.
            final: whether with `final`.

        Raises:
            ValueError: a count out of range.
        """
        check_count("trials", trials, 1, 2**31 - 1)
        check_count("max_steps", max_steps, 1, 2**31 - 1)
        shape = conditions, trials
        return cls(
            np.zeros(shape, np.int32),
            np.zeros(shape, np.uint8),
            max_steps,
            np.zeros((*shape, 3), np.float32) if watched else None,
            np.zeros((*shape, 3)) if relaxed else None,
            np.zeros((*shape, 4)) if final else None,
        )


def paper_steps(seconds: Any) -> Any:
    """In which of the paper's steps a time lies, counted from 1."""
    return np.maximum(np.ceil(seconds / PAPER_DT - 1e-6), 1)


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

    Raises:
        ValueError: a count out of range, or objects of which some turn and others do not.
    """
    turns = scenarios[0].body.turns
    outcomes = Outcomes.blank(
        len(scenarios),
        trials,
        max_steps,
        watched=turns,
        relaxed=engine.goal_layer is not None,
        final=keep_final,
    )
    check_count("seed", seed, 0, 2**32 - 1)
    check_count("first", first, 0, 2**31 - 1 - trials)
    if precision not in (32, 64):
        raise ValueError(f"precision is {precision!r}: it has to be 32 or 64 (bits)")
    if any(scenario.body.turns != turns for scenario in scenarios):
        raise ValueError("some of the objects turn and others do not: run them one after the other")
    kinds: dict[Any, list[int]] = {}
    for k, scenario in enumerate(scenarios):
        kinds.setdefault(jax.tree.structure(scenario), []).append(k)
    if len(kinds) > 1:
        for chosen in kinds.values():
            part = run(
                [scenarios[k] for k in chosen],
                trials=trials,
                first=first,
                max_steps=max_steps,
                seed=seed,
                engine=engine,
                precision=precision,
                block=block,
                workers=workers,
                progress=progress,
                cloud=cloud,
                keep_final=keep_final,
            )
            outcomes.put(chosen, part)
        return outcomes
    dtype = np.float32 if precision == 32 else np.float64
    # The compiled program depends on how many conditions there are: of a few numbers only.
    room = max(_FEWEST_CONDITIONS, 1 << (len(scenarios) - 1).bit_length())
    filled = [*scenarios, *[scenarios[0]] * (room - len(scenarios))]
    stacked = jax.tree.map(lambda *leaves: np.asarray(leaves, dtype), *filled)
    devices = jax.local_devices()
    platform = devices[0].platform
    crew = _crew(devices, workers)
    total = outcomes.steps.size
    if block is None:
        fair = -(-total // len(crew))
        largest = _BLOCK.get(platform, _BLOCK_ON_ACCELERATOR)
        block = min(largest, max(_SMALLEST_BLOCK, 1 << (fair - 1).bit_length()))
    check_count("block", block, 1, 2**24)
    ledger = _Ledger(scenarios, engine, outcomes, first)
    advance = functools.partial(
        _advance_for(platform),
        engine=engine,
        stacked=stacked,
        seed=np.uint32(seed),
        last_period=np.int32(ledger.last_period),
        cloud=None if cloud is None else jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), cloud),
    )
    with (
        tqdm(
            total=total,
            desc="trials",
            unit="trial",
            disable=None if progress else True,
            leave=False,
        ) as bar,
        ThreadPoolExecutor(len(crew)) as pool,
    ):
        ledger.on_end = bar.update
        jobs = [
            pool.submit(_work, ledger, advance, block, dtype, precision, device, 5 if turns else 0)
            for device in crew
        ]
        try:
            done, _ = wait(jobs, return_when=FIRST_EXCEPTION)
        finally:
            ledger.stopped.set()
        for job in done:
            job.result()
    return outcomes


def _crew(devices: Sequence[Any], workers: int | None) -> list[Any]:
    """The device that each worker thread uses."""
    if devices[0].platform != "cpu":
        return list(devices)
    if workers is None:
        # Cores that this process may use, where the system tells.
        affinity = getattr(os, "sched_getaffinity", None)
        workers = len(affinity(0)) if affinity else os.cpu_count() or 1
    check_count("workers", workers, 1, 4096)
    return [devices[k % len(devices)] for k in range(workers)]


class _Ledger:
    """The trials that wait and the results so far, shared by the workers."""

    def __init__(
        self, scenarios: Sequence[Scenario], engine: Engine, outcomes: Outcomes, first: int
    ) -> None:
        self._regions = None if engine.goal_layer is not None else _regions(scenarios)
        self._radii = np.array([float(scenario.body.radius) for scenario in scenarios])
        self._outcomes = outcomes
        self._first = first
        self.stopped = threading.Event()
        self.on_end: Callable[[int], Any] = lambda count: None
        self._lock = threading.Lock()
        self._next = 0
        self._suspended: list[Lanes] = []
        self._busy = 0
        self._max_steps = outcomes.max_steps
        self._engine = engine
        self._period = scenarios[0].drive.period
        self.last_period = -(-outcomes.max_steps // round(self._period / PAPER_DT)) - 1

    def enter(self) -> None:
        with self._lock:
            self._busy += 1

    def fill(self, lanes: Lanes) -> bool:
        """Gives the lanes that have ended to waiting trials; False if the worker may go home.

        A worker with less than half a block left and nothing waiting hands its trials to another.
        """
        with self._lock:
            free = np.flatnonzero(lanes.status != RUNNING)
            while self._suspended and len(free):
                waiting = self._suspended.pop()
                count = min(len(free), len(waiting.trial))
                for mine, theirs in zip(lanes, waiting, strict=True):
                    mine[free[:count]] = theirs[:count]
                if count < len(waiting.trial):
                    self._suspended.append(Lanes(*(a[count:] for a in waiting)))
                free = free[count:]
            count = min(len(free), self._outcomes.steps.size - self._next)
            fresh = self._next + np.arange(count)
            self._next += count
            into = free[:count]
            # All conditions of one trial follow each other: they end at different times, so a
            # block keeps a mixture of short and long trials.
            row, lanes.condition[into] = np.divmod(fresh, len(self._outcomes.steps))
            lanes.trial[into] = self._first + row
            lanes.period[into] = -1
            lanes.time[into] = np.inf
            lanes.status[into] = RUNNING
            running = np.flatnonzero(lanes.status == RUNNING)
            if len(running) > len(lanes.trial) // 2 or self._busy == 1:
                return len(running) > 0
            if len(running):
                self._suspended.append(Lanes(*(a[running] for a in lanes)))
            self._busy -= 1
            return False

    def collect(self, lanes: Lanes, ran: np.ndarray) -> None:
        """Takes down which of the trials that `ran` in the last call have ended."""
        seconds = self._engine.seconds(lanes, self._period)
        steps = paper_steps(seconds)
        late = (lanes.status == PASSED) & (steps > self._max_steps)
        all_over = (lanes.period >= self.last_period) & (lanes.time >= self._period)
        out_of_time = (lanes.status == RUNNING) & all_over
        lanes.status[ran & (late | out_of_time)] = LIMIT
        self._look_after(lanes, np.flatnonzero(ran & out_of_time))
        ended = np.flatnonzero(ran & (lanes.status != RUNNING))
        where_to = lanes.condition[ended], lanes.trial[ended] - self._first
        with self._lock:
            self._outcomes.status[where_to] = lanes.status[ended]
            self._outcomes.steps[where_to] = np.minimum(steps[ended], self._max_steps)
            if self._outcomes.watch is not None:
                self._outcomes.watch[where_to] = lanes.more[ended, 2:]
            if self._outcomes.progress is not None:
                first = np.where(lanes.period == 0, lanes.mark, lanes.first)
                progress = np.stack([lanes.mark, first, lanes.held], axis=-1)
                self._outcomes.progress[where_to] = progress[ended]
            if self._outcomes.final is not None:
                final = np.stack([lanes.x, lanes.y, lanes.vx, lanes.vy], axis=-1)
                self._outcomes.final[where_to] = final[ended]
            self.on_end(len(ended))

    def _look_after(self, lanes: Lanes, held: np.ndarray) -> None:
        """Makes trials that count as held INVALID where the object is not in the hand."""
        if self._regions is None or len(held) == 0:
            return
        condition = lanes.condition[held]
        points = np.stack([lanes.x[held], lanes.y[held]], axis=-1).astype(float)
        outside = _how_far_outside(points, self._regions[condition])
        lanes.status[held[outside > _STRAY * self._radii[condition]]] = INVALID


_STRAY = 0.01
"""How far, in radii, an object that is held may be beyond the goal line by rounding."""


def _regions(scenarios: Sequence[Scenario]) -> Float[np.ndarray, "conditions corners 2"]:
    """What limbs and goal line enclose in each condition."""
    stacked = jax.tree.map(lambda *leaves: np.asarray(leaves, float), *(s.hand for s in scenarios))
    with jax.enable_x64(True):
        corners = jax.device_get(_corners(stacked))
    return np.stack([[corner.x, corner.y] for corner in corners]).transpose(2, 0, 1)


@jax.jit
def _corners(hands: HandDesign) -> list[Vec]:
    zero = hands.palm_length * 0.0
    found = jax.vmap(HandDesign.region)(hands)
    return [corner + Vec(zero, zero) for corner in found]


def _how_far_outside(
    points: Float[np.ndarray, "n 2"], polygons: Float[np.ndarray, "n corners 2"]
) -> Float[np.ndarray, " n"]:
    """Distance of each point to its own polygon, 0 inside (even-odd rule)."""
    a, b = polygons, np.roll(polygons, -1, axis=1)
    along, to = b - a, points[:, None] - a
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
        x = a[..., 0] + to[..., 1] * along[..., 0] / along[..., 1]
    straddles = (a[..., 1] > points[:, None, 1]) != (b[..., 1] > points[:, None, 1])
    inside = (straddles & (points[:, None, 0] < x)).sum(axis=1) % 2 == 1
    distance = np.linalg.norm(to - np.nan_to_num(share)[..., None] * along, axis=-1).min(axis=1)
    return np.where(inside, 0.0, distance)


def _work(
    ledger: _Ledger,
    advance: Callable[..., Any],
    block: int,
    dtype: type,
    precision: int,
    device: Any,
    more: int,
) -> None:
    lanes = Lanes.idle(block, dtype, more)
    ledger.enter()
    with jax.enable_x64(precision == 64), jax.default_device(device):
        while not ledger.stopped.is_set() and ledger.fill(lanes):
            ran = lanes.status == RUNNING
            moved = jax.device_get(advance(lanes=lanes))
            lanes = Lanes(*(np.array(leaf) for leaf in moved))
            ledger.collect(lanes, ran)


@functools.cache
def _advance_for(platform: str) -> Callable[..., Any]:
    return jax.jit(
        _advance_block,
        static_argnames=("engine",),
        compiler_options=_COMPILER_OPTIONS.get(platform),
    )


def _advance_block(
    *,
    engine: Engine,
    stacked: Scenario,
    seed: jax.Array,
    last_period: jax.Array,
    cloud: Cloud | None,
    lanes: Lanes,
) -> Lanes:
    """One call of the engine's `rounds` for a block of lanes."""
    scenarios = jax.tree.map(lambda leaf: leaf[lanes.condition], stacked)
    worlds = jax.vmap(lambda scenario: scenario.world())(scenarios)
    starts = None if cloud is None else jax.tree.map(lambda leaf: leaf[lanes.trial], cloud)

    def next_period(scenario: Scenario, lane: Lanes, start: Cloud | None) -> tuple[Lanes, Any]:
        drive = scenario.drive
        over = (lane.time >= drive.period) & (lane.period < last_period)
        over = over & (lane.status == RUNNING)
        period = lane.period + over
        key = trial_key(seed, lane.trial)
        fresh = over & (period == 0)
        if start is None:
            state = begin(scenario, start_draws(key, scenario.draws_for_start))
        else:
            state = start.state_in(scenario)
        zero = jnp.zeros_like(lane.held)
        first = with_progress(with_states(lane, state), Progress(zero + NOWHERE, zero, zero))
        lane = jax.tree.map(lambda new, old: jnp.where(fresh, new, old), first, lane)
        lane = lane._replace(
            period=period,
            time=jnp.where(over, 0.0, lane.time),
            status=jnp.where(over, RUNNING, lane.status),
            first=jnp.where(over & (period == 1), lane.mark, lane.first),
        )
        before = period_draws(key, jnp.maximum(period - 1, 0), drive.targets_per_period)
        draws = period_draws(key, period, drive.targets_per_period)
        if start is not None:
            before = jnp.where(period == 0, start.draws, before)
        return lane, drive.swing(before, draws, (period == 0) & (start is None))

    def round(_: Any, lanes: Lanes) -> Lanes:
        lanes, swings = jax.vmap(next_period)(scenarios, lanes, starts)
        return engine.run(worlds, swings, lanes)

    if engine.rounds == 1:
        return round(0, lanes)
    return jax.lax.fori_loop(0, engine.rounds, round, lanes)


def roll(
    engine: Engine,
    stacked: Scenario,
    seed: jax.Array,
    periods: int,
    lanes: Lanes,
) -> Lanes:
    """Runs lanes to their ends, or through that many periods, within one compiled program.

    `run` is faster, since here a block waits for its slowest trial. This one can be differentiated,
    forwards, with respect to every leaf of `stacked`.

    Arguments:
        engine: how trials are run.
        stacked: the conditions, every leaf with the conditions as its first axis.
        seed: trial i depends on (seed, i) alone.
        periods: of the drive.
        lanes: from `Lanes.fresh`.
    """

    def going(lanes: Lanes) -> jax.Array:
        over = (lanes.period >= periods - 1) & (lanes.time >= stacked.drive.period)
        return jnp.any((lanes.status == RUNNING) & ~over)

    def advance(lanes: Lanes) -> Lanes:
        return _advance_block(
            engine=engine,
            stacked=stacked,
            seed=seed,
            last_period=jnp.asarray(periods - 1, jnp.int32),
            cloud=None,
            lanes=lanes,
        )

    return jax.lax.while_loop(going, advance, lanes)
