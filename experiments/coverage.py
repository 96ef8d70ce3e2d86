"""How often the 95 % intervals hold the truth, from ordinary hands to some with hardly any escape.

Pools of real trials are run, and each pool's own mean, or ratio or difference of means, is taken as
the truth. Samples of 10, 100 and 1,000 trials are drawn from it with replacement, and it is counted
how often the interval holds the truth and how wide it is, and both for the usual one: Student's t,
Wilson's for a share, the delta method in the logarithm for a score. Where no interval is given
(`given_percent`), the score is undefined. A usual one that is not given misses the truth.

With `--stopping`: as many trials are drawn as a precision takes that was asked for
(`pcjax.quality.stopping`), and beside it as many as it takes where it is looked after every 1,000
trials whether the interval is narrow enough.

Keeps `results/coverage.csv`, or `results/coverage_stopping.csv`.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.special import stdtrit
from scipy.stats import binomtest
from tqdm import tqdm

from pcjax.model.bodies.circle import Circle
from pcjax.model.presets import box_hand
from pcjax.model.scenario import DIRECTIONS
from pcjax.quality.indices import Estimate, mean, ratio
from pcjax.quality.stopping import FIRST_LOOK, half_width, next_look
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.outcomes import LIMIT

POOLS = {
    "ordinary": (25.0, 200.0, (10, 20), 600_000),
    "heavy": (25.0, 400.0, (-20, -30), 600_000),
    "near closed": (3.0, 200.0, (70, 65), 100_000),
    "hardly any": (3.0, 200.0, (70, 65), 30_000),
}
"""Radius, gap width, fingertip angles (degrees) of the hand and of the one that it is compared
with, and the step limit."""

SIZES = (10, 100, 1_000)

Trials = Float[np.ndarray, " trials"]
Case = tuple[Float[np.ndarray, "k pool"], Callable[[np.ndarray], Estimate]]


def pool(name: str, trials: int) -> tuple[Int[np.ndarray, "3 trials"], np.ndarray, int]:
    """Escape steps of DoEs, EoEn and the other hand's DoEs, who reached the limit, and the limit;
    trials that went wrong somewhere are left out."""
    radius, gap_width, angles, limit = POOLS[name]
    scenarios = [
        DIRECTIONS[direction](
            box_hand(math.radians(angle), gap_width=gap_width, fingertip_length=100.0),
            Circle(radius),
        )
        for angle, direction in ((angles[0], "does"), (angles[0], "eoen"), (angles[1], "does"))
    ]
    engine = choose_engine("auto", None, scenarios[0])
    out = run(scenarios, engine=engine, trials=trials, max_steps=limit, seed=0, progress=True)
    valid = np.isin(out.status, (1, LIMIT)).all(axis=0)
    return out.steps[:, valid], out.status[:, valid] == LIMIT, limit


def cases(steps: np.ndarray, stayed: np.ndarray, limit: int) -> Iterator[tuple[str, Case]]:
    """What is estimated: values of each trial, and the estimate from a sample of them."""
    for number, values, most in ((1, steps.astype(float), limit), (2, stayed.astype(float), 1)):
        does, eoen, other = values
        yield f"index {number}", (does[None], lambda v, most=most: mean(v[0], 0, most))
        yield (
            f"score, index {number}",
            (np.stack([does, eoen]), lambda v, most=most: ratio(v[0], v[1], most)),
        )
        yield (
            f"difference, index {number}",
            ((does - other)[None], lambda v, most=most: mean(v[0], -most, most)),
        )


def usual(what: str, estimate: Estimate, size: int) -> tuple[float, float]:
    """The usual interval: Student's t, Wilson's, or the delta method in the logarithm."""
    value, se = estimate.value, estimate.se
    if what == "index 2":
        wilson = binomtest(round(value * size), size).proportion_ci(method="wilson")
        return float(wilson.low), float(wilson.high)
    if what.startswith("score"):
        if not value > 0:
            return math.nan, math.nan
        factor = math.exp(min(1.96 * se / value, 700.0))
        return value / factor, value * factor
    reach = float(stdtrit(size - 1, 0.975)) * se
    return value - reach, value + reach


def rows(trials: int, repeats: int) -> Iterator[dict[str, str]]:
    """The table, a row for each pool, estimate and size."""
    for name in POOLS:
        steps, stayed, limit = pool(name, trials)
        for what, (values, estimate) in cases(steps, stayed, limit):
            means = values.mean(axis=1)
            truth = float(means[0] if len(means) == 1 else means[0] / means[1])
            for size in SIZES:
                rng = np.random.default_rng([size, repeats])
                held, usual_held, given, widths, usual_widths = 0, 0, 0, [], []
                for _ in tqdm(range(repeats), desc=f"{name}, {what}, {size}", leave=False):
                    got = estimate(values[:, rng.integers(0, values.shape[1], size)])
                    low, high = usual(what, got, size)
                    usual_held += low <= truth <= high
                    if math.isnan(got.low):
                        continue
                    given += 1
                    held += got.low <= truth <= got.high
                    widths.append(got.high - got.low)
                    usual_widths.append(high - low)
                # Of no samples there is no coverage.
                share = held / given if given else math.nan
                error = math.sqrt(share * (1 - share) / given) if given else math.nan
                yield {
                    "pool": name,
                    "escapes_percent": f"{100 * (1 - stayed[0].mean()):.2f}",
                    "estimate": what,
                    "trials": str(size),
                    "truth": f"{truth:.6g}",
                    "given_percent": f"{100 * given / repeats:.1f}",
                    "coverage_percent": f"{100 * share:.2f}",
                    "coverage_error": f"{100 * error:.2f}",
                    "mean_width": f"{np.mean(widths or math.nan):.4g}",
                    "usual_coverage_percent": f"{100 * usual_held / repeats:.2f}",
                    "usual_mean_width": f"{np.nanmean(usual_widths or math.nan):.4g}",
                }


TARGETS = (0.1, 0.05, 0.02, 0.01)


def stopping_rows(trials: int, repeats: int) -> Iterator[dict[str, str]]:
    """The table with `--stopping`, a row for each pool, estimate, precision and rule."""
    for name in ("ordinary", "heavy", "near closed"):
        steps, _, limit = pool(name, trials)
        does, eoen, other = steps.astype(float)
        best = float(does.mean())
        asked: dict[str, tuple[np.ndarray, Callable[[np.ndarray], Estimate], float]] = {
            "index 1": (does[None], lambda v, most=limit: mean(v[0], 0, most), math.nan),
            "score": (np.stack([does, eoen]), lambda v, m=limit: ratio(v[0], v[1], m), math.nan),
            "difference": ((does - other)[None], lambda v, m=limit: mean(v[0], -m, m), best),
        }
        for what, (values, estimate, of) in asked.items():
            means = values.mean(axis=1)
            truth = float(means[0] if len(means) == 1 else means[0] / means[1])
            for target in TARGETS:
                # The other one takes hours for what is very precise.
                for rule in ("planned", "every 1,000") if target > 0.01 else ("planned",):
                    rng = np.random.default_rng(repeats)
                    held, used, looks = 0, [], []
                    for _ in tqdm(range(repeats), desc=f"{name}, {what}, {target}", leave=False):
                        sample, look, seen = values[:, :0], FIRST_LOOK, 0
                        while True:
                            more = rng.integers(0, values.shape[1], look - sample.shape[1])
                            sample = np.concatenate([sample, values[:, more]], axis=1)
                            got, seen = estimate(sample), seen + 1
                            wanted = target * (got.value if math.isnan(of) else of)
                            look = next_look(half_width(got), wanted, sample.shape[1], 200_000)
                            if look == sample.shape[1]:
                                break
                            if rule != "planned":
                                look = sample.shape[1] + 1000
                        held += got.low <= truth <= got.high
                        used.append(sample.shape[1])
                        looks.append(seen)
                    share = held / repeats
                    yield {
                        "pool": name,
                        "estimate": what,
                        "target_percent": f"{100 * target:g}",
                        "rule": rule,
                        "coverage_percent": f"{100 * share:.2f}",
                        "coverage_error": f"{100 * math.sqrt(share * (1 - share) / repeats):.2f}",
                        "mean_trials": f"{np.mean(used):.0f}",
                        "mean_looks": f"{np.mean(looks):.2f}",
                    }


def main() -> None:
    """Runs the pools and draws from them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--trials", type=int, default=100_000, help="trials of a pool")
    parser.add_argument("--repeats", type=int, default=2_000, help="samples of each size")
    parser.add_argument("--stopping", action="store_true", help="precisions that are asked for")
    arguments = parser.parse_args()
    name, made = ("coverage", rows)
    if arguments.stopping:
        name, made = ("coverage_stopping", stopping_rows)
    out = Path(__file__).parent / "results" / f"{name}.csv"
    table = list(made(arguments.trials, arguments.repeats))
    with out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, table[0])
        writer.writeheader()
        writer.writerows(table)
    for row in table:
        print("  ".join(row.values()))


if __name__ == "__main__":
    main()
