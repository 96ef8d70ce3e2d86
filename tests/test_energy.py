"""Escape energies: closed forms, symmetry, watersheds of a fine grid, thrown objects, commands."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Bool, Float
from matplotlib.image import imread
from scipy import ndimage

import pcjax
from experiments import fuzz
from pcjax.cli import main
from pcjax.geometry import Mirror, Segment, Vec, is_inside, segment_between
from pcjax.physics.state import PASSED, at_rest
from pcjax.physics.step import advance
from pcjax.quality import slices
from pcjax.quality.energy import energy_of

pytestmark = pytest.mark.usefixtures("quick_programs")

CIRCLE = pcjax.Circle(25.0)


def climb(found: pcjax.EscapeEnergy, degrees: float) -> float:
    return found.at(math.radians(degrees)).from_rest


@pytest.mark.parametrize("tip", [0.0, 30.0])
def test_climbs_out_of_the_box_hand(tip: float) -> None:
    """Palm and lids at y = 0 and 500, walls at x = +-250, tips of 100 hung at x = +-100."""
    found = pcjax.energy(pcjax.box_hand(math.radians(tip)), CIRCLE)
    s, c = math.sin(math.radians(tip)), math.cos(math.radians(tip))
    close = found.landscape.tolerance
    assert found.exact
    # From the palm to the line between the tips' joints.
    assert climb(found, 0) == pytest.approx(500 - 25, abs=close)
    # Out of the pocket between lid and tip, below the tip's end.
    assert climb(found, 180) == pytest.approx(100 * c, abs=close)
    # From the wall to beside the tip's end.
    assert climb(found, 90) == pytest.approx(225 - (100 - 100 * s - 25), abs=close)
    # From the corner: to the end of the goal line where the object fits beside the tip.
    free = 100 - 25 / c
    for tilt in (10, 18):
        along, up = 225 - free, 500 - 25
        far = up * math.cos(math.radians(tilt)) + along * math.sin(math.radians(tilt))
        assert climb(found, tilt) == pytest.approx(far, abs=close)
    # Starts are in the middle of a square of 50 from (-+225, 25) on.
    assert found.at(0.0).from_start == pytest.approx(500 - 50, abs=close)
    # The left start is as high as the goal line's right end, where the object fits.
    opens = math.atan2(500 - 50, 200 + free)
    np.testing.assert_allclose(found.opens, (-opens, opens), atol=1e-4)
    assert np.isnan(found.lets_go).all()


def test_ways_into_the_box_hand_end_between_the_fingertips_ends() -> None:
    found = pcjax.energy(pcjax.box_hand(math.radians(30)), CIRCLE, direction="eoen")
    tip = 100 * math.cos(math.radians(30))
    assert climb(found, 0) == pytest.approx(500 + tip - 25, abs=found.landscape.tolerance)
    assert climb(found, 180) == 0.0


def test_a_saddle_is_the_highest_point_of_its_way_and_touches_a_limb() -> None:
    found = pcjax.energy(pcjax.box_hand(math.radians(30)), CIRCLE)
    out = found.at(math.pi / 2)
    tip = np.array([50.0, 500 - 100 * math.cos(math.radians(30))])
    np.testing.assert_allclose(
        out.saddle, tip + np.array([-25.0, 0.0]), atol=1.0
    )  # a chord is level there
    assert out.way[:, 0].min() == out.saddle[0]
    np.testing.assert_array_equal(out.way[0], out.rest)
    assert out.way[-1, 1] == pytest.approx(500.0)
    assert out.from_rest == pytest.approx(out.rest[0] - out.saddle[0])


def test_what_is_wider_than_the_gap_never_gets_out_and_what_fits_exactly_does() -> None:
    for gap, caged in ((49.9999, True), (50.0, False)):
        found = pcjax.energy(pcjax.box_hand(0.0, gap_width=gap), CIRCLE, tilts=12)
        assert np.isinf(found.from_rest).all() == np.isinf(found.from_start).all() == caged
        assert np.isnan(found.opens).all() == caged
        assert math.isinf(found.mean) == caged
    assert climb(found, 0) == pytest.approx(475.0)


@pytest.mark.parametrize("tilts", [5, 12])
def test_what_opens_upside_down_alone_is_found_with_an_odd_number_of_tilts(tilts: int) -> None:
    """For entering, a box hand lets go upside down: its lids are level then."""
    found = pcjax.energy(pcjax.box_hand(0.5), CIRCLE, direction="eoen", tilts=tilts)
    np.testing.assert_allclose(found.lets_go, (-math.pi, math.pi), atol=1e-3)


@pytest.mark.parametrize("kind", ["does", "eoen"])
def test_symmetric_hands_have_symmetric_climbs(kind: str) -> None:
    """10 random ones of three limbs a finger, each against its own other side."""
    rng, seen = np.random.default_rng(5), 0
    while seen < 10:
        lengths, angles = fuzz.random_finger(rng, 3, str(rng.choice(fuzz.SHAPES)), 500.0)
        hand = pcjax.HandDesign(500.0, (lengths, lengths), (angles, angles))
        try:
            found = pcjax.energy(hand, pcjax.Circle(12.0), direction=kind, tilts=24)
        except ValueError:
            continue
        seen += 1
        for climbs in (found.from_rest, found.from_start):
            there, back = climbs[:-1], climbs[-2::-1]  # without 180 deg, its own other side
            np.testing.assert_allclose(there, back, atol=found.landscape.tolerance)


def test_thickness_is_as_a_larger_circle_and_lengths_scale() -> None:
    plain = pcjax.energy(pcjax.box_hand(0.3), CIRCLE, tilts=36)
    thick = pcjax.energy(pcjax.box_hand(0.3, thickness=20.0), pcjax.Circle(15.0), tilts=36)
    np.testing.assert_allclose(thick.from_rest, plain.from_rest, atol=1e-6)
    small = pcjax.energy(pcjax.box_hand(0.3, palm_length=50.0), pcjax.Circle(2.5), tilts=36)
    np.testing.assert_allclose(10 * small.from_rest, plain.from_rest, atol=1e-6)


def test_pockets_that_reach_beyond_the_ends_of_the_goal_line_are_no_way_out() -> None:
    """Lids at y = 500 with posts at x = +-100, whose lower part from y = 400 to 340 is the tip: the
    goal line goes from post to post at y = 400, and its extension through the pockets behind."""
    right = math.pi / 2
    finger = (500.0, 150.0, 100.0, 60.0), (right, right, right, 0.0)
    hand = pcjax.HandDesign(500.0, (finger[0],) * 2, (finger[1],) * 2)
    found = pcjax.energy(hand, pcjax.Circle(20.0), tilts=12)
    close = found.landscape.tolerance
    assert climb(found, 0) == pytest.approx(400 - 20, abs=close)
    # Upside down from below the lid to below the tip's end.
    assert climb(found, 180) == pytest.approx((500 - 20) - (340 - 20), abs=close)


def test_where_the_ends_of_the_palm_are_apart_the_easier_one_counts() -> None:
    """Finger 2's tip hangs down to 40 above the palm: nothing gets out of what is behind it."""
    right = math.pi / 2
    hand = pcjax.HandDesign(
        500.0, ((400.0, 100.0), (500.0, 120.0, 460.0)), ((right, 0.0), (right, right, right))
    )
    found = pcjax.energy(hand, CIRCLE, tilts=12)
    assert len(found.landscape.sides) == 2
    # The goal line rises from (-250, 400) to (130, 500).
    lowest = 400 + 100 * 25 / 380
    assert climb(found, 0) == pytest.approx(lowest - 25, abs=found.landscape.tolerance)
    assert found.at(0.0).from_start == pytest.approx(lowest - 50, abs=found.landscape.tolerance)


