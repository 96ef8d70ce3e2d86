"""Bodies as they are described, started and drawn."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf
import jax
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

import pcjax
from pcjax.cli import main
from pcjax.geometry import Vec
from pcjax.model.bodies.base import placed_outline
from pcjax.model.bodies.convex import Convex
from pcjax.model.scenario import Scenario
from pcjax.physics.state import PASSED, State
from pcjax.physics.step import begin
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.replay import Recording, record
from pcjax.view.export import export_hand
from pcjax.view.scene import draw_scene
from pcjax.view.shapes import rounded
from tests.test_convex import slid

pytestmark = pytest.mark.usefixtures("quick_programs")

HAND = pcjax.box_hand()
ROUGH = pcjax.ContactLaw(friction=0.3)
WEDGE = ((0.0, 0.0), (60.0, 0.0), (0.0, 80.0))
"""Another one than its mirror image."""

# --------------------------------------------------------------------------- drawn orientations


@jax.jit
def started(scenario: Scenario, trials: jax.Array) -> State:
    """The first states of trials."""
    count = scenario.draws_for_start
    return jax.vmap(lambda i: begin(scenario, start_draws(trial_key(0, i), count)))(trials)


def test_a_drawn_orientation_is_uniform_and_moves_no_other_draw() -> None:
    trials = np.arange(4000)
    drawn = started(pcjax.does(HAND, pcjax.Square(60.0, orientation="random")), trials)
    fixed = started(pcjax.does(HAND, pcjax.Square(60.0, orientation=0.3)), trials)
    np.testing.assert_array_equal(drawn.position.x, fixed.position.x)
    np.testing.assert_array_equal(drawn.position.y, fixed.position.y)
    angles = np.asarray(drawn.angle)
    counts, _ = np.histogram(angles, 20, (-math.pi, math.pi))
    assert counts.sum() == 4000
    assert ((counts - 200) ** 2 / 200).sum() < 43.8  # chi-squared of 19, 0.1 %
    # Neither the place nor the first targets tell it.
    others = [drawn.position.x, drawn.position.y]
    others += list(jax.vmap(lambda i: period_draws(trial_key(0, i), 0, 2))(trials).T)
    for other in others:
        assert abs(np.corrcoef(angles, np.asarray(other))[0, 1]) < 0.05
    # The draws that there were before keep every bit.
    key = trial_key(7, 5)
    np.testing.assert_array_equal(start_draws(key, 4)[:3], start_draws(key, 3))


def test_whether_an_orientation_is_drawn_is_part_of_the_structure() -> None:
    drawn = pcjax.Stick(50.0, orientation="random")
    assert drawn.orientation is None
    assert len(jax.tree.leaves(drawn)) == 2
    assert drawn.having(orientation=1.0).orientation == 1.0
    assert pcjax.Stick(50.0, 1.0).having(orientation="random") == drawn


def test_a_drawn_orientation_is_the_recordings() -> None:
    scenario = pcjax.does(HAND, pcjax.Stick(25.0, orientation="random"))
    film = record(scenario, seed=0, trial=2, max_steps=1000, dt=0.01)
    assert film.angle is not None
    assert film.angle[0] == pytest.approx(float(started(scenario, np.arange(3)).angle[2]))


# ----------------------------------------------------------------------------------------- pucks


def test_a_puck_brakes_and_never_turns() -> None:
    puck = pcjax.Square(60.0, 0.5, turns=False)
    stops = slid(puck, (0.0, -10.0), 0.3, speed=6.0)
    assert float(stops.position.x) == pytest.approx(6.0**2 / (2 * 3), rel=1e-3)
    # What would tip sticks.
    tips = slid(puck, (11.0, -10.0), 2.0)
    assert (float(tips.position.x), float(tips.angle)) == (0.0, 0.0)


# -------------------------------------------------------------------------- files, flags, messages


def inspected(capsys: pytest.CaptureFixture[str], line: str) -> str:
    """What `pcjax inspect` prints of the object, in one line."""
    main(["inspect", *line.split()])
    out = " ".join(capsys.readouterr().out.split())
    return out.partition("object ")[2].partition(" DoEs")[0]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "square --side 60 --rounding 2 --orientation 20",
            "square of side 60, at 20 deg to the palm; a gap of 60 lets it through",
        ),
        (
            "rectangle --sides 40 60 --orientation random",
            "rectangle of 40 by 60, at any angle to the palm; a gap of 40 lets it through",
        ),
        (
            "capsule --length 80 --diameter 10 --turns no",
            "capsule of length 80 and diameter 10, at 0 deg to the palm, never turned; a gap of 10 "
            "lets it through if it lies well",
        ),
        (
            "regular --number 6 --circumradius 30",
            "regular polygon of 6 vertices and circumradius 30, at 0 deg to the palm; a gap of "
            "51.96 lets it through",
        ),
        ("circle --turns no", "circle of radius 25, never turned; a gap of 50 lets it through"),
    ],
)
def test_flags_give_a_body(capsys: pytest.CaptureFixture[str], line: str, words: str) -> None:
    assert inspected(capsys, f"--body {line} --friction 0.3") == words


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--body square", "--side is missing"),
        ("--body square --side -3", "--side is -3: it has to be above 0"),
        (
            "--body square --side 60 --rounding 40",
            "--rounding is 40: it has to be less than half of the side, 30",
        ),
        ("--body square --side 60 --radius 3", "--radius does not apply to the body square"),
        ("--body square --side 600", "the square of side 600 does not fit at its start"),
        ("--body regular --circumradius 30", "--number is missing"),
        ("--body regular --number 2 --circumradius 30", "--number is 2: it has to lie between 3"),
        ("--body regular --number 5.5 --circumradius 30", "'5.5' is not a whole number"),
        ("--body capsule --length 8 --diameter 9", "--diameter is 9: it has to be less than the l"),
        ("--body stick --orientation any", "'any' is not a number, nor random"),
        ("--body stick --turns maybe", "'maybe': it has to be one of yes, no"),
        ("--body polygon", "vertices is missing"),
    ],
)
def test_what_is_wrong_with_a_body_is_said_in_a_line(
    capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["evaluate", *line.split(), "--trials", "2"])
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('kind = "stick"\norientation = "any"', "orientation is 'any': it has to be 'random'"),
        (
            'kind = "stick"\norientation = 30',
            "orientation is 30: .* orientation_deg is for numbers",
        ),
        ('kind = "stick"\norientation = "random"\norientation_deg = 3', "give one of them"),
        (
            'kind = "circle"\norientation = "random"',
            "orientation does not apply to the body circle",
        ),
        ('kind = "circle"\nturns = "no"', "turns is 'no': it has to be true or false"),
        ('kind = "regular"\ncircumradius = 3\nnumber = 5.0', "number is 5.0: .* whole number"),
        (
            'kind = "polygon"\nvertices = [[0, 0], [9, 9], [9, 0], [0, 9]]',
            "the outline crosses itself",
        ),
        ('kind = "polygon"\nvertices = [[0, 0], [9, 0], [9, 0], [0, 9]]', "two are the same"),
        ('kind = "polygon"\nvertices = [[0, 0], [9, 0], [18, 0]]', "they lie on one line"),
    ],
)
def test_what_is_wrong_with_a_table_is_said(tmp_path: Path, table: str, words: str) -> None:
    path = tmp_path / "study.toml"
    path.write_text(f"[body]\n{table}\n")
    with pytest.raises(ValueError, match=rf"line \d: \[body\] .*{words}"):
        pcjax.load_study(path)


def test_words_and_whole_numbers_come_back_and_flags_win(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    body = pcjax.RegularPolygon(5, 30.0, 1.0, "random", turns=False)
    study = pcjax.Study(HAND, body)
    path = tmp_path / "study.toml"
    path.write_text(study.to_toml())
    assert pcjax.load_study(path).body == body
    words = "at 30 deg to the palm; a gap of"
    assert words in inspected(capsys, f"{path} --orientation 30 --turns yes")
    assert study.having({"orientation_deg": 90.0}).body.orientation == math.pi / 2
    assert study.having({"number": 6.0}).body == body.having(number=6)
    with pytest.raises(ValueError, match="there is no turns to be swept"):
        study.having({"turns": 0.0})
    assert "turns" not in pcjax.Study(HAND, pcjax.Circle(5.0)).to_toml()


def test_a_polygon_is_the_same_in_either_sense() -> None:
    """In a compiled program, too, where nothing can be turned around any more."""
    clockwise = pcjax.Polygon((WEDGE[0], WEDGE[2], WEDGE[1]), 2.0)
    assert clockwise == pcjax.Polygon(WEDGE, 2.0)
    inside = jax.jit(lambda body: body.vertices)(clockwise)
    outside = clockwise.vertices
    np.testing.assert_allclose(jax.tree.leaves(inside), jax.tree.leaves(outside), rtol=1e-5)

    class Clockwise(Convex):
        side: Any = 3.0
        rounding = 0.0

        def core(self) -> tuple[Vec, ...]:
            return Vec(0.0, 0.0), Vec(0.0, self.side), Vec(self.side, 0.0)

    with pytest.raises(ValueError, match="the core goes clockwise"):
        Clockwise()


# ------------------------------------------------------------------------------ seen from outside


def test_what_differs_from_its_image_is_mirrored_for_entering() -> None:
    wedge = pcjax.Polygon(WEDGE, 2.0, 0.4)
    assert pcjax.does(HAND, wedge).body == wedge
    image: Any = pcjax.eoen(HAND, wedge).body
    assert image.corners == ((0.0, -80.0), (60.0, 0.0), (0.0, 0.0))
    assert (image.orientation, image.rounding) == (0.4, 2.0)
    assert float(image.width) == pytest.approx(float(wedge.width))
    assert float(image.inertia) == pytest.approx(float(wedge.inertia), rel=1e-5)
    square = pcjax.Square(60.0, orientation=0.4)
    assert pcjax.eoen(HAND, square).body == square
    # A shape and its image are one with the x axis for a mirror.
    for symmetric in (pcjax.Rectangle((30, 50), 3), pcjax.RegularPolygon(5, 20), pcjax.Stick(9)):
        own = np.array([[float(v.x), float(v.y)] for v in symmetric.vertices])
        away = np.linalg.norm(own[:, None] * [1, -1] - own[None], axis=-1).min(axis=0)
        np.testing.assert_allclose(away, 0.0, atol=1e-5)


# --------------------------------------------------------------------------------------- pictures


def test_outlines_are_those_of_the_inflated_polygons() -> None:
    """Their area: polygon, a rectangle on each edge, and a whole disc at the corners."""
    for body in (pcjax.Polygon(WEDGE, 4.0), pcjax.Capsule(80, 20), pcjax.Square(60)):
        corners, rounding = placed_outline(body, np.array([3.0, 4.0]), 0.7)
        outline = rounded(corners, rounding)
        edges = np.roll(corners, -1, axis=0) - corners
        ring = np.hypot(*edges.T).sum() * rounding + math.pi * rounding**2
        assert _area(outline) == pytest.approx(_area(corners) + ring, rel=1e-3)
    disc = rounded(np.array([[1.0, 2.0]]), 5.0)
    np.testing.assert_allclose(np.hypot(*(disc - [1.0, 2.0]).T), 5.0)


def _area(points: np.ndarray) -> float:
    after = np.roll(points, -1, axis=0)
    return float((points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]).sum() / 2)


@pytest.mark.parametrize(
    ("body", "law", "tip"),
    [
        (pcjax.Square(60.0), None, 30.0),
        (pcjax.Capsule(80.0, 20.0), None, 40.0),
        (pcjax.Circle(25.0), ROUGH, 25.0),
        (pcjax.Circle(25.0), None, None),
        (pcjax.Stick(25.0), None, None),
    ],
)
def test_a_film_shows_how_the_object_lies(body: Any, law: Any, tip: float | None) -> None:
    """A white line from the centre to the outline, along the body's own x axis."""
    times = np.linspace(0.0, 2.0, 5)
    position = np.stack([10 * times, 100 + 20 * times], axis=-1)
    scenario = pcjax.does(HAND, body, law=law)
    recording = Recording(scenario, 0, 0, PASSED, 2.0, 0.5, times, position, 0.5 * times)
    axis = Figure().subplots()
    draw_scene(axis, recording, recording.at(times), 2)
    marks = [line.get_xydata() for line in axis.lines if line.get_color() == "white"]
    assert len(axis.patches) == (not isinstance(body, pcjax.Stick))
    if tip is None:
        assert not marks
        return
    way = np.array([math.cos(0.5), math.sin(0.5)])
    np.testing.assert_allclose(marks, [[[10, 120], np.array([10, 120]) + tip * way]], atol=0.05)
    if isinstance(body, pcjax.Square):
        (patch,) = axis.patches
        assert isinstance(patch, Polygon)
        corners = placed_outline(body, np.array([10.0, 120.0]), 0.5)[0]
        np.testing.assert_allclose(patch.get_xy()[:4], corners, atol=1e-4)


