"""A hand as the object meets it: its colliding geoms where the posture has them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from pcjax.importing import mujoco
from pcjax.model.spatial.bodies import Points, Solid
from pcjax.model.spatial.hand import SpatialHand

_MOST_OVERLAP = 1e-3
"""How far geoms of a posture may overlap, m, beyond what they do in the file's own."""

_SOLIDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")


@dataclass(frozen=True)
class Geom:
    """A convex geom of a hand in a posture.

    Attributes:
        name: as messages call it.
        parts: its own name and its body's.
        solid: its shape.
        place: its centre in the hand's frame, m.
        axes: its own axes, as columns.
    """

    name: str
    parts: tuple[str, str]
    solid: Solid
    place: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]

    def points(self) -> Points:
        """Points whose convex hull it is."""
        return self.solid.points() @ self.axes.T + self.place

    def mirrored(self, point: np.ndarray, normal: np.ndarray) -> Geom:
        """Its image in a plane. Its solid is the same but for a mesh: all others have a plane of
        symmetry across their z axis."""
        flip = np.eye(3) - 2 * np.outer(normal, normal)
        own = np.diag([1.0, 1.0, -1.0])
        solid = self.solid
        if solid.vertices is not None:
            solid = replace(solid, vertices=solid.vertices @ own)
        place = point + flip @ (self.place - point)
        return replace(self, solid=solid, place=place, axes=flip @ self.axes @ own)


@dataclass(frozen=True)
class FrozenHand:
    """The geoms of a hand in its posture, and what follows from them.

    Attributes:
        geoms: those that collide.
        overlap: how deep geoms that should not meet do so, m, beyond `_MOST_OVERLAP`; 0 if none do.
        overlapping: names of the two that overlap most.
    """

    geoms: tuple[Geom, ...]
    overlap: float = 0.0
    overlapping: tuple[str, str] = ("", "")

    @functools.cached_property
    def hull(self) -> Float[np.ndarray, "planes 4"]:
        """Planes of the convex hull of all geoms, of unit normals outwards."""
        from scipy.spatial import ConvexHull

        points = np.concatenate([geom.points() for geom in self.geoms])
        return np.unique(ConvexHull(points).equations.round(12), axis=0)

    @functools.cached_property
    def size(self) -> float:
        """The diagonal of the box about all geoms, m."""
        points = np.concatenate([geom.points() for geom in self.geoms])
        return float(np.linalg.norm(np.ptp(points, axis=0)))

    @functools.cached_property
    def thinnest(self) -> Geom:
        """The geom of the least thickness."""
        return min(self.geoms, key=lambda geom: geom.solid.half_thickness)

    def reach(self, names: Sequence[str], point: np.ndarray, normal: np.ndarray) -> float:
        """How far the middles of some geoms reach beyond a plane, m; 0 if they do not."""
        beyond = [
            float(((geom.points() - point) @ normal).max()) - geom.solid.half_thickness
            for geom in self.geoms
            if not set(names).isdisjoint(geom.parts)
        ]
        return max([0.0, *beyond])

    def mirrored(self, names: Sequence[str], point: np.ndarray, normal: np.ndarray) -> FrozenHand:
        """The hand with some geoms mirrored in a plane."""
        return FrozenHand(
            tuple(
                geom if set(names).isdisjoint(geom.parts) else geom.mirrored(point, normal)
                for geom in self.geoms
            )
        )


_MOST_KEPT = 64
_kept: dict[tuple[Any, ...], FrozenHand] = {}


def frozen(hand: SpatialHand) -> FrozenHand:
    """The hand's geoms in its posture; kept, since a search asks several times.

    Raises:
        ValueError: no geom of the hand collides, or one is no solid.
    """
    key = hand.key
    if key not in _kept:
        made = _freeze(hand)
        while len(_kept) >= _MOST_KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = made
    return _kept[key]


@dataclass(frozen=True)
class Posed:
    """A hand file's model in the hand's posture.

    Attributes:
        model, data: MuJoCo's, in the file's own frame.
        origin, frame: of the hand, in that one.
        below: of each body, whether it is the hand's.
    """

    model: Any
    data: Any
    origin: Float[np.ndarray, "3"]
    frame: Float[np.ndarray, "3 3"]
    below: Bool[np.ndarray, " bodies"]

    def parts_of(self, geom: int) -> tuple[str, str]:
        """The name of a geom and of its body."""
        model = self.model
        return model.geom(geom).name, model.body(model.geom_bodyid[geom]).name

    def place_of(self, geom: int) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
        """A geom's centre and axes in the hand's frame."""
        place = (self.data.geom_xpos[geom] - self.origin) @ self.frame
        return place, self.frame.T @ self.data.geom_xmat[geom].reshape(3, 3)

    def collides(self, geom: int) -> bool:
        """Whether a geom is one that anything can touch."""
        return bool(self.model.geom_contype[geom] or self.model.geom_conaffinity[geom])


