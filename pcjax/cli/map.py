"""`pcjax map`: the score over two parameters of a hand, or other numbers of a study."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pcjax.cli.condition import (
    PARAMETERS,
    add_condition,
    condition,
    parameter_flag,
)
from pcjax.cli.parts import (
    add_experiment,
    add_outputs,
    check_data,
    check_picture,
    save_picture,
    settle_outputs,
    whole,
)
from pcjax.design.map import MapPlan, Number, Side
from pcjax.importing import xr
from pcjax.quality.indices import Estimate
from pcjax.quality.surrogate import OBJECTIVES, Surrogate
from pcjax.results.map_csv import map_as_csv
from pcjax.results.saving import save_dataset, save_text
from pcjax.results.schema import length_unit_of, place_of
from pcjax.results.tables import estimate_text, in_columns, wrapped
from pcjax.study.evaluate import as_attribute
from pcjax.study.spec import Objective, Study
from pcjax.study.task import task_of
from pcjax.study.vary import names
from pcjax.units import with_unit

_DATA = (".nc", ".csv")


def add_map(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add = parser.add_argument
    for side, which, more in (
        (
            "x",
            0,
            f": {PARAMETERS}; or of the object, the drive or the contact, such as radius=10:40",
        ),
        ("y", 1, "; as for --x"),
    ):
        wrist, arm = (("fingertip-angle", "joint-angle-1"), ("fingertip-length", "joint-angle-2"))[
            which
        ]
        add(
            f"--{side}",
            type=parameter_flag,
            default=None,
            metavar="NAME[=LOW:HIGH]",
            help=f"the parameter along {side}, with bounds in degrees or lengths{more} "
            f"(default: {wrist}, on the arm {arm})",
        )
    add(
        "--points",
        type=whole,
        nargs=2,
        default=(11, 11),
        metavar=("NX", "NY"),
        help="hands along each side",
    )
    add(
        "--trials",
        dest="trials_each",  # not those of the study: they are for evaluations of one hand
        metavar="TRIALS",
        type=whole,
        default=None,
        help="trials of each hand and direction (default: 400; in three dimensions 100)",
    )
    add(
        "--objective",
        choices=OBJECTIVES,
        default="index1",
        help="what the score is made of; escape_rate has no step limit in it",
    )
    add_experiment(parser)
    add("--json", action="store_true", help="print one JSON object on stdout, nothing else")
    add_outputs(
        parser,
        data="keep the data: .nc or .csv",
        plot="the picture",
        plot_default=Path("map.png"),
        before={"out": "plot", "data": "out"},
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    settle_outputs(arguments)
    check_picture(arguments.plot)
    check_data(arguments.out, _DATA)
    study = replace(condition(arguments), objective=Objective())  # that of one best hand
    asked = _asked(study, arguments)
    sides = [_side(study, name, bounds) for name, bounds in asked]
    if sides[0].label == sides[1].label:
        raise ValueError(f"--x and --y are both {sides[0].label}: they have to differ")
    space = study.map_space([side for side in sides if not isinstance(side, Number)])
    trials = study.trials_of_map if arguments.trials_each is None else arguments.trials_each
    surrogate = Surrogate(
        task_of(study),
        objective=arguments.objective,
        form="exact",
        trials=trials,
        dt=study.run.dt,
    )
    plan = MapPlan.of(
        surrogate,
        space,
        arguments.points,
        seed=study.run.seed,
        sides=sides,
        task_at=lambda values: task_of(study.having(values)),
    )
    task = plan.task
    print(
        f"{plan.hands:,} of {math.prod(arguments.points):,} hands have a score; each with "
        f"{surrogate.trials:,} trials in {' and '.join(task.directions)}: "
        f"{plan.hands * len(task.directions) * surrogate.trials:,} trials",
        file=sys.stderr,
    )
    as_run = replace(study, run=replace(study.run, trials=surrogate.trials), sweep=None)
    data = plan.run(progress=True).assign_attrs(as_attribute(as_run))
    if arguments.out:
        if arguments.out.suffix.lower() == ".csv":
            save_text(map_as_csv(data), arguments.out)
        else:
            save_dataset(data, arguments.out)
    save_picture("view.designs.plot_map", data, arguments.plot)
    if arguments.json:
        print(json.dumps(as_json(data, [side.label for side in sides])))
    else:
        print(map_text(data))
        print(f"{data.attrs['wall_seconds']:.1f} s; picture: {arguments.plot}")


Asked = tuple[str, tuple[float, float] | None]
"""A name and its bounds, where they are given."""


def _asked(study: Study, arguments: argparse.Namespace) -> tuple[Asked, Asked]:
    """What is along x and y."""
    sides: list[Asked | None] = [arguments.x, arguments.y]
    for k, flag in enumerate(("--x", "--y")):
        if sides[k] is None:
            usual = study.usual_free
            if len(usual) <= k:
                raise ValueError(f"say what is along {flag}: the study's posture names one joint")
            sides[k] = usual[k], None
    x, y = sides
    assert x is not None
    assert y is not None
    return x, y


def _side(study: Study, name: str, bounds: tuple[float, float] | None) -> Side:
    """What is along a side: a parameter of the hand, or a number of the study's."""
    known = names(study.components)
    label = study.label_of(name)
    if label != "start_spread" and label not in known:
        return study.parameter(label, bounds)
    if label == "start_spread":
        current: float | None = study.run.start_spread
    else:
        table, what = known[label]
        current = what.to_file(getattr(study.components[table], what.name))
    if not isinstance(current, (int, float)):  # none, such as a friction, or a word
        current = math.nan
    if bounds is None:
        if not current > 0:
            raise ValueError(f"{name} needs bounds, such as {name}=0:0.5")
        bounds = 0.5 * current, 1.5 * current
    low, high = bounds
    if not low < high:
        raise ValueError(f"{name} is free from {low:g} to {high:g}: the bounds are out of order")
    for value in bounds:
        if study.having({label: value}).hand is not study.hand:
            raise ValueError(
                f"a map cannot have {name} along a side: it says how the hand is used; take a "
                "number of the object, the drive or the contact"
            )
    return Number(label, low, high, current, study.unit_of(label))


