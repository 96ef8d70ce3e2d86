"""Plane vectors as pairs of scalars.

Every component stays a scalar of its own, so under `jax.vmap` it becomes one contiguous array
and the elementwise arithmetic of a whole step fuses into few loops.

What a hand looks like is worked out with NumPy where its numbers are plain, or arrays of NumPy's
that stand for many hands: nothing is compiled then (see `library_of`).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

Scalar = Float[Array, ""] | Float[np.ndarray, "..."] | np.floating | float
Flag = Bool[Array, ""] | Bool[np.ndarray, "..."] | np.bool_ | bool
Scalars = Float[Array, "..."] | Float[np.ndarray, "..."] | np.floating | float
Integers = Int[Array, "..."]
"""Fields of what there may be a batch of: one trial's are scalars."""
T = TypeVar("T")


def library_of(*trees: Any) -> Any:
    """What to calculate with: NumPy for plain numbers and its own arrays, else JAX's NumPy."""
    plain = (float, int, np.ndarray, np.generic)
    return np if all(isinstance(leaf, plain) for leaf in jax.tree.leaves(trees)) else jnp


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Vec:
    """A vector (x, y) in the plane. A plain dataclass: they are made by the thousand.

    Examples:
        >>> from pcjax.geometry import Vec
        >>> Vec(3.0, 4.0).dot(Vec(1.0, 0.0))
        3.0
    """

    x: Scalar
    y: Scalar

    def __add__(self, other: Vec) -> Vec:
        return Vec(self.x + other.x, self.y + other.y)

    def __sub__(self, other: Vec) -> Vec:
        return Vec(self.x - other.x, self.y - other.y)

    def __mul__(self, factor: Scalar) -> Vec:
        return Vec(self.x * factor, self.y * factor)

    def dot(self, other: Vec) -> Scalar:
        return self.x * other.x + self.y * other.y

    def cross(self, other: Vec) -> Scalar:
        """The z component of the cross product."""
        return self.x * other.y - self.y * other.x


def where(condition: Flag, a: T, b: T) -> T:
    """`a` where the condition holds, else `b`, for pytrees of one structure."""
    choose = library_of(condition, a, b).where
    return jax.tree.map(functools.partial(choose, condition), a, b)


def fence(value: Scalar, barrier: Scalar) -> Scalar:
    """`value`, computed once: a division by a 1 that the compiler cannot see through.

    XLA's fusion on the CPU copies cheap elementwise producers into each of their consumers, so a
    long chain with several outputs is recomputed dozens of times. It never copies a division.
    `barrier` has to be a run-time 1 (see `runtime_barrier`); dividing by it is exact.
    """
    return value / barrier


def fence_all(tree: T, barrier: Scalar) -> T:
    """`fence` for every number of a pytree."""
    return jax.tree.map(lambda value: fence(value, barrier), tree)


def decided(flag: Flag, barrier: Scalar) -> Flag:
    """The flag, computed once: where the compiler works it out anew for each use, rounding may turn
    it out differently."""
    return fence(jnp.where(flag, barrier, 0.0 * barrier), barrier) > 0.5


def runtime_barrier(count: Int[Array, ""], like: Scalar) -> Scalar:
    """1 with the dtype of `like`, from a count that is never negative."""
    return jnp.where(count < 0, 2.0, 1.0).astype(jnp.result_type(like))


def safe_sqrt(value: Scalar) -> Scalar:
    """The square root of max(value, 0), with derivative 0 (not infinite) at and below 0."""
    positive = value > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, value, 1.0)), 0.0)


def sine_and_cosine(angle: Scalar) -> tuple[Scalar, Scalar]:
    """Sine and cosine of an angle of at most some 100 degrees, as sums that the compiler turns into
    vectors; `jnp.sin` is a call for each lane on the CPU."""
    terms = 6 if jnp.result_type(angle).itemsize == 4 else 11
    square = angle * angle
    sine = cosine = 1.0 + 0.0 * angle
    for k in range(terms, 0, -1):
        sine = 1.0 - square * sine * (1.0 / (2 * k * (2 * k + 1)))
        cosine = 1.0 - square * cosine * (1.0 / (2 * k * (2 * k - 1)))
    return angle * sine, cosine


NEVER = 1e9
"""A time, s, that nothing lasts."""


def first_root(gap: Scalar, speed: Scalar, acceleration: Scalar) -> Scalar:
    """When gap + speed t + acceleration t^2 / 2 first falls to 0, for a gap of at least 0."""
    square = speed * speed - 2.0 * acceleration * gap
    root = safe_sqrt(square)
    closing = speed < 0
    numerator = jnp.where(closing, 2.0 * gap, root + speed)
    denominator = jnp.where(closing, root - speed, -acceleration)
    falls = (square >= 0) & (denominator > 0)
    return jnp.where(falls, numerator / jnp.where(falls, denominator, 1.0), NEVER)


def unit_and_length(vector: Vec) -> tuple[Vec, Scalar]:
    """Direction and length of a vector; the zero vector has direction 0, length 0, derivative 0."""
    xp, square = library_of(vector), vector.dot(vector)
    positive = square > 0
    inverse = xp.where(positive, 1.0 / xp.sqrt(xp.where(positive, square, 1.0)), 0.0)
    return vector * inverse, square * inverse


