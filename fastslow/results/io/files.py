"""Saving and loading of every result."""

from __future__ import annotations

import contextlib
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
from fastslow.results.io.zarr_store import read_store

#: Version of the file format; files of other versions are rejected.
FILE_FORMAT = 3

WRITERS = {".npz": write_archive, ".nc": write_netcdf}

#: Readers by the first bytes of a file.
READERS = {b"PK\x03\x04": read_archive, b"\x89HDF\r\n\x1a\n": read_netcdf}


def write(result: object, path: str | os.PathLike[str]) -> None:
    """Write a result; see `Result.save`.

    A file contains JSON text with the keys ``format``, ``library`` (the version of the
    package) and ``result`` (the fields of the result by name, including equations,
    parameters and settings), large arrays in binary form, and a checksum at its end.
    """
    target = Path(path)
    writer = WRITERS.get(target.suffix.lower())
    if writer is None:
        raise ArgumentError(f"{target}: expected a name that ends in {' or '.join(WRITERS)}")
    arrays: dict[str, Any] = {}
    tree = {"format": FILE_FORMAT, "library": _version(), "result": encoded(result, "", arrays)}
    text = json.dumps(tree, allow_nan=False)
    try:
        content = writer(text, arrays)
    except FastSlowError:
        raise
    except (OSError, ValueError, RuntimeError, struct.error) as error:
        if raised_by_handler(error):
            raise
        # raised by the HDF5 library, and by `zipfile` for a name that is too long
        raise FileError(f"{target} cannot be written: {reason(error)}") from error
    write_file(target, content)


@validated(path=path)
def load(path: str | os.PathLike[str]) -> Any:
    """Load a saved result from a file.

    The checksum of the file is verified first, and a changed file is rejected. No code
    in the file is executed; SymPy, Numba and Matplotlib are not required. The result
    supports the same queries and plots, and its ``model`` can be simulated
    (`StoredModel`); equilibria between the rows of a diagram (`Diagram.at`) are
    interpolated and marked as such.

    Parameters
    ----------
    path : str or path
        A file written by ``save``, or the store of a sweep (extra ``cluster``).

    Returns
    -------
    Diagram, Branch, Trajectory, Overlay, Grid, …
        The saved result.

    Raises
    ------
    FileError
        If the file is missing, not a regular file, truncated, damaged, of another
        program, or of another format version.
    MissingPackageError
        For NetCDF if the extra ``data`` is not installed, for a store if Zarr is not.

    See Also
    --------
    fastslow.read_auto, fastslow.export

    Examples
    --------
    >>> load("nothing.npz")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nothing.npz cannot be read: No such file or directory
    """
    source = Path(path)
    if _is_store(source):
        return read_store(source)
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
        # a crafted file with a correct checksum can raise any exception
        raise FileError(
            f"{source} is damaged, or not written by fastslow: {reason(error)}"
        ) from error


def _is_store(path: Path) -> bool:
    """Return True for the directory of a Zarr group."""
    try:
        return (path / "zarr.json").is_file()
    except OSError:
        return False  # a name that is too long, or a loop of links


def _read(text: str, arrays: Arrays) -> Any:
    tree = json.loads(text, parse_constant=_no_number)
    if tree["format"] != FILE_FORMAT:
        raise FileError(
            f"was written by fastslow {tree['library']} in format {tree['format']}; this is "
            f"fastslow {_version()}, which reads format {FILE_FORMAT}"
            + ": upgrade it"
            * (tree["format"] > FILE_FORMAT)
        )
    result = decoded(tree["result"], arrays)
    _require_readable(result)
    return result


def _require_readable(result: Any) -> None:
    """Show a result, make its table and its hash: fields made by hand may not fit each other."""
    for name in ("__repr__", "_repr_html_", "to_dict"):
        if hasattr(type(result), name):
            with contextlib.suppress(FastSlowError):
                getattr(result, name)()
    if type(result).__hash__ is not None:
        hash(result)


def _no_number(name: str) -> NoReturn:
    raise BrokenError(f"its text holds {name}, which is no JSON")


def _version() -> str:
    return str(import_module("fastslow").__version__)
