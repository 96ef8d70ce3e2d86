"""`python -m benchmarks.optimisers`: ways to a better hand, at equal processor time.

Every method gets the same processor time in each problem, from each of three starts, compilation
and final comparisons aside. The designs that they end with are compared on 10,000 trials that none
of them has used, the same for all. Keeps a table (`optimisers.csv`) and draws it, with
`--out DIRECTORY`.

- model, gradient, cma: the package's. The gradient's schedule is as long as the time allows.
- process: a plain Gaussian process of the score (Matern 5/2, Thompson sampling, batches of 8
  designs on 250 fresh trials), whose noise is independent.
- evolution: scipy's differential evolution, 250 trials, the same for all designs.
- random: designs spread over the space on 250 trials, of which the better half gets twice as many,
  and so on.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pcjax.design.ascent import search_gradient
from pcjax.design.compare import compare
from pcjax.design.gaussian import GaussianProcess, Kernel, fitted
from pcjax.design.modelled import Search, search_model
from pcjax.design.outcome import Settings
from pcjax.design.search import search_cma
from pcjax.design.space import Design, DesignSpace, design_space
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.convex import Capsule, Square
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task

BOTH_TIPS = {"fingertip_angle_deg": (-30.0, 50.0), "fingertip_length": (25.0, 175.0)}
EACH_TIP = {
    "fingertip_angle_1_deg": (-30.0, 50.0),
    "fingertip_length_1": (25.0, 175.0),
    "fingertip_angle_2_deg": (-30.0, 50.0),
    "fingertip_length_2": (25.0, 175.0),
}
ONE_SIDED = EACH_TIP | {"gap_width": (100.0, 400.0)}

UNSEEN = 777
TRIALS = 250
BOTH = ("does", "eoen")


@dataclass(frozen=True)
class Problem:
    """A hand to improve: what may change, where searches begin, and the processor time."""

    name: str
    surrogate: Surrogate
    space: DesignSpace
    starts: Sequence[Sequence[float]]
    seconds: float

    def start(self, k: int) -> Problem:
        """With its base hand at a start."""
        at = self.space.nearest_allowed(np.array(self.starts[k], float))
        space = replace(self.space, base=self.space.hand(at))
        return replace(self, space=space.holding(self.surrogate.task))


def _wrist(body: Body, directions: tuple[str, ...] = BOTH, friction: float | None = None) -> Task:
    return Task(body, WristTilt(), directions, 600_000, ContactLaw(friction=friction))


def _chain(angles: Sequence[float], lengths: Sequence[float]) -> HandDesign:
    radians, each = tuple(map(math.radians, angles)), tuple(lengths)
    return HandDesign(500.0, (each, each), (radians, radians))


def problems() -> list[Problem]:
    """All of them."""
    tip, each, gap = BOTH_TIPS, EACH_TIP, {"gap_width": (100.0, 400.0)}
    joints = {f"joint_angle_{k}{j}_deg": (60.0, 120.0) for k in (1, 2) for j in (1, 2)}
    links = {f"link_length_{k}1": (300.0, 600.0) for k in (1, 2)}
    two = {
        "joint_angle_1_deg": (45.0, 85.0),
        "joint_angle_2_deg": (60.0, 130.0),
        "link_length_1": (120.0, 260.0),
        "link_length_2": (60.0, 160.0),
    }
    arm = Task(Circle(50.0), PlanarArm(), ("does",), 300_000)
    box, rubbing = box_hand(), ContactLaw(friction=0.3)
    return [
        Problem(
            "box, 2",
            Surrogate(_wrist(Circle(25.0))),
            design_space(box, tip, 50.0),
            [(-20, 50), (40, 50), (0, 150)],
            6.0,
        ),
        Problem(
            "box, 3",
            Surrogate(_wrist(Circle(40.0))),
            design_space(box, tip | gap, 80.0, 12.0),
            [(-10, 60, 330), (30, 100, 150), (-25, 150, 390)],
            6.0,
        ),
        Problem(
            "chain with barbs, 3",
            Surrogate(_wrist(Circle(30.0))),
            design_space(
                _chain((80, 60, 30), (200, 120, 100)),
                {
                    "joint_angle_2_deg": (20, 100),
                    "joint_angle_3_deg": (-30, 100),
                    "link_length_3": (40, 200),
                },
                60.0,
                15.0,
            ),
            [(60, 30, 100), (90, 0, 60), (30, 60, 150)],
            9.0,
        ),
        Problem(
            "box, escape rate, 3",
            Surrogate(_wrist(Circle(25.0)), objective="escape_rate"),
            design_space(box, tip | gap, 50.0),
            [(-10, 60, 330), (30, 100, 150), (-25, 150, 390)],
            6.0,
        ),
        Problem(
            "square with friction, 3",
            Surrogate(_wrist(Square(60.0), friction=0.35)),
            design_space(box, tip | gap, 60.0),
            [(-10, 60, 330), (30, 100, 150), (-25, 150, 390)],
            25.0,
        ),
        Problem(
            "two limbs a finger, 4",
            Surrogate(replace(_wrist(Circle(25.0)), max_steps=300_000)),
            design_space(two_joint_hand(), two, 50.0, 8.0),
            [(65, 90, 200, 100), (50, 120, 140, 70), (80, 80, 250, 150)],
            8.0,
        ),
        Problem(
            "arm with lengths, 4",
            Surrogate(arm),
            design_space(two_joint_hand(), two, 100.0, 8.0),
            [(65, 90, 200, 100), (50, 100, 180, 70), (80, 80, 250, 120)],
            20.0,
        ),
        Problem(
            "asymmetric tips, 5",
            Surrogate(_wrist(Circle(25.0))),
            design_space(box, ONE_SIDED, 50.0),
            [(-20, 50, 10, 100, 200), (40, 50, 0, 150, 250), (-30, 175, 30, 50, 200)],
            8.0,
        ),
        Problem(
            "asymmetric, index 2, 6",
            Surrogate(_wrist(Circle(10.0), ("does",)), objective="index2"),
            design_space(box, ONE_SIDED | {"link_length_1": (300.0, 600.0)}, 20.0, 12.0),
            [
                (10, 100, 10, 100, 200, 500),
                (-20, 50, 0, 100, 300, 400),
                (30, 60, 0, 150, 150, 600),
            ],
            8.0,
        ),
        Problem(
            "three radii, the worst, 3",
            Surrogate(
                replace(
                    _wrist(Circle(25.0)),
                    also=(_wrist(Circle(10.0)), _wrist(Circle(40.0))),
                    worst=True,
                )
            ),
            design_space(box, tip | gap, 80.0, 12.0),
            [(-10, 60, 330), (30, 100, 150), (-25, 150, 390)],
            12.0,
        ),
        Problem(
            "asymmetric, all, 10",
            Surrogate(_wrist(Circle(25.0))),
            design_space(box, each | joints | links, 50.0),
            [
                (10, 100, 10, 100, 90, 90, 90, 90, 500, 500),
                (-20, 50, 0, 150, 80, 90, 80, 90, 400, 400),
                (30, 60, -10, 60, 95, 85, 85, 95, 550, 450),
            ],
            12.0,
        ),
        # Chosen when the default's method was fixed.
        Problem(
            "capsule on the arm, 4",
            Surrogate(Task(Capsule(80.0, 40.0), PlanarArm(), ("does",), 300_000, rubbing)),
            design_space(two_joint_hand(), two, 40.0, 8.0),
            [(65, 90, 200, 100), (50, 100, 180, 70), (80, 80, 250, 120)],
            20.0,
        ),
        Problem(
            "asymmetric, score by index 2, 4",
            Surrogate(_wrist(Circle(25.0)), objective="index2"),
            design_space(box, each, 50.0),
            [(10, 100, 10, 100), (-20, 50, 0, 100), (30, 60, -10, 150)],
            8.0,
        ),
    ]


# ---------------------------------------------------------------------------------------- methods

Method = Callable[[Problem, int, float], Design]
"""From a problem, a seed and a time on the process' clock to the design that is best by then."""


