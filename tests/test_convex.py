"""Convex bodies with friction: closed forms, the circle's own engine, an independent simulator."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pcjax
from benchmarks import pymunk_scene
from benchmarks.inputs import as_arrays, solid_of
from pcjax.model.bodies.base import Body
from pcjax.model.scenario import Scenario
from pcjax.physics.pushes import NOT_NEEDED, least_pushes
from pcjax.physics.rigid import impact
from pcjax.physics.state import INVALID
from pcjax.physics.tumbling.flight import Tumble
from pcjax.simulate.batch import run
from pcjax.simulate.convex import ConvexLeaps
from pcjax.simulate.event import EventDriven
from tests.flights import STEADY, flown, pulled, released
from tests.reference import polygon as reference
from tests.reference.trials import escape_times

pytestmark = pytest.mark.usefixtures("quick_programs")

OPEN = pcjax.box_hand(math.radians(-20), gap_width=400.0)
"""A hand that many bodies leave soon."""


# --------------------------------------------------------------------------------------- bodies


def test_moments_are_those_of_the_shapes() -> None:
    assert float(pcjax.Square(60.0).inertia) == pytest.approx(60.0**2 / 6, rel=1e-6)
    assert float(pcjax.Rectangle((30.0, 40.0)).inertia) == pytest.approx(2500 / 12, rel=1e-6)
    # A square rounded until it is all but a disc.
    assert float(pcjax.Square(2.0, 0.9999).inertia) == pytest.approx(0.5, rel=1e-3)
    # A rectangle l x 2r and two half discs, whose centres of mass are 4 r / 3 pi beyond its ends.
    length, r = 40.0, 10.0
    box, disc = 2 * length * r, math.pi * r * r
    second = box * (length**2 + 4 * r * r) / 12 + disc * (r * r / 2 + length**2 / 4)
    second += disc * length * 4 * r / (3 * math.pi)
    capsule = pcjax.Capsule(length + 2 * r, 2 * r)
    assert float(capsule.inertia) == pytest.approx(second / (box + disc), rel=1e-6)
    assert float(capsule.width) == pytest.approx(20.0)
    assert float(capsule.radius) == pytest.approx(30.0)
    # Of a triangle: M (a^2 + b^2 + c^2) / 36, whatever the sense of its vertices.
    for corners in (((0, 0), (60, 0), (0, 80)), ((0, 0), (0, 80), (60, 0))):
        triangle = pcjax.Polygon(corners)
        assert float(triangle.inertia) == pytest.approx((60**2 + 80**2 + 100**2) / 36, rel=1e-6)
        assert float(triangle.width) == pytest.approx(48.0)
    turned = pcjax.RegularPolygon(16, 30.0)
    assert 0.97 < float(turned.inertia) / (30.0**2 / 2) < 1


def test_rounding_moves_the_centre_of_mass() -> None:
    """Against the moments of a polygon with 500 points on each round corner."""
    corners, rounding = np.array([(0.0, 0.0), (60.0, 0.0), (50.0, 25.0), (0.0, 80.0)]), 5.0
    edges = np.roll(corners, -1, 0) - corners
    headings = np.unwrap(np.arctan2(edges[:, 1], edges[:, 0]) - math.pi / 2)
    outline = np.concatenate(
        [
            corner + rounding * np.stack([np.cos(arc), np.sin(arc)], 1)
            for corner, after, before in zip(corners, headings, np.roll(headings, 1), strict=True)
            for arc in [np.linspace(before - 2 * math.pi * (before > after), after, 500)]
        ]
    )
    after = np.roll(outline, -1, 0)
    twice = outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]
    area, both = twice.sum() / 2, outline + after
    centre = (both * twice[:, None]).sum(0) / (6 * area)
    square = (outline**2 + outline * after + after**2).sum(1)
    second = (twice * square).sum() / 12 / area - centre @ centre
    body = pcjax.Polygon(tuple(map(tuple, corners)), rounding)
    np.testing.assert_allclose(
        [[float(v.x), float(v.y)] for v in body.vertices], corners - centre, atol=1e-3
    )
    assert float(body.inertia) == pytest.approx(second, rel=1e-4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: pcjax.Polygon(((0, 0), (10, 0), (10, 0), (0, 9))),
            r"two are the same, \(10, 0\)",
        ),
        (lambda: pcjax.Polygon(((0, 0), (9, 0), (3, 3), (0, 9))), r"not convex at \(3, 3\)"),
        (lambda: pcjax.Polygon(((0, 0), (5, 5), (9, 9))), "on one line"),
        (lambda: pcjax.Polygon(((0, 0),)), "rounding of a single vertex is 0"),
        (
            lambda: pcjax.Polygon(((0, 0), (9, math.nan), (0, 9))),
            "has to be a finite number",
        ),
        (lambda: pcjax.Polygon(tuple((k, k * k) for k in range(17))), "there are 17, and 1 to 16"),
        (
            lambda: pcjax.Polygon(tuple((math.sin(2.4 * k), math.cos(2.4 * k)) for k in range(5))),
            "not convex|crosses itself",
        ),
        (lambda: pcjax.Square(10.0, 5.0), "rounding is 5: it has to be less than half of the side"),
        (
            lambda: pcjax.Capsule(10.0, 12.0),
            "diameter is 12: it has to be less than the length, 10",
        ),
        (lambda: pcjax.RegularPolygon(2, 10.0), "number"),
        (lambda: pcjax.ContactLaw(friction=-0.1), "friction is -0.1: it has to be at least 0"),
    ],
)
def test_what_is_no_convex_body_is_refused(make: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


def test_a_body_of_a_study_comes_back(tmp_path: Any) -> None:
    path = tmp_path / "study.toml"
    path.write_text(
        '[body]\nkind = "polygon"\nvertices = [[0, 0], [60, 0], [0, 80]]\nrounding = 2\n'
        "orientation_deg = 30\n[contact]\nfriction = 0.3\n"
    )
    study = pcjax.load_study(path)
    assert float(study.body.rounding) == 2
    assert float(study.body.orientation) == pytest.approx(math.pi / 6)
    assert study.law.friction == 0.3
    path.write_text(study.to_toml())
    assert pcjax.load_study(path) == study
    path.write_text('[body]\nkind = "polygon"\nvertices = [[0, 0], [60]]\n')
    with pytest.raises(ValueError, match=r"\[body\] vertices is .*: it has to be a list of places"):
        pcjax.load_study(path)


def test_what_no_engine_can_run_is_said() -> None:
    square, rough = pcjax.Square(40.0), pcjax.ContactLaw(friction=0.3)
    with pytest.raises(ValueError, match=r"no engine can run this: .*this one is smoothed"):
        pcjax.evaluate(body=square, law=pcjax.ContactLaw(smoothing=1.0), trials=2)
    with pytest.raises(ValueError, match="without friction and drag; take engine 'convex'"):
        pcjax.evaluate(body=pcjax.Circle(25.0), law=rough, engine="event", trials=2)


# -------------------------------------------------------------------------------------- contacts


def test_an_impact_is_wang_and_masons_and_creates_no_energy() -> None:
    """2,000 random contacts; the reference goes through the phases one after the other."""
    rng = np.random.default_rng(0)
    n = 2000
    approach, slip = rng.exponential(1.0, n), rng.normal(size=n) * rng.choice([0, 0.1, 3], n)
    normal, along = rng.normal(size=(2, n)) * rng.choice([0.0, 0.5, 2.0], n)
    mu, e = rng.choice([0.0, 0.1, 0.5, 1.2], n), rng.choice([rng.uniform(), 0.0, 1.0], n)
    with jax.enable_x64(True):
        pushed, rubbed = map(np.asarray, jax.vmap(impact)(approach, slip, normal, along, mu, e))
    each = zip(approach, slip, normal, along, mu, e, strict=True)
    np.testing.assert_allclose(
        np.stack([pushed, rubbed], 1), [reference.collide(*one) for one in each], atol=1e-9
    )
    nt = normal * along
    normal_speed = -approach + pushed * (1 + normal**2) + rubbed * nt
    tangent_speed = slip + rubbed * (1 + along**2) + pushed * nt
    # Work of the impulses: at most none is gained.
    gained = pushed * (normal_speed - approach) / 2 + rubbed * (tangent_speed + slip) / 2
    assert gained.max() < 1e-9
    assert np.all(normal_speed > -1e-9)
    assert np.all(np.abs(rubbed) <= mu * pushed + 1e-9)
    smooth = mu == 0
    np.testing.assert_allclose(normal_speed[smooth], (e * approach)[smooth], atol=1e-9)
    # Without friction nothing changes along the limb, and all energy is kept at e = 1.
    assert np.all(rubbed[smooth] == 0)
    lost = approach**2 * (1 - e**2) / (2 * (1 + normal**2))
    np.testing.assert_allclose(-gained[smooth], lost[smooth], atol=1e-9)


def test_least_pushes_pull_at_nothing_and_leave_nothing_out() -> None:
    """500 random sets of four contacts in three dimensions; the conditions of Kuhn and Tucker."""
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(500, 4, 3))
    rows[:, :, 1] = np.abs(rows[:, :, 1]) + 0.5  # so that all can be met at once
    rows /= np.linalg.norm(rows, axis=2, keepdims=True)
    need = rng.normal(size=(500, 4))
    need[rng.random((500, 4)) < 0.3] = NOT_NEEDED

    def one(rows: jax.Array, need: jax.Array) -> jax.Array:
        cosines = {(a, b): rows[a] @ rows[b] for a in range(4) for b in range(a + 1, 4)}
        return jnp.stack(least_pushes(cosines, list(need), jnp.ones(())))

    with jax.enable_x64(True):
        pushes = np.asarray(jax.jit(jax.vmap(one))(jnp.asarray(rows), jnp.asarray(need)))
    given = np.einsum("nac,nbc,nb->na", rows, rows, pushes)
    assert np.all(pushes >= 0)
    assert np.all(given - need > -1e-6)
    assert np.all(np.minimum(pushes, given - need) < 1e-6)


# ------------------------------------------------------------------------------- slopes, by hand


def slid(
    body: Body,
    pull: tuple[float, float],
    friction: float,
    speed: float = 0.0,
    drag: float = 0.0,
) -> Tumble:
    """A body that lies on the palm for 3 s under a steady pull, at (0, height)."""
    law = pcjax.ContactLaw(friction=friction, drag=drag)
    scenario = pcjax.does(pcjax.box_hand(), body, STEADY, law)
    return _slid(scenario, jnp.asarray(pull), jnp.asarray(speed))


@jax.jit
def _slid(scenario: Scenario, pull: jax.Array, speed: jax.Array) -> Tumble:
    world, zero = scenario.world(), jnp.zeros(())
    body: Any = scenario.body
    lowest = jnp.stack([vertex.y for vertex in body.vertices]).min()
    first = released((zero, body.skin - lowest), (speed, zero), zero, zero)
    return flown(world, pulled(pull[0], pull[1]), first, 3.0)


def test_a_block_sticks_slides_brakes_and_tips() -> None:
    block = pcjax.Square(60.0, 0.5)
    sticks = slid(block, (2.9, -10.0), 0.3)
    assert float(sticks.position.x) == 0.0
    assert int(sticks.leaps) <= 3
    slides = slid(block, (5.0, -10.0), 0.3)
    assert float(slides.position.x) == pytest.approx(0.5 * (5 - 3) * 3**2, rel=1e-3)
    assert float(slides.spin) == pytest.approx(0.0, abs=1e-3)
    stops = slid(block, (0.0, -10.0), 0.3, speed=6.0)
    assert float(stops.position.x) == pytest.approx(6.0**2 / (2 * 3), rel=1e-3)
    assert float(stops.velocity.x) == 0.0


def test_a_block_tips_about_its_leading_corner_as_the_pull_leaves_its_base() -> None:
    """Against the equation of motion of a block on a hinge."""
    block = pcjax.Square(60.0)
    assert abs(float(slid(block, (9.0, -10.0), 2.0).angle)) < 1e-4
    inertia = 2 / 3 * 60.0**2

    def hinged(_: float, state: Any) -> Any:
        angle = state[0] + 3 * math.pi / 4  # from the corner to the centre
        x, y = 30 * math.sqrt(2) * math.cos(angle), 30 * math.sqrt(2) * math.sin(angle)
        return state[1], (x * -10.0 - y * 12.0) / inertia

    true = solve_ivp(hinged, (0, 3), (0, 0), rtol=1e-9, atol=1e-9).y[:, -1]
    tips = slid(block, (12.0, -10.0), 2.0)
    np.testing.assert_allclose([float(tips.angle), float(tips.spin)], true, rtol=2e-2)


def test_drag_brakes_as_an_exponential() -> None:
    """v' = a - c v, in flight as in sliding."""
    slides = slid(pcjax.Square(60.0, 0.5), (4.0, -10.0), 0.1, speed=5.0, drag=0.4)
    settles = (4.0 - 1.0) / 0.4
    left = math.exp(-0.4 * 3)
    assert float(slides.velocity.x) == pytest.approx(settles + (5 - settles) * left, rel=2e-3)
    travelled = settles * 3 + (5 - settles) * (1 - left) / 0.4
    assert float(slides.position.x) == pytest.approx(travelled, rel=2e-3)
    spins = slid(pcjax.Circle(20.0), (0.0, -10.0), 2.0, speed=9.0, drag=0.4)
    assert float(spins.velocity.x) == pytest.approx(9 * 2 / 3 * left, rel=2e-3)


