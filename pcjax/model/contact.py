"""What happens at a contact: restitution, rest, and how sharply contact switches on."""

from __future__ import annotations

import jax.numpy as jnp

from pcjax.components import Component, quantity
from pcjax.geometry import Scalar


def _none_if_zero(value: Scalar | None) -> Scalar | None:
    # What is zero has no leaf: the compiled contact carries nothing of it.
    return None if isinstance(value, (int, float)) and value == 0 else value


class ContactLaw(Component):
    """Hard or smoothed contact with restitution.

    | field | unit | usual | what it does |
    | --- | --- | --- | --- |
    | restitution | 1 | 0.1 | e_r in (7): the share of normal speed that an impact keeps |
    | resting_speed | length / s | 0.05 | slower impacts are inelastic; keep it far below a fall's |
    | smoothing | length | 0 | half width of the layer over which contact switches on |

    Width 0 is the paper's hard contact. Smoothed and hard contact are one code path: `switch` and
    `ramp` are the step function and its integral, or smooth versions of them with support
    [-smoothing, smoothing].

    Raises:
        ValueError: restitution outside [0, 1], or a negative resting speed or smoothing width.

    Examples:
        Half way into the layer of a smoothed contact it is on by a half:

        >>> import pcjax
        >>> float(pcjax.ContactLaw(smoothing=2.0).switch(0.0))
        0.5
        >>> float(pcjax.ContactLaw().switch(0.1))
        1.0
    """

    restitution: Scalar = quantity(
        "1", "e_r in (7)", default=0.1, low=0, high=1, key="restitution", flag="restitution"
    )
    resting_speed: Scalar = quantity(
        "speed",
        "slower impacts are inelastic",
        default=0.05,
        metric=1e-3,
        low=0,
        key="resting_speed",
    )
    smoothing: Scalar | None = quantity(
        "length",
        "half width of the layer over which contact switches on",
        default=None,
        low=0,
        converter=_none_if_zero,
    )

    friction: Scalar | None = quantity(
        "1",
        "mu, of Coulomb's friction at every contact",
        default=None,
        low=0,
        converter=_none_if_zero,
        key="friction",
        flag="friction",
        usual="0",
    )
    drag: Scalar | None = quantity(
        "rate",
        "at which the plane that it lies on brakes its motion against the hand",
        default=None,
        low=0,
        converter=_none_if_zero,
        key="drag",
        flag="drag",
        usual="0",
    )

    def switch(self, penetration: Scalar) -> Scalar:
        """How far contact is on, from 0 to 1."""
        if self.smoothing is None:
            return jnp.where(penetration > 0, 1.0, 0.0)
        z = _layer(penetration, self.smoothing)
        return z * z * (3.0 - 2.0 * z)

    def ramp(self, penetration: Scalar) -> Scalar:
        """How far to push out: the integral of `switch`, negative where nothing is to be pushed."""
        if self.smoothing is None:
            return penetration
        z = _layer(penetration, self.smoothing)
        inside = self.smoothing * z * z * z * (2.0 - z)
        outside = jnp.where(z > 0, inside, penetration + self.smoothing)
        return jnp.where(z < 1, outside, penetration)


def _layer(penetration: Scalar, width: Scalar) -> Scalar:
    """From 0 to 1 across the layer of half width `width`."""
    return jnp.clip(0.5 * (penetration / width + 1.0), 0.0, 1.0)
