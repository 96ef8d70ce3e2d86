"""No direction is special: the physics in turned axes gives the turned motion."""

from __future__ import annotations

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pcjax.geometry import Segment, Vec
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import TiltProfile
from pcjax.model.hand import Goal
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, World, does
from pcjax.physics.state import RUNNING, State, at_rest
from pcjax.physics.step import advance

pytestmark = pytest.mark.usefixtures("x64")

TURN = 0.7345
LAW = ContactLaw(restitution=0.4)
PAST_THE_RAMP = 10**7


def turned(vector: Vec) -> Vec:
    c, s = math.cos(TURN), math.sin(TURN)
    return Vec(c * vector.x - s * vector.y, s * vector.x + c * vector.y)


def turned_world(world: World) -> World:
    limbs = tuple(
        Segment(turned(limb.start), turned(limb.tangent), limb.length) for limb in world.limbs
    )
    return replace(world, limbs=limbs, goal=Goal(turned(world.goal.a), turned(world.goal.b)))


def held(pull: Vec) -> TiltProfile:
    zero = Vec(jnp.asarray(0.0), jnp.asarray(0.0))
    return TiltProfile(zero, zero, pull)


def state(place: Vec, velocity: Vec, angle: float, spin: float) -> State:
    begin = at_rest(place, jnp.asarray(angle))
    clock = jnp.asarray(PAST_THE_RAMP)
    return replace(begin, velocity=velocity, clock=clock, spin=jnp.asarray(spin))


@jax.jit
def roll(world: World, profile: TiltProfile, begin: State) -> State:
    """The states after each of 800 steps of 5 ms."""

    def one(now: State, _: None) -> tuple[State, State]:
        now = advance(world, profile, now, 5e-3)
        return now, now

    return jax.lax.scan(one, begin, length=800)[1]


CIRCLES = [does(hand, Circle(25.0), law=LAW) for hand in (box_hand(), two_joint_hand())]
STICKS = [does(hand, Stick(25.0), law=LAW) for hand in (box_hand(), two_joint_hand())]


@pytest.mark.parametrize("scenario", [*CIRCLES, *STICKS])
@pytest.mark.parametrize(
    ("pull", "velocity"), [((1.5, -4.0), (20.0, -30.0)), ((-3.0, 5.0), (-70.0, 10.0))]
)
def test_turned_axes_give_the_turned_motion(
    scenario: Scenario, pull: tuple[float, float], velocity: tuple[float, float]
) -> None:
    world = scenario.world()
    turn, spin = (TURN, 0.7) if scenario.body.oriented else (0.0, 0.0)
    place, speed, felt = (
        Vec(jnp.asarray(x), jnp.asarray(y)) for x, y in ((11.0, 75.0), velocity, pull)
    )
    path = roll(world, held(felt), state(place, speed, 0.4, spin))
    begin = state(turned(place), turned(speed), 0.4 + turn, spin)
    other = roll(turned_world(world), held(turned(felt)), begin)

    # It hits something: without limbs it would go elsewhere.
    t = 800 * 5e-3
    free = place + speed * t + felt * (t * t / 2)
    assert math.hypot(path.position.x[-1] - free.x, path.position.y[-1] - free.y) > 1.0
    assert np.all(path.status == RUNNING)
    np.testing.assert_array_equal(path.status, other.status)
    for mine, theirs in ((path.position, other.position), (path.velocity, other.velocity)):
        expected = turned(mine)
        np.testing.assert_allclose(theirs.x, expected.x, atol=1e-9)
        np.testing.assert_allclose(theirs.y, expected.y, atol=1e-9)
    apart = np.angle(np.exp(1j * np.asarray(other.angle - path.angle - turn)))
    np.testing.assert_allclose(apart, 0.0, atol=1e-9)
    np.testing.assert_allclose(other.spin, path.spin, atol=1e-9)
