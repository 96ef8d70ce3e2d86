"""What all pictures share: their colours, and the limbs and the object in them."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle as Disc
from matplotlib.patches import Polygon

from pcjax.units import length_in_words

COLOURS = ("#0072b2", "#d55e00", "#009e73")


def name_axes(axis: Axes, units: str) -> None:
    """Labels of a picture that is to scale, with the unit of lengths."""
    unit = length_in_words(units)
    axis.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")


def draw_limbs(
    axis: Axes,
    points: Float[np.ndarray, "points 2"],
    thickness: float,
    *,
    colour: str = "black",
    width: float = 2.0,
    label: str | None = None,
    zorder: float = 2,
) -> None:
    """A hand's limbs, from `points_of`: as thick as they are, to scale, with round ends; without
    thickness as a line.

    Arguments:
        axis: where.
        points: of the middle line.
        thickness: of the limbs, a length.
        colour, label, zorder: of what is drawn.
        width: of a line, in points.
    """
    style: dict[str, Any] = {"color": colour, "label": label, "zorder": zorder}
    if thickness > 0:
        for a, b in pairwise(points):
            axis.add_patch(Polygon(_slot(a, b, thickness / 2), lw=0, **style))
            style["label"] = None
    else:
        axis.plot(*points.T, lw=width, solid_capstyle="round", solid_joinstyle="round", **style)


def _slot(
    a: Float[np.ndarray, "2"], b: Float[np.ndarray, "2"], radius: float
) -> Float[np.ndarray, "points 2"]:
    """The outline of all that is within a radius of the line from a to b."""
    heading = np.arctan2(*(b - a)[::-1])
    arc = heading + np.linspace(-np.pi / 2, np.pi / 2, 25)
    way = radius * np.stack([np.cos(arc), np.sin(arc)], axis=-1)
    return np.concatenate([b + way, a - way])


def draw_object(
    axis: Axes,
    corners: Float[np.ndarray, "corners 2"],
    rounding: float,
    *,
    colour: str = COLOURS[1],
    label: str | None = None,
    zorder: float = 4,
    mark: tuple[Float[np.ndarray, "2"], float] | None = None,
) -> None:
    """The object to scale, from `placed_outline`: two corners that are not rounded are a line.

    Arguments:
        axis: where.
        corners, rounding: of the object.
        colour, label, zorder: of what is drawn.
        mark: from where and at which angle, radians, a line to the outline shows how it lies.
    """
    style: dict[str, Any] = {"color": colour, "label": label, "zorder": zorder}
    if len(corners) == 2 and rounding == 0:
        axis.plot(*corners.T, lw=3, solid_capstyle="round", **style)
        return
    if len(corners) == 1:
        axis.add_patch(Disc((corners[0, 0], corners[0, 1]), rounding, alpha=0.7, **style))
    else:
        axis.add_patch(Polygon(rounded(corners, rounding), alpha=0.7, **style))
    if mark is not None:
        centre, angle = mark
        way = np.array([math.cos(angle), math.sin(angle)])
        ends = np.stack([centre, centre + way * _reach(rounded(corners, rounding), *mark)])
        axis.plot(*ends.T, color="white", lw=1.5, zorder=zorder + 0.1)


def rounded(
    corners: Float[np.ndarray, "corners 2"], rounding: float
) -> Float[np.ndarray, "points 2"]:
    """The outline of a convex polygon inflated by a radius, counterclockwise as its corners are."""
    if len(corners) == 1:
        arc = np.linspace(0.0, 2 * math.pi, 100, endpoint=False)
        return corners + rounding * np.stack([np.cos(arc), np.sin(arc)], axis=-1)
    if rounding == 0:
        return corners
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.arctan2(edges[:, 1], edges[:, 0]) - math.pi / 2  # which way an edge looks out
    before = np.roll(after, 1)
    turn = (after - before + 1e-9) % (2 * math.pi)
    arcs = before[:, None] + turn[:, None] * np.linspace(0.0, 1.0, 25)
    out = rounding * np.stack([np.cos(arcs), np.sin(arcs)], axis=-1)
    return (corners[:, None] + out).reshape(-1, 2)


def _reach(
    outline: Float[np.ndarray, "points 2"], centre: Float[np.ndarray, "2"], angle: float
) -> float:
    """How far a convex outline is from a point in it at an angle."""
    way = np.array([math.cos(angle), math.sin(angle)])
    edges = np.roll(outline, -1, axis=0) - outline
    outwards = np.stack([edges[:, 1], -edges[:, 0]], axis=-1)
    ahead = outwards @ way
    far = ((outline - centre) * outwards).sum(axis=-1)
    return float(np.min(far[ahead > 0] / ahead[ahead > 0]))
