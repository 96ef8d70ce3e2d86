"""How high the object of a study has to climb to get out of its hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pcjax.quality.energy import TILTS, EscapeEnergy, energy_of
from pcjax.results.schema import NAMES
from pcjax.results.tables import wrapped
from pcjax.study.spec import Study
from pcjax.units import length_in_words


def energy_of_study(study: Study, *, tilts: int = TILTS) -> dict[str, EscapeEnergy]:
    """`pcjax.energy` of the hand of a study in each direction that the study asks for; its sweep
    and its run are not looked at.

    Arguments:
        study: what is looked at.
        tilts: as for `pcjax.energy`.

    Raises:
        ValueError: see `pcjax.energy`, and EoEn of a hand that has none.

    Examples:
        >>> import pcjax
        >>> study = pcjax.Study(pcjax.box_hand(0.0), pcjax.Circle(25.0))
        >>> found = pcjax.energy_of_study(study)
        >>> print(f"{found['does'].at(0.0).from_rest:.1f} {found['eoen'].at(0.0).from_rest:.1f}")
        475.0 575.0
    """
    return {d: energy_of(scenario, tilts) for d, scenario in study.scenarios().items()}


def energy_table(found: Mapping[str, EscapeEnergy], units: str) -> str:
    """The climbs of each direction in words, with the unit of lengths.

    Arguments:
        found: by direction, from `energy_of_study`.
        units: of lengths (see `pcjax.units`).
    """
    return (
        "\n".join(line for d, one in found.items() for line in _lines(NAMES[d], one))
        + "\n"
        + ("\n".join(wrapped(note) for note in _notes(found, units)))
    )


def _lines(name: str, found: EscapeEnergy) -> list[str]:
    told = found.as_json()
    kinds = told["from_rest"], told["from_start"]
    begins = f"as a trial begins, {told['begins_tilt_deg']:.4g} deg"
    rows = [
        (name, "from rest", "from a start"),
        ("upright, 0 deg", *(_length(kind["upright"]) for kind in kinds)),
        ("least of all tilts", *(_at(kind["least"]) for kind in kinds)),
        ("most of all tilts", *(_at(kind["most"]) for kind in kinds)),
        ("no climb from a tilt of", _tilts(told["lets_go_deg"]), _tilts(told["opens_deg"])),
        ("mean over the drive's tilts", *(_length(kind["mean"]) for kind in kinds)),
    ]
    if math.hypot(*told["begins"]) > 1e-6:
        rows.insert(2, (begins, *(_length(kind["begins"]) for kind in kinds)))
    return [f"{label:30}{rest:>22}{start:>22}" for label, rest, start in rows]


def _length(value: float | None) -> str:
    return "infinite" if value is None else f"{value:,.4g}"


def _at(what: dict[str, Any]) -> str:
    if what["climb"] is None:
        return "infinite"
    return f"{_length(what['climb'])} at {what['tilt_deg']:.4g} deg"


def _tilts(degrees: list[float | None]) -> str:
    there = [f"{tilt:+.1f}" for tilt in degrees if tilt is not None]
    return f"{' and '.join(there)} deg" if there else "none"


def _notes(found: Mapping[str, EscapeEnergy], units: str) -> list[str]:
    first = next(iter(found.values()))
    notes = [
        f"climbs: energy over weight where gravity lies in the plane, {length_in_words(units)}; "
        "tilts from where gravity points at the palm, + towards finger 2; the mean is with the "
        "share of gravity that the drive turns into the plane"
    ]
    if not first.exact:
        notes.append(
            "lower bounds: the ways out are those of the circle inside the object, of radius "
            f"{first.scenario.body.inner_radius():.4g}"
        )
    caged = [NAMES[d] for d, one in found.items() if np.isinf(one.from_rest).all()]
    if caged:
        notes.append(f"{' and '.join(caged)}: a full cage, nothing gets out")
    return notes
