"""How trials end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int32, UInt8

from pcjax.checks import check_count
from pcjax.physics.state import INVALID, PAPER_DT, PASSED

LIMIT = 3
"""Status of a trial that reached the step limit."""

STATUS_NAMES = {PASSED: "passed", LIMIT: "limit", INVALID: "invalid"}
"""What a trial can end as: through the goal, still there at the limit, or gone wrong."""


@dataclass(frozen=True)
class Outcomes:
    """How every trial of every condition ended.

    Attributes:
        steps: the paper's step (of 0.001 s) in which the trial ended, at most `max_steps`.
        status: PASSED, LIMIT or INVALID (`STATUS_NAMES`).
        max_steps: the step limit.
        watch: for sticks, what `Watch` keeps of each trial.
        excursion: where the goal is relaxed, the `Excursion` of each trial: its peak, that of the
            first period, and the survival time.
        final: if kept, where each trial was in the end: x, y, vx, vy.
    """

    steps: Int32[np.ndarray, "conditions trials"]
    status: UInt8[np.ndarray, "conditions trials"]
    max_steps: int
    watch: Float32[np.ndarray, "conditions trials 3"] | None = None
    excursion: Float[np.ndarray, "conditions trials 3"] | None = None
    final: Float[np.ndarray, "conditions trials 4"] | None = None

    def of(self, conditions: Sequence[int]) -> Outcomes:
        """Those of some conditions, on their own."""
        return replace(self, **{name: whole[conditions] for name, whole in self._arrays()})

    def put(self, conditions: Sequence[int], part: Outcomes) -> None:
        """Fills in the outcomes of some conditions, which were run on their own."""
        for name, whole in self._arrays():
            whole[conditions] = getattr(part, name)

    def joined(self, more: Outcomes) -> Outcomes:
        """With further trials of the same conditions."""
        arrays = dict(more._arrays())
        return replace(
            self,
            **{
                name: np.concatenate([whole, arrays[name]], axis=1)
                for name, whole in self._arrays()
            },
        )

    def _arrays(self) -> list[tuple[str, np.ndarray]]:
        names = ("steps", "status", "watch", "excursion", "final")
        return [(name, whole) for name in names if (whole := getattr(self, name)) is not None]

    @classmethod
    def blank(
        cls,
        conditions: int,
        trials: int,
        max_steps: int,
        *,
        watched: bool = False,
        relaxed: bool = False,
        final: bool = False,
    ) -> Outcomes:
        """Outcomes to be filled in.

        Arguments:
            watched: whether with a `watch`.
            relaxed: whether with `excursion`.
            final: whether with `final`.

        Raises:
            ValueError: a count out of range.
        """
        check_count("trials", trials, 1, 2**31 - 1)
        check_count("max_steps", max_steps, 1, 2**31 - 1)
        shape = conditions, trials
        return cls(
            np.zeros(shape, np.int32),
            np.zeros(shape, np.uint8),
            max_steps,
            np.zeros((*shape, 3), np.float32) if watched else None,
            np.zeros((*shape, 3)) if relaxed else None,
            np.zeros((*shape, 4)) if final else None,
        )


def paper_steps(seconds: Any) -> Any:
    """In which of the paper's steps a time lies, counted from 1."""
    return np.maximum(np.ceil(seconds / PAPER_DT - 1e-6), 1)
