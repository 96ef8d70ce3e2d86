"""Results: what is kept and read back, what a failed write leaves, what is printed and noted."""

from __future__ import annotations

import json
import math
import pickle
import re
from dataclasses import astuple
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
import xarray as xr

import pcjax
from pcjax.physics.state import INVALID, PASSED
from pcjax.quality.indices import index1, index2, ratio
from pcjax.results.tables import engines_text
from pcjax.simulate.outcomes import LIMIT, STATUS_NAMES, Outcomes

P, L, X = PASSED, LIMIT, INVALID

pytestmark = pytest.mark.usefixtures("quick_programs")

LENGTHS = ((500.0, 140.0, 100.0), (480.0, 160.0, 90.0))
ANGLES = ((1.57, 1.58, 1.4), (1.56, 1.55, 1.5))
DRIVE = {"amplitude": 0.5, "gravity": 9.7, "ramp_time": 1.0, "period": 10.0}
LAW = {"restitution": 0.2, "resting_speed": 0.04}
SETTINGS: dict[str, Any] = {"trials": 64, "max_steps": 200_000, "seed": 7}


@pytest.fixture(scope="module")
def run() -> pcjax.Evaluation:
    """A small real run of a lopsided hand: every parameter has a value of its own."""
    return pcjax.evaluate(
        pcjax.HandDesign(510.0, LENGTHS, ANGLES),
        pcjax.Circle(24.0, mass=2.5),
        drive=pcjax.WristTilt(**DRIVE),
        law=pcjax.ContactLaw(**LAW),
        start_spread=0.08,
        **SETTINGS,
    )


def built(
    *,
    limit: int = 1000,
    hand: pcjax.HandDesign | None = None,
    radius: float = 25.0,
    **ends: list[tuple[int, int]],
) -> pcjax.Evaluation:
    """An evaluation from made-up ends of trials, (step, status) by direction."""
    hand = pcjax.box_hand() if hand is None else hand
    make = {"does": pcjax.does, "eoen": pcjax.eoen}
    scenarios = {name: make[name](hand, pcjax.Circle(radius)) for name in ends}
    table = np.array(list(ends.values()))
    outcomes = Outcomes(table[..., 0].astype(np.int32), table[..., 1].astype(np.uint8), limit)
    settings = {
        "seed": 3,
        "engine": "stepping",
        "dt": 0.02,
        "precision": 32,
        "gap": float(hand.gap()),
        "wall_seconds": 0.25,
    }
    return pcjax.Evaluation.from_outcomes(scenarios, outcomes, settings)


def noted(evaluation: pcjax.Evaluation, *words: str) -> bool:
    """Whether one of the notes has all the words."""
    return any(all(word in note for word in words) for note in evaluation.notes())


# -------------------------------------------------------------------------- kept and read back


def test_saving_and_loading_gives_the_same_back(run: pcjax.Evaluation, tmp_path: Path):
    path = run.save(tmp_path / "run.nc")
    loaded = pcjax.Evaluation.load(path)
    xr.testing.assert_identical(loaded.dataset, run.dataset)
    for name, variable in run.dataset.variables.items():
        assert loaded.dataset[name].dtype == variable.dtype, name
    assert loaded.as_json() == run.as_json()
    assert repr(loaded) == repr(run)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.nc"]


def test_a_result_can_be_pickled(run: pcjax.Evaluation):
    again = pickle.loads(pickle.dumps(run))
    assert again.dataset.identical(run.dataset)
    assert repr(again) == repr(run)
    assert again.as_json() == run.as_json()


def test_one_direction_survives_the_round_trip(tmp_path: Path):
    one = built(does=[(10, P), (1000, L)])
    loaded = pcjax.Evaluation.load(one.save(tmp_path / "one.nc"))
    xr.testing.assert_identical(loaded.dataset, one.dataset)
    assert loaded.directions == ["does"]


def test_estimates_are_stored_beside_the_data(run: pcjax.Evaluation, tmp_path: Path):
    before = run.dataset.copy(deep=True)
    data = run.to_xarray()
    xr.testing.assert_identical(run.dataset, before)
    xr.testing.assert_identical(data[list(before.data_vars)], before)
    for direction in ("does", "eoen"):
        for name, estimate in run.indices(direction).items():
            kept = data[name].sel(direction=direction, statistic=["value", "se", "low", "high"])
            assert tuple(kept.values) == astuple(estimate)
    for name, estimate in run.score().items():
        kept = data.score.sel(index=name, statistic=["value", "se", "low", "high"])
        assert tuple(kept.values) == astuple(estimate)
    data.to_netcdf(tmp_path / "all.nc", engine="h5netcdf")
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "all.nc", engine="h5netcdf"), data)


