"""Studies of hands in three dimensions, and their files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pcjax.components import Component, quantities
from pcjax.design.postures import PostureSpace, posture_parameter, posture_space
from pcjax.design.space import Design, Space
from pcjax.importing import named
from pcjax.model.contact import ContactLaw
from pcjax.model.layout import Place
from pcjax.model.scenario import Scenario
from pcjax.model.spatial.bodies import SPATIAL_BODIES
from pcjax.model.spatial.hand import PRESETS, SpatialHand, several
from pcjax.model.spatial.regions import ESCAPES, Escape, StartBox
from pcjax.model.spatial.scenario import SpatialScenario, check_spatial, why_no_spatial_eoen
from pcjax.model.spatial.tilt import SPATIAL_DRIVES
from pcjax.quality.spatial import SpatialTask
from pcjax.results.files import digest
from pcjax.study.spec import Run, Study
from pcjax.study.tables import Reader
from pcjax.study.vary import names
from pcjax.units import check_units
from pcjax.words import did_you_mean

TRIALS = 1000
"""Of a condition in a direction unless said otherwise."""

_MOST_FREE = 6
"""Joints that a search moves unless it is told which."""

_OF_CONTACT = ("restitution", "friction")


@dataclass(frozen=True)
class SpatialStudy(Study):
    """A hand in three dimensions, its object, its tilt, the contact law, how it is tried, and what
    is swept; see `Study`. Lengths are in metres, as MuJoCo's models have them.

    Raises:
        TypeError: something that is no hand, object, tilt or contact law of these.
        ValueError: another unit, or a start spread, which is the hand's own here.

    Examples:
        >>> import pcjax
        >>> from pcjax import spatial
        >>> start = spatial.StartBox((0.0, 0.0, 0.036), (0.002, 0.002, 0.001))
        >>> hand = spatial.Hand(spatial.PRESETS["three-finger"], start, root="palm")
        >>> study = spatial.Study(hand, spatial.Sphere(0.024), spatial.Tilt(1.0, (1.0, 0.0, 0.0)))
        >>> study.directions, study.trials
        (('does',), 1000)
    """

    hand: Any  # a SpatialHand
    body: Any  # a SpatialBody
    drive: Any = None  # a SpatialTilt
    units: str = "m"

    task_kind = SpatialTask
    dimensions = 3
    inspected_by = "study.looking.inspect_spatial"
    page_in = "view.web.spatial"

    trials_of_search = 100, 1000
    trials_of_map = 100

    def __post_init__(self) -> None:
        check_units(self.units)
        if self.units != "m":
            raise ValueError(
                f"units is {self.units!r}: a hand in three dimensions is in m, as MuJoCo's models "
                "are"
            )
        if self.law is None:
            object.__setattr__(self, "law", ContactLaw(resting_speed=1e-3))
        check_spatial(self.hand, self.body, self.drive, self.law)
        if self.run.start_spread != Run.start_spread:
            raise ValueError(
                "start_spread is for hands in the plane: the start of this one says its spread"
            )
        # MuJoCo knows no other.
        object.__setattr__(self, "run", replace(self.run, precision=64))

    @property
    def _directions(self) -> tuple[str, str]:
        missing = why_no_spatial_eoen(self.hand)
        return self.run.direction or ("does" if missing else "both"), missing

    @property
    def directions(self) -> tuple[str, ...]:
        """Of "does" and "eoen", those to be evaluated."""
        chosen, _ = self._directions
        return ("does", "eoen") if chosen == "both" else (chosen,)

    @property
    def why_no_eoen(self) -> str:
        """Why EoEn is none of the directions where none was asked for; else ""."""
        return "" if self.run.direction else self._directions[1]

    @property
    def trials(self) -> int:
        """For each direction; the most of them where a precision is asked for."""
        if self.run.trials is None and self.run.precision_target is None:
            return TRIALS
        return super().trials

    @property
    def components(self) -> dict[str, Component]:
        """What has numbers of its own, by the tables of a study file."""
        found = super().components
        return {"start": self.hand.start, "escape": self.hand.escape, **found}

    def scenarios(self) -> dict[str, Scenario]:
        """The scenario in each direction.

        Raises:
            ValueError: EoEn of a hand that has none.
        """
        return {
            d: SpatialScenario(self.hand, self.body, self.drive, self.law, d == "eoen")
            for d in self.directions
        }

    def having(self, values: Mapping[str, float]) -> Study:
        """This study with other numbers, by the names that `[sweep]` knows: posture.JOINT in
        degrees (of slide joints in m), scale.BODY, and those of object, tilt, contact and escape.
        posture.A+B and scale.A+B are for several that are alike.

        Raises:
            ValueError: an unknown name, or a number out of range.
        """
        study = replace(self, sweep=None)
        for name, value in values.items():
            study = _changed(study, name, value)
        return study

    def check_drawn(self) -> None:
        """See `Study`: nothing can be rendered here."""
        named("view.rendering.check_rendering")()

    def places_ahead(self) -> list[Place]:
        """Nothing: each hand is looked at on its own."""
        return []

    def unit_of(self, name: str) -> str:
        """The unit of a number that can be swept."""
        if name.startswith("posture."):
            joint, *_ = several(name.removeprefix("posture."), self.hand.source.joints)
            _, hinge, _ = self.hand.source.joints[joint]
            return "degree" if hinge else "m"
        return "1" if name.startswith("scale.") else super().unit_of(name)

    def full_name(self, name: str) -> str:
        """A number as files name it."""
        return name if "." in name else super().full_name(name)

    @property
    def usual_free(self) -> tuple[str, ...]:
        """The joints that the posture names, as many as a search can well do with.

        Raises:
            ValueError: it names none.
        """
        if not self.hand.joints:
            joints = ", ".join(f"posture.{joint}" for joint in list(self.hand.source.joints)[:6])
            raise ValueError(
                "the study's posture names no joint: say what may change, such as "
                f"{joints or 'scale.BODY=0.8:1.2'}"
            )
        return tuple(f"posture.{joint}" for joint in self.hand.joints[:_MOST_FREE])

    def label_of(self, name: str) -> str:
        """What may be free, or along a map's side, as files name it, from what one types."""
        return self.full_name(name)

    def parameter(self, label: str, bounds: tuple[float, float] | None) -> Any:
        """A parameter of the hand; see `posture_parameter`."""
        return posture_parameter(label, self.hand, self.body, bounds)

    def space(
        self,
        free: Mapping[str, tuple[float, float] | None],
        clearance: float | None = None,
        limits: Sequence[str] = (),
    ) -> PostureSpace:
        """The hands that differ from this one in the parameters named; see `posture_space`.

        Raises:
            ValueError: as `posture_space`; a clearance or a limit; or a number of the object that
                the objective has values of, too.
        """
        for what, given in (("a clearance", clearance is not None), ("a limit", bool(limits))):
            if given:
                raise ValueError(
                    f"{what} is for hands in the plane: in three dimensions there are the bounds "
                    "of each parameter"
                )
        for name in self.objective.over:
            if name in free:
                raise ValueError(f"{name} is free, and the objective has values of it, too")
        return replace(posture_space(self.hand, free, self.body), dt=self.run.dt)

    def map_space(self, free: Sequence[Any]) -> PostureSpace:
        """The hands of a map over some of its parameters, or this one."""
        return PostureSpace(self.hand, tuple(free), self.body, dt=self.run.dt)

    def designed(self, space: Space, design: Design) -> Study:
        """This study with a space's hand, and its object where that is looked for, too."""
        return self.having(space.named(design))

    def tables(self) -> dict[str, Mapping[str, Any]]:
        """The study as the tables of its file."""
        hand = self.hand
        own = next((name for name, path in PRESETS.items() if str(path) == hand.file), None)
        whole: dict[str, Any] = {"file": hand.file} if own is None else {"preset": own}
        whole |= {
            name: list(value) if isinstance(value, tuple) else value
            for name in ("root", "exclude", "fingertips")
            if (value := getattr(hand, name))
        }
        tables: dict[str, Mapping[str, Any]] = {"units": {"length": self.units}, "hand": whole}
        if hand.joints:
            tables["hand.posture"] = {joint: hand.to_file(joint) for joint in hand.joints}
        if hand.links:
            tables["hand.scale"] = dict(zip(hand.links, map(float, hand.scales), strict=True))
        law = self.law.as_table()
        return tables | {
            "start": hand.start.as_table(),
            "escape": {"kind": ESCAPES.kind_of(hand.escape)} | hand.escape.as_table(),
            "body": {"kind": SPATIAL_BODIES.kind_of(self.body)} | self.body.as_table(),
            "drive": {"kind": SPATIAL_DRIVES.kind_of(self.drive)} | self.drive.as_table(),
            "contact": {key: law[key] for key in _OF_CONTACT if key in law},
        }

    @property
    def files_digest(self) -> str:
        """Of the hand's file, and of the object's if it has one."""
        vertices = self.body.solid().vertices
        return self.hand.digest + ("" if vertices is None else digest(vertices.tobytes()))

    def run_table(self) -> dict[str, Any]:
        """How it is tried, as a table."""
        table = self.run.as_table()
        del table["start_spread"]
        return table


