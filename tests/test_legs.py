"""What drives say of a leg, against what they say of a step."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pcjax
from pcjax.geometry import Vec
from pcjax.model.drives.base import Drive
from pcjax.model.motion import Leg

ARM, HAND = pcjax.PlanarArm(), pcjax.two_joint_hand()


class Unspoken(pcjax.PlanarArm):
    """An arm that leaves its legs to what any drive does."""

    def steady_interval(self, drift: Any) -> Any:
        return Drive.steady_interval(self, drift)

    def leg(self, profile: Any, time: Any, interval: Any) -> Leg:
        return Drive.leg(self, profile, time, interval)


@pytest.mark.parametrize(
    ("drive", "error"),
    [
        (pcjax.WristTilt(), 1e-9),
        (ARM, 1e-9),
        (ARM.mirrored(HAND.tip_mirror()), 1e-9),
        # It is asked for a twist a thousandth of the leg late, and for a pull at a window's end.
        (Unspoken(), 2e-3),
    ],
    ids=["wrist", "arm", "arm in a mirror", "any"],
)
def test_a_leg_is_the_free_motion_of_a_short_step(drive: Drive, error: float) -> None:
    """Ten legs of a thousandth of a second, each against the exact motion: place to third order,
    velocity as seen from the hand to second."""
    rng, dt = np.random.default_rng(0), 1e-3
    with jax.enable_x64(True):
        draws = jnp.asarray(rng.random((2, drive.targets_per_period)))
        profile = drive.profile(draws[0], draws[1], False)
        for time in [*np.round(rng.uniform(0, 0.9, 5), 3), *np.round(rng.uniform(6, 9, 5), 3)]:
            place, ground = (Vec(*map(jnp.asarray, rng.normal(size=2) * 50)) for _ in range(2))
            leg = drive.leg(profile, jnp.asarray(time), jnp.asarray(dt))
            seen = ground
            if leg.carry is not None:
                seen = ground - leg.carry.twist(jnp.asarray(time)).at(place)
            half = leg.felt(place + seen * (dt / 2), seen + leg.felt(place, seen) * (dt / 2))
            there = place + (seen + half * (dt / 2)) * dt
            then = seen + half * dt
            free = drive.fly(profile, place, ground, jnp.asarray(time), jnp.asarray(dt))
            scale = 50 * dt**3 + error * dt
            np.testing.assert_allclose(
                [there.x, there.y], [free.position.x, free.position.y], rtol=0, atol=20 * scale
            )
            reached = free.relative()
            np.testing.assert_allclose(
                [then.x, then.y], [reached.x, reached.y], rtol=0, atol=20 * scale / dt
            )
            assert float(leg.until) >= time + dt * (1 - 1e-6)
