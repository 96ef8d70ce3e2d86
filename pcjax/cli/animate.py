"""`pcjax animate`: a film of one trial."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import (
    add_dt,
    add_experiment,
    add_outputs,
    check_writable,
    number,
    settle_outputs,
    whole,
)
from pcjax.model.scenario import DIRECTIONS
from pcjax.physics.state import INVALID, PASSED
from pcjax.results.schema import NAMES
from pcjax.simulate.replay import PICKED_FROM, PICKS


def add_animate(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add = parser.add_argument
    add("--direction", choices=tuple(DIRECTIONS), default="does", help="what to film")
    add(
        "--trial",
        type=whole,
        default=None,
        metavar="N",
        help="which trial, from 0; the one that evaluate runs with this seed",
    )
    add(
        "--pick",
        choices=tuple(PICKS),
        default=None,
        help=f"without --trial, of the first {PICKED_FROM}: "
        + ", ".join(f"{name}: {what}" for name, what in PICKS.items())
        + " (default: escaped)",
    )
    add_experiment(parser)
    add_dt(parser, "as large as accuracy allows")
    add("--seconds", type=number, default=40.0, help="how much of the trial, up to its end")
    add("--speed", type=number, default=4.0, help="seconds of the trial in one of the film")
    add("--fps", type=whole, default=20, help="pictures in a second of the film")
    add_outputs(
        parser,
        plot="the film: .gif, .html, or .mp4 where there is ffmpeg",
        plot_default=Path("escape.gif"),
        before={"out": "plot"},
    )
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    from pcjax.view.animation import animate, check_film  # matplotlib takes a second to import

    settle_outputs(arguments)
    check_writable(arguments.plot)
    check_film(arguments.plot)
    if arguments.trial is not None and arguments.pick is not None:
        raise ValueError("--pick does not go with --trial: that one is picked already")
    study = condition(arguments)
    name = NAMES[arguments.direction]
    scenario = study.scenarios()[arguments.direction]
    pick = arguments.pick or "escaped"
    recording = animate(
        scenario,
        arguments.plot,
        trial=arguments.trial,
        pick=pick,
        seed=study.run.seed,
        max_steps=study.max_steps,
        dt=study.run.dt,
        seconds=arguments.seconds,
        speed=arguments.speed,
        fps=arguments.fps,
        title=name,
        units=study.units,
        progress=True,
    )
    step = f"step {recording.escape_step:,} ({recording.seconds:.3f} s)"
    endings = {PASSED: f"escaped in {step}", INVALID: f"went wrong in {step}"}
    ending = endings.get(recording.status, f"still inside at the limit, {step}")
    why = "" if arguments.trial is not None else f" ({PICKS[pick]} of {PICKED_FROM})"
    print(
        f"{name}, trial {recording.trial} of seed {recording.seed}{why}: {ending}; "
        f"dt = {recording.dt:.3g} s; film: {arguments.plot}"
    )
