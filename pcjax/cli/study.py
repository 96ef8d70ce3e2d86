"""`pcjax study`: an example of a study file, one of a drawn hand, or what one asks for."""

from __future__ import annotations

import argparse
import os
import warnings
from pathlib import Path

from pcjax.cli.parts import check_writable, number, whole
from pcjax.model.bodies.circle import Circle
from pcjax.results.saving import save_text
from pcjax.study.drawing import drawn_hand
from pcjax.study.read import EXAMPLES, example, load_study
from pcjax.study.spec import Study
from pcjax.sweep.plan import Plan
from pcjax.units import UNITS
from pcjax.words import InputWarning

_OF_A_DRAWING = ("units", "palm", "thickness", "radius")


def add_study(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("study", type=Path, nargs="?", default=None, metavar="FILE", help="to be checked")
    add(
        "--example",
        nargs="?",
        const=EXAMPLES[0],
        default=None,
        metavar="NAME",
        help="print a commented study that runs, of a hand in the plane or, with NAME mujoco, of "
        "one in three dimensions; with FILE, write it there",
    )
    add(
        "--hand",
        type=Path,
        default=None,
        metavar="DRAWING",
        help="print a study of a hand that is drawn, .dxf or .svg: the middle lines of its palm "
        "and limbs (pip install 'pcjax[cad]'); with FILE, write it there",
    )
    add(
        "--units",
        choices=UNITS,
        default=None,
        help="with --hand: of its lengths, and of --thickness and --radius; a model unit is drawn "
        "as a mm (default: the drawing's own)",
    )
    add(
        "--palm",
        type=whole,
        default=None,
        metavar="K",
        help="with --hand: which line is the palm, from 1 at finger 1's tip (default: the one on a "
        "layer PALM, or in the middle)",
    )
    add(
        "--thickness",
        type=number,
        default=None,
        metavar="T",
        help="with --hand: of palm and limbs (default: the drawing's, or 0)",
    )
    add(
        "--radius",
        type=number,
        default=None,
        metavar="R",
        help="with --hand: of the object, a circle (default: 0.05 of the palm)",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    path, wanted = arguments.study, arguments.example
    if wanted is not None and wanted not in EXAMPLES and path is None and "." in wanted:
        path, wanted = Path(wanted), EXAMPLES[0]  # a file's name after --example
    if wanted is not None and arguments.hand is not None:
        raise ValueError("--example and --hand: ask for one of them")
    if arguments.hand is None:
        for name in _OF_A_DRAWING:
            if getattr(arguments, name) is not None:
                raise ValueError(f"--{name} is for a hand that is drawn: name its file with --hand")
    else:
        _write(_of_drawn_hand(arguments).to_toml() + "\n", path)
        return
    if wanted is not None:
        _write(example(wanted), path)
        return
    if path is None:
        raise ValueError("name a study file, or ask for --example or --hand")
    study = load_study(path)
    print(study.to_toml())
    if study.sweep is not None:
        print(Plan(study).describe(os.cpu_count() or 1))


def _write(text: str, path: Path | None) -> None:
    """Prints a new study, or writes it to a file that is not there yet."""
    if path is None:
        print(text, end="")
        return
    check_writable(path)
    if path.exists():
        raise ValueError(f"{path} is there already: name another file")
    save_text(text, path)


def _of_drawn_hand(arguments: argparse.Namespace) -> Study:
    body = None if arguments.radius is None else Circle(arguments.radius)
    hand, units, doubts = drawn_hand(
        arguments.hand, arguments.units, arguments.palm, arguments.thickness
    )
    for doubt in doubts:
        warnings.warn(doubt, InputWarning, stacklevel=2)
    return Study.usual(hand, body, units=units)
