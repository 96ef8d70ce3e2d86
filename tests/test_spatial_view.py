"""Hands in three dimensions to be seen: films of trials that are counted, pictures, the page."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import pcjax
from pcjax import spatial
from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.physics.state import PASSED
from pcjax.simulate.backends.recording import record_spatial
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.replay import pick_trial
from tests.browser import Visitor, browser, page_served
from tests.test_spatial import done

pytest.importorskip("mujoco.batch")

STUDY = """
[hand]
{hand}
root = "palm"
fingertips = ["distal1", "distal2", "distal3"]

[hand.posture]
tip1 = 20.0
tip2 = 20.0
tip3 = 20.0

[start]
centre = [0.0, 0.0, 0.036]
spread = [0.002, 0.002, 0.001]
orientation = "random"

[escape]
kind = "plane"
point = [0, 0, 0.06]
normal = [0, 0, 1]

[body]
kind = "box"
side_x = 0.03
side_y = 0.02
side_z = 0.02

[drive]
amplitude_deg = 60.0
rest = [0.0, 0.0, -1.0]

[run]
trials = 6
max_steps = 400
seed = 4
"""
"""Escaping and entering, of which some trials do and some do not."""

DRESSED = """
<mujoco>
  <asset><mesh name="shell" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="forearm" pos="0 0 1">
      <geom name="arm" type="capsule" size=".02 .1"/>
      <body name="palm" pos="0 0 .2">
        <geom name="skin" type="mesh" mesh="shell" contype="0" conaffinity="0" rgba="1 0 0 1"/>
        <geom name="flesh" type="box" size=".05 .05 .01"/>
        <body name="tip"><geom name="tip" type="sphere" size=".01" pos="0 0 .05"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""A palm that is dressed in a mesh, a bare fingertip, and an arm that is no part of the hand."""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> pcjax.Study:
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(STUDY.format(hand='preset = "three-finger"'))
    return pcjax.load_study(path)


@pytest.fixture
def rendering() -> None:
    """Skips where nothing can be rendered."""
    from pcjax.view.rendering import check_rendering

    try:
        check_rendering()
    except ValueError as error:
        pytest.skip(str(error))


def scenario_of(study: pcjax.Study, direction: str = "does") -> SpatialScenario:
    scenario = study.scenarios()[direction]
    assert isinstance(scenario, SpatialScenario)
    return scenario


def step_of(scenario: SpatialScenario) -> float:
    return choose_engine("auto", None, scenario).step_taken(scenario.drive.period)


# ------------------------------------------------------------------------------------- the trials


def test_the_trial_of_a_film_is_the_one_that_is_counted(study: pcjax.Study) -> None:
    counted = pcjax.evaluate_study(study)
    seen = set()
    for direction in counted.directions:
        scenario = scenario_of(study, direction)
        planes = scenario.inside()
        steps, status = counted.ends(direction)
        for trial in range(study.trials):
            one = record_spatial(
                scenario,
                seed=study.run.seed,
                trial=trial,
                max_steps=study.max_steps,
                dt=step_of(scenario),
            )
            assert (one.escape_step, one.status) == (steps[trial], status[trial])
            key = trial_key(study.run.seed, trial)
            draws = np.asarray(start_draws(key, scenario.draws_for_start), float)
            start = scenario.hand.start.places(draws[None])[0]
            np.testing.assert_array_equal(one.at(np.zeros(1))[0, :3], start[:3])
            end = one.path(np.array([one.seconds]))[0]
            beyond = (planes[:, :3] @ end + planes[:, 3]).max()
            if one.status == PASSED:  # the last picture has the centre where it escapes
                assert beyond == pytest.approx(0.0, abs=1e-9)
            else:
                assert beyond < 0
            seen.add(one.status)
    assert seen == {PASSED, LIMIT}


def test_the_trial_that_is_picked_is_the_one_asked_for(study: pcjax.Study) -> None:
    scenario = scenario_of(study)
    many = replace(study, run=replace(study.run, trials=24, direction="does"))
    steps, status = pcjax.evaluate_study(many).ends("does")
    run = {"seed": study.run.seed, "max_steps": study.max_steps, "trials": 24, "at_once": 5}
    engine = choose_engine("auto", None, scenario)
    picked = {
        p: pick_trial(scenario, p, engine=engine, **run) for p in ("escaped", "stuck", "longest")
    }
    assert picked["escaped"] == np.flatnonzero(status == PASSED)[0]
    assert picked["stuck"] == np.flatnonzero(status == LIMIT)[0]
    assert steps[picked["longest"]] == steps[status == PASSED].max()


def test_the_tilt_that_is_shown_is_the_trials(study: pcjax.Study) -> None:
    scenario = scenario_of(study.having({"gravity": 1e-6}))  # it stays for a while
    one = record_spatial(scenario, seed=4, trial=2, max_steps=10_600, dt=step_of(scenario))
    assert one.status == LIMIT
    targets = [
        math.pi / 3 * (2 * np.asarray(period_draws(trial_key(4, 2), k, 2), float) - 1)
        for k in (0, 1)
    ]
    expected = [0 * targets[0], targets[0], targets[0], 0.5 * (targets[0] + targets[1])]
    found = one.angles(np.array([0.0, 1.0, 10.0, 10.5]))
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("direction", ["does", "eoen"])
def test_a_hand_stands_in_the_world_so_that_gravity_points_down(
    study: pcjax.Study, direction: str
) -> None:
    scenario = scenario_of(study, direction)
    for angles in np.random.default_rng(0).uniform(-2, 2, (20, 2)):
        turned = scenario.attitude(angles)
        pull = scenario.pull(angles[None])[0]
        np.testing.assert_allclose(turned @ pull, [0, 0, -9.8], atol=1e-9)
        np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turned) == pytest.approx(1.0)  # no mirror


# ----------------------------------------------------------------------------------- the pictures


def test_a_hand_is_drawn_as_its_file_has_it(tmp_path: Path) -> None:
    from pcjax.view.rendering import parts_met, parts_seen

    path = tmp_path / "dressed.xml"
    path.write_text(DRESSED)
    start = spatial.StartBox((0.0, 0.0, 0.03), (0.0, 0.0, 0.0))
    hand = spatial.Hand(path, start, root="forearm", exclude=["arm"])
    seen = parts_seen(hand)
    assert [part.solid.type for part in seen] == ["capsule", "mesh", "sphere"]
    assert [part.met for part in seen] == [False, False, True]
    assert seen[0].colour[3] < 0.5  # no part of the hand
    assert seen[1].colour == (1.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(seen[2].place, [0, 0, 0.25], atol=1e-12)
    # The mesh's own frame is where MuJoCo has put it: its corners are those of the file.
    corners = seen[1].solid.vertices @ seen[1].axes.T + seen[1].place
    for corner in ([0, 0, 0.2], [0.1, 0, 0.2], [0, 0.1, 0.2], [0, 0, 0.3]):
        assert np.linalg.norm(corners - corner, axis=1).min() < 1e-6
    met = parts_met(spatial.Scenario(hand, spatial.Sphere(0.01), spatial.Tilt(1.0, (0, 0, -1))))
    assert [part.solid.type for part in met] == ["box", "sphere"]


def orange(pixels: np.ndarray) -> np.ndarray:
    """Where the object is seen: row and column of each of its pixels."""
    red, green, blue = pixels.astype(int).transpose(2, 0, 1)
    return np.argwhere((red > 2 * blue + 40) & (red > green + 30))


@pytest.mark.usefixtures("rendering")
@pytest.mark.parametrize("direction", ["does", "eoen"])
def test_the_object_is_seen_where_it_is(study: pcjax.Study, direction: str) -> None:
    from pcjax.view.rendering import Stage

    scenario = scenario_of(study, direction)
    angles = np.array([0.4, -0.3])
    turned = scenario.attitude(angles)
    state = scenario.hand.start.places(np.full((1, 6), 0.5))[0]
    with Stage(scenario, []) as stage:  # without the hand
        first = orange(stage.picture(state, angles)).mean(axis=0)
        up, raised = turned.T @ [0.0, 0.0, 0.02], state.copy()
        raised[:3] += up
        higher = orange(stage.picture(raised, angles)).mean(axis=0)
        # Row by row down the page; the camera does not turn, so it stays in its column.
        assert higher[0] < first[0] - 20
        assert higher[1] == pytest.approx(first[1], abs=6)
        small = len(orange(stage.picture(state, angles)))
        way = math.radians(stage.azimuth)
        nearer, towards = state.copy(), np.array([-math.cos(way), -math.sin(way), 0.0])
        nearer[:3] += turned.T @ (0.05 * towards)
        assert len(orange(stage.picture(nearer, angles))) > 1.1 * small
    with Stage(scenario) as stage:  # on the side from which it is seen best
        best = len(orange(stage.picture()))
        stage.look_from(stage.azimuth + 180)
        assert best > len(orange(stage.picture()))


@pytest.mark.usefixtures("rendering")
def test_what_the_commands_show(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    hand = tmp_path / "hand.xml"
    hand.write_text(spatial.PRESETS["three-finger"].read_text())
    path, film = tmp_path / "own.toml", tmp_path / "film.gif"
    path.write_text(STUDY.format(hand='file = "hand.xml"'))
    words = ("--seconds", 0.4, "--speed", 1, "--fps", 10, "--plot", film)
    code, out, _ = done(capfd, "animate", path, "--pick", "stuck", *words)
    assert code == 0
    assert "still inside at the limit, step 400" in out
    with Image.open(film) as pictures:
        assert pictures.n_frames == 5
        first = np.asarray(pictures.convert("RGB"))
        pictures.seek(4)
        assert np.any(first != np.asarray(pictures.convert("RGB")))
    code, out, _ = done(capfd, "inspect", path, "--plot", tmp_path / "seen.png")
    assert code == 0
    for words in ("7 geoms collide", "the thinnest is geom distal1, 14 mm", "dt = 0.002 s"):
        assert words in " ".join(out.split())
    kept, picture = tmp_path / "kept.nc", tmp_path / "kept.png"
    code, told, _ = done(capfd, "evaluate", path, "--out", kept, "--plot", picture)
    assert code == 0
    whole = picture.stat().st_size
    code, again, _ = done(capfd, "show", kept)
    assert (code, again) == (0, told)
    assert "<img" in pcjax.Evaluation.load(kept)._repr_html_()
    other = tmp_path / "other.toml"
    other.write_text(path.read_text().replace("tip1 = 20.0", "tip1 = 10.0"))
    code, out, _ = done(capfd, "compare", path, other, "--plot", tmp_path / "both.png")
    assert code == 0
    assert "own" in out
    # Of a hand that is another one now, or gone, there is the curve.
    hand.write_text(hand.read_text().replace("0.055", "0.056"))
    code, _, err = done(capfd, "plot", kept, "--plot", picture)
    assert (code, len(err.splitlines())) == (0, 1)
    assert "the hand is not drawn" in err
    assert "is not as it was" in err
    assert picture.stat().st_size < 0.8 * whole
    hand.unlink()
    code, _, err = done(capfd, "plot", kept, "--plot", picture)
    assert (code, len(err.splitlines())) == (0, 1)
    assert "there is no hand file" in err


@pytest.mark.usefixtures("rendering")
def test_postures_are_drawn_side_by_side(study: pcjax.Study) -> None:
    from pcjax.view.spatial import plot_postures

    figure = plot_postures({"before": study, "after": study.having({"posture.tip1": 0.0})})
    one, other = (axis.images[0].get_array() for axis in figure.axes)
    assert np.any(one != other)
    assert [axis.get_title() for axis in figure.axes] == ["before", "after"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("export",), "a drawing for CAD is for hands in the plane"),
        (("plot", "--occupancy", "--plot", "x.png"), "is drawn of hands in the plane"),
        (("energy",), "escape energy is for hands in the plane"),
        (("animate", "--plot", "x.gif"), "apt-get install libegl1"),
        (("evaluate", "--plot", "x.png"), "apt-get install libegl1"),
        (("inspect", "--plot", "x.png"), "apt-get install libegl1"),
        (("optimize", "--plot", "x.png", "--trials", "4"), "apt-get install libegl1"),
        (("optimize", "--plot", "x.png", "--front", "--trials", "4"), "apt-get install libegl1"),
        (("view", "--no-browser"), "apt-get install libegl1"),
    ],
    ids=lambda part: part[0] if isinstance(part, tuple) else "",
)
def test_what_cannot_be_drawn_is_refused(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    told: str,
) -> None:
    if words[0] == "view":
        pytest.importorskip("nicegui")
    monkeypatch.setenv("MUJOCO_GL", "off")
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text(STUDY.format(hand='preset = "three-finger"'))
    code, _, err = done(capfd, words[0], "own.toml", *words[1:])
    assert (code, len(err.splitlines())) == (2, 1)
    assert told in err
    assert [one.name for one in tmp_path.iterdir()] == ["own.toml"]


# ---------------------------------------------------------------------------------------- the page


class Guest(Visitor):
    """Somebody at the page of a hand in three dimensions."""

    def refined(self) -> str:
        """Waits until the design has had all of its trials; what is known of it."""
        self.page.wait_for_timeout(300)
        self.page.locator(".numbers:not(.stale)").wait_for()
        self.until("about", "200 trials")
        return self.told("score")


@pytest.fixture
def chromium() -> Iterator[Any]:
    with browser() as one:
        yield one


@pytest.mark.usefixtures("rendering")
def test_a_trial_is_played_and_a_joint_is_turned(tmp_path: Path, chromium: Any) -> None:
    pytest.importorskip("nicegui")
    (tmp_path / "own.toml").write_text(STUDY.format(hand='preset = "three-finger"'))
    with page_served(tmp_path, "own.toml") as served:
        me = Guest(chromium, served.address)
        study = pcjax.load_study(tmp_path / "own.toml")
        known = pcjax.evaluate_study(replace(study, run=replace(study.run, trials=200)))
        value = f"{known.score()['index1'].value:.3f}"
        assert me.told("score").startswith(f"score {value}")
        steps, status = known.ends("does")
        me.at("trial").fill("3")
        me.page.keyboard.press("Enter")
        me.at("play").click()
        ending = {PASSED: "escaped", LIMIT: "still held"}[int(status[3])]
        lasts = f"{round(0.001 * steps[3], 1):.1f}"
        told = me.until("clock", f"{lasts} of {lasts} s, {ending}")
        assert told.startswith("trial 3:")
        assert str(me.at("picture").get_attribute("src")).startswith("data:image/jpeg")
        before = me.told("score")
        me.at("number-posture.tip1").fill("-30")
        me.page.keyboard.press("Enter")
        assert me.refined() != before
        assert me.told("clock") == ""  # the film was of another hand
        me.at("undo").click()
        assert me.refined() == before
        me.at("number-posture.tip1").fill("170")
        me.page.keyboard.press("Enter")
        me.notified("posture.tip1: posture: tip1 is 170 deg")
        me.well()
