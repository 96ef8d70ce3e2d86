"""What all pictures share: their colours, and the object in them."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle as Disc

from pcjax.units import length_in_words

COLOURS = ("#0072b2", "#d55e00", "#009e73")


def name_axes(axis: Axes, units: str) -> None:
    """Labels of a picture that is to scale, with the unit of lengths."""
    unit = length_in_words(units)
    axis.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")


def draw_object(
    axis: Axes,
    corners: Float[np.ndarray, "corners 2"],
    rounding: float,
    *,
    colour: str = COLOURS[1],
    label: str | None = None,
    zorder: float = 4,
) -> None:
    """The object to scale, from `placed_outline`: one corner is a disc, two are a line."""
    style: dict[str, Any] = {"color": colour, "label": label, "zorder": zorder}
    if len(corners) == 1:
        axis.add_patch(Disc((corners[0, 0], corners[0, 1]), rounding, alpha=0.7, **style))
    else:
        axis.plot(*corners.T, lw=3, solid_capstyle="round", **style)
