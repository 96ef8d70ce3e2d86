"""Limbs with a thickness: a circle there is a larger circle in a hand without, and what is said of
surfaces is what a ruler says."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pcjax
from pcjax.model.checking import check_geometry, geometry_of
from pcjax.model.hand import full_cage
from pcjax.model.scenario import Scenario, why_no_eoen
from pcjax.physics.state import INVALID
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.convex import ConvexLeaps
from pcjax.simulate.event import EventDriven
from pcjax.simulate.stepping import Stepping, safe_step, trajectory
from pcjax.study.inspect import inspect
from pcjax.view.designs import plot_inspection

pytestmark = pytest.mark.usefixtures("quick_programs")

OPEN = pcjax.box_hand(math.radians(-20), gap_width=400.0)
"""A hand that many bodies leave soon."""

DIRECTIONS: list[Callable[..., Scenario]] = [pcjax.does, pcjax.eoen]


# ------------------------------------------------------------------------------------ by a ruler


def test_gap_and_full_cage_are_from_surface_to_surface() -> None:
    hand = pcjax.box_hand(math.radians(30), thickness=12.0)  # 200 - 2 * 100 / 2 between the lines
    assert float(hand.gap()) == pytest.approx(88.0, abs=1e-3)
    a, b = hand.narrowest_passage()
    assert float(b.x - a.x) == pytest.approx(88.0, abs=1e-3)
    assert float(a.x) == pytest.approx(-44.0, abs=1e-3)
    for make in DIRECTIONS:
        wide, narrow = (make(hand, pcjax.Circle(radius)) for radius in (44.1, 43.9))
        assert check_geometry(wide) == pytest.approx(88.0, abs=1e-9)
        assert full_cage(geometry_of(wide).gap, wide.body.width)
        assert not full_cage(geometry_of(narrow).gap, narrow.body.width)
    caged = pcjax.evaluate(hand, pcjax.Circle(44.1), trials=8, max_steps=20_000)
    assert caged.indices("does")["index2"].value == 1
    assert caged.status("does")["limit"] == 8


def test_a_gap_that_thickness_closes_is_0_from_both_sides() -> None:
    hand = pcjax.box_hand(math.radians(30), thickness=100.0)
    assert check_geometry(pcjax.does(hand, pcjax.Circle(5.0))) == pytest.approx(0.0, abs=1e-9)
    assert why_no_eoen(hand) == ""


def test_starts_touch_the_surfaces() -> None:
    tilt = math.radians(65)
    hand = pcjax.two_joint_hand(tilt, math.pi / 2, thickness=14.0)
    with jax.enable_x64(True):
        start = pcjax.does(hand, pcjax.Circle(20.0), start_spread=0.0).corner_start()
        distances = [float(limb.distance(start)) for limb in hand.limbs()]
    assert distances[0] == pytest.approx(20 + 7, abs=1e-9)
    assert distances[3] == pytest.approx(20 + 7, abs=1e-9)
    # 160 from side to side, and starts that are 50 apart.
    tight = pcjax.box_hand(0.0, gap_width=480.0, thickness=340.0)
    check_geometry(pcjax.does(tight, pcjax.Circle(54.0)))
    with pytest.raises(ValueError, match="the circle of radius 56 does not fit at its start"):
        check_geometry(pcjax.does(tight, pcjax.Circle(56.0)))


def test_surfaces_that_overlap_are_refused_but_for_those_close_along_the_hand() -> None:
    tips = pcjax.box_hand(math.radians(50), fingertip_length=120.0)
    apart = 200 - 2 * 120 * math.sin(math.radians(50))  # 16.2
    check_geometry(pcjax.does(replace(tips, thickness=apart - 0.01), pcjax.Circle(25.0)))
    with pytest.raises(ValueError, match="finger 2's limb 3 crosses finger 1's limb 3"):
        check_geometry(pcjax.does(replace(tips, thickness=apart + 0.01), pcjax.Circle(25.0)))
    # A finger of many short limbs that bends a little at each joint.
    lengths, angles = (400.0, *(8.0,) * 4), (math.pi / 2, *(math.radians(20),) * 4)
    curled = pcjax.HandDesign(500.0, (lengths, lengths), (angles, angles), 12.0)
    check_geometry(pcjax.does(curled, pcjax.Circle(25.0)))


def test_eoen_keeps_gap_and_thickness() -> None:
    hand = pcjax.box_hand(math.radians(30), thickness=12.0)
    outside = pcjax.eoen(hand, pcjax.Circle(20.0))
    assert outside.hand.thickness == 12.0
    assert geometry_of(outside).gap == pytest.approx(88.0, abs=1e-9)
    goal = outside.hand.goal()  # of the middle lines
    assert float(goal.a.y) == pytest.approx(500 + 100 * math.cos(math.radians(30)), abs=1e-3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: pcjax.box_hand(thickness=-1.0), "thickness is -1: it has to be at least 0"),
        (lambda: pcjax.two_joint_hand(thickness=math.nan), "thickness is nan"),
        (lambda: replace(OPEN, thickness=-0.5), "thickness is -0.5: it has to be at least 0"),
        (
            lambda: pcjax.design_space(OPEN, {"thickness": (-1, 5)}, 50.0),
            "thickness's lower bound is -1",
        ),
    ],
)
def test_what_is_no_thickness_is_refused(make: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


# -------------------------------------------------------------------------------------- in motion


def test_a_circle_is_a_larger_one_in_a_thin_hand() -> None:
    """Bit for bit, for both engines and directions, on wrist and arm: its centre moves alike."""
    thick, thin = pcjax.Circle(20.0), pcjax.Circle(25.0)
    pairs: list[tuple[list[Scenario], Any, int]] = []
    for make in DIRECTIONS:
        pair = [make(replace(OPEN, thickness=10.0), thick), make(OPEN, thin)]
        pairs += [(pair, EventDriven(), 100_000), (pair, Stepping(0.04), 40_000)]
    arm, tight = pcjax.PlanarArm(), pcjax.two_joint_hand(math.radians(65), math.radians(90))
    bodies = (pcjax.Circle(40.0), pcjax.Circle(50.0))
    pair = [pcjax.does(replace(tight, thickness=20.0), bodies[0], arm)]
    pairs.append(([*pair, pcjax.does(tight, bodies[1], arm)], Stepping(0.02), 10_000))
    for pair, engine, limit in pairs:
        assert safe_step(pair[0]) == safe_step(pair[1])
        found = run(pair, engine=engine, trials=64, max_steps=limit, seed=1)
        np.testing.assert_array_equal(found.steps[0], found.steps[1])
        np.testing.assert_array_equal(found.status[0], found.status[1])
        assert np.mean(found.steps[0] < limit) > 0.1


def test_the_engine_for_convex_bodies_agrees_for_a_circle() -> None:
    """The share of trials that may part: they meet a fingertip's end, which multiplies rounding."""
    for make in DIRECTIONS:
        scenario = make(replace(OPEN, thickness=18.0), pcjax.Circle(16.0))
        settings: dict[str, Any] = {"trials": 64, "max_steps": 50_000}
        mine = run([scenario], engine=ConvexLeaps(drift=1e-7), **settings)
        other = run([scenario], engine=EventDriven(), **settings)
        assert np.mean(np.abs(mine.steps - other.steps) <= 2) >= 0.95
        assert not np.any(mine.status == INVALID)
        assert np.mean(other.steps < 50_000) > 0.1


