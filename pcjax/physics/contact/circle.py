"""The circle: where it meets the limbs, eqs (3)-(6), and what that does to it, eq. (7)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.geometry import (
    Flag,
    Scalar,
    Segment,
    Vec,
    bits,
    fence,
    fence_all,
    pick,
    unit_and_length,
    where,
)
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.motion import Motion
from pcjax.model.scenario import World
from pcjax.physics.response import INACTIVE, Angle, impacts_in_turn, least_push, time_since_contact
from pcjax.physics.state import State, judge


def move_circle(
    body: Circle, world: World, state: State, free: Motion, dt: Scalar, barrier: Scalar
) -> State:
    """A step's contact of a circle: it is with the two nearest limbs."""
    moved = meet_limbs(world, free, dt, barrier)
    travel = free.position - state.position
    # Written so that NaN fails it too.
    safe = travel.dot(travel) < world.contact_radius * world.contact_radius
    return judge(world, state, moved, safe)


def meet_limbs(world: World, free: Motion, dt: Scalar, barrier: Scalar) -> Motion:
    """Impacts with the two nearest limbs, then rest and sliding on them."""
    radius = world.contact_radius
    contacts = two_nearest(world.limbs, free.position, barrier)
    moved = bounce(world.law, contacts, radius, free, dt, barrier)
    return hold_off(world.law, contacts, radius, moved, moved.position - free.position, dt, barrier)


class Contact(eqx.Module):
    """What the circle's centre sees of one limb.

    Attributes:
        offset: from the limb's closest point to the centre.
        round: whether that point is an end of the limb (6) and not inside it (4), (5): whether the
            surface at radius r_o around it is round or flat.
        limb: the limb.
    """

    offset: Vec
    round: Flag
    limb: Segment

    def after(self, move: Vec) -> tuple[Vec, Scalar]:
        """Unit normal (limb to centre) and distance once the centre has moved by `move`.

        Exact as long as the closest point stays inside the limb, or stays its end.
        """
        normal, distance = unit_and_length(self.offset)
        flat = normal * normal.dot(move)
        moved, length = unit_and_length(self.offset + move)
        return (
            where(self.round, moved, normal),
            jnp.where(self.round, length, distance + flat.dot(normal)),
        )


def two_nearest(limbs: Sequence[Segment], centre: Vec, barrier: Scalar) -> tuple[Contact, Contact]:
    """The contacts with the limb nearest to the centre and the second nearest.

    A joint counts for the limb that ends there (the palm, first in `limbs`, counts both its ends),
    so the two never stand for one and the same joint.

    The search runs on squared distances whose lowest bits hold the limb's number. Their minimum
    carries all that is needed, which compiles to one short loop where a chain of selects over
    distances and offsets makes dozens. It leaves undecided only distances that agree to a
    millionth (float32), where either limb will do.
    """
    tag_bits = math.ceil(math.log2(2 * len(limbs)))
    keys = [_key(limb, centre, number, tag_bits) for number, limb in enumerate(limbs)]
    first, second = jnp.minimum(keys[0], keys[1]), jnp.maximum(keys[0], keys[1])
    for key in keys[2:]:
        second = jnp.minimum(second, jnp.maximum(first, key))
        first = jnp.minimum(first, key)

    def contact(key: Scalar) -> Contact:
        tag = bits(fence(key, barrier)) & ((1 << tag_bits) - 1)
        limb = pick(limbs, tag >> 1)
        offset = limb.offset(centre)
        return Contact(
            Vec(fence(offset.x, barrier), fence(offset.y, barrier)), (tag & 1) != 0, limb
        )

    return contact(first), contact(second)


def _key(limb: Segment, centre: Vec, number: int, tag_bits: int) -> Scalar:
    """The squared distance to a limb; its lowest bits are the limb's number and `round`."""
    relative = jax.lax.stop_gradient(centre - limb.start)
    tangent, length = jax.lax.stop_gradient((limb.tangent, limb.length))
    along = relative.dot(tangent)
    across = relative.cross(tangent)
    beyond = along - jnp.clip(along, 0.0, length)
    # The tiny term keeps the key a normal number whatever its lowest bits.
    square = beyond * beyond + (across * across + 1e-30)
    if number > 0:
        square = jnp.where(along < 0, 1e30, square)
    tag = jnp.where(beyond != 0, 2 * number + 1, 2 * number)
    marked = (bits(square) & ~((1 << tag_bits) - 1)) | tag.astype(bits(square).dtype)
    return jax.lax.bitcast_convert_type(marked, square.dtype)


def bounce(
    law: ContactLaw,
    contacts: tuple[Contact, Contact],
    radius: Scalar,
    end: Motion,
    dt: Scalar,
    barrier: Scalar,
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
        return fence(time_since_contact(inwards, pressing, penetration, longest), barrier)

    def kicked(end: Motion, normal: Vec, penetration: Scalar, since: Scalar) -> Motion:
        approach = -(end.relative() - end.acceleration * since).dot(normal)  # (3): only if positive
        restitution = jnp.where(approach > law.resting_speed, law.restitution, 0.0)
        change = law.switch(penetration) * (1.0 + restitution) * jnp.maximum(approach, 0.0)  # (7)
        kick = fence_all(end.turned(normal * fence(change, barrier), since), barrier)
        return Motion(end.position + kick * since, end.velocity + kick, end.acceleration, end.twist)

    seen = [unit_and_length(contact.offset) for contact in contacts]
    depths = [radius - distance for _, distance in seen]
    times = [begun(end, normal, depth, dt) for (normal, _), depth in zip(seen, depths, strict=True)]
    swapped = times[1] > times[0]
    first, second = (where(swapped, contacts[1 - k], contacts[k]) for k in (0, 1))
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


def hold_off(
    law: ContactLaw,
    contacts: tuple[Contact, Contact],
    radius: Scalar,
    end: Motion,
    move: Vec,
    dt: Scalar,
    barrier: Scalar,
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
        depths.append(fence(radius - distance, barrier))
    angle = Angle.between(*normals)
    out = least_push(angle, *(law.ramp(depth) for depth in depths))
    gates = [law.switch(depth) for depth in depths]
    leaving, resting = [], []
    for gate, normal in zip(gates, normals, strict=True):
        leaving.append(fence(jnp.where(gate > 0, end.relative().dot(normal), -INACTIVE), barrier))
        pressing = jnp.maximum(-end.acceleration.dot(normal), 0.0)
        resting.append(fence(law.resting_speed + pressing * dt, barrier))
    turn = impacts_in_turn(law, angle, (leaving[0], leaving[1]), (resting[0], resting[1]))
    position, velocity = end.position, end.velocity
    for normal, gate, push, stop in zip(normals, gates, out, turn, strict=True):
        position = position + normal * fence(push, barrier)
        # The limb has pressed all through the step, so on average half a step ago.
        velocity = velocity + end.turned(normal * fence(gate * stop, barrier), 0.5 * dt)
    return Motion(position, velocity, end.acceleration, end.twist)
