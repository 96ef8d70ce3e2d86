"""Comparing hands on the same trials, and looking at them before trials are spent."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import pcjax
from pcjax.cli import main
from pcjax.quality.indices import ratio, ratio_difference
from pcjax.study.compare import names_of

pytestmark = pytest.mark.usefixtures("quick_programs")

RUN = pcjax.Run(trials=200, max_steps=30_000, seed=3)


def study(angle_deg: float, radius: float = 25.0, run: pcjax.Run = RUN) -> pcjax.Study:
    return pcjax.Study(pcjax.box_hand(math.radians(angle_deg)), pcjax.Circle(radius), run=run)


def test_the_difference_of_ratios_is_theirs_and_its_error_that_of_a_bootstrap() -> None:
    """400 samples of 300 trials: the scatter's error is 3.5 %, four of them are 14 %."""
    rng = np.random.default_rng(0)

    def draw(count: int) -> tuple[np.ndarray, np.ndarray]:
        shared = rng.gamma(2.0, 1.0, count)
        four = [np.minimum(k * shared * rng.gamma(4.0, 0.25, count), 9.0) for k in (3, 2, 2.5, 2.2)]
        return np.stack(four[:2]), np.stack(four[2:])

    pool = draw(400_000)
    truth = ratio(*pool[0], 9.0).value - ratio(*pool[1], 9.0).value
    found = [ratio_difference(*draw(300), 9.0) for _ in range(400)]
    values = np.array([one.value for one in found])
    assert np.mean(values) == pytest.approx(truth, abs=4 * np.std(values) / 20)
    assert np.std(values) == pytest.approx(np.mean([one.se for one in found]), rel=0.14)
    # 95 % at least, from 400: 4.6 standard errors of a share of 0.95.
    assert np.mean([one.low <= truth <= one.high for one in found]) > 0.90
    same = ratio_difference(pool[0], pool[0], 9.0)
    assert same.value == 0.0
    assert same.se == pytest.approx(0.0, abs=1e-9)


def test_a_ranking_is_by_score_and_paired() -> None:
    hands = {"flared": study(-20), "tapered": study(20), "again": study(20)}
    ranking = pcjax.compare(hands)
    assert ranking.by == "score"
    assert ranking.names[-1] == "flared"
    alone = pcjax.evaluate(
        hands["flared"].hand, pcjax.Circle(25.0), trials=200, max_steps=30_000, seed=3
    )
    assert ranking.value("flared") == alone.score()["index1"]
    best = ranking.names[0]
    off = ranking.difference("flared", best)
    assert off.value == pytest.approx(ranking.value("flared").value - ranking.value(best).value)
    assert off.se < math.hypot(ranking.value("flared").se, ranking.value(best).se)
    assert ranking.difference("again", "tapered").value == 0.0
    assert ranking.verdict("again", "tapered") == "not certain"
    assert max(map(len, repr(ranking).splitlines()[:4])) <= 100


def test_settings_are_the_first_ones_and_a_hand_without_eoen_is_ranked_by_does() -> None:
    single = pcjax.HandDesign(500.0, ((500.0,), (500.0,)), ((1.4,), (1.4,)))
    other = pcjax.Study(single, pcjax.Circle(25.0), run=pcjax.Run(trials=7, seed=9))
    ranking = pcjax.compare({"box": study(20), "open": other})
    assert ranking.by == "does"
    assert [e.trials for e in ranking.evaluations.values()] == [200, 200]
    assert {int(e.dataset.attrs["seed"]) for e in ranking.evaluations.values()} == {3}
    with pytest.raises(ValueError, match="two hands or more"):
        pcjax.compare({"one": study(0)})
    with pytest.raises(ValueError, match=r"^far: .*does not fit"):
        pcjax.compare({"box": study(0), "far": study(0, radius=300.0)})


def test_inspection_says_gap_starts_and_what_would_be_refused() -> None:
    found = pcjax.inspect(study(30))
    does, eoen = found.views["does"], found.views["eoen"]
    # W_g - 2 L_g sin(theta_g)
    assert does.gap == pytest.approx(200 - 2 * 100 * 0.5)
    assert eoen.gap == pytest.approx(does.gap)
    assert does.starts == (((-225.0, 25.0), (-175.0, 75.0)), ((175.0, 25.0), (225.0, 75.0)))
    # From rest, s = g sin(30 deg) sqrt(2) t^2 / 2 along the diagonal pull.
    pull = 9.8 * math.sqrt(2.0) * 0.5
    reach = 500 + 500 + 150 + 100
    assert found.fall == pytest.approx(math.sqrt(2 * reach / pull))
    assert not found.doubts
    small = pcjax.Study(pcjax.box_hand(0.0), pcjax.Circle(25.0), pcjax.WristTilt(gravity=0.01))
    assert "same unit" in pcjax.inspect(small).doubts[0]
    huge = pcjax.inspect(study(0, radius=300.0))
    assert "does not fit" in huge.views["does"].problem
    assert huge.views["does"].gap is None
    assert not pcjax.inspect(study(0, radius=0.15)).doubts
    (doubt,) = pcjax.inspect(study(0, radius=0.1)).doubts
    assert "precision 64" in doubt


def test_the_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = []
    for name, angle in (("a", -20), ("b", 35)):
        paths.append(tmp_path / f"{name}.toml")
        paths[-1].write_text(study(angle).to_toml())
    a, b = map(str, paths)
    flags = ["--direction", "does", "--max-steps", "100000", "--plot", str(tmp_path / "c.png")]
    main(["compare", a, b, "--json", *flags])
    told = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in told["ranking"]] == ["b", "a"]
    assert told["ranking"][1]["verdict"] == "worse"
    assert (tmp_path / "c.png").stat().st_size > 10_000
    main(["inspect", a, "--json", "--plot", str(tmp_path / "i.png")])
    # Flared fingertips: between the joints it is narrowest, W_g.
    assert json.loads(capsys.readouterr().out)["gap"]["does"] == pytest.approx(200, rel=1e-6)
    assert (tmp_path / "i.png").stat().st_size > 10_000
    for words in (["compare", a], ["compare", a, a]):
        with pytest.raises(SystemExit) as end:
            main(words)
        assert end.value.code == 2
    assert len(capsys.readouterr().err.splitlines()) == 2
    assert names_of(["x/a.toml", "y/a.toml", "b.toml"]) == ["x/a.toml", "y/a.toml", "b.toml"]
