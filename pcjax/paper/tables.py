"""The paper's figures as text."""

from __future__ import annotations

import math

import xarray as xr

from pcjax.paper import constants as paper
from pcjax.paper.figures import curve, score_curve
from pcjax.results.schema import NAMES


def figure_table(data: xr.Dataset) -> str:
    """A figure's numbers as text: one line per angle, one column per curve."""
    if data.attrs["figure"] not in paper.FIGURES:
        return _arm_table(data)
    settings = paper.FIGURES[str(data.attrs["figure"])]
    columns, curves = [], []
    for gap_width in settings.gap_widths:
        for radius in settings.radii:
            where = {"gap_width": gap_width, "radius": radius}
            tag = f"W_g={gap_width:g} r_o={radius:g}"
            for direction in settings.directions:
                columns.append(f"{NAMES[direction]} {tag}")
                curves.append((curve(data, direction, where=where), ",.0f"))
                if data.attrs["figure"] == "9a":
                    columns.append("index 2")
                    curves.append((curve(data, direction, "index2", where), ".4f"))
            if len(settings.directions) == 2:
                columns.append(f"score {tag}")
                curves.append((score_curve(data, where), ".4f"))
    lines = ["theta_g  " + "  ".join(f"{name:>24}" for name in columns)]
    for k, angle in enumerate(curves[0][0].angle):
        cells = (f"{line.value[k]:{form}} ± {line.se[k]:{form}}" for line, form in curves)
        lines.append(f"{angle:>7g}  " + "  ".join(f"{cell:>24}" for cell in cells))
    return "\n".join(lines)


def _arm_table(data: xr.Dataset) -> str:
    """The numbers of a figure of the arm: one line per condition."""
    names = {"theta_1": "theta_i1", "theta_2": "theta_i2", "orientation": "orientation"}
    names |= {"width": "width", "index1": "index 1", "index2": "index 2", "invalid": "invalid"}
    lines = ["  ".join(f"{name:>16}" for name in names.values())]
    for k in range(data.sizes["condition"]):
        one = data.isel(condition=k)
        se = [math.sqrt(max(float(one.covariance[i, i, k]), 0.0)) for i in (0, 1)]
        cells = [f"{float(one[name]):g}" for name in ("theta_1", "theta_2", "orientation")]
        cells += [f"{float(one.width):.1f}", f"{float(one.index1):,.0f} ± {se[0]:,.0f}"]
        cells += [f"{float(one.index2):.4f} ± {se[1]:.4f}"]
        cells += [f"{int(one['count'].sel(status='invalid'))}"]
        lines.append("  ".join(f"{cell:>16}" for cell in cells))
    if "penetration" in data:
        lines.append(
            f"stick: worst penetration {float(data.penetration.max()):.2g} of a skin of "
            f"{float(data.attrs['skin']):.2g}, farthest travel in a step "
            f"{float(data.travel.max()):.3g}, {int(data.undone.sum())} steps undone, "
            f"{int(data['count'].sel(status='invalid').sum())} "
            "trials went wrong"
        )
    return "\n".join(lines)
