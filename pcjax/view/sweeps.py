"""Pictures of sweeps and other grids: an index or the score along one number, a curve for each of
others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from pcjax.importing import xr
from pcjax.results.schema import INDICES, NAMES, labels_of
from pcjax.view.labels import axis_label, objective_label, score_label, value_text
from pcjax.view.picture import Picture
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
    zipped, swept = "condition" in data.dims, labels_of(data)
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
                listed = ", ".join(f"{v:g}" for v in data[name].values)
                raise ValueError(f"{name} {value:g} was not swept: there are {listed}")
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
                (_text(data, hue, value), data[x].values, estimate.sel({hue: value}).values)
                for value in data[hue].values
            ]
    listed = ", ".join(_text(data, name, value) for name, value in at.items())
    used = np.unique(data.trials_used.values[data.trials_used.values > 0])
    trials = f"{used[0]:,}" if len(used) == 1 else f"{used[0]:,} to {used[-1]:,}"
    return _figure(lines, x, label, f"{listed + '; ' if listed else ''}{trials} trials", data)


def plot_grid(
    data: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    hue: str | None = None,
    at: Mapping[str, float | str] | None = None,
) -> Figure:
    """An index of a grid's conditions with its 95 % band.

    Arguments:
        data: from `evaluate_grid`.
        x: the label along the axis, a number; "angle" or else the first that varies unless given.
        y: "index1", which it is unless given, or "index2".
        hue: the label of which each value has a curve; each combination of those that are neither
            `x` nor determined by it unless given.
        at: values of other labels.

    Raises:
        ValueError: an unknown name or value, or nothing to draw along.
    """
    at, labels = dict(at or {}), labels_of(data)
    values = {name: data[name].values for name in labels}
    for name in [n for n in (x, hue, *at) if n is not None]:
        _check_name(name, labels, "no label of the conditions")
    y = INDICES[0] if y is None else y
    _check_name(y, INDICES, "not in the results")
    chosen = np.ones(data.sizes["condition"], bool)
    for name, value in at.items():
        here = values[name] == value
        if not here.any():
            listed = ", ".join(dict.fromkeys(map(_number_text, values[name].tolist())))
            raise ValueError(f"no condition has {name} {_number_text(value)}: there are {listed}")
        chosen &= here
    rows = np.flatnonzero(chosen)
    varying = [name for name in labels if len(set(values[name][rows].tolist())) > 1]
    along = [name for name in varying if values[name].dtype.kind in "iuf"]
    if x is None:
        x = next((name for name in ("angle", *along) if name in along), None)
    if x is None or x not in along:
        raise ValueError("the conditions have no number that varies, to draw along: name it by --x")
    others = [hue] if hue else [n for n in varying if n != x and not _follows(values, n, x, rows)]
    curves: dict[tuple, list[int]] = {}
    for row in rows.tolist():
        curves.setdefault(tuple(values[name][row].item() for name in others), []).append(row)
    for some in curves.values():
        if len(set(values[x][some].tolist())) < len(some):
            raise ValueError(
                f"several conditions have the same {x} on a curve: say which by --at NAME=VALUE"
            )
    lines = [
        (
            ", ".join(_text(data, name, v) for name, v in zip(others, key, strict=True)),
            values[x][some],
            data[y].values[some],
        )
        for key, some in curves.items()
    ]
    listed = "".join(f"{_text(data, name, value)}; " for name, value in at.items())
    label = objective_label(y)
    return _figure(lines, x, label, f"{listed}{data.attrs['trials']:,} trials", data)


def _text(data: xr.Dataset, name: str, value: float | str) -> str:
    return value_text(name, value, data[name].attrs.get("units"))


def _number_text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _check_name(name: str, names: Sequence[str], why: str) -> None:
    if name not in names:
        raise ValueError(
            f"{name} is {why}: {did_you_mean(name, names)}there are {', '.join(names)}"
        )


def _follows(values: Mapping[str, np.ndarray], name: str, x: str, rows: np.ndarray) -> bool:
    """Whether a label is known where `x` is."""
    pairs = set(zip(values[x][rows].tolist(), values[name][rows].tolist(), strict=True))
    return len(pairs) == len(set(values[x][rows].tolist()))


def _figure(
    lines: Sequence[tuple[str, np.ndarray, np.ndarray]],
    x: str,
    label: str,
    title: str,
    data: xr.Dataset,
) -> Figure:
    """Curves with bands: each with its name, its places and its estimates (statistic last)."""
    figure = Picture(figsize=(7.2, 4.8), layout="constrained")
    axis = figure.subplots()
    many = colormaps["viridis"](np.linspace(0, 0.9, len(lines)))
    for k, (name, places, values) in enumerate(lines):
        colour = COLOURS[k] if len(lines) <= len(COLOURS) else many[k]
        order = np.argsort(places)
        value, _, low, high = values[order].T
        axis.plot(places[order], value, "o-", ms=4, color=colour, label=name)
        axis.fill_between(places[order], low, high, color=colour, alpha=0.25, lw=0)
    axis.set_xlabel(axis_label(x, data[x].attrs.get("units")))
    axis.set_ylabel(label)
    if len(lines) > 1:
        axis.legend(fontsize=9)
    axis.grid(alpha=0.3)
    axis.set_title(f"{title}, limit {data.attrs['max_steps']:,} steps; 95 % bands", fontsize=10)
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
        return data.score.sel(index=f"index{number}"), score_label(f"DoEs / EoEn by index{number}")
    return data[name].sel(direction=what), score_label(f"{NAMES[what]} by {name}")