def _changed(study: SpatialStudy, name: str, value: float) -> SpatialStudy:
    hand, parts = study.hand, study.components
    sort, _, part = name.partition(".")
    if part and sort == "posture":
        each = {joint: hand.from_file(joint, value) for joint in several(part, hand.source.joints)}
        return replace(study, hand=hand.having(posture=each))
    if part and sort == "scale":
        each = dict.fromkeys(several(part, hand.source.bodies), value)
        return replace(study, hand=hand.having(scales=each))
    known = names(parts)
    if name not in known:
        joints = [f"posture.{joint}" for joint in hand.source.joints]
        choices = [*known, *joints]
        raise ValueError(
            f"there is no {name} to be swept: {did_you_mean(name, choices)}there are "
            f"{', '.join([*known, *joints[:6]])}{', ...' if len(joints) > 6 else ''}; scale.BODY: "
            "how many times as large a body of the hand is"
        )
    table, what = known[name]
    changed: Any = parts[table].having(**{what.name: what.from_file(value)})
    if table in ("start", "escape"):
        return replace(study, hand=hand.having(**{table: changed}))
    if table == "run":
        return replace(study, run=replace(study.run, engine=changed))
    return replace(study, **{{"contact": "law"}.get(table, table): changed})


class SpatialReader(Reader):
    """Reads the tables of a study of a hand in three dimensions.

    Arguments:
        data: the tables, as TOML gives them.
        folder: where relative paths begin.
    """

    TABLES = (
        "units", "hand", "start", "escape", "body", "drive", "contact", "run", "objective", "sweep",
    )  # fmt: skip
    usual_units = "m"

    def __init__(self, data: Mapping[str, Any], folder: Path):
        super().__init__(data)
        self.folder = folder

    def parts(self) -> Study:
        """The study, without what it sweeps."""
        hand = self.spatial_hand()
        body = self.component("body", SPATIAL_BODIES, "kind", self.kind("body"), {})
        drive = self.component(
            "drive",
            SPATIAL_DRIVES,
            "kind",
            self.word("drive", "kind", SPATIAL_DRIVES.kinds(), "tilt"),
            {},
        )
        self.table("contact", _OF_CONTACT)
        run = self.run()
        if "start_spread" in self.table("run"):
            raise ValueError("[run] start_spread is for hands in the plane: see [start] spread")
        return SpatialStudy(hand, body, drive, self.law(), run, units=self.units)

    def kind(self, where: str) -> str:
        """Which object it is."""
        kind = self.word(where, "kind", SPATIAL_BODIES.kinds(), None)
        if kind is None:
            raise ValueError(
                f"[{where}] kind is missing: there are {', '.join(SPATIAL_BODIES.kinds())}"
            )
        return kind

    def path(self, name: str) -> str:
        """A path, seen from the study's folder."""
        return str((self.folder / name).resolve())

    def value(self, where: str, key: str, what: Any) -> Any:
        """A parameter as Python has it; files are seen from the study's folder."""
        found = super().value(where, key, what)
        return self.path(found) if what.kind is str else found

    def spatial_hand(self) -> SpatialHand:
        """The hand."""
        keys = ("file", "preset", "root", "exclude", "fingertips", "posture", "scale")
        table = self.table("hand", keys)
        if ("file" in table) == ("preset" in table):
            raise ValueError("[hand] needs either a file or a preset")
        preset = self.word("hand", "preset", tuple(PRESETS), None)
        file = PRESETS[preset] if preset else self.path(self.text("hand", "file"))
        where = self.named("start", StartBox)
        start = self.sound("start", lambda: StartBox(**where))
        kind = self.word("escape", "kind", ESCAPES.kinds(), "hull")
        escape: Escape = self.component("escape", ESCAPES, "kind", kind, {})
        chosen: dict[str, Any] = {
            name: self.texts("hand", name) for name in ("exclude", "fingertips") if name in table
        }
        if "root" in table:
            chosen["root"] = self.text("hand", "root")
        bare = self.sound("hand", lambda: SpatialHand(file, start, escape=escape, **chosen))
        posture = {
            joint: bare.from_file(joint, value)
            for joint, value in self.numbers_of("hand", "posture").items()
        }
        scales = self.numbers_of("hand", "scale")
        return self.sound("hand", lambda: bare.having(posture=posture, scales=scales))

    def named(self, where: str, component: type[Component]) -> dict[str, Any]:
        """The values of a component of which there is one kind."""
        known = {what.file_key: what for what in quantities(component).values() if what.key}
        words = tuple(what.key for what in known.values() if what.word)
        self.table(where, (*known, *words))
        return self.given(where, known, {})

    def texts(self, where: str, key: str) -> tuple[str, ...]:
        """A list of texts."""
        value = self.table(where)[key]
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be a list of names")
        return tuple(value)

    def numbers_of(self, where: str, key: str) -> dict[str, float]:
        """A table of numbers by name."""
        value = self.table(where).get(key, {})
        if not isinstance(value, dict):
            raise ValueError(f"[{where}] {key} has to be a table, [{where}.{key}]")
        for name, number in value.items():
            if isinstance(number, bool) or not isinstance(number, (int, float)):
                raise ValueError(f"[{where}] {key}: {name} is {number!r}: it has to be a number")
        return {name: float(number) for name, number in value.items()}


def is_spatial(data: Mapping[str, Any]) -> bool:
    """Whether a study's tables are of a hand in three dimensions."""
    hand = data.get("hand")
    return isinstance(hand, dict) and ("file" in hand or hand.get("preset") in PRESETS)
