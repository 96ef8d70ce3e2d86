"""Scalar reference simulator: a circle in a planar two-fingered hand under wrist tilt.

Written to be read, not to be fast: Python floats, one trial, one step after the other, and inside a step an explicit
list of events.  It shares no code with the package, so that agreement between the two means something.

Units: lengths in the unit of ``g``, times in seconds, angles in radians.

One step of length ``dt``
-------------------------
1. Free motion: RK4 for an acceleration that depends on time alone gives ``x1, v1``.  If the circle is then clear of
   every limb, the step is done.
2. Otherwise the step is replayed as a path of constant acceleration ``a = (v1 - v0) / dt`` that ends in ``x1, v1``:

   * *held* contacts (touching, no normal velocity) do not count as impacts.  Where the limb is flat, their share of
     ``a`` is cancelled; where it is round (a limb's end), the path stays free and is pushed back at the step's end;
     a circle held by two contacts that both push stays where it is;
   * the first impact with a limb that is not held is found by bisection, eq. (7) is applied there, and the path goes
     on from that point.  Where that sends the circle into another limb that it touches, held or not, that one is
     struck next, and so on, the fastest approach first.  What is left when none is faster than a resting one is
     answered without rebound: the velocity is projected on the cone ``v.n >= 0`` of all that is touched.

3. The circle is pushed out of whatever it still overlaps, and velocity into those limbs is removed.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = tuple[float, float]
Swing = tuple[Sequence[float], Sequence[float]]

TOUCH = 1e-9  # a gap up to this counts as touching [length]
STILL = 1e-9  # a normal speed up to this counts as none [length/s]
OVERLAP = 2e-13  # pushing out stops at an overlap below this [length]
MAX_EVENTS = 40  # bound on the events inside one step
MAX_AT_ONCE = 16  # bound on the impacts at one moment


# --------------------------------------------------------------------------------------------------------------- hand


def hand_limbs(
    palm_length: float, lengths: Sequence[Sequence[float]], angles: Sequence[Sequence[float]]
) -> NDArray[np.float64]:
    """Limbs of a hand as segments (ax, ay, bx, by) [length]: palm, finger 1, finger 2, each from the palm outwards.

    ``lengths`` [length] and joint ``angles`` [rad] are pairs (finger 1, finger 2).  At angle zero a limb continues its
    predecessor (the palm read outwards from its middle); positive angles turn towards the hand's axis, the +y axis.
    """
    half = 0.5 * palm_length
    limbs = [(-half, 0.0, half, 0.0)]
    for side, finger_lengths, finger_angles in zip((-1.0, 1.0), lengths, angles, strict=True):
        x, y = side * half, 0.0
        turned = 0.0
        for length, angle in zip(finger_lengths, finger_angles, strict=True):
            turned += angle
            # Finger 2 sets out along +x and turns anticlockwise; finger 1 is its mirror image.
            end_x, end_y = x + side * length * cos(turned), y + length * sin(turned)
            limbs.append((x, y, end_x, end_y))
            x, y = end_x, end_y
    return np.array(limbs, dtype=np.float64)


def goal_line(
    limbs: ArrayLike, n1: int, n2: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """End points (A on finger 1, B on finger 2) [length] of the line the centre has to cross.

    It is the line between the tip joints or the one between the tip ends, whichever is farther out: the latter if the
    ends are beyond the former on average.  ``n1`` and ``n2`` are the numbers of limbs of the two fingers.
    """
    segments = np.asarray(limbs, dtype=np.float64)
    tip1, tip2 = segments[n1], segments[n1 + n2]
    joints, ends = (tip1[:2], tip2[:2]), (tip1[2:], tip2[2:])
    along = joints[1] - joints[0]
    outwards = np.array([-along[1], along[0]])
    out = sum(float(outwards @ (end - joints[0])) for end in ends)
    chosen = ends if out > 0.0 else joints
    return chosen[0].copy(), chosen[1].copy()


def gravity(swing: Swing, t: float, g: float, ramp: float) -> Vector:
    """Gravity in the hand's plane, the first two components of eq. (1) [length/s^2].

    ``swing`` holds the tilt (T1, T2) [rad] at the period's start and its target; the tilt moves linearly for ``ramp``
    seconds and is then held.  ``t`` [s] counts from the period's start.
    """
    (from1, from2), (to1, to2) = swing
    share = 1.0 if t >= ramp else t / ramp
    tilt1 = from1 + share * (to1 - from1)
    tilt2 = from2 + share * (to2 - from2)
    return g * sin(tilt1), -g * cos(tilt1) * sin(tilt2)


# ------------------------------------------------------------------------------------------------------------ geometry


class _Limb(NamedTuple):
    """A segment: first end, unit direction, length."""

    ax: float
    ay: float
    ux: float
    uy: float
    length: float


class _Contact(NamedTuple):
    """Distance and normal from a limb to the circle's centre; ``flat`` if the closest point is not an end."""

    limb: int
    distance: float
    nx: float
    ny: float
    flat: bool


