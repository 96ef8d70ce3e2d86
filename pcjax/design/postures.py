"""Which joints and sizes of a hand in three dimensions may change, and which hands are allowed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Array, Bool, Float

from pcjax.checks import check_finite
from pcjax.components import Quantity, quantities
from pcjax.design.space import Design, Space
from pcjax.model.bodies.base import Body
from pcjax.model.spatial.frozen import frozen
from pcjax.model.spatial.hand import SpatialHand, several
from pcjax.model.spatial.scenario import MisfitError
from pcjax.quality.spatial import HandWithObject
from pcjax.quality.task import Task
from pcjax.simulate.choose import engine_for
from pcjax.words import did_you_mean

HELP = (
    "posture.JOINT (degrees; of slide joints m), scale.BODY (how many times as large), a number of "
    "the object such as radius; posture.A+B, scale.A+B: of several that are alike"
)
"""What a parameter may be called."""

_OVERLAP = "geoms overlap"


@dataclass(frozen=True)
class PostureParameter:
    """One number of a hand in three dimensions, or of its object, that may change.

    Attributes:
        name: as `HELP` has it; `label` is the same.
        low, high: its bounds, as files have them.
        sort: what it is a number of.
        parts: names of the joints or bodies, or of the object's field.
        unit: "deg", "m", or "" for a factor.
    """

    name: str
    low: float
    high: float
    sort: Literal["posture", "scale", "object"]
    parts: tuple[str, ...]
    unit: str

    @property
    def label(self) -> str:
        """Its name."""
        return self.name

    @property
    def axis_unit(self) -> str:
        """Of a coordinate of a dataset."""
        return {"deg": "degree", "": "1"}.get(self.unit, self.unit)

    @property
    def scale(self) -> float:
        """The usual change: 10 degrees, a tenth of a link, or a tenth of the bounds."""
        usual = {"deg": 10.0, "": 0.1}
        return usual.get(self.unit, 0.1 * (self.high - self.low))

    def headed(self, units: str) -> str:
        """Its name and in brackets its unit."""
        return self.name + (f" [{self.unit}]" if self.unit else "")


@dataclass(frozen=True)
class PostureSpace(Space):
    """The hands in three dimensions that differ from a base hand in the free parameters.

    A design is a vector of the parameters' values as files have them. It is allowed within the
    bounds if no geoms overlap that did not before, the object has room at its starts, and nothing
    is too thin for a step. MuJoCo takes milliseconds to tell, so what it said is remembered.

    Arguments:
        base: the hand whose other numbers stay.
        free: the parameters.
        body: the object.
        task: for whose directions and objects hands are checked; a search puts its own there.
        dt: the step of trials, s. Unless given it is chosen for each design, and one that is too
            thin for every step is not allowed.

    Raises:
        ValueError: a number twice.
    """

    base: SpatialHand
    free: tuple[PostureParameter, ...]
    body: Body
    task: Task | None = None
    dt: float | None = None
    _wrong: dict[bytes, str] = field(default_factory=dict, repr=False, compare=False)

    picture = "view.postures.plot_optimum"
    front_picture = "view.postures.plot_front"
    why_no_gradient = "MuJoCo's trials have none; take method 'model', 'grid' or 'cma'"
    shown_finely = False
    looks = 32
    cuts = 3, 2

    def __post_init__(self) -> None:
        taken: dict[tuple[str, str], str] = {}
        for p in self.free:
            for part in p.parts:
                if (p.sort, part) in taken:
                    raise ValueError(
                        f"{taken[p.sort, part]} and {p.name} are the same number of the hand"
                    )
                taken[p.sort, part] = p.name

    @property
    def width(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of the object, m."""
        return float(self.body.width)

    @property
    def scales(self) -> Design:
        """The usual change of each parameter: 10 degrees, or a tenth of a link or of the bounds."""
        return np.array([p.scale for p in self.free])

    def holding(self, task: Task) -> PostureSpace:
        """The space whose hands have room for the task's objects in its directions."""
        return replace(self, task=task, _wrong={})

    def for_object(self, body: Body) -> PostureSpace:
        """The space for another object."""
        return replace(self, body=body, _wrong={})

    def _each(self, hand: SpatialHand | HandWithObject) -> list[list[float]]:
        """The values of each parameter, for each of its parts."""
        numbers: dict[str, float] = {}
        if isinstance(hand, HandWithObject):
            hand, numbers = hand.hand, dict(hand.numbers)
        read: dict[str, Any] = {
            "posture": hand.to_file,
            "scale": hand.scale_of,
            "object": lambda name: numbers.get(name, getattr(self.body, name)),
        }
        return [[float(read[p.sort](part)) for part in p.parts] for p in self.free]

    def design_of(self, hand: SpatialHand | HandWithObject) -> Design:
        """The design that a hand is; of parameters for several parts, by the first of them."""
        return np.array([float(f"{each[0]:.12g}") for each in self._each(hand)])

    def hand(self, design: Array | np.ndarray | Sequence[float]) -> SpatialHand | HandWithObject:
        """The hand of a design; where a number of the object is free, with that."""
        found: dict[str, dict[str, float]] = {"posture": {}, "scale": {}, "object": {}}
        for p, value in zip(self.free, map(float, design), strict=True):
            found[p.sort] |= dict.fromkeys(p.parts, value)
        posture = {joint: self.base.from_file(joint, x) for joint, x in found["posture"].items()}
        hand = self.base.having(posture=posture, scales=found["scale"])
        return HandWithObject(hand, tuple(found["object"].items())) if found["object"] else hand

    def _unlike(self) -> list[str]:
        """Parameters whose parts differ in the base hand, in words."""
        found = []
        for p, each in zip(self.free, self._each(self.base), strict=True):
            if max(each) - min(each) > 1e-6 * p.scale:
                listed = ", ".join(f"{value:.4g}" for value in each)
                found.append(f"its {p.name} is {listed}, and designs have it alike")
        return found

    @property
    def has_base(self) -> bool:
        """Whether the base hand is one of the space: its parts may differ in a parameter that is
        for several."""
        return not self._unlike()

    def objections(self) -> list[str]:
        """Why the base hand itself is not one of the designs, each in words; none if it is one."""
        found = []
        for p, value in zip(self.free, self.design_of(self.base), strict=True):
            if not p.low - 1e-6 * p.scale <= value <= p.high + 1e-6 * p.scale:
                unit = f" {p.unit}" if p.unit else ""
                found.append(
                    f"its {p.name} is {value:.4g}{unit}, outside {p.low:g} to {p.high:g}{unit}"
                )
        return [*found, *self._unlike()]

    def wrong_with(self, design: Design) -> str:
        """What is wrong with a design, in a few words; "" if nothing is. Bounds do not count."""
        key = np.asarray(design, float).tobytes()
        if key not in self._wrong:
            self._wrong[key] = self._look_at(self.hand(design))
        return self._wrong[key]

    def _look_at(self, hand: SpatialHand | HandWithObject) -> str:
        if self.task is None:
            alone = hand.hand if isinstance(hand, HandWithObject) else hand
            return _OVERLAP if frozen(alone).overlap > 0 else ""
        try:
            for scenario in self.task.scenarios(hand):  # pyright: ignore[reportArgumentType]
                scenario.check()
                engine_for([scenario], self.dt)
        except MisfitError as misfit:
            return misfit.short
        return ""

    def refused(self) -> dict[str, int]:
        """How many of the designs that were looked at are not allowed, by what is wrong, the most
        frequent first."""
        return dict(Counter(why for why in self._wrong.values() if why).most_common())

    def look(
        self, designs: Float[np.ndarray, "*shape parameters"]
    ) -> tuple[Float[np.ndarray, "*shape"], Bool[np.ndarray, "*shape"]]:
        """NaN for the gaps, which are not known, and which hands have room for the objects."""
        shape = designs.shape[:-1]
        rows = designs.reshape(math.prod(shape), len(self.free))
        there = np.array([not self.wrong_with(design) for design in rows], bool)
        return np.full(shape, np.nan), there.reshape(shape)

    def caged(self, gaps: Float[np.ndarray, "*shape"]) -> Bool[np.ndarray, "*shape"]:
        """No hand: it is not known which of them nothing passes."""
        return np.zeros(gaps.shape, bool)

    def which(
        self, designs: Float[np.ndarray, "designs parameters"]
    ) -> Bool[np.ndarray, " designs"]:
        """Which of many designs are allowed."""
        slack = 1e-9 * self.scales
        inside = np.all((designs >= self.low - slack) & (designs <= self.high + slack), axis=1)
        within = np.clip(designs, self.low, self.high)
        inside[inside] = [not self.wrong_with(design) for design in within[inside]]
        return inside

    def nearest_allowed(
        self, design: Design | Sequence[float], fallback: Design | None = None
    ) -> Design:
        """A design itself within the bounds or, where that is not allowed, the last on the way to
        it that is.

        Arguments:
            design: any.
            fallback: an allowed design that the way begins at; the base hand unless given.

        Raises:
            ValueError: the way begins at a design that is not allowed, too.
        """
        wanted = np.clip(design, self.low, self.high)
        if self.allowed(wanted):
            return wanted
        begin = np.clip(self.design_of(self.base), self.low, self.high)
        begin = begin if fallback is None else fallback
        if not self.allowed(begin):
            raise ValueError(
                f"no allowed hand was found near {self.describe(wanted)}: {self.wrong_with(wanted)}"
            )
        share = 0.0
        for step in 0.5 ** np.arange(1, 7):
            if self.allowed(begin + (share + step) * (wanted - begin)):
                share += step
        return begin + share * (wanted - begin)


