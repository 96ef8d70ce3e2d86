"""What hands are compared at: an object, a drive, the directions and a limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from pcjax.checks import check_count, check_kind, check_positive
from pcjax.model.bodies.base import Body
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import Drive
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import DIRECTIONS, Scenario, look_at
from pcjax.units import check_units

Hand = Any
"""What a task makes scenarios of: a `HandDesign`, or in three dimensions what a `SpatialTask`
takes."""


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
        also: tasks that it has to be good at as well, in the same directions and to the same limit.
        weights: of this one and those, in the mean of the scores' logarithms; alike unless given.
        worst: whether the least of the scores counts, in place of that mean.

    Raises:
        TypeError: a body or drive that is none.
        ValueError: other directions, a limit that is no positive whole number, an unknown unit, or
            other tasks or weights that do not go with it.

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
    also: tuple[Task, ...] = ()
    weights: tuple[float, ...] = ()
    worst: bool = False

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
        for other in self.also:
            if other.also:
                raise ValueError("a task that is one of several cannot have others of its own")
            for what in ("directions", "max_steps", "units"):
                if getattr(other, what) != getattr(self, what):
                    raise ValueError(f"tasks that go together have to have the same {what}")
            if other.drive.period != self.drive.period:
                raise ValueError("tasks that go together have to have the same period")
        if self.weights and len(self.weights) != len(self.each):
            raise ValueError(
                f"there are {len(self.weights)} weights for {len(self.each)} conditions: as many "
                "of either"
            )
        for weight in self.weights:
            check_positive("a weight", weight)
        if self.worst and self.weights:
            raise ValueError("weights are for the mean of the scores, and the worst one counts")

    @property
    def each(self) -> list[Task]:
        """This one alone, and the others."""
        return (
            [replace(self, also=(), weights=(), worst=False), *self.also] if self.also else [self]
        )

    @property
    def shares(self) -> Float[np.ndarray, " tasks"]:
        """The weights, of sum 1."""
        weights = np.array(self.weights or [1.0] * len(self.each))
        return weights / weights.sum()

    @property
    def runs(self) -> int:
        """How many scenarios a hand has."""
        return len(self.each) * len(self.directions)

    def scenarios(self, hand: HandDesign) -> list[Scenario]:
        """One scenario for each direction, of each task in turn."""
        return [
            DIRECTIONS[d](hand, one.body, one.drive, one.law, one.start_spread)
            for one in self.each
            for d in one.directions
        ]

    def scenarios_of(self, hands: Sequence[HandDesign]) -> list[list[Scenario]]:
        """`scenarios` of many hands whose numbers are concrete, all of which are checked at once,
        which takes little longer than one."""
        if "eoen" in self.directions:
            look_at(hands)
        return [self.scenarios(hand) for hand in hands]
