"""The search that learns: its Gaussian process, what it believes, and what it finds."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import beta, binom, multivariate_normal

import pcjax
from pcjax.design.belief import Batch, Belief
from pcjax.design.checkpoint import Progress
from pcjax.design.compare import compare, comparison_of
from pcjax.design.gaussian import GaussianProcess, Kernel, fitted
from pcjax.design.modelled import Search, calm, tops_of
from pcjax.design.outcome import Settings
from pcjax.design.space import design_space
from pcjax.physics.state import PAPER_DT
from pcjax.quality.surrogate import Sample, Surrogate
from pcjax.quality.task import Task

pytestmark = pytest.mark.usefixtures("quick_programs")

TASK = Task(pcjax.Circle(25.0), pcjax.WristTilt(), ("does", "eoen"), 20_000)
TIPS = design_space(
    pcjax.box_hand(), {"fingertip_angle_deg": (-30.0, 45.0), "fingertip_length": (25, 175)}, 50.0
)
FEW = Settings(iterations=3, accept_trials=40)


# --------------------------------------------------------------------------------- the process


def test_the_process_is_the_conditional_normal_distribution() -> None:
    """Against the textbook's formula, with the matrices written out."""
    rng = np.random.default_rng(1)
    at, other = rng.random((7, 2)), rng.random((4, 2))
    root = 0.1 * rng.standard_normal((7, 7))
    noise = root @ root.T + 0.01 * np.eye(7)
    kernel = Kernel(math.log(0.7), np.log([0.4, 2.0]))
    values = 3.0 + rng.standard_normal(7)

    def covariance(one: np.ndarray, two: np.ndarray) -> np.ndarray:
        r = np.sqrt((((one[:, None] - two) / [0.4, 2.0]) ** 2).sum(axis=-1) * 5)
        return 0.49 * ((1 + r + r**2 / 3) * np.exp(-r) + 10.0)

    total = covariance(at, at) + noise + 0.02 * np.diag(np.diag(noise)) + 1e-8 * 0.49 * np.eye(7)
    gain = covariance(other, at) @ np.linalg.inv(total)
    mean, spread = GaussianProcess(at, values, noise, kernel).joint(other)
    np.testing.assert_allclose(mean, values.mean() + gain @ (values - values.mean()), rtol=1e-9)
    np.testing.assert_allclose(
        spread, covariance(other, other) - gain @ covariance(at, other), atol=1e-9
    )


def test_a_fit_is_likelier_than_what_is_near_it() -> None:
    """By scipy's normal density times the prior's; a step of 0.2 either way in each number."""
    rng = np.random.default_rng(2)
    at = rng.random((40, 2))
    values = np.sin(4 * at[:, 0]) + 0.2 * at[:, 1] + 0.05 * rng.standard_normal(40)
    noise = 0.0025 * np.eye(40)
    found = fitted(at, values, noise)

    def likelihood(kernel: Kernel) -> float:
        total = kernel(at, at) + 1.02 * noise + 1e-8 * math.exp(2 * kernel.log_scale) * np.eye(40)
        off = (kernel.log_lengths - math.sqrt(2) - 0.5 * math.log(2)) / math.sqrt(3)
        far = (kernel.log_scale - math.log(np.std(values) + 1e-6)) / 2
        density = multivariate_normal(np.full(40, values.mean()), total).logpdf(values)
        return float(density - 0.5 * off @ off - 0.5 * far**2)

    top = likelihood(found)
    for step in 0.2 * np.concatenate([np.eye(3), -np.eye(3)]):
        assert likelihood(Kernel(found.log_scale + step[0], found.log_lengths + step[1:])) < top
    # The sine varies over a fraction of the bounds, the line hardly.
    assert found.log_lengths[0] < found.log_lengths[1] - 1


def test_what_erred_together_is_compared_sharply() -> None:
    """Two designs on the same trials: neither value is known well, their difference is."""
    at = np.array([[0.2], [0.8], [0.5]])
    shared = np.full((3, 3), 0.04)
    noise = shared + 1e-6 * np.eye(3)
    process = GaussianProcess(at, np.array([1.0, 1.1, 1.05]), noise, Kernel(0.0, np.log([0.5])))
    mean, spread = process.joint(at[:2])
    assert mean[1] - mean[0] == pytest.approx(0.1, abs=0.01)
    assert math.sqrt(spread[0, 0]) > 0.15
    assert math.sqrt(spread[0, 0] + spread[1, 1] - 2 * spread[0, 1]) < 0.05


