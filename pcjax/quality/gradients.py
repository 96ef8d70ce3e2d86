"""Estimators of the derivative of a surrogate's logarithm: value, gradient, and how sure they are.

`Differences` moves the design both ways along some directions, on the same trials. One parameter at
a time ("axial") is the textbook's way. In a two-level factorial design ("factorial", after Plackett
and Burman, with Hadamard's signs) every run moves all parameters at once, so that all runs tell
about every parameter: for the same number of runs the variance is up to P times smaller, as far as
the trials still resemble each other after the larger move. "gaussian" directions are evolution
strategies.

`Pathwise` differentiates each trial, forward through the smoothed steps. `Mixture` weighs two
estimators by their variances.
"""

from __future__ import annotations

import math
import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg import hadamard

from pcjax.checks import check_between, check_count
from pcjax.engines.stepping import Stepping
from pcjax.model.hand import HandDesign
from pcjax.quality.surrogate import Surrogate

DIRECTIONS = ("axial", "factorial", "gaussian")

_ANGLE_STEP, _LENGTH_STEP = 0.4, 0.2
"""How far differences move a parameter, in its scale: 4 degrees, 0.02 L_p."""


_OTHER = 0x5BD1E995
"""Tells the seeds of a mixture's two estimators apart."""


class Space(Protocol):
    """What a gradient is taken in: vectors that stand for hands."""

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]: ...

    @property
    def angular(self) -> tuple[bool, ...]: ...

    def hand(self, design: Float[Array, " parameters"]) -> HandDesign: ...

    def open(self, design: Float[np.ndarray, " parameters"], share: float) -> bool: ...


@dataclass(frozen=True)
class Gradient:
    """An estimate of the surrogate's logarithm and of its derivative.

    Attributes:
        value, value_se: the logarithm of the score at the design.
        gradient: per unit of each parameter.
        covariance: of the gradient.
        largest_share: of the squared deviations of the noisiest component, the largest trial's
            share; above 0.05 the standard errors are not to be trusted.
        trials: simulated, all hands and directions together.
        seconds: wall time.
    """

    value: float
    value_se: float
    gradient: Float[np.ndarray, " parameters"]
    covariance: Float[np.ndarray, "parameters parameters"]
    largest_share: float
    trials: int
    seconds: float

    @property
    def se(self) -> Float[np.ndarray, " parameters"]:
        """Standard errors of the gradient."""
        return np.sqrt(np.diag(self.covariance))


class Estimator(Protocol):
    """How a gradient is estimated."""

    def __call__(
        self,
        surrogate: Surrogate,
        space: Space,
        design: Float[np.ndarray, " parameters"],
        seed: int,
    ) -> Gradient: ...


@dataclass(frozen=True)
class Differences:
    """Central differences on common random numbers.

    Arguments:
        directions: one of `DIRECTIONS`.
        reach: factor on the usual steps of 4 degrees and 0.02 L_p. They shrink, all alike, where
            the hand would close.
        count: how many gaussian directions; the number of parameters unless given.

    Raises:
        ValueError: an unknown name or a number out of range.
    """

    directions: str = "factorial"
    reach: float = 1.0
    count: int | None = None

    def __post_init__(self) -> None:
        if self.directions not in DIRECTIONS:
            raise ValueError(
                f"directions is {self.directions!r}: it has to be one of {', '.join(DIRECTIONS)}"
            )
        check_between("reach", self.reach, 1e-3, 10.0)
        if self.count is not None:
            check_count("count", self.count, 1, 4096)

    def __call__(
        self,
        surrogate: Surrogate,
        space: Space,
        design: Float[np.ndarray, " parameters"],
        seed: int,
    ) -> Gradient:
        """The gradient at a design.

        Raises:
            ValueError: the hand is closed, or as good as closed, at the design.
        """
        began = time.perf_counter()
        moves = self._moves(space, len(design), seed)
        reach = open_reach(space, design, moves)
        moves = reach * moves
        designs = [design, *(design + move for move in moves), *(design - move for move in moves)]
        hands = [space.hand(one) for one in designs]
        sample = surrogate.sample(hands, seed, hands[0])
        count = int(sample.valid.sum())
        if count < 2:
            raise ValueError("fewer than two trials went right at every design: try a smaller dt")
        means = sample.means()
        values, slopes = surrogate.judge(means)
        # Least squares: half the differences are moves @ gradient.
        weights = np.linalg.pinv(moves)
        pick = np.zeros((1 + len(design), len(designs)))
        pick[0, 0] = 1.0
        pick[1:, 1 : 1 + len(moves)] = 0.5 * weights
        pick[1:, 1 + len(moves) :] = -0.5 * weights
        deviations = sample.values[..., sample.valid] - means[..., None]
        influence = pick @ np.einsum("vdk,vdkn->vn", slopes, deviations)
        covariance = influence @ influence.T / (count * (count - 1))
        estimate = pick @ values
        return Gradient(
            float(estimate[0]),
            math.sqrt(covariance[0, 0]),
            estimate[1:],
            covariance[1:, 1:],
            largest_share(influence[1:]),
            sample.values.shape[0] * sample.values.shape[1] * surrogate.trials,
            time.perf_counter() - began,
        )

    def _moves(self, space: Space, count: int, seed: int) -> Float[np.ndarray, "moves parameters"]:
        steps = self.reach * np.where(space.angular, _ANGLE_STEP, _LENGTH_STEP) * space.scales
        if self.directions == "axial":
            return np.diag(steps)
        if self.directions == "factorial":
            return _signs(count) * steps
        draws = np.random.default_rng(seed).standard_normal((self.count or count, count))
        return draws * steps


