"""Where the circle meets the limbs: eqs (3)-(6)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from pcjax.planar import Flag, Scalar, Segment, T, Vec, fence, unit_and_length, where


class Contact(eqx.Module):
    """What the circle's centre sees of one limb.

    Attributes:
        offset: from the limb's closest point to the centre.
        round: whether that point is an end of the limb (6) and not inside it (4), (5): whether the
            surface at radius r_o around it is round or flat.
        limb: the limb.
    """

    offset: Vec
    round: Flag
    limb: Segment

    def after(self, move: Vec) -> tuple[Vec, Scalar]:
        """Unit normal (limb to centre) and distance once the centre has moved by `move`.

        Exact as long as the closest point stays inside the limb, or stays its end.
        """
        normal, distance = unit_and_length(self.offset)
        flat = normal * normal.dot(move)
        moved, length = unit_and_length(self.offset + move)
        return (
            where(self.round, moved, normal),
            jnp.where(self.round, length, distance + flat.dot(normal)),
        )


def two_nearest(limbs: Sequence[Segment], centre: Vec, one: Scalar) -> tuple[Contact, Contact]:
    """The contacts with the limb nearest to the centre and the second nearest.

    A joint counts for the limb that ends there (the palm, first in `limbs`, counts both its ends),
    so the two never stand for one and the same joint.

    The search runs on squared distances whose lowest bits hold the limb's number. Their minimum
    carries all that is needed, which compiles to one short loop where a chain of selects over
    distances and offsets makes dozens. It leaves undecided only distances that agree to a
    millionth (float32), where either limb will do.
    """
    tag_bits = math.ceil(math.log2(2 * len(limbs)))
    keys = [_key(limb, centre, number, tag_bits) for number, limb in enumerate(limbs)]
    first, second = jnp.minimum(keys[0], keys[1]), jnp.maximum(keys[0], keys[1])
    for key in keys[2:]:
        second = jnp.minimum(second, jnp.maximum(first, key))
        first = jnp.minimum(first, key)

    def contact(key: Scalar) -> Contact:
        tag = bits(fence(key, one)) & ((1 << tag_bits) - 1)
        limb = pick(limbs, tag >> 1)
        offset = limb.offset(centre)
        return Contact(Vec(fence(offset.x, one), fence(offset.y, one)), (tag & 1) != 0, limb)

    return contact(first), contact(second)


def _key(limb: Segment, centre: Vec, number: int, tag_bits: int) -> Scalar:
    """The squared distance to a limb; its lowest bits are the limb's number and `round`."""
    relative = jax.lax.stop_gradient(centre - limb.start)
    tangent, length = jax.lax.stop_gradient((limb.tangent, limb.length))
    along = relative.dot(tangent)
    across = relative.cross(tangent)
    beyond = along - jnp.clip(along, 0.0, length)
    # The tiny term keeps the key a normal number whatever its lowest bits.
    square = beyond * beyond + (across * across + 1e-30)
    if number > 0:
        square = jnp.where(along < 0, 1e30, square)
    tag = jnp.where(beyond != 0, 2 * number + 1, 2 * number)
    marked = (bits(square) & ~((1 << tag_bits) - 1)) | tag.astype(bits(square).dtype)
    return jax.lax.bitcast_convert_type(marked, square.dtype)


def bits(value: Scalar) -> Array:
    integer = {4: jnp.int32, 8: jnp.int64}[jnp.result_type(value).itemsize]
    return jax.lax.bitcast_convert_type(value, integer)


def pick(items: Sequence[T], number: Scalar) -> T:
    """items[number] for a traced number, as selects; the last one beyond the end."""

    def choose(*leaves: Scalar) -> Scalar:
        chosen = leaves[-1]
        for k, leaf in enumerate(leaves[:-1]):
            chosen = jnp.where(number == k, leaf, chosen)
        return chosen

    return jax.tree.map(choose, *items)
