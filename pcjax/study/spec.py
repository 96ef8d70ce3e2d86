"""What a study is: a hand, what it has to hold, how it is tried, and what is swept."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from pcjax.checks import check_between, check_count, check_kind
from pcjax.components import Component, Quantity, quantities, usual_in
from pcjax.design.parameters import Parameter, labelled, parameter
from pcjax.design.space import Design, DesignSpace, Space, design_space
from pcjax.geometry import Scalar
from pcjax.model.bodies.base import BODIES, Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import DRIVES, Drive
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.layout import Place
from pcjax.model.presets import HANDS
from pcjax.model.scenario import (
    DIRECTIONS,
    Scenario,
    check_kinds,
    default_direction,
    usual_max_steps,
)
from pcjax.quality.task import Task
from pcjax.simulate.choose import check_engine
from pcjax.simulate.engine import Engine
from pcjax.study.vary import change, full_name, unit_of
from pcjax.study.write import hand_table, text_of
from pcjax.units import check_units

TRIALS = 5000
"""Of a condition in a direction unless said otherwise, as in the paper (Sec. 3.2)."""

MOST_TRIALS = 1_000_000
"""The same, at most, where a precision is asked for."""

MOST_CONDITIONS = 100_000
"""Of a sweep."""

MOST_AT_ONCE = 64
"""Conditions that a hand can be optimised for."""


@dataclass(frozen=True)
class Run:
    """How a hand is tried.

    Arguments:
        direction: "does", "eoen" or "both"; unless given, both for a hand that has both.
        trials: for each direction, 5,000 unless given; where a precision is asked for the most of
            them, 1,000,000 unless given.
        max_steps: limit in steps of 0.001 s; the paper's unless given.
        seed: trial i depends on (seed, i) alone.
        start_spread: of the starts, in palm lengths.
        engine: one, or the kind of one with its usual parameters, such as "event" or "stepping", or
            "auto" (see `choose_engine`).
        dt: the solver's step, s, for an engine that has one; chosen by the engine unless given.
        precision: 32 or 64 bits.
        precision_target: there are trials enough once half the 95 % interval of the score (of
            index 1 where there is no score) is this share of it (see `pcjax.quality.stopping`);
            where hands are compared, that of the difference to the best hand.

    Raises:
        ValueError: a name or number out of range.
    """

    direction: str | None = None
    trials: int | None = None
    max_steps: int | None = None
    seed: int = 0
    start_spread: float = 0.1
    engine: str | Engine = "auto"
    dt: float | None = None
    precision: int = 32
    precision_target: float | None = None

    def __post_init__(self) -> None:
        for name, value, names in (
            ("direction", self.direction, (None, *DIRECTIONS, "both")),
            ("precision", self.precision, (32, 64)),
        ):
            if value not in names:
                allowed = ", ".join(str(n) for n in names if n is not None)
                raise ValueError(f"{name} is {value!r}: it has to be one of {allowed}")
        check_engine(self.engine)
        if self.trials is not None:
            check_count("trials", self.trials, 1, 2**31 - 1)
        if self.max_steps is not None:
            check_count("max_steps", self.max_steps, 1, 2**31 - 1)
        check_count("seed", self.seed, 0, 2**32 - 1)
        check_between("start_spread", self.start_spread, 0.0, 1.0)
        if self.dt is not None:
            check_between("dt", self.dt, 1e-6, 1.0)
        if self.precision_target is not None:
            check_between("precision_target", self.precision_target, 1e-4, 1.0)

    def as_table(self) -> dict[str, Any]:
        """Its settings by their names in study files, with the engine's parameters; what is not set
        is left out.

        Raises:
            ValueError: the engine is of a class that is not registered.
        """
        table: dict[str, Any] = {}
        for name, value in vars(self).items():
            if isinstance(value, Engine):
                table |= {"engine": value.name} | value.as_table()
            elif value is not None:
                table[name] = value
        return table


def own_parameters(engine: type[Engine]) -> dict[str, Quantity]:
    """The parameters of an engine by their names in study files, but for those that every run has,
    such as `dt`."""
    return {
        what.file_key: what
        for what in quantities(engine).values()
        if what.key and what.key not in Run.__dataclass_fields__
    }


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
            listed = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise ValueError(f"[sweep] values that go together have to be as many each: {listed}")
        if self.count > MOST_CONDITIONS:
            listed = " x ".join(map(str, lengths.values()))
            raise ValueError(
                f"[sweep] is {listed} = {self.count:,} conditions: the most is {MOST_CONDITIONS:,}"
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
class Objective:
    """What the best hand is the best at.

    Arguments:
        over: the conditions: every value of one number with every value of the others; those of the
            study alone unless given.
        weights: of the conditions, the last number's values changing fastest, in the mean of the
            scores' logarithms; alike unless given.
        worst: whether the least of the scores counts, in place of that mean.

    Raises:
        ValueError: a number without values or with one twice, or as many weights as there are no
            conditions.
    """

    over: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    weights: tuple[float, ...] = ()
    worst: bool = False

    def __post_init__(self) -> None:
        for name, values in self.over.items():
            if not values:
                raise ValueError(f"{name} has no values")
            if len(set(values)) < len(values):
                raise ValueError(f"{name} has a value twice")
        count = math.prod(len(values) for values in self.over.values())
        if count > MOST_AT_ONCE:
            raise ValueError(
                f"there are {count:,} conditions for each hand: the most is {MOST_AT_ONCE}"
            )
        if self.weights and len(self.weights) != count:
            raise ValueError(
                f"there are {len(self.weights)} weights for {count} "
                f"{'condition' if count == 1 else 'conditions'}: as many of either"
            )
        for weight in self.weights:
            if not 0 < weight < math.inf:
                raise ValueError(f"a weight is {weight:g}: it has to be above 0")
        if self.weights and self.worst:
            raise ValueError("weights are for the mean of scores, and the worst counts")

    def points(self) -> list[dict[str, float]]:
        """The numbers of each condition."""
        return [
            dict(zip(self.over, row, strict=True)) for row in itertools.product(*self.over.values())
        ]


_USUAL: Any = None
"""Stands for a part of a study that follows from its units, until it is made."""


def usual_radius(drive: Drive, hand: HandDesign, units: str) -> Scalar | None:
    """The object's radius unless one is given; None where lengths are in a real unit, and the
    drive's usual radius is a number of its own in place of a share of the palm."""
    palm = hand.palm_length
    size = drive.usual_radius(palm)
    share = units == "model" or float(drive.usual_radius(2.0 * palm)) == 2.0 * float(size)
    return size if share else None