# ---------------------------------------------------------------------------------- the belief


def test_lucky_samples_do_not_count_for_more() -> None:
    """200 shares of 40 trials of which 0.8 are held, each with a variance from its own share: the
    mean of the logarithms is within 3.5 s.e. of the truth (false alarm 5e-4). Weighed by each
    sample's own variance, which is least where the share is high, it is 6 s.e. too high."""
    rng = np.random.default_rng(3)
    surrogate = Surrogate(replace(TASK, directions=("does",)), form="exact", trials=40)
    shares = (rng.binomial(40, 0.8, size=200) + 0.5) / 41
    variances = (1 - shares) / (40 * shares)
    at = np.linspace(0, 1, 200)[:, None]
    belief = Belief(surrogate)
    belief.learn(Batch(at, np.log(shares)[:, None], np.diag(variances)[None], 40))
    found = belief.mean(np.linspace(0.1, 0.9, 9)[:, None]).mean()
    every = (np.arange(41) + 0.5) / 41
    truth = binom(40, 0.8).pmf(np.arange(41)) @ np.log(every)
    error = math.sqrt(0.2 / (40 * 0.8) / 200)
    assert abs(found - truth) < 3.5 * error
    own = np.average(np.log(shares), weights=1 / variances)
    assert own - truth > 3.5 * error


def test_no_share_is_certain() -> None:
    """None or all of n held: half a trial more either way, as Jeffreys' prior has it."""
    surrogate = Surrogate(replace(TASK, directions=("does",)), "index2", "exact", trials=250)
    for held in (0, 1, 100, 250):
        ends = np.arange(250) < held
        sample = Sample(np.stack([ends * 20.0, ends * 1.0])[None, None], np.ones(250, bool), 0)
        (logs,), _ = surrogate.appraise(sample)
        posterior = beta(held + 0.5, 250 - held + 0.5)
        assert math.exp(logs[0]) == pytest.approx(posterior.mean(), rel=1e-6)
        doubt = float(surrogate.doubt(sample.means(), 250)[0, 0])
        assert doubt > (0.5 / 250) ** 2
        if held == 0:
            assert doubt == pytest.approx(2.0, rel=0.05)  # e-fold either way, and more


def test_a_score_that_cannot_be_known_is_undefined() -> None:
    """By index 2 nothing is held for 10,000 s, from inside or from outside."""
    task = replace(TASK, max_steps=10_000_000)
    surrogate = Surrogate(task, objective="index2", trials=20)
    found = compare(surrogate, TIPS, [np.array([0.0, 50.0])] * 2, trials=20, seed=0)
    assert all(math.isnan(score.value) for score in found.scores)
    assert math.isnan(found.improvement(0, 1).value)
    assert np.isfinite(found.logs).all()


@pytest.mark.parametrize("seed", range(3))
def test_what_is_known_well_can_be_drawn_from(seed: int) -> None:
    """A line, whose process is long and wide: the prior cancels but for rounding."""
    rng = np.random.default_rng(seed)
    belief = Belief(Surrogate(replace(TASK, directions=("does",)), form="exact"))
    for _ in range(8):
        at = rng.random((8, 1))
        logs = 3 * at + 0.01 * rng.standard_normal((8, 1))
        belief.learn(Batch(at, logs, 1e-4 * np.eye(8)[None], 250))
    places = rng.random((300, 1))
    drawn = belief.draws(places, 200, rng)
    np.testing.assert_allclose(drawn.mean(axis=1), 3 * places[:, 0], atol=0.02)
    assert np.max(drawn.std(axis=1)) < 0.02


# ------------------------------------------------------------------------------------ the search


def test_tops_are_those_of_the_hills() -> None:
    """Two hills, one hill, and one ridge that is bent: two tops, one and one."""
    rng = np.random.default_rng(4)
    places = rng.random((600, 2))

    def hill(x: float, y: float, height: float) -> np.ndarray:
        return height * np.exp(-((places - [x, y]) ** 2).sum(axis=1) / 0.02)

    two = np.maximum(hill(0.2, 0.3, 1.0), hill(0.8, 0.6, 0.7))
    tops = places[tops_of(places, two, known=600)]
    np.testing.assert_allclose(tops, [[0.2, 0.3], [0.8, 0.6]], atol=0.06)
    one = tops_of(places, hill(0.2, 0.3, 1.0), known=600)
    np.testing.assert_allclose(places[one], [[0.2, 0.3]], atol=0.06)
    radius = np.hypot(*places.T)
    angle = np.arctan2(*places.T)
    ridge = 1.0 - 8 * (radius - 0.7) ** 2 - 0.1 * angle
    assert len(tops_of(places, ridge, known=600)) == 1
    # Of a hill whose top is not known, the highest place that is.
    known = np.flatnonzero(two < 0.5)
    order = np.concatenate([known, np.flatnonzero(two >= 0.5)])
    found = tops_of(places[order], two[order], known=len(known))
    assert set(found) <= set(range(len(known)))


