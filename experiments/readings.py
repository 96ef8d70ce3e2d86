"""How the claims that hold in part move with our readings of the model and with the step limit.

One reading at a time is changed from its default; then come, over theta_g, Fig. 9(b)'s index 1
(claim 3), Fig. 9(a)'s index 2 (claim 2) and Fig. 12's score at r_o = 0.1 L_p (claim 6). Last, the
score at r_o = 0.05 L_p for several step limits and for none, all from one run at the highest.

Keeps `results/readings.csv` and draws `results/readings.png`. Each reading is kept when it is done,
so a run that was interrupted goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand
from pcjax.model.scenario import DIRECTIONS, Scenario
from pcjax.paper import constants as paper
from pcjax.paper.figures import Curve, curve, score_curve
from pcjax.physics.state import INVALID
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.study.evaluate import evaluate_grid

DEFAULTS = {"start spread": 0.1, "ramp": 1.0, "restitution": 0.1, "gravity": 9.8}
READINGS = {
    "start spread": (0.0, 0.1, 0.3, 0.5),  # L_p
    "ramp": (0.1, 1.0, 5.0, 10.0),  # s, of a period of 10 s
    "restitution": (0.0, 0.1, 0.6, 0.9),
    "gravity": (9.8, 98.0, 980.0, 9800.0),  # length / s^2; small steps, so last
}
UNITS = {
    "start spread": "start spread [$L_p$]",
    "ramp": "ramp of each 10 s [s]",
    "restitution": "restitution $e_r$",
    "gravity": "gravity [length/s²]",
}

PARTS = (
    (0.4, 0.01, ("does",), range(20, 61, 5)),
    (0.6, 0.01, ("does",), range(0, 81, 10)),
    (0.8, 0.01, ("does",), range(0, 81, 10)),
    (0.4, 0.1, ("does", "eoen"), range(-10, 26, 5)),
)
"""W_g / L_p, r_o / L_p, directions, theta_g in degrees; the gap is open at all of them."""

CURVES: dict[str, Callable[[xr.Dataset], Curve]] = {
    "index 1, W_g = 0.6": lambda data: curve(data, "does", where={"gap_width": 0.6}),
    "index 1, W_g = 0.8": lambda data: curve(data, "does", where={"gap_width": 0.8}),
    "index 2, W_g = 0.4": lambda data: curve(
        data, "does", "index2", {"gap_width": 0.4, "radius": 0.01}
    ),
    "score, r_o = 0.1": lambda data: score_curve(data, {"radius": 0.1}),
}
PANELS = (
    ("Fig. 9(b), $W_g$ = 0.6 $L_p$", "index 1 [thousand steps]", 40.0),
    ("Fig. 9(b), $W_g$ = 0.8 $L_p$", "index 1 [thousand steps]", 50.0),
    ("Fig. 9(a), $W_g$ = 0.4 $L_p$", "index 2 [share of trials]", 40.0),
    ("Fig. 12, $r_o$ = 0.1 $L_p$", "score DoEs / EoEn", 10.0),
)
"""For each curve its title, what it shows, and where the paper's peak is (of index 2: the dip)."""

LIMITS = (100_000, 300_000, 600_000, 1_000_000, 3_000_000, 10_000_000)
LIMIT_ANGLES = (-20, -10, 0, 5, 10, 15, 20, 25, 30, 35, 40, 45)
"""The gap closes at 48.6 deg."""

Row = dict[str, str]


def scenario(
    angle: float, gap_width: float, radius: float, direction: str, changed: dict[str, float]
) -> Scenario:
    """The paper's box hand at `angle` degrees, lengths in L_p, with some readings changed."""
    reading, unit = DEFAULTS | changed, paper.WRIST_PALM_LENGTH
    hand = box_hand(
        math.radians(angle),
        palm_length=unit,
        gap_width=gap_width * unit,
        fingertip_length=paper.FINGERTIP_LENGTH * unit,
    )
    drive = WristTilt(gravity=reading["gravity"], ramp_time=reading["ramp"])
    law = ContactLaw(restitution=reading["restitution"])
    return DIRECTIONS[direction](hand, Circle(radius * unit), drive, law, reading["start spread"])


