"""Where the parts of a sweep are kept as they are done."""

from __future__ import annotations

import io
import json
import os
import shutil
from pathlib import Path

import numpy as np

from pcjax.physics.state import INVALID
from pcjax.results.files import read_plain, sealed, unsealed
from pcjax.results.saving import replacing, save_text
from pcjax.simulate.outcomes import STATUS_NAMES, Outcomes
from pcjax.sweep.plan import Part


class Store:
    """The folder beside a result file in which parts are kept until all are done."""

    def __init__(self, out: Path, recipe: str):
        """
        Arguments:
            out: the result file.
            recipe: everything that the result depends on, as text.

        Raises:
            ValueError: the folder belongs to another sweep.
            OSError: it cannot be made.
        """
        self.recipe = recipe
        self.folder = out.with_name(out.name + ".parts")
        self.folder.mkdir(exist_ok=True)
        of = self.folder / "study.txt"
        if not of.exists():
            save_text(recipe, of)
        elif read_plain(of) != recipe.encode():
            raise ValueError(
                f"{self.folder} holds parts of another sweep (another study, other settings or "
                "another version), or its study.txt is damaged: name another file, or remove the "
                "folder to begin anew, or study.txt alone to keep the parts that are this sweep's"
            )

    def _path(self, part: Part) -> Path:
        return self.folder / f"{part.name}.npz"

    def _identity(self, part: Part) -> str:
        """What a part is sealed with: no other part's, of whatever sweep, is taken for it."""
        return json.dumps([self.recipe, part.name, part.cells, part.first, part.trials])

    def read(self, part: Part) -> Outcomes | None:
        """A part's outcomes, if they are here.

        Raises:
            ValueError: there is something else in their place.
        """
        path = self._path(part)
        if not os.path.lexists(path):
            return None
        content = unsealed(read_plain(path), self._identity(part))
        if content is None:
            raise ValueError(f"{path} is damaged, or no part of this sweep")
        with np.load(io.BytesIO(content)) as kept:
            steps, status, watch = (kept[name] for name in ("steps", "status", "watch"))
        outcomes = Outcomes(steps, status, part.max_steps, watch if watch.size else None)
        if not _can_be(outcomes, part):
            raise ValueError(f"{path} holds what no trial can end as")
        return outcomes

    def keep(self, part: Part, outcomes: Outcomes) -> None:
        """Writes a part's outcomes, whole or not at all.

        Raises:
            OSError: they cannot be written; what was kept before is still there.
        """
        watch = np.zeros(0, np.float32) if outcomes.watch is None else outcomes.watch
        with (
            replacing(self._path(part)) as unfinished,
            unfinished.open("wb") as file,
            io.BytesIO() as content,
        ):
            np.savez_compressed(content, steps=outcomes.steps, status=outcomes.status, watch=watch)
            file.write(sealed(content.getvalue(), self._identity(part)))
            file.flush()
            os.fsync(file.fileno())

    def remove(self) -> None:
        """Removes the folder."""
        shutil.rmtree(self.folder)


def _can_be(outcomes: Outcomes, part: Part) -> bool:
    """Whether a part can give these outcomes."""
    shape = len(part.cells), part.trials
    steps, status, watch = outcomes.steps, outcomes.status, outcomes.watch
    kinds = (steps.shape, steps.dtype, status.shape, status.dtype)
    if kinds != (shape, np.int32, shape, np.uint8):
        return False
    if part.scenarios[0].body.oriented != (watch is not None):
        return False
    if watch is not None and (watch.shape, watch.dtype) != ((*shape, 3), np.float32):
        return False
    return bool(
        np.isin(status, list(STATUS_NAMES)).all()
        and (steps >= 1).all()
        and (steps <= part.max_steps).all()
        # What went wrong may have been no number.
        and (watch is None or np.isfinite(watch[status != INVALID]).all())
    )
