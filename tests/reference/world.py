"""Scalar reference simulator in the world frame: a circle or a stick in a hand that an arm carries.

Everything is written in axes that stand still.  The hand's limbs are moved from step to step by the arm (or stay, under
wrist tilt), the object flies along a parabola between contacts, and every impact uses the velocities of the two points
that meet.  Written to be read: Python floats, one trial, one step after the other.  It shares no code with the package.

Units: lengths in the unit of ``g``, times in seconds, angles in radians.  Masses cancel; the object's is 1.

One step of length ``dt``
-------------------------
1. Free motion: constant acceleration that ends where the exact solution (arm) or RK4 (wrist) does; a stick keeps its
   spin.
2. A contact at the end of the step is an impact, at the last moment at which it began, found by regula falsi between
   object and moving limb: eq. (7), or (14)-(17), there, and free motion to the end of the step. A circle meets the two
   nearest limbs so, one after the other, a stick the one contact that is deepest.
3. What then still overlaps is pushed out, by the least pushes that leave no overlap, and the velocity into it is turned
   back likewise, as by a force that has acted all through the step.  Faster approaches than rest and the step's
   acceleration explain are further impacts and keep their restitution.  For a stick this is done twice, for the
   impact's contact and the three deepest, in the metric of its kinetic energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, hypot, inf, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

Vector = tuple[float, float]


# -------------------------------------------------------------------------------------------------------------- drives


class Pose(NamedTuple):
    """The hand in the world: its origin, cosine and sine of its turn, and how both change.

    ``bx, by`` is the acceleration of the origin.
    """

    px: float
    py: float
    c: float
    s: float
    vx: float
    vy: float
    spin: float
    bx: float
    by: float

    def out(self, x: float, y: float) -> Vector:
        """A point of the hand, in the world."""
        return self.px + self.c * x - self.s * y, self.py + self.s * x + self.c * y

    def back(self, x: float, y: float) -> Vector:
        """A point of the world, as seen from the hand."""
        dx, dy = x - self.px, y - self.py
        return self.c * dx + self.s * dy, self.c * dy - self.s * dx

    def velocity(self, x: float, y: float) -> Vector:
        """The velocity of the hand's point that is now at (x, y)."""
        return self.vx - self.spin * (y - self.py), self.vy + self.spin * (x - self.px)

    def acceleration(self, x: float, y: float, vx: float, vy: float) -> Vector:
        """What a body at (x, y) that moves by (vx, vy) as seen from the hand has to have to look unaccelerated."""
        w = self.spin
        return (
            self.bx - w * w * (x - self.px) - 2.0 * w * vy,
            self.by - w * w * (y - self.py) + 2.0 * w * vx,
        )