def under(changed: dict[str, float], **settings: Any) -> Iterator[Row]:
    """All curves with some readings changed, as rows of the data file."""
    keys = [
        (direction, gap_width, radius, float(angle))
        for gap_width, radius, directions, angles in PARTS
        for angle, direction in product(angles, directions)
    ]
    names = ("direction", "gap_width", "radius", "angle")
    data = evaluate_grid(
        [scenario(angle, gap, radius, way, changed) for way, gap, radius, angle in keys],
        dict(zip(names, zip(*keys, strict=True), strict=True)),
        progress=True,
        **settings,
    )
    made = {"trials_used": str(data.attrs["trials_right"]), "engine": str(data.attrs["engine"])}
    made["least_dt_s"] = f"{data.dt.values.min():.4g}"
    for name, pick in CURVES.items():
        for row in rows_of(pick(data)):
            yield {"curve": name} | row | made


def limits(*, max_steps: int, burn_in: int, **settings: Any) -> Iterator[Row]:
    """The score over theta_g for each limit up to `max_steps`, and the one that needs no limit.

    Trials do not depend on the limit: escape steps cut at a lower one are those of a run with it.

    The score without a limit is the ratio of escape rates, EoEn's over DoEs'. After `burn_in`
    periods the rate per period stays the same, so the tail of the escape times is exponential and
    its rate is events over exposure: the number of trials that escape after b, over the sum of
    max(min(T_i, max_steps) - b, 0), with b the steps of the burn-in and T_i the escape steps.
    """
    keys = list(product(LIMIT_ANGLES, ("does", "eoen")))
    scenarios = [scenario(angle, 0.4, 0.05, direction, {}) for angle, direction in keys]
    engine = choose_engine("auto", None, scenarios[0])
    out = run(scenarios, engine=engine, max_steps=max_steps, progress=True, **settings)
    valid = (out.status != INVALID).all(axis=0)
    steps = out.steps[:, valid].astype(float)
    lines = {}
    for limit in (*(some for some in LIMITS if some < max_steps), max_steps):
        held = np.minimum(steps, limit)
        lines[str(limit)] = ratio_curve([held[::2]], [held[1::2]])
    start = burn_in * round(paper.WRIST_PERIOD / paper.DT)
    exposure = np.maximum(steps - start, 0.0)
    events = ((steps > start) & (steps < max_steps)).astype(float)
    lines["none"] = ratio_curve([exposure[::2], events[1::2]], [events[::2], exposure[1::2]])
    made = {"trials_used": str(valid.sum()), "engine": engine.name}
    made["least_dt_s"] = f"{engine.step_taken(paper.WRIST_PERIOD):.4g}"
    for value, line in lines.items():
        for row in rows_of(line):
            yield {"value": value, "curve": "score, r_o = 0.05"} | row | made


def ratio_curve(
    above: Sequence[Float[np.ndarray, "angles trials"]],
    below: Sequence[Float[np.ndarray, "angles trials"]],
) -> Curve:
    """The product of the means of `above` over that of `below`, at the angles where none is 0.

    Covariance by the delta method. To first order a trial moves the logarithm by 1 / trials of the
    sum of its x / mean(x) over `above` less that over `below`; all angles share the trials.
    """
    some = np.all([x.mean(axis=1) > 0 for x in (*above, *below)], axis=0)
    means = [[x[some].mean(axis=1, keepdims=True) for x in part] for part in (above, below)]
    top, bottom = (np.prod(part, axis=0)[:, 0] for part in means)
    plus, minus = (
        np.sum([x[some] / mean for x, mean in zip(part, of_part, strict=True)], axis=0)
        for part, of_part in zip((above, below), means, strict=True)
    )
    value = top / bottom
    covariance = np.atleast_2d(np.cov(plus - minus)) / plus.shape[1] * np.outer(value, value)
    return Curve(np.asarray(LIMIT_ANGLES, float)[some], value, covariance, some[some])


def rows_of(line: Curve) -> Iterator[Row]:
    """A curve's estimates with standard errors, its paired steps between neighbours, its peak."""
    peak, low, high = peak_of(line.angle, line.value, line.covariance)
    for k, angle in enumerate(line.angle):
        step, step_se = line.difference(angle, line.angle[k - 1]) if k else (math.nan, math.nan)
        yield {
            "angle_deg": f"{angle:g}",
            "estimate": f"{line.value[k]:.6g}",
            "se": f"{line.se[k]:.3g}",
            "step": f"{step:.4g}",
            "step_se": f"{step_se:.3g}",
            "peak_deg": f"{peak:g}",
            "peak_low_deg": f"{low:g}",
            "peak_high_deg": f"{high:g}",
        }


