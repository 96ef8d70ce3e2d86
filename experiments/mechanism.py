"""Why the curves of Fig. 9(b) peak: from where in the box hand objects escape, and which way.

For W_g = 0.6 and 0.8 L_p, theta_g from 0 to 80 deg and several readings of the model: how often an
object begins a period of the wrist at rest in the wedge between fingertip and lid, in the lid's
outer corner, at the palm, or in motion; how many escape in that period, and whether they came
round a fingertip (the last they touched before was the lid or the fingertip's back) or straight
from palm and sides; and what statics and a parabola say about the way from the lid's corner round
the fingertip (`way_round`).

Keeps `results/mechanism.csv`, a reading and a gap at a time, so a run that was interrupted goes on
where it was; draws `results/mechanism.png` and, of single objects, `results/mechanism_paths.png`.
"""

from __future__ import annotations

import argparse
import math
import threading
import time
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binomtest

from experiments.readings import kept, numbers, peak_of, save
from pcjax.geometry import Vec
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import points_of
from pcjax.model.presets import box_hand
from pcjax.model.scenario import Scenario, does
from pcjax.paper import constants as paper
from pcjax.paper.readings import LITERAL, RUBBING, Reading
from pcjax.physics.state import INVALID, PASSED, State, at_rest
from pcjax.physics.step import step
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine
from pcjax.simulate.lanes import Lanes
from pcjax.simulate.track import Track
from pcjax.view.shapes import draw_limbs

RESULTS = Path(__file__).parent / "results"
UNIT = paper.WRIST_PALM_LENGTH
RADIUS = paper.RADII[0] * UNIT
TIP = paper.FINGERTIP_LENGTH * UNIT
GAP_WIDTHS = paper.GAP_WIDTHS[1:]
PEAKS = (40.0, 50.0)
"""Where the paper's curves for these gaps peak, degrees (Sec. 3.3.2)."""
ANGLES = tuple(range(0, 81, 5))

FALLING = Reading("gravity 98", RUBBING.gravity, 0.0, True)
ROLLING = Reading("rolling", RUBBING.gravity, RUBBING.friction, True)
READINGS = {reading.name: reading for reading in (LITERAL, FALLING, RUBBING, ROLLING)}
COLOURS = dict(zip(READINGS, ("#0072b2", "#e69f00", "#d55e00", "#888888"), strict=True))
FURTHER = {
    reading.name: reading
    for reading in (
        Reading(f"friction {mu:g}", RUBBING.gravity, mu, RUBBING.turning) for mu in (0.2, 0.5)
    )
}
"""Pucks that rub less and more: their peaks have to move along. Not drawn."""

FEWER = {ROLLING.name: 5, **dict.fromkeys(FURTHER, 2)}
"""Of how many trials one is run: those of a circle that rolls take longest."""

PLACES = ("wedge", "lid corner", "palm corner", "other rest", "sliding behind", "moving", "start")
"""Where an object is when a period begins. At rest: behind a fingertip, touching its back; where
lid and side meet; where palm and side meet; elsewhere. In motion: touching the lid or a fingertip's
back; elsewhere. In a trial's first period: at its start."""
_WEDGE, _LID, _PALM, _OTHER, _SLIDING, _MOVING, _START = range(len(PLACES))

_TOUCHES = 1.05
"""Contact radii from a limb up to which an object touches it."""

_SLOW = 0.05
"""Speed up to which an object is at rest: the contact law's resting speed."""

Row = dict[str, Any]


def scenario(reading: Reading, gap_width: float, angle: float) -> Scenario:
    """Fig. 9(b)'s hand and object under a reading; the gap in L_p, the angle in degrees."""
    hand = box_hand(
        math.radians(angle), palm_length=UNIT, gap_width=gap_width * UNIT, fingertip_length=TIP
    )
    return does(hand, reading.circle(RADIUS), reading.wrist(), reading.law())


# ------------------------------------------------------------------------------ where trials are


