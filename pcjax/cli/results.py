"""`pcjax show` and `pcjax plot`: kept results as a table or a picture."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from pcjax.cli.map import map_text
from pcjax.cli.parts import add_outputs, check_picture, number, settle_outputs
from pcjax.importing import xr
from pcjax.model.scenario import DIRECTIONS
from pcjax.paper.figures import check_figure
from pcjax.paper.tables import figure_table
from pcjax.results.evaluation import Evaluation
from pcjax.results.map_csv import load_map_csv
from pcjax.results.reading import load_dataset
from pcjax.results.tables import LONGEST, conditions_table
from pcjax.study.inspect import inspect
from pcjax.study.read import load_study

_STUDY = ".toml"
_FILES = "what pcjax has written: .nc, a map's .csv, or a study's .toml"


def add_show(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    parser.add_argument("results", type=Path, metavar="FILE", help=_FILES)
    parser.add_argument("--all", action="store_true", help=f"more than {LONGEST} lines, too")
    parser.set_defaults(run=_show)


def add_plot(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("results", type=Path, metavar="FILE", help=_FILES)
    add("--x", default=None, metavar="NAME", help="the swept number along the axis")
    add(
        "--y",
        default=None,
        metavar="NAME",
        help="score or index1, index2 (of DoEs; eoen.index1: of EoEn), score.index2 "
        "(default: score, or index1 where there is none)",
    )
    add("--hue", default=None, metavar="NAME", help="the swept number of which each has a curve")
    add(
        "--at",
        action="append",
        type=_at,
        default=[],
        metavar="NAME=VALUE",
        help="the value of a swept number that is not drawn; again for more",
    )
    add_outputs(parser, plot="the picture", before={"out": "plot"})
    parser.set_defaults(run=_plot)


def _at(text: str) -> tuple[str, Any]:
    """A label and its value, a number or, of a direction, a text."""
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text!r} has to be like radius=25")
    return name, value if value in DIRECTIONS else number(value)


def _show(arguments: argparse.Namespace) -> None:
    path = arguments.results
    if path.suffix.lower() == _STUDY:
        print(inspect(load_study(path)))
        return
    data = _load(path)
    if "figure" in data.attrs:
        print(figure_table(data))
    elif data.attrs["kind"] == "map":
        print(map_text(data))
    elif data.attrs["kind"] == "evaluation":
        print(Evaluation(data))
    else:
        print(conditions_table(data, None if arguments.all else LONGEST))


def _load(path: Path) -> xr.Dataset:
    """A result; a figure of the paper is checked to be one."""
    if path.suffix.lower() == ".csv":
        return load_map_csv(path)
    data = load_dataset(path)
    if "figure" in data.attrs:
        try:
            check_figure(data)
        except ValueError as error:
            raise ValueError(f"{path} is no figure of the paper: {error}") from None
    return data


def _plot(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    if arguments.plot is None:
        raise ValueError("say where the picture goes: --plot FILE")
    check_picture(arguments.plot)
    path = arguments.results
    # Imported where they are needed: matplotlib takes a second.
    from pcjax.view import designs, plots, sweeps

    data = None if path.suffix.lower() == _STUDY else _load(path)
    kind = None if data is None or "figure" in data.attrs else data.attrs["kind"]
    if kind not in ("sweep", "grid") and (
        arguments.at or any(getattr(arguments, flag) is not None for flag in ("x", "y", "hue"))
    ):
        raise ValueError(f"{path} is no sweep: --x, --y, --hue, --at are not for it")
    if data is None:
        figure = designs.plot_inspection(inspect(load_study(path)))
    elif kind is None:
        from pcjax.paper.pictures import plot_figure

        figure = plot_figure(data)
    elif kind == "map":
        figure = designs.plot_map(data)
    elif kind == "evaluation":
        figure = plots.plot_evaluation(Evaluation(data))
    else:
        draw = sweeps.plot_sweep if kind == "sweep" else sweeps.plot_grid
        figure = draw(data, arguments.x, arguments.y, arguments.hue, dict(arguments.at))
    figure.savefig(arguments.plot, dpi=130)
