"""What moves the hand: where gravity points in the hand frame at each instant of a trial."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pcjax.checks import check_between
from pcjax.components import Component, Registry, quantity
from pcjax.model.motion import Carry, Motion
from pcjax.planar import Flag, Mirror, Scalar, Vec, where

DRIVES: Registry[Drive] = Registry("drive", "pcjax.drives", ("pcjax.model.arm",))
"""What moves the hand, as study files and flags can name it."""

register_drive = DRIVES.register


def gravity_field() -> Any:
    """g, as drives declare it."""
    return quantity("acceleration", "g", default=9.8, low=0, key="gravity", flag="gravity")


def duration_field(help: str, default: float, key: str) -> Any:
    """A time that decides which code runs."""
    return quantity("time", help, default=default, low=0, above=True, key=key, static=True)


class Carriage(eqx.Module):
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

    A trial's life is cut into periods. `swing` turns a period's random draws into numbers, once;
    `fly` is called in every step and looks the motion up in them. Every drive has a static field
    `period`, seconds.

    Attributes:
        targets_per_period: how many draws a period takes.
        steady_in_between: whether gravity is all that changes, and `steady` and `steady_interval`
            say how: then trials can leap from event to event.
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

    def swing(self, before: Array, draws: Array, first: Flag) -> Any:
        """The period that follows the draws `before` with `draws`, as a pytree of numbers.

        Arguments:
            before, draws: uniform on [0, 1), of shape (targets_per_period,).
            first: whether the trial begins, so that `before` says nothing.
        """
        raise NotImplementedError

    def fly(self, swing: Any, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """Free motion over the step from `time` to `time + dt` (s) of a period.

        Arguments:
            swing: from `swing`.
            position: of the centre, in the hand frame.
            velocity: as seen from the ground, in the hand's axes.
            time: the same for all trials of a batch, so that a `jax.lax.cond` on it stays a branch.
            dt: the step, s.

        Returns:
            The end of the step, in the hand's axes there; with a `carry` if the hand moves.
        """
        raise NotImplementedError

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers.

        The automatic step follows from it.
        """
        raise NotImplementedError

    def carriage(self, swing: Any, time: Scalar) -> Carriage:
        """Where the hand is at a time of a period, for pictures: unless a drive says otherwise,
        where it always was, with the pull that an object at rest in its middle feels."""
        zero = 0.0 * time
        still = Vec(zero, zero)
        return Carriage(
            (still,), zero, self.fly(swing, still, still, time, 1e-3 + zero).acceleration
        )

    def mirrored(self, mirror: Mirror) -> Drive:
        """The drive as it is seen in a mirror that is fixed to the hand."""
        return MirroredDrive(self, mirror)


class Pull(eqx.Module):
    """The object's acceleration (2) at a step's start, middle and end."""

    start: Vec
    middle: Vec
    end: Vec


class Swing(eqx.Module):
    """One period of a wrist: tilt (T1, T2) at its start, target tilt, and gravity once there."""

    start: Vec
    target: Vec
    held: Vec


