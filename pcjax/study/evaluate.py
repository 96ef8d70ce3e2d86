"""From a hand to its quality: `evaluate` for one, `evaluate_grid` for many conditions at once."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pcjax.checks import check_count
from pcjax.importing import xr
from pcjax.model.bodies.base import Body
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.base import Drive
from pcjax.model.hand import HandDesign, full_cage
from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID
from pcjax.quality.stopping import precision_of, until_known
from pcjax.results.estimates import counts_of, indices_of, rows_of
from pcjax.results.evaluation import Evaluation
from pcjax.results.provenance import conditions, provenance
from pcjax.results.schema import INDICES, WATCHED, dataset_of
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.engine import Engine, How
from pcjax.simulate.outcomes import LIMIT, Outcomes
from pcjax.study.spec import Run, Study
from pcjax.units import check_units, doubts_of_gravity, doubts_of_model_units
from pcjax.words import InputWarning


def evaluate(
    hand: HandDesign | None = None,
    body: Body | None = None,
    *,
    direction: str | None = None,
    drive: Drive | None = None,
    law: ContactLaw | None = None,
    start_spread: float = 0.1,
    trials: int | None = None,
    max_steps: int | None = None,
    seed: int = 0,
    engine: str | Engine = "auto",
    dt: float | None = None,
    precision: int = 32,
    precision_target: float | None = None,
    units: str | None = None,
    progress: bool = False,
) -> Evaluation:
    """Evaluates how well a hand cages an object without closing on it (Sec. 3.1).

    Arguments:
        hand: the design; unless given, the paper's box hand at theta_g = 10 deg on the wrist and
            its two-joint hand at 65 and 90 deg on the arm.
        body: the object; a circle of radius 0.05 L_p on the wrist and 50 on the arm unless given.
        direction: "does" (difficulty of escaping), "eoen" (ease of entering) or "both", which also
            gives the score; unless given, both for a hand that has both, and "does" on an arm.
        drive: what moves the hand; the paper's wrist unless given.
        law: contact law; the paper's unless given.
        start_spread: spread of the starts near the palm's ends, in palm lengths.
        trials: trials for each direction, 5,000 unless given; with `precision_target` the most of
            them, 1,000,000 unless given.
        max_steps: limit in the paper's steps of 0.001 s; the paper's unless given: 600,000 for a
            circle on the wrist, 300,000 on the arm, 180,000 for a stick.
        seed: trial i is the same experiment for every hand evaluated with the same seed.
        engine: one, or the kind of one with its usual parameters, such as "event" or "stepping", or
            "auto" (see `choose_engine`).
        dt: the solver's step in seconds, for an engine that has one; chosen by it unless given.
        precision: 32 or 64 bits.
        precision_target: how well the score (index 1 where there is no score) is to be known: what
            share of it half its 95 % interval is to be at most.
        units: of all lengths, "mm", "cm" or "m", with the earth's gravity unless a drive is given;
            or "model", the paper's, in which g is 9.8, which they are unless given. In a real unit
            the hand has to be given, and on the arm the object.
        progress: whether to show a progress bar on stderr.

    Warns (`InputWarning`) where hand or gravity are probably in another unit.

    Returns:
        An `Evaluation`; print it for a table.

    Raises:
        ValueError: a number or name out of range, limbs that cross, an object that does not fit
            at its start, or EoEn of a hand that has none.

    Examples:
        >>> import pcjax
        >>> result = pcjax.evaluate(pcjax.box_hand(0.17), trials=64, max_steps=20_000)
        >>> 0 < result.indices("does")["index1"].value <= 20_000
        True
    """
    settings = Run(
        direction, trials, max_steps, seed, start_spread, engine, dt, precision, precision_target
    )
    study = Study.usual(hand, body, drive, law, settings, units or "model")
    doubts = doubts_of_gravity(getattr(study.drive, "gravity", None), study.units)
    if hand is not None and drive is None and units is None:
        doubts += doubts_of_model_units(float(hand.palm_length), "units")
    for doubt in doubts:
        warnings.warn(doubt, InputWarning, stacklevel=2)
    return evaluate_study(study, progress=progress)


class Experiment:
    """The hand of a study, tried as often as one likes, and then more often.

    Raises:
        ValueError: see `evaluate`.
    """

    def __init__(self, study: Study):
        run_as = study.run
        self.study = study
        self._scenarios = study.scenarios()
        for scenario in self._scenarios.values():
            scenario.check()
        self._engines = [
            choose_engine(run_as.engine, run_as.dt, scenario)
            for scenario in self._scenarios.values()
        ]
        self._outcomes: Outcomes | None = None
        self._seconds = 0.0

    @property
    def trials(self) -> int:
        """How many there are in each direction."""
        return 0 if self._outcomes is None else self._outcomes.steps.shape[1]

    def go_on(self, trials: int, *, progress: bool = False) -> Evaluation:
        """Runs what is missing for so many trials in each direction; what is known then."""
        began = time.perf_counter()
        if trials > self.trials:
            more = _run_each(
                list(self._scenarios.values()),
                self._engines,
                trials=trials - self.trials,
                first=self.trials,
                max_steps=self.study.max_steps,
                seed=self.study.run.seed,
                precision=self.study.run.precision,
                progress=progress,
            )
            self._outcomes = more if self._outcomes is None else self._outcomes.joined(more)
        self._seconds += time.perf_counter() - began
        return self._known({})

    def checked(self) -> Evaluation:
        """What is known after the trials so far, with what the engines say of their own accuracy:
        asked for once, at the end, since it may take trials of its own."""
        assert self._outcomes is not None
        began, run_as = time.perf_counter(), self.study.run
        how = How(0, run_as.seed, run_as.precision, None, None, False, None, None)
        said: dict[str, float] = {}
        for k, (direction, scenario) in enumerate(self._scenarios.items()):
            found = self._engines[k].second_opinion(scenario, self._outcomes.of([k]), how)
            said |= {f"{direction}_{name}": value for name, value in found.items()}
        self._seconds += time.perf_counter() - began
        return self._known(said)

    def _known(self, said: dict[str, float]) -> Evaluation:
        assert self._outcomes is not None
        attrs = self._settings() | said
        return Evaluation.from_outcomes(self._scenarios, self._outcomes, attrs)

    def _settings(self) -> dict[str, Any]:
        study, missing = self.study, self.study.why_no_eoen
        period = next(iter(self._scenarios.values())).drive.period
        target = study.run.precision_target
        return {
            "seed": study.run.seed,
            "engine": _provenance_of(self._engines),
            "dt": np.fmin.reduce([engine.step_taken(period) for engine in self._engines]),
            "precision": study.run.precision,
            "length_unit": study.units,
            "wall_seconds": self._seconds,
            **({"precision_target": target} if target is not None else {}),
            **({"no_eoen": missing} if missing else {}),
            **as_attribute(study),
        }


def evaluate_study(study: Study, *, progress: bool = False) -> Evaluation:
    """Evaluates the hand of a study as the study says; its sweep is not looked at.

    Arguments:
        study: what is evaluated, and how.
        progress: whether to show a progress bar on stderr.

    Raises:
        ValueError: see `evaluate`.
    """
    experiment = Experiment(study)
    until_known(
        study.run.precision_target,
        study.trials,
        lambda trials: experiment.go_on(trials, progress=progress),
        lambda found: precision_of(found.main),
    )
    return experiment.checked()


def evaluate_grid(
    scenarios: Sequence[Scenario],
    coords: Mapping[str, Sequence[Any]],
    *,
    trials: int,
    max_steps: int,
    seed: int = 0,
    engine: str | Engine = "auto",
    dt: float | None = None,
    precision: int = 32,
    units: str = "model",
    progress: bool = False,
) -> xr.Dataset:
    """Evaluates many conditions in one batch, all on the same trials.

    Arguments:
        scenarios: the conditions, of equal structure.
        coords: labels of the conditions by name, each with one value for every scenario.
        trials, max_steps, seed, engine, dt, precision, progress: see `evaluate`.
        units: of lengths, for the dataset: the scenarios are taken as they are.

    Returns:
        A dataset along `condition` with `index1` and `index2` (statistic), over the trials that
        went right in all of them, `count` (status_name), the hand's `gap`, and `covariance` of all
        the estimates (the trials are shared, so differences and ratios between conditions are known
        better than each alone).

    Raises:
        ValueError: see `evaluate`.

    Examples:
        >>> import pcjax
        >>> from pcjax.study.evaluate import evaluate_grid
        >>> radii = [10.0, 25.0]
        >>> scenarios = [pcjax.does(pcjax.box_hand(), pcjax.Circle(radius)) for radius in radii]
        >>> data = evaluate_grid(scenarios, {"radius": radii}, trials=64, max_steps=20_000)
        >>> data.index1.dims, data.radius.values.tolist()
        (('condition', 'statistic'), [10.0, 25.0])
    """
    check_count("trials", trials, 2, 2**31 - 1)
    check_units(units)
    gaps = [scenario.check() for scenario in scenarios]
    chosen = [choose_engine(engine, dt, scenario) for scenario in scenarios]
    began = time.perf_counter()
    outcomes = _run_each(
        scenarios,
        chosen,
        trials=trials,
        max_steps=max_steps,
        seed=seed,
        precision=precision,
        progress=progress,
    )
    valid = (outcomes.status != INVALID).all(axis=0)
    if valid.sum() < 2:
        raise ValueError("fewer than two trials went right in every condition: try a smaller dt")
    samples = np.concatenate(
        [outcomes.steps[:, valid].astype(float), (outcomes.status[:, valid] == LIMIT).astype(float)]
    )
    covariance = np.atleast_2d(np.cov(samples)) / valid.sum()
    c, widths = len(scenarios), [float(s.body.width) for s in scenarios]
    # Invalid in one condition is left out of all, and counts as lost in each.
    status = np.where(valid, outcomes.status, INVALID)
    estimates = [
        indices_of(
            outcomes.steps[k],
            status[k],
            max_steps,
            caged=bool(full_cage(gap, scenario.body.least_passage())),
        )
        for k, (gap, scenario) in enumerate(zip(gaps, scenarios, strict=True))
    ]
    stick = {}
    if outcomes.watch is not None:
        worst = outcomes.watch.max(axis=1).astype(float)
        worst[:, 2] = outcomes.watch[..., 2].sum(axis=1)
        stick = dict(zip(WATCHED, worst.T, strict=True))
        stick["skin"] = [float(getattr(s.body, "skin", np.nan)) for s in scenarios]
    periods = [scenario.drive.period for scenario in scenarios]
    return dataset_of(
        "grid",
        {
            **stick,
            **{name: rows_of(each[name] for each in estimates) for name in INDICES},
            "covariance": covariance.reshape(2, c, 2, c).transpose(0, 2, 1, 3),
            "count": counts_of(outcomes.status),
            "gap": gaps,
            "object_width": widths,
            "dt": [one.step_taken(period) for one, period in zip(chosen, periods, strict=True)],
        },
        {name: ("condition", list(values)) for name, values in coords.items()},
        provenance(
            {
                "trials": trials,
                "trials_right": int(valid.sum()),
                "max_steps": max_steps,
                "seed": seed,
                "engine": _provenance_of(chosen),
                "precision": precision,
                "length_unit": units,
                "wall_seconds": time.perf_counter() - began,
                **conditions(scenarios),
            }
        ),
        place=("condition",),
    )


def as_attribute(study: Study) -> dict[str, str]:
    """A study's text for the attributes of its results; none for classes that have no kind."""
    try:
        return {"study": study.to_toml()}
    except ValueError:
        return {}


def _provenance_of(engines: Sequence[Engine]) -> str:
    return ", ".join(dict.fromkeys(engine.provenance for engine in engines))


def _run_each(
    scenarios: Sequence[Scenario], engines: Sequence[Engine], **settings: Any
) -> Outcomes:
    """The outcomes of each scenario by its own engine; those with equal engines share a batch."""
    watched = scenarios[0].body.oriented
    outcomes = Outcomes.blank(
        len(scenarios), settings["trials"], settings["max_steps"], watched=watched
    )
    for engine in dict.fromkeys(engines):
        chosen = [k for k, other in enumerate(engines) if other == engine]
        outcomes.put(chosen, run([scenarios[k] for k in chosen], engine=engine, **settings))
    return outcomes
