"""What do escape energies, which no trial is run for, say about the indices?

- `ranks`: 200 random hands on the wrist (angles and lengths of all joints and limbs, the gap) and
  200 on the arm: rank correlations of index 1, by 1,000 trials on shared draws, with energies and
  with the gap alone. Keeps `results/energy.csv` and draws `results/energy.png`.
- `starts`: the default search of `benchmarks.optimisers` from the given starts against searches
  that know the energies of a thousand designs. Keeps `results/energy_starts.csv`.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.stats import qmc, spearmanr

from benchmarks.optimisers import EACH_TIP
from pcjax.design.gaussian import Points
from pcjax.design.space import DesignSpace, design_space
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.base import Drive
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.quality.energy import energy_of
from pcjax.quality.task import Task
from pcjax.study.evaluate import evaluate

RESULTS = Path(__file__).parent / "results"
UNSEEN = 777

WRIST = EACH_TIP | {
    "gap_width": (100.0, 400.0),
    **{f"joint_angle_{k}1_deg": (60.0, 120.0) for k in (1, 2)},
    **{f"link_length_{k}1": (300.0, 600.0) for k in (1, 2)},
}
ARM = {
    f"{name}_{k}{j}{unit}": bounds
    for k in (1, 2)
    for name, j, unit, bounds in (
        ("joint_angle", 1, "_deg", (45.0, 85.0)),
        ("joint_angle", 2, "_deg", (60.0, 130.0)),
        ("link_length", 1, "", (120.0, 260.0)),
        ("link_length", 2, "", (60.0, 160.0)),
    )
}


@dataclass(frozen=True)
class Setting:
    """From where random hands are drawn, and what they are tried with."""

    name: str
    space: DesignSpace
    body: Body
    drive: Drive
    directions: tuple[str, ...]
    max_steps: int

    @property
    def task(self) -> Task:
        return Task(self.body, self.drive, self.directions, self.max_steps)


def settings() -> list[Setting]:
    circle, large = Circle(25.0), Circle(50.0)
    return [
        Setting(
            "wrist",
            design_space(box_hand(), WRIST, circle.width),
            circle,
            WristTilt(),
            ("does", "eoen"),
            600_000,
        ),
        Setting(
            "arm",
            design_space(two_joint_hand(), ARM, large.width),
            large,
            PlanarArm(),
            ("does",),
            300_000,
        ),
    ]


def allowed_designs(space: DesignSpace, task: Task, count: int, seed: int) -> Points:
    """Designs spread over the space (Sobol), all allowed."""
    sobol, found = qmc.Sobol(len(space.free), rng=seed), np.zeros((0, len(space.free)))
    space = space.holding(task)
    while len(found) < count:
        some = space.low + sobol.random(256) * (space.high - space.low)
        found = np.concatenate([found, some[space.which(some)]])
    return found[:count]


# ------------------------------------------------------------------------------------------- ranks

MEASURES = {
    "mean": "energy from rest, mean over the drive's tilts",
    "mean_from_start": "energy from a start, mean over the drive's tilts",
    "upright": "climb from rest, upright",
    "most": "climb from rest, most of all tilts",
    "least": "climb from rest, least of all tilts",
    "opens_deg": "tilt at which a start needs no climb",
    "clearance": "gap less the object's width, negated",
}
"""Columns and what they are; of each a larger one should keep the object better."""


def ranks(hands: int, trials: int) -> list[dict[str, Any]]:
    """Energies and indices of random hands."""
    rows: list[dict[str, Any]] = []
    for setting in settings():
        designs = allowed_designs(setting.space, setting.task, hands, 0)
        for number, design in enumerate(designs):
            hand = setting.space.hand(design)
            began = time.perf_counter()
            result = evaluate(
                hand,
                setting.body,
                drive=setting.drive,
                direction="both" if len(setting.directions) == 2 else "does",
                trials=trials,
                max_steps=setting.max_steps,
            )
            took = time.perf_counter() - began
            for direction, scenario in zip(
                setting.directions, setting.task.scenarios(hand), strict=True
            ):
                began = time.perf_counter()
                found = energy_of(scenario, 72)
                spent = time.perf_counter() - began
                index = result.indices(direction)["index1"]
                opens = [math.degrees(abs(tilt)) for tilt in found.opens]
                rows.append(
                    {
                        "drive": setting.name,
                        "hand": number,
                        "direction": direction,
                        "index1": index.value,
                        "se": index.se,
                        "mean": found.mean,
                        "mean_from_start": found.mean_from_start,
                        "upright": found.at(0.0).from_rest,
                        "most": float(found.from_rest.max()),
                        "least": float(found.from_rest.min()),
                        "opens_deg": 180.0 if np.isnan(opens).any() else min(opens),
                        "clearance": float(setting.body.width - hand.gap()),
                        "ms": 1e3 * spent,
                        "trials_ms": 1e3 * took / len(setting.directions),
                    }
                )
            if number % 20 == 0:
                print(setting.name, number, flush=True)
    return rows


def correlation(
    x: Float[np.ndarray, " hands"], y: Float[np.ndarray, " hands"], draws: int = 2000
) -> tuple[float, float, float]:
    """Spearman's rank correlation and its 95 % interval, by resampling hands."""
    rng, all_of_them = np.random.default_rng(0), np.arange(len(x))
    resampled = [
        float(spearmanr(x[at], y[at]).statistic)
        for at in (rng.choice(all_of_them, len(x)) for _ in range(draws))
    ]
    low, high = np.nanpercentile(resampled, [2.5, 97.5])
    return float(spearmanr(x, y).statistic), float(low), float(high)


