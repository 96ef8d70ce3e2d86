"""A study file (TOML): a hand, what it has to hold, how it is tried, and what is swept."""

from __future__ import annotations

import itertools
import math
import os
import tomllib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pcjax import paper
from pcjax.checks import (
    InputWarning,
    check_between,
    check_count,
    did_you_mean,
    doubts_of_degrees,
    one_line,
)
from pcjax.design.space import DesignSpace, parameter
from pcjax.engines.choice import ENGINES
from pcjax.evaluate import default_max_steps
from pcjax.files import read_plain
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import HandDesign, box_hand, two_joint_hand
from pcjax.model.scenario import DIRECTIONS, Scenario, default_direction

MOST_CONDITIONS = 100_000
"""Of a sweep."""

_WRIST, _ARM, _LAW = WristTilt(), PlanarArm(), ContactLaw()


@dataclass(frozen=True)
class Run:
    """How a hand is tried.

    Arguments:
        direction: "does", "eoen" or "both"; unless given, both for a hand that has both.
        trials: for each direction; the most of them where a precision is asked for.
        max_steps: limit in steps of 0.001 s; the paper's unless given.
        seed: trial i depends on (seed, i) alone.
        start_spread: of the starts, in palm lengths.
        engine: "auto", "event" or "stepping".
        dt: the solver's step, s; chosen by the engine unless given.
        precision: 32 or 64 bits.
        precision_target: in a sweep, a condition has trials enough once half its 95 % interval is
            this share of its score (of index 1 where there is no score).

    Raises:
        ValueError: a name or number out of range.
    """

    direction: str | None = None
    trials: int = paper.TRIALS
    max_steps: int | None = None
    seed: int = 0
    start_spread: float = 0.1
    engine: str = "auto"
    dt: float | None = None
    precision: int = 32
    precision_target: float | None = None

    def __post_init__(self) -> None:
        for name, value, names in (
            ("direction", self.direction, (None, *DIRECTIONS, "both")),
            ("engine", self.engine, ENGINES),
            ("precision", self.precision, (32, 64)),
        ):
            if value not in names:
                allowed = ", ".join(str(n) for n in names if n is not None)
                raise ValueError(f"{name} is {value!r}: it has to be one of {allowed}")
        check_count("trials", self.trials, 2, 2**31 - 1)
        if self.max_steps is not None:
            check_count("max_steps", self.max_steps, 1, 2**31 - 1)
        check_count("seed", self.seed, 0, 2**32 - 1)
        check_between("start_spread", self.start_spread, 0.0, 1.0)
        if self.dt is not None:
            check_between("dt", self.dt, 1e-6, 1.0)
        if self.precision_target is not None:
            check_between("precision_target", self.precision_target, 1e-4, 1.0)


@dataclass(frozen=True)
class Sweep:
    """Which numbers are swept, and through what.

    Arguments:
        values: of each number by its name.
        zipped: whether the first values of all go together, then the second, and so on; else every
            value of one goes with every value of the others.

    Raises:
        ValueError: nothing to sweep, a value twice, lists of unequal length to be zipped, or far
            too many conditions.
    """

    values: Mapping[str, tuple[float, ...]]
    zipped: bool = False

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError("[sweep] is empty: name a number and its values")
        for name, values in self.values.items():
            if not values:
                raise ValueError(f"[sweep] {name} has no values")
            if not self.zipped and len(set(values)) < len(values):
                raise ValueError(f"[sweep] {name} has a value twice")
        lengths = {name: len(values) for name, values in self.values.items()}
        if self.zipped and len(set(lengths.values())) > 1:
            told = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise ValueError(f"[sweep] values that go together have to be as many each: {told}")
        if self.count > MOST_CONDITIONS:
            told = " x ".join(map(str, lengths.values()))
            raise ValueError(
                f"[sweep] is {told} = {self.count:,} conditions: the most is {MOST_CONDITIONS:,}"
            )

    @property
    def count(self) -> int:
        """How many conditions."""
        lengths = [len(values) for values in self.values.values()]
        return lengths[0] if self.zipped else math.prod(lengths)

    def points(self) -> list[dict[str, float]]:
        """The swept numbers of each condition, the last of them changing fastest."""
        lines = self.values.values()
        rows = zip(*lines, strict=True) if self.zipped else itertools.product(*lines)
        return [dict(zip(self.values, row, strict=True)) for row in rows]


