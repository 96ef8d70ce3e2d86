"""Does the design loop find the best hand, and which of its parts does it owe that to?

- `two`: angle and length of both fingertips, 20 seeds from five starts, against the best design on
  a grid of 2.5 degrees by 0.025 L_p.
- `five`: fingertips that differ and the gap, 20 seeds, against the best on a grid of 5 values each.
- `parts`: searches of equal length without one part of the model each, on problems of 2, 3, 6 and
  10 parameters.

Final scores are exact, paired, and on trials that nothing else has used. Keeps
`results/optimum.json` and draws `results/optimum.png`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.optimisers import ONE_SIDED, Problem, problems
from pcjax.design.belief import Batch, Belief
from pcjax.design.checkpoint import Progress
from pcjax.design.compare import compare
from pcjax.design.gaussian import Points
from pcjax.design.modelled import BATCH, Search
from pcjax.design.optimize import optimize
from pcjax.design.outcome import Settings
from pcjax.design.space import Design, DesignSpace, design_space
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand
from pcjax.paper import constants as paper
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task

RESULTS = Path(__file__).parent / "results"
UNSEEN = 777
SEEDS = 20
RADIUS, UNIT = 25.0, paper.WRIST_PALM_LENGTH
BOUNDS = {"fingertip_angle_deg": (-30.0, 45.0), "fingertip_length": (0.05 * UNIT, 0.35 * UNIT)}
STARTS = [(-20, 0.1), (40, 0.1), (0, 0.3), (-30, 0.35), (10, 0.05)]


def wrist() -> Surrogate:
    task = Task(Circle(RADIUS), WristTilt(), ("does", "eoen"), paper.WRIST_MAX_STEPS)
    return Surrogate(task)


def best_of(space: DesignSpace, designs: np.ndarray, trials: int) -> Design:
    """The best of many designs: all on some trials, the top ones again on many."""
    designs = designs[space.holding(wrist().task).which(designs)]
    logs = np.concatenate(
        [
            compare(wrist(), space, list(designs[k : k + 64]), trials=trials, seed=1).logs
            for k in range(0, len(designs), 64)
        ]
    )
    top = designs[np.argsort(logs)[-32:]]
    again = compare(wrist(), space, list(top), trials=20 * trials, seed=3)
    return top[again.best]


def from_seeds(
    space: DesignSpace, starts: Sequence[tuple[float, ...]], best: Design, trials: int
) -> dict[str, Any]:
    """The default from every seed against the best of a grid."""
    optimize(wrist(), space, Settings(iterations=2, accept_trials=trials))  # compiles
    rows, ends = [], []
    for seed in range(SEEDS):
        base = space.hand(np.array(starts[seed % len(starts)], float))
        began = time.process_time()
        mine = replace(space, base=base)
        got = optimize(wrist(), mine, Settings(seed=1000 * seed, accept_trials=10 * trials))
        ends.append(got.best)
        rows.append(
            {
                "seconds": time.process_time() - began,
                "trials": got.trials,
                "path": [step.design for step in got.progress.history[0]],
                "end": list(map(float, got.best)),
            }
        )
    final = compare(wrist(), space, [best, *ends], trials=20 * trials, seed=UNSEEN)
    for k, row in enumerate(rows, start=1):
        difference = np.zeros(len(ends) + 1)
        difference[k], difference[0] = 1.0, -1.0
        row["to_best"] = float(final.logs[k] - final.logs[0])
        row["se"] = math.sqrt(difference @ final.covariance @ difference)
    return {"best": list(map(float, best)), "score": math.exp(final.logs[0]), "seeds": rows}


def two(trials: int) -> dict[str, Any]:
    space = design_space(box_hand(), BOUNDS, 2 * RADIUS)
    angles, shares = np.arange(-30, 45.1, 2.5), np.arange(0.05, 0.3501, 0.025)
    designs = np.array([[a, share * UNIT] for a in angles for share in shares])
    best = best_of(space, designs, trials)
    return from_seeds(space, [(a, share * UNIT) for a, share in STARTS], best, trials)


def five(trials: int) -> dict[str, Any]:
    space = design_space(box_hand(), ONE_SIDED, 2 * RADIUS)
    lines = [np.linspace(p.low, p.high, 5) for p in space.free]
    best = best_of(space, np.array(list(itertools.product(*lines))), max(trials // 4, 2))
    starts = [(-20, 50, 10, 100, 200), (40, 50, 0, 150, 250), (-30, 175, 30, 50, 200)]
    return from_seeds(space, starts, best, trials)


# ------------------------------------------------------------------------------------------ parts


@dataclass(frozen=True)
class Unpaired(Search):
    """As if every design had trials of its own."""

    def try_out(self, at: Points, round: int) -> tuple[Batch, int]:
        batch, invalid = super().try_out(at, round)
        return replace(batch, noise=batch.noise * np.eye(len(at))), invalid


@dataclass(frozen=True)
class AsOne(Search):
    """One process for the score, in place of one for each direction."""

    def try_out(self, at: Points, round: int) -> tuple[Batch, int]:
        exact = replace(self.surrogate, form="exact", trials=self.trials(round))
        hands = [self.space.hand(one) for one in self.design(at)]
        found = exact.appraise(sample := exact.sample(hands, self.seed + round))
        influence = np.einsum("vd,dvn->vn", exact.weigh(found[0]), found[1])
        count = influence.shape[1]
        noise = influence @ influence.T / (count * (count - 1)) + 1e-9 * np.eye(len(at))
        logs = np.asarray(exact.combined(found[0]))[:, None]
        return Batch(at, logs, noise[None], count), sample.invalid


@dataclass(frozen=True)
class Starred(Search):
    """Half of each batch, or more, is moves about the best design: derivatives, as differences on
    the same trials."""

    def think(self, belief: Belief, round: int) -> tuple[Points, float]:
        at, gain = super().think(belief, round)
        assert isinstance(self.space, DesignSpace)
        moves = self.space.usual_moves(self.design(at[0])) / (self.space.high - self.space.low)
        star = at[0] + np.concatenate([np.diag(moves), np.diag(-moves)])
        star = self.drawn_in(star, np.repeat(at[:1], len(star), axis=0))
        return np.concatenate([at[: max(BATCH - len(star), BATCH // 2)], star]), gain


KINDS = {"all of it": Search, "unpaired": Unpaired, "one process": AsOne, "derivatives": Starred}


def searched(problem: Problem, kind: type[Search], seed: int) -> Design:
    """The best design that one kind of search has tried in the problem's time."""
    surrogate, until = problem.surrogate, time.process_time() + problem.seconds
    search = kind(surrogate, problem.space, seed)
    alone = replace(surrogate, task=replace(surrogate.task, directions=("does",)))
    belief = Belief(alone if kind is AsOne else surrogate)
    begun = problem.space.design_of(problem.space.base)
    state = Progress([[]], [list(map(float, begun))], [])
    while not belief.batches or time.process_time() < until:
        state = search.round(belief, state)
    return np.array(state.designs[0])


