"""`pcjax evaluate`: one hand."""

from __future__ import annotations

import argparse
import json
import sys

from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import (
    add_direction,
    add_outputs,
    add_precision_target,
    add_run,
    check_data,
    check_picture,
    save_picture,
    settle_outputs,
)
from pcjax.importing import results_meanwhile
from pcjax.study.evaluate import evaluate_study


def add_evaluate(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add = parser.add_argument
    add_direction(parser, "both on the wrist, does on the arm")
    add_run(parser)
    add_precision_target(parser, "the score is this share of it")
    add("--json", action="store_true", help="print one JSON object on stdout, nothing else")
    add_outputs(parser, data="keep everything: .nc (netCDF)", plot="draw hand and survival curves")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_picture(arguments.plot)
    check_data(arguments.out)
    study = condition(arguments)
    if study.sweep is not None:
        print("pcjax: the study's [sweep] is left out: 'pcjax sweep' runs it", file=sys.stderr)
    if arguments.plot:
        study.check_drawn()
    results_meanwhile(kept=bool(arguments.out or arguments.plot))
    result = evaluate_study(study, progress=True)
    if arguments.out:
        result.save(arguments.out)
    if arguments.plot:
        save_picture(result.drawn_by, result, arguments.plot)
    print(json.dumps(result.as_json()) if arguments.json else result)
