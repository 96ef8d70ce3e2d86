"""`pcjax export`: the hand for CAD."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import add_outputs, check_plane, check_writable, settle_outputs
from pcjax.model.scenario import does
from pcjax.view.export import check_drawing, export_hand


def add_export(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    parser.add_argument(
        "--with-object", action="store_true", help="draw the object too, at a start"
    )
    add_outputs(
        parser,
        plot="the drawing, .svg or .dxf, to scale; one model unit is drawn as a millimetre",
        plot_default=Path("hand.svg"),
        before={"out": "plot"},
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_writable(arguments.plot)
    check_drawing(arguments.plot)
    study = condition(arguments)
    check_plane(study, "a drawing for CAD")
    does(study.hand, study.body, study.drive, study.law).check()
    body = study.body if arguments.with_object else None
    export_hand(study.hand, arguments.plot, body=body, units=study.units)
    print(f"drawing: {arguments.plot}")
