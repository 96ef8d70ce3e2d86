"""Runs what the documentation shows, at small sizes: commands, Python blocks, files."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import pcjax
from pcjax.cli import main
from pcjax.compiling import quick_options
from pcjax.components import Registry
from pcjax.model.bodies.base import BODIES
from pcjax.model.drives.base import DRIVES
from pcjax.model.presets import HANDS
from pcjax.simulate.engine import ENGINES

ROOT = Path(__file__).parent.parent
SMALL = ("--trials", "10", "--max-steps", "20000")
"""Flags that make a command small; a later flag wins over an earlier one."""

QUICK = {"XLA_FLAGS": " ".join(f"--{flag}={int(value)}" for flag, value in quick_options().items())}
"""Environment of a process whose programs run for a moment (see `quick_programs`)."""

_FENCE = re.compile(r'^```(\w*)(?: title="([^"]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page; `title` names the file that it is."""

    language: str
    title: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Its lines that call pcjax, but for pages, which are served until they are interrupted:
        tests/test_view.py visits one."""
        lines = [line for line in self.text.splitlines() if line.startswith("pcjax ")]
        return [line for line in lines if not line.startswith("pcjax view")]


def blocks(page: Path) -> list[Block]:
    """The blocks of a page, in order."""
    return [Block(*found) for found in _FENCE.findall(page.read_text(encoding="utf-8"))]


def small_words(line: str) -> list[str]:
    """A command's words after `pcjax`, with flags that make it small."""
    words = shlex.split(line, comments=True)[1:]
    less = {
        "optimize": [*SMALL, "--iterations", "1", "--accept-trials", "20"],
        "map": [*SMALL, "--points", "3", "2"],
        "animate": ["--max-steps", "100000", "--seconds", "1", "--fps", "5"],
    }
    if "--occupancy" in words:
        return [*words, *SMALL[:2]]
    if words[0] in ("energy", "export", "study", "show", "plot", "inspect"):
        return words
    return [*words, *less.get(words[0], SMALL)]


def check_files_written(words: list[str], folder: Path) -> None:
    """The files that a command names are there, and not empty."""
    for k, word in enumerate(words):
        if word in ("--out", "--plot"):
            assert (folder / words[k + 1]).stat().st_size > 300


def keep_registered(registry: Registry[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Forgets after a test what it has registered."""
    registry.kinds()  # imports the package's own
    monkeypatch.setattr(registry, "_classes", dict(registry._classes))


def run_page(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs everything that a page shows from top to bottom, in one folder and one Python process.

    Files are written, commands and Python run; trials and limits are smaller than shown.
    """
    monkeypatch.chdir(folder)
    for registry in (BODIES, DRIVES, ENGINES, HANDS):
        keep_registered(registry, monkeypatch)
    # Where a block gives no number of trials it gets a small one, too.
    defaults = dict(pcjax.evaluate.__kwdefaults__ or {}) | {"trials": 20, "max_steps": 20_000}
    monkeypatch.setattr(pcjax.evaluate, "__kwdefaults__", defaults)
    names = {"__name__": "__main__"}
    for block in blocks(page):
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        for line in block.commands if block.language == "bash" else []:
            words = small_words(line)
            main(words)
            check_files_written(words, folder)
        if block.language == "python":
            exec(compile(_small(block.text), page.name, "exec"), names)


def _small(code: str) -> str:
    for names, value in (
        ("trials|accept_trials|check_trials", "20"),
        ("iterations", "1"),
        ("first", "20"),
        ("max_steps", "20_000"),
    ):
        code = re.sub(rf"\b({names})=[\d_]+", rf"\1={value}", code)
    return code
