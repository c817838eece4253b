"""Saving and loading of every result."""

from __future__ import annotations

import json
import os
import struct
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from fastslow.arguments import path, validated
from fastslow.disk import read_file, reason, write_file
from fastslow.errors import (
    ArgumentError,
    FastSlowError,
    FileError,
    MissingPackageError,
    raised_by_handler,
)
from fastslow.results.io.encoding import Arrays, BrokenError, decoded, encoded
from fastslow.results.io.npz_netcdf import read_archive, read_netcdf, write_archive, write_netcdf

#: Version of the layout described here; a file of another one is not read.
FORMAT = 3

WRITERS = {".npz": write_archive, ".nc": write_netcdf}

#: How files begin.
READERS = {b"PK\x03\x04": read_archive, b"\x89HDF\r\n\x1a\n": read_netcdf}


def write(result: object, path: str | os.PathLike[str]) -> None:
    """Write a result; see `Result.save`.

    The text of a file is JSON: ``format``, ``library`` (the version that wrote
    it) and ``result``, the fields of the result by name with its equations,
    parameters and settings. Arrays too large for it stand beside it, and a
    checksum of everything at the end of the file.
    """
    target = Path(path)
    writer = WRITERS.get(target.suffix.lower())
    if writer is None:
        raise ArgumentError(f"{target}: expected a name that ends in {' or '.join(WRITERS)}")
    arrays: dict[str, Any] = {}
    tree = {"format": FORMAT, "library": _version(), "result": encoded(result, "", arrays)}
    text = json.dumps(tree, allow_nan=False)
    try:
        content = writer(text, arrays)
    except FastSlowError:
        raise
    except (OSError, ValueError, RuntimeError, struct.error) as error:
        if raised_by_handler(error):
            raise
        # of the HDF5 library, and of `zipfile` for a name that is too long
        raise FileError(f"{target} cannot be written: {reason(error)}") from error
    write_file(target, content)


@validated(path=path)
def load(path: str | os.PathLike[str]) -> Any:
    """Read a result that was saved.

    The checksum of the file is compared first: a file that changed since it was
    written is refused. Nothing in the file is run, and neither SymPy, Numba nor
    matplotlib is needed. The result answers and plots as before, and its ``model`` can be
    simulated (`StoredModel`); what a diagram solved for (`Diagram.at` between rows) is
    interpolated now, and says so.

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
        When there is no such file, or it is no regular one, cut short, damaged, of
        another program, or of another format than that of this version.
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
    content = read_file(source)
    reader = next((r for magic, r in READERS.items() if content.startswith(magic)), None)
    if reader is None:
        what = "is neither an .npz archive nor NetCDF" if content else "is empty"
        raise FileError(f"{source} {what}: it was not written by fastslow, or is damaged")
    try:
        return reader(content, _read)
    except MissingPackageError:
        raise
    except FileError as error:
        raise FileError(f"{source} {error}") from None
    except BrokenError as error:
        raise FileError(f"{source} cannot be read: {error}") from None
    except Exception as error:
        if raised_by_handler(error):
            raise
        # what a file written by hand with a right checksum can raise has no end
        raise FileError(
            f"{source} is damaged, or not written by fastslow: {reason(error)}"
        ) from error


def _read(text: str, arrays: Arrays) -> Any:
    tree = json.loads(text, parse_constant=_no_number)
    if tree["format"] != FORMAT:
        raise FileError(
            f"was written by fastslow {tree['library']} in format {tree['format']}; this is "
            f"fastslow {_version()}, which reads format {FORMAT}"
            + ": upgrade it"
            * (tree["format"] > FORMAT)
        )
    return decoded(tree["result"], arrays)


def _no_number(name: str) -> NoReturn:
    raise BrokenError(f"its text holds {name}, which is no JSON")


def _version() -> str:
    return str(import_module("fastslow").__version__)
