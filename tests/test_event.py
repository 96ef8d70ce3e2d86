"""The event-driven engine against closed forms, energy, its own certificates, and stepping."""

from __future__ import annotations

import functools
import math
from itertools import pairwise
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pcjax.compiling import compiled_quickly
from pcjax.geometry import NEVER, Vec, first_root
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import TiltProfile, WristTilt
from pcjax.model.presets import box_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import INVALID, PASSED, RUNNING
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.event import EventDriven
from pcjax.simulate.leaping import LONGEST_ARC, Flight, leap
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.stepping import Stepping
from tests.helpers import strong


def scenario(radius: float = 25.0, angle: float = 10.0, *, back: bool = False, **law: float):
    make = eoen if back else does
    return make(box_hand(math.radians(angle)), Circle(radius), law=ContactLaw(**law))


def held(x: float, y: float) -> TiltProfile:
    """A wrist that is held where gravity has the components x, y."""
    zero = Vec(jnp.asarray(0.0), jnp.asarray(0.0))
    return TiltProfile(zero, zero, Vec(jnp.asarray(x), jnp.asarray(y)))


def flight(x: float, y: float, vx: float = 0.0, vy: float = 0.0, time: float = 2.0) -> Flight:
    x, y, vx, vy, time = map(float, (x, y, vx, vy, time))
    place, velocity = Vec(*map(jnp.asarray, (x, y))), Vec(*map(jnp.asarray, (vx, vy)))
    zero = jnp.zeros((), jnp.int32)
    return Flight(place, velocity, jnp.asarray(time), zero, zero)


def hop(scenario: Scenario, profile: TiltProfile, before: Flight, longest: float = NEVER) -> Flight:
    """The state after one leap, of at most `longest` seconds where gravity turns."""
    return _hop(*strong((scenario, profile, before, longest)))


@compiled_quickly
def _hop(scenario: Scenario, profile: TiltProfile, before: Flight, longest: jax.Array) -> Flight:
    drift = EventDriven().drift * scenario.body.radius
    swing = scenario.drive.swing(profile, before.time, drift)
    return leap(scenario.world(), swing, longest, before)


def leaps(scenario: Scenario, profile: TiltProfile, begin: Flight, most: int = 400) -> list[Flight]:
    """The states after each leap, to the end of the period or the trial."""
    path = [begin]
    while path[-1].status == RUNNING and path[-1].time < 10:
        path.append(hop(scenario, profile, path[-1]))
        assert len(path) <= most
    return path


def numbers(vec: Vec) -> np.ndarray:
    return np.array([float(vec.x), float(vec.y)])


coefficient = st.floats(-5, 5).filter(lambda v: v == 0 or abs(v) > 1e-3)


@pytest.mark.usefixtures("x64")
@settings(deadline=None)
@given(st.floats(1e-3, 10), coefficient, coefficient)
def test_first_root_is_the_least_positive_root(
    gap: float, speed: float, acceleration: float
) -> None:
    roots = np.roots([0.5 * acceleration, speed, gap]) if acceleration or speed else []
    scale = abs(speed) + abs(acceleration)
    real = [r.real for r in np.atleast_1d(roots) if abs(r.imag) < 1e-7 * scale and r.real > 0]
    got = float(first_root(gap, speed, acceleration))
    square = speed**2 - 2 * acceleration * gap
    if abs(square) < 1e-9:
        return  # a double root is there or not by rounding
    assert got == pytest.approx(min(real), rel=1e-6) if real else got == NEVER


@pytest.mark.usefixtures("x64")
def test_free_fall_through_the_goal_takes_one_leap_and_the_exact_time() -> None:
    # From the middle of the box out through the gap; nothing is in the way.
    path = leaps(scenario(), held(0.0, 30.0), flight(0.0, 200.0, 0.0, 4.0))
    assert int(path[-1].status) == PASSED
    time = (-4 + math.sqrt(16 + 60 * 300.0)) / 30.0  # 300 to the line between the tip joints
    assert float(path[-1].time) - 2.0 == pytest.approx(time, abs=1e-6)
    assert len(path) - 1 <= 6  # the planes through the fingertips' ends take a few looks


@pytest.mark.usefixtures("x64")
def test_bounces_on_the_palm_are_a_geometric_series() -> None:
    e, g, drop = 0.6, 20.0, 8.0
    path = leaps(
        scenario(restitution=e, resting_speed=1.0), held(0.0, -g), flight(10, 25 + drop, 2.0)
    )
    speed, time = math.sqrt(2 * g * drop), 2.0 + math.sqrt(2 * drop / g)
    for after in path[1:-1]:
        assert float(after.time) == pytest.approx(time, abs=1e-7)
        assert float(after.velocity.y) == pytest.approx(-speed, abs=1e-7)
        last, speed = speed, e * speed
        time += 2 * speed / g
    assert last <= 1.0 < last / e  # slower than the resting speed, so inelastic
    assert float(path[-1].velocity.y) == 0.0
    assert float(path[-1].time) == 10.0
    assert float(path[-1].position.x) == pytest.approx(10 + 2.0 * 8.0, abs=1e-6)  # no friction


