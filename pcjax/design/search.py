"""Ways to look for a better hand that use no gradient: an exhaustive grid, and CMA-ES.

Evolution strategies are the design loop with gaussian differences of the exact score:
`optimize(replace(surrogate, form="exact"), space, Settings("gradient"),
estimator=Differences("gaussian"))`.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pcjax.checks import check_between, check_count
from pcjax.design.checkpoint import Progress, Step
from pcjax.design.compare import compare, score_all
from pcjax.design.outcome import Optimum, Settings, accept
from pcjax.design.space import Design, Space
from pcjax.design.starts import given_start, starting_designs
from pcjax.progress import progress_bar
from pcjax.quality.surrogate import Surrogate

_MOST_DESIGNS = 100_000
"""Of a grid."""

_GENERATIONS = 44
"""Of CMA-ES at most, unless given."""


@runtime_checkable
class _Bounded(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...


def grid_lines(
    free: Sequence[_Bounded], points: Sequence[int] | None = None
) -> list[Float[np.ndarray, " _"]]:
    """Values of each parameter, from bound to bound, whose combinations are a grid's designs.

    Arguments:
        free: the parameters.
        points: along each parameter; 11 each unless given.

    Raises:
        ValueError: a grid too large.
    """
    points = [11] * len(free) if points is None else list(points)
    for p, count in zip(free, points, strict=True):
        check_count(f"grid points of {p.name}", count, 1, _MOST_DESIGNS)
    total = int(np.prod(points))
    check_count("designs on the grid", total, 1, _MOST_DESIGNS)
    return [np.linspace(p.low, p.high, count) for p, count in zip(free, points, strict=True)]


def search_grid(
    surrogate: Surrogate,
    space: Space,
    settings: Settings,
    points: Sequence[int] | None = None,
    *,
    progress: bool = False,
) -> Optimum:
    """The exact score of all allowed designs on a grid over the bounds.

    Arguments:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: what may change.
        settings: for the seed and the final comparison.
        points: along each parameter; 11 each unless given.
        progress: whether to show a bar on stderr.

    Raises:
        ValueError: a grid too large, or without an allowed design.
    """
    space = space.holding(surrogate.task)
    designs = np.array(list(itertools.product(*grid_lines(space.free, points))))
    allowed = list(designs[space.which(designs)])
    if not allowed:
        raise ValueError("no design on the grid is allowed: take more points, or other bounds")
    (begun,) = starting_designs(space, 1, settings.seed)
    start = given_start(surrogate, space, begun)
    began = time.perf_counter()
    with progress_bar(total=len(allowed), desc="designs", unit="design", shown=progress) as bar:
        each = surrogate.task.scenarios_of(list(map(space.hand, allowed)))
        scores, invalid = score_all(surrogate, each, seed=settings.seed, on_done=bar.update)
    values = np.array([score.value for score in scores])
    if np.isnan(values).all():
        raise ValueError(
            "no design on the grid has a score: no trial escapes, or none is held to the limit "
            "from outside; take more trials, another limit, or objective index1"
        )
    best = allowed[int(np.nanargmax(values))]
    spent = Progress(
        [],
        [],
        [],
        len(allowed) * surrogate.trials * surrogate.task.runs,
        time.perf_counter() - began,
        invalid,
    )
    return accept([[best]], spent, start, surrogate, space, settings)


def search_cma(
    surrogate: Surrogate,
    space: Space,
    settings: Settings,
    *,
    enough: Callable[[], bool] = lambda: False,
    sigma: float = 1.0,
    progress: bool = False,
) -> Optimum:
    """CMA-ES on the exact score, for `settings.iterations` generations.

    Every generation has trials of its own, the same for all its designs; one that is not allowed is
    replaced by the nearest that is.

    Arguments:
        surrogate: whose task, objective and trials count; nothing is relaxed.
        space: what may change; its base hand is the start.
        settings: for generations, seed and the final comparison.
        enough: asked after each generation whether to end the search.
        sigma: first step size, in the parameters' scales.
        progress: whether to show a bar on stderr.

    Raises:
        ValueError: the package `cmaes` is not installed, or a number out of range.
    """
    try:
        from cmaes import CMA
    except ImportError:
        raise ValueError("CMA-ES needs the package cmaes: pip install 'pcjax[baselines]'") from None
    check_between("sigma", sigma, 1e-6, 100.0)
    space = space.holding(surrogate.task)
    (begun,) = starting_designs(space, 1, settings.seed)
    start = given_start(surrogate, space, begun)
    search = CMA(
        mean=begun / space.scales,
        sigma=sigma,
        bounds=np.stack([space.low, space.high], axis=1) / space.scales[:, None],
        seed=settings.seed,
    )
    generations = settings.iterations or _GENERATIONS
    began, trials, invalid = time.perf_counter(), 0, 0
    history: list[Step] = []
    bar = progress_bar(
        total=generations,
        desc="CMA-ES",
        unit="generation",
        shown=progress,
    )
    interrupted = False
    with bar:
        try:
            for generation in range(generations):
                middle = list(map(float, search.mean * space.scales))
                asked = [search.ask() for _ in range(search.population_size)]
                designs = [space.nearest_allowed(x * space.scales, begun) for x in asked]
                found = compare(
                    surrogate,
                    space,
                    designs,
                    trials=surrogate.trials,
                    seed=settings.seed + generation,
                )
                trials += len(designs) * surrogate.trials * surrogate.task.runs
                invalid += found.invalid
                search.tell(
                    [(d / space.scales, -v) for d, v in zip(designs, found.logs, strict=True)]
                )
                value, error = float(np.mean(found.logs)), math.sqrt(np.mean(found.covariance))
                history.append(Step(middle, value, error, [], []))
                bar.update()
                if enough() or search.should_stop():
                    break
        except KeyboardInterrupt:
            interrupted = True
    end: Design = space.nearest_allowed(search.mean * space.scales, begun)
    spent = Progress([history], [], [], trials, time.perf_counter() - began, invalid)
    return accept([[end]], spent, start, surrogate, space, settings, interrupted=interrupted)