def _enough(until: float) -> Callable[[], bool]:
    return lambda: time.process_time() > until


def _settings(method: str, seed: int, iterations: int = 100_000) -> Settings:
    return Settings(
        method,
        iterations,
        gain=0.0,
        check_every=100_000,
        check_trials=2,
        accept_trials=8,
        seed=seed,
    )


def by_model(problem: Problem, seed: int, until: float) -> Design:
    """The package's default."""
    settings = replace(_settings("model", seed), accept_trials=10_000)
    enough = _enough(until)
    return search_model(
        problem.surrogate, problem.space, settings, watch=lambda state: enough()
    ).best


def by_gradient(problem: Problem, seed: int, until: float) -> Design:
    """The gradient of the relaxed score; an iteration is timed first."""
    began = time.process_time()
    search_gradient(problem.surrogate, problem.space, _settings("gradient", seed, 1))
    took, left = time.process_time() - began, until - time.process_time()
    settings = _settings("gradient", seed + 1, max(int(left / took), 2))
    return search_gradient(problem.surrogate, problem.space, settings).best


def by_cma(problem: Problem, seed: int, until: float) -> Design:
    """CMA-ES on the exact score."""
    few = replace(problem.surrogate, trials=TRIALS)
    return search_cma(few, problem.space, _settings("cma", seed), enough=_enough(until)).best


