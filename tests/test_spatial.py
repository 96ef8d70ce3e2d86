"""Hands in three dimensions: what they are made of, and the trials that MuJoCo runs with them."""

import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import pcjax
from experiments.plane3d import compared, flat
from pcjax import spatial
from pcjax.cli import main
from pcjax.model.spatial.bodies import Solid, centred_hull
from pcjax.model.spatial.frozen import frozen
from pcjax.model.spatial.hand import _read
from pcjax.physics.state import INVALID, PASSED
from pcjax.quality import stopping
from pcjax.simulate.backends.crossing import Crossings
from pcjax.simulate.backends.mujoco import MuJoCo, run_trials
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.draws import period_draws, trial_key
from pcjax.simulate.outcomes import LIMIT
from pcjax.study.read import example, read_study

pytest.importorskip("mujoco.batch")

CUP = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1" pos="0 0 -1"/>
    <body name="arm" pos="0.3 0.1 0.2" euler="0 90 0">
      <geom name="arm" type="capsule" fromto="0 0 -0.3 0 0 -0.2" size="0.02"/>
      <body name="cup" pos="0 0 0.1">
        <geom name="bottom" type="box" size="0.05 0.05 0.005" pos="0 0 -0.005"/>
        <geom name="east" type="box" size="0.005 0.05 0.05" pos="0.045 0 0.05"/>
        <geom name="west" type="box" size="0.005 0.05 0.05" pos="-0.045 0 0.05"/>
        <geom name="north" type="box" size="0.05 0.005 0.05" pos="0 0.045 0.05"/>
        <geom name="south" type="box" size="0.05 0.005 0.05" pos="0 -0.045 0.05"/>
        <body name="lid" pos="0.05 0 0.1">
          <joint name="hinge" type="hinge" axis="0 1 0" range="-180 90"/>
          <joint name="slide" type="slide" axis="0 0 1"/>
          <geom name="lid" type="box" size="0.05 0.05 0.005" pos="0.055 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""A cup that opens along its z, with a lid that lies open beside it, on an arm that lies down."""


@pytest.fixture
def cup(tmp_path: Path) -> spatial.Hand:
    path = tmp_path / "cup.xml"
    path.write_text(CUP)
    start = spatial.StartBox((0.0, 0.0, 0.03), (0.01, 0.01, 0.0))
    opening = spatial.PlaneEscape((0.0, 0.0, 0.1), (0.0, 0.0, 2.0))
    return spatial.Hand(path, start, root="cup", escape=opening, exclude=["lid"])


def done(capfd: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """The exit status of a command, and what it printed."""
    code = 0
    try:
        main([str(word) for word in words])
    except SystemExit as end:
        code = int(end.code or 0)
    out, err = capfd.readouterr()
    return code, out, err


def still(rest: tuple[float, float, float], **more: float) -> spatial.Tilt:
    return spatial.Tilt(0.0, rest, **more)


# ------------------------------------------------------------------------------------------ parts


def test_solids_have_their_thickness_and_lie_within_their_points():
    box = np.array([[x, y, z] for x in (0, 2) for y in (0, 3) for z in (0, 4)], float)
    for solid, half, farthest in (
        (Solid("sphere", (2.0,)), 2.0, 2.0),
        (Solid("capsule", (1.0, 3.0)), 1.0, 4.0),
        (Solid("cylinder", (3.0, 1.0)), 1.0, math.hypot(3, 1)),
        (Solid("box", (1.0, 2.0, 2.0)), 1.0, 3.0),
        (Solid("ellipsoid", (1.0, 2.0, 0.5)), 0.5, 2.0),
        (Solid("mesh", (1.0, 1.5, 2.0), centred_hull(box)), 1.0, math.sqrt(1 + 1.5**2 + 4)),
    ):
        assert solid.half_thickness == pytest.approx(half, abs=1e-9)
        reach = np.linalg.norm(solid.points(), axis=1).max()
        assert reach == pytest.approx(farthest, rel=1e-9)
        assert solid.scaled(3.0).half_thickness == pytest.approx(3 * half)


def test_a_hull_is_seen_from_its_centre_of_mass():
    rng = np.random.default_rng(3)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    inside = rng.dirichlet([1, 1, 1, 1], 100) @ corners
    hull = centred_hull(np.concatenate([corners, inside]))
    assert len(hull) == 4
    assert hull.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)  # of a tetrahedron it is that


