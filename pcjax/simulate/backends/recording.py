"""One trial of a hand in three dimensions as a film needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcjax.checks import check_count
from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.simulate.backends.mujoco import Film, run_trials
from pcjax.simulate.replay import Recorded


@dataclass(frozen=True)
class SpatialRecording(Recorded):
    """One trial of a hand in three dimensions.

    Attributes:
        states: the object's place, m, and unit quaternion in the hand's frame at the times kept.
        targets: the drive's draws for each period.
    """

    states: Float[np.ndarray, "states 7"]
    targets: Float[np.ndarray, "periods targets"]

    def path(self, times: Float[np.ndarray, " frames"]) -> Float[np.ndarray, "frames 3"]:
        """Where the object's centre is in the hand's frame at some times of the trial, m."""
        return np.stack([np.interp(times, self.times, x) for x in self.states[:, :3].T], axis=-1)

    def at(self, times: Float[np.ndarray, " frames"]) -> Float[np.ndarray, "frames 7"]:
        """Place and unit quaternion in the hand's frame at some times of the trial."""
        # A step turns the object so little that one may go straight from one to the next.
        turned = np.stack(
            [np.interp(times, self.times, q) for q in _steady(self.states).T], axis=-1
        )
        turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
        return np.concatenate([self.path(times), turned], axis=-1)

    def angles(self, times: Float[np.ndarray, " frames"]) -> Float[np.ndarray, "frames 2"]:
        """The hand's tilt T1 and T2 at some times of the trial, radians."""
        drive, found = self.scenario.drive, []
        for time in times:
            # The end of a period belongs to it, not to the next.
            k = max(int(np.ceil(time / drive.period - 1e-6)) - 1, 0)
            before, draws = self.targets[max(k - 1, 0)][None], self.targets[k][None]
            found.append(drive.angles(before, draws, time - k * drive.period, k == 0)[0])
        return np.array(found).reshape(-1, 2)


def _steady(states: Float[np.ndarray, "states 7"]) -> Float[np.ndarray, "states 4"]:
    """Quaternions whose sign does not jump."""
    turned = states[:, 3:]
    flips = np.append(1.0, np.where((turned[1:] * turned[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    return turned * np.cumprod(flips)[:, None]


def record_spatial(
    scenario: SpatialScenario, *, seed: int, trial: int, max_steps: int, dt: float
) -> SpatialRecording:
    """Runs one trial and keeps every step.

    Arguments:
        scenario: the condition.
        seed, trial: which experiment; the same as trial `trial` of `pcjax.evaluate_study`.
        max_steps: limit in steps of 0.001 s.
        dt: MuJoCo's step, s, a whole number of which is the drive's period.

    Raises:
        ValueError: a number out of range.
    """
    check_count("seed", seed, 0, 2**32 - 1)
    check_count("trial", trial, 0, 2**31 - 1)
    check_count("max_steps", max_steps, 1, 2**31 - 1)
    film = Film()
    _, status = run_trials(
        scenario, np.array([trial]), max_steps=max_steps, seed=seed, dt=dt, threads=1, film=film
    )
    states = np.concatenate(film.states)
    known = np.flatnonzero(np.isfinite(states).all(axis=1))  # all, unless it went wrong
    return SpatialRecording(
        scenario, seed, trial, int(status[0]), film.seconds, dt, known * dt, states[known],
        np.array(film.targets),
    )  # fmt: skip