def _scores(problem: Problem, designs: np.ndarray, trials: int, seed: int) -> tuple[Any, Any]:
    found = compare(problem.surrogate, problem.space, list(designs), trials=trials, seed=seed)
    return found.logs, np.diag(found.covariance)


def by_process(problem: Problem, seed: int, until: float) -> Design:
    """A plain Gaussian process with Thompson sampling."""
    search, rng = Search(problem.surrogate, problem.space, seed), np.random.default_rng(seed)
    begun = search.place(problem.space.design_of(problem.space.base))
    at, values, variances, kernel, known = search.first(begun), [], [], None, 0
    seen, enough = np.zeros((0, len(begun))), _enough(until)
    for k in range(100_000):
        found, variance = _scores(problem, search.design(at), TRIALS, seed + k)
        values, variances = [*values, *found], [*variances, *variance]
        seen = np.concatenate([seen, at])
        y, noise = np.array(values), np.diag(variances)
        if len(seen) >= 1.2 * known:
            kernel, known = fitted(seen, y, noise, kernel), len(seen)
        assert isinstance(kernel, Kernel)
        process = GaussianProcess(seen, y, noise, kernel)
        spread = rng.random((512, len(begun)))
        best = seen[np.argmax(process.mean(seen))]
        near = np.clip(best + 0.05 * rng.standard_normal((256, len(begun))), 0, 1)
        places = np.concatenate([spread, near])
        places = np.concatenate([places[search.allowed(places)], best[None]])
        if enough():
            return search.design(places[np.argmax(process.mean(places))])
        mean, covariance = process.joint(places)
        covariance[np.diag_indices_from(covariance)] += 1e-6 * np.trace(covariance) / len(places)
        draws = np.linalg.cholesky(covariance) @ rng.standard_normal((len(places), 8))
        at = places[list(dict.fromkeys(np.argmax(mean[:, None] + draws, axis=0).tolist()))]
    raise AssertionError


def by_evolution(problem: Problem, seed: int, until: float) -> Design:
    """Scipy's differential evolution on 250 trials, the same for all."""
    from scipy.optimize import differential_evolution

    search, best = Search(problem.surrogate, problem.space, seed), [(-math.inf, np.zeros(0))]
    begun = search.place(problem.space.design_of(problem.space.base))
    enough = _enough(until)

    def loss(columns: np.ndarray) -> np.ndarray:
        at = columns.T
        result, good = np.full(len(at), 1e3), search.allowed(at)
        if good.any() and not enough():
            result[good] = -_scores(problem, search.design(at[good]), TRIALS, seed)[0]
            k = int(np.argmin(result))
            best.append(max(best[-1], (-result[k], at[k]), key=lambda one: one[0]))
        return result

    differential_evolution(
        loss,
        [(0.0, 1.0)] * len(begun),
        x0=np.clip(begun, 0.0, 1.0),
        vectorized=True,
        updating="deferred",
        polish=False,
        maxiter=100_000,
        tol=0.0,
        rng=seed,
        callback=lambda *_, **__: enough(),
    )
    return search.design(best[-1][1])


