"""A search over the six joints of the three-finger hand, against a posture that is set by hand.

The object, the tilt and the escape rule are those of `pcjax study --example mujoco`. Fingers may
lean out, not in, and tips bend by 20 degrees at most, so that the hand stays open: a closed one
would win. Start and result are compared on trials that the search has not seen.

Keeps `results/posture.csv`, one row for each of both postures, and `results/posture.json` with what
was spent and refused; draws `results/posture.png`.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pcjax import spatial
from pcjax.design.checkpoint import Progress
from pcjax.design.optimize import optimize
from pcjax.design.outcome import Optimum, Settings
from pcjax.design.postures import PostureSpace
from pcjax.quality.surrogate import Surrogate
from pcjax.study.spec import Run
from pcjax.study.task import task_of

RESULTS = Path(__file__).parent / "results"
FINGERS = (1, 2, 3)
MAX_STEPS = 30_000
BASES, TIPS = (-15.0, 0.0), (0.0, 20.0)
TIP = 15.0
"""Set by hand, degrees."""


def example() -> spatial.Study:
    """The hand-set posture, its object and its tilt."""
    hand = spatial.Hand(
        spatial.PRESETS["three-finger"],
        spatial.StartBox((0.0, 0.0, 0.036), (0.002, 0.002, 0.001)),
        root="palm",
        posture={f"base{k}": 0.0 for k in FINGERS}
        | {f"tip{k}": math.radians(TIP) for k in FINGERS},
    )
    drive = spatial.Tilt(math.radians(60.0), rest=(1.0, 0.0, 0.0))
    return spatial.Study(hand, spatial.Sphere(0.024), drive, run=Run(max_steps=MAX_STEPS))


def rows_of(found: Optimum, space: PostureSpace) -> list[dict[str, float | str]]:
    """Both postures with their scores."""
    rows: list[dict[str, float | str]] = []
    for name, design, score in (
        ("set by hand", found.start, found.start_score),
        ("found", found.best, found.best_score),
    ):
        values = {key: round(value, 3) for key, value in space.named(design).items()}
        estimate = {key: float(f"{value:.5g}") for key, value in vars(score).items()}
        rows.append({"posture": name} | values | estimate)
    return rows


def draw(found: Optimum, space: PostureSpace) -> Figure:
    """Scores along the way, and where each joint was and is."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    way, joints = figure.subplots(1, 2)
    (steps,) = found.progress.history
    logs, errors = (np.array([getattr(s, name) for s in steps]) for name in ("value", "value_se"))
    k = np.arange(1, len(steps) + 1)
    way.plot(k, np.exp(logs), label="the best so far, as the search believes")
    way.fill_between(k, np.exp(logs - 1.96 * errors), np.exp(logs + 1.96 * errors), alpha=0.2)
    for at, score, name in ((0, found.start_score, "hand"), (k[-1] + 1, found.best_score, "found")):
        reach = [[score.value - score.low], [score.high - score.value]]
        way.errorbar(at, score.value, reach, fmt="s", capsize=4, label=f"{name}, unseen trials")
    way.set(xlabel="round", ylabel="DoEs: index 1 [steps of 0.001 s]")
    names = [p.name.removeprefix("posture.") for p in space.free]
    joints.plot(names, found.start, "s", label="set by hand")
    joints.plot(names, found.best, "o", label="found")
    joints.set(ylabel="joint [deg]")
    for axis in (way, joints):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    return figure


def tell(state: Progress) -> bool:
    """Prints where the search is; it goes on."""
    step = state.history[0][-1]
    at = ", ".join(f"{value:.1f}" for value in step.design)
    print(f"round {state.iteration}: {math.exp(step.value):.4g} at {at} deg", flush=True)
    return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=60, help="of a posture and direction")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--accept-trials", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    study = example()
    free = {f"posture.base{k}": BASES for k in FINGERS} | {f"posture.tip{k}": TIPS for k in FINGERS}
    space = study.space(free)
    surrogate = Surrogate(task_of(study), form="exact", trials=arguments.trials)
    settings = Settings(
        iterations=arguments.rounds,
        accept_trials=arguments.accept_trials,
        seed=arguments.seed,
    )
    wall, busy = time.perf_counter(), time.process_time()
    found = optimize(surrogate, space, settings, watch=tell)
    wall, busy = time.perf_counter() - wall, time.process_time() - busy
    print(found, f"\n{wall:.0f} s, {busy:.0f} s of all cores")
    rows = rows_of(found, space)
    with (RESULTS / "posture.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    told = {
        "improvement": {name: float(f"{x:.5g}") for name, x in vars(found.improvement).items()},
        "rounds": found.progress.iteration,
        "trials": found.trials,
        "invalid": found.invalid,
        "refused": dict(found.refused),
        "max_steps": MAX_STEPS,
        "settings": vars(settings),
        "wall_seconds": round(wall),
        "cpu_seconds": round(busy),
    }
    (RESULTS / "posture.json").write_text(json.dumps(told, indent=1) + "\n")
    draw(found, space).savefig(RESULTS / "posture.png", dpi=110)


if __name__ == "__main__":
    main()
