"""What several tests use: trials step by step, with one compiled program for a kind of scenario."""

from __future__ import annotations

import functools
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from pcjax.model.scenario import Scenario
from pcjax.physics.state import State
from pcjax.physics.step import step
from pcjax.simulate.stepping import trajectory

_CHUNK = 100

T = TypeVar("T")


def _scan(scenario: Scenario, profile: Any, begin: State, steps: int, dt: Any) -> State:
    def one(state: State, _: None) -> tuple[State, State]:
        state = step(scenario, profile, state, dt)
        return state, state

    return jax.lax.scan(one, begin, length=steps)[1]


@jax.jit
def _chunk(scenario: Scenario, profile: Any, begin: State, dt: Any) -> State:
    return _scan(scenario, profile, begin, _CHUNK, dt)


@functools.partial(jax.jit, static_argnames=("periods", "dt"))
def path_of(scenario: Scenario, trial: Any, periods: int = 1, dt: float = 0.001) -> State:
    """All the states of a trial; one program for a kind of scenario."""
    return trajectory(scenario, trial=trial, periods=periods, dt=dt)


def strong(tree: T) -> T:
    """The same with 64-bit arrays for numbers, so that what takes it is compiled once.

    Python's whole numbers stand for lengths; counts are 32-bit arrays.
    """
    return jax.tree.map(
        lambda leaf: leaf if getattr(leaf, "dtype", None) == np.int32 else np.asarray(leaf, float),
        tree,
    )


def roll(scenario: Scenario, profile: Any, begin: State, steps: int, dt: float) -> State:
    """All the states after each of `steps` steps, with 64-bit numbers.

    Numbers may be traced; if none is, the steps go in chunks, so that nothing has to be compiled
    anew for another number of them.
    """
    if any(
        isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves((scenario, profile, begin))
    ):
        return _scan(scenario, profile, begin, steps, dt)
    scenario, profile, state = strong((scenario, profile, begin))
    parts = []
    for _ in range(-(-steps // _CHUNK)):
        parts.append(jax.device_get(_chunk(scenario, profile, state, np.float64(dt))))
        state = jax.tree.map(lambda leaf: leaf[-1], parts[-1])
    return jax.tree.map(lambda *leaves: jnp.asarray(np.concatenate(leaves)[:steps]), *parts)
