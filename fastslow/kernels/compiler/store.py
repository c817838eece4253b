"""Cache of compiled code on disk: location, permissions and integrity.

The content of these files is executed. They are read only if they belong to this user or to
root and nobody else can write to them or to their directory. Both are checked on the opened
file, and the checksum on the bytes that are used, so that nothing can be exchanged in between.
Windows has neither such owners and modes nor such locks: there the directory of the user is
trusted, and processes do not wait for each other.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import sys
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path

try:
    import fcntl
except ImportError:
    _LOCKS = False
else:
    _LOCKS = True

OWNERS = hasattr(os, "geteuid")

_BEGINNING = b"fastslow compiled code "
SUFFIX, _ASIDE = ".code", ".tmp"

#: Days without use after which a file is removed, and total bytes beyond which the least
#: recently used are.
KEPT_DAYS, KEPT_BYTES = 90, 2**30
_DAY = 86400.0

#: Files that a process writes from one search for unused ones to the next; each looks at all files.
SWEPT_EVERY = 100

_written = count()

#: Seconds that a process waits for another one compiling the same code, and polling interval.
COMPILATION_WAIT, _PAUSE = 600.0, 0.05

_MEMORY = "compiled code is kept in memory alone, and every process compiles its own"


def writable_directory() -> Path | None:
    """Directory of compiled code: ``FASTSLOW_CACHE``, else the cache directory of the user.

    None if neither is writable.
    """
    with _folders() as folders:
        return next((folder.path for folder in folders if folder.writable), None)


def _candidates() -> list[Path]:
    """The configured directory, then that of the user as a fallback."""
    chosen = os.environ.get("FASTSLOW_CACHE")
    places = [Path(chosen).absolute() if chosen else None, _own_directory()]
    return [place for place in places if place is not None]


def _own_directory() -> Path | None:
    """Cache directory of the user on each system."""
    home = _home()
    if sys.platform == "win32":
        base = _from_environment("LOCALAPPDATA") or (home and home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home and home / "Library" / "Caches"
    else:
        base = _from_environment("XDG_CACHE_HOME") or (home and home / ".cache")
    return base and base / "fastslow"


def _from_environment(variable: str) -> Path | None:
    """Directory in an environment variable; an empty or relative one counts as unset (XDG)."""
    path = Path(os.environ.get(variable, ""))
    return path if path.is_absolute() else None


def _home() -> Path | None:
    try:
        home = Path.home()
    except (RuntimeError, KeyError):
        return None
    return home if home.is_absolute() and os.environ.get("HOME") != "" else None


def read(name: str) -> bytes | None:
    """Read compiled code by its name from any directory; None if missing or damaged."""
    with _folders() as folders:
        for folder in folders:
            try:
                content = folder.read(name)
            except OSError as error:
                file = folder.path / f"{name}{SUFFIX}"
                warn_once(f"{file} is not loaded ({_reason(error)}): it is compiled again")
                continue
            if content is not None:
                return content
    return None


def write(name: str, content: bytes) -> None:
    """Store compiled code, in memory alone if no directory is writable.

    Parameters
    ----------
    name : str
        Key for `read`, which determines everything that the code depends on.
    content : bytes
    """
    with _folders() as folders:
        refusals = []
        for folder in folders:
            try:
                folder.write(name, content)
            except OSError as error:
                refusals.append(f"{folder.path} takes no compiled code ({_reason(error)})")
            else:
                _warn_of_fallback(refusals, f"{folder.path} does")
                if next(_written) % SWEPT_EVERY == 0:
                    _sweep(folder)
                return
        _warn_of_fallback(refusals, _MEMORY)


@contextmanager
def exclusively(name: str, waiting: Callable[[], None]) -> Iterator[None]:
    """Lock a name, so that one process at a time compiles it; others wait.

    The system releases the lock with the process. Without locks, and after `COMPILATION_WAIT`,
    the wait ends. Meanwhile ``waiting`` is called repeatedly.
    """
    with _folders() as folders, ExitStack() as stack:
        if _LOCKS and folders:
            with contextlib.suppress(OSError):
                descriptor = folders[-1].open("lock", os.O_RDWR | os.O_CREAT)
                stack.callback(os.close, descriptor)
                _wait(descriptor, name, waiting)
        yield


def _wait(descriptor: int, name: str, waiting: Callable[[], None]) -> None:
    # a byte of the lock file, which need not exist, represents the name
    byte = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])
    end = time.monotonic() + COMPILATION_WAIT
    while True:
        try:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
        except (BlockingIOError, PermissionError):
            if time.monotonic() > end:
                warn_once(
                    f"{name} is compiled here too: another process has been at it for too long"
                )
                return
            waiting()
            time.sleep(_PAUSE)
        else:
            return


@contextmanager
def _folders() -> Iterator[list[_Folder]]:
    """Open the directories to read from; only the last one may be writable."""
    with ExitStack() as stack:
        found: list[_Folder] = []
        refusals = []
        for path in _candidates():
            try:
                path.mkdir(mode=0o755, parents=True, exist_ok=True)
                folder = _Folder(path)
            except OSError as error:
                refusals.append(f"no compiled code is loaded from {path} ({_reason(error)})")
                continue
            stack.callback(folder.close)
            found.append(folder)
            if folder.writable:
                break
        if not found and not refusals:
            refusals = ["there is no home directory, and FASTSLOW_CACHE is not set"]
        _warn_of_fallback(refusals, f"{found[0].path} is used" if found else _MEMORY)
        yield found


class _UntrustedError(OSError):
    """A file or directory that others can write to."""


def _check(status: os.stat_result, what: str) -> None:
    if not OWNERS:
        return
    if status.st_uid not in (os.geteuid(), 0):
        raise _UntrustedError(f"the {what} belongs to the user of number {status.st_uid}")
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise _UntrustedError(f"the {what} can be written by others (chmod go-w)")


class _Folder:
    """An open directory that nobody else can write to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.descriptor: int | None = None
        if OWNERS:
            self.descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
            try:
                _check(os.fstat(self.descriptor), "directory")
            except OSError:
                self.close()
                raise

    @property
    def writable(self) -> bool:
        return os.access(self.path, os.W_OK)

    def close(self) -> None:
        if self.descriptor is not None:
            os.close(self.descriptor)

    def at(self, file: str) -> str:
        """Path of a file for functions that accept a directory descriptor."""
        return file if self.descriptor is not None else str(self.path / file)

    def open(self, file: str, flags: int) -> int:
        for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_BINARY"):
            flags |= getattr(os, name, 0)
        return os.open(self.at(file), flags, 0o644, dir_fd=self.descriptor)

    def remove(self, file: str) -> None:
        with contextlib.suppress(OSError):
            os.unlink(self.at(file), dir_fd=self.descriptor)

    def read(self, name: str) -> bytes | None:
        file = name + SUFFIX
        try:
            # a pipe in place of the file must not block
            descriptor = self.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        except FileNotFoundError:
            return None
        with os.fdopen(descriptor, "rb") as stream:
            status = os.fstat(descriptor)
            _check(status, "file")
            if not stat.S_ISREG(status.st_mode):
                raise _UntrustedError("it is not a file")
            content = unwrapped(name, stream.read())
        if content is not None and time.time() - status.st_mtime > _DAY:
            # its last use, for `_sweep`
            with contextlib.suppress(OSError):
                os.utime(self.at(file), dir_fd=self.descriptor)
        return content

    def write(self, name: str, content: bytes) -> None:
        aside = f"{name}.{uuid.uuid4().hex}{_ASIDE}"
        descriptor = self.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(wrapped(name, content))
            inside = {"src_dir_fd": self.descriptor, "dst_dir_fd": self.descriptor}
            os.replace(self.at(aside), self.at(name + SUFFIX), **inside)  # noqa: PTH105
        except BaseException:
            self.remove(aside)
            raise


