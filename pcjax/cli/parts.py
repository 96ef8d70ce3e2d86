"""What the commands share: common flags, checks of files."""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from pcjax.components import Quantity
from pcjax.importing import named
from pcjax.paper import constants as paper
from pcjax.paper.readings import LITERAL, READINGS
from pcjax.simulate.choose import engine_names
from pcjax.simulate.engine import ENGINES, Engine
from pcjax.study.spec import MOST_TRIALS, Run, Study, own_parameters
from pcjax.words import InputWarning

PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp")


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def whole(text: str) -> int:
    try:
        return int(text.replace("_", "").replace(",", ""))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def add_run(parser: argparse.ArgumentParser, trials: int = paper.TRIALS) -> None:
    """Flags that all commands which simulate share; None where they are not given."""
    add = parser.add_argument
    add(
        "--trials",
        type=whole,
        default=None,
        help=f"trials for each condition (default: {trials})",
    )
    add_experiment(parser)
    _add_engine(parser)
    add_dt(parser, "the engine's choice; the paper's is 0.001")
    add(
        "--precision",
        type=whole,
        choices=(32, 64),
        default=None,
        help="bits of a number (default: 32)",
    )


def add_precision_target(parser: argparse.ArgumentParser, what: str) -> None:
    """How well it is to be known; there are as many trials as that takes."""
    parser.add_argument(
        "--precision-target",
        type=share,
        default=None,
        metavar="SHARE",
        help=f"run trials until half the 95 %% interval of {what}: 1%%, say (--trials is then the "
        f"most of them; default: {MOST_TRIALS:,})",
    )


def share(text: str) -> float:
    """A share such as 0.01 or 1%."""
    return number(text[:-1]) / 100 if text.endswith("%") else number(text)


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """The engine, and the flags of those that have some."""
    kinds = "; ".join(f"{kind}: {engine.summary}" for kind, engine in ENGINES.items())
    parser.add_argument(
        "--engine",
        choices=engine_names(),
        default=None,
        help=f"how trials are run. {kinds} (default: auto, the fastest of them that is accurate)",
    )
    for flag, owners in _flags_of_engines().items():
        what = next(iter(owners.values()))
        unit = f", {what.unit_in_words}" if what.unit_in_words else ""
        try:
            parser.add_argument(
                f"--{flag}",
                type=number,
                default=None,
                metavar=flag.rsplit("-", 1)[-1][0].upper(),
                help=f"of engine {' and '.join(owners)}: {what.help}{unit} (default: "
                f"{what.to_file(what.default):g})",
            )
        except argparse.ArgumentError:
            raise ValueError(
                f"--{flag}, a flag of engine {' and '.join(owners)}, is another one's already"
            ) from None


def _flags_of_engines() -> dict[str, dict[str, Quantity]]:
    """The parameters that have a flag, by that and by the kinds of engines that have them."""
    flags: dict[str, dict[str, Quantity]] = {}
    for kind, engine in ENGINES.items():
        for what in own_parameters(engine).values():
            if what.flag:
                flags.setdefault(what.flag, {})[kind] = what
    return flags


def _engine_said(arguments: argparse.Namespace, usual: str | Engine) -> str | Engine:
    """The engine that the flags ask for: another one, or other parameters of the usual one.

    Raises:
        ValueError: a parameter of an engine that is not the one.
    """
    before = usual if isinstance(usual, str) else usual.name
    kind = arguments.engine or before
    engine = usual if kind == before else kind
    for flag, owners in _flags_of_engines().items():
        value = getattr(arguments, flag.replace("-", "_"))
        if value is None:
            continue
        if kind not in owners:
            raise ValueError(
                f"--{flag} does not apply to the engine {kind}: it belongs to "
                f"{' and '.join(owners)}"
            )
        made = ENGINES[kind]() if isinstance(engine, str) else engine
        engine = made.having(**{owners[kind].name: owners[kind].from_file(value)})
    return engine


def add_experiment(parser: argparse.ArgumentParser) -> None:
    """Flags that say which experiments trials are; None where they are not given."""
    add = parser.add_argument
    add(
        "--max-steps",
        type=whole,
        default=None,
        help="limit, steps of 0.001 s (default: the paper's: 600,000 on the wrist, 300,000 on the "
        "arm, 180,000 for a stick)",
    )
    add("--seed", type=whole, default=None, help="trial i depends on (seed, i) alone (default: 0)")


def add_dt(parser: argparse.ArgumentParser, default: str) -> None:
    """The solver's step, and what it is unless given."""
    parser.add_argument(
        "--dt",
        type=number,
        default=None,
        metavar="SECONDS",
        help=f"the solver's step (default: {default})",
    )


RUN_FLAGS = ("trials", "max_steps", "seed", "engine", "dt", "precision")


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Which reading of the paper's model."""
    what = "; ".join(f"{reading.name}: {reading}" for reading in READINGS.values())
    parser.add_argument(
        "--reading",
        choices=READINGS,
        default=None,
        help=f"of the paper's model (default: {LITERAL.name}): {what}",
    )


