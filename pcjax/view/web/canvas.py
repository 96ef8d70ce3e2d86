"""The hand on the page, in each of its directions, with what one can drag."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from nicegui import events, ui

from pcjax.model.hand import HandDesign
from pcjax.model.scenario import Scenario, does
from pcjax.results.schema import NAMES
from pcjax.study.spec import Study
from pcjax.units import with_unit
from pcjax.view.web.dials import joints_of, limb_set, pulled
from pcjax.view.web.picture import Frame, frame_of, hand_svg, object_svg, scene_svg
from pcjax.view.web.studio import Studio

_PLACE = """
const at = (e) => {
  const m = e.currentTarget.getScreenCTM().inverse();
  const p = new DOMPoint(e.clientX, e.clientY).matrixTransform(m);
  return [p.x, -p.y];
};
"""
"""Where the pointer is, in the hand's lengths."""

_DOWN = f"""(e) => {{
  {_PLACE}
  const name = e.target.dataset.handle;
  if (!name || e.button > 0) return;
  e.preventDefault();
  e.target.focus();
  e.currentTarget.setPointerCapture(e.pointerId);
  emit(name, ...at(e));
}}"""

_MOVE = f"""(e) => {{
  {_PLACE}
  if (e.currentTarget.hasPointerCapture(e.pointerId)) emit(...at(e));
}}"""

_KEY = """(e) => {
  const name = e.target.dataset.handle;
  if (!name || !e.key.startsWith('Arrow')) return;
  e.preventDefault();
  emit(name, e.key.slice(5).toLowerCase(), e.shiftKey);
}"""

_DEGREE = np.pi / 180

_IN_A_ROW = 1.0
"""Seconds between keys that are one change."""

_WAYS = {"does": "escape from inside", "eoen": "enter from outside"}


