"""Redoes figures of the paper and keeps data and picture in `experiments/results`."""

from __future__ import annotations

import sys
from pathlib import Path

from pcjax.cli import main

RESULTS = Path(__file__).parent / "results"


def redo(*figures: str) -> None:
    """Runs `pcjax figure` at the paper's settings; flags on the command line change them.

    `--trials 500 --max-steps 100000` makes a cheap version; see `pcjax figure --help`.
    """
    for name in figures:
        out = ["--out", str(RESULTS / f"fig{name}.nc"), "--plot", str(RESULTS / f"fig{name}.png")]
        main(["figure", name, *out, *sys.argv[1:]])
