"""A drive seen in a mirror: for an object outside the hand, in the mirror image of its body.

The hand for EoEn has its fingertips mirrored across the line through their joints (Fig. 8(b)). That
is the real hand seen in this mirror: the object's box is the mirror image of the hand's body and
the fingertips are the real ones. So gravity and the hand's motion have to be seen in it as well.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
from jaxtyping import Array

from pcjax.model.drive import Drive
from pcjax.model.motion import Carry, Motion
from pcjax.planar import Flag, Mirror, Scalar, Vec


class MirroredDrive(eqx.Module):
    """A drive as it is seen in a mirror that is fixed to the hand; exact for every drive.

    Arguments:
        drive: the hand's.
        mirror: in the hand frame.
    """

    drive: Drive
    mirror: Mirror

    @property
    def targets_per_period(self) -> int:
        """As the drive's."""
        return self.drive.targets_per_period

    @property
    def period(self) -> float:
        """As the drive's."""
        return self.drive.period

    def swing(self, before: Array, draws: Array, first: Flag) -> Any:
        """As the drive's."""
        return self.drive.swing(before, draws, first)

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
