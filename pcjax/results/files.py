"""Files that can be believed: no pipes, a seal against damage, and one process at a time."""

from __future__ import annotations

import errno
import hashlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_MARK = b"\npcjax sha256 "


def read_plain(path: Path) -> bytes:
    """A file's content. Nothing is waited for: a pipe or a device is refused.

    Raises:
        ValueError: there is none, or it is no plain file or cannot be read; in one line.
    """
    try:
        if path.is_file():
            return path.read_bytes()
        what = "it is a folder" if path.is_dir() else "it is no plain file"
        what = f"cannot be read: {what}" if path.exists() else "does not exist"
    except (OSError, MemoryError) as error:
        what = f"cannot be read: {getattr(error, 'strerror', None) or 'it is too large'}"
    raise ValueError(f"{path} {what}")


def digest(content: bytes, of: str = "") -> str:
    """The SHA-256 of a content and of the text that says what it is, in hexadecimal."""
    owner = of.encode()
    return hashlib.sha256(b"%d\n%b%b" % (len(owner), owner, content)).hexdigest()


def sealed(content: bytes, of: str = "") -> bytes:
    """The content with its digest behind it; netCDF and other readers pass over that."""
    return content + _MARK + digest(content, of).encode() + b"\n"


def unsealed(kept: bytes, of: str = "") -> bytes | None:
    """The content that was sealed as `of`; None if it is damaged, another's, or has no seal."""
    content = kept[: kept.rfind(_MARK)]
    return content if kept == sealed(content, of) else None


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Keeps a file that is to be written for this process alone. However the process ends, the
    system gives the lock back; what a killed one leaves (an empty file) locks nothing.

    Raises:
        ValueError: another one has it.
        OSError: the lock's file cannot be made.
    """
    lock = path.with_name(f".{path.name}.lock")
    while True:
        try:
            handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        if not _lock(handle):
            os.close(handle)
            raise ValueError(
                f"{path} is being written by another process: wait for its end, or name "
                "another file"
            )
        # Whoever had it before may have removed the file since it was opened here.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.stat(lock)):
                break
        os.close(handle)
    try:
        yield
    finally:
        if sys.platform == "win32":  # where no open file can be removed
            os.close(handle)
        with suppress(OSError):
            lock.unlink()
        if sys.platform != "win32":
            os.close(handle)


def _lock(handle: int) -> bool:
    """Whether this process has the lock now. Where a file system knows none, it always has."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK)
    return True
