"""Where the stick meets the limbs, eqs (8)-(13).

Two segments that do not cut each other can only begin to where an end of one meets the other. So
contact is between a point and a segment: an end of the stick and a limb, or a vertex of the hand (a
joint, an end of the palm, a fingertip's end) and the stick; parallel contact (12), (13) is two of
these at once. Which side of the segment the point has to stay on is known from the start of the
step, when nothing was cut. A point that has changed its side by the end of a step, however far, is
seen, and told from one that went past the segment's end by where it crossed the line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.geometry import Flag, Scalar, Segment, Vec, bits, fence, fence_all, pick, where
from pcjax.model.bodies.stick import Stick
from pcjax.model.scenario import World
from pcjax.physics.response import INACTIVE


class Pose(eqx.Module):
    """The stick's centre and direction t_o."""

    centre: Vec
    along: Vec

    @classmethod
    def of(cls, centre: Vec, angle: Scalar) -> Pose:
        """The pose at an angle."""
        return cls(centre, Vec(jnp.cos(angle), jnp.sin(angle)))


class Touch(eqx.Module):
    """A contact in question: a point, a segment, and the side that the point has to stay on.

    Attributes:
        on: whether it is one at all.
        by_end: whether an end of the stick meets a limb, and not a vertex of the hand the stick.
        anchor: a point of the limb, or the vertex.
        normal: the limb's normal, towards the stick (meaningless for a vertex).
        reach: from the stick's centre to its end, along t_o (meaningless for a vertex).
        side: which side of the stick the vertex is on, 1 for the left of t_o, else -1.
    """

    on: Flag
    by_end: Flag
    anchor: Vec
    normal: Vec
    reach: Scalar
    side: Scalar

    def at(self, pose: Pose) -> tuple[Vec, Scalar, Scalar, Scalar]:
        """Normal n_c, lever (r x n_c), distance, and r_oa (8), (9), for the stick in a pose."""
        relative = pose.centre - self.anchor
        of_stick = Vec(pose.along.y, -pose.along.x) * self.side
        normal = where(self.by_end, self.normal, of_stick)
        reach = jnp.where(self.by_end, self.reach, -pose.along.dot(relative))
        distance = normal.dot(relative + pose.along * reach)
        return normal, reach * pose.along.cross(normal), distance, reach

    def bend(self, pose: Pose, normal: Vec, reach: Scalar, velocity: Vec, spin: Scalar) -> Scalar:
        """What the stick's turning adds to the second derivative of the distance."""
        end = -reach * spin * spin * pose.along.dot(normal)
        vertex = 2.0 * self.side * spin * pose.along.dot(velocity)
        return jnp.where(self.by_end, end, vertex)


def depths(body: Stick, world: World, before: Pose, after: Pose) -> list[Scalar]:
    """How far the stick is inside its skin at each contact there can be; INACTIVE where it is not.

    First both ends of the stick for each limb, then the hand's vertices (see `_vertices`). Their
    sides are those at `before`. What counts is where the point crossed: inside the segment or past
    its end, on the straight way between the two poses. That errs by a trifle where a point passes
    just by an end; if then stick and limb cut each other, every point of the two that has changed
    its side counts.
    """
    half, skin = body.half_length, body.skin

    def judged(
        s0: Scalar, a0: Scalar, s1: Scalar, a1: Scalar, low: Scalar, high: Scalar
    ) -> tuple[Scalar, Flag, Flag]:
        was = jnp.abs(s0)
        now = jnp.where(s0 >= 0, s1, -s1)
        closing = was - now
        share = jnp.clip((was - skin) / jnp.where(closing > 0, closing, 1.0), 0.0, 1.0)
        crossed = a0 + (a1 - a0) * share
        return skin - now, (crossed > low) & (crossed < high), now < 0

    by_end = []
    for limb in world.limbs:
        ends = zip(_ends_from(limb, before, half), _ends_from(limb, after, half), strict=True)
        by_end.append([judged(*b, *a, 0.0, limb.length) for b, a in ends])
    by_vertex = [
        judged(*_from_stick(v, before), *_from_stick(v, after), -half, half)
        for v in _vertices(world.limbs)
    ]
    missed = []
    for k, limb in enumerate(world.limbs):
        points = [*by_end[k], *(by_vertex[v] for v in _vertices_of(k, world.finger_1))]
        (one_end, _), (other_end, _) = _ends_from(limb, after, half)
        sides = [_from_stick(v, after)[0] for v in (limb.start, limb.end)]
        cut = (one_end * other_end < 0) & (sides[0] * sides[1] < 0)
        seen = False
        for _, inside, changed in points:
            seen = seen | (inside & changed)
        missed.append(cut & ~seen)
    found = []
    for k in range(len(world.limbs)):
        found += [
            jnp.where(inside | (missed[k] & changed), depth, INACTIVE)
            for depth, inside, changed in by_end[k]
        ]
    for v, (depth, inside, changed) in enumerate(by_vertex):
        of = [m for k, m in enumerate(missed) if v in _vertices_of(k, world.finger_1)]
        lost = of[0] if len(of) == 1 else of[0] | of[1]
        found.append(jnp.where(inside | (lost & changed), depth, INACTIVE))
    return found


