"""What a contact does: impacts (7) at their time within the step, and being held off the limbs."""

from __future__ import annotations

import functools

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.model.contact_law import ContactLaw
from pcjax.model.motion import Motion
from pcjax.physics.collide import Contact
from pcjax.planar import Scalar, Vec, fence, fence_all, safe_sqrt, unit_and_length

INACTIVE = -1e30
"""A bound that never binds, for a contact that is off."""

MOST_IMPACTS = 16
"""Impacts that two limbs may deal a circle in turn at one instant, before both hold it.

In a corner of 15 degrees that leaves less than a thousandth of the speed undecided."""


def bounce(
    law: ContactLaw,
    contacts: tuple[Contact, Contact],
    radius: Scalar,
    end: Motion,
    dt: Scalar,
    one: Scalar,
) -> Motion:
    """Resolves an impact with each of two limbs at its time within the step that led to `end`.

    The time since an impact follows from the penetration at the end of the step, the normal is
    taken at the impact, the impulse (7) acts there, and what it changes of the velocity is carried
    on to the end of the step. The limb that was reached first comes first (its time once refined,
    so that a limb's round end is met to second order); the other one is met on the way that is left
    from there. On straight limbs under constant acceleration both are exact, unless the second
    impact sends the circle back to the first limb within the step.
    """

    def begun(end: Motion, normal: Vec, penetration: Scalar, longest: Scalar) -> Scalar:
        inwards, pressing = -end.relative().dot(normal), -end.acceleration.dot(normal)
        return fence(time_since_contact(inwards, pressing, penetration, longest), one)

    def kicked(end: Motion, normal: Vec, penetration: Scalar, since: Scalar) -> Motion:
        approach = -(end.relative() - end.acceleration * since).dot(normal)  # (3): only if positive
        restitution = jnp.where(approach > law.resting_speed, law.restitution, 0.0)
        change = law.switch(penetration) * (1.0 + restitution) * jnp.maximum(approach, 0.0)  # (7)
        kick = fence_all(end.turned(normal * fence(change, one), since), one)
        return Motion(end.position + kick * since, end.velocity + kick, end.acceleration, end.carry)

    seen = [unit_and_length(contact.offset) for contact in contacts]
    depths = [radius - distance for _, distance in seen]
    times = [begun(end, normal, depth, dt) for (normal, _), depth in zip(seen, depths, strict=True)]
    swapped = times[1] > times[0]
    first, second = (
        jax.tree.map(functools.partial(jnp.where, swapped), contacts[1 - k], contacts[k])
        for k in (0, 1)
    )
    penetration = jnp.where(swapped, depths[1], depths[0])

    back = _way_back(end, jnp.maximum(times[0], times[1]))
    normal, distance = first.after(back)
    # How deep the end of the step lies below the tangent plane at the estimated impact.
    depth = radius - distance + normal.dot(back)
    since = jnp.where(penetration > 0, begun(end, normal, depth, dt), 0.0)
    normal, _ = first.after(_way_back(end, since))
    moved = kicked(end, normal, penetration, since)

    move = moved.position - end.position
    normal, distance = second.after(move)
    since = begun(moved, normal, radius - distance, since)
    later, _ = second.after(move + _way_back(moved, since))
    return kicked(moved, later, radius - distance, since)


def _way_back(end: Motion, time: Scalar) -> Vec:
    """From where the motion ends to where it was `time` seconds earlier, as seen from the hand."""
    return (end.acceleration * (0.5 * time) - end.relative()) * time


def time_since_contact(
    inwards: Scalar, pressing: Scalar, penetration: Scalar, longest: Scalar
) -> Scalar:
    """Seconds before the end of the step at which a penetration began, in [0, longest].

    With speed u and acceleration a into the limb, penetration = u s - a s^2 / 2.
    """
    denominator = inwards + safe_sqrt(inwards * inwards - 2.0 * pressing * penetration)
    entered = (penetration > 0) & (denominator > 0)
    since = 2.0 * penetration / jnp.where(entered, denominator, 1.0)
    since = jnp.where(entered, jnp.minimum(since, longest), longest)
    return jnp.where(penetration > 0, since, 0.0)