def test_designs_are_drawn_in_to_the_edge() -> None:
    """Along 200 - 2 L sin(theta) = 70, the clearance's edge, to 1/64 of the way there."""
    search = Search(Surrogate(TASK), TIPS.holding(TASK), 0)
    inside = search.place(np.array([0.0, 100.0]))
    at = np.random.default_rng(5).uniform(-0.2, 1.2, (60, 2))
    found = search.drawn_in(at, np.repeat(inside[None], 60, axis=0))
    assert search.allowed(found).all()
    good = search.allowed(np.clip(at, 0, 1))
    np.testing.assert_array_equal(found[good], np.clip(at, 0, 1)[good])
    for one, wanted in zip(found[~good], np.clip(at, 0, 1)[~good], strict=True):
        beyond = one + (wanted - inside) / 60
        assert not search.allowed(np.clip(beyond, 0, 1)[None])[0]


class Hills(Search):
    """A search over a known landscape: two hills, the start near the lower one; noise that the
    designs of a batch share for the most part."""

    def height(self, at: np.ndarray) -> np.ndarray:
        at = at[:, :2]  # others do nothing
        low = 0.6 * np.exp(-((at - [0.25, 0.3]) ** 2).sum(axis=1) / 0.08)
        return low + 0.9 * np.exp(-((at - [0.8, 0.75]) ** 2).sum(axis=1) / 0.05)

    def try_out(self, at: np.ndarray, round: int) -> tuple[Batch, int]:
        rng, count = np.random.default_rng([self.seed, round, 7]), self.trials(round)
        covariance = (0.8 * np.ones((len(at),) * 2) + 0.2 * np.eye(len(at))) / count
        shift = np.linalg.cholesky(covariance) @ rng.standard_normal(len(at))
        logs = np.stack([self.height(at) + shift, np.zeros(len(at))], axis=1)
        noise = np.stack([covariance, 1e-8 * np.eye(len(at))])
        return Batch(at, logs, noise, count), 0


def search_hills(
    seed: int, rounds: int, others: dict[str, tuple[float, float]] | None = None
) -> tuple[Hills, Belief]:
    free = {"fingertip_angle_deg": (-30.0, 0.0), "fingertip_length": (25.0, 175.0)}
    wide = design_space(pcjax.box_hand(), free | (others or {}), 50.0)
    search = Hills(Surrogate(TASK, trials=1000), wide.holding(TASK), seed)
    belief = Belief(search.surrogate)
    begin = np.full(len(wide.free), 0.2)
    state = Progress([[]], [list(search.design(begin))], [])
    for _ in range(rounds):
        state = search.round(belief, state)
    return search, belief


@pytest.mark.parametrize("seed", range(4))
def test_both_hills_are_found_and_the_higher_one_is_told_from_the_lower(seed: int) -> None:
    search, belief = search_hills(seed, 14)
    best, *others = search.basins(belief)
    top = search.place(best[0])
    # Within 1 % of the height that can be had.
    assert search.height(top[None])[0] > search.height(np.array([[0.8, 0.75]]))[0] - 0.01
    assert any(np.max(np.abs(search.place(o[0]) - [0.25, 0.3])) < 0.2 for o in others)


@pytest.mark.parametrize("seed", range(3))
def test_parameters_that_do_nothing_do_no_harm(seed: int) -> None:
    """Two of them, one over hundredths of a unit and one over hundreds."""
    nothing = {"thickness": (0.0, 0.02), "link_length_1": (400.0, 900.0)}
    search, belief = search_hills(seed, 14, nothing)
    (top,), *_ = search.best(belief)
    assert search.height(top[None])[0] > search.height(np.array([[0.8, 0.75]]))[0] - 0.03
    lengths = belief.kernels[0].log_lengths
    assert min(lengths[2:]) > max(lengths[:2]) + 0.7  # twice as long at least