@pytest.mark.usefixtures("x64")
def test_sliding_off_a_limb_is_one_leap_to_its_end() -> None:
    # Down the right fingertip's inner side, theta_g = 10 deg, and off its end.
    angle = math.radians(10)
    tangent = np.array([-math.sin(angle), -math.cos(angle)])
    normal = np.array([math.cos(angle), -math.sin(angle)])
    begin = np.array([100.0, 500.0]) + 40 * tangent + 5 * normal
    pull = -3.0 * normal + 2.0 * tangent
    path = leaps(scenario(radius=5.0), held(*pull), flight(*begin, *(6.0 * tangent)))
    off = path[1]
    time = (-6 + math.sqrt(36 + 4 * 60.0)) / 2.0  # 60 to the limb's end
    assert float(off.time) - 2.0 == pytest.approx(time, abs=1e-6)
    np.testing.assert_allclose(numbers(off.position), begin + 60 * tangent, atol=1e-4)
    np.testing.assert_allclose(numbers(off.velocity), (6 + 2 * time) * tangent, atol=1e-6)


@pytest.mark.usefixtures("x64")
def test_rolling_over_a_limbs_end_keeps_the_energy_and_flies_off_where_it_has_to() -> None:
    # From rest a little to the right of the top of the (turned) right fingertip's end. A point on
    # a frictionless circle leaves it at cos(angle) = 2 / 3 from the top.
    hand = scenario(radius=30.0, angle=0.0, back=True)
    end = np.array([100.0, 600.0])
    tilt = 0.05
    begin = end + 30 * np.array([math.sin(tilt), math.cos(tilt)])
    path = leaps(hand, held(0.0, -50.0), flight(*begin))
    for before, after in pairwise(path):
        offset = numbers(after.position) - end
        angle = math.atan2(offset[0], offset[1])
        energy = 0.5 * numbers(after.velocity) @ numbers(after.velocity) + 50.0 * after.position.y
        assert float(energy) == pytest.approx(50.0 * begin[1], rel=1e-9)
        if np.linalg.norm(offset) > 30 + 1e-3:
            left = numbers(before.position) - end
            leaving = math.atan2(left[0], left[1])
            assert math.cos(leaving) == pytest.approx(2 / 3, abs=LONGEST_ARC)
            return
        assert angle < math.pi / 2
    pytest.fail("it never flew off")


@pytest.mark.usefixtures("x64")
@pytest.mark.parametrize("angle", [-20.0, 20.0, 40.0])
def test_a_circle_thrown_into_a_corner_comes_to_rest_there(angle: float) -> None:
    # The corner between the right lid and its fingertip, acute or obtuse.
    begin = flight(150.0, 400.0, -5.0, 3.0)
    for _ in range(6):
        path = leaps(scenario(radius=10.0, angle=angle), held(-3.0, 4.0), begin, 60)
        begin = eqx.tree_at(lambda f: f.time, path[-1], jnp.asarray(2.0))
    assert float(path[-1].time) == 10.0
    assert numbers(path[-1].velocity) == pytest.approx([0, 0], abs=0)
    assert float(path[-1].position.y) == pytest.approx(490.0, abs=1e-5)
    assert len(path) == 2  # rest is one leap


@pytest.mark.usefixtures("x64")
def test_rest_on_two_fingertips_of_a_full_cage_takes_one_leap() -> None:
    hand = scenario(radius=30.0, angle=60.0)
    reach = 100 - 100 * math.sin(math.radians(60))
    height = 500 - 100 * math.cos(math.radians(60))
    begin = flight(0.0, height - math.sqrt(30**2 - reach**2))
    path = leaps(hand, held(0.3, 5.0), begin)
    assert len(path) <= 4
    np.testing.assert_allclose(numbers(path[-1].position), numbers(begin.position), atol=1e-5)


