"""Where in a hand objects stay, and from where they escape."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from pcjax.checks import check_count
from pcjax.geometry import Vec
from pcjax.model.scenario import Scenario, usual_max_steps
from pcjax.physics.state import PAPER_DT, PASSED
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.engine import Engine
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.outcomes import STATUS_NAMES
from pcjax.simulate.track import Track

TRIALS = 200
"""Trials unless a number is given: enough for a picture."""

CELLS = 101
"""Cells along the longer side of the grid unless a number is given. What rests on a limb of round
numbers is not on the line between two of them."""

_LOOKS = 50
"""How often in a period of the drive it is looked where the object is."""

_REST = 5
"""Looks in a row at which an object is slow that make a rest, a tenth of a period."""

_SLOW = 0.01
"""Contact radii in a tenth of a period: what goes no faster is slow."""


@dataclass(frozen=True)
class Occupancy:
    """Where objects stay in a hand, and from where they escape; made by `occupancy`.

    Attributes:
        scenario: the condition.
        seed, max_steps: as for `pcjax.evaluate`.
        engine: what ran the trials, with its parameters.
        trials: how many there were.
        first: the number of the first of them.
        status: how many of them ended as "passed" (escaped), "limit" and "invalid".
        seconds: s that the object's centre spent in each cell, over all trials until each ended,
            those that went wrong included; the first row is the lowest.
        extent: x0, x1, y0, y1 of the grid in the hand frame, lengths. Its cells are squares.
        escaped: numbers of the trials that escaped, in order.
        origins: where each of these last rested, the centre in the hand frame, lengths. A rest is a
            tenth of a period of the drive, or more, at no more than a hundredth of the contact
            radius in that time, as seen from the hand. One that never rested has been at rest at
            its start only, and that is its origin.
        rested: which of these have rested since their start.
    """

    scenario: Scenario
    seed: int
    max_steps: int
    engine: str
    trials: int
    first: int
    status: Mapping[str, int]
    seconds: Float[np.ndarray, "rows columns"]
    extent: tuple[float, float, float, float]
    escaped: Int[np.ndarray, " escapes"]
    origins: Float[np.ndarray, "escapes 2"]
    rested: Bool[np.ndarray, " escapes"]

    @property
    def share(self) -> Float[np.ndarray, "rows columns"]:
        """Share of the time spent in each cell; all of them sum to 1."""
        return self.seconds / self.seconds.sum()

    @property
    def cell(self) -> float:
        """Side of a cell, a length."""
        return (self.extent[1] - self.extent[0]) / self.seconds.shape[1]

    def joined(self, more: Occupancy) -> Occupancy:
        """With further trials of the same condition, so that a picture can grow.

        Raises:
            ValueError: those of another seed, limit or grid, or that do not follow on these.
        """
        if more.first != self.first + self.trials:
            raise ValueError(
                f"trials from number {more.first} on do not follow on those up to number "
                f"{self.first + self.trials - 1}"
            )
        for name in ("seed", "max_steps", "engine", "extent"):
            mine, theirs = getattr(self, name), getattr(more, name)
            if mine != theirs:
                raise ValueError(f"occupancies of different {name}: {mine!r} and {theirs!r}")
        if self.seconds.shape != more.seconds.shape:
            raise ValueError("occupancies on different grids")
        return replace(
            self,
            trials=self.trials + more.trials,
            status={name: count + more.status[name] for name, count in self.status.items()},
            seconds=self.seconds + more.seconds,
            escaped=np.concatenate([self.escaped, more.escaped]),
            origins=np.concatenate([self.origins, more.origins]),
            rested=np.concatenate([self.rested, more.rested]),
        )


def occupancy(
    scenario: Scenario,
    *,
    trials: int = TRIALS,
    first: int = 0,
    max_steps: int | None = None,
    seed: int = 0,
    engine: str | Engine = "auto",
    dt: float | None = None,
    precision: int = 32,
    cells: int = CELLS,
    progress: bool = False,
) -> Occupancy:
    """Where in a hand an object's centre stays, and from where it escapes.

    Fifty times in every period of the drive, in the middles of equal intervals, it is looked where
    each object is, until its trial ends: every moment counts the same, however busy or quiet. Where
    it is follows from the engine's own states: between two of them motion is taken at constant
    acceleration, or, by fixed steps, straight for a fiftieth of a period.

    Arguments:
        scenario: the condition, from `pcjax.does` or `pcjax.eoen`.
        trials, first: trials `first` to `first + trials - 1`: those of `pcjax.evaluate`.
        max_steps: limit in steps of 0.001 s; the paper's unless given.
        seed, engine, dt, precision: as for `pcjax.evaluate`.
        cells: of the grid along the longer side of what limbs and goal line enclose.
        progress: whether to show a progress bar on stderr.

    Raises:
        ValueError: what `pcjax.evaluate` refuses, an engine that does not tell where its trials
            are, a number of cells out of range, or trials too short for a look.

    Examples:
        >>> import pcjax
        >>> scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> found = pcjax.occupancy(scenario, trials=64, max_steps=20_000)
        >>> found.extent
        (-250.0, 250.0, 0.0, 500.0)
        >>> print(f"{found.share.sum():.3f}")
        1.000
        >>> len(found.origins) == found.status["passed"]
        True
    """
    check_count("cells", cells, 1, 2000)
    if scenario.dimensions != 2:
        raise ValueError(
            "where objects stay is drawn of hands in the plane, and this one is in three dimensions"
        )
    scenario.check()
    chosen = choose_engine(engine, dt, scenario)
    limit = usual_max_steps(scenario.body, scenario.drive) if max_steps is None else max_steps
    check_count("trials", trials, 1, 2**31 - 1)
    tally = _Tally(scenario, trials, first, limit, cells)
    outcomes = run(
        [scenario],
        trials=trials,
        first=first,
        max_steps=limit,
        seed=seed,
        engine=chosen,
        precision=precision,
        progress=progress,
        follower=tally,
    )
    if not tally.counts.any():
        raise ValueError(
            f"no trial lasts for {tally.interval / 2:g} s, when it is first looked where it is: "
            "nothing is seen"
        )
    status = outcomes.status[0]
    passed = np.flatnonzero(status == PASSED)
    return Occupancy(
        scenario,
        seed,
        limit,
        chosen.provenance,
        trials,
        first,
        {name: int((status == kind).sum()) for kind, name in STATUS_NAMES.items()},
        tally.counts.reshape(tally.shape) * tally.interval,
        tally.extent,
        first + passed,
        tally.resting_place[passed],
        tally.rested[passed],
    )


class _Tally:
    """Counts looks by cell, and keeps where each trial last rested.

    Arguments:
        scenario: the condition.
        trials, first: which trials.
        max_steps: after which no look counts.
        cells: along the grid's longer side.
    """

    def __init__(self, scenario: Scenario, trials: int, first: int, max_steps: int, cells: int):
        self.extent, self.shape = _grid(scenario, cells)
        self._period = float(scenario.drive.period)
        self.interval = self._period / _LOOKS
        self._slow = _SLOW * float(scenario.contact_radius) / (0.1 * self._period)
        self._last = _looks_before(np.array([max_steps * PAPER_DT]), self.interval)
        self._first = first
        self._lock = threading.Lock()
        self.counts = np.zeros(self.shape[0] * self.shape[1], np.int64)
        self.resting_place = np.zeros((trials, 2))
        self.rested = np.zeros(trials, bool)
        self._slow_so_far = np.zeros(trials, np.int64)

    def follow(self, lanes: Lanes, track: Track, ran: Bool[np.ndarray, " lanes"]) -> None:
        """Counts what happened in one call."""
        trial = np.asarray(lanes.trial)[ran] - self._first
        time = np.asarray(track.period)[:, ran] * self._period + np.asarray(track.time)[:, ran]
        place = _as_array(track.position)[:, :, ran]
        begins = time[0] == 0
        self.resting_place[trial[begins]] = place[:, 0, begins].T
        looks = np.minimum(_looks_before(time, self.interval), self._last)
        # By lane, then by leg between two points, then by look: the order of each trial's time.
        count = np.diff(looks, axis=0).T.ravel()
        leg = np.repeat(np.arange(count.size), count)
        lane, row = np.divmod(leg, len(time) - 1)
        nth = np.arange(leg.size) - np.repeat(np.cumsum(count) - count, count)
        back = time[row + 1, lane] - (looks[row, lane] + nth + 0.5) * self.interval
        lasts = time[row + 1, lane] - time[row, lane]
        there = place[:, row + 1, lane]
        mean = speed = (there - place[:, row, lane]) / lasts
        if track.velocity is not None:
            speed = _as_array(track.velocity)[:, :, ran][:, row + 1, lane]
        pull = 2.0 * (speed - mean) / lasts
        there = there - (speed - 0.5 * pull * back) * back
        self._count(there)
        self._look_for_rests(trial, lane, there, np.hypot(*(speed - pull * back)) <= self._slow)

    def _count(self, there: Float[np.ndarray, "2 looks"]) -> None:
        x0, x1, y0, y1 = self.extent
        rows, columns = self.shape
        with np.errstate(invalid="ignore"):
            column = np.floor((there[0] - x0) / (x1 - x0) * columns)
            row = np.floor((there[1] - y0) / (y1 - y0) * rows)
            # What is beside the grid, or nowhere, has gone wrong.
            known = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        cell = (row[known] * columns + column[known]).astype(np.int64)
        with self._lock:
            self.counts += np.bincount(cell, minlength=self.counts.size)

    def _look_for_rests(
        self,
        trial: Int[np.ndarray, " lanes"],
        lane: Int[np.ndarray, " looks"],
        there: Float[np.ndarray, "2 looks"],
        slow: Bool[np.ndarray, " looks"],
    ) -> None:
        """Keeps each trial's last rest. No other thread has these trials."""
        if lane.size == 0:
            return
        index = np.arange(lane.size)
        begins = np.searchsorted(lane, np.arange(trial.size))
        ends = np.searchsorted(lane, np.arange(trial.size), side="right")
        # How many looks in a row, this one included, have found it slow.
        moved = np.maximum.accumulate(np.where(slow, -1, index))
        unbroken = moved < begins[lane]
        run = np.where(
            unbroken, index - begins[lane] + 1 + self._slow_so_far[trial[lane]], index - moved
        )
        found = np.flatnonzero(run >= _REST)
        latest = np.full(trial.size, -1)
        latest[lane[found]] = found  # of several the last is kept
        some = latest >= 0
        self.resting_place[trial[some]] = there[:, latest[some]].T
        self.rested[trial[some]] = True
        looked = ends > begins
        self._slow_so_far[trial[looked]] = run[ends[looked] - 1]


