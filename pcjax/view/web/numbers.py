"""The indices and the score as they come in, and how a pinned design compares."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from nicegui import ui

from pcjax.physics.state import PAPER_DT
from pcjax.quality.indices import Estimate
from pcjax.results.evaluation import Evaluation
from pcjax.results.schema import NAMES
from pcjax.view.shapes import COLOURS
from pcjax.view.web.studio import Against, Look, Studio

Z95 = 1.96

_POINTS = 120
"""Of a survival curve."""


class Numbers:
    """The table and the verdict."""

    def __init__(self, studio: Studio):
        self.studio = studio
        with ui.element("section").classes("card numbers") as self._card:
            with ui.element("div").classes("head"):
                self._big = _told("score", "big")
                self._about = _told("about", "quiet")
            self._cells: dict[tuple[str, str], ui.label] = {}
            with ui.element("div").classes("figures"):
                for head in ("", "index 1", "index 2"):
                    ui.label(head).classes("quiet")
                for direction, name in NAMES.items():
                    ui.label(f"{name} [steps]").tooltip("index 1 in the paper's steps of 0.001 s")
                    for index in ("index1", "index2"):
                        self._cells[direction, index] = _told(f"{index}-{direction}", "")
                ui.label("score")
                for index in ("index1", "index2"):
                    self._cells["score", index] = _told(f"score-{index}", "")
            self._problem = _told("problem", "problem")
            self._against = _told("against", "against")
            self._notes = _told("notes", "quiet")
        studio.on_opened.append(self._clear)
        studio.on_design.append(self._on_design)
        studio.on_look.append(self._on_look)
        self._on_design(False)

    def _on_design(self, moving: bool) -> None:
        desk = self.studio.desk
        problem = self.studio.problem
        self._problem.set_text(problem or self.studio.doubt)
        self._problem.set_visibility(bool(self._problem.text))
        self._against.set_visibility(desk.pinned is not None)
        # Until the first look the numbers are those of another design.
        self._card.classes(add="stale")
        if problem:
            self._clear("no score", "")
            self._card.classes(remove="stale")

    def _clear(self, score: str = "…", about: str = "another kind of study takes seconds") -> None:
        self._big.set_text(score)
        self._about.set_text(about)
        self._against.set_text("")
        self._notes.set_text("")
        for cell in self._cells.values():
            cell.set_text("—")

    def _on_look(self, look: Look) -> None:
        found = look.found
        if look.study is self.studio.desk.study:
            self._card.classes(remove="stale")
        both = len(found.directions) == 2
        score = found.score() if both else {}
        for (direction, index), cell in self._cells.items():
            if direction == "score":
                one = score.get(index)
            else:
                one = found.indices(direction)[index] if direction in found.directions else None
            form = ",.0f" if index == "index1" and direction != "score" else ".3f"
            cell.set_text("—" if one is None else with_interval(one, form))
        main = found.main
        what = "score" if both else NAMES[found.directions[0]]
        self._big.set_text(f"{what} {with_interval(main, '.3f' if both else ',.0f')}")
        self._about.set_text(f"{found.trials:,} trials a direction, {1000 * look.seconds:.0f} ms")
        invalid = sum(found.status(d)["invalid"] for d in found.directions)
        if invalid:
            self._about.set_text(f"{self._about.text}; {invalid} went wrong")
        self._tell_against(look.against)
        self._notes.set_text("; ".join(found.notes()))
        self._notes.set_visibility(bool(self._notes.text))

    def _tell_against(self, against: Against | None) -> None:
        if self.studio.desk.pinned is None:
            return
        if against is None or math.isnan(against.gain.value):
            self._against.set_text("against the pinned design: not to be compared")
            return
        what, form = "", "+.3f"
        if against.what != "score":
            what, form = f"{NAMES[against.what]} ", "+,.0f"
        text = with_interval(against.gain, form)
        self._against.set_text(f"against the pinned design {what}{text}: {against.verdict}")


class Curves:
    """The survival curves of both directions."""

    def __init__(self, studio: Studio):
        with ui.element("section").classes("card survival") as self._card:
            self._chart = ui.echart(_curves()).classes("curves")
            self._chart.props["data-testid"] = "survival"
        self._studio = studio
        studio.on_look.append(self._on_look)
        studio.on_design.append(self._on_design)
        studio.on_opened.append(self._clear)

    def _on_design(self, moving: bool) -> None:
        self._card.classes(add="stale")
        if self._studio.problem:
            self._clear()

    def _clear(self) -> None:
        for one in self._chart.options["series"]:
            one["data"] = []
        self._chart.update()

    def _on_look(self, look: Look) -> None:
        found, options = look.found, self._chart.options
        if look.study is self._studio.desk.study:
            self._card.classes(remove="stale")
        for k, direction in enumerate(NAMES):
            lines = _lines(found, direction) if direction in found.directions else [[], [], []]
            for j, line in enumerate(lines):
                options["series"][3 * k + j]["data"] = line
        options["xAxis"]["max"] = found.max_steps * PAPER_DT
        self._chart.update()


def with_interval(one: Estimate, form: str) -> str:
    """Value and 95 % interval."""
    if math.isnan(one.value):
        return "undefined"
    return f"{one.value:{form}} [{one.low:{form}}, {one.high:{form}}]"


def _told(name: str, classes: str) -> ui.label:
    label = ui.label("").classes(classes)
    label.props["data-testid"] = name
    if name in ("score", "problem", "against"):
        label.props["aria-live"] = "polite"
    return label


def _lines(found: Evaluation, direction: str) -> list[list[list[float]]]:
    """The curve, its band's lower edge, and how wide the band is."""
    steps, left = found.survival(direction)
    times = np.linspace(0.0, found.max_steps, _POINTS)
    share = left[np.searchsorted(steps, times, side="right") - 1]
    reach = Z95 * np.sqrt(share * (1 - share) / found.trials)
    low, high = np.maximum(share - reach, 0.0), np.minimum(share + reach, 1.0)
    seconds = times * PAPER_DT
    return [
        np.round(np.stack([seconds, values], axis=1), 4).tolist()
        for values in (share, low, high - low)
    ]


