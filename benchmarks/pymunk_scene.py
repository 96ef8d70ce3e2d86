"""Baseline: first-passage times of a circle in a tilted planar hand, as a pymunk scene.

Lengths are in the unit of `limbs`, times in seconds, angles in radians.
"""

import math

import numpy as np
import pymunk
from numpy.typing import NDArray

Points = tuple[tuple[float, float], tuple[float, float]]


def _scene(
    limbs: NDArray[np.float64], radius: float, restitution: float
) -> tuple[pymunk.Space, pymunk.Body]:
    """A hand of static segments without thickness, and a frictionless circle at the origin."""
    space = pymunk.Space()
    space.collision_slop = 1e-3  # keeps resting contacts alive; lengths are in hundreds
    space.collision_bias = 0.0  # what overlaps is pushed out within the step
    for ax, ay, bx, by in limbs.tolist():
        limb = pymunk.Segment(space.static_body, (ax, ay), (bx, by), 0.0)
        limb.elasticity, limb.friction = 1.0, 0.0
        space.add(limb)
    body = pymunk.Body(mass=1.0, moment=math.inf)  # no friction: it never turns
    circle = pymunk.Circle(body, radius)
    circle.elasticity, circle.friction = restitution, 0.0  # a pair's elasticity is the product
    space.add(body, circle)
    return space, body


def _gravity(angle1: float, angle2: float, g: float) -> tuple[float, float]:
    """Gravity in the hand frame (1)."""
    return g * math.sin(angle1), -g * math.cos(angle1) * math.sin(angle2)


def escape_steps(
    limbs: NDArray[np.float64],
    goal: Points,
    radius: float,
    restitution: float,
    resting_speed: float,
    starts: NDArray[np.float64],
    targets: NDArray[np.float64],
    *,
    max_steps: int,
    g: float = 9.8,
    dt: float = 0.005,
    period: float = 10.0,
    ramp: float = 1.0,
) -> NDArray[np.int64]:
    """Steps of `dt` until the centre passes the goal line outwards, for every trial.

    The wrist angles start at 0, go linearly to the period's target during `ramp`, then hold.
    pymunk integrates positions with the velocity at the start of the step, a first-order scheme:
    free flight under constant gravity lags by `g dt / 2` times its duration, 0.25 lengths in 10 s
    at the default `dt`. That is small against the limbs, and a finer step costs in proportion.

    Args:
        limbs: (n, 4) two-sided segments ax, ay, bx, by in the hand frame [length].
        goal: ends A, B of the goal line [length]; outwards is its normal with positive y.
        radius: of the circle [length].
        restitution: e_r of (7).
        resting_speed: unused, there so that the baselines are called alike. pymunk takes the
            bounce from the approach speed before gravity acts, so resting contacts do not bounce.
        starts: (trials, 2) centres at rest [length].
        targets: (trials, periods, 2) wrist angles T1, T2 [rad].
        max_steps: limit, in steps of `dt`.
        g: gravity [length/s^2].
        dt: step [s].
        period: time between targets [s].
        ramp: time in which a target is reached [s].

    Returns:
        (trials,) escape steps, counted from 1; max_steps + 1 where the limit was reached.

    Raises:
        ValueError: if `targets` ends before `max_steps`.
    """
    period_steps = round(period / dt)
    ramp_steps = round(ramp / dt)
    if targets.shape[1] * period_steps < max_steps:
        raise ValueError(f"{targets.shape[1]} periods of {period_steps} steps, need {max_steps}")
    (ax, ay), (bx, by) = sorted(np.asarray(goal).tolist())  # so that (-ty, tx) points outwards
    length = math.hypot(bx - ax, by - ay)
    tx, ty = (bx - ax) / length, (by - ay) / length

    def escape_step(start: list[float], wrist: list[list[float]]) -> int:
        space, body = _scene(limbs, radius, restitution)
        body.position = start[0], start[1]
        x, y = start
        above = (y - ay) * tx - (x - ax) * ty
        angles = [0.0, 0.0]
        for step in range(max_steps):
            k, phase = divmod(step, period_steps)
            if phase <= ramp_steps:  # at the middle of the step; constant during the hold
                share = min((phase + 0.5) / ramp_steps, 1.0) if ramp_steps else 1.0
                before = wrist[k - 1] if k else angles
                now = [a + share * (b - a) for a, b in zip(before, wrist[k], strict=True)]
                space.gravity = _gravity(now[0], now[1], g)
            space.step(dt)
            x0, y0, below = x, y, above
            x, y = body.position
            above = (y - ay) * tx - (x - ax) * ty
            if below <= 0.0 < above:
                cross = below / (below - above)
                along = (x0 + cross * (x - x0) - ax) * tx + (y0 + cross * (y - y0) - ay) * ty
                if 0.0 <= along <= length:
                    return step + 1
        return max_steps + 1

    pairs = zip(starts.tolist(), targets.tolist(), strict=True)
    return np.array([escape_step(start, wrist) for start, wrist in pairs], dtype=np.int64)
