"""Where things are in a hand: limbs, gap, goal and starts, of the hand and two numbers alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from pcjax.compiling import compiled_quickly
from pcjax.geometry import (
    Flag,
    Scalar,
    Segment,
    Vec,
    cut_through,
    is_inside,
    segment_between,
    stacked,
)
from pcjax.model.hand import Goal, HandDesign


def first_centre(hand: HandDesign, radius: Scalar, start_spread: Scalar, draws: Array) -> Vec:
    """`Scenario.start`, of the numbers that it depends on; `radius` is the contact radius."""
    left = draws[0] < 0.5
    spread = start_spread * hand.palm_length
    side = jnp.where(left, -1.0, 1.0)
    corner = jnp.where(left, *(_corner_inset(finger[0], radius) for finger in hand.angles))
    lean = jnp.where(left, *(_lean(finger[0]) for finger in hand.angles))
    up = draws[2] * spread
    x = side * (hand.palm_length / 2 - corner - draws[1] * spread - lean * up)
    return Vec(x, radius + up)


def corner_centre(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Vec:
    """`Scenario.corner_start`, of the numbers that it depends on."""
    return first_centre(hand, radius, start_spread, jnp.array([0.9, 0.0, 0.0]))


def _corner_inset(angle: Scalar, radius: Scalar) -> Scalar:
    # The circle's centre lies on the bisector of the corner between palm and first limb.
    return radius * jnp.tan(angle / 2)


def _lean(angle: Scalar) -> Scalar:
    # How far the first limb comes in for each unit of height; a right angle is none.
    rise = jnp.sin(angle)
    leans = (jnp.cos(angle) < -1e-6) & (rise > 0)
    return jnp.where(leans, -jnp.cos(angle) / jnp.where(leans, rise, 1.0), 0.0)


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
    corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    draws = jnp.array([[[end, *corner] for end in (0.0, 0.9)] for corner in corners])
    boxes = jax.vmap(jax.vmap(lambda one: first_centre(hand, radius, start_spread, one)))(draws)
    boxes = [jax.tree.map(lambda x, k=k: x[k], boxes) for k in range(len(corners))]
    goal, region = hand.goal(), hand.region()
    each = jax.vmap(_distance_to_box, (0, None))
    least = jnp.min(jax.vmap(each, (None, 0))(stacked(hand.limbs()), boxes))
    crossed = jax.vmap(_distance_to_box, (None, 0))(segment_between(goal.a, goal.b), boxes)
    outside = jnp.any((crossed <= 0.0) | jnp.logical_not(is_inside(region, boxes[0])))
    return Fit(least - radius, outside)


def _distance_to_box(segment: Segment, corners: Sequence[Vec]) -> Scalar:
    """Distance from a segment to a filled parallelogram; 0 where they meet."""
    least, cut = jnp.inf, is_inside(corners, segment.start) | is_inside(corners, segment.end)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        edge = segment_between(a, b)
        for distance in (
            segment.distance(a),
            edge.distance(segment.start),
            edge.distance(segment.end),
        ):
            least = jnp.minimum(least, distance)
        cut = cut | cut_through(segment, edge)
    return jnp.where(cut, 0.0, least)


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
    start: Vec


@compiled_quickly
def _geometry(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Geometry:
    """All of it as one program: function by function it would be fifty. It is of the hand and two
    numbers alone, so that bodies, drives and laws share it."""
    return Geometry(
        fit_of(hand, radius, start_spread),
        hand.gap(),
        hand.crossings(),
        hand.faces(),
        hand.blocked_goal(),
        hand.limbs(),
        hand.goal(),
        hand.narrowest_passage(),
        corner_centre(hand, radius, start_spread),
    )


def geometry_of_hand(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Geometry:
    """The geometry of numbers that are concrete, in 64 bits."""
    with jax.enable_x64(True):
        return jax.device_get(_geometry(*jax.tree.map(float, (hand, radius, start_spread))))


def same_gap(gap: Any, other: Any, thickness: Any) -> Any:
    """Whether two gaps of a hand of some thickness are the same number, but for rounding."""
    return abs(gap - other) <= 1e-9 * (gap + other + thickness)