def test_drawings_have_the_rounded_outline(tmp_path: Path) -> None:
    body = pcjax.Polygon(WEDGE, 4.0, 0.3)
    start = np.array([float(x) for x in jax.tree.leaves(pcjax.does(HAND, body).corner_start())])
    corners, _ = placed_outline(body, start)
    file = ezdxf.readfile(export_hand(HAND, tmp_path / "wedge.dxf", body=body))  # pyright: ignore
    (line,) = file.modelspace().query('LWPOLYLINE[layer=="OBJECT"]')
    points = np.array(line.get_points("xyb"))
    assert line.closed
    # Straight and round in turn, 4 from the corners, and once around in all.
    away = np.linalg.norm(points[:, None, :2] - corners[None], axis=-1).min(axis=1)
    np.testing.assert_allclose(away, 4.0, rtol=1e-4)
    assert 4 * np.arctan(points[:, 2]).sum() == pytest.approx(2 * math.pi)
    root = ElementTree.parse(export_hand(HAND, tmp_path / "wedge.svg", body=body)).getroot()
    (path,) = root.iterfind(".//*[@id='OBJECT']/*")
    text = path.get("d", "")
    assert text.count("A4.0,4.0") == 3
    first = np.array(text.split()[0][1:].split(","), float)
    np.testing.assert_allclose(first, points[0, :2], rtol=1e-6)
    sharp = export_hand(HAND, tmp_path / "square.svg", body=pcjax.Square(60))
    (path,) = ElementTree.parse(sharp).getroot().iterfind(".//*[@id='OBJECT']/*")
    assert [part[0] for part in path.get("d", "").split()] == list("MLLLZ")


