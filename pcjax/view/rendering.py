"""Hands in three dimensions as pictures, which MuJoCo renders offscreen.

The hand is drawn from its own file, in its posture: with the geoms that are there to be seen, where
a body has some, else with those that collide. Nothing of it is simulated: what moves is where the
object was in a trial of the bare hand.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import TracebackType
from typing import Any, Self

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.colors import to_rgba

from pcjax.importing import RENDERING, mujoco
from pcjax.model.spatial.bodies import Solid
from pcjax.model.spatial.frozen import posed
from pcjax.model.spatial.hand import SpatialHand
from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.view.shapes import COLOURS

SIZE = 640, 480
"""Width and height of a picture, pixels."""

_ELEVATION = 25.0
"""Of the camera above what it looks at, degrees."""

_FIELD = 30.0
"""How much the camera sees from bottom to top, degrees."""

_DIRECTIONS = 16
"""From which it may look."""

_GREY = (0.62, 0.66, 0.72, 1.0)
"""What has no colour of its own, as MuJoCo's geoms are unless said otherwise."""

_NO_COLOUR = (0.5, 0.5, 0.5, 1.0)

_HIDDEN, _THROUGH = 0.5, 0.6
"""Where less of the object is seen than that share of it, one sees through the hand: its opacity is
the other."""

_FAINT = 0.25
"""How much is seen of what is no part of the hand."""

_BACKGROUND = (0.93, 0.95, 0.97)

_ARROW = (0.2, 0.2, 0.2, 1.0)

_OFF = ("disable", "disabled", "off", "false", "0")
"""What MUJOCO_GL says where nothing is to be rendered."""

_MOST_GEOMS = 20_000

