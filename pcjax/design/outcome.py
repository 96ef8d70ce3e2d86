"""How to search, what a search found, and how that is accepted: on exact scores, on trials that the
search has not seen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pcjax.checks import check_between, check_count
from pcjax.design.checkpoint import Progress
from pcjax.design.compare import Comparison, compare, compare_hands
from pcjax.design.space import Design, Space
from pcjax.design.starts import Start
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Hand
from pcjax.results.tables import estimate_text, in_columns, interval_text, wrapped
from pcjax.showing import Shown

METHODS = ("model", "gradient", "grid", "cma")
"""Ways to look for a better hand; see `pcjax.design.optimize.optimize`."""

CHECKPOINT, _CHOICE, _ACCEPTANCE = 0x10000000, 0x20000000, 0x30000000
"""Added to the seed for exact checkpoints, the choice among designs, and the acceptance."""

_DRAWS = 10_000
"""Of the scores' errors, for how sure it is which design is the best."""


@dataclass(frozen=True)
class Settings:
    """How to optimise.

    Arguments:
        method: one of `METHODS`.
        iterations: at most; a method's own unless given.
        gain: the model's search ends where it expects less, as a share of the score.
        starts: of gradients; the first from the given hand, the others spread over the space.
        rate: of gradients, in the parameters' scales (10 degrees, 0.1 L_p) an iteration; in the
            second half of the iterations it falls to 0 along a cosine.
        wide: factor on the reach of differences at the beginning; it falls to 1 in the first half.
            Far from the top a wide look is surer of the direction, and its bias does no harm.
        check_every: iterations of gradients between exact checkpoints.
        check_trials: trials of each.
        accept_trials: trials of the final comparison.
        seed: of everything.

    Raises:
        ValueError: an unknown method, or a number out of range.
    """

    method: str = "model"
    iterations: int | None = None
    gain: float = 2e-3
    starts: int = 1
    rate: float = 0.4
    wide: float = 4.0
    check_every: int = 6
    check_trials: int = 1000
    accept_trials: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method is {self.method!r}: it has to be one of {', '.join(METHODS)}")
        if self.iterations is not None:
            check_count("iterations", self.iterations, 1, 100_000)
        check_between("gain", self.gain, 0.0, 1.0)
        check_count("starts", self.starts, 1, 1000)
        check_between("rate", self.rate, 1e-6, 10.0)
        check_between("wide", self.wide, 1.0, 10.0)
        check_count("check_every", self.check_every, 1, 100_000)
        check_count("check_trials", self.check_trials, 2, 2**24)
        check_count("accept_trials", self.accept_trials, 2, 2**24)
        check_count("seed", self.seed, 0, 2**28 - 1)


@dataclass(frozen=True)
class Candidate:
    """A design that a search ended with.

    Attributes:
        design: it.
        score: exact, on the trials of the acceptance.
        behind: by how much the best one's is higher, on the same trials.
    """

    design: Design
    score: Estimate
    behind: Estimate


@dataclass(frozen=True)
class Part:
    """One of several tasks.

    Attributes:
        start, best: the exact scores in it alone, on the trials of the acceptance.
        improvement: of the score.
    """

    start: Estimate
    best: Estimate
    improvement: Estimate


