"""What tilts a hand in three dimensions."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float

from pcjax.components import Registry, quantity
from pcjax.geometry import Scalar
from pcjax.model.drives.base import Drive, duration_field, gravity_field

SPATIAL_DRIVES: Registry[SpatialTilt] = Registry("tilt", "pcjax.tilts", (__name__,))
"""What moves a hand in three dimensions, as study files name it."""


@SPATIAL_DRIVES.register("tilt")
class SpatialTilt(Drive):
    """The wrist manipulator of Sec. 3.3 with a hand in three dimensions on it.

    With both angles 0 gravity points along `rest` in the hand's frame. In every period both move at
    uniform speed to new targets T1, T2 ~ U(-amplitude, amplitude), reach them after `ramp_time` and
    hold them; gravity is then g (sin T1, -cos T1 sin T2, -cos T1 cos T2), as in (1), in axes of
    which the third points against `rest` and the first is as close to the hand's x axis as may be
    (to its y axis where `rest` is within 26 deg of x).

    Arguments:
        amplitude: largest tilt, radians.
        rest: where gravity points at rest, in the hand's frame; of any length but 0.
        gravity: g, m / s^2.
        ramp_time: seconds of each period in which the wrist turns.
        period: seconds between draws of new targets.

    Raises:
        ValueError: a number out of range, or a direction of no length.

    Examples:
        Gravity of a hand whose palm lies in the plane of x and y, as in the paper:

        >>> import numpy as np
        >>> from pcjax.model.spatial.tilt import SpatialTilt
        >>> drive = SpatialTilt(0.5, (0.0, 0.0, -1.0))
        >>> x, _, z = drive.pull(np.array([[0.5, 0.0]]))[0]
        >>> print(f"{x:.2f} {z:.2f}")
        4.70 -8.60
    """

    amplitude: Scalar = quantity("angle", "largest tilt", low=0, high=math.pi, key="amplitude")
    rest: tuple[Scalar, ...] = quantity(
        "1", "where gravity points at rest, in the hand's frame", count=3, each="axis", key="rest"
    )
    gravity: Scalar = gravity_field()
    ramp_time: float = duration_field("of each period, in which the wrist turns", 1.0, "ramp_time")
    period: float = duration_field("between new targets", 10.0, "period")

    targets_per_period = 2
    usual_max_steps = 60_000
    usual_directions = "does"

    def __check_init__(self) -> None:
        super().__check_init__()
        if not np.linalg.norm(self._rest) > 0:
            raise ValueError("rest is a direction of no length: it says where gravity points")
        if self.ramp_time > self.period:
            raise ValueError(
                f"ramp_time is {self.ramp_time:g}: it has to be at most the period, {self.period:g}"
            )

    @property
    def _rest(self) -> Float[np.ndarray, "3"]:
        return np.array([float(x) for x in self.rest])

    def axes(self) -> Float[np.ndarray, "3 3"]:
        """The axes that gravity is given in, as columns in the hand's frame."""
        up = -self._rest / np.linalg.norm(self._rest)
        along = np.eye(3)[1 if abs(up[0]) > 0.9 else 0]
        first = along - up * (up @ along)
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(up, first), up], axis=1)

    def angles(
        self,
        before: Float[np.ndarray, "trials 2"],
        draws: Float[np.ndarray, "trials 2"],
        time: float,
        first: bool,
    ) -> Float[np.ndarray, "trials 2"]:
        """T1 and T2 at a time of a period, radians, from the draws of the last one and its own."""
        old, new = ((2 * one - 1) * float(self.amplitude) for one in (before, draws))
        old = 0 * old if first else old
        return old + min(time / self.ramp_time, 1.0) * (new - old)

    def pull(self, angles: Float[np.ndarray, "trials 2"]) -> Float[np.ndarray, "trials 3"]:
        """Gravity in the hand's frame for angles T1 and T2, m / s^2."""
        (s1, s2), (c1, c2) = np.sin(angles).T, np.cos(angles).T
        return float(self.gravity) * np.stack([s1, -c1 * s2, -c1 * c2], axis=1) @ self.axes().T

    def attitude(self, angles: Float[np.ndarray, "2"]) -> Float[np.ndarray, "3 3"]:
        """What takes directions in the hand's frame to a world in which gravity points along -z:
        the hand has turned about x by T2, and then about y by T1, of the axes above."""
        (s1, s2), (c1, c2) = np.sin(angles), np.cos(angles)
        about_y = np.array([[c1, 0, s1], [0, 1, 0], [-s1, 0, c1]])
        about_x = np.array([[1, 0, 0], [0, c2, -s2], [0, s2, c2]])
        return about_y @ about_x @ self.axes().T

    def top_speed(self, reach: float) -> float:
        """Of a fall through a hand of that length, m / s."""
        return math.sqrt(2 * float(self.gravity) * reach)
