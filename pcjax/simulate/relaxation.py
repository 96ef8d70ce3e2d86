"""A goal that is spread over the channel, so that how far a trial came counts as well.

The exact trial ends where its centre crosses the goal line. Relaxed, the line lies anywhere within
+-w of its place, at random; the share of lines not yet crossed is the relaxed survival

    S = 1 - F(s* / w),   F(u) = z^3 (6 z^2 - 15 z + 10),   z = clip((u + 1) / 2, 0, 1),

with s* the farthest that the centre has come past the line inside the channel between the
fingertips. S is smooth in everything that the motion depends on, and as w goes to 0 it tends to the
exact survival.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from pcjax.geometry import Scalar, Scalars, Vec, first_root
from pcjax.model.hand import Channel, Goal, channel_between
from pcjax.model.scenario import World
from pcjax.physics.state import PASSED, RUNNING

NOWHERE = -1e9
"""s* of a trial that has not been in the channel."""


_BOOLE = ((0.0, 7 / 90), (0.25, 32 / 90), (0.5, 12 / 90), (0.75, 32 / 90), (1.0, 7 / 90))
"""Boole's rule: places and weights."""


class Excursion(eqx.Module):
    """How far a trial has come.

    Attributes:
        peak: s*, the farthest that the centre has been past the goal line inside the channel.
        first_peak: what `peak` was at the end of the first period.
        survival_time: the integral of the relaxed survival over time, s.
    """

    peak: Scalars
    first_peak: Scalars
    survival_time: Scalars

    def with_first_over(self, over: Bool[Array, " lanes"]) -> Excursion:
        """The same, where the first period may be over."""
        first_peak = jnp.where(over, self.peak, self.first_peak)
        return Excursion(self.peak, first_peak, self.survival_time)


class Layer(eqx.Module):
    """Where the goal is spread: the channel, and the half width w."""

    channel: Channel
    width: Scalars

    @classmethod
    def of(cls, channel: Channel, share: Scalar) -> Layer:
        """w is a share of the channel's depth. It is not differentiated: it is our choice."""
        return cls(channel, jax.lax.stop_gradient(share * channel.depth()))

    @classmethod
    def all_of(cls, worlds: World, share: Scalar | None) -> Layer | None:
        """The layers of a batch of worlds, None where the goal is exact."""
        if share is None:
            return None

        def one(world: World) -> Layer:
            return cls.of(channel_between(world.limbs[world.finger_1], world.limbs[-1]), share)

        axes = jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, worlds)
        return jax.vmap(one, in_axes=(axes,))(worlds)

    def farthest_goal(self) -> Goal:
        """The last line of the layer: whoever crosses it is out for certain."""
        goal = self.channel.goal
        out = goal.outwards() * self.width
        return Goal(goal.a + out, goal.b + out)

    def follow(self, before: Excursion, end: Vec, time: Scalar) -> Excursion:
        """The excursion at `end`, `time` seconds later: a step so short that S hardly changes."""
        peak = self._peak(before.peak, end, self.channel.goal.beyond(end))
        mean = 0.5 * (self.survival(before.peak) + self.survival(peak))
        return Excursion(peak, before.first_peak, before.survival_time + mean * time)

    def follow_leap(
        self, before: Excursion, start: Vec, end: Vec, velocity: Vec, time: Scalar
    ) -> Excursion:
        """The excursion after a move of any length under constant acceleration.

        Arguments:
            before: at `start`.
            velocity: at `end`.
            time: seconds from `start` to `end`.
        """
        goal = self.channel.goal
        moving = time > 0
        seconds = jnp.where(moving, time, 1.0)
        past, reached = goal.beyond(start), goal.beyond(end)
        last = goal.beyond(end + velocity) - reached
        first = 2.0 * (reached - past) / seconds - last
        change = (last - first) / seconds
        # From `rises` on the layer is entered deeper than before, up to `top`.
        turns = moving & (first > 0) & (last < 0)
        top = jnp.where(turns, first / jnp.where(turns, -change, 1.0), seconds)
        deepest = jnp.maximum(before.peak, -self.width)
        rises = jnp.minimum(first_root(jnp.maximum(deepest - past, 0.0), -first, -change), top)
        back = top - seconds
        acceleration = (velocity - (end - start) * (1.0 / seconds)) * (2.0 / seconds)
        farthest = end + (velocity + acceleration * (0.5 * back)) * back
        peak = self._peak(before.peak, farthest, past + (first + 0.5 * change * top) * top)
        counts = peak > before.peak
        held = self.survival(before.peak) * rises + self.survival(peak) * (seconds - top)
        for share, weight in _BOOLE:
            t = rises + share * (top - rises)
            here = jnp.maximum(before.peak, past + (first + 0.5 * change * t) * t)
            held = held + weight * (top - rises) * self.survival(jnp.minimum(here, peak))
        held = jnp.where(counts, held, self.survival(before.peak) * seconds)
        return Excursion(
            peak, before.first_peak, before.survival_time + jnp.where(moving, held, 0.0)
        )

    def _peak(self, peak: Scalar, point: Vec, past: Scalar) -> Scalar:
        """The peak once a point that far past the goal line has been visited.

        Who has crossed the goal line is out of the hand; how far, then counts wherever it is.
        """
        counts = self.channel.holds(point) | (peak > 0)
        return jnp.where(counts, jnp.maximum(peak, past), peak)

    def verdict(self, status: Int[Array, ""], excursion: Excursion) -> Int[Array, ""]:
        """A trial's status: it ends once it is past the last line of the layer."""
        return jnp.where((status == RUNNING) & (excursion.peak >= self.width), PASSED, status)

    def survival(self, peak: Scalar) -> Scalar:
        """S for a peak s*."""
        return relaxed_survival(peak, self.width)


def relaxed_survival(peak: Scalars, width: Scalars) -> Scalars:
    """S = 1 - F(peak / width)."""
    z = jnp.clip(0.5 * (peak / width + 1.0), 0.0, 1.0)
    return 1.0 - z * z * z * (z * (6.0 * z - 15.0) + 10.0)
