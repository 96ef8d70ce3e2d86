"""Pictures of hands in three dimensions."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.model.spatial.hand import SpatialHand
from pcjax.model.spatial.scenario import SpatialScenario
from pcjax.results.evaluation import Evaluation
from pcjax.results.schema import NAMES
from pcjax.study.looking import SpatialInspection
from pcjax.study.read import study_of
from pcjax.study.spec import Study
from pcjax.view.picture import Picture
from pcjax.view.rendering import Part, Stage, parts_met, parts_seen
from pcjax.words import InputWarning, one_line

_MOST_COLUMNS = 4


def draw_hand(
    axis: Axes,
    scenario: SpatialScenario,
    *,
    state: Float[np.ndarray, "7"] | None = None,
    angles: Float[np.ndarray, "2"] | None = None,
    parts: Sequence[Part] | None = None,
    azimuth: float | None = None,
    title: str = "",
) -> float:
    """The hand in its posture with the object in it, rendered; the arrow is gravity. Returns where
    the camera is, degrees, for other hands to be seen from there as well.

    Arguments:
        axis: where.
        scenario: the condition.
        state: the object's place, m, and unit quaternion in the hand's frame; in the middle of its
            starts unless given.
        angles: the hand's tilt T1 and T2, radians; 0 unless given.
        parts, azimuth: see `Stage`.
        title: of the axis.

    Raises:
        ValueError: nothing can be rendered here.
    """
    with Stage(scenario, parts, azimuth=azimuth) as stage:
        axis.imshow(stage.picture(state, angles))
        axis.set_axis_off()
        axis.set_title(title, fontsize=10)
        return stage.azimuth


def plot_postures(studies: Mapping[str, Study]) -> Figure:
    """Hands side by side, each with its object at its start, seen from the same side.

    Arguments:
        studies: of hands in three dimensions, by what is written above each.

    Raises:
        ValueError: nothing can be rendered here.
    """
    columns = min(len(studies), _MOST_COLUMNS)
    rows = -(-len(studies) // columns)
    figure = Picture(figsize=(4.4 * columns, 3.7 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(studies) :]:
        axis.set_axis_off()
    azimuth = None
    for axis, (name, study) in zip(axes, studies.items(), strict=False):
        azimuth = draw_hand(axis, _bare(study), azimuth=azimuth, title=name)
    return figure


def plot_inspection(found: SpatialInspection) -> Figure:
    """The hand as its file draws it, and, where that is something else, what of it the object
    meets, in each direction that it has."""
    scenario = _bare(found.study)
    panels = {"the hand at rest": partial(draw_hand, scenario=scenario)}
    directions = [d for d, view in found.views.items() if not view.problem]
    if not _drawn_as_met(found.study.hand):
        directions = directions or ["does"]
    elif directions[:1] == ["does"]:
        directions = directions[1:]
    for direction in directions:
        seen = scenario if direction == "does" else _bare(found.study, mirrored=True)
        words = f"{NAMES[direction]}: what the object meets"
        panels[words] = partial(draw_hand, scenario=seen, parts=parts_met(seen))
    figure = Picture(figsize=(4.8 * len(panels), 4.0), layout="constrained")
    for axis, (title, draw) in zip(
        figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True
    ):
        draw(axis, title=title)
    return figure


def hands_of(evaluation: Evaluation) -> dict[str, Callable[[Axes], Any]]:
    """See `pcjax.results.schema.Kind`: of a hand in three dimensions whose file is still there as
    it was.

    Warns (`InputWarning`) where it is not.
    """
    attrs, directions = evaluation.attrs, evaluation.directions
    try:
        study = study_of(attrs.get("study", ""))
        scenarios = {d: _bare(study, mirrored=d == "eoen") for d in directions}
        hand: Any = study.hand
        if hand.digest != attrs["hand_digest"]:
            raise ValueError(f"{hand.file} is not as it was, or MuJoCo is of another version")
    except ValueError as error:
        message = f"the hand is not drawn: {one_line(error)}"
        warnings.warn(message, InputWarning, stacklevel=2)
        return {}
    return {
        d: partial(draw_hand, scenario=scenario, title=NAMES[d])
        for d, scenario in scenarios.items()
    }


def _bare(study: Study, *, mirrored: bool = False) -> SpatialScenario:
    return SpatialScenario(study.hand, study.body, study.drive, study.law, mirrored)  # pyright: ignore


def _drawn_as_met(hand: SpatialHand) -> bool:
    """Whether the file draws just what collides."""
    return all(part.met for part in parts_seen(hand))
