"""Trials from event to event: exact motion in between, as far at a time as can be proved safe.

Between events a circle in a hand that stays put flies freely, slides along a limb, rolls over a
limb's end or rests, under an acceleration that is constant or, while gravity turns, a cubic in
time. Each leap settles the contacts at its start and then goes as far as provably nothing happens:

- A limb is convex, so the plane through its closest point, square to the line to the circle's
  centre, has all of it on one side: until the circle reaches that plane it cannot touch the limb.
  The time to the plane is the root of a quadratic, with the least that the acceleration can be
  where it turns. For a limb's flat side that is the exact time of impact under constant
  acceleration; else the leaps converge to it, as in Newton's method.
- While the circle slides along a limb, what lies behind the surface it slides on is out of reach.
- A leap also ends at the goal line, at the end of the limb slid on, when gravity begins or ends to
  turn, and when, as it turns, a limb lets go of the circle or begins to press.

Only the roll over a limb's end goes by small arcs, whose speed follows from the energy.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp

from pcjax.geometry import (
    NEVER,
    Flag,
    Integers,
    Scalar,
    Scalars,
    Segment,
    Vec,
    decided,
    fence,
    fence_all,
    first_root,
    runtime_barrier,
    safe_sqrt,
    unit_and_length,
    where,
)
from pcjax.model.motion import Swing
from pcjax.model.scenario import World
from pcjax.physics.contact.circle import Contact, two_nearest
from pcjax.physics.response import Angle, impacts_in_turn, least_push
from pcjax.physics.state import INVALID, PASSED, RUNNING

LONGEST_ARC = 0.05
"""Longest arc that one leap rolls over a limb's end, radians."""

CAPTURE = 0.1
"""Share of the contact law's resting speed below which a limb keeps the circle it carries."""

_DEEPEST = 0.05
"""Overlap with a limb, in radii, that shows a missed contact."""

_SOON = 1e-3
"""Seconds by which gravity is looked at ahead, for a limb that it turns towards."""

_LONGEST_TURNING_ARC = 0.1
"""Longest time, s, that one leap rolls while gravity turns."""

_NO_NEED = -1e30
"""A bound that never binds, for a contact that is off."""


class Flight(eqx.Module):
    """Where a trial is.

    Attributes:
        position, velocity: of the circle's centre, in the hand frame.
        time: seconds of the current period gone by.
        leaps: leaps taken since the period began.
        status: RUNNING, PASSED, or INVALID where a number stopped being finite or a contact was
            missed.
    """

    position: Vec
    velocity: Vec
    time: Scalars
    leaps: Integers
    status: Integers


class Way(eqx.Module):
    """An acceleration as a cubic in time."""

    powers: tuple[Vec, Vec, Vec, Vec]

    def mean(self, time: Scalar) -> Vec:
        """The constant acceleration that leads from rest to the same place in that time."""
        a, b, c, d = self.powers
        return a + (b * (1 / 3) + (c * (1 / 6) + d * (0.1 * time)) * time) * time

    def gained(self, time: Scalar) -> Vec:
        """The change of velocity by then."""
        a, b, c, d = self.powers
        return (a + (b * 0.5 + (c * (1 / 3) + d * (0.25 * time)) * time) * time) * time


class Least(eqx.Module):
    """Of a way the least that `mean` can be along any direction, up to some time.

    Attributes:
        first, last: what it is at the beginning and at that time.
        slack: what it may be less in between.
    """

    first: Vec
    last: Vec
    slack: Scalar

    @classmethod
    def of(cls, way: Way, longest: Scalar, barrier: Scalar) -> Least:
        """Up to `longest` seconds."""
        a, _, c, d = way.powers
        late = c + d * (1.8 * longest)
        bend = jnp.maximum(jnp.abs(c.x) + jnp.abs(c.y), jnp.abs(late.x) + jnp.abs(late.y))
        last = fence_all(way.mean(longest), barrier)
        return cls(a, last, fence(bend * (longest * longest * (1 / 24)), barrier))

    def along(self, direction: Vec) -> Scalar:
        """The least along a unit vector."""
        return jnp.minimum(self.first.dot(direction), self.last.dot(direction)) - self.slack


class Support(eqx.Module):
    """The motion at a leap's start, once the contacts have been settled.

    Attributes:
        position, velocity: with what the limbs do to them.
        way: the acceleration, with what the limbs do to it.
        least: of that for as long as `longest`.
        normal: of the limb that carries the circle or just touches it.
        touches: whether there is one.
        rolls: whether that is at the limb's end.
        carried: whether it presses on a limb.
        longest: seconds for which the limbs that carry the circle do so, and no other that it
            touches begins to.
        until_end: seconds until it has slid off the limb's end.
    """

    position: Vec
    velocity: Vec
    way: Way
    least: Least
    normal: Vec
    touches: Flag
    rolls: Flag
    carried: Flag
    longest: Scalar
    until_end: Scalar


