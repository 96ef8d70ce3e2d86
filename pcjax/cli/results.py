"""`pcjax show` and `pcjax plot`: kept results as a table or a picture; where objects stay."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcjax.cli.map import map_text
from pcjax.cli.parts import (
    add_outputs,
    as_flags_say,
    check_picture,
    number,
    settle_outputs,
    whole,
)
from pcjax.importing import named, xr
from pcjax.model.scenario import DIRECTIONS
from pcjax.paper.figures import check_figure
from pcjax.paper.tables import figure_table
from pcjax.quality.occupancy import TRIALS
from pcjax.results.evaluation import Evaluation
from pcjax.results.map_csv import load_map_csv
from pcjax.results.reading import load_dataset
from pcjax.results.schema import EVALUATIONS
from pcjax.results.tables import LONGEST, conditions_table
from pcjax.study.inspect import inspect
from pcjax.study.occupancy import occupancy_of_study
from pcjax.study.read import load_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    add(
        "--occupancy",
        action="store_true",
        help="run a study's hand, and draw where in it objects stay and from where they escape",
    )
    add(
        "--trials",
        type=whole,
        default=None,
        help=f"with --occupancy: how many of evaluate's trials, in each direction (default: "
        f"{TRIALS})",
    )
    add(
        "--direction",
        choices=(*DIRECTIONS, "both"),
        default=None,
        help="with --occupancy: which way the object goes (default: the study's)",
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
    elif data.attrs["kind"] in EVALUATIONS:
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
    picture = _occupancy_picture if arguments.occupancy else _picture
    picture(arguments).savefig(arguments.plot, dpi=130)


def _occupancy_picture(arguments: argparse.Namespace) -> Figure:
    """Where objects stay in the hand of a study."""
    path = arguments.results
    if path.suffix.lower() != _STUDY:
        raise ValueError(f"{path} is no study's .toml: --occupancy runs the hand of one")
    if _swept(arguments):
        raise ValueError("--x, --y, --hue, --at are for sweeps: they do not go with --occupancy")
    study = as_flags_say(load_study(path), arguments)
    from pcjax.view.occupancy import plot_occupancy

    trials = TRIALS if arguments.trials is None else arguments.trials
    return plot_occupancy(occupancy_of_study(study, trials=trials, progress=True), study.units)


def _picture(arguments: argparse.Namespace) -> Figure:
    """What is kept, or a study, as it is."""
    path = arguments.results
    if arguments.trials is not None or arguments.direction is not None:
        raise ValueError("--trials and --direction go with --occupancy: nothing is run without it")
    # Imported where they are needed: matplotlib takes a second.
    from pcjax.view import designs, plots, sweeps

    data = None if path.suffix.lower() == _STUDY else _load(path)
    kind = None if data is None or "figure" in data.attrs else data.attrs["kind"]
    if kind not in ("sweep", "grid") and _swept(arguments):
        raise ValueError(f"{path} is no sweep: --x, --y, --hue, --at are not for it")
    if data is None:
        found = inspect(load_study(path))
        return named(found.drawn_by)(found)
    if kind is None:
        from pcjax.paper.pictures import plot_figure

        return plot_figure(data)
    if kind == "map":
        return designs.plot_map(data)
    if kind in EVALUATIONS:
        return plots.plot_evaluation(Evaluation(data))
    draw = sweeps.plot_sweep if kind == "sweep" else sweeps.plot_grid
    return draw(data, arguments.x, arguments.y, arguments.hue, dict(arguments.at))


def _swept(arguments: argparse.Namespace) -> bool:
    """Whether a flag says what of a sweep is drawn."""
    flags = (arguments.x, arguments.y, arguments.hue)
    return bool(arguments.at) or any(flag is not None for flag in flags)
