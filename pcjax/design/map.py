"""The exact score of the hands that two parameters make, as labelled data."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Bool, Float

from pcjax.checks import check_count, check_kind
from pcjax.design.compare import score_all
from pcjax.design.search import grid_lines
from pcjax.design.space import DesignSpace
from pcjax.importing import xr
from pcjax.model.hand import full_cage
from pcjax.quality.surrogate import Surrogate
from pcjax.results.estimates import rows_of
from pcjax.results.provenance import conditions, provenance
from pcjax.results.schema import dataset_of

FINE = 121
"""Hands along each side that are looked at, to draw where there are none."""


def score_map(
    surrogate: Surrogate,
    space: DesignSpace,
    points: Sequence[int] | None = None,
    *,
    seed: int = 0,
    progress: bool = False,
) -> xr.Dataset:
    """The exact score over two parameters of a hand, all hands on the same trials.

    Arguments:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: with two free parameters; its clearance does not count.
        points: hands along each parameter, from its lower to its upper bound; 11 each unless given.
        seed: of the trials.
        progress: whether to show a bar on stderr.

    Returns:
        A dataset along the two parameters' labels, the second first, with the `score` (index,
        statistic; NaN where there is none), where `index` is the objective, the hand's `gap`,
        whether it is a `full_cage` and whether it is `possible` at all; `gap_fine` and
        `possible_fine` on a finer grid.
        Attributes `current_...` are the base hand's; there are none where it is not on the map:
        outside the bounds, or its fingers differ in a parameter that is for both.

    Raises:
        TypeError: a surrogate or space that is none.
        ValueError: not two parameters, a number out of range, or no hand that has a score.
    """
    check_kind("surrogate", surrogate, Surrogate)
    check_kind("space", space, DesignSpace)
    return MapPlan.of(surrogate, space, points, seed=seed).run(progress=progress)


@dataclass(frozen=True)
class MapPlan:
    """The hands of a map before they are scored.

    Attributes:
        surrogate, space, seed: see `score_map`.
        lines: values of each parameter.
        designs: of the grid, the second parameter slowest, and after them the base hand's.
        gaps, possible: of those (`shapes`).
        scored: which of those are to be scored.
    """

    surrogate: Surrogate
    space: DesignSpace
    seed: int
    lines: list[Float[np.ndarray, " _"]]
    designs: Float[np.ndarray, "designs 2"]
    gaps: Float[np.ndarray, " designs"]
    possible: Bool[np.ndarray, " designs"]
    scored: Bool[np.ndarray, " designs"]

    @classmethod
    def of(
        cls,
        surrogate: Surrogate,
        space: DesignSpace,
        points: Sequence[int] | None = None,
        *,
        seed: int = 0,
    ) -> MapPlan:
        """Checks everything and looks at every hand; see `score_map`."""
        check_count("seed", seed, 0, 2**32 - 1)
        if len(space.free) != 2:
            raise ValueError(f"a map needs two free parameters, and there are {len(space.free)}")
        lines = grid_lines(space, points)
        for p, line in zip(space.free, lines, strict=True):
            check_count(f"grid points of {p.name}", len(line), 2, 1000)
        current = space.design_of(space.base)
        designs = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
        designs = np.concatenate([designs, current[None]])
        gaps, possible = space.holding(surrogate.task).look(designs)
        scored = possible & ~full_cage(gaps, space.width)
        if not np.any(scored[:-1]):
            raise ValueError(
                "no hand on the map has a score: everywhere the gap is narrower than the object, "
                "limbs cross, or the object does not fit; take other bounds or more points"
            )
        scored[-1] &= _on_map(space, current)
        return cls(surrogate, space, seed, lines, designs, gaps, possible, scored)

    @property
    def hands(self) -> int:
        """How many hands of the grid are to be scored."""
        return int(np.sum(self.scored[:-1]))

    def run(self, *, progress: bool = False) -> xr.Dataset:
        """The map; see `score_map`."""
        began = time.perf_counter()
        surrogate, space, count = self.surrogate, self.space, len(self.designs)
        task = surrogate.task
        found, invalid = score_all(
            surrogate, space, list(self.designs[self.scored]), seed=self.seed, progress=progress
        )
        scores = np.full((count, 4), np.nan)
        scores[self.scored] = rows_of(found)
        x, y = space.free
        sides = {y.label: self.lines[1], x.label: self.lines[0]}
        shape = len(self.lines[1]), len(self.lines[0])
        current = self.designs[-1]
        about_current = {
            **{f"current_{name}": value for name, value in space.named(current).items()},
            "current_score": scores[-1, 0],
            "current_se": scores[-1, 1],
        }
        fine = {f"{p.label}_fine": np.linspace(p.low, p.high, FINE) for p in (y, x)}
        places = np.stack(np.meshgrid(fine[f"{x.label}_fine"], fine[f"{y.label}_fine"]), axis=-1)
        gaps, possible = space.holding(surrogate.task).look(places)
        task, base = surrogate.task, space.hand(current)
        scenarios = dict(zip(task.directions, task.scenarios(base), strict=True))
        dataset = dataset_of(
            "map",
            {
                "score": scores[:-1].reshape(*shape, 1, 4),
                "gap": self.gaps[:-1].reshape(shape),
                "full_cage": full_cage(self.gaps, space.width)[:-1].reshape(shape),
                "possible": self.possible[:-1].reshape(shape),
                "gap_fine": gaps,
                "possible_fine": possible,
            },
            {**sides, **fine, "index": [surrogate.objective]},
            provenance(
                {
                    "trials": surrogate.trials,
                    "max_steps": task.max_steps,
                    "seed": self.seed,
                    "engine": surrogate.engine(list(scenarios.values())).name,
                    "precision": 32,
                    "objective": surrogate.objective,
                    "score_name": score_name(surrogate),
                    "directions": list(task.directions),
                    "length_unit": task.units,
                    "object_width": space.width,
                    "hands": self.hands,
                    "invalid": invalid,
                    "wall_seconds": time.perf_counter() - began,
                    **(about_current if _on_map(space, current) else {}),
                    **conditions(scenarios),
                }
            ),
            place=tuple(sides),
        )
        dataset.score.attrs["long_name"] = score_name(surrogate)
        return dataset


def _on_map(space: DesignSpace, current: Float[np.ndarray, "2"]) -> bool:
    """Whether the design `current` is the base hand, and within the bounds."""
    pairs = zip(jax.tree.leaves(space.hand(current)), jax.tree.leaves(space.base), strict=True)
    same = all(np.isclose(float(a), float(b), rtol=1e-9, atol=1e-12) for a, b in pairs)
    return same and bool(np.all((current >= space.low) & (current <= space.high)))


def score_name(surrogate: Surrogate) -> str:
    """What a surrogate's exact score is called."""
    task = surrogate.task
    what = "DoEs / EoEn" if len(task.directions) == 2 else "DoEs"
    how = "worst" if task.worst else "mean"
    over = f", {how} of {len(task.each)} conditions" if task.also else ""
    return f"{what} by {surrogate.objective}{over}"
