"""`python -m benchmarks.growth`: how time and memory grow with trials, conditions, limbs and the
step limit.

Each point is measured in a fresh process (its peak memory is its own): a first call that compiles
and runs one period of the drive, then timed runs. Draws docs/growth.png and prints a table.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

PICTURE = Path(__file__).parent.parent / "docs" / "growth.png"
PERIOD = 10_000
"""Steps between new targets of the wrist."""
BUDGET = 5.0
"""Seconds after which a timed run is not repeated."""

Point = dict[str, Any]


def sweeps(quick: bool) -> dict[str, list[Point]]:
    """What is measured: the points of each curve.

    From a full cage nobody escapes, so that hands of different limbs simulate equally many steps.
    """
    box = {"limbs": 3, "gap_width": 200.0}
    cage = {"limbs": 3, "gap_width": 40.0}
    trials = [10**n for n in range(2, 4 if quick else 8)]
    conditions = [10**n for n in range(2 if quick else 5)]
    limits = [10**n for n in range(3, 6 if quick else 8)]
    limbs = (1, 3, 8) if quick else range(1, 9)
    some = 100 if quick else 1000
    return {
        "trials": [box | {"trials": n, "max_steps": 2 * PERIOD} for n in trials],
        "conditions": [
            box | {"trials": some, "max_steps": 2 * PERIOD, "conditions": n} for n in conditions
        ],
        "limbs, full cage": [
            cage | {"limbs": n, "trials": some, "max_steps": 10 * PERIOD} for n in limbs
        ],
        "limit": [box | {"trials": some, "max_steps": n} for n in limits],
        "limit, full cage": [cage | {"trials": some, "max_steps": n} for n in limits],
    }


def chain_hand(limbs: int, gap_width: float) -> Any:
    """A hand of so many limbs per finger around one gap.

    From 3 limbs on it is the box hand, its sides in pieces; 2 leave out the fingertip, 1 is a side
    that leans inwards.
    """
    from pcjax.model.hand import HandDesign

    palm = side = 500.0
    lid, right = (palm - gap_width) / 2, math.pi / 2
    if limbs == 1:
        lengths, angles = [math.hypot(side, lid)], [right + math.atan2(lid, side)]
    elif limbs == 2:
        lengths, angles = [side, lid], [right, right]
    else:
        pieces = limbs - 2
        lengths = [side / pieces] * pieces + [lid, 100.0]
        angles = [right] + [0.0] * (pieces - 1) + [right, right - math.radians(10)]
    finger, joints = tuple(lengths), tuple(angles)
    return HandDesign(palm, (finger, finger), (joints, joints))


def measure(point: Point) -> Point:
    """Runs one point in this process: seconds, simulated steps and peak memory."""
    from pcjax.model.bodies.circle import Circle
    from pcjax.study.evaluate import evaluate_study
    from pcjax.study.spec import Run, Study, Sweep
    from pcjax.sweep.run import run_sweep

    hand = chain_hand(point["limbs"], point["gap_width"])

    def timed(max_steps: int) -> tuple[float, float]:
        # All starts in the corner: a side that leans leaves no more room.
        how = Run("does", trials=point["trials"], max_steps=max_steps, start_spread=0.0)
        study = Study(hand, Circle(25.0), run=how)
        began = time.perf_counter()
        if "conditions" not in point:
            index1 = evaluate_study(study).indices("does")["index1"].value
            return time.perf_counter() - began, index1 * point["trials"]
        with tempfile.TemporaryDirectory() as folder:
            radii = tuple(np.linspace(24.0, 26.0, point["conditions"]).tolist())
            swept = replace(study, sweep=Sweep({"radius": radii}))
            found = run_sweep(swept, Path(folder) / "sweep.nc")
            seconds = time.perf_counter() - began
            return seconds, float(found.index1[..., 0].sum()) * point["trials"]

    imported = _peak_mib()
    first, _ = timed(min(PERIOD, point["max_steps"]))
    seconds, steps = [], 0.0
    while not seconds or (len(seconds) < 3 and sum(seconds) < BUDGET):
        run, steps = timed(point["max_steps"])
        seconds.append(run)
    return point | {
        "first_call": first,
        "seconds": seconds,
        "steps": steps,
        "imported_mib": imported,
        "peak_mib": _peak_mib(),
    }


def _peak_mib() -> float:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def measure_apart(point: Point) -> Point:
    """`measure` in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.growth", "--point", json.dumps(point)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


