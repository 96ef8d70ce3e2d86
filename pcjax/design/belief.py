"""What a search has seen, and what it believes of all other designs.

Each run's logarithm is a Gaussian process of its own: how hard it is to escape and how easy
to enter vary over different lengths, and the score is the difference of the two. Designs that were
tried together shared their trials, so the noise of each batch is known with its correlations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from pcjax.design.gaussian import GaussianProcess, Kernel, Matrix, Numbers, Points, fitted
from pcjax.quality.surrogate import Surrogate

_GROWTH = 1.2
"""How many times as many designs have to be known before kernels are fitted anew."""


@dataclass(frozen=True)
class Batch:
    """Designs that were tried together.

    Attributes:
        at: the designs, parameters from 0 to 1.
        logs: of each run (a task in one direction) the logarithm of how well they hold.
        noise: its covariance, for each run.
        trials: of each.
    """

    at: Points
    logs: Float[np.ndarray, "points runs"]
    noise: Float[np.ndarray, "runs points points"]
    trials: int

    def plain(self) -> dict[str, Any]:
        """As lists, for a file."""
        return {name: np.asarray(value).tolist() for name, value in vars(self).items()}

    @classmethod
    def of(cls, kept: dict[str, Any]) -> Batch:
        """From `plain`."""
        at, logs, noise = (np.array(kept[name], float) for name in ("at", "logs", "noise"))
        return cls(at, logs, noise, int(kept["trials"]))


@dataclass
class Belief:
    """What is believed after some batches.

    Attributes:
        surrogate: says how runs make a score.
        batches: what was seen.
        kernels: of each run; fitted when enough has been seen since.
        fitted_at: how many designs were known then.
    """

    surrogate: Surrogate
    batches: list[Batch] = field(default_factory=list)
    kernels: list[Kernel] = field(default_factory=list)
    fitted_at: int = 0
    _processes: list[GaussianProcess] = field(default_factory=list)

    @property
    def at(self) -> Points:
        """All designs that were seen."""
        return np.concatenate([batch.at for batch in self.batches])

    def learn(self, batch: Batch) -> None:
        """Takes one more batch; where that is interrupted, none of it."""
        batches = [*self.batches, batch]
        at, logs = (np.concatenate([getattr(b, name) for b in batches]) for name in ("at", "logs"))
        kernels, fitted_at, processes = self.kernels, self.fitted_at, self._processes
        # At first nothing is expected of any design: with noise that is alike for all, before it is
        # by what is expected.
        for _ in range(1 if processes else 2):
            expected = [process.mean(at) for process in processes]
            noises = _noises(batches, expected or [np.zeros(len(at))] * logs.shape[1])
            if not expected or len(at) >= _GROWTH * fitted_at:
                kernels = [
                    fitted(at, values, noise, kernel)
                    for values, noise, kernel in zip(
                        logs.T, noises, kernels or [None] * len(noises), strict=True
                    )
                ]
                fitted_at = len(at) if expected else 0
            processes = [
                GaussianProcess(at, values, noise, kernel)
                for values, noise, kernel in zip(logs.T, noises, kernels, strict=True)
            ]
        self.batches, self.kernels = batches, kernels
        self.fitted_at, self._processes = fitted_at, processes

    def mean(self, at: Points) -> Float[np.ndarray, " points"]:
        """The logarithm of the score to expect."""
        return np.asarray(self.surrogate.combined(self.each_mean(at)))

    def draws(
        self, at: Points, count: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "points draws"]:
        """The score's logarithms at designs, drawn from what is believed."""
        return np.asarray(self.surrogate.combined(self.each_draws(at, count, rng)))

    def each_mean(self, at: Points) -> Float[np.ndarray, "points runs"]:
        """The logarithm of each run to expect."""
        return np.stack([process.mean(at) for process in self._processes], axis=-1)

    def each_draws(
        self, at: Points, count: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "points draws runs"]:
        """The runs' logarithms at designs, drawn from what is believed."""
        each = []
        for process in self._processes:
            mean, covariance = process.joint(at)
            # Where all is known well, the prior cancels but for rounding, and some eigenvalues are
            # negative: too far for a Cholesky factor.
            sizes, ways = np.linalg.eigh(covariance)
            root = ways * np.sqrt(np.maximum(sizes, 0.0))
            each.append(mean[:, None] + root @ rng.standard_normal((len(at), count)))
        return np.stack(each, axis=-1)

    @property
    def lengths(self) -> Float[np.ndarray, " parameters"]:
        """How far each parameter goes before the runs' logarithms change."""
        return np.exp(np.mean([kernel.log_lengths for kernel in self.kernels], axis=0))


def _noises(batches: Sequence[Batch], expected: Sequence[Numbers]) -> list[Matrix]:
    """The noise of all batches, for each run."""
    trials = np.concatenate([np.full(len(b.at), b.trials) for b in batches])
    return [
        _smoothed([b.noise[k] for b in batches], values, trials)
        for k, values in enumerate(expected)
    ]


def _smoothed(
    blocks: Sequence[Float[np.ndarray, "points points"]],
    expected: Float[np.ndarray, " all"],
    trials: Float[np.ndarray, " all"],
) -> Float[np.ndarray, "all all"]:
    """The noise of all batches, with variances that go by what is expected of a design.

    A sample whose mean came out low has a low variance, too: weighed by its own one it would count
    for more, and draw what is believed down.
    """
    from scipy.linalg import block_diag

    noise = np.asarray(block_diag(*blocks))
    errors = np.sqrt(np.diag(noise))
    each, off = np.log(errors**2 * trials), expected - expected.mean()
    degree = 0 if np.ptp(off) == 0 else 1 if len(each) < 30 else 2
    line = np.polyval(np.polyfit(off, each, degree), off)
    smooth = np.sqrt(np.exp(np.clip(line, each.min(), each.max())) / trials)
    return noise * np.outer(smooth / errors, smooth / errors)
