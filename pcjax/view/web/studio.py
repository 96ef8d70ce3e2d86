"""What happens on one page: the design changes, and its numbers follow."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from nicegui import background_tasks

from pcjax.quality.indices import Estimate
from pcjax.results.evaluation import Evaluation
from pcjax.study.evaluate import Experiment
from pcjax.study.spec import Study
from pcjax.view.web.desk import Desk, problem_of
from pcjax.view.web.dials import turned
from pcjax.view.web.files import EXPORTS
from pcjax.view.web.looks import AT_REST, MOVING, experiment_of


@dataclass(frozen=True)
class Against:
    """How a design compares with the pinned one.

    Attributes:
        what: is compared, "score", "does" or "eoen".
        gain: by how much it is higher, by index 1.
    """

    what: str
    gain: Estimate

    @property
    def verdict(self) -> str:
        """By the 95 % interval; a low EoEn is the better one."""
        low, high = self.gain.low, self.gain.high
        if self.what == "eoen":
            low, high = -high, -low
        return "better" if low > 0 else "worse" if high < 0 else "not certain"


@dataclass(frozen=True)
class Look:
    """What is known of the design.

    Attributes:
        study: of what.
        found: of so many trials.
        against: the pinned design on the same trials, if there is one that can be compared.
        seconds: since the design changed.
    """

    study: Study
    found: Evaluation
    against: Against | None
    seconds: float


class _Pinned:
    """The pinned design, as often as it is looked at."""

    def __init__(self, study: Study):
        self.study = study
        self._experiment: Experiment | None = None
        self._found: dict[int, Evaluation] = {}

    async def found(self, trials: int) -> Evaluation | None:
        """What is known of it after so many trials; None if it has had more by now."""
        if trials not in self._found:
            if self._experiment is None:
                self._experiment = await asyncio.to_thread(experiment_of, self.study)
            if self._experiment.trials > trials:
                return None
            self._found[trials] = await asyncio.to_thread(self._experiment.go_on, trials)
        return self._found[trials]


class Studio:
    """A design, and its numbers as they come in.

    Arguments:
        desk: the design.
        folder: where files may be read and written.
        keep: told what to keep for when the page is loaded again.

    Attributes:
        desks: the kind of its desk.
        moving, at_rest: how many trials it looks at while something is dragged, and then.
        exports: what can be downloaded.
    """

    desks: ClassVar[type[Desk]] = Desk
    moving: ClassVar[tuple[int, ...]] = MOVING
    at_rest: ClassVar[tuple[int, ...]] = AT_REST
    exports: ClassVar[tuple[str, ...]] = tuple(EXPORTS)

    def __init__(self, desk: Desk, folder: Path, keep: Callable[[Desk], None]):
        self.desk, self.folder, self._keep = desk, folder, keep
        self.on_design: list[Callable[[bool], None]] = []
        """Called when the design has changed; whether it is still moving."""
        self.on_look: list[Callable[[Look], None]] = []
        self.on_opened: list[Callable[[], None]] = []
        """Called when it is another study altogether."""
        self.on_dials: list[Callable[[], None]] = []
        """Called when other numbers can be turned."""
        self.on_named: list[Callable[[], None]] = []
        self.last: Look | None = None
        self.problem = self.doubt = ""
        """Why the design cannot be evaluated, or breaks a limit."""
        self._check()
        self.closed = False
        self._turn, self._moving, self._changed = 0, False, 0.0
        self._task: asyncio.Task[None] | None = None
        self._pinned = None if desk.pinned is None else _Pinned(desk.pinned)
        self.held = False
        """Whether something is being dragged: nothing is undone then."""

    # ------------------------------------------------------------------ the design

    def take(
        self,
        study: Study,
        *,
        before: Study | None = None,
        moving: bool = False,
        further: bool = False,
    ) -> None:
        """Another design.

        Arguments:
            study: it.
            before, further: see `Desk.change`.
            moving: whether it is still being dragged; it cannot be undone then.
        """
        if moving:
            self.desk.study = study
        else:
            self.desk.change(study, before, further=further)
        self.tell(moving=moving)

    def turn(
        self, label: str, value: float | None, *, before: Study | None = None, moving: bool = False
    ) -> str:
        """`take`, with another number; says why it cannot be, else ""."""
        try:
            study = turned(self.desk.study, label, value)
        except ValueError as error:
            return str(error)
        self.take(study, before=before, moving=moving)
        return ""

    def undo(self) -> None:
        if not self.held:
            self.desk.undo()
            self.tell()

    def redo(self) -> None:
        if not self.held:
            self.desk.redo()
            self.tell()

    def reset(self) -> None:
        if not self.held:
            self.desk.reset()
            self.tell()

    def open(self, study: Study, name: str) -> None:
        """Another study in place of this one."""
        self.desk = self.desks.of(study, name)
        self._pinned = None
        self._check()
        self.rename(name)
        for told in (*self.on_opened, *self.on_dials):
            told()
        self.tell()

    def rename(self, name: str) -> None:
        """The design is in another file."""
        self.desk.name = name
        self._keep(self.desk)
        for told in self.on_named:
            told()

    def _check(self) -> None:
        self.problem = problem_of(self.desk.study)
        self.doubt = "" if self.problem else self.desk.doubt()

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
        self._pinned = None if desk.pinned is None else _Pinned(desk.pinned)
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
            study, looks = self.desk.study, self.moving if self._moving else self.at_rest
            if self.problem:
                continue
            try:
                experiment = await asyncio.to_thread(experiment_of, study)
                for trials in looks:
                    found = await asyncio.to_thread(experiment.go_on, trials)
                    if trials == self.at_rest[-1]:
                        found = await asyncio.to_thread(experiment.checked)
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
                if done == self._turn:
                    self.problem = str(error)
                    for drawn in self.on_design:
                        drawn(False)

    def refused(self, why: str) -> None:
        """What could not be done; a page shows it."""

    async def _against(self, found: Evaluation, trials: int) -> Against | None:
        """How the design compares with the pinned one, on the same trials."""
        if self._pinned is None:
            return None
        with suppress(ValueError):  # of another seed or limit
            theirs = await self._pinned.found(trials)
            if theirs is None:
                return None
            common = [d for d in found.directions if d in theirs.directions]
            if common:
                what = "score" if len(common) == 2 else common[0]
                return Against(what, found.difference(theirs, what)["index1"])
        return None