# -------------------------------------------------------------------------------- a fine grid


Pixels = Float[np.ndarray, "rows columns"]


class Grid:
    """Pixels of a hand, and levels up to which they hang together."""

    def __init__(self, scenario: pcjax.Scenario, cells: int):
        hand = jax.tree.map(float, scenario.hand)
        corners = hand.region()
        ends = np.array([[corner.x, corner.y] for corner in corners])
        low, high = ends.min(axis=0), ends.max(axis=0)
        self.spacing = float((high - low).max()) / cells
        lines = [
            np.arange(a - 2 * self.spacing, b + 2 * self.spacing, self.spacing)
            for a, b in zip(low, high, strict=True)
        ]
        self.x, self.y = np.meshgrid(*lines)
        at = Vec(self.x, self.y)
        self.away = np.min([_distance(limb, at) for limb in hand.limbs()], axis=0)
        goal = hand.goal()
        self.exit = _distance(segment_between(goal.a, goal.b), at) <= self.reach
        self.inside = np.asarray(is_inside(corners, at)) | self.exit

    @property
    def reach(self) -> float:
        """How far a point may be from the nearest pixel's middle."""
        return self.spacing / math.sqrt(2)

    def levels(self, radius: float, tilt: float) -> tuple[Pixels, Pixels]:
        """Heights, and the least level up to which each place hangs together with the goal line:
        infinite where it is not free, or there is no way."""
        free = self.inside & (self.away >= radius)
        height = self.y * math.cos(tilt) - self.x * math.sin(tilt)
        level, before = np.where(free & self.exit, height, np.inf), None
        while before is None or not np.array_equal(level, before):
            before = level
            around = ndimage.minimum_filter(level, 3, mode="constant", cval=np.inf)
            level = np.minimum(level, np.where(free, np.maximum(around, height), np.inf))
        return height, level

    def nearest(self, free: Bool[np.ndarray, "rows columns"], place: np.ndarray) -> Any:
        """The pixel of some that is nearest to a place."""
        off = np.where(free, np.hypot(self.x - place[0], self.y - place[1]), np.inf)
        return np.unravel_index(np.argmin(off), off.shape)


