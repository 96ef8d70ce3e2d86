"""What is checked of a scenario before it is run: whether its hand is one, and the object fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from pcjax.geometry import Flag, Scalar, library_of
from pcjax.model.bodies.base import Body
from pcjax.model.hand import HandDesign
from pcjax.model.layout import (
    Geometry,
    Place,
    geometries_of,
    geometry_of_hand,
    same_gap,
)


@runtime_checkable
class Held(Protocol):
    """What is looked at of a scenario in the plane."""

    @property
    def hand(self) -> HandDesign: ...
    @property
    def body(self) -> Body: ...
    @property
    def start_spread(self) -> Scalar: ...
    @property
    def contact_radius(self) -> Scalar: ...


def is_hand(hand: HandDesign, directions: Sequence[str]) -> Flag:
    """Whether a hand is one in these directions: no limbs cross, the fingertips face each other
    across a free goal line, and it has EoEn if that is asked for. The numbers may be traced."""
    xp, seen = library_of(hand), {"does": hand}
    if "eoen" in directions:
        seen["eoen"] = hand.with_fingertips_mirrored()
    good = xp.asarray(True)
    for direction in directions:
        one = seen[direction]
        crossed = xp.any(xp.asarray(list(one.crossings().values())), axis=0)
        good = good & one.faces() & xp.logical_not(one.blocked_goal() | crossed)
    return good & same_gap(hand.gap(), seen[directions[-1]].gap(), hand.thickness)


def _slack(scenario: Held) -> Scalar:
    return -1e-9 * scenario.hand.palm_length


def check_geometry(scenario: Held) -> float:
    """Checks a scenario whose numbers are concrete and returns the hand's gap.

    Raises:
        ValueError: limbs that cross each other or the palm, fingertips that have swapped sides, a
            limb that cuts the goal line, an object that does not fit at one of its starts, or a
            start that is not inside what limbs and goal line enclose.
    """
    found = geometry_of(scenario)
    for (a, b), crossed in found.crossings.items():
        if crossed:
            raise ValueError(
                f"{b} crosses {a}: limbs may touch but not cross; shorten it or change its angle"
            )
    if not found.faces:
        raise ValueError(
            "the fingertips have swapped sides: finger 1's has to stay on the left of finger 2's "
            "for there to be a gap between them; shorten a limb or change a joint angle"
        )
    if found.blocked:
        raise ValueError(
            "a limb cuts the goal line between the fingertips, so nothing tells inside from "
            "outside; shorten it or change a joint angle"
        )
    if found.fit.clearance < _slack(scenario):
        raise ValueError(
            f"the {scenario.body.noun} {scenario.body.size_in_words()} does not fit at its start "
            f"near the palm's ends (it overlaps a limb by {-found.fit.clearance:.3g}): "
            + _advice(scenario)
        )
    if found.fit.outside:
        raise ValueError(
            "the object would start beyond the goal line, outside of what the hand encloses: "
            + _advice(scenario)
        )
    return float(found.gap)


def geometry_of(scenario: Held) -> Geometry:
    """What a scenario looks like whose numbers are concrete, in 64 bits."""
    return geometry_of_hand(*_place(scenario))


def _place(scenario: Held) -> Place:
    return scenario.hand, scenario.contact_radius, scenario.start_spread


def _advice(scenario: Any) -> str:
    """What would let the object start inside the hand, found by trying."""

    def starts(spread: float, shrunk: float = 1.0) -> bool:
        body = scenario.body if shrunk == 1.0 else scenario.body.scaled(shrunk)
        other = replace(scenario, body=body, start_spread=spread)
        fit = geometry_of(other).fit
        return bool(fit.clearance >= _slack(other) and not fit.outside)

    spread = float(scenario.start_spread)
    tried = [spread * (1 - k / 20) for k in range(1, 21)]
    fitting = next((share for share in tried if starts(share)), None)
    if fitting is not None:
        return f"start_spread (now {spread:g}) has to be {fitting:.3g} or less"
    if starts(0.0, 1e-3):
        return "take a smaller object, and a smaller start_spread; start_spread alone does not help"
    return "change the joint angles; no object and no start_spread would do"


def passages_of(scenarios: Sequence[Held]) -> list[np.ndarray]:
    """Widths between any two limbs that share no joint, for plain numbers."""
    return [np.array(found.passages) for found in geometries_of(list(map(_place, scenarios)))]
