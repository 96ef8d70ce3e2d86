"""The design loop: estimated gradients drive optax; the result is accepted on the exact score.

Every iteration has trials of its own. So do the exact checkpoints along the way, the choice among
several starts, and the final comparison of start and result: three sets of seeds that the gradients
have never seen.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from pcjax.checks import check_between, check_count, check_kind
from pcjax.design.checkpoint import Progress, Step, keep_progress, load_progress
from pcjax.design.compare import compare, compare_hands
from pcjax.design.estimator import Estimator, Gradient
from pcjax.design.gradients import Differences
from pcjax.design.space import Design, DesignSpace
from pcjax.design.starts import Start, given_start, starting_designs
from pcjax.model.hand import HandDesign
from pcjax.progress import progress_bar
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate
from pcjax.results.files import locked

_REST = 0.15
"""How far, in the parameters' scales, a design at rest moves at most from window to window."""

_CHECKPOINT, _CHOICE, _ACCEPTANCE = 0x10000000, 0x20000000, 0x30000000
"""Added to the seed for the exact checkpoints, the choice among starts, and the acceptance."""

_WINDOW = 6
"""Iterations whose mean designs and values are compared to see whether anything still moves."""


@dataclass(frozen=True)
class Settings:
    """How to optimise.

    Arguments:
        iterations: at most.
        starts: the first from the given hand, the others spread over the space.
        rate: learning rate, in the parameters' scales (10 degrees, 0.1 L_p) an iteration; in the
            second half of the iterations it falls to 0 along a cosine.
        wide: factor on the reach of differences at the beginning; it falls to 1 in the first half.
            Far from the top a wide look is surer of the direction, and its bias does no harm.
        check_every: iterations between exact checkpoints.
        check_trials: trials of each.
        accept_trials: trials of the final comparison.
        seed: of everything.

    Raises:
        ValueError: a number out of range.
    """

    iterations: int = 44
    starts: int = 1
    rate: float = 0.4
    wide: float = 4.0
    check_every: int = 6
    check_trials: int = 1000
    accept_trials: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        check_count("iterations", self.iterations, 1, 100_000)
        check_count("starts", self.starts, 1, 1000)
        check_between("rate", self.rate, 1e-6, 10.0)
        check_between("wide", self.wide, 1.0, 10.0)
        check_count("check_every", self.check_every, 1, 100_000)
        check_count("check_trials", self.check_trials, 2, 2**24)
        check_count("accept_trials", self.accept_trials, 2, 2**24)
        check_count("seed", self.seed, 0, 2**28 - 1)


@dataclass(frozen=True)
class Optimum:
    """What an optimisation found.

    Attributes:
        start: the given hand's design, even if it is not an allowed one; where that hand cannot be
            evaluated, the design that the search began at.
        best: the best design.
        start_score, best_score: exact, on trials that nothing else has used.
        improvement: of the exact score, from the same trials for both.
        candidates: where each start ended, and its exact score on the trials of the choice.
        progress: the whole history.
        trials: simulated in all.
        invalid: how many of them went wrong, and were left out.
        interrupted: whether it was stopped before its end.
        start_hand: the hand of `start`.
        moved: whether `start` is not the given hand's.
        notes: what is wrong with the given hand, a line each.
    """

    start: Design
    best: Design
    start_score: Estimate
    best_score: Estimate
    improvement: Estimate
    candidates: list[tuple[Design, Estimate]]
    progress: Progress
    trials: int
    invalid: int
    interrupted: bool
    start_hand: HandDesign
    moved: bool
    notes: tuple[str, ...]

    @property
    def better(self) -> bool:
        """Whether the result is better than the start for certain (95 %)."""
        return self.improvement.low > 0


