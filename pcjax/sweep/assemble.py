"""From the trials of a sweep to its dataset."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import jax
import numpy as np
import xarray as xr

from pcjax.model.drives.base import DRIVES
from pcjax.model.hand import full_cage
from pcjax.physics.state import PAPER_DT
from pcjax.quality.indices import Estimate
from pcjax.results.schema import WATCHED, indices_of, score_of
from pcjax.simulate.outcomes import STATUS_NAMES, Outcomes
from pcjax.sweep.plan import Part, Plan
from pcjax.words import package_version


class Samples:
    """The trials of one cell so far."""

    def __init__(self, most: int):
        self.steps = np.zeros(most, np.int32)
        self.status = np.zeros(most, np.uint8)
        self.watch: np.ndarray | None = None
        self.used = 0


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
    caged = [bool(full_cage(c.gap, float(c.scenario.body.width))) for c in cells]
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
    study, directions, count = plan.study, plan.study.directions, len(plan.points)
    names, statuses = [f.name for f in fields(Estimate)], list(STATUS_NAMES)
    indices = ("index1", "index2")
    index = {name: np.full((count, len(directions), len(names)), np.nan) for name in indices}
    score = np.full((count, len(indices), len(names)), np.nan)
    counts = np.zeros((count, len(directions), len(statuses)), int)
    used = np.zeros(count, int)
    gap, dt = np.full((2, count, len(directions)), np.nan)
    watched = {name: np.full((count, len(directions)), np.nan) for name in WATCHED}
    steps = np.zeros((count, len(directions), study.run.trials), np.int32)
    status = np.zeros(steps.shape, np.uint8)
    for k in range(count):
        if plan.problems[k]:
            continue
        each, ratio = estimates(plan, samples, k)
        for d, direction in enumerate(directions):
            cell, sample = plan.cells[k, direction], samples[k, direction]
            used[k] = sample.used
            for name in indices:
                index[name][k, d] = list(asdict(each[direction][name]).values())
            counts[k, d] = [int(np.sum(sample.status[: sample.used] == code)) for code in statuses]
            gap[k, d] = cell.gap
            dt[k, d] = cell.engine.step_taken(cell.scenario.drive.period)
            steps[k, d], status[k, d] = sample.steps, sample.status
            if sample.watch is not None:
                worst = sample.watch[: sample.used]
                for j, name in enumerate(WATCHED):
                    how = np.sum if name == "undone" else np.max
                    watched[name][k, d] = how(worst[:, j])
        if ratio is not None:
            score[k] = [list(asdict(ratio[name]).values()) for name in indices]
    place, each_way = ("condition",), ("condition", "direction")
    length = {"units": "model length"}
    data: dict[str, Any] = {
        "index1": ((*each_way, "statistic"), index["index1"], {"units": f"steps of {PAPER_DT} s"}),
        "index2": ((*each_way, "statistic"), index["index2"], {"units": "1"}),
        "count": ((*each_way, "status_name"), counts, {"long_name": "trials that ended so"}),
        "trials_used": (place, used, {"long_name": "trials of each direction"}),
        "gap": (each_way, gap, length),
        "dt": (each_way, dt, {"units": "s", "long_name": "the solver's step; NaN: event-driven"}),
        "problem": (place, plan.problems, {"long_name": "why the condition could not be run"}),
    }
    if len(directions) == 2:
        data["score"] = (("condition", "index", "statistic"), score, {"units": "1"})
    if not np.isnan(watched["travel"]).all():
        data |= {name: (each_way, watched[name], attrs) for name, attrs in WATCHED.items()}
    if keep_trials:
        limit = {"units": f"steps of {PAPER_DT} s", "long_name": "escape step, or the limit"}
        flags = {
            "flag_values": [0, *statuses],
            "flag_meanings": " ".join(["not_run", *STATUS_NAMES.values()]),
        }
        data["escape_step"] = ((*each_way, "trial"), steps, limit)
        data["status"] = ((*each_way, "trial"), status, flags)
    coords = {
        "direction": list(directions),
        "statistic": names,
        "status_name": list(STATUS_NAMES.values()),
    }
    coords |= {"index": list(indices)} if len(directions) == 2 else {}
    dataset = xr.Dataset(data, coords, attrs=_provenance(plan))
    return _along_swept(dataset, plan)


def _along_swept(dataset: xr.Dataset, plan: Plan) -> xr.Dataset:
    """The dataset with the swept numbers as its dimensions, or as labels of its conditions."""
    sweep = plan.study.sweep
    assert sweep is not None
    units = {
        name: {"units": "degree" if name.endswith("_deg") else "as in the study"}
        for name in sweep.values
    }
    if sweep.zipped:
        return dataset.assign_coords(
            {
                name: ("condition", list(values), units[name])
                for name, values in sweep.values.items()
            }
        )
    shape = [len(values) for values in sweep.values.values()]
    data = {
        name: (
            (*sweep.values, *var.dims[1:]),
            var.values.reshape(*shape, *var.shape[1:]),
            var.attrs,
        )
        for name, var in dataset.items()
    }
    coords: dict[str, Any] = {
        name: (name, list(values), units[name]) for name, values in sweep.values.items()
    }
    return xr.Dataset(data, coords | dict(dataset.coords), dataset.attrs)


def swept_names(data: xr.Dataset) -> list[str]:
    """The swept numbers of a sweep's dataset."""
    if "condition" in data.dims:
        return [str(n) for n in data.coords if data.coords[n].dims == ("condition",)]
    return [str(dim) for dim in data.problem.dims]


def _provenance(plan: Plan) -> dict[str, Any]:
    """How the result was made: all that it depends on."""
    study = plan.study
    engines = dict.fromkeys(cell.engine.name for cell in plan.cells.values())
    return {
        "made_by": "pcjax sweep",
        "pcjax_version": package_version(),
        "jax_version": jax.__version__,
        "device": jax.local_devices()[0].device_kind,
        "study": study.to_toml(),
        "drive": DRIVES.kind_of(study.drive),
        "trials": study.run.trials,
        "max_steps": study.max_steps,
        "seed": study.run.seed,
        "engine": ", ".join(engines),
        "precision": study.run.precision,
        "precision_target": study.run.precision_target or math.nan,
    }
