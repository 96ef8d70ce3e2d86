"""Bias of index 1 over cost per trial for the engines, their steps and precisions.

The reference is stepping at dt = 0.001 s in float64 on the same draws, so biases are paired. Cost
is the time of one core, which other work on the machine changes little.
Keeps `results/engines.csv` and draws `results/engines.png` for the group "wrist" (circles), and
`results/engines_arm.csv` and `.png` for the group "arm" (circles on the arm, and sticks), and
`results/engines_odd.csv` and `.png` for the group "odd" (acute corners, lopsided hands).
"""

from __future__ import annotations

import argparse
import csv
import functools
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import INVALID
from pcjax.simulate.batch import run
from pcjax.simulate.engine import Engine
from pcjax.simulate.event import EventDriven
from pcjax.simulate.stepping import Stepping

RESULTS = Path(__file__).parent / "results"
STILL_GOOD = 1e-3
"""The share of trials that may go invalid before a point is left out of the picture."""


@dataclass(frozen=True)
class Part:
    """Conditions of equal structure, which run in one batch.

    Attributes:
        conditions: makes the named conditions.
        trials, max_steps: of each.
        event: whether the event-driven engine applies.
    """

    conditions: Callable[[], dict[str, Scenario]]
    trials: int
    max_steps: int
    event: bool = False


@dataclass(frozen=True)
class Group:
    """What one table and one picture show.

    Attributes:
        parts: by name; a row of the picture for each.
        steps: the steps of the stepping engine, s; the reference's own comes first.
        reach: of the picture's axis of biases, percent.
        stem: of the names of the files.
    """

    parts: Mapping[str, Part]
    steps: tuple[float, ...]
    reach: float
    stem: str

    def engines(self, part: Part) -> dict[str, Engine]:
        """The engines by name, the reference first."""
        stepping = {f"dt = {dt:g}": Stepping(dt) for dt in self.steps}
        return {**stepping, "event": EventDriven()} if part.event else dict(stepping)


def wrist_circles() -> dict[str, Scenario]:
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


def arm_circles() -> dict[str, Scenario]:
    """A wide, a narrow and an inward-pointing gate."""
    return {
        f"{first}, {second} deg": does(
            two_joint_hand(math.radians(first), math.radians(second)), Circle(50.0), PlanarArm()
        )
        for first, second in ((55, 90), (75, 90), (65, 120))
    }


def arm_sticks() -> dict[str, Scenario]:
    """Two orientations at the start, and a hand that holds it for longer."""
    return {
        f"{first}, {second} deg, stick at {orientation} deg": does(
            two_joint_hand(math.radians(first), math.radians(second)),
            Stick(50.0, math.radians(orientation)),
            PlanarArm(),
        )
        for first, second, orientation in ((65, 90, 0), (65, 90, 45), (65, 120, 90))
    }


def wrist_sticks() -> dict[str, Scenario]:
    """A stick half as long as the opening between the fingertips' joints is wide."""
    return {"10 deg, stick of half length 25": does(box_hand(math.radians(10)), Stick(25.0))}


def leaning_limbs() -> dict[str, Scenario]:
    """One limb a finger, leaning inwards: two acute corners at the palm."""

    def make(one: float, two: float, radius: float, e: float, g: float = 9.8) -> Scenario:
        angles = ((math.radians(one),), (math.radians(two),))
        hand = HandDesign(500.0, ((450.0,), (450.0,)), angles)
        return does(hand, Circle(radius), WristTilt(gravity=g), ContactLaw(restitution=e))

    return {
        "103 and 108 deg, r = 60, e = 0.64": make(103, 108, 60, 0.64),
        "103 and 108 deg, r = 60, e = 1, g = 98": make(103, 108, 60, 1.0, 98),
        "100 and 100 deg, r = 90, e = 0.9": make(100, 100, 90, 0.9),
        "112 and 95 deg, r = 40, e = 0.3": make(112, 95, 40, 0.3),
        "95 and 110 deg, r = 60, e = 0.5, g = 98": make(95, 110, 60, 0.5, 98),
        "110 and 80 deg, r = 30, e = 1": make(110, 80, 30, 1.0),
    }


def acute_tips() -> dict[str, Scenario]:
    """Fingertips folded back over their limbs, and one beside an inward-leaning limb."""

    def make(
        limb: float, tip: float, radius: float, e: float, g: float = 9.8, length: float = 130.0
    ) -> Scenario:
        angles = (math.radians(limb), math.radians(tip))
        hand = HandDesign(500.0, ((350.0, length), (350.0, length)), (angles, angles))
        return does(hand, Circle(radius), WristTilt(gravity=g), ContactLaw(restitution=e))

    return {
        "tips at 130 deg, r = 20, e = 0.64": make(90, 130, 20, 0.64),
        "tips at 150 deg, r = 12, e = 1": make(90, 150, 12, 1.0),
        "tips at 110 deg on limbs at 100, r = 50, e = 0.8": make(100, 110, 50, 0.8, length=90),
        "tips at 120 deg, r = 30, e = 0.9, g = 98": make(90, 120, 30, 0.9, 98),
    }


