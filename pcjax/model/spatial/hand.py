"""A hand in three dimensions: an MJCF or URDF file in one posture."""

from __future__ import annotations

import functools
import hashlib
import math
import os
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from pcjax.checks import check_finite, check_positive
from pcjax.geometry import Scalar
from pcjax.importing import mujoco
from pcjax.model.spatial.regions import Escape, HullEscape, StartBox
from pcjax.words import did_you_mean, one_line

PRESETS = {"three-finger": Path(__file__).parent / "three_finger.xml"}
"""Hands of this package, as study files name them."""


class SpatialHand(eqx.Module):
    """A hand file in one posture, and how it is used: where the object starts and when it has
    escaped. The hand frame is that of the body `root`.

    Arguments:
        file: MJCF or URDF.
        root: the body whose subtree is the hand; "" for all of the file.
        joints, posture: names of joints, and where they are: radians, of slide joints m. All others
            are at 0.
        links, scales: names of bodies, and how many times as large each is: its geoms, and the
            places of the bodies that it carries.
        exclude: names of bodies and geoms in it that are no part of the hand, such as a forearm.
        fingertips: names of the bodies and geoms that are mirrored for EoEn.
        start: where the object starts.
        escape: when it has escaped.

    Raises:
        ValueError: no such file, one that MuJoCo cannot read, a name that is not in it, or a
            posture beyond a joint's range.
    """

    file: str = eqx.field(static=True)
    root: str = eqx.field(static=True)
    joints: tuple[str, ...] = eqx.field(static=True)
    posture: tuple[Scalar, ...]
    links: tuple[str, ...] = eqx.field(static=True)
    scales: tuple[Scalar, ...]
    exclude: tuple[str, ...] = eqx.field(static=True)
    fingertips: tuple[str, ...] = eqx.field(static=True)
    start: StartBox
    escape: Escape
    digest: str = eqx.field(static=True)

    def __init__(
        self,
        file: str | os.PathLike[str],
        start: StartBox,
        *,
        root: str = "",
        posture: Mapping[str, Scalar] | None = None,
        scales: Mapping[str, Scalar] | None = None,
        exclude: Sequence[str] = (),
        fingertips: Sequence[str] = (),
        escape: Escape | None = None,
    ):
        posture, scales = dict(posture or {}), dict(scales or {})
        self.file = str(Path(file).resolve())
        self.root = root
        self.joints, self.posture = tuple(posture), tuple(posture.values())
        self.links, self.scales = tuple(scales), tuple(scales.values())
        self.exclude, self.fingertips = tuple(exclude), tuple(fingertips)
        self.start = start
        self.escape = HullEscape() if escape is None else escape
        source = self.source
        self.digest = source.digest
        for name, value in posture.items():
            source.check_posture(name, value)
        for name, value in scales.items():
            source.check_link(name)
            check_positive(f"scale of {name}", value)
        source.check_parts("root", [root] if root else [], geoms=False)
        source.check_parts("exclude", self.exclude)
        source.check_parts("fingertips", self.fingertips)

    @property
    def source(self) -> HandFile:
        """The file, as MuJoCo reads it."""
        return read_hand(self.file)

    def having(
        self,
        posture: Mapping[str, Scalar] | None = None,
        scales: Mapping[str, Scalar] | None = None,
        **changes: Any,
    ) -> SpatialHand:
        """The hand with some joints or links otherwise, or another start or escape rule."""
        given: dict[str, Any] = {
            name: getattr(self, name) for name in ("root", "exclude", "fingertips", "escape")
        }
        start = changes.pop("start", self.start)
        return SpatialHand(
            self.file,
            start,
            posture=dict(zip(self.joints, self.posture, strict=True)) | dict(posture or {}),
            scales=dict(zip(self.links, self.scales, strict=True)) | dict(scales or {}),
            **(given | changes),
        )

    @property
    def key(self) -> tuple[Any, ...]:
        """What says which hand it is: hashable, for plain numbers."""
        leaves, structure = jax.tree.flatten(self)
        return (structure, *map(float, leaves))

    def from_file(self, joint: str, value: float) -> float:
        """Where a joint is, radians or m, from what files say: degrees, of slide joints m."""
        known = self.source.joints
        hinge = joint not in known or known[joint][1]
        return math.radians(value) if hinge else value

    def to_file(self, joint: str) -> float:
        """Where a joint is, as files say it."""
        value, (_, hinge, _) = self.number_of(joint), self.source.joints[joint]
        return round(math.degrees(value), 9) if hinge else value

    def number_of(self, joint: str) -> float:
        """Where a joint is, radians or m."""
        known = dict(zip(self.joints, self.posture, strict=True))
        return float(known.get(joint, 0.0))

    def scale_of(self, link: str) -> float:
        """How many times as large a link is."""
        return float(dict(zip(self.links, self.scales, strict=True)).get(link, 1.0))


