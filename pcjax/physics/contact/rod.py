"""The stick: where it meets the limbs, eqs (8)-(13), and what that does to it, eqs (14)-(17).

Two segments that do not cut each other can only begin to where an end of one meets the other. So
contact is between a point and a segment: an end of the stick and a limb, or a vertex of the hand (a
joint, an end of the palm, a fingertip's end) and the stick; parallel contact (12), (13) is two of
these at once. Which side of the segment the point has to stay on is known from the start of the
step, when nothing was cut. A point that has changed its side by the end of a step, however far, is
seen, and told from one that went past the segment's end by where it crossed the line.

The stick's configuration (x, y, kappa theta) with kappa^2 = I / M = r_o^2 / 3 has the unit matrix
for its mass, per unit of mass. A contact with normal n and lever c = (r x n) is one direction in
it, N = (n, c / kappa), and the impulse (17) a change of velocity along N / (N . N).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.geometry import (
    Flag,
    Scalar,
    Segment,
    Vec,
    bits,
    fence,
    fence_all,
    pick,
    unit_and_length,
    where,
)
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.motion import Motion
from pcjax.model.scenario import World
from pcjax.physics.response import INACTIVE, time_since_contact
from pcjax.physics.state import RUNNING, State, Watch, judge

_SWEEPS = 2
"""How often in a step the deepest contacts are taken anew and held off together."""

_TOGETHER = 3
"""How many contacts are held off together with the one of the impact."""

_ROUNDS = 12
"""Rounds of Gauss-Seidel among the contacts that are held off together."""


LONGEST_TRAVEL, LARGEST_TURN = 0.5, 0.3
"""What one step of a stick may cover: share of the half length by any of its points, radians."""


class Pose(eqx.Module):
    """The stick's centre and direction t_o."""

    centre: Vec
    along: Vec

    @classmethod
    def of(cls, centre: Vec, angle: Scalar) -> Pose:
        """The pose at an angle."""
        return cls(centre, Vec(jnp.cos(angle), jnp.sin(angle)))


class Rod(eqx.Module):
    """The stick at a step's end: its centre's motion, and angle and spin as seen from the hand."""

    centre: Motion
    angle: Scalar
    spin: Scalar

    def pose(self, barrier: Scalar) -> Pose:
        """Where it is."""
        return fence_all(Pose.of(self.centre.position, self.angle), barrier)

    def earlier(self, time: Scalar, barrier: Scalar) -> tuple[Pose, Vec]:
        """Pose and velocity `time` seconds before the end, as seen from the hand."""
        velocity, acceleration = self.centre.relative(), self.centre.acceleration
        back = (acceleration * (0.5 * time) - velocity) * time
        pose = Pose.of(self.centre.position + back, self.angle - self.spin * time)
        return fence_all((pose, velocity - acceleration * time), barrier)

    def kicked(self, kick: Vec, spin: Scalar, since: Scalar, carried: Scalar) -> Rod:
        """After a change of velocity and spin `since` seconds ago, `carried` on for as long."""
        end = self.centre
        kick = end.turned(kick, since)
        centre = Motion(
            end.position + kick * carried, end.velocity + kick, end.acceleration, end.twist
        )
        return Rod(centre, self.angle + spin * carried, self.spin + spin)

    def pushed(self, push: Vec, turn: Scalar) -> Rod:
        """Elsewhere, with the same velocity and spin."""
        end = self.centre
        centre = Motion(end.position + push, end.velocity, end.acceleration, end.twist)
        return Rod(centre, self.angle + turn, self.spin)


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


