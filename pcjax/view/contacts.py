"""Where an object touches the hand in a recorded trial, and how fast it slips there."""

from __future__ import annotations

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

_SAME = 0.1
"""Places of contact nearer to each other than that are one, in the object's radii."""

_NEAR = 0.05
"""How near an object comes to what it is said to have bounced off, in its radii."""


def contacts_at(
    recording: Recording, time: float
) -> tuple[Float[np.ndarray, "contacts 2"], Float[np.ndarray, "contacts 2"]]:
    """Points of contact on the limbs' surfaces in the hand frame, and the velocity against the hand
    of what of the object is there, along the limb.

    Arguments:
        recording: the trial.
        time: seconds since the trial began.
    """
    reach = float(recording.scenario.body.radius)
    around = np.clip(time + 0.5 * recording.dt * np.array([-1, 0, 1]), 0.0, recording.seconds)
    places = recording.path(around)
    angles = np.interp(around, recording.times, recording.angle)
    took = max(around[2] - around[0], 1e-12)
    velocity, spin = (places[2] - places[0]) / took, (angles[2] - angles[0]) / took
    points, normals, gaps = _nearest(recording, places[1:2], angles[1:2])
    touching = gaps[0] < TOUCHING * reach
    where, normal = points[0][touching], normals[0][touching]
    _, first = np.unique(where.round(6), axis=0, return_index=True)  # two limbs share a joint
    where, normal = where[first], normal[first]
    arm = where - places[1]
    moves = velocity + spin * np.stack([-arm[:, 1], arm[:, 0]], axis=-1)
    return where, moves - normal * (moves * normal).sum(axis=-1, keepdims=True)


def touches(
    recording: Recording, begin: float = 0.0
) -> tuple[Float[np.ndarray, " touches"], Float[np.ndarray, "touches 2"]]:
    """Where on the limbs' surfaces an object has touched the hand, in the hand frame, each place
    once, and when it first did, in order.

    Between two states that are kept it has touched if it was about to and went back.

    Arguments:
        recording: the trial.
        begin: seconds since the trial began, from which on.
    """
    kept = (recording.times >= begin) & (recording.times <= recording.seconds)
    times, reach = recording.times[kept], float(recording.scenario.body.radius)
    places, angles = recording.position[kept], recording.angle[kept]
    points, _, gaps = _nearest(recording, places, angles)
    states, pairs = np.nonzero(gaps < TOUCHING * reach)
    when, where = [times[states]], [points[states, pairs]]
    step = np.diff(gaps, axis=0)
    about_to = (step[:-1] < 0) & (gaps[1:-1] + step[:-1] < 0) & (gaps[1:-1] >= TOUCHING * reach)
    before, pairs = np.nonzero(about_to)
    if len(before):
        # Where it would be with the speed before; something else may have been in the way.
        left = gaps[before + 1, pairs] / -step[before, pairs]
        ahead = [
            at[before + 1] + (left * np.diff(at, axis=0)[before].T).T for at in (places, angles)
        ]
        points, _, gaps = _nearest(recording, *ahead)
        rows = np.arange(len(before))
        hit = gaps[rows, pairs] < _NEAR * reach
        when.append((times[before + 1] + left * recording.dt)[hit])
        where.append(points[rows, pairs][hit])
    order = np.argsort(np.concatenate(when), kind="stable")
    sorted_when, sorted_where = np.concatenate(when)[order], np.concatenate(where)[order]
    _, first = np.unique((sorted_where / (_SAME * reach)).round(), axis=0, return_index=True)
    first.sort()
    return sorted_when[first], sorted_where[first]


def _nearest(
    recording: Recording,
    places: Float[np.ndarray, "states 2"],
    angles: Float[np.ndarray, " states"],
) -> tuple[
    Float[np.ndarray, "states pairs 2"],
    Float[np.ndarray, "states pairs 2"],
    Float[np.ndarray, "states pairs"],
]:
    """What may touch: the point of each limb nearest to each of the object's corners, and each
    joint and fingertip with each of its edges.

    Arguments:
        recording: of the trial.
        places, angles: of the object, in the hand frame.

    Returns:
        The points on the limbs' surfaces, the direction to the object, and how far it is to its
        surface: NaN where that is an end of the edge, which is a corner.
    """
    hand, half = recording.hand, 0.5 * float(recording.scenario.hand.thickness)
    own, rounding = placed_outline(recording.scenario.body, np.zeros(2), 0.0)
    c, s = np.cos(angles), np.sin(angles)
    turn = np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)], axis=1)
    corners = places[:, None] + own @ turn
    a, b = hand[:-1], hand[1:]
    share = _share(corners[:, :, None], a, b).clip(0.0, 1.0)[..., None]
    on_hand = [(a + share * (b - a)).reshape(len(places), -1, 2)]
    on_object = [np.repeat(corners, len(a), axis=1)]
    apart = [np.zeros(on_hand[0].shape[:2])]
    if len(own) > 1:
        a, b = corners[:, None], np.roll(corners, -1, axis=1)[:, None]
        share = _share(hand[None, :, None], a, b)
        beside = (share <= 0.0) | (share >= 1.0)
        edge = a + share[..., None] * (b - a)
        on_hand.append(np.tile(np.repeat(hand, len(own), axis=0), (len(places), 1, 1)))
        on_object.append(edge.reshape(len(places), -1, 2))
        apart.append(np.where(beside, np.nan, 0.0).reshape(len(places), -1))
    points = np.concatenate(on_hand, axis=1)
    way = np.concatenate(on_object, axis=1) - points
    far = np.hypot(way[..., 0], way[..., 1])
    normals = way / np.where(far > 0, far, 1.0)[..., None]
    # What lies on a middle line is on neither side of it: it has no normal.
    return points + half * normals, normals, far - rounding - half + np.concatenate(apart, axis=1)


def _share(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How far along the line from a to b the place nearest to a point is."""
    along = b - a
    return ((point - a) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-300)


def draw_contacts(
    axis: Axes, recording: Recording, frames: Frames, k: int, *, slips: bool = True
) -> None:
    """A dot at each contact, and where the object slips a line that way.

    Arguments:
        axis: in the world.
        recording: the trial.
        frames, k: some of its times, and which of them.
        slips: whether to draw the lines.
    """
    where, slip = contacts_at(recording, float(frames.times[k]))
    reach = float(recording.scenario.body.radius)
    length = np.hypot(*slip.T)[:, None]
    ahead = slip * SHOWN_FOR * np.minimum(1.0, reach / np.maximum(SHOWN_FOR * length, 1e-12))
    for start, end in zip(
        frames.in_world(where, k), frames.in_world(where + ahead, k), strict=True
    ):
        if slips:
            axis.plot(*np.stack([start, end]).T, color=COLOURS[0], lw=2.5, zorder=5)
        axis.plot(*start, "o", color=COLOURS[0], ms=4.5, mec="white", mew=0.6, zorder=5.1)
