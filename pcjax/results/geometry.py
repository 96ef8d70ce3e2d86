"""Where limbs, goal line, gap and object are, as evaluations keep them for pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pcjax.geometry import Vec
from pcjax.model.bodies.base import placed_outline
from pcjax.model.checking import geometry_of
from pcjax.model.scenario import Scenario


def places_of(scenarios: Sequence[Scenario]) -> tuple[dict[str, np.ndarray], float]:
    """The variables of an evaluation that say where things are, each along the directions, and the
    radius by which the object's corners are rounded; for plain numbers, in 64 bits."""
    found = [geometry_of(scenario) for scenario in scenarios]
    starts = [_numbers(one.start) for one in found]
    outlines = [
        placed_outline(scenario.body, start)
        for scenario, start in zip(scenarios, starts, strict=True)
    ]
    return {
        "limbs": np.stack(
            [[_numbers(limb.start, limb.end) for limb in one.limbs] for one in found]
        ),
        "goal": np.stack([_numbers(one.goal.a, one.goal.b) for one in found]),
        "passage": np.stack([_numbers(*one.passage) for one in found]),
        "gap": np.array([one.gap for one in found], float),
        "start": np.stack(starts),
        "outline": np.stack([corners for corners, _ in outlines]),
    }, outlines[0][1]


def _numbers(*points: Vec) -> np.ndarray:
    return np.array([number for point in points for number in (point.x, point.y)], float)
