"""How an object moves as seen from a hand that moves itself.

Positions are in the hand frame. Velocities are the object's own, as seen from the ground, and only
written in the hand's axes: when the hand starts or stops with a jerk, they stay what they are.
"""

from __future__ import annotations

import equinox as eqx

from pcjax.geometry import Flag, Scalar, Vec, where


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


class Carry(eqx.Module):
    """How a hand is carried about for a while: its twist changes evenly.

    Attributes:
        since: when the while began, s.
        begin, end: the twist then, and at its end.
        lasts: how long the while is, s.
    """

    since: Scalar
    begin: Twist
    end: Twist
    lasts: Scalar

    def twist(self, time: Scalar) -> Twist:
        """The twist at a time, s."""
        share = (time - self.since) / self.lasts
        return Twist(
            self.begin.velocity + (self.end.velocity - self.begin.velocity) * share,
            self.begin.spin + (self.end.spin - self.begin.spin) * share,
        )


class Leg(eqx.Module):
    """What pulls at things for a while, as seen from the hand.

    Attributes:
        pull: the acceleration of a thing that rests at the hand's origin, as seen from the hand; it
            stands for all of the while.
        until: when the while ends, s of the period.
        carry: how the hand moves; None for a hand that stays put.
    """

    pull: Vec
    until: Scalar
    carry: Carry | None = None

    def felt(self, position: Vec, velocity: Vec) -> Vec:
        """The acceleration of a thing at a place and with a velocity, both as seen from the hand:
        with the centrifugal, Coriolis' and Euler's."""
        if self.carry is None:
            return self.pull
        begin, end = self.carry.begin.spin, self.carry.end.spin
        spin = 0.5 * (begin + end)
        euler = Vec(position.y, -position.x) * self.turning
        coriolis = Vec(velocity.y, -velocity.x) * (2.0 * spin)
        return self.pull + position * (spin * spin) + euler + coriolis

    @property
    def turning(self) -> Scalar:
        """The rate of the hand's spin, 1 / s^2."""
        if self.carry is None:
            return 0.0 * self.until
        return (self.carry.end.spin - self.carry.begin.spin) / self.carry.lasts


class Swing(eqx.Module):
    """What pulls at things in a hand that stays put, for a stretch of a period: a cubic in time,
    and then what is held.

    Attributes:
        since: when the cubic begins, s of the period.
        powers: its coefficients, of time since then to the power of 0 to 3.
        turns_until: when it ends, s of the period.
        held: what pulls from then on.
        until: when the stretch ends, s of the period.
    """

    since: Scalar
    powers: tuple[Vec, Vec, Vec, Vec]
    turns_until: Scalar
    held: Vec
    until: Scalar

    def turning(self, time: Scalar) -> Flag:
        """Whether the pull changes at a time of the period, s."""
        return time < self.turns_until * (1 - 1e-6)

    def around(self, time: Scalar) -> tuple[Vec, Vec, Vec, Vec]:
        """The cubic's coefficients about a time of the period, s."""
        a, b, c, d = self.powers
        t = time - self.since
        turning = self.turning(time)
        none = Vec(0.0 * t, 0.0 * t)
        powers = (
            a + (b + (c + d * t) * t) * t,
            b + (c * 2.0 + d * (3.0 * t)) * t,
            c + d * (3.0 * t),
            d,
        )
        return where(turning, powers, (self.held, none, none, none))
