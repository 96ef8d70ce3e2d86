"""`pcjax export`: the hand for CAD."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import check_writable, number
from pcjax.export import check_drawing, export_hand
from pcjax.model.scenario import check_geometry, does


def add_export(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add = parser.add_argument
    add(
        "--thickness",
        type=number,
        default=None,
        metavar="T",
        help="draw each limb's outline too, this thick, in model units",
    )
    add("--with-object", action="store_true", help="draw the object too, at a start")
    add(
        "--out",
        type=Path,
        default=Path("hand.svg"),
        metavar="FILE",
        help="the drawing, .svg or .dxf, one model unit a millimetre",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    check_writable(arguments.out)
    check_drawing(arguments.out)
    study = condition(arguments)
    check_geometry(does(study.hand, study.body, study.drive, study.law))
    body = study.body if arguments.with_object else None
    export_hand(study.hand, arguments.out, thickness=arguments.thickness, body=body)
    print(f"drawing: {arguments.out}")
