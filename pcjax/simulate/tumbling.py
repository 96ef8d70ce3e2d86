"""Trials of convex bodies from event to event: as far at a time as can be proved safe.

A rounded convex polygon flies, slides, rolls, tips or rests in a hand, under an acceleration that
is constant for a while. Each leap settles the contacts at its start and then goes as far as
provably nothing happens:

- A line separates the polygon from a limb that it does not touch: one along an edge of the polygon,
  or one square to the shortest way between the two. Until every vertex could have reached the
  second, or both ends of the limb the first, they cannot touch. How fast a vertex can come is
  bounded by a parabola, since the turn is bounded.
- A contact that carries the body is kept by its force. The leap ends before turning has led it
  astray by more than rounding may, and where the contact leaves its limb or stops slipping.
- A leap also ends at the goal line and when the acceleration changes.

Whether the two are apart is checked in each leap; where they are not, the trial is INVALID.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.geometry import (
    NEVER,
    Flag,
    Integers,
    Scalar,
    Scalars,
    Segment,
    Vec,
    fence,
    fence_all,
    first_root,
    for_each,
    runtime_barrier,
    stacked,
    unit_and_length,
    unstacked,
    where,
)
from pcjax.model.contact import ContactLaw
from pcjax.model.motion import Leg
from pcjax.model.scenario import World
from pcjax.physics.contact.manifold import (
    ON_EDGE,
    ON_END,
    Contact,
    Outline,
    decided,
    left_of,
    nearest_contacts,
    offset_from,
    points_of,
    start_numbers,
)
from pcjax.physics.rigid import (
    NOT_NEEDED,
    Direction,
    Rate,
    Rows,
    at_rest_under,
    catches,
    forces_with_friction,
    impact,
    least_pushes,
)
from pcjax.physics.state import INVALID, PASSED, RUNNING, State

CONTACTS = 4
"""Contacts that are settled at once: two flush edges have as many."""

IMPACTS = 3
"""Impacts of a leap. Where more follow each other, the leap ends where it began."""

LARGEST_TURN = 0.01
"""Largest turn, radians, of a leap on a contact that carries the body."""

LARGEST_BRAKE = 0.02
"""Largest share of a speed that drag takes in one leap."""

CAPTURE = 0.1
"""Share of the contact law's resting speed below which a limb keeps the body that it carries."""


class Tumble(eqx.Module):
    """Where a trial is.

    Attributes:
        position: of the centre, in the hand frame.
        velocity: of the centre as seen from the ground, in the hand's axes.
        angle: from the palm, radians.
        spin: the rate of its turning as seen from the ground.
        time: seconds of the current period gone by.
        leaps: leaps taken since the period began.
        status: RUNNING, PASSED, or INVALID.
        deepest: the deepest overlap so far.
    """

    position: Vec
    velocity: Vec
    angle: Scalars
    spin: Scalars
    time: Scalars
    leaps: Integers
    status: Integers
    deepest: Scalars


class Path(eqx.Module):
    """The motion from a leap's start, once the contacts have been settled: accelerations stay.

    Attributes:
        position, velocity, acceleration: of the centre.
        angle, spin, twist: angle, its rate, and the rate of that.
        working: what of the accelerations does work: the pull, and friction where it slips.
    """

    position: Vec
    velocity: Vec
    acceleration: Vec
    angle: Scalar
    spin: Scalar
    twist: Scalar
    working: Rate

    def after(self, wait: Scalar) -> tuple[Vec, Vec, Scalar, Scalar]:
        """Position, velocity, angle within half a turn, and spin, so many seconds later."""
        position = self.position + (self.velocity + self.acceleration * (0.5 * wait)) * wait
        angle = self.angle + (self.spin + 0.5 * self.twist * wait) * wait
        angle = angle - 2 * math.pi * jnp.round(angle / (2 * math.pi))
        velocity = self.velocity + self.acceleration * wait
        return position, velocity, angle, self.spin + self.twist * wait


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


class Margins(eqx.Module):
    """What rounding may hide: a distance and a speed; and below which speed a limb keeps a body."""

    near: Scalar
    noise: Scalar
    slow: Scalar


