"""Baseline: the scene of `pymunk_scene` in Box2D (`pip install Box2D`)."""

from collections.abc import Sequence
from typing import Any

import Box2D  # pyright: ignore[reportMissingImports]
import numpy as np
from numpy.typing import NDArray

from benchmarks.pymunk_scene import Solid

METRES = 0.1
"""Of a unit of length: Box2D wants things of 0.1 to 10 m, and its slop is 5 mm."""


class Box2DScene:
    """Static edges without thickness, and a body: Box2D rounds all polygons by 1 cm itself."""

    def __init__(self, limbs: NDArray[np.float64], solid: Solid, start: Sequence[float]):
        self.world: Any = Box2D.b2World(gravity=(0, 0), doSleep=False)
        hand = self.world.CreateStaticBody()
        for ax, ay, bx, by in (METRES * limbs).tolist():
            hand.CreateEdgeFixture(vertices=[(ax, ay), (bx, by)], friction=1.0, restitution=0.0)
        self.body = self.world.CreateDynamicBody(
            position=(METRES * start[0], METRES * start[1]), angle=solid.angle
        )
        # Friction of a pair is the root of the product, restitution the larger one.
        common = {"density": 1.0, "friction": solid.friction**2, "restitution": solid.restitution}
        if len(solid.vertices) == 1:
            self.body.CreateCircleFixture(radius=METRES * solid.rounding, **common)
        else:
            corners = [(METRES * x, METRES * y) for x, y in solid.vertices.tolist()]
            self.body.CreatePolygonFixture(vertices=corners, **common)
        mass = self.body.massData
        mass.mass, mass.I, mass.center = 1.0, METRES**2 * solid.inertia, (0.0, 0.0)
        self.body.massData = mass

    def step(self, gravity: tuple[float, float], dt: float) -> tuple[float, float]:
        """Goes on by `dt` seconds; where the centre is then."""
        self.world.gravity = (METRES * gravity[0], METRES * gravity[1])
        self.world.Step(dt, 8, 3)
        x, y = self.body.position
        return x / METRES, y / METRES
