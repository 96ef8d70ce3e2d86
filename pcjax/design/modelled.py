"""The search that learns: a model of the exact score from all that was tried, in every round.

Each round some designs are tried together, on trials of their own: the one that the model holds for
the best, and those that came out best in draws from what it believes (Thompson sampling, Thompson
1933). So designs are tried for as long as they may be the best, whichever basin they are in, and
trials go where the decision hangs. It ends when the model expects no more gain worth having.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from pcjax.design.belief import Batch, Belief
from pcjax.design.checkpoint import (
    Progress,
    Step,
    fingerprint_of,
    keep_progress,
    load_progress,
)
from pcjax.design.gaussian import Points
from pcjax.design.outcome import Optimum, Settings, accept
from pcjax.design.space import Design, Space
from pcjax.design.starts import given_start, starting_designs
from pcjax.progress import progress_bar
from pcjax.quality.surrogate import Surrogate
from pcjax.results.files import locked

_ROUNDS = 40
"""At most, unless given."""

_CALM = 3
"""Rounds in a row with hardly any gain to expect, after which a search ends."""

_BASINS = 4
"""Designs that a search ends with at most."""

_VALLEY = 0.02
"""How much lower, as a logarithm, the score has to be between two designs for these to be two."""

_APART = 0.1
"""How far apart they have to be, in shares of the bounds."""


_FIRST = 16
"""Designs of the first round, or three for each parameter."""

BATCH = 8
"""Designs of each other round."""

DRAWS = 64

_AT_BOUND = 0.3
"""Share of the numbers of designs spread over the space that are put to the nearer bound, in half
of them."""

_NEAREST, _FARTHEST = 0.005, 0.3
"""How far from it, in shares of the bounds."""

_DOUBLED_EVERY = 8
"""Rounds after which a design gets twice the trials, three times over."""


def search_model(
    surrogate: Surrogate,
    space: Space,
    settings: Settings,
    *,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool = False,
    watch: Callable[[Progress], bool] = lambda state: False,
) -> Optimum:
    """Learns a model of the exact score, and tries what may be the best by it.

    Arguments:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: what may change; its base hand is among the first designs.
        settings: see `Settings`.
        checkpoint, progress: see `pcjax.optimize`.
        watch: told the state after each round; whether to end the search.

    Raises:
        ValueError: see `pcjax.optimize`.
    """
    space = space.holding(surrogate.task)
    (begun,) = starting_designs(space, 1, settings.seed)
    start = given_start(surrogate, space, begun)
    search, belief = Search(surrogate, space, settings.seed), Belief(surrogate)
    state, interrupted = search.run(
        belief,
        begun,
        settings.iterations or _ROUNDS,
        gain=settings.gain,
        checkpoint=checkpoint,
        fingerprint=fingerprint_of(surrogate, space, settings),
        progress=progress,
        watch=watch,
    )
    ends, tried = [[begun]], []
    if belief.batches:
        ends, tried = search.basins(belief), list(search.design(belief.at))
    return accept(
        ends, state, start, surrogate, space, settings, interrupted=interrupted, tried=tried
    )


def calm(state: Progress, gain: float) -> bool:
    """Whether no round of the last ones expected more than that gain."""
    gains = [kept["gain"] for kept in state.state[1:]]
    return len(gains) >= _CALM and max(gains[-_CALM:]) < gain


def _in_short(step: Step) -> str:
    low, value, high = (math.exp(step.value + sign * 1.96 * step.value_se) for sign in (-1, 0, 1))
    return f"score {value:.4g} [{low:.4g}, {high:.4g}]"


@dataclass(frozen=True)
class Search:
    """A search, whose designs have parameters from 0 to 1.

    Attributes:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: what may change.
        seed: of everything.
    """

    surrogate: Surrogate
    space: Space
    seed: int

    def design(self, at: Float[np.ndarray, "*some parameters"]) -> np.ndarray:
        """Designs as the space has them."""
        return self.space.low + at * (self.space.high - self.space.low)

    def place(self, design: Design) -> Design:
        """The other way round."""
        return (design - self.space.low) / (self.space.high - self.space.low)

    def allowed(self, at: Points) -> Bool[np.ndarray, " points"]:
        """Which designs are."""
        return self.space.which(self.design(at))

    def drawn_in(self, at: Points, inside: Points) -> Points:
        """Designs as they are or, where not allowed, the last that is on the way there from another
        one that is; clipped to the bounds."""
        at = np.clip(at, 0.0, 1.0)
        wrong = np.flatnonzero(~self.allowed(at))
        if len(wrong) == 0:
            return at
        begin, way = inside[wrong], at[wrong] - inside[wrong]
        share, step = np.zeros(len(wrong)), 1.0
        rounds, parts = self.space.cuts
        for _ in range(rounds):
            tried = share[:, None] + step * np.arange(1, parts) / parts
            places = begin[:, None] + tried[..., None] * way[:, None]
            good = self.allowed(places.reshape(-1, at.shape[1])).reshape(tried.shape)
            share = share + step / parts * np.cumprod(good, axis=1).sum(axis=1)
            step = step / parts
        at = at.copy()
        at[wrong] = begin + share[:, None] * way
        return at

    def run(
        self,
        belief: Belief,
        begun: Design,
        rounds: int,
        *,
        gain: float,
        checkpoint: str | os.PathLike[str] | None,
        fingerprint: str,
        progress: bool,
        watch: Callable[[Progress], bool],
    ) -> tuple[Progress, bool]:
        """Rounds, as many as that or until little gain is to be expected; and whether they were
        interrupted.

        Arguments:
            belief: without batches; it learns what is seen.
            begun: a design of the space, where the search begins.
            rounds: at most.
            gain: see `Settings`.
            checkpoint, progress: see `pcjax.optimize`.
            fingerprint: of all that the search depends on.
            watch: see `search_model`.
        """
        path = None if checkpoint is None else Path(checkpoint)
        state, interrupted = Progress([[]], [list(map(float, begun))], []), False
        ended = False
        with nullcontext() if path is None else locked(path):
            if path is not None and os.path.lexists(path):
                state = load_progress(path, fingerprint, self.possible)
                for kept in state.state:
                    belief.learn(Batch.of(kept["batch"]))
            with progress_bar(
                total=rounds,
                initial=state.iteration,
                desc="optimise",
                unit="round",
                shown=progress,
            ) as bar:
                try:
                    while state.iteration < rounds and not calm(state, gain) and not ended:
                        state = self.round(belief, state)
                        if path is not None:
                            keep_progress(path, fingerprint, state)
                        bar.update()
                        bar.set_postfix_str(_in_short(state.history[0][-1]))
                        ended = watch(state)
                except KeyboardInterrupt:
                    interrupted = True
        return state, interrupted

    def first(self, begun: Design) -> Points:
        """The designs of the first round: where the search begins, and others spread."""
        count = max(_FIRST, 3 * len(begun)) - 1
        spread = self._spread(4 * count, 0)
        good = self.allowed(spread)
        inside = np.broadcast_to(begun, spread[~good].shape)
        others = np.concatenate([spread[good], self.drawn_in(spread[~good], inside)])[:count]
        return np.concatenate([begun[None], others])

    def _spread(self, count: int, round: int) -> Points:
        from scipy.stats import qmc  # takes more than a second to import

        sobol = qmc.Sobol(len(self.space.free), rng=np.random.default_rng([self.seed, round, 1]))
        return sobol.random_base2((count - 1).bit_length())[:count]

    def trials(self, round: int) -> int:
        """Of each design and direction in a round: few as long as much is open."""
        few = max(self.surrogate.trials // 4, 2)
        return few << min(round // _DOUBLED_EVERY, 3)

    def try_out(self, at: Points, round: int) -> tuple[Batch, int]:
        """Runs designs; and how many trials went wrong."""
        exact = replace(self.surrogate, form="exact", trials=self.trials(round))
        sample = exact.sample([self.space.hand(one) for one in self.design(at)], self.seed + round)
        logs, influences = exact.appraise(sample)
        count = influences.shape[2]
        noise = influences @ influences.transpose(0, 2, 1) / (count * (count - 1))
        doubt = exact.doubt(sample.means(), count)
        noise += doubt.T[:, :, None] * np.eye(len(at))
        return Batch(at, logs, noise, count), sample.invalid

    def round(self, belief: Belief, state: Progress) -> Progress:
        """One more: some designs are chosen and tried, and the belief learns of them."""
        began, k = time.perf_counter(), state.iteration
        if k == 0:
            at, gain = self.first(self.place(np.array(state.designs[0]))), math.inf
        else:
            at, gain = self.think(belief, k)
        batch, invalid = self.try_out(at, k)
        belief.learn(batch)
        (best,), value, error = self.best(belief)
        step = Step(list(map(float, self.design(best))), value, error, [], [])
        return Progress(
            [[*state.history[0], step]],
            [step.design],
            [*state.state, {"batch": batch.plain(), "gain": gain}],
            state.trials + batch.logs.size * self.trials(k),
            state.seconds + time.perf_counter() - began,
            state.invalid + invalid,
        )

    def best(self, belief: Belief) -> tuple[Points, float, float]:
        """Of the designs that were tried the one that is held for the best, and what is believed of
        its score's logarithm: the mean and its standard error."""
        at = belief.at
        best = at[[np.argmax(belief.mean(at))]]
        drawn = belief.draws(best, 1000, np.random.default_rng(0))
        return best, float(belief.mean(best)[0]), float(np.std(drawn))

    def think(self, belief: Belief, round: int) -> tuple[Points, float]:
        """What to try in a round, and by how much the best of all may be expected to be better than
        the first of these, which is held for the best; as a logarithm."""
        rng, seen = np.random.default_rng([self.seed, round]), belief.at
        order = np.argsort(-belief.mean(seen))
        top, good = seen[order[:6]], seen[order[: max(6, len(seen) // 3)]]
        places = self.places(belief, top, good, round, rng)
        best = self.climbed(belief, places[np.argmax(belief.mean(places))], rng)
        places = distinct(np.concatenate([best[None], places]))
        draws = belief.draws(places, DRAWS, rng)
        gain = float(np.mean(draws.max(axis=0) - draws[0]))
        chosen = list(dict.fromkeys([0, *np.argmax(draws, axis=0).tolist()]))[: BATCH - 1]
        return self.with_unknown(places, chosen, seen), gain

    def places(
        self, belief: Belief, top: Points, good: Points, round: int, rng: np.random.Generator
    ) -> Points:
        """Designs to think of, all allowed: spread over the space, about the top ones, and these;
        what is not allowed is drawn in towards a good one. Half of those that are spread have some
        of their numbers at a bound: the best often lies there, and none of a Sobol set does."""
        looks = self.space.looks
        spread = self._spread(looks, round)
        at_bound = rng.random(spread.shape) < _AT_BOUND
        at_bound[: looks // 2] = False
        spread = np.where(at_bound, np.round(spread), spread)
        near = top[rng.integers(len(top), size=2 * looks)]
        inside = np.concatenate([good[rng.integers(len(good), size=looks)], near])
        moves = _moves(near.shape, _FARTHEST, rng) * self._lengths(belief)
        found = self.drawn_in(np.concatenate([spread, near + moves]), inside)
        return np.concatenate([found, top])

    def with_unknown(self, places: Points, chosen: list[int], seen: Points) -> Points:
        """The places chosen and one more, where least is known whatever is believed: there may be a
        cliff in between."""
        known = np.concatenate([seen, places[chosen]])
        return places[[*chosen, int(np.argmax(_distance(places, known)))]]

    def _lengths(self, belief: Belief) -> Design:
        """How far to move each parameter, as shares of one another."""
        logs = np.log(belief.lengths)
        return np.clip(np.exp(logs - logs.mean()), 0.3, 3.0)

    def climbed(self, belief: Belief, best: Design, rng: np.random.Generator) -> Design:
        """The best near a design, by what is believed."""
        around = np.repeat(best[None], self.space.looks, axis=0)
        moves = _moves(around.shape, _FARTHEST / 6, rng) * self._lengths(belief)
        places = np.concatenate([best[None], self.drawn_in(around + moves, around)])
        return places[np.argmax(belief.mean(places))]

    def basins(self, belief: Belief) -> list[list[Design]]:
        """The best design that was tried, and if there are any those of other basins, where on all
        ways from one to the other the score falls; beside the first the best of all by what is
        believed."""
        seen, rng = belief.at, np.random.default_rng(self.seed)
        best = self.climbed(belief, seen[np.argmax(belief.mean(seen))], rng)
        count = 4 * self.space.looks
        inside = seen[rng.integers(len(seen), size=count)]
        places = np.concatenate([seen, self.drawn_in(self._spread(count, 0), inside)])
        tops = tops_of(places, belief.mean(places), known=len(seen))
        apart: list[Design] = []
        for top in places[tops]:
            if all(np.max(np.abs(top - other)) > _APART for other in apart):
                apart.append(top)
        first, *others = ([self.design(top)] for top in apart[:_BASINS])
        return [[*first, self.design(best)], *others]

    def possible(self, state: Progress) -> bool:
        """Whether this search can have come to a state."""
        parameters, count = len(self.space.free), self.surrogate.task.runs
        batches = [Batch.of(kept["batch"]) for kept in state.state]
        return len(batches) == len(state.history[0]) and all(
            batch.at.shape == (len(batch.at), parameters)
            and batch.logs.shape == (len(batch.at), count)
            and batch.noise.shape == (count, len(batch.at), len(batch.at))
            for batch in batches
        )


def tops_of(
    places: Points, values: Float[np.ndarray, " points"], known: int
) -> Int[np.ndarray, " tops"]:
    """Which of the first `known` places are tops, the highest first: on the ways from each to any
    higher one, from neighbour to neighbour, the values fall by `_VALLEY` or more.

    The places are gone through from the highest down, as if water fell: a top is where an island
    comes up, and counts if that has risen far enough when it meets a higher one.
    """
    from scipy.spatial import KDTree

    count = min(len(places), 2 * places.shape[1] + 7)
    neighbours = KDTree(places).query(places, count)[1]
    near: list[set[int]] = [set() for _ in places]
    for k, others in enumerate(np.atleast_2d(neighbours)):
        for other in others:
            near[k].add(int(other))
            near[int(other)].add(k)
    # Each island by one of its places; of each its highest place that is known.
    root: dict[int, int] = {}
    top: dict[int, int | None] = {}

    def find(k: int) -> int:
        while root[k] != k:
            k = root[k]
        return k

    found: list[int] = []
    for k in map(int, np.argsort(-values)):
        root[k], top[k] = k, k if k < known else None
        for island in {find(other) for other in near[k] if other in root} - {k}:
            mine, theirs = top[find(k)], top[island]
            higher, lower = mine, theirs
            if mine is None or (theirs is not None and values[theirs] > values[mine]):
                higher, lower = theirs, mine
            if lower is not None and values[lower] - values[k] > _VALLEY:
                found.append(lower)
            root[find(k)] = island
            top[island] = higher
    last = {top[find(k)] for k in root} - {None}
    return np.array(sorted({*found, *last}, key=lambda k: -values[k]), int)


def _moves(
    shape: tuple[int, ...], farthest: float, rng: np.random.Generator
) -> Float[np.ndarray, "points parameters"]:
    """Moves of some parameters, near and far: about two thirds of them, at least one."""
    count, parameters = shape
    reach = np.exp(rng.uniform(math.log(_NEAREST), math.log(farthest), (count, 1)))
    chosen = rng.random(shape) < 2 / 3
    chosen[np.arange(count), rng.integers(parameters, size=count)] = True
    return reach * rng.standard_normal(shape) * chosen


def distinct(places: Points) -> Points:
    """Without those that are hardly different from an earlier one."""
    return places[np.sort(np.unique(places.round(3), axis=0, return_index=True)[1])]


def _distance(points: Points, others: Points) -> Float[np.ndarray, " points"]:
    """From each point to the nearest of others."""
    return np.linalg.norm(points[:, None] - others, axis=-1).min(axis=1)