STILL = Pose(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Arm:
    """Three links from the world's origin; ``targets`` is (n_periods, 3), joint angles [rad]."""

    def __init__(
        self,
        targets: ArrayLike,
        rest: Sequence[float] = (0.0, pi / 4, 0.0),
        lengths: Sequence[float] = (200.0, 200.0, 0.0),
        mount: float = -pi / 2,
        g: float = 9.8,
        ramp: float = 5.0,
        period: float = 10.0,
    ):
        self.stops = [tuple(map(float, rest)), *map(tuple, np.asarray(targets, float).tolist())]
        self.lengths, self.mount, self.g, self.ramp, self.period = lengths, mount, g, ramp, period
        self.held: dict[int, Pose] = {}

    def pose(self, k: int, time: float, moving: bool) -> Pose:
        """At a time of period k; ``moving`` tells of which side of the ramp's end it is spoken."""
        if not moving and k in self.held:
            return self.held[k]
        share = time / self.ramp if moving else 1.0
        heading, speed = self.mount, 0.0
        px = py = vx = vy = bx = by = 0.0
        for length, start, target in zip(
            self.lengths, self.stops[k], self.stops[k + 1], strict=True
        ):
            heading += start + share * (target - start)
            speed += (target - start) / self.ramp if moving else 0.0
            lx, ly = length * cos(heading), length * sin(heading)
            px, py = px + lx, py + ly
            vx, vy = vx - speed * ly, vy + speed * lx
            bx, by = bx - speed * speed * lx, by - speed * speed * ly
        # The last link points along the hand's +y.
        made = Pose(px, py, sin(heading), -cos(heading), vx, vy, speed, bx, by)
        if not moving:
            self.held[k] = made
        return made

    def is_moving(self, time: float, dt: float) -> bool:
        return time + 0.5 * dt < self.ramp

    def gains(self, k: int, time: float, dt: float) -> tuple[float, float, float, float]:
        """What gravity adds to position and velocity in a step."""
        return 0.0, -0.5 * self.g * dt * dt, 0.0, -self.g * dt


class Wrist:
    """A hand that stays, under gravity that turns; ``targets`` is (n_periods, 2), tilts [rad]."""

    def __init__(self, targets: ArrayLike, g: float = 9.8, ramp: float = 1.0, period: float = 10.0):
        self.stops = [(0.0, 0.0), *map(tuple, np.asarray(targets, float).tolist())]
        self.g, self.ramp, self.period = g, ramp, period

    def pose(self, k: int, time: float, moving: bool) -> Pose:
        return STILL

    def is_moving(self, time: float, dt: float) -> bool:
        return False

    def _gravity(self, k: int, time: float) -> Vector:
        share = min(time / self.ramp, 1.0)
        one, two = (a + share * (b - a) for a, b in zip(*self.stops[k : k + 2], strict=True))
        return self.g * sin(one), -self.g * cos(one) * sin(two)  # (1)

    def gains(self, k: int, time: float, dt: float) -> tuple[float, float, float, float]:
        """Classical Runge-Kutta for an acceleration that depends on time alone."""
        (x0, y0), (xh, yh), (x1, y1) = (self._gravity(k, time + f * dt) for f in (0.0, 0.5, 1.0))
        sixth = dt / 6.0
        return (
            dt * sixth * (x0 + 2.0 * xh),
            dt * sixth * (y0 + 2.0 * yh),
            sixth * (x0 + 4.0 * xh + x1),
            sixth * (y0 + 4.0 * yh + y1),
        )


# --------------------------------------------------------------------------------------------------------- small tools


def least_pushes(overlaps: Sequence[Sequence[float]], needs: Sequence[float]) -> list[float]:
    """Pushes p >= 0 with sum_j overlaps[i][j] p_j >= needs[i], and equal where p_i > 0; unit diagonal.

    Gauss-Seidel with projection, until nothing changes, or for 60 rounds.
    """
    pushes = [0.0] * len(needs)
    for _ in range(60):
        change = 0.0
        for i, row in enumerate(overlaps):
            others = sum(row[j] * pushes[j] for j in range(len(needs)) if j != i)
            new = max(needs[i] - others, 0.0)
            change = max(change, abs(new - pushes[i]))
            pushes[i] = new
        if change <= 1e-12 * max(needs, default=0.0):
            break
    return pushes


def seconds_since(gap: Callable[[float], float], dt: float) -> float:
    """Seconds before the step's end at which a gap, negative at the end, was last positive; dt if it was not."""
    inside, low = 0.0, gap(0.0)
    for piece in range(1, 5):
        outside = dt * piece / 4
        high = gap(outside)
        if high > 0.0:
            break
        inside, low = outside, high
    else:
        return dt
    # Regula falsi (Illinois).
    kept = 0
    for _ in range(60):
        middle = (inside * high - outside * low) / (high - low)
        if not inside < middle < outside:
            break
        value = gap(middle)
        if abs(value) < 1e-14:
            return middle
        if value > 0.0:
            outside, high = middle, value
            low, kept = (0.5 * low, 1) if kept == 1 else (low, 1)
        else:
            inside, low = middle, value
            high, kept = (0.5 * high, -1) if kept == -1 else (high, -1)
        if outside - inside < 1e-13 * dt:
            break
    return inside


def turned(x: float, y: float, angle: float) -> Vector:
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


class _Hand:
    """Segments (local start, unit direction, length) and vertices, in the hand's frame."""

    def __init__(self, limbs: ArrayLike, n1: int):
        rows = np.asarray(limbs, dtype=np.float64)
        self.limbs = []
        for ax, ay, bx, by in rows.tolist():
            length = hypot(bx - ax, by - ay)
            self.limbs.append((ax, ay, (bx - ax) / length, (by - ay) / length, length))
        # Every joint and end once: the palm's left end, then each limb's end.
        self.vertices = [tuple(rows[0, :2].tolist()), *(tuple(row[2:]) for row in rows.tolist())]
        starts = [0, 0, *range(2, n1 + 1), 1, *range(n1 + 2, len(rows))]
        self.corners = [(starts[i], i + 1) for i in range(len(rows))]

    def placed(self, pose: Pose) -> list[tuple[float, float, float, float, float]]:
        """The limbs in the world."""
        px, py, c, s = pose[:4]
        return [
            (px + c * ax - s * ay, py + s * ax + c * ay, c * ux - s * uy, s * ux + c * uy, length)
            for ax, ay, ux, uy, length in self.limbs
        ]


class _Goal:
    def __init__(self, goal: tuple[ArrayLike, ArrayLike]):
        (self.ax, self.ay), (bx, by) = (np.asarray(end, float).tolist() for end in goal)
        self.width = hypot(bx - self.ax, by - self.ay)
        self.ux, self.uy = (bx - self.ax) / self.width, (by - self.ay) / self.width

    def beyond(self, x: float, y: float) -> float:
        return self.ux * (y - self.ay) - self.uy * (x - self.ax)

    def between(self, x: float, y: float) -> bool:
        return 0.0 < self.ux * (x - self.ax) + self.uy * (y - self.ay) < self.width


# -------------------------------------------------------------------------------------------------------------- circle


class _Near(NamedTuple):
    """The closest point of limb ``limb`` (``share`` along it) is ``distance`` from the centre, the normal to it."""

    limb: int
    share: float
    distance: float
    nx: float
    ny: float


def _nearest(placed: Sequence[tuple[float, ...]], x: float, y: float, reach: float) -> list[_Near]:
    """Contacts within reach; a joint counts for the limb that ends there, and the palm's ends for the palm."""
    found = []
    for i, (ax, ay, ux, uy, length) in enumerate(placed):
        dx, dy = x - ax, y - ay
        along = dx * ux + dy * uy
        if along < 0.0:
            if i > 0:
                continue
            along = 0.0
        elif along > length:
            along = length
        dx -= along * ux
        dy -= along * uy
        if abs(dx) < reach and abs(dy) < reach:
            distance = hypot(dx, dy)
            if distance < reach:
                found.append(_Near(i, along, distance, dx / distance, dy / distance))
    return found


def simulate_circle(
    limbs: ArrayLike,
    n1: int,
    goal: tuple[ArrayLike, ArrayLike],
    radius: float,
    restitution: float,
    resting_speed: float,
    start: Sequence[float],
    drive: Arm | Wrist,
    *,
    dt: float = 0.001,
    steps: int,
) -> dict[str, Any]:
    """One trial of a circle, from rest in the world at ``start`` (as seen from the hand).

    Returns ``positions`` and ``velocities`` as `simulate_stick` does, ``escape_step`` and ``impacts``, the numbers of
    the steps with an impact faster than ``resting_speed``.
    """
    hand, goal_line = _Hand(limbs, n1), _Goal(goal)
    per_period = round(drive.period / dt)
    pose = drive.pose(0, 0.0, drive.is_moving(0.0, dt))
    x, y = pose.out(*start)
    vx = vy = 0.0
    local = (float(start[0]), float(start[1]))
    before = goal_line.beyond(*local)
    positions: list[Vector] = []
    velocities: list[Vector] = []
    impacts: list[int] = []
    escape_step = None
    slack = 0.0  # no limb can be reached before circle and hand have moved by this much

    for number in range(1, steps + 1):
        k, clock = divmod(number - 1, per_period)
        time = clock * dt
        moving = drive.is_moving(time, dt)
        pose = drive.pose(k, time + dt, moving)
        gx, gy, hx, hy = drive.gains(k, time, dt)
        x1, y1 = x + vx * dt + gx, y + vy * dt + gy
        vx1, vy1 = vx + hx, vy + hy
        ax, ay = hx / dt, hy / dt

        # At most this much nearer to any limb: how far it has come as seen from the hand.
        last, local = local, pose.back(x1, y1)
        slack -= hypot(local[0] - last[0], local[1] - last[1])
        if slack <= 0.0:
            placed = hand.placed(pose)
            near = sorted(_nearest(placed, x1, y1, inf), key=lambda contact: contact.distance)[:2]
            slack = near[0].distance - radius
            if slack < 0.0:
                x1, y1, vx1, vy1, hit = _circle_contacts(
                    hand, drive, k, time + dt, moving, pose, placed, near,
                    (x1, y1, vx1, vy1, ax, ay), radius, restitution, resting_speed, dt,
                )  # fmt: skip
                local = pose.back(x1, y1)
                slack = 0.0
                if hit:
                    impacts.append(number)
        x, y, vx, vy = x1, y1, vx1, vy1
        positions.append(local)
        velocities.append((pose.c * vx + pose.s * vy, pose.c * vy - pose.s * vx))

        after = goal_line.beyond(*local)
        if before < 0.0 <= after and goal_line.between(*local):
            escape_step = number
            break
        before = after

    return {
        "positions": np.array(positions),
        "velocities": np.array(velocities),
        "escape_step": escape_step,
        "impacts": impacts,
    }


def _circle_contacts(
    hand: _Hand,
    drive: Arm | Wrist,
    k: int,
    end_time: float,
    moving: bool,
    pose: Pose,
    placed: Sequence[tuple[float, ...]],
    near: Sequence[_Near],
    end: tuple[float, float, float, float, float, float],
    radius: float,
    restitution: float,
    resting_speed: float,
    dt: float,
) -> tuple[float, float, float, float, bool]:
    """Parts 2 and 3 of a step that ends inside a limb."""
    x1, y1, vx1, vy1, ax, ay = end
    speed = pose.velocity(x1, y1)
    fx, fy = pose.acceleration(x1, y1, vx1 - speed[0], vy1 - speed[1])
    felt_x, felt_y = ax - fx, ay - fy

    x, y, vx, vy = x1, y1, vx1, vy1

    def at(i: int, since: float) -> tuple[float, float, float, float, float, Pose]:
        """Distance and normal from limb i, and the closest point of it, some time ago."""
        then = drive.pose(k, end_time - since, moving)
        px = x - vx * since + 0.5 * ax * since * since
        py = y - vy * since + 0.5 * ay * since * since
        lax, lay, lux, luy, length = hand.limbs[i]
        lx, ly = then.back(px, py)
        along = min(max((lx - lax) * lux + (ly - lay) * luy, 0.0), length)
        qx, qy = then.out(lax + along * lux, lay + along * luy)
        distance = hypot(px - qx, py - qy)
        return distance, (px - qx) / distance, (py - qy) / distance, qx, qy, then

    hit, latest, waiting = False, dt, [c.limb for c in near]
    while waiting:
        begun = {
            i: seconds_since(lambda s, i=i: at(i, s)[0] - radius, latest)
            for i in waiting
            if at(i, 0.0)[0] < radius
        }
        if not begun:
            break
        struck = max(begun, key=lambda i: begun[i])
        since = begun[struck]
        _, nx, ny, qx, qy, then = at(struck, since)
        ux, uy = then.velocity(qx, qy)
        approach = -((vx - ax * since - ux) * nx + (vy - ay * since - uy) * ny)
        e = restitution if approach > resting_speed else 0.0
        kick = (1.0 + e) * max(approach, 0.0)  # (7)
        x, y = x + kick * nx * since, y + kick * ny * since
        vx, vy = vx + kick * nx, vy + kick * ny
        hit = hit or e > 0.0
        latest = since
        waiting.remove(struck)

    contacts = sorted(_nearest(placed, x, y, inf), key=lambda contact: contact.distance)[:2]
    overlaps = [[a.nx * b.nx + a.ny * b.ny for b in contacts] for a in contacts]
    pushes = least_pushes(overlaps, [radius - c.distance for c in contacts])
    leaving, resting = [], []
    for c in contacts:
        lax, lay, lux, luy, _ = placed[c.limb]
        ux, uy = pose.velocity(lax + c.share * lux, lay + c.share * luy)
        touching = c.distance < radius
        leaving.append((vx - ux) * c.nx + (vy - uy) * c.ny if touching else 1e30)
        resting.append(resting_speed + max(-(felt_x * c.nx + felt_y * c.ny), 0.0) * dt)
    turns = [0.0 for _ in contacts]
    for _ in range(16):  # one impact after the other, the fastest approach first
        struck = min(range(len(contacts)), key=lambda i: leaving[i])
        if leaving[struck] >= -resting[struck]:
            break
        kick = -(1.0 + restitution) * leaving[struck]
        turns[struck] += kick
        leaving = [v + kick * overlaps[struck][i] for i, v in enumerate(leaving)]
        hit = hit or restitution > 0.0
    rest = least_pushes(overlaps, [-v for v in leaving])
    turns = [turn + last for turn, last in zip(turns, rest, strict=True)]
    for c, push, turn in zip(contacts, pushes, turns, strict=True):
        x, y = x + push * c.nx, y + push * c.ny
        kx, ky = turned(c.nx * turn, c.ny * turn, -0.5 * pose.spin * dt)
        vx, vy = vx + kx, vy + ky
    return x, y, vx, vy, hit


# --------------------------------------------------------------------------------------------------------------- stick


class _Bar(NamedTuple):
    """A stick: centre, angle, their velocities and the centre's acceleration, in the world."""

    x: float
    y: float
    angle: float
    vx: float
    vy: float
    spin: float

    def earlier(self, since: float, ax: float, ay: float) -> _Bar:
        return _Bar(
            self.x - self.vx * since + 0.5 * ax * since * since,
            self.y - self.vy * since + 0.5 * ay * since * since,
            self.angle - self.spin * since,
            self.vx - ax * since,
            self.vy - ay * since,
            self.spin,
        )


class _Pair(NamedTuple):
    """A point and a segment that may meet: the stick's end ``reach`` and a limb, or a vertex (reach 0) and the stick.

    ``side`` is the side of the segment's line on which the point has to stay.
    """

    number: int
    reach: float
    side: float


def _meeting(
    pair: _Pair, placed: Sequence[tuple[float, ...]], corners: Sequence[Vector], bar: _Bar
) -> tuple[float, float, float, float, float, float]:
    """Distance, normal towards the stick, lever (r x n), and the place of contact in the world."""
    tx, ty = cos(bar.angle), sin(bar.angle)
    if pair.reach != 0.0:
        ax, ay, ux, uy, _ = placed[pair.number]
        nx, ny = -uy * pair.side, ux * pair.side
        qx, qy = bar.x + pair.reach * tx, bar.y + pair.reach * ty
        return (qx - ax) * nx + (qy - ay) * ny, nx, ny, pair.reach * (tx * ny - ty * nx), qx, qy
    qx, qy = corners[pair.number]
    nx, ny = ty * pair.side, -tx * pair.side
    reach = (qx - bar.x) * tx + (qy - bar.y) * ty
    distance = (bar.x - qx) * nx + (bar.y - qy) * ny
    return distance, nx, ny, reach * (tx * ny - ty * nx), qx, qy


def _coordinates(
    hand: _Hand,
    placed: Sequence[tuple[float, ...]],
    corners: Sequence[Vector],
    bar: _Bar,
    half: float,
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """(left of the line, along it) for both ends of the stick seen from each limb, and each vertex from the stick."""
    tx, ty = cos(bar.angle), sin(bar.angle)
    by_end = []
    for ax, ay, ux, uy, _ in placed:
        for reach in (half, -half):
            dx, dy = bar.x + reach * tx - ax, bar.y + reach * ty - ay
            by_end.append((ux * dy - uy * dx, ux * dx + uy * dy))
    by_vertex = [
        (tx * (qy - bar.y) - ty * (qx - bar.x), tx * (qx - bar.x) + ty * (qy - bar.y))
        for qx, qy in corners
    ]
    return by_end, by_vertex


def _depths(
    hand: _Hand,
    before: tuple[list[tuple[float, float]], list[tuple[float, float]]],
    after: tuple[list[tuple[float, float]], list[tuple[float, float]]],
    half: float,
    skin: float,
) -> list[tuple[float, _Pair]]:
    """How deep in the skin each pair is, on the side it was before, if the point crossed within the segment."""

    def judged(was: Vector, now: Vector, low: float, high: float) -> tuple[float, bool, bool]:
        off0, off1 = abs(was[0]), now[0] if was[0] >= 0.0 else -now[0]
        share = 0.0
        if off0 > off1:
            share = min(max((off0 - skin) / (off0 - off1), 0.0), 1.0)
        crossed = was[1] + share * (now[1] - was[1])
        return skin - off1, low < crossed < high, off1 < 0.0

    ends = [
        judged(before[0][n], after[0][n], 0.0, hand.limbs[n // 2][4])
        for n in range(2 * len(hand.limbs))
    ]
    points = [judged(was, now, -half, half) for was, now in zip(before[1], after[1], strict=True)]
    lost_ends, lost_points = set(), set()
    for i, corners in enumerate(hand.corners):
        mine = [ends[2 * i], ends[2 * i + 1], *(points[v] for v in corners)]
        cut = (
            after[0][2 * i][0] * after[0][2 * i + 1][0] < 0.0
            and after[1][corners[0]][0] * after[1][corners[1]][0] < 0.0
        )
        if cut and not any(inside and changed for _, inside, changed in mine):
            lost_ends.update((2 * i, 2 * i + 1))
            lost_points.update(corners)
    found = []
    for n, (depth, inside, changed) in enumerate(ends):
        if inside or (changed and n in lost_ends):
            side = 1.0 if before[0][n][0] >= 0.0 else -1.0
            found.append((depth, _Pair(n // 2, half if n % 2 == 0 else -half, side)))
    for v, (depth, inside, changed) in enumerate(points):
        if inside or (changed and v in lost_points):
            found.append((depth, _Pair(v, 0.0, 1.0 if before[1][v][0] >= 0.0 else -1.0)))
    return found


def simulate_stick(
    limbs: ArrayLike,
    n1: int,
    goal: tuple[ArrayLike, ArrayLike],
    half: float,
    skin: float,
    restitution: float,
    resting_speed: float,
    start: Sequence[float],
    orientation: float,
    drive: Arm | Wrist,
    *,
    dt: float = 0.001,
    steps: int,
) -> dict[str, Any]:
    """One trial of a stick, from rest in the world at ``start`` and ``orientation`` as seen from the hand.

    Returns ``positions`` as seen from the hand, ``velocities`` as seen from the ground but in the hand's axes,
    ``angles`` as seen from the hand and ``spins`` as seen from the ground, entry j after j + 1 steps; ``escape_step``,
    the number (from 1) of the step that passed the goal, or None; ``impacts``, the numbers of the steps with an impact
    faster than ``resting_speed``; ``undone``, how many steps had to be undone.
    """
    hand, goal_line = _Hand(limbs, n1), _Goal(goal)
    per_period = round(drive.period / dt)
    per_inertia = 3.0 / (half * half)
    pose = drive.pose(0, 0.0, drive.is_moving(0.0, dt))
    heading = np.arctan2(pose.s, pose.c).item()
    bar = _Bar(*pose.out(*start), orientation + heading, 0.0, 0.0, 0.0)
    local = (float(start[0]), float(start[1]))
    positions: list[Vector] = []
    velocities: list[Vector] = []
    angles: list[float] = []
    spins: list[float] = []
    impacts: list[int] = []
    undone = 0
    escape_step = None

    for number in range(1, steps + 1):
        k, clock = divmod(number - 1, per_period)
        time = clock * dt
        moving = drive.is_moving(time, dt)
        old_pose, pose = drive.pose(k, time, moving), drive.pose(k, time + dt, moving)
        gx, gy, hx, hy = drive.gains(k, time, dt)
        ax, ay = hx / dt, hy / dt
        old = bar
        bar = free = _Bar(
            bar.x + bar.vx * dt + gx,
            bar.y + bar.vy * dt + gy,
            bar.angle + bar.spin * dt,
            bar.vx + hx,
            bar.vy + hy,
            bar.spin,
        )
        placed, corners = hand.placed(pose), [pose.out(*v) for v in hand.vertices]
        reach = half + 2.0 * (hypot(free.x - old.x, free.y - old.y) + 1.0)
        if _nearest(placed, free.x, free.y, reach):
            old_placed = hand.placed(old_pose)
            old_corners = [old_pose.out(*v) for v in hand.vertices]
            before = _coordinates(hand, old_placed, old_corners, old, half)

            def deepest(
                bar: _Bar, count: int, before=before, placed=placed, corners=corners
            ) -> list[tuple[float, _Pair]]:
                found = _depths(
                    hand, before, _coordinates(hand, placed, corners, bar, half), half, skin
                )
                return sorted(found, key=lambda item: -item[0])[:count]

            met = deepest(bar, 1)
            if met and met[0][0] > 0.0:
                bar, hit = _stick_impact(
                    hand, drive, k, time + dt, moving, met[0][1], bar, ax, ay,
                    skin, restitution, resting_speed, per_inertia, dt,
                )  # fmt: skip
                for _ in range(2):
                    pairs = [met[0][1]]
                    pairs += [pair for _, pair in deepest(bar, 3) if pair != met[0][1]]
                    bar, more = _stick_hold_off(
                        pose, placed, corners, pairs, bar, free, ax, ay,
                        skin, restitution, resting_speed, per_inertia, dt,
                    )  # fmt: skip
                    hit = hit or more
                if hit:
                    impacts.append(number)
                left = deepest(bar, 1)
                if left and left[0][0] >= skin:
                    undone += 1
                    place = pose.out(*old_pose.back(old.x, old.y))
                    bar = bar._replace(x=place[0], y=place[1], angle=old.angle + pose.spin * dt)

        last, local = local, pose.back(bar.x, bar.y)
        positions.append(local)
        velocities.append((pose.c * bar.vx + pose.s * bar.vy, pose.c * bar.vy - pose.s * bar.vx))
        angle = bar.angle - np.arctan2(pose.s, pose.c).item()
        angles.append(angle - 2.0 * pi * round(angle / (2.0 * pi)))
        spins.append(bar.spin)

        was, now = goal_line.beyond(*last), goal_line.beyond(*local)
        if was < 0.0 <= now:
            share = was / (was - now)
            crossing = [a + share * (b - a) for a, b in zip(last, local, strict=True)]
            if goal_line.between(*crossing):
                escape_step = number
                break

    return {
        "positions": np.array(positions),
        "velocities": np.array(velocities),
        "angles": np.array(angles),
        "spins": np.array(spins),
        "escape_step": escape_step,
        "impacts": impacts,
        "undone": undone,
    }


def _closing(
    pose: Pose, bar: _Bar, nx: float, ny: float, lever: float, qx: float, qy: float
) -> float:
    """Speed at which the two points that meet close in."""
    ux, uy = pose.velocity(qx, qy)
    return -((bar.vx - ux) * nx + (bar.vy - uy) * ny + bar.spin * lever)


def _stick_impact(
    hand: _Hand,
    drive: Arm | Wrist,
    k: int,
    end_time: float,
    moving: bool,
    pair: _Pair,
    end: _Bar,
    ax: float,
    ay: float,
    skin: float,
    restitution: float,
    resting_speed: float,
    per_inertia: float,
    dt: float,
) -> tuple[_Bar, bool]:
    """Eqs (14)-(17) at the time of the impact, and free motion from there to the end of the step."""

    def at(since: float) -> tuple[Pose, _Bar, tuple[float, float, float, float, float, float]]:
        then = drive.pose(k, end_time - since, moving)
        bar = end.earlier(since, ax, ay)
        corners = [then.out(*v) for v in hand.vertices]
        return then, bar, _meeting(pair, hand.placed(then), corners, bar)

    since = seconds_since(lambda s: at(s)[2][0] - skin, dt)
    then, bar, (_, nx, ny, lever, qx, qy) = at(since)
    approach = _closing(then, bar, nx, ny, lever, qx, qy)
    e = restitution if approach > resting_speed else 0.0
    impulse = (1.0 + e) * max(approach, 0.0) / (1.0 + lever * lever * per_inertia)  # (17)
    kx, ky, spin = impulse * nx, impulse * ny, lever * per_inertia * impulse  # (15), (16)
    bar = _Bar(
        end.x + kx * since,
        end.y + ky * since,
        end.angle + spin * since,
        end.vx + kx,
        end.vy + ky,
        end.spin + spin,
    )
    return bar, e > 0.0


def _stick_hold_off(
    pose: Pose,
    placed: Sequence[tuple[float, ...]],
    corners: Sequence[Vector],
    pairs: Sequence[_Pair],
    bar: _Bar,
    free: _Bar,
    ax: float,
    ay: float,
    skin: float,
    restitution: float,
    resting_speed: float,
    per_inertia: float,
    dt: float,
) -> tuple[_Bar, bool]:
    """Part 3 of a step, once."""
    # The centre's acceleration as seen from the hand is that of the free motion.
    ux, uy = pose.velocity(free.x, free.y)
    fx, fy = pose.acceleration(free.x, free.y, free.vx - ux, free.vy - uy)
    felt_x, felt_y = ax - fx, ay - fy
    tx, ty = cos(bar.angle), sin(bar.angle)
    ux, uy = pose.velocity(bar.x, bar.y)
    rel_x, rel_y, rel_spin = bar.vx - ux, bar.vy - uy, bar.spin - pose.spin

    ways, depths, stops, fast = [], [], [], []
    for pair in pairs:
        distance, nx, ny, lever, qx, qy = _meeting(pair, placed, corners, bar)
        size = (1.0 + lever * lever * per_inertia) ** 0.5
        approach = _closing(pose, bar, nx, ny, lever, qx, qy)
        if pair.reach != 0.0:
            bend = -pair.reach * rel_spin * rel_spin * (tx * nx + ty * ny)
        else:
            bend = 2.0 * pair.side * rel_spin * (tx * rel_x + ty * rel_y)
        pressing = -(felt_x * nx + felt_y * ny) - bend
        e = restitution if approach > resting_speed + max(pressing, 0.0) * dt else 0.0
        ways.append((nx / size, ny / size, lever / size))
        depths.append((skin - distance) / size)
        stops.append((1.0 + e) * approach / size)
        fast.append(e > 0.0 and skin > distance)
    overlaps = [[a[0] * b[0] + a[1] * b[1] + a[2] * b[2] * per_inertia for b in ways] for a in ways]
    pushes = least_pushes(overlaps, depths)
    touching = [depth > 0.0 or push > 0.0 for depth, push in zip(depths, pushes, strict=True)]
    turns = least_pushes(
        overlaps, [stop if on else -1e30 for stop, on in zip(stops, touching, strict=True)]
    )
    x, y, angle, vx, vy, spin = bar
    for (nx, ny, lever), push, turn in zip(ways, pushes, turns, strict=True):
        x, y, angle = x + push * nx, y + push * ny, angle + push * lever * per_inertia
        kx, ky = turned(turn * nx, turn * ny, -0.5 * pose.spin * dt)
        vx, vy, spin = vx + kx, vy + ky, spin + turn * lever * per_inertia
    return _Bar(x, y, angle, vx, vy, spin), any(fast)
