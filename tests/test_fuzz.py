"""Random hands through both engines: a small share of what `experiments/fuzz.py` does."""

from __future__ import annotations

import numpy as np

from experiments import fuzz


def test_both_engines_agree_on_random_hands_and_nothing_goes_wrong() -> None:
    """20 hands of two limbs a finger, 64 trials each by two engines in two precisions. |z| < 3.5 is
    a false alarm once in 2,000 of the 60 comparisons, so once in 36 choices of hands."""
    cases = [case for case in fuzz.random_cases(30, 4, ((2, 2),)) if case.dt == fuzz.STEPS[0]][:20]
    assert len({case.shape for case in cases}) > 4
    verdicts = fuzz.judge(cases, trials=64, max_steps=20_000)
    for case, verdict in zip(cases, verdicts, strict=True):
        assert verdict.sane, fuzz.row_of(case, verdict)
    assert np.mean([verdict.same for verdict in verdicts]) > 0.5
    assert sum(verdict.index1 < 19_000 for verdict in verdicts) > 8  # many do escape
