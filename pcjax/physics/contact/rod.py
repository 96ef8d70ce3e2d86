"""What contact with the limbs does to the stick, eqs (14)-(17).

The stick's configuration (x, y, kappa theta) with kappa^2 = I / M = r_o^2 / 3 has the unit matrix
for its mass, per unit of mass. A contact with normal n and lever c = (r x n) is one direction in
it, N = (n, c / kappa), and the impulse (17) a change of velocity along N / (N . N).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from pcjax.geometry import Flag, Scalar, Vec, fence, fence_all, unit_and_length, where
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.motion import Motion
from pcjax.model.scenario import World
from pcjax.physics.contact.touch import Pose, Touch, deepest_touches, depths
from pcjax.physics.response import INACTIVE, time_since_contact
from pcjax.physics.state import RUNNING, State, Watch, judge

_SWEEPS = 2
"""How often in a step the deepest contacts are taken anew and held off together."""

_TOGETHER = 3
"""How many contacts are held off together with the one of the impact."""

_ROUNDS = 12
"""Rounds of Gauss-Seidel among the contacts that are held off together."""


LONGEST_TRAVEL, LARGEST_TURN = 0.5, 0.3
"""What one step of a stick may cover: share of the half length by any of its points, radians."""


class Rod(eqx.Module):
    """The stick at a step's end: its centre's motion, and angle and spin as seen from the hand."""

    centre: Motion
    angle: Scalar
    spin: Scalar

    def pose(self, barrier: Scalar) -> Pose:
        """Where it is."""
        return fence_all(Pose.of(self.centre.position, self.angle), barrier)

    def earlier(self, time: Scalar, barrier: Scalar) -> tuple[Pose, Vec]:
        """Pose and velocity `time` seconds before the end, as seen from the hand."""
        velocity, acceleration = self.centre.relative(), self.centre.acceleration
        back = (acceleration * (0.5 * time) - velocity) * time
        pose = Pose.of(self.centre.position + back, self.angle - self.spin * time)
        return fence_all((pose, velocity - acceleration * time), barrier)

    def kicked(self, kick: Vec, spin: Scalar, since: Scalar, carried: Scalar) -> Rod:
        """After a change of velocity and spin `since` seconds ago, `carried` on for as long."""
        end = self.centre
        kick = end.turned(kick, since)
        centre = Motion(
            end.position + kick * carried, end.velocity + kick, end.acceleration, end.twist
        )
        return Rod(centre, self.angle + spin * carried, self.spin + spin)

    def pushed(self, push: Vec, turn: Scalar) -> Rod:
        """Elsewhere, with the same velocity and spin."""
        end = self.centre
        centre = Motion(end.position + push, end.velocity, end.acceleration, end.twist)
        return Rod(centre, self.angle + turn, self.spin)


def move_stick(
    body: Stick, world: World, state: State, free: Motion, dt: Scalar, barrier: Scalar
) -> State:
    """A step's contact of a stick: its turning, and what it touches."""
    half, skin = body.half_length, body.skin
    # Nothing turns the stick between impacts; the hand turns steadily.
    carried = 0.0 if free.twist is None else free.twist.spin
    spin = state.spin - carried
    turn = spin * dt
    rod = Rod(free, state.angle + turn, spin)
    before = Rod(replace(free, position=state.position), state.angle, spin).pose(barrier)
    moved, penetration, undone = meet_limbs_with_stick(
        body, world, before, state.angle, rod, dt, barrier
    )
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


def meet_limbs_with_stick(
    body: Stick, world: World, before: Pose, angle: Scalar, free: Rod, dt: Scalar, barrier: Scalar
) -> tuple[Rod, Scalar, Flag]:
    """The impact with the deepest contact, then rest and sliding on all that it touches.

    Arguments:
        body: the stick.
        world: with limbs and contact law.
        before, angle: the stick at the start of the step, where it cuts nothing.
        free: at the end of its free motion.

    Returns:
        The stick at the end of the step, how deep it then is in its skin anywhere, and whether the
        step had to be undone. The depth is less than the skin: the stick cuts no limb, and no point
        of either is on another side than before.
    """
    law = world.law
    (met,) = deepest_touches(1, body, world, before, free.pose(barrier), barrier)
    moved = impact(law, body, met, free, dt, barrier)

    def sweep(_: Int[Array, ""], moved: Rod) -> Rod:
        # The impact's contact stays among them, even where another one has been run into so far
        # that the point is beside its segment meanwhile.
        touches = [
            met,
            *deepest_touches(_TOGETHER, body, world, before, moved.pose(barrier), barrier),
        ]
        return hold_off(law, body, touches, moved, dt, barrier)

    moved = jax.lax.fori_loop(0, _SWEEPS, sweep, moved)
    deepest = functools.reduce(
        jnp.maximum,
        [
            jax.lax.stop_gradient(depth)
            for depth in depths(body, world, before, moved.pose(barrier))
        ],
    )
    # Several impacts at once in a narrow corner may be too much for the sweeps. Then the stick
    # stays where it was, where it cuts nothing, with the velocity that they have given it.
    undone = deepest >= body.skin
    end = moved.centre
    centre = Motion(
        where(undone, before.centre, end.position), end.velocity, end.acceleration, end.twist
    )
    angle = jnp.where(undone, angle, moved.angle)
    return Rod(centre, angle, moved.spin), jnp.where(undone, 0.0, deepest), undone


