"""A hand from a drawing of its limbs' middle lines: DXF or SVG."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from pcjax.model.hand import HandDesign
from pcjax.study.entities import Drawing, Stroke, drawing_of
from pcjax.units import PER_METRE, check_units

MOST_LINES = 200
"""Of a hand."""

_TOLERANCE = 1e-6
"""Ends that are nearer than this share of the drawing's longer side are one joint."""


def read_drawing(
    path: str | os.PathLike[str],
    *,
    units: str = "model",
    palm: int | None = None,
    thickness: float | None = None,
) -> HandDesign:
    """Reads a hand from a drawing of the middle lines of its palm and limbs.

    The drawing is a DXF or an SVG file. It has one chain of straight lines from fingertip to
    fingertip: an open polyline, or polylines and lines in any order and direction whose ends meet
    within 1e-6 of its longer side. Each of its corners is a joint, also where two lines continue
    each other straight on. It may lie anywhere, at any angle: the hand's own frame has its mouth,
    the side on which the chain encloses more, at +y, and finger 1 is the one that is on the left
    then.

    The palm is, whichever comes first,

    - the line that `palm` says;
    - the line on a layer PALM;
    - of three entities the one in the middle, if it is one line; a part of an SVG path that begins
      elsewhere than the part before it ends is an entity of its own;
    - the line with as many lines on one side as on the other.

    If there is a layer LIMBS, as in what `export_hand` writes, only that one and PALM count;
    capitals do not matter. In an SVG file a layer is an id, a class or an Inkscape label, of an
    element or of a group around it. What is hidden, texts, dimensions and hatches never count.

    The thickness is that of the slots on a layer OUTLINES, as `export_hand` draws them; 0 if there
    are none.

    Arguments:
        path: the file, .dxf (needs ezdxf) or .svg (needs svgpathtools).
        units: of the hand's lengths, "mm", "cm" or "m", into which the drawing's own unit is
            converted; a "model" unit is drawn as a millimetre. A DXF file's $INSUNITS says its
            unit, an SVG file's width and height with a unit other than pixels do. Numbers without
            a unit are taken to be in `units`.
        palm: which line is the palm, counted from 1 at finger 1's tip.
        thickness: of palm and limbs, in `units`, in place of the drawing's.

    Raises:
        ValueError: no such file, one that cannot be read, or a package that is missing; curves,
            branches, a closed outline, lines that do not hang together, lines of no length, numbers
            that are not finite, more than 200 lines; a palm that cannot be told, or a chain that
            encloses nothing; no such unit.

    Examples:
        >>> import pcjax
        >>> path = pcjax.export_hand(pcjax.box_hand(thickness=12), "hand.svg")
        >>> hand = pcjax.read_drawing(path)
        >>> [round(float(length), 6) for length in hand.lengths[0]]
        [500.0, 150.0, 100.0]
        >>> round(float(hand.thickness), 6)
        12.0
    """
    check_units(units)
    return drawn_hand(path, units, palm, thickness)[0]


