"""The command line: evaluate, optimise, sweep, map, film or export hands; the paper's figures."""

from __future__ import annotations

import argparse
import codecs
import importlib
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from pcjax.cli.parser import HelpFormatter, NegativeNumber, Parser, Terminated, fail
from pcjax.words import InputWarning, in_ascii, package_version

COMMANDS = {
    "inspect": ("inspect", "look at a study before trials are spent on it"),
    "evaluate": ("evaluate", "evaluate one hand: DoEs, EoEn and the score"),
    "energy": ("energy", "how high the object has to climb to get out, with no trial run"),
    "compare": ("compare", "rank several hands on the same trials"),
    "optimize": ("optimize", "look for a better hand"),
    "study": ("study", "check a study file, or print an example"),
    "sweep": ("sweep", "evaluate every condition of a study's sweep"),
    "show": ("results", "print kept results"),
    "plot": ("results", "draw kept results, or where objects stay in a hand"),
    "map": ("map", "map the score over two parameters"),
    "view": ("view", "drag the hand in the browser, and see its score follow"),
    "animate": ("animate", "film one trial"),
    "export": ("export", "draw the hand for CAD"),
    "figure": ("figure", "redo one of the paper's figures"),
    "claims": ("claims", "check the paper's claims"),
    "completion": ("completion", "let a shell complete commands and flags"),
}
"""Each command's module, which is imported when the command is run (JAX takes half a second, and
what draws another), and what it does. The module has a function `add_COMMAND`."""


INTERRUPTED, TERMINATED, BROKEN_PIPE = 128 + signal.SIGINT, 128 + signal.SIGTERM, 128 + 13
"""Exit status after Ctrl-C, after SIGTERM, and where nobody reads on."""


def main(argv: Sequence[str] | None = None, *, ready: Callable[[], Any] = lambda: None) -> None:
    """Runs one command. Exit status 0, 2 for bad input, 130 by Ctrl-C, 143 when terminated.

    Arguments:
        argv: the words after the program's name; the process's own unless given.
        ready: called once all modules are there, before the command runs.
    """
    _write_in_any_encoding()
    try:
        with _told_to_end(), warnings.catch_warnings():
            arguments = _parse(sys.argv[1:] if argv is None else list(argv))
            from pcjax.cli.compilation_cache import use_compilation_cache

            use_compilation_cache()
            ready()
            warnings.simplefilter("always", InputWarning)
            warnings.showwarning = _in_one_line(warnings.showwarning)
            arguments.run(arguments)
            sys.stdout.flush()
    except ValueError as error:
        fail(str(error))
    except BrokenPipeError:
        # Whoever read has seen enough. What is left must not be tried again on the way out.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(BROKEN_PIPE)
    except OSError as error:
        fail(f"cannot write {error.filename or 'the output'}: {error.strerror or error}")
    except (KeyboardInterrupt, Terminated) as stop:
        what = "terminated" if isinstance(stop, Terminated) else "interrupted"
        print(f"pcjax: {'; '.join([what, *getattr(stop, '__notes__', ())])}", file=sys.stderr)
        sys.exit(TERMINATED if what == "terminated" else INTERRUPTED)


def _write_in_any_encoding() -> None:
    """Lets stdout and stderr spell what their encoding lacks."""

    def spelt(error: UnicodeError) -> tuple[str, int]:
        assert isinstance(error, UnicodeEncodeError)
        return in_ascii(error.object[error.start : error.end]), error.end

    codecs.register_error("pcjax", spelt)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="pcjax")


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
    chosen = next((word for word in argv if not word.startswith("-")), None)
    subparsers = _add_commands(commands, lambda name: name == chosen)
    arguments, unknown = parser.parse_known_args(argv)
    if unknown:
        subparsers.get(arguments.command, parser).unknown(unknown)
    if arguments.command is None:
        parser.print_help()
        sys.exit(0)
    return arguments


def _add_commands(commands: Any, wanted: Callable[[str], bool]) -> dict[str, Parser]:
    """Adds all commands, those wanted with their arguments."""
    added = {}
    for name, (module, text) in COMMANDS.items():
        added[name] = commands.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + ".",
            allow_abbrev=False,
            formatter_class=HelpFormatter,
        )
        # "-1e1", "-inf" and "-nan" are values, not flags.
        added[name]._negative_number_matcher = NegativeNumber()
        if wanted(name):
            found = importlib.import_module(f"pcjax.cli.{module}")
            getattr(found, f"add_{name}")(added[name])
    return added


def every_parser() -> dict[str, Parser]:
    """The parser of each command, with its arguments."""
    return _add_commands(Parser().add_subparsers(), lambda _: True)