def tumble(
    world: World, profile: Any, interval: Scalar, flight: Tumble, until: Scalar | None = None
) -> Tumble:
    """The state after the longest leap in which provably nothing happens.

    Arguments:
        world: the condition.
        profile: the drive's motion in the current period, from `Drive.profile`.
        interval: seconds for which the pull is taken as constant, from `Drive.steady_interval`.
        flight: the state before. It stays as it is if its trial or its period is over.
        until: the leap goes no further than to this time of the period, s.
    """
    shape = world.shape
    assert shape is not None
    law, drive = world.law, world.drive
    barrier = runtime_barrier(flight.leaps, flight.time)
    leg = fence_all(drive.leg(profile, flight.time, interval), barrier)
    change = leg.until if until is None else jnp.minimum(leg.until, until)
    ground, flight = flight, _seen_from_hand(flight, leg, barrier)
    per_gyration, skin, half = fence_all(
        (shape.per_gyration, shape.skin, world.half_thickness), barrier
    )
    rounding = skin + half
    turning = jnp.abs(flight.spin) * shape.radius
    fast = jnp.abs(flight.velocity.x) + jnp.abs(flight.velocity.y) + turning + 1.0
    noise = fence(32 * float(jnp.finfo(jnp.result_type(fast)).eps) * fast, barrier)
    margins = Margins(world.nearness(), noise, noise + CAPTURE * law.resting_speed)

    cosine, sine = fence_all((jnp.cos(flight.angle), jnp.sin(flight.angle)), barrier)
    outline = Outline.of(shape.vertices, cosine, sine, barrier)
    found = nearest_contacts(CONTACTS, world.limbs, outline, flight.position, skin, half, barrier)
    left = fence(change - flight.time, barrier)
    settled = _settled(law, found, flight, leg, left, per_gyration, margins, barrier)
    path, loaded = settled.path, settled.loaded
    longest = jnp.minimum(left, settled.steady)
    longest = _while_kept(longest, found, loaded, outline, skin, half, path, margins, barrier)
    wait, apart = _while_apart(longest, world, outline, rounding, path, margins, barrier)
    goal = world.goal
    line = goal.beyond(path.position)
    towards = jnp.where(line < 0, -1.0, 1.0)
    speed, rate = (
        towards * (goal.beyond(path.position + vector) - line)
        for vector in (path.velocity, path.acceleration)
    )
    # A little beyond the line, so that rounding cannot leave it on this side.
    wait = jnp.minimum(wait, first_root(jnp.abs(line) + margins.near, speed, rate))
    inside = goal.beyond(flight.position) < margins.near
    # Being put back to touching may have taken it across.
    over = inside & (line >= 0) & goal.between(path.position)
    wait = fence(jnp.where(settled.closing | over, 0.0, wait), barrier)

    position, velocity, angle, spin = path.after(wait)
    share = jnp.where(any_of(loaded), _due(path, per_gyration, wait), 1.0)
    velocity, spin = velocity * share, spin * share
    passed = inside & (goal.beyond(position) >= 0) & goal.between(position)
    # Written so that NaN fails it too.
    finite = (position.dot(position) < jnp.inf) & (jnp.abs(spin) < jnp.inf)
    sound = (apart > -0.5 * rounding) & finite
    verdict = jnp.where(sound, jnp.where(passed, PASSED, RUNNING), INVALID)
    moves = (flight.status == RUNNING) & (flight.time < drive.period)
    time = jnp.where(wait < left, flight.time + wait, change)
    leaps = flight.leaps + 1
    deepest = jnp.maximum(flight.deepest, -apart)
    new = Tumble(position, velocity, angle, spin, time, leaps, verdict, deepest)
    new = _seen_from_ground(new, leg)
    return jax.tree.map(lambda a, b: jnp.where(moves, a, b), new, ground)


LEAPS_IN_A_STEP = 400
"""Leaps of a fixed step after which the trial ends as INVALID."""


