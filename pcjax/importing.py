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


if TYPE_CHECKING:
    import xarray as xr
else:
    xr = Later("xarray")


def results_meanwhile() -> None:
    """Imports what results need on another thread, while this one waits for trials."""

    def bring() -> None:
        # Xarray looks for dask when it makes its first dataset.
        for name in ("scipy.optimize", "xarray", "dask.array"):
            with suppress(ImportError):
                importlib.import_module(name)

    threading.Thread(target=bring, daemon=True).start()
