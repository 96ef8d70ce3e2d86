"""The engine for hands in three dimensions: MuJoCo's, many trials at once.

Ours are the draws, the drive, the start and the escape rule. What a trial does depends on
(seed, trial number, condition, step) alone: MuJoCo's batch gives the same bits for any number of
threads and any split. Contacts are as stiff as the step allows, since soft ones let an object
squeeze through gaps that are narrower than itself.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, Integer

from pcjax.components import quantity
from pcjax.importing import mujoco
from pcjax.model.scenario import Scenario
from pcjax.model.spatial.scenario import MisfitError, SpatialScenario
from pcjax.physics.state import INVALID, PAPER_DT, PASSED, RUNNING
from pcjax.progress import progress_bar
from pcjax.simulate.backends.crossing import Crossings, lengths
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.engine import Engine, How, register_engine
from pcjax.simulate.outcomes import LIMIT, Outcomes, paper_steps

_STEPS = (0.002, 0.001, 0.0005, 0.00025)
"""Steps that are chosen from, s."""

_GRAVITY_EVERY = 0.02
"""Seconds of a ramp for which gravity is that of their middle."""

_CHUNK = 250
"""Steps that are recorded at a time."""

_BLOCK = 1024
"""Trials at a time."""

_CHECKED = 0.1
"""The share of trials that is run at half the step, too."""

_STEPS_A_SECOND = 100_000
"""Of a core of 2023, for a forecast."""


@register_engine("mujoco")
class MuJoCo(Engine):
    """MuJoCo's rigid bodies.

    Arguments:
        dt: the step, s.
    """

    dt: float = quantity(
        "time", "the step", default=0.002, low=1e-5, high=0.01, key="dt", static=True
    )

    noun = "MuJoCo"
    summary = "hands in three dimensions"
    preference = 1.0
    dimensions = 3
    bits = 64

    @classmethod
    def suited(cls, scenarios: Sequence[Scenario]) -> MuJoCo:
        """With the longest step in which nothing falls by more than half the thickness of what it
        may fall on, nor by half of its own.

        Raises:
            MisfitError: a geom or the object is too thin for any step.
        """
        return cls(min(map(_step_for, scenarios)))

    def step_taken(self, period: float) -> float:
        """A whole number of them is a period."""
        return period / math.ceil(period / self.dt - 1e-9)

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """See `Engine`: as if no trial ended early."""
        return max_steps * PAPER_DT / self.dt / _STEPS_A_SECOND

    def second_opinion(self, scenario: Scenario, outcomes: Outcomes, how: How) -> dict[str, float]:
        """How many of the paper's steps later the first tenth of the trials end with half the step:
        the mean, its standard error, and of how many trials."""
        assert isinstance(scenario, SpatialScenario)
        count = math.ceil(_CHECKED * outcomes.steps.shape[1])
        again, status = run_trials(
            scenario,
            np.arange(count),
            max_steps=outcomes.max_steps,
            seed=how.seed,
            dt=0.5 * self.step_taken(scenario.drive.period),
            threads=how.workers,
        )
        valid = (status != INVALID) & (outcomes.status[0, :count] != INVALID)
        later = (again - outcomes.steps[0, :count])[valid].astype(float)
        if len(later) < 2:
            return {}
        return {
            "half_step_later": float(later.mean()),
            "half_step_se": float(later.std(ddof=1) / math.sqrt(len(later))),
            "half_step_trials": len(later),
        }

    def fill(self, outcomes: Outcomes, scenarios: Sequence[Scenario], how: How) -> None:
        """Runs one condition after the other."""
        total = outcomes.steps.size
        with progress_bar(total=total, desc="trials", unit="trial", shown=how.progress) as bar:
            for k, scenario in enumerate(scenarios):
                assert isinstance(scenario, SpatialScenario)
                for first in range(0, outcomes.steps.shape[1], _BLOCK):
                    mine = slice(first, first + _BLOCK)
                    count = outcomes.steps[k, mine].size
                    steps, status = run_trials(
                        scenario,
                        np.arange(count) + how.first + first,
                        max_steps=outcomes.max_steps,
                        seed=how.seed,
                        dt=self.step_taken(scenario.drive.period),
                        threads=how.workers,
                        on_end=bar.update,
                    )
                    outcomes.steps[k, mine], outcomes.status[k, mine] = steps, status


def _step_for(scenario: Scenario) -> float:
    assert isinstance(scenario, SpatialScenario)
    speed = scenario.drive.top_speed(scenario.seen().size)
    thin, half = scenario.thinnest()
    for dt in _STEPS:
        if speed * dt <= half:
            return dt
    raise MisfitError(
        "too thin for the shortest step",
        f"{thin} is {2000 * half:.3g} mm thick, and what falls through the hand moves "
        f"{1000 * speed * _STEPS[-1]:.3g} mm in the shortest step, so it may pass unseen: make it "
        "thicker, exclude it if it is of the hand, or ask for a smaller dt",
    )


@dataclass
class Film:
    """Where the object was in a trial, step for step.

    Attributes:
        states: place and unit quaternion in the hand's frame at the start and, in parts, after each
            step.
        targets: the drive's draws for each period.
        seconds: when it ended.
    """

    states: list[Float[np.ndarray, "steps 7"]] = field(default_factory=list)
    targets: list[Float[np.ndarray, " targets"]] = field(default_factory=list)
    seconds: float = math.nan


def run_trials(
    scenario: SpatialScenario,
    trials: Integer[np.ndarray, " trials"],
    *,
    max_steps: int,
    seed: int,
    dt: float,
    threads: int | None = None,
    on_end: Callable[[int], Any] = lambda count: None,
    film: Film | None = None,
) -> tuple[Integer[np.ndarray, " trials"], Integer[np.ndarray, " trials"]]:
    """In which of the paper's steps trials ended, and how.

    Arguments:
        scenario: the condition.
        trials: their numbers.
        max_steps: the limit, in steps of 0.001 s.
        seed: trial i depends on (seed, i) alone.
        dt: the step, s, a whole number of which is the drive's period.
        threads: one per core unless given.
        on_end: told how many more trials have ended.
        film: to be filled with where the object is, of one trial.
    """
    run = _Run(scenario, np.asarray(trials), seed, dt, max_steps * PAPER_DT, threads)
    if film is not None:
        film.states.append(run.states.copy())
    with _no_log():
        while run.going.size:
            before = run.going.size
            run.advance(film)
            on_end(before - run.going.size)
    if film is not None:
        film.seconds = float(run.seconds[0])
    return run.ends()


class _Run:
    """Some trials of a scenario on their way, all at the same time.

    Attributes:
        going: places, among the trials, of those that have not ended.
        states: where each was last seen.
        seconds: when each ended.
    """

    def __init__(
        self,
        scenario: SpatialScenario,
        trials: Integer[np.ndarray, " trials"],
        seed: int,
        dt: float,
        limit: float,
        threads: int | None,
    ):
        from mujoco.batch import Batch  # pyright: ignore[reportMissingImports]

        self._scenario, self._trials, self._seed, self._dt = scenario, trials, seed, dt
        self._limit, self._last = limit, math.ceil(limit / dt - 1e-9)
        scene, drive = scenario.scene(dt), scenario.drive
        self._crossings = Crossings(scene)
        self._planes = scenario.inside()
        self._period = round(drive.period / dt)
        self._ramp = math.ceil(drive.ramp_time / dt - 1e-9)
        self._few = max(round(_GRAVITY_EVERY / dt), 1)
        self._batch = Batch(scene.model, nsim=len(trials), nthread=threads or os.cpu_count() or 1)
        self._gravity = self._batch.expand("opt.gravity")
        places = self._batch.bind("qpos")
        draws = _start_draws(seed, trials, scenario.draws_for_start)
        places[:] = scenario.hand.start.places(draws)
        self.states = np.array(places)
        self._before = self._draws = np.zeros((len(trials), drive.targets_per_period))
        self._step = 0
        self.seconds = np.full(len(trials), limit)
        self._status = np.full(len(trials), RUNNING, np.uint8)
        self.going = np.arange(len(trials))

    def advance(self, film: Film | None) -> None:
        """Goes on for as long as gravity stays the same."""
        phase = self._step % self._period
        if phase == 0:
            period = self._step // self._period
            self._before = self._draws
            self._draws = _period_draws(self._seed, self._trials, period, self._before.shape[1])
            if film is not None:
                film.targets.append(self._draws[0])
        count = min(
            self._few if phase < self._ramp else _CHUNK,
            self._ramp - phase if phase < self._ramp else self._period,
            self._period - phase,
            self._last - self._step,
        )
        ids = self.going
        drive, middle = self._scenario.drive, (phase + 0.5 * count) * self._dt
        angles = drive.angles(
            self._before[ids], self._draws[ids], middle, self._step < self._period
        )
        self._gravity[ids] = self._scenario.pull(angles)
        try:
            record = self._batch.rollout(count, record=("qpos", "sensordata"), ids=ids)
        except Exception as error:  # mujoco.SimulationError, of some of them
            if type(error).__name__ != "SimulationError":
                raise
            self._end(ids, np.full(len(ids), self._step), INVALID)
            return
        states = np.concatenate([self.states[ids, None], record["qpos"]], axis=1)
        if film is not None:
            film.states.append(states[0, 1:])
        self.states[ids] = states[:, -1]
        self._look(ids, states, -record["sensordata"][..., 0], count)
        self._step += count
        if self._step >= self._last:
            self._end(self.going, self._step, LIMIT)

    def _look(self, ids: Any, states: Any, depth: Any, count: int) -> None:
        """Which trials have ended in the last steps, and how."""
        never = count + 1
        good = np.isfinite(states).all(axis=-1)
        if not good.all():
            states = np.where(good[..., None], states, states[:, :1])
        beyond = self._beyond(states[..., :3])
        first_out = _first(beyond[:, 1:] > 0, never)
        wrong = ~good[:, 1:] | self._crossings.wrong(states, depth, first_out)
        first_wrong = _first(wrong, never)
        warned = np.asarray(self._batch.warning)[ids].reshape(len(ids), -1).any(axis=1)
        first_wrong = np.where(warned & (first_wrong == never), count - 1, first_wrong)
        escaped = first_out < first_wrong
        rows, at = np.flatnonzero(escaped), first_out[escaped]
        low, high = beyond[rows, at], beyond[rows, at + 1]
        self._end(ids[rows], self._step + at + low / (low - high), PASSED)
        rows = np.flatnonzero(~escaped & (first_wrong < never))
        self._end(ids[rows], self._step + first_wrong[rows] + 1, INVALID)

    def _beyond(self, places: Float[np.ndarray, "trials times 3"]) -> Any:
        """How far beyond the region's nearest plane places are, m; of trials that cannot have got
        there on the way from the first place, a bound that is not above 0."""
        bound = self._beyond_of(places[:, 0])[:, None] + lengths(places - places[:, :1])
        near = np.flatnonzero((bound > -1e-9).any(axis=1))
        bound[near] = self._beyond_of(places[near])
        return bound

    def _beyond_of(self, places: Float[np.ndarray, "*some 3"]) -> Any:
        planes = self._planes
        return (places @ planes[:, :3].T + planes[:, 3]).max(axis=-1)

    def _end(self, which: Any, steps: Any, status: int) -> None:
        self.seconds[which] = np.minimum(np.asarray(steps) * self._dt, self._limit)
        self._status[which] = status
        self.going = np.flatnonzero(self._status == RUNNING)

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """The paper's steps in which they ended, and how."""
        return paper_steps(self.seconds).astype(np.int32), self._status


