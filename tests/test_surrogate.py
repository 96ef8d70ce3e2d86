"""The relaxed score: what it is, its limit, its derivatives, and their errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2

from pcjax.compiling import compiled_quickly
from pcjax.design.estimator import Estimator, Gradient
from pcjax.design.gradients import Differences, Mixture, Pathwise, differentiable_score
from pcjax.design.space import DesignSpace, design_space
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import INVALID
from pcjax.quality.surrogate import Sample, Surrogate
from pcjax.quality.task import Task
from pcjax.simulate.batch import run
from pcjax.simulate.event import EventDriven
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.relaxation import Layer, relaxed_survival
from pcjax.simulate.rounds import roll
from pcjax.simulate.stepping import Stepping

WIDE = box_hand(math.radians(-20), gap_width=400.0)
"""Half of the trials are out within 50 s."""


def task(**changes: Any) -> Task:
    settings: dict[str, Any] = {
        "body": Circle(25.0),
        "drive": WristTilt(),
        "directions": ("does", "eoen"),
        "max_steps": 50_000,
    }
    return Task(**(settings | changes))


def space() -> DesignSpace:
    return design_space(WIDE, ["fingertip_angle_deg", "fingertip_length"], 50.0)


# ------------------------------------------------------------------------------------- survival


def test_relaxed_survival_falls_smoothly_from_1_to_0() -> None:
    with jax.enable_x64(True):
        marks = jnp.linspace(-1.5, 1.5, 301)
        survival = relaxed_survival(2.0 * marks, jnp.asarray(2.0))
        slope = jax.vmap(jax.grad(lambda mark: relaxed_survival(mark, jnp.asarray(1.0))))
        bend = jax.vmap(jax.grad(jax.grad(lambda mark: relaxed_survival(mark, jnp.asarray(1.0)))))
        ends = jnp.array([-1.0, 1.0])
        assert np.all(np.diff(survival) <= 0)
        assert np.all(survival[marks <= -1] == 1)
        np.testing.assert_allclose(survival[marks >= 1], 0, atol=1e-14)
        np.testing.assert_allclose(survival + survival[::-1], 1, atol=1e-14)
        np.testing.assert_allclose(slope(ends), 0, atol=1e-14)
        np.testing.assert_allclose(bend(ends), 0, atol=1e-13)
        # The steepest place of F is its middle, F' = 15 / 16.
        np.testing.assert_allclose(slope(jnp.zeros(1)), -15 / 16, rtol=1e-12)


@pytest.mark.parametrize("make", [does, eoen], ids=["does", "eoen"])
@pytest.mark.parametrize("engine", [EventDriven(), Stepping(0.02)], ids=["event", "stepping"])
def test_a_thin_layer_gives_the_exact_trials(
    make: Callable[..., Scenario], engine: EventDriven | Stepping
) -> None:
    scenario = make(WIDE, Circle(25.0))
    settings: dict[str, Any] = {"trials": 200, "max_steps": 50_000, "precision": 64}
    exact = run([scenario], engine=engine, **settings)
    thin = run([scenario], engine=replace(engine, goal_layer=1e-6), **settings)
    assert thin.excursion is not None
    mark, _, held = np.moveaxis(thin.excursion[0], -1, 0)
    assert not np.any(thin.status == INVALID)
    # One that just touches the line and falls back is out in either.
    np.testing.assert_array_equal(mark > 0, exact.status[0] != LIMIT)
    step = 0.02 if isinstance(engine, Stepping) else 0.001
    np.testing.assert_allclose(held, exact.steps[0] * 0.001, atol=step + 0.001)


def test_the_relaxed_index_tends_to_the_exact_one() -> None:
    """Paired: the differences' standard errors are far below the exact index's own."""
    gaps = []
    scenarios = [does(WIDE, Circle(25.0)), eoen(WIDE, Circle(25.0))]
    settings: dict[str, Any] = {"trials": 4000, "max_steps": 50_000}
    exact = run(scenarios, engine=EventDriven(), **settings).steps * 0.001
    for layer in (0.8, 0.2, 0.05):
        relaxed = run(scenarios, engine=EventDriven(goal_layer=layer), **settings)
        assert relaxed.excursion is not None
        gaps.append(np.abs(relaxed.excursion[..., 2] - exact).mean(axis=1) / exact.mean(axis=1))
    assert np.all(gaps[0] < 0.08)
    assert np.all(gaps[1] < gaps[0])
    assert np.all(gaps[2] < 0.3 * gaps[0])


# ---------------------------------------------------------------------------------- derivatives


def held_by(scenario: Scenario, trials: int, periods: int, layer: float, dt: float) -> jax.Array:
    """The mean relaxed survival time of some trials, s."""
    stacked = jax.tree.map(lambda leaf: jnp.asarray(leaf, float)[None], scenario)
    numbers = jnp.arange(trials, dtype=jnp.int32)
    lanes = Lanes.fresh(jnp.zeros_like(numbers), numbers, np.float64)
    program = Stepping(dt, goal_layer=layer).program(stacked.drive.period)
    return jnp.mean(roll(program, stacked, jnp.uint32(3), periods, lanes).excursion.survival_time)


OPEN = HandDesign(
    WIDE.palm_length, WIDE.lengths, ((1.56, *WIDE.angles[0][1:]), (1.56, *WIDE.angles[1][1:]))
)
"""`WIDE` with sides that lean out a little: where they begin to lean in, the starts have a kink."""

SMOOTH = {
    "wrist, circle": (does(OPEN, Circle(25.0), law=ContactLaw(smoothing=5.0)), 32, 2),
    "wrist, circle, EoEn": (eoen(OPEN, Circle(25.0), law=ContactLaw(smoothing=5.0)), 32, 2),
    "arm, circle": (
        does(two_joint_hand(), Circle(50.0), PlanarArm(), ContactLaw(smoothing=10.0)),
        8,
        1,
    ),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_forward_mode_equals_differences_of_the_same_function_for_every_leaf(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the layer's width, which is not differentiated, none of the two sees a change."""
    of = Layer.of
    scenario, trials, periods = SMOOTH[name]
    with jax.enable_x64(True):
        width = float(of(scenario.hand.channel(), 0.8).width)
        monkeypatch.setattr(
            Layer, "of", lambda channel, share: replace(of(channel, share), width=width)
        )
        leaves, structure = jax.tree.flatten(scenario)
        at = jnp.array([float(leaf) for leaf in leaves])

        def mean(numbers: jax.Array) -> jax.Array:
            return held_by(jax.tree.unflatten(structure, list(numbers)), trials, periods, 0.8, 0.05)

        held = compiled_quickly(mean)
        slope = compiled_quickly(lambda at, way: jax.jvp(mean, (at,), (way,))[1])
        steps = np.maximum(np.abs(at), 1.0)
        ways = np.diag(steps)
        forward = np.array([slope(at, way) for way in ways])
        moves = 1e-6 * ways
        difference = np.array([held(at + m) - held(at - m) for m in moves]) / 2e-6
    assert np.sum(np.abs(forward) > 0.01) >= 8
    np.testing.assert_allclose(forward, difference, rtol=1e-6, atol=1e-6 * np.abs(forward).max())


