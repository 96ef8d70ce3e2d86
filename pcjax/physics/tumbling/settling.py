"""What contacts do to a tumbling body at a leap's start: impacts, forces, back to touching."""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp

from pcjax.geometry import (
    NEVER,
    Flag,
    Scalar,
    Vec,
    decided,
    fence,
    fence_all,
    unit_and_length,
    where,
)
from pcjax.model.contact import ContactLaw
from pcjax.model.motion import Leg
from pcjax.physics.contact.manifold import ON_EDGE, ON_END, Contact, left_of
from pcjax.physics.pushes import NOT_NEEDED, least_pushes
from pcjax.physics.rigid import (
    Direction,
    Rate,
    Rows,
    at_rest_under,
    catches,
    forces_with_friction,
    impact,
)
from pcjax.physics.tumbling.flight import Margins, Path, Tumble, gyration_of

CONTACTS = 4
"""Contacts that are settled at once: two flush edges have as many."""

IMPACTS = 3
"""Impacts of a leap. Where more follow each other, the leap ends where it began."""

JAM = 0.1
"""How much more than a contact needs it may be given, as a share of the pull."""

BRIEF = 1e-3
"""Seconds in which what pulls gives a body the speed below which two contacts that can hold it at
rest do so."""

ALIKE = 1e-3
"""Share by which approaches, and normals, differ in a face that lands flat."""

LARGEST_BRAKE = 0.02
"""Largest share of a speed that drag takes in one leap."""

CAPTURE = 0.1
"""Share of the contact law's resting speed below which a limb keeps the body that it carries."""


class Settled(eqx.Module):
    """What the contacts have done at a leap's start.

    Attributes:
        path: the motion from then on.
        loaded: which of them carry the body.
        closing: whether there are impacts left to be met.
        steady: for how many seconds those that slip do so, and drag is what it is.
    """

    path: Path
    loaded: list[Flag]
    closing: Flag
    steady: Scalar


def settled_by(
    law: ContactLaw,
    found: Sequence[Contact],
    flight: Tumble,
    leg: Leg,
    left: Scalar,
    per_gyration: Scalar,
    margins: Margins,
    barrier: Scalar,
) -> Settled:
    """What the contacts do at a leap's start: impacts, forces, and back to touching."""
    rows = Rows.of(found, per_gyration, barrier)
    touches = [decided(one.gap <= margins.near, barrier) for one in found]
    lacks = [
        jnp.where(on, -one.gap / normal.size, NOT_NEEDED)
        for on, one, normal in zip(touches, found, rows.normals, strict=True)
    ]
    gyration = gyration_of(per_gyration)
    turning = flight.spin * gyration
    moving = Rate(flight.velocity.x, flight.velocity.y, turning)
    moving, closing = _meet(law, found, rows, touches, moving, per_gyration, barrier)
    free, longest = _free(law, flight.position, touches, moving, leg, left, gyration, margins)
    free = Rate(*fence_all(tuple(free), barrier))
    met = moving
    moving, acceleration, working, loaded, steady = _carried(
        law, found, rows, touches, moving, free, per_gyration, margins, barrier
    )
    # While there are impacts left, nothing but impacts changes what the body does.
    moving = Rate(*(jnp.where(closing, a, b) for a, b in zip(met, moving, strict=True)))
    steady = fence(jnp.minimum(steady, longest), barrier)
    # Those that carry the body touch it, so that drift does not add up until they let go of it.
    nowhere = 0.0 * flight.time
    shift = rows.settle(
        Rate(nowhere, nowhere, nowhere),
        least_pushes(rows.cosines, lacks, barrier, exactly=loaded),
        barrier,
    )
    path = Path(
        flight.position + Vec(shift.x, shift.y),
        Vec(moving.x, moving.y),
        Vec(acceleration.x, acceleration.y),
        flight.angle + shift.turn * per_gyration,
        moving.turn * per_gyration,
        acceleration.turn * per_gyration,
        working,
    )
    return Settled(fence_all(path, barrier), loaded, closing, steady)


