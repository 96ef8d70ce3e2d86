"""A frozen hand with an object in it, as MuJoCo simulates them, and how close they are."""

from __future__ import annotations

import functools
import math
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


@functools.cache
def damping_ratio(restitution: float) -> float:
    """Of a spring that only pushes, from which what runs against it comes back with that share of
    its speed."""
    from scipy.optimize import root_scalar

    if restitution <= 0:
        return 1.0

    def log_share(ratio: float) -> float:
        root = math.sqrt(abs(1 - ratio * ratio))
        if ratio < 1:
            return -2 * ratio * math.acos(ratio) / root
        return -2 * ratio * math.acosh(ratio) / root if ratio > 1 else -2.0

    stiff = log_share(1.0) > math.log(restitution)
    bracket = (1.0, 1e3) if stiff else (1e-9, 1.0)
    return float(
        root_scalar(lambda ratio: log_share(ratio) - math.log(restitution), bracket=bracket).root
    )


class Scene:
    """A hand in its posture, whose geoms are fixed to the world, and a free object.

    Attributes:
        model: MuJoCo's.
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
            solref=[2 * dt, damping_ratio(restitution)], solimp=_SOLVER_IMPEDANCE,
        )  # fmt: skip
        deepest = spec.add_sensor(
            name="deepest", type=mj.mjtSensor.mjSENS_CONTACT,
            objtype=mj.mjtObj.mjOBJ_BODY, objname=_OBJECT,
        )  # fmt: skip
        distance, least = 1 << int(mj.mjtConDataField.mjCONDATA_DIST), 1
        deepest.intprm = [distance, least, 1]
        self.model = spec.compile()


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
    scene = Scene(hand, solid, 0.0, 0.0, 0.002)
    model, data = scene.model, mj.MjData(scene.model)
    mine, count = model.ngeom - 1, len(hand.geoms)
    turned = StartBox(start.centre, start.spread, start.orientation or (0.0, 0.0, 0.0))
    (place,) = turned.places(np.full((1, 3), 0.5))
    found = []
    for corner in start.corners():
        data.qpos[:] = [*corner, *place[3:]]
        mj.mj_kinematics(model, data)
        found.append(min(mj.mj_geomDistance(model, data, mine, k, 1.0, None) for k in range(count)))
    return np.array(found)
