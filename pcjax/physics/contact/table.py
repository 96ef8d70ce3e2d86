"""Which function deals with the contacts of which kind of body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from pcjax.compiling import keep_nothing
from pcjax.model.bodies.base import Body
from pcjax.model.bodies.circle import Circle
from pcjax.model.bodies.stick import Stick
from pcjax.physics.contact.circle import move_circle
from pcjax.physics.contact.rod import move_stick
from pcjax.physics.state import State

Contact = Callable[..., State]
"""A body's part of a step: what limbs do to its free motion, and whether it has passed.

It is called with the body; the world (limbs, goal, drive and contact law); the state before the
step; the centre's free motion over the step; the step, s; and a 1 for `pcjax.geometry.fence`. It
gives the state after the step, from `pcjax.physics.state.judge`.
"""

CONTACTS: dict[type[Body], Contact] = {Circle: move_circle, Stick: move_stick}
"""By kind of body."""

F = TypeVar("F", bound=Callable[..., Any])


def register_contact(kind: type[Body]) -> Callable[[F], F]:
    """Adds the function (see `Contact`) for a kind of body, as a decorator."""

    def add(function: F) -> F:
        if kind in CONTACTS:
            keep_nothing()
        CONTACTS[kind] = function
        return function

    return add


def registered_contact(body: Body) -> Contact | None:
    """The function for a body: that of its class, or of the nearest one it is derived from; None if
    there is none."""
    return next((CONTACTS[kind] for kind in type(body).__mro__ if kind in CONTACTS), None)


def contact_of(body: Body) -> Contact:
    """The function for a body (see `registered_contact`).

    Raises:
        TypeError: there is none.
    """
    found = registered_contact(body)
    if found is None:
        raise TypeError(
            f"nothing says how a {type(body).__name__} moves: register a function with "
            "pcjax.physics.contact.table.register_contact"
        )
    return found
