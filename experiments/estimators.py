"""Two more estimators of the score's derivative against `Differences`, at equal processor time.

*Saltation*: each trial's exact derivative (`experiments.trajectories`).

*Warped draws*: a generalised likelihood ratio. In each period the draws u of the tilt's targets
move with the parameter by a field v(u) that takes the growth out of the derivative,

    v = -b (b J J' b + kappa^2)^-1 b J t,

with t the derivative of the state at the period's end, J that with respect to u, and b(u) 0 near
the edges of the square. What is left of t goes on, and the density's change counts: E[f div v].
Where the draws do not move the state, as in a corner, v is 0. div v is a difference over `SHIFT`,
since v jumps where an impact falls on a period's end.

With `--lines`: whether a boundary term has anything to catch. Along a line in a period's draws, is
there a place where the period's end jumps?

Keeps `results/estimators.csv`, `results/growth.csv` and, with `--lines`, `results/lines.csv`; draws
`results/estimators.png`. What is in `results/estimators.csv` already is not run again.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure

from experiments.gradients import EIGHT, cells_of, groups, rows_of
from experiments.readings import kept, save
from experiments.trajectories import HELD, PEAK, Ended, X, after_period, started
from pcjax.compiling import quick_options
from pcjax.design.estimator import Designs, Estimator, Gradient, gradient_from
from pcjax.design.gradients import Differences
from pcjax.design.space import Design, DesignSpace
from pcjax.geometry import Flag, Scalar, where
from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID, RUNNING
from pcjax.quality.surrogate import Surrogate
from pcjax.simulate.draws import period_draws, trial_key
from pcjax.simulate.relaxation import Layer, relaxed_survival

RESULTS = Path(__file__).parent / "results"
SEED = 21

SIGNS = 1 << 30
"""What tells the draws of the signs of shifts from those of the targets."""

SHIFT, EDGE = 0.03, 0.05
"""Over how much, up or down by chance, div v is taken; how wide v goes to 0 at an edge."""

MOST = 0.3
"""The longest v, for a parameter's scale."""

PLACE, SPEED = 50.0, 20.0
"""What counts as alike in v: lengths, and lengths / s."""

BLOCK = 64
"""Trials in one call."""

OPTIONS = {"xla_backend_optimization_level": 1}
"""The compiler's: with more of it, it takes minutes."""


# -------------------------------------------------------------------------------- the estimators


class Trial(NamedTuple):
    """What a trial's run tells.

    Attributes:
        numbers: at its end.
        slopes: their derivatives.
        held: seconds held up to each period's start.
        divergence: div v of each period.
        growth: the largest derivative of the place at each period's end; NaN once it is over.
        status: in the end.
    """

    numbers: Float[Array, "6"]
    slopes: Float[Array, "parameters 6"]
    held: Float[Array, " periods"]
    divergence: Float[Array, "periods parameters"]
    growth: Float[Array, " periods"]
    status: Array


Pushed = tuple[Ended, Float[Array, "ways 6"]]


def pushed(
    scenario: Scenario,
    turned: Scenario,
    share: Scalar,
    numbers: Array,
    before: Array,
    draws: Array,
    first: Flag,
    status: Array,
    along: tuple[Array, Array, Array],
) -> Pushed:
    """A period, and the derivatives of the numbers at its end along some ways.

    Arguments:
        turned: the derivatives of the scenario along each.
        along: those of `numbers`, `before` and `draws`.
    """

    def period(scenario: Scenario, numbers: Array, before: Array, draws: Array) -> Any:
        ended = after_period(scenario, share, numbers, before, draws, first, status)
        return ended.numbers, ended

    def one(turned: Scenario, *along: Array) -> tuple[Ended, Array]:
        at = scenario, numbers, before, draws
        _, slope, ended = jax.jvp(period, at, (turned, *along), has_aux=True)
        return ended, slope

    return jax.vmap(one, out_axes=(None, 0))(turned, *along)


