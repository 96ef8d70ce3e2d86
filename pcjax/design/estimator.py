"""What an estimate of a gradient is, and what every estimator of one does."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcjax.design.space import Design, DesignSpace
from pcjax.quality.surrogate import Surrogate


@dataclass(frozen=True)
class Gradient:
    """An estimate of the surrogate's logarithm and of its derivative.

    Attributes:
        value, value_se: the logarithm of the score at the design.
        gradient: per unit of each parameter.
        covariance: of the gradient.
        parts, parts_se: the derivatives of the logarithm of each run, a task in one direction; the
            gradient is made of these.
        largest_share: of the squared deviations of the noisiest component, the largest trial's
            share; above 0.05 the standard errors are not to be trusted.
        trials: simulated, all hands and directions together.
        seconds: wall time.
        invalid: trials of a hand and direction that went wrong, and are left out.
    """

    value: float
    value_se: float
    gradient: Design
    covariance: Float[np.ndarray, "parameters parameters"]
    parts: Float[np.ndarray, "runs parameters"]
    parts_se: Float[np.ndarray, "runs parameters"]
    largest_share: float
    trials: int
    seconds: float
    invalid: int = 0

    @property
    def se(self) -> Design:
        """Standard errors of the gradient."""
        return np.sqrt(np.diag(self.covariance))


Designs = Sequence[Design]


class Estimator(ABC):
    """How gradients are estimated, at one design or several, all on the same trials."""

    @abstractmethod
    def __call__(
        self, surrogate: Surrogate, space: DesignSpace, designs: Designs, seed: int
    ) -> list[Gradient]:
        """The gradients at some designs; trial i depends on (seed, i) alone."""

    def reaching(self, factor: float) -> Estimator:
        """The estimator that looks that many times as far around a design; unless it says
        otherwise it looks at no other design, and is the same."""
        return self


def gradient_from(
    surrogate: Surrogate,
    parts: Float[np.ndarray, "runs numbers"],
    influences: Float[np.ndarray, "runs numbers trials"],
    *,
    trials: int,
    seconds: float,
    invalid: int,
) -> Gradient:
    """From each direction's logarithm and its derivatives, and what each trial adds to them."""
    weights = surrogate.weigh(parts[:, 0])
    estimate, influence = weights @ parts, np.einsum("d,dpn->pn", weights, influences)
    count = influence.shape[1]
    covariance = influence @ influence.T / (count * (count - 1))
    parts_se = np.sqrt((influences**2).sum(axis=-1) / (count * (count - 1)))
    return Gradient(
        float(surrogate.combined(parts[:, 0])),
        math.sqrt(covariance[0, 0]),
        estimate[1:],
        covariance[1:, 1:],
        parts[:, 1:],
        parts_se[:, 1:],
        _largest_share(influence[1:]),
        trials,
        seconds,
        invalid,
    )


def _largest_share(influence: Float[np.ndarray, "components trials"]) -> float:
    """The largest trial's share of the squared deviations, in the worst component."""
    squares = influence**2
    totals = squares.sum(axis=1)
    return float(np.max(squares.max(axis=1) / np.where(totals > 0, totals, 1.0)))