def test_every_quantity_has_a_unit(run: pcjax.Evaluation):
    data = run.to_xarray()
    for name, variable in data.data_vars.items():
        assert "units" in variable.attrs or name == "status", name
    assert data.escape_step.units == data.index1.units == "steps of 0.001 s"
    assert data.index2.units == data.score.units == "1"
    status = data.status.attrs
    meanings = dict(zip(status["flag_values"], status["flag_meanings"].split(), strict=True))
    assert meanings == STATUS_NAMES


def test_attributes_say_how_a_result_was_made(run: pcjax.Evaluation):
    attrs = run.dataset.attrs
    assert attrs["pcjax_version"] == version("pcjax")
    assert attrs["jax_version"] == jax.__version__
    assert attrs["seed"] == SETTINGS["seed"]
    assert attrs["max_steps"] == SETTINGS["max_steps"]
    assert attrs["precision"] == 32
    assert attrs["engine"] == "event"
    assert math.isnan(attrs["dt"])  # it takes no steps
    assert attrs["wall_seconds"] > 0
    assert attrs["radius"] == 24.0
    assert run.trials == SETTINGS["trials"]


def expected_parameters(*, mirrored: bool) -> dict[str, float]:
    """All numbers of the run's scenario, with the fingertips mirrored or as they are."""
    design = pcjax.HandDesign(510.0, LENGTHS, ANGLES)
    turn = design.tip_mirror().turn
    angles = design.with_fingertips_mirrored().angles if mirrored else ANGLES
    hand = {"hand.palm_length": 510.0, "hand.thickness": 0.0, "start_spread": 0.08}
    for i in (0, 1):
        for j in (0, 1, 2):
            hand[f"hand.lengths[{i}][{j}]"] = LENGTHS[i][j]
            hand[f"hand.angles[{i}][{j}]"] = angles[i][j]
    body = {"body.radius": 24.0, "body.mass": 2.5}
    drive = {f"drive.{name}": value for name, value in DRIVE.items()}
    x, y = (turn.x, turn.y) if mirrored else (1.0, 0.0)
    drive |= {"drive.turned.x": x, "drive.turned.y": y}
    return hand | body | drive | {f"law.{name}": value for name, value in LAW.items()}


def test_attributes_hold_every_parameter(run: pcjax.Evaluation):
    kept = json.loads(run.dataset.attrs["parameters"])
    assert kept == {
        "does": expected_parameters(mirrored=False),
        "eoen": expected_parameters(mirrored=True),
    }


def test_a_result_can_be_repeated_from_its_file_alone(run: pcjax.Evaluation, tmp_path: Path):
    kept = pcjax.Evaluation.load(run.save(tmp_path / "run.nc")).dataset
    of = json.loads(kept.attrs["parameters"])["does"]

    def finger(values: str, i: int) -> tuple[float, ...]:
        return tuple(of[f"hand.{values}[{i}][{j}]"] for j in (0, 1, 2))

    def part(name: str) -> dict[str, float]:
        return {key.split(".")[1]: value for key, value in of.items() if key.startswith(name)}

    wrist = part("drive.")
    assert wrist.pop("turned") == 0.0  # the last of its two numbers: gravity is not turned
    hand = pcjax.HandDesign(
        of["hand.palm_length"],
        (finger("lengths", 0), finger("lengths", 1)),
        (finger("angles", 0), finger("angles", 1)),
        of["hand.thickness"],
    )
    again = pcjax.evaluate(
        hand,
        pcjax.Circle(**part("body.")),
        drive=pcjax.WristTilt(**wrist),
        law=pcjax.ContactLaw(**part("law.")),
        start_spread=of["start_spread"],
        trials=kept.sizes["trial"],
        max_steps=int(kept.attrs["max_steps"]),
        seed=int(kept.attrs["seed"]),
        engine=kept.attrs["engine"],
        precision=int(kept.attrs["precision"]),
    ).dataset
    xr.testing.assert_equal(again, kept)
    changing = {"created", "wall_seconds", "dt", "study"}  # which asked for engine "auto"
    for name in kept.attrs.keys() - changing:
        assert again.attrs[name] == kept.attrs[name], name