def trial(
    scenario: Scenario,
    turned: Scenario,
    share: float,
    periods: int,
    kappa: float | None,
    seed: Array,
    number: Array,
) -> Trial:
    """One trial to the end, with its derivatives.

    Arguments:
        turned: the scenario's derivatives, with the parameters as each leaf's first axis.
        share: half width of the goal's layer, in depths of the channel.
        kappa: what v spares; None for no warp.
    """
    key = trial_key(seed, number)
    count = jax.tree.leaves(turned)[0].shape[0]

    numbers, slopes = jax.vmap(
        lambda way: jax.jvp(lambda one: started(one, key), (scenario,), (way,)), out_axes=(None, 0)
    )(turned)
    alone = jnp.zeros((count, 2))
    layer = Layer.of(scenario.hand.channel(), share)
    scale = jnp.array([PLACE, PLACE, SPEED, SPEED])

    spared = 0.0 if kappa is None else kappa**2

    def plain(carry: Any, period: Array) -> tuple[Any, ...]:
        numbers, slopes, before, moved, status = carry
        draws = period_draws(key, period, 2).astype(float)
        along = slopes, moved, alone
        ended, after = pushed(
            scenario, turned, share, numbers, before, draws, period == 0, status, along
        )
        return (ended, after, draws, alone, alone[:, 0])

    def warped(carry: Any, period: Array) -> tuple[Any, ...]:
        numbers, slopes, before, moved, status = carry
        drawn = period_draws(key, period, 2).astype(float)
        sign = jnp.where(period_draws(key, SIGNS + period, 2) < 0.5, -1.0, 1.0)
        # Two ways more, along which the draws alone move.
        still, *more = jax.tree.map(
            lambda leaf: jnp.concatenate([leaf, jnp.zeros((2, *leaf.shape[1:]))]),
            (turned, slopes, moved),
        )
        along = more[0], more[1], jnp.concatenate([alone, jnp.eye(2)])

        def field(draws: Array) -> tuple[Array, Ended, Array]:
            ended, ways = pushed(
                scenario, still, share, numbers, before, draws, period == 0, status, along
            )
            gains, places = ways[count:, X] / scale, ways[:count, X] / scale
            # b, and 0 towards the end of a trial, so that v does not jump there.
            edge = jnp.minimum(draws, 1.0 - draws)
            fades = jnp.clip((edge - SHIFT) / EDGE, 0.0, 1.0)
            fades = fades * relaxed_survival(ended.numbers[PEAK], layer.width)
            gains = gains * fades[:, None]
            square = gains @ gains.T + spared * jnp.eye(2)
            v = -fades * jnp.linalg.solve(square, gains @ places.T).T
            v = v / jnp.sqrt(1.0 + jnp.sum(v * v, axis=1, keepdims=True) / MOST**2)
            return v, ended, ways[:count] + v @ ways[count:]

        points = drawn + jnp.concatenate([jnp.zeros((1, 2)), SHIFT * jnp.diag(sign)])
        fields, ended, after = jax.vmap(field)(points)
        change = sum((fields[1 + k, :, k] - fields[0, :, k]) * sign[k] / SHIFT for k in (0, 1))
        ended, after = jax.tree.map(lambda leaf: leaf[0], (ended, after))
        return ended, after, drawn, fields[0], change

    def one(carry: Any, period: Array) -> tuple[Any, Any]:
        numbers, *_, status = carry
        step = plain if kappa is None else warped
        ended, after, draws, moved, change = step(carry, period)
        running = status == RUNNING
        after = jnp.where(running, after, carry[1])
        going = ended.status == RUNNING
        growth = jnp.where(going, jnp.max(jnp.abs(after[:, :2])), jnp.nan)
        change = jnp.where(running, change, 0.0)
        kept = numbers[HELD], change, growth
        return (ended.numbers, after, draws, jnp.where(running, moved, 0.0), ended.status), kept

    level = jnp.full(2, 0.5)
    begin_with = numbers, slopes, level, alone, jnp.int32(RUNNING)
    carry, (held, change, growth) = jax.lax.scan(one, begin_with, jnp.arange(periods))
    return Trial(carry[0], carry[1], held, change, growth, carry[4])


