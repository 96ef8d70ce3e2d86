"""Which of many designs are hands, have their clearance, and have room for the object."""

from __future__ import annotations

import jax
import numpy as np
from jaxtyping import Bool, Float

from pcjax.design.space import DesignSpace
from pcjax.model.checking import is_hand
from pcjax.model.layout import fit_of
from pcjax.quality.task import Task


def shapes(
    task: Task, space: DesignSpace, designs: Float[np.ndarray, "*shape parameters"]
) -> tuple[Float[np.ndarray, "*shape"], Bool[np.ndarray, "*shape"]]:
    """The gaps of many hands, and which of them can be: lengths above 0, hands in all of the
    task's directions, and room for the object at its starts."""
    columns = np.moveaxis(designs, -1, 0).reshape(len(space.free), -1)
    count = columns.shape[1]
    hands = jax.tree.map(
        lambda leaf: np.broadcast_to(np.asarray(leaf, float), count), space.hand(columns)
    )
    there = np.all([length > 0 for row in hands.lengths for length in row], axis=0)
    seen = {"does": hands, "eoen": hands}
    with np.errstate(all="ignore"):
        if "eoen" in task.directions:
            seen["eoen"] = hands.with_fingertips_mirrored()
        there &= is_hand(hands, task.directions)
        radius, spread = task.body.radius + 0.5 * hands.thickness, np.full(count, task.start_spread)
        for direction in task.directions:
            fit = fit_of(seen[direction], radius, spread)
            there &= (fit.clearance >= -1e-9 * hands.palm_length) & ~fit.outside
        gaps = hands.gap()
    return gaps.reshape(designs.shape[:-1]), there.reshape(designs.shape[:-1])


def allowed_among(
    task: Task, space: DesignSpace, designs: Float[np.ndarray, "designs parameters"]
) -> Bool[np.ndarray, " designs"]:
    """Which of many designs are allowed (see `DesignSpace.allowed`) and have room for the object
    at its starts."""
    gaps, there = shapes(task, space, designs)
    slack = 1e-9 * np.abs(space.scales)
    inside = np.all((designs >= space.low - slack) & (designs <= space.high + slack), axis=1)
    for limit in space.limits:
        most = limit.most + np.abs(limit.coefficients) @ slack
        inside &= designs @ limit.coefficients <= most
    return there & inside & (gaps - space.least_gap(1.0) > -1e-6 * space.width)
