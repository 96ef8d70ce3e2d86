"""Whether an object in three dimensions went through something that it should have run against."""

from __future__ import annotations

import functools

import numpy as np
from jaxtyping import Bool, Float, Integer

from pcjax.importing import mujoco
from pcjax.model.spatial.bodies import Solid
from pcjax.model.spatial.frozen import Geom
from pcjax.model.spatial.scene import Scene

_CORE = 0.5
"""The part of a geom's half thickness about its middle that nothing may get into."""

Points = Float[np.ndarray, "points 3"]
States = Float[np.ndarray, "states 7"]


class Crossings:
    """Tells of a scene's trials which step went wrong.

    A step is wrong that ends with the object deeper in a geom than half of the geom's thickness, or
    than half of its own; or in which a point of the object got into a geom's core. Whether one of
    the two can be is seen at a glance for nearly every step, so few are looked at in detail.

    Arguments:
        scene: what is simulated.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        self._half = np.array([geom.solid.half_thickness for geom in scene.hand.geoms])
        self._own = scene.solid.half_thickness
        self._points = _points_of(scene.solid)
        self._radius = float(np.linalg.norm(scene.solid.points(), axis=1).max())
        self._cores = [_Core(geom) for geom in scene.hand.geoms]
        self._deepest = float(min(self._half.min(), self._own))
        self._data = mujoco().MjData(scene.model)

    def wrong(
        self,
        states: Float[np.ndarray, "trials times 7"],
        depth: Float[np.ndarray, "trials steps"],
        last: Integer[np.ndarray, " trials"] | None = None,
    ) -> Bool[np.ndarray, "trials steps"]:
        """Which steps went wrong.

        Arguments:
            states: place and orientation before each step, and after the last.
            depth: how deep the object was in any geom before each step, m; 0 where it touched none.
            last: the step of each trial after which nothing matters, such as that of its escape.
        """
        moved = lengths(np.diff(states[..., :3], axis=1))
        if len(self._points) > 1:
            cosine = np.abs(np.einsum("tsi,tsi->ts", states[:, 1:, 3:], states[:, :-1, 3:]))
            moved += 2 * np.arccos(np.minimum(cosine, 1.0)) * self._radius
        deep, far = depth > self._deepest, moved > self._deepest
        if last is not None:
            asked = np.arange(depth.shape[1]) <= last[:, None]
            deep, far = deep & asked, far & asked
        found = np.zeros(depth.shape, bool)
        for trial, step in np.argwhere(deep):
            found[trial, step] = self._too_deep(states[trial, step])
        if far.any():
            trials, steps = np.nonzero(far & ~found)
            found[trials, steps] = self._met_core(states[trials, steps], states[trials, steps + 1])
        return found

    def _too_deep(self, state: Float[np.ndarray, "7"]) -> bool:
        mj, model, data = mujoco(), self._scene.model, self._data
        data.qpos[:] = state
        mj.mj_fwdPosition(model, data)
        return any(
            -contact.dist > min(self._half[min(map(int, contact.geom))], self._own)
            for contact in data.contact[: data.ncon]
        )

    def _met_core(self, before: States, after: States) -> Bool[np.ndarray, " states"]:
        start, end = _placed(self._points, before), _placed(self._points, after)
        found = np.zeros(len(before), bool)
        for core in self._cores:
            found |= core.met(start, end).any(axis=1)
        return found


def lengths(vectors: Float[np.ndarray, "*some 3"]) -> Float[np.ndarray, "*some"]:
    """How long vectors are; several times as fast as `np.linalg.norm`."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _points_of(solid: Solid) -> Points:
    """Points of an object that stand for all of it: its middle, and its corners or ends."""
    middle = np.zeros((1, 3))
    if solid.type == "sphere":
        return middle
    if solid.type == "capsule":
        ends = np.array([[0.0, 0.0, z] for z in (-solid.size[1], solid.size[1])])
        return np.concatenate([middle, ends])
    return np.concatenate([middle, 0.9 * solid.points(8)])


def _placed(points: Points, states: States) -> Float[np.ndarray, "states points 3"]:
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat(states[:, [4, 5, 6, 3]]).as_matrix()
    return states[:, None, :3] + np.einsum("sij,pj->spi", turned, points)


class _Core:
    """The inner part of a geom."""

    def __init__(self, geom: Geom):
        self._geom = geom
        self._inset = _CORE * geom.solid.half_thickness

    @functools.cached_property
    def _planes(self) -> Float[np.ndarray, "planes 4"]:
        from scipy.spatial import ConvexHull

        planes = ConvexHull(self._geom.points()).equations
        return planes + np.array([0.0, 0.0, 0.0, self._inset])

    def met(
        self, start: Float[np.ndarray, "*some 3"], end: Float[np.ndarray, "*some 3"]
    ) -> Bool[np.ndarray, "*some"]:
        """Which straight ways go through it (Cyrus and Beck 1978)."""
        normals, offsets = self._planes[:, :3], self._planes[:, 3]
        a, b = start @ normals.T + offsets, end @ normals.T + offsets
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a / (a - b)
        enter = np.where((a > 0) & (b <= 0), at, 0.0).max(axis=-1)
        leave = np.where((a <= 0) & (b > 0), at, 1.0).min(axis=-1)
        return (enter <= leave) & ~((a > 0) & (b > 0)).any(axis=-1)
