"""`pcjax map`: the score over two parameters of a hand."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pcjax.cli.condition import (
    add_condition,
    condition,
    parameter_flag,
    task_of,
    usual_parameters,
)
from pcjax.cli.parts import add_experiment, check_picture, check_writable, save_picture, whole
from pcjax.design.score_map import MapPlan, score_name
from pcjax.design.space import HELP, DesignSpace, design_space
from pcjax.quality.surrogate import OBJECTIVES, Surrogate
from pcjax.results import save_dataset, save_text

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
    add("--trials", type=whole, default=400, help="trials of each hand and direction")
    add(
        "--objective",
        choices=OBJECTIVES,
        default="index1",
        help="what the score is made of; escape_rate has no step limit in it",
    )
    add_experiment(parser)
    add("--json", action="store_true", help="print one JSON object on stdout, nothing else")
    add("--out", type=Path, default=Path("map.png"), metavar="FILE", help="the picture")
    add("--data", type=Path, default=None, metavar="FILE", help="keep the data: .nc or .csv")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    check_picture(arguments.out)
    check_writable(arguments.data)
    if arguments.data and arguments.data.suffix.lower() not in _DATA:
        raise ValueError(
            f"cannot keep {arguments.data}: its ending has to be one of {', '.join(_DATA)}"
        )
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
        task, objective=arguments.objective, form="exact", trials=arguments.trials, dt=study.run.dt
    )
    plan = MapPlan.of(surrogate, space, arguments.points, seed=study.run.seed)
    print(
        f"{plan.hands:,} of {math.prod(arguments.points):,} hands have a score; each with "
        f"{surrogate.trials:,} trials in {' and '.join(task.directions)}: "
        f"{plan.hands * len(task.directions) * surrogate.trials:,} trials",
        file=sys.stderr,
    )
    data = plan.run(progress=True)
    if arguments.data:
        if arguments.data.suffix.lower() == ".csv":
            save_text(data.to_dataframe().to_csv(), arguments.data)
        else:
            save_dataset(data, arguments.data)
    save_picture("plot_map", (data, space, surrogate), arguments.out)
    if arguments.json:
        print(json.dumps(as_json(data, space)))
    else:
        print(as_text(data, space, surrogate))
        print(f"{data.attrs['wall_seconds']:.1f} s; picture: {arguments.out}")


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


def as_text(data: xr.Dataset, space: DesignSpace, surrogate: Surrogate) -> str:
    """The best hand and the current one."""
    best, attrs = _best(data), data.attrs
    lines = [f"{score_name(surrogate)}, of {attrs['hands']:,} hands:"]
    at = np.array([float(best[p.label]) for p in space.free])
    lines.append(
        f"best     {float(best.score):,.4f} ± {float(best.se):.4f}  at {space.describe(at)}"
    )
    if "current_score" not in attrs:
        lines.append(
            "the current hand is not on the map: it is outside the bounds, or its fingers differ "
            "in a parameter that is for both"
        )
        return "\n".join(lines)
    value, se = attrs["current_score"], attrs["current_se"]
    score = f"{value:,.4f} ± {se:.4f}" if math.isfinite(value) else "no score"
    lines.append(f"current  {score}  at {space.describe(space.design_of(space.base))}")
    return "\n".join(lines)


def _best(data: xr.Dataset) -> xr.Dataset:
    return data.isel(data.score.argmax(list(data.score.dims)))  # pyright: ignore
