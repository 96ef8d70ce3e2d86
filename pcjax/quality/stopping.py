"""How many trials a precision takes that was asked for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from pcjax.quality.indices import Estimate

F = TypeVar("F")

FIRST_LOOK = 1000
"""Trials after which it is looked at for the first time how many it takes."""

_MARGIN = 1.1
"""How many times as many trials are run as seem to be needed, so that few looks are."""

_GROWTH = 10.0
"""How many times as many trials the next look has at most."""


def half_width(estimate: Estimate) -> float:
    """Half of its 95 % interval."""
    return 0.5 * (estimate.high - estimate.low)


def precision_of(estimate: Estimate) -> float:
    """Half of its 95 % interval as a share of it; NaN where nothing is known."""
    return half_width(estimate) / estimate.value


def until_known(
    target: float | None,
    most: int,
    go_on: Callable[[int], F],
    precision: Callable[[F], float],
) -> F:
    """What so many trials give that it is as precise as is asked for.

    Arguments:
        target: the precision; None: after the most trials.
        most: trials that there may be.
        go_on: what a number of trials gives.
        precision: of that.
    """
    if target is None:
        return go_on(most)
    trials = min(FIRST_LOOK, most)
    while True:
        found = go_on(trials)
        more = next_look(precision(found), target, trials, most)
        if more == trials:
            return found
        trials = more


def next_look(half: float, wanted: float, trials: int, most: int) -> int:
    """After how many trials to look again; `trials` if these will do, or there are no more.

    Whoever looks after every trial and stops at the first interval that is narrow enough stops
    where the scatter is underestimated. So what is seen now says how many trials there shall be,
    which are then run whatever they show; there are two or three looks.

    Arguments:
        half: half of the 95 % interval from the trials so far; NaN where nothing is known.
        wanted: what it is to be at most.
        trials: so far.
        most: that there may be.

    Examples:
        >>> from pcjax.quality.stopping import next_look
        >>> next_look(0.02, 0.01, 1000, 100_000)
        4400
        >>> next_look(0.0099, 0.01, 4400, 100_000)
        4400
    """
    if trials >= most or half <= wanted:
        return trials
    known = math.isfinite(half) and wanted > 0
    needed = _MARGIN * (half / wanted) ** 2 if known else _GROWTH
    return min(most, math.ceil(trials * min(needed, _GROWTH)))
