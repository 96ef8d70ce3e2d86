"""Words: of errors and warnings, and the package's own name and version."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version


def package_version() -> str:
    """The installed version of pcjax."""
    try:
        return version("pcjax")
    except PackageNotFoundError:
        return "unknown (not installed)"


def one_line(text: object) -> str:
    """The text with whatever would leave its line, or the printable, written as an escape."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(text))


class InputWarning(UserWarning):
    """Input that can be used, but is probably not what was meant."""


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Asks "did you mean NAME? " for the nearest of the names; empty if none is near.

    The dashes that all flags begin with make none of them near.
    """
    known = {name.lstrip("-"): name for name in names}
    near = difflib.get_close_matches(word.lstrip("-"), known, 1, cutoff=0.6)
    return f"did you mean {known[near[0]]}? " if near else ""


_SPELT = {"\u00b1": "+-", "\u00b0": " deg", "\u2212": "-", "\u00d7": "x", "\u2026": "..."}


def in_ascii(text: str) -> str:
    """The text as a terminal prints it that knows no letters but ASCII."""
    return "".join(c if c.isascii() else _SPELT.get(c, "?") for c in text)
