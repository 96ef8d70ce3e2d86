"""The gap in a picture of a hand: a dimension line between the fingers, and its width beside it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from pcjax.view.labels import length_text

_PAD = 3.0
"""Points that a label stays away from what is drawn."""


def draw_gap(axis: Axes, ends: Float[np.ndarray, "2 2"], width: float, units: str) -> GapLabel:
    """An arrow from finger to finger where they are closest, and its length in words.

    Arguments:
        axis: with the hand.
        ends: the points of the fingers that are closest to each other.
        width: of the gap.
        units: of lengths.
    """
    style = {"arrowstyle": "<->", "color": "0.35", "shrinkA": 1, "shrinkB": 1}
    axis.annotate("", *ends, arrowprops=style)
    return GapLabel(axis, ends, f"gap {length_text(width, units)}")


class GapLabel(Text):
    """A text beside a line, where it lies over nothing else.

    Where that is, is known only when the picture's layout is: so it is looked for when it is drawn,
    as matplotlib does for the best place of a legend.
    """

    def __init__(self, axis: Axes, ends: Float[np.ndarray, "2 2"], text: str):
        x, y = ends.mean(axis=0)
        super().__init__(x, y, text, ha="center", va="center", fontsize=9, color="0.3")
        self._axis, self._ends = axis, ends
        self.set_in_layout(False)
        axis.add_artist(self)

    def draw(self, renderer: RendererBase) -> None:
        """Draws it at the nearest free place."""
        axis, pad = self._axis, float(np.asarray(renderer.points_to_pixels(_PAD)))
        ends = axis.transData.transform(self._ends)
        box = self.get_window_extent(renderer)
        taken = [*_drawn(axis, renderer), (Path(ends), False)]
        centres = [ends.mean(axis=0) + shift for shift in _shifts(ends, box, pad)]

        def overlaps(centre: np.ndarray) -> int:
            return _overlaps(box.translated(*(centre - _middle(box))).padded(pad), taken, axis.bbox)

        # The first of the best is the nearest.
        x, y = axis.transData.inverted().transform(min(centres, key=overlaps))
        self.set_position((x, y))
        super().draw(renderer)


def _middle(box: Bbox) -> np.ndarray:
    return np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2


def _shifts(ends: np.ndarray, box: Bbox, pad: float) -> Iterator[np.ndarray]:
    """From a line's middle to where a label may be, the nearest first, on either side."""
    along = ends[1] - ends[0]
    along = along / max(np.hypot(*along), 1e-9)
    across = np.array([along[1], -along[0]])
    least = np.abs(across) @ [box.width, box.height] / 2 + 2 * pad
    for ring, slide, side in itertools.product(range(24), (0, -1, 1, -2, 2), (1, -1)):
        yield side * across * (least + ring * pad) + along * slide * box.width / 4


def _drawn(axis: Axes, renderer: RendererBase) -> list[tuple[Path, bool]]:
    """Outlines of an axis's lines, patches and legend, in pixels, and whether they are filled."""
    found = [(line.get_transform().transform_path(line.get_path()), False) for line in axis.lines]
    found += [(p.get_transform().transform_path(p.get_path()), True) for p in axis.patches]
    legend = axis.get_legend()
    for text in [] if legend is None else [*legend.get_texts(), *legend.legend_handles]:
        assert isinstance(text, Artist)
        (x0, y0), (x1, y1) = text.get_window_extent(renderer).get_points()
        found.append((Path([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]), True))
    return found


def _overlaps(box: Bbox, taken: list[tuple[Path, bool]], page: Bbox) -> int:
    """How many things are under a box, and whether it leaves the page."""
    inside = page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1
    return (not inside) + sum(path.intersects_bbox(box, filled) for path, filled in taken)