def _meet(
    law: ContactLaw,
    found: Sequence[Contact],
    rows: Rows,
    touches: Sequence[Flag],
    moving: Rate,
    per_gyration: Scalar,
    barrier: Scalar,
) -> tuple[Rate, Flag]:
    """Impacts (14)-(17), with friction, one after the other, the fastest approach first. Contacts
    of a face that lands flat are one impact, in their middle: which is the faster is rounding. What
    is left below the resting speed is met by all contacts at once, without rebound."""
    friction = 0.0 if law.friction is None else law.friction

    def closing_speeds(moving: Rate) -> list[Scalar]:
        return [
            fence(jnp.where(on, -normal.speed(moving), 0.0), barrier)
            for on, normal in zip(touches, rows.normals, strict=True)
        ]

    def met(moving: Rate) -> Rate:
        approach = closing_speeds(moving)
        facing, fastest = found[0].normal, approach[0]
        for one, speed in zip(found[1:], approach[1:], strict=True):
            faster = speed > fastest
            facing, fastest = where(faster, (one.normal, speed), (facing, fastest))
        facing, fastest = fence_all((facing, fastest), barrier)
        lever, number = Vec(0.0 * fastest, 0.0 * fastest), 0.0
        for one, speed in zip(found, approach, strict=True):
            alike = (speed >= (1.0 - ALIKE) * fastest) & (facing.dot(one.normal) > 1.0 - ALIKE)
            share = jnp.where(alike, 1.0, 0.0)
            lever, number = lever + one.lever * share, number + share
        lever = fence_all(lever * (1.0 / jnp.maximum(number, 1.0)), barrier)
        normal = Direction.of(facing, lever, per_gyration, barrier)
        tangent = Direction.of(left_of(facing), lever, per_gyration, barrier)
        hits = fastest > law.resting_speed
        pushed, rubbed = impact(
            jnp.maximum(-normal.speed(moving), 0.0),
            tangent.speed(moving),
            normal.lever,
            tangent.lever,
            friction,
            law.restitution,
        )
        pushed = fence(jnp.where(hits, pushed * normal.size, 0.0), barrier)
        rubbed = fence(jnp.where(hits, rubbed * tangent.size, 0.0), barrier)
        moving = moving.plus(normal.row, pushed).plus(tangent.row, rubbed)
        return Rate(*fence_all(tuple(moving), barrier))

    for _ in range(IMPACTS):
        moving = met(moving)
    approach = closing_speeds(moving)
    closing = jnp.asarray(False)
    for speed in approach:
        closing = closing | (speed > law.resting_speed)
    closing = decided(closing, barrier)
    needs = [
        jnp.where(on & ~closing, speed / normal.size, NOT_NEEDED)
        for on, speed, normal in zip(touches, approach, rows.normals, strict=True)
    ]
    return rows.settle(moving, least_pushes(rows.cosines, needs, barrier), barrier), closing


def _free(
    law: ContactLaw,
    position: Vec,
    touches: Sequence[Flag],
    moving: Rate,
    leg: Leg,
    left: Scalar,
    gyration: Scalar,
    margins: Margins,
) -> tuple[Rate, Scalar]:
    """The acceleration without contacts that stands for the leap, and for how many seconds at most.

    In a hand that turns, and with drag, it depends on velocity; the one halfway through the leap
    stands for all of it.
    """
    velocity = Vec(moving.x, moving.y)
    longest = NEVER + 0.0 * left
    pull, turn = leg.felt(position, velocity), -leg.turning * gyration
    if leg.carry is not None:
        alone = jnp.asarray(True)
        for on in touches:
            alone = alone & ~on
        # What slides along a limb feels Coriolis' force square to it, so that the start's does.
        half = jnp.where(alone, 0.5 * left, 0.0)
        pull = leg.felt(position + (velocity + pull * (0.5 * half)) * half, velocity + pull * half)
    if law.drag is not None:
        speed = unit_and_length(velocity)[1] + jnp.abs(moving.turn)
        longest = jnp.where(speed > margins.slow, LARGEST_BRAKE / law.drag, longest)
        # As halfway through the leap, if it is not cut short.
        share = 1.0 / (1.0 + 0.5 * law.drag * jnp.where(longest < NEVER, longest, 0.0))
        pull, turn = (pull - velocity * law.drag) * share, (turn - moving.turn * law.drag) * share
    return Rate(pull.x, pull.y, turn), longest


