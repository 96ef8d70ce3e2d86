"""Pictures: axes with units, names in words, and nothing written over anything."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.text import Text

import pcjax
from pcjax.design.checkpoint import Progress, Step
from pcjax.design.front import Front, Member
from pcjax.design.outcome import Candidate, Optimum
from pcjax.model.hand import points_of
from pcjax.paper.constants import FIGURE_NAMES
from pcjax.paper.pictures import plot_figure
from pcjax.quality.indices import Estimate
from pcjax.results.reading import load_dataset
from pcjax.sweep.run import run_sweep
from pcjax.view import designs
from pcjax.view.contours import draw_contours
from pcjax.view.dimension import GapLabel
from pcjax.view.front import plot_front
from pcjax.view.labels import score_label
from pcjax.view.plots import plot_evaluation, plot_ranking
from pcjax.view.sweeps import plot_grid, plot_sweep

pytestmark = pytest.mark.usefixtures("quick_programs")

RESULTS = Path(__file__).parents[1] / "experiments" / "results"
CIRCLE = pcjax.Circle(25.0)
RUN = pcjax.Run(trials=20, max_steps=20_000)
OWN = pcjax.HandDesign(
    400.0, ((350.0, 120.0, 90.0), (300.0, 140.0, 60.0)), ((1.57, 1.57, 1.3), (1.4, 1.66, 0.87))
)

_PURE = re.compile(r"iteration|share of .*|score( .*)?")
"""What has no unit."""


def texts_of(figure: Figure) -> Iterator[tuple[str, str]]:
    """Every label of an axis and every text of a legend, with what it is."""
    for axis in figure.axes:
        for label in (axis.get_xlabel(), axis.get_ylabel()):
            if label:
                yield "axis", label
        legend = axis.get_legend()
        for text in [] if legend is None else legend.get_texts():
            yield "legend", text.get_text()
    for legend in figure.legends:
        for text in legend.get_texts():
            yield "legend", text.get_text()


def check(figure: Figure, *, scales: int, units: str = "") -> None:
    """Holds a figure against what is said of all of them.

    Arguments:
        figure: to be held.
        scales: how many labels of axes it has to have.
        units: of the lengths, which some label or text has to name.
    """
    found = list(texts_of(figure))
    labels = [text for kind, text in found if kind == "axis"]
    assert len(labels) >= scales
    for label in labels:
        # The paper's symbols have an underscore in TeX, and stand between dollars.
        plain = re.sub(r"\$.*?\$", "", label)
        assert "_" not in plain, label
        assert re.search(r"\[[^\]]+\]", plain) or _PURE.fullmatch(plain), label
    for kind, text in found:
        assert kind == "axis" or "_" not in text, text
        assert not re.search(r"index[12]|\bdoes\b|\beoen\b", text), text
    assert not units or any(f"[{units}]" in label for label in labels)


def boxes_of(axis: Axes, figure: Figure) -> list[GapLabel]:
    figure.draw_without_rendering()
    return [text for text in axis.get_children() if isinstance(text, GapLabel)]


@pytest.mark.parametrize("name", FIGURE_NAMES)
def test_the_papers_figures_have_units_and_words(name: str) -> None:
    check(plot_figure(load_dataset(RESULTS / f"fig{name}.nc")), scales=2)


def test_evaluations_and_rankings_have_units_and_words() -> None:
    studies = {
        name: pcjax.Study(hand, CIRCLE, run=RUN, units="mm")
        for name, hand in (("a", OWN), ("b", pcjax.box_hand()))
    }
    ranking = pcjax.compare(studies)
    check(plot_ranking(ranking), scales=4, units="mm")
    assert "<img" in ranking._repr_html_()
    figure = plot_evaluation(ranking.evaluations["a"])
    check(figure, scales=6, units="mm")
    for axis in figure.axes[:2]:
        (label,) = boxes_of(axis, figure)
        assert re.fullmatch(r"gap [\d.]+ mm", label.get_text())


HANDS = {
    "own": OWN,
    "box": pcjax.box_hand(),
    "flared": pcjax.box_hand(-0.5),
    "narrow": pcjax.box_hand(0.0, gap_width=56.0),
    "thick": pcjax.box_hand(0.3, thickness=20.0),
    "long tips": pcjax.box_hand(0.35, fingertip_length=175.0),
    "arm": pcjax.two_joint_hand(),
}


@pytest.mark.parametrize("name", HANDS)
def test_the_gaps_label_lies_over_no_limb_and_not_over_its_line(name: str) -> None:
    study = pcjax.Study(HANDS[name], CIRCLE)
    found = pcjax.inspect(study)
    assert "<img" in found._repr_html_()
    figure = designs.plot_inspection(found)
    check(figure, scales=2, units="model length")
    for axis, (direction, view) in zip(figure.axes, found.views.items(), strict=True):
        (label,) = boxes_of(axis, figure)
        assert f"gap {view.gap:.4g} model units" == label.get_text()
        box = label.get_window_extent()
        hand = study.hand if direction == "does" else study.hand.with_fingertips_mirrored()
        share = np.linspace(0.0, 1.0, 400)[:, None]
        lines = [*zip(points_of(hand)[:-1], points_of(hand)[1:], strict=True), view.passage]
        # Limbs' round ends and sides are half a thickness away from their middle lines.
        half = 0.5 * float(hand.thickness) * axis.transData.get_matrix()[0, 0]
        for a, b in lines:
            path = axis.transData.transform(np.asarray(a) + share * (np.asarray(b) - np.asarray(a)))
            inside = (path > box.min - half) & (path < box.max + half)
            assert not inside.all(axis=1).any()
        assert axis.bbox.x0 <= box.x0
        assert box.x1 <= axis.bbox.x1
        assert axis.bbox.y0 <= box.y0
        assert box.y1 <= axis.bbox.y1


def test_sweeps_and_grids_have_units_and_words(tmp_path: Path) -> None:
    sweep = pcjax.Sweep({"fingertip_angle_deg": (0.0, 10.0), "radius": (20.0, 25.0)})
    study = pcjax.Study(pcjax.box_hand(), CIRCLE, run=RUN, sweep=sweep, units="cm")
    data = run_sweep(study, tmp_path / "s.nc")
    figure = plot_sweep(data, "radius")
    check(figure, scales=2, units="cm")
    legend = [text for kind, text in texts_of(figure) if kind == "legend"]
    assert legend == ["fingertip angle 0 deg", "fingertip angle 10 deg"]
    for y in ("does.index1", "eoen.index2", "score.index2"):
        figure = plot_sweep(data, "fingertip_angle_deg", y, at={"radius": 25.0})
        check(figure, scales=2, units="deg")
        assert figure.axes[0].get_title().startswith("radius 25 cm; ")
    hands = [pcjax.box_hand(math.radians(angle)) for angle in (0, 10)]
    scenarios = [make(hand, CIRCLE) for hand in hands for make in (pcjax.does, pcjax.eoen)]
    labels = {"direction": ["does", "eoen"] * 2, "fingertip_angle_deg": [0.0, 0.0, 10.0, 10.0]}
    grid = pcjax.evaluate_grid(scenarios, labels, trials=20, max_steps=20_000)
    figure = plot_grid(grid)
    check(figure, scales=2, units="deg")
    assert [text for kind, text in texts_of(figure) if kind == "legend"] == ["DoEs", "EoEn"]


def found_by_hand() -> tuple[Optimum, pcjax.DesignSpace, pcjax.Surrogate]:
    """What a search would return that took two iterations."""
    free = {"fingertip_angle_deg": (-30.0, 50.0), "fingertip_length": (25.0, 175.0)}
    space = pcjax.design_space(pcjax.box_hand(), free, 50.0)
    task = pcjax.Task(CIRCLE, pcjax.WristTilt(), ("does", "eoen"), 20_000, units="mm")
    start, best = np.array([10.0, 100.0]), np.array([20.0, 150.0])
    score, gain = Estimate(1.5, 0.02, 1.46, 1.54), Estimate(0.2, 0.02, 0.16, 0.24)
    steps = [Step([10.0, 100.0], 0.4, 0.01, [], []), Step([20.0, 150.0], 0.5, 0.01, [], [])]
    candidate = Candidate(best, score, Estimate(0.0, 0.0, 0.0, 0.0))
    found = Optimum(
        start,
        best,
        score,
        score,
        gain,
        [candidate],
        [],
        1.0,
        Progress([steps], [[20.0, 150.0]], []),
        1000,
        0,
        False,
        space.hand(start),
        False,
        (),
        [start, best],
    )
    return found, space, pcjax.Surrogate(task, trials=20)


def test_an_optimum_and_a_front_have_units_and_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(designs, "_MAP", 3)
    found, space, surrogate = found_by_hand()
    figure = designs.plot_optimum((found, space, surrogate))
    check(figure, scales=7, units="mm")
    figure.draw_without_rendering()
    assert all(float(tick).is_integer() for tick in figure.axes[1].get_xticks())
    check(designs.plot_history(found), scales=2)
    aims = Estimate(9e3, 90.0, 8.8e3, 9.2e3), Estimate(7e3, 90.0, 6.8e3, 7.2e3)
    member, names = Member(found.best, aims), ("DoEs by index1", "EoEn by index1")
    tried = np.array([[8e3, 9e3]])
    front = Front(names, (True, False), [member], member, False, 0, tried, 1000, 0, False)
    figure = plot_front((front, space, surrogate))
    check(figure, scales=2, units="steps of 0.001 s")
    for one, words in ((found, "score, best: 1.5000"), (front, "less is better")):
        assert words in repr(one)
        assert "<img" in one._repr_html_()


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("DoEs / EoEn by index1", "score DoEs / EoEn (index 1)"),
        ("DoEs by index1", "DoEs: index 1 [steps of 0.001 s]"),
        ("DoEs by index2", "DoEs: index 2 [share of trials]"),
        ("DoEs by escape_rate", "DoEs: mean time to escape [s]"),
        (
            "DoEs / EoEn by index2, worst of 3 conditions",
            "score DoEs / EoEn (index 2, worst of 3 conditions)",
        ),
        (
            "DoEs by index1, mean of 2 conditions",
            "DoEs: index 1, mean of 2 conditions [steps of 0.001 s]",
        ),
        ("score in condition 1", "score in condition 1"),
    ],
)
def test_scores_are_called_by_their_names(name: str, label: str) -> None:
    assert score_label(name) == label


def labels_of(axis: Axes) -> list[Text]:
    """The values of an axis's contours."""
    lines = [one for one in axis.collections if isinstance(one, QuadContourSet) and not one.filled]
    return [text for one in lines for text in getattr(one, "labelTexts", [])]


