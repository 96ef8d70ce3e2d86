"""What one can turn of a study: its numbers with their ranges, and the hand's joints as points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pcjax.components import Quantity
from pcjax.design.parameters import Parameter, parameter
from pcjax.model.hand import FingerValues, HandDesign
from pcjax.study.spec import Study
from pcjax.study.vary import names
from pcjax.units import PER_METRE, length_in_words

GROUPS = {
    "hand": "Hand",
    "body": "Object",
    "drive": "Motion",
    "contact": "Contact",
}
"""Tables of a study file, as the page calls them."""

_FIELDS = {"contact": "law"}
"""What a study calls a table, where that is something else."""

_WIDE = 2.5
"""A range without a bound of its own ends at so many times its value."""

_SHORTEST = 0.01
"""Limb that a drag leaves, in palm lengths."""

_REPEATED = 60
"""Times that a gap is set again at most, each of which takes it nearer."""

_LONGEST = 1.5
"""Range of a limb's length, in palm lengths."""


@dataclass(frozen=True)
class Dial:
    """A number of a study that can be turned.

    Attributes:
        label: its name, as `Study.having` takes it.
        words: for people.
        group: one of `GROUPS`.
        low, high: its range on the page; what is typed may lie outside.
        step: of a slider.
        value: NaN where it has none, as friction may.
        unit: in words, "" for a pure number.
        of_hand: whether it is the hand's, so that a search can free it.
    """

    label: str
    words: str
    group: str
    low: float
    high: float
    step: float
    value: float
    unit: str
    of_hand: bool = False

    @property
    def text(self) -> str:
        """Its words and unit."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words


def dials_of(study: Study, *, mirrored: bool) -> list[Dial]:
    """All numbers that can be turned, the hand's first.

    Arguments:
        study: whose.
        mirrored: whether both fingers turn together, where they are alike.
    """
    hand = _of_hand(study, mirrored=mirrored and alike(study.hand))
    return [*hand, *dials_of_components(study)]


def dials_of_components(study: Study) -> list[Dial]:
    """The numbers of all but the hand that can be turned."""
    found = []
    for label, (table, what) in names(study.components).items():
        if table not in GROUPS:
            continue
        given = what.to_file(getattr(study.components[table], what.name))
        value = float(given) if isinstance(given, (int, float)) else math.nan
        found.append(_of_component(label, table, what.in_file(), value, study.units))
    return found


def parameters_of(hand: HandDesign) -> list[Parameter]:
    """All of a hand's parameters that have a name, of both fingers together and of each."""
    limbs = min(len(row) for row in hand.lengths)
    names = ["thickness", *(["gap_width"] if limbs >= 3 else [])]
    for finger in ("", "_1", "_2"):
        names += [f"fingertip_angle{finger}_deg", f"fingertip_length{finger}"]
    for finger in ("", "1", "2"):
        for joint in range(1, limbs + 1):
            names += [f"joint_angle_{finger}{joint}_deg", f"link_length_{finger}{joint}"]
    return [parameter(name, hand) for name in names]


def alike(hand: HandDesign) -> bool:
    """Whether both fingers have as many limbs."""
    return len(hand.lengths[0]) == len(hand.lengths[1])


def _of_hand(study: Study, *, mirrored: bool) -> Iterator[Dial]:
    hand, palm = study.hand, float(study.hand.palm_length)
    counts = [len(row) for row in hand.lengths]
    unit = study.units if study.units in PER_METRE else ""

    def length(label: str, words: str, low: float, high: float, *, free: bool = True) -> Dial:
        value = palm if not free else float(parameter(label, hand).read(hand))
        step = _nice((high - low) * palm / 1000)
        return Dial(label, words, "hand", low * palm, high * palm, step, value, unit, free)

    def angle(label: str, words: str, most: float) -> Dial:
        value = float(parameter(label, hand).read(hand))
        return Dial(label, words, "hand", -most, most, 0.5, value, "deg", True)

    yield length("palm_length", "palm", 0.1, _WIDE, free=False)
    boxed = min(counts) >= 3
    if boxed:
        yield length("gap_width", "gap between the tips' joints", 0.02, _LONGEST)
    for finger in ("",) if mirrored else ("1", "2"):
        who = f"finger {finger}: " if finger else ""
        limbs = min(counts)  # a joint that only one of them has has no name
        for joint in range(1, limbs + (0 if boxed else 1)):
            at = f"{finger}{joint}"
            yield angle(f"joint_angle_{at}_deg", f"{who}joint {joint}", 180.0)
            yield length(f"link_length_{at}", f"{who}limb {joint}", _SHORTEST, _LONGEST)
        if boxed:
            tip = f"_{finger}" if finger else ""
            yield angle(f"fingertip_angle{tip}_deg", f"{who}fingertip angle", 90.0)
            yield length(f"fingertip_length{tip}", f"{who}fingertip length", _SHORTEST, _LONGEST)
    yield length("thickness", "thickness", 0.0, 0.2)


