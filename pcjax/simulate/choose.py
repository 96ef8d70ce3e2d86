"""Which engine runs a scenario, and with which step."""

from __future__ import annotations

from pcjax.model.bodies.circle import Circle
from pcjax.model.scenario import Scenario, gap_of
from pcjax.physics.state import PAPER_DT
from pcjax.simulate.event import EventDriven
from pcjax.simulate.lanes import Engine
from pcjax.simulate.stepping import SHORTEST_STEP, Stepping

ENGINES = ("auto", "event", "stepping")

_LEAST_CLEARANCE = 1e-4
"""Difference between gap and object, in diameters, that the event-driven engine needs."""

_AUTO_TRAVEL = 0.5
"""Share of the radius that a step may cover at the speed of a fall through the whole hand."""


def choose_engine(name: str, dt: float | None, scenario: Scenario) -> Engine:
    """The engine for a name: "event", "stepping" (at `dt`, the paper's 0.001 s unless given), or
    "auto": the event-driven one where it applies and no `dt` is asked for, else stepping, as far at
    a time as accuracy allows (0.04 s, on the arm 0.02 s, for a stick 0.01 s, or less for small,
    fast objects).

    Raises:
        ValueError: an unknown name, or an event-driven engine that does not apply.

    Examples:
        >>> import pcjax
        >>> from pcjax.simulate.choose import choose_engine
        >>> hand = pcjax.box_hand()
        >>> choose_engine("auto", None, pcjax.does(hand, pcjax.Circle(25.0))).name
        'event'
        >>> choose_engine("auto", None, pcjax.does(hand, pcjax.Stick(25.0))).name
        'stepping'
    """
    if name == "stepping":
        return Stepping(PAPER_DT if dt is None else dt)
    if name == "event":
        if dt is not None:
            raise ValueError("dt does not go with the event-driven engine: it takes no steps")
        obstacle = _obstacle_to_events(scenario)
        if obstacle:
            raise ValueError(f"the event-driven engine cannot run this: {obstacle}")
        return EventDriven()
    if name != "auto":
        raise ValueError(f"engine is {name!r}: it has to be one of {', '.join(ENGINES)}")
    if dt is not None:
        return Stepping(dt)
    if _obstacle_to_events(scenario):
        return Stepping(safe_step(scenario))
    return EventDriven()


def _obstacle_to_events(scenario: Scenario) -> str | None:
    """Why the event-driven engine does not apply to a scenario, if so."""
    if not (scenario.drive.steady_in_between and isinstance(scenario.body, Circle)):
        return "it knows a circle in a hand that a wrist tilts; take engine 'stepping'"
    if scenario.law.smoothing is not None:
        return "it knows hard contact only, and this one is smoothed; take engine 'stepping'"
    diameter = 2 * float(scenario.body.radius)
    clearance = gap_of(scenario) - diameter
    if abs(clearance) < _LEAST_CLEARANCE * diameter:
        return (
            f"the gap differs from the object's diameter by {clearance:.2g}, too little for a "
            "contact on either side; take engine 'stepping'"
        )
    return None


def safe_step(scenario: Scenario) -> float:
    """A step in which a fall through the whole hand covers a modest share of the radius."""
    hand, drive = scenario.hand, scenario.drive
    reach = float(hand.palm_length) + max(float(sum(ls)) for ls in hand.lengths)
    speed = drive.top_speed(reach)
    radius = float(scenario.body.radius)
    if _AUTO_TRAVEL * radius < SHORTEST_STEP * speed:
        raise ValueError(
            f"the radius {radius:g} is too small for a hand of {reach:g} under gravity: the object "
            f"would need steps below {SHORTEST_STEP:g} s"
        )
    longest = min(drive.longest_step, scenario.body.longest_step)
    return min(longest, _AUTO_TRAVEL * radius / max(speed, 1e-9))
