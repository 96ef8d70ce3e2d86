"""What files of results say of themselves: what was run, by whom and when."""

from __future__ import annotations

import dataclasses
import datetime
import json
from collections.abc import Mapping, Sequence
from typing import Any

import jax

from pcjax.model.scenario import Scenario
from pcjax.words import package_version


def parameters(scenario: Scenario) -> dict[str, float]:
    """Every number of a scenario by name, for instance `hand.angles[0][2]`."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(scenario)
    numbers = {jax.tree_util.keystr(path).lstrip("."): float(leaf) for path, leaf in leaves}
    parts: dict[str, Any] = {"drive": scenario.drive, "body": scenario.body}
    fixed = {
        f"{part}.{f.name}": getattr(thing, f.name)
        for part, thing in parts.items()
        for f in dataclasses.fields(thing)
        if f.metadata.get("static")
    }
    # That a body turns, as any does unless it is said, is no number.
    return numbers | {name: value for name, value in fixed.items() if value is not True}


def conditions(scenarios: Mapping[str, Scenario] | Sequence[Scenario]) -> dict[str, str]:
    """Attributes that say what was run: kinds of hand, body, drive and contact law, and every
    number, by direction or in the order of the conditions."""
    named = isinstance(scenarios, Mapping)
    some: Sequence[Scenario] = list(scenarios.values()) if named else scenarios
    numbers = [parameters(scenario) for scenario in some]
    named_numbers: Any = dict(zip(scenarios, numbers, strict=True)) if named else numbers
    kinds = {
        part: ", ".join(dict.fromkeys(type(getattr(s, part)).__name__ for s in some))
        for part in ("hand", "body", "drive", "law")
    }
    return kinds | {"parameters": json.dumps(named_numbers)}


def provenance(run: Mapping[str, Any], *, dated: bool = True) -> dict[str, Any]:
    """Attributes that say how a result was made: versions and the run's own settings, and the date
    but where equal runs have to give equal files."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return {
        "made_by": "pcjax",
        "pcjax_version": package_version(),
        "jax_version": jax.__version__,
        "device": jax.local_devices()[0].device_kind,
        **({"created": now} if dated else {}),
        **run,
    }
