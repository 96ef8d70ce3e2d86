"""Which numbers of a hand may change, within which bounds, and which hands are allowed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from pcjax.checks import check_between
from pcjax.design.parameters import (
    HELP,
    Draft,
    Limit,
    Parameter,
    current_name,
    linear_limit,
    parameter,
)
from pcjax.model.bodies.base import Body
from pcjax.model.checking import is_hand
from pcjax.model.hand import HandDesign, full_cage
from pcjax.model.layout import fit_of
from pcjax.model.scenario import why_no_eoen
from pcjax.quality.task import Task

Design = Float[np.ndarray, " parameters"]
"""The values of a space's parameters, in order."""


def nearest_within(
    point: Float[np.ndarray, " n"],
    normals: Float[np.ndarray, "edges n"],
    room: Float[np.ndarray, " edges"],
) -> Float[np.ndarray, " n"] | None:
    """The nearest point x with normals @ x <= room; None where there is none.

    Least distance programming by non-negative least squares (Lawson and Hanson 1974, chapter 23).
    """
    excess = normals @ point - room
    if np.all(excess <= 0):
        return point
    from scipy.optimize import nnls

    rows = np.vstack([-normals.T, excess])
    target = np.append(np.zeros(len(point)), 1.0)
    weights, miss = nnls(rows, target)
    if miss < 1e-9:
        return None
    residual = rows @ weights - target
    return point - residual[:-1] / residual[-1]


class Space:
    """The hands that a search may try, by their designs, and which of them are allowed.

    Attributes:
        base: the hand that a search begins at.
        free: the parameters.
        width: of the object.
        picture, front_picture: what draws an optimum and a front in it, as "module.name".
        why_no_gradient: why scores of its hands have no gradient; "" where they have.
        shown_finely: whether a look at a hand is cheap enough for thousands, in a map.
        looks: designs spread over the space that a search thinks of in a round; twice as many are
            near the best.
        cuts: rounds in which the way out of what is allowed is looked at, and parts of each.
    """

    base: Any
    free: tuple[Any, ...]
    width: float

    picture: ClassVar[str]
    front_picture: ClassVar[str]
    why_no_gradient: ClassVar[str] = ""
    shown_finely: ClassVar[bool] = True
    looks: ClassVar[int] = 128
    cuts: ClassVar[tuple[int, int]] = 2, 8

    @property
    def scales(self) -> Design:
        """The usual change of each parameter."""
        raise NotImplementedError

    @property
    def low(self) -> Design:
        """Lower bounds."""
        return np.array([p.low for p in self.free], float)

    @property
    def high(self) -> Design:
        """Upper bounds."""
        return np.array([p.high for p in self.free], float)

    def holding(self, task: Task) -> Space:
        """The space whose hands are hands in the task's directions, with room for its objects."""
        raise NotImplementedError

    def for_object(self, body: Body) -> Space:
        """The space for another object."""
        raise NotImplementedError

    def design_of(self, hand: Any) -> Design:
        """The design that a hand is."""
        raise NotImplementedError

    def hand(self, design: Any) -> Any:
        """The hand of a design."""
        raise NotImplementedError

    @property
    def has_base(self) -> bool:
        """Whether the base hand is one of the space."""
        raise NotImplementedError

    def objections(self) -> list[str]:
        """Why the base hand itself is not an allowed design, each in words; none if it is one."""
        raise NotImplementedError

    def look(
        self, designs: Float[np.ndarray, "*shape parameters"]
    ) -> tuple[Float[np.ndarray, "*shape"], Bool[np.ndarray, "*shape"]]:
        """The gaps of many designs, NaN where there is no such thing, and which of them are hands
        that the objects have room in."""
        raise NotImplementedError

    def caged(self, gaps: Float[np.ndarray, "*shape"]) -> Bool[np.ndarray, "*shape"]:
        """Which gaps are too narrow for the object."""
        raise NotImplementedError

    def which(
        self, designs: Float[np.ndarray, "designs parameters"]
    ) -> Bool[np.ndarray, " designs"]:
        """Which of many designs are allowed."""
        raise NotImplementedError

    def allowed(self, design: Design) -> bool:
        """Whether a design is allowed."""
        return bool(self.which(design[None])[0])

    def nearest_allowed(
        self, design: Design | Sequence[float], fallback: Design | None = None
    ) -> Design:
        """An allowed design close by.

        Arguments:
            design: any.
            fallback: an allowed design to go back towards; the base hand unless given.

        Raises:
            ValueError: no allowed design was found.
        """
        raise NotImplementedError

    def refused(self) -> dict[str, int]:
        """How many designs were looked at in vain, by what is wrong with them, where that is
        counted."""
        return {}

    def describe(self, design: Design) -> str:
        """A design as text."""
        values = zip(self.free, design, strict=True)
        return ", ".join(f"{p.name} {v:.4g}{f' {p.unit}' if p.unit else ''}" for p, v in values)

    def named(self, design: Design) -> dict[str, float]:
        """A design by the parameters' labels."""
        return {p.label: float(v) for p, v in zip(self.free, design, strict=True)}


