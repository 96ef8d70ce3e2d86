"""The readings of the paper that its claims are judged under: what its text says, and one that was
found by searching for what its curves need."""

from __future__ import annotations

from dataclasses import dataclass

from pcjax.importing import xr
from pcjax.model.bodies.circle import Circle
from pcjax.model.contact import ContactLaw
from pcjax.model.drives.arm import PlanarArm
from pcjax.model.drives.wrist import WristTilt
from pcjax.model.hand import HandDesign
from pcjax.model.scenario import DIRECTIONS, Scenario
from pcjax.paper import constants as paper


@dataclass(frozen=True)
class Reading:
    """What is left to a reading of the paper's model: how fast things fall, and whether they rub.

    Attributes:
        name: what the command line calls it.
        gravity: g, length / s^2, with lengths as the paper prints them.
        friction: mu, of Coulomb's friction between object and limbs.
        turning: whether a circle turns where it rubs. Sticks always do.
        doubt: what speaks against it; empty if nothing does.
    """

    name: str
    gravity: float
    friction: float
    turning: bool
    doubt: str = ""

    def __str__(self) -> str:
        circles = "" if self.turning else ", circles that do not turn"
        return f"gravity {self.gravity:g}, friction {self.friction:g}{circles}"

    def wrist(self) -> WristTilt:
        """The wrist of Sec. 3.3."""
        return WristTilt(gravity=self.gravity)

    def arm(self) -> PlanarArm:
        """The arm of Sec. 3.6."""
        return PlanarArm(gravity=self.gravity)

    def law(self) -> ContactLaw:
        """The contact law of Sec. 2, with friction."""
        return ContactLaw(friction=self.friction)

    def circle(self, radius: float) -> Circle:
        """The paper's object."""
        return Circle(radius, turns=self.turning)


LITERAL = Reading("literal", paper.GRAVITY, 0.0, True)
"""What the text says: g = 9.8 with L_p = 500 (Secs. 3.2 and 3.3.1), no friction (Sec. 2.1)."""

RUBBING = Reading(
    "rubbing",
    98.0,
    0.35,
    False,
    "It contradicts Sec. 2.1, which rules friction out, and was found by a search for what the "
    "paper's curves need.",
)
"""A puck that rubs without rolling, and falls ten times as fast: found to bring the peaks of
Fig. 9(b) near the paper's, which nothing that agrees with its text was found to do."""

READINGS = {reading.name: reading for reading in (LITERAL, RUBBING)}
"""By name; the literal one is what is meant where none is named."""


def rubbing_wrist(hand: HandDesign, radius: float, direction: str = "does") -> Scenario:
    """The wrist of Sec. 3.3 under the reading `RUBBING`: gravity 98, friction 0.35, a circle that
    does not turn. It contradicts Sec. 2.1 and was found by search.

    Arguments:
        hand: the design.
        radius: r_o, a length.
        direction: "does" or "eoen".

    Examples:
        >>> import pcjax
        >>> from pcjax.paper.readings import rubbing_wrist
        >>> scenario = rubbing_wrist(pcjax.box_hand(), 5.0)
        >>> scenario.law.friction, scenario.drive.gravity, scenario.body.turns
        (0.35, 98.0, False)
    """
    reading = RUBBING
    return DIRECTIONS[direction](hand, reading.circle(radius), reading.wrist(), reading.law())


def reading_of(data: xr.Dataset) -> Reading:
    """The reading of a figure's data; the literal one where files were kept before there were two.

    Raises:
        ValueError: it names one that is not known.
    """
    name = data.attrs.get("reading", LITERAL.name)
    if name not in READINGS:
        raise ValueError(f"reading is {name!r}: it has to be one of {', '.join(READINGS)}")
    return READINGS[name]
