"""The search that learns: a model of the exact score from all that was tried, in every round.

Each round some designs are tried together, on trials of their own: the one that the model holds for
the best, and those that came out best in draws from what it believes (Thompson sampling, Thompson
1933). So designs are tried for as long as they may be the best, whichever basin they are in, and
trials go where the decision hangs. It ends when the model expects no more gain worth having.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from pcjax.design.belief import Batch, Belief
from pcjax.design.gaussian import Points
from pcjax.design.shapes import allowed_among
from pcjax.design.space import Design, DesignSpace
from pcjax.quality.surrogate import Surrogate

_FIRST = 16
"""Designs of the first round, or three for each parameter."""

_BATCH = 8
"""Designs of each other round."""

_DRAWS = 64

_SPREAD = 128
"""Designs spread over the space that are thought of in each round, and as many again that lie
between them and the best, where the former are not allowed."""

_NEAR = 256
"""Designs near the best that are thought of in each round."""

_NEAREST, _FARTHEST = 0.005, 0.3
"""How far from it, in shares of the bounds."""

_DOUBLED_EVERY = 8
"""Rounds after which a design gets twice the trials, three times over."""


@dataclass(frozen=True)
class Search:
    """The designs of a search, with parameters from 0 to 1.

    Attributes:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: what may change.
        seed: of everything.
    """

    surrogate: Surrogate
    space: DesignSpace
    seed: int

    def design(self, at: Float[np.ndarray, "*some parameters"]) -> np.ndarray:
        """Designs as the space has them."""
        return self.space.low + at * (self.space.high - self.space.low)

    def place(self, design: Design) -> Design:
        """The other way round."""
        return (design - self.space.low) / (self.space.high - self.space.low)

    def allowed(self, at: Points) -> Bool[np.ndarray, " points"]:
        """Which designs are."""
        return allowed_among(self.surrogate.task, self.space, self.design(at))

    def drawn_in(self, at: Points, inside: Points) -> Points:
        """Designs as they are or, where not allowed, the last that is on the way there from another
        one that is; clipped to the bounds."""
        at = np.clip(at, 0.0, 1.0)
        wrong = np.flatnonzero(~self.allowed(at))
        if len(wrong) == 0:
            return at
        begin, way = inside[wrong], at[wrong] - inside[wrong]
        share, step = np.zeros(len(wrong)), 1.0
        for _ in range(2):
            tried = share[:, None] + step * np.arange(1, 8) / 8
            places = begin[:, None] + tried[..., None] * way[:, None]
            good = self.allowed(places.reshape(-1, at.shape[1])).reshape(tried.shape)
            share = share + step / 8 * np.cumprod(good, axis=1).sum(axis=1)
            step = step / 8
        at = at.copy()
        at[wrong] = begin + share[:, None] * way
        return at

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

    def think(self, belief: Belief, best: Design, round: int) -> tuple[Points, Design, float]:
        """What to try in a round: the designs, the first of which is the best that is known; that
        one; and by how much the best of all may be expected to be better, as a logarithm."""
        rng = np.random.default_rng([self.seed, round])
        seen = belief.at
        order = np.argsort(-belief.mean(seen))
        top, good = seen[order[:6]], seen[order[: max(6, len(seen) // 3)]]
        lengths = belief.lengths
        lengths = np.clip(lengths / np.exp(np.mean(np.log(lengths))), 0.3, 3.0)
        spread = self._spread(_SPREAD, round)
        near = top[rng.integers(len(top), size=_NEAR)]
        reach = np.exp(rng.uniform(math.log(_NEAREST), math.log(_FARTHEST), (_NEAR, 1)))
        moves = reach * lengths * rng.standard_normal(near.shape) * _some(rng, near.shape)
        inside = np.concatenate([good[rng.integers(len(good), size=_SPREAD)], near])
        places = self.drawn_in(np.concatenate([spread, near + moves]), inside)
        places = np.concatenate([places, best[None], top])
        best = places[np.argmax(belief.mean(places))]
        best = self.climbed(belief, best, lengths, rng)
        places = np.concatenate([best[None], places])
        places = places[np.sort(np.unique(places.round(3), axis=0, return_index=True)[1])]
        draws = belief.draws(places, _DRAWS, rng)
        gain = float(np.mean(draws.max(axis=0) - draws[0]))
        chosen = list(dict.fromkeys([0, *np.argmax(draws, axis=0).tolist()]))[: _BATCH - EXPL]
        chosen += [int(np.argmax(_distance(places, np.concatenate([seen,places[chosen]]))))] if EXPL else []
        return places[chosen], best, gain

    def climbed(
        self, belief: Belief, best: Design, lengths: Design, rng: np.random.Generator
    ) -> Design:
        """The best near a design, by what is believed."""
        around = np.repeat(best[None], _SPREAD, axis=0)
        reach = np.exp(rng.uniform(math.log(_NEAREST), math.log(0.05), (_SPREAD, 1)))
        moves = reach * lengths * rng.standard_normal(around.shape) * _some(rng, around.shape)
        places = np.concatenate([best[None], self.drawn_in(around + moves, around)])
        return places[np.argmax(belief.mean(places))]


EXPL = 1
def _distance(points: Points, others: Points) -> Float[np.ndarray, " points"]:
    """From each point to the nearest of others."""
    return np.linalg.norm(points[:, None] - others, axis=-1).min(axis=1)


def _some(rng: np.random.Generator, shape: tuple[int, ...]) -> Bool[np.ndarray, "points parameters"]:
    """Which parameters to move: about two thirds, at least one."""
    count, parameters = shape
    chosen = rng.random(shape) < 2 / 3
    chosen[np.arange(count), rng.integers(parameters, size=count)] = True
    return chosen
