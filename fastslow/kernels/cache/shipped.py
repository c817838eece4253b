"""Machine code that this package brings with it, made when its wheel was.

It is trusted as the sources beside it are, which this process has run: it is loaded where it
has their owner and can be written by nobody who cannot write them.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from fastslow.kernels.cache import store
from fastslow.kernels.loop_target import platform_name

#: Where it is, and the file there that says what platform it is for.
FOLDER = Path(__file__).parents[1] / "objects"
PLATFORM = "platform.txt"

_WRITERS = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def read(name: str) -> bytes | None:
    """An object by its name; None where there is none, or none that can be trusted."""
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
    """Why an object that is asked for is not there, in words."""
    try:
        made_for = (FOLDER / PLATFORM).read_text(encoding="utf-8").strip()
    except OSError:
        return "this installation brings no machine code"
    if made_for != platform_name():
        return f"this installation brings machine code for {made_for}; this is {platform_name()}"
    return "its sources are not those that the machine code of this installation is made of"
