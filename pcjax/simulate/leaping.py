"""Trials from event to event: exact motion in between, as far at a time as can be proved safe.

Between events a circle in a hand that stays put flies freely, slides along a limb, rolls over a
limb's end or rests, under a constant acceleration. Each leap settles the contacts at its start and
then goes as far as provably nothing happens:

- A limb is convex, so the plane through its closest point, square to the line to the circle's
  centre, has all of it on one side: until the circle reaches that plane it cannot touch the limb.
  The time to the plane is the root of a quadratic. For a limb's flat side that is the exact time
  of impact; for its round end the planes of successive leaps converge to it, as in Newton's method.
- While the circle slides along a limb, what lies behind the surface it slides on is out of reach.
- A leap also ends at the goal line, at the end of the limb slid on, and when gravity changes.

Only the roll over a limb's end goes by small arcs, whose speed follows from the energy.
"""

from __future__ import annotations

from typing import Any

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
    first_root,
    runtime_barrier,
    safe_sqrt,
    unit_and_length,
    where,
)
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


class Support(eqx.Module):
    """The motion at a leap's start, once the contacts have been settled.

    Attributes:
        position, velocity, acceleration: with what the limbs do to them.
        normal: of the limb that carries the circle or just touches it.
        touches: whether there is one.
        rolls: whether that is at the limb's end.
        carried: whether it presses on a limb.
        until_end: seconds until it has slid off the limb's end.
    """

    position: Vec
    velocity: Vec
    acceleration: Vec
    normal: Vec
    touches: Flag
    rolls: Flag
    carried: Flag
    until_end: Scalar


def leap(world: World, profile: Any, interval: Scalar, flight: Flight) -> Flight:
    """The state after the longest leap in which provably nothing happens.

    Arguments:
        world: the condition.
        profile: the drive's motion in the current period, from `Drive.profile`.
        interval: seconds for which gravity is taken as constant, from `Drive.steady_interval`.
        flight: the state before. It stays as it is if its trial or its period is over.
    """
    radius, drive = world.contact_radius, world.drive
    barrier = runtime_barrier(flight.leaps, radius)
    leg = drive.leg(profile, flight.time, interval)
    pull, change = leg.pull, leg.until
    contacts = two_nearest(world.limbs, flight.position, barrier)
    support = settle(world, contacts, flight, pull, barrier)
    left = change - flight.time
    wait = fence(_wait(world, support, jnp.minimum(left, support.until_end)), barrier)
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
    moves = (flight.status == RUNNING) & (flight.time < drive.period)
    return Flight(
        where(moves, position, flight.position),
        where(moves, velocity, flight.velocity),
        jnp.where(moves, jnp.where(wait < left, flight.time + wait, change), flight.time),
        flight.leaps + moves.astype(flight.leaps.dtype),
        jnp.where(moves, verdict, flight.status),
    )


def settle(
    world: World, contacts: tuple[Contact, Contact], flight: Flight, pull: Vec, barrier: Scalar
) -> Support:
    """Impacts (7) with the two nearest limbs, where they touch, and the forces they exert then."""
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
        needs.append(fence(jnp.where(stay, -pull.dot(normal) - bend, _NO_NEED), barrier))
    forces = least_push(angle, *needs)
    forces = fence(forces[0], barrier), fence(forces[1], barrier)
    acceleration = _pushed(pull, normals, forces)

    pinned = (forces[0] > 0) & (forces[1] > 0)
    second = (forces[1] > 0) | (stays[1] & jnp.logical_not(stays[0]))
    carrier = where(second, contacts[1], contacts[0])
    normal = where(second, normals[1], normals[0])
    touches = stays[0] | stays[1]
    carried = (forces[0] > 0) | (forces[1] > 0)
    rolls = touches & carrier.round & jnp.logical_not(pinned)
    # What it leaves its limb with is forgotten, unless that would send it into the other one, as it
    # does where it goes over from one limb to the next, almost in line with it.
    kept = velocity - normal * velocity.dot(normal)
    other = where(second, normals[0], normals[1])
    into = stays[0] & stays[1] & (kept.dot(other) < -_noise(velocity))
    velocity = where(carried & jnp.logical_not(into), kept, velocity)
    still = Vec(0.0 * pull.x, 0.0 * pull.y)
    velocity = where(pinned, still, velocity)
    acceleration = where(pinned, still, acceleration)

    limb = carrier.limb
    along = (position - limb.start).dot(limb.tangent)
    speed, change = velocity.dot(limb.tangent), acceleration.dot(limb.tangent)
    until_end = jnp.minimum(
        first_root(jnp.maximum(along, 0.0) + near, speed, change),
        first_root(jnp.maximum(limb.length - along, 0.0) + near, -speed, -change),
    )
    slides = carried & ~rolls & ~pinned
    return Support(
        position,
        velocity,
        acceleration,
        normal,
        touches,
        rolls,
        carried,
        jnp.where(slides, until_end, NEVER),
    )


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


def _wait(world: World, support: Support, longest: Scalar) -> Scalar:
    """Seconds, at most `longest`, in which nothing can happen."""
    wait = longest
    for limb in world.limbs:
        wait = jnp.minimum(wait, _until_limb(world, limb, support))
    position, velocity, acceleration = support.position, support.velocity, support.acceleration
    line = world.goal.beyond(position)
    towards = jnp.where(line < 0, -1.0, 1.0)
    speed, change = (
        towards * (world.goal.beyond(position + vector) - line)
        for vector in (velocity, acceleration)
    )
    # A little beyond the line, so that rounding cannot leave the circle on this side of it.
    wait = jnp.minimum(wait, first_root(jnp.abs(line) + world.nearness(), speed, change))
    fast, hard = unit_and_length(velocity)[1], unit_and_length(acceleration)[1]
    arc = first_root(LONGEST_ARC * world.contact_radius, -fast, -hard)
    return jnp.where(support.rolls, jnp.minimum(wait, arc), wait)


def _until_limb(world: World, limb: Segment, support: Support) -> Scalar:
    """A time until which the circle cannot touch the limb, and the time it does on a flat side."""
    near, slow = world.nearness(), _noise(support.velocity)
    normal, distance = unit_and_length(limb.offset(support.position))
    gap = jnp.maximum(distance - world.contact_radius, 0.0)
    speed, change = support.velocity.dot(normal), support.acceleration.dot(normal)
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
    change = jnp.where(rolled_over, -before * support.acceleration.dot(limb.tangent), change)
    on_side = rolled_over & (to_side <= 0)
    return jnp.where(behind | on_side, NEVER, first_root(gap, speed, change))


def _move(support: Support, radius: Scalar, pull: Vec, time: Scalar) -> tuple[Vec, Vec]:
    """Position and velocity `time` seconds later."""
    start, velocity, acceleration = support.position, support.velocity, support.acceleration
    straight = start + (velocity + acceleration * (0.5 * time)) * time
    # Around a limb's end; the speed follows from the work of gravity.
    normal = support.normal
    tangent = Vec(-normal.y, normal.x)
    speed, change = velocity.dot(tangent), pull.dot(tangent)
    angle = (speed + 0.5 * change * time) * time / radius
    turned = normal * jnp.cos(angle) + tangent * jnp.sin(angle)
    around = start + (turned - normal) * radius
    square = speed * speed + 2.0 * pull.dot(around - start)
    fast = jnp.where(speed + change * time < 0, -1.0, 1.0) * safe_sqrt(square)
    arc = support.rolls & support.carried
    return (
        where(arc, around, straight),
        where(arc, Vec(-turned.y, turned.x) * fast, velocity + acceleration * time),
    )
