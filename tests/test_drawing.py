"""Hands read from drawings: each is the hand that was drawn, and what is none is refused."""

from __future__ import annotations

import builtins
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

import pcjax
from pcjax.model.hand import points_of
from pcjax.study import entities
from pcjax.study.drawing import MOST_LINES, drawn_hand, read_drawing

HANDS = 100


def encloses(points: np.ndarray) -> float:
    """The area to the left of a closed line, by the shoelace formula, as a share of its box."""
    (x, y), (after_x, after_y) = points.T, np.roll(points, -1, axis=0).T
    return float(np.sum(x * after_y - after_x * y) / 2 / np.prod(np.ptp(points, axis=0)))


def random_hand(rng: np.random.Generator, links: tuple[int, int] | None = None) -> pcjax.HandDesign:
    """A hand with 1 to 4 limbs a finger unless it is said, and something on its mouth's side."""
    while True:
        counts = rng.integers(1, 5, 2) if links is None else links
        hand = pcjax.HandDesign(
            rng.uniform(20, 600),
            tuple(tuple(rng.uniform(10, 400, n).tolist()) for n in counts),
            tuple(tuple(rng.uniform(-1.0, 2.2, n).tolist()) for n in counts),
        )
        if encloses(points_of(hand)) > 0.02:
            return hand


def seeded(count: int, links: tuple[int, int] | None = None) -> list[pcjax.HandDesign]:
    rng = np.random.default_rng(7)
    return [random_hand(rng, links) for _ in range(count)]


def check_same(found: pcjax.HandDesign, hand: pcjax.HandDesign, rtol: float = 1e-9) -> None:
    assert tuple(map(len, found.lengths)) == tuple(map(len, hand.lengths))
    expected = points_of(hand)
    np.testing.assert_allclose(points_of(found), expected, atol=rtol * np.ptp(expected))
    np.testing.assert_allclose(found.palm_length, hand.palm_length, rtol=rtol)
    for finger in (0, 1):
        np.testing.assert_allclose(found.lengths[finger], hand.lengths[finger], rtol=rtol)
        np.testing.assert_allclose(found.angles[finger], hand.angles[finger], atol=10 * rtol)


def moved(points: np.ndarray, angle: float, shift: Sequence[float]) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]]) + shift


def numbers(points: np.ndarray) -> str:
    return " ".join(f"{float(x)!r},{float(y)!r}" for x, y in points)


def svg(path: Path, inside: str, page: str = "") -> Path:
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {page}>{inside}</svg>')
    return path


def dxf(
    path: Path,
    lines: Sequence[np.ndarray],
    layers: Sequence[str] = (),
    units: int = 4,
    **more: Any,
) -> Path:
    file = ezdxf.new("R2010", units=units)  # pyright: ignore
    for k, points in enumerate(lines):
        attributes = {"layer": layers[k]} if layers else {}
        if len(points) == 2:
            file.modelspace().add_line(*points.tolist(), dxfattribs=attributes)
        else:
            file.modelspace().add_lwpolyline(points.tolist(), dxfattribs=attributes, **more)
    file.saveas(path)
    return path


def three(hand: pcjax.HandDesign, points: np.ndarray | None = None) -> list[np.ndarray]:
    """Finger 1, the palm and finger 2."""
    points, n = points_of(hand) if points is None else points, len(hand.lengths[0])
    return [points[: n + 1], points[n : n + 2], points[n + 1 :]]


# --------------------------------------------------------------------------- what was drawn


@pytest.mark.parametrize("ending", ["svg", "dxf"])
def test_an_exported_hand_is_read_back(tmp_path: Path, ending: str) -> None:
    for k, hand in enumerate(seeded(HANDS)):
        thick = pcjax.HandDesign(hand.palm_length, hand.lengths, hand.angles, 3.0 * (k % 2))
        path = pcjax.export_hand(thick, tmp_path / f"hand.{ending}")
        found = read_drawing(path)
        check_same(found, hand)
        assert found.thickness == pytest.approx(thick.thickness, rel=1e-9)
        assert read_drawing(path, thickness=1.5).thickness == 1.5


@pytest.mark.parametrize("ending", ["svg", "dxf"])
@pytest.mark.parametrize("units", ["model", "mm", "cm", "m"])
def test_an_exported_hand_has_the_studys_unit(tmp_path: Path, ending: str, units: str) -> None:
    hand = pcjax.box_hand(0.2, palm_length=80, thickness=4.0)
    path = pcjax.export_hand(hand, tmp_path / f"hand.{ending}", units=units, body=pcjax.Circle(5.0))
    check_same(read_drawing(path, units=units), hand)
    found, own, doubts = drawn_hand(path)
    # An SVG file's page is in mm whatever the study's unit is.
    expected = "mm" if units == "model" or ending == "svg" else units
    assert (own, doubts) == (expected, [])
    size = {"model": 1, "mm": 1, "cm": 10, "m": 1000}[units] if ending == "svg" else 1
    assert found.palm_length == pytest.approx(80 * size, rel=1e-9)


