"""pcjax: how well a planar robot hand cages an object without closing on it."""

import importlib
from typing import TYPE_CHECKING, Any

from pcjax.design.optimize import Optimum, Settings, optimize
from pcjax.design.score_map import score_map
from pcjax.design.space import DesignSpace, design_space
from pcjax.engines.stepping import trajectory
from pcjax.evaluate import evaluate
from pcjax.export import export_hand
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Body, Circle, Stick, register_body
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import Drive, WristTilt, register_drive
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand, register_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.step import State, step
from pcjax.quality.gradients import Differences, Mixture, Pathwise, differentiable_score
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import Surrogate, Task
from pcjax.results import Evaluation
from pcjax.study.read import load_study
from pcjax.study.spec import Run, Study, Sweep
from pcjax.sweep import run_sweep

if TYPE_CHECKING:
    from pcjax.viz.animation import animate
    from pcjax.viz.designs import plot_map

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
    "animate",
    "box_hand",
    "design_space",
    "differentiable_score",
    "does",
    "eoen",
    "evaluate",
    "export_hand",
    "load_study",
    "optimize",
    "plot_map",
    "register_body",
    "register_drive",
    "register_hand",
    "run_sweep",
    "score_map",
    "step",
    "trajectory",
    "two_joint_hand",
]

_PICTURES = {"animate": "pcjax.viz.animation", "plot_map": "pcjax.viz.designs"}


def __getattr__(name: str) -> Any:
    """Imports what draws only when it is asked for: matplotlib takes a second."""
    if name not in _PICTURES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_PICTURES[name]), name)
