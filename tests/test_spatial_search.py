"""Searches and maps over hands in three dimensions: what is allowed, what is refused, and that they
end with the exact score of hands that a study file keeps."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcjax
import pcjax.sweep.plan
from pcjax import spatial
from pcjax.cli import main
from pcjax.design.compare import compare
from pcjax.design.optimize import optimize
from pcjax.design.outcome import Optimum, Settings
from pcjax.design.postures import PostureSpace
from pcjax.design.search import search_grid
from pcjax.quality.surrogate import Surrogate
from pcjax.results.reading import load_dataset
from pcjax.simulate.outcomes import Outcomes
from pcjax.study.read import example
from pcjax.study.task import task_of
from pcjax.sweep.plan import Part
from pcjax.sweep.store import Store

pytest.importorskip("mujoco.batch")

TIPS = "posture.tip1+tip2+tip3"
LIMIT = 2_000
"""A period of the tilt, which is shorter here than usual."""


@pytest.fixture(autouse=True)
def _few_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A look takes milliseconds."""
    monkeypatch.setattr(PostureSpace, "looks", 8)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The example's study, with short periods and to a lower limit."""
    path, text = tmp_path / "study.toml", example("mujoco").replace("60_000", str(LIMIT))
    text = text.replace("ramp_time = 1.0", "ramp_time = 0.5").replace("period = 10.0", "period = 2")
    path.write_text(text)
    return path


def study(file: Path = spatial.PRESETS["three-finger"]) -> spatial.Study:
    hand = spatial.Hand(
        file,
        spatial.StartBox((0.0, 0.0, 0.036), (0.002, 0.002, 0.001)),
        root="palm",
        posture={f"tip{k}": math.radians(20.0) for k in (1, 2, 3)},
    )
    drive = spatial.Tilt(math.radians(60.0), rest=(1.0, 0.0, 0.0)).having(ramp_time=0.5, period=2.0)
    return spatial.Study(hand, spatial.Sphere(0.024), drive, run=pcjax.Run(max_steps=LIMIT))


def searched(method: str, seed: int = 0) -> tuple[Optimum, PostureSpace]:
    mine = study()
    space = mine.space({TIPS: (0.0, 60.0), "posture.base1": (-20.0, 20.0)})
    surrogate = Surrogate(task_of(mine), form="exact", trials=16)
    settings = Settings(method, iterations=2, accept_trials=16, seed=seed)
    return optimize(surrogate, space, settings), space


# ------------------------------------------------------------------------------------------ spaces


def test_the_design_of_a_designs_hand_is_that_design() -> None:
    space = study().space(
        {
            "posture.tip1+tip3": (0.0, 40.0),
            "posture.base2": None,
            "scale.distal1": (0.8, 1.2),
            "radius": (0.02, 0.026),
        }
    )
    design = np.array([33.3, -7.7, 1.1, 0.021])
    assert space.design_of(space.hand(design)) == pytest.approx(design, rel=1e-11)
    assert space.design_of(space.base) == pytest.approx([20.0, 0.0, 1.0, 0.024])
    assert space.low.tolist() == [0.0, -45.0, 0.8, 0.02]  # the file's own range where none is given
    assert space.high.tolist() == [40.0, 90.0, 1.2, 0.026]


def test_a_designed_study_has_its_numbers() -> None:
    mine = study()
    space = mine.space({TIPS: (0.0, 40.0), "radius": (0.02, 0.026)})
    design = np.array([31.0, 0.021])
    made: Any = mine.designed(space, design)
    assert made.body.radius == pytest.approx(0.021)
    assert [made.hand.to_file(f"tip{k}") for k in (1, 2, 3)] == [31.0] * 3
    scenario: Any = task_of(mine).scenarios(space.hand(design))[0]  # pyright: ignore
    assert scenario.hand.key == made.hand.key
    assert scenario.body.width == made.body.width


