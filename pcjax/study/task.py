"""What a study's hand has to be good at, for a search."""

from __future__ import annotations

from dataclasses import replace

from pcjax.quality.task import Task
from pcjax.study.spec import Study


def task_of(study: Study) -> Task:
    """What the study's hand has to be good at.

    Raises:
        ValueError: EoEn alone, which the best hand would be none at all for.
    """
    if study.directions == ("eoen",):
        raise ValueError("the score or DoEs can be looked at, EoEn alone makes no better hand")
    first, *others = (
        one.task_kind(
            one.body,
            one.drive,
            study.directions,
            study.max_steps,
            one.law,
            one.run.start_spread,
            study.units,
        )
        for one in study.objective_studies()
    )
    objective = study.objective
    return replace(first, also=tuple(others), weights=objective.weights, worst=objective.worst)
