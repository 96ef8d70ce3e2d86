"""`pcjax study`: an example of a study file, or what one asks for."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from pcjax.cli.parts import check_writable
from pcjax.results.saving import save_text
from pcjax.study.read import EXAMPLE, load_study
from pcjax.sweep.plan import Plan


def add_study(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("study", type=Path, nargs="?", default=None, metavar="FILE", help="to be checked")
    add(
        "--example",
        action="store_true",
        help="print a commented study that runs; with FILE, write it there",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    path = arguments.study
    if arguments.example:
        if path is None:
            print(EXAMPLE, end="")
            return
        check_writable(path)
        if path.exists():
            raise ValueError(f"{path} is there already: name another file for the example")
        save_text(EXAMPLE, path)
        return
    if path is None:
        raise ValueError("name a study file, or ask for --example")
    study = load_study(path)
    print(study.to_toml())
    if study.sweep is not None:
        print(Plan(study).describe(os.cpu_count() or 1))
