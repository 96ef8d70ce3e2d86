"""The page of a hand in three dimensions: its joints to turn, its numbers, and films of trials."""

from __future__ import annotations

import asyncio
import base64
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from nicegui import app, background_tasks, ui

from pcjax.model.spatial.frozen import posed
from pcjax.physics.state import PASSED
from pcjax.results.evaluation import Evaluation
from pcjax.simulate.backends.recording import SpatialRecording, record_spatial
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.outcomes import LIMIT
from pcjax.study.spec import Study
from pcjax.view.rendering import Stage, check_rendering
from pcjax.view.takes import Shots
from pcjax.view.web.desk import Desk
from pcjax.view.web.dials import Dial, dials_of_components
from pcjax.view.web.looks import experiment_of
from pcjax.view.web.numbers import Curves, Numbers
from pcjax.view.web.page import opened
from pcjax.view.web.panel import Panel
from pcjax.view.web.player import Player
from pcjax.view.web.studio import Studio

T = TypeVar("T")

_EVERY = 0.1
"""Seconds between the pictures of a film, on the page's clock."""

_SPEEDS = {0.25: "1/4", 1: "real time", 4: "4 x", 16: "16 x"}

_QUALITY = 85

_RENDERING = ThreadPoolExecutor(max_workers=1)
"""What OpenGL has made can be used by the thread that has made it alone."""


@dataclass
class SpatialDesk(Desk):
    """A design in three dimensions."""

    @classmethod
    def of(cls, study: Study, name: str = "") -> Desk:
        """A study that has just been opened."""
        return cls(study, study, name)

    def doubt(self) -> str:
        """Nothing: a hand in three dimensions has no limits of its own."""
        return ""

    def dials(self) -> list[Dial]:
        """Joints that move a part of the hand, those first that the study names; and the numbers of
        object, tilt and contact."""
        return [*_joints(self.study), *dials_of_components(self.study)]


def _joints(study: Study) -> Iterator[Dial]:
    hand: Any = study.hand
    there, root = posed(hand), hand.source.model.body(hand.root).id if hand.root else 0
    order = {name: k for k, name in enumerate((*hand.joints, *hand.source.joints))}
    for name in sorted(hand.source.joints, key=lambda joint: order[joint]):
        body = int(there.model.jnt_bodyid[there.model.joint(name).id])
        if not there.below[body] or body == root:
            continue
        _, hinge, limits = hand.source.joints[name]
        low, high = limits or ((-math.pi, math.pi) if hinge else (-0.1, 0.1))
        per, unit, step = (math.degrees(1.0), "deg", 0.5) if hinge else (1.0, "m", 0.0005)
        value = per * hand.number_of(name)
        yield Dial(f"posture.{name}", name, "hand", per * low, per * high, step, value, unit)


class SpatialStudio(Studio):
    """A design in three dimensions; its numbers follow once what is dragged is dropped."""

    desks = SpatialDesk
    moving = ()
    at_rest = (10, 50, 200)
    exports = ("png", "json")

    def turn(
        self, label: str, value: float | None, *, before: Study | None = None, moving: bool = False
    ) -> str:
        """See `Studio`: nothing before it is dropped."""
        return "" if moving else super().turn(label, value, before=before)


class SpatialPanel(Panel):
    """A row for each number that can be turned."""

    def _switches(self) -> None:
        """None."""

    def _limits(self) -> None:
        """None."""


def warm_up(study: Study) -> None:
    """Looks whether the page can show the study, and compiles its draws.

    Raises:
        ValueError: the study cannot be evaluated, or nothing can be rendered here.
    """
    check_rendering()
    experiment_of(study).go_on(2)


async def page(study: Study, name: str, folder: Path) -> None:
    """Builds the page of one visitor; see `pcjax.view.web.page.page`."""
    studio = await opened(study, name, folder, SpatialStudio)
    if studio is None:
        return
    with ui.element("main").classes("columns"):
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("card hand"):
                SpatialWatch(studio)
            Curves(studio)
        with ui.element("div").classes("stack"):
            Numbers(studio)
            with ui.element("section").classes("card"):
                SpatialPanel(studio)
    studio.tell()


def chosen_trial(found: Evaluation, direction: str, pick: str) -> int:
    """The number of the first trial of its kind.

    Raises:
        ValueError: there is no such trial.
    """
    steps, status = found.ends(direction)
    likely = np.flatnonzero(status == (LIMIT if pick == "stuck" else PASSED))
    if not len(likely):
        what = "is still held at the limit" if pick == "stuck" else "escapes"
        raise ValueError(f"none of {len(status):,} trials {what}: pick another one")
    return int(likely[np.argmax(steps[likely])] if pick == "longest" else likely[0])


def recorded(study: Study, direction: str, trial: int) -> SpatialRecording:
    """A trial as the study's numbers count it."""
    scenario: Any = study.scenarios()[direction]
    engine = choose_engine(study.run.engine, study.run.dt, scenario)
    return record_spatial(
        scenario,
        seed=study.run.seed,
        trial=trial,
        max_steps=study.max_steps,
        dt=engine.step_taken(study.drive.period),
    )