def by_chance(problem: Problem, seed: int, until: float) -> Design:
    """Random designs for a half of the time, then the better half of them, and so on."""
    search, rng = Search(problem.surrogate, problem.space, seed), np.random.default_rng(seed)
    begun = search.place(problem.space.design_of(problem.space.base))
    began = time.process_time()
    at, values = begun[None], np.zeros(0)
    while time.process_time() < began + 0.5 * (until - began):
        some = rng.random((64, len(begun)))
        some = some[search.allowed(some)]
        tried = np.concatenate([at[len(values) :], some])
        at = np.concatenate([at, some])
        values = np.append(values, _scores(problem, search.design(tried), TRIALS, seed)[0])
    trials = TRIALS
    while time.process_time() < until and len(at) > 1:
        trials, order = 4 * trials, np.argsort(-values)[: max(len(values) // 4, 1)]
        at = at[order]
        values = _scores(problem, search.design(at), trials, seed + trials)[0]
    return search.design(at[np.argmax(values)])


METHODS: dict[str, Method] = {
    "model": by_model,
    "gradient": by_gradient,
    "process": by_process,
    "cma": by_cma,
    "evolution": by_evolution,
    "random": by_chance,
}


def run(problem: Problem, methods: Sequence[str], seed: int) -> list[dict[str, Any]]:
    """A problem by some methods from each of its starts, all ends compared."""
    rows: list[dict[str, Any]] = []
    ends: list[Design] = []
    for name in methods:  # compiles
        METHODS[name](problem.start(0), seed, time.process_time() + 0.2)
    for start in range(len(problem.starts)):
        mine = problem.start(start)
        for name in methods:
            began = time.process_time()
            end = METHODS[name](mine, seed + 1000 * start, began + problem.seconds)
            spent = time.process_time() - began
            ends.append(end)
            rows.append({"problem": problem.name, "start": start, "method": name, "cpu": spent})
    logs, covariance = [], []
    found = compare(problem.surrogate, problem.space, ends, trials=10_000, seed=UNSEEN)
    logs, covariance = found.logs, found.covariance
    best = int(np.argmax(logs))
    for k, (row, end) in enumerate(zip(rows, ends, strict=True)):
        of_best = np.zeros(len(ends))
        of_best[k] += 1.0
        of_best[best] -= 1.0
        row["score"] = math.exp(logs[k])
        row["to_best"] = logs[k] - logs[best]
        row["se"] = math.sqrt(max(of_best @ covariance @ of_best, 0.0))
        row["design"] = problem.space.describe(end)
    return rows


def main() -> None:
    """Runs all and prints a table."""
    parser = argparse.ArgumentParser(description="Ways to a better hand, at equal time.")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--only", nargs="*", default=[], help="words of the problems' names")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the times")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for optimisers.csv")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for problem in problems():
        if arguments.only and not any(word in problem.name for word in arguments.only):
            continue
        mine = replace(problem, seconds=arguments.scale * problem.seconds)
        found = run(mine, arguments.methods, arguments.seed)
        rows += found
        best = max(row["score"] for row in found)
        print(f"{problem.name}: best score {best:.4f}, {mine.seconds:g} s of processor time")
        for name in arguments.methods:
            each = [row for row in found if row["method"] == name]
            told = [f"{100 * row['to_best']:+7.2f} ± {196 * row['se']:.2f}" for row in each]
            mean = 100 * np.mean([row["to_best"] for row in each])
            print(f"  {name:10}{mean:+8.2f} %   {', '.join(told)}", flush=True)
        if arguments.out:
            arguments.out.mkdir(parents=True, exist_ok=True)
            _keep(rows, arguments.out / "optimisers.csv")
            draw(rows).savefig(arguments.out / "optimisers.png", dpi=110)


def draw(rows: Sequence[dict[str, Any]]) -> Figure:
    """How far below the best end each one is, problem by problem; a hundredth of a per cent at
    least."""
    figure = Figure(figsize=(15.5, 5.2), layout="constrained")
    axis = figure.subplots()
    names = list(dict.fromkeys(row["problem"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for k, method in enumerate(methods):
        mine = [row for row in rows if row["method"] == method]
        x = [names.index(row["problem"]) + 0.13 * (k - (len(methods) - 1) / 2) for row in mine]
        below = [max(-100 * float(row["to_best"]), 0.01) for row in mine]
        axis.plot(x, below, "osD^vx"[k % 6], ms=5, label=method)
    words = [name.rsplit(", ", 1) for name in names]
    axis.set(
        yscale="log",
        ylabel="below the best end of all [%]",
        xticks=np.arange(len(names)),
        xticklabels=[f"{name.replace(', ', chr(10))}\n{count} free" for name, count in words],
    )
    axis.tick_params(axis="x", labelsize=7)
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, ncols=len(methods), loc="upper center", bbox_to_anchor=(0.5, 1.1))
    return figure


def _keep(rows: list[dict[str, Any]], path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows
        )


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
