"""Areas, widths and checks of convex polygons with rounded corners."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from pcjax.geometry import Scalar, Vec, unit_and_length

MOST_VERTICES = 16

SKIN = 2e-4
"""Least share of a body's radius by which its polygon is rounded (0.01 for the paper's stick).

Wide enough that rounding errors cannot hide on which side of a limb it is, and thousands of times
thinner than anything else in the paper's settings.
"""

Corners = tuple[tuple[Scalar, Scalar], ...]


def farthest(vertices: tuple[Vec, ...]) -> Scalar:
    far = unit_and_length(vertices[0])[1]
    for vertex in vertices[1:]:
        far = jnp.maximum(far, unit_and_length(vertex)[1])
    return far


def _edges(core: tuple[Vec, ...]) -> list[tuple[Vec, Vec]]:
    return list(zip(core, (*core[1:], core[0]), strict=True))


def moments(core: tuple[Vec, ...], rounding: Scalar) -> tuple[Scalar, Vec, Scalar]:
    """Area, centre and second moment about the origin of a polygon inflated by a radius.

    The inflated polygon is the polygon, a rectangle on each edge, and a sector at each vertex.
    """
    area: Any = 0.0
    first = Vec(0.0 * core[0].x, 0.0 * core[0].y)
    second: Any = 0.0

    def add(more: Scalar, offset: Vec, about: Scalar) -> None:
        """A part: its area, its first moment, and its second moment about the origin."""
        nonlocal area, first, second
        area, first, second = area + more, first + offset, second + about

    normals = []
    for a, b in _edges(core):
        twice = a.cross(b)
        both = a + b
        add(twice / 2, both * (twice / 6), twice * (a.dot(a) + a.dot(b) + b.dot(b)) / 12)
        along, length = unit_and_length(b - a)
        normal = Vec(along.y, -along.x)
        normals.append(normal)
        flank, middle = length * rounding, both * 0.5 + normal * (0.5 * rounding)
        own = (length * length + rounding * rounding) / 12
        add(flank, middle * flank, flank * (middle.dot(middle) + own))
    for k, vertex in enumerate(core):
        before, after = normals[k - 1], normals[k]
        turn = jnp.abs(jnp.arctan2(before.cross(after), before.dot(after)))
        turn = 2 * math.pi if len(core) == 1 else turn
        sector = 0.5 * turn * rounding * rounding
        cubed = rounding * rounding * rounding / 3
        swept = Vec(after.y - before.y, before.x - after.x) * cubed
        about = sector * (vertex.dot(vertex) + 0.5 * rounding * rounding) + 2 * vertex.dot(swept)
        add(sector, vertex * sector + swept, about)
    return area, first * (1 / area), second


def least_width(core: tuple[Vec, ...]) -> Scalar:
    """The least distance between two parallel lines that have a convex polygon between them."""
    width: Any = math.inf
    for a, b in _edges(core):
        along, length = unit_and_length(b - a)
        height = along.cross(core[0] - a)
        for vertex in core[1:]:
            height = jnp.maximum(height, along.cross(vertex - a))
        width = jnp.minimum(width, jnp.where(length > 0, height, 0.0))
    return width


def check_convex(core: tuple[Vec, ...]) -> None:
    """Checks the vertices of a polygon, for plain numbers; others are taken as they are.

    Raises:
        ValueError: too many vertices, two that are the same, or an outline that is not convex, or
            clockwise.
    """
    if not 1 <= len(core) <= MOST_VERTICES:
        raise ValueError(f"vertices: there are {len(core)}, and 1 to {MOST_VERTICES} are allowed")
    if not is_plain(core):
        return
    places = np.array([[float(vertex.x), float(vertex.y)] for vertex in core])
    if not np.isfinite(places).all():
        raise ValueError("vertices: every one has to be two finite numbers")
    size = max(float(np.ptp(places, axis=0).max()), 1e-300)
    for k, place in enumerate(places):
        if (np.abs(place - places[:k]).max(axis=1) < _SAME * size).any():
            raise ValueError(f"vertices: two are the same, ({place[0]:g}, {place[1]:g})")
    if len(core) < 3:
        return
    edges = np.roll(places, -1, axis=0) - places
    ahead = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * ahead[:, 1] - edges[:, 1] * ahead[:, 0]
    scale = np.hypot(*edges.T) * np.hypot(*ahead.T)
    area = _twice_area(places.tolist())
    if (np.abs(turns) < _SAME * scale).all():
        raise ValueError("vertices: they lie on one line; two are enough for a rod")
    if abs(area) < _SAME * size * size:
        raise ValueError("vertices: the outline crosses itself")
    if area < 0:
        raise ValueError("vertices: the core goes clockwise; it has to go counterclockwise")
    if (turns < -_SAME * scale).any():
        x, y = np.roll(places, -1, axis=0)[np.argmin(turns)]
        raise ValueError(
            f"vertices: the outline is not convex at ({x:g}, {y:g}); only convex bodies can be run"
        )
    angles = np.arctan2(turns, np.sum(edges * ahead, axis=1))
    if angles.sum() > 2 * math.pi + 1e-6:
        raise ValueError(
            "vertices: the outline winds more than once around, so that it crosses itself"
        )


def is_plain(numbers: Any) -> bool:
    """Whether all are single numbers, not traced."""
    leaves = jax.tree.leaves(numbers)
    return not any(isinstance(leaf, Tracer) or np.ndim(leaf) for leaf in leaves)


def _twice_area(places: Sequence[Any]) -> float:
    """Of a polygon; negative if it goes clockwise."""
    after = [*places[1:], *places[:1]]
    return float(sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(places, after, strict=True)))


def counterclockwise(corners: Corners) -> Corners:
    """The same polygon counterclockwise; vertices that are no plain numbers are as they were."""
    pairs = all(len(corner) == 2 for corner in corners)
    if pairs and is_plain(corners) and _twice_area(corners) < 0:
        return (*corners[:1], *corners[:0:-1])
    return corners


_SAME = 1e-6
"""Share of its size by which something has to differ from nothing."""