def posture_space(
    hand: SpatialHand,
    free: Mapping[str, tuple[float, float] | None] | Sequence[str],
    body: Body,
) -> PostureSpace:
    """The hands in three dimensions that differ from `hand` in the parameters named.

    Arguments:
        hand: its other numbers stay.
        free: names (see `HELP`), or names with their bounds; a joint's are its range unless given.
        body: the object.

    Raises:
        ValueError: nothing free, or see `posture_parameter` and `PostureSpace`.

    Examples:
        >>> from pcjax import spatial
        >>> start = spatial.StartBox((0.0, 0.0, 0.036), (0.002, 0.002, 0.001))
        >>> hand = spatial.Hand(spatial.PRESETS["three-finger"], start, root="palm")
        >>> space = spatial.posture_space(hand, ["posture.tip1+tip2+tip3"], spatial.Sphere(0.024))
        >>> space.describe(space.design_of(hand)), space.high
        ('posture.tip1+tip2+tip3 0 deg', array([90.]))
    """
    bounds = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    if not bounds:
        raise ValueError(f"no parameter is free: name one or more of {HELP}")
    each = [posture_parameter(name, hand, body, span) for name, span in bounds.items()]
    return PostureSpace(hand, tuple(each), body)


def posture_parameter(
    name: str, hand: SpatialHand, body: Body, bounds: tuple[float, float] | None = None
) -> PostureParameter:
    """A parameter by its name, with bounds.

    Arguments:
        name: see `HELP`.
        hand: that it is a number of.
        body: its object.
        bounds: as files have them; of joints their range unless given.

    Raises:
        ValueError: an unknown name, or bounds that are missing, out of order or beyond the range.
    """
    sort, dot, rest = name.partition(".")
    numbers = _numbers_of(body)
    if dot and sort == "posture":
        return _of_joints(name, several(rest, hand.source.joints), hand, bounds)
    if dot and sort == "scale":
        parts = several(rest, hand.source.bodies)
        for part in parts:
            hand.source.check_link(part)
        low, high = _in_order(name, bounds, "0.8:1.2")
        if low <= 0:
            raise ValueError(f"{name}'s lower bound is {low:g}: it has to be above 0")
        return PostureParameter(name, low, high, "scale", parts, "")
    if name not in numbers:
        known = [*(f"posture.{joint}" for joint in hand.source.joints), *numbers]
        raise ValueError(
            f"there is no parameter {name}: {did_you_mean(name, known)}there are {HELP}"
        )
    what = numbers[name]
    low, high = _in_order(name, bounds, "LOW:HIGH")
    for bound in (low, high):
        what.in_file().check(bound)
    unit = "m" if what.unit == "length" else ""
    return PostureParameter(name, low, high, "object", (what.name,), unit)