class Canvas:
    """Both directions side by side: escaping, where one drags, and entering, which follows."""

    def __init__(self, studio: Studio):
        self.studio = studio
        self.under: dict[str, Callable[[Frame], str]] = {}
        """What lies beneath the limbs in each direction, as SVG."""
        self.over: dict[str, Callable[[Frame], str]] = {}
        """What takes the object's place, as SVG: a trial that is played."""
        self._ghost: HandDesign | None = None
        self.frame = frame_of(studio.desk.study.hand, both=True)
        self._before: Study | None = None
        self._held = ""
        self._off = np.zeros(2)
        """From the pointer to what it holds, when it was taken."""
        self._moved = False
        self._last_key = ("", 0.0)
        self._handles: dict[str, ui.element] = {}
        self._parts: dict[tuple[str, str], ui.html] = {}
        self._plates: dict[str, ui.element] = {}
        self._captions: dict[str, ui.label] = {}
        self._row = ui.element("div").classes("canvas")
        self._build()
        studio.on_opened.append(self._build)
        studio.on_design.append(lambda moving: self.draw(moving=moving))

    # ------------------------------------------------------------------ building

    def _build(self) -> None:
        self._row.clear()
        self._handles, self._parts, self._captions = {}, {}, {}
        study = self.studio.desk.study
        self._plates = {}
        with self._row:
            for direction in _WAYS if "eoen" in study.directions else ("does",):
                with ui.element("figure").classes("pane"):
                    self._pane(direction, study)
        self.draw(moving=False)

    def _pane(self, direction: str, study: Study) -> None:
        with ui.element("figcaption"):
            self._captions[direction] = ui.label()
        with ui.element("svg") as svg:
            svg.props["data-testid"] = f"hand-{direction}"
            svg.props["role"] = "group"
            for name in ("under", "limbs", "scene", "over"):
                self._parts[direction, name] = ui.html("", tag="g", sanitize=False)
            if direction == "does":
                for name, words in _handles_of(study):
                    self._handles[name] = self._handle(name, words)
        self._plates[direction] = svg
        if direction == "does":
            svg.on("pointerdown", self._down, js_handler=_DOWN)
            svg.on("pointermove", self._move, throttle=0.04, js_handler=_MOVE)
            svg.on("pointerup", self._up, js_handler=_MOVE)
            svg.on("pointercancel", self._up, js_handler=_MOVE)
            # A finger on a joint drags it, and elsewhere it scrolls the page.
            svg.on("touchstart", js_handler="(e) => e.target.dataset.handle && e.preventDefault()")
            svg.on("keydown", self._key, js_handler=_KEY)

    def _handle(self, name: str, words: str) -> ui.element:
        handle = ui.element("circle").classes("handle")
        handle.props.update(
            {
                "data-testid": name,
                "data-handle": name,
                "tabindex": "0",
                "role": "slider",
                "aria-label": words,
                "aria-valuenow": "0",
            }
        )
        return handle

    # ------------------------------------------------------------------ drawing

    def draw(self, *, moving: bool = False) -> None:
        """Everything as it is now; the part of the plane that is seen stays while one drags."""
        desk = self.studio.desk
        study, problem = desk.study, self.studio.problem
        if not moving and not problem and ("eoen" in study.directions) != ("eoen" in self._plates):
            self._build()  # which draws, too
            return
        if not moving:
            self.frame = frame_of(study.hand, both="eoen" in self._plates)
        scenarios = {} if problem else study.scenarios()
        gap = f"; gap {with_unit(float(study.hand.gap()), study.units)}"
        for direction, caption in self._captions.items():
            caption.set_text(f"{NAMES[direction]}: {_WAYS[direction]}{gap}")
        for direction in self._plates:
            # What is wrong has no EoEn, but its place stays: nothing may move while one drags.
            self._plates[direction].props["viewBox"] = self.frame.view_box
            hand = study.hand if direction == "does" else study.hand.with_fingertips_mirrored()
            wrong = bool(problem or self.studio.doubt)
            self._set(direction, "limbs", hand_svg(hand, self.frame, wrong=wrong))
            self._draw_rest(direction, scenarios.get(direction))
        self._place_handles(study)

    def show_ghost(self, hand: HandDesign | None) -> None:
        """Another hand behind the design, such as the best that a search has found so far."""
        self._ghost = hand
        for direction in self._plates:
            self.redraw(direction)

    def redraw(self, direction: str) -> None:
        """What lies beneath and above the limbs, anew."""
        if direction not in self._plates:
            return
        problem = self.studio.problem
        scenarios = {} if problem else self.studio.desk.study.scenarios()
        self._draw_rest(direction, scenarios.get(direction))

    def _draw_rest(self, direction: str, scenario: Scenario | None) -> None:
        blank = scenario is None
        under, over = self.under.get(direction), self.over.get(direction)
        beneath = "" if blank or under is None else under(self.frame)
        if self._ghost is not None:
            hand = self._ghost
            hand = hand if direction == "does" else hand.with_fingertips_mirrored()
            beneath += hand_svg(hand, self.frame, name="ghost")
        self._set(direction, "under", beneath)
        self._set(direction, "over", "" if blank or over is None else over(self.frame))
        scene = ""
        if scenario is not None:
            scene = scene_svg(scenario, self.frame)
            if over is None:
                centre = start_of(scenario)
                scene += object_svg(scenario.body, centre, None, self.frame)
        self._set(direction, "scene", scene)

    def _set(self, direction: str, name: str, svg: str) -> None:
        part = self._parts[direction, name]
        if part.content != svg:
            part.set_content(svg)

    @staticmethod
    def _places(study: Study) -> dict[str, np.ndarray]:
        """Where everything is that can be dragged; the object at its rightmost reach."""
        joints = np.concatenate(joints_of(study.hand))
        places = dict(zip(_names_of(study.hand), joints, strict=True))
        places["object"] = _first_place(study) + np.array([float(study.body.radius), 0.0])
        return places

    def _place_handles(self, study: Study) -> None:
        places = self._places(study)
        for name, handle in self._handles.items():
            x, y = places[name]
            new = {
                "cx": f"{x:.6g}",
                "cy": f"{-y:.6g}",
                "aria-valuetext": f"{x:.4g}, {y:.4g}",
                "r": f"{(0.017 if name == 'object' else 0.024) * self.frame.size:.5g}",
            }
            if any(handle.props.get(k) != v for k, v in new.items()):
                handle.props.update(new)

    # ------------------------------------------------------------------ dragging

    def _down(self, event: events.GenericEventArguments) -> None:
        name, x, y = event.args
        self._held, self._before = str(name), self.studio.desk.study
        self._off = self._places(self._before)[self._held] - np.array([x, y])
        self._moved, self.studio.held = False, True

    def _move(self, event: events.GenericEventArguments) -> None:
        if self._held:
            self._moved = True
            self._pull(*map(float, event.args), moving=True)

    def _up(self, event: events.GenericEventArguments) -> None:
        self.studio.held = False
        if self._held and self._moved:
            self._pull(*map(float, event.args), moving=False)
        self._held, self._before = "", None

    def _pull(self, x: float, y: float, *, moving: bool) -> None:
        studio, before = self.studio, self._before
        assert before is not None
        x, y = np.array([x, y]) + self._off
        if self._held == "object":
            start = _first_place(before)
            reach = float(np.hypot(x - start[0], y - start[1]))
            factor = max(reach / float(before.body.radius), 0.05)
            new = replace(before, body=before.body.scaled(float(f"{factor:.3g}")))
        else:
            # From where it was when it was taken: rounding would add up.
            finger, joint = _joint_of(before.hand, self._held)
            mirrored = studio.desk.mirrored
            hand = pulled(before.hand, finger, joint, float(x), float(y), mirrored=mirrored)
            new = replace(before, hand=hand)
        studio.take(new, before=before, moving=moving)

    def _key(self, event: events.GenericEventArguments) -> None:
        """Left and right turn a limb, up and down make it longer and shorter."""
        name, key, shift = event.args
        study, many = self.studio.desk.study, 5 if shift else 1
        longer = many * {"up": 1, "down": -1}.get(key, 0)
        turned = many * {"left": 1, "right": -1}.get(key, 0)
        hand = study.hand
        if name == "object":
            new = replace(study, body=study.body.scaled(1 + 0.02 * longer)) if longer else study
        else:
            finger, joint = _joint_of(hand, name)
            palm = float(hand.palm_length)
            if joint == 0:
                hand = replace(hand, palm_length=palm * (1 + 0.01 * longer)) if longer else hand
            else:
                length = float(hand.lengths[finger][joint - 1]) + 0.01 * longer * palm
                angle = float(hand.angles[finger][joint - 1]) + _DEGREE * turned
                mirrored = self.studio.desk.mirrored
                length = max(length, 1e-3 * palm)
                hand = limb_set(hand, finger, joint - 1, angle, length, mirrored=mirrored)
            new = replace(study, hand=hand)
        # Keys in a row are one change.
        last, when = self._last_key
        now = time.monotonic()
        self._last_key = name, now
        self.studio.take(new, further=last == name and now - when < _IN_A_ROW)


