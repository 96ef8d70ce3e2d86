"""Index 1, index 2 and the score against survival analysis, closed forms and repeated sampling."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from lifelines import KaplanMeierFitter
from lifelines.utils import restricted_mean_survival_time
from scipy import stats

import pcjax
from pcjax.quality.indices import (
    UNDEFINED,
    Estimate,
    index1,
    index2,
    mean,
    ratio,
    survival_curve,
)
from pcjax.simulate.outcomes import LIMIT
from tests.shown import ROOT


def sampled(name: str) -> tuple[np.ndarray, np.ndarray, int]:
    """Escape steps (the limit where censored), who was censored, and the limit."""
    rng = np.random.default_rng(5)
    limit = 1000
    steps = {
        "spread": rng.geometric(1 / 700, 300),
        # Many ties, some escapes in the very last step, which are escapes all the same.
        "ties": rng.choice([1, 10, 10, 999, 1000, 5000], 200),
        "all escape": rng.integers(1, 900, 50),
        "most stay": np.concatenate([[17], np.full(40, 2000)]),
        "one trial": np.array([400]),
    }[name]
    return np.minimum(steps, limit), steps > limit, limit


SAMPLES = ("spread", "ties", "all escape", "most stay", "one trial")


@pytest.fixture(scope="module")
def run() -> pcjax.Evaluation:
    """A small real run in which some trials escape and some stay, in both directions."""
    hand = pcjax.box_hand(math.radians(-20.0), gap_width=400.0)
    return pcjax.evaluate(hand, trials=64, max_steps=50_000)


def pair_of_lives(
    rng: np.random.Generator, shape: tuple[int, ...], limit: float = 1.0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Correlated pairs of restricted exponential life times, and the true ratio of their means.

    Rates 1 and 2, a Gaussian copula of correlation 0.8, both restricted to `limit`.
    """
    first = rng.standard_normal(shape)
    second = 0.8 * first + 0.6 * rng.standard_normal(shape)
    rates = (1.0, 2.0)
    lives = [
        np.minimum(-np.log(stats.norm.sf(normal)) / rate, limit)
        for normal, rate in zip((first, second), rates, strict=True)
    ]
    # E min(T, L) = (1 - exp(-rate L)) / rate
    means = [(1 - math.exp(-rate * limit)) / rate for rate in rates]
    return lives[0], lives[1], means[0] / means[1]


# ------------------------------------------------------------------------------------- index 1


def restricted_mean(fitted: KaplanMeierFitter, limit: float) -> float:
    mean = restricted_mean_survival_time(fitted, t=limit)
    assert isinstance(mean, float)
    return mean


@pytest.mark.parametrize("name", SAMPLES)
def test_index1_is_the_restricted_mean_survival_time(name: str):
    steps, stayed, limit = sampled(name)
    expected = restricted_mean(KaplanMeierFitter().fit(steps, ~stayed), limit)
    assert index1(steps, limit).value == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ["spread", "ties", "most stay"])
def test_index1_standard_error_is_that_of_the_restricted_mean(name: str):
    steps, stayed, limit = sampled(name)
    curve = KaplanMeierFitter().fit(steps, ~stayed).survival_function_["KM_estimate"]
    # Var min(T, L) = 2 int_0^L t S(t) dt - RMST^2, exactly, for the fitted step function S.
    times = np.append(curve.index.to_numpy(), limit)
    mean = np.sum(curve.to_numpy() * np.diff(times))
    variance = np.sum(curve.to_numpy() * np.diff(times**2)) - mean**2
    # It is the sample variance with divisor n; the mean's standard error has divisor n - 1.
    assert index1(steps, limit).se == pytest.approx(
        math.sqrt(variance / (len(steps) - 1)), rel=1e-9
    )