def parts(trials: int) -> dict[str, Any]:
    names = ("box, 2", "box, 3", "chain with barbs, 3", "asymmetric tips, 5", "asymmetric, all, 10")
    found = {}
    for problem in problems():
        if problem.name not in names:
            continue
        ends, rows = [], []
        for seed, (name, kind) in itertools.product(range(6), KINDS.items()):
            mine = replace(problem.start(start := seed % 3), seconds=0.5 * problem.seconds)
            ends.append(searched(mine, kind, 1000 * seed))
            rows.append({"start": start, "kind": name})
        final = compare(problem.surrogate, problem.space, ends, trials=10 * trials, seed=UNSEEN)
        top = int(np.argmax(final.logs))
        for k, row in enumerate(rows):
            pair = np.zeros(len(ends))
            pair[k] += 1.0
            pair[top] -= 1.0
            row["to_best"] = float(final.logs[k] - final.logs[top])
            row["se"] = math.sqrt(max(pair @ final.covariance @ pair, 0.0))
        found[problem.name] = rows
        for name in KINDS:
            each = [100 * row["to_best"] for row in rows if row["kind"] == name]
            print(f"{problem.name}: {name}: {np.mean(each):.2f} % {np.round(each, 2)}", flush=True)
    return found


PARTS = {"two": two, "five": five, "parts": parts}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="factor on all numbers of trials")
    parser.add_argument("--only", nargs="*", default=[*PARTS], choices=PARTS, help="parts to do")
    arguments = parser.parse_args()
    kept = RESULTS / "optimum.json"
    found: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    for part in arguments.only:
        found[part] = _rounded(PARTS[part](max(50, round(1000 * arguments.scale))))
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
    """Ends against the best of a grid, how long that took, and searches without a part."""
    figure = Figure(figsize=(14, 4.4), layout="constrained")
    ends, seconds, without = figure.subplots(1, 3, width_ratios=[1, 1, 1.5])
    for k, (part, name) in enumerate((("two", "2 parameters"), ("five", "5 parameters"))):
        rows = found[part]["seeds"]
        gains = 100 * np.array([row["to_best"] for row in rows])
        errors = 196 * np.array([row["se"] for row in rows])
        x = np.arange(len(rows)) + 0.2 * k
        ends.errorbar(x, gains, errors, fmt="os"[k], ms=4, lw=1, label=name)
        seconds.plot(x, [row["seconds"] for row in rows], "os"[k], ms=4, label=name)
    ends.axhline(0, color="0.5", lw=0.8)
    ends.axhline(-1, color="0.5", lw=0.8, ls=":")
    ends.set(xlabel="seed", ylabel="above the best on a grid [%]", title="20 seeds")
    seconds.set(xlabel="seed", ylabel="processor time after compilation [s]", ylim=(0, None))
    for axis in (ends, seconds):
        axis.legend(fontsize=8)
    for k, kind in enumerate(KINDS):
        x, y = [], []
        for place, rows in enumerate(found["parts"].values()):
            mine = [-100 * row["to_best"] for row in rows if row["kind"] == kind]
            x += [place + 0.15 * (k - 1.5)] * len(mine)
            y += mine
        without.plot(x, np.maximum(y, 0.01), "osD^"[k], ms=5, label=kind)
    names = [name.rsplit(", ", 1) for name in found["parts"]]
    without.set(
        yscale="log",
        xticks=np.arange(len(names)),
        xticklabels=[f"{name}\n{count} parameters" for name, count in names],
        ylabel="below the best that any found [%]",
        title="searches without a part, half the benchmark's time",
    )
    without.tick_params(axis="x", labelsize=7)
    without.legend(fontsize=8)
    for axis in (ends, seconds, without):
        axis.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    main()