def _distance(segment: Segment, at: Vec) -> Float[np.ndarray, "rows columns"]:
    return np.asarray(segment.distance(at))


def test_random_hands_have_the_watersheds_of_a_fine_grid() -> None:
    """50 hands, at a tilt each. A way of a circle that is half a pixel's diagonal smaller goes
    along pixels no more than that higher than the circle's own, and pixels that are free for one
    that is as much larger are a way of its own."""
    rng, seen, sharp = np.random.default_rng(1), 0, 0
    for case in fuzz.random_cases(150, 11):
        scenario = case.scenario
        radius = float(scenario.contact_radius)
        grid = Grid(scenario, 140)
        if radius < 2 * grid.spacing or seen == 50:
            continue
        seen += 1
        tilt = float(rng.uniform(-math.pi, math.pi))
        landscape = energy_of(scenario, 4).landscape
        down = np.array([math.sin(tilt), -math.cos(tilt)])
        out = landscape.climb(down)
        slack = grid.reach + landscape.tolerance
        (height, low), (_, high) = (
            grid.levels(radius + by, tilt) for by in (-grid.reach, grid.reach)
        )
        easier, harder = np.isfinite(low), np.isfinite(high)
        # Of each start: the climb from it, and the deepest of what the larger circle reaches.
        starts = [np.array(_middle(scenario, end), float) for end in (0.25, 0.75)]
        least = [low[grid.nearest(easier, start)] + start @ down for start in starts]
        most = [high[grid.nearest(easier, start)] + start @ down for start in starts]
        assert min(least) - slack <= out.from_start <= min(most) + 2 * slack
        sharp += min(most) - min(least) < 6 * grid.spacing
        parts: Any = ndimage.label(
            grid.inside & (grid.away >= radius + grid.reach), np.ones((3, 3))
        )
        deep = []
        for start in starts:
            mine = parts[0] == parts[0][grid.nearest(parts[0] > 0, start)]
            deep.append(float(np.max(low[mine] - height[mine])))
        assert out.from_rest >= min(deep) - slack
        # And from there it is no more: the larger circle has a way from close by.
        near = grid.nearest(harder, out.rest)
        aside = math.hypot(grid.x[near] - out.rest[0], grid.y[near] - out.rest[1])
        if aside < 4 * grid.spacing:
            sharp += 1
            assert out.from_rest <= high[near] + out.rest @ down + aside + slack
    assert seen == 50
    assert sharp > 60


def _middle(scenario: pcjax.Scenario, end: float = 0.25) -> tuple[Any, Any]:
    middle = jax.tree.map(float, scenario).start([end, 0.5, 0.5])
    return middle.x, middle.y


# ------------------------------------------------------------------------------- thrown objects


