"""How the paper's hand holds things with a shape, and what friction does.

Five parts, each kept in `results/shapes_PART.nc` when it is done, so that an interrupted run goes
on where it was (`--again` runs all of them anew):

- size: a square and a stick of several sizes, at theta_g = 10 deg;
- orientation: the same by their angle at the start;
- friction_circle, friction_square: each for several mu;
- angle: squares as wide as the circles of Figs. 10 to 12, against theta_g.

Then it draws `results/shapes_PART.png`.
"""

from __future__ import annotations

import argparse
import functools
import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.convex import Square
from pcjax.model.bodies.stick import Stick
from pcjax.model.contact import ContactLaw
from pcjax.model.presets import box_hand
from pcjax.model.scenario import DIRECTIONS
from pcjax.paper import constants as paper
from pcjax.paper.figures import curve, score_curve
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.study.evaluate import evaluate_grid

RESULTS = Path(__file__).parent / "results"
UNIT = paper.WRIST_PALM_LENGTH
SIZES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.25)
"""Side of the square, length of the stick, in L_p."""

Row = tuple[str, float, Body, float, float]
"""A series, what varies, the body, theta_g in degrees, and mu."""


def _size() -> list[Row]:
    return [
        row
        for size in SIZES
        for row in (
            ("square", size, Square(size * UNIT), 10.0, 0.0),
            ("stick", size, Stick(size * UNIT / 2), 10.0, 0.0),
        )
    ]


def _orientation() -> list[Row]:
    return [
        (name, float(angle), body, 10.0, 0.0)
        for angle in range(0, 91, 15)
        for name, body in (
            ("square", Square(side=0.1 * UNIT, orientation=math.radians(angle))),
            ("stick", Stick(0.1 * UNIT, orientation=math.radians(angle))),
        )
    ]


def _friction(name: str, body: Body) -> list[Row]:
    return [(name, mu, body, 10.0, mu) for mu in (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.8)]


def _angle() -> list[Row]:
    return [
        (f"square of side {2 * radius:g} $L_p$", float(angle), Square(2 * radius * UNIT), angle, 0)
        for radius in paper.FIGURES["12"].radii
        for angle in paper.FIGURES["12"].angles_deg
    ]


PARTS = {
    "size": (_size, "side, or length, / $L_p$"),
    "orientation": (_orientation, "orientation at the start [degrees]"),
    "friction_circle": (
        functools.partial(_friction, "circle", Circle(0.05 * UNIT)),
        "friction $\\mu$",
    ),
    "friction_square": (
        functools.partial(_friction, "square", Square(0.1 * UNIT)),
        "friction $\\mu$",
    ),
    "angle": (_angle, "$\\theta_g$ [degrees]"),
}


def evaluated(rows: Sequence[Row], **settings: Any) -> xr.Dataset:
    """DoEs and EoEn of some rows."""
    keys = list(product(rows, ("does", "eoen")))
    scenarios = [
        DIRECTIONS[direction](
            box_hand(
                math.radians(theta),
                palm_length=UNIT,
                gap_width=0.4 * UNIT,
                fingertip_length=paper.FINGERTIP_LENGTH * UNIT,
            ),
            body,
            law=ContactLaw(friction=mu),
        )
        for (_, _, body, theta, mu), direction in keys
    ]
    coords = {
        "series": [row[0] for row, _ in keys],
        "angle": [row[1] for row, _ in keys],
        "direction": [direction for _, direction in keys],
    }
    return evaluate_grid(scenarios, coords, engine="convex", progress=True, **settings)


def draw(data: xr.Dataset, label: str, path: Path) -> None:
    """Index 1, index 2 and the score, with 95 % intervals."""
    figure = Figure((11, 3.6), layout="constrained")
    axes: list[Axes] = list(figure.subplots(1, 3))
    for k, name in enumerate(dict.fromkeys(data.series.values.tolist())):
        of = {"series": name}
        for direction, style in (("does", "-"), ("eoen", "--")):
            for axis, index, scale in ((axes[0], "index1", 1e-3), (axes[1], "index2", 1.0)):
                line = curve(data, direction, index, of)
                what = name if direction == "does" else None
                axis.errorbar(
                    line.angle,
                    scale * line.value,
                    1.96 * scale * line.se,
                    color=f"C{k}",
                    linestyle=style,
                    label=what,
                    capsize=2,
                )
        line = score_curve(data, of)
        axes[2].errorbar(line.angle, line.value, 1.96 * line.se, color=f"C{k}", capsize=2)
    axes[0].set_ylabel("index 1 [thousand steps]")
    axes[1].set_ylabel("index 2 [share of trials]")
    axes[2].set_ylabel("score DoEs / EoEn, by index 1")
    for axis in axes:
        axis.set_xlabel(label)
        axis.grid(alpha=0.3)
    axes[0].plot([], [], "k-", label="DoEs")
    axes[0].plot([], [], "k--", label="EoEn")
    axes[0].legend(fontsize="small")
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--trials", type=int, default=1000, help="for each condition and direction")
    add("--max-steps", type=int, default=paper.WRIST_MAX_STEPS, help="limit")
    add("--seed", type=int, default=0)
    add("--part", choices=PARTS, action="append", help="only this one; may be repeated")
    add("--again", action="store_true", help="run parts that are kept, too")
    args = parser.parse_args()
    for name in args.part or PARTS:
        rows, label = PARTS[name]
        kept = RESULTS / f"shapes_{name}.nc"
        if args.again or not kept.exists():
            data = evaluated(rows(), trials=args.trials, max_steps=args.max_steps, seed=args.seed)
            save_dataset(data, kept)
        draw(load_dataset(kept), label, RESULTS / f"shapes_{name}.png")


if __name__ == "__main__":
    main()