def test_gravity_is_the_wrists():
    # With the hand's palm in the plane of x and y, gravity's part in that plane is (1).
    tilt = spatial.Tilt(math.pi / 6, (0.0, 0.0, -1.0))
    wrist = pcjax.WristTilt()
    draws = np.random.default_rng(1).random((5, 2, 2))
    for before, now in draws:
        profile = wrist.profile(jnp.asarray(before), jnp.asarray(now), False)
        for time in (0.0, 0.3, 1.0, 5.0):
            still = pcjax.model.drives.base.Vec(0.0, 0.0)
            there = wrist.fly(profile, still, still, time, 1e-6).acceleration
            angles = tilt.angles(before[None], now[None], time, first=False)
            (x, y, _) = tilt.pull(angles)[0]
            assert (x, y) == pytest.approx((float(there.x), float(there.y)), abs=1e-3)


def test_gravity_at_rest_points_where_it_is_said_to():
    for rest in ((1.0, 0.0, 0.0), (0.0, 3.0, 0.0), (1.0, 1.0, -1.0), (-1.0, 0.1, 0.0)):
        tilt = spatial.Tilt(1.0, rest, gravity=2.0)
        axes = tilt.axes()
        assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        expected = 2 * np.array(rest) / np.linalg.norm(rest)
        assert tilt.pull(np.zeros((1, 2)))[0] == pytest.approx(expected, abs=1e-12)


def test_trials_have_the_draws_of_the_plane():
    # So that trial i is the same experiment there and here.
    from pcjax.simulate.backends.mujoco import _period_draws

    mine = _period_draws(7, np.arange(3), 4, 2)
    theirs = [period_draws(trial_key(7, trial), 4, 2) for trial in range(3)]
    assert mine == pytest.approx(np.array(jax.device_get(theirs)))


def test_random_orientations_are_uniform():
    # 4,000 draws: each entry of a random rotation has mean 0 and variance 1/3, so the means of nine
    # entries are beyond 4.5 standard errors in 6 of 100,000 runs.
    box = spatial.StartBox((0.0, 0.0, 0.0), (1.0, 2.0, 0.0), None)
    draws = np.random.default_rng(0).random((4000, box.draws))
    places = box.places(draws)
    assert np.linalg.norm(places[:, 3:], axis=1) == pytest.approx(np.ones(4000))
    from scipy.spatial.transform import Rotation

    entries = Rotation.from_quat(places[:, [4, 5, 6, 3]]).as_matrix()
    assert np.abs(entries.mean(axis=0)).max() < 4.5 * math.sqrt(1 / 3 / 4000)
    assert (np.abs(places[:, :3]).max(axis=0) <= [1, 2, 0]).all()


# ------------------------------------------------------------------------------------------- hand


def test_a_hand_is_seen_from_its_root_without_what_is_excluded(cup: spatial.Hand):
    seen = frozen(cup)
    assert [geom.parts[0] for geom in seen.geoms] == ["bottom", "east", "west", "north", "south"]
    by_name = {geom.parts[0]: geom for geom in seen.geoms}
    assert by_name["east"].place == pytest.approx([0.045, 0, 0.05], abs=1e-12)
    assert by_name["east"].axes == pytest.approx(np.eye(3), abs=1e-12)
    # The hull is the box about all of it.
    inside, outside = np.array([[0.049, 0.049, 0.099]]), np.array([[0, 0, 0.1001]])
    planes = seen.hull
    assert (inside @ planes[:, :3].T + planes[:, 3]).max() < 0
    assert (outside @ planes[:, :3].T + planes[:, 3]).max() == pytest.approx(1e-4, rel=1e-6)


