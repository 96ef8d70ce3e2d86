"""A trial played in the hand, with its trail, gravity and clock."""

from __future__ import annotations

import time
from asyncio import to_thread
from dataclasses import dataclass

import numpy as np
from nicegui import ui

from pcjax.model.scenario import DIRECTIONS, Scenario
from pcjax.physics.state import INVALID, PASSED
from pcjax.results.evaluation import Evaluation
from pcjax.results.schema import NAMES
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.replay import PICKS, Frames, Recording, record
from pcjax.simulate.stepping import safe_step
from pcjax.study.spec import Study
from pcjax.view.web.canvas import Canvas
from pcjax.view.web.picture import Frame, object_svg, pull_svg, trail_svg
from pcjax.view.web.studio import Studio

_EVERY = 0.05
"""Seconds between the pictures of a film, on the page's clock."""

_TRAIL = 8.0
"""Seconds of a trial that its trail reaches back."""

_TRIED = 8
"""Trials that are recorded at most until one ends as was asked for: steps and events part."""

_PADDED = 2000
"""Frames are worked out so many at a time, by one program."""

_SPEEDS = {1: "real time", 4: "4 x", 16: "16 x"}


@dataclass(frozen=True)
class Film:
    """A trial that can be shown at any time of it.

    Attributes:
        recording: it.
        times: of the frames, s.
        frames: hand and object then.
        gravity: what `frames.pull` is at most.
    """

    recording: Recording
    times: np.ndarray
    frames: Frames
    gravity: float

    @classmethod
    def of(cls, recording: Recording) -> Film:
        """Frames each twentieth of a second."""
        times = np.append(np.arange(0.0, recording.seconds, _EVERY), recording.seconds)
        padded = -(-len(times) // _PADDED) * _PADDED
        frames = recording.at(np.append(times, np.full(padded - len(times), recording.seconds)))
        return cls(recording, times, frames, float(np.hypot(*frames.pull.T).max()) or 1.0)

    def at(self, seconds: float, frame: Frame) -> str:
        """The object, its trail and gravity, as SVG."""
        k = int(np.searchsorted(self.times, seconds, side="right")) - 1
        k = min(max(k, 0), len(self.times) - 1)
        path = self.frames.position
        first = int(np.searchsorted(self.times, self.times[k] - _TRAIL))
        body = self.recording.scenario.body
        turn = self.frames.turn[k]
        back = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        pull = self.frames.pull[k] @ back / self.gravity  # in the hand's own axes
        return (
            trail_svg(path[first : k + 1], frame)
            + object_svg(body, path[k], float(self.frames.angle[k]), frame)
            + pull_svg(pull, frame)
        )


def find_film(study: Study, direction: str, pick: str, found: Evaluation) -> Film:
    """The first trial of its kind.

    Arguments:
        study, direction: of what.
        pick: one of `PICKS`.
        found: what is known of the study's trials, to know where to look.

    Raises:
        ValueError: there is no such trial.
    """
    scenario: Scenario = study.scenarios()[direction]
    steps, status = found.ends(direction)
    wanted = LIMIT if pick == "stuck" else PASSED
    likely = np.flatnonzero(status == wanted)
    if pick == "longest":
        likely = likely[np.argsort(-steps[likely], kind="stable")]
    for trial in likely[:_TRIED]:
        recording = record(
            scenario,
            seed=study.run.seed,
            trial=int(trial),
            max_steps=study.max_steps,
            dt=safe_step(scenario),
        )
        if recording.status == wanted or (recording.status != INVALID and pick == "longest"):
            return Film.of(recording)
    what = {"escaped": "escapes", "longest": "escapes", "stuck": "is still held at the limit"}
    raise ValueError(f"none of {len(status):,} trials {what[pick]}: pick another one")


class Watch:
    """The player's controls."""

    def __init__(self, studio: Studio, canvas: Canvas):
        self.studio, self.canvas = studio, canvas
        self._film: Film | None = None
        self._last = 0.0
        self._shown = ""
        with ui.element("div").classes("line many"):
            names = {d: NAMES[d] for d in DIRECTIONS}
            self._direction = ui.toggle(names, value="does").props("dense no-caps")
            self._pick = ui.select(list(PICKS), value="escaped", label="trial").props("dense")
            self._pick.props["data-testid"] = "pick"
            self._play = ui.button("play", icon="play_arrow", on_click=self.toggle)
            self._play.props("dense no-caps").props["data-testid"] = "play"
            self._speed = ui.select(_SPEEDS, value=4, label="speed").props("dense")
        with ui.element("div").classes("line"):
            self._clock = ui.label("").classes("quiet")
            self._clock.props["data-testid"] = "clock"
            self._time = ui.slider(min=0.0, max=1.0, step=0.01, value=0.0).props("dense")
            self._time.props["aria-label"] = "time of the trial"
            self._time.on("update:model-value", self._seek, throttle=0.04)
        self._timer = ui.timer(_EVERY, self._tick, active=False)
        self._direction.on_value_change(self.clear)
        self._pick.on_value_change(self.clear)
        studio.on_design.append(lambda moving: self.clear())

    def clear(self) -> None:
        """No film any more: it was of something else."""
        if self._film is None:
            return
        self._film = None
        self._timer.active = False
        self.canvas.over.pop(self._shown, None)
        self.canvas.redraw(self._shown)
        self._clock.set_text("")
        self._label()

    @property
    def _now(self) -> float:
        return float(self._time.value or 0.0)

    async def toggle(self) -> None:
        """Plays, or stops."""
        if self._film is None and not await self._load():
            return
        assert self._film is not None
        if self._now >= self._film.recording.seconds:
            self._time.value = 0.0
        self._timer.active, self._last = not self._timer.active, time.perf_counter()
        self._label()

    async def _load(self) -> bool:
        studio, last = self.studio, self.studio.last
        direction, pick = str(self._direction.value), str(self._pick.value)
        if last is None or last.study is not studio.desk.study or studio.problem:
            studio.refused("there is no trial to be played of this design yet")
            return False
        if direction not in last.found.directions:
            studio.refused(f"this hand has no {NAMES[direction]}")
            return False
        self._play.props("loading")
        try:
            film = await to_thread(find_film, last.study, direction, pick, last.found)
        except ValueError as error:
            studio.refused(str(error))
            return False
        finally:
            self._play.props(remove="loading")
        if studio.desk.study is not last.study:
            return False
        self._film, self._shown = film, direction
        self._time.props["max"] = film.recording.seconds
        # Its end is what is worth a look.
        self._time.value = max(film.recording.seconds - 20.0, 0.0)
        self.canvas.over[direction] = lambda frame: film.at(self._now, frame)
        self._draw()
        return True

    def _tick(self) -> None:
        film = self._film
        if film is None:
            return
        now = time.perf_counter()
        later = self._now + float(self._speed.value or 1) * (now - self._last)
        self._last = now
        self._time.value = min(later, film.recording.seconds)
        if later >= film.recording.seconds:
            self._timer.active = False
            self._label()
        self._draw()

    def _seek(self) -> None:
        if self._film is not None:
            self._draw()

    def _draw(self) -> None:
        film = self._film
        assert film is not None
        self.canvas.redraw(self._shown)
        ends = {PASSED: "escaped", LIMIT: "still held", INVALID: "went wrong"}
        one = film.recording
        self._clock.set_text(
            f"trial {one.trial}: {self._now:.1f} of {one.seconds:.1f} s, {ends[one.status]}"
        )

    def _label(self) -> None:
        playing = self._timer.active
        self._play.set_text("pause" if playing else "play")
        self._play.props(f"icon={'pause' if playing else 'play_arrow'}")
