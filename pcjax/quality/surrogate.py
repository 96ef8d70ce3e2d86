"""The relaxed score: what the optimiser looks at in place of the exact one.

Two things are softened, each by a named width, and as both go to 0 the exact score comes back:

| field | unit | usual | what it does |
| --- | --- | --- | --- |
| goal_layer | depths of the channel | 0.2 | half width over which the goal line is spread |
| contact_layer | radii of the object | 0 | half width over which contact switches on |

and it takes one of three forms:

- "horizon": trials from the paper's starts to the step limit, as the exact score has them.
- "cloud": objects that have been in the hand for `burn_in` periods and have not left, followed for
  3 more. After a few periods the share that escapes per period is constant, p, and
  index 1 = (1 - (1 - p)^n) / p periods for a limit of n.
- "exact": the exact trials; nothing is relaxed.

All forms are sums over trials that depend on (seed, trial) alone, so that two designs are compared
on the same experiments (common random numbers).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from pcjax.checks import check_between, check_count
from pcjax.compiling import compiled_quickly
from pcjax.geometry import Scalar, library_of
from pcjax.model.contact import ContactLaw
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID, PAPER_DT
from pcjax.quality.cloud import settled_cloud
from pcjax.quality.task import Hand, Task
from pcjax.simulate.batch import LaneEngine, run
from pcjax.simulate.choose import engine_for
from pcjax.simulate.engine import Engine
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.outcomes import LIMIT
from pcjax.simulate.relaxation import Layer, relaxed_survival
from pcjax.simulate.rounds import roll

OBJECTIVES = ("index1", "index2", "escape_rate")
"""What a score can be made of: an index, or the limit-free mean time to escape, 1 / rate."""

FORMS = ("horizon", "cloud", "exact")

ROLLED = 3
"""Periods that a cloud is followed. The first is left out of the rate: whoever starts far from the
goal needs a while to get there."""

_SIGNS = (1.0, -1.0)
"""How the logarithms of DoEs and EoEn count in a score's."""

_FRESH = 0x9E3779B9
"""Tells the seed of a cloud's further life from that of its burn-in."""


@dataclass(frozen=True)
class Sample:
    """What the trials of some hands gave.

    Attributes:
        values: two numbers of each trial, for each hand and run (a task in one direction). For a
            horizon the seconds it was held and whether it was to the end (or the relaxed survival
            then); for a cloud the survival after one period and after all.
        valid: trials that went right in every hand.
        invalid: how many trials of a hand went wrong.
    """

    values: Float[np.ndarray, "hands runs 2 trials"]
    valid: Bool[np.ndarray, " trials"]
    invalid: int

    def means(self) -> Float[np.ndarray, "hands runs 2"]:
        """Means over the valid trials."""
        return self.values[..., self.valid].mean(axis=-1)


