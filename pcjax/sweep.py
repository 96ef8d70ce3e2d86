"""Sweeps: many conditions in tasks that are kept as they are done, so that any of it survives.

A task is a block of trials of some conditions. Its result is written to a folder beside the result
file, whole or not at all; a sweep that was killed does only what is missing. What a task gives
depends on the study alone, not on when, where or after what it ran, so the final file is the same,
bit for bit, however often it was interrupted and whoever ran the tasks.
"""

from __future__ import annotations

import io
import json
import logging
import math
import os
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr
from tqdm.auto import tqdm

from pcjax.checks import check_count
from pcjax.engines.choice import choose_engine
from pcjax.engines.ensemble import STATUS_NAMES, Outcomes, run
from pcjax.engines.lanes import Engine
from pcjax.files import locked, read_plain, sealed, unsealed
from pcjax.model.drive import DRIVES
from pcjax.model.hand import full_cage
from pcjax.model.scenario import Scenario, check_geometry
from pcjax.physics.step import INVALID, PAPER_DT
from pcjax.quality.indices import Estimate
from pcjax.reading import load_dataset
from pcjax.results import WATCHED, indices_of, replacing, save_dataset, save_text, score_of
from pcjax.study.spec import Study
from pcjax.words import package_version

BLOCK = 1000
"""Trials of a condition in a task."""

PATIENCE = 20.0
"""Seconds to wait for a scheduler to answer."""

_CONDITIONS = 16
"""Conditions, each in one direction, in a task."""

_COST = {"event": 0.18e-3, "circle": 2.5e-3, "stick": 5e-3}
"""Rough processor seconds of a trial of the paper's length, on a core of 2023."""


@dataclass(frozen=True)
class Cell:
    """One condition in one direction, as it is run."""

    scenario: Scenario
    engine: Engine
    gap: float


