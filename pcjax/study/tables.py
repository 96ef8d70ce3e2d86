"""The tables of a study file as a study."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from pcjax.checks import check_between, check_count, doubts_of_degrees
from pcjax.components import Component, Quantity, Registry, quantities
from pcjax.model.bodies.base import BODIES, Body
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import DRIVES, Drive
from pcjax.model.hand import HandDesign
from pcjax.model.presets import HANDS
from pcjax.simulate.choose import engine_names
from pcjax.simulate.engine import ENGINES
from pcjax.study.spec import (
    MOST_CONDITIONS,
    Objective,
    Run,
    Study,
    Sweep,
    own_parameters,
    usual_radius,
)
from pcjax.units import UNITS, doubts_of_gravity, doubts_of_model_units
from pcjax.words import did_you_mean

C = TypeVar("C", bound=Component)
T = TypeVar("T")


class Reader:
    """Reads tables; all its errors are ValueErrors that name the table and the key.

    Arguments:
        data: the tables, as TOML gives them.

    Attributes:
        doubts: what is strange about the angles and units read so far, a line each.
    """

    TABLES: ClassVar[tuple[str, ...]] = (
        "units", "hand", "body", "drive", "contact", "run", "objective", "sweep",
    )  # fmt: skip
    usual_units: ClassVar[str] = "model"

    def __init__(self, data: Mapping[str, Any]):
        self.data = data
        self.units = "model"
        self.doubts: list[str] = []

    def doubt(self, where: str, key: str, values: Iterable[float]) -> None:
        """Takes down what is strange about the angles of a key."""
        if key.endswith("_deg"):
            joints = key in ("angles_deg", "joint_angles_deg")
            self.doubts += doubts_of_degrees(f"[{where}] {key}", values, joints=joints)

    def study(self) -> Study:
        """The study that the tables are.

        Raises:
            ValueError: an unknown or missing key, or a value that does not do.
        """
        self.known("", self.data, self.TABLES)
        self.table("units", ("length",))
        self.units = self.word("units", "length", UNITS, self.usual_units)
        study = self.parts()
        sweep = self.sweep()
        if sweep is not None:
            for name, values in sweep.values.items():
                try:
                    for value in values:
                        study.having({name: value})
                except ValueError as error:
                    raise ValueError(f"[sweep] {name}: {error}") from None
        study.scenarios()
        objective = self.objective()
        try:
            replace(study, objective=objective).objective_studies()
        except ValueError as error:
            raise ValueError(f"[objective] {error}") from None
        return replace(study, objective=objective, sweep=sweep)

    def parts(self) -> Study:
        """The study, without what it sweeps."""
        drive = self.drive()
        hand = self.hand(drive)
        study = Study(hand, self.body(hand, drive), drive, self.law(), self.run(), units=self.units)
        self.doubt_units(study)
        return study

    def doubt_units(self, study: Study) -> None:
        """Takes down what is strange about the unit of lengths."""
        drive, hand = self.table("drive"), self.table("hand")
        doubts = doubts_of_gravity(drive.get("gravity"), study.units)
        self.doubts += [f"[drive] {doubt}" for doubt in doubts]
        if "palm_length" in hand and "gravity" not in drive and not self.table("units"):
            doubts = doubts_of_model_units(float(study.hand.palm_length), "[units] length")
            self.doubts += [f"[hand] {doubt}" for doubt in doubts]

    def hand(self, drive: Drive) -> HandDesign:
        given = self.table("hand")
        preset = self.word("hand", "preset", HANDS.kinds(), None)
        if preset is None and "lengths" not in given and "angles_deg" not in given:
            preset = drive.usual_hand
        if preset is not None:
            return self.sound("hand", self.component("hand", HANDS, "preset", preset, {}).design)
        table = self.table("hand", ("palm_length", "lengths", "angles_deg", "thickness"))
        lengths, degrees = self.rows("lengths"), self.rows("angles_deg")
        angles = [tuple(math.radians(x) for x in row) for row in degrees]
        for finger in (0, 1):
            if len(lengths[finger]) != len(angles[finger]):
                raise ValueError(
                    f"[hand] finger {finger + 1} has {len(lengths[finger])} lengths and "
                    f"{len(angles[finger])} angles: as many of either"
                )
        palm = self.number("hand", "palm_length")
        thickness = self.number("hand", "thickness") if "thickness" in table else 0.0
        fingers = (tuple(lengths[0]), tuple(lengths[1])), (angles[0], angles[1])
        return self.sound("hand", lambda: HandDesign(palm, *fingers, thickness))

    def component(
        self, where: str, registry: Registry[C], key: str, kind: str, usual: Mapping[str, Any]
    ) -> C:
        """A table as a component of that kind.

        Arguments:
            where: the table.
            registry: of its sort.
            key: under which the table says the kind.
            kind: which.
            usual: values of parameters, by name, that have no default of their own.
        """
        chosen = registry[kind]
        known = {what.file_key: what for what in quantities(chosen).values() if what.key}
        self.table_of(where, registry, kind, (key, *_keys(chosen)))
        given = self.given(where, known, usual)
        return self.sound(where, lambda: chosen(**given))

    def given(
        self, where: str, known: Mapping[str, Quantity], usual: Mapping[str, Any]
    ) -> dict[str, Any]:
        """The values of parameters, by the names of their fields: a table's, or what is usual."""
        table = self.table(where)
        given: dict[str, Any] = {}
        for key, what in known.items():
            if what.word and what.key in table:
                given[what.name] = self.no_number(where, what)
                continue
            if key in table:
                given[what.name] = self.value(where, key, what)
                continue
            given[what.name] = usual.get(what.name, what.default_in(self.units))
            if given[what.name] is MISSING:
                raise ValueError(f"[{where}] {what.why_missing(self.units)}")
        return given

    def value(self, where: str, key: str, what: Quantity) -> Any:
        """A parameter as Python has it."""
        if what.kind is bool:
            value = self.flag(where, key)
        elif what.kind is int:
            value = self.count(where, key)
        elif what.kind is str:
            value = self.text(where, key)
        elif what.many:
            value = self.places(where, key)
        elif what.count is None:
            value = self.number(where, key)
        else:
            value = self.numbers(where, key, what.count)
        self.sound(where, lambda: what.in_file().check(value))
        return what.from_file(value)

    def no_number(self, where: str, what: Quantity) -> Any:
        """What a parameter is in Python that a table gives by its word."""
        table = self.table(where)
        if what.file_key in table:
            raise ValueError(f"[{where}] {what.key} and {what.file_key}: give one of them")
        if table[what.key] != what.word:
            raise ValueError(
                f"[{where}] {what.key} is {table[what.key]!r}: it has to be '{what.word}'; "
                f"{what.file_key} is for numbers"
            )
        return what.from_file(what.word)

    def sound(self, where: str, make: Callable[[], T]) -> T:
        """What is made, or an error that names the table."""
        try:
            return make()
        except ValueError as error:
            raise ValueError(f"[{where}] {error}") from None

    def body(self, hand: HandDesign, drive: Drive) -> Body:
        kind = self.word("body", "kind", BODIES.kinds(), "circle")
        size = usual_radius(drive, hand, self.units)
        usual = {
            what.name: size
            for what in quantities(BODIES[kind]).values()
            if what.key == "radius" and what.default is MISSING and size is not None
        }
        return self.component("body", BODIES, "kind", kind, usual)

    def drive(self) -> Drive:
        kind = self.word("drive", "kind", DRIVES.kinds(), "wrist")
        return self.component("drive", DRIVES, "kind", kind, {})

    def law(self) -> ContactLaw:
        known = {what.file_key: what for what in quantities(ContactLaw).values() if what.key}
        self.table("contact", tuple(known))
        given = self.given("contact", known, {})
        return self.sound("contact", lambda: ContactLaw(**given))

    def run(self) -> Run:
        settings = tuple(vars(Run()))
        kind = self.word("run", "engine", engine_names(), "auto")
        own = {} if kind == "auto" else own_parameters(ENGINES[kind])
        table = self.table_of("run", ENGINES, kind, (*settings, *own))
        given: dict[str, Any] = {"engine": kind}
        if own:
            values = {
                own[key].name: self.value("run", key, own[key]) for key in own if key in table
            }
            given["engine"] = self.sound("run", lambda: ENGINES[kind](**values))
        if "direction" in table:
            given["direction"] = self.word("run", "direction", ("does", "eoen", "both"), None)
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

    def objective(self) -> Objective:
        table = self.table("objective")
        worst = self.word("objective", "of", ("mean", "worst"), "mean") == "worst"
        weights = table.get("weights", [])
        if not isinstance(weights, list) or not all(map(is_number, weights)):
            raise ValueError(f"[objective] weights is {weights!r}: it has to be a list of numbers")
        over = {
            name: self.line(name, value, "objective")
            for name, value in table.items()
            if name not in ("of", "weights")
        }
        for name, line in over.items():
            self.doubt("objective", name, line)
        try:
            return Objective(over, tuple(map(_float, weights)), worst)
        except ValueError as error:
            raise ValueError(f"[objective] {error}") from None

    def line(self, name: str, value: Any, where: str = "sweep") -> tuple[float, ...]:
        """The values that a number takes: a list, or a range as a table."""
        what = f"[{where}] {name}"
        if isinstance(value, list) and all(map(is_number, value)):
            return tuple(map(_float, value))
        if not isinstance(value, dict):
            raise ValueError(
                f"{what} is {value!r}: it has to be a list of numbers, or a range such as "
                "{ from = 0, to = 40, points = 5 } or { from = 0, to = 40, step = 10 }"
            )
        self.known(f"{what}: ", value, ("from", "to", "points", "step"))
        for key in ("from", "to"):
            if not is_number(value.get(key)):
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
        if not is_number(step) or not 0 < _float(step) < math.inf or not high >= low:
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

    def table_of(
        self, where: str, registry: Registry[Any], kind: str, keys: Sequence[str]
    ) -> Mapping[str, Any]:
        """A table that may have these keys; it says so where another one is of another kind."""
        for other in self.table(where):
            if other in keys:
                continue
            kinds = [k for k, component in registry.items() if other in _keys(component)]
            if kinds:
                raise ValueError(
                    f"[{where}] {other} does not apply to the {registry.noun} {kind}: it belongs "
                    f"to {' and '.join(kinds)}"
                )
        return self.table(where, keys)

    def number(self, where: str, key: str) -> float:
        value = self.table(where).get(key)
        if value is None:
            raise ValueError(f"[{where}] {key} is missing")
        if not is_number(value):
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

    def flag(self, where: str, key: str) -> bool:
        value = self.table(where)[key]
        if not isinstance(value, bool):
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be true or false")
        return value

    def word(self, where: str, key: str, names: Sequence[str], default: str | None) -> Any:
        value = self.table(where).get(key, default)
        if value is not None and value not in names:
            hint = did_you_mean(value, names) if isinstance(value, str) else ""
            raise ValueError(
                f"[{where}] {key} is {value!r}: {hint}it has to be {' or '.join(names)}"
            )
        return value

    def text(self, where: str, key: str) -> str:
        value = self.table(where)[key]
        if not isinstance(value, str):
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be a text")
        return value

    def numbers(self, where: str, key: str, count: int) -> tuple[float, ...]:
        value = self.table(where)[key]
        if not isinstance(value, list) or len(value) != count or not all(map(is_number, value)):
            raise ValueError(
                f"[{where}] {key} is {value!r}: it has to be a list of {count} numbers"
            )
        found = tuple(map(_float, value))
        self.doubt(where, key, found)
        return found

    def places(self, where: str, key: str) -> list[list[float]]:
        value = self.table(where)[key]
        good = isinstance(value, list) and len(value) > 0
        good = good and all(isinstance(row, list) and len(row) == 2 for row in value)
        if not good or not all(map(is_number, itertools.chain(*value))):
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be a list of places [x, y]")
        return [[_float(x) for x in row] for row in value]

    def rows(self, key: str) -> list[list[float]]:
        value = self.table("hand").get(key)
        if value is None:
            raise ValueError(f"[hand] {key} is missing")
        good = isinstance(value, list) and len(value) == 2
        good = good and all(isinstance(row, list) and all(map(is_number, row)) for row in value)
        if not good:
            raise ValueError(
                f"[hand] {key} is {value!r}: it has to be two lists of numbers, one for each finger"
            )
        found = [[_float(x) for x in row] for row in value]
        self.doubt("hand", key, itertools.chain(*found))
        return found


def _keys(component: type[Component]) -> list[str]:
    return [key for what in quantities(component).values() if what.key for key in what.file_keys]


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _float(value: float) -> float:
    """The number; infinity, as TOML reads 1e400, for a whole one that is as large."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
