"""Where a trial is, and how it goes over into the next state: goal test and verdict."""

from __future__ import annotations

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp

from pcjax.geometry import Flag, Integers, Scalar, Scalars, Vec, where
from pcjax.model.motion import Motion
from pcjax.model.scenario import World

RUNNING, PASSED, INVALID = 0, 1, 2
"""A trial's status: under way, through the goal, or gone wrong (see `State`)."""

PAPER_DT = 0.001
"""The paper's step in seconds; index 1 and all limits count these, whatever step is taken."""


class Watch(eqx.Module):
    """What a trial of something that turns has come to so far; zeros for a circle.

    Attributes:
        penetration: deepest it has been in its skin at the end of a step.
        travel: the farthest any point of it went in a step, as seen from the hand.
        undone: steps in which it stayed where it was (see `meet_limbs_with_stick`).
    """

    penetration: Scalars
    travel: Scalars
    undone: Scalars


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
        angle: the object's angle from the palm, radians; a circle keeps that of its start, 0.
        spin: its angular velocity as seen from the ground.
        watch: see `Watch`.
    """

    position: Vec
    velocity: Vec
    clock: Integers
    steps: Integers
    status: Integers
    angle: Scalars
    spin: Scalars
    watch: Watch


def at_rest(position: Vec, angle: Scalar = 0.0) -> State:
    """The state at the start of a trial."""
    zero, count = 0.0 * position.x, jnp.zeros((), jnp.int32)
    still, watch = Vec(zero, zero), Watch(zero, zero, zero)
    return State(position, still, count, count, count, angle + zero, zero, watch)


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
    if moved.twist is not None:
        velocity = where(passed, moved.relative(), velocity)
    verdict = jnp.where(safe, jnp.where(passed, PASSED, RUNNING), INVALID)
    return replace(
        state,
        position=where(running, moved.position, state.position),
        velocity=where(running, velocity, state.velocity),
        clock=state.clock + 1,
        steps=state.steps + running.astype(state.steps.dtype),
        status=jnp.where(running, verdict, state.status),
    )
