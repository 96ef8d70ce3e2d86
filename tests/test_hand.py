"""Forward kinematics, gap, goal lines and starts of the hand, against closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pcjax.model.bodies.circle import Circle
from pcjax.model.checking import check_geometry
from pcjax.model.hand import HandDesign, full_cage
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import does, eoen
from pcjax.simulate.draws import start_draws, trial_key
from pcjax.words import InputWarning

pytestmark = pytest.mark.usefixtures("x64")


def ends(hand: HandDesign) -> np.ndarray:
    limbs = jax.device_get(hand.limbs())
    return np.array([[limb.start.x, limb.start.y, limb.end.x, limb.end.y] for limb in limbs], float)


@pytest.mark.parametrize("degrees", [-35.0, 0.0, 10.0, 40.0])
def test_box_hand_is_a_box_with_fingertips(degrees: float) -> None:
    s, c = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    right = [[250, 0, 250, 500], [250, 500, 100, 500], [100, 500, 100 - 100 * s, 500 - 100 * c]]
    left = [[-x0, y0, -x1, y1] for x0, y0, x1, y1 in right]
    expected = [[-250, 0, 250, 0], *left, *right]
    np.testing.assert_allclose(ends(box_hand(math.radians(degrees))), expected, atol=1e-10)


@pytest.mark.parametrize("degrees", [0.0, 10.0, 40.0])
def test_gap_is_the_papers(degrees: float) -> None:
    # Sec. 3.3.3: W_g - 2 L_g sin(theta_g) where the gate closes
    gap = box_hand(math.radians(degrees)).gap()
    assert float(gap) == pytest.approx(200 - 200 * math.sin(math.radians(degrees)), abs=1e-9)


def test_narrowest_gap_of_a_flared_gate_is_between_the_tip_joints() -> None:
    assert float(box_hand(math.radians(-20)).gap()) == pytest.approx(200, abs=1e-9)


def test_gap_sees_a_narrow_passage_that_is_not_between_the_tips() -> None:
    waisted = HandDesign(
        400.0,
        ((100.0, 150.0, 150.0), (100.0, 150.0, 150.0)),
        ((math.pi / 2, math.pi / 4, -math.pi / 2), (math.pi / 2, math.pi / 4, -math.pi / 2)),
    )
    assert float(waisted.gap()) == pytest.approx(400 - 2 * 150 / math.sqrt(2), abs=1e-9)


def test_goal_lines_of_both_directions() -> None:
    angle = math.radians(25)
    hand = box_hand(angle)
    inside, outside = hand.goal(), hand.with_fingertips_mirrored().goal()
    corners = [float(v) for v in (inside.a.x, inside.a.y, inside.b.x, inside.b.y)]
    np.testing.assert_allclose(corners, [-100, 500, 100, 500], atol=1e-10)
    x, y = 100 - 100 * math.sin(angle), 500 + 100 * math.cos(angle)
    corners = [float(v) for v in (outside.a.x, outside.a.y, outside.b.x, outside.b.y)]
    np.testing.assert_allclose(corners, [-x, y, x, y], atol=1e-10)


@settings(max_examples=25, deadline=None)
@given(
    lengths=st.lists(st.floats(10, 200), min_size=1, max_size=5),
    angles=st.lists(st.floats(-2, 2), min_size=5, max_size=5),
)
def test_fingers_with_equal_joints_mirror_each_other(
    lengths: list[float], angles: list[float]
) -> None:
    joints = tuple(angles[: len(lengths)])
    hand = HandDesign(300.0, (tuple(lengths), tuple(lengths)), (joints, joints))
    limbs = ends(hand)
    n = len(lengths)
    np.testing.assert_allclose(limbs[1 : n + 1] * [-1, 1, -1, 1], limbs[n + 1 :], atol=1e-9)


def test_asymmetric_fingers() -> None:
    hand = HandDesign(100.0, ((50.0,), (30.0, 40.0)), ((math.pi / 2,), (0.0, math.pi / 2)))
    expected = [[-50, 0, 50, 0], [-50, 0, -50, 50], [50, 0, 80, 0], [80, 0, 80, 40]]
    np.testing.assert_allclose(ends(hand), expected, atol=1e-12)


def test_starts_cover_the_box_near_both_ends_of_the_palm() -> None:
    scenario = does(box_hand(), Circle(25.0))
    draws = jax.vmap(lambda i: start_draws(trial_key(0, i), 3))(np.arange(4000))
    start = jax.vmap(scenario.start)(draws)
    x, y = np.asarray(start.x), np.asarray(start.y)
    # the circle touches palm and side, plus U(0, 50) along each
    assert np.all((np.abs(x) > 175) & (np.abs(x) < 225) & (y > 25) & (y < 75))
    # 4,000 fair draws: |share - 1/2| beyond 4 s.e. (0.032) has a chance of 6e-5
    assert abs(np.mean(x < 0) - 0.5) < 0.032
    # means of uniforms: 4 s.e. = 4 * 50 / sqrt(12 * 4000) = 0.91, false alarm 1.3e-4
    assert abs(np.mean(np.abs(x)) - 200) < 0.92
    assert abs(np.mean(y) - 50) < 0.92


def test_start_circle_touches_an_oblique_first_limb() -> None:
    tilt = math.radians(65)
    hand = HandDesign(200.0, ((200.0, 100.0),) * 2, ((tilt, math.pi / 2),) * 2)
    scenario = does(hand, Circle(20.0), start_spread=0.0)
    start = scenario.start(jnp.array([0.9, 0.0, 0.0]))
    distances = [float(limb.distance(start)) for limb in hand.limbs()]
    assert distances[0] == pytest.approx(20, abs=1e-9)
    assert distances[3] == pytest.approx(20, abs=1e-9)


def test_geometry_is_checked() -> None:
    assert check_geometry(does(box_hand(), Circle(25.0))) == pytest.approx(165.27, abs=0.01)
    with pytest.raises(ValueError, match="does not fit at its start"):
        check_geometry(does(box_hand(), Circle(230.0)))
    with pytest.raises(ValueError, match="crosses the palm"):
        check_geometry(does(box_hand(fingertip_length=505.0, fingertip_angle=0.1), Circle(25.0)))
    # turned to the other side the same fingertips are clear of the palm
    check_geometry(eoen(box_hand(fingertip_length=505.0, fingertip_angle=0.1), Circle(25.0)))
    with pytest.raises(ValueError, match="finger 2's limb 3 crosses finger 1's limb 3"):
        check_geometry(does(box_hand(fingertip_length=150.0, fingertip_angle=1.4), Circle(25.0)))


def test_object_that_just_fits_is_no_full_cage() -> None:
    assert not full_cage(100.0, 100.0)
    assert full_cage(99.99, 100.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: box_hand(math.nan), "fingertip_angle is nan"),
        (lambda: box_hand(gap_width=500.0), "lid length"),
        (lambda: box_hand(palm_length=-1.0), "palm_length is -1"),
        (lambda: HandDesign(1.0, ((1.0,), ()), ((0.0,), ())), "finger 2 has 0 limb lengths"),
        (lambda: HandDesign(1.0, ((1.0,), (1.0,)), ((0.0,), (0.0, 1.0))), "2 joint angles"),
        (lambda: HandDesign(1.0, ((1.0,), (-2.0,)), ((0.0,), (0.0,))), "length L_21 is -2"),
        (lambda: Circle(0.0), "radius is 0"),
        (lambda: Circle(math.inf), "radius is inf"),
    ],
)
def test_bad_numbers_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


RIGHT = math.pi / 2


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: box_hand(10), "fingertip_angle is 10"),
        (lambda: two_joint_hand(65, 90), "theta_1 is 65, theta_2 is 90"),
        (lambda: HandDesign(1.0, ((1.0,), (1.0,)), ((RIGHT,), (-90,))), "theta_21 is -90"),
    ],
)
def test_degrees_in_place_of_radians_are_pointed_out_where_they_are_given(
    make: Callable[[], HandDesign], words: str
) -> None:
    with pytest.warns(InputWarning, match=f"^{words}: angles are in radians") as caught:
        hand = make()
    assert [warning.filename for warning in caught] == [__file__]
    # What the package derives from it is not pointed out again; pytest would fail.
    hand.with_fingertips_mirrored()


def test_angles_within_a_turn_and_traced_ones_pass(unchecked: None) -> None:
    turn = 2 * math.pi
    HandDesign(1.0, ((1.0, 1.0), (1.0,)), ((turn, -turn), (np.float32(turn),)))
    jax.jit(lambda angle: box_hand(angle).gap())(10.0)


def test_limbs_on_one_line_that_do_not_meet_do_not_cross(x64: None) -> None:
    # Both lids of a box hand are on one line, but for rounding.
    crossed = jax.jit(lambda gap: box_hand(gap_width=gap, fingertip_length=5.0).crossings())
    for gap in np.arange(20.0, 400.0, 5.0):
        assert not any(crossed(gap).values()), gap
