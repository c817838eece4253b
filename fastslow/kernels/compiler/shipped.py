"""Machine code shipped with this package, built with its wheel.

It is trusted like the adjacent sources, which this process runs: it is loaded if it has the
same owner and nobody can write to it who cannot write to the sources.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from fastslow.kernels.compiler import store
from fastslow.kernels.compiler.loop_target import platform_name

#: Its folder, and the file in it that names the platform.
FOLDER = Path(__file__).parents[1] / "objects"
PLATFORM = "platform.txt"

_WRITERS = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def read(name: str) -> bytes | None:
    """Read an object by its name; None if there is no trusted one."""
    file = FOLDER / f"{name}{store.SUFFIX}"
    try:
        descriptor = os.open(file, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        return None
    with os.fdopen(descriptor, "rb") as stream:
        status = os.fstat(descriptor)
        if not _as_trusted(status, Path(__file__).stat()):
            store.warn_once(
                f"{file} is not loaded: others than the sources beside it can write to it"
            )
            return None
        content = store.unwrapped(name, stream.read())
    if content is None:
        store.warn_once(f"{file} is not loaded: it is damaged")
    return content


def _as_trusted(status: os.stat_result, source: os.stat_result) -> bool:
    if not stat.S_ISREG(status.st_mode):
        return False
    if not store.OWNERS:
        return True
    writers = status.st_mode & _WRITERS
    if status.st_uid != source.st_uid or writers & ~source.st_mode:
        return False
    return status.st_gid == source.st_gid or not writers & stat.S_IWGRP


def missing() -> str:
    """Describe why a requested object is missing."""
    try:
        made_for = (FOLDER / PLATFORM).read_text(encoding="utf-8").strip()
    except OSError:
        return "this installation contains no machine code"
    if made_for != platform_name():
        return f"this installation contains machine code for {made_for}; this is {platform_name()}"
    return "its sources differ from those of the machine code of this installation"
