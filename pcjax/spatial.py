"""Hands in three dimensions, from MJCF and URDF files, by their short names.

`pcjax.evaluate_study`, `compare`, `inspect`, `run_sweep`, `optimize` and the command line take such
a study as they take one of a hand in the plane. MuJoCo simulates it: `pip install 'pcjax[mujoco]'`.

Examples:
    >>> import math, pcjax
    >>> from pcjax import spatial
    >>> hand = spatial.Hand(
    ...     spatial.PRESETS["three-finger"],
    ...     spatial.StartBox((0.0, 0.0, 0.036), (0.002, 0.002, 0.001)),
    ...     root="palm",
    ...     posture={"tip1": math.radians(20), "tip2": math.radians(20), "tip3": math.radians(20)},
    ... )
    >>> drive = spatial.Tilt(math.radians(60), rest=(1.0, 0.0, 0.0))
    >>> study = spatial.Study(hand, spatial.Sphere(0.024), drive, run=pcjax.Run(trials=4))
    >>> pcjax.evaluate_study(study).status("does")["invalid"]
    0
"""

from pcjax.design.postures import PostureSpace, posture_space
from pcjax.model.spatial.bodies import Box, Cylinder, Ellipsoid, Mesh, Sphere
from pcjax.model.spatial.bodies import SpatialCapsule as Capsule
from pcjax.model.spatial.hand import PRESETS
from pcjax.model.spatial.hand import SpatialHand as Hand
from pcjax.model.spatial.regions import HullEscape, PlaneEscape, StartBox
from pcjax.model.spatial.scenario import SpatialScenario as Scenario
from pcjax.model.spatial.tilt import SpatialTilt as Tilt
from pcjax.simulate.backends.mujoco import MuJoCo
from pcjax.study.spatial import SpatialStudy as Study

__all__ = [
    "PRESETS",
    "Box",
    "Capsule",
    "Cylinder",
    "Ellipsoid",
    "Hand",
    "HullEscape",
    "Mesh",
    "MuJoCo",
    "PlaneEscape",
    "PostureSpace",
    "Scenario",
    "Sphere",
    "StartBox",
    "Study",
    "Tilt",
    "posture_space",
]