def test_derivatives_are_finite_where_lengths_vanish() -> None:
    """At rest in a corner, just touching, without any motion, and behind a closed gap.

    The derivative along the sum of all leaves: not a number, if any of them had none.
    """

    def held(scenario: Scenario) -> jax.Array:
        return held_by(scenario, 4, 1, 0.8, 0.05)

    closed = box_hand(math.radians(30), gap_width=100.0, fingertip_length=100.0)
    still = WristTilt(amplitude=0.0)
    cases = [
        does(WIDE, Circle(25.0), still, ContactLaw(smoothing=5.0), start_spread=0.0),
        does(WIDE, Circle(25.0), still, start_spread=0.0),
        does(closed, Circle(25.0), WristTilt(), ContactLaw(smoothing=5.0)),
        does(box_hand(0.0, gap_width=50.0), Circle(25.0)),
    ]
    slope = compiled_quickly(lambda at: jax.jvp(held, (at,), (jax.tree.map(jnp.ones_like, at),))[1])
    for scenario in cases:
        with jax.enable_x64(True):
            at = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), scenario)
            assert np.isfinite(slope(at))


def test_the_derivative_of_the_compiled_score_is_the_differences() -> None:
    surrogate = Surrogate(task(max_steps=20_000), trials=64)
    design = space().design_of(WIDE)
    score = differentiable_score(surrogate, space(), block=64)
    value, slope = jax.value_and_grad(score)(design, 5)
    (told,) = Differences()(surrogate, space(), [design], 5)
    assert float(value) == pytest.approx(math.exp(told.value), rel=1e-5)
    np.testing.assert_allclose(slope, math.exp(told.value) * told.gradient, rtol=1e-3)
    forward = jax.jvp(lambda at: score(at, 5), (design,), (np.array([1.0, 2.0]),))[1]
    assert float(forward) == pytest.approx(float(slope @ np.array([1.0, 2.0])), rel=1e-4)
    for second in (jax.hessian(score), jax.jacfwd(jax.jit(jax.grad(score)))):
        with pytest.raises(NotImplementedError, match="no second derivatives"):
            jax.eval_shape(second, jnp.asarray(design, float), 5)


# ----------------------------------------------------------------------------------- estimators


def test_standard_errors_are_those_of_repetitions() -> None:
    """16 seeds, value and 2 derivatives: each variance ratio within the 99.99 % range of chi2 / 15,
    false alarms 3e-4."""
    surrogate = Surrogate(task(), trials=200)
    design = space().design_of(WIDE)
    found = [Differences()(surrogate, space(), [design], seed)[0] for seed in range(16)]
    values = np.array([[g.value, *g.gradient] for g in found])
    told = np.array([[g.value_se, *g.se] for g in found])
    ratios = values.var(axis=0, ddof=1) / (told**2).mean(axis=0)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 15) / 15
    assert np.all((low < ratios) & (ratios < high))


