"""One step of one trial: drive, free motion, contact, goal test."""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from pcjax.geometry import Scalar, runtime_barrier
from pcjax.model.bodies.base import Body
from pcjax.model.contact import ContactLaw
from pcjax.model.scenario import Scenario, World
from pcjax.physics.contact.table import contact_of, registered_contact
from pcjax.physics.state import PAPER_DT, State, at_rest
from pcjax.physics.tumbling.leap import tumble_for


def begin(scenario: Scenario, draws: Float[Array, " draws"]) -> State:
    """A trial's first state, from `scenario.draws_for_start` draws uniform on [0, 1)."""
    body: Any = scenario.body
    angle = body.orientation if body.oriented else 0.0
    if angle is None:
        angle = math.pi * (2 * draws[3] - 1)
    return at_rest(scenario.start(draws[:3]), angle)


def step(scenario: Scenario, profile: Any, state: State, dt: Scalar = PAPER_DT) -> State:
    """The state one step of `dt` seconds later. A trial that has ended stays as it is.

    Arguments:
        scenario: the condition.
        profile: the drive's motion in the current period, from `scenario.drive.profile`.
        state: the state before.
        dt: the step, s.

    Examples:
        Gravity along the palm, T1 = 30 degrees, from rest: v = g sin(T1) t.

        >>> import jax.numpy as jnp, pcjax
        >>> from pcjax.physics.step import begin
        >>> scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> draws = jnp.array([1.0, 0.5])
        >>> profile = scenario.drive.profile(draws, draws, first=False)
        >>> state = begin(scenario, jnp.array([0.2, 0.5, 0.5]))
        >>> print(f"{pcjax.step(scenario, profile, state, 0.01).velocity.x:.4f}")
        0.0490
    """
    return advance(scenario.world(), profile, state, dt)


def by_leaps(body: Body, law: ContactLaw) -> bool:
    """Whether a step is made of the leaps of convex bodies: for those that have no contact of their
    own registered, for what does not turn though it has an orientation, and for all of them where
    there is friction or drag."""
    rough = law.friction is not None or law.drag is not None
    stiff = body.oriented and not body.turns
    return body.convex and (rough or stiff or registered_contact(body) is None)


def advance(world: World, profile: Any, state: State, dt: Scalar) -> State:
    """`step` for a scenario whose kinematics have been worked out by `Scenario.world`."""
    if by_leaps(world.body, world.law):
        return tumble_for(world, profile, state, dt)
    time = jnp.asarray(state.clock, jnp.result_type(dt)) * dt
    free = world.drive.fly(profile, state.position, state.velocity, time, dt)
    return contact_of(world.body)(
        world.body, world, state, free, dt, runtime_barrier(state.clock, dt)
    )
