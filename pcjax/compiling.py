"""How programs are compiled, and kept for the next process where somebody wants that."""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import pickle
import platform
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol, TypeVar

import jax
import jaxlib.version
import numpy as np
from jax.experimental import serialize_executable

R = TypeVar("R")


class Shelf(Protocol):
    """Where compiled programs are kept."""

    def get(self, key: str) -> bytes | None:
        """What is kept under a key; None if there is nothing, or it is damaged."""
        ...

    def put(self, key: str, value: bytes) -> None:
        """Keeps something.

        Raises:
            OSError: it cannot be written.
        """
        ...

    def aside(self) -> AbstractContextManager[None]:
        """JAX looks nothing up and keeps nothing meanwhile, on this thread: a program that it had
        kept cannot be kept once more."""
        ...


_shelf: Shelf | None = None


def keep_on(shelf: Shelf | None) -> None:
    """Where `Kept` programs of this process are looked for and kept; None for nowhere."""
    global _shelf
    _shelf = shelf


_rewritten = False


def keep_nothing() -> None:
    """From now on this process looks for no program and keeps none: for when what is compiled no
    longer depends on this package's sources and the arguments alone."""
    global _rewritten
    _rewritten = True


class Kept:
    """`jax.jit` of a function, whose programs may be kept: then a later process traces nothing.

    What is kept is the compiler's own: it is found only by the same sources of this package, with
    the same versions, settings and processor, for arguments of the same structure, shapes and
    types. Of functions and classes that are none of this package's nothing is kept.

    Arguments:
        function: of pytrees.
        options: the compiler's.
    """

    def __init__(self, function: Callable[..., Any], options: Mapping[str, Any]):
        self._function = function
        self._options = dict(options)
        self._usual = jax.jit(function, compiler_options=self._options)
        self._known: dict[Any, Callable[[list[Any]], Any] | None] = {}
        self._lock = threading.Lock()

    @property
    def count(self) -> int:
        """How many programs this process has of it."""
        usual: Any = self._usual
        return sum(map(bool, self._known.values())) + usual._cache_size()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        shelf = _shelf
        if shelf is None or _rewritten or jax.default_backend() != "cpu":
            return self._usual(*args, **kwargs)
        leaves, structure = jax.tree.flatten((args, kwargs))
        kinds = tuple((np.shape(leaf), *_type_of(leaf)) for leaf in leaves)
        known = structure, kinds, bool(jax.config.values["jax_enable_x64"])
        with self._lock:
            if known not in self._known:
                ours = _is_named(self._function) and _is_ours(structure)
                self._known[known] = self._program(shelf, leaves, known) if ours else None
            program = self._known[known]
        return self._usual(*args, **kwargs) if program is None else program(leaves)

    def _program(self, shelf: Shelf, leaves: list[Any], known: Any) -> Any:
        """From the shelf, where it has been seen to run; or compiled and put there."""
        which = f"{self._function.__module__}.{self._function.__qualname__}"
        described = repr((which, sorted(self._options.items()), known, _surroundings()))
        key = f"{self._function.__name__}-{hashlib.sha256(described.encode()).hexdigest()}"
        structure = known[0]
        kept = shelf.get(key)
        if kept is not None:
            try:
                content, found = pickle.loads(kept)
                run = serialize_executable.deserialize_and_load(*content)
                jax.block_until_ready(run(leaves))
                return functools.partial(_called, run, jax.tree.structure(found))
            except Exception:
                # Whatever is wrong with it, it can be compiled.
                pass
        result = None

        @functools.wraps(self._function)
        def flat(leaves: list[Any]) -> list[Any]:
            nonlocal result
            args, kwargs = jax.tree.unflatten(structure, leaves)
            out, result = jax.tree.flatten(self._function(*args, **kwargs))
            return out

        with shelf.aside():
            compiled = jax.jit(flat, compiler_options=self._options).lower(leaves).compile()
        assert result is not None
        found = jax.tree.unflatten(result, range(result.num_leaves))
        try:
            content = pickle.dumps((serialize_executable.serialize(compiled), found))
            shelf.put(key, content)
        except (OSError, ValueError, TypeError, pickle.PicklingError):
            pass  # then the next process compiles it
        return functools.partial(_called, compiled, result)


def _is_named(function: Callable[..., Any]) -> bool:
    """Whether a function's name says which one it is: one of a module of this package."""
    module = sys.modules.get(function.__module__)
    found = getattr(module, function.__qualname__, None)
    ours = function.__module__.partition(".")[0] == __name__.partition(".")[0]
    return ours and found is not None and inspect.unwrap(found) is function


def _called(run: Any, result: Any, leaves: list[Any]) -> Any:
    return jax.tree.unflatten(result, run(leaves))


def _type_of(leaf: Any) -> tuple[str, bool]:
    """The type of an argument, and whether it gives way to others'."""
    if isinstance(leaf, (bool, int, float)):
        return type(leaf).__name__, True
    return str(leaf.dtype), bool(getattr(leaf, "weak_type", False))


def _is_ours(structure: Any) -> bool:
    """Whether a pytree is made of this package's classes and built-in ones alone."""
    data = structure.node_data()
    if data is not None:
        module = data[0].__module__.partition(".")[0]
        if module not in (__name__.partition(".")[0], "builtins"):
            return False
    return all(map(_is_ours, structure.children()))


@functools.cache
def _surroundings() -> str:
    """Everything that a compiled program depends on beside its arguments."""
    package = Path(__file__).parent
    sources = [
        (str(path.relative_to(package)), (facts := path.stat()).st_size, facts.st_mtime_ns)
        for path in sorted(package.rglob("*.py"))
    ]
    settings = {name: value for name, value in jax.config.values.items() if "cache" not in name}
    settings.pop("jax_enable_x64", None)
    settings.pop("jax_default_device", None)
    return repr(
        (
            sources,
            sorted((name, repr(value)) for name, value in settings.items()),
            os.environ.get("XLA_FLAGS"),
            (jax.__version__, jaxlib.version.__version__, np.__version__, sys.version),
            (platform.platform(), _processor()),
        )
    )


def _processor() -> str:
    """What the processor is and can do."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    wanted = ("model name", "flags", "Features", "CPU part")
    return "\n".join(dict.fromkeys(line for line in lines if line.startswith(wanted)))


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
        if static:
            return jax.jit(function, compiler_options=quick_options(), **static)
        return Kept(function, quick_options())

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> R:
        return program()(*args, **kwargs)

    return call
