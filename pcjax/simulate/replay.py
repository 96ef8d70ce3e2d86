"""One trial as a film needs it: where everything is at any time, and how and when it ended."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pcjax.checks import check_count
from pcjax.compiling import compiled_quickly
from pcjax.geometry import Vec
from pcjax.model.drives.base import Drive
from pcjax.model.hand import points_of
from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID, PAPER_DT, PASSED
from pcjax.physics.step import begin
from pcjax.simulate.batch import run
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.engine import Engine
from pcjax.simulate.outcomes import LIMIT, paper_steps
from pcjax.simulate.stepping import Stepping, check_can_step, lag_of, trajectory

PICKS = {
    "escaped": "the first that escaped",
    "stuck": "the first still inside at the limit",
    "longest": "the one that took longest to escape",
}
"""Trials worth a look."""

PICKED_FROM = 200
"""Trials that one is picked from."""


@dataclass(frozen=True)
class Frames:
    """Hand and object at some times of a trial.

    Attributes:
        times: seconds since the trial began.
        position: the object's centre in the hand frame.
        angle: the object's angle from the palm, radians.
        joints: the hand's origin in the world, preceded by the joints of the arm that carries it.
        turn: the angle by which the hand's axes are turned against the world's, radians.
        pull: gravity in the world's axes, as far as it acts in the plane of the hand.
        tilt: the wrist's T1 and T2, radians; None for other drives.
    """

    times: Float[np.ndarray, " frames"]
    position: Float[np.ndarray, "frames 2"]
    angle: Float[np.ndarray, " frames"]
    joints: Float[np.ndarray, "frames joints 2"]
    turn: Float[np.ndarray, " frames"]
    pull: Float[np.ndarray, "frames 2"]
    tilt: Float[np.ndarray, "frames 2"] | None

    def in_world(
        self, points: Float[np.ndarray, "points 2"], frame: int
    ) -> Float[np.ndarray, "points 2"]:
        """Points that are fixed to the hand, in the world at one of the times."""
        c, s = math.cos(self.turn[frame]), math.sin(self.turn[frame])
        return self.joints[frame, -1] + points @ np.array([[c, s], [-s, c]])


@dataclass(frozen=True)
class Recorded:
    """One trial, from its start to its end.

    Attributes:
        scenario: the condition.
        seed, trial: which experiment.
        status: PASSED, LIMIT or INVALID.
        seconds: when it ended.
        dt: the step taken, s.
        times: of the states kept, s.
    """

    scenario: Any  # a Scenario
    seed: int
    trial: int
    status: int
    seconds: float
    dt: float
    times: Float[np.ndarray, " states"]

    @property
    def escape_step(self) -> int:
        """The paper's step (of 0.001 s) in which it ended, as `pcjax.evaluate` counts."""
        return int(paper_steps(self.seconds))


@dataclass(frozen=True)
class Recording(Recorded):
    """One trial of a hand in the plane.

    Attributes:
        position, angle: of the object at the times kept, as in `Frames`; the angle without jumps.
    """

    position: Float[np.ndarray, "states 2"]
    angle: Float[np.ndarray, " states"]

    @functools.cached_property
    def hand(self) -> Float[np.ndarray, "points 2"]:
        """The hand as one line (`points_of`)."""
        return points_of(self.scenario.hand)

    @functools.cached_property
    def goal(self) -> Float[np.ndarray, "2 2"]:
        """The ends of the goal line."""
        line = jax.device_get(self.scenario.hand.goal())
        return np.array([[end.x, end.y] for end in (line.a, line.b)], float)

    def path(self, times: Float[np.ndarray, " frames"]) -> Float[np.ndarray, "frames 2"]:
        """Where the object's centre is in the hand frame at some times of the trial."""
        x, y = (np.interp(times, self.times, self.position[:, k]) for k in (0, 1))
        return np.stack([x, y], axis=-1)

    def at(self, times: Float[np.ndarray, " frames"]) -> Frames:
        """Hand and object at some times, between the trial's start and its end."""
        angle = np.interp(times, self.times, self.angle)
        drive = self.scenario.drive
        # The end of a period belongs to it, not to the next.
        period = np.maximum(np.ceil(times / drive.period - 1e-6) - 1, 0).astype(np.int32)
        joints, turn, pull, tilt = jax.device_get(
            _placements(drive, self.seed, self.trial, period, times - period * drive.period)
        )
        return Frames(np.asarray(times), self.path(times), angle, joints, turn, pull, tilt)