def test_joints_and_scales_move_what_they_carry(cup: spatial.Hand):
    closed = cup.having(posture={"hinge": -math.pi, "slide": 0.01}, exclude=[])
    lid = next(geom for geom in frozen(closed).geoms if geom.parts[0] == "lid")
    # The slide has turned along: it goes down.
    assert lid.place == pytest.approx([-0.005, 0, 0.09], abs=1e-9)
    larger = cup.having(scales={"lid": 2.0}, exclude=[])
    lid = next(geom for geom in frozen(larger).geoms if geom.parts[0] == "lid")
    assert lid.solid.size == pytest.approx((0.1, 0.1, 0.01))
    assert lid.place == pytest.approx([0.05 + 0.11, 0, 0.1], abs=1e-9)
    whole = frozen(cup.having(scales={"cup": 2.0}))
    assert whole.size == pytest.approx(2 * frozen(cup).size)


def test_a_mirrored_geom_is_its_image(tmp_path: Path):
    point, normal = np.array([0.0, 0.0, 0.06]), np.array([0.6, 0.0, 0.8])
    hand = spatial.Hand(
        spatial.PRESETS["three-finger"], spatial.StartBox((0, 0, 0.04), (0, 0, 0)), root="palm"
    )
    for geom in frozen(hand).geoms:
        image = geom.mirrored(point, normal)
        flipped = geom.points() - 2 * np.outer((geom.points() - point) @ normal, normal)
        # The same points, in another order.
        order = [np.lexsort(points.round(9).T) for points in (flipped, image.points())]
        assert image.points()[order[1]] == pytest.approx(flipped[order[0]], abs=1e-12)
        assert np.linalg.det(image.axes) == pytest.approx(1.0)


def test_a_urdf_hand_is_read(tmp_path: Path):
    path = tmp_path / "hand.urdf"
    path.write_text("""
<robot name="hand">
  <link name="palm"><collision><geometry><box size="0.1 0.1 0.02"/></geometry></collision></link>
  <link name="finger"><collision><origin xyz="0 0 0.04"/>
    <geometry><cylinder radius="0.01" length="0.08"/></geometry></collision>
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="knuckle" type="revolute"><parent link="palm"/><child link="finger"/>
    <origin xyz="0.04 0 0.01"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1"
    velocity="1"/></joint>
</robot>""")
    start = spatial.StartBox((0.0, 0.0, 0.03), (0.0, 0.0, 0.0))
    hand = spatial.Hand(path, start, root="palm", posture={"knuckle": 0.5})
    palm, finger = frozen(hand).geoms
    assert palm.solid.size == pytest.approx((0.05, 0.05, 0.01))
    expected = [0.04 + 0.04 * math.sin(0.5), 0, 0.01 + 0.04 * math.cos(0.5)]
    assert finger.place == pytest.approx(expected, abs=1e-9)


# ----------------------------------------------------------------------------------------- trials


def test_a_fall_takes_as_long_as_it_has_to(cup: spatial.Hand):
    # Out of the cup, which is upside down: from z = .03 to .1 under g.
    scenario = spatial.Scenario(cup, spatial.Sphere(0.01), still((0, 0, 1)))
    scenario.check()
    steps, status = run_trials(scenario, np.arange(4), max_steps=2000, seed=0, dt=0.001)
    assert (status == PASSED).all()
    # In steps of dt a fall is ahead by half a step.
    assert np.abs(steps - 1000 * math.sqrt(2 * 0.07 / 9.8)).max() <= 1


