"""A picture of where objects stay in a hand, and from where they escape."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import jax
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from pcjax.model.bodies.base import placed_outline
from pcjax.model.hand import points_of
from pcjax.quality.occupancy import Occupancy
from pcjax.results.schema import NAMES
from pcjax.units import length_in_words
from pcjax.view.picture import Picture
from pcjax.view.shapes import COLOURS, draw_limbs, draw_object, name_axes

_MAP = "viridis"
_RANGE = 1e4
"""How much of the densest cell's density the colours go down to."""

_TALL = 4.2
"""Longer side of a hand's picture, inches."""

_SMALLEST, _LARGEST = 12.0, 260.0
"""Areas, square points, of the marks of one escape and of as many as there are at all."""


def plot_occupancy(found: Mapping[str, Occupancy], units: str = "model") -> Figure:
    """The hand in each direction to scale, over how much of the time the object's centre spends
    where, on a logarithmic scale; and from where objects escape.

    Where an object last rested before it escaped is marked; the more escapes from a cell, the
    larger is its mark. Empty marks are starts, of those that never rested.

    Arguments:
        found: by direction, from `pcjax.occupancy` or `pcjax.occupancy_of_study`.
        units: of lengths (see `pcjax.units`), for the labels.

    Examples:
        >>> import pcjax
        >>> scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> found = pcjax.occupancy(scenario, trials=64, max_steps=20_000)
        >>> pcjax.plot_occupancy({"does": found}).savefig("where.png")
    """
    low, high = _frame(found.values())
    width, height = _TALL * (high - low) / (high - low).max()
    figure = Picture(
        figsize=((max(width, 3.0) + 0.5) * len(found) + 1.6, height + 1.5), layout="constrained"
    )
    axes = figure.subplots(1, len(found), squeeze=False)[0]
    norm = _norm(max((one.share / one.cell**2).max() for one in found.values()))
    for axis, (direction, one) in zip(axes, found.items(), strict=True):
        draw_occupancy(axis, one, norm)
        axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        name_axes(axis, units)
        axis.label_outer()
        escapes = f"{one.status['passed']:,} of {one.trials:,} trials escaped"
        wrong = one.status["invalid"]
        axis.set_title(
            f"{NAMES[direction]}: {escapes}" + (f", {wrong:,} went wrong" if wrong else ""),
            fontsize=11,
        )
    unit = length_in_words(units)
    figure.colorbar(
        ScalarMappable(norm, _MAP),
        ax=axes.tolist(),
        label=f"share of the time per area [1 / {unit}²]",
        extend="min",
        shrink=0.9,
    )
    shown = {}
    for axis in axes:
        marks, labels = axis.get_legend_handles_labels()
        shown |= dict(zip(labels, marks, strict=True))
    figure.legend(
        shown.values(),
        shown.keys(),
        loc="outside lower center",
        ncols=2 * len(found),
        fontsize=9,
        frameon=False,
    )
    return figure


def shades(found: Occupancy) -> Float[np.ndarray, "rows columns 4"]:
    """The colours of its map, lowest row first, red, green, blue and opacity; where no object has
    been it is clear."""
    density = found.share / found.cell**2
    coloured = ScalarMappable(_norm(density.max()), _MAP).to_rgba(density)
    coloured[found.seconds == 0] = 0.0
    return coloured


def _norm(densest: float) -> LogNorm:
    return LogNorm(densest / _RANGE, densest, clip=True)


def draw_occupancy(axis: Axes, found: Occupancy, norm: LogNorm) -> None:
    """One hand with its map, its goal line and the marks of escapes, and the object below it.

    Arguments:
        axis: where.
        found: from `pcjax.occupancy`.
        norm: from shares of the time per area to colours.
    """
    scenario = found.scenario
    density = np.where(found.seconds > 0, found.share / found.cell**2, np.nan)
    axis.imshow(
        density, origin="lower", extent=found.extent, norm=norm, cmap=_MAP, interpolation="nearest"
    )
    hand = scenario.hand
    draw_limbs(axis, points_of(hand), float(hand.thickness), zorder=3)
    with jax.enable_x64(True):
        goal = jax.device_get(jax.tree.map(float, hand).goal())
    axis.plot(
        [goal.a.x, goal.b.x],
        [goal.a.y, goal.b.y],
        color=COLOURS[2],
        ls="--",
        lw=1.8,
        label="goal line",
        zorder=3,
    )
    draw_object(
        axis,
        *placed_outline(scenario.body, _below(found)),
        colour=COLOURS[0],
        label="object, to scale",
    )
    _mark_escapes(axis, found, ~found.rested, "none", "start of one that never rested")
    _mark_escapes(axis, found, found.rested, COLOURS[1], "last rest before an escape")
    axis.set_aspect("equal")


def _below(found: Occupancy) -> Float[np.ndarray, "2"]:
    """Where the object is drawn, out of the way."""
    radius = float(found.scenario.contact_radius)
    return np.array([0.0, points_of(found.scenario.hand)[:, 1].min() - 1.4 * radius])


def _frame(found: Iterable[Occupancy]) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Corners of the box, with some room, that has all hands and the object below them."""
    corners = []
    for one in found:
        thick, radius = 0.5 * float(one.scenario.hand.thickness), float(one.scenario.body.radius)
        points = points_of(one.scenario.hand)
        corners += [points - thick, points + thick, [_below(one) - radius]]
    together = np.concatenate(corners)
    low, high = together.min(axis=0), together.max(axis=0)
    room = 0.05 * (high - low).max()
    return low - room, high + room


def _mark_escapes(
    axis: Axes, found: Occupancy, which: Bool[np.ndarray, " escapes"], colour: str, label: str
) -> None:
    """One mark for all that escaped from a cell, at their middle."""
    places = found.origins[which]
    if len(places) == 0:
        return
    corner = np.array([found.extent[0], found.extent[2]])
    cells = np.floor((places - corner) / found.cell)
    _, member, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    middle: Float[np.ndarray, "cells 2"] = np.zeros((len(count), 2))
    np.add.at(middle, member.ravel(), places)
    share = count / len(found.origins)
    axis.scatter(
        *(middle / count[:, None]).T,
        s=_SMALLEST + (_LARGEST - _SMALLEST) * share,
        facecolors=colour,
        edgecolors=COLOURS[1] if colour == "none" else "white",
        linewidths=0.8,
        label=label,
        zorder=5 if colour != "none" else 4.5,
    )