def _numbers_of(body: Body) -> dict[str, Quantity]:
    """The single numbers of an object, by their names in files."""
    return {
        what.file_key: what
        for what in quantities(type(body)).values()
        if what.key and what.count is None and what.kind is float
    }


def _of_joints(
    name: str, joints: tuple[str, ...], hand: SpatialHand, bounds: tuple[float, float] | None
) -> PostureParameter:
    for joint in joints:
        hand.source.check_joint(joint)
    known = [hand.source.joints[joint] for joint in joints]
    hinges = {hinge for _, hinge, _ in known}
    if len(hinges) > 1:
        raise ValueError(f"{name}: some of them turn and others slide, so they are not alike")
    to_file = math.degrees if hinges == {True} else float
    unit = "deg" if hinges == {True} else "m"
    ranges = [[round(to_file(x), 9) for x in limits] for _, _, limits in known if limits]
    least, most = (
        max((r[0] for r in ranges), default=-math.inf),
        min((r[1] for r in ranges), default=math.inf),
    )
    if bounds is None and math.isfinite(least):
        bounds = least, most
    low, high = _in_order(name, bounds, "0:40" if unit == "deg" else "0:0.01")
    if low < least or high > most:
        raise ValueError(
            f"{name} is free from {low:g} to {high:g} {unit}: its range in {hand.file} is "
            f"{least:g} to {most:g} {unit}"
        )
    return PostureParameter(name, low, high, "posture", joints, unit)


def _in_order(name: str, bounds: tuple[float, float] | None, such_as: str) -> tuple[float, float]:
    if bounds is None:
        raise ValueError(f"{name} needs bounds, such as {name}={such_as}")
    for which, bound in zip(("lower", "upper"), bounds, strict=True):
        check_finite(f"{name}'s {which} bound", bound)
    low, high = bounds
    if not low < high:
        raise ValueError(f"{name} is free from {low:g} to {high:g}: the bounds are out of order")
    return low, high
