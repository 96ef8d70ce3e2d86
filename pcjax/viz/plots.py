"""Pictures: a hand with its survival curves, and the paper's figures with error bands."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax import paper
from pcjax.comparison import Ranking
from pcjax.figures import Curve, curve, score_curve
from pcjax.results import NAMES, Evaluation, engines_text
from pcjax.viz.shapes import COLOURS, draw_object

_Z95 = 1.96
_DIRECTION_COLOUR = {"does": COLOURS[0], "eoen": COLOURS[1]}


def plot_evaluation(evaluation: Evaluation) -> Figure:
    """The hand in each direction evaluated, drawn to scale, beside the survival curves."""
    directions = evaluation.directions
    figure = Figure(figsize=(4.2 * len(directions) + 5.2, 4.4), layout="constrained")
    axes = figure.subplots(
        1, len(directions) + 1, width_ratios=[1.0] * len(directions) + [1.25], squeeze=False
    )[0]
    for axis, direction in zip(axes, directions, strict=False):
        draw_hand(axis, evaluation, direction)
    draw_survival(axes[-1], evaluation)
    return figure


def plot_ranking(ranking: Ranking) -> Figure:
    """The hands side by side, the best first, each with what it is ranked by."""
    names = ranking.names
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(4.0 * columns, 4.4 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    form = ".4g" if ranking.by == "score" else ",.0f"
    for axis in axes[len(names) :]:
        axis.set_axis_off()
    for place, (axis, name) in enumerate(zip(axes, names, strict=False), start=1):
        draw_hand(axis, ranking.evaluations[name], ranking.evaluations[name].directions[0])
        value = ranking.value(name)
        what = "score" if ranking.by == "score" else "DoEs"
        told = f"{what} {value.value:{form}} [{value.low:{form}}, {value.high:{form}}]"
        axis.set_title(f"{place}. {name}\n{told}", fontsize=10)
    return figure


def draw_hand(axis: Axes, evaluation: Evaluation, direction: str) -> None:
    """The limbs, the gap, the goal line and the object at a start, to scale."""
    data = evaluation.dataset.sel(direction=direction)
    for x0, y0, x1, y1 in data.limbs.values:
        axis.plot([x0, x1], [y0, y1], color="black", lw=2, solid_capstyle="round")
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
    axis.annotate("", (x0, y0), (x1, y1), arrowprops={"arrowstyle": "<->", "color": "0.4"})
    axis.annotate(
        f"gap {float(data.gap):.4g}",
        ((x0 + x1) / 2, (y0 + y1) / 2),
        (0, -4),
        textcoords="offset points",
        ha="center",
        va="top",
        color="0.3",
        fontsize=9,
    )
    axis.set_aspect("equal")
    axis.margins(0.08)
    axis.set_title(
        f"{NAMES[direction]}: " + ("escape from inside" if direction == "does" else "enter")
    )
    axis.set_xlabel("x [model length]")
    axis.set_ylabel("y [model length]")
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
            steps * paper.DT,
            left,
            where="post",
            color=colour,
            label=f"{NAMES[direction]}: index 1 = {indices['index1'].value:,.0f}, "
            f"index 2 = {indices['index2'].value:.3f}",
        )
        axis.fill_between(
            steps * paper.DT, left - band, left + band, step="post", color=colour, alpha=0.2, lw=0
        )
    axis.set(
        xlabel="time [s]", ylabel="share still held", ylim=(0, 1.02), xlim=(0, limit * paper.DT)
    )
    title = f"{n:,} trials a direction, 95 % bands"
    if len(evaluation.directions) == 2:
        score = evaluation.score()["index1"]
        title = f"score {score.value:.3f} [{score.low:.3f}, {score.high:.3f}], " + title
    axis.set_title(title, fontsize=10)
    axis.legend(loc="lower left", fontsize=9)
    axis.grid(alpha=0.3)


def plot_figure(dataset: xr.Dataset) -> Figure:
    """One of the paper's figures from `pcjax.figures.run_figure`, with 95 % bands."""
    name = str(dataset.attrs["figure"])
    if name not in paper.FIGURES:
        return _plot_arm_figure(dataset)
    settings = paper.FIGURES[name]
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    axis = figure.subplots()
    if name == "9a":
        where = {"gap_width": settings.gap_widths[0]}
        _band(axis, curve(dataset, "does", "index1", where), COLOURS[0], "index 1", 1e-3)
        axis.set_ylabel("index 1 [thousand steps]", color=COLOURS[0])
        right = axis.twinx()
        _band(right, curve(dataset, "does", "index2", where), COLOURS[1], "index 2", 1.0)
        right.set_ylabel("index 2 [share of trials]", color=COLOURS[1])
        right.set_ylim(0, 1.02)
        limit = float(dataset.attrs["max_steps"]) * 1e-3
        axis.set_ylim(0, 1.02 * limit)
        axis.legend(handles=[axis.get_lines()[0], right.get_lines()[0]], loc="upper left")
    else:
        symbol = {"gap_width": "$W_g$", "radius": "$r_o$"}[settings.varies]
        values = settings.gap_widths if settings.varies == "gap_width" else settings.radii
        for value, colour in zip(values, COLOURS, strict=True):
            label = f"{symbol} = {value:g} $L_p$"
            where: dict[str, float] = {settings.varies: value}
            if name == "12":
                _band(axis, score_curve(dataset, where=where), colour, label, 1.0)
            else:
                direction = settings.directions[0]
                _band(axis, curve(dataset, direction, where=where), colour, label, 1e-3)
        if name == "12":
            axis.set_ylabel("score DoEs / EoEn (index 1)")
            axis.axhline(1.0, color="0.6", lw=0.8)
        else:
            axis.set_ylabel(f"{NAMES[settings.directions[0]]}: index 1 [thousand steps]")
            axis.set_ylim(0, None)
        axis.legend()
    axis.set_xlabel(r"fingertip angle $\theta_g$ [deg]")
    axis.grid(alpha=0.3)
    attrs = dataset.attrs
    axis.set_title(
        f"{settings.title}\n{attrs['trials']:,} trials, limit {attrs['max_steps']:,} steps; "
        f"{engines_text(attrs['engine'], dataset.dt)}\n95 % bands, hollow: full cage",
        fontsize=10,
    )
    return figure