@dataclass(frozen=True)
class Study:
    """A hand, its object, its drive, the contact law, how it is tried, and what is swept."""

    hand: HandDesign
    body: Circle | Stick
    drive: WristTilt | PlanarArm
    law: ContactLaw
    run: Run = field(default_factory=Run)
    sweep: Sweep | None = None

    @property
    def directions(self) -> tuple[str, ...]:
        """Of "does" and "eoen", those to be evaluated."""
        chosen = self.run.direction
        if chosen is None:
            chosen = default_direction(self.hand, self.drive)
        return tuple(DIRECTIONS) if chosen == "both" else (chosen,)

    @property
    def max_steps(self) -> int:
        """The limit, in steps of 0.001 s."""
        given = self.run.max_steps
        return default_max_steps(self.body, self.drive) if given is None else given

    def scenarios(self) -> dict[str, Scenario]:
        """The scenario in each direction.

        Raises:
            ValueError: EoEn of a hand that has none.
        """
        return {
            d: DIRECTIONS[d](self.hand, self.body, self.drive, self.law, self.run.start_spread)
            for d in self.directions
        }

    def conditions(self) -> list[tuple[dict[str, float], Study]]:
        """The swept numbers of each condition, and its study.

        Raises:
            ValueError: nothing is swept, or an unknown name.
        """
        if self.sweep is None:
            raise ValueError("the study sweeps nothing: it has no [sweep]")
        return [(point, self.having(point)) for point in self.sweep.points()]

    def having(self, values: Mapping[str, float]) -> Study:
        """This study with other numbers, by the names that `[sweep]` knows.

        Raises:
            ValueError: an unknown name, or a number out of range.
        """
        study = replace(self, sweep=None)
        for name, value in values.items():
            study = _setter(study, name)(study, value)
        return study

    def to_toml(self) -> str:
        """The study as a file's text; lengths in model units, angles in degrees."""
        return "\n\n".join(_text_of(name, table) for name, table in _tables(self).items()) + "\n"


def _tidy(radians: Any) -> float:
    return round(math.degrees(float(radians)), 9)


def _tables(study: Study) -> dict[str, dict[str, Any]]:
    """A study as the tables of its file."""
    hand, body, drive, law, run = study.hand, study.body, study.drive, study.law, study.run
    tables: dict[str, dict[str, Any]] = {
        "hand": {
            "palm_length": float(hand.palm_length),
            "lengths": [[float(x) for x in row] for row in hand.lengths],
            "angles_deg": [[_tidy(x) for x in row] for row in hand.angles],
        },
        "body": {
            "kind": "stick" if isinstance(body, Stick) else "circle",
            "radius": float(body.radius),
        },
    }
    if isinstance(body, Stick):
        tables["body"]["orientation_deg"] = _tidy(body.orientation)
    if isinstance(drive, WristTilt):
        tables["drive"] = {"kind": "wrist", "amplitude_deg": _tidy(drive.amplitude)}
    else:
        tables["drive"] = {
            "kind": "arm",
            "lengths": [float(x) for x in drive.lengths],
            "rest_deg": [_tidy(x) for x in drive.rest],
            "low_deg": [_tidy(x) for x in drive.low],
            "high_deg": [_tidy(x) for x in drive.high],
            "mount_angle_deg": _tidy(drive.mount_angle),
            "gravity_direction_deg": _tidy(drive.gravity_direction),
        }
    tables["drive"] |= {
        "gravity": float(drive.gravity),
        "ramp_time": drive.ramp_time,
        "period": drive.period,
    }
    tables["contact"] = {
        "restitution": float(law.restitution),
        "resting_speed": float(law.resting_speed),
    }
    tables["run"] = {k: v for k, v in vars(run).items() if v is not None}
    if study.sweep is not None:
        mode = {"mode": "zip"} if study.sweep.zipped else {}
        tables["sweep"] = mode | {k: list(v) for k, v in study.sweep.values.items()}
    return tables


def _text_of(name: str, table: Mapping[str, Any]) -> str:
    lines = [f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v!r}" for k, v in table.items()]
    return "\n".join([f"[{name}]", *lines])


# ------------------------------------------------------------------------- what can be swept

_Setter = Callable[[Study, float], Study]


