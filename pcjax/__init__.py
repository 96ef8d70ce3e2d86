"""pcjax: how well a planar robot hand cages an object without closing on it."""

from pcjax.design.optimize import Optimum, Settings, optimize
from pcjax.design.space import DesignSpace, design_space
from pcjax.engines.stepping import trajectory
from pcjax.evaluate import evaluate
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import HandDesign, box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.step import State, step
from pcjax.quality.gradients import Differences, Mixture, Pathwise, differentiable_score
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate, Task
from pcjax.results import Evaluation
from pcjax.study import Run, Study, Sweep, load_study
from pcjax.sweep import run_sweep

__all__ = [
    "Circle",
    "ContactLaw",
    "DesignSpace",
    "Differences",
    "Estimate",
    "Evaluation",
    "HandDesign",
    "Mixture",
    "Optimum",
    "Pathwise",
    "PlanarArm",
    "Run",
    "Scenario",
    "Settings",
    "State",
    "Stick",
    "Study",
    "Surrogate",
    "Sweep",
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
    "run_sweep",
    "step",
    "trajectory",
    "two_joint_hand",
]
