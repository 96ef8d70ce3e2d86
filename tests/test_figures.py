"""Figures as data, and the verdicts on the paper's claims drawn from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
import xarray as xr

import pcjax
from pcjax.paper import constants as paper
from pcjax.paper.claims import FIGURES_NEEDED, IN_PART, NOT, REPRODUCED, judge_claims
from pcjax.paper.figures import check_figure, curve, run_figure, score_curve
from pcjax.paper.pictures import plot_figure
from pcjax.paper.readings import LITERAL, RUBBING, rubbing_wrist
from pcjax.results.schema import STATISTICS

pytestmark = pytest.mark.usefixtures("quick_programs")

RUN = {"trials": 60, "max_steps": 40_000, "seed": 3}


@pytest.fixture(scope="module")
def grid() -> xr.Dataset:
    return run_figure("12", **RUN)


def test_a_figures_estimates_are_those_of_evaluate(grid: xr.Dataset) -> None:
    hand = pcjax.box_hand(math.radians(20))
    alone = pcjax.evaluate(hand, pcjax.Circle(25.0), **RUN)
    line = score_curve(grid, {"radius": 0.05})
    score = alone.score()["index1"]
    assert line.value[line.at(20.0)] == pytest.approx(score.value, rel=1e-12)
    assert line.se[line.at(20.0)] == pytest.approx(score.se, rel=1e-9)
    does = curve(grid, "does", "index2", {"radius": 0.05})
    index2 = alone.indices("does")["index2"]
    assert does.value[does.at(20.0)] == pytest.approx(index2.value, rel=1e-12)
    # n - 1 against n in the denominator
    assert does.se[does.at(20.0)] == pytest.approx(index2.se * math.sqrt(60 / 59), rel=1e-9)


def test_differences_along_a_curve_are_paired(grid: xr.Dataset) -> None:
    runs = [
        pcjax.evaluate(
            pcjax.box_hand(math.radians(angle)),
            pcjax.Circle(25.0),
            direction="does",
            **RUN,
        )
        for angle in (0.0, 20.0)
    ]
    early, late = (run.dataset.escape_step.values[0].astype(float) for run in runs)
    value, se = curve(grid, "does", where={"radius": 0.05}).difference(20.0, 0.0)
    assert value == pytest.approx((late - early).mean())
    assert se == pytest.approx((late - early).std(ddof=1) / math.sqrt(60))


def test_a_contrast_adds_up_terms_at_one_angle(grid: xr.Dataset) -> None:
    line = score_curve(grid, {"radius": 0.05})
    assert line.difference(10.0, 10.0) == (0.0, 0.0)


def test_settings_are_the_papers(grid: xr.Dataset) -> None:
    assert grid.sizes["condition"] == 90
    assert set(grid.radius.values) == {0.01, 0.05, 0.1}
    assert set(grid.direction.values) == {"does", "eoen"}
    assert np.all(grid["count"].sum("status_name") == RUN["trials"])
    shut = grid.gap.values < 2 * grid.radius.values * 500 * (1 - 1e-9)
    index2 = grid.index2.sel(statistic="value").values
    assert np.all(index2[shut] == 1.0)
    assert np.all(index2[~shut & (grid.angle.values < 20)] < 1.0)


@pytest.fixture(scope="module")
def rubbed() -> xr.Dataset:
    return run_figure("12", RUBBING, trials=20, max_steps=20_000, seed=3)


def test_a_figure_under_the_other_reading_is_of_pucks_that_rub(rubbed: xr.Dataset) -> None:
    hand = pcjax.box_hand(math.radians(20))
    alone = pcjax.evaluate(
        hand,
        pcjax.Circle(25.0, turns=False),
        drive=pcjax.WristTilt(gravity=98.0),
        law=pcjax.ContactLaw(friction=0.35),
        trials=20,
        max_steps=20_000,
        seed=3,
    )
    for direction in ("does", "eoen"):
        line = curve(rubbed, direction, where={"radius": 0.05})
        assert line.value[line.at(20.0)] == alone.indices(direction)["index1"].value
    preset = rubbing_wrist(hand, 25.0, "eoen")
    named = pcjax.evaluate_grid([preset], {"n": [0]}, trials=20, max_steps=20_000, seed=3)
    assert float(named.index1.sel(statistic="value")[0]) == line.value[line.at(20.0)]


def test_what_is_drawn_under_another_reading_says_so(rubbed: xr.Dataset, grid: xr.Dataset) -> None:
    (axis,) = plot_figure(rubbed).axes
    assert "rubbing: gravity 98, friction 0.35, circles that do not turn" in axis.get_title()
    (axis,) = plot_figure(grid).axes
    assert LITERAL.name not in axis.get_title()


def test_a_figure_kept_when_steps_were_wider_is_still_one(grid: xr.Dataset) -> None:
    check_figure(grid)
    every_second = np.flatnonzero(grid.angle.values % 10 == 0)
    kept = grid.isel(condition=every_second, condition_2=every_second)
    check_figure(kept)
    line, fine = (score_curve(data, {"radius": 0.05}) for data in (kept, grid))
    assert line.difference(20.0, 0.0) == pytest.approx(fine.difference(20.0, 0.0), rel=1e-12)
    with pytest.raises(ValueError, match=r"not those of Fig\. 12"):
        check_figure(grid.isel(condition=every_second[1:], condition_2=every_second[1:]))


def test_unknown_figure_is_refused() -> None:
    with pytest.raises(ValueError, match="'16'"):
        run_figure("16", **RUN)


def synthetic(name: str, index1: dict, index2: object = None, se: float = 1e-3) -> xr.Dataset:
    """A figure's dataset with given curves (angle -> value in limits) and independent errors."""
    figure = paper.FIGURES[name]
    rows = [
        (d, w, r, a)
        for w in figure.gap_widths
        for r in figure.radii
        for a in figure.angles_deg
        for d in figure.directions
    ]
    key = {"gap_width": 1, "radius": 2}[figure.varies]
    one = np.array([index1[(row[0], row[key])](row[3]) for row in rows]) * 600_000
    two = np.array([index2(row[3]) for row in rows]) if callable(index2) else one / 600_000
    n = len(rows)
    covariance = np.zeros((2, 2, n, n))
    covariance[0, 0] = np.eye(n) * (se * 600_000) ** 2
    covariance[1, 1] = np.eye(n) * se**2
    gap = [1e9 for _ in rows]
    return xr.Dataset(
        {
            "index1": (("condition", "statistic"), estimates(one)),
            "index2": (("condition", "statistic"), estimates(two)),
            "covariance": (("index", "index_2", "condition", "condition_2"), covariance),
            "gap": ("condition", gap),
            "object_width": ("condition", [2 * 500 * row[2] for row in rows]),
            "dt": ("condition", [0.01] * n),
        },
        coords={
            "statistic": list(STATISTICS),
            **{
                label: ("condition", list(column))
                for label, column in zip(
                    ("direction", "gap_width", "radius", "angle"),
                    zip(*rows, strict=True),
                    strict=True,
                )
            },
        },
    )


