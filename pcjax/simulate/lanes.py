"""What the ensemble and the engines hand to each other: a block of trials under way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from pcjax.geometry import Vec
from pcjax.model.scenario import World
from pcjax.physics.state import PASSED, RUNNING, State, Watch
from pcjax.simulate.relaxation import Progress


class Lanes(NamedTuple):
    """Trials under way: arrays of shape (lanes,), NumPy's between calls and JAX's within.

    Attributes:
        condition, trial: which experiment.
        period: which period of the drive, from 0; -1 before the first.
        time: seconds of that period gone by; infinite before the first.
        x, y, vx, vy: the object's position and velocity.
        steps: steps or leaps that the engine has taken since the trial began.
        lag: seconds by which the trial passed before its last step's end.
        status: RUNNING, PASSED or INVALID.
        mark, first, held: how far the trial has come (`Progress`), where the goal is relaxed.
        more: for a stick, of shape (lanes, 5): angle, spin and what `Watch` keeps; for a circle
            (lanes, 0).
    """

    condition: Any
    trial: Any
    period: Any
    time: Any
    x: Any
    y: Any
    vx: Any
    vy: Any
    steps: Any
    lag: Any
    status: Any
    mark: Any
    first: Any
    held: Any
    more: Any

    @classmethod
    def idle(cls, count: int, dtype: type, more: int = 0) -> Lanes:
        """Lanes with nothing to do."""
        whole = ("condition", "trial", "period", "steps", "status")
        idle = cls(**{n: np.zeros(count, np.int32 if n in whole else dtype) for n in cls._fields})
        idle.status[:] = PASSED
        return idle._replace(more=np.zeros((count, more), dtype))

    @classmethod
    def fresh(
        cls,
        condition: Int[Array, " lanes"],
        trial: Int[Array, " lanes"],
        dtype: type,
        more: int = 0,
    ) -> Lanes:
        """Lanes whose trials are about to begin, for a compiled program."""
        idle = cls.idle(len(trial), dtype, more)
        return jax.tree.map(
            jnp.asarray,
            idle._replace(
                condition=condition,
                trial=trial,
                period=idle.period - 1,
                time=idle.time + np.inf,
                status=np.full_like(idle.status, RUNNING),
            ),
        )


def states_of(lanes: Lanes) -> State:
    """The states of lanes, at the start of a period."""
    zero = jnp.zeros((), jnp.int32)
    position, velocity = Vec(lanes.x, lanes.y), Vec(lanes.vx, lanes.vy)
    states = State(position, velocity, zero, lanes.steps, lanes.status)
    if lanes.more.shape[-1] == 0:
        return states
    angle, spin, *watch = (lanes.more[..., k] for k in range(5))
    return replace(states, angle=angle, spin=spin, watch=Watch(*watch))


def with_states(lanes: Lanes, states: State) -> Lanes:
    """The lanes with those states in place of theirs."""
    more = (states.angle, states.spin, states.watch)
    return lanes._replace(
        x=states.position.x,
        y=states.position.y,
        vx=states.velocity.x,
        vy=states.velocity.y,
        steps=states.steps,
        status=states.status,
        more=lanes.more if states.angle is None else jnp.stack(jax.tree.leaves(more), axis=-1),
    )


def progress_of(lanes: Lanes) -> Progress:
    """How far the lanes have come."""
    return Progress(lanes.mark, lanes.first, lanes.held)


def with_progress(lanes: Lanes, progress: Progress) -> Lanes:
    """The lanes with that progress in place of theirs."""
    return lanes._replace(mark=progress.mark, first=progress.first, held=progress.held)


def lane_axes(batch: Any) -> Any:
    """The vmap axes of a batch: a leaf without an axis is the same for all lanes."""
    return jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, batch)


class Program(Protocol):
    """An engine as it is compiled: a pytree, whose numbers are traced."""

    @property
    def rounds(self) -> int:
        """How often in one call lanes whose period is over begin the next."""
        ...

    def run(self, worlds: World, swings: Any, lanes: Lanes) -> Lanes:
        """Takes lanes some way through their periods, at most to the end of them.

        Arguments:
            worlds, swings: batches; every leaf has the lanes as its first axis, but for those that
                all lanes share, which have none.
            lanes: those with another status than RUNNING or whose period is over stay as they are.
        """
        ...


class Engine(Protocol):
    """How a block of trials is advanced."""

    @property
    def name(self) -> str:
        """What the command line calls it."""
        ...

    @property
    def goal_layer(self) -> float | None:
        """Half width of the layer that the goal is spread over, in depths of the channel; None for
        the exact goal."""
        ...

    def program(self, period: float) -> Program:
        """What is compiled, for periods of `period` seconds."""
        ...

    def step_taken(self, period: float) -> float:
        """The step taken for periods of `period` seconds, s; NaN for one that takes no steps."""
        ...

    def seconds(self, lanes: Lanes, period: float) -> np.ndarray:
        """How long each trial has lasted, s, for periods of `period` seconds."""
        ...
