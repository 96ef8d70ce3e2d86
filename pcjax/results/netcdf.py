"""NetCDF is read: in a process of its own at first where nobody vouches for a file, for damage can
make HDF5 loop for ever or crash. Run as a program, this file is that process."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py

from pcjax.importing import xr

PATIENCE = 30.0
"""Seconds for that process, and as many again for each 100 MB."""

_DENSEST = 2 * 1032
"""Bytes that a result declares, at most, for each byte of its file: deflate makes 1032 of one, and
a dimension without labels declares as much as the widest of its data without storing any."""


def read_netcdf(path: Path) -> xr.Dataset:
    """A file's dataset.

    Raises:
        ValueError: more is declared than the file can hold.
        Exception: of any kind, where HDF5 and its wrappers meet damage.
    """
    sizes = []

    def add(_: str, found: Any) -> None:
        if isinstance(found, h5py.Dataset):
            sizes.append(math.prod(found.shape or ()) * found.dtype.itemsize)
        sizes.extend(found.attrs.get_id(name).get_storage_size() for name in found.attrs)

    with h5py.File(path, "r") as file:
        add("", file)
        file.visititems(add)
    if sum(sizes) > _DENSEST * path.stat().st_size:
        raise ValueError(f"it declares {sum(sizes):,} bytes, more than a file of its size holds")
    return xr.load_dataset(path, engine="h5netcdf")


def try_netcdf(path: Path) -> None:
    """Reads a file in a process of its own.

    Raises:
        ValueError: it cannot be read.
    """
    patience = PATIENCE * (1 + path.stat().st_size / 1e8)
    try:
        done = subprocess.run(
            # -P: what stands beside this file is no top-level module.
            [sys.executable, "-P", __file__, str(path)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            timeout=patience,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"HDF5 has not come to an end in {patience:.0f} s") from None
    if done.returncode:
        raise ValueError(done.stdout or "HDF5 has crashed")


def message_of(error: Exception) -> str:
    """An error as a line; those that are not ours with their kind."""
    text = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
    return " ".join(text.split())


if __name__ == "__main__":
    try:
        read_netcdf(Path(sys.argv[1]))
    except Exception as error:
        sys.stdout.buffer.write(message_of(error).encode(errors="backslashreplace"))
        sys.exit(1)
