"""`python -m benchmarks.optimisers`: ways to a better hand, score reached against time and trials.

All begin with the paper's hand and have the same two parameters free. Scores are exact, on trials
that no method has used, the same for all; so are their standard errors, relative to the first row.
Compilation is paid for before.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import numpy as np

from pcjax.design.compare import compare
from pcjax.design.gradients import Differences
from pcjax.design.optimize import Optimum, Settings, optimize
from pcjax.design.search import search_cma, search_grid
from pcjax.design.space import DesignSpace, design_space
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand
from pcjax.paper import constants as paper
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task

_UNSEEN = 777
_SHARES = (0.25, 0.5, 1.0)
"""Of each method's time, after which its design is looked at."""

Row = tuple[str, float, int, np.ndarray]
"""Method, seconds, trials, design."""


def _rows(name: str, found: Optimum) -> list[Row]:
    """Where a method was after some shares of its time; a grid only has an end."""
    spent, steps = found.progress, found.progress.history
    rows = []
    for share in _SHARES[:-1] if steps else ():
        design = steps[0][round(share * (len(steps[0]) - 1))].design
        rows.append((name, share * spent.seconds, round(share * spent.trials), np.array(design)))
    return [*rows, (name, spent.seconds, spent.trials, found.best)]


def _methods(surrogate: Surrogate, space: DesignSpace, settings: Settings) -> list[Row]:
    rows = [("start", 0.0, 0, space.nearest_allowed(space.design_of(space.base)))]
    loop = optimize(surrogate, space, settings)
    rows += _rows("gradient of the relaxed score", loop)
    exact = replace(surrogate, form="exact")
    rows += _rows("gradient of the exact score", optimize(exact, space, settings))
    evolution = optimize(exact, space, settings, estimator=Differences("gaussian"))
    rows += _rows("evolution strategy", evolution)
    many = replace(settings, iterations=100_000)
    seconds = loop.progress.seconds
    rows += _rows("CMA-ES", search_cma(surrogate, space, many, seconds=seconds))
    return rows + _rows("grid, 11 x 11", search_grid(surrogate, space, settings))


def main() -> None:
    """Runs all methods and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000, help="of a hand and direction")
    parser.add_argument("--iterations", type=int, default=Settings.iterations)
    parser.add_argument("--max-steps", type=int, default=paper.WRIST_MAX_STEPS)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    task = Task(Circle(25.0), WristTilt(), ("does", "eoen"), arguments.max_steps)
    surrogate = Surrogate(task, trials=arguments.trials)
    space = design_space(box_hand(), ["fingertip_angle_deg", "fingertip_length"], 50.0)
    settings = Settings(
        iterations=arguments.iterations,
        check_every=100_000,
        accept_trials=arguments.trials,
        seed=arguments.seed,
    )
    _methods(surrogate, space, replace(settings, iterations=1))
    rows = _methods(surrogate, space, settings)
    designs = [row[-1] for row in rows]
    final = compare(surrogate, space, designs, trials=20 * arguments.trials, seed=_UNSEEN)
    print(f"{'method':32}{'seconds':>9}{'trials':>12}{'score':>16}  design")
    for k, (name, seconds, trials, design) in enumerate(rows):
        gain = final.improvement(0, k)
        told = f"{math.exp(final.logs[k]):.4f} ± {gain.se:.4f}"
        print(f"{name:32}{seconds:>9.1f}{trials:>12,}{told:>16}  {space.describe(design)}")


if __name__ == "__main__":
    main()