def _of_component(label: str, table: str, what: Quantity, value: float, units: str) -> Dial:
    size = abs(value) if value else 1.0
    size = 1.0 if math.isnan(size) else size
    least, most = (-180.0, 180.0) if what.unit == "angle" else (-_WIDE * size, _WIDE * size)
    low = what.low if math.isfinite(what.low) else least
    high = what.high if math.isfinite(what.high) and what.high < 1e3 * size else most
    unit = what.unit_in(units)
    unit = {"degree": "deg", "1": "", length_in_words("model"): ""}.get(unit, unit)
    step = 1.0 if what.kind is int else _nice((high - low) / 500)
    low = low + step if what.above else low
    words = label.removesuffix("_deg").replace("_", " ")
    return Dial(label, words, table, low, high, step, value, unit)


def _nice(step: float) -> float:
    """1, 2 or 5 times a power of ten, at most that step or the least of them."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(k * power for k in (5, 2, 1) if k * power <= step * (1 + 1e-9))


def turned(study: Study, label: str, value: float | None) -> Study:
    """The study with another number; everything else of it stays, what is swept as well.

    Arguments:
        study, label: of what, and which.
        value: the number; None for none.

    Raises:
        ValueError: the value is out of range, or there has to be one.
    """
    if value is None:
        return _without(study, label)
    new = study.having({label: value})
    if label == "gap_width":
        # Where the limbs that give way are not parallel to the palm, once is not enough.
        for _ in range(_REPEATED):
            there = float(parameter(label, new.hand).read(new.hand))
            if abs(there - value) < 1e-9 * float(new.hand.palm_length):
                break
            new = new.having({label: value})
    return replace(new, sweep=study.sweep)


def _without(study: Study, label: str) -> Study:
    known = names(study.components)
    if label not in known or not (known[label][1].word or known[label][1].default is None):
        raise ValueError("it has to be a number")
    table, what = known[label]
    part = study.components[table].having(**{what.name: None})
    return replace(study, **{_FIELDS.get(table, table): part})


def joints_of(hand: HandDesign) -> list[Float[np.ndarray, "points 2"]]:
    """Each finger's joints from the palm outwards, and last its tip."""
    return [
        np.array(
            [[limb.start.x, limb.start.y] for limb in limbs] + [[limbs[-1].end.x, limbs[-1].end.y]],
            float,
        )
        for limbs in (hand.finger(0), hand.finger(1))
    ]


def pulled(
    hand: HandDesign, finger: int, joint: int, x: float, y: float, *, mirrored: bool
) -> HandDesign:
    """The hand whose joint is at a point: the limb before it turns and changes its length, and what
    lies beyond moves along. A finger's first joint is an end of the palm, both of which move.

    Arguments:
        hand: any.
        finger: 0 or 1.
        joint: from 0 at the palm to the number of limbs, the tip.
        x, y: where it is to be, a length.
        mirrored: whether the other finger's goes along.
    """
    side, palm = (-1.0, 1.0)[finger], float(hand.palm_length)
    if joint == 0:
        return replace(hand, palm_length=_rounded(max(2 * side * x, 0.05 * palm), palm))
    before = joints_of(hand)[finger][joint - 1]
    heading = sum(float(angle) for angle in hand.angles[finger][: joint - 1])
    angle = math.atan2(y - before[1], side * (x - before[0])) - heading
    angle = math.radians(round(math.degrees(math.remainder(angle, 2 * math.pi)), 1))
    length = max(math.hypot(x - before[0], y - before[1]), _SHORTEST * palm)
    return limb_set(hand, finger, joint - 1, angle, _rounded(length, palm), mirrored=mirrored)


def limb_set(
    hand: HandDesign, finger: int, limb: int, angle: float, length: float, *, mirrored: bool
) -> HandDesign:
    """The hand with another angle, radians, and length of a limb, from 0; `mirrored`: of both
    fingers' limb."""
    both = mirrored and alike(hand)

    def changed(rows: FingerValues, value: float) -> FingerValues:
        first, second = (
            (*row[:limb], value, *row[limb + 1 :]) if both or k == finger else row
            for k, row in enumerate(rows)
        )
        return first, second

    return replace(hand, lengths=changed(hand.lengths, length), angles=changed(hand.angles, angle))


def _rounded(length: float, palm: float) -> float:
    """To about a thousandth of the palm."""
    step = _nice(palm / 500) / 2
    return float(f"{round(length / step) * step:.9g}")