def test_a_circle_rolls_at_two_thirds_and_skids_beyond_its_grip() -> None:
    circle = pcjax.Circle(30.0)
    rolls = slid(circle, (3.0, -10.0), 0.5)
    assert float(rolls.position.x) == pytest.approx(2 / 3 * 3.0 * 3**2 / 2, rel=1e-3)
    assert float(rolls.spin) == pytest.approx(-2 / 3 * 3.0 * 3 / 30, rel=1e-3)
    skids = slid(circle, (8.0, -10.0), 0.1)
    assert float(skids.position.x) == pytest.approx((8 - 1) * 3**2 / 2, rel=1e-3)
    assert float(skids.spin) == pytest.approx(-2 * 1.0 * 3 / 30, rel=1e-3)


# ----------------------------------------------------------------------------------- whole trials


def outcomes(body: Body, friction: float, engine: Any, **settings: Any) -> Any:
    law = pcjax.ContactLaw(friction=friction)
    return run([pcjax.does(OPEN, body, law=law)], engine=engine, **settings)


def test_one_vertex_is_the_circle() -> None:
    """The share of trials that may part: they meet a fingertip's end, which multiplies rounding."""
    settings: dict[str, Any] = {"trials": 64, "max_steps": 50_000}
    mine = outcomes(pcjax.Circle(25.0), 0.0, ConvexLeaps(drift=1e-7), **settings)
    other = outcomes(pcjax.Circle(25.0), 0.0, EventDriven(), **settings)
    assert np.mean(np.abs(mine.steps - other.steps) <= 2) >= 0.95
    assert not np.any(mine.status == INVALID)


