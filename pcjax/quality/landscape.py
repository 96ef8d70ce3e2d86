"""How high an object has to climb out of a triangulated free space.

Height against a steady gravity is linear, so two points of a free space in the plane are connected
by places no higher than some level if and only if they are along edges whose ends are no higher: in
each triangle what is below a level is convex, holds the triangle's lowest corner, and meets the
triangle next to it where it holds their edge's lower end. The least height that has to be passed
between two places is then that of a path of corners, exactly, whatever the triangulation.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from pcjax.importing import Later

if TYPE_CHECKING:
    import shapely
else:
    shapely = Later("shapely")

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
        rest_angle: of the object at that place, radians; 0 of a circle.
        angles: of the object along the way.
    """

    from_rest: float
    from_start: float
    rest: Point
    saddle: Point
    way: Points
    rest_angle: float
    angles: Float[np.ndarray, " points"]


@dataclass(frozen=True)
class Places:
    """Points in the free space, each with the corners of the triangles that it is in."""

    at: Points
    angles: Float[np.ndarray, " points"]
    corners: Int[np.ndarray, "points _"]


@dataclass(frozen=True)
class Landscape:
    """A triangulated free space.

    Attributes:
        points: the triangles' corners.
        angles: of the object there, radians.
        near: of each corner those at the other ends of its edges.
        exits: the corners on the goal line.
        outlines: of the polygons that it is made of; none has a hole.
        sides: for each start, its middle and the places that the object can surely reach from
            there; one where both reach the same.
        period: the turn after which the object looks the same.
        tolerance: by how much heights may be wrong, a length; no climb is less than that.
    """

    points: Points
    angles: Float[np.ndarray, " corners"]
    near: tuple[tuple[int, ...], ...]
    exits: Int[np.ndarray, " exits"]
    outlines: tuple[Outline, ...]
    sides: tuple[tuple[Places, Places], ...]
    period: float
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
        climb, rest, angle, corner = min(found, key=lambda one: one[0])
        corners = []
        while corner >= 0:
            corners.append(corner)
            corner = onwards[corner]
        ways = np.concatenate([rest[None], self.points[corners]])
        angles = np.unwrap([angle, *self.angles[corners]], period=self.period)
        climb, start = (0.0 if one < self.tolerance else one for one in (climb, min(starts)))
        saddle = np.full(2, math.nan)
        if math.isinf(climb):
            ways, angles = ways[:0], angles[:0]
        elif climb > 0:
            saddle = ways[np.argmin(ways @ direction)]
        return Climb(climb, start, rest, saddle, ways, angle, angles)

    def _deepest(
        self, levels: Float[np.ndarray, " corners"], places: Places, direction: Point
    ) -> tuple[float, Point, float, int]:
        """The most that has to be climbed from any of some places, which that is, the object's
        angle there, and the corner where the way out begins; -1 where there is none."""
        climbs = _climbs(levels, places, direction)
        if not np.isfinite(climbs).all():
            lowest = int(np.argmax(places.at @ direction))
            return math.inf, places.at[lowest], float(places.angles[lowest]), -1
        worst = int(np.argmax(climbs))
        corners = places.corners[worst]
        corner = int(corners[np.argmin(levels[corners])])
        return float(climbs[worst]), places.at[worst], float(places.angles[worst]), corner

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
    levels: Float[np.ndarray, " corners"], places: Places, direction: Point
) -> Float[np.ndarray, " points"]:
    """The least that has to be climbed from each of some places to the goal line."""
    below = places.at @ direction
    return np.maximum(levels[places.corners].min(axis=1) + below, 0.0)


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
    pool = min(polygons_of(shapely.intersection(low, free)), key=rest.distance)
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


def short_way(
    landscape: Landscape, climb: Climb, direction: Point, radius: float
) -> tuple[Points, Float[np.ndarray, " points"]]:
    """The shortest way out along edges from the place of rest, no higher than the saddle, and the
    object's angles on it.

    Arguments:
        landscape: a free space.
        climb: a way out of it.
        direction: of gravity.
        radius: how long a turn by a radian is.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    points, angles, period = landscape.points, landscape.angles, landscape.period
    a = np.repeat(np.arange(len(points)), [len(others) for others in landscape.near])
    b = np.concatenate([np.array(others, int) for others in landscape.near])
    heights = -(points @ direction)
    top = np.max(-(climb.way @ direction)) + 1e-9 * np.ptp(points)
    low = (heights[a] <= top) & (heights[b] <= top)
    a, b = a[low], b[low]
    turn = np.abs((angles[b] - angles[a] + period / 2) % period - period / 2)
    # Links in place have no length where nothing is turned, but are edges all the same.
    length = np.hypot(*(points[b] - points[a]).T) + radius * turn + 1e-12 * np.ptp(points)
    graph = csr_array((length, (a, b)), (len(points),) * 2)
    begin = np.argmin(
        np.hypot(*(points - climb.rest).T) + np.where(angles == climb.rest_angle, 0, np.inf)
    )
    far, before = dijkstra(graph, indices=begin, return_predecessors=True)
    way = [int(landscape.exits[np.argmin(far[landscape.exits])])]
    while way[-1] != begin:
        way.append(int(before[way[-1]]))
    way.reverse()
    return points[way], np.unwrap(angles[way], period=period)


def polygons_of(shape: Any) -> list[Any]:
    """The polygons of what may have other parts."""
    return [part for part in shapely.get_parts(shape).tolist() if part.geom_type == "Polygon"]
