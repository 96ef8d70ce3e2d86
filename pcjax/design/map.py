"""The exact score of the hands that two parameters make, as labelled data."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from pcjax.checks import check_count, check_kind
from pcjax.design.compare import score_all
from pcjax.design.parameters import Parameter
from pcjax.design.postures import PostureParameter
from pcjax.design.search import grid_lines
from pcjax.design.space import Space
from pcjax.importing import xr
from pcjax.model.scenario import Scenario
from pcjax.progress import progress_bar
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task
from pcjax.results.estimates import rows_of
from pcjax.results.provenance import conditions, provenance
from pcjax.results.schema import dataset_of

FINE = 121
"""Hands along each side that are looked at, to draw where there are none."""


@dataclass(frozen=True)
class Number:
    """A number of the object, the drive or the contact that a map has along one side.

    Attributes:
        label: its name in study files.
        low, high: its bounds, as files have it.
        current: what it is in the study.
        unit: as `pcjax.study.vary.unit_of` has it.
    """

    label: str
    low: float
    high: float
    current: float
    unit: str

    @property
    def axis_unit(self) -> str:
        """As the coordinate of a dataset has it."""
        return self.unit

    @property
    def name(self) -> str:
        """Without the unit."""
        return self.label.removesuffix("_deg")


Side = Parameter | PostureParameter | Number
"""What a map may have along a side."""


def score_map(
    surrogate: Surrogate,
    space: Space,
    points: Sequence[int] | None = None,
    *,
    seed: int = 0,
    progress: bool = False,
) -> xr.Dataset:
    """The exact score over two parameters of a hand, all hands on the same trials.

    Arguments:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: with two free parameters; a clearance does not count.
        points: hands along each parameter, from its lower to its upper bound; 11 each unless given.
        seed: of the trials.
        progress: whether to show a bar on stderr.

    Returns:
        A dataset along the two parameters' labels, the second first, with the `score` (index,
        statistic; NaN where there is none), where `index` is the objective, the hand's `gap`,
        whether it is a `full_cage` and whether it is `possible` at all; in the plane `gap_fine` and
        `possible_fine` on a finer grid. In three dimensions no gap is known: it is NaN.
        Attributes `current_...` are the base hand's; there are none where it is not on the map:
        outside the bounds, or its fingers differ in a parameter that is for both.

    Raises:
        TypeError: a surrogate or space that is none.
        ValueError: not two parameters, a number out of range, or no hand that has a score.
    """
    check_kind("surrogate", surrogate, Surrogate)
    check_kind("space", space, Space)
    return MapPlan.of(surrogate, space, points, seed=seed).run(progress=progress)


@dataclass(frozen=True)
class MapPlan:
    """The hands of a map before they are scored.

    Attributes:
        surrogate, seed: see `score_map`.
        space: whose free parameters are those sides that are the hand's, if any is.
        sides: what is along x and along y.
        task_at: the task for values of those sides that are not the hand's, by label.
        lines: values of each side.
        places: of the grid, the second side slowest, and after them the current one.
        gaps, possible: of those (`Space.look`).
        caged: which are full cages.
        scored: which of those are to be scored.
    """

    surrogate: Surrogate
    space: Space
    sides: tuple[Side, ...]
    task_at: Callable[[dict[str, float]], Task]
    seed: int
    lines: list[Float[np.ndarray, " _"]]
    places: Float[np.ndarray, "places 2"]
    gaps: Float[np.ndarray, " places"]
    possible: Bool[np.ndarray, " places"]
    caged: Bool[np.ndarray, " places"]
    scored: Bool[np.ndarray, " places"]

    @classmethod
    def of(
        cls,
        surrogate: Surrogate,
        space: Space,
        points: Sequence[int] | None = None,
        *,
        seed: int = 0,
        sides: Sequence[Side] | None = None,
        task_at: Callable[[dict[str, float]], Task] | None = None,
    ) -> MapPlan:
        """Checks everything and looks at every hand; see `score_map`.

        Arguments:
            surrogate, space, points, seed: see there.
            sides: what is along x and y, if not the space's two parameters. A space of which none
                is a side says of its first parameter that it stays as it is.
            task_at: see the class.
        """
        check_count("seed", seed, 0, 2**32 - 1)
        if surrogate.task.also:
            raise ValueError("a map is of one condition, and the task has several")
        sides = tuple(space.free if sides is None else sides)
        if len(sides) != 2:
            raise ValueError(f"a map needs two free parameters, and there are {len(sides)}")
        lines = grid_lines(sides, points)
        for side, line in zip(sides, lines, strict=True):
            check_count(f"grid points of {side.name}", len(line), 2, 1000)
        design = dict(zip(space.free, space.design_of(space.base), strict=True))
        current = [s.current if isinstance(s, Number) else design[s] for s in sides]
        # One that is none, such as no friction, is nowhere on the map.
        current = [s.low if math.isnan(v) else v for s, v in zip(sides, current, strict=True)]
        places = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
        places = np.concatenate([places, [current]])
        blank, none = np.zeros(len(places)), np.zeros(len(places), bool)
        task_at = (lambda _: surrogate.task) if task_at is None else task_at
        plan = cls(surrogate, space, sides, task_at, seed, lines, places, blank, none, none, none)
        gaps, possible, caged = blank.copy(), none.copy(), none.copy()
        for rows, mine, designs in plan.groups():
            gaps[rows], possible[rows] = mine.holding(plan.task_of(rows)).look(designs)
            caged[rows] = mine.caged(gaps[rows])
        scored = possible & ~caged
        if not np.any(scored[:-1]):
            raise ValueError(
                "no hand on the map has a score: everywhere the gap is narrower than the object, "
                "limbs cross or overlap, or the object does not fit; take other bounds, more points"
            )
        scored[-1] &= plan.marked
        return replace(plan, gaps=gaps, possible=possible, caged=caged, scored=scored)

    def task_of(self, rows: Int[np.ndarray, " rows"]) -> Task:
        """The task of some places, which have it in common."""
        values = zip(self.sides, self.places[rows[0]], strict=True)
        return self.task_at({s.label: float(v) for s, v in values if isinstance(s, Number)})

    def groups(
        self, among: Bool[np.ndarray, " places"] | None = None
    ) -> Iterator[tuple[Int[np.ndarray, " rows"], Space, Float[np.ndarray, "rows _"]]]:
        """Places that have their task in common: their rows, the space of their hands, and their
        designs in it."""
        others = [k for k, side in enumerate(self.sides) if isinstance(side, Number)]
        _, group = np.unique(self.places[:, others], axis=0, return_inverse=True)
        for k in range(group.max() + 1):
            rows = np.flatnonzero((group == k) & (True if among is None else among))
            if len(rows) == 0:
                continue
            designs = np.repeat(self.space.design_of(self.space.base)[None], len(rows), axis=0)
            for column, p in enumerate(self.space.free):
                if p in self.sides:
                    designs[:, column] = self.places[rows, self.sides.index(p)]
            space = self.space
            yield rows, space.for_object(self.task_of(rows).body) if others else space, designs

    @property
    def hands(self) -> int:
        """How many hands of the grid are to be scored."""
        return int(np.sum(self.scored[:-1]))

    @property
    def marked(self) -> bool:
        """Whether the current hand is on the map: within the bounds, and one of the space."""
        current = self.places[-1]
        there = all(
            side.low <= value <= side.high for side, value in zip(self.sides, current, strict=True)
        )
        numbers = [side for side in self.sides if isinstance(side, Number)]
        return (
            self.space.has_base
            and there
            and not any(math.isnan(number.current) for number in numbers)
        )

    def run(self, *, progress: bool = False) -> xr.Dataset:
        """The map; see `score_map`."""
        began = time.perf_counter()
        surrogate, space, count, task = self.surrogate, self.space, len(self.places), self.task
        scores, each = np.full((count, 4), np.nan), dict[int, list[Scenario]]()
        for rows, mine, designs in self.groups(self.scored):
            hands = list(map(mine.hand, designs))
            each |= zip(rows.tolist(), self.task_of(rows).scenarios_of(hands), strict=True)
        with progress_bar(total=len(each), desc="designs", unit="design", shown=progress) as bar:
            found, invalid = score_all(
                surrogate, list(each.values()), seed=self.seed, on_done=bar.update
            )
        if all(math.isnan(score.value) for score in found):
            raise ValueError(
                "no hand on the map has a score: nowhere does a trial escape, or is one held to "
                "the limit from outside; take more trials, another limit, or objective index1"
            )
        scores[list(each)] = rows_of(found)
        x, y = self.sides
        sides = {y.label: self.lines[1], x.label: self.lines[0]}
        shape = len(self.lines[1]), len(self.lines[0])
        about_current = {
            **{
                f"current_{side.label}": float(value)
                for side, value in zip(self.sides, self.places[-1], strict=True)
            },
            "current_score": scores[-1, 0],
            "current_se": scores[-1, 1],
        }
        coordinates: dict[str, Any] = dict(sides)
        variables = {
            "score": scores[:-1].reshape(*shape, 1, 4),
            "gap": self.gaps[:-1].reshape(shape),
            "full_cage": self.caged[:-1].reshape(shape),
            "possible": self.possible[:-1].reshape(shape),
        }
        if space.shown_finely and not any(isinstance(side, Number) for side in self.sides):
            fine = {f"{p.label}_fine": np.linspace(p.low, p.high, FINE) for p in (y, x)}
            shown = np.meshgrid(fine[f"{x.label}_fine"], fine[f"{y.label}_fine"])
            gaps, possible = space.holding(task).look(np.stack(shown, axis=-1))
            variables |= {"gap_fine": gaps, "possible_fine": possible}
            coordinates |= fine
        for side in self.sides:
            if side.axis_unit:
                coordinates[side.label] = (side.label, sides[side.label], {"units": side.axis_unit})
        base = space.hand(space.design_of(space.base))
        scenarios = dict(zip(task.directions, task.scenarios(base), strict=True))
        engine = surrogate.engine(list(scenarios.values()))
        dataset = dataset_of(
            "map",
            variables,
            {**coordinates, "index": [surrogate.objective]},
            provenance(
                {
                    "trials": surrogate.trials,
                    "max_steps": task.max_steps,
                    "seed": self.seed,
                    "engine": engine.name,
                    "precision": engine.bits or 32,
                    "objective": surrogate.objective,
                    "score_name": score_name(surrogate),
                    "directions": list(task.directions),
                    "length_unit": task.units,
                    "object_width": space.width,
                    "hands": self.hands,
                    "invalid": invalid,
                    "wall_seconds": time.perf_counter() - began,
                    **(about_current if self.marked else {}),
                    **conditions(scenarios),
                }
            ),
            place=tuple(sides),
        )
        dataset.score.attrs["long_name"] = score_name(surrogate)
        return dataset

    @property
    def task(self) -> Task:
        """Of the current hand."""
        return self.surrogate.task


def score_name(surrogate: Surrogate) -> str:
    """What a surrogate's exact score is called."""
    task = surrogate.task
    what = "DoEs / EoEn" if len(task.directions) == 2 else "DoEs"
    how = "worst" if task.worst else "mean"
    over = f", {how} of {len(task.each)} conditions" if task.also else ""
    return f"{what} by {surrogate.objective}{over}"
