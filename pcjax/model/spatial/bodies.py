"""Objects in three dimensions. Lengths are in metres; each is of uniform density."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from pcjax.components import Registry, quantity
from pcjax.geometry import Scalar
from pcjax.importing import mujoco
from pcjax.model.bodies.base import Body
from pcjax.words import one_line

Numbers = tuple[float, ...]
Points = Float[np.ndarray, "points 3"]

SPATIAL_BODIES: Registry[SpatialBody] = Registry("object", "pcjax.objects", (__name__,))
"""Objects in three dimensions, as study files name them."""

register_object = SPATIAL_BODIES.register


@dataclass(frozen=True)
class Solid:
    """A convex solid as MuJoCo has it, in its own axes.

    Attributes:
        type: "sphere", "capsule", "cylinder", "ellipsoid", "box" or "mesh".
        size: as MuJoCo has it for that type.
        vertices: of a mesh, those of its hull.
    """

    type: str
    size: Numbers
    vertices: Points | None = None

    @property
    def half_thickness(self) -> float:
        """Half of its least width, m; of a mesh the radius of the largest ball in its hull."""
        if self.vertices is not None:
            return _inradius(self.vertices)
        return min(self.size[: 1 if self.type in ("sphere", "capsule") else None])

    def points(self, per_turn: int = 16) -> Points:
        """Points whose convex hull is the solid, or close to it."""
        if self.vertices is not None:
            return self.vertices
        return _points_of(self.type, self.size, per_turn)

    def scaled(self, factor: float) -> Solid:
        """The same, that many times as large."""
        vertices = None if self.vertices is None else self.vertices * factor
        return Solid(self.type, tuple(factor * x for x in self.size), vertices)


@functools.lru_cache(maxsize=256)
def _points_of(type: str, size: Numbers, per_turn: int) -> Points:
    if type == "box":
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        return signs * size
    turns = np.arange(per_turn) * 2 * math.pi / per_turn
    circle = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    if type == "cylinder":
        radius, half = size
        return np.concatenate([circle * radius + [0, 0, z] for z in (-half, half)])
    heights = np.sin(np.linspace(-math.pi / 2, math.pi / 2, per_turn // 2 + 1))
    ball = np.concatenate([circle * math.sqrt(max(1 - z * z, 0.0)) + [0, 0, z] for z in heights])
    if type == "capsule":
        radius, half = size
        return np.concatenate([ball * radius + [0, 0, z] for z in (-half, half)])
    return ball * np.broadcast_to(size, 3)


def _inradius(vertices: Points) -> float:
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull

    planes = ConvexHull(vertices).equations
    rows = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = linprog(
        [0, 0, 0, -1], A_ub=rows, b_ub=-planes[:, 3], bounds=[(None, None)] * 3 + [(0, None)]
    )
    return float(found.x[3])


class SpatialBody(Body):
    """An object in three dimensions; its radius is that of the ball about its centre that it is in,
    and its width its least one: no gap that is narrower lets it through."""

    noun: ClassVar[str] = "object"

    def solid(self) -> Solid:
        """Its shape."""
        raise NotImplementedError

    @property
    def radius(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of the ball about its centre that it is in, m."""
        return float(np.linalg.norm(self.solid().points(), axis=1).max())

    @property
    def width(self) -> float:
        """Its least width, m."""
        return 2 * self.solid().half_thickness

    def size_in_words(self) -> str:
        """Its radii and half lengths in mm."""
        return " x ".join(f"{1000 * x:.4g}" for x in self.solid().size) + " mm"


def _length(key: str, help: str) -> Any:
    return quantity("length", help, low=0, above=True, key=key)


@register_object("sphere")
class Sphere(SpatialBody):
    """A ball.

    Arguments:
        ball_radius: m.

    Examples:
        >>> from pcjax.model.spatial.bodies import Sphere
        >>> Sphere(0.02).width
        0.04
    """

    ball_radius: Scalar = _length("radius", "its radius")

    noun = "ball of radius"

    def solid(self) -> Solid:
        """Its shape."""
        return Solid("sphere", (float(self.ball_radius),))


