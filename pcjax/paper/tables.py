"""The paper's figures as text."""

from __future__ import annotations

import math

from pcjax.importing import xr
from pcjax.paper import constants as paper
from pcjax.paper.figures import curve, score_curve
from pcjax.paper.readings import LITERAL, Reading, reading_of
from pcjax.quality.indices import Estimate
from pcjax.results.schema import INDICES, NAMES
from pcjax.results.tables import estimate_text, in_columns, stick_text, wrapped


def reading_text(reading: Reading) -> list[str]:
    """What is told of a reading that is not the literal one."""
    if reading == LITERAL:
        return []
    return [wrapped(f"Under the reading '{reading.name}': {reading}. {reading.doubt}", indent=0)]


def figure_table(data: xr.Dataset) -> str:
    """A figure's numbers as text: one line per angle, one column per curve."""
    table = _wrist_table if data.attrs["figure"] in paper.FIGURES else _arm_table
    return "\n".join([*reading_text(reading_of(data)), table(data)])


def _wrist_table(data: xr.Dataset) -> str:
    settings = paper.FIGURES[str(data.attrs["figure"])]
    heads, curves = [], []
    for gap_width in settings.gap_widths:
        for radius in settings.radii:
            where = {"gap_width": gap_width, "radius": radius}
            tag = f"W_g={gap_width:g} r_o={radius:g}"
            for direction in settings.directions:
                heads.append(f"{NAMES[direction]} {tag}")
                curves.append((curve(data, direction, where=where), ",.0f"))
                if data.attrs["figure"] == "9a":
                    heads.append("index 2")
                    curves.append((curve(data, direction, "index2", where), ".4f"))
            if len(settings.directions) == 2:
                heads.append(f"score {tag}")
                curves.append((score_curve(data, where), ".4f"))
    rows = [
        [f"{angle:g}", *(_text(line.value[k], line.se[k], form) for line, form in curves)]
        for k, angle in enumerate(curves[0][0].angle)
    ]
    return in_columns(["theta_g", *heads], rows)


def _arm_table(data: xr.Dataset) -> str:
    """The numbers of a figure of the arm: one line per condition."""
    heads = ["theta_i1", "theta_i2", "orientation", "width", "index 1", "index 2", "invalid"]
    rows = []
    for k in range(data.sizes["condition"]):
        one = data.isel(condition=k, condition_2=k)
        found = [
            _text(float(one[name].sel(statistic="value")), _root(one.covariance[i, i]), form)
            for i, (name, form) in enumerate(zip(INDICES, (",.0f", ".4f"), strict=True))
        ]
        angles = [f"{float(one[name]):g}" for name in ("theta_1", "theta_2", "orientation")]
        invalid = f"{int(one['count'].sel(status_name='invalid')):,}"
        rows.append([*angles, f"{float(one.width):.1f}", *found, invalid])
    lines = [in_columns(heads, rows, keys=4)]
    if "penetration" in data:
        lines.append(
            stick_text(
                "stick",
                penetration=float(data.penetration.max()),
                skin=float(data["skin"].max()),
                travel=float(data.travel.max()),
                undone=int(data.undone.sum()),
                invalid=int(data["count"].sel(status_name="invalid").sum()),
            )
        )
    return "\n".join(lines)


def _root(variance: xr.DataArray) -> float:
    return math.sqrt(max(float(variance), 0.0))


def _text(value: float, se: float, form: str) -> str:
    return estimate_text(Estimate(value, se, math.nan, math.nan), form)
