"""Text and arrays in one file: NumPy's archive (.npz), or NetCDF (.nc), both with a checksum.

The last bytes of a file are the SHA-256 of all bytes before them. It is compared before
anything else is read, so that neither `zipfile` nor the HDF5 library, which a damaged file can
crash, meets a file that has changed. Both formats allow for it: it is the comment of the archive,
and HDF5 does not look beyond the end that its own header states; NumPy, h5netcdf, xarray and the
netCDF library open such files. A checksum of the arrays inside the file could only be compared
after the HDF5 library has parsed it.

A checksum is no signature: whoever writes a file by hand can give it the right one. Therefore
nothing is unpacked or allocated that the size of the file does not account for. Members of
archives and variables are stored as they are, without compression, and what is read of all of
them together is at most as large as the file.
"""

from __future__ import annotations

import hashlib
import math
import zipfile
from collections.abc import Callable, Mapping
from io import SEEK_END, BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import FileError
from fastslow.results.base.extras import extra
from fastslow.results.io.encoding import Arrays, BrokenError

Array = NDArray[Any]

#: Decodes the text and the arrays of a file.
Use = Callable[[str, Arrays], Any]

#: Name of the entry with the text.
TEXT = "fastslow"

#: Marker before the checksum.
SEAL = b"fastslow sha256 "

#: Length in bytes of marker and checksum.
SEAL_SIZE = len(SEAL) + 2 * hashlib.sha256().digest_size


def sealed(content: bytes) -> bytes:
    """Append the checksum to the content of a file.

    Examples
    --------
    >>> check_seal(sealed(b"1.5"))
    """
    return _sealed(BytesIO(content), len(content))


def check_seal(content: bytes) -> None:
    """Verify the checksum at the end of the content of a file.

    Raises
    ------
    FileError
        When there is none, or the content has changed.
    """
    seal = content[-SEAL_SIZE:]
    if not seal.startswith(SEAL):
        raise FileError(
            "has no checksum at its end: it is cut short, was changed by another program, or was "
            "not written by fastslow in format 2 or later"
        )
    if seal != _seal(memoryview(content)[:-SEAL_SIZE]):
        raise FileError("is damaged: its content is not what its checksum was computed of")


def _sealed(stream: BytesIO, size: int) -> bytes:
    """Write the checksum after given bytes in place; results can be large."""
    with stream.getbuffer() as content:
        seal = _seal(content[:size])
    stream.seek(size)
    stream.write(seal)
    return stream.getvalue()


def _seal(content: bytes | memoryview) -> bytes:
    return SEAL + hashlib.sha256(content).hexdigest().encode()


