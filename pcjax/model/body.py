"""The object that the hand holds."""

from __future__ import annotations

from typing import Protocol

import equinox as eqx

from pcjax.checks import check_finite, check_positive, check_radians
from pcjax.planar import Scalar


class Body(Protocol):
    """What an object tells about itself. How it moves is in `pcjax.physics.step.move_body`.

    Attributes:
        radius: r_o of the circle in which it starts: that circle touches palm and first limb. Also
            the size that a step must not exceed, a length.
        width: the narrowest gap that it fits through, a length.
        turns: whether its angle is part of the state. Its `orientation` is then the angle from the
            palm at the start of a trial, radians.
    """

    @property
    def radius(self) -> Scalar: ...

    @property
    def width(self) -> Scalar: ...

    @property
    def turns(self) -> bool: ...


class Circle(eqx.Module):
    """A circle of radius r_o. Its mass M_o cancels from the indices; it is kept for energies.

    Arguments:
        radius: r_o, a length.
        mass: M_o.

    Raises:
        ValueError: a radius or mass that is not a positive number.

    Examples:
        >>> import pcjax
        >>> pcjax.Circle(25.0).width
        50.0
        >>> pcjax.Circle(-1)
        Traceback (most recent call last):
        ValueError: radius is -1: it has to be above 0
    """

    radius: Scalar
    mass: Scalar

    turns = False

    def __init__(self, radius: Scalar, mass: Scalar = 1.0):
        check_positive("radius", radius)
        check_positive("mass", mass)
        self.radius = radius
        self.mass = mass

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through."""
        return 2 * self.radius


SKIN = 2e-4
"""Share of a stick's half length at which it is held off the limbs (0.01 for the paper's stick).

Wide enough that rounding cannot hide on which side of a limb the stick is, and thousands of times
thinner than anything else in the paper's settings.
"""


class Stick(eqx.Module):
    """A thin uniform rod: half length r_o, moment of inertia I = M_o r_o^2 / 3, no thickness.

    Arguments:
        half_length: r_o.
        orientation: angle from the palm at the start of a trial, radians; 0 is parallel to it.
        mass: M_o; it cancels from the indices.

    Raises:
        ValueError: a half length or mass that is not a positive number, or an orientation that is
            not finite.

    Examples:
        >>> import math, pcjax
        >>> stick = pcjax.Stick(50.0, orientation=math.radians(45))
        >>> round(stick.inertia, 1)
        833.3
    """

    half_length: Scalar
    orientation: Scalar
    mass: Scalar

    turns = True

    def __init__(self, half_length: Scalar, orientation: Scalar = 0.0, mass: Scalar = 1.0):
        check_positive("half_length", half_length)
        check_finite("orientation", orientation)
        check_radians({"orientation": orientation})
        check_positive("mass", mass)
        self.half_length = half_length
        self.orientation = orientation
        self.mass = mass

    @property
    def radius(self) -> Scalar:
        """r_o, by a circle's name for it: that of the circle that the stick can turn in."""
        return self.half_length

    @property
    def inertia(self) -> Scalar:
        """I = M_o r_o^2 / 3."""
        return self.mass * self.half_length * self.half_length / 3

    @property
    def skin(self) -> Scalar:
        """The distance from limbs at which contact begins; see `SKIN`."""
        return SKIN * self.half_length

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through: any, endwise."""
        return 0.0 * self.half_length
