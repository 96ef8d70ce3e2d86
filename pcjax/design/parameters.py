"""The numbers of a hand that may change: their names, bounds, and linear limits on them."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcjax.checks import check_finite
from pcjax.geometry import Scalar
from pcjax.model.hand import HandDesign
from pcjax.units import in_brackets
from pcjax.words import InputWarning, did_you_mean

Rows = list[list[Scalar]]


@dataclass
class Draft:
    """What may change of a hand."""

    lengths: Rows
    angles: Rows
    thickness: Scalar

    @classmethod
    def of(cls, hand: HandDesign) -> Draft:
        """A hand as it is."""
        return cls(
            [list(row) for row in hand.lengths], [list(row) for row in hand.angles], hand.thickness
        )

    def hand(self, palm_length: Scalar) -> HandDesign:
        """The hand that has come of it."""
        lengths, angles = ((tuple(rows[0]), tuple(rows[1])) for rows in (self.lengths, self.angles))
        return HandDesign(palm_length, lengths, angles, self.thickness)


@dataclass(frozen=True)
class _Kind:
    """What a kind of parameter is to a finger: how to read it, and how to give it a value."""

    unit: str
    read: Callable[[HandDesign, int, int], Scalar]
    write: Callable[[HandDesign, Draft, int, int, Scalar], None]


def _read_tip_angle(hand: HandDesign, finger: int, _: int) -> Scalar:
    return 90.0 - hand.angles[finger][-1] * (180.0 / math.pi)  # (21)


def _write_tip_angle(_: HandDesign, draft: Draft, finger: int, __: int, value: Scalar) -> None:
    draft.angles[finger][-1] = (90.0 - value) * (math.pi / 180.0)


def _read_angle(hand: HandDesign, finger: int, joint: int) -> Scalar:
    return hand.angles[finger][joint] * (180.0 / math.pi)


def _write_angle(_: HandDesign, draft: Draft, finger: int, joint: int, value: Scalar) -> None:
    draft.angles[finger][joint] = value * (math.pi / 180.0)


def _read_length(hand: HandDesign, finger: int, joint: int) -> Scalar:
    return hand.lengths[finger][joint]


def _write_length(_: HandDesign, draft: Draft, finger: int, joint: int, value: Scalar) -> None:
    draft.lengths[finger][joint] = value


def _read_gap_width(hand: HandDesign, _: int, __: int) -> Scalar:
    return hand.finger(1)[-1].start.x - hand.finger(0)[-1].start.x  # (20)


def _write_gap_width(hand: HandDesign, draft: Draft, finger: int, _: int, value: Scalar) -> None:
    # The second limbs give way, each by half; exact where they are parallel to the palm.
    change = 0.5 * (value - _read_gap_width(hand, 0, 0))
    draft.lengths[finger][-2] = hand.lengths[finger][-2] - change


def _read_thickness(hand: HandDesign, _: int, __: int) -> Scalar:
    return hand.thickness


def _write_thickness(_: HandDesign, draft: Draft, __: int, ___: int, value: Scalar) -> None:
    draft.thickness = value


_KINDS = {
    "fingertip_angle": _Kind("deg", _read_tip_angle, _write_tip_angle),
    "fingertip_length": _Kind("", _read_length, _write_length),
    "gap_width": _Kind("", _read_gap_width, _write_gap_width),
    "joint_angle": _Kind("deg", _read_angle, _write_angle),
    "link_length": _Kind("", _read_length, _write_length),
    "thickness": _Kind("", _read_thickness, _write_thickness),
}

HELP = (
    "fingertip_angle_deg, fingertip_length (of both fingers; _1 or _2 after angle or length: of "
    "one), gap_width, joint_angle_J_deg, link_length_J (joint J of both fingers; IJ: of finger I), "
    "thickness (of palm and limbs)"
)
"""What a parameter may be called: what is in degrees says so."""

_NAME = re.compile(r"([a-z_]+?)(?:_([12]?)(\d))?(_deg)?")
"""A parameter's kind, finger and joint, and its unit."""


def labelled(name: str) -> str:
    """A name as `HELP` has it, from one that may lack the unit or have hyphens, as flags do."""
    name = name.replace("-", "_")
    match = _NAME.fullmatch(name)
    kind = _KINDS.get(match.group(1)) if match else None
    return name.removesuffix("_deg") + ("_deg" if kind.unit else "") if kind else name


def current_name(name: str) -> str:
    """A parameter's name; an earlier spelling, without the unit, is taken with a warning."""
    label = labelled(name)
    if label == f"{name}_deg":
        warnings.warn(f"{name} is called {label} now: it is in degrees", InputWarning, stacklevel=4)
        return label
    return name


@dataclass(frozen=True)
class Parameter:
    """One number of a hand that may change.

    Attributes:
        name: one of those in `HELP`, without the unit.
        low, high: its bounds, in degrees, or a length.
        kind: which of the kinds.
        fingers: 0 and 1 for finger 1 and 2.
        joint: which joint or limb of the finger, from 0; -1 for the fingertip.
    """

    name: str
    low: float
    high: float
    kind: str
    fingers: tuple[int, ...]
    joint: int

    @property
    def unit(self) -> str:
        """ "deg", or "" for a length."""
        return _KINDS[self.kind].unit

    @property
    def label(self) -> str:
        """Its name with the unit, one of those in `HELP`."""
        return labelled(self.name)

    @property
    def axis_unit(self) -> str:
        """Of a coordinate of a dataset; "": it goes by the label and the file's unit of length."""
        return ""

    def headed(self, units: str) -> str:
        """Its name and in brackets its unit, where lengths are in `units`."""
        return self.name + in_brackets(self.label, units)

    def read(self, hand: HandDesign) -> Scalar:
        """Its value in a hand; that of the first finger it is for."""
        return self.read_each(hand)[0]

    def read_each(self, hand: HandDesign) -> list[Scalar]:
        """Its value on each of its fingers."""
        return [_KINDS[self.kind].read(hand, finger, self.joint) for finger in self.fingers]

    def write(self, base: HandDesign, draft: Draft, value: Scalar) -> None:
        """Changes what is to differ from `base` so that it has this value."""
        for finger in self.fingers:
            _KINDS[self.kind].write(base, draft, finger, self.joint, value)