def test_a_result_holds_its_study(run: pcjax.Evaluation, tmp_path: Path):
    (tmp_path / "study.toml").write_text(run.dataset.attrs["study"], encoding="utf-8")
    study = pcjax.load_study(tmp_path / "study.toml")
    assert study.hand.lengths == LENGTHS
    assert study.run.seed == SETTINGS["seed"]
    kinds = {part: run.dataset.attrs[part] for part in ("hand", "body", "drive", "law")}
    assert kinds == {
        "hand": "HandDesign",
        "body": "Circle",
        "drive": "WristTilt",
        "law": "ContactLaw",
    }


# ------------------------------------------------------------------------------- failed writes


@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt(), MemoryError()])
@pytest.mark.parametrize("existing", [None, b"an older result"])
def test_a_write_that_fails_leaves_nothing_behind(
    error: BaseException,
    existing: bytes | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    path = tmp_path / "run.nc"
    if existing is not None:
        path.write_bytes(existing)

    def half_written(dataset: xr.Dataset, path: Any, **options: Any) -> None:
        Path(path).write_bytes(b"half of a file")
        raise error

    monkeypatch.setattr(xr.Dataset, "to_netcdf", half_written)
    with pytest.raises(type(error)):
        built(does=[(10, P)]).save(path)
    left = {entry.name: entry.read_bytes() for entry in tmp_path.iterdir()}
    assert left == ({} if existing is None else {"run.nc": existing})


def test_a_complete_write_replaces_an_older_file(tmp_path: Path):
    path = tmp_path / "run.nc"
    built(does=[(10, P)]).save(path)
    newer = built(does=[(20, P)])
    newer.save(path)
    xr.testing.assert_identical(pcjax.Evaluation.load(path).dataset, newer.dataset)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.nc"]


def test_a_place_that_cannot_be_written_is_an_oserror(tmp_path: Path):
    one = built(does=[(10, P)])
    with pytest.raises(OSError, match="missing"):
        one.save(tmp_path / "missing" / "run.nc")
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(OSError, match="folder"):
        one.save(folder)
    assert [entry.name for entry in tmp_path.rglob("*")] == ["folder"]


# -------------------------------------------------------------------------------------- printed


def numbers_in(line: str) -> list[tuple[float, float]]:
    """The numbers of a line, each with half a unit of its last digit."""
    found = re.findall(r"-?\d[\d,]*(?:\.\d+)?|nan", line)
    return [
        (float(text.replace(",", "")), 0.5 * 10.0 ** -len(text.partition(".")[2])) for text in found
    ]


def test_the_printed_table_shows_every_estimate(run: pcjax.Evaluation):
    lines = repr(run).splitlines()
    rows = {"DoEs": run.indices("does"), "EoEn": run.indices("eoen"), "score": run.score()}
    for name, estimates in rows.items():
        (line,) = (line for line in lines if line.startswith(name))
        told = numbers_in(line)
        expected = [*astuple(estimates["index1"]), *astuple(estimates["index2"])]
        assert len(told) == len(expected)
        for (number, reach), value in zip(told, expected, strict=True):
            assert abs(number - value) <= reach * (1 + 1e-9), (name, number, value)
    settings = "\n".join(line for line in lines if line.split()[0] not in rows)
    for text in ("64 trials", "200,000 steps", "seed 7", "event engine", "float32"):
        assert text in settings


def test_engines_are_told_with_their_steps():
    assert engines_text("event", math.nan) == "event engine"
    assert engines_text("stepping", 0.04) == "stepping engine (dt = 0.04 s)"
    both = engines_text("event, stepping", [math.nan, 0.02, 0.04])
    assert both == "event, stepping engine (dt = 0.02 to 0.04 s)"


def test_the_notes_are_printed_too():
    one = built(does=[(10, P), (20, P)], eoen=[(10, P), (1000, L)])
    assert one.notes()
    for note in one.notes():
        assert note in repr(one)


def test_one_direction_prints_no_score(run: pcjax.Evaluation):
    one = built(does=[(10, P), (1000, L)])
    assert "score" not in repr(one)
    assert "EoEn" not in repr(one)
    with pytest.raises(ValueError, match="both"):
        one.score()
    assert "score" not in one.to_xarray()
    assert one.as_json().keys().isdisjoint({"eoen", "score"})


def test_an_unremarkable_run_has_no_notes(run: pcjax.Evaluation):
    for direction in run.directions:
        counts = run.status(direction)
        assert counts["passed"] > 0
        assert counts["limit"] > 0
    assert run.notes() == []


# ----------------------------------------------------------------------------- degenerate cases


def test_nobody_escapes_within_the_limit():
    stuck = built(does=[(1000, L)] * 3, eoen=[(1000, L)] * 3)
    for direction, name in (("does", "DoEs"), ("eoen", "EoEn")):
        one, two = stuck.indices(direction).values()
        assert (one.value, one.se, one.high) == (1000.0, 0.0, 1000.0)
        assert (two.value, two.se, two.high) == (1.0, 0.0, 1.0)
        # Three trials that stay say little: 0.025^(1/3) of all, and no more, stay for certain.
        assert one.low / 1000 == pytest.approx(two.low) == pytest.approx(0.292, abs=0.01)
        assert noted(stuck, name, "nobody passed", "1,000 steps")
    assert noted(stuck, "EoEn is at the limit")
    assert not noted(stuck, "full cage")
    for score in stuck.score().values():
        assert (score.value, score.se) == (1.0, 0.0)
        assert 0 < score.low < 0.5 < 2 < score.high


def test_nobody_escapes_from_a_real_hand_in_one_step():
    # An open gap, but the start is far from it.
    stuck = pcjax.evaluate(trials=64, max_steps=1)
    assert stuck.status("does") == {"passed": 0, "limit": 64, "invalid": 0}
    assert stuck.indices("does")["index1"].value == 1.0
    assert noted(stuck, "DoEs", "nobody passed")
    assert noted(stuck, "EoEn", "nobody passed")


def test_everybody_escapes():
    loose = built(does=[(10, P), (20, P), (60, P)], eoen=[(5, P), (10, P), (15, P)])
    assert noted(loose, "DoEs", "everybody passed")
    assert noted(loose, "EoEn", "everybody passed")
    assert noted(loose, "score by index 2", "undefined")
    assert loose.indices("does")["index2"].value == 0.0
    assert loose.score()["index1"].value == pytest.approx(3.0)
    assert loose.as_json()["score"]["index2"] == dict.fromkeys(("value", "se", "low", "high"))


def test_a_hand_too_narrow_for_the_object_is_a_full_cage():
    hand = pcjax.box_hand(0.0, gap_width=40.0)
    caged = built(hand=hand, radius=25.0, does=[(1000, L)] * 2, eoen=[(1000, L)] * 2)
    assert noted(caged, "full cage", "40", "50")
    assert astuple(caged.indices("does")["index1"]) == (1000.0, 0.0, 1000.0, 1000.0)
    assert astuple(caged.indices("does")["index2"]) == (1.0, 0.0, 1.0, 1.0)
    assert astuple(caged.score()["index1"]) == (1.0, 0.0, 1.0, 1.0)
    assert astuple(caged.difference(caged, "does")["index1"]) == (0.0, 0.0, 0.0, 0.0)
    # That nobody passes is then no question of the limit.
    assert not noted(caged, "nobody passed")
    fits = built(hand=hand, radius=19.0, does=[(1000, L)] * 2, eoen=[(1000, L)] * 2)
    assert not noted(fits, "full cage")


def test_invalid_trials_are_counted_and_left_out_in_pairs():
    some = built(
        does=[(100, P), (200, P), (300, X), (1000, L), (500, P)],
        eoen=[(150, P), (250, X), (350, P), (1000, L), (1000, L)],
    )
    assert some.status("does") == {"passed": 3, "limit": 1, "invalid": 1}
    assert some.status("eoen") == {"passed": 2, "limit": 2, "invalid": 1}
    assert noted(some, "DoEs", "1 of 5", "went wrong")
    assert noted(some, "EoEn", "1 of 5", "went wrong")
    # Alone, a direction leaves out its own; the score leaves out the pair.
    assert some.indices("does") == {
        "index1": index1(np.array([100, 200, 1000, 500]), 1000, lost=1),
        "index2": index2(np.array([False, False, True, False]), lost=1),
    }
    assert some.indices("eoen") == {
        "index1": index1(np.array([150, 350, 1000, 1000]), 1000, lost=1),
        "index2": index2(np.array([False, False, True, True]), lost=1),
    }
    assert some.score() == {
        "index1": ratio(
            np.array([100.0, 1000, 500]), np.array([150.0, 1000, 1000]), 1000.0, lost=2
        ),
        "index2": ratio(np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0]), 1.0, lost=2),
    }
    times, left = some.survival("does")
    assert times.tolist() == [0, 100, 200, 500]
    np.testing.assert_allclose(left, [1.0, 0.75, 0.5, 0.25])