@dataclass(frozen=True)
class Optimum(Shown):
    """What an optimisation found; prints as a table, without the names of the parameters, which
    only the space knows.

    Attributes:
        start: the given hand's design, even if it is not an allowed one; where that hand cannot be
            evaluated, the design that the search began at.
        best: the best design.
        start_score, best_score: exact, on trials that nothing else has used.
        improvement: of the exact score, from the same trials for both.
        candidates: where the search ended: for gradients each start's end, for the model the best
            of each basin.
        parts: where there are several tasks, the scores in each.
        certainty: how sure it is, from 0 to 1, that the best is the best of these.
        progress: the whole history.
        trials: simulated in all.
        invalid: how many of them went wrong, and were left out.
        interrupted: whether it was stopped before its end.
        start_hand: the hand of `start`.
        moved: whether `start` is not the given hand's.
        notes: what is wrong with the given hand, a line each.
        tried: all designs that a model has seen; none for the other methods.
        refused: how many designs were looked at in vain, by what is wrong with them, where the
            space counts them.
    """

    drawn_by = "view.designs.plot_history"

    start: Design
    best: Design
    start_score: Estimate
    best_score: Estimate
    improvement: Estimate
    candidates: list[Candidate]
    parts: list[Part]
    certainty: float
    progress: Progress
    trials: int
    invalid: int
    interrupted: bool
    start_hand: Hand
    moved: bool
    notes: tuple[str, ...]
    tried: Sequence[Design] = ()
    refused: Mapping[str, int] = field(default_factory=dict)

    @property
    def better(self) -> bool:
        """Whether the result is better than the start for certain (95 %)."""
        return self.improvement.low > 0

    @property
    def verdict(self) -> str:
        """Whether the result is better than the start, in words."""
        if math.isnan(self.improvement.value):
            return "it cannot be known"
        if self.improvement.high < 0:
            return "worse"
        return "better" if self.better else "not better for certain"

    def __repr__(self) -> str:
        names = [f"parameter {k}" for k in range(1, 1 + len(self.best))]
        spent = f"{self.trials:,} trials"
        notes = [*self.notes, *refused_text(self.refused), spent]
        return "\n".join([self.table(names, "score"), *map(wrapped, notes)])

    def table(self, names: Sequence[str], what: str) -> str:
        """Start and best with their scores, and how they compare.

        Arguments:
            names: of the parameters, with their units.
            what: the score is called.
        """
        start = "moved start" if self.moved else "start"
        rows = [
            [name, f"{a:.4g}", f"{b:.4g}"]
            for name, a, b in zip(names, self.start, self.best, strict=True)
        ]
        lines = [
            f"{what}, {name}: {estimate_text(score, ',.4f')} {interval_text(score, ',.4f')}"
            for name, score in ((start, self.start_score), ("best", self.best_score))
        ]
        gain = self.improvement
        if math.isnan(gain.value):
            lines.append(
                "a score is undefined where no trial at all escapes, or none is held to the limit "
                "from outside: take more trials, another limit, or objective index1"
            )
        lines.append(
            f"improvement: {estimate_text(gain, ',.4f')} {interval_text(gain, ',.4f')}: "
            f"{self.verdict} (exact, unseen trials, the same for both; 95 % interval)"
        )
        return "\n".join([in_columns(["", start, "best"], rows, left=[0]), *map(wrapped, lines)])


def refused_text(refused: Mapping[str, int]) -> list[str]:
    """How many designs were looked at in vain, and why: a line, or none."""
    if not refused:
        return []
    count = sum(refused.values())
    reasons = ", ".join(f"{why} ({number:,})" for why, number in refused.items())
    return [f"{count:,} {'design' if count == 1 else 'designs'} refused: {reasons}"]


def accept(
    ends: Sequence[Sequence[Design]],
    state: Progress,
    start: Start,
    surrogate: Surrogate,
    space: Space,
    settings: Settings,
    *,
    interrupted: bool = False,
    tried: Sequence[Design] = (),
) -> Optimum:
    """Chooses among the ends and compares all of them and the start, on trials of their own.

    Arguments:
        ends: where the search ended; of each the designs to choose from.
        state, start, surrogate, space, settings, interrupted, tried: of the search.
    """
    designs, best, spent, invalid = [end[0] for end in ends], 0, 0, 0
    every = [design for end in ends for design in end]
    if len(every) > 1:
        choice = compare(
            surrogate,
            space,
            every,
            trials=max(settings.accept_trials // 4, 2),
            seed=settings.seed + _CHOICE,
        )
        logs, tops = choice.logs.tolist(), []
        for k, end in enumerate(ends):
            mine, logs = logs[: len(end)], logs[len(end) :]
            designs[k] = end[int(np.argmax(mine))]
            tops.append(max(mine))
        best, spent, invalid = int(np.argmax(tops)), len(every) * choice.trials, choice.invalid
    final = compare_hands(
        surrogate,
        [start.hand, *map(space.hand, designs)],
        trials=settings.accept_trials,
        seed=settings.seed + _ACCEPTANCE,
    )
    spent += (1 + len(designs)) * final.trials
    behind = [final.improvement(k, 1 + best) for k in range(1, 1 + len(designs))]
    behind[best] = Estimate(0.0, 0.0, 0.0, 0.0)
    return Optimum(
        start.design,
        designs[best],
        final.scores[0],
        final.scores[1 + best],
        final.improvement(0, 1 + best),
        list(map(Candidate, designs, final.scores[1:], behind)),
        _parts(final, 1 + best),
        _certainty(final, 1 + best),
        state,
        state.trials + spent * surrogate.task.runs,
        state.invalid + invalid + final.invalid,
        interrupted,
        start.hand,
        start.moved,
        start.notes,
        tried,
        space.refused(),
    )


def _parts(final: Comparison, best: int) -> list[Part]:
    """Of each task, where there are several."""
    count = len(final.surrogate.task.each)
    alone = [final.of(k) for k in range(count if count > 1 else 0)]
    return [Part(one.scores[0], one.scores[best], one.improvement(0, best)) for one in alone]


def _certainty(final: Comparison, best: int) -> float:
    """How often a design is the best of all but the first, within the errors of their scores."""
    logs, covariance = final.logs[1:], final.covariance[1:, 1:]
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(logs, covariance, _DRAWS, method="eigh")
    return float(np.mean(drawn[:, best - 1] >= drawn.max(axis=1)))