def test_what_the_cup_holds_stays_and_comes_to_rest(cup: spatial.Hand):
    for body in (spatial.Sphere(0.01), spatial.Box(0.02, 0.02, 0.02), spatial.Capsule(0.008, 0.01)):
        scenario = spatial.Scenario(cup, body, still((0, 0, -1)), pcjax.ContactLaw(friction=0.3))
        scenario.check()
        steps, status = run_trials(scenario, np.arange(4), max_steps=3000, seed=0, dt=0.002)
        assert (status == LIMIT).all()
        assert (steps == 3000).all()


def test_an_impact_keeps_about_the_share_of_restitution(cup: spatial.Hand):
    from pcjax.simulate.backends.mujoco import Film

    hand = cup.having(start=spatial.StartBox((0.0, 0.0, 0.09), (0.0, 0.0, 0.0)))
    law = pcjax.ContactLaw(restitution=0.5)
    scenario = spatial.Scenario(hand, spatial.Sphere(0.01), still((0, 0, -1)), law)
    film = Film()
    run_trials(scenario, np.arange(1), max_steps=400, seed=0, dt=0.0005, film=film)
    height = np.concatenate(film.states)[:, 2] - 0.01
    after = round((math.sqrt(2 * 0.08 / 9.8) + 0.02) / 0.0005)
    assert height[after:].max() == pytest.approx(0.08 * 0.5**2, rel=0.15)


def test_trials_do_not_depend_on_threads_or_company():
    study, _ = read_study_text(example("mujoco"))
    scenario = study.scenarios()["does"]
    together, status = run_trials(scenario, np.arange(6), max_steps=4000, seed=3, dt=0.002)
    alone = [
        run_trials(scenario, np.array([k]), max_steps=4000, seed=3, dt=0.002, threads=1)
        for k in range(6)
    ]
    assert together.tolist() == [int(steps[0]) for steps, _ in alone]
    assert status.tolist() == [int(ends[0]) for _, ends in alone]


def test_trials_go_as_single_steps_of_mujoco_do():
    # On the benchmark's starts and gravity, which it works out by itself.
    from benchmarks.spatial import DT, pulls, starts, stepped
    from pcjax.simulate.backends.mujoco import Film

    study, _ = read_study_text(example("mujoco"))
    scenario: Any = study.scenarios()["does"]
    model, gravity = scenario.scene(DT).model, pulls(scenario, 2, 750)
    for k, place in enumerate(starts(scenario, 2)):
        film = Film()
        run_trials(scenario, np.arange(k, k + 1), max_steps=1500, seed=0, dt=DT, film=film)
        states = np.concatenate(film.states)
        count = len(states) - 1
        assert count > 500
        assert (stepped(model, place, gravity[k], count) == states[-1]).all()


def read_study_text(text: str, folder: Path | None = None) -> tuple[pcjax.Study, list[str]]:
    import tempfile

    with tempfile.TemporaryDirectory() as made:
        path = (folder or Path(made)) / "study.toml"
        path.write_text(text)
        return read_study(path)


# --------------------------------------------------------------------------- nothing slips through


def test_a_bullet_through_a_wall_went_wrong(cup: spatial.Hand):
    # The east wall's core is from x = .0425 to .0475.
    scenario = spatial.Scenario(cup, spatial.Sphere(0.01), still((0, 0, -1)))
    crossings = Crossings(scenario.scene(0.002))
    ways = np.array([[0.02, 0.07], [0.02, 0.041], [0.044, 0.05], [0.06, 0.3]])
    states = np.zeros((4, 2, 7))
    states[..., 0], states[..., 2], states[..., 3] = ways, 0.05, 1.0
    found = crossings.wrong(states, np.zeros((4, 1)))
    assert found[:, 0].tolist() == [True, False, True, False]


def test_what_is_in_a_wall_by_more_than_half_went_wrong(cup: spatial.Hand):
    scenario = spatial.Scenario(cup, spatial.Sphere(0.01), still((0, 0, -1)))
    crossings = Crossings(scenario.scene(0.002))
    for depth, wrong in ((0.004, False), (0.006, True)):
        state = np.array([0.04 - 0.01 + depth, 0, 0.05, 1, 0, 0, 0])
        states = np.stack([state, state])[None]
        assert crossings.wrong(states, np.full((1, 1), depth)).tolist() == [[wrong]]