class Watcher:
    """Keeps where each trial is at the end of each period, and what it touched last.

    Arguments:
        scenarios: box hands, symmetric.
        trials: of each.
        periods: that a trial may last.

    Attributes:
        place: of `PLACES`, at the end of each period; -1 where the trial had ended.
        round: whether the limb touched last was a lid or the back of a fingertip.
    """

    def __init__(self, scenarios: Sequence[Scenario], trials: int, periods: int):
        shape = len(scenarios), trials
        self.place = np.full((*shape, periods), -1, np.int8)
        self.round = np.zeros(shape, bool)
        self._period = float(scenarios[0].drive.period)
        # Palm, side, lid and fingertip on the left.
        limbs = [(s.hand.limbs()[0], *s.hand.finger(0)) for s in scenarios]
        self._ends = np.array(
            [[[end.x, end.y] for end in (k.start, k.end)] for one in limbs for k in one], float
        ).reshape(len(scenarios), 4, 2, 2)
        self._lock = threading.Lock()

    def follow(self, lanes: Lanes, track: Track, ran: Bool[np.ndarray, " lanes"]) -> None:
        """Takes note of what one call did."""
        assert track.velocity is not None
        condition, trial = np.asarray(lanes.condition)[ran], np.asarray(lanes.trial)[ran]
        period, moment = np.asarray(track.period)[:, ran], np.asarray(track.time)[:, ran]
        at = np.stack([-np.abs(track.position.x), track.position.y], -1).astype(float)[:, ran]
        speed = np.hypot(track.velocity.x, track.velocity.y)[:, ran]
        palm, side, lid, tip = self._touched(condition, at)

        behind = lid | tip
        # The last point of each lane at which it touches something.
        rows = np.arange(len(at))[:, None]
        last = np.where(behind | palm | side, rows, -1).max(axis=0)
        some = np.flatnonzero(last >= 0)
        at_rest = speed <= _SLOW
        place = np.select(
            [at_rest & tip, at_rest & lid & side, at_rest & palm & side, at_rest, behind],
            [_WEDGE, _LID, _PALM, _OTHER, _SLIDING],
            _MOVING,
        )
        over = moment >= self._period * (1 - 1e-6)
        over[0] = False  # told by the call before
        row, lane = np.nonzero(over)
        with self._lock:
            self.round[condition[some], trial[some]] = behind[last[some], some]
            self.place[condition[lane], trial[lane], period[row, lane]] = place[row, lane]

    def _touched(
        self, condition: Int[np.ndarray, " lanes"], at: Float[np.ndarray, "points lanes 2"]
    ) -> Bool[np.ndarray, "4 points lanes"]:
        """Whether palm, side, lid and the fingertip's back are touched."""
        touched = []
        for limb in range(4):
            start, end = self._ends[condition, limb, 0], self._ends[condition, limb, 1]
            along, to = end - start, at - start
            share = (to * along).sum(-1) / (along**2).sum(-1)
            off = to - np.clip(share, 0, 1)[..., None] * along
            near = np.hypot(off[..., 0], off[..., 1]) <= _TOUCHES * RADIUS
            if limb == 3:  # from behind, and not at its end
                behind = along[:, 0] * off[..., 1] - along[:, 1] * off[..., 0] < 0
                near &= behind & (share < 1)
            touched.append(near)
        return np.array(touched)


