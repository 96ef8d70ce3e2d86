"""What do escape energies, which no trial is run for, say about the indices?

- `ranks`: 200 random hands on the wrist (angles and lengths of all joints and limbs, the gap) and
  200 on the arm: rank correlations of index 1, by 1,000 trials on shared draws, with energies and
  with the gap alone. Keeps `results/energy.csv` and draws `results/energy.png`.
- `starts`: the default search of `benchmarks.optimisers` from the given starts against searches
  that know the energies of 500 designs, half as long. Keeps `results/energy_starts.csv`.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.stats import qmc, rankdata

from benchmarks.optimisers import EACH_TIP, Problem, problems
from pcjax.design.belief import Belief
from pcjax.design.checkpoint import Progress
from pcjax.design.compare import compare
from pcjax.design.gaussian import Points
from pcjax.design.modelled import Search
from pcjax.design.space import Design, DesignSpace, design_space
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.base import Drive
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.quality.energy import energy_of, landscape_for
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
            design_space(box_hand(), WRIST, 50.0),
            circle,
            WristTilt(),
            ("does", "eoen"),
            600_000,
        ),
        Setting(
            "arm",
            design_space(two_joint_hand(), ARM, 100.0),
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
    "both": "the first and the last, by a fit to all other hands",
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


def rank_correlation(x: Float[np.ndarray, " hands"], y: Float[np.ndarray, " hands"]) -> float:
    """Spearman's."""
    return float(np.corrcoef(rankdata(x), rankdata(y))[0, 1])


def correlation(
    x: Float[np.ndarray, " hands"], y: Float[np.ndarray, " hands"], draws: int = 2000
) -> tuple[float, float, float]:
    """Spearman's rank correlation and its 95 % interval, by resampling hands."""
    rng, all_of_them = np.random.default_rng(0), np.arange(len(x))
    resampled = [
        rank_correlation(x[at], y[at])
        for at in (rng.choice(all_of_them, len(x)) for _ in range(draws))
    ]
    low, high = np.nanpercentile(resampled, [2.5, 97.5])
    return rank_correlation(x, y), float(low), float(high)


def groups_of(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, Float[np.ndarray, " hands"]]]:
    """Columns by drive and what is ranked; the score is ranked by ratios."""
    found: dict[str, dict[str, Any]] = {}
    known = ("index1", *MEASURES)
    for drive, direction in (("wrist", "does"), ("wrist", "eoen"), ("arm", "does")):
        mine = [row for row in rows if (row["drive"], row["direction"]) == (drive, direction)]
        name = f"{drive}, {'DoEs' if direction == 'does' else 'EoEn'}"
        found[name] = {
            key: np.array([float(row[key]) for row in mine]) for key in mine[0] if key in known
        }
        found[name]["both"] = foretold(found[name])
    does, eoen = found["wrist, DoEs"], found["wrist, EoEn"]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = {key: does[key] / eoen[key] for key in known}
    ratios = {key: ratio for key, ratio in ratios.items() if np.isfinite(ratio).all()}
    found["wrist, score"] = ratios | {"clearance": does["clearance"]}
    return found


def foretold(group: dict[str, Float[np.ndarray, " hands"]]) -> Float[np.ndarray, " hands"]:
    """Index 1 of each hand from the mean energy and the clearance, by a product of powers of both
    that is fitted to all other hands."""
    logs = [np.ones(len(group["mean"])), np.log(group["mean"]), np.log(-group["clearance"])]
    columns, index = np.column_stack(logs), np.log(group["index1"])
    hat = columns @ np.linalg.pinv(columns)
    return np.exp(index - (index - hat @ index) / (1 - np.diag(hat)))


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
            xlabel="mean energy over weight from rest [length]",
            ylabel="index 1 [steps]",
            title=drive,
        )
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    last = axes[-1]
    for k, name in enumerate(groups):
        mine = [row for row in table if row["of"] == name]
        places = [list(MEASURES).index(row["measure"]) for row in mine]
        at = np.array(places) + 0.18 * (k - 1.5)
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
        if key in group
        for found in [correlation(group[key], group["index1"])]
    ]


# ------------------------------------------------------------------------------------------ starts

CANDIDATES, LOOKS = 500, 16
"""Designs whose energies are known, and at how many tilts."""

PROBLEMS = ("box, 3", "asymmetric tips, 5", "arm with lengths, 4", "asymmetric, index 2, 6")


