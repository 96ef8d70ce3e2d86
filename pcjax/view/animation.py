"""A film of one trial: GIF, MP4, or HTML that plays by itself.

A wrist tilts the plane of the picture like a tray, about two axes at once: seen from above the hand
stays put, and what changes is gravity's part in that plane. So the hand is drawn fixed, and a dial
shows where that part points and how strong it is. An arm carries the hand about in the plane of the
picture under steady gravity, so there everything is drawn as it is in the world. The path is the
object's in the hand, as an escape is a motion out of the hand, and so are the places where it has
touched: of an object that is stuck they say where.
"""

from __future__ import annotations

import math
import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import (
    AbstractMovieWriter,
    FFMpegWriter,
    FuncAnimation,
    HTMLWriter,
    PillowWriter,
)
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle as Disc

from pcjax.checks import check_between
from pcjax.importing import named
from pcjax.model.scenario import Scenario, usual_max_steps
from pcjax.physics.state import INVALID, PASSED
from pcjax.progress import progress_bar
from pcjax.simulate.replay import Frames, Recorded, Recording, check_in_sight, pick_trial, record
from pcjax.simulate.stepping import safe_step
from pcjax.view.contacts import touches
from pcjax.view.labels import length_text
from pcjax.view.scene import draw_scene
from pcjax.view.shapes import COLOURS

FILMS = (".gif", ".mp4", ".html")
"""Kinds of films, by the file's ending."""

_TRAIL = 8.0
"""Seconds of the object's path behind it that are drawn strongly."""

_TRAIL_POINTS = 120

_HOLD = 1.5
"""Seconds of film for which the last picture stays."""

_MOST_FRAMES = 5000

_SIDE = 1.7
"""Width of the column beside the picture, inches."""

_TOUCHED = "#56b4e9"

_DPI = 100

ENDINGS = {PASSED: "escaped", INVALID: "went wrong"}
"""What is written where a trial ends so; else it is still inside."""


def check_film(path: str | os.PathLike[str]) -> None:
    """Fails before the work when a film of this name cannot be made.

    Raises:
        ValueError: an unknown ending, or no ffmpeg for MP4.
    """
    ending = Path(path).suffix.lower()
    if ending not in FILMS:
        raise ValueError(f"cannot film {path}: its ending has to be one of {', '.join(FILMS)}")
    if ending == ".mp4" and not FFMpegWriter.isAvailable():
        raise ValueError(
            f"cannot film {path}: MP4 needs the program ffmpeg, which is not there; "
            "install it, or take .gif or .html"
        )