def record(
    scenario: Scenario, *, seed: int, trial: int, max_steps: int, dt: float = PAPER_DT
) -> Recording:
    """Runs one trial and keeps every step.

    Arguments:
        scenario: the condition.
        seed, trial: which experiment; the same as trial `trial` of `pcjax.evaluate(seed=seed)`.
        max_steps: limit in steps of 0.001 s.
        dt: the solver's step, s.

    Raises:
        ValueError: a number out of range, or steps cannot run the scenario.
    """
    check_can_step(scenario)
    check_count("seed", seed, 0, 2**32 - 1)
    check_count("trial", trial, 0, 2**31 - 1)
    check_count("max_steps", max_steps, 1, 2**31 - 1)
    period, limit = scenario.drive.period, max_steps * PAPER_DT
    step = Stepping(dt).step_taken(period)
    first, path, lag = jax.device_get(
        _run(scenario, np.uint32(seed), trial, math.ceil(limit / period - 1e-9), dt)
    )
    count = int(path.steps[-1])
    status = int(path.status[-1])
    ended = count * step - float(lag)
    if status not in (PASSED, INVALID) or paper_steps(ended) > max_steps:
        status, ended = LIMIT, limit
    times = np.arange(count + 1) * step

    def both(start: Any, later: Any) -> np.ndarray:
        return np.append(start, later[:count]).astype(float)

    position = np.stack(
        [both(first.position.x, path.position.x), both(first.position.y, path.position.y)], axis=-1
    )
    angle = np.unwrap(both(first.angle, path.angle))
    return Recording(scenario, seed, trial, status, ended, step, times, position, angle)


@functools.partial(compiled_quickly, static_argnames=("periods", "dt"))
def _run(scenario: Scenario, seed: Any, trial: Any, periods: int, dt: float) -> Any:
    first = begin(scenario, start_draws(trial_key(seed, trial), scenario.draws_for_start))
    path = trajectory(scenario, seed=seed, trial=trial, periods=periods, dt=dt)
    last = jax.tree.map(lambda leaf: leaf[-1], path)
    step = Stepping(dt).step_taken(scenario.drive.period)
    return first, path, lag_of(scenario.world(), last, jnp.asarray(step))


def _placed(drive: Drive, seed: Any, trial: Any, periods: Array, times: Array) -> Any:
    """`joints`, `turn`, `pull` and `tilt` of `Frames` at times of some periods."""
    key = trial_key(seed, trial)

    def one(period: Array, time: Array) -> Any:
        before, draws = (
            period_draws(key, jnp.maximum(k, 0), drive.targets_per_period)
            for k in (period - 1, period)
        )
        there = drive.placement(drive.profile(before, draws, period == 0), time)

        def pair(vector: Vec) -> Array:
            return jnp.stack([vector.x, vector.y])

        joints = jnp.stack([pair(joint) for joint in there.joints])
        tilt = None if there.tilt is None else pair(there.tilt)
        return joints, there.turn, pair(there.pull), tilt

    return jax.vmap(one)(periods, times)


_placements = compiled_quickly(_placed)


def check_in_sight(drive: Drive) -> None:
    """Checks that a film can show what the drive does to the hand.

    Raises:
        ValueError: there is no saying where the hand is.
    """
    jax.eval_shape(_placed, drive, 0, 0, np.zeros(1, np.int32), np.zeros(1))


def pick_trial(
    scenario: Scenario,
    pick: str,
    *,
    seed: int,
    max_steps: int,
    dt: float = PAPER_DT,
    engine: Engine | None = None,
    trials: int = PICKED_FROM,
    at_once: int | None = None,
    progress: bool = False,
) -> int:
    """A trial worth a look.

    Arguments:
        scenario, seed, max_steps, dt: as for `record`.
        pick: one of `PICKS`.
        engine: what runs them; steps of `dt` unless given.
        trials: how many to look through.
        at_once: how many are run before it is looked whether the first is there; all of them unless
            given.
        progress: whether to show a bar on stderr.

    Raises:
        ValueError: an unknown name, a number out of range, or no such trial.
    """
    if pick not in PICKS:
        raise ValueError(f"pick is {pick!r}: it has to be one of {', '.join(PICKS)}")
    wanted = LIMIT if pick == "stuck" else PASSED
    engine = Stepping(dt) if engine is None else engine
    at_once = trials if at_once is None or pick == "longest" else at_once
    found, steps = np.zeros(0, int), np.zeros(0, int)
    for first in range(0, trials, at_once):
        out = run(
            [scenario],
            trials=min(at_once, trials - first),
            first=first,
            max_steps=max_steps,
            seed=seed,
            engine=engine,
            progress=progress,
        )
        found, steps = first + np.flatnonzero(out.status[0] == wanted), out.steps[0]
        if len(found):
            break
    if len(found) == 0:
        limit = f"{max_steps:,} steps"
        raise ValueError(
            f"none of the first {trials} trials is still inside after {limit}: pick 'escaped'"
            if pick == "stuck"
            else f"none of the first {trials} trials escaped within {limit}: pick 'stuck'"
        )
    return int(found[np.argmax(steps[found])] if pick == "longest" else found[0])