def test_a_turning_rod_through_a_wall_went_wrong(cup: spatial.Hand):
    scenario = spatial.Scenario(cup, spatial.Capsule(0.006, 0.04), still((0, 0, -1)))
    crossings = Crossings(scenario.scene(0.002))
    half = math.sqrt(0.5)
    upright, along = [0.035, 0, 0.05, 1, 0, 0, 0], [0.035, 0, 0.05, half, 0, half, 0]
    assert crossings.wrong(np.array([[upright, along]]), np.zeros((1, 1))).all()
    assert not crossings.wrong(np.array([[upright, upright]]), np.zeros((1, 1))).any()


def test_geoms_that_are_too_thin_for_any_step_are_refused(tmp_path: Path, cup: spatial.Hand):
    thin = tmp_path / "thin.xml"
    thin.write_text(CUP.replace('size="0.005 0.05 0.05"', 'size="0.0001 0.05 0.05"'))
    hand = spatial.Hand(thin, cup.start, root="cup", exclude=["lid"])
    scenario = spatial.Scenario(hand, spatial.Sphere(0.01), still((0, 0, -1)))
    with pytest.raises(ValueError, match=r"geom east is 0.2 mm thick.*exclude it"):
        choose_engine("auto", None, scenario)
    thick = spatial.Scenario(cup, spatial.Sphere(0.01), still((0, 0, -1)))
    assert choose_engine("auto", None, thick).step_taken(10.0) == pytest.approx(0.002)


def test_steps_are_short_enough_for_thin_objects(cup: spatial.Hand):
    # A coin of 1 mm in walls of 10 mm: with the step that does for the walls it is lost in nearly
    # every trial, with its own in none.
    start = spatial.StartBox((0.0, 0.0, 0.03), (0.01, 0.01, 0.0), None)
    tilt = spatial.Tilt(math.radians(60), (0.0, 0.0, -1.0), ramp_time=0.2, period=0.5)
    coin = spatial.Cylinder(0.012, 0.001)
    scenario = spatial.Scenario(cup.having(start=start), coin, tilt)
    dt = choose_engine("auto", None, scenario).step_taken(tilt.period)
    assert dt == pytest.approx(0.00025)
    for step, least, most in ((dt, 0, 0), (0.002, 6, 8)):
        _, status = run_trials(scenario, np.arange(8), max_steps=1000, seed=0, dt=step)
        assert least <= (status == INVALID).sum() <= most
    thin = spatial.Scenario(cup, spatial.Cylinder(0.012, 0.0002), tilt)
    with pytest.raises(ValueError, match=r"the object is 0.2 mm thick.* a smaller dt"):
        choose_engine("auto", None, thin)
    assert choose_engine("auto", 1e-4, thin).step_taken(tilt.period) == pytest.approx(1e-4)


@pytest.mark.parametrize("radius", [1e-5, 1e-9])
def test_specks_are_refused_in_our_words(cup: spatial.Hand, radius: float):
    # MuJoCo refuses bodies of no mass, with an error of its own.
    scenario = spatial.Scenario(cup, spatial.Sphere(radius), still((0, 0, -1)))
    scenario.check()
    with pytest.raises(ValueError, match=r"the object is .* mm thick"):
        choose_engine("auto", None, scenario)
    frozen(cup.having(scales={"lid": 1e-4}, exclude=[]))


