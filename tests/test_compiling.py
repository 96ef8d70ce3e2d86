"""What compiles anew: no number of a study does; and what is kept for the next process."""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import numpy as np
import pytest

from pcjax import compiling, geometry
from pcjax.cli import compilation_cache
from pcjax.compiling import Kept, compiled_quickly, quick_options
from pcjax.geometry import Vec
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import Goal
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does
from pcjax.physics.contact import table
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
        before = programs.count
        for scenario in scenarios:
            run([scenario], engine=engine, trials=4, max_steps=10_000)
        return programs.count - before

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


class Drawer:
    """A shelf for one process."""

    def __init__(self) -> None:
        self.kept: dict[str, bytes] = {}

    def get(self, key: str) -> bytes | None:
        return self.kept.get(key)

    def put(self, key: str, value: bytes) -> None:
        self.kept[key] = value

    def aside(self) -> Any:
        return contextlib.nullcontext()


@pytest.fixture
def drawer(monkeypatch: pytest.MonkeyPatch) -> Drawer:
    drawer = Drawer()
    monkeypatch.setattr(compiling, "_shelf", drawer)
    monkeypatch.setattr(compiling, "_rewritten", False)
    # What JAX has kept cannot be kept once more.
    monkeypatch.setattr(compilation_cache._aside, "value", True, raising=False)
    return drawer


def test_what_is_kept_is_not_traced_again_and_what_is_damaged_is_compiled(
    drawer: Drawer, monkeypatch: pytest.MonkeyPatch
) -> None:
    traced = []

    def scaled(points: list[Vec], factor: Any) -> dict[str, Vec]:
        traced.append(factor)
        return {"sum": (points[0] + points[1]) * factor}

    scaled.__module__, scaled.__qualname__ = "pcjax.geometry", "scaled"
    monkeypatch.setattr(geometry, "scaled", scaled, raising=False)

    def outcome(count: int = 3) -> Vec:
        ones = np.ones(count, np.float32)
        return Kept(scaled, {})([Vec(ones, ones), Vec(ones, 2 * ones)], np.float32(3))["sum"]

    first = outcome()
    assert (len(traced), len(drawer.kept)) == (1, 1)
    second = outcome()
    assert len(traced) == 1
    np.testing.assert_array_equal(second.y, first.y)
    assert np.asarray(first.y).tolist() == [9.0, 9.0, 9.0]
    (key,) = drawer.kept
    for damaged in (b"", drawer.kept[key][:-200], pickle.dumps(((b"", 0, 0), 1))):
        drawer.kept[key] = damaged
        before = len(traced)
        np.testing.assert_array_equal(outcome().y, first.y)
        assert len(traced) == before + 1
    outcome(4)
    assert len(drawer.kept) == 2


def test_with_another_contact_for_a_circle_nothing_is_kept(
    drawer: Drawer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "CONTACTS", dict(table.CONTACTS))
    numbers = np.float32(2), np.float32(-1), np.float32(0)
    assert float(Kept(geometry.first_root, {})(*numbers)) == 2.0
    assert len(drawer.kept) == 1
    drawer.kept.clear()
    table.register_contact(Circle)(table.CONTACTS[Circle])
    assert float(Kept(geometry.first_root, {})(*numbers)) == 2.0
    assert not drawer.kept


def test_what_a_name_does_not_tell_is_not_kept(drawer: Drawer) -> None:
    """A function of one's own, or one that is made of this package's."""
    goal = does(box_hand(), Circle(25.0)).hand.goal()
    line = jax.tree.map(np.float32, goal)
    point = Vec(np.float32(3), np.float32(4))
    inward = Kept(lambda line, point: -line.beyond(point), {})
    slope = Kept(jax.grad(Goal.beyond, argnums=1), {})
    assert float(inward(line, point)) == -float(goal.beyond(point))
    assert float(slope(line, point).y) == 1.0
    assert not drawer.kept


def test_programs_of_other_peoples_classes_are_not_kept(drawer: Drawer) -> None:
    class Mine(eqx.Module):
        x: Any

    doubled = Kept(lambda mine: mine.x * 2, {})
    assert float(doubled(Mine(np.float32(2)))) == 4.0
    assert not drawer.kept
    assert doubled.count == 1


def test_evaluating_waits_for_no_library_that_it_may_not_need() -> None:
    """In a process of its own."""
    code = (
        "import sys, pcjax.cli as c\n"
        "c.main('evaluate --trials 4 --max-steps 2000 --direction does --json'.split())\n"
        "print(*{'xarray', 'pandas', 'optax', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[1:] == [""]


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
