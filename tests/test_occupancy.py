"""Where objects stay: as replayed paths have it, in the hand, in the trials that evaluate runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg

import pcjax
from pcjax.cli import main
from pcjax.geometry import Vec
from pcjax.physics.state import PASSED
from pcjax.quality.occupancy import Occupancy, _Tally
from pcjax.simulate.engine import Engine
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.replay import Recording, record
from pcjax.simulate.track import Track
from pcjax.study.read import example

pytestmark = pytest.mark.usefixtures("quick_programs")

BOX = pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))
ARM = pcjax.does(
    pcjax.two_joint_hand(math.radians(65), math.radians(90)), pcjax.Circle(50.0), pcjax.PlanarArm()
)
STEPS = 60_000
INTERVAL = 0.2
"""Seconds between two looks where a period has 10."""


def replayed(scenario: pcjax.Scenario, trials: int, dt: float) -> list[Recording]:
    return [
        record(scenario, seed=3, trial=trial, max_steps=STEPS, dt=dt) for trial in range(trials)
    ]


def looks(one: Recording) -> Float[np.ndarray, " looks"]:
    times = (np.arange(STEPS) + 0.5) * INTERVAL
    return times[times < one.seconds]


def counted(found: Occupancy, points: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "r c"]:
    """Looks by cell of the same grid."""
    x0, x1, y0, y1 = found.extent
    bins = found.seconds.shape[::-1]
    counts = np.histogram2d(*points.T, bins=bins, range=((x0, x1), (y0, y1)))[0]
    return counts.T


@pytest.mark.parametrize(("scenario", "dt"), [(BOX, 0.04), (ARM, 0.02)], ids=["wrist", "arm"])
def test_stepped_trials_are_where_their_replayed_paths_are(
    scenario: pcjax.Scenario, dt: float
) -> None:
    trials = 12
    found = pcjax.occupancy(
        scenario, trials=trials, max_steps=STEPS, seed=3, engine="stepping", dt=dt, cells=21
    )
    paths = replayed(scenario, trials, dt)
    places = [one.path(looks(one)) for one in paths]
    slow = sum(counted(found, place) for place in places) * INTERVAL
    assert found.seconds.sum() == pytest.approx(slow.sum(), abs=INTERVAL)
    # Two programs that round differently may find an object on either side of a cell's edge.
    assert np.abs(found.seconds - slow).sum() < 0.01 * slow.sum()
    passed = [number for number, one in enumerate(paths) if one.status == PASSED]
    assert found.escaped.tolist() == passed != []
    for number, origin, rested in zip(found.escaped, found.origins, found.rested, strict=True):
        expected, has_rested = last_rest(paths[number], float(scenario.contact_radius))
        assert rested == has_rested
        np.testing.assert_allclose(origin, expected, atol=0.01)


def last_rest(one: Recording, radius: float) -> tuple[np.ndarray, bool]:
    """Look by look."""
    place, rested, run = one.path(np.zeros(1))[0], False, 0
    for time in looks(one):
        before = max(time - INTERVAL, math.floor(time / 10.0) * 10.0)
        there, was = one.path(np.array([time, before]))
        speed = math.dist(there, was) / (time - before)
        run = run + 1 if speed <= 0.01 * radius else 0  # in 1 s
        if run >= 5:
            place, rested = there, True
    return place, rested


def coarse(found: np.ndarray) -> np.ndarray:
    """Shares on a grid of 4 by 4."""
    rows, columns = found.shape
    blocks = found.reshape(4, rows // 4, 4, columns // 4).sum(axis=(1, 3))
    return blocks / found.sum()


def test_leaps_are_where_replayed_paths_are() -> None:
    """32 trials of 60 s, 16 shares, each against its standard error over trials. The trials are the
    same, so they differ by less: |z| > 4 in one of them has a chance below 16 * 6e-5 = 0.1 %."""
    trials = 32
    found = pcjax.occupancy(BOX, trials=trials, max_steps=STEPS, seed=3, cells=40)
    paths = replayed(BOX, trials, 0.04)
    times = np.array([len(looks(one)) for one in paths])
    each = np.stack([counted(found, one.path(looks(one))) for one in paths])
    blocks = each.reshape(trials, 4, 10, 4, 10).sum(axis=(2, 4))
    share = blocks.sum(axis=0) / times.sum()
    # Of a ratio of sums, to first order.
    spread = (blocks - share * times[:, None, None]).std(axis=0, ddof=1)
    error = spread * math.sqrt(trials) / times.sum()
    z = (coarse(found.seconds) - share) / np.maximum(error, 1e-3)
    assert np.abs(z).max() < 4


def test_leaps_in_a_hand_that_is_carried_are_where_steps_are() -> None:
    """In the first 8 s, before small differences have grown: 32 trials at two steps each."""
    settings: dict[str, Any] = {"trials": 32, "max_steps": 8000, "seed": 3, "cells": 12}
    leaping = pcjax.occupancy(ARM, engine="convex", **settings)
    stepping = pcjax.occupancy(ARM, engine="stepping", dt=0.02, **settings)
    assert np.abs(leaping.share - stepping.share).sum() / 2 < 0.02
    assert leaping.seconds.sum() == pytest.approx(stepping.seconds.sum(), rel=0.01)


@pytest.mark.parametrize("make", [pcjax.does, pcjax.eoen])
def test_it_is_the_trials_of_evaluate_in_the_hand(make: Any) -> None:
    hand, body = pcjax.box_hand(), pcjax.Circle(25.0)
    found = pcjax.occupancy(make(hand, body), trials=64, max_steps=STEPS, seed=5)
    direction = make.__name__
    result = pcjax.evaluate(hand, body, trials=64, max_steps=STEPS, seed=5)
    data = result.dataset.sel(direction=direction)
    assert found.status == result.as_json()["status"][direction]
    assert found.escaped.tolist() == np.flatnonzero(data.status.values == PASSED).tolist()
    assert len(found.origins) == len(found.rested) == found.status["passed"] > 5
    assert found.share.sum() == pytest.approx(1)
    # A trial has a look more or less than its time has intervals, by half of one.
    lasted = data.escape_step.values * 0.001
    assert found.seconds.sum() == pytest.approx(lasted.sum(), abs=64 * INTERVAL / 2)

    x0, x1, y0, y1 = found.extent
    rows, columns = found.seconds.shape
    assert (x1 - x0) / columns == pytest.approx((y1 - y0) / rows)
    row, column = np.nonzero(found.seconds)
    x, y = x0 + (column + 0.5) * found.cell, y0 + (row + 0.5) * found.cell
    within = found.cell / math.sqrt(2) + 0.01
    with jax.enable_x64(True):
        simulated = jax.tree.map(float, found.scenario.hand)
        for limb in simulated.limbs():
            assert np.min(limb.distance(Vec(x, y))) > 25 - within
        assert np.max(simulated.goal().beyond(Vec(x, y))) < within


def test_a_symmetric_hand_is_used_alike_on_both_sides() -> None:
    """10 batches of 24 trials, 8 differences of mirrored shares, each against its standard error
    over batches: |t| > 6.6 (9 degrees of freedom) in one of them has a chance of 8 * 1e-4."""
    batches = [
        coarse(pcjax.occupancy(BOX, trials=24, first=24 * k, max_steps=STEPS, cells=40).seconds)
        for k in range(10)
    ]
    shares = np.stack(batches)
    left = (shares - shares[:, :, ::-1])[:, :, :2]
    t = left.mean(axis=0) / (left.std(axis=0, ddof=1) / math.sqrt(10))
    assert np.abs(t).max() < 6.6
    assert shares.min(axis=0).max() > 0.1, "where they stay is no matter of chance"


def test_parts_make_the_whole() -> None:
    settings: dict[str, Any] = {"max_steps": STEPS, "seed": 3}
    whole = pcjax.occupancy(BOX, trials=40, **settings)
    start = pcjax.occupancy(BOX, trials=24, **settings)
    rest = pcjax.occupancy(BOX, trials=16, first=24, **settings)
    joined = start.joined(rest)
    np.testing.assert_allclose(joined.seconds, whole.seconds)
    assert joined.status == whole.status
    assert joined.trials == 40
    np.testing.assert_array_equal(joined.escaped, whole.escaped)
    np.testing.assert_array_equal(joined.origins, whole.origins)
    np.testing.assert_array_equal(joined.rested, whole.rested)
    with pytest.raises(ValueError, match="different seed: 3 and 4"):
        whole.joined(pcjax.occupancy(BOX, trials=4, first=40, max_steps=STEPS, seed=4))
    with pytest.raises(ValueError, match="different grids"):
        whole.joined(pcjax.occupancy(BOX, trials=4, first=40, cells=7, **settings))
    with pytest.raises(ValueError, match="24 on do not follow on those up to number 39"):
        whole.joined(rest)


def test_a_rest_goes_on_from_call_to_call_and_a_turning_point_is_none() -> None:
    tally = _Tally(BOX, 2, 10, STEPS, 10)

    def call(times: list[float], xs: list[float], speeds: list[float]) -> None:
        """The same for both lanes, of which the second is idle."""
        time, x, speed = (np.array(row)[:, None].repeat(2, axis=1) for row in (times, xs, speeds))
        lanes = Lanes.idle(2, np.float32)._replace(trial=np.array([11, 10]))
        there, velocity = Vec(x, 0 * x + 100.0), Vec(speed, 0 * speed)
        track = Track(0 * time.astype(np.int32), time, there, velocity)
        tally.follow(lanes, track, np.array([True, False]))

    # Thrown up a slope of 1 / s^2, it turns at 2 s.
    call([0.0, 4.0], [0.0, 0.0], [2.0, -2.0])
    assert not tally.rested.any()
    np.testing.assert_allclose(tally.resting_place, [[0, 0], [0, 100]])
    assert tally.counts.sum() == 20
    # Still for 1 s, in two calls; then off.
    call([4.0, 4.6], [50.0, 50.0], [0.0, 0.0])
    assert not tally.rested.any()
    call([4.6, 5.0, 9.0], [50.0, 50.0, 90.0], [0.0, 0.0, 20.0])
    assert tally.rested.tolist() == [False, True]
    np.testing.assert_allclose(tally.resting_place[1], [50, 100])
    assert tally.counts.sum() == 45


class Mute(Engine):
    """An engine that does not say where its trials are."""

    noun = "an engine of no words"


def test_what_cannot_be_had_is_refused() -> None:
    with pytest.raises(ValueError, match="an engine of no words does not tell where its trials"):
        pcjax.occupancy(BOX, trials=4, engine=Mute())
    with pytest.raises(ValueError, match=r"no trial lasts for 0.1 s"):
        pcjax.occupancy(BOX, trials=4, max_steps=50)
    for wrong in ({"cells": 0}, {"trials": 0}, {"first": -1}, {"max_steps": 0}, {"seed": -1}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            pcjax.occupancy(BOX, **{"trials": 4, "max_steps": 1000, **wrong})


def test_a_full_cage_lets_nothing_out_and_can_be_drawn() -> None:
    caged = pcjax.does(pcjax.box_hand(0.0, gap_width=60.0), pcjax.Circle(28.0))
    found = pcjax.occupancy(caged, trials=8, max_steps=2000)
    assert found.status == {"passed": 0, "limit": 8, "invalid": 0}
    assert found.origins.shape == (0, 2)
    (legend,) = pcjax.plot_occupancy({"does": found}).legends
    assert [text.get_text() for text in legend.get_texts()] == ["goal line", "object, to scale"]


def test_the_picture_has_it_all() -> None:
    study = pcjax.Study(pcjax.box_hand(), pcjax.Circle(25.0), run=pcjax.Run(max_steps=STEPS))
    found = pcjax.occupancy_of_study(study, trials=64)
    assert list(found) == ["does", "eoen"]
    figure = pcjax.plot_occupancy(found, "mm")
    *panels, bar = figure.axes
    for panel, direction in zip(panels, found, strict=True):
        name = {"does": "DoEs", "eoen": "EoEn"}[direction]
        count = found[direction].status["passed"]
        assert panel.get_title() == f"{name}: {count} of 64 trials escaped"
        assert panel.get_xlabel() == "x [mm]"
        (x0, x1), (y0, y1) = panel.get_xlim(), panel.get_ylim()
        left, right, low, high = found[direction].extent
        assert x0 < left < right < x1
        assert y0 < low < high < y1
        assert list(panel.images[0].get_extent()) == [left, right, low, high]
    assert bar.get_ylabel() == "share of the time per area [1 / mm²]"
    (legend,) = figure.legends
    assert {text.get_text() for text in legend.get_texts()} == {
        "goal line",
        "object, to scale",
        "start of one that never rested",
        "last rest before an escape",
    }
    # Nothing is cut.
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for part in (*figure.axes, legend):
        box = part.get_tightbbox(canvas.get_renderer())
        assert box is not None
        assert min(box.x0, box.y0) >= 0
        assert box.x1 <= figure.bbox.width
        assert box.y1 <= figure.bbox.height


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(example() + "\n")
    return path


def test_the_command_draws_it(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = study.with_name("where.png")
    words = ["plot", str(study), "--occupancy", "--plot", str(picture)]
    main([*words, "--trials", "24", "--direction", "does"])
    assert picture.stat().st_size > 10_000
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("file", "flags", "said"),
    [
        ("study.toml", "--occupancy --trials 0", "trials is 0"),
        ("study.toml", "--occupancy --x radius", "--x, --y, --hue, --at are for sweeps"),
        ("study.toml", "--trials 5", "go with --occupancy"),
        ("study.toml", "--direction does", "go with --occupancy"),
        ("hand.nc", "--occupancy", "no study's .toml"),
        ("none.toml", "--occupancy", "none.toml"),
    ],
)
def test_what_the_command_refuses(
    study: Path, capsys: pytest.CaptureFixture[str], file: str, flags: str, said: str
) -> None:
    picture = study.with_name("where.png")
    with pytest.raises(SystemExit) as stopped:
        main(["plot", str(study.with_name(file)), *flags.split(), "--plot", str(picture)])
    assert stopped.value.code == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert said in told[0]
    assert not picture.exists()
