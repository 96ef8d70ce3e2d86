"""What files of results hold: every variable and attribute, declared once. Datasets are built from
that here, and checked against it in `pcjax.results.checking`.

There are five kinds of files. An evaluation has one hand, in each direction, with all its trials,
and where things are in the plane; that of a hand in three dimensions has the trials alone; a sweep
has the conditions of a study; a grid has conditions of anybody's making (a figure of the
paper is one) and the covariance between them; a map has the score over two parameters. What is the
same thing has the same name in all of them. What is one number for a whole file is an attribute,
and a variable of that name where it differs between conditions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from pcjax.importing import xr
from pcjax.model.scenario import DIRECTIONS
from pcjax.physics.state import PAPER_DT
from pcjax.quality.indices import Estimate
from pcjax.simulate.outcomes import STATUS_NAMES
from pcjax.units import length_in_words

NAMES = {"does": "DoEs", "eoen": "EoEn"}
"""Directions: difficulty of escaping and ease of entering."""

STATISTICS = tuple(f.name for f in fields(Estimate))
"""What is kept of an estimate."""

INDICES = ("index1", "index2")

KindName = Literal["evaluation", "spatial", "sweep", "grid", "map"]

EVALUATIONS = ("evaluation", "spatial")
"""Kinds of files that have one hand, in the plane or in three dimensions, with all its trials."""

Numbers = Literal["real", "whole", "flag", "text"]

PLACE, EACH, FINE = "*place", "*each", "*fine"
"""Stand for dimensions that differ between kinds: of a file's conditions, of its conditions each in
one direction, and of a map's finer grid."""


def units_of(quantity: str, length_unit: str = "model") -> str:
    """The `units` attribute of a quantity: a length's, a duration's, or what is given itself."""
    known = {"length": length_in_words(length_unit), "steps": f"steps of {PAPER_DT} s"}
    return known.get(quantity, quantity)


def length_unit_of(data: xr.Dataset) -> str:
    """The unit of a result's lengths; files that do not say it are in the model's."""
    return str(data.attrs.get("length_unit", "model"))


@dataclass(frozen=True)
class Variable:
    """What a variable of a result is.

    Attributes:
        dims: its dimensions; see `PLACE`, `EACH` and `FINE`.
        numbers: of what type.
        units: for `units_of`; "" where it has none.
        long_name: what it is.
        low, high: the range; a name is that of the attribute with the bound.
        nan: whether a number may be missing.
    """

    dims: tuple[str, ...]
    numbers: Numbers = "real"
    units: str = ""
    long_name: str = ""
    low: float = -math.inf
    high: float | str = math.inf
    nan: bool = False

    def attrs(self, length_unit: str) -> dict[str, Any]:
        """As in files whose lengths are in that unit."""
        texts = {"units": units_of(self.units, length_unit), "long_name": self.long_name}
        return {name: text for name, text in texts.items() if text}

    def per_trial(self) -> Variable:
        """The same of each trial."""
        return replace(self, dims=(*self.dims, "trial"))


@dataclass(frozen=True)
class Attribute:
    """What an attribute of a result is; the range as in `Variable`."""

    numbers: Numbers
    low: float = -math.inf
    high: float = math.inf
    nan: bool = False


@dataclass(frozen=True)
class Kind:
    """One kind of files.

    Attributes:
        noun: what it is.
        each: dimensions of its conditions each in one direction, after those of `place`.
        variables: by name.
        optional: variables that not every file has.
        attributes: that it has beside `ATTRIBUTES`.
        gaps: whether conditions may be empty, with NaN for all their numbers.
        hands_drawn_by: the function that draws the hand of an evaluation, in each direction that it
            can be drawn in; by its name, since it is of a layer above.
    """

    noun: str
    each: tuple[str, ...]
    variables: Mapping[str, Variable]
    optional: Mapping[str, Variable]
    attributes: Mapping[str, Attribute]
    gaps: bool = False
    hands_drawn_by: str = "view.plots.hands_of"


