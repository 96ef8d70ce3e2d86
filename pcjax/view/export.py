"""A hand as a drawing for CAD or a cutter: SVG and DXF, to scale; one model unit a millimetre."""

from __future__ import annotations

import io
import math
import os
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jax
import numpy as np
from jaxtyping import Float

from pcjax.model.bodies.base import Body, placed_outline
from pcjax.model.hand import HandDesign, points_of
from pcjax.model.scenario import does
from pcjax.results.saving import save_text
from pcjax.units import PER_METRE, check_units

DRAWINGS = (".svg", ".dxf")
"""Kinds of drawings, by the file's ending."""

_SVG = "http://www.w3.org/2000/svg"

_COLOURS = {"LIMBS": 7, "OUTLINES": 8, "JOINTS": 1, "GOAL": 3, "OBJECT": 5}
"""Layers of a DXF file, and their colours by AutoCAD's numbers."""

_STROKES = {
    "LIMBS": "black",
    "OUTLINES": "gray",
    "JOINTS": "red",
    "GOAL": "green",
    "OBJECT": "blue",
}

Points = Float[np.ndarray, "points 2"]


def check_drawing(path: str | os.PathLike[str]) -> None:
    """Fails before the work when a drawing of this name cannot be made.

    Raises:
        ValueError: an unknown ending, or no ezdxf for DXF.
    """
    ending = Path(path).suffix.lower()
    if ending not in DRAWINGS:
        raise ValueError(f"cannot draw {path}: its ending has to be one of {', '.join(DRAWINGS)}")
    if ending == ".dxf":
        try:
            import ezdxf  # noqa: F401
        except ImportError:
            raise ValueError("DXF needs the package ezdxf: pip install 'pcjax[cad]'") from None


def export_hand(
    hand: HandDesign,
    path: str | os.PathLike[str],
    *,
    body: Body | None = None,
    units: str = "model",
) -> Path:
    """Draws a hand to scale, y up.

    Layers (groups of an SVG file): LIMBS, the middle line from fingertip to fingertip, in three
    parts if the fingers differ in their number of limbs, so that the palm can be told; JOINTS,
    circles where limbs meet; GOAL, the goal line; for limbs with a thickness OUTLINES, the
    surfaces of each and of the palm, a slot with round ends about its joints; and if asked for
    OBJECT, the object at a start.

    Arguments:
        hand: with plain numbers.
        path: the file, .svg or .dxf (needs ezdxf).
        body: the object; unless given, there is none.
        units: of lengths, "mm", "cm" or "m"; a "model" unit is drawn as a millimetre. A DXF file's
            numbers are in that unit, and its header says so; an SVG file's size is in millimetres.

    Raises:
        ValueError: an ending that is neither, no ezdxf, or no such unit.

    Example:
        >>> import pcjax
        >>> pcjax.export_hand(pcjax.box_hand(thickness=12), "hand.svg").name
        'hand.svg'
    """
    check_drawing(path)
    check_units(units)
    path = Path(path)
    drawing = (_Svg if path.suffix.lower() == ".svg" else _Dxf)("mm" if units == "model" else units)
    line = points_of(hand)
    left, right = map(len, hand.lengths)
    cuts = [0, len(line) - 1] if left == right else [0, left, left + 1, len(line) - 1]
    for first, last in pairwise(cuts):
        drawing.line("LIMBS", line[first : last + 1])
    size, thickness = 0.01 * float(hand.palm_length), float(hand.thickness)
    if thickness > 0:
        size = 0.2 * thickness
        for a, b in pairwise(line):
            drawing.rounded("OUTLINES", np.array([a, b]), thickness / 2)
    for joint in line[1:-1]:
        drawing.circle("JOINTS", joint, size)
    with jax.enable_x64(True):
        goal = jax.device_get(hand.goal())
        drawing.line("GOAL", np.array([[end.x, end.y] for end in (goal.a, goal.b)], float))
        if body is not None:
            start = jax.device_get(does(hand, body).corner_start())
            centre = np.array([start.x, start.y], float)
            corners, radius = placed_outline(body, centre)
            if len(corners) == 1:
                drawing.circle("OBJECT", centre, radius)
            elif len(corners) == 2 and radius == 0:
                drawing.line("OBJECT", corners)
            else:
                drawing.rounded("OBJECT", corners, radius)
    save_text(drawing.text(), path)
    return path


