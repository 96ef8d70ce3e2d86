"""What the ensemble and the engines hand to each other: a block of trials under way."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from pcjax.model.drive import Swing
from pcjax.model.scenario import World
from pcjax.physics.step import PASSED


class Lanes(NamedTuple):
    """Trials under way: arrays of shape (lanes,), NumPy's between calls and JAX's within.

    Attributes:
        condition, trial: which experiment.
        period: which period of the drive, from 0; -1 before the first.
        time: seconds of that period gone by; infinite before the first.
        x, y, vx, vy: the object's position and velocity.
        steps: steps or leaps that the engine has taken since the trial began.
        lag: seconds by which the trial passed before its last step's end.
        status: RUNNING, PASSED or INVALID.
    """

    condition: Any
    trial: Any
    period: Any
    time: Any
    x: Any
    y: Any
    vx: Any
    vy: Any
    steps: Any
    lag: Any
    status: Any

    @classmethod
    def idle(cls, count: int, dtype: type) -> Lanes:
        """Lanes with nothing to do."""
        whole = ("condition", "trial", "period", "steps", "status")
        idle = cls(**{n: np.zeros(count, np.int32 if n in whole else dtype) for n in cls._fields})
        idle.status[:] = PASSED
        return idle


class Engine(Protocol):
    """How a block of trials is advanced."""

    @property
    def name(self) -> str:
        """What the command line calls it."""
        ...

    @property
    def rounds(self) -> int:
        """How often in one call lanes whose period is over begin the next."""
        ...

    def step_taken(self, period: float) -> float:
        """The step taken for periods of `period` seconds, s; NaN for one that takes no steps."""
        ...

    def run(self, worlds: World, swings: Swing, lanes: Lanes) -> Lanes:
        """Takes lanes some way through their periods, at most to the end of them.

        Arguments:
            worlds, swings: batches; every leaf has the lanes as its first axis.
            lanes: those with another status than RUNNING or whose period is over stay as they are.
        """
        ...

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s, for periods of `period` seconds."""
        ...
