"""Design spaces and the design loop: what may change, where it goes, and what is kept."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pcjax.design.ascent import at_rest
from pcjax.design.checkpoint import Step
from pcjax.design.compare import compare
from pcjax.design.estimator import Estimator, Gradient
from pcjax.design.optimize import optimize
from pcjax.design.outcome import Settings
from pcjax.design.search import search_grid
from pcjax.design.space import DesignSpace, design_space, nearest_within
from pcjax.design.starts import starting_designs
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand
from pcjax.physics.state import PAPER_DT
from pcjax.quality.indices import ratio
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task
from pcjax.words import InputWarning

pytestmark = pytest.mark.usefixtures("quick_programs")

BOX = box_hand(math.radians(10))
TASK = Task(Circle(25.0), WristTilt(), ("does", "eoen"), 20_000)
SURROGATE = Surrogate(TASK, trials=40)
QUICK = Settings("gradient", iterations=4, check_every=2, check_trials=40, accept_trials=60)


def tips(clearance: float = 20.0) -> DesignSpace:
    return design_space(BOX, ["fingertip_angle_deg", "fingertip_length"], 50.0, clearance)


# ---------------------------------------------------------------------------------------- space


def test_parameters_are_the_papers() -> None:
    space = design_space(BOX, ["fingertip_angle_deg", "fingertip_length", "gap_width"], 50.0)
    np.testing.assert_allclose(space.design_of(BOX), [10.0, 100.0, 200.0], atol=1e-4)
    hand = space.hand([25.0, 80.0, 240.0])
    same = box_hand(math.radians(25), fingertip_length=80.0, gap_width=240.0)
    for mine, other in zip(jax.tree.leaves(hand), jax.tree.leaves(same), strict=True):
        assert float(mine) == pytest.approx(float(other), abs=1e-4)


def test_one_finger_alone_may_change() -> None:
    space = design_space(
        BOX, ["fingertip_angle_2_deg", "link_length_13", "joint_angle_1_deg"], 50.0
    )
    hand = space.hand([0.0, 70.0, 85.0])
    assert hand.angles[0][2] == BOX.angles[0][2]
    assert float(hand.angles[1][2]) == pytest.approx(math.pi / 2)
    assert (hand.lengths[0][2], hand.lengths[1][2]) == (70.0, BOX.lengths[1][2])
    assert math.degrees(hand.angles[0][0]) == pytest.approx(85.0)
    assert hand.angles[0][0] == hand.angles[1][0]


def test_a_design_is_differentiable() -> None:
    space = tips()
    slope = jax.grad(lambda design: space.hand(design).gap())(jnp.array([20.0, 120.0]))
    angle = math.radians(20)
    expected = [-2 * 120 * math.cos(angle) * math.pi / 180, -2 * math.sin(angle)]
    np.testing.assert_allclose(slope, expected, rtol=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.floats(-60, 90), st.floats(10, 300))
def test_the_nearest_allowed_design_is_allowed_and_near(angle: float, length: float) -> None:
    space = tips()
    design = np.array([angle, length])
    found = space.nearest_allowed(design)
    assert space.allowed(found)
    gap = float(space.hand(found).gap())
    assert gap >= 70 - 1e-3
    if space.allowed(design):
        np.testing.assert_array_equal(found, design)
    if space.low[0] <= angle <= space.high[0] and space.low[1] <= length <= space.high[1]:
        # On the constraint's edge, not somewhere behind it.
        assert space.allowed(design) or gap < 75


def test_a_search_from_a_hand_whose_limbs_cross_begins_at_the_nearest_of_many() -> None:
    crossed = box_hand(fingertip_angle=np.deg2rad(80), fingertip_length=250.0)
    space = design_space(
        crossed, {"fingertip_angle_deg": (-30, 80), "fingertip_length": (50, 250)}, 50.0
    )
    with pytest.raises(ValueError, match="no allowed hand"):
        space.nearest_allowed(space.design_of(crossed))
    (begun,) = starting_designs(space, 1, 0)
    assert space.allowed(begun)
    assert begun[0] > 20  # not at the other end of the bounds
    closed = replace(space, clearance=1000.0)
    with pytest.raises(ValueError, match="no allowed hand"):
        starting_designs(closed, 1, 0)


def test_the_nearest_point_within_edges_is_a_projection() -> None:
    """Against brute force: no other allowed point is nearer."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        normals = rng.standard_normal((5, 3))
        room = rng.uniform(0.0, 1.0, 5)
        point = 3 * rng.standard_normal(3)
        found = nearest_within(point, normals, room)
        assert found is not None
        assert np.all(normals @ found <= room + 1e-9)
        others = found + rng.standard_normal((4000, 3)) * rng.uniform(0, 1, (4000, 1))
        others = others[np.all(others @ normals.T <= room, axis=1)]
        assert len(others) > 0
        nearest = np.linalg.norm(others - point, axis=1).min()
        assert nearest >= np.linalg.norm(found - point) - 1e-9
    both = np.array([[1.0, 0.0], [-1.0, 0.0]])
    assert nearest_within(np.zeros(2), both, np.array([-1.0, -1.0])) is None


