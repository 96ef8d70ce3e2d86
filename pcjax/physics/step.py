"""One step of one trial: drive, free motion, collide, respond, goal test."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from pcjax.model.body import Circle, Stick
from pcjax.model.motion import Motion
from pcjax.model.scenario import Scenario, World
from pcjax.physics.collide import two_nearest
from pcjax.physics.respond import bounce, hold_off
from pcjax.physics.stick import Rod, meet_limbs_with_stick
from pcjax.planar import Flag, Scalar, Vec, runtime_one, unit_and_length, where

RUNNING, PASSED, INVALID = 0, 1, 2
"""A trial's status: under way, through the goal, or gone wrong (see `State`)."""

PAPER_DT = 0.001
"""The paper's step in seconds; index 1 and all limits count these, whatever step is taken."""


LONGEST_TRAVEL, LARGEST_TURN = 0.5, 0.3
"""What one step of a stick may cover: share of the half length by any of its points, radians."""


class Watch(eqx.Module):
    """What a stick's trial has come to so far.

    Attributes:
        penetration: deepest it has been in its skin at the end of a step.
        travel: the farthest any point of it went in a step, as seen from the hand.
        undone: steps in which it stayed where it was (see `meet_limbs_with_stick`).
    """

    penetration: Scalar
    travel: Scalar
    undone: Scalar


class State(eqx.Module):
    """Where a trial is.

    Attributes:
        position: the object's centre in the hand frame.
        velocity: its velocity as seen from the ground, in the hand's axes; once it has passed, as
            seen from the hand, which tells when within the step it did.
        clock: steps taken in the current period of the drive.
        steps: steps taken since the trial began, the one that ended it included.
        status: RUNNING, PASSED, or INVALID where the motion stopped being a finite number or went
            so far in one step that a limb could be stepped over: a circle by its radius; a stick by
            `LONGEST_TRAVEL` or `LARGEST_TURN`.
        angle: a stick's angle from the palm, radians; None for a circle, and so are the next two.
        spin: its angular velocity as seen from the ground.
        watch: see `Watch`.
    """

    position: Vec
    velocity: Vec
    clock: Int[Array, ""]
    steps: Int[Array, ""]
    status: Int[Array, ""]
    angle: Scalar | None = None
    spin: Scalar | None = None
    watch: Watch | None = None


def at_rest(position: Vec, angle: Scalar | None = None) -> State:
    """The state at the start of a trial; a stick also has an angle."""
    zero, count = 0.0 * position.x, jnp.zeros((), jnp.int32)
    state = State(position, Vec(zero, zero), count, count, count)
    if angle is None:
        return state
    return replace(state, angle=angle + zero, spin=zero, watch=Watch(zero, zero, zero))


def begin(scenario: Scenario, draws: Float[Array, "3"]) -> State:
    """A trial's first state, from `scenario.draws_for_start` draws uniform on [0, 1)."""
    body: Any = scenario.body
    return at_rest(scenario.start(draws), body.orientation if body.turns else None)


def step(scenario: Scenario, swing: Any, state: State, dt: Scalar = PAPER_DT) -> State:
    """The state one step of `dt` seconds later. A trial that has ended stays as it is.

    Arguments:
        scenario: the condition.
        swing: the drive's motion in the current period, from `scenario.drive.swing`.
        state: the state before.
        dt: the step, s.

    Examples:
        Gravity along the palm, T1 = 30 degrees, from rest: v = g sin(T1) t.

        >>> import jax.numpy as jnp, pcjax
        >>> from pcjax.physics.step import begin
        >>> scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> swing = scenario.drive.swing(jnp.array([1.0, 0.5]), jnp.array([1.0, 0.5]), first=False)
        >>> state = begin(scenario, jnp.array([0.2, 0.5, 0.5]))
        >>> print(f"{pcjax.step(scenario, swing, state, 0.01).velocity.x:.4f}")
        0.0490
    """
    return advance(scenario.world(), swing, state, dt)


