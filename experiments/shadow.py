"""A Shadow hand in four postures with three objects: indices 1 and 2 on the same draws.

The hand is `reach.xml` of gymnasium-robotics, whose files are read without importing it: `pip
install --no-deps gymnasium-robotics` is enough. Its palm is up at rest, and tilts by up to 60 deg.
Keeps `results/shadow.csv`, row by row, and draws `results/shadow.png`; goes on where it was
interrupted.

    python -m experiments.shadow            # 11 minutes of a core
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import math
import time
from itertools import product
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

import pcjax
from pcjax import spatial
from pcjax.model.contact import ContactLaw

OUT = Path(__file__).parent / "results" / "shadow.csv"

EXCLUDE = ("robot0:V_thbase", "robot0:V_thhub")
"""Cubes of 2 mm in the middle of the thumb, which the file lets collide. Nothing reaches them, but
they would make the step eight times as short."""

FINGERS, THUMB, LITTLE = (2, 1, 0), (4, 3, 2, 1, 0), (4, 3)
"""Numbers of joints: knuckle to tip; base to tip; the palm's arch and the spread."""

POSTURES = {
    "open": ((15, 15, 10), (20, 20, 0, 0, -10), (0, 0)),
    "cupped": ((30, 30, 20), (20, 30, 0, 0, -20), (0, 0)),
    "half closed": ((45, 45, 30), (40, 40, 0, 0, -30), (0, 0)),
    "half closed, palm arched": ((45, 45, 30), (40, 40, 0, 0, -30), (30, -19)),
}
"""Angles of `FINGERS` (of each but the thumb), `THUMB` and `LITTLE`, degrees."""

OBJECTS: dict[str, Any] = {
    "sphere": spatial.Sphere(0.022),
    "box": spatial.Box(0.03, 0.03, 0.04),
    "capsule": spatial.Capsule(0.015, 0.03),
}

FRICTIONS = (0.0, 0.5)

TILT = spatial.Tilt(math.radians(60), rest=(0.0, 1.0, 0.0))


def hand_file() -> Path | None:
    """Where the hand's file is; None where its package is not installed."""
    found = importlib.util.find_spec("gymnasium_robotics")
    if found is None or not found.submodule_search_locations:
        return None
    path = Path(found.submodule_search_locations[0], "envs", "assets", "hand", "reach.xml")
    return path if path.is_file() else None


def angles_of(posture: str) -> dict[str, float]:
    """Its joints by name, radians."""
    fingers, thumb, little = POSTURES[posture]
    degrees = {
        f"robot0:{finger}J{joint}": angle
        for finger in ("FF", "MF", "RF", "LF")
        for joint, angle in zip(FINGERS, fingers, strict=True)
    }
    degrees |= {f"robot0:THJ{j}": angle for j, angle in zip(THUMB, thumb, strict=True)}
    degrees |= {f"robot0:LFJ{j}": angle for j, angle in zip(LITTLE, little, strict=True)}
    return {joint: math.radians(angle) for joint, angle in degrees.items()}


def shadow_hand(posture: str) -> spatial.Hand:
    """The hand in a posture.

    Raises:
        SystemExit: its package is not installed.
    """
    path = hand_file()
    if path is None:
        raise SystemExit("the hand is not here: pip install --no-deps gymnasium-robotics")
    start = spatial.StartBox((0.005, -0.042, 0.06), (0.003, 0.001, 0.003))
    return spatial.Hand(
        path, start, root="robot0:palm", posture=angles_of(posture), exclude=EXCLUDE
    )


def row(posture: str, body: str, friction: float, trials: int, seconds: float) -> dict[str, Any]:
    """What a condition gives; times in s."""
    study = spatial.Study(
        shadow_hand(posture),
        OBJECTS[body],
        TILT,
        ContactLaw(friction=friction or None),
        pcjax.Run(trials=trials, max_steps=round(1000 * seconds)),
    )
    wall, cpu = time.perf_counter(), time.process_time()
    result = pcjax.evaluate_study(study)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    found, attrs = result.indices("does"), result.attrs
    one, two = found["index1"], found["index2"]
    return {
        "posture": posture,
        "object": body,
        "friction": friction,
        "trials": trials,
        "limit": seconds,
        "index1": round(one.value / 1000, 3),
        "index1_low": round(one.low / 1000, 3),
        "index1_high": round(one.high / 1000, 3),
        "index2": two.value,
        "index2_low": round(two.low, 4),
        "index2_high": round(two.high, 4),
        "invalid": result.status("does")["invalid"],
        "half_step_later": round(attrs["does_half_step_later"] / 1000, 5),
        "half_step_se": round(attrs["does_half_step_se"] / 1000, 5),
        "half_step_trials": attrs["does_half_step_trials"],
        "wall_s": round(wall, 1),
        "cpu_s": round(cpu, 1),
    }


def kept(path: Path) -> list[dict[str, str]]:
    """The rows of the table so far."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def append(path: Path, new: dict[str, Any]) -> None:
    """Adds a row to the table."""
    fresh = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, list(new))
        if fresh:
            writer.writeheader()
        writer.writerow(new)


def draw(rows: list[dict[str, str]], path: Path) -> None:
    """Index 1 by posture and object, with 95 % intervals."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes: Axes = figure.subplots()
    for k, (body, friction) in enumerate(product(OBJECTS, FRICTIONS)):
        chosen = (
            row for row in rows if row["object"] == body and float(row["friction"]) == friction
        )
        mine = {row["posture"]: row for row in chosen}
        places = [p for p, name in enumerate(POSTURES) if name in mine]
        values, low, high = (
            [float(mine[name][key]) for name in POSTURES if name in mine]
            for key in ("index1", "index1_low", "index1_high")
        )
        axes.errorbar(
            [place + 0.07 * (k - 2.5) for place in places],
            values,
            [
                [v - x for v, x in zip(values, low, strict=True)],
                [x - v for v, x in zip(values, high, strict=True)],
            ],
            fmt="os^"[k // 2],
            color=f"C{k // 2}",
            markerfacecolor="white" if friction == 0 else None,
            capsize=2,
            label=f"{body}, $\\mu$ = {friction:g}",
        )
    axes.set_xticks(range(len(POSTURES)), [name.replace(", ", ",\n") for name in POSTURES])
    axes.set_ylim(bottom=0)
    axes.set_ylabel("index 1 [s]")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Runs what is not there yet, and draws."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    done = {(r["posture"], r["object"], float(r["friction"])) for r in kept(options.out)}
    for one in product(POSTURES, OBJECTS, FRICTIONS):
        if one not in done:
            append(options.out, row(*one, options.trials, options.limit))
            print(kept(options.out)[-1], flush=True)
    draw(kept(options.out), options.out.with_suffix(".png"))


if __name__ == "__main__":
    main()
