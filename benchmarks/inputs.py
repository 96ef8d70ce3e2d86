"""A scenario and its random draws as the plain arrays that the baselines take."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from benchmarks.pymunk_scene import Solid
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.scenario import Scenario
from pcjax.simulate.draws import period_draws, start_draws, trial_key


def as_arrays(scenario: Scenario, *, trials: int, max_steps: int, seed: int = 0) -> dict[str, Any]:
    """Keyword arguments for `numba_loop.escape_steps` and `pymunk_scene.escape_steps`.

    They describe the same hand and the same trials 0 ... trials - 1 as `pcjax.evaluate`: limbs
    (n, 4), goal line, radius, contact law, starts (trials, 2) and tilt targets
    (trials, periods, 2) in radians.
    """
    drive = scenario.drive
    assert isinstance(drive, WristTilt)
    periods = int(np.ceil(max_steps * 0.001 / drive.period))
    with jax.enable_x64(True):
        world = jax.device_get(scenario.world())

        def draw(trial: Any) -> tuple[Any, Any, Any]:
            key = trial_key(seed, trial)
            start = scenario.start(start_draws(key, scenario.draws_for_start))
            targets = jax.vmap(lambda k: period_draws(key, k, 2))(np.arange(periods))
            return start.x, start.y, (2 * targets - 1) * drive.amplitude

        x, y, targets = jax.device_get(jax.vmap(draw)(np.arange(trials)))
    limbs = [[limb.start.x, limb.start.y, limb.end.x, limb.end.y] for limb in world.limbs]
    goal = world.goal
    return {
        "limbs": np.array(limbs, float),
        "goal": ((float(goal.a.x), float(goal.a.y)), (float(goal.b.x), float(goal.b.y))),
        "radius": float(scenario.body.radius),
        "restitution": float(scenario.law.restitution),
        "resting_speed": float(scenario.law.resting_speed),
        "starts": np.stack([x, y], axis=1),
        "targets": targets,
        "g": float(drive.gravity),
        "period": drive.period,
        "ramp": drive.ramp_time,
    }


def solid_of(scenario: Scenario) -> Solid:
    """A convex object for `pymunk_scene.escape_steps`; a circle turns where there is friction."""
    body: Any = scenario.body
    friction = scenario.law.friction
    inertia = 1 / float(body.per_gyration) ** 2 if body.turns else np.inf
    return Solid(
        np.array([[float(vertex.x), float(vertex.y)] for vertex in body.vertices]),
        float(body.skin),
        inertia,
        float(getattr(body, "orientation", None) or 0.0),
        0.0 if friction is None else float(friction),
        float(scenario.law.restitution),
    )
