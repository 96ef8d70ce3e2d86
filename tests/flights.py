"""Flights of a convex body under a pull that stays."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

import pcjax
from pcjax.geometry import Vec
from pcjax.model.drives.wrist import TiltProfile
from pcjax.model.scenario import World
from pcjax.physics.state import RUNNING
from pcjax.physics.tumbling.flight import Tumble
from pcjax.physics.tumbling.leap import tumble

BEGIN = 0.1
STEADY = pcjax.WristTilt(ramp_time=BEGIN, period=1e4)
"""Flights begin after its ramp, and end before its period does, so that the pull stays."""


def released(place: Any, velocity: Any, angle: Any, spin: Any) -> Tumble:
    """A body at the beginning of its flight."""
    zero = jnp.zeros_like(spin)
    count = jnp.zeros(zero.shape, jnp.int32)
    return Tumble(Vec(*place), Vec(*velocity), angle, spin, zero + BEGIN, count, count, zero)


def pulled(x: Any, y: Any) -> TiltProfile:
    """What pulls at it."""
    none = Vec(0.0 * x, 0.0 * x)
    return TiltProfile(none, none, Vec(x, y))


def leap(world: World, profile: TiltProfile, flight: Tumble, seconds: Any) -> Tumble:
    """One leap, at most to so many seconds after the beginning."""
    zero = 0.0 * flight.spin
    return tumble(world, profile, zero + 1.0, flight, zero + BEGIN + seconds)


def flown(world: World, profile: TiltProfile, first: Tumble, seconds: Any) -> Tumble:
    """The flight so many seconds after its beginning, or 2,000 leaps."""

    def going(flight: Tumble) -> jax.Array:
        still = (flight.time < BEGIN + seconds) & (flight.status == RUNNING)
        return still & (flight.leaps < 2000)

    return jax.lax.while_loop(going, lambda flight: leap(world, profile, flight, seconds), first)