def advance(world: World, swing: Any, state: State, dt: Scalar) -> State:
    """`step` for a scenario whose kinematics have been worked out by `Scenario.world`."""
    free = world.drive.fly(swing, state.position, state.velocity, state.clock * dt, dt)
    return move_body(world.body, world, state, free, dt, runtime_one(state.clock, dt))


@functools.singledispatch
def move_body(
    body: Any, world: World, state: State, free: Motion, dt: Scalar, one: Scalar
) -> State:
    """A body's part of a step: what limbs do to its free motion, and whether it has passed.

    One function for each kind of body, registered with `move_body.register`.

    Arguments:
        body: that of the world; its type chooses the function.
        world: limbs, goal, drive and contact law.
        state: before the step.
        free: the centre's free motion over the step.
        dt: the step, s.
        one: a 1 for `pcjax.planar.fence`.

    Returns:
        The state after the step, from `judge`.

    Raises:
        TypeError: a body without such a function.
    """
    raise TypeError(
        f"nothing says how a {type(body).__name__} moves: register it with "
        "pcjax.physics.step.move_body"
    )


@move_body.register
def move_circle(
    body: Circle, world: World, state: State, free: Motion, dt: Scalar, one: Scalar
) -> State:
    """`move_body` for a circle: contact with the two nearest limbs."""
    moved = meet_limbs(world, free, dt, one)
    travel = free.position - state.position
    # Written so that NaN fails it too.
    safe = travel.dot(travel) < body.radius * body.radius
    return judge(world, state, moved, safe)


def meet_limbs(world: World, free: Motion, dt: Scalar, one: Scalar) -> Motion:
    """Impacts with the two nearest limbs, then rest and sliding on them."""
    radius = world.body.radius
    contacts = two_nearest(world.limbs, free.position, one)
    moved = bounce(world.law, contacts, radius, free, dt, one)
    return hold_off(world.law, contacts, radius, moved, moved.position - free.position, dt, one)


@move_body.register
def move_stick(
    body: Stick, world: World, state: State, free: Motion, dt: Scalar, one: Scalar
) -> State:
    """`move_body` for a stick: its turning, and its contacts."""
    assert state.angle is not None
    assert state.spin is not None
    assert state.watch is not None
    half, skin = body.half_length, body.skin
    # Nothing turns the stick between impacts; the hand turns steadily.
    carried = 0.0 if free.carry is None else free.carry.spin
    spin = state.spin - carried
    turn = spin * dt
    rod = Rod(free, state.angle + turn, spin)
    before = Rod(replace(free, position=state.position), state.angle, spin).pose(one)
    moved, penetration, undone = meet_limbs_with_stick(world, before, state.angle, rod, dt, one)
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


def judge(world: World, state: State, moved: Motion, safe: Flag) -> State:
    """Goal test, the verdict on the step's safety, and the freeze of trials that have ended.

    Arguments:
        world: with the goal.
        state: before the step.
        moved: the centre after it.
        safe: whether no limb can have been stepped over; False, also for what is not a number,
            ends the trial as invalid.
    """
    before, after = world.goal.beyond(state.position), world.goal.beyond(moved.position)
    share = jnp.clip(before / jnp.where(after > before, before - after, -1.0), 0.0, 1.0)
    across = state.position + (moved.position - state.position) * share
    passed = (before < world.nearness()) & (after >= 0) & world.goal.between(across)
    running = state.status == RUNNING
    velocity = moved.velocity
    if moved.carry is not None:
        velocity = where(passed, moved.relative(), velocity)
    verdict = jnp.where(safe, jnp.where(passed, PASSED, RUNNING), INVALID)
    return State(
        where(running, moved.position, state.position),
        where(running, velocity, state.velocity),
        state.clock + 1,
        state.steps + running,
        jnp.where(running, verdict, state.status),
    )