class Mirror(eqx.Module):
    """A mirror in the plane.

    Attributes:
        turn: cosine and sine of twice the angle of its line.
        origin: the image of the origin.

    Examples:
        >>> from pcjax.geometry import Mirror, Vec
        >>> mirror = Mirror.along(Vec(0.0, 5.0), Vec(1.0, 0.0))
        >>> mirror.point(Vec(2.0, 1.0))
        Vec(x=2.0, y=9.0)
    """

    turn: Vec
    origin: Vec

    @classmethod
    def along(cls, point: Vec, direction: Vec) -> Mirror:
        """The mirror through a point along a unit vector."""
        c, s = direction.x, direction.y
        turn = Vec(c * c - s * s, 2.0 * c * s)
        normal = Vec(-s, c)
        return cls(turn, normal * (2.0 * normal.dot(point)))

    def vector(self, vector: Vec) -> Vec:
        """The image of a velocity or an acceleration."""
        c, s = self.turn.x, self.turn.y
        return Vec(c * vector.x + s * vector.y, s * vector.x - c * vector.y)

    def point(self, point: Vec) -> Vec:
        """The image of a point."""
        return self.origin + self.vector(point)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Segment:
    """A straight segment: `start`, unit `tangent` and `length`."""

    start: Vec
    tangent: Vec
    length: Scalar

    @property
    def end(self) -> Vec:
        return self.start + self.tangent * self.length

    def offset(self, point: Vec) -> Vec:
        """The vector from the segment's closest point to `point`."""
        relative = point - self.start
        along = library_of(self, point).clip(relative.dot(self.tangent), 0.0, self.length)
        return relative - self.tangent * along

    def distance(self, point: Vec) -> Scalar:
        """Distance from `point` to the segment."""
        return unit_and_length(self.offset(point))[1]


def segment_between(start: Vec, end: Vec) -> Segment:
    """The segment from one point to another."""
    return Segment(start, *unit_and_length(end - start))


def cut_through(a: Segment, b: Segment) -> Flag:
    """Whether two segments cut through each other; touching does not count."""
    xp, small = library_of(a, b), _negligible(a, b)

    def on_both_sides(of: Segment, by: Segment) -> Flag:
        # Rounding puts segments on one line a little to either side of each other.
        sides = [by.tangent.cross(point - by.start) for point in (of.start, of.end)]
        return (xp.minimum(*sides) < -small) & (xp.maximum(*sides) > small)

    return on_both_sides(a, b) & on_both_sides(b, a)


def _negligible(a: Segment, b: Segment) -> Scalar:
    return 1e-9 * (a.length + b.length)


def segments_cross(a: Segment, b: Segment) -> Flag:
    """Whether two segments cut through each other or lie on each other; touching is neither."""
    xp, small = library_of(a, b), _negligible(a, b)
    ends = [a.tangent.dot(point - a.start) for point in (b.start, b.end)]
    shared = xp.minimum(xp.maximum(*ends), a.length) - xp.maximum(xp.minimum(*ends), 0.0)
    off_line = [abs(a.tangent.cross(point - a.start)) for point in (b.start, b.end)]
    on_each_other = (xp.maximum(*off_line) < small) & (shared > small)
    return cut_through(a, b) | on_each_other


def closest_points(a: Segment, b: Segment) -> tuple[Vec, Vec]:
    """The points of two segments, which do not cross, that lie closest to each other."""
    pairs = [(point - a.offset(point), point) for point in (b.start, b.end)]
    pairs += [(point, point - b.offset(point)) for point in (a.start, a.end)]
    return closest_pair(stacked(pairs))


def closest_pair(pairs: tuple[Vec, Vec]) -> tuple[Vec, Vec]:
    """Of pairs of points along the first axis those closest to each other, the first in a tie."""
    xp, apart = library_of(pairs), pairs[1] - pairs[0]
    least = xp.argmin(apart.dot(apart), axis=0)
    return jax.tree.map(lambda x: xp.take_along_axis(x, least[None], axis=0)[0], pairs)


def stacked(items: Sequence[T]) -> T:
    """Pytrees of one structure as one, along a new first axis. Arithmetic on it is that of all
    items at once: a program far smaller, and sooner compiled, than one that repeats it for each."""
    xp = library_of(*items)
    return jax.tree.map(lambda *leaves: xp.stack(xp.broadcast_arrays(*leaves)), *items)


def cube_root(value: Scalar) -> Scalar:
    """Of what is above 0; unlike `jnp.cbrt` it does not keep the compiler from using vectors."""
    return jnp.exp(jnp.log(value) / 3.0)


def is_inside(corners: Sequence[Vec], point: Vec) -> Flag:
    """Whether a point is inside a polygon without self-crossings (even-odd rule)."""
    xp, inside = library_of(corners, point), False
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        straddles = (a.y > point.y) != (b.y > point.y)
        # Which side of the edge, without a division.
        left = (b - a).cross(point - a) * xp.where(b.y > a.y, 1.0, -1.0) > 0
        inside = inside ^ (straddles & left)
    return inside


def bits(value: Scalar) -> Int[Array, ""]:
    integer = {4: jnp.int32, 8: jnp.int64}[jnp.result_type(value).itemsize]
    return jax.lax.bitcast_convert_type(value, integer)


def pick(items: Sequence[T], number: Int[Array, ""]) -> T:
    """items[number] for a traced number, as selects; the last one beyond the end."""

    def choose(*leaves: Scalar) -> Scalar:
        chosen = leaves[-1]
        for k, leaf in enumerate(leaves[:-1]):
            chosen = jnp.where(number == k, leaf, chosen)
        return chosen

    return jax.tree.map(choose, *items)
