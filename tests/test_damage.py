"""Files that lie: damaged, another's, no files at all. What is read from them is the same as before
the damage, or is done again, or refused in one line that names the file."""

from __future__ import annotations

import functools
import os
import random
import signal
import subprocess
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

import pcjax
import pcjax.results.netcdf
import pcjax.sweep.plan
from pcjax.cli import main
from pcjax.cli.compilation_cache import SealedCache
from pcjax.design.ascent import _can_be
from pcjax.design.checkpoint import Progress, Step, keep_progress, load_progress
from pcjax.results.files import locked, unsealed
from pcjax.results.provenance import conditions, provenance
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.results.schema import dataset_of
from pcjax.simulate.outcomes import Outcomes
from pcjax.study.read import example, load_study
from pcjax.study.spec import Run, Study, Sweep
from pcjax.sweep.plan import Part, Plan
from pcjax.sweep.run import run_sweep
from pcjax.sweep.store import Store

MUTATIONS = int(os.environ.get("PCJAX_MUTATIONS", "60"))
"""Of each kind of file; thousands by hand: PCJAX_MUTATIONS=3000 pytest tests/test_damage.py -s."""

STUDY = Study(
    pcjax.box_hand(),
    pcjax.Circle(25.0),
    pcjax.WristTilt(),
    pcjax.ContactLaw(),
    Run(trials=20, max_steps=5000, seed=3),
    Sweep({"radius": (20.0, 25.0)}),
)


