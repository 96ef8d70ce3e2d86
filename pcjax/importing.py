"""Modules that are imported when they are first used, since that takes longer than much of what is
asked for; and on another thread meanwhile."""

from __future__ import annotations

import importlib
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
