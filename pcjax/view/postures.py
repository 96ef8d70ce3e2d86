"""Pictures of searches over hands in three dimensions."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from pcjax.design.front import Front
from pcjax.design.outcome import Optimum
from pcjax.design.postures import PostureSpace
from pcjax.quality.surrogate import Surrogate
from pcjax.view.designs import draw_history
from pcjax.view.front import front_with_places
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
    figure, places = front_with_places(found, _HANDS)
    hands = [space.hand(found.members[k].design) for k in places]
    _draw(places.values(), hands, [str(k + 1) for k in places], surrogate)
    return figure


def _draw(axes: Any, hands: Any, titles: list[str], surrogate: Surrogate) -> None:
    from pcjax.view.spatial import draw_hand

    azimuth = None
    for axis, hand, title in zip(axes, hands, titles, strict=True):
        scenario: Any = surrogate.task.scenarios(hand)[0]
        azimuth = draw_hand(axis, scenario, azimuth=azimuth, title=title)
