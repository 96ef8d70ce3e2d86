"""`pcjax optimize`: a better hand."""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from pcjax.cli.condition import (
    PARAMETERS,
    add_condition,
    condition,
    limit_flag,
    parameter_flag,
)
from pcjax.cli.parser import Terminated
from pcjax.cli.parts import (
    add_dt,
    add_experiment,
    add_outputs,
    check_data,
    check_picture,
    check_writable,
    number,
    save_picture,
    settle_outputs,
    whole,
)
from pcjax.design.estimator import Estimator
from pcjax.design.front import Member, trade_off
from pcjax.design.gradients import Differences, Mixture, Pathwise
from pcjax.design.map import score_name
from pcjax.design.optimize import optimize
from pcjax.design.outcome import METHODS, Optimum, Settings, refused_text
from pcjax.design.search import search_grid
from pcjax.design.space import Space
from pcjax.design.starts import starting_designs
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import FORMS, OBJECTIVES, Surrogate
from pcjax.results.estimates import as_plain
from pcjax.results.saving import save_text
from pcjax.results.tables import estimate_text, interval_text, wrapped
from pcjax.study.spec import Objective, Study
from pcjax.study.task import task_of

_FOR_PATHWISE = {"goal_layer": 0.8, "contact_layer": 0.2}
"""The widths with which pathwise gradients are least noisy."""

_ESTIMATORS: dict[str, Estimator] = {
    "axial": Differences("axial"),
    "factorial": Differences("factorial"),
    "evolution": Differences("gaussian"),
    "pathwise": Pathwise(),
    "mixture": Mixture(Differences(), Pathwise(), tuple(_FOR_PATHWISE.items())),
}


_OF_METHODS = {
    "form": "gradient",
    "estimator": "gradient",
    "starts": "gradient",
    "gain": "model",
    "grid_points": "grid",
}
"""Flags that are for one method alone."""


