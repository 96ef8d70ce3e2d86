"""`python -m benchmarks`: pcjax against what one would use instead, on conditions of Fig. 12.

All in one run. A round times every contender once, one after the other; each runs the first trials
of the same conditions, as many as it can in some seconds. Machines drift and are shared, so
medians over the rounds come with their ranges, and ratios are taken within a round.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import numba_loop, pymunk_scene
from benchmarks.inputs import as_arrays
from pcjax.model.bodies.circle import Circle
from pcjax.model.presets import box_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.paper import constants as paper
from pcjax.simulate.choose import choose_engine
from pcjax.study.evaluate import evaluate_grid

SAMPLE = ((0.01, -20.0), (0.05, 10.0), (0.1, 40.0))
"""Radius in palm lengths and fingertip angle in degrees; each in both directions."""

WARM_UP = 10_000
"""Steps of a first, untimed call: it compiles and runs one period of the drive."""

Steps = NDArray[np.number]


@dataclass
class Contender:
    """One way to get the escape steps of `trials` trials of every condition of the sample.

    `run` takes the step limit and gives them as (conditions, trials), or as (conditions, 1) means.
    """

    name: str
    trials: int
    run: Callable[[int], Steps]
    first_call: float = math.nan
    rates: list[float] = field(default_factory=list)
    steps: Steps = field(default_factory=lambda: np.zeros((0, 0)))

    def compile(self) -> None:
        began = time.perf_counter()
        self.run(WARM_UP)
        self.first_call = time.perf_counter() - began

    def time(self, limit: int) -> None:
        began = time.perf_counter()
        self.steps = self.run(limit)
        seconds = time.perf_counter() - began
        self.rates.append(self.steps.mean() * self.trials * len(self.steps) / seconds)


def sample() -> list[Scenario]:
    """Some conditions of Fig. 12, spread over radii, angles and directions."""
    palm = paper.WRIST_PALM_LENGTH
    return [
        direction(box_hand(math.radians(angle)), Circle(radius * palm))
        for radius, angle in SAMPLE
        for direction in (does, eoen)
    ]


def contenders(scenarios: Sequence[Scenario], scale: float, limit: int) -> list[Contender]:
    """Everything that is compared; the first one is what the ratios are for."""
    longest = max(limit, WARM_UP)
    inputs = [as_arrays(s, trials=max(1, round(500 * scale)), max_steps=longest) for s in scenarios]

    def ours(name: str, trials: int, **settings: Any) -> Contender:
        trials = max(2, round(trials * scale))
        labels = {"number": range(len(scenarios))}

        def run(limit: int) -> Steps:
            data = evaluate_grid(scenarios, labels, trials=trials, max_steps=limit, **settings)
            return data.index1.sel(statistic="value").values[:, None]

        return Contender(name, trials, run)

    def theirs(
        name: str,
        trials: int,
        escape_steps: Callable[..., NDArray[np.int64]],
        every: int = 1,
        **settings: Any,
    ) -> Contender:
        """`every`: the contender's step in steps of 0.001 s."""
        trials = max(1, round(trials * scale))

        def run(limit: int) -> Steps:
            rows = []
            for arrays in inputs:
                first = arrays | {name: arrays[name][:trials] for name in ("starts", "targets")}
                steps = every * escape_steps(**first, max_steps=limit // every, **settings)
                rows.append(np.minimum(steps, limit))
            return np.array(rows)

        return Contender(name, trials, run)

    numba = numba_loop.escape_steps
    auto = ", ".join(dict.fromkeys(choose_engine("auto", None, s).name for s in scenarios))
    found = [
        ours(f"pcjax auto ({auto}), float32", 5000),
        ours(f"pcjax auto ({auto}), float64", 5000, precision=64),
        ours("pcjax stepping, 0.001 s, float32", 500, engine="stepping", dt=0.001),
        theirs("numba, same step, float32", 500, numba, dtype=np.float32),
        theirs("numba, same step, float64", 500, numba, dtype=np.float64),
        theirs("numba, push-out, float32", 500, numba, dtype=np.float32, time_of_impact=False),
        theirs("pymunk, 0.005 s, one core", 5, pymunk_scene.escape_steps, 5, dt=0.005),
    ]
    if importlib.util.find_spec("mujoco") is None:
        print("mujoco: not installed (pip install mujoco)")
        return found
    from benchmarks import mujoco_scene

    mujoco = mujoco_scene.escape_steps
    return [
        *found,
        theirs("MuJoCo, rollout", 8, mujoco),
        theirs("MuJoCo, mj_step in Python, one core", 1, mujoco, in_python=True),
    ]


def table(every: Sequence[Contender]) -> str:
    """Speeds and ratios to the first contender."""
    mean_steps = every[0].steps.mean()
    lines = [
        f"{'':36}{'trials':>7}{'million steps/s':>24}{'trials/s':>10}"
        f"{'first one is faster by':>26}{'first call':>12}"
    ]
    for contender in every:
        rates = [rate / 1e6 for rate in contender.rates]
        ratios = [a / b for a, b in zip(every[0].rates, contender.rates, strict=True)]
        per_second = statistics.median(contender.rates) / mean_steps
        lines.append(
            f"{contender.name:36}{contender.trials:>7,}{_with_range(rates):>24}"
            f"{_short(per_second):>10}{_with_range(ratios):>26}{contender.first_call:>10.1f} s"
        )
    return "\n".join(lines)


def _short(number: float) -> str:
    return f"{number:,.0f}" if number >= 100 else f"{number:.2g}"


def _with_range(numbers: Sequence[float]) -> str:
    low, high = _short(min(numbers)), _short(max(numbers))
    return f"{_short(statistics.median(numbers))} [{low}, {high}]"


def agreement(other: Contender, reference: Contender, limit: int) -> str:
    """How far the escape steps are from the reference's on the same trials."""
    ours = reference.steps[:, : other.trials].ravel().astype(float)
    theirs = other.steps.ravel().astype(float)
    error = np.std(theirs - ours) / math.sqrt(len(ours))
    return (
        f"{other.name:36}{len(ours):>7,} trials: index 1 {theirs.mean() / ours.mean() - 1:+.2%} "
        f"± {error / ours.mean():.2%}, passed {(theirs < limit).sum():,} against "
        f"{(ours < limit).sum():,}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--max-steps", type=int, default=600_000, help="limit, steps of 0.001 s")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--scale", type=float, default=1.0, help="factor on all numbers of trials")
    arguments = parser.parse_args()
    limit = arguments.max_steps

    scenarios = sample()
    every = contenders(scenarios, arguments.scale, limit)
    for contender in every:
        contender.compile()
    for _ in range(arguments.rounds):
        for contender in every:
            contender.time(limit)

    print(
        f"{len(scenarios)} conditions of Fig. 12, limit {limit:,} steps of 0.001 s, "
        f"{os.cpu_count()} cores; medians [ranges] of {arguments.rounds} rounds.\n"
        "trials: run of each condition. trials/s: at the first one's mean escape time. first call: "
        f"compiles, and runs {WARM_UP:,} steps.\n"
    )
    print(table(every))
    (reference,) = (c for c in every if c.name == "numba, same step, float64")
    print(f"\nEscape steps against {reference.name}, on the same trials:")
    for contender in every:
        if contender is not reference and contender.steps.shape[1] == contender.trials:
            print(agreement(contender, reference, limit))


if __name__ == "__main__":
    main()
