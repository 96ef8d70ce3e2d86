"""Kept results are read with distrust: whole, of a size that can be, and what a result can hold."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pcjax.model.scenario import DIRECTIONS
from pcjax.quality.indices import Estimate
from pcjax.results.files import read_plain, unsealed
from pcjax.results.netcdf import read_netcdf, told, try_netcdf
from pcjax.simulate.outcomes import STATUS_NAMES

_SIGNATURE = b"\x89HDF\r\n\x1a\n"

_WATCHED = ("penetration", "travel", "undone")


def load_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Reads a result of any kind, and believes nothing that it says of itself.

    Raises:
        ValueError: there is none, it is damaged, or it holds what no result can; in one line.
    """
    path = Path(path)
    kept = read_plain(path)
    try:
        if not kept.startswith(_SIGNATURE):
            raise ValueError("it is no netCDF (HDF5)")
        if unsealed(kept) is None:
            # Other programs' files have no seal, nor had ours at first: they end where they say.
            if _told_end(kept) != len(kept):
                raise ValueError("it has been cut short or changed")
            try_netcdf(path)
        data = read_netcdf(path)
        _check(data)
    except Exception as error:  # of every kind, where HDF5 and its wrappers meet damage
        raise ValueError(f"{path} is no result that can be read: {told(error)}") from None
    return data


def _told_end(kept: bytes) -> int:
    """Where an HDF5 file's first lines say that it ends."""
    place = 40 if kept[8] < 2 else 28
    return int.from_bytes(kept[place : place + 8], "little")


# ------------------------------------------------------------------------ what a result can hold


def _check(data: xr.Dataset) -> None:
    attrs = data.attrs
    if not str(attrs.get("made_by", "")).startswith("pcjax"):
        raise ValueError("pcjax did not make it")
    if "sweep" in attrs:
        _check_sweep(data)
    elif "covariance" in data:
        _check_grid(data)
    elif "escape_step" in data:
        _check_evaluation(data)


def _check_evaluation(data: xr.Dataset) -> None:
    limit = _check_run(data, "radius", "wall_seconds")
    each = ("direction", "trial")
    _check_directions(data.direction.values)
    for name, dims in {
        "limbs": ("direction", "limb", "end"),
        "goal": ("direction", "end"),
        "passage": ("direction", "end"),
        "gap": ("direction",),
        "start": ("direction", "coordinate"),
    }.items():
        check_numbers(data, name, dims)
    if data.sizes["end"] != 4 or data.sizes["coordinate"] != 2:
        raise ValueError("its limbs are none")
    _check_trials(data, each, limit, tuple(STATUS_NAMES))
    _check_real(data, "dt", nan=True)
    if "skin" in data.attrs:
        _check_real(data, "skin")
        for name in _WATCHED:
            check_numbers(data, name, each, low=0, nan=True)
    for name in ("width", "orientation"):
        if name in data.attrs:
            _check_real(data, name)


def _check_sweep(data: xr.Dataset) -> None:
    limit = _check_run(data)
    trials = _check_count(data, "trials")
    place = tuple(map(str, variable_of(data, "problem").dims))
    if not all(isinstance(text, str) for text in data.problem.values.flat):
        raise ValueError("problem is no text")
    each = (*place, "direction")
    _check_directions(data.direction.values)
    _check_labels(data, "statistic", [f.name for f in fields(Estimate)])
    _check_labels(data, "status_name", list(STATUS_NAMES.values()))
    zipped = place == ("condition",)
    for name in [str(n) for n in data.coords if data[n].dims == place] if zipped else place:
        check_numbers(data, name, place if zipped else (name,))
    _check_estimates(data, "index1", (*each, "statistic"), 1, limit)
    _check_estimates(data, "index2", (*each, "statistic"), 0, 1)
    if "score" in data:
        _check_labels(data, "index", ["index1", "index2"])
        _check_estimates(data, "score", (*place, "index", "statistic"), 0, math.inf)
    check_numbers(data, "count", (*each, "status_name"), low=0, high=trials, whole=True)
    check_numbers(data, "trials_used", place, low=0, high=trials, whole=True)
    if (data["count"].sum("status_name") != data.trials_used).any():
        raise ValueError("count does not sum up to trials_used")
    check_numbers(data, "gap", each, low=0, nan=True)
    check_numbers(data, "dt", each, low=0, nan=True)
    for name in _WATCHED:
        if name in data:
            check_numbers(data, name, each, low=0, nan=True)
    if "escape_step" in data:
        _check_trials(data, (*each, "trial"), limit, (0, *STATUS_NAMES))


