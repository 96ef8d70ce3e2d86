"""`pcjax map`: the score over two parameters of a hand."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from pcjax.cli.condition import (
    add_condition,
    condition,
    parameter_flag,
    task_of,
    usual_parameters,
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
from pcjax.design.map import MapPlan
from pcjax.design.space import HELP, DesignSpace, design_space
from pcjax.quality.surrogate import OBJECTIVES, Surrogate
from pcjax.results.saving import save_dataset, save_text

_DATA = (".nc", ".csv")


def add_map(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add = parser.add_argument
    for side, which, more in (("x", 0, f": {HELP}"), ("y", 1, "; as for --x")):
        wrist, arm = (("fingertip-angle", "joint-angle-1"), ("fingertip-length", "joint-angle-2"))[
            which
        ]
        add(
            f"--{side}",
            type=parameter_flag,
            default=None,
            metavar="NAME[=LOW:HIGH]",
            help=f"the parameter along {side}, with bounds in degrees or model lengths{more} "
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
        default=400,
        help="trials of each hand and direction",
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
    study = condition(arguments)
    sides = [
        (name.replace("-", "_"), bounds)
        for name, bounds in (
            given or (usual, None)
            for given, usual in zip(
                (arguments.x, arguments.y), usual_parameters(study), strict=True
            )
        )
    ]
    if len(dict(sides)) < 2:
        raise ValueError(f"--x and --y are both {sides[0][0]}: they have to differ")
    space = design_space(
        study.hand, dict(sides), float(study.body.width), 0.0, (), study.directions
    )
    task = task_of(study)
    surrogate = Surrogate(
        task,
        objective=arguments.objective,
        form="exact",
        trials=arguments.trials_each,
        dt=study.run.dt,
    )
    plan = MapPlan.of(surrogate, space, arguments.points, seed=study.run.seed)
    print(
        f"{plan.hands:,} of {math.prod(arguments.points):,} hands have a score; each with "
        f"{surrogate.trials:,} trials in {' and '.join(task.directions)}: "
        f"{plan.hands * len(task.directions) * surrogate.trials:,} trials",
        file=sys.stderr,
    )
    data = plan.run(progress=True)
    if arguments.out:
        if arguments.out.suffix.lower() == ".csv":
            coarse = data[["score", "se", "gap", "full_cage", "possible"]]
            save_text(coarse.to_dataframe().to_csv(), arguments.out)
        else:
            save_dataset(data, arguments.out)
    save_picture("view.designs.plot_map", data, arguments.plot)
    if arguments.json:
        print(json.dumps(as_json(data, space)))
    else:
        print(map_text(data))
        print(f"{data.attrs['wall_seconds']:.1f} s; picture: {arguments.plot}")


def as_json(data: xr.Dataset, space: DesignSpace) -> dict[str, Any]:
    """The map as one JSON object; what has no score is null."""

    def plain(values: Any) -> Any:
        if isinstance(values, list):
            return [plain(value) for value in values]
        return values if math.isfinite(values) else None

    x, y = space.free
    best, attrs = _best(data), data.attrs
    current = None
    if "current_score" in attrs:
        current = {
            "parameters": {p.label: attrs[f"current_{p.label}"] for p in space.free},
            "score": {"value": plain(attrs["current_score"]), "se": plain(attrs["current_se"])},
        }
    return {
        **{
            side: {"parameter": p.label, "values": data[p.label].values.tolist()}
            for side, p in (("x", x), ("y", y))
        },
        **{name: plain(data[name].values.tolist()) for name in ("score", "se", "gap")},
        **{name: data[name].values.tolist() for name in ("full_cage", "possible")},
        "best": {
            "parameters": {p.label: float(best[p.label]) for p in space.free},
            "score": {"value": float(best.score), "se": float(best.se)},
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
    names = [str(name) for name in reversed(data.score.dims)]

    def place(values: Sequence[float]) -> str:
        return ", ".join(
            f"{name.removesuffix('_deg')} {value:.4g}{' deg' if name.endswith('_deg') else ''}"
            for name, value in zip(names, values, strict=True)
        )

    lines = [
        f"{attrs['score_name']}, of {attrs['hands']:,} hands:",
        f"best     {float(best.score):,.4f} ± {float(best.se):.4f}  at "
        f"{place([float(best[name]) for name in names])}",
    ]
    if "current_score" not in attrs:
        lines.append(
            "the current hand is not on the map: it is outside the bounds, or its fingers differ "
            "in a parameter that is for both"
        )
        return "\n".join(lines)
    value, se = attrs["current_score"], attrs["current_se"]
    score = f"{value:,.4f} ± {se:.4f}" if math.isfinite(value) else "no score"
    lines.append(f"current  {score}  at {place([attrs[f'current_{name}'] for name in names])}")
    return "\n".join(lines)


def _best(data: xr.Dataset) -> xr.Dataset:
    return data.isel(data.score.argmax(list(data.score.dims)))  # pyright: ignore
