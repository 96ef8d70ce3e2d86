"""Every command and every Python example that the README shows runs, at small sizes."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import pcjax
from pcjax.study import Study

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
SMALL = ["--trials", "20", "--max-steps", "20000"]
SMALLER = {
    "Surrogate(task, trials=500)": "Surrogate(task, trials=20)",
    "max_steps=600_000": "max_steps=20_000",
    "iterations=12, accept_trials=2000": "iterations=1, accept_trials=20, check_trials=20",
    "trials=500": "trials=40, max_steps=20_000",
}


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


COMMANDS = [
    line for block in blocks("bash") for line in block.splitlines() if line.startswith("pcjax ")
]


def test_there_are_examples() -> None:
    assert len(COMMANDS) >= 4
    assert len(blocks("python")) >= 2


@pytest.mark.parametrize("line", COMMANDS)
def test_command(line: str, tmp_path: Path) -> None:
    words = shlex.split(line, comments=True)[1:]
    (tmp_path / "best.toml").write_text(
        Study(pcjax.box_hand(), pcjax.Circle(25.0), pcjax.WristTilt(), pcjax.ContactLaw()).to_toml()
    )
    less = {
        "optimize": [*SMALL, "--iterations", "1", "--accept-trials", "20"],
        "map": [*SMALL, "--points", "3", "2"],
        "animate": ["--max-steps", "100000", "--seconds", "1"],
        "export": [],
    }.get(words[0], SMALL)
    # a later flag wins over an earlier one
    done = subprocess.run(
        [sys.executable, "-m", "pcjax", *words, *less],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout
    for k, word in enumerate(words):
        if word in ("--out", "--plot", "--data"):
            assert (tmp_path / words[k + 1]).stat().st_size > 300


@pytest.mark.parametrize("code", blocks("python"))
def test_python_example(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for large, small in SMALLER.items():
        code = code.replace(large, small)
    exec(compile(code, "README.md", "exec"), {})


def test_links_and_pictures_exist() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target


def test_setup_and_test_commands_are_the_ones_that_ci_runs() -> None:
    commands = [b.strip() for b in blocks("bash") if b.startswith("python3 -m venv")]
    assert len(commands) == 2
    assert "pytest" in commands[1]
    assert "README.md" in (ROOT / ".ci" / "run").read_text()
