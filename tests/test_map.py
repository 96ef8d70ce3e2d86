"""Maps of the score: what is scored, what is not, and that it is the exact score."""

from __future__ import annotations

import json
import math
from dataclasses import astuple, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure

import pcjax
from pcjax.cli import main
from pcjax.design.compare import compare
from pcjax.model.checking import check_geometry
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.view import designs

pytestmark = pytest.mark.usefixtures("quick_programs")

CIRCLE = pcjax.Circle(25.0)
HAND = pcjax.box_hand()


def surrogate(body: pcjax.Circle | pcjax.Stick = CIRCLE) -> pcjax.Surrogate:
    task = pcjax.Task(body, pcjax.WristTilt(), ("does", "eoen"), 20_000, units="mm")
    return pcjax.Surrogate(task, form="exact", trials=30)


def space(
    hand: pcjax.HandDesign = HAND, width: float = 50.0, **bounds: tuple[float, float]
) -> pcjax.DesignSpace:
    free = bounds or {"fingertip_angle_deg": (-20.0, 70.0), "gap_width": (50.0, 200.0)}
    return pcjax.design_space(hand, free, width, 0.0)


def test_a_hand_whose_score_the_trials_cannot_tell_is_hatched() -> None:
    data = pcjax.score_map(surrogate(), space(), (4, 3))
    names = {text.get_text() for text in pcjax.plot_map(data).legends[0].texts}
    assert "a score that is undefined" not in names
    row, column = np.argwhere(np.isfinite(data.score.values[..., 0, 0]))[0]
    data.score.values[row, column] = math.nan
    names = {text.get_text() for text in pcjax.plot_map(data).legends[0].texts}
    assert "a score that is undefined" in names


def test_a_map_without_any_score_is_refused() -> None:
    """By index 2, with no trial that lasts."""
    wide = {"fingertip_angle_deg": (-20.0, 0.0), "gap_width": (350.0, 400.0)}
    task = replace(surrogate().task, body=pcjax.Circle(5.0), max_steps=2_000_000)
    long = pcjax.Surrogate(task, objective="index2", form="exact", trials=4)
    with pytest.raises(ValueError, match="no hand on the map has a score: nowhere does a trial"):
        pcjax.score_map(long, space(width=10.0, **wide), (2, 2))


def test_a_maps_scores_are_compares() -> None:
    where = space()
    data = pcjax.score_map(surrogate(), where, (4, 2), seed=5)
    assert data.score.dims == ("gap_width", "fingertip_angle_deg", "index", "statistic")
    designs = [np.array([10.0, 200.0]), np.array([-20.0, 50.0])]
    found = compare(surrogate(), where, designs, trials=30, seed=5)
    for (x, y), score in zip(designs, found.scores, strict=True):
        at = data.sel(fingertip_angle_deg=x, gap_width=y)
        assert at.score.sel(index="index1").values == pytest.approx(astuple(score), rel=1e-9)
    # The base hand is on the grid, and told by itself as well.
    assert data.attrs["current_score"] == pytest.approx(found.scores[0].value, rel=1e-9)
    counted = pcjax.evaluate(HAND, CIRCLE, trials=30, max_steps=20_000, seed=5)
    assert found.scores[0].value == pytest.approx(counted.score()["index1"].value, rel=1e-6)


