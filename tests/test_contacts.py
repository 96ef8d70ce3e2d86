"""Contacts of recorded trials, as films show them: where they are and how fast they slip."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pcjax
from pcjax.physics.state import RUNNING
from pcjax.simulate.replay import Recording
from pcjax.view.contacts import contacts_at, touches


def moving(body: Any, height: float, speed: float, spin: float, **hand: float) -> Recording:
    """From the palm's middle, at a steady height, for a second."""
    scenario = pcjax.does(pcjax.box_hand(**hand), body, law=pcjax.ContactLaw(friction=0.3))
    times = np.linspace(0.0, 1.0, 101)
    place = np.stack([speed * times, np.full(101, height)], axis=-1)
    return Recording(scenario, 0, 0, RUNNING, 1.0, 0.01, times, place, spin * times)


def test_a_square_slides_on_two_corners() -> None:
    where, slip = contacts_at(moving(pcjax.Square(60.0, 5.0), 30.0, 8.0, 0.0), 0.5)
    np.testing.assert_allclose(sorted(where.tolist()), [[-21, 0], [29, 0]], atol=1e-9)
    np.testing.assert_allclose(slip, [[8.0, 0.0]] * 2, atol=1e-9)


@pytest.mark.parametrize(("spin", "slip"), [(-0.4, 0.0), (0.0, 10.0), (0.4, 20.0)])
def test_a_circle_rolls_or_slips(spin: float, slip: float) -> None:
    record = moving(pcjax.Circle(25.0), 30.0, 10.0, spin, thickness=10.0)
    where, speed = contacts_at(record, 0.3)
    np.testing.assert_allclose(where, [[3.0, 5.0]], atol=1e-9)
    np.testing.assert_allclose(speed, [[slip, 0.0]], atol=1e-9)


def test_a_fingertip_touches_a_side() -> None:
    """A stick across the end of a fingertip, not near any of its own ends."""
    still = moving(pcjax.Stick(40.0), 100.0, 0.0, 0.0)
    before, tip = still.hand[-2:]
    way = (tip - before) / np.hypot(*(tip - before))
    along = np.array([-way[1], way[0]])
    place = np.tile(tip + 1e-9 * way + 10.0 * along, (101, 1))
    angle = np.full(101, math.atan2(along[1], along[0]))
    record = replace(still, position=place, angle=angle)
    where, slip = contacts_at(record, 0.5)
    np.testing.assert_allclose(where, [tip], atol=1e-6)
    np.testing.assert_allclose(slip, [[0.0, 0.0]], atol=1e-9)


def test_what_flies_touches_nothing() -> None:
    where, slip = contacts_at(moving(pcjax.Square(60.0), 100.0, 8.0, 0.1), 0.5)
    assert where.shape == slip.shape == (0, 2)


def test_a_circle_that_flies_and_bounces_touches_where_it_turns() -> None:
    """Down to the palm and up again, then along it: each place once, and when that was."""
    falls = moving(pcjax.Circle(25.0), 25.0, 0.0, 0.0)
    down = 25.0 + 100.0 * np.abs(falls.times - 0.505)  # it meets the palm between two states
    place = np.stack([40.0 * falls.times, down], axis=-1)
    when, where = touches(replace(falls, position=place))
    assert when == pytest.approx([0.505], abs=1e-6)
    np.testing.assert_allclose(where, [[20.2, 0.0]], atol=1e-6)
    when, where = touches(moving(pcjax.Circle(25.0), 25.0, 50.0, 0.0))
    assert (np.diff(when) > 0).all()
    assert where[[0, -1], 0] == pytest.approx([0.0, 50.0], abs=2.5)
    assert np.diff(where[1:, 0]) == pytest.approx(2.5, abs=0.6)
    assert touches(moving(pcjax.Circle(25.0), 25.0, 50.0, 0.0), 0.5)[1][0, 0] == pytest.approx(25.0)


def test_what_passes_by_a_fingertip_touches_nothing() -> None:
    """It comes nearer and goes away again, and in between is half a step away."""
    still = moving(pcjax.Circle(25.0), 100.0, 0.0, 0.0)
    tip = still.hand[-1]
    place = tip + np.stack([200.0 * (still.times - 0.5), np.full(101, -26.0)], axis=-1)
    when, where = touches(replace(still, position=place))
    assert len(when) == len(where) == 0
