"""Saving and loading of every result."""

from __future__ import annotations

import json
import os
import secrets
import struct
import zipfile
import zlib
from importlib import import_module
from pathlib import Path
from typing import Any

from fastslow.arguments import path, takes
from fastslow.errors import ArgumentError, FastSlowError, FileError, MissingPackageError
from fastslow.results.encoding import Arrays, BrokenError, decoded, encoded
from fastslow.results.storage import read_archive, read_netcdf, write_archive, write_netcdf

#: Version of the layout described here; a file with a higher one is not read.
FORMAT = 1

WRITERS = {".npz": write_archive, ".nc": write_netcdf}

#: How files begin.
READERS = {b"PK\x03\x04": read_archive, b"\x89HDF\r\n\x1a\n": read_netcdf}

_BROKEN = (
    OSError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    EOFError,
    RuntimeError,
    NotImplementedError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)


def write(result: object, path: str | os.PathLike[str]) -> None:
    """Write a result; see `Result.save`.

    The text of a file is JSON: ``format``, ``library`` (the version that wrote
    it) and ``result``, the fields of the result by name with its equations,
    parameters and settings. Arrays too large for it stand beside it.
    """
    target = Path(path)
    writer = WRITERS.get(target.suffix)
    if writer is None:
        raise ArgumentError(f"{target}: expected a name that ends in {' or '.join(WRITERS)}")
    arrays: dict[str, Any] = {}
    tree = {"format": FORMAT, "library": _version(), "result": encoded(result, "", arrays)}
    text = json.dumps(tree, allow_nan=False)
    beside = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    try:
        writer(beside, text, arrays)
        with beside.open("rb+") as file:
            os.fsync(file.fileno())
        beside.replace(target)
    except FastSlowError:
        raise
    except (OSError, ValueError) as error:
        raise FileError(f"{target} cannot be written: {_reason(error)}") from error
    finally:
        beside.unlink(missing_ok=True)


@takes(path=path)
def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that was saved, by this or an earlier version.

    Nothing in the file is run, and neither SymPy, Numba nor matplotlib is
    needed. The result answers and plots as before; what it read off a model
    (`Diagram.at` between rows) is interpolated now, and says so.

    Parameters
    ----------
    path : str or path
        Written by ``save``.

    Returns
    -------
    Diagram, Branch, Trajectory, Overlay, …
        What was saved.

    Raises
    ------
    FileError
        When there is no such file, or it is cut short, of another program, or newer
        than this version.
    MissingPackageError
        For NetCDF without the extra ``data``.

    Examples
    --------
    >>> load("nothing.npz")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nothing.npz cannot be read: No such file or directory
    """
    source = Path(path)
    try:
        with source.open("rb") as file:
            begin = file.read(8)
    except OSError as error:
        raise FileError(f"{source} cannot be read: {_reason(error)}") from error
    reader = next((r for magic, r in READERS.items() if begin.startswith(magic)), None)
    if reader is None:
        what = "is empty" if not begin else "is neither an .npz archive nor NetCDF"
        raise FileError(f"{source} {what}: it was not written by fastslow, or is damaged")
    try:
        return reader(source, _read)
    except MissingPackageError:
        raise
    except FileError as error:
        raise FileError(f"{source} {error}") from None
    except BrokenError as error:
        raise FileError(f"{source} cannot be read: {error}") from None
    except _BROKEN as error:
        raise FileError(
            f"{source} is cut short, damaged, or not written by fastslow: {_reason(error)}"
        ) from error


def _read(text: str, arrays: Arrays) -> Any:
    tree = json.loads(text)
    if tree["format"] > FORMAT:
        raise FileError(
            f"was written by fastslow {tree['library']} in format {tree['format']}; this is "
            f"fastslow {_version()}, which reads formats up to {FORMAT}: upgrade it"
        )
    return decoded(tree["result"], arrays)


def _version() -> str:
    return str(import_module("fastslow").__version__)


def _reason(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
