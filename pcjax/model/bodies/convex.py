"""Convex things: a polygon with rounded corners, and its cases by a few numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from pcjax.checks import check_positive
from pcjax.components import quantity
from pcjax.geometry import Scalar, Vec, unit_and_length
from pcjax.model.bodies.base import (
    Body,
    Orientation,
    mass_field,
    orientation_field,
    register_body,
    turns_field,
)

SKIN = 2e-4
"""Least share of a body's radius by which its polygon is rounded: wide enough that rounding errors
cannot hide on which side of a limb it is, and far thinner than anything else."""

MOST_VERTICES = 16

Corners = tuple[tuple[Scalar, Scalar], ...]


def rounding_field() -> Any:
    """The radius of a polygon's corners."""
    return quantity(
        "length",
        "radius of its corners",
        default=0.0,
        low=0,
        key="rounding",
        flag="rounding",
    )


class Convex(Body):
    """A convex polygon with rounded corners, of uniform density.

    What it is made of is its `core`: the polygon of the centres of its corners' circles. Centre of
    mass and moment of inertia are those of the core inflated by `rounding`.

    Attributes:
        rounding: the corners' radius, a length. It is taken as `SKIN` times the body's radius
            where it is less.
        orientation: angle from the palm at the start of a trial, radians; None: drawn for each.
        mass: M_o; it cancels from the indices.
        turns: whether it turns; if not, its moment of inertia counts as infinite.
    """

    oriented = True
    convex = True

    if TYPE_CHECKING:  # for fields or properties of the subclass
        rounding: Scalar = eqx.field(init=False)
        mass: Scalar = eqx.field(init=False)

    def __check_init__(self) -> None:
        super().__check_init__()  # what is out of range is said first
        core = self.core()
        check_convex(core)
        if len(core) == 1:
            check_positive("rounding of a single vertex", self.rounding)

    def core(self) -> tuple[Vec, ...]:
        """The polygon's vertices, counterclockwise, in axes of the body's own."""
        raise NotImplementedError

    @property
    def vertices(self) -> tuple[Vec, ...]:
        """The core's vertices seen from the centre of mass."""
        core = self.core()
        centre = moments(core, self.rounding)[1]
        return tuple(vertex - centre for vertex in core)

    @property
    def radius(self) -> Scalar:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of the circle about the centre of mass in which it can turn."""
        return _farthest(self.vertices) + self.rounding

    @property
    def skin(self) -> Scalar:
        """The rounding that contact takes: at least `SKIN` of the radius."""
        return jnp.maximum(self.rounding, SKIN * self.radius)

    @property
    def inertia(self) -> Scalar:
        """About the centre of mass."""
        area, centre, second = moments(self.core(), self.rounding)
        return self.mass * (second / area - centre.dot(centre))

    @property
    def per_gyration(self) -> Scalar:
        """1 over the radius of gyration; 0 if it does not turn."""
        return jnp.sqrt(self.mass / self.inertia) if self.turns else 0.0 * self.radius

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through: its least width."""
        return least_width(self.core()) + 2.0 * self.rounding

    def outline(self) -> tuple[tuple[Vec, ...], Scalar]:
        """Its vertices and their rounding."""
        return self.vertices, self.rounding


def _farthest(vertices: tuple[Vec, ...]) -> Scalar:
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
    if not _is_plain(core):
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


def _is_plain(numbers: Any) -> bool:
    """Whether all are single numbers, not traced."""
    leaves = jax.tree.leaves(numbers)
    return not any(isinstance(leaf, Tracer) or np.ndim(leaf) for leaf in leaves)


def _twice_area(places: Sequence[Any]) -> float:
    """Of a polygon; negative if it goes clockwise."""
    after = [*places[1:], *places[:1]]
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(places, after, strict=True))


