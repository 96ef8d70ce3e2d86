"""`python -m benchmarks`: trial-steps per second, all in one run, as a table of ratios.

Rates are over all cores. Each contender runs the same trials of one condition; a round times every
contender once, and the table gives medians over the rounds, since machines drift.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import time
from collections.abc import Callable

import numpy as np

from benchmarks import numba_loop, pymunk_scene
from benchmarks.inputs import as_arrays
from pcjax.engines.ensemble import run
from pcjax.engines.stepping import Stepping
from pcjax.evaluate import choose_engine
from pcjax.model.body import Circle
from pcjax.model.hand import box_hand
from pcjax.model.scenario import does

PAPER_DT = 0.001


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--trials", type=int, default=4096, help="trials of the one condition")
    parser.add_argument("--max-steps", type=int, default=20_000, help="limit, steps of 0.001 s")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    trials, limit = arguments.trials, arguments.max_steps

    scenario = does(box_hand(math.radians(10)), Circle(25.0))
    inputs = as_arrays(scenario, trials=trials, max_steps=limit)
    few = min(trials, 8)
    automatic = choose_engine("auto", None, scenario)

    def pcjax_steps(engine: Stepping, precision: int) -> Callable[[], np.ndarray]:
        return lambda: run(
            [scenario], trials=trials, max_steps=limit, engine=engine, precision=precision
        ).steps[0]

    def numba_steps(dtype: type, in_step: bool) -> Callable[[], np.ndarray]:
        return lambda: numba_loop.escape_steps(
            **inputs, max_steps=limit, dtype=dtype, time_of_impact=in_step
        )

    def pymunk_steps() -> np.ndarray:
        some = inputs | {k: inputs[k][:few] for k in ("starts", "targets")}
        return 5 * pymunk_scene.escape_steps(**some, dt=0.005, max_steps=limit // 5)

    reference = Stepping(PAPER_DT)
    contenders = {
        "pcjax stepping, dt = 0.001, float32": pcjax_steps(reference, 32),
        "pcjax stepping, dt = 0.001, float64": pcjax_steps(reference, 64),
        f"pcjax auto, dt = {automatic.dt:g}, float32": pcjax_steps(automatic, 32),
        "numba, same step, float32": numba_steps(np.float32, True),
        "numba, same step, float64": numba_steps(np.float64, True),
        "numba, push-out only, float32": numba_steps(np.float32, False),
        "pymunk, dt = 0.005": pymunk_steps,
    }
    rates: dict[str, list[float]] = {name: [] for name in contenders}
    first: dict[str, float] = {}
    for _ in range(arguments.rounds + 1):
        for name, contender in contenders.items():
            began = time.perf_counter()
            steps = np.minimum(contender(), limit)
            seconds = time.perf_counter() - began
            if name in first:
                rates[name].append(steps.sum() / seconds)
            else:
                first[name] = seconds

    base = statistics.median(rates["numba, same step, float32"])
    print(
        f"{trials:,} trials, limit {limit:,} steps of 0.001 s, {os.cpu_count()} cores, "
        f"medians of {arguments.rounds} rounds"
    )
    print(
        f"{'':38}{'million simulated':>20}{'against numba,':>18}{'first call':>12}\n"
        f"{'':38}{'0.001 s steps / s':>20}{'same step, f32':>18}{'[s]':>12}"
    )
    for name, samples in rates.items():
        rate = statistics.median(samples)
        print(f"{name:38}{rate / 1e6:>20.2f}{rate / base:>17.2f}x{first[name]:>12.1f}")
    print("first call: with compilation; pymunk runs", few, "trials on one core")


if __name__ == "__main__":
    main()
