"""How far a tumbling body can leap: while contacts stay what they are, and until others can be."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from pcjax.geometry import (
    NEVER,
    Flag,
    Scalar,
    Segment,
    Vec,
    cube_root,
    fence,
    fence_all,
    first_root,
    stacked,
    unit_and_length,
    where,
)
from pcjax.model.scenario import World
from pcjax.physics.contact.manifold import (
    ON_EDGE,
    ON_END,
    Contact,
    Outline,
    left_of,
    offset_from,
    points_of,
    start_numbers,
)
from pcjax.physics.tumbling.flight import Margins, Path, any_of

LARGEST_TURN = 0.01
"""Largest turn, radians, of a leap on a contact that carries the body."""


def while_round(near: Scalar, far: Scalar, speed: Scalar, hard: Scalar, jerk: Scalar) -> Scalar:
    """For how long what starts at that speed, with accelerations of at most `hard` that change by
    at most `jerk`, is led astray by no more than half of `near` where its distance to a point,
    `far`, is taken as a parabola.

    That distance has the derivatives (v.y) / |y|, (v.v - f'^2 + a.y) / |y| and, as the bound has
    it, (3 v.a - 3 f' f'') / |y|; from rest the third grows with time.
    """
    longest = jnp.sqrt(jnp.sqrt(near * far / (2.0 * hard * hard + 1e-9)))
    quick = speed + hard * longest
    third = 3.0 * quick * (2.0 * hard + quick * quick / far) / far + jerk + 1e-12
    return jnp.minimum(longest, cube_root(3.0 * near / third))


def while_kept(
    longest: Scalar,
    found: Sequence[Contact],
    loaded: Sequence[Flag],
    outline: Outline,
    skin: Scalar,
    half: Scalar,
    path: Path,
    margins: Margins,
    barrier: Scalar,
) -> Scalar:
    """Seconds, at most `longest`, for which the contacts that carry the body stay what they are."""
    near = margins.near
    size = outline.reach + skin
    turn = jnp.minimum(LARGEST_TURN, cube_root(6.0 * near / size))
    # A single vertex is moved by no turn.
    turn = turn * size / jnp.maximum(outline.reach, 1e-9)
    turned = first_root(turn, -jnp.abs(path.spin), -jnp.abs(path.twist))
    # And before what rounding leaves of acceleration against a limb has done so.
    force = path.working
    pull = jnp.abs(force.x) + jnp.abs(force.y) + jnp.abs(force.turn)
    drifted = jnp.sqrt(near / (16 * float(jnp.finfo(jnp.result_type(pull)).eps) * (pull + 1e-9)))
    moves = (path.acceleration.dot(path.acceleration) > 0) | (path.twist != 0)
    turned = jnp.where(moves, jnp.minimum(turned, drifted), turned)
    longest = fence(jnp.where(any_of(loaded), jnp.minimum(longest, turned), longest), barrier)
    ahead = jnp.minimum(longest, 1.0)
    twist = jnp.abs(path.twist)
    spin = jnp.abs(path.spin) + twist * ahead
    hard = unit_and_length(path.acceleration)[1]
    fast = unit_and_length(path.velocity)[1] + hard * ahead
    spin, fast, hard = fence_all((spin, fast, hard), barrier)

    for contact, on in zip(found, loaded, strict=True):
        # What the gap's third derivative is at most leads it astray by no more than half of `near`.
        arm = unit_and_length(contact.arm)[1]
        jerk = arm * (3.0 * twist * spin + spin * spin * spin)
        swept = 3.0 * (spin * hard + twist * fast + spin * spin * fast)
        jerk = jerk + jnp.where(contact.kind == ON_EDGE, swept, 0.0)
        strays = jerk > 1e-12
        astray = cube_root(3.0 * near / jnp.where(strays, jerk, 1.0))
        # How far along, until the contact is another one.
        along = left_of(contact.normal)
        velocity = path.velocity + left_of(contact.arm) * path.spin
        change = path.acceleration + left_of(contact.arm) * path.twist
        change = change - contact.arm * (path.spin * path.spin)
        speed, rate = velocity.dot(contact.way), change.dot(contact.way)
        ends = jnp.minimum(
            first_root(jnp.maximum(contact.along, 0.0) + near, speed, rate),
            first_root(jnp.maximum(contact.length - contact.along, 0.0) + near, -speed, -rate),
        )
        on_end = contact.kind == ON_END
        core = skin + half
        arc = jnp.where(on_end, jnp.maximum(0.05 * core, jnp.sqrt(2.0 * core * near)), 0.05 * size)
        rolled = first_root(arc, -jnp.abs(velocity.dot(along)), -jnp.abs(change.dot(along)))
        around = while_round(
            near,
            jnp.where(on_end, jnp.maximum(contact.core, 0.5 * core), 1.0),
            unit_and_length(velocity)[1],
            unit_and_length(change)[1],
            0.0,
        )
        ends = jnp.where(on_end, jnp.minimum(rolled, around), ends)
        ends = jnp.where(contact.kind == ON_EDGE, jnp.minimum(ends, rolled), ends)
        ends = jnp.where(strays, jnp.minimum(ends, astray), ends)
        longest = fence(jnp.where(on, jnp.minimum(longest, ends), longest), barrier)
    return longest


def while_apart(
    longest: Scalar,
    world: World,
    outline: Outline,
    rounding: Scalar,
    path: Path,
    margins: Margins,
    barrier: Scalar,
) -> tuple[Scalar, Scalar]:
    """Seconds, at most `longest`, in which the body cannot touch a limb that it does not; and by
    how much a line separates it from each limb, the least of all."""
    near, noise = margins.near, margins.noise
    position, velocity, pulled = path.position, path.velocity, path.acceleration
    spin, twist = jnp.abs(path.spin), jnp.abs(path.twist)
    horizon = fence(jnp.minimum(longest, 0.5 / jnp.maximum(spin, 1e-9)), barrier)
    most = fence(spin + twist * horizon, barrier)
    swing = fence(jnp.minimum(2.0, most * horizon), barrier)
    hard = fence(unit_and_length(pulled)[1], barrier)
    fast = fence(unit_and_length(velocity)[1] + hard * horizon, barrier)
    travel = fence(fast * horizon, barrier)
    jolt = fence(3.0 * twist * most + most * most * most, barrier)
    square = fence(path.spin * path.spin, barrier)
    reach = outline.reach
    now = unit_and_length(velocity)[1] + spin * reach

    def until(
        gap: Scalar, speed: Scalar, true: Scalar, bound: Scalar, jerk: Scalar, unsure: Scalar
    ) -> Scalar:
        """When a gap may close.

        Its second derivative is `true` now and at least `bound`; of its third, `jerk` is a bound.
        Below the speed `unsure` rounding decides whether it opens.
        """
        cut = gap < -2.0 * near
        gap = jnp.maximum(gap, 0.0)
        touches = (gap <= near) & (speed > -noise)
        opens = speed > unsure
        # One that closes and is no contact of its own, such as a joint about to be reached: a floor
        # keeps the leap from ending where it starts.
        floor = jnp.where(touches, near / 64, near / 4)
        gap = jnp.where(touches & opens, 0.0, jnp.maximum(gap, floor))
        speed = jnp.where(touches, jnp.maximum(speed, 0.0), speed)
        time = first_root(gap, speed, jnp.maximum(bound, true - jerk * horizon))
        # One that does not close: for as long as it opens for certain, and as the third derivative
        # alone leads it astray by no more than half of `near`.
        stays = touches & (true > -8.0 * noise)
        turns = jerk > 1e-12
        jerk = jnp.where(turns, jerk, 1.0)
        kept = jnp.maximum(3.0 * true / jerk, cube_root(3.0 * near / jerk))
        kept = jnp.where(turns, kept, NEVER)
        return jnp.where(cut, 0.0, jnp.where(stays, jnp.maximum(kept, time), time))

    def over_end(limb: Segment, arm: Vec, beyond: Scalar, normal: Vec, distance: Scalar) -> Scalar:
        """For how long a vertex that goes round a limb's end, touching it, stays so far away from
        it, and is past the flat side; 0 if it does not."""
        length = unit_and_length(arm)[1]
        moving = velocity + left_of(arm) * path.spin
        change = pulled + left_of(arm) * path.twist - arm * square
        falling, aside = moving.dot(normal), moving.cross(normal)
        on_end = (beyond != 0) & (jnp.abs(distance - rounding) <= near) & (distance > 0)
        far = jnp.where(on_end, distance, 1.0)
        true = change.dot(normal) + aside * aside / far
        strong = hard + length * (twist + most * most)
        kept = while_round(near, far, unit_and_length(moving)[1], strong, length * jolt)
        # What carries it was worked out before it was put back to touching, by no more than `near`.
        slack = 2.0 * near * (aside / far) * (aside / far)
        kept = jnp.minimum(kept, 0.5 * far / jnp.maximum(jnp.abs(aside), 1e-9))
        to_side = jnp.where(beyond > 0, 1.0, -1.0)
        along, rate = moving.dot(limb.tangent) * to_side, change.dot(limb.tangent) * to_side
        until_side = first_root(jnp.abs(beyond) + near, along, rate - (length * jolt) * horizon)
        goes = on_end & (jnp.abs(falling) <= noise) & (true > -8.0 * noise - slack)
        return jnp.where(goes, jnp.minimum(kept, until_side), 0.0)

    def for_limb(
        so_far: tuple[Scalar, Scalar], one: tuple[Segment, Vec, Vec]
    ) -> tuple[tuple[Scalar, Scalar], None]:
        limb, start, end = one
        # Against the line that is square to the shortest way from limb to polygon.
        beyond, across, least, nearest = 0.0, 0.0, NEVER, Vec(0.0, 0.0)
        for arm in outline.arms:
            _, past, aside = offset_from(limb, position + arm)
            far = jax.lax.stop_gradient(past * past + aside * aside)
            closer = far < least
            beyond, across = jnp.where(closer, past, beyond), jnp.where(closer, aside, across)
            nearest, least = where(closer, arm, nearest), jnp.minimum(far, least)
        # Once for both components: across a tiny distance rounding would turn the direction.
        beyond, across = fence_all((beyond, across), barrier)
        offset = left_of(limb.tangent) * across + limb.tangent * beyond
        normal, distance = fence_all(unit_and_length(offset), barrier)
        # Rounding of the place turns a direction from a limb's end, the more the closer that is.
        turned = jnp.where(beyond != 0, near / 16 / jnp.maximum(distance, near / 16), 0.0)
        unsure = fence(noise + now * turned, barrier)
        base = normal.dot(limb.start) + jnp.maximum(0.0, normal.dot(limb.tangent) * limb.length)
        height, falls, drop = fence_all(
            (normal.dot(position) - base - rounding, normal.dot(velocity), normal.dot(pulled)),
            barrier,
        )
        around = over_end(limb, nearest, beyond, normal, distance)
        reached, apart = NEVER, NEVER
        for arm, length in zip(outline.arms, outline.lengths, strict=True):
            lever, up = arm.cross(normal), arm.dot(normal)
            straight = drop + path.twist * lever
            true = straight - square * up
            bound = straight - length * (most * most + twist * swing)
            gap = height + up
            falling = falls + path.spin * lever
            time = until(gap, falling, true, bound, length * jolt, unsure)
            is_nearest = (arm.x == nearest.x) & (arm.y == nearest.y)
            time = jnp.where(is_nearest, jnp.maximum(time, around), time)
            reached = jnp.minimum(reached, time)
            apart = jnp.minimum(apart, gap)
        reached, apart = fence_all((jnp.minimum(reached, horizon), apart), barrier)

        if len(outline.arms) > 1:
            best, low = None, None
            for arm, edge in zip(outline.arms, outline.along, strict=True):
                ends = [(point - position - arm).cross(edge) - rounding for point in (start, end)]
                lower = jnp.minimum(*ends)
                candidate = (*ends, edge)
                if best is None or low is None:
                    best, low = candidate, lower
                else:
                    better = lower > low
                    best = where(better, candidate, best)
                    low = jnp.maximum(lower, low)
            assert best is not None
            *gaps, edge = fence_all(best, barrier)
            normal = left_of(edge)  # from the limb to the body
            sideways = left_of(normal).dot(velocity)
            falls, drop = normal.dot(velocity), normal.dot(pulled)
            soonest = NEVER
            for gap, point in zip(gaps, (start, end), strict=True):
                to_point = point - position
                far = unit_and_length(to_point)[1]
                wide = far + travel
                lever = to_point.cross(normal)
                straight = drop + path.twist * lever
                true = straight + square * normal.dot(to_point) + 2.0 * path.spin * sideways
                swept = (hard + twist * far) * swing + twist * travel
                bound = straight - swept - most * most * wide - 2.0 * most * fast
                swept = most * hard + twist * fast + most * most * fast
                jerk = 3.0 * swept + jolt * wide
                falling = falls + path.spin * lever
                time = until(gap, falling, true, bound, jerk, noise)
                soonest = jnp.minimum(soonest, time)
            room = jnp.minimum(*gaps)
            by_edge = jnp.where(room > -near, soonest, 0.0)
            reached = jnp.maximum(reached, jnp.minimum(by_edge, horizon))
            apart = jnp.maximum(apart, room)

        # Against the circle about it.
        away, distance = unit_and_length(limb.offset(position))
        room = distance - reach - rounding
        alone = first_root(jnp.maximum(room, 0.0), away.dot(velocity), away.dot(pulled))
        reached = jnp.maximum(reached, jnp.where(room > near, alone, 0.0))
        least_time, least_apart = so_far
        both = jnp.minimum(least_time, reached), jnp.minimum(least_apart, apart)
        return fence_all(both, barrier), None

    limbs = world.limbs
    points = points_of(limbs)
    starts = [points[number] for number in start_numbers(len(limbs), world.finger_1)]
    each = stacked(limbs), stacked(starts), stacked(points[1:])
    everything = longest, NEVER + 0.0 * longest
    (wait, apart), _ = jax.lax.scan(for_limb, everything, each)
    return wait, apart