class _Svg:
    """An SVG file in the making; its groups are in the hand's axes, y up."""

    def __init__(self, units: str) -> None:
        self._mm = PER_METRE["mm"] / PER_METRE[units]
        self._groups: dict[str, list[tuple[str, dict[str, str]]]] = {}
        self._reach: list[np.ndarray] = []

    def _add(self, layer: str, tag: str, around: Points, **attributes: str) -> None:
        self._groups.setdefault(layer, []).append((tag, attributes))
        self._reach += [around.min(axis=0), around.max(axis=0)]

    def line(self, layer: str, points: Points) -> None:
        text = " ".join(f"{_text(x)},{_text(y)}" for x, y in points)
        self._add(layer, "polyline", points, points=text)

    def circle(self, layer: str, centre: np.ndarray, radius: float) -> None:
        around = np.array([centre - radius, centre + radius])
        where = {"cx": _text(centre[0]), "cy": _text(centre[1]), "r": _text(radius)}
        self._add(layer, "circle", around, **where)

    def rounded(self, layer: str, corners: Points, radius: float) -> None:
        ends = _straight_parts(corners, radius) if radius > 0 else corners
        first, *others = (f"{_text(x)},{_text(y)}" for x, y in ends)
        steps = [f"L{other}" for other in others]
        if radius > 0:
            arc = f"A{_text(radius)},{_text(radius)} 0 0 1 "
            steps[1::2] = [arc + other for other in others[1::2]]
            steps.append(arc + first)
        around = np.array([corners.min(axis=0) - radius, corners.max(axis=0) + radius])
        self._add(layer, "path", around, d=" ".join([f"M{first}", *steps, "Z"]))

    def text(self) -> str:
        low, high = np.min(self._reach, axis=0), np.max(self._reach, axis=0)
        margin = 0.02 * float(np.max(high - low))
        width, height = high - low + 2 * margin
        ElementTree.register_namespace("", _SVG)
        root = ElementTree.Element(
            f"{{{_SVG}}}svg",
            width=f"{_text(width * self._mm)}mm",
            height=f"{_text(height * self._mm)}mm",
            viewBox=" ".join(map(_text, (low[0] - margin, -high[1] - margin, width, height))),
        )
        up = ElementTree.SubElement(
            root,
            f"{{{_SVG}}}g",
            {
                "transform": "scale(1,-1)",
                "fill": "none",
                "stroke-width": _text(0.1 * margin),
                "stroke-linejoin": "round",
            },
        )
        for layer, parts in self._groups.items():
            group = ElementTree.SubElement(up, f"{{{_SVG}}}g", id=layer, stroke=_STROKES[layer])
            for tag, attributes in parts:
                ElementTree.SubElement(group, f"{{{_SVG}}}{tag}", attributes)
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


class _Dxf:
    """A DXF file in the making."""

    def __init__(self, units: str) -> None:
        import ezdxf
        from ezdxf.units import CM, MM, M

        unit = {"mm": MM, "cm": CM, "m": M}[units]
        self._file: Any = ezdxf.new("R2010", setup=["linetypes"], units=unit)  # pyright: ignore
        for layer, colour in _COLOURS.items():
            self._file.layers.add(layer, color=colour)
        self._file.layers.get("GOAL").dxf.linetype = "DASHED"
        self._space = self._file.modelspace()

    def line(self, layer: str, points: Points) -> None:
        if len(points) == 2:
            self._space.add_line(*points.tolist(), dxfattribs={"layer": layer})
        else:
            self._space.add_lwpolyline(points.tolist(), dxfattribs={"layer": layer})

    def circle(self, layer: str, centre: np.ndarray, radius: float) -> None:
        self._space.add_circle(centre.tolist(), radius, dxfattribs={"layer": layer})

    def rounded(self, layer: str, corners: Points, radius: float) -> None:
        points = np.column_stack([corners, np.zeros(len(corners))])
        if radius > 0:
            ends = _straight_parts(corners, radius)
            along = ends[1::2] - ends[::2]
            headings = np.arctan2(along[:, 1], along[:, 0])
            turns = (np.roll(headings, -1) - headings) % (2 * math.pi)
            points = np.column_stack([ends, np.zeros(len(ends))])
            # The bulge of a side that is an arc is the tangent of a quarter of its angle.
            points[1::2, 2] = np.tan(turns / 4)
        self._space.add_lwpolyline(
            points.tolist(), format="xyb", close=True, dxfattribs={"layer": layer}
        )

    def text(self) -> str:
        stream = io.StringIO()
        self._file.write(stream)
        return stream.getvalue()


def _straight_parts(corners: Points, radius: float) -> Points:
    """Both ends of each straight part of the outline of what is within a radius of a convex
    polygon, one after the other, anticlockwise as its corners are."""
    after = np.roll(corners, -1, axis=0)
    along = (after - corners) / np.hypot(*(after - corners).T)[:, None]
    out = radius * np.stack([along[:, 1], -along[:, 0]], axis=-1)
    return np.stack([corners + out, after + out], axis=1).reshape(-1, 2)


def _text(value: float) -> str:
    """A number with all its digits."""
    return repr(float(value))