def _as_array(vector: Vec) -> Float[np.ndarray, "2 points lanes"]:
    return np.stack([vector.x, vector.y]).astype(float)


def _looks_before(time: Float[np.ndarray, "..."], interval: float) -> Int[np.ndarray, "..."]:
    """How many looks, in the middles of intervals, there are before a time, s."""
    return np.ceil(time / interval - 0.5).astype(np.int64)


def _grid(
    scenario: Scenario, cells: int
) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    """Extent, and rows and columns, of square cells over what limbs and goal line enclose."""
    with jax.enable_x64(True):
        corners = jax.device_get(jax.tree.map(float, scenario.hand).region())
    points = np.array([[corner.x, corner.y] for corner in corners], float)
    low, high = points.min(axis=0), points.max(axis=0)
    size = (high - low).max() / cells
    columns, rows = np.maximum(np.ceil((high - low) / size - 1e-6), 1).astype(int).tolist()
    # Whole cells, in the middle of which the hand stays; without the last digits of its joints,
    # nor a minus before 0.
    middle, half = 0.5 * (low + high), 0.5 * size * np.array([columns, rows])
    digits = 9 - math.floor(math.log10(size))
    (x0, y0), (x1, y1) = (((middle + k * half).round(digits) + 0.0).tolist() for k in (-1, 1))
    return (x0, x1, y0, y1), (rows, columns)
