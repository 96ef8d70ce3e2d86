"""What compiles anew: no number of a study does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import pytest

from pcjax.compiling import compiled_quickly, quick_options
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does
from pcjax.simulate import workers
from pcjax.simulate.batch import run
from pcjax.simulate.engine import Engine
from pcjax.simulate.event import EventDriven
from pcjax.simulate.stepping import Stepping

pytestmark = pytest.mark.usefixtures("quick_programs")


def test_no_number_compiles_anew() -> None:
    programs = workers.advance_for("cpu")
    hand = box_hand()

    def compiled(engine: Engine, *scenarios: Scenario) -> int:
        """How many programs these need that were not there."""
        before = programs._cache_size()
        for scenario in scenarios:
            run([scenario], engine=engine, trials=4, max_steps=10_000)
        return programs._cache_size() - before

    def wrist(**changes: float) -> Scenario:
        return does(hand, Circle(25.0), WristTilt(**changes), ContactLaw(0.3))

    def arm(radius: float, **changes: float) -> Scenario:
        return does(two_joint_hand(), Circle(radius), PlanarArm(**changes))

    leaping, stepping = EventDriven(), Stepping(0.04)
    assert compiled(leaping, wrist()) <= 1
    assert compiled(stepping, wrist()) <= 1
    assert compiled(stepping, arm(50.0)) <= 1
    others = [
        wrist(period=8.0),
        wrist(ramp_time=2.0, gravity=5.0),
        wrist(amplitude=0.2, period=12.5),
        does(box_hand(0.3, gap_width=300.0), Circle(10.0), WristTilt(), ContactLaw(0.9, 0.01), 0.3),
    ]
    assert compiled(leaping, *others) == 0
    for dt in (0.04, 0.02, 0.013):
        assert compiled(Stepping(dt), *others) == 0
        assert (
            compiled(Stepping(dt), arm(20.0), arm(30.0, ramp_time=2.0), arm(9.0, period=5.0)) == 0
        )
    for engine in (leaping, stepping):
        assert compiled(replace(engine, goal_layer=0.2), wrist()) <= 1
        assert compiled(replace(engine, goal_layer=0.7), wrist(), wrist(period=8.0)) == 0


def test_options_that_the_compiler_does_not_know_are_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They come and go with its versions."""
    usual, jit = quick_options(), jax.jit

    def newer(function: Any, compiler_options: dict[str, Any]) -> Any:
        strange = {f"{name}_of_old": value for name, value in compiler_options.items()}
        return jit(function, compiler_options=strange)

    with monkeypatch.context() as patch:
        patch.setattr(jax, "jit", newer)
        assert quick_options.__wrapped__() == {}
    assert usual["xla_backend_optimization_level"] == 0
    assert quick_options.__wrapped__() == usual
    doubled = compiled_quickly(lambda x, times: x * times, static_argnames="times")
    assert float(doubled(2.0, times=3)) == 6.0
