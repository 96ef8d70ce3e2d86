"""The search that follows gradients: estimated ones of the relaxed score drive optax.

Every iteration has trials of its own.
"""

from __future__ import annotations

import functools
import math
import os
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from pcjax.design.checkpoint import (
    Progress,
    Step,
    fingerprint_of,
    keep_progress,
    load_progress,
)
from pcjax.design.compare import compare
from pcjax.design.estimator import Estimator, Gradient
from pcjax.design.gradients import Differences
from pcjax.design.outcome import CHECKPOINT, Optimum, Settings, accept
from pcjax.design.space import Design, DesignSpace
from pcjax.design.starts import given_start, starting_designs
from pcjax.progress import progress_bar
from pcjax.quality.surrogate import Surrogate
from pcjax.results.files import locked

_ITERATIONS = 44
"""At most, unless given."""

_REST = 0.15
"""How far, in the parameters' scales, a design at rest moves at most from window to window."""

_WINDOW = 6
"""Iterations whose mean designs and values are compared to see whether anything still moves."""


def search_gradient(
    surrogate: Surrogate,
    space: DesignSpace,
    settings: Settings,
    *,
    estimator: Estimator | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool = False,
    watch: Callable[[Progress], bool] = lambda state: False,
) -> Optimum:
    """Follows the gradient of the relaxed score, from one start or several.

    Arguments:
        surrogate: the relaxed score.
        space: what may change; its base hand is the first start.
        settings: see `Settings`.
        estimator: of the gradient; `Differences()` unless given.
        checkpoint, progress, watch: see `pcjax.optimize`.

    Raises:
        ValueError: see `pcjax.optimize`.
    """
    estimator = Differences() if estimator is None else estimator
    path = None if checkpoint is None else Path(checkpoint)
    space = space.holding(surrogate.task)
    iterations = settings.iterations or _ITERATIONS
    starts = starting_designs(space, settings.starts, settings.seed)
    start = given_start(surrogate, space, starts[0])
    climb = _Climb(surrogate, space, settings, estimator, iterations)
    numbers, count = _numbers(climb.rule.init(jnp.zeros(len(space.free)))), len(starts)
    state = Progress(
        [[] for _ in starts],
        [list(map(float, start)) for start in starts],
        [numbers for _ in range(count)],
        stopped=[False] * count,
    )
    interrupted = ended = False
    fingerprint = fingerprint_of(surrogate, space, settings, estimator)
    with nullcontext() if path is None else locked(path):
        if path is not None and os.path.lexists(path):
            state = load_progress(path, fingerprint, functools.partial(_can_be, blank=state))
        bar = progress_bar(
            total=iterations,
            initial=state.iteration,
            desc="optimise",
            unit="iteration",
            shown=progress,
        )
        with bar:
            try:
                while state.iteration < iterations and not all(state.stopped) and not ended:
                    state = climb.iterate(state)
                    if path is not None:
                        keep_progress(path, fingerprint, state)
                    bar.update()
                    last = [steps[-1] for steps in state.history]
                    bar.set_postfix_str(f"score {math.exp(max(s.value for s in last)):.4g}")
                    ended = watch(state)
            except KeyboardInterrupt:
                interrupted = True
    ends = [
        [settled_design(space, steps, design)]
        for steps, design in zip(state.history, state.designs, strict=True)
    ]
    return accept(ends, state, start, surrogate, space, settings, interrupted=interrupted)


