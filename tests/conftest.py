"""Shared by all tests: one folder of compiled programs for the session, nothing kept in the user's
folders, 64-bit arithmetic where it is asked, annotations and dtypes taken at their word."""

from __future__ import annotations

import functools
import os
import tempfile
from collections.abc import Iterator

import jax
import jaxtyping
import pytest

from pcjax.cli.compilation_cache import VARIABLE, use_compilation_cache
from pcjax.compiling import quick_options

# Arguments and results of what computes are held against their annotations, shapes included; a
# whole number is a float, too. What is missing here: `pcjax.geometry`, whose vectors are made by
# the thousand while a program is traced; `design.optimize` and `design.starts`, whose warnings
# count the frames up to their caller; and what people type, which is refused in our own words.
jaxtyping.install_import_hook(
    [
        "pcjax.design.compare",
        "pcjax.design.gradients",
        "pcjax.design.map",
        "pcjax.design.parameters",
        "pcjax.design.search",
        "pcjax.design.space",
        "pcjax.model",
        "pcjax.physics",
        "pcjax.quality",
        "pcjax.simulate",
    ],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)

# No dtype is made another one unasked: not here, and not in the commands that tests run.
os.environ["JAX_NUMPY_DTYPE_PROMOTION"] = "strict"
jax.config.update("jax_numpy_dtype_promotion", "strict")

_PROGRAMS = None
if "PYTEST_XDIST_WORKER" not in os.environ:
    # Workers, and the commands that tests run, inherit the variable.
    _PROGRAMS = tempfile.TemporaryDirectory(prefix="pcjax-tests-")
    os.environ[VARIABLE] = _PROGRAMS.name
use_compilation_cache()


def pytest_unconfigure() -> None:
    """Workers have ended by now."""
    if _PROGRAMS is not None:
        _PROGRAMS.cleanup()


@pytest.fixture(scope="module")
def quick_programs() -> Iterator[None]:
    """Compiles a module's programs in a third of the time, to run for a moment: for what is said
    and written about trials. How they go is tested with the programs that users run."""
    from pcjax.simulate import workers  # after the hook above

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "_COMPILER_OPTIONS", {"cpu": quick_options()})
        patch.setattr(jax, "jit", functools.partial(jax.jit, compiler_options=quick_options()))
        workers.advance_for.cache_clear()
        yield
    workers.advance_for.cache_clear()


@pytest.fixture
def programs_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has processes that use the library, not the command, share the session's programs as well."""
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", os.environ[VARIABLE])
    monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Lets a test pass what annotations forbid, as users can."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture
def x64() -> Iterator[None]:
    """64-bit numbers for the duration of a test."""
    with jax.enable_x64(True):
        yield