def _bends(contact: Contact, moving: Rate, spin: Scalar) -> tuple[Scalar, Scalar]:
    """What turning adds to the accelerations along a contact's normal and tangent."""
    velocity, along = Vec(moving.x, moving.y), left_of(contact.normal)
    rolled = (velocity + left_of(contact.arm) * spin).dot(along)
    square = spin * spin
    core = jnp.maximum(contact.core, 0.25 * (contact.core - contact.gap))
    on_end = jnp.where(contact.kind == ON_END, rolled * rolled / core, 0.0)
    vertex = on_end - square * contact.arm.dot(contact.normal)
    edge = square * contact.arm.dot(contact.normal) + 2.0 * spin * along.dot(velocity)
    vertex_along = -square * contact.arm.dot(along)
    edge_along = -2.0 * spin * contact.normal.dot(velocity)
    edge_along = edge_along - square * contact.arm.cross(contact.normal)
    by_edge = contact.kind == ON_EDGE
    return jnp.where(by_edge, edge, vertex), jnp.where(by_edge, edge_along, vertex_along)


class Pressing(eqx.Module):
    """What a contact needs to be kept.

    Attributes:
        need, along: pushes along the normal, NOT_NEEDED where it is off, and against slipping.
        stays: whether it is on.
        slip: the speed along the tangent.
        slow: whether that is all but none.
        bend_along: what turning adds to the acceleration along the tangent.
    """

    need: Scalar
    stays: Flag
    slip: Scalar
    slow: Flag
    along: Scalar
    bend_along: Scalar


