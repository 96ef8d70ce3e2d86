"""Checks of plain numbers where objects are made. Traced values pass: they end as a status."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterable, Mapping
from types import FrameType
from typing import Any

import numpy as np
from jax.core import Tracer

from pcjax.words import InputWarning


def _plain(value: Any) -> float | None:
    """The value as a float if it is one concrete number, else None (traced or batched)."""
    if value is None or isinstance(value, Tracer) or np.ndim(value) > 0:
        return None
    return float(value)


_LARGEST = 1e15
"""Beyond this, squares of squares leave the range of float32."""


def check_finite(name: str, value: Any) -> None:
    """Raises ValueError unless `value` is a finite number (of at most 1e15)."""
    number = _plain(value)
    if number is not None and not math.isfinite(number):
        raise ValueError(f"{name} is {number}: it has to be a finite number")
    if number is not None and abs(number) > _LARGEST:
        raise ValueError(f"{name} is {number:g}: it has to be at most {_LARGEST:g} in size")


def check_kind(name: str, value: Any, kind: type) -> None:
    """Raises TypeError unless `value` is a `kind`, such as for a number or the class itself."""
    if not isinstance(value, kind):
        what = f"a {type(value).__name__}"
        if isinstance(value, type):
            what = f"the class {value.__name__}"
        elif value is None or isinstance(value, str | int | float):
            what = repr(value)
        raise TypeError(f"{name} is {what}: it has to be a {kind.__name__}")


def check_positive(name: str, value: Any) -> None:
    """Raises ValueError unless `value` is finite and above 0."""
    check_finite(name, value)
    number = _plain(value)
    if number is not None and number <= 0:
        raise ValueError(f"{name} is {number:g}: it has to be above 0")


def check_between(name: str, value: Any, low: float, high: float) -> None:
    """Raises ValueError unless low <= value <= high."""
    check_finite(name, value)
    number = _plain(value)
    if number is not None and not low <= number <= high:
        allowed = (
            f"be at least {low:g}" if high == math.inf else f"lie between {low:g} and {high:g}"
        )
        raise ValueError(f"{name} is {number:g}: it has to {allowed}")


def check_count(name: str, value: Any, low: int, high: int) -> None:
    """Raises ValueError unless `value` is a whole number with low <= value <= high."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ValueError(f"{name} is {value!r}: it has to be a whole number")
    if not low <= value <= high:
        raise ValueError(f"{name} is {value}: it has to lie between {low} and {high}")


_WRAPPERS = ("equinox", "jaxtyping", "beartype", "dataclasses")
"""Packages whose frames lie between a constructor and its caller."""


def check_radians(angles: Mapping[str, Any]) -> None:
    """Warns the caller of the function that calls this of angles beyond a turn: degrees, probably.

    Only code outside this package is warned: its own angles were checked where they came in, or
    are derived from such. Traced values are not looked at.
    """
    turn = 2 * math.pi * (1 + 1e-6)  # a turn in 32 bits is within
    large = {name: _plain(angle) for name, angle in angles.items()}
    large = {name: n for name, n in large.items() if n is not None and abs(n) > turn}
    if not large:
        return
    level, frame = 3, sys._getframe(2)
    while _package_of(frame) in _WRAPPERS and frame.f_back is not None:
        level, frame = level + 1, frame.f_back
    if _package_of(frame) == __package__:
        return
    listed = ", ".join(f"{name} is {number:g}" for name, number in large.items())
    warnings.warn(
        f"{listed}: angles are in radians, and this is more than a turn; are these degrees? "
        "math.radians converts them",
        InputWarning,
        stacklevel=level,
    )


def doubts_of_degrees(name: str, degrees: Iterable[float], *, joints: bool = False) -> list[str]:
    """What is strange about angles given in degrees, in words; mostly nothing.

    Arguments:
        name: what they are called where they were given.
        degrees: the angles.
        joints: whether these are all of a hand's joints.
    """
    largest = max(degrees, key=abs, default=0.0)
    if 360 < abs(largest) < math.inf:
        return [f"{name} is {largest:g} deg, more than a turn: a digit too many?"]
    if joints and 0 < abs(largest) < 3:
        return [f"{name}: no joint is bent by 3 deg or more; these look like radians"]
    return []


def _package_of(frame: FrameType) -> str:
    return frame.f_globals.get("__name__", "").partition(".")[0]
