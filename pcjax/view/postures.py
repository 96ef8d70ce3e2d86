"""Pictures of searches over hands in three dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pcjax.design.front import Front
from pcjax.design.outcome import Optimum
from pcjax.design.postures import PostureSpace
from pcjax.quality.surrogate import Surrogate
from pcjax.view.designs import draw_history
from pcjax.view.front import draw_front
from pcjax.view.picture import Picture

_HANDS = 4
"""Drawn along a front at most."""


def plot_optimum(data: tuple[Optimum, PostureSpace, Surrogate]) -> Figure:
    """The hand before and after with the object at the middle of its starts, seen from the same
    side, and the scores along the way."""
    found, space, surrogate = data
    figure = Picture(figsize=(14.5, 4.4), layout="constrained")
    start, best, history = figure.subplots(1, 3, width_ratios=[1, 1, 1.25])
    hands = [found.start_hand, space.hand(found.best)]
    titles = [
        f"{'moved start' if found.moved else 'start'}: {found.start_score.value:,.4g}",
        f"best: {found.best_score.value:,.4g}",
    ]
    _draw([start, best], hands, titles, surrogate)
    draw_history(history, found, surrogate)
    return figure


def plot_front(data: tuple[Front, PostureSpace, Surrogate]) -> Figure:
    """Both aims of all designs that were tried, the front with its 95 % intervals, and hands along
    it from one end to the other."""
    found, space, surrogate = data
    count = min(len(found.members), _HANDS)
    shown = np.unique(np.linspace(0, len(found.members) - 1, count).round().astype(int))
    figure = Picture(figsize=(13.5, 5.0), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.25])
    left, right = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    draw_front(left.subplots(), found, shown)
    axes = right.subplots(2, -(-len(shown) // 2), squeeze=False).ravel()
    hands = [space.hand(found.members[k].design) for k in shown]
    _draw(axes, hands, [str(k + 1) for k in shown], surrogate)
    for axis in axes[len(shown) :]:
        axis.set_axis_off()
    return figure


def _draw(axes: Any, hands: Any, titles: list[str], surrogate: Surrogate) -> None:
    from pcjax.view.spatial import draw_hand

    azimuth = None
    for axis, hand, title in zip(axes, hands, titles, strict=False):
        scenario: Any = surrogate.task.scenarios(hand)[0]
        azimuth = draw_hand(axis, scenario, azimuth=azimuth, title=title)
