"""The program: `pcjax`, or `python -m pcjax`."""

from __future__ import annotations

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
    from pcjax import cli

    status: object = 0
    try:
        cli.main(ready=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))
    except SystemExit as end:
        status = end.code
    if status in (cli.INTERRUPTED, cli.TERMINATED):
        # Worker threads may still be inside XLA; nothing is left to be written.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)  # pyright: ignore[reportArgumentType]


def _at_once(*_: object) -> NoReturn:
    os.write(2, b"pcjax: interrupted\n")
    os._exit(128 + signal.SIGINT)


if __name__ == "__main__":
    main()
