"""Every number of the paper's Secs. 3.2, 3.3 and 3.6, by name.

The figures' own grids of angles are not in the text; ours are listed here and marked as such.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

DT = 0.001
"""Step of the solver, s (Sec. 3.2)."""
GRAVITY = 9.8
"""g (Sec. 3.2)."""
RESTITUTION = 0.1
"""e_r (Sec. 3.2)."""
TRIALS = 5000
"""Trials for each setting (Sec. 3.2)."""

WRIST_PALM_LENGTH = 500.0
"""L_p = L_11 = L_21 (Sec. 3.3.1)."""
WRIST_AMPLITUDE = math.pi / 6
"""Bound of |Theta_a1| and |Theta_a2|, radians (Sec. 3.3.1)."""
WRIST_PERIOD = 10.0
"""Seconds between new targets: 10,000 steps (Sec. 3.3.1)."""
WRIST_RAMP_TIME = 1.0
"""Seconds to reach a target: 1,000 steps (Sec. 3.3.1)."""
WRIST_MAX_STEPS = 600_000
"""Limit of steps (Sec. 3.3.1)."""
FINGERTIP_LENGTH = 0.2
"""L_g / L_p (Sec. 3.3.1)."""
GAP_WIDTHS = (0.4, 0.6, 0.8)
"""W_g / L_p (Sec. 3.3.2)."""
RADII = (0.01, 0.05, 0.1)
"""r_o / L_p (Secs. 3.3.2 and 3.3.3)."""

BEST_ANGLE_DEG = 10.0
"""theta_g at which the score is high for every radius, degrees (Sec. 3.4)."""
CORRELATION = 0.984
"""Correlation of index 1 and index 2 in Fig. 9(a) (Sec. 3.3.2)."""

ARM_PALM_LENGTH = 200.0
"""L_p (Sec. 3.6.1)."""
ARM_FINGER = (200.0, 100.0)
"""L_i1, L_i2 (Sec. 3.6.1)."""
ARM_RADIUS = 50.0
"""r_o of the circle, and half length of the stick (Sec. 3.6.1)."""
ARM_JOINT_ANGLES_DEG = (65.0, 90.0)
"""theta_i1, theta_i2 where they are held fixed, degrees (Secs. 3.6.2 and 3.6.3)."""
ARM_MAX_STEPS = 300_000
"""Limit of steps for a circle (Sec. 3.6.1)."""
STICK_MAX_STEPS = 180_000
"""Limit of steps for a stick (Sec. 3.6.1)."""


@dataclass(frozen=True)
class Figure:
    """The settings of one figure: lengths in units of L_p, angles in degrees."""

    title: str
    directions: tuple[str, ...]
    gap_widths: tuple[float, ...]
    radii: tuple[float, ...]
    angles_deg: tuple[float, ...]
    varies: str
    """The parameter with one curve for each value: "gap_width" or "radius"."""


_NARROW = tuple(float(angle) for angle in range(-20, 51, 5))
_WIDE = tuple(float(angle) for angle in range(-20, 81, 5))

FIGURES = {
    "9a": Figure(
        "Fig. 9(a): index 1 and index 2 (DoEs), W_g = 0.4 L_p",
        ("does",),
        (0.4,),
        (0.01,),
        tuple(float(a) for a in range(-20, 71, 5)),
        "gap_width",
    ),
    "9b": Figure(
        "Fig. 9(b): index 1 (DoEs) for three widths of the gap",
        ("does",),
        GAP_WIDTHS,
        (0.01,),
        _WIDE,
        "gap_width",
    ),
    "10": Figure(
        "Fig. 10: difficulty of escaping for three radii",
        ("does",),
        (0.4,),
        RADII,
        _NARROW,
        "radius",
    ),
    "11": Figure(
        "Fig. 11: ease of entering for three radii",
        ("eoen",),
        (0.4,),
        RADII,
        _NARROW,
        "radius",
    ),
    "12": Figure(
        "Fig. 12: score DoEs / EoEn for three radii",
        ("does", "eoen"),
        (0.4,),
        RADII,
        _NARROW,
        "radius",
    ),
}
"""Settings of Figs. 9-12. The angles are our choice: they span what the text discusses."""


@dataclass(frozen=True)
class ArmFigure:
    """The settings of one figure of the arm: angles in degrees."""

    title: str
    body: str
    """"circle" or "stick"."""
    angles_1_deg: tuple[float, ...]
    """theta_i1."""
    angles_2_deg: tuple[float, ...]
    """theta_i2."""
    orientations_deg: tuple[float, ...] = (0.0,)
    """The stick's orientation at the start."""
    varies: str = "theta_2"
    """The angle along the horizontal axis, "theta_1" or "theta_2"."""


_FIRST = tuple(float(angle) for angle in range(45, 81, 5))
_SECOND = tuple(float(angle) for angle in range(60, 121, 10))

ARM_FIGURES = {
    "13": ArmFigure(
        "Fig. 13: difficulty of escaping against theta_i1, theta_i2 = 90 deg",
        "circle",
        _FIRST,
        (90.0,),
        varies="theta_1",
    ),
    "14": ArmFigure(
        "Fig. 14: difficulty of escaping against theta_i2, theta_i1 = 65 deg",
        "circle",
        (65.0,),
        _SECOND,
    ),
    "17": ArmFigure(
        "Fig. 17: difficulty of escaping for a stick, by its initial orientation",
        "stick",
        (65.0,),
        _SECOND,
        (0.0, 30.0, 60.0, 90.0),
    ),
}
"""Settings of Figs. 13, 14 and 17. The angles are our choice within what the text says. Fig. 15
shows the conditions of Figs. 13 and 14 against the width between the fingertips."""

FIG15_TITLE = "Fig. 15: difficulty of escaping against the width between the fingertips"

FIGURE_NAMES = (*FIGURES, "13", "14", "15", "17")
"""The figures that can be redone."""


def max_steps(name: str) -> int:
    """The limit of steps in a figure."""
    if name in FIGURES:
        return WRIST_MAX_STEPS
    return STICK_MAX_STEPS if name == "17" else ARM_MAX_STEPS
