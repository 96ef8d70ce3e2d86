"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pcjax.importing import xr
from pcjax.results.files import sealed


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A new file beside `path` that takes its place once the block is done: whole or not at all.

    Where `path` is a link, what it leads to is replaced.

    Raises:
        OSError: it cannot be written; the error names `path`.
    """
    path = path.resolve() if path.is_symlink() else path
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    mask = os.umask(0)
    os.umask(mask)
    try:
        yield Path(name)
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, path)
    except BaseException as error:
        os.unlink(name)
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise


def save_dataset(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Writes netCDF, sealed; a file of that name is replaced only once the new one is complete.

    Raises:
        OSError: the file cannot be written.
    """
    path = Path(path)
    compress = {name: {"zlib": True, "complevel": 9} for name, var in dataset.items() if var.ndim}
    with replacing(path) as unfinished:
        dataset.to_netcdf(unfinished, engine="h5netcdf", encoding=compress)
        unfinished.write_bytes(sealed(unfinished.read_bytes()))
    return path


def save_text(text: str, path: Path) -> None:
    """Writes a text file; one of that name is replaced only once the new one is complete."""
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8", newline="\n")
