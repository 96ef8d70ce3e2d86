"""Sweeps: the same numbers whoever runs them and however often they are interrupted."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import pcjax.sweep.cluster
import pcjax.sweep.plan
import pcjax.sweep.run
from pcjax.cli import main
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand
from pcjax.results.tables import conditions_table
from pcjax.study.evaluate import evaluate
from pcjax.study.read import example, load_study
from pcjax.study.spec import Run, Study, Sweep
from pcjax.sweep.plan import Plan
from pcjax.sweep.run import run_sweep
from pcjax.sweep.store import Store
from pcjax.view.sweeps import plot_sweep

pytestmark = pytest.mark.usefixtures("quick_programs")

QUICK = Run(trials=60, max_steps=20_000, seed=3)
STUDY = Study(
    box_hand(),
    Circle(25.0),
    WristTilt(),
    ContactLaw(),
    QUICK,
    Sweep({"fingertip_angle_deg": (-10.0, 20.0), "radius": (10.0, 25.0, 40.0)}),
)


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pcjax.sweep.plan, "BLOCK", 20)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sweep") / "whole.nc"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pcjax.sweep.plan, "BLOCK", 20)
        run_sweep(STUDY, path, keep_trials=True)
    return path


def test_each_condition_is_what_evaluate_gives(whole: Path) -> None:
    data = xr.load_dataset(whole, engine="h5netcdf")
    assert dict(data.index1.sizes) == {
        "fingertip_angle_deg": 2,
        "radius": 3,
        "direction": 2,
        "statistic": 4,
    }
    one = evaluate(
        box_hand(np.radians(20.0)), Circle(40.0), trials=60, max_steps=20_000, seed=3
    ).to_xarray()
    mine = data.sel(fingertip_angle_deg=20.0, radius=40.0)
    np.testing.assert_array_equal(mine.escape_step.values, one.escape_step.values)
    np.testing.assert_array_equal(mine.status.values, one.status.values)
    for name in ("index1", "index2", "score"):
        np.testing.assert_array_equal(mine[name].values, one[name].values)
    assert mine["count"].values.sum() == 2 * 60
    assert load_like(data.attrs["study"], whole.parent) == STUDY.to_toml()


def load_like(text: str, folder: Path) -> str:
    path = folder / "again.toml"
    path.write_text(text)
    return load_study(path).to_toml()


def test_an_interrupted_sweep_ends_in_the_same_file(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "r.nc"
    keep, kept = Store.keep, []

    def keep_one(
        self: Store, task: pcjax.sweep.plan.Part, outcomes: pcjax.simulate.outcomes.Outcomes
    ) -> None:
        if kept:
            raise KeyboardInterrupt
        kept.append(task.name)
        keep(self, task, outcomes)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "keep", keep_one)
        with pytest.raises(KeyboardInterrupt):
            run_sweep(STUDY, out, keep_trials=True)
    assert not out.exists()
    folder = tmp_path / "r.nc.parts"
    assert [path.stem for path in folder.glob("*.npz")] == kept
    # A part that is not whole, and the remains of a write that was killed.
    (folder / "0000000020-000000.npz").write_bytes((folder / f"{kept[0]}.npz").read_bytes()[:200])
    (folder / ".unfinished.x").write_bytes(b"PK")
    ran = []
    run = pcjax.sweep.plan.Part.run
    monkeypatch.setattr(
        pcjax.sweep.plan.Part,
        "run",
        lambda task, *a, **k: ran.append(task.name) or run(task, *a, **k),
    )
    with pytest.warns(UserWarning, match=r"20-000000.npz is damaged.*: to be run again"):
        run_sweep(STUDY, out, keep_trials=True)
    assert kept[0] not in ran
    assert "0000000020-000000" in ran
    assert out.read_bytes() == whole.read_bytes()
    assert list(tmp_path.iterdir()) == [out]
    ran.clear()
    again = run_sweep(STUDY, out, keep_trials=True)
    assert not ran
    xr.testing.assert_identical(again, xr.load_dataset(whole, engine="h5netcdf"))


_CHILD = """
import sys, time
import pcjax.sweep.plan
import pcjax.sweep.run
import pcjax.sweep.store
from pcjax.cli.compilation_cache import use_compilation_cache
from pcjax.study.read import load_study
use_compilation_cache()
pcjax.sweep.plan.BLOCK = 20
keep = pcjax.sweep.store.Store.keep
# There is time to kill it between two parts.
pcjax.sweep.store.Store.keep = lambda *part: (keep(*part), time.sleep(60))
pcjax.sweep.run.run_sweep(load_study(sys.argv[1]), sys.argv[2], keep_trials=True)
"""


def test_a_killed_sweep_ends_in_the_same_file(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(STUDY.to_toml())
    out = tmp_path / "r.nc"
    command = [sys.executable, "-c", _CHILD, str(tmp_path / "study.toml"), str(out)]
    folder = tmp_path / "r.nc.parts"
    child = subprocess.Popen(command)
    deadline = time.monotonic() + 300
    while not list(folder.glob("*.npz")) and child.poll() is None:
        assert time.monotonic() < deadline, "no part within five minutes"
        time.sleep(0.002)
    child.send_signal(signal.SIGKILL)
    assert child.wait() == -signal.SIGKILL
    run_sweep(STUDY, out, keep_trials=True)
    assert out.read_bytes() == whole.read_bytes()
    assert not folder.exists()


def test_a_changed_study_is_refused(whole: Path, tmp_path: Path) -> None:
    other = replace(STUDY, run=replace(QUICK, seed=4))
    before = whole.read_bytes()
    with pytest.raises(ValueError, match="the result of something else"):
        run_sweep(other, whole, keep_trials=True)
    with pytest.raises(ValueError, match="the result of something else"):
        run_sweep(STUDY, whole)
    assert whole.read_bytes() == before
    Store(tmp_path / "r.nc", "another")
    with pytest.raises(ValueError, match="parts of another sweep"):
        run_sweep(STUDY, tmp_path / "r.nc")
    cut = tmp_path / "cut.nc"
    cut.write_bytes(before[: len(before) // 2])
    with pytest.raises(ValueError, match=r"cut.nc is no result that can be read: it has been cut"):
        run_sweep(STUDY, cut)


def test_a_full_disk_loses_nothing(
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "study.toml").write_text(STUDY.to_toml())
    out, save, saved = tmp_path / "r.nc", np.savez_compressed, []

    def full(*args: object, **kwargs: object) -> None:
        if len(saved) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        saved.append(1)
        save(*args, **kwargs)  # pyright: ignore[reportArgumentType]

    command = ["sweep", str(tmp_path / "study.toml"), "--out", str(out), "--keep-trials"]
    with monkeypatch.context() as patch:
        patch.setattr(np, "savez_compressed", full)
        with pytest.raises(SystemExit) as caught:
            main(command)
    assert caught.value.code == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert "cannot write" in last
    assert "No space left on device" in last
    parts = sorted(path.name for path in (tmp_path / "r.nc.parts").iterdir())
    assert parts == ["0000000000-000000.npz", "0000000020-000000.npz", "study.txt"]
    main(command)
    assert out.read_bytes() == whole.read_bytes()


def test_a_condition_that_cannot_be_run_stays_empty_and_says_why(tmp_path: Path) -> None:
    study = replace(STUDY, sweep=Sweep({"radius": (25.0, 400.0)}))
    plan = Plan(study)
    assert plan.problems[0] == ""
    assert "does not fit" in plan.problems[1]
    assert "1 of them cannot be run" in plan.describe(2)
    data = run_sweep(study, tmp_path / "r.nc")
    assert np.isfinite(data.score.sel(radius=25.0)).all()
    assert np.isnan(data.score.sel(radius=400.0)).all()
    assert int(data.trials_used.sel(radius=400.0)) == 0
    assert "does not fit" in conditions_table(data)
    with pytest.raises(ValueError, match="no condition of the sweep can be run"):
        Plan(replace(STUDY, sweep=Sweep({"radius": (400.0, 500.0)})))


def test_numbers_that_go_together(tmp_path: Path) -> None:
    sweep = Sweep({"gap_width": (180.0, 200.0), "radius": (20.0, 25.0)}, zipped=True)
    data = run_sweep(replace(STUDY, sweep=sweep, units="mm"), tmp_path / "r.nc")
    assert {data.attrs["length_unit"], data.gap.units, data.radius.units} == {"mm"}
    assert dict(data.gap.sizes) == {"condition": 2, "direction": 2}
    np.testing.assert_array_equal(data.radius.values, [20.0, 25.0])
    np.testing.assert_allclose(
        data.gap.sel(direction="does"),
        np.array([180.0, 200.0]) - 200 * np.sin(np.pi / 18),
        rtol=1e-6,
    )
    figure = plot_sweep(data, "gap_width")
    assert figure.axes[0].get_xlabel() == "gap width [mm]"
    with pytest.raises(ValueError, match="go together"):
        plot_sweep(data, "gap_width", hue="radius")


def test_conditions_of_unlike_structure_run_side_by_side(tmp_path: Path) -> None:
    """The period is fixed when compiled; the sweep does not mind."""
    study = replace(STUDY, sweep=Sweep({"period": (10.0, 20.0)}))
    data = run_sweep(study, tmp_path / "r.nc")
    for period in (10.0, 20.0):
        alone = evaluate(
            STUDY.hand,
            STUDY.body,
            drive=WristTilt(period=period),
            trials=60,
            max_steps=20_000,
            seed=3,
        )
        mine = float(data.score.sel(period=period, index="index1", statistic="value"))
        assert mine == alone.score()["index1"].value


def test_a_stick_is_watched(tmp_path: Path) -> None:
    study = replace(
        STUDY,
        body=Stick(25.0),
        run=Run("does", trials=10, max_steps=2000, engine="stepping", dt=0.01),
        sweep=Sweep({"orientation_deg": (0.0, 45.0)}),
    )
    data = run_sweep(study, tmp_path / "r.nc")
    assert (data.penetration < 2e-4 * 25).all()
    assert (data.travel > 0).all()


def test_a_condition_stops_once_it_is_precise_enough(tmp_path: Path) -> None:
    target = 0.03
    study = replace(
        STUDY,
        run=replace(QUICK, trials=400, max_steps=60_000, precision_target=target),
        sweep=Sweep({"fingertip_angle_deg": (0.0, 20.0, 50.0)}),
    )
    data = run_sweep(study, tmp_path / "r.nc", keep_trials=True)
    used = data.trials_used.values
    # The closed hand has nothing to be found out after one block.
    assert used[2] == 20
    assert 20 < used[0] < 400
    assert (used % 20 == 0).all()
    for k, angle in enumerate(data.fingertip_angle_deg.values):
        value, _, low, high = data.score.sel(fingertip_angle_deg=angle, index="index1").values
        assert high - low <= 2 * target * value
        alone = replace(study, run=replace(study.run, trials=int(used[k]))).having(
            {"fingertip_angle_deg": float(angle)}
        )
        again = evaluate(
            alone.hand, alone.body, trials=int(used[k]), max_steps=60_000, seed=3
        ).score()["index1"]
        # Of other blocks: the same program but for rounding.
        assert again.value == pytest.approx(value, rel=1e-6)
    # The first block was not enough.
    short = replace(study, run=replace(study.run, trials=20))
    less = run_sweep(short, tmp_path / "less.nc").sel(fingertip_angle_deg=0.0)
    value, _, low, high = less.score.sel(index="index1").values
    assert high - low > 2 * target * value


def test_a_huge_sweep_is_refused_at_once() -> None:
    many = tuple(float(k) for k in range(1, 1001))
    with pytest.raises(ValueError, match=r"1000 x 1000 = 1,000,000 conditions"):
        Sweep({"radius": many, "gravity": many})


# --------------------------------------------------------------------------------- a cluster


@pytest.mark.usefixtures("programs_for_all")
def test_a_cluster_gives_the_same_file_though_a_worker_dies(whole: Path, tmp_path: Path) -> None:
    """In a process of its own: the cluster's threads and warnings are not this suite's."""
    code = f"""