def _set_palm(study: Study, value: float) -> Study:
    hand = HandDesign(value, study.hand.lengths, study.hand.angles)
    return replace(study, hand=hand)


def _set_radius(study: Study, value: float) -> Study:
    body = study.body
    stick = isinstance(body, Stick)
    return replace(study, body=Stick(value, body.orientation) if stick else Circle(value))


def _set_orientation(study: Study, value: float) -> Study:
    return replace(study, body=Stick(study.body.radius, math.radians(value)))


def _set_drive(name: str) -> _Setter:
    def set(study: Study, value: float) -> Study:
        value = math.radians(value) if name.endswith("_deg") else value
        return replace(study, drive=replace(study.drive, **{name.removesuffix("_deg"): value}))

    return set


def _set_law(name: str) -> _Setter:
    return lambda study, value: replace(study, law=replace(study.law, **{name: value}))


def _set_spread(study: Study, value: float) -> Study:
    return replace(study, run=replace(study.run, start_spread=value))


_SETTERS: dict[str, _Setter] = {
    "palm_length": _set_palm,
    "radius": _set_radius,
    "orientation_deg": _set_orientation,
    **{name: _set_drive(name) for name in ("gravity", "amplitude_deg", "ramp_time", "period")},
    **{name: _set_law(name) for name in ("restitution", "resting_speed")},
    "start_spread": _set_spread,
}


def _set_hand(name: str) -> _Setter:
    def set(study: Study, value: float) -> Study:
        free = replace(parameter(name, study.hand), low=-math.inf, high=math.inf)
        hand = DesignSpace(study.hand, (free,), 0.0, float(study.body.width)).hand([value])
        return replace(study, hand=hand)

    return set


def _setter(study: Study, name: str) -> _Setter:
    """How a number is changed by its name.

    Raises:
        ValueError: there is no such number in the study.
    """
    wrist, stick = isinstance(study.drive, WristTilt), isinstance(study.body, Stick)
    if name in _SETTERS and (wrist or name != "amplitude_deg"):
        if stick or name != "orientation_deg":
            return _SETTERS[name]
        raise ValueError(f"{name}: a circle has no orientation")
    bare = name.removesuffix("_deg")
    try:
        found = parameter(bare, study.hand)
    except ValueError as error:
        told = [n for n in _SETTERS if wrist or n != "amplitude_deg"]
        usual = ["fingertip_angle_deg", "fingertip_length", "gap_width"]
        usual += ["joint_angle_1_deg", "link_length_1"]
        hint = did_you_mean(name, [*usual, *told])
        if not hint and "there is no parameter" not in str(error):
            raise
        raise ValueError(
            f"there is no {name} to be swept: {hint}there are {', '.join([*usual, *told])}; "
            "_1 or _2 after fingertip_angle, fingertip_length: of one finger; joint_angle_IJ_deg, "
            "link_length_IJ: joint J of finger I"
        ) from None
    if found.label != name:
        raise ValueError(f"there is no {name} to be swept: did you mean {found.label}?")
    return _set_hand(bare)


# -------------------------------------------------------------------------------- reading


