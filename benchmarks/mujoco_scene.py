"""Baseline: first-passage times of a circle in a tilted planar hand, as a MuJoCo scene.

The circle is a sphere on two slide joints, x and y; each limb is a static capsule so thin that it
acts as a segment. Contacts are frictionless (condim 1) and soft: a contact is a damped spring that
only pushes, set by `solref`. Its time constant is 10 steps; its damping ratio is the one that gives
the restitution asked for. In steps of 0.001 s an impact comes back with 0.083 to 0.103 of its speed
for e_r = 0.1, depending on where in a step it falls (with 5 steps, 0.065 to 0.107), and goes 0.3
lengths deep at 80 lengths per second.

Lengths are in the unit of `limbs`, times in seconds, angles in radians.
"""

import math
import os
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

mujoco: Any = import_module("mujoco")  # a type checker does not see its compiled names
rollout: Any = import_module("mujoco.rollout")

Points = tuple[tuple[float, float], tuple[float, float]]
Floats = NDArray[np.float64]
Advance = Callable[[Floats, Floats], Floats]
"""States (trials, steps, 5) after each step from states (trials, 5) and gravity (trials, steps, 2).
"""

_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS.value  # time, x, y, vx, vy
_FORCE = mujoco.mjtState.mjSTATE_QFRC_APPLIED.value

_CHUNK = 1000
"""Steps between looks at who has passed."""