def peak_of(
    angle: Float[np.ndarray, " angles"],
    value: Float[np.ndarray, " angles"],
    covariance: Float[np.ndarray, "angles angles"],
) -> tuple[float, float, float]:
    """The angle of a curve's highest value, and its 95 % interval on the grid of angles, from 4,000
    draws of a parametric bootstrap of the whole curve."""
    draws = np.random.default_rng(0).multivariate_normal(
        value, covariance, 4000, check_valid="ignore", method="svd"
    )
    low, high = np.quantile(angle[draws.argmax(axis=1)], [0.025, 0.975], method="inverted_cdf")
    return float(angle[value.argmax()]), float(low), float(high)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--trials", type=int, default=paper.TRIALS, help="for each condition of the readings")
    add("--max-steps", type=int, default=paper.WRIST_MAX_STEPS, help="limit for the readings")
    add("--limit-trials", type=int, default=paper.TRIALS, help="for each condition of the limits")
    add("--longest", type=int, default=LIMITS[-1], help="the highest limit, in steps of 0.001 s")
    add("--burn-in", type=int, default=5, help="periods that the escape rates leave out")
    add("--out", type=Path, default=Path(__file__).parent / "results" / "readings.csv")
    add("--redo", action="store_true", help="start afresh")
    args = parser.parse_args()
    common = {"trials": args.trials, "max_steps": args.max_steps}
    of_limits = {"trials": args.limit_trials, "max_steps": args.longest, "burn_in": args.burn_in}
    args.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [] if args.redo else kept(args.out)

    jobs = [("default", "")]
    for name, values in READINGS.items():
        jobs += [(name, f"{value:g}") for value in values if value != DEFAULTS[name]]
    todo = []
    for name, value in (*jobs, ("limit", "")):
        settings = of_limits if name == "limit" else common
        before = [r for r in rows if r["reading"] == name and value in (r["value"], "")]
        made = {key: int(before[0][key]) for key in settings} if before else None
        if made not in (None, settings):
            parser.error(f"{args.out} was made with {made}: use these settings, or --redo")
        if made is None:
            todo.append((name, value, settings))
    for name, value, settings in todo:
        began = time.perf_counter()
        changed = {name: float(value)} if value else {}
        new = limits(**settings) if name == "limit" else under(changed, **settings)
        used = {key: str(number) for key, number in settings.items()}
        rows += [{"reading": name, "value": value} | row | used for row in new]
        save(rows, args.out)
        print(f"{name} {value}".strip(), f"{time.perf_counter() - began:.0f} s", flush=True)
    report(rows)
    draw(rows).savefig(args.out.with_suffix(".png"), dpi=100)


