"""Exact derivatives of a circle's trajectory, forward along the leaps of the event-driven engine.

In between events the motion is known in closed form, so a leap may end anywhere and its length is
not differentiated; where it ends at an event, a Newton step on the time of that event, of which
only the derivative is kept, makes up for it. At an impact that is the saltation matrix.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pcjax.geometry import Flag, Scalar, Vec, runtime_barrier, unit_and_length, where
from pcjax.model.motion import Swing
from pcjax.model.scenario import Scenario, World
from pcjax.physics.contact.circle import two_nearest
from pcjax.physics.state import INVALID, RUNNING
from pcjax.physics.step import begin
from pcjax.simulate import leaping
from pcjax.simulate.draws import start_draws
from pcjax.simulate.leaping import Flight, Support, Way
from pcjax.simulate.relaxation import NOWHERE, Excursion, Layer

X, PEAK, HELD = slice(0, 4), 4, 5
"""Where a trial's numbers are: x, y, vx, vy; the excursion's peak; seconds held."""

DRIFT, BUDGET = 4e-4, 2_000
"""As the engine's: see `pcjax.simulate.bursts.LeapingEngine`."""

SLOWEST = 0.02
"""Share of the resting speed below which what touches a limb is not taken for an impact."""


def at_event(world: World, flight: Flight, pull: Vec, slid: Flag) -> Flight:
    """The flight at the end of a leap, with the derivative that it has at the event there.

    Arguments:
        pull: the acceleration there, with what the limbs do to it.
        slid: whether the leap went along a limb's flat side.
    """
    radius, near = world.contact_radius, world.nearness()
    tau = fastest = 0.0 * flight.time
    for contact in two_nearest(world.limbs, flight.position, runtime_barrier(flight.leaps, radius)):
        normal, distance = unit_and_length(contact.offset)
        gap, approach = distance - radius, -flight.velocity.dot(normal)
        hits = (gap <= near) & (approach > SLOWEST * world.law.resting_speed)
        first = hits & (approach > fastest)
        tau = jnp.where(first, gap / jnp.where(hits, approach, 1.0), tau)
        fastest = jnp.where(first, approach, fastest)
        # Off the end of the limb that it slid along, where the acceleration jumps.
        limb = contact.limb
        along = (flight.position - limb.start).dot(limb.tangent)
        beyond = jnp.where(along > 0.5 * limb.length, along - limb.length, along)
        speed = flight.velocity.dot(limb.tangent)
        leaves = slid & contact.round & (gap <= near) & (jnp.abs(beyond) < 64 * near)
        leaves = leaves & (jnp.abs(speed) > 1e-6) & (fastest <= 0)
        tau = jnp.where(leaves, -beyond / jnp.where(leaves, speed, 1.0), tau)
    tau = jnp.where(flight.status == RUNNING, tau - jax.lax.stop_gradient(tau), 0.0)
    return replace(
        flight,
        position=flight.position + (flight.velocity + pull * (0.5 * tau)) * tau,
        velocity=flight.velocity + pull * tau,
        time=flight.time + tau,
    )


def leapt(world: World, swing: Swing, longest: Scalar, flight: Flight) -> Flight:
    """`pcjax.simulate.leaping.leap` with the derivative of the trajectory.

    The leap is the engine's; its length is not differentiated, but for one that ends with gravity's
    stretch.
    """
    after = leaping.leap(world, swing, longest, jax.lax.stop_gradient(flight))
    radius = world.contact_radius
    barrier = runtime_barrier(flight.leaps, radius)
    pull = Way(swing.around(flight.time))
    turning = swing.turning(flight.time)
    change = jnp.where(turning, swing.turns_until, swing.until)
    left = change - flight.time
    contacts = two_nearest(world.limbs, flight.position, barrier)
    most = jnp.where(turning, jnp.minimum(left, longest), left)
    support = leaping.settle(world, contacts, flight, pull, turning, most, barrier)
    whole = after.time >= change
    wait = jnp.where(whole, left, jax.lax.stop_gradient(after.time - flight.time))
    position, velocity = leaping._move(support, radius, pull, wait)
    moves = (flight.status == RUNNING) & (flight.time < swing.until)
    reached = Flight(
        where(moves, position, flight.position),
        where(moves, velocity, flight.velocity),
        jnp.where(moves, jnp.where(whole, change, flight.time + wait), flight.time),
        after.leaps,
        after.status,
    )
    slid = moves & support.carried & jnp.logical_not(support.rolls)
    return at_event(world, reached, _arriving(support, pull, velocity, radius, wait), slid)