def posed(hand: SpatialHand) -> Posed:
    """The hand's file in its posture."""
    mj, source = mujoco(), hand.source
    model = _scaled(hand) if hand.links else source.model
    data = mj.MjData(model)
    for joint, value in zip(hand.joints, hand.posture, strict=True):
        data.qpos[source.joints[joint][0]] = float(value)
    mj.mj_kinematics(model, data)
    root = model.body(hand.root).id if hand.root else 0
    below = np.zeros(model.nbody, bool)
    for body in range(model.nbody):  # parents come before their children
        below[body] = body == root or (body > 0 and below[model.body_parentid[body]])
    origin, frame = data.xpos[root].copy(), data.xmat[root].reshape(3, 3).copy()
    return Posed(model, data, origin, frame, below)


def _freeze(hand: SpatialHand) -> FrozenHand:
    mj, there = mujoco(), posed(hand)
    model, data = there.model, there.data
    collide = [
        k for k in range(model.ngeom) if there.below[model.geom_bodyid[k]] and there.collides(k)
    ]
    chosen = [k for k in collide if set(hand.exclude).isdisjoint(there.parts_of(k))]
    if not chosen:
        why = (
            f"is left: exclude takes out all {len(collide)} that collide"
            if collide
            else "collides (contype and conaffinity are 0)"
        )
        raise ValueError(
            f"no geom of {hand.root or 'the hand'} in {hand.file} {why}: nothing can hold an object"
        )
    geoms = tuple(
        Geom(
            _name_of(model, k),
            there.parts_of(k),
            _solid_of(mj, model, k),
            *there.place_of(k),
        )
        for k in chosen
    )
    return FrozenHand(geoms, *_overlap(mj, model, data, chosen))


def _scaled(hand: SpatialHand) -> Any:
    """The model in which some links are larger or smaller."""
    spec = hand.source.spec.copy()
    model = hand.source.model
    for link, value in zip(hand.links, hand.scales, strict=True):
        body, factor = spec.body(link), float(value)
        for geom in body.geoms:
            if geom.type == mujoco().mjtGeom.mjGEOM_MESH:
                raise ValueError(
                    f"scale: {link} in {hand.file} is made of meshes, and only spheres, capsules, "
                    "cylinders, ellipsoids and boxes can be scaled"
                )
            row = model.geom_bodyid == model.body(link).id
            geom.fromto = np.full(6, np.nan)
            k = np.flatnonzero(row)[list(body.geoms).index(geom)]
            geom.pos, geom.size = model.geom_pos[k] * factor, model.geom_size[k] * factor
            geom.quat = model.geom_quat[k]
            geom.alt.type = mujoco().mjtOrientation.mjORIENTATION_QUAT
        for part in (*body.bodies, *body.joints):
            part.pos = np.asarray(part.pos) * factor
    # Masses do not count here, and MuJoCo refuses those of small links.
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-12
    return spec.compile()


def _name_of(model: Any, geom: int) -> str:
    own, body = model.geom(geom).name, int(model.geom_bodyid[geom])
    if own:
        return f"geom {own}"
    number = geom - int(model.body_geomadr[body]) + 1
    return f"geom {number} of body {model.body(body).name}"


def _solid_of(mj: Any, model: Any, geom: int) -> Solid:
    kind = mj.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    if kind not in _SOLIDS:
        raise ValueError(
            f"{_name_of(model, geom)} is a {kind}: a hand is made of {', '.join(_SOLIDS)}; exclude "
            "it"
        )
    sizes = {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3)
    if kind != "mesh":
        return Solid(kind, tuple(map(float, model.geom_size[geom][:sizes])))
    from scipy.spatial import ConvexHull

    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.array(model.mesh_vert[first : first + count], float)
    vertices = vertices[ConvexHull(vertices).vertices]
    return Solid("mesh", tuple(0.5 * np.ptp(vertices, axis=0)), vertices)


def _overlap(
    mj: Any, model: Any, data: Any, chosen: Sequence[int]
) -> tuple[float, tuple[str, str]]:
    """How deep two of the geoms are in each other that no joint is between alone, as MuJoCo's own
    collisions tell; changes the data."""

    def depths() -> dict[tuple[int, int], float]:
        mj.mj_fwdPosition(model, data)
        found: dict[tuple[int, int], float] = {}
        for contact in data.contact[: data.ncon]:
            pair = int(contact.geom[0]), int(contact.geom[1])
            if set(pair) <= set(chosen) and not _joined(model, *pair):
                found[pair] = max(found.get(pair, 0.0), -float(contact.dist))
        return found

    here = depths()
    if not here:
        return 0.0, ("", "")
    data.qpos[:] = model.qpos0
    usual = depths()
    excess = {pair: depth - usual.get(pair, 0.0) - _MOST_OVERLAP for pair, depth in here.items()}
    worst = max(excess, key=lambda pair: excess[pair])
    names = _name_of(model, worst[0]), _name_of(model, worst[1])
    return max(excess[worst], 0.0), names


def _joined(model: Any, one: int, other: int) -> bool:
    """Whether two geoms are of one link, or of links that a joint joins."""
    a, b = (int(model.body_weldid[model.geom_bodyid[geom]]) for geom in (one, other))
    above_a, above_b = (int(model.body_weldid[model.body_parentid[body]]) for body in (a, b))
    return a in (b, above_b) or b == above_a