def move_stick(
    body: Stick, world: World, state: State, free: Motion, dt: Scalar, barrier: Scalar
) -> State:
    """A step's contact of a stick: its turning, and what it touches."""
    half, skin = body.half_length, body.skin
    # Nothing turns the stick between impacts; the hand turns steadily.
    carried = 0.0 if free.twist is None else free.twist.spin
    spin = state.spin - carried
    turn = spin * dt
    rod = Rod(free, state.angle + turn, spin)
    before = Rod(replace(free, position=state.position), state.angle, spin).pose(barrier)
    moved, penetration, undone = meet_limbs_with_stick(
        body, world, before, state.angle, rod, dt, barrier
    )
    travel = unit_and_length(free.position - state.position)[1] + half * jnp.abs(turn)
    travel = jax.lax.stop_gradient(travel)
    safe = (penetration < skin) & (travel < LONGEST_TRAVEL * half) & (jnp.abs(turn) < LARGEST_TURN)
    after = judge(world, state, moved.centre, safe)
    running = state.status == RUNNING
    watch = state.watch
    return replace(
        after,
        # Within half a turn, where it has all its digits.
        angle=jnp.where(
            running,
            moved.angle - 2 * math.pi * jnp.round(moved.angle / (2 * math.pi)),
            state.angle,
        ),
        spin=jnp.where(running, moved.spin + carried, state.spin),
        watch=Watch(
            jnp.where(running, jnp.maximum(watch.penetration, penetration), watch.penetration),
            jnp.where(running, jnp.maximum(watch.travel, travel), watch.travel),
            watch.undone + jnp.where(running & undone, 1.0, 0.0),
        ),
    )


def meet_limbs_with_stick(
    body: Stick, world: World, before: Pose, angle: Scalar, free: Rod, dt: Scalar, barrier: Scalar
) -> tuple[Rod, Scalar, Flag]:
    """The impact with the deepest contact, then rest and sliding on all that it touches.

    Arguments:
        body: the stick.
        world: with limbs and contact law.
        before, angle: the stick at the start of the step, where it cuts nothing.
        free: at the end of its free motion.

    Returns:
        The stick at the end of the step, how deep it then is in its skin anywhere, and whether the
        step had to be undone. The depth is less than the skin: the stick cuts no limb, and no point
        of either is on another side than before.
    """
    law = world.law
    (met,) = _deepest(1, body, world, before, free.pose(barrier), barrier)
    moved = impact(law, body, met, free, dt, barrier)

    def sweep(_: int, moved: Rod) -> Rod:
        # The impact's contact stays among them, even where another one has been run into so far
        # that the point is beside its segment meanwhile.
        touches = [met, *_deepest(_TOGETHER, body, world, before, moved.pose(barrier), barrier)]
        return hold_off(law, body, touches, moved, dt, barrier)

    moved = jax.lax.fori_loop(0, _SWEEPS, sweep, moved)
    deepest = functools.reduce(
        jnp.maximum,
        [
            jax.lax.stop_gradient(depth)
            for depth in depths(body, world, before, moved.pose(barrier))
        ],
    )
    # Several impacts at once in a narrow corner may be too much for the sweeps. Then the stick
    # stays where it was, where it cuts nothing, with the velocity that they have given it.
    undone = deepest >= body.skin
    end = moved.centre
    centre = Motion(
        where(undone, before.centre, end.position), end.velocity, end.acceleration, end.twist
    )
    angle = jnp.where(undone, angle, moved.angle)
    return Rod(centre, angle, moved.spin), jnp.where(undone, 0.0, deepest), undone


def impact(
    law: ContactLaw, body: Stick, touch: Touch, end: Rod, dt: Scalar, barrier: Scalar
) -> Rod:
    """Resolves the impact (14)-(17) at its time within the step that led to `end`.

    The time follows from the depth at the end of the step and one Newton step at the time so found,
    where stick and normal are as they were then.
    """
    now, velocity = end.earlier(0.0, barrier)
    normal, lever, distance, reach = fence_all(touch.at(now), barrier)
    depth = body.skin - distance
    pressing = -end.centre.acceleration.dot(normal) - touch.bend(
        now, normal, reach, velocity, end.spin
    )
    inwards = -velocity.dot(normal) - end.spin * lever
    since = fence(time_since_contact(inwards, pressing, depth, dt), barrier)

    then, velocity = end.earlier(since, barrier)
    normal, lever, distance, _ = fence_all(touch.at(then), barrier)
    approach = -velocity.dot(normal) - end.spin * lever
    fast = approach > law.resting_speed
    late = jnp.where(fast, (body.skin - distance) / jnp.where(fast, approach, 1.0), 0.0)
    since = fence(jnp.where(depth > 0, jnp.clip(since + late, 0.0, dt), 0.0), barrier)

    then, velocity = end.earlier(since, barrier)
    normal, lever, _, _ = fence_all(touch.at(then), barrier)
    approach = -velocity.dot(normal) - end.spin * lever  # (3): only if positive
    restitution = jnp.where(approach > law.resting_speed, law.restitution, 0.0)
    change = (1.0 + restitution) * jnp.maximum(approach, 0.0)  # (14)
    per_inertia = body.mass / body.inertia
    impulse = law.switch(depth) * change / (1.0 + lever * lever * per_inertia)  # (17) / M_o
    impulse = fence(jnp.where(touch.on, impulse, 0.0), barrier)
    # (15), (16)
    return end.kicked(normal * impulse, lever * per_inertia * impulse, since, since)


