"""What several contacts do to a rigid body at once: impacts with friction, rest, and forces.

Velocities are triples (v_x, v_y, kappa omega), with kappa the radius of gyration, so that kinetic
energy is half their square; a contact's normal and tangent are directions in that space.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from pcjax.geometry import Flag, Scalar, Vec, fence, fence_all
from pcjax.physics.contact.manifold import Contact, left_of
from pcjax.physics.pushes import Pairs, all_pairs


class Rate(NamedTuple):
    """A velocity or acceleration (x, y, kappa omega)."""

    x: Scalar
    y: Scalar
    turn: Scalar

    def plus(self, other: Rate, factor: Scalar) -> Rate:
        """With so much of another one."""
        return Rate(*(a + b * factor for a, b in zip(self, other, strict=True)))

    def plus_all(self, others: Sequence[Rate], factors: Sequence[Scalar]) -> Rate:
        """With so much of each of several."""
        for other, factor in zip(others, factors, strict=True):
            self = self.plus(other, factor)
        return self

    def dot(self, other: Rate) -> Scalar:
        return self.x * other.x + self.y * other.y + self.turn * other.turn

    def cross(self, other: Rate) -> Rate:
        return Rate(
            self.y * other.turn - self.turn * other.y,
            self.turn * other.x - self.x * other.turn,
            self.x * other.y - self.y * other.x,
        )


class Direction(eqx.Module):
    """A contact's normal or tangent.

    Attributes:
        row: of unit length.
        size: the length that it had, so that `row.dot(velocity) * size` is a speed.
        lever: the turn's part of it before.
    """

    row: Rate
    size: Scalar
    lever: Scalar

    @classmethod
    def of(cls, vector: Vec, lever: Vec, per_gyration: Scalar, barrier: Scalar) -> Direction:
        """A direction in the plane that acts with a lever; 1 / kappa is 0 where nothing turns."""
        arm = lever.cross(vector) * per_gyration
        size = fence(jnp.sqrt(1.0 + arm * arm), barrier)
        row = Rate(vector.x / size, vector.y / size, arm / size)
        return fence_all(cls(row, size, arm), barrier)

    def speed(self, moving: Rate) -> Scalar:
        """The contact's speed along it."""
        return self.row.dot(moving) * self.size


class Rows(eqx.Module):
    """The contacts' directions, and the cosines of the angles between normals."""

    normals: list[Direction]
    tangents: list[Direction]
    cosines: Pairs

    @classmethod
    def of(cls, found: Sequence[Contact], per_gyration: Scalar, barrier: Scalar) -> Rows:
        """From contacts, and 1 / kappa."""
        normals = [Direction.of(one.normal, one.lever, per_gyration, barrier) for one in found]
        tangents = [
            Direction.of(left_of(one.normal), one.lever, per_gyration, barrier) for one in found
        ]
        cosines = {
            (a, b): fence(normals[a].row.dot(normals[b].row), barrier)
            for a, b in all_pairs(len(found))
        }
        return cls(normals, tangents, cosines)

    def settle(self, moving: Rate, pushes: Sequence[Scalar], barrier: Scalar) -> Rate:
        """The velocity, or acceleration, with pushes along the normals."""
        rows = [normal.row for normal in self.normals]
        return Rate(*fence_all(tuple(moving.plus_all(rows, pushes)), barrier))


def impact(
    approach: Scalar,
    slip: Scalar,
    normal_lever: Scalar,
    tangent_lever: Scalar,
    friction: Scalar,
    restitution: Scalar,
) -> tuple[Scalar, Scalar]:
    """The impulses, for a unit of mass, along normal and tangent in one impact.

    Poisson's hypothesis with Coulomb's friction, by Routh's method: see Wang and Mason, "Two-
    dimensional rigid-body collisions with friction" (1992). Slip falls with the normal impulse and
    may stop; then the contact sticks or slides the other way. The impulse is 1 + e times what it is
    when the approach ends, so that no impact creates energy.

    Arguments:
        approach: the speed against the normal, at least 0.
        slip: the speed along the tangent.
        normal_lever, tangent_lever: the lever's cross product with either, over kappa.
        friction, restitution: mu and e.
    """
    nn, tt = 1.0 + normal_lever * normal_lever, 1.0 + tangent_lever * tangent_lever
    nt = normal_lever * tangent_lever
    side = jnp.sign(slip)
    slip_rate, rate = nt - friction * side * tt, nn - friction * side * nt
    stops = side * slip_rate < 0
    until = jnp.where(stops, -slip / jnp.where(stops, slip_rate, 1.0), jnp.inf)
    until = jnp.where(side == 0, 0.0, until)
    sticks = jnp.abs(nt) <= friction * tt
    after = jnp.where(sticks, -nt / tt, -friction * jnp.sign(nt))
    rate_after = nn + after * nt
    early = (rate > 0) & (approach <= rate * until)
    first = jnp.where(early, 0.0, until)
    met = jnp.where(
        early,
        approach / jnp.where(early, rate, 1.0),
        first + (approach - rate * first) / rate_after,
    )
    whole = (1.0 + restitution) * met
    before = jnp.minimum(whole, until)
    return whole, -friction * side * before + after * (whole - before)


