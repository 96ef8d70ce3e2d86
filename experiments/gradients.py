"""Estimated derivatives of the score against exact ones, for spread designs.

The truth is a difference of the exact score, one parameter at a time, half as wide as the
estimators' and on other trials. Two parameters of each hand, and eight of the box hand, where
differences get dear. Keeps `results/gradients.csv` and draws `results/gradients.png`.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

from pcjax.design.estimator import Estimator, Gradient
from pcjax.design.gradients import Differences, Pathwise, mixed
from pcjax.design.parameters import labelled
from pcjax.design.space import DesignSpace, design_space
from pcjax.model.bodies.circle import Circle
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.paper import constants as paper
from pcjax.physics.contact import circle
from pcjax.quality.surrogate import Surrogate
from pcjax.quality.task import Task

RESULTS = Path(__file__).parent / "results"
SEED, TRUTH_SEED = 11, 12

WIDE = {"goal_layer": 0.8}
FEW = WIDE | {"trials": 128}

ESTIMATORS: dict[str, tuple[Estimator, dict]] = {
    "axial": (Differences("axial"), {"trials": 8000}),
    "axial, wide goal": (Differences("axial"), WIDE | {"trials": 8000}),
    "axial, exact": (Differences("axial"), {"form": "exact", "trials": 8000}),
    "factorial": (Differences("factorial"), {"trials": 8000}),
    "evolution, exact": (Differences("gaussian"), {"form": "exact", "trials": 8000}),
    "axial, cloud": (Differences("axial"), WIDE | {"form": "cloud", "trials": 16_000}),
    "pathwise, compliant": (Pathwise(block=64), FEW | {"contact_layer": 0.2}),
    "pathwise, time of impact": (Pathwise(block=64), FEW),
    "pathwise, push-out alone": (Pathwise(block=64), FEW),
}
SOME = ("axial", "factorial", "pathwise, compliant", "pathwise, time of impact")
"""Those for the arm and for eight parameters, where trials are dear."""

MIXED = ("axial", "pathwise, compliant")

# theta_g in degrees, L_g in palm lengths, by the object's radius.
WRIST = {
    25.0: [(-30, 0.1), (-15, 0.3), (0, 0.05), (0, 0.2), (10, 0.2), (20, 0.3), (30, 0.2), (45, 0.1)],
    5.0: [(10, 0.2), (25, 0.3), (40, 0.2)],
    50.0: [(-20, 0.2), (0, 0.3), (15, 0.15)],
}
ARM = [(55, 90), (65, 100), (70, 80), (60, 110)]
EIGHT = "eight parameters"
ONE_SIDED = [
    labelled(f"{kind}_{finger}{joint}")
    for finger in (1, 2)
    for kind, joint in (
        ("fingertip_angle", ""),
        ("fingertip_length", ""),
        ("joint_angle", 2),
        ("link_length", 2),
    )
]
MANY = [(0, 0.2), (20, 0.2), (20, 0.3)]


def groups() -> list[tuple[str, Surrogate, DesignSpace, list[np.ndarray]]]:
    """The designs, those of one object and drive together."""
    found = []
    for radius, designs in WRIST.items():
        unit = paper.WRIST_PALM_LENGTH
        space = design_space(box_hand(), ["fingertip_angle_deg", "fingertip_length"], 2 * radius)
        task = Task(Circle(radius), WristTilt(), ("does", "eoen"), paper.WRIST_MAX_STEPS)
        at = [np.array([angle, share * unit]) for angle, share in designs]
        found.append((f"wrist, r = {radius:g}", Surrogate(task), space, at))
    body = Circle(paper.ARM_RADIUS)
    space = design_space(
        two_joint_hand(), ["joint_angle_1_deg", "joint_angle_2_deg"], 2 * paper.ARM_RADIUS
    )
    task = Task(body, PlanarArm(), ("does",), paper.ARM_MAX_STEPS)
    found.append(("arm", Surrogate(task), space, [np.array(angles, float) for angles in ARM]))
    unit = paper.WRIST_PALM_LENGTH
    space = design_space(box_hand(), ONE_SIDED, 50.0)
    task = Task(Circle(25.0), WristTilt(), ("does", "eoen"), paper.WRIST_MAX_STEPS)
    hands = [box_hand(math.radians(angle), fingertip_length=share * unit) for angle, share in MANY]
    found.append((EIGHT, Surrogate(task), space, [space.design_of(hand) for hand in hands]))
    return found


@contextlib.contextmanager
def push_out_alone() -> Iterator[None]:
    """Contact without impacts at their times: the circle is only put back at the end of a step."""
    impact = circle.bounce
    circle.bounce = lambda law, contact, radius, end, dt, one: end
    jax.clear_caches()
    try:
        yield
    finally:
        circle.bounce = impact
        jax.clear_caches()


def rows_of(
    name: str, group: str, space: DesignSpace, design: np.ndarray, got: Gradient, true: Gradient
) -> list[dict]:
    """One line for each direction and parameter, derivatives in the parameters' scales."""
    kinds = ("does", "eoen")[: len(got.parts)]
    lines = [
        (kind, got.parts[k], got.parts_se[k], true.parts[k], true.parts_se[k])
        for k, kind in enumerate(kinds)
    ]
    if len(kinds) == 2:
        lines.append(("score", got.gradient, got.se, true.gradient, true.se))
    return [
        {
            "estimator": name,
            "group": group,
            "design": space.describe(design),
            "of": kind,
            "parameter": p.name,
            "value": round(value[k] * space.scales[k], 6),
            "se": round(se[k] * space.scales[k], 6),
            "truth": round(truth[k] * space.scales[k], 6),
            "truth_se": round(truth_se[k] * space.scales[k], 6),
            "largest_share": round(got.largest_share, 4),
            "trials": got.trials,
            "seconds": round(got.seconds, 2),
        }
        for kind, value, se, truth, truth_se in lines
        for k, p in enumerate(space.free)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--truth-trials", type=int, default=25_000)
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the estimators' trials")
    arguments = parser.parse_args()
    rows: list[dict] = []
    for group, surrogate, space, designs in groups():
        trials = arguments.truth_trials // (2 if group == EIGHT else 1)
        exact = replace(surrogate, form="exact", trials=trials)
        truth = Differences("axial", reach=0.5)(exact, space, designs, TRUTH_SEED)
        print(f"{group}: truth, {sum(g.seconds for g in truth):.0f} s", flush=True)
        estimates: dict[str, list[Gradient]] = {}
        for name, (estimator, changes) in ESTIMATORS.items():
            if group in ("arm", EIGHT) and name not in SOME:
                continue
            changes = changes | {"trials": max(2, round(changes["trials"] * arguments.scale))}
            mine = replace(surrogate, **changes)
            patch = push_out_alone() if "push-out" in name else contextlib.nullcontext()
            with patch:
                found = estimates[name] = estimator(mine, space, designs, SEED + len(estimates))
            print(f"{group}: {name}, {sum(g.seconds for g in found):.0f} s", flush=True)
        estimates["mixture"] = [
            mixed(one, two) for one, two in zip(*(estimates[name] for name in MIXED), strict=True)
        ]
        for name, found in estimates.items():
            for design, got, true in zip(designs, found, truth, strict=True):
                rows += rows_of(name, group, space, design, got, true)
        with (RESULTS / "gradients.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    two = [row for row in rows if row["group"] != EIGHT]
    print(table(two), table([row for row in rows if row["group"] == EIGHT]), sep="\n\n")
    draw(two).savefig(RESULTS / "gradients.png", dpi=110)


def agreement(rows: list[dict], name: str, of: str) -> tuple[float, float, float, int, int, float]:
    """Cosine, slope and its standard error against the truth, right signs of those that the truth
    is sure of, how many that are, and the median standard error per degree of the angles."""
    mine = [row for row in rows if row["estimator"] == name and row["of"] == of]
    value, truth, noise, truth_noise = (
        np.array([float(row[key]) for row in mine]) for key in ("value", "truth", "se", "truth_se")
    )
    slope = float(value @ truth / (truth @ truth))
    noise = np.hypot(noise, slope * truth_noise)
    sure = np.array([abs(float(row["truth"])) > 3 * float(row["truth_se"]) for row in mine])
    errors = [float(row["se"]) / 10 for row in mine if "angle" in row["parameter"]]
    cosine = float(value @ truth) / math.sqrt((value @ value) * (truth @ truth))
    right = int(np.sum(np.sign(value[sure]) == np.sign(truth[sure])))
    return (
        cosine,
        slope,
        float(np.sqrt((truth * noise) @ (truth * noise)) / (truth @ truth)),
        right,
        int(sure.sum()),
        float(np.median(errors)),
    )


def cells_of(rows: list[dict], name: str, seconds: str) -> list[str]:
    """An estimator's line of a table: name, seconds of a design, agreement of each part, right
    signs, standard error, largest share.

    Arguments:
        rows: of all estimators.
        name: of the estimator.
        seconds: which column they are.
    """
    mine = [row for row in rows if row["estimator"] == name]
    designs = {(row["group"], row["design"]): float(row[seconds]) for row in mine}
    share = np.median([float(row["largest_share"]) for row in mine])
    cells = [agreement(rows, name, of) for of in ("does", "eoen", "score")]
    right, sure = (sum(cell[k] for cell in cells) for k in (3, 4))
    return [
        name,
        f"{np.mean(list(designs.values())):.1f}",
        *(f"{cosine:.3f}, {slope:.2f} ± {se:.2f}" for cosine, slope, se, *_ in cells),
        f"{right}/{sure}",
        f"{cells[2][5]:.4f}",
        f"{share:.3f}",
    ]


def table(rows: list[dict]) -> str:
    """The estimators' agreement as a Markdown table."""
    lines = [
        "| estimator | s / design | d ln DoEs: cosine, slope | d ln EoEn | d ln score "
        "| right signs | median s.e. per degree | largest trial's share |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name in dict.fromkeys(row["estimator"] for row in rows):
        lines.append(f"| {' | '.join(cells_of(rows, name, 'seconds'))} |")
    return "\n".join(lines)


def draw(rows: list[dict]) -> Figure:
    """Each estimator's derivatives of the score's parts against the truth."""
    names = list(dict.fromkeys(row["estimator"] for row in rows))
    figure = Figure(figsize=(14, 7), layout="constrained")
    axes = figure.subplots(2, math.ceil(len(names) / 2), sharex=True, sharey=True).ravel()
    reach = 1.15 * max(abs(float(row["truth"])) for row in rows)
    for axis, name in zip(axes, names, strict=False):
        for k, of in enumerate(("does", "eoen", "score")):
            mine = [row for row in rows if row["estimator"] == name and row["of"] == of]
            x, sx, y, sy = (
                [float(row[key]) for row in mine] for key in ("truth", "truth_se", "value", "se")
            )
            axis.errorbar(x, y, sy, sx, fmt="o", ms=3.5, lw=0.7, color=f"C{k}", label=of)
        axis.plot([-reach, reach], [-reach, reach], color="0.6", lw=0.8, zorder=0)
        axis.set(title=name, xlim=(-reach, reach), ylim=(-reach, reach))
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8, title="d ln")
    figure.supxlabel("exact difference [per 10 degrees, per 0.1 L_p]")
    figure.supylabel("estimate")
    return figure


if __name__ == "__main__":
    main()
