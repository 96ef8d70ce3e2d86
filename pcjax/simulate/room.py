"""Room for objects that fit between two limbs exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pcjax.model.checking import passages_of
from pcjax.model.hand import full_cage
from pcjax.model.scenario import Scenario

_LEAST_CLEARANCE = 1e-4
"""Difference between passage and object, in contact diameters, with which trials are run."""


def with_room(scenarios: Sequence[Scenario]) -> list[Scenario]:
    """The scenarios as they are run.

    An object that fits between two limbs exactly, or all but, would be touched on both sides all
    the time, and rounding would decide whether it fits. It is run a ten-thousandth smaller, or
    larger if it is too wide already, to which index 1 tends.
    """
    return list(map(_with_room, scenarios, passages_of(scenarios)))


def _with_room(scenario: Scenario, passages: np.ndarray) -> Scenario:
    """The scenario with an object that passes between any two limbs with some room, or is too wide
    by as much."""
    width = float(scenario.body.width)
    room = _LEAST_CLEARANCE * 2 * float(scenario.contact_radius)
    near = passages[np.abs(passages - width) < room]
    if not near.size or width == 0:
        return scenario
    fits = near[~full_cage(near, width)]
    wanted = fits.min() - room if fits.size else near.max() + room
    return replace(scenario, body=scenario.body.scaled(float(wanted) / width))