def test_a_search_ends_when_it_expects_no_gain() -> None:
    blank = Progress([[]], [[0.0]], [])

    def after(*gains: float) -> Progress:
        return replace(blank, state=[{"gain": gain} for gain in (math.inf, *gains)])

    assert not calm(blank, 0.001)
    assert not calm(after(0.1, 0.0005, 0.0005), 0.001)
    assert calm(after(0.1, 0.0005, 0.0005, 0.0004), 0.001)
    assert not calm(after(0.0005, 0.0005, 0.002), 0.001)


def test_the_same_seed_finds_the_same_and_a_search_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    surrogate, path = Surrogate(TASK, trials=40), tmp_path / "state.json"
    whole = pcjax.optimize(surrogate, TIPS, FEW)
    assert whole.progress.iteration == 3
    tried = Search.try_out

    def interrupted(search: Search, at: np.ndarray, round: int) -> Any:
        if round == 1:
            raise KeyboardInterrupt
        return tried(search, at, round)

    with monkeypatch.context() as patch:
        patch.setattr(Search, "try_out", interrupted)
        part = pcjax.optimize(surrogate, TIPS, FEW, checkpoint=path)
    assert (part.interrupted, part.progress.iteration) == (True, 1)
    rest = pcjax.optimize(surrogate, TIPS, FEW, checkpoint=path)
    assert rest.progress.history == whole.progress.history
    np.testing.assert_array_equal(rest.best, whole.best)
    assert rest.trials == whole.trials
    kept = json.loads(path.read_text())
    kept["state"]["state"][0]["batch"]["at"] = [[0.0]]
    path.write_text(json.dumps(kept))
    with pytest.raises(ValueError, match="damaged"):
        pcjax.optimize(surrogate, TIPS, FEW, checkpoint=path)


def test_every_design_that_is_tried_is_allowed() -> None:
    own = design_space(
        pcjax.box_hand(),
        {"fingertip_angle_deg": (-30, 50), "fingertip_length": (25, 175), "gap_width": (100, 400)},
        50.0,
        limits=["fingertip_length + 0.5 gap_width <= 200"],
    )
    found = pcjax.optimize(Surrogate(TASK, trials=40), own, FEW)
    for kept in found.progress.state:
        at = np.array(kept["batch"]["at"])
        designs = own.low + at * (own.high - own.low)
        assert own.holding(TASK).which(designs).all()


# ------------------------------------------------------------------------------ several conditions


def several(**how: Any) -> Task:
    others = (replace(TASK, body=pcjax.Circle(15.0)), replace(TASK, body=pcjax.Square(50.0)))
    return replace(TASK, also=others, **how)


@pytest.mark.parametrize("weights", [(), (1.0, 2.0, 5.0)])
def test_the_mean_over_conditions_is_that_of_each(weights: tuple[float, ...]) -> None:
    """Designs, objects with and without an orientation: as if each were alone."""
    designs = [np.array([10.0, 100.0]), np.array([20.0, 60.0])]
    surrogate = Surrogate(several(weights=weights))
    together = compare(surrogate, TIPS, designs, trials=60, seed=1)
    alone = [compare(Surrogate(task), TIPS, designs, trials=60, seed=1) for task in several().each]
    shares = np.array(weights or (1, 1, 1)) / sum(weights or (1, 1, 1))
    expected = shares @ [one.logs for one in alone]
    np.testing.assert_allclose(together.logs, expected, rtol=1e-6)
    for k, one in enumerate(alone):
        part = together.of(k).scores[0]
        assert (part.value, part.low) == pytest.approx(
            (one.scores[0].value, one.scores[0].low), rel=1e-6
        )


def test_the_worst_condition_is_the_least_score() -> None:
    designs = [np.array([10.0, 100.0]), np.array([20.0, 60.0])]
    together = compare(Surrogate(several(worst=True)), TIPS, designs, trials=60, seed=1)
    alone = np.array([together.of(k).logs for k in range(3)])
    np.testing.assert_allclose(together.logs, alone.min(axis=0), rtol=1e-6)
    least = int(np.argmin(alone[:, 0]))
    assert together.covariance[0, 0] == pytest.approx(together.of(least).covariance[0, 0])


