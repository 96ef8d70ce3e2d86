"""Baseline: first-passage times of a circle in a tilted planar hand, one scalar loop per trial.

Compiled with Numba and parallel over the trials on all cores. Lengths are in the unit of `limbs`,
times in seconds, angles in radians. Equation numbers are those of the paper.
"""

import cmath
import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Points = tuple[tuple[float, float], tuple[float, float]]
Floats = NDArray[np.floating]

_jit = numba.njit(fastmath=False, error_model="numpy")


class _Scene(NamedTuple):
    """The numbers, of the working precision unless said otherwise.

    Arrays stay out of it: counting their references would cost calls inside the loop.
    """

    radius: Any
    restitution: Any
    resting_speed: Any
    dt: Any
    half_dt2: Any  # dt^2 / 2
    reach2: Any  # squared travel after which the limbs nearby are listed again
    zero: Any  # literals would promote float32 to float64
    real: type  # working precision
    g: float  # float64, as is all of the wrist
    period_steps: int
    ramp_steps: int
    max_steps: int
    time_of_impact: bool


@_jit
def _contact(
    x: float, y: float, limbs: Floats, i: int, radius: float, zero: float
) -> tuple[float, float, float]:
    """Penetration (<= 0: no contact) into limb i and the normal from it towards the centre."""
    dx, dy, tx, ty, length = x - limbs[i, 0], y - limbs[i, 1], limbs[i, 2], limbs[i, 3], limbs[i, 4]
    along = dx * tx + dy * ty
    if zero <= along <= length:
        height = dy * tx - dx * ty
        if height < zero:
            return radius + height, ty, -tx
        return radius - height, -ty, tx
    if along > zero:
        dx, dy = dx - length * tx, dy - length * ty
    d2 = dx * dx + dy * dy
    if d2 >= radius * radius:
        return zero, zero, zero
    d = math.sqrt(d2)
    return radius - d, dx / d, dy / d  # (6)


@_jit
def _nearby(x: float, y: float, limbs: Floats, near: Floats, reach: float, zero: float) -> int:
    """Copy to `near` the limbs that the circle could touch within `reach - radius` of travel."""
    count = 0
    for i in range(limbs.shape[0]):
        if _contact(x, y, limbs, i, reach, zero)[0] > zero:
            near[count] = limbs[i]
            count += 1
    return count


@_jit
def _response(
    vx: float,
    vy: float,
    ax: float,
    ay: float,
    pen: float,
    nx: float,
    ny: float,
    scene: _Scene,
) -> tuple[float, float]:
    """Displacement and velocity change, both along the normal, that one contact asks for.

    With the time of impact tau (counted back from the end of the step), the free flight is
    rewound by tau, the impulse (7) applied there, and the flight resumed for tau: that moves the
    end of the step by impulse * tau. A body still inside is put back to touching.
    """
    zero = scene.zero
    inward, tau = -(vx * nx + vy * ny), zero
    impact = inward
    if scene.time_of_impact:
        acceleration = -(ax * nx + ay * ny)
        square = inward * inward - (pen + pen) * acceleration
        reach = abs(inward) + (math.sqrt(square) if square > zero else zero)
        tau = (pen + pen) / reach if pen + pen < reach * scene.dt else scene.dt
        impact = inward - acceleration * tau
    impulse = zero
    if impact > zero:  # (3)
        impulse = impact
        if impact >= scene.resting_speed:
            impulse += scene.restitution * impact  # (7)
    return max(pen, impulse * tau), max(impulse, inward)


@_jit
def _gravity(wrist1: complex, wrist2: complex, g: float) -> tuple[float, float]:
    """Gravity in the hand frame (1); the wrist angles come as exp(1j T1), exp(1j T2)."""
    return g * wrist1.imag, -g * wrist1.real * wrist2.imag


@_jit
def _ramp(
    wrist1: complex, wrist2: complex, half1: complex, half2: complex, g: float
) -> tuple[complex, complex, float, float, float, float]:
    """One step of the ramp, as two half-step rotations.

    Returns the wrist after it and the mean accelerations, x and y, that Runge-Kutta 4 uses for
    the velocity and for the position: (g0 + 4 gh + g1) / 6 and (g0 + 2 gh) / 3.
    """
    g0x, g0y = _gravity(wrist1, wrist2, g)
    wrist1, wrist2 = wrist1 * half1, wrist2 * half2
    ghx, ghy = _gravity(wrist1, wrist2, g)
    wrist1, wrist2 = wrist1 * half1, wrist2 * half2
    g1x, g1y = _gravity(wrist1, wrist2, g)
    ax, ay = (g0x + 4 * ghx + g1x) * (1 / 6), (g0y + 4 * ghy + g1y) * (1 / 6)
    bx, by = (g0x + 2 * ghx) * (1 / 3), (g0y + 2 * ghy) * (1 / 3)
    return wrist1, wrist2, ax, ay, bx, by


