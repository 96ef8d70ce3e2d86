"""`python -m benchmarks.circles --against DIRECTORY`: a circle on the wrist by another checkout of
pcjax and by this one, in turn, each as its command runs: processor time a trial, and how many
trials end in the same step.

Each checkout has a process of its own with one worker. Rounds go through both in turn; ratios are
taken within a round.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys

import numpy as np

WORKER = """
import math, sys, time
try:
    from pcjax.__main__ import fuse_outputs
    fuse_outputs()
except ImportError:  # before there was such a thing
    pass
import pcjax
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
trials, limit = int(sys.argv[1]), int(sys.argv[2])
for line in sys.stdin:
    radius, angle, direction = line.split()
    hand = pcjax.box_hand(math.radians(float(angle)))
    scenario = getattr(pcjax, direction)(hand, pcjax.Circle(float(radius)))
    engine = choose_engine("auto", None, scenario)
    began = time.process_time()
    out = run([scenario], engine=engine, trials=trials, max_steps=limit, workers=1)
    print(time.process_time() - began, *out.steps[0], flush=True)
"""

CONDITIONS = [
    (radius, angle, direction)
    for radius in (5, 25, 50)
    for angle in (10, 40)
    for direction in ("does", "eoen")
]


class Checkout:
    """A checkout's process."""

    def __init__(self, directory: str, trials: int, limit: int):
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER, str(trials), str(limit)],
            cwd=directory,
            env=os.environ | {"PYTHONPATH": os.path.abspath(directory)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, condition: tuple[float, float, str]) -> tuple[float, np.ndarray]:
        """Seconds of processor time, and the escape steps."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(*condition, file=self.process.stdin, flush=True)
        seconds, *steps = self.process.stdout.readline().split()
        return float(seconds), np.array(steps, int)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--trials", type=int, default=5000)
    add("--max-steps", type=int, default=600_000)
    add("--rounds", type=int, default=5)
    add("--against", required=True, help="directory of another checkout of pcjax")
    args = parser.parse_args()
    checkouts = [
        Checkout(where, args.trials, args.max_steps) for where in (args.against, os.getcwd())
    ]
    print(f"{args.trials:,} trials to {args.max_steps:,} steps, {args.rounds} rounds")
    print(f"{'radius':>6} {'angle':>6} {'':5}{'other':>7}{'here':>7} us a trial   ratio [range]")
    for condition in CONDITIONS:
        found = [one.run(condition) for one in checkouts]  # compiles
        times = []
        for _ in range(args.rounds):
            found = [one.run(condition) for one in checkouts]
            times.append([1e6 * seconds / args.trials for seconds, _ in found])
        other, here = (statistics.median(column) for column in zip(*times, strict=True))
        ratios = [a / b for a, b in times]
        index1 = [steps.mean() for _, steps in found]
        same = np.mean(np.abs(found[0][1] - found[1][1]) <= 2)
        print(
            f"{condition[0]:>6} {condition[1]:>6} {condition[2]:5}{other:>7.1f}{here:>7.1f}"
            f"{statistics.median(ratios):>17.2f} [{min(ratios):.2f}, {max(ratios):.2f}]"
            f"   index 1 {index1[0]:,.0f}, {index1[1]:,.0f}; same end {100 * same:.0f} %",
            flush=True,
        )


if __name__ == "__main__":
    main()