@dataclass(frozen=True)
class Surrogate:
    """A relaxed score of hands at a task.

    Arguments:
        task: what they have to be good at.
        objective: one of `OBJECTIVES`.
        form: one of `FORMS`.
        trials: trials for each hand and direction.
        goal_layer, contact_layer: see above.
        dt: step in seconds where trials are stepped; as large as accuracy allows unless given.
        burn_in: periods before a cloud counts.

    Raises:
        ValueError: an unknown name, a number out of range, a limit that is not a whole number of
            periods, or a cloud of sticks.

    Examples:
        >>> import pcjax
        >>> task = pcjax.Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
        >>> surrogate = pcjax.Surrogate(task, trials=32)
        >>> surrogate.periods
        2
        >>> sample = surrogate.sample([pcjax.box_hand(0.1), pcjax.box_hand(0.2)], seed=0)
        >>> sample.values.shape  # hands, directions, (seconds held, survival), trials
        (2, 2, 2, 32)
    """

    task: Task
    objective: str = "index1"
    form: str = "horizon"
    trials: int = 1000
    goal_layer: float = 0.2
    contact_layer: float = 0.0
    dt: float | None = None
    burn_in: int = 8

    def __post_init__(self) -> None:
        for name, value, names in (
            ("objective", self.objective, OBJECTIVES),
            ("form", self.form, FORMS),
        ):
            if value not in names:
                raise ValueError(f"{name} is {value!r}: it has to be one of {', '.join(names)}")
        check_count("trials", self.trials, 2, 2**24)
        check_count("burn_in", self.burn_in, 1, 1000)
        check_between("goal_layer", self.goal_layer, 1e-6, 1.0)
        check_between("contact_layer", self.contact_layer, 0.0, 0.5)
        if self.task.max_steps % round(self.task.drive.period / PAPER_DT):
            raise ValueError(
                f"max_steps is {self.task.max_steps}: a surrogate's limit has to be a whole number "
                f"of periods of {round(self.task.drive.period / PAPER_DT)} steps"
            )
        if self.form == "cloud" and any(
            one.body.oriented or one.law.friction is not None for one in self.task.each
        ):
            raise ValueError(
                "form 'cloud' knows circles without friction only: take 'horizon' for others"
            )

    @property
    def periods(self) -> int:
        """The limit in periods of the drive."""
        return self.task.max_steps // round(self.task.drive.period / PAPER_DT)

    def annealed(self, factor: float) -> Surrogate:
        """With both widths times `factor`; at 0 it is the exact score."""
        return replace(
            self,
            goal_layer=max(self.goal_layer * factor, 1e-6),
            contact_layer=self.contact_layer * factor,
        )

    def softened(self, scenario: Scenario) -> Scenario:
        """The scenario with its contact softened."""
        if self.contact_layer == 0 or self.form == "exact":
            return scenario
        law = ContactLaw(
            scenario.law.restitution,
            scenario.law.resting_speed,
            jax.lax.stop_gradient(self.contact_layer * scenario.body.radius),
        )
        return replace(scenario, law=law)

    def sample(
        self, hands: Sequence[Hand], seed: int, bases: Sequence[Hand] | None = None
    ) -> Sample:
        """Runs the same trials with every hand.

        Arguments:
            hands: to be compared.
            seed: trial i depends on (seed, i) alone.
            bases: hands in which clouds are made, each for as many of `hands` in turn, which differ
                little from it; unless given, each hand has its own.
        """
        each = [[self.softened(s) for s in some] for some in self.task.scenarios_of(hands)]
        if self.form == "cloud":
            bases = hands if bases is None else bases
            share = len(hands) // len(bases)
            parts = [
                self._sample_cloud(each[k * share : (k + 1) * share], seed, base)
                for k, base in enumerate(bases)
            ]
            values = np.concatenate([part[0] for part in parts])
            wrong = np.concatenate([part[1] for part in parts])
        else:
            values, wrong = self._sample_horizon(each, seed)
        return _sample_of(values, wrong)

    def sample_scenarios(self, each: list[list[Scenario]], seed: int) -> Sample:
        """The same of any hands' scenarios, whatever their tasks; nothing is softened.

        Arguments:
            each: of each hand, as `Task.scenarios` gives them; the limit is this task's.
            seed: trial i depends on (seed, i) alone.
        """
        return _sample_of(*self._sample_horizon(each, seed))

    def engine(self, scenarios: Sequence[Scenario]) -> Engine:
        """The engine of choice for all of these; any for exact scores, else with the goal layer."""
        if self.form == "exact":
            return engine_for(scenarios, self.dt)
        return self.relaxed_engine(scenarios)

    def relaxed_engine(self, scenarios: Sequence[Scenario]) -> LaneEngine:
        """The engine of choice for all of these, of those that have a goal layer, with this one."""
        return engine_for(scenarios, self.dt, LaneEngine).having(goal_layer=self.goal_layer)

    def _sample_horizon(
        self, each: list[list[Scenario]], seed: int
    ) -> tuple[np.ndarray, np.ndarray]:
        values = np.zeros((len(each), len(each[0]), 2, self.trials))
        wrong = np.zeros((len(each), len(each[0]), self.trials), bool)
        # What an engine runs together: objects with and without an orientation are not.
        kinds: dict[Any, list[int]] = {}
        for k, scenario in enumerate(each[0]):
            engine = self.engine([scenarios[k] for scenarios in each])
            kinds.setdefault((type(engine), scenario.body.oriented), []).append(k)
        for chosen in kinds.values():
            flat = [scenarios[k] for scenarios in each for k in chosen]
            shape = len(each), len(chosen), self.trials
            out = run(
                flat,
                trials=self.trials,
                max_steps=self.task.max_steps,
                seed=seed,
                engine=self.engine(flat),
            )
            if out.excursion is None:
                held, end = out.steps * PAPER_DT, (out.status == LIMIT).astype(float)
            else:
                held = out.excursion[..., 2]
                end = self._survival(out.excursion[..., 0], flat)
            values[:, chosen] = np.stack([held.reshape(shape), end.reshape(shape)], axis=2)
            wrong[:, chosen] = (out.status == INVALID).reshape(shape)
        return values, wrong.reshape(-1, self.trials)

    def _sample_cloud(
        self,
        each: list[list[Scenario]],
        seed: int,
        base: HandDesign,
    ) -> tuple[np.ndarray, np.ndarray]:
        values, wrong = [], []
        engine = self.engine([scenario for scenarios in each for scenario in scenarios])
        steps = ROLLED * round(self.task.drive.period / PAPER_DT)
        for k, scenario in enumerate(self.task.scenarios(base)):
            cloud = settled_cloud(
                scenario, trials=self.trials, burn_in=self.burn_in, seed=seed, dt=self.dt
            )
            mine = [scenarios[k] for scenarios in each]
            out = run(
                mine,
                trials=self.trials,
                max_steps=steps,
                seed=seed ^ _FRESH,
                engine=engine,
                cloud=cloud,
            )
            assert out.excursion is not None
            ends = [self._survival(out.excursion[..., k], mine) for k in (1, 0)]
            values.append(np.stack(ends, axis=1))
            wrong.append(out.status == INVALID)
        return np.stack(values, axis=1), np.concatenate(wrong)

    def traced_values(
        self,
        hand: HandDesign,
        engine: LaneEngine,
        trials: Int[Array, " trials"],
        seed: Any,
    ) -> Float[Array, "runs 2 trials"]:
        """`Sample.values` of one hand within a compiled program, differentiable forwards.

        A horizon's trials from the paper's starts; one that goes wrong counts as far as it came.
        """
        scenarios = [self.softened(scenario) for scenario in self.task.scenarios(hand)]
        kinds: dict[Any, list[int]] = {}
        for k, scenario in enumerate(scenarios):
            kinds.setdefault(jax.tree.structure(scenario), []).append(k)
        values = []
        for chosen in kinds.values():
            alike = [scenarios[k] for k in chosen]
            stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves).astype(float), *alike)
            count = len(alike)
            lanes = Lanes.fresh(
                jnp.repeat(jnp.arange(count, dtype=jnp.int32), len(trials)),
                jnp.tile(trials, count),
                np.dtype(jnp.result_type(float)).type,
            )
            program = engine.program(stacked.drive.period)
            lanes = roll(program, stacked, seed, self.periods, lanes)
            widths = _layer_widths(stacked.hand, self.goal_layer)
            end = relaxed_survival(lanes.excursion.peak, widths[lanes.condition])
            values.append(jnp.stack([lanes.excursion.survival_time, end]).reshape(2, count, -1))
        order = np.argsort([k for chosen in kinds.values() for k in chosen])  # of the runs
        return jnp.moveaxis(jnp.concatenate(values, axis=1)[:, order], 0, 1)

    def _survival(
        self, marks: Float[np.ndarray, "hands trials"], scenarios: Sequence[Scenario]
    ) -> Float[np.ndarray, "hands trials"]:
        """The relaxed survival S for marks s*."""
        hands = [scenario.hand for scenario in scenarios]
        stacked = jax.tree.map(lambda *leaves: np.asarray(leaves, np.float32), *hands)
        widths = _layer_widths(stacked, self.goal_layer)
        return np.asarray(_relaxed_survival(marks, widths[:, None]))

    def combined(
        self, each: Float[Array | np.ndarray, "*some runs"]
    ) -> Float[Array | np.ndarray, "*some"]:
        """The logarithm of the score, from that of each task and direction: DoEs less EoEn; of
        several tasks the weighed mean, or the worst."""
        signs, xp = _SIGNS[: len(self.task.directions)], library_of(each)
        scores = xp.reshape(each, (*each.shape[:-1], -1, len(signs))) @ xp.asarray(
            signs, each.dtype
        )
        shares = xp.asarray(self.task.shares, each.dtype)
        return xp.asarray(xp.min(scores, axis=-1) if self.task.worst else scores @ shares)

    def weigh(self, each: Float[np.ndarray, "*some runs"]) -> Float[np.ndarray, "*some runs"]:
        """The derivative of `combined`."""
        signs = np.array(_SIGNS[: len(self.task.directions)])
        scores = each.reshape(*each.shape[:-1], -1, len(signs)) @ signs
        shares = np.broadcast_to(self.task.shares, scores.shape)
        if self.task.worst:
            shares = np.eye(scores.shape[-1])[np.argmin(scores, axis=-1)]
        return (shares[..., None] * signs).reshape(each.shape)

    def log_score(self, means: Float[Array, "runs 2"]) -> Scalar:
        """The logarithm of the score, from a hand's means."""
        logs = [_log_quality(one, math.inf, *self._static()) for one in means]
        return self.combined(jnp.stack(logs))

    def judge(
        self, means: Float[np.ndarray, "hands runs 2"], trials: float = math.inf
    ) -> tuple[Float[np.ndarray, "hands runs"], Float[np.ndarray, "hands runs 2"]]:
        """How well each hand holds in each direction, as a logarithm, and that one's derivatives
        with respect to the means.

        Arguments:
            means: of each hand and direction, as `Sample.means` has them.
            trials: that they are of. A share has half a trial more that is held, and half a one
                that is not: where none or all are held its logarithm is finite so, and does not
                jump where the first one is.
        """
        with jax.enable_x64(True):
            value, slope = _judge(jnp.asarray(means, float), float(trials), *self._static())
            return np.asarray(value), np.asarray(slope)

    def doubt(
        self, means: Float[np.ndarray, "hands runs 2"], trials: int
    ) -> Float[np.ndarray, "hands runs"]:
        """The variance that the logarithms of `judge` have beyond what the trials' own spread says:
        that of its two halves of a trial, and of half a trial in a mean."""
        slopes, end = self.judge(means, trials)[1][..., 1], means[..., 1]
        halves = 0.5 * ((1 - end) ** 2 + end**2)
        return (slopes**2 * halves + 0.25) / trials**2

    def known(self, means: Float[np.ndarray, "runs 2"]) -> bool:
        """Whether a hand's means say what its score is: not where nothing was held to the limit
        from outside, or nothing escaped, and the score is made of that."""
        end = means[:, 1]
        if self.objective == "index2" and self.task.also and not self.task.worst:
            return bool(np.all(end > 0))  # else a mean of logarithms has none
        if self.objective == "index2":
            return len(self.task.directions) == 1 or bool(np.all(end[1::2] > 0))
        return self.objective == "index1" or bool(np.all(end < 1))

    def appraise(
        self, sample: Sample
    ) -> tuple[Float[np.ndarray, "hands runs"], Float[np.ndarray, "runs hands n"]]:
        """`judge` of a sample's means, and what each valid trial adds to those logarithms.

        Raises:
            ValueError: a hand lets every trial out at once, or fewer than two trials went right
                with all hands.
        """
        if sample.valid.sum() < 2:
            raise ValueError(
                "fewer than two trials went right with all of the hands that were tried: try a "
                "smaller dt"
            )
        means = sample.means()
        logs, slopes = self.judge(means, int(sample.valid.sum()))
        if not np.isfinite(logs).all():
            raise ValueError(
                "a hand that was tried lets every object out at once, as its relaxed goal reaches "
                "the starts: take form 'exact', or bounds that keep the goal line farther away"
            )
        deviations = sample.values[..., sample.valid] - means[..., None]
        return logs, np.einsum("vdk,vdkn->dvn", slopes, deviations)

    def _static(self) -> tuple[str, bool, int, float]:
        return self.objective, self.form == "cloud", self.periods, self.task.drive.period


