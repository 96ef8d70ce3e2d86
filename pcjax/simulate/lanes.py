"""What the ensemble and the engines hand to each other: a block of trials under way."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Int32

from pcjax.geometry import Vec
from pcjax.physics.state import PASSED, RUNNING, State, at_rest
from pcjax.simulate.relaxation import Excursion

Numbers = Float[Array, " lanes"]
Counts = Int32[Array, " lanes"]


class Lanes(NamedTuple):
    """Trials under way, as NumPy's arrays between calls and JAX's within.

    Attributes:
        condition, trial: which experiment.
        period: which period of the drive, from 0; -1 before the first.
        time: seconds of that period gone by; infinite before the first.
        state: where the trial is, at the start of a period if it is stepped; `steps` counts the
            engine's steps or leaps, and the clock, which all lanes share, is 0 between calls.
        lag: seconds by which the trial passed before its last step's end.
        excursion: how far the trial has come, where the goal is relaxed.
    """

    condition: Counts
    trial: Counts
    period: Counts
    time: Numbers
    state: State
    lag: Numbers
    excursion: Excursion

    @classmethod
    def idle(cls, count: int, dtype: type) -> Lanes:
        """Lanes with nothing to do."""

        def zeros(like: Any = 0) -> Any:
            return np.zeros(count, dtype if isinstance(like, float) else np.int32)

        state = jax.tree.map(zeros, at_rest(Vec(0.0, 0.0)))
        over = np.full(count, PASSED, np.int32), np.zeros((), np.int32)
        state = eqx.tree_at(lambda state: (state.status, state.clock), state, over)
        excursion = jax.tree.map(zeros, Excursion(0.0, 0.0, 0.0))
        return cls(zeros(), zeros(), zeros(), zeros(0.0), state, zeros(0.0), excursion)

    @classmethod
    def fresh(
        cls, condition: Int[Array, " lanes"], trial: Int[Array, " lanes"], dtype: type
    ) -> Lanes:
        """Lanes whose trials are about to begin, for a compiled program."""
        idle = cls.idle(len(trial), dtype)
        running = np.full_like(idle.condition, RUNNING)
        return jax.tree.map(
            jnp.asarray,
            idle._replace(
                condition=condition,
                trial=trial,
                period=idle.period - 1,
                time=idle.time + np.inf,
                state=eqx.tree_at(lambda state: state.status, idle.state, running),
            ),
        )


def lane_axes(batch: Any) -> Any:
    """The vmap axes of a batch: a leaf without an axis is the same for all lanes."""
    return jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, batch)
