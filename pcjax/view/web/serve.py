"""The server behind the page: on this machine alone, for pages that it has given out itself."""

from __future__ import annotations

import errno
import importlib
import importlib.util
import os
import socket
import sys
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from pcjax.study.spec import Study

HOST = "127.0.0.1"

PORT = 8420
"""Unless given; the next free one if it is taken."""

_NAMES = ("127.0.0.1", "localhost")

_NEXT = 20

_UNFRAMED = [
    (b"x-frame-options", b"DENY"),
    (b"content-security-policy", b"frame-ancestors 'none'"),
]

Scope = MutableMapping[str, Any]
App = Callable[
    [Scope, Callable[..., Awaitable[Any]], Callable[..., Awaitable[Any]]], Awaitable[Any]
]


class OwnPagesOnly:
    """Refuses what other sites ask a browser to send here: a foreign Origin, a request from one of
    their pages that is no link to follow, or a name that leads here without being this machine's
    (DNS rebinding). No other page may have this one in a frame."""

    def __init__(self, app: App, port: int):
        self._app, self._hosts = app, {f"{name}:{port}" for name in _NAMES}
        if port == 80:
            self._hosts |= set(_NAMES)

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        async def unframed(message: Scope) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *_UNFRAMED]
            await send(message)

        if scope["type"] not in ("http", "websocket") or self._own(dict(scope["headers"])):
            await self._app(scope, receive, unframed)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            kind = [(b"content-type", b"text/plain")]
            await send({"type": "http.response.start", "status": 403, "headers": kind})
            await send({"type": "http.response.body", "body": b"for this machine alone\n"})

    def _own(self, headers: dict[bytes, bytes]) -> bool:
        def told(name: bytes) -> str:
            return headers.get(name, b"").decode("latin-1")

        foreign = False
        if b"origin" in headers:
            try:
                foreign = urlsplit(told(b"origin")).netloc not in self._hosts
            except ValueError:
                foreign = True
        sent = told(b"sec-fetch-site") == "cross-site" and told(b"sec-fetch-mode") != "navigate"
        return told(b"host") in self._hosts and not foreign and not sent


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
    if importlib.util.find_spec("nicegui") is None:
        raise ValueError("the page needs the package nicegui: pip install 'pcjax[view]'")


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
        ValueError: no nicegui, no such port, or a study that cannot be evaluated or drawn.
    """
    check_web()
    free_port(port)  # before the work
    # It keeps no file: what a page has to know again is in memory, by the browser's tab.
    os.environ.setdefault("NICEGUI_STORAGE_PATH", os.devnull)
    pages = importlib.import_module(f"pcjax.{study.page_in}")
    pages.warm_up(study)
    port = free_port(port)
    from nicegui import app, ui

    async def root() -> None:
        await pages.page(study, name, folder)

    def ready() -> None:
        print(f"the page is at http://{HOST}:{port}/ (Ctrl-C ends it)", file=sys.stderr, flush=True)

    app.add_middleware(OwnPagesOnly, port=port)
    app.on_startup(ready)
    ui.run(
        root,
        host=HOST,
        port=port,
        title="pcjax",
        favicon="🖐",
        reload=False,
        show=browser,
        show_welcome_message=False,
        dark=None,
    )