_SCENE = """
<mujoco>
  <option timestep="{dt}" gravity="0 0 0"/>
  <default>
    <geom condim="1" solref="{time_constant} {damping_ratio}" solimp="0.9999 0.9999 1"/>
  </default>
  <worldbody>
    {limbs}
    <body>
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 1 0"/>
      <geom type="sphere" size="{radius}" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""
_LIMB = '<geom type="capsule" fromto="{} {} 0 {} {} 0" size="1e-3"/>'


def damping_ratio(restitution: float) -> float:
    """The damping ratio at which a damped spring that cannot pull has a restitution in (0, 1).

    The body leaves it when its force vanishes. With a damping ratio of z = cos(a) < 1 that leaves
    it exp(-2 a / tan(a)) of its speed; for z = cosh(a) > 1 the tangent is a hyperbolic one.
    """

    def log_restitution(z: float) -> float:
        if z < 1:
            return -2 * z * math.acos(z) / math.sqrt(1 - z * z)
        return -2 * z * math.acosh(z) / math.sqrt(z * z - 1) if z > 1 else -2.0

    return root_scalar(lambda z: log_restitution(z) - math.log(restitution), bracket=(0, 1e3)).root


def scene(limbs: Floats, radius: float, restitution: float, dt: float) -> Any:
    """A hand of static capsules and a frictionless sphere of mass 1, without gravity."""
    return mujoco.MjModel.from_xml_string(
        _SCENE.format(
            dt=dt,
            time_constant=10 * dt,
            damping_ratio=damping_ratio(restitution),
            limbs="".join(_LIMB.format(*limb) for limb in limbs.tolist()),
            radius=radius,
        )
    )


def rollouts(model: Any) -> Advance:
    """Many trials at once on all cores, by MuJoCo's `rollout`.

    A rollout cannot change the model's gravity, so it acts as a force on the unit mass.
    """
    datas = [mujoco.MjData(model) for _ in range(os.cpu_count() or 1)]
    pool = rollout.Rollout(nthread=len(datas))
    return lambda states, gravity: pool.rollout(model, datas, states, gravity, control_spec=_FORCE)[
        0
    ]


def loop(model: Any) -> Advance:
    """One trial after another on one core, `mj_step` by `mj_step` in Python."""
    data = mujoco.MjData(model)

    def advance(states: Floats, gravity: Floats) -> Floats:
        after = np.empty((*gravity.shape[:2], states.shape[1]))
        for i, state in enumerate(states):
            mujoco.mj_setState(model, data, state, _STATE)
            for j, pull in enumerate(gravity[i]):
                model.opt.gravity[:2] = pull
                mujoco.mj_step(model, data)
                after[i, j, 1:3] = data.qpos
            mujoco.mj_getState(model, data, after[i, -1], _STATE)
        return after

    return advance


def _gravity(targets: Floats, steps: NDArray[np.int64], period: int, ramp: int, g: float) -> Floats:
    """Gravity in the hand frame (1) at the middle of steps: (trials, steps, 2).

    Targets are (trials, periods, 2) wrist angles; period and ramp are counted in steps.
    """
    k, phase = np.divmod(steps, period)
    share = np.minimum((phase + 0.5) / ramp, 1.0)[:, None] if ramp else 1.0
    before = np.where((k == 0)[:, None], 0.0, targets[:, k - 1])
    t1, t2 = np.moveaxis(before + share * (targets[:, k] - before), -1, 0)
    return g * np.stack([np.sin(t1), -np.cos(t1) * np.sin(t2)], axis=-1)


def _passes(paths: Floats, goal: Points) -> NDArray[np.bool_]:
    """For paths (trials, steps + 1, 2), whether each step crosses the goal line outwards."""
    a, b = np.array(sorted(np.asarray(goal).tolist()))  # so that (-ty, tx) points outwards
    length = math.dist(a, b)
    tx, ty = (b - a) / length
    from_a = paths - a
    above, along = from_a @ [-ty, tx], from_a @ [tx, ty]
    crosses = (above[:, :-1] <= 0) & (above[:, 1:] > 0)
    rise = np.where(crosses, np.diff(above), 1.0)
    where = along[:, :-1] - above[:, :-1] / rise * np.diff(along)
    return crosses & (where >= 0) & (where <= length)


def escape_steps(
    limbs: Floats,
    goal: Points,
    radius: float,
    restitution: float,
    resting_speed: float,
    starts: Floats,
    targets: Floats,
    *,
    max_steps: int,
    g: float = 9.8,
    dt: float = 0.001,
    period: float = 10.0,
    ramp: float = 1.0,
    in_python: bool = False,
) -> NDArray[np.int64]:
    """Steps of `dt` until the centre passes the goal line outwards, for every trial.

    The wrist angles start at 0, go linearly to the period's target during `ramp`, then hold.
    Trials that have passed drop out after every 1,000 steps.

    Args:
        limbs: (n, 4) two-sided segments ax, ay, bx, by in the hand frame [length].
        goal: ends A, B of the goal line [length]; outwards is its normal with positive y.
        radius: of the circle [length].
        restitution: e_r of (7), between 0 and 1, without the two.
        resting_speed: unused, there so that the baselines are called alike.
        starts: (trials, 2) centres at rest [length].
        targets: (trials, periods, 2) wrist angles T1, T2 [rad].
        max_steps: limit, in steps of `dt`.
        g: gravity [length/s^2].
        dt: step [s].
        period: time between targets [s].
        ramp: time in which a target is reached [s].
        in_python: whether to call `mj_step` in a Python loop on one core; otherwise MuJoCo's
            `rollout` runs the trials on all of them.

    Returns:
        (trials,) escape steps, counted from 1; max_steps + 1 where the limit was reached.

    Raises:
        ValueError: if `targets` ends before `max_steps`.
    """
    period_steps, ramp_steps = round(period / dt), round(ramp / dt)
    if targets.shape[1] * period_steps < max_steps:
        raise ValueError(f"{targets.shape[1]} periods of {period_steps} steps, need {max_steps}")
    model = scene(limbs, radius, restitution, dt)
    advance = (loop if in_python else rollouts)(model)
    states = np.zeros((len(starts), mujoco.mj_stateSize(model, _STATE)))
    states[:, 1:3] = starts
    found = np.full(len(starts), max_steps + 1)
    running = np.arange(len(starts))
    for first in range(0, max_steps, _CHUNK):
        steps = np.arange(first, min(first + _CHUNK, max_steps))
        gravity = _gravity(targets[running], steps, period_steps, ramp_steps, g)
        after = advance(states[running], gravity)
        paths = np.concatenate([states[running, None, 1:3], after[:, :, 1:3]], axis=1)
        passes = _passes(paths, goal)
        out = passes.any(axis=1)
        found[running[out]] = first + passes[out].argmax(axis=1) + 1
        states[running] = after[:, -1]
        running = running[~out]
        if len(running) == 0:
            break
    return found