def estimates(values: Sequence[float]) -> np.ndarray:
    """Values without errors, along `statistic`."""
    missing = [math.nan] * (len(STATISTICS) - 1)
    return np.array([[value, *missing] for value in values])


def papers_world(**changes: object) -> dict[str, xr.Dataset]:
    """Data in which every claim of the paper holds."""

    def rising(angle: float) -> float:
        return 0.4 + 0.005 * angle

    def peak(at: float) -> object:
        return lambda angle: 0.5 - 0.00005 * (angle - at) ** 2

    def entering(slope: float) -> object:
        return lambda angle: 0.3 + (slope * (angle - 10) if angle > 10 else 0.0)

    def dips(angle: float) -> float:
        return rising(angle) - (0.03 if angle == 40 else 0.0)

    narrow = synthetic("9a", {("does", 0.4): rising}, dips)
    wide = synthetic(
        "9b", {("does", 0.4): rising, ("does", 0.6): peak(40.0), ("does", 0.8): peak(50.0)}
    )
    escape = {("does", radius): rising for radius in paper.RADII}
    enter = {
        ("eoen", r): entering(s) for r, s in zip(paper.RADII, (0.02, 0.009, 0.006), strict=True)
    }
    grid = synthetic("12", escape | enter)
    arm = arm_data("15", lambda first, second, _: 9e5 / (3 + width_of(first, second)))
    stick = arm_data("17", lambda _, second, o: 100.0 * second + o)
    figures = {"9a": narrow, "9b": wide, "12": grid, "15": arm, "17": stick}
    return figures | changes  # type: ignore[return-value]


def width_of(first: float, second: float) -> float:
    tip = pcjax.two_joint_hand(math.radians(first), math.radians(second)).finger(1)[-1]
    return 2 * float(tip.end.x)


def arm_data(name: str, index1: Callable[[float, float, float], float]) -> xr.Dataset:
    """Data of a figure of the arm with independent errors of one step."""
    parts = [paper.ARM_FIGURES[part] for part in (("13", "14") if name == "15" else (name,))]
    rows = list(
        dict.fromkeys(
            (a, b, o)
            for part in parts
            for o in part.orientations_deg
            for a in part.angles_1_deg
            for b in part.angles_2_deg
        )
    )
    n = len(rows)
    covariance = np.zeros((2, 2, n, n))
    covariance[0, 0] = covariance[1, 1] = np.eye(n)
    widths = [width_of(a, b) for a, b, _ in rows]
    first, second, orientation = zip(*rows, strict=True)
    return xr.Dataset(
        {
            "index1": (("condition", "statistic"), estimates([index1(*row) for row in rows])),
            "index2": (("condition", "statistic"), estimates([0.0] * n)),
            "covariance": (("index", "index_2", "condition", "condition_2"), covariance),
            "gap": ("condition", widths),
            "object_width": ("condition", np.zeros(n) if name == "17" else np.full(n, 100.0)),
            "dt": ("condition", np.full(n, 0.02)),
        },
        coords={
            "statistic": list(STATISTICS),
            "direction": ("condition", ["does"] * n),
            "theta_1": ("condition", list(first)),
            "theta_2": ("condition", list(second)),
            "orientation": ("condition", list(orientation)),
            "width": ("condition", widths),
            "angle": ("condition", widths if name == "15" else list(second)),
        },
        attrs={
            "figure": name,
            "title": name,
            "trials": 10,
            "max_steps": 1000,
            "engine": "stepping",
        },
    )


