"""What an object that the hand holds tells about itself."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

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


Orientation = Scalar | Literal["random"] | None
"""An angle from the palm, radians, or "random", which is kept as None: uniform on the whole turn,
drawn for each trial."""


def _none_if_random(orientation: Orientation) -> Scalar | None:
    if not isinstance(orientation, str):
        return orientation
    if orientation != "random":
        raise ValueError(f"orientation is {orientation!r}: it has to be an angle or 'random'")
    return None


def orientation_field() -> Any:
    """A body's angle from the palm at the start of a trial."""
    return quantity(
        "angle",
        "its angle from the palm at the start (random: any, drawn for each trial)",
        default=0.0,
        converter=_none_if_random,
        word="random",
        key="orientation",
        flag="orientation",
    )


def mass_field() -> Any:
    """A body's mass."""
    return quantity("mass", "M_o", default=1.0, low=0, above=True)


def turns_field() -> Any:
    """Whether a body turns."""
    return quantity(
        "1",
        "whether it turns; no: a puck, whose moment of inertia is infinite",
        default=True,
        kind=bool,
        static=True,
        key="turns",
        flag="turns",
    )


class _Sized:
    """Fields or properties of each body; `orientation` of an oriented one."""

    radius: Scalar
    orientation: Orientation


class Body(Component, _Sized):
    """What an object tells about itself. How it moves is in `pcjax.physics.step.move_body`.

    Attributes:
        radius: r_o of the circle in which it starts: that circle touches palm and first limb. Also
            the size that a step must not exceed, a length.
        width: the narrowest gap that it fits through, a length.
        oriented: whether it has an angle at the start of a trial, its `orientation`: from the palm,
            radians; None where it is drawn for each trial.
        turns: whether it can turn; else its moment of inertia is infinite.
        longest_step: the longest step, s, that accuracy allows whatever the speed.
        usual_max_steps: the limit in steps of 0.001 s unless one is given; None for the drive's.
        noun: what messages call it, before its `size_in_words`.
        convex: whether it is a rounded convex polygon and has `vertices`, `skin` and
            `per_gyration`, as `pcjax.model.bodies.convex.Convex` has them.
    """

    oriented: ClassVar[bool] = False
    longest_step: ClassVar[float] = math.inf
    usual_max_steps: ClassVar[int | None] = None
    noun: ClassVar[str] = "object of radius"
    convex: ClassVar[bool] = False
    turns = True

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

    def size_in_words(self) -> str:
        """How large it is, after its noun."""
        return f"{float(self.radius):.4g}"

    def mirrored(self) -> Body:
        """What is seen of it in a mirror along its own x axis."""
        return self

    def outline(self) -> tuple[tuple[Vec, ...], Scalar]:
        """Its corners seen from its centre, in its own axes, and the radius by which they are
        rounded: unless a body says otherwise, a circle."""
        zero = 0.0 * self.radius
        return (Vec(zero, zero),), self.radius

    def least_passage(self) -> float:
        """Nothing narrower lets its centre through, a length for plain numbers: twice the inner
        radius. Of what is not alike on both sides of its centre, as a triangle, that is less than
        the width: its centre may be past two fingertips that hold the rest of it back."""
        return min(float(self.width), 2 * self.inner_radius())

    def inner_radius(self) -> float:
        """Of the largest circle about its centre that is within it, for plain numbers."""
        corners, rounding = self.outline()
        if len(corners) <= 2:
            return float(rounding)
        at = np.array([[float(corner.x), float(corner.y)] for corner in corners])
        along = np.roll(at, -1, axis=0) - at
        share = np.clip(-(at * along).sum(axis=1) / (along * along).sum(axis=1), 0, 1)
        return float(np.hypot(*(at + share[:, None] * along).T).min()) + float(rounding)


def placed_outline(
    body: Body, centre: Float[np.ndarray, "2"], angle: float | None = None
) -> tuple[Float[np.ndarray, "corners 2"], float]:
    """Where a body's corners are, and the radius by which they are rounded, for plain numbers.

    Arguments:
        body: what.
        centre: where its centre is.
        angle: of its axes, radians; unless given, its orientation at the start, 0 if that is drawn.
    """
    if angle is None:
        angle = float(getattr(body, "orientation", None) or 0.0)
    corners, rounding = body.outline()
    own = np.array([[float(corner.x), float(corner.y)] for corner in corners])
    c, s = math.cos(angle), math.sin(angle)
    return centre + own @ np.array([[c, s], [-s, c]]), float(rounding)
