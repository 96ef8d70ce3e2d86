"""Convex bodies by leaps against an independent simulator, and whether they gain energy.

The reference (`tests/reference/polygon.py`) takes small steps in float64 on the same draws, so that
biases are paired; some conditions are repeated with another step. The engine runs more trials
than are compared, to count those that go wrong. Keeps `results/convex.csv` and draws
`results/convex.png`; goes on where it was interrupted.

With `--limits`: one body or law on its way to another one, on the same trials, in
`results/convex_limits.csv`.

With `--energy`: flights from random states, with random contacts, under a pull that stays. The
largest growth of energy in a leap is kept in `results/convex_energy.csv`, as a share of the largest
energy of the flight.

Run as `python -m experiments.convex`.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.geometry import Vec
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.convex import Capsule, Polygon, Rectangle, RegularPolygon, Square
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does
from pcjax.physics.state import INVALID, RUNNING
from pcjax.physics.tumbling.flight import Tumble
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.convex import ConvexLeaps
from tests.flights import STEADY, leap, pulled, released
from tests.reference.trials import escape_times

RESULTS = Path(__file__).parent / "results"

BODIES: dict[str, Body] = {
    "circle": Circle(35.0),
    "stick": Stick(35.0),
    "capsule": Capsule(100.0, 10.0),
    "triangle": Polygon(((0.0, 0.0), (80.0, 0.0), (0.0, 60.0)), 1.0, orientation=0.3),
    "square": Square(70.0, 0.5),
    "sharp square": Square(70.0),
    "hexagon": RegularPolygon(6, 40.0, 2.0),
}
FRICTIONS = (0.0, 0.1, 0.35, 0.5)
OPEN = box_hand(math.radians(-20), gap_width=400.0)
"""A hand that many bodies leave soon."""

ARM_HAND = two_joint_hand(math.radians(55), math.radians(90))

DRIVES: dict[str, Any] = {
    "wrist": (OPEN, WristTilt()),
    "wrist, g = 98": (OPEN, WristTilt(gravity=98.0)),
    "arm": (ARM_HAND, PlanarArm()),
}
STEPS = {"wrist": 0.001, "wrist, g = 98": 0.0005, "arm": 0.001}
"""The reference's steps, s."""

AGAIN = (
    ("wrist", "square", 0.35, 0.0005),
    ("wrist", "capsule", 0.0, 0.0005),
    ("arm", "square", 0.35, 0.0005),
    ("wrist, g = 98", "stick", 0.1, 0.00025),
    ("wrist, g = 98", "stick", 0.1, 0.001),
    ("wrist, g = 98", "stick", 0.0, 0.00025),
)
"""What is repeated with another step."""


def scenario_of(drive: str, body: str, friction: float) -> Scenario:
    hand, how = DRIVES[drive]
    law = ContactLaw(friction=friction if friction > 0 else None)
    return does(hand, BODIES[body], how, law)


def compared(
    drive: str, body: str, friction: float, step: float, args: argparse.Namespace
) -> dict[str, Any]:
    """A row of the table."""
    scenario = scenario_of(drive, body, friction)
    settings: dict[str, Any] = {"engine": ConvexLeaps(), "max_steps": args.max_steps}
    out = run([scenario], trials=args.trials, **settings)
    mine = out.steps[0].astype(float)
    invalid = out.status[0] == INVALID
    theirs = escape_times(scenario, args.compared, args.max_steps * 0.001, step) / 0.001
    sound = ~invalid[: args.compared] & np.isfinite(theirs)
    difference = (mine[: args.compared] - theirs)[sound]
    share = 100 / float(np.mean(theirs[sound]))
    return {
        "drive": drive,
        "body": body,
        "friction": friction,
        "reference_step": step,
        "compared": args.compared,
        "trials": args.trials,
        "limit": args.max_steps,
        "index1": round(float(np.mean(mine))),
        "bias_percent": f"{share * np.mean(difference):.3f}",
        "bias_95": f"{1.96 * share * np.std(difference) / math.sqrt(len(difference)):.3f}",
        "within_20_steps": f"{np.mean(np.abs(difference) <= 20):.3f}",
        "held": f"{np.mean(mine >= args.max_steps):.3f}",
        "invalid": int(np.sum(invalid)),
    }


def conditions() -> Iterator[tuple[str, str, float, float]]:
    for drive in DRIVES:
        for body in BODIES:
            for friction in FRICTIONS:
                yield drive, body, friction, STEPS[drive]
    yield from AGAIN