def groups_of(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, Float[np.ndarray, " hands"]]]:
    """Columns by drive and what is ranked; the score is ranked by ratios."""
    found: dict[str, dict[str, Any]] = {}
    for drive, direction in (("wrist", "does"), ("wrist", "eoen"), ("arm", "does")):
        mine = [row for row in rows if (row["drive"], row["direction"]) == (drive, direction)]
        name = f"{drive}, {'DoEs' if direction == 'does' else 'EoEn'}"
        found[name] = {
            key: np.array([float(row[key]) for row in mine]) for key in ("index1", *MEASURES)
        }
    does, eoen = found["wrist, DoEs"], found["wrist, EoEn"]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = {key: does[key] / eoen[key] for key in ("index1", *MEASURES)}
    found["wrist, score"] = ratios | {"clearance": does["clearance"]}
    return found


def draw(rows: Sequence[dict[str, Any]], table: Sequence[dict[str, Any]]) -> Figure:
    """Index 1 over the mean energy, and all rank correlations."""
    groups = groups_of(rows)
    figure = Figure(figsize=(14, 4.6), layout="constrained")
    axes = figure.subplots(1, 3, width_ratios=[1, 1, 1.5])
    for axis, drive in zip(axes, ("wrist", "arm"), strict=False):
        for k, (name, group) in enumerate(groups.items()):
            if name.startswith(drive) and "score" not in name:
                axis.plot(
                    group["mean"], group["index1"], "os^"[k], ms=3.5, label=name.split(", ")[1]
                )
        axis.set(
            xlabel="energy over weight from rest, mean over tilts [length]",
            ylabel="index 1 [steps]",
            title=drive,
        )
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    last = axes[-1]
    for k, name in enumerate(groups):
        mine = [row for row in table if row["of"] == name]
        at = np.arange(len(mine)) + 0.18 * (k - 1.5)
        value = np.array([row["rank"] for row in mine])
        ends = np.array([[row["low"], row["high"]] for row in mine]).T
        last.errorbar(value, at, xerr=np.abs(ends - value), fmt="os^D"[k], ms=4, lw=1, label=name)
    last.set(
        yticks=np.arange(len(MEASURES)),
        yticklabels=[words.replace(", ", ",\n") for words in MEASURES.values()],
        xlabel="rank correlation with index 1 (or the score)",
        xlim=(-1, 1),
    )
    last.invert_yaxis()
    last.tick_params(axis="y", labelsize=7)
    last.axvline(0, color="0.5", lw=0.8)
    last.legend(fontsize=8)
    last.grid(alpha=0.3)
    return figure


def tabled(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rank correlation of each measure with each of what is ranked."""
    return [
        {"of": name, "measure": key, **dict(zip(("rank", "low", "high"), found, strict=True))}
        for name, group in groups_of(rows).items()
        for key in MEASURES
        for found in [correlation(group[key], group["index1"])]
    ]


def keep(rows: Sequence[dict[str, Any]], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hands", type=int, default=200)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--draw", action="store_true", help="only draw what is kept")
    arguments = parser.parse_args()
    kept = RESULTS / "energy.csv"
    if not arguments.draw:
        keep(ranks(arguments.hands, arguments.trials), kept)
    with kept.open(newline="") as file:
        rows = list(csv.DictReader(file))
    table = tabled(rows)
    for row in table:
        print(f"{row['of']:14}{row['rank']:7.3f} [{row['low']:.3f}, {row['high']:.3f}]", end="  ")
        print(MEASURES[row["measure"]])
    draw(rows, table).savefig(RESULTS / "energy.png", dpi=110)


if __name__ == "__main__":
    main()