def _counterclockwise(corners: Corners) -> Corners:
    """The same polygon counterclockwise; vertices that are no plain numbers are as they were."""
    pairs = all(len(corner) == 2 for corner in corners)
    if pairs and _is_plain(corners) and _twice_area(corners) < 0:
        return (*corners[:1], *corners[:0:-1])
    return corners


_SAME = 1e-6
"""Share of its size by which something has to differ from nothing."""


@register_body("polygon")
class Polygon(Convex):
    """A convex polygon by its vertices, inflated by `rounding`.

    Arguments:
        corners: the vertices (x, y), lengths, in either sense around; 1 to 16.
        rounding: by which the polygon is inflated.
        orientation: angle from the palm at the start of a trial, radians; "random", kept as None:
            any, drawn for each trial.
        mass: M_o.
        turns: whether it turns, or is a puck that rubs.

    Raises:
        ValueError: an outline that is not convex, that crosses itself or has no area, a vertex
            twice, too many of them, or a number out of range.

    Examples:
        >>> import pcjax
        >>> triangle = pcjax.Polygon(((0, 0), (60, 0), (0, 80)))
        >>> round(float(triangle.width), 1)  # the height over the longest side
        48.0
    """

    corners: Corners = quantity(
        "length",
        "its vertices (x, y)",
        converter=_counterclockwise,
        key="vertices",
        count=2,
        many=True,
        each="coordinate",
    )
    rounding: Scalar = rounding_field()
    orientation: Orientation = orientation_field()
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    noun = "polygon of"

    def core(self) -> tuple[Vec, ...]:
        """The vertices, counterclockwise."""
        return tuple(Vec(*corner) for corner in self.corners)

    def size_in_words(self) -> str:
        """How many vertices it has, and its radius."""
        vertices = "1 vertex" if len(self.corners) == 1 else f"{len(self.corners)} vertices"
        return f"{vertices} and radius {float(self.radius):.4g}"

    def mirrored(self) -> Polygon:
        """The polygon with every y turned to the other side."""
        return replace(self, corners=tuple((x, -y) for x, y in reversed(self.corners)))


def _side(help: str, key: str, **more: Any) -> Any:
    return quantity("length", help, low=0, above=True, key=key, flag=key, **more)


def _check_below(name: str, value: Scalar, bound: Scalar, of: str) -> None:
    """What has to be less than another length, where that is one."""
    if isinstance(value, (int, float)) and isinstance(bound, (int, float)) and 0 < bound <= value:
        raise ValueError(f"{name} is {value:g}: it has to be less than {of}, {bound:g}")


@register_body("square")
class Square(Convex):
    """A square with rounded corners.

    Arguments:
        side: from side to side.
        rounding: its corners' radius, less than half of the side.
        orientation: angle from the palm at the start of a trial, radians; "random", kept as None:
            any, drawn for each trial.
        mass: M_o.
        turns: whether it turns, or is a puck that rubs.

    Raises:
        ValueError: a number out of range.

    Examples:
        >>> import pcjax
        >>> square = pcjax.Square(60.0)
        >>> float(square.width)
        60.0
        >>> round(float(square.inertia), 3)  # M a^2 / 6
        600.0
    """

    side: Scalar = _side("of a square, from side to side", "side")
    rounding: Scalar = rounding_field()
    orientation: Orientation = orientation_field()
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    noun = "square of side"

    def __check_init__(self) -> None:
        _check_below("rounding", self.rounding, self.side / 2, "half of the side")

    def core(self) -> tuple[Vec, ...]:
        """Four vertices."""
        half = self.side / 2 - self.rounding
        return _box(half, half)

    def size_in_words(self) -> str:
        """Its side."""
        return f"{float(self.side):.4g}"


def _box(wide: Scalar, high: Scalar) -> tuple[Vec, ...]:
    return Vec(-wide, -high), Vec(wide, -high), Vec(wide, high), Vec(-wide, high)


