"""A scenario: one hand, object, drive and contact law, and where the object starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pcjax.checks import check_between
from pcjax.model.body import Body, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import Drive, WristTilt
from pcjax.model.hand import Goal, HandDesign
from pcjax.planar import Flag, Scalar, Segment, T, Vec


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
        check_between("start_spread", start_spread, 0.0, 1.0)
        self.hand = hand
        self.body = body
        self.drive = WristTilt() if drive is None else drive
        self.law = ContactLaw() if law is None else law
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
        along the palm and the same along the hand's axis.
        """
        left = draws[0] < 0.5
        spread = self.start_spread * self.hand.palm_length
        side = jnp.where(left, -1.0, 1.0)
        corner = jnp.where(left, self._corner_inset(0), self._corner_inset(1))
        x = side * (self.hand.palm_length / 2 - corner - draws[1] * spread)
        return Vec(x, self.body.radius + draws[2] * spread)

    def corner_start(self) -> Vec:
        """The start closest to the corner at the palm's right end."""
        return self.start(jnp.array([0.9, 0.0, 0.0]))

    def _corner_inset(self, finger: int) -> Scalar:
        # The circle's centre lies on the bisector of the corner between palm and first limb.
        return self.body.radius * jnp.tan(self.hand.angles[finger][0] / 2)

    def start_clearance(self) -> Scalar:
        """Least distance between the circle and a limb over all starts; negative: does not fit."""
        corners = [
            self.start(jnp.array([end, along, up]))
            for end in (0.0, 0.9)
            for along in (0.0, 1.0)
            for up in (0.0, 1.0)
        ]
        ends = ((0, 1), (0, 2), (1, 3), (2, 3), (4, 5), (4, 6), (5, 7), (6, 7))
        limbs = _stacked(self.hand.limbs())
        # A limb comes closest to a rectangle at a corner of one or at an end of the other, unless
        # it cuts through; then it cuts an edge or has an end inside.
        least = jnp.min(_each_with_each(Segment.distance)(limbs, _stacked(corners)))
        for point in (limbs.start, limbs.end):
            for first in (0, 4):
                apart = _distance_to_box(point, corners[first], corners[first + 3])
                least = jnp.minimum(least, jnp.min(apart))
        edges = [_stacked([corners[pair[k]] for pair in ends]) for k in (0, 1)]
        cut = _each_with_each(lambda limb, edge: _cuts(limb, *edge))(limbs, tuple(edges))
        return jnp.where(jnp.any(cut), 0.0, least) - self.body.radius


def _stacked(items: Sequence[T]) -> T:
    """One pytree with the items along a first axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *items)


def _each_with_each(function: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """For a batch of first arguments and one of second ones, all pairs."""
    return jax.vmap(jax.vmap(function, (None, 0)), (0, None))


def _distance_to_box(point: Vec, a: Vec, b: Vec) -> Scalar:
    """Distance from a point to the filled box with opposite corners a and b."""
    dx = point.x - jnp.clip(point.x, jnp.minimum(a.x, b.x), jnp.maximum(a.x, b.x))
    dy = point.y - jnp.clip(point.y, jnp.minimum(a.y, b.y), jnp.maximum(a.y, b.y))
    return jnp.sqrt(dx * dx + dy * dy)


def _cuts(limb: Segment, a: Vec, b: Vec) -> Flag:
    """Whether a limb cuts the line from a to b."""
    along = b - a
    by_limb = limb.tangent.cross(a - limb.start) * limb.tangent.cross(b - limb.start) < 0
    by_line = along.cross(limb.start - a) * along.cross(limb.end - a) < 0
    return by_limb & by_line


@jax.jit
def _geometry(scenario: Scenario) -> tuple[Scalar, Scalar, dict[tuple[str, str], Flag]]:
    return scenario.start_clearance(), scenario.hand.gap(), scenario.hand.crossings()


def check_geometry(scenario: Scenario) -> float:
    """Checks a scenario whose numbers are concrete and returns the hand's gap.

    Raises:
        ValueError: limbs that cross each other or the palm, or an object that does not fit at one
            of its starts.
    """
    with jax.enable_x64(True):
        clearance, gap, crossings = jax.device_get(_geometry(scenario))
    for (a, b), crossed in crossings.items():
        if crossed:
            raise ValueError(
                f"{b} crosses {a}: limbs may touch but not cross; shorten it or change its angle"
            )
    if clearance < -1e-9 * float(scenario.hand.palm_length):
        shape = "stick of half length" if isinstance(scenario.body, Stick) else "circle of radius"
        raise ValueError(
            f"the {shape} {float(scenario.body.radius):g} does not fit at its start "
            f"near the palm's ends (it overlaps a limb by {-clearance:.3g}): "
            "a smaller one or a smaller start spread fits"
        )
    return float(gap)


def gap_of(scenario: Scenario) -> float:
    """The hand's gap, for a scenario whose numbers are concrete."""
    with jax.enable_x64(True):
        return float(_geometry(scenario)[1])


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

    It is outside but virtually confined: the same box, the fingertips turned to the other side.

    Raises:
        ValueError: a finger with fewer than three limbs, which leaves no box.

    Examples:
        >>> import pcjax
        >>> scenario = pcjax.eoen(pcjax.box_hand(0.0), pcjax.Circle(25.0))
        >>> print(f"{scenario.hand.goal().a.y:.1f}")  # the line between the fingertips' ends
        600.0
    """
    if not hand.can_turn_fingertips():
        raise ValueError(
            "EoEn needs a hand with three limbs or more a finger: with two, turned fingertips "
            "leave an open hand that confines nothing; evaluate with direction 'does'"
        )
    return Scenario(hand.with_fingertips_turned(), body, drive, law, start_spread)


DIRECTIONS = {"does": does, "eoen": eoen}
"""How each direction's scenario is made from a design."""
