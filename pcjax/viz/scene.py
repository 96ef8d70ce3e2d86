"""Pictures of the arm, the hand and the object in the world, as in Figs. 3 and 16."""

from __future__ import annotations

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle as Disc

from pcjax.engines.draws import period_draws, start_draws, trial_key
from pcjax.engines.stepping import Stepping, trajectory
from pcjax.model.arm import Gesture, PlanarArm
from pcjax.model.body import Stick
from pcjax.model.scenario import Scenario
from pcjax.physics.step import State, begin
from pcjax.viz.plots import COLOURS


def plot_scenes(
    scenario: Scenario, times: Sequence[float], *, seed: int = 0, trial: int = 0, dt: float = 0.01
) -> Figure:
    """One trial at some of its times, to scale and upright: the base, the links, hand and object.

    Arguments:
        scenario: with a planar arm.
        times: seconds since the trial began; 0 is its start.
        seed, trial: as for `pcjax.trajectory`.
        dt: the step, s.

    Raises:
        ValueError: a scenario without an arm.
    """
    drive = scenario.drive
    if not isinstance(drive, PlanarArm):
        raise ValueError("the scenario has no planar arm to be drawn")
    periods = int(max(times) // drive.period) + 1
    path = jax.device_get(
        jax.jit(lambda: trajectory(scenario, seed=seed, trial=trial, periods=periods, dt=dt))()
    )
    key = trial_key(seed, trial)
    first = jax.device_get(begin(scenario, start_draws(key, scenario.draws_for_start)))
    step = Stepping(dt).step_taken(drive.period)
    figure = Figure(figsize=(3.4 * len(times), 4.6), layout="constrained")
    axes = figure.subplots(1, len(times), sharex=True, sharey=True, squeeze=False)[0]
    for axis, time in zip(axes, times, strict=True):
        k = round(time / step)
        state = first if k == 0 else jax.tree.map(lambda leaf, k=k: leaf[k - 1], path)
        period = max(k - 1, 0) * step // drive.period
        draws = [period_draws(key, int(max(p, 0)), 3) for p in (period - 1, period)]
        swing = drive.swing(draws[0], draws[1], period == 0)
        draw_scene(axis, scenario, swing, time - period * drive.period, state)
        axis.set_title(f"{time:g} s", fontsize=10)
    axes[0].set_ylabel("y [model length]")
    return figure


def draw_scene(axis: Axes, scenario: Scenario, swing: Gesture, time: float, state: State) -> None:
    """The arm, the hand and the object at one time of a period, in the world.

    Where gravity does not point down the picture, an arrow at the base says where it does.
    """
    assert isinstance(scenario.drive, PlanarArm)
    joints, angle = jax.device_get(scenario.drive.pose(swing, jnp.asarray(time)))
    base = np.array([[joint.x, joint.y] for joint in joints], float)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def world(x: float, y: float) -> np.ndarray:
        return base[-1] + turn @ np.array([x, y], float)

    axis.plot(*base.T, color="0.55", lw=4, solid_capstyle="round", zorder=1)
    axis.plot(*base[:-1].T, "o", color="0.3", ms=6, zorder=2)
    pull = float(scenario.drive.gravity_direction)
    if abs(math.remainder(pull + math.pi / 2, 2 * math.pi)) > 1e-6:
        length = 0.4 * float(scenario.hand.palm_length)
        tip = (length * math.cos(pull), length * math.sin(pull))
        axis.annotate("", tip, (0.0, 0.0), arrowprops={"arrowstyle": "->", "color": "0.3"})
        axis.annotate("g", tip, color="0.3", fontsize=9)
    for limb in jax.device_get(scenario.hand.limbs()):
        ends = np.array([world(limb.start.x, limb.start.y), world(limb.end.x, limb.end.y)])
        axis.plot(*ends.T, color="black", lw=2, solid_capstyle="round", zorder=3)
    goal = jax.device_get(scenario.hand.goal())
    line = np.array([world(goal.a.x, goal.a.y), world(goal.b.x, goal.b.y)])
    axis.plot(*line.T, color=COLOURS[2], ls="--", lw=1.2, zorder=2)
    centre = world(float(state.position.x), float(state.position.y))
    radius = float(scenario.body.radius)
    if isinstance(scenario.body, Stick):
        assert state.angle is not None
        along = turn @ np.array([np.cos(state.angle), np.sin(state.angle)]) * radius
        ends = np.array([centre - along, centre + along])
        axis.plot(*ends.T, color=COLOURS[1], lw=3, solid_capstyle="round", zorder=4)
    else:
        axis.add_patch(Disc((centre[0], centre[1]), radius, color=COLOURS[0], alpha=0.7, zorder=4))
    axis.set_aspect("equal")
    axis.grid(alpha=0.25)
    axis.set_xlabel("x [model length]")
