"""A study: a hand, what it has to hold, how it is tried, and what is swept; as a file, TOML."""

from pcjax.study.read import load_study
from pcjax.study.spec import Run, Study, Sweep

__all__ = ["Run", "Study", "Sweep", "load_study"]
