"""Several hands, with what they have to hold, on the same trials: which is better, and how sure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pcjax.quality.indices import Estimate
from pcjax.quality.stopping import half_width, until_known
from pcjax.results.estimates import as_plain
from pcjax.results.evaluation import Evaluation
from pcjax.results.schema import length_unit_of
from pcjax.results.tables import in_columns, interval_text, shortened, wrapped
from pcjax.showing import Shown
from pcjax.study.evaluate import Experiment
from pcjax.study.spec import Study
from pcjax.units import with_unit

Verdict = Literal["better", "worse", "not certain"]


@dataclass(frozen=True)
class Ranking(Shown):
    """Hands in the order of their scores, by index 1; of DoEs where some hand has no EoEn.

    Attributes:
        evaluations: by name, the best first.
        by: what they are ranked by, "score" or "does".
        precision_target: what was asked for (see `compare`).
    """

    drawn_by = "view.plots.plot_ranking"

    evaluations: Mapping[str, Evaluation]
    by: Literal["score", "does"]
    precision_target: float | None = None

    @property
    def names(self) -> list[str]:
        """The best first."""
        return list(self.evaluations)

    def value(self, name: str) -> Estimate:
        """What a hand is ranked by."""
        return _value(self.evaluations[name], self.by)

    def difference(self, name: str, other: str) -> Estimate:
        """How much higher one hand's value is than another's, on the same trials."""
        mine, theirs = self.evaluations[name], self.evaluations[other]
        return mine.difference(theirs, self.by)["index1"]

    @property
    def precision(self) -> float:
        """Half the widest 95 % interval of the differences to the best, as a share of the best."""
        best, *others = self.names
        widest = np.max([half_width(self.difference(name, best)) for name in others])
        return float(widest) / self.value(best).value

    def verdict(self, name: str, other: str) -> Verdict:
        """Whether one hand is better than another, as far as a 95 % interval can tell."""
        found = self.difference(name, other)
        if found.low > 0:
            return "better"
        return "worse" if found.high < 0 else "not certain"

    def __repr__(self) -> str:
        first = self.names[0]
        unit, form = ("score", ".4f") if self.by == "score" else ("DoEs [steps]", ",.0f")
        rows = []
        for place, (name, result) in enumerate(self.evaluations.items(), start=1):
            value, off = self.value(name), self.difference(name, first)
            rows.append(
                [
                    str(place),
                    shortened(name),
                    "undefined" if math.isnan(value.value) else f"{value.value:{form}}",
                    interval_text(value, form),
                    _gap_text(result),
                    f"{off.value:{form}} {interval_text(off, form)}" if place > 1 else "",
                    self.verdict(name, first) if place > 1 else "",
                ]
            )
        heads = ["", "", unit, "95 % interval", "gap", "against the best", ""]
        some = self.evaluations[first]
        lines = [
            in_columns(heads, rows, keys=2, left=[1, 5, 6]),
            wrapped(
                f"{some.trials:,} trials a direction, the same for all; limit {some.max_steps:,} "
                f"steps, seed {some.dataset.attrs['seed']}"
            ),
        ]
        notes = {
            note: [n for n, result in self.evaluations.items() if note in result.notes()]
            for result in self.evaluations.values()
            for note in result.notes()
        }
        lines += [wrapped(f"note: {', '.join(names)}: {note}") for note, names in notes.items()]
        if self.precision_target is not None and not self.precision <= self.precision_target:
            lines.append(
                wrapped(
                    f"note: {some.trials:,} trials are too few for the precision asked for: "
                    f"differences are known to {self.precision:.2%} of the best, not "
                    f"{self.precision_target:.2%}"
                )
            )
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Plain numbers for `--json`; what is undefined is null."""

        first = self.names[0]
        return {
            "by": self.by,
            "ranking": [
                {
                    "name": name,
                    "value": as_plain(self.value(name)),
                    "difference": None if name == first else as_plain(self.difference(name, first)),
                    "verdict": None if name == first else self.verdict(name, first),
                    "evaluation": result.as_json(),
                }
                for name, result in self.evaluations.items()
            ],
        }


def compare(studies: Mapping[str, Study], *, progress: bool = False) -> Ranking:
    """Evaluates hands on the same trials and ranks them.

    Arguments:
        studies: by name. Seed, trials, limit and precision are the first one's for all; each hand
            keeps its own engine and step. Where a `precision_target` is asked for, half the 95 %
            interval of each difference to the best is to be at most this share of the best.
        progress: whether to show a progress bar on stderr.

    Raises:
        ValueError: fewer than two studies, or one that cannot be evaluated; its name comes first.

    Examples:
        >>> import pcjax
        >>> run = pcjax.Run(direction="does", trials=200, max_steps=100_000)
        >>> hands = {"flared": pcjax.box_hand(-0.35), "tapered": pcjax.box_hand(0.6)}
        >>> studies = {n: pcjax.Study(h, pcjax.Circle(25.0), run=run) for n, h in hands.items()}
        >>> pcjax.compare(studies).verdict("flared", "tapered")
        'worse'
    """
    if len(studies) < 2:
        raise ValueError("name two hands or more to be compared")
    first = next(iter(studies.values()))
    target, most = first.run.precision_target, first.trials
    same = {
        "seed": first.run.seed,
        "trials": most,
        "max_steps": first.max_steps,
        "precision": first.run.precision,
        "precision_target": None,
    }
    tried: dict[str, Experiment] = {}
    for name, study in studies.items():
        with _named(name):
            tried[name] = Experiment(replace(study, run=replace(study.run, **same), sweep=None))

    def go_on(trials: int) -> Ranking:
        found: dict[str, Evaluation] = {}
        for name, experiment in tried.items():
            with _named(name):
                found[name] = experiment.go_on(trials, progress=progress)
        return _ranked(found, target)

    until_known(target, most, go_on, lambda ranking: ranking.precision)
    return _ranked({name: experiment.checked() for name, experiment in tried.items()}, target)


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Says of whom an error is."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _ranked(found: Mapping[str, Evaluation], target: float | None) -> Ranking:
    by = "score" if all(len(e.directions) == 2 for e in found.values()) else "does"
    if by == "does" and any("does" not in e.directions for e in found.values()):
        raise ValueError("one hand has EoEn only and another has not: give all the same direction")
    order = sorted(found, key=lambda name: _order(_value(found[name], by)), reverse=True)
    return Ranking({name: found[name] for name in order}, by, target)


def _gap_text(result: Evaluation) -> str:
    gap = result.gap(result.directions[0])
    return "" if math.isnan(gap) else with_unit(gap, length_unit_of(result.dataset))


def _value(evaluation: Evaluation, by: str) -> Estimate:
    chosen = evaluation.score() if by == "score" else evaluation.indices(by)
    return chosen["index1"]


def _order(estimate: Estimate) -> float:
    return -math.inf if math.isnan(estimate.value) else estimate.value


def names_of(paths: Sequence[str]) -> list[str]:
    """Names for files: without what all share of their folders and endings, if that is unique."""
    stems = [path.rsplit("/", 1)[-1].removesuffix(".toml") for path in paths]
    return stems if len(set(stems)) == len(stems) else list(paths)
