"""Random hands, most of them nothing like the paper's: do both engines say the same?

For each hand the event-driven engine and fixed steps run the same trials, in 64 and in 32 bits.
What has to hold: no trial goes wrong, nobody leaves but across the goal line, what is held is in
the hand, the engines' index 1 agrees within 3.5 standard errors of their paired difference, and
energy never grows while gravity is held.
Keeps `results/fuzz.csv`; `--hands 20` makes a cheap version.
"""

from __future__ import annotations

import argparse
import csv
import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from pcjax.compiling import compiled_quickly
from pcjax.geometry import NEVER, Vec
from pcjax.model.bodies.circle import Circle
from pcjax.model.checking import check_geometry
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import TiltProfile, WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import INVALID, PASSED, RUNNING, State, at_rest
from pcjax.physics.step import advance
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.event import EventDriven
from pcjax.simulate.leaping import Flight, leap
from pcjax.simulate.outcomes import Outcomes
from pcjax.simulate.stepping import Stepping, safe_step

RESULTS = Path(__file__).parent / "results"

LIMBS = ((1, 1), (2, 2), (3, 3), (2, 4), (5, 5))
"""Limbs of finger 1 and finger 2: few pairs, since each compiles programs of its own."""

STEPS = (2e-3, 2e-4)
"""Steps, s, of which the first that is fine enough is taken: few, for the same reason."""

FINER = 0.3
"""The largest step as a share of what would be taken automatically."""

SHAPES = ("box", "flared", "leaning", "tapered", "acute", "collinear", "curled", "any")

STRAY = 1e-3
"""How far beside the goal line, in radii, a trial may pass by rounding."""


@dataclass(frozen=True)
class Case:
    """A random condition and what it is like."""

    scenario: Scenario
    shape: str
    direction: str
    gap: float

    @property
    def dt(self) -> float:
        """The step that the stepping engine takes, s."""
        longest = FINER * safe_step(self.scenario)
        return next(step for step in STEPS if step <= longest)

    @property
    def tightness(self) -> float:
        """How much wider the gap is than the object, in diameters."""
        diameter = 2 * float(self.scenario.body.radius)
        return self.gap / diameter - 1


