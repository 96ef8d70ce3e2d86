"""A study file: a hand and what it has to hold, as TOML."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcjax import paper
from pcjax.checks import did_you_mean
from pcjax.model.arm import PlanarArm
from pcjax.model.body import Circle, Stick
from pcjax.model.contact_law import ContactLaw
from pcjax.model.drive import WristTilt
from pcjax.model.hand import HandDesign


@dataclass(frozen=True)
class Study:
    """A hand, its object, its drive and the contact law."""

    hand: HandDesign
    body: Circle | Stick
    drive: WristTilt | PlanarArm
    law: ContactLaw

    def to_toml(self) -> str:
        """The study as a file's text; lengths in model units, angles in degrees."""
        hand, body = self.hand, self.body
        lengths = [[float(x) for x in row] for row in hand.lengths]
        angles = [[_tidy(math.degrees(float(x))) for x in row] for row in hand.angles]
        stick = isinstance(body, Stick)
        lines = [
            "[hand]",
            f"palm_length = {float(hand.palm_length)!r}",
            "# Of finger 1 and 2, from the palm outwards: the limbs, and the joints before them.",
            f"lengths = {lengths}",
            f"angles_deg = {angles}",
            "",
            "[body]",
            f'kind = "{"stick" if stick else "circle"}"',
            f"radius = {float(body.radius)!r}" + ("     # half length" if stick else ""),
        ]
        if isinstance(body, Stick):
            lines.append(f"orientation_deg = {_tidy(math.degrees(float(body.orientation)))!r}")
        lines += [
            "",
            "[drive]",
            f'kind = "{"wrist" if isinstance(self.drive, WristTilt) else "arm"}"',
            f"gravity = {float(self.drive.gravity)!r}",
            "",
            "[contact]",
            f"restitution = {float(self.law.restitution)!r}",
        ]
        return "\n".join(lines) + "\n"


def _tidy(degrees: float) -> float:
    return round(degrees, 9)


def load_study(path: str | os.PathLike[str]) -> Study:
    """Reads a study file.

    Raises:
        ValueError: no such file, no TOML, an unknown or missing key, or a value that does not do.

    Examples:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import pcjax
        >>> text = '''
        ... [hand]
        ... palm_length = 400
        ... lengths = [[350, 120, 90], [300, 140, 60]]
        ... angles_deg = [[90, 90, 75], [80, 95, 50]]
        ... '''
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / "own.toml"
        ...     _ = path.write_text(text)
        ...     study = pcjax.load_study(path)
        >>> study.body.radius  # 0.05 L_p unless said
        20.0
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path} does not exist") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path} is no TOML: {error}") from None
    reader = _Reader(path, data)
    reader.known("", data, ("hand", "body", "drive", "contact"))
    try:
        return reader.study()
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f"{path}: {text}") from None


class _Reader:
    def __init__(self, path: Path, data: Mapping[str, Any]):
        self.path, self.data = path, data

    def study(self) -> Study:
        hand = self.table("hand", ("palm_length", "lengths", "angles_deg"))
        rows = {key: self.rows(hand, key) for key in ("lengths", "angles_deg")}
        length = self.number("hand", hand, "palm_length")
        angles = [tuple(math.radians(x) for x in row) for row in rows["angles_deg"]]
        lengths = [tuple(row) for row in rows["lengths"]]
        design = HandDesign(length, (lengths[0], lengths[1]), (angles[0], angles[1]))
        drive = self.table("drive", ("kind", "gravity"))
        kind = self.word("drive", drive, "kind", ("wrist", "arm"), "wrist")
        gravity = self.number("drive", drive, "gravity", paper.GRAVITY)
        body = self.table("body", ("kind", "radius", "orientation_deg"))
        shape = self.word("body", body, "kind", ("circle", "stick"), "circle")
        usual = 0.05 * length if kind == "wrist" else paper.ARM_RADIUS
        radius = self.number("body", body, "radius", usual)
        if shape == "circle" and "orientation_deg" in body:
            raise ValueError("[body] orientation_deg does not apply to a circle")
        angle = math.radians(self.number("body", body, "orientation_deg", 0.0))
        contact = self.table("contact", ("restitution",))
        restitution = self.number("contact", contact, "restitution", paper.RESTITUTION)
        return Study(
            design,
            Circle(radius) if shape == "circle" else Stick(radius, angle),
            WristTilt(gravity=gravity) if kind == "wrist" else PlanarArm(gravity=gravity),
            ContactLaw(restitution=restitution),
        )

    def known(self, where: str, table: Mapping[str, Any], names: tuple[str, ...]) -> None:
        for key in table:
            if key not in names:
                raise ValueError(
                    f"{self.path}: unknown key {where}{key}: {did_you_mean(key, names)}"
                    f"there {'are' if len(names) > 1 else 'is'} {', '.join(names)}"
                )

    def table(self, name: str, keys: tuple[str, ...]) -> Mapping[str, Any]:
        found = self.data.get(name, {})
        if not isinstance(found, dict):
            raise ValueError(f"{self.path}: {name} has to be a table, [{name}]")
        self.known(f"[{name}] ", found, keys)
        return found

    def number(
        self, where: str, table: Mapping[str, Any], key: str, default: float | None = None
    ) -> float:
        value = table.get(key, default)
        if value is None:
            raise ValueError(f"[{where}] {key} is missing")
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be a number")
        return float(value)

    def word(
        self,
        where: str,
        table: Mapping[str, Any],
        key: str,
        names: tuple[str, ...],
        default: str,
    ) -> str:
        value = table.get(key, default)
        if value not in names:
            raise ValueError(f"[{where}] {key} is {value!r}: it has to be {' or '.join(names)}")
        return value

    def rows(self, table: Mapping[str, Any], key: str) -> list[list[float]]:
        value = table.get(key)
        if value is None:
            raise ValueError(f"[hand] {key} is missing")
        good = isinstance(value, list) and len(value) == 2
        good = good and all(isinstance(row, list) for row in value)
        if not good or any(
            isinstance(x, bool) or not isinstance(x, (int, float)) for row in value for x in row
        ):
            raise ValueError(
                f"[hand] {key} is {value!r}: it has to be two lists of numbers, one for each finger"
            )
        return [[float(x) for x in row] for row in value]
