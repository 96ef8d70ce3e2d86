"""Makes the gallery from its study files while the site is built: pictures, numbers, the page.

A file begins with two comments: its title, and what it teaches. `GALLERY_TRIALS` in the environment
says how many trials each hand gets.
"""

from __future__ import annotations

import functools
import io
import json
import tempfile
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

PAGE = "gallery.md"
HANDS = Path(__file__).resolve().parent / "gallery"
ORDER = (
    *("paper", "gripper", "arm", "stick", "triangle", "friction", "fingers"),
    *("cage", "scoop", "found"),
)


def _made(name: str, trials: int) -> tuple[bytes, dict[str, Any]]:
    return _run((HANDS / f"{name}.toml").read_text(), name, trials)


@functools.cache
def _run(text: str, name: str, trials: int) -> tuple[bytes, dict[str, Any]]:
    """The picture and the numbers of a study with that text, by the command itself."""
    from pcjax.cli import main

    said = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(said):
        picture = Path(folder) / "hand.png"
        words = ["evaluate", str(HANDS / f"{name}.toml"), "--trials", str(trials), "--json"]
        if name != "fingers" or _rendered():
            main([*words, "--plot", str(picture)])
        else:
            main(words)
            picture = HANDS.parent / "hand3d.png"  # of the same hand
        return picture.read_bytes(), json.loads(said.getvalue())


def _rendered() -> bool:
    """Whether hands in three dimensions can be drawn here."""
    from pcjax.view.rendering import check_rendering

    try:
        check_rendering()
    except ValueError:
        return False
    return True


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pictures and the study files."""
    if {path.stem for path in HANDS.glob("*.toml")} != set(ORDER):
        raise ValueError(f"{HANDS} has other hands than the gallery's order names")
    for name in ORDER:
        picture, _ = _made(name, config.extra["gallery_trials"])
        files.append(File.generated(config, f"gallery/{name}.png", content=picture))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The page's hands, where it says so."""
    if page.file.src_uri != PAGE:
        return markdown
    trials = config.extra["gallery_trials"]
    return markdown.replace("<!-- hands -->", "\n".join(_entry(name, trials) for name in ORDER))


def _entry(name: str, trials: int) -> str:
    title, lesson = (line[2:] for line in (HANDS / f"{name}.toml").read_text().splitlines()[:2])
    _, told = _made(name, trials)
    rows = [
        (words, told[key]["index1"], told[key]["index2"], ",.0f" if key != "score" else ".3f")
        for key, words in (("does", "DoEs"), ("eoen", "EoEn"), ("score", "score"))
        if key in told
    ]
    table = "\n".join(
        f"| {words} | {_number(one, form)} | {_number(two, '.3f')} |"
        for words, one, two, form in rows
    )
    return (
        f"## {title}\n\n{lesson}\n\n![{title}](gallery/{name}.png)\n\n"
        f"| | index 1 | index 2 |\n| --- | --- | --- |\n{table}\n\n"
        f"{told['trials']:,} trials a direction, {told['engine']} engine: "
        f"[{name}.toml](gallery/{name}.toml)\n"
    )


def _number(one: dict[str, float | None], form: str) -> str:
    if one["value"] is None:
        return "undefined"
    return f"{one['value']:{form}} [{one['low']:{form}}, {one['high']:{form}}]"
