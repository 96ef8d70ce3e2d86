"""Drawings of a hand: read back, they have the hand's own coordinates, to scale."""

from __future__ import annotations

import builtins
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

import pcjax
from pcjax.view.export import export_hand

SVG = "{http://www.w3.org/2000/svg}"
HANDS = {
    "own": pcjax.HandDesign(
        400.0, ((350.0, 120.0, 80.0), (300.0, 100.0, 60.0)), ((1.4, 1.66, 1.3), (1.48, 1.66, 1.05))
    ),
    "box": pcjax.box_hand(),
    "two joints": pcjax.two_joint_hand(),
}
BODIES = {"circle": pcjax.Circle(20.0), "stick": pcjax.Stick(30.0, 0.4)}


def joints_and_tips(hand: pcjax.HandDesign) -> np.ndarray:
    """Forward kinematics by complex numbers, from fingertip 1 to fingertip 2."""
    fingers = []
    for side, lengths, angles in zip((-1, 1), hand.lengths, hand.angles, strict=True):
        place, heading, points = complex(hand.palm_length / 2), 0.0, []
        for length, angle in zip(lengths, angles, strict=True):
            points.append(place)
            heading += float(angle)
            place += length * complex(math.cos(heading), math.sin(heading))
        fingers.append([(side * p.real, p.imag) for p in [*points, place]])
    return np.array([*reversed(fingers[0]), *fingers[1]])


def svg_points(text: str) -> np.ndarray:
    return np.array([[float(n) for n in pair.split(",")] for pair in text.split()])


@pytest.mark.parametrize("hand", HANDS.values(), ids=HANDS)
def test_svg_has_the_hands_coordinates(tmp_path: Path, hand: pcjax.HandDesign) -> None:
    thick = replace(hand, thickness=10.0)
    path = export_hand(thick, tmp_path / "hand.svg", body=BODIES["circle"])
    root = ElementTree.parse(path).getroot()
    groups = {group.get("id"): group for group in root.iter(f"{SVG}g") if group.get("id")}
    assert set(groups) == {"LIMBS", "OUTLINES", "JOINTS", "GOAL", "OBJECT"}
    (line,) = groups["LIMBS"]
    points = svg_points(line.get("points", ""))
    expected = joints_and_tips(hand)
    np.testing.assert_allclose(points, expected, atol=1e-9)
    centres = [[float(c.get(k, "")) for k in ("cx", "cy")] for c in groups["JOINTS"]]
    np.testing.assert_allclose(centres, expected[1:-1], atol=1e-9)
    goal = svg_points(groups["GOAL"][0].get("points", ""))
    assert all(np.abs(expected - end).sum(axis=1).min() < 1e-3 for end in goal)
    # One unit is a millimetre, y is up, and everything is within the page.
    left, top, width, height = (float(n) for n in root.get("viewBox", "").split())
    assert root.get("width") == f"{width!r}mm"
    assert root.get("height") == f"{height!r}mm"
    assert root[0].get("transform") == "scale(1,-1)"
    x, y = points.T
    assert left <= x.min() - 5
    assert x.max() + 5 <= left + width
    assert top <= -y.max() - 5
    assert -y.min() + 5 <= top + height


@pytest.mark.parametrize(
    ("units", "mm", "code"), [("model", 1, 4), ("mm", 1, 4), ("cm", 10, 5), ("m", 1000, 6)]
)
def test_drawings_are_in_the_unit_of_the_study(
    tmp_path: Path, units: str, mm: int, code: int
) -> None:
    svg, dxf = (export_hand(HANDS["own"], tmp_path / f"h.{e}", units=units) for e in ("svg", "dxf"))
    root = ElementTree.parse(svg).getroot()
    _, _, width, height = (float(n) for n in root.get("viewBox", "").split())
    assert (root.get("width"), root.get("height")) == (f"{width * mm!r}mm", f"{height * mm!r}mm")
    file = ezdxf.readfile(dxf)  # pyright: ignore
    assert file.header["$INSUNITS"] == code
    (line,) = file.modelspace().query('LWPOLYLINE[layer=="LIMBS"]')
    np.testing.assert_allclose(list(line.get_points("xy")), joints_and_tips(HANDS["own"]))


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("hand", HANDS.values(), ids=HANDS)
def test_dxf_has_the_hands_coordinates(
    tmp_path: Path, hand: pcjax.HandDesign, body: pcjax.Circle | pcjax.Stick
) -> None:
    path = export_hand(replace(hand, thickness=10.0), tmp_path / "hand.dxf", body=body)
    file = ezdxf.readfile(path)  # pyright: ignore
    assert not file.audit().errors
    assert file.header["$INSUNITS"] == ezdxf.units.MM
    space = file.modelspace()
    expected = joints_and_tips(hand)
    (line,) = space.query('LWPOLYLINE[layer=="LIMBS"]')
    np.testing.assert_allclose(list(line.get_points("xy")), expected, atol=1e-9)
    joints = [(c.dxf.center.x, c.dxf.center.y) for c in space.query('CIRCLE[layer=="JOINTS"]')]
    np.testing.assert_allclose(joints, expected[1:-1], atol=1e-9)
    (goal,) = space.query('LINE[layer=="GOAL"]')
    for end in (goal.dxf.start, goal.dxf.end):
        assert np.abs(expected - [end.x, end.y]).sum(axis=1).min() < 1e-9
    outlines = list(space.query('LWPOLYLINE[layer=="OUTLINES"]'))
    assert len(outlines) == len(expected) - 1
    for outline, a, b in zip(outlines, expected, expected[1:], strict=False):
        assert outline.closed
        corners = np.array(outline.get_points("xy"))
        np.testing.assert_allclose(corners.mean(axis=0), (a + b) / 2, atol=1e-9)
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        length = math.dist(a, b)
        np.testing.assert_allclose(sides, [length, 10, length, 10], atol=1e-9)
    (thing,) = space.query('*[layer=="OBJECT"]')
    if isinstance(body, pcjax.Circle):
        assert thing.dxf.radius == 20
    else:
        along = thing.dxf.end - thing.dxf.start
        assert (along.magnitude, along.angle) == pytest.approx((60, 0.4))


@pytest.mark.parametrize("ending", ["svg", "dxf"])
def test_without_thickness_or_object_they_are_not_there(tmp_path: Path, ending: str) -> None:
    text = export_hand(HANDS["own"], tmp_path / f"hand.{ending}").read_text()
    if ending == "svg":
        assert "OUTLINES" not in text
        assert "OBJECT" not in text
    else:
        file = ezdxf.readfile(tmp_path / "hand.dxf")  # pyright: ignore
        layers = {entity.dxf.layer for entity in file.modelspace()}
        assert layers == {"LIMBS", "JOINTS", "GOAL"}


@pytest.mark.parametrize(("name", "words"), [("hand.stl", r"\.svg, \.dxf"), ("hand", "ending")])
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        export_hand(HANDS["own"], tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_without_ezdxf_dxf_is_refused_with_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def missing(name: str, *rest: Any, **more: Any) -> Any:
        if name == "ezdxf":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(ValueError, match=r"pip install 'pcjax\[cad\]'"):
        export_hand(HANDS["own"], tmp_path / "hand.dxf")
    assert export_hand(HANDS["own"], tmp_path / "hand.svg").exists()