@dataclass(frozen=True)
class DesignSpace(Space):
    """The hands that differ from a base hand in the free parameters, and which are allowed.

    A design is a vector of the parameters' values: degrees where the name ends in `_deg`, else
    lengths. Optimisers work in `scales`, in which angles
    count in tens of degrees and lengths in tenths of the palm.

    Arguments:
        base: the hand whose other numbers stay.
        free: the parameters.
        clearance: the least that the gap has to be wider than the object, a length.
        width: of the object.
        limits: linear ones, in addition.
        directions: in which the hands have to be hands (see `is_hand`).
        rooms: radius and start spread of each object that has to have room at its starts; a search
            puts its task's own there.

    Raises:
        ValueError: nothing free, a parameter twice, or a negative clearance.
    """

    base: HandDesign
    free: tuple[Parameter, ...]
    clearance: float
    width: float
    limits: tuple[Limit, ...] = ()
    directions: tuple[str, ...] = ("does",)
    rooms: tuple[tuple[float, float], ...] = ()

    picture = "view.designs.plot_optimum"
    front_picture = "view.front.plot_front"

    def __post_init__(self) -> None:
        if not self.free:
            raise ValueError("no parameter is free: name one or more of " + HELP)
        names = [p.name for p in self.free]
        taken: dict[tuple[str, int, int], str] = {}
        for p in self.free:
            for finger in p.fingers:
                # A fingertip's angle and its joint's, say, are the same number.
                size = len(self.base.lengths[finger])
                what = "angle" if p.unit else "length"
                what = p.kind if p.kind == "thickness" else what
                joint = size - 2 if p.kind == "gap_width" else p.joint % size
                other = taken.setdefault((what, finger, joint), p.name)
                if other != p.name or names.count(p.name) > 1:
                    raise ValueError(f"{p.name} and {other} are the same number of the hand")
        check_between("clearance", self.clearance, 0.0, math.inf)

    def holding(self, task: Task) -> DesignSpace:
        """The space whose hands are hands in the task's directions, with room for its objects."""
        rooms = tuple((float(one.body.radius), float(one.start_spread)) for one in task.each)
        return replace(self, directions=task.directions, rooms=rooms)

    def for_object(self, body: Body) -> DesignSpace:
        """The space for another object."""
        return replace(self, width=float(body.width))

    @property
    def scales(self) -> Design:
        """The usual change of each parameter: 10 degrees, or a tenth of the palm."""
        length = 0.1 * float(self.base.palm_length)
        return np.array([10.0 if p.unit else length for p in self.free])

    def usual_moves(self, design: Design) -> Design:
        """How far differences move each parameter: 4 degrees, or 0.02 palm lengths but no more than
        a fifth of the length itself."""
        moves = self.scales * [0.4 if p.unit else 0.2 for p in self.free]
        angles = np.array([bool(p.unit) for p in self.free])
        return np.where(angles, moves, np.minimum(moves, 0.2 * np.abs(design)))

    def least_gap(self, share: float) -> float:
        """The gap that leaves that share of the clearance."""
        return self.width + share * self.clearance

    def design_of(self, hand: HandDesign) -> Design:
        """The design that a hand is, to twelve digits: the others may be rounding, which is not to
        take it over a bound."""
        return np.array([float(f"{float(p.read(hand)):.12g}") for p in self.free])

    def hand(self, design: Array | np.ndarray | Sequence[float]) -> HandDesign:
        """The hand of a design; differentiable."""
        draft = Draft.of(self.base)
        for p, value in zip(self.free, design, strict=True):
            p.write(self.base, draft, value)
        return draft.hand(self.base.palm_length)

    @property
    def has_base(self) -> bool:
        """Whether the base hand is one of the space: its fingers may differ in a parameter that is
        for both."""
        pairs = zip(
            jax.tree.leaves(self.hand(self.design_of(self.base))),
            jax.tree.leaves(self.base),
            strict=True,
        )
        return all(np.isclose(float(a), float(b), rtol=1e-9, atol=1e-12) for a, b in pairs)

    def look(
        self, designs: Float[np.ndarray, "*shape parameters"]
    ) -> tuple[Float[np.ndarray, "*shape"], Bool[np.ndarray, "*shape"]]:
        """The gaps of many designs, and which of them are hands in all of the directions, with
        lengths above 0 and room for the objects at their starts."""
        columns = np.moveaxis(designs, -1, 0).reshape(len(self.free), -1)
        gaps, there = self._look(self.hand(columns), columns.shape[1])
        return gaps.reshape(designs.shape[:-1]), there.reshape(designs.shape[:-1])

    def _look(
        self, hand: HandDesign, count: int
    ) -> tuple[Float[np.ndarray, " count"], Bool[np.ndarray, " count"]]:
        hands = jax.tree.map(lambda leaf: np.broadcast_to(np.asarray(leaf, float), count), hand)
        there = np.all([length > 0 for row in hands.lengths for length in row], axis=0)
        with np.errstate(all="ignore"):
            there &= is_hand(hands, self.directions)
            for direction in self.directions if self.rooms else ():
                seen = hands if direction == "does" else hands.with_fingertips_mirrored()
                for radius, spread in self.rooms:
                    contact_radius = radius + 0.5 * hands.thickness
                    fit = fit_of(seen, contact_radius, np.full(count, spread))
                    there &= (fit.clearance >= -1e-9 * hands.palm_length) & ~fit.outside
            return hands.gap(), there

    def spare(
        self, designs: Float[np.ndarray, "*shape parameters"]
    ) -> tuple[Float[np.ndarray, "*shape"], Bool[np.ndarray, "*shape"]]:
        """How much wider than object and clearance the gaps are, and which are no hands."""
        gaps, there = self.look(designs)
        return np.asarray(gaps - self.width - self.clearance), np.asarray(~there)

    def objections(self) -> list[str]:
        """Why the base hand itself is not an allowed design, each in words; none if it is one.

        Whether it is a hand at all is left to `pcjax.model.checking.check_geometry`.
        """
        found, given = [], self.design_of(self.base)
        for p, value, scale in zip(self.free, given, self.scales, strict=True):
            unit = f" {p.unit}" if p.unit else ""
            if not p.low - 1e-6 * scale <= value <= p.high + 1e-6 * scale:
                found.append(
                    f"its {p.name} is {value:.4g}{unit}, outside {p.low:g} to {p.high:g}{unit}"
                )
            each = [float(value) for value in p.read_each(self.base)]
            if max(each) - min(each) > 1e-6 * scale:
                found.append(
                    f"its {p.name} is {each[0]:.4g}{unit} on finger 1 and {each[1]:.4g}{unit} on "
                    "finger 2, and designs have it alike"
                )
        found += [
            f"it breaks the limit {limit.text!r}"
            for limit in self.limits
            if limit.coefficients @ given
            > limit.most + 1e-6 * np.abs(limit.coefficients) @ self.scales
        ]
        (gap,), (there,) = self._look(self.base, 1)
        if gap < self.least_gap(1.0) - 1e-6 * self.width and there:
            found.append(
                f"its gap is {gap:.4g}, less than the object's {self.width:g} and the clearance of "
                f"{self.clearance:g}"
            )
        return found

    def caged(self, gaps: Float[np.ndarray, "*shape"]) -> Bool[np.ndarray, "*shape"]:
        """Which gaps are narrower than the object."""
        return np.asarray(full_cage(gaps, self.width))

    def which(
        self, designs: Float[np.ndarray, "designs parameters"]
    ) -> Bool[np.ndarray, " designs"]:
        """Which of many designs are within bounds and limits, have their clearance, and are hands
        that the objects have room in."""
        slack = 1e-9 * np.abs(self.scales)
        inside = np.all((designs >= self.low - slack) & (designs <= self.high + slack), axis=1)
        for limit in self.limits:
            most = limit.most + np.abs(limit.coefficients) @ slack
            inside &= designs @ limit.coefficients <= most
        return inside & self.open(designs, 1.0)

    def open(
        self, designs: Float[np.ndarray, "*shape parameters"], share: float
    ) -> Bool[np.ndarray, "*shape"]:
        """Which designs' gaps leave that share of the clearance, and are hands."""
        spare, wrong = self.spare(designs)
        return np.asarray((spare + (1.0 - share) * self.clearance > -1e-6 * self.width) & ~wrong)

    def nearest_allowed(
        self,
        design: Design | Sequence[float],
        fallback: Design | None = None,
    ) -> Design:
        """An allowed design close by, by small moves (in the scales) that mend what is wrong.

        Arguments:
            design: any.
            fallback: an allowed design to go back towards where that does not do; the base hand
                unless given.

        Raises:
            ValueError: no allowed design was found.
        """
        wanted = design = np.clip(design, self.low, self.high)
        inside = np.clip(self.design_of(self.base), self.low, self.high)
        inside = inside if fallback is None else fallback
        for _ in range(40):
            if self.allowed(design):
                return design
            if self.spare(design)[1]:
                # Fingers that cross, say, have no gap whose gradient could help.
                design = inside + 0.8 * (design - inside)
                continue
            normals, room = self._edges(design)
            move = nearest_within(np.zeros(len(design)), normals, room)
            if move is None:
                break
            design = np.clip(design + move * self.scales, self.low, self.high)
        for share in 0.5 ** np.arange(1, 12):
            between = inside + share * (wanted - inside)
            if self.allowed(between):
                return between
        if self.allowed(inside):
            return inside
        raise ValueError(
            f"no allowed hand was found near {self.describe(wanted)}: its gap has to be "
            f"{self.clearance:g} wider than the object ({self.width:g}), no limbs may cross, "
            f"{'the object has to fit inside at its start, ' if self.rooms else ''}and every "
            "parameter has to be within its bounds and limits"
        )

    def along_edges(
        self,
        design: Design,
        way: Design,
        reach: float,
    ) -> Design:
        """What is left of a way uphill where it would leave the allowed hands within one step.

        On an edge it is the part along the edge; a whole step away from all edges, all of it.

        Arguments:
            design: an allowed one.
            way: a direction, in the scales.
            reach: length of a step, in the scales.
        """
        normals, room = self._edges(design)
        size = float(np.linalg.norm(way))
        kept = nearest_within(way, normals, np.maximum(room, 0.0) * size / reach)
        return np.zeros(len(way)) if kept is None else kept

    def _edges(
        self, design: Design
    ) -> tuple[Float[np.ndarray, "edges parameters"], Float[np.ndarray, " edges"]]:
        """Bounds, limits and the gap's tangent: outward normals, and how far each is away, all in
        the scales."""
        one = np.eye(len(design))
        normals = [*one, *-one]
        room = [*(self.high - design) / self.scales, *(design - self.low) / self.scales]
        for limit in self.limits:
            normal = limit.coefficients * self.scales
            size = np.linalg.norm(normal)
            normals.append(normal / size)
            room.append((limit.most - limit.coefficients @ design) / size)
        steps = 1e-4 * np.diag(self.scales)
        # A thickness of 0 has hands on one side only.
        thin = np.array([p.kind == "thickness" for p in self.free])
        about = np.where(thin, np.maximum(design, 1e-4 * self.scales), design)
        spare = self.spare(np.concatenate([about + steps, about - steps, design[None]]))[0]
        slope = (spare[: len(design)] - spare[len(design) : -1]) / 2e-4
        size = np.linalg.norm(slope)
        if size > 0:
            normals.append(-slope / size)
            room.append((spare[-1] - 1e-7 * self.width) / size)
        return np.array(normals), np.array(room)