def test_inspect_draws_the_body_in_the_circle_that_it_turns_in() -> None:
    from pcjax.view.designs import plot_inspection

    wedge = pcjax.Polygon(WEDGE, 2.0, "random")
    figure = plot_inspection(pcjax.inspect(pcjax.Study(HAND, wedge)))
    areas = []
    for axis in figure.axes:
        (drawn,) = [patch for patch in axis.patches if type(patch) is Polygon]
        outline = np.asarray(drawn.get_xy())[:-1]
        (circle,) = [patch for patch in axis.patches if hasattr(patch, "radius")]
        far = np.hypot(*(outline - np.array(circle.center)).T)
        assert far.max() == pytest.approx(float(wedge.radius), rel=1e-4)
        areas.append(_area(outline))
    assert areas[0] == pytest.approx(areas[1], rel=1e-4)


def test_a_gap_narrower_than_a_triangle_is_no_sure_cage() -> None:
    """Its centre is past two fingertips that hold its base back: where they are 2/3 of a side apart
    or more. Then trials that all stay do not make it certain that one never gets out."""
    triangle = pcjax.RegularPolygon(3, 111.0)
    hand = pcjax.box_hand(math.radians(10))
    gap = float(hand.gap())
    assert 2 / 3 * 111.0 * math.sqrt(3) < gap < float(triangle.width)
    assert triangle.least_passage() == pytest.approx(111.0)
    assert pcjax.Square(60.0, 0.3).least_passage() == pytest.approx(60.0)
    kept = pcjax.evaluate(hand, triangle, trials=8, max_steps=5000, direction="does")
    index1 = kept.indices("does")["index1"]
    assert (index1.value, index1.high) == (5000, 5000)
    assert index1.low < 5000
    assert "no more than its centre passes" in " ".join(str(kept).split())
    square = pcjax.evaluate(hand, pcjax.Square(170.0), trials=8, max_steps=5000, direction="does")
    assert square.indices("does")["index1"].low == 5000
    assert "nothing passes" in " ".join(str(square).split())
