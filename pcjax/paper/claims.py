"""The paper's claims, each tested on figures' data, with the numbers behind it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pcjax.importing import xr
from pcjax.paper import constants as paper
from pcjax.paper.figures import Curve, curve, score_curve
from pcjax.results.schema import INDICES
from pcjax.results.tables import wrapped

FIGURES_NEEDED = ("9a", "9b", "12", "15", "17")
"""The figures whose data the claims are tested on; Figs. 10 and 11 are parts of Fig. 12's, Figs. 13
and 14 of Fig. 15's."""

REPRODUCED, IN_PART, NOT = "reproduced", "reproduced in part", "not reproduced"

_Z = 3.0
"""A difference counts when it is this many standard errors from 0 (false alarm 0.27 %)."""


@dataclass(frozen=True)
class Claim:
    """One claim of the paper, our verdict, and what it rests on."""

    number: int
    text: str
    verdict: str
    evidence: str

    def __str__(self) -> str:
        verdict = wrapped(f"{self.number}. {self.verdict.upper()}: {self.text}", indent=5)
        return f"{verdict}\n{wrapped(' ' * 5 + self.evidence, indent=5)}"


def judge_claims(figures: Mapping[str, xr.Dataset]) -> list[Claim]:
    """All claims.

    Arguments:
        figures: the data of `FIGURES_NEEDED`, from `pcjax.paper.figures.run_figure`.
    """
    narrow, wide, grid, arm, stick = (figures[name] for name in FIGURES_NEEDED)
    return [
        _correlation(narrow),
        _follows_gap(narrow),
        _peaks(wide),
        _grows_for_each_radius(grid),
        _entering_flat_then_grows(grid),
        _score_high_at_ten(grid),
        _smallest_falls(grid),
        _negative_angles(grid),
        _grows_with_joint_angle(arm, 9),
        _grows_with_joint_angle(arm, 10),
        _follows_width(arm),
        _depends_on_orientation(stick),
    ]


def _thousands(value: float, se: float) -> str:
    return f"{value / 1000:+.1f} ± {se / 1000:.1f} thousand steps"


