"""`python -m tests.film docs/view.gif`: films a visit to the page of `pcjax view`."""

from __future__ import annotations

import sys
import tempfile
from io import BytesIO
from pathlib import Path

from PIL import Image

from tests.browser import Visitor, browser, page_served

_SIZE = 900, 562
_TENTH = 100
"""Milliseconds that a picture is shown, unless it is shown longer."""


class Film:
    """Pictures of a page, one after the other."""

    def __init__(self, visitor: Visitor):
        self._page = visitor.page
        self._pictures: list[Image.Image] = []
        self._times: list[int] = []

    def take(self, milliseconds: int = _TENTH) -> None:
        """One more, shown for so long."""
        picture = Image.open(BytesIO(self._page.screenshot()))
        self._pictures.append(picture.convert("RGB").resize(_SIZE, Image.Resampling.LANCZOS))
        self._times.append(milliseconds)

    def drag(self, visitor: Visitor, name: str, right: float, down: float, steps: int = 14) -> None:
        """Drags something while the film goes on."""
        x, y = visitor.middle(name)
        mouse = visitor.page.mouse
        mouse.move(x, y)
        mouse.down()
        for k in range(1, steps + 1):
            mouse.move(x + right * k / steps, y + down * k / steps)
            visitor.page.wait_for_timeout(120)
            self.take(120)
        mouse.up()
        visitor.page.wait_for_timeout(1000)
        self.take(1500)

    def save(self, path: Path) -> None:
        """As a GIF, in the colours that some of its pictures have."""
        some = self._pictures[:: max(len(self._pictures) // 8, 1)]
        sheet = Image.new("RGB", (_SIZE[0], _SIZE[1] * len(some)))
        for k, picture in enumerate(some):
            sheet.paste(picture, (0, k * _SIZE[1]))
        palette = sheet.quantize(192)
        drawn = [
            picture.quantize(palette=palette, dither=Image.Dither.NONE)
            for picture in self._pictures
        ]
        drawn[0].save(
            path,
            save_all=True,
            append_images=drawn[1:],
            duration=self._times,
            loop=0,
            optimize=True,
        )


def main(path: Path) -> None:
    """A visit: a drag, a pin, a design that is none, a trial, a search."""
    with (
        tempfile.TemporaryDirectory() as folder,
        browser() as chromium,
        page_served(Path(folder)) as served,
    ):
        me = Visitor(chromium, served.address)
        film = Film(me)
        me.at("pin").click()
        me.refined()
        film.take(1500)
        film.drag(me, "fingertip-1", 10, 30)
        film.drag(me, "joint-2-3", 12, 0, steps=8)
        film.drag(me, "fingertip-2", -70, 10, steps=8)
        me.at("undo").click()
        me.refined()
        me.at("occupancy").click()
        me.page.locator("[data-testid=hand-does] image").wait_for()
        film.take(1500)
        me.at("play").click()
        me.until("clock", "escaped")
        for _ in range(30):
            film.take()
            me.page.wait_for_timeout(40)
        me.at("occupancy").click()
        me.page.get_by_role("tab", name="improve").click()
        me.at("optimise").click()
        while "unseen" not in me.told("optimum"):
            film.take(200)
            me.page.wait_for_timeout(300)
        me.at("take").click()
        me.refined()
        film.take(3000)
        me.well()
    film.save(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
