"""Both directions through one gap, and starts inside the hand, for any hand."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pcjax.geometry import Vec
from pcjax.model.bodies.circle import Circle
from pcjax.model.checking import check_geometry
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign, full_cage
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import default_direction, does, eoen, why_no_eoen
from pcjax.simulate.batch import run
from pcjax.simulate.event import EventDriven
from pcjax.simulate.outcomes import LIMIT

pytestmark = pytest.mark.usefixtures("x64")

RIGHT = math.pi / 2


def hand_of(degrees: tuple, lengths: tuple, palm: float = 500.0) -> HandDesign:
    return HandDesign(palm, lengths, tuple(tuple(map(math.radians, row)) for row in degrees))


LOPSIDED = hand_of(((95, 80, 60), (80, 100, 95)), ((450, 150, 90), (520, 160, 120)))
"""Joints of the fingertips at different heights, and fingertips of different lengths."""


def finger(limbs: int) -> st.SearchStrategy:
    """Lengths and joint angles in degrees."""
    length = st.floats(60, 300)
    first, other = st.floats(60, 100), st.floats(-80, 120)
    return st.tuples(
        st.tuples(st.floats(300, 500), *[length] * (limbs - 1)),
        st.tuples(first, *[other] * (limbs - 1)),
    )


@settings(max_examples=120, deadline=None)
@given(st.sampled_from([(2, 2), (3, 3), (3, 2)]).flatmap(lambda n: st.tuples(*map(finger, n))))
def test_the_gap_is_one_number_and_a_cage_is_closed_both_ways(fingers: tuple) -> None:
    hand = hand_of(tuple(f[1] for f in fingers), tuple(f[0] for f in fingers))
    escaping = does(hand, Circle(25.0), start_spread=0.0)
    try:
        gap = check_geometry(escaping)
    except ValueError:
        assume(False)
    if why_no_eoen(hand):  # says that the gap would be another one, or that limbs would cross
        with pytest.raises(ValueError, match="EoEn is not defined for this hand"):
            eoen(hand, Circle(25.0))
        return
    entering = eoen(hand, Circle(25.0), start_spread=0.0)
    assert float(entering.hand.gap()) == pytest.approx(gap, rel=1e-9)
    for diameter in (0.5 * gap, 0.999 * gap, 1.001 * gap, 2 * gap):
        assert full_cage(gap, diameter) == full_cage(float(entering.hand.gap()), diameter)


def test_fingertips_are_mirrored_by_one_isometry() -> None:
    mirrored = LOPSIDED.with_fingertips_mirrored()
    mirror = LOPSIDED.tip_mirror()
    for i in (0, 1):
        real, image = LOPSIDED.finger(i)[-1], mirrored.finger(i)[-1]
        for point, other in ((real.start, image.start), (real.end, image.end)):
            expected = mirror.point(point)
            assert float(other.x) == pytest.approx(float(expected.x), abs=1e-9)
            assert float(other.y) == pytest.approx(float(expected.y), abs=1e-9)
    twice = mirrored.with_fingertips_mirrored()
    for a, b in zip(jax.tree.leaves(twice), jax.tree.leaves(LOPSIDED), strict=True):
        assert math.remainder(float(a) - float(b), 2 * math.pi) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("degrees", [-35.0, -20.0, 0.0, 10.0, 23.4, 50.0])
def test_the_papers_hands_are_what_they_were_to_the_bit(degrees: float) -> None:
    hand = box_hand(math.radians(degrees))
    scenario = eoen(hand, Circle(25.0))
    for angles, mirrored in zip(hand.angles, scenario.hand.angles, strict=True):
        assert mirrored == (*angles[:-1], -angles[-1])
    assert isinstance(scenario.drive, WristTilt)
    assert (scenario.drive.turned.x, scenario.drive.turned.y) == (1.0, 0.0)


def test_the_gap_has_the_right_derivatives_where_joints_differ_in_height() -> None:
    angles = jnp.array([a for row in LOPSIDED.angles for a in row])

    def end(angles: jax.Array) -> jax.Array:
        hand = HandDesign(500.0, LOPSIDED.lengths, (tuple(angles[:3]), tuple(angles[3:])))
        tip = hand.with_fingertips_mirrored().finger(0)[-1].end
        return jnp.stack([tip.x, tip.y])

    exact = jax.jacfwd(end)(angles)
    h = 1e-6
    rises = [(end(angles + h * e) - end(angles - h * e)) / (2 * h) for e in np.eye(6)]
    np.testing.assert_allclose(exact, np.stack(rises, axis=1), atol=1e-5)
    assert np.abs(exact[:, 3:5]).min() > 1  # finger 2's joint turns the mirror of finger 1's tip


def test_gravity_outside_is_the_mirror_image_of_one_that_is_as_likely() -> None:
    drive, mirror = WristTilt(), LOPSIDED.tip_mirror()
    turned = drive.mirrored(mirror)
    for draws in np.random.default_rng(0).random((20, 2)):
        other = np.array([draws[0], 1 - draws[1]])  # T2 with the other sign
        profiles = [
            d.profile(jnp.asarray(x), jnp.asarray(x), first=False)
            for d, x in ((turned, draws), (drive, other))
        ]
        expected = mirror.vector(profiles[1].held)
        assert float(profiles[0].held.x) == pytest.approx(float(expected.x), abs=1e-12)
        assert float(profiles[0].held.y) == pytest.approx(float(expected.y), abs=1e-12)


def test_a_closed_hand_lets_nobody_in_or_out() -> None:
    closed = hand_of(((90, 90, 60), (90, 90, 75)), ((400, 120, 180), (430, 120, 160)))
    gap = float(closed.gap())
    circle = Circle(0.51 * gap)
    scenarios = [make(closed, circle) for make in (does, eoen)]
    for scenario in scenarios:
        check_geometry(scenario)
    out = run(scenarios, trials=64, max_steps=60_000, engine=EventDriven())
    assert (out.status == LIMIT).all()


def test_which_directions_are_evaluated() -> None:
    assert default_direction(two_joint_hand(math.radians(90)), WristTilt())[0] == "both"
    assert default_direction(two_joint_hand(), PlanarArm())[0] == "does"
    single = hand_of(((90,), (90,)), ((400,), (400,)))
    direction, why = default_direction(single, WristTilt())
    assert direction == "does"
    assert "one limb a finger" in why
    assert "one limb a finger" in why_no_eoen(single)


def test_a_thumb_that_reaches_past_the_other_fingertip_has_no_eoen() -> None:
    thumb = hand_of(((90, 90, 45), (90, 20, 60)), ((500, 200, 330), (500, 60, 40)))
    assert "another limb than the other fingertip" in why_no_eoen(thumb)


# ------------------------------------------------------------------------------------- starts


@pytest.mark.parametrize("lean", [0.5, 2.0, 10.0, 25.0])
def test_starts_follow_a_first_limb_that_leans_in(lean: float) -> None:
    hand = hand_of(((90 + lean, 80 - lean, 80),) * 2, ((250, 60, 60),) * 2)
    scenario = does(hand, Circle(20.0))
    check_geometry(scenario)
    for draws in np.random.default_rng(1).random((40, 3)):
        start = scenario.start(jnp.asarray(draws))
        assert min(float(limb.distance(start)) for limb in hand.limbs()) > 20.0 - 1e-9
    # As far from the leaning limb as from an upright one.
    start = scenario.start(jnp.array([0.9, 0.0, 0.7]))
    assert float(hand.finger(1)[0].distance(start)) == pytest.approx(20.0, abs=1e-9)


def test_starts_at_upright_limbs_are_the_papers() -> None:
    scenario = does(box_hand(), Circle(25.0))
    for draws in np.random.default_rng(2).random((20, 3)):
        start = scenario.start(jnp.asarray(draws))
        inset = 25.0 * math.tan(RIGHT / 2) + 50.0 * draws[1]
        side = math.copysign(1, draws[0] - 0.5)
        assert float(start.x) == pytest.approx(side * (250 - inset), rel=1e-14)
        assert float(start.y) == pytest.approx(25.0 + 50.0 * draws[2], rel=1e-14)


def test_a_start_beyond_the_goal_line_is_refused_with_what_would_do() -> None:
    scoop = hand_of(((12,), (12,)), ((300,), (300,)))
    with pytest.raises(ValueError, match=r"beyond the goal line.*start_spread.*or less") as error:
        check_geometry(does(scoop, Circle(25.0)))
    spread = float(str(error.value).split("has to be ")[1].split()[0])
    check_geometry(does(scoop, Circle(25.0), start_spread=spread))


def test_an_open_hand_on_the_arm_is_refused_in_one_line() -> None:
    with pytest.raises(ValueError, match="beyond the goal line") as error:
        check_geometry(does(two_joint_hand(math.radians(-20), math.radians(10)), Circle(50.0)))
    assert "\n" not in str(error.value)
    assert "start_spread (now" not in str(error.value)  # none would help


def test_fingertips_that_have_swapped_sides_are_refused() -> None:
    swapped = hand_of(((90, 90, -60), (90, 90, 60)), ((560, 300, 40), (480, 300, 40)))
    with pytest.raises(ValueError, match="swapped sides"):
        check_geometry(does(swapped, Circle(10.0)))


def test_what_leaves_an_open_hand_has_escaped() -> None:
    """A shallow scoop: everybody leaves it, and nobody counts as held out there. 200 trials."""
    scoop = hand_of(((20,), (20,)), ((200,), (200,)))
    scenario = does(scoop, Circle(20.0), start_spread=0.02)
    check_geometry(scenario)
    out = run([scenario], trials=200, max_steps=200_000, engine=EventDriven(), keep_final=True)
    assert out.final is not None
    assert (out.status[0] != LIMIT).mean() > 0.9
    height = float(scoop.goal().a.y)
    held = out.status[0] == LIMIT
    assert (out.final[0, held, 1] < height).all()
    assert out.final[0, ~held, 1] == pytest.approx(height, abs=0.1)


def test_a_mirror_keeps_distances_and_is_its_own_inverse() -> None:
    mirror = LOPSIDED.tip_mirror()
    a, b = Vec(3.0, 4.0), Vec(-7.0, 120.0)
    back = mirror.point(mirror.point(a))
    assert (float(back.x), float(back.y)) == pytest.approx((3.0, 4.0), abs=1e-9)
    apart = mirror.point(a) - mirror.point(b)
    assert float(apart.dot(apart)) == pytest.approx(10**2 + 116**2, rel=1e-12)