def drawn_hand(
    path: str | os.PathLike[str],
    units: str | None = None,
    palm: int | None = None,
    thickness: float | None = None,
) -> tuple[HandDesign, str, list[str]]:
    """A drawing's hand, the unit of its lengths, and what is strange about that unit, in words.

    Arguments:
        path, palm, thickness: as `read_drawing` takes them.
        units: as well; the drawing's own unless given, or mm where it has none of ours.

    Raises:
        ValueError: as `read_drawing`.
    """
    path = Path(path)
    drawing = drawing_of(path)
    doubts = []
    if units is None:
        units = drawing.unit if drawing.unit in PER_METRE else "mm"
        if drawing.mm is None:
            doubts = [f"{path} does not say its unit: taken to be mm (--units says otherwise)"]
        elif drawing.unit != units:
            doubts = [f"{path} is in {drawing.unit}: its lengths are converted into {units}"]
    per_mm = 1.0 if units == "model" else PER_METRE[units] / PER_METRE["mm"]
    scale = 1.0 if drawing.mm is None else drawing.mm * per_mm
    try:
        return _hand(drawing, scale, palm, thickness), units, doubts
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _hand(drawing: Drawing, scale: float, palm: int | None, thickness: float | None) -> HandDesign:
    strokes = _strokes(drawing)
    points, entity = _chain(strokes)
    if drawing.y_down:
        points = np.conj(points)
    if len(points) < 4:
        raise ValueError(
            f"it has {len(points) - 1} lines: a hand has a palm and at least one line a finger"
        )
    size = _size(points)
    # Seen from inside, the model's hand goes round from finger 1 over the palm to finger 2.
    around = points - points[0]
    area = 0.5 * float(np.sum(np.imag(np.conj(around) * np.roll(around, -1))))
    if abs(area) <= _TOLERANCE * size**2:
        raise ValueError(
            "the middle lines enclose nothing, so neither side is the hand's mouth: bend the "
            "fingers to one side of the palm"
        )
    if area < 0:
        points, entity = points[::-1], entity[::-1]
    sides = np.diff(points)
    k = _palm(entity, strokes) if palm is None else palm - 1
    if not 0 < k < len(sides) - 1:
        raise ValueError(
            f"line {k + 1} of {len(sides)}, counted from finger 1's tip, cannot be the palm: each "
            "finger has at least one line"
        )
    lengths, turns = scale * np.abs(sides), np.angle(sides[1:] / sides[:-1])
    if thickness is None:
        thickness = scale * _thickness(drawing, size)
    return HandDesign(
        _rounded(lengths)[k],
        (_rounded(lengths[:k][::-1]), _rounded(lengths[k + 1 :])),
        (tuple(turns[:k][::-1].tolist()), tuple(turns[k:].tolist())),
        thickness,
    )


def _rounded(lengths: Float[np.ndarray, "lines"]) -> tuple[float, ...]:
    """Lengths without the digits that differences of coordinates do not have."""
    return tuple(float(f"{length:.12g}") for length in lengths)


def _size(points: Complex[np.ndarray, "points"]) -> float:
    """The longer side of the box round the points."""
    return float(max(np.ptp(np.real(points)), np.ptp(np.imag(points))))


def _at(point: complex) -> str:
    return f"({point.real:.6g}, {point.imag:.6g})"


def _strokes(drawing: Drawing) -> list[Stroke]:
    """The middle lines, all of them straight."""
    wanted = [e for e in drawing.entities if e.layers & {"LIMBS", "PALM"}]
    alone = any("LIMBS" in entity.layers for entity in wanted)
    hint = "" if alone else "; if there is more in the drawing, put them on a layer LIMBS"
    entities = wanted if alone else drawing.entities
    many = f"more than {MOST_LINES} lines: a hand's drawing has the middle lines alone{hint}"
    if len(entities) > MOST_LINES:
        raise ValueError(many)
    strokes = [stroke for entity in entities for stroke in entity.strokes()]
    lines = sum(len(stroke.curved) for stroke in strokes)
    if lines == 0:
        raise ValueError("it has no lines: draw the middle lines of fingers and palm")
    if lines > MOST_LINES:
        raise ValueError(many)
    for stroke in strokes:
        # Above the largest number of a hand, differences of squares overflow.
        if not np.all(np.abs(stroke.points) < 1e100):
            raise ValueError("it has a number that is not finite, or far too large")
        if stroke.curved.any():
            start = stroke.points[int(np.argmax(stroke.curved))]
            raise ValueError(
                f"a curve begins at {_at(start)}: the middle lines have to be straight{hint}"
            )
    return strokes


