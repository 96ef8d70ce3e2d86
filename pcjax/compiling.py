"""How programs are compiled that run for a moment."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

import jax

R = TypeVar("R")


@functools.cache
def quick_options() -> dict[str, Any]:
    """Compiler options: a third of the time to compile, and several times as long to run.

    They are the compiler's own, and come and go with its versions; those that it refuses are left
    out.
    """
    known: dict[str, Any] = {}
    wanted = {"xla_backend_optimization_level": 0}, {"xla_cpu_use_fusion_emitters": False}
    for option in wanted:
        try:
            jax.jit(lambda x: x, compiler_options=option).lower(0.0).compile()
        except jax.errors.JaxRuntimeError:
            continue
        known |= option
    return known


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

    @functools.cache
    def program() -> Any:  # asked for in the first call: nothing is compiled on import
        return jax.jit(function, compiler_options=quick_options(), **static)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> R:
        return program()(*args, **kwargs)

    return call