def _arriving(support: Support, pull: Way, velocity: Vec, radius: Scalar, wait: Scalar) -> Vec:
    """The acceleration at a leap's end, with what the limbs do to it."""

    def at_end(way: Way) -> Vec:
        a, b, c, d = way.powers
        return a + (b + (c + d * wait) * wait) * wait

    # On an arc: gravity along it, and towards its middle.
    tangent, speed = unit_and_length(velocity)
    inwards = Vec(-tangent.y, tangent.x)
    side = jnp.where(inwards.dot(support.normal) < 0, 1.0, -1.0)
    arc = tangent * at_end(pull).dot(tangent) + inwards * (side * speed * speed / radius)
    return where(support.rolls & support.carried, arc, at_end(support.way))


class Ended(NamedTuple):
    """How a period left a trial: its numbers, its status and the leaps that it took."""

    numbers: Float[Array, "6"]
    status: Array
    leaps: Array


def after_period(
    scenario: Scenario,
    share: Scalar,
    numbers: Float[Array, "6"],
    before: Float[Array, "2"],
    draws: Float[Array, "2"],
    first: Flag,
    status: Array,
) -> Ended:
    """A trial after one more period, differentiable forwards in everything.

    Arguments:
        share: half width of the goal's layer, in depths of the channel.
        numbers: at the period's start.
        before, draws: of the period before and of this one.
        first: whether there is none before.
    """
    world = scenario.world()
    channel = scenario.hand.channel()
    layer = Layer(channel, share * channel.depth())
    world = replace(world, goal=layer.farthest_goal())
    profile = world.drive.profile(before, draws, first)
    drift = DRIFT * world.contact_radius
    longest, zero = world.drive.steady_interval(drift), 0.0 * numbers[0]
    x, y, u, v = (numbers[k] for k in range(4))
    flight = Flight(Vec(x, y), Vec(u, v), zero, jnp.int32(0), status)
    excursion = Excursion(numbers[PEAK], zero, numbers[HELD])

    def going(carry: tuple[Flight, Excursion, Scalar]) -> Array:
        flight, _, _ = carry
        over = flight.time >= world.drive.period
        return jnp.logical_not(over) & (flight.status == RUNNING) & (flight.leaps < BUDGET)

    def go(carry: tuple[Flight, Excursion, Scalar]) -> tuple[Flight, Excursion, Scalar]:
        flight, excursion, since = carry
        until = world.drive.swing(jax.lax.stop_gradient(profile), since, drift).until
        since = jax.lax.stop_gradient(jnp.where(flight.time >= until, until, since))
        swing = world.drive.swing(profile, since, drift)
        then = leapt(world, swing, longest + 0.0 * since, flight)
        lasted = then.time - flight.time
        excursion = layer.follow_leap(
            excursion, flight.position, then.position, then.velocity, lasted
        )
        return replace(then, status=layer.verdict(then.status, excursion)), excursion, since

    flight, excursion, _ = jax.lax.while_loop(going, go, (flight, excursion, zero))
    spent = (flight.leaps >= BUDGET) & (flight.status == RUNNING)
    at, speed = flight.position, flight.velocity
    ended = jnp.stack([at.x, at.y, speed.x, speed.y, excursion.peak, excursion.survival_time])
    return Ended(ended, jnp.where(spent, INVALID, flight.status), flight.leaps)


def started(scenario: Scenario, key: Array) -> Float[Array, "6"]:
    """A trial's numbers at its start."""
    state = begin(scenario, start_draws(key, scenario.draws_for_start))
    none = 0.0 * state.position.x
    at, speed = state.position, state.velocity
    return jnp.stack([at.x, at.y, none + speed.x, none + speed.y, none + NOWHERE, none])