def add_optimize(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add = parser.add_argument
    add(
        "--free",
        action="append",
        type=parameter_flag,
        default=None,
        metavar="NAME[=LOW:HIGH]",
        help="a parameter that may change, with bounds in degrees or lengths; again for more: "
        f"{PARAMETERS} (default: fingertip-angle and fingertip-length; on the arm joint-angle-1 "
        "and joint-angle-2; in three dimensions the joints that the study's posture names, 6 at "
        "most)",
    )
    add(
        "--clearance",
        type=number,
        default=None,
        metavar="L",
        help="the least that the gap has to be wider than the object (default: 0.04 L_p)",
    )
    add(
        "--limit",
        action="append",
        type=limit_flag,
        default=[],
        metavar="TEXT",
        help="a linear limit, such as 'fingertip-length + 0.5 gap-width <= 200'; again for more",
    )
    add(
        "--objective",
        choices=OBJECTIVES,
        default="index1",
        help="what the score is made of; escape_rate has no step limit in it",
    )
    add(
        "--over",
        action="append",
        type=_values_flag,
        default=[],
        metavar="NAME=V,V,...",
        help="optimise for several conditions at once, such as radius=10,25,40: a number of the "
        "object, the drive or the contact; again for more, all with all",
    )
    add("--weights", type=_numbers, default=None, metavar="W,W,...", help="of these conditions")
    add("--worst", action="store_true", help="the worst of their scores counts, not the mean")
    add(
        "--front",
        action="store_true",
        help="the designs that no other one beats in both of two aims: DoEs and EoEn or, with "
        "--over, the scores in two conditions",
    )
    add(
        "--method",
        choices=METHODS,
        help="learn a model of the score from all designs that were tried, follow the gradient of "
        "the relaxed score, try all designs on a grid, or CMA-ES "
        f"(default: {Settings.method})",
    )
    add("--grid-points", type=whole, help="of each parameter, for --method grid (default: 11)")
    add("--form", choices=FORMS, help="what the gradient is taken of (default: horizon)")
    add("--estimator", choices=tuple(_ESTIMATORS), help="of the gradient (default: axial)")
    add(
        "--starts",
        type=whole,
        help="of gradients: the hand given, and others spread over the bounds (default: 1)",
    )
    add(
        "--iterations",
        type=whole,
        default=None,
        help="at most (default: 40 rounds of the model, which ends where it expects no more gain "
        "than --gain; 24 of --front; 44 of the others)",
    )
    add(
        "--gain",
        type=number,
        help="the model's search ends where it expects less, as a share of the score "
        f"(default: {Settings.gain:g})",
    )
    add(
        "--trials",
        dest="trials_each",  # not those of the study: they are for evaluations of one hand
        metavar="TRIALS",
        type=whole,
        default=None,
        help="trials of a hand and direction, an iteration; the model begins with a quarter, and "
        "goes up to twice as many (default: 1000; in three dimensions 100)",
    )
    add(
        "--accept-trials",
        type=whole,
        default=None,
        help="trials of the final comparison of start and result (default: 10000; in three "
        "dimensions 1000)",
    )
    add_experiment(parser)
    add_dt(parser, "the engine's choice")
    add("--json", action="store_true", help="print one JSON object on stdout, nothing else")
    add_outputs(
        parser, data="keep the hand as a study file: .toml", plot="draw hands, history and map"
    )
    add(
        "--checkpoint",
        type=Path,
        default=None,
        metavar="FILE",
        help="keep the state here after each iteration, and go on from it if it is there",
    )
    parser.set_defaults(run=_run)


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(number(part) for part in text.split(","))


def _values_flag(text: str) -> tuple[str, tuple[float, ...]]:
    """A number's name and its values: NAME=V,V,..."""
    name, equals, values = text.partition("=")
    if not name or not equals or not values:
        raise argparse.ArgumentTypeError(f"{text!r} has to be like radius=10,25,40")
    return name, _numbers(values)


def _for_all(study: Study, arguments: argparse.Namespace) -> Study:
    """The study with the objective that the flags ask for; they win over the file's."""
    objective = study.objective
    if arguments.weights is not None and arguments.worst:
        raise ValueError("--weights are for the mean of the scores, and --worst for the worst one")
    if arguments.over:
        over = [(study.full_name(name), values) for name, values in arguments.over]
        for k, (name, _) in enumerate(over):
            if name in dict(over[:k]):
                raise ValueError(f"--over {name} is there twice")
        try:
            objective = Objective(dict(over), worst=objective.worst)
            replace(study, objective=objective).objective_studies()
        except ValueError as error:
            raise ValueError(f"--over {error}") from None
    if arguments.weights is not None:
        try:
            objective = replace(objective, weights=arguments.weights, worst=False)
        except ValueError as error:
            raise ValueError(f"--weights: {error}") from None
    if arguments.worst:
        objective = replace(objective, weights=(), worst=True)
    return replace(study, objective=objective)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_picture(arguments.plot)
    check_data(arguments.out, (".toml",))
    check_writable(arguments.checkpoint)
    method = arguments.method or Settings.method
    gradient = method == "gradient"
    for name, whose in _OF_METHODS.items():
        if getattr(arguments, name) is not None and method != whose:
            flag = name.replace("_", "-")
            raise ValueError(f"--{flag} is for --method {whose}, and this is {method}")
    study = _for_all(condition(arguments), arguments)
    if arguments.plot:
        study.check_drawn()
    free = arguments.free or [(name, None) for name in study.usual_free]
    names = [study.label_of(name) for name, _ in free]
    for (name, _), label in zip(free, names, strict=True):
        if names.count(label) > 1:
            raise ValueError(f"--free {name} is there twice")
    task = task_of(study)
    bounds = dict(zip(names, (bounds for _, bounds in free), strict=True))
    space = study.space(bounds, arguments.clearance, arguments.limit)
    trials, accept_trials = study.trials_of_search
    surrogate = Surrogate(
        task,
        objective=arguments.objective,
        form=arguments.form or Surrogate.form,
        trials=trials if arguments.trials_each is None else arguments.trials_each,
        dt=study.run.dt,
    )
    if arguments.estimator == "pathwise":
        surrogate = replace(surrogate, **_FOR_PATHWISE)
    settings = Settings(
        method=method,
        iterations=arguments.iterations,
        gain=Settings.gain if arguments.gain is None else arguments.gain,
        starts=Settings.starts if arguments.starts is None else arguments.starts,
        accept_trials=accept_trials if arguments.accept_trials is None else arguments.accept_trials,
        seed=study.run.seed,
    )
    (begun,) = starting_designs(space.holding(task), 1, settings.seed)
    for scenario in task.scenarios(space.hand(begun)):
        scenario.check()
    if arguments.front:
        _run_front(arguments, surrogate, space, settings)
        return
    began = time.perf_counter()
    if method == "grid" and arguments.checkpoint is None:
        each = 11 if arguments.grid_points is None else arguments.grid_points
        points = [each] * len(space.free)
        found = search_grid(surrogate, space, settings, points, progress=True)
    else:
        try:
            found = optimize(
                surrogate,
                space,
                settings,
                estimator=_ESTIMATORS[arguments.estimator or "axial"] if gradient else None,
                checkpoint=arguments.checkpoint,
                progress=True,
            )
        except (KeyboardInterrupt, Terminated) as stop:
            if arguments.checkpoint and arguments.checkpoint.exists():
                stop.add_note(f"the state is kept in {arguments.checkpoint}")
                stop.add_note("the same command goes on from there")
            raise
    seconds, conditions = time.perf_counter() - began, study.objective.points()
    if arguments.out:
        save_text(study.designed(space, found.best).to_toml(), arguments.out)
    if arguments.plot:
        save_picture(space.picture, (found, space, surrogate), arguments.plot)
    if arguments.json:
        print(json.dumps(as_json(found, space, conditions, seconds)))
    else:
        print(as_text(found, space, surrogate, conditions, seconds))


def _run_front(
    arguments: argparse.Namespace, surrogate: Surrogate, space: Space, settings: Settings
) -> None:
    """What `--front` asks for."""
    for name, given in (
        ("--method", arguments.method is not None),
        ("--gain", arguments.gain is not None),
        ("--out", arguments.out is not None),
        ("--checkpoint", arguments.checkpoint is not None),
        ("--weights", bool(surrogate.task.weights)),
        ("--worst", surrogate.task.worst),
    ):
        if given:
            raise ValueError(f"{name} is for one best hand, and --front looks for many")
    began = time.perf_counter()
    found = trade_off(surrogate, space, settings, progress=True)
    seconds = time.perf_counter() - began
    if arguments.plot:
        save_picture(space.front_picture, (found, space, surrogate), arguments.plot)
    if arguments.json:

        def member(one: Member) -> dict[str, Any]:
            aims = dict(zip(found.names, map(as_plain, one.aims), strict=True))
            return {"parameters": space.named(one.design), "aims": aims}

        told = {
            "front": list(map(member, found.members)),
            "start": member(found.start) | {"moved": found.moved},
            "undefined": found.undefined,
            "trials": found.trials,
            "invalid": found.invalid,
            "interrupted": found.interrupted,
            "wall_seconds": seconds,
        }
        print(json.dumps(told))
        return
    names = [p.headed(surrogate.task.units) for p in space.free]
    print(f"{found.table(names)}, {seconds:.1f} s")


def as_json(
    found: Optimum, space: Space, conditions: list[dict[str, float]], seconds: float
) -> dict[str, Any]:
    """The result as one JSON object."""

    def side(design: Any, score: Estimate) -> dict[str, Any]:
        return {"parameters": space.named(design), "score": as_plain(score)}

    return {
        "start": side(found.start, found.start_score) | {"moved": found.moved},
        "best": side(found.best, found.best_score),
        "improvement": as_plain(found.improvement),
        "candidates": [
            side(one.design, one.score) | {"behind": as_plain(one.behind)}
            for one in found.candidates
        ],
        "certainty": found.certainty,
        "conditions": [
            {"numbers": condition} | {k: as_plain(v) for k, v in vars(part).items()}
            for condition, part in zip(conditions, found.parts, strict=False)
        ],
        "iterations": found.progress.iteration,
        "trials": found.trials,
        "invalid": found.invalid,
        "refused": dict(found.refused),
        "interrupted": found.interrupted,
        "wall_seconds": seconds,
        "notes": list(found.notes),
    }


def _others(found: Optimum, space: Space) -> list[str]:
    """Where else the search ended, and how sure it is which is the best."""
    others = [one for one in found.candidates if one.design is not found.best]
    if not others:
        return []
    lines = [
        f"another end: {space.describe(one.design)}: {one.score.value:,.4f}, lower by "
        f"{estimate_text(one.behind, ',.4f')} {interval_text(one.behind, ',.4f')}"
        for one in others
    ]
    return [*lines, f"the best is the best of these with a probability of {found.certainty:.0%}"]


def _parts(found: Optimum, conditions: list[dict[str, float]]) -> list[str]:
    """The scores in each of several conditions."""
    return [
        f"{', '.join(f'{name} {value:g}' for name, value in condition.items())}: "
        f"{part.start.value:,.4f} at the start, {part.best.value:,.4f} "
        f"{interval_text(part.best, ',.4f')} at the best"
        for condition, part in zip(conditions, found.parts, strict=False)
    ]


def as_text(
    found: Optimum,
    space: Space,
    surrogate: Surrogate,
    conditions: list[dict[str, float]],
    seconds: float,
) -> str:
    """The result as a table and a verdict."""
    what = ("score " if len(surrogate.task.directions) == 2 else "") + score_name(surrogate)
    names = [p.headed(surrogate.task.units) for p in space.free]
    lines = _parts(found, conditions)
    lines += _others(found, space)
    rounds = f"{found.progress.iteration} iterations, " if found.progress.history else ""
    if found.invalid:
        lines.append(
            f"{found.invalid:,} {'trial' if found.invalid == 1 else 'trials'} went wrong with some "
            "hand, left out of all its comparisons"
        )
    lines += refused_text(found.refused)
    stop = "interrupted after " if found.interrupted else ""
    lines.append(f"{stop}{rounds}{found.trials:,} trials, {seconds:.1f} s")
    return "\n".join([found.table(names, what), *map(wrapped, lines)])
