"""Numbers in words: estimates in columns, engines by name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pcjax.quality.indices import (
    Estimate,
)


def engines_text(names: str, dt: Any) -> str:
    """Engines in words, with the steps (s) that those which step took; NaN marks the others."""
    steps = np.unique(np.atleast_1d(dt)[np.isfinite(np.atleast_1d(dt))])
    if len(steps) == 0:
        return f"{names} engine"
    span = f"{steps[0]:.3g}" if len(steps) == 1 else f"{steps[0]:.3g} to {steps[-1]:.3g}"
    return f"{names} engine (dt = {span} s)"


def in_columns(estimate: Estimate, form: str, wide: int, wide_error: int) -> str:
    """Value and standard error in columns; in words where there is none."""
    if math.isnan(estimate.value):
        return f"{'undefined':>{wide}}{'':{wide_error + 3}}"
    error = "unknown" if math.isnan(estimate.se) else f"{estimate.se:{form}}"
    return f"{estimate.value:>{wide}{form}} ± {error:<{wide_error}}"


def interval_text(estimate: Estimate, form: str) -> str:
    """The interval in brackets, nothing where there is none."""
    if math.isnan(estimate.low):
        return ""
    return f"[{estimate.low:{form}}, {estimate.high:{form}}]"
