"""Flights of convex bodies among limbs: energy, momentum, mirrors, derivatives, limits."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pcjax
from pcjax.model.bodies.base import Body
from pcjax.physics.state import INVALID, RUNNING
from pcjax.physics.tumbling.flight import Tumble
from tests.flights import BEGIN, STEADY, flown, leap, pulled, released
from tests.reference.polygon import collide

pytestmark = pytest.mark.usefixtures("quick_programs")

TRIANGLE = ((0.0, 0.0), (80.0, 0.0), (0.0, 60.0))


def test_energy_never_grows_and_a_mirror_changes_nothing() -> None:
    """100 flights of a triangle that knocks about a box with friction, each with its mirror image,
    some hundred leaps with some fifty contacts each."""
    law = pcjax.ContactLaw(restitution=0.4, friction=0.4)
    seconds, leaps, count = 30.0, 400, 100

    @jax.jit
    def followed(body: Body, first: Tumble, pull: jax.Array) -> tuple[Tumble, jax.Array]:
        world = pcjax.does(pcjax.box_hand(), body, STEADY, law).world()
        gyration = 1 / world.shape.per_gyration

        def energy(flight: Tumble) -> jax.Array:
            turning = flight.spin * gyration
            kinetic = (flight.velocity.dot(flight.velocity) + turning * turning) / 2
            return kinetic - pull[0] * flight.position.x - pull[1] * flight.position.y

        def one(flight: Tumble, _: None) -> tuple[Tumble, jax.Array]:
            new = leap(world, pulled(pull[0], pull[1]), flight, seconds)
            return new, energy(new) - energy(flight)

        flight, gains = jax.lax.scan(one, first, length=leaps)
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
        every = jax.vmap(followed, in_axes=(None, 0, 0))
        flight, gains = every(body, released((x, y), (vx, vy), angle, spin), pull)
        # Mirrored along its own x axis, so turned by half a turn besides.
        image, image_gains = every(
            body.mirrored(),
            released((-x, y), (-vx, vy), math.pi - angle, -spin),
            pull * jnp.array([-1.0, 1.0]),
        )
        flight, image, gains = jax.device_get((flight, image, jnp.maximum(gains, image_gains)))
    whole = flight.time >= BEGIN + seconds
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
        world = pcjax.does(pcjax.box_hand(), pcjax.Square(side, 3.0), STEADY, law).world()
        zero = 0.0 * side
        first = released((zero, zero + 80.0), (speed, zero), angle, spin)
        flight = flown(world, pulled(zero + 1.0, zero - 9.8), first, seconds)
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


def test_friction_does_not_drive_what_it_has_stopped() -> None:
    """A square that chatters, all but at rest, in 32 bits: clearing away an approach of its corners
    turns its tiny slip. It is pulled with less than its grip, so that it stays."""

    @jax.jit
    def rested(first: Tumble) -> Tumble:
        law = pcjax.ContactLaw(restitution=1.0, friction=0.3)
        world = pcjax.does(pcjax.box_hand(), pcjax.Square(70.0, 0.5), STEADY, law).world()
        zero = 0.0 * first.spin
        return flown(world, pulled(zero - 1.2767842, zero - 9.716472), first, 3.0)

    place, velocity = (-195.27998, 35.000473), (0.0015794538, -0.031667043)
    (x, y), (vx, vy) = map(jnp.asarray, place), map(jnp.asarray, velocity)
    first = released((x, y), (vx, vy), jnp.asarray(-1.5707978), jnp.asarray(-0.0006711223))
    end = rested(first)
    assert float(end.position.x) == pytest.approx(place[0], abs=0.01)
    assert float(jnp.hypot(end.velocity.x, end.velocity.y)) < 0.2


def test_a_flat_landing_is_one_impact_in_its_middle() -> None:
    """A square that lands flat, sliding: one impulse in the middle of its base, with e = 1, both
    ways and in both precisions. After it neither corner approaches."""
    friction, side, fall, slip = 0.1, 60.0, 50.0, 40.0
    body = pcjax.Square(side, 0.5)

    @jax.jit
    def landed(first: Tumble) -> Tumble:
        law = pcjax.ContactLaw(restitution=1.0, friction=friction)
        world = pcjax.does(pcjax.box_hand(), body, STEADY, law).world()
        zero = 0.0 * first.spin
        return leap(world, pulled(zero, zero - 9.8), first, 1e-4)

    for bits in (32, 64):
        with jax.enable_x64(bits == 64):
            for way in (1.0, -1.0):
                place, velocity = (0.0, side / 2), (way * slip, -fall)
                (x, y), (vx, vy) = map(jnp.asarray, place), map(jnp.asarray, velocity)
                end = landed(released((x, y), (vx, vy), jnp.asarray(0.0), jnp.asarray(0.0)))
                rubbed = -way * friction * 2 * fall
                assert float(end.velocity.y) == pytest.approx(fall, rel=1e-4)
                assert float(end.velocity.x) == pytest.approx(way * slip + rubbed, rel=1e-4)
                spin = rubbed * (side / 2) * float(body.per_gyration) ** 2
                assert float(end.spin) == pytest.approx(spin, rel=1e-4)


@pytest.mark.parametrize(("restitution", "friction"), [(0.1, 0.0), (0.1, 0.1), (0.6, 0.1)])
def test_a_body_that_wedges_meets_one_impact_after_the_other(
    restitution: float, friction: float
) -> None:
    """A triangle slides along a finger until its slope hits the fingertip's end: some twenty
    impacts of finger and tip in turn, by a plain loop with the reference's law for one of them."""
    speed, resting = 155.0, 0.05
    body = pcjax.Polygon(TRIANGLE, 1.0)
    hand = pcjax.box_hand(math.radians(-20), gap_width=400.0)
    with jax.enable_x64(True):
        tip = np.array([float(part) for part in jax.tree.leaves(hand.limbs()[3].end)])
        own = np.array([[float(one.x), float(one.y)] for one in body.vertices])
        per_gyration = float(body.per_gyration)
        lower, right, upper = own[np.argsort(own @ [1.0, 10.0])][[0, 1, 2]]
        slope = np.array([upper[1] - right[1], right[0] - upper[0]])
        slope /= np.linalg.norm(slope)
        x = float(hand.limbs()[1].start.x) + 1.0 - lower[0]
        y = tip[1] - (slope @ right + 1.0 - slope[0] * (tip[0] - x)) / slope[1]
        side = np.array([1.0, 0.0])
        contacts = [(side, upper - side), (side, lower - side), (-slope, tip - [x, y])]

        velocity, spin = np.array([0.0, speed]), 0.0
        while True:
            closing = [
                -(velocity + spin * np.array([-lever[1], lever[0]])) @ normal
                for normal, lever in contacts
            ]
            k = int(np.argmax(closing))
            if closing[k] <= resting:
                break
            normal, lever = contacts[k]
            along = np.array([-normal[1], normal[0]])
            cn, ct = (
                per_gyration * (lever[0] * way[1] - lever[1] * way[0]) for way in (normal, along)
            )
            slip = (velocity + spin * np.array([-lever[1], lever[0]])) @ along
            push, rub = collide(closing[k], slip, cn, ct, friction, restitution)
            velocity = velocity + push * normal + rub * along
            spin += per_gyration * (push * cn + rub * ct)

        law = pcjax.ContactLaw(restitution, resting, friction=friction or None)
        scenario = pcjax.does(hand, body, STEADY, law)

        @jax.jit
        def wedged(first: Tumble) -> Tumble:
            zero = 0.0 * first.spin
            return flown(scenario.world(), pulled(zero, zero), first, 1.001 / speed)

        zero = jnp.asarray(0.0)
        start = released((zero + x, zero + y - 1.0), (zero, zero + speed), zero, zero)
        end = wedged(start)
    found = [float(end.velocity.x), float(end.velocity.y), float(end.spin) / per_gyration]
    expected = [*velocity, spin / per_gyration]
    np.testing.assert_allclose(found, expected, atol=4 * resting)