def leap(world: World, swing: Swing, longest: Scalar, flight: Flight) -> Flight:
    """The state after the longest leap in which provably nothing happens.

    Arguments:
        world: the condition.
        swing: what pulls, in the current stretch of a period, from `Drive.swing`.
        longest: seconds that a leap may take while gravity turns.
        flight: the state before. It stays as it is if its trial or its stretch is over.
    """
    radius = world.contact_radius
    barrier = runtime_barrier(flight.leaps, radius)
    turning = swing.turning(flight.time)
    pull = Way(fence_all(swing.around(flight.time), barrier))
    change = jnp.where(turning, swing.turns_until, swing.until)
    left = fence(change - flight.time, barrier)
    contacts = two_nearest(world.limbs, flight.position, barrier)
    most = jnp.where(turning, jnp.minimum(left, longest), left)
    support = settle(world, contacts, flight, pull, turning, most, barrier)
    wait = fence(_wait(world, support), barrier)
    goal = world.goal
    inside = goal.beyond(flight.position) < world.nearness()
    # Being put back to touching may have taken it across.
    over = inside & (goal.beyond(support.position) >= 0) & goal.between(support.position)
    wait = jnp.where(over, 0.0, wait)
    position, velocity = _move(support, radius, pull, wait)
    passed = inside & (goal.beyond(position) >= 0) & goal.between(position)
    # Written so that NaN fails it too.
    overlap = radius - unit_and_length(contacts[0].offset)[1]
    sound = (overlap < _DEEPEST * radius) & (position.dot(position) < jnp.inf)
    verdict = jnp.where(sound, jnp.where(passed, PASSED, RUNNING), INVALID)
    moves = (flight.status == RUNNING) & (flight.time < swing.until)
    return Flight(
        where(moves, position, flight.position),
        where(moves, velocity, flight.velocity),
        jnp.where(moves, jnp.where(wait < left, flight.time + wait, change), flight.time),
        flight.leaps + moves.astype(flight.leaps.dtype),
        jnp.where(moves, verdict, flight.status),
    )


def settle(
    world: World,
    contacts: tuple[Contact, Contact],
    flight: Flight,
    way: Way,
    turning: Flag,
    most: Scalar,
    barrier: Scalar,
) -> Support:
    """Impacts (7) with the two nearest limbs, where they touch, and the forces they exert then.

    Arguments:
        way: gravity's acceleration from now on.
        turning: whether it changes.
        most: seconds that the leap may take.
    """
    pull = way.powers[0]
    # A limb about to be pressed is.
    soon = pull + way.powers[1] * _SOON
    law, radius, near = world.law, world.contact_radius, world.nearness()
    normals, depths = [], []
    for contact in contacts:
        normal, distance = unit_and_length(contact.offset)
        normals.append(normal)
        depths.append(fence(radius - distance, barrier))
    angle = Angle.between(*normals)
    position = _pushed(flight.position, normals, least_push(angle, *depths))

    leaving = [
        fence(jnp.where(depth >= -near, flight.velocity.dot(normal), -_NO_NEED), barrier)
        for normal, depth in zip(normals, depths, strict=True)
    ]
    rest = law.resting_speed
    kicks = impacts_in_turn(law, angle, (leaving[0], leaving[1]), (rest, rest))
    velocity = _pushed(flight.velocity, normals, kicks)

    slow = _noise(velocity) + CAPTURE * law.resting_speed
    stays = [
        (depth >= -near) & (velocity.dot(normal) < slow)
        for normal, depth in zip(normals, depths, strict=True)
    ]
    # A limb's end on the surface of the flat side that the circle is on, such as a joint about to
    # be reached, is no contact of its own.
    ends = [_standing_out(contacts[k], contacts[1 - k], normals[1 - k]) <= near for k in (0, 1)]
    # Decided once: where the compiler works out a flag anew for each of its uses, rounding may
    # turn it out differently, and a limb that exerts no force be taken for one that is slid on.
    stays = [decided(stays[k] & ~(ends[k] & stays[1 - k]), barrier) for k in (0, 1)]
    needs = []
    for contact, normal, stay in zip(contacts, normals, stays, strict=True):
        along = velocity.cross(normal)
        bend = jnp.where(contact.round, along * along / radius, 0.0)
        needs.append(fence(jnp.where(stay, -soon.dot(normal) - bend, _NO_NEED), barrier))
    forces = least_push(angle, *needs)
    forces = fence(forces[0], barrier), fence(forces[1], barrier)

    presses = [force > 0 for force in forces]
    pinned = presses[0] & presses[1]
    second = presses[1] | (stays[1] & jnp.logical_not(stays[0]))
    carrier = where(second, contacts[1], contacts[0])
    normal = where(second, normals[1], normals[0])
    touches = stays[0] | stays[1]
    carried = presses[0] | presses[1]
    rolls = touches & carrier.round & jnp.logical_not(pinned)
    # What it leaves its limb with is forgotten, unless that would send it into the other one, as it
    # does where it goes over from one limb to the next, almost in line with it.
    kept = velocity - normal * velocity.dot(normal)
    other = where(second, normals[0], normals[1])
    into = stays[0] & stays[1] & (kept.dot(other) < -_noise(velocity))
    velocity = where(carried & jnp.logical_not(into), kept, velocity)
    still = Vec(0.0 * pull.x, 0.0 * pull.y)
    velocity = fence_all(where(pinned, still, velocity), barrier)

    slides = decided(carried & ~rolls & ~pinned, barrier)
    most = jnp.where(rolls & turning, jnp.minimum(most, _LONGEST_TURNING_ARC), most)
    lasts = _lasting(way, angle, normals, presses, stays, pinned, jnp.where(turning, most, 0.0))
    lasts = lasts + jnp.where(carried, 0.2 * _SOON, _SOON)
    longest = jnp.where(turning & touches & ~rolls, jnp.minimum(most, lasts), most)
    longest = fence(longest, barrier)

    def along_limb(vector: Vec) -> Vec:
        vector = vector - normal * jnp.where(slides, vector.dot(normal), 0.0)
        return where(pinned, still, vector)

    # Arcs are short, so that of their acceleration the first counts.
    arcs = rolls & carried
    rest = [where(arcs, still, along_limb(power)) for power in way.powers[1:]]
    first = where(arcs, _pushed(pull, normals, forces), along_limb(pull))
    way = Way(fence_all((first, rest[0], rest[1], rest[2]), barrier))
    least = Least.of(way, jnp.where(turning, longest, 0.0), barrier)

    limb = carrier.limb
    along = (position - limb.start).dot(limb.tangent)
    speed = velocity.dot(limb.tangent)
    until_end = jnp.minimum(
        first_root(jnp.maximum(along, 0.0) + near, speed, least.along(limb.tangent)),
        first_root(
            jnp.maximum(limb.length - along, 0.0) + near, -speed, least.along(limb.tangent * -1.0)
        ),
    )
    return Support(
        position,
        velocity,
        way,
        least,
        normal,
        touches,
        rolls,
        carried,
        longest,
        jnp.where(slides, until_end, NEVER),
    )