@pytest.mark.parametrize("ending", ["svg", "dxf"])
def test_a_drawing_may_lie_anywhere_and_be_drawn_in_any_order(tmp_path: Path, ending: str) -> None:
    rng = np.random.default_rng(3)
    for hand in seeded(HANDS):
        points = moved(points_of(hand), rng.uniform(-4, 4), rng.uniform(-900, 900, 2))
        parts = three(hand, points)
        lines = [parts[k][:: rng.choice([-1, 1])] for k in rng.permutation(3)]
        if ending == "dxf":
            path = dxf(tmp_path / "hand.dxf", lines)
        else:
            shapes = [f'<polyline points="{numbers(p * [1, -1])}"/>' for p in lines]
            path = svg(tmp_path / "hand.svg", "".join(shapes))
        check_same(read_drawing(path), hand)


def test_a_line_in_one_piece_has_its_palm_in_the_middle_or_where_it_is_said(tmp_path: Path) -> None:
    for hand in seeded(HANDS // 2):
        n = [len(row) for row in hand.lengths]
        for step in (1, -1):
            path = dxf(tmp_path / "hand.dxf", [points_of(hand)[::step]])
            check_same(read_drawing(path, palm=n[0] + 1), hand)
            if n[0] == n[1]:
                check_same(read_drawing(path), hand)
            elif (n[0] + n[1]) % 2:
                with pytest.raises(ValueError, match=r"which of its .* lines is the palm"):
                    read_drawing(path)


def test_every_line_alone_with_the_palm_on_its_layer(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    for hand in seeded(HANDS // 2):
        points = points_of(hand)
        order = rng.permutation(len(points) - 1)
        lines = [points[k : k + 2][:: rng.choice([-1, 1])] for k in order]
        names = ["Palm" if k == len(hand.lengths[0]) else "0" for k in order]
        check_same(read_drawing(dxf(tmp_path / "hand.dxf", lines, names)), hand)
        shapes = [
            f'<line x1="{a[0]!r}" y1="{-a[1]!r}" x2="{b[0]!r}" y2="{-b[1]!r}" class="part {name}"/>'
            for (a, b), name in zip((p.tolist() for p in lines), names, strict=True)
        ]
        check_same(read_drawing(svg(tmp_path / "hand.svg", "".join(shapes))), hand)


def test_a_mirrored_drawing_is_the_hand_with_its_fingers_swapped(tmp_path: Path) -> None:
    for hand in seeded(20):
        path = dxf(tmp_path / "hand.dxf", [part * [-1, 1] for part in three(hand)])
        swapped = pcjax.HandDesign(hand.palm_length, hand.lengths[::-1], hand.angles[::-1])
        check_same(read_drawing(path), swapped)


def test_a_line_split_straight_on_has_a_joint_there(tmp_path: Path) -> None:
    hand = pcjax.HandDesign(80.0, ((60.0,), (50.0, 20.0)), ((1.5,), (1.6, 1.2)))
    points = np.insert(points_of(hand), 1, points_of(hand)[:2].mean(axis=0), axis=0)
    found = read_drawing(dxf(tmp_path / "hand.dxf", [points]))
    split = pcjax.HandDesign(80.0, ((30.0, 30.0), (50.0, 20.0)), ((1.5, 0.0), (1.6, 1.2)))
    check_same(found, split)


def test_ends_within_the_tolerance_are_joined(tmp_path: Path) -> None:
    (hand,) = seeded(1, (3, 2))
    parts = three(hand)
    size = np.ptp(points_of(hand), axis=0).max()
    parts[0] = parts[0] + [0.5e-6 * size, 0]
    check_same(read_drawing(dxf(tmp_path / "hand.dxf", parts)), hand, rtol=1e-5)
    parts[0] = parts[0] + [2e-6 * size, 0]
    with pytest.raises(ValueError, match="2 chains that do not touch"):
        read_drawing(dxf(tmp_path / "hand.dxf", parts))


def test_only_the_limbs_count_where_there_is_such_a_layer(tmp_path: Path) -> None:
    (hand,) = seeded(1, (2, 2))
    path = dxf(tmp_path / "hand.dxf", [points_of(hand), np.eye(2) * 1e3], ["limbs", "FRAME"])
    check_same(read_drawing(path), hand)
    file = ezdxf.readfile(path)  # pyright: ignore
    space = file.modelspace()
    space.add_circle((0, 0), 5, dxfattribs={"layer": "HOLES"})
    space.add_text("a hand", dxfattribs={"layer": "LIMBS"})
    file.saveas(path)
    check_same(read_drawing(path), hand)


def test_layers_that_are_off_do_not_count(tmp_path: Path) -> None:
    (hand,) = seeded(1, (2, 2))
    path = dxf(tmp_path / "hand.dxf", [points_of(hand), np.eye(2) * 1e3], ["A", "B"])
    file = ezdxf.readfile(path)  # pyright: ignore
    file.layers.add("B").off()
    file.saveas(path)
    check_same(read_drawing(path), hand)
    line = numbers(points_of(hand) * [1, -1])
    hidden = '<g style="display: none"><circle cx="1" cy="1" r="4"/></g><defs><path d="M0"/></defs>'
    hidden += (
        '<path visibility="hidden" d="M0 0L9 9"/><path style="visibility: hidden" d="M1 0L9 9"/>'
    )
    check_same(
        read_drawing(svg(tmp_path / "hand.svg", f'{hidden}<polyline points="{line}"/>')), hand
    )


def test_polylines_of_old_dxf_files_and_those_seen_from_behind(tmp_path: Path) -> None:
    (hand,) = seeded(1, (2, 2))
    for version in ("R12", "R2010"):
        file = ezdxf.new(version, units=4)  # pyright: ignore
        file.modelspace().add_polyline2d(points_of(hand).tolist())
        file.saveas(tmp_path / "hand.dxf")
        check_same(read_drawing(tmp_path / "hand.dxf"), hand)
    # With its normal along -z a polyline's own x points left.
    file = ezdxf.new(units=4)  # pyright: ignore
    line = file.modelspace().add_lwpolyline((points_of(hand) * [-1, 1]).tolist())
    line.dxf.extrusion = (0, 0, -1)
    file.saveas(tmp_path / "hand.dxf")
    check_same(read_drawing(tmp_path / "hand.dxf"), hand)


@pytest.mark.parametrize("relative", [True, False])
def test_paths_of_straight_lines_and_transforms_of_groups(tmp_path: Path, relative: bool) -> None:
    rng = np.random.default_rng(11)
    for hand in seeded(20):
        parts = three(hand)
        shapes = []
        for part in (parts[k] for k in (0, 2, 1)):  # none goes on where another one ends
            steps = np.diff(part, axis=0) if relative else part[1:]
            shapes.append(f"M{numbers(part[:1])} {'l' if relative else 'L'}{numbers(steps)}")
        turn, x, y = rng.uniform(-180, 180, 3).tolist()
        inside = (
            f'<g transform="translate({x!r}, {y!r}) rotate({turn!r})"><g transform="scale(2 -2)">'
            f'<path transform="matrix(0.5 0 0 0.5 3 -7)" d="{" ".join(shapes)}"/></g></g>'
        )
        check_same(read_drawing(svg(tmp_path / "hand.svg", inside)), hand)


@pytest.mark.parametrize(
    ("page", "unit", "size"),
    [
        ('width="100mm" height="200mm" viewBox="0 0 100 200"', "mm", 1.0),
        ('width="10cm" height="20cm" viewBox="0 0 1000 2000"', "mm", 0.1),
        ('width="1in" viewBox="0,0,254,9"', "mm", 0.1),
        ('width="100mm" height="900mm" viewBox="-5 -5 10 20"', "mm", 10.0),
        ('width="100mm" height="90mm"', "mm", 25.4 / 96),
        ('width="100px" height="200px" viewBox="0 0 10 20"', "", 1.0),
        ('width="100%" height="50"', "", 1.0),
        ("", "", 1.0),
    ],
)
def test_an_svg_files_unit(tmp_path: Path, page: str, unit: str, size: float) -> None:
    hand = pcjax.box_hand(palm_length=80)
    line = f'<polyline points="{numbers(points_of(hand) * [1, -1])}"/>'
    path = svg(tmp_path / "hand.svg", line, page)
    assert read_drawing(path).palm_length == pytest.approx(80 * size, rel=1e-9)
    # What has no unit is in the one that is asked for.
    cm = read_drawing(path, units="cm").palm_length
    assert cm == pytest.approx(8 * size if unit else 80.0, rel=1e-9)
    found, units, doubts = drawn_hand(path)
    scale = 1.0 if units == "mm" else 0.1
    assert found.palm_length == pytest.approx(80 * size * scale, rel=1e-9)
    assert bool(doubts) == (not unit or "in" in page.split('"')[1])


@pytest.mark.parametrize(
    ("code", "units", "size", "doubt"),
    [
        (4, "mm", 1, ""),
        (5, "cm", 1, ""),
        (6, "m", 1, ""),
        (0, "mm", 1, "does not say its unit"),
        (1, "mm", 25.4, "is in inches: its lengths are converted into mm"),
    ],
)
def test_a_dxf_files_unit(tmp_path: Path, code: int, units: str, size: float, doubt: str) -> None:
    hand = pcjax.box_hand(palm_length=80)
    path = dxf(tmp_path / "hand.dxf", [points_of(hand)], units=code)
    found, own, doubts = drawn_hand(path)
    assert own == units
    assert found.palm_length == pytest.approx(80 * size, rel=1e-9)
    assert doubt in " ".join(doubts)
    assert bool(doubts) == bool(doubt)


def test_a_dxf_file_without_a_header_has_no_unit(tmp_path: Path) -> None:
    lines = (np.array(points) for points in ([[0, 9], [0, 0]], [[0, 0], [5, 0]], [[5, 0], [5, 9]]))
    entities_text = "".join(
        f"0\nLINE\n8\n0\n10\n{a[0]}\n20\n{a[1]}\n11\n{b[0]}\n21\n{b[1]}\n" for a, b in lines
    )
    path = tmp_path / "hand.dxf"
    path.write_text(f"0\nSECTION\n2\nENTITIES\n{entities_text}0\nENDSEC\n0\nEOF\n")
    found, units, doubts = drawn_hand(path)
    assert (found.palm_length, units) == (5.0, "mm")
    assert "does not say its unit" in doubts[0]


# ------------------------------------------------------------------------------------ refused

U = np.array([[0.0, 90.0], [0.0, 0.0], [80.0, 0.0], [80.0, 90.0]])


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ("", "has no lines"),
        ('<path d=""/>', "has no lines"),
        ('<path d="M0 0 L0 9 C 1 1 2 2 3 3"/>', r"curve begins at \(0, 9\).*straight"),
        ('<path d="M0 0 A 5 5 0 0 1 9 9"/>', "curve.*layer LIMBS"),
        ('<circle cx="1" cy="2" r="3"/>', "curve"),
        ('<polygon points="0,0 9,0 9,9"/>', "close an outline"),
        ('<rect width="9" height="9"/>', "close an outline"),
        ('<path d="M0 0 L9 0 9 9 Z"/>', "close an outline"),
        ('<polyline points="0,0 9,0"/>', "has 1 lines: a hand has a palm"),
        ('<polyline points="0,0 9,0 9,9"/>', "has 2 lines"),
        ('<polyline points="0,0 9,0 18,0 27,0"/>', "enclose nothing"),
        ('<polyline points="0,0 0,9 0,9 9,9 9,0"/>', r"a line at \(0, 9\) has no length"),
        ('<polyline points="0,0 nan,9 9,9 9,0"/>', "<polyline>.*'nan', which is no number"),
        ('<polyline points="0,0 1e999,9 9,9 9,0"/>', "not finite, or far too large"),
        ('<polyline points="0,1e30 0,0 1e30,0 1e30,1e30"/>', "at most 1e"),
        ('<polyline points="0,0 0 9,9"/>', "x without a y"),
        ('<line id="tip" x1="1mm" x2="4"/>', "<line> 'tip' cannot be read.*'mm'"),
        ('<path d="M0 0 L"/>', "<path> cannot be read"),
        ('<polyline points="0,9 0,0 5,0 5,9 8,9"/>', "which of its 4 lines is the palm"),
        (
            '<polyline points="0,9 0,0 5,0 5,9"/><line x1="5" x2="9"/>',
            r"3 lines meet at \(5, 0\): a hand has no branches",
        ),
        (
            '<polyline points="0,9 0,0 5,0 5,9"/><line x1="6" y1="9" x2="9"/>',
            r"2 chains that do not touch: \(.*are 1 apart",
        ),
        (
            '<g class="palm"><polyline points="0,9 0,0 5,0 5,9"/></g>',
            "3 lines are on the layer PAL",
        ),
        (
            '<polyline points="0,9 0,0 5,0"/><line id="PALM" x1="5" x2="5" y2="9"/>',
            "cannot be the p",
        ),
        ('<use href="#a"/>', "<use> repeats"),
        ('<a><line x2="5"/></a>', "is in a <a>: only groups"),
        ('<line x2="5" transform="turn(3)"/>', "<line> cannot be read"),
        ('<line x2="5" style="transform: rotate(3deg)"/>', "moved by its style"),
        ('<line x2="5"/>' * (MOST_LINES + 1), f"more than {MOST_LINES} lines"),
        ("<g>", "cannot be read as SVG"),
    ],
)
def test_what_is_no_hand_in_svg(tmp_path: Path, inside: str, words: str) -> None:
    check_refused(svg(tmp_path / "hand.svg", inside), words)


@pytest.mark.parametrize(
    ("page", "words"),
    [
        ('width="9mm" viewBox="0 0 9"', "viewBox has to be four numbers"),
        ('width="9mm" viewBox="0 0 0 9"', "last two above 0"),
        ('width="-9mm" viewBox="0 0 9 9"', "above 0"),
        ('width="9mm" height="3mm" viewBox="0 0 9 9" preserveAspectRatio="none"', "stretched"),
    ],
)
def test_pages_without_a_size(tmp_path: Path, page: str, words: str) -> None:
    check_refused(svg(tmp_path / "hand.svg", f'<polyline points="{numbers(U)}"/>', page), words)


def check_refused(path: Path, words: str, **more: Any) -> None:
    """One line that names the file."""
    with pytest.raises(ValueError, match=words) as caught:
        read_drawing(path, **more)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_hand_in_dxf(tmp_path: Path) -> None:
    path = tmp_path / "hand.dxf"
    check_refused(dxf(path, []), "has no lines")
    check_refused(dxf(path, [U], close=True), "close an outline")
    check_refused(dxf(path, [U, U[:2] + np.array([0, 90])]), "has 4 lines|which of its 4 lines")
    check_refused(dxf(path, [U], units=21), "size is not known: save it in mm")
    bulged = np.column_stack([U, [0, 0.5, 0, 0]])
    check_refused(dxf(path, [bulged], format="xyb"), r"a curve begins at \(0, 0\)")
    wide = np.array([[0, 9], [math.nan, 0], [4, 0]])
    check_refused(dxf(path, [wide]), "not finite")
    check_refused(dxf(path, [U]), "line 0 of 3", palm=0)
    check_refused(dxf(path, [U]), "line 3 of 3", palm=3)
    file = ezdxf.new()  # pyright: ignore
    file.modelspace().add_polyline3d([(0, 9, 0), (0, 0, 0), (5, 0, 2), (5, 9, 0)])
    file.saveas(path)
    check_refused(path, "rises out of the plane")
    file = ezdxf.new()  # pyright: ignore
    file.blocks.new("FINGER").add_line((0, 0), (1, 1))
    file.modelspace().add_blockref("FINGER", (0, 0))
    file.saveas(path)
    check_refused(path, "block FINGER.*explode")
    file = ezdxf.new()  # pyright: ignore
    file.modelspace().add_arc((0, 0), 5, 0, 90)
    file.saveas(path)
    check_refused(path, "curve")


def test_outlines_that_tell_no_thickness(tmp_path: Path) -> None:
    path = dxf(tmp_path / "hand.dxf", [U, U + 5], ["LIMBS", "OUTLINES"])
    check_refused(path, "does not tell the thickness")
    assert read_drawing(path, thickness=3.0).thickness == 3.0


def test_files_that_are_no_drawings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_refused(tmp_path / "none.svg", "does not exist")
    (tmp_path / "folder.dxf").mkdir()
    check_refused(tmp_path / "folder.dxf", "folder")
    check_refused(tmp_path / "hand.step", r"ending has to be \.dxf or \.svg")
    for ending in ("svg", "dxf"):
        path = tmp_path / f"hand.{ending}"
        for content in (b"", b"hello", bytes(range(256)), b"<svg/>", b"0\nSECTION\n2\n"):
            path.write_bytes(content)
            check_refused(path, f"cannot be read as {ending.upper()}|no lines")
        monkeypatch.setattr(entities, "MOST_BYTES", 5)
        check_refused(path, "bytes: a hand's drawing has at most 5")
        monkeypatch.undo()
    with pytest.raises(ValueError, match="units is 'inch'"):
        read_drawing(tmp_path / "hand.svg", units="inch")


@pytest.mark.parametrize(("ending", "package"), [("svg", "svgpathtools"), ("dxf", "ezdxf")])
def test_what_is_to_be_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, package: str
) -> None:
    path = pcjax.export_hand(pcjax.box_hand(), tmp_path / f"hand.{ending}")
    real = builtins.__import__

    def missing(name: str, *rest: Any, **more: Any) -> Any:
        if name.split(".")[0] == package:
            raise ImportError(name, name=package)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    check_refused(path, re.escape(f"needs the package {package}: pip install 'pcjax[cad]'"))
