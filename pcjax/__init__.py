"""pcjax: how well a planar robot hand cages an object without closing on it."""

from pcjax.engines.stepping import trajectory
from pcjax.evaluate import evaluate
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import HandDesign, box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.step import State, step
from pcjax.quality.indices import Estimate
from pcjax.results import Evaluation

__all__ = [
    "Circle",
    "ContactLaw",
    "Estimate",
    "Evaluation",
    "HandDesign",
    "PlanarArm",
    "Scenario",
    "State",
    "Stick",
    "WristTilt",
    "box_hand",
    "does",
    "eoen",
    "evaluate",
    "step",
    "trajectory",
    "two_joint_hand",
]
