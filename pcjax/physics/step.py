"""One step of one trial: drive, free motion, collide, respond, goal test."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Int

from pcjax.model.drive import Pull, Swing
from pcjax.model.scenario import Scenario, World
from pcjax.physics.collide import two_nearest
from pcjax.physics.respond import Motion, bounce, hold_off
from pcjax.planar import Scalar, Vec, runtime_one, where

RUNNING, PASSED, INVALID = 0, 1, 2
"""A trial's status: under way, through the goal, or gone wrong (see `State`)."""

PAPER_DT = 0.001
"""The paper's step in seconds; index 1 and all limits count these, whatever step is taken."""


class State(eqx.Module):
    """Where a trial is.

    Attributes:
        position: the circle's centre in the hand frame.
        velocity: its velocity.
        clock: steps taken in the current period of the drive.
        steps: steps taken since the trial began, the one that ended it included.
        status: RUNNING, PASSED, or INVALID where the motion stopped being a finite number or
            covered more than the circle's radius in one step, so that a limb could be stepped over.
    """

    position: Vec
    velocity: Vec
    clock: Int[Array, ""]
    steps: Int[Array, ""]
    status: Int[Array, ""]


def at_rest(position: Vec) -> State:
    """The state at the start of a trial."""
    zero, count = 0.0 * position.x, jnp.zeros((), jnp.int32)
    return State(position, Vec(zero, zero), count, count, count)


def step(scenario: Scenario, swing: Swing, state: State, dt: Scalar = PAPER_DT) -> State:
    """The state one step of `dt` seconds later. A trial that has ended stays as it is.

    Arguments:
        scenario: the condition.
        swing: the drive's motion in the current period, from `scenario.drive.swing`.
        state: the state before.
        dt: the step, s.
    """
    return advance(scenario.world(), swing, state, dt)


def advance(world: World, swing: Swing, state: State, dt: Scalar) -> State:
    """`step` for a scenario whose kinematics have been worked out by `Scenario.world`."""
    pull = world.drive.pull(swing, state.clock * dt, dt)
    free = fly(state, pull, dt)
    moved = meet_limbs(world, free, dt, runtime_one(state.clock, dt))
    return judge(world, state, free, moved)


def fly(state: State, pull: Pull, dt: Scalar) -> Motion:
    """Free motion (2) by the classical Runge-Kutta method, for a force that depends on time."""
    mean = (pull.start + pull.middle * 4.0 + pull.end) * (1 / 6)
    early = (pull.start + pull.middle * 2.0) * (1 / 3)
    return Motion(
        state.position + (state.velocity + early * (0.5 * dt)) * dt,
        state.velocity + mean * dt,
        mean,
    )


def meet_limbs(world: World, free: Motion, dt: Scalar, one: Scalar) -> Motion:
    """The impact with the nearest limb, then rest and sliding on the two nearest."""
    radius = world.body.radius
    contacts = two_nearest(world.limbs, free.position, one)
    moved = bounce(world.law, contacts[0], radius, free, dt, one)
    return hold_off(world.law, contacts, radius, moved, moved.position - free.position, dt, one)


def judge(world: World, state: State, free: Motion, moved: Motion) -> State:
    """Goal test, the bound on one step's travel, and the freeze of trials that have ended."""
    before, after = world.goal.beyond(state.position), world.goal.beyond(moved.position)
    passed = (before < 0) & (after >= 0) & world.goal.between(moved.position)
    travel = free.position - state.position
    # Written so that NaN fails it too.
    safe = travel.dot(travel) < world.body.radius * world.body.radius
    running = state.status == RUNNING
    verdict = jnp.where(safe, jnp.where(passed, PASSED, RUNNING), INVALID)
    return State(
        where(running, moved.position, state.position),
        where(running, moved.velocity, state.velocity),
        state.clock + 1,
        state.steps + running,
        jnp.where(running, verdict, state.status),
    )
