"""Text tables: numbers in words, in columns, and in lines of at most `WIDTH` characters."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from pcjax.importing import xr
from pcjax.quality.indices import Estimate
from pcjax.results.schema import NAMES, labels_of, place_of
from pcjax.words import in_ascii

WIDTH = 100
"""Characters of a line, also where a terminal spells what it lacks."""

LONGEST = 60
"""Conditions in a table unless all are asked for."""

_APART, _LONGEST_CELL = "  ", 60


# ---------------------------------------------------------------------------------------- words


def engines_text(names: str, dt: Any) -> str:
    """Engines in words, with the steps (s) that those which step took; NaN marks the others."""
    steps = np.unique(np.atleast_1d(dt)[np.isfinite(np.atleast_1d(dt))])
    if len(steps) == 0:
        return f"{names} engine"
    span = f"{steps[0]:.3g}" if len(steps) == 1 else f"{steps[0]:.3g} to {steps[-1]:.3g}"
    return f"{names} engine (dt = {span} s)"


def estimate_text(estimate: Estimate, form: str) -> str:
    """Value and standard error; in words where there is none."""
    if math.isnan(estimate.value):
        return "undefined"
    error = "unknown" if math.isnan(estimate.se) else f"{estimate.se:{form}}"
    return f"{estimate.value:{form}} ± {error}"


def interval_text(estimate: Estimate, form: str) -> str:
    """The interval in brackets, nothing where there is none."""
    if math.isnan(estimate.low):
        return ""
    return f"[{estimate.low:{form}}, {estimate.high:{form}}]"


def stick_text(
    name: str, *, penetration: float, skin: float, travel: float, undone: float, invalid: int
) -> str:
    """How well the contacts of what turns were resolved, in a line or two."""
    if not travel > 0:  # by an engine that takes no steps
        return wrapped(
            f"{name}: worst overlap {penetration:.2g} of a skin of {skin:.2g}, "
            f"{invalid:,} trials went wrong"
        )
    return wrapped(
        f"{name}: worst penetration {penetration:.2g} of a skin of {skin:.2g}, farthest travel in "
        f"a step {travel:.3g}, {undone:,.0f} steps undone, {invalid:,} trials went wrong"
    )


def shortened(name: str, most: int = 24) -> str:
    """A name without its beginning where it is long."""
    return name if len(name) <= most else f"...{name[3 - most :]}"


# --------------------------------------------------------------------------------------- layout


def wrapped(text: str, indent: int = 2) -> str:
    """A text in lines of at most `WIDTH`, all but the first indented."""
    spare = len(in_ascii(text)) - len(text)
    return textwrap.fill(text, WIDTH - spare, subsequent_indent=" " * indent)


def in_columns(
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    keys: int = 1,
    left: Collection[int] = (),
) -> str:
    """A table: a line of heads, a line for each row; if it is too wide, in parts under each other.

    Arguments:
        heads: of the columns.
        rows: cells. Those of a column are aligned at "±", or to the right.
        keys: how many columns say what a row is; each part begins with them. Where they are too
            many for that, rows are numbered.
        left: which columns are aligned to the left.
    """
    turned = enumerate(zip(heads, *rows, strict=True))
    columns = [_aligned(column, left=k in left) for k, column in turned]
    first, others = columns[:keys], columns[keys:]
    widest = max(map(_wide, others), default=0)
    if sum(map(_wide, first)) + widest > WIDTH:
        numbers = ["#", *map(str, range(1, len(rows) + 1))]
        first, others = [_aligned(numbers)], columns
    lead = sum(map(_wide, first))
    parts = _shared_out(others, WIDTH - lead + len(_APART)) or [[]]
    texts = [
        "\n".join(_APART.join(cells).rstrip() for cells in zip(*first, *part, strict=True))
        for part in parts
    ]
    return "\n\n".join(texts)


def _aligned(cells: Sequence[str], *, left: bool = False) -> list[str]:
    """A column, its head first, in cells of one width."""
    head, *body = (shortened(cell, _LONGEST_CELL) for cell in cells)
    pairs = [cell.partition(" ± ") for cell in body]
    before, after = (max((len(pair[k]) for pair in pairs if pair[1]), default=0) for k in (0, 2))
    body = [
        f"{value:>{before}} ± {error:<{after}}" if sign else value for value, sign, error in pairs
    ]
    wide = max(map(len, [head, *body]))
    return [cell.ljust(wide) if left else cell.rjust(wide) for cell in (head, *body)]


def _wide(column: Sequence[str]) -> int:
    """Characters that a column takes, with what keeps it apart."""
    return max(len(in_ascii(cell)) for cell in column) + len(_APART)


def _shared_out(columns: Sequence[list[str]], room: int) -> list[list[list[str]]]:
    """Columns in parts that each find room, about as many in each."""
    parts: list[list[list[str]]] = []
    for most in range(len(columns), 0, -1):
        parts = [list(columns[k : k + most]) for k in range(0, len(columns), most)]
        if all(sum(map(_wide, part)) <= room for part in parts):
            break
    return parts


# ------------------------------------------------------------------------ sweeps and other grids


def conditions_table(data: xr.Dataset, most: int | None = LONGEST) -> str:
    """A sweep's or a grid's numbers as text: one line for each condition.

    Arguments:
        data: of the kind "sweep" or "grid".
        most: conditions that are shown; None for all.
    """
    place, labels = place_of(data), labels_of(data)
    ways = [str(d) for d in data.direction.values] if "direction" in data.dims else [""]
    heads = [*labels, *(f"{NAMES.get(d, '')} index 1".strip() for d in ways)]
    heads += ["score"] if "score" in data else ["index 2"] if ways == [""] else []
    heads += ["invalid", "trials"]
    rows, problems = [], {}
    places = list(itertools.product(*(range(data.sizes[dim]) for dim in place)))
    for where in places[:most]:
        one = data.isel(dict(zip(place, where, strict=True)))
        names = [_label_text(one[name].item()) for name in labels]
        problem = str(one.problem.values) if "problem" in one else ""
        if problem:
            label = ", ".join(f"{n} {value}" for n, value in zip(labels, names, strict=True))
            problems.setdefault(problem, []).append(label)
            rows.append([*names, *["-"] * (len(heads) - len(names))])
            continue
        estimates = [(one.index1.sel(direction=d) if d else one.index1, ",.0f") for d in ways]
        if "score" in one:
            estimates.append((one.score.sel(index="index1"), ".4f"))
        elif ways == [""]:
            estimates.append((one.index2, ".4f"))
        counts = one["count"]
        used = one.trials_used if "trials_used" in one else data.attrs["trials"]
        rows.append(
            [
                *names,
                *(estimate_text(Estimate(*found.values.tolist()), f) for found, f in estimates),
                f"{int(counts.sel(status_name='invalid').sum()):,}",
                f"{int(used):,}",
            ]
        )
    lines = [in_columns(heads, rows, keys=len(labels))]
    if len(places) > len(rows):
        lines.append(f"... {len(places) - len(rows):,} more: 'pcjax show --all'")
    for problem, at in problems.items():
        more = f" and {len(at) - 1:,} more" if at[1:] else ""
        lines.append(wrapped(f"{at[0]}{more}: {problem}"))
    attrs = data.attrs
    lines.append(
        wrapped(
            f"limit {attrs['max_steps']:,} steps, seed {attrs['seed']}, "
            f"{engines_text(attrs['engine'], data.dt.values)}, float{attrs['precision']}; "
            "value ± standard error"
        )
    )
    return "\n".join(lines)


def _label_text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