def test_trials_that_all_go_wrong_leave_everything_undefined():
    wrong = built(does=[(1, X)] * 2, eoen=[(1, X)] * 2)
    estimates = [*wrong.indices("does").values(), *wrong.score().values()]
    assert all(math.isnan(number) for estimate in estimates for number in astuple(estimate))
    assert noted(wrong, "2 of 2", "went wrong")
    # An index that is undefined is not 0.
    assert not noted(wrong, "is 0")
    plain = json.loads(json.dumps(wrong.as_json(), allow_nan=False))
    assert plain["does"]["index1"] == dict.fromkeys(("value", "se", "low", "high"))
    rows = repr(wrong).splitlines()[1:4]
    assert all(row.split()[1:] == ["undefined", "undefined"] for row in rows)


def test_an_undefined_score_is_noted_whichever_trials_are_left_out():
    # EoEn's only trial that stays is left out of the score, since DoEs' twin went wrong.
    one = built(does=[(1, X), (10, P), (1000, L)], eoen=[(1000, L), (10, P), (20, P)])
    assert one.indices("eoen")["index2"].value > 0
    assert math.isnan(one.score()["index2"].value)
    assert noted(one, "score by index 2", "undefined")


def test_one_trial_is_a_value_without_an_error():
    one = built(does=[(10, P)], eoen=[(20, P)])
    plain = json.loads(json.dumps(one.as_json(), allow_nan=False))
    for estimate, value in ((plain["does"]["index1"], 10.0), (plain["score"]["index1"], 0.5)):
        assert (estimate["value"], estimate["se"]) == (value, None)
        assert estimate["low"] < value < estimate["high"]
    assert "10 ± unknown" in repr(one)
    assert "nan" not in repr(one)