def group(
    reading: Reading, gap_width: float, *, trials: int, max_steps: int, seed: int
) -> Iterator[Row]:
    """All angles of a reading and a gap, as rows of the data file."""
    scenarios = [scenario(reading, gap_width, angle) for angle in ANGLES]
    engine = choose_engine("auto", None, scenarios[0])
    length = round(paper.WRIST_PERIOD / paper.DT)
    periods = -(-max_steps // length)
    watcher = Watcher(scenarios, trials, periods)
    began = time.process_time()
    out = run(
        scenarios,
        trials=trials,
        max_steps=max_steps,
        seed=seed,
        engine=engine,
        progress=True,
        follower=watcher,
    )
    cpu = time.process_time() - began
    valid = (out.status != INVALID).all(axis=0)
    steps, passed = out.steps[:, valid], (out.status == PASSED)[:, valid]
    # Where each period begins, and how it ends.
    start = np.full((*steps.shape, 1), _START, np.int8)
    begun = np.concatenate([start, watcher.place[:, valid, :-1]], axis=-1)
    last = (steps - 1) // length
    escaped = passed[..., None] & (np.arange(periods) == last[..., None])
    wound = watcher.round[:, valid, None]
    later = begun >= 0
    later[..., 0] = False
    exposure, events = later.sum(-1).astype(float), (escaped & later).sum(-1).astype(float)
    rates = events.sum(1) / exposure.sum(1)
    moved = (events - rates[:, None] * exposure) / exposure.mean(axis=1, keepdims=True)
    made = {
        "peak_deg": peak(steps.mean(axis=1), np.cov(steps) / steps.shape[1]),
        "fewest_deg": peak(-rates, np.cov(moved) / steps.shape[1]),
        "engine": engine.name,
        "trials_used": int(valid.sum()),
        "cpu_s": f"{cpu:.0f}",
    }
    for k, angle in enumerate(ANGLES):
        common = {"reading": reading.name, "gap_width": gap_width, "angle_deg": angle}
        settings = {"trials": trials, "max_steps": max_steps, "seed": seed}
        inside = steps[k][passed[k]] / length - last[k][passed[k]]
        for place, name in enumerate(("all", *PLACES), start=-1):
            there = later[k] if place < 0 else begun[k] == place
            whole = later[k] if place != _START else there
            row = common | {"place": name} | shares(there.sum(-1), whole.sum(-1))
            for way, taken in (("round", wound[k]), ("straight", ~wound[k])):
                row |= rate(way, int((escaped[k] & there & taken).sum()), int(there.sum()))
            if place < 0:
                row |= {
                    "index1": f"{steps[k].mean():.6g}",
                    "index1_se": f"{steps[k].std(ddof=1) / math.sqrt(len(steps[k])):.3g}",
                    "escape_phase": f"{inside.mean():.3f}",
                }
                row |= made
            if place == _LID and not (reading.friction and reading.turning):
                row["way_round"] = f"{way_round(reading, gap_width, angle):.4g}"
            yield row | settings


def shares(there: Int[np.ndarray, " trials"], whole: Int[np.ndarray, " trials"]) -> Row:
    """Periods begun somewhere, and which share of all they are, with a standard error between
    trials."""
    share = there.sum() / whole.sum()
    residual = (there - share * whole) / whole.mean()
    se = residual.std(ddof=1) / math.sqrt(len(whole))
    return {"periods": int(there.sum()), "share": f"{share:.5f}", "share_se": f"{se:.2g}"}


def rate(way: str, escapes: int, periods: int) -> Row:
    """Escapes on a way per period, with Wilson's 95 % interval: an object's past does not matter
    much for what it does next."""
    if periods == 0:
        return {way: 0, f"{way}_rate": "", f"{way}_low": "", f"{way}_high": ""}
    found = binomtest(escapes, periods).proportion_ci(method="wilson")
    return {
        way: escapes,
        f"{way}_rate": f"{escapes / periods:.5f}",
        f"{way}_low": f"{found.low:.5f}",
        f"{way}_high": f"{found.high:.5f}",
    }


def peak(
    value: Float[np.ndarray, " angles"], covariance: Float[np.ndarray, "angles angles"]
) -> str:
    """The angle of the highest value with its 95 % interval, in words."""
    return "{:g} [{:g}, {:g}]".format(*peak_of(np.array(ANGLES), value, covariance))


# ----------------------------------------------------------------- what statics and a parabola say


def release_angle(reading: Reading, angle: float) -> float:
    """How far gravity in the hand's plane may be turned from the palm's direction, towards the gap,
    before a fingertip at `angle` no longer lets go of an object that rests on its back; degrees.

    Gravity at an angle phi pulls with sin(theta - phi) along the fingertip and presses with
    cos(theta - phi) on it: the object slides where phi < theta - atan(mu).
    """
    return angle - math.degrees(math.atan(reading.friction))


def way_round(reading: Reading, gap_width: float, angle: float) -> float:
    """Which share of all tilts takes an object at rest in the lid's corner round the fingertip and
    out, within one period (see `seconds_out`). The ramp counts as a jump half way through it."""
    drive, n = reading.wrist(), 400
    tilts = float(drive.amplitude) * (2 * (np.arange(n) + 0.5) / n - 1)
    first, second = np.meshgrid(tilts, tilts)
    pull = np.sin(first), -np.cos(first) * np.sin(second)  # (1)
    seconds = seconds_out(
        reading, gap_width, angle, *(reading.gravity * component for component in pull)
    )
    return float((seconds < drive.period - 0.5 * drive.ramp_time).mean())


def seconds_out(
    reading: Reading,
    gap_width: float,
    angle: float,
    x: Float[np.ndarray, "..."],
    y: Float[np.ndarray, "..."],
) -> Float[np.ndarray, "..."]:
    """How long an object at rest in the lid's left corner takes round the fingertip and out.

    It slides along the lid, is caught by the fingertip without rebound, and slides on along its
    back, both with Coulomb's friction, if it moves at all; leaves at its end; and has to be above
    the end of the other fingertip when it gets there.

    Arguments:
        reading, gap_width, angle: as for `scenario`.
        x, y: gravity, which stays, along the palm and towards the gap, length / s^2.

    Returns:
        Seconds until it is above the other fingertip's end; infinite where it never is.

    Raises:
        ValueError: a circle that rolls.
    """
    mu = reading.friction
    if mu and reading.turning:
        raise ValueError("a circle that rolls gives its fall to its spin, too")
    theta, r = math.radians(angle), RADIUS
    s, c = math.sin(theta), math.cos(theta)
    # Where the circle touches lid and fingertip, it is so far from their joint along each.
    from_joint = r * (1 - s) / c
    along_lid, along_tip = 0.5 * (1 - gap_width) * UNIT - r - from_joint, TIP - from_joint
    on_lid = x - mu * y
    on_tip = x * s - y * c - mu * (x * c + y * s)
    with np.errstate(invalid="ignore", divide="ignore"):
        speed = np.sqrt(2 * on_lid * along_lid)
        caught = np.maximum(speed * (s - mu * c), 0.0)
        left = np.sqrt(caught**2 + 2 * on_tip * along_tip)
        # From beside the end of the fingertip to above that of the other.
        across = gap_width * UNIT - 2 * TIP * s + r * c
        flight = (np.sqrt((left * s) ** 2 + 2 * x * across) - left * s) / x
        height = -r * s - left * c * flight + 0.5 * y * flight**2
        seconds = speed / on_lid + 2 * along_tip / (caught + left) + flight
    out = (x > 0) & (y > 0) & (on_lid > 0) & (left > 0) & (height > 0)
    return np.where(out, seconds, np.inf)


def path(
    scenario: Scenario, place: tuple[float, float], phi: float, seconds: float, dt: float = 0.01
) -> tuple[Float[np.ndarray, "steps 2"], bool]:
    """Where an object goes that is let go at a place, under a tilt that stays.

    Arguments:
        scenario: of a wrist.
        place: of the centre, where it is at rest.
        phi: the direction of gravity in the hand's plane, from the palm's to the right towards the
            gap's, degrees; about as strong as the wrist allows.
        seconds: how long.
        dt: between the places, s.

    Returns:
        The centre after each step until it is out or the time is over; whether it is out.
    """
    drive = scenario.drive
    assert isinstance(drive, WristTilt)
    x, y = math.cos(math.radians(phi)), math.sin(math.radians(phi))
    amplitude = float(drive.amplitude)
    # sin T1 = k x and cos T1 sin T2 = -k y, with neither beyond the amplitude.
    k = STRENGTH * math.sin(amplitude) / max(abs(x), abs(y))
    first = math.asin(k * x)
    second = -math.asin(k * y / math.cos(first))
    draws = jnp.array([0.5 + 0.5 * tilt / amplitude for tilt in (first, second)])
    profile = drive.profile(draws, draws, first=False)
    state, places, passed = at_rest(Vec(*map(jnp.asarray, place))), [], []
    steps = round(seconds / dt)
    for _ in range(-(-steps // _CHUNK)):
        states = jax.device_get(_chunk(scenario, profile, state, dt))
        state = jax.tree.map(lambda leaf: leaf[-1], states)
        places.append(np.stack([states.position.x, states.position.y], axis=-1))
        passed.append(states.status == PASSED)
    out = np.flatnonzero(np.concatenate(passed)[:steps])
    last = int(out[0]) + 1 if len(out) else steps
    return np.concatenate(places)[:last].astype(float), len(out) > 0


STRENGTH = 0.85
"""Share of the amplitude's sine that the larger component of gravity has in a path."""

_CHUNK = 100
"""Steps of a path that are compiled as one, whatever its length."""


@jax.jit
def _chunk(scenario: Scenario, profile: Any, state: State, dt: float) -> State:
    def one(state: State, _: None) -> tuple[State, State]:
        state = step(scenario, profile, state, dt)
        return state, state

    return jax.lax.scan(one, state, length=_CHUNK)[1]


# --------------------------------------------------------------------------------------- pictures


def picked(rows: Sequence[Row], reading: str, gap_width: float, place: str) -> list[Row]:
    """The rows of a curve."""
    wanted = reading, f"{gap_width:g}", place
    return [r for r in rows if (r["reading"], r["gap_width"], r["place"]) == wanted]


def index1_of(rows: Sequence[Row], gap_width: float, reading: str, *ways: str) -> np.ndarray:
    """Index 1 by angle, were escapes as likely in every period after the first as they are on
    average, on some ways alone: a geometric law, cut at the limit."""
    every, first = (picked(rows, reading, gap_width, place) for place in ("all", "start"))
    later, begin = (sum(numbers(part, f"{way}_rate")[0] for way in ways) for part in (every, first))
    phase, limit = numbers(every, "escape_phase", "max_steps")
    length = round(paper.WRIST_PERIOD / paper.DT)
    # Those that escape in a period are still there for this share of it.
    lasts = 1 - later * (1 - phase)
    left = (1 - begin) * (1 - (1 - later) ** (limit / length - 1)) / later
    return length * (1 - begin * (1 - phase) + left * lasts)


def draw(rows: Sequence[Row]) -> Figure:
    """A column for each gap: index 1, escapes by way, those from the lid's corner, places."""
    figure = Figure(figsize=(12, 17), layout="constrained")
    panels = figure.subplots(4, 2, sharex=True, sharey="row")
    for k, (gap_width, stated) in enumerate(zip(GAP_WIDTHS, PEAKS, strict=True)):
        top, ways, corner, rest = panels[:, k]
        top.set_title(f"$W_g$ = {gap_width:g} $L_p$")
        top.axvline(stated, color="0.4", ls=":", lw=1.5)
        for reading, colour in COLOURS.items():
            every = picked(rows, reading, gap_width, "all")
            if not every:
                continue
            angle, value, se = numbers(every, "angle_deg", "index1", "index1_se")
            band(top, angle, value / 1e3, 1.96 * se / 1e3, colour, "-", reading)
            top.plot(
                angle,
                index1_of(rows, gap_width, reading, "round", "straight") / 1e3,
                "x",
                ms=5,
                color=colour,
            )
            for way, style in (("round", "-"), ("straight", "--")):
                share, low, high = numbers(every, f"{way}_rate", f"{way}_low", f"{way}_high")
                ways.plot(angle, share, style, color=colour)
                ways.fill_between(angle, low, high, color=colour, alpha=0.2, lw=0)
            mine = picked(rows, reading, gap_width, "lid corner")
            share, low, high = numbers(mine, "round_rate", "round_low", "round_high")
            reach = np.maximum([share - low, high - share], 0)
            corner.errorbar(angle, share, reach, fmt="o", ms=4, color=colour, capsize=2)
            corner.plot(angle, numbers(mine, "way_round")[0], "-", color=colour)
            for place, style in (("wedge", "-"), ("lid corner", "--")):
                share, se = numbers(picked(rows, reading, gap_width, place), "share", "share_se")
                band(rest, angle, share, 1.96 * se, colour, style)
        shift_arrow(corner, rows, gap_width)
        rest.set_xlabel(r"$\theta_g$ [deg]")
    for axis in panels.ravel():
        axis.grid(alpha=0.3)
        axis.set_ylim(0, None)
    top, ways, corner, rest = panels[:, 0]
    top.set_ylabel("index 1 [thousand steps]")
    ways.set_ylabel("escapes per period")
    corner.set_ylabel("escapes round a fingertip per period\nbegun at rest in the lid's corner")
    rest.set_ylabel("share of periods begun there")
    top.plot([], [], "kx", label="from the mean escapes per period")
    top.plot([], [], color="0.4", ls=":", label="the paper's peak")
    ways.plot([], [], "k-", label="round a fingertip")
    ways.plot([], [], "k--", label="straight")
    corner.plot([], [], "ko", ms=4, label="measured")
    corner.plot([], [], "k-", label="statics and a parabola")
    rest.plot([], [], "k-", label="at rest behind a fingertip")
    rest.plot([], [], "k--", label="at rest in the lid's corner")
    for axis in panels[:, 0]:
        axis.legend(fontsize=9, loc="upper left" if axis is corner else "best")
    trials = {row["reading"]: f"{int(row['trials']):,}" for row in rows}
    fewer = [
        f", {trials[name]} for {name}" for name in READINGS if name in FEWER and name in trials
    ]
    figure.suptitle(
        f"{trials[rows[0]['reading']]} trials{''.join(fewer)}; limit "
        f"{int(rows[0]['max_steps']):,} steps; bands and bars are 95 % intervals"
    )
    return figure


def band(
    axis: Axes, x: Any, value: Any, reach: Any, colour: str, style: str, label: str | None = None
) -> None:
    """A curve with its 95 % band."""
    axis.plot(x, value, style, color=colour, label=label)
    axis.fill_between(x, value - reach, value + reach, color=colour, alpha=0.2, lw=0)


def shift_arrow(axis: Axes, rows: Sequence[Row], gap_width: float) -> None:
    """An arrow as long as atan(mu), between what statics says without friction and with it."""
    height, ends = 0.012, []
    for reading in (FALLING, RUBBING):
        angle, share = numbers(
            picked(rows, reading.name, gap_width, "lid corner"), "angle_deg", "way_round"
        )
        if len(angle) == 0:
            return
        ends.append(float(np.interp(height, share, angle)))
    shift = math.degrees(math.atan(RUBBING.friction))
    axis.annotate("", (ends[0] + shift, height), (ends[0], height), arrowprops={"arrowstyle": "->"})
    label = f"atan {RUBBING.friction:g} = {shift:.0f}°"
    axis.text(ends[0] + shift + 4.0, 0.3 * height, label, fontsize=9)


def draw_paths() -> Figure:
    """Objects that start at rest in the lid's corner, without friction and with it."""
    figure = Figure(figsize=(11, 6.1), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    cases = ((FALLING, 40.0), (RUBBING, 40.0), (FALLING, 60.0), (RUBBING, 60.0))
    for axis, (reading, angle) in zip(panels.ravel(), cases, strict=True):
        made = scenario(reading, GAP_WIDTHS[0], angle)
        draw_limbs(axis, points_of(made.hand), 0.0)
        goal = made.hand.goal()
        axis.plot([goal.a.x, goal.b.x], [goal.a.y, goal.b.y], "--", color="#009e73")
        place = RADIUS - 0.5 * UNIT, UNIT - RADIUS
        for phi, colour in ((30, "#0072b2"), (45, "#d55e00"), (60, "#009e73")):
            places, out = path(made, place, phi, 9.5)
            x, y = places.T
            fate = "out" if out else "stays in"
            axis.plot(x, y, color=colour, label=f"gravity at {phi}°: {fate}")
            axis.plot(x[-1], y[-1], "o", ms=5, color=colour)
        axis.set(aspect="equal", xlim=(-260, 260), ylim=(280, 530))
        axis.set_title(rf"{reading.name}, $\theta_g$ = {angle:g}°", fontsize=11)
        axis.legend(fontsize=9, loc="lower left")
        axis.label_outer()
    for axis in panels[:, 0]:
        axis.set_ylabel("y [model length]")
    for axis in panels[1]:
        axis.set_xlabel("x [model length]")
    return figure


# ------------------------------------------------------------------------------------------- run


def main() -> None:
    """Runs what is not there yet, and draws."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add(
        "--trials",
        type=int,
        default=paper.TRIALS,
        help="for each condition; a fifth of them for a circle that rolls, half for other pucks",
    )
    add("--max-steps", type=int, default=paper.WRIST_MAX_STEPS, help="limit")
    add("--seed", type=int, default=1)
    add("--out", type=Path, default=RESULTS / "mechanism.csv")
    args = parser.parse_args()
    settings = {"trials": args.trials, "max_steps": args.max_steps, "seed": args.seed}
    rows = kept(args.out)
    wanted = {
        name: settings | {"trials": max(args.trials // FEWER.get(name, 1), 2)}
        for name in (*READINGS, *FURTHER)
    }
    if any(int(row[k]) != value for row in rows for k, value in wanted[row["reading"]].items()):
        parser.error(f"{args.out} was made with other settings: use those, or another --out")
    for reading, gap_width in product((*READINGS.values(), *FURTHER.values()), GAP_WIDTHS):
        if picked(rows, reading.name, gap_width, "all"):
            continue
        rows += group(reading, gap_width, **wanted[reading.name])
        save(rows, args.out)
        rows = kept(args.out)
        made = picked(rows, reading.name, gap_width, "all")[0]
        print(
            f"{reading.name}, W_g = {gap_width:g} L_p: index 1 peaks at {made['peak_deg']} deg, "
            f"fewest escapes per period at {made['fewest_deg']} deg; {made['cpu_s']} CPU seconds, "
            f"{made['trials_used']} of {made['trials']} trials right",
            flush=True,
        )
    draw(rows).savefig(args.out.with_suffix(".png"), dpi=90)
    draw_paths().savefig(args.out.with_name(args.out.stem + "_paths.png"), dpi=90)


if __name__ == "__main__":
    main()
