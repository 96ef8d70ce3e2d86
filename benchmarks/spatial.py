"""`python -m benchmarks.spatial`: hands in three dimensions, by what one would use instead.

Steps a second in one run, on the same model, starts and gravity: trials as pcjax runs them, with
its look at who has escaped and what went wrong; `mujoco.mj_step` in a loop in Python, a trial after
the other, which only steps; and MJX on the CPU (where it is installed), all trials to the limit.
Rounds go through all of them in turn; ratios are taken within a round. Seconds are those that
processors worked, so that a busy machine changes little.

MJX takes float32, has no sensor of contacts with a body, and no elliptic cones for contacts without
friction: its model goes without the sensor, and has pyramidal cones where they make no difference.
"""

from __future__ import annotations

import argparse
import functools
import importlib.util
import math
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

import pcjax
from experiments.shadow import OBJECTS, TILT, hand_file, shadow_hand
from pcjax import spatial
from pcjax.importing import mujoco
from pcjax.simulate.backends.mujoco import run_trials
from pcjax.simulate.draws import period_draws, start_draws, trial_key

DT = 0.002

EVERY = 10
"""Steps for which gravity is held."""


def scenarios() -> dict[str, spatial.Scenario]:
    """What is timed; the Shadow hand where it is installed."""
    start = spatial.StartBox((0.0, 0.0, 0.036), (0.002, 0.002, 0.001))
    hand = spatial.Hand(
        spatial.PRESETS["three-finger"],
        start,
        root="palm",
        posture={f"tip{k}": math.radians(20) for k in (1, 2, 3)},
    )
    tilt = spatial.Tilt(math.radians(60), rest=(1.0, 0.0, 0.0))
    found = {"three fingers, sphere": spatial.Scenario(hand, spatial.Sphere(0.024), tilt)}
    if hand_file() is None:
        print("the Shadow hand: not installed (pip install --no-deps gymnasium-robotics)")
        return found
    shadow = shadow_hand("half closed, palm arched")
    for body, friction in (("sphere", 0.0), ("box", 0.5)):
        law = pcjax.ContactLaw(friction=friction or None)
        name = f"Shadow hand, {body}, mu {friction:g}"
        found[name] = spatial.Scenario(shadow, OBJECTS[body], TILT, law)
    return found


def starts(scenario: spatial.Scenario, trials: int) -> Float[np.ndarray, "trials 7"]:
    """Where the first trials of seed 0 start."""
    draws = [start_draws(trial_key(0, k), scenario.draws_for_start) for k in range(trials)]
    return scenario.hand.start.places(np.array(draws, float))


def pulls(
    scenario: spatial.Scenario, trials: int, steps: int
) -> Float[np.ndarray, "trials chunks 3"]:
    """Gravity in the first trials of seed 0, every `EVERY` steps of the first period."""
    draws = np.array([period_draws(trial_key(0, k), 0, 2) for k in range(trials)], float)
    middles = (np.arange(math.ceil(steps / EVERY)) + 0.5) * EVERY * DT
    angles = [scenario.drive.angles(draws, draws, middle, True) for middle in middles]
    return np.stack([scenario.pull(one) for one in angles], axis=1)


@dataclass
class Contender:
    """`run` makes trials, and tells how many steps; it is timed in seconds of processors."""

    name: str
    run: Callable[[], int]
    rates: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    first_call: float = math.nan

    def warm(self) -> None:
        began = time.process_time()
        self.run()
        self.first_call = time.process_time() - began

    def time(self) -> None:
        began, worked = time.perf_counter(), time.process_time()
        steps = self.run()
        self.rates.append(steps / (time.process_time() - worked))
        self.wall.append(steps / (time.perf_counter() - began))


def ours(scenario: spatial.Scenario, trials: int, limit: float, threads: int) -> Contender:
    def run() -> int:
        steps, _ = run_trials(
            scenario,
            np.arange(trials),
            max_steps=round(1000 * limit),
            seed=0,
            dt=DT,
            threads=threads,
        )
        return round(steps.sum() * 0.001 / DT)

    return Contender(f"pcjax, {threads} thread{'s' if threads > 1 else ''}", run)


