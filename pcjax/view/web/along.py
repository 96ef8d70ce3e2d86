"""The score along one parameter, as a curve with a band; a click goes there."""

from __future__ import annotations

from asyncio import to_thread

import numpy as np
from nicegui import events, ui

from pcjax.results.schema import NAMES
from pcjax.study.spec import Study
from pcjax.view.shapes import COLOURS
from pcjax.view.web.dials import dials_of, turned
from pcjax.view.web.looks import experiment_of
from pcjax.view.web.numbers import axes, band_series
from pcjax.view.web.studio import Studio

_TRIALS = 400
"""Of each point and direction, the same for all."""

_USUAL = 25
"""Points of a curve."""


class Along:
    """A parameter, its range, and the curve."""

    def __init__(self, studio: Studio):
        self.studio = studio
        self._turn = 0
        self._of: Study | None = None
        self._swept: tuple[str, list[float]] = "", []
        """What the curve is along, and at which values."""
        with ui.element("div").classes("line many"):
            self._which = ui.select([], label="along").props("dense").classes("grow")
            self._which.props["data-testid"] = "along"
            self._low = ui.number("from").props("dense")
            self._high = ui.number("to").props("dense")
            self._go = ui.button("sweep", icon="show_chart", on_click=self.sweep)
            self._go.props("dense no-caps").props["data-testid"] = "sweep"
        self._told = ui.label("").classes("quiet")
        self._told.props["data-testid"] = "swept"
        options = axes("", "score", band_series(COLOURS[0], "score"), [])
        self._chart = ui.echart(options, on_point_click=self._click).classes("curves")
        self._chart.props["data-testid"] = "curve"
        self._chart.set_visibility(False)
        self._which.on_value_change(self._ask)
        self._renew()
        studio.on_dials.append(self._renew)
        studio.on_opened.append(self._clear)
        studio.on_design.append(lambda moving: self._age())

    def _clear(self) -> None:
        """The curve was of another study."""
        self._turn += 1
        self._told.set_text("")
        self._chart.set_visibility(False)

    def _age(self) -> None:
        """Says of a curve that it is of another design."""
        if self._of is not self.studio.desk.study:
            self._chart.classes(add="stale")

    def _renew(self) -> None:
        desk = self.studio.desk
        dials = dials_of(desk.study, mirrored=desk.mirrored)
        names = {dial.label: dial.text for dial in dials}
        tip = next((n for n in names if n.startswith("fingertip_angle")), next(iter(names)))
        self._which.set_options(names, value=tip)
        self._ask()

    def _ask(self) -> None:
        """The usual range of what was chosen."""
        desk = self.studio.desk
        for dial in dials_of(desk.study, mirrored=desk.mirrored):
            if dial.label == self._which.value:
                reach = 0.25 * (dial.high - dial.low)
                middle = 0.0 if np.isnan(dial.value) else dial.value
                self._low.value = float(f"{max(dial.low, middle - reach):.4g}")
                self._high.value = float(f"{min(dial.high, middle + reach):.4g}")

    async def sweep(self) -> None:
        """Point by point; where there is no hand, there is none. The next sweep ends this one."""
        self._turn += 1
        mine, label = self._turn, str(self._which.value)
        low, high = self._low.value, self._high.value
        if low is None or high is None or not low < high:
            self.studio.refused(f"{label}: it has to go from a lower number to a higher one")
            return
        study, series = self.studio.desk.study, self._chart.options["series"]
        self._of, self._swept = study, (label, [])
        self._chart.classes(remove="stale")
        for one in series:
            one["data"] = []
        self._chart.options["xAxis"]["name"] = self._which.options[label]  # pyright: ignore
        self._chart.set_visibility(True)
        missing = 0
        for x in (float(f"{value:.6g}") for value in np.linspace(low, high, _USUAL)):
            try:
                experiment = experiment_of(turned(study, label, x))
                found = await to_thread(experiment.go_on, _TRIALS)
            except ValueError:
                missing += 1
                continue
            if mine != self._turn or self.studio.closed:
                return
            main = found.main
            self._swept[1].append(x)
            # An undefined score is a gap in the curve.
            for one, y in zip(series, (main.value, main.low, main.high - main.low), strict=True):
                one["data"].append([x, None if np.isnan(y) else round(y, 4)])
            self._chart.options["yAxis"]["name"] = (
                "score"
                if len(found.directions) == 2
                else f"{NAMES[found.directions[0]]} [steps of 0.001 s]"
            )
            self._chart.update()
            self._told.set_text(f"{len(series[0]['data'])} points")
        no_hand = f"; {missing} of {_USUAL} values are no hand" if missing else ""
        self._told.set_text(
            f"{len(series[0]['data'])} points, {_TRIALS} trials a direction{no_hand}; a click on "
            "the curve goes there"
        )

    def _click(self, event: events.EChartPointClickEventArguments) -> None:
        label, values = self._swept
        if event.data_index < len(values):
            why = self.studio.turn(label, values[event.data_index])
            if why:
                self.studio.refused(why)