def mutated(content: bytes, draw: random.Random) -> bytes:
    """The content with one damage: a flipped bit, an end cut off, a range of zeros, or bytes put
    in."""
    place = draw.randrange(len(content))
    length = draw.randint(1, 1 + len(content) // 4)
    match draw.choice(("flip", "flip", "cut", "zeros", "insert")):
        case "flip":
            flipped = content[place] ^ 1 << draw.randrange(8)
            return content[:place] + bytes([flipped]) + content[place + 1 :]
        case "cut":
            return content[:place]
        case "zeros":
            zeros = content[place : place + length]
            return content[:place] + bytes(len(zeros)) + content[place + length :]
        case _:
            return content[:place] + draw.randbytes(min(length, 64)) + content[place:]


def outcome(path: Path, read: Callable[[], Any], same: Callable[[Any], bool]) -> str:
    """What became of reading a file: "same", "other", or "refused" in one line that names it."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            found = read()
        except ValueError as error:
            told = str(error)
            assert path.name in told, told
            assert told.isprintable(), told
            return "refused"
    assert not heard, [str(warning.message) for warning in heard]
    return "same" if same(found) else "other"


def damaged(
    path: Path,
    read: Callable[[], Any],
    same: Callable[[Any], bool],
) -> Counter[str]:
    """What became of reading a file under one seeded damage after another."""
    whole = path.read_bytes()
    assert outcome(path, read, same) == "same"
    draw, found = random.Random(1), Counter[str]()
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(whole, draw))
        found[outcome(path, read, same)] += 1
    path.write_bytes(whole)
    print(f"{path.name}: {dict(found)}")
    return found


def made_up(part: Part) -> Outcomes:
    """Outcomes that a part could have, of its name alone."""
    draw = np.random.default_rng(list(part.name.encode()))
    steps = draw.integers(1, part.max_steps, (len(part.cells), part.trials), np.int32)
    return Outcomes(steps, np.ones(steps.shape, np.uint8), part.max_steps)


@contextmanager
def without_running(ran: list[str] | None = None) -> Iterator[None]:
    """Parts give made-up outcomes at once; their names are appended to `ran`."""

    def run(part: Part, workers: int | None = None) -> Outcomes:
        if ran is not None:
            ran.append(part.name)
        return made_up(part)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Part, "run", run)
        patch.setattr(pcjax.sweep.plan, "BLOCK", 10)
        yield


# ------------------------------------------------------------------------------------- results


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small result of every kind, and one as the first version wrote them: without a seal."""
    folder = tmp_path_factory.mktemp("kept")
    with without_running():
        run_sweep(STUDY, folder / "sweep.nc", keep_trials=True)
    scenario = pcjax.does(STUDY.hand, STUDY.body)
    ends = Outcomes(np.full((1, 9), 7, np.int32), np.full((1, 9), 1, np.uint8), 5000)
    settings = {"seed": 3, "engine": "event", "dt": np.nan, "precision": 32, "wall_seconds": 0.5}
    pcjax.Evaluation.from_outcomes({"does": scenario}, ends, settings).save(
        folder / "evaluation.nc"
    )
    old = Path(__file__).parent.parent / "experiments" / "results" / "fig13.nc"
    content = unsealed(old.read_bytes())  # as files were before they were sealed
    assert content is not None
    (folder / "old.nc").write_bytes(content)
    save_dataset(load_dataset(old), folder / "figure.nc")
    save_dataset(made_up_map(), folder / "map.nc")
    return folder


def made_up_map() -> xr.Dataset:
    """A map of four hands."""
    told = {"objective": "index1", "score_name": "DoEs by index1", "hands": 4, "invalid": 0}
    told |= {"seed": 3, "engine": "event", "precision": 32, "max_steps": 5000, "trials": 20}
    told |= {"object_width": 50.0, "wall_seconds": 0.5}
    scenario = pcjax.does(STUDY.hand, STUDY.body)
    return dataset_of(
        "map",
        {
            "score": np.arange(16.0).reshape(2, 2, 1, 4),
            "gap": np.full((2, 2), 200.0),
            "full_cage": np.zeros((2, 2), bool),
            "possible": np.ones((2, 2), bool),
        },
        {"radius": [1.0, 2.0], "gap_width": [3.0, 4.0], "index": ["index1"]},
        provenance(told) | conditions({"does": scenario}),
        place=("radius", "gap_width"),
    )


KINDS = ("sweep", "evaluation", "figure", "map")


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_result_is_refused(kind: str, kept: Path, tmp_path: Path) -> None:
    path = tmp_path / f"{kind}.nc"
    path.write_bytes((kept / path.name).read_bytes())
    before = load_dataset(path)
    found = damaged(path, lambda: load_dataset(path), before.identical)
    assert not found["other"]
    assert found["refused"] > 0.9 * MUTATIONS


def test_a_result_without_a_seal_is_read_or_refused(kept: Path, tmp_path: Path) -> None:
    path = tmp_path / "old.nc"
    whole = (kept / path.name).read_bytes()
    before, third = load_dataset(kept / path.name), len(whole) // 3
    for content, expected in (
        (whole, "same"),
        (whole[:third] + bytes(third) + whole[2 * third :], "refused"),
        (whole[:-1], "refused"),
        (whole + b"\n", "refused"),
    ):
        path.write_bytes(content)
        assert outcome(path, lambda: load_dataset(path), before.identical) == expected


def test_a_result_on_which_hdf5_loops_for_ever_is_refused(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """None loops in every version: one that takes too long stands for it."""
    monkeypatch.setattr(pcjax.results.netcdf, "PATIENCE", 0.01)
    (tmp_path / "old.nc").write_bytes((kept / "old.nc").read_bytes())
    with pytest.raises(ValueError, match=r"old.nc is no result .* HDF5 has not come to an end"):
        load_dataset(tmp_path / "old.nc")
    load_dataset(kept / "figure.nc")  # one with a seal is read here


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("escape_step", -7, "escape_step has values"),
        ("escape_step", 2**31 - 1, "escape_step has values"),
        ("status", 77, "status has values"),
        ("limbs", np.nan, "limbs has values"),
    ],
)
def test_what_no_result_can_hold_is_refused_by_show(
    name: str,
    value: float,
    words: str,
    kept: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    data = load_dataset(kept / "evaluation.nc")
    data[name].values.flat[0] = value
    save_dataset(data, tmp_path / "lies.nc")
    assert words in refused(["show", str(tmp_path / "lies.nc")], capsys)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (kind, name)
        for kind in KINDS
        for name in ("max_steps", "seed", "engine", "direction", "gap", "law", "parameters")
        if name != "direction" or kind in ("sweep", "evaluation")
    ],
)
def test_what_a_result_lacks_is_said(kind: str, name: str, kept: Path, tmp_path: Path) -> None:
    data = load_dataset(kept / f"{kind}.nc")
    if name in data.variables:
        data = data.drop_vars(name)
    else:
        del data.attrs[name]
    save_dataset(data, tmp_path / "lacks.nc")
    with pytest.raises(ValueError, match=rf"lacks.nc is no result .* {name}"):
        load_dataset(tmp_path / "lacks.nc")