@register_object("box")
class Box(SpatialBody):
    """A cuboid.

    Arguments:
        side_x, side_y, side_z: its sides along its own axes, m.
    """

    side_x: Scalar = _length("side_x", "side along its own x axis")
    side_y: Scalar = _length("side_y", "side along its own y axis")
    side_z: Scalar = _length("side_z", "side along its own z axis")

    noun = "box of half sides"

    def solid(self) -> Solid:
        """Its shape."""
        return Solid("box", tuple(0.5 * float(x) for x in (self.side_x, self.side_y, self.side_z)))


class _Round(SpatialBody):
    """A solid of revolution about its own z axis."""

    axis_radius: Scalar = _length("radius", "its radius")
    length: Scalar = _length("length", "its length along its own z axis, without round ends")

    def solid(self) -> Solid:
        """Its shape."""
        kind = SPATIAL_BODIES.kind_of(self)
        return Solid(kind, (float(self.axis_radius), 0.5 * float(self.length)))


@register_object("capsule")
class SpatialCapsule(_Round):
    """A cylinder with round ends.

    Arguments:
        axis_radius: m.
        length: between the centres of its ends, m.
    """

    noun = "capsule of radius and half length"


@register_object("cylinder")
class Cylinder(_Round):
    """A cylinder.

    Arguments:
        axis_radius: m.
        length: m.
    """

    noun = "cylinder of radius and half length"


@register_object("ellipsoid")
class Ellipsoid(SpatialBody):
    """An ellipsoid.

    Arguments:
        semi_axis_x, semi_axis_y, semi_axis_z: m.
    """

    semi_axis_x: Scalar = _length("semi_axis_x", "semi-axis along its own x axis")
    semi_axis_y: Scalar = _length("semi_axis_y", "semi-axis along its own y axis")
    semi_axis_z: Scalar = _length("semi_axis_z", "semi-axis along its own z axis")

    noun = "ellipsoid of semi-axes"

    def solid(self) -> Solid:
        """Its shape."""
        axes = self.semi_axis_x, self.semi_axis_y, self.semi_axis_z
        return Solid("ellipsoid", tuple(map(float, axes)))


@register_object("mesh")
class Mesh(SpatialBody):
    """The convex hull of a mesh, about its centre of mass.

    Arguments:
        file: STL, OBJ or MSH.
        scale: how many times as large, such as 0.001 for a file in mm.

    Raises:
        ValueError: there is no such file, or it has no volume.
    """

    file: str = quantity("1", "the mesh: STL, OBJ or MSH", kind=str, static=True, key="file")
    scale: Scalar = quantity(
        "1", "how many times as large", default=1.0, low=0, above=True, key="scale"
    )

    noun = "hull of a mesh, in a box of half sides"

    def __check_init__(self) -> None:
        super().__check_init__()
        _hull_of(self.file)

    def solid(self) -> Solid:
        """Its shape; the size is that of the box about it."""
        vertices = _hull_of(self.file) * float(self.scale)
        return Solid("mesh", tuple(0.5 * np.ptp(vertices, axis=0)), vertices)


@functools.cache
def _hull_of(file: str) -> Points:
    """The vertices of a mesh's hull, seen from the hull's centre of mass."""
    if not Path(file).is_file():
        raise ValueError(f"there is no mesh file {file}")
    mj = mujoco()
    spec = mj.MjSpec()
    spec.add_mesh(name="mesh", file=str(Path(file).resolve()))
    spec.worldbody.add_geom(type=mj.mjtGeom.mjGEOM_MESH, meshname="mesh")
    try:
        model = spec.compile()
    except ValueError as error:
        raise ValueError(f"{file} cannot be used as a mesh: {one_line(error)}") from None
    return centred_hull(np.array(model.mesh_vert, float))


def centred_hull(points: Points) -> Float[np.ndarray, "corners 3"]:
    """The vertices of the points' convex hull, seen from its centre of mass.

    Raises:
        ValueError: they lie in a plane.
    """
    from scipy.spatial import ConvexHull, Delaunay, QhullError

    try:
        corners = points[ConvexHull(points).vertices]
        cells = corners[Delaunay(corners).simplices]
    except QhullError:
        raise ValueError("a mesh needs four points that are not in one plane") from None
    volumes = np.abs(np.linalg.det(cells[:, 1:] - cells[:, :1]))
    return corners - volumes @ cells.mean(axis=1) / volumes.sum()
