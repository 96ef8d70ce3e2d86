"""Numbers of a study by their names, and what becomes of it where one is another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pcjax.components import Component, Quantity, quantities
from pcjax.design.parameters import labelled, parameter
from pcjax.design.space import DesignSpace
from pcjax.model.bodies.base import BODIES
from pcjax.model.drives.base import DRIVES
from pcjax.model.hand import HandDesign
from pcjax.units import length_in_words
from pcjax.words import did_you_mean

_USUAL_OF_HANDS = (
    "fingertip_angle_deg",
    "fingertip_length",
    "gap_width",
    "joint_angle_1_deg",
    "link_length_1",
    "thickness",
)


def names(components: Mapping[str, Component]) -> dict[str, tuple[str, Quantity]]:
    """The single numbers of components by their names in files, each with its table."""
    return {
        what.file_key: (table, what)
        for table, component in components.items()
        for what in quantities(type(component)).values()
        if what.key and what.count is None and what.kind in (int, float)
    }


def full_name(name: str, components: Mapping[str, Component]) -> str:
    """A component's number as files name it, from what one types: `-` for `_`, an angle without its
    unit."""
    name = name.replace("-", "_")
    return f"{name}_deg" if f"{name}_deg" in names(components) else name


def unit_of(name: str, components: Mapping[str, Component], units: str) -> str:
    """The unit of a number that can be swept, where lengths are in `units`."""
    known = names(components)
    if name in known:
        return known[name][1].unit_in(units)
    if name == "start_spread":
        return "1"
    return "degree" if name.endswith("_deg") else length_in_words(units)


def change(
    hand: HandDesign, components: Mapping[str, Component], name: str, value: float
) -> tuple[HandDesign, dict[str, Any]]:
    """The hand and the components where the number of that name is another.

    Raises:
        ValueError: there is no such number, or the value is out of range.
    """
    parts: dict[str, Any] = dict(components)
    if name == "palm_length":
        return replace(hand, palm_length=value), parts
    known = names(components)
    if name in known:
        table, what = known[name]
        parts[table] = components[table].having(**{what.name: what.from_file(value)})
        return hand, parts
    try:
        found = parameter(labelled(name), hand)
    except ValueError as error:
        elsewhere = [
            f"the {registry.noun} {kind}"
            for registry in (BODIES, DRIVES)
            for kind, component in registry.items()
            if any(
                name == what.file_key and what.kind is not bool
                for what in quantities(component).values()
            )
        ]
        if elsewhere:
            where = ", ".join(elsewhere)
            raise ValueError(f"{name} is none of this study's numbers: {where} has it") from None
        choices = [*_USUAL_OF_HANDS, "palm_length", *known, "start_spread"]
        hint = did_you_mean(name, choices)
        if not hint and "there is no parameter" not in str(error):
            raise
        raise ValueError(
            f"there is no {name} to be swept: {hint}there are {', '.join(choices)}; "
            "_1 or _2 after fingertip_angle, fingertip_length: of one finger; joint_angle_IJ_deg, "
            "link_length_IJ: joint J of finger I"
        ) from None
    if found.label != name:
        raise ValueError(f"there is no {name} to be swept: did you mean {found.label}?")
    free = replace(found, low=-math.inf, high=math.inf)
    return DesignSpace(hand, (free,), 0.0, 0.0).hand([value]), parts
