"""What hands in three dimensions are compared at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pcjax.model.scenario import Scenario
from pcjax.model.spatial.hand import SpatialHand
from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.quality.task import Task


@dataclass(frozen=True)
class HandWithObject:
    """A hand that is tried with objects of its own size, where that is looked for, too.

    Attributes:
        hand: in its posture.
        numbers: those of the object by the names of its fields, in place of the task's.
    """

    hand: SpatialHand
    numbers: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class SpatialTask(Task):
    """What a hand in three dimensions has to be good at; see `Task`."""

    def scenarios(self, hand: Any) -> list[Scenario]:
        """One scenario for each direction, of each task in turn; of a hand, or of one with its
        objects."""
        numbers: dict[str, Any] = {}
        if isinstance(hand, HandWithObject):
            hand, numbers = hand.hand, dict(hand.numbers)
        found: list[Scenario] = []
        for one in self.each:
            body: Any = one.body.having(**numbers) if numbers else one.body
            drive: Any = one.drive
            found += [
                SpatialScenario(hand, body, drive, one.law, d == "eoen") for d in one.directions
            ]
        return found

    def scenarios_of(self, hands: Sequence[Any]) -> list[list[Scenario]]:
        """`scenarios` of many hands."""
        return [self.scenarios(hand) for hand in hands]
