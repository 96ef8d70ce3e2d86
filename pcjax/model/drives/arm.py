"""The planar arm: forward kinematics of a hand that is carried about under steady gravity."""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pcjax.checks import check_between
from pcjax.components import quantity
from pcjax.geometry import Flag, Scalar, Vec, where
from pcjax.model.drives.base import Drive, Placement, duration_field, gravity_field, register_drive
from pcjax.model.motion import Carry, Leg, Motion, Twist

Joints = tuple[Scalar, Scalar, Scalar]


class JointProfile(eqx.Module):
    """One period of an arm: its joint angles at the start, their targets, and gravity once there.

    Gravity is in the hand's axes.
    """

    start: Joints
    target: Joints
    held: Vec


def _joints(what: str, default: Joints, key: str) -> Any:
    return quantity("angle", what, default=default, count=3, each="joint", key=key)


@register_drive("arm")
class PlanarArm(Drive):
    """The planar arm of Sec. 3.6: three links that carry the hand about under steady gravity.

    The first link points along `mount_angle` (from the world's x axis) when its joint angle is 0,
    and each further link continues its predecessor when its own is. The last link's direction is
    the way the hand points, and its end the middle of the palm.

    In every period each joint moves at uniform speed from where it is to a new target, uniform
    between `low` and `high`, reaches it after `ramp_time` and holds it. A trial begins at `rest`.

    Arguments:
        lengths: L_a1, L_a2, L_a3, lengths.
        rest: joint angles Theta_a1, Theta_a2, Theta_a3 at the start of a trial, radians.
        low, high: bounds of the joint angles' targets, radians.
        mount_angle: where the first link points at joint angle 0, radians; -pi/2: it hangs.
        gravity: g, length / s^2.
        gravity_direction: where gravity points (from the world's x axis), radians; -pi/2: down.
        ramp_time: seconds of each period in which the arm moves; a whole number of fiftieths of the
            period, so that steps end where it does (the same for all trials of a batch).
        period: seconds between draws of new targets (the same for all trials of a batch).

    Raises:
        ValueError: a length or gravity that is not a finite number of at least 0, an angle that is
            not finite, low > high, or a ramp or period out of range.

    Examples:
        At rest the first link hangs and the second one is turned by 45 degrees:

        >>> import jax.numpy as jnp, pcjax
        >>> arm = pcjax.PlanarArm()
        >>> profile = arm.profile(jnp.zeros(3), jnp.zeros(3), first=True)
        >>> joints, _ = arm.pose(profile, 0.0)
        >>> [f"{joint.x:.1f} {joint.y:.1f}" for joint in joints[1:3]]
        ['-0.0 -200.0', '141.4 -341.4']
    """

    lengths: Joints = quantity(
        "length",
        "L_a1, L_a2, L_a3",
        default=(200.0, 200.0, 0.0),
        low=0,
        count=3,
        each="joint",
        key="lengths",
    )
    rest: Joints = _joints("joint angles at the start", (0.0, math.pi / 4, 0.0), "rest")
    low: Joints = _joints("least targets", (-math.pi / 4, 0.0, 0.0), "low")
    high: Joints = _joints("largest targets", (math.pi / 4, math.pi / 2, 0.0), "high")
    mount_angle: Scalar = quantity(
        "angle",
        "where the first link points at joint angle 0",
        default=-math.pi / 2,
        key="mount_angle",
    )
    gravity: Scalar = gravity_field()
    gravity_direction: Scalar = quantity(
        "angle", "where gravity points", default=-math.pi / 2, key="gravity_direction"
    )
    ramp_time: float = duration_field("of each period, in which the arm moves", 5.0, "ramp_time")
    period: float = duration_field("between new targets", 10.0, "period")

    targets_per_period = 3
    usual_directions = "does"
    usual_hand = "two-joint"

    def __check_init__(self) -> None:
        for k in range(3):
            span = self.high[k] - self.low[k]
            check_between(f"high - low of joint {k + 1}", span, 0.0, math.inf)
        check_between("ramp_time", self.ramp_time, 0.0, self.period)
        fiftieths = 50 * self.ramp_time / self.period
        if abs(fiftieths - round(fiftieths)) > 1e-9:
            raise ValueError(
                f"ramp_time is {self.ramp_time:g}: it has to be a whole number of fiftieths of the "
                f"period, {self.period:g}"
            )

    def usual_radius(self, palm_length: Scalar) -> Scalar:
        """The paper's circle, whatever the palm."""
        return 50.0

    def profile(
        self, before: Float[Array, "3"], draws: Float[Array, "3"], first: Flag
    ) -> JointProfile:
        """The period that follows the draws `before` with `draws`, both uniform on [0, 1).

        In the `first` period of a trial the arm starts at `rest`, whatever `before` is.
        """
        t1, t2, t3 = (
            jnp.where(first, rest, reached)
            for rest, reached in zip(self.rest, self._targets(before), strict=True)
        )
        target = self._targets(draws)
        return JointProfile((t1, t2, t3), target, self._gravity_at(target))

    def fly(
        self, profile: JointProfile, position: Vec, velocity: Vec, time: Scalar, dt: Scalar
    ) -> Motion:
        """Free motion (2) over the step from `time` to `time + dt` (s) of a period.

        In the world a parabola, exactly; seen from the hand as it is at the end of the step. The
        step lies either in the ramp or after it.
        """

        def moving() -> Motion:
            joints, rates = self._along(profile, time + dt)
            gravity, felt = self._gravity_at(joints), self._felt(profile, time + dt)
            twist = self._twist(profile, time + dt)
            toward, speeds = self._links(joints), _sums(rates)
            spin = speeds[2]
            pushed = Vec(0.0 * spin, 0.0 * spin)
            for link, length, speed in zip(toward, self.lengths, speeds, strict=True):
                across = Vec(-link.y, link.x)
                turn = speed * dt
                # How far the link's end has come, from where the link points now; 1 - cos as a
                # square, which keeps its digits.
                half = jnp.sin(0.5 * turn)
                moved = across * jnp.sin(turn) + link * (2.0 * half * half)
                pushed = pushed + moved * length
            c, s = jnp.cos(spin * dt), jnp.sin(spin * dt)
            ahead = _turned_back(velocity, c, s)
            place = _turned_back(position, c, s) + (ahead + gravity * (0.5 * dt)) * dt - pushed
            ahead = ahead + gravity * dt
            seen = ahead - twist.at(place)
            felt = felt + place * (spin * spin) + Vec(seen.y, -seen.x) * (2.0 * spin)
            return Motion(place, ahead, felt, twist)

        def held() -> Motion:
            zero = 0.0 * profile.held.x
            return Motion(
                position + (velocity + profile.held * (0.5 * dt)) * dt,
                velocity + profile.held * dt,
                profile.held,
                Twist(Vec(zero, zero), zero),
            )

        # Shared by all lanes, as for the wrist; half a step in, so that rounding does not decide.
        return jax.lax.cond(time + 0.5 * dt < self.ramp_time, moving, held)

    def steady_interval(self, drift: Scalar) -> Scalar:
        """Seconds for which a leg may last while the arm moves.

        In an interval h the pull's change leads the object astray by at most f h^3 / 12, with f
        about three times gravity's rate, for what is pulled moves as well; that stays within
        `drift` (a length). Nor does the hand turn by more than a tenth of a radian meanwhile.
        """
        spin = sum(high - low for low, high in zip(self.low, self.high, strict=True))
        spin = jnp.maximum(spin / self.ramp_time, 1e-9)
        change = 3.0 * spin * self.gravity
        longest = jnp.minimum(jnp.cbrt(12.0 * drift / jnp.maximum(change, 1e-9)), 0.1 / spin)
        return self.ramp_time / jnp.clip(jnp.ceil(self.ramp_time / longest), 1.0, 1e4)

    def leg(self, profile: JointProfile, time: Scalar, interval: Scalar) -> Leg:
        """What is felt halfway through an interval of the ramp, or until the period's end."""
        lasts = self.ramp_time / jnp.ceil(self.ramp_time / interval - 1e-3)
        moving = time < self.ramp_time * (1 - 1e-6)
        since = jnp.floor(time / lasts + 1e-3) * lasts
        halfway = self._felt(profile, since + 0.5 * lasts)
        begin, end = (
            jax.tree.map(lambda part: jnp.where(moving, part, 0.0), self._twist(profile, at))
            for at in (since, since + lasts)
        )
        pull = where(moving, halfway, profile.held)
        until = jnp.where(moving, since + lasts, self.period)
        return Leg(pull, until, Carry(since, begin, end, lasts))

    def _twist(self, profile: JointProfile, time: Scalar) -> Twist:
        """How the hand moves at a time of the ramp."""
        joints, rates = self._along(profile, time)
        speeds = _sums(rates)
        carried = Vec(0.0 * speeds[2], 0.0 * speeds[2])
        for link, length, speed in zip(self._links(joints), self.lengths, speeds, strict=True):
            carried = carried + Vec(-link.y, link.x) * (length * speed)
        return Twist(carried, speeds[2])

    def _felt(self, profile: JointProfile, time: Scalar) -> Vec:
        """What a thing that rests at the palm's middle feels at a time of the ramp: gravity, and
        the links' centrifugal accelerations."""
        joints, rates = self._along(profile, time)
        speeds = _sums(rates)
        flung = Vec(0.0 * speeds[2], 0.0 * speeds[2])
        for link, length, speed in zip(self._links(joints), self.lengths, speeds, strict=True):
            flung = flung + link * (length * speed * speed)
        return self._gravity_at(joints) + flung

    def pose(self, profile: JointProfile, time: Scalar) -> tuple[tuple[Vec, ...], Scalar]:
        """The arm in the world at a time of a period: its joints from the base to the palm's
        middle, and the angle by which the hand's axes are turned against the world's."""
        joints, _ = self._along(profile, time)
        heading = self.mount_angle
        points = [Vec(0.0 * heading, 0.0 * heading)]
        for length, joint in zip(self.lengths, joints, strict=True):
            heading = heading + joint
            points.append(points[-1] + Vec(jnp.cos(heading), jnp.sin(heading)) * length)
        return tuple(points), heading - math.pi / 2

    def placement(self, profile: JointProfile, time: Scalar) -> Placement:
        """The arm in the world."""
        joints, turn = self.pose(profile, time)
        down = self.gravity_direction
        return Placement(joints, turn, Vec(jnp.cos(down), jnp.sin(down)) * self.gravity)

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers."""
        spins = [
            sum(float(self.high[j]) - float(self.low[j]) for j in range(k + 1)) / self.ramp_time
            for k in range(3)
        ]
        hand = sum(float(length) * spin for length, spin in zip(self.lengths, spins, strict=True))
        return math.sqrt(2.0 * float(self.gravity) * reach) + hand + spins[2] * reach

    def _targets(self, draws: Float[Array, "3"]) -> Joints:
        t1, t2, t3 = (self.low[k] + (self.high[k] - self.low[k]) * draws[k] for k in range(3))
        return t1, t2, t3

    def _along(self, profile: JointProfile, time: Scalar) -> tuple[Joints, Joints]:
        """Joint angles at a time of a period, and their rates during the ramp."""
        share = jnp.minimum(time / self.ramp_time, 1.0)
        spans = [b - a for a, b in zip(profile.start, profile.target, strict=True)]
        t1, t2, t3 = (a + span * share for a, span in zip(profile.start, spans, strict=True))
        r1, r2, r3 = (span / self.ramp_time for span in spans)
        return (t1, t2, t3), (r1, r2, r3)

    def _links(self, joints: Joints) -> tuple[Vec, Vec, Vec]:
        """The links' directions in the hand's axes; the last one is the hand's own +y."""
        _, t2, t3 = joints
        zero = 0.0 * t3
        return (
            Vec(jnp.sin(t2 + t3), jnp.cos(t2 + t3)),
            Vec(jnp.sin(t3), jnp.cos(t3)),
            Vec(zero, 1.0 + zero),
        )

    def _gravity_at(self, joints: Joints) -> Vec:
        # Where the hand points in axes in which gravity points along -y.
        mount = self.mount_angle - (self.gravity_direction + math.pi / 2)
        heading = mount + _sums(joints)[2]
        return Vec(self.gravity * jnp.cos(heading), -self.gravity * jnp.sin(heading))


def _sums(values: Joints) -> Joints:
    """Running sums: from joint to link."""
    a, b, c = values
    return a, a + b, a + b + c


def _turned_back(vector: Vec, cosine: Scalar, sine: Scalar) -> Vec:
    """A vector in axes that are turned on by the angle with this cosine and sine."""
    return Vec(vector.x * cosine + vector.y * sine, vector.y * cosine - vector.x * sine)