def test_on_an_edge_the_way_uphill_goes_along_it() -> None:
    space = tips()
    inside = np.array([10.0, 100.0])
    way = np.array([1.0, 1.0])
    np.testing.assert_array_equal(space.along_edges(inside, way, 0.4), way)
    # The clearance's edge: 200 - 2 L sin(theta) = 70.
    angle = math.radians(30)
    edge = space.nearest_allowed(np.array([30.0, 65 / math.sin(angle) + 1e-6]))
    normal = np.array([130 / math.tan(angle) * 10 * math.pi / 180, 2 * math.sin(angle) * 50])
    left = space.along_edges(edge, way, 0.4)
    expected = way - normal * (way @ normal) / (normal @ normal)
    np.testing.assert_allclose(left, expected, atol=1e-3)
    np.testing.assert_array_equal(space.along_edges(edge, -way, 0.4), -way)
    # In the corner of that edge and the longest tip there is no way on.
    corner = np.array([math.degrees(math.asin(65 / 175)), 175.0])
    np.testing.assert_allclose(space.along_edges(corner, np.array([0.1, 1.0]), 0.4), 0, atol=1e-4)


def test_linear_limits_are_kept() -> None:
    free = ["fingertip_angle_deg", "fingertip_length", "gap_width"]
    text = "2 fingertip-length - 0.5 * gap_width >= 50"
    space = design_space(BOX, free, 50.0, 20.0, [text, "fingertip_angle_deg+fingertip_length<=120"])
    np.testing.assert_array_equal(space.limits[0].coefficients, [0.0, -2.0, 0.5])
    assert space.limits[0].most == -50
    rng = np.random.default_rng(0)
    for design in rng.uniform(space.low, space.high, (40, 3)):
        angle, length, gap = space.nearest_allowed(design)
        assert 2 * length - 0.5 * gap >= 50 - 1e-6
        assert angle + length <= 120 + 1e-6


def test_names_of_what_is_in_degrees_say_so() -> None:
    with pytest.warns(InputWarning, match="fingertip_angle is called fingertip_angle_deg now"):
        space = design_space(BOX, {"fingertip_angle": (-30.0, 45.0)}, 50.0)
    assert space.named(space.design_of(BOX)) == {"fingertip_angle_deg": pytest.approx(10.0)}
    with pytest.warns(InputWarning, match="joint_angle_13 is called joint_angle_13_deg now"):
        design_space(BOX, ["joint_angle_13_deg"], 50.0, limits=["joint_angle_13 <= 90"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gap_width", "cannot be read"),
        ("gap_width <= wide", "cannot be read"),
        ("gap_width 3 <= 5", "cannot be read at '3'"),
        ("gap_widht <= 5", "did you mean gap_width"),
        ("fingertip_length <= 5", "is not free"),
        ("gap_width - gap_width <= 5", "limits nothing"),
        ("gap_width <= inf", "finite"),
    ],
)
def test_bad_limits_are_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        design_space(BOX, ["gap_width"], 50.0, limits=[text])


