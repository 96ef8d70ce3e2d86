"""`pcjax claims`: the paper's claims and what came out."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.parts import add_reading, add_run, run_settings
from pcjax.importing import xr
from pcjax.paper.claims import FIGURES_NEEDED, judge_claims
from pcjax.paper.figures import check_figure, run_figure
from pcjax.paper.readings import LITERAL, READINGS, reading_of
from pcjax.paper.tables import reading_text
from pcjax.results.reading import load_dataset
from pcjax.study.spec import Run

_TRIALS = 1000


def add_claims(parser: argparse.ArgumentParser) -> None:
    add_run(parser, _TRIALS)
    add_reading(parser)
    parser.add_argument(
        "--results",
        type=Path,
        default=None,
        metavar="DIR",
        help="judge kept data (fig9a.nc, fig9b.nc, ...) instead of running anew",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    if arguments.results is None:
        reading = READINGS[arguments.reading or LITERAL.name]
        run = run_settings(arguments, Run(trials=_TRIALS))
        figures = {name: run_figure(name, reading, **run) for name in FIGURES_NEEDED}
    else:
        figures = _load_figures(arguments.results, arguments.reading)
        reading = reading_of(figures[FIGURES_NEEDED[0]])
    for line in (*reading_text(reading), *judge_claims(figures)):
        print(line)


def _load_figures(folder: Path, reading: str | None) -> dict[str, xr.Dataset]:
    """The figures' data, all under one reading: the one asked for, or that of the first."""
    figures = {}
    for name in FIGURES_NEEDED:
        path = folder / f"fig{name}.nc"
        data = figures[name] = _load_figure(path, name)
        reading = reading or reading_of(data).name
        if reading_of(data).name != reading:
            raise ValueError(
                f"{path} holds Fig. {name} under the reading '{reading_of(data).name}': make it by "
                f"'pcjax figure {name} --reading {reading}'"
            )
    return figures


def _load_figure(path: Path, name: str) -> xr.Dataset:
    if not path.is_file():
        raise ValueError(f"{path} is missing: --results has to name a folder with fig{name}.nc")
    data = load_dataset(path)
    if data.attrs.get("figure") != name:
        raise ValueError(f"{path} does not hold Fig. {name}: make it by 'pcjax figure {name}'")
    try:
        check_figure(data)
    except ValueError as error:
        raise ValueError(f"{path} is no figure of the paper: {error}") from None
    return data
