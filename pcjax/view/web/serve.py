"""The server behind the page: on this machine alone, for pages that it has given out itself."""

from __future__ import annotations

import errno
import os
import socket
import sys
import webbrowser
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from pcjax.study.evaluate import Experiment
from pcjax.study.spec import Study
from pcjax.view.web.studio import AT_REST

HOST = "127.0.0.1"

PORT = 8420
"""Unless given; the next free one if it is taken."""

_NAMES = ("127.0.0.1", "localhost")

_NEXT = 20

Scope = MutableMapping[str, Any]
App = Callable[
    [Scope, Callable[..., Awaitable[Any]], Callable[..., Awaitable[Any]]], Awaitable[Any]
]


class OwnPagesOnly:
    """Refuses what other sites ask a browser to send here: a foreign Origin, or a name that leads
    here without being this machine's (DNS rebinding)."""

    def __init__(self, app: App, port: int):
        self._app, self._hosts = app, {f"{name}:{port}" for name in _NAMES}

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket") or self._own(dict(scope["headers"])):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await send(
                {
                    "type": "http.response.start",
                    "status": 403,
                    "headers": [(b"content-type", b"text/plain")],
                }
            )
            await send(
                {"type": "http.response.body", "body": b"this page is for this machine alone\n"}
            )

    def _own(self, headers: dict[bytes, bytes]) -> bool:
        host = headers.get(b"host", b"").decode("latin-1")
        origin = headers.get(b"origin")
        foreign = (
            origin is not None and urlsplit(origin.decode("latin-1")).netloc not in self._hosts
        )
        return host in self._hosts and not foreign


def free_port(wanted: int | None) -> int:
    """A port that nobody listens on.

    Raises:
        ValueError: the one that was asked for is taken, or none can be had.
    """
    for port in [wanted] if wanted is not None else range(PORT, PORT + _NEXT):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                one.bind((HOST, port))
            except OSError as error:
                if wanted is not None:
                    taken = error.errno == errno.EADDRINUSE
                    why = "something listens there already" if taken else error.strerror
                    raise ValueError(f"port {port} cannot be had: {why}") from None
                continue
            return port
    raise ValueError(f"no port from {PORT} to {PORT + _NEXT - 1} is free: name one with --port")


def check_web() -> None:
    """
    Raises:
        ValueError: there is no nicegui.
    """
    try:
        import nicegui  # noqa: F401
    except ImportError:
        raise ValueError("the page needs the package nicegui: pip install 'pcjax[view]'") from None


def warm_up(study: Study) -> None:
    """Compiles what the page runs, so that the first move does not have to wait for it.

    Raises:
        ValueError: the study cannot be evaluated.
    """
    experiment = Experiment(study)
    for trials in AT_REST[:3]:
        experiment.go_on(trials)


def serve(
    study: Study, *, name: str = "", folder: Path, port: int | None = None, browser: bool = True
) -> None:
    """Serves the page until it is interrupted.

    Arguments:
        study, name: what it begins with, and the name of its file.
        folder: where the page may read and write files.
        port: on 127.0.0.1.
        browser: whether to open it in a browser.

    Raises:
        ValueError: no nicegui, no such port, or a study that cannot be evaluated.
    """
    check_web()
    port = free_port(port)
    warm_up(study)
    # It keeps no file: what a page has to know again is in memory, by the browser's tab.
    os.environ.setdefault("NICEGUI_STORAGE_PATH", os.devnull)
    from nicegui import app, ui

    from pcjax.view.web.page import page

    address = f"http://{HOST}:{port}/"

    async def root() -> None:
        await page(study, name, folder)

    def ready() -> None:
        print(f"the page is at {address} (Ctrl-C ends it)", file=sys.stderr, flush=True)
        if browser:
            webbrowser.open(address)

    app.add_middleware(OwnPagesOnly, port=port)
    app.on_startup(ready)
    ui.run(
        root,
        host=HOST,
        port=port,
        title="pcjax",
        favicon="🖐",
        reload=False,
        show=False,
        show_welcome_message=False,
        dark=None,
    )