def _as_limb(segment: Sequence[float]) -> _Limb:
    ax, ay, bx, by = (float(value) for value in segment)
    length = hypot(bx - ax, by - ay)
    if not length > 0.0:
        raise ValueError("a limb has no length")
    return _Limb(ax, ay, (bx - ax) / length, (by - ay) / length, length)


def _distance(limb: _Limb, x: float, y: float) -> float:
    """Distance from a point to a limb [length]."""
    ax, ay, ux, uy, length = limb
    dx, dy = x - ax, y - ay
    along = dx * ux + dy * uy
    if along <= 0.0:
        return sqrt(dx * dx + dy * dy)
    if along >= length:
        dx -= length * ux
        dy -= length * uy
        return sqrt(dx * dx + dy * dy)
    return abs(ux * dy - uy * dx)


def _contact(index: int, limb: _Limb, x: float, y: float) -> _Contact:
    """Distance, normal and kind of the place where a limb is closest to a point."""
    ax, ay, ux, uy, length = limb
    dx, dy = x - ax, y - ay
    along = dx * ux + dy * uy
    if 0.0 < along < length:
        across = ux * dy - uy * dx  # positive on the left of the limb
        if across >= 0.0:
            return _Contact(index, across, -uy, ux, True)
        return _Contact(index, -across, uy, -ux, True)
    if along >= length:
        dx -= length * ux
        dy -= length * uy
    distance = sqrt(dx * dx + dy * dy)
    return _Contact(index, distance, dx / distance, dy / distance, False)


def _same_normal(one: _Contact, other: _Contact) -> bool:
    """Two limbs that meet in a joint are one obstacle for a circle that touches the joint."""
    return (
        one.nx * other.nx + one.ny * other.ny > 0.0
        and abs(one.nx * other.ny - one.ny * other.nx) < 1e-9
    )


# --------------------------------------------------------------------------------------------------------- constraints


def _to_cone(
    ux: float, uy: float, contacts: Sequence[_Contact]
) -> tuple[float, float, list[_Contact]]:
    """Nearest vector to u with u.n >= 0 at every contact, and the contacts that push (all, if nothing is left of u).

    This solves u' = u + sum(push_i n_i), push_i >= 0, u'.n_i >= 0, push_i (u'.n_i) = 0.  In the plane at most two
    contacts push, and if two do, nothing is left of u.
    """
    against = [c for c in contacts if ux * c.nx + uy * c.ny < 0.0]
    if not against:
        return ux, uy, []
    slack = 1e-12 * (abs(ux) + abs(uy))
    for c in against:
        normal = ux * c.nx + uy * c.ny
        wx, wy = ux - normal * c.nx, uy - normal * c.ny
        if all(wx * other.nx + wy * other.ny >= -slack for other in contacts):
            return wx, wy, [c]
    return 0.0, 0.0, list(contacts)


def _without_normals(ux: float, uy: float, contacts: Sequence[_Contact]) -> Vector:
    """Vector u less its parts along the normals: its part along the limb for one normal, nothing for two."""
    if not contacts:
        return ux, uy
    first = contacts[0]
    normal = ux * first.nx + uy * first.ny
    ux, uy = ux - normal * first.nx, uy - normal * first.ny
    for c in contacts[1:]:
        if abs(first.nx * c.ny - first.ny * c.nx) > 1e-9:
            return 0.0, 0.0
    return ux, uy