@functools.cache
def clearance_along(radius: float, angle: float, back: bool, trial: int) -> tuple[float, float]:
    """Least clearance within the leaps of a trial, and the largest rise in energy."""
    condition = scenario(radius, angle, back=back, restitution=0.5)
    limbs, drive = condition.hand.limbs(), condition.drive
    key, before = trial_key(5, trial), jnp.zeros(2)
    start = condition.start(start_draws(key, 3))
    now = flight(float(start.x), float(start.y), time=0.0)
    least, rise = math.inf, 0.0

    @jax.jit
    @jax.vmap
    def clear(x: jax.Array, y: jax.Array) -> jax.Array:
        return jnp.min(jnp.stack([jnp.asarray(limb.distance(Vec(x, y))) for limb in limbs]))

    for k in range(3):
        draws = period_draws(key, k, 2)
        profile = drive.profile(before, draws, k == 0)
        before = draws
        now = eqx.tree_at(lambda f: f.time, now, jnp.asarray(0.0))
        while float(now.time) < 10 and int(now.status) == RUNNING:
            after = hop(condition, profile, now)
            span = float(after.time - now.time)
            shares, weights = (
                np.linspace(0, 1, 9),
                np.array([7, 32, 12, 32, 14, 32, 12, 32, 7]) / 180,
            )
            if float(now.time) < 1 - 1e-6:
                # Shorter leaps from the same state.
                parts = [hop(condition, profile, now, max(share, 1e-9) * span) for share in shares]
                points = np.array([numbers(part.position) for part in parts])
                speeds = np.array([numbers(part.velocity) for part in parts])
                swing = drive.swing(profile, now.time, EventDriven().drift * radius)
                times = np.minimum(float(now.time) + shares * span, float(swing.turns_until) - 3e-6)
                pulls = [numbers(swing.around(jnp.asarray(time))[0]) for time in times]
            else:
                # The path between two states with the same acceleration.
                p, w, q = map(numbers, (now.position, after.velocity, after.position))
                first = 2 * (q - p) / max(span, 1e-12) - w  # just after the leap's start
                bend = (w - first) / max(span, 1e-12)
                t = shares[:, None] * span
                points, speeds = p + first * t + 0.5 * bend * t * t, first + bend * t
                pulls = np.tile(numbers(profile.held), (9, 1))
            least = min(least, float(np.min(clear(points[:, 0], points[:, 1]))) - radius)
            work = span * weights @ np.einsum("ij,ij->i", speeds, pulls)  # Boole's rule
            v, w = numbers(now.velocity), numbers(after.velocity)
            rise = max(rise, 0.5 * (w @ w - v @ v) - work)
            now = after
    return least, rise


@pytest.mark.usefixtures("x64")
@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from(
        [(25.0, 10.0, False), (5.0, 35.0, False), (5.0, -20.0, True), (40.0, 20.0, True)]
    ),
    st.integers(0, 50),
)
def test_nothing_happens_within_a_leap(condition: tuple[float, float, bool], trial: int) -> None:
    least, rise = clearance_along(*condition, trial)
    assert least > -1e-3 * condition[0]  # an arc's chord lies inside it by 5e-4 radii at most
    assert rise < 1e-4  # of some hundreds; Boole leaves 1e-5


SPREAD = {
    "large": scenario(50.0, 20.0),
    "small": scenario(5.0, 40.0),
    "back": scenario(25.0, -20.0, back=True),
    "bouncy": scenario(25.0, 10.0, restitution=0.6),
    "dead": scenario(25.0, 0.0, restitution=0.0),
    "tight": does(box_hand(0.0, gap_width=55.0), Circle(25.0)),
    "heavy": does(box_hand(0.2), Circle(5.0), WristTilt(gravity=98.0)),
    "steep": does(box_hand(0.2), Circle(25.0), WristTilt(amplitude=1.4)),
}


def test_agrees_with_fine_steps_on_the_same_draws() -> None:
    # 60 trials of 8 conditions to 60 s. Trials agree to a few steps until chaos tells them apart;
    # paired over all 480, the means may differ by chance alone: |z| < 4 (false alarm 6e-5).
    conditions = list(SPREAD.values())
    mine = run(conditions, trials=60, max_steps=60_000, engine=EventDriven(), precision=64)
    theirs = run(conditions, trials=60, max_steps=60_000, engine=Stepping(0.004), precision=64)
    assert not np.any(mine.status == INVALID)
    difference = mine.steps.astype(float) - theirs.steps
    assert np.mean(np.abs(difference) <= 20) > 0.97
    error = difference.std(ddof=1) / math.sqrt(difference.size)
    assert abs(difference.mean()) < max(4 * error, 1.0)


def test_precisions_agree() -> None:
    conditions = list(SPREAD.values())
    single, double = (
        run(conditions, trials=200, max_steps=100_000, engine=EventDriven(), precision=bits)
        for bits in (32, 64)
    )
    assert not np.any(single.status == INVALID)
    assert np.mean(np.abs(single.steps.astype(float) - double.steps) <= 20) > 0.97


