"""How high an object has to climb to get out of a hand: escape energy, without simulation."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pcjax.checks import check_count
from pcjax.geometry import Scalar
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.outline import SKIN
from pcjax.model.checking import check_geometry
from pcjax.model.drives.base import Drive
from pcjax.model.hand import HandDesign, full_cage
from pcjax.model.scenario import DIRECTIONS, Scenario
from pcjax.quality.landscape import Climb, Landscape, Points
from pcjax.quality.slices import POINT, Shape, landscape_of, slices_of
from pcjax.showing import Shown

TILTS = 360
"""Directions of gravity unless a number is given: one a degree."""

ORIENTATIONS = 72
"""At how many angles a body that turns is looked at unless a number is given: every 5 degrees."""

_FLAT = 1e-6
"""Shares of gravity in the plane that are rounding."""

_DRAWS = 4096
"""How many of a drive's targets stand for all."""


@dataclass(frozen=True, repr=False)
class EscapeEnergy(Shown):
    """How high an object has to climb to get out of a hand, for each direction of gravity; made by
    `energy`; prints as a table.

    A climb is an energy over the object's weight, a length in the hand's unit, where all of gravity
    lies in the hand's plane. A wrist has only a part of it there, and the energy is that part of
    it.

    Of a circle, and of what does not turn, climbs are exact. Of another body there are two: along
    ways that it surely can take, at most (`from_rest` and all else here), and those of the circle
    inside it, at least (the same of `at_least`).

    A tilt is the angle of gravity in the hand frame from the way to the palm, -y, positive towards
    finger 2: upright the hand's is 0.

    Attributes:
        scenario: the condition.
        bound: "exact" where climbs are the object's own, to the landscape's tolerance; else "at
            most" or "at least".
        tilts: from above -pi up to pi, radians.
        from_rest: the climb from the place of which it is most, a length: what the object needs
            from wherever it lies. Infinite in a full cage, and as an upper bound where no way out
            was found.
        from_start: the climb from the middle of a start, the lesser of both: what it needs at
            least.
        opens: the smallest tilts, radians, towards finger 1 (negative) and finger 2, at which it
            need not climb from a start; NaN where there is none.
        lets_go: the same from wherever it lies.
        begins: gravity over g in the hand frame as a trial begins.
        held: the same at the ends of periods, for many draws of the drive.
        landscape: the triangulated free space.
        at_least: the lower bounds where climbs are upper bounds; None elsewhere.
    """

    drawn_by = "view.energy.plot_energy"

    scenario: Scenario
    bound: str
    tilts: Float[np.ndarray, " tilts"]
    from_rest: Float[np.ndarray, " tilts"]
    from_start: Float[np.ndarray, " tilts"]
    opens: tuple[float, float]
    lets_go: tuple[float, float]
    begins: Float[np.ndarray, "2"]
    held: Float[np.ndarray, "draws 2"]
    landscape: Landscape
    at_least: EscapeEnergy | None = None

    @property
    def exact(self) -> bool:
        """Whether climbs are the object's own, to the landscape's tolerance."""
        return self.bound == "exact"

    @property
    def full_cage(self) -> bool:
        """Whether nothing gets out, for sure: not only that no way was found."""
        return bool(np.isinf((self.at_least or self).from_rest).all())

    def at(self, tilt: float) -> Climb:
        """The way out at a tilt, radians."""
        return self.landscape.climb(_direction(tilt))

    @property
    def begins_at(self) -> float:
        """The tilt as a trial begins, radians; 0 where gravity is then square to the plane."""
        x, y = self.begins.tolist()
        return math.atan2(x, -y) if math.hypot(x, y) > _FLAT else 0.0

    @property
    def held_tilts(self) -> Float[np.ndarray, " draws"]:
        """The tilts at the ends of periods, radians."""
        return np.arctan2(self.held[:, 0], -self.held[:, 1])

    @property
    def mean(self) -> float:
        """The energy over the weight, a length, from rest, as a mean over the drive's targets."""
        return self._over_held(self.from_rest)

    @property
    def mean_from_start(self) -> float:
        """The same from a start."""
        return self._over_held(self.from_start)

    def lines(self, name: str = "") -> list[str]:
        """A table, line by line, with a name in its corner: one of each bound, unless both are the
        same to their last digit."""
        tables = {"" if self.exact else self.bound: self._rows()}
        if self.at_least:
            least = self.at_least._rows()
            same = least == tables[self.bound]
            tables = {"at least and at most": least} if same else tables | {"at least": least}
        return [
            f"{label:30}{rest:>22}{start:>22}"
            for bound, rows in tables.items()
            for label, rest, start in (
                (", ".join(filter(None, (name, bound))), "from rest", "from a start"),
                *rows,
            )
        ]

    def _rows(self) -> list[tuple[str, str, str]]:
        """The table's cells."""
        told = self.as_json()
        kinds = told["from_rest"], told["from_start"]
        rows = [
            ("upright, 0 deg", *(_length(kind["upright"]) for kind in kinds)),
            ("least of all tilts", *(_at(kind["least"]) for kind in kinds)),
            ("most of all tilts", *(_at(kind["most"]) for kind in kinds)),
            ("no climb from a tilt of", _tilts(told["lets_go_deg"]), _tilts(told["opens_deg"])),
            ("mean over the drive's tilts", *(_length(kind["mean"]) for kind in kinds)),
        ]
        if np.hypot(*self.begins) > _FLAT:
            begins = f"as a trial begins, {told['begins_tilt_deg']:.4g} deg"
            rows.insert(1, (begins, *(_length(kind["begins"]) for kind in kinds)))
        return rows

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def as_json(self) -> dict[str, Any]:
        """Plain numbers for `--json`: angles in degrees, None for what is infinite or not there."""
        tilts = np.degrees(self.tilts)

        def found(climbs: Float[np.ndarray, " tilts"], at: float, begins: float) -> dict[str, Any]:
            least, most = int(np.argmin(climbs)), int(np.argmax(climbs))
            return {
                "upright": _plain(at),
                "begins": _plain(begins),
                "least": {"climb": _plain(climbs[least]), "tilt_deg": _plain(tilts[least])},
                "most": {"climb": _plain(climbs[most]), "tilt_deg": _plain(tilts[most])},
                "mean": _plain(self._over_held(climbs)),
                "climbs": [_plain(climb) for climb in climbs],
            }

        upright, begins = self.at(0.0), self.at(self.begins_at)
        told = {
            "exact": self.exact,
            "bound": self.bound,
            "full_cage": self.full_cage,
            "tilts_deg": [_plain(tilt) for tilt in tilts],
            "begins": [_plain(part) for part in self.begins],
            "begins_tilt_deg": _plain(math.degrees(self.begins_at)),
            "opens_deg": [_plain(math.degrees(tilt)) for tilt in self.opens],
            "lets_go_deg": [_plain(math.degrees(tilt)) for tilt in self.lets_go],
            "from_rest": found(self.from_rest, upright.from_rest, begins.from_rest),
            "from_start": found(self.from_start, upright.from_start, begins.from_start),
            "saddle_upright": [_plain(part) for part in upright.saddle],
        }
        return told | ({"at_least": self.at_least.as_json()} if self.at_least else {})

    def _over_held(self, climbs: Float[np.ndarray, " tilts"]) -> float:
        if not np.isfinite(climbs).all():
            return math.inf
        found = np.interp(self.held_tilts, self.tilts, climbs, period=2 * math.pi)
        return float(np.mean(found * np.hypot(*self.held.T)))