def test_as_thickness_vanishes_so_does_what_it_does() -> None:
    """The end of 10 s in 64 bits, and its derivative by the thickness, from differences."""

    def end(thickness: Any) -> Any:
        hand = pcjax.box_hand(math.radians(10), thickness=thickness)
        path = trajectory(pcjax.does(hand, pcjax.Circle(25.0)), trial=3, dt=0.02)
        return jnp.stack([path.position.x[-1], path.position.y[-1]])

    with jax.enable_x64(True):
        ends = np.asarray(jax.jit(jax.vmap(end))(jnp.array([0.0, 1e-6, 1e-3])))
        slope = np.asarray(jax.jit(jax.jacfwd(end))(jnp.asarray(0.0)))
    assert np.abs(ends[1] - ends[0]).max() < 1e-5
    np.testing.assert_allclose(slope, (ends[2] - ends[0]) / 1e-3, atol=0.02)
    assert np.abs(slope).max() > 0.1


def test_the_stick_goes_by_the_engine_for_convex_bodies() -> None:
    thick = replace(OPEN, thickness=10.0)
    scenario = pcjax.does(thick, pcjax.Stick(30.0))
    assert choose_engine("auto", None, scenario).name == "convex"
    with pytest.raises(ValueError, match=r"without thickness.*take engine 'convex'"):
        choose_engine("stepping", None, scenario)
    with pytest.raises(ValueError, match="without thickness, and engine 'convex' in any"):
        trajectory(scenario)
    assert choose_engine("stepping", None, pcjax.does(OPEN, pcjax.Stick(30.0))).name == "stepping"


