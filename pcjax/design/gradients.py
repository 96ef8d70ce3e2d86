"""Estimators of the derivative of a surrogate's logarithm: value, gradient, and how sure they are.

`Differences` moves the design both ways along some directions, on the same trials: one parameter at
a time ("axial"), or all of them in every run ("factorial", after Plackett and Burman, with
Hadamard's signs), so that all runs tell about every parameter. The variance is then smaller, and
the bias larger, since the joint move is longer. "gaussian" directions are evolution strategies.

`Pathwise` differentiates each trial, forward through the smoothed steps. `Mixture` weighs two
estimators by their variances.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Integer
from scipy.linalg import hadamard

from pcjax.checks import check_between, check_count
from pcjax.design.estimator import Designs, Estimator, Gradient, gradient_from
from pcjax.design.space import Design, DesignSpace
from pcjax.geometry import Scalar
from pcjax.quality.surrogate import Surrogate
from pcjax.simulate.stepping import Stepping

DIRECTIONS = ("axial", "factorial", "gaussian")

_OTHER = 0x5BD1E995
"""Tells the seeds of a mixture's two estimators apart."""


@dataclass(frozen=True)
class Differences(Estimator):
    """Central differences on common random numbers.

    Arguments:
        directions: one of `DIRECTIONS`.
        reach: factor on the usual steps of 4 degrees and 0.02 L_p (no more than a fifth of a
            length). They shrink where the hand would close, or leave no room for the object.
        count: how many gaussian directions; the number of parameters unless given.

    Raises:
        ValueError: an unknown name or a number out of range.

    Examples:
        >>> import pcjax
        >>> task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
        >>> space = pcjax.design_space(pcjax.box_hand(), ["fingertip_angle_deg"], 50.0)
        >>> designs = [space.design_of(space.base)]
        >>> (found,) = pcjax.Differences()(pcjax.Surrogate(task, trials=20), space, designs, 0)
        >>> found.gradient.shape, found.trials  # three hands, two directions
        ((1,), 120)
    """

    directions: str = "axial"
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

    def reaching(self, factor: float) -> Differences:
        """With moves that many times as long."""
        return replace(self, reach=self.reach * factor)

    def __call__(
        self, surrogate: Surrogate, space: DesignSpace, designs: Designs, seed: int
    ) -> list[Gradient]:
        """The gradients at some designs, all in one batch.

        Raises:
            ValueError: a hand is closed, or as good as closed.
        """
        began = time.perf_counter()
        ways = self._ways(len(designs[0]), seed)
        all_moves = [
            open_moves(space, design, self.reach * ways * space.usual_moves(design))
            for design in designs
        ]
        hands = [
            space.hand(one)
            for design, (ahead, back) in zip(designs, all_moves, strict=True)
            for one in (design, *(design + ahead), *(design - back))
        ]
        each = 1 + 2 * len(ways)
        sample = surrogate.sample(hands, seed, hands[::each])
        values, influences = surrogate.appraise(sample)
        seconds = time.perf_counter() - began
        gradients = []
        for k, (ahead, back) in enumerate(all_moves):
            mine = slice(k * each, (k + 1) * each)
            # Least squares: the differences are (ahead + back) @ gradient.
            weights = np.linalg.pinv(ahead + back)
            pick = np.zeros((1 + len(weights), each))
            pick[0, 0] = 1.0
            pick[1:, 1 : 1 + len(ways)] = weights
            pick[1:, 1 + len(ways) :] = -weights
            parts, each_influence = pick @ values[mine], pick @ influences[:, mine]
            gradients.append(
                gradient_from(
                    surrogate,
                    parts.T,
                    each_influence,
                    trials=each * len(parts.T) * surrogate.trials,
                    seconds=seconds / len(designs),
                    invalid=sample.invalid,
                )
            )
        return gradients

    def _ways(self, count: int, seed: int) -> Float[np.ndarray, "moves parameters"]:
        """The moves, in usual moves."""
        if self.directions == "axial":
            return np.eye(count)
        if self.directions == "factorial":
            return _signs(count)
        return np.random.default_rng(seed).standard_normal((self.count or count, count))


def _signs(count: int) -> Float[np.ndarray, "runs parameters"]:
    """Orthogonal columns of signs: as few runs as a power of 2 allows."""
    size = 1 << (count - 1).bit_length()
    return hadamard(size)[:, :count].astype(float)


