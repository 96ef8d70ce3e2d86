"""What the commands share: the parser and its one-line errors, common flags, checks of files."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from pcjax import paper
from pcjax.checks import did_you_mean
from pcjax.engines.choice import ENGINES
from pcjax.study.spec import Run

PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp")


def fail(message: str) -> NoReturn:
    print(f"pcjax: {message}", file=sys.stderr)
    sys.exit(2)


class Terminated(SystemExit):
    """SIGTERM has come: there is time to leave the files in order, and for nothing else."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, with the nearest name for a misspelt one."""

    def error(self, message: str) -> NoReturn:
        fail(f"{message} (see '{self.prog} --help')")

    def unknown(self, words: Sequence[str]) -> NoReturn:
        word = words[0]
        flags = [flag for flag in self._option_string_actions if flag.startswith("--")]
        hint = did_you_mean(word.split("=")[0], flags)
        what = "flag" if word.startswith("-") else "argument"
        self.error(f"unknown {what} {word}" + (f": {hint.rstrip()}" if hint else ""))

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            allowed = [str(choice) for choice in action.choices]
            hint = did_you_mean(str(value), allowed)
            name = "/".join(action.option_strings) or action.metavar or action.dest
            self.error(f"{name} is {value!r}: {hint}it has to be one of {', '.join(allowed)}")


class HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Adds the default to a flag's help where there is one to tell."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        told = action.default is None or action.default is False
        return action.help if told else super()._get_help_string(action)


class NegativeNumber:
    def match(self, text: str) -> bool:
        try:
            float(text)
        except ValueError:
            return False
        return text.startswith("-")


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def whole(text: str) -> int:
    try:
        return int(text.replace("_", "").replace(",", ""))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def add_run(parser: argparse.ArgumentParser, trials: int = paper.TRIALS) -> None:
    """Flags that all commands which simulate share; None where they are not given."""
    add = parser.add_argument
    add(
        "--trials",
        type=whole,
        default=None,
        help=f"trials for each condition (default: {trials})",
    )
    add_experiment(parser)
    add("--engine", choices=ENGINES, default=None, help="how trials are run (default: auto)")
    add_dt(parser, "the engine's choice; the paper's is 0.001")
    add(
        "--precision",
        type=whole,
        choices=(32, 64),
        default=None,
        help="bits of a number (default: 32)",
    )


def add_experiment(parser: argparse.ArgumentParser) -> None:
    """Flags that say which experiments trials are; None where they are not given."""
    add = parser.add_argument
    add(
        "--max-steps",
        type=whole,
        default=None,
        help="limit, steps of 0.001 s (default: the paper's: 600,000 on the wrist, 300,000 on the "
        "arm, 180,000 for a stick)",
    )
    add("--seed", type=whole, default=None, help="trial i depends on (seed, i) alone (default: 0)")


def add_dt(parser: argparse.ArgumentParser, default: str) -> None:
    """The solver's step, and what it is unless given."""
    parser.add_argument(
        "--dt",
        type=number,
        default=None,
        metavar="SECONDS",
        help=f"the solver's step (default: {default})",
    )


RUN_FLAGS = ("trials", "max_steps", "seed", "engine", "dt", "precision")


def run_settings(arguments: argparse.Namespace, usual: Run) -> dict[str, Any]:
    """How to run: the flags given, and the usual for the others."""
    given = {name: getattr(arguments, name) for name in RUN_FLAGS}
    settings = {name: getattr(usual, name) if v is None else v for name, v in given.items()}
    return settings | {"progress": True}


def check_writable(path: Path | None) -> None:
    """Fails before the work, not after it, when a file cannot be written."""
    if path is None:
        return
    folder = path.parent
    if not folder.is_dir():
        raise ValueError(f"cannot write {path}: the folder {folder} does not exist")
    if path.is_dir():
        raise ValueError(f"cannot write {path}: it is a folder")
    if path.exists() and not path.is_file():
        raise ValueError(f"cannot write {path}: it is no plain file")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise ValueError(f"cannot write {path}: no permission")


def check_picture(path: Path | None) -> None:
    """Fails before the work when a picture cannot be written or is of no known kind."""
    check_writable(path)
    if path is not None and path.suffix.lower() not in PICTURES:
        raise ValueError(f"cannot draw {path}: its ending has to be one of {', '.join(PICTURES)}")


def save_picture(plot: str, data: Any, path: Path) -> None:
    """Draws with a function of `pcjax.viz.plots` or `pcjax.viz.designs`."""
    from pcjax.viz import designs, plots  # matplotlib takes a second to import

    draw = getattr(plots, plot, None) or getattr(designs, plot)
    draw(data).savefig(path, dpi=130)