def test_what_is_not_finite_went_wrong(cup: spatial.Hand, monkeypatch: pytest.MonkeyPatch):
    tilt = still((0, 0, -1), gravity=9.8)
    monkeypatch.setattr(
        spatial.Tilt,
        "pull",
        lambda self, angles: np.where(np.arange(4) == 2, np.nan, 0.0)[:, None] + np.zeros((4, 3)),
    )
    scenario = spatial.Scenario(cup, spatial.Sphere(0.01), tilt)
    _, status = run_trials(scenario, np.arange(4), max_steps=10, seed=0, dt=0.002)
    assert status.tolist() == [LIMIT, LIMIT, INVALID, LIMIT]
    assert not Path("MUJOCO_LOG.TXT").exists()


# ------------------------------------------------------------------------------- ways to and fro


def test_an_engine_is_for_hands_of_its_own_dimensions(cup: spatial.Hand):
    scenario = spatial.Scenario(cup, spatial.Sphere(0.01), still((0, 0, -1)))
    with pytest.raises(ValueError, match=r"is for hands in the plane; take engine 'mujoco'"):
        choose_engine("event", None, scenario)
    flat = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
    with pytest.raises(ValueError, match="is for hands in three dimensions; take engine 'event'"):
        choose_engine("mujoco", None, flat)


def test_the_example_runs_and_reads_back(tmp_path: Path):
    study, doubts = read_study_text(example("mujoco"))
    assert not doubts
    again, _ = read_study_text(study.to_toml())
    assert again.to_toml() == study.to_toml()
    small = replace(study, run=replace(study.run, trials=4, max_steps=1000))
    result = pcjax.evaluate_study(small)
    assert sum(result.status("does").values()) == 4
    assert math.isnan(result.gap("does"))
    path = result.save(tmp_path / "hand.nc")
    assert repr(pcjax.Evaluation.load(path)) == repr(result)


def test_names_of_numbers_reach_them():
    study, _ = read_study_text(example("mujoco"))
    other = study.having(
        {"posture.tip1": 30.0, "radius": 0.02, "amplitude_deg": 10.0, "inflation": 2}
    )
    assert other.hand.number_of("tip1") == pytest.approx(math.radians(30))
    assert other.body.width == pytest.approx(0.04)
    assert float(other.drive.amplitude) == pytest.approx(math.radians(10))
    assert other.unit_of("posture.tip1"), other.unit_of("radius") == ("degree", "m")
    for name, said in (
        ("posture.tip9", "there is no joint tip9 in .*: did you mean tip"),
        ("scale.thumb", "there is no body thumb in "),
        ("radios", "there is no radios to be swept: did you mean radius?"),
    ):
        with pytest.raises(ValueError, match=said):
            study.having({name: 1.0})


def test_half_the_step_is_told_of(cup: spatial.Hand):
    # A fall is ahead by half a step of dt, so that with half the step it ends later for certain.
    drive = still((0, 0, 1), period=2.0)
    run_as = pcjax.Run(trials=40, max_steps=2000, dt=0.004)
    study = spatial.Study(cup, spatial.Sphere(0.01), drive, run=run_as)
    result = pcjax.evaluate_study(study)
    assert result.attrs["does_half_step_trials"] == 4
    later = result.attrs["does_half_step_later"]
    assert 0.5 <= later <= 1.5
    error = result.attrs["does_half_step_se"]
    told = "half the step" in " ".join(result.notes())
    assert told == (later > stats.t.ppf(0.975, df=3) * error)


@pytest.mark.parametrize(("trials", "told"), [(4, False), (100, True)])
def test_a_difference_of_few_trials_has_to_be_larger(trials: int, told: bool):
    # 2.5 standard errors: with 3 degrees of freedom 95 % are within 3.18 of them, with 99 in 1.98.
    study, _ = read_study_text(example("mujoco"))
    result = pcjax.evaluate_study(replace(study, run=replace(study.run, trials=4, max_steps=20)))
    result.attrs |= {
        "does_half_step_later": -2.5,
        "does_half_step_se": 1.0,
        "does_half_step_trials": trials,
    }
    assert ("half the step" in " ".join(result.notes())) == told


