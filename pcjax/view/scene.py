"""Pictures of the arm, the hand and the object in the world, as in Figs. 3 and 16."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.model.bodies.base import placed_outline
from pcjax.model.scenario import Scenario
from pcjax.physics.state import PAPER_DT
from pcjax.simulate.replay import Frames, Recording, record
from pcjax.view.contacts import draw_contacts
from pcjax.view.picture import Picture
from pcjax.view.shapes import COLOURS, draw_limbs, draw_object, name_axes


def plot_scenes(
    scenario: Scenario,
    times: Sequence[float],
    *,
    seed: int = 0,
    trial: int = 0,
    dt: float = 0.01,
    units: str = "model",
) -> Figure:
    """One trial at some of its times, to scale and upright: the base, the links, hand and object.

    A wrist tilts the plane of the picture: there the hand stays put. Where gravity does not point
    down the picture, an arrow says where it does.

    Arguments:
        scenario: the condition.
        times: seconds since the trial began; 0 is its start. After its end all stays as it is.
        seed, trial: as for `pcjax.trajectory`.
        dt: the step, s.
        units: of lengths (see `pcjax.units`), for the labels.
    """
    steps = max(round(max(times) / PAPER_DT), 1)
    recording = record(scenario, seed=seed, trial=trial, max_steps=steps, dt=dt)
    frames = recording.at(np.minimum(np.asarray(times, float), recording.seconds))
    figure = Picture(figsize=(3.4 * len(times), 4.6), layout="constrained")
    axes = figure.subplots(1, len(times), sharex=True, sharey=True, squeeze=False)[0]
    for k, (axis, time) in enumerate(zip(axes, times, strict=True)):
        draw_scene(axis, recording, frames, k)
        _draw_sideways_pull(axis, frames, k, 0.4 * float(scenario.hand.palm_length))
        axis.set_aspect("equal")
        axis.grid(alpha=0.25)
        name_axes(axis, units)
        axis.label_outer()
        axis.set_title(f"{time:g} s", fontsize=10)
    return figure


def draw_scene(axis: Axes, recording: Recording, frames: Frames, k: int) -> None:
    """The arm (if one carries the hand), the hand, its goal line and the object, in the world.

    Arguments:
        recording: the trial.
        frames, k: some of its times, and which of them.
    """
    joints = frames.joints[k]
    if len(joints) > 1:
        axis.plot(*joints.T, color="0.55", lw=4, solid_capstyle="round", zorder=1)
        axis.plot(*joints[:-1].T, "o", color="0.3", ms=6, zorder=2)
    thickness = float(recording.scenario.hand.thickness)
    draw_limbs(axis, frames.in_world(recording.hand, k), thickness, zorder=3)
    axis.plot(*frames.in_world(recording.goal, k).T, color=COLOURS[2], ls="--", lw=1.2, zorder=2)
    centre = frames.in_world(frames.position[k : k + 1], k)[0]
    angle = float(frames.angle[k] + frames.turn[k])
    scenario = recording.scenario
    # A circle without friction keeps its angle: there is nothing to be seen of it.
    marked = scenario.body.oriented or scenario.law.friction is not None
    mark = (centre, angle) if marked else None
    draw_object(axis, *placed_outline(scenario.body, centre, angle), mark=mark)
    draw_contacts(axis, recording, frames, k, slips=marked)


def _draw_sideways_pull(axis: Axes, frames: Frames, k: int, length: float) -> None:
    """An arrow for gravity at the base, unless it points straight down."""
    pull, size = frames.pull[k], np.hypot(*frames.pull[k])
    if (size > 0 and abs(pull[0]) > 1e-6 * size) or pull[1] > 0:
        base = frames.joints[k, 0]
        tip = base + length * pull / size
        axis.annotate("", tip, base, arrowprops={"arrowstyle": "->", "color": "0.3"})
        axis.annotate("g", tip, color="0.3", fontsize=9)
