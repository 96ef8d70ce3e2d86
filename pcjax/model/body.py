"""The object that the hand holds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Float

from pcjax.components import Component, Registry, quantity
from pcjax.planar import Scalar, Vec

BODIES: Registry[Body] = Registry("body", "pcjax.bodies")
"""The objects that study files and flags can name."""

register_body = BODIES.register


def size_field(help: str) -> Any:
    """An object's size, which files and flags call its radius."""
    return quantity(
        "length",
        help,
        low=0,
        above=True,
        key="radius",
        flag="radius",
        usual="0.05 L_p on the wrist, 50 on the arm",
    )


class Body(Component):
    """What an object tells about itself. How it moves is in `pcjax.physics.step.move_body`.

    Attributes:
        radius: r_o of the circle in which it starts: that circle touches palm and first limb. Also
            the size that a step must not exceed, a length.
        width: the narrowest gap that it fits through, a length.
        turns: whether its angle is part of the state. Its `orientation` is then the angle from the
            palm at the start of a trial, radians.
        longest_step: the longest step, s, that accuracy allows whatever the speed.
        usual_max_steps: the limit in steps of 0.001 s unless one is given; None for the drive's.
        noun: what messages call it, before its radius.
    """

    turns: ClassVar[bool] = False
    longest_step: ClassVar[float] = math.inf
    usual_max_steps: ClassVar[int | None] = None
    noun: ClassVar[str] = "object of radius"

    if TYPE_CHECKING:  # for a field or a property of the subclass
        radius: Scalar = eqx.field(init=False)

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through, a length."""
        raise NotImplementedError

    def outline(self) -> tuple[tuple[Vec, ...], Scalar]:
        """Its corners seen from its centre, in its own axes, and the radius by which they are
        rounded: unless a body says otherwise, a circle."""
        zero = 0.0 * self.radius
        return (Vec(zero, zero),), self.radius


@register_body("circle")
class Circle(Body):
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

    radius: Scalar = size_field("r_o")
    mass: Scalar = quantity("mass", "M_o", default=1.0, low=0, above=True)

    noun = "circle of radius"

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through."""
        return 2 * self.radius


SKIN = 2e-4
"""Share of a stick's half length at which it is held off the limbs (0.01 for the paper's stick).

Wide enough that rounding cannot hide on which side of a limb the stick is, and thousands of times
thinner than anything else in the paper's settings.
"""


@register_body("stick")
class Stick(Body):
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

    half_length: Scalar = size_field("r_o, its half length")
    orientation: Scalar = quantity(
        "angle",
        "its angle from the palm at the start",
        default=0.0,
        key="orientation",
        flag="orientation",
    )
    mass: Scalar = quantity("mass", "M_o", default=1.0, low=0, above=True)

    turns = True
    longest_step = 0.01
    usual_max_steps = 180_000
    noun = "stick of half length"

    @property
    def radius(self) -> Scalar:  # pyright: ignore[reportIncompatibleVariableOverride]
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

    def outline(self) -> tuple[tuple[Vec, ...], Scalar]:
        """Its two ends, not rounded."""
        zero = 0.0 * self.half_length
        return (Vec(-self.half_length, zero), Vec(self.half_length, zero)), zero


def placed_outline(
    body: Body, centre: Float[np.ndarray, "2"], angle: float | None = None
) -> tuple[Float[np.ndarray, "corners 2"], float]:
    """Where a body's corners are, and the radius by which they are rounded, for plain numbers.

    Arguments:
        body: what.
        centre: where its centre is.
        angle: of its axes, radians; its orientation at the start unless given.
    """
    if angle is None:
        angle = float(getattr(body, "orientation", 0.0))
    corners, rounding = body.outline()
    own = np.array([[float(corner.x), float(corner.y)] for corner in corners])
    c, s = math.cos(angle), math.sin(angle)
    return centre + own @ np.array([[c, s], [-s, c]]), float(rounding)