def tumble_for(world: World, profile: Any, state: State, dt: Scalar) -> State:
    """The state a fixed step of `dt` seconds later, by as many leaps as that takes.

    Differentiable in forward mode.
    """
    zero = 0.0 * state.position.x
    clock = jnp.asarray(state.clock, jnp.result_type(zero))
    begin, end = clock * dt + zero, (clock + 1.0) * dt + zero
    flight = Tumble(
        state.position,
        state.velocity,
        state.angle,
        state.spin,
        begin,
        jnp.zeros_like(state.steps),
        state.status,
        state.watch.penetration,
    )

    def under_way(flight: Tumble) -> Flag:
        moves = (flight.status == RUNNING) & (flight.time < world.drive.period)
        return moves & (flight.time < end) & (flight.leaps < LEAPS_IN_A_STEP)

    def leap(flight: Tumble) -> Tumble:
        return tumble(world, profile, dt, flight, end)

    flight = jax.lax.while_loop(under_way, leap, flight)
    running = state.status == RUNNING
    stuck = (flight.status == RUNNING) & (flight.leaps >= LEAPS_IN_A_STEP)
    passed = running & (flight.status == PASSED)
    # One that has passed goes on to the step's end, so that its place there tells when it did.
    leg = world.drive.leg(profile, begin, dt)
    seen = _seen_from_hand(flight, leg, runtime_barrier(state.clock, dt)).velocity
    beyond = flight.position + seen * (end - flight.time)
    return replace(
        state,
        position=where(passed, beyond, flight.position),
        velocity=where(passed, seen, flight.velocity),
        angle=flight.angle,
        spin=flight.spin,
        clock=state.clock + 1,
        steps=state.steps + running.astype(state.steps.dtype),
        status=jnp.where(stuck, INVALID, flight.status),
        watch=replace(state.watch, penetration=flight.deepest),
    )


def _seen_from_hand(flight: Tumble, leg: Leg, barrier: Scalar) -> Tumble:
    if leg.carry is None:
        return flight
    twist = leg.carry.twist(flight.time)
    velocity = flight.velocity - twist.at(flight.position)
    velocity, spin = fence_all((velocity, flight.spin - twist.spin), barrier)
    return replace(flight, velocity=velocity, spin=spin)


def _seen_from_ground(flight: Tumble, leg: Leg) -> Tumble:
    if leg.carry is None:
        return flight
    twist = leg.carry.twist(flight.time)
    velocity = flight.velocity + twist.at(flight.position)
    return replace(flight, velocity=velocity, spin=flight.spin + twist.spin)


def any_of(loaded: Sequence[Flag]) -> Flag:
    """Whether any contact carries the body."""
    some = loaded[0]
    for on in loaded[1:]:
        some = some | on
    return some


def gyration_of(per_gyration: Scalar) -> Scalar:
    """The radius of gyration from 1 over it; 0 where nothing turns."""
    turns = per_gyration > 0
    return jnp.where(turns, 1.0 / jnp.where(turns, per_gyration, 1.0), 0.0)


def _due(path: Path, per_gyration: Scalar, wait: Scalar) -> Scalar:
    """By what share of its speed a body has to move after a leap, so that it gains what is done in
    work: contacts that do not slip do none.

    Accelerations that stay, where they should turn with the body, give it a little more or less.
    """
    _, velocity, _, spin = path.after(wait)
    gyration = gyration_of(per_gyration)
    gone = (path.velocity + path.acceleration * (0.5 * wait)) * wait
    turned = (path.spin + 0.5 * path.twist * wait) * wait

    def twice(velocity: Vec, spin: Scalar) -> Scalar:
        turning = spin * gyration
        return velocity.dot(velocity) + turning * turning

    work = path.working.dot(Rate(gone.x, gone.y, turned * gyration))
    has, due = twice(velocity, spin), twice(path.velocity, path.spin) + 2.0 * work
    moves = has > 0
    # Within bounds, for where it all but stops.
    return jnp.sqrt(jnp.where(moves, jnp.clip(due / jnp.where(moves, has, 1.0), 0.96, 1.04), 1.0))


