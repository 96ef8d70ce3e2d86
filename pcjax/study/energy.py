"""How high the object of a study has to climb to get out of its hand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pcjax.quality.energy import ORIENTATIONS, TILTS, EscapeEnergy, energy_of
from pcjax.results.schema import NAMES
from pcjax.results.tables import wrapped
from pcjax.study.spec import Study
from pcjax.units import length_in_words


def energy_of_study(
    study: Study, *, tilts: int = TILTS, orientations: int = ORIENTATIONS
) -> dict[str, EscapeEnergy]:
    """`pcjax.energy` of the hand of a study in each direction that the study asks for; its sweep
    and its run are not looked at.

    Arguments:
        study: what is looked at.
        tilts, orientations: as for `pcjax.energy`.

    Raises:
        ValueError: see `pcjax.energy`, and EoEn of a hand that has none.

    Examples:
        >>> import pcjax
        >>> study = pcjax.Study(pcjax.box_hand(0.0), pcjax.Circle(25.0))
        >>> found = pcjax.energy_of_study(study)
        >>> print(f"{found['does'].at(0.0).from_rest:.1f} {found['eoen'].at(0.0).from_rest:.1f}")
        475.0 575.0
    """
    return {
        d: energy_of(scenario, tilts, orientations) for d, scenario in study.scenarios().items()
    }


def energy_table(found: Mapping[str, EscapeEnergy], units: str) -> str:
    """The climbs of each direction in words, with the unit of lengths.

    Arguments:
        found: by direction, from `energy_of_study`.
        units: of lengths (see `pcjax.units`).
    """
    first = next(iter(found.values()))
    notes = [
        f"climbs: energy over weight where gravity lies in the plane, {length_in_words(units)}; "
        "tilts from where gravity points at the palm, + towards finger 2; the mean is with the "
        "share of gravity that the drive turns into the plane"
    ]
    if not first.exact:
        notes.append(
            "at most: along ways that the object can take, as found; at least: along those of the "
            f"circle inside it, of radius {first.scenario.body.inner_radius():.4g}"
        )
    for said, caged in (("a full cage, nothing gets out", True), ("no way out was found", False)):
        shut = [NAMES[d] for d, one in found.items() if np.isinf(one.from_rest).all()
                and one.full_cage == caged]  # fmt: skip
        if shut:
            notes.append(f"{' and '.join(shut)}: {said}")
    tables = [line for direction, one in found.items() for line in one.lines(NAMES[direction])]
    return "\n".join([*tables, *map(wrapped, notes)])