def test_a_figure_that_is_none_of_the_papers_is_refused(
    kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = load_dataset(kept / "figure.nc")
    for lies, words in (
        (data.drop_vars("direction"), "direction is missing"),
        (data.assign_attrs(figure="99"), "no figure '99'"),
        (data.assign_coords(theta_1=data.theta_1 + 1), "not those of Fig. 13"),
    ):
        save_dataset(lies, tmp_path / "lies.nc")
        for line in (["show"], ["plot", "--plot", str(tmp_path / "p.png")]):
            said = refused([line[0], str(tmp_path / "lies.nc"), *line[1:]], capsys)
            assert words in said
            assert "lies.nc" in said


def test_a_declared_size_is_not_allocated(kept: Path, tmp_path: Path) -> None:
    path = tmp_path / "huge.nc"
    path.write_bytes((kept / "old.nc").read_bytes())
    with h5py.File(path, "r+") as file:
        file.create_dataset("huge", (200_000_000_000,), "f8", chunks=(1000,))
    with pytest.raises(ValueError, match=r"huge.nc .* declares 1,600,0.* bytes"):
        load_dataset(path)


def test_what_is_no_kind_of_result_is_refused(
    kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = xr.Dataset({"score": ("radius", [1.0])}, attrs=provenance({}))
    save_dataset(other, tmp_path / "other.nc")
    assert (
        "none of an evaluation of one hand, an evaluation of one hand in three dimensions, a sweep"
        in refused(["show", str(tmp_path / "other.nc")], capsys)
    )


# --------------------------------------------------------------------------------------- parts


def test_a_damaged_part_is_done_again(tmp_path: Path) -> None:
    with without_running():
        part = Plan(STUDY).parts(list(Plan(STUDY).cells), 0, 10)[0]
    store = Store(tmp_path / "r.nc", "told")
    store.keep(part, made_up(part))
    path = store.folder / f"{part.name}.npz"

    def same(found: Outcomes | None) -> bool:
        return found is not None and np.array_equal(found.steps, made_up(part).steps)

    found = damaged(path, lambda: store.read(part), same)
    assert not found["other"]
    assert found["refused"] > 0.9 * MUTATIONS


def test_a_sweep_says_what_is_done_again_and_ends_the_same(kept: Path, tmp_path: Path) -> None:
    """Parts that were damaged, are another sweep's or another part's, or of an earlier version."""
    out, ran, told = tmp_path / "sweep.nc", [], []

    def stop(self: Store) -> None:
        raise KeyboardInterrupt

    other = replace(STUDY, run=replace(STUDY.run, seed=4))
    for study, path in ((STUDY, out), (other, tmp_path / "other.nc")):
        with without_running(), pytest.MonkeyPatch.context() as patch:
            patch.setattr(Store, "remove", stop)
            with pytest.raises(KeyboardInterrupt):
                run_sweep(study, path, keep_trials=True)
    out.unlink()
    folder, theirs = tmp_path / "sweep.nc.parts", tmp_path / "other.nc.parts"
    names = sorted(path.name for path in folder.glob("*.npz"))
    assert len(names) == 2
    mine = [(folder / name).read_bytes() for name in names]
    of_old = mine[0][: mine[0].rfind(b"\npcjax sha256")]
    for bad in (mine[0][:-9], (theirs / names[0]).read_bytes(), mine[1], of_old, b""):
        (folder / names[0]).write_bytes(bad)
        ran.clear()
        told.clear()
        with without_running(ran):
            data = run_sweep(STUDY, out, keep_trials=True, tell=told.append)
        assert ran == [names[0].removesuffix(".npz")]
        assert len(told) == 1
        assert names[0] in told[0]
        assert "run again" in told[0]
        assert data.identical(load_dataset(kept / "sweep.nc"))
        assert out.read_bytes() == (kept / "sweep.nc").read_bytes()
        assert not folder.exists()
        out.unlink()
        folder.mkdir()
        for name, content in zip(names, mine, strict=True):
            (folder / name).write_bytes(content)


@pytest.mark.parametrize(
    ("name", "value"), [("steps", 0), ("steps", -7), ("steps", 5001), ("status", 0), ("status", 77)]
)
def test_a_part_with_what_no_trial_can_end_as_is_done_again(
    name: str, value: int, tmp_path: Path
) -> None:
    part = Plan(STUDY).parts(list(Plan(STUDY).cells), 0, 10)[0]
    store, outcomes = Store(tmp_path / "r.nc", "told"), made_up(part)
    getattr(outcomes, name)[0, 0] = value
    store.keep(part, outcomes)
    with pytest.raises(ValueError, match="holds what no trial can end as"):
        store.read(part)


def test_a_damaged_study_txt_refuses_the_sweep(tmp_path: Path) -> None:
    Store(tmp_path / "r.nc", "told")
    of = tmp_path / "r.nc.parts" / "study.txt"
    found = damaged(of, lambda: Store(tmp_path / "r.nc", "told"), lambda _: True)
    assert found["refused"] == MUTATIONS


# -------------------------------------------------------------------------- studies, checkpoints


def test_a_damaged_study_is_read_or_refused(tmp_path: Path) -> None:
    """A study is written by hand: what is still one may ask for something else."""
    path = tmp_path / "study.toml"
    path.write_text(example())
    before = load_study(path).to_toml()
    damaged(path, lambda: load_study(path).to_toml(), lambda text: text == before)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[hand]\nlengths = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("[hand]\nlengths = " + "[" * 80 + "]" * 80, "two lists of numbers"),
        (f"[body]\nradius = 1{'0' * 400}", "radius is inf"),
        (f"[sweep]\nradius = [1{'0' * 400}]", "inf"),
        (f"[sweep]\nradius = {{ from = 0, to = 5, step = 1{'0' * 400} }}", "radius"),
        (f"[run]\ntrials = 0x{'f' * 5000}", "4300 digits"),
        (f"[run]\ntrials = 1{'0' * 5000}", "4300"),
        ('["a\\nb"]\n', "a.nb"),
        ('[body]\nkind = """a\nb"""', "kind is 'a.nb'"),
    ],
)
def test_a_strange_study_is_refused_in_a_line(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match=words) as caught:
        load_study(path)
    assert str(caught.value).startswith(str(path))
    assert str(caught.value).isprintable()


