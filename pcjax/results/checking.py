"""Whether a dataset is what `pcjax.results.schema` says of its kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pcjax.importing import xr
from pcjax.results.schema import (
    ATTRIBUTES,
    EVALUATIONS,
    INDICES,
    KINDS,
    LABELS,
    WATCHED,
    Attribute,
    Variable,
    dims_of,
    labels_of,
    length_unit_of,
    place_of,
    variable_of,
)
from pcjax.simulate.outcomes import STATUS_NAMES
from pcjax.units import check_units

_CODES = {"real": "f", "whole": "iu", "flag": "b", "text": "UOT"}


def check_dataset(data: xr.Dataset) -> None:
    """Believes nothing that a result says of itself.

    Raises:
        ValueError: it is none, or holds what none can.
    """
    kind = data.attrs.get("kind")
    if kind not in KINDS:
        raise ValueError(f"it is none of {', '.join(one.noun for one in KINDS.values())}")
    for name, what in {**ATTRIBUTES, **KINDS[kind].attributes}.items():
        check_attribute(data, name, what)
    if data.attrs["precision"] not in (32, 64):
        raise ValueError(f"precision is {data.attrs['precision']}")
    check_units(length_unit_of(data))
    check_variables(data)


def check_variables(data: xr.Dataset) -> None:
    """The same of the variables alone."""
    kind = KINDS[data.attrs["kind"]]
    place = place_of(data)
    for name, what in {**kind.variables, **kind.optional}.items():
        if name in kind.optional and name not in data.variables:
            continue
        _check_variable(data, name, what, dims_of(what, kind, place), gaps=kind.gaps)
    for dim, some in LABELS.items():
        if dim in data.dims and variable_of(data, dim).values.tolist() not in some:
            raise ValueError(f"{dim} is not {' or '.join(', '.join(one) for one in some)}")
    for name in place if place != ("condition",) else ():
        check_numbers(data, name, (name,))
    _check_together(data)


def _check_together(data: xr.Dataset) -> None:
    """What has to fit together."""
    kind, limits = data.attrs["kind"], data.attrs
    if kind == "sweep":
        for name in labels_of(data):
            check_numbers(data, name, data[name].dims)
    if "count" in data and kind not in EVALUATIONS:
        whole = data["trials_used"] if kind == "sweep" else limits["trials"]
        if (data["count"].sum("status_name") != whole).any():
            raise ValueError("count does not sum up to the trials")
    if "gap_fine" in data:
        for name in map(str, data.gap_fine.dims):
            check_numbers(data, name, (name,))
    if "index" in data.dims and kind != "map" and tuple(data["index"].values) != INDICES:
        raise ValueError(f"index is not {', '.join(INDICES)}")
    if "covariance" in data:
        count = data.sizes["condition"]
        if data.covariance.shape != (2, 2, count, count):
            raise ValueError("covariance is of another shape")
    if "status" in data:
        status = data.status.values
        if not np.isin(status, [*STATUS_NAMES, *([0] if kind == "sweep" else [])]).all():
            raise ValueError("status has values that cannot be")
        if ((data.escape_step.values == 0) & (status != 0)).any():
            raise ValueError("escape_step has values that cannot be")
    if kind == "evaluation" and "skin" in limits:
        check_attribute(data, "skin", Attribute("real", 0))
        for name in WATCHED:
            variable_of(data, name)


def check_attribute(data: xr.Dataset, name: str, what: Attribute) -> None:
    """Raises ValueError unless an attribute is there, and what it has to be."""
    value = data.attrs.get(name)
    if what.numbers == "text":
        if not isinstance(value, str):
            raise ValueError(f"{name} is no text")
        return
    whole = isinstance(value, int | np.integer)
    real = whole or isinstance(value, float | np.floating)
    if not (whole if what.numbers == "whole" else real):
        raise ValueError(f"{name} is {value}")
    number = float(value)  # pyright: ignore[reportArgumentType]
    missing = what.nan and math.isnan(number)
    if not (missing or (math.isfinite(number) and what.low <= number <= what.high)):
        raise ValueError(f"{name} is {value}")


def check_numbers(data: xr.Dataset, name: str, dims: Sequence[Any]) -> None:
    """Raises ValueError unless a variable goes along these dimensions and has finite numbers."""
    _check_variable(data, name, Variable(tuple(dims)), tuple(dims))


def _check_variable(
    data: xr.Dataset, name: str, what: Variable, dims: tuple[str, ...], *, gaps: bool = False
) -> None:
    found = variable_of(data, name)
    if found.dims != dims:
        raise ValueError(f"{name} goes along {', '.join(map(str, found.dims)) or 'nothing'}")
    if found.dtype.kind not in _CODES[what.numbers]:
        raise ValueError(f"{name} is of the type {found.dtype}")
    values, high = found.values, what.high
    if what.numbers == "text":
        if not all(isinstance(text, str) for text in values.flat):
            raise ValueError(f"{name} is no text")
        return
    if what.numbers == "flag":
        return
    high = float(data.attrs[high] if isinstance(high, str) else high)
    if dims[-1:] == ("statistic",):  # an error or an interval may be missing, or without end
        value, se, *_ = np.moveaxis(values, -1, 0)
        fine = not ((value < what.low).any() or (value > high).any() or (se < 0).any())
    else:
        there = values[~np.isnan(values)] if what.nan or gaps else values
        fine = np.isfinite(there).all() and (there >= what.low).all() and (there <= high).all()
    if not fine:
        raise ValueError(f"{name} has values that cannot be")
