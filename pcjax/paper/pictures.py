"""Pictures of the paper's figures."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.importing import xr
from pcjax.paper import constants as paper
from pcjax.paper.figures import Curve, curve, score_curve
from pcjax.paper.readings import LITERAL, reading_of
from pcjax.results.schema import NAMES
from pcjax.results.tables import engines_text
from pcjax.view.labels import score_label
from pcjax.view.picture import Picture
from pcjax.view.plots import COLOURS

_Z95 = 1.96


def plot_figure(dataset: xr.Dataset) -> Figure:
    """One of the paper's figures from `pcjax.paper.figures.run_figure`, with 95 % bands."""
    name = str(dataset.attrs["figure"])
    if name not in paper.FIGURES:
        return _plot_arm_figure(dataset)
    settings = paper.FIGURES[name]
    figure = Picture(figsize=(7.2, 4.8), layout="constrained")
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
        what = {"gap_width": "gap width", "radius": "radius"}[settings.varies]
        values = settings.gap_widths if settings.varies == "gap_width" else settings.radii
        for value, colour in zip(values, COLOURS, strict=True):
            label = f"{what} {value:g} palm lengths"
            where: dict[str, float] = {settings.varies: value}
            if name == "12":
                _band(axis, score_curve(dataset, where=where), colour, label, 1.0)
            else:
                direction = settings.directions[0]
                _band(axis, curve(dataset, direction, where=where), colour, label, 1e-3)
        if name == "12":
            axis.set_ylabel(score_label("DoEs / EoEn by index1"))
            axis.axhline(1.0, color="0.6", lw=0.8)
        else:
            axis.set_ylabel(f"{NAMES[settings.directions[0]]}: index 1 [thousand steps]")
            axis.set_ylim(0, None)
        axis.legend()
    axis.set_xlabel(r"fingertip angle $\theta_g$ [deg]")
    axis.grid(alpha=0.3)
    attrs = dataset.attrs
    axis.set_title(
        f"{_heading(dataset, settings.title)}\n"
        f"{attrs['trials']:,} trials, limit {attrs['max_steps']:,} steps; "
        f"{engines_text(attrs['engine'], dataset.dt)}\n95 % bands, hollow: full cage",
        fontsize=10,
    )
    return figure


def _plot_arm_figure(dataset: xr.Dataset) -> Figure:
    name, attrs = str(dataset.attrs["figure"]), dataset.attrs
    figure = Picture(figsize=(7.2, 4.8), layout="constrained")
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
            _band(axis, line, colour, f"joint angle {varied} varied", 1e-3)
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
        f"{_heading(dataset, attrs['title'])}\n"
        f"{attrs['trials']:,} trials, limit {attrs['max_steps']:,} steps; "
        f"{engines_text(attrs['engine'], dataset.dt)}\n95 % bands, hollow: full cage",
        fontsize=10,
    )
    return figure


def _heading(dataset: xr.Dataset, title: str) -> str:
    """The title, and under which reading the figure is if not the literal one."""
    reading = reading_of(dataset)
    return _in_symbols(title) + ("" if reading == LITERAL else f"\n{reading.name}: {reading}")


def _in_symbols(title: str) -> str:
    """A title with the paper's symbols as it prints them."""
    greek = re.sub(r"\btheta_(\w+)", r"$\\theta_{\1}$", title)
    return re.sub(r"\b([A-Z])_(\w)\b", r"$\1_\2$", greek)


def _band(axis: Axes, line: Curve, colour: str, label: str, scale: float) -> None:
    value, reach = line.value * scale, _Z95 * line.se * scale
    axis.plot(line.angle, value, color=colour, label=label)
    for chosen, face in ((line.open, colour), (~line.open, "white")):
        axis.plot(line.angle[chosen], value[chosen], "o", ms=5, color=colour, mfc=face)
    axis.fill_between(line.angle, value - reach, value + reach, color=colour, alpha=0.25, lw=0)
