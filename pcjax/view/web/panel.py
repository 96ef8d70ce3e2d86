"""Sliders with numbers beside them, for everything that can be turned."""

from __future__ import annotations

import math
from functools import partial

from nicegui import events, ui

from pcjax.study.spec import Study
from pcjax.view.web.desk import limits_of
from pcjax.view.web.dials import GROUPS, Dial, alike
from pcjax.view.web.studio import Studio


class Panel:
    """A row for each number, in groups."""

    def __init__(self, studio: Studio):
        self.studio = studio
        self._rows: dict[str, tuple[ui.slider, ui.number]] = {}
        self._shown: dict[str, float] = {}
        self._before: Study | None = None
        self._all = ui.element("div").classes("dials")
        self._build()
        studio.on_dials.append(self._build)
        studio.on_design.append(self._update)

    def _build(self) -> None:
        self._all.clear()
        self._rows, self._shown = {}, {}
        dials = self.studio.desk.dials()
        with self._all:
            self._switches()
            for group, title in GROUPS.items():
                mine = [dial for dial in dials if dial.group == group]
                if mine:
                    with ui.expansion(title, value=group in ("hand", "body")).classes("group"):
                        for dial in mine:
                            self._row(dial)
            self._limits()

    def _switches(self) -> None:
        desk = self.studio.desk
        both = ui.switch("both fingers together", value=desk.mirrored)
        both.props["data-testid"] = "mirrored"
        both.set_enabled(alike(desk.study.hand))
        both.on_value_change(self._mirror)

    def _limits(self) -> None:
        desk = self.studio.desk
        with ui.expansion("Limits").classes("group"):
            with ui.element("div").classes("line"):
                ui.label("clearance [palm lengths]")
                least = ui.number(value=desk.clearance, min=0.0, max=1.0, step=0.01)
                least.props["aria-label"] = "clearance in palm lengths"
                least.on_value_change(self._clear)
            words = "linear limits, a line each, such as fingertip_length + 0.5 gap_width <= 200"
            limits = ui.textarea(words, value="\n".join(desk.limits)).props("dense autogrow")
            limits.props["data-testid"] = "limits"
            limits.on("blur", lambda: self._limit(str(limits.value or "")))

    def _row(self, dial: Dial) -> None:
        with ui.element("div").classes("line"):
            ui.label(dial.text)
            value = _within(dial)
            slider = ui.slider(min=dial.low, max=dial.high, step=dial.step, value=value)
            slider.props["aria-label"] = dial.text
            slider.props["data-testid"] = f"slider-{dial.label}"
            number = ui.number(value=_short(dial.value), step=dial.step, format="%.6g")
            number.props["aria-label"] = dial.text
            number.props["data-testid"] = f"number-{dial.label}"
            number.props("dense")
        # What comes last comes with the drop.
        slider.on(
            "update:model-value",
            partial(self._slide, dial.label),
            throttle=0.04,
            trailing_events=False,
        )
        slider.on("change", partial(self._drop, dial.label))
        number.on("change", partial(self._type, dial.label))
        self._rows[dial.label] = slider, number
        self._shown[dial.label] = dial.value

    def _update(self, moving: bool) -> None:
        """The numbers as they are now."""
        dials = self.studio.desk.dials()
        if {dial.label for dial in dials} != set(self._rows):
            self._build()
            return
        for dial in dials:
            old = self._shown[dial.label]
            if old == dial.value or (math.isnan(old) and math.isnan(dial.value)):
                continue
            self._shown[dial.label] = dial.value
            slider, number = self._rows[dial.label]
            if not slider.props["min"] <= _within(dial) <= slider.props["max"]:
                slider.props.update({"min": dial.low, "max": dial.high, "step": dial.step})
            slider.value = _within(dial)
            number.value = _short(dial.value)

    def _slide(self, label: str, event: events.GenericEventArguments) -> None:
        if event.args is None:
            return
        if self._before is None:
            self._before = self.studio.desk.study
            self.studio.held = True
        self._shown[label] = math.nan  # what the slider shows is the browser's
        self.studio.turn(label, float(event.args), moving=True)

    def _drop(self, label: str, event: events.GenericEventArguments) -> None:
        studio, before = self.studio, self._before
        self._before, studio.held = None, False
        why = studio.turn(label, float(event.args), before=before)
        if why and before is not None:  # as far as it could be dragged
            studio.take(studio.desk.study, before=before)
        self._say(label, why)

    def _type(self, label: str) -> None:
        value = self._rows[label][1].value
        # An emptied field is none, where there may be none.
        self._say(label, self.studio.turn(label, None if value is None else float(value)))

    def _say(self, label: str, why: str) -> None:
        if why:
            self.studio.refused(f"{label}: {why}")
            self._shown[label] = math.inf  # whatever stands there now
            self._update(False)

    def _mirror(self, event: events.ValueChangeEventArguments) -> None:
        self.studio.desk.mirrored = bool(event.value)
        for told in self.studio.on_dials:
            told()

    def _limit(self, text: str) -> None:
        studio = self.studio
        limits = [line.strip() for line in text.splitlines() if line.strip()]
        try:
            limits_of(studio.desk.study.hand, limits)
        except ValueError as error:
            studio.refused(str(error))
            return
        if limits != studio.desk.limits:
            studio.desk.limits = limits
            studio.tell()

    def _clear(self, event: events.ValueChangeEventArguments) -> None:
        if event.value is not None and 0 <= event.value <= 1:
            self.studio.desk.clearance = float(event.value)
            self.studio.tell()


def _within(dial: Dial) -> float:
    value = 0.0 if math.isnan(dial.value) else dial.value
    return min(max(value, dial.low), dial.high)


def _short(value: float) -> float | None:
    return None if math.isnan(value) else float(f"{value:.6g}")
