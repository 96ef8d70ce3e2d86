"""The hand as SVG, in its own lengths with y up the page; colours are the page's."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from pcjax.model.bodies.base import Body, placed_outline
from pcjax.model.hand import HandDesign, points_of
from pcjax.model.scenario import Scenario
from pcjax.view.shapes import rounded
from pcjax.view.web.dials import joints_of

Points = Float[np.ndarray, "points 2"]


@dataclass(frozen=True)
class Frame:
    """What part of the plane is seen: its left and lower edge and its sides."""

    x: float
    y: float
    width: float
    height: float

    @property
    def view_box(self) -> str:
        """As SVG has it, where y goes down."""
        return f"{self.x:.6g} {-self.y - self.height:.6g} {self.width:.6g} {self.height:.6g}"

    @property
    def size(self) -> float:
        """A length that marks and letters go by."""
        return max(self.width, self.height)


def frame_of(hand: HandDesign, *, both: bool) -> Frame:
    """What shows a hand in one or both of its directions, with room to drag."""
    hands = [hand, hand.with_fingertips_mirrored()] if both else [hand]
    corners = np.concatenate([np.concatenate(joints_of(hand)) for hand in hands])
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.14 * float(np.max(high - low)) + float(hand.thickness)
    low, high = low - room, high + room
    return Frame(*map(float, (low[0], low[1], *(high - low))))


def hand_svg(
    hand: HandDesign,
    frame: Frame,
    *,
    wrong: bool = False,
    name: str = "limbs",
) -> str:
    """The limbs: as thick as they are, to scale; without thickness as lines.

    Arguments:
        hand, frame: what is seen.
        wrong: whether it is no hand.
        name: of the class that has their colour.
    """
    thick = float(hand.thickness)
    width = max(thick, 0.009 * frame.size)
    classes = f"{name} wrong" if wrong else name
    return (
        f'<polyline class="{classes}" points="{_listed(points_of(hand))}" fill="none" '
        f'stroke-width="{width:.5g}" stroke-linecap="round" stroke-linejoin="round"/>'
    )


def scene_svg(scenario: Scenario, frame: Frame) -> str:
    """Goal line and narrowest passage, beside the limbs."""
    with jax.enable_x64(True):
        goal = jax.device_get(scenario.hand.goal())
        a, b = jax.device_get(scenario.hand.narrowest_passage())
    ends = np.array([[goal.a.x, goal.a.y], [goal.b.x, goal.b.y]], float)
    gap = np.array([[a.x, a.y], [b.x, b.y]], float)
    thin = 0.004 * frame.size
    return (
        f'<polyline class="goal" points="{_listed(ends)}" fill="none" stroke-width="{thin:.5g}" '
        f'stroke-dasharray="{4 * thin:.5g}"/>'
        f'<polyline class="gap" points="{_listed(gap)}" fill="none" stroke-width="{thin:.5g}"/>'
    )


def object_svg(
    body: Body, centre: Float[np.ndarray, "2"], angle: float | None, frame: Frame
) -> str:
    """The object somewhere, at an angle in radians, or as it starts."""
    corners, rounding = placed_outline(body, centre, angle)
    if len(corners) == 2 and rounding == 0:  # a stick
        return (
            f'<polyline class="object" points="{_listed(corners)}" fill="none" '
            f'stroke-width="{0.012 * frame.size:.5g}" stroke-linecap="round"/>'
        )
    return f'<polygon class="object" points="{_listed(rounded(corners, rounding))}"/>'


def trail_svg(path: Points, frame: Frame) -> str:
    """Where an object's centre has been."""
    return (
        f'<polyline class="trail" points="{_listed(path)}" fill="none" '
        f'stroke-width="{0.004 * frame.size:.5g}"/>'
    )


def pull_svg(pull: Float[np.ndarray, "2"], frame: Frame) -> str:
    """Gravity in the hand's plane, in a corner, as long as it is strong; of size 1 at most."""
    size = 0.07 * frame.size
    at = np.array([frame.x + 1.3 * size, frame.y + frame.height - 1.3 * size])
    tip = at + size * pull
    return (
        f'<circle class="dial" cx="{at[0]:.6g}" cy="{-at[1]:.6g}" r="{size:.5g}" fill="none" '
        f'stroke-width="{0.003 * frame.size:.5g}"/>'
        f'<polyline class="pull" points="{_listed(np.stack([at, tip]))}" fill="none" '
        f'stroke-width="{0.008 * frame.size:.5g}" stroke-linecap="round"/>'
    )


def _listed(points: Points) -> str:
    return " ".join(f"{x:.6g},{-y:.6g}" for x, y in points)