# ----------------------------------------------------------------------- studies, files, pictures


def test_a_study_keeps_and_sweeps_it(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    for hand in (
        'preset = "box"\nthickness = 12',
        "palm_length = 400\nlengths = [[300, 100, 60], [300, 100, 60]]\n"
        "angles_deg = [[90, 90, 75], [90, 90, 75]]\nthickness = 12",
    ):
        path.write_text(f"[hand]\n{hand}\n\n[sweep]\nthickness = [0, 8, 16]\n")
        study = pcjax.load_study(path)
        assert study.hand.thickness == 12
        assert [float(one.hand.thickness) for _, one in study.conditions()] == [0, 8, 16]
        path.write_text(study.to_toml())
        assert pcjax.load_study(path).hand.thickness == 12
    path.write_text('[hand]\npreset = "two-joint"\nthickness = -2\n')
    with pytest.raises(ValueError, match=r"line 3: \[hand\] thickness is -2"):
        pcjax.load_study(path)
    thin = pcjax.Study(OPEN, pcjax.Circle(25.0)).to_toml()
    assert "thickness" not in thin


def test_results_have_it_and_older_ones_are_of_0(tmp_path: Path) -> None:
    result = pcjax.evaluate(
        replace(OPEN, thickness=9.0), pcjax.Circle(25.0), trials=8, max_steps=20_000
    )
    back = pcjax.Evaluation.load(result.save(tmp_path / "thick.nc")).dataset
    assert back.attrs["thickness"] == 9
    assert json.loads(back.attrs["parameters"])["does"]["hand.thickness"] == 9
    assert "thickness = 9.0" in back.attrs["study"]
    x0, _, x1, _ = back.passage.sel(direction="does").values
    assert x1 - x0 == pytest.approx(float(back.gap.sel(direction="does")), abs=1e-9)
    older = back.copy()
    del older.attrs["thickness"]
    save_dataset(older, tmp_path / "older.nc")
    assert load_dataset(tmp_path / "older.nc").attrs["thickness"] == 0
    older.attrs["thickness"] = -1.0
    save_dataset(older, tmp_path / "wrong.nc")
    with pytest.raises(ValueError, match="thickness is -1"):
        load_dataset(tmp_path / "wrong.nc")


def test_it_is_a_parameter_of_designs() -> None:
    space = pcjax.design_space(
        pcjax.box_hand(thickness=10.0), {"thickness": (0, 40), "fingertip_length": (50, 150)}, 50.0
    )
    hand = space.hand([30.0, 80.0])
    assert hand.thickness == 30.0
    assert hand.lengths[0][-1] == 80.0
    assert space.design_of(hand).tolist() == [30.0, 80.0]
    # Where the gap is too narrow, the thickness gives way, and 0 has no hands below.
    narrow = pcjax.box_hand(math.radians(40), fingertip_length=80.0, thickness=0.0)
    least = pcjax.design_space(narrow, {"thickness": (0, 60)}, 50.0)
    found = least.nearest_allowed([60.0])
    assert float(least.hand(found).gap()) == pytest.approx(50 + 0.04 * 500, abs=1e-3)
    assert least.nearest_allowed([0.0]).tolist() == [0.0]
    with pytest.raises(ValueError, match="there is no parameter thickness_1"):
        pcjax.design_space(narrow, ["thickness_1"], 50.0)


def test_inspection_and_picture_are_of_the_surfaces() -> None:
    study = pcjax.Study(pcjax.box_hand(0.0, thickness=20.0), pcjax.Circle(25.0))
    found = inspect(study)
    view = found.views["does"]
    assert view.gap == pytest.approx(180.0)
    assert view.starts is not None
    assert view.starts[0] == ((-215.0, 35.0), (-165.0, 85.0))
    assert found.size == pytest.approx((520.0, 520.0))
    assert "palm 500, 20 thick" in repr(found)
    axis = plot_inspection(found).axes[0]
    limbs = [patch.get_path().vertices for patch in axis.patches if patch.get_facecolor()[0] == 0]
    low, high = (
        f([f(np.asarray(part), axis=0) for part in limbs], axis=0) for f in (np.min, np.max)
    )
    np.testing.assert_allclose([low, high], [[-260, -10], [260, 510]], atol=1e-3)
    assert len(limbs) == 7
