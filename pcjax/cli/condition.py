"""The flags that describe a hand, its object and its drive, and the study file they go with."""

from __future__ import annotations

import argparse
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import MISSING
from pathlib import Path
from typing import Any

from pcjax.cli.parts import as_flags_say, number, whole
from pcjax.components import Component, Quantity, quantities
from pcjax.design import postures
from pcjax.design.parameters import HELP, labelled
from pcjax.model.bodies.base import BODIES
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import DRIVES
from pcjax.model.presets import HANDS
from pcjax.study.read import read_study
from pcjax.study.spec import Study
from pcjax.units import UNITS
from pcjax.words import InputWarning

_YES_OR_NO = {"yes": True, "no": False}

_KINDS = {
    "hand": ("preset", "hand", HANDS, "the hand (default: box on the wrist, two-joint on the arm)"),
    "drive": ("kind", "scenario", DRIVES, "what moves the hand (default: wrist)"),
    "body": ("kind", "body", BODIES, "the object (default: circle)"),
}
"""By table: the key that says the kind, its flag, the registry, and the flag's help."""


def _declared() -> Iterator[tuple[str, str, Quantity]]:
    """Every parameter with a flag: its table, the kind of component it belongs to, itself."""
    sorts: list[tuple[str, str, type[Component]]] = [
        (table, kind, component)
        for table, (_, _, registry, _) in _KINDS.items()
        for kind, component in registry.items()
    ]
    for table, kind, component in [*sorts, ("contact", "", ContactLaw)]:
        for what in quantities(component).values():
            if what.flag:
                yield table, kind, what


def add_condition(parser: argparse.ArgumentParser) -> None:
    """The flags, from what components declare."""
    add = parser.add_argument
    add(
        "study",
        type=Path,
        nargs="?",
        default=None,
        metavar="FILE",
        help="a study file (TOML), which the flags change; 'pcjax study --example' prints one",
    )
    add(
        "--units",
        choices=UNITS,
        default=None,
        help="of lengths; in mm, cm and m gravity is the earth's unless given, and the palm has to "
        "be given (default: model, the paper's, in which gravity is 9.8)",
    )
    for _, flag, registry, help_text in _KINDS.values():
        add(f"--{flag}", choices=registry.kinds(), default=None, help=help_text)
    flags: dict[str, list[tuple[str, Quantity]]] = {}
    for _, kind, what in _declared():
        flags.setdefault(what.flag, []).append((kind, what))
    for flag, owners in flags.items():
        first = owners[0][1]
        letter = "DEG" if first.unit == "angle" else flag.rsplit("-", 1)[-1][0].upper()
        several = [chr(ord("A") + k) for k in range(first.count or 1)]
        names = letter if first.count is None else tuple(several)
        taken: dict[str, Any] = {"type": _or_word(first), "nargs": first.count, "metavar": names}
        if first.kind is bool:
            taken = {"choices": tuple(_YES_OR_NO)}
        add(f"--{flag}", default=None, help=_help(owners), **taken)


def _or_word(what: Quantity) -> Callable[[str], Any]:
    """What reads a flag's number, or its word."""
    plain = whole if what.kind is int else number

    def read(text: str) -> Any:
        if what.word and text == what.word:
            return text
        try:
            return plain(text)
        except argparse.ArgumentTypeError as error:
            other = f", nor {what.word}" if what.word else ""
            raise argparse.ArgumentTypeError(f"{error}{other}") from None

    return read


def _help(owners: list[tuple[str, Quantity]]) -> str:
    """What a flag is, its unit, and what it is unless given, for each kind that has it."""
    texts, defaults = {}, {}
    for kind, what in owners:
        texts.setdefault(what.help, []).append(kind)
        usual = what.usual
        if what.kind is bool:
            usual = next(word for word, value in _YES_OR_NO.items() if value == what.default)
        elif not usual and what.default not in (None, MISSING):
            value = what.to_file(what.default)
            usual = " ".join(f"{v:g}" for v in (value if isinstance(value, list) else [value]))
        defaults.setdefault(usual or "none", []).append(kind)

    def in_words(each: dict[str, list[str]]) -> str:
        if len(each) == 1:
            return next(iter(each))
        return ", ".join(f"{text} ({', '.join(kinds)})" for text, kinds in each.items())

    unit = owners[0][1].unit_in_words
    return f"{in_words(texts)}{', ' if unit else ''}{unit} (default: {in_words(defaults)})"


def condition(arguments: argparse.Namespace) -> Study:
    """What the study file and the flags ask for; flags win over the file."""
    instead: dict[str, dict[str, Any]] = {}
    for table, (key, flag, _, _) in _KINDS.items():
        if getattr(arguments, flag) is not None:
            instead.setdefault(table, {})[key] = getattr(arguments, flag)
    names: dict[str, str] = {}
    if arguments.units is not None:
        instead["units"] = {"length": arguments.units}
    if arguments.units is not None or arguments.study is None:
        names["[units] length"] = "--units"
    for table, _, what in _declared():
        given = getattr(arguments, what.flag.replace("-", "_"))
        if given is not None:
            key = what.key if what.word and given == what.word else what.file_key
            value = _YES_OR_NO[given] if what.kind is bool else given
            instead.setdefault(table, {})[key] = value
        if given is not None or arguments.study is None:
            names |= {f"[{table}] {key}": f"--{what.flag}" for key in what.file_keys}

    def by_flag(text: str) -> str:
        """A message in which what came from a flag, or could have, is called by it."""
        return re.sub(r"\[\w+\] \w+", lambda m: names.get(m.group(), m.group()), text)

    try:
        study, doubts = read_study(arguments.study, instead)
    except ValueError as error:
        raise ValueError(by_flag(str(error))) from None
    for doubt in doubts:
        message = by_flag(doubt)
        where = "" if arguments.study is None or message != doubt else f"{arguments.study}: "
        warnings.warn(f"{where}{message}", InputWarning, stacklevel=2)
    return as_flags_say(study, arguments)


PARAMETERS = HELP.replace("_deg", "").replace("_", "-") + f"; in three dimensions {postures.HELP}"
"""What a parameter may be called on the command line: angles are in degrees in all of it."""


def parameter_flag(text: str) -> tuple[str, tuple[float, float] | None]:
    """A parameter's name and, where they are given, its bounds: NAME or NAME=LOW:HIGH."""
    name, _, bounds = text.partition("=")
    if not bounds:
        if "=" in text:
            raise argparse.ArgumentTypeError(f"{text!r} has no bounds after =")
        return name, None
    low, colon, high = bounds.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r} has to be like fingertip-angle=-30:50")
    return name, (number(low), number(high))


def limit_flag(text: str) -> str:
    """A linear limit in which angles' names say their unit, as in Python."""

    def named(word: re.Match[str]) -> str:
        label = labelled(word.group())
        return label if label.endswith("_deg") else word.group()

    return re.sub(r"[a-z][a-z0-9_-]*", named, text)