def test_moves_keep_to_the_scales() -> None:
    np.testing.assert_allclose(tips().scales, [10.0, 50.0])
    np.testing.assert_allclose(tips().usual_moves(np.array([0.0, 100.0])), [4.0, 10.0])
    # A short fingertip is not moved by half its length.
    np.testing.assert_allclose(tips().usual_moves(np.array([0.0, 25.0])), [4.0, 5.0])


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ([], "no parameter"),
        (["fingertip_angel"], "did you mean fingertip_angle_deg"),
        (["joint_angle_deg"], "joint_angle_1_deg to joint_angle_3_deg"),
        (["gap_width_deg"], "did you mean gap_width"),
        (["joint_angle_4_deg"], "joint_angle_3"),
        (["gap_width_1"], "no parameter gap_width_1"),
        (["fingertip_angle_deg", "joint_angle_3_deg"], "same number"),
        (["fingertip_length", "link_length_23"], "same number"),
        (["gap_width", "link_length_2"], "same number"),
        ({"fingertip_angle_deg": (30.0, 30.0)}, "order"),
        ({"fingertip_length": (0.0, 30.0)}, "above 0"),
        ({"fingertip_angle_deg": (math.nan, 30.0)}, "finite"),
    ],
)
def test_bad_spaces_are_refused(free: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        design_space(BOX, free, 50.0)


def test_a_space_without_any_allowed_hand_is_refused() -> None:
    with pytest.raises(ValueError, match="no allowed hand"):
        starting_designs(tips(clearance=300.0), 1, 0)


def test_starts_are_spread_and_allowed() -> None:
    starts = starting_designs(tips(), 6, 3)
    assert len(starts) == 6
    np.testing.assert_allclose(starts[0], [10.0, 100.0], atol=1e-4)
    assert all(tips().allowed(start) for start in starts)
    assert np.ptp(starts, axis=0)[0] > 30


def test_a_base_hand_that_is_not_allowed_says_why() -> None:
    """Bounds, limits, clearance, and fingers that a design makes alike; allowed hands say nothing,
    those on an edge among them."""
    free = {"fingertip_angle_deg": (20.0, 30.0), "fingertip_length": (100.0, 150.0)}
    space = design_space(BOX, free, 50.0, 130.0, ["fingertip_length <= 80"])
    outside, limit, gap = space.objections()
    assert outside == "its fingertip_angle is 10 deg, outside 20 to 30 deg"
    assert limit == "it breaks the limit 'fingertip_length <= 80'"
    assert gap == "its gap is 165.3, less than the object's 50 and the clearance of 130"
    uneven = HandDesign(500.0, ((500.0, 150.0, 90.0),) * 2, ((1.5, 1.5, 1.2), (1.5, 1.5, 1.1)))
    (told,) = design_space(uneven, ["joint_angle_3_deg", "fingertip_length"], 50.0).objections()
    assert told.startswith("its joint_angle_3 is 68.75 deg on finger 1 and 63.03 deg on finger 2")
    assert not design_space(uneven, ["joint_angle_23_deg", "gap_width"], 50.0).objections()
    assert not design_space(
        BOX, {"fingertip_angle_deg": (10, 30)}, 50.0, limits=["fingertip_angle_deg <= 10"]
    ).objections()


# ----------------------------------------------------------------------------------------- loop


class Bowl(Estimator):
    """An estimator whose score is a known paraboloid, without noise."""

    def __init__(self, top: Sequence[float], fail_at: int | None = None):
        self.top, self.fail_at, self.calls = np.array(top), fail_at, 0

    def __repr__(self) -> str:
        return f"Bowl({self.top})"

    def __call__(
        self, surrogate: Surrogate, space: DesignSpace, designs: Sequence[np.ndarray], seed: int
    ) -> list[Gradient]:
        if self.calls == self.fail_at:
            raise KeyboardInterrupt
        self.calls += 1
        found = []
        for design in designs:
            away = (design - self.top) / space.scales
            slope = -0.2 * away / space.scales
            blank, covariance = np.zeros((1, len(slope))), np.eye(len(slope)) * 1e-6
            value = 0.5 - 0.1 * float(away @ away)
            found.append(Gradient(value, 1e-3, slope, covariance, blank, blank, 0.0, 10, 0.1))
        return found


def test_the_loop_finds_the_top_of_a_known_hill() -> None:
    found = optimize(SURROGATE, tips(), replace(QUICK, iterations=40), estimator=Bowl([0.0, 70.0]))
    np.testing.assert_allclose(found.best, [0.0, 70.0], atol=1.0)
    assert found.progress.iteration <= 40
    assert all(tips().allowed(np.array(step.design)) for step in found.progress.history[0])


def test_the_loop_stays_on_the_allowed_side() -> None:
    found = optimize(
        SURROGATE, tips(), replace(QUICK, iterations=40), estimator=Bowl([50.0, 170.0])
    )
    assert tips().allowed(found.best)
    assert float(tips().hand(found.best).gap()) == pytest.approx(70.0, abs=0.5)


def test_every_start_is_followed() -> None:
    some = replace(QUICK, starts=3, iterations=30)
    found = optimize(SURROGATE, tips(), some, estimator=Bowl([5.0, 80.0]))
    assert len(found.candidates) == len(found.progress.history) == 3
    for end in found.candidates:
        np.testing.assert_allclose(end.design, [5.0, 80.0], atol=3.0)


def test_an_interrupted_loop_keeps_what_it_has_and_goes_on_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    whole = optimize(SURROGATE, tips(), QUICK, estimator=Bowl([0.0, 70.0]))
    part = optimize(
        SURROGATE, tips(), QUICK, estimator=Bowl([0.0, 70.0], fail_at=2), checkpoint=path
    )
    assert part.interrupted
    assert part.progress.iteration == 2
    rest = optimize(SURROGATE, tips(), QUICK, estimator=Bowl([0.0, 70.0]), checkpoint=path)
    assert not rest.interrupted
    assert rest.progress.history == whole.progress.history
    assert rest.progress.designs == whole.progress.designs
    np.testing.assert_array_equal(rest.best, whole.best)
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_of_another_optimisation_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    optimize(SURROGATE, tips(), QUICK, estimator=Bowl([0.0, 70.0], fail_at=1), checkpoint=path)
    with pytest.raises(ValueError, match="other settings"):
        optimize(
            SURROGATE, tips(), replace(QUICK, seed=1), estimator=Bowl([0, 70]), checkpoint=path
        )
    path.write_text(json.dumps({"of": "", "state": {"history": 3}}))
    with pytest.raises(ValueError, match="no checkpoint"):
        optimize(SURROGATE, tips(), QUICK, estimator=Bowl([0.0, 70.0]), checkpoint=path)


def test_a_result_that_is_not_better_is_said_to_be_so() -> None:
    found = optimize(SURROGATE, tips(), QUICK, estimator=Bowl([10.0, 100.0]))
    assert found.improvement.low <= 0 <= found.improvement.high
    assert not found.better


def test_the_result_is_compared_with_the_hand_given_though_the_search_begins_elsewhere() -> None:
    space = design_space(BOX, {"fingertip_angle_deg": (20.0, 30.0)}, 50.0)
    with pytest.warns(InputWarning, match="10 deg, outside 20 to 30 deg.*begins at.* 20 deg") as w:
        found = optimize(SURROGATE, space, QUICK, estimator=Bowl([25.0]))
    assert [warning.filename for warning in w] == [__file__]
    assert found.progress.history[0][0].design == pytest.approx([20.0])
    assert (found.start_hand, found.moved, len(found.notes)) == (BOX, False, 1)
    np.testing.assert_allclose(found.start, [10.0])
    trials, seed = QUICK.accept_trials, QUICK.seed + 0x30000000  # those of the acceptance
    same = compare(SURROGATE, space, [found.start, found.best], trials=trials, seed=seed)
    assert found.start_score.value == pytest.approx(same.scores[0].value, rel=1e-6)
    assert found.improvement.value == pytest.approx(same.improvement(0, 1).value, abs=1e-6)


def test_a_hand_that_cannot_be_evaluated_is_compared_from_where_it_was_moved() -> None:
    crossed = box_hand(math.radians(80), gap_width=150.0)
    space = design_space(crossed, {"fingertip_angle_deg": (-10.0, 10.0)}, 50.0)
    with pytest.warns(InputWarning, match="cannot be evaluated.*crosses.*moved start"):
        found = search_grid(SURROGATE, space, QUICK, [2])
    assert found.moved
    np.testing.assert_allclose(found.start, [10.0])
    assert math.degrees(found.start_hand.angles[0][2]) == pytest.approx(80.0)


def test_a_plateau_within_noise_stops_a_start() -> None:
    def rests(values: Sequence[float], places: Sequence[float] | None = None) -> bool:
        places = [0.0] * len(values) if places is None else places
        steps = [Step([x], v, 0.01, [0.0], [0.0]) for x, v in zip(places, values, strict=True)]
        return at_rest(steps, np.array([10.0]))

    assert not rests(np.linspace(0, 1, 30).tolist())
    assert not rests([0.5] * 11)
    assert rests([0.5] * 12)
    # One that still moves is not at rest, whatever the score does.
    assert not rests([0.5] * 12, np.linspace(0, 10, 12).tolist())


def test_comparisons_are_paired() -> None:
    """The difference of near designs is known far better than either score."""
    designs = [np.array([10.0, 100.0]), np.array([10.5, 100.0])]
    found = compare(SURROGATE, tips(), designs, trials=2000, seed=1)
    apart = math.hypot(found.scores[0].se, found.scores[1].se)
    assert 0 < found.improvement(0, 1).se < 0.7 * apart
    same = compare(SURROGATE, tips(), [designs[0]] * 2, trials=200, seed=1).improvement(0, 1)
    assert (same.value, same.se) == pytest.approx((0.0, 0.0), abs=1e-12)
    # Equal outcomes of 200 trials do not make two hands equal.
    assert same.low < 0 < same.high


def test_comparisons_have_the_intervals_of_the_score() -> None:
    # In 20 trials of 20 s hardly any escapes, which leaves room for many that do.
    designs = [np.array([10.0, 100.0]), np.array([30.0, 100.0])]
    found = compare(SURROGATE, tips(), designs, trials=20, seed=1)
    for score, hand in zip(found.scores, found.sample.values, strict=True):
        does, eoen = hand[:, 0, found.sample.valid]
        expected = ratio(does, eoen, TASK.max_steps * PAPER_DT)
        assert (score.low, score.high) == pytest.approx((expected.low, expected.high), rel=1e-6)
        assert score.low < score.value - 5 * score.se
    gain = found.improvement(0, 1)
    assert gain.low < gain.value < gain.high
    # The difference lies between the extremes of both.
    assert gain.low > found.scores[1].low - found.scores[0].high
    assert gain.high < found.scores[1].high - found.scores[0].low