_INDEX = {
    "index1": Variable(
        (EACH, "statistic"), "real", "steps", "mean escape step, cut at the limit", 1, "max_steps"
    ),
    "index2": Variable((EACH, "statistic"), "real", "1", "share of trials at the limit", 0, 1),
}
_SCORE = {"score": Variable((PLACE, "index", "statistic"), "real", "1", "DoEs / EoEn", 0)}
_COUNT = {
    "count": Variable((EACH, "status_name"), "whole", "1", "trials that ended so", 0, "trials")
}
_TRIALS = {
    "escape_step": Variable(
        (EACH, "trial"), "whole", "steps", "escape step, or the limit", 0, "max_steps"
    ),
    "status": Variable((EACH, "trial"), "whole", "", "how the trial ended"),
}
_GAP = {"gap": Variable((EACH,), "real", "length", "narrowest passage between the fingers", 0)}
_OBJECT = {
    "object_width": Variable(
        (EACH,), "real", "length", "the narrowest gap the object fits through", 0
    )
}
_DT = {"dt": Variable((EACH,), "real", "s", "the solver's step; NaN: it took none", 0, nan=True)}
_SKIN = {
    "skin": Variable(
        (EACH,), "real", "length", "distance from limbs at which a stick is held", 0, nan=True
    )
}
WATCHED = {
    "penetration": Variable(
        (EACH,),
        "real",
        "length",
        "deepest that the stick was inside its skin at the end of a step",
        low=0,
        nan=True,
    ),
    "travel": Variable(
        (EACH,),
        "real",
        "length",
        "farthest that a point of the stick went in a step, seen from the hand",
        low=0,
        nan=True,
    ),
    "undone": Variable(
        (EACH,), "real", "steps", "steps in which the stick had to stay where it was", 0, nan=True
    ),
}
"""What is kept of trials of a stick; over several trials, the worst of them and the sum of the
steps."""

_END, _POINT = (EACH, "end"), (EACH, "coordinate")
_PICTURE = {
    "limbs": Variable((EACH, "limb", "end"), "real", "length", "the limbs' middle lines' two ends"),
    "goal": Variable(_END, "real", "length", "the goal line's two ends"),
    "passage": Variable(_END, "real", "length", "narrowest passage between the fingers"),
    "start": Variable(_POINT, "real", "length", "the start closest to the right corner"),
    "outline": Variable(
        (EACH, "corner", "coordinate"), "real", "length", "the object's corners there"
    ),
}

_CAGE = Variable((PLACE,), "flag", "", "whether the gap is narrower than the object")
_POSSIBLE = Variable(
    (PLACE,), "flag", "", "whether no limbs cross and the object fits at its starts"
)

KINDS: dict[KindName, Kind] = {
    "evaluation": Kind(
        "an evaluation of one hand",
        ("direction",),
        _TRIALS | _PICTURE | _GAP,
        {name: what.per_trial() for name, what in WATCHED.items()} | _INDEX | _SCORE | _COUNT,
        {
            "radius": Attribute("real", 0),
            "object_width": Attribute("real", 0),
            "least_passage": Attribute("real", 0),
            "thickness": Attribute("real", 0),
            "dt": Attribute("real", 0, nan=True),
            "wall_seconds": Attribute("real"),
        },
    ),
    "spatial": Kind(
        "an evaluation of one hand in three dimensions",
        ("direction",),
        _TRIALS,
        _INDEX | _SCORE | _COUNT,
        {
            "radius": Attribute("real", 0),
            "object_width": Attribute("real", 0),
            "hand_digest": Attribute("text"),
            "dt": Attribute("real", 0),
            "wall_seconds": Attribute("real"),
        },
        hands_drawn_by="view.spatial.hands_of",
    ),
    "sweep": Kind(
        "a sweep",
        ("direction",),
        _INDEX
        | _COUNT
        | _GAP
        | _DT
        | {
            "trials_used": Variable(
                (PLACE,), "whole", "1", "trials of each direction", 0, "trials"
            ),
            "problem": Variable((PLACE,), "text", "", "why the condition could not be run"),
        },
        _SCORE | _OBJECT | _SKIN | WATCHED | _TRIALS,
        {"sweep": Attribute("text")},
        gaps=True,
    ),
    "grid": Kind(
        "a grid of conditions",
        (),
        _INDEX
        | _COUNT
        | _GAP
        | _DT
        | {
            "covariance": Variable(
                ("index", "index_2", "condition", "condition_2"),
                "real",
                "",
                "covariance of the estimates, from the shared trials",
            )
        },
        _OBJECT | _SKIN | WATCHED,
        {"wall_seconds": Attribute("real"), "trials_right": Attribute("whole", 2)},
    ),
    "map": Kind(
        "a map of the score",
        (),
        _SCORE | _GAP | {"full_cage": _CAGE, "possible": _POSSIBLE},
        {
            "gap_fine": replace(_GAP["gap"], dims=(FINE,)),
            "possible_fine": replace(_POSSIBLE, dims=(FINE,)),
        },
        {
            "object_width": Attribute("real", 0),
            "objective": Attribute("text"),
            "score_name": Attribute("text"),
            "hands": Attribute("whole", 1),
            "invalid": Attribute("whole", 0),
            "wall_seconds": Attribute("real"),
        },
        gaps=True,
    ),
}