@dataclass(frozen=True)
class Along(Estimator):
    """Derivatives along the engine's leaps.

    Arguments:
        kappa: of the warped draws; None for saltation alone.
        block: trials in one call; their number is rounded up to whole blocks.
    """

    kappa: float | None = None
    block: int = BLOCK

    def __call__(
        self, surrogate: Surrogate, space: DesignSpace, designs: Designs, seed: int
    ) -> list[Gradient]:
        """The gradients at some designs."""
        return [self.at(surrogate, space, design, seed)[0] for design in designs]

    def at(
        self, surrogate: Surrogate, space: DesignSpace, design: Design, seed: int
    ) -> tuple[Gradient, Float[np.ndarray, "runs trials periods"]]:
        """The gradient at a design, and how the derivatives grew."""
        with jax.enable_x64(True):
            return self._at(surrogate, space, design, seed)

    def _at(
        self, surrogate: Surrogate, space: DesignSpace, design: Design, seed: int
    ) -> tuple[Gradient, Float[np.ndarray, "runs trials periods"]]:
        began = time.perf_counter()

        def scenarios(at: Array) -> Scenario:
            each = surrogate.task.scenarios(space.hand(at))
            return jax.tree.map(lambda *leaves: jnp.stack(leaves).astype(float), *each)

        at = jnp.asarray(design, float)
        both, turned = jax.vmap(lambda way: jax.jvp(scenarios, (at,), (way,)), out_axes=(None, 0))(
            jnp.diag(jnp.asarray(space.scales))
        )
        runs: list[Trial] = []
        numbers = jnp.arange(self.block)
        for which in range(len(surrogate.task.directions)):
            mine = jax.tree.map(lambda leaf: leaf[which], both)  # noqa: B023
            its = jax.tree.map(lambda leaf: leaf[:, which], turned)  # noqa: B023
            program = _program(surrogate.periods, self.kappa)
            parts = [
                program(mine, its, surrogate.goal_layer, jnp.uint32(seed), first + numbers)
                for first in range(0, surrogate.trials, self.block)
            ]
            runs.append(jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts))
        values = np.stack([run.numbers[:, HELD] for run in runs])
        slopes = np.stack([_weighed(run) for run in runs]) / space.scales
        good = np.stack([run.status != INVALID for run in runs]) & np.isfinite(slopes).all(-1)
        good = good.all(axis=0)
        values, slopes = values[:, good], slopes[:, good]
        # Index 1 does not ask who is held to the end.
        means = np.stack([values.mean(axis=-1), np.full(len(runs), 0.5)], axis=-1)
        (value,), (weights,) = surrogate.judge(means[None])
        own = weights[:, 0, None, None] * np.swapaxes(slopes, 1, 2)
        deviations = weights[:, 0, None] * (values - means[:, :1])
        centred = own - own.mean(axis=-1, keepdims=True)
        found = gradient_from(
            surrogate,
            np.concatenate([value[:, None], own.mean(axis=-1)], axis=1),
            np.concatenate([deviations[:, None], centred], axis=1),
            trials=surrogate.trials * len(runs),
            seconds=time.perf_counter() - began,
            invalid=int(np.sum(~good)),
        )
        return found, np.stack([run.growth for run in runs])


_programs: dict[Any, Callable[..., Trial]] = {}


def _program(periods: int, kappa: float | None) -> Callable[..., Trial]:
    """Trials of one scenario, compiled."""
    if (periods, kappa is None) not in _programs:

        def run(
            kappa: float | None, scenario: Any, turned: Any, share: Any, seed: Any, numbers: Array
        ) -> Trial:
            def one(number: Array) -> Trial:
                return trial(scenario, turned, share, periods, kappa, seed, number)

            return jax.vmap(one)(numbers)

        _programs[periods, kappa is None] = jax.jit(
            run, compiler_options=OPTIONS, static_argnums=(0,) if kappa is None else ()
        )
    program = _programs[periods, kappa is None]
    return lambda *arguments: program(kappa, *arguments)


def _weighed(run: Trial) -> Float[np.ndarray, "trials parameters"]:
    """Each trial's derivative of the seconds held, the change of its draws' density included.

    div v of a period counts for what comes after its start, less the mean of that over the trials
    that have come so far.
    """
    rest = run.numbers[:, HELD, None] - run.held
    under_way = rest > 0
    mean = np.sum(rest, axis=0) / np.maximum(np.sum(under_way, axis=0), 1)
    return run.slopes[:, :, HELD] + np.einsum(
        "nm,nmp->np", np.where(under_way, rest - mean, 0.0), run.divergence
    )


