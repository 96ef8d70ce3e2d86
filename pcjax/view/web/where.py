"""Where objects stay in the hand, beneath its limbs, and from where they escape."""

from __future__ import annotations

import base64
from asyncio import Task, to_thread
from contextlib import suppress
from functools import partial
from io import BytesIO

import numpy as np
from nicegui import background_tasks, ui

from pcjax.quality.occupancy import Occupancy
from pcjax.study.occupancy import occupancy_of_study
from pcjax.study.spec import Study
from pcjax.view.occupancy import shades
from pcjax.view.web.canvas import Canvas
from pcjax.view.web.picture import Frame
from pcjax.view.web.studio import Studio

_TRIALS = (100, 300)
"""Of each look: the first is there at once."""


class Where:
    """A switch for the map; the map follows the design once it rests."""

    def __init__(self, studio: Studio, canvas: Canvas):
        self.studio, self.canvas = studio, canvas
        self._turn = 0
        self._task: Task[None] | None = None
        self._switch = ui.switch("where objects stay")
        self._switch.props["data-testid"] = "occupancy"
        self._switch.on_value_change(self._renew)
        self._switch.tooltip("brighter: longer; dots: the last rest before an escape")
        studio.on_design.append(self._on_design)

    def _on_design(self, moving: bool) -> None:
        self._turn += 1
        self._clear()
        if not moving:
            self._renew()

    def _clear(self) -> None:
        for direction in list(self.canvas.under):
            del self.canvas.under[direction]
            self.canvas.redraw(direction)

    def _renew(self) -> None:
        self._turn += 1
        if not self._switch.value:
            self._clear()
        elif self._task is None or self._task.done():
            self._task = background_tasks.create(self._follow())

    async def _follow(self) -> None:
        """Looks at the newest design, again and again until nothing is left to be seen."""
        done = 0
        while done != self._turn and self._switch.value and not self.studio.closed:
            done = self._turn
            if not self.studio.problem:
                # Another engine than the one for the numbers may not be able to run it.
                with suppress(ValueError):
                    await self._look(done, self.studio.desk.study)

    async def _look(self, turn: int, study: Study) -> None:
        known: dict[str, Occupancy] = {}
        for trials in _TRIALS:
            first = next(iter(known.values())).trials if known else 0
            more = await to_thread(occupancy_of_study, study, trials=trials - first, first=first)
            known = {d: known[d].joined(one) if known else one for d, one in more.items()}
            pictures = {d: await to_thread(map_svg, one) for d, one in known.items()}
            if turn != self._turn or self.studio.closed:
                return
            for direction, svg in pictures.items():
                self.canvas.under[direction] = partial(_drawn, svg, known[direction])
                self.canvas.redraw(direction)


def map_svg(found: Occupancy) -> str:
    """The map as an image in the hand's lengths."""
    import matplotlib.image  # takes long to import

    file = BytesIO()
    matplotlib.image.imsave(file, shades(found), format="png", origin="lower")
    x0, x1, y0, y1 = found.extent
    data = base64.b64encode(file.getvalue()).decode()
    return (
        f'<image href="data:image/png;base64,{data}" x="{x0:.6g}" y="{-y1:.6g}" '
        f'width="{x1 - x0:.6g}" height="{y1 - y0:.6g}" preserveAspectRatio="none" '
        'style="image-rendering:pixelated"/>'
    )


def _drawn(image: str, found: Occupancy, frame: Frame) -> str:
    marks = [
        f'<circle class="escape" cx="{x:.6g}" cy="{-y:.6g}" r="{0.007 * frame.size:.5g}"/>'
        for x, y in np.asarray(found.origins)[found.rested]
    ]
    return image + "".join(marks)
