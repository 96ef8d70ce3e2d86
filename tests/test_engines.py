"""Engines as registered components: what they say of themselves decides who runs what."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pcjax
from pcjax.cli.parts import add_run, as_flags_say
from pcjax.components import quantity
from pcjax.model.scenario import Scenario
from pcjax.physics.contact.table import CONTACTS
from pcjax.physics.state import PASSED
from pcjax.simulate.choose import choose_engine, engine_for, engine_names
from pcjax.simulate.convex import ConvexLeaps
from pcjax.simulate.engine import ENGINES, How
from pcjax.simulate.event import EventDriven
from pcjax.simulate.outcomes import LIMIT, Outcomes
from pcjax.simulate.stepping import Stepping
from tests.shown import keep_registered

HAND = pcjax.box_hand()
CIRCLE, STICK = pcjax.does(HAND, pcjax.Circle(25.0)), pcjax.does(HAND, pcjax.Stick(25.0))
SMOOTHED = pcjax.does(HAND, pcjax.Stick(25.0), law=pcjax.ContactLaw(smoothing=1.0))


class Clock(pcjax.Engine):
    """Another simulator: trial i ends `pace` steps after trial i - 1."""

    pace: float = quantity(
        "1", "steps between ends", default=100, low=1, key="pace", flag="pace", static=True
    )

    noun = "the clock"
    summary = "what time it is"

    @classmethod
    def obstacle(cls, scenario: Scenario) -> str | None:
        return "it has no hands for what turns" if scenario.body.oriented else None

    def processor_seconds(self, scenario: Scenario, max_steps: int) -> float:
        return 3600.0

    def fill(self, outcomes: Outcomes, scenarios: Any, how: How) -> None:
        ends = self.pace * (1 + how.first + np.arange(outcomes.steps.shape[1]))
        outcomes.steps[:] = np.minimum(ends, outcomes.max_steps)
        outcomes.status[:] = np.where(ends < outcomes.max_steps, PASSED, LIMIT)


class Favourite(Clock):
    """The first choice of `auto`."""

    preference = 100


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    keep_registered(ENGINES, monkeypatch)
    ENGINES.register("clock")(Clock)


def test_each_of_the_package_says_what_it_is_and_auto_goes_by_preference() -> None:
    assert engine_names() == ("auto", "event", "stepping", "convex", "mujoco", "clock")
    assert all(engine.summary and engine.noun for _, engine in ENGINES.items())
    assert type(choose_engine("auto", None, CIRCLE)) is EventDriven
    ENGINES.register("favourite")(Favourite)
    assert type(choose_engine("auto", None, CIRCLE)) is Favourite
    assert type(choose_engine("auto", None, STICK)) is ConvexLeaps
    assert choose_engine("auto", None, SMOOTHED) == Stepping(0.01)
    assert choose_engine("auto", 0.02, CIRCLE) == Stepping(0.02)
    assert type(engine_for([CIRCLE], None, EventDriven)) is EventDriven


def test_a_subclass_is_not_taken_of_its_own_accord() -> None:
    class Finer(Stepping):
        pass

    ENGINES.register("finer")(Finer)
    assert type(choose_engine("auto", None, SMOOTHED)) is Stepping
    assert choose_engine("finer", None, STICK).name == "finer"


def test_what_an_engine_cannot_run_is_said_with_one_that_can() -> None:
    with pytest.raises(ValueError, match=r"the clock cannot run this: it has .*'convex'"):
        choose_engine("clock", None, STICK)
    with pytest.raises(ValueError, match="dt does not go with the clock: it takes no steps"):
        choose_engine(Clock(), 0.01, CIRCLE)
    with pytest.raises(
        ValueError, match=r"engine is 'clok': .* auto, event, stepping, convex, mujoco, clock"
    ):
        choose_engine("clok", None, CIRCLE)
    with pytest.raises(ValueError, match="engine is 3: it has to be one of"):
        pcjax.Run(engine=3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"dt is 0\.5: it has to lie between 1e-06 and 0\.2"):
        choose_engine("stepping", 0.5, CIRCLE)


def test_what_moves_in_a_way_of_its_own_does_not_leap(monkeypatch: pytest.MonkeyPatch) -> None:
    class Jelly(pcjax.Circle):
        pass

    scenario = pcjax.does(HAND, Jelly(25.0))
    assert choose_engine("auto", None, scenario).name == "event"
    monkeypatch.setitem(CONTACTS, Jelly, lambda *_: None)
    assert choose_engine("auto", None, scenario).name == "stepping"


def test_one_that_is_no_compiled_program_runs_a_study() -> None:
    result = pcjax.evaluate(
        HAND, pcjax.Circle(25.0), engine=Clock(300), trials=40, max_steps=10_000
    )
    ends = np.minimum(300 * np.arange(1, 41), 10_000)
    for direction in ("does", "eoen"):
        assert (result.dataset.escape_step.sel(direction=direction) == ends).all()
        assert result.indices(direction)["index1"].value == pytest.approx(ends.mean())
    assert result.status("does") == {"passed": 33, "limit": 7, "invalid": 0}
    assert result.dataset.attrs["engine"] == "clock (pace = 300)"


def test_its_parameters_go_into_study_files_and_can_be_swept(tmp_path: Path) -> None:
    study = pcjax.Study(HAND, pcjax.Circle(25.0), run=pcjax.Run(engine=Clock(200)))
    path = tmp_path / "clock.toml"
    path.write_text(study.to_toml())
    read = pcjax.load_study(path)
    assert read.run.engine == Clock(200)
    assert read.to_toml() == study.to_toml()
    assert read.having({"pace": 50}).run.engine == Clock(50)
    path.write_text('[run]\nengine = "clock"\n')
    assert pcjax.load_study(path).run.engine == Clock()
    for wrong, told in (
        (
            'engine = "event"\npace = 3',
            "line 3: .*pace does not apply to the engine event: .*clock",
        ),
        ("pace = 3", "line 2: .*pace does not apply to the engine auto: it belongs to clock"),
        ('engine = "clock"\npace = 0', "line 3: .*pace is 0: it has to be at least 1"),
        ('engine = "clock"\npase = 9', r"unknown key \[run\] pase: did you mean pace"),
    ):
        path.write_text(f"[run]\n{wrong}\n")
        with pytest.raises(ValueError, match=told):
            pcjax.load_study(path)


def test_its_parameters_are_flags_which_win_over_the_file() -> None:
    parser = argparse.ArgumentParser()
    ENGINES.register("favourite")(Favourite)  # with the same flag
    add_run(parser)

    def engine(words: str, usual: Any = "auto") -> Any:
        study = pcjax.Study(HAND, pcjax.Circle(25.0), run=pcjax.Run(engine=usual))
        return as_flags_say(study, parser.parse_args(words.split())).run.engine

    assert engine("") == "auto"
    assert engine("", Clock(7)) == engine("--engine clock", Clock(7)) == Clock(7)
    assert engine("--engine clock") == "clock"
    assert engine("--engine clock --pace 5") == engine("--pace 5", Clock(7)) == Clock(5)
    assert engine("--engine event", Clock(7)) == "event"
    with pytest.raises(ValueError, match=r"--pace does not apply .* auto: .* to clock and fav"):
        engine("--pace 5")


def test_a_flag_that_is_taken_is_refused() -> None:
    class Seeded(Clock):
        luck: float = quantity("1", "of the draw", default=1, key="luck", flag="seed", static=True)

    ENGINES.register("seeded")(Seeded)
    with pytest.raises(ValueError, match="--seed, a flag of engine seeded, is another"):
        add_run(argparse.ArgumentParser())