def draw(found: dict[str, list[Point]]) -> Figure:
    """Time above, memory below, against each of the four."""
    figure = Figure(figsize=(15, 6.4), layout="constrained")
    axes = figure.subplots(2, 4, sharex="col", sharey="row")
    columns = (
        ("trials", "trials", {"trials": "box hand"}),
        ("conditions", "conditions of a sweep", {"conditions": "box hand"}),
        ("limbs", "limbs per finger", {"limbs, full cage": "full cage"}),
        ("max_steps", "step limit", {"limit": "box hand", "limit, full cage": "full cage"}),
    )
    for (times, memory), (key, label, curves) in zip(axes.T, columns, strict=True):
        points = []
        for name, text in curves.items():
            points = found[name]
            style = {"color": "C1" if "cage" in text else "C0"}
            x = [point[key] for point in points]
            first = [point["first_call"] for point in points]
            times.plot(x, first, "s:", alpha=0.5, label=f"{text}, first call", **style)
            middle = [statistics.median(point["seconds"]) for point in points]
            below = [m - min(p["seconds"]) for m, p in zip(middle, points, strict=True)]
            above = [max(p["seconds"]) - m for m, p in zip(middle, points, strict=True)]
            times.errorbar(x, middle, [below, above], fmt="o-", capsize=3, label=text, **style)
            memory.plot(x, [point["peak_mib"] for point in points], "o-", label=text, **style)
        memory.axhline(points[0]["imported_mib"], color="0.5", ls="--", label="imports alone")
        times.set_title(_fixed(points[0], key), fontsize=10)
        memory.set_xlabel(label)
        for axis in (times, memory):
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.grid(alpha=0.3)
            axis.legend(fontsize=8)
        if key == "limbs":
            numbers = [point["limbs"] for point in points]
            memory.set_xticks(numbers, [str(n) for n in numbers])
            memory.xaxis.set_minor_formatter(NullFormatter())
    axes[0, 0].set_ylabel("wall time [s]")
    axes[1, 0].set_ylabel("peak memory [MiB]")
    axes[1, 0].set_ylim(100, 2000)
    axes[1, 0].set_yticks([100, 200, 500, 1000, 2000], ["100", "200", "500", "1,000", "2,000"])
    axes[1, 0].yaxis.set_minor_formatter(NullFormatter())
    return figure


def _fixed(point: Point, varies: str) -> str:
    """What a column keeps the same."""
    texts = {
        "limbs": f"{point['limbs']} limbs per finger",
        "trials": f"{point['trials']:,} trials" + (" each" if "conditions" in point else ""),
        "max_steps": f"limit {point['max_steps']:,} steps",
    }
    return ",\n".join(text for key, text in texts.items() if key != varies)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.growth", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few small points, to try it")
    parser.add_argument("--plot", type=Path, default=PICTURE, metavar="FILE")
    parser.add_argument("--point", type=json.loads, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.point:
        print(json.dumps(measure(arguments.point)))
        return
    print(
        f"{'':18}{'limbs':>6}{'conditions':>11}{'trials':>11}{'limit':>12}"
        f"{'first call [s]':>16}{'run [s]':>24}"
        f"{'ns / step':>11}{'peak [MiB]':>12}   ({os.cpu_count()} cores)"
    )
    found: dict[str, list[Point]] = {}
    for name, points in sweeps(arguments.quick).items():
        found[name] = []
        for point in points:
            got = measure_apart(point)
            found[name].append(got)
            low, high = min(got["seconds"]), max(got["seconds"])
            middle = statistics.median(got["seconds"])
            print(
                f"{name:18}{got['limbs']:>6}{got.get('conditions', 1):>11,}{got['trials']:>11,}"
                f"{got['max_steps']:>12,}"
                f"{got['first_call']:>16.1f}{f'{middle:.3g} [{low:.3g}, {high:.3g}]':>24}"
                f"{1e9 * middle / got['steps']:>11.3g}{got['peak_mib']:>12,.0f}",
                flush=True,
            )
    draw(found).savefig(arguments.plot, dpi=130)


if __name__ == "__main__":
    main()
