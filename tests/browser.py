"""A browser that visits the page of `pcjax view`."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)

_LONG = 30_000
"""Milliseconds that anything on the page may take, on a busy machine."""

_START = 180.0
"""Seconds that it may take to compile all that the page runs."""


@dataclass(frozen=True)
class Served:
    """Where a page is, and the process that serves it."""

    address: str
    process: int


@contextmanager
def page_served(folder: Path, *arguments: str) -> Iterator[Served]:
    """Runs `pcjax view` in a folder."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    words = [sys.executable, "-m", "pcjax", "view", "--no-browser", "--port", str(port), *arguments]
    with (folder / ".said").open("w+") as said:
        # As a user has it: NiceGUI behaves in another way where it sees pytest.
        env = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
        server = subprocess.Popen(words, cwd=folder, env=env, stderr=said, stdout=said)
        address = f"http://127.0.0.1:{port}/"
        try:
            end = time.monotonic() + _START
            while True:
                try:
                    urllib.request.urlopen(address).read()
                    break
                except OSError:
                    if server.poll() is not None or time.monotonic() > end:
                        said.seek(0)
                        raise AssertionError(f"no page: {said.read()}") from None
                    time.sleep(0.1)
            yield Served(address, server.pid)
        finally:
            server.terminate()
            server.wait()
        said.seek(0)
        text = said.read()
        assert "Traceback" not in text, text


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium, without a window; skips where there is none."""
    api = pytest.importorskip("playwright.sync_api")
    found = next(filter(None, map(shutil.which, _NAMES)), None)
    with api.sync_playwright() as playwright:
        if found is None and not os.path.exists(playwright.chromium.executable_path):
            pytest.skip("no browser: there is neither chromium nor playwright's own")
        one = playwright.chromium.launch(executable_path=found, args=list(_FLAGS))
        try:
            yield one
        finally:
            one.close()


class Visitor:
    """Somebody at the page.

    Attributes:
        page: Playwright's.
        errors: what the console has complained about.
        outside: what was asked for elsewhere.
    """

    def __init__(self, browser: Any, address: str, **context: Any):
        size = {"width": 1280, "height": 800}
        self.context = browser.new_context(**({"viewport": size} | context))
        self.page = self.context.new_page()
        self.page.set_default_timeout(_LONG)
        self.errors: list[str] = []
        self.outside: list[str] = []
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", self._asked)
        self.address = address
        self.page.goto(address)
        self.refined()

    def _heard(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def _asked(self, request: Any) -> None:
        if not request.url.startswith((self.address, "data:", "blob:")):
            self.outside.append(request.url)

    def at(self, name: str) -> Any:
        """An element by its test id."""
        return self.page.get_by_test_id(name)

    def told(self, name: str) -> str:
        """Its text."""
        return self.at(name).text_content() or ""

    def until(self, name: str, text: str) -> str:
        """Waits until an element says something; all that it says."""
        self.page.wait_for_function(
            '([name, text]) => document.querySelector(`[data-testid="${name}"]`)'
            "?.textContent.includes(text)",
            arg=[name, text],
        )
        return self.told(name)

    def refined(self) -> str:
        """Waits until the design has had all of its trials; the score."""
        # What was done has to have reached the server; from then on other numbers are stale.
        self.page.wait_for_timeout(300)
        self.page.locator(".numbers:not(.stale)").wait_for()
        self.until("about", "5,000 trials")
        return self.told("score")

    def drag(self, name: str, right: float, down: float, *, hold: bool = False) -> None:
        """Drags an element by some pixels; `hold`: without letting go."""
        x, y = self.middle(name)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + right, y + down, steps=12)
        if not hold:
            self.page.mouse.up()

    def middle(self, name: str) -> tuple[float, float]:
        """Where an element is, in pixels."""
        box = self.at(name).bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def file(self, what: str, name: str) -> None:
        """Opens or saves a file."""
        self.at(what).click()
        self.at("file").fill(name)
        self.at("file-done").click()

    def notified(self, text: str) -> None:
        """Waits for a notice."""
        self.page.get_by_text(text).first.wait_for()

    def download(self, ending: str) -> bytes:
        """What an export is."""
        with self.page.expect_download() as coming:
            self.at("export").click()
            self.at(f"export-{ending}").click()
        return Path(coming.value.path()).read_bytes()

    def touch(self, name: str, right: float, down: float) -> None:
        """Drags an element with a finger."""
        x, y = self.middle(name)
        session = self.context.new_cdp_session(self.page)

        def send(kind: str, *points: tuple[float, float]) -> None:
            touched = [{"x": a, "y": b} for a, b in points]
            session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touched})

        send("touchStart", (x, y))
        for k in range(1, 9):
            send("touchMove", (x + right * k / 8, y + down * k / 8))
            self.page.wait_for_timeout(30)
        send("touchEnd")

    def well(self) -> None:
        """Nothing was wrong, and nothing was asked for elsewhere."""
        assert self.errors == []
        assert self.outside == []
