"""`pcjax show` and `pcjax plot`: kept results as a table or a picture."""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import xarray as xr

from pcjax.cli.map import map_text
from pcjax.cli.parts import add_outputs, check_picture, number, settle_outputs
from pcjax.paper.figures import check_figure
from pcjax.paper.tables import figure_table
from pcjax.results.evaluation import Evaluation
from pcjax.results.reading import load_dataset
from pcjax.results.schema import NAMES
from pcjax.sweep.assemble import swept_names

_LONGEST = 60
"""Lines of a table."""


def add_show(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    parser.add_argument("results", type=Path, metavar="FILE", help="a result (netCDF)")
    parser.add_argument("--all", action="store_true", help=f"more than {_LONGEST} lines, too")
    parser.set_defaults(run=_show)


def add_plot(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("results", type=Path, metavar="FILE", help="a result (netCDF)")
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


def _at(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"{text!r} has to be like radius=25")
    return name, number(value)


def _show(arguments: argparse.Namespace) -> None:
    data = load_dataset(arguments.results)
    if "sweep" in data.attrs:
        print(table(data, None if arguments.all else _LONGEST))
    elif "figure" in data.attrs:
        print(figure_table(_figure(data, arguments.results)))
    elif _is_map(data):
        print(map_text(data))
    else:
        print(_evaluation(data, arguments.results))


def _is_map(data: xr.Dataset) -> bool:
    return {"score_name", "hands"} <= set(data.attrs) and {"score", "se"} <= set(data)


def _figure(data: xr.Dataset, path: Path) -> xr.Dataset:
    try:
        check_figure(data)
    except ValueError as error:
        raise ValueError(f"{path} is no figure of the paper: {error}") from None
    return data


def _evaluation(data: xr.Dataset, path: Path) -> Evaluation:
    if "escape_step" not in data:
        raise ValueError(f"{path} is no evaluation, sweep, map or figure")
    return Evaluation(data)


def _plot(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    if arguments.plot is None:
        raise ValueError("say where the picture goes: --plot FILE")
    check_picture(arguments.plot)
    data = load_dataset(arguments.results)
    flags = ("x", "y", "hue")
    from pcjax.view import plots, sweeps  # matplotlib takes a second to import

    if "sweep" in data.attrs:
        figure = sweeps.plot_sweep(
            data, arguments.x, arguments.y, arguments.hue, dict(arguments.at)
        )
    else:
        for flag in flags:
            if getattr(arguments, flag) is not None or arguments.at:
                raise ValueError(
                    f"{arguments.results} is no sweep: --x, --y, --hue, --at are not for it"
                )
        if _is_map(data):
            from pcjax.view.designs import plot_map

            figure = plot_map(data)
        elif "figure" in data.attrs:
            from pcjax.paper.pictures import plot_figure

            figure = plot_figure(_figure(data, arguments.results))
        else:
            figure = plots.plot_evaluation(_evaluation(data, arguments.results))
    figure.savefig(arguments.plot, dpi=130)


def table(data: xr.Dataset, most: int | None = _LONGEST) -> str:
    """A sweep's numbers as text: one line for each condition."""
    swept = swept_names(data)
    directions = [str(d) for d in data.direction.values]
    heads = [*swept, *(f"{NAMES[d]} index 1" for d in directions)]
    heads += ["score"] if "score" in data else []
    heads += ["invalid", "trials"]
    lines = ["  ".join(f"{head:>19}" for head in heads)]
    places = [data.sizes[d] for d in data.problem.dims]
    for place in itertools.product(*map(range, places)):
        if most is not None and len(lines) > most:
            lines.append(f"... {data.problem.size - most:,} more: 'pcjax show --all'")
            break
        one = data.isel(dict(zip(data.problem.dims, place, strict=True)))
        cells = [f"{float(one[name]):g}" for name in swept]
        if str(one.problem.values):
            lines.append("  ".join(f"{c:>19}" for c in cells) + f"  {one.problem.values}")
            continue
        for d in directions:
            value, se = (float(x) for x in one.index1.sel(direction=d).values[:2])
            cells.append(f"{value:,.0f} ± {se:,.0f}")
        if "score" in one:
            value, se = (float(x) for x in one.score.sel(index="index1").values[:2])
            cells.append(f"{value:.4f} ± {se:.4f}")
        cells.append(f"{int(one['count'].sel(status_name='invalid').sum()):,}")
        cells.append(f"{int(one.trials_used):,}")
        lines.append("  ".join(f"{c:>19}" for c in cells))
    attrs = data.attrs
    lines.append(
        f"limit {attrs['max_steps']:,} steps, seed {attrs['seed']}, {attrs['engine']} engine, "
        f"float{attrs['precision']}; value ± standard error"
    )
    return "\n".join(lines)
