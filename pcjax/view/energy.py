"""Pictures of escape energy: the climb by tilt, and the ways out in the hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.model.bodies.base import placed_outline
from pcjax.model.hand import points_of
from pcjax.quality.energy import EscapeEnergy
from pcjax.quality.landscape import pool_of, short_way
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
    the object's centre stays in it. What turns is drawn along its way instead. Where climbs are
    known within bounds, lines are upper ones and dashes lower ones. Grey sectors are the tilts that
    the drive holds, the darker the more it pulls there.

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
    shown = [one for one in (found, found.at_least) if one]
    finite = [c[np.isfinite(c)] for one in shown for c in (one.from_rest, one.from_start)]
    top = 1.08 * max((float(c.max()) for c in finite if len(c)), default=1.0) or 1.0
    sectors = np.linspace(-math.pi, math.pi, _SECTORS + 1)
    pull = np.histogram(found.held_tilts, sectors, weights=np.hypot(*found.held.T))[0]
    for low, width, share in zip(
        sectors, np.diff(sectors), pull / max(pull.max(), 1e-12), strict=False
    ):
        axis.bar(low, top, width, align="edge", color="0.5", alpha=0.3 * share, lw=0, zorder=0)
    closed = np.append(found.tilts, found.tilts[0] + 2 * math.pi)
    for climbs, colour, name in (
        (found.from_rest, COLOURS[0], "climb from where it lies deepest"),
        (found.from_start, COLOURS[1], "climb from a start"),
    ):
        label = name if found.exact else f"{name}, {found.bound}"
        if np.isfinite(climbs).all():
            axis.plot(closed, np.append(climbs, climbs[0]), color=colour, lw=2, label=label)
    if (less := found.at_least) is not None:
        for climbs in (less.from_rest, less.from_start):
            if np.isfinite(climbs).all():
                axis.plot(closed, np.append(climbs, climbs[0]), "k--", lw=0.9, label=less.bound)
    for tilt in found.opens:
        if math.isfinite(tilt):
            axis.plot([tilt, tilt], [0, top], color=COLOURS[1], ls=":", lw=1.2)
    if np.isinf(found.from_rest).all():
        said = "a full cage:\nnothing gets out" if found.full_cage else "no way out\nwas found"
        axis.text(0, 0, said, ha="center", va="center", bbox={"fc": "white", "lw": 0, "alpha": 0.8})
    if found.full_cage:
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
    out from there, and the water up to its saddle, or what turns at places along that way."""
    c, s = math.cos(tilt), math.sin(tilt)
    turn = np.array([[c, -s], [s, c]])  # of rows, by -tilt
    climb, body, hand = found.at(tilt), found.scenario.body, found.scenario.hand

    def draw_body(at: Float[np.ndarray, "2"], angle: float, **style: Any) -> None:
        draw_object(axis, *placed_outline(body, at @ turn, angle - tilt), **style)

    for outline in found.landscape.outlines:
        axis.fill(*(outline @ turn).T, color="0.93", lw=0, zorder=0)
    down, way, flows = np.array([s, -c]), climb.way, np.isfinite(climb.saddle).all()
    if found.at_least and len(way):
        radius = float(body.radius)
        way, angles = short_way(found.landscape, climb, down, radius)
        for at, angle in _spread_along(way, angles, radius):
            draw_body(at, angle, colour="0.6", label="object along a way out")
        if flows:
            k = np.argmin(way @ down)
            draw_body(way[k], angles[k], colour=COLOURS[1], label="object at the saddle")
    elif flows:
        pool, way = pool_of(found.landscape, climb, down)
        axis.fill(*(pool @ turn).T, color="#9ecae1", lw=0, zorder=0.5)
    draw_limbs(axis, points_of(hand) @ turn, float(hand.thickness), zorder=3)
    with jax.enable_x64(True):
        goal = jax.device_get(jax.tree.map(float, hand).goal())
    ends = np.array([[goal.a.x, goal.a.y], [goal.b.x, goal.b.y]])
    axis.plot(*(ends @ turn).T, color=COLOURS[2], ls="--", lw=1.5, label="goal line", zorder=2)
    draw_body(climb.rest, climb.rest_angle, colour=COLOURS[0], label="object where it lies deepest")
    if len(way):
        axis.plot(*(way @ turn).T, color="0.25", lw=1, ls=":", label="a way out", zorder=4.5)
    if flows:
        top = way[np.argmin(way @ down)]
        axis.plot(
            *(top @ turn), marker="*", color=COLOURS[1], ms=13, ls="", label="saddle",
            zorder=5,
        )  # fmt: skip
    axis.set_aspect("equal")
    axis.margins(0.06)
    axis.set_axis_off()
    axis.set_title(f"tilt {math.degrees(tilt):.4g}°: {_height(found, tilt)}", fontsize=10)


def _height(found: EscapeEnergy, tilt: float) -> str:
    """The climb at a tilt in words."""
    least, most = (one.at(tilt).from_rest for one in (found.at_least or found, found))
    if math.isinf(least):
        return "no way out"
    if math.isinf(most):
        return f"climb {least:,.4g} at least, no way found"
    words = [f"{climb:,.4g}" for climb in (least, most)]
    return f"climb {' to '.join(dict.fromkeys(words))}"


def _spread_along(
    way: Float[np.ndarray, "points 2"],
    angles: Float[np.ndarray, " points"],
    radius: float,
    count: int = 6,
) -> list[tuple[Float[np.ndarray, "2"], float]]:
    """Places and angles that are evenly spread on a way, by how far a body's ends come."""
    steps = np.hypot(*np.diff(way, axis=0).T) + radius * np.abs(np.diff(angles))
    gone = np.append(0.0, np.cumsum(steps))
    at = gone[-1] * np.arange(1, count + 1) / count
    x, y, turned = (np.interp(at, gone, part) for part in (*way.T, angles))
    return list(zip(np.stack([x, y], axis=1), turned.tolist(), strict=True))
