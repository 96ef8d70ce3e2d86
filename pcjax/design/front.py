"""Trade-offs: the designs that no other one beats in both of two aims.

The two aims are DoEs and EoEn (hard to escape from, easy to enter), or the scores in two
conditions. The search is that of `pcjax.design.modelled`; what may be the best is judged by another
weighing of the two aims in every draw (Knowles 2006).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from pcjax.checks import check_kind
from pcjax.design.belief import Belief
from pcjax.design.checkpoint import fingerprint_of
from pcjax.design.compare import compare_hands
from pcjax.design.gaussian import Points
from pcjax.design.modelled import BATCH, DRAWS, Search, distinct
from pcjax.design.outcome import Settings
from pcjax.design.space import Design, Space
from pcjax.design.starts import given_start, starting_designs
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate
from pcjax.results.tables import estimate_text, in_columns, wrapped
from pcjax.showing import Shown

_ROUNDS = 24
"""Unless given."""

_MOST = 12
"""Designs of a front at most."""

_UNSEEN = 0x30000000
"""Added to the seed for the trials that the front is compared on."""

_BEND = 0.05
"""Share of the sum of both aims beside the lesser of them, so that none is given away for nothing
(the augmentation of Chebyshev's norm)."""


@dataclass(frozen=True)
class Member:
    """A design of a front.

    Attributes:
        design: its parameters.
        aims: its two values, exact, on trials that the search has not used.
    """

    design: Design
    aims: tuple[Estimate, Estimate]


@dataclass(frozen=True)
class Front(Shown):
    """Designs none of which is beaten by another one in both aims; prints as a table, without the
    names of the parameters, which only the space knows.

    Attributes:
        names: of the aims.
        larger: of each aim whether more of it is better.
        members: the designs, from the least of the first aim to the most.
        start: the given hand, even if it is not an allowed one; where it cannot be evaluated, the
            design that the search began at.
        moved: whether it is the latter.
        undefined: designs left out of the front, as their trials cannot tell one of their aims.
        tried: the values of all designs that the search has tried, as it believes them to be.
        trials: simulated in all.
        invalid: how many of them went wrong, and were left out.
        interrupted: whether the search was stopped before its end.
    """

    drawn_by = "view.front.plot_aims"

    names: tuple[str, str]
    larger: tuple[bool, bool]
    members: list[Member]
    start: Member
    moved: bool
    undefined: int
    tried: Float[np.ndarray, "designs 2"]
    trials: int
    invalid: int
    interrupted: bool

    def __repr__(self) -> str:
        return self.table([f"parameter {k}" for k in range(1, 1 + len(self.start.design))])

    def table(self, names: Sequence[str]) -> str:
        """The designs with their two values.

        Arguments:
            names: of the parameters, with their units.
        """
        rows = [
            [
                name,
                *(f"{x:.4g}" for x in one.design),
                *map(_aim_text, one.aims, self.names),
            ]
            for name, one in [
                *((str(k), one) for k, one in enumerate(self.members, start=1)),
                ("moved start" if self.moved else "start", self.start),
            ]
        ]
        lines = [
            f"{name}: {'more' if larger else 'less'} is better"
            for name, larger in zip(self.names, self.larger, strict=True)
        ]
        if self.undefined:
            lines.append(
                f"{self.undefined} designs are left out, as their trials cannot tell one of the "
                "aims: take more trials, another limit, or objective index1"
            )
        if self.invalid:
            lines.append(f"{self.invalid:,} trials went wrong with some hand, and were left out")
        stop = "interrupted after " if self.interrupted else ""
        lines.append(f"{stop}{self.trials:,} trials")
        table = in_columns(["", *names, *self.names], rows, left=[0])
        return "\n".join([table, *map(wrapped, lines)])


def _aim_text(aim: Estimate, name: str) -> str:
    return estimate_text(aim, ",.0f" if name.endswith("index1") else ",.4f")


@dataclass(frozen=True)
class _FrontSearch(Search):
    """The search for a front, which goes by two aims."""

    def aims(self, each: Float[np.ndarray, "*some runs"]) -> Float[np.ndarray, "*some 2"]:
        """Of each run's logarithm; of either more is better."""
        if not self.surrogate.task.also:
            return each * [1.0, -1.0]
        alone = [replace(self.surrogate, task=task) for task in self.surrogate.task.each]
        runs = each.shape[-1] // 2
        parts = each[..., :runs], each[..., runs:]
        return np.stack([one.combined(part) for one, part in zip(alone, parts, strict=True)], -1)

    def best(self, belief: Belief) -> tuple[Points, float, float]:
        """The middle of the front so far; its value is the mean of both aims."""
        at = belief.at
        aims = self.aims(belief.each_mean(at))
        middle = int(np.argmax(_weighed(aims[:, None], np.array([[0.5, 0.5]]))[:, 0]))
        return at[[middle]], float(aims[middle].mean()), 0.0

    def think(self, belief: Belief, round: int) -> tuple[Points, float]:
        """What to try in a round; it never ends early."""
        rng, seen = np.random.default_rng([self.seed, round]), belief.at
        front = seen[unbeaten(self.aims(belief.each_mean(seen)))]
        places = distinct(self.places(belief, front, front, round, rng))
        drawn = self.aims(belief.each_draws(places, DRAWS, rng))
        share = rng.random(DRAWS)
        values = _weighed(drawn, np.stack([share, 1 - share], axis=1))
        chosen = list(dict.fromkeys(np.argmax(values, axis=0).tolist()))[: BATCH - 1]
        return self.with_unknown(places, chosen, seen), math.inf


def _weighed(
    aims: Float[np.ndarray, "points draws 2"], shares: Float[np.ndarray, "draws 2"]
) -> Float[np.ndarray, "points draws"]:
    """Both aims, each from 0 to 1 within the draw, as one number: the lesser of the two, where a
    large share makes one count early, and a little of their sum."""
    low, high = aims.min(axis=0), aims.max(axis=0)
    lack = (high - aims) / np.maximum(high - low, 1e-9) * shares
    return -lack.max(axis=-1) - _BEND * lack.sum(axis=-1)


def unbeaten(aims: Float[np.ndarray, "points 2"]) -> Bool[np.ndarray, " points"]:
    """Which points no other one beats: none is as good in both and better in one."""
    as_good = np.all(aims[None] >= aims[:, None], axis=-1)
    better = np.any(aims[None] > aims[:, None], axis=-1)
    return ~np.any(as_good & better, axis=1)


def trade_off(
    surrogate: Surrogate,
    space: Space,
    settings: Settings | None = None,
    *,
    progress: bool = False,
) -> Front:
    """Looks for the designs that no other one beats in both of two aims.

    The aims are index 1, or what the objective is, of DoEs (more is better) and EoEn (less is
    better); for a task with one other task, the scores in the two.

    Arguments:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: what may change.
        settings: `iterations`, 24 rounds unless given, `accept_trials` and `seed`.
        progress: whether to show a bar on stderr.

    Raises:
        TypeError: a surrogate or space that is none.
        ValueError: the task has DoEs alone and no other task, or more than one other; no allowed
            hand; or none whose aims the trials can tell.

    Examples:
        Far too few trials to find anything, but quick:

        >>> import pcjax
        >>> task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
        >>> space = pcjax.design_space(pcjax.box_hand(), ["fingertip_angle_deg"], 50.0)
        >>> settings = pcjax.Settings(iterations=1, accept_trials=32)
        >>> front = pcjax.trade_off(pcjax.Surrogate(task, trials=40), space, settings)
        >>> front.names
        ('DoEs by index1', 'EoEn by index1')
    """
    check_kind("surrogate", surrogate, Surrogate)
    check_kind("space", space, Space)
    settings, task = Settings() if settings is None else settings, surrogate.task
    if len(task.each) > 2 or (len(task.each) == 1 and len(task.directions) == 1):
        raise ValueError(
            "a front is for two aims: DoEs and EoEn in one condition, or the scores in two"
        )
    space = space.holding(task)
    (begun,) = starting_designs(space, 1, settings.seed)
    start = given_start(surrogate, space, begun, calls=1)
    search, belief = _FrontSearch(surrogate, space, settings.seed), Belief(surrogate)
    state, interrupted = search.run(
        belief,
        begun,
        settings.iterations or _ROUNDS,
        gain=0.0,
        checkpoint=None,
        fingerprint=fingerprint_of(surrogate, space, settings),
        progress=progress,
        watch=lambda state: False,
    )
    if not belief.batches:
        raise KeyboardInterrupt  # before anything was seen
    names = f"DoEs by {surrogate.objective}", f"EoEn by {surrogate.objective}"
    if task.also:
        names = "score in condition 1", "score in condition 2"
    larger = (True, bool(task.also))
    seen = belief.at
    aims = search.aims(belief.each_mean(seen))
    chosen = _spread_over(aims, np.flatnonzero(unbeaten(aims)))
    designs = [start.design, *search.design(seen[chosen])]
    final = compare_hands(
        surrogate,
        [start.hand, *map(space.hand, designs[1:])],
        trials=settings.accept_trials,
        seed=settings.seed + _UNSEEN,
    )
    parts = [final.of(k) for k in (0, 1)] if task.also else [final.of_run(k) for k in (0, 1)]
    members = [
        Member(design, (parts[0].scores[k], parts[1].scores[k])) for k, design in enumerate(designs)
    ]
    signs = np.where(larger, 1.0, -1.0)
    told = [one for one in members[1:] if not any(math.isnan(aim.value) for aim in one.aims)]
    if not told:
        raise ValueError(
            "no design has both aims: no trial escapes, or none is held to the limit from outside; "
            "take more trials, another limit, or objective index1"
        )
    found = np.array([[aim.value for aim in member.aims] for member in told]) * signs
    front = [told[k] for k in np.flatnonzero(unbeaten(found))]
    return Front(
        names,
        larger,
        sorted(front, key=lambda member: member.aims[0].value),
        members[0],
        start.moved,
        len(designs) - 1 - len(told),
        np.exp(aims * signs),
        state.trials + len(designs) * final.trials * task.runs,
        state.invalid + final.invalid,
        interrupted,
    )


def _spread_over(aims: Float[np.ndarray, "points 2"], front: np.ndarray) -> np.ndarray:
    """Some designs of a front, evenly along it."""
    front = front[np.argsort(aims[front, 0])]
    if len(front) <= _MOST:
        return front
    sides = np.ptp(aims[front], axis=0)
    steps = np.abs(np.diff(aims[front], axis=0)) / np.where(sides > 0, sides, 1.0)
    along = np.concatenate([[0.0], np.cumsum(steps.sum(axis=1))])
    wanted = np.linspace(0.0, along[-1], _MOST)
    return front[np.unique(np.argmin(np.abs(along[:, None] - wanted), axis=0))]
