"""Reads a study file (TOML)."""

from __future__ import annotations

import os
import re
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pcjax.results.files import read_plain
from pcjax.study.spatial import SpatialReader, is_spatial
from pcjax.study.spec import Study
from pcjax.study.tables import Reader, is_number
from pcjax.words import InputWarning, did_you_mean, one_line

_EXAMPLES = {"plane": "example.toml", "mujoco": "example_mujoco.toml"}


def example(name: str = "plane") -> str:
    """A commented study that runs, as text: of a hand in the plane, or "mujoco" for one in three
    dimensions; `pcjax study --example` prints it.

    Raises:
        ValueError: there is no such example.
    """
    if name not in _EXAMPLES:
        raise ValueError(
            f"there is no example {name}: {did_you_mean(name, _EXAMPLES)}there are "
            f"{', '.join(_EXAMPLES)}"
        )
    return (Path(__file__).parent / _EXAMPLES[name]).read_text(encoding="utf-8")


EXAMPLES = tuple(_EXAMPLES)
"""Names of the examples."""


def _named(problem: str) -> tuple[str, str]:
    """The table and the key that a message is about; a table alone may be the key."""
    named = re.search(r"\[(\w+)\](?: ([\w-]+))?", problem)
    if named is None:
        return "", problem.removeprefix("unknown key ").split(":")[0]
    return named.group(1), named.group(2) or ""


def _line_of(text: str, table: str, key: str) -> int | None:
    """The line, from 1, of a key, or of its table's header where the key is not there."""
    inside, header_at = table == "", None
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*\[\s*([\w-]+)\s*\]", line)
        if header:
            inside = header.group(1) == table
            if inside or (not table and header.group(1) == key):
                header_at = number
        elif inside and key and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[=.]", line):
            return number
    return header_at


def load_study(path: str | os.PathLike[str]) -> Study:
    """Reads a study file.

    Warns (`InputWarning`) of angles and lengths that look like a slip of units.

    Raises:
        ValueError: no such file, no TOML, an unknown or missing key, or a value that does not do.

    Examples:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import pcjax
        >>> text = '''
        ... [hand]
        ... palm_length = 400
        ... lengths = [[350, 120, 90], [300, 140, 60]]
        ... angles_deg = [[90, 90, 75], [80, 95, 50]]
        ... '''
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "own.toml"
        ...     _ = path.write_text(text)
        ...     study = pcjax.load_study(path)
        >>> study.body.radius  # 0.05 L_p unless said
        20.0
    """
    study, doubts = read_study(path)
    for doubt in doubts:
        warnings.warn(f"{path}: {doubt}", InputWarning, stacklevel=2)
    return study


def read_study(
    path: str | os.PathLike[str] | None,
    instead: Mapping[str, Mapping[str, Any]] | None = None,
) -> tuple[Study, list[str]]:
    """A study, and what is strange about its angles and units.

    Arguments:
        path: of the file; None for a study of what is usual.
        instead: tables whose keys take the place of those in the file. A number of a hand that the
            file gives as two chains changes these chains.

    Raises:
        ValueError: as `load_study`.
    """
    data, text = ({}, "") if path is None else _tables(Path(path))
    hand = data.get("hand", {})
    chains = isinstance(hand, dict) and "lengths" in hand
    numbers: dict[str, Any] = {}
    for table, keys in (instead or {}).items():
        if table == "hand" and chains and "preset" not in keys:
            numbers |= keys
        elif isinstance(data.setdefault(table, {}), dict):
            if table == "hand" and chains:  # another kind of hand takes the place of the chains
                del data[table]["lengths"], data[table]["angles_deg"]
            others = {_without_unit(key) for key in keys}
            kept = {k: v for k, v in data[table].items() if _without_unit(k) not in others}
            data[table] = {**kept, **keys}
    reader = _reader(data, Path() if path is None else Path(path).parent)
    try:
        study = reader.study()
    except ValueError as error:
        table, key = _named(str(error))
        if path is None or key in (instead or {}).get(table, {}):
            raise ValueError(one_line(error)) from None
        line = _line_of(text, table, key)
        where = f"{path}, line {line}" if line else f"{path}"
        raise ValueError(f"{where}: {one_line(error)}") from None
    for key, value in numbers.items():
        if not is_number(value):
            raise ValueError(f"[hand] {key} does not apply to a hand of two chains")
        reader.doubt("hand", key, [value])
        try:
            study = replace(study.having({key: value}), sweep=study.sweep)
        except ValueError as error:
            raise ValueError(f"[hand] {key}: {one_line(error)}") from None
    return study, reader.doubts


def study_of(text: str) -> Study:
    """The study of a file's text, such as results keep; paths are seen from the current folder.

    Raises:
        ValueError: it is none, or a file that it names is not there.
    """
    return _reader(tomllib.loads(text), Path()).study()


def _reader(data: dict[str, Any], folder: Path) -> Reader:
    return SpatialReader(data, folder) if is_spatial(data) else Reader(data)


def _without_unit(key: str) -> str:
    """A key's name, whether it has a number or a word."""
    return key.removesuffix("_deg")


def _tables(path: Path) -> tuple[dict[str, Any], str]:
    """A file's tables and its text."""
    content = read_plain(path)
    try:
        text = content.decode("utf-8-sig")  # with or without a byte order mark
        data = tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} cannot be read: {one_line(error)}") from None
    except RecursionError:
        raise ValueError(f"{path} is no study: its lists are nested too deeply") from None
    except ValueError as error:  # of TOML, or of a number with thousands of digits
        raise ValueError(f"{path} is no TOML: {one_line(error)}") from None
    if not data:
        raise ValueError(f"{path} is empty: 'pcjax study --example' prints what may be in it")
    return data, text
