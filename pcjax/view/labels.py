"""What pictures call things: names in words, and the units of axes and values."""

from __future__ import annotations

from pcjax.physics.state import PAPER_DT
from pcjax.results.schema import NAMES
from pcjax.units import PER_METRE

_STEPS = f"steps of {PAPER_DT:g} s"
_SCORES = {
    "index1": ("index 1", _STEPS),
    "index2": ("index 2", "share of trials"),
    "escape_rate": ("mean time to escape", "s"),
}
"""What a score is made of: in words, and its unit where it is no ratio."""


def in_words(name: str) -> str:
    """A parameter's or a direction's name in files, as one says it, without its unit."""
    return NAMES.get(name, name.removesuffix("_deg").replace("_", " "))


def unit_in_words(name: str, unit: str | None) -> str:
    """The unit of a parameter of that name, from the one that its file has; "" if it has none."""
    # Earlier files say "as in the study" of all but angles, which is not known here.
    known = "" if unit in (None, "1", "as in the study") else unit
    return "deg" if name.endswith("_deg") or known in ("degree", "degrees") else known


def axis_label(name: str, unit: str | None = None) -> str:
    """A parameter's label at an axis: its name and, in brackets, its unit."""
    unit = unit_in_words(name, unit)
    return in_words(name) + (f" [{unit}]" if unit else "")


def value_text(name: str, value: float | str, unit: str | None = None) -> str:
    """A parameter's name, its value and its unit."""
    if isinstance(value, str):
        return in_words(value) if name == "direction" else f"{in_words(name)} {in_words(value)}"
    unit = unit_in_words(name, unit).replace("model length", "model units")
    return f"{in_words(name)} {value:g}" + (f" {unit}" if unit else "")


def length_text(length: float, units: str) -> str:
    """A length with its unit, the model's too."""
    return f"{length:.4g} {units if units in PER_METRE else 'model units'}"


def objective_label(objective: str, over: str = "") -> str:
    """What a score is made of, of which conditions, and its unit, for an axis."""
    words, unit = _SCORES[objective]
    return f"{words}{over} [{unit}]"


def score_label(name: str) -> str:
    """The label of an axis with scores, from `score_name`: in words, and with the unit of what is
    no ratio."""
    what, _, objective = name.partition(" by ")
    objective, comma, over = objective.partition(", ")
    if "/" in what:
        return f"score {what} ({_SCORES[objective][0]}{comma}{over})"
    return f"{what}: {objective_label(objective, comma + over)}" if objective else what
