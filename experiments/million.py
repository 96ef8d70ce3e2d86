"""A million trials of ten odd conditions in both precisions: nothing goes wrong, nobody is outside.

A trial goes wrong (status INVALID) where a number stops being finite, a contact was missed, a
period took too many leaps, or an object that counts as held is not in the hand at the limit.
Keeps `results/million.csv`; `--trials 1000` makes a cheap version.
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

import numpy as np

from experiments.fuzz import farthest_stray
from pcjax.model.bodies.circle import Circle
from pcjax.model.checking import check_geometry
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.presets import box_hand
from pcjax.model.scenario import Scenario, does, eoen
from pcjax.physics.state import INVALID, PASSED
from pcjax.simulate.batch import run
from pcjax.simulate.choose import choose_engine

RESULTS = Path(__file__).parent / "results"


def conditions() -> dict[str, Scenario]:
    """Hands and laws at the edges of what is accepted."""

    def hand(one: list[tuple[float, float]], two: list[tuple[float, float]] | None = None):
        fingers = [one, one if two is None else two]
        lengths = [tuple(length for length, _ in finger) for finger in fingers]
        angles = [tuple(math.radians(angle) for _, angle in finger) for finger in fingers]
        return HandDesign(500.0, (lengths[0], lengths[1]), (angles[0], angles[1]))

    def bounces(restitution: float) -> ContactLaw:
        return ContactLaw(restitution=restitution)

    leaning = hand([(450.0, 103.0)], [(450.0, 108.0)])
    bent = [(200.0, 90.0), (100.0, 1e-3), (100.0, -2e-3), (140.0, 95.0)]
    curled = [(300.0, 80.0), (120.0, 40.0), (90.0, 30.0), (60.0, 25.0), (40.0, 30.0)]
    barb = [(300.0, 90.0), (160.0, 80.0), (80.0, 150.0)]
    lopsided = hand([(300.0, 95.0), (190.0, 70.0)], [(240.0, 70.0), (150.0, 100.0)])
    return {
        "two leaning limbs, e = .64": does(leaning, Circle(60.0), law=bounces(0.64)),
        "two leaning limbs, e = 1, g = 1000": does(
            leaning, Circle(60.0), WristTilt(gravity=1000.0), bounces(1.0)
        ),
        "limbs in line, e = 1": does(hand(bent), Circle(25.0), law=bounces(1.0)),
        "a gap 0.3 % wider than the object": does(
            hand([(300.0, 90.0), (150.0, 60.0)]), Circle(119.7), law=bounces(0.5)
        ),
        "open scoop": does(hand([(300.0, 50.0)]), Circle(25.0), law=bounces(0.9)),
        "lopsided, from outside": eoen(lopsided, Circle(20.0), law=bounces(0.3)),
        "curled, five limbs a finger": does(hand(curled), Circle(15.0)),
        "barbs with acute corners": does(hand(barb), Circle(12.0), law=bounces(0.8)),
        "an object 1/1000 of the palm": does(box_hand(), Circle(0.5)),
        "an object that all but fills the hand": does(
            hand([(420.0, 90.0), (60.0, 60.0)]), Circle(180.0), law=bounces(0.2)
        ),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=100_000, help="of each condition")
    parser.add_argument("--max-steps", type=int, default=60_000)
    arguments = parser.parse_args()
    rows = []
    for name, scenario in conditions().items():
        check_geometry(scenario)
        engine = choose_engine("auto", None, scenario)
        for bits in (64, 32):
            out = run(
                [scenario],
                trials=arguments.trials,
                max_steps=arguments.max_steps,
                engine=engine,
                precision=bits,
                keep_final=True,
            )
            rows.append(
                {
                    "condition": name,
                    "engine": engine.name,
                    "bits": bits,
                    "trials": arguments.trials,
                    "passed_percent": f"{100 * float(np.mean(out.status == PASSED)):.2f}",
                    "invalid": int(np.sum(out.status == INVALID)),
                    "stray_in_radii": f"{farthest_stray(scenario, out, 0):.1e}",
                }
            )
            print(*rows[-1].values(), sep=", ", flush=True)
    with (RESULTS / "million.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