def differentiable_score(
    surrogate: Surrogate, space: DesignSpace, *, block: int = 256
) -> Callable[[Float[Array, " parameters"], Integer[Array, ""] | int], Scalar]:
    """The relaxed score as a function of (design, seed) that JAX can compile and differentiate.

    A design has the values of `space.free` in order: degrees where the name ends in `_deg`, else
    lengths. So the derivative is per degree or per length.

    Its derivative is the estimate of `Differences`, with the base hand's moves, by
    `jax.custom_jvp`, so `jax.grad` of it and any optimiser of optax just work. `optimize` is
    faster: here the trials of a block wait for each other. There are no second derivatives:
    differentiating the derivative raises a NotImplementedError.

    Arguments:
        surrogate: of the form "horizon".
        space: of the designs.
        block: trials that run together; `surrogate.trials` is rounded up to whole blocks.

    Raises:
        ValueError: a surrogate of another form.

    Examples:
        >>> import pcjax, jax
        >>> task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 30_000)
        >>> space = pcjax.design_space(pcjax.box_hand(), ["fingertip_angle_deg"], 50.0)
        >>> score = pcjax.differentiable_score(pcjax.Surrogate(task, trials=64), space, block=64)
        >>> jax.eval_shape(jax.grad(score), space.design_of(space.base), 0).shape
        (1,)
    """
    if surrogate.form != "horizon":
        raise ValueError(f"a score to be compiled needs form 'horizon', not {surrogate.form!r}")
    engine = surrogate.relaxed_engine(surrogate.task.scenarios(space.base))
    moves = np.diag(space.usual_moves(space.design_of(space.base)))
    blocks = -(-surrogate.trials // block)

    def log_score(design: Array, seed: Array) -> Scalar:
        def means(number: Array) -> Array:
            trials = number * block + jnp.arange(block, dtype=jnp.int32)
            return surrogate.traced_values(space.hand(design), engine, trials, seed).mean(axis=-1)

        each = jax.lax.map(means, jnp.arange(blocks, dtype=jnp.int32))
        return surrogate.log_score(each.mean(axis=0))

    @jax.custom_jvp
    def score(design: Array, seed: Array) -> Scalar:
        return jnp.exp(log_score(design, seed))

    @jax.custom_jvp
    def log_gradient(design: Array, seed: Array) -> Array:
        ways = jnp.asarray(np.concatenate([moves, -moves]))
        factors = 0.75 ** jnp.arange(17.0)
        gaps = jax.vmap(
            lambda factor: jnp.min(
                jax.vmap(lambda way: space.hand(design + factor * way).gap())(ways)
            )
        )(factors)
        reach = factors[jnp.argmax(gaps > space.least_gap(0.5))]
        logs = jax.lax.map(lambda way: log_score(design + reach * way, seed), ways)
        half = 0.5 * (logs[: len(moves)] - logs[len(moves) :])
        return jnp.linalg.pinv(jnp.asarray(moves)) @ half / reach

    @score.defjvp
    def _(primals: tuple[Array, Array], tangents: tuple[Array, Any]) -> tuple[Scalar, Scalar]:
        value = score(*primals)
        return value, value * jnp.dot(log_gradient(*primals), tangents[0])

    @log_gradient.defjvp
    def _(primals: tuple[Array, Array], tangents: tuple[Array, Any]) -> NoReturn:
        raise NotImplementedError(
            "the score has no second derivatives, since its gradient is an estimate from "
            "differences: optimise with first derivatives, or take differences of jax.grad over "
            "moves of some degrees, with one seed"
        )

    return lambda design, seed: score(jnp.asarray(design, float), jnp.asarray(seed, jnp.uint32))


@dataclass(frozen=True)
class Pathwise(Estimator):
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
        self, surrogate: Surrogate, space: DesignSpace, designs: Designs, seed: int
    ) -> list[Gradient]:
        """The gradients at some designs.

        Raises:
            ValueError: a surrogate of another form.
        """
        if surrogate.form != "horizon":
            raise ValueError(f"a pathwise gradient needs form 'horizon', not {surrogate.form!r}")
        engine = Stepping(self.dt, goal_layer=surrogate.goal_layer)

        @jax.jit
        def block(first: Array, at: Array) -> tuple[Array, Array]:
            trials = first + jnp.arange(self.block, dtype=jnp.int32)

            def values(at: Array) -> Array:
                return surrogate.traced_values(space.hand(at), engine, trials, jnp.uint32(seed))

            return values(at), jax.jacfwd(values)(at)

        return [self._at(surrogate, block, design) for design in designs]

    def _at(
        self,
        surrogate: Surrogate,
        block: Callable[[Array, Array], tuple[Array, Array]],
        design: Design,
    ) -> Gradient:
        began = time.perf_counter()
        at, firsts = jnp.asarray(design, float), range(0, surrogate.trials, self.block)

        def run(first: int) -> tuple[np.ndarray, np.ndarray]:
            with jax.enable_x64(at.dtype == jnp.float64):  # threads do not inherit it
                return jax.device_get(block(jnp.int32(first), at))

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            parts = list(pool.map(run, firsts))
        values = np.concatenate([part[0] for part in parts], axis=-1)[..., : surrogate.trials]
        slopes = np.concatenate([part[1] for part in parts], axis=-2)[..., : surrogate.trials, :]
        good = np.isfinite(slopes).all(axis=(0, 1, 3)) & np.isfinite(values).all(axis=(0, 1))
        values, slopes = values[..., good], slopes[..., good, :]
        means = values.mean(axis=-1)
        (value,), (weights,) = surrogate.judge(means[None])
        own = np.einsum("dk,dknp->dpn", weights, slopes)
        deviations = np.einsum("dk,dkn->dn", weights, values - means[..., None])
        influences = np.concatenate(
            [deviations[:, None], own - own.mean(axis=-1, keepdims=True)], axis=1
        )
        return gradient_from(
            surrogate,
            np.concatenate([value[:, None], own.mean(axis=-1)], axis=1),
            influences,
            trials=surrogate.trials * len(means),
            seconds=time.perf_counter() - began,
            invalid=int(np.sum(~good)),
        )


