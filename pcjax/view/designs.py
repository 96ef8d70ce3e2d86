"""Pictures of designs: an optimisation's hands, history and path, and maps of the score."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Rectangle
from matplotlib.ticker import MaxNLocator

from pcjax.design.compare import compare
from pcjax.design.map import FINE, score_name
from pcjax.design.outcome import Optimum
from pcjax.design.space import DesignSpace
from pcjax.importing import xr
from pcjax.model.bodies.base import placed_outline
from pcjax.model.hand import points_of
from pcjax.quality.surrogate import Surrogate
from pcjax.results.schema import NAMES, length_unit_of, place_of
from pcjax.study.inspect import Inspection
from pcjax.units import length_in_words
from pcjax.view.contours import draw_contours
from pcjax.view.dimension import draw_gap
from pcjax.view.labels import axis_label, length_text, score_label
from pcjax.view.picture import Picture
from pcjax.view.shapes import COLOURS, draw_limbs, draw_object, name_axes

_Z95 = 1.96
_MAP = 11
"""Designs along each side of a score map."""
_MAP_TRIALS = 400
"""Trials for each of them at most; as many as the search took for a hand where that is fewer."""


def plot_optimum(data: tuple[Optimum, DesignSpace, Surrogate]) -> Figure:
    """The hand before and after, the scores along the way, and for two parameters the path."""
    found, space, surrogate = data
    pair = len(space.free) == 2
    figure = Picture(figsize=(14.5 if pair else 10, 4.4), layout="constrained")
    axes = figure.subplots(1, 3 if pair else 2, width_ratios=[1, 1.25, 1.25][: 3 if pair else 2])
    draw_hands(axes[0], found, space, surrogate)
    draw_history(axes[1], found, surrogate)
    if pair:
        draw_map(axes[2], found, space, surrogate)
    return figure


def plot_history(found: Optimum) -> Figure:
    """The scores along the way, of what is all that an optimum knows without its space."""
    figure = Picture(figsize=(6.4, 4.4), layout="constrained")
    _draw_history(figure.subplots(), found, "score")
    return figure


def plot_inspection(found: Inspection) -> Figure:
    """The hand in each direction that can be run, with the box of starts and the object in it, in
    the circle in which it can turn."""
    views = {d: view for d, view in found.views.items() if view.gap is not None}
    figure = Picture(figsize=(5.0 * max(len(views), 1), 4.6), layout="constrained")
    axes = figure.subplots(1, max(len(views), 1), squeeze=False)[0]
    study = found.study
    for axis, direction in zip(axes, views or ["does"], strict=True):
        hand, body = study.hand, study.body
        if direction == "eoen":
            hand, body = hand.with_fingertips_mirrored(), body.mirrored()
        draw_limbs(axis, points_of(hand), float(hand.thickness))
        with jax.enable_x64(True):
            goal = jax.device_get(hand.goal())
        axis.plot([goal.a.x, goal.b.x], [goal.a.y, goal.b.y], color=COLOURS[2], ls="--", lw=1.5)
        axis.set_aspect("equal")
        axis.margins(0.08)
        name_axes(axis, study.units)
        view = found.views[direction]
        if view.starts is None or view.gap is None or view.passage is None:
            axis.set_title(f"{NAMES[direction]}: cannot be run")
            continue
        for (x0, y0), (x1, y1) in view.starts:
            axis.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fc="0.9", ec="0.6", zorder=0))
        (x0, y0), _ = view.starts[0]
        draw_object(axis, *placed_outline(body, np.array([x0, y0])))
        if body.oriented:
            around = Circle((x0, y0), float(body.radius), fill=False, ls=":", ec="0.4", zorder=4)
            axis.add_patch(around)
        draw_gap(axis, np.array(view.passage), view.gap, study.units)
        width = length_text(found.width, study.units)
        axis.set_title(f"{NAMES[direction]}: the object needs {width}")
    return figure


def draw_hands(axis: Axes, found: Optimum, space: DesignSpace, surrogate: Surrogate) -> None:
    """The limbs before (grey) and after, with the object at a start, to scale."""
    start = "moved start" if found.moved else "start"
    for hand, score, colour, name in (
        (found.start_hand, found.start_score, "0.6", start),
        (space.hand(found.best), found.best_score, COLOURS[0], "best"),
    ):
        draw_limbs(
            axis,
            points_of(hand),
            float(hand.thickness),
            colour=colour,
            width=2.2,
            label=f"{name}: {score.value:,.4g}",
        )
    scenario = surrogate.task.scenarios(space.hand(found.best))[0]
    centre, body = jax.device_get(scenario.corner_start()), scenario.body
    draw_object(axis, *placed_outline(body, np.array([centre.x, centre.y], float)))
    axis.set_aspect("equal")
    axis.margins(0.08)
    name_axes(axis, surrogate.task.units)
    axis.set_title("hand")
    axis.legend(loc="center", fontsize=9, frameon=False)


def draw_history(axis: Axes, found: Optimum, surrogate: Surrogate) -> None:
    """Scores that the search saw with 95 % bands, exact checkpoints, and the final comparison."""
    _draw_history(axis, found, score_label(score_name(surrogate)))


def _draw_history(axis: Axes, found: Optimum, label_of_score: str) -> None:
    last = 1
    for n, steps in enumerate(found.progress.history):
        colour = COLOURS[0] if len(found.progress.history) == 1 else f"C{n % 10}"
        k = np.arange(len(steps))
        logs = np.array([step.value for step in steps])
        errors = _Z95 * np.array([step.value_se for step in steps])
        label = "seen by the search, fresh trials each"
        if len(found.tried):
            label = "the best so far, as the model believes"
        label = label if n == 0 else None
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
    gain = found.improvement
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.set(
        xlabel="iteration",
        ylabel=label_of_score,
        title=f"improvement {gain.value:.3g} [{gain.low:.3g}, {gain.high:.3g}]",
    )
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def draw_map(axis: Axes, found: Optimum, space: DesignSpace, surrogate: Surrogate) -> None:
    """The exact score over two parameters, and the way of each start."""
    # With room for the object: a trial that goes wrong counts for no hand.
    space = space.holding(surrogate.task)
    xs, ys = (np.linspace(p.low, p.high, _MAP) for p in space.free)
    grid = [space.nearest_allowed(np.array([x, y]), found.best) for y in ys for x in xs]
    rough = replace(surrogate, contact_layer=0.0)
    trials = min(surrogate.trials, _MAP_TRIALS)
    score = np.exp(compare(rough, space, grid, trials=trials, seed=0).logs)
    fine = [np.linspace(p.low, p.high, FINE) for p in space.free]
    gaps, possible = space.look(np.stack(np.meshgrid(*fine), axis=-1))
    least = space.least_gap(1.0)
    label, covered = score_label(score_name(surrogate)), (fine, (gaps < least) | ~possible)
    draw_contours(axis, xs, ys, score.reshape(_MAP, _MAP), label, covered, found.best[None])
    _draw_regions(axis, fine, gaps, possible, least, hatched=False)
    _name_parameters(axis, [p.label for p in space.free], surrogate.task.units, {})
    if len(found.tried):
        axis.plot(*np.transpose(found.tried), ".", color="black", ms=3, alpha=0.6, zorder=3)
    for n, steps in enumerate(found.progress.history):
        way = np.array([step.design for step in steps] + [found.candidates[n].design])
        axis.plot(*way.T, ".-", color="white", lw=1, ms=5, mec="black", mew=0.4, zorder=3)
    axis.plot(*found.best, "*", color=COLOURS[1], ms=14, mec="white", zorder=4)
    others = [one.design for one in found.candidates if one.design is not found.best]
    if others and len(found.tried):
        axis.plot(*np.transpose(others), "o", mfc="none", mec=COLOURS[1], mew=1.5, ms=8, zorder=4)
    shown = "dots: tried; line: the best so far" if len(found.tried) else "path"
    axis.set(title=f"{shown}; grey: not allowed")


def plot_map(dataset: xr.Dataset) -> Figure:
    """A map from `pcjax.score_map` with the current hand; hatched: hands without a score."""
    figure = Picture(figsize=(7.4, 5.6), layout="constrained")
    axis = figure.subplots()
    labels = [str(label) for label in reversed(place_of(dataset))]
    estimates = dataset.score.isel(index=0)
    score, errors = (estimates.sel(statistic=name).values for name in ("value", "se"))
    xs, ys = (dataset[label].values for label in labels)
    attrs = dataset.attrs
    fine = "_fine" if "gap_fine" in dataset else ""  # earlier maps have the coarse grid alone
    units = {label: dataset[label].attrs.get("units") for label in labels}
    if "object_width" in attrs and not any(units.values()):
        gaps, least = dataset[f"gap{fine}"].values, float(attrs["object_width"])
    else:  # from a table, or of several objects: it says only where there is a full cage
        gaps, least = np.where(dataset.full_cage.values, 0.0, 1.0), 0.5
    possible = dataset[f"possible{fine}"].values
    lines = [dataset[f"{label}{fine}"].values for label in labels]
    covered = (lines, (gaps < least) | ~possible)
    row, column = np.unravel_index(np.nanargmax(score), score.shape)
    points = {"best": (xs[column], ys[row])}
    if "current_score" in attrs:
        points["current"] = tuple(attrs[f"current_{label}"] for label in labels)
    name = score_label(attrs["score_name"])
    draw_contours(axis, xs, ys, score, name, covered, np.array(list(points.values())))
    handles = _draw_regions(axis, lines, gaps, possible, least, hatched=True)
    open_ones = dataset.possible.values & ~dataset.full_cage.values
    unknown = np.where(open_ones & np.isnan(score), 0.0, 1.0)
    handles += _draw_region(axis, (xs, ys), unknown, 0.5, "0.95", "..", "a score that is undefined")
    _name_parameters(axis, labels, length_unit_of(dataset), units)
    known = {
        "best": (score[row, column], float(errors[row, column])),
        "current": (attrs.get("current_score", np.nan), attrs.get("current_se", np.nan)),
    }
    for name, place in points.items():
        value, se = known[name]
        label = f"{name} hand: {value:,.4g} ± {se:.2g}" if np.isfinite(value) else f"{name} hand"
        marker, size = ("*", 15) if name == "current" else ("o", 8)
        style = {"mfc": COLOURS[1], "mec": "white", "ms": size, "zorder": 4}
        handles += axis.plot(*place, marker, ls="none", label=label, clip_on=False, **style)
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=9, frameon=False)
    parts = [f"{attrs['hands']:,} hands"]
    if "trials" in attrs:
        parts += [f"{attrs['trials']:,} trials a direction", f"limit {attrs['max_steps']:,} steps"]
    axis.set_title(", ".join(parts), fontsize=10)
    return figure


def _draw_regions(
    axis: Axes,
    fine: Sequence[np.ndarray],
    gaps: np.ndarray,
    possible: np.ndarray,
    least: float,
    *,
    hatched: bool,
) -> list[Patch]:
    """Covers the hands whose gap is below `least` and those that cannot be."""
    handles = []
    for values, edge, colour, hatch, label in (
        (gaps, least, "0.9", "//", "full cage: the gap is narrower than the object"),
        (np.where(possible, 1.0, 0.0), 0.5, "0.75", "xx", "limbs cross or overlap, or no room"),
    ):
        handles += _draw_region(axis, fine, values, edge, colour, hatch if hatched else None, label)
    return handles


def _draw_region(
    axis: Axes,
    lines: Sequence[np.ndarray],
    values: np.ndarray,
    edge: float,
    colour: str,
    hatch: str | None,
    label: str,
) -> list[Patch]:
    """Covers where the values are below an edge; and its entry for the legend, if it is there."""
    if not np.any(values < edge):
        return []
    # Above the score's lines and their labels, below the paths.
    axis.contourf(*lines, values, [-1.0, edge], colors=colour, hatches=[hatch], zorder=2.2)
    axis.contour(*lines, values, [edge], colors="0.3", linewidths=1, zorder=2.3)
    return [Patch(fc=colour, ec="0.3", hatch=hatch, label=label)]


def _name_parameters(
    axis: Axes, labels: Sequence[str], units: str, others: Mapping[str, str | None]
) -> None:
    """Parameters' labels in words; `others` has the units of those that are not the hand's, which
    are all lengths but for the angles."""
    x, y = (axis_label(label, others.get(label) or length_in_words(units)) for label in labels)
    axis.set(xlabel=x, ylabel=y)
