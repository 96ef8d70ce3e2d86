"""`pcjax claims`: the paper's claims and what came out."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.parts import add_run, run_settings
from pcjax.importing import xr
from pcjax.paper.claims import FIGURES_NEEDED, judge_claims
from pcjax.paper.figures import run_figure
from pcjax.results.reading import load_dataset
from pcjax.study.spec import Run

_TRIALS = 1000


def add_claims(parser: argparse.ArgumentParser) -> None:
    add_run(parser, _TRIALS)
    parser.add_argument(
        "--results",
        type=Path,
        default=None,
        metavar="DIR",
        help="judge kept data (fig9a.nc, fig9b.nc, ...) instead of running anew",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    figures = {}
    for name in FIGURES_NEEDED:
        if arguments.results is None:
            figures[name] = run_figure(name, **run_settings(arguments, Run(trials=_TRIALS)))
        else:
            figures[name] = _load_figure(arguments.results / f"fig{name}.nc", name)
    for claim in judge_claims(figures):
        print(claim)


def _load_figure(path: Path, name: str) -> xr.Dataset:
    if not path.is_file():
        raise ValueError(f"{path} is missing: --results has to name a folder with fig{name}.nc")
    data = load_dataset(path)
    if data.attrs.get("figure") != name:
        raise ValueError(f"{path} does not hold Fig. {name}: make it by 'pcjax figure {name}'")
    return data