def _settled(
    law: ContactLaw,
    found: Contact,
    flight: Tumble,
    leg: Leg,
    left: Scalar,
    per_gyration: Scalar,
    margins: Margins,
    barrier: Scalar,
) -> Settled:
    """What the contacts do at a leap's start: impacts, forces, and back to touching."""
    rows = Rows.of(found, CONTACTS, per_gyration, barrier)
    gaps = [fence(gap, barrier) for gap in unstacked(found.gap, CONTACTS)]
    touches = [decided(gap <= margins.near, barrier) for gap in gaps]
    lacks = [
        jnp.where(on, -gap / normal.size, NOT_NEEDED)
        for on, gap, normal in zip(touches, gaps, rows.normals, strict=True)
    ]
    gyration = gyration_of(per_gyration)
    turning = flight.spin * gyration
    moving = Rate(flight.velocity.x, flight.velocity.y, turning)
    moving, closing = _meet(law, rows, touches, moving, barrier)
    free, longest = _free(law, flight.position, touches, moving, leg, left, gyration, margins)
    free = Rate(*fence_all(tuple(free), barrier))
    moving, acceleration, working, loaded, steady = _carried(
        law, found, rows, touches, moving, free, per_gyration, margins, barrier
    )
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
    law: ContactLaw, rows: Rows, touches: Sequence[Flag], moving: Rate, barrier: Scalar
) -> tuple[Rate, Flag]:
    """Impacts (14)-(17), with friction, one after the other, the fastest approach first. What is
    left below the resting speed is met by all contacts at once, without rebound."""
    friction = 0.0 if law.friction is None else law.friction

    def closing_speeds(moving: Rate) -> list[Scalar]:
        return [
            fence(jnp.where(on, -normal.speed(moving), 0.0), barrier)
            for on, normal in zip(touches, rows.normals, strict=True)
        ]

    def meet(_: Any, moving: Rate) -> Rate:
        approach = closing_speeds(moving)
        normal, tangent, fastest = rows.normals[0], rows.tangents[0], approach[0]
        for a in range(1, len(touches)):
            faster = approach[a] > fastest
            other = rows.normals[a], rows.tangents[a], approach[a]
            normal, tangent, fastest = jax.tree.map(
                lambda new, old, faster=faster: jnp.where(faster, new, old),
                other,
                (normal, tangent, fastest),
            )
        normal, tangent, fastest = fence_all((normal, tangent, fastest), barrier)
        hits = fastest > law.resting_speed
        pushed, rubbed = impact(
            jnp.maximum(fastest, 0.0),
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

    moving = jax.lax.fori_loop(0, IMPACTS, meet, moving)
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
    found: Contact,
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

    each = unstacked(
        for_each(pressing, found, *map(stacked, (touches, rows.normals, rows.tangents))), CONTACTS
    )
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

    def clean(_: Any, moving: Rate) -> Rate:
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
    moving = jax.lax.fori_loop(0, 2, clean, kept(moving, loaded))
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
    rests = (still < margins.slow) & at_rest_under(rows, stays, ratio, free, strength)
    rests = decided(rests, barrier)
    moving = Rate(*(jnp.where(rests, 0.0, part) for part in moving))
    acceleration = Rate(*(jnp.where(rests, 0.0, part) for part in acceleration))
    moving, acceleration = (
        Rate(*fence_all(tuple(rate), barrier)) for rate in (moving, acceleration)
    )
    steady = NEVER + 0.0 * free.x
    for on, stick, one, tangent in zip(loaded, sticks, each, rows.tangents, strict=True):
        slip, change = tangent.speed(moving), tangent.speed(acceleration) + one.bend_along
        brakes = on & ~stick & (slip * change < 0)
        stop = jnp.abs(slip) / jnp.where(brakes, jnp.abs(change), 1.0)
        steady = jnp.where(brakes, jnp.minimum(steady, stop), steady)
    return moving, acceleration, working, loaded, fence(steady, barrier)


def _while_kept(
    longest: Scalar,
    found: Contact,
    loaded: Sequence[Flag],
    outline: Outline,
    skin: Scalar,
    half: Scalar,
    path: Path,
    margins: Margins,
    barrier: Scalar,
) -> Scalar:
    """Seconds, at most `longest`, for which the contacts that carry the body stay what they are."""
    near = margins.near
    size = outline.reach + skin
    turn = jnp.minimum(LARGEST_TURN, jnp.cbrt(6.0 * near / size)) * size / outline_or_one(outline)
    turned = first_root(turn, -jnp.abs(path.spin), -jnp.abs(path.twist))
    longest = fence(jnp.where(any_of(loaded), jnp.minimum(longest, turned), longest), barrier)
    ahead = jnp.minimum(longest, 1.0)
    twist = jnp.abs(path.twist)
    spin = jnp.abs(path.spin) + twist * ahead
    hard = unit_and_length(path.acceleration)[1]
    fast = unit_and_length(path.velocity)[1] + hard * ahead
    spin, fast, hard = fence_all((spin, fast, hard), barrier)

    def for_contact(longest: Scalar, each: tuple[Contact, Flag]) -> tuple[Scalar, None]:
        contact, on = each
        # What the gap's third derivative is at most leads it astray by no more than half of `near`.
        arm = unit_and_length(contact.arm)[1]
        jerk = arm * (3.0 * twist * spin + spin * spin * spin)
        swept = 3.0 * (spin * hard + twist * fast + spin * spin * fast)
        jerk = jerk + jnp.where(contact.kind == ON_EDGE, swept, 0.0)
        strays = jerk > 1e-12
        astray = jnp.cbrt(3.0 * near / jnp.where(strays, jerk, 1.0))
        # How far along, until the contact is another one.
        along = left_of(contact.normal)
        velocity = path.velocity + left_of(contact.arm) * path.spin
        change = path.acceleration + left_of(contact.arm) * path.twist
        change = change - contact.arm * (path.spin * path.spin)
        speed, rate = velocity.dot(contact.way), change.dot(contact.way)
        ends = jnp.minimum(
            first_root(jnp.maximum(contact.along, 0.0) + near, speed, rate),
            first_root(jnp.maximum(contact.length - contact.along, 0.0) + near, -speed, -rate),
        )
        on_end = contact.kind == ON_END
        core = skin + half
        arc = jnp.where(on_end, jnp.maximum(0.05 * core, jnp.sqrt(2.0 * core * near)), 0.05 * size)
        rolled = first_root(arc, -jnp.abs(velocity.dot(along)), -jnp.abs(change.dot(along)))
        ends = jnp.where(on_end, rolled, ends)
        ends = jnp.where(contact.kind == ON_EDGE, jnp.minimum(ends, rolled), ends)
        ends = jnp.where(strays, jnp.minimum(ends, astray), ends)
        return fence(jnp.where(on, jnp.minimum(longest, ends), longest), barrier), None

    return jax.lax.scan(for_contact, longest, (found, stacked(loaded)))[0]


def outline_or_one(outline: Outline) -> Scalar:
    """The longest arm, or a tiny length for a single vertex, which no turn moves."""
    return jnp.maximum(outline.reach, 1e-9)


def _while_apart(
    longest: Scalar,
    world: World,
    outline: Outline,
    rounding: Scalar,
    path: Path,
    margins: Margins,
    barrier: Scalar,
) -> tuple[Scalar, Scalar]:
    """Seconds, at most `longest`, in which the body cannot touch a limb that it does not; and by
    how much a line separates it from each limb, the least of all."""
    near, noise = margins.near, margins.noise
    position, velocity, pulled = path.position, path.velocity, path.acceleration
    spin, twist = jnp.abs(path.spin), jnp.abs(path.twist)
    horizon = fence(jnp.minimum(longest, 0.5 / jnp.maximum(spin, 1e-9)), barrier)
    most = fence(spin + twist * horizon, barrier)
    swing = fence(jnp.minimum(2.0, most * horizon), barrier)
    hard = fence(unit_and_length(pulled)[1], barrier)
    fast = fence(unit_and_length(velocity)[1] + hard * horizon, barrier)
    travel = fence(fast * horizon, barrier)
    jolt = fence(3.0 * twist * most + most * most * most, barrier)
    square = fence(path.spin * path.spin, barrier)
    reach = outline.reach

    def until(gap: Scalar, speed: Scalar, true: Scalar, bound: Scalar, jerk: Scalar) -> Scalar:
        """When a gap may close.

        Its second derivative is `true` now and at least `bound`; of its third, `jerk` is a bound.
        """
        cut = gap < -2.0 * near
        gap = jnp.maximum(gap, 0.0)
        touches = (gap <= near) & (speed > -noise)
        opens = speed > noise
        # One that closes and is no contact of its own, such as a joint about to be reached: a floor
        # keeps the leap from ending where it starts.
        floor = jnp.where(touches, near / 64, near / 4)
        gap = jnp.where(touches & opens, 0.0, jnp.maximum(gap, floor))
        speed = jnp.where(touches, jnp.maximum(speed, 0.0), speed)
        time = first_root(gap, speed, jnp.maximum(bound, true - jerk * horizon))
        # One that neither opens nor closes: for as long as it opens for certain, and as the third
        # derivative alone leads it astray by no more than half of `near`.
        stays = touches & ~opens & (true > -8.0 * noise)
        turns = jerk > 1e-12
        jerk = jnp.where(turns, jerk, 1.0)
        kept = jnp.maximum(3.0 * true / jerk, jnp.cbrt(3.0 * near / jerk))
        kept = jnp.where(turns, kept, NEVER)
        return jnp.where(cut, 0.0, jnp.where(stays, kept, time))

    def for_limb(
        so_far: tuple[Scalar, Scalar], one: tuple[Segment, Vec, Vec]
    ) -> tuple[tuple[Scalar, Scalar], None]:
        limb, start, end = one
        # Against the line that is square to the shortest way from limb to polygon.
        beyond, across, least = 0.0, 0.0, NEVER
        for arm in outline.arms:
            _, past, aside = offset_from(limb, position + arm)
            far = jax.lax.stop_gradient(past * past + aside * aside)
            beyond = jnp.where(far < least, past, beyond)
            across = jnp.where(far < least, aside, across)
            least = jnp.minimum(far, least)
        # Once for both components: across a tiny distance rounding would turn the direction.
        beyond, across = fence_all((beyond, across), barrier)
        offset = left_of(limb.tangent) * across + limb.tangent * beyond
        normal = fence_all(unit_and_length(offset)[0], barrier)
        base = normal.dot(limb.start) + jnp.maximum(0.0, normal.dot(limb.tangent) * limb.length)
        height, falls, drop = fence_all(
            (normal.dot(position) - base - rounding, normal.dot(velocity), normal.dot(pulled)),
            barrier,
        )
        reached, apart = NEVER, NEVER
        for arm, length in zip(outline.arms, outline.lengths, strict=True):
            lever, up = arm.cross(normal), arm.dot(normal)
            straight = drop + path.twist * lever
            true = straight - square * up
            bound = straight - length * (most * most + twist * swing)
            gap = height + up
            falling = falls + path.spin * lever
            reached = jnp.minimum(reached, until(gap, falling, true, bound, length * jolt))
            apart = jnp.minimum(apart, gap)
        reached, apart = fence_all((jnp.minimum(reached, horizon), apart), barrier)

        if len(outline.arms) > 1:
            best, low = None, None
            for arm, edge in zip(outline.arms, outline.along, strict=True):
                ends = [(point - position - arm).cross(edge) - rounding for point in (start, end)]
                lower = jnp.minimum(*ends)
                candidate = (*ends, edge)
                if best is None or low is None:
                    best, low = candidate, lower
                else:
                    better = lower > low
                    best = jax.tree.map(
                        lambda new, old, better=better: jnp.where(better, new, old), candidate, best
                    )
                    low = jnp.maximum(lower, low)
            assert best is not None
            *gaps, edge = fence_all(best, barrier)
            normal = left_of(edge)  # from the limb to the body
            sideways = left_of(normal).dot(velocity)
            falls, drop = normal.dot(velocity), normal.dot(pulled)
            soonest = NEVER
            for gap, point in zip(gaps, (start, end), strict=True):
                to_point = point - position
                far = unit_and_length(to_point)[1]
                wide = far + travel
                lever = to_point.cross(normal)
                straight = drop + path.twist * lever
                true = straight + square * normal.dot(to_point) + 2.0 * path.spin * sideways
                swept = (hard + twist * far) * swing + twist * travel
                bound = straight - swept - most * most * wide - 2.0 * most * fast
                swept = most * hard + twist * fast + most * most * fast
                jerk = 3.0 * swept + jolt * wide
                falling = falls + path.spin * lever
                soonest = jnp.minimum(soonest, until(gap, falling, true, bound, jerk))
            room = jnp.minimum(*gaps)
            by_edge = jnp.where(room > -near, soonest, 0.0)
            reached = jnp.maximum(reached, jnp.minimum(by_edge, horizon))
            apart = jnp.maximum(apart, room)

        # Against the circle about it.
        away, distance = unit_and_length(limb.offset(position))
        room = distance - reach - rounding
        alone = first_root(jnp.maximum(room, 0.0), away.dot(velocity), away.dot(pulled))
        reached = jnp.maximum(reached, jnp.where(room > near, alone, 0.0))
        least_time, least_apart = so_far
        both = jnp.minimum(least_time, reached), jnp.minimum(least_apart, apart)
        return fence_all(both, barrier), None

    limbs = world.limbs
    points = points_of(limbs)
    starts = [points[number] for number in start_numbers(len(limbs), world.finger_1)]
    each = stacked(limbs), stacked(starts), stacked(points[1:])
    everything = longest, NEVER + 0.0 * longest
    (wait, apart), _ = jax.lax.scan(for_limb, everything, each)
    return wait, apart
