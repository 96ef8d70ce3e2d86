"""Where a rounded convex polygon meets the limbs: its nearest contacts.

A convex polygon and a segment come closest at a vertex of the polygon and a point of the segment,
or at an end of the segment and a point of the polygon's edge. So contact is of two kinds: a vertex
at a limb (its flat side or its end), and a joint or an end of the hand at an edge. Parallel contact
is two of these at once. The polygon is inflated by its rounding, the limbs by half their thickness.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.geometry import (
    Integers,
    Scalar,
    Segment,
    Vec,
    bits,
    fence_all,
    pick,
    stacked,
    unit_and_length,
    where,
)

ON_SIDE, ON_END, ON_EDGE = 0, 1, 2
"""What touches: a vertex and a limb's flat side, a vertex and a limb's end, an edge and a point of
the hand."""

_FAR = 1e30


def left_of(vector: Vec) -> Vec:
    """The vector turned by a right angle."""
    return Vec(-vector.y, vector.x)


class Outline(eqx.Module):
    """A body's polygon, turned.

    Attributes:
        arms: from its centre to its vertices, counterclockwise.
        lengths: of the arms.
        along: the direction of the edge from each vertex to the next; 0 for a single vertex.
        edges: the edges' lengths.
    """

    arms: tuple[Vec, ...]
    lengths: tuple[Scalar, ...]
    along: tuple[Vec, ...]
    edges: tuple[Scalar, ...]

    @classmethod
    def of(cls, vertices: Sequence[Vec], cosine: Scalar, sine: Scalar, barrier: Scalar) -> Outline:
        """The polygon turned by the angle with this cosine and sine."""

        def turned(vector: Vec) -> Vec:
            x, y = vector.x, vector.y
            return fence_all(Vec(cosine * x - sine * y, sine * x + cosine * y), barrier)

        ahead = [*vertices[1:], vertices[0]]
        edges = [unit_and_length(b - a) for a, b in zip(vertices, ahead, strict=True)]
        return cls(
            tuple(turned(vertex) for vertex in vertices),
            tuple(unit_and_length(vertex)[1] for vertex in vertices),
            tuple(turned(direction) for direction, _ in edges),
            tuple(length for _, length in edges),
        )

    @property
    def reach(self) -> Scalar:
        """The longest arm."""
        longest = self.lengths[0]
        for length in self.lengths[1:]:
            longest = jnp.maximum(longest, length)
        return longest


def points_of(limbs: Sequence[Segment]) -> list[Vec]:
    """The palm's first end and each limb's end: every joint and end of the hand once."""
    return [limbs[0].start, *(limb.end for limb in limbs)]


def start_numbers(limbs: int, finger_1: int) -> tuple[int, ...]:
    """The number in `points_of` of each limb's start."""
    starts = list(range(limbs))
    starts[1] = 0
    if limbs > finger_1 + 1:
        starts[finger_1 + 1] = 1
    return tuple(starts)


def offset_from(limb: Segment, point: Vec) -> tuple[Scalar, Scalar, Scalar]:
    """How far a point is along a limb from its start, how much of that is past its ends, and how
    far it is to the left of its line."""
    relative = point - limb.start
    along = relative.dot(limb.tangent)
    # Not the difference to what is clipped: worked out anew with another rounding, as the compiler
    # may, that is not 0 in between, and a direction across a tiny distance is a wrong one.
    before, after = jnp.minimum(along, 0.0), jnp.maximum(along - limb.length, 0.0)
    return along, before + after, limb.tangent.cross(relative)


class Contact(eqx.Module):
    """One of the nearest contacts.

    Attributes:
        gap: between the surfaces; large where there is no contact.
        core: between polygon and limb without their rounding.
        normal: from the limb to the body.
        lever: from the centre to the contact.
        arm: from the centre to the vertex, or to the hand's point.
        kind: ON_SIDE, ON_END or ON_EDGE.
        along: how far along the limb or the edge the contact is.
        length: of the limb or the edge.
        way: its direction, such that the contact moves along it as the body does.
    """

    gap: Scalar
    core: Scalar
    normal: Vec
    lever: Vec
    arm: Vec
    kind: Integers
    along: Scalar
    length: Scalar
    way: Vec