def energy(
    hand: HandDesign,
    body: Body,
    *,
    direction: str = "does",
    drive: Drive | None = None,
    start_spread: float = 0.1,
    tilts: int = TILTS,
    orientations: int = ORIENTATIONS,
) -> EscapeEnergy:
    """How high an object has to climb to get out of a hand, for each direction of gravity, without
    a trial.

    It is out where a trial ends: where its centre crosses the goal line. Places that it cannot
    reach from its starts do not count. For a circle climbs are exact, and for what does not turn.
    For another body there are two bounds. Upper ones are along ways found through many
    orientations: it surely can take each, and with more of them they come down to its own. Lower
    ones, `at_least`, are along the ways of the circle about its centre that is within it. It is
    looked at where it lies in these orientations.

    Energies know nothing of speed, friction or how a hand moves, nor of chance.

    Arguments:
        hand, body, drive, start_spread: as for `pcjax.evaluate`.
        direction: "does" or "eoen".
        tilts: of how many directions of gravity, evenly spread. Between these the mean is taken to
            be linear, and a tilt that opens the hand is looked for between those that do and not.
        orientations: at how many angles a body that turns is looked at, evenly spread, beside those
            at which a side of it lies flat on a limb.

    Raises:
        ValueError: what `pcjax.evaluate` refuses of a hand, a number of tilts or orientations out
            of range, what does not turn at an orientation that is drawn for each trial, a drive
            without gravity, or no shapely (`pip install 'pcjax[energy]'`).

    Examples:
        Upright the centre climbs from the palm to the line between the tips' joints; upside down
        from a lid to below a tip, where tips of 100 point straight at the palm:

        >>> import math, pcjax
        >>> found = pcjax.energy(pcjax.box_hand(0.0), pcjax.Circle(25.0))
        >>> print(f"{found.at(0.0).from_rest:.2f} {found.at(math.pi).from_rest:.2f}")
        475.00 100.00

        A stick of 180 gets out endwise through a gap of 60. Upside down it has to turn between lids
        and tips first, and the circle inside it, a point, does not:

        >>> found = pcjax.energy(pcjax.box_hand(0.0, gap_width=60.0), pcjax.Stick(90.0), tilts=4)
        >>> least, most = found.at_least.at(math.pi), found.at(math.pi)
        >>> print(f"{least.from_rest:.0f} to {most.from_rest:.0f}")
        100 to 113
    """
    if direction not in DIRECTIONS:
        raise ValueError(f"direction is {direction!r}: it has to be one of {', '.join(DIRECTIONS)}")
    scenario = DIRECTIONS[direction](hand, body, drive, None, start_spread)
    return energy_of(scenario, tilts, orientations)


