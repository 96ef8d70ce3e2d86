"""`pcjax figure`: one of the paper's figures anew."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.parts import (
    add_outputs,
    add_reading,
    add_run,
    check_data,
    check_picture,
    run_settings,
    save_picture,
    settle_outputs,
)
from pcjax.paper import constants as paper
from pcjax.paper.figures import run_figure
from pcjax.paper.readings import LITERAL, READINGS
from pcjax.paper.tables import figure_table
from pcjax.results.saving import save_dataset
from pcjax.study.spec import TRIALS, Run


def add_figure(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "figure",
        choices=paper.FIGURE_NAMES,
        metavar="figure",
        help=f"one of {', '.join(paper.FIGURE_NAMES)}",
    )
    add_reading(parser)
    add_run(parser)
    add_outputs(parser, data="keep the data: .nc (netCDF)", plot="the picture, figNAME.png here")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    arguments.plot = arguments.plot or Path(f"fig{arguments.figure}.png")
    settle_outputs(arguments)
    picture = arguments.plot
    check_picture(picture)
    check_data(arguments.out)
    run = run_settings(arguments, Run(trials=TRIALS))
    data = run_figure(arguments.figure, READINGS[arguments.reading or LITERAL.name], **run)
    if arguments.out:
        save_dataset(data, arguments.out)
    save_picture("paper.pictures.plot_figure", data, picture)
    print(figure_table(data))
    print(f"{data.attrs['wall_seconds']:.1f} s; picture: {picture}")