def nearest_contacts(
    count: int,
    limbs: Sequence[Segment],
    outline: Outline,
    centre: Vec,
    rounding: Scalar,
    half_thickness: Scalar,
    barrier: Scalar,
) -> list[Contact]:
    """The `count` nearest contacts, the nearest first.

    All pairs of features are looked at, one limb after the other so that the program stays small.
    The squared distances' last bits hold the number of the pair.
    """
    arms, along = outline.arms, outline.along
    vertices, points = len(arms), points_of(limbs)
    pairs = vertices * (len(limbs) + len(points))
    mask = (1 << math.ceil(math.log2(pairs))) - 1
    by_limbs = vertices * len(limbs)

    def insert(best: list[Scalar], square: Scalar, number: Integers) -> list[Scalar]:
        square = jax.lax.stop_gradient(square) + 1e-30
        marked = (bits(square) & ~mask) | number.astype(bits(square).dtype)
        key = jax.lax.bitcast_convert_type(marked, jnp.result_type(square))
        best = list(best)
        for place, other in enumerate(best):
            best[place], key = jnp.minimum(other, key), jnp.maximum(other, key)
        return best

    def for_limb(best: list[Scalar], one: tuple[Segment, Integers]) -> tuple[list[Scalar], None]:
        limb, number = one
        for k, arm in enumerate(arms):
            reached, beyond, across = offset_from(limb, centre + arm)
            # A joint belongs to the limb that ends there.
            mine = (reached >= 0) | (number == 0)
            square = jnp.where(mine, beyond * beyond + across * across, _FAR)
            best = insert(best, square, number * vertices + k)
        return fence_all(best, barrier), None

    def for_point(best: list[Scalar], one: tuple[Vec, Integers]) -> tuple[list[Scalar], None]:
        point, number = one
        for k, (arm, edge, length) in enumerate(zip(arms, along, outline.edges, strict=True)):
            relative = point - centre - arm
            height, reached = relative.cross(edge), relative.dot(edge)
            over = (reached > 0) & (reached < length) & (height > 0)
            square = jnp.where(over, height * height, _FAR)
            best = insert(best, square, by_limbs + number * vertices + k)
        return fence_all(best, barrier), None

    best = [_FAR + 0.0 * centre.x for _ in range(count)]
    best, _ = jax.lax.scan(for_limb, best, (stacked(limbs), jnp.arange(len(limbs))))
    if vertices > 1:
        best, _ = jax.lax.scan(for_point, best, (stacked(points), jnp.arange(len(points))))

    def contact(key: Scalar) -> Contact:
        number = bits(key) & mask
        by_edge = number >= by_limbs
        place = jnp.where(by_edge, number - by_limbs, number) // vertices
        vertex = number % vertices
        limb, arm = fence_all((pick(limbs, place), pick(arms, vertex)), barrier)
        reached, beyond, across = fence_all(offset_from(limb, centre + arm), barrier)
        # From along and across, not as a difference of long vectors: it may be on the limb. They
        # are worked out once, or rounding would turn a direction across so tiny a distance.
        off = left_of(limb.tangent) * across + limb.tangent * beyond
        normal, distance = unit_and_length(off)
        kind = jnp.where(beyond == 0, ON_SIDE, ON_END)
        edge, point = pick(along, vertex), pick(points, place)
        to_point = point - centre
        relative = to_point - arm
        normal = where(by_edge, left_of(edge), normal)
        distance = jnp.where(by_edge, relative.cross(edge), distance)
        lever = where(by_edge, to_point + normal * half_thickness, arm - normal * rounding)
        found = Contact(
            jnp.where(key > 0.5 * _FAR, _FAR, distance - (rounding + half_thickness)),
            distance,
            normal,
            lever,
            where(by_edge, to_point, arm),
            jnp.where(by_edge, ON_EDGE, kind),
            jnp.where(by_edge, relative.dot(edge), reached),
            jnp.where(by_edge, pick(outline.edges, vertex), limb.length),
            where(by_edge, edge * -1.0, limb.tangent),
        )
        numbers, kinds = eqx.partition(found, lambda x: jnp.issubdtype(x.dtype, jnp.floating))
        return eqx.combine(fence_all(numbers, barrier), kinds)

    return [contact(key) for key in best]
