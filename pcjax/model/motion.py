"""How an object moves as seen from a hand that moves itself.

Positions are in the hand frame. Velocities are the object's own, as seen from the ground, and only
written in the hand's axes: when the hand starts or stops with a jerk, they stay what they are.
"""

from __future__ import annotations

import equinox as eqx

from pcjax.geometry import Scalar, Vec


class Twist(eqx.Module):
    """How a moving hand moves: its origin's velocity, written in its own axes, and its spin."""

    velocity: Vec
    spin: Scalar

    def at(self, point: Vec) -> Vec:
        """The velocity of a point that is fixed to the hand."""
        return self.velocity + Vec(-point.y, point.x) * self.spin


class Motion(eqx.Module):
    """An object at the end of a step, and how it came there under one constant acceleration.

    Attributes:
        position: in the hand frame.
        velocity: as seen from the ground, in the hand's axes at the end of the step.
        acceleration: as seen from the hand.
        twist: how the hand moves; None for a hand that stays put.
    """

    position: Vec
    velocity: Vec
    acceleration: Vec
    twist: Twist | None = None

    def relative(self) -> Vec:
        """The velocity as seen from the hand."""
        return self.velocity if self.twist is None else self.velocity - self.twist.at(self.position)

    def turned(self, kick: Vec, since: Scalar) -> Vec:
        """A change of velocity made `since` seconds ago, in the hand's axes of now.

        The hand has turned on meanwhile, by an angle so small that its first order does.
        """
        if self.twist is None:
            return kick
        return kick + Vec(kick.y, -kick.x) * (self.twist.spin * since)
