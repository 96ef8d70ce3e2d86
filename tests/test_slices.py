"""Escape energies of what has corners: closed forms, bounds, a coarse grid, mirrors."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
import shapely
from jaxtyping import Float
from scipy import ndimage

import pcjax
from experiments import fuzz
from pcjax.geometry import Vec, is_inside
from pcjax.model.bodies.outline import SKIN
from pcjax.quality.energy import energy_of, landscape_for, landscape_inside
from pcjax.study.energy import energy_table

pytestmark = pytest.mark.usefixtures("quick_programs")


def down(degrees: float) -> Float[np.ndarray, "2"]:
    return np.array([math.sin(math.radians(degrees)), -math.cos(math.radians(degrees))])


def bounds(found: pcjax.EscapeEnergy, degrees: float) -> tuple[float, float]:
    """At least and at most from where it lies deepest."""
    assert found.at_least
    least, most = (one.at(math.radians(degrees)) for one in (found.at_least, found))
    return least.from_rest, most.from_rest


def test_climbs_of_a_square_out_of_the_box_hand() -> None:
    """Palm and lids at y = 0 and 500, walls at x = +-250, tips of 100 hung at x = +-100."""
    found = pcjax.energy(pcjax.box_hand(0.0), pcjax.Square(40.0), tilts=4)
    assert (found.exact, found.bound) == (False, "at most")
    told = found.as_json()
    assert (told["bound"], told["at_least"]["bound"]) == ("at most", "at least")
    skin = SKIN * 20 * math.sqrt(2)
    closed = {0: 500 - 20 - skin, 90: (250 - 20) - (100 - 20), 180: 100}
    for degrees, climb in closed.items():
        least, most = bounds(found, degrees)
        assert least == pytest.approx(climb, abs=0.02)
        assert most == pytest.approx(climb, abs=0.02)
    # Starts are in the middle of a square of 50 from where it can turn in the corner.
    assert found.at(0.0).from_start == pytest.approx(500 - 25 - 20 * math.sqrt(2), abs=0.01)


def test_what_does_not_turn_has_the_climb_of_its_orientation() -> None:
    """A square of side 60 in a gap of 70 fits through upright, but not by its diagonal of 85."""
    hand = pcjax.box_hand(0.0, gap_width=70.0)
    upright = pcjax.Square(60.0, turns=False)
    found = pcjax.energy(hand, upright, tilts=4)
    assert (found.exact, found.at_least) == (True, None)
    skin = SKIN * 30 * math.sqrt(2)
    assert found.at(0.0).from_rest == pytest.approx(500 - 30 - skin, abs=1e-4)
    # From the wall to the gap's other side, 5 - skin from its middle: 35 - 30 is what is left.
    assert found.at(math.pi / 2).from_rest == pytest.approx(250 - 35, abs=1e-4)
    across = pcjax.energy(hand, replace(upright, orientation=math.radians(45)), tilts=4)
    assert np.isinf(across.from_rest).all()
    assert np.isinf(across.from_start).all()
    least, most = bounds(pcjax.energy(hand, pcjax.Square(60.0, orientation=0.8), tilts=4), 0)
    assert least == pytest.approx(found.at(0.0).from_rest, abs=0.01)
    assert most == pytest.approx(least, abs=0.01)
    with pytest.raises(ValueError, match="does not turn and its orientation is drawn"):
        pcjax.energy(hand, replace(upright, orientation=None))


def test_sticks_get_out_endwise_and_what_is_wider_than_the_gap_does_not() -> None:
    hand = pcjax.box_hand(0.0, gap_width=60.0)
    for body in (pcjax.Stick(90.0), pcjax.Rectangle((150.0, 55.0))):
        least, most = bounds(pcjax.energy(hand, body, tilts=4), 0)
        half = 27.5 if isinstance(body, pcjax.Rectangle) else 0.0
        assert least == pytest.approx(500 - half, abs=0.05)
        assert most == pytest.approx(least, abs=0.05)
        held = pcjax.energy(hand, replace(body, turns=False), tilts=4)
        assert np.isinf(held.from_rest).all()
    for wide in (pcjax.Square(60.1), pcjax.Rectangle((150.0, 60.1))):
        found = pcjax.energy(hand, wide, tilts=4)
        assert np.isinf(bounds(found, 0)).all()
        assert found.as_json()["full_cage"]


def test_a_triangle_whose_width_is_more_than_the_gap_may_still_reach_through_it() -> None:
    """Its centre is on the goal line while its base, wider than the gap, is behind the tips."""
    right = math.pi / 2
    fingers = ((500.0, 200.0), (500.0, 200.0)), ((right, right), (right, right))
    hand = pcjax.HandDesign(500.0, *fingers)
    tall = pcjax.Polygon(((-60.0, 0.0), (60.0, 0.0), (0.0, 150.0)))
    width = float(tall.width)
    assert float(hand.gap()) < width
    # It lies on its longest side.
    least, most = bounds(pcjax.energy(hand, tall, tilts=4), 0)
    assert least == pytest.approx(500 - width / 3, abs=0.05)
    assert most == pytest.approx(least, abs=0.05)


def test_no_way_found_is_no_full_cage(tmp_path: Path) -> None:
    """A capsule that fits through an oblique gap so tightly that the polygon about its rounding
    does not: its circle gets out."""
    left, right = (500.0, 150.0, 120.0), (420.0, 190.0, 80.0)
    bent, turned = (tuple(map(math.radians, row)) for row in ((90, 90, 75), (85, 95, 60)))
    hand = pcjax.HandDesign(500.0, (left, right), (bent, turned))
    wide = 0.9998 * float(hand.gap())
    found = {"does": pcjax.energy(hand, pcjax.Capsule(1.2 * wide, wide), tilts=4)}
    least, most = bounds(found["does"], 0)
    assert math.isfinite(least)
    assert math.isinf(most)
    assert not found["does"].full_cage
    assert "DoEs: no way out was found" in energy_table(found, "model")
    pcjax.plot_energy(found).savefig(tmp_path / "energy.png")
    assert (tmp_path / "energy.png").stat().st_size > 10_000


BODIES = (
    pcjax.Square(1.3, rounding=0.1),
    pcjax.Rectangle((1.8, 0.5)),
    pcjax.Capsule(2.0, 0.4),
    pcjax.Stick(1.0),
    pcjax.RegularPolygon(3, 1.0),
    pcjax.Polygon(((0.0, 0.0), (1.2, 0.0), (0.0, 1.6)), rounding=0.05),
)
"""Each about 1 from its centre to its ends."""


def random_scenarios(count: int, seed: int) -> list[pcjax.Scenario]:
    """Random hands in both directions, with each of the bodies in turn."""
    found: list[pcjax.Scenario] = []
    rng = np.random.default_rng(seed)
    while len(found) < count:
        circle = fuzz.random_case(rng, fuzz.LIMBS[len(found) % len(fuzz.LIMBS)]).scenario
        body = BODIES[len(found) % len(BODIES)]
        scale = float(circle.body.radius) / float(body.radius)
        scenario = replace(circle, body=body.scaled(scale))
        try:
            scenario.check()
        except ValueError:
            continue
        found.append(scenario)
    return found


def test_bounds_enclose_and_more_orientations_bring_the_upper_one_down() -> None:
    """30 random hands and bodies. The angles of 36 orientations are among those of 72, and what is
    swept between these in what is swept between those, so that no way is lost."""
    close = 0
    for scenario in random_scenarios(30, 21):
        few, many = landscape_for(scenario, 36), landscape_for(scenario, 72)
        inside, palm = landscape_inside(scenario, many), float(scenario.hand.palm_length)
        for degrees in (-90, 0, 90, 180):
            above, upper, lower = (one.climb(down(degrees)) for one in (few, many, inside))
            slack = inside.tolerance + 1e-6 * palm
            assert lower.from_rest <= upper.from_rest + slack
            assert lower.from_start <= upper.from_start + slack
            assert upper.from_start <= above.from_start + slack
            close += upper.from_rest == lower.from_rest or (
                upper.from_rest - lower.from_rest < 0.002 * palm
            )
    assert close >= 110  # of 120


def test_a_nearly_round_polygon_climbs_as_a_circle_does() -> None:
    polygon = pcjax.RegularPolygon(16, 26.0, 20.0)
    inner, outer = polygon.inner_radius(), float(polygon.radius)
    hand = pcjax.box_hand(math.radians(20))
    near = pcjax.energy(hand, polygon, tilts=24)
    circle = pcjax.energy(hand, pcjax.Circle(inner), tilts=24)
    assert outer - inner < 0.15
    np.testing.assert_allclose(near.from_rest, circle.from_rest, atol=2 * (outer - inner) + 0.05)


def test_a_mirrored_hand_with_a_mirrored_object_has_the_mirrored_climbs() -> None:
    """In a mirror along the hand's axis an object at an angle is its mirror image in its own x
    axis, at half a turn less the angle."""
    left, right = (500.0, 150.0, 120.0), (420.0, 190.0, 80.0)
    bent, turned = (tuple(map(math.radians, row)) for row in ((90, 90, 75), (85, 95, 60)))
    hand = pcjax.HandDesign(500.0, (left, right), (bent, turned))
    other = pcjax.HandDesign(500.0, (right, left), (turned, bent))
    for turns in (True, False):
        body = pcjax.Polygon(
            ((0.0, 0.0), (60.0, 0.0), (0.0, 80.0)), 5.0, orientation=0.4, turns=turns
        )
        seen = replace(body.mirrored(), orientation=math.pi - 0.4)
        found, mirrored = (
            pcjax.energy(one, what, tilts=12) for one, what in ((hand, body), (other, seen))
        )
        for a, b in ((found, mirrored), (found.at_least, mirrored.at_least)):
            if a and b:
                np.testing.assert_allclose(a.from_rest[:-1], b.from_rest[-2::-1], atol=0.02)
                np.testing.assert_allclose(a.from_start[:-1], b.from_start[-2::-1], atol=0.02)


def test_ways_go_from_rest_over_the_saddle_to_the_goal_line_among_the_limbs() -> None:
    """Every corner of a way is a place where the object is clear of all limbs."""
    hand, body = pcjax.box_hand(math.radians(20)), pcjax.Stick(90.0)
    landscape = landscape_for(pcjax.does(hand, body))
    limbs = shapely.multilinestrings([[_pair(limb) for limb in jax.tree.map(float, hand).limbs()]])
    for degrees in (0, 60, 100, 180):
        out = landscape.climb(down(degrees))
        heights = -(out.way @ down(degrees))
        assert out.from_rest == pytest.approx(heights.max() - heights[0], abs=1e-9)
        assert heights.max() == pytest.approx(float(-(out.saddle @ down(degrees))))
        np.testing.assert_array_equal(out.way[0], out.rest)
        assert out.angles[0] == out.rest_angle
        assert out.way[-1, 1] == pytest.approx(500.0)
        ends = 90 * np.stack([np.cos(out.angles), np.sin(out.angles)], axis=1)
        sticks = shapely.linestrings(np.stack([out.way - ends, out.way + ends], axis=1))
        assert shapely.distance(sticks, limbs).min() > 0.99 * SKIN * 90
        # From one corner to the next it goes at most half of 5 degrees.
        assert np.abs(np.diff(out.angles)).max() < math.radians(2.5) + 1e-9


def _pair(limb: Any) -> list[tuple[float, float]]:
    return [(limb.start.x, limb.start.y), (limb.end.x, limb.end.y)]


# ------------------------------------------------------------------------------- a coarse grid


class Grid:
    """Places and angles of an object in a hand, by how far it is from the limbs there, and levels
    up to which they hang together. Three periods of the angle, so that it may be turned around."""

    def __init__(self, scenario: pcjax.Scenario, period: float, cells: int = 80, angles: int = 36):
        hand = jax.tree.map(float, scenario.hand)
        region = hand.region()
        corners = np.array([[corner.x, corner.y] for corner in region])
        low, high = corners.min(axis=0), corners.max(axis=0)
        self.spacing = float((high - low).max()) / cells
        x, y = (np.arange(a, b, self.spacing) for a, b in zip(low, high, strict=True))
        self.x, self.y = np.meshgrid(x, y, indexing="ij")
        turned = period * np.arange(angles) / angles
        core, rounding = scenario.body.outline()
        c, s = np.cos(turned), np.sin(turned)
        own = np.array([[float(corner.x), float(corner.y)] for corner in core])
        core_at = own @ np.moveaxis(np.array([[c, s], [-s, c]]), -1, 0)
        at = np.stack([self.x, self.y], axis=-1)[:, :, None, None] + core_at
        shapes: Any = shapely.polygons(at) if len(own) > 2 else shapely.linestrings(at)
        limbs = shapely.multilinestrings([[_pair(limb) for limb in hand.limbs()]])
        away = shapely.distance(shapes, limbs) - float(rounding) - 0.5 * float(hand.thickness)
        self.away = np.concatenate([away] * 3, axis=2)
        step = period / angles / 2 * float(scenario.body.radius)
        # How far any point of the object may be from where it is at the nearest node.
        self.reach = self.spacing / math.sqrt(2) + step
        goal = hand.goal()
        line = shapely.linestrings([[goal.a.x, goal.a.y], [goal.b.x, goal.b.y]])
        self.exit = shapely.distance(shapely.points(self.x, self.y), line) <= self.reach
        self.inside = np.asarray(is_inside(region, Vec(self.x, self.y))) | self.exit

    def level(self, margin: float, degrees: float, place: Float[np.ndarray, "2"]) -> float:
        """The least level up to which a place, where it can turn, hangs together with the goal line
        for what is a margin from all limbs."""
        height = -(self.x * down(degrees)[0] + self.y * down(degrees)[1])
        free = self.inside[:, :, None] & (self.away >= margin)
        near = np.argmin((self.x - place[0]) ** 2 + (self.y - place[1]) ** 2)
        i, j = divmod(int(near), self.x.shape[1])

        def open_at(level: float) -> bool:
            found: Any = ndimage.label(free & (height <= level)[:, :, None], np.ones((3, 3, 3)))
            mine = set(found[0][i, j].tolist()) - {0}
            return bool(mine & set(np.unique(found[0][self.exit]).tolist()))

        low, high = float(height[i, j]), float(height.max())
        if not open_at(high):
            return math.inf
        while high - low > 0.1 * self.spacing:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if open_at(middle) else (middle, high)
        return high


@pytest.mark.parametrize(
    ("tip", "gap", "body", "period"),
    [
        (20.0, 200.0, pcjax.Stick(90.0), math.pi),
        (-30.0, 120.0, pcjax.Square(70.0), math.pi / 2),
        (0.0, 120.0, pcjax.Capsule(140.0, 40.0), math.pi),
        (0.0, 160.0, pcjax.Polygon(((0.0, 0.0), (90.0, 0.0), (0.0, 120.0))), 2 * math.pi),
    ],
)
def test_levels_of_a_coarse_grid_are_on_both_sides(
    tip: float, gap: float, body: pcjax.Body, period: float
) -> None:
    """What is half a cell's diagonal and half a step smaller goes along nodes no more than that
    higher than the object's own ways, and nodes that are as much farther from the limbs are a way
    of its own, with room enough to turn from slice to slice."""
    scenario = pcjax.does(pcjax.box_hand(math.radians(tip), gap_width=gap), body)
    grid = Grid(scenario, period, angles=round(36 * period / math.pi))
    found = energy_of(scenario, 4, 144)
    assert found.at_least
    exact = jax.tree.map(float, scenario)
    middles = [exact.start([end, 0.5, 0.5]) for end in (0.25, 0.75)]
    sharp = 0
    for degrees in (0, 40, 70, 100):
        slack = grid.reach + 0.1 * grid.spacing
        lower, upper = (
            min(
                grid.level(margin, degrees, np.array([m.x, m.y]))
                + float(np.array([m.x, m.y]) @ down(degrees))
                for m in middles
            )
            for margin in (-grid.reach, grid.reach)
        )
        least, most = (one.at(math.radians(degrees)).from_start for one in (found.at_least, found))
        assert lower - slack <= most <= max(upper, 0.0) + slack
        assert least <= max(upper, 0.0) + slack
        sharp += upper - lower < 8 * grid.spacing
    assert sharp >= 2