def energy_of(
    scenario: Scenario, tilts: int = TILTS, orientations: int = ORIENTATIONS
) -> EscapeEnergy:
    """`pcjax.energy` of a condition, from `pcjax.does` or `pcjax.eoen`.

    Raises:
        ValueError: see `pcjax.energy`.
    """
    check_count("tilts", tilts, 4, 36_000)
    check_count("orientations", orientations, 8, 720)
    gap = check_geometry(scenario)
    begins, held = _gravities(scenario.drive)
    caged = full_cage(gap, scenario.body.least_passage())

    def found(bound: str, landscape: Landscape, less: EscapeEnergy | None = None) -> EscapeEnergy:
        if caged:
            landscape = replace(landscape, exits=landscape.exits[:0])
        each, climbs, (opens, lets_go) = _at_tilts(landscape, tilts)
        return EscapeEnergy(
            scenario,
            bound,
            each,
            np.array([climb.from_rest for climb in climbs]),
            np.array([climb.from_start for climb in climbs]),
            opens,
            lets_go,
            begins,
            held,
            landscape,
            less,
        )

    landscape = landscape_for(scenario, orientations)
    if not _turns(scenario.body):
        return found("exact", landscape)
    return found("at most", landscape, found("at least", landscape_inside(scenario, landscape)))


def _at_tilts(
    landscape: Landscape, tilts: int
) -> tuple[Float[np.ndarray, " tilts"], list[Climb], list[tuple[float, float]]]:
    """So many tilts, the climb at each, and those at which none is left from a start and from
    rest."""

    @functools.cache
    def climb(tilt: float) -> Climb:
        return landscape.climb(_direction(tilt))

    def from_start_is_open(tilt: float) -> bool:
        return climb(tilt).from_start <= 0

    def from_rest_is_open(tilt: float) -> bool:
        return climb(tilt).from_rest <= 0

    count = math.ceil(tilts / 2)  # so that the last one is upside down
    step = math.pi / count
    openings = [
        (_first(is_open, -step, count), _first(is_open, step, count))
        for is_open in (from_start_is_open, from_rest_is_open)
    ]
    each = 2 * math.pi / tilts * (np.arange(tilts) + 1 - tilts / 2)
    return each, [climb(tilt) for tilt in each.tolist()], openings


def landscape_for(scenario: Scenario, orientations: int = ORIENTATIONS) -> Landscape:
    """The free space of a condition's object, for plain numbers that `pcjax.evaluate` takes.

    Raises:
        ValueError: what does not turn at an orientation that is drawn for each trial, or no
            shapely.
    """
    body, half, starts = scenario.body, 0.5 * float(scenario.hand.thickness), _starts(scenario)
    with jax.enable_x64(True):
        exact = jax.tree.map(float, body)
        shape = exact.shape()
        corners, rounding = exact.outline() if shape is None else (shape.vertices, shape.skin)
        core = np.array([[float(corner.x), float(corner.y)] for corner in corners])
        limits = Shape(core, float(rounding) + half)
    if _turns(body):
        return slices_of(scenario.hand, limits, starts, orientations)
    orientation = body.orientation if body.oriented else 0.0
    if orientation is None and len(core) > 1:
        raise ValueError(
            "the object does not turn and its orientation is drawn for each trial: each has an "
            "energy of its own, so give it one"
        )
    return landscape_of(scenario.hand, limits, starts, float(orientation or 0.0))


