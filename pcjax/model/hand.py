"""The hand: two fingers of limbs on a palm, its forward kinematics, its gap and its goal line."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from pcjax.checks import check_between, check_finite, check_positive, check_radians
from pcjax.geometry import (
    Flag,
    Mirror,
    Scalar,
    Segment,
    Vec,
    closest_pair,
    closest_points,
    cut_through,
    library_of,
    segment_between,
    segments_cross,
    stacked,
    unit_and_length,
    where,
)

FingerValues = tuple[tuple[Scalar, ...], tuple[Scalar, ...]]


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Goal:
    """The line whose crossing ends a trial, from finger 1's side `a` to finger 2's side `b`."""

    a: Vec
    b: Vec

    def beyond(self, point: Vec) -> Scalar:
        """Signed distance of `point` past the line, positive outside."""
        along = self.b - self.a
        return along.cross(point - self.a) / library_of(along).sqrt(along.dot(along))

    def outwards(self) -> Vec:
        """The unit vector square to the line, out of the hand."""
        along, _ = unit_and_length(self.b - self.a)
        return Vec(-along.y, along.x)

    def between(self, point: Vec) -> Flag:
        """Whether `point` projects onto the line between the two fingers."""
        along = self.b - self.a
        share = along.dot(point - self.a)
        return (share > 0) & (share < along.dot(along))


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Channel:
    """The passage between the two fingertips, from its inner ends to the goal line.

    Attributes:
        goal: the goal line, at the channel's outer ends.
        inner: the line between its inner ends.
    """

    goal: Goal
    inner: Goal

    def depth(self) -> Scalar:
        """How far the inner ends lie behind the goal line, on average."""
        return -0.5 * (self.goal.beyond(self.inner.a) + self.goal.beyond(self.inner.b))

    def holds(self, point: Vec) -> Flag:
        """Whether a point is between the two fingertips, both taken as endless lines."""
        left, right = self.goal.a - self.inner.a, self.goal.b - self.inner.b
        return (left.cross(point - self.inner.a) < 0) & (right.cross(point - self.inner.b) > 0)


class HandDesign(eqx.Module):
    """A planar two-fingered hand; every length and angle is a traced leaf.

    The hand frame has its origin at the palm's middle, +x along the palm and +y the way the hand
    points. Finger 1 starts at the palm's left end, finger 2 at its right end. With all joint angles
    zero a limb continues its predecessor; positive angles turn a finger towards the hand's axis.
    Lengths and angles are those of the limbs' middle lines; their surfaces lie half of the
    thickness off these on both sides, with round ends.

    Arguments:
        palm_length: L_p, a length.
        lengths: (finger 1's, finger 2's) limb lengths L_ij, from the palm outwards.
        angles: (finger 1's, finger 2's) joint angles theta_ij in radians.
        thickness: of palm and limbs, a length; 0 in the paper.

    Raises:
        ValueError: a length that is not positive, a thickness below 0, a number that is not finite,
            a finger without limbs or with unequal numbers of lengths and angles. Traced values are
            not checked.

    Examples:
        >>> import math, pcjax
        >>> right = math.pi / 2
        >>> hand = pcjax.HandDesign(4.0, ((3.0,), (2.0, 1.0)), ((right,), (right, right)))
        >>> len(hand.limbs())
        4
        >>> round(float(hand.gap()), 3)
        3.0
    """

    palm_length: Scalar
    lengths: FingerValues
    angles: FingerValues
    thickness: Scalar

    def __init__(
        self,
        palm_length: Scalar,
        lengths: FingerValues,
        angles: FingerValues,
        thickness: Scalar = 0.0,
    ):
        self.palm_length = palm_length
        self.lengths = (tuple(lengths[0]), tuple(lengths[1]))
        self.angles = (tuple(angles[0]), tuple(angles[1]))
        self.thickness = thickness
        check_positive("palm_length", palm_length)
        check_between("thickness", thickness, 0.0, math.inf)
        for finger, (ls, ts) in enumerate(zip(self.lengths, self.angles, strict=True), start=1):
            if len(ls) == 0 or len(ls) != len(ts):
                raise ValueError(
                    f"finger {finger} has {len(ls)} limb lengths and {len(ts)} joint angles: "
                    "give one angle for each length, and at least one limb"
                )
            for j, (length, angle) in enumerate(zip(ls, ts, strict=True), start=1):
                check_positive(f"length L_{finger}{j}", length)
                check_finite(f"joint angle theta_{finger}{j}", angle)
        check_radians(
            {
                f"theta_{finger}{j}": angle
                for finger, ts in enumerate(self.angles, start=1)
                for j, angle in enumerate(ts, start=1)
            }
        )

    def limbs(self) -> tuple[Segment, ...]:
        """Forward kinematics: the middle lines of the palm (left to right), finger 1's limbs and
        finger 2's limbs."""
        half = self.palm_length / 2
        palm = Segment(Vec(-half, 0.0 * half), Vec(1.0 + 0.0 * half, 0.0 * half), self.palm_length)
        return (palm, *self.finger(0), *self.finger(1))

    def finger(self, i: int) -> tuple[Segment, ...]:
        """The limbs of finger `i` (0 or 1), from the palm outwards."""
        xp, side = library_of(self), (-1.0, 1.0)[i]
        joint, heading = Vec(side * self.palm_length / 2, 0.0 * self.palm_length), 0.0
        limbs = []
        for length, angle in zip(self.lengths[i], self.angles[i], strict=True):
            heading = heading + angle
            limb = Segment(joint, Vec(side * xp.cos(heading), xp.sin(heading)), length)
            limbs.append(limb)
            joint = limb.end
        return tuple(limbs)

    def goal(self) -> Goal:
        """The goal line: tip joints or tip ends (20), whichever lies farther out along +y."""
        return self.channel().goal

    def channel(self) -> Channel:
        """The passage between the fingertips."""
        return channel_between(self.finger(0)[-1], self.finger(1)[-1])

    def gap(self) -> Scalar:
        """The narrowest passage out of the hand: the least distance between the two fingers, from
        surface to surface; 0 where they overlap.

        An object that is wider is in a full cage.
        """
        a, b = self._closest()
        between = unit_and_length(b - a)[1] - self.thickness
        return library_of(self).maximum(between, 0.0)

    def narrowest_passage(self) -> tuple[Vec, Vec]:
        """The points of finger 1's and finger 2's surfaces that are closest to each other."""
        a, b = self._closest()
        inset = unit_and_length(b - a)[0] * (0.5 * self.thickness)
        return a + inset, b - inset

    def _closest(self) -> tuple[Vec, Vec]:
        """The points of the fingers' middle lines that are closest to each other."""
        pairs = [(a, b) for a in self.finger(0) for b in self.finger(1)]
        return closest_pair(closest_points(*stacked(pairs)))

    def crossings(self) -> dict[tuple[str, str], Flag]:
        """For each pair of limbs that do not share a joint, whether they cross: their middle lines
        do, or their surfaces overlap.

        Surfaces of limbs between which the hand is shorter than twice its thickness may overlap,
        as those at a joint do.
        """
        names, limbs = self.limb_names(), self.limbs()
        order, places, apart = self._apart()

        def way_between(i: int, j: int) -> Scalar:
            low, high = sorted((places[i], places[j]))
            return sum(limbs[k].length for k in order[low + 1 : high])

        first, second = stacked([(limbs[i], limbs[j]) for i, j in apart])
        between = stacked([way_between(i, j) for i, j in apart])
        a, b = closest_points(first, second)
        near = unit_and_length(b - a)[1] < self.thickness - 1e-9 * (first.length + second.length)
        overlap = near & (between > 2.0 * self.thickness)
        crossed = library_of(self).asarray(segments_cross(first, second) | overlap)
        return {(names[i], names[j]): crossed[k] for k, (i, j) in enumerate(apart)}

    def passages(self) -> tuple[Scalar, ...]:
        """How far each two limbs that share no joint are from each other, from surface to surface;
        the object may have to pass between any of them."""
        limbs, (_, _, apart) = self.limbs(), self._apart()
        a, b = closest_points(*stacked([(limbs[i], limbs[j]) for i, j in apart]))
        between: Any = unit_and_length(b - a)[1] - self.thickness
        return tuple(between)

    def _apart(self) -> tuple[list[int], list[int], list[tuple[int, int]]]:
        """The limbs' numbers from fingertip to fingertip along the hand, the place of each in that
        row, and the pairs that share no joint."""
        n1, count = len(self.lengths[0]), 1 + sum(map(len, self.lengths))
        order = [*range(n1, 0, -1), 0, *range(n1 + 1, count)]
        places = sorted(range(count), key=order.__getitem__)
        pairs = itertools.combinations(range(count), 2)
        return order, places, [(i, j) for i, j in pairs if abs(places[i] - places[j]) > 1]

    def limb_names(self) -> tuple[str, ...]:
        """A readable name for each of `limbs()`."""
        fingers = [
            f"finger {i + 1}'s limb {j + 1}" for i in (0, 1) for j in range(len(self.lengths[i]))
        ]
        return ("the palm", *fingers)

    def region(self) -> tuple[Vec, ...]:
        """The corners of what limbs and goal line enclose, counterclockwise from the palm's left
        end; a corner may be there twice."""
        left, right = self.finger(0), self.finger(1)
        goal = channel_between(left[-1], right[-1]).goal
        up = [limb.start for limb in right[1:]]
        down = [limb.start for limb in reversed(left[1:])]
        return (left[0].start, right[0].start, *up, goal.b, goal.a, *down)

    def faces(self) -> Flag:
        """Whether finger 1's fingertip is on the left of finger 2's: their joints, seen along the
        palm, and their ends, seen along the line through the joints."""
        tips = self.finger(0)[-1], self.finger(1)[-1]
        joints, ends = tips[1].start - tips[0].start, tips[1].end - tips[0].end
        return (joints.x > 0) & (joints.dot(ends) > 0)

    def blocked_goal(self) -> Flag:
        """Whether a limb cuts through the goal line."""
        goal = self.goal()
        line = segment_between(goal.a, goal.b)
        return library_of(self).any(cut_through(line, stacked(self.limbs())), axis=0)

    def with_fingertips_mirrored(self) -> HandDesign:
        """The hand for EoEn (Fig. 8(b)): both fingertips mirrored across the line through their
        joints, by one isometry, so that the gap between them is the same.

        Each keeps its joint; only the angles of the last joints change.

        Examples:
            For the box hand each fingertip turns to the other side of its lid:

            >>> import math, pcjax
            >>> hand = pcjax.box_hand(math.radians(10))
            >>> mirrored = hand.with_fingertips_mirrored()
            >>> [round(math.degrees(float(angles[-1])), 6) for angles in mirrored.angles]
            [-80.0, -80.0]
        """
        hand, numbers = self._in_numbers()
        _, slope, headings = hand._tip_line(numbers)
        # A direction a becomes 2 slope - a. Headings are counted from +x for finger 2 and from -x,
        # the other way round, for finger 1.
        rows = []
        for angles, heading, side in zip(hand.angles, headings, (-1.0, 1.0), strict=True):
            turn = 2.0 * (heading - side * slope)
            turn = turn - 2.0 * math.pi * numbers.round(turn / (2.0 * math.pi))
            rows.append((*angles[:-1], -angles[-1] - turn))
        return HandDesign(self.palm_length, self.lengths, (rows[0], rows[1]), self.thickness)

    def tip_mirror(self) -> Mirror:
        """The mirror along the line through the fingertips' joints."""
        hand, numbers = self._in_numbers()
        joint, slope, _ = hand._tip_line(numbers)
        return Mirror.along(joint, Vec(numbers.cos(slope), numbers.sin(slope)))

    def _in_numbers(self) -> tuple[HandDesign, Any]:
        """The hand, and the module to calculate with: plain numbers keep all their digits."""
        if any(isinstance(leaf, Tracer) or np.ndim(leaf) for leaf in jax.tree.leaves(self)):
            return self, library_of(self)
        return jax.tree.map(float, self), np

    def _tip_line(self, numbers: Any) -> tuple[Vec, Scalar, list[Scalar]]:
        """Finger 1's fingertip's joint, the slope (radians) of the line from there to finger 2's,
        and the headings of the limbs before the fingertips."""
        places, headings = [], []
        for lengths, angles, side in zip(self.lengths, self.angles, (-1.0, 1.0), strict=True):
            place, heading = Vec(side * self.palm_length / 2, 0.0), 0.0
            for length, angle in zip(lengths[:-1], angles[:-1], strict=True):
                heading = heading + angle
                place = place + Vec(side * numbers.cos(heading), numbers.sin(heading)) * length
            places.append(place)
            headings.append(heading)
        along = places[1] - places[0]
        return places[0], numbers.arctan2(along.y, along.x), headings