def lopsided_arms() -> dict[str, Scenario]:
    """First joints that differ, on the arm."""

    def make(one: float, two: float, tips: float) -> Scenario:
        angles = tuple((math.radians(first), math.radians(tips)) for first in (one, two))
        hand = HandDesign(200.0, ((200.0, 100.0), (200.0, 100.0)), (angles[0], angles[1]))
        return does(hand, Circle(50.0), PlanarArm())

    return {
        f"first joints {one} and {two} deg, second {tips}": make(one, two, tips)
        for one, two, tips in ((70, 60, 90), (60, 70, 90), (70, 60, 110))
    }


GROUPS = {
    "wrist": Group(
        {"circle on the wrist": Part(wrist_circles, 1500, 200_000, event=True)},
        (0.001, 0.005, 0.01, 0.02, 0.05),
        reach=1.0,
        stem="engines",
    ),
    "arm": Group(
        {
            "circle on the arm": Part(arm_circles, 1000, 300_000),
            "stick on the arm": Part(arm_sticks, 340, 180_000),
            "stick on the wrist": Part(wrist_sticks, 64, 60_000),
        },
        (0.001, 0.005, 0.01, 0.02, 0.04),
        reach=3.0,
        stem="engines_arm",
    ),
    "odd": Group(
        {
            "leaning limbs": Part(leaning_limbs, 3000, 60_000, event=True),
            "acute tips": Part(acute_tips, 3000, 60_000, event=True),
            "lopsided hands on the arm": Part(lopsided_arms, 3000, 300_000),
        },
        (0.001, 0.005, 0.01, 0.02),
        reach=1.5,
        stem="engines_odd",
    ),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--group", choices=list(GROUPS), default="wrist")
    parser.add_argument("--trials", type=int, help="each part's own number unless given")
    parser.add_argument("--max-steps", type=int, help="each part's own limit unless given")
    arguments = parser.parse_args()
    group = GROUPS[arguments.group]
    measured = {}
    for name, part in group.parts.items():
        trials = arguments.trials or part.trials
        max_steps = arguments.max_steps or part.max_steps
        print(f"{name}: {trials:,} trials to {max_steps:,} steps", flush=True)
        measured[name] = measure(part.conditions(), group.engines(part), trials, max_steps)
        keep(measured, group)  # also of a run that is cut short


def keep(measured: Mapping[str, list[dict]], group: Group) -> None:
    """Writes table and picture of the parts measured so far."""
    rows = [row for part in measured.values() for row in part]
    with (RESULTS / f"{group.stem}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draw(measured, group.reach).savefig(RESULTS / f"{group.stem}.png", dpi=110)


def measure(
    named: Mapping[str, Scenario], engines: Mapping[str, Engine], trials: int, max_steps: int
) -> list[dict]:
    """A row for each precision, engine and condition, against the first engine in float64."""
    scenarios = list(named.values())
    # No larger than the batch, or empty lanes would count as cost.
    block = min(1024, 1 << (trials * len(scenarios) - 1).bit_length())

    def timed(engine: Engine, precision: int) -> tuple[np.ndarray, np.ndarray, float]:
        go = functools.partial(run, scenarios, engine=engine, precision=precision, block=block)
        go(trials=1, max_steps=1)  # compiles
        began = time.process_time()
        out = go(trials=trials, max_steps=max_steps)
        cost = (time.process_time() - began) / out.steps.size
        return out.steps.astype(float), out.status == INVALID, cost

    reference, rows = None, []
    for precision in (64, 32):
        for name, engine in engines.items():
            steps, invalid, cost = timed(engine, precision)
            if reference is None:
                reference = steps
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
                        "trials": trials,
                        "max_steps": max_steps,
                    }
                )
            print(f"{name}, float{precision}: {1e6 * cost:.0f} us a trial", flush=True)
    return rows


def draw(measured: Mapping[str, list[dict]], reach: float) -> Figure:
    """Bias with 95 % intervals over cost: a row for each part, a panel for each precision, a colour
    for each condition."""
    figure = Figure(figsize=(12, 1.0 + 4.8 * len(measured)), layout="constrained")
    figure.suptitle("left out: where more than 0.1 % of the trials were invalid", fontsize=10)
    grid = figure.subplots(len(measured), 2, sharey=True, squeeze=False)
    for axes, (part, rows) in zip(grid, measured.items(), strict=True):
        names = list(dict.fromkeys(row["condition"] for row in rows))
        for axis, bits in zip(axes, (64, 32), strict=True):
            shown = [row for row in rows if row["bits"] == bits]
            for k, name in enumerate(names):
                mine = [row for row in shown if row["condition"] == name]
                good = [row for row in mine if row["invalid"] <= STILL_GOOD * row["trials"]]
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
            for k, row in enumerate({row["engine"]: row for row in shown}.values()):
                x, y = row["cost_us_per_trial"], (0.88 - 0.08 * (k % 2)) * reach
                axis.text(x, y, row["engine"], ha="center", fontsize=9, backgroundcolor="white")
            axis.axhspan(-0.3, 0.3, color="0.92", zorder=0)
            axis.set(
                xscale="log",
                xlabel="cost per trial [us of one core]",
                title=f"{part}, float{bits}",
                ylim=(-reach, reach),
            )
            axis.margins(x=0.08)
            axis.xaxis.set_minor_formatter(NullFormatter())
            axis.grid(alpha=0.3)
        axes[0].set_ylabel("bias of index 1 against dt = 0.001, float64 [%]")
        axes[1].legend(fontsize=8, loc="lower left", ncols=2 if len(names) > 4 else 1)
    return figure


if __name__ == "__main__":
    main()
