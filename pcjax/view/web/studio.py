"""What happens on one page: the design changes, and its numbers follow."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from nicegui import background_tasks

from pcjax.model.bodies.base import Body
from pcjax.model.hand import HandDesign
from pcjax.quality.indices import Estimate
from pcjax.results.evaluation import Evaluation
from pcjax.study.evaluate import Experiment
from pcjax.study.spec import Study
from pcjax.view.web.desk import Desk, doubt_of, problem_of
from pcjax.view.web.dials import turned

MOVING = (200,)
"""Trials while something is dragged."""

AT_REST = (200, 1000, 2000, 3000, 4000, 5000)
"""Looks at a design that rests: the last but the second ones are refined in the background, in
parts, so that the next move does not have to wait."""


@dataclass(frozen=True)
class Look:
    """What is known of the design.

    Attributes:
        study: of what.
        found: of so many trials.
        against: how it compares with the pinned design on the same trials, if there is one.
        seconds: since the design changed.
    """

    study: Study
    found: Evaluation
    against: Estimate | None
    seconds: float


class Studio:
    """A design, and its numbers as they come in.

    Arguments:
        desk: the design.
        folder: where files may be read and written.
        keep: told what to keep for when the page is loaded again.
    """

    def __init__(self, desk: Desk, folder: Path, keep: Callable[[Desk], None]):
        self.desk, self.folder, self._keep = desk, folder, keep
        self.on_design: list[Callable[[bool], None]] = []
        """Called when the design has changed; whether it is still moving."""
        self.on_look: list[Callable[[Look], None]] = []
        self.on_opened: list[Callable[[], None]] = []
        """Called when it is another study altogether, or other numbers can be turned."""
        self.on_named: list[Callable[[], None]] = []
        self.last: Look | None = None
        self.problem = self.doubt = ""
        """Why the design cannot be evaluated, or breaks a limit."""
        self._check()
        self.closed = False
        self._turn, self._moving, self._changed = 0, False, 0.0
        self._task: asyncio.Task[None] | None = None
        self._pinned: dict[int, Evaluation] = {}

    # ------------------------------------------------------------------ the design

    def take(self, study: Study, *, before: Study | None = None, moving: bool = False) -> None:
        """Another design; `before` is what undo goes back to, unless given the present one. What is
        still moving cannot be undone."""
        if moving:
            self.desk.study = study
        else:
            self.desk.change(study, before)
        self.tell(moving=moving)

    def bend(self, hand: HandDesign, *, before: Study | None = None, moving: bool = False) -> None:
        """`take`, of another hand."""
        self.take(replace(self.desk.study, hand=hand), before=before, moving=moving)

    def resize(self, body: Body, *, before: Study | None = None, moving: bool = False) -> None:
        """`take`, of another object."""
        self.take(replace(self.desk.study, body=body), before=before, moving=moving)

    def turn(
        self, label: str, value: float, *, before: Study | None = None, moving: bool = False
    ) -> str:
        """`take`, with another number; says why it cannot be, else ""."""
        try:
            study = turned(self.desk.study, label, value)
        except ValueError as error:
            return str(error)
        self.take(study, before=before, moving=moving)
        return ""

    def undo(self) -> None:
        self.desk.undo()
        self.tell()

    def redo(self) -> None:
        self.desk.redo()
        self.tell()

    def reset(self) -> None:
        self.desk.reset()
        self.tell()

    def open(self, study: Study, name: str) -> None:
        """Another study in place of this one."""
        self.desk = Desk.of(study, name)
        self._pinned = {}
        self._check()
        self.rename(name)
        self.renew()

    def rename(self, name: str) -> None:
        """The design is in another file."""
        self.desk.name = name
        self._keep(self.desk)
        for told in self.on_named:
            told()

    def renew(self) -> None:
        """Tells that other numbers can be turned."""
        for told in self.on_opened:
            told()
        self.tell()

    def _check(self) -> None:
        study = self.desk.study
        self.problem = problem_of(study)
        self.doubt = "" if self.problem else doubt_of(study, self.desk.clearance, self.desk.limits)

    def tell(self, *, moving: bool = False) -> None:
        """Tells everybody of the design, and begins to follow it."""
        self._check()
        if not moving:
            self._keep(self.desk)
        for told in self.on_design:
            told(moving)
        self._follow(moving=moving)

    # ------------------------------------------------------------------ its numbers

    def pin(self) -> None:
        """Compares what follows with the present design; a second time: no more."""
        desk = self.desk
        desk.pinned = None if desk.pinned is desk.study else desk.study
        self._pinned = {}
        self.tell()

    def _follow(self, *, moving: bool) -> None:
        self._turn, self._moving, self._changed = self._turn + 1, moving, time.perf_counter()
        if self._task is None or self._task.done():
            self._task = background_tasks.create(self._look())

    async def _look(self) -> None:
        """Looks at the newest design, again and again until nothing is left to be seen."""
        done = 0
        while done != self._turn and not self.closed:
            done, began = self._turn, self._changed
            study, looks = self.desk.study, MOVING if self._moving else AT_REST
            if self.problem:
                continue
            try:
                experiment = await asyncio.to_thread(Experiment, study)
                for trials in looks:
                    found = await asyncio.to_thread(experiment.go_on, trials)
                    against = await self._against(found, trials)
                    # A first look is shown even if the design has moved on: the next is on its way.
                    if self.closed or self.problem:
                        break
                    self.last = Look(study, found, against, time.perf_counter() - began)
                    for told in self.on_look:
                        told(self.last)
                    if done != self._turn:
                        break
            except ValueError as error:  # an engine that cannot run it, say
                self.refused(str(error))

    def refused(self, why: str) -> None:
        """What could not be done; a page shows it."""

    async def _against(self, found: Evaluation, trials: int) -> Estimate | None:
        """How the design compares with the pinned one, on the same trials."""
        pinned = self.desk.pinned
        if pinned is None:
            return None
        if trials not in self._pinned:
            with suppress(ValueError):  # it was evaluated when it was pinned
                experiment = await asyncio.to_thread(Experiment, pinned)
                self._pinned = {n: await asyncio.to_thread(experiment.go_on, n) for n in AT_REST}
        theirs = self._pinned.get(trials)
        if theirs is None:
            return None
        both = len(found.directions) == 2 == len(theirs.directions)
        with suppress(ValueError):  # of another seed or limit
            return found.difference(theirs, "score" if both else "does")["index1"]
        return None
