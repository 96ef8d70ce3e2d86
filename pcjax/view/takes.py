"""Films of hands in three dimensions.

The world is fixed, gravity points down, and the hand tilts as it does in the trial. The path is the
object's in the hand, and tilts along with it.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.simulate.backends.recording import SpatialRecording, record_spatial
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.replay import pick_trial
from pcjax.view.animation import ENDINGS, Camera, Film
from pcjax.view.rendering import SIZE, Stage, check_rendering
from pcjax.view.shapes import COLOURS

_TRAIL = 8.0
"""Seconds of the object's path behind it that are drawn."""

_TRAIL_POINTS = 80

_OPACITY = 0.6
"""Of the hand, in which the object is to be seen wherever it is."""

_AT_ONCE = 16
"""Trials that are run before it is looked whether the one that is wanted is there."""

_DPI = 100

_ABOVE = 34
"""Pixels for the texts above a picture."""


class SpatialCamera(Camera):
    """Films hands in three dimensions: the very trials that `pcjax.evaluate_study` counts.

    Arguments:
        scenario: the condition.
        dt: MuJoCo's step, s; chosen for the scenario unless given.

    Raises:
        ValueError: nothing can be rendered here.
    """

    def __init__(self, scenario: SpatialScenario, dt: float | None):
        check_rendering()
        self._scenario = scenario
        self._engine = choose_engine("auto", dt, scenario)

    def pick(self, pick: str, *, seed: int, max_steps: int, progress: bool) -> int:
        """See `Camera`."""
        return pick_trial(
            self._scenario,
            pick,
            seed=seed,
            max_steps=max_steps,
            engine=self._engine,
            at_once=_AT_ONCE,
            progress=progress,
        )

    def record(self, *, seed: int, trial: int, max_steps: int) -> SpatialRecording:
        """See `Camera`."""
        dt = self._engine.step_taken(self._scenario.drive.period)
        return record_spatial(self._scenario, seed=seed, trial=trial, max_steps=max_steps, dt=dt)

    def film(
        self, recording: SpatialRecording, times: np.ndarray, speed: float, title: str, units: str
    ) -> Film:
        """See `Camera`."""
        return _Film(recording, times, speed, title)


class Shots:
    """Pictures of a recorded trial at any time of it; to be closed."""

    def __init__(self, recording: SpatialRecording, azimuth: float | None = None):
        self.recording = recording
        self._stage = Stage(recording.scenario, azimuth=azimuth, opacity=_OPACITY)
        self.close, self.look_from = self._stage.close, self._stage.look_from

    def at(self, time: float) -> np.ndarray:
        """The picture at a time of the trial, s."""
        recording, now = self.recording, np.array([time])
        back = np.linspace(max(time - _TRAIL, 0.0), time, _TRAIL_POINTS)
        return self._stage.picture(
            recording.at(now)[0], recording.angles(now)[0], recording.path(back)
        )


class _Film(Film):
    """Pictures of a trial of a hand in three dimensions."""

    def __init__(self, recording: SpatialRecording, times: np.ndarray, speed: float, title: str):
        self._recording, self._times = recording, times
        self._angles = np.degrees(recording.angles(times))
        self._shots = Shots(recording)
        width, height = SIZE
        self.figure = Figure(figsize=(width / _DPI, (height + _ABOVE) / _DPI), dpi=_DPI)
        axis: Axes = self.figure.add_axes((0.0, 0.0, 1.0, height / (height + _ABOVE)))
        axis.set_axis_off()
        self._image = axis.imshow(self._shots.at(float(times[0])), aspect="auto")
        axis.text(0.04, 0.93, "gravity", transform=axis.transAxes, fontsize=9, color="0.3")
        line = 1 - 0.5 * _ABOVE / (height + _ABOVE)
        self.figure.text(
            0.015,
            line,
            f"{title}, {speed:g} times as fast; the world is fixed, the hand tilts",
            va="center",
        )
        self._clock = self.figure.text(0.985, line, "", ha="right", va="center")
        self._tilt = axis.text(0.04, 0.05, "", transform=axis.transAxes, fontsize=9, color="0.3")

    def __exit__(self, *_: object) -> None:
        """Gives back what OpenGL holds."""
        self._shots.close()

    def draw(self, k: int) -> tuple[()]:
        """Picture `k`, in place of the one before."""
        self._image.set_data(self._shots.at(float(self._times[k])))
        self._clock.set(text=f"t = {self._times[k]:.1f} s", color="black")
        if k == len(self._times) - 1:
            ending = ENDINGS.get(self._recording.status, "still inside")
            self._clock.set(text=f"{ending} {self._recording.seconds:.2f} s", color=COLOURS[1])
        one, other = (math.remainder(angle, 360.0) for angle in self._angles[k])
        self._tilt.set_text(f"tilt {one:+.0f}°, {other:+.0f}°")
        return ()
