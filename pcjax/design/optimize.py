"""The design loop: from a task, and what may change of a hand, to a better one."""

from __future__ import annotations

import os
from collections.abc import Callable

from pcjax.checks import check_kind
from pcjax.design.checkpoint import Progress
from pcjax.design.estimator import Estimator
from pcjax.design.modelled import search_model
from pcjax.design.outcome import Optimum, Settings
from pcjax.design.search import search_cma, search_grid
from pcjax.design.space import DesignSpace, Space
from pcjax.quality.surrogate import Surrogate


def optimize(
    surrogate: Surrogate,
    space: Space,
    settings: Settings | None = None,
    *,
    estimator: Estimator | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool = False,
    watch: Callable[[Progress], bool] | None = None,
) -> Optimum:
    """Looks for the design with the highest score.

    The method is "model" unless the settings say otherwise: a model of the exact score that learns
    from every design that was tried (`pcjax.design.modelled`). "gradient" follows the relaxed
    score's gradient by optax, "grid" tries all designs on a grid, "cma" is CMA-ES.

    Arguments:
        surrogate: whose task and objective count. The model begins with a quarter of its trials for
            a design and direction, and goes up to twice as many; gradients are of its form.
        space: what may change; its base hand is the start.
        settings: see `Settings`.
        estimator: for the method "gradient"; `Differences()` unless given.
        checkpoint: for "model" and "gradient": a file to keep the state in after every iteration.
            If it is there already, the optimisation goes on from it.
        progress: whether to show a bar on stderr.
        watch: for "model" and "gradient": told where the search is after every iteration; the
            search ends where it returns True.

    Returns:
        The best design with its exact score, compared with the given hand. Ctrl-C ends the loop
        early and keeps the best so far.

    Warns (`InputWarning`) if the given hand is not an allowed one; the search then begins at one
    near it.

    Raises:
        ValueError: no allowed hand, an estimator, a checkpoint or a `watch` for a method that has
            none, or a checkpoint file that is damaged, of another optimisation, or in use by
            another process.

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
    check_kind("space", space, Space)
    settings = Settings() if settings is None else settings
    method = settings.method
    if estimator is not None and method != "gradient":
        raise ValueError(f"an estimator is for method 'gradient', and this is {method!r}")
    if checkpoint is not None and method not in ("model", "gradient"):
        raise ValueError(f"a checkpoint is for methods 'model' and 'gradient', not {method!r}")
    if watch is not None and method not in ("model", "gradient"):
        raise ValueError(f"only methods 'model' and 'gradient' can be watched, not {method!r}")
    if method == "gradient" and space.why_no_gradient:
        raise ValueError(f"method 'gradient' is not for these hands: {space.why_no_gradient}")
    watched = watch or (lambda state: False)
    if method == "gradient":
        from pcjax.design.ascent import search_gradient  # optax takes half a second to import

        assert isinstance(space, DesignSpace)
        return search_gradient(
            surrogate,
            space,
            settings,
            estimator=estimator,
            checkpoint=checkpoint,
            progress=progress,
            watch=watched,
        )
    if method == "grid":
        return search_grid(surrogate, space, settings, progress=progress)
    if method == "cma":
        return search_cma(surrogate, space, settings, progress=progress)
    return search_model(
        surrogate, space, settings, checkpoint=checkpoint, progress=progress, watch=watched
    )
