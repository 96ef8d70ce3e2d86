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
    """The hand before and after with the object at the middle of its starts, and the scores along
    the way."""
    found, space, surrogate = data
    figure = Picture(figsize=(14.5, 4.6), layout="constrained")
    start, best, history = np.ravel(figure.subfigures(1, 3, width_ratios=[1, 1, 1.25]))
    name = "moved start" if found.moved else "start"
    for part, hand, score, what in (
        (start, found.start_hand, found.start_score, name),
        (best, space.hand(found.best), found.best_score, "best"),
    ):
        _draw(part, hand, surrogate, f"{what}: {score.value:,.4g}")
    draw_history(history.subplots(), found, surrogate)
    return figure


def plot_front(data: tuple[Front, PostureSpace, Surrogate]) -> Figure:
    """Both aims of all designs that were tried, the front with its 95 % intervals, and hands along
    it from one end to the other."""
    found, space, surrogate = data
    count = min(len(found.members), _HANDS)
    shown = np.unique(np.linspace(0, len(found.members) - 1, count).round().astype(int))
    figure = Picture(figsize=(13.5, 5.0), layout="constrained")
    left, right = np.ravel(figure.subfigures(1, 2, width_ratios=[1.0, 1.25]))
    draw_front(left.subplots(), found, shown)
    parts = np.ravel(right.subfigures(2, -(-len(shown) // 2), squeeze=False))
    for part, k in zip(parts, shown, strict=False):
        _draw(part, space.hand(found.members[k].design), surrogate, str(k + 1))
    return figure


def _draw(figure: Any, hand: Any, surrogate: Surrogate, title: str) -> None:
    from pcjax.view.spatial import draw_hand

    axis = figure.add_subplot(projection="3d")
    draw_hand(axis, surrogate.task.scenarios(hand)[0])
    axis.set_title(title)