def _first(which: Any, never: int) -> Any:
    """The first step of each trial of which something is so; `never` where there is none."""
    return np.where(which.any(axis=1), which.argmax(axis=1), never)


@functools.partial(jax.jit, static_argnums=2)
def _drawn_starts(seed: Any, trials: Any, count: int) -> Any:
    return jax.vmap(lambda trial: start_draws(trial_key(seed, trial), count))(trials)


@functools.partial(jax.jit, static_argnums=3)
def _drawn_targets(seed: Any, trials: Any, period: Any, count: int) -> Any:
    return jax.vmap(lambda trial: period_draws(trial_key(seed, trial), period, count))(trials)


def _start_draws(seed: int, trials: Any, count: int) -> Float[np.ndarray, "trials draws"]:
    return np.asarray(_drawn_starts(np.uint32(seed), trials.astype(np.uint32), count), float)


def _period_draws(
    seed: int, trials: Any, period: int, count: int
) -> Float[np.ndarray, "trials draws"]:
    found = _drawn_targets(np.uint32(seed), trials.astype(np.uint32), np.int32(period), count)
    return np.asarray(found, float)


@contextmanager
def _no_log() -> Iterator[None]:
    """Keeps MuJoCo from writing its warnings to a file in the current folder: they are counted."""
    mj = mujoco()
    mj.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mj.set_mju_user_warning(None)