def test_the_worst_scores_intervals_know_of_all_conditions() -> None:
    """200 samples of two conditions that are alike, 50 exponential times each in either direction:
    the interval of the worst, 1, and of a gain of 0 hold what is true in 95 % and more (in fewer
    than 180 of 200: false alarm below 1e-3)."""
    task = replace(TASK, also=(replace(TASK, body=pcjax.Circle(15.0)),), worst=True)
    exact = Surrogate(task, form="exact", trials=50)
    rng = np.random.default_rng(6)
    held = gained = 0
    for _ in range(200):
        times = np.minimum(rng.exponential(8.0, (2, 4, 50)), 20.0)
        values = np.stack([times, (times == 20.0).astype(float)], axis=2)
        found = comparison_of(exact, Sample(values, np.ones(50, bool), 0))
        held += found.scores[0].low <= 1 <= found.scores[0].high
        gain = found.improvement(0, 1)
        gained += gain.low <= 0 <= gain.high
    assert held >= 180
    assert gained >= 180


def test_the_runs_of_a_traced_score_are_in_their_order() -> None:
    """On the arm both directions' drives differ in kind: DoEs and EoEn of two objects. A trial or
    two may have come apart by rounding, as other programs run them."""
    hand = pcjax.two_joint_hand()
    one = Task(pcjax.Circle(30.0), pcjax.PlanarArm(), ("does", "eoen"), 20_000)
    both = Surrogate(replace(one, also=(replace(one, body=pcjax.Circle(15.0)),)), trials=8)
    trials = jnp.arange(8, dtype=jnp.int32)

    def values(surrogate: Surrogate) -> np.ndarray:
        engine = surrogate.relaxed_engine(surrogate.task.scenarios(hand))
        return np.asarray(surrogate.traced_values(hand, engine, trials, jnp.uint32(0)))

    alone = [values(replace(both, task=task)) for task in both.task.each]
    wrong = np.abs(values(both)[:, 0] / np.concatenate(alone)[:, 0] - 1)
    assert (np.median(wrong, axis=1) < 1e-3).all()


def test_a_mean_of_logarithms_needs_every_one_of_them() -> None:
    """By index 2, with nothing held in one of two conditions."""
    task = replace(TASK, also=(replace(TASK, body=pcjax.Circle(15.0)),))
    means = np.array([[9.0, 0.4], [8.0, 0.2], [5.0, 0.0], [6.0, 0.1]])
    assert not Surrogate(task, "index2").known(means)
    assert Surrogate(replace(task, worst=True), "index2").known(means)


def test_the_hand_that_is_best_on_average_has_room_for_all() -> None:
    wide = replace(TASK, body=pcjax.Circle(60.0))
    space = TIPS.holding(replace(TASK, also=(wide,)))
    narrow = np.array([0.0, 100.0])
    assert [room[0] for room in space.rooms] == [25.0, 60.0]
    assert space.allowed(narrow)
    # 100 apart, a hand's sides leave no room for 60 at its starts.
    slim = replace(space, base=pcjax.box_hand(palm_length=130.0, gap_width=90.0))
    assert not slim.allowed(np.array([0.0, 25.0]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"also": (replace(TASK, max_steps=10_000),)}, "same max_steps"),
        ({"also": (replace(TASK, directions=("does",)),)}, "same directions"),
        ({"also": (replace(TASK, drive=pcjax.WristTilt(period=5.0)),)}, "same period"),
        ({"also": (replace(TASK, also=(TASK,)),)}, "others of its own"),
        ({"weights": (1.0, 2.0)}, "2 weights for 1"),
        ({"also": (TASK,), "weights": (1.0, 0.0)}, "weight is 0"),
        ({"also": (TASK,), "weights": (1.0, 1.0), "worst": True}, "worst one counts"),
    ],
)
def test_tasks_that_do_not_go_together_are_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(TASK, **change)


def test_a_map_is_of_one_condition() -> None:
    with pytest.raises(ValueError, match="one condition"):
        pcjax.score_map(Surrogate(several()), TIPS, (2, 2))


def test_the_limit_of_held_trials_is_the_tasks() -> None:
    """Means of seconds are at most the limit, in each condition: the bounds know it."""
    found = compare(Surrogate(several()), TIPS, [np.array([40.0, 84.0])], trials=20, seed=2)
    most = TASK.max_steps * PAPER_DT
    assert (found.sample.values[:, :, 0] <= most).all()
    assert found.scores[0].low < found.scores[0].value < found.scores[0].high
