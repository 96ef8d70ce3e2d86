"""Modules that are imported when they are first used, since that takes longer than much of what is
asked for; and on another thread meanwhile."""

from __future__ import annotations

import importlib
import importlib.util
import os
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any


class Later:
    """Stands for a module, which is imported when something of it is first used."""

    def __init__(self, name: str):
        self._name = name

    def __getattr__(self, name: str) -> Any:
        return getattr(importlib.import_module(self._name), name)


def named(name: str) -> Any:
    """What has that name in this package, "module.name", imported now."""
    module, _, last = name.rpartition(".")
    return getattr(importlib.import_module(f"pcjax.{module}"), last)


if TYPE_CHECKING:
    import xarray as xr
else:
    xr = Later("xarray")


def results_meanwhile(*, kept: bool) -> None:
    """Imports what results need on another thread, while this one waits for trials; more of it
    where they are kept or drawn."""
    # Xarray looks for dask when it makes its first dataset.
    names = ("scipy.optimize", *(("xarray", "dask.array") if kept else ()))

    def bring() -> None:
        for name in names:
            with suppress(ImportError):
                importlib.import_module(name)

    threading.Thread(target=bring, daemon=True).start()


RENDERING = (
    "pictures need EGL (on Debian and Ubuntu apt-get install libegl1 libgl1-mesa-dri), or "
    "MUJOCO_GL=osmesa and OSMesa (libosmesa6)"
)
"""What pictures of hands in three dimensions are rendered with, and how to get it."""


def mujoco() -> Any:
    """MuJoCo, which simulates hands in three dimensions.

    Raises:
        ValueError: it is not installed, or a version without what is needed.
    """
    install = "pip install 'pcjax[mujoco]'"
    try:
        module = importlib.import_module("mujoco")
        importlib.import_module("mujoco.batch")
    except ImportError:
        older = importlib.util.find_spec("mujoco") is not None
        problem = "needs MuJoCo 3.17 or later" if older else "needs MuJoCo"
        raise ValueError(f"a hand in three dimensions {problem}: {install}") from None
    except (AttributeError, OSError, RuntimeError):  # of what MUJOCO_GL asks for
        asked = os.environ.get("MUJOCO_GL", "")
        raise ValueError(f"MuJoCo cannot be used with MUJOCO_GL={asked}: {RENDERING}") from None
    if module.__version__ == "4.0.0":  # its contact solver is wrong for sparse Jacobians
        raise ValueError(f"MuJoCo 4.0.0 solves contacts wrongly, take another version: {install}")
    return module