@register_drive("wrist")
class WristTilt(Drive):
    """The wrist manipulator of Sec. 3.3: it tilts the hand's plane, the hand itself stays put.

    In every period both angles move at uniform speed from where they are to new targets
    T1, T2 ~ U(-amplitude, amplitude), reach them after `ramp_time` and hold them. T1 = T2 = 0 at
    the start of a trial.

    Arguments:
        amplitude: largest tilt, radians.
        gravity: g, length / s^2.
        ramp_time: seconds of each period in which the wrist turns (fixed when compiled).
        period: seconds between draws of new targets (fixed when compiled).
        turned: cosine and sine of an angle by which gravity is turned in the hand's plane (see
            `mirrored`).

    Raises:
        ValueError: an amplitude outside [0, pi/2], a ramp longer than the period, a period that
            is not positive, or gravity that is not a finite number of at least 0.

    Examples:
        Tilted to T1 = amplitude and T2 = 0, gravity along the palm is g sin(T1):

        >>> import math, jax.numpy as jnp, pcjax
        >>> drive = pcjax.WristTilt(amplitude=math.radians(30))
        >>> swing = drive.swing(jnp.zeros(2), jnp.array([1.0, 0.5]), first=True)
        >>> print(f"{swing.held.x:.2f} {abs(swing.held.y):.2f}")
        4.90 0.00
    """

    amplitude: Scalar = quantity(
        "angle", "largest tilt", default=math.pi / 6, low=0, high=math.pi / 2, key="amplitude"
    )
    gravity: Scalar = gravity_field()
    ramp_time: float = duration_field("of each period, in which the wrist turns", 1.0, "ramp_time")
    period: float = duration_field("between new targets", 10.0, "period")
    turned: Vec = eqx.field(default_factory=lambda: Vec(1.0, 0.0))

    targets_per_period = 2
    steady_in_between = True
    longest_step = 0.04
    usual_max_steps = 600_000

    def __check_init__(self) -> None:
        check_between("ramp_time", self.ramp_time, 0.0, self.period)

    def mirrored(self, mirror: Mirror) -> WristTilt:
        """The wrist as it is seen in a mirror that is fixed to the hand.

        Which of T2 and -T2 was drawn is even chance, so a mirror along the palm leaves the wrist
        what it is, and another one along a line at an angle phi turns its gravity by 2 phi.
        """
        return replace(self, turned=mirror.turn)

    def swing(self, before: Float[Array, "2"], draws: Float[Array, "2"], first: Flag) -> Swing:
        """The period that follows the draws `before` with `draws`, both uniform on [0, 1).

        In the `first` period of a trial the wrist starts level, whatever `before` is.
        """
        level = Vec(0.0 * draws[0], 0.0 * draws[1])
        start = where(first, level, self._tilt(before))
        target = self._tilt(draws)
        return Swing(start, target, self._gravity_at(target))

    def pull(self, swing: Swing, time: Scalar, dt: Scalar) -> Pull:
        """Gravity in the hand frame over the step from `time` to `time + dt` (s) of a period."""

        def turning() -> Pull:
            return Pull(*(self._gravity_during(swing, time + share * dt) for share in (0, 0.5, 1)))

        def held() -> Pull:
            return Pull(swing.held, swing.held, swing.held)

        # The time in the period is the same for all lanes of a batch, so this stays a branch
        # under vmap and the trigonometry costs nothing while the tilt is held.
        return jax.lax.cond(time < self.ramp_time, turning, held)

    def steady_interval(self, drift: Scalar) -> Scalar:
        """Seconds for which gravity may be taken as constant, as it is halfway, while it turns.

        In an interval h that leads the object astray by at most g' h^3 / 12, with g' how fast
        gravity changes; that stays within `drift` (a length). Intervals divide the ramp evenly.
        """
        change = 2.0 * self.amplitude * self.gravity / self.ramp_time
        longest = jnp.cbrt(12.0 * drift / jnp.maximum(change, 1e-9))
        return self.ramp_time / jnp.clip(jnp.ceil(self.ramp_time / longest), 1.0, 1e4)

    def steady(self, swing: Swing, time: Scalar, interval: Scalar) -> tuple[Vec, Scalar]:
        """A pull that stands for gravity from `time` (s) of a period on, and until when."""
        number = jnp.floor(time / interval + 1e-3)
        turning = time < self.ramp_time * (1 - 1e-6)
        pull = where(turning, self._gravity_during(swing, (number + 0.5) * interval), swing.held)
        return pull, jnp.where(turning, (number + 1.0) * interval, self.period)

    def fly(self, swing: Swing, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """Free motion (2) over the step from `time` to `time + dt` (s) of a period.

        By the classical Runge-Kutta method, for a force that depends on time alone.
        """
        pull = self.pull(swing, time, dt)
        mean = (pull.start + pull.middle * 4.0 + pull.end) * (1 / 6)
        early = (pull.start + pull.middle * 2.0) * (1 / 3)
        return Motion(
            position + (velocity + early * (0.5 * dt)) * dt,
            velocity + mean * dt,
            mean,
        )

    def carriage(self, swing: Swing, time: Scalar) -> Carriage:
        """The hand stays put; gravity is what turns."""
        zero = 0.0 * time
        tilt = self.tilt(swing, time)
        return Carriage((Vec(zero, zero),), zero, self._gravity_at(tilt), tilt)

    def tilt(self, swing: Swing, time: Scalar) -> Vec:
        """The angles (T1, T2) at a time of a period."""
        share = jnp.minimum(time / self.ramp_time, 1.0)
        return swing.start + (swing.target - swing.start) * share

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers."""
        pull = float(self.gravity) * math.sqrt(2.0) * math.sin(float(self.amplitude))
        return math.sqrt(2.0 * pull * reach)

    def _tilt(self, draws: Float[Array, "2"]) -> Vec:
        return Vec(*(self.amplitude * (2.0 * draws[k] - 1.0) for k in (0, 1)))

    def _gravity_during(self, swing: Swing, time: Scalar) -> Vec:
        return self._gravity_at(self.tilt(swing, time))

    def _gravity_at(self, tilt: Vec) -> Vec:
        # (1), first two components
        x = self.gravity * jnp.sin(tilt.x)
        y = -self.gravity * jnp.cos(tilt.x) * jnp.sin(tilt.y)
        c, s = self.turned.x, self.turned.y
        return Vec(x * c - y * s, x * s + y * c)


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

    def swing(self, before: Array, draws: Array, first: Flag) -> Any:
        """As the drive's."""
        return self.drive.swing(before, draws, first)

    def fly(self, swing: Any, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """As the drive's."""
        return self.drive.fly(swing, position, velocity, time, dt)

    def top_speed(self, reach: float) -> float:
        """As the drive's."""
        return self.drive.top_speed(reach)

    def carriage(self, swing: Any, time: Scalar) -> Carriage:
        """As the drive's."""
        return self.drive.carriage(swing, time)


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

    def fly(self, swing: Any, position: Vec, velocity: Vec, time: Scalar, dt: Scalar) -> Motion:
        """The image of the drive's free motion."""
        mirror = self.mirror
        real = self.drive.fly(swing, mirror.point(position), mirror.vector(velocity), time, dt)
        carry = None
        if real.carry is not None:
            # The hand's velocity where the image of the origin is.
            carry = Carry(mirror.vector(real.carry.at(mirror.origin)), -real.carry.spin)
        return Motion(
            mirror.point(real.position),
            mirror.vector(real.velocity),
            mirror.vector(real.acceleration),
            carry,
        )

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers."""
        # The image of the palm is twice the hand away from where the drive moves it.
        return self.drive.top_speed(3.0 * reach)

    def carriage(self, swing: Any, time: Scalar) -> Carriage:
        """
        Raises:
            ValueError: always; the world of the mirror is nowhere to be seen.
        """
        raise ValueError("a hand that is carried about cannot be drawn as seen in a mirror")
