"""pcjax: how well a planar robot hand cages an object without closing on it."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pcjax.comparison import Ranking, compare
    from pcjax.design.optimize import Optimum, Settings, optimize
    from pcjax.design.score_map import score_map
    from pcjax.design.space import DesignSpace, design_space
    from pcjax.engines.stepping import trajectory
    from pcjax.evaluation import evaluate, evaluate_grid, evaluate_study
    from pcjax.export import export_hand
    from pcjax.inspection import Inspection, inspect
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
    from pcjax.viz.animation import animate
    from pcjax.viz.designs import plot_map

_WHERE = {
    "Body": "pcjax.model.body",
    "Circle": "pcjax.model.body",
    "ContactLaw": "pcjax.model.contact_law",
    "DesignSpace": "pcjax.design.space",
    "Differences": "pcjax.quality.gradients",
    "Drive": "pcjax.model.drive",
    "Estimate": "pcjax.quality.indices",
    "Evaluation": "pcjax.results",
    "HandDesign": "pcjax.model.hand",
    "Mixture": "pcjax.quality.gradients",
    "Inspection": "pcjax.inspection",
    "Optimum": "pcjax.design.optimize",
    "Pathwise": "pcjax.quality.gradients",
    "PlanarArm": "pcjax.model.arm",
    "Ranking": "pcjax.comparison",
    "Run": "pcjax.study.spec",
    "Scenario": "pcjax.model.scenario",
    "Settings": "pcjax.design.optimize",
    "State": "pcjax.physics.step",
    "Stick": "pcjax.model.body",
    "Study": "pcjax.study.spec",
    "Surrogate": "pcjax.quality.surrogate",
    "Sweep": "pcjax.study.spec",
    "Task": "pcjax.quality.surrogate",
    "WristTilt": "pcjax.model.drive",
    "animate": "pcjax.viz.animation",
    "box_hand": "pcjax.model.presets",
    "compare": "pcjax.comparison",
    "design_space": "pcjax.design.space",
    "differentiable_score": "pcjax.quality.gradients",
    "does": "pcjax.model.scenario",
    "eoen": "pcjax.model.scenario",
    "evaluate": "pcjax.evaluation",
    "evaluate_grid": "pcjax.evaluation",
    "evaluate_study": "pcjax.evaluation",
    "export_hand": "pcjax.export",
    "inspect": "pcjax.inspection",
    "load_study": "pcjax.study.read",
    "optimize": "pcjax.design.optimize",
    "plot_map": "pcjax.viz.designs",
    "register_body": "pcjax.model.body",
    "register_drive": "pcjax.model.drive",
    "register_hand": "pcjax.model.presets",
    "run_sweep": "pcjax.sweep",
    "score_map": "pcjax.design.score_map",
    "step": "pcjax.physics.step",
    "trajectory": "pcjax.engines.stepping",
    "two_joint_hand": "pcjax.model.presets",
}
"""Where each public name is. They are imported when they are asked for: JAX takes half a second."""

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
    "Inspection",
    "Mixture",
    "Optimum",
    "Pathwise",
    "PlanarArm",
    "Ranking",
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
    "compare",
    "design_space",
    "differentiable_score",
    "does",
    "eoen",
    "evaluate",
    "evaluate_grid",
    "evaluate_study",
    "export_hand",
    "inspect",
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


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(importlib.import_module(_WHERE[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
