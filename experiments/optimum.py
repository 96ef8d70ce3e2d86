"""Does the design loop find the best hand? Against an exhaustive grid, and against CMA-ES.

- Two parameters: every start against the best design on a grid of 2.5 degrees by 0.025 L_p.
- The relaxed score against the exact one over that grid.
- Five parameters (asymmetric fingertips): the loop against CMA-ES for the same wall time.
- The arm's hand: both joint angles.

Final scores are exact, paired, and on trials that nothing else has used. Keeps
`results/optimum.json` and draws `results/optimum.png`.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import rankdata

from pcjax.design.compare import compare
from pcjax.design.optimize import Settings, optimize
from pcjax.design.search import search_cma
from pcjax.design.space import DesignSpace, design_space
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.paper import constants as paper
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task

RESULTS = Path(__file__).parent / "results"
UNSEEN = 777
PARTS = ("grid", "two", "arm", "five")
RADIUS, UNIT = 25.0, paper.WRIST_PALM_LENGTH
BOUNDS = {"fingertip_angle_deg": (-30.0, 45.0), "fingertip_length": (0.05 * UNIT, 0.35 * UNIT)}
STARTS = [(-20, 0.1), (40, 0.1), (0, 0.3), (-30, 0.35), (10, 0.05)]
ONE_SIDED = {
    "fingertip_angle_1_deg": (-30.0, 45.0),
    "fingertip_angle_2_deg": (-30.0, 45.0),
    "fingertip_length_1": (0.05 * UNIT, 0.35 * UNIT),
    "fingertip_length_2": (0.05 * UNIT, 0.35 * UNIT),
    "gap_width": (0.3 * UNIT, 0.6 * UNIT),
}
ONE_SIDED_STARTS = [
    (-20, 10, 0.1, 0.2, 0.4),
    (40, 0, 0.1, 0.3, 0.5),
    (0, 0, 0.3, 0.05, 0.6),
    (-30, 30, 0.35, 0.1, 0.4),
    (10, -10, 0.05, 0.05, 0.35),
]


def wrist() -> Surrogate:
    task = Task(Circle(RADIUS), WristTilt(), ("does", "eoen"), paper.WRIST_MAX_STEPS)
    return Surrogate(task, trials=1000)


def from_start(space: DesignSpace, design: tuple[float, ...]) -> DesignSpace:
    """The space with its base hand at a design."""
    return replace(space, base=space.hand(list(design)))


def grid(scale: float) -> dict[str, Any]:
    """Relaxed and exact scores over the grid, and the best design on it."""
    space = design_space(box_hand(), BOUNDS, 2 * RADIUS)
    angles = np.arange(-30, 45.1, 2.5)
    lengths = np.arange(0.05, 0.3501, 0.025) * UNIT
    designs = [np.array([a, length]) for a in angles for length in lengths]
    designs = [design for design in designs if space.allowed(design)]
    trials, surrogate = max(50, round(1000 * scale)), wrist()
    exact, relaxed = [], []
    for first in range(0, len(designs), 64):
        some = designs[first : first + 64]
        exact += list(compare(surrogate, space, some, trials=trials, seed=1).logs)
        mine = replace(surrogate, trials=trials)
        sample = mine.sample([space.hand(design) for design in some], 2)
        relaxed += list(mine.judge(sample.means())[0] @ mine.signs)
    top = np.argsort(exact)[-8:]
    again = compare(surrogate, space, [designs[k] for k in top], trials=8 * trials, seed=3)
    best = designs[top[again.best]]
    return {
        "designs": [list(map(float, design)) for design in designs],
        "exact": [math.exp(x) for x in exact],
        "relaxed": [math.exp(x) for x in relaxed],
        "rank_correlation": float(np.corrcoef(rankdata(exact), rankdata(relaxed))[0, 1]),
        "best": list(map(float, best)),
    }


def two_parameters(best: list[float], scale: float) -> list[dict[str, Any]]:
    """Each start's end against the best on the grid."""
    found, space = [], design_space(box_hand(), BOUNDS, 2 * RADIUS)
    trials = max(50, round(1000 * scale))
    ends = []
    for angle, share in STARTS:
        began = time.perf_counter()
        got = optimize(
            replace(wrist(), trials=trials),
            from_start(space, (angle, share * UNIT)),
            Settings(check_trials=trials, accept_trials=trials, seed=5),
        )
        ends.append(got.best)
        found.append(
            {
                "start": [angle, share * UNIT],
                "end": list(map(float, got.best)),
                "path": [step.design for step in got.progress.history[0]],
                "trials": got.progress.trials,
                "seconds": time.perf_counter() - began,
                "loop_seconds": got.progress.seconds,
            }
        )
    every = [np.array(best), *ends]
    final = compare(wrist(), space, every, trials=20 * trials, seed=UNSEEN)
    for k, row in enumerate(found, start=1):
        ratio = math.exp(final.logs[k] - final.logs[0])
        difference = np.zeros(len(every))
        difference[k], difference[0] = 1.0, -1.0
        row["ratio_to_best"] = ratio
        row["ratio_se"] = ratio * math.sqrt(difference @ final.covariance @ difference)
        row["score"] = final.scores[k].value
    return found