def parameter(
    name: str, hand: HandDesign, low: float | None = None, high: float | None = None
) -> Parameter:
    """A parameter by its name, for a hand, with bounds.

    Arguments:
        name: see `HELP`.
        low, high: degrees or lengths. Unless given: -30 to 50 deg for fingertips, 40 deg
            either way for joints, 0.05 to 0.35 L_p for fingertips' lengths, 0.2 to 0.8 L_p for the
            gap, half to one and a half of a link, 0.01 to 0.1 L_p for the thickness.

    Raises:
        ValueError: an unknown name, a joint that the hand does not have, or bounds out of order.
    """
    match = _NAME.fullmatch(name)
    kind = match.group(1) if match else name
    if match is None or kind not in _KINDS or name != labelled(name):
        hint = did_you_mean(labelled(name), [labelled(known) for known in _KINDS])
        raise ValueError(f"there is no parameter {name}: {hint}there are {HELP}")
    unit = match.group(4) or ""
    limbs = min(len(lengths) for lengths in hand.lengths)
    fingers, joint = (0, 1), -1
    if kind in ("joint_angle", "link_length"):
        if match.group(3) is None or not 1 <= int(match.group(3)) <= limbs:
            raise ValueError(
                f"{name}: say which joint, {kind}_1{unit} to {kind}_{limbs}{unit} for this hand"
            )
        joint = int(match.group(3)) - 1
        if match.group(2):
            fingers = (int(match.group(2)) - 1,)
    elif match.group(3) is not None:
        whole = kind in ("gap_width", "thickness")
        if whole or match.group(2) or match.group(3) not in "12":
            raise ValueError(f"there is no parameter {name}: there are {HELP}")
        fingers = (int(match.group(3)) - 1,)
    if kind == "gap_width" and limbs < 3:
        raise ValueError("gap_width needs a hand with three limbs or more a finger")
    name = name.removesuffix(unit)
    found = Parameter(name, -math.inf, math.inf, kind, fingers, joint)
    value, palm = float(found.read(hand)), float(hand.palm_length)
    usual = {
        "fingertip_angle": (-30.0, 50.0),
        "fingertip_length": (0.05 * palm, 0.35 * palm),
        "gap_width": (0.2 * palm, 0.8 * palm),
        "joint_angle": (value - 40.0, value + 40.0),
        "link_length": (0.5 * value, 1.5 * value),
        "thickness": (0.01 * palm, 0.1 * palm),
    }[kind]
    low, high = (usual[0] if low is None else low), (usual[1] if high is None else high)
    check_finite(f"{name}'s lower bound", low)
    check_finite(f"{name}'s upper bound", high)
    if kind in ("fingertip_length", "link_length", "gap_width") and low <= 0:
        raise ValueError(f"{name}'s lower bound is {low:g}: a length has to be above 0")
    if kind == "thickness" and low < 0:
        raise ValueError(f"{name}'s lower bound is {low:g}: it has to be at least 0")
    if not low < high:
        raise ValueError(f"{name} is free from {low:g} to {high:g}: the bounds are out of order")
    return Parameter(name, low, high, kind, fingers, joint)


@dataclass(frozen=True)
class Limit:
    """A linear limit: the sum of coefficients times parameters is at most a number.

    Attributes:
        text: as it was given.
        coefficients: of each free parameter.
        most: the number.
    """

    text: str
    coefficients: Float[np.ndarray, " parameters"]
    most: float

    def __repr__(self) -> str:
        return f"Limit({self.text!r})"


def linear_limit(text: str, free: Sequence[Parameter]) -> Limit:
    """A limit as text, for instance "fingertip_length + 0.5 gap_width <= 200".

    Arguments:
        text: terms of parameters with coefficients, then <= or >=, then a number; hyphens within
            names stand for underscores.
        free: the parameters that it may name; degrees and lengths.

    Raises:
        ValueError: it cannot be read, or names something that is not free.
    """
    parts = re.split(r"(<=|>=)", text)
    what = f"limit {text!r}"
    example = "it has to look like 'fingertip_length + 0.5 gap_width <= 200'"
    try:
        left, sign, right = parts
        most = float(right)
    except ValueError:
        raise ValueError(f"{what} cannot be read: {example}") from None
    names = [p.label for p in free]
    coefficients = np.zeros(len(names))
    term = r"\s*([+-])?\s*(\d+\.?\d*|\.\d+)?\s*\*?\s*([a-z][a-z0-9_-]*)"
    rest = left
    while rest.strip():
        match = re.match(term, rest)
        if match is None or (rest is not left and match.group(1) is None):
            raise ValueError(f"{what} cannot be read at {rest.strip()!r}: {example}")
        name = current_name(match.group(3).replace("-", "_"))
        if name not in names:
            hint = did_you_mean(name, names)
            raise ValueError(f"{what}: {name} is not free: {hint}free are {', '.join(names)}")
        size = float(match.group(2) or 1.0)
        coefficients[names.index(name)] += -size if match.group(1) == "-" else size
        rest = rest[match.end() :]
    if not coefficients.any():
        raise ValueError(f"{what} limits nothing: {example}")
    check_finite(what, most)
    return Limit(text, coefficients, most) if sign == "<=" else Limit(text, -coefficients, -most)
