"""The wrist manipulator of Sec. 3.3."""

from __future__ import annotations

import math
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pcjax.checks import check_between
from pcjax.components import quantity
from pcjax.geometry import Flag, Mirror, Scalar, Vec, cube_root, sine_and_cosine, where
from pcjax.model.drives.base import Drive, Placement, duration_field, gravity_field, register_drive
from pcjax.model.motion import Leg, Motion, Swing


class Pull(eqx.Module):
    """The object's acceleration (2) at a step's start, middle and end."""

    start: Vec
    middle: Vec
    end: Vec


class TiltProfile(eqx.Module):
    """One period of a wrist: tilt (T1, T2) at its start, target tilt, and gravity once there."""

    start: Vec
    target: Vec
    held: Vec


_NODES = 0.5 - 0.5 * np.cos((2 * np.arange(4) + 1) * np.pi / 8)
"""Chebyshev nodes of a stretch of length 1."""

_TO_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))
"""From values there to the coefficients of the cubic through them."""


@register_drive("wrist")
class WristTilt(Drive):
    """The wrist manipulator of Sec. 3.3: it tilts the hand's plane, the hand itself stays put.

    In every period both angles move at uniform speed from where they are to new targets
    T1, T2 ~ U(-amplitude, amplitude), reach them after `ramp_time` and hold them. T1 = T2 = 0 at
    the start of a trial.

    Arguments:
        amplitude: largest tilt, radians.
        gravity: g, length / s^2.
        ramp_time: seconds of each period in which the wrist turns (the same for all trials
            of a batch).
        period: seconds between draws of new targets (the same for all trials of a batch).
        turned: cosine and sine of an angle by which gravity is turned in the hand's plane (see
            `mirrored`).

    Raises:
        ValueError: an amplitude outside [0, pi/2], a ramp longer than the period, a period that
            is not positive, or gravity that is not a finite number of at least 0.

    Examples:
        Tilted to T1 = amplitude and T2 = 0, gravity along the palm is g sin(T1):

        >>> import math, jax.numpy as jnp, pcjax
        >>> drive = pcjax.WristTilt(amplitude=math.radians(30))
        >>> profile = drive.profile(jnp.zeros(2), jnp.array([1.0, 0.5]), first=True)
        >>> print(f"{profile.held.x:.2f} {abs(profile.held.y):.2f}")
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

    def profile(
        self, before: Float[Array, "2"], draws: Float[Array, "2"], first: Flag
    ) -> TiltProfile:
        """The period that follows the draws `before` with `draws`, both uniform on [0, 1).

        In the `first` period of a trial the wrist starts level, whatever `before` is.
        """
        level = Vec(0.0 * draws[0], 0.0 * draws[1])
        start = where(first, level, self._tilt(before))
        target = self._tilt(draws)
        return TiltProfile(start, target, self._gravity_at(target))

    def pull(self, profile: TiltProfile, time: Scalar, dt: Scalar) -> Pull:
        """Gravity in the hand frame over the step from `time` to `time + dt` (s) of a period."""

        def turning() -> Pull:
            return Pull(
                *(self._gravity_during(profile, time + share * dt) for share in (0, 0.5, 1))
            )

        def held() -> Pull:
            return Pull(profile.held, profile.held, profile.held)

        # The time in the period is the same for all lanes of a batch, so this stays a branch
        # under vmap and the trigonometry costs nothing while the tilt is held.
        return jax.lax.cond(time < self.ramp_time, turning, held)

    def steady_interval(self, drift: Scalar) -> Scalar:
        """Seconds for which gravity may be taken as constant, as it is halfway, while it turns.

        In an interval h that leads the object astray by at most g' h^3 / 12, with g' how fast
        gravity changes; that stays within `drift` (a length). Intervals divide the ramp evenly.
        """
        change = 2.0 * self.amplitude * self.gravity / self.ramp_time
        longest = cube_root(12.0 * drift / jnp.maximum(change, 1e-9))
        return self.ramp_time / jnp.clip(jnp.ceil(self.ramp_time / longest), 1.0, 1e4)

    def leg(self, profile: TiltProfile, time: Scalar, interval: Scalar) -> Leg:
        """Gravity as it is halfway through an interval of the ramp, or until the period's end."""
        number = jnp.floor(time / interval + 1e-3)
        turning = time < self.ramp_time * (1 - 1e-6)
        pull = where(
            turning, self._gravity_during(profile, (number + 0.5) * interval), profile.held
        )
        return Leg(pull, jnp.where(turning, (number + 1.0) * interval, self.period))

    def swing(self, profile: TiltProfile, time: Scalar, drift: Scalar) -> Swing:
        """Gravity as a cubic through four Chebyshev nodes of a piece of the ramp, most often of all
        of it, and then as it is held.

        In a piece of h seconds that is wrong by at most g w^4 h^4 / 3072, where w is the sum of
        both rates of tilt; it leads the object astray by less than 0.07 h^2 times as much. Pieces
        divide the ramp evenly.
        """
        away = profile.target - profile.start
        rate = (jnp.abs(away.x) + jnp.abs(away.y)) / self.ramp_time
        change = 0.07 / 3072 * self.gravity * rate**4
        lasts = jnp.maximum(change, 1e-30) / drift
        pieces = jnp.clip(jnp.ceil(self.ramp_time * cube_root(jnp.sqrt(lasts))), 1.0, 1e4)
        piece = self.ramp_time / pieces
        number = jnp.floor(time / piece + 1e-3)
        since = jnp.minimum(number, pieces - 1.0) * piece
        turns_until = since + piece
        last = number > pieces - 1.5
        share = piece / self.ramp_time
        at = [
            self._gravity_at(profile.start + away * (since / self.ramp_time + share * float(node)))
            for node in _NODES
        ]

        def power(k: int) -> Vec:
            scale = 1.0 / piece**k
            x, y = (
                sum(float(_TO_POWERS[k, j]) * part for j, part in enumerate(parts))
                for parts in ([one.x for one in at], [one.y for one in at])
            )
            return Vec(x * scale, y * scale)

        return Swing(
            since,
            (power(0), power(1), power(2), power(3)),
            turns_until,
            profile.held,
            jnp.where(last, self.period, turns_until),
        )

    def fly(
        self, profile: TiltProfile, position: Vec, velocity: Vec, time: Scalar, dt: Scalar
    ) -> Motion:
        """Free motion (2) over the step from `time` to `time + dt` (s) of a period.

        By the classical Runge-Kutta method, for a force that depends on time alone.
        """
        pull = self.pull(profile, time, dt)
        mean = (pull.start + pull.middle * 4.0 + pull.end) * (1 / 6)
        early = (pull.start + pull.middle * 2.0) * (1 / 3)
        return Motion(
            position + (velocity + early * (0.5 * dt)) * dt,
            velocity + mean * dt,
            mean,
        )

    def placement(self, profile: TiltProfile, time: Scalar) -> Placement:
        """The hand stays put; gravity is what turns."""
        zero = 0.0 * time
        tilt = self.tilt(profile, time)
        return Placement((Vec(zero, zero),), zero, self._gravity_at(tilt), tilt)

    def tilt(self, profile: TiltProfile, time: Scalar) -> Vec:
        """The angles (T1, T2) at a time of a period."""
        share = jnp.minimum(time / self.ramp_time, 1.0)
        return profile.start + (profile.target - profile.start) * share

    def top_speed(self, reach: float) -> float:
        """About the highest speed of an object in a hand of length `reach`, for plain numbers."""
        pull = float(self.gravity) * math.sqrt(2.0) * math.sin(float(self.amplitude))
        return math.sqrt(2.0 * pull * reach)

    def _tilt(self, draws: Float[Array, "2"]) -> Vec:
        return Vec(*(self.amplitude * (2.0 * draws[k] - 1.0) for k in (0, 1)))

    def _gravity_during(self, profile: TiltProfile, time: Scalar) -> Vec:
        return self._gravity_at(self.tilt(profile, time))

    def _gravity_at(self, tilt: Vec) -> Vec:
        # (1), first two components
        (sine, cosine), (other, _) = sine_and_cosine(tilt.x), sine_and_cosine(tilt.y)
        x, y = self.gravity * sine, -self.gravity * cosine * other
        c, s = self.turned.x, self.turned.y
        return Vec(x * c - y * s, x * s + y * c)
