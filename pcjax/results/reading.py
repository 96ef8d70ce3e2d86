"""Kept results are read with distrust: whole, of a size that can be, and what a result can hold."""

from __future__ import annotations

import os
from pathlib import Path

from pcjax.importing import xr
from pcjax.results.checking import check_dataset
from pcjax.results.files import read_plain, unsealed
from pcjax.results.netcdf import message_of, read_netcdf, try_netcdf
from pcjax.results.upgrade import upgraded

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def load_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Reads a result of any kind and version, and believes nothing that it says of itself.

    Returns:
        It as this version writes it; its attribute `kind` says what it is.

    Raises:
        ValueError: there is none, it is damaged, or it holds what no result can; in one line.
    """
    path = Path(path)
    kept = read_plain(path)
    try:
        if not kept.startswith(_SIGNATURE):
            raise ValueError("it is no netCDF (HDF5)")
        if unsealed(kept) is None:
            # Other programs' files have no seal, nor had ours at first: they end where they say.
            if _told_end(kept) != len(kept):
                raise ValueError("it has been cut short or changed")
            try_netcdf(path)
        data = read_netcdf(path)
        if not str(data.attrs.get("made_by", "")).startswith("pcjax"):
            raise ValueError("pcjax did not make it")
        data = upgraded(data)
        check_dataset(data)
    except Exception as error:  # of every kind, where HDF5 and its wrappers meet damage
        raise ValueError(f"{path} is no result that can be read: {message_of(error)}") from None
    return data


def _told_end(kept: bytes) -> int:
    """Where an HDF5 file's first lines say that it ends."""
    place = 40 if kept[8] < 2 else 28
    return int.from_bytes(kept[place : place + 8], "little")
