"""What a study of a hand in three dimensions is like before a trial is spent on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcjax.model.scenario import DIRECTIONS
from pcjax.model.spatial.frozen import frozen
from pcjax.model.spatial.regions import ESCAPES
from pcjax.model.spatial.scenario import SpatialScenario, why_no_spatial_eoen
from pcjax.model.spatial.scene import clearances
from pcjax.results.schema import NAMES
from pcjax.results.tables import engines_text, wrapped
from pcjax.simulate.choose import choose_engine
from pcjax.study.inspect import Inspection, View
from pcjax.study.spatial import SpatialStudy


@dataclass(frozen=True)
class SpatialInspection(Inspection):
    """A study of a hand in three dimensions before it is evaluated; prints as a list.

    Attributes:
        geoms: how many of the hand's geoms collide.
        thinnest: the name of the thinnest of them, and its thickness, m.
        room: how far the object is from the hand at the middle and the corners of its starts, the
            least of them, m; None if that is not known.
    """

    drawn_by = "view.spatial.plot_inspection"

    study: SpatialStudy
    geoms: int
    thinnest: tuple[str, float]
    room: float | None

    def __repr__(self) -> str:
        study, hand = self.study, self.study.hand
        body, drive, start = study.body, study.drive, self.study.hand.start
        name, thickness = self.thinnest
        of = f", {hand.root} and what it carries" if hand.root else ""
        lines = [f"hand     {Path(hand.file).name}{of}"]
        if self.geoms:
            lines.append(
                f"         {self.geoms} geoms collide, in a box of "
                f"{' x '.join(f'{1000 * side:.4g}' for side in self.size)} mm; the thinnest is "
                f"{name}, {1000 * thickness:.3g} mm"
            )
        room = "" if self.room is None else f"; {1000 * self.room:.3g} mm from the hand there"
        lines += [
            f"object   {body.noun} {body.size_in_words()}: a gap of {1000 * self.width:.4g} mm may "
            "let it through",
            f"start    centre {_listed(start.centre)} m, give or take {_listed(start.spread)} m, "
            f"{_attitude(start.orientation)}{room}",
            f"escape   by {ESCAPES.kind_of(hand.escape)}: {_numbers(hand.escape.as_table())}",
        ]
        for direction, view in self.views.items():
            lines.append(
                f"{NAMES[direction]:8} "
                + (f"cannot be run: {view.problem}" if view.problem else str(view.engine))
            )
        lines += [
            f"drive    up to {math.degrees(float(drive.amplitude)):.4g} deg from where gravity "
            f"points along {_listed(drive.rest)}, period {drive.period:g} s; a fall through the "
            f"hand takes about {self.fall:.2g} s",
            *self.ending(),
        ]
        return "\n".join(wrapped(line, indent=9) for line in lines)

    def as_json(self) -> dict[str, Any]:
        """Plain numbers for `--json`."""
        study, hand = self.study, self.study.hand
        name, thickness = self.thinnest
        return {
            "units": study.units,
            "hand": {"file": hand.file, "root": hand.root, "geoms": self.geoms},
            "thinnest": {"name": name, "thickness": thickness},
            "object_width": self.width,
            "object_radius": study.body.radius,
            "size": list(self.size),
            "room": self.room,
            "fall_seconds": self.fall,
            "views": {
                d: {"problem": view.problem, "engine": view.engine}
                for d, view in self.views.items()
            },
            "directions": list(study.directions),
            "trials": study.trials,
            "max_steps": study.max_steps,
            "doubts": list(self.doubts),
        }


def _listed(numbers: Any) -> str:
    return f"({', '.join(f'{float(x):.4g}' for x in numbers)})"


def _attitude(angles: Any) -> str:
    if angles is None:
        return "at any angle"
    if not any(float(angle) for angle in angles):
        return "not turned"
    return f"turned by {_listed(math.degrees(float(angle)) for angle in angles)} deg"


def _numbers(table: dict[str, Any]) -> str:
    """A component's numbers by their names."""
    return ", ".join(
        f"{key} {_listed(value) if isinstance(value, (list, tuple)) else f'{value:g}'}"
        for key, value in table.items()
    )


def inspect_spatial(study: SpatialStudy) -> SpatialInspection:
    """`pcjax.inspect`, of a hand in three dimensions."""
    hand, body, drive = study.hand, study.body, study.drive
    views = {direction: _view(study, direction) for direction in DIRECTIONS}
    size, geoms, thinnest, room = (0.0, 0.0, 0.0), 0, ("", 0.0), None
    doubts: list[str] = []
    fall = math.inf
    try:
        seen = frozen(hand)
    except ValueError:
        pass  # the views say so
    else:
        points = np.concatenate([geom.points() for geom in seen.geoms])
        size = tuple(np.ptp(points, axis=0).tolist())
        geoms = len(seen.geoms)
        thinnest = seen.thinnest.name, 2 * seen.thinnest.solid.half_thickness
        room = float(clearances(seen, body.solid(), hand.start).min())
        speed = drive.top_speed(seen.size)
        fall = 2 * seen.size / speed if speed > 0 else math.inf
        step = study.run.dt
        what, half = SpatialScenario(hand, body, drive, study.law).thinnest()
        if step is not None and speed * step > half:
            doubts.append(
                f"in a step of {step:g} s what falls moves up to {1000 * speed * step:.3g} mm, "
                f"more than half the {2000 * half:.3g} mm of {what}: leave dt out, and it is chosen"
            )
    return SpatialInspection(
        study, views, size, body.width, fall, tuple(doubts), geoms, thinnest, room
    )


def _view(study: SpatialStudy, direction: str) -> View:
    if direction == "eoen" and (problem := why_no_spatial_eoen(study.hand)):
        return View(f"EoEn is not defined for this hand: {problem}")
    scenario = SpatialScenario(
        study.hand,
        study.body,
        study.drive,
        study.law,
        direction == "eoen",  # pyright: ignore
    )
    try:
        scenario.check()
        engine = choose_engine(study.run.engine, study.run.dt, scenario)
    except ValueError as error:
        return View(str(error))
    return View("", engine=engines_text(engine.provenance, engine.step_taken(study.drive.period)))
