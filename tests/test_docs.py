"""The documentation: it builds without a warning, all it shows runs, and all it names is there."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import pcjax
from pcjax.simulate.engine import ENGINES
from tests.shown import QUICK, ROOT, SMALL, blocks, run_page

pytestmark = pytest.mark.usefixtures("quick_programs")

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
WRITTEN = [
    *PAGES,
    *(ROOT / page for page in ("README.md", "experiments/README.md", "paper/paper.md")),
]
SHOWING = [
    page for page in PAGES if any(b.language == "python" or b.commands for b in blocks(page))
]

_FENCED = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
_FILE = re.compile(r"(?:[\w.-]+/)+[\w.-]+\.(?:py|md|ipynb|nc|csv|png|toml)")
_NAME = re.compile(r"pcjax(?:\.\w+)+")
_FUNCTION = re.compile(r"`([\w/]+\.py)`:((?:,? ?`[\w.]+`)+)")


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return _FENCED.sub("", page.read_text(encoding="utf-8"))


def resolve(path: str) -> Any:
    """What a dotted name stands for: a module, or something in one."""
    parts = path.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            fields = getattr(found, "__dataclass_fields__", {})
            found = fields[part] if part in fields else getattr(found, part)
        return found
    raise ModuleNotFoundError(path)


def test_site_builds_without_a_warning(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")],
        cwd=ROOT,
        env=os.environ
        | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1", "GALLERY_TRIALS": "40"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stdout + done.stderr
    home = (tmp_path / "site" / "index.html").read_text(encoding="utf-8")
    assert "experiments/results/fig12.png" in home
    assert (tmp_path / "site" / "experiments" / "results" / "fig12.png").is_file()
    gallery = (tmp_path / "site" / "gallery" / "index.html").read_text(encoding="utf-8")
    assert gallery.count("40 trials a direction") == 10
    assert (tmp_path / "site" / "gallery" / "stick.png").stat().st_size > 10_000
    assert "//fonts" not in home, "nothing is fetched from elsewhere"


@pytest.mark.parametrize("page", SHOWING, ids=name)
def test_everything_shown_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_page(page, tmp_path, monkeypatch)


def test_pages_that_show_something() -> None:
    assert {"tutorial.md", "extending.md"} <= {page.name for page in SHOWING}


def test_the_table_of_engines_is_what_they_say_of_themselves() -> None:
    rows = "".join(f"| `{kind}` | {engine.summary} |\n" for kind, engine in ENGINES.items())
    assert f"| --- | --- |\n{rows}\n" in (DOCS / "how-to" / "evaluate.md").read_text()


def test_setup_in_the_tutorial_is_the_one_in_the_readme() -> None:
    setup = blocks(DOCS / "tutorial.md")[0].text.splitlines()[0]
    assert setup.startswith("python3 -m venv")
    assert setup in (ROOT / "README.md").read_text(encoding="utf-8")


def test_diffs_shown_apply_and_work(tmp_path: Path) -> None:
    diffs = [b.text for b in blocks(DOCS / "extending.md") if b.language == "diff"]
    assert len(diffs) == 1
    shutil.copytree(ROOT / "pcjax", tmp_path / "pcjax")
    subprocess.run(
        ["git", "apply", "-"], input=diffs[0], cwd=tmp_path, text=True, check=True, timeout=60
    )
    done = subprocess.run(
        [sys.executable, "-m", "pcjax", "figure", "wide", *SMALL],
        cwd=tmp_path,
        env=os.environ | QUICK | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "figwide.png").stat().st_size > 1000


@pytest.mark.parametrize("page", WRITTEN, ids=name)
def test_links_lead_somewhere_on_github_as_well(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s#]+)", prose(page)):
        if not target.startswith(("http://", "https://")):
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", WRITTEN, ids=name)
def test_files_and_names_are_there(page: Path) -> None:
    text = prose(page)
    for span in re.findall(r"`([^`\n]+)`", text):
        if _FILE.fullmatch(span):
            folders = (ROOT, ROOT / "pcjax", page.parent)
            assert any((folder / span).exists() for folder in folders), span
        for dotted in _NAME.findall(span.split("(")[0]):
            resolve(dotted)
    for dotted in re.findall(r"^::: (\S+)$", text, re.MULTILINE):
        resolve(dotted)
    for path, names in _FUNCTION.findall(text):
        module = path.removeprefix("pcjax/").removesuffix(".py").replace("/", ".")
        for inner in re.findall(r"`([\w.]+)`", names):
            resolve(f"pcjax.{module}.{inner}")


def test_every_equation_has_its_function() -> None:
    first = re.findall(r"^\| (\([^|]*) \|", (DOCS / "equations.md").read_text(), re.MULTILINE)
    numbers: set[int] = set()
    for cell in first:
        for low, high in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", cell):
            numbers |= set(range(int(low), int(high or low) + 1))
    assert numbers == set(range(1, 22))


def test_every_public_name_is_in_the_reference_and_says_what_it_is() -> None:
    shown = [
        resolve(dotted)
        for page in (DOCS / "api").glob("*.md")
        for dotted in re.findall(r"^::: (\S+)$", page.read_text(), re.MULTILINE)
    ]
    for public in pcjax.__all__:
        thing = getattr(pcjax, public)
        assert any(thing is other for other in shown), f"{public} is not in docs/api"
        assert not isinstance(thing, ModuleType)
        assert thing.__doc__, public
        # A dataclass without a docstring gets its signature.
        assert not thing.__doc__.startswith(f"{public}("), public
