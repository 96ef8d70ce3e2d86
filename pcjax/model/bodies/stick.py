"""The stick: the paper's other object (Sec. 3.6.3)."""

from __future__ import annotations

import math

from pcjax.geometry import Scalar, Scalars, Vec
from pcjax.model.bodies.base import (
    Body,
    Orientation,
    mass_field,
    orientation_field,
    register_body,
    size_field,
    turns_field,
)
from pcjax.model.bodies.outline import SKIN


@register_body("stick")
class Stick(Body):
    """A thin uniform rod: half length r_o, moment of inertia I = M_o r_o^2 / 3, no thickness.

    Arguments:
        half_length: r_o.
        orientation: angle from the palm at the start of a trial, radians; 0 is parallel to it;
            "random", kept as None: any, drawn for each trial.
        mass: M_o; it cancels from the indices.
        turns: whether it turns; if not, only the engine `convex` can run it.

    Raises:
        ValueError: a half length or mass that is not a positive number, or an orientation that is
            not finite.

    Examples:
        >>> import math, pcjax
        >>> stick = pcjax.Stick(50.0, orientation=math.radians(45))
        >>> round(stick.inertia, 1)
        833.3
    """

    half_length: Scalar = size_field("half length r_o")
    orientation: Orientation = orientation_field()
    mass: Scalar = mass_field()
    turns: bool = turns_field()

    oriented = True
    longest_step = 0.01
    usual_max_steps = 180_000
    noun = "stick of half length"
    convex = True

    @property
    def radius(self) -> Scalars:  # pyright: ignore[reportIncompatibleVariableOverride]
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
    def vertices(self) -> tuple[Vec, ...]:
        """Its ends: a polygon of two vertices, rounded by its skin."""
        return self.outline()[0]

    @property
    def per_gyration(self) -> Scalar:
        """1 over the radius of gyration, sqrt(3) / r_o; 0 if it does not turn."""
        return (math.sqrt(3.0) if self.turns else 0.0) / self.half_length

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through: any, endwise."""
        return 0.0 * self.half_length

    def outline(self) -> tuple[tuple[Vec, ...], Scalar]:
        """Its two ends, not rounded."""
        zero = 0.0 * self.half_length
        return (Vec(-self.half_length, zero), Vec(self.half_length, zero)), zero
