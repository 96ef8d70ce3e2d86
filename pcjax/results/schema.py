"""What files of results say about themselves, and the estimates that all of them hold."""

from __future__ import annotations

import dataclasses
import datetime
import json
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Int32, UInt8

from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID
from pcjax.quality.indices import (
    UNDEFINED,
    Estimate,
    index1,
    index2,
    ratio,
)
from pcjax.simulate.outcomes import LIMIT
from pcjax.words import package_version

WATCHED = {
    "penetration": {
        "units": "model length",
        "long_name": "deepest that the stick was inside its skin at the end of a step",
    },
    "travel": {
        "units": "model length",
        "long_name": "farthest that a point of the stick went in a step, seen from the hand",
    },
    "undone": {
        "units": "steps",
        "long_name": "steps in which the stick had to stay where it was",
    },
}
"""What is kept of each trial of a stick."""

NAMES = {"does": "DoEs", "eoen": "EoEn"}
"""Directions: difficulty of escaping and ease of entering."""


def parameters(scenario: Scenario) -> dict[str, float]:
    """Every number of a scenario by name, for instance `hand.angles[0][2]`."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(scenario)
    numbers = {jax.tree_util.keystr(path).lstrip("."): float(leaf) for path, leaf in leaves}
    drive: Any = scenario.drive
    fixed = [f.name for f in dataclasses.fields(drive) if f.metadata.get("static")]
    return numbers | {f"drive.{name}": getattr(drive, name) for name in fixed}


def conditions(scenarios: Mapping[str, Scenario] | Sequence[Scenario]) -> dict[str, str]:
    """Attributes that say what was run: kinds of body and drive, and every number, by direction or
    in the order of the conditions."""
    named = isinstance(scenarios, Mapping)
    some: Sequence[Scenario] = list(scenarios.values()) if named else scenarios
    numbers = [parameters(scenario) for scenario in some]
    told: Any = dict(zip(scenarios, numbers, strict=True)) if named else numbers
    return {
        "body": ", ".join(dict.fromkeys(type(s.body).__name__ for s in some)),
        "drive": ", ".join(dict.fromkeys(type(s.drive).__name__ for s in some)),
        "parameters": json.dumps(told),
    }


def provenance(run: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes that say how a result was made: versions, date and the run's own settings."""
    return {
        "made_by": "pcjax",
        "pcjax_version": package_version(),
        "jax_version": jax.__version__,
        "device": jax.local_devices()[0].device_kind,
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        **run,
    }


def indices_of(
    steps: Int32[np.ndarray, " trials"],
    status: UInt8[np.ndarray, " trials"],
    limit: int,
    *,
    caged: bool,
) -> dict[str, Estimate]:
    """Index 1 and index 2 over the trials that did not go wrong; `caged`: in a full cage."""
    valid = status != INVALID
    if not valid.any():
        return {"index1": UNDEFINED, "index2": UNDEFINED}
    lost = int(np.sum(~valid))
    return {
        "index1": index1(steps[valid], limit, certain=caged, lost=lost),
        "index2": index2(status[valid] == LIMIT, certain=caged, lost=lost),
    }


def score_of(
    steps: Int32[np.ndarray, "2 trials"],
    status: UInt8[np.ndarray, "2 trials"],
    limit: int,
    *,
    caged: tuple[bool, bool],
) -> dict[str, Estimate]:
    """The score (18) by index 1 and by index 2, of DoEs and EoEn on the same trials."""
    valid = (status != INVALID).all(axis=0)
    if not valid.any():
        return {"index1": UNDEFINED, "index2": UNDEFINED}
    lost = int(np.sum(~valid))
    held, stayed = steps[:, valid].astype(float), (status[:, valid] == LIMIT).astype(float)
    return {
        "index1": ratio(held[0], held[1], limit, certain=caged, lost=lost),
        "index2": ratio(stayed[0], stayed[1], 1.0, certain=caged, lost=lost),
    }
