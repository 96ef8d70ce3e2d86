"""Results as labelled data: printed, kept in netCDF with units and provenance, and read back."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pcjax.importing import xr
from pcjax.model.hand import full_cage
from pcjax.model.scenario import Scenario
from pcjax.physics.state import INVALID
from pcjax.quality.indices import Estimate, mean, ratio_difference, survival_curve
from pcjax.quality.stopping import precision_of
from pcjax.results.estimates import as_plain, counts_of, indices_of, rows_of, score_of
from pcjax.results.provenance import conditions, provenance
from pcjax.results.reading import load_dataset
from pcjax.results.saving import save_dataset
from pcjax.results.schema import EVALUATIONS, INDICES, NAMES, WATCHED, dataset_of, length_unit_of
from pcjax.results.tables import (
    engines_text,
    estimate_text,
    in_columns,
    interval_text,
    stick_text,
    wrapped,
)
from pcjax.showing import Shown
from pcjax.simulate.outcomes import LIMIT, STATUS_NAMES, Outcomes


class Evaluation(Shown):
    """How hard a hand is to escape (DoEs), how easy to enter (EoEn), and the score.

    Prints as a table, and shows in notebooks with its picture. `dataset` holds everything: the
    escape step and status of every trial, the limbs and goal lines, and in its attributes how it
    was made.

    Examples:
        >>> import pcjax
        >>> result = pcjax.evaluate(pcjax.box_hand(0.17), trials=64, max_steps=20_000)
        >>> result.directions
        ['does', 'eoen']
        >>> sum(result.status("does").values())
        64
        >>> result.to_xarray().index1.dims
        ('direction', 'statistic')
    """

    drawn_by = "view.plots.plot_evaluation"

    def __init__(self, dataset: xr.Dataset):
        self.attrs: dict[str, Any] = dict(dataset.attrs)
        self.directions = [str(d) for d in dataset.direction.values]
        self._arrays = {str(name): one.values for name, one in dataset.data_vars.items()}
        self._dataset: Callable[[], xr.Dataset] = lambda: dataset

    def __reduce__(self) -> tuple[type[Evaluation], tuple[xr.Dataset]]:
        return Evaluation, (self.dataset,)

    @functools.cached_property
    def dataset(self) -> xr.Dataset:
        """Everything, labelled; made when it is asked for, since a table needs none."""
        return self._dataset()

    @classmethod
    def from_outcomes(
        cls, scenarios: Mapping[str, Scenario], outcomes: Outcomes, run: Mapping[str, Any]
    ) -> Evaluation:
        """The evaluation of one hand from the outcomes in each direction."""
        each = [scenario.places() for scenario in scenarios.values()]
        places = {name: np.stack([one[name] for one in each]) for name in each[0]}
        rounding = places.pop("rounding", None)
        values = {"escape_step": outcomes.steps, "status": outcomes.status, **places}
        if outcomes.watch is not None:
            values |= dict(zip(WATCHED, np.moveaxis(outcomes.watch, -1, 0), strict=True))
        attrs = (
            provenance(run)
            | {
                "trials": outcomes.steps.shape[1],
                "max_steps": outcomes.max_steps,
            }
            | next(iter(scenarios.values())).sizes()
            | conditions(scenarios)
        )

        def dataset() -> xr.Dataset:
            kind = "spatial" if rounding is None else "evaluation"
            made = dataset_of(kind, values, {"direction": list(scenarios)}, attrs)
            if rounding is not None:
                made.outline.attrs["rounding"] = float(rounding[0])
            return made

        new = cls.__new__(cls)
        new.attrs, new.directions, new._arrays = attrs, list(scenarios), values
        new._dataset = dataset
        return new

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Evaluation:
        """Reads what `save` has written.

        Raises:
            ValueError: there is no such file, it is damaged, or no evaluation.
        """
        data = load_dataset(path)
        if data.attrs["kind"] not in EVALUATIONS:
            raise ValueError(f"{path} is a result of pcjax, but no evaluation of one hand")
        return cls(data)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes everything to a netCDF file.

        Raises:
            OSError: the file cannot be written.
        """
        return save_dataset(self.dataset, path)

    def to_xarray(self) -> xr.Dataset:
        """The data with the estimates beside it: `index1`, `index2` (direction, statistic), `count`
        (direction, status_name) and, if both directions were evaluated, `score` (index,
        statistic)."""
        indices = [self.indices(d) for d in self.directions]
        both = len(self.directions) == 2
        estimates = dataset_of(
            self.dataset.attrs["kind"],
            {
                **{name: rows_of(each[name] for each in indices) for name in INDICES},
                "score": rows_of(self.score().values()) if both else None,
                "count": counts_of(self.dataset.status.values),
            },
            {"direction": self.directions},
            {"length_unit": length_unit_of(self.dataset)},
        )
        return self.dataset.assign_coords(estimates.coords).assign(estimates.data_vars)

    @property
    def max_steps(self) -> int:
        """The step limit."""
        return int(self.attrs["max_steps"])

    @property
    def trials(self) -> int:
        """Trials per direction."""
        return self._arrays["status"].shape[1]

    def gap(self, direction: str) -> float:
        """The narrowest passage between the fingers, a length; NaN where it is not known."""
        return float(self._row("gap", direction)) if "gap" in self._arrays else math.nan

    def indices(self, direction: str) -> dict[str, Estimate]:
        """Index 1 and index 2 in one direction, over the trials that did not go wrong."""
        steps, status = self._row("escape_step", direction), self._row("status", direction)
        return indices_of(steps, status, self.max_steps, caged=self._caged(direction))

    def score(self) -> dict[str, Estimate]:
        """The score (18) by index 1 and by index 2; trial i of both directions shares its draws.

        Raises:
            ValueError: only one direction was evaluated.
        """
        if len(self.directions) < 2:
            raise ValueError("the score needs both directions: evaluate with direction='both'")
        steps, status = (
            np.stack([self._row(name, direction) for direction in NAMES])
            for name in ("escape_step", "status")
        )
        does, eoen = (self._caged(direction) for direction in NAMES)
        return score_of(steps, status, self.max_steps, caged=(does, eoen))

    @property
    def main(self) -> Estimate:
        """The score by index 1; index 1 where only one direction was evaluated."""
        return (self.score() if len(self.directions) == 2 else self.indices(self.directions[0]))[
            "index1"
        ]

    def difference(self, other: Evaluation, direction: str) -> dict[str, Estimate]:
        """How much higher this hand's index 1 and index 2 are than another one's.

        Trial i was the same experiment for both, so the difference is known better than either.

        Arguments:
            other: the other hand.
            direction: "does", "eoen", or "score" for the difference of the scores.

        Raises:
            ValueError: the two differ in seed, limit or number of trials.
        """
        for name in ("seed", "max_steps", "trials"):
            mine, theirs = (
                run.trials if name == "trials" else int(run.attrs[name]) for run in (self, other)
            )
            if mine != theirs:
                raise ValueError(
                    f"{name} is {mine} here and {theirs} there: only runs with the same seed, "
                    "limit and trials can be compared trial by trial"
                )
        if direction == "score":
            return self._score_difference(other)
        valid = self._valid([direction]) & other._valid([direction])
        (steps, stayed), (their_steps, they_stayed) = (
            run._trials(direction, valid) for run in (self, other)
        )
        # Of a hand that is a full cage it is known that every trial reaches the limit.
        mine, theirs = (0.0 if run._caged(direction) else 1.0 for run in (self, other))
        samples = {
            "index1": (self.max_steps, (steps - their_steps).astype(float)),
            "index2": (1.0, stayed.astype(float) - they_stayed.astype(float)),
        }
        lost = int(np.sum(~valid))
        return {
            name: mean(sample, -most * mine, most * theirs, lost=lost)
            for name, (most, sample) in samples.items()
        }

    def _score_difference(self, other: Evaluation) -> dict[str, Estimate]:
        both = list(NAMES)
        valid = self._valid(both) & other._valid(both)
        pairs = [[run._trials(d, valid) for d in both] for run in (self, other)]
        a, b, c, d = (run._caged(direction) for run in (self, other) for direction in both)
        found = {}
        for k, (name, most) in enumerate((("index1", self.max_steps), ("index2", 1.0))):
            mine, theirs = (np.stack([one[k].astype(float) for one in pair]) for pair in pairs)
            lost = int(np.sum(~valid))
            found[name] = ratio_difference(mine, theirs, most, certain=(a, b, c, d), lost=lost)
        return found

    def status(self, direction: str) -> dict[str, int]:
        """How many trials passed, reached the limit, or went wrong."""
        status = self._row("status", direction)
        return {name: int(np.sum(status == code)) for code, name in STATUS_NAMES.items()}

    def ends(self, direction: str) -> tuple[np.ndarray, np.ndarray]:
        """Of each trial the step in which it ended, and how: PASSED, LIMIT or INVALID."""
        return self._row("escape_step", direction), self._row("status", direction)

    def survival(self, direction: str) -> tuple[np.ndarray, np.ndarray]:
        """Steps, and the share of trials that has not passed by then (`survival_curve`)."""
        return survival_curve(*self._trials(direction, self._valid([direction])))

    def stick(self, direction: str) -> dict[str, float] | None:
        """The worst of all trials of a stick in one direction, None for a circle.

        `penetration`, how deep it was inside its `skin` at the end of a step (less than the skin:
        nothing was cut), and `travel`, the largest relative speed times the step. `undone` is how
        many steps in all had to leave the stick where it was.
        """
        if "skin" not in self.attrs:
            return None
        worst = {name: float(self._row(name, direction).max()) for name in WATCHED}
        undone = int(self._row("undone", direction).sum())
        return worst | {"undone": undone, "skin": float(self.attrs["skin"])}

    def notes(self) -> list[str]:
        """What one should know before using the numbers; empty if all is well."""
        notes = []
        if "no_eoen" in self.attrs:
            notes.append(f"EoEn, and so the score, is not given: {self.attrs['no_eoen']}")
        steps = bool(np.isfinite(self.attrs["dt"]))
        cure = "a smaller dt mends it" if steps else "precision 64 or engine 'stepping' may mend it"
        for direction in self.directions:
            name, counts, n = NAMES[direction], self.status(direction), self.trials
            caged, gap = self._caged(direction), self.gap(direction)
            width = float(self.attrs["object_width"])
            if full_cage(gap, width):
                fate = "nothing passes" if caged else "no more than its centre passes"
                notes.append(
                    f"{name}: full cage, the gap of {gap:.4g} is narrower than the object "
                    f"({width:.4g}) and {fate}"
                )
            notes += self._half_step(direction)
            if counts["invalid"]:
                notes.append(
                    f"{name}: {counts['invalid']} of {n} trials went wrong (a limb stepped over, "
                    "or not a number) and are left out of the indices; the intervals hold "
                    f"wherever they would have ended; {cure}"
                )
            if counts["limit"] == n and not caged:
                notes.append(
                    f"{name}: nobody passed within {self.max_steps:,} steps, so index 1 is the "
                    "limit itself, and its interval says what the trials exclude; a higher limit "
                    "tells more"
                )
            if counts["passed"] == n:
                notes.append(f"{name}: everybody passed, so index 2 is 0")
        target, known = self.attrs.get("precision_target"), precision_of(self.main)
        if target is not None and known > target:
            notes.append(
                f"{self.trials:,} trials are too few for the precision asked for: it is known to "
                f"{known:.2%}, not {target:.2%}"
            )
        if len(self.directions) == 2:
            eoen = self.status("eoen")
            if eoen["limit"] == self.trials:
                notes.append("EoEn is at the limit: the score says only how DoEs falls short of it")
            score = self.score()
            if math.isnan(score["index1"].value):
                notes.append("the score is undefined: no trial went right in both directions")
            elif math.isnan(score["index2"].value):
                notes.append(
                    "the score by index 2 is undefined: EoEn's index 2 is 0 over the trials that "
                    "went right in both directions"
                )
        return notes

    def _half_step(self, direction: str) -> list[str]:
        """Where half the step makes a difference that is beyond a 95 % interval."""
        later = float(self.attrs.get(f"{direction}_half_step_later", 0.0))
        if not later:
            return []
        from scipy.special import stdtrit

        tried = int(self.attrs[f"{direction}_half_step_trials"])
        error = float(self.attrs[f"{direction}_half_step_se"])
        if abs(later) <= stdtrit(tried - 1, 0.975) * error:  # Student's t: they may be few
            return []
        return [
            f"{NAMES[direction]}: with half the step the first {tried} trials end {later:+.4g} ± "
            f"{error:.2g} steps later, which is beyond its error; a smaller dt tells more"
        ]

    def as_json(self) -> dict[str, Any]:
        """Plain numbers for `--json`; what is undefined is null."""
        out: dict[str, Any] = {
            d: {name: as_plain(e) for name, e in self.indices(d).items()} for d in self.directions
        }
        if len(self.directions) == 2:
            out["score"] = {name: as_plain(e) for name, e in self.score().items()}
        sticks = {d: stick for d in self.directions if (stick := self.stick(d))}
        if sticks:
            out["stick"] = sticks
        attrs = self.attrs
        return out | {
            "trials": self.trials,
            "seed": int(attrs["seed"]),
            "engine": str(attrs["engine"]),
            "status": {d: self.status(d) for d in self.directions},
            "wall_seconds": float(attrs["wall_seconds"]),
            "notes": self.notes(),
        }

    def __repr__(self) -> str:
        attrs = self.attrs
        shown = [(NAMES[d], self.indices(d), ",.0f") for d in self.directions]
        shown += [("score", self.score(), ".4f")] if len(self.directions) == 2 else []
        rows = []
        for name, (one, two), form in ((name, each.values(), form) for name, each, form in shown):
            rows.append(
                [
                    name,
                    estimate_text(one, form),
                    interval_text(one, form),
                    estimate_text(two, ".4f"),
                    interval_text(two, ".4f"),
                ]
            )
        heads = ["", "index 1 [steps]", "95 % interval", "index 2", "95 % interval"]
        lines = [
            in_columns(heads, rows, left=[0]),
            wrapped(
                f"{self.trials:,} trials a direction, limit {self.max_steps:,} steps, seed "
                f"{attrs['seed']}, {engines_text(attrs['engine'], attrs['dt'])}, "
                f"float{attrs['precision']}, {attrs['wall_seconds']:.1f} s; value ± standard error"
            ),
        ]
        for direction in self.directions:
            if stick := self.stick(direction):
                invalid = self.status(direction)["invalid"]
                name = f"{attrs.get('body', 'Stick').lower()}, {NAMES[direction]}"
                lines.append(stick_text(name, **stick, invalid=invalid))
        return "\n".join(lines + [wrapped(f"note: {note}") for note in self.notes()])

    def _caged(self, direction: str) -> bool:
        """Whether nothing passes, for sure."""
        return bool(
            full_cage(self.gap(direction), float(self.attrs.get("least_passage", math.nan)))
        )

    def _valid(self, directions: list[str]) -> np.ndarray:
        rows = [self._row("status", direction) != INVALID for direction in directions]
        return np.logical_and.reduce(rows)

    def _trials(self, direction: str, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Escape steps, and who reached the limit, of the chosen trials."""
        steps, status = self._row("escape_step", direction), self._row("status", direction)
        return steps[chosen], status[chosen] == LIMIT

    def _row(self, name: str, direction: str) -> np.ndarray:
        """A variable in one direction.

        Raises:
            KeyError: that was not evaluated.
        """
        if direction not in self.directions:
            raise KeyError(direction)
        return self._arrays[name][self.directions.index(direction)]