def channel_between(tip_1: Segment, tip_2: Segment) -> Channel:
    """The passage between two fingertips; its outer ends are those farther out."""
    joints, ends = Goal(tip_1.start, tip_2.start), Goal(tip_1.end, tip_2.end)
    # Seen from the line through the joints, so that mirrored fingertips swap the two.
    ends_out = joints.beyond(ends.a) + joints.beyond(ends.b) > 0
    outer = Goal(where(ends_out, ends.a, joints.a), where(ends_out, ends.b, joints.b))
    inner = Goal(where(ends_out, joints.a, ends.a), where(ends_out, joints.b, ends.b))
    return Channel(outer, inner)


def points_of(hand: HandDesign) -> Float[np.ndarray, "points 2"]:
    """A hand's middle line, for plain numbers: from finger 1's tip along its joints to the palm's
    left end, and from its right end along finger 2's joints to its tip; in 64 bits."""
    hand = jax.tree.map(float, hand)
    left, right = hand.finger(0), hand.finger(1)
    row = [limb.end for limb in reversed(left)] + [left[0].start, right[0].start]
    row += [limb.end for limb in right]
    return np.array([[point.x, point.y] for point in row], float)


def full_cage(gap: Any, diameter: Any) -> Any:
    """Whether an object is too wide for a hand's gap, so that nothing passes.

    One that fits exactly is guided through by the fingertips' round ends, so rounding (here one
    part in a billion) counts as fitting.
    """
    return gap < diameter * (1 - 1e-9)
