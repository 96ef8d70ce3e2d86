"""A scenario's hand, laws and draws as the arrays that `polygon.run` takes: the same trials."""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np

from pcjax.model.drives.arm import PlanarArm
from pcjax.model.scenario import Scenario
from pcjax.simulate.draws import period_draws, start_draws, trial_key
from tests.reference import polygon


def escape_times(
    scenario: Scenario, trials: int, seconds: float, dt: float = 0.001, seed: int = 0
) -> np.ndarray:
    """When each trial escapes, s; `seconds` if it does not, nan where it went wrong.

    The object is convex and starts at its `orientation`, if it has one; the drive is the wrist or the arm.
    """
    body: Any = scenario.body
    drive: Any = scenario.drive
    law, world = scenario.law, scenario.world()
    arm = isinstance(drive, PlanarArm)
    periods = math.ceil(seconds / drive.period)
    count = drive.targets_per_period

    def draw(trial: Any) -> Any:
        key = trial_key(seed, trial)
        start = scenario.start(start_draws(key, 3))
        return start.x, start.y, jax.vmap(lambda k: period_draws(key, k, count))(np.arange(periods))

    drawn = jax.jit(jax.vmap(draw))(np.arange(trials))
    x, y, draws = (np.asarray(part, float) for part in drawn)
    orientation = float(getattr(body, "orientation", 0.0))
    starts = np.stack([x, y, np.full(trials, orientation)], 1)
    if arm:
        low, high, first = (np.array(joints) for joints in (drive.low, drive.high, drive.rest))
        links = np.array([drive.mount_angle, *drive.lengths[:2]], float)
    else:
        low, high, first = -drive.amplitude * np.ones(2), drive.amplitude * np.ones(2), np.zeros(2)
        links = np.zeros(3)
    targets = low + (high - low) * draws
    limbs = np.array(
        [
            [float(value) for value in (s.start.x, s.start.y, s.tangent.x, s.tangent.y, s.length)]
            for s in scenario.hand.limbs()
        ]
    )
    goal = world.goal
    times, _ = polygon.run(
        limbs,
        np.vstack([limbs[:1, :2], limbs[:, :2] + limbs[:, 2:4] * limbs[:, 4:]]),
        np.array([float(value) for value in (goal.a.x, goal.a.y, goal.b.x, goal.b.y)]),
        np.array([[float(vertex.x), float(vertex.y)] for vertex in body.vertices]),
        float(body.skin),
        float(world.half_thickness),
        1 / float(body.per_gyration) if body.turns else 1.0,
        bool(body.turns),
        0.0 if law.friction is None else float(law.friction),
        float(law.restitution),
        float(law.resting_speed),
        links,
        float(drive.gravity),
        starts,
        np.concatenate([np.broadcast_to(first, (trials, 1, count)), targets], 1),
        float(drive.ramp_time),
        float(drive.period),
        dt,
        seconds,
    )
    return times