def _lasting(
    way: Way,
    angle: Angle,
    normals: list[Vec],
    presses: list[Flag],
    stays: list[Flag],
    pinned: Flag,
    longest: Scalar,
) -> Scalar:
    """Seconds, NEVER if longer than `longest`, in which the limbs that carry a circle that does not
    roll do so, and one that only touches it does not begin to press."""
    cosine = jnp.where(pinned, angle.cosine, 0.0)
    # As for the pushes, with digits where the normals are close.
    square = jnp.where(cosine > 0.9, angle.sine * angle.sine, 1.0 - cosine * cosine)
    square = jnp.maximum(square, 1e-7)
    inverse = jnp.where(pinned, 1.0 / square, 1.0)
    lasts = NEVER + 0.0 * longest
    for k in (0, 1):
        towards = (normals[1 - k] * cosine - normals[k]) * inverse
        force = way.powers[0].dot(towards)
        # One that opens until gravity turns it back.
        towards = where(presses[k], towards, normals[k])
        force = jnp.where(presses[k], force, way.powers[0].dot(normals[k]))
        force = jnp.maximum(force, 0.0)
        b, c, d = (power.dot(towards) for power in way.powers[1:])
        until = first_root(force, b, 2.0 * c + jnp.minimum(0.0, 6.0 * d * longest))
        # By Bernstein's coefficients it stays positive.
        early = force + b * longest * (1 / 3)
        late = early + (b * longest + c * longest * longest) * (1 / 3)
        end = force + (b + (c + d * longest) * longest) * longest
        stays_so = jnp.minimum(early, jnp.minimum(late, end)) > 0
        counts = presses[k] | (stays[k] & ~presses[1 - k])
        lasts = jnp.minimum(lasts, jnp.where(counts & ~stays_so, until, NEVER))
    return lasts


def _standing_out(end: Contact, side: Contact, normal: Vec) -> Scalar:
    """How far a limb's end stands out of a flat side with that normal; NEVER if they are not."""
    height = (side.offset - end.offset).dot(normal)
    return jnp.where(end.round & ~side.round, height, NEVER)


def _pushed(vector: Vec, normals: list[Vec], pushes: tuple[Scalar, Scalar]) -> Vec:
    return vector + normals[0] * pushes[0] + normals[1] * pushes[1]


