"""Things of the wrong kind, swapped or not made: one line says what is what it cannot be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import pcjax

pytestmark = pytest.mark.usefixtures("unchecked")

HAND, CIRCLE, WRIST = pcjax.box_hand(), pcjax.Circle(25.0), pcjax.WristTilt()


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda: pcjax.evaluate(HAND, 25), "body is 25: it has to be a Body"),
        (lambda: pcjax.evaluate("box"), "hand is 'box': it has to be a HandDesign"),
        (lambda: pcjax.evaluate(CIRCLE, HAND), "hand is a Circle: it has to be a HandDesign"),
        (
            lambda: pcjax.evaluate(HAND, drive=pcjax.WristTilt),
            "drive is the class WristTilt: it has to be a Drive",
        ),
        (lambda: pcjax.Study(HAND, WRIST, CIRCLE), "body is a WristTilt: it has to be a Body"),
        (
            lambda: pcjax.Task(HAND, WRIST, ("does",), 20_000),
            "body is a HandDesign: it has to be a Body",
        ),
        (
            lambda: pcjax.score_map(HAND, HAND),
            "surrogate is a HandDesign: it has to be a Surrogate",
        ),
        (
            lambda: pcjax.optimize(HAND, CIRCLE),
            "surrogate is a HandDesign: it has to be a Surrogate",
        ),
    ],
)
def test_the_wrong_kind_is_refused(wrong: Callable[[], Any], told: str) -> None:
    with pytest.raises(TypeError, match=told):
        wrong()


@pytest.mark.parametrize("directions", ["does", ("eoen",), (), ("does", "up"), ["does"]])
def test_a_task_has_does_or_both_directions(directions: Any) -> None:
    with pytest.raises(ValueError, match=r"it has to be one of \('does',\), \('does', 'eoen'\)"):
        pcjax.Task(CIRCLE, WRIST, directions, 20_000)
