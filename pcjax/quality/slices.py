"""Where in a hand an object's centre can be, at the angles that it may have.

Held at an angle, a convex object is free where its centre is in none of the Minkowski sums of limbs
with the object's mirror image in its centre: in what limbs and goal line enclose, less these. That
polygon is triangulated (see `pcjax.quality.landscape`).

An object that turns has such a polygon, a slice, at each of many angles, and goes from one to the
next where all that it sweeps as it turns in place is free. That is a polygon, too, within both
slices, and each part of it that is below a level holds one of its corners: the slices hang together
where corners link the triangles that they are in. So every way found is one that the object can
take, and the least heights that are passed are bounds from above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from pcjax.geometry import Vec
from pcjax.importing import Later
from pcjax.model.hand import HandDesign
from pcjax.quality.landscape import Landscape, Outline, Places, Points

if TYPE_CHECKING:
    import shapely
else:
    shapely = Later("shapely")

ARC = 32
"""Chords of a quarter of a circle about a limb's end. They lie inside of it, by no more than 3.1e-4
of its radius, so that no height is wrong by more."""

_TOUCH = 1e-9
"""By what share of itself the radius is taken smaller, so that what fits exactly does."""

Angles = Float[np.ndarray, " angles"]
Pieces = Float[np.ndarray, "angles _ _ 2"]


@dataclass(frozen=True)
class Shape:
    """A rounded convex polygon, as limbs meet it.

    Attributes:
        core: its corners seen from its centre, counterclockwise.
        radius: by which they are rounded, and half of the limbs' thickness, above 0.
    """

    core: Outline
    radius: float

    def turned(self, angles: Float[np.ndarray, " angles"]) -> Float[np.ndarray, "angles _ 2"]:
        """The corners at some angles, radians."""
        c, s = np.cos(angles), np.sin(angles)
        return self.core @ np.moveaxis(np.array([[c, s], [-s, c]]), -1, 0)

    @property
    def reach(self) -> float:
        """How far its corners are from its centre."""
        return float(np.hypot(*self.core.T).max())

    @property
    def order(self) -> int:
        """At how many angles of a turn it looks the same."""
        count, corners = len(self.core), self.core
        return max(
            order
            for order in range(1, count + 1)
            if count % order == 0
            and np.allclose(
                np.roll(corners, -(count // order), axis=0),
                self.turned(np.array([2 * math.pi / order]))[0],
                rtol=0,
                atol=1e-9 * self.reach,
            )
        )

    def angles(self, hand: HandDesign, count: int) -> Float[np.ndarray, " angles"]:
        """So many angles a turn, evenly spread, and those at which a side of it lies flat on a
        limb, within the period."""
        limbs = np.array([math.atan2(limb.tangent.y, limb.tangent.x) for limb in hand.limbs()])
        sides = np.roll(self.core, -1, axis=0) - self.core
        flat = limbs[:, None] - np.arctan2(sides[:, 1], sides[:, 0])
        period = 2 * math.pi / self.order
        flat = flat.ravel() / period
        each = max(-(-count // self.order), 3)
        turns = np.concatenate([np.arange(each) / each, flat, flat + self.order / 2])
        return period * np.unique(np.round(turns % 1.0, 12) % 1.0)

    def swept(self, angles: Angles, period: float) -> Pieces:
        """What its core is in as it turns in place from each angle to the next, in convex pieces.

        What is farthest out in any direction is that at either end, or a corner between them: the
        arc of each corner is in a kite of the centre, both ends, and where tangents there meet.
        """
        half = np.diff(angles, append=angles[0] + period) / 2
        one, other = self.turned(angles), self.turned(angles + 2 * half)
        out = self.turned(angles + half) / np.cos(half)[:, None, None]
        kites = np.stack([np.zeros_like(one), one, out, other], axis=2)
        ends = np.stack([one, other], axis=1)
        most = max(ends.shape[2], 4)

        def filled(pieces: Pieces) -> Pieces:
            lacking = (0, 0), (0, 0), (0, most - pieces.shape[2]), (0, 0)
            return np.pad(pieces, lacking, mode="edge")

        return np.concatenate([filled(ends), filled(kites)], axis=1)

    def rim(self, count: int) -> Outline:
        """Corners of a polygon about the circle by which it is rounded. With so many angles they
        are about as far out of it as turning sweeps corners of the object beyond a chord; twice as
        many have the same sides and more."""
        radius = self.radius * (1 - _TOUCH)
        share = math.sqrt(radius / (self.reach + radius))
        sides = 4 * 2 ** math.ceil(math.log2(max(count / 8 * share, 1.0)))
        at = 2 * math.pi / sides * (np.arange(sides) + 0.5)
        return radius / math.cos(math.pi / sides) * np.stack([np.cos(at), np.sin(at)], axis=1)


POINT = np.zeros((1, 2))
"""The core of a circle."""


def landscape_of(
    hand: HandDesign,
    shape: Shape,
    starts: Points,
    angle: float = 0.0,
    around: Landscape | None = None,
) -> Landscape:
    """The free space of an object that does not turn, for plain numbers in 64 bits.

    Arguments:
        hand: as simulated.
        shape: of the object.
        starts: the middles of its starts.
        angle: at which it is, radians.
        around: of what it is within: it lies only where that can be; unless given, wherever it can
            be itself.

    Raises:
        ValueError: shapely is missing.
    """
    _check_shapely()
    hand = jax.tree.map(float, hand)
    held = np.array([angle])
    net = _Net(*_free_space(hand, shape.turned(held)[:, None], shape.radius), 1)
    # GEOS makes an arc of the nearest whole number of chords, so that one may be half longer.
    chord = math.pi / 2 / ARC * (1.0 if len(shape.core) == 1 else 1.5)
    tolerance = shape.radius * (1 - math.cos(chord / 2))
    return net.landscape(hand, held, starts, 2 * math.pi, tolerance, around)


def slices_of(hand: HandDesign, shape: Shape, starts: Points, count: int) -> Landscape:
    """The free space of an object that turns, for plain numbers in 64 bits.

    Arguments:
        hand: as simulated.
        shape: of the object.
        starts: the middles of its starts, where it can turn.
        count: at how many angles a turn it is looked at, beside those at which a side of it lies
            flat on a limb.

    Raises:
        ValueError: shapely is missing.
    """
    _check_shapely()
    hand = jax.tree.map(float, hand)
    period, angles, rim = 2 * math.pi / shape.order, shape.angles(hand, count), shape.rim(count)

    def rounded(pieces: Pieces) -> Pieces:
        return (pieces[:, :, :, None] + rim).reshape(*pieces.shape[:2], -1, 2)

    net = _Net(*_free_space(hand, rounded(shape.turned(angles)[:, None])), len(angles))
    parts, which = _free_space(hand, rounded(shape.swept(angles, period)))
    corners, part = shapely.get_coordinates(parts, return_index=True)
    every = np.arange(len(angles))
    net.link(
        np.concatenate([corners, *([start] * len(every) for start in starts)]),
        np.concatenate([which[part], *([every] * len(starts))]),
    )
    return net.landscape(hand, angles, starts, period, 1e-9 * float(hand.palm_length))


class _Net:
    """Triangulated slices, and what links them.

    Arguments:
        parts: the polygons of all slices.
        which: the slice of each, ascending.
        count: of slices.
    """

    def __init__(self, parts: Any, which: Int[np.ndarray, " parts"], count: int):
        triangles = shapely.constrained_delaunay_triangles(parts)
        at, part = shapely.get_coordinates(triangles, return_index=True)
        rows = np.column_stack([part, at]).reshape(-1, 4, 3)[:, :3].reshape(-1, 3)
        corners, index = np.unique(rows, axis=0, return_inverse=True)
        self.parts, self.count = parts, count
        self.points, self.part = corners[:, 1:], corners[:, 0].astype(int)
        self.slice = which[self.part]
        self.triangles = index.reshape(-1, 3)
        self.edges = [self.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]
        self.joints, self.after = np.zeros((0, 2)), np.zeros(0, int)
        cells: Any = shapely.polygons(self.points[self.triangles])
        self.ends = np.searchsorted(self.slice[self.triangles[:, 0]], np.arange(count + 1))
        self.trees = [shapely.STRtree(cells[a:b]) for a, b in pairwise(self.ends)]

    def within(self, at: Points, number: int) -> Int[np.ndarray, "points 3"]:
        """The corners of the triangle of a slice in which points are."""
        return self.triangles[self.ends[number] + self.trees[number].nearest(shapely.points(at))]

    def link(self, at: Points, after: Int[np.ndarray, " points"]) -> None:
        """Links at some points the slice after which each comes with the next one."""
        joints = np.unique(np.column_stack([after, at]), axis=0)
        self.joints, self.after = joints[:, 1:], joints[:, 0].astype(int)
        for number in range(self.count):
            mine = np.flatnonzero(self.after == number)
            pair = number, (number + 1) % self.count
            for one in pair if all(len(self.trees[k]) for k in pair) else ():
                corners = self.within(self.joints[mine], one)
                own = np.repeat(len(self.points) + mine, 3)
                self.edges.append(np.stack([own, corners.ravel()], axis=1))

    def landscape(
        self,
        hand: HandDesign,
        angles: Angles,
        starts: Points,
        period: float,
        tolerance: float,
        around: Landscape | None = None,
    ) -> Landscape:
        """What hangs together with the starts; the object lies where that around it can, if any."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        own, count = len(self.points), len(self.points) + len(self.joints)
        a, b = np.concatenate(self.edges).T
        graph = coo_array((np.ones(len(a)), (a, b)), (count, count))
        labels = connected_components(graph)[1][:own]
        turned = angles[self.slice]

        def placed(at: Points, turned: Angles | None = None) -> Places:
            there = [self.within(at, k) for k in range(self.count) if len(self.trees[k])]
            turned = np.full(len(at), angles[0]) if turned is None else turned
            return Places(at, turned, np.concatenate(there, axis=1))

        begun = labels[placed(starts).corners[:, 0]]
        sides = []
        for group in dict.fromkeys(begun.tolist()):
            mine = np.flatnonzero(labels == group)
            places = Places(self.points[mine], turned[mine], mine[:, None])
            sides.append((placed(starts[begun == group]), places))
        if around is not None:
            sides = [
                (placed(start.at), placed(places.at, places.angles))
                for start, places in around.sides
            ]
        joined = np.isin(labels, begun)
        after = np.append(angles[1:], angles[0] + period)
        return Landscape(
            np.concatenate([self.points, self.joints]),
            np.concatenate([turned, (angles + after)[self.after] / 2]),
            _neighbours(a, b, count),
            self._exits(hand, joined),
            tuple(shapely.get_coordinates(self.parts[k]) for k in np.unique(self.part[joined])),
            tuple(sides),
            period,
            tolerance,
        )

    def _exits(
        self, hand: HandDesign, joined: Bool[np.ndarray, " corners"]
    ) -> Int[np.ndarray, " exits"]:
        """Which of some corners are on the goal line."""
        goal, at = hand.goal(), Vec(self.points[:, 0], self.points[:, 1])
        # A corner in a pocket may be in line with the goal line, beside its ends.
        past, between = np.asarray(goal.beyond(at)), np.asarray(goal.between(at))
        on = joined & between & (np.abs(past) < 1e-8 * hand.palm_length)
        # What touches the line in a point has no way out there.
        sides = self.triangles[on[self.triangles].sum(axis=1) > 1]
        return np.unique(sides[on[sides]])