def _ends_from(limb: Segment, pose: Pose, half: Scalar) -> list[tuple[Scalar, Scalar]]:
    """For each end of the stick, how far to the left of a limb's line it is, and how far along."""
    relative = pose.centre - limb.start
    across, along = limb.tangent.cross(relative), limb.tangent.dot(relative)
    up, forth = limb.tangent.cross(pose.along) * half, limb.tangent.dot(pose.along) * half
    return [(across + up, along + forth), (across - up, along - forth)]


def _from_stick(vertex: Vec, pose: Pose) -> tuple[Scalar, Scalar]:
    """How far a vertex is to the left of the stick's line, and how far along from its centre."""
    relative = vertex - pose.centre
    return pose.along.cross(relative), pose.along.dot(relative)


def _vertices(limbs: Sequence[Segment]) -> list[Vec]:
    """The palm's left end, and the end of each limb: every joint and end of the hand once."""
    return [limbs[0].start, *(limb.end for limb in limbs)]


def _vertices_of(limb: int, finger_1: int) -> tuple[int, int]:
    """The numbers of a limb's start and end in `_vertices`."""
    if limb == 0:
        return 0, 1
    first = {1: 0, finger_1 + 1: 1}
    return first.get(limb, limb), limb + 1


def deepest_touches(
    count: int, body: Stick, world: World, before: Pose, after: Pose, barrier: Scalar
) -> list[Touch]:
    """The `count` deepest contacts of the stick at `after`, the deepest first.

    Where there are fewer, the last ones are off. As in `circle.two_nearest`, the depths' lowest
    bits hold the contact's number.
    """
    limbs, half = world.limbs, body.half_length
    found = depths(*jax.lax.stop_gradient((body, world, before, after)))
    mask = (1 << math.ceil(math.log2(len(found)))) - 1
    best: list[Scalar] = []
    for number, depth in enumerate(found):
        marked = (bits(depth) & ~mask) | number
        key = fence(jax.lax.bitcast_convert_type(marked, jnp.result_type(depth)), barrier)
        for place, other in enumerate(best):
            best[place], key = jnp.maximum(other, key), jnp.minimum(other, key)
        if len(best) < count:
            best.append(key)

    def touch(key: Scalar) -> Touch:
        key = fence(key, barrier)
        number = bits(key) & mask
        by_end = number < 2 * len(limbs)
        reach = jnp.where((number & 1) == 0, half, -half)
        place = jnp.where(by_end, number >> 1, number - len(limbs))
        anchor = pick([*(limb.start for limb in limbs), *_vertices(limbs)], place)
        tangent = pick([limb.tangent for limb in limbs], place)
        relative = before.centre - anchor
        across = jnp.where(
            by_end,
            tangent.cross(relative + before.along * reach),
            -before.along.cross(relative),
        )
        side = jnp.where(across >= 0, 1.0, -1.0)
        normal = Vec(-tangent.y, tangent.x) * side
        anchor, normal, reach, side = fence_all((anchor, normal, reach, side), barrier)
        return Touch(key > 0.5 * INACTIVE, by_end, anchor, normal, reach, side)

    return [touch(key) for key in best]
