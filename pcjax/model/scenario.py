"""A scenario: one hand, object, drive and contact law, and where the object starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from pcjax.checks import check_between, check_kind
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
from pcjax.model.bodies.base import Body
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import Drive
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import Goal, HandDesign


class World(eqx.Module):
    """What a step needs of a scenario, worked out once: limbs and goal in place of the design.

    Of the limbs after the palm the first `finger_1` are finger 1's.
    """

    limbs: tuple[Segment, ...]
    goal: Goal
    body: Body
    drive: Drive
    law: ContactLaw
    finger_1: int = eqx.field(static=True)

    def nearness(self) -> Scalar:
        """A distance that rounding may hide: within it the object touches a limb or a line."""
        length = self.limbs[0].length
        return length * max(16 * float(jnp.finfo(jnp.result_type(length)).eps), 1e-8)


class Scenario(eqx.Module):
    """One condition: everything but the random draws, the step limit and the solver's step.

    The hand is the one that is simulated; `does` and `eoen` make it from a design.

    Arguments:
        hand: as simulated.
        body: the object.
        drive: what moves the hand; the paper's wrist unless given.
        law: contact law; the paper's unless given.
        start_spread: spread of the starts near the palm's ends, in palm lengths, 0 to 1.

    Raises:
        ValueError: a start spread out of range.
        TypeError: something that is no hand, body, drive or contact law.

    Examples:
        >>> import jax.numpy as jnp, pcjax
        >>> scenario = pcjax.Scenario(pcjax.box_hand(), pcjax.Circle(25.0))
        >>> start = scenario.start(jnp.array([0.0, 0.0, 0.0]))  # in the left corner
        >>> print(f"{start.x:.1f} {start.y:.1f}")
        -225.0 25.0
    """

    hand: HandDesign
    body: Body
    drive: Drive
    law: ContactLaw
    start_spread: Scalar

    draws_for_start = 3

    def __init__(
        self,
        hand: HandDesign,
        body: Body,
        drive: Drive | None = None,
        law: ContactLaw | None = None,
        start_spread: Scalar = 0.1,
    ):
        drive = WristTilt() if drive is None else drive
        law = ContactLaw() if law is None else law
        check_kinds(hand, body, drive, law)
        check_between("start_spread", start_spread, 0.0, 1.0)
        self.hand = hand
        self.body = body
        self.drive = drive
        self.law = law
        self.start_spread = start_spread

    def world(self) -> World:
        """Forward kinematics and goal line, for `pcjax.physics.step.advance`."""
        return World(
            self.hand.limbs(),
            self.hand.goal(),
            self.body,
            self.drive,
            self.law,
            len(self.hand.lengths[0]),
        )

    def start(self, draws: Float[Array, "3"]) -> Vec:
        """The object's first centre, "near either end of the palm", from draws uniform on [0, 1).

        A stick starts where the circle that it can turn in does. That circle touches the palm and
        its first limb at one of the two ends (even chance), plus U(0, start_spread L_p) inwards
        along the palm and the same along the hand's axis. Where the first limb leans in, the circle
        is shifted along the palm so as to stay as far from it.
        """
        return _start(self.hand, self.body.radius, self.start_spread, draws)

    def corner_start(self) -> Vec:
        """The start closest to the corner at the palm's right end."""
        return _corner_start(self.hand, self.body.radius, self.start_spread)

    def fit(self) -> Fit:
        """Whether its starts are where they have to be; for numbers that may be traced."""
        return _fit(self.hand, self.body.radius, self.start_spread)


def _start(hand: HandDesign, radius: Scalar, start_spread: Scalar, draws: Array) -> Vec:
    left = draws[0] < 0.5
    spread = start_spread * hand.palm_length
    side = jnp.where(left, -1.0, 1.0)
    corner = jnp.where(left, *(_corner_inset(finger[0], radius) for finger in hand.angles))
    lean = jnp.where(left, *(_lean(finger[0]) for finger in hand.angles))
    up = draws[2] * spread
    x = side * (hand.palm_length / 2 - corner - draws[1] * spread - lean * up)
    return Vec(x, radius + up)


