"""The command line: its contract, its files, and one clear line for everything it refuses."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread

import pcjax
from pcjax.cli import main
from pcjax.cli.compilation_cache import OLDEST_JAX, cache_folder, use_compilation_cache
from pcjax.paper import constants as paper
from pcjax.paper.claims import FIGURES_NEEDED, judge_claims
from pcjax.paper.figures import run_figure
from pcjax.results.saving import save_dataset
from pcjax.study import Study
from pcjax.view.plots import plot_evaluation

pytestmark = pytest.mark.usefixtures("quick_programs")

# A wide gate and inclined fingertips: within 50 s about half of the trials pass.
SMALL = "--trials 64 --max-steps 50_000 --fingertip-angle -20 --gap-width 400"
TINY_FIGURE = "--trials 2 --max-steps 60_000"
NUMBERS = ("value", "se", "low", "high")


class Done(NamedTuple):
    """What a command left: exit status, stdout and stderr."""

    code: int
    out: str
    err: str


Command = Callable[..., Done]


@pytest.fixture
def command(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Command:
    """Runs a command line in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(line: str) -> Done:
        code: Any = 0
        try:
            main(shlex.split(line))
        except SystemExit as end:
            code = end.code
        out, err = capfd.readouterr()
        return Done(code, out, err)

    return run


def check_value(value: dict[str, Any]) -> None:
    assert tuple(value) == NUMBERS
    assert all(type(number) is float for number in value.values())
    assert value["low"] <= value["value"] <= value["high"]
    assert value["se"] >= 0


def check_json(told: dict[str, Any], directions: tuple[str, ...]) -> None:
    """The object that `--json` promises, to the last key."""
    both = ("score",) if len(directions) == 2 else ()
    plain = ("trials", "seed", "engine", "status", "wall_seconds", "notes")
    assert set(told) == {*directions, *both, *plain}
    for name in (*directions, *both):
        assert set(told[name]) == {"index1", "index2"}
        for value in told[name].values():
            check_value(value)
    assert set(told["status"]) == set(directions)
    for counts in told["status"].values():
        assert set(counts) == {"passed", "limit", "invalid"}
        assert all(type(count) is int for count in counts.values())
        assert sum(counts.values()) == told["trials"]
    assert type(told["trials"]) is type(told["seed"]) is int
    assert type(told["engine"]) is str
    assert type(told["wall_seconds"]) is float
    assert told["wall_seconds"] > 0
    assert all(type(note) is str for note in told["notes"])


def one_object(done: Done) -> dict[str, Any]:
    """The one JSON object on stdout; nothing else may be on either stream."""
    assert (done.code, done.err) == (0, "")
    assert done.out.endswith("\n")
    # A number that JSON does not know (NaN) would get through `json.loads`.
    return json.loads(done.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))


def numbers(told: dict[str, Any]) -> dict[str, Any]:
    """All but the time it took."""
    return {key: value for key, value in told.items() if key != "wall_seconds"}


# ------------------------------------------------------------------------------------- evaluate


def test_json_is_one_object_of_the_promised_shape(command: Command):
    told = one_object(command(f"evaluate --json {SMALL}"))
    check_json(told, ("does", "eoen"))
    assert (told["trials"], told["seed"], told["engine"]) == (64, 0, "event")
    for name, index in (("index1", 50_000), ("index2", 1)):
        does, eoen = (told[direction][name]["value"] for direction in ("does", "eoen"))
        assert 0 < does < index
        assert told["score"][name]["value"] == pytest.approx(does / eoen, rel=1e-12)


@pytest.mark.parametrize("direction", ["does", "eoen"])
def test_one_direction_has_neither_the_other_nor_the_score(command: Command, direction: str):
    told = one_object(command(f"evaluate --json --direction {direction} {SMALL}"))
    check_json(told, (direction,))
    # It is the same run as that of both directions.
    both = one_object(command(f"evaluate --json {SMALL}"))
    assert told[direction] == both[direction]


def program(line: str, folder: Path, **environment: str) -> Done:
    """Runs a command line as a program of its own in `folder`."""
    done = subprocess.run(
        [sys.executable, "-m", "pcjax", *shlex.split(line)],
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | environment,
        timeout=120,
        check=False,
    )
    return Done(done.returncode, done.stdout, done.stderr)


@pytest.mark.skipif(jax.__version_info__ < OLDEST_JAX, reason="nothing is kept")
def test_kept_programs_change_no_number_and_print_nothing(command: Command, tmp_path: Path):
    # Few trials of a few steps: this is about where programs are kept.
    line = "evaluate --trials 4 --max-steps 2000 --direction does --json"
    timed = "wall_seconds"
    compiled = one_object(command(line)) | {timed: 0}
    cache = tmp_path / "cache"

    def with_cache(folder: Path) -> dict[str, Any]:
        return one_object(program(line, tmp_path, PCJAX_CACHE=str(folder))) | {timed: 0}

    def kept() -> dict[str, int]:
        return {path.name: path.stat().st_mtime_ns for path in cache.iterdir()}

    assert with_cache(cache) == compiled
    entries = kept()
    assert any(name.startswith("advance_block") for name in entries)
    # As another process would see it that reads while this one writes.
    small = min(cache.iterdir(), key=lambda path: path.stat().st_size)
    whole = small.read_bytes()
    small.write_bytes(whole[:-100])
    assert with_cache(cache) == compiled
    assert len(small.read_bytes()) == len(whole)
    assert kept() | {small.name: 0} == entries | {small.name: 0}

    assert [path.name for path in tmp_path.iterdir()] == ["cache"]


def test_where_programs_cannot_be_kept_none_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    configured = jax.config.values["jax_compilation_cache_dir"]
    (tmp_path / "plain").write_text("a file, not a folder")
    monkeypatch.setenv("PCJAX_CACHE", str(tmp_path / "plain" / "cache"))
    try:
        jax.config.update("jax_compilation_cache_dir", None)
        use_compilation_cache()
        assert jax.config.values["jax_compilation_cache_dir"] is None
    finally:
        jax.config.update("jax_compilation_cache_dir", configured)