def _neighbours(
    a: Int[np.ndarray, " edges"], b: Int[np.ndarray, " edges"], count: int
) -> tuple[tuple[int, ...], ...]:
    """Of each of so many corners those at the other ends of its edges."""
    pairs = np.unique(np.concatenate([a * count + b, b * count + a]))
    others = (pairs % count).tolist()
    ends = np.searchsorted(pairs, count * np.arange(count + 1)).tolist()
    return tuple(tuple(others[i:j]) for i, j in pairwise(ends))


def _free_space(
    hand: HandDesign, pieces: Pieces, radius: float = 0.0
) -> tuple[Any, Int[np.ndarray, " parts"]]:
    """The polygons in which a centre can be, and at which angle each is, for what has convex
    pieces there, rounded by a radius."""
    region: Any = shapely.Polygon(_points(hand.region()))
    if not region.is_valid:  # limbs that touch
        region = shapely.make_valid(region)
    limbs = np.stack([_points([limb.start, limb.end]) for limb in hand.limbs()])
    taken = []
    for held in pieces:  # one after the other, so that they need no room at once
        sums = limbs[:, None, :, None] - held[:, None]
        hulls = shapely.convex_hull(shapely.linestrings(sums.reshape(-1, 2 * held.shape[1], 2)))
        if radius > 0:
            hulls = shapely.buffer(hulls, radius * (1 - _TOUCH), quad_segs=ARC)
        taken.append(shapely.union_all(hulls))
    left = shapely.difference(region, taken)
    parts, which = shapely.get_parts(left, return_index=True)
    polygons = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    return parts[polygons], which[polygons]


def _points(corners: Sequence[Vec]) -> Points:
    return np.array([[corner.x, corner.y] for corner in corners], float)


def _check_shapely() -> None:
    if find_spec("shapely") is None:
        raise ValueError("energies need the package shapely: pip install 'pcjax[energy]'")
