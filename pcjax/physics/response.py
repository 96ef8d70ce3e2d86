"""What any contact does: when an impact was, impacts in turn, and the least push."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp

from pcjax.geometry import Scalar, Vec, safe_sqrt
from pcjax.model.contact import ContactLaw

INACTIVE = -1e30
"""A bound that never binds, for a contact that is off."""

MOST_IMPACTS = 16
"""Impacts that two limbs may deal a circle in turn at one instant, before both hold it.

In a corner of 15 degrees that leaves less than a thousandth of the speed undecided."""


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