@register_body("rectangle")
class Rectangle(Convex):
    """A rectangle with rounded corners.

    Arguments:
        sides: along the palm at orientation 0, and square to it.
        rounding: its corners' radius, less than half of the shorter side.
        orientation: angle from the palm at the start of a trial, radians; "random", kept as None:
            any, drawn for each trial.
        mass: M_o.
        turns: whether it turns, or is a puck that rubs.

    Raises:
        ValueError: a number out of range.
    """

    sides: tuple[Scalar, Scalar] = _side(
        "of a rectangle, along the palm at orientation 0, and square to it",
        "sides",
        count=2,
        each="side",
    )
    rounding: Scalar = rounding_field()
    orientation: Orientation = orientation_field()
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    noun = "rectangle of"

    def __check_init__(self) -> None:
        for side in self.sides:
            _check_below("rounding", self.rounding, side / 2, "half of each side")

    def core(self) -> tuple[Vec, ...]:
        """Four vertices."""
        wide, high = (side / 2 - self.rounding for side in self.sides)
        return _box(wide, high)

    def size_in_words(self) -> str:
        """Its sides."""
        return " by ".join(f"{float(side):.4g}" for side in self.sides)


@register_body("capsule")
class Capsule(Convex):
    """A rod with round ends.

    Arguments:
        length: from end to end, along the palm at orientation 0.
        diameter: from side to side, less than the length.
        orientation: angle from the palm at the start of a trial, radians; "random", kept as None:
            any, drawn for each trial.
        mass: M_o.
        turns: whether it turns, or is a puck that rubs.

    Raises:
        ValueError: a number out of range.
    """

    length: Scalar = _side("of a capsule, from end to end", "length")
    diameter: Scalar = _side("of a capsule, from side to side", "diameter")
    orientation: Orientation = orientation_field()
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    noun = "capsule of length"

    def __check_init__(self) -> None:
        _check_below("diameter", self.diameter, self.length, "the length")

    @property
    def rounding(self) -> Scalar:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Half of the diameter."""
        return self.diameter / 2

    def core(self) -> tuple[Vec, ...]:
        """Two vertices."""
        half, zero = (self.length - self.diameter) / 2, 0.0 * self.length
        return Vec(-half, zero), Vec(half, zero)

    def size_in_words(self) -> str:
        """From end to end, and from side to side."""
        return f"{float(self.length):.4g} and diameter {float(self.diameter):.4g}"


@register_body("regular")
class RegularPolygon(Convex):
    """A regular polygon with rounded corners; at orientation 0 a vertex points along the palm.

    Arguments:
        number: of vertices, 3 to 16.
        circumradius: from the centre to the sharp corners that rounding takes off.
        rounding: its corners' radius, less than that of the circle in it.
        orientation: angle from the palm at the start of a trial, radians; "random", kept as None:
            any, drawn for each trial.
        mass: M_o.
        turns: whether it turns, or is a puck that rubs.

    Raises:
        ValueError: a number out of range.
    """

    number: int = quantity(
        "1",
        "of a regular polygon's vertices",
        low=3,
        high=MOST_VERTICES,
        kind=int,
        static=True,
        key="number",
        flag="number",
    )
    circumradius: Scalar = _side(
        "of a regular polygon, from the centre to its sharp corners", "circumradius"
    )
    rounding: Scalar = rounding_field()
    orientation: Orientation = orientation_field()
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    noun = "regular polygon of"

    def __check_init__(self) -> None:
        inner = self.circumradius * math.cos(math.pi / max(self.number, 3))
        _check_below("rounding", self.rounding, inner, "the radius of the circle in it")

    def core(self) -> tuple[Vec, ...]:
        """Vertices on a circle."""
        radius = self.circumradius - self.rounding / math.cos(math.pi / self.number)
        angles = [2 * math.pi * k / self.number for k in range(self.number)]
        return tuple(Vec(radius * math.cos(a), radius * math.sin(a)) for a in angles)

    def size_in_words(self) -> str:
        """How many vertices it has, and how far they are from the centre."""
        return f"{self.number} vertices and circumradius {float(self.circumradius):.4g}"