@pytest.mark.parametrize(("cells", "told"), [(5, True), (21, False)])
def test_a_loop_that_is_hardly_longer_than_its_value_has_none(cells: int, told: bool) -> None:
    """About a single peak: diamonds whose sides are up to a cell of the grid long."""
    score = np.zeros((cells, cells))
    score[cells // 2, cells // 2] = 1.0
    axis = Figure().subplots()
    across = np.linspace(0.0, 1.0, cells)
    covered = [across, across], np.zeros((cells, cells), bool)
    draw_contours(axis, across, across, score, "score", covered, np.array([[0.0, 0.0]]))
    assert bool(labels_of(axis)) == told


@pytest.mark.parametrize("seed", range(6))
def test_values_of_contours_lie_in_the_axes_and_apart_from_what_covers_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xs, ys = np.linspace(-30.0, 50.0, 9), np.linspace(20.0, 170.0, 7)
    score = rng.random((7, 9)).cumsum(axis=0).cumsum(axis=1)
    score[4:, 6:] = np.nan
    fine = [np.linspace(-30.0, 50.0, 41), np.linspace(20.0, 170.0, 41)]
    covered = np.add.outer(fine[1] / 150, -fine[0] / 80) > 0.9
    figure = Figure(figsize=(4.0, 3.0), layout="constrained")
    axis = figure.subplots()
    mark = np.array([[0.0, 80.0]])
    draw_contours(axis, xs, ys, 1e4 * score, "score", (fine, covered), mark)
    figure.draw_without_rendering()
    labels = labels_of(axis)
    assert labels
    for label in labels:
        box = label.get_window_extent()
        assert axis.bbox.x0 < box.x0 < box.x1 < axis.bbox.x1
        assert axis.bbox.y0 < box.y0 < box.y1 < axis.bbox.y1
        x, y = label.get_position()
        at = [np.abs(values - v).argmin() for values, v in zip(fine, (x, y), strict=True)]
        assert not covered[at[1], at[0]]
        assert not box.contains(*axis.transData.transform(mark[0]))
