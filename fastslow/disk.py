"""Files written whole or not at all, and read without waiting: the only place that opens them.

The rules of writing, the same for every file of the package:

- The new content is written beside the file and then takes its name in one step. When the disk
  is full or fails, the old file is as it was, and nothing is left beside it. (A process that
  is killed meanwhile may leave a file ``.fastslow-*`` there; it can be removed.)
- A symbolic link is followed: the file that it names is written, also where there is none yet,
  and the link stays. Another hard link to the file keeps the old content.
- A file that exists keeps its permission bits and, where the system allows that, its owner. One
  that may not be written is not replaced.
- Only regular files are written and read: no folder, no pipe, no device.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from pathlib import Path

from fastslow.errors import FileError, raised_by_handler


def write_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file, whole or not at all.

    Parameters
    ----------
    path : str or path
    content : bytes

    Raises
    ------
    FileError
        When it cannot be written, with the reason.

    Examples
    --------
    >>> write_file("nowhere/a", b"")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nowhere/a cannot be written: No such file or directory
    """
    try:
        _replace(Path(os.path.realpath(path)), content)
    except (OSError, ValueError) as error:
        if raised_by_handler(error):
            raise
        raise FileError(f"{os.fspath(path)} cannot be written: {reason(error)}") from error


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a file of text in UTF-8, whole or not at all; errors as for `write_file`."""
    try:
        content = text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise FileError(f"{os.fspath(path)} cannot be written: {reason(error)}") from error
    write_file(path, content)


def read_file(path: str | os.PathLike[str]) -> bytes:
    """Read a regular file; nothing else is opened, so that no pipe or device can block.

    Raises
    ------
    FileError
        When it cannot be read, with the reason.

    Examples
    --------
    >>> read_file("nothing")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nothing cannot be read: No such file or directory
    """
    try:
        _check_regular(Path(path).stat())
        # in the meantime it may have become a pipe
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(path, flags), "rb") as file:
            _check_regular(os.fstat(file.fileno()))
            return file.read()
    except (OSError, ValueError, MemoryError) as error:
        if raised_by_handler(error):
            raise
        raise FileError(f"{os.fspath(path)} cannot be read: {reason(error)}") from error


def reason(error: BaseException) -> str:
    """What went wrong, in the words of the system where it has some."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def _replace(target: Path, content: bytes) -> None:
    """Put new content in the place of a file; what is still a link leads in a circle."""
    old: os.stat_result | None = None
    with contextlib.suppress(FileNotFoundError):
        old = target.stat()
    if old is not None:
        _check_regular(old)
        if not os.access(target, os.W_OK, effective_ids=os.access in os.supports_effective_ids):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    beside = target.parent / f".fastslow-{secrets.token_hex(8)}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        # private until it has the permission bits of the file that it replaces
        with os.fdopen(os.open(beside, flags, 0o666 if old is None else 0o600), "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if old is not None:
            _keep_access(beside, old)
        beside.replace(target)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
    _sync_folder(target.parent)


def _keep_access(path: Path, old: os.stat_result) -> None:
    """Give a file the owner, where that is allowed, and the permission bits of another."""
    new = path.stat()
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        with contextlib.suppress(OSError):
            os.chown(path, old.st_uid, old.st_gid)
    path.chmod(stat.S_IMODE(old.st_mode) & 0o777)


def _sync_folder(folder: Path) -> None:
    """Make a new name last a power failure, where the system can."""
    try:
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        # a TimeoutError is one of these
        if raised_by_handler(error):
            raise


def _check_regular(status: os.stat_result) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "It is a pipe, a socket or a device, not a regular file")
