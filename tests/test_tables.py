"""Text tables: no line is wider than 100 columns, whatever the names and numbers, and old files."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import pcjax
from pcjax.cli import main
from pcjax.cli.map import map_text
from pcjax.cli.optimize import as_text
from pcjax.design.checkpoint import Progress, Step
from pcjax.design.outcome import Candidate, Optimum, Part
from pcjax.paper.claims import Claim, judge_claims
from pcjax.paper.tables import figure_table
from pcjax.results.map_csv import load_map_csv, map_as_csv
from pcjax.results.provenance import conditions, provenance
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.results.schema import INDICES, KINDS, NAMES, STATISTICS, WATCHED, dataset_of
from pcjax.results.tables import WIDTH, conditions_table, in_columns
from pcjax.simulate.outcomes import Outcomes
from pcjax.study.compare import Ranking
from pcjax.words import in_ascii

RESULTS = Path(__file__).parent.parent / "experiments" / "results"
SCENARIOS = {"does": pcjax.does(pcjax.box_hand(), pcjax.Circle(25.0))}
RUN = {
    "seed": 4_294_967_295,
    "engine": "event, stepping",
    "precision": 64,
    "max_steps": 600_000,
    "trials": 100_000,
    "wall_seconds": 12_345.6,
}
LONG = "a-hand-with-a-name-that-is-longer-than-any-table-can-bear"
SWEPT = ("fingertip_angle_1_deg", "fingertip_angle_2_deg", "fingertip_length_1", "resting_speed")


def fits(text: str) -> str:
    """The text, whose lines are all narrow enough, also where ± is spelt."""
    assert max(len(in_ascii(line)) for line in text.splitlines()) <= WIDTH == 100
    return text


def evaluation(*, stick: bool = False, seed: int = 0) -> pcjax.Evaluation:
    """Made-up trials of both directions, with one that went wrong."""
    draw = np.random.default_rng(seed)
    steps = draw.integers(1, 600_000, (2, 400), np.int32)
    status = np.where(steps > 590_000, 3, 1).astype(np.uint8)
    status[0, 0] = 2
    body = pcjax.Stick(25.0) if stick else pcjax.Circle(25.0)
    hand = pcjax.box_hand()
    scenarios = {"does": pcjax.does(hand, body), "eoen": pcjax.eoen(hand, body)}
    watch = np.full((2, 400, 3), 123.456, np.float32) if stick else None
    run = {name: RUN[name] for name in RUN if name not in ("trials", "max_steps")} | {"dt": 0.02}
    ends = Outcomes(steps, status, 600_000, watch)
    return pcjax.Evaluation.from_outcomes(scenarios, ends, run)


def sweep(*names: str, values: int = 2) -> xr.Dataset:
    """A sweep of made-up numbers; its first condition cannot be run."""
    shape = (values,) * len(names)
    index = np.broadcast_to([599_999.0, 12_345.6, 555_555.5, 600_000.0], (*shape, 2, 4))
    score = np.broadcast_to([1234.5678, 123.4567, 1000.0, 1500.0], (*shape, 2, 4)).copy()
    count = np.broadcast_to([90_000, 9_000, 1_000], (*shape, 2, 3))
    problem = np.full(shape, "", dtype="<U300")
    problem.flat[0] = "the circle 300 does not fit at its start near the palm's ends " * 4
    width = np.full((*shape, 2), 50.0)
    return dataset_of(
        "sweep",
        {
            "index1": index,
            "index2": np.full((*shape, 2, 4), 0.5),
            "score": score,
            "count": count,
            "trials_used": np.full(shape, 100_000),
            "gap": width,
            "object_width": width,
            "dt": np.full((*shape, 2), 0.0123),
            "problem": problem,
        },
        {name: -1234.56 + np.arange(values) for name in names} | {"direction": list(NAMES)},
        provenance(RUN | {"sweep": "told", "study": "[hand]"}) | conditions(SCENARIOS),
        place=names,
    )


def grid(count: int = 3, **labels: list[Any]) -> xr.Dataset:
    """A grid of made-up numbers."""
    rows = np.array([[599_999.0 - k, 12_345.6, 555_555.5, 600_000.0] for k in range(count)])
    return dataset_of(
        "grid",
        {
            "index1": rows,
            "index2": rows / 600_000,
            "covariance": np.eye(2 * count).reshape(2, count, 2, count).transpose(0, 2, 1, 3),
            "count": np.full((count, 3), [90_000, 9_000, 1_000]),
            "gap": np.full(count, 200.0),
            "object_width": np.full(count, 50.0),
            "dt": np.full(count, np.nan),
        },
        {name: ("condition", values) for name, values in labels.items()},
        provenance(RUN | {"trials_right": 99_000}) | conditions(list(SCENARIOS.values()) * count),
        place=("condition",),
    )


def score_map() -> xr.Dataset:
    """A map of made-up numbers with the longest names."""
    told = {"objective": "escape_rate", "score_name": "DoEs / EoEn by escape_rate", "hands": 4}
    names = ("fingertip_angle_1_deg", "fingertip_length_2")
    current = {f"current_{name}": -123.456 for name in names}
    return dataset_of(
        "map",
        {
            "score": np.arange(16.0).reshape(2, 2, 1, 4) + 1234.5,
            "gap": np.full((2, 2), 200.0),
            "full_cage": np.array([[True, False], [False, False]]),
            "possible": np.ones((2, 2), bool),
        },
        {name: [-123.456, 80.5] for name in names} | {"index": ["escape_rate"]},
        provenance(RUN | told | {"invalid": 0, "object_width": 50.0} | current)
        | {"current_score": 1234.5678, "current_se": 123.4567}
        | conditions(SCENARIOS),
        place=names,
    )


# ---------------------------------------------------------------------------------------- width


@pytest.mark.parametrize("stick", [False, True])
def test_an_evaluation_fits(stick: bool) -> None:
    text = fits(repr(evaluation(stick=stick)))
    assert [line.split()[0] for line in text.splitlines()[1:4]] == ["DoEs", "EoEn", "score"]


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_sweep_fits_however_many_numbers_are_swept(count: int) -> None:
    text = fits(conditions_table(sweep(*SWEPT[:count])))
    assert "1234.5678 ± 123.4567" in text
    assert "does not fit" in text
    assert all(name in text for name in SWEPT[:count])
    assert "more: 'pcjax show --all'" in fits(conditions_table(sweep("radius", values=70)))


def test_a_grid_fits() -> None:
    labels = {"direction": ["does"] * 3, "radius": [10.0, 25.0, 50.0], "note": [LONG, LONG, "b"]}
    assert "599,999 ± 12,346" in fits(conditions_table(grid(**labels)))


def test_a_comparison_fits() -> None:
    three = {name: evaluation(seed=k) for k, name in enumerate((LONG, f"other-{LONG}", "c"))}
    text = fits(repr(Ranking(three, "score")))
    assert "not certain" in text
    fits(repr(Ranking(three, "does")))


def test_a_map_fits() -> None:
    assert "fingertip_length_2" in fits(map_text(score_map()))


def test_an_optimum_fits() -> None:
    space = pcjax.design_space(
        pcjax.box_hand(),
        {"fingertip_angle_1_deg": (-30, 50), "fingertip_length_2": (25, 175)},
        50.0,
    )
    task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 600_000)
    estimate = pcjax.Estimate(1234.5678, 123.4567, 1000.0, 1500.1234)
    design = np.array([-12.3456, 123.456])
    step = Step([0.0, 0.0], 0.0, 0.0, [], [])
    found = Optimum(
        start=design,
        best=design,
        moved=True,
        start_hand=space.hand(design),
        start_score=estimate,
        best_score=estimate,
        improvement=estimate,
        candidates=[Candidate(design + k, estimate, estimate) for k in (0, 1)],
        certainty=0.5,
        parts=[Part(estimate, estimate, estimate)],
        progress=Progress([[step] * 100], [], []),
        invalid=12_345,
        interrupted=True,
        trials=100_000_000,
        notes=(LONG,),
    )
    text = fits(
        as_text(found, space, pcjax.Surrogate(task), [{"amplitude_deg": 12.3456}], 12_345.6)
    )
    assert "fingertip_length_2" in text
    assert "another end" in text
    assert "amplitude_deg 12.3456" in text
    assert "parameter 2" in fits(repr(found))


def test_an_inspection_fits() -> None:
    study = pcjax.Study(pcjax.box_hand(), pcjax.Circle(0.01), pcjax.WristTilt(gravity=0.01))
    found = pcjax.inspect(study)
    assert "doubt:" in fits(repr(found))
    far = replace(study, body=pcjax.Circle(300.0))
    assert "cannot be run" in fits(repr(pcjax.inspect(far)))


@pytest.mark.parametrize("path", sorted(RESULTS.glob("fig*.nc")), ids=lambda path: path.stem)
def test_a_figure_fits(path: Path) -> None:
    fits(figure_table(load_dataset(path)))


def test_claims_fit() -> None:
    names = ("9a", "9b", "12", "15", "17")
    claims = judge_claims({name: load_dataset(RESULTS / f"fig{name}.nc") for name in names})
    assert all(isinstance(claim, Claim) for claim in claims)
    for claim in claims:
        fits(str(claim))


def test_parts_of_a_table_begin_with_what_a_row_is_or_its_number() -> None:
    cells = ["x" * 20] * 9
    parts = in_columns(["name", *cells], [["a", *cells]]).split("\n\n")
    assert all(part.splitlines()[0].startswith("name") for part in parts)
    assert sum(part.count("x" * 20) for part in parts) == 18
    numbered = in_columns(cells, [cells, cells], keys=8).split("\n\n")
    assert all(part.splitlines()[2].lstrip().startswith("2") for part in numbered)


def test_numbers_are_aligned_at_their_errors() -> None:
    lines = in_columns(["", "index"], [["a", "5 ± 1,000"], ["b", "12,345 ± 2"]]).splitlines()
    assert lines[1].index("±") == lines[2].index("±")


# --------------------------------------------------------------------- shown, drawn, and upgraded


@pytest.mark.parametrize("kind", ["evaluation", "sweep", "grid", "map.nc", "map.csv", "study"])
def test_every_file_is_shown_and_drawn(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{kind}.nc"
    if kind == "evaluation":
        evaluation().save(path)
    elif kind in ("sweep", "grid"):
        save_dataset(sweep("radius") if kind == "sweep" else grid(radius=[1.0, 2.0, 3.0]), path)
    elif kind == "map.nc":
        save_dataset(score_map(), path)
    else:
        path = tmp_path / ("map.csv" if kind == "map.csv" else "study.toml")
        study = pcjax.Study(pcjax.box_hand(), pcjax.Circle(25.0))
        path.write_text(map_as_csv(score_map()) if kind == "map.csv" else study.to_toml())
    main(["show", str(path)])
    fits(capsys.readouterr().out)
    main(["plot", str(path), "--plot", str(tmp_path / "p.png")])
    assert (tmp_path / "p.png").stat().st_size > 5000
    if kind == "grid":
        with pytest.raises(SystemExit):
            main(["plot", str(path), "--at", "radius=7", "--plot", str(tmp_path / "p.png")])
        assert "no condition has radius 7" in capsys.readouterr().err


def test_a_map_survives_as_a_table(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(map_as_csv(score_map()))
    again, first = load_map_csv(tmp_path / "m.csv"), score_map()
    for name in ("gap", "full_cage", "possible"):
        assert again[name].equals(first[name])
    kept = ["value", "se"]
    np.testing.assert_array_equal(
        again.score.sel(statistic=kept).values, first.score.sel(statistic=kept).values
    )
    for lie in ("", "a,b\n1,2\n", map_as_csv(first).replace("80.5", "81.5", 1)):
        (tmp_path / "lie.csv").write_text(lie)
        with pytest.raises(ValueError, match=r"lie.csv is no map"):
            load_map_csv(tmp_path / "lie.csv")


def test_an_earlier_figure_has_todays_form_and_its_own_numbers(tmp_path: Path) -> None:
    path = RESULTS / "fig9a.nc"
    old, new = xr.load_dataset(path, engine="h5netcdf"), load_dataset(path)
    assert new.attrs["kind"] == "grid"
    for k, index in enumerate(INDICES):
        assert new[index].dims == ("condition", "statistic")
        np.testing.assert_array_equal(new[index].sel(statistic="value").values, old[index].values)
        variance = np.diag(old.covariance.values[k, k])
        np.testing.assert_allclose(new[index].sel(statistic="se").values ** 2, variance)
        assert np.isnan(new[index].sel(statistic=["low", "high"])).all()
    np.testing.assert_array_equal(new["count"].values, old["count"].values)
    assert new["count"].dims == ("condition", "status_name")
    assert new.attrs["trials_right"] == old.attrs["trials_used"]
    # A stick's had its skin once.
    old.attrs["skin"] = 0.01
    old.to_netcdf(tmp_path / "stick.nc", engine="h5netcdf")
    assert set(load_dataset(tmp_path / "stick.nc")["skin"].values) == {0.01}


def test_earlier_evaluations_and_maps_have_todays_form(tmp_path: Path) -> None:
    result = evaluation()
    attrs = dict(result.dataset.attrs)
    attrs["width"] = attrs.pop("object_width")
    for name in ("kind", "trials", "hand", "law"):
        del attrs[name]
    old = result.dataset.drop_vars("outline")
    old.attrs = attrs
    save_dataset(old, tmp_path / "e.nc")
    again = pcjax.Evaluation.load(tmp_path / "e.nc")
    assert repr(again) == repr(result)
    np.testing.assert_array_equal(again.dataset.outline, result.dataset.outline)
    assert again.dataset.attrs["law"] == "not kept"

    new = score_map()
    score = new.score.isel(index=0, drop=True)
    one, se = (score.sel(statistic=name, drop=True) for name in ("value", "se"))
    old = new.drop_vars(["score", "index", "statistic"]).assign(score=one, se=se)
    old.attrs = {k: v for k, v in new.attrs.items() if k not in ("kind", "engine", "precision")}
    save_dataset(old, tmp_path / "m.nc")
    again = load_dataset(tmp_path / "m.nc")
    assert map_text(again) == map_text(new)
    assert again.score.dims == new.score.dims


# --------------------------------------------------------------------------------------- schema


def test_what_is_the_same_has_one_name_one_unit_and_one_meaning() -> None:
    seen: dict[str, Any] = {}
    for kind in KINDS.values():
        for name, what in {**kind.variables, **kind.optional}.items():
            first = seen.setdefault(name, what)
            assert (what.units, what.long_name) == (first.units, first.long_name)
            # What is kept of a stick is of each trial, or of the worst of them.
            assert what.dims == first.dims or name in WATCHED


def test_estimates_are_along_their_statistics() -> None:
    data = evaluation().to_xarray()
    assert data["count"].dims == ("direction", "status_name")
    assert (data["count"].sum("status_name") == 400).all()
    assert data.statistic.values.tolist() == list(STATISTICS)
    assert not math.isnan(float(data.index1.sel(direction="does", statistic="low")))