def test_what_does_not_do_is_not_allowed_and_counted() -> None:
    """By each of the reasons, and the nearest that is allowed is on the edge of what is."""
    mine = study()
    space = mine.space({TIPS: (-45.0, 85.0), "posture.base1": None})
    held = space.holding(task_of(mine))
    designs = np.array([[20.0, 0.0], [20.0, 40.0], [80.0, 0.0], [88.0, 0.0]])
    assert held.which(designs).tolist() == [True, False, False, False]
    assert held.refused() == {"no room for the object at a start": 1, "geoms overlap": 1}
    edge = held.nearest_allowed(designs[1])
    assert held.allowed(edge)
    assert not held.allowed(edge + 0.04 * (designs[1] - designs[0]))
    # Before a search says what has to fit, overlaps alone count.
    assert space.which(designs).tolist() == [True, True, False, False]
    far = replace(mine, hand=mine.hand.having(start=spatial.StartBox((0, 0, 0.2), (0, 0, 0))))
    high = far.space({TIPS: (0.0, 40.0)}).holding(task_of(far))
    assert high.wrong_with(np.array([20.0])) == "a start is outside of the hand"
    with pytest.raises(ValueError, match=r"no allowed hand .*: a start is outside"):
        high.nearest_allowed([20.0])


def test_what_is_too_thin_for_a_step_is_not_allowed() -> None:
    """Links or objects, unless a step is asked for; and a search goes on beside them."""
    mine = study()
    free = {"scale.distal1+distal2+distal3": (0.01, 1.0), "radius": (1e-4, 0.024)}
    held = mine.space(free).holding(task_of(mine))
    designs = np.array([[1.0, 0.024], [0.01, 0.024], [1.0, 1e-4]])
    assert held.which(designs).tolist() == [True, False, False]
    assert held.refused() == {"too thin for the shortest step": 2}
    finer = replace(mine, run=replace(mine.run, dt=1e-5))
    assert finer.space(free).holding(task_of(finer)).which(designs).all()
    surrogate = Surrogate(task_of(mine), form="exact", trials=8)
    lengths = mine.space({"scale.distal1+distal2+distal3": (0.001, 1.0)})
    found = search_grid(surrogate, lengths, Settings("grid", accept_trials=8), [5])
    assert found.refused == {"too thin for the shortest step": 1}


def test_a_joint_that_differs_is_no_design() -> None:
    mine = study()
    uneven = replace(mine, hand=mine.hand.having(posture={"tip2": math.radians(10.0)}))
    space = uneven.space({TIPS: (0.0, 15.0)})
    assert not space.has_base
    assert space.objections() == [
        f"its {TIPS} is 20 deg, outside 0 to 15 deg",
        f"its {TIPS} is 20, 10, 20, and designs have it alike",
    ]
    assert mine.space({TIPS: None}).has_base


