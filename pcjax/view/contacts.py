"""Where an object touches the hand in a recorded trial, and how fast it slips there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

from pcjax.model.bodies.base import placed_outline
from pcjax.simulate.replay import Frames, Recording
from pcjax.view.shapes import COLOURS

TOUCHING = 2e-3
"""The widest gap that counts as a contact, in the object's radii."""

SHOWN_FOR = 0.5
"""Seconds of slip that a line shows."""


def contacts_at(
    recording: Recording, time: float
) -> tuple[Float[np.ndarray, "contacts 2"], Float[np.ndarray, "contacts 2"]]:
    """Points of contact on the limbs' surfaces in the hand frame, and the velocity against the hand
    of what of the object is there, along the limb.

    Arguments:
        recording: of an object with an angle.
        time: seconds since the trial began.
    """
    scenario = recording.scenario
    reach, half = float(scenario.body.radius), 0.5 * float(scenario.hand.thickness)
    around = np.clip(time + 0.5 * recording.dt * np.array([-1, 0, 1]), 0.0, recording.seconds)
    places = recording.path(around)
    angles = np.interp(around, recording.times, recording.angle)
    took = max(around[2] - around[0], 1e-12)
    velocity, spin = (places[2] - places[0]) / took, (angles[2] - angles[0]) / took
    corners, rounding = placed_outline(scenario.body, places[1], float(angles[1]))
    points, normals = [], []
    for point, normal, gap in _nearest(recording.hand, corners):
        if gap - rounding - half < TOUCHING * reach:
            points.append(point + half * normal)
            normals.append(normal)
    where, normal = np.array(points).reshape(-1, 2), np.array(normals).reshape(-1, 2)
    _, first = np.unique(where.round(6), axis=0, return_index=True)  # two limbs share a joint
    where, normal = where[first], normal[first]
    arm = where - places[1]
    moves = velocity + spin * np.stack([-arm[:, 1], arm[:, 0]], axis=-1)
    return where, moves - normal * (moves * normal).sum(axis=-1, keepdims=True)


def _nearest(
    hand: Float[np.ndarray, "points 2"], corners: Float[np.ndarray, "corners 2"]
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """The point of the hand's middle line nearest to each corner on each limb, and each of its
    points that has an edge's inner part nearest; the direction to the object; and how far that is.
    """
    found = []

    def add(on_hand: np.ndarray, on_object: np.ndarray) -> None:
        way = on_object - on_hand
        gap = float(np.hypot(*way))
        if gap > 0:
            found.append((on_hand, way / gap, gap))

    for a, b in pairwise(hand):
        for corner in corners:
            share = np.clip((corner - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            add(a + share * (b - a), corner)
    if len(corners) > 1:
        for point in hand:
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                share = (point - a) @ (b - a) / ((b - a) @ (b - a))
                if 0.0 < share < 1.0:
                    add(point, a + share * (b - a))
    return found


def draw_contacts(axis: Axes, recording: Recording, frames: Frames, k: int) -> None:
    """A dot at each contact, and where the object slips a line that way.

    Arguments:
        axis: in the world.
        recording: the trial, of an object with an angle.
        frames, k: some of its times, and which of them.
    """
    where, slip = contacts_at(recording, float(frames.times[k]))
    reach = float(recording.scenario.body.radius)
    length = np.hypot(*slip.T)[:, None]
    ahead = slip * SHOWN_FOR * np.minimum(1.0, reach / np.maximum(SHOWN_FOR * length, 1e-12))
    for start, end in zip(
        frames.in_world(where, k), frames.in_world(where + ahead, k), strict=True
    ):
        axis.plot(*np.stack([start, end]).T, color=COLOURS[0], lw=2.5, zorder=5)
        axis.plot(*start, "o", color=COLOURS[0], ms=4.5, mec="white", mew=0.6, zorder=5.1)