BLANK = Progress([[]], [[1.0, 2.0]], [[0, [0.0, 0.0]]], stopped=[False])
POSSIBLE = functools.partial(_can_be, blank=BLANK)
STATE = replace(
    BLANK, history=[[Step([1.0, 2.0], 0.5, 0.1, [0.1, float("nan")], [0.2, 0.3])]], trials=9
)


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    keep_progress(path, "told", STATE)
    found = damaged(
        path,
        lambda: load_progress(path, "told", POSSIBLE),
        lambda state: repr(state) == repr(STATE),
    )
    assert not found["other"]
    assert found["refused"] > 0.7 * MUTATIONS


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[" * 100_000,
        '{"state": null}',
        '{"of": "told", "state": null, "sha256": ""}',
        '{"of": "told", "state": {"history": []}, "sha256": 3}',
    ],
)
def test_what_is_no_checkpoint_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"state.json is no checkpoint of an optimisation"):
        load_progress(path, "told", POSSIBLE)


@pytest.mark.parametrize(
    "changed",
    [
        {"designs": [[1.0]]},
        {"designs": [[1.0, float("inf")]]},
        {"state": [[0, [0.0]]]},
        {"history": []},
        {"trials": -1},
        {"seconds": float("nan")},
        {"stopped": [0]},
    ],
)
def test_a_checkpoint_with_what_cannot_be_is_refused(
    changed: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / "state.json"
    keep_progress(path, "told", replace(STATE, **changed))
    with pytest.raises(ValueError, match=r"state.json is no checkpoint"):
        load_progress(path, "told", POSSIBLE)


# ------------------------------------------------------------------------------------- programs


def test_a_damaged_program_is_not_run_but_replaced(tmp_path: Path) -> None:
    cache, program = SealedCache(tmp_path), random.Random(0).randbytes(500)
    cache.put("key", program)
    path = tmp_path / "key-cache"
    whole, draw = path.read_bytes(), random.Random(1)
    for _ in range(MUTATIONS):
        path.write_bytes(bad := mutated(whole, draw))
        assert cache.get("key") == (program if bad == whole else None)
    cache.put("key", program)
    assert cache.get("key") == program
    (tmp_path / "other-cache").write_bytes(whole)
    assert cache.get("other") is None
    assert cache.get("none") is None


# ------------------------------------------------------------------------- locks, pipes, signals


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The line with which a command refuses."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as caught:
        main(words)
    lines = capsys.readouterr().err.splitlines()
    assert caught.value.code == 2
    assert len(lines) == 1, lines
    return lines[0]


def test_a_file_is_written_by_one_process_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "r.nc"
    with locked(path):
        with pytest.raises(ValueError, match=r"r.nc is being written by another process"):
            run_sweep(STUDY, path)
        with locked(tmp_path / "another.nc"):
            pass
    assert not list(tmp_path.iterdir())
    with locked(path):
        pass


def test_a_crash_releases_the_lock(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    code = (
        "import sys, time; from pathlib import Path; from files import locked\n"
        "with locked(Path(sys.argv[1])): print('here', flush=True); time.sleep(600)"
    )
    command = [sys.executable, "-c", code, str(path)]
    alone = {
        **os.environ,
        "PYTHONPATH": str(Path(pcjax.__file__).parent / "results"),
    }  # without JAX: at once
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=alone) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "here\n"
        part = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
        space = pcjax.design_space(pcjax.box_hand(), ["fingertip_angle_deg"], 50.0)
        with pytest.raises(ValueError, match=r"state.json is being written by another process"):
            pcjax.optimize(pcjax.Surrogate(part), space, checkpoint=path)
        child.kill()
    with locked(path):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no named pipes")
@pytest.mark.parametrize("what", ["pipe", "folder", "/dev/zero"])
def test_what_is_no_plain_file_is_refused(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(what) if what.startswith("/") else tmp_path / what
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    (tmp_path / "study.toml").write_text(STUDY.to_toml())
    study, picture = str(tmp_path / "study.toml"), str(tmp_path / "p.png")
    for words in (
        ["show", str(path)],
        ["plot", str(path), "--plot", picture],
        ["study", str(path)],
        ["evaluate", str(path)],
        ["sweep", str(path), "--out", str(tmp_path / "r.nc")],
        ["sweep", study, "--out", str(path)],
        ["optimize", "--checkpoint", str(path)],
        ["map", "--out", f"{path}"],
    ):
        assert str(path) in refused(words, capsys)


def test_sigterm_says_what_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "study.toml").write_text(STUDY.to_toml())
    before, keep = signal.getsignal(signal.SIGTERM), Store.keep

    def keep_and_end(self: Store, part: Part, outcomes: Outcomes) -> None:
        keep(self, part, outcomes)
        signal.raise_signal(signal.SIGTERM)

    out = tmp_path / "r.nc"
    with without_running(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "keep", keep_and_end)
        with pytest.raises(SystemExit) as caught:
            main(["sweep", str(tmp_path / "study.toml"), "--out", str(out)])
    assert caught.value.code == 143
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"pcjax: terminated; what was finished is kept in {out}.parts; the same command goes on "
        "where it was"
    )
    assert signal.getsignal(signal.SIGTERM) is before
    left = ["0000000000-000000.npz", "r.nc.parts", "study.toml", "study.txt"]
    assert sorted(path.name for path in tmp_path.rglob("*")) == left