def load_study(path: str | os.PathLike[str]) -> Study:
    """Reads a study file.

    Warns (`InputWarning`) of angles that look like a slip of units.

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
    path = Path(path)
    content = read_plain(path)
    try:
        data = tomllib.loads(content.decode())
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} cannot be read: {one_line(error)}") from None
    except RecursionError:
        raise ValueError(f"{path} is no study: its lists are nested too deeply") from None
    except ValueError as error:  # of TOML, or of a number with thousands of digits
        raise ValueError(f"{path} is no TOML: {one_line(error)}") from None
    reader = _Reader(data)
    try:
        study = reader.study()
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None
    for doubt in reader.doubts:
        warnings.warn(f"{path}: {doubt}", InputWarning, stacklevel=2)
    return study


class _Reader:
    """Reads tables; all its errors are ValueErrors that name the table and the key."""

    def __init__(self, data: Mapping[str, Any]):
        self.data = data
        self.doubts: list[str] = []

    def doubt(self, where: str, key: str, values: Iterable[float]) -> None:
        """Takes down what is strange about the angles of a key."""
        if key.endswith("_deg"):
            joints = key in ("angles_deg", "joint_angles_deg")
            self.doubts += doubts_of_degrees(f"[{where}] {key}", values, joints=joints)

    def study(self) -> Study:
        self.known("", self.data, ("hand", "body", "drive", "contact", "run", "sweep"))
        drive = self.drive()
        hand = self.hand(isinstance(drive, WristTilt))
        study = Study(hand, self.body(hand, drive), drive, self.law(), self.run())
        sweep = self.sweep()
        if sweep is not None:
            for name, values in sweep.values.items():
                try:
                    for value in values:
                        study.having({name: value})
                except ValueError as error:
                    raise ValueError(f"[sweep] {name}: {error}") from None
        study.scenarios()
        return replace(study, sweep=sweep)

    def hand(self, wrist: bool) -> HandDesign:
        preset = self.word("hand", "preset", ("box", "two-joint"), None)
        given = self.table("hand")
        if preset is None and "lengths" not in given and "angles_deg" not in given:
            preset = "box" if wrist else "two-joint"
        if preset == "box":
            names = ("fingertip_length", "gap_width", "side_length")
            self.table("hand", ("preset", "palm_length", "fingertip_angle_deg", *names))
            return box_hand(
                math.radians(self.number("hand", "fingertip_angle_deg", paper.BEST_ANGLE_DEG)),
                palm_length=self.number("hand", "palm_length", paper.WRIST_PALM_LENGTH),
                **{name: self.optional("hand", name) for name in names},
            )
        if preset == "two-joint":
            self.table("hand", ("preset", "palm_length", "joint_angles_deg", "link_lengths"))
            angles = self.numbers("hand", "joint_angles_deg", 2, paper.ARM_JOINT_ANGLES_DEG)
            lengths = self.numbers("hand", "link_lengths", 2, paper.ARM_FINGER)
            return two_joint_hand(
                *(math.radians(angle) for angle in angles),
                palm_length=self.number("hand", "palm_length", paper.ARM_PALM_LENGTH),
                lengths=(lengths[0], lengths[1]),
            )
        self.table("hand", ("palm_length", "lengths", "angles_deg"))
        lengths, degrees = self.rows("lengths"), self.rows("angles_deg")
        angles = [tuple(math.radians(x) for x in row) for row in degrees]
        for finger in (0, 1):
            if len(lengths[finger]) != len(angles[finger]):
                raise ValueError(
                    f"[hand] finger {finger + 1} has {len(lengths[finger])} lengths and "
                    f"{len(angles[finger])} angles: as many of either"
                )
        return HandDesign(
            self.number("hand", "palm_length"),
            (tuple(lengths[0]), tuple(lengths[1])),
            (angles[0], angles[1]),
        )

    def body(self, hand: HandDesign, drive: WristTilt | PlanarArm) -> Circle | Stick:
        kind = self.word("body", "kind", ("circle", "stick"), "circle")
        given = self.table("body", ("kind", "radius", "orientation_deg"))
        if kind == "circle" and "orientation_deg" in given:
            raise ValueError("[body] orientation_deg does not apply to a circle")
        wrist = isinstance(drive, WristTilt)
        usual = 0.05 * float(hand.palm_length) if wrist else paper.ARM_RADIUS
        radius = self.number("body", "radius", usual)
        if kind == "circle":
            return Circle(radius)
        return Stick(radius, math.radians(self.number("body", "orientation_deg", 0.0)))

    def drive(self) -> WristTilt | PlanarArm:
        kind = self.word("drive", "kind", ("wrist", "arm"), "wrist")
        usual: WristTilt | PlanarArm = _WRIST if kind == "wrist" else _ARM
        given: dict[str, Any] = {
            name: self.number("drive", name, float(getattr(usual, name)))
            for name in ("gravity", "ramp_time", "period")
        }
        if isinstance(usual, WristTilt):
            self.table("drive", ("kind", "amplitude_deg", *given))
            tilt = self.number("drive", "amplitude_deg", _tidy(usual.amplitude))
            return WristTilt(math.radians(tilt), **given)
        angles = ("rest_deg", "low_deg", "high_deg")
        directions = ("mount_angle_deg", "gravity_direction_deg")
        self.table("drive", ("kind", "lengths", *angles, *directions, *given))
        for name in angles:
            own = tuple(map(_tidy, getattr(usual, name.removesuffix("_deg"))))
            three = self.numbers("drive", name, 3, own)
            given[name.removesuffix("_deg")] = tuple(map(math.radians, three))
        for name in directions:
            value = self.number("drive", name, _tidy(getattr(usual, name.removesuffix("_deg"))))
            given[name.removesuffix("_deg")] = math.radians(value)
        lengths = self.numbers("drive", "lengths", 3, tuple(map(float, usual.lengths)))
        return PlanarArm((lengths[0], lengths[1], lengths[2]), **given)

    def law(self) -> ContactLaw:
        names = ("restitution", "resting_speed")
        self.table("contact", names)
        return ContactLaw(
            *(self.number("contact", name, float(getattr(_LAW, name))) for name in names)
        )

    def run(self) -> Run:
        usual = Run()
        table = self.table("run", tuple(vars(usual)))
        given: dict[str, Any] = {}
        for name in ("direction", "engine"):
            if name in table:
                names = ("does", "eoen", "both") if name == "direction" else ENGINES
                given[name] = self.word("run", name, names, None)
        for name in ("trials", "max_steps", "seed", "precision"):
            if name in table:
                given[name] = self.count("run", name)
        for name in ("start_spread", "dt", "precision_target"):
            if name in table:
                given[name] = self.number("run", name)
        try:
            return Run(**given)
        except ValueError as error:
            raise ValueError(f"[run] {error}") from None

    def sweep(self) -> Sweep | None:
        if "sweep" not in self.data:
            return None
        table = self.data["sweep"]
        if not isinstance(table, dict):
            raise ValueError("sweep has to be a table, [sweep]")
        zipped = self.word("sweep", "mode", ("grid", "zip"), "grid") == "zip"
        values = {name: self.line(name, v) for name, v in table.items() if name != "mode"}
        for name, line in values.items():
            self.doubt("sweep", name, line)
        return Sweep(values, zipped)

    def line(self, name: str, value: Any) -> tuple[float, ...]:
        """The values of a swept number: a list, or a range as a table."""
        what = f"[sweep] {name}"
        if isinstance(value, list) and all(map(_is_number, value)):
            return tuple(map(_float, value))
        if not isinstance(value, dict):
            raise ValueError(
                f"{what} is {value!r}: it has to be a list of numbers, or a range such as "
                "{ from = 0, to = 40, points = 5 } or { from = 0, to = 40, step = 10 }"
            )
        self.known(f"{what}: ", value, ("from", "to", "points", "step"))
        for key in ("from", "to"):
            if not _is_number(value.get(key)):
                raise ValueError(f"{what}: a range needs a number for {key}")
        low, high = _float(value["from"]), _float(value["to"])
        if not (math.isfinite(low) and math.isfinite(high)):
            raise ValueError(f"{what} goes from {low:g} to {high:g}: it has to be finite")
        if ("points" in value) == ("step" in value):
            raise ValueError(f"{what}: a range needs either points or step")
        if "points" in value:
            count = value["points"]
            if isinstance(count, bool) or not isinstance(count, int):
                raise ValueError(f"{what}: points is {count!r}: it has to be a whole number")
            check_count(f"{what}: points", count, 1, MOST_CONDITIONS)
            return tuple(float(x) for x in np.linspace(low, high, count).round(12))
        step = value["step"]
        if not _is_number(step) or not 0 < _float(step) < math.inf or not high >= low:
            raise ValueError(
                f"{what}: step is {step!r} from {low:g} to {high:g}: it has to lead up"
            )
        check_between(f"{what}: number of steps", (high - low) / _float(step), 0, MOST_CONDITIONS)
        count = math.floor((high - low) / _float(step) + 1e-9) + 1
        return tuple(float(x) for x in (low + _float(step) * np.arange(count)).round(12))

    def known(self, where: str, table: Mapping[str, Any], names: Sequence[str]) -> None:
        for key in table:
            if key not in names:
                raise ValueError(
                    f"unknown key {where}{key}: {did_you_mean(key, names)}"
                    f"there {'are' if len(names) > 1 else 'is'} {', '.join(names)}"
                )

    def table(self, name: str, keys: Sequence[str] | None = None) -> Mapping[str, Any]:
        found = self.data.get(name, {})
        if not isinstance(found, dict):
            raise ValueError(f"{name} has to be a table, [{name}]")
        if keys is not None:
            self.known(f"[{name}] ", found, keys)
        return found

    def optional(self, where: str, key: str) -> float | None:
        return self.number(where, key) if key in self.table(where) else None

    def number(self, where: str, key: str, default: float | None = None) -> float:
        value = self.table(where).get(key, default)
        if value is None:
            raise ValueError(f"[{where}] {key} is missing")
        if not _is_number(value):
            unit = ", in degrees" if key.endswith("_deg") else ""
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be a number{unit}")
        value = _float(value)
        self.doubt(where, key, [value])
        return value

    def count(self, where: str, key: str) -> int:
        value = self.table(where)[key]
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be a whole number")
        return value

    def word(self, where: str, key: str, names: Sequence[str], default: str | None) -> Any:
        value = self.table(where).get(key, default)
        if value is not None and value not in names:
            hint = did_you_mean(value, names) if isinstance(value, str) else ""
            raise ValueError(
                f"[{where}] {key} is {value!r}: {hint}it has to be {' or '.join(names)}"
            )
        return value

    def numbers(
        self, where: str, key: str, count: int, default: Sequence[float]
    ) -> tuple[float, ...]:
        value = self.table(where).get(key, list(default))
        if not isinstance(value, list) or len(value) != count or not all(map(_is_number, value)):
            raise ValueError(
                f"[{where}] {key} is {value!r}: it has to be a list of {count} numbers"
            )
        found = tuple(map(_float, value))
        self.doubt(where, key, found)
        return found

    def rows(self, key: str) -> list[list[float]]:
        value = self.table("hand").get(key)
        if value is None:
            raise ValueError(f"[hand] {key} is missing")
        good = isinstance(value, list) and len(value) == 2
        good = good and all(isinstance(row, list) and all(map(_is_number, row)) for row in value)
        if not good:
            raise ValueError(
                f"[hand] {key} is {value!r}: it has to be two lists of numbers, one for each finger"
            )
        found = [[_float(x) for x in row] for row in value]
        self.doubt("hand", key, itertools.chain(*found))
        return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _float(value: float) -> float:
    """The number; infinity, as TOML reads 1e400, for a whole one that is as large."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


