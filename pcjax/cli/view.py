"""`pcjax view`: the hand in the browser, to be dragged."""

from __future__ import annotations

import argparse
from pathlib import Path

from pcjax.cli.condition import add_condition, condition
from pcjax.cli.parts import add_direction, add_experiment, whole


def add_view(parser: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    add_condition(parser)
    add_direction(parser, "both for a hand that has both")
    add_experiment(parser)
    add = parser.add_argument
    add("--port", type=whole, help="on 127.0.0.1 (default: 8420, or the next free one)")
    add("--no-browser", action="store_true", help="only serve the page, do not open it")
    parser.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> None:
    if arguments.port is not None and not 1 <= arguments.port <= 65535:
        raise ValueError(f"--port is {arguments.port}: it has to lie between 1 and 65535")
    from pcjax.view.web.serve import check_web, serve

    check_web()
    study, folder = condition(arguments), Path.cwd()
    given = (arguments.study or folder).resolve()
    serve(
        study,
        name=str(given.relative_to(folder)) if given.parent.is_relative_to(folder) else "",
        folder=folder,
        port=arguments.port,
        browser=not arguments.no_browser,
    )
