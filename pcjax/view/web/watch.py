"""A trial played in the hand, with its trail, gravity and clock."""

from __future__ import annotations

from asyncio import to_thread
from dataclasses import dataclass

import numpy as np

from pcjax.model.scenario import DIRECTIONS, Scenario
from pcjax.physics.state import INVALID, PASSED
from pcjax.results.evaluation import Evaluation
from pcjax.results.schema import NAMES
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.replay import Frames, Recording, record
from pcjax.simulate.stepping import safe_step
from pcjax.study.spec import Study
from pcjax.view.web.canvas import Canvas
from pcjax.view.web.picture import Frame, object_svg, pull_svg, trail_svg
from pcjax.view.web.player import Player
from pcjax.view.web.studio import Studio

_EVERY = 0.05
"""Seconds between the pictures of a film, on the page's clock."""

_TRAIL = 8.0
"""Seconds of a trial that its trail reaches back."""

_TRIED = 8
"""Trials that are recorded at most until one ends as was asked for: steps and events part."""

_PADDED = 2000
"""Frames are worked out so many at a time, by one program."""

_SPEEDS = {1.0: "real time", 4.0: "4 x", 16.0: "16 x"}


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


class Watch(Player):
    """The player's controls."""

    def __init__(self, studio: Studio, canvas: Canvas):
        self.canvas = canvas
        self._film: Film | None = None
        self._shown = ""
        super().__init__(studio, DIRECTIONS, _SPEEDS, 4, _EVERY)
        self._direction.on_value_change(self.clear)
        self._pick.on_value_change(self.clear)
        studio.on_design.append(lambda moving: self.clear())

    @property
    def _recording(self) -> Recording | None:
        return None if self._film is None else self._film.recording

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

    async def _load(self) -> bool:
        studio, last = self.studio, self._known()
        direction, pick = str(self._direction.value), str(self._pick.value)
        if last is None:
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
        self._begin()
        self.canvas.over[direction] = lambda frame: film.at(self._now, frame)
        self._draw()
        return True

    def _tick(self) -> None:
        if self._film is not None:
            self._advance()
            self._draw()

    def _draw(self) -> None:
        if self._film is not None:
            self.canvas.redraw(self._shown)
            self._tell(self._now)
