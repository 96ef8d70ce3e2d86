"""Scores over a plane: colours, and lines with their values where there is room for these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from scipy.interpolate import NearestNDInterpolator

_MARGIN = 0.1
"""Share of the plane's sides that labels stay away from them, so that none is cut."""

_APART = 0.15
"""Share of the plane's sides that labels are apart."""

_SHORTEST = 0.4
"""Share of the plane's sides that a line has to be long for a label."""

_HALF = 0.06
"""Half of a label's length, as share of the plane's sides: so far to both sides of it the line has
to be straight, else it stands beside the line and cuts a corner off."""

_STRAIGHT = 0.95
"""How long the chord of such a piece has to be, as share of the piece."""

Covered = tuple[Sequence[Float[np.ndarray, " _"]], Bool[np.ndarray, "y x"]]
"""Lines of a grid, x first, and where something else is drawn over it."""


def draw_contours(
    axis: Axes,
    xs: Float[np.ndarray, " x"],
    ys: Float[np.ndarray, " y"],
    score: Float[np.ndarray, "y x"],
    label: str,
    covered: Covered,
    marks: Float[np.ndarray, "marks 2"],
) -> None:
    """Colours with their bar, and white lines of equal score.

    Arguments:
        axis: where.
        xs, ys: the grid.
        score: on it; NaN where there is none.
        label: of the scores.
        covered: where no line's value is to be written.
        marks: points that it is not to be written at.
    """
    # An index at its limit is beyond it by rounding, and the last colour ends there.
    shown = _without_holes(score).astype(np.float32)
    filled = axis.contourf(xs, ys, shown, 12, cmap="viridis")
    axis.figure.colorbar(filled, ax=axis, label=label)
    levels = list(filled.levels)[1:-1:2]
    lines = axis.contour(xs, ys, score, levels, colors="white", linewidths=0.7)
    low = np.array([xs.min(), ys.min()])
    size = np.array([xs.max(), ys.max()]) - low
    marked = list((marks - low) / size)
    places = list(marked)
    for path in lines.get_paths():
        for line in path.to_polygons(closed_only=False):
            _add_place(places, (line - low) / size, low, size, covered)
    labels = [tuple(low + size * at) for at in places[len(marked) :]]
    if labels:
        axis.clabel(lines, manual=labels, fontsize=8, zorder=2)


def _add_place(
    places: list[np.ndarray],
    line: Float[np.ndarray, "points 2"],
    low: Float[np.ndarray, "2"],
    size: Float[np.ndarray, "2"],
    covered: Covered,
) -> None:
    """Adds the free place next to a line's middle, if there is one; all in shares of the plane."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    if along[-1] < _SHORTEST:
        return
    way = np.linspace(0.0, along[-1], 101)
    points = np.stack([np.interp(way, along, line[:, k]) for k in (0, 1)], axis=-1)
    free = np.all((points > _MARGIN) & (points < 1 - _MARGIN), axis=1)
    before, after = (
        np.stack([np.interp(way + off, along, line[:, k]) for k in (0, 1)], axis=-1)
        for off in (-_HALF, _HALF)
    )
    free &= np.hypot(*(after - before).T) > 2 * _HALF * _STRAIGHT
    (columns, rows), mask = covered
    at = low + size * points
    column, row = (
        np.abs(values[None] - at[:, k, None]).argmin(axis=1)
        for k, values in enumerate((columns, rows))
    )
    free &= ~mask[row, column]
    for other in places:
        free &= np.hypot(*(points - other).T) > _APART
    if free.any():
        places.append(points[free][np.abs(way[free] - along[-1] / 2).argmin()])


def _without_holes(values: Float[np.ndarray, "y x"]) -> Float[np.ndarray, "y x"]:
    """Every NaN replaced by the nearest value, so that colours reach the edge of a region."""
    there = np.isfinite(values)
    nearest = NearestNDInterpolator(np.argwhere(there), values[there])
    return nearest(*np.indices(values.shape))
