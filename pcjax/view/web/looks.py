"""How the page looks at a design."""

from __future__ import annotations

from dataclasses import replace

from pcjax.study.evaluate import Experiment
from pcjax.study.spec import Study

MOVING = (200,)
"""Trials while something is dragged."""

AT_REST = (200, 1000, 2000, 3000, 4000, 5000)
"""Once it rests: at once, then better, in parts, so that the next move does not wait for long."""


def experiment_of(study: Study) -> Experiment:
    """The hand of a study, to be tried as often as the page likes, not as the study asks.

    Raises:
        ValueError: see `pcjax.evaluate`.
    """
    return Experiment(replace(study, run=replace(study.run, trials=None, precision_target=None)))