def _carried(
    law: ContactLaw,
    found: Sequence[Contact],
    rows: Rows,
    touches: Sequence[Flag],
    moving: Rate,
    free: Rate,
    per_gyration: Scalar,
    margins: Margins,
    barrier: Scalar,
) -> tuple[Rate, Rate, Rate, list[Flag], Scalar]:
    """The forces of the contacts that carry the body.

    Returns:
        Velocity and acceleration with them, what of this does work, which contacts these are, and
        for how many seconds those that slip do so.
    """
    spin = fence(moving.turn * per_gyration, barrier)

    def pressing(contact: Contact, on: Flag, normal: Direction, tangent: Direction) -> Pressing:
        bend, bend_along = fence_all(_bends(contact, moving, spin), barrier)
        leaving = normal.speed(moving)
        presses = -(normal.speed(free) + bend)
        # One that leaves a limb so slowly that it would be back before it is `near` away.
        caught = (leaving * leaving < 2.0 * margins.near * presses) & (presses > 0)
        caught = caught & (leaving < law.resting_speed)
        stays = decided(on & ((leaving < margins.slow) | caught), barrier)
        need = jnp.where(stays, presses / normal.size, NOT_NEEDED)
        slip = tangent.speed(moving)
        slow = jnp.abs(slip) < margins.slow
        along = -(tangent.speed(free) + bend_along) / tangent.size
        need, slip, along = fence_all((need, slip, along), barrier)
        return Pressing(need, stays, slip, slow, along, bend_along)

    each = [pressing(*one) for one in zip(found, touches, rows.normals, rows.tangents, strict=True)]
    needs, stays = [one.need for one in each], [one.stays for one in each]

    def kept(moving: Rate, loaded: Sequence[Flag]) -> Rate:
        """Without what drift and rounding have left of speed where a limb carries it, and without
        an approach that this makes elsewhere."""
        needs = [
            jnp.where(on, -normal.row.dot(moving), NOT_NEEDED)
            for on, normal in zip(touches, rows.normals, strict=True)
        ]
        pushes = least_pushes(rows.cosines, needs, barrier, exactly=loaded)
        return rows.settle(moving, pushes, barrier)

    if law.friction is None:
        pushes = least_pushes(rows.cosines, needs, barrier)
        loaded = [decided(push > 0, barrier) for push in pushes]
        return kept(moving, loaded), rows.settle(free, pushes, barrier), free, loaded, NEVER

    ratio = [
        fence(law.friction * tangent.size / normal.size, barrier)
        for normal, tangent in zip(rows.normals, rows.tangents, strict=True)
    ]
    slips = [one.slip for one in each]
    sticks = []
    for a, (normal, tangent) in enumerate(zip(rows.normals, rows.tangents, strict=True)):
        stops = each[a].slow | catches(normal, tangent, slips[a], ratio[a])
        sticks.append(decided(stays[a] & stops, barrier))
    along = [one.along for one in each]
    pushes, rubs = forces_with_friction(rows, needs, along, slips, sticks, ratio, barrier)
    loaded = [decided(push > 0, barrier) for push in pushes]

    def cleaned(moving: Rate) -> Rate:
        for normal, tangent, on, stick in zip(
            rows.normals, rows.tangents, loaded, sticks, strict=True
        ):
            # Along the tangent without what goes along the normal, whose speed stays 0.
            cosine = normal.row.dot(tangent.row)
            back = tangent.row.dot(moving) / (1.0 - cosine * cosine)
            back = jnp.where(on & stick, -back, 0.0)
            moving = moving.plus(tangent.row, back).plus(normal.row, -cosine * back)
            moving = Rate(*fence_all(tuple(moving), barrier))
        return kept(moving, loaded)

    # The first time without what sticks, so that normals come first.
    moving = cleaned(cleaned(kept(moving, loaded)))
    acceleration = rows.settle(free, pushes, barrier)
    along_tangents = [tangent.row for tangent in rows.tangents]
    acceleration = acceleration.plus_all(along_tangents, rubs)
    # One at rest that its grip does not hold begins to slip.
    slipping = [
        jnp.where(stick & (jnp.abs(rub) < 0.9999 * share * push), 0.0, rub)
        for stick, rub, share, push in zip(sticks, rubs, ratio, pushes, strict=True)
    ]
    working = free.plus_all(along_tangents, slipping)
    still = jnp.maximum(jnp.maximum(jnp.abs(moving.x), jnp.abs(moving.y)), jnp.abs(moving.turn))
    strength = unit_and_length(Vec(free.x, free.y))[1] + 1e-9
    # Where forces that grow with what they cause find no balance, the body is jammed and stops.
    jams = jnp.asarray(False)
    for on, need, normal in zip(loaded, needs, rows.normals, strict=True):
        given = normal.speed(acceleration) - normal.speed(free)
        jams = jams | (on & (given - need * normal.size > JAM * strength))
    # In a wedge slips that alternate would take it there in ever smaller steps.
    wedged = sum(jnp.where(on, 1, 0) for on in loaded) > 1
    slow = jnp.maximum(margins.slow, jnp.where(wedged, BRIEF * strength, 0.0))
    rests = (still < slow) | jams
    rests = rests & at_rest_under(rows, stays, ratio, free, strength)
    rests = decided(rests, barrier)
    moving = Rate(*(jnp.where(rests, 0.0, part) for part in moving))
    acceleration = Rate(*(jnp.where(rests, 0.0, part) for part in acceleration))
    moving, acceleration = (
        Rate(*fence_all(tuple(rate), barrier)) for rate in (moving, acceleration)
    )
    steady = NEVER + 0.0 * free.x
    for on, stick, one, tangent in zip(loaded, sticks, each, rows.tangents, strict=True):
        # Against the slip of before: where what clears away an approach has turned it, friction
        # would go on to drive the body.
        way = jnp.sign(one.slip)
        slip = way * tangent.speed(moving)
        change = way * (tangent.speed(acceleration) + one.bend_along)
        brakes = on & ~stick & (change < 0)
        stop = jnp.maximum(slip, 0.0) / jnp.where(brakes, -change, 1.0)
        steady = jnp.where(brakes, jnp.minimum(steady, stop), steady)
    return moving, acceleration, working, loaded, fence(steady, barrier)
