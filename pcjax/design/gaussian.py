"""A Gaussian process: what noisy values at some designs say about the values at all others.

Matern's kernel of smoothness 5/2 with a length for each parameter, about an unknown mean. The noise
is given, as a covariance: values that come from the same trials err together, so that differences
between neighbours, and with them derivatives, are known far better than the values are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Points = Float[np.ndarray, "points parameters"]
Matrix = Float[np.ndarray, "points others"]
Numbers = Float[np.ndarray, " points"]

_MEAN = 10.0
"""Variance of the mean, in variances of the process."""

_JITTER = 1e-8
_MISFIT = 0.02
"""Added to the diagonals, in variances of the process and of the noise, whose covariance is an
estimate as well."""


@dataclass(frozen=True)
class Kernel:
    """How values at two designs vary together.

    Attributes:
        log_scale: logarithm of the process' standard deviation.
        log_lengths: logarithms of the lengths over which it varies, of each parameter.
    """

    log_scale: float
    log_lengths: Float[np.ndarray, " parameters"]

    @classmethod
    def usual(cls, values: Numbers, parameters: int) -> Kernel:
        """To begin a fit with."""
        return cls(math.log(float(np.std(values)) + 1e-6), np.full(parameters, math.log(0.5)))

    def __call__(self, one: Points, other: Points) -> Matrix:
        """The covariance of all pairs."""
        distance = _distances(one, other, np.exp(self.log_lengths))
        return math.exp(2 * self.log_scale) * (_matern(distance) + _MEAN)


def _distances(one: Points, other: Points, lengths: Float[np.ndarray, " parameters"]) -> Matrix:
    a, b = one / lengths, other / lengths
    squares = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    return np.sqrt(np.maximum(5 * squares, 0.0))


def _matern(distance: Matrix) -> Matrix:
    return (1 + distance + distance**2 / 3) * np.exp(-distance)


class GaussianProcess:
    """A process that has been seen at some designs.

    Arguments:
        at: the designs, parameters from 0 to 1.
        values: what was seen.
        noise: its covariance.
        kernel: see `fitted`.
    """

    def __init__(self, at: Points, values: Numbers, noise: Matrix, kernel: Kernel) -> None:
        self.kernel, self._at = kernel, at
        self._middle = float(np.mean(values))
        self._factor = _factor(kernel(at, at), noise, kernel)
        self._weights = _solve(self._factor, values - self._middle)

    def mean(self, designs: Points) -> Numbers:
        """What to expect."""
        return self._middle + self.kernel(designs, self._at) @ self._weights

    def joint(self, designs: Points) -> tuple[Numbers, Matrix]:
        """What to expect, and its covariance."""
        from scipy.linalg import solve_triangular

        cross = self.kernel(designs, self._at)
        known = solve_triangular(self._factor, cross.T, lower=True, check_finite=False)
        covariance = self.kernel(designs, designs) - known.T @ known
        return self._middle + cross @ self._weights, covariance


def _factor(covariance: Matrix, noise: Matrix, kernel: Kernel) -> Matrix:
    from scipy.linalg import cholesky

    total = covariance + noise
    spread = _JITTER * math.exp(2 * kernel.log_scale) + _MISFIT * np.diag(noise)
    total[np.diag_indices_from(total)] += spread
    return cholesky(total, lower=True, overwrite_a=True, check_finite=False)


def _solve(factor: Matrix, right: np.ndarray) -> np.ndarray:
    from scipy.linalg import cho_solve

    return cho_solve((factor, True), right, check_finite=False)


def fitted(
    at: Points, values: Numbers, noise: Matrix, begin: Kernel | None = None, rounds: int = 40
) -> Kernel:
    """The kernel that makes what was seen likeliest.

    Weighed by a wide prior for the lengths, which grows with the number of parameters (Hvarfner,
    Hellsten and Nardi 2024), so that a parameter that does nothing gets a great length.

    Arguments:
        at, values, noise: see `GaussianProcess`.
        begin: where to begin.
        rounds: of the search at most.
    """
    from scipy.optimize import minimize

    parameters = at.shape[1]
    centred, usual = values - np.mean(values), Kernel.usual(values, parameters)
    begin = usual if begin is None else begin
    middle, wide = math.sqrt(2) + 0.5 * math.log(parameters), math.sqrt(3)
    squares = (at[:, None] - at[None]) ** 2

    def loss(theta: Numbers) -> tuple[float, Numbers]:
        kernel = Kernel(float(theta[0]), theta[1:])
        lengths = np.exp(2 * kernel.log_lengths)
        distance = np.sqrt(5 * (squares / lengths).sum(axis=-1))
        variance = math.exp(2 * kernel.log_scale)
        covariance = variance * (_matern(distance) + _MEAN)
        try:
            factor = _factor(covariance.copy(), noise, kernel)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros_like(theta)
        weights = _solve(factor, centred)
        inverse = _solve(factor, np.eye(len(at)))
        by_covariance = 0.5 * (inverse - np.outer(weights, weights))
        # d matern / d log length = (5 / 3) (1 + distance) exp(-distance) squares / length^2
        slope = by_covariance * (5 / 3 * variance * (1 + distance) * np.exp(-distance))
        by_lengths = np.einsum("ij,ijk->k", slope, squares) / lengths
        by_scale = 2 * np.sum(by_covariance * covariance)
        off = (kernel.log_lengths - middle) / wide
        far = (kernel.log_scale - usual.log_scale) / 2.0
        value = 0.5 * centred @ weights + np.log(np.diag(factor)).sum()
        return (
            float(value + 0.5 * off @ off + 0.5 * far**2),
            np.concatenate([[by_scale + far / 2.0], by_lengths + off / wide]),
        )

    bounds = [(usual.log_scale - 6, usual.log_scale + 6)] + [(math.log(0.02), 6.0)] * parameters
    at_first = np.concatenate([[begin.log_scale], begin.log_lengths])
    found = minimize(
        loss, at_first, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": rounds}
    )
    return Kernel(float(found.x[0]), found.x[1:])
