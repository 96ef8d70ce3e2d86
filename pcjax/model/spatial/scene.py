"""A frozen hand with an object in it, as MuJoCo simulates them, and how close they are."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from pcjax.importing import mujoco
from pcjax.model.spatial.bodies import Solid
from pcjax.model.spatial.frozen import FrozenHand
from pcjax.model.spatial.regions import StartBox

_SOLVER_IMPEDANCE = (0.9999, 0.9999, 1.0, 0.5, 2.0)
"""MuJoCo's `solimp`: contacts as hard as may be."""

_ALL = 0x7FFFFFFF

_OBJECT = "held object"


_SHARE = 0.05
"""Of an overlap, what a step takes out."""


def direct_law(restitution: float, dt: float) -> tuple[float, float]:
    """MuJoCo's `solref` for contacts that keep that share of the speed of an impact on average.

    A step with overlap p and approach v ends with a speed of e v + `_SHARE` (p / dt - v / 2) apart.
    So an impact is over within a step, wherever in it it falls. A spring and a damper (a positive
    `solref`) take several, keep between nothing and half as much again, and gain energy where
    restitution is high.
    """
    least = max(restitution, _SHARE / 2)
    return -_SHARE / dt**2, -(1 + least - _SHARE / 2) / dt


class Scene:
    """A hand in its posture, whose geoms are fixed to the world, and a free object.

    Attributes:
        spec, model: MuJoCo's.
        hand, solid: what is in it.
        dt: the step, s.
    """

    def __init__(
        self, hand: FrozenHand, solid: Solid, restitution: float, friction: float, dt: float
    ):
        mj = mujoco()
        self.hand, self.solid, self.dt = hand, solid, dt
        spec = mj.MjSpec()
        spec.option.timestep = dt
        spec.option.gravity = [0, 0, 0]
        spec.option.cone = mj.mjtCone.mjCONE_ELLIPTIC
        # Else MuJoCo refuses specks, which are to be refused in our words.
        spec.compiler.boundmass = spec.compiler.boundinertia = 1e-12
        for geom in hand.geoms:
            _add(
                mj, spec, spec.worldbody, geom.solid,
                pos=geom.place, quat=_quaternion(mj, geom.axes), contype=1, conaffinity=1,
            )  # fmt: skip
        body = spec.worldbody.add_body(name=_OBJECT)
        body.add_freejoint()
        _add(
            mj, spec, body, solid,
            mass=1.0, contype=_ALL, conaffinity=_ALL, priority=1,
            condim=3 if friction > 0 else 1, friction=[friction, 0.0, 0.0],
            solref=direct_law(restitution, dt), solimp=_SOLVER_IMPEDANCE,
        )  # fmt: skip
        deepest = spec.add_sensor(
            name="deepest", type=mj.mjtSensor.mjSENS_CONTACT,
            objtype=mj.mjtObj.mjOBJ_BODY, objname=_OBJECT,
        )  # fmt: skip
        distance, least = 1 << int(mj.mjtConDataField.mjCONDATA_DIST), 1
        deepest.intprm = [distance, least, 1]
        self.spec, self.model = spec, spec.compile()


def _add(mj: Any, spec: Any, body: Any, solid: Solid, **more: Any) -> None:
    kind = getattr(mj.mjtGeom, f"mjGEOM_{solid.type.upper()}")
    if solid.vertices is None:
        body.add_geom(type=kind, size=[*solid.size, 0.0, 0.0][:3], **more)
        return
    name = f"mesh {len(spec.meshes)}"
    spec.add_mesh(name=name, uservert=solid.vertices.ravel().tolist())
    body.add_geom(type=kind, meshname=name, **more)


def _quaternion(mj: Any, axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4"]:
    found = np.zeros(4)
    mj.mju_mat2Quat(found, axes.ravel())
    return found


def clearances(hand: FrozenHand, solid: Solid, start: StartBox) -> Float[np.ndarray, " places"]:
    """How far the object is from the hand at the middle and the corners of its starts, m; below 0
    where it overlaps. One that starts at any angle is taken as the ball about it."""
    mj = mujoco()
    if start.orientation is None:
        solid = Solid("sphere", (float(np.linalg.norm(solid.points(), axis=1).max()),))
    model, data = _room_of(hand, solid).placed(hand)
    mine, count = model.ngeom - 1, len(hand.geoms)
    turned = StartBox(start.centre, start.spread, start.orientation or (0.0, 0.0, 0.0))
    (place,) = turned.places(np.full((1, 3), 0.5))
    found = []
    for corner in start.corners():
        data.qpos[:] = [*corner, *place[3:]]
        mj.mj_kinematics(model, data)
        found.append(min(mj.mj_geomDistance(model, data, mine, k, 1.0, None) for k in range(count)))
    return np.array(found)


class _Room:
    """A scene whose geoms can be placed anew, which takes a tenth of making one."""

    def __init__(self, hand: FrozenHand, solid: Solid):
        mj = mujoco()
        self._model = Scene(hand, solid, 0.0, 0.0, 0.002).model
        self._model.geom_sameframe[:] = 0  # else a geom at the origin stays there
        self._data = mj.MjData(self._model)
        # MuJoCo turns meshes to their principal axes.
        self._own = []
        for k, geom in enumerate(hand.geoms):
            turned = np.zeros(9)
            mj.mju_quat2Mat(turned, self._model.geom_quat[k])
            moved = self._model.geom_pos[k] - geom.place
            self._own.append((geom.axes.T @ moved, geom.axes.T @ turned.reshape(3, 3)))

    def placed(self, hand: FrozenHand) -> tuple[Any, Any]:
        """MuJoCo's model and data, with a hand of the same solids elsewhere."""
        mj = mujoco()
        for k, (geom, (moved, turned)) in enumerate(zip(hand.geoms, self._own, strict=True)):
            self._model.geom_pos[k] = geom.place + geom.axes @ moved
            self._model.geom_quat[k] = _quaternion(mj, geom.axes @ turned)
        return self._model, self._data


_MOST_ROOMS = 8
_rooms: dict[Any, _Room] = {}


def _room_of(hand: FrozenHand, solid: Solid) -> _Room:
    """The room for a hand's solids and an object; kept, since postures of a hand have it alike."""

    def told(one: Solid) -> Any:
        return one.type, one.size, None if one.vertices is None else one.vertices.tobytes()

    key = told(solid), *(told(geom.solid) for geom in hand.geoms)
    if key not in _rooms:
        while len(_rooms) >= _MOST_ROOMS:
            del _rooms[next(iter(_rooms))]
        _rooms[key] = _Room(hand, solid)
    return _rooms[key]
