"""`pcjax sweep`: every condition of a study, kept as it is done."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from tqdm.std import tqdm

from pcjax.cli.parser import Terminated
from pcjax.cli.parts import add_precision_target, add_run, as_flags_say, check_data
from pcjax.results.tables import conditions_table
from pcjax.study.read import load_study
from pcjax.sweep.plan import Plan
from pcjax.sweep.run import run_sweep


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add = parser.add_argument
    add("study", type=Path, metavar="FILE", help="a study file with [sweep]")
    add(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="the result (netCDF); the same command again goes on where it was",
    )
    add_run(parser)
    add_precision_target(parser, "a condition's score is this share of it")
    add("--keep-trials", action="store_true", help="keep the escape step of every trial")
    add(
        "--scheduler",
        default=None,
        metavar="ADDRESS",
        help="of a dask.distributed scheduler that runs the trials; 'local': one of this machine",
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    check_data(arguments.out)
    study = as_flags_say(load_study(arguments.study), arguments)
    plan = Plan(study)
    print(plan.describe(os.cpu_count() or 1), file=sys.stderr)
    try:
        data = run_sweep(
            study,
            arguments.out,
            keep_trials=arguments.keep_trials,
            scheduler=arguments.scheduler,
            progress=True,
            plan=plan,
            tell=lambda line: tqdm.write(f"pcjax: {line}", file=sys.stderr),
        )
    except (KeyboardInterrupt, Terminated) as stop:
        stop.add_note(f"what was finished is kept in {arguments.out}.parts")
        stop.add_note("the same command goes on where it was")
        raise
    print(conditions_table(data))
