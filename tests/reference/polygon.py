"""Reference simulator for convex polygons with friction: fixed small steps in float64, compiled by numba.

A rounded polygon in a hand that stays put under gravity that turns, or that an arm carries.  Every step flies freely,
looks at all pairs of a vertex and a limb and of a point of the hand and an edge, answers what has come in by impacts one
after the other (Wang and Mason 1992), takes what is left of approach and slip by impulses in turn until nothing changes,
and pushes out what still overlaps.  Its error is of first order in the step; it shares no code with the package.

Units: lengths in the unit of ``g``, times in seconds, angles in radians.  Masses cancel; the object's is 1.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

MOST = 64
"""Contacts that are kept of a step."""


@njit(cache=False)
def _contacts(
    limbs, points, own, edges, reach, rounding, half, x, y, c, s, x0, y0, c0, s0, margin, out
):
    """Contacts with a gap below the margin: normal from limb to body, point, gap. Returns how many.

    ``edges``: rows (x, y, length), the direction from each vertex to the next; ``reach``: the longest arm. ``x0``,
    ``y0``, ``c0``, ``s0``: where the body was when it last overlapped nothing, which tells what has gone through a limb.
    """
    n = 0
    k = len(own)
    far = (reach + rounding + half + margin) ** 2
    for j in range(len(limbs)):
        ax, ay, tx, ty, length = limbs[j]
        centre_along = (x - ax) * tx + (y - ay) * ty
        centre_across = tx * (y - ay) - ty * (x - ax)
        over = centre_along - min(max(centre_along, 0.0), length)
        if over * over + centre_across * centre_across > far:
            continue
        for i in range(k):
            qx = x + c * own[i, 0] - s * own[i, 1]
            qy = y + s * own[i, 0] + c * own[i, 1]
            rx, ry = qx - ax, qy - ay
            along, across = rx * tx + ry * ty, tx * ry - ty * rx
            qx0 = x0 + c0 * own[i, 0] - s0 * own[i, 1] - ax
            qy0 = y0 + s0 * own[i, 0] + c0 * own[i, 1] - ay
            along0, across0 = qx0 * tx + qy0 * ty, tx * qy0 - ty * qx0
            if across * across0 < 0.0 and n < MOST:
                through = along + (along0 - along) * across / (across - across0)
                if 0.0 <= through <= length:
                    side = 1.0 if across0 > 0.0 else -1.0
                    nx, ny = -ty * side, tx * side
                    out[n, 0], out[n, 1] = nx, ny
                    out[n, 2], out[n, 3] = qx - nx * rounding, qy - ny * rounding
                    out[n, 4] = -abs(across) - rounding
                    n += 1
                    continue
            if j > 0 and along < 0.0:
                continue  # the limb before has this joint
            on = min(max(along, 0.0), length)
            dx, dy = rx - tx * on, ry - ty * on
            d = math.sqrt(dx * dx + dy * dy)
            if d - rounding - half < margin and d > 0.0 and n < MOST:
                nx, ny = dx / d, dy / d
                out[n, 0], out[n, 1] = nx, ny
                out[n, 2], out[n, 3] = qx - nx * rounding, qy - ny * rounding
                out[n, 4] = d - rounding - half
                n += 1
    if k > 1:
        for h in range(len(points)):
            if (points[h, 0] - x) ** 2 + (points[h, 1] - y) ** 2 > far:
                continue
            best, edge = -1e30, -1
            for i in range(k):
                if k == 2:
                    # A rod has no inside: the side on which the point was, if it came through.
                    wx0 = c0 * edges[i, 0] - s0 * edges[i, 1]
                    wy0 = s0 * edges[i, 0] + c0 * edges[i, 1]
                    px0 = points[h, 0] - x0 - c0 * own[i, 0] + s0 * own[i, 1]
                    py0 = points[h, 1] - y0 - s0 * own[i, 0] - c0 * own[i, 1]
                    height0, along0 = px0 * wy0 - py0 * wx0, px0 * wx0 + py0 * wy0
                else:
                    height0, along0 = 0.0, 0.0
                wx, wy = c * edges[i, 0] - s * edges[i, 1], s * edges[i, 0] + c * edges[i, 1]
                qx = x + c * own[i, 0] - s * own[i, 1]
                qy = y + s * own[i, 0] + c * own[i, 1]
                height = (points[h, 0] - qx) * wy - (points[h, 1] - qy) * wx
                if height0 > 0.0 and height < 0.0:
                    along = (points[h, 0] - qx) * wx + (points[h, 1] - qy) * wy
                    through = along + (along0 - along) * height / (height - height0)
                    if 0.0 <= through <= edges[i, 2]:
                        best, edge = height, i
                        break
                if height > best:
                    best, edge = height, i
            wx = c * edges[edge, 0] - s * edges[edge, 1]
            wy = s * edges[edge, 0] + c * edges[edge, 1]
            qx = x + c * own[edge, 0] - s * own[edge, 1]
            qy = y + s * own[edge, 0] + c * own[edge, 1]
            along = (points[h, 0] - qx) * wx + (points[h, 1] - qy) * wy
            if 0.0 < along < edges[edge, 2] and best - rounding - half < margin and n < MOST:
                out[n, 0], out[n, 1] = -wy, wx
                out[n, 2], out[n, 3] = points[h, 0] - wy * half, points[h, 1] + wx * half
                out[n, 4] = best - rounding - half
                n += 1
    return n


@njit(cache=False)
def collide(approach, slip, cn, ct, mu, e):
    """Normal and tangential impulse of one impact, for a unit of mass; cn, ct: levers over kappa."""
    nn, tt, nt = 1.0 + cn * cn, 1.0 + ct * ct, cn * ct
    p, vn, vt, f = 0.0, -approach, slip, 0.0
    target = -1.0
    for _ in range(6):
        if vt > 0.0:
            rub = -mu
        elif vt < 0.0:
            rub = mu
        elif abs(nt) <= mu * tt:
            rub = -nt / tt
        else:
            rub = -mu if nt > 0.0 else mu
        an, at = nn + rub * nt, nt + rub * tt
        step = math.inf
        if vt * at < 0.0:
            step = -vt / at
        if vn < 0.0 and an > 0.0 and target < 0.0 and -vn / an <= step:
            p += -vn / an
            f += rub * (-vn / an)
            vt += at * (-vn / an)
            vn = 0.0
            target = (1.0 + e) * p
            continue
        if target >= 0.0 and target - p <= step:
            return target, f + rub * (target - p)
        p, f, vn = p + step, f + rub * step, vn + an * step
        vt = 0.0
    return p, f


@njit(cache=False)
def run(
    limbs,
    points,
    goal,
    own,
    rounding,
    half,
    kappa,
    turns,
    mu,
    e,
    rest,
    arm,
    g,
    starts,
    targets,
    ramp,
    period,
    dt,
    limit,
):
    """Each trial's time of escape (``limit`` if it stays), s, and its deepest overlap.

    ``limbs``: rows (x, y, tx, ty, length) in the hand's frame; ``points``: joints and ends once; ``goal``: (ax, ay, bx,
    by); ``half``: of the limbs' thickness; ``own``: vertices about the centre of mass; ``starts``: rows (x, y, angle); ``targets``: (trials, periods + 1,
    2 or 3) joint angles, those at rest first; ``arm``: (mount, L1, L2), or L1 = 0 for a hand that stays put.
    """
    count = len(starts)
    times, deepest = np.full(count, limit), np.zeros(count)
    reach = 0.0
    for i in range(len(own)):
        reach = max(reach, math.hypot(own[i, 0], own[i, 1]))
    ahead = np.empty_like(own)
    ahead[:-1], ahead[-1] = own[1:], own[0]
    edges = np.zeros((len(own), 3))
    for i in range(len(own)):
        length = math.hypot(ahead[i, 0] - own[i, 0], ahead[i, 1] - own[i, 1])
        if length > 0.0:
            edges[i, 0] = (ahead[i, 0] - own[i, 0]) / length
            edges[i, 1] = (ahead[i, 1] - own[i, 1]) / length
            edges[i, 2] = length
    found = np.zeros((MOST, 5))
    scene = (limbs, points, own, edges, reach, rounding, half)
    carried = arm[1] > 0.0
    inv = 1.0 / kappa if turns else 0.0
    gx, gy = goal[2] - goal[0], goal[3] - goal[1]
    goal_length = math.hypot(gx, gy)
    per_period, in_ramp = round(period / dt), round(ramp / dt)
    for trial in range(count):
        x, y, angle = starts[trial]
        vx = vy = w = 0.0
        clear, line_before = 0.0, -1.0
        ox = oy = turn = 0.0
        cos_t, sin_t = 1.0, 0.0
        ovx = ovy = spin = 0.0
        before = (x, y, math.cos(angle), math.sin(angle))
        n, steps, same = -1, round(limit / dt), 0
        while n + 1 < steps:
            n += 1
            which, at = n // per_period, n % per_period
            x_before, y_before, angle_before = x, y, angle
            if carried:
                # The hand at the end of the step; the object flies in the world.
                if n == 0:
                    a1, a2, a3 = targets[trial, 0, 0], targets[trial, 0, 1], targets[trial, 0, 2]
                    h1 = arm[0] + a1
                    h2 = h1 + a2
                    ox = arm[1] * math.cos(h1) + arm[2] * math.cos(h2)
                    oy = arm[1] * math.sin(h1) + arm[2] * math.sin(h2)
                    turn = h2 + a3 - 0.5 * math.pi
                    c, s = math.cos(turn), math.sin(turn)
                    x, y = ox + c * x - s * y, oy + s * x + c * y
                    angle += turn
                x += vx * dt
                y += vy * dt - 0.5 * g * dt * dt
                vy -= g * dt
                angle += w * dt
                share = min((at + 1.0) / in_ramp, 1.0)
                b, d = targets[trial, which], targets[trial, which + 1]
                rates = 1.0 / ramp if at < in_ramp else 0.0
                h1 = arm[0] + b[0] + share * (d[0] - b[0])
                h2 = h1 + b[1] + share * (d[1] - b[1])
                h3 = h2 + b[2] + share * (d[2] - b[2])
                w1 = rates * (d[0] - b[0])
                w2 = w1 + rates * (d[1] - b[1])
                spin = w2 + rates * (d[2] - b[2])
                l1x, l1y = arm[1] * math.cos(h1), arm[1] * math.sin(h1)
                l2x, l2y = arm[2] * math.cos(h2), arm[2] * math.sin(h2)
                ox, oy, turn = l1x + l2x, l1y + l2y, h3 - 0.5 * math.pi
                ovx, ovy = -w1 * l1y - w2 * l2y, w1 * l1x + w2 * l2x
                cos_t, sin_t = math.cos(turn), math.sin(turn)
                rx, ry = x - ox, y - oy
                hx, hy = cos_t * rx + sin_t * ry, cos_t * ry - sin_t * rx
                ux, uy = vx - ovx + spin * ry, vy - ovy - spin * rx
                ux, uy = cos_t * ux + sin_t * uy, cos_t * uy - sin_t * ux
                turned, uw = angle - turn, w - spin
                px, py = -sin_t * g, -cos_t * g
            else:
                share = min((at + 0.5) / in_ramp, 1.0)
                b, d = targets[trial, which], targets[trial, which + 1]
                one, two = b[0] + share * (d[0] - b[0]), b[1] + share * (d[1] - b[1])
                px, py = g * math.sin(one), -g * math.cos(one) * math.sin(two)
                x += (vx + 0.5 * px * dt) * dt
                y += (vy + 0.5 * py * dt) * dt
                vx += px * dt
                vy += py * dt
                angle += w * dt
                hx, hy, ux, uy, turned, uw = x, y, vx, vy, angle, w
            speed = math.hypot(ux, uy) + abs(uw) * (reach + rounding) + 2.0 * g * dt
            clear -= (speed + 0.1) * dt
            if clear <= 0.0:
                c, s = math.cos(turned), math.sin(turned)
                near = _contacts(*scene, hx, hy, c, s, *before, 2.0, found)
                least = 2.0
                for a in range(near):
                    least = min(least, found[a, 4])
                clear = max(least - 0.02, 0.0)
                if least < 0.0:
                    deepest[trial] = max(deepest[trial], -least)
                    for _ in range(200):
                        fastest, first = 0.0, -1
                        for a in range(near):
                            if found[a, 4] < 0.0:
                                rx, ry = found[a, 2] - hx, found[a, 3] - hy
                                nx, ny = found[a, 0], found[a, 1]
                                vn = (ux - uw * ry) * nx + (uy + uw * rx) * ny
                                press = max(0.0, -(px * nx + py * ny)) * dt
                                if -vn > rest + 2.0 * press and -vn > fastest:
                                    fastest, first = -vn, a
                        if first < 0:
                            break
                        # A face that lands flat hits in the middle of its contacts.
                        nx, ny = found[first, 0], found[first, 1]
                        rx = ry = alike = 0.0
                        for a in range(near):
                            if found[a, 4] < 0.0 and nx * found[a, 0] + ny * found[a, 1] > 0.999:
                                ax, ay = found[a, 2] - hx, found[a, 3] - hy
                                vn = (ux - uw * ay) * nx + (uy + uw * ax) * ny
                                if -vn >= 0.999 * fastest:
                                    rx, ry, alike = rx + ax, ry + ay, alike + 1.0
                        rx, ry = rx / alike, ry / alike
                        fastest = -((ux - uw * ry) * nx + (uy + uw * rx) * ny)
                        cn, ct = (rx * ny - ry * nx) * inv, (rx * nx + ry * ny) * inv
                        vt = -(ux - uw * ry) * ny + (uy + uw * rx) * nx
                        jn, jt = collide(fastest, vt, cn, ct, mu, e)
                        ux += jn * nx - jt * ny
                        uy += jn * ny + jt * nx
                        uw += (jn * cn + jt * ct) * inv
                    # What is left, by impulses in turn, plastic.
                    normal, along = np.zeros(near), np.zeros(near)
                    for _ in range(500):
                        change = 0.0
                        for a in range(near):
                            if found[a, 4] >= 0.0:
                                continue
                            rx, ry = found[a, 2] - hx, found[a, 3] - hy
                            nx, ny = found[a, 0], found[a, 1]
                            cn, ct = (rx * ny - ry * nx) * inv, (rx * nx + ry * ny) * inv
                            vn = (ux - uw * ry) * nx + (uy + uw * rx) * ny
                            new = max(0.0, normal[a] - vn / (1.0 + cn * cn))
                            j = new - normal[a]
                            normal[a] = new
                            ux += j * nx
                            uy += j * ny
                            uw += j * cn * inv
                            change = max(change, abs(j))
                            if mu > 0.0:
                                vt = -(ux - uw * ry) * ny + (uy + uw * rx) * nx
                                most = mu * normal[a]
                                new = min(max(along[a] - vt / (1.0 + ct * ct), -most), most)
                                j = new - along[a]
                                along[a] = new
                                ux -= j * ny
                                uy += j * nx
                                uw += j * ct * inv
                                change = max(change, abs(j))
                        if change < 1e-11:
                            break
                    for _ in range(10):
                        mx = my = mt = 0.0
                        pushes = np.zeros(near)
                        for _ in range(300):
                            change = 0.0
                            for a in range(near):
                                if found[a, 4] > 0.1:
                                    continue
                                rx, ry = found[a, 2] - hx, found[a, 3] - hy
                                nx, ny = found[a, 0], found[a, 1]
                                cn = (rx * ny - ry * nx) * inv
                                lack = -found[a, 4] - (mx * nx + my * ny + mt * cn)
                                new = max(0.0, pushes[a] + lack / (1.0 + cn * cn))
                                j = new - pushes[a]
                                pushes[a] = new
                                mx += j * nx
                                my += j * ny
                                mt += j * cn
                                change = max(change, abs(j))
                            if change < 1e-12:
                                break
                        hx += mx
                        hy += my
                        turned += mt * inv
                        c, s = math.cos(turned), math.sin(turned)
                        near = _contacts(*scene, hx, hy, c, s, *before, 2.0, found)
                        worst = 0.0
                        for a in range(near):
                            worst = max(worst, -found[a, 4])
                        if worst < 1e-9:
                            break
                    if carried:
                        rx, ry = cos_t * hx - sin_t * hy, sin_t * hx + cos_t * hy
                        x, y, angle, w = ox + rx, oy + ry, turned + turn, uw + spin
                        vx = cos_t * ux - sin_t * uy + ovx - spin * ry
                        vy = sin_t * ux + cos_t * uy + ovy + spin * rx
                    else:
                        x, y, vx, vy, angle, w = hx, hy, ux, uy, turned, uw
            before = (hx, hy, math.cos(turned), math.sin(turned))
            line = (gx * (hy - goal[1]) - gy * (hx - goal[0])) / goal_length
            where = (gx * (hx - goal[0]) + gy * (hy - goal[1])) / goal_length**2
            if line_before < 0.0 and line >= 0.0 and 0.0 < where < 1.0:
                times[trial] = (n + 1) * dt
                break
            line_before = line
            if not (abs(hx) < 1e5 and abs(hy) < 1e5):
                times[trial] = np.nan
                break
            # What stays where it is under a pull that stays does so to the period's end.
            moved = abs(x - x_before) + abs(y - y_before) + reach * abs(angle - angle_before)
            moved += (abs(vx) + abs(vy) + reach * abs(w)) * dt
            same = same + 1 if moved < 1e-9 else 0
            if same > 10 and at >= in_ramp and not carried:
                n, same, clear = min((which + 1) * per_period, steps) - 1, 0, 0.0
    return times, deepest
