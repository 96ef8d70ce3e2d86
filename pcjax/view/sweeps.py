"""Pictures of sweeps: an index or the score along one swept number, a curve for each of another."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.figure import Figure

from pcjax.results.schema import NAMES
from pcjax.sweep.assemble import swept_names
from pcjax.view.plots import COLOURS
from pcjax.words import did_you_mean


def plot_sweep(
    data: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    hue: str | None = None,
    at: Mapping[str, float] | None = None,
) -> Figure:
    """An estimate of a sweep with its 95 % band.

    Arguments:
        data: from `run_sweep`.
        x: the swept number along the axis; the first unless given.
        y: "score", "score.index2", "index1", "index2", "eoen.index1" or "eoen.index2"; the score if
            there is one, else index 1, unless given.
        hue: the swept number of which each has a curve; where there are two that vary, the other.
        at: values of the other swept numbers.

    Raises:
        ValueError: an unknown name, or a swept number of which it is not said which value to draw.
    """
    zipped, swept = "condition" in data.dims, swept_names(data)
    at = dict(at or {})
    x = swept[0] if x is None else x
    for name in (x, *at, *([] if hue is None else [hue])):
        if name not in swept:
            hint = did_you_mean(name, swept)
            raise ValueError(f"{name} is not swept: {hint}there are {', '.join(swept)}")
    estimate, label = _estimate(data, y)
    if zipped:
        if hue is not None or at:
            raise ValueError("the swept numbers go together: there is one curve, without hue or at")
        lines = [("", data[x].values, estimate.values)]
    else:
        for name, value in at.items():
            near = data[name].values[np.argmin(np.abs(data[name].values - value))]
            if abs(near - value) > 1e-9 * max(abs(value), 1.0):
                told = ", ".join(f"{v:g}" for v in data[name].values)
                raise ValueError(f"{name} {value:g} was not swept: there are {told}")
            estimate = estimate.sel({name: near})
        rest = [n for n in swept if n not in (x, hue, *at)]
        several = [n for n in rest if estimate.sizes[n] > 1]
        if hue is None and len(several) == 1:
            hue, several = several[0], []
        if several:
            raise ValueError(f"say which value of {several[0]} to draw: --at {several[0]}=VALUE")
        estimate = estimate.isel({n: 0 for n in rest if n != hue})
        if hue is None:
            lines = [("", data[x].values, estimate.values)]
        else:
            lines = [
                (f"{hue} {value:g}", data[x].values, estimate.sel({hue: value}).values)
                for value in data[hue].values
            ]
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    axis = figure.subplots()
    many = colormaps["viridis"](np.linspace(0, 0.9, len(lines)))
    for k, (name, places, values) in enumerate(lines):
        colour = COLOURS[k] if len(lines) <= len(COLOURS) else many[k]
        order = np.argsort(places)
        value, _, low, high = values[order].T
        axis.plot(places[order], value, "o-", ms=4, color=colour, label=name)
        axis.fill_between(places[order], low, high, color=colour, alpha=0.25, lw=0)
    unit = " [deg]" if x.endswith("_deg") else ""
    axis.set_xlabel(x.removesuffix("_deg").replace("_", " ") + unit)
    axis.set_ylabel(label)
    if len(lines) > 1:
        axis.legend(fontsize=9)
    axis.grid(alpha=0.3)
    told = ", ".join(f"{name} {value:g}" for name, value in at.items())
    used = np.unique(data.trials_used.values[data.trials_used.values > 0])
    trials = f"{used[0]:,}" if len(used) == 1 else f"{used[0]:,} to {used[-1]:,}"
    axis.set_title(
        f"{told + '; ' if told else ''}{trials} trials, limit {data.attrs['max_steps']:,} steps; "
        "95 % bands",
        fontsize=10,
    )
    return figure


def _estimate(data: xr.Dataset, y: str | None) -> tuple[xr.DataArray, str]:
    """The estimate that a name stands for, and its label."""
    known = [f"{d}.{name}" for d in data.direction.values for name in ("index1", "index2")]
    known += ["score", "score.index2"] if "score" in data else []
    short = {"index1": known[0], "index2": known[1]}
    y = ("score" if "score" in data else "index1") if y is None else y
    y = short.get(y, y)
    if y not in known:
        names = [*known, *short]
        hint = did_you_mean(y, names)
        raise ValueError(f"there is no {y} in the results: {hint}there are {', '.join(names)}")
    what, _, name = y.partition(".")
    number = (name or "index1")[-1]
    if what == "score":
        return data.score.sel(index=f"index{number}"), f"score DoEs / EoEn (index {number})"
    unit = " [steps of 0.001 s]" if number == "1" else ""
    return data[name].sel(direction=what), f"{NAMES[what]}: index {number}{unit}"