WIDE = 0.8
"""The goal's layer, as for the other pathwise derivatives."""


# ------------------------------------------------------------------- what jumps within a period

LINE_PERIODS, POINTS, HALVINGS = 8, 65, 30
LINES = {"wrist, r = 25": (4, 6), "wrist, r = 5": (0, 2)}
"""Designs whose draws are looked at along lines."""

JUMPS = {"place": 1.0, "seconds held": 0.1}
"""What counts as a jump between neighbours: a length, and seconds."""


def steepest(
    scenario: Scenario, share: float, seed: Array, number: Array, what: str
) -> tuple[Flag, Float[Array, " widths"]]:
    """How far apart a period ends for draws that are close together, where they matter most.

    One draw of one of a trial's first periods takes `POINTS` values; where two neighbours' ends of
    the period are farthest apart their interval is halved, and so on.

    Arguments:
        what: one of `JUMPS`, by which ends are compared.

    Returns:
        Whether the trial comes so far, and how far apart they are at widths of 1 / 64, 1 / 128, ...
    """
    key = trial_key(seed, number)
    which, axis = number % LINE_PERIODS, (number // LINE_PERIODS) % 2

    def after(numbers: Array, before: Array, draws: Array, period: Array, status: Array) -> Ended:
        return after_period(scenario, share, numbers, before, draws, period == 0, status)

    def on(carry: Any, period: Array) -> tuple[Any, Any]:
        numbers, before, status = carry
        draws = period_draws(key, period, 2).astype(float)
        ended = after(numbers, before, draws, period, status)
        return (ended.numbers, draws, ended.status), carry

    begin_with = started(scenario, key), jnp.full(2, 0.5), jnp.int32(RUNNING)
    _, begun = jax.lax.scan(on, begin_with, jnp.arange(LINE_PERIODS))
    numbers, before, status = jax.tree.map(lambda leaf: leaf[which], begun)
    drawn = period_draws(key, which, 2).astype(float)

    def end(value: Array) -> Ended:
        draws = jnp.where(jnp.arange(2) == axis, value, drawn)
        return after(numbers, before, draws, which, status)

    def apart(a: Ended, b: Ended) -> Scalar:
        if what == "seconds held":
            return jnp.abs(a.numbers[HELD] - b.numbers[HELD])
        both = (a.status == RUNNING) & (b.status == RUNNING)
        return jnp.where(both, jnp.hypot(*(a.numbers - b.numbers)[:2]), 0.0)

    points = jnp.linspace(0.0, 1.0, POINTS)
    ends = jax.vmap(end)(points)
    left, right = (
        jax.tree.map(lambda leaf: leaf[where], (points, ends))  # noqa: B023
        for where in (slice(0, -1), slice(1, None))
    )
    gaps: Any = jax.vmap(apart)(left[1], right[1])
    farthest = jnp.argmax(gaps)

    def halve(carry: Any, _: None) -> tuple[Any, Scalar]:
        left, right = carry
        place = 0.5 * (left[0] + right[0])
        middle = place, end(place)
        nearer = apart(left[1], middle[1]) >= apart(middle[1], right[1])
        left, right = where(nearer, (left, middle), (middle, right))
        return (left, right), apart(left[1], right[1])

    around = jax.tree.map(lambda leaf: leaf[farthest], (left, right))
    _, closer = jax.lax.scan(halve, around, length=HALVINGS)
    return status == RUNNING, jnp.concatenate([gaps[farthest][None], closer])


def line_rows(trials: int) -> list[dict]:
    """How far apart neighbours along a line end, by how close they are in the draw; in how many
    lines that is a jump if it stays so."""
    found = []
    numbers, seed = jnp.arange(trials), jnp.uint32(SEED)
    for what, threshold in JUMPS.items():
        along = partial(steepest, what=what)
        program = jax.jit(
            jax.vmap(along, in_axes=(None, None, None, 0)), compiler_options=quick_options()
        )
        for group, surrogate, space, designs in groups():
            for design in (designs[k] for k in LINES.get(group, ())):
                each = surrogate.task.scenarios(space.hand(jnp.asarray(design, float)))
                for of, one in zip(("does", "eoen"), each, strict=True):
                    scenario = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), one)
                    runs, gaps = program(scenario, WIDE, seed, numbers)
                    gaps = np.asarray(gaps)[np.asarray(runs)]
                    for j in (0, 4, 10, 20, 30):
                        row = {"what": what, "group": group, "design": space.describe(design)}
                        row |= {"of": of, "lines": len(gaps)}
                        row |= {"width": f"{2.0**-j / (POINTS - 1):.2g}"}
                        row |= {"median": f"{np.median(gaps[:, j]):.3g}"}
                        row |= {"most": f"{gaps[:, j].max():.3g}"}
                        found.append(row | {"above": int(np.sum(gaps[:, j] > threshold))})
    return found