@pytest.mark.parametrize(
    "changes", [{"block": 64}, {"workers": 1}, {"engine": EventDriven(5, 3)}], ids=str
)
def test_batches_bursts_and_workers_change_nothing(changes: dict) -> None:
    conditions = list(SPREAD.values())
    usual = {"trials": 70, "max_steps": 60_000, "engine": EventDriven(), "block": 256, "workers": 2}
    one, other = run(conditions, **usual), run(conditions, **(usual | changes))
    np.testing.assert_array_equal(one.steps, other.steps)
    np.testing.assert_array_equal(one.status, other.status)


def test_a_full_cage_by_a_hair_keeps_everything_in() -> None:
    # The gap is one part in ten thousand too narrow; 2 x 300 trials of 100 s.
    hand = box_hand(math.radians(30), gap_width=199.98)
    for bits in (32, 64):
        out = run(
            [does(hand, Circle(50.0)), eoen(hand, Circle(50.0))],
            trials=300,
            max_steps=100_000,
            engine=EventDriven(),
            precision=bits,
        )
        assert np.all(out.status == LIMIT)


def test_an_exact_fit_is_what_a_little_room_tends_to() -> None:
    # 400 trials of 60 s in each direction, paired with a circle a five-hundredth smaller and with
    # steps: means may differ by 0.5 % and by chance, |z| < 4 (false alarm 6e-5).
    hand = box_hand(math.radians(30), gap_width=200.0)
    exact = [make(hand, Circle(50.0)) for make in (does, eoen)]
    settings: dict[str, Any] = {"trials": 400, "max_steps": 60_000}
    mine = run(exact, engine=choose_engine("auto", None, exact[0]), **settings)
    assert not np.any(mine.status == INVALID)
    roomy = run(
        [make(hand, Circle(49.9)) for make in (does, eoen)], engine=EventDriven(), **settings
    )
    stepped = run(exact, engine=Stepping(0.01), **settings)
    for other in (roomy, stepped):
        difference = mine.steps.astype(float) - other.steps
        error = difference.std(ddof=1) / math.sqrt(difference.size)
        assert abs(difference.mean()) < 4 * error + 0.005 * mine.steps.mean()
    assert np.mean(mine.status == PASSED) > 0.05
    caged = [make(hand, Circle(50.0 * (1 + 1e-6))) for make in (does, eoen)]
    assert np.all(run(caged, engine=EventDriven(), **settings).status == LIMIT)


def test_a_spent_budget_ends_as_invalid() -> None:
    out, usual = (
        run([scenario()], trials=64, max_steps=100_000, engine=engine)
        for engine in (EventDriven(budget=12), EventDriven())
    )
    assert np.any(out.status == INVALID)
    assert not np.any(usual.status == INVALID)


@pytest.mark.usefixtures("x64")
def test_what_is_not_a_number_or_inside_a_limb_ends_as_invalid() -> None:
    assert int(hop(scenario(), held(0.0, -1.0), flight(math.nan, 100.0)).status) == INVALID
    assert int(hop(scenario(), held(0.0, -1.0), flight(0.0, 15.0)).status) == INVALID


def test_auto_is_event_driven_where_that_applies() -> None:
    assert isinstance(choose_engine("auto", None, scenario()), EventDriven)
    assert isinstance(choose_engine("auto", 0.01, scenario()), Stepping)
    soft = does(box_hand(0.1), Circle(25.0), law=ContactLaw(smoothing=1.0))
    assert isinstance(choose_engine("auto", None, soft), Stepping)
    with pytest.raises(ValueError, match="stepping"):
        choose_engine("event", None, soft)
    with pytest.raises(ValueError, match="dt"):
        choose_engine("event", 0.01, scenario())


def test_a_pocket_as_wide_as_the_object_lets_it_in_in_both_precisions():
    # Between fingertip and first limb of the paper's box hand with W_g = .8 L_p it is 50 wide.
    hand = box_hand(0.0, gap_width=400.0)

    def ends(radius: float, precision: int) -> np.ndarray:
        scenario = does(hand, Circle(radius))
        return run(
            [scenario],
            trials=300,
            max_steps=150_000,
            seed=0,
            engine=EventDriven(),
            precision=precision,
        ).steps[0]

    exact = ends(25.0, 64)
    assert np.mean(np.abs(ends(25.0, 32) - exact) < 100) > 0.97
    assert np.mean(np.abs(ends(24.99, 64) - exact) < 100) > 0.95
    # With a hair more it never gets in, which decides one trial in eight.
    assert np.mean(np.abs(ends(25.01, 64) - exact) < 100) < 0.93