def _curves() -> dict[str, Any]:
    series: list[dict[str, Any]] = []
    for direction, colour in zip(NAMES, COLOURS, strict=False):
        series += band_series(colour, NAMES[direction], symbol="none")
    whole = {"min": 0, "max": 1}
    return axes("time [s]", "share still held", series, list(NAMES.values()), yAxis=whole)


def band_series(colour: str, name: str, symbol: str = "circle") -> list[dict[str, Any]]:
    """A line with a band: its values, its lower edge, and how wide the band is."""
    base: dict[str, Any] = {"type": "line", "animation": False, "data": [], "symbolSize": 7}
    hidden = {
        "lineStyle": {"opacity": 0},
        "symbol": "none",
        "silent": True,
        "tooltip": {"show": False},
        "stack": name,
    }
    return [
        base | {"name": name, "color": colour, "symbol": symbol},
        base | hidden,
        base | hidden | {"areaStyle": {"color": colour, "opacity": 0.2}},
    ]


def axes(
    x: str, y: str, series: list[dict[str, Any]], legend: list[str], **more: dict[str, Any]
) -> dict[str, Any]:
    """A chart's options: colours that can be read on a light page and on a dark one."""
    grey = "#8a8a8a"
    axis = {
        "type": "value",
        "nameTextStyle": {"color": grey},
        "axisLabel": {"color": grey, "hideOverlap": True},
        "axisLine": {"lineStyle": {"color": grey}},
        "splitLine": {"lineStyle": {"color": grey, "opacity": 0.25}},
    }
    across = {"name": x, "nameLocation": "middle", "nameGap": 26}
    up = {"name": y, "nameLocation": "middle", "nameGap": 42, "nameRotate": 90, "scale": True}
    return {
        "animation": False,
        "grid": {"left": 60, "right": 16, "top": 28, "bottom": 44},
        "legend": {"data": legend, "textStyle": {"color": grey}, "top": 0},
        "tooltip": {"trigger": "axis"},
        "xAxis": axis | across | more.get("xAxis", {}),
        "yAxis": axis | up | more.get("yAxis", {}),
        "series": series,
    }
