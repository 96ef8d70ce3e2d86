"""What hands are compared at: an object, a drive, the directions and a limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pcjax.checks import check_count, check_kind
from pcjax.model.bodies.base import Body
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import Drive
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import DIRECTIONS, Scenario, look_at
from pcjax.units import check_units


@dataclass(frozen=True)
class Task:
    """What a hand has to be good at.

    Arguments:
        body: the object.
        drive: what moves the hand.
        directions: ("does", "eoen") for their ratio, the score, or ("does",) alone.
        max_steps: limit in steps of 0.001 s.
        law: contact law.
        start_spread: of the starts, in palm lengths.
        units: of lengths (see `pcjax.units`), for labels: no number depends on it.

    Raises:
        TypeError: a body or drive that is none.
        ValueError: other directions, a limit that is no positive whole number, or an unknown unit.

    Examples:
        >>> import pcjax
        >>> task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 600_000)
        >>> len(task.scenarios(pcjax.box_hand()))
        2
    """

    body: Body
    drive: Drive
    directions: tuple[str, ...]
    max_steps: int
    law: ContactLaw = field(default_factory=ContactLaw)
    start_spread: float = 0.1
    units: str = field(default="model", repr=False)  # so that checkpoints do not depend on it

    def __post_init__(self) -> None:
        check_units(self.units)
        check_kind("body", self.body, Body)
        check_kind("drive", self.drive, Drive)
        check_kind("law", self.law, ContactLaw)
        known = [("does",), ("does", "eoen")]
        if self.directions not in known:
            raise ValueError(
                f"directions is {self.directions!r}: it has to be one of {known[0]}, {known[1]}"
            )
        check_count("max_steps", self.max_steps, 1, 2**31 - 1)

    def scenarios(self, hand: HandDesign) -> list[Scenario]:
        """One scenario for each direction."""
        return [
            DIRECTIONS[d](hand, self.body, self.drive, self.law, self.start_spread)
            for d in self.directions
        ]

    def scenarios_of(self, hands: Sequence[HandDesign]) -> list[list[Scenario]]:
        """`scenarios` of many hands whose numbers are concrete, all of which are checked at once,
        which takes little longer than one."""
        if "eoen" in self.directions:
            look_at(hands)
        return [self.scenarios(hand) for hand in hands]