@dataclass(frozen=True)
class Task:
    """Trials `first` to `first + trials - 1` of some cells that share a compiled program."""

    name: str
    cells: tuple[tuple[int, str], ...]
    scenarios: tuple[Scenario, ...]
    engine: Engine
    first: int
    trials: int
    max_steps: int
    seed: int
    precision: int

    @property
    def count(self) -> int:
        """Trials in all."""
        return self.trials * len(self.cells)

    def run(self, workers: int | None = None) -> Outcomes:
        """Runs them, on this machine, with that many threads (one per core unless given)."""
        block = None
        if jax.local_devices()[0].platform == "cpu":
            # By the task alone, so that the same program runs whatever the number of threads.
            block = min(1024, max(64, 1 << (self.count // 2).bit_length()))
        return run(
            self.scenarios,
            trials=self.trials,
            first=self.first,
            max_steps=self.max_steps,
            seed=self.seed,
            engine=self.engine,
            precision=self.precision,
            block=block,
            workers=workers,
        )


class Plan:
    """What a sweep consists of: its conditions, which of them can be run, and how.

    Attributes:
        study: with its sweep.
        points: the swept numbers of each condition.
        cells: what is run, by condition and direction.
        problems: why a condition cannot be run, "" where it can.
    """

    def __init__(self, study: Study):
        """
        Raises:
            ValueError: nothing is swept, or no condition can be run.
        """
        check_count("trials", study.run.trials, 2, 2**31 - 1)
        self.study = study
        self.points: list[dict[str, float]] = []
        self.cells: dict[tuple[int, str], Cell] = {}
        self.problems: list[str] = []
        for k, (point, one) in enumerate(study.conditions()):
            self.points.append(point)
            try:
                self.cells |= {(k, d): _cell(one, scenario) for d, scenario in _each(one)}
                self.problems.append("")
            except ValueError as error:
                self.problems.append(str(error))
        if not self.cells:
            raise ValueError(f"no condition of the sweep can be run: {self.problems[0]}")

    @property
    def trials(self) -> int:
        """Trials in all, at most."""
        return len(self.cells) * self.study.run.trials

    def seconds(self, cores: int) -> float:
        """About how long it will take, going by typical speeds."""
        total = 0.0
        for cell in self.cells.values():
            kind = "event" if cell.engine.name == "event" else "circle"
            kind = "stick" if cell.scenario.body.turns else kind
            usual = 0.02 if kind == "circle" else 0.01
            step = cell.engine.step_taken(cell.scenario.drive.period)
            finer = 1.0 if math.isnan(step) else usual / step
            length = (
                self.study.max_steps / 300_000
                if kind != "event"
                else (self.study.max_steps / 600_000)
            )
            total += _COST[kind] * finer * length * self.study.run.trials
        return total / cores

    def describe(self, cores: int) -> str:
        """What is about to be done, in a line; with another on conditions that cannot be run."""
        about = "at most " if self.study.run.precision_target else ""
        lines = [
            f"{len(self.points):,} conditions, {about}{self.trials:,} trials; "
            f"{_duration(self.seconds(cores))} on {cores} cores"
        ]
        bad = [k for k, problem in enumerate(self.problems) if problem]
        if bad:
            where = ", ".join(f"{name} {value:g}" for name, value in self.points[bad[0]].items())
            lines.append(
                f"{len(bad):,} of them cannot be run and stay empty; the first, at {where}: "
                f"{self.problems[bad[0]]}"
            )
        return "\n".join(lines)

    def tasks(self, open_cells: Sequence[tuple[int, str]], first: int, trials: int) -> list[Task]:
        """The tasks that run trials `first` to `first + trials - 1` of some cells."""
        groups: dict[Any, list[tuple[int, str]]] = {}
        for key in open_cells:
            cell = self.cells[key]
            alike = cell.engine, jax.tree.structure(cell.scenario)
            groups.setdefault(alike, []).append(key)
        found = []
        for (engine, _), keys in groups.items():
            for start in range(0, len(keys), _CONDITIONS):
                some = tuple(keys[start : start + _CONDITIONS])
                found.append(
                    Task(
                        f"{first:010d}-{len(found):06d}",
                        some,
                        tuple(self.cells[key].scenario for key in some),
                        engine,
                        first,
                        trials,
                        self.study.max_steps,
                        self.study.run.seed,
                        self.study.run.precision,
                    )
                )
        return found


def _each(study: Study) -> list[tuple[str, Scenario]]:
    return list(study.scenarios().items())


def _cell(study: Study, scenario: Scenario) -> Cell:
    gap = check_geometry(scenario)
    return Cell(scenario, choose_engine(study.run.engine, study.run.dt, scenario), gap)


def _duration(seconds: float) -> str:
    for size, unit in ((86_400.0, "days"), (3600.0, "hours"), (60.0, "minutes")):
        if seconds > 2 * size:
            return f"roughly {seconds / size:.0f} {unit}"
    return f"roughly {seconds:.0f} seconds" if seconds > 10 else "some seconds"


# --------------------------------------------------------------------------------- what is kept


class Parts:
    """The folder beside a result file in which tasks are kept until all are done."""

    def __init__(self, out: Path, told: str):
        """
        Arguments:
            out: the result file.
            told: everything that the result depends on, as text.

        Raises:
            ValueError: the folder belongs to another sweep.
            OSError: it cannot be made.
        """
        self.told = told
        self.folder = out.with_name(out.name + ".parts")
        self.folder.mkdir(exist_ok=True)
        of = self.folder / "study.txt"
        if not of.exists():
            save_text(told, of)
        elif read_plain(of) != told.encode():
            raise ValueError(
                f"{self.folder} holds parts of another sweep (another study, other settings or "
                "another version), or its study.txt is damaged: name another file, or remove the "
                "folder to begin anew, or study.txt alone to keep the parts that are this sweep's"
            )

    def _path(self, task: Task) -> Path:
        return self.folder / f"{task.name}.npz"

    def _identity(self, task: Task) -> str:
        """What a part is sealed with: no other task's, of whatever sweep, is taken for it."""
        return json.dumps([self.told, task.name, task.cells, task.first, task.trials])

    def read(self, task: Task) -> Outcomes | None:
        """A task's outcomes, if they are here.

        Raises:
            ValueError: there is something else in their place.
        """
        path = self._path(task)
        if not os.path.lexists(path):
            return None
        content = unsealed(read_plain(path), self._identity(task))
        if content is None:
            raise ValueError(f"{path} is damaged, or no part of this sweep")
        with np.load(io.BytesIO(content)) as kept:
            steps, status, watch = (kept[name] for name in ("steps", "status", "watch"))
        outcomes = Outcomes(steps, status, task.max_steps, watch if watch.size else None)
        if not _can_be(outcomes, task):
            raise ValueError(f"{path} holds what no trial can end as")
        return outcomes

    def keep(self, task: Task, outcomes: Outcomes) -> None:
        """Writes a task's outcomes, whole or not at all.

        Raises:
            OSError: they cannot be written; what was kept before is still there.
        """
        watch = np.zeros(0, np.float32) if outcomes.watch is None else outcomes.watch
        with (
            replacing(self._path(task)) as unfinished,
            unfinished.open("wb") as file,
            io.BytesIO() as content,
        ):
            np.savez_compressed(content, steps=outcomes.steps, status=outcomes.status, watch=watch)
            file.write(sealed(content.getvalue(), self._identity(task)))
            file.flush()
            os.fsync(file.fileno())

    def remove(self) -> None:
        """Removes the folder."""
        shutil.rmtree(self.folder)


def _can_be(outcomes: Outcomes, task: Task) -> bool:
    """Whether a task can give these outcomes."""
    shape = len(task.cells), task.trials
    steps, status, watch = outcomes.steps, outcomes.status, outcomes.watch
    kinds = (steps.shape, steps.dtype, status.shape, status.dtype)
    if kinds != (shape, np.int32, shape, np.uint8):
        return False
    if task.scenarios[0].body.turns != (watch is not None):
        return False
    if watch is not None and (watch.shape, watch.dtype) != ((*shape, 3), np.float32):
        return False
    return bool(
        np.isin(status, list(STATUS_NAMES)).all()
        and (steps >= 1).all()
        and (steps <= task.max_steps).all()
        # What went wrong may have been no number.
        and (watch is None or np.isfinite(watch[status != INVALID]).all())
    )


# ------------------------------------------------------------------------------ who runs tasks


@contextmanager
def _bench(scheduler: str | None) -> Iterator[Any]:
    """Gives a function from tasks to (task, outcomes), in whatever order they are done."""
    if scheduler is None:
        yield lambda tasks: ((task, task.run()) for task in tasks)
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise ValueError(
            "a scheduler needs the package distributed: pip install 'pcjax[cluster]'"
        ) from None
    with ExitStack() as stack:
        stack.enter_context(_silent("distributed", "tornado", "asyncio"))
        if scheduler == "local":
            cluster = stack.enter_context(
                LocalCluster(
                    threads_per_worker=1,
                    dashboard_address=None,  # pyright: ignore[reportArgumentType]  # none at all
                )
            )
            client = Client(cluster)
        else:
            try:
                client = Client(scheduler, timeout=PATIENCE)
            except (OSError, ValueError) as error:
                raise ValueError(f"no scheduler answers at {scheduler}: {error}") from None
        stack.enter_context(client)
        yield lambda tasks: _through(client, tasks)


@contextmanager
def _silent(*names: str) -> Iterator[None]:
    """Keeps loggers, and all below them, quiet about what is told in a line of our own."""
    known = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in names]
    loggers = [logging.getLogger(name) for name in known]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _through(client: Any, tasks: Sequence[Task]) -> Iterator[tuple[Task, Outcomes]]:
    """Runs tasks on a cluster; those of a worker that dies are run again by another."""
    from distributed import KilledWorker, as_completed

    by_key = {f"pcjax-{task.name}": task for task in tasks}
    futures = [client.submit(_remote, task, key=key, pure=False) for key, task in by_key.items()]
    for future in as_completed(futures):
        try:
            outcomes = future.result()
        except (KilledWorker, CancelledError, OSError) as error:
            raise ValueError(
                f"the cluster has given up ({str(error).splitlines()[0]}); what was done is kept, "
                "and the same command goes on from there"
            ) from None
        yield by_key[future.key], outcomes
        future.release()


def _remote(task: Task) -> Outcomes:
    return task.run(workers=1)


# ------------------------------------------------------------------------------------ the sweep


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
        out: the netCDF file; until it is complete, tasks are kept in a folder beside it, with
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
    told = study.to_toml() + json.dumps(
        {"keep_trials": keep_trials, "pcjax": package_version(), "jax": jax.__version__}
    )
    if out.exists():  # for which no lock is needed, nor a folder that can be written
        return _finished(out, told)
    plan = Plan(study) if plan is None else plan
    with locked(out):
        if out.exists():
            return _finished(out, told)
        return _run_plan(
            plan,
            out,
            told,
            keep_trials=keep_trials,
            scheduler=scheduler,
            progress=progress,
            tell=tell,
        )


def _run_plan(
    plan: Plan,
    out: Path,
    told: str,
    *,
    keep_trials: bool,
    scheduler: str | None,
    progress: bool,
    tell: Callable[[str], object],
) -> xr.Dataset:
    """Does what is missing and writes the file."""
    study, parts = plan.study, Parts(out, told)
    samples = {key: _Samples(study.run.trials) for key in plan.cells}
    with (
        tqdm(
            total=plan.trials,
            desc="sweep",
            unit="trial",
            unit_scale=True,
            disable=None if progress else True,
            leave=False,
        ) as bar,
        _bench(scheduler) as do,
    ):
        for first, trials, stages in _waves(study):
            going = [key for key in plan.cells if not _enough(plan, samples, key[0])]
            bar.total -= (len(plan.cells) - len(going)) * trials
            tasks = [
                task
                for start in range(first, first + trials, stages)
                for task in plan.tasks(going, start, min(stages, first + trials - start))
            ]
            missing, unusable = [], []
            for task in tasks:
                try:
                    kept = parts.read(task)
                except ValueError as error:
                    kept = None
                    unusable.append(str(error))
                if kept is None:
                    missing.append(task)
                else:
                    _take(samples, task, kept)
                    bar.update(task.count)
            if unusable:
                others = f"; so it is with {len(unusable) - 1:,} more" if unusable[1:] else ""
                tell(f"{unusable[0]}{others}: to be run again")
            for task, outcomes in do(missing):
                parts.keep(task, outcomes)
                _take(samples, task, outcomes)
                bar.update(task.count)
    dataset = _assemble(plan, samples, keep_trials=keep_trials).assign_attrs(sweep=told)
    save_dataset(dataset, out)
    parts.remove()
    return load_dataset(out)


def _finished(out: Path, told: str) -> xr.Dataset:
    try:
        found = load_dataset(out)
    except ValueError as error:
        raise ValueError(f"{error}; it is there already: name another file, or remove it") from None
    if found.attrs.get("sweep") != told:
        raise ValueError(
            f"{out} is there already, the result of something else (another study, other settings "
            "or another version): name another file, or remove it"
        )
    return found


def _waves(study: Study) -> Iterator[tuple[int, int, int]]:
    """First trial and number of trials of each wave, and of its blocks.

    Where a precision is asked for, a wave is one block, after which it is looked who has enough.
    """
    total = study.run.trials
    if study.run.precision_target is None:
        yield 0, total, BLOCK
        return
    for first in range(0, total, BLOCK):
        yield first, min(BLOCK, total - first), BLOCK


class _Samples:
    """The trials of one cell so far."""

    def __init__(self, most: int):
        self.steps = np.zeros(most, np.int32)
        self.status = np.zeros(most, np.uint8)
        self.watch: np.ndarray | None = None
        self.used = 0


def _take(samples: Mapping[tuple[int, str], _Samples], task: Task, outcomes: Outcomes) -> None:
    mine = slice(task.first, task.first + task.trials)
    for row, key in enumerate(task.cells):
        sample = samples[key]
        sample.steps[mine], sample.status[mine] = outcomes.steps[row], outcomes.status[row]
        sample.used = max(sample.used, task.first + task.trials)
        if outcomes.watch is not None:
            if sample.watch is None:
                sample.watch = np.zeros((len(sample.steps), 3), np.float32)
            sample.watch[mine] = outcomes.watch[row]


def _estimates(
    plan: Plan, samples: Mapping[tuple[int, str], _Samples], condition: int
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


def _enough(plan: Plan, samples: Mapping[tuple[int, str], _Samples], condition: int) -> bool:
    """Whether a condition's score is known as well as was asked for."""
    study, target = plan.study, plan.study.run.precision_target
    if target is None or samples[condition, study.directions[0]].used == 0:
        return False
    each, score = _estimates(plan, samples, condition)
    estimate = each[study.directions[0]]["index1"] if score is None else score["index1"]
    return estimate.high - estimate.low <= 2 * target * estimate.value


def _assemble(
    plan: Plan, samples: Mapping[tuple[int, str], _Samples], *, keep_trials: bool
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
        each, ratio = _estimates(plan, samples, k)
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
