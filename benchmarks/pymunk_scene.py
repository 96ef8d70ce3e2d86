"""Baseline: first-passage times of an object in a tilted planar hand, as a pymunk scene.

Lengths are in the unit of `limbs`, times in seconds, angles in radians.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pymunk
from numpy.typing import NDArray

Points = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Solid:
    """A rounded convex polygon of mass 1, seen from its centre of mass, or a circle.

    Attributes:
        vertices: (n, 2), counterclockwise; a single one is a circle's centre [length].
        rounding: the radius of its corners, or of the circle [length].
        inertia: about its centre; infinite where nothing turns [length^2].
        angle: at the start [rad].
        friction: mu.
        restitution: e_r of (7).
    """

    vertices: NDArray[np.float64]
    rounding: float
    inertia: float = math.inf
    angle: float = 0.0
    friction: float = 0.0
    restitution: float = 0.0


class Scene(Protocol):
    """A hand that stays put, and a solid at rest in it, as an engine has them."""

    def step(self, gravity: tuple[float, float], dt: float) -> tuple[float, float]:
        """Goes on by `dt` seconds; where the centre is then."""
        ...


class PymunkScene:
    """Static segments without thickness, and a body."""

    def __init__(self, limbs: NDArray[np.float64], solid: Solid, start: Sequence[float]):
        self.space = space = pymunk.Space()
        space.collision_slop = 1e-3  # keeps resting contacts alive; lengths are in hundreds
        space.collision_bias = 0.0  # what overlaps is pushed out within the step
        for ax, ay, bx, by in limbs.tolist():
            limb = pymunk.Segment(space.static_body, (ax, ay), (bx, by), 0.0)
            limb.elasticity, limb.friction = 1.0, 1.0
            space.add(limb)
        self.body = body = pymunk.Body(mass=1.0, moment=solid.inertia)
        corners = [(x, y) for x, y in solid.vertices.tolist()]
        if len(corners) == 1:
            shape: pymunk.Shape = pymunk.Circle(body, solid.rounding)
        elif len(corners) == 2:
            shape = pymunk.Segment(body, corners[0], corners[1], solid.rounding)
        else:
            shape = pymunk.Poly(body, corners, radius=solid.rounding)
        # A pair's elasticity is the product, and so is its friction.
        shape.elasticity, shape.friction = solid.restitution, solid.friction
        space.add(body, shape)
        body.position, body.angle = (start[0], start[1]), solid.angle

    def step(self, gravity: tuple[float, float], dt: float) -> tuple[float, float]:
        """Goes on by `dt` seconds; where the centre is then."""
        self.space.gravity = gravity
        self.space.step(dt)
        return self.body.position


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
    solid: Solid | None = None,
    scene: Callable[[NDArray[np.float64], Solid, Sequence[float]], Scene] = PymunkScene,
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
        solid: the object, if it is not a frictionless circle of the radius.
        scene: makes an engine's scene of limbs, solid and start.

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

    what = solid or Solid(np.zeros((1, 2)), radius, restitution=restitution)

    def escape_step(start: list[float], wrist: list[list[float]]) -> int:
        engine = scene(limbs, what, start)
        x, y = start
        above = (y - ay) * tx - (x - ax) * ty
        angles, gravity = [0.0, 0.0], (0.0, 0.0)
        for step in range(max_steps):
            k, phase = divmod(step, period_steps)
            if phase <= ramp_steps:  # at the middle of the step; constant during the hold
                share = min((phase + 0.5) / ramp_steps, 1.0) if ramp_steps else 1.0
                before = wrist[k - 1] if k else angles
                now = [a + share * (b - a) for a, b in zip(before, wrist[k], strict=True)]
                gravity = _gravity(now[0], now[1], g)
            x0, y0, below = x, y, above
            x, y = engine.step(gravity, dt)
            above = (y - ay) * tx - (x - ax) * ty
            if below <= 0.0 < above:
                cross = below / (below - above)
                along = (x0 + cross * (x - x0) - ax) * tx + (y0 + cross * (y - y0) - ay) * ty
                if 0.0 <= along <= length:
                    return step + 1
        return max_steps + 1

    pairs = zip(starts.tolist(), targets.tolist(), strict=True)
    return np.array([escape_step(start, wrist) for start, wrist in pairs], dtype=np.int64)
