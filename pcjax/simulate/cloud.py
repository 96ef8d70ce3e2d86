"""Starts other than the paper's: a cloud of objects that have been in the hand for a while."""

from __future__ import annotations

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from pcjax.geometry import Segment, Vec, unit_and_length, where
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import Scenario
from pcjax.physics.state import State, at_rest


class Cloud(eqx.Module):
    """Where circles are in a hand, one or a batch.

    Arguments:
        numbers: x, y, vx, vy.
        draws: those of the drive's targets in the period before.
        hand: the hand that they are in.
    """

    numbers: Float[Array, "... 4"]
    draws: Float[Array, "... targets"]
    hand: HandDesign

    def state_in(self, scenario: Scenario) -> State:
        """One object's state in another hand: each keeps its place beside its nearest limb.

        So it stays on the same side of that limb, whichever way a joint was turned.
        """
        x, y, vx, vy = (self.numbers[k] for k in range(4))
        limbs = zip(self.hand.limbs(), scenario.hand.limbs(), strict=True)
        place, least = Vec(x, y), jnp.inf
        for old, new in limbs:
            distance = old.distance(Vec(x, y))
            nearer = distance < least
            place = where(nearer, _carried(Vec(x, y), old, new), place)
            least = jnp.minimum(least, distance)
        # Beyond reach of all limbs it stays where it is.
        radius = scenario.contact_radius
        share = jnp.clip((2.0 * radius - least) / radius, 0.0, 1.0)
        place = Vec(x, y) + (place - Vec(x, y)) * share
        for _ in range(4):
            for limb in scenario.hand.limbs():
                normal, distance = unit_and_length(limb.offset(place))
                place = place + normal * jnp.maximum(radius - distance, 0.0)
        return replace(at_rest(place), velocity=Vec(vx, vy))


def _carried(point: Vec, old: Segment, new: Segment) -> Vec:
    """The point that is to the new limb what `point` is to the old one."""
    offset = old.offset(point)
    along = (point - offset - old.start).dot(old.tangent) / old.length
    normal, tangent = Vec(-new.tangent.y, new.tangent.x), new.tangent
    across, beyond = old.tangent.cross(offset), old.tangent.dot(offset)
    return new.start + tangent * (along * new.length + beyond) + normal * across
