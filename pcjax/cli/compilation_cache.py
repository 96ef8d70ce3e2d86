"""Keeps compiled programs between runs of the command line, in the user's cache folder."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import jax
from jax._src import compilation_cache as jax_cache

from pcjax.compiling import keep_on
from pcjax.results.files import read_plain, sealed, unsealed
from pcjax.results.saving import replacing

VARIABLE = "PCJAX_CACHE"
"""Environment variable: a folder for compiled programs, or "off" to compile anew in every run."""

MOST_BYTES = 300 * 2**20
"""Size of the folder from which on what was written longest ago is removed."""

OLDEST_JAX = (0, 10, 2)
"""Before this version XLA logs errors on stderr when it loads a program on many Intel CPUs."""


def use_compilation_cache() -> None:
    """Configures JAX, for the whole process, to load and keep compiled programs.

    JAX names a program by what is compiled, its own version and the processor's features, so a
    folder may be shared by versions and machines; it may be deleted at any time. Where it cannot
    be used, everything is compiled, in silence. A cache that the user has configured for JAX
    stays as it is.

    JAX runs what it finds, and never replaces an entry: its own cache would keep one that was cut
    short for ever, and a flipped bit in one need not be noticed. Here entries are sealed, and one
    that is damaged is compiled and written anew.
    """
    folder = cache_folder()
    if (
        folder is None
        or jax.config.values["jax_compilation_cache_dir"]
        or jax.__version_info__ < OLDEST_JAX
    ):
        return
    try:
        # Programs in it are run: nobody else should be able to write there.
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return
    if not hasattr(jax_cache, "get_file_cache"):  # a later JAX
        return
    jax_cache.get_file_cache = _file_cache
    # What cannot be read or written is compiled.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
    jax.config.update("jax_compilation_cache_dir", str(folder))
    # A run starts some twenty small programs beside the large one: keep them as well.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    keep_on(SealedCache(folder))


_aside = threading.local()


class _Jaxs:
    """A cache as JAX uses it, which may be told to look away."""

    def __init__(self, cache: SealedCache):
        self._cache = cache

    def get(self, key: str) -> bytes | None:
        return None if getattr(_aside, "value", False) else self._cache.get(key)

    def put(self, key: str, value: bytes) -> None:
        if not getattr(_aside, "value", False):
            self._cache.put(key, value)


class SealedCache:
    """Compiled programs in a folder, as JAX looks them up: whole and undamaged, or not at all."""

    def __init__(self, folder: Path):
        self._path = folder

    def _entry(self, key: str) -> Path:
        return self._path / f"{key}-cache"

    def get(self, key: str) -> bytes | None:
        """A program; None where it has to be compiled."""
        try:
            return unsealed(read_plain(self._entry(key)), key)
        except ValueError:
            return None

    def put(self, key: str, value: bytes) -> None:
        """Keeps a program.

        Raises:
            OSError: it cannot be written.
        """
        with replacing(self._entry(key)) as unfinished:
            unfinished.write_bytes(sealed(value, key))
        self._make_room()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """JAX finds and keeps nothing meanwhile, on this thread."""
        _aside.value = True
        try:
            yield
        finally:
            _aside.value = False

    def _make_room(self) -> None:
        """Removes what was written longest ago where all is more than `MOST_BYTES`."""
        facts = []
        for path in self._path.glob("*-cache"):
            with suppress(OSError):  # another process may be at it as well
                one = path.stat()
                facts.append((one.st_mtime, one.st_size, path))
        total = sum(size for _, size, _ in facts)
        for _, size, path in sorted(facts):
            if total <= MOST_BYTES:
                return
            with suppress(OSError):
                path.unlink()
            total -= size


def _file_cache(path: str) -> tuple[_Jaxs, str]:
    return _Jaxs(SealedCache(Path(path))), path


def cache_folder() -> Path | None:
    """Where programs are kept by the environment's and the platform's rules; None to keep none."""
    named = os.environ.get(VARIABLE)
    if named == "off":
        return None
    try:
        return Path(named).expanduser() if named else _user_caches() / "pcjax"
    except RuntimeError:  # no home
        return None


def _user_caches() -> Path:
    """The platform's folder for the user's caches."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return named if named.is_absolute() else Path.home() / ".cache"
