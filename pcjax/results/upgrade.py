"""Files as earlier versions wrote them, with today's names and dimensions. No number changes; what
they did not keep is NaN or "not kept"."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pcjax.importing import xr
from pcjax.results.schema import INDICES, STATISTICS, KindName, dataset_of

_NOT_KEPT = "not kept"

_THIN = {"thickness": 0.0}
"""Of hands from before limbs had a thickness."""


def upgraded(data: xr.Dataset) -> xr.Dataset:
    """A dataset of any version in the form of this one; what is no result stays as it is."""
    if data.attrs.get("kind") == "evaluation":
        return data.assign_attrs(_complete(data.attrs))
    kind = None if "kind" in data.attrs else _kind_of(data)
    if kind is None:
        return data
    data = _UPGRADES[kind](data)
    parts = dict.fromkeys(("hand", "body", "drive", "law"), _NOT_KEPT)
    return data.assign_attrs(parts | {"parameters": "{}"} | data.attrs | {"kind": kind})


def _complete(attrs: dict[str, Any]) -> dict[str, Any]:
    """An evaluation's attributes with those that came later."""
    known = {"least_passage": attrs["object_width"]} if "object_width" in attrs else {}
    return _THIN | known | attrs


def _kind_of(data: xr.Dataset) -> KindName | None:
    """What a file of before files said so is."""
    if "sweep" in data.attrs:
        return "sweep"
    if "covariance" in data:
        return "grid"
    if "escape_step" in data:
        return "evaluation"
    return "map" if {"score", "se"} <= set(data) and "hands" in data.attrs else None


def _evaluation(data: xr.Dataset) -> xr.Dataset:
    """One without the object's outline, or with its `width`."""
    attrs = dict(data.attrs)
    radius, angle = (float(attrs.get(name, math.nan)) for name in ("radius", "orientation"))
    attrs.setdefault("object_width", attrs.pop("width", 2 * radius))
    attrs.setdefault("trials", data.sizes["trial"])
    data = _with_attrs(data, _complete(attrs))
    if "outline" in data:
        return data
    corners, rounding = np.zeros((1, 2)), radius
    if not math.isnan(angle):
        along = radius * np.array([math.cos(angle), math.sin(angle)])
        corners, rounding = np.array([-along, along]), 0.0
    placed = data.start.values[:, None, :] + corners
    like = dataset_of("evaluation", {"outline": placed}, {}, {})
    like.outline.attrs["rounding"] = rounding
    return data.assign(outline=like.outline.variable)


def _grid(data: xr.Dataset) -> xr.Dataset:
    """One that has the standard errors in its covariance alone, and a stick's skin once."""
    names = {"status": "status_name", "estimate": "index", "estimate_2": "index_2"}
    data = data.rename({old: new for old, new in names.items() if old in data.dims})
    attrs = dict(data.attrs)
    values = {}
    for k, name in enumerate(INDICES):
        errors = np.sqrt(np.maximum(np.diag(data.covariance.values[k, k]), 0.0))
        missing = np.full_like(errors, np.nan)
        values[name] = np.stack([data[name].values, errors, missing, missing], axis=1)
    if "skin" in attrs:
        values["skin"] = np.full(data.sizes["condition"], float(attrs.pop("skin")))
    if "trials_used" in attrs:
        attrs["trials_right"] = attrs.pop("trials_used")
    new = dataset_of("grid", values, {}, {}, place=("condition",))
    data = data.drop_vars(INDICES).assign(dict(new.data_vars))
    return _with_attrs(data.assign_coords(statistic=list(STATISTICS)), attrs)


def _map(data: xr.Dataset) -> xr.Dataset:
    """One whose score and standard error were two variables."""
    place = tuple(map(str, data.score.dims))
    missing = np.full(data.score.shape, np.nan)
    rows = np.stack([data.score.values, data.se.values, missing, missing], axis=-1)
    new = dataset_of(
        "map",
        {"score": rows[..., None, :]},
        {"index": [str(data.attrs["objective"])]},
        {},
        place=place,
    )
    data = data.drop_vars(["score", "se"]).assign(score=new.score.variable)
    attrs = {"engine": _NOT_KEPT, "precision": 32} | data.attrs
    return data.assign_coords(index=new.index, statistic=new.statistic).assign_attrs(attrs)


def _with_attrs(data: xr.Dataset, attrs: dict[str, Any]) -> xr.Dataset:
    """The dataset with these attributes, and no others."""
    data = data.copy()
    data.attrs = attrs
    return data


_UPGRADES: dict[KindName, Callable[[xr.Dataset], xr.Dataset]] = {
    "evaluation": _evaluation,
    "sweep": lambda data: data,
    "grid": _grid,
    "map": _map,
}