def _pushed_out(
    x: float, y: float, near: Sequence[tuple[int, _Limb]], radius: float
) -> tuple[float, float, set[int]]:
    """Smallest move of the centre that leaves no overlap, and the limbs that overlapped."""
    pushed: set[int] = set()
    for _ in range(50):
        contacts = [_contact(i, limb, x, y) for i, limb in near]
        wanted = [(radius - c.distance, c) for c in contacts]
        overlapping = [(depth, c) for depth, c in wanted if depth > OVERLAP]
        if not overlapping:
            break
        pushed.update(c.limb for _, c in overlapping)

        def enough(mx: float, my: float, wanted: Sequence[tuple[float, _Contact]] = wanted) -> bool:
            return all(mx * c.nx + my * c.ny >= depth - 0.5 * OVERLAP for depth, c in wanted)

        moves = [(depth * c.nx, depth * c.ny) for depth, c in overlapping]
        moves = [move for move in moves if enough(*move)]
        if not moves:
            for depth1, c1 in overlapping:
                for depth2, c2 in wanted:
                    cross = c1.nx * c2.ny - c1.ny * c2.nx
                    if abs(cross) > 1e-9:
                        move = (
                            (depth1 * c2.ny - depth2 * c1.ny) / cross,
                            (depth2 * c1.nx - depth1 * c2.nx) / cross,
                        )
                        if enough(*move):
                            moves.append(move)
        if not moves:
            depth, c = max(overlapping)
            moves = [(depth * c.nx, depth * c.ny)]
        mx, my = min(moves, key=lambda move: hypot(*move))
        x, y = x + mx, y + my
    return x, y, pushed


# ---------------------------------------------------------------------------------------------------- inside one step


def _impact_time(
    limb: _Limb,
    x: float,
    y: float,
    vx: float,
    vy: float,
    ax: float,
    ay: float,
    duration: float,
    radius: float,
) -> float | None:
    """Time [s] at which the path first reaches the limb, given that it ends inside; None if it is never clear of it."""

    def gap(t: float) -> float:
        return (
            _distance(limb, x + vx * t + 0.5 * ax * t * t, y + vy * t + 0.5 * ay * t * t) - radius
        )

    late = duration
    early = 0.0
    if gap(early) <= TOUCH:
        # The path sets out from the limb (a rebound): look for a moment at which it is clear of it.
        early = duration
        while gap(early) <= 1e-12:
            late = early
            early *= 0.5
            if early < 1e-10 * duration:
                return None
    while True:
        middle = 0.5 * (early + late)
        if middle in (early, late):
            return early
        if gap(middle) >= 0.0:
            early = middle
        else:
            late = middle