def optimize(
    surrogate: Surrogate,
    space: DesignSpace,
    settings: Settings | None = None,
    *,
    estimator: Estimator | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Optimum:
    """Looks for the design with the highest score.

    Arguments:
        surrogate: the relaxed score whose gradient is followed.
        space: what may change; its base hand is the start.
        settings: see `Settings`.
        estimator: of the gradient; `Differences()` unless given.
        checkpoint: a file to keep the state in after every iteration. If it is there already, the
            optimisation goes on from it.
        progress: whether to show a bar on stderr.

    Returns:
        The best design with its exact score, compared with the given hand. Ctrl-C ends the loop
        early and keeps the best so far.

    Warns (`InputWarning`) if the given hand is not an allowed one; the search then begins at one
    near it.

    Raises:
        ValueError: no allowed hand, or a checkpoint file that is damaged, of another optimisation,
            or in use by another process.

    Examples:
        Far too few trials to find anything, but quick:

        >>> import pcjax
        >>> task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
        >>> space = pcjax.design_space(pcjax.box_hand(), ["fingertip_angle_deg"], 50.0)
        >>> settings = pcjax.Settings(iterations=1, accept_trials=32, check_trials=32)
        >>> found = pcjax.optimize(pcjax.Surrogate(task, trials=20), space, settings)
        >>> found.best.shape, found.progress.iteration
        ((1,), 1)
    """
    check_kind("surrogate", surrogate, Surrogate)
    check_kind("space", space, DesignSpace)
    settings = Settings() if settings is None else settings
    estimator = Differences() if estimator is None else estimator
    path = None if checkpoint is None else Path(checkpoint)
    starts = starting_designs(space, settings.starts, settings.seed)
    start = given_start(surrogate, space, starts[0])
    # Shorter memory than usual: a few dozen iterations leave no time to swing back, nor to forget a
    # steep beginning.
    rule = optax.adam(_rate(settings), b1=0.6, b2=0.8)
    fingerprint = _fingerprint(surrogate, space, settings, estimator)
    numbers, count = _numbers(rule.init(jnp.zeros(len(space.free)))), len(starts)
    state = Progress(
        [[] for _ in starts],
        [list(map(float, start)) for start in starts],
        [numbers for _ in range(count)],
        stopped=[False] * count,
    )
    interrupted = False
    with nullcontext() if path is None else locked(path):
        if path is not None and os.path.lexists(path):
            state = load_progress(path, fingerprint, state)
        bar = progress_bar(
            total=settings.iterations,
            initial=state.iteration,
            desc="optimise",
            unit="iteration",
            shown=progress,
        )
        with bar:
            try:
                while state.iteration < settings.iterations and not all(state.stopped):
                    state = _iterate(state, surrogate, space, settings, estimator, rule)
                    if path is not None:
                        keep_progress(path, fingerprint, state)
                    bar.update()
                    last = [steps[-1] for steps in state.history]
                    bar.set_postfix_str(f"score {math.exp(max(s.value for s in last)):.4g}")
            except KeyboardInterrupt:
                interrupted = True
    ends = [
        settled_design(space, steps, design)
        for steps, design in zip(state.history, state.designs, strict=True)
    ]
    return accept(ends, state, start, surrogate, space, settings, interrupted=interrupted)


def _rate(settings: Settings) -> optax.Schedule:
    half = settings.iterations // 2
    fall = optax.cosine_decay_schedule(settings.rate, max(settings.iterations - half, 1))
    return optax.join_schedules([optax.constant_schedule(settings.rate), fall], [half])


def _looking_wide(estimator: Estimator, settings: Settings, iteration: int) -> Estimator:
    """The estimator for an iteration: differences reach farther at the beginning."""
    left = max(0.0, 1.0 - 2.0 * iteration / settings.iterations)
    return estimator.reaching(settings.wide**left)


def _iterate(
    state: Progress,
    surrogate: Surrogate,
    space: DesignSpace,
    settings: Settings,
    estimator: Estimator,
    rule: optax.GradientTransformation,
) -> Progress:
    """The state after one more iteration of every start that still moves."""
    began = time.perf_counter()
    k, trials, invalid = state.iteration, state.trials, state.invalid
    going = [n for n, stopped in enumerate(state.stopped) if not stopped]
    at = [np.array(state.designs[n]) for n in going]
    look = _looking_wide(estimator, settings, k)
    found = look(surrogate, space, at, settings.seed + k)
    exact = None
    if k % settings.check_every == 0:
        exact = compare(
            surrogate,
            space,
            at,
            trials=settings.check_trials,
            seed=settings.seed + _CHECKPOINT,
        )
        trials += exact.trials * len(at) * len(surrogate.task.directions)
        invalid += exact.invalid
    invalid += max(gradient.invalid for gradient in found)  # of a batch that shares its trials
    reach = max(float(np.asarray(_rate(settings)(k))), 0.01)
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
        designs[n], numbers[n] = _moved(rule, space, design, way, numbers[n])
        stopped[n] = at_rest(history[n], space.scales)
        trials += gradient.trials
    seconds = state.seconds + time.perf_counter() - began
    return Progress(history, designs, numbers, trials, seconds, invalid, stopped)


def _moved(
    rule: optax.GradientTransformation,
    space: DesignSpace,
    design: Design,
    way: Design,
    numbers: list[Any],
) -> tuple[list[float], list[Any]]:
    """The next design and optax's state, by a step on the way uphill, in the parameters' scales."""
    like = rule.init(jnp.zeros(len(design)))
    state = jax.tree.unflatten(
        jax.tree.structure(like),
        [
            jnp.asarray(n, leaf.dtype)
            for n, leaf in zip(numbers, jax.tree.leaves(like), strict=True)
        ],
    )
    with jax.numpy_dtype_promotion("standard"):  # optax mixes floats and counts
        updates, state = rule.update(jnp.asarray(-way), state)
    moved = space.nearest_allowed(design + np.asarray(updates) * space.scales, design)
    return list(map(float, moved)), _numbers(state)


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


def accept(
    ends: Sequence[Design],
    state: Progress,
    start: Start,
    surrogate: Surrogate,
    space: DesignSpace,
    settings: Settings,
    *,
    interrupted: bool = False,
) -> Optimum:
    """Chooses among the ends and compares the choice with the start, on trials of their own."""
    choice = compare(
        surrogate,
        space,
        ends,
        trials=settings.accept_trials,
        seed=settings.seed + _CHOICE,
    )
    best = ends[choice.best]
    final = compare_hands(
        surrogate,
        [start.hand, space.hand(best)],
        trials=settings.accept_trials,
        seed=settings.seed + _ACCEPTANCE,
    )
    return Optimum(
        start.design,
        best,
        final.scores[0],
        final.scores[1],
        final.improvement(0, 1),
        list(zip(ends, choice.scores, strict=True)),
        state,
        state.trials + (len(ends) + 2) * settings.accept_trials * len(surrogate.task.directions),
        state.invalid + choice.invalid + final.invalid,
        interrupted,
        start.hand,
        start.moved,
        start.notes,
    )


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


def _fingerprint(
    surrogate: Surrogate, space: DesignSpace, settings: Settings, estimator: Estimator
) -> str:
    """Everything that an optimisation depends on, as text."""
    return "\n".join(repr(part) for part in (surrogate, space, settings, estimator))
