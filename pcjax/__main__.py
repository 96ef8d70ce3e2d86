"""The program: `pcjax`, or `python -m pcjax`."""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import NoReturn


def main() -> NoReturn:
    """Runs one command as a process of its own.

    Until its modules are there, Ctrl-C ends it at once: in the middle of JAX's imports an exception
    would be lost, or end in a crash.
    """
    signal.signal(signal.SIGINT, _at_once)
    fuse_outputs()
    # Trials keep all cores busy; threads for small matrices would only wait in their way.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Modules stay: looking through all they are made of, again and again, is a fifth of the time.
    gc.disable()
    from pcjax import cli

    status: object = 0
    try:
        cli.main(ready=_ready)
    except SystemExit as end:
        status = end.code
    if status is None or isinstance(status, int):
        # Worker threads may still be inside XLA, which takes a tenth of a second to be taken apart;
        # nothing is left to be written.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status or 0)
    sys.exit(status)  # pyright: ignore[reportArgumentType]


FUSES = ("0.10.",)
"""Versions of jaxlib, as they begin, with which every program of this package was compiled so."""


def fuse_outputs() -> None:
    """Lets XLA put what has the same inputs into one loop on the CPU: trials are up to twice as
    fast. It is an option of the whole process, which has to be there before JAX is."""
    from importlib.metadata import version

    option = "xla_cpu_use_multi_output_fusion"
    flags = os.environ.get("XLA_FLAGS", "")
    if version("jaxlib").startswith(FUSES) and "xla_backend_extra_options" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} --xla_backend_extra_options={option}".strip()


def _ready() -> None:
    gc.freeze()
    gc.enable()
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _at_once(*_: object) -> NoReturn:
    os.write(2, b"pcjax: interrupted\n")
    os._exit(128 + signal.SIGINT)


if __name__ == "__main__":
    main()