def draw(rows: list[dict[str, str]], path: Path) -> None:
    """Biases with their 95 % intervals, a panel for each drive."""
    figure = Figure((11, 4), layout="constrained")
    axes: list[Axes] = list(figure.subplots(1, len(DRIVES), sharey=True))
    for axis, drive in zip(axes, DRIVES, strict=True):
        for k, friction in enumerate(FRICTIONS):
            of = [
                row
                for row in rows
                if row["drive"] == drive
                and float(row["friction"]) == friction
                and float(row["reference_step"]) == STEPS[drive]
            ]
            names = list(BODIES)
            axis.errorbar(
                [names.index(row["body"]) + 0.16 * (k - 1.5) for row in of],
                [float(row["bias_percent"]) for row in of],
                [float(row["bias_95"]) for row in of],
                fmt="o",
                markersize=4,
                capsize=2,
                label=f"$\\mu$ = {friction:g}",
            )
        axis.axhspan(-0.5, 0.5, color="0.9", zorder=0)
        axis.set_xticks(range(len(BODIES)), list(BODIES), rotation=40, ha="right")
        axis.set_title(drive)
    axes[0].set_ylabel("bias of index 1 [%]")
    axes[0].legend(fontsize="small")
    figure.savefig(path, dpi=120)


def kept(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def append(path: Path, row: dict[str, Any]) -> None:
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, list(row), lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)
    print(*row.values(), sep=", ", flush=True)


# --------------------------------------------------------------------------------------- limits


VERTEX = "one vertex to circle"


def limits() -> Iterator[tuple[str, float, Scenario, Scenario]]:
    """What goes where, how far it is from there, and both conditions; `OPEN` is the hand. One
    vertex differs from the circle's own engine by what gravity is taken for: how far off, in radii,
    is `ConvexLeaps.drift`."""

    def of(body: Body, thickness: float = 0.0, **law: Any) -> Scenario:
        return does(replace(OPEN, thickness=thickness), body, law=ContactLaw(**law))

    circle, square, stick = Circle(35.0), Square(70.0, 0.5), Stick(35.0)
    for drift in (ConvexLeaps().drift, 1e-7):
        yield VERTEX, drift, of(Polygon(((0.0, 0.0),), 35.0)), of(circle)
    for number in (4, 8, 16):
        # As large as the circle in area.
        size = 35.0 * math.sqrt(2 * math.pi / (number * math.sin(2 * math.pi / number)))
        yield "regular polygon to circle", number, of(RegularPolygon(number, size)), of(circle)
    for wide in (8.0, 2.0, 0.5, 0.1):
        yield "rectangle to stick", wide, of(Rectangle((70.0, wide))), of(stick)
    for friction in (0.1, 0.01, 1e-3, 1e-5):
        yield "friction to none", friction, of(square, friction=friction), of(square)
    for thick in (5.0, 0.5, 0.05):
        yield "thickness to none", thick, of(square, thick), of(square)


def keep_limits(args: argparse.Namespace) -> None:
    path = RESULTS / "convex_limits.csv"
    path.unlink(missing_ok=True)
    for name, rest, near, end in limits():
        settings: dict[str, Any] = {"trials": args.trials, "max_steps": args.max_steps}
        engines = [choose_engine("auto", None, one) for one in (near, end)]
        if name == VERTEX:
            engines[0] = ConvexLeaps(drift=rest)
        ends = [
            run([one], engine=engine, **settings)
            for one, engine in zip((near, end), engines, strict=True)
        ]
        mine, theirs = (out.steps[0].astype(float) for out in ends)
        difference, share = mine - theirs, 100 / float(theirs.mean())
        row = {
            "limit": name,
            "at": f"{rest:g}",
            "trials": args.trials,
            "index1": round(float(theirs.mean())),
            "difference_percent": f"{share * difference.mean():.3f}",
            "difference_95": f"{1.96 * share * difference.std() / math.sqrt(args.trials):.3f}",
            "within_2_steps": f"{np.mean(np.abs(difference) <= 2):.3f}",
            "invalid": sum(int(np.sum(out.status == INVALID)) for out in ends),
        }
        append(path, row)


# --------------------------------------------------------------------------------------- energy


