"""Every command and every Python example that the README shows runs, at small sizes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pcjax
from pcjax.cli import main
from pcjax.study.read import example
from pcjax.study.spec import Study
from tests.shown import ROOT, SMALL, blocks, check_files_written, small_words

pytestmark = pytest.mark.usefixtures("quick_programs")

README = ROOT / "README.md"
SMALLER = {
    "Surrogate(task, trials=500)": "Surrogate(task, trials=20)",
    "max_steps=600_000": "max_steps=20_000",
    "iterations=12, accept_trials=2000": "iterations=1, accept_trials=20, check_trials=20",
    "trials=500": "trials=40, max_steps=20_000",
}
BLOCKS = blocks(README)
COMMANDS = [line for block in BLOCKS if block.language == "bash" for line in block.commands]
PYTHON = [block.text for block in BLOCKS if block.language == "python"]


def test_there_are_examples() -> None:
    assert len(COMMANDS) >= 4
    assert len(PYTHON) >= 2


@pytest.mark.parametrize("line", COMMANDS)
def test_command(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = small_words(line)
    (tmp_path / "best.toml").write_text(
        Study(pcjax.box_hand(), pcjax.Circle(25.0), pcjax.WristTilt(), pcjax.ContactLaw()).to_toml()
    )
    if "study.toml" in words and words[0] != "study":
        (tmp_path / "study.toml").write_text(example())
    if "sweep.nc" in words and words[0] != "sweep":
        (tmp_path / "study.toml").write_text(example())
        main(["sweep", str(tmp_path / "study.toml"), "--out", str(tmp_path / "sweep.nc"), *SMALL])
    if "--hand" in words:
        pcjax.export_hand(pcjax.box_hand(), tmp_path / "hand.dxf", units="mm")
    capsys.readouterr()
    main(words)
    assert capsys.readouterr().out or words[0] in ("study", "plot")
    check_files_written(words, tmp_path)


@pytest.mark.parametrize("code", PYTHON)
def test_python_example(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for large, small in SMALLER.items():
        code = code.replace(large, small)
    exec(compile(code, "README.md", "exec"), {})


def test_links_and_pictures_exist() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README.read_text()):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target


def test_setup_and_test_commands_are_the_ones_that_ci_runs() -> None:
    commands = [b.text.strip() for b in BLOCKS if b.text.startswith("python3 -m venv")]
    assert len(commands) == 2
    assert "pytest" in commands[1]
    assert "README.md" in (ROOT / ".ci" / "run").read_text()
