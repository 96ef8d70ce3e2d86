"""Pictures: a hand with its survival curves, and the paper's figures with error bands."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.importing import named
from pcjax.physics.state import PAPER_DT
from pcjax.results.evaluation import Evaluation
from pcjax.results.schema import KINDS, NAMES, length_unit_of
from pcjax.study.compare import Ranking
from pcjax.view.dimension import draw_gap
from pcjax.view.picture import Picture
from pcjax.view.shapes import COLOURS, draw_limbs, draw_object, name_axes

_Z95 = 1.96
_DIRECTION_COLOUR = {"does": COLOURS[0], "eoen": COLOURS[1]}


def plot_evaluation(evaluation: Evaluation) -> Figure:
    """The hand in each direction evaluated, drawn to scale, beside the survival curves."""
    hands = _hands_of(evaluation)
    figure = Picture(figsize=(4.2 * len(hands) + 5.2, 4.4), layout="constrained")
    axes = figure.subplots(
        1, len(hands) + 1, width_ratios=[1.0] * len(hands) + [1.25], squeeze=False
    )[0]
    for axis, draw in zip(axes, hands.values(), strict=False):
        draw(axis)
    draw_survival(axes[-1], evaluation)
    return figure


def _hands_of(evaluation: Evaluation) -> dict[str, Callable[[Axes], Any]]:
    """What draws the hand, in each direction that was evaluated in which it can be drawn."""
    return named(KINDS[evaluation.dataset.attrs["kind"]].hands_drawn_by)(evaluation)


def hands_of(evaluation: Evaluation) -> dict[str, Callable[[Axes], Any]]:
    """See `pcjax.results.schema.Kind`: of a hand in the plane."""
    return {
        direction: partial(draw_hand, evaluation=evaluation, direction=direction)
        for direction in evaluation.directions
    }


def plot_ranking(ranking: Ranking) -> Figure:
    """The hands side by side, the best first, each with what it is ranked by."""
    names = ranking.names
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    figure = Picture(figsize=(4.0 * columns, 4.4 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    form, unit = (".4g", "") if ranking.by == "score" else (",.0f", " steps")
    for axis in axes[len(names) :]:
        axis.set_axis_off()
    for place, (axis, name) in enumerate(zip(axes, names, strict=False), start=1):
        hands = _hands_of(ranking.evaluations[name])
        for draw in list(hands.values())[:1]:
            draw(axis)
        if not hands:
            axis.set_axis_off()
        value = ranking.value(name)
        what = "score" if ranking.by == "score" else "DoEs"
        estimate = f"{what} {value.value:{form}} [{value.low:{form}}, {value.high:{form}}]{unit}"
        axis.set_title(f"{place}. {name}\n{estimate}", fontsize=10)
    return figure


def draw_hand(axis: Axes, evaluation: Evaluation, direction: str) -> None:
    """The limbs, the gap, the goal line and the object at a start, to scale."""
    data = evaluation.dataset.sel(direction=direction)
    units = length_unit_of(data)
    for x0, y0, x1, y1 in data.limbs.values:
        draw_limbs(axis, np.array([[x0, y0], [x1, y1]]), float(data.attrs["thickness"]))
    ax, ay, bx, by = data.goal.values
    axis.plot([ax, bx], [ay, by], color=COLOURS[2], ls="--", lw=1.5, label="goal line")
    draw_object(
        axis,
        data.outline.values,
        float(data.outline.attrs["rounding"]),
        colour=_DIRECTION_COLOUR[direction],
        label="object",
    )
    x0, y0, x1, y1 = data.passage.values
    draw_gap(axis, np.array([[x0, y0], [x1, y1]]), float(data.gap), units)
    axis.set_aspect("equal")
    axis.margins(0.08)
    axis.set_title(
        f"{NAMES[direction]}: " + ("escape from inside" if direction == "does" else "enter")
    )
    name_axes(axis, units)
    axis.legend(loc="center", fontsize=9, frameon=False)


def draw_survival(axis: Axes, evaluation: Evaluation) -> None:
    """Share of trials still held against time, with 95 % bands."""
    limit, n = evaluation.max_steps, evaluation.trials
    for direction in evaluation.directions:
        steps, left = evaluation.survival(direction)
        steps, left = np.append(steps, limit), np.append(left, left[-1])
        band = _Z95 * np.sqrt(left * (1 - left) / n)
        colour = _DIRECTION_COLOUR[direction]
        indices = evaluation.indices(direction)
        axis.step(
            steps * PAPER_DT,
            left,
            where="post",
            color=colour,
            label=f"{NAMES[direction]}: index 1 = {indices['index1'].value:,.0f} steps, "
            f"index 2 = {indices['index2'].value:.3f}",
        )
        axis.fill_between(
            steps * PAPER_DT, left - band, left + band, step="post", color=colour, alpha=0.2, lw=0
        )
    axis.set(
        xlabel="time [s]",
        ylabel="share of trials still held",
        ylim=(0, 1.02),
        xlim=(0, limit * PAPER_DT),
    )
    title = f"{n:,} trials a direction, 95 % bands"
    if len(evaluation.directions) == 2:
        score = evaluation.score()["index1"]
        title = f"score {score.value:.3f} [{score.low:.3f}, {score.high:.3f}], " + title
    axis.set_title(title, fontsize=10)
    axis.legend(loc="lower left", fontsize=9)
    axis.grid(alpha=0.3)