@pytest.mark.parametrize(("friction", "thickness"), [(0.0, 0.0), (0.35, 0.0), (0.35, 16.0)])
def test_trials_are_the_references(friction: float, thickness: float) -> None:
    """Square and rod, 48 trials to 30 s by steps of 1 ms: most end within 20 steps of another."""
    for body in (pcjax.Square(70.0, 0.5), pcjax.Capsule(70.0, 1.0)):
        hand = replace(OPEN, thickness=thickness)
        scenario = pcjax.does(hand, body, law=pcjax.ContactLaw(friction=friction))
        mine = run([scenario], engine=ConvexLeaps(), trials=48, max_steps=30_000)
        theirs = escape_times(scenario, 48, 30.0) / 0.001
        assert not np.any(mine.status == INVALID)
        assert not np.any(np.isnan(theirs))
        assert np.mean(np.abs(mine.steps[0] - theirs) <= 20) >= 0.85
        assert np.mean(theirs < 30_000) > 0.15


def test_pymunk_has_the_same_index() -> None:
    """A square with friction, 96 trials to 30 s by steps of 5 ms, each mean with its own error:
    less than one false alarm in 10,000 (4 standard errors)."""
    limit = 30_000
    scenario = pcjax.does(OPEN, pcjax.Square(70.0, 0.5), law=pcjax.ContactLaw(friction=0.35))
    mine = run([scenario], engine=ConvexLeaps(), trials=96, max_steps=limit).steps[0]
    inputs, solid = as_arrays(scenario, trials=96, max_steps=limit), solid_of(scenario)
    theirs = pymunk_scene.escape_steps(**inputs, solid=solid, dt=0.005, max_steps=limit // 5)
    theirs = np.minimum(5 * theirs, limit)
    error = math.hypot(mine.std(), theirs.std()) / math.sqrt(96)
    assert abs(mine.mean() - theirs.mean()) < 4 * error
    assert error < 0.06 * limit


def test_hardly_any_friction_or_thickness_is_none() -> None:
    """Programs with and without friction on the same trials."""
    settings: dict[str, Any] = {"engine": ConvexLeaps(), "trials": 64, "max_steps": 30_000}
    capsule = pcjax.Capsule(70.0, 1.0)
    without = run([pcjax.does(OPEN, capsule)], **settings)
    law = pcjax.ContactLaw(friction=1e-7)
    for hand in (OPEN, replace(OPEN, thickness=1e-5)):
        hardly = run([pcjax.does(hand, capsule, law=law)], **settings)
        assert np.mean(np.abs(hardly.steps - without.steps) <= 2) >= 0.9


def test_a_small_sharp_square_is_not_lost_to_rounding() -> None:
    """Its skin of 0.0014 is about what 32 bits hide in a hand of 500; with no more between corners
    and limbs 28 of 1,000 such trials went wrong, so that none of 200 had a chance of 0.4 %."""
    scenario = pcjax.does(pcjax.box_hand(math.radians(10)), pcjax.Square(10.0))
    out = run([scenario], engine=ConvexLeaps(), trials=200, max_steps=600_000)
    assert not np.any(out.status == INVALID)


@pytest.mark.parametrize("law", [pcjax.ContactLaw(), pcjax.ContactLaw(friction=0.35)])
def test_a_gap_that_a_body_fits_exactly_lets_it_through(law: pcjax.ContactLaw) -> None:
    """As many as one with a little room, whatever the precision; 200 shared trials. Rounding held
    most of them back. False alarm 1e-4: four standard errors of a paired difference."""
    hand = pcjax.box_hand(math.radians(30))  # W_g - 2 L_g sin(theta_g) = 100

    def ends(radius: float, precision: int) -> np.ndarray:
        scenario = pcjax.eoen(hand, pcjax.Circle(radius, turns=False), law=law)
        out = run(
            [scenario],
            engine=ConvexLeaps(),
            trials=200,
            max_steps=300_000,
            seed=1,
            precision=precision,
        )
        return out.steps[0].astype(float)

    exactly = ends(50.0, 32)
    assert np.mean(exactly < 300_000) > 0.1
    for other in (ends(50.0, 64), ends(49.9, 32)):
        difference = exactly - other
        assert abs(difference.mean()) <= 4 * difference.std(ddof=1) / math.sqrt(200)
