"""Convex things: a polygon with rounded corners, and its cases by a few numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import jax.numpy as jnp

from pcjax.checks import check_positive
from pcjax.components import quantity
from pcjax.geometry import Scalar, Vec
from pcjax.model.bodies.base import (
    Body,
    Orientation,
    mass_field,
    orientation_field,
    register_body,
    turns_field,
)
from pcjax.model.bodies.outline import (
    MOST_VERTICES,
    SKIN,
    Corners,
    check_convex,
    counterclockwise,
    farthest,
    least_width,
    moments,
)


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


class _Rounded:
    """Fields or properties of each convex body."""

    rounding: Scalar
    mass: Scalar


class Convex(Body, _Rounded):
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
        return farthest(self.vertices) + self.rounding

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
        converter=counterclockwise,
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