def five_parameters(scale: float) -> list[dict[str, Any]]:
    """The loop and CMA-ES from the same starts, for the same wall time."""
    found, space = [], design_space(box_hand(), ONE_SIDED, 2 * RADIUS)
    trials = max(50, round(1000 * scale))
    surrogate = replace(wrist(), trials=max(50, round(500 * scale)))
    settings = Settings(check_every=1000, accept_trials=trials, seed=6)
    # Compile first: neither is to pay for that.
    few = replace(settings, iterations=1)
    optimize(surrogate, space, few)
    search_cma(surrogate, space, few)
    for at in ONE_SIDED_STARTS:
        start = (at[0], at[1], at[2] * UNIT, at[3] * UNIT, at[4] * UNIT)
        mine = from_start(space, start)
        loop = optimize(surrogate, mine, settings)
        many = replace(settings, iterations=10_000)
        cma = search_cma(surrogate, mine, many, seconds=loop.progress.seconds)
        final = compare(surrogate, space, [loop.best, cma.best], trials=20 * trials, seed=UNSEEN)
        gain = final.improvement(1, 0)
        found.append(
            {
                "start": list(start),
                "loop": {
                    "end": list(map(float, loop.best)),
                    "score": final.scores[0].value,
                    "trials": loop.progress.trials,
                    "seconds": loop.progress.seconds,
                },
                "cma": {
                    "end": list(map(float, cma.best)),
                    "score": final.scores[1].value,
                    "trials": cma.progress.trials,
                    "seconds": cma.progress.seconds,
                },
                "difference": [gain.value, gain.low, gain.high],
            }
        )
        print(json.dumps(found[-1]), flush=True)
    return found


def arm_hand(scale: float) -> dict[str, Any]:
    """Both joint angles of the arm's hand, from the paper's 65 and 90 degrees."""
    task = Task(Circle(paper.ARM_RADIUS), PlanarArm(), ("does",), paper.ARM_MAX_STEPS)
    free = {"joint_angle_1_deg": (45.0, 85.0), "joint_angle_2_deg": (60.0, 130.0)}
    space = design_space(two_joint_hand(), free, 2 * paper.ARM_RADIUS, 8.0)
    trials = max(50, round(2000 * scale))
    settings = Settings(check_trials=trials, accept_trials=2 * trials, seed=7)
    got = optimize(Surrogate(task, trials=trials), space, settings)
    gain = got.improvement
    return {
        "start": list(map(float, got.start)),
        "end": list(map(float, got.best)),
        "scores": [got.start_score.value, got.best_score.value],
        "improvement": [gain.value, gain.low, gain.high],
        "seconds": got.progress.seconds,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="factor on all numbers of trials")
    parser.add_argument("--only", nargs="*", default=PARTS, choices=PARTS, help="parts to do anew")
    arguments = parser.parse_args()
    kept = RESULTS / "optimum.json"
    found: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    work = {
        "grid": grid,
        "two": lambda scale: two_parameters(found["grid"]["best"], scale),
        "arm": arm_hand,
        "five": five_parameters,
    }
    for part in PARTS:
        if part in arguments.only:
            found[part] = _rounded(work[part](arguments.scale))
            kept.write_text(json.dumps(found) + "\n")
            print(part, "done", flush=True)
    draw(found).savefig(RESULTS / "optimum.png", dpi=110)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_rounded(inner) for inner in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def draw(found: dict[str, Any]) -> Figure:
    """The ways over the map, relaxed against exact, and the loop against CMA-ES."""
    figure = Figure(figsize=(15, 4.6), layout="constrained")
    ways, ranks, five = figure.subplots(1, 3)
    designs, exact = np.array(found["grid"]["designs"]), np.array(found["grid"]["exact"])
    points = ways.scatter(*designs.T, c=exact, s=34, marker="s", cmap="viridis")
    figure.colorbar(points, ax=ways, label="exact score")
    for row in found["two"]:
        way = np.array([*row["path"], row["end"]])
        ways.plot(*way.T, ".-", color="black", lw=0.7, ms=4, mec="white", mew=0.4)
        ways.plot(*way[-1], "*", color="C3", ms=12, mec="white")
    ways.plot(*found["grid"]["best"], "o", mfc="none", mec="C3", ms=14, label="best on the grid")
    ways.set(xlabel="fingertip angle [deg]", ylabel="fingertip length", title="five starts")
    ways.legend(fontsize=8)
    ranks.plot(exact, found["grid"]["relaxed"], ".", alpha=0.6)
    span = [min(exact), max(exact)]
    ranks.plot(span, span, color="0.6", lw=0.8)
    ranks.set(
        xlabel="exact score",
        ylabel="relaxed score (other trials)",
        title=f"rank correlation {found['grid']['rank_correlation']:.3f}",
    )
    x = np.arange(len(found["five"]))
    for k, name in enumerate(("loop", "cma")):
        scores = [row[name]["score"] for row in found["five"]]
        five.plot(x, scores, "os"[k], label={"loop": "design loop", "cma": "CMA-ES"}[name])
    five.set(
        xticks=x,
        xlabel="start",
        ylabel="exact score, unseen trials",
        title="five parameters, equal wall time",
    )
    five.legend(fontsize=8)
    for axis in (ranks, five):
        axis.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    main()