@pytest.mark.parametrize(
    ("free", "said"),
    [
        ({"posture.tip9": None}, "no joint tip9 in .*did you mean tip"),
        ({"posture.tip1": (-60.0, 0.0)}, "tip1 is free from -60 to 0 deg: its range in .* is -45"),
        ({"posture.tip1": (20.0, 10.0)}, "posture.tip1 is free from 20 to 10: .* out of order"),
        ({"posture.tip1+base1": None, "posture.tip1": None}, "posture.tip1 are the same number"),
        ({"scale.distal9": (0.8, 1.2)}, "scale: there is no body distal9"),
        ({"scale.distal1": None}, "scale.distal1 needs bounds, such as scale.distal1=0.8:1.2"),
        ({"scale.distal1": (0.0, 1.2)}, "scale.distal1's lower bound is 0: it has to be above 0"),
        ({"side_x": (0.01, 0.02)}, "there is no parameter side_x: there are posture.JOINT"),
        ({"radius": (-0.01, 0.02)}, "radius .*positive|radius .*above 0"),
        ({}, "no parameter is free: name one or more of posture.JOINT"),
    ],
)
def test_bad_parameters_are_named(free: dict[str, tuple[float, float] | None], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        study().space(free)


def test_what_is_for_the_plane_is_refused() -> None:
    mine = study()
    with pytest.raises(ValueError, match="a clearance is for hands in the plane"):
        mine.space({TIPS: None}, 0.01)
    with pytest.raises(ValueError, match="a limit is for hands in the plane"):
        mine.space({TIPS: None}, limits=("posture.tip1 <= 3",))
    over = replace(mine, objective=replace(mine.objective, over={"radius": (0.02, 0.024)}))
    with pytest.raises(ValueError, match="radius is free, and the objective has values of it"):
        over.space({"radius": (0.02, 0.026)})
    bare = replace(mine, hand=spatial.Hand(mine.hand.file, mine.hand.start, root="palm"))
    with pytest.raises(ValueError, match=r"posture names no joint: .* posture.base1"):
        assert bare.usual_free
    with pytest.raises(ValueError, match="method 'gradient' is not for these hands: MuJoCo"):
        searched("gradient")


# ---------------------------------------------------------------------------------------- searches


@pytest.mark.parametrize("method", ["cma", "model"])
def test_a_search_ends_alike_for_the_same_seed(method: str) -> None:
    """And tells how many designs were refused."""
    if method == "cma":
        pytest.importorskip("cmaes")
    (found, space), (again, _) = searched(method), searched(method)
    assert found.best.tolist() == again.best.tolist()
    assert found.best_score == again.best_score
    assert found.refused == again.refused
    assert f"{sum(found.refused.values()):,} design" in repr(found)
    assert space.holding(task_of(study())).allowed(found.best)


def test_a_search_that_is_interrupted_goes_on_to_the_same_end(tmp_path: Path) -> None:
    mine = study()
    space = mine.space({TIPS: (0.0, 40.0)})
    surrogate = Surrogate(task_of(mine), form="exact", trials=8)
    kept, settings = tmp_path / "kept.json", Settings(iterations=2, accept_trials=8)
    whole = optimize(surrogate, space, settings)
    optimize(surrogate, space, settings, checkpoint=kept, watch=lambda _: True)
    assert json.loads(kept.read_text())["state"]["trials"] < whole.progress.trials
    rest = optimize(surrogate, space, settings, checkpoint=kept)
    assert rest.best.tolist() == whole.best.tolist()
    assert rest.best_score == whole.best_score


def test_the_command_ends_with_a_study_of_the_best(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whose hand has the score that is told, on the same trials."""
    pytest.importorskip("cmaes")
    kept = file.with_name("best.toml")
    words = ["optimize", str(file), "--method", "cma", "--iterations", "2", "--trials", "16"]
    words += ["--accept-trials", "16", "--free", f"{TIPS}=0:60", "--free", "radius=0.02:0.026"]
    main([*words, "--out", str(kept), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["best"]["parameters"].keys() == {TIPS, "radius"}
    assert sum(told["refused"].values()) > 0
    best = pcjax.load_study(kept)
    assert best.body.radius == pytest.approx(told["best"]["parameters"]["radius"])
    design = np.array([told["best"]["parameters"][TIPS]])
    space = best.space({TIPS: (0.0, 40.0)})
    assert space.design_of(best.hand) == pytest.approx(design)
    scored = Surrogate(task_of(best), form="exact")
    exact = compare(scored, space, [design], trials=16, seed=0x30000000)
    assert exact.scores[0].value == pytest.approx(told["best"]["score"]["value"], rel=1e-9)


def test_joints_of_the_posture_are_free_unless_said(file: Path) -> None:
    joints = [f"{name}{k}" for name in ("base", "tip") for k in (1, 2, 3)]
    mine: Any = pcjax.load_study(file)
    assert mine.usual_free == tuple(f"posture.{joint}" for joint in joints)
    many = {f"{name}{k}": 0.0 for name in ("tip", "base") for k in (1, 2, 3)}
    assert len(replace(mine, hand=mine.hand.having(posture=many)).usual_free) == 6


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--clearance", "0.01"], "a clearance is for hands in the plane"),
        (["--limit", "gap-width <= 3"], "a limit is for hands in the plane"),
        (["--method", "gradient"], "method 'gradient' is not for these hands"),
        (["--form", "cloud"], "--form is for --method gradient"),
        (["--free", "gap-width"], "there is no parameter gap_width"),
        (["--free", "posture.tipp1"], "there is no joint tipp1 in .*: did you mean tip1"),
    ],
)
def test_one_line_says_what_does_not_apply(
    file: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["optimize", str(file), "--trials", "4", "--accept-trials", "4", *words])
    error = capsys.readouterr().err.splitlines()[-1]
    assert stop.value.code == 2
    assert error.startswith("pcjax: ")
    assert re.search(said, error)


# -------------------------------------------------------------------------------------------- maps


def test_a_map_has_scores_of_what_is_possible(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Along a joint and the object's radius: those of the hands alone, and no gap anywhere."""
    kept, drawn = file.with_name("map.nc"), file.with_name("map.png")
    words = ["map", str(file), "--x", "posture.tip1=10:30", "--y", "radius=0.022:0.026"]
    words += ["--points", "2", "2", "--trials", "8", "--plot", str(drawn), "--out", str(kept)]
    main([*words, "--json"])
    told = json.loads(capsys.readouterr().out)
    data = load_dataset(kept)
    assert drawn.stat().st_size > 0
    assert data.score.dims[:2] == ("radius", "posture.tip1")
    assert data.possible.values.tolist() == [[True, True], [False, False]]
    assert (
        np.isfinite(data.score.sel(statistic="value").values[..., 0]).tolist() == told["possible"]
    )
    assert np.isnan(data.gap).all()
    assert "gap_fine" not in data
    assert data["posture.tip1"].attrs["units"] == "degree"
    assert data.attrs["precision"] == 64
    for name, value in zip("xy", ("posture.tip1", "radius"), strict=True):
        assert told[name]["parameter"] == value
    mine = pcjax.load_study(file).having({"radius": 0.022})
    scored = Surrogate(task_of(mine), form="exact")
    alone = compare(
        scored, mine.space({"posture.tip1": None}), [np.array([30.0])], trials=8, seed=0
    )
    assert told["score"][0][1] == pytest.approx(alone.scores[0].value, rel=1e-9)
    assert told["current"]["parameters"] == {"posture.tip1": 20.0, "radius": 0.024}


def test_a_map_cannot_vary_how_the_hand_is_used(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["map", str(file), "--x", "posture.tip1", "--y", "inflation=0.5:1"])
    assert "a map cannot have inflation along a side" in capsys.readouterr().err


# ------------------------------------------------------------------------------------------ sweeps


def swept(file: Path = spatial.PRESETS["three-finger"]) -> spatial.Study:
    """Joints that are alike, and radii of which one is too large."""
    sweep = pcjax.Sweep({TIPS: (10.0, 20.0), "radius": (0.022, 0.026)})
    return replace(study(file), sweep=sweep, run=pcjax.Run(trials=8, max_steps=LIMIT))


def test_an_interrupted_sweep_goes_on_to_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pcjax.sweep.plan, "BLOCK", 4)
    mine, file = swept(), tmp_path / "whole.nc"
    whole = pcjax.run_sweep(mine, file, keep_trials=True)
    assert [bool(problem) for problem in whole.problem.values.ravel()] == [False, True] * 2
    assert whole[TIPS].attrs["units"] == "degree"
    alone = pcjax.evaluate_study(mine.having({TIPS: 20.0, "radius": 0.022}))
    at = whole.sel({TIPS: 20.0, "radius": 0.022, "direction": "does"})
    assert at.escape_step.values.tolist() == alone.ends("does")[0].tolist()

    keep, kept = Store.keep, []

    def keep_one(self: Store, part: Part, outcomes: Outcomes) -> None:
        if kept:
            raise KeyboardInterrupt
        kept.append(part.name)
        keep(self, part, outcomes)

    again = tmp_path / "again.nc"
    with monkeypatch.context() as patch:
        patch.setattr(Store, "keep", keep_one)
        with pytest.raises(KeyboardInterrupt):
            pcjax.run_sweep(mine, again, keep_trials=True)
    ran, run = [], Part.run
    monkeypatch.setattr(Part, "run", lambda part, *a: ran.append(part.name) or run(part, *a))
    pcjax.run_sweep(mine, again, keep_trials=True)
    assert ran
    assert kept[0] not in ran
    assert again.read_bytes() == file.read_bytes()


def test_a_sweep_on_other_processes_has_the_same_bits(tmp_path: Path) -> None:
    """In a process of its own: the cluster's threads and warnings are not this suite's."""
    pytest.importorskip("distributed")
    study_file, file = tmp_path / "study.toml", tmp_path / "here.nc"
    study_file.write_text(swept().to_toml())
    other = tmp_path / "other.nc"
    pcjax.run_sweep(swept(), file)
    words = [sys.executable, "-m", "pcjax", "sweep", str(study_file), "--scheduler", "local"]
    done = subprocess.run(
        [*words, "--out", str(other)], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    assert other.read_bytes() == file.read_bytes()


def test_a_hand_file_that_has_changed_is_another_sweep(tmp_path: Path) -> None:
    own, out = tmp_path / "own.xml", tmp_path / "out.nc"
    text = spatial.PRESETS["three-finger"].read_text()
    own.write_text(text)
    pcjax.run_sweep(swept(own), out)
    own.write_text(text.replace('size="0.055 0.01"', 'size="0.056 0.01"'))
    with pytest.raises(ValueError, match="is there already, the result of something else"):
        pcjax.run_sweep(swept(own), out)