def _turns(body: Body) -> bool:
    """Whether it matters at which angle it is, and that changes."""
    return body.turns and len(body.outline()[0]) > 1


def landscape_inside(scenario: Scenario, around: Landscape) -> Landscape:
    """That of the circle inside the object, whose ways out are no higher than the object's own; it
    lies where the object can."""
    # What has no thickness is held off limbs all the same.
    inner = max(scenario.body.inner_radius(), SKIN * float(scenario.body.radius))
    shape = Shape(POINT, inner + 0.5 * float(scenario.hand.thickness))
    return landscape_of(scenario.hand, shape, _starts(scenario), around=around)


def _starts(scenario: Scenario) -> Points:
    """The middles of its starts."""
    exact = jax.tree.map(float, scenario)
    middles = [exact.start([end, 0.5, 0.5]) for end in (0.25, 0.75)]
    return np.array([[float(middle.x), float(middle.y)] for middle in middles])


def _length(value: float | None) -> str:
    return "infinite" if value is None else f"{value:,.4g}"


def _at(what: dict[str, Any]) -> str:
    if what["climb"] is None:
        return "infinite"
    return f"{_length(what['climb'])} at {what['tilt_deg']:.4g} deg"


def _tilts(degrees: list[float | None]) -> str:
    there = [f"{tilt:+.1f}" for tilt in degrees if tilt is not None]
    return f"{' and '.join(there)} deg" if there else "none"


def _plain(value: float) -> float | None:
    """The number without the digits that rounding makes; None where it is not finite."""
    return float(f"{value:.10g}") if math.isfinite(value) else None


def _direction(tilt: float) -> Float[np.ndarray, "2"]:
    return np.array([math.sin(tilt), -math.cos(tilt)])


def _first(is_open: Callable[[float], bool], step: float, count: int) -> float:
    """The first tilt, radians, that is open, of so many steps from 0 on; NaN if none is."""
    found = next((k for k in range(count + 1) if is_open(k * step)), None)
    if found is None:
        return math.nan
    if found == 0:
        return 0.0
    shut, opened = (found - 1) * step, found * step
    while abs(opened - shut) > 1e-6:
        middle = 0.5 * (shut + opened)
        shut, opened = (shut, middle) if is_open(middle) else (middle, opened)
    return opened


def _gravities(drive: Drive) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "draws 2"]]:
    """Gravity over g in the hand frame as a trial begins and at the ends of periods."""
    full = getattr(drive, "gravity", None)
    if full is None:
        raise ValueError(
            f"{type(drive).__name__} has no gravity: energies are heights against it, and what "
            "else pulls at the object is left to trials"
        )
    if float(full) <= 0:
        raise ValueError("gravity is 0: there is no height to climb against it")
    with jax.enable_x64(True):
        draws = jnp.asarray(_spread(int(drive.targets_per_period)))
        begins, held = jax.device_get(_seen(jax.tree.map(float, drive), draws))
    return np.stack(begins) / float(full), np.stack(held, axis=-1) / float(full)


@jax.jit
def _seen(drive: Drive, draws: Float[Array, "draws targets"]) -> tuple[Any, Any]:
    """Gravity as a trial begins, and at the end of a period with each of some draws."""

    def held(draw: Float[Array, " targets"]) -> tuple[Scalar, Scalar]:
        profile = drive.profile(draw, draw, jnp.asarray(False))
        pull = drive.gravity_seen(profile, jnp.asarray(drive.period, float))
        return pull.x, pull.y

    first = drive.profile(draws[0], draws[0], jnp.asarray(True))
    begins = drive.gravity_seen(first, jnp.zeros(()))
    return (begins.x, begins.y), jax.vmap(held)(draws)


@functools.cache
def _spread(count: int) -> Float[np.ndarray, "draws targets"]:
    """Draws of a drive's targets, spread evenly (Sobol)."""
    from scipy.stats import qmc  # takes more than a second to import

    return qmc.Sobol(count, rng=0).random(_DRAWS)