def energy_growth(scenario: Scenario, lanes: int, leaps: int, seed: int = 0) -> dict[str, Any]:
    """The largest growth of energy in a leap, as a share of the flight's largest so far; how many
    leaps began at an impact or with a contact; how many flights went wrong.

    Flights start on random ways through the hand's middle, under pulls that stay, each its own.
    """
    world, body = scenario.world(), scenario.body
    shape = world.shape
    assert shape is not None
    turns = float(shape.per_gyration) > 0
    gyration = 1 / float(shape.per_gyration) if turns else 0.0

    def energy(flight: Tumble, pull: Vec) -> jax.Array:
        turning = flight.spin * gyration
        speed = flight.velocity.dot(flight.velocity) + turning * turning
        return jnp.asarray(0.5 * speed - pull.dot(flight.position))

    def flight_of(key: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        a = jax.random.uniform(key, (8,))
        zero = 0.0 * a[0]
        count = jnp.zeros((), jnp.int32)
        radius = jnp.asarray(body.radius)
        goal = world.goal
        # In the middle of the hand and below its fingertips, where nothing touches it yet.
        high = radius + a[0] * (0.6 * goal.a.y - radius)
        place = Vec((2 * a[1] - 1) * 0.2 * scenario.hand.palm_length, high)
        speed, way = 200.0 * a[2], 2 * math.pi * a[3]
        velocity = Vec(speed * jnp.cos(way), speed * jnp.sin(way))
        # Downwards, within 30 degrees, so that most stay.
        lean = (2 * a[4] - 1) * math.pi / 6
        pull = Vec(9.8 * jnp.sin(lean), -9.8 * jnp.cos(lean))
        spin = (2 * a[6] - 1) * 200.0 / radius
        first = released((place.x, place.y), (velocity.x, velocity.y), 2 * math.pi * a[5], spin)
        profile = pulled(pull.x, pull.y)

        def one(_: Any, carried: Any) -> Any:
            flight, most, growth, changes = carried
            before = energy(flight, pull)
            new = leap(world, profile, flight, jnp.inf)
            after = energy(new, pull)
            # From the lowest that the pull lets it get: the palm, all but.
            lowest = -pull.dot(Vec(jnp.sign(pull.x) * 0.5 * scenario.hand.palm_length, zero))
            most = jnp.maximum(most, before - lowest)
            going = flight.status == RUNNING
            growth = jnp.maximum(growth, jnp.where(going, (after - before) / most, 0.0))
            free = flight.velocity + pull * (new.time - flight.time)
            pushed = jnp.abs(new.velocity.x - free.x) + jnp.abs(new.velocity.y - free.y)
            return new, most, growth, changes + (going & (pushed > 1e-3 * (1 + speed)))

        start = (first, zero + 1e-6, zero, count)
        flight, _, growth, changes = jax.lax.fori_loop(0, leaps, one, start)
        return growth, changes, flight.status == INVALID

    keys = jax.random.split(jax.random.key(seed), lanes)
    growth, changes, invalid = jax.jit(jax.vmap(flight_of))(keys)
    return {
        "contacts": int(changes.sum()),
        "largest_growth": f"{float(growth.max()):.1e}",
        "invalid": int(invalid.sum()),
    }


def energies(args: argparse.Namespace) -> None:
    path = RESULTS / "convex_energy.csv"
    path.unlink(missing_ok=True)
    for name in ("circle", "stick", "square", "triangle"):
        for bits in (64, 32):
            for friction in (None, 0.3, 1.5):
                for restitution in (0.0, 0.5, 1.0):
                    law = ContactLaw(restitution=restitution, friction=friction)
                    with jax.enable_x64(bits == 64):
                        scenario = does(box_hand(), BODIES[name], STEADY, law)
                        row = energy_growth(scenario, args.lanes, args.leaps)
                    first = {"body": name, "bits": bits, "friction": friction or 0.0}
                    append(path, {**first, "restitution": restitution, **row})


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--trials", type=int, default=20_000, help="of each condition")
    add("--compared", type=int, default=2_000, help="of these, with the reference")
    add("--max-steps", type=int, default=50_000, help="limit")
    add("--drive", choices=DRIVES, help="only this one")
    add("--limits", action="store_true", help="limits instead")
    add("--energy", action="store_true", help="energy instead")
    add("--lanes", type=int, default=256, help="flights for the energy")
    add("--leaps", type=int, default=400, help="of each flight")
    args = parser.parse_args()
    if args.limits:
        keep_limits(args)
        return
    if args.energy:
        energies(args)
        return
    path = RESULTS / "convex.csv"
    names = ("drive", "body", "friction", "reference_step")
    done = {tuple(row[name] for name in names) for row in kept(path)}
    for one in conditions():
        wanted = args.drive in (None, one[0])
        if wanted and tuple(str(part) for part in one) not in done:
            append(path, compared(*one, args))
    draw(kept(path), RESULTS / "convex.png")


if __name__ == "__main__":
    main()
