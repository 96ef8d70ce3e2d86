"""The paper's figures as data: settings -> conditions -> curves with standard errors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from pcjax.importing import xr
from pcjax.model.bodies.stick import Stick
from pcjax.model.hand import full_cage
from pcjax.model.presets import box_hand, two_joint_hand
from pcjax.model.scenario import DIRECTIONS, does
from pcjax.paper import constants as paper
from pcjax.paper.readings import LITERAL, Reading, reading_of
from pcjax.results.checking import check_attribute, check_numbers
from pcjax.results.schema import INDICES, Attribute, units_of, variable_of
from pcjax.study.evaluate import evaluate_grid


def run_figure(name: str, reading: Reading = LITERAL, **run: Any) -> xr.Dataset:
    """Evaluates all conditions of a figure in one batch.

    Arguments:
        name: one of `pcjax.paper.constants.FIGURE_NAMES`.
        reading: of the paper's model, one of `pcjax.paper.readings.READINGS`.
        run: `trials`, `max_steps` (the paper's unless given) and others of
            `pcjax.evaluate_grid`.

    Raises:
        ValueError: an unknown figure, or a number out of range.
    """
    if name not in paper.FIGURE_NAMES:
        raise ValueError(f"figure is {name!r}: it has to be one of {', '.join(paper.FIGURE_NAMES)}")
    if run.get("max_steps") is None:
        run["max_steps"] = paper.max_steps(name)
    if name not in paper.FIGURES:
        return _run_arm_figure(name, reading, **run)
    figure, unit = paper.FIGURES[name], paper.WRIST_PALM_LENGTH
    drive, law = reading.wrist(), reading.law()
    rows, scenarios = [], []
    for gap_width in figure.gap_widths:
        for radius in figure.radii:
            for angle in figure.angles_deg:
                hand = box_hand(
                    math.radians(angle),
                    palm_length=unit,
                    gap_width=gap_width * unit,
                    fingertip_length=paper.FINGERTIP_LENGTH * unit,
                )
                for direction in figure.directions:
                    rows.append((direction, gap_width, radius, angle))
                    body = reading.circle(radius * unit)
                    scenarios.append(DIRECTIONS[direction](hand, body, drive, law))
    names = ["direction", "gap_width", "radius", "angle"]
    coords = dict(zip(names, zip(*rows, strict=True), strict=True))
    dataset = evaluate_grid(scenarios, coords, **run)
    dataset.angle.attrs = {"units": "degrees", "long_name": "fingertip angle theta_g"}
    dataset.radius.attrs = dataset.gap_width.attrs = {"units": "palm lengths L_p"}
    dataset.attrs |= {"figure": name, "title": figure.title, "reading": reading.name}
    return dataset


def _run_arm_figure(name: str, reading: Reading, **run: Any) -> xr.Dataset:
    parts = [paper.ARM_FIGURES[part] for part in ("13", "14") if name in (part, "15")]
    parts = parts or [paper.ARM_FIGURES[name]]
    stick = parts[0].body == "stick"
    # Figs. 13 and 14 share a condition, which Fig. 15 shows once.
    angles = dict.fromkeys(
        (a, b, o)
        for part in parts
        for o in part.orientations_deg
        for a in part.angles_1_deg
        for b in part.angles_2_deg
    )
    scenarios = []
    for first, second, orientation in angles:
        hand = two_joint_hand(
            math.radians(first),
            math.radians(second),
            palm_length=paper.ARM_PALM_LENGTH,
            lengths=paper.ARM_FINGER,
        )
        body = reading.circle(paper.ARM_RADIUS)
        if stick:
            body = Stick(paper.ARM_RADIUS, math.radians(orientation))
        scenarios.append(does(hand, body, reading.arm(), reading.law()))
    names = ("theta_1", "theta_2", "orientation")
    coords: dict[str, Any] = dict(zip(names, zip(*angles, strict=True), strict=True))
    tips = [[s.hand.finger(i)[-1].end.x for i in (0, 1)] for s in scenarios]
    coords["width"] = [float(right - left) for left, right in tips]
    coords["direction"] = ["does"] * len(scenarios)
    coords["angle"] = coords["width" if name == "15" else parts[0].varies]
    dataset = evaluate_grid(scenarios, coords, **run)
    for key in ("theta_1", "theta_2", "orientation"):
        dataset[key].attrs = {"units": "degrees"}
    dataset.width.attrs = {"units": units_of("length"), "long_name": "between the fingertips' ends"}
    title = paper.FIG15_TITLE if name == "15" else parts[0].title
    dataset.attrs |= {"figure": name, "title": title, "reading": reading.name}
    return dataset


def check_figure(data: xr.Dataset) -> None:
    """Refuses a dataset that says it is a figure of the paper and is not.

    Raises:
        ValueError: an unknown figure or reading, or other conditions than that figure's.
    """
    for attribute in ("figure", "title"):
        check_attribute(data, attribute, Attribute("text"))
    reading_of(data)
    name = data.attrs["figure"]
    if name in paper.FIGURES:
        names = ("gap_width", "radius", "angle")
    elif name in paper.FIGURE_NAMES:
        names = ("theta_1", "theta_2", "orientation")
        for other in ("width", "angle"):
            check_numbers(data, other, ("condition",))
    else:
        raise ValueError(f"the paper has no figure {name!r}")
    for other in names:
        check_numbers(data, other, ("condition",))
    labels = [variable_of(data, other).values.tolist() for other in ("direction", *names)]
    found = list(zip(*labels, strict=True))
    if not any(_same(found, rows) for rows in _conditions(name)):
        raise ValueError(f"its conditions are not those of Fig. {name}")


def _conditions(name: str) -> Iterator[list[tuple[str, float, float, float]]]:
    """The conditions of a figure, as they are and as they were when files were first kept: at every
    second angle."""
    if name in paper.FIGURES:
        figure = paper.FIGURES[name]
        for angles in (figure.angles_deg, figure.angles_deg[::2]):
            yield [
                (direction, gap, radius, angle)
                for gap in figure.gap_widths
                for radius in figure.radii
                for angle in angles
                for direction in figure.directions
            ]
    else:
        parts = ("13", "14") if name == "15" else (name,)
        rows = [
            ("does", first, second, orientation)
            for part in (paper.ARM_FIGURES[p] for p in parts)
            for orientation in part.orientations_deg
            for first in part.angles_1_deg
            for second in part.angles_2_deg
        ]
        yield list(dict.fromkeys(rows))


def _same(found: Sequence[tuple], rows: Sequence[tuple]) -> bool:
    return len(found) == len(rows) and all(
        a[0] == b[0] and np.allclose(a[1:], b[1:]) for a, b in zip(found, rows, strict=True)
    )


@dataclass(frozen=True)
class Curve:
    """Estimates along the fingertip angle, with the covariance between them.

    Attributes:
        angle: degrees.
        value: the estimates.
        covariance: of the estimates; the trials are shared along the curve.
        open: whether the object fits through the gap there.
    """

    angle: Float[np.ndarray, " n"]
    value: Float[np.ndarray, " n"]
    covariance: Float[np.ndarray, "n n"]
    open: Bool[np.ndarray, " n"]

    @property
    def se(self) -> Float[np.ndarray, " n"]:
        """Standard errors."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def at(self, angle: float) -> int:
        """The position of an angle."""
        return int(np.flatnonzero(self.angle == angle)[0])

    def difference(self, later: float, earlier: float) -> tuple[float, float]:
        """value(later) - value(earlier) and its standard error, paired."""
        return self.contrast((later, 1.0), (earlier, -1.0))

    def contrast(self, *terms: tuple[float, float]) -> tuple[float, float]:
        """The sum of value(angle) times weight over `terms`, (angle, weight), and its standard
        error."""
        w = np.zeros(len(self.angle))
        for angle, weight in terms:
            w[self.at(angle)] += weight
        return float(w @ self.value), math.sqrt(max(float(w @ self.covariance @ w), 0.0))

    def only(self, chosen: Bool[np.ndarray, " n"]) -> Curve:
        """The curve at some of its angles."""
        return Curve(
            self.angle[chosen],
            self.value[chosen],
            self.covariance[np.ix_(chosen, chosen)],
            self.open[chosen],
        )


def _places(dataset: xr.Dataset, direction: str, where: Mapping[str, float | str]) -> np.ndarray:
    chosen = dataset.direction.values == direction
    for name, value in where.items():
        values = dataset[name].values
        chosen &= values == value if isinstance(value, str) else np.isclose(values, value)
    places = np.flatnonzero(chosen)
    return places[np.argsort(dataset.angle.values[places])]


def _passable(dataset: xr.Dataset, places: np.ndarray) -> np.ndarray:
    width = dataset.object_width.values[places]
    return ~np.asarray(full_cage(dataset.gap.values[places], width))


def curve(
    dataset: xr.Dataset,
    direction: str,
    estimate: str = "index1",
    where: Mapping[str, float | str] | None = None,
) -> Curve:
    """Index 1 or index 2 against the angle, in one direction.

    Arguments:
        dataset: from `run_figure`.
        direction: "does" or "eoen".
        estimate: "index1" or "index2".
        where: the radius or gap width, where the figure has several, or any other coordinate.
    """
    places = _places(dataset, direction, where or {})
    k = INDICES.index(estimate)
    return Curve(
        dataset.angle.values[places],
        dataset[estimate].sel(statistic="value").values[places],
        dataset.covariance.values[k, k][np.ix_(places, places)],
        _passable(dataset, places),
    )


def score_curve(dataset: xr.Dataset, where: Mapping[str, float | str] | None = None) -> Curve:
    """The score (18) by index 1 against the angle; errors by the delta method, paired."""
    top, bottom = (_places(dataset, d, where or {}) for d in ("does", "eoen"))
    means = dataset.index1.sel(statistic="value").values
    score = means[top] / means[bottom]
    # d score_k = sum over conditions of jacobian[k] d mean
    jacobian = np.zeros((len(score), len(means)))
    rows = np.arange(len(score))
    jacobian[rows, top] = 1.0 / means[bottom]
    jacobian[rows, bottom] = -score / means[bottom]
    covariance = dataset.covariance[0, 0].values
    return Curve(
        dataset.angle.values[top],
        score,
        jacobian @ covariance @ jacobian.T,
        _passable(dataset, top),
    )
