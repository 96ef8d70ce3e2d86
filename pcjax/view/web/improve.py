"""A search for a better hand, watched as it goes; its result can be taken."""

from __future__ import annotations

import math
from asyncio import to_thread
from dataclasses import replace
from typing import Any

import numpy as np
from nicegui import ui

from pcjax.design.checkpoint import Progress
from pcjax.design.optimize import optimize
from pcjax.design.outcome import Optimum, Settings
from pcjax.design.parameters import Limit, parameter
from pcjax.design.space import DesignSpace, design_space
from pcjax.quality.surrogate import Surrogate
from pcjax.study.spec import Study
from pcjax.study.task import task_of
from pcjax.view.shapes import COLOURS
from pcjax.view.web.canvas import Canvas
from pcjax.view.web.desk import limits_of
from pcjax.view.web.dials import dials_of, parameters_of
from pcjax.view.web.numbers import Z95, axes, band_series, with_interval
from pcjax.view.web.studio import Studio

_ACCEPTED_ON = 5000
"""Unseen trials on which the result is compared with the start."""


class Improve:
    """What is free, the search's way, and its end."""

    def __init__(self, studio: Studio, canvas: Canvas):
        self.studio, self.canvas = studio, canvas
        self._steps: list[Progress] = []
        self._stopped = False
        self._space: DesignSpace | None = None
        self._of = studio.desk.opened
        self._result: tuple[Optimum, DesignSpace] | None = None
        self._bounds: dict[str, tuple[ui.number, ui.number]] = {}
        self._free = ui.select([], multiple=True, label="free parameters").props("dense use-chips")
        self._free.props["data-testid"] = "free"
        self._free.on_value_change(self._ask_bounds)
        self._ranges = ui.element("div").classes("ranges")
        with ui.element("div").classes("line many"):
            self._start = ui.button("optimise", icon="trending_up", on_click=self.search)
            self._start.props("dense no-caps").props["data-testid"] = "optimise"
            self._stop = ui.button("stop", on_click=self.stop).props("dense no-caps outline")
            self._take = ui.button("take the result", on_click=self.take).props("dense no-caps")
            self._take.props["data-testid"] = "take"
        self._told = ui.label("").classes("told")
        self._told.props["data-testid"] = "optimum"
        self._chart = ui.echart(_way()).classes("curves")
        self._timer = ui.timer(0.2, self._show, active=False)
        for part in (self._stop, self._take, self._chart):
            part.set_visibility(False)
        self._renew()
        studio.on_dials.append(self._renew)
        studio.on_opened.append(self._clear)

    def _clear(self) -> None:
        """What was found was of another study."""
        self._steps, self._result = [], None
        self._told.set_text("")
        for part in (self._take, self._chart):
            part.set_visibility(False)
        self.canvas.show_ghost(None)

    def _renew(self) -> None:
        """What may be free now; at first what makes the fingertips, or the last two angles."""
        study = self.studio.desk.study
        dials = [d for d in dials_of(study, mirrored=self.studio.desk.mirrored) if d.of_hand]
        names = {dial.label: dial.words for dial in dials}
        tips = [n for n in names if n.startswith(("fingertip_angle", "fingertip_length"))]
        usual = tips or [n for n in names if n.startswith("joint_angle")][:4]
        self._bounds = {}
        self._free.set_options(names, value=usual[:6])
        self._ask_bounds()

    def _ask_bounds(self) -> None:
        hand = self.studio.desk.study.hand
        typed = {label: (low.value, high.value) for label, (low, high) in self._bounds.items()}
        self._bounds = {}
        self._ranges.clear()
        with self._ranges:
            for label in self._free.value or []:
                one = parameter(label, hand)
                with ui.element("div").classes("line"):
                    ui.label(self._free.options[label])  # pyright: ignore
                    usual = float(f"{one.low:.4g}"), float(f"{one.high:.4g}")
                    low, high = (
                        ui.number(value=value).props("dense") for value in typed.get(label, usual)
                    )
                    low.props["aria-label"] = f"{label} from"
                    high.props["aria-label"] = f"{label} to"
                self._bounds[label] = low, high

    async def search(self) -> None:
        """Looks for a better hand until the search ends or is stopped."""
        studio, study = self.studio, self.studio.desk.study
        if studio.problem:
            studio.refused("this design cannot be evaluated, so no search can begin at it")
            return
        if not self._bounds:
            studio.refused("name at least one free parameter")
            return
        try:
            surrogate, space = self._task(study)
        except ValueError as error:
            studio.refused(str(error))
            return
        self._steps, self._stopped, self._result, self._space = [], False, None, space
        self._of = studio.desk.opened
        self._working(True)
        settings = Settings(accept_trials=_ACCEPTED_ON, seed=study.run.seed % 2**28)
        try:
            found = await to_thread(optimize, surrogate, space, settings, watch=self._watch)
        except ValueError as error:
            studio.refused(str(error))
            return
        finally:
            if not studio.closed:
                self._working(False)
        if self._over:
            return
        self._show()
        self._result = found, space
        gain = found.improvement
        verdict = "better" if found.better else "worse" if gain.high < 0 else "not certain"
        self._told.set_text(
            f"{space.describe(found.best)}: {with_interval(found.best_score, '.3f')}, "
            f"{with_interval(gain, '+.3f')} against the start on unseen trials: {verdict}"
        )
        self._take.set_visibility(True)

    def _task(self, study: Study) -> tuple[Surrogate, DesignSpace]:
        bounds: dict[str, tuple[float, float]] = {}
        for label, (low, high) in self._bounds.items():
            if low.value is None or high.value is None:
                raise ValueError(f"{label} needs a bound on either side")
            bounds[label] = low.value, high.value
        task, desk = task_of(study), self.studio.desk
        least = desk.clearance * float(study.hand.palm_length)
        width = max(float(one.body.width) for one in task.each)
        space = design_space(study.hand, bounds, width, least, (), study.directions)
        limits = tuple(_on_free(one, space) for one in limits_of(study.hand, desk.limits))
        return Surrogate(task), replace(space, limits=limits)

    def _watch(self, state: Progress) -> bool:
        self._steps.append(state)
        return self._stopped or self._over

    @property
    def _over(self) -> bool:
        """Whether nobody waits for the search any more."""
        return self.studio.closed or self.studio.desk.opened is not self._of

    def stop(self) -> None:
        """Ends the search after its round; the best so far is compared with the start."""
        self._stopped = True

    def take(self) -> None:
        """The result as the design."""
        if self._result is not None:
            found, space = self._result
            self.studio.take(replace(self.studio.desk.study, hand=space.hand(found.best)))

    def _working(self, working: bool) -> None:
        self._timer.active = working
        directions = self.studio.desk.study.directions
        what = "score" if len(directions) == 2 else "DoEs [steps of 0.001 s]"
        self._chart.options["yAxis"]["name"] = f"{what} of the best so far"
        if not working:
            self.canvas.show_ghost(None)
        self._start.set_enabled(not working)
        self._stop.set_visibility(working)
        if working:
            self._take.set_visibility(False)
            self._told.set_text("the first designs are tried")

    def _show(self) -> None:
        """The best so far, and how it came about."""
        if not self._steps:
            return
        way = self._steps[-1].history[0]
        logs = [(step.value, Z95 * step.value_se) for step in way]
        low = [math.exp(value - reach) for value, reach in logs]
        high = [math.exp(value + reach) for value, reach in logs]
        series = self._chart.options["series"]
        series[0]["data"] = [[k + 1, round(math.exp(v), 4)] for k, (v, _) in enumerate(logs)]
        series[1]["data"] = [[k + 1, round(v, 4)] for k, v in enumerate(low)]
        series[2]["data"] = [
            [k + 1, round(b - a, 4)] for k, (a, b) in enumerate(zip(low, high, strict=True))
        ]
        self._chart.set_visibility(True)
        self._chart.update()
        if self._timer.active and self._space is not None and not self._over:
            self.canvas.show_ghost(self._space.hand(way[-1].design))
            state = self._steps[-1]
            self._told.set_text(
                f"round {state.iteration}, {state.trials:,} trials: "
                f"{math.exp(logs[-1][0]):.3f} [{low[-1]:.3f}, {high[-1]:.3f}]"
            )


def _way() -> dict[str, Any]:
    return axes("round", "score of the best so far", band_series(COLOURS[0], "best so far"), [])


def _on_free(limit: Limit, space: DesignSpace) -> Limit:
    """A limit on a hand's parameters as one on the free ones; the others stay as they are."""
    coefficients, most = np.zeros(len(space.free)), limit.most
    labels = [one.label for one in space.free]
    for one, c in zip(parameters_of(space.base), limit.coefficients, strict=True):
        if one.label in labels:
            coefficients[labels.index(one.label)] = c
        elif c:
            most -= max(float(c) * float(value) for value in one.read_each(space.base))
    return Limit(limit.text, coefficients, most)
