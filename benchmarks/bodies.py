"""`python -m benchmarks.bodies`: what objects with a shape and friction cost, a trial each.

All in one run: circles without friction by their own engine, convex bodies by theirs, the same
trials in pymunk and Box2D (where they are installed), and sticks by another checkout of pcjax
(`--against DIRECTORY`). Rounds go through all of them in turn; ratios are taken within a round.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks import pymunk_scene
from benchmarks.inputs import as_arrays, solid_of
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.convex import Capsule, RegularPolygon, Square
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine

BODIES: dict[str, Body] = {
    "circle": Circle(50.0),
    "stick": Stick(50.0),
    "capsule": Capsule(100.0, 20.0),
    "square": Square(90.0, 2.0),
    "hexagon": RegularPolygon(6, 50.0, 2.0),
}
"""Of equal size, more or less."""


def scenario_of(drive: str, body: str, friction: float) -> Scenario:
    law = ContactLaw(friction=friction or None)
    if drive == "wrist":
        return does(box_hand(math.radians(10)), BODIES[body], law=law)
    hand = two_joint_hand(math.radians(65), math.radians(90))
    return does(hand, BODIES[body], PlanarArm(), law)


@dataclass
class Contender:
    """`run` makes the trials, and gives their escape steps; seconds a trial are kept."""

    name: str
    drive: str
    trials: int
    run: Callable[[], np.ndarray]
    first_call: float = math.nan
    index1: float = math.nan
    se: float = math.nan
    seconds: list[float] = field(default_factory=list)

    def time(self) -> None:
        began = time.perf_counter()
        steps = self.run()
        self.seconds.append((time.perf_counter() - began) / self.trials)
        self.index1 = float(steps.mean())
        self.se = float(steps.std()) / math.sqrt(steps.size)


def ours(drive: str, body: str, friction: float, trials: int, limit: int) -> Contender:
    scenario = scenario_of(drive, body, friction)
    engine = choose_engine("auto", None, scenario)

    def steps() -> np.ndarray:
        return run([scenario], engine=engine, trials=trials, max_steps=limit).steps[0].astype(float)

    name = f"{body}, mu {friction:g} ({engine.name})"
    return Contender(name, drive, trials, steps)


def theirs(name: str, scene: Any, body: str, friction: float, trials: int, limit: int):
    scenario = scenario_of("wrist", body, friction)
    inputs, solid = as_arrays(scenario, trials=trials, max_steps=limit), solid_of(scenario)

    def steps() -> np.ndarray:
        of = pymunk_scene.escape_steps(**inputs, max_steps=limit // 5, solid=solid, scene=scene)
        return np.minimum(5.0 * of, limit)

    return Contender(f"{body}, mu {friction:g}: {name}", "wrist", trials, steps)


OTHER = """
import math, sys, time, warnings
import pcjax
drive, trials, limit = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
if drive == "wrist":
    hand, how = pcjax.box_hand(math.radians(10)), pcjax.WristTilt()
else:
    hand, how = pcjax.two_joint_hand(math.radians(65), math.radians(90)), pcjax.PlanarArm()
settings = dict(drive=how, direction="does", trials=trials, max_steps=limit)
pcjax.evaluate(hand, pcjax.Stick(50.0), **settings)
for line in sys.stdin:
    began = time.perf_counter()
    found = pcjax.evaluate(hand, pcjax.Stick(50.0), **settings)
    index1 = found.indices("does")["index1"]
    print(time.perf_counter() - began, index1.value, index1.se, flush=True)
"""


class Other(Contender):
    """The stick by another checkout, in a process of its own."""

    def __init__(self, directory: str, drive: str, trials: int, limit: int):
        super().__init__("stick, mu 0: the other checkout", drive, trials, lambda: np.zeros(0))
        self.process = subprocess.Popen(
            [sys.executable, "-c", OTHER, drive, str(trials), str(limit)],
            cwd=directory,
            env=os.environ | {"PYTHONPATH": os.path.abspath(directory)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def time(self) -> None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("again\n")
        self.process.stdin.flush()
        seconds, self.index1, self.se = map(float, self.process.stdout.readline().split())
        self.seconds.append(seconds / self.trials)


def contenders(args: argparse.Namespace) -> list[Contender]:
    found: list[Contender] = []
    for drive in ("wrist", "arm"):
        for body in BODIES:
            for friction in (0.0, 0.35):
                found.append(ours(drive, body, friction, args.trials, args.max_steps))
        if args.against:
            found.append(Other(args.against, drive, args.trials, args.max_steps))
    scenes: dict[str, Any] = {"pymunk": pymunk_scene.PymunkScene}
    if importlib.util.find_spec("Box2D") is None:
        print("Box2D: not installed (pip install Box2D)")
    else:
        from benchmarks.box2d_scene import Box2DScene

        scenes["Box2D"] = Box2DScene
    few = max(2, args.trials // 250)
    for name, scene in scenes.items():
        for body, friction in (("circle", 0.0), ("square", 0.0), ("square", 0.35)):
            what = f"{name}, 5 ms, one core"
            found.append(theirs(what, scene, body, friction, few, args.max_steps))
    return found


def table(every: list[Contender]) -> str:
    first = {one.drive: one for one in reversed(every)}  # the circle without friction
    lines = [f"{'':44}{'trials':>7}{'us a trial':>12}{'to circle':>10}{'index 1':>16}{'first':>9}"]
    for drive, base in first.items():
        lines.append(drive)
        for one in every:
            if one.drive == drive:
                ratios = [a / b for a, b in zip(one.seconds, base.seconds, strict=True)]
                index1 = f"{one.index1:,.0f} ± {1.96 * one.se:,.0f}"
                lines.append(
                    f"  {one.name:42}{one.trials:>7,}{1e6 * statistics.median(one.seconds):>12,.0f}"
                    f"{statistics.median(ratios):>10.1f}{index1:>16}{one.first_call:>7.1f} s"
                )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--trials", type=int, default=4000, help="of ours; others make fewer")
    add("--max-steps", type=int, default=180_000)
    add("--rounds", type=int, default=3)
    add("--against", help="directory of another checkout of pcjax")
    args = parser.parse_args()
    every = contenders(args)
    for one in every:
        if type(one) is Contender and one.trials == args.trials:
            began = time.perf_counter()
            one.run()
            one.first_call = time.perf_counter() - began
    for _ in range(args.rounds):
        for one in every:
            one.time()
    print(f"{os.cpu_count()} cores, at most {args.max_steps:,} steps, {args.rounds} rounds")
    print(table(every))


if __name__ == "__main__":
    main()