def escapes(
    tip: float, body: pcjax.Body, shares: Float[np.ndarray, " throws"], seconds: int = 50
) -> Bool[np.ndarray, " throws"]:
    """Which objects get out in that time that are thrown up from where they lie deepest with that
    share of the energy that the climb takes, and lose none in impacts."""
    law = pcjax.ContactLaw(restitution=1.0)
    scenario = pcjax.does(pcjax.box_hand(tip), body, pcjax.WristTilt(), law)
    found = energy_of(scenario, 4)
    out = (found.at_least or found).at(0.0)
    with jax.enable_x64(True):
        drive: Any = scenario.drive
        draws = jnp.array([0.5, 1.0])  # T1 = 0, T2 = 30 deg
        profile = drive.profile(draws, draws, jnp.asarray(False))
        pull = 9.8 * math.sin(math.radians(30))
        world, dt = scenario.world(), 0.01

        def one(angle: jax.Array, share: jax.Array) -> jax.Array:
            speed = jnp.sqrt(2 * pull * out.from_rest * share)
            start = replace(
                at_rest(Vec(*jnp.asarray(out.rest)), jnp.asarray(out.rest_angle)),
                velocity=Vec(speed * jnp.cos(angle), speed * jnp.sin(angle)),
            )

            def step(state: Any, _: None) -> tuple[Any, None]:
                # The tilt is held all the while.
                state = replace(state, clock=jnp.asarray(500, state.clock.dtype))
                return advance(world, profile, state, dt), None

            return jax.lax.scan(step, start, length=100 * seconds)[0].status

        angles = np.linspace(0.3, math.pi - 0.3, len(shares))
        status = jax.jit(jax.vmap(one))(jnp.asarray(angles), jnp.asarray(shares))
        return np.asarray(status) == PASSED


@pytest.mark.parametrize("tip", [0.0, -0.5])
def test_objects_thrown_with_less_energy_stay_and_some_with_more_get_out(tip: float) -> None:
    assert not escapes(tip, CIRCLE, np.full(64, 0.99)).any()
    assert escapes(tip, CIRCLE, np.full(64, 1.2)).any()


def test_squares_thrown_with_less_energy_than_they_need_at_least_stay() -> None:
    square = pcjax.Square(50.0)
    found = escapes(0.0, square, np.repeat([0.99, 1.3], 32), 20)
    assert not found[:32].any()
    assert found[32:].any()


# ------------------------------------------------------------------------------------- drives


def test_tilts_that_the_wrist_holds_are_spread_as_its_targets_are() -> None:
    found = pcjax.energy(pcjax.box_hand(), CIRCLE, tilts=4)
    assert np.hypot(*found.begins) == pytest.approx(0.0, abs=1e-12)
    assert found.begins_at == 0.0
    # T ~ U(-a, a): the mean of sin^2 is 1/2 - sin(2 a) / (4 a), that of cos^2 the rest to 1.
    a = math.pi / 6
    square = 0.5 - math.sin(2 * a) / (4 * a)
    np.testing.assert_allclose(
        np.mean(found.held**2, axis=0), [square, (1 - square) * square], rtol=1e-3
    )


def test_gravity_in_a_hand_that_an_arm_carries() -> None:
    """At rest its last link points 45 deg up from the world's -y, so that the hand hangs over."""
    hand, arm = pcjax.two_joint_hand(), pcjax.PlanarArm()
    found = pcjax.energy(hand, pcjax.Circle(50.0), drive=arm, tilts=4)
    np.testing.assert_allclose(found.begins, [math.sqrt(0.5), math.sqrt(0.5)])
    assert math.degrees(found.begins_at) == pytest.approx(135.0)
    # Headings of the hand are uniform sums: from -90 - 45 to -90 + 135 deg.
    assert math.degrees(found.held_tilts.min() % (2 * math.pi)) >= 45 - 1e-6
    np.testing.assert_allclose(np.hypot(*found.held.T), 1.0)
    mirror = Mirror.along(Vec(0.0, 10.0), Vec(1.0, 0.0))
    seen = energy_of(pcjax.does(hand, pcjax.Circle(50.0), arm.mirrored(mirror)), 4)
    np.testing.assert_allclose(seen.begins, found.begins * [1, -1])
    np.testing.assert_allclose(seen.held, found.held * [1, -1], atol=1e-12)


def test_the_mean_counts_the_part_of_gravity_in_the_plane() -> None:
    """Small tilts turn as much of it there as they are large."""
    less, more = (
        pcjax.energy(
            pcjax.box_hand(),
            CIRCLE,
            drive=pcjax.WristTilt(amplitude=math.radians(largest)),
            tilts=72,
        )
        for largest in (0.1, 1.0)
    )
    assert more.mean == pytest.approx(10 * less.mean, rel=1e-3)
    assert more.mean_from_start == pytest.approx(10 * less.mean_from_start, rel=1e-3)