import os, pathlib, signal, threading, time
from distributed import Client, LocalCluster
import pcjax.sweep.cluster
import pcjax.sweep.plan
import pcjax.sweep.run
from pcjax.study.read import load_study

def main():
    pcjax.sweep.plan.BLOCK = 20
    out = pathlib.Path({str(tmp_path / "r.nc")!r})
    study = load_study({str(tmp_path / "study.toml")!r})
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        pids = [worker.pid for worker in cluster.workers.values()]
        def strike():
            while not list(out.with_name("r.nc.parts").glob("*.npz")):
                time.sleep(0.002)
            os.kill(pids[0], signal.SIGKILL)
        threading.Thread(target=strike, daemon=True).start()
        pcjax.sweep.run.run_sweep(
            study, out, keep_trials=True, scheduler=cluster.scheduler_address
        )
        after = [worker.pid for worker in cluster.workers.values()]
    assert pids[0] not in after, "nobody died"

if __name__ == "__main__":
    main()
"""
    (tmp_path / "study.toml").write_text(STUDY.to_toml())
    (tmp_path / "child.py").write_text(code)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "child.py")],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "r.nc").read_bytes() == whole.read_bytes()


# ------------------------------------------------------------------------------ command line


def test_the_example_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["study", "--example"])
    text = capsys.readouterr().out
    assert text == example()
    study, out = tmp_path / "study.toml", tmp_path / "r.nc"
    main(["study", "--example", str(study)])
    assert study.read_text() == text
    with pytest.raises(SystemExit):
        main(["study", "--example", str(study)])
    assert "there already" in capsys.readouterr().err
    study.write_text(text.replace("trials = 200", "trials = 20"))
    main(["study", str(study)])
    assert "6 conditions, 240 trials" in capsys.readouterr().out
    main(["sweep", str(study), "--out", str(out), "--max-steps", "20000"])
    swept = capsys.readouterr().out
    main(["show", str(out)])
    assert capsys.readouterr().out == swept
    assert len(swept.splitlines()) == 8
    for name in ("a.png", "b.svg"):
        main(["plot", str(out), "--x=radius", "--y=eoen.index1", "--plot", str(tmp_path / name)])
        assert (tmp_path / name).stat().st_size > 5000
    main(["evaluate", str(study), "--trials", "15", "--json"])
    said = capsys.readouterr()
    assert json.loads(said.out)["trials"] == 15
    assert "'pcjax sweep' runs it" in said.err


def test_kept_evaluations_are_shown_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = tmp_path / "e.nc"
    evaluation = evaluate(trials=20, max_steps=5000)
    evaluation.save(kept)
    main(["show", str(kept)])
    assert capsys.readouterr().out.rstrip("\n") == repr(evaluation)
    main(["plot", str(kept), "--plot", str(tmp_path / "e.png")])
    assert (tmp_path / "e.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["plot", "WHOLE", "--x", "raduis", "--plot", "p.png"], "did you mean radius"),
        (["plot", "WHOLE", "--y", "sorce", "--plot", "p.png"], "did you mean score"),
        (["plot", "WHOLE", "--at", "radius=11", "--plot", "p.png"], "radius 11 was not swept"),
        (["plot", "WHOLE", "--at", "radius", "--plot", "p.png"], "has to be like radius=25"),
        (["plot", "WHOLE", "--plot", "p.xyz"], "its ending has to be"),
        (["show", "none.nc"], "does not exist"),
        (["show", "STUDY", "--out", "r.nc"], "unknown flag --out"),
        (["sweep", "STUDY", "--out", "no/r.nc"], "the folder no does not exist"),
        (["sweep", "none.toml", "--out", "r.nc"], "does not exist"),
        (["sweep", "STUDY", "--out", "r.nc", "--precision-target", "0%"], "precision_target"),
        (["sweep", "STUDY", "--out", "r.nc", "--precision-target", "much"], "is not a number"),
        (["sweep", "STUDY", "--out", "r.nc", "--scheduler", "tcp://127.0.0.1:9"], "no scheduler"),
        (["study"], "name a study file"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str],
    told: str,
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pcjax.sweep.cluster, "PATIENCE", 0.5)
    Path("study.toml").write_text(STUDY.to_toml())
    names = {"WHOLE": str(whole), "STUDY": "study.toml"}
    with pytest.raises(SystemExit) as caught:
        main([names.get(word, word) for word in words])
    assert caught.value.code == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert told in lines[-1]
    assert not any("Traceback" in line for line in lines)