def _sample_of(values: np.ndarray, wrong: np.ndarray) -> Sample:
    return Sample(values, np.logical_not(wrong.any(axis=0)), int(wrong.sum(axis=1).max()))


def _log_quality(
    means: Float[Array, "2"],
    trials: Scalar,
    objective: str,
    cloud: bool,
    periods: int,
    period: float,
) -> Scalar:
    """How well a hand holds in one direction, as a logarithm; see `Surrogate.judge`."""
    tiny = 1e-9
    if cloud:
        stay = jnp.clip(jnp.sqrt(means[1] / means[0]), tiny, 1 - tiny)
        return {
            "index1": jnp.log((1 - stay**periods) / (1 - stay) * period / PAPER_DT),
            "index2": periods * jnp.log(stay),
            "escape_rate": -jnp.log(-jnp.log(stay) / period),
        }[objective]
    held, end = means[0], (means[1] + 0.5 / trials) / (1 + 1 / trials)
    return {
        "index1": jnp.log(held / PAPER_DT),
        "index2": jnp.log(jnp.maximum(end, tiny)),
        # Escapes over time at risk: the maximum likelihood for a constant rate.
        "escape_rate": jnp.log(held / jnp.maximum(1 - end, tiny)),
    }[objective]


@functools.partial(compiled_quickly, static_argnums=(2, 3, 4, 5))
def _judge(
    means: Array, trials: Scalar, objective: str, cloud: bool, periods: int, period: float
) -> tuple[Array, Array]:
    quality = functools.partial(
        _log_quality,
        trials=trials,
        objective=objective,
        cloud=cloud,
        periods=periods,
        period=period,
    )
    return jax.vmap(jax.vmap(jax.value_and_grad(quality)))(means)


@functools.partial(jax.jit, static_argnums=1)
def _layer_widths(hands: HandDesign, share: float) -> Array:
    return jax.vmap(lambda hand: jnp.asarray(Layer.of(hand.channel(), share).width))(hands)


_relaxed_survival = compiled_quickly(relaxed_survival)
