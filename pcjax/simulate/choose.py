"""Which engine runs a scenario, and with which step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from pcjax.model.scenario import Scenario
from pcjax.simulate.engine import ENGINES, Engine, in_order_of_preference, takes_dt

E = TypeVar("E", bound=Engine)


def engine_names() -> tuple[str, ...]:
    """What an engine can be named by: "auto", and all kinds."""
    return ("auto", *ENGINES.kinds())


def check_engine(engine: object) -> None:
    """
    Raises:
        ValueError: it is neither a known name nor an engine.
    """
    if not isinstance(engine, Engine) and engine not in engine_names():
        raise ValueError(
            f"engine is {engine!r}: it has to be one of {', '.join(engine_names())}, or an Engine"
        )


def choose_engine(engine: str | Engine, dt: float | None, scenario: Scenario) -> Engine:
    """The engine for a scenario.

    Arguments:
        engine: one, or the kind of one with its usual parameters, such as "event" or "stepping" (at
            the paper's 0.001 s); or "auto": of those that can run it, the one of highest
            preference, with the parameters that accuracy asks for. So it is the event-driven one
            where that applies and no `dt` is asked for, else stepping, as far at a time as accuracy
            allows (0.04 s, on the arm 0.02 s, for a stick 0.01 s, or less for small, fast objects).
        dt: the solver's step, s, for an engine that has one; else None.
        scenario: what is to be run.

    Raises:
        ValueError: an unknown name, an engine that does not apply, or a step that does not.

    Examples:
        >>> import pcjax
        >>> from pcjax.simulate.choose import choose_engine
        >>> hand = pcjax.box_hand()
        >>> choose_engine("auto", None, pcjax.does(hand, pcjax.Circle(25.0))).name
        'event'
        >>> choose_engine("auto", None, pcjax.does(hand, pcjax.Stick(25.0))).name
        'convex'
    """
    check_engine(engine)
    if engine == "auto":
        return engine_for([scenario], dt)
    made = ENGINES[engine]() if isinstance(engine, str) else engine
    if dt is not None:
        if not takes_dt(type(made)):
            raise ValueError(
                f"dt does not go with {made.noun}: it takes no steps whose length can be chosen"
            )
        made = made.having(dt=dt)
    obstacle = _obstacle(type(made), scenario) or made.obstacle(scenario)
    if obstacle:
        other = ENGINES.kind_of(_first([scenario], None, Engine))
        raise ValueError(f"{made.noun} cannot run this: {obstacle}; take engine '{other}'")
    return made


def engine_for(
    scenarios: Sequence[Scenario], dt: float | None = None, family: type[E] = Engine
) -> E:
    """The engine of highest preference that can run all of some scenarios, with the parameters that
    accuracy asks for.

    Arguments:
        scenarios: what is to be run.
        dt: the solver's step, s, if the engine has to be one that takes it.
        family: a subclass of `Engine` that it has to be of.

    Raises:
        ValueError: there is none, or accuracy asks for too much.
    """
    kind = _first(scenarios, dt, family)
    return kind.suited(scenarios) if dt is None else kind().having(dt=dt)


def _obstacle(kind: type[Engine], scenario: Scenario) -> str | None:
    """Why a kind of engine cannot run a scenario whatever its parameters; None where it can."""
    if kind.dimensions != scenario.dimensions:
        where = {2: "in the plane", 3: "in three dimensions"}
        return f"it is for hands {where[kind.dimensions]}"
    return kind.obstacle(scenario)


def _first(scenarios: Sequence[Scenario], dt: float | None, family: type[E]) -> type[E]:
    for kind in in_order_of_preference(scenarios):
        if (
            issubclass(kind, family)
            and (dt is None or takes_dt(kind))
            and not any(_obstacle(kind, scenario) for scenario in scenarios)
        ):
            return kind
    reasons = {
        kind.noun: found
        for kind in in_order_of_preference(scenarios)
        for found in (_obstacle(kind, scenario) for scenario in scenarios)
        if found
    }
    if not reasons:
        raise ValueError("no engine takes this of its own accord: name one")
    listed = "; ".join(f"{noun}: {found}" for noun, found in reasons.items())
    raise ValueError(f"no engine can run this: {listed}")