@pytest.mark.parametrize("compared", [False, True])
def test_half_the_step_is_tried_once_for_a_precision(
    cup: spatial.Hand, monkeypatch: pytest.MonkeyPatch, compared: bool
):
    # However often it is looked at how many trials the precision takes.
    asked = []

    def second_opinion(self: MuJoCo, scenario: Any, outcomes: Any, how: Any) -> dict[str, float]:
        asked.append(outcomes.steps.shape[1])
        return {"half_step_later": 0.0, "half_step_se": 0.0, "half_step_trials": 2}

    monkeypatch.setattr(MuJoCo, "second_opinion", second_opinion)
    monkeypatch.setattr(stopping, "FIRST_LOOK", 8)
    run_as = pcjax.Run(trials=20, max_steps=10, precision_target=1e-4)
    study = spatial.Study(cup, spatial.Sphere(0.01), still((0, 0, 1)), run=run_as)
    if compared:
        other = replace(study, body=spatial.Sphere(0.011))
        found = pcjax.compare({"one": study, "other": other}).evaluations["one"]
    else:
        found = pcjax.evaluate_study(study)
    assert asked == [20] * (2 if compared else 1)
    assert found.attrs["does_half_step_trials"] == 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('preset = "three-finger"', 'file = "none.xml"'), "there is no hand file"),
        (('root = "palm"', 'root = "plam"'), "root: there is no body plam in .*did you mean palm"),
        (("tip1 = 20.0", "tip7 = 20.0"), "posture: there is no joint tip7 in .*did you mean tip"),
        (("tip1 = 20.0", "tip1 = 120.0"), "posture: tip1 is 120 deg: its range in .* is -45 to 90"),
        (("tip1 = 20.0", "tip1 = 'x'"), "tip1 is 'x': it has to be a number"),
        (('root = "palm"', 'exclude = ["lid"]'), "exclude: there is no body or geom lid"),
        (("radius = 0.024", "radius = 0.05"), "does not fit at its start"),
        (("0.0, 0.0, 0.036", "0.0, 0.0, 0.5"), "is not inside of what the hand holds"),
        (("0.002, 0.002, 0.001", "-0.002, 0, 0"), r"line \d+: \[start\] spread .*-0.002"),
        (("0.002, 0.002, 0.001", "0.002, 0.002"), r"line \d+: \[start\] spread "),
        (
            ("tip1 = 20.0\ntip2 = 20.0\ntip3 = 20.0", "tip1 = 55\ntip2 = 55\ntip3 = 55"),
            "and geom .* overlap in this posture",
        ),
        (("rest = [1.0, 0.0, 0.0]", "rest = [0, 0, 0]"), "rest is a direction of no length"),
        (("rest = [1.0, 0.0, 0.0]", ""), "rest is missing"),
        (("amplitude_deg = 60.0", ""), "amplitude_deg is missing"),
        (('length = "m"', 'length = "mm"'), "a hand in three dimensions is in m"),
        (('kind = "sphere"', 'kind = "circle"'), "kind is 'circle'"),
        (('kind = "sphere"', 'kind = "mesh"\nfile = "none.stl"'), "there is no mesh file"),
        (("restitution = 0.1", "drag = 1.0"), "unknown key .contact. drag"),
        (("seed = 0", 'engine = "event"'), "is for hands in the plane"),
        (("seed = 0", 'direction = "both"'), "it is left through a hull"),
    ],
)
def test_bad_studies_are_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], change: tuple[str, str], said: str
):
    before, after = change
    text = example("mujoco").split("[sweep]")[0]
    assert before in text
    if 'kind = "mesh"' in after:
        text = text.replace("radius = 0.024,", "").replace("radius = 0.024 ", "# ")
    path = tmp_path / "study.toml"
    path.write_text(text.replace(before, after))
    code, out, err = done(capfd, "evaluate", path, "--trials", 2, "--max-steps", 10)
    assert code == 2
    assert out == ""
    (line,) = err.strip().splitlines()
    assert re.search(said, line), line