def test_index1_interval_of_many_trials_is_students():
    # 5,000 trials, a third of them at the limit: 1 % wider is what the bound costs.
    steps = np.minimum(np.random.default_rng(6).geometric(1 / 900, 5000), 1000)
    interval = stats.ttest_1samp(steps, 0.0).confidence_interval(0.95)
    estimate = index1(steps, 1000)
    width = interval.high - interval.low
    assert width < estimate.high - estimate.low < 1.02 * width
    assert (estimate.low, estimate.high) == pytest.approx(
        (interval.low, interval.high), abs=0.02 * width
    )


@pytest.mark.parametrize("direction", ["does", "eoen"])
def test_a_real_run_agrees_with_survival_analysis(run: pcjax.Evaluation, direction: str):
    data = run.dataset.sel(direction=direction)
    steps, stayed = data.escape_step.values, data.status.values == LIMIT
    assert 0 < stayed.sum() < len(stayed), "the sample has to mix escapes and censored trials"
    kaplan_meier = KaplanMeierFitter().fit(steps, ~stayed)
    estimates = run.indices(direction)
    expected = restricted_mean(kaplan_meier, run.max_steps)
    assert estimates["index1"].value == pytest.approx(expected, rel=1e-12)
    at_the_limit = kaplan_meier.survival_function_at_times(run.max_steps).item()
    assert estimates["index2"].value == pytest.approx(at_the_limit, abs=1e-12)
    times, left = run.survival(direction)
    np.testing.assert_allclose(left, kaplan_meier.survival_function_at_times(times), atol=1e-12)


# ------------------------------------------------------------------------------- survival curve


@pytest.mark.parametrize("name", SAMPLES)
def test_survival_curve_is_kaplan_meiers(name: str):
    steps, stayed, limit = sampled(name)
    times, left = survival_curve(steps, stayed)
    kaplan_meier = KaplanMeierFitter().fit(steps, ~stayed)
    # Right-continuous: at a time of the curve, and between its times, the last value counts.
    asked = np.unique(np.concatenate([times, times + 0.5, [limit]]))
    ours = left[np.searchsorted(times, asked, side="right") - 1]
    np.testing.assert_allclose(ours, kaplan_meier.survival_function_at_times(asked), atol=1e-12)
    assert (times[0], left[0]) == (0, 1)
    assert left[-1] == pytest.approx(stayed.mean(), abs=1e-12)


@pytest.mark.parametrize("name", SAMPLES)
def test_area_under_the_survival_curve_is_index1(name: str):
    steps, stayed, limit = sampled(name)
    times, left = survival_curve(steps, stayed)
    area = np.sum(left * np.diff(np.append(times, limit)))
    assert index1(steps, limit).value == pytest.approx(area, rel=1e-12)


def test_survival_curve_of_trials_that_all_stay_is_flat():
    times, left = survival_curve(np.full(9, 100), np.full(9, True))
    assert (times.tolist(), left.tolist()) == ([0.0], [1.0])


# ------------------------------------------------------------------------------------- index 2


@pytest.mark.parametrize(
    ("stay", "n"), [(0, 1), (1, 1), (0, 40), (40, 40), (1, 40), (13, 40), (4999, 5000)]
)
def test_index2_interval_is_clopper_and_pearsons(stay: int, n: int):
    estimate = index2(np.arange(n) < stay)
    interval = stats.binomtest(stay, n).proportion_ci(0.95, method="exact")
    assert estimate.value == stay / n
    assert estimate.se == pytest.approx(float(stats.binom.std(n, stay / n)) / n, rel=1e-12)
    # The saddlepoint is near: by 1 % of the width, outwards, or hardly inwards.
    width = interval.high - interval.low
    assert -0.01 * width < estimate.low - interval.low < 1e-4 * width
    assert -1e-4 * width < estimate.high - interval.high < 0.01 * width
    assert 0 <= estimate.low <= estimate.value <= estimate.high <= 1


