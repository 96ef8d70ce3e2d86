"""pcjax: how well a planar robot hand cages an object without closing on it."""

from pcjax.design.optimize import Optimum, Settings, optimize
from pcjax.design.space import DesignSpace, design_space
from pcjax.engines.stepping import trajectory
from pcjax.evaluate import evaluate
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Body, Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import Drive, WristTilt
from pcjax.model.hand import HandDesign, box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.step import State, step
from pcjax.quality.gradients import Differences, Mixture, Pathwise, differentiable_score
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate, Task
from pcjax.results import Evaluation
from pcjax.study import Study, load_study

__all__ = [
    "Body",
    "Circle",
    "ContactLaw",
    "DesignSpace",
    "Differences",
    "Drive",
    "Estimate",
    "Evaluation",
    "HandDesign",
    "Mixture",
    "Optimum",
    "Pathwise",
    "PlanarArm",
    "Scenario",
    "Settings",
    "State",
    "Stick",
    "Study",
    "Surrogate",
    "Task",
    "WristTilt",
    "box_hand",
    "design_space",
    "differentiable_score",
    "does",
    "eoen",
    "evaluate",
    "load_study",
    "optimize",
    "step",
    "trajectory",
    "two_joint_hand",
]
