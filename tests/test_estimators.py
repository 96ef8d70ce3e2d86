"""Exact derivatives of trajectories along the leaps of the event-driven engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import pcjax
from experiments.estimators import Trial as Run
from experiments.estimators import _weighed, dearness, growth_rows, pushed
from experiments.trajectories import PEAK, X, started
from pcjax.compiling import quick_options
from pcjax.model.scenario import Scenario
from pcjax.physics.state import RUNNING
from pcjax.simulate.draws import period_draws, trial_key
from pcjax.simulate.relaxation import NOWHERE

SHARE = 0.5
STEEP = np.array([0.5, 1.0])
"""Draws of the largest T2: gravity points at the palm."""


@pytest.fixture(autouse=True, scope="module")
def double() -> Iterator[None]:
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def period() -> Callable[..., Any]:
    """A period and its derivatives along one way, compiled once."""
    return jax.jit(pushed, compiler_options=quick_options())


def scenario(angle: Any) -> Scenario:
    made = pcjax.does(pcjax.box_hand(angle), pcjax.Circle(25.0))
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, float), made)


def one_way(tree: Any) -> Any:
    return jax.tree.map(lambda leaf: leaf[None], tree)


def test_derivative_of_a_fall_and_its_rebound(period: Callable[..., Any]) -> None:
    # From rest at height h above the palm: t = sqrt(2 h / g), v = g t, and tau = 10 s - t later
    # y = e v tau - g tau^2 / 2, with dt/dh = 1 / v and dv/dh = g / v.
    here = scenario(0.2)
    height, pull, rebound = 200.0, 9.8 * math.sin(math.pi / 6), 0.1
    speed = math.sqrt(2 * pull * height)
    tau = 10.0 - speed / pull
    numbers = jnp.array([0.0, 25.0 + height, 0.0, 0.0, NOWHERE, 0.0])
    along = jnp.eye(6)[1:2], jnp.zeros((1, 2)), jnp.zeros((1, 2))
    still = jax.tree.map(lambda leaf: jnp.zeros((1, *leaf.shape)), here)
    ended, slopes = period(
        here, still, SHARE, numbers, STEEP, STEEP, False, jnp.int32(RUNNING), along
    )
    y, v = rebound * speed * tau - pull * tau**2 / 2, rebound * speed - pull * tau
    np.testing.assert_allclose(ended.numbers[X], [0.0, 25.0 + y, 0.0, v], atol=1e-4)
    slope = (1 + rebound) * pull * tau / speed - rebound
    expected = [0.0, slope, 0.0, (1 + rebound) * pull / speed]
    np.testing.assert_allclose(slopes[0, X], expected, atol=1e-6)


def test_a_trajectorys_derivative_is_that_of_small_differences(period: Callable[..., Any]) -> None:
    # Six trials, three periods each, that reach the fingertips, whose angle is turned.
    def run(angle: float, number: int) -> tuple[np.ndarray, np.ndarray, int]:
        here, turned = jax.jvp(scenario, (jnp.asarray(angle),), (jnp.asarray(1.0),))
        key = trial_key(3, number)
        numbers, slopes = jax.jvp(lambda one: started(one, key), (here,), (turned,))
        slopes, before, status, leaps = slopes[None], np.full(2, 0.5), jnp.int32(RUNNING), 0
        for m in range(3):
            draws = period_draws(key, m, 2).astype(float)
            along = slopes, jnp.zeros((1, 2)), jnp.zeros((1, 2))
            ended, slopes = period(
                here, one_way(turned), SHARE, numbers, before, draws, m == 0, status, along
            )
            numbers, before, status = ended.numbers, draws, ended.status
            leaps += int(ended.leaps)
        assert status == RUNNING
        return np.asarray(numbers[:PEAK]), np.asarray(slopes[0, :PEAK]), leaps

    step, moved = 1e-6, 0
    trials = (12, 15, 21, 25, 40, 41)
    for number in trials:
        _, slope, leaps = run(0.17, number)
        ahead, back = run(0.17 + step, number), run(0.17 - step, number)
        assert leaps == ahead[2] == back[2]  # no jump in between
        difference = (ahead[0] - back[0]) / (2 * step)
        np.testing.assert_allclose(slope, difference, rtol=1e-3, atol=1e-3)
        moved += bool(np.abs(slope).max() > 1)
    assert moved == len(trials)


def test_moving_draws_with_their_density_changes_no_mean() -> None:
    # One period whose draw u moves by v(u), 0 at both edges: d/du (f v) integrates to 0. On the
    # midpoints of many intervals, f = u^2 seconds held.
    u = (np.arange(20_000) + 0.5) / 20_000
    v, change = u * (1 - u), 1 - 2 * u
    none = np.zeros_like(u)
    numbers = np.stack([none] * 5 + [u**2], axis=1)
    slopes = np.zeros((len(u), 1, 6))
    slopes[:, 0, 5] = 2 * u * v
    some: Any = numbers, slopes, none[:, None], change[:, None, None], none[:, None], none
    run = Run(*some)
    assert np.mean(_weighed(run)) == pytest.approx(0.0, abs=1e-8)


def test_dearness_is_squared_error_times_time() -> None:
    def row(name: str, se: float, cpu: float) -> dict[str, Any]:
        where = {"group": "a", "design": "b", "parameter": "c", "of": "does"}
        return where | {"estimator": name, "se": se, "cpu": cpu}

    rows = [row("differences", 0.1, 2.0), row("other", 0.3, 4.0)]
    assert dearness(rows, "other", "does") == pytest.approx(18.0)


def test_growth_is_that_of_trials_under_way() -> None:
    growth = np.full((1, 200, 2), np.nan)
    growth[0, :101, 0] = np.arange(101)
    growth[0, :40, 1] = 1.0  # too few to tell
    (row,) = growth_rows("other", "a", "b", growth)
    assert (row["period"], row["trials"], row["q0.9"], row["q1"]) == (1, 101, "90", "100")
