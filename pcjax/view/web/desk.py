"""The design on the page: what it is, what it was, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pcjax.design.parameters import Limit, linear_limit
from pcjax.model.hand import HandDesign
from pcjax.study.spec import Study
from pcjax.units import with_unit
from pcjax.view.web.dials import Dial, dials_of, parameters_of

_KEPT = 200
"""Changes that can be undone."""


@dataclass
class Desk:
    """One person's design, and the ways back.

    Attributes:
        opened: the study as it was opened.
        study: as it is now.
        name: of the study's file, if it has one.
        undone: what `redo` goes to, the next last.
        done: what `undo` goes to, the next last.
        pinned: what the design is compared with.
        mirrored: whether both fingers move together.
        clearance: the least that the gap has to be wider than the object, in palm lengths.
        limits: linear ones as text (see `pcjax.design.parameters.linear_limit`).
    """

    opened: Study
    study: Study
    name: str = ""
    done: list[Study] = field(default_factory=list)
    undone: list[Study] = field(default_factory=list)
    pinned: Study | None = None
    mirrored: bool = True
    clearance: float = 0.04
    limits: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, study: Study, name: str = "") -> Desk:
        """A study that has just been opened."""
        lengths, angles = study.hand.lengths, study.hand.angles
        return cls(study, study, name, mirrored=lengths[0] == lengths[1] and angles[0] == angles[1])

    def doubt(self) -> str:
        """Why a design that can be evaluated breaks a limit; else ""."""
        return doubt_of(self.study, self.clearance, self.limits)

    def dials(self) -> list[Dial]:
        """What can be turned of the design."""
        return dials_of(self.study, mirrored=self.mirrored)

    def kept(self) -> dict[str, Any]:
        """All of it, for a page that is loaded again; lists of its own."""
        return {k: list(v) if isinstance(v, list) else v for k, v in vars(self).items()}

    @classmethod
    def again(cls, kept: Mapping[str, Any]) -> Desk:
        """From `kept`."""
        own: dict[str, Any] = {k: list(v) if isinstance(v, list) else v for k, v in kept.items()}
        return cls(**own)

    def change(self, study: Study, before: Study | None = None, *, further: bool = False) -> None:
        """Takes a new design.

        Arguments:
            study: it.
            before: what undo goes back to; unless given the present design.
            further: whether it goes on with the last change, so that both are undone at once.
        """
        before = self.study if before is None else before
        self.study = study
        if study is not before:
            self.done = self.done if further and self.done else [*self.done, before][-_KEPT:]
            self.undone = []

    def undo(self) -> None:
        """One change back."""
        if self.done:
            self.undone.append(self.study)
            self.study = self.done.pop()

    def redo(self) -> None:
        """One change on again."""
        if self.undone:
            self.done.append(self.study)
            self.study = self.undone.pop()

    def reset(self) -> None:
        """As it was opened."""
        self.change(self.opened)


def problem_of(study: Study) -> str:
    """Why a study cannot be evaluated; else ""."""
    try:
        for scenario in study.scenarios().values():
            scenario.check()
    except ValueError as error:
        return str(error)
    return ""


def limits_of(hand: HandDesign, texts: Sequence[str]) -> list[Limit]:
    """Linear limits on a hand's parameters, which all may be named.

    Raises:
        ValueError: one cannot be read.
    """
    return [linear_limit(text, parameters_of(hand)) for text in texts]


def doubt_of(study: Study, clearance: float, limits: Sequence[str] = ()) -> str:
    """Why a study that can be evaluated breaks a limit; else "".

    Arguments:
        study: what.
        clearance: the least that the gap has to be wider than the object, in palm lengths.
        limits: linear ones as text.
    """
    # Of both fingers, where they differ in what the limit has of both.
    each = [one.read_each(study.hand) for one in parameters_of(study.hand)]
    for limit in limits_of(study.hand, limits):
        used = sum(
            max(float(c) * float(value) for value in values)
            for c, values in zip(limit.coefficients, each, strict=True)
        )
        if used > limit.most + 1e-9 * abs(limit.most):
            return f"it breaks the limit {limit.text}"
    gap, width = float(study.hand.gap()), float(study.body.width)
    least = width + clearance * float(study.hand.palm_length)
    if gap >= least - 1e-6 * width:  # what a search allows, which ends on this edge
        return ""
    one, other, more = (with_unit(x, study.units) for x in (gap, width, least - width))
    return f"the gap is {one}, less than the object's {other} and a clearance of {more}"
