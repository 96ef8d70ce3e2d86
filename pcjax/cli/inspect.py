"""`pcjax inspect`: a study before trials are spent on it."""

from __future__ import annotations

import argparse
import json

from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import add_outputs, check_picture, save_picture, settle_outputs
from pcjax.study.inspect import inspect


def add_inspect(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_outputs(parser, plot="draw the hand in both directions, with the starts")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_picture(arguments.plot)
    found = inspect(condition(arguments))
    if arguments.plot:
        save_picture(found.drawn_by, found, arguments.plot)
    print(json.dumps(found.as_json()) if arguments.json else found)
