"""Films: what they show is what `evaluate` counts, and it is where the model says it is."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import jax
import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

import pcjax
from pcjax.compiling import compiled_quickly
from pcjax.model.hand import points_of
from pcjax.physics.state import PASSED
from pcjax.simulate.draws import period_draws, trial_key
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.replay import Recording, pick_trial, record
from pcjax.view.animation import _Film, animate
from pcjax.view.scene import plot_scenes

pytestmark = pytest.mark.usefixtures("quick_programs")

OWN = pcjax.HandDesign(
    400.0, ((350.0, 120.0, 80.0), (300.0, 100.0, 60.0)), ((1.4, 1.66, 1.3), (1.48, 1.66, 1.05))
)
ARMS = pcjax.two_joint_hand(math.radians(65), math.radians(90))
CONDITIONS = {
    "wrist, circle": (pcjax.box_hand(), pcjax.Circle(25.0), pcjax.WristTilt(), 100_000, 0.04),
    "own hand": (OWN, pcjax.Circle(20.0), pcjax.WristTilt(), 100_000, 0.04),
    "arm, circle": (ARMS, pcjax.Circle(50.0), pcjax.PlanarArm(), 100_000, 0.02),
    "arm, stick": (ARMS, pcjax.Stick(50.0, 0.5), pcjax.PlanarArm(), 40_000, 0.02),
}
FEW = 12


def recordings(name: str) -> tuple[list[Recording], pcjax.Evaluation]:
    hand, body, drive, max_steps, dt = CONDITIONS[name]
    run = {"seed": 3, "max_steps": max_steps, "dt": dt}
    scenario = pcjax.does(hand, body, drive)
    counted = pcjax.evaluate(
        hand, body, drive=drive, direction="does", engine="stepping", trials=FEW, **run
    )
    return [record(scenario, trial=trial, **run) for trial in range(FEW)], counted


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_recorded_trial_ends_as_evaluate_counts_it(name: str) -> None:
    recorded, counted = recordings(name)
    data = counted.dataset.sel(direction="does")
    assert [one.status for one in recorded] == data.status.values.tolist()
    # Two compiled programs may round the moment within the last step differently.
    assert [one.escape_step for one in recorded] == pytest.approx(
        data.escape_step.values.tolist(), abs=1
    )
    assert PASSED in data.status
    for one in recorded:
        inside = one.at(np.array([0.0, one.seconds / 2]))
        ends = one.at(np.array([one.seconds]))
        (a, b), along = one.goal, one.goal[1] - one.goal[0]
        beyond = [
            (along[0] * (p[1] - a[1]) - along[1] * (p[0] - a[0])) / math.hypot(*along)
            for p in (*inside.position, *ends.position)
        ]
        assert max(beyond[:2]) < 0
        if one.status == PASSED:
            # The film's last picture has the centre on the goal line.
            assert beyond[2] == pytest.approx(0, abs=0.01)
            assert 0 < along @ (ends.position[0] - a) < along @ (b - a)
        else:
            assert one.seconds == pytest.approx(one.escape_step * 0.001)


def test_a_recording_passes_through_the_states_of_the_trajectory() -> None:
    scenario = pcjax.does(ARMS, pcjax.Stick(50.0), pcjax.PlanarArm())
    one = record(scenario, seed=1, trial=2, max_steps=40_000, dt=0.02)
    path = compiled_quickly(
        lambda scenario: pcjax.trajectory(scenario, seed=1, trial=2, periods=4, dt=0.02)
    )(scenario)
    count = len(one.times) - 1
    frames = one.at(one.times[1:])
    assert frames.angle is not None
    np.testing.assert_allclose(frames.position[:, 0], path.position.x[:count], atol=1e-2)
    turned = frames.angle - np.asarray(path.angle)[:count]
    np.testing.assert_allclose(np.sin(turned), 0, atol=1e-3)
    np.testing.assert_allclose(np.cos(turned), 1, atol=1e-3)


def test_the_pull_that_is_shown_is_the_models() -> None:
    drive = pcjax.WristTilt()
    scenario = pcjax.does(OWN, pcjax.Circle(20.0), drive)
    one = record(scenario, seed=0, trial=5, max_steps=100_000, dt=0.04)
    frames = one.at(np.array([0.0, 5.0, 10.0, 10.5, 15.0]))
    assert frames.tilt is not None
    t1, t2 = frames.tilt.T
    # (1)
    np.testing.assert_allclose(frames.pull[:, 0], 9.8 * np.sin(t1), atol=1e-5)
    np.testing.assert_allclose(frames.pull[:, 1], -9.8 * np.cos(t1) * np.sin(t2), atol=1e-5)
    assert frames.tilt[0] == pytest.approx([0, 0])
    targets = [
        math.pi / 6 * (2 * np.asarray(period_draws(trial_key(0, 5), k, 2)) - 1) for k in (0, 1)
    ]
    expected = [targets[0], targets[0], (targets[0] + targets[1]) / 2, targets[1]]
    np.testing.assert_allclose(frames.tilt[1:], expected, atol=1e-6)
    # The hand stays put.
    np.testing.assert_array_equal(frames.in_world(points_of(OWN), 3), points_of(OWN))


def test_the_arms_hand_is_carried_as_the_drive_says() -> None:
    drive = pcjax.PlanarArm()
    scenario = pcjax.does(ARMS, pcjax.Circle(50.0), drive)
    one = record(scenario, seed=0, trial=0, max_steps=100_000, dt=0.02)
    frames = one.at(np.array([0.0, one.seconds]))
    # At rest the first link hangs, the second is turned by 45 degrees, the third has no length.
    reach = 200 * math.sqrt(0.5)
    expected = [[0, 0], [0, -200], [reach, -200 - reach], [reach, -200 - reach]]
    np.testing.assert_allclose(frames.joints[0], expected, atol=1e-3)
    np.testing.assert_allclose(frames.pull, [[0, -9.8]] * 2, atol=1e-5)
    lengths = np.linalg.norm(np.diff(frames.joints[1], axis=0), axis=1)
    np.testing.assert_allclose(lengths, [200, 200, 0], atol=1e-3)
    # The palm's middle is the arm's end, and the hand keeps its shape.
    world = frames.in_world(points_of(ARMS), 1)
    np.testing.assert_allclose((world[2] + world[3]) / 2, frames.joints[1, -1], atol=1e-9)
    sides = [np.linalg.norm(np.diff(line, axis=0), axis=1) for line in (world, points_of(ARMS))]
    np.testing.assert_allclose(*sides)


def test_the_trial_that_is_picked_is_the_one_asked_for() -> None:
    scenario = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
    run = {"seed": 3, "max_steps": 100_000, "dt": 0.04}
    counted = pcjax.evaluate(direction="does", engine="stepping", trials=40, **run).dataset.isel(
        direction=0
    )
    steps, status = counted.escape_step.values, counted.status.values
    picked = {
        pick: pick_trial(scenario, pick, trials=40, **run)
        for pick in ("escaped", "stuck", "longest")
    }
    assert picked["escaped"] == np.flatnonzero(status == PASSED)[0]
    assert picked["stuck"] == np.flatnonzero(status == LIMIT)[0]
    assert steps[picked["longest"]] == steps[status == PASSED].max()
    with pytest.raises(ValueError, match="none of the first 40 trials escaped within 10 steps"):
        pick_trial(scenario, "escaped", seed=3, max_steps=10, trials=40, dt=0.001)
    caged = pcjax.does(pcjax.box_hand(0.0, gap_width=60.0), pcjax.Circle(28.0))
    assert pick_trial(caged, "stuck", seed=3, max_steps=10_000, trials=4, dt=0.04) == 0


@pytest.mark.parametrize(
    ("drive", "body"),
    [(pcjax.WristTilt(), pcjax.Stick(30.0)), (pcjax.PlanarArm(), pcjax.Circle(20.0))],
    ids=["wrist, stick", "arm, circle"],
)
def test_a_gif_has_the_frames_and_the_time_asked_for(
    tmp_path: Path, drive: pcjax.WristTilt | pcjax.PlanarArm, body: pcjax.Circle | pcjax.Stick
) -> None:
    path = tmp_path / "film.gif"
    one = animate(
        pcjax.does(OWN, body, drive), path, trial=1, max_steps=3000, seconds=2.0, speed=4.0, fps=10
    )
    assert one.status == LIMIT
    with Image.open(path) as film:
        assert film.n_frames == 6
        lasts, pictures = [], []
        for k in range(6):
            film.seek(k)
            lasts.append(film.info["duration"])
            pictures.append(np.asarray(film.convert("L"), float))
    # The last picture stays for one and a half seconds more.
    assert lasts == [100] * 5 + [1600]
    assert all(np.ptp(picture) > 200 for picture in pictures)
    assert all(np.any(a != b) for a, b in pairwise(pictures))


def test_html_plays_by_itself(tmp_path: Path) -> None:
    path = tmp_path / "film.html"
    scenario = pcjax.eoen(OWN, pcjax.Circle(20.0))
    animate(scenario, path, trial=0, max_steps=1000, dt=0.02, seconds=0.4, speed=2.0, fps=10)
    text = path.read_text()
    assert text.count("data:image/png;base64") == 3 + 15
    assert [entry.name for entry in tmp_path.iterdir()] == ["film.html"]


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="no ffmpeg")
def test_mp4(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    scenario = pcjax.does(OWN, pcjax.Circle(20.0))
    animate(scenario, path, trial=0, max_steps=1000, dt=0.02, seconds=0.4, speed=2.0, fps=10)
    assert b"ftyp" in path.read_bytes()[:16]


@pytest.mark.parametrize(
    ("name", "changed", "words"),
    [
        ("film.avi", {}, r"\.gif, \.mp4, \.html"),
        ("film", {}, "ending"),
        ("film.gif", {"pick": "best"}, "'best'.*escaped, stuck, longest"),
        ("film.gif", {"trial": -1}, "trial"),
        ("film.gif", {"seed": -1, "trial": 0}, "seed"),
        ("film.gif", {"seconds": 0.0}, "seconds"),
        ("film.gif", {"seconds": math.nan}, "seconds"),
        ("film.gif", {"speed": -1.0}, "speed"),
        ("film.gif", {"fps": 100}, "fps"),
        ("film.gif", {"seconds": 1e4, "speed": 0.1}, "frames"),
        ("film.gif", {"seconds": 0.01, "speed": 100.0}, "frames"),
        ("film.gif", {"max_steps": 0, "trial": 0}, "max_steps"),
        ("film.gif", {"dt": 100.0}, "dt"),
    ],
)
def test_what_cannot_be_filmed_is_refused(
    tmp_path: Path, name: str, changed: dict, words: str
) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        animate(pcjax.does(OWN, pcjax.Circle(20.0)), tmp_path / name, **changed)
    assert len(str(caught.value).splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_ffmpeg_mp4_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ValueError, match="ffmpeg"):
        animate(pcjax.does(OWN, pcjax.Circle(20.0)), tmp_path / "film.mp4")


@pytest.mark.parametrize("drive", [pcjax.WristTilt(), pcjax.PlanarArm()], ids=["wrist", "arm"])
def test_scenes_show_the_object_where_it_is(drive: pcjax.WristTilt | pcjax.PlanarArm) -> None:
    scenario = pcjax.does(OWN, pcjax.Circle(20.0), drive)
    figure = plot_scenes(scenario, [0.0, 3.0], dt=0.02)
    one = record(scenario, seed=0, trial=0, max_steps=3000, dt=0.02)
    frames = one.at(np.array([0.0, 3.0]))
    for k, axis in enumerate(figure.axes):
        (disc,) = axis.patches
        np.testing.assert_allclose(
            disc.get_center(), frames.in_world(frames.position[k : k + 1], k)[0], atol=1e-6
        )


def test_the_line_of_a_hand_is_its_limbs(x64: None) -> None:
    line = points_of(OWN)
    limbs = jax.device_get(OWN.limbs())
    palm, first, last = limbs[0], limbs[1], limbs[-1]
    assert len(line) == len(limbs) + 1
    np.testing.assert_allclose(line[3], [palm.start.x, palm.start.y], atol=1e-12)
    np.testing.assert_allclose(line[4], [palm.end.x, palm.end.y], atol=1e-12)
    np.testing.assert_allclose(line[2], [first.end.x, first.end.y], atol=1e-12)
    np.testing.assert_allclose(line[-1], [last.end.x, last.end.y], atol=1e-12)


def test_a_film_shows_path_contacts_and_scale() -> None:
    scenario = pcjax.does(OWN, pcjax.Circle(20.0))
    one = record(scenario, seed=0, trial=1, max_steps=20_000, dt=0.02)
    film = _Film(one, np.linspace(0.0, one.seconds, 11), 4.0, "DoEs", "mm")
    counts = []
    for k in (0, 5, 10):
        film.draw(k)
        path, touched = film._main.lines[:2]
        np.testing.assert_allclose(
            path.get_xydata()[-1], one.path(np.array([one.seconds / 10 * k]))[0]
        )
        counts.append(len(touched.get_xdata()))
    assert 0 == counts[0] <= counts[1] < counts[2]
    # The marks are on the hand: here within its thinnest line.
    ends = zip(points_of(OWN)[:-1], points_of(OWN)[1:], strict=True)
    nearest = np.min([_far(touched.get_xydata(), a, b) for a, b in ends], axis=0)
    assert nearest.max() < 0.1
    words = [text.get_text() for text in film.figure.axes[-1].texts]
    assert words == ["path", "touched", "100 mm"]


def _far(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How far points are from the line from a to b."""
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - a - share[:, None] * (b - a), axis=1)