def _chain(
    strokes: list[Stroke],
) -> tuple[Complex[np.ndarray, "joints"], Int[np.ndarray, "joints-1"]]:
    """The points from one fingertip to the other, and of each line between them its stroke."""
    starts = np.concatenate([stroke.points[:-1] for stroke in strokes])
    ends = np.concatenate([stroke.points[1:] for stroke in strokes])
    entity = np.repeat(np.arange(len(strokes)), [len(stroke.curved) for stroke in strokes])
    all_ends = np.concatenate([starts, ends])
    tolerance = _TOLERANCE * _size(all_ends)
    lengths = np.abs(ends - starts)
    if np.min(lengths) <= tolerance:
        at = starts[int(np.argmin(lengths))]
        raise ValueError(f"a line at {_at(at)} has no length: each limb has one")
    near = np.abs(all_ends[:, None] - all_ends) <= tolerance
    count, node = connected_components(near, directed=False)
    place = np.zeros(count, complex)
    place[node] = all_ends
    a, b = node[: len(starts)], node[len(starts) :]
    graph = coo_array((np.ones(len(a)), (a, b)), (count, count)).tocsr()
    chains, chain = connected_components(graph, directed=False)
    if chains > 1:
        apart = np.abs(place[:, None] - place)
        apart[chain[:, None] == chain] = np.inf
        one, other = np.unravel_index(int(np.argmin(apart)), apart.shape)
        raise ValueError(
            f"its lines make {chains} chains that do not touch: {_at(place[one])} and "
            f"{_at(place[other])} are {apart[one, other]:.3g} apart, and ends are joined within "
            f"{tolerance:.1g}; a hand is one chain from fingertip to fingertip"
        )
    meeting = np.bincount(node, minlength=count)
    if meeting.max() > 2:
        at = place[int(np.argmax(meeting))]
        raise ValueError(f"{meeting.max()} lines meet at {_at(at)}: a hand has no branches")
    tips = np.flatnonzero(meeting == 1)
    if len(tips) == 0:
        raise ValueError(
            "its lines close an outline: draw the open middle line from fingertip to fingertip; if "
            "there is more in the drawing, put that on a layer LIMBS"
        )
    row = breadth_first_order(graph, tips[0], directed=False, return_predecessors=False)
    line_of = {
        frozenset(pair): k for k, pair in enumerate(zip(a.tolist(), b.tolist(), strict=True))
    }
    order = [
        line_of[frozenset(pair)] for pair in zip(row[:-1].tolist(), row[1:].tolist(), strict=True)
    ]
    return place[row], entity[order]


def _palm(entity: Int[np.ndarray, "lines"], strokes: list[Stroke]) -> int:
    """Which line is the palm, from 0.

    Arguments:
        entity: of each line its stroke, from fingertip to fingertip.
        strokes: all.
    """
    named = np.flatnonzero(["PALM" in strokes[k].layers for k in entity])
    if len(named) == 1:
        return int(named[0])
    if len(named) > 1:
        raise ValueError(f"{len(named)} lines are on the layer PALM: the palm is one line")
    along = list(dict.fromkeys(entity.tolist()))
    if len(along) == 3 and np.sum(entity == along[1]) == 1:
        return int(np.flatnonzero(entity == along[1])[0])
    if len(entity) % 2 == 0:
        raise ValueError(
            f"which of its {len(entity)} lines is the palm cannot be told: draw it on a layer PALM "
            "(an id or a class of that name in SVG), or as a line of its own between two fingers, "
            "or say which it is, counted from finger 1's tip"
        )
    return len(entity) // 2


def _thickness(drawing: Drawing, size: float) -> float:
    """The width of the slots on the layer OUTLINES; 0 without any."""
    entities = [entity for entity in drawing.entities if "OUTLINES" in entity.layers]
    widths: list[float] = []
    for stroke in (stroke for entity in entities for stroke in entity.strokes()):
        straight = np.flatnonzero(~stroke.curved)
        if len(straight) != 2:
            widths.append(np.nan)
            continue
        # Round ends lead from the end of either side to the start of the other.
        first, second = straight
        points = stroke.points
        widths += np.abs(points[[first + 1, second + 1]] - points[[second, first]]).tolist()
    if not widths:
        return 0.0
    if not np.ptp(widths) <= _TOLERANCE * size:
        raise ValueError(
            "the layer OUTLINES has other than slots of one width, so it does not tell the "
            "thickness: give that"
        )
    return _rounded(np.mean(widths, keepdims=True))[0]