def promise(problem: Problem, designs: Points) -> Float[np.ndarray, " designs"]:
    """What energies and gaps say of a problem's objective: the logarithm of the mean energy over
    the clearance of DoEs, less that of EoEn where the score counts."""
    task, held, found = problem.surrogate.task, {}, []
    tilts = 2 * math.pi * np.arange(LOOKS) / LOOKS - math.pi
    for design in designs:
        hand, value = problem.space.hand(design), 0.0
        for sign, scenario in zip((1, -1), task.scenarios(hand), strict=False):
            if sign not in held:
                known = energy_of(scenario, 4)
                held[sign] = known.held_tilts, np.hypot(*known.held.T)
            land, (at, share) = landscape_for(scenario), held[sign]
            down = np.stack([np.sin(tilts), -np.cos(tilts)], axis=1)
            climbs = [land.climb(one).from_rest for one in down]
            mean = np.mean(share * np.interp(at, tilts, climbs, period=2 * math.pi))
            clearance = float(hand.gap()) - problem.space.width
            value += sign * (math.log(mean + 1e-9) - math.log(clearance + 1e-9))
        found.append(value)
    return np.array(found)


@dataclass(frozen=True)
class Told(Search):
    """A search whose first round has designs that were chosen for it."""

    chosen: Any = None

    def first(self, begun: Design) -> Points:
        """Where it begins, and these."""
        count = len(super().first(begun))
        return np.concatenate([begun[None], self.chosen])[:count]


def searched(problem: Problem, search: Search) -> Design:
    """The best design that a search has tried in the problem's time."""
    until, belief = time.process_time() + problem.seconds, Belief(problem.surrogate)
    begun = problem.space.design_of(problem.space.base)
    state = Progress([[]], [list(map(float, begun))], [])
    while not belief.batches or time.process_time() < until:
        state = search.round(belief, state)
    return np.array(state.designs[0])


def ends_of(problem: Problem, seed: int) -> tuple[dict[str, Design], float]:
    """Ends of each kind of search from one start, and what the energies cost, s."""
    space = problem.space
    began = time.process_time()
    designs = allowed_designs(space, problem.surrogate.task, CANDIDATES, seed)
    designs = designs[np.argsort(-promise(problem, designs))]
    cost = time.process_time() - began
    best = replace(problem, space=replace(space, base=space.hand(designs[0])))
    plain = Search(problem.surrogate, space, seed)
    top = plain.place(designs[:64])
    return {
        "given": searched(problem, plain),
        "best energy": searched(best, Search(best.surrogate, best.space, seed)),
        "64 best energies": searched(problem, Told(problem.surrogate, space, seed, top)),
        "best energy, untried": designs[0],
    }, cost


def starts(scale: float) -> list[dict[str, Any]]:
    """Ends of searches in the benchmark's time, on trials that none of them has used. Energies cost
    no time here: what they save at best."""
    rows: list[dict[str, Any]] = []
    for problem in problems():
        if problem.name not in PROBLEMS:
            continue
        problem = replace(problem, seconds=scale * problem.seconds)
        ends, mine = [], []
        searched(
            replace(problem.start(0), seconds=0.1),
            Search(problem.surrogate, problem.start(0).space, 0),
        )  # compiles
        for start in range(len(problem.starts)):
            found, cost = ends_of(problem.start(start), 1000 * start)
            ends += found.values()
            mine += [
                {
                    "problem": problem.name,
                    "start": start,
                    "kind": kind,
                    "energies_s": cost,
                    "search_s": problem.seconds,
                }
                for kind in found
            ]
        final = compare(problem.surrogate, problem.space, ends, trials=5000, seed=UNSEEN)
        top = int(np.argmax(final.logs))
        for k, row in enumerate(mine):
            pair = np.zeros(len(ends))
            pair[k] += 1.0
            pair[top] -= 1.0
            row["to_best"] = float(final.logs[k] - final.logs[top])
            row["se"] = math.sqrt(max(pair @ final.covariance @ pair, 0.0))
        rows += mine
        for kind in dict.fromkeys(row["kind"] for row in mine):
            each = [100 * row["to_best"] for row in mine if row["kind"] == kind]
            print(f"{problem.name}: {kind}: {np.mean(each):.2f} % {np.round(each, 2)}", flush=True)
    return rows


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
    parser.add_argument("--scale", type=float, default=0.5, help="factor on the searches' time")
    parser.add_argument("--only", choices=("ranks", "starts", "draw"), help="one part")
    arguments = parser.parse_args()
    if arguments.only in (None, "starts"):
        keep(starts(arguments.scale), RESULTS / "energy_starts.csv")
    if arguments.only == "starts":
        return
    kept = RESULTS / "energy.csv"
    if arguments.only != "draw":
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
