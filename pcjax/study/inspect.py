"""What a study is like before a trial is spent on it: gap, scale, and what would be refused."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import jax
import numpy as np

from pcjax.importing import named
from pcjax.model.bodies.base import Body
from pcjax.model.checking import geometry_of
from pcjax.model.hand import full_cage, points_of
from pcjax.model.scenario import DIRECTIONS, Scenario, why_no_eoen
from pcjax.results.schema import NAMES
from pcjax.results.tables import engines_text, wrapped
from pcjax.showing import Shown
from pcjax.simulate.choose import choose_engine
from pcjax.study.spec import Study
from pcjax.units import PER_METRE

Point = tuple[float, float]

Box = tuple[Point, Point]

_SLOW_FALL, _FAST_FALL = 30.0, 0.02
"""Seconds of a fall through the hand beyond which lengths and gravity hardly go together."""

_TINY = 1e-4
"""Radius over the hand's reach below which trials go wrong at 32 bits: one in a hundred here."""


@dataclass(frozen=True)
class View:
    """A hand in one direction.

    Attributes:
        gap: the narrowest passage between the fingers, a length.
        passage: its ends.
        starts: lower left and upper right corners of the boxes that the object's centre starts in,
            one at each end of the palm.
        problem: why it cannot be run, "" if it can; then the rest is not given.
        engine: how it would be run.
    """

    problem: str = ""
    gap: float | None = None
    starts: tuple[Box, Box] | None = None
    engine: str | None = None
    passage: tuple[Point, Point] | None = None


@dataclass(frozen=True)
class Inspection(Shown):
    """A study before it is evaluated; prints as a list.

    Attributes:
        study: what was looked at.
        views: the hand in each direction.
        size: width and height of the hand, lengths; of one in three dimensions along x, y and z.
        width: the narrowest gap that the object fits through, a length.
        fall: about how long the object takes through the whole hand where it is pulled most, s.
        doubts: what is probably not meant.
    """

    drawn_by = "view.designs.plot_inspection"

    study: Study
    views: dict[str, View]
    size: tuple[float, ...]
    width: float
    fall: float
    doubts: tuple[str, ...]

    def __repr__(self) -> str:
        study = self.study
        limbs = " and ".join(str(len(lengths)) for lengths in study.hand.lengths)
        body = study.body
        pull = getattr(study.drive, "gravity", None)
        gravity = "" if pull is None else f", gravity {float(pull):g} of them / s^2"
        thickness = float(study.hand.thickness)
        thick = f"{thickness:.4g} thick, " if thickness else ""
        lines = [
            f"units    {study.units if study.units in PER_METRE else 'model units'}{gravity}",
            f"hand     {limbs} limbs a finger, palm {float(study.hand.palm_length):.4g}, "
            f"{thick}{self.size[0]:.4g} wide and {self.size[1]:.4g} high",
            f"object   {body.noun} {body.size_in_words()}{_attitude(body)}; a gap of "
            f"{self.width:.4g} lets it through{_if_it_lies_well(body)}",
        ]
        for direction, view in self.views.items():
            name = f"{NAMES[direction]:8}"
            if view.problem:
                lines.append(f"{name} cannot be run: {view.problem}")
                continue
            assert view.gap is not None
            assert view.starts is not None
            fate = "nothing" if full_cage(view.gap, body.least_passage()) else "at most its centre"
            caged = f" (a full cage: {fate} passes)" if full_cage(view.gap, self.width) else ""
            lines.append(
                f"{name} gap {view.gap:.4g}, {view.gap - self.width:+.4g} to the object{caged}; "
                f"{view.engine}"
            )
            where = [
                f"x {x0:.4g} to {x1:.4g}, y {y0:.4g} to {y1:.4g}"
                for (x0, y0), (x1, y1) in view.starts
            ]
            lines.append(f"         starts at {' or '.join(where)}")
        lines += [
            f"drive    {type(study.drive).__name__}, period {study.drive.period:g} s; a fall "
            f"through the hand takes about {self.fall:.2g} s",
            *self.ending(),
        ]
        return "\n".join(wrapped(line, indent=9) for line in lines)

    def ending(self) -> list[str]:
        """The list's last lines: how it is tried, and doubts."""
        study = self.study
        trials = f"{study.trials:,}"
        if study.run.precision_target is not None:
            trials = f"at most {trials}"
        return [
            f"run      {' and '.join(NAMES[d] for d in study.directions)}, {trials} trials each, "
            f"limit {study.max_steps:,} steps ({study.max_steps / 1000:g} s), seed "
            f"{study.run.seed}",
            *(f"doubt: {doubt}" for doubt in self.doubts),
        ]

    def as_json(self) -> dict[str, Any]:
        """Plain numbers for `--json`."""
        return {
            "units": self.study.units,
            "gap": {d: view.gap for d, view in self.views.items()},
            "object_width": self.width,
            "thickness": float(self.study.hand.thickness),
            "size": list(self.size),
            "fall_seconds": self.fall,
            "views": {d: asdict(view) for d, view in self.views.items()},
            "directions": list(self.study.directions),
            "max_steps": self.study.max_steps,
            "doubts": list(self.doubts),
        }


