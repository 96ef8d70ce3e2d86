"""Hands of the plane in three dimensions: MuJoCo against the event engine, trial by trial.

A limb of the paper's box hand is a capsule that lies on a floor, and the circle a ball on it; the
tilt presses the ball on the floor in every trial, so that it moves in the plane. Both engines have
the same starts and tilt targets, so the difference of index 1 is known better than either. The
limbs are 10 thick here and there: what is thinner than a step is far may be jumped.

    python -m experiments.plane3d            # five minutes on 2 cores
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

import pcjax
from pcjax import spatial
from pcjax.model.scenario import DIRECTIONS, Scenario
from pcjax.physics.state import INVALID, PAPER_DT
from pcjax.simulate.backends.mujoco import MuJoCo
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine

HANDS = ((0.0, 0.8, 25.0), (30.0, 0.6, 25.0), (10.0, 0.4, 10.0))
"""Fingertip angle [deg], W_g / L_p, radius."""

THICKNESS = 10.0

LIMITS = (100.0, 300.0)
"""Where index 1 is censored, s."""

OUT = Path(__file__).parent / "results" / "plane3d.csv"


class PalmEnds(spatial.StartBox):
    """Starts near the palm's ends, as in the plane."""

    flat: Scenario | None = None

    def places(self, draws: Float[np.ndarray, "trials draws"]) -> Float[np.ndarray, "trials 7"]:
        """See `StartBox`."""
        assert self.flat is not None
        there = jax.vmap(self.flat.start)(jnp.asarray(draws))
        ones, zeros = np.ones(len(draws)), np.zeros(len(draws))
        columns = [np.asarray(there.x), np.asarray(there.y), zeros, ones, zeros, zeros, zeros]
        return np.stack(columns, axis=1).astype(float)


class OtherWay(spatial.Tilt):
    """A tilt whose T2 has the other sign, as the mirror image of gravity has: in the plane the
    wrist's draws are taken for that image's, which has the same law."""

    def angles(
        self,
        before: Float[np.ndarray, "trials 2"],
        draws: Float[np.ndarray, "trials 2"],
        time: float,
        first: bool,
    ) -> Float[np.ndarray, "trials 2"]:
        """See `SpatialTilt`."""
        return super().angles(before, draws, time, first) * [1.0, -1.0]


@dataclass(frozen=True)
class Flat:
    """A condition of the plane, and the same in three dimensions."""

    plane: Scenario
    space: spatial.Scenario


def flat(
    hand: pcjax.HandDesign, radius: float, direction: str, folder: Path, drive: Any = None
) -> Flat:
    """A hand whose limbs have a thickness, with a circle, in both."""
    drive = pcjax.WristTilt() if drive is None else drive
    plane = DIRECTIONS[direction](hand, pcjax.Circle(radius), drive)
    half, names = 0.5 * float(hand.thickness), []
    geoms = [f'<geom name="floor" type="box" size="2000 2000 50" pos="0 0 {-radius - 50}"/>']
    tips = (len(hand.lengths[0]), len(hand.lengths[0]) + len(hand.lengths[1]))
    for k, limb in enumerate(hand.limbs()):
        ends = [float(x) for end in (limb.start, limb.end) for x in (end.x, end.y, 0.0)]
        names.append(f"tip{k}" if k in tips else f"limb{k}")
        places = " ".join(map(repr, ends))
        geoms.append(f'<geom name="{names[-1]}" type="capsule" size="{half}" fromto="{places}"/>')
    path = folder / "flat.xml"
    path.write_text(f"<mujoco><worldbody>{''.join(geoms)}</worldbody></mujoco>")
    a, b = (hand.finger(i)[-1].start for i in (0, 1))
    normal = (-float(b.y - a.y), float(b.x - a.x), 0.0)
    held = spatial.Hand(
        path,
        PalmEnds((0.0, 0.5 * float(hand.palm_length), 0.0), (0.0,) * 3, flat=plane),
        fingertips=[name for name in names if name.startswith("tip")],
        escape=spatial.PlaneEscape((float(a.x), float(a.y), 0.0), normal),
    )
    kind = OtherWay if direction == "eoen" else spatial.Tilt
    tilt = kind(
        amplitude=drive.amplitude,
        rest=(0.0, 0.0, -1.0),
        gravity=drive.gravity,
        ramp_time=drive.ramp_time,
        period=drive.period,
    )
    law = pcjax.ContactLaw(restitution=0.1)
    space = spatial.Scenario(held, spatial.Sphere(radius), tilt, law, direction == "eoen")
    return Flat(plane, space)


def compared(
    both: Flat, trials: int, limit: float, dt: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, int]:
    """Seconds until each trial ended, in the plane and in three dimensions, of those that went
    right in both; and how many did not."""
    outcomes = [
        run([scenario], trials=trials, max_steps=round(limit / PAPER_DT), seed=seed, engine=engine)
        for scenario, engine in (
            (both.plane, choose_engine("event", None, both.plane)),
            (both.space, MuJoCo(dt)),
        )
    ]
    good = np.logical_and(*(one.status[0] != INVALID for one in outcomes))
    plane, space = (one.steps[0][good] * PAPER_DT for one in outcomes)
    return plane, space, int((~good).sum())


def row(plane: np.ndarray, space: np.ndarray, limit: float) -> dict[str, float]:
    """Index 1 of both at a limit, and their difference as a share."""
    one, other = np.minimum(plane, limit), np.minimum(space, limit)
    later = other - one
    return {
        "limit": limit,
        "trials": len(one),
        "plane": round(float(one.mean()), 3),
        "mujoco": round(float(other.mean()), 3),
        "difference_percent": round(100 * float(later.mean() / one.mean()), 3),
        "se_percent": round(100 * float(later.std(ddof=1) / math.sqrt(len(later)) / one.mean()), 3),
        "correlation": round(float(np.corrcoef(one, other)[0, 1]), 4),
        "same_end": round(float(np.mean(np.abs(later) < 0.1)), 3),
    }


def main() -> None:
    """Runs all hands in both directions, and writes the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--trials", type=int, default=800)
    parser.add_argument("--dt", type=float, default=0.008)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for theta, gap, radius in HANDS:
            hand = pcjax.box_hand(math.radians(theta), gap_width=500 * gap, thickness=THICKNESS)
            for direction in DIRECTIONS:
                began = time.process_time()
                both = flat(hand, radius, direction, Path(folder))
                plane, space, wrong = compared(both, options.trials, max(LIMITS), options.dt)
                for limit in LIMITS:
                    rows.append(
                        {"theta": theta, "W_g": gap, "radius": radius, "direction": direction}
                        | row(plane, space, limit)
                        | {"invalid": wrong, "cpu_s": round(time.process_time() - began)}
                    )
                    print(rows[-1], flush=True)
    with options.out.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
