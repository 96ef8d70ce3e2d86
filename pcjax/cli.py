"""The command line: evaluate a hand, redo a figure, check the paper's claims."""

from __future__ import annotations

import argparse
import difflib
import json
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import xarray as xr

from pcjax import paper
from pcjax.claims import FIGURES_NEEDED, judge_claims
from pcjax.compilation_cache import use_compilation_cache
from pcjax.engines.choice import ENGINES
from pcjax.evaluate import evaluate
from pcjax.figures import curve, run_figure, score_curve
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Body, Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import HandDesign, box_hand, two_joint_hand
from pcjax.model.scenario import Drive
from pcjax.results import NAMES, package_version, save_dataset

_PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp")


def main(argv: Sequence[str] | None = None) -> None:
    """Runs one command. Exit status 0, 2 for bad input, 130 when interrupted."""
    arguments = _parse(sys.argv[1:] if argv is None else list(argv))
    use_compilation_cache()
    try:
        arguments.run(arguments)
    except ValueError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"cannot write {error.filename or 'the output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        print("pcjax: interrupted", file=sys.stderr)
        sys.exit(130)


def _fail(message: str) -> NoReturn:
    print(f"pcjax: {message}", file=sys.stderr)
    sys.exit(2)


class _Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, with the nearest name for a misspelt one."""

    def error(self, message: str) -> NoReturn:
        _fail(f"{message} (see '{self.prog} --help')")

    def unknown(self, words: Sequence[str]) -> NoReturn:
        word = words[0]
        flags = [flag for flag in self._option_string_actions if flag.startswith("--")]
        near = difflib.get_close_matches(word.split("=")[0], flags, 1, cutoff=0.5)
        hint = f": did you mean {near[0]}?" if near else ""
        self.error(f"unknown {'flag' if word.startswith('-') else 'argument'} {word}{hint}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            allowed = [str(choice) for choice in action.choices]
            near = difflib.get_close_matches(str(value), allowed, 1, cutoff=0.5)
            hint = f"did you mean {near[0]}? " if near else ""
            name = "/".join(action.option_strings) or action.metavar or action.dest
            self.error(f"{name} is {value!r}: {hint}it has to be one of {', '.join(allowed)}")


class _HelpFormatter(argparse.ArgumentDefaultsHelpFormatter):
    """Adds the default to a flag's help where there is one to tell."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        told = action.default is None or action.default is False
        return action.help if told else super()._get_help_string(action)