def random_finger(
    rng: np.random.Generator, limbs: int, shape: str, palm: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Limb lengths and joint angles."""
    lengths = palm * np.concatenate([rng.uniform(0.3, 1.2, 1), rng.uniform(0.05, 0.5, limbs - 1)])
    first = {
        "box": lambda: 90.0,
        "flared": lambda: rng.uniform(35, 88),
        "leaning": lambda: rng.uniform(90.5, 112),
    }.get(shape, lambda: rng.uniform(55, 105))()
    others = {
        "box": lambda: rng.choice([90.0, 90.0, rng.uniform(-20, 110)]),
        "tapered": lambda: rng.uniform(5, 60),
        "acute": lambda: rng.choice([-1, 1]) * rng.uniform(95, 165),
        "collinear": lambda: rng.normal(0, 2),
        "curled": lambda: rng.uniform(50, 100),
    }.get(shape, lambda: rng.uniform(-110, 130))
    angles = [first, *(others() for _ in range(limbs - 1))]
    return tuple(lengths.tolist()), tuple(np.radians(angles).tolist())


def random_case(rng: np.random.Generator, limbs: tuple[int, int]) -> Case:
    """A condition that `check_geometry` and the event-driven engine accept."""
    while True:
        shape = str(rng.choice(SHAPES))
        palm = float(rng.choice([1.0, 200.0, 500.0]))
        fingers = [random_finger(rng, count, shape, palm) for count in limbs]
        if limbs[0] == limbs[1] and rng.random() < 0.3:
            fingers[1] = fingers[0]
        hand = HandDesign(palm, (fingers[0][0], fingers[1][0]), (fingers[0][1], fingers[1][1]))
        with jax.enable_x64(True):
            gap = float(_gap(hand))
        radius = palm * math.exp(rng.uniform(math.log(0.005), math.log(0.15)))
        if rng.random() < 0.25:  # a hair wider than the object
            radius = gap / (2 * (1 + math.exp(rng.uniform(math.log(3e-4), math.log(3e-2)))))
        if not 0.004 * palm < radius < 0.2 * palm:
            continue
        gravity = palm / 500 * math.exp(rng.uniform(math.log(1.0), math.log(1000.0)))
        law = ContactLaw(
            restitution=float(rng.choice([0.0, 0.1, rng.uniform(0, 1), 1.0])),
            resting_speed=0.05 * palm / 500,
        )
        direction = str(rng.choice(["does", "eoen"]))
        try:
            make = does if direction == "does" else eoen
            scenario = make(
                hand, Circle(radius), WristTilt(gravity=gravity), law, float(rng.uniform(0, 0.1))
            )
            gap = check_geometry(scenario)
            choose_engine("event", None, scenario)
        except ValueError:
            continue
        if safe_step(scenario) * FINER < STEPS[-1]:
            continue
        return Case(scenario, shape, direction, gap)


_gap = jax.jit(HandDesign.gap)


def random_cases(count: int, seed: int, pairs: Sequence[tuple[int, int]] = LIMBS) -> list[Case]:
    """Conditions with these numbers of limbs in turn."""
    rng = np.random.default_rng(seed)
    return [random_case(rng, pairs[k % len(pairs)]) for k in range(count)]


@dataclass(frozen=True)
class Verdict:
    """What came of the trials of one condition.

    Attributes:
        index1: by the event-driven engine in 64 bits, steps.
        invalid: trials that went wrong, by any engine.
        stray: the farthest that a trial passed beside the goal line, past its ends, radii.
        z: the largest of the paired differences of index 1 between engines, in standard errors.
        same: share of trials that end in the same step, +-2, in both engines (64 bits).
        growth: the largest growth of energy in a leap, as a share of what there is.
        step_growth: that in a step, which is exact to second order only where limbs end.
    """

    index1: float
    invalid: int
    stray: float
    z: float
    same: float
    growth: float
    step_growth: float

    @property
    def sane(self) -> bool:
        """Whether everything that has to hold does."""
        bounded = self.growth < 1e-9 and self.step_growth < 5e-3
        return self.invalid == 0 and self.stray < STRAY and self.z < 3.5 and bounded


def judge(cases: Sequence[Case], *, trials: int, max_steps: int, seed: int = 0) -> list[Verdict]:
    """Runs conditions of equal structure and compares.

    Arguments:
        cases: with equal numbers of limbs, and the same step.
        trials, max_steps, seed: of each.
    """
    scenarios = [case.scenario for case in cases]
    dt = cases[0].dt
    runs: dict[tuple[str, int], Outcomes] = {
        (engine.name, bits): run(
            scenarios,
            trials=trials,
            max_steps=max_steps,
            seed=seed,
            engine=engine,
            precision=bits,
            keep_final=True,
        )
        for engine in (EventDriven(), Stepping(dt))
        for bits in (64, 32)
    }
    growth = energy_growth(scenarios)
    verdicts = []
    for k, scenario in enumerate(scenarios):
        steps = {key: out.steps[k].astype(float) for key, out in runs.items()}
        wrong = sum(int(np.sum(out.status[k] == INVALID)) for out in runs.values())
        exact = steps["event", 64]
        z = max(paired_z(exact, other) for key, other in steps.items() if key != ("event", 64))
        same = float(np.mean(np.abs(exact - steps["stepping", 64]) <= 2))
        stray = max(farthest_stray(scenario, out, k) for out in runs.values())
        verdicts.append(Verdict(float(exact.mean()), wrong, stray, z, same, *growth[k]))
    return verdicts


def paired_z(a: Float[np.ndarray, " trials"], b: Float[np.ndarray, " trials"]) -> float:
    """How many standard errors the mean of a - b is away from 0."""
    difference = a - b
    spread = float(difference.std(ddof=1)) / math.sqrt(len(difference))
    # What one trial more that parts would add: few that part have no spread to go by. And what no
    # index needs: a ten thousandth.
    spread = math.hypot(spread, float(np.max(np.abs(difference))) / len(difference))
    spread = math.hypot(spread, 1e-4 * float(a.mean()))
    return abs(float(difference.mean())) / spread if spread else 0.0


def farthest_stray(scenario: Scenario, out: Outcomes, row: int) -> float:
    """How far beside the goal line, past its ends, any trial that passed did so, in radii."""
    assert out.final is not None
    passed = out.status[row] == PASSED
    if not passed.any():
        return 0.0
    goal = jax.device_get(scenario.hand.goal())
    a, b = (np.array([end.x, end.y], float) for end in (goal.a, goal.b))
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    to = out.final[row, passed, :2] - a
    share = to @ along
    aside = np.maximum(np.maximum(-share, share - length), 0.0)
    return float(aside.max()) / float(scenario.body.radius)


def energy_growth(
    scenarios: Sequence[Scenario], leaps: int = 200, lanes: int = 8
) -> list[tuple[float, float]]:
    """The largest growth of energy in a leap and in a step with gravity held, each as a share of
    the largest kinetic energy, over some random flights in each hand."""
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        stacked = jax.tree.map(lambda *leaves: jnp.asarray(leaves, float), *scenarios)
        draws = jnp.asarray(rng.random((lanes, 7)))
        leapt, stepped = jax.vmap(lambda s: _growth(s, draws, leaps))(stacked)
        return list(zip(leapt.tolist(), stepped.tolist(), strict=True))


@functools.partial(compiled_quickly, static_argnames="leaps")
def _growth(scenario: Scenario, draws: jax.Array, leaps: int) -> tuple[jax.Array, jax.Array]:
    world, drive = scenario.world(), scenario.drive
    assert isinstance(drive, WristTilt)

    def one(draw: jax.Array) -> tuple[jax.Array, jax.Array]:
        position = scenario.start(draw[:3])
        speed = jnp.sqrt(drive.gravity * scenario.hand.palm_length) * draw[3]
        velocity = Vec(speed * jnp.cos(2 * jnp.pi * draw[4]), speed * jnp.sin(2 * jnp.pi * draw[4]))
        profile: TiltProfile = drive.profile(draw[5:7], draw[5:7], False)
        held = profile.held
        zero = jnp.zeros((), jnp.int32)

        def energy(position: Vec, velocity: Vec) -> jax.Array:
            return jnp.asarray(0.5 * velocity.dot(velocity) - held.dot(position))

        def by_leap(flight: Flight, _: None) -> tuple[Flight, jax.Array]:
            moved = leap(
                world,
                drive.swing(profile, flight.time, EventDriven().drift * world.contact_radius),
                NEVER,
                flight,
            )
            before = energy(flight.position, flight.velocity)
            after = energy(moved.position, moved.velocity)
            return moved, jnp.where(moved.status == RUNNING, after - before, 0.0)

        def by_step(state: State, _: None) -> tuple[State, jax.Array]:
            moved = advance(world, profile, state, dt)
            before = energy(state.position, state.velocity)
            after = energy(moved.position, moved.velocity)
            return moved, jnp.where(moved.status == RUNNING, after - before, 0.0)

        fastest = speed + jnp.sqrt(6.0 * drive.gravity * scenario.hand.palm_length)
        dt = 0.05 * scenario.body.radius / fastest
        flight = Flight(position, velocity, drive.ramp_time + 0.0 * speed, zero, zero)
        clock = jnp.ceil(drive.ramp_time / dt).astype(jnp.int32) + 1
        state = replace(at_rest(position), velocity=velocity, clock=clock)
        _, leapt = jax.lax.scan(by_leap, flight, length=leaps)
        _, stepped = jax.lax.scan(by_step, state, length=20 * leaps)
        scale = 0.5 * speed * speed + 0.01 * drive.gravity * scenario.hand.palm_length
        return jnp.max(leapt) / scale, jnp.max(stepped) / scale

    leapt, stepped = jax.vmap(one)(draws)
    return jnp.max(leapt), jnp.max(stepped)


def grouped(cases: Sequence[Case]) -> Iterator[list[Case]]:
    """The cases of equal structure, with steps of the same size."""
    groups: dict[tuple, list[Case]] = {}
    for case in cases:
        alike = tuple(map(len, case.scenario.hand.lengths))
        groups.setdefault((alike, case.dt), []).append(case)
    yield from groups.values()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hands", type=int, default=300)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--max-steps", type=int, default=30_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rows = []
    for group in grouped(random_cases(arguments.hands, arguments.seed)):
        verdicts = judge(group, trials=arguments.trials, max_steps=arguments.max_steps)
        for case, verdict in zip(group, verdicts, strict=True):
            rows.append(row_of(case, verdict))
        odd = [row for row in rows[-len(group) :] if not row["sane"]]
        print(f"{len(rows)} hands", *odd, sep="\n  ", flush=True)
    with (RESULTS / "fuzz.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    good = sum(bool(row["sane"]) for row in rows)
    print(f"{good} of {len(rows)} hands as they have to be")


def row_of(case: Case, verdict: Verdict) -> dict[str, object]:
    """One line of the table."""
    scenario = case.scenario
    assert isinstance(scenario.drive, WristTilt)
    return {
        "limbs": "-".join(str(len(ls)) for ls in scenario.hand.lengths),
        "shape": case.shape,
        "direction": case.direction,
        "radius_by_palm": f"{scenario.body.radius / scenario.hand.palm_length:.4f}",
        "clearance_by_diameter": f"{case.tightness:.4f}",
        "restitution": f"{scenario.law.restitution:.2f}",
        "gravity_by_palm": f"{scenario.drive.gravity / scenario.hand.palm_length:.4f}",
        "index1": round(verdict.index1),
        "invalid": verdict.invalid,
        "stray": f"{verdict.stray:.1e}",
        "z": f"{verdict.z:.2f}",
        "same_step": f"{verdict.same:.2f}",
        "energy_growth": f"{verdict.growth:.1e}",
        "energy_growth_of_a_step": f"{verdict.step_growth:.1e}",
        "sane": verdict.sane,
    }


if __name__ == "__main__":
    main()
