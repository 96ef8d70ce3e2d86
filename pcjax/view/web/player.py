"""The controls of a film of a trial."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from typing import Any

from nicegui import ui

from pcjax.physics.state import INVALID, PASSED
from pcjax.results.schema import NAMES
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.replay import PICKS
from pcjax.view.web.studio import Look, Studio

_LAST = 20.0
"""Seconds before a trial's end at which its film begins."""

_ENDS = {PASSED: "escaped", LIMIT: "still held", INVALID: "went wrong"}


class Player:
    """Which trial, play and pause, its speed, and the time in it. A subclass makes the film and
    shows it.

    Arguments:
        studio: whose trials are played.
        directions: that there are.
        speeds: words for them, by how many seconds of a trial a second takes.
        speed: the first of them.
        every: seconds between the pictures of a film, on the page's clock.
    """

    def __init__(
        self,
        studio: Studio,
        directions: Iterable[str],
        speeds: Mapping[float, str],
        speed: float,
        every: float,
    ):
        self.studio = studio
        self._last = 0.0
        with ui.element("div").classes("line many"):
            names = {d: NAMES[d] for d in directions}
            self._direction = ui.toggle(names, value=next(iter(names))).props("dense no-caps")
            self._pick = ui.select(list(PICKS), value="escaped", label="trial").props("dense")
            self._pick.props["data-testid"] = "pick"
            self._choose_more()
            self._play = ui.button("play", icon="play_arrow", on_click=self.toggle)
            self._play.props("dense no-caps").props["data-testid"] = "play"
            self._speed = ui.select(dict(speeds), value=speed, label="speed").props("dense")
        with ui.element("div").classes("line"):
            self._clock = ui.label("").classes("quiet")
            self._clock.props["data-testid"] = "clock"
            self._time = ui.slider(min=0.0, max=1.0, step=0.01, value=0.0).props("dense")
            self._time.props["aria-label"] = "time of the trial"
            self._time.on("update:model-value", self._draw, throttle=every)
        self._timer = ui.timer(every, self._tick, active=False)

    def _choose_more(self) -> None:
        """What else says which trial: nothing."""

    @property
    def _recording(self) -> Any:
        """The trial whose film there is; None where there is none."""
        raise NotImplementedError

    async def _load(self) -> bool:
        """Makes the film that is asked for; whether there is one then."""
        raise NotImplementedError

    def _draw(self) -> Any:
        """Shows the film where it is; nothing where there is none."""
        raise NotImplementedError

    def _tick(self) -> Any:
        """Plays on."""
        raise NotImplementedError

    @property
    def _now(self) -> float:
        return float(self._time.value or 0.0)

    async def toggle(self) -> None:
        """Plays, or stops."""
        if self._recording is None and not await self._load():
            return
        self._rewind()
        self._timer.active, self._last = not self._timer.active, time.perf_counter()
        self._label()

    def _known(self) -> Look | None:
        """What is known of the design as it is; None, which is told, where that is nothing yet."""
        studio, last = self.studio, self.studio.last
        if last is None or last.study is not studio.desk.study or studio.problem:
            studio.refused("there is no trial to be played of this design yet")
            return None
        return last

    def _begin(self) -> None:
        """To where a film begins: its end is what is worth a look."""
        self._time.props["max"] = self._recording.seconds
        self._time.value = max(self._recording.seconds - _LAST, 0.0)

    def _rewind(self) -> None:
        """From the film's end to its beginning."""
        if self._now >= self._recording.seconds:
            self._time.value = 0.0

    def _advance(self) -> None:
        """On by as much as time has passed, to the film's end at most."""
        now, end = time.perf_counter(), self._recording.seconds
        later = self._now + float(self._speed.value or 1) * (now - self._last)
        self._last, self._time.value = now, min(later, end)
        if later >= end:
            self._timer.active = False
            self._label()

    def _tell(self, at: float, more: str = "") -> None:
        one = self._recording
        self._clock.set_text(
            f"trial {one.trial}: {at:.1f} of {one.seconds:.1f} s, {_ENDS[one.status]}{more}"
        )

    def _label(self) -> None:
        playing = self._timer.active
        self._play.set_text("pause" if playing else "play")
        self._play.props(f"icon={'pause' if playing else 'play_arrow'}")
