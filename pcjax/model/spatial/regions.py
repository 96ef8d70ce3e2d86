"""Where an object starts in a hand in three dimensions, and when it has escaped."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from pcjax.components import Component, Registry, quantity
from pcjax.geometry import Scalar

Points = Float[np.ndarray, "*points 3"]


def _place(help: str, key: str, **more: Any) -> Any:
    return quantity("length", help, count=3, each="axis", key=key, **more)


class StartBox(Component):
    """Where the object's centre starts, at rest: anywhere in a box, all places alike.

    Arguments:
        centre: of the box in the hand's frame, m.
        spread: half of its sides, m.
        orientation: of the object to the hand: angles about x, then y, then z of the hand, radians;
            None if each trial has its own, all alike.
    """

    centre: tuple[Scalar, ...] = _place("the middle of the starts, in the hand's frame", "centre")
    spread: tuple[Scalar, ...] = _place(
        "how far starts are from it, along x, y and z", "spread", low=0
    )
    orientation: tuple[Scalar, ...] | None = quantity(
        "angle",
        "of the object: about x, then y, then z of the hand",
        default=(0.0, 0.0, 0.0),
        count=3,
        each="axis",
        key="orientation",
        word="random",
    )

    @property
    def draws(self) -> int:
        """How many draws a start takes: for its place, and for its orientation."""
        return 3 if self.orientation is not None else 6

    def places(self, draws: Float[np.ndarray, "trials draws"]) -> Float[np.ndarray, "trials 7"]:
        """Centres and orientations (unit quaternions) from draws uniform on (0, 1).

        Random orientations are uniform on SO(3) (Shoemake 1992).
        """
        centre, spread = (np.array([float(x) for x in p]) for p in (self.centre, self.spread))
        where = centre + (2 * draws[:, :3] - 1) * spread
        if self.orientation is not None:
            turned = np.broadcast_to(_quaternion(self.orientation), (len(draws), 4))
            return np.concatenate([where, turned], axis=1)
        u, v, w = draws[:, 3:].T
        a, b = np.sqrt(1 - u), np.sqrt(u)
        v, w = 2 * math.pi * v, 2 * math.pi * w
        turned = np.stack([b * np.cos(w), a * np.sin(v), a * np.cos(v), b * np.sin(w)], axis=1)
        return np.concatenate([where, turned], axis=1)

    def corners(self) -> Float[np.ndarray, "9 3"]:
        """The box's middle and corners."""
        centre, spread = (np.array([float(x) for x in p]) for p in (self.centre, self.spread))
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        return centre + np.concatenate([np.zeros((1, 3)), signs]) * spread


def _quaternion(angles: tuple[Scalar, ...]) -> Float[np.ndarray, "4"]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("xyz", [float(a) for a in angles]).as_quat()
    return np.array([w, x, y, z])


ESCAPES: Registry[Escape] = Registry("escape rule", "pcjax.escapes", (__name__,))
"""When an object has escaped, as study files name it."""


class Escape(Component):
    """When the object has escaped from a hand in three dimensions: its centre has left a convex
    region that is made of planes."""

    @property
    def opening(self) -> tuple[np.ndarray, np.ndarray] | None:
        """A point of the plane that the hand opens in, and its unit normal outwards; None if there
        is no such plane."""
        return None

    def planes(
        self, hull: Float[np.ndarray, "planes 4"], radius: float, reach: float
    ) -> Float[np.ndarray, "sides 4"]:
        """The region's planes: a x + b y + c z + d <= 0 inside, of unit normals.

        Arguments:
            hull: those of the hull of the hand's geoms.
            radius: of the ball about the object's centre that it is in, m.
            reach: how far the fingertips reach beyond the opening, m; 0 if they do not.
        """
        raise NotImplementedError


def inflated(hull: Float[np.ndarray, "planes 4"], by: float) -> Float[np.ndarray, "sides 4"]:
    """The planes of a hull, that much further out."""
    return hull - np.array([0, 0, 0, by])


@ESCAPES.register("hull")
class HullEscape(Escape):
    """The object's centre has left the convex hull of the hand, inflated by the object.

    Arguments:
        inflation: by how many of the object's radii.
    """

    inflation: Scalar = quantity(
        "1", "by how many of the object's radii the hull is inflated", default=1.0, low=0,
        key="inflation",
    )  # fmt: skip

    def planes(
        self, hull: Float[np.ndarray, "planes 4"], radius: float, reach: float
    ) -> Float[np.ndarray, "sides 4"]:
        """See `Escape`."""
        return inflated(hull, float(self.inflation) * radius)


@ESCAPES.register("plane")
class PlaneEscape(Escape):
    """The object's centre has passed the plane that the hand opens in, or the fingertips beyond it,
    or has left the inflated hull elsewhere.

    Arguments:
        point: of the plane, in the hand's frame, m; where the fingertips have their joints.
        normal: out of the hand; of any length but 0.
    """

    point: tuple[Scalar, ...] = _place("of the plane, in the hand's frame", "point")
    normal: tuple[Scalar, ...] = quantity(
        "1", "of the plane, out of the hand", count=3, each="axis", key="normal"
    )

    def __check_init__(self) -> None:
        super().__check_init__()
        if not any(float(x) for x in self.normal):
            raise ValueError("normal is a direction of no length: it points out of the hand")

    @property
    def opening(self) -> tuple[np.ndarray, np.ndarray]:
        """See `Escape`."""
        point, normal = (np.array([float(x) for x in p]) for p in (self.point, self.normal))
        return point, normal / np.linalg.norm(normal)

    def planes(
        self, hull: Float[np.ndarray, "planes 4"], radius: float, reach: float
    ) -> Float[np.ndarray, "sides 4"]:
        """See `Escape`."""
        point, normal = self.opening
        own = np.append(normal, -(normal @ point) - reach)
        return np.vstack([own, inflated(hull, radius)])
