"""Worker threads that share one supply of waiting trials, and the compiled program they call."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from pcjax.checks import check_count
from pcjax.compiling import Kept
from pcjax.geometry import stacked
from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID, PAPER_DT, PASSED, RUNNING
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.outcomes import LIMIT, Outcomes, paper_steps
from pcjax.simulate.rounds import advance_block, track_block
from pcjax.simulate.track import Follower

_COMPILER_OPTIONS = {
    # Each worker thread runs its own block; XLA splitting small kernels among threads costs more
    # than it brings.
    "cpu": {"xla_cpu_multi_thread_eigen": False, "xla_cpu_prefer_vector_width": 512},
}


def crew_of(devices: Sequence[Any], workers: int | None) -> list[Any]:
    """The device that each worker thread uses."""
    if devices[0].platform != "cpu":
        return list(devices)
    if workers is None:
        # Cores that this process may use, where the system tells.
        affinity = getattr(os, "sched_getaffinity", None)
        workers = len(affinity(0)) if affinity else os.cpu_count() or 1
    check_count("workers", workers, 1, 4096)
    return [devices[k % len(devices)] for k in range(workers)]


class Ledger:
    """The trials that wait and the results so far, shared by the workers.

    Arguments:
        scenarios: of one structure.
        seconds: how long each trial of some lanes has lasted, s.
        outcomes: to be filled in.
        first: number of the first trial.
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        seconds: Callable[[Lanes], np.ndarray],
        outcomes: Outcomes,
        first: int,
    ) -> None:
        self._regions = None if outcomes.excursion is not None else _regions(scenarios)
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
        self._seconds = seconds
        self._period = scenarios[0].drive.period
        self.last_period = -(-outcomes.max_steps // round(self._period / PAPER_DT)) - 1

    def enter(self) -> None:
        with self._lock:
            self._busy += 1

    def fill(self, lanes: Lanes) -> bool:
        """Gives the lanes that have ended to waiting trials; False if the worker may go home.

        A worker with less than half a block left and nothing waiting hands its trials to another.
        """
        status = np.asarray(lanes.state.status)
        with self._lock:
            free = np.flatnonzero(status != RUNNING)
            while self._suspended and len(free):
                waiting = self._suspended.pop()
                count = min(len(free), len(waiting.trial))
                theirs = jax.tree.leaves(_some(waiting, np.arange(count)))
                for mine, other in zip(jax.tree.leaves(lanes), theirs, strict=True):
                    _put(mine, free[:count], other)
                if count < len(waiting.trial):
                    rest = np.arange(count, len(waiting.trial))
                    self._suspended.append(_some(waiting, rest))
                free = free[count:]
            count = min(len(free), self._outcomes.steps.size - self._next)
            fresh = self._next + np.arange(count)
            self._next += count
            into = free[:count]
            # All conditions of one trial follow each other: they end at different times, so a
            # block keeps a mixture of short and long trials.
            row, condition = np.divmod(fresh, len(self._outcomes.steps))
            _put(lanes.condition, into, condition)
            _put(lanes.trial, into, self._first + row)
            _put(lanes.period, into, -1)
            _put(lanes.time, into, np.inf)
            _put(status, into, RUNNING)
            running = np.flatnonzero(status == RUNNING)
            if len(running) > len(lanes.trial) // 2 or self._busy == 1:
                return len(running) > 0
            if len(running):
                self._suspended.append(_some(lanes, running))
            self._busy -= 1
            return False

    def collect(self, lanes: Lanes, ran: np.ndarray) -> None:
        """Takes down which of the trials that `ran` in the last call have ended."""
        state, status = lanes.state, np.asarray(lanes.state.status)
        steps = paper_steps(self._seconds(lanes))
        late = (status == PASSED) & (steps > self._max_steps)
        all_over = (lanes.period >= self.last_period) & (lanes.time >= self._period)
        out_of_time = (status == RUNNING) & all_over
        status[ran & (late | out_of_time)] = LIMIT
        self._look_after(lanes, np.flatnonzero(ran & out_of_time))
        ended = np.flatnonzero(ran & (status != RUNNING))
        where_to = lanes.condition[ended], lanes.trial[ended] - self._first
        with self._lock:
            self._outcomes.status[where_to] = status[ended]
            self._outcomes.steps[where_to] = np.minimum(steps[ended], self._max_steps)
            if self._outcomes.watch is not None:
                watch = np.stack(jax.tree.leaves(state.watch), axis=-1)
                self._outcomes.watch[where_to] = watch[ended]
            if self._outcomes.excursion is not None:
                far = lanes.excursion
                first = np.where(lanes.period == 0, far.peak, far.first_peak)
                excursion = np.stack([far.peak, first, far.survival_time], axis=-1)
                self._outcomes.excursion[where_to] = excursion[ended]
            if self._outcomes.final is not None:
                final = np.stack(jax.tree.leaves((state.position, state.velocity)), axis=-1)
                self._outcomes.final[where_to] = final[ended]
            self.on_end(len(ended))

    def _look_after(self, lanes: Lanes, held: np.ndarray) -> None:
        """Makes trials that count as held INVALID where the object is not in the hand."""
        if self._regions is None or len(held) == 0:
            return
        condition = lanes.condition[held]
        points = np.stack(jax.tree.leaves(lanes.state.position), axis=-1)[held]
        outside = _how_far_outside(points.astype(float), self._regions[condition])
        _put(lanes.state.status, held[outside > _STRAY * self._radii[condition]], INVALID)


def _put(array: Any, where: np.ndarray, values: Any) -> None:
    """Writes into an array of lanes; what all lanes share stays."""
    if array.ndim:
        array[where] = values


def _some(lanes: Lanes, chosen: np.ndarray) -> Lanes:
    return jax.tree.map(lambda leaf: leaf[chosen] if leaf.ndim else leaf, lanes)


_STRAY = 0.01
"""How far, in radii, an object that is held may be beyond the goal line by rounding."""


def _regions(scenarios: Sequence[Scenario]) -> Float[np.ndarray, "conditions corners 2"]:
    """What limbs and goal line enclose in each condition."""
    corners = stacked([jax.tree.map(float, scenario.hand) for scenario in scenarios]).region()
    return np.stack([[corner.x, corner.y] for corner in corners]).transpose(2, 0, 1)


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


def work(
    ledger: Ledger,
    advance: Callable[..., Any],
    block: int,
    dtype: type,
    precision: int,
    device: Any,
    follower: Follower | None,
) -> None:
    lanes = Lanes.idle(block, dtype)
    ledger.enter()
    with jax.enable_x64(precision == 64), jax.default_device(device):
        while not ledger.stopped.is_set() and ledger.fill(lanes):
            ran = np.asarray(lanes.state.status) == RUNNING
            moved = jax.device_get(advance(lanes=lanes))
            if follower is not None:
                moved, track = moved
                follower.follow(moved, track, ran)
            lanes = jax.tree.map(np.array, moved)
            ledger.collect(lanes, ran)


@functools.cache
def advance_for(platform: str, tracked: bool = False) -> Callable[..., Any]:
    block = track_block if tracked else advance_block
    return Kept(block, _COMPILER_OPTIONS.get(platform, {}))
