"""Sweeps: many conditions in parts that are kept as they are done, so that any of it survives.

A part is a block of trials of some conditions. Its result is written to a folder beside the result
file, whole or not at all; a sweep that was killed does only what is missing. What a part gives
depends on the study alone, not on when, where or after what it ran, so the final file is the same,
bit for bit, however often it was interrupted and whoever ran the parts.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import jax

from pcjax.importing import xr
from pcjax.progress import progress_bar
from pcjax.quality.stopping import next_look, precision_of
from pcjax.results.files import locked
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.study.spec import Study
from pcjax.sweep.assemble import Samples, assemble, estimates, take
from pcjax.sweep.cluster import bench
from pcjax.sweep.plan import Plan
from pcjax.sweep.store import Store
from pcjax.words import package_version


def run_sweep(
    study: Study,
    out: str | os.PathLike[str],
    *,
    keep_trials: bool = False,
    scheduler: str | None = None,
    progress: bool = False,
    plan: Plan | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> xr.Dataset:
    """Evaluates every condition of a study's sweep and writes one labelled dataset.

    Begun again with the same arguments it goes on where it was, after any end whatsoever; with a
    file that is complete it returns that.

    Arguments:
        study: with a sweep.
        out: the netCDF file; until it is complete, parts are kept in a folder beside it, with
            ".parts" after its name.
        keep_trials: whether to keep the escape step and status of every trial.
        scheduler: address of a dask.distributed scheduler, or "local" for a cluster of processes on
            this machine; unless given, this process runs everything.
        progress: whether to show a bar on stderr.
        plan: of this study, if it has been made.
        tell: is given a line where parts that were kept cannot be used, and are done again.

    Returns:
        A dataset along the swept numbers (along `condition` where they go together) with `index1`
        and `index2` (direction, statistic), `score` (index, statistic), `count` (direction,
        status), `trials_used`, `gap`, `dt` and `problem`.

    Raises:
        ValueError: see `Plan`; or the file or its parts belong to another sweep, or another process
            is at it.
        OSError: something cannot be written; what was done is kept.
    """
    out = Path(out)
    recipe = (
        study.to_toml()
        + study.files_digest
        + json.dumps(
            {"keep_trials": keep_trials, "pcjax": package_version(), "jax": jax.__version__}
        )
    )
    if out.exists():  # for which no lock is needed, nor a folder that can be written
        return _finished(out, recipe)
    plan = Plan(study) if plan is None else plan
    with locked(out):
        if out.exists():
            return _finished(out, recipe)
        return _run_plan(
            plan,
            out,
            recipe,
            keep_trials=keep_trials,
            scheduler=scheduler,
            progress=progress,
            tell=tell,
        )


def _run_plan(
    plan: Plan,
    out: Path,
    recipe: str,
    *,
    keep_trials: bool,
    scheduler: str | None,
    progress: bool,
    tell: Callable[[str], object],
) -> xr.Dataset:
    """Does what is missing and writes the file."""
    store = Store(out, recipe)
    samples = {key: Samples() for key in plan.cells}
    goals, done = dict.fromkeys((condition for condition, _ in plan.cells), 0), 0
    with (
        progress_bar(
            total=plan.trials,
            desc="sweep",
            unit="trial",
            unit_scale=True,
            shown=progress,
        ) as bar,
        bench(scheduler) as do,
    ):
        while True:
            for condition, goal in goals.items():
                if goal == done:
                    goals[condition] = _goal(plan, samples, condition, done)
            bar.total = sum(goals[condition] for condition, _ in plan.cells)
            going = [key for key in plan.cells if goals[key[0]] > done]
            if not going:
                break
            # What goes on has had as many trials, all of it.
            upto = min(goals[condition] for condition, _ in going)
            parts, done = plan.blocks(going, done, upto), upto
            for key in going:
                samples[key].make_room(upto)
            missing, unusable = [], []
            for part in parts:
                try:
                    kept = store.read(part)
                except ValueError as error:
                    kept = None
                    unusable.append(str(error))
                if kept is None:
                    missing.append(part)
                else:
                    take(samples, part, kept)
                    bar.update(part.count)
            if unusable:
                others = f"; so it is with {len(unusable) - 1:,} more" if unusable[1:] else ""
                tell(f"{unusable[0]}{others}: to be run again")
            for part, outcomes in do(missing):
                store.keep(part, outcomes)
                take(samples, part, outcomes)
                bar.update(part.count)
    dataset = assemble(plan, samples, keep_trials=keep_trials).assign_attrs(sweep=recipe)
    save_dataset(dataset, out)
    store.remove()
    return load_dataset(out)


def _finished(out: Path, recipe: str) -> xr.Dataset:
    try:
        found = load_dataset(out)
    except ValueError as error:
        raise ValueError(f"{error}; it is there already: name another file, or remove it") from None
    if found.attrs.get("sweep") != recipe:
        raise ValueError(
            f"{out} is there already, the result of something else (another study, other settings "
            "or another version): name another file, or remove it"
        )
    return found


def _goal(plan: Plan, samples: Mapping[tuple[int, str], Samples], condition: int, done: int) -> int:
    """After how many trials to look at a condition again; `done`, where it has enough of them."""
    study, target, most = plan.study, plan.study.run.precision_target, plan.study.trials
    if target is None:
        return most
    if done == 0:
        return plan.rounded(1)
    each, score = estimates(plan, samples, condition)
    estimate = each[study.directions[0]]["index1"] if score is None else score["index1"]
    return plan.rounded(next_look(precision_of(estimate), target, done, most))
