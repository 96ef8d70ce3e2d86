"""Units of length: which there are, and what a length in them is called."""

from __future__ import annotations

PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0}
"""Real units, and how many of each are a metre."""

UNITS = ("model", *PER_METRE)
"""What lengths may be in. "model" is the paper's: it has no size of its own, and g is 9.8 in it."""

_EARTH = 9.8
"""g in m / s^2, as the paper rounds it."""

_HANDS_IN_MM = 20.0, 150.0
"""Palms that most real hands have in mm; the paper's are 500 and 200 model units."""


def check_units(units: str) -> None:
    """
    Raises:
        ValueError: there is no such unit.
    """
    if units not in UNITS:
        raise ValueError(f"units is {units!r}: it has to be one of {', '.join(UNITS)}")


def length_in_words(units: str) -> str:
    """The unit of a length, for labels and files."""
    return units if units in PER_METRE else "model length"


def with_unit(length: float, units: str) -> str:
    """A length in words, without the unit where that is the model's."""
    return f"{length:.4g}" + (f" {units}" if units in PER_METRE else "")


def in_brackets(name: str, units: str) -> str:
    """The unit of a parameter with that name as labels have it; "" for the model's lengths."""
    if name.endswith("_deg"):
        return " [deg]"
    return f" [{units}]" if units in PER_METRE else ""


def doubts_of_gravity(gravity: float | None, units: str) -> list[str]:
    """What is strange about gravity where lengths are in a real unit, in words; mostly nothing."""
    if gravity is None or units not in PER_METRE:
        return []
    own = _EARTH * PER_METRE[units]
    return [
        f"gravity is {gravity:g}, the earth's in {other} / s^2, and lengths are in {units}: "
        f"there it is {own:g}"
        for other, scale in PER_METRE.items()
        if other != units and abs(gravity - _EARTH * scale) < 0.03 * _EARTH * scale
    ]


def doubts_of_model_units(palm_length: float, where: str) -> list[str]:
    """What is strange about a hand for which neither a unit nor a gravity was given, in words.

    If it is as large in mm as most real hands are, it is probably in mm. The paper's hands, and
    those on their scale, are larger. A larger one in mm cannot be told from those.

    Arguments:
        palm_length: of a hand of which that was given.
        where: one says what the unit is.
    """
    low, high = _HANDS_IN_MM
    if not low <= palm_length <= high:
        return []
    return [
        f"palm_length is {palm_length:g} in the paper's model units, in which gravity is "
        f'{_EARTH:g}; are these mm? "mm" as {where} says so, "model" that they are not'
    ]