def _check_grid(data: xr.Dataset) -> None:
    limit = _check_run(data, "wall_seconds")
    trials = _check_count(data, "trials")
    count = data.sizes["condition"]
    place, other = ("condition",), ("condition_2",)
    _check_labels(data, "estimate", ["index1", "index2"])
    _check_labels(data, "status", list(STATUS_NAMES.values()))
    check_numbers(data, "index1", place, low=1, high=limit)
    check_numbers(data, "index2", place, low=0, high=1)
    check_numbers(data, "covariance", ("estimate", "estimate_2", *place, *other))
    if data.covariance.shape != (2, 2, count, count):
        raise ValueError("covariance is of another shape")
    check_numbers(data, "count", (*place, "status"), low=0, high=trials, whole=True)
    if (data["count"].sum("status") != trials).any():
        raise ValueError("count does not sum up to trials")
    check_numbers(data, "gap", place, low=0)
    check_numbers(data, "dt", place, low=0, nan=True)
    if "object_width" in data:
        check_numbers(data, "object_width", place, low=0)
    if "penetration" in data:
        _check_real(data, "skin")
        for watched in _WATCHED:
            check_numbers(data, watched, place, low=0, nan=True)


def _check_run(data: xr.Dataset, *real: str) -> int:
    """Checks what every result says of its run; returns the limit, in steps."""
    _check_count(data, "seed", 0, 2**32 - 1)
    if _check_count(data, "precision") not in (32, 64):
        raise ValueError(f"precision is {data.attrs['precision']}")
    check_text(data, "engine")
    for name in real:
        _check_real(data, name)
    return _check_count(data, "max_steps")


def check_text(data: xr.Dataset, name: str) -> None:
    if not isinstance(data.attrs.get(name), str):
        raise ValueError(f"{name} is no text")


def _check_count(data: xr.Dataset, name: str, low: int = 1, high: int = 2**31 - 1) -> int:
    value = data.attrs.get(name)
    if not isinstance(value, int | np.integer) or not low <= value <= high:
        raise ValueError(f"{name} is {value}")
    return int(value)


def _check_real(data: xr.Dataset, name: str, *, nan: bool = False) -> None:
    value = data.attrs.get(name)
    fine = isinstance(value, float | int | np.floating | np.integer)
    if not fine or not (math.isfinite(value) or (nan and math.isnan(value))):
        raise ValueError(f"{name} is {value}")


def variable_of(data: xr.Dataset, name: str) -> xr.DataArray:
    if name not in data.variables:
        raise ValueError(f"{name} is missing")
    return data[name]


def _values(data: xr.Dataset, name: str, dims: Sequence[Any], kinds: str) -> np.ndarray:
    found = variable_of(data, name)
    if found.dims != tuple(dims):
        raise ValueError(f"{name} goes along {', '.join(map(str, found.dims)) or 'nothing'}")
    if found.dtype.kind not in kinds:
        raise ValueError(f"{name} is of the type {found.dtype}")
    return found.values


def check_numbers(
    data: xr.Dataset,
    name: str,
    dims: Sequence[Any],
    *,
    low: float = -math.inf,
    high: float = math.inf,
    nan: bool = False,
    whole: bool = False,
) -> None:
    """Raises ValueError unless a variable has these dimensions and finite numbers in the range."""
    values = _values(data, name, dims, "iu" if whole else "f")
    there = values[~np.isnan(values)] if nan else values
    if not np.isfinite(there).all() or (there < low).any() or (there > high).any():
        raise ValueError(f"{name} has values that cannot be")


def _check_estimates(
    data: xr.Dataset, name: str, dims: Sequence[Any], low: float, high: float
) -> None:
    """Raises ValueError unless estimates, where they are defined, lie in the range."""
    value, se, *_ = np.moveaxis(_values(data, name, dims, "f"), -1, 0)
    if (value < low).any() or (value > high).any() or (se < 0).any():
        raise ValueError(f"{name} has values that cannot be")


def _check_trials(data: xr.Dataset, dims: Sequence[Any], limit: int, codes: Sequence[int]) -> None:
    """Raises ValueError unless every trial ended as one can; 0 in `codes`: or was not run."""
    if not np.isin(_values(data, "status", dims, "iu"), codes).all():
        raise ValueError("status has values that cannot be")
    check_numbers(data, "escape_step", dims, low=0, high=limit, whole=True)
    if ((data.escape_step.values == 0) & (data.status.values != 0)).any():
        raise ValueError("escape_step has values that cannot be")


def _check_directions(found: np.ndarray) -> None:
    if list(found) not in (["does", "eoen"], ["does"], ["eoen"]):
        raise ValueError(f"its directions are not of {', '.join(DIRECTIONS)}")


def _check_labels(data: xr.Dataset, name: str, labels: list[str]) -> None:
    if variable_of(data, name).values.tolist() != labels:
        raise ValueError(f"{name} is not {', '.join(labels)}")
