"""Exact scores of designs, compared on the same trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from tqdm import tqdm

from pcjax.design.space import DesignSpace
from pcjax.model.hand import HandDesign
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate

_Z95 = 1.959964

_BATCH = 64
"""Designs that run together."""


@dataclass(frozen=True)
class Comparison:
    """Exact scores of some designs, all on the same trials.

    Attributes:
        scores: of each design; the ratio DoEs / EoEn, or DoEs alone where there is no EoEn.
        logs: their logarithms.
        covariance: of the logarithms.
        trials: of each design and direction.
        invalid: the most trials of one design that went wrong; they are left out everywhere.
    """

    scores: list[Estimate]
    logs: Float[np.ndarray, " designs"]
    covariance: Float[np.ndarray, "designs designs"]
    trials: int
    invalid: int

    @property
    def best(self) -> int:
        """Which design has the highest score."""
        return int(np.argmax(self.logs))

    def improvement(self, start: int, end: int) -> Estimate:
        """How much higher the score of design `end` is than that of `start`."""
        values = np.exp(self.logs[[start, end]])
        jacobian = np.array([-values[0], values[1]])
        pair = np.ix_([start, end], [start, end])
        se = math.sqrt(max(float(jacobian @ self.covariance[pair] @ jacobian), 0.0))
        value = float(values[1] - values[0])
        return Estimate(value, se, value - _Z95 * se, value + _Z95 * se)


def compare(
    surrogate: Surrogate,
    space: DesignSpace,
    designs: Sequence[Float[np.ndarray, " parameters"]],
    *,
    trials: int,
    seed: int,
) -> Comparison:
    """The exact scores of designs.

    Arguments:
        surrogate: whose task and objective count.
        space: of the designs.
        designs: to be compared.
        trials: for each design and direction.
        seed: trial i is the same experiment for every design.
    """
    hands = [space.hand(design) for design in designs]
    return compare_hands(surrogate, hands, trials=trials, seed=seed)


def compare_hands(
    surrogate: Surrogate, hands: Sequence[HandDesign], *, trials: int, seed: int
) -> Comparison:
    """`compare`, of hands that need not be designs of one space."""
    exact = replace(surrogate, form="exact", trials=trials)
    sample = exact.sample(hands, seed)
    each, influences = exact.appraise(sample)
    logs, influence = each @ exact.signs, np.einsum("d,dvn->vn", exact.signs, influences)
    count = influence.shape[1]
    covariance = influence @ influence.T / (count * (count - 1))
    errors = np.sqrt(np.diag(covariance))
    scores = [
        Estimate(
            math.exp(log),
            math.exp(log) * error,
            math.exp(log - _Z95 * error),
            math.exp(log + _Z95 * error),
        )
        for log, error in zip(logs, errors, strict=True)
    ]
    return Comparison(scores, logs, covariance, trials, sample.invalid)


def score_all(
    surrogate: Surrogate,
    space: DesignSpace,
    designs: Sequence[Float[np.ndarray, " parameters"]],
    *,
    seed: int,
    progress: bool = False,
) -> tuple[list[Estimate], int]:
    """The exact scores of any number of designs, `surrogate.trials` each; a bar if wanted.

    Returns:
        The scores, and how many trials went wrong and were left out.
    """
    scores: list[Estimate] = []
    invalid = 0
    with tqdm(
        total=len(designs),
        desc="designs",
        unit="design",
        disable=None if progress else True,
        leave=False,
    ) as bar:
        for first in range(0, len(designs), _BATCH):
            some = designs[first : first + _BATCH]
            found = compare(surrogate, space, some, trials=surrogate.trials, seed=seed)
            scores += found.scores
            invalid += found.invalid
            bar.update(len(some))
    return scores, invalid