def at_rest_under(
    rows: Rows, on: Sequence[Flag], ratio: Sequence[Scalar], pull: Rate, size: Scalar
) -> Flag:
    """Whether contacts that stick can hold a body at rest: whether what pulls at it is balanced by
    forces within their cones of friction.

    What lies in the cone of many rays in three dimensions lies in that of three of them
    (Caratheodory). So all sets of three rays are tried.

    Arguments:
        rows: the contacts.
        on: which of them there are.
        ratio: the largest push along the tangent for a push along the normal.
        pull: the acceleration without contact.
        size: its length, not 0.
    """
    normals = [normal.row for normal in rows.normals]
    tangents = [tangent.row for tangent in rows.tangents]
    normals, tangents, ratio, pull, size = jax.lax.stop_gradient(
        (normals, tangents, list(ratio), pull, size)
    )
    wanted = Rate(*(-part / size for part in pull))
    rays = [
        Rate(
            *(jnp.where(on[a], part, 0.0) for part in normals[a].plus(tangents[a], side * ratio[a]))
        )
        for a in range(len(on))
        for side in (1.0, -1.0)
    ]
    across = {(a, b): rays[a].cross(rays[b]) for a, b in all_pairs(len(rays))}
    wants = {pair: wanted.dot(normal) for pair, normal in across.items()}
    held = size < 0
    for a, b, c in itertools.combinations(range(len(rays)), 3):
        volume = rays[a].dot(across[b, c])
        way, room = jnp.sign(volume), jnp.abs(volume)
        slack = -1e-5 * room
        balanced = (way * wants[b, c] >= slack) & (way * wants[a, b] >= slack)
        held = held | ((room > 1e-4) & balanced & (-way * wants[a, c] >= slack))
    return held


SWEEPS = 16
"""Rounds in which forces with friction settle."""

LEAST_OWN = 0.1
"""Share of a push that has to be left of it in its own direction, after the friction it causes."""


def catches(normal: Direction, tangent: Direction, slip: Scalar, ratio: Scalar) -> Flag:
    """Whether a contact that slides and is pressed on cannot go on to slide.

    Where friction turns the body into the limb as fast as the push turns it away, no force is large
    enough (Painleve's paradox), and an impulse stops the slip at once.

    Arguments:
        normal, tangent: of the contact.
        slip: the speed along the tangent.
        ratio: the largest push along the tangent for a push along the normal.
    """
    return 1.0 - jnp.sign(slip) * ratio * normal.row.dot(tangent.row) < LEAST_OWN


def forces_with_friction(
    rows: Rows,
    need: Sequence[Scalar],
    need_along: Sequence[Scalar],
    slip: Sequence[Scalar],
    sticks: Sequence[Flag],
    ratio: Sequence[Scalar],
    barrier: Scalar,
) -> tuple[list[Scalar], list[Scalar]]:
    """The forces, as pushes along the normals and tangents, of contacts that stick or slide.

    By projected Gauss-Seidel: no contact pulls, one that slides rubs against its slip, one that
    sticks is held by as much as its cone allows.

    Arguments:
        rows: the contacts.
        need, need_along: the accelerations that keep each contact from closing, NOT_NEEDED where
            it is off, and from slipping.
        slip: speeds along the tangents.
        sticks: whether a contact does not slip.
        ratio: the largest push along the tangent for a push along the normal.
        barrier: a 1 for `fence`.
    """
    count = len(need)
    every = [d.row for d in (*rows.normals, *rows.tangents)]
    cosines = {
        pair: fence(every[pair[0]].dot(every[pair[1]]), barrier) for pair in all_pairs(2 * count)
    }
    drag = [jnp.where(slip[a] > 0, -ratio[a], ratio[a]) for a in range(count)]
    own = [1.0 + cosines[a, count + a] * drag[a] for a in range(count)]
    own = [jnp.where(sticks[a], 1.0, jnp.maximum(own[a], LEAST_OWN)) for a in range(count)]
    drag, own = fence_all((drag, own), barrier)

    pushes = [0.0 * need[0]] * (2 * count)

    def lack(wanted: Scalar, a: int) -> Scalar:
        """What it still needs, not counting its own push."""
        for b, push in enumerate(pushes):
            if b != a:
                wanted = wanted - cosines[min(a, b), max(a, b)] * push
        return wanted

    for _ in range(SWEEPS):
        for a in range(count):
            change = (lack(need[a], a) - pushes[a]) / own[a]
            pushes[a] = fence(jnp.maximum(pushes[a] + change, 0.0), barrier)
            most = ratio[a] * pushes[a]
            stuck = jnp.clip(lack(need_along[a], count + a), -most, most)
            along = jnp.where(sticks[a], stuck, drag[a] * pushes[a])
            pushes[count + a] = fence(along, barrier)
    return pushes[:count], pushes[count:]