Pixels = UInt8[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class Part:
    """Something to be seen of a hand.

    Attributes:
        solid: its shape; the vertices of a mesh are those of its faces.
        place, axes: in the hand's frame, m; axes are columns.
        colour: red, green, blue and opacity, 0 to 1.
        faces: of a mesh, three vertices each; its hull unless given.
        met: whether it is as the object meets it.
    """

    solid: Solid
    place: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    colour: tuple[float, ...] = _GREY
    faces: Any = None
    met: bool = True


def parts_seen(hand: SpatialHand) -> list[Part]:
    """A hand as its file draws it; what is excluded from it is faint."""
    there = posed(hand)
    model = there.model
    shapes = [_solid_seen(model, k) for k in range(model.ngeom)]
    mine = [
        k for k, one in enumerate(shapes) if one is not None and there.below[model.geom_bodyid[k]]
    ]
    # A body that has geoms only to be seen is not drawn by those that collide.
    dressed = {int(model.geom_bodyid[k]) for k in mine if not there.collides(k)}
    found = []
    for k in mine:
        if there.collides(k) and int(model.geom_bodyid[k]) in dressed:
            continue
        solid, faces = shapes[k]  # pyright: ignore[reportGeneralTypeIssues]
        red, green, blue, opacity = _colour_of(model, k)
        own = set(hand.exclude).isdisjoint(there.parts_of(k))
        colour = red, green, blue, opacity if own else _FAINT * opacity
        met = own and there.collides(k)
        found.append(Part(solid, *there.place_of(k), colour, faces, met))
    return found


def _solid_seen(model: Any, geom: int) -> tuple[Solid, Any] | None:
    """A geom's shape and a mesh's faces; None if it is of a kind that has no end, or cannot be
    seen."""
    kind = mujoco().mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    if kind in ("sphere", "capsule", "cylinder", "ellipsoid", "box"):
        count = {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3)
        return Solid(kind, tuple(map(float, model.geom_size[geom][:count]))), None
    if kind != "mesh":
        return None
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.array(model.mesh_vert[first : first + count], float)
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    faces = np.array(model.mesh_face[first : first + count])
    return Solid("mesh", tuple(0.5 * np.ptp(vertices, axis=0)), vertices), faces


def _colour_of(model: Any, geom: int) -> tuple[float, ...]:
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    plain = np.allclose(own, _NO_COLOUR)
    if plain and material < 0:
        return _GREY
    return tuple(map(float, model.mat_rgba[material] if plain and material >= 0 else own))


def parts_met(scenario: SpatialScenario) -> list[Part]:
    """A hand as the object meets it: the geoms that collide, for EoEn in the mirror."""
    return [Part(geom.solid, geom.place, geom.axes) for geom in scenario.seen().geoms]


def check_rendering() -> None:
    """Fails before the work where nothing can be rendered.

    Raises:
        ValueError: there is no EGL, nor what MUJOCO_GL asks for instead.
    """
    _context(8, 8).free()


def _context(width: int, height: int) -> Any:
    """An OpenGL context, made current: on Linux EGL's, or OSMesa's where MUJOCO_GL asks for it."""
    mj, asked = mujoco(), os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in _OFF:
        raise ValueError(f"MUJOCO_GL={asked}, so nothing is rendered: {RENDERING}")
    kind = "osmesa" if asked == "osmesa" else "egl"
    try:
        made = importlib.import_module(f"mujoco.{kind}") if sys.platform == "linux" else mj
        context = made.GLContext(width, height)
        context.make_current()
    except Exception:  # of every kind, where something of OpenGL is missing
        raise ValueError(f"nothing can be rendered here: {RENDERING}") from None
    return context


class Stage:
    """A hand with an object in it in front of a camera; to be closed, and used by the thread that
    has made it alone.

    The world is fixed and the hand tilts, about the centre of its hull. The camera is 25 deg above
    that, on the side from which most of the object is seen at its start, unless that is said.

    Arguments:
        scenario: the condition.
        parts: what is drawn of the hand; unless given, `parts_seen`, or `parts_met` where the
            object has to enter.
        azimuth: where the camera is, degrees about the vertical.
        size: width and height of pictures, pixels.
        opacity: of the hand, 0 to 1; less than 1 where it hides the object unless given.

    Raises:
        ValueError: nothing can be rendered here.
    """

    def __init__(
        self,
        scenario: SpatialScenario,
        parts: Sequence[Part] | None = None,
        *,
        azimuth: float | None = None,
        size: tuple[int, int] = SIZE,
        opacity: float | None = None,
    ):
        mj = mujoco()
        if parts is None:
            parts = parts_met(scenario) if scenario.mirrored else parts_seen(scenario.hand)
        self.scenario, self.size = scenario, size
        points = np.concatenate([geom.points() for geom in scenario.seen().geoms])
        self._centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = float(np.linalg.norm(points - self._centre, axis=1).max())
        self._reach = reach + scenario.body.radius
        self._model = _compiled(mj, scenario, parts, self._centre, self._reach, size)
        self._posed: Any = mj.MjData(self._model)
        self._scene = mj.MjvScene(self._model, _MOST_GEOMS)
        self._camera = mj.MjvCamera()
        self._camera.distance = self._reach / math.sin(math.radians(_FIELD / 2))
        self._camera.elevation = -_ELEVATION
        self._gl: Any = _context(*size)
        self._drawn = mj.MjrContext(self._model, mj.mjtFontScale.mjFONTSCALE_100.value)
        mj.mjr_setBuffer(mj.mjtFramebuffer.mjFB_OFFSCREEN.value, self._drawn)
        self._camera.azimuth = self._best_azimuth() if azimuth is None else azimuth
        if opacity is None:
            opacity = 1.0 if self._share_seen() >= _HIDDEN else _THROUGH
        self._fade(opacity)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Gives back what OpenGL holds."""
        if self._gl is not None:
            self._gl.make_current()
            self._drawn.free()
            self._gl.free()
            self._gl = None

    @property
    def azimuth(self) -> float:
        """Where the camera is, degrees."""
        return float(self._camera.azimuth)

    def look_from(self, azimuth: float) -> None:
        """Puts the camera elsewhere, degrees about the vertical."""
        self._camera.azimuth = azimuth

    def picture(
        self,
        state: Float[np.ndarray, "7"] | None = None,
        angles: Float[np.ndarray, "2"] | None = None,
        trail: Float[np.ndarray, "places 3"] | None = None,
    ) -> Pixels:
        """What the camera sees.

        Arguments:
            state: the object's place and unit quaternion in the hand's frame; in the middle of its
                starts unless given.
            angles: T1 and T2, radians; 0 unless given.
            trail: where its centre was, in the hand's frame.
        """
        turned = self._place(state, angles)
        if trail is not None:
            self._draw_trail((trail - self._centre) @ turned.T)
        self._draw_gravity()
        return self._rendered()

    def _place(
        self, state: Float[np.ndarray, "7"] | None, angles: Float[np.ndarray, "2"] | None
    ) -> Float[np.ndarray, "3 3"]:
        """Puts hand and object where they are; what takes the hand's frame to the world."""
        mj = mujoco()
        data: Any = self._posed
        start = self.scenario.hand.start
        first = start.places(np.full((1, start.draws), 0.5))[0]
        there: Any = first if state is None else state
        turned = self.scenario.attitude(np.zeros(2) if angles is None else angles)
        quaternion = np.zeros(4)
        mj.mju_mat2Quat(quaternion, turned.ravel())
        data.mocap_pos[0], data.mocap_quat[0] = 0.0, quaternion
        data.mocap_pos[1] = turned @ (there[:3] - self._centre)
        mj.mju_mulQuat(data.mocap_quat[1], quaternion, there[3:])
        mj.mj_kinematics(self._model, data)
        mj.mj_camlight(self._model, data)
        mj.mjv_updateScene(
            self._model, data, mj.MjvOption(), None, self._camera,
            mj.mjtCatBit.mjCAT_ALL.value, self._scene,
        )  # fmt: skip
        return turned

    def _rendered(self) -> Pixels:
        mj, (width, height) = mujoco(), self.size
        pixels = np.empty((height, width, 3), np.uint8)
        view = mj.MjrRect(0, 0, width, height)
        self._gl.make_current()
        mj.mjr_render(view, self._scene, self._drawn)
        mj.mjr_readPixels(pixels, None, view, self._drawn)
        return pixels[::-1]

    def _draw_trail(self, places: Float[np.ndarray, "places 3"]) -> None:
        kind, colour = mujoco().mjtGeom.mjGEOM_CAPSULE, np.array(to_rgba(COLOURS[0]))
        width = 0.009 * self._reach
        for one, other in pairwise(places):
            self._connect(kind, width, one, other, colour)

    def _draw_gravity(self) -> None:
        """Down in the world, in the picture's upper left corner."""
        way = math.radians(self._camera.azimuth)
        left = np.array([-math.sin(way), math.cos(way), 0.0])
        tail = 0.95 * self._reach * left + [0, 0, 0.78 * self._reach]
        tip = tail - [0, 0, 0.36 * self._reach]
        arrow = mujoco().mjtGeom.mjGEOM_ARROW
        self._connect(arrow, 0.022 * self._reach, tail, tip, np.array(_ARROW))

    def _connect(self, kind: Any, width: float, one: Any, other: Any, colour: Any) -> None:
        mj, scene = mujoco(), self._scene
        if scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        mj.mjv_initGeom(
            geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colour.astype(np.float32)
        )
        mj.mjv_connector(geom, kind, width, one, other)
        scene.ngeom += 1

    def _best_azimuth(self) -> float:
        """From where most of the object is seen."""
        seen = {}
        for k in range(_DIRECTIONS):
            self._camera.azimuth = 360.0 * k / _DIRECTIONS - 135.0
            seen[self.azimuth] = self._pixels_of_object()
        return max(seen, key=lambda azimuth: seen[azimuth])

    def _share_seen(self) -> float:
        """How much of the object the hand leaves to be seen, 0 to 1."""
        seen = self._pixels_of_object()
        opacities = self._model.geom_rgba[:-1, 3].copy()
        self._model.geom_rgba[:-1, 3] = 0.0
        whole = self._pixels_of_object()
        self._model.geom_rgba[:-1, 3] = opacities
        return seen / max(whole, 1)

    def _fade(self, opacity: float) -> None:
        self._model.geom_rgba[:-1, 3] *= opacity

    def _pixels_of_object(self) -> int:
        """How many show it, at its start."""
        mj, scene = mujoco(), self._scene
        flags = scene.flags.copy()
        self._place(None, None)
        for flag in (mj.mjtRndFlag.mjRND_SEGMENT, mj.mjtRndFlag.mjRND_IDCOLOR):
            scene.flags[flag] = 1
        numbers = self._rendered().astype(int) @ [1, 1 << 8, 1 << 16]
        np.copyto(scene.flags, flags)
        held = scene.geoms[scene.ngeom - 1]  # it comes last
        return int((numbers == held.segid + 1).sum())


def _compiled(
    mj: Any,
    scenario: SpatialScenario,
    parts: Sequence[Part],
    centre: Float[np.ndarray, "3"],
    reach: float,
    size: tuple[int, int],
) -> Any:
    """The model that is drawn: the hand and the object as two bodies that are put somewhere."""
    spec = mj.MjSpec()
    spec.stat.extent, spec.stat.center = reach, [0, 0, 0]
    look = spec.visual
    look.global_.offwidth, look.global_.offheight, look.global_.fovy = *size, _FIELD
    look.map.znear, look.map.zfar = 0.5, 20.0
    look.quality.offsamples = 4
    look.headlight.ambient, look.headlight.diffuse = [0.42] * 3, [0.28] * 3
    look.headlight.specular = [0.1] * 3
    sky, flat = mj.mjtTexture.mjTEXTURE_SKYBOX, mj.mjtBuiltin.mjBUILTIN_FLAT
    spec.add_texture(
        name="sky", type=sky, builtin=flat, rgb1=_BACKGROUND, rgb2=_BACKGROUND, width=8, height=8
    )
    cube, checks = mj.mjtTexture.mjTEXTURE_CUBE, mj.mjtBuiltin.mjBUILTIN_CHECKER
    bright = np.array(to_rgba(COLOURS[1])[:3])
    spec.add_texture(
        name="checks", type=cube, builtin=checks, rgb1=bright, rgb2=0.8 * bright,
        width=64, height=64,
    )  # fmt: skip
    checked = spec.add_material(name="held")
    checked.textures[mj.mjtTextureRole.mjTEXROLE_RGB] = "checks"
    spec.worldbody.add_light(
        type=mj.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[-0.3, 0.4, -1], pos=[0, 0, 4 * reach],
        diffuse=[0.45] * 3, specular=[0.1] * 3, castshadow=False,
    )  # fmt: skip
    hand = spec.worldbody.add_body(name="hand", mocap=True)
    for part in parts:
        _add(mj, spec, hand, part, centre)
    held = spec.worldbody.add_body(name="object", mocap=True)
    solid = scenario.drawn_solid()
    part = Part(solid, np.zeros(3), np.eye(3), (1.0, 1.0, 1.0, 1.0))
    _add(mj, spec, held, part, np.zeros(3), material="held")
    return spec.compile()


def _add(
    mj: Any,
    spec: Any,
    body: Any,
    part: Part,
    centre: Float[np.ndarray, "3"],
    **more: Any,
) -> None:
    kind = getattr(mj.mjtGeom, f"mjGEOM_{part.solid.type.upper()}")
    quaternion = np.zeros(4)
    mj.mju_mat2Quat(quaternion, part.axes.ravel())
    given: dict[str, Any] = {"size": [*part.solid.size, 0.0, 0.0][:3]}
    if part.solid.vertices is not None:
        name = f"mesh {len(spec.meshes)}"
        shell = mj.mjtMeshInertia.mjMESH_INERTIA_SHELL
        shape: dict[str, Any] = {"uservert": part.solid.vertices.ravel().tolist()}
        if part.faces is not None:
            shape |= {"userface": part.faces.ravel().tolist(), "inertia": shell}
        spec.add_mesh(name=name, **shape)
        given = {"meshname": name}
    body.add_geom(
        type=kind, pos=part.place - centre, quat=quaternion, rgba=part.colour,
        contype=0, conaffinity=0, **given, **more,
    )  # fmt: skip