def stepped(
    model: Any, place: Float[np.ndarray, "7"], pulls: Float[np.ndarray, "chunks 3"], count: int
) -> Float[np.ndarray, "7"]:
    """Where an object is after so many steps, in a loop in Python."""
    mj = mujoco()
    data = mj.MjData(model)
    data.qpos[:] = place
    for step in range(count):
        if step % EVERY == 0:
            model.opt.gravity[:] = pulls[step // EVERY]
        mj.mj_step(model, data)
    return data.qpos.copy()


def in_python(scenario: spatial.Scenario, trials: int, limit: float) -> Contender:
    """Each trial to where it ends, as known from a first run."""
    few, last = np.arange(trials), round(1000 * limit)
    ends, _ = run_trials(scenario, few, max_steps=last, seed=0, dt=DT)
    counts = np.ceil(ends * 0.001 / DT - 1e-9).astype(int).tolist()
    gravity = pulls(scenario, trials, max(counts))
    model, places = scenario.scene(DT).model, starts(scenario, trials)

    def run() -> int:
        for place, pull, count in zip(places, gravity, counts, strict=True):
            stepped(model, place, pull, count)
        return sum(counts)

    return Contender("mujoco.mj_step in Python", run)


def by_mjx(scenario: spatial.Scenario, trials: int, limit: float) -> Contender:
    from mujoco import mjx  # pyright: ignore[reportMissingImports, reportAttributeAccessIssue]

    mj = mujoco()
    spec = scenario.scene(DT).spec
    spec.delete(spec.sensor("deepest"))
    if not scenario.law.friction:
        spec.option.cone = mj.mjtCone.mjCONE_PYRAMIDAL
    model = spec.compile()
    theirs, blank = mjx.put_model(model), mjx.make_data(model)
    gravity = pulls(scenario, trials, round(limit / DT))

    def one(place: Any, pull: Any) -> Any:
        def held(data: Any, now: Any) -> tuple[Any, None]:
            here = theirs.tree_replace({"opt.gravity": now})
            return jax.lax.fori_loop(0, EVERY, lambda _, data: mjx.step(here, data), data), None

        return jax.lax.scan(held, blank.replace(qpos=place), pull)[0].qpos

    roll, places = jax.jit(jax.vmap(one)), starts(scenario, trials)

    def run() -> int:
        jax.block_until_ready(roll(places.astype(np.float32), gravity.astype(np.float32)))
        return trials * gravity.shape[1] * EVERY

    return Contender("MJX, jit of vmap", run)


def table(every: list[Contender]) -> str:
    lines = []
    for one in every:
        ratios = [a / b for a, b in zip(every[0].rates, one.rates, strict=True)]
        rate = statistics.median(one.rates)
        lines.append(
            f"  {one.name:28}{rate:>12,.0f}{DT * rate:>12,.0f}"
            f"{statistics.median(one.wall):>14,.0f}"
            f"{statistics.median(ratios):>10.2f} [{min(ratios):.2f}, {max(ratios):.2f}]"
            f"{one.first_call:>10.1f} s"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--limit", type=float, default=2.0, help="of a trial, s, at most a period of the tilt")
    add("--trials", type=int, default=500, help="of pcjax")
    add("--few", type=int, default=20, help="of the loop in Python")
    add("--worlds", type=int, default=32, help="of MJX")
    add("--mjx-limit", type=float, default=0.5, help="the same for MJX, which takes long")
    add("--only", default="", help="what has this in its name")
    add("--rounds", type=int, default=3)
    args = parser.parse_args()
    cores = os.cpu_count() or 1
    print(
        f"{cores} cores, steps of {DT} s, at most {args.limit:g} s a trial, {args.rounds} rounds\n"
        f"{'':30}{'steps / CPU s':>12}{'s / CPU s':>12}{'steps / s':>12}"
        f"{'first one is faster by':>24}{'first call':>12}"
    )
    mjx = importlib.util.find_spec("mujoco.mjx") is not None
    if not mjx:
        print("MJX: not installed (pip install mujoco-mjx)")
    for name, scenario in scenarios().items():
        if args.only not in name:
            continue
        mine = functools.partial(ours, scenario, args.trials, args.limit)
        every = [mine(1), *([mine(cores)] if cores > 1 else [])]
        every.append(in_python(scenario, args.few, args.limit))
        if mjx:
            every.append(by_mjx(scenario, args.worlds, args.mjx_limit))
        for one in every:
            one.warm()
        for _ in range(args.rounds):
            for one in every:
                one.time()
        print(f"{name}\n{table(every)}", flush=True)


if __name__ == "__main__":
    main()