def _step_with_contact(
    start: tuple[float, float, float, float],
    free_end: tuple[float, float, float, float],
    dt: float,
    near: Sequence[tuple[int, _Limb]],
    radius: float,
    restitution: float,
    resting_speed: float,
) -> tuple[float, float, float, float, int]:
    """Replay a step whose free motion ends inside a limb: its end state (x, y, vx, vy) and the number of impacts."""
    x0, y0, vx, vy = start
    x1, y1, vx1, vy1 = free_end
    ax, ay = (vx1 - vx) / dt, (vy1 - vy) / dt
    # The path of constant acceleration through the free end starts a hair (order dt^3) beside the step's start.
    hair_x = x1 - vx1 * dt + 0.5 * ax * dt * dt - x0
    hair_y = y1 - vy1 * dt + 0.5 * ay * dt * dt - y0

    x, y = x0, y0
    left = dt
    impacts = 0
    held: set[int] = set()
    struck: set[int] = set()
    gripped: set[int] = set()
    bx, by = ax, ay
    first_pass = True

    for _ in range(MAX_EVENTS):
        touching = [
            c for c in (_contact(i, limb, x, y) for i, limb in near) if c.distance <= radius + TOUCH
        ]
        if first_pass:
            held = {c.limb for c in touching if abs(vx * c.nx + vy * c.ny) <= STILL}

        # Impacts at this very moment, one after the other: eq. (7).
        for _ in range(MAX_AT_ONCE):
            if not touching:
                break
            c = min(touching, key=lambda c: vx * c.nx + vy * c.ny)
            normal = vx * c.nx + vy * c.ny
            if normal >= -max(resting_speed, STILL):
                break
            vx -= (1.0 + restitution) * normal * c.nx
            vy -= (1.0 + restitution) * normal * c.ny
            impacts += 1
            struck.update(other.limb for other in touching if _same_normal(c, other))
        impacts += any(vx * c.nx + vy * c.ny < -STILL and c.limb not in held for c in touching)
        vx, vy, _ = _to_cone(vx, vy, touching)

        # What holds the circle from here on, and the acceleration that it leaves.
        holding = [c for c in touching if c.limb in gripped or abs(vx * c.nx + vy * c.ny) <= STILL]
        held = {c.limb for c in holding}
        vx, vy = _without_normals(vx, vy, holding)
        if first_pass:
            hair_x, hair_y = _without_normals(
                hair_x, hair_y, [c for c in holding if c.flat or len(holding) > 1]
            )
            x, y = x + hair_x, y + hair_y
            first_pass = False
        bx, by, pushing = _to_cone(ax, ay, holding)
        if len(pushing) == 1 and not _is_flat_throughout(
            pushing[0], near, (x, y), (vx, vy), (bx, by), left
        ):
            bx, by = ax, ay

        # The next impact on the way to the step's end.
        end_x, end_y = (
            x + vx * left + 0.5 * bx * left * left,
            y + vy * left + 0.5 * by * left * left,
        )
        first: float | None = None
        caught: int | None = None
        for i, limb in near:
            if i in held or _distance(limb, end_x, end_y) >= radius:
                continue
            when = _impact_time(limb, x, y, vx, vy, bx, by, left, radius)
            if when is None:
                c = _contact(i, limb, x, y)
                if vx * c.nx + vy * c.ny < -STILL:
                    when = 0.0
                else:
                    caught = i  # a rebound too small to be seen: it has come to rest
                    continue
            if first is None or when < first:
                first = when
        if caught is not None:
            gripped.add(caught)
            continue
        if first is None:
            break
        x, y = x + vx * first + 0.5 * bx * first * first, y + vy * first + 0.5 * by * first * first
        vx, vy = vx + bx * first, vy + by * first
        left -= first

    # The rest of the step, and no overlap and no velocity into a limb at its end.
    x, y = x + vx * left + 0.5 * bx * left * left, y + vy * left + 0.5 * by * left * left
    vx, vy = vx + bx * left, vy + by * left
    if len(held) == 1:
        for i, limb in near:
            if i in held:
                c = _contact(i, limb, x, y)
                if c.flat and abs(c.distance - radius) <= 2.0 * TOUCH:
                    x, y = x + (radius - c.distance) * c.nx, y + (radius - c.distance) * c.ny
    x, y, pushed = _pushed_out(x, y, near, radius)
    touching = [
        c for c in (_contact(i, limb, x, y) for i, limb in near) if c.distance <= radius + TOUCH
    ]
    vx, vy, _ = _to_cone(
        vx, vy, [c for c in touching if c.limb in held or c.limb in struck or c.limb in pushed]
    )
    return x, y, vx, vy, impacts


def _is_flat_throughout(
    contact: _Contact,
    near: Sequence[tuple[int, _Limb]],
    position: Vector,
    velocity: Vector,
    acceleration: Vector,
    duration: float,
) -> bool:
    """Whether a circle that slides on a limb is still beside it, not past its end, when the path ends."""
    if not contact.flat:
        return False
    limb = next(candidate for i, candidate in near if i == contact.limb)
    x = position[0] + velocity[0] * duration + 0.5 * acceleration[0] * duration * duration
    y = position[1] + velocity[1] * duration + 0.5 * acceleration[1] * duration * duration
    return _contact(contact.limb, limb, x, y).flat


# --------------------------------------------------------------------------------------------------------------- trial