ATTRIBUTES = {
    "made_by": Attribute("text"),
    "engine": Attribute("text"),
    "seed": Attribute("whole", 0, 2**32 - 1),
    "precision": Attribute("whole", 32, 64),
    "max_steps": Attribute("whole", 1, 2**31 - 1),
    "trials": Attribute("whole", 1, 2**31 - 1),
    "hand": Attribute("text"),
    "body": Attribute("text"),
    "drive": Attribute("text"),
    "law": Attribute("text"),
    "parameters": Attribute("text"),
}
"""What every file says of its run, and of what was run."""

LABELS = {
    "direction": [list(DIRECTIONS), ["does"], ["eoen"]],
    "statistic": [list(STATISTICS)],
    "status_name": [list(STATUS_NAMES.values())],
    "end": [["x_start", "y_start", "x_end", "y_end"]],
    "coordinate": [["x", "y"]],
}
"""Labels of dimensions that are the same in all files, or one of some."""


# ------------------------------------------------------------------------------------- building


def dataset_of(
    kind: KindName,
    values: Mapping[str, Any],
    coords: Mapping[str, Any],
    attrs: Mapping[str, Any],
    *,
    place: Sequence[str] = (),
) -> xr.Dataset:
    """A dataset of some kind, with names, dimensions, units and labels as declared.

    Arguments:
        kind: of `KINDS`.
        values: of the variables by name; what is None is left out.
        coords: labels, those that are the same in all files excepted.
        attrs: of the dataset.
        place: dimensions of its conditions.

    Raises:
        KeyError: a variable that files of this kind do not have.
    """
    what = KINDS[kind]
    known = {**what.variables, **what.optional}
    length_unit = attrs.get("length_unit", "model")
    data = {
        name: (dims_of(known[name], what, place), value, known[name].attrs(length_unit))
        for name, value in values.items()
        if value is not None
    }
    used = {dim for dims, *_ in data.values() for dim in dims}
    labels = {dim: some[0] for dim, some in LABELS.items() if dim in used and len(some) == 1}
    if "index" in used and kind != "map":
        labels["index"] = list(INDICES)
    dataset = xr.Dataset(data, labels | dict(coords), {"kind": kind, **attrs})
    if "status" in dataset:
        endings = ({0: "not_run"} if kind == "sweep" else {}) | STATUS_NAMES
        dataset.status.attrs |= {
            "flag_values": list(endings),
            "flag_meanings": " ".join(endings.values()),
        }
    return dataset


def dims_of(variable: Variable, kind: Kind, place: Sequence[str]) -> tuple[str, ...]:
    """A variable's dimensions in a file whose conditions lie along `place`."""
    meant = {
        PLACE: tuple(place),
        EACH: (*place, *kind.each),
        FINE: tuple(f"{dim}_fine" for dim in place),
    }
    return tuple(one for dim in variable.dims for one in meant.get(dim, (dim,)))


def place_of(data: xr.Dataset) -> tuple[str, ...]:
    """The dimensions of a result's conditions.

    Raises:
        ValueError: there are none where there have to be.
    """
    kind = data.attrs["kind"]
    if kind in EVALUATIONS:
        return ()
    if kind == "grid":
        return ("condition",)
    name = "problem" if kind == "sweep" else "gap"
    return tuple(map(str, variable_of(data, name).dims))


def labels_of(data: xr.Dataset) -> list[str]:
    """The labels of a sweep's, a grid's or a map's conditions: its swept numbers, say."""
    place = place_of(data)
    if place == ("condition",):
        return [str(n) for n in data.coords if data.coords[n].dims == place]
    return list(place)


def variable_of(data: xr.Dataset, name: str) -> xr.DataArray:
    """Raises ValueError unless the variable is there."""
    if name not in data.variables:
        raise ValueError(f"{name} is missing")
    return data[name]
