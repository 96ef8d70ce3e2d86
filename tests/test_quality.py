"""Indices against what is known of them: our published table, another engine, more of the same.

Statistical tests state their trials and false-alarm rate.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import pcjax
from benchmarks import pymunk_scene
from benchmarks.inputs import as_arrays
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand
from pcjax.model.scenario import does, eoen
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.event import EventDriven
from pcjax.simulate.stepping import Stepping, safe_step

# theta_g: DoEs index 1, index 2, EoEn index 1, index 2, from an independent program with about
# 2,000 trials each (standard errors about 5,000 for DoEs and 4,000 for EoEn; W_g = 0.4 L_p,
# L_g = 0.2 L_p, r_o = 0.05 L_p, limit 600,000).
EXPECTED = {
    -20.0: (266_000, 0.14, 206_000, 0.05),
    0.0: (311_000, 0.23, 217_000, 0.06),
    20.0: (386_000, 0.38, 248_000, 0.11),
    40.0: (483_000, 0.64, 334_000, 0.26),
}


def test_table_of_an_independent_program() -> None:
    # 2,000 trials, 16 comparisons at |z| < 3.5: false alarm 16 * 4.7e-4 = 0.7 %.
    trials = 2000
    scenarios = [
        make(box_hand(math.radians(angle)), Circle(25.0))
        for angle in EXPECTED
        for make in (does, eoen)
    ]
    out = run(scenarios, trials=trials, max_steps=600_000, engine=EventDriven(), seed=1)
    for k, (angle, row) in enumerate(EXPECTED.items()):
        for d, their_se in enumerate((5000.0, 4000.0)):
            steps = out.steps[2 * k + d].astype(float)
            z1 = (steps.mean() - row[2 * d]) / math.hypot(steps.std() / math.sqrt(trials), their_se)
            share, theirs = float(np.mean(steps == 600_000)), row[2 * d + 1]
            pooled = (share + theirs) / 2
            # the table is rounded to 0.01
            rounding = 0.01 / math.sqrt(12)
            z2 = (share - theirs) / math.hypot(
                math.sqrt(2 * pooled * (1 - pooled) / trials), rounding
            )
            assert abs(z1) < 3.5, (angle, d, z1)
            assert abs(z2) < 3.5, (angle, d, z2)


def test_pymunk_agrees() -> None:
    # The same 80 starts and targets in another engine, to 60 s. Paired, so that the two may
    # differ by little; |z| < 4 has a false alarm of 6e-5, and 25 steps (0.05 %) of bias are
    # allowed for pymunk's first-order solver.
    scenario = does(box_hand(0.0, gap_width=300.0), Circle(25.0))
    trials, limit = 80, 60_000
    ours = run([scenario], trials=trials, max_steps=limit, engine=Stepping(0.01)).steps[0]
    inputs = as_arrays(scenario, trials=trials, max_steps=limit)
    theirs = pymunk_scene.escape_steps(**inputs, dt=0.005, max_steps=limit // 5) * 5
    theirs = np.minimum(theirs, limit)
    difference = (ours - theirs).astype(float)
    reach = 4 * difference.std(ddof=1) / math.sqrt(trials) + 25
    assert np.mean(ours < limit) > 0.2
    assert abs(difference.mean()) < reach
    assert np.corrcoef(ours, theirs)[0, 1] > 0.8


def test_automatic_engine_and_step_agree_with_the_papers() -> None:
    # Paired over 200 trials to 50,000 steps for a large and a small radius: the mean difference
    # within 4 s.e. (false alarm 6e-5 each) plus 0.3 % of index 1.
    trials, limit = 200, 50_000
    for scenario in (does(box_hand(0.2, gap_width=250.0), Circle(r)) for r in (25.0, 5.0)):
        step = safe_step(scenario)
        assert step > 0.01
        fine, *others = (
            run([scenario], trials=trials, max_steps=limit, engine=engine, precision=64).steps[0]
            for engine in (Stepping(0.001), Stepping(step), choose_engine("auto", None, scenario))
        )
        assert np.mean(fine < limit) > 0.1
        for coarse in others:
            difference = (coarse - fine).astype(float)
            reach = 4 * difference.std(ddof=1) / math.sqrt(trials) + 0.003 * fine.mean()
            assert abs(difference.mean()) < reach


def test_automatic_step_shrinks_with_speed_and_radius() -> None:
    def step(radius: float, gravity: float) -> float:
        scenario = does(box_hand(), Circle(radius), WristTilt(gravity=gravity))
        return safe_step(scenario)

    assert step(25.0, 9.8) == 0.04
    assert step(1.0, 9.8) < step(5.0, 9.8) < 0.02
    assert step(5.0, 980.0) == pytest.approx(step(5.0, 9.8) / 10, rel=1e-6)
    fast = pcjax.evaluate(
        body=Circle(5.0),
        drive=WristTilt(gravity=980.0),
        law=pcjax.ContactLaw(restitution=1.0),
        trials=100,
        max_steps=30_000,
        dt=step(5.0, 980.0),
    )
    assert fast.status("does")["invalid"] == 0


def test_full_cage_holds_everybody_and_says_so() -> None:
    result = pcjax.evaluate(box_hand(math.radians(50)), trials=200, max_steps=200_000)
    for direction in ("does", "eoen"):
        assert result.indices(direction)["index2"].value == 1.0
    assert result.score()["index1"].value == 1.0
    assert any("full cage" in note for note in result.notes())


def test_gap_just_wider_than_the_object_is_no_cage_and_just_narrower_is() -> None:
    shares = []
    for clearance in (0.5, -0.5):
        hand = box_hand(0.0, gap_width=50.0 + clearance, fingertip_length=20.0, side_length=150.0)
        result = pcjax.evaluate(hand, direction="does", trials=200, max_steps=600_000)
        assert result.status("does")["invalid"] == 0
        shares.append(result.indices("does")["index2"].value)
    assert shares[0] < 1.0
    assert shares[1] == 1.0