def _resample(means: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """4,000 draws of a parametric bootstrap: means over many trials are close to normal."""
    rng = np.random.default_rng(0)
    # Full cages have no variance, so rounding may leave eigenvalues a hair below 0.
    return rng.multivariate_normal(means, covariance, 4000, check_valid="ignore", method="svd")


def _falls(line: Curve) -> list[tuple[float, float, float]]:
    """Neighbouring angles between which a curve falls for certain: (from, to, z)."""
    falls = []
    for earlier, later in pairwise(line.angle):
        difference, se = line.difference(later, earlier)
        if se > 0 and difference / se < -_Z:
            falls.append((float(earlier), float(later), difference / se))
    return falls


def _correlation(data: xr.Dataset) -> Claim:
    text = f"Fig. 9(a): index 1 and index 2 correlate (the paper: {paper.CORRELATION})"
    one, two = (curve(data, "does", name) for name in ("index1", "index2"))
    if np.ptp(one.value) == 0 or np.ptp(two.value) == 0:
        return Claim(1, text, NOT, "one of the indices does not vary: no correlation to speak of")
    value = float(np.corrcoef(one.value, two.value)[0, 1])
    blocks = data.covariance.values
    joint = np.block([[blocks[i, j] for j in (0, 1)] for i in (0, 1)])
    means = np.concatenate([data[name].sel(statistic="value").values for name in INDICES])
    draws = _resample(means, joint)
    n = data.sizes["condition"]
    samples = [np.corrcoef(draw[:n], draw[n:])[0, 1] for draw in draws]
    low, high = np.quantile(samples, [0.025, 0.975])
    verdict = REPRODUCED if low > 0.95 else IN_PART if low > 0.8 else NOT
    return Claim(
        1,
        text,
        verdict,
        f"correlation over {n} angles {value:.4f} [{low:.4f}, {high:.4f}]",
    )


def _follows_gap(data: xr.Dataset) -> Claim:
    one, two = (curve(data, "does", name) for name in ("index1", "index2"))
    one, two = one.only(one.open), two.only(two.open)
    growth, se = one.difference(one.angle[-1], one.angle[0])
    near = (two.angle >= 30) & (two.angle <= 50)
    dips = _falls(two.only(near))
    falls = _falls(one)
    grows = growth > _Z * se and not falls
    verdict = REPRODUCED if grows and dips else IN_PART if grows or dips else NOT
    dip = "; ".join(f"falls from {a:g} to {b:g} deg (z = {z:.1f})" for a, b, z in dips)
    differences = [two.difference(b, a) for a, b in pairwise(two.angle[near])]
    least = min(differences, key=lambda pair: pair[0])
    return Claim(
        2,
        "Fig. 9(a): the index follows the gap's width (grows with theta_g), but for a slight dip "
        "of index 2 near 40 deg",
        verdict,
        f"index 1 from {one.angle[0]:g} to {one.angle[-1]:g} deg {_thousands(growth, se)}, "
        f"{len(falls)} falls between neighbouring angles; index 2 between 30 and 50 deg: "
        + (dip or f"no dip, least difference of neighbours {least[0]:+.4f} ± {least[1]:.4f}"),
    )


def _peaks(data: xr.Dataset) -> Claim:
    parts, found = [], []
    for gap_width, stated in zip(paper.GAP_WIDTHS[1:], (40.0, 50.0), strict=True):
        line = curve(data, "does", where={"gap_width": gap_width})
        draws = _resample(line.value, line.covariance)
        places = line.angle[np.argmax(draws, axis=1)]
        low, high = np.quantile(places, [0.025, 0.975])
        peak = float(line.angle[np.argmax(line.value)])
        after, se = line.difference(line.angle[-1], peak)
        before, se_before = line.difference(peak, line.angle[0])
        rises = before > _Z * se_before
        falls = se > 0 and after < -_Z * se
        there = low <= stated <= high
        found.append((rises, falls, there))
        parts.append(
            f"W_g = {gap_width} L_p: highest at {peak:g} deg [{low:g}, {high:g}] (the paper "
            f"{stated:g}), from there to {line.angle[-1]:g} deg {_thousands(after, se)}"
        )
    if all(all(each) for each in found):
        verdict = REPRODUCED
    elif all(rises for rises, _, _ in found) and any(falls for _, falls, _ in found):
        verdict = IN_PART
    else:
        verdict = NOT
    return Claim(
        3,
        "Fig. 9(b): with W_g = 0.6 and 0.8 L_p index 1 grows up to 40 and 50 deg, then falls",
        verdict,
        "; ".join(parts),
    )


def _grows_for_each_radius(data: xr.Dataset) -> Claim:
    parts, good = [], []
    for radius in paper.RADII:
        line = curve(data, "does", where={"radius": radius})
        growth, se = line.difference(line.angle[-1], line.angle[0])
        falls = _falls(line)
        good.append(growth > _Z * se and not falls)
        parts.append(f"r_o = {radius} L_p: {_thousands(growth, se)}, {len(falls)} falls")
    verdict = REPRODUCED if all(good) else IN_PART if any(good) else NOT
    return Claim(
        4, "Fig. 10: index 1 grows with theta_g for each radius", verdict, "; ".join(parts)
    )


def _entering_flat_then_grows(data: xr.Dataset) -> Claim:
    parts, good, grows = [], [], []
    for radius in paper.RADII:
        line = curve(data, "eoen", where={"radius": radius})
        line = line.only(line.open)
        first, last = float(line.angle[0]), float(line.angle[-1])
        knee = paper.BEST_ANGLE_DEG
        slope_before = line.difference(knee, first)
        slope_after = line.difference(last, knee)
        before = np.array(slope_before) / (knee - first)
        after = np.array(slope_after) / (last - knee)
        # Flat: certainly less than half as steep as what follows.
        excess, se = line.contrast(
            (knee, 1 / (knee - first) + 0.5 / (last - knee)),
            (first, -1 / (knee - first)),
            (last, -0.5 / (last - knee)),
        )
        good.append(excess < -_Z * se)
        grows.append(after[0] > _Z * after[1])
        parts.append(
            f"r_o = {radius} L_p: {before[0]:+.0f} ± {before[1]:.0f} steps/deg up to {knee:g} deg, "
            f"then {after[0]:+.0f} ± {after[1]:.0f} up to {last:g}"
        )
    verdict = REPRODUCED if all(good) and all(grows) else IN_PART if any(grows) else NOT
    return Claim(
        5,
        "Fig. 11: EoEn is low and flat for theta_g <= 10 deg, then grows",
        verdict,
        "; ".join(parts),
    )


def _score_high_at_ten(data: xr.Dataset) -> Claim:
    parts, good = [], []
    for radius in paper.RADII:
        line = score_curve(data, where={"radius": radius})
        line = line.only(line.open)
        here = line.at(paper.BEST_ANGLE_DEG)
        best = float(line.angle[np.argmax(line.value)])
        short, se = line.difference(best, paper.BEST_ANGLE_DEG)
        above = line.value[here] - 1 > _Z * line.se[here]
        good.append(above and short + 2 * se < 0.05 * line.value.max())
        parts.append(
            f"r_o = {radius} L_p: {line.value[here]:.3f} ± {line.se[here]:.3f} at 10 deg"
            f", highest at {best:g} deg, {short:+.3f} ± {se:.3f} more"
        )
    verdict = REPRODUCED if all(good) else IN_PART if any(good) else NOT
    return Claim(
        6,
        "Fig. 12: the score is high about theta_g = 10 deg for every radius (within 5 % of its "
        "highest)",
        verdict,
        "; ".join(parts),
    )


def _smallest_falls(data: xr.Dataset) -> Claim:
    line = score_curve(data, where={"radius": paper.RADII[0]})
    last = float(line.angle[-1])
    change, se = line.difference(last, paper.BEST_ANGLE_DEG)
    later = line.only(line.angle >= paper.BEST_ANGLE_DEG)
    rises = sum(
        (pair := later.difference(b, a))[0] > _Z * pair[1] for a, b in pairwise(later.angle)
    )
    falls = change < -_Z * se
    verdict = REPRODUCED if falls and not rises else IN_PART if falls else NOT
    return Claim(
        7,
        "Fig. 12: for the smallest object the score falls with theta_g after 10 deg",
        verdict,
        f"from 10 to {last:g} deg {change:+.3f} ± {se:.3f}, {rises} rises between neighbouring "
        "angles",
    )


def _negative_angles(data: xr.Dataset) -> Claim:
    parts, good = [], []
    for radius in paper.RADII:
        line = curve(data, "does", where={"radius": radius})
        change, se = line.difference(-20.0, 0.0)
        good.append(change < -_Z * se)
        parts.append(f"r_o = {radius} L_p: {_thousands(change, se)}")
    gaps = [float(data.gap.values[data.angle.values == angle].max()) for angle in (0.0, -20.0)]
    same = math.isclose(gaps[0], gaps[1], rel_tol=1e-6)
    verdict = REPRODUCED if all(good) and same else IN_PART if any(good) else NOT
    return Claim(
        8,
        "Sec. 3.5: for theta_g < 0 the difficulty of escaping falls although the narrowest gap is "
        "no narrower",
        verdict,
        f"narrowest gap {gaps[0]:g} at 0 deg and {gaps[1]:g} at -20 deg; index 1 from 0 to "
        "-20 deg, " + "; ".join(parts),
    )


def _joint_curve(data: xr.Dataset, varied: int) -> Curve:
    """Index 1 of the arm against theta_i1 or theta_i2, the other one as the paper fixes it."""
    first, second = paper.ARM_JOINT_ANGLES_DEG
    where = {"theta_2": second} if varied == 1 else {"theta_1": first}
    return curve(data.assign_coords(angle=data[f"theta_{varied}"]), "does", where=where)


def _grows_with_joint_angle(data: xr.Dataset, number: int) -> Claim:
    varied = number - 8
    line = _joint_curve(data, varied)
    line = line.only(line.open)
    growth, se = line.difference(line.angle[-1], line.angle[0])
    falls = _falls(line)
    grows = growth > _Z * se
    verdict = REPRODUCED if grows and not falls else IN_PART if grows else NOT
    steepest = "; ".join(f"falls from {a:g} to {b:g} deg (z = {z:.1f})" for a, b, z in falls)
    return Claim(
        number,
        f"Fig. {number + 4}: index 1 grows with theta_i{varied}",
        verdict,
        f"from {line.angle[0]:g} to {line.angle[-1]:g} deg {_thousands(growth, se)}; "
        + (steepest or "no falls between neighbouring angles"),
    )


def _follows_width(data: xr.Dataset) -> Claim:
    """Index 1 falls as the fingertips part, in each series; between the series it is compared at
    equal width, by interpolating the logarithm along the first."""
    lines = [
        curve(data.assign_coords(angle=data.width), "does", where=where)
        for where in (
            {"theta_2": paper.ARM_JOINT_ANGLES_DEG[1]},
            {"theta_1": paper.ARM_JOINT_ANGLES_DEG[0]},
        )
    ]
    lines = [line.only(line.open) for line in lines]
    rises = 0
    drops = []
    for line in lines:
        pairs = [line.difference(b, a) for a, b in pairwise(line.angle)]
        rises += sum(value > _Z * se for value, se in pairs)
        drops.append(line.difference(line.angle[-1], line.angle[0]))
    first, second = lines
    inside = (second.angle >= first.angle[0]) & (second.angle <= first.angle[-1])
    ratio = second.value[inside] / np.exp(
        np.interp(second.angle[inside], first.angle, np.log(first.value))
    )
    falls = all(value < -_Z * se for value, se in drops)
    verdict = REPRODUCED if falls and not rises else IN_PART if falls else NOT
    pairs = "; ".join(
        f"theta_i{k} varied: {_thousands(*drop)} from a width of {line.angle[0]:.0f} to "
        f"{line.angle[-1]:.0f}"
        for k, (drop, line) in enumerate(zip(drops, lines, strict=True), start=1)
    )
    apart = f"{ratio.min():.2f} to {ratio.max():.2f}" if len(ratio) else "no"
    return Claim(
        11,
        "Fig. 15: index 1 depends on the width between the fingertips",
        verdict,
        f"{pairs}; {rises} rises; at equal width the second series has {apart} times the index of "
        "the first",
    )


def _depends_on_orientation(data: xr.Dataset) -> Claim:
    """Slightly: at some theta_i2 certainly, and nowhere by more than a third."""
    orientations = np.unique(data.orientation.values)
    lines = [curve(data, "does", where={"orientation": float(o)}) for o in orientations]
    places = [np.flatnonzero(np.isclose(data.orientation.values, o)) for o in orientations]
    covariance = data.covariance.values[0, 0]
    largest, most, certain = 0.0, 0.0, 0
    for k in range(len(lines[0].angle)):
        rows = [place[np.argsort(data.angle.values[place])][k] for place in places]
        values = data.index1.sel(statistic="value").values[rows]
        z = 0.0
        for i in range(len(rows)):
            for j in range(i):
                w = np.zeros(len(covariance))
                w[rows[i]], w[rows[j]] = 1.0, -1.0
                se = math.sqrt(max(float(w @ covariance @ w), 0.0))
                if se > 0:
                    z = max(z, abs(values[i] - values[j]) / se)
        spread = float(values.max() / values.min() - 1)
        most, largest = max(most, spread), max(largest, z)
        # Six pairs at seven angles: 42 looks, so 4 and not 3 standard errors.
        certain += z > _Z + 1
    verdict = NOT if not certain else REPRODUCED if most < 1 / 3 else IN_PART
    return Claim(
        12,
        "Fig. 17: the stick's initial orientation changes index 1 slightly",
        verdict,
        f"at {certain} of {len(lines[0].angle)} joint angles orientations differ for certain "
        f"(largest z = {largest:.1f}); the highest is at most {100 * most:.0f} % above the lowest",
    )
