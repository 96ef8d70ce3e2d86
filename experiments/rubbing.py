"""The figures that the paper's claims rest on under the reading `rubbing`, beside the literal ones,
and how Fig. 9(b) moves with friction.

Each figure is kept in `results/rubbing/` when it is done, so a run that was interrupted goes on
where it was; then `results/rubbing.png` shows both readings. The literal ones are those of
`fig09.py` to `fig17.py`. The seed is one that the search for the reading did not use.

Then Fig. 9(b)'s curves for W_g = 0.6 and 0.8 L_p, and Fig. 9(a)'s index 2 about its dip, with that
reading's gravity, for several coefficients of friction and circles that turn or do not; kept in
`results/friction.csv` and drawn as `results/friction.png`.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.readings import Row, kept, numbers, rows_of, save
from pcjax.model.presets import box_hand
from pcjax.model.scenario import does
from pcjax.paper import constants as paper
from pcjax.paper.claims import FIGURES_NEEDED, judge_claims
from pcjax.paper.figures import Curve, curve, run_figure, score_curve
from pcjax.paper.readings import LITERAL, READINGS, RUBBING
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.study.evaluate import evaluate_grid

RESULTS = Path(__file__).parent / "results"
FOLDERS = {LITERAL.name: RESULTS, RUBBING.name: RESULTS / RUBBING.name}
FRICTIONS = (
    *((mu, False) for mu in (0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5)),
    *((mu, True) for mu in (0.1, 0.3, 0.5)),
)
"""Friction, and whether the circle turns; without friction it never does."""
FRICTION_PARTS = ((0.4, range(30, 51, 5)), (0.6, range(0, 81, 5)), (0.8, range(0, 81, 5)))
"""W_g / L_p, theta_g in degrees: index 2 about its dip, and index 1."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=paper.TRIALS)
    parser.add_argument("--friction-trials", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    folder = FOLDERS[RUBBING.name]
    folder.mkdir(exist_ok=True)
    for name in FIGURES_NEEDED:
        path = folder / f"fig{name}.nc"
        run = {"trials": arguments.trials, "seed": arguments.seed}
        if not path.exists() or not run.items() <= load_dataset(path).attrs.items():
            data = run_figure(name, RUBBING, **run, progress=True)
            save_dataset(data, path)
            print(f"Fig. {name}: {data.attrs['wall_seconds']:.0f} s", flush=True)
    kept = {
        reading: {name: load_dataset(folder / f"fig{name}.nc") for name in FIGURES_NEEDED}
        for reading, folder in FOLDERS.items()
    }
    for claim in judge_claims(kept[RUBBING.name]):
        print(claim)
    draw(kept).savefig(RESULTS / "rubbing.png", dpi=110)
    rows = with_friction(RESULTS / "friction.csv", arguments.friction_trials, arguments.seed)
    draw_friction(rows).savefig(RESULTS / "friction.png", dpi=110)


def draw(kept: dict[str, dict[str, xr.Dataset]]) -> Figure:
    """A row for each reading: Figs. 9(a), 9(b), 10, 11 and 12, with 95 % bands."""
    figure = Figure(figsize=(17, 7.4), layout="constrained")
    rows = figure.subplots(2, 5, sharex="col")
    for axes, (reading, figures) in zip(rows, kept.items(), strict=True):
        narrow, wide, grid = (figures[name] for name in ("9a", "9b", "12"))
        band(axes[0], curve(narrow, "does", "index2"), COLOURS[0], "index 2", 1.0)
        says = str(READINGS[reading]).replace(", circles", ",\ncircles")
        axes[0].set_ylabel(f"{reading}: {says}", fontsize=9)
        for gap_width, colour, stated in zip(
            paper.GAP_WIDTHS, COLOURS, (None, 40.0, 50.0), strict=False
        ):
            line = curve(wide, "does", where={"gap_width": gap_width})
            band(axes[1], line, colour, f"$W_g$ = {gap_width:g} $L_p$", 1e-3)
            if stated is not None:
                axes[1].axvline(stated, color=colour, ls=":", lw=1)
        for radius, colour in zip(paper.RADII, COLOURS, strict=False):
            where, label = {"radius": radius}, f"$r_o$ = {radius:g} $L_p$"
            band(axes[2], curve(grid, "does", where=where), colour, label, 1e-3)
            band(axes[3], curve(grid, "eoen", where=where), colour, label, 1e-3)
            band(axes[4], score_curve(grid, where), colour, label, 1.0)
        for axis in axes[1:4]:
            axis.set_ylabel("index 1 [thousand steps]", fontsize=9)
            axis.set_ylim(0, None)
        for axis in axes:
            axis.grid(alpha=0.3)
    titles = (
        "Fig. 9(a): index 2, $W_g$ = 0.4 $L_p$",
        "Fig. 9(b): DoEs (dotted: the paper's peaks)",
        "Fig. 10: DoEs",
        "Fig. 11: EoEn",
        "Fig. 12: score",
    )
    for axis, title in zip(rows[0], titles, strict=True):
        axis.set_title(title, fontsize=10)
        axis.legend(fontsize=8)
    for axis in rows[1]:
        axis.set_xlabel(r"$\theta_g$ [deg]")
    return figure


def with_friction(path: Path, trials: int, seed: int) -> list[Row]:
    """The curves for each friction, those that are missing run anew."""
    made = {"trials": str(trials), "seed": str(seed)}
    rows = [row for row in kept(path) if made.items() <= row.items()]
    known = {(row["friction"], row["turning"]) for row in rows}
    keys = [(gap_width, float(angle)) for gap_width, angles in FRICTION_PARTS for angle in angles]
    for friction, turning in FRICTIONS:
        what = {"friction": f"{friction:g}", "turning": str(int(turning))}
        if tuple(what.values()) in known:
            continue
        reading = replace(RUBBING, friction=friction, turning=turning)
        unit = paper.WRIST_PALM_LENGTH
        hands = [
            box_hand(math.radians(angle), palm_length=unit, gap_width=gap_width * unit)
            for gap_width, angle in keys
        ]
        body, drive, law = reading.circle(0.01 * unit), reading.wrist(), reading.law()
        labels = dict(zip(("gap_width", "angle"), zip(*keys, strict=True), strict=True))
        data = evaluate_grid(
            [does(hand, body, drive, law) for hand in hands],
            {"direction": ["does"] * len(keys)} | labels,
            trials=trials,
            max_steps=paper.WRIST_MAX_STEPS,
            seed=seed,
            progress=True,
        )
        for (gap_width, _), of in zip(FRICTION_PARTS, ("index2", "index1", "index1"), strict=True):
            line = curve(data, "does", of, {"gap_width": gap_width})
            rows += [
                what | {"gap_width": f"{gap_width:g}", "of": of} | row | made
                for row in rows_of(line)
            ]
        save(rows, path)
        print(f"{reading}: {data.attrs['wall_seconds']:.0f} s", flush=True)
    return rows


def draw_friction(rows: Sequence[Row]) -> Figure:
    """Index 1 over theta_g for each friction; and where it is highest."""
    figure = Figure(figsize=(15, 8.4), layout="constrained")
    curves = figure.subplots(2, 3)
    values = list(dict.fromkeys(friction for friction, _ in FRICTIONS))
    shade = dict(zip(values, colormaps["viridis"](np.linspace(0, 0.92, len(values))), strict=True))
    for axes, turning in zip(curves, (False, True), strict=True):
        for axis, gap_width, stated in zip(axes, ("0.6", "0.8"), (40.0, 50.0), strict=False):
            for friction, turns in FRICTIONS:
                mine = [
                    row
                    for row in rows
                    if (row["friction"], row["turning"], row["gap_width"])
                    == (f"{friction:g}", str(int(turns)), gap_width)
                ]
                if not mine or (turns != turning and friction > 0):
                    continue
                angle, value, se = numbers(mine, "angle_deg", "estimate", "se")
                axis.plot(angle, value / 1e3, color=shade[friction], label=f"{friction:g}")
                low, high = ((value + k * 1.96 * se) / 1e3 for k in (-1, 1))
                axis.fill_between(angle, low, high, color=shade[friction], alpha=0.25, lw=0)
                place, *reach = numbers(mine, "peak_deg", "peak_low_deg", "peak_high_deg")[:, 0]
                spread = [[place - reach[0]], [reach[1] - place]]
                style = {"fmt": "D", "color": shade[friction], "capsize": 3}
                axes[2].errorbar(
                    place,
                    friction + (0.006 if gap_width == "0.8" else -0.006),
                    xerr=spread,
                    mfc=shade[friction] if gap_width == "0.8" else "white",
                    **style,
                )
            axis.axvline(stated, color="0.5", ls=":")
            circles = "turns" if turning else "does not turn"
            axis.set_title(f"$W_g$ = {gap_width} $L_p$, the circle {circles}", fontsize=10)
            axis.set(xlabel=r"$\theta_g$ [deg]", ylabel="index 1 [thousand steps]")
            axis.grid(alpha=0.3)
        axes[0].legend(title="friction", fontsize=8)
        axes[2].set(xlabel=r"highest at $\theta_g$ [deg]", ylabel="friction", xlim=(-5, 85))
        axes[2].set_title("hollow: $W_g$ = 0.6, full: 0.8 $L_p$; 95 % intervals", fontsize=10)
        axes[2].grid(alpha=0.3)
    return figure


def band(axis: Axes, line: Curve, colour: str, label: str, scale: float) -> None:
    """A curve where the object fits through the gap."""
    line = line.only(line.open)
    value, reach = line.value * scale, 1.96 * line.se * scale
    axis.plot(line.angle, value, "o-", ms=3, lw=1, color=colour, label=label)
    axis.fill_between(line.angle, value - reach, value + reach, color=colour, alpha=0.25, lw=0)


if __name__ == "__main__":
    main()
