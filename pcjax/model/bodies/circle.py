"""The circle: the paper's object (Sec. 3.1)."""

from __future__ import annotations

import math

from pcjax.geometry import Scalar, Vec
from pcjax.model.bodies.base import Body, mass_field, register_body, size_field, turns_field


@register_body("circle")
class Circle(Body):
    """A circle of radius r_o. Its mass M_o cancels from the indices; it is kept for energies.

    Arguments:
        radius: r_o, a length.
        mass: M_o.
        turns: whether it turns where there is friction: without, it never does.

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

    radius: Scalar = size_field("radius r_o")
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    noun = "circle of radius"
    convex = True

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through."""
        return 2 * self.radius

    @property
    def vertices(self) -> tuple[Vec, ...]:
        """Its centre: a polygon of one vertex, rounded."""
        zero = 0.0 * self.radius
        return (Vec(zero, zero),)

    @property
    def skin(self) -> Scalar:
        """The rounding: its radius."""
        return self.radius

    @property
    def per_gyration(self) -> Scalar:
        """1 over the radius of gyration, sqrt(2) / r_o; 0 if it does not turn."""
        return (math.sqrt(2.0) if self.turns else 0.0) / self.radius