def simulate(
    limbs: ArrayLike,
    goal: tuple[ArrayLike, ArrayLike],
    radius: float,
    restitution: float,
    resting_speed: float,
    start: Sequence[float],
    targets: ArrayLike,
    *,
    g: float = 9.8,
    dt: float = 0.001,
    period: float = 10.0,
    ramp: float = 1.0,
    steps: int | None = None,
    record_every: int = 1,
) -> dict[str, Any]:
    """One trial from rest at ``start`` [length], until the goal is passed or ``steps`` are done.

    ``targets`` is an (n_periods, 2) array of tilts (T1, T2) [rad]: in period k the tilt goes from ``targets[k - 1]``
    (zero for k = 0) to ``targets[k]`` in ``ramp`` seconds and stays there.  ``dt``, ``period`` and ``ramp`` are in
    seconds, ``resting_speed`` in length/s.  Without ``steps`` all periods are simulated.

    Returns ``positions`` and ``velocities`` (k, 2), entry j being the state after (j + 1) * ``record_every`` steps;
    ``escape_step``, the number (from 1) of the step that passed the goal, or None; ``contacts``, the number of impacts.
    """
    shapes = [_as_limb(segment) for segment in np.asarray(limbs, dtype=np.float64)]
    tilts = [
        (float(tilt1), float(tilt2))
        for tilt1, tilt2 in np.asarray(targets, dtype=np.float64).reshape(-1, 2)
    ]
    period_steps = round(period / dt)
    if steps is None:
        steps = period_steps * len(tilts)
    if steps > period_steps * len(tilts):
        raise ValueError("there are too few targets for so many steps")

    goal_ax, goal_ay = (float(value) for value in np.asarray(goal[0], dtype=np.float64))
    goal_bx, goal_by = (float(value) for value in np.asarray(goal[1], dtype=np.float64))
    width = hypot(goal_bx - goal_ax, goal_by - goal_ay)
    along_x, along_y = (goal_bx - goal_ax) / width, (goal_by - goal_ay) / width
    out_x, out_y = (-along_y, along_x) if along_x > 0.0 else (along_y, -along_x)

    x, y = (float(value) for value in start)
    vx = vy = 0.0
    if min(_distance(limb, x, y) for limb in shapes) < radius - 1e-9:
        raise ValueError("the circle overlaps a limb at the start")
    before = (x - goal_ax) * out_x + (y - goal_ay) * out_y

    # A limb need not be looked at before the circle has travelled as far as its gap to it was.
    travelled = 0.0
    due = [0.0] * len(shapes)

    positions: list[Vector] = []
    velocities: list[Vector] = []
    contacts = 0
    escape_step: int | None = None
    sixth, sixth2 = dt / 6.0, dt * dt / 6.0
    swing: Swing = ((0.0, 0.0), (0.0, 0.0))
    settled = False  # the tilt is held, and gravity with it
    g0x = g0y = ghx = ghy = g1x = g1y = 0.0

    for number in range(1, steps + 1):
        in_period = (number - 1) % period_steps
        if in_period == 0:
            k = (number - 1) // period_steps
            swing = (tilts[k - 1] if k > 0 else (0.0, 0.0), tilts[k])
            settled = False
            g1x, g1y = gravity(swing, 0.0, g, ramp)
        if not settled:
            g0x, g0y = g1x, g1y
            ghx, ghy = gravity(swing, (in_period + 0.5) * dt, g, ramp)
            g1x, g1y = gravity(swing, (in_period + 1) * dt, g, ramp)
            settled = in_period * dt >= ramp

        # 1. Free motion.
        vx1 = vx + sixth * (g0x + 4.0 * ghx + g1x)
        vy1 = vy + sixth * (g0y + 4.0 * ghy + g1y)
        x1 = x + dt * vx + sixth2 * (g0x + 2.0 * ghx)
        y1 = y + dt * vy + sixth2 * (g0y + 2.0 * ghy)

        overlap = False
        moved = abs(x1 - x) + abs(y1 - y)
        travelled += moved
        for i, when_due in enumerate(due):
            if when_due <= travelled:
                gap = _distance(shapes[i], x1, y1) - radius
                if gap < 0.0:
                    overlap = True
                due[i] = travelled + gap

        # 2. and 3. Contacts.
        if overlap:
            reach = (
                travelled + 4.0 * (moved + dt * (abs(vx) + abs(vy) + abs(vx1) + abs(vy1))) + 1e-3
            )
            near = [(i, shapes[i]) for i, when_due in enumerate(due) if when_due <= reach]
            free_end = (x1, y1, vx1, vy1)
            x1, y1, vx1, vy1, impacts = _step_with_contact(
                (x, y, vx, vy), free_end, dt, near, radius, restitution, resting_speed
            )
            contacts += impacts
            travelled += abs(x1 - free_end[0]) + abs(y1 - free_end[1])
        x, y, vx, vy = x1, y1, vx1, vy1

        if number % record_every == 0:
            positions.append((x, y))
            velocities.append((vx, vy))

        # 4. Goal.
        after = (x - goal_ax) * out_x + (y - goal_ay) * out_y
        if (
            before < 0.0 <= after
            and 0.0 < (x - goal_ax) * along_x + (y - goal_ay) * along_y < width
        ):
            escape_step = number
            break
        before = after

    return {
        "positions": np.array(positions, dtype=np.float64).reshape(-1, 2),
        "velocities": np.array(velocities, dtype=np.float64).reshape(-1, 2),
        "escape_step": escape_step,
        "contacts": contacts,
    }