def test_files_that_mujoco_cannot_use_are_refused(tmp_path: Path, cup: spatial.Hand):
    bad = tmp_path / "bad.xml"
    for text, said in (
        ("<mujoco><worldbody><body/></worldbody>", "MuJoCo cannot read"),
        ('<mujoco><worldbody><body><geom size="-1"/></body></worldbody></mujoco>', "MuJoCo cannot"),
        ('<mujoco><asset><mesh file="no.stl"/></asset></mujoco>', "MuJoCo cannot read .*no.stl"),
    ):
        bad.write_text(text)
        with pytest.raises(ValueError, match=said) as caught:
            spatial.Hand(bad, cup.start)
        assert "\n" not in str(caught.value)
    bad.write_text(CUP.replace('type="box"', 'type="box" contype="0" conaffinity="0"'))
    with pytest.raises(ValueError, match=r"no geom of cup .* collides"):
        frozen(spatial.Hand(bad, cup.start, root="cup"))
    parts = ["bottom", "east", "west", "north", "south", "lid"]
    with pytest.raises(ValueError, match=r"no geom of cup .* is left: exclude takes out all 6 "):
        frozen(spatial.Hand(cup.file, cup.start, root="cup", exclude=parts))
    with pytest.raises(ValueError, match=r"geom floor is a plane: .*exclude it"):
        frozen(spatial.Hand(cup.file, cup.start))


def test_a_sweep_is_resumed_with_the_same_bits(tmp_path: Path):
    text = example("mujoco").replace("trials = 100", "trials = 4").replace("60_000", "2_000")
    path = tmp_path / "study.toml"
    path.write_text(text)
    study = pcjax.load_study(path)
    whole = pcjax.run_sweep(study, tmp_path / "whole.nc", keep_trials=True)
    assert whole.escape_step.shape == (3, 2, 1, 4)
    scenario = study.having({"posture.tip1": 15.0, "radius": 0.022}).scenarios()["does"]
    engine = choose_engine("auto", None, scenario)
    alone = run([scenario], trials=4, max_steps=2000, seed=0, engine=engine)
    assert whole.escape_step.values[1, 0, 0].tolist() == alone.steps[0].tolist()


def test_the_command_evaluates_the_example(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    code, *_ = done(capfd, "study", tmp_path / "hand.toml", "--example", "mujoco")
    assert code == 0
    code, out, _ = done(
        capfd, "evaluate", tmp_path / "hand.toml", "--trials", 4, "--max-steps", 2000, "--json"
    )
    assert code == 0
    told = json.loads(out)
    assert told["engine"] == "mujoco"
    assert told["status"]["does"]["invalid"] == 0


@pytest.mark.parametrize("direction", ["does", "eoen"])
def test_a_hand_of_the_plane_is_the_same_in_three_dimensions(tmp_path: Path, direction: str):
    # The same draws: nearly every trial ends within .1 s of the event engine's.
    hand = pcjax.box_hand(math.radians(30), gap_width=300.0, thickness=10.0)
    both = flat(hand, 25.0, direction, tmp_path)
    plane, space, wrong = compared(both, 40, 40.0, 0.008)
    assert wrong == 0
    assert np.mean(np.abs(plane - space) < 0.1) > 0.85
    assert np.corrcoef(plane, space)[0, 1] > 0.9
    assert (plane < 40).sum() >= 3


def test_without_mujoco_one_line_says_how_to_get_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "study.toml"
    path.write_text(example("mujoco").split("[sweep]")[0])
    monkeypatch.setitem(sys.modules, "mujoco", None)
    _read.cache_clear()  # the hand was read before
    code, _, err = done(capfd, "evaluate", path)
    assert code == 2
    assert "a hand in three dimensions needs MuJoCo" in err
    assert "pip install 'pcjax[mujoco]'" in err
    assert len(err.strip().splitlines()) == 1