def animate(
    scenario: Scenario,
    path: str | os.PathLike[str],
    *,
    trial: int | None = None,
    pick: str = "escaped",
    seed: int = 0,
    max_steps: int | None = None,
    dt: float | None = None,
    seconds: float = 40.0,
    speed: float = 4.0,
    fps: int = 20,
    title: str = "",
    units: str = "model",
    progress: bool = False,
) -> Recorded:
    """Films the end of one trial.

    Arguments:
        scenario: the condition, from `pcjax.does`, `pcjax.eoen` or `Study.scenarios`.
        path: the file, .gif, .mp4 (needs ffmpeg) or .html.
        trial: which one; the same as trial `trial` of `pcjax.evaluate(seed=seed)`.
        pick: unless a trial is given, which of the first 200: the first that "escaped", the first
            still inside at the limit ("stuck"), or the one that took "longest" to escape.
        seed: of the trials.
        max_steps: limit in steps of 0.001 s; the paper's unless given.
        dt: the solver's step, s; as large as accuracy allows unless given.
        seconds: how much of the trial to film, up to its end.
        speed: seconds of the trial in one of the film.
        fps: pictures in a second of the film.
        title: of the film.
        units: of lengths (see `pcjax.units`), for the scale.
        progress: whether to show bars on stderr.

    Returns:
        The trial, with its escape step.

    Raises:
        ValueError: a number or name out of range, no such trial, limbs that cross, an object that
            does not fit, a film that cannot be made, or a hand in three dimensions where nothing
            can be rendered.

    Example:
        >>> import pcjax
        >>> scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> pcjax.animate(scenario, "escape.gif", trial=1, seconds=0.4).escape_step > 0
        True
    """
    check_film(path)
    check_between("seconds", seconds, 0.01, 1e5)
    check_between("speed", speed, 0.01, 1000.0)
    check_between("fps", fps, 1, 50)
    count = round(seconds / speed * fps)
    if not 1 <= count <= _MOST_FRAMES:
        raise ValueError(
            f"{seconds:g} s at speed {speed:g} and {fps:g} fps are {count} frames: "
            f"there may be 1 to {_MOST_FRAMES}"
        )
    scenario.check()
    camera: Camera = named(scenario.filmed_by)(scenario, dt)
    if max_steps is None:
        max_steps = usual_max_steps(scenario.body, scenario.drive)
    if trial is None:
        trial = camera.pick(pick, seed=seed, max_steps=max_steps, progress=progress)
    recording = camera.record(seed=seed, trial=trial, max_steps=max_steps)
    begin = max(recording.seconds - seconds, 0.0)
    count = max(math.ceil((recording.seconds - begin) / speed * fps), 1)
    times = np.linspace(begin, recording.seconds, count + 1)
    with camera.film(recording, times, speed, title, units) as film:
        _save(film, len(times), Path(path), fps, progress)
    return recording


class Film(AbstractContextManager["Film"]):
    """The figure of a film, and how each of its pictures is drawn."""

    figure: Figure

    def draw(self, k: int) -> tuple[()]:
        """Picture `k`, in place of the one before."""
        raise NotImplementedError

    def __exit__(self, *_: object) -> None:
        """Gives back what drawing takes."""


class Camera:
    """How trials of a kind of scenario are filmed; see `Scenario.filmed_by`.

    Arguments:
        scenario: the condition.
        dt: the solver's step, s; as large as accuracy allows unless given.

    Raises:
        ValueError: it cannot be filmed.
    """

    def __init__(self, scenario: Any, dt: float | None):
        raise NotImplementedError

    def pick(self, pick: str, *, seed: int, max_steps: int, progress: bool) -> int:
        """A trial worth a look; see `pick_trial`."""
        raise NotImplementedError

    def record(self, *, seed: int, trial: int, max_steps: int) -> Recorded:
        """One trial, from its start to its end."""
        raise NotImplementedError

    def film(self, recording: Any, times: np.ndarray, speed: float, title: str, units: str) -> Film:
        """The pictures at some times of a recorded trial."""
        raise NotImplementedError


class PlaneCamera(Camera):
    """Films hands in the plane, in steps."""

    def __init__(self, scenario: Scenario, dt: float | None):
        check_in_sight(scenario.drive)
        self._scenario = scenario
        self._dt = safe_step(scenario) if dt is None else dt

    def pick(self, pick: str, *, seed: int, max_steps: int, progress: bool) -> int:
        """See `Camera`."""
        return pick_trial(
            self._scenario, pick, seed=seed, max_steps=max_steps, dt=self._dt, progress=progress
        )

    def record(self, *, seed: int, trial: int, max_steps: int) -> Recording:
        """See `Camera`."""
        return record(self._scenario, seed=seed, trial=trial, max_steps=max_steps, dt=self._dt)

    def film(
        self, recording: Recording, times: np.ndarray, speed: float, title: str, units: str
    ) -> Film:
        """See `Camera`."""
        return _Film(recording, times, speed, title, units)