def design_space(
    hand: HandDesign,
    free: Mapping[str, tuple[float, float] | None] | Sequence[str],
    width: float,
    clearance: float | None = None,
    limits: Sequence[str] = (),
    directions: Sequence[str] | None = None,
) -> DesignSpace:
    """The hands that differ from `hand` in the parameters named.

    Arguments:
        hand: its other numbers stay.
        free: names (see `HELP`), or names with their bounds: degrees where the name ends in `_deg`,
            else lengths.
        width: of the object, a length.
        clearance: the least that the gap has to be wider; 0.04 L_p unless given.
        limits: linear limits as text, see `linear_limit`.
        directions: of "does" and "eoen", those that are to be evaluated; both for a hand that has
            both unless given.

    Raises:
        ValueError: see `parameter`, `linear_limit` and `DesignSpace`.

    Examples:
        >>> import pcjax
        >>> space = pcjax.design_space(pcjax.box_hand(), {"fingertip_angle_deg": (-30, 45)}, 50.0)
        >>> space.describe(space.nearest_allowed([60.0]))
        'fingertip_angle 40.37 deg'
    """
    bounds = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    parameters = [
        parameter(current_name(name), hand, *(span or (None, None)))
        for name, span in bounds.items()
    ]
    least = 0.04 * float(hand.palm_length) if clearance is None else clearance
    linear = tuple(linear_limit(text, parameters) for text in limits)
    if directions is None:
        directions = ("does",) if why_no_eoen(hand) else ("does", "eoen")
    return DesignSpace(hand, tuple(parameters), least, width, linear, tuple(directions))
