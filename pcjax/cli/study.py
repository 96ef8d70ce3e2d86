"""`pcjax study`: an example of a study file, or what one asks for."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from pcjax.study import EXAMPLE, load_study
from pcjax.sweep import Plan


def add_study(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("study", type=Path, nargs="?", default=None, metavar="FILE", help="to be checked")
    add("--example", action="store_true", help="print a commented study file that runs")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    if arguments.example == (arguments.study is not None):
        raise ValueError("name a study file, or ask for --example")
    if arguments.example:
        print(EXAMPLE, end="")
        return
    study = load_study(arguments.study)
    print(study.to_toml())
    if study.sweep is not None:
        print(Plan(study).describe(os.cpu_count() or 1))
