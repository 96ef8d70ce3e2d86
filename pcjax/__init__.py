"""pcjax: how well a planar robot hand cages an object without closing on it."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pcjax.design.front import trade_off
    from pcjax.design.gradients import Differences, Mixture, Pathwise, differentiable_score
    from pcjax.design.map import score_map
    from pcjax.design.optimize import optimize
    from pcjax.design.outcome import Optimum, Settings
    from pcjax.design.space import DesignSpace, design_space
    from pcjax.model.bodies.base import Body, register_body
    from pcjax.model.bodies.circle import Circle
    from pcjax.model.bodies.convex import Capsule, Polygon, Rectangle, RegularPolygon, Square
    from pcjax.model.bodies.stick import Stick
    from pcjax.model.contact import ContactLaw
    from pcjax.model.drives.arm import PlanarArm
    from pcjax.model.drives.base import Drive, register_drive
    from pcjax.model.drives.wrist import WristTilt
    from pcjax.model.hand import HandDesign
    from pcjax.model.presets import box_hand, register_hand, two_joint_hand
    from pcjax.model.scenario import Scenario, does, eoen
    from pcjax.physics.state import State
    from pcjax.physics.step import step
    from pcjax.quality.energy import EscapeEnergy, energy
    from pcjax.quality.indices import Estimate
    from pcjax.quality.occupancy import Occupancy, occupancy
    from pcjax.quality.surrogate import Surrogate
    from pcjax.quality.task import Task
    from pcjax.results.evaluation import Evaluation
    from pcjax.simulate.engine import Engine, register_engine
    from pcjax.simulate.stepping import trajectory
    from pcjax.study.compare import Ranking, compare
    from pcjax.study.drawing import read_drawing
    from pcjax.study.energy import energy_of_study
    from pcjax.study.evaluate import evaluate, evaluate_grid, evaluate_study
    from pcjax.study.inspect import Inspection, inspect
    from pcjax.study.occupancy import occupancy_of_study
    from pcjax.study.read import load_study
    from pcjax.study.spec import Run, Study, Sweep
    from pcjax.sweep.run import run_sweep
    from pcjax.view.animation import animate
    from pcjax.view.designs import plot_map
    from pcjax.view.energy import plot_energy
    from pcjax.view.export import export_hand
    from pcjax.view.occupancy import plot_occupancy

_WHERE = {
    "Body": "pcjax.model.bodies.base",
    "Capsule": "pcjax.model.bodies.convex",
    "Circle": "pcjax.model.bodies.circle",
    "ContactLaw": "pcjax.model.contact",
    "DesignSpace": "pcjax.design.space",
    "Differences": "pcjax.design.gradients",
    "Drive": "pcjax.model.drives.base",
    "Engine": "pcjax.simulate.engine",
    "EscapeEnergy": "pcjax.quality.energy",
    "Estimate": "pcjax.quality.indices",
    "Evaluation": "pcjax.results.evaluation",
    "HandDesign": "pcjax.model.hand",
    "Mixture": "pcjax.design.gradients",
    "Inspection": "pcjax.study.inspect",
    "Occupancy": "pcjax.quality.occupancy",
    "Optimum": "pcjax.design.outcome",
    "Pathwise": "pcjax.design.gradients",
    "PlanarArm": "pcjax.model.drives.arm",
    "Polygon": "pcjax.model.bodies.convex",
    "Ranking": "pcjax.study.compare",
    "Rectangle": "pcjax.model.bodies.convex",
    "RegularPolygon": "pcjax.model.bodies.convex",
    "Run": "pcjax.study.spec",
    "Scenario": "pcjax.model.scenario",
    "Settings": "pcjax.design.outcome",
    "Square": "pcjax.model.bodies.convex",
    "State": "pcjax.physics.state",
    "Stick": "pcjax.model.bodies.stick",
    "Study": "pcjax.study.spec",
    "Surrogate": "pcjax.quality.surrogate",
    "Sweep": "pcjax.study.spec",
    "Task": "pcjax.quality.task",
    "WristTilt": "pcjax.model.drives.wrist",
    "animate": "pcjax.view.animation",
    "box_hand": "pcjax.model.presets",
    "compare": "pcjax.study.compare",
    "design_space": "pcjax.design.space",
    "differentiable_score": "pcjax.design.gradients",
    "does": "pcjax.model.scenario",
    "energy": "pcjax.quality.energy",
    "energy_of_study": "pcjax.study.energy",
    "eoen": "pcjax.model.scenario",
    "evaluate": "pcjax.study.evaluate",
    "evaluate_grid": "pcjax.study.evaluate",
    "evaluate_study": "pcjax.study.evaluate",
    "export_hand": "pcjax.view.export",
    "inspect": "pcjax.study.inspect",
    "load_study": "pcjax.study.read",
    "occupancy": "pcjax.quality.occupancy",
    "occupancy_of_study": "pcjax.study.occupancy",
    "optimize": "pcjax.design.optimize",
    "plot_energy": "pcjax.view.energy",
    "plot_map": "pcjax.view.designs",
    "plot_occupancy": "pcjax.view.occupancy",
    "read_drawing": "pcjax.study.drawing",
    "register_body": "pcjax.model.bodies.base",
    "register_drive": "pcjax.model.drives.base",
    "register_engine": "pcjax.simulate.engine",
    "register_hand": "pcjax.model.presets",
    "run_sweep": "pcjax.sweep.run",
    "score_map": "pcjax.design.map",
    "step": "pcjax.physics.step",
    "trade_off": "pcjax.design.front",
    "trajectory": "pcjax.simulate.stepping",
    "two_joint_hand": "pcjax.model.presets",
}
"""Where each public name is. They are imported when they are asked for: JAX takes half a second."""

__all__ = [
    "Body",
    "Capsule",
    "Circle",
    "ContactLaw",
    "DesignSpace",
    "Differences",
    "Drive",
    "Engine",
    "EscapeEnergy",
    "Estimate",
    "Evaluation",
    "HandDesign",
    "Inspection",
    "Mixture",
    "Occupancy",
    "Optimum",
    "Pathwise",
    "PlanarArm",
    "Polygon",
    "Ranking",
    "Rectangle",
    "RegularPolygon",
    "Run",
    "Scenario",
    "Settings",
    "Square",
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
    "energy",
    "energy_of_study",
    "eoen",
    "evaluate",
    "evaluate_grid",
    "evaluate_study",
    "export_hand",
    "inspect",
    "load_study",
    "occupancy",
    "occupancy_of_study",
    "optimize",
    "plot_energy",
    "plot_map",
    "plot_occupancy",
    "read_drawing",
    "register_body",
    "register_drive",
    "register_engine",
    "register_hand",
    "run_sweep",
    "score_map",
    "step",
    "trade_off",
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
