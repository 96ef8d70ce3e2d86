"""Checks of plain numbers where objects are made. Traced values pass: they end as a status."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from jax.core import Tracer


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
        raise ValueError(f"{name} is {number:g}: it has to lie between {low:g} and {high:g}")


def check_count(name: str, value: Any, low: int, high: int) -> None:
    """Raises ValueError unless `value` is a whole number with low <= value <= high."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ValueError(f"{name} is {value!r}: it has to be a whole number")
    if not low <= value <= high:
        raise ValueError(f"{name} is {value}: it has to lie between {low} and {high}")


def one_line(text: object) -> str:
    """The text with whatever would leave its line, or the printable, written as an escape."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(text))


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Asks "did you mean NAME? " for the nearest of the names; empty if none is near."""
    near = difflib.get_close_matches(word, list(names), 1, cutoff=0.5)
    return f"did you mean {near[0]}? " if near else ""
