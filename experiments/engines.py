"""Bias of index 1 over cost per trial for the engines, their steps and precisions.

The reference is stepping at dt = 0.001 s in float64 on the same draws, so biases are paired. Cost
is the time of one core, which other work on the machine changes little.
Keeps `results/engines.csv` and draws `results/engines.png`.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from pcjax.engines.ensemble import run
from pcjax.engines.event import EventDriven
from pcjax.engines.lanes import Engine
from pcjax.engines.stepping import Stepping
from pcjax.model.body import Circle
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import box_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.step import INVALID

RESULTS = Path(__file__).parent / "results"
ENGINES = {f"dt = {dt:g}": Stepping(dt) for dt in (0.001, 0.005, 0.01, 0.02, 0.05)} | {
    "event": EventDriven()
}


def conditions() -> dict[str, Scenario]:
    """Small and large objects, tapered and flared tips, a tight gap, bouncy and heavy."""

    def make(angle: float, radius: float, *, gap: float = 200.0, e: float = 0.1, g: float = 9.8):
        hand = box_hand(math.radians(angle), gap_width=gap)
        return hand, Circle(radius), WristTilt(gravity=g), ContactLaw(restitution=e)

    return {
        "10 deg, r = 25": does(*make(10, 25)),
        "10 deg, r = 5": does(*make(10, 5)),
        "40 deg, r = 5": does(*make(40, 5)),
        "20 deg, r = 50": does(*make(20, 50)),
        "-20 deg, r = 25, EoEn": eoen(*make(-20, 25)),
        "30 deg, r = 5, EoEn": eoen(*make(30, 5)),
        "gap 5 wider than r = 25": does(*make(0, 25, gap=55)),
        "10 deg, r = 25, e = 0": does(*make(10, 25, e=0.0)),
        "10 deg, r = 25, e = 0.6": does(*make(10, 25, e=0.6)),
        "10 deg, r = 25, e = 1": does(*make(10, 25, e=1.0)),
        "10 deg, r = 5, g = 98": does(*make(10, 5, g=98.0)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1500)
    parser.add_argument("--max-steps", type=int, default=200_000)
    arguments = parser.parse_args()
    settings = {"trials": arguments.trials, "max_steps": arguments.max_steps}
    named = conditions()
    scenarios = list(named.values())

    def timed(engine: Engine, precision: int) -> tuple[np.ndarray, np.ndarray, float]:
        run(scenarios, trials=1, max_steps=1, engine=engine, precision=precision, block=1024)
        began = time.process_time()
        out = run(scenarios, engine=engine, precision=precision, block=1024, **settings)
        cost = (time.process_time() - began) / out.steps.size
        return out.steps.astype(float), out.status == INVALID, cost

    reference, _, _ = timed(Stepping(0.001), 64)
    rows = []
    for precision in (64, 32):
        for name, engine in ENGINES.items():
            steps, invalid, cost = timed(engine, precision)
            for k, condition in enumerate(named):
                valid = ~invalid[k]
                difference = (steps[k] - reference[k])[valid] / reference[k].mean()
                bias, se = math.nan, math.nan
                if valid.sum() > 1:
                    bias = difference.mean()
                    se = difference.std(ddof=1) / math.sqrt(valid.sum())
                rows.append(
                    {
                        "condition": condition,
                        "engine": name,
                        "bits": precision,
                        "bias_percent": round(100 * bias, 4),
                        "se_percent": round(100 * se, 4),
                        "invalid": int(invalid[k].sum()),
                        "cost_us_per_trial": round(1e6 * cost, 1),
                        **settings,
                    }
                )
            print(f"{name}, float{precision}: {1e6 * cost:.0f} us a trial", flush=True)
    with (RESULTS / "engines.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draw(rows).savefig(RESULTS / "engines.png", dpi=110)


def draw(rows: list[dict]) -> Figure:
    """Bias with 95 % intervals over cost, a panel for each precision, a line for each condition."""
    figure = Figure(figsize=(12, 5.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    names = list(dict.fromkeys(row["condition"] for row in rows))
    for axis, bits in zip(axes, (64, 32), strict=True):
        for k, name in enumerate(names):
            mine = [row for row in rows if row["condition"] == name and row["bits"] == bits]
            good = [row for row in mine if row["invalid"] == 0]
            x = [row["cost_us_per_trial"] * (1 + 0.02 * (k - len(names) / 2)) for row in good]
            axis.errorbar(
                x,
                [row["bias_percent"] for row in good],
                [1.96 * row["se_percent"] for row in good],
                fmt="o",
                ms=4,
                lw=1,
                color=f"C{k % 10}",
                mfc="white" if k >= 10 else f"C{k % 10}",
                label=name,
            )
        for k, row in enumerate({r["engine"]: r for r in rows if r["bits"] == bits}.values()):
            x, y = row["cost_us_per_trial"], 0.94 - 0.07 * (k % 2)
            axis.text(x, y, row["engine"], ha="center", fontsize=9, backgroundcolor="white")
        axis.axhspan(-0.3, 0.3, color="0.92", zorder=0)
        axis.set(
            xscale="log",
            xlabel="cost per trial [us of one core]",
            title=f"float{bits}; where trials went invalid: left out",
            ylim=(-1, 1),
        )
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("bias of index 1 against dt = 0.001, float64 [%]")
    axes[1].legend(fontsize=8, loc="lower left", ncols=2)
    return figure


if __name__ == "__main__":
    main()