@dataclass(frozen=True)
class Study:
    """A hand, its object, its drive, the contact law, how it is tried, and what is swept.

    Arguments:
        hand, body: their lengths are in `units`.
        drive: what moves the hand, gravity in `units` / s^2; the paper's wrist unless given, with
            the earth's gravity where `units` is a real unit.
        law: contact law; the paper's unless given, with a resting speed of 1 mm/s where `units` is
            a real unit.
        run: how the hand is tried.
        sweep: what is swept.
        objective: what the best hand is the best at.
        units: of all lengths: "mm", "cm" or "m"; "model" for the paper's, in which g is 9.8.

    Raises:
        TypeError: something that is no hand, body, drive or contact law.
        ValueError: an unknown unit.

    Examples:
        >>> import pcjax
        >>> hand = pcjax.box_hand(0.17, palm_length=80)
        >>> pcjax.Study(hand, pcjax.Circle(4), units="mm").drive.gravity
        9800.0
    """

    hand: HandDesign
    body: Body
    drive: Drive = _USUAL
    law: ContactLaw = _USUAL
    run: Run = field(default_factory=Run)
    sweep: Sweep | None = None
    units: str = "model"
    objective: Objective = field(default_factory=Objective)

    task_kind: ClassVar[type[Task]] = Task

    dimensions: ClassVar[int] = 2
    """Of the space that the hand is in."""

    inspected_by: ClassVar[str] = "study.inspect.inspect_plane"
    page_in: ClassVar[str] = "view.web.page"
    """What looks at it before it is run, and the module with the page of `pcjax view`, by their
    names: they are imported when they are asked for."""

    trials_of_search: ClassVar[tuple[int, int]] = 1000, 10_000
    """Of a hand in a search, and of the final comparison."""

    trials_of_map: ClassVar[int] = 400

    def __post_init__(self) -> None:
        check_units(self.units)
        for name, usual in (("drive", WristTilt), ("law", ContactLaw)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, usual_in(usual, self.units))
        check_kinds(self.hand, self.body, self.drive, self.law)

    @classmethod
    def usual(
        cls,
        hand: HandDesign | None = None,
        body: Body | None = None,
        drive: Drive | None = None,
        law: ContactLaw | None = None,
        run: Run | None = None,
        units: str = "model",
    ) -> Study:
        """A study in which what is not given is as usual: the paper's wrist, its hand for the
        drive, and a circle that is as large as the drive's usual one.

        Raises:
            ValueError: in a real unit there is no usual hand, nor a usual circle on the arm.
        """
        check_units(units)
        drive = usual_in(WristTilt, units) if drive is None else drive
        check_kind("drive", drive, Drive)
        if hand is None:
            hand = usual_in(HANDS[drive.usual_hand], units).design()
        check_kind("hand", hand, HandDesign)
        if body is None:
            size = usual_radius(drive, hand, units)
            if size is None:
                raise ValueError(quantities(Circle)["radius"].why_missing(units))
            body = Circle(size)
        law = usual_in(ContactLaw, units) if law is None else law
        return cls(hand, body, drive, law, Run() if run is None else run, units=units)

    @property
    def directions(self) -> tuple[str, ...]:
        """Of "does" and "eoen", those to be evaluated."""
        return self._directions_and_why[0]

    @property
    def why_no_eoen(self) -> str:
        """Why EoEn is none of the directions where none was asked for; else ""."""
        return self._directions_and_why[1]

    @functools.cached_property
    def _directions_and_why(self) -> tuple[tuple[str, ...], str]:
        chosen, missing = self.run.direction, ""
        if chosen is None:
            chosen, missing = default_direction(self.hand, self.drive)
        return (tuple(DIRECTIONS) if chosen == "both" else (chosen,)), missing

    @property
    def max_steps(self) -> int:
        """The limit, in steps of 0.001 s."""
        given = self.run.max_steps
        return usual_max_steps(self.body, self.drive) if given is None else given

    @property
    def trials(self) -> int:
        """For each direction; the most of them where a precision is asked for."""
        usual = TRIALS if self.run.precision_target is None else MOST_TRIALS
        return usual if self.run.trials is None else self.run.trials

    @property
    def components(self) -> dict[str, Component]:
        """What has numbers of its own, by the tables of a study file."""
        found: dict[str, Component] = {
            "body": self.body,
            "drive": self.drive,
            "contact": self.law,
        }
        if isinstance(self.run.engine, Engine):
            found["run"] = self.run.engine
        return found

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
            if name == "start_spread":
                study = replace(study, run=replace(study.run, start_spread=value))
                continue
            hand, parts = change(study.hand, study.components, name, value)
            body, drive, law = parts["body"], parts["drive"], parts["contact"]
            run = replace(study.run, engine=parts.get("run", study.run.engine))
            study = replace(study, hand=hand, body=body, drive=drive, law=law, run=run)
        return study

    def check_drawn(self) -> None:
        """Fails before the work where a picture of the hand cannot be made.

        Raises:
            ValueError: what it takes is missing.
        """

    def places_ahead(self) -> list[Place]:
        """What checks will look at of the hand: that of many studies is worked out together in
        little more time than of one."""
        hand, spread = self.hand, self.run.start_spread
        radius = self.body.radius + 0.5 * hand.thickness
        found: list[Place] = [(hand, radius, spread)]
        if self.run.direction != "does" and min(map(len, hand.lengths)) > 1:
            mirrored = hand.with_fingertips_mirrored()
            found += [(mirrored, radius, spread), (hand, 0.0, 0.0), (mirrored, 0.0, 0.0)]
        return found

    def unit_of(self, name: str) -> str:
        """The unit of a number that can be swept."""
        return unit_of(name, self.components, self.units)

    def full_name(self, name: str) -> str:
        """A component's number as files name it, from what one types."""
        return full_name(name, self.components)

    @property
    def usual_free(self) -> tuple[str, ...]:
        """The parameters of the hand that one looks at first."""
        limbs = min(len(lengths) for lengths in self.hand.lengths)
        if limbs > 2:
            return "fingertip_angle_deg", "fingertip_length"
        return "joint_angle_1_deg", "joint_angle_2_deg" if limbs == 2 else "link_length_1"

    def label_of(self, name: str) -> str:
        """What may be free, or along a map's side, as files name it, from what one types."""
        return self.full_name(labelled(name))

    def parameter(self, label: str, bounds: tuple[float, float] | None) -> Parameter:
        """A parameter of the hand, with its usual bounds unless some are given.

        Raises:
            ValueError: there is none of that label, or the bounds are out of order.
        """
        return parameter(label, self.hand, *(bounds or (None, None)))

    def space(
        self,
        free: Mapping[str, tuple[float, float] | None],
        clearance: float | None = None,
        limits: Sequence[str] = (),
    ) -> Space:
        """The hands that differ from this one in the parameters named; see `design_space`.

        Raises:
            ValueError: as `design_space`, or what does not apply to such hands.
        """
        width = max(float(study.body.width) for study in self.objective_studies())
        return design_space(self.hand, free, width, clearance, limits, self.directions)

    def map_space(self, free: Sequence[Any]) -> Space:
        """The hands of a map over some of its parameters. Where none is the hand's, that stays as
        it is: one length of it stands for all."""
        free = tuple(free) or (parameter("link_length_11", self.hand),)
        return DesignSpace(self.hand, free, 0.0, float(self.body.width), (), self.directions)

    def designed(self, space: Space, design: Design) -> Study:
        """This study with a space's hand, and nothing swept."""
        return replace(self, hand=space.hand(design), sweep=None)

    def objective_studies(self) -> list[Study]:
        """This study in each condition that its objective names, in their order; itself alone where
        it names none.

        Raises:
            ValueError: an unknown name, a number of the hand's, or one out of range.
        """
        found = []
        for point in self.objective.points():
            study = self
            for name, value in point.items():
                try:
                    study = study.having({name: value})
                except ValueError as error:
                    raise ValueError(f"{name}: {error}") from None
                if study.hand is not self.hand:
                    raise ValueError(
                        f"{name}: it is the hand that is looked for; name numbers of "
                        "the object, the drive or the contact"
                    )
            found.append(study)
        return found

    def tables(self) -> dict[str, Mapping[str, Any]]:
        """What is tried, as the tables of a file."""
        return {
            "units": {"length": self.units},
            "hand": hand_table(self.hand),
            "body": {"kind": BODIES.kind_of(self.body)} | self.body.as_table(),
            "drive": {"kind": DRIVES.kind_of(self.drive)} | self.drive.as_table(),
            "contact": self.law.as_table(),
        }

    @property
    def files_digest(self) -> str:
        """Of the files that the study is made of, beside its own; "" if there are none."""
        return ""

    def run_table(self) -> dict[str, Any]:
        """How it is tried, as a table."""
        return self.run.as_table()

    def to_toml(self) -> str:
        """The study as a file's text; lengths in its units, angles in degrees.

        Raises:
            ValueError: the body, the drive or the engine is of a class that is not registered.
        """
        tables = self.tables() | {"run": self.run_table()}
        if self.objective != Objective():
            tables["objective"] = {
                **{k: list(v) for k, v in self.objective.over.items()},
                **({"weights": list(self.objective.weights)} if self.objective.weights else {}),
                **({"of": "worst"} if self.objective.worst else {}),
            }
        if self.sweep is not None:
            mode = {"mode": "zip"} if self.sweep.zipped else {}
            tables["sweep"] = mode | {k: list(v) for k, v in self.sweep.values.items()}
        return text_of(tables)