def _attitude(body: Body) -> str:
    """How a body lies at its start, and whether that changes."""
    words = ""
    if body.oriented:
        angle = body.orientation
        known = "any angle" if angle is None else f"{math.degrees(float(angle)):.4g} deg"
        words = f", at {known} to the palm"
    return words if body.turns else f"{words}, never turned"


def _if_it_lies_well(body: Body) -> str:
    return "" if body.turns or not body.oriented else " if it lies well"


def inspect(study: Study) -> Inspection:
    """Looks at a study without running a trial; of a hand in three dimensions it returns a
    `SpatialInspection`.

    Examples:
        >>> import pcjax
        >>> found = pcjax.inspect(pcjax.Study(pcjax.box_hand(0.0), pcjax.Circle(25.0)))
        >>> print(f"{found.views['does'].gap:.4f}")
        200.0000
        >>> found.views["does"].starts[0]
        ((-225.0, 25.0), (-175.0, 75.0))
    """
    return named(study.inspected_by)(study)


def inspect_plane(study: Study) -> Inspection:
    """`inspect`, of a hand in the plane."""
    views = {direction: _view(study, direction) for direction in DIRECTIONS}
    points = points_of(study.hand)
    across, up = np.ptp(points, axis=0) + float(study.hand.thickness)
    reach = float(study.hand.palm_length) + max(float(sum(ls)) for ls in study.hand.lengths)
    speed = study.drive.top_speed(reach)
    fall = 2 * reach / speed if speed > 0 else float("inf")
    doubts = []
    if not _FAST_FALL < fall < _SLOW_FALL:
        doubts.append(
            f"a fall through the hand takes {fall:.2g} s: do lengths and gravity have the same "
            "unit (9.8 m/s^2 is 9,800 mm/s^2)? [units] length says which"
        )
    if study.run.precision == 32 and float(study.body.radius) < _TINY * reach:
        doubts.append(
            f"an object of {float(study.body.radius):.2g} is tiny beside a hand of {reach:.4g}: at "
            "32 bits many a trial will go wrong, so use precision 64"
        )
    return Inspection(
        study, views, (float(across), float(up)), float(study.body.width), fall, tuple(doubts)
    )


def _view(study: Study, direction: str) -> View:
    if direction == "eoen" and (problem := why_no_eoen(study.hand)):
        return View(f"EoEn is not defined for this hand: {problem}")
    make, run = DIRECTIONS[direction], study.run
    scenario = make(study.hand, study.body, study.drive, study.law, run.start_spread)
    try:
        gap = scenario.check()
        engine = choose_engine(run.engine, run.dt, scenario)
    except ValueError as error:
        return View(str(error))
    engine_text = engines_text(engine.provenance, engine.step_taken(study.drive.period))
    first, second = geometry_of(scenario).passage
    passage = (float(first.x), float(first.y)), (float(second.x), float(second.y))
    return View("", gap, (_starts(scenario, 0.0), _starts(scenario, 0.9)), engine_text, passage)


def _starts(scenario: Scenario, end: float) -> Box:
    """The box of starts at the palm's left end (a draw below a half) or its right one."""
    exact = jax.tree.map(float, scenario)
    corners = [exact.start([end, along, up]) for along in (0.0, 1.0) for up in (0.0, 1.0)]
    points = np.array([[corner.x, corner.y] for corner in corners], float)
    (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return (x0, y0), (x1, y1)