def _corner_start(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Vec:
    return _start(hand, radius, start_spread, jnp.array([0.9, 0.0, 0.0]))


def _corner_inset(angle: Scalar, radius: Scalar) -> Scalar:
    # The circle's centre lies on the bisector of the corner between palm and first limb.
    return radius * jnp.tan(angle / 2)


def _lean(angle: Scalar) -> Scalar:
    # How far the first limb comes in for each unit of height; a right angle is none.
    rise = jnp.sin(angle)
    leans = (jnp.cos(angle) < -1e-6) & (rise > 0)
    return jnp.where(leans, -jnp.cos(angle) / jnp.where(leans, rise, 1.0), 0.0)


def _fit(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Fit:
    corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    draws = jnp.array([[[end, *corner] for end in (0.0, 0.9)] for corner in corners])
    boxes = jax.vmap(jax.vmap(lambda one: _start(hand, radius, start_spread, one)))(draws)
    boxes = [jax.tree.map(lambda x, k=k: x[k], boxes) for k in range(len(corners))]
    goal, region = hand.goal(), hand.region()
    each = jax.vmap(_distance_to_box, (0, None))
    least = jnp.min(jax.vmap(each, (None, 0))(stacked(hand.limbs()), boxes))
    crossed = jax.vmap(_distance_to_box, (None, 0))(segment_between(goal.a, goal.b), boxes)
    outside = jnp.any((crossed <= 0.0) | jnp.logical_not(is_inside(region, boxes[0])))
    return Fit(least - radius, outside)


def check_kinds(hand: Any, body: Any, drive: Any, law: Any) -> None:
    """
    Raises:
        TypeError: one of them is something else, such as a number or a class.
    """
    check_kind("hand", hand, HandDesign)
    check_kind("body", body, Body)
    check_kind("drive", drive, Drive)
    check_kind("law", law, ContactLaw)


class Fit(eqx.Module):
    """How the object fits at its starts.

    Attributes:
        clearance: least distance between the circle and a limb over all starts; negative: it does
            not fit.
        outside: whether some start is not inside what limbs and goal line enclose.
    """

    clearance: Scalar
    outside: Flag


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
        _fit(hand, radius, start_spread),
        hand.gap(),
        hand.crossings(),
        hand.faces(),
        hand.blocked_goal(),
        hand.limbs(),
        hand.goal(),
        hand.narrowest_passage(),
        _corner_start(hand, radius, start_spread),
    )


def is_hand(hand: HandDesign, directions: Sequence[str]) -> Flag:
    """Whether a hand is one in these directions: no limbs cross, the fingertips face each other
    across a free goal line, and it has EoEn if that is asked for. The numbers may be traced."""
    seen = {"does": hand}
    if "eoen" in directions:
        seen["eoen"] = hand.with_fingertips_mirrored()
    good = jnp.asarray(True)
    for direction in directions:
        one = seen[direction]
        crossed = jnp.any(jnp.array(list(one.crossings().values())))
        good = good & one.faces() & jnp.logical_not(one.blocked_goal() | crossed)
    return good & same_gap(hand.gap(), seen[directions[-1]].gap())


def fits(scenario: Scenario) -> Flag:
    """Whether the object fits at its starts, and they are inside the hand; may be traced."""
    fit = scenario.fit()
    return (fit.clearance >= _slack(scenario)) & jnp.logical_not(fit.outside)


def _slack(scenario: Scenario) -> Scalar:
    return -1e-9 * scenario.hand.palm_length


def check_geometry(scenario: Scenario) -> float:
    """Checks a scenario whose numbers are concrete and returns the hand's gap.

    Raises:
        ValueError: limbs that cross each other or the palm, fingertips that have swapped sides, a
            limb that cuts the goal line, an object that does not fit at one of its starts, or a
            start that is not inside what limbs and goal line enclose.
    """
    found = geometry_of(scenario)
    for (a, b), crossed in found.crossings.items():
        if crossed:
            raise ValueError(
                f"{b} crosses {a}: limbs may touch but not cross; shorten it or change its angle"
            )
    if not found.faces:
        raise ValueError(
            "the fingertips have swapped sides: finger 1's has to stay on the left of finger 2's "
            "for there to be a gap between them; shorten a limb or change a joint angle"
        )
    if found.blocked:
        raise ValueError(
            "a limb cuts the goal line between the fingertips, so nothing tells inside from "
            "outside; shorten it or change a joint angle"
        )
    if found.fit.clearance < _slack(scenario):
        raise ValueError(
            f"the {scenario.body.noun} {float(scenario.body.radius):g} does not fit at its start "
            f"near the palm's ends (it overlaps a limb by {-found.fit.clearance:.3g}): "
            + _advice(scenario)
        )
    if found.fit.outside:
        raise ValueError(
            "the object would start beyond the goal line, outside of what the hand encloses: "
            + _advice(scenario)
        )
    return float(found.gap)


def geometry_of(scenario: Scenario) -> Geometry:
    """What a scenario looks like whose numbers are concrete, in 64 bits."""
    return _seen(scenario.hand, scenario.body.radius, scenario.start_spread)


def _seen(hand: HandDesign, radius: Scalar, start_spread: Scalar) -> Geometry:
    with jax.enable_x64(True):
        return jax.device_get(_geometry(*jax.tree.map(float, (hand, radius, start_spread))))


def _advice(scenario: Scenario) -> str:
    """What would let the object start inside the hand, found by trying."""

    def starts(spread: float, shrunk: float = 1.0) -> bool:
        body = scenario.body if shrunk == 1.0 else scenario.body.scaled(shrunk)
        other = replace(scenario, body=body, start_spread=spread)
        fit = geometry_of(other).fit
        return bool(fit.clearance >= _slack(other) and not fit.outside)

    spread = float(scenario.start_spread)
    tried = [spread * (1 - k / 20) for k in range(1, 21)]
    fitting = next((share for share in tried if starts(share)), None)
    if fitting is not None:
        return f"start_spread (now {spread:g}) has to be {fitting:.3g} or less"
    if starts(0.0, 1e-3):
        return "take a smaller object, and a smaller start_spread; start_spread alone does not help"
    return "change the joint angles; no object and no start_spread would do"


def gap_of(scenario: Scenario) -> float:
    """The hand's gap, for a scenario whose numbers are concrete."""
    return float(geometry_of(scenario).gap)


def does(
    hand: HandDesign,
    body: Body,
    drive: Drive | None = None,
    law: ContactLaw | None = None,
    start_spread: Scalar = 0.1,
) -> Scenario:
    """Difficulty of escaping (Fig. 8(a)): the hand as it is, the object inside.

    Its arguments are those of `Scenario`.

    Examples:
        >>> import pcjax
        >>> scenario = pcjax.does(pcjax.box_hand(0.0), pcjax.Circle(25.0))
        >>> print(f"{scenario.hand.goal().a.y:.1f}")  # the line between the tip joints
        500.0
    """
    return Scenario(hand, body, drive, law, start_spread)


def eoen(
    hand: HandDesign,
    body: Body,
    drive: Drive | None = None,
    law: ContactLaw | None = None,
    start_spread: Scalar = 0.1,
) -> Scenario:
    """Ease of entering (Fig. 8(b)): the object has to pass the fingertips from their back.

    It is outside but virtually confined, in a box that mirrors the hand's body. The scenario is
    that seen in the mirror: the hand's body, with both fingertips mirrored across the line through
    their joints, and the drive mirrored along.

    Raises:
        ValueError: a hand without EoEn, see `why_no_eoen`. Traced numbers are not checked.

    Examples:
        >>> import pcjax
        >>> scenario = pcjax.eoen(pcjax.box_hand(0.0), pcjax.Circle(25.0))
        >>> print(f"{scenario.hand.goal().a.y:.1f}")  # the line between the fingertips' ends
        600.0
    """
    problem = why_no_eoen(hand)
    if problem:
        raise ValueError(
            f"EoEn is not defined for this hand: {problem}; evaluate with direction 'does'"
        )
    drive = WristTilt() if drive is None else drive
    mirrored = drive.mirrored(hand.tip_mirror())
    return Scenario(hand.with_fingertips_mirrored(), body, mirrored, law, start_spread)


def why_no_eoen(hand: HandDesign) -> str:
    """Why ease of entering is not defined for a hand; "" where it is, or its numbers are traced."""
    if min(len(lengths) for lengths in hand.lengths) < 2:
        return "with one limb a finger only the palm is left to confine an object outside"
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(hand)):
        return ""
    inside, outside = (_seen(one, 0.0, 0.0) for one in (hand, hand.with_fingertips_mirrored()))
    gap, mirrored = inside.gap, outside.gap
    for (a, b), crossed in outside.crossings.items():
        if crossed:
            return f"seen from outside {b} crosses {a}"
    if not same_gap(gap, mirrored):
        return (
            f"a fingertip is {min(gap, mirrored):.4g} from another limb than the other fingertip, "
            f"so that the gap is {gap:.4g} for escaping and would be {mirrored:.4g} for entering"
        )
    return ""


def same_gap(gap: Any, other: Any) -> Any:
    """Whether two gaps are the same number, but for rounding."""
    return abs(gap - other) <= 1e-9 * (gap + other)


def usual_max_steps(body: Body, drive: Drive) -> int:
    """The limit in steps of 0.001 s unless one is given; the paper's for what is in the paper."""
    return body.usual_max_steps or drive.usual_max_steps


def default_direction(hand: HandDesign, drive: Drive) -> tuple[str, str]:
    """What is evaluated unless a direction is asked for, and why EoEn is not, if so: both where the
    hand has both; in a hand that an arm carries DoEs alone, as in the paper (Sec. 3.6)."""
    missing = why_no_eoen(hand)
    return ("does" if missing else drive.usual_directions), missing


DIRECTIONS = {"does": does, "eoen": eoen}
"""How each direction's scenario is made from a design."""