@dataclass(frozen=True)
class Mixture(Estimator):
    """Two estimators, each component weighted by the inverse of its variance.

    Arguments:
        first, second: the estimators.
        changes: what the second one's surrogate has otherwise, for instance
            (("contact_layer", 0.2), ("trials", 256)).

    Examples:
        >>> import pcjax
        >>> both = pcjax.Mixture(pcjax.Differences(), pcjax.Pathwise(), (("contact_layer", 0.2),))
        >>> both.first.directions
        'axial'
    """

    first: Estimator
    second: Estimator
    changes: tuple[tuple[str, Any], ...] = ()

    def __call__(
        self, surrogate: Surrogate, space: DesignSpace, designs: Designs, seed: int
    ) -> list[Gradient]:
        """The gradients at some designs; the values are the first one's."""
        ones = self.first(surrogate, space, designs, seed)
        twos = self.second(replace(surrogate, **dict(self.changes)), space, designs, seed ^ _OTHER)
        return [mixed(one, two) for one, two in zip(ones, twos, strict=True)]


def mixed(one: Gradient, two: Gradient) -> Gradient:
    """Two independent estimates as one, each component weighted by the inverse of its variance."""
    share = two.se**2 / (one.se**2 + two.se**2)
    rest = 1 - share
    return Gradient(
        one.value,
        one.value_se,
        share * one.gradient + rest * two.gradient,
        np.outer(share, share) * one.covariance + np.outer(rest, rest) * two.covariance,
        share * one.parts + rest * two.parts,
        np.hypot(share * one.parts_se, rest * two.parts_se),
        max(one.largest_share, two.largest_share),
        one.trials + two.trials,
        one.seconds + two.seconds,
        one.invalid + two.invalid,
    )


_LEAST_REACH = 0.1

Moves = Float[np.ndarray, "moves parameters"]


def open_moves(space: DesignSpace, design: Design, moves: Moves) -> tuple[Moves, Moves]:
    """The moves ahead and back that leave the hand open, with room for the objects: all of them
    times one factor or, where that would be less than a tenth, each as far as it can go.

    Raises:
        ValueError: some move leads nowhere, ahead or back.
    """
    factors = 0.75 ** np.arange(17)
    ways = factors[:, None, None, None] * np.stack([moves, -moves])
    good = space.open(design + ways, 0.5)
    common = factors[good.all(axis=(1, 2))]
    if len(common) and common[0] >= _LEAST_REACH:
        return common[0] * moves, common[0] * moves
    ahead, back = np.max(np.where(good, factors[:, None, None], 0.0), axis=0)[..., None] * moves
    if not np.all(np.any(ahead + back != 0, axis=1)):
        raise ValueError(
            "the hand is closed, or as good as closed: there is no way to move from it"
        )
    return ahead, back