def _parse(argv: list[str]) -> argparse.Namespace:
    parser = _Parser(
        prog="pcjax",
        description="How well a planar robot hand cages an object without closing on it.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"pcjax {package_version()}")
    commands = parser.add_subparsers(dest="command", metavar="command")
    each = {
        "evaluate": (_add_evaluate, "evaluate one hand: DoEs, EoEn and the score"),
        "figure": (_add_figure, "redo one of the paper's figures"),
        "claims": (_add_claims, "check the paper's claims"),
    }
    subparsers = {}
    for name, (add, text) in each.items():
        subparsers[name] = commands.add_parser(
            name,
            help=text,
            description=text[0].upper() + text[1:] + ".",
            allow_abbrev=False,
            formatter_class=_HelpFormatter,
        )
        # "-1e1", "-inf" and "-nan" are values, not flags.
        subparsers[name]._negative_number_matcher = _NegativeNumber()
        add(subparsers[name])
    arguments, unknown = parser.parse_known_args(argv)
    if unknown:
        subparsers.get(arguments.command, parser).unknown(unknown)
    if arguments.command is None:
        parser.print_help()
        sys.exit(0)
    return arguments


class _NegativeNumber:
    def match(self, text: str) -> bool:
        try:
            float(text)
        except ValueError:
            return False
        return text.startswith("-")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def _whole(text: str) -> int:
    try:
        return int(text.replace("_", "").replace(",", ""))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def _add_run(parser: argparse.ArgumentParser, trials: int, precision: int = 32) -> None:
    """Flags that all commands which simulate share."""
    add = parser.add_argument
    add("--trials", type=_whole, default=trials, help="trials for each condition")
    add(
        "--max-steps",
        type=_whole,
        default=None,
        help="limit, steps of 0.001 s (default: the paper's: 600,000 on the wrist, 300,000 on the "
        "arm, 180,000 for a stick)",
    )
    add("--seed", type=_whole, default=0, help="trial i depends on (seed, i) alone")
    add("--engine", choices=ENGINES, default="auto", help="how trials are run")
    add(
        "--dt",
        type=_number,
        default=None,
        metavar="SECONDS",
        help="the solver's step (default: the engine's choice; the paper's is 0.001)",
    )
    add("--precision", type=_whole, choices=(32, 64), default=precision, help="bits of a number")


def _run_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    names = ("trials", "max_steps", "seed", "engine", "dt", "precision")
    return {name: getattr(arguments, name) for name in names} | {"progress": True}


def _add_evaluate(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--scenario", choices=("wrist", "arm"), default="wrist", help="what moves the hand")
    add("--body", choices=("circle", "stick"), default="circle", help="the object")
    add(
        "--direction",
        choices=("does", "eoen", "both"),
        default=None,
        help="what to evaluate (default: both on the wrist, does on the arm)",
    )
    add(
        "--fingertip-angle",
        type=_number,
        default=None,
        metavar="DEG",
        help=f"theta_g, degrees, of the wrist's box hand (default: {paper.BEST_ANGLE_DEG:g})",
    )
    first, second = paper.ARM_JOINT_ANGLES_DEG
    add(
        "--joint-angles",
        type=_number,
        nargs=2,
        default=None,
        metavar=("A", "B"),
        help=f"theta_i1 and theta_i2, degrees, of the arm's hand (default: {first:g} {second:g})",
    )
    add(
        "--palm-length",
        type=_number,
        default=None,
        metavar="L",
        help=f"L_p, model units (default: {paper.WRIST_PALM_LENGTH:g} on the wrist, "
        f"{paper.ARM_PALM_LENGTH:g} on the arm)",
    )
    add(
        "--fingertip-length",
        type=_number,
        default=None,
        metavar="L",
        help="L_g, model units, of the wrist's box hand (default: 0.2 L_p)",
    )
    add(
        "--gap-width",
        type=_number,
        default=None,
        metavar="W",
        help="W_g, model units, of the wrist's box hand (default: 0.4 L_p)",
    )
    add(
        "--radius",
        type=_number,
        default=None,
        metavar="R",
        help="r_o, a circle's radius or a stick's half length, model units (default: 0.05 L_p on "
        f"the wrist, {paper.ARM_RADIUS:g} on the arm)",
    )
    add(
        "--orientation",
        type=_number,
        default=None,
        metavar="DEG",
        help="a stick's angle from the palm at the start, degrees (default: 0)",
    )
    add("--restitution", type=_number, default=paper.RESTITUTION, metavar="E", help="e_r")
    add("--gravity", type=_number, default=paper.GRAVITY, metavar="G", help="g")
    _add_run(parser, trials=paper.TRIALS)
    add("--json", action="store_true", help="print one JSON object on stdout, nothing else")
    add("--plot", type=Path, default=None, metavar="FILE", help="draw hand and survival curves")
    add("--out", type=Path, default=None, metavar="FILE", help="keep everything as netCDF")
    parser.set_defaults(run=_evaluate)


def _evaluate(arguments: argparse.Namespace) -> None:
    _check_picture(arguments.plot)
    _check_writable(arguments.out)
    hand, body, drive = _condition(arguments)
    result = evaluate(
        hand,
        body,
        direction=arguments.direction,
        drive=drive,
        law=ContactLaw(restitution=arguments.restitution),
        **_run_settings(arguments),
    )
    if arguments.out:
        result.save(arguments.out)
    if arguments.plot:
        _save_picture("plot_evaluation", result, arguments.plot)
    print(json.dumps(result.as_json()) if arguments.json else result)


def _condition(arguments: argparse.Namespace) -> tuple[HandDesign, Body, Drive]:
    """Hand, object and drive from the flags; those that do not apply are refused."""
    arm, stick = arguments.scenario == "arm", arguments.body == "stick"
    for flag, applies, why in (
        ("fingertip_angle", not arm, "the arm's two-joint hand has --joint-angles"),
        ("fingertip_length", not arm, "it belongs to the wrist's box hand"),
        ("gap_width", not arm, "it belongs to the wrist's box hand"),
        ("joint_angles", arm, "the wrist's box hand has --fingertip-angle"),
        ("orientation", stick, "a circle has none; --body stick has"),
    ):
        if getattr(arguments, flag) is not None and not applies:
            name = "--" + flag.replace("_", "-")
            where = f"--body {arguments.body}" if flag == "orientation" else "--scenario "
            where += "" if flag == "orientation" else arguments.scenario
            raise ValueError(f"{name} does not apply to {where}: {why}")
    if arm:
        angles = arguments.joint_angles or paper.ARM_JOINT_ANGLES_DEG
        hand = two_joint_hand(
            *(math.radians(angle) for angle in angles),
            palm_length=_given(arguments.palm_length, paper.ARM_PALM_LENGTH),
            lengths=paper.ARM_FINGER,
        )
        drive, radius = PlanarArm(gravity=arguments.gravity), paper.ARM_RADIUS
    else:
        length = _given(arguments.palm_length, paper.WRIST_PALM_LENGTH)
        hand = box_hand(
            math.radians(_given(arguments.fingertip_angle, paper.BEST_ANGLE_DEG)),
            palm_length=length,
            gap_width=arguments.gap_width,
            fingertip_length=arguments.fingertip_length,
        )
        drive, radius = WristTilt(gravity=arguments.gravity), 0.05 * length
    radius = _given(arguments.radius, radius)
    if stick:
        return hand, Stick(radius, math.radians(_given(arguments.orientation, 0.0))), drive
    return hand, Circle(radius), drive


def _given(value: float | None, default: float) -> float:
    return default if value is None else value


def _add_figure(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "figure",
        choices=paper.FIGURE_NAMES,
        metavar="figure",
        help=f"one of {', '.join(paper.FIGURE_NAMES)}",
    )
    _add_run(parser, trials=paper.TRIALS)
    add(
        "--plot",
        type=Path,
        default=None,
        metavar="FILE",
        help="the picture (default: figNAME.png here)",
    )
    add("--out", type=Path, default=None, metavar="FILE", help="keep the data as netCDF")
    parser.set_defaults(run=_figure)


def _figure(arguments: argparse.Namespace) -> None:
    picture = arguments.plot or Path(f"fig{arguments.figure}.png")
    _check_picture(picture)
    _check_writable(arguments.out)
    data = run_figure(arguments.figure, **_run_settings(arguments))
    if arguments.out:
        save_dataset(data, arguments.out)
    _save_picture("plot_figure", data, picture)
    print(figure_table(data))
    print(f"{data.attrs['wall_seconds']:.1f} s; picture: {picture}")


def figure_table(data: xr.Dataset) -> str:
    """A figure's numbers as text: one line per angle, one column per curve."""
    if data.attrs["figure"] not in paper.FIGURES:
        return _arm_table(data)
    settings = paper.FIGURES[str(data.attrs["figure"])]
    columns, curves = [], []
    for gap_width in settings.gap_widths:
        for radius in settings.radii:
            where = {"gap_width": gap_width, "radius": radius}
            tag = f"W_g={gap_width:g} r_o={radius:g}"
            for direction in settings.directions:
                columns.append(f"{NAMES[direction]} {tag}")
                curves.append((curve(data, direction, where=where), ",.0f"))
                if data.attrs["figure"] == "9a":
                    columns.append("index 2")
                    curves.append((curve(data, direction, "index2", where), ".4f"))
            if len(settings.directions) == 2:
                columns.append(f"score {tag}")
                curves.append((score_curve(data, where), ".4f"))
    lines = ["theta_g  " + "  ".join(f"{name:>24}" for name in columns)]
    for k, angle in enumerate(curves[0][0].angle):
        cells = (f"{line.value[k]:{form}} ± {line.se[k]:{form}}" for line, form in curves)
        lines.append(f"{angle:>7g}  " + "  ".join(f"{cell:>24}" for cell in cells))
    return "\n".join(lines)


def _arm_table(data: xr.Dataset) -> str:
    """The numbers of a figure of the arm: one line per condition."""
    names = {"theta_1": "theta_i1", "theta_2": "theta_i2", "orientation": "orientation"}
    names |= {"width": "width", "index1": "index 1", "index2": "index 2", "invalid": "invalid"}
    lines = ["  ".join(f"{name:>16}" for name in names.values())]
    for k in range(data.sizes["condition"]):
        one = data.isel(condition=k)
        se = [math.sqrt(max(float(one.covariance[i, i, k]), 0.0)) for i in (0, 1)]
        cells = [f"{float(one[name]):g}" for name in ("theta_1", "theta_2", "orientation")]
        cells += [f"{float(one.width):.1f}", f"{float(one.index1):,.0f} ± {se[0]:,.0f}"]
        cells += [f"{float(one.index2):.4f} ± {se[1]:.4f}"]
        cells += [f"{int(one['count'].sel(status='invalid'))}"]
        lines.append("  ".join(f"{cell:>16}" for cell in cells))
    if "penetration" in data:
        lines.append(
            f"stick: worst penetration {float(data.penetration.max()):.2g} of a skin of "
            f"{float(data.attrs['skin']):.2g}, farthest travel in a step "
            f"{float(data.travel.max()):.3g}, {int(data.undone.sum())} steps undone, "
            f"{int(data['count'].sel(status='invalid').sum())} "
            "trials went wrong"
        )
    return "\n".join(lines)


def _add_claims(parser: argparse.ArgumentParser) -> None:
    _add_run(parser, trials=1000)
    parser.add_argument(
        "--results",
        type=Path,
        default=None,
        metavar="DIR",
        help="judge kept data (fig9a.nc, fig9b.nc, ...) instead of running anew",
    )
    parser.set_defaults(run=_claims)


def _claims(arguments: argparse.Namespace) -> None:
    figures = {}
    for name in FIGURES_NEEDED:
        if arguments.results is None:
            figures[name] = run_figure(name, **_run_settings(arguments))
        else:
            figures[name] = _load_figure(arguments.results / f"fig{name}.nc", name)
    for claim in judge_claims(figures):
        print(f"{claim.number}. {claim.verdict.upper()}: {claim.text}\n     {claim.evidence}")


def _load_figure(path: Path, name: str) -> xr.Dataset:
    if not path.is_file():
        raise ValueError(f"{path} is missing: --results has to name a folder with fig{name}.nc")
    try:
        data = xr.load_dataset(path, engine="h5netcdf")
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} is no netCDF file that can be read") from error
    if data.attrs.get("figure") != name:
        raise ValueError(f"{path} does not hold Fig. {name}: make it by 'pcjax figure {name}'")
    return data


def _check_writable(path: Path | None) -> None:
    """Fails before the work, not after it, when a file cannot be written."""
    if path is None:
        return
    folder = path.parent
    if not folder.is_dir():
        raise ValueError(f"cannot write {path}: the folder {folder} does not exist")
    if path.is_dir():
        raise ValueError(f"cannot write {path}: it is a folder")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise ValueError(f"cannot write {path}: no permission")


def _check_picture(path: Path | None) -> None:
    """Fails before the work when a picture cannot be written or is of no known kind."""
    _check_writable(path)
    if path is not None and path.suffix.lower() not in _PICTURES:
        raise ValueError(f"cannot draw {path}: its ending has to be one of {', '.join(_PICTURES)}")


def _save_picture(plot: str, data: Any, path: Path) -> None:
    from pcjax.viz import plots  # matplotlib takes a second to import, so only where it is needed

    getattr(plots, plot)(data).savefig(path, dpi=130)


if __name__ == "__main__":
    main()