def test_a_searchs_map_scores_each_hand_as_if_it_were_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Trials that go wrong are left out of all hands; long fingertips that flare leave no room."""
    lengths, degrees = ((7.0, 3.1, 2.2), (5.5, 3.8, 2.6)), ((88, 75, 70), (95, 70, 60))
    hand = pcjax.HandDesign(14.0, lengths, tuple(tuple(map(math.radians, d)) for d in degrees))
    drive, body = pcjax.WristTilt(gravity=980.0), pcjax.Circle(1.4)
    task = pcjax.Task(body, drive, ("does", "eoen"), 20_000, units="cm")
    free = {"fingertip_angle_deg": (-30.0, 50.0), "fingertip_length": (0.7, 4.9)}
    where, scored = pcjax.design_space(hand, free, 2.8), pcjax.Surrogate(task, trials=30)
    best = np.array([10.0, 2.8])
    progress = SimpleNamespace(history=[[]])
    found: Any = SimpleNamespace(
        best=best, progress=progress, candidates=[SimpleNamespace(design=best)], tried=()
    )
    drawn: list[np.ndarray] = []
    draw = designs.draw_contours
    monkeypatch.setattr(designs, "_MAP", 3)
    monkeypatch.setattr(designs, "draw_contours", lambda *a: (drawn.append(a[3]), draw(*a)))
    designs.draw_map(Figure().subplots(), found, where, scored)
    for (column, row), design in {(0, 0): (-30.0, 0.7), (1, 0): (10.0, 0.7), (1, 1): best}.items():
        alone = compare(scored, where, [np.array(design)], trials=30, seed=0)
        assert alone.invalid == 0
        assert drawn[0][row, column] == pytest.approx(alone.scores[0].value, rel=1e-6)
    assert np.isfinite(drawn[0]).all()  # the nearest hand with room


def test_hands_without_a_score_are_those_that_are_closed_or_cannot_be() -> None:
    where = space(fingertip_angle_deg=(-20.0, 80.0), gap_width=(30.0, 230.0))
    data = pcjax.score_map(surrogate(), where, (5, 5))
    for x in data.fingertip_angle_deg.values:
        for y in data.gap_width.values:
            at = data.sel(fingertip_angle_deg=x, gap_width=y)
            hand = pcjax.box_hand(math.radians(x), gap_width=y)
            try:
                gap, _ = (check_geometry(make(hand, CIRCLE)) for make in (pcjax.does, pcjax.eoen))
            except ValueError:
                assert not at.possible
                assert np.isnan(at.score).all()
                continue
            assert at.possible
            assert float(at.gap) == pytest.approx(gap, rel=1e-9)
            # Tips that tilt inwards by t leave W_g - 2 L_g sin t.
            expected = min(y, y - 200 * math.sin(math.radians(x)))
            assert float(at.gap) == pytest.approx(expected, abs=1e-6)
            assert (
                bool(at.full_cage)
                == (gap < 50 * (1 - 1e-9))
                == bool(np.isnan(at.score.values[0, 0]))
            )
    assert data.full_cage.any()
    assert not data.possible.all()
    assert data.attrs["hands"] == int(np.isfinite(data.score.sel(statistic="value")).sum())


def test_the_hatched_region_ends_where_the_gap_is_the_objects_width() -> None:
    where, exact = space(), surrogate()
    figure = pcjax.plot_map(pcjax.score_map(exact, where, (4, 3)))
    axis = figure.axes[0]
    regions = [
        found
        for found in axis.collections
        if isinstance(found, QuadContourSet) and found.filled and any(found.hatches)
    ]
    assert len(regions) == 2
    assert not any(isinstance(found, QuadMesh) for found in axis.collections)
    edges = [
        found
        for found in axis.collections
        if isinstance(found, QuadContourSet) and not found.filled and len(found.levels) == 1
    ]
    (edge,) = (found for found in edges if found.levels[0] == 50)
    corners = np.concatenate([path.vertices for path in edge.get_paths()])
    gaps, possible = where.holding(exact.task).look(corners)
    np.testing.assert_allclose(gaps[possible], 50.0, atol=0.1)
    # A point of the hatched region is closed, one beyond its edge is open.
    inside = regions[0].get_paths()[0]
    for design, closed in (([0.0, 51.0], False), ([20.0, 110.0], True), ([20.0, 125.0], False)):
        assert inside.contains_point(design) is closed
        assert (float(where.holding(exact.task).look(np.array(design))[0]) < 50) is closed


def test_a_current_hand_that_is_not_on_the_map_is_not_marked() -> None:
    own = pcjax.HandDesign(
        400.0, ((350.0, 120.0, 80.0), (300.0, 100.0, 60.0)), ((1.4, 1.66, 1.3), (1.48, 1.66, 1.05))
    )
    exact = replace(surrogate(pcjax.Circle(20.0)), trials=4)
    for bounds, marked in (
        ({"fingertip_angle_deg": (0.0, 30.0), "fingertip_length_1": (50.0, 100.0)}, False),
        ({"fingertip_angle_1_deg": (0.0, 30.0), "fingertip_length_2": (50.0, 100.0)}, True),
        ({"fingertip_angle_1_deg": (0.0, 10.0), "fingertip_length_2": (50.0, 100.0)}, False),
    ):
        where = space(own, 40.0, **bounds)
        data = pcjax.score_map(exact, where, (2, 2))
        assert ("current_score" in data.attrs) is marked
        figure = pcjax.plot_map(data)
        assert any(line.get_marker() == "*" for line in figure.axes[0].lines) is marked


def test_a_stick_is_never_in_a_full_cage() -> None:
    stick = pcjax.Stick(25.0)
    where = space(width=float(stick.width))
    gaps, possible = where.holding(surrogate(stick).task).look(
        np.array([[10.0, 200.0], [0.0, 10.0]])
    )
    assert possible.all()
    assert (gaps > 0).all()


@pytest.mark.parametrize(
    ("bounds", "points", "words"),
    [
        ({"gap_width": (100.0, 200.0)}, (3,), "two free parameters"),
        (
            {"gap_width": (100.0, 200.0), "fingertip_angle_deg": (0.0, 9.0)},
            (1, 3),
            "gap_width is 1",
        ),
        (
            {"gap_width": (10.0, 40.0), "fingertip_angle_deg": (0.0, 9.0)},
            (2, 2),
            "no hand on the map",
        ),
    ],
)
def test_what_cannot_be_mapped_is_refused(
    bounds: dict[str, tuple[float, float]], points: tuple[int, ...], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        pcjax.score_map(surrogate(), space(**bounds), points)


def test_a_map_is_drawn_again_from_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = pcjax.score_map(surrogate(), space(), (4, 3))
    assert (data.attrs["body"], data.attrs["drive"]) == ("Circle", "WristTilt")
    numbers = json.loads(data.attrs["parameters"])
    assert numbers["does"]["body.radius"] == 25
    assert (data.attrs["length_unit"], data.gap.units) == ("mm", "mm")
    save_dataset(data, tmp_path / "map.nc")
    main(["plot", str(tmp_path / "map.nc"), "--plot", str(tmp_path / "map.png")])
    picture = pcjax.plot_map(data)
    labels = (picture.axes[0].get_xlabel(), picture.axes[0].get_ylabel())
    assert labels == ("fingertip angle [deg]", "gap width [mm]")
    picture.savefig(tmp_path / "same.png", dpi=130)
    drawn, same = (matplotlib.image.imread(tmp_path / name) for name in ("map.png", "same.png"))
    np.testing.assert_array_equal(drawn, same)
    main(["show", str(tmp_path / "map.nc")])
    assert "best" in capsys.readouterr().out
    # As they were before they held the finer grid.
    earlier = data.drop_dims([str(dim) for dim in data.gap_fine.dims])
    assert pcjax.plot_map(earlier).axes


def test_a_map_of_the_objects_size_is_that_of_each_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Radii and angles: each score as by `compare` with that object, closed where it does not pass,
    and the picture names the unit."""
    monkeypatch.chdir(tmp_path)
    line = (
        "map --x fingertip-angle=0:30 --y radius=20:80 --points 2 3 --trials 20 "
        "--max-steps 20_000 --json --out map.nc"
    )
    main(line.split())
    told = json.loads(capsys.readouterr().out)
    assert told["y"] == {"parameter": "radius", "values": [20.0, 50.0, 80.0]}
    # A gap of 200 with fingertips of 100 at 30 degrees leaves 100.
    assert told["full_cage"] == [[False, False], [False, False], [False, True]]
    assert told["score"][2][1] is None
    assert told["current"]["parameters"] == {
        "fingertip_angle_deg": pytest.approx(10.0),
        "radius": pytest.approx(25.0),
    }
    for row, radius in enumerate((20.0, 50.0)):
        for column, angle in enumerate((0.0, 30.0)):
            hand = pcjax.box_hand(math.radians(angle))
            found = pcjax.evaluate(hand, pcjax.Circle(radius), trials=20, max_steps=20_000)
            score = found.score()["index1"].value
            assert told["score"][row][column] == pytest.approx(score, rel=1e-4)
    figure = pcjax.plot_map(load_dataset(tmp_path / "map.nc"))
    assert figure.axes[0].get_ylabel() == "radius [model length]"


def test_a_map_may_have_nothing_of_the_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    line = (
        "map --x start-spread=0:0.1 --y restitution=0:0.5 --points 2 2 --trials 20 "
        "--max-steps 20_000 --json"
    )
    main(line.split())
    told = json.loads(capsys.readouterr().out)
    assert [told[side]["parameter"] for side in "xy"] == ["start_spread", "restitution"]
    law = pcjax.ContactLaw(restitution=0.5)
    found = pcjax.evaluate(law=law, start_spread=0.1, trials=20, max_steps=20_000)
    assert told["score"][1][1] == pytest.approx(found.score()["index1"].value, rel=1e-4)