def test_the_plain_object_is_strict_json(run: pcjax.Evaluation):
    plain = run.as_json()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    for direction in ("does", "eoen"):
        assert sum(plain["status"][direction].values()) == plain["trials"] == 64
        assert plain["status"][direction] == run.status(direction)


def test_differences_between_hands_are_paired(run: pcjax.Evaluation):
    seed = int(run.dataset.attrs["seed"])
    hand = pcjax.box_hand(0.5)
    other = pcjax.evaluate(hand, trials=run.trials, max_steps=run.max_steps, seed=seed)
    for direction in run.directions:
        mine, theirs = (
            e.dataset.escape_step.sel(direction=direction).values.astype(float)
            for e in (run, other)
        )
        found = run.difference(other, direction)["index1"]
        assert found.value == pytest.approx((mine - theirs).mean())
        assert found.se == pytest.approx((mine - theirs).std(ddof=1) / math.sqrt(run.trials))
        assert found.low < found.value < found.high
    same = run.difference(run, "does")["index2"]
    assert (same.value, same.se) == (0.0, 0.0)
    # Two of 64 trials could yet have told the hands apart.
    assert same.high == -same.low == pytest.approx(1 - 0.025 ** (1 / 64), rel=0.02)


def test_runs_on_other_trials_are_not_compared(run: pcjax.Evaluation):
    other = pcjax.Evaluation(run.dataset.isel(trial=slice(0, 10)))
    with pytest.raises(ValueError, match=r"trials is .* here and 10 there"):
        run.difference(other, "does")


def test_an_asymmetric_hand_has_one_gap_and_is_closed_in_both_directions():
    right = math.pi / 2
    hand = pcjax.HandDesign(
        500.0,
        ((500.0, 150.0, 100.0), (450.0, 60.0, 100.0)),
        ((right, right, 0.9), (right, 1.0, 0.6)),
    )
    gap = float(hand.gap())
    for share in (0.45, 0.51):
        result = pcjax.evaluate(hand, pcjax.Circle(share * gap), trials=64, max_steps=20_000)
        assert list(result.dataset.gap.values) == pytest.approx([gap, gap])
        for direction, name in (("does", "DoEs"), ("eoen", "EoEn")):
            assert noted(result, f"{name}: full cage") == (share > 0.5)
            assert share < 0.5 or result.status(direction)["passed"] == 0
