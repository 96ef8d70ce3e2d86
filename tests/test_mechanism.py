"""How an object gets round a fingertip: statics, a parabola, and what is counted of trials."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments import mechanism
from experiments.mechanism import (
    FALLING,
    PLACES,
    RADIUS,
    ROLLING,
    RUBBING,
    STRENGTH,
    UNIT,
    Watcher,
    group,
    index1_of,
    numbers,
    path,
    picked,
    rate,
    release_angle,
    save,
    scenario,
    seconds_out,
)
from pcjax.paper.readings import Reading
from pcjax.physics.state import PASSED
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.outcomes import LIMIT
from tests.shown import ROOT

pytestmark = pytest.mark.usefixtures("quick_programs")

BOTH = pytest.mark.parametrize("reading", [FALLING, RUBBING], ids=lambda reading: reading.name)


def behind(angle: float, gap_width: float) -> tuple[float, float]:
    """Where a circle at rest touches the left lid and the back of the left fingertip."""
    theta = math.radians(angle)
    along = RADIUS * (1 - math.sin(theta)) / math.cos(theta)
    return -0.5 * gap_width * UNIT - along, UNIT - RADIUS


@BOTH
@pytest.mark.parametrize("angle", [30.0, 45.0, 60.0])
def test_a_fingertip_lets_go_beyond_the_release_angle(reading: Reading, angle: float) -> None:
    made, place = scenario(reading, 0.6, angle), behind(angle, 0.6)
    theta, last = math.radians(angle), release_angle(reading, angle)
    assert last == pytest.approx(angle - (19.29 if reading is RUBBING else 0.0), abs=0.01)

    held, _ = path(made, place, last + 1.0, 1.0)
    np.testing.assert_allclose(held, np.broadcast_to(place, held.shape), atol=0.05)

    phi = math.radians(last - 8.0)
    freed, _ = path(made, place, last - 8.0, 1.5, 0.001)
    strength = 98 * 0.5 * STRENGTH / max(math.cos(phi), math.sin(phi))
    slope = math.sin(theta - phi) - reading.friction * math.cos(theta - phi)
    gone = 0.5 * strength * slope * 1.5**2
    along = np.array([math.sin(theta), -math.cos(theta)])
    np.testing.assert_allclose(freed[-1] - place, gone * along, atol=0.05)


@BOTH
@pytest.mark.parametrize(("gap_width", "angle"), [(0.6, 25.0), (0.6, 50.0), (0.8, 65.0)])
def test_a_trip_round_the_fingertip_is_as_statics_and_a_parabola_say(
    reading: Reading, gap_width: float, angle: float
) -> None:
    made, corner = scenario(reading, gap_width, angle), (RADIUS - 0.5 * UNIT, UNIT - RADIUS)
    phi = np.radians(np.arange(2.0, 89.0, 0.25))
    out = np.isfinite(seconds_out(reading, gap_width, angle, np.cos(phi), np.sin(phi)))
    # One range of directions, and the engine's is the same but for the rebound that is left out.
    first, *more = np.flatnonzero(np.diff(out.astype(int)))
    assert len(more) == 1
    low, high = np.degrees(phi[[first, more[0]]]).tolist()
    for direction, escapes in (
        (low - 3, False),
        (low + 2, True),
        (0.5 * (low + high), True),
        (high - 2, True),
        (high + 3, False),
    ):
        if high - low > 4 or direction in (low - 3, high + 3):
            assert path(made, corner, direction, 9.9)[1] == escapes, direction


def test_friction_shifts_the_way_round_and_a_circle_that_rolls_is_refused() -> None:
    phi = np.radians(np.arange(1.0, 89.0, 0.05))
    highest = [
        np.degrees(phi[np.isfinite(seconds_out(one, 0.6, angle, np.cos(phi), np.sin(phi)))].max())
        for one, angle in ((FALLING, 40.0), (RUBBING, 40.0 + 19.29))
    ]
    # A fingertip that is turned by atan(mu) more, but friction on the lid takes some speed before.
    assert 0 < highest[0] - highest[1] < 6
    none = np.isfinite(seconds_out(RUBBING, 0.6, 19.0, np.cos(phi), np.sin(phi)))
    assert not none.any()
    with pytest.raises(ValueError, match="rolls"):
        seconds_out(ROLLING, 0.6, 40.0, np.cos(phi), np.sin(phi))


@BOTH
def test_places_are_those_where_trials_are_when_a_period_ends(reading: Reading) -> None:
    made, trials = [scenario(reading, 0.6, angle) for angle in (0, 30)], 128
    settings: dict[str, Any] = {"trials": trials, "seed": 5}
    settings["engine"] = choose_engine("auto", None, made[0])
    watcher = Watcher(made, trials, 4)
    run(made, max_steps=40_000, follower=watcher, **settings)
    for periods in (1, 4):
        out = run(made, max_steps=10_000 * periods, keep_final=True, **settings)
        assert out.final is not None
        there = out.status == LIMIT
        place = watcher.place[..., periods - 1]
        assert (there == (place >= 0)).all()
        x, y, speed = np.abs(out.final[..., 0]), out.final[..., 1], np.hypot(*out.final.T[2:]).T
        still = there & (speed < 0.05)
        side, palm, lid = (np.abs(gap - RADIUS) < 0.2 for gap in (UNIT / 2 - x, y, UNIT - y))
        names = np.array([*PLACES, "none"])[place]
        assert ((names == "palm corner") == (still & side & palm)).all()
        assert ((names == "lid corner") == (still & side & lid)).all()
        assert (np.isin(names, ("moving", "sliding behind")) == (there & ~still)).all()
        assert not (still & (names == "wedge") & side).any()


def test_rows_count_every_escape_once_and_give_index_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mechanism, "ANGLES", (0, 40))
    settings: dict[str, Any] = {"trials": 400, "max_steps": 300_000, "seed": 2}
    save(list(group(FALLING, 0.6, **settings)), tmp_path / "some.csv")
    rows = mechanism.kept(tmp_path / "some.csv")
    out = run(
        [scenario(FALLING, 0.6, angle) for angle in (0, 40)],
        engine=choose_engine("auto", None, scenario(FALLING, 0.6, 0.0)),
        **settings,
    )
    every = picked(rows, FALLING.name, 0.6, "all")
    np.testing.assert_allclose(numbers(every, "index1")[0], out.steps.mean(axis=1), rtol=1e-5)
    names = "periods", "round", "straight"
    parts = {name: numbers(picked(rows, FALLING.name, 0.6, name), *names) for name in PLACES}
    whole = numbers(every, *names)
    np.testing.assert_array_equal(whole, sum(parts[name] for name in PLACES[:-1]))
    total = whole[1:].sum(0) + parts["start"][1:].sum(0)
    np.testing.assert_array_equal(total, (out.status == PASSED).sum(axis=1))
    periods = np.ceil(out.steps / 10_000).sum(axis=1)
    np.testing.assert_array_equal(whole[0] + parts["start"][0], periods)
    # 2 standard errors of index 1 are 5 %.
    found = index1_of(rows, 0.6, FALLING.name, "round", "straight")
    np.testing.assert_allclose(found, out.steps.mean(axis=1), rtol=0.1)
    assert (index1_of(rows, 0.6, FALLING.name, "straight") >= found).all()


def test_a_rate_without_periods_is_not_known() -> None:
    assert rate("round", 0, 0)["round_rate"] == ""
    known = rate("round", 5, 100)
    assert float(known["round_low"]) < float(known["round_rate"]) < float(known["round_high"])


def test_numbers_of_the_page_are_those_of_the_data() -> None:
    rows = mechanism.kept(mechanism.RESULTS / "mechanism.csv")
    page = (ROOT / "docs" / "why.md").read_text(encoding="utf-8")
    header = r"^\| \| \| ((?:\d+ deg \| )+\d+ deg) \|$"
    angles = [int(a) for a in re.findall(r"\d+", re.findall(header, page, re.MULTILINE)[0])]
    shown = re.findall(r"^\| ([a-z]+(?: 98)?) \| (0\.\d) L_p \| (.+) \|$", page, re.MULTILINE)
    assert len(shown) == 6
    for reading, gap_width, cells in shown:
        every = picked(rows, reading, float(gap_width), "all")
        known = {int(row["angle_deg"]): row for row in every}
        told = [tuple(map(float, cell.split(", "))) for cell in cells.split(" | ")]
        found = [
            tuple(float(known[angle][f"{way}_rate"]) for way in ("round", "straight"))
            for angle in angles
        ]
        np.testing.assert_allclose(told, found, atol=6e-5)
    for reading in ("literal", "rubbing", "rolling", "gravity 98", "friction 0.2", "friction 0.5"):
        for gap_width in mechanism.GAP_WIDTHS:
            assert picked(rows, reading, gap_width, "all")[0]["peak_deg"] in page