def _plot_arm_figure(dataset: xr.Dataset) -> Figure:
    name, attrs = str(dataset.attrs["figure"]), dataset.attrs
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    axis = figure.subplots()
    if name == "17":
        colours = (*COLOURS, "#cc79a7")
        orientations = np.unique(dataset.orientation.values)
        for orientation, colour in zip(orientations, colours, strict=False):
            line = curve(dataset, "does", where={"orientation": float(orientation)})
            _band(axis, line, colour, f"orientation {orientation:g} deg", 1e-3)
        axis.legend()
    elif name == "15":
        first, second = paper.ARM_JOINT_ANGLES_DEG
        for fixed, at, varied, colour in (
            ("theta_2", second, "1", COLOURS[0]),
            ("theta_1", first, "2", COLOURS[1]),
        ):
            line = curve(dataset, "does", where={fixed: at})
            _band(axis, line, colour, rf"$\theta_{{i{varied}}}$ varied", 1e-3)
        axis.legend()
        axis.set_yscale("log")
    else:
        _band(axis, curve(dataset, "does"), COLOURS[0], "index 1", 1e-3)
    labels = {
        "13": r"joint angle $\theta_{i1}$ [deg]",
        "15": "width between the fingertips [model length]",
    }
    axis.set_xlabel(labels.get(name, r"joint angle $\theta_{i2}$ [deg]"))
    axis.set_ylabel("DoEs: index 1 [thousand steps]")
    if name != "15":
        axis.set_ylim(0, None)
    axis.grid(alpha=0.3, which="both" if name == "15" else "major")
    axis.set_title(
        f"{attrs['title']}\n{attrs['trials']:,} trials, limit {attrs['max_steps']:,} steps; "
        f"{engines_text(attrs['engine'], dataset.dt)}\n95 % bands, hollow: full cage",
        fontsize=10,
    )
    return figure


def _band(axis: Axes, line: Curve, colour: str, label: str, scale: float) -> None:
    value, reach = line.value * scale, _Z95 * line.se * scale
    axis.plot(line.angle, value, color=colour, label=label)
    for chosen, face in ((line.open, colour), (~line.open, "white")):
        axis.plot(line.angle[chosen], value[chosen], "o", ms=5, color=colour, mfc=face)
    axis.fill_between(line.angle, value - reach, value + reach, color=colour, alpha=0.25, lw=0)