def _noise(velocity: Vec) -> Scalar:
    """The speed below which rounding decides whether a contact closes or opens."""
    eps = float(jnp.finfo(jnp.result_type(velocity.x)).eps)
    return 32 * eps * (jnp.abs(velocity.x) + jnp.abs(velocity.y) + 1.0)


def _wait(world: World, support: Support) -> Scalar:
    """Seconds in which nothing can happen."""
    wait = jnp.minimum(support.longest, support.until_end)
    for limb in world.limbs:
        wait = jnp.minimum(wait, _until_limb(world, limb, support))
    position, velocity = support.position, support.velocity
    line = world.goal.beyond(position)
    away = world.goal.outwards() * jnp.where(line < 0, -1.0, 1.0)
    speed, change = away.dot(velocity), support.least.along(away)
    # A little beyond the line, so that rounding cannot leave the circle on this side of it.
    wait = jnp.minimum(wait, first_root(jnp.abs(line) + world.nearness(), speed, change))
    fast, hard = unit_and_length(velocity)[1], unit_and_length(support.way.powers[0])[1]
    arc = first_root(LONGEST_ARC * world.contact_radius, -fast, -hard)
    return jnp.where(support.rolls, jnp.minimum(wait, arc), wait)


def _until_limb(world: World, limb: Segment, support: Support) -> Scalar:
    """A time until which the circle cannot touch the limb, and the time it does on a flat side."""
    near, slow = world.nearness(), _noise(support.velocity)
    normal, distance = unit_and_length(limb.offset(support.position))
    gap = jnp.maximum(distance - world.contact_radius, 0.0)
    speed, change = support.velocity.dot(normal), support.least.along(normal)
    touches = (gap <= near) & (speed > -slow)
    # One that opens falls back to where it was. For one that does neither, and for one that closes
    # and is none of the two settled, a floor keeps the leap from ending where it starts.
    floor = jnp.where(touches, near / 64, near / 4)
    gap = jnp.where(touches & (speed > slow), 0.0, jnp.maximum(gap, floor))
    speed = jnp.where(touches, jnp.maximum(speed, 0.0), speed)
    change = jnp.where(touches & (change > -slow), jnp.maximum(change, 0.0), change)
    surface = support.position - support.normal * world.contact_radius
    height = support.normal.dot(limb.start - surface)
    height = jnp.maximum(height, height + support.normal.dot(limb.tangent) * limb.length)
    behind = support.touches & ~support.rolls & (height <= near)
    # The end rolled over is in the way again where the limb's flat side begins.
    rolled_over = support.rolls & touches & (normal.dot(support.normal) > 0.99)
    to_start = -(support.position - limb.start).dot(limb.tangent)
    to_end = -to_start - limb.length
    before = jnp.where(to_start > 0, 1.0, -1.0)
    to_side = jnp.maximum(to_start, to_end)
    gap = jnp.where(rolled_over, jnp.maximum(to_side, 0.0) + near, gap)
    speed = jnp.where(rolled_over, -before * support.velocity.dot(limb.tangent), speed)
    change = jnp.where(rolled_over, -before * support.way.powers[0].dot(limb.tangent), change)
    on_side = rolled_over & (to_side <= 0)
    return jnp.where(behind | on_side, NEVER, first_root(gap, speed, change))


def _move(support: Support, radius: Scalar, way: Way, time: Scalar) -> tuple[Vec, Vec]:
    """Position and velocity `time` seconds later, with gravity's own way."""
    start, velocity = support.position, support.velocity
    straight = start + (velocity + support.way.mean(time) * (0.5 * time)) * time
    # Around a limb's end, under gravity as it is halfway; the speed follows from its work.
    a, b, c, d = way.powers
    half = 0.5 * time
    pull = a + (b + (c + d * half) * half) * half
    normal = support.normal
    tangent = Vec(-normal.y, normal.x)
    speed, change = velocity.dot(tangent), pull.dot(tangent)
    # An arc is short, and what is not one is not wanted.
    angle = jnp.clip((speed + change * half) * time / radius, -1.0, 1.0)
    square = angle * angle
    sine = angle * (1.0 - square * (1 / 6) * (1.0 - square * (1 / 20)))
    cosine = 1.0 - square * 0.5 * (1.0 - square * (1 / 12) * (1.0 - square * (1 / 30)))
    turned = normal * cosine + tangent * sine
    around = start + (turned - normal) * radius
    square = speed * speed + 2.0 * pull.dot(around - start)
    fast = jnp.where(speed + change * time < 0, -1.0, 1.0) * safe_sqrt(square)
    arc = support.rolls & support.carried
    return (
        where(arc, around, straight),
        where(arc, Vec(-turned.y, turned.x) * fast, velocity + support.way.gained(time)),
    )