def save(rows: Sequence[Row], path: Path) -> None:
    """Writes the data file; the old one stays until the new one is complete."""
    unfinished = path.with_suffix(".part")
    with unfinished.open("w", newline="") as file:
        names = dict.fromkeys(name for row in rows for name in row)
        writer = csv.DictWriter(file, list(names), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    unfinished.replace(path)


def kept(path: Path) -> list[Row]:
    """The rows of a data file; none if there is none yet."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def by_curve(rows: Sequence[Row]) -> dict[tuple[str, str, str], list[Row]]:
    """The rows of each (reading, value, curve)."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["reading"], row["value"], row["curve"]), []).append(row)
    return groups


def numbers(rows: Sequence[Row], *names: str) -> np.ndarray:
    """Columns as numbers, one row of the array for each name; NaN where there is nothing."""
    return np.array([[float(row[name] or math.nan) for row in rows] for name in names])


def report(rows: Sequence[Row]) -> None:
    """Prints where each curve peaks, and its lowest step between neighbours from 30 to 50 deg."""
    for (name, value, key), mine in by_curve(rows).items():
        first = mine[0]
        peak = "{peak_deg} deg [{peak_low_deg}, {peak_high_deg}]".format(**first)
        angle, step, se = numbers(mine, "angle_deg", "step", "step_se")
        near = np.flatnonzero((angle > 30) & (angle <= 50))
        text = ""
        if key.startswith("index 2"):
            k = min(near, key=lambda k: step[k])
            text = f", lowest step {step[k]:+.3f} ± {se[k]:.3f} up to {angle[k]:g} deg"
        bad = int(first["trials"]) - int(first["trials_used"])
        text += f", {bad} trials left out as invalid" if bad else ""
        print(f"{name + ' ' + value:18} {key:20} highest at {peak}{text}")


def draw(rows: Sequence[Row]) -> Figure:
    """A row of panels for each reading, a column for each curve; the limits below."""
    figure = Figure(figsize=(16, 19), layout="constrained")
    grid = figure.add_gridspec(len(READINGS) + 1, 4, height_ratios=[1.0] * len(READINGS) + [1.4])
    groups = by_curve(rows)
    shades = colormaps["viridis"](np.linspace(0, 0.9, 4))
    for i, (name, values) in enumerate(READINGS.items()):
        for j, (key, (title, what, claimed)) in enumerate(zip(CURVES, PANELS, strict=True)):
            axis = figure.add_subplot(grid[i, j])
            for value, shade in zip(values, shades, strict=True):
                usual = value == DEFAULTS[name]
                chosen = ("default", "", key) if usual else (name, f"{value:g}", key)
                label = f"{value:g}" + (" (default)" if usual else "")
                band(axis, groups.get(chosen, []), shade, label, 1e-3 if j < 2 else 1.0)
            axis.axvline(claimed, color="0.5", ls=":")
            axis.set(xlabel=r"$\theta_g$ [deg]", ylabel=what, title=title if i == 0 else "")
            axis.grid(alpha=0.3)
            if j == 0:
                axis.legend(fontsize=9, title=UNITS[name])
    at_limits = {value: mine for (name, value, _), mine in groups.items() if name == "limit"}
    over, peaks = figure.add_subplot(grid[-1, :2]), figure.add_subplot(grid[-1, 2:])
    shades = [*colormaps["viridis"](np.linspace(0, 0.9, max(len(at_limits) - 1, 0))), "black"]
    labels = ["no limit" if value == "none" else f"{int(value):,}" for value in at_limits]
    for k, (mine, shade) in enumerate(zip(at_limits.values(), shades, strict=False)):
        band(over, mine, shade, labels[k], 1.0)
        low, peak, high = numbers(mine, "peak_low_deg", "peak_deg", "peak_high_deg")[:, 0]
        peaks.errorbar(k, peak, [[peak - low], [high - peak]], fmt="D", capsize=4, color=shade)
    over.set(yscale="log", xlabel=r"$\theta_g$ [deg]", ylabel="score DoEs / EoEn", ylim=(0.9, 9))
    over.yaxis.set_major_locator(FixedLocator([1, 1.2, 1.5, 2, 3, 4, 5, 7]))
    over.yaxis.set_minor_locator(NullLocator())
    over.yaxis.set_major_formatter("{x:g}")
    over.set_title("Score at $r_o$ = 0.05 $L_p$; without a limit: ratio of escape rates")
    over.legend(title="limit [steps]", loc="upper left")
    peaks.set(xlabel="limit [steps]", ylabel=r"$\theta_g$ of the highest score [deg]")
    peaks.set_title("Where that score is highest; the gap closes at 48.6 deg")
    peaks.set_xticks(range(len(labels)), labels)
    for axis in (over, peaks):
        axis.grid(alpha=0.3)
    made = dict.fromkeys(
        f"{int(r['trials']):,} trials, limit {int(r['max_steps']):,} steps" for r in rows
    )
    figure.suptitle(
        "Figures whose claims hold in part, one reading of the model changed at a time. Bands and "
        "bars: 95 %; diamonds: the highest value;\ntriangles: a fall of index 2 by 3 standard "
        "errors; dotted: the paper's peak (index 2: its dip). " + "; last row ".join(made)
    )
    return figure


def band(axis: Axes, rows: Sequence[Row], colour: Any, label: str, scale: float) -> None:
    """A curve with its 95 % band, and where it is highest (of index 2: where it falls)."""
    if not rows:
        return
    angle, value, se, step, step_se = numbers(
        rows, "angle_deg", "estimate", "se", "step", "step_se"
    )
    value, reach = value * scale, 1.96 * se * scale
    axis.plot(angle, value, color=colour, label=label)
    axis.fill_between(angle, value - reach, value + reach, color=colour, alpha=0.25, lw=0)
    if rows[0]["curve"].startswith("index 2"):
        falls = (step_se > 0) & (step < -3 * step_se)
        axis.plot(angle[falls], value[falls], "v", ms=9, color=colour)
        return
    low, peak, high = numbers(rows, "peak_low_deg", "peak_deg", "peak_high_deg")[:, 0]
    axis.errorbar(
        peak, value.max(), xerr=[[peak - low], [high - peak]], fmt="D", capsize=4, color=colour
    )


if __name__ == "__main__":
    main()