# ---------------------------------------------------------------------------------- the command

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Command:
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        code: Any = 0
        try:
            main(["energy", *words])
        except SystemExit as end:
            code = end.code
        said = capfd.readouterr()
        return code, said.out, said.err

    return run


def test_the_command_says_what_python_does(command: Command, tmp_path: Path) -> None:
    study = pcjax.Study(pcjax.box_hand(0.0), CIRCLE)
    (tmp_path / "study.toml").write_text(study.to_toml())
    code, out, err = command("study.toml", "--tilts", "24", "--json", "--plot", "energy.png",
                             "--at", "0", "90", "180")  # fmt: skip
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert imread(tmp_path / "energy.png").shape[0] > 800
    found = pcjax.energy_of_study(study, tilts=24)
    assert list(found) == ["does", "eoen"]
    for direction, one in found.items():
        assert told[direction] == json.loads(json.dumps(one.as_json()))
    assert told["units"] == "model"
    does = told["does"]
    assert does["from_rest"]["upright"] == pytest.approx(475.0)
    assert does["from_rest"]["least"]["tilt_deg"] == 180.0
    np.testing.assert_allclose(np.radians(does["opens_deg"]), found["does"].opens, atol=1e-8)
    code, out, err = command("study.toml", "--tilts", "24", "--direction", "does")
    assert (code, err) == (0, "")
    assert "EoEn" not in out
    for words in ("475", "450", "100 at 180 deg", "-58.6 and +58.6 deg", "model length"):
        assert words in out


def test_the_command_on_the_arm_and_of_a_square(command: Command, tmp_path: Path) -> None:
    _, out, _ = command("--scenario", "arm", "--tilts", "24", "--plot", "energy.svg")
    assert "as a trial begins, 135 deg" in out
    assert (tmp_path / "energy.svg").stat().st_size > 10_000
    _, out, _ = command("--body", "square", "--side", "60", "--tilts", "24", "--units", "mm",
                        "--palm-length", "500")  # fmt: skip
    for words in ("DoEs, at most", "DoEs, at least", "radius 30"):
        assert words in out
    assert ", mm;" in out


def test_the_command_says_that_a_cage_is_full(command: Command, tmp_path: Path) -> None:
    _, out, _ = command("--gap-width", "40", "--tilts", "12", "--plot", "energy.png")
    assert "full cage" in out
    assert imread(tmp_path / "energy.png").ndim == 3
    told = json.loads(command("--gap-width", "40", "--tilts", "12", "--json")[1])
    assert told["does"]["full_cage"]
    assert told["does"]["from_rest"]["mean"] is None
    assert told["does"]["opens_deg"] == [None, None]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--tilts", "3"], ["tilts is 3", "between 4 and"]),
        (["--orientations", "7"], ["orientations is 7", "between 8 and"]),
        (
            ["--body", "square", "--side", "40", "--turns", "no", "--orientation", "random"],
            ["does not turn", "give it one"],
        ),
        (["--tilts", "many"], ["--tilts", "not a whole number"]),
        (["--gravity", "0"], ["gravity is 0"]),
        (["--radius", "200"], ["does not fit"]),
        (["missing.toml"], ["missing.toml"]),
        (["--at", "90"], ["--at", "--plot"]),
        (["--at", "nan", "--plot", "energy.png"], ["--at is nan"]),
        (["--plot", "energy.doc"], ["energy.doc", ".png"]),
    ],
)
def test_bad_input_is_refused_in_a_line(
    command: Command, words: list[str], said: list[str]
) -> None:
    code, out, err = command(*words)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    for word in said:
        assert word in err


def test_a_drive_without_gravity_and_a_missing_package_are_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Still(pcjax.Drive):
        period = 1.0
        targets_per_period = 1

    with pytest.raises(ValueError, match="Still has no gravity"):
        pcjax.energy(pcjax.box_hand(), CIRCLE, drive=Still())
    with pytest.raises(ValueError, match="direction is 'both'"):
        pcjax.energy(pcjax.box_hand(), CIRCLE, direction="both")
    monkeypatch.setattr(slices, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"shapely: pip install 'pcjax\[energy\]'"):
        pcjax.energy(pcjax.box_hand(), CIRCLE)
