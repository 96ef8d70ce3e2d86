"""The pushes that several contacts need at once: which of them push, and by how much.

With their directions of unit length, what pushes along one contact do to another is a cosine, and
the pushes that a set of contacts needs follow from a small system of linear equations.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from pcjax.geometry import Flag, Scalar, fence_all

NOT_NEEDED = -1e30
"""What a contact that is off needs."""

Pairs = Mapping[tuple[int, int], Scalar]
"""A symmetric table without its diagonal: a number for each pair (a, b), a < b."""


def all_pairs(count: int) -> list[tuple[int, int]]:
    return list(itertools.combinations(range(count), 2))


def least_pushes(
    cosines: Pairs,
    need: Sequence[Scalar],
    barrier: Scalar,
    exactly: Sequence[Flag] | None = None,
) -> list[Scalar]:
    """The least pushes along the normals, none negative, that give each contact what it needs.

    `cosines @ pushes >= need`, with equality where a push is not 0: the projection onto a cone of
    half-spaces in three dimensions. It is found by cases: of all sets of up to three contacts, the
    one whose solution pulls at none and leaves none out.

    Arguments:
        cosines: between the normals.
        need: by contact; NOT_NEEDED where it is off.
        barrier: a 1 for `fence`.
        exactly: which contacts are to get what they need and no more, by a pull if need be.
    """
    count = len(need)

    def miss(pushes: Mapping[int, Scalar]) -> Scalar:
        """The largest pull, or the most that one outside of the set lacks."""
        worst = 0.0 * need[0]
        for a in range(count):
            if a in pushes:
                wrong = -pushes[a]
                if exactly is not None:
                    wrong = jnp.where(exactly[a], 0.0, wrong)
            else:
                wrong = need[a]
                for b, push in pushes.items():
                    wrong = wrong - cosines[min(a, b), max(a, b)] * push
                if exactly is not None:
                    wrong = jnp.where(exactly[a], jnp.abs(wrong), wrong)
            worst = jnp.maximum(worst, wrong)
        return jax.lax.stop_gradient(worst)

    least, chosen = miss({}), [0.0 * need[0]] * count
    for size in (1, 2, 3):
        for one in itertools.combinations(range(count), size):
            pushes, fine = _solved(cosines, need, one)
            score = jnp.where(fine, miss(pushes), jnp.inf)
            better = score < least
            chosen = [jnp.where(better, pushes.get(a, 0.0), old) for a, old in enumerate(chosen)]
            least = jnp.minimum(score, least)
    chosen = fence_all(chosen, barrier)
    if exactly is None:
        return [jnp.maximum(push, 0.0) for push in chosen]
    return [
        jnp.where(exact, push, jnp.maximum(push, 0.0))
        for exact, push in zip(exactly, chosen, strict=True)
    ]


def _solved(
    cosines: Pairs, need: Sequence[Scalar], one: tuple[int, ...]
) -> tuple[Mapping[int, Scalar], Any]:
    """The pushes that give a set of up to three contacts just what they need; and whether they are
    far enough from being in line."""
    if len(one) == 1:
        return {one[0]: need[one[0]]}, True
    if len(one) == 2:
        a, b = one
        cosine = cosines[a, b]
        left = 1.0 - cosine * cosine
        fine = left > 1e-6
        inverse = 1.0 / jnp.where(fine, left, 1.0)
        pushes = {
            a: (need[a] - cosine * need[b]) * inverse,
            b: (need[b] - cosine * need[a]) * inverse,
        }
        return pushes, fine
    a, b, c = one
    ab, ac, bc = cosines[a, b], cosines[a, c], cosines[b, c]
    left = 1.0 + 2.0 * ab * ac * bc - ab * ab - ac * ac - bc * bc
    fine = left > 1e-5
    inverse = 1.0 / jnp.where(fine, left, 1.0)
    mixed_ab, mixed_ac, mixed_bc = ac * bc - ab, ab * bc - ac, ab * ac - bc
    na, nb, nc = need[a], need[b], need[c]
    pushes = {
        a: ((1.0 - bc * bc) * na + mixed_ab * nb + mixed_ac * nc) * inverse,
        b: (mixed_ab * na + (1.0 - ac * ac) * nb + mixed_bc * nc) * inverse,
        c: (mixed_ac * na + mixed_bc * nb + (1.0 - ab * ab) * nc) * inverse,
    }
    return pushes, fine