def _signs(count: int) -> Float[np.ndarray, "runs parameters"]:
    """Orthogonal columns of signs: as few runs as a power of 2 allows."""
    size = 1 << (count - 1).bit_length()
    return hadamard(size)[:, :count].astype(float)


@dataclass(frozen=True)
class Pathwise:
    """The mean of each trial's own derivative, in forward mode through all its steps.

    The surrogate has to be a "horizon". Its `contact_layer` decides how contact is differentiated:
    0 goes through the time of impact, more than 0 through a smooth layer (0.2 does well).

    Arguments:
        dt: step, s.
        block: trials in one call.
    """

    dt: float = 0.05
    block: int = 256

    def __call__(
        self,
        surrogate: Surrogate,
        space: Space,
        design: Float[np.ndarray, " parameters"],
        seed: int,
    ) -> Gradient:
        """The gradient at a design.

        Raises:
            ValueError: a surrogate of another form.
        """
        if surrogate.form != "horizon":
            raise ValueError(f"a pathwise gradient needs form 'horizon', not {surrogate.form!r}")
        began = time.perf_counter()
        engine = Stepping(self.dt, surrogate.goal_layer)

        @jax.jit
        def block(first: Array, at: Array) -> tuple[Array, Array]:
            trials = first + jnp.arange(self.block, dtype=jnp.int32)

            def values(at: Array) -> Array:
                return surrogate.traced_values(space.hand(at), engine, trials, np.uint32(seed))

            return values(at), jax.jacfwd(values)(at)

        firsts = range(0, surrogate.trials, self.block)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            parts = list(
                pool.map(
                    lambda first: jax.device_get(block(np.int32(first), jnp.asarray(design))),
                    firsts,
                )
            )
        values = np.concatenate([part[0] for part in parts], axis=-1)[..., : surrogate.trials]
        slopes = np.concatenate([part[1] for part in parts], axis=-2)[..., : surrogate.trials, :]
        good = np.isfinite(slopes).all(axis=(0, 1, 3)) & np.isfinite(values).all(axis=(0, 1))
        values, slopes, count = values[..., good], slopes[..., good, :], int(good.sum())
        means = values.mean(axis=-1)
        (value,), (weights,) = surrogate.judge(means[None])
        # Of the score's logarithm: through the means' derivatives, and for the error through the
        # means themselves.
        each = np.einsum("dk,dknp->pn", weights, slopes)
        deviations = np.einsum("dk,dkn->n", weights, values - means[..., None])
        influence = each - each.mean(axis=1, keepdims=True)
        return Gradient(
            float(value),
            float(deviations.std(ddof=1)) / math.sqrt(count),
            each.mean(axis=1),
            influence @ influence.T / (count * (count - 1)),
            largest_share(influence),
            surrogate.trials * len(means),
            time.perf_counter() - began,
        )


@dataclass(frozen=True)
class Mixture:
    """Two estimators, each component weighted by the inverse of its variance.

    Arguments:
        first, second: the estimators, and
        softer: the surrogate's settings that the second one looks at, as `dataclasses.replace`
            takes them; they differ where the two need different widths.
    """

    first: Estimator
    second: Estimator
    softer: tuple[tuple[str, Any], ...] = ()

    def __call__(
        self,
        surrogate: Surrogate,
        space: Space,
        design: Float[np.ndarray, " parameters"],
        seed: int,
    ) -> Gradient:
        """The gradient at a design; the value is the first one's."""
        one = self.first(surrogate, space, design, seed)
        two = self.second(replace(surrogate, **dict(self.softer)), space, design, seed ^ _OTHER)
        share = np.array(two.se**2 / (one.se**2 + two.se**2))
        mixed = share * one.gradient + (1 - share) * two.gradient
        covariance = (
            np.outer(share, share) * one.covariance
            + np.outer(1 - share, 1 - share) * two.covariance
        )
        return Gradient(
            one.value,
            one.value_se,
            mixed,
            covariance,
            max(one.largest_share, two.largest_share),
            one.trials + two.trials,
            one.seconds + two.seconds,
        )


def open_reach(
    space: Space, design: Float[np.ndarray, " parameters"], moves: Float[np.ndarray, "moves p"]
) -> float:
    """The factor, at most 1, with which all moves leave the hand open, either way.

    Raises:
        ValueError: there is none above 1 %.
    """
    for factor in 0.75 ** np.arange(17):
        if all(space.open(design + sign * factor * m, 0.5) for m in moves for sign in (1, -1)):
            return float(factor)
    raise ValueError("the hand is closed, or as good as closed: there is no way to move from it")


def largest_share(influence: Float[np.ndarray, "components trials"]) -> float:
    """The largest trial's share of the squared deviations, in the worst component."""
    squares = influence**2
    totals = squares.sum(axis=1)
    return float(np.max(squares.max(axis=1) / np.where(totals > 0, totals, 1.0)))