EXAMPLE = """\
# A study. Lengths are in model units, angles in degrees, times in seconds. Whatever is left out is
# as in the paper. `pcjax evaluate` and `pcjax optimize` take the hand as it is written here,
# `pcjax sweep` goes through [sweep].

[hand]
# A preset:
#   preset = "box"              # the paper's box hand: palm_length, fingertip_angle_deg,
#                               # fingertip_length, gap_width, side_length
#   preset = "two-joint"        # its hand for the arm: palm_length, joint_angles_deg, link_lengths
# or any two chains, finger 1 on the left, finger 2 on the right: the links from the palm outwards,
# and the angle of the joint before each (0: straight on; positive: inwards).
palm_length = 500.0
lengths = [[500.0, 150.0, 120.0], [420.0, 190.0, 80.0]]
angles_deg = [[90.0, 90.0, 75.0], [85.0, 95.0, 60.0]]

[body]
kind = "circle"                 # or "stick", with orientation_deg
radius = 25.0                   # of a stick: its half length

[drive]
kind = "wrist"                  # tilts the hand; or "arm", which carries it about
amplitude_deg = 30.0            # largest tilt
gravity = 9.8
ramp_time = 1.0                 # of each period, in which the hand turns
period = 10.0

[contact]
restitution = 0.1

[run]
direction = "both"              # DoEs and EoEn, and so the score; or "does" or "eoen"
trials = 200                    # for each condition and direction; the paper has 5000
max_steps = 60_000              # limit, steps of 0.001 s; the paper has 600_000
seed = 0
# precision_target = 0.01       # stop a condition once its score is known to 1 % (95 %)

[sweep]
# Each name with a list or a range. Also: fingertip_length, gap_width, joint_angle_IJ_deg,
# link_length_IJ (joint J of finger I), palm_length, orientation_deg, gravity, amplitude_deg,
# ramp_time, period, restitution, resting_speed, start_spread.
# mode = "zip"                  # first with first, second with second; else all with all
fingertip_angle_1_deg = { from = 0, to = 30, step = 15 }
radius = [15.0, 25.0]
"""
"""A commented study that runs; `pcjax study --example` prints it."""