def _checksum(name: str, content: bytes) -> bytes:
    digest = hashlib.sha256(name.encode() + b"\n")
    digest.update(content)
    return digest.hexdigest().encode()


def wrapped(name: str, content: bytes) -> bytes:
    """Prefix the content with its checksum, for writing to a file."""
    return _BEGINNING + _checksum(name, content) + b"\n" + content


def unwrapped(name: str, whole: bytes) -> bytes | None:
    """Content of a file without the checksum; None if it does not match."""
    length = len(_BEGINNING) + 64
    content = whole[length + 1 :]
    return content if whole == wrapped(name, content) else None


def _sweep(folder: _Folder) -> None:
    """Remove files not used recently, such as code for other versions."""
    files = []
    where = folder.path if folder.descriptor is None else folder.descriptor
    # another process may remove them at the same time
    with contextlib.suppress(OSError), os.scandir(where) as entries:
        for entry in entries:
            if entry.name.endswith((SUFFIX, _ASIDE)):
                status = entry.stat(follow_symlinks=False)
                used = max(status.st_atime, status.st_mtime)
                files.append((used, status.st_size, entry.name))
    total, now = 0, time.time()
    for used, size, file in sorted(files, reverse=True):
        total += size
        days = KEPT_DAYS if file.endswith(SUFFIX) else 1
        if total > KEPT_BYTES or now - used > days * _DAY:
            folder.remove(file)


_warned: set[str] = set()


def _warn_of_fallback(refusals: list[str], instead: str) -> None:
    if refusals:
        warn_once(f"{'; '.join(refusals)}: {instead}")


def warn_once(sentence: str) -> None:
    """Warn once in a process."""
    if sentence not in _warned:
        _warned.add(sentence)
        warnings.warn(sentence, RuntimeWarning, stacklevel=2)


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
