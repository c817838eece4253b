"""A lock file beside a directory, with the name of its owner and a heartbeat.

The file is created exclusively, so that one process has it. That of a process that no longer
runs is taken over: on the same computer the process is looked up; a lock of another computer
is abandoned when its heartbeat, the time of its last change, has stopped.
"""

from __future__ import annotations

import contextlib
import getpass
import json
import os
import secrets
import socket
import threading
from pathlib import Path
from typing import Any

from fastslow.disk import create_file, reason, write_file
from fastslow.errors import FileError

#: Seconds between heartbeats, and after which a lock of another computer is abandoned.
BEAT, ABANDONED = 10.0, 300.0

#: Locks of this process, by token.
_HELD: set[str] = set()


class Lock:
    """The lock of a directory, held within a ``with`` statement.

    Parameters
    ----------
    path : Path
        The directory; the lock file is beside it.

    Raises
    ------
    FileError
        On entry, if another process has it, with the name of its owner.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = path.with_name(f"{path.name}.lock")
        self.token = secrets.token_hex(8)
        self._stop = threading.Event()
        self._lost = False

    def __enter__(self) -> Lock:
        try:
            self._acquire()
        except FileError:
            raise
        except OSError as error:
            raise FileError(f"{self.file} cannot be written: {reason(error)}") from error
        _HELD.add(self.token)
        threading.Thread(target=self._beat, name="heartbeat", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        _HELD.discard(self.token)
        if self._mine():
            with contextlib.suppress(OSError):
                self.file.unlink()

    def check(self) -> None:
        """Raise FileError if another process took the lock over, because this one was stopped."""
        if self._lost:
            raise FileError(f"{self.path} was taken over by another process: {_name(self._read())}")

    def _acquire(self) -> None:
        while True:
            try:
                create_file(self.file, self._content())
                return
            except FileExistsError:
                owner = self._read()
            if owner is None:
                continue  # released since
            if _alive(owner, self.file):
                raise FileError(
                    f"{self.path} is in use by {_name(owner)}; wait for it, or use another store"
                )
            if self._take_over(owner):
                return

    def _take_over(self, owner: dict[str, Any]) -> bool:
        """Replace the lock of a dead owner; of several processes that try, one succeeds."""
        claim = self.file.with_name(f"{self.file.name}.{owner['token']}")
        try:
            create_file(claim, b"")
        except FileExistsError:
            raise FileError(
                f"{self.path} is being taken over by another process; if none is running, remove "
                f"{claim}"
            ) from None
        try:
            if (self._read() or {}).get("token") != owner["token"]:
                return False
            write_file(self.file, self._content())
            return True
        finally:
            claim.unlink(missing_ok=True)

    def _content(self) -> bytes:
        pid = os.getpid()
        try:
            user = getpass.getuser()
        except (OSError, KeyError, ImportError):
            user = "unknown user"
        owner = {"token": self.token, "host": socket.gethostname(), "user": user}
        return json.dumps({**owner, "process": pid, "started": _started(pid)}).encode()

    def _read(self) -> dict[str, Any] | None:
        """Return the owner, None if the lock was released."""
        try:
            owner = json.loads(self.file.read_bytes())
            return {"token": "", "host": "", "user": "", "process": 0, "started": "", **owner}
        except FileNotFoundError:
            return None
        except (ValueError, TypeError):
            # just created, or damaged; abandoned if it stays so
            return {"token": "", "host": "unknown host", "user": "", "process": 0, "started": ""}

    def _mine(self) -> bool:
        return (self._read() or {}).get("token") == self.token

    def _beat(self) -> None:
        while not self._stop.wait(BEAT):
            with contextlib.suppress(OSError):
                self._lost = not self._mine()
                if self._lost:
                    return
                os.utime(self.file)


def _alive(owner: dict[str, Any], file: Path) -> bool:
    """Return True unless the owner of a lock certainly no longer runs."""
    if owner["token"] in _HELD:
        return True
    if owner["host"] == socket.gethostname() and os.name == "posix":
        if owner["process"] == os.getpid():
            return False
        try:
            os.kill(owner["process"], 0)
        except ProcessLookupError:
            return False
        except PermissionError:
            return True
        return bool(_started(owner["process"]) == owner["started"])
    return _age(file) < ABANDONED


def _age(file: Path) -> float:
    """Return the seconds since a change of a file, by the clock of its disk."""
    probe = file.with_name(f"{file.name}.{secrets.token_hex(8)}")
    try:
        create_file(probe, b"")
        return probe.stat().st_mtime - file.stat().st_mtime
    except FileNotFoundError:
        return 0.0
    finally:
        probe.unlink(missing_ok=True)


def _started(process: int) -> str:
    """Return the time at which a process began, in ticks, empty where it is not known."""
    try:
        text = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return ""
    return text.rpartition(")")[2].split()[19]


def _name(owner: dict[str, Any] | None) -> str:
    if owner is None or not owner["process"]:
        return "a process that cannot be determined"
    return f"process {owner['process']} of {owner['user']} on {owner['host']}"
