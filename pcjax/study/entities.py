"""What is drawn in a DXF or an SVG file: its entities, by their layers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Bool, Complex

from pcjax.results.files import read_plain
from pcjax.words import one_line

MOST_BYTES = 10_000_000
"""Of a drawing's file."""

_SVG = "{http://www.w3.org/2000/svg}"

_SVG_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "Q": 0.25}
"""Units of an SVG file that are lengths, and their size in mm. A pixel is none: programs disagree
on its size."""

_SVG_NOT_DRAWN = {"defs", "symbol", "clipPath", "mask", "marker", "pattern"}

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"

_DXF_DRAWN = {
    *("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "HELIX"),
    *("SOLID", "TRACE", "3DFACE"),
}
"""Entities that are lines or curves. Others, such as texts, dimensions and hatches, are none."""


@dataclass(frozen=True)
class Stroke:
    """Lines and curves, one after the other.

    Attributes:
        points: the ends of each, x + iy in the file's numbers.
        curved: of each, whether it is a curve.
        layers: the names under which it is drawn, in capitals.
    """

    points: Complex[np.ndarray, "points"]
    curved: Bool[np.ndarray, "points-1"]
    layers: frozenset[str]


@dataclass(frozen=True)
class Entity:
    """One entity of a drawing, which is looked at only if its layer is wanted.

    Attributes:
        layers: the names under which it is drawn, in capitals.
        strokes: what it draws; raises ValueError if that cannot be read.
    """

    layers: frozenset[str]
    strokes: Callable[[], list[Stroke]]


@dataclass(frozen=True)
class Drawing:
    """
    Attributes:
        entities: all that is drawn.
        unit: of the file's numbers, in words; "" if it does not say.
        mm: that unit in mm; None if it does not say.
        y_down: whether its y points down.
    """

    entities: list[Entity]
    unit: str
    mm: float | None
    y_down: bool


def drawing_of(path: Path) -> Drawing:
    """What a file draws.

    Raises:
        ValueError: an ending that is neither .dxf nor .svg, no such file, one that is too large or
            cannot be read, or no package to read it with.
    """
    ending = path.suffix.lower()
    if ending not in _READERS:
        raise ValueError(f"{path} is no drawing: its ending has to be .dxf or .svg")
    if path.is_file() and path.stat().st_size > MOST_BYTES:
        raise ValueError(
            f"{path} has {path.stat().st_size:,} bytes: a hand's drawing has at most "
            f"{MOST_BYTES:,}; keep the limbs' middle lines alone in a file"
        )
    content = read_plain(path)
    try:
        return _READERS[ending](path, content)
    except ImportError as error:
        raise ValueError(
            f"reading {path} needs the package {error.name}: pip install 'pcjax[cad]'"
        ) from None
    except Exception as error:  # of every kind, where a parser meets damage
        raise ValueError(f"{path} cannot be read as {ending[1:].upper()}: {_line(error)}") from None


def _line(error: Exception) -> str:
    return one_line(error) or f"it is damaged or cut short ({type(error).__name__})"


# ----------------------------------------------------------------------------------------- DXF


def _dxf(path: Path, content: bytes) -> Drawing:
    import ezdxf
    from ezdxf.enums import InsertUnits
    from ezdxf.units import conversion_factor, unit_name

    file: Any = ezdxf.readfile(path)  # pyright: ignore
    # A file that says nothing gets the unit of ezdxf's own template.
    code = file.header.get("$INSUNITS", 0) if b"$INSUNITS" in content else 0
    hidden = {
        layer.dxf.name.upper() for layer in file.layers if layer.is_off() or layer.is_frozen()
    }
    entities = [
        Entity(frozenset({layer}), _dxf_strokes(entity, layer))
        for entity in file.modelspace()
        if (layer := entity.dxf.layer.upper()) not in hidden
        and entity.dxftype() in {*_DXF_DRAWN, "INSERT"}
        and not entity.dxf.get("invisible", 0)
    ]
    if not code:
        return Drawing(entities, "", None, y_down=False)
    known = {4: "mm", 5: "cm", 6: "m"}
    unit = known.get(code, unit_name(code).lower())
    try:
        mm = conversion_factor(InsertUnits(code), InsertUnits.Millimeters)
    except (TypeError, ValueError):
        raise ValueError(
            f"$INSUNITS is {code} ({unit}), whose size is not known: save it in mm"
        ) from None
    return Drawing(entities, unit, mm, y_down=False)


def _dxf_strokes(entity: Any, layer: str) -> Callable[[], list[Stroke]]:
    def strokes() -> list[Stroke]:
        from ezdxf.path import Command, make_path

        if entity.dxftype() == "INSERT":
            raise ValueError(
                f"the block {entity.dxf.name} is put in on layer {layer}: explode it into lines"
            )
        try:
            path = make_path(entity)
            commands: list[Any] = list(path.commands())
        except Exception as error:  # of every kind, where ezdxf meets what is no curve
            raise ValueError(
                f"a {entity.dxftype()} on layer {layer} cannot be read: {_line(error)}"
            ) from None
        places = np.array([path.start.xyz, *(command.end.xyz for command in commands)])
        size = np.ptp(places[:, :2], axis=0).max()
        if np.ptp(places[:, 2]) > 1e-6 * size:
            raise ValueError(
                f"a {entity.dxftype()} on layer {layer} rises out of the plane: a hand is drawn "
                "with one z"
            )
        curved = np.array([command.type != Command.LINE_TO for command in commands], bool)
        return [Stroke(places[:, 0] + 1j * places[:, 1], curved, frozenset({layer}))]

    return strokes


# ----------------------------------------------------------------------------------------- SVG


def _svg(path: Path, content: bytes) -> Drawing:
    # Asked for now: what is missing is to be said before anything else.
    from svgpathtools.document import CONVERSIONS

    root = ElementTree.fromstring(content)
    if root.tag != f"{_SVG}svg":
        raise ValueError(f"its root is <{root.tag}>, not <svg> of {_SVG[1:-1]}")
    parents = {child: parent for parent in root.iter() for child in parent}

    def line_of(element: ElementTree.Element) -> Iterator[ElementTree.Element]:
        while element is not root:
            yield element
            element = parents[element]

    entities = []
    for element in root.iter():
        if _tag(element) not in {*CONVERSIONS, "use"}:
            continue
        above = list(line_of(element))
        if not any(_tag(one) in _SVG_NOT_DRAWN or _hidden(one) for one in above):
            layers = frozenset(name for one in above for name in _names(one))
            entities.append(Entity(layers, _svg_strokes(above, layers)))
    unit, mm = _svg_unit(root)
    return Drawing(entities, unit, mm, y_down=True)


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).removeprefix(_SVG)


