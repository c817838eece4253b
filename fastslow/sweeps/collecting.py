"""Collection of the outputs of a sweep, in memory or in a store."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, FileError, unknown_name
from fastslow.results.base.display import value_text
from fastslow.results.io.lock import Lock
from fastslow.results.io.zarr_store import (
    DIED,
    STORE_FORMAT,
    ZarrStore,
    has_marks,
    read_about,
    read_axes,
    read_store,
)
from fastslow.results.maps.grid import Grid
from fastslow.results.maps.tiles import FILL, POINT, WORKER_DIED, Tiles
from fastslow.sweeps.evaluation import Computed, check_kinds, require_memory
from fastslow.sweeps.function_digest import FunctionIdentity

Array = NDArray[Any]

#: Names of arrays and files that a grid or its store has besides axes and outputs.
RESERVED = ("checksum", "computed", "done", "failure", POINT, "zarr.json")


class Collector(Protocol):
    """Receives the outputs of tasks in any order."""

    tiles: Tiles

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...

    def finished(self, k: int) -> bool:
        """Return True for tasks that need not be computed."""

    def add(self, k: int, computed: Computed) -> None:
        """Add the outputs of a task."""

    def lose(self, k: int) -> None:
        """Record that a worker died twice during a task."""

    def grid(self) -> Grid:
        """Return the outputs received."""


class Memory:
    """Collects outputs in memory.

    Parameters
    ----------
    about : dict
        The fields of the grid that are known before: axes, function and so on.
    tiles : Tiles
    """

    def __init__(self, about: Mapping[str, Any], tiles: Tiles) -> None:
        self.about, self.tiles = about, tiles
        self.outputs: dict[int, dict[str, Array]] = {}
        self.kinds: dict[str, Array] = {}
        self.done = np.zeros(math.prod(tiles.shape), dtype=bool)
        self.failures: dict[int, str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def finished(self, k: int) -> bool:
        return False

    def add(self, k: int, computed: Computed) -> None:
        if computed.outputs:
            if not self.kinds:
                _check_names(self.about, computed)
                self._check_memory(computed)
                self.kinds = computed.outputs
            check_kinds(computed.outputs, self.kinds)
            self.outputs[k] = computed.outputs
        rows = self.tiles.points(k)
        self.failures |= {rows.start + row: text for row, text in computed.failures.items()}
        self.done[rows] = True

    def lose(self, k: int) -> None:
        rows = self.tiles.points(k)
        self.failures |= dict.fromkeys(range(rows.start, rows.stop), WORKER_DIED)

    def _check_memory(self, computed: Computed) -> None:
        size = sum(values.nbytes for values in computed.outputs.values()) / computed.count
        require_memory(
            size * len(self.done),
            "the outputs of all points",
            "write them to a store, execution=fs.Execution(store='map.zarr')",
        )

    def grid(self) -> Grid:
        outputs = {}
        for name, first in self.kinds.items():
            received = {k: part[name] for k, part in self.outputs.items()}
            dtype = np.result_type(*(values.dtype for values in received.values()))
            values = np.full((len(self.done), *first.shape[1:]), FILL[dtype.kind], dtype=dtype)
            for k, part in received.items():
                values[self.tiles.points(k)] = part
            outputs[name] = values.reshape((*self.tiles.shape, *first.shape[1:]))
            outputs[name].flags.writeable = False
        rows = sorted(self.failures)
        return Grid(
            outputs=outputs,
            done=self.done,
            failed=np.array(rows, dtype=np.int64),
            reasons=tuple(self.failures[row] for row in rows),
            **self.about,
        )


class Stored:
    """Writes outputs to a store, which it creates or resumes.

    Parameters
    ----------
    path : str or path
    about : dict
        The fields of the grid that are known before.
    tiles : Tiles
    identity : FunctionIdentity
    chunk : int, optional
        Size of the tasks if it is prescribed; else a store that exists keeps its own.
    resume : bool or str
        Whether to accept a store that exists, ``"anyway"`` with values that cannot be compared.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        about: Mapping[str, Any],
        tiles: Tiles,
        *,
        identity: FunctionIdentity,
        chunk: int | None,
        resume: bool | str,
    ) -> None:
        self.path = Path(path).absolute()
        self.about, self.tiles, self.chunk, self.resume = about, tiles, chunk, resume
        self.identity = identity
        self.lock = Lock(self.path)
        self.kinds: dict[str, Array] = {}
        self.damaged = 0

    def _described(self) -> dict[str, Any]:
        """Return what the store names, as plain values."""
        about = self.about
        settings = {n: list(v) if isinstance(v, tuple) else v for n, v in about["settings"].items()}
        return {
            "format": STORE_FORMAT,
            "axes": list(about["axes"]),
            "paired": about["paired"],
            "tasks": list(self.tiles.size),
            "function": about["function"],
            "digest": self.identity.digest,
            "equations": about["equations"],
            "settings": settings,
            "versions": dict(about["versions"]),
            "notes": list(about["notes"]),
            "units": dict(about["units"]),
        }

    def __enter__(self) -> Self:
        if self.path.exists() and not self.path.is_dir():
            raise FileError(f"{self.path} is a file; expected the directory of a Zarr store")
        self.lock.__enter__()
        try:
            self._open()
        except BaseException:
            self.lock.__exit__()
            raise
        return self

    def _open(self) -> None:
        known: dict[str, Any] | None = None
        if self.path.is_dir() and any(self.path.iterdir()):
            known = read_about(self.path)
            if not self.resume:
                raise ArgumentError(
                    f"{self.path} exists; expected resume=True to continue it, or another store"
                )
            if known["paired"] == self.about["paired"] and self.chunk is None:
                self.tiles = Tiles(self.tiles.shape, tuple(known["tasks"]))
        about = self._described()
        incomplete = known is not None and not has_marks(self.path)
        if known is not None:
            self._compare(known, about, values=not incomplete)
            if not incomplete:
                about |= {n: known[n] for n in ("checksums", "outputs") if n in known}
        store = ZarrStore(self.path, about, self.about["axes"], about["paired"], self.tiles)
        if known is None or incomplete:
            store.create()
        else:
            self.damaged = store.resume()
        self.store = store
        self.kinds = store.kinds()

    def _compare(self, known: Mapping[str, Any], about: Mapping[str, Any], *, values: bool) -> None:
        """Raise ArgumentError if a store is of another sweep, with the difference."""
        names = ("axes", "paired", "function", "equations", "settings", "versions", "tasks")
        found = [
            f"{name}: {value_text(known.get(name))}, now {value_text(about[name])}"
            for name in names
            if known.get(name) != about[name]
        ]
        units = known.get("units", {})
        if units != about["units"]:
            found.append(f"units: {value_text(units)}, now {value_text(about['units'])}")
        if known.get("function") == about["function"] and known.get("digest") != about["digest"]:
            found.append(
                f"function: the code of {about['function']} or values that it reaches have changed"
            )
        if not found and values:
            for name, stored in read_axes(self.path, known).items():
                axis = self.about["axes"][name]
                if stored.dtype != axis.dtype or not np.array_equal(stored, axis):
                    if stored.dtype.kind == axis.dtype.kind == "U" and (stored == axis).all():
                        continue
                    found.append(f"axis {name}: {_span(stored)}, now {_span(axis)}")
        if found:
            raise ArgumentError(
                f"{self.path} is of another sweep ({'; '.join(found)}); use another store, or "
                "remove this one"
            )
        if values and self.identity.undigested and self.resume != "anyway":
            raise ArgumentError(
                f"{self.path} has results of {about['function']}, of which these values may have "
                f"changed since: {', '.join(self.identity.undigested)}; expected resume='anyway' "
                "to keep the results, or another store"
            )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            # with an error, the marks of the last tasks are written if that is still possible
            with contextlib.suppress(FileError) if error else contextlib.nullcontext():
                self.lock.check()
                self.store.flush()
        finally:
            self.lock.__exit__()

    def finished(self, k: int) -> bool:
        return self.store.marks.flat[k] not in (0, DIED)

    def add(self, k: int, computed: Computed) -> None:
        self.lock.check()
        if computed.outputs:
            if not self.kinds:
                _check_names(self.about, computed)
                self.kinds = computed.outputs
            check_kinds(computed.outputs, self.kinds)
        self.store.write(k, computed.outputs, computed.failures)

    def lose(self, k: int) -> None:
        self.store.mark(k, DIED)

    def grid(self) -> Grid:
        grid: Grid = read_store(self.path)
        if not self.damaged:
            return grid
        note = f"Files of {self.damaged} tasks of the store were damaged; they are computed again."
        return replace(grid, notes=(*grid.notes, note))


def usable(name: str) -> bool:
    """Return True for names that axes and outputs may have in a grid and its store."""
    return name.strip(".") != "" and name not in RESERVED and not name.startswith("__")


def _check_names(about: Mapping[str, Any], computed: Computed) -> None:
    """Check the names of outputs, and that every unit is of an axis or of one of them."""
    for name in computed.outputs:
        if name in about["axes"]:
            raise ArgumentError(
                f"the function returned an output with the name of an axis, {name}; rename it"
            )
        if not usable(name):
            raise ArgumentError(
                f"the function returned an output with the name {name or repr(name)}, which is "
                "used by the grid; rename it"
            )
    known = (*about["axes"], *computed.outputs)
    for name in about["units"]:
        if name not in known:
            raise unknown_name("axis or output with a unit", name, known)


def _span(values: Array) -> str:
    if values.dtype.kind in "Ub" or len(values) < 4:
        return value_text(values)
    return f"{len(values)} values from {values.min():.6g} to {values.max():.6g}"
