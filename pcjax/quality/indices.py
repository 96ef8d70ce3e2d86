"""What the outcomes are worth: index 1, index 2 and the score with intervals (Sec. 3.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Integer
from scipy.special import ndtri, stdtrit

_Z95 = float(ndtri(0.975))


@dataclass(frozen=True)
class Estimate:
    """An estimate with its standard error and 95 % interval.

    `value` is NaN where the quantity is undefined, and `low`, `high` are then NaN too.

    Examples:
        >>> import numpy as np
        >>> from pcjax.quality.indices import index2
        >>> share = index2(np.array([True, False, False, False]))
        >>> print(f"{share.value} [{share.low:.2f}, {share.high:.2f}]")
        0.25 [0.05, 0.70]
    """

    value: float
    se: float
    low: float
    high: float


UNDEFINED = Estimate(math.nan, math.nan, math.nan, math.nan)


def index1(steps: Integer[np.ndarray, " trials"]) -> Estimate:
    """Index 1: mean of min(escape step, limit), the restricted mean survival time.

    Every trial is followed to the limit, so the sample mean is the exact estimator. Interval:
    Student's t.

    Arguments:
        steps: escape steps, those of trials that never escape replaced by the limit.
    """
    return _mean(steps.astype(float))


def index2(stayed: Bool[np.ndarray, " trials"]) -> Estimate:
    """Index 2: share of trials that reach the limit. Interval: Wilson."""
    n = len(stayed)
    share = float(np.mean(stayed))
    spread = _Z95**2 / n
    middle = (share + spread / 2) / (1 + spread)
    reach = math.sqrt(spread * (share * (1 - share) + spread / 4)) / (1 + spread)
    low = 0.0 if share == 0 else middle - reach
    high = 1.0 if share == 1 else middle + reach
    return Estimate(share, math.sqrt(share * (1 - share) / n), low, high)


def ratio(does: Float[np.ndarray, " trials"], eoen: Float[np.ndarray, " trials"]) -> Estimate:
    """A score (18): mean of `does` over mean of `eoen`, trial i of both from the same draws.

    The standard error is the delta method's for paired samples, and the interval is symmetric in
    the logarithm. Undefined where the lower mean is 0; where both never vary the error is 0.
    """
    top, bottom = float(np.mean(does)), float(np.mean(eoen))
    if bottom == 0:
        return UNDEFINED
    value = top / bottom
    if len(does) < 2:
        return Estimate(value, math.nan, math.nan, math.nan)
    residual = (does - value * eoen) / bottom
    se = float(np.std(residual, ddof=1)) / math.sqrt(len(does))
    if value == 0:
        return Estimate(0.0, math.nan, 0.0, math.nan)  # a sample without one event bounds nothing
    factor = math.exp(_Z95 * se / value)
    return Estimate(value, se, value / factor, value * factor)


def _mean(sample: Float[np.ndarray, " trials"]) -> Estimate:
    n, value = len(sample), float(np.mean(sample))
    if n < 2:
        return Estimate(value, math.nan, math.nan, math.nan)
    se = float(np.std(sample, ddof=1)) / math.sqrt(n)
    reach = float(stdtrit(n - 1, 0.975)) * se
    return Estimate(value, se, value - reach, value + reach)


def survival_curve(
    steps: Integer[np.ndarray, " trials"], stayed: Bool[np.ndarray, " trials"]
) -> tuple[Float[np.ndarray, " times"], Float[np.ndarray, " times"]]:
    """Share of trials still held after each escape step, as a right-continuous step function.

    Returns:
        Times in steps, the first one 0, and the share that has not escaped by then.
    """
    times, counts = np.unique(steps[~stayed], return_counts=True)
    left = 1.0 - np.cumsum(counts) / len(steps)
    return np.concatenate([[0.0], times]), np.concatenate([[1.0], left])
