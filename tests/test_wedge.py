"""A corner between two limbs: one impact (7) after the other, in both engines, by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pcjax.geometry import Vec
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import TiltProfile, WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import Scenario, World, does
from pcjax.physics.response import Angle, least_push
from pcjax.physics.state import RUNNING, State, at_rest
from pcjax.physics.step import step
from pcjax.simulate.leaping import Flight, leap

pytestmark = pytest.mark.usefixtures("x64")

RADIUS, SPEED, RESTING = 5.0, 40.0, 0.05
ANGLES = (15, 20, 30, 45, 60, 75, 85, 90, 95, 105, 120, 135, 150, 165)
RESTITUTIONS = (0.0, 0.1, 0.5, 0.9, 1.0)


def after(degrees: float, restitution: float, velocity: tuple[float, float]) -> np.ndarray:
    """The velocity that successive impacts give, by a plain loop without a bound.

    The corner is between a floor and a limb that rises at this angle from it on the right.
    """
    w = math.radians(degrees)
    normals = np.array([[0.0, 1.0], [-math.sin(w), -math.cos(w)]])
    v = np.array(velocity)
    while True:
        k = int(np.argmin(normals @ v))
        approach = -float(normals[k] @ v)
        if approach <= RESTING:
            break
        v = v + (1 + restitution) * approach * normals[k]
    # What is slower than a resting contact has come to rest on one limb, or on both.
    for k in (0, 1):
        if normals[k] @ v < 0:
            alone = v - (normals[k] @ v) * normals[k]
            v = alone if normals[1 - k] @ alone >= -1e-12 else np.zeros(2)
    return v


def corner(degrees: float, restitution: float) -> tuple[World, Scenario]:
    """A floor with a limb at its right end, no gravity."""
    lean = math.radians(180 - degrees)
    hand = HandDesign(1000.0, ((10.0,), (400.0,)), ((math.pi / 2,), (lean,)))
    law = ContactLaw(restitution, RESTING)
    scenario = does(hand, Circle(RADIUS), WristTilt(gravity=0.0), law, start_spread=0.0)
    return scenario.world(), scenario


WAYS = {"sliding in": (SPEED, 0.0), "into the limb": (SPEED, -3.0), "into the floor": (12.0, -30.0)}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("restitution", RESTITUTIONS)
def test_both_engines_give_what_successive_impacts_give(restitution: float, way: str) -> None:
    event = jax.jit(leap)
    for degrees in ANGLES:
        world, scenario = corner(degrees, restitution)
        drive = scenario.drive
        profile = drive.profile(jnp.zeros(2), jnp.zeros(2), first=True)
        velocity = Vec(*map(jnp.asarray, WAYS[way]))
        touch = 500.0 - RADIUS / math.tan(math.radians(degrees) / 2)
        expected = after(degrees, restitution, WAYS[way])
        zero = jnp.zeros((), jnp.int32)

        flight = Flight(
            Vec(jnp.asarray(touch), jnp.asarray(RADIUS)), velocity, jnp.zeros(()), zero, zero
        )
        swing = drive.swing(profile, flight.time, 1e-3)
        flight = event(world, swing, jnp.asarray(1.0), flight)
        assert int(flight.status) == RUNNING
        got = np.array([flight.velocity.x, flight.velocity.y])
        np.testing.assert_allclose(got, expected, atol=2e-3 * SPEED, err_msg=f"event, {degrees}")

        if way != "sliding in":  # both limbs at the same instant: steps may take either first
            continue
        # A step resolves some of the impacts, so it takes a few, so short that it stays there.
        dt = 1e-7
        back = velocity * (-0.5 * dt)
        state = replace(at_rest(Vec(touch + back.x, RADIUS + back.y)), velocity=velocity)
        state = steps(scenario, profile, state, dt)
        got = np.array([state.velocity.x, state.velocity.y])
        np.testing.assert_allclose(got, expected, atol=2e-3 * SPEED, err_msg=f"step, {degrees}")


@jax.jit
def steps(scenario: Scenario, profile: TiltProfile, state: State, dt: float) -> State:
    return jax.lax.fori_loop(0, 400, lambda _, s: step(scenario, profile, s, dt), state)


def test_a_limb_that_is_slid_on_gives_its_restitution() -> None:
    # Sliding on the floor into a limb that leans over it by 15 degrees: thrown down by it, and up
    # again by the floor. One joint impact would leave the circle on the floor.
    w = math.radians(75)
    down = 1.64 * SPEED * math.sin(w)  # along the limb's normal, (-sin w, -cos w)
    assert after(75, 0.64, (SPEED, 0.0))[1] == pytest.approx(0.64 * down * math.cos(w), rel=1e-12)


@pytest.mark.parametrize("degrees", [1e-3, 0.01, 0.1, 1.0, 30.0, 90.0, 150.0, 178.0])
def test_least_pushes_do_for_limbs_at_any_angle(degrees: float) -> None:
    rng = np.random.default_rng(0)
    a = np.array([0.0, 1.0])
    w = math.radians(degrees)
    b = np.array([math.sin(w), math.cos(w)])
    angle = Angle.between(Vec(*a), Vec(*b))
    for needs in rng.normal(size=(200, 2)):
        pushes = np.array(least_push(angle, *map(jnp.asarray, needs)))
        assert (pushes >= 0).all()
        moved = pushes[0] * a + pushes[1] * b
        size = np.abs(needs).max() + pushes.max()
        assert moved @ a >= needs[0] - 1e-9 * size
        assert moved @ b >= needs[1] - 1e-9 * size
        # Never more than is needed, but for limbs so nearly in line that one push does for both.
        over = min(pushes[0] * abs(moved @ a - needs[0]), pushes[1] * abs(moved @ b - needs[1]))
        assert over <= 1e-6 * size * size
