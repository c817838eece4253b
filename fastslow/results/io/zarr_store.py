"""Zarr stores of sweeps: written task by task, loaded at any time.

A store is a Zarr group in a directory, which xarray opens by itself. Its arrays are the axes, one
array for each output, ``failure`` with the text of the error of each point that failed, ``done``
with a mark for each task, and ``checksum`` with a checksum of the files and the mark of each
task. One chunk of an output is one task. The data of a task are written before its mark, so that
a task without a mark is computed again, whatever its chunks contain.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.disk import reason
from fastslow.errors import (
    ArgumentError,
    FastSlowError,
    FileError,
    MissingPackageError,
    raised_by_handler,
)
from fastslow.results.base.extras import extra
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.io.encoding import classes
from fastslow.results.io.store_checksums import (
    METADATA,
    checksum_of_files,
    read_attributes,
    verified_arrays,
    write_group,
)
from fastslow.results.maps.tiles import (
    FILL,
    POINT,
    WORKER_DIED,
    Tiles,
    trailing,
    unit_attributes,
)

Array = NDArray[Any]

#: Version of the layout of a store.
STORE_FORMAT = 2

#: The version of Zarr since which files of chunks are written atomically.
NEEDED = (3, 1, 3)

#: Marks of tasks: not computed, computed, computed with failures, a worker died twice.
ABSENT, DONE, WITH_FAILURES, DIED = range(4)

#: Mark that is read where the file of the marks is lost; no task has it.
LOST_MARK = 255

#: Smallest time between writes of the marks, in seconds.
PAUSE = 0.25

#: Chunks of empty values are written: a chunk that is lost reads as one of them.
EMPTY = {"write_empty_chunks": True}

#: Types of arrays by kind.
TYPES: dict[str, Any] = {"f": "float64", "c": "complex128", "b": "bool", "U": str, "i": "int64"}


@dataclass(frozen=True)
class StoredOutput:
    """An output in a store, read at each access.

    Parameters
    ----------
    path : str
        The store.
    name : str
    shape : tuple of int
    kind : str
        Kind of its numbers as in NumPy, ``"U"`` for text.
    """

    path: str
    name: str
    shape: tuple[int, ...]
    kind: str

    @property
    def dtype(self) -> np.dtype[Any]:
        return np.dtype(TYPES[self.kind])

    def read(self) -> Array:
        """Return the array, read-only."""
        with translated(self.path, "read"):
            group = _zarr().open_group(self.path, mode="r")
            values = _plain(group[array_name(self.name)][...])
        values.flags.writeable = False
        return values


class ZarrStore:
    """A store that is being written; one process has it at a time, by its `Lock`.

    Parameters
    ----------
    path : Path
    about : dict
        Equations, function and so on, as plain values.
    axes : mapping
    paired : bool
    tiles : Tiles
    """

    def __init__(
        self,
        path: Path,
        about: Mapping[str, Any],
        axes: Mapping[str, Array],
        paired: bool,
        tiles: Tiles,
    ) -> None:
        self.path, self.about, self.axes = path, dict(about), axes
        self.paired, self.tiles = paired, tiles
        self.dims = (POINT,) if paired else tuple(map(array_name, axes))
        self.arrays: dict[str, Any] = {}
        self.marks = np.zeros(tiles.counts, dtype=np.uint8)
        self.checksums = np.zeros(tiles.counts, dtype=np.uint64)
        self._written = 0.0

    def create(self) -> None:
        """Write the axes and the marks; the metadata that name them complete the store."""
        with translated(self.path, "written"):
            self.path.mkdir(parents=True, exist_ok=True)
            self._write_group(())
            for entry in self.path.iterdir():
                if entry.is_dir():
                    shutil.rmtree(entry)
            self.group = _zarr().open_group(str(self.path), mode="r+", use_consolidated=False)
            self._require_distinct(self.axes)
            for name, values in self.axes.items():
                dims = (POINT,) if self.paired else (array_name(name),)
                array = _create(
                    self.group, name, values.shape, values.shape, TYPES[values.dtype.kind], dims
                )
                array.attrs.update(unit_attributes(self.about["units"], name))
                array[...] = values
            self.arrays["failure"] = _create(
                self.group, "failure", self.tiles.shape, self.tiles.size, str, self.dims
            )
            tasks = tuple(f"{name}_task" for name in self.dims)
            counts = self.tiles.counts
            for name, values in (("done", self.marks), ("checksum", self.checksums)):
                self.arrays[name] = _create(self.group, name, counts, counts, values.dtype, tasks)
                self.arrays[name][...] = values
            self.about["checksums"] = axis_checksums(self.path, self.axes)
            self._write_group((*self.axes, *self.arrays))

    def resume(self) -> int:
        """Read the marks of a store that exists, and remove incomplete files.

        Returns the number of tasks whose files are damaged, which are to be computed again.
        """
        names = ("failure", "done", "checksum", *self.about.get("outputs", ()))
        with translated(self.path, "read"):
            zarr = _zarr()
            self.group = zarr.open_group(str(self.path), mode="r+", use_consolidated=False)
            with zarr.config.set({f"array.{name}": value for name, value in EMPTY.items()}):
                self.arrays = {name: self.group[array_name(name)] for name in names}
            self.marks = np.array(self.arrays["done"][...])
            self.checksums = np.array(self.arrays["checksum"][...])
            damaged = damaged_tasks(self.path, self.tiles, self.arrays, self.marks, self.checksums)
        self.marks.flat[damaged] = ABSENT
        with translated(self.path, "written"):
            for pattern in ("*.partial", ".fastslow-*"):
                for incomplete in self.path.rglob(pattern):
                    incomplete.unlink(missing_ok=True)
        return len(damaged)

    def _write_group(self, names: Iterable[str]) -> None:
        """Write what the store names, and the metadata of its arrays, with a checksum."""
        attributes: dict[str, Any] = {"fastslow": self.about}
        if self.paired:
            attributes["coordinates"] = " ".join(map(array_name, self.axes))
        write_group(self.path, attributes, map(array_name, names))

    def write(self, k: int, outputs: Mapping[str, Array], failures: Mapping[int, str]) -> None:
        """Write the outputs of a task, shape (m, ...), then its mark."""
        part, box = self.tiles.slices(k), self.tiles.box(k)
        with translated(self.path, "written", self._resumable()):
            if outputs and not set(outputs) <= self.arrays.keys():
                self._create_outputs(outputs)
            for file in files_of_task(self.tiles, self.arrays, k):
                # of an earlier attempt, which may be damaged
                (self.path / file).unlink(missing_ok=True)
            for name, values in outputs.items():
                self.arrays[name][part] = values.reshape(box + values.shape[1:])
            if failures:
                texts = np.full(math.prod(box), "", dtype=object)
                texts[list(failures)] = list(failures.values())
                self.arrays["failure"][part] = texts.reshape(box)
        self.mark(k, WITH_FAILURES if failures else DONE)

    def mark(self, k: int, value: int) -> None:
        with translated(self.path, "read"):
            files = files_of_task(self.tiles, self.arrays, k)
            self.checksums.flat[k] = checksum_of_files(self.path, files, value)
        self.marks.flat[k] = value
        if time.monotonic() - self._written > PAUSE:
            self.flush()

    def flush(self) -> None:
        """Write the marks, after the checksums that go with them."""
        with translated(self.path, "written", self._resumable()):
            self.arrays["checksum"][...] = self.checksums
            self.arrays["done"][...] = self.marks
        self._written = time.monotonic()

    def _create_outputs(self, outputs: Mapping[str, Array]) -> None:
        """Create the arrays of the outputs; their names in the attributes complete them."""
        self._require_distinct((*self.axes, *outputs))
        for name, values in outputs.items():
            shape, inner = self.tiles.shape, values.shape[1:]
            dims = self.dims + trailing(array_name(name), len(inner))
            size = self.tiles.size + inner
            self.arrays[name] = _create(
                self.group, name, shape + inner, size, TYPES[values.dtype.kind], dims
            )
            self.arrays[name].attrs.update(unit_attributes(self.about["units"], name))
        self.about["outputs"] = list(outputs)
        self._write_group((*self.axes, *self.arrays))

    def _require_distinct(self, names: Iterable[str]) -> None:
        """Raise ArgumentError for names that are one directory on a disk that ignores case."""
        if not (self.path / "ZARR.JSON").exists():
            return
        folded: dict[str, str] = {}
        for name in names:
            other = folded.setdefault(name.casefold(), name)
            if other != name:
                raise ArgumentError(
                    f"{other} and {name} would be one directory of {self.path}, on a disk that "
                    "ignores case; rename one"
                )

    def kinds(self) -> dict[str, Array]:
        """Return an empty array of the kind and the shape of each output at a point."""
        count = len(self.tiles.shape)
        found = {}
        for name, array in self.arrays.items():
            if name not in ("failure", "done", "checksum"):
                found[name] = np.empty((0, *array.shape[count:]), _dtype(array))
        return found

    def _resumable(self) -> str:
        done = np.count_nonzero(self.marks)
        return f"; {done} of {len(self.tiles)} tasks are stored, and the same call resumes them"


def read_store(path: Path) -> Any:
    """Return the grid of a store; its outputs are read when they are used.

    Raises
    ------
    FileError
        If the directory is not a store of a sweep, of a newer version, or damaged.
    MissingPackageError
        Without Zarr.
    """
    about = read_about(path)
    if "axes" not in about:
        raise FileError(
            f"{path} is the store of an adaptive map or of attractors: the same call resumes it; "
            f"its batches of points are grids, such as {path / 'batch_1'}"
        )
    if not has_marks(path):
        raise FileError(f"{path} has no marks yet: the sweep ended before its first task")
    axes = read_axes(path, about)
    with translated(path, "read"):
        group = _zarr().open_group(str(path), mode="r", use_consolidated=False)
        names = ("failure", *about.get("outputs", ()))
        arrays = {name: group[array_name(name)] for name in names}
        marks = group["done"][...]
        tiles = Tiles(tuple(group["failure"].shape), tuple(about["tasks"]))
        damaged = damaged_tasks(path, tiles, arrays, marks, group["checksum"][...])
        if damaged:
            files = ", ".join(files_of_task(tiles, arrays, damaged[0]))
            raise FileError(
                f"{path} is damaged: {len(damaged)} of {len(tiles)} tasks differ from their "
                f"checksums, the first in one of {files} or its mark; the same call of the sweep "
                "computes them again"
            )
        outputs = {
            name: StoredOutput(str(path), name, tuple(array.shape), _dtype(array).kind)
            for name, array in arrays.items()
            if name != "failure"
        }
        failures: dict[int, str] = {}
        for k in np.flatnonzero(marks >= WITH_FAILURES).tolist():
            rows = tiles.points(k)
            if marks.flat[k] == DIED:
                failures |= dict.fromkeys(range(rows.start, rows.stop), WORKER_DIED)
                continue
            texts = arrays["failure"][tiles.slices(k)].reshape(-1)
            failures |= {rows.start + j: str(text) for j, text in enumerate(texts) if text}
    done = np.isin(tiles.spread(marks), (DONE, WITH_FAILURES)).reshape(-1)
    return classes()["Grid"](
        axes=NamedMapping("axis", axes),
        paired=about["paired"],
        outputs=NamedMapping("output", outputs),
        done=done,
        failed=np.array(list(failures), dtype=np.int64),
        reasons=tuple(failures.values()),
        function=about["function"],
        equations=about["equations"],
        settings=NamedMapping(
            "setting", {n: tuple(v) if type(v) is list else v for n, v in about["settings"].items()}
        ),
        versions=NamedMapping("version", about["versions"]),
        notes=tuple(about["notes"]),
        units=NamedMapping("unit", about.get("units", {})),
    )


def read_axes(path: Path, about: Mapping[str, Any]) -> dict[str, Array]:
    """Return the axes of the store of a sweep; FileError if they are damaged."""
    names = about["axes"]
    with translated(path, "read"):
        found = axis_checksums(path, names)
        for name in names:
            if found[name] != about["checksums"][name]:
                raise FileError(f"{path} is damaged: the axis {name} differs from its checksum")
        group = _zarr().open_group(str(path), mode="r", use_consolidated=False)
        return {name: _plain(group[array_name(name)][...]) for name in names}


def axis_checksums(path: Path, names: Iterable[str]) -> dict[str, int]:
    """Return the checksum of the file of each axis."""
    return {name: checksum_of_files(path, [f"{array_name(name)}/c/0"]) for name in names}


def files_of_task(tiles: Tiles, arrays: Mapping[str, Any], k: int) -> list[str]:
    """Return the names of the files of a task: those of its failures and its outputs."""
    place = np.unravel_index(k, tiles.counts)
    files = []
    for name, array in arrays.items():
        if name not in ("done", "checksum"):
            inner = array.ndim - len(place)
            files.append("/".join((array_name(name), "c", *map(str, place), *"0" * inner)))
    return files


def damaged_tasks(
    path: Path, tiles: Tiles, arrays: Mapping[str, Any], marks: Array, checksums: Array
) -> list[int]:
    """Return the tasks whose files or mark differ from their checksums."""
    return [
        k
        for k in np.flatnonzero(marks).tolist()
        if checksums.flat[k]
        != checksum_of_files(path, files_of_task(tiles, arrays, k), int(marks.flat[k]))
    ]


def require_group(path: Path, chunk: int) -> int:
    """Create the group of batches of points, or accept one that exists.

    Returns the number of points of its tasks.

    Raises
    ------
    FileError
        If the path is a file, another directory, or the store of a sweep.
    """
    if path.exists() and not path.is_dir():
        raise FileError(f"{path} is a file; expected the directory of a Zarr store")
    if path.is_dir() and any(path.iterdir()):
        about = read_about(path)
        if "axes" in about:
            raise FileError(f"{path} is the store of a sweep; expected one with batches of points")
        return int(about["chunk"])
    with translated(path, "written"):
        path.mkdir(parents=True, exist_ok=True)
        write_group(path, {"fastslow": {"format": STORE_FORMAT, "chunk": chunk}}, ())
    return chunk


def has_marks(path: Path) -> bool:
    """Return True if the store of a sweep was created completely."""
    with translated(path, "read"):
        return "done" in verified_arrays(path)


def read_about(path: Path) -> dict[str, Any]:
    """Return what a store names: its function, axes, settings and versions; errors as above."""
    _zarr()
    with translated(path, "read"):
        if not (path / METADATA).exists():
            raise FileError(f"{path} is a directory without a Zarr group")
        about = read_attributes(path).get("fastslow")
    if not isinstance(about, dict) or "format" not in about:
        raise FileError(f"{path} is a Zarr group that was not written by a sweep of fastslow")
    if about["format"] != STORE_FORMAT:
        version = about.get("versions", {}).get("fastslow", "of unknown version")
        raise FileError(
            f"{path} was written by fastslow {version} in format {about['format']} of stores; this "
            f"is fastslow {import_module('fastslow').__version__}, which reads format "
            f"{STORE_FORMAT}" + ": upgrade it" * (about["format"] > STORE_FORMAT)
        )
    with translated(path, "read"):
        verified_arrays(path)
    return about


@contextlib.contextmanager
def translated(path: object, done: str, more: str = "") -> Iterator[None]:
    """Raise FileError for the errors of Zarr and of the disk."""
    try:
        yield
    except FastSlowError:
        raise
    except Exception as error:
        if raised_by_handler(error):
            raise
        if isinstance(error, OSError) and getattr(error, "strerror", None):
            raise FileError(f"{path} cannot be {done}: {reason(error)}{more}") from error
        raise FileError(f"{path} is damaged, or no store of a sweep: {reason(error)}") from error


def _zarr() -> Any:
    """Import Zarr, of a version whose writes are atomic."""
    zarr = extra("zarr", "cluster")
    found = tuple(int(part) for part in zarr.__version__.split(".")[:3] if part.isdigit())
    if found < NEEDED:
        raise MissingPackageError(
            f"this needs zarr {'.'.join(map(str, NEEDED))} or later, which writes chunks "
            f"atomically; found {zarr.__version__}: pip install -U 'fastslow[cluster]'"
        )
    return zarr


def array_name(name: str) -> str:
    """Return the name of the array of an axis or an output; a slash would begin a folder."""
    return name.replace("/", "\N{DIVISION SLASH}")


def _create(
    group: Any,
    name: str,
    shape: tuple[int, ...],
    chunks: tuple[int, ...],
    dtype: Any,
    dims: tuple[str, ...],
) -> Any:
    """Create an array of a store."""
    kind = "U" if dtype is str else np.dtype(dtype).kind
    codecs = import_module("zarr.codecs")
    return group.create_array(
        array_name(name),
        shape=shape,
        # a dimension of length zero still has chunks of one
        chunks=tuple(max(n, 1) for n in chunks),
        dtype=dtype,
        compressors=(codecs.ZstdCodec(level=0), codecs.Crc32cCodec()),
        fill_value={**FILL, "i": 0, "u": LOST_MARK}[kind],
        dimension_names=dims,
        config=EMPTY,
        overwrite=True,
    )


def _dtype(array: Any) -> np.dtype[Any]:
    """Return the type of the numbers of an array, that of text as Unicode."""
    kind = array.dtype.kind
    return np.dtype("U") if kind in "TO" else np.dtype(array.dtype)


def _plain(values: Any) -> Array:
    """Return an array that was read, text as Unicode of fixed width."""
    array = np.asarray(values)
    if array.dtype.kind == "T":
        width = int(np.strings.str_len(array).max()) if array.size else 0
        return array.astype(f"U{max(width, 1)}")
    return array.astype(str) if array.dtype.kind == "O" else array
