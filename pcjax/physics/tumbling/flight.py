"""Where a tumbling body is, and the path it takes from there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp

from pcjax.geometry import Flag, Integers, Scalar, Scalars, Vec
from pcjax.physics.rigid import Rate


class Tumble(eqx.Module):
    """Where a trial is.

    Attributes:
        position: of the centre, in the hand frame.
        velocity: of the centre as seen from the ground, in the hand's axes.
        angle: from the palm, radians.
        spin: the rate of its turning as seen from the ground.
        time: seconds of the current period gone by.
        leaps: leaps taken since the period began.
        status: RUNNING, PASSED, or INVALID.
        deepest: the deepest overlap so far.
    """

    position: Vec
    velocity: Vec
    angle: Scalars
    spin: Scalars
    time: Scalars
    leaps: Integers
    status: Integers
    deepest: Scalars


class Path(eqx.Module):
    """The motion from a leap's start, once the contacts have been settled: accelerations stay.

    Attributes:
        position, velocity, acceleration: of the centre.
        angle, spin, twist: angle, its rate, and the rate of that.
        working: what of the accelerations does work: the pull, and friction where it slips.
    """

    position: Vec
    velocity: Vec
    acceleration: Vec
    angle: Scalar
    spin: Scalar
    twist: Scalar
    working: Rate

    def after(self, wait: Scalar) -> tuple[Vec, Vec, Scalar, Scalar]:
        """Position, velocity, angle within half a turn, and spin, so many seconds later."""
        position = self.position + (self.velocity + self.acceleration * (0.5 * wait)) * wait
        angle = self.angle + (self.spin + 0.5 * self.twist * wait) * wait
        angle = angle - 2 * math.pi * jnp.round(angle / (2 * math.pi))
        velocity = self.velocity + self.acceleration * wait
        return position, velocity, angle, self.spin + self.twist * wait


class Margins(eqx.Module):
    """What rounding may hide: a distance and a speed; and below which speed a limb keeps a body."""

    near: Scalar
    noise: Scalar
    slow: Scalar


def any_of(loaded: Sequence[Flag]) -> Flag:
    """Whether any contact carries the body."""
    some = loaded[0]
    for on in loaded[1:]:
        some = some | on
    return some


def gyration_of(per_gyration: Scalar) -> Scalar:
    """The radius of gyration from 1 over it; 0 where nothing turns."""
    turns = per_gyration > 0
    return jnp.where(turns, 1.0 / jnp.where(turns, per_gyration, 1.0), 0.0)