@_jit
def _escape_step(
    x: float, y: float, targets: NDArray[np.float64], limbs: Floats, line: Floats, scene: _Scene
) -> int:
    """Step in which one trial passes the goal line, or max_steps + 1."""
    zero, dt, real = scene.zero, scene.dt, scene.real
    near = np.empty_like(limbs)
    reach = scene.radius + scene.radius
    count, anchor_x, anchor_y = _nearby(x, y, limbs, near, reach, zero), x, y
    vx = vy = ax = ay = bx = by = zero
    above = (y - line[1]) * line[2] - (x - line[0]) * line[3]
    step = 0
    angle1 = angle2 = 0.0
    half_step = 0.5j / max(scene.ramp_steps, 1)
    for k in range(targets.shape[0]):
        # The ramp is a uniform rotation: products of complex numbers replace trigonometry.
        wrist1, wrist2 = cmath.exp(1j * angle1), cmath.exp(1j * angle2)
        half1 = cmath.exp(half_step * (targets[k, 0] - angle1))
        half2 = cmath.exp(half_step * (targets[k, 1] - angle2))
        angle1, angle2 = targets[k, 0], targets[k, 1]
        for phase in range(scene.period_steps):
            if step == scene.max_steps:
                return step + 1
            step += 1

            # (2), with the mean acceleration ax, ay for the velocity, bx, by for the position
            if phase < scene.ramp_steps:
                wrist1, wrist2, gx, gy, hx, hy = _ramp(wrist1, wrist2, half1, half2, scene.g)
                ax, ay, bx, by = real(gx), real(gy), real(hx), real(hy)
            elif phase == scene.ramp_steps:
                gx, gy = _gravity(cmath.exp(1j * angle1), cmath.exp(1j * angle2), scene.g)
                ax = bx = real(gx)
                ay = by = real(gy)
            x0, y0 = x, y
            x += dt * vx + scene.half_dt2 * bx
            y += dt * vy + scene.half_dt2 * by
            vx += dt * ax
            vy += dt * ay

            moved_x, moved_y = x - anchor_x, y - anchor_y
            if moved_x * moved_x + moved_y * moved_y > scene.reach2:
                count, anchor_x, anchor_y = _nearby(x, y, limbs, near, reach, zero), x, y

            last = -1
            for _ in range(min(count, 2)):  # twice, so that corners hold
                hit, pen, nx, ny = -1, zero, zero, zero
                for j in range(count):
                    depth, mx, my = _contact(x, y, near, j, scene.radius, zero)
                    if depth > pen and j != last:
                        hit, pen, nx, ny = j, depth, mx, my
                if hit < 0:
                    break
                last = hit
                shift, kick = _response(vx, vy, ax, ay, pen, nx, ny, scene)
                x, y = x + shift * nx, y + shift * ny
                vx, vy = vx + kick * nx, vy + kick * ny

            below = above
            above = (y - line[1]) * line[2] - (x - line[0]) * line[3]
            if below <= zero < above:
                share = below / (below - above)
                cross_x, cross_y = x0 + share * (x - x0), y0 + share * (y - y0)
                along = (cross_x - line[0]) * line[2] + (cross_y - line[1]) * line[3]
                if zero <= along <= line[4]:
                    return step
    return scene.max_steps + 1


@numba.njit(parallel=True, fastmath=False, error_model="numpy")
def _escape_steps(
    starts: Floats, targets: NDArray[np.float64], limbs: Floats, line: Floats, scene: _Scene
) -> NDArray[np.int64]:
    """`_escape_step` of every trial."""
    steps = np.empty(starts.shape[0], np.int64)
    for i in numba.prange(starts.shape[0]):
        steps[i] = _escape_step(starts[i, 0], starts[i, 1], targets[i], limbs, line, scene)
    return steps


def _segments(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Segments ax, ay, bx, by as ax, ay, unit tangent x, y, length."""
    along = ends[:, 2:] - ends[:, :2]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return np.hstack([ends[:, :2], along / length, length])


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
    dt: float = 0.001,
    period: float = 10.0,
    ramp: float = 1.0,
    time_of_impact: bool = False,
    dtype: type[np.float32] | type[np.float64] = np.float64,
) -> NDArray[np.int64]:
    """Steps of `dt` until the centre passes the goal line outwards, for every trial.

    The wrist angles start at 0, go linearly to the period's target during `ramp`, then hold.
    The first call with a given `dtype` compiles (some seconds).

    Args:
        limbs: (n, 4) two-sided segments ax, ay, bx, by in the hand frame [length].
        goal: ends A, B of the goal line [length]; outwards is its normal with positive y.
        radius: of the circle [length].
        restitution: e_r of (7).
        resting_speed: an impact slower than this is inelastic [length/s].
        starts: (trials, 2) centres at rest [length].
        targets: (trials, periods, 2) wrist angles T1, T2 [rad].
        max_steps: limit, in steps of `dt`.
        g: gravity [length/s^2].
        dt: step [s].
        period: time between targets [s].
        ramp: time in which a target is reached [s].
        time_of_impact: resolve an impact at its time within the step, not at the step's end.
        dtype: working precision; the wrist is always in double precision.

    Returns:
        (trials,) escape steps, counted from 1; max_steps + 1 where the limit was reached.

    Raises:
        ValueError: if `targets` ends before `max_steps`.
    """
    period_steps = round(period / dt)
    if targets.shape[1] * period_steps < max_steps:
        raise ValueError(f"{targets.shape[1]} periods of {period_steps} steps, need {max_steps}")
    line = np.reshape(sorted(np.asarray(goal).tolist()), (1, 4))  # now (-ty, tx) points outwards
    scene = _Scene(
        radius=dtype(radius),
        restitution=dtype(restitution),
        resting_speed=dtype(resting_speed),
        dt=dtype(dt),
        half_dt2=dtype(dt * dt / 2),
        reach2=dtype((0.9 * radius) ** 2),
        zero=dtype(0),
        real=dtype,
        g=float(g),
        period_steps=period_steps,
        ramp_steps=round(ramp / dt),
        max_steps=max_steps,
        time_of_impact=time_of_impact,
    )
    tables = _segments(limbs).astype(dtype), _segments(line)[0].astype(dtype)
    return _escape_steps(starts.astype(dtype), targets, *tables, scene)
