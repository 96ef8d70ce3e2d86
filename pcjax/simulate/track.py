"""Where trials are while they are run, for those who want to know more than how they end."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Array, Bool, Float, Int

from pcjax.geometry import Vec
from pcjax.simulate.lanes import Lanes


class Track(NamedTuple):
    """Where the trials of a block were in one call of a compiled program, point by point.

    The first point is where the call found them. Between two points a trial's centre moves under a
    constant acceleration, such that it arrives at the later one with the velocity there.

    Attributes:
        period: which period of the drive.
        time: seconds of that period gone by. It stays once a trial has ended.
        position: of the centre in the hand frame.
        velocity: as seen from the hand; None for points close enough for straight lines.
    """

    period: Int[Array, "points lanes"]
    time: Float[Array, "points lanes"]
    position: Vec
    velocity: Vec | None


@runtime_checkable
class Follower(Protocol):
    """Who is told where trials are."""

    def follow(self, lanes: Lanes, track: Track, ran: Bool[np.ndarray, " lanes"]) -> None:
        """Takes note of what one call did; from any thread.

        Arguments:
            lanes: after the call.
            track: where they were, in NumPy's arrays.
            ran: which of them were under way.
        """
        ...
