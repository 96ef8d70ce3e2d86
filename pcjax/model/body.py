"""The object that the hand holds."""

from __future__ import annotations

import equinox as eqx

from pcjax.checks import check_positive
from pcjax.planar import Scalar


class Circle(eqx.Module):
    """A circle of radius r_o. Its mass M_o cancels from the indices; it is kept for energies.

    Raises:
        ValueError: a radius or mass that is not a positive number.
    """

    radius: Scalar
    mass: Scalar

    def __init__(self, radius: Scalar, mass: Scalar = 1.0):
        check_positive("radius", radius)
        check_positive("mass", mass)
        self.radius = radius
        self.mass = mass