def hold_off(
    law: ContactLaw,
    contacts: tuple[Contact, Contact],
    radius: Scalar,
    end: Motion,
    move: Vec,
    dt: Scalar,
    one: Scalar,
) -> Motion:
    """Takes the circle out of both limbs and turns back what still moves it into them.

    This keeps a sliding circle on its limb and a resting one in its corner, where approach is no
    more than the step's acceleration makes it; on a straight limb it leaves the motion along the
    limb untouched. Faster approaches are impacts more in the same step (`impacts_in_turn`).

    Arguments:
        contacts: as seen from the end of the step's free motion.
        end: the motion after the impacts.
        move: from the end of the free motion to `end.position`.
    """
    normals, depths = [], []
    for contact in contacts:
        normal, distance = contact.after(move)
        normals.append(normal)
        depths.append(fence(radius - distance, one))
    angle = Angle.between(*normals)
    out = least_push(angle, *(law.ramp(depth) for depth in depths))
    gates = [law.switch(depth) for depth in depths]
    leaving, resting = [], []
    for gate, normal in zip(gates, normals, strict=True):
        leaving.append(fence(jnp.where(gate > 0, end.relative().dot(normal), -INACTIVE), one))
        pressing = jnp.maximum(-end.acceleration.dot(normal), 0.0)
        resting.append(fence(law.resting_speed + pressing * dt, one))
    turn = impacts_in_turn(law, angle, (leaving[0], leaving[1]), (resting[0], resting[1]))
    position, velocity = end.position, end.velocity
    for normal, gate, push, stop in zip(normals, gates, out, turn, strict=True):
        position = position + normal * fence(push, one)
        # The limb has pressed all through the step, so on average half a step ago.
        velocity = velocity + end.turned(normal * fence(gate * stop, one), 0.5 * dt)
    return Motion(position, velocity, end.acceleration, end.carry)


def impacts_in_turn(
    law: ContactLaw,
    angle: Angle,
    leaving: tuple[Scalar, Scalar],
    resting: tuple[Scalar, Scalar],
) -> tuple[Scalar, Scalar]:
    """What two limbs that are touched do to the velocity: impacts (7) one after the other.

    The limb that is approached faster comes first. Its impact may send the circle into the other
    limb, also one that it was only sliding on, and so on in turn: in an acute corner several times.
    What is left once no approach is faster than a resting one is met by both limbs without rebound.

    Arguments:
        law: with the restitution.
        angle: between the limbs' normals.
        leaving: the speed along each normal; large where there is no contact.
        resting: the approach up to which each limb answers without rebound.

    Returns:
        The changes of velocity along each normal.
    """
    swapped = leaving[1] < leaving[0]
    speeds = [jnp.where(swapped, leaving[1 - k], leaving[k]) for k in (0, 1)]
    bounds = [jnp.where(swapped, resting[1 - k], resting[k]) for k in (0, 1)]
    sums: list[Scalar] = [0.0 * speeds[0], 0.0 * speeds[0]]
    for k in range(MOST_IMPACTS):
        mine, other = k % 2, 1 - k % 2
        kick = jnp.where(speeds[mine] < -bounds[mine], -(1.0 + law.restitution) * speeds[mine], 0.0)
        speeds[mine] = speeds[mine] + kick
        speeds[other] = speeds[other] + angle.cosine * kick
        sums[mine] = sums[mine] + kick
    last = least_push(angle, -speeds[0], -speeds[1])
    first, second = sums[0] + last[0], sums[1] + last[1]
    return jnp.where(swapped, second, first), jnp.where(swapped, first, second)


class Angle(eqx.Module):
    """The angle between two limbs' normals: its cosine and sine."""

    cosine: Scalar
    sine: Scalar

    @classmethod
    def between(cls, a: Vec, b: Vec) -> Angle:
        """From unit vector a to b."""
        return cls(a.dot(b), a.cross(b))


_ALMOST_ONE = 3e-4
"""The angle, radians, below which two limbs are in line, and a push along one normal does for both.
"""


def least_push(angle: Angle, need_a: Scalar, need_b: Scalar) -> tuple[Scalar, Scalar]:
    """The pushes along two unit normals that give each at least the displacement it needs.

    Pushes are never negative, and zero where not needed (a linear complementarity problem of two
    unknowns): the sum moves along normal a by at least `need_a` and along b by at least `need_b`.
    """
    cosine = angle.cosine
    alone_a, alone_b = jnp.maximum(need_a, 0.0), jnp.maximum(need_b, 0.0)
    a_suffices = cosine * alone_a >= need_b
    b_suffices = cosine * alone_b >= need_a
    in_line = cosine > 0.9
    # 1 - cosine^2, with its digits where the normals are close. Normals closer to antiparallel than
    # this would ask for pushes of a thousand penetrations.
    square = jnp.where(in_line, angle.sine * angle.sine, jnp.maximum(1.0 - cosine * cosine, 1e-6))
    as_one = in_line & (square < _ALMOST_ONE**2)
    inverse = 1.0 / jnp.where(as_one, 1.0, square)
    both_a = jnp.where(as_one, 0.0, (need_a - cosine * need_b) * inverse)
    both_b = jnp.where(
        as_one, need_a / jnp.where(as_one, cosine, 1.0), (need_b - cosine * need_a) * inverse
    )
    push_a = jnp.where(a_suffices, alone_a, jnp.where(b_suffices, 0.0, both_a))
    push_b = jnp.where(a_suffices, 0.0, jnp.where(b_suffices, alone_b, both_b))
    return push_a, push_b
