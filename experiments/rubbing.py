"""The figures that the paper's claims rest on under the reading `rubbing`, beside the literal ones.

Each figure is kept in `results/rubbing/` when it is done, so a run that was interrupted goes on
where it was; then `results/rubbing.png` shows both readings. The literal ones are those of
`fig09.py` to `fig17.py`. The seed is one that the search for the reading did not use.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pcjax.paper import constants as paper
from pcjax.paper.claims import FIGURES_NEEDED, judge_claims
from pcjax.paper.figures import Curve, curve, run_figure, score_curve
from pcjax.paper.readings import LITERAL, READINGS, RUBBING
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset

RESULTS = Path(__file__).parent / "results"
FOLDERS = {LITERAL.name: RESULTS, RUBBING.name: RESULTS / RUBBING.name}
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=paper.TRIALS)
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


def draw(kept: dict[str, dict[str, xr.Dataset]]) -> Figure:
    """A row for each reading: Figs. 9(a), 9(b), 10, 11 and 12, with 95 % bands."""
    figure = Figure(figsize=(17, 7.4), layout="constrained")
    rows = figure.subplots(2, 5, sharex="col")
    for axes, (reading, figures) in zip(rows, kept.items(), strict=True):
        narrow, wide, grid = (figures[name] for name in ("9a", "9b", "12"))
        band(axes[0], curve(narrow, "does", "index2"), COLOURS[0], "index 2", 1.0)
        axes[0].set_ylabel(f"{reading}: {READINGS[reading]}", fontsize=9)
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


def band(axis: Axes, line: Curve, colour: str, label: str, scale: float) -> None:
    """A curve where the object fits through the gap."""
    line = line.only(line.open)
    value, reach = line.value * scale, 1.96 * line.se * scale
    axis.plot(line.angle, value, "o-", ms=3, lw=1, color=colour, label=label)
    axis.fill_between(line.angle, value - reach, value + reach, color=colour, alpha=0.25, lw=0)


if __name__ == "__main__":
    main()