def test_a_body_stays_in_its_corner_for_as_long_as_the_pull_stays() -> None:
    """Without friction nothing but its contacts holds a stick; for 3,000 s in 32 bits."""

    @jax.jit
    def rested(first: Tumble) -> Tumble:
        law = pcjax.ContactLaw(restitution=0.0)
        world = pcjax.does(pcjax.box_hand(), pcjax.Stick(35.0), STEADY, law).world()
        zero = 0.0 * first.spin
        return flown(world, pulled(zero + 1.0, zero - 9.7), first, 3000.0)

    zero = jnp.zeros(20)
    x = jnp.linspace(-50.0, 50.0, 20)
    end = jax.vmap(rested)(released((x, zero + 100.0), (zero + 20.0, zero), zero + 0.3, zero))
    assert np.all(np.asarray(end.status) == RUNNING)
    assert np.all(np.asarray(end.time) >= BEGIN + 3000.0)
    # Along the palm, or on end in the corner.
    assert np.all(np.minimum(abs(end.position.y), abs(end.position.y - 35.0)) < 0.01)


def test_a_circle_rolls_over_a_fingertip_as_a_pendulum_in_few_leaps() -> None:
    """Pressed against a fingertip's end by a pull along the finger, it rolls about it: without
    slipping v^2 = 4/3 g r (cos a_0 - cos a), until a is some 55 degrees. Leaps that end where it
    crosses the plane through the end are 3,000."""
    pull, first_angle, seconds = 9.8, 0.1, 7.0
    circle = pcjax.Circle(50.0)
    hand = pcjax.box_hand(0.0, fingertip_length=100.0)

    @jax.jit
    def rolled(body: Body) -> Tumble:
        world = pcjax.does(hand, body, STEADY, pcjax.ContactLaw(friction=3.0)).world()
        end = world.limbs[3].end
        place = end.x + 50.0 * math.sin(first_angle), end.y - 50.0 * math.cos(first_angle)
        zero = jnp.zeros(())
        first = released(place, (zero, zero), zero, zero)
        return flown(world, pulled(zero, zero + pull), first, seconds)

    with jax.enable_x64(True):
        flight = jax.device_get(rolled(jax.tree.map(jnp.asarray, circle)))
        end = hand.limbs()[3].end
    across, below = flight.position.x - float(end.x), float(end.y) - flight.position.y
    angle = math.atan2(across, below)
    assert 0.5 < angle < 0.95
    assert math.hypot(across, below) == pytest.approx(50.0, abs=1e-5)
    speed = math.hypot(flight.velocity.x, flight.velocity.y)
    square = 4 / 3 * pull * 50.0 * (math.cos(first_angle) - math.cos(angle))
    assert speed == pytest.approx(math.sqrt(square), rel=2e-5)
    assert abs(flight.spin) * 50.0 == pytest.approx(speed, rel=1e-5)
    assert flight.leaps < 600
