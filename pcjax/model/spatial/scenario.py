"""A scenario in three dimensions: a hand in its posture, an object, a tilt, a contact law."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from pcjax.checks import check_kind
from pcjax.model.contact import ContactLaw
from pcjax.model.scenario import Scenario
from pcjax.model.spatial.bodies import Solid, SpatialBody
from pcjax.model.spatial.frozen import FrozenHand, frozen
from pcjax.model.spatial.hand import SpatialHand
from pcjax.model.spatial.scene import Scene, clearances
from pcjax.model.spatial.tilt import SpatialTilt


class MisfitError(ValueError):
    """A hand that is none, or that the object does not fit in at its start.

    Attributes:
        short: what is wrong, in a few words that do not depend on numbers.
    """

    def __init__(self, short: str, message: str):
        super().__init__(message)
        self.short = short


class SpatialScenario(Scenario):
    """One condition in three dimensions: everything but the random draws, the limit and the step.

    Arguments:
        hand: in its posture.
        body: the object.
        drive: what tilts the hand.
        law: restitution and friction.
        mirrored: whether the object has to enter: then the fingertips are mirrored in the opening,
            and everything is seen in that mirror (see `eoen`).

    Raises:
        TypeError: something that is no hand, object, tilt or contact law of these.
        ValueError: a contact law of other kind than MuJoCo's, or EoEn of a hand that has none.
    """

    hand: Any  # a SpatialHand
    body: Any  # a SpatialBody
    drive: Any  # a SpatialTilt
    mirrored: bool = eqx.field(static=True)

    dimensions = 3
    filmed_by = "view.takes.SpatialCamera"

    def __init__(
        self,
        hand: SpatialHand,
        body: SpatialBody,
        drive: SpatialTilt,
        law: ContactLaw | None = None,
        mirrored: bool = False,
    ):
        law = ContactLaw() if law is None else law
        check_spatial(hand, body, drive, law)
        if mirrored and (problem := why_no_spatial_eoen(hand)):
            raise ValueError(
                f"EoEn is not defined for this hand: {problem}; evaluate with direction 'does'"
            )
        self.hand = hand
        self.body = body
        self.drive = drive
        self.law = law
        self.start_spread = 0.0
        self.mirrored = mirrored

    @property
    def draws_for_start(self) -> int:
        """How many draws a trial's first state takes."""
        return self.hand.start.draws

    def seen(self) -> FrozenHand:
        """The hand's geoms as the object meets them."""
        given = frozen(self.hand)
        if not self.mirrored:
            return given
        return given.mirrored(self.hand.fingertips, *self.hand.escape.opening)

    def thinnest(self) -> tuple[str, float]:
        """What is thinnest of all that may run against each other, the hand's geoms and the object,
        and half of its thickness, m."""
        geom, own = self.seen().thinnest, self.body.solid().half_thickness
        if own < geom.solid.half_thickness:
            return "the object", own
        return geom.name, geom.solid.half_thickness

    def pull(self, angles: Float[np.ndarray, "trials 2"]) -> Float[np.ndarray, "trials 3"]:
        """Gravity for angles T1 and T2, as the object feels it, m / s^2."""
        pull = self.drive.pull(angles)
        if self.mirrored:
            _, normal = self.hand.escape.opening
            pull = pull - 2 * np.outer(pull @ normal, normal)
        return pull

    def inside(self) -> Float[np.ndarray, "planes 4"]:
        """Planes of the region that the object escapes from: a x + b y + c z + d <= 0 inside."""
        seen, opening = self.seen(), self.hand.escape.opening
        reach = 0.0 if opening is None else seen.reach(self.hand.fingertips, *opening)
        return self.hand.escape.planes(seen.hull, self.body.radius, reach)

    def scene(self, dt: float) -> Scene:
        """The hand with the object in it, as MuJoCo simulates it in steps of `dt` seconds."""
        friction = 0.0 if self.law.friction is None else float(self.law.friction)
        return Scene(self.seen(), self.drawn_solid(), float(self.law.restitution), friction, dt)

    def drawn_solid(self) -> Solid:
        """The object's shape, for EoEn in the mirror."""
        solid = self.body.solid()
        if self.mirrored and solid.vertices is not None:
            solid = replace(solid, vertices=solid.vertices * [1.0, 1.0, -1.0])
        return solid

    def attitude(self, angles: Float[np.ndarray, "2"]) -> Float[np.ndarray, "3 3"]:
        """What takes directions in the hand's frame to a world in which gravity points along -z,
        for angles T1 and T2."""
        turned = self.drive.attitude(angles)
        if self.mirrored:
            _, normal = self.hand.escape.opening
            flip = np.eye(3) - 2 * np.outer(normal, normal)
            turned = np.diag([-1.0, 1.0, 1.0]) @ turned @ flip
        return turned

    def check(self) -> float:
        """Checks the hand and the starts; a gap is not known of a hand in three dimensions.

        Raises:
            MisfitError: geoms overlap in the posture, or the object does not fit at its starts, or
                they are not in the region that it escapes from.
        """
        hand = frozen(self.hand)
        if hand.overlap > 0:
            a, b = hand.overlapping
            raise MisfitError(
                "geoms overlap",
                f"{a} and {b} overlap in this posture, by {1000 * hand.overlap:.3g} mm more than "
                "they may: change a joint",
            )
        corners, start = self.hand.start.corners(), self.hand.start
        planes = self.inside()
        outside = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        if outside.max() > 0:
            x, y, z = corners[np.argmax(outside)]
            raise MisfitError(
                "a start is outside of the hand",
                f"the start at ({x:.4g}, {y:.4g}, {z:.4g}) m is not inside of what the hand holds: "
                "the object would have escaped already; change the start's centre or spread",
            )
        room = clearances(self.seen(), self.body.solid(), start)
        if room.min() < -1e-6:
            x, y, z = corners[np.argmin(room)]
            raise MisfitError(
                "no room for the object at a start",
                f"the {self.body.noun} {self.body.size_in_words()} does not fit at its start at "
                f"({x:.4g}, {y:.4g}, {z:.4g}) m: it overlaps the hand by "
                f"{-1000 * room.min():.3g} mm; change the start's centre or spread, or take a "
                "smaller object",
            )
        return float("nan")

    def places(self) -> dict[str, Any]:
        """What a picture in the plane needs: nothing."""
        return {}

    def sizes(self) -> dict[str, Any]:
        """What results keep of the object's and the hand's sizes, and of the hand's file."""
        return {
            "radius": self.body.radius,
            "object_width": self.body.width,
            "hand_digest": self.hand.digest,
        }


def check_spatial(hand: Any, body: Any, drive: Any, law: Any) -> None:
    """
    Raises:
        TypeError: one of them is something else, such as what is in the plane.
        ValueError: a contact law that MuJoCo has not.
    """
    check_kind("hand", hand, SpatialHand)
    check_kind("body", body, SpatialBody)
    check_kind("drive", drive, SpatialTilt)
    check_kind("law", law, ContactLaw)
    if law.drag is not None or law.smoothing is not None:
        raise ValueError(
            "contact in three dimensions has restitution and friction: drag and smoothing are for "
            "hands in the plane"
        )


def why_no_spatial_eoen(hand: SpatialHand) -> str:
    """Why ease of entering is not defined for a hand; "" where it is."""
    if hand.escape.opening is None:
        return "it is left through a hull, which has no opening that it could be entered by"
    if not hand.fingertips:
        return "it does not say which of its parts are fingertips"
    return ""
