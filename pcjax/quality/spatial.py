"""What hands in three dimensions are compared at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pcjax.model.scenario import Scenario
from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.quality.task import Task


@dataclass(frozen=True)
class SpatialTask(Task):
    """What a hand in three dimensions has to be good at; see `Task`."""

    def scenarios(self, hand: Any) -> list[Scenario]:
        """One scenario for each direction, of each task in turn."""
        return [
            SpatialScenario(hand, one.body, one.drive, one.law, d == "eoen")  # pyright: ignore
            for one in self.each
            for d in one.directions
        ]

    def scenarios_of(self, hands: Sequence[Any]) -> list[list[Scenario]]:
        """`scenarios` of many hands."""
        return [self.scenarios(hand) for hand in hands]
