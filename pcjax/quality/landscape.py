"""Where in a hand a disc's centre can be, and how high it has to climb to get out.

A disc is free where its centre is at least its radius from every limb, so the places of its centre
are what limbs and goal line enclose, less all that is within that radius of a limb. That polygon is
triangulated. Height against a steady gravity is linear, so two points are connected by places no
higher than some level if and only if they are along edges whose ends are no higher: in each
triangle what is below a level is convex, holds the triangle's lowest corner, and meets the
triangle next to it where it holds their edge's lower end. The least height that has to be passed
between two places is then that of a path of corners, exactly, whatever the triangulation.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Float, Int

from pcjax.geometry import Vec
from pcjax.importing import Later
from pcjax.model.hand import HandDesign

if TYPE_CHECKING:
    import shapely
else:
    shapely = Later("shapely")

ARC = 32
"""Chords of a quarter of a circle about a limb's end. They lie inside of it, by no more than 3.1e-4
of its radius, so that no height is wrong by more."""

_TOUCH = 1e-9
"""By what share of itself the radius is taken smaller, so that what fits exactly does."""

Points = Float[np.ndarray, "points 2"]
Point = Float[np.ndarray, "2"]
Outline = Float[np.ndarray, "_ 2"]


@dataclass(frozen=True)
class Climb:
    """The way out against one direction of gravity.

    Attributes:
        from_rest: how much higher than the object the way out leads it, from the place of which
            that is most, a length: 0 where nothing holds it anywhere, infinite in a full cage.
        from_start: the same from the middle of a start; the lesser of both starts.
        rest: that place.
        saddle: the highest point of the lowest way out from there; NaN where there is none.
        way: corners of such a way, from there to the goal line; no points where there is none.
    """

    from_rest: float
    from_start: float
    rest: Point
    saddle: Point
    way: Points


@dataclass(frozen=True)
class _Places:
    """Points in the free space, each with the corners of the triangle that it is in."""

    at: Points
    corners: Int[np.ndarray, "points 3"]


@dataclass(frozen=True)
class Landscape:
    """A triangulated free space.

    Attributes:
        points: the triangles' corners.
        near: of each corner those at the other ends of its edges.
        exits: the corners on the goal line.
        outlines: of the polygons that it is made of; none has a hole.
        sides: for each start, its middle and the places that the object can surely reach from
            there; one where both reach the same.
        tolerance: by how much heights may be wrong, a length; no climb is less than that.
    """

    points: Points
    near: tuple[tuple[int, ...], ...]
    exits: Int[np.ndarray, " exits"]
    outlines: tuple[Outline, ...]
    sides: tuple[tuple[_Places, _Places], ...]
    tolerance: float

    def climb(self, direction: Point) -> Climb:
        """The way out.

        Arguments:
            direction: of gravity, a unit vector in the hand frame.
        """
        heights = -(self.points @ direction)
        levels, onwards = self._flood(heights)
        starts = [float(np.min(_climbs(levels, start, direction))) for start, _ in self.sides]
        found = [self._deepest(levels, places, direction) for _, places in self.sides]
        climb, rest, corner = min(found, key=lambda one: one[0])
        way = [rest]
        while corner >= 0:
            way.append(self.points[corner])
            corner = onwards[corner]
        climb, start = (0.0 if one < self.tolerance else one for one in (climb, min(starts)))
        saddle, ways = np.full(2, math.nan), np.array(way)
        if math.isinf(climb):
            ways = ways[:0]
        elif climb > 0:
            saddle = ways[np.argmin(ways @ direction)]
        return Climb(climb, start, rest, saddle, ways)

    def _deepest(
        self, levels: Float[np.ndarray, " corners"], places: _Places, direction: Point
    ) -> tuple[float, Point, int]:
        """The most that has to be climbed from any of some places, which that is, and the corner
        where the way out begins; -1 where there is none."""
        climbs = _climbs(levels, places, direction)
        if not np.isfinite(climbs).all():
            return math.inf, places.at[np.argmax(places.at @ direction)], -1
        worst = int(np.argmax(climbs))
        corners = places.corners[worst]
        return float(climbs[worst]), places.at[worst], int(corners[np.argmin(levels[corners])])

    def _flood(
        self, heights: Float[np.ndarray, " corners"]
    ) -> tuple[Float[np.ndarray, " corners"], list[int]]:
        """The least height that has to be passed from each corner to the goal line, and the corner
        that comes after it on such a way; -1 at the end.

        Water rises from the goal line and takes the lowest of the corners at its edge one after the
        other (priority flood: Barnes, Lehman and Mulla 2014).
        """
        count = len(self.points)
        height = heights.tolist()
        level, onwards, seen = [math.inf] * count, [-1] * count, [False] * count
        edge = []
        for corner in self.exits.tolist():
            level[corner], seen[corner] = height[corner], True
            edge.append((height[corner], corner))
        heapq.heapify(edge)
        while edge:
            water, corner = heapq.heappop(edge)
            for other in self.near[corner]:
                if not seen[other]:
                    seen[other], onwards[other] = True, corner
                    level[other] = max(water, height[other])
                    heapq.heappush(edge, (level[other], other))
        return np.array(level), onwards


def _climbs(
    levels: Float[np.ndarray, " corners"], places: _Places, direction: Point
) -> Float[np.ndarray, " points"]:
    """The least that has to be climbed from each of some places to the goal line."""
    below = places.at @ direction
    return np.maximum(levels[places.corners].min(axis=1) + below, 0.0)


def landscape_of(hand: HandDesign, inner: float, outer: float, starts: Points) -> Landscape:
    """The free space of an object, for plain numbers in 64 bits.

    Ways are those of the disc that is within the object, so that the object's own are no lower;
    places of rest those of the disc that it can turn in, where it can surely be.

    Arguments:
        hand: as simulated.
        inner: how far that disc's centre has to be from a limb's middle line, above 0.
        outer: the same for the disc that it can turn in.
        starts: the middles of its starts.

    Raises:
        ValueError: shapely is missing.
    """
    _check_shapely()
    hand = jax.tree.map(float, hand)
    inside = _around(starts, _free_space(hand, inner))
    corners = shapely.get_coordinates(
        [shapely.constrained_delaunay_triangles(part) for part in dict.fromkeys(inside)]
    ).reshape(-1, 4, 2)[:, :3]
    points, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    triangles = index.reshape(-1, 3)
    near: list[set[int]] = [set() for _ in points]
    for a, b, c in triangles.tolist():
        near[a] |= {b, c}
        near[b] |= {c, a}
        near[c] |= {a, b}
    cells: Any = shapely.polygons(points[triangles])
    tree = shapely.STRtree(cells)

    def placed(at: Points) -> _Places:
        return _Places(at, triangles[tree.nearest(shapely.points(at))])

    around = inside if outer == inner else _around(starts, _free_space(hand, outer))
    corner = {tuple(point): k for k, point in enumerate(points.tolist())}
    reached = {}
    for part in dict.fromkeys(around):
        at = shapely.get_coordinates(part)[:-1]
        if outer == inner:
            own = np.array([corner[tuple(point)] for point in at.tolist()])
            reached[part] = _Places(at, np.repeat(own[:, None], 3, axis=1))
        else:
            reached[part] = placed(at)
    if len(reached) == 1:
        sides = ((placed(starts), reached[around[0]]),)
    else:
        sides = tuple(
            (placed(start[None]), reached[part]) for start, part in zip(starts, around, strict=True)
        )
    goal, at = hand.goal(), Vec(points[:, 0], points[:, 1])
    # A corner in a pocket may be in line with the goal line, beside its ends.
    past, between = np.asarray(goal.beyond(at)), np.asarray(goal.between(at))
    exits = np.flatnonzero((np.abs(past) < 1e-8 * hand.palm_length) & between)
    exits = exits if len(exits) > 1 else exits[:0]  # a point that touches the line is no way out
    outlines = tuple(shapely.get_coordinates(part) for part in dict.fromkeys(inside))
    return Landscape(
        points,
        tuple(map(tuple, near)),
        exits,
        outlines,
        sides,
        inner * (1 - math.cos(math.pi / 4 / ARC)),
    )


def _free_space(hand: HandDesign, radius: float) -> list[Any]:
    """The polygons in which a centre can be."""
    region: Any = shapely.Polygon(_points(hand.region()))
    if not region.is_valid:  # limbs that touch
        region = shapely.make_valid(region)
    lines = np.stack([_points([limb.start, limb.end]) for limb in hand.limbs()])
    taken = shapely.buffer(shapely.linestrings(lines), radius * (1 - _TOUCH), quad_segs=ARC)
    return _polygons(shapely.difference(region, shapely.union_all(taken)))


def _points(corners: Sequence[Vec]) -> Points:
    return np.array([[corner.x, corner.y] for corner in corners], float)


def _polygons(shape: Any) -> list[Any]:
    return [part for part in shapely.get_parts(shape).tolist() if part.geom_type == "Polygon"]


def _around(starts: Points, parts: list[Any]) -> list[Any]:
    """The polygon that each start is in."""
    found = np.asarray(shapely.STRtree(parts).nearest(shapely.points(starts)))
    return [parts[k] for k in found]


def _check_shapely() -> None:
    if find_spec("shapely") is None:
        raise ValueError("energies need the package shapely: pip install 'pcjax[energy]'")


def pool_of(landscape: Landscape, climb: Climb, direction: Point) -> tuple[Outline, Outline]:
    """The outline of what is no higher than the saddle and hangs together with the place of rest,
    and the way out without the corners that it can do without there.

    Arguments:
        landscape: a free space.
        climb: a way out of it, with a saddle.
        direction: of gravity.
    """
    across, far = np.array([-direction[1], direction[0]]), 4 * float(np.ptp(landscape.points))
    sides = [(-far, 0.0), (far, 0.0), (far, far), (-far, far)]
    low = shapely.Polygon([climb.saddle + a * across + d * direction for a, d in sides])
    free = shapely.union_all([shapely.Polygon(outline) for outline in landscape.outlines])
    rest: Any = shapely.Point(climb.rest)
    pool = min(_polygons(shapely.intersection(low, free)), key=rest.distance)
    room = shapely.buffer(pool, 1e-6 * far)
    way, k = [climb.rest], 0
    while k < len(climb.way) - 1:
        k = max(
            j
            for j in range(k + 1, len(climb.way))
            if j == k + 1 or room.covers(shapely.LineString([climb.way[k], climb.way[j]]))
        )
        way.append(climb.way[k])
    return shapely.get_coordinates(pool), np.array(way)
