"""What all pictures share: their colours, and the object in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle as Disc

COLOURS = ("#0072b2", "#d55e00", "#009e73")


def draw_object(
    axis: Axes,
    centre: Sequence[float] | np.ndarray,
    radius: float,
    angle: float | None = None,
    *,
    colour: str = COLOURS[1],
    label: str | None = None,
    zorder: float = 4,
) -> None:
    """A circle as a disc, or a stick as a line, to scale.

    Arguments:
        centre: x and y, model lengths.
        radius: of the circle, or half the stick's length.
        angle: of the stick from the picture's x axis, radians; None for a circle.
    """
    style: dict[str, Any] = {"color": colour, "label": label, "zorder": zorder}
    x, y = float(centre[0]), float(centre[1])
    if angle is None:
        axis.add_patch(Disc((x, y), radius, alpha=0.7, **style))
    else:
        dx, dy = radius * math.cos(angle), radius * math.sin(angle)
        ends = [x - dx, x + dx], [y - dy, y + dy]
        axis.plot(*ends, lw=3, solid_capstyle="round", **style)
