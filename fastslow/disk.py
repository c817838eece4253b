"""Atomic writing and non-blocking reading of files; no other module opens files.

Every file of the package is written by the same rules:

- The new content is written to a temporary file in the same directory, which then replaces the
  old file atomically. If the disk is full or fails, the old file is unchanged and the temporary
  one is removed. (A process killed meanwhile may leave a file ``.fastslow-*``, which can be
  deleted.)
- A symbolic link is followed: its target is written, or created if missing, and the link is
  preserved. Other hard links to the file keep the old content.
- An existing file keeps its permission bits and, where the system allows it, its owner. A
  read-only file is not replaced.
- Only regular files are written and read, not directories, pipes or devices.
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
    """Write a file atomically.

    Parameters
    ----------
    path : str or path
    content : bytes

    Raises
    ------
    FileError
        If it cannot be written, with the reason.

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


def create_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Create a file that does not exist, for locks; its content is not complete at once.

    Raises
    ------
    FileExistsError
        If the file exists: of several processes, one creates it.
    OSError
        If it cannot be created.
    """
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666), "wb") as file:
        file.write(content)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8 atomically; errors as for `write_file`."""
    try:
        content = text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise FileError(f"{os.fspath(path)} cannot be written: {reason(error)}") from error
    write_file(path, content)


def read_file(path: str | os.PathLike[str], largest: int | None = None) -> bytes:
    """Read a regular file; other files are not opened, because a pipe or device may block.

    Parameters
    ----------
    path : str or path
    largest : int, optional
        Number of bytes above which a file is not read.

    Raises
    ------
    FileError
        If it cannot be read, with the reason.

    Examples
    --------
    >>> read_file("nothing")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nothing cannot be read: No such file or directory
    """
    try:
        _check_regular(Path(path).stat())
        # the file may have been replaced by a pipe since
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(path, flags), "rb") as file:
            status = os.fstat(file.fileno())
            _check_regular(status)
            if largest is not None and status.st_size > largest:
                raise ValueError(f"it has {status.st_size} bytes; expected at most {largest}")
            return file.read()
    except (OSError, ValueError, MemoryError) as error:
        if raised_by_handler(error):
            raise
        raise FileError(f"{os.fspath(path)} cannot be read: {reason(error)}") from error


def reason(error: BaseException) -> str:
    """Return the reason of an error, as given by the operating system if it gives one."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def _replace(target: Path, content: bytes) -> None:
    """Replace the content of a file; a target that is still a link is a circular one."""
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
    """Copy the permission bits of another file and, where that is allowed, its owner."""
    new = path.stat()
    if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
        with contextlib.suppress(OSError):
            os.chown(path, old.st_uid, old.st_gid)
    path.chmod(stat.S_IMODE(old.st_mode) & 0o777)


def _sync_folder(folder: Path) -> None:
    """Flush a directory to disk where the system can, so that a rename survives power loss."""
    try:
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        # TimeoutError is a subclass of OSError
        if raised_by_handler(error):
            raise


def _check_regular(status: os.stat_result) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "It is a pipe, a socket or a device, not a regular file")
