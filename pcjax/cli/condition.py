"""The flags that describe a hand, its object and its drive, and the study file in their place."""

from __future__ import annotations

import argparse
import math
import warnings
from dataclasses import replace
from pathlib import Path

from pcjax import paper
from pcjax.checks import InputWarning, doubts_of_degrees
from pcjax.cli.parts import number
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import box_hand, two_joint_hand
from pcjax.quality.surrogate import Task
from pcjax.study import Study, load_study

_FLAGS = (
    "scenario",
    "body",
    "fingertip_angle",
    "joint_angles",
    "palm_length",
    "fingertip_length",
    "gap_width",
    "radius",
    "orientation",
    "restitution",
    "gravity",
)


def add_condition(parser: argparse.ArgumentParser) -> None:
    """The flags."""
    add = parser.add_argument
    add(
        "study",
        type=Path,
        nargs="?",
        default=None,
        metavar="FILE",
        help="a study file (TOML) in place of flags for the hand, its object and its drive; "
        "'pcjax study --example' prints one",
    )
    add(
        "--scenario",
        choices=("wrist", "arm"),
        default=None,
        help="what moves the hand (default: wrist)",
    )
    add("--body", choices=("circle", "stick"), default=None, help="the object (default: circle)")
    add(
        "--fingertip-angle",
        type=number,
        default=None,
        metavar="DEG",
        help=f"theta_g, degrees, of the wrist's box hand (default: {paper.BEST_ANGLE_DEG:g})",
    )
    first, second = paper.ARM_JOINT_ANGLES_DEG
    add(
        "--joint-angles",
        type=number,
        nargs=2,
        default=None,
        metavar=("A", "B"),
        help=f"theta_i1 and theta_i2, degrees, of the arm's hand (default: {first:g} {second:g})",
    )
    add(
        "--palm-length",
        type=number,
        default=None,
        metavar="L",
        help=f"L_p, model units (default: {paper.WRIST_PALM_LENGTH:g} on the wrist, "
        f"{paper.ARM_PALM_LENGTH:g} on the arm)",
    )
    add(
        "--fingertip-length",
        type=number,
        default=None,
        metavar="L",
        help="L_g, model units, of the wrist's box hand (default: 0.2 L_p)",
    )
    add(
        "--gap-width",
        type=number,
        default=None,
        metavar="W",
        help="W_g, model units, of the wrist's box hand (default: 0.4 L_p)",
    )
    add(
        "--radius",
        type=number,
        default=None,
        metavar="R",
        help="r_o, a circle's radius or a stick's half length, model units (default: 0.05 L_p on "
        f"the wrist, {paper.ARM_RADIUS:g} on the arm)",
    )
    add(
        "--orientation",
        type=number,
        default=None,
        metavar="DEG",
        help="a stick's angle from the palm at the start, degrees (default: 0)",
    )
    add(
        "--restitution",
        type=number,
        default=None,
        metavar="E",
        help=f"e_r (default: {paper.RESTITUTION:g})",
    )
    add(
        "--gravity",
        type=number,
        default=None,
        metavar="G",
        help=f"g (default: {paper.GRAVITY:g})",
    )


def condition(arguments: argparse.Namespace) -> Study:
    """What the flags or the study file ask for; flags that do not apply are refused."""
    if arguments.study is not None:
        for flag in _FLAGS:
            if getattr(arguments, flag) is not None:
                raise ValueError(
                    f"--{flag.replace('_', '-')} does not go with a study file: say it there"
                )
        return _with_flags(load_study(arguments.study), arguments)
    arm, stick = arguments.scenario == "arm", arguments.body == "stick"
    gravity = _given(arguments.gravity, paper.GRAVITY)
    for flag, applies, why in (
        ("fingertip_angle", not arm, "the arm's two-joint hand has --joint-angles"),
        ("fingertip_length", not arm, "it belongs to the wrist's box hand"),
        ("gap_width", not arm, "it belongs to the wrist's box hand"),
        ("joint_angles", arm, "the wrist's box hand has --fingertip-angle"),
        ("orientation", stick, "a circle has none; --body stick has"),
    ):
        if getattr(arguments, flag) is not None and not applies:
            name = "--" + flag.replace("_", "-")
            where = "--body circle" if flag == "orientation" else "--scenario "
            where += "" if flag == "orientation" else ("arm" if arm else "wrist")
            raise ValueError(f"{name} does not apply to {where}: {why}")
    if arm:
        angles = arguments.joint_angles or paper.ARM_JOINT_ANGLES_DEG
        hand = two_joint_hand(
            *(math.radians(angle) for angle in angles),
            palm_length=_given(arguments.palm_length, paper.ARM_PALM_LENGTH),
            lengths=paper.ARM_FINGER,
        )
        drive, radius = PlanarArm(gravity=gravity), paper.ARM_RADIUS
    else:
        length = _given(arguments.palm_length, paper.WRIST_PALM_LENGTH)
        hand = box_hand(
            math.radians(_given(arguments.fingertip_angle, paper.BEST_ANGLE_DEG)),
            palm_length=length,
            gap_width=arguments.gap_width,
            fingertip_length=arguments.fingertip_length,
        )
        drive, radius = WristTilt(gravity=gravity), 0.05 * length
    radius = _given(arguments.radius, radius)
    orientation = math.radians(_given(arguments.orientation, 0.0))
    law = ContactLaw(restitution=_given(arguments.restitution, paper.RESTITUTION))
    body = Stick(radius, orientation) if stick else Circle(radius)
    given = {
        "--fingertip-angle": [_given(arguments.fingertip_angle, 0.0)],
        "--joint-angles": arguments.joint_angles or [],
        "--orientation": [_given(arguments.orientation, 0.0)],
    }
    for flag, degrees in given.items():
        for doubt in doubts_of_degrees(flag, degrees, joints=flag == "--joint-angles"):
            warnings.warn(doubt, InputWarning, stacklevel=2)
    return _with_flags(Study(hand, body, drive, law), arguments)


def _with_flags(study: Study, arguments: argparse.Namespace) -> Study:
    """The study run as the flags say, where the command has them and they are given."""
    flags = ("max_steps", "seed", "engine", "dt", "precision")
    given = {name: getattr(arguments, name, None) for name in flags}
    given = {name: value for name, value in given.items() if value is not None}
    return replace(study, run=replace(study.run, **given))


def _given(value: float | None, default: float) -> float:
    return default if value is None else value


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


def usual_parameters(study: Study) -> tuple[str, str]:
    """The two parameters of a hand that one looks at first."""
    if isinstance(study.drive, WristTilt):
        return "fingertip_angle", "fingertip_length"
    return "joint_angle_1", "joint_angle_2"


def task_of(study: Study) -> Task:
    """What the study's hand has to be good at.

    Raises:
        ValueError: EoEn alone, which the best hand would be none at all for.
    """
    if study.directions == ("eoen",):
        raise ValueError("the score or DoEs can be looked at, EoEn alone makes no better hand")
    return Task(
        study.body,
        study.drive,
        study.directions,
        study.max_steps,
        study.law,
        study.run.start_spread,
    )