def start_of(scenario: Scenario) -> np.ndarray:
    """Where the object starts, but for the spread."""
    start = scenario.corner_start()
    return np.array([float(start.x), float(start.y)])


def _first_place(study: Study) -> np.ndarray:
    """Where the object starts inside the hand, whether or not it has room there."""
    return start_of(does(study.hand, study.body, study.drive, study.law, study.run.start_spread))


def _names_of(hand: HandDesign) -> list[str]:
    """Of all joints, as `joints_of` has them."""
    return [
        f"joint-{finger}-{joint}" if joint <= len(row) else f"fingertip-{finger}"
        for finger, row in enumerate(hand.lengths, start=1)
        for joint in range(1, len(row) + 2)
    ]


def _joint_of(hand: HandDesign, name: str) -> tuple[int, int]:
    """Finger and joint of a name, both from 0."""
    kind, finger, *joint = name.split("-")
    one = int(finger) - 1
    return one, len(hand.lengths[one]) if kind == "fingertip" else int(joint[0]) - 1


def _handles_of(study: Study) -> list[tuple[str, str]]:
    """Names of what can be dragged, and what screen readers say of it."""
    words: dict[str, Any] = {
        name: f"{name.replace('-', ' ')}: "
        + (
            "up and down lengthen the palm"
            if name.endswith("-1") and name.startswith("joint")
            else "left and right turn its limb, up and down lengthen it"
        )
        for name in _names_of(study.hand)
    }
    return [("object", "object: up and down change its size"), *words.items()]
