"""Where an optimisation is, and the file that keeps it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pcjax.results.files import digest, read_plain
from pcjax.results.saving import save_text


@dataclass
class Step:
    """One iteration of one start: where it was and what it saw; with `exact`, a checkpoint."""

    design: list[float]
    value: float
    value_se: float
    gradient: list[float]
    gradient_se: list[float]
    exact: float | None = None
    exact_se: float | None = None


@dataclass
class Progress:
    """Where an optimisation is, as the checkpoint file keeps it.

    Attributes:
        history: the steps of each start.
        designs: where each start is now.
        state: what the method has to know beside: optax's numbers for each start, or the batches
            that a model has seen.
        trials, seconds: spent so far.
        invalid: trials that went wrong, and were left out.
        stopped: which starts have come to rest.
    """

    history: list[list[Step]]
    designs: list[list[float]]
    state: list[Any]
    trials: int = 0
    seconds: float = 0.0
    invalid: int = 0
    stopped: list[bool] = field(default_factory=list)

    @property
    def iteration(self) -> int:
        """Iterations done."""
        return max((len(steps) for steps in self.history), default=0)


def keep_progress(path: Path, fingerprint: str, state: Progress) -> None:
    """Writes a state to a file.

    Arguments:
        path: of the file.
        fingerprint: all that the optimisation depends on, as text.
        state: what to keep.
    """
    kept = asdict(state)
    kept = {"of": fingerprint, "state": kept, "sha256": _seal(kept, fingerprint)}
    save_text(json.dumps(kept, indent=1) + "\n", path)


def _seal(state: Any, fingerprint: str) -> str:
    return digest(json.dumps(state).encode(), fingerprint)


def fingerprint_of(*parts: Any) -> str:
    """Everything that an optimisation depends on, as text."""
    return "\n".join(map(repr, parts))


def load_progress(path: Path, fingerprint: str, possible: Callable[[Progress], bool]) -> Progress:
    """The state that a file keeps.

    Arguments:
        path: of the file.
        fingerprint: of the optimisation that goes on from it.
        possible: whether this optimisation can come to a state.

    Raises:
        ValueError: it cannot be read, is damaged, or is another optimisation's.
    """
    damaged = ValueError(
        f"{path} is no checkpoint of an optimisation, or it is damaged: name another file, or "
        "remove it to begin anew"
    )
    content = read_plain(path)
    try:
        kept = json.loads(content)
        of, state, seal = (kept[name] for name in ("of", "state", "sha256"))
        if seal != _seal(state, of):
            raise damaged
        history = [[Step(**step) for step in steps] for steps in state.pop("history")]
        found = Progress(history, **state)
        fits = of != fingerprint or (_counts(found) and possible(found))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise damaged from None
    if of != fingerprint:
        raise ValueError(
            f"{path} was kept by an optimisation with other settings: name another file, or "
            "remove it to begin anew"
        )
    if not fits:
        raise damaged
    return found


def _counts(found: Progress) -> bool:
    """Whether what is counted can have been."""
    counts = found.trials, found.invalid
    return all(type(n) is int and n >= 0 for n in counts) and 0 <= found.seconds < math.inf