# ------------------------------------------------------------------------------- the comparison

ESTIMATORS: dict[str, tuple[Estimator, dict[str, Any]]] = {
    "differences": (Differences(), {"trials": 8000}),
    "saltation": (Along(), {"trials": 512, "goal_layer": WIDE}),
    "warped draws": (Along(10.0), {"trials": 256, "goal_layer": WIDE}),
}
CHOSEN = {
    "wrist, r = 25": (4, 6),
    "wrist, r = 5": (0, 2),
    EIGHT: (1,),
}
"""Which of the designs of `experiments.gradients`."""

QUANTILES = (0.5, 0.9, 0.99, 1.0)


def truth_of(group: str, described: str) -> dict[tuple[str, str], tuple[float, float]]:
    """The exact derivatives of a design and their standard errors, by direction and parameter."""
    return {
        (row["of"], row["parameter"]): (float(row["truth"]), float(row["truth_se"]))
        for row in kept(RESULTS / "gradients.csv")
        if (row["group"], row["design"]) == (group, described)
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the trials")
    parser.add_argument("--lines", action="store_true", help="only what jumps within a period")
    arguments = parser.parse_args()
    if arguments.lines:
        with jax.enable_x64(True):
            save(line_rows(max(16, round(256 * arguments.scale))), RESULTS / "lines.csv")
        return
    rows: list[dict[str, Any]] = [*kept(RESULTS / "estimators.csv")]
    grown: list[dict[str, Any]] = [*kept(RESULTS / "growth.csv")]
    done = {(row["group"], row["design"], row["estimator"]) for row in rows}
    compiled = set()
    for group, surrogate, space, designs in groups():
        for k in CHOSEN.get(group, ()):
            design, described = designs[k], space.describe(designs[k])
            truth = truth_of(group, described)
            for name, (estimator, changes) in ESTIMATORS.items():
                if (group, described, name) in done:
                    continue
                trials = max(BLOCK, round(changes["trials"] * arguments.scale))
                mine = replace(surrogate, **changes | {"trials": trials})
                if (name, len(design)) not in compiled:
                    few = trials if name == "differences" else BLOCK
                    estimator(replace(mine, trials=few), space, [design], SEED + 1)
                    compiled.add((name, len(design)))
                began = time.process_time()
                if isinstance(estimator, Along):
                    got, growth = estimator.at(mine, space, design, SEED)
                    grown += growth_rows(name, group, described, growth)
                else:
                    (got,) = estimator(mine, space, [design], SEED)
                seconds = time.process_time() - began
                for row in rows_of(name, group, space, design, got, got):
                    value, error = truth[row["of"], row["parameter"]]
                    given = {"truth": value, "truth_se": error, "cpu": round(seconds, 2)}
                    rows.append(row | given)
                print(f"{group}, {described}: {name}, {seconds:.0f} CPU s", flush=True)
                save(rows, RESULTS / "estimators.csv")
                if grown:
                    save(grown, RESULTS / "growth.csv")
    print(table([row for row in rows if row["group"] != EIGHT]))
    print(table([row for row in rows if row["group"] == EIGHT]))
    draw(rows, grown).savefig(RESULTS / "estimators.png", dpi=110)


def growth_rows(
    name: str, group: str, described: str, growth: Float[np.ndarray, "runs trials periods"]
) -> list[dict]:
    """How large the derivatives of the place are at each period's end, of trials under way."""
    found = []
    for which, of in enumerate(("does", "eoen")[: len(growth)]):
        for period, some in enumerate(growth[which].T):
            some = some[np.isfinite(some)]
            if len(some) >= 50:
                sizes = np.quantile(some, QUANTILES)
                row = {"estimator": name, "group": group, "design": described, "of": of}
                row |= {"period": period + 1, "trials": len(some)}
                found.append(
                    row | {f"q{q:g}": f"{x:.4g}" for q, x in zip(QUANTILES, sizes, strict=True)}
                )
    return found


def dearness(rows: list[dict], name: str, of: str) -> float:
    """Squared standard error times processor time, against that of differences: the median."""

    def product(name: str) -> dict[tuple[str, ...], float]:
        mine = [row for row in rows if (row["estimator"], row["of"]) == (name, of)]
        keys = [(row["group"], row["design"], row["parameter"]) for row in mine]
        dear = [float(row["se"]) ** 2 * float(row["cpu"]) for row in mine]
        return dict(zip(keys, dear, strict=True))

    mine, usual = product(name), product("differences")
    return float(np.median([mine[key] / usual[key] for key in mine]))


def table(rows: list[dict]) -> str:
    """The estimators' agreement as a Markdown table."""
    lines = [
        "| estimator | CPU s / design | d ln DoEs: cosine, slope | d ln EoEn | d ln score "
        "| right signs | median s.e. per degree | largest trial's share "
        "| s.e.^2 x time against differences: DoEs, EoEn |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name in dict.fromkeys(row["estimator"] for row in rows):
        dear = [f"{dearness(rows, name, of):.3g}" for of in ("does", "eoen")]
        lines.append(f"| {' | '.join(cells_of(rows, name, 'cpu'))} | {', '.join(dear)} |")
    return "\n".join(lines)


def draw(rows: list[dict], grown: list[dict]) -> Figure:
    """How the derivatives of the place grow, and each estimator's derivatives against the truth."""
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    growing, *others = figure.subplots(1, 3)
    ways = {"saltation": "-", "warped draws": "--"}
    for k, group in enumerate(("wrist, r = 5", "wrist, r = 25")):
        for name, style in ways.items():
            mine = [row for row in grown if (row["estimator"], row["group"]) == (name, group)]
            mine = [row for row in mine if row["of"] == "does"]
            last = [row for row in mine if row["design"] == mine[-1]["design"]]
            x, y = ([float(row[key]) for row in last] for key in ("period", "q0.99"))
            growing.semilogy(x, np.maximum(y, 1.0), style, color=f"C{k}", label=f"{group}: {name}")
    growing.set(xlabel="period", ylabel="99 % quantile of |dx| [per 10 deg or 0.1 L_p]")
    growing.set_title("growth of a trial's derivative, DoEs, turned fingertips")
    growing.legend(fontsize=7)
    two = [row for row in rows if row["group"] != EIGHT]
    for axis, of, title in zip(others, ("does", "eoen"), ("DoEs", "EoEn"), strict=True):
        for k, name in enumerate(dict.fromkeys(row["estimator"] for row in two)):
            mine = [row for row in two if (row["estimator"], row["of"]) == (name, of)]
            x, y, error = (
                np.array([float(row[key]) for row in mine]) for key in ("truth", "value", "se")
            )
            # Beside each other.
            x, color = x + 0.003 * (k - 1), f"C{k + 2}"
            axis.errorbar(x, y, error, fmt="o", ms=3.5, lw=0.8, color=color, label=name)
        reach = 1.1 * max(float(row["truth"]) for row in two if row["of"] == of)
        axis.plot([0, reach], [0, reach], color="0.6", lw=0.8, zorder=0)
        axis.set(title=f"d ln {title}, two parameters", xlabel="exact difference")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7, loc="lower left" if of == "does" else "upper left")
    others[0].set_ylabel("estimate [per 10 degrees, per 0.1 L_p]")
    return figure


if __name__ == "__main__":
    main()
