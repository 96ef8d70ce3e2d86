"""From the trials of a sweep to its dataset."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import astuple, replace
from typing import Any

import numpy as np

from pcjax.importing import xr
from pcjax.model.hand import full_cage
from pcjax.model.scenario import Scenario
from pcjax.quality.indices import Estimate
from pcjax.results.estimates import counts_of, indices_of, rows_of, score_of
from pcjax.results.provenance import conditions, provenance
from pcjax.results.schema import INDICES, STATISTICS, WATCHED, dataset_of
from pcjax.simulate.outcomes import STATUS_NAMES, Outcomes
from pcjax.study.spec import Study
from pcjax.sweep.plan import Part, Plan


class Samples:
    """The trials of one cell so far."""

    def __init__(self) -> None:
        self.steps = np.zeros(0, np.int32)
        self.status = np.zeros(0, np.uint8)
        self.watch: np.ndarray | None = None
        self.used = 0

    def make_room(self, trials: int) -> None:
        """For so many in all; where a precision is asked for, there may be far more than needed."""
        more = trials - len(self.steps)
        self.steps, self.status = (np.pad(old, (0, more)) for old in (self.steps, self.status))
        if self.watch is not None:
            self.watch = np.pad(self.watch, ((0, more), (0, 0)))


def take(samples: Mapping[tuple[int, str], Samples], part: Part, outcomes: Outcomes) -> None:
    mine = slice(part.first, part.first + part.trials)
    for row, key in enumerate(part.cells):
        sample = samples[key]
        sample.steps[mine], sample.status[mine] = outcomes.steps[row], outcomes.status[row]
        sample.used = max(sample.used, part.first + part.trials)
        if outcomes.watch is not None:
            if sample.watch is None:
                sample.watch = np.zeros((len(sample.steps), 3), np.float32)
            sample.watch[mine] = outcomes.watch[row]


def estimates(
    plan: Plan, samples: Mapping[tuple[int, str], Samples], condition: int
) -> tuple[dict[str, dict[str, Estimate]], dict[str, Estimate] | None]:
    """Each direction's indices, and the score if there is one, from the trials so far."""
    directions, limit = plan.study.directions, plan.study.max_steps
    cells = [plan.cells[condition, d] for d in directions]
    caged = [bool(full_cage(c.gap, c.scenario.body.least_passage())) for c in cells]
    some = [samples[condition, d] for d in directions]
    steps, status = (
        np.stack([getattr(sample, name)[: some[0].used] for sample in some])
        for name in ("steps", "status")
    )
    each = {
        d: indices_of(steps[k], status[k], limit, caged=caged[k]) for k, d in enumerate(directions)
    }
    if len(directions) == 1:
        return each, None
    return each, score_of(steps, status, limit, caged=(caged[0], caged[1]))


def assemble(
    plan: Plan, samples: Mapping[tuple[int, str], Samples], *, keep_trials: bool
) -> xr.Dataset:
    """The dataset of a sweep that is complete. Nothing in it depends on when or where it was run,
    but for the kind of device."""
    directions, count = plan.study.directions, len(plan.points)
    index = {name: np.full((count, len(directions), len(STATISTICS)), np.nan) for name in INDICES}
    score = np.full((count, len(INDICES), len(STATISTICS)), np.nan)
    counts = np.zeros((count, len(directions), len(STATUS_NAMES)), int)
    used = np.zeros(count, int)
    gap, width, skin, dt = np.full((4, count, len(directions)), np.nan)
    watched = {name: np.full((count, len(directions)), np.nan) for name in WATCHED}
    kept = int(keep_trials) * max(len(sample.steps) for sample in samples.values())
    steps = np.zeros((count, len(directions), kept), np.int32)
    status = np.zeros(steps.shape, np.uint8)
    for k in range(count):
        if plan.problems[k]:
            continue
        each, ratio = estimates(plan, samples, k)
        for d, direction in enumerate(directions):
            cell, sample = plan.cells[k, direction], samples[k, direction]
            used[k] = sample.used
            for name in INDICES:
                index[name][k, d] = astuple(each[direction][name])
            counts[k, d] = counts_of(sample.status[: sample.used])
            gap[k, d], width[k, d] = cell.gap, float(cell.scenario.body.width)
            dt[k, d] = cell.engine.step_taken(cell.scenario.drive.period)
            if keep_trials:
                mine = slice(len(sample.steps))
                steps[k, d, mine], status[k, d, mine] = sample.steps, sample.status
            if sample.watch is not None:
                skin[k, d] = float(getattr(cell.scenario.body, "skin", np.nan))
                worst = sample.watch[: sample.used]
                for j, name in enumerate(WATCHED):
                    how = np.sum if name == "undone" else np.max
                    watched[name][k, d] = how(worst[:, j])
        if ratio is not None:
            score[k] = rows_of(ratio.values())
    values: dict[str, np.ndarray] = {
        **index,
        "count": counts,
        "trials_used": used,
        "gap": gap,
        "object_width": width,
        "dt": dt,
        "problem": np.array(plan.problems),
    }
    if len(directions) == 2:
        values["score"] = score
    if not np.isnan(watched["travel"]).all():
        values |= watched | {"skin": skin}
    if keep_trials:
        values |= {"escape_step": steps, "status": status}
    return _along_swept(values, plan)


def _along_swept(values: Mapping[str, np.ndarray], plan: Plan) -> xr.Dataset:
    """The dataset with the swept numbers as its dimensions, or as labels of its conditions."""
    study, sweep = plan.study, plan.study.sweep
    assert sweep is not None
    units = {name: {"units": study.unit_of(name)} for name in sweep.values}
    place, shape = list(sweep.values), [len(line) for line in sweep.values.values()]
    if sweep.zipped:
        place, shape = ["condition"], [len(plan.points)]
    labels: dict[str, Any] = {
        name: ("condition" if sweep.zipped else name, list(line), units[name])
        for name, line in sweep.values.items()
    }
    return dataset_of(
        "sweep",
        {name: value.reshape(*shape, *value.shape[1:]) for name, value in values.items()},
        labels | {"direction": list(study.directions)},
        _provenance(plan),
        place=place,
    )


def _provenance(plan: Plan) -> dict[str, Any]:
    """How the result was made: all that it depends on."""
    study = plan.study
    engines = dict.fromkeys(cell.engine.name for cell in plan.cells.values())
    run = {
        "made_by": "pcjax sweep",
        "study": study.to_toml(),
        "length_unit": study.units,
        "trials": study.trials,
        "max_steps": study.max_steps,
        "seed": study.run.seed,
        "engine": ", ".join(engines),
        "precision": study.run.precision,
        "precision_target": study.run.precision_target or math.nan,
    }
    return provenance(run, dated=False) | conditions(_before_sweeping(study))


def _before_sweeping(study: Study) -> dict[str, Scenario]:
    """The study's own scenarios, in the directions that its hand has as it stands."""
    found = {}
    for direction in (*study.directions, "does"):  # which every hand has
        if not found or direction in study.directions:
            with suppress(ValueError):
                found |= replace(study, run=replace(study.run, direction=direction)).scenarios()
    return found