@pytest.mark.parametrize(
    ("platform", "environment", "folder"),
    [
        ("linux", {}, "~/.cache/pcjax"),
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches/pcjax"),
        ("linux", {"XDG_CACHE_HOME": "not/absolute"}, "~/.cache/pcjax"),
        ("darwin", {}, "~/Library/Caches/pcjax"),
        ("win32", {}, "~/AppData/Local/pcjax"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local/pcjax"),
        ("linux", {"PCJAX_CACHE": ""}, "~/.cache/pcjax"),
        ("linux", {"PCJAX_CACHE": "/elsewhere"}, "/elsewhere"),
        ("linux", {"PCJAX_CACHE": "~/mine"}, "~/mine"),
        ("linux", {"PCJAX_CACHE": "off"}, None),
    ],
)
def test_programs_are_kept_where_the_user_keeps_caches(
    monkeypatch: pytest.MonkeyPatch,
    platform: str,
    environment: dict[str, str],
    folder: str | None,
):
    monkeypatch.setattr(sys, "platform", platform)
    for name in ("PCJAX_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert cache_folder() == (folder and Path(folder).expanduser())


def test_the_same_seed_repeats_and_another_changes_the_numbers(command: Command):
    first, again, other = (
        numbers(one_object(command(f"evaluate --json {SMALL} --seed {seed}"))) for seed in (5, 5, 6)
    )
    assert again == first
    assert other["seed"] == 6
    for direction in ("does", "eoen"):
        assert other[direction]["index1"]["value"] != first[direction]["index1"]["value"]


def test_the_flags_reach_the_simulation(command: Command):
    flags = (
        "--palm-length 510 --gap-width 390 --fingertip-length 90 --fingertip-angle -15 "
        "--radius 24 --restitution 0.2 --gravity 9.7"
    )
    told = one_object(
        command(f"evaluate --json {flags} --trials 64 --max-steps 60,000 --seed 9 --dt 0.02")
    )
    by_hand = pcjax.evaluate(
        pcjax.box_hand(
            math.radians(-15.0), palm_length=510.0, gap_width=390.0, fingertip_length=90.0
        ),
        pcjax.Circle(24.0),
        drive=pcjax.WristTilt(gravity=9.7),
        law=pcjax.ContactLaw(restitution=0.2),
        trials=64,
        max_steps=60_000,
        seed=9,
        dt=0.02,
    )
    assert numbers(told) == numbers(by_hand.as_json())


def test_flags_win_over_a_study_file(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    kept: list[Study] = []

    def record(study: Study, **_: Any) -> pcjax.Evaluation:
        kept.append(study)
        return pcjax.evaluate(trials=64, max_steps=50_000)

    monkeypatch.setattr("pcjax.cli.evaluate.evaluate_study", record)
    (tmp_path / "own.toml").write_text(
        "[hand]\npalm_length = 400\nlengths = [[350, 120, 90], [300, 140, 60]]\n"
        "angles_deg = [[90, 90, 75], [80, 95, 50]]\n[body]\nradius = 12\n[run]\nseed = 3\n"
    )
    line = "evaluate own.toml --direction does"
    flags = "--radius 15 --gravity 5 --fingertip-angle 20 --body stick --orientation 30 --seed 4"
    assert command(f"{line} {flags}").code == 0
    told = kept[-1]
    assert told.run.seed == 4
    assert isinstance(told.body, pcjax.Stick)
    assert told.body.half_length == 15
    assert told.body.orientation == pytest.approx(math.radians(30))
    assert isinstance(told.drive, pcjax.WristTilt)
    assert told.drive.gravity == 5
    assert told.hand.lengths[1][1] == 140
    for angles in told.hand.angles:
        assert angles[2] == pytest.approx(math.radians(70))
    check_refused(command(f"{line} --joint-angles 65 90"), "--joint-angles", "two chains")
    # A fault of a flag is no fault of a line in the file.
    check_refused(command(f"{line} --radius -1"), "pcjax: --radius is -1")
    # Another kind of hand takes the place of the chains.
    assert command(f"{line} --hand box --fingertip-angle 20").code == 0
    assert kept[-1].hand.palm_length == 400
    assert kept[-1].hand.lengths[0][2] == 80


def test_lengths_that_are_not_given_follow_the_palm(command: Command):
    # With g scaled as well, twice the size is the same motion in the same time, but for impacts
    # about the resting speed, which is a speed of its own.
    small, large = (
        numbers(
            one_object(
                command(
                    "evaluate --json --trials 64 --max-steps 100_000 --dt 0.02 "
                    f"--palm-length {500 * scale} --gravity {9.8 * scale}"
                )
            )
        )
        for scale in (1, 2)
    )
    for direction in ("does", "eoen"):
        assert large[direction]["index1"]["value"] == pytest.approx(
            small[direction]["index1"]["value"], rel=0.02
        )


def test_a_hand_has_the_same_indices_in_mm_and_in_m(command: Command):
    line = "evaluate --json --trials 64 --max-steps 50_000 --fingertip-angle -20"
    mm, metres = (
        one_object(
            command(
                f"{line} --units {units} --palm-length {palm} --gap-width {gap} --out {units}.nc"
            )
        )
        for units, palm, gap in (("mm", 90, 72), ("m", 0.09, 0.072))
    )
    kept = pcjax.Evaluation.load("mm.nc")
    assert kept.dataset.attrs["length_unit"] == "mm"
    for name in ("limbs", "goal", "passage", "gap", "start", "outline"):
        assert kept.dataset[name].units == "mm"
    axis = plot_evaluation(kept).axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("x [mm]", "y [mm]")
    for direction in ("does", "eoen"):
        assert mm["status"][direction]["passed"] > 8
        # Rounding to 32 bits may tell a few of the trials apart.
        assert mm[direction]["index1"]["value"] == pytest.approx(
            metres[direction]["index1"]["value"], rel=0.02
        )


def test_flags_say_the_unit_and_win_over_the_file(command: Command, tmp_path: Path):
    limbs = "lengths = [[80, 30], [80, 25]]\nangles_deg = [[90, 90], [90, 80]]"
    own = f"[hand]\npalm_length = 80\n{limbs}"
    (tmp_path / "own.toml").write_text(f'[units]\nlength = "m"\n{own}')
    for flags, units in (("", "m"), ("--units cm", "cm"), ("--units model", "model")):
        assert one_object(command(f"inspect own.toml --json {flags}"))["units"] == units
    assert command("inspect own.toml --units mm").out.startswith("units    mm, gravity 9800 of")
    (tmp_path / "own.toml").write_text(own)
    done = command("inspect own.toml")
    assert done.code == 0
    assert done.err.startswith("pcjax: own.toml: [hand] palm_length is 80 in the paper's model")
    assert '"mm" as [units] length says so' in done.err
    assert '"mm" as --units says so' in command("inspect --palm-length 80").err
    check_refused(command("evaluate --units mm"), "--palm-length is missing", "lengths are in mm")


def test_the_arms_flags_reach_the_simulation(command: Command):
    told = one_object(
        command(
            "evaluate --json --scenario arm --body stick --joint-angles 60 100 --orientation 30 "
            "--radius 40 --gravity 9.7 --restitution 0.2 --trials 40 --max-steps 12_000 --dt 0.02"
        )
    )
    by_hand = pcjax.evaluate(
        pcjax.two_joint_hand(math.radians(60), math.radians(100)),
        pcjax.Stick(40.0, math.radians(30)),
        drive=pcjax.PlanarArm(gravity=9.7),
        law=pcjax.ContactLaw(restitution=0.2),
        trials=40,
        max_steps=12_000,
        dt=0.02,
    )
    assert numbers(told) == numbers(by_hand.as_json())
    assert set(told["stick"]) == {"does"}
    stick = told["stick"]["does"]
    assert set(stick) == {"penetration", "travel", "undone", "skin"}
    assert 0 <= stick["penetration"] < stick["skin"] == pytest.approx(0.008)
    assert 0 < stick["travel"] < 20


def test_defaults_of_the_arm(command: Command):
    told = one_object(command("evaluate --json --scenario arm --trials 40 --dt 0.02"))
    hand = pcjax.two_joint_hand(math.radians(65), math.radians(90))
    by_hand = pcjax.evaluate(
        hand,
        pcjax.Circle(50.0),
        drive=pcjax.PlanarArm(),
        direction="does",
        trials=40,
        max_steps=300_000,
        dt=0.02,
    )
    assert numbers(told) == numbers(by_hand.as_json())


def test_every_setting_of_a_run_is_handed_on(command: Command, monkeypatch: pytest.MonkeyPatch):
    handed: dict[str, Any] = {}

    def record(study: Study, **_: Any) -> pcjax.Evaluation:
        handed.update(vars(study.run))
        return pcjax.evaluate(trials=64, max_steps=50_000)

    monkeypatch.setattr("pcjax.cli.evaluate.evaluate_study", record)
    line = (
        "evaluate --json --direction both --trials 1_000 --max-steps 70,000 --seed 8 "
        "--engine stepping --dt 1e-3 --precision 64"
    )
    one_object(command(line))
    expected = {
        "direction": "both",
        "trials": 1000,
        "max_steps": 70_000,
        "seed": 8,
        "engine": "stepping",
        "dt": 0.001,
        "precision": 64,
    }
    assert {name: handed[name] for name in expected} == expected


def test_a_gap_narrower_than_the_object_is_a_full_cage(command: Command):
    told = one_object(
        command("evaluate --json --gap-width 40 --radius 25 --trials 64 --max-steps 50_000")
    )
    check_json(told, ("does", "eoen"))
    for direction in ("does", "eoen"):
        assert told[direction]["index2"]["value"] == 1
        assert told["status"][direction] == {"passed": 0, "limit": 64, "invalid": 0}
    assert any("full cage" in note for note in told["notes"])
    printed = command("evaluate --gap-width 40 --radius 25 --trials 64 --max-steps 50_000")
    assert printed.code == 0
    assert "full cage" in printed.out


def test_without_json_a_table_is_printed(command: Command):
    done = command(f"evaluate {SMALL}")
    assert (done.code, done.err) == (0, "")
    told = numbers(one_object(command(f"evaluate --json {SMALL}")))
    for name, row in (("DoEs", "does"), ("EoEn", "eoen")):
        assert name in done.out
        assert f"{told[row]['index1']['value']:,.0f}" in done.out
    assert f"{told['score']['index1']['value']:.4f}" in done.out


def test_files_are_written_and_can_be_read(command: Command, tmp_path: Path):
    done = command(f"evaluate --json {SMALL} --out run.nc --plot hand.png")
    told = one_object(done)
    check_json(told, ("does", "eoen"))
    loaded = pcjax.Evaluation.load(tmp_path / "run.nc")
    assert loaded.as_json() == told
    height, width, channels = imread(tmp_path / "hand.png").shape
    assert height >= 300
    assert width > height
    assert channels in (3, 4)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["hand.png", "run.nc"]


@pytest.mark.parametrize("flags", ["--direction does", "--gap-width 40", "--max-steps 1"])
def test_every_kind_of_result_can_be_drawn(command: Command, tmp_path: Path, flags: str):
    assert command(f"evaluate {SMALL} {flags} --plot hand.png").code == 0
    assert imread(tmp_path / "hand.png").ndim == 3


@pytest.mark.parametrize("ending", ["svg", "pdf", "jpg", "webp", "PNG"])
def test_pictures_of_other_kinds(command: Command, tmp_path: Path, ending: str):
    done = command(f"evaluate {SMALL} --plot hand.{ending}")
    assert (done.code, done.err) == (0, "")
    (picture,) = tmp_path.iterdir()
    assert picture.name == f"hand.{ending}"
    begins = {"svg": b"<?xml", "pdf": b"%PDF", "jpg": b"\xff\xd8", "webp": b"RIFF"}
    assert picture.read_bytes().startswith(begins.get(ending, b"\x89PNG"))


def test_no_command_prints_the_help(command: Command):
    done = command("")
    assert (done.code, done.err) == (0, "")
    for name in ("evaluate", "optimize", "map", "animate", "export", "figure", "claims"):
        assert name in done.out


def test_the_version_is_printed(command: Command):
    done = command("--version")
    assert (done.code, done.err) == (0, "")
    assert re.fullmatch(r"pcjax \d+\.\d+\S*\n", done.out)


def test_an_interruption_is_one_line_and_status_130(
    command: Command, monkeypatch: pytest.MonkeyPatch
):
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pcjax.cli.evaluate.evaluate_study", interrupted)
    done = command("evaluate")
    assert (done.code, done.out) == (130, "")
    assert len(done.err.splitlines()) == 1


# ------------------------------------------------------------------------------------- optimize

QUICK_OPTIMUM = "optimize --iterations 2 --trials 40 --accept-trials 60 --max-steps 20_000"


def test_optimize_prints_one_object_and_keeps_a_hand_that_evaluate_reads(
    command: Command, tmp_path: Path
):
    line = f"{QUICK_OPTIMUM} --method gradient --json --checkpoint state.json"
    told = one_object(command(f"{line} --out best.toml --plot best.png"))
    assert list(told) == [
        *("start", "best", "improvement", "candidates", "certainty", "conditions"),
        *("iterations", "trials", "invalid", "refused", "interrupted", "wall_seconds", "notes"),
    ]
    assert (told["notes"], told["interrupted"]) == ([], False)
    assert told["start"].pop("moved") is False
    assert told["invalid"] == 0
    for side in ("start", "best"):
        assert set(told[side]) == {"parameters", "score"}
        assert set(told[side]["parameters"]) == {"fingertip_angle_deg", "fingertip_length"}
        assert tuple(told[side]["score"]) == NUMBERS
    assert tuple(told["improvement"]) == NUMBERS
    assert told["start"]["parameters"]["fingertip_angle_deg"] == pytest.approx(10)
    assert told["start"]["parameters"]["fingertip_length"] == pytest.approx(100)
    assert told["iterations"] == 2
    gain = told["best"]["score"]["value"] - told["start"]["score"]["value"]
    assert told["improvement"]["value"] == pytest.approx(gain)
    # 2 iterations of 5 hands, 1 checkpoint, and the comparison of 2 hands.
    assert told["trials"] == 2 * (2 * 5 * 40 + 1000 + 2 * 60)
    assert (told["certainty"], len(told["candidates"])) == (1.0, 1)
    assert told["candidates"][0]["score"] == told["best"]["score"]
    assert told["conditions"] == []
    assert np.ptp(imread(tmp_path / "best.png")) > 0.5
    # The trials of an iteration are none of the study's.
    assert pcjax.load_study(tmp_path / "best.toml").trials == 5000
    same = one_object(command(line))
    assert same["best"] == told["best"]
    evaluated = one_object(command("evaluate best.toml --json --trials 40 --max-steps 20_000"))
    hand = pcjax.box_hand(
        math.radians(told["best"]["parameters"]["fingertip_angle_deg"]),
        fingertip_length=told["best"]["parameters"]["fingertip_length"],
    )
    by_hand = pcjax.evaluate(hand, trials=40, max_steps=20_000)
    assert numbers(evaluated) == numbers(by_hand.as_json())


@pytest.mark.parametrize(
    "flags",
    [
        "--method grid --grid-points 2 --free fingertip-angle=-10:10",
        "--method cma --free fingertip-angle-1 --free fingertip-length-2=50:120",
        "--method gradient --estimator axial --objective escape_rate --starts 2 --free gap-width",
        "--method gradient --estimator evolution --form exact --objective index2 "
        "--free link-length-1",
        "--objective index2 --free fingertip-length --free gap-width --limit 'gap-width <= 250'",
        "--scenario arm --max-steps 20_000",
    ],
)
def test_ways_to_optimize(command: Command, flags: str):
    done = command(f"{QUICK_OPTIMUM} {flags}")
    assert (done.code, done.err) == (0, "")
    assert re.search(r"^improvement: ", done.out, re.MULTILINE)
    assert re.search(r"better", done.out)


def test_a_start_outside_the_bounds_is_named_and_compared_with(command: Command):
    done = command(f"{QUICK_OPTIMUM} --free fingertip-angle=20:30 --json")
    (line,) = done.err.splitlines()
    assert line.startswith("pcjax: the given hand is not an allowed one")
    assert "fingertip_angle is 10 deg, outside 20 to 30 deg" in line
    told = json.loads(done.out)
    assert told["start"]["parameters"]["fingertip_angle_deg"] == pytest.approx(10)
    assert told["start"]["moved"] is False
    assert [f"pcjax: {note}" for note in told["notes"]] == [line]


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ("--fingertip-angle 1090", "--fingertip-angle is 1090 deg, more than a turn"),
    ],
)
def test_a_slip_of_units_is_one_line_and_no_failure(
    command: Command, tmp_path: Path, flags: str, words: str
):
    done = command(f"export {flags} --plot hand.svg")
    assert done.code == 0
    (line,) = done.err.splitlines()
    assert line.startswith(f"pcjax: {words}")
    assert (tmp_path / "hand.svg").exists()


# ------------------------------------------------------------------------------------ completion


def test_completion_offers_commands_flags_and_choices(command: Command, tmp_path: Path) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("there is no bash")
    (tmp_path / "complete.sh").write_text(command("completion bash").out)
    script = (
        f"source {tmp_path / 'complete.sh'}\n"
        'COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 )); _pcjax; echo "${COMPREPLY[@]}"'
    )
    for words, offered in (
        (["pcjax", "ev"], "evaluate"),
        (["pcjax", "evaluate", "--fing"], "--fingertip-angle --fingertip-length"),
        (["pcjax", "evaluate", "--engine", ""], "auto event stepping convex mujoco"),
        (["pcjax", "figure", "9"], "9a 9b"),
        (["pcjax", "evaluate", "nothing"], ""),
    ):
        done = subprocess.run(
            [bash, "-c", script, "bash", *words], capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == offered
    zsh, fish = (command(f"completion {shell}").out for shell in ("zsh", "fish"))
    assert "bashcompinit" in zsh
    assert "-n '__fish_seen_subcommand_from evaluate' -l body -r -a 'circle stick polygon" in fish


# ------------------------------------------------------------------------- map, animate, export

SMALL_MAP = "map --points 3 2 --trials 20 --max-steps 20_000"


def test_a_map_is_one_object_a_picture_and_its_data(command: Command, tmp_path: Path):
    done = command(f"{SMALL_MAP} --x fingertip-angle=-20:40 --y gap-width=40:200 --json --out m.nc")
    assert (done.code, done.err.count("\n")) == (0, 1)
    assert "3 of 6 hands" in done.err
    told = json.loads(done.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
    assert told["x"] == {"parameter": "fingertip_angle_deg", "values": [-20, 10, 40]}
    assert told["y"] == {"parameter": "gap_width", "values": [40, 200]}
    # A gap of 40 is too narrow for a diameter of 50, the paper's is not.
    assert told["score"][0] == [None] * 3
    assert all(told["full_cage"][0])
    assert told["current"]["score"]["value"] == told["score"][1][1]
    assert told["best"]["score"]["value"] == max(told["score"][1])
    assert told["hands"] == 3
    assert imread(tmp_path / "map.png").ndim == 3
    data = xr.load_dataset(tmp_path / "m.nc", engine="h5netcdf")
    assert data.score.sel(index="index1", statistic="value")[1].values.tolist() == told["score"][1]
    assert (data.attrs["trials"], data.attrs["seed"]) == (20, 0)


def test_a_map_of_the_arm_as_text_and_a_table(command: Command, tmp_path: Path):
    done = command(f"{SMALL_MAP} --scenario arm --objective escape_rate --plot m.svg --out m.csv")
    assert done.code == 0
    assert re.search(r"^best .*joint_angle_1", done.out, re.MULTILINE)
    assert re.search(r"^current .*joint_angle_1 65 deg", done.out, re.MULTILINE)
    rows = (tmp_path / "m.csv").read_text().splitlines()
    assert rows[0] == "joint_angle_2_deg,joint_angle_1_deg,score,se,gap,full_cage,possible"
    assert len(rows) == 1 + 6


def test_animate_says_which_trial_and_when_it_ended(command: Command, tmp_path: Path):
    line = "animate --gap-width 400 --fingertip-angle -20 --seconds 1 --fps 5 --plot film.gif"
    done = command(f"{line} --seed 2 --max-steps 100_000 --dt 0.04")
    assert (done.code, done.err) == (0, "")
    told = re.search(r"trial (\d+) of seed 2 .*escaped in step ([\d,]+)", done.out)
    assert told
    trial, step = (int(text.replace(",", "")) for text in told.groups())
    counted = pcjax.evaluate(
        pcjax.box_hand(math.radians(-20), gap_width=400.0),
        direction="does",
        engine="stepping",
        dt=0.04,
        trials=trial + 1,
        seed=2,
        max_steps=100_000,
    )
    assert counted.dataset.escape_step.values[0, trial] == pytest.approx(step, abs=1)
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF89a")
    done = command(f"{line} --direction eoen --trial 1 --max-steps 1000")
    assert "EoEn, trial 1 of seed 0: still inside at the limit, step 1,000 (1.000 s)" in done.out


def test_export_reads_a_study_file(command: Command, tmp_path: Path):
    study = pcjax.study.Study(
        pcjax.box_hand(), pcjax.Stick(20.0), pcjax.WristTilt(), pcjax.ContactLaw()
    )
    (tmp_path / "hand.toml").write_text(study.to_toml())
    for ending in ("svg", "dxf"):
        done = command(f"export hand.toml --thickness 8 --with-object --plot hand.{ending}")
        assert (done.code, done.err) == (0, "")
        by_hand = pcjax.export_hand(
            replace(study.hand, thickness=8), tmp_path / f"own.{ending}", body=study.body
        )
        if ending == "svg":
            assert (tmp_path / "hand.svg").read_text() == by_hand.read_text()
        assert "OUTLINES" in (tmp_path / f"hand.{ending}").read_text()


def test_a_drawn_hand_becomes_a_study(command: Command, tmp_path: Path):
    hand = pcjax.HandDesign(90.0, ((80.0,), (70.0, 40.0)), ((1.5,), (1.6, 1.4)), 6.0)
    for ending, units in (("svg", "mm"), ("dxf", "cm")):
        pcjax.export_hand(hand, f"hand.{ending}", units=units)
        done = command(f"study --hand hand.{ending}")
        assert (done.code, done.err) == (0, "")
        (tmp_path / f"{ending}.toml").write_text(done.out)
        study = pcjax.load_study(tmp_path / f"{ending}.toml")
        assert study.units == units
        assert study.body == pcjax.Circle(4.5)  # 0.05 of the palm
        assert study.drive.gravity == pytest.approx({"mm": 9800, "cm": 980}[units])
        np.testing.assert_allclose(jax.tree.leaves(study.hand), jax.tree.leaves(hand), rtol=1e-9)
    # One may say the rest, and where it goes.
    line = "study --hand hand.dxf own.toml --units mm --palm 3 --thickness 2 --radius 5"
    assert command(line) == Done(0, "", "")
    study = pcjax.load_study(tmp_path / "own.toml")
    assert (study.units, study.body, study.hand.thickness) == ("mm", pcjax.Circle(5.0), 2.0)
    assert study.hand.palm_length == pytest.approx(700)
    assert command("evaluate svg.toml --trials 20 --max-steps 20_000").code == 0


def test_the_unit_of_a_drawing_is_said_where_it_is_taken_to_be_one(
    command: Command, tmp_path: Path
):
    (tmp_path / "hand.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><polyline points="0,0 0,90 80,90 80,0"/></svg>'
    )
    done = command("study --hand hand.svg")
    assert (done.code, len(done.err.splitlines())) == (0, 1)
    assert "hand.svg does not say its unit: taken to be mm" in done.err
    assert 'length = "mm"' in done.out
    done = command("study --hand hand.svg --units model")
    assert (done.code, done.err) == (0, "")
    assert 'length = "model"' in done.out


def test_drawings_and_flags_that_make_no_study(command: Command, tmp_path: Path):
    (tmp_path / "hand.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    check_refused(command("study --hand hand.svg"), "hand.svg", "no lines")
    check_refused(command("study --hand hand.step"), "hand.step", "ending")
    check_refused(command("study --hand hand.svg --example"), "--example and --hand")
    for flag in ("--radius 3", "--units mm", "--palm 2", "--thickness 1"):
        check_refused(command(f"study {flag}"), flag.split()[0], "name its file with --hand")
    (tmp_path / "own.toml").write_text("mine")
    pcjax.export_hand(pcjax.box_hand(), tmp_path / "box.svg")
    check_refused(command("study --hand box.svg own.toml"), "own.toml is there already")
    check_refused(command("study --hand box.svg --radius -1"), "radius")
    assert (tmp_path / "own.toml").read_text() == "mine"


# ------------------------------------------------------------------------------ figures, claims


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the data of the figures that the claims need, at tiny sizes."""
    folder = tmp_path_factory.mktemp("figures")
    for name in FIGURES_NEEDED:
        line = f"figure {name} {TINY_FIGURE} --out {folder}/fig{name}.nc"
        main(shlex.split(f"{line} --plot {folder}/fig{name}.png"))
    return folder


@pytest.mark.parametrize("name", FIGURES_NEEDED)
def test_a_figure_is_a_picture_and_its_data(kept: Path, name: str):
    height, width, channels = imread(kept / f"fig{name}.png").shape
    assert min(height, width) >= 300
    assert channels in (3, 4)
    data = xr.load_dataset(kept / f"fig{name}.nc", engine="h5netcdf")
    assert (data.attrs["figure"], data.attrs["trials"], data.attrs["seed"]) == (name, 2, 0)
    counts = data["count"]
    assert (counts.sum("status_name") == 2).all()
    index1, index2 = (data[name].sel(statistic="value") for name in ("index1", "index2"))
    assert (index1 > 0).all()
    assert (index1 <= 60_000).all()
    # Nobody passes a gap narrower than the object.
    narrow = data.gap < data.object_width * (1 - 1e-6)
    assert (index2.where(narrow, 1.0) == 1.0).all()


def test_figure_12_prints_its_numbers_and_names_its_picture(command: Command, tmp_path: Path):
    done = command(f"figure 12 {TINY_FIGURE}")
    assert (done.code, done.err) == (0, "")
    assert "fig12.png" in done.out
    assert imread(tmp_path / "fig12.png").ndim == 3
    assert [entry.name for entry in tmp_path.iterdir()] == ["fig12.png"]
    rows = re.findall(r"^ *(-?\d+)  ", done.out, flags=re.MULTILINE)
    # One part of the table for each radius.
    assert [float(angle) for angle in rows] == 3 * list(paper.FIGURES["12"].angles_deg)


def verdicts(done: Done) -> dict[int, str]:
    """The verdict of each claim by its number."""
    found = re.findall(r"^(\d+)\. ([A-Z ]+): ", done.out, flags=re.MULTILINE)
    return {int(number): verdict.lower() for number, verdict in found}


ALLOWED = {"reproduced", "reproduced in part", "not reproduced"}


def test_claims_from_kept_data_and_from_a_new_run_agree(command: Command, kept: Path):
    from_kept = command(f"claims --results {kept}")
    assert (from_kept.code, from_kept.err) == (0, "")
    assert list(verdicts(from_kept)) == list(range(1, 13))
    assert set(verdicts(from_kept).values()) <= ALLOWED
    anew = command(f"claims {TINY_FIGURE}")
    assert (anew.code, anew.out) == (0, from_kept.out)


def test_claims_say_under_which_reading_they_are_judged(command: Command, kept: Path):
    rubbed = kept.parent / "rubbed"
    shutil.copytree(kept, rubbed)
    for path in rubbed.glob("*.nc"):
        data = xr.load_dataset(path, engine="h5netcdf").assign_attrs(reading="rubbing")
        save_dataset(data, path)
    told = command(f"claims --results {rubbed}")
    assert told.out.startswith("Under the reading 'rubbing': gravity 98, friction 0.35")
    assert "Sec. 2.1, which rules friction out" in told.out
    assert list(verdicts(told)) == list(range(1, 13))
    shown = command(f"show {rubbed}/fig9b.nc")
    assert shown.out.startswith("Under the reading 'rubbing'")
    check_refused(command(f"claims --results {rubbed} --reading literal"), "fig9a.nc", "rubbing")
    shutil.copy(kept / "fig17.nc", rubbed)
    check_refused(command(f"claims --results {rubbed}"), "fig17.nc", "literal", "rubbing")
    data = xr.load_dataset(kept / "fig9a.nc", engine="h5netcdf").assign_attrs(reading="free")
    save_dataset(data, rubbed / "fig9a.nc")
    check_refused(command(f"claims --results {rubbed}"), "fig9a.nc", "free", "literal, rubbing")


def test_a_figure_under_the_other_reading_is_another_one(command: Command, tmp_path: Path):
    told = [
        command(f"figure 13 --trials 20 --max-steps 3000 --reading {reading} --out {reading}.nc")
        for reading in ("literal", "rubbing")
    ]
    assert [done.code for done in told] == [0, 0]
    literal, rubbing = (
        xr.load_dataset(tmp_path / f"{name}.nc", engine="h5netcdf")
        for name in ("literal", "rubbing")
    )
    assert (literal.attrs["reading"], rubbing.attrs["reading"]) == ("literal", "rubbing")
    # Ten times the gravity, and the same draws: no trial of an open hand stays as it was.
    assert not np.any(literal.index1.values[0] == rubbing.index1.values[0])


def test_estimates_that_tell_nothing_reproduce_nothing(kept: Path):
    figures = {}
    for name in FIGURES_NEEDED:
        data = xr.load_dataset(kept / f"fig{name}.nc", engine="h5netcdf")
        # Independent errors ten times the limit: no two estimates can be told apart.
        blocks = np.zeros(data.covariance.shape)
        blocks[0, 0] = blocks[1, 1] = np.eye(data.sizes["condition"]) * 6_000_000.0**2
        figures[name] = data.assign(covariance=(data.covariance.dims, blocks))
    told = {claim.number: claim.verdict for claim in judge_claims(figures)}
    assert [number for number, verdict in told.items() if verdict == "reproduced"] == []


def test_trials_that_all_reach_the_limit_reproduce_nothing(command: Command):
    done = command("claims --trials 2 --max-steps 1000")
    assert done.code == 0
    assert len(verdicts(done)) == 12
    assert "reproduced" not in verdicts(done).values()
    assert "nan" not in done.out


# ---------------------------------------------------------------------------- what it refuses


def check_refused(done: Done, *words: str) -> None:
    """Status 2, and one line on stderr that has the words; nothing on stdout."""
    assert done.code == 2, done.err
    assert done.out == ""
    assert "Traceback" not in done.err
    lines = done.err.splitlines()
    assert len(lines) == 1, done.err
    assert lines[0].strip()
    for word in words:
        assert word in lines[0]


def refused(line: str, *words: str, id: str | None = None) -> Any:
    return pytest.param(line, words, id=id or line.replace("evaluate ", "") or "nothing")


LENGTHS = ("palm-length", "fingertip-length", "gap-width", "radius")
BAD_LENGTHS = [
    refused(f"evaluate --{name} {value}", f"--{name}", value)
    for name in LENGTHS
    for value in ("nan", "inf", "-inf", "0", "-1")
]
BAD_COUNTS = [
    refused(f"evaluate --{name} {value}", value)
    for name in ("trials", "max-steps")
    for value in ("nan", "inf", "-inf", "0", "-1", "1.5", "2147483648", "many")
]
BAD_NUMBERS = [
    refused("evaluate --restitution 1.2", "restitution", "1.2", "between 0 and 1"),
    refused("evaluate --restitution -0.1", "restitution", "-0.1", "between 0 and 1"),
    refused("evaluate --restitution nan", "restitution", "nan"),
    refused("evaluate --gravity nan", "gravity", "nan"),
    refused("evaluate --gravity inf", "gravity", "inf"),
    refused("evaluate --gravity -9.8", "gravity", "-9.8"),
    refused("evaluate --fingertip-angle nan", "--fingertip-angle", "nan"),
    refused("evaluate --fingertip-angle inf", "--fingertip-angle", "inf"),
    refused("evaluate --dt 0", "dt", "0"),
    refused("evaluate --dt -0.001", "dt", "-0.001"),
    refused("evaluate --dt=-1e-3", "dt", "-0.001"),
    refused("evaluate --dt nan", "dt", "nan"),
    refused("evaluate --dt inf", "dt", "inf"),
    refused("evaluate --dt 100", "dt", "100"),
    refused("evaluate --engine stepping --dt 0", "dt", "0"),
    refused("evaluate --seed -1", "seed", "-1"),
    refused("evaluate --seed 4294967296", "seed", "4294967296"),
    refused("evaluate --seed 0.5", "seed", "0.5"),
    refused("evaluate --precision 16", "precision", "16", "32", "64"),
    refused("evaluate --radius ''", "radius", "not a number"),
    refused("evaluate --radius 5cm", "radius", "5cm", "not a number"),
]
BAD_GEOMETRY = [
    refused("evaluate --radius 240", "radius 240", "does not fit"),
    refused("evaluate --direction does --radius 240", "radius 240", "does not fit"),
    refused("evaluate --fingertip-length 600 --fingertip-angle 0", "limb 3", "crosses the palm"),
    refused(
        "evaluate --gap-width 150 --fingertip-angle 80",
        "finger 1's limb 3",
        "finger 2's limb 3",
        "cross",
    ),
    refused("evaluate --gap-width 600", "gap_width", "palm_length"),
    refused("evaluate --gap-width 500", "gap_width", "palm_length"),
    refused("evaluate --palm-length 150 --gap-width 200", "gap_width", "palm_length"),
]
BAD_WORDS = [
    refused("evaluat", "evaluat", "did you mean evaluate"),
    refused(
        "destroy",
        "destroy",
        "inspect, evaluate, energy, compare, optimize, study, sweep, show, plot, map, view",
    ),
    refused("evaluate --radus 5", "--radus", "did you mean --radius"),
    refused("evaluate --fingertip-angel=5", "--fingertip-angel", "did you mean --fingertip-angle"),
    refused("figure 12 --trails 10", "--trails", "did you mean --trials"),
    refused("claims --result here", "--result", "did you mean --results"),
    refused("--versoin", "--versoin", "did you mean --version"),
    refused("evaluate --frobnicate", "--frobnicate"),
    refused("map --free gap_width", "unknown flag --free (see"),  # and not "did you mean --seed?"
    # No abbreviations: a flag added later must not change what an old command means.
    refused("evaluate --rad 5", "--rad", "did you mean --radius"),
    refused("evaluate 12", "12"),
    refused("evaluate --radius", "--radius"),
    refused("evaluate --scenario leg", "scenario", "leg", "wrist, arm"),
    refused("evaluate --body cube", "body", "cube", "circle, stick"),
    refused("evaluate --direction in", "direction", "in", "does, eoen, both"),
    refused(
        "evaluate --engine evnt", "engine", "evnt", "did you mean event", "auto, event, stepping"
    ),
    refused("evaluate --engine event --dt 0.01", "dt", "event"),
    refused("figure", "figure"),
    refused("figure 16", "16", "9a, 9b, 10, 11, 12, 13, 14, 15, 17"),
    refused("figure 9", "'9'", "9a, 9b, 10, 11, 12"),
    refused("figure 12 --reading rubing", "rubing", "literal, rubbing"),
    refused("figure 12 13", "13"),
]
BAD_COMBINATIONS = [
    refused("evaluate --scenario arm --fingertip-angle 10", "--fingertip-angle", "two-joint"),
    refused("evaluate --scenario arm --fingertip-length 10", "--fingertip-length", "two-joint"),
    refused("evaluate --scenario arm --gap-width 10", "--gap-width", "two-joint"),
    refused("evaluate --joint-angles 65 90", "--joint-angles", "box"),
    refused("evaluate --orientation 45", "--orientation", "circle"),
    refused("evaluate --scenario arm --orientation 45", "--orientation", "circle"),
    refused("evaluate --scenario arm --joint-angles 65", "--joint-angles"),
    refused("evaluate --scenario arm --joint-angles 65 nan", "--joint-angles of joint 2", "nan"),
    refused("evaluate --body stick --orientation inf", "orientation", "inf"),
    refused("evaluate --body stick --radius -1", "--radius", "-1"),
    refused("evaluate --body stick --radius 240", "stick", "240", "does not fit"),
    refused("evaluate --scenario arm --joint-angles 120 120", "cross"),
]
BAD_FILES = [
    refused("optimize --out missing/hand.toml", "missing/hand.toml", "folder"),
    refused("optimize --plot hand.doc", "hand.doc", "png"),
    refused("optimize --checkpoint folder", "folder", "it is a folder"),
    refused("evaluate plain", "plain", "TOML"),
    refused("evaluate folder", "folder", "cannot be read"),
    refused("evaluate missing.toml --radius 5", "missing.toml", "does not exist"),
    refused("evaluate --out missing/run.nc", "missing/run.nc", "folder"),
    refused("evaluate --out folder", "folder", "it is a folder"),
    refused("evaluate --out plain/run.nc", "plain/run.nc", "folder"),
    refused("evaluate --plot missing/hand.png", "missing/hand.png", "folder"),
    refused("evaluate --plot folder", "folder", "it is a folder"),
    refused("evaluate --plot hand.doc", "hand.doc", "png"),
    refused("evaluate --plot hand", "hand", "png"),
    refused("figure 12 --out missing/fig.nc", "missing/fig.nc", "folder"),
    refused("figure 12 --out folder", "folder", "it is a folder"),
    refused("figure 12 --plot missing/fig.png", "missing/fig.png", "folder"),
    refused("figure 12 --plot folder", "folder", "it is a folder"),
    refused("figure 12 --plot fig.doc", "fig.doc", "png"),
    refused("claims --results missing", "missing", "fig9a.nc"),
    refused("claims --results plain", "plain", "fig9a.nc"),
    refused("claims --results folder", "folder", "fig9a.nc"),
]
BAD_OPTIMIZE = [
    refused("optimize --free fingertip-angel", "fingertip_angel", "did you mean fingertip_angle"),
    refused("optimize --free fingertip-angle=5", "fingertip-angle=5", "-30:50"),
    refused("optimize --free fingertip-angle=", "fingertip-angle=", "bounds"),
    refused("optimize --free fingertip-angle=50:-30", "50", "-30", "order"),
    refused("optimize --free fingertip-angle=a:3", "'a'", "number"),
    refused("optimize --free fingertip-length=-5:3", "fingertip_length", "-5"),
    refused("optimize --free joint-angle", "joint_angle", "joint_angle_3"),
    refused("optimize --free gap-width --free gap-width", "gap-width", "twice"),
    refused("optimize --free joint-angle-3 --free fingertip-angle", "same number"),
    refused("optimize --scenario arm --free gap-width", "gap_width", "three limbs"),
    refused("optimize --clearance -1", "clearance", "-1"),
    refused("optimize --clearance 300", "no allowed hand", "300"),
    refused("optimize --objective index3", "index3", "index1"),
    refused("optimize --method gird", "gird", "did you mean grid"),
    refused("optimize --method grid --grid-points 0", "grid points", "0"),
    refused("optimize --method grid --grid-points 1000", "grid", "100000"),
    refused("optimize --estimator adjoint", "adjoint", "factorial"),
    refused("optimize --method gradient --form cloud --body stick", "cloud", "horizon"),
    refused("optimize --form cloud", "--form", "--method gradient", "model"),
    refused("optimize --iterations 0", "iterations", "0"),
    refused("map --x radius=50:10", "radius", "order"),
    refused("map --x friction", "friction", "bounds"),
    refused("map --x radius=-5:10", "radius", "-5"),
    refused("map --x radius=5:10 --y radius", "--x and --y", "radius"),
    refused("optimize --front --out best.toml", "--out", "--front"),
    refused("optimize --front --scenario arm", "two aims", "DoEs"),
    refused("optimize --front --over radius=10,20,30", "two aims"),
    refused("optimize --over radius=10,20 --weights 1,2 --worst", "--weights", "--worst"),
    refused("optimize --over radius", "'radius'", "radius=10,25,40"),
    refused("optimize --over radus=10,20", "radus", "did you mean radius"),
    refused("optimize --over amplitude=20,20", "--over amplitude_deg", "twice"),
    refused("optimize --over =1,2", "'=1,2'", "radius=10,25,40"),
    refused("optimize --gain 0.1 --method cma", "--gain", "--method model"),
    refused("optimize --grid-points 3", "--grid-points", "--method grid"),
    refused("optimize --front --gain 0.1", "--gain", "--front"),
    refused("optimize --over radius=10,10", "radius", "twice"),
    refused("optimize --over radius=10,20 --over radius=30", "--over radius", "twice"),
    refused("optimize --over palm-length=400,500", "palm_length", "hand that is looked for"),
    refused("optimize --over radius=10,20 --weights 1", "1 weights", "2 conditions"),
    refused("optimize --over radius=10,20 --weights 1,-1", "weight", "-1"),
    refused("optimize --gain -1", "gain", "-1"),
    refused("optimize --method gradient --starts 0", "starts", "0"),
    refused("optimize --method cma --checkpoint state.json", "checkpoint", "'gradient'"),
    refused("optimize --trials 1", "trials", "1"),
    refused("optimize --accept-trials 1", "accept_trials", "1"),
    refused("optimize --max-steps 12345", "12345", "10000"),
    refused("optimize --seed -1", "seed", "-1"),
    refused("optimize --dt 0", "dt", "0"),
    refused("optimize --limit 'gap-width <= 5'", "gap_width", "is not free"),
    refused("optimize missing.toml", "missing.toml"),
]
BAD_DRAWINGS = [
    refused("animate --plot film.avi", "film.avi", ".gif, .mp4, .html"),
    refused("animate --plot missing/film.gif", "missing/film.gif", "folder"),
    refused("animate --pick best", "best", "escaped, stuck, longest"),
    refused("animate --pick stuck --trial 3", "--pick", "--trial"),
    refused("animate --trial -1", "trial", "-1"),
    refused("animate --trial 1.5", "1.5", "whole"),
    refused("animate --seconds 0", "seconds", "0"),
    refused("animate --speed nan", "speed", "nan"),
    refused("animate --fps 1000", "fps", "1000"),
    refused("animate --dt 100", "dt", "100"),
    refused("animate --max-steps 10", "none of the first 200", "escaped", "10 steps"),
    refused("animate --direction both", "both", "does, eoen"),
    refused("animate --direction eoen --scenario arm", "seen in a mirror"),
    refused("animate --radius 240", "radius 240", "does not fit"),
    refused("map --plot map.doc", "map.doc", "png"),
    refused("map --out map.xls", "map.xls", ".nc, .csv"),
    refused("map --x fingertip-angel", "fingertip_angel", "did you mean fingertip_angle"),
    refused("map --x fingertip-length", "--x", "--y", "fingertip_length"),
    refused("map --x joint-angle-3 --y fingertip-angle", "same number"),
    refused("map --points 1 5", "fingertip_angle", "1"),
    refused("map --points 5 0", "fingertip_length", "0"),
    refused("map --points 1000 1000", "grid", "100000"),
    refused("map --points 5", "--points"),
    refused("map --seed -1", "seed", "-1"),
    refused("map --trials 1", "trials", "1"),
    refused("map --max-steps 12345", "12345", "10000"),
    refused("map --y gap-width=10:40 --points 2 2", "no hand on the map"),
    refused("map --objective index3", "index3", "index1"),
    refused("export --plot hand.stl", "hand.stl", ".svg, .dxf"),
    refused("export --thickness -1", "--thickness is -1", "at least 0"),
    refused("export --thickness nan", "thickness", "nan"),
    refused("export --fingertip-length 600 --fingertip-angle 0", "crosses the palm"),
    refused("export missing.toml", "missing.toml"),
]
BAD_FIGURES = [
    refused(f"{name} --{flag} {value}", value)
    for name in ("figure 12", "claims")
    for flag, value in (
        ("trials", "1"),
        ("trials", "-1"),
        ("max-steps", "0"),
        ("dt", "nan"),
        ("dt", "0"),
        ("seed", "-1"),
        ("precision", "16"),
    )
]


def unexpected(*_: Any, **__: Any) -> None:
    pytest.fail("the work began before its input was checked")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        *BAD_LENGTHS,
        *BAD_COUNTS,
        *BAD_NUMBERS,
        *BAD_GEOMETRY,
        *BAD_WORDS,
        *BAD_COMBINATIONS,
        *BAD_OPTIMIZE,
        *BAD_DRAWINGS,
        *BAD_FIGURES,
    ],
)
def test_bad_input_is_refused_in_one_line(
    command: Command, tmp_path: Path, line: str, words: tuple[str, ...]
):
    check_refused(command(line), *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("line", "words"), BAD_FILES)
def test_a_file_that_cannot_be_used_is_refused_before_the_work(
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    words: tuple[str, ...],
):
    (tmp_path / "folder").mkdir()
    (tmp_path / "plain").write_text("a file, not a folder")
    for work in (
        "evaluate.evaluate_study",
        "figure.run_figure",
        "claims.run_figure",
        "optimize.optimize",
    ):
        monkeypatch.setattr(f"pcjax.cli.{work}", unexpected)
    check_refused(command(line), *words)
    assert sorted(entry.name for entry in tmp_path.rglob("*")) == ["folder", "plain"]


def test_a_picture_of_the_wrong_kind_leaves_no_data_either(command: Command, tmp_path: Path):
    check_refused(command(f"evaluate {SMALL} --out run.nc --plot hand.doc"), "hand.doc", "png")
    assert not list(tmp_path.iterdir())


def test_one_file_cannot_be_two_outputs(command: Command, tmp_path: Path):
    line = "figure 12 --plot both.nc --out both.nc"
    check_refused(command(line), "both.nc", "--out and --plot")
    (tmp_path / "hand.toml").write_text("[hand]\npreset = 'box'\n")
    check_refused(command("optimize hand.toml --out hand.toml"), "hand.toml", "the study and --out")


def test_data_has_to_be_called_what_it_is(command: Command, tmp_path: Path):
    for line in ("evaluate --out run.csv", "figure 12 --out fig.csv", "optimize --out best.nc"):
        check_refused(command(line), line.split()[-1], "ending")
    assert not list(tmp_path.iterdir())


def test_earlier_spellings_of_outputs_do_with_a_line(command: Command, tmp_path: Path):
    done = command(f"{SMALL_MAP} --out m.png --data m.nc")
    assert done.code == 0
    assert "pcjax: --out is called --plot now" in done.err.splitlines()
    assert "pcjax: --data is called --out now" in done.err.splitlines()
    assert {path.name for path in tmp_path.iterdir()} == {"m.png", "m.nc"}
    # What map keeps, show prints.
    assert command("show m.nc").out.splitlines() == done.out.splitlines()[:-1]


def test_a_link_stays_and_what_it_leads_to_is_replaced(command: Command, tmp_path: Path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "run.nc").symlink_to(tmp_path / "folder" / "kept.nc")
    assert command(f"evaluate {SMALL} --out run.nc").code == 0
    assert (tmp_path / "run.nc").is_symlink()
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["kept.nc"]


def test_studies_that_are_empty_or_begin_with_a_byte_order_mark(command: Command, tmp_path: Path):
    (tmp_path / "empty.toml").write_text("# nothing\n")
    check_refused(command("evaluate empty.toml"), "empty.toml is empty")
    (tmp_path / "mark.toml").write_bytes(b"\xef\xbb\xbf[hand]\npreset = 'box'\n")
    assert command(f"evaluate mark.toml {SMALL}").code == 0


def test_a_terminal_without_the_letters_and_a_reader_who_has_seen_enough(
    command: Command, tmp_path: Path
):
    shown = command(f"evaluate {SMALL} --out run.nc").out
    done = program("show run.nc", tmp_path, PYTHONIOENCODING="ascii")
    assert (done.code, done.err) == (0, "")
    assert " +- " in done.out
    assert done.out == shown.replace("±", "+-")
    running = subprocess.Popen(
        [sys.executable, "-m", "pcjax", "study", "--example"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stdout is not None
    assert running.stderr is not None
    running.stdout.close()  # as `head` does
    told = running.stderr.read()
    running.stderr.close()
    assert running.wait(timeout=300) == 128 + signal.SIGPIPE
    assert told == ""


@pytest.mark.parametrize("words", [["--version"], ["--help"]])
def test_what_needs_no_simulation_does_not_import_it(words: list[str], tmp_path: Path):
    code = f"""
import sys
from pcjax.cli import main
try:
    main({words!r})
except SystemExit as end:
    assert end.code in (0, None), end.code
heavy = {{"jax", "numpy", "scipy", "xarray", "matplotlib"}} & set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_ctrl_c_while_modules_are_imported(tmp_path: Path):
    code = """
import os, signal, sys, threading, time
from pcjax.__main__ import main
def press():
    while "jax" not in sys.modules:
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=press, daemon=True).start()
sys.argv = ["pcjax", "evaluate"]
main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "pcjax: interrupted\n")


def test_kept_data_that_is_no_netcdf_is_refused(command: Command, tmp_path: Path):
    (tmp_path / "fig9a.nc").write_text("no netCDF")
    done = command("claims --results .")
    check_refused(done, "fig9a.nc")
    # The file is read, not written.
    assert "write" not in done.err


@pytest.mark.parametrize("other", ["an evaluation", "another figure"])
def test_kept_data_of_another_kind_is_refused(
    command: Command, kept: Path, tmp_path: Path, other: str
):
    for name in FIGURES_NEEDED:
        shutil.copy(kept / f"fig{name}.nc", tmp_path)
    if other == "an evaluation":
        assert command(f"evaluate {SMALL} --out fig9a.nc").code == 0
    else:
        shutil.copy(kept / "fig12.nc", tmp_path / "fig9a.nc")
    check_refused(command("claims --results ."), "fig9a.nc")


def test_a_write_that_fails_is_one_line_too(command: Command, monkeypatch: pytest.MonkeyPatch):
    def full(dataset: xr.Dataset, path: Any, **options: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", full)
    check_refused(command(f"evaluate {SMALL} --out run.nc"), "No space left on device")


# -------------------------------------------------------------------- the same through Python

NAN, INF = math.nan, math.inf


def evaluate_small(**changed: Any) -> pcjax.Evaluation:
    settings: dict[str, Any] = {"trials": 64, "max_steps": 50_000}
    return pcjax.evaluate(**settings | changed)


def python(name: str, make: Callable[[], Any]) -> Any:
    return pytest.param(name, make, id=name)


PYTHON_LENGTHS = [
    python(f"{name} = {value}", lambda name=name, value=value: pcjax.box_hand(**{name: value}))
    for name in ("palm_length", "gap_width", "fingertip_length", "side_length")
    for value in (NAN, INF, -INF, 0.0, -1.0)
]
PYTHON_RADII = [
    python(f"radius = {value}", lambda value=value: pcjax.Circle(value))
    for value in (NAN, INF, -INF, 0.0, -1.0)
]
PYTHON_SETTINGS = [
    python(f"{name} = {value!r}", lambda name=name, value=value: evaluate_small(**{name: value}))
    for name, values in {
        "trials": (NAN, INF, 0, -1, 1.5, 2**31, "64", True),
        "max_steps": (NAN, INF, 0, -1, 1.5, 2**31),
        "seed": (-1, 2**32, 0.5),
        "dt": (0.0, -0.001, NAN, INF, 100.0),
        "precision": (16, "32"),
        "engine": ("evnt",),
        "direction": ("in",),
        "start_spread": (-0.1, NAN, 1.5),
    }.items()
    for value in values
]
PYTHON_OTHERS = [
    python("restitution = 1.2", lambda: pcjax.ContactLaw(restitution=1.2)),
    python("restitution = -0.1", lambda: pcjax.ContactLaw(restitution=-0.1)),
    python("restitution = nan", lambda: pcjax.ContactLaw(restitution=NAN)),
    python("gravity = nan", lambda: pcjax.WristTilt(gravity=NAN)),
    python("gravity = -9.8", lambda: pcjax.WristTilt(gravity=-9.8)),
    python("fingertip_angle = nan", lambda: pcjax.box_hand(NAN)),
    python("gap_width = 600", lambda: pcjax.box_hand(gap_width=600.0)),
    python("radius 240 does not fit", lambda: evaluate_small(body=pcjax.Circle(240.0))),
    python(
        "limb 3 crosses the palm",
        lambda: evaluate_small(hand=pcjax.box_hand(0.0, fingertip_length=600.0)),
    ),
    python(
        "limb 3 crosses finger",
        lambda: evaluate_small(hand=pcjax.box_hand(math.radians(80.0), gap_width=150.0)),
    ),
    python("figure is '16'", lambda: run_figure("16", trials=2, max_steps=1000)),
    python("trials is 1", lambda: run_figure("12", trials=1, max_steps=1000)),
]


@pytest.mark.parametrize(
    ("what", "make"), [*PYTHON_LENGTHS, *PYTHON_RADII, *PYTHON_SETTINGS, *PYTHON_OTHERS]
)
def test_python_raises_value_error_where_the_command_line_refuses(
    what: str, make: Callable[[], Any]
):
    with pytest.raises(ValueError, match=what.split()[0]) as caught:
        make()
    assert len(str(caught.value).splitlines()) == 1
