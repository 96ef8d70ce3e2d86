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

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp

from pcjax.geometry import Flag, Scalar, Vec, fence, fence_all, first_root, runtime_barrier, where
from pcjax.model.motion import Leg
from pcjax.model.scenario import World
from pcjax.physics.contact.manifold import Outline, nearest_contacts
from pcjax.physics.rigid import Rate
from pcjax.physics.state import INVALID, PASSED, RUNNING, State
from pcjax.physics.tumbling.bounds import while_apart, while_kept
from pcjax.physics.tumbling.flight import Margins, Path, Tumble, any_of, gyration_of
from pcjax.physics.tumbling.settling import CAPTURE, CONTACTS, settled_by

_CLEAR = 8.0
"""How many times what rounding may hide a body and a limb are held apart, at least."""


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
    # On which side of a limb a corner is has to be clear, whatever rounding does.
    skin = jnp.maximum(shape.skin, _CLEAR * world.nearness() - world.half_thickness)
    per_gyration, skin, half = fence_all((shape.per_gyration, skin, world.half_thickness), barrier)
    rounding = skin + half
    turning = jnp.abs(flight.spin) * shape.radius
    fast = jnp.abs(flight.velocity.x) + jnp.abs(flight.velocity.y) + turning + 1.0
    noise = fence(32 * float(jnp.finfo(jnp.result_type(fast)).eps) * fast, barrier)
    margins = Margins(world.nearness(), noise, noise + CAPTURE * law.resting_speed)

    cosine, sine = fence_all((jnp.cos(flight.angle), jnp.sin(flight.angle)), barrier)
    outline = Outline.of(shape.vertices, cosine, sine, barrier)
    found = nearest_contacts(CONTACTS, world.limbs, outline, flight.position, skin, half, barrier)
    left = fence(change - flight.time, barrier)
    settled = settled_by(law, found, flight, leg, left, per_gyration, margins, barrier)
    path, loaded = settled.path, settled.loaded
    # Being put back to touching has turned it, by so little that this is first order.
    shifted = path.angle - flight.angle
    turned = fence_all((cosine - sine * shifted, sine + cosine * shifted), barrier)
    outline = Outline.of(shape.vertices, *turned, barrier)
    longest = jnp.minimum(left, settled.steady)
    longest = while_kept(longest, found, loaded, outline, skin, half, path, margins, barrier)
    wait, apart = while_apart(longest, world, outline, rounding, path, margins, barrier)
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
    return where(moves, new, ground)


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
    return jnp.sqrt(jnp.where(moves, jnp.clip(due / jnp.where(moves, has, 1.0), 1e-6, 1.04), 1.0))