class SpatialWatch(Player):
    """The hand in its posture, or a film of a trial, and the player's controls."""

    def __init__(self, studio: SpatialStudio):
        self._shots: Shots | None = None
        self._turn, self._busy = 0, False
        self._azimuth: float | None = None
        self._image = ui.element("img").classes("rendered")
        self._image.props["alt"] = "the hand with the object in it; the arrow is gravity"
        self._image.props["data-testid"] = "picture"
        super().__init__(studio, studio.desk.study.directions, _SPEEDS, 1, _EVERY)
        with ui.element("div").classes("line"):
            ui.label("seen from [deg]").classes("quiet")
            self._from = ui.slider(min=-180, max=180, step=1, value=0).props("dense")
            self._from.props["aria-label"] = "where the camera is, degrees about the vertical"
            self._from.props["data-testid"] = "camera"
            self._from.on("update:model-value", self._look_from, throttle=0.1)
        for choice in (self._direction, self._pick, self._number):
            choice.on_value_change(self._renew)
        studio.on_design.append(lambda moving: self._renew())
        ui.context.client.on_delete(self._put_away)
        app.on_shutdown(self._put_away)

    def _choose_more(self) -> None:
        """A trial's number."""
        self._number = ui.number("or its number", min=0, format="%d").props("dense clearable")
        self._number.props["data-testid"] = "trial"

    @property
    def _recording(self) -> SpatialRecording | None:
        return None if self._shots is None else self._shots.recording

    def _put_away(self) -> None:
        """Ends the film, in the thread that OpenGL has made it in."""
        self._timer.active = False
        if self._shots is not None:
            _RENDERING.submit(self._shots.close)
            self._shots = None

    def _renew(self) -> None:
        """No film any more, as it was of something else: the hand in its posture."""
        self._turn += 1
        self._put_away()
        self._clock.set_text("")
        self._label()
        background_tasks.create(self._show_posture(self._turn))

    async def _show_posture(self, turn: int) -> None:
        study, direction = self.studio.desk.study, str(self._direction.value)
        try:
            pixels, azimuth = await _rendered(lambda: _still(study, direction, self._azimuth))
        except ValueError:  # what is wrong with the design stands beside it
            return
        if self._azimuth is None:
            self._azimuth = self._from.value = azimuth
        if turn == self._turn and not self.studio.closed:
            self._show(pixels)

    async def _look_from(self) -> None:
        self._azimuth = float(self._from.value or 0.0)
        if self._shots is None:
            await self._show_posture(self._turn)
        else:
            self._shots.look_from(self._azimuth)
            await self._draw()

    async def _load(self) -> bool:
        studio, last, turn = self.studio, self._known(), self._turn
        if last is None:
            return False
        direction, number = str(self._direction.value), self._number.value
        self._play.props("loading")
        try:
            pick = str(self._pick.value)
            trial = chosen_trial(last.found, direction, pick) if number is None else int(number)
            recording = await asyncio.to_thread(recorded, last.study, direction, trial)
            shots = await _rendered(lambda: Shots(recording, self._azimuth))
        except ValueError as error:
            studio.refused(str(error))
            return False
        finally:
            self._play.props(remove="loading")
        if turn != self._turn or studio.closed:
            _RENDERING.submit(shots.close)
            return False
        self._shots = shots
        self._begin()
        await self._draw()
        return True

    async def _tick(self) -> None:
        if self._shots is not None and not self._busy:
            self._advance()
            await self._draw()

    async def _draw(self) -> None:
        shots, at = self._shots, self._now
        if shots is None or self._busy:
            return
        self._busy = True
        try:
            pixels = await _rendered(lambda: shots.at(at))
        finally:
            self._busy = False
        if shots is not self._shots:
            return
        self._show(pixels)
        tilt = ", ".join(
            f"{math.degrees(t):+.0f}°" for t in shots.recording.angles(np.array([at]))[0]
        )
        self._tell(at, f"; tilt {tilt}")

    def _show(self, pixels: np.ndarray) -> None:
        from PIL import Image

        file = BytesIO()
        Image.fromarray(pixels).save(file, "JPEG", quality=_QUALITY)
        data = base64.b64encode(file.getvalue()).decode()
        self._image.props["src"] = f"data:image/jpeg;base64,{data}"


def _still(study: Study, direction: str, azimuth: float | None) -> tuple[np.ndarray, float]:
    """The hand with the object at its start, and from where that is seen."""
    scenario: Any = study.scenarios()[direction]
    with Stage(scenario, azimuth=azimuth) as stage:
        return stage.picture(), stage.azimuth


async def _rendered(make: Callable[[], T]) -> T:
    return await asyncio.get_running_loop().run_in_executor(_RENDERING, make)