def hold_off(
    law: ContactLaw,
    body: Stick,
    touches: Sequence[Touch],
    end: Rod,
    dt: Scalar,
    barrier: Scalar,
) -> Rod:
    """Takes the stick out of its contacts and turns back what still moves it into them.

    As for the circle, with unit vectors along N in place of normals and more than two contacts.
    """
    now, velocity = end.earlier(0.0, barrier)
    per_inertia = body.mass / body.inertia
    ways, needs, stops, gates = [], [], [], []
    for touch in touches:
        normal, lever, distance, reach = fence_all(touch.at(now), barrier)
        depth = body.skin - distance
        size = jnp.sqrt(1.0 + lever * lever * per_inertia)
        approach = -velocity.dot(normal) - end.spin * lever
        pressing = -end.centre.acceleration.dot(normal) - touch.bend(
            now, normal, reach, velocity, end.spin
        )
        resting = law.resting_speed + jnp.maximum(pressing, 0.0) * dt
        stop = approach * (1.0 + jnp.where(approach > resting, law.restitution, 0.0))
        way, lever = normal * (1.0 / size), lever / size
        ways.append(fence_all((way, lever), barrier))
        needs.append(fence(jnp.where(touch.on, law.ramp(depth) / size, INACTIVE), barrier))
        stops.append(fence(stop / size, barrier))
        gates.append(jnp.where(touch.on, law.switch(depth), 0.0))
    overlaps = [
        [way.dot(other) + lever * turned * per_inertia for other, turned in ways]
        for way, lever in ways
    ]
    pushes = [fence(push, barrier) for push in _least_pushes(overlaps, needs, barrier)]
    # Also what the other contacts push the stick against turns it back.
    gates = [
        jnp.where((need <= 0) & (push > 0), 1.0, gate)
        for need, push, gate in zip(needs, pushes, gates, strict=True)
    ]
    turns = [jnp.where(gate > 0, stop, INACTIVE) for gate, stop in zip(gates, stops, strict=True)]
    turns = _least_pushes(overlaps, [fence(turn, barrier) for turn in turns], barrier)
    held = end
    for (way, lever), gate, push, turn in zip(ways, gates, pushes, turns, strict=True):
        turn = fence(gate * turn, barrier)
        held = held.pushed(way * push, lever * per_inertia * push)
        held = held.kicked(way * turn, lever * per_inertia * turn, 0.5 * dt, 0.0)
    return held


def _least_pushes(
    overlaps: Sequence[Sequence[Scalar]], needs: Sequence[Scalar], barrier: Scalar
) -> list[Scalar]:
    """`response.least_push` for more than two unit vectors, by projected Gauss-Seidel."""

    def once(_: int, pushes: list[Scalar]) -> list[Scalar]:
        for k, need in enumerate(needs):
            others = [overlaps[k][m] * pushes[m] for m in range(len(needs)) if m != k]
            pushes[k] = fence(jnp.maximum(need - sum(others), 0.0), barrier)
        return pushes

    return jax.lax.fori_loop(0, _ROUNDS, once, [0.0 * need for need in needs])


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


def _deepest(
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
