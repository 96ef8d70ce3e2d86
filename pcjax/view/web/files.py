"""Files of the page: only those in the folder that it was started in, and below."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from itertools import islice
from pathlib import Path

from pcjax.results.evaluation import Evaluation
from pcjax.results.saving import save_text
from pcjax.study.drawing import drawn_hand
from pcjax.study.read import read_study
from pcjax.study.spec import Study
from pcjax.view.export import export_hand

_MOST = 200
"""Files that are listed."""

_VISITED = 1000
"""Entries of a folder, and folders of a level, that are looked at."""

_DEEP = 3
"""Folders that are gone into below one another."""


def inside(folder: Path, name: str) -> Path:
    """The path of a file in a folder or below it, links followed.

    Raises:
        ValueError: no name, or it is elsewhere.
    """
    if not name.strip():
        raise ValueError("the file needs a name, such as hand.toml")
    try:
        path = (folder / name.strip()).resolve()
    except (OSError, RuntimeError) as error:
        raise ValueError(f"{name}: {error}") from None
    if not path.is_relative_to(folder.resolve()):
        raise ValueError(f"{name} is outside of the folder that the page was started in: {folder}")
    return path


def listed(folder: Path, endings: tuple[str, ...]) -> list[str]:
    """The files with such endings, by their paths from the folder; the nearest first."""
    found: list[str] = []
    level = [folder]
    for _ in range(_DEEP):
        deeper: list[Path] = []
        for one in level:
            with suppress(OSError), os.scandir(one) as entries:
                for entry in sorted(islice(entries, _VISITED), key=lambda each: each.name):
                    path = Path(entry.path)
                    if entry.name.startswith("."):
                        continue
                    if entry.is_dir(follow_symlinks=False):
                        deeper.append(path)
                    elif path.suffix.lower() in endings:
                        found.append(str(path.relative_to(folder)))
            if len(found) >= _MOST:
                return found[:_MOST]
        level = deeper[:_VISITED]
    return found


STUDIES = (".toml", ".dxf", ".svg")
"""What can be opened: study files, and drawings of hands."""


def open_study(folder: Path, name: str) -> tuple[Study, list[str]]:
    """A study from its file, or that of a drawn hand; and what is doubtful about it.

    Arguments:
        folder, name: see `inside`.

    Raises:
        ValueError: it is elsewhere, cannot be read, or is no study.
    """
    path = inside(folder, name)
    try:
        if path.suffix.lower() == ".toml":
            return read_study(path)
        if path.suffix.lower() not in STUDIES:
            raise ValueError(f"{name}: its ending has to be one of {', '.join(STUDIES)}")
        hand, units, doubts = drawn_hand(path)
        return Study.usual(hand, units=units), doubts
    except OSError as error:
        raise ValueError(f"{name} cannot be read: {error.strerror}") from None


def save_study(folder: Path, name: str, study: Study, own: str = "") -> str:
    """Writes a study file; its name, with the ending .toml.

    Arguments:
        folder, name: see `inside`.
        study: what is kept.
        own: the file that the study came from, which is written over.

    Raises:
        ValueError: it would be elsewhere, another file is there, or it cannot be written.
    """
    name = name.strip() if name.strip().lower().endswith(".toml") else f"{name.strip()}.toml"
    path = inside(folder, name)
    if path.exists() and name != own:
        raise ValueError(f"{name} is there already: take another name, or open it first")
    try:
        save_text(study.to_toml(), path)
    except OSError as error:
        raise ValueError(f"{name} cannot be written: {error.strerror}") from None
    return name


def _drawn(ending: str) -> Callable[[Study, Evaluation | None], bytes]:
    def export(study: Study, _: Evaluation | None) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"hand{ending}"
            export_hand(study.hand, path, body=study.body, units=study.units)
            return path.read_bytes()

    return export


def _picture(_: Study, found: Evaluation | None) -> bytes:
    from io import BytesIO

    from pcjax.view.plots import plot_evaluation  # matplotlib takes a second to import

    if found is None:
        raise ValueError("a picture needs numbers, and this design has none yet")
    file = BytesIO()
    plot_evaluation(found).savefig(file, format="png", dpi=130)
    return file.getvalue()


def _numbers(study: Study, found: Evaluation | None) -> bytes:
    told = {"study": study.to_toml(), "evaluation": None if found is None else found.as_json()}
    return json.dumps(told, indent=1).encode()


EXPORTS = {"svg": _drawn(".svg"), "dxf": _drawn(".dxf"), "png": _picture, "json": _numbers}
"""What can be downloaded, by its ending."""
