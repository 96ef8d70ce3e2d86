"""What moves the hand: where gravity points in the hand frame at each instant of a trial."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from pcjax.components import Component, Registry, quantity
from pcjax.geometry import Flag, Mirror, Scalar, Vec
from pcjax.model.motion import Carry, Leg, Motion, Swing, Twist

DRIVES: Registry[Drive] = Registry(
    "drive", "pcjax.drives", ("pcjax.model.drives.wrist", "pcjax.model.drives.arm")
)
"""What moves the hand, as study files and flags can name it."""

register_drive = DRIVES.register


def gravity_field() -> Any:
    """g, as drives declare it."""
    return quantity(
        "acceleration",
        "g",
        default=9.8,
        metric=9.8,
        low=0,
        key="gravity",
        flag="gravity",
        usual="9.8; in mm, cm and m the earth's 9.8 m / s^2",
    )


def duration_field(help: str, default: float, key: str) -> Any:
    """A time that all trials of a batch share, so that what depends on it stays a branch."""
    return quantity("time", help, default=default, low=0, above=True, key=key, shared=True)


class Placement(eqx.Module):
    """Where a drive has taken the hand at a time, to be drawn.

    Attributes:
        joints: places in the world from the drive's base to the palm's middle, the last one.
        turn: the angle by which the hand's axes are turned against the world's, radians.
        pull: gravity, in the world's axes.
        tilt: angles (T1, T2) of a wrist, radians.
    """

    joints: tuple[Vec, ...]
    turn: Scalar
    pull: Vec
    tilt: Vec | None = None


class Drive(Component):
    """What moves the hand: where it is and where gravity points, at each instant of a trial.

    A trial's life is cut into periods. `profile` turns a period's random draws into numbers, once;
    `fly` is called in every step and looks the motion up in them. Every drive has a static field
    `period`, seconds.

    Attributes:
        targets_per_period: how many draws a period takes.
        steady_in_between: whether gravity is all that changes, so that no `leg` has a `carry` and
            `swing` says how it changes: then a circle's trials can leap from event to event.
        longest_step: the longest step, s, that accuracy allows whatever the speed.
        usual_max_steps: the limit in steps of 0.001 s unless one is given.
        usual_directions: "both" or "does", where a hand has both and none is asked for.
        usual_hand: the kind of hand unless one is given.
    """

    targets_per_period: ClassVar[int]
    steady_in_between: ClassVar[bool] = False
    longest_step: ClassVar[float] = 0.02
    usual_max_steps: ClassVar[int] = 300_000
    usual_directions: ClassVar[str] = "both"
    usual_hand: ClassVar[str] = "box"

    if TYPE_CHECKING:  # for a field or a property of the subclass
        period: float = eqx.field(init=False)

    def usual_radius(self, palm_length: Scalar) -> Scalar:
        """The object's radius unless one is given: 0.05 L_p."""
        return 0.05 * palm_length

    def profile(self, before: Array, draws: Array, first: Flag) -> Any:
        """The period that follows the draws `before` with `draws`, as a pytree of numbers.

        Arguments:
            before, draws: uniform on [0, 1), of shape (targets_per_period,).
            first: whether the trial begins, so that `before` says nothing.
        """
        raise NotImplementedError

    def fly(self, profile: Any, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """Free motion over the step from `time` to `time + dt` (s) of a period.

        Arguments:
            profile: from `profile`.
            position: of the centre, in the hand frame.
            velocity: as seen from the ground, in the hand's axes.
            time: the same for all trials of a batch, so that a `jax.lax.cond` on it stays a branch.
            dt: the step, s.

        Returns:
            The end of the step, in the hand's axes there; with a `twist` if the hand moves.
        """
        raise NotImplementedError

    def steady_interval(self, drift: Scalar) -> Scalar:
        """Seconds for which a leg may last.

        Arguments:
            drift: how far taking the pull as constant may lead the object astray, a length.
        """
        return self.longest_step + 0.0 * drift

    def leg(self, profile: Any, time: Scalar, interval: Scalar) -> Leg:
        """What pulls from `time` (s) of a period on, and until when that stands.

        Unless a drive says it better, it is what `fly` says over the `interval` in which `time` is.

        Arguments:
            profile: from `profile`.
            time: of the period, s.
            interval: seconds, about; intervals divide the period evenly.
        """
        lasts = self.period / jnp.ceil(self.period / interval - 1e-3)
        since = jnp.floor(time / lasts + 1e-3) * lasts
        still = Vec(0.0 * since, 0.0 * since)
        soon = self.fly(profile, still, still, since, lasts / 1024).twist
        if soon is None:
            return Leg(self.fly(profile, still, still, since, lasts).acceleration, since + lasts)
        late = self.fly(profile, still, still, since, lasts).twist
        assert late is not None
        middle = self.fly(profile, still, still, since + 0.5 * lasts, lasts / 64)
        assert middle.twist is not None
        # Without Coriolis', since what rests on the ground moves as seen from the hand.
        away = middle.twist.velocity
        pull = middle.acceleration + Vec(away.y, -away.x) * (2.0 * middle.twist.spin)
        return Leg(pull, since + lasts, Carry(since, soon, late, lasts))

    def swing(self, profile: Any, time: Scalar, drift: Scalar) -> Swing:
        """What pulls from `time` (s) of a period on, in a hand that stays put, and until when.

        Unless a drive says it better, it is a `leg`, over which it does not change.

        Arguments:
            profile: from `profile`.
            time: of the period, s.
            drift: how far the stretch's pull may lead the object astray, a length.
        """
        leg = self.leg(profile, time, self.steady_interval(drift))
        none = Vec(0.0 * leg.until, 0.0 * leg.until)
        return Swing(time, (leg.pull, none, none, none), 0.0 * leg.until, leg.pull, leg.until)

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers.

        The automatic step follows from it.
        """
        raise NotImplementedError

    def placement(self, profile: Any, time: Scalar) -> Placement:
        """Where the hand is at a time of a period, for pictures: unless a drive says otherwise,
        where it always was, with the pull that an object at rest in its middle feels."""
        zero = 0.0 * time
        still = Vec(zero, zero)
        return Placement(
            (still,), zero, self.fly(profile, still, still, time, 1e-3 + zero).acceleration
        )

    def gravity_seen(self, profile: Any, time: Scalar) -> Vec:
        """Gravity in the hand's axes at a time of a period, without what the hand's own motion
        adds."""
        placed = self.placement(profile, time)
        c, s, pull = jnp.cos(placed.turn), jnp.sin(placed.turn), placed.pull
        return Vec(pull.x * c + pull.y * s, pull.y * c - pull.x * s)

    def mirrored(self, mirror: Mirror) -> Drive:
        """The drive as it is seen in a mirror that is fixed to the hand."""
        return MirroredDrive(self, mirror)


class WrappedDrive(Drive):
    """A drive that does as another one does, but for what its subclass says.

    Arguments:
        drive: the other one.
    """

    drive: Drive

    @property
    def targets_per_period(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """As the drive's, as are all others."""
        return self.drive.targets_per_period

    @property
    def period(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Seconds."""
        return self.drive.period

    @property
    def longest_step(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Seconds."""
        return self.drive.longest_step

    @property
    def usual_max_steps(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Steps of 0.001 s."""
        return self.drive.usual_max_steps

    @property
    def usual_directions(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """ "both" or "does"."""
        return self.drive.usual_directions

    @property
    def usual_hand(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """A kind."""
        return self.drive.usual_hand

    def usual_radius(self, palm_length: Scalar) -> Scalar:
        """A length."""
        return self.drive.usual_radius(palm_length)

    def profile(self, before: Array, draws: Array, first: Flag) -> Any:
        """As the drive's."""
        return self.drive.profile(before, draws, first)

    def fly(self, profile: Any, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """As the drive's."""
        return self.drive.fly(profile, position, velocity, time, dt)

    def steady_interval(self, drift: Scalar) -> Scalar:
        """As the drive's."""
        return self.drive.steady_interval(drift)

    def leg(self, profile: Any, time: Scalar, interval: Scalar) -> Leg:
        """As the drive's."""
        return self.drive.leg(profile, time, interval)

    def top_speed(self, reach: float) -> float:
        """As the drive's."""
        return self.drive.top_speed(reach)

    def placement(self, profile: Any, time: Scalar) -> Placement:
        """As the drive's."""
        return self.drive.placement(profile, time)

    def gravity_seen(self, profile: Any, time: Scalar) -> Vec:
        """As the drive's."""
        return self.drive.gravity_seen(profile, time)

    @property
    def gravity(self) -> Scalar:
        """As the drive's, where it has one."""
        return self.drive.gravity  # pyright: ignore[reportAttributeAccessIssue]


class MirroredDrive(WrappedDrive):
    """A drive as it is seen in a mirror that is fixed to the hand; exact for every drive.

    The hand for EoEn has its fingertips mirrored across the line through their joints (Fig. 8(b)).
    That is the real hand seen in this mirror: the object's box is the mirror image of the hand's
    body and the fingertips are the real ones. So gravity and the hand's motion have to be seen in
    it as well.

    Arguments:
        drive: the hand's.
        mirror: in the hand frame.
    """

    mirror: Mirror

    def fly(self, profile: Any, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """The image of the drive's free motion."""
        mirror = self.mirror
        real = self.drive.fly(profile, mirror.point(position), mirror.vector(velocity), time, dt)
        twist = None
        if real.twist is not None:
            # The hand's velocity where the image of the origin is.
            twist = Twist(mirror.vector(real.twist.at(mirror.origin)), -real.twist.spin)
        return Motion(
            mirror.point(real.position),
            mirror.vector(real.velocity),
            mirror.vector(real.acceleration),
            twist,
        )

    def leg(self, profile: Any, time: Scalar, interval: Scalar) -> Leg:
        """The image of the drive's leg."""
        mirror = self.mirror
        real = self.drive.leg(profile, time, interval)
        origin = mirror.origin
        still = Vec(0.0 * origin.x, 0.0 * origin.y)
        pull = mirror.vector(real.felt(origin, still))
        if real.carry is None:
            return Leg(pull, real.until)
        begin, end = (
            Twist(mirror.vector(twist.at(origin)), -twist.spin)
            for twist in (real.carry.begin, real.carry.end)
        )
        return Leg(pull, real.until, Carry(real.carry.since, begin, end, real.carry.lasts))

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers."""
        # The image of the palm is twice the hand away from where the drive moves it.
        return self.drive.top_speed(3.0 * reach)

    def placement(self, profile: Any, time: Scalar) -> Placement:
        """
        Raises:
            ValueError: always; the world of the mirror is nowhere to be seen.
        """
        raise ValueError("a hand that is carried about cannot be drawn as seen in a mirror")

    def gravity_seen(self, profile: Any, time: Scalar) -> Vec:
        """The image of the drive's."""
        return self.mirror.vector(self.drive.gravity_seen(profile, time))