def verdicts(figures: dict[str, xr.Dataset]) -> dict[int, str]:
    return {claim.number: claim.verdict for claim in judge_claims(figures)}


def test_all_claims_hold_in_the_papers_world() -> None:
    assert verdicts(papers_world()) == dict.fromkeys(range(1, 13), REPRODUCED)


def test_claims_fail_where_they_should() -> None:
    def rising(angle: float) -> float:
        return 0.4 + 0.005 * angle

    def falling(angle: float) -> float:
        return 0.6 - 0.005 * angle

    late = synthetic(
        "9b",
        {
            ("does", 0.4): rising,
            ("does", 0.6): lambda a: 0.5 - 0.00005 * (a - 60) ** 2,
            ("does", 0.8): lambda a: 0.5 - 0.00005 * (a - 70) ** 2,
        },
    )
    smooth = synthetic("9a", {("does", 0.4): rising})
    odd = verdicts(papers_world(**{"9b": late, "9a": smooth}))
    assert odd[3] == IN_PART
    assert odd[2] == IN_PART

    unrelated = synthetic("9a", {("does", 0.4): rising}, lambda a: 0.5 + 0.3 * math.sin(a))
    falls = {("does", radius): falling for radius in paper.RADII}
    flat = {("eoen", radius): lambda a: 0.3 for radius in paper.RADII}
    wrong = verdicts(papers_world(**{"9a": unrelated, "12": synthetic("12", falls | flat)}))
    assert wrong[1] == NOT
    assert wrong[4] == NOT
    assert wrong[5] == NOT
    assert wrong[8] == NOT

    flat_arm = arm_data("15", lambda *_: 5000.0)
    falling_arm = arm_data("15", lambda first, second, _: 9e5 - 1e3 * first - 1e3 * second)
    same = arm_data("17", lambda *_: 5000.0)
    strong = arm_data("17", lambda _a, _b, o: 5000.0 + 100 * o)
    told = verdicts(papers_world(**{"15": flat_arm, "17": same}))
    assert [told[k] for k in (9, 10, 11, 12)] == [NOT] * 4
    told = verdicts(papers_world(**{"15": falling_arm, "17": strong}))
    assert [told[k] for k in (9, 10, 11, 12)] == [NOT, NOT, NOT, IN_PART]

    noisy = verdicts(
        {k: v.assign(covariance=v.covariance * 1e10) for k, v in papers_world().items()}
    )
    assert REPRODUCED not in {noisy[k] for k in (1, 2, 4, 5, 7, 8, 9, 10, 11, 12)}


@pytest.mark.parametrize("name", sorted(paper.FIGURES))
def test_pictures_show_every_curve(name: str, grid: xr.Dataset) -> None:
    if name == "12":
        data = grid
    else:
        figure = paper.FIGURES[name]
        key = "gap_width" if figure.varies == "gap_width" else "radius"
        values = figure.gap_widths if key == "gap_width" else figure.radii
        shapes = {(d, v): lambda a: 0.5 + a / 400 for d in figure.directions for v in values}
        data = synthetic(name, shapes)
        data.attrs = {"figure": name, "trials": 10, "max_steps": 600_000, "engine": "stepping"}
    picture = plot_figure(data)
    labelled = [
        t.get_text()
        for axis in picture.axes
        if axis.get_legend()
        for t in axis.get_legend().get_texts()
    ]
    assert len(labelled) == (2 if name == "9a" else 3)
    assert all(axis.get_ylabel() for axis in picture.axes)


@pytest.mark.parametrize(("name", "curves"), [("15", 2), ("17", 4)])
def test_pictures_of_the_arm_show_every_curve(name: str, curves: int) -> None:
    picture = plot_figure(arm_data(name, lambda _, second, o: 100.0 * second + o))
    (axis,) = picture.axes
    assert len(axis.get_legend().get_texts()) == curves
    assert axis.get_xlabel()


def test_figure_15_shows_figures_13_and_14() -> None:
    settings = {"trials": 40, "seed": 3, "max_steps": 12_000, "dt": 0.02}
    both = run_figure("15", **settings)
    for name in ("13", "14"):
        one = run_figure(name, **settings)
        for k in range(one.sizes["condition"]):
            first, second = float(one.theta_1[k]), float(one.theta_2[k])
            same = (both.theta_1 == first) & (both.theta_2 == second)
            assert int(same.sum()) == 1
            assert both.index1[same].values[0].tolist() == one.index1[k].values.tolist()
            assert float(both.width[same][0]) == pytest.approx(width_of(first, second))
    shut = both.gap.values < 100
    assert np.all(both.index2.sel(statistic="value").values[shut] == 1.0)


def test_claims_need_all_their_figures() -> None:
    assert set(FIGURES_NEEDED) <= set(paper.FIGURE_NAMES)
