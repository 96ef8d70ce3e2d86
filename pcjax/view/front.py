"""The picture of a trade-off: its front, and the hands along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.design.front import Front
from pcjax.design.space import DesignSpace
from pcjax.model.bodies.base import placed_outline
from pcjax.model.hand import HandDesign, points_of
from pcjax.quality.surrogate import Surrogate
from pcjax.view.labels import score_label
from pcjax.view.picture import Picture
from pcjax.view.shapes import COLOURS, draw_limbs, draw_object

_HANDS = 8
"""Drawn along the front at most."""


def plot_front(data: tuple[Front, DesignSpace, Surrogate]) -> Figure:
    """Both aims of all designs that were tried, the front with its 95 % intervals, and hands along
    it from one end to the other, to scale."""
    found, space, surrogate = data
    figure, places = front_with_places(found, _HANDS)
    hands = {k: space.hand(found.members[k].design) for k in places}
    corners = np.concatenate([points_of(hand) for hand in hands.values()])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.06 * np.max(high - low)
    for k, place in places.items():
        _draw_hand(place, hands[k], surrogate, k + 1)
        place.set(
            xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin)
        )
    return figure


def front_with_places(found: Front, most: int) -> tuple[Figure, dict[int, Axes]]:
    """A figure with both aims and the front, and axes for hands along it from one end to the other.

    Arguments:
        found: the front.
        most: hands.

    Returns:
        The figure, and the axes by which of the members they are for.
    """
    count = min(len(found.members), most)
    shown = np.unique(np.linspace(0, len(found.members) - 1, count).round().astype(int)).tolist()
    figure = Picture(figsize=(13.5, 5.0), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.25])
    left, right = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    _draw_front(left.subplots(), found, shown)
    places = right.subplots(2, -(-len(shown) // 2), squeeze=False).ravel()
    for place in places[len(shown) :]:
        place.set_axis_off()
    return figure, dict(zip(shown, places, strict=False))


def plot_aims(found: Front) -> Figure:
    """The front without its hands: all that it knows without its space."""
    figure = Picture(figsize=(6.4, 5.0), layout="constrained")
    _draw_front(figure.subplots(), found, range(len(found.members)))
    return figure


def _draw_front(axis: Axes, found: Front, shown: Sequence[int]) -> None:
    """Both aims of all designs that were tried, and the front, in which some are numbered."""
    axis.plot(*found.tried.T, ".", color="0.75", ms=5, label="tried, as the model sees them")
    values = np.array([[aim.value for aim in member.aims] for member in found.members])
    ends = np.array([[[a.low, a.high] for a in member.aims] for member in found.members])
    reach = np.abs(ends - values[..., None])
    axis.errorbar(
        *values.T,
        xerr=reach[:, 0].T,
        yerr=reach[:, 1].T,
        fmt="o-",
        ms=4,
        lw=1,
        color=COLOURS[0],
        ecolor="0.5",
        elinewidth=0.7,
        label="front, exact, 95 % intervals",
    )
    start = [aim.value for aim in found.start.aims]
    name = "moved start" if found.moved else "the hand given"
    axis.plot(*start, "*", ms=13, color=COLOURS[1], mec="white", label=name)
    for k in shown:
        axis.annotate(
            str(k + 1),
            (values[k, 0], values[k, 1]),
            xytext=(5, -12),
            textcoords="offset points",
            fontsize=9,
            fontweight="bold",
        )
    ways = ["more is better" if larger else "less is better" for larger in found.larger]
    axis.set(
        xlabel=f"{score_label(found.names[0])}, {ways[0]}",
        ylabel=f"{score_label(found.names[1])}, {ways[1]}",
        title="no design tried is better in both",
    )
    axis.ticklabel_format(style="plain")
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def _draw_hand(axis: Axes, hand: HandDesign, surrogate: Surrogate, number: int) -> None:
    draw_limbs(axis, points_of(hand), float(hand.thickness), width=1.6)
    scenario = surrogate.task.scenarios(hand)[0]
    centre, body = scenario.corner_start(), scenario.body
    draw_object(axis, *placed_outline(body, np.array([centre.x, centre.y], float)))
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_title(str(number), fontsize=9, fontweight="bold")