def _style(element: ElementTree.Element) -> str:
    return re.sub(r"\s", "", element.get("style", ""))


def _hidden(element: ElementTree.Element) -> bool:
    style = _style(element)
    return (
        element.get("display") == "none"
        or "display:none" in style
        or element.get("visibility") in ("hidden", "collapse")
        or re.search(r"visibility:(hidden|collapse)", style) is not None
    )


def _names(element: ElementTree.Element) -> Iterator[str]:
    """Its id, its classes and what Inkscape calls it."""
    for key, value in element.items():
        if key in ("id", "class") or key.endswith("}label"):
            yield from value.upper().split()


def _svg_unit(root: ElementTree.Element) -> tuple[str, float | None]:
    """The unit of the page's size, and the size of the file's numbers in mm; "" and None if it has
    none."""
    box = [float(x) for x in re.findall(_NUMBER, root.get("viewBox", ""))]
    if len(box) not in (0, 4) or min(box[2:], default=1.0) <= 0:
        raise ValueError("its viewBox has to be four numbers, the last two above 0")
    unit, scales = "", []
    for side, key in enumerate(("width", "height")):
        size = re.fullmatch(rf"\s*({_NUMBER})([a-zA-Z]+)\s*", root.get(key, ""))
        if size is None or size.group(2) not in _SVG_MM:
            continue
        unit = size.group(2)
        mm = _SVG_MM[unit]
        # Without a viewBox a number is a pixel, 1/96 of an inch.
        scales.append(float(size.group(1)) * mm / box[2 + side] if box else 25.4 / 96)
    if min(scales, default=1.0) <= 0:
        raise ValueError("its width and height have to be above 0")
    stretched = bool(scales) and max(scales) > (1 + 1e-3) * min(scales)
    if stretched and re.search("none|slice", root.get("preserveAspectRatio", "")):
        raise ValueError("its page is stretched or cut by preserveAspectRatio: leave that out")
    # Else a page of another shape than its viewBox has all of that in it.
    return unit, min(scales, default=None)


def _svg_strokes(
    above: list[ElementTree.Element], layers: frozenset[str]
) -> Callable[[], list[Stroke]]:
    """What an element draws.

    Arguments:
        above: the element, what it stands in, and so on.
        layers: their names.
    """

    def strokes() -> list[Stroke]:
        from svgpathtools import Line, parse_path, parse_transform
        from svgpathtools.document import CONVERSIONS
        from svgpathtools.path import transform

        element = above[0]
        called = element.get("id")
        what = f"<{_tag(element)}>" + (f" '{called}'" if called else "")
        if _tag(element) == "use":
            raise ValueError(f"a {what} repeats what is elsewhere: unlink the clone")
        for one in above[1:]:
            if _tag(one) != "g":
                raise ValueError(f"a {what} is in a <{_tag(one)}>: only groups, <g>, are read")
        if any("transform:" in _style(one) for one in above):
            raise ValueError(f"a {what} is moved by its style: have its attribute transform do so")
        try:
            _check_numbers(element)
            matrix = np.identity(3)
            for one in above:
                matrix = parse_transform(one.get("transform"), strict=True) @ matrix
            path = parse_path(CONVERSIONS[_tag(element)](element))
            parts = [transform(part, matrix) for part in path.continuous_subpaths() if len(part)]
        except Exception as error:  # of every kind, where svgpathtools meets damage
            raise ValueError(f"a {what} cannot be read: {_line(error)}") from None
        return [
            Stroke(
                np.array([part[0].start, *(piece.end for piece in part)], complex),
                np.array([not isinstance(piece, Line) for piece in part], bool),
                layers,
            )
            for part in parts
        ]

    return strokes


def _check_numbers(element: ElementTree.Element) -> None:
    """
    Raises:
        ValueError: something that is no number, which svgpathtools would pass over.
    """
    commands = "MmZzLlHhVvCcSsQqTtAa"
    for key in ("points", "d", "x1", "y1", "x2", "y2"):
        text = element.get(key, "")
        left = re.sub(rf"{_NUMBER}|[\s,]", "", text).strip(commands if key == "d" else "")
        if left:
            raise ValueError(f"{key} has {left[:20]!r}, which is no number")
        if key == "points" and len(re.findall(_NUMBER, text)) % 2:
            raise ValueError("points has an x without a y")


_READERS = {".dxf": _dxf, ".svg": _svg}
