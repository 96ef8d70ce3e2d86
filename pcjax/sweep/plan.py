"""What a sweep has to do: conditions, each in one direction, in parts of some trials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import jax

from pcjax.checks import check_count
from pcjax.model.layout import geometries_of
from pcjax.model.scenario import Scenario
from pcjax.simulate.batch import run, usual_block
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.engine import Engine
from pcjax.simulate.outcomes import Outcomes
from pcjax.study.spec import Study

BLOCK = 1000
"""Trials of a condition in a part."""

_CONDITIONS = 4, 64
"""Conditions, each in one direction, in a part: at least, and at most."""

_SECONDS = 20.0
"""Of a processor that a part takes, about, where it may have more or fewer conditions."""


_AHEAD = 256
"""Conditions whose hands are looked at together."""


@dataclass(frozen=True)
class Cell:
    """One condition in one direction, as it is run."""

    scenario: Scenario
    engine: Engine
    gap: float


@dataclass(frozen=True)
class Part:
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
        platform = jax.local_devices()[0].platform
        if platform == "cpu":
            # By the part alone, so that the same program runs whatever the number of threads.
            block = usual_block(-(-self.count // 2), platform)
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
        check_count("trials", study.trials, 2, 2**31 - 1)
        self.study = study
        self.points: list[dict[str, float]] = []
        self.cells: dict[tuple[int, str], Cell] = {}
        self.problems: list[str] = []
        for k, (point, one) in enumerate(_looked_ahead(study.conditions())):
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
        return len(self.cells) * self.study.trials

    def seconds(self, cores: int) -> float:
        """About how long it will take, going by typical speeds."""
        total = sum(
            cell.engine.processor_seconds(cell.scenario, self.study.max_steps)
            for cell in self.cells.values()
        )
        return total * self.study.trials / cores

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

    def blocks(self, open_cells: Sequence[tuple[int, str]], first: int, upto: int) -> list[Part]:
        """The parts that run trials `first` to `upto - 1` of some cells."""
        return [
            part
            for start in range(first, upto, BLOCK)
            for part in self.parts(open_cells, start, min(BLOCK, upto - start))
        ]

    def rounded(self, trials: int) -> int:
        """Up to whole blocks, but no more trials than there may be."""
        return min(-(-trials // BLOCK) * BLOCK, self.study.trials)

    def parts(self, open_cells: Sequence[tuple[int, str]], first: int, trials: int) -> list[Part]:
        """The parts that run trials `first` to `first + trials - 1` of some cells."""
        groups: dict[Any, list[tuple[int, str]]] = {}
        for key in open_cells:
            cell = self.cells[key]
            alike = cell.engine, jax.tree.structure(cell.scenario)
            groups.setdefault(alike, []).append(key)
        found = []
        for (engine, _), keys in groups.items():
            least, most = _CONDITIONS
            each = engine.processor_seconds(self.cells[keys[0]].scenario, self.study.max_steps)
            count = min(max(int(_SECONDS / max(each * trials, 1e-9)), least), most)
            for start in range(0, len(keys), count):
                some = tuple(keys[start : start + count])
                found.append(
                    Part(
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


def _looked_ahead(
    conditions: Sequence[tuple[dict[str, float], Study]],
) -> Iterator[tuple[dict[str, float], Study]]:
    """The conditions; what their hands look like is worked out for many at once."""
    for start in range(0, len(conditions), _AHEAD):
        some = conditions[start : start + _AHEAD]
        geometries_of([place for _, study in some for place in study.places_ahead()])
        yield from some


def _each(study: Study) -> list[tuple[str, Scenario]]:
    return list(study.scenarios().items())


def _cell(study: Study, scenario: Scenario) -> Cell:
    gap = scenario.check()
    return Cell(scenario, choose_engine(study.run.engine, study.run.dt, scenario), gap)


def _duration(seconds: float) -> str:
    for size, unit in ((86_400.0, "days"), (3600.0, "hours"), (60.0, "minutes")):
        if seconds > 2 * size:
            return f"roughly {seconds / size:.0f} {unit}"
    return f"roughly {seconds:.0f} seconds" if seconds > 10 else "some seconds"
