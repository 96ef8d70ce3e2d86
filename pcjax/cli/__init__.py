"""The command line: evaluate, optimise, sweep, map, film or export hands; the paper's figures."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from pcjax.checks import InputWarning
from pcjax.cli.animate import add_animate
from pcjax.cli.claims import add_claims
from pcjax.cli.evaluate import add_evaluate
from pcjax.cli.export import add_export
from pcjax.cli.figure import add_figure
from pcjax.cli.map import add_map
from pcjax.cli.optimize import add_optimize
from pcjax.cli.parts import HelpFormatter, NegativeNumber, Parser, Terminated, fail
from pcjax.cli.results import add_plot, add_show
from pcjax.cli.study import add_study
from pcjax.cli.sweep import add_sweep
from pcjax.compilation_cache import use_compilation_cache
from pcjax.results import package_version


def main(argv: Sequence[str] | None = None) -> None:
    """Runs one command. Exit status 0, 2 for bad input, 130 by Ctrl-C, 143 when terminated."""
    arguments = _parse(sys.argv[1:] if argv is None else list(argv))
    use_compilation_cache()
    try:
        with _told_to_end(), warnings.catch_warnings():
            warnings.simplefilter("always", InputWarning)
            warnings.showwarning = _in_one_line(warnings.showwarning)
            arguments.run(arguments)
    except ValueError as error:
        fail(str(error))
    except OSError as error:
        fail(f"cannot write {error.filename or 'the output'}: {error.strerror or error}")
    except (KeyboardInterrupt, Terminated) as stop:
        what = "terminated" if isinstance(stop, Terminated) else "interrupted"
        print(f"pcjax: {'; '.join([what, *getattr(stop, '__notes__', ())])}", file=sys.stderr)
        sys.exit(128 + (signal.SIGTERM if what == "terminated" else signal.SIGINT))


@contextmanager
def _told_to_end() -> Iterator[None]:
    """Turns SIGTERM into `Terminated`, so that whatever is at work leaves its files in order."""

    def end(*_: object) -> NoReturn:
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _in_one_line(show: Callable[..., None]) -> Callable[..., None]:
    """A way to show warnings: of input, as a line of the command's own; others as they were."""

    def mine(message: Warning | str, category: type[Warning], *where: Any) -> None:
        if issubclass(category, InputWarning):
            print(f"pcjax: {message}", file=sys.stderr)
        else:
            show(message, category, *where)

    return mine


def _parse(argv: list[str]) -> argparse.Namespace:
    parser = Parser(
        prog="pcjax",
        description="How well a planar robot hand cages an object without closing on it.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"pcjax {package_version()}")
    commands = parser.add_subparsers(dest="command", metavar="command")
    each = {
        "evaluate": (add_evaluate, "evaluate one hand: DoEs, EoEn and the score"),
        "optimize": (add_optimize, "look for a better hand"),
        "study": (add_study, "check a study file, or print an example"),
        "sweep": (add_sweep, "evaluate every condition of a study's sweep"),
        "show": (add_show, "print kept results"),
        "plot": (add_plot, "draw kept results"),
        "map": (add_map, "map the score over two parameters"),
        "animate": (add_animate, "film one trial"),
        "export": (add_export, "draw the hand for CAD"),
        "figure": (add_figure, "redo one of the paper's figures"),
        "claims": (add_claims, "check the paper's claims"),
    }
    subparsers = {}
    for name, (add, text) in each.items():
        subparsers[name] = commands.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + ".",
            allow_abbrev=False,
            formatter_class=HelpFormatter,
        )
        # "-1e1", "-inf" and "-nan" are values, not flags.
        subparsers[name]._negative_number_matcher = NegativeNumber()
        add(subparsers[name])
    arguments, unknown = parser.parse_known_args(argv)
    if unknown:
        subparsers.get(arguments.command, parser).unknown(unknown)
    if arguments.command is None:
        parser.print_help()
        sys.exit(0)
    return arguments
