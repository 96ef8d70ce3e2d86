"""A scenario: one hand, object, drive and contact law, and where the object starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from pcjax.checks import check_between, check_kind
from pcjax.geometry import Scalar, Scalars, Segment, Vec
from pcjax.model.bodies.base import Body, Shape, placed_outline
from pcjax.model.checking import check_geometry, geometry_of
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import Drive
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import Goal, HandDesign
from pcjax.model.layout import (
    corner_centre,
    first_centre,
    geometries_of,
    geometry_of_hand,
    same_gap,
)


class World(eqx.Module):
    """What a step needs of a scenario, worked out once: limbs and goal in place of the design.

    Of the limbs after the palm the first `finger_1` are finger 1's. They are middle lines, and
    their surfaces are `half_thickness` off. The `shape` is that of a convex body.
    """

    limbs: tuple[Segment, ...]
    half_thickness: Scalars
    goal: Goal
    body: Body
    drive: Drive
    law: ContactLaw
    finger_1: int = eqx.field(static=True)
    shape: Shape | None = None

    @property
    def contact_radius(self) -> Scalar:
        """How far from a limb's middle line the centre of a circle is that touches it."""
        return self.body.radius + self.half_thickness

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

    dimensions: ClassVar[int] = 2

    filmed_by: ClassVar[str] = "view.animation.PlaneCamera"
    """The `Camera` that films trials of it, by its name: it is of a layer above."""

    @property
    def contact_radius(self) -> Scalar:
        """How far from a limb's middle line the centre of a circle of the object's radius is that
        touches it."""
        return self.body.radius + 0.5 * self.hand.thickness

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

    @property
    def draws_for_start(self) -> int:
        """How many draws a trial's first state takes: one more where the orientation is drawn."""
        return 4 if self.body.oriented and self.body.orientation is None else 3

    def world(self) -> World:
        """Forward kinematics and goal line, for `pcjax.physics.step.advance`."""
        return World(
            self.hand.limbs(),
            0.5 * self.hand.thickness,
            self.hand.goal(),
            self.body,
            self.drive,
            self.law,
            len(self.hand.lengths[0]),
            self.body.shape(),
        )

    def start(self, draws: Float[Array, "3"] | Sequence[float]) -> Vec:
        """The object's first centre, "near either end of the palm", from draws uniform on [0, 1).

        A stick starts where the circle that it can turn in does. That circle touches the palm and
        its first limb at one of the two ends (even chance), plus U(0, start_spread L_p) inwards
        along the palm and the same along the hand's axis. Where the first limb leans in, the circle
        is shifted along the palm so as to stay as far from it.
        """
        return first_centre(self.hand, self.contact_radius, self.start_spread, draws)

    def check(self) -> float:
        """Checks what is to be run, and returns the hand's gap; NaN where that is not known.

        Raises:
            ValueError: see `pcjax.model.checking.check_geometry`.
        """
        return check_geometry(self)

    def places(self) -> dict[str, np.ndarray]:
        """Where limbs, goal line, gap, start and object are, for pictures, for plain numbers; the
        `rounding` is the radius by which the object's corners are rounded. Nothing where a picture
        is made otherwise."""
        found = geometry_of(self)
        start = _numbers(found.start)
        corners, rounding = placed_outline(self.body, start)
        return {
            "limbs": np.array([_numbers(limb.start, limb.end) for limb in found.limbs]),
            "goal": _numbers(found.goal.a, found.goal.b),
            "passage": _numbers(*found.passage),
            "gap": np.array(found.gap, float),
            "start": start,
            "outline": corners,
            "rounding": np.array(rounding),
        }

    def sizes(self) -> dict[str, Any]:
        """Sizes of object and hand, as results keep them for plain numbers, and which file the hand
        is of where it is of one."""
        body = self.body
        sizes = {
            "radius": float(body.radius),
            "object_width": float(body.width),
            "least_passage": body.least_passage(),
            "thickness": float(self.hand.thickness),
        }
        # What one has to know of what has an angle: that at the start, and its skin.
        more = ("orientation", "skin") if body.oriented else ()
        known = {name: getattr(body, name, None) for name in more}
        return sizes | {name: float(number) for name, number in known.items() if number is not None}

    def corner_start(self) -> Vec:
        """The start closest to the corner at the palm's right end."""
        return corner_centre(self.hand, self.contact_radius, self.start_spread)


def _numbers(*points: Vec) -> np.ndarray:
    return np.array([number for point in points for number in (point.x, point.y)], float)


def check_kinds(hand: Any, body: Any, drive: Any, law: Any) -> None:
    """
    Raises:
        TypeError: one of them is something else, such as a number or a class.
    """
    check_kind("hand", hand, HandDesign)
    check_kind("body", body, Body)
    check_kind("drive", drive, Drive)
    check_kind("law", law, ContactLaw)


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
    their joints, and the drive and the object mirrored along. The object's orientation is that in
    the mirror.

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
    check_kind("body", body, Body)
    return Scenario(hand.with_fingertips_mirrored(), body.mirrored(), mirrored, law, start_spread)


def why_no_eoen(hand: HandDesign) -> str:
    """Why ease of entering is not defined for a hand; "" where it is, or its numbers are traced."""
    if min(len(lengths) for lengths in hand.lengths) < 2:
        return "with one limb a finger only the palm is left to confine an object outside"
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(hand)):
        return ""
    inside, outside = (
        geometry_of_hand(one, 0.0, 0.0) for one in (hand, hand.with_fingertips_mirrored())
    )
    gap, mirrored = inside.gap, outside.gap
    for (a, b), crossed in outside.crossings.items():
        if crossed:
            return f"seen from outside {b} crosses {a}"
    if not same_gap(gap, mirrored, hand.thickness):
        return (
            f"a fingertip is {min(gap, mirrored):.4g} from another limb than the other fingertip, "
            f"so that the gap is {gap:.4g} for escaping and would be {mirrored:.4g} for entering"
        )
    return ""


def look_at(hands: Sequence[HandDesign]) -> None:
    """Works out at once what `why_no_eoen` has to know of many hands, and keeps it."""
    geometries_of([(one, 0.0, 0.0) for h in hands for one in (h, h.with_fingertips_mirrored())])


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
