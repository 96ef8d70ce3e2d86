"""All randomness of a trial: functions of (seed, trial, period) and of nothing else.

Uniform numbers are made from 24 random bits, which both float32 and float64 hold exactly: a trial
is the same physical experiment in either precision.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Integer, Key

_START = 0
_FIRST_PERIOD = 1
_ORIENTATION = np.uint32(2**32 - 1)


def trial_key(seed: Integer[Array, ""] | int, trial: Integer[Array, ""] | int) -> Key[Array, ""]:
    """The key of one trial, whatever random generator JAX is configured to use."""
    return jax.random.fold_in(jax.random.key(seed, impl="threefry2x32"), trial)


def start_draws(key: Key[Array, ""], count: int) -> Float[Array, "{count}"]:
    """Draws for where the object starts, 3, and at which angle, a fourth, uniform on (0, 1)."""
    place = _uniform(jax.random.fold_in(key, _START), 3)
    if count == 3:
        return place
    return jnp.append(place, _uniform(jax.random.fold_in(key, _ORIENTATION), count - 3))


def period_draws(
    key: Key[Array, ""], period: Integer[Array, ""] | int, count: int
) -> Float[Array, "{count}"]:
    """Draws for the drive's targets in a period (from 0), uniform on (0, 1)."""
    return _uniform(jax.random.fold_in(key, _FIRST_PERIOD + period), count)


def _uniform(key: Key[Array, ""], count: int) -> Float[Array, "{count}"]:
    bits = jax.random.bits(key, (count,), jnp.uint32)
    return (bits >> 8).astype(float) * 2.0**-24 + 2.0**-25
