"""Clouds: objects that have been in a hand for a while, as starts for others."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from pcjax.compiling import compiled_quickly, roomy_size
from pcjax.model.scenario import Scenario
from pcjax.physics.state import PAPER_DT
from pcjax.simulate.batch import LaneEngine, run
from pcjax.simulate.choose import engine_for
from pcjax.simulate.cloud import Cloud
from pcjax.simulate.draws import period_draws, trial_key
from pcjax.simulate.outcomes import LIMIT


def settled_cloud(
    scenario: Scenario, *, trials: int, burn_in: int, seed: int, dt: float | None = None
) -> Cloud:
    """Places of `trials` objects that are still in the hand after the burn-in.

    Arguments:
        scenario: the hand, and what moves it.
        trials: how many objects.
        burn_in: periods of the drive.
        seed: trial i depends on (seed, i) alone.
        dt: the engine's step, s; chosen by the engine unless given.

    Raises:
        ValueError: hardly anything stays in the hand that long.
    """
    engine = engine_for([scenario], dt, LaneEngine)
    steps = burn_in * round(scenario.drive.period / PAPER_DT)
    places, draws, tried = [], [], 0
    while sum(map(len, places)) < trials:
        out = run(
            [scenario],
            trials=trials,
            max_steps=steps,
            seed=(seed + tried) % 2**32,
            engine=engine,
            keep_final=True,
        )
        assert out.final is not None
        stay = np.flatnonzero(out.status[0] == LIMIT)
        places.append(out.final[0, stay])
        draws.append(
            _last_draws(
                (seed + tried) % 2**32,
                stay,
                burn_in - 1,
                scenario.drive.targets_per_period,
            )
        )
        tried += 1
        if tried == 20:
            raise ValueError(
                f"too few objects stay in the hand for {burn_in} periods to make a cloud "
                "of: take form 'horizon', or a shorter burn-in"
            )
    hands = jax.tree.map(lambda leaf: np.full(trials, leaf, np.float32), scenario.hand)
    return Cloud(
        jnp.asarray(np.concatenate(places)[:trials], np.float32),
        jnp.asarray(np.concatenate(draws)[:trials], np.float32),
        hands,
    )


@functools.partial(compiled_quickly, static_argnums=(2, 3))
def _draws_of(seed: Array, trials: Array, period: int, count: int) -> Array:
    return jax.vmap(lambda trial: period_draws(trial_key(seed, trial), period, count))(trials)


def _last_draws(seed: int, trials: np.ndarray, period: int, count: int) -> np.ndarray:
    padded = np.zeros(roomy_size(len(trials), 64), np.int32)
    padded[: len(trials)] = trials
    return np.asarray(_draws_of(np.uint32(seed), padded, period, count))[: len(trials)]
