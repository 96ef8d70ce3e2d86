"""From the trials of a hand to its indices and its score, and how they lie in arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, astuple

import numpy as np
from jaxtyping import Float, Int, Int32, UInt8

from pcjax.physics.state import INVALID
from pcjax.quality.indices import UNDEFINED, Estimate, index1, index2, ratio
from pcjax.simulate.outcomes import LIMIT, STATUS_NAMES


def indices_of(
    steps: Int32[np.ndarray, " trials"],
    status: UInt8[np.ndarray, " trials"],
    limit: int,
    *,
    caged: bool,
) -> dict[str, Estimate]:
    """Index 1 and index 2 over the trials that did not go wrong; `caged`: in a full cage."""
    valid = status != INVALID
    if not valid.any():
        return {"index1": UNDEFINED, "index2": UNDEFINED}
    lost = int(np.sum(~valid))
    return {
        "index1": index1(steps[valid], limit, certain=caged, lost=lost),
        "index2": index2(status[valid] == LIMIT, certain=caged, lost=lost),
    }


def score_of(
    steps: Int32[np.ndarray, "2 trials"],
    status: UInt8[np.ndarray, "2 trials"],
    limit: int,
    *,
    caged: tuple[bool, bool],
) -> dict[str, Estimate]:
    """The score (18) by index 1 and by index 2, of DoEs and EoEn on the same trials."""
    valid = (status != INVALID).all(axis=0)
    if not valid.any():
        return {"index1": UNDEFINED, "index2": UNDEFINED}
    lost = int(np.sum(~valid))
    held, stayed = steps[:, valid].astype(float), (status[:, valid] == LIMIT).astype(float)
    return {
        "index1": ratio(held[0], held[1], limit, certain=caged, lost=lost),
        "index2": ratio(stayed[0], stayed[1], 1.0, certain=caged, lost=lost),
    }


def rows_of(estimates: Iterable[Estimate]) -> Float[np.ndarray, "estimates 4"]:
    """Estimates along the dimension `statistic`."""
    return np.array([astuple(estimate) for estimate in estimates], float).reshape(-1, 4)


def as_plain(estimate: Estimate) -> dict[str, float | None]:
    """An estimate as JSON has it: what is not known is null."""
    return {k: v if math.isfinite(v) else None for k, v in asdict(estimate).items()}


def counts_of(status: UInt8[np.ndarray, "*some trials"]) -> Int[np.ndarray, "*some 3"]:
    """How many trials ended how, along the dimension `status_name`."""
    return np.stack([np.sum(status == code, axis=-1) for code in STATUS_NAMES], axis=-1)