def impact(
    law: ContactLaw, body: Stick, touch: Touch, end: Rod, dt: Scalar, barrier: Scalar
) -> Rod:
    """Resolves the impact (14)-(17) at its time within the step that led to `end`.

    The time follows from the depth at the end of the step and one Newton step at the time so found,
    where stick and normal are as they were then.
    """
    now, velocity = end.earlier(0.0, barrier)
    normal, lever, distance, reach = fence_all(touch.at(now), barrier)
    depth = body.skin - distance
    pressing = -end.centre.acceleration.dot(normal) - touch.bend(
        now, normal, reach, velocity, end.spin
    )
    inwards = -velocity.dot(normal) - end.spin * lever
    since = fence(time_since_contact(inwards, pressing, depth, dt), barrier)

    then, velocity = end.earlier(since, barrier)
    normal, lever, distance, _ = fence_all(touch.at(then), barrier)
    approach = -velocity.dot(normal) - end.spin * lever
    fast = approach > law.resting_speed
    late = jnp.where(fast, (body.skin - distance) / jnp.where(fast, approach, 1.0), 0.0)
    since = fence(jnp.where(depth > 0, jnp.clip(since + late, 0.0, dt), 0.0), barrier)

    then, velocity = end.earlier(since, barrier)
    normal, lever, _, _ = fence_all(touch.at(then), barrier)
    approach = -velocity.dot(normal) - end.spin * lever  # (3): only if positive
    restitution = jnp.where(approach > law.resting_speed, law.restitution, 0.0)
    change = (1.0 + restitution) * jnp.maximum(approach, 0.0)  # (14)
    per_inertia = body.mass / body.inertia
    impulse = law.switch(depth) * change / (1.0 + lever * lever * per_inertia)  # (17) / M_o
    impulse = fence(jnp.where(touch.on, impulse, 0.0), barrier)
    # (15), (16)
    return end.kicked(normal * impulse, lever * per_inertia * impulse, since, since)


def hold_off(
    law: ContactLaw,
    body: Stick,
    touches: Sequence[Touch],
    end: Rod,
    dt: Scalar,
    barrier: Scalar,
) -> Rod:
    """Takes the stick out of its contacts and turns back what still moves it into them.

    As for the circle, with unit vectors along N in place of normals and more than two contacts.
    """
    now, velocity = end.earlier(0.0, barrier)
    per_inertia = body.mass / body.inertia
    ways, needs, stops, gates = [], [], [], []
    for touch in touches:
        normal, lever, distance, reach = fence_all(touch.at(now), barrier)
        depth = body.skin - distance
        size = jnp.sqrt(1.0 + lever * lever * per_inertia)
        approach = -velocity.dot(normal) - end.spin * lever
        pressing = -end.centre.acceleration.dot(normal) - touch.bend(
            now, normal, reach, velocity, end.spin
        )
        resting = law.resting_speed + jnp.maximum(pressing, 0.0) * dt
        stop = approach * (1.0 + jnp.where(approach > resting, law.restitution, 0.0))
        way, lever = normal * (1.0 / size), lever / size
        ways.append(fence_all((way, lever), barrier))
        needs.append(fence(jnp.where(touch.on, law.ramp(depth) / size, INACTIVE), barrier))
        stops.append(fence(stop / size, barrier))
        gates.append(jnp.where(touch.on, law.switch(depth), 0.0))
    overlaps = [
        [way.dot(other) + lever * turned * per_inertia for other, turned in ways]
        for way, lever in ways
    ]
    pushes = [fence(push, barrier) for push in _least_pushes(overlaps, needs, barrier)]
    # Also what the other contacts push the stick against turns it back.
    gates = [
        jnp.where((need <= 0) & (push > 0), 1.0, gate)
        for need, push, gate in zip(needs, pushes, gates, strict=True)
    ]
    turns = [jnp.where(gate > 0, stop, INACTIVE) for gate, stop in zip(gates, stops, strict=True)]
    turns = _least_pushes(overlaps, [fence(turn, barrier) for turn in turns], barrier)
    held = end
    for (way, lever), gate, push, turn in zip(ways, gates, pushes, turns, strict=True):
        turn = fence(gate * turn, barrier)
        held = held.pushed(way * push, lever * per_inertia * push)
        held = held.kicked(way * turn, lever * per_inertia * turn, 0.5 * dt, 0.0)
    return held


def _least_pushes(
    overlaps: Sequence[Sequence[Scalar]], needs: Sequence[Scalar], barrier: Scalar
) -> list[Scalar]:
    """`response.least_push` for more than two unit vectors, by projected Gauss-Seidel."""

    def once(_: Int[Array, ""], pushes: list[Scalar]) -> list[Scalar]:
        for k, need in enumerate(needs):
            others = [overlaps[k][m] * pushes[m] for m in range(len(needs)) if m != k]
            pushes[k] = fence(jnp.maximum(need - sum(others), 0.0), barrier)
        return pushes

    return jax.lax.fori_loop(0, _ROUNDS, once, [0.0 * need for need in needs])
