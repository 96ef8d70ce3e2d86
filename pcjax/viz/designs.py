"""Pictures of an optimisation: the hands before and after, the history, the path over a map."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.design.compare import compare
from pcjax.design.optimize import Optimum
from pcjax.design.space import DesignSpace
from pcjax.model.body import Stick
from pcjax.model.hand import points_of
from pcjax.quality.surrogate import Surrogate
from pcjax.viz.shapes import COLOURS, draw_object

_Z95 = 1.96
_MAP = 11
"""Designs along each side of a score map."""
_MAP_TRIALS = 400
_FINE = 121
"""Points along each side for the edge of what is allowed."""


def plot_optimum(data: tuple[Optimum, DesignSpace, Surrogate]) -> Figure:
    """The hand before and after, the scores along the way, and for two parameters the path."""
    found, space, surrogate = data
    pair = len(space.free) == 2
    figure = Figure(figsize=(14.5 if pair else 10, 4.4), layout="constrained")
    axes = figure.subplots(1, 3 if pair else 2, width_ratios=[1, 1.25, 1.25][: 3 if pair else 2])
    draw_hands(axes[0], found, space, surrogate)
    draw_history(axes[1], found, surrogate)
    if pair:
        draw_map(axes[2], found, space, surrogate)
    return figure


def draw_hands(axis: Axes, found: Optimum, space: DesignSpace, surrogate: Surrogate) -> None:
    """The limbs before (grey) and after, with the object at a start, to scale."""
    for design, score, colour, name in (
        (found.start, found.start_score, "0.6", "start"),
        (found.best, found.best_score, COLOURS[0], "best"),
    ):
        axis.plot(
            *points_of(space.hand(design)).T,
            color=colour,
            lw=2.2,
            solid_capstyle="round",
            solid_joinstyle="round",
            label=f"{name}: {score.value:,.4g}",
        )
    scenario = surrogate.task.scenarios(space.hand(found.best))[0]
    centre, body = jax.device_get(scenario.corner_start()), scenario.body
    angle = float(body.orientation) if isinstance(body, Stick) else None
    draw_object(axis, (centre.x, centre.y), float(body.radius), angle)
    axis.set_aspect("equal")
    axis.margins(0.08)
    axis.set(xlabel="x [model length]", ylabel="y [model length]", title="hand")
    axis.legend(loc="center", fontsize=9, frameon=False)


def draw_history(axis: Axes, found: Optimum, surrogate: Surrogate) -> None:
    """Relaxed scores with 95 % bands, exact checkpoints, and the final exact comparison."""
    last = 1
    for n, steps in enumerate(found.progress.history):
        colour = COLOURS[0] if len(found.progress.history) == 1 else f"C{n % 10}"
        k = np.arange(len(steps))
        logs = np.array([step.value for step in steps])
        errors = _Z95 * np.array([step.value_se for step in steps])
        label = "relaxed, fresh trials each" if n == 0 else None
        axis.plot(k, np.exp(logs), "-", color=colour, lw=1.2, label=label)
        axis.fill_between(k, np.exp(logs - errors), np.exp(logs + errors), color=colour, alpha=0.15)
        checks = [(i, s.exact, s.exact_se) for i, s in enumerate(steps) if s.exact is not None]
        if checks:
            i, value, se = np.array(checks, float).T
            axis.errorbar(
                i,
                value,
                _Z95 * se,
                fmt="o",
                color=colour,
                capsize=3,
                label="exact checkpoints" if n == 0 else None,
            )
        last = max(last, len(steps))
    for x, score, name in ((0, found.start_score, "start"), (last, found.best_score, "best")):
        band = [[score.value - score.low], [score.high - score.value]]
        axis.errorbar(
            x,
            score.value,
            band,
            fmt="s",
            color=COLOURS[1],
            capsize=4,
            label="exact, unseen trials" if name == "start" else None,
        )
    what = "DoEs / EoEn" if len(surrogate.task.directions) == 2 else "DoEs"
    gain = found.improvement
    axis.set(
        xlabel="iteration",
        ylabel=f"{what} by {surrogate.objective}",
        title=f"improvement {gain.value:.3g} [{gain.low:.3g}, {gain.high:.3g}]",
    )
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def draw_map(axis: Axes, found: Optimum, space: DesignSpace, surrogate: Surrogate) -> None:
    """The exact score over two parameters, and the way of each start."""
    xs, ys = (np.linspace(p.low, p.high, _MAP) for p in space.free)
    grid = [space.nearest_allowed(np.array([x, y]), found.best) for y in ys for x in xs]
    rough = replace(surrogate, contact_layer=0.0)
    logs = compare(rough, space, grid, trials=_MAP_TRIALS, seed=0).logs
    score = np.exp(logs).reshape(_MAP, _MAP)
    filled = axis.contourf(xs, ys, score, 12, cmap="viridis")
    axis.figure.colorbar(filled, ax=axis, label="exact score")
    fine = [np.linspace(p.low, p.high, _FINE) for p in space.free]
    designs = np.stack(np.meshgrid(*fine), axis=-1)
    gaps = jax.jit(jax.vmap(jax.vmap(lambda design: space.hand(design).gap())))(designs)
    allowed = [[space.allowed(np.array([x, y])) for x in fine[0][::8]] for y in fine[1][::8]]
    if not np.all(allowed):
        least = space.least_gap(1.0)
        axis.contourf(*fine, gaps, [-1.0, least], colors="0.9")
        axis.contour(*fine, gaps, [least], colors="0.3", linewidths=1)
    for n, steps in enumerate(found.progress.history):
        way = np.array([step.design for step in steps] + [found.candidates[n][0]])
        axis.plot(*way.T, ".-", color="white", lw=1, ms=5, mec="black", mew=0.4)
    axis.plot(*found.best, "*", color=COLOURS[1], ms=14, mec="white")
    names = [p.name.replace("_", " ") + (" [deg]" if p.unit else "") for p in space.free]
    axis.set(xlabel=names[0], ylabel=names[1], title="path; grey: not allowed")