@pytest.mark.parametrize("n", [1, 7, 40, 5000])
def test_index2_interval_stays_within_0_and_1(n: int):
    nobody, everybody = index2(np.full(n, False)), index2(np.full(n, True))
    assert (nobody.value, nobody.low) == (0.0, 0.0)
    assert (everybody.value, everybody.high) == (1.0, 1.0)
    assert nobody.high == pytest.approx(1.0 - everybody.low, rel=1e-12)
    assert 0 < nobody.high < 1


@pytest.mark.parametrize("n", [1, 10, 60])
def test_index2_interval_covers_every_share(n: int):
    # Exact coverage, summed over the binomial distribution: nothing is drawn.
    counts = np.arange(n + 1)
    estimates = [index2(np.arange(n) < count) for count in counts]
    low, high = np.array([[e.low, e.high] for e in estimates]).T
    for share in np.concatenate([np.geomspace(1e-4, 0.5, 100), 1 - np.geomspace(1e-4, 0.5, 100)]):
        covered = (low <= share) & (share <= high)
        assert np.sum(stats.binom.pmf(counts, n, share)[covered]) >= 0.95, share


# ---------------------------------------------------------------------------- the bound of a mean


@pytest.mark.parametrize("name", ["many ends", "skew", "one escaped", "two values"])
def test_bounds_are_quantiles_over_the_simplex(name: str):
    # 200,000 draws of uniform weights: the share under the bound has an error of 0.035 %, four of
    # which, and 0.1 % for the saddlepoint, are granted. Checked with other seeds, too.
    rng = np.random.default_rng(7)
    sample = {
        "many ends": np.minimum(rng.exponential(1.0, 30), 1.0),
        "skew": np.minimum(rng.exponential(0.05, 12), 1.0),
        "one escaped": np.append(np.ones(9), 0.3),
        "two values": np.repeat([0.2, 0.7], [3, 8]),
    }[name]
    weights = rng.dirichlet(np.ones(len(sample) + 1), 200_000)
    estimate = mean(sample, 0.0, 1.0)
    under = np.mean(weights @ np.append(sample, 0.0) < estimate.low)
    over = np.mean(weights @ np.append(sample, 1.0) > estimate.high)
    for share in (under, over):
        assert share == pytest.approx(0.025, abs=0.0024)


def test_higher_values_have_higher_bounds():
    rng = np.random.default_rng(8)
    for n in (1, 4, 30):
        some = rng.uniform(size=n) ** rng.choice([0.1, 1, 10])
        more = some + (1 - some) * rng.uniform(size=n) * (rng.uniform(size=n) < 0.3)
        one, two = mean(some, 0.0, 1.0), mean(more, 0.0, 1.0)
        assert one.low <= two.low
        assert one.high <= two.high


def test_more_trials_narrow_the_interval_and_wider_ends_widen_it():
    sample = np.minimum(np.random.default_rng(9).exponential(0.5, 20), 1.0)
    widths = [e.high - e.low for e in (mean(np.tile(sample, k), 0.0, 1.0) for k in (1, 5, 50))]
    assert widths[0] > widths[1] > widths[2] > 0
    near, far = mean(sample, 0.0, 1.0), mean(sample, -1.0, 2.0)
    assert far.low < near.low
    assert near.high < far.high


def test_index1_is_known_at_least_as_well_as_index2_says():
    # A trial that reaches the limit gives all of it, any other at least nothing.
    for name in SAMPLES:
        steps, stayed, limit = sampled(name)
        assert index1(steps, limit).low >= limit * index2(stayed).low * (1 - 1e-9)


def fewest_covering(repeats: int) -> int:
    """What a count of intervals that cover with 95 % stays under for one seed in 10,000."""
    return int(stats.binom.ppf(1e-4, repeats, 0.95))


def lives_of(
    rng: np.random.Generator, rate: float, shape: tuple[int, int], limit: int
) -> tuple[np.ndarray, float]:
    """Geometric escape steps cut at the limit, and their true mean (1 - (1 - p)^L) / p."""
    return np.minimum(rng.geometric(rate, shape), limit), -math.expm1(
        limit * math.log1p(-rate)
    ) / rate