@dataclass(frozen=True)
class _Climb:
    """One iteration after the other."""

    surrogate: Surrogate
    space: DesignSpace
    settings: Settings
    estimator: Estimator
    iterations: int

    @functools.cached_property
    def rate(self) -> optax.Schedule:
        """Steps in the parameters' scales."""
        rate, half = self.settings.rate, self.iterations // 2
        fall = optax.cosine_decay_schedule(rate, max(self.iterations - half, 1))
        return optax.join_schedules([optax.constant_schedule(rate), fall], [half])

    @functools.cached_property
    def rule(self) -> optax.GradientTransformation:
        """Shorter memory than usual: a few dozen iterations leave no time to swing back, nor to
        forget a steep beginning."""
        return optax.adam(self.rate, b1=0.6, b2=0.8)

    def iterate(self, state: Progress) -> Progress:
        """The state after one more iteration of every start that still moves."""
        began = time.perf_counter()
        settings, space, surrogate = self.settings, self.space, self.surrogate
        k, trials, invalid = state.iteration, state.trials, state.invalid
        going = [n for n, stopped in enumerate(state.stopped) if not stopped]
        at = [np.array(state.designs[n]) for n in going]
        # Differences reach farther at the beginning.
        left = max(0.0, 1.0 - 2.0 * k / self.iterations)
        look = self.estimator.reaching(settings.wide**left)
        found = look(surrogate, space, at, settings.seed + k)
        exact = None
        if k % settings.check_every == 0:
            exact = compare(
                surrogate,
                space,
                at,
                trials=settings.check_trials,
                seed=settings.seed + CHECKPOINT,
            )
            trials += exact.trials * len(at) * surrogate.task.runs
            invalid += exact.invalid
        invalid += max(gradient.invalid for gradient in found)  # of a batch that shares its trials
        reach = max(float(np.asarray(self.rate(k))), 0.01)
        history = [list(steps) for steps in state.history]
        designs, numbers, stopped = list(state.designs), list(state.state), list(state.stopped)
        for place, (n, design, gradient) in enumerate(zip(going, at, found, strict=True)):
            step = _step_of(design, gradient)
            if exact is not None:
                step.exact, step.exact_se = exact.scores[place].value, exact.scores[place].se
            history[n].append(step)
            way = gradient.gradient * space.scales
            # Else most of a step is taken back on an edge, and Adam remembers what was never done.
            way = space.along_edges(design, way, reach)
            designs[n], numbers[n] = self.moved(design, way, _sureness(gradient), numbers[n])
            # Not while steps are as long as ever: what stands still then may still find its way.
            stopped[n] = k >= self.iterations // 2 and at_rest(history[n], space.scales)
            trials += gradient.trials
        seconds = state.seconds + time.perf_counter() - began
        return Progress(history, designs, numbers, trials, seconds, invalid, stopped)

    def moved(
        self, design: Design, way: Design, sureness: Design, numbers: list[Any]
    ) -> tuple[list[float], list[Any]]:
        """The next design and optax's state, by a step on the way uphill, in the parameters'
        scales, of which so large a share is taken as it is sure."""
        like = self.rule.init(jnp.zeros(len(design)))
        state = jax.tree.unflatten(
            jax.tree.structure(like),
            [
                jnp.asarray(n, leaf.dtype)
                for n, leaf in zip(numbers, jax.tree.leaves(like), strict=True)
            ],
        )
        with jax.numpy_dtype_promotion("standard"):  # optax mixes floats and counts
            updates, state = self.rule.update(jnp.asarray(-way), state)
        move = np.asarray(updates) * sureness * self.space.scales
        moved = self.space.nearest_allowed(design + move, design)
        return list(map(float, moved)), _numbers(state)


def _sureness(gradient: Gradient) -> Design:
    """From 0 to 1: each component's size, in two of its standard errors. Adam makes a full step of
    whatever it gets, of noise as well."""
    certain = gradient.se <= 0
    ratio = np.abs(gradient.gradient) / np.where(certain, 1.0, 2 * gradient.se)
    return np.where(certain, 1.0, np.minimum(ratio, 1.0))


def at_rest(steps: Sequence[Step], scales: Design) -> bool:
    """Whether the last iterations neither raised the mean score, within noise, nor moved it far."""
    if len(steps) < 2 * _WINDOW:
        return False
    before, after = steps[-2 * _WINDOW : -_WINDOW], steps[-_WINDOW:]
    gain = np.mean([step.value for step in after]) - np.mean([step.value for step in before])
    noise = math.sqrt(2 * np.mean([step.value_se**2 for step in [*before, *after]]) / _WINDOW)
    return bool(gain < 0.5 * noise and _drift(steps, scales) < _REST)


def _drift(steps: Sequence[Step], scales: Design) -> float:
    """How far the mean design moved from the last window but one to the last, in the scales."""
    before, after = steps[-2 * _WINDOW : -_WINDOW], steps[-_WINDOW:]
    moved = np.mean([s.design for s in after], axis=0) - np.mean([s.design for s in before], axis=0)
    return float(np.max(np.abs(moved) / scales))


def settled_design(space: DesignSpace, steps: Sequence[Step], last: Sequence[float]) -> Design:
    """Where a start has come to: the mean of its last designs, less noisy than any of them, unless
    it was still on its way."""
    if len(steps) < 2 * _WINDOW or _drift(steps, space.scales) > _REST:
        return np.array(last)
    designs = [step.design for step in steps[-_WINDOW:]]
    return space.nearest_allowed(np.mean([*designs, last], axis=0), np.array(last))


def _step_of(design: Design, gradient: Gradient) -> Step:
    return Step(
        list(map(float, design)),
        gradient.value,
        gradient.value_se,
        list(map(float, gradient.gradient)),
        list(map(float, gradient.se)),
    )


def _numbers(state: Any) -> list[Any]:
    """An optax state as numbers and lists."""
    return [np.asarray(leaf).tolist() for leaf in jax.tree.leaves(state)]


def _can_be(found: Progress, blank: Progress) -> bool:
    """Whether an optimisation that begins with `blank` can come to this state."""

    def shapes(numbers: Any) -> Any:
        return [np.shape(number) for number in numbers]

    steps = [step for history in found.history for step in history]
    designs = [*found.designs, *(step.design for step in steps)]
    return (
        shapes(designs) == shapes(blank.designs[:1]) * len(designs)
        and len(found.history) == len(found.designs) == len(blank.designs)
        and [shapes(numbers) for numbers in found.state] == [shapes(n) for n in blank.state]
        and len(found.stopped) == len(blank.stopped)
        and all(isinstance(stopped, bool) for stopped in found.stopped)
        and all(np.isfinite(np.array(design, float)).all() for design in designs)
    )