def as_flags_say(study: Study, arguments: argparse.Namespace) -> Study:
    """The study run as the flags say, where the command has them and they are given."""
    flags = {field.name: getattr(arguments, field.name, None) for field in fields(Run)}
    given = {name: value for name, value in flags.items() if value is not None}
    if hasattr(arguments, "engine"):
        given["engine"] = _engine_said(arguments, study.run.engine)
    return replace(study, run=replace(study.run, **given))


def add_direction(parser: argparse.ArgumentParser, default: str) -> None:
    """Which way the object goes, and what it is unless given."""
    parser.add_argument(
        "--direction",
        choices=("does", "eoen", "both"),
        default=None,
        help=f"what to evaluate (default: {default})",
    )


def run_settings(arguments: argparse.Namespace, usual: Run) -> dict[str, Any]:
    """How to run: the flags given, and the usual for the others."""
    given = {name: getattr(arguments, name) for name in RUN_FLAGS}
    settings = {name: getattr(usual, name) if v is None else v for name, v in given.items()}
    return settings | {"engine": _engine_said(arguments, usual.engine), "progress": True}


def add_outputs(
    parser: argparse.ArgumentParser,
    *,
    data: str | None = None,
    plot: str | None = None,
    plot_default: Path | None = None,
    before: Mapping[str, str] | None = None,
) -> None:
    """`--out` for data and `--plot` for a picture, the same in every command.

    Arguments:
        parser: of the command.
        data, plot: what is written there, for the help; None where the command has no such file.
        plot_default: where the picture goes unless that is said.
        before: earlier spellings and the flags that took their place, "out" or "plot".
    """
    add = parser.add_argument
    if data is not None:
        add("--out", type=Path, default=None, metavar="FILE", help=data)
    if plot is not None:
        where = "" if plot_default is None else f" (default: {plot_default} here)"
        add("--plot", type=Path, default=None, metavar="FILE", help=plot + where)
    for old in before or {}:
        if f"--{old}" not in parser._option_string_actions:
            add(f"--{old}", type=Path, default=None, help=argparse.SUPPRESS)
    parser.set_defaults(plot_default=plot_default, before=before or {})


def settle_outputs(arguments: argparse.Namespace) -> None:
    """Takes earlier spellings, with a warning, and refuses one file for two outputs.

    Raises:
        ValueError: a file that is to be two things.
    """
    for old, new in arguments.before.items():
        given = getattr(arguments, old)
        # A map's --out was its picture, and is its data now.
        is_data = old == "out" and hasattr(arguments, "data")
        if given is None or (is_data and given.suffix.lower() not in PICTURES):
            continue
        if getattr(arguments, new) is not None:
            raise ValueError(f"--{old} is called --{new} now: give one of them")
        warnings.warn(f"--{old} is called --{new} now", InputWarning, stacklevel=2)
        setattr(arguments, new, given)
        setattr(arguments, old, None)
    if getattr(arguments, "plot", None) is None:
        arguments.plot = arguments.plot_default
    names = ("study", "results", "out", "plot", "checkpoint")
    files: dict[Path, str] = {}
    for name in names:
        path = getattr(arguments, name, None)
        if not isinstance(path, Path):
            continue
        other = files.setdefault(path.resolve(), name)
        if other != name:
            raise ValueError(f"{path} cannot be both {_as_typed(other)} and {_as_typed(name)}")


def _as_typed(name: str) -> str:
    return {"study": "the study", "results": "the result"}.get(name, f"--{name}")


def check_plane(study: Study, what: str) -> None:
    """
    Raises:
        ValueError: the hand is one in three dimensions.
    """
    if study.dimensions != 2:
        raise ValueError(f"{what} is for hands in the plane, and this one is in three dimensions")


def check_data(path: Path | None, endings: Sequence[str] = (".nc",)) -> None:
    """Fails before the work when data cannot be written, or the file's ending says another kind."""
    check_writable(path)
    if path is not None and path.suffix.lower() not in endings:
        raise ValueError(f"cannot keep {path}: its ending has to be one of {', '.join(endings)}")


def check_writable(path: Path | None) -> None:
    """Fails before the work, not after it, when a file cannot be written."""
    if path is None:
        return
    folder = path.parent
    if not folder.is_dir():
        raise ValueError(f"cannot write {path}: the folder {folder} does not exist")
    if path.is_dir():
        raise ValueError(f"cannot write {path}: it is a folder")
    if path.exists() and not path.is_file():
        raise ValueError(f"cannot write {path}: it is no plain file")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise ValueError(f"cannot write {path}: no permission")


def check_picture(path: Path | None) -> None:
    """Fails before the work when a picture cannot be written or is of no known kind."""
    check_writable(path)
    if path is not None and path.suffix.lower() not in PICTURES:
        raise ValueError(f"cannot draw {path}: its ending has to be one of {', '.join(PICTURES)}")


def save_picture(plot: str, data: Any, path: Path) -> None:
    """Draws with a function, "module.name", which is imported now: matplotlib takes a second."""
    named(plot)(data).savefig(path, dpi=130)
