"""Text and arrays in one file: NumPy's archive (.npz), or NetCDF (.nc)."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.encoding import Arrays
from fastslow.results.tables import extra

Array = NDArray[Any]

#: What is done with the text and the arrays of a file.
Use = Callable[[str, Arrays], Any]

#: The name of the text among the arrays.
TEXT = "fastslow"


def write_archive(path: Path, text: str, arrays: Mapping[str, Array]) -> None:
    """Write an .npz archive, which `numpy.load` reads too."""
    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name, array in {TEXT: np.array(text), **arrays}.items():
            entry = zipfile.ZipInfo(f"{name}.npy")
            # numbers hardly become smaller, and text four times
            entry.compress_type = zipfile.ZIP_DEFLATED if name == TEXT else zipfile.ZIP_STORED
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def read_archive(path: Path, use: Use) -> Any:
    """Give the text and the arrays of an archive to a function; KeyError without the text."""
    with zipfile.ZipFile(path) as archive:

        def array(name: str, kind: str) -> Array:
            with archive.open(f"{name}.npy") as member:
                values = np.lib.format.read_array(member, allow_pickle=False)
                # to the end, where the checksum is looked at
                member.read()
            return values

        return use(str(array(TEXT, "")), array)


def write_netcdf(path: Path, text: str, arrays: Mapping[str, Array]) -> None:
    """Write NetCDF 4: one group for each part, complex numbers as two variables."""
    with extra("h5netcdf").File(path, "w") as file:
        _write_variable(file, TEXT, np.array(text))
        for name, array in arrays.items():
            if array.dtype.kind == "c":
                _write_variable(file, f"{name}_real", array.real)
                _write_variable(file, f"{name}_imag", array.imag)
            else:
                _write_variable(file, name, array)


def _write_variable(file: Any, name: str, array: Array) -> None:
    dimensions = tuple(f"axis{k}_{size}" for k, size in enumerate(array.shape))
    for dimension, size in zip(dimensions, array.shape, strict=True):
        if dimension not in file.dimensions:
            file.dimensions[dimension] = size
    options = {"data": np.ascontiguousarray(array).reshape(array.shape)}
    if array.dtype.kind == "U":
        text = extra("h5py").string_dtype("utf-8")
        options = {"data": np.array(array, dtype=object), "dtype": text}
    elif array.dtype.kind == "b":
        options = {"data": array.astype(np.int8)}
    file.create_variable(f"/{name}", dimensions, **options)


def read_netcdf(path: Path, use: Use) -> Any:
    """Give the text and the arrays of a NetCDF file to a function; KeyError without the text."""
    with extra("h5netcdf").File(path, "r") as file:

        def array(name: str, kind: str) -> Array:
            dtype = np.dtype(kind)
            if dtype.kind == "c":
                real, imaginary = (file[f"{name}_{part}"][...] for part in ("real", "imag"))
                values = np.empty(real.shape, dtype=dtype)
                values.real, values.imag = real, imaginary
                return values
            stored = file[name][...]
            if dtype.kind == "U":
                texts = [item.decode() for item in stored.reshape(-1)]
                return np.array(texts, dtype=dtype).reshape(stored.shape)
            return np.asarray(stored).astype(dtype, copy=False)

        return use(file[TEXT][()].decode(), array)