def write_archive(text: str, arrays: Mapping[str, Array]) -> bytes:
    """Return the content of an .npz archive, which `numpy.load` can read too."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        archive.comment = bytes(SEAL_SIZE)
        try:
            for name, array in {TEXT: np.array(text.encode("ascii")), **arrays}.items():
                entry = zipfile.ZipInfo(f"{name}.npy")
                with archive.open(entry, "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, array, allow_pickle=False)
        except BaseException:
            # closing an archive in which a member was left open fails, and would hide an interrupt
            archive.fp = None
            raise
    return _sealed(stream, stream.seek(0, SEEK_END) - SEAL_SIZE)


def read_archive(content: bytes, use: Use) -> Any:
    """Call a function with the text and the arrays of an archive; KeyError without the text."""
    check_seal(content)
    budget = _Budget(len(content))
    with zipfile.ZipFile(BytesIO(content)) as archive:
        members: dict[str, zipfile.ZipInfo] = {}
        for entry in archive.infolist():
            if entry.filename in members:
                raise BrokenError(f"it holds {entry.filename} twice")
            if entry.compress_type != zipfile.ZIP_STORED or entry.file_size != entry.compress_size:
                raise BrokenError(f"its {entry.filename} is compressed, which no result is")
            members[entry.filename] = entry

        def array(name: str, kind: str) -> Array:
            entry = members[f"{name}.npy"]
            budget.take(name, entry.file_size)
            return _parsed(name, archive.read(entry))

        return use(_text(array(TEXT, "S")), array)


def _parsed(name: str, member: bytes) -> Array:
    """Return the array of an archive member, after its header is checked against its size."""
    stream = BytesIO(member)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise BrokenError(f"the header of {name} is not of version 1.0")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    _check_dtype(name, dtype)
    size = math.prod(shape)
    if min(shape, default=0) < 0 or len(member) - stream.tell() != size * dtype.itemsize:
        raise BrokenError(f"the size of {name} is not the one that its header states")
    if not size:
        return np.empty(shape, dtype)
    flat = np.frombuffer(member, dtype, offset=stream.tell())
    return (flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)).copy(order="K")


def write_netcdf(text: str, arrays: Mapping[str, Array]) -> bytes:
    """Return the content of a NetCDF 4 file, built in memory.

    There is one group for each part; complex numbers are two variables, and text is characters
    in UTF-8.
    """
    stream = BytesIO()
    with extra("h5netcdf").File(stream, "w") as file:
        _write_variable(file, TEXT, np.array(text))
        for name, array in arrays.items():
            if array.dtype.kind == "c":
                _write_variable(file, f"{name}_real", array.real)
                _write_variable(file, f"{name}_imag", array.imag)
            else:
                _write_variable(file, name, array)
    return _sealed(stream, stream.seek(0, SEEK_END))


def _write_variable(file: Any, name: str, array: Array) -> None:
    shape, attributes = array.shape, {}
    dimensions = tuple(f"axis{k}_{size}" for k, size in enumerate(shape))
    if array.dtype.kind == "U":
        array = _characters(array)
        # a dimension of their own, by which xarray joins them to words
        dimensions = (*dimensions, f"characters_{array.shape[-1]}")
        attributes = {"_Encoding": "utf-8"}
    elif array.dtype.kind == "b":
        array = array.astype(np.int8)
    for dimension, size in zip(dimensions, array.shape, strict=True):
        if dimension not in file.dimensions:
            file.dimensions[dimension] = size
    data = np.ascontiguousarray(array).reshape(array.shape)
    variable = file.create_variable(f"/{name}", dimensions, data=data)
    for key, value in attributes.items():
        variable.attrs[key] = value


def _characters(array: Array) -> Array:
    """Encode strings in UTF-8 as single bytes along one more axis."""
    words = [word.encode("utf-8", "surrogatepass") for word in array.reshape(-1).tolist()]
    width = max([array.dtype.itemsize // 4, *map(len, words)])
    joined = b"".join(word.ljust(width, b"\0") for word in words)
    return np.frombuffer(joined, "S1").reshape(*array.shape, width)


def read_netcdf(content: bytes, use: Use) -> Any:
    """Call a function with the text and the arrays of a NetCDF file; KeyError without the text."""
    h5py = extra("h5py")
    check_seal(content)
    budget = _Budget(len(content))
    with h5py.File(BytesIO(content), "r") as file:

        def stored(name: str) -> Array:
            """Return a variable stored in this file itself, not a link."""
            found = file
            for part in filter(None, name.split("/")):
                if not isinstance(found.get(part, getlink=True), h5py.HardLink):
                    raise BrokenError(f"{name} is missing or a link, which no result holds")
                found = found[part]
            if not isinstance(found, h5py.Dataset):
                raise BrokenError(f"{name} is no variable")
            _check_dtype(name, found.dtype)
            if not found.size:
                return np.empty(found.shape, found.dtype)
            size = found.size * found.dtype.itemsize
            start = found.id.get_offset()
            if start is None or found.id.get_storage_size() != size or start + size > len(content):
                raise BrokenError(f"{name} is not stored as fastslow stores variables")
            budget.take(name, size)
            return np.asarray(found[...])

        def array(name: str, kind: str) -> Array:
            dtype = np.dtype(kind)
            _check_dtype(name, dtype, "biufcU")
            if dtype.kind == "c":
                real, imaginary = (stored(f"{name}_{part}") for part in ("real", "imag"))
                values = np.empty(real.shape, dtype=dtype)
                values.real, values.imag = real, imaginary
                return values
            if dtype.kind == "U":
                return _words(name, stored(name), dtype)
            return stored(name).astype(dtype, copy=False)

        return use(_text(stored(TEXT)), array)


def _words(name: str, characters: Array, dtype: np.dtype[Any]) -> Array:
    """Decode strings from their bytes along the last axis."""
    if characters.dtype.str != "|S1" or not 4 <= dtype.itemsize <= 4 * characters.shape[-1]:
        raise BrokenError(f"{name} is not stored as fastslow stores words")
    joined = np.ascontiguousarray(characters).view(f"S{characters.shape[-1]}")
    words = [item.decode("utf-8", "surrogatepass") for item in joined.reshape(-1).tolist()]
    return np.array(words, dtype=dtype).reshape(characters.shape[:-1])


class _Budget:
    """Limit on the bytes read from a file, because a crafted one can repeat the same bytes."""

    def __init__(self, size: int) -> None:
        self._left = size

    def take(self, name: str, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise BrokenError(f"with {name} its arrays are larger than the file")


def _check_dtype(name: str, dtype: np.dtype[Any], kinds: str = "biufcUS") -> None:
    """Accept numbers and characters, but no objects and records."""
    if dtype.kind not in kinds or dtype.itemsize == 0 or dtype.subdtype is not None:
        raise BrokenError(f"{name} is of type {str(dtype)[:40]}, which no result holds")


def _text(array: Array) -> str:
    return np.ascontiguousarray(array).tobytes().decode("ascii")