@pytest.mark.parametrize("n", [10, pytest.param(100, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("rate", [2e-6, 2e-5, 1e-3, 5e-2, 0.5])
def test_index1_interval_covers_from_nobody_escapes_to_everybody_at_once(rate: float, n: int):
    # 300 samples; 0.2 % escape within the limit at the lowest rate. False alarm: one seed in
    # 10,000 for each of ten cases, or less, where more than 95 % are covered.
    lives, truth = lives_of(np.random.default_rng(42), rate, (300, n), 1000)
    estimates = [index1(steps, 1000) for steps in lives]
    assert sum(e.low <= truth <= e.high for e in estimates) >= fewest_covering(300)
    for e in estimates:
        assert 0 <= e.low <= e.value <= e.high <= 1000
        assert e.high - e.low > 1e-4 * 1000


@pytest.mark.parametrize("n", [10, pytest.param(100, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("rates", [(2e-5, 1e-4), (1e-3, 3e-3), (5e-2, 2e-2)])
def test_score_and_differences_cover_with_few_escapes(rates: tuple[float, float], n: int):
    # 100 samples of pairs that share half of their trials' draws; false alarm as above, six cases
    # of four intervals.
    rng, limit, repeats = np.random.default_rng(43), 1000, 100
    shared, own = rng.uniform(size=(2, repeats, n))
    draws = shared, np.where(rng.uniform(size=own.shape) < 0.5, shared, own)
    a, b = (
        np.minimum(1 + np.floor(np.log(u) / np.log1p(-rate)), limit)
        for u, rate in zip(draws, rates, strict=True)
    )
    means = [-math.expm1(limit * math.log1p(-rate)) / rate for rate in rates]
    stay = [(1 - rate) ** (limit - 1) for rate in rates]
    cases = [(a, b, limit, *means), ((a == limit) * 1.0, (b == limit) * 1.0, 1, *stay)]
    for top, bottom, most, true_top, true_bottom in cases:
        scores = [ratio(x, y, most) for x, y in zip(top, bottom, strict=True)]
        gaps = [mean(x - y, -most, most) for x, y in zip(top, bottom, strict=True)]
        for estimates, truth in ((scores, true_top / true_bottom), (gaps, true_top - true_bottom)):
            given = [e for e in estimates if not math.isnan(e.value)]
            missed = sum(not e.low <= truth <= e.high for e in given)
            assert missed <= repeats - fewest_covering(repeats)
            assert all(e.low <= e.value <= e.high and e.low < e.high for e in given)


# --------------------------------------------------------------------------------------- score


def test_score_standard_error_agrees_with_a_paired_bootstrap():
    # 400 pairs, 10,000 resamples: the bootstrap's own error is 1 / sqrt(2 * 10,000) = 0.7 %, what
    # it differs from the delta method by is of order 1 / 400. Tolerance 4 %: over 5 of its errors,
    # while breaking the pairs, below, moves the standard error by 69 %.
    a, b, _ = pair_of_lives(np.random.default_rng(11), (400,))
    draws = np.random.default_rng(12).integers(0, 400, (10_000, 400))
    resampled = a[draws].mean(axis=1) / b[draws].mean(axis=1)
    estimate = ratio(a, b, 1.0)
    assert estimate.value == pytest.approx(a.mean() / b.mean(), rel=1e-14)
    assert estimate.se == pytest.approx(float(resampled.std(ddof=1)), rel=0.04)
    unpaired = ratio(a, np.random.default_rng(13).permutation(b), 1.0)
    assert unpaired.se > 1.5 * estimate.se


def test_score_by_index2_agrees_with_a_paired_bootstrap():
    # As above with shares of trials that stay; 4 %.
    a, b, _ = pair_of_lives(np.random.default_rng(21), (400,), limit=0.4)
    stayed, stayed_in = (a == 0.4).astype(float), (b == 0.4).astype(float)
    draws = np.random.default_rng(22).integers(0, 400, (10_000, 400))
    resampled = stayed[draws].mean(axis=1) / stayed_in[draws].mean(axis=1)
    estimate = ratio(stayed, stayed_in, 1.0)
    assert estimate.se == pytest.approx(float(resampled.std(ddof=1)), rel=0.04)


def test_score_interval_covers_the_truth_in_95_of_100_runs():
    # 500 runs of 200 correlated pairs; false alarm: one seed in 10,000. Halving the error covers
    # 67 %. It is at most 20 % wider than the delta method's, which it tends to.
    a, b, truth = pair_of_lives(np.random.default_rng(31), (500, 200))
    estimates = [ratio(x, y, 1.0) for x, y in zip(a, b, strict=True)]
    assert sum(e.low <= truth <= e.high for e in estimates) >= fewest_covering(500)
    wider = [math.log(e.high / e.low) / (2 * 1.96 * e.se / e.value) for e in estimates]
    assert 1.0 < np.mean(wider) < 1.2


def test_kept_table_has_no_interval_that_fails():
    with (ROOT / "experiments" / "results" / "coverage.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len({(row["pool"], row["estimate"], row["trials"]) for row in rows}) == 4 * 6 * 3
    for row in rows:
        assert float(row["given_percent"]) == 100 or row["estimate"] == "score, index 2"
        assert float(row["coverage_percent"]) >= 93


def test_score_does_not_depend_on_the_unit_of_time():
    a, b, _ = pair_of_lives(np.random.default_rng(51), (100,))
    in_steps, in_seconds = ratio(1000 * a, 1000 * b, 1000.0), ratio(a, b, 1.0)
    for name in ("value", "se", "low", "high"):
        assert getattr(in_steps, name) == pytest.approx(getattr(in_seconds, name), rel=1e-7)


def test_inverse_of_the_score_has_the_inverse_interval():
    a, b, _ = pair_of_lives(np.random.default_rng(52), (100,))
    score, inverse = ratio(a, b, 1.0), ratio(b, a, 1.0)
    assert (inverse.value, inverse.low, inverse.high) == pytest.approx(
        (1 / score.value, 1 / score.high, 1 / score.low), rel=1e-7
    )


def test_score_of_a_hand_against_itself_is_near_1_the_nearer_the_more_trials():
    a, _, _ = pair_of_lives(np.random.default_rng(53), (100,))
    few, many = ratio(a, a, 1.0), ratio(np.tile(a, 50), np.tile(a, 50), 1.0)
    assert (few.value, few.se) == (many.value, many.se) == (1.0, 0.0)
    # One trial in 27 could be unlike all of these 100.
    assert 0.85 < few.low < 0.97 < many.low < 1 < many.high < 1.03 < few.high < 1.15


# -------------------------------------------------------------------------- degenerate samples


def same(estimate: Estimate, expected: Estimate) -> bool:
    """Equality in which NaN equals NaN."""
    pairs = [(getattr(estimate, n), getattr(expected, n)) for n in ("value", "se", "low", "high")]
    return all(x == y or (math.isnan(x) and math.isnan(y)) for x, y in pairs)


def test_trials_that_all_end_alike_are_no_certainty():
    stuck = index1(np.full(10, 600_000), 600_000)
    assert (stuck.value, stuck.se, stuck.high) == (600_000.0, 0.0, 600_000.0)
    # 31 % of trials could escape, and 10 in a row would still not be too unlikely.
    assert stuck.low == pytest.approx(600_000 * 0.025 ** (1 / 10), rel=0.005)
    score = ratio(np.full(7, 500.0), np.full(7, 400.0), 600.0)
    assert score.low < score.value == 1.25 < score.high


def test_what_is_known_for_certain_has_no_width():
    assert index1(np.full(7, 600), 600, certain=True) == Estimate(600.0, 0.0, 600.0, 600.0)
    assert index2(np.full(7, True), certain=True) == Estimate(1.0, 0.0, 1.0, 1.0)
    caged = ratio(np.full(7, 600.0), np.full(7, 600.0), 600.0, certain=(True, True))
    assert caged == Estimate(1.0, 0.0, 1.0, 1.0)
    # DoEs for certain and EoEn not: the score cannot be lower.
    half = ratio(np.full(7, 600.0), np.full(7, 600.0), 600.0, certain=(True, False))
    assert half.low == 1.0 < half.high


def test_one_trial_has_bounds_but_no_error():
    one, score = index1(np.array([123]), 1000), ratio(np.array([3.0]), np.array([2.0]), 9.0)
    assert (one.value, score.value) == (123.0, 1.5)
    assert math.isnan(one.se)
    assert math.isnan(score.se)
    assert 0 < one.low < 123 < 900 < one.high < 1000
    assert 0 < score.low < 0.1 < 20 < score.high < math.inf


@pytest.mark.parametrize(("stay", "pass_", "lost"), [(3, 5, 2), (40, 60, 1), (0, 9, 9), (5, 0, 95)])
def test_trials_that_went_wrong_could_have_ended_either_way(stay: int, pass_: int, lost: int):
    # Every one passes, or every one stays: from the one interval's end to the other one's.
    known = np.arange(stay + pass_) < stay
    estimate = index2(known, lost=lost)
    fewest, most = (index2(np.concatenate([known, np.full(lost, all_)])) for all_ in (False, True))
    assert estimate.value == stay / (stay + pass_)
    assert (estimate.low, estimate.high) == pytest.approx((fewest.low, most.high), rel=1e-9)


def test_intervals_hold_however_the_trials_that_went_wrong_would_have_ended():
    rng = np.random.default_rng(11)
    for _ in range(50):
        n, lost = int(rng.integers(4, 60)), int(rng.integers(1, 20))
        lives = rng.choice([rng.uniform(0, 9, (2, n)), np.full((2, n), 9.0)])
        unknown = rng.choice([0.0, 4.0, 9.0], (2, lost))
        whole = np.concatenate([lives, unknown], axis=1)
        for guess, sure in (
            (mean(lives[0], 0, 9, lost=lost), mean(whole[0], 0, 9)),
            (ratio(*lives, 9, lost=lost), ratio(*whole, 9)),
        ):
            assert guess.low <= sure.low * (1 + 1e-6)
            assert guess.high >= sure.high * (1 - 1e-6)


@pytest.mark.parametrize("does", [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0]])
def test_score_over_nothing_is_undefined(does: list[float]):
    assert same(ratio(np.array(does), np.zeros(len(does)), 1.0), UNDEFINED)


def test_score_of_nothing_is_zero_and_has_an_upper_bound():
    estimate = ratio(np.zeros(5), np.array([1.0, 0.0, 1.0, 1.0, 0.0]), 1.0)
    assert (estimate.value, estimate.low) == (0.0, 0.0)
    assert 1 < estimate.high < math.inf


def test_estimates_stay_finite_when_a_single_trial_stays():
    # The widest relative error there is: one 1 among zeros, in different trials.
    does, eoen = np.zeros(5000), np.zeros(5000)
    does[0] = eoen[1] = 1.0
    estimate = ratio(does, eoen, 1.0)
    assert estimate.value == 1.0
    # Each share has relative error 1, and the two exclude each other: sqrt(2).
    assert estimate.se == pytest.approx(math.sqrt(2), rel=1e-3)
    # Of two trials that differ, a share of 0.0127 or more is on one side: Clopper and Pearson's.
    share = stats.binomtest(1, 2).proportion_ci(0.95, method="exact").low
    assert estimate.low == pytest.approx(share / (1 - share), rel=0.05)
    assert estimate.high == pytest.approx(1 / estimate.low, rel=1e-4)
