"""`pcjax energy`: how high the object has to climb to get out, for each direction of gravity."""

from __future__ import annotations

import argparse
import json
import math

from pcjax.checks import check_between
from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import (
    add_direction,
    add_outputs,
    check_picture,
    check_plane,
    number,
    settle_outputs,
    whole,
)
from pcjax.quality.energy import ORIENTATIONS, TILTS
from pcjax.study.energy import energy_of_study, energy_table


def add_energy(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add_direction(parser, "both where the hand has both, does on the arm")
    parser.add_argument(
        "--tilts", type=whole, default=TILTS, help="of how many directions of gravity"
    )
    parser.add_argument(
        "--orientations",
        type=whole,
        default=ORIENTATIONS,
        metavar="N",
        help="at how many angles an object that turns is looked at; the more, the closer is what "
        "it needs at most",
    )
    parser.add_argument(
        "--at",
        type=number,
        nargs="+",
        default=None,
        metavar="DEG",
        help="tilts at which the hand is drawn (default: as a trial begins, and 90)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_outputs(parser, plot="draw the climb by tilt, and the ways out in the hand")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_picture(arguments.plot)
    if arguments.at is not None and arguments.plot is None:
        raise ValueError("--at is for the picture: say where that goes with --plot FILE")
    for tilt in arguments.at or ():
        check_between("--at", tilt, -360, 360)
    study = condition(arguments)
    check_plane(study, "escape energy")
    found = energy_of_study(study, tilts=arguments.tilts, orientations=arguments.orientations)
    if arguments.plot:
        # Imported where it is needed: matplotlib takes a second.
        from pcjax.view.energy import plot_energy

        at = None if arguments.at is None else [math.radians(tilt) for tilt in arguments.at]
        plot_energy(found, study.units, at).savefig(arguments.plot, dpi=130)
    if arguments.json:
        told = {direction: one.as_json() for direction, one in found.items()}
        print(json.dumps({"units": study.units, **told}))
    else:
        print(energy_table(found, study.units))
