"""How programs are compiled that run for a moment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import jax

R = TypeVar("R")

QUICKLY = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
"""Compiler options: a third of the time to compile, and several times as long to run."""


def roomy_size(count: int, least: int) -> int:
    """The first of `least`, 4 `least`, 16 `least`, ... that is `count` or more, for what is padded:
    few sizes are few programs to compile."""
    while least < count:
        least *= 4
    return least


def compiled_quickly(function: Callable[..., R], **static: Any) -> Callable[..., R]:
    """`jax.jit` for what is called a few times, and not from within other compiled functions.

    Arguments:
        function: what to compile.
        static: which arguments are static, as `jax.jit` has it.
    """
    return cast(Callable[..., R], jax.jit(function, compiler_options=QUICKLY, **static))