class HandFile:
    """An MJCF or URDF file as MuJoCo reads it.

    Attributes:
        spec, model: MuJoCo's.
        digest: of all that the model consists of.
    """

    def __init__(self, path: str):
        """
        Raises:
            ValueError: no such file, or none that MuJoCo can read.
        """
        mj = mujoco()
        self.path = path
        if not Path(path).is_file():
            raise ValueError(f"there is no hand file {path}")
        try:
            self.spec = mj.MjSpec.from_file(path)
            self.spec.compiler.fusestatic = False  # else a fixed root is merged into the world
            self.model = self.spec.compile()
        except ValueError as error:
            raise ValueError(f"MuJoCo cannot read {path}: {one_line(error)}") from None
        buffer = np.empty(mj.mj_sizeModel(self.model), np.uint8)
        mj.mj_saveModel(self.model, None, buffer)
        self.digest = hashlib.sha256(buffer.tobytes()).hexdigest()[:16]

    @functools.cached_property
    def joints(self) -> dict[str, tuple[int, bool, tuple[float, float] | None]]:
        """Of each hinge and slide joint by name: its place in `qpos`, whether it is a hinge, and
        its range, radians or m."""
        mj, model = mujoco(), self.model
        hinge, slide = int(mj.mjtJoint.mjJNT_HINGE), int(mj.mjtJoint.mjJNT_SLIDE)
        found = {}
        for k in range(model.njnt):
            kind = int(model.jnt_type[k])
            if kind in (hinge, slide):
                low, high = map(float, model.jnt_range[k])
                limits = (low, high) if model.jnt_limited[k] else None
                place = int(model.jnt_qposadr[k])
                found[model.joint(k).name] = (place, kind == hinge, limits)
        return found

    @functools.cached_property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, without the world."""
        return tuple(self.model.body(k).name for k in range(1, self.model.nbody))

    @functools.cached_property
    def geoms(self) -> tuple[str, ...]:
        """Names of those geoms that have one."""
        names = (self.model.geom(k).name for k in range(self.model.ngeom))
        return tuple(name for name in names if name)

    def check_joint(self, joint: str) -> None:
        """
        Raises:
            ValueError: there is no such joint.
        """
        if joint not in self.joints:
            raise ValueError(
                f"posture: there is no joint {joint} in {self.path}: "
                f"{did_you_mean(joint, self.joints)}there are {_listed(self.joints)}"
            )

    def check_posture(self, joint: str, value: Scalar) -> None:
        """
        Raises:
            ValueError: there is no such joint, or the value is beyond its range.
        """
        self.check_joint(joint)
        check_finite(f"posture of {joint}", value)
        _, hinge, limits = self.joints[joint]
        if limits is not None and not limits[0] - 1e-6 <= value <= limits[1] + 1e-6:
            unit = " deg" if hinge else " m"
            at, low, high = (
                f"{math.degrees(x) if hinge else x:.4g}" for x in (float(value), *limits)
            )
            raise ValueError(
                f"posture: {joint} is {at}{unit}: its range in {self.path} is {low} to {high}{unit}"
            )

    def check_link(self, body: str) -> None:
        """
        Raises:
            ValueError: there is no such body.
        """
        self.check_parts("scale", [body], geoms=False)

    def check_parts(self, what: str, names: Sequence[str], *, geoms: bool = True) -> None:
        """
        Raises:
            ValueError: one of them is no body (nor geom) of the file.
        """
        known = (*self.bodies, *(self.geoms if geoms else ()))
        for name in names:
            if name not in known:
                sort = "body or geom" if geoms else "body"
                raise ValueError(
                    f"{what}: there is no {sort} {name} in {self.path}: "
                    f"{did_you_mean(name, known)}there are {_listed(known)}"
                )


def _listed(names: Any, most: int = 12) -> str:
    """Some names, and how many more there are."""
    names = [name or "(one without a name)" for name in names]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more


def several(text: str, known: Container[str]) -> tuple[str, ...]:
    """The names that a text stands for: itself, or those between plus signs."""
    return (text,) if text in known else tuple(text.split("+"))


def read_hand(path: str) -> HandFile:
    """The hand file, read anew where it has changed since."""
    try:
        changed = os.stat(path).st_mtime_ns
    except OSError:
        changed = 0
    return _read(path, changed)


@functools.lru_cache(maxsize=16)
def _read(path: str, changed: int) -> HandFile:
    return HandFile(path)
