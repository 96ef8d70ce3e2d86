"""What an engine tells about itself: what it can run, how well, and by which name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeVar

from pcjax.components import Component, Registry, quantities
from pcjax.model.scenario import Scenario
from pcjax.simulate.cloud import Cloud
from pcjax.simulate.outcomes import Outcomes
from pcjax.simulate.track import Follower

ENGINES: Registry[Engine] = Registry(
    "engine",
    "pcjax.engines",
    (
        "pcjax.simulate.event",
        "pcjax.simulate.stepping",
        "pcjax.simulate.convex",
        "pcjax.simulate.backends.mujoco",
    ),
)
"""How trials are run, as study files and flags can name it."""

register_engine = ENGINES.register


@dataclass(frozen=True)
class How:
    """How trials are run, whatever the engine: the arguments of `pcjax.simulate.batch.run`."""

    first: int
    seed: int
    precision: int
    block: int | None
    workers: int | None
    progress: bool
    cloud: Cloud | None
    follower: Follower | None


E = TypeVar("E", bound="Engine")


class Engine(Component):
    """How trials are run.

    Its parameters are declared with `quantity`, each with a default, since an engine may be named
    alone. One that runs blocks of trials as a compiled program is a
    `pcjax.simulate.batch.LaneEngine`.

    Attributes:
        noun: what messages call it.
        summary: what it does and for what, in a few words, for help and tables.
        preference: where no engine is named, the one of highest preference that can run the
            scenario is taken. Each class speaks for itself: without a number in its own body it is
            taken only where it is named.
        tracks: whether it tells a `Follower` where its trials are on their way.
        dimensions: of the scenarios that it is for, 2 or 3.
        bits: of its numbers, where it knows no other; None where the run says.
    """

    noun: ClassVar[str] = "this engine"
    summary: ClassVar[str] = "without a summary"
    preference: ClassVar[float | None] = None
    tracks: ClassVar[bool] = False
    dimensions: ClassVar[int] = 2
    bits: ClassVar[int | None] = None

    @property
    def name(self) -> str:
        """What files, flags and results call it.

        Raises:
            ValueError: its class is not registered.
        """
        return ENGINES.kind_of(self)

    @property
    def provenance(self) -> str:
        """Its name and parameters, as results keep them; they keep the step taken apart."""
        given = {key: value for key, value in self.as_table().items() if key != "dt"}
        listed = ", ".join(f"{key} = {value:g}" for key, value in given.items())
        return f"{self.name} ({listed})" if listed else self.name

    @property
    def relaxed(self) -> bool:
        """Whether the goal is spread over a layer, so that outcomes have an excursion."""
        return False

    @classmethod
    def preference_for(cls, scenario: Scenario) -> float | None:
        """Its `preference`, where it goes by the scenario."""
        return vars(cls).get("preference")

    @classmethod
    def obstacle(cls, scenario: Scenario) -> str | None:
        """Why it cannot run a scenario; None where it can."""
        return None

    @classmethod
    def suited(cls: type[E], scenarios: Sequence[Scenario]) -> E:
        """With the parameters that accuracy asks for in these scenarios, where none are given."""
        return cls()

    def step_taken(self, period: float) -> float:
        """The step taken for periods of `period` seconds, s; NaN for one that takes no steps."""
        return float("nan")

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        """About how long a trial takes a core of 2023, for a forecast."""
        raise NotImplementedError

    def second_opinion(self, scenario: Scenario, outcomes: Outcomes, how: How) -> dict[str, float]:
        """How far its trials are to be trusted, from a finer look at some of them, as attributes of
        results: nothing, unless an engine says otherwise.

        Arguments:
            scenario: the condition.
            outcomes: of this condition alone.
            how: they were run.
        """
        return {}

    def fill(self, outcomes: Outcomes, scenarios: Sequence[Scenario], how: How) -> None:
        """Runs the trials of every scenario, as many as `outcomes` has room for.

        Arguments:
            outcomes: blank arrays, filled in here; those that are None are not wanted.
            scenarios: the conditions.
            how: checked.
        """
        raise NotImplementedError


def in_order_of_preference(scenarios: Sequence[Scenario]) -> list[type[Engine]]:
    """The engines that may be taken for all of some scenarios where none is named, the first choice
    first."""
    found = []
    for _, kind in ENGINES.items():
        if any(kind.dimensions != scenario.dimensions for scenario in scenarios):
            continue
        preferences = [kind.preference_for(scenario) for scenario in scenarios]
        known = [preference for preference in preferences if preference is not None]
        if len(known) == len(preferences):
            found.append((min(known), kind))
    return [kind for _, kind in sorted(found, key=lambda pair: -pair[0])]


def takes_dt(engine: type[Engine]) -> bool:
    """Whether the solver's step is a parameter of an engine."""
    return "dt" in quantities(engine)
