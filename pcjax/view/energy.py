"""Pictures of escape energy: the climb by tilt, and the ways out in the hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.model.bodies.base import placed_outline
from pcjax.model.hand import points_of
from pcjax.quality.energy import EscapeEnergy
from pcjax.quality.landscape import pool_of
from pcjax.results.schema import NAMES
from pcjax.units import length_in_words
from pcjax.view.picture import Picture
from pcjax.view.shapes import COLOURS, draw_limbs, draw_object

_SECTORS = 36
"""Of the rose that shows which tilts the drive holds."""


def plot_energy(
    found: EscapeEnergy | Mapping[str, EscapeEnergy],
    units: str = "model",
    at: Sequence[float] | None = None,
) -> Figure:
    """How high the object has to climb, by the tilt; and the hand at some tilts, gravity down, with
    the lowest way out.

    In the hand the water stands up to the saddle, the highest point of that way: with less energy
    the object's centre stays in it. Grey sectors are the tilts that the drive holds, the darker the
    more it pulls there.

    Arguments:
        found: from `pcjax.energy`, or by direction from `pcjax.energy_of_study`.
        units: of lengths (see `pcjax.units`), for the labels.
        at: tilts at which the hand is drawn, radians; unless given, as a trial begins and a quarter
            of a turn.

    Examples:
        >>> import pcjax
        >>> found = pcjax.energy(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> pcjax.plot_energy(found).savefig("energy.png")
    """
    found = {"": found} if isinstance(found, EscapeEnergy) else found
    shown = 2 if at is None else len(at)
    figure = Picture(figsize=(4.4 + 3.7 * shown, 4.3 * len(found) + 0.5), layout="constrained")
    engine: Any = figure.get_layout_engine()
    engine.set(h_pad=0.15)  # for the angles' labels, which it does not see
    grid = figure.add_gridspec(len(found), shown + 1, width_ratios=[1.15] + [1.0] * shown)
    for row, (direction, one) in enumerate(found.items()):
        rose = figure.add_subplot(grid[row, 0], projection="polar")
        draw_climbs(rose, one, units)
        rose.set_title(NAMES.get(direction, ""), fontsize=11, loc="left", y=0.97)
        tilts = (one.begins_at, math.pi / 2) if at is None else at
        for column, tilt in enumerate(tilts, start=1):
            draw_way_out(figure.add_subplot(grid[row, column]), one, tilt)
    shown_once: dict[str, Artist] = {}
    for axis in figure.axes:
        marks, labels = axis.get_legend_handles_labels()
        shown_once |= dict(zip(labels, marks, strict=True))
    figure.legend(
        list(shown_once.values()),
        list(shown_once),
        loc="outside lower center",
        ncols=4,
        fontsize=9,
        frameon=False,
    )
    return figure


def draw_climbs(axis: Axes, found: EscapeEnergy, units: str) -> None:
    """The climbs over the tilt, a polar plot whose 0 is below, as the palm is."""
    polar: Any = axis
    polar.set_theta_zero_location("S")
    finite = [c[np.isfinite(c)] for c in (found.from_rest, found.from_start)]
    top = 1.08 * max((float(c.max()) for c in finite if len(c)), default=1.0) or 1.0
    sectors = np.linspace(-math.pi, math.pi, _SECTORS + 1)
    pull = np.histogram(found.held_tilts, sectors, weights=np.hypot(*found.held.T))[0]
    for low, width, share in zip(
        sectors, np.diff(sectors), pull / max(pull.max(), 1e-12), strict=False
    ):
        axis.bar(low, top, width, align="edge", color="0.5", alpha=0.3 * share, lw=0, zorder=0)
    closed = np.append(found.tilts, found.tilts[0] + 2 * math.pi)
    for climbs, colour, label in (
        (found.from_rest, COLOURS[0], "climb from where it lies deepest"),
        (found.from_start, COLOURS[1], "climb from a start"),
    ):
        if np.isfinite(climbs).all():
            axis.plot(closed, np.append(climbs, climbs[0]), color=colour, lw=2, label=label)
    for tilt in found.opens:
        if math.isfinite(tilt):
            axis.plot([tilt, tilt], [0, top], color=COLOURS[1], ls=":", lw=1.2)
    if np.isinf(found.from_rest).all():
        axis.text(0, 0, "a full cage:\nnothing gets out", ha="center", va="center")
        axis.set_yticks([])
    axis.set_ylim(0, top)
    degrees = np.arange(0, 360, 45)
    names = [f"{degree if degree <= 180 else degree - 360}°" for degree in degrees]
    axis.set_xticks(np.radians(degrees), ["palm 0°", *names[1:]], fontsize=8)
    axis.tick_params(axis="y", labelsize=7)
    axis.set_xlabel(f"climb [{length_in_words(units)}] by tilt of gravity", fontsize=9)
    axis.grid(alpha=0.4)


def draw_way_out(axis: Axes, found: EscapeEnergy, tilt: float) -> None:
    """The hand turned until gravity points down, with where the object lies deepest, the lowest way
    out from there, and the water up to its saddle."""
    c, s = math.cos(tilt), math.sin(tilt)
    turn = np.array([[c, -s], [s, c]])  # of rows, by -tilt
    climb, scenario = found.at(tilt), found.scenario
    for outline in found.landscape.outlines:
        axis.fill(*(outline @ turn).T, color="0.93", lw=0, zorder=0)
    way, flows = climb.way, np.isfinite(climb.saddle).all()
    if flows:
        pool, way = pool_of(found.landscape, climb, np.array([s, -c]))
        axis.fill(*(pool @ turn).T, color="#9ecae1", lw=0, zorder=0.5)
    hand = scenario.hand
    draw_limbs(axis, points_of(hand) @ turn, float(hand.thickness), zorder=3)
    with jax.enable_x64(True):
        goal = jax.device_get(jax.tree.map(float, hand).goal())
    ends = np.array([[goal.a.x, goal.a.y], [goal.b.x, goal.b.y]])
    axis.plot(*(ends @ turn).T, color=COLOURS[2], ls="--", lw=1.5, label="goal line", zorder=2)
    draw_object(
        axis,
        *placed_outline(scenario.body, climb.rest @ turn, 0.0),
        colour=COLOURS[0],
        label="object where it lies deepest",
    )
    if len(way):
        axis.plot(*(way @ turn).T, color="0.25", lw=1, ls=":", label="a way out", zorder=4.5)
    if flows:
        axis.plot(
            *(climb.saddle @ turn), marker="*", color=COLOURS[1], ms=13, ls="", label="saddle",
            zorder=5,
        )  # fmt: skip
    axis.set_aspect("equal")
    axis.margins(0.06)
    axis.set_axis_off()
    height = "no way out" if math.isinf(climb.from_rest) else f"climb {climb.from_rest:,.4g}"
    axis.set_title(f"tilt {math.degrees(tilt):.4g}°: {height}", fontsize=10)
