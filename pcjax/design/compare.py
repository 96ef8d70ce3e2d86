"""Exact scores of designs, compared on the same trials."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from pcjax.design.space import Design, Space
from pcjax.model.scenario import Scenario
from pcjax.physics.state import PAPER_DT
from pcjax.quality.indices import UNDEFINED, Estimate, extremes
from pcjax.quality.surrogate import Sample, Surrogate
from pcjax.quality.task import Hand

_BATCH = 64
"""Designs that run together."""


@dataclass(frozen=True)
class Comparison:
    """Exact scores of some designs, all on the same trials.

    Attributes:
        scores: of each design; the ratio DoEs / EoEn, or DoEs alone where there is no EoEn;
            undefined where the trials cannot tell (see `Surrogate.known`).
        logs: their logarithms, finite even where a score is undefined (see `Surrogate.judge`).
        covariance: of the logarithms.
        trials: of each design and direction.
        sample: what the trials gave.
        surrogate: what they are scored by.
    """

    scores: list[Estimate]
    logs: Float[np.ndarray, " designs"]
    covariance: Float[np.ndarray, "designs designs"]
    trials: int
    sample: Sample
    surrogate: Surrogate

    @property
    def invalid(self) -> int:
        """The most trials of one design that went wrong; they are left out everywhere."""
        return self.sample.invalid

    def of(self, task: int) -> Comparison:
        """The same of one of the surrogate's tasks alone."""
        count, every = len(self.surrogate.task.directions), self.surrogate.task.each
        mine = self.sample.values[:, task * count : (task + 1) * count]
        alone = replace(self.surrogate, task=every[task])
        return comparison_of(alone, replace(self.sample, values=mine))

    def of_run(self, run: int) -> Comparison:
        """How well the hands hold in one direction of one task."""
        count = len(self.surrogate.task.directions)
        alone = replace(
            self.surrogate,
            task=replace(self.surrogate.task.each[run // count], directions=("does",)),
        )
        return comparison_of(
            alone, replace(self.sample, values=self.sample.values[:, run : run + 1])
        )

    @property
    def best(self) -> int:
        """Which design has the highest score."""
        return int(np.argmax(self.logs))

    def improvement(self, start: int, end: int) -> Estimate:
        """How much higher the score of design `end` is than that of `start`; undefined where one of
        them is."""
        if math.isnan(self.scores[start].value + self.scores[end].value):
            return UNDEFINED
        values = np.array([self.scores[k].value for k in (start, end)])
        jacobian = np.array([-values[0], values[1]])
        pair = np.ix_([start, end], [start, end])
        se = math.sqrt(max(float(jacobian @ self.covariance[pair] @ jacobian), 0.0))
        value = float(values[1] - values[0])
        if self.surrogate.task.worst:
            low, high = self._worst_gain(start, end)
            return Estimate(value, se, min(low, value), max(high, value))

        def gain(logs: Float[np.ndarray, "2"]) -> tuple[float, Float[np.ndarray, "2"]]:
            scores = np.exp(logs)
            return float(scores[1] - scores[0]), scores * [-1.0, 1.0]

        low, high = _bounds(self.surrogate, self.sample, [start, end], gain)
        return Estimate(value, se, min(low, value), max(high, value))

    def _worst_gain(self, start: int, end: int) -> tuple[float, float]:
        """95 % bounds of the gain of the worst score: it is at least the gain in the condition that
        is the worst at the end, and at most that in the one that is the worst at the start."""
        alone = [self.of(k) for k in range(len(self.surrogate.task.each))]
        gains = [one.improvement(start, end) for one in alone]
        first, last = (_may_be_worst([one.scores[k] for one in alone]) for k in (start, end))
        return min(gains[k].low for k in last), max(gains[k].high for k in first)


def _may_be_worst(scores: Sequence[Estimate]) -> list[int]:
    """Which of several conditions may be the one with the lowest score, by their intervals."""
    least = min(score.high for score in scores)
    return [k for k, score in enumerate(scores) if score.low <= least]


def _bounds(
    surrogate: Surrogate,
    sample: Sample,
    designs: list[int],
    of: Callable[[Float[np.ndarray, " n"]], tuple[float, Float[np.ndarray, " n"]]],
) -> tuple[float, float]:
    """95 % bounds of a function of some designs' log scores, `of`, that gives its slopes, too."""
    values = sample.values[designs][..., sample.valid]
    shape = values.shape[:-1]

    def judge(means: Float[np.ndarray, " k"]) -> tuple[float, Float[np.ndarray, " k"]]:
        each, slopes = surrogate.judge(means.reshape(shape))
        value, weights = of(np.asarray(surrogate.combined(each)))
        weighted = weights[:, None, None] * surrogate.weigh(each)[..., None] * slopes
        return value, weighted.ravel()

    most = np.broadcast_to([surrogate.task.max_steps * PAPER_DT, 1.0], shape).ravel()
    found = extremes(
        values.reshape(len(most), -1),
        np.stack([0 * most, most]),
        lambda m: judge(m)[1],
        int(np.sum(~sample.valid)),
    )
    low, high = (judge(means)[0] for means in found)
    return low, high


def compare(
    surrogate: Surrogate,
    space: Space,
    designs: Sequence[Design],
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
    surrogate: Surrogate, hands: Sequence[Hand], *, trials: int, seed: int
) -> Comparison:
    """`compare`, of hands that need not be designs of one space."""
    exact = replace(surrogate, form="exact", trials=trials)
    return comparison_of(exact, exact.sample(hands, seed))


def comparison_of(exact: Surrogate, sample: Sample) -> Comparison:
    """What a sample says of its hands."""
    each, influences = exact.appraise(sample)
    logs = np.asarray(exact.combined(each))
    influence = np.einsum("vd,dvn->vn", exact.weigh(each), influences)
    count = influence.shape[1]
    covariance = influence @ influence.T / (count * (count - 1))
    errors = np.sqrt(np.diag(covariance))
    scores, means = [], sample.means()
    for k, error in enumerate(errors):
        if not exact.known(means[k]):
            scores.append(UNDEFINED)
            continue
        value = math.exp(float(exact.combined(exact.judge(means[k : k + 1])[0])[0]))
        low, high = value, value
        if not exact.task.worst:
            low, high = _bounds(exact, sample, [k], lambda one: (math.exp(one[0]), np.ones(1)))
        scores.append(Estimate(value, value * error, min(low, value), max(high, value)))
    found = Comparison(scores, logs, covariance, exact.trials, sample, exact)
    return _with_worst_bounds(found) if exact.task.worst else found


def _with_worst_bounds(found: Comparison) -> Comparison:
    """With intervals that know of every condition that may be the worst, not of the one that came
    out so."""
    alone = [found.of(k) for k in range(len(found.surrogate.task.each))]
    scores = []
    for k, score in enumerate(found.scores):
        each = [one.scores[k] for one in alone]
        if not math.isnan(score.value):
            low = min(one.low for one in each)
            high = max(each[j].high for j in _may_be_worst(each))
            score = replace(score, low=min(low, score.value), high=max(high, score.value))
        scores.append(score)
    return replace(found, scores=scores)


def score_all(
    surrogate: Surrogate,
    each: list[list[Scenario]],
    *,
    seed: int,
    on_done: Callable[[int], Any] = lambda count: None,
) -> tuple[list[Estimate], int]:
    """The exact scores of any number of hands, `surrogate.trials` each.

    Arguments:
        surrogate: whose objective, directions and limit count.
        each: the scenarios of each hand, as `Task.scenarios` gives them.
        seed: trial i is the same experiment for every hand.
        on_done: told how many more are done.

    Returns:
        The scores, and how many trials went wrong and were left out.
    """
    exact = replace(surrogate, form="exact")
    scores: list[Estimate] = []
    invalid = 0
    for first in range(0, len(each), _BATCH):
        sample = exact.sample_scenarios(each[first : first + _BATCH], seed)
        scores += comparison_of(exact, sample).scores
        invalid += sample.invalid
        on_done(min(_BATCH, len(each) - first))
    return scores, invalid
