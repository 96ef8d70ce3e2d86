"""What the outcomes are worth: index 1, index 2 and the score with intervals (Sec. 3.1).

All that is estimated is a mean of numbers that lie between known ends, or a function of such means,
and all intervals come from one bound, `extremes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from jaxtyping import Bool, Float, Integer

_Z95 = NormalDist().inv_cdf(0.975)

_ROUNDS = 50
"""Slopes that are tried at most; a score takes about 5."""


@dataclass(frozen=True)
class Estimate:
    """An estimate with its standard error and 95 % interval.

    `value` is NaN where the quantity is undefined, and `low`, `high` are then NaN too.

    Examples:
        >>> import numpy as np
        >>> from pcjax.quality.indices import index2
        >>> share = index2(np.array([True, False, False, False]))
        >>> print(f"{share.value} [{share.low:.2f}, {share.high:.2f}]")
        0.25 [0.01, 0.81]
    """

    value: float
    se: float
    low: float
    high: float


UNDEFINED = Estimate(math.nan, math.nan, math.nan, math.nan)


def index1(
    steps: Integer[np.ndarray, " trials"], limit: int, *, certain: bool = False, lost: int = 0
) -> Estimate:
    """Index 1: mean of min(escape step, limit), the restricted mean survival time.

    Every trial is followed to the limit, so the sample mean is the exact estimator.

    Arguments:
        steps: escape steps, those of trials that never escape replaced by the limit.
        limit: the step limit.
        certain: whether it is known that nothing can escape, so that no trial could be less.
        lost: how many trials went wrong and are not in the sample (see `extremes`).
    """
    return mean(steps.astype(float), limit if certain else 0, limit, lost=lost)


def index2(
    stayed: Bool[np.ndarray, " trials"], *, certain: bool = False, lost: int = 0
) -> Estimate:
    """Index 2: share of trials that reach the limit, `certain` and `lost` as for `index1`."""
    share = float(np.mean(stayed))
    se = math.sqrt(share * (1 - share) / len(stayed))
    bounds = mean(stayed.astype(float), float(certain), 1, lost=lost)
    return Estimate(share, se, bounds.low, bounds.high)


def mean(
    sample: Float[np.ndarray, " trials"], least: float, most: float, *, lost: int = 0
) -> Estimate:
    """The mean of something that is never under `least` nor over `most`, `lost` of it unknown."""
    n, value = len(sample), float(np.mean(sample))
    se = float(np.std(sample, ddof=1)) / math.sqrt(n) if n > 1 else math.nan
    ends = np.array([[least], [most]], float)
    low, high = (float(m[0]) for m in extremes(sample[None], ends, np.ones_like, lost))
    return Estimate(value, se, min(low, value), max(high, value))


def ratio(
    does: Float[np.ndarray, " trials"],
    eoen: Float[np.ndarray, " trials"],
    most: float,
    *,
    certain: tuple[bool, bool] = (False, False),
    lost: int = 0,
) -> Estimate:
    """A score (18): mean of `does` over mean of `eoen`, trial i of both from the same draws.

    The standard error is the delta method's for paired samples. Undefined where the lower mean
    is 0.

    Arguments:
        does, eoen: numbers from 0 to `most`.
        certain: whether it is known of each that it is `most` always.
        lost: how many pairs went wrong and are not in the sample (see `extremes`).
    """
    top, bottom = float(np.mean(does)), float(np.mean(eoen))
    if bottom == 0:
        return UNDEFINED
    value, n = top / bottom, len(does)
    residual = (does - value * eoen) / bottom
    se = float(np.std(residual, ddof=1)) / math.sqrt(n) if n > 1 else math.nan
    least = np.where(certain, most, 0.0)
    low, high = (
        float(m[0] / m[1])
        for m in extremes(
            np.stack([does, eoen]),
            np.stack([least, np.full(2, most)]),
            lambda m: np.array([1.0, -m[0] / m[1]]),
            lost,
        )
    )
    return Estimate(value, se, min(low, value), max(high, value))


def ratio_difference(
    one: Float[np.ndarray, "2 trials"],
    other: Float[np.ndarray, "2 trials"],
    most: float,
    *,
    certain: tuple[bool, bool, bool, bool] = (False, False, False, False),
    lost: int = 0,
) -> Estimate:
    """How much higher one ratio of means is than another one, of the same trials.

    The standard error is the delta method's. Undefined where a lower mean is 0.

    Arguments:
        one, other: DoEs' numbers and EoEn's, from 0 to `most`.
        certain: whether it is known of each of the four that it is `most` always.
        lost: how many trials went wrong and are not in the samples (see `extremes`).
    """
    means = np.concatenate([one.mean(axis=1), other.mean(axis=1)])
    if means[1] == 0 or means[3] == 0:
        return UNDEFINED

    def slopes(m: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
        return np.array([1 / m[1], -m[0] / m[1] ** 2, -1 / m[3], m[2] / m[3] ** 2])

    def value(m: Float[np.ndarray, "4"]) -> float:
        return float(m[0] / m[1] - m[2] / m[3])

    samples = np.concatenate([one, other])
    n = samples.shape[1]
    influence = slopes(means) @ samples
    se = float(np.std(influence, ddof=1)) / math.sqrt(n) if n > 1 else math.nan
    ends = np.stack([np.where(certain, most, 0.0), np.full(4, most)])
    low, high = (value(m) for m in extremes(samples, ends, slopes, lost))
    found = value(means)
    return Estimate(found, se, min(low, found), max(high, found))


def extremes(
    values: Float[np.ndarray, "k trials"],
    ends: Float[np.ndarray, "2 k"],
    slopes: Callable[[Float[np.ndarray, " k"]], Float[np.ndarray, " k"]],
    lost: int = 0,
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """The means at which a function of them is lowest and highest, within 95 % confidence.

    For a mean, the function itself, this is the bound of Gaffke (2005) and of Learned-Miller and
    Thomas (arXiv 1905.06208): one trial more is thought of, as far out as one can be, and the
    bound is the 97.5 % quantile of the mean under weights that are uniform on the simplex. No
    distribution between the ends is known for which it fails, however few the trials; for a share
    it is the interval of Clopper and Pearson, and for many trials the normal one. The quantile is
    a saddlepoint's, within 1 % of the exact one.

    A trial that went wrong could have ended anywhere, and why it did may have to do with how it
    would have ended. So it counts as far out as it can be, too.

    For another function, its slope at the means so found says what to bound next, until it stays
    (for a ratio this is Dinkelbach's method).

    Arguments:
        values: of each trial.
        ends: the least and the most that each value can be.
        slopes: derivatives of the function by the means, up to a positive factor.
        lost: how many trials went wrong and are not among the values.

    Returns:
        The means where the function is lowest, and where it is highest.
    """
    count = values.shape[1]
    middle = (values.sum(axis=1) + ends.sum(axis=0)) / (count + 2)  # within the ends for certain
    found = []
    for sign in (-1.0, 1.0):
        means, before = middle, np.zeros(len(values))
        for _ in range(_ROUNDS):
            slope = sign * slopes(means)
            if np.abs(slope - before).max() <= 1e-6 * np.abs(slope).max():
                break  # the bounds are then known to about as much
            corner = np.where(slope > 0, ends[1], ends[0])
            distance = np.append(slope @ (corner[:, None] - values), np.zeros(1 + lost))
            weights = _weights(distance)
            # Not beyond the ends by rounding.
            means = values @ weights[:count] + corner * weights[count:].sum()
            means = np.clip(means, *ends)
            before = slope
        found.append(means)
    return found[0], found[1]


def _weights(distance: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Weights under which the mean distance is the 2.5 % quantile of what it is under weights
    that are uniform on the simplex.

    The weights are exponential variables over their sum, so P(mean < m) = P(sum of E_i (d_i - m)
    < 0), whose saddlepoint has weights in proportion to 1 / (g + d_i); the tail is Lugannani and
    Rice's, in the form of Barndorff-Nielsen.
    """
    from scipy.optimize import root_scalar

    count, farthest = len(distance), float(distance.max())
    if farthest <= 0:
        return np.full(count, 1 / count)
    distance = np.maximum(distance / farthest, 0.0)

    def excess(log_g: float) -> float:
        each = 1 / (math.exp(log_g) + distance)
        mean = float(each.mean())
        w = math.sqrt(2 * (count * math.log(mean) - float(np.log(each).sum())))
        u = math.sqrt(float(each @ each) / mean**2 - count)
        return w + math.log(u / w) / w - _Z95

    # Here it is negative for certain: w^2 <= 2 n var / g^2.
    most = math.log(2 * math.sqrt(count) * float(distance.std()))
    least = most - 2
    while excess(least) < 0:
        least -= 2
    g = math.exp(root_scalar(excess, bracket=(least, most), xtol=1e-9).root)
    each = 1 / (g + distance)
    return each / each.sum()


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