@pytest.mark.parametrize("form", ["horizon", "cloud", "exact"])
@pytest.mark.parametrize("directions", ["axial", "factorial"])
def test_differences_agree_with_exact_ones(form: str, directions: str) -> None:
    """|z| < 4.5 for 2 derivatives of 2 directions and the score: false alarms below 1e-4 a case.

    Differences over +-4 deg are biased, and relaxed ones too; 3 % of the scale is granted.
    """
    design = space().design_of(WIDE)
    relaxed = Surrogate(task(max_steps=100_000), form=form, trials=2000, burn_in=3)
    truth = Surrogate(task(max_steps=100_000), form="exact", trials=8000)
    (got,) = Differences(directions)(relaxed, space(), [design], 7)
    (true,) = Differences(reach=0.5)(truth, space(), [design], 8)
    for mine, my_se, theirs, their_se in (
        (got.gradient, got.se, true.gradient, true.se),
        (got.parts, got.parts_se, true.parts, true.parts_se),
    ):
        error = (mine - theirs) * space().scales
        allowed = 4.5 * np.hypot(my_se, their_se) * space().scales + 0.03
        assert np.all(np.abs(error) < allowed)


def test_several_designs_in_one_batch_are_the_same_as_each_alone() -> None:
    surrogate = Surrogate(task(), trials=60)
    designs = [np.array([-20.0, 100.0]), np.array([5.0, 80.0])]
    both = Differences()(surrogate, space(), designs, 2)
    for together, design in zip(both, designs, strict=True):
        (alone,) = Differences()(surrogate, space(), [design], 2)
        np.testing.assert_array_equal(together.gradient, alone.gradient)


def test_a_mixture_weighs_by_inverse_variances() -> None:

    @dataclass(frozen=True)
    class Fixed(Estimator):
        value: float
        se: float

        def __call__(self, *_: Any) -> list[Gradient]:
            one, covariance = np.array([self.value]), np.array([[self.se**2]])
            parts = one[None], one[None] * self.se
            return [Gradient(0.0, 1.0, one, covariance, *parts, 0.01, 10, 1.0)]

    (mixed,) = Mixture(Fixed(1.0, 0.1), Fixed(2.0, 0.2))(
        Surrogate(task()), space(), [np.zeros(2)], 0
    )
    weights = np.array([1 / 0.1**2, 1 / 0.2**2])
    assert mixed.gradient[0] == pytest.approx((weights @ [1.0, 2.0]) / weights.sum(), rel=1e-12)
    assert mixed.se[0] == pytest.approx(weights.sum() ** -0.5, rel=1e-12)


def test_pathwise_gradients_are_those_of_the_trials_mean() -> None:
    """Smooth contact, 1 period: the derivative of the estimate itself, in float64."""
    surrogate = Surrogate(task(max_steps=10_000), trials=8, contact_layer=0.2)
    wide = space()
    design = wide.design_of(WIDE)
    with jax.enable_x64(True):
        (got,) = Pathwise(block=8)(surrogate, wide, [design], 1)
        numbers = jnp.arange(8, dtype=jnp.int32)

        @compiled_quickly
        def score(at: jax.Array) -> jax.Array:
            engine = Stepping(0.05, goal_layer=0.8)
            values = surrogate.traced_values(wide.hand(at), engine, numbers, jnp.uint32(1))
            return surrogate.log_score(values.mean(axis=-1))

        moves = 1e-6 * np.diag(wide.scales)
        difference = [(score(design + m) - score(design - m)) / 2e-6 for m in moves]
        value = float(score(design))
    assert got.value == pytest.approx(value, rel=1e-4)
    np.testing.assert_allclose(got.gradient * wide.scales, difference, rtol=1e-4, atol=1e-8)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"objective": "index3"}, "index3"),
        ({"form": "clouds"}, "clouds"),
        ({"trials": 1}, "trials"),
        ({"goal_layer": 0.0}, "goal_layer"),
        ({"task": task(max_steps=12_345)}, "12345"),
        ({"task": task(body=Stick(25.0)), "form": "cloud"}, "knows circles without friction"),
    ],
)
def test_bad_settings_are_refused(changes: dict[str, Any], words: str) -> None:
    settings: dict[str, Any] = {"task": task()} | changes
    with pytest.raises(ValueError, match=words):
        Surrogate(**settings)


def test_a_closed_hand_has_no_gradient() -> None:
    closed = box_hand(math.radians(60), fingertip_length=110.0)
    shut = design_space(closed, ["fingertip_angle_deg"], 50.0, 0.0)
    with pytest.raises(ValueError, match="closed"):
        Differences()(Surrogate(task()), shut, [np.array([60.0])], 0)


def test_a_hand_that_lets_everybody_out_at_once_is_said_to() -> None:
    held = np.ones((2, 2, 2, 4))
    held[1, 1] = 0.0
    with pytest.raises(ValueError, match="every object out at once"):
        Surrogate(task()).appraise(Sample(held, np.ones(4, bool), 0))
