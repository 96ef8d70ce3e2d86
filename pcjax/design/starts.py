"""Where a search begins, and what its result is compared with."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcjax.design.space import Design, Space
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Hand
from pcjax.words import InputWarning

_LOOKED_AT = 1024
"""Designs that are looked at where none near the base hand is allowed."""


@dataclass(frozen=True)
class Start:
    """What the result of a search is compared with.

    Attributes:
        hand: the given one, allowed or not; where it cannot be evaluated, the one that the search
            begins at.
        design: its parameters.
        moved: whether it is the latter.
        notes: what is wrong with the given hand, a line each.
    """

    hand: Hand
    design: Design
    moved: bool = False
    notes: tuple[str, ...] = ()


def starting_designs(space: Space, count: int, seed: int) -> list[Design]:
    """The base hand's design and others spread over the space (Sobol), all allowed.

    Where nothing near the base hand is allowed, the nearest of many others stands for it.

    Raises:
        ValueError: no allowed design was found.
    """
    given = space.design_of(space.base)
    try:
        first = space.nearest_allowed(given)
    except ValueError:
        others = _spread(space, _LOOKED_AT, seed)
        others = others[space.which(others)]
        if len(others) == 0:
            raise
        away = np.linalg.norm((others - given) / space.scales, axis=1)
        first = space.nearest_allowed(given, others[np.argmin(away)])
    if count == 1:
        return [first]
    spread = _spread(space, count - 1, seed)
    return [first, *(space.nearest_allowed(design, first) for design in spread)]


def _spread(space: Space, count: int, seed: int) -> Float[np.ndarray, "designs parameters"]:
    from scipy.stats import qmc  # takes more than a second to import

    draws = qmc.Sobol(len(space.free), rng=seed).random_base2(count.bit_length())
    return space.low + draws[:count] * (space.high - space.low)


def given_start(surrogate: Surrogate, space: Space, begun: Design, calls: int = 2) -> Start:
    """What a search that begins at `begun` is compared with: the base hand, if it can be evaluated.

    Warns the user, that many calls further up, if that hand is not allowed.
    """
    where = f"the search begins at {space.describe(begun)}"
    try:
        for scenario in surrogate.task.scenarios(space.base):
            scenario.check()
    except ValueError as error:
        note = (
            f"the given hand cannot be evaluated ({error}): {where}, and the result is compared "
            "with that moved start"
        )
        start = Start(space.hand(begun), begun, True, (note,))
    else:
        wrong = "; ".join(space.objections())
        note = (
            f"the given hand is not an allowed one ({wrong}): {where}, and the result is compared "
            "with the hand given"
        )
        start = Start(space.base, space.design_of(space.base), False, (note,) if wrong else ())
    for note in start.notes:
        warnings.warn(note, InputWarning, stacklevel=2 + calls)
    return start