def as_json(data: xr.Dataset, labels: Sequence[str]) -> dict[str, Any]:
    """The map as one JSON object; what has no score is null."""

    def plain(values: Any) -> Any:
        if isinstance(values, list):
            return [plain(value) for value in values]
        return values if math.isfinite(values) else None

    best, attrs, estimates = _best(data), data.attrs, data.score.isel(index=0)
    current = None
    if "current_score" in attrs:
        current = {
            "parameters": {label: attrs[f"current_{label}"] for label in labels},
            "score": {"value": plain(attrs["current_score"]), "se": plain(attrs["current_se"])},
        }
    return {
        **{
            side: {"parameter": label, "values": data[label].values.tolist()}
            for side, label in zip("xy", labels, strict=True)
        },
        **{
            name: plain(estimates.sel(statistic=of).values.tolist())
            for name, of in (("score", "value"), ("se", "se"))
        },
        "gap": plain(data.gap.values.tolist()),
        **{name: data[name].values.tolist() for name in ("full_cage", "possible")},
        "best": {
            "parameters": {label: float(best[label]) for label in labels},
            "score": {"value": float(best[0]), "se": float(best[1])},
        },
        "current": current,
        "hands": attrs["hands"],
        "trials": attrs["trials"],
        "invalid": attrs["invalid"],
        "seed": attrs["seed"],
        "wall_seconds": attrs["wall_seconds"],
    }


def map_text(data: xr.Dataset) -> str:
    """The best hand of a map and the current one."""
    best, attrs = _best(data), data.attrs
    labels = [str(name) for name in reversed(place_of(data))]
    units = length_unit_of(data)

    def one(name: str, value: float) -> str:
        if name.endswith("_deg"):
            return f"{name[:-4]} {value:.4g} deg"
        unit = data[name].attrs.get("units")  # of what is no length of the hand
        told = "" if unit in (None, "1") else f" {'deg' if unit == 'degree' else unit}"
        return f"{name} {value:.4g}{told}" if unit else f"{name} {with_unit(value, units)}"

    def place(values: Sequence[float]) -> str:
        return ", ".join(map(one, labels, values))

    rows = [["best", _score_text(*best.values[:2]), place([float(best[name]) for name in labels])]]
    if "current_score" in attrs:
        score = _score_text(attrs["current_score"], attrs["current_se"])
        rows.append(["current", score, place([attrs[f"current_{name}"] for name in labels])])
    heads = [f"of {attrs['hands']:,} hands", attrs["score_name"], "at"]
    text = in_columns(heads, rows, left=[0, 2])
    if "current_score" in attrs:
        return text
    missing = (
        "the current hand is not on the map: it is outside the bounds, or its fingers differ in a "
        "parameter that is for both"
        if "parameters" in attrs
        else "a .csv says neither what was scored nor how: a map's .nc does"
    )
    return f"{text}\n{wrapped(missing)}"


def _score_text(value: float, se: float) -> str:
    if not math.isfinite(value):
        return "no score"
    return estimate_text(Estimate(value, se, math.nan, math.nan), ",.4f")


def _best(data: xr.Dataset) -> xr.DataArray:
    """The estimate of the hand with the highest score, labelled by its parameters."""
    score = data.score.isel(index=0)
    value = score.sel(statistic="value")
    return score.isel(value.reset_coords(drop=True).argmax(list(value.dims)))  # pyright: ignore
