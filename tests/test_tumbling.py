"""Flights of convex bodies among limbs: energy, momentum, mirrors, derivatives, limits."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pcjax
from pcjax.geometry import Vec
from pcjax.model.bodies.base import Body
from pcjax.model.drives.wrist import TiltProfile
from pcjax.physics.state import INVALID, RUNNING
from pcjax.physics.tumbling.flight import Tumble
from pcjax.physics.tumbling.leap import tumble

pytestmark = pytest.mark.usefixtures("quick_programs")

WRIST = pcjax.WristTilt(ramp_time=0.1, period=1e4)
"""Flights begin after its ramp, so that the pull stays."""

TRIANGLE = ((0.0, 0.0), (80.0, 0.0), (0.0, 60.0))


def first_of(place: Any, velocity: Any, angle: Any, spin: Any) -> Tumble:
    zero = jnp.zeros_like(spin)
    count = jnp.zeros(zero.shape, jnp.int32)
    return Tumble(Vec(*place), Vec(*velocity), angle, spin, zero + 0.1, count, count, zero)


def pulled(pull: Any) -> TiltProfile:
    none = Vec(0.0 * pull[0], 0.0 * pull[0])
    return TiltProfile(none, none, Vec(pull[0], pull[1]))


def test_energy_never_grows_and_a_mirror_changes_nothing() -> None:
    """100 flights of a triangle that knocks about a box with friction, each with its mirror image,
    some hundred leaps with some fifty contacts each."""
    law = pcjax.ContactLaw(restitution=0.4, friction=0.4)
    seconds, leaps, count = 30.0, 400, 100

    @jax.jit
    def flown(body: Body, first: Tumble, pull: jax.Array) -> tuple[Tumble, jax.Array]:
        world = pcjax.does(pcjax.box_hand(), body, WRIST, law).world()
        gyration = 1 / world.shape.per_gyration

        def energy(flight: Tumble) -> jax.Array:
            turning = flight.spin * gyration
            kinetic = (flight.velocity.dot(flight.velocity) + turning * turning) / 2
            return kinetic - pull[0] * flight.position.x - pull[1] * flight.position.y

        def leap(flight: Tumble, _: None) -> tuple[Tumble, jax.Array]:
            zero = flight.spin * 0
            new = tumble(world, pulled(pull), zero + 1.0, flight, zero + 0.1 + seconds)
            return new, energy(new) - energy(flight)

        flight, gains = jax.lax.scan(leap, first, length=leaps)
        return flight, gains.max()

    rng = np.random.default_rng(3)

    def uniform(most: float) -> jax.Array:
        return jnp.asarray(rng.uniform(-most, most, count))

    with jax.enable_x64(True):
        body = jax.tree.map(jnp.asarray, pcjax.Polygon(TRIANGLE, 1.0))
        x, vx = uniform(80.0), uniform(60.0)
        y, vy = 200 + uniform(100.0), uniform(60.0)
        angle, spin = uniform(3.0), uniform(2.0)
        lean = uniform(0.5)
        pull = 9.8 * jnp.stack([jnp.sin(lean), -jnp.cos(lean)], 1)
        every = jax.vmap(flown, in_axes=(None, 0, 0))
        flight, gains = every(body, first_of((x, y), (vx, vy), angle, spin), pull)
        # Mirrored along its own x axis, so turned by half a turn besides.
        image, image_gains = every(
            body.mirrored(),
            first_of((-x, y), (-vx, vy), math.pi - angle, -spin),
            pull * jnp.array([-1.0, 1.0]),
        )
        flight, image, gains = jax.device_get((flight, image, jnp.maximum(gains, image_gains)))
    whole = flight.time >= 0.1 + seconds
    assert whole.mean() > 0.5
    assert np.all(flight.status != INVALID)
    most = 0.5 * 60**2 + 0.5 * 60**2 + 9.8 * 600
    assert gains.max() < 1e-5 * most
    assert np.mean(np.abs(flight.velocity.y) < 1e-3) > 0.1  # some have come to rest
    same = np.hypot(image.position.x + flight.position.x, image.position.y - flight.position.y)
    turned = np.cos(image.angle + flight.angle) + 1
    # Impacts multiply rounding errors, so that a few go other ways.
    assert np.mean((same < 1e-3) & (turned < 1e-6)) > 0.9


def test_derivatives_go_through_impacts() -> None:
    """A square falls on a corner and tumbles on; friction .3 slips and 1.5 sticks. Against central
    differences in float64."""
    seconds = 6.0

    def end(inputs: jax.Array) -> jax.Array:
        restitution, friction, side, spin, speed, angle = inputs
        law = pcjax.ContactLaw(restitution=restitution, friction=friction)
        world = pcjax.does(pcjax.box_hand(), pcjax.Square(side, 3.0), WRIST, law).world()
        zero = 0.0 * side
        first = first_of((zero, zero + 80.0), (speed, zero), angle, spin)
        profile = pulled((zero + 1.0, zero - 9.8))

        def going(flight: Tumble) -> jax.Array:
            still = (flight.time < 0.1 + seconds) & (flight.status == RUNNING)
            return still & (flight.leaps < 400)

        def leap(flight: Tumble) -> Tumble:
            return tumble(world, profile, zero + 1.0, flight, zero + 0.1 + seconds)

        flight = jax.lax.while_loop(going, leap, first)
        place, velocity = flight.position, flight.velocity
        return jnp.stack([place.x, place.y, flight.angle, flight.spin, velocity.x, velocity.y])

    derivative, value = jax.jit(jax.jacfwd(end)), jax.jit(end)
    with jax.enable_x64(True):
        for friction in (0.3, 1.5):
            inputs = jnp.array([0.5, friction, 60.0, 0.3, 10.0, 0.2])
            found = np.asarray(derivative(inputs))
            for k in range(len(inputs)):
                step = 1e-5 * max(abs(float(inputs[k])), 0.1)
                up, down = value(inputs.at[k].add(step)), value(inputs.at[k].add(-step))
                difference = np.asarray(up - down) / (2 * step)
                size = np.abs(difference).max()
                np.testing.assert_allclose(
                    found[:, k], difference, rtol=1e-4, atol=1e-5 * size + 1e-9
                )
