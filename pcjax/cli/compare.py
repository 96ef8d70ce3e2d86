"""`pcjax compare`: several hands on the same trials."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pcjax.cli.parts import (
    add_direction,
    add_outputs,
    add_precision_target,
    add_run,
    as_flags_say,
    check_picture,
    save_picture,
    settle_outputs,
)
from pcjax.study.compare import compare, names_of
from pcjax.study.read import load_study


def add_compare(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("studies", type=Path, nargs="+", metavar="FILE", help="study files (TOML), two or more")
    add_direction(parser, "each study's own")
    add_run(parser)
    add_precision_target(
        parser, "each difference to the best hand is this share of the best's score"
    )
    add("--json", action="store_true", help="print one JSON object on stdout, nothing else")
    add_outputs(parser, plot="draw the hands side by side")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_picture(arguments.plot)
    names = names_of([str(path) for path in arguments.studies])
    if len(set(names)) < len(names):
        raise ValueError("a study file is named twice")
    studies = {
        name: as_flags_say(load_study(path), arguments)
        for name, path in zip(names, arguments.studies, strict=True)
    }
    for study in studies.values() if arguments.plot else ():
        study.check_drawn()
    ranking = compare(studies, progress=True)
    if arguments.plot:
        save_picture(ranking.drawn_by, ranking, arguments.plot)
    print(json.dumps(ranking.as_json()) if arguments.json else ranking)