def _save(film: Film, count: int, path: Path, fps: int, progress: bool) -> None:
    shown = list(range(count)) + [count - 1] * round(_HOLD * fps)
    animation = FuncAnimation(
        film.figure, film.draw, frames=shown, init_func=lambda: (), cache_frame_data=False
    )
    with progress_bar(
        total=len(shown),
        desc="frames",
        unit="frame",
        shown=progress,
    ) as bar:
        animation.save(
            path,
            writer=_writer(path, fps),
            dpi=_DPI,
            progress_callback=lambda *_: bar.update(),
        )


def _writer(path: Path, fps: int) -> AbstractMovieWriter:
    ending = path.suffix.lower()
    if ending == ".gif":
        return PillowWriter(fps=fps)
    if ending == ".mp4":
        return FFMpegWriter(fps=fps, codec="h264")
    return HTMLWriter(fps=fps, embed_frames=True, default_mode="loop", embed_limit=1000)


class _Film(Film):
    """Pictures of a trial of a hand in the plane."""

    def __init__(
        self, recording: Recording, times: np.ndarray, speed: float, title: str, units: str
    ):
        self._recording, self._speed, self._title = recording, speed, title
        self._frames = recording.at(times)
        pull = float(np.hypot(*self._frames.pull.T).max())
        self._gravity = float(getattr(recording.scenario.drive, "gravity", pull))
        self._low, self._high = self._extent()
        width, height = self._high - self._low
        # Room for the pictures' text above, and for the dial on the right.
        tall = max(min(4.4, 7.0 * height / width), 3.2)
        wide = max(min(tall * width / height, 7.0), 2.6)
        self.figure = Figure(figsize=(wide + _SIDE, tall + 0.5), dpi=_DPI)
        right, top = wide / (wide + _SIDE), tall / (tall + 0.5)
        self._main = self.figure.add_axes((0.0, 0.0, right, top))
        side = 1.4 / (wide + _SIDE), 1.4 / (tall + 0.5)
        self._dial = self.figure.add_axes((right + 0.01, 0.62 * top, *side))
        self._text_at = right + 0.01 + side[0] / 2
        key = self.figure.add_axes((right + 0.01, 0.0, side[0], 1.0 / (tall + 0.5)))
        _draw_key(key, min(wide / width, tall / height), units)
        self._touches = touches(recording, float(times[0]))

    def _extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box that everything stays in."""
        frames = self._frames
        hands = [frames.in_world(self._recording.hand, k) for k in range(len(frames.times))]
        centres = [frames.in_world(frames.position[k : k + 1], k) for k in range(len(hands))]
        scenario = self._recording.scenario
        reach, half = float(scenario.body.radius), 0.5 * float(scenario.hand.thickness)
        around = np.concatenate(centres)
        points = np.concatenate(
            [*hands, around - reach, around + reach, frames.joints.reshape(-1, 2)]
        )
        margin = half + 0.05 * np.ptp(points, axis=0).max()
        return points.min(axis=0) - margin, points.max(axis=0) + margin

    def draw(self, k: int) -> tuple[()]:
        """Picture `k`, in place of the one before."""
        main = self._main
        main.clear()
        main.set_axis_off()
        main.set(xlim=(self._low[0], self._high[0]), ylim=(self._low[1], self._high[1]))
        main.set_aspect("equal")
        self._draw_trail(k)
        draw_scene(main, self._recording, self._frames, k)
        _draw_dial(self._dial, self._gravity, self._frames, k)
        for text in list(self.figure.texts):
            text.remove()
        self._draw_texts(k)
        return ()

    def _draw_trail(self, k: int) -> None:
        recording, frames = self._recording, self._frames
        begin, now = frames.times[0], frames.times[k]
        gone = recording.times[(recording.times > begin) & (recording.times < now)]
        whole = recording.path(np.concatenate([[begin], gone, [now]]))
        self._main.plot(*frames.in_world(whole, k).T, color=COLOURS[1], alpha=0.35, lw=1.0)
        when, where = self._touches
        touched = frames.in_world(where[when <= now], k)
        self._main.plot(*touched.T, "o", color=_TOUCHED, ms=3.5, zorder=4.5)
        times = np.linspace(max(now - _TRAIL, 0.0), now, _TRAIL_POINTS)
        path = self._frames.in_world(self._recording.path(times), k)
        pieces = np.stack([path[:-1], path[1:]], axis=1)
        shades = [to_rgba(COLOURS[1], 0.75 * share) for share in np.linspace(0, 1, len(pieces))]
        self._main.add_collection(
            LineCollection(list(pieces), colors=shades, linewidths=1.6, zorder=2.5)
        )

    def _draw_texts(self, k: int) -> None:
        recording, frames = self._recording, self._frames
        write = self.figure.text
        write(0.015, 0.985, self._title, ha="left", va="top", fontsize=11)
        write(
            self._text_at,
            0.985,
            f"{self._speed:g} times as fast",
            ha="center",
            va="top",
            color="0.4",
        )
        if frames.tilt is None:
            angle = math.degrees(math.remainder(frames.turn[k], 2 * math.pi))
            attitude = f"hand turned\n{_degrees(angle)}"
        else:
            attitude = "tilt\n" + ", ".join(_degrees(math.degrees(t)) for t in frames.tilt[k])
        low = self._dial.get_position().y0
        write(self._text_at, low - 0.01, attitude, ha="center", va="top", fontsize=10)
        clock, colour = f"t = {frames.times[k]:.1f} s", "black"
        if k == len(frames.times) - 1:
            ending = ENDINGS.get(recording.status, "still inside")
            clock, colour = f"{ending}\n{recording.seconds:.2f} s", COLOURS[1]
        write(self._text_at, 0.36, clock, ha="center", va="center", fontsize=12, color=colour)


def _draw_key(axis: Axes, scale: float, units: str) -> None:
    """What path and dots are, and how long a length is.

    Arguments:
        axis: 1.4 inches wide and 1 inch high.
        scale: inches of the picture for a length of 1.
        units: of lengths.
    """
    axis.set_axis_off()
    axis.set(xlim=(0.0, 1.4), ylim=(0.0, 1.0))
    axis.plot([0.1, 0.4], [0.86, 0.86], color=COLOURS[1], lw=1.6)
    axis.plot([0.25], [0.64], "o", color=_TOUCHED, ms=3.5)
    for y, word in ((0.86, "path"), (0.64, "touched")):
        axis.text(0.5, y, word, va="center", fontsize=9, color="0.3")
    most = 1.2 / scale
    power = 10.0 ** math.floor(math.log10(most))
    length = max(step * power for step in (1, 2, 5) if step * power <= most)
    ends = 0.7 + 0.5 * length * scale * np.array([-1, 1])
    axis.plot(ends, [0.32, 0.32], color="0.3", lw=1.2, marker="|", ms=6)
    text = length_text(length, units)
    axis.text(0.7, 0.24, text, ha="center", va="top", fontsize=9, color="0.3")


def _draw_dial(axis: Axes, g: float, frames: Frames, k: int) -> None:
    """Gravity in the plane of the picture: where it points, and how much of g it is."""
    axis.clear()
    axis.set_axis_off()
    axis.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
    axis.set_aspect("equal")
    axis.add_patch(Disc((0, 0), 1.0, fc="0.96", ec="0.7"))
    x, y = frames.pull[k] / g if g > 0 else (0.0, 0.0)
    axis.annotate(
        "",
        (x, y),
        (0, 0),
        arrowprops={"arrowstyle": "-|>", "color": "0.2", "lw": 2, "shrinkA": 0, "shrinkB": 0},
    )
    axis.text(
        0, 0.8, f"{math.hypot(x, y):.2f} g", ha="center", va="center", fontsize=9, color="0.3"
    )


def _degrees(angle: float) -> str:
    """Without a minus before 0."""
    return f"{round(angle):+d}°" if round(angle) else "0°"
