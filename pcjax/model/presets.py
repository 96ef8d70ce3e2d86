"""Hands by a few numbers: the paper's, and those that others register."""

from __future__ import annotations

import math
from typing import Any

from pcjax.checks import check_positive, check_radians
from pcjax.components import Component, Registry, quantity
from pcjax.geometry import Scalar
from pcjax.model.hand import HandDesign

HANDS: Registry[Preset] = Registry("hand", "pcjax.hands")
"""The hands that study files and flags can name."""

register_hand = HANDS.register


def _length(help: str, default: Any = None, **more: Any) -> Any:
    return quantity("length", help, default=default, low=0, above=True, **more)


def thickness_field() -> Any:
    """The thickness of a hand's limbs."""
    return quantity(
        "length",
        "thickness of palm and limbs, half of it on either side of their middle lines",
        default=0.0,
        low=0,
        key="thickness",
        flag="thickness",
    )


class Preset(Component):
    """A hand by a few numbers."""

    def design(self) -> HandDesign:
        """The hand.

        Raises:
            ValueError: the numbers make none.
        """
        raise NotImplementedError


@register_hand("box")
class BoxHand(Preset):
    """The box-shaped hand of Sec. 3.3; see `box_hand`."""

    palm_length: Scalar = _length("L_p", default=500.0, key="palm_length", flag="palm-length")
    fingertip_angle: Scalar = quantity(
        "angle",
        "theta_g (21); 0 points the fingertips at the palm, positive angles close the gate",
        default=math.pi / 18,
        key="fingertip_angle",
        flag="fingertip-angle",
    )
    fingertip_length: Scalar | None = _length(
        "L_g (19)", key="fingertip_length", flag="fingertip-length", usual="0.2 L_p"
    )
    gap_width: Scalar | None = _length(
        "W_g (20), between the fingertips' joints",
        key="gap_width",
        flag="gap-width",
        usual="0.4 L_p",
    )
    side_length: Scalar | None = _length(
        "L_11 = L_21", key="side_length", flag="side-length", usual="L_p"
    )
    thickness: Scalar = thickness_field()

    def design(self) -> HandDesign:
        """Side, lid and fingertip on either side of the palm."""
        palm = self.palm_length
        gap = 0.4 * palm if self.gap_width is None else self.gap_width
        tip = 0.2 * palm if self.fingertip_length is None else self.fingertip_length
        side = palm if self.side_length is None else self.side_length
        lid = (palm - gap) / 2
        check_positive("lid length (palm_length - gap_width) / 2", lid)
        lengths, right = (side, lid, tip), math.pi / 2
        angles = (right, right, right - self.fingertip_angle)  # (21)
        return HandDesign(palm, (lengths, lengths), (angles, angles), self.thickness)


@register_hand("two-joint")
class TwoJointHand(Preset):
    """The hand of Sec. 3.6; see `two_joint_hand`."""

    palm_length: Scalar = _length("L_p", default=200.0, key="palm_length", flag="palm-length")
    joint_angles: tuple[Scalar, Scalar] = quantity(
        "angle",
        "theta_i1, between palm and first limbs, and theta_i2",
        default=(13 / 36 * math.pi, math.pi / 2),
        count=2,
        each="joint",
        key="joint_angles",
        flag="joint-angles",
    )
    link_lengths: tuple[Scalar, Scalar] = _length(
        "L_i1 and L_i2",
        default=(200.0, 100.0),
        count=2,
        each="limb",
        key="link_lengths",
        flag="link-lengths",
    )
    thickness: Scalar = thickness_field()

    def design(self) -> HandDesign:
        """Two limbs on either side of the palm, both fingers alike."""
        lengths, angles = tuple(self.link_lengths), tuple(self.joint_angles)
        return HandDesign(self.palm_length, (lengths, lengths), (angles, angles), self.thickness)


def box_hand(
    fingertip_angle: Scalar = math.pi / 18,
    *,
    palm_length: Scalar = 500.0,
    gap_width: Scalar | None = None,
    fingertip_length: Scalar | None = None,
    side_length: Scalar | None = None,
    thickness: Scalar = 0.0,
) -> HandDesign:
    """The box-shaped hand of Sec. 3.3: side, lid and fingertip on either side of the palm.

    Arguments:
        fingertip_angle: theta_g (21) in radians; 0 points the fingertips straight at the palm,
            positive angles close the gate.
        palm_length: L_p.
        gap_width: W_g (20), between the fingertips' joints; 0.4 L_p unless given.
        fingertip_length: L_g (19); 0.2 L_p unless given.
        side_length: L_11 = L_21; L_p unless given.
        thickness: of palm and limbs, half of it on either side of their middle lines.

    Raises:
        ValueError: a length that is not positive, a thickness below 0, or a gap as wide as the palm
            or wider.

    Examples:
        >>> import math, pcjax
        >>> hand = pcjax.box_hand(math.radians(30))
        >>> round(float(hand.gap()), 3)  # W_g - 2 L_g sin(theta_g) = 200 - 2 * 100 / 2
        100.0
    """
    check_radians({"fingertip_angle": fingertip_angle})
    return BoxHand(
        palm_length=palm_length,
        fingertip_angle=fingertip_angle,
        fingertip_length=fingertip_length,
        gap_width=gap_width,
        side_length=side_length,
        thickness=thickness,
    ).design()


def two_joint_hand(
    theta_1: Scalar = 13 / 36 * math.pi,
    theta_2: Scalar = math.pi / 2,
    *,
    palm_length: Scalar = 200.0,
    lengths: tuple[Scalar, Scalar] = (200.0, 100.0),
    thickness: Scalar = 0.0,
) -> HandDesign:
    """The hand of Sec. 3.6: two limbs on either side of the palm, both fingers alike.

    Arguments:
        theta_1: theta_11 = theta_21, between palm and first limbs, radians.
        theta_2: theta_12 = theta_22, between first limbs and fingertips, radians.
        palm_length: L_p.
        lengths: L_i1 and L_i2.
        thickness: of palm and limbs, half of it on either side of their middle lines.

    Raises:
        ValueError: a length that is not positive, a thickness below 0, or an angle that is not
            finite.

    Examples:
        >>> import math, pcjax
        >>> hand = pcjax.two_joint_hand(math.radians(90), math.radians(90))
        >>> [round(float(limb.end.y), 1) for limb in hand.finger(0)]
        [200.0, 200.0]
    """
    check_radians({"theta_1": theta_1, "theta_2": theta_2})
    return TwoJointHand(palm_length, (theta_1, theta_2), lengths, thickness).design()
