"""Where things are in a hand: limbs, gap, goal and starts, of the hand and two numbers alone."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from pcjax.geometry import (
    Flag,
    Scalar,
    Segment,
    Vec,
    cut_through,
    is_inside,
    library_of,
    segment_between,
    stacked,
)
from pcjax.model.hand import Goal, HandDesign


def first_centre(
    hand: HandDesign, radius: Scalar, start_spread: Scalar, draws: Array | Sequence[float]
) -> Vec:
    """`Scenario.start`, of the numbers that it depends on; `radius` is the contact radius."""
    xp = library_of(hand, radius, start_spread, draws)
    left = draws[0] < 0.5
    spread = start_spread * hand.palm_length
    side = xp.where(left, -1.0, 1.0)
    corner = xp.where(left, *(_corner_inset(finger[0], radius) for finger in hand.angles))
    lean = xp.where(left, *(_lean(finger[0]) for finger in hand.angles))
    up = draws[2] * spread
    x = side * (hand.palm_length / 2 - corner - draws[1] * spread - lean * up)
    return Vec(x, radius + up)


def corner_centre(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Vec:
    """`Scenario.corner_start`, of the numbers that it depends on."""
    return first_centre(hand, radius, start_spread, [0.9, 0.0, 0.0])


def _corner_inset(angle: Scalar, radius: Scalar) -> Scalar:
    # The circle's centre lies on the bisector of the corner between palm and first limb.
    return radius * library_of(angle).tan(angle / 2)


def _lean(angle: Scalar) -> Scalar:
    # How far the first limb comes in for each unit of height; a right angle is none.
    xp = library_of(angle)
    rise, out = xp.sin(angle), xp.cos(angle)
    leans = (out < -1e-6) & (rise > 0)
    return xp.where(leans, -out / xp.where(leans, rise, 1.0), 0.0)


class Fit(eqx.Module):
    """How the object fits at its starts.

    Attributes:
        clearance: least distance between the circle and a limb over all starts; negative: it does
            not fit.
        outside: whether some start is not inside what limbs and goal line enclose.
    """

    clearance: Scalar
    outside: Flag


def fit_of(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Fit:
    """How an object of that contact radius fits; the numbers may be traced."""
    xp = library_of(hand, radius, start_spread)
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    # At both ends of the palm, along the first axis.
    boxes = [
        stacked([first_centre(hand, radius, start_spread, [end, *corner]) for end in (0.0, 0.9)])
        for corner in corners
    ]
    goal, region = hand.goal(), hand.region()
    limbs = jax.tree.map(lambda x: x[:, None], stacked(hand.limbs()))
    least = xp.min(_distance_to_box(limbs, boxes), axis=(0, 1))
    crossed = _distance_to_box(segment_between(goal.a, goal.b), boxes)
    outside = xp.any((crossed <= 0.0) | xp.logical_not(is_inside(region, boxes[0])), axis=0)
    return Fit(least - radius, outside)


def _distance_to_box(segment: Segment, corners: Sequence[Vec]) -> Any:
    """Distance from a segment to a filled parallelogram; 0 where they meet."""
    xp, least = library_of(segment, corners), math.inf
    cut = is_inside(corners, segment.start) | is_inside(corners, segment.end)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        edge = segment_between(a, b)
        for distance in (
            segment.distance(a),
            edge.distance(segment.start),
            edge.distance(segment.end),
        ):
            least = xp.minimum(least, distance)
        cut = cut | cut_through(segment, edge)
    return xp.where(cut, 0.0, least)


class Geometry(eqx.Module):
    """What is checked of a scenario before it is run, and where things are.

    Attributes:
        fit: of the object at its starts.
        gap: the narrowest passage out of the hand, a length.
        crossings: for each pair of limbs that do not share a joint, whether they cross.
        faces: whether finger 1's fingertip is on the left of finger 2's.
        blocked: whether a limb cuts through the goal line.
        limbs, goal: of the hand.
        passage: the points of finger 1 and finger 2 that are closest to each other.
        passages: widths between any two limbs that share no joint.
        start: the start closest to the corner at the palm's right end.
    """

    fit: Fit
    gap: Scalar
    crossings: dict[tuple[str, str], Flag]
    faces: Flag
    blocked: Flag
    limbs: tuple[Segment, ...]
    goal: Goal
    passage: tuple[Vec, Vec]
    passages: tuple[Scalar, ...]
    start: Vec


Place = tuple[HandDesign, Scalar, Scalar]
"""A hand, the contact radius of an object, and the spread of its starts; plain numbers."""

_MOST_KNOWN = 4096

_known: dict[Any, Geometry] = {}
"""The geometries asked for last: each is asked for several times before a hand is run."""

_lock = threading.Lock()


def geometries_of(places: Sequence[Place]) -> list[Geometry]:
    """The geometries of plain numbers, in 64 bits; hands of one structure are worked out at once,
    which takes little longer than one of them."""
    exact = [jax.tree.map(float, place) for place in places]
    keys = [(jax.tree.structure(one), *jax.tree.leaves(one)) for one in exact]
    with _lock:
        found = {key: _known[key] for key in keys if key in _known}
    groups: dict[Any, dict[Any, Place]] = {}
    for key, one in zip(keys, exact, strict=True):
        if key not in found:
            groups.setdefault(key[0], {})[key] = one
    for group in groups.values():
        leaves, structure = jax.tree.flatten(_geometry(*stacked(list(group.values()))))
        whole = [np.broadcast_to(leaf, len(group)) for leaf in leaves]
        for key, row in zip(group, zip(*whole, strict=True), strict=True):
            found[key] = jax.tree.unflatten(structure, row)
    with _lock:
        _known.update(found)
        for key in list(_known)[: max(0, len(_known) - _MOST_KNOWN)]:
            del _known[key]
    return [found[key] for key in keys]


def geometry_of_hand(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Geometry:
    """The geometry of plain numbers, in 64 bits."""
    return geometries_of([(hand, radius, start_spread)])[0]


def _geometry(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Geometry:
    with np.errstate(all="ignore"):
        return Geometry(
            fit_of(hand, radius, start_spread),
            hand.gap(),
            hand.crossings(),
            hand.faces(),
            hand.blocked_goal(),
            hand.limbs(),
            hand.goal(),
            hand.narrowest_passage(),
            hand.passages(),
            corner_centre(hand, radius, start_spread),
        )


def same_gap(gap: Any, other: Any, thickness: Any) -> Any:
    """Whether two gaps of a hand of some thickness are the same number, but for rounding."""
    return abs(gap - other) <= 1e-9 * (gap + other + thickness)
