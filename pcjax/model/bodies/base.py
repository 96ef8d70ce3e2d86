"""What an object that the hand holds tells about itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Float

from pcjax.components import Component, Registry, quantity
from pcjax.geometry import Scalar, Vec

BODIES: Registry[Body] = Registry(
    "body",
    "pcjax.bodies",
    ("pcjax.model.bodies.circle", "pcjax.model.bodies.stick", "pcjax.model.bodies.convex"),
)
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


class Shape(eqx.Module):
    """What contact needs of a rounded convex polygon, worked out once.

    Attributes:
        vertices: of the polygon, seen from the centre of mass, counterclockwise.
        skin: the radius of its corners, not 0.
        per_gyration: 1 over the radius of gyration; 0 for what does not turn.
        radius: of the circle about the centre in which it can turn.
    """

    vertices: tuple[Vec, ...]
    skin: Scalar
    per_gyration: Scalar
    radius: Scalar


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
        convex: whether it is a rounded convex polygon and has `vertices`, `skin` and
            `per_gyration`, as `pcjax.model.bodies.convex.Convex` has them.
    """

    turns: ClassVar[bool] = False
    longest_step: ClassVar[float] = math.inf
    usual_max_steps: ClassVar[int | None] = None
    noun: ClassVar[str] = "object of radius"
    convex: ClassVar[bool] = False

    if TYPE_CHECKING:  # for a field or a property of the subclass
        radius: Scalar = eqx.field(init=False)

    @property
    def width(self) -> Scalar:
        """The narrowest gap that it fits through, a length."""
        raise NotImplementedError

    def shape(self) -> Shape | None:
        """What contact needs of a convex body; None for any other one."""
        if not self.convex:
            return None
        body: Any = self
        return Shape(body.vertices, body.skin, body.per_gyration, body.radius)

    def outline(self) -> tuple[tuple[Vec, ...], Scalar]:
        """Its corners seen from its centre, in its own axes, and the radius by which they are
        rounded: unless a body says otherwise, a circle."""
        zero = 0.0 * self.radius
        return (Vec(zero, zero),), self.radius


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
