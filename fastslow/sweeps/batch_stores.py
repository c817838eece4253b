"""Stores of computations whose points depend on earlier results: one for each batch of points."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fastslow.results.io.lock import Lock
from fastslow.results.io.zarr_store import (
    has_marks,
    read_about,
    read_axes,
    require_group,
    translated,
)
from fastslow.simulation.settings import Execution
from fastslow.sweeps.function_digest import identity_of

#: Default number of points of a task of an executor or a store.
POINTS_OF_TASK = 256


class BatchStores:
    """Size of the tasks of successive batches, and their stores in one directory.

    One process has the directory at a time, within a ``with`` statement.

    Parameters
    ----------
    execution : Execution
        With the directory as its store, which is created; or without one.

    Attributes
    ----------
    chunk : int or None
        Points of a task: as given, that of an existing directory, or 256; None for batches
        that are computed at once.
    count : int
        Number of batches so far.

    Raises
    ------
    FileError
        On entry, if the directory is in use, cannot be written or is no group of batches.
    """

    def __init__(self, execution: Execution) -> None:
        self.execution, self.chunk = execution, execution.chunk
        self.count = 0
        self.path = None if execution.store is None else Path(execution.store).absolute()

    def __enter__(self) -> Self:
        if self.path is not None:
            self.lock = Lock(self.path)
            self.lock.__enter__()
            try:
                recorded = require_group(self.path, self.chunk or POINTS_OF_TASK)
            except BaseException:
                self.lock.__exit__()
                raise
            self.chunk = self.chunk or recorded
        elif self.execution.executor is not None:
            self.chunk = self.chunk or POINTS_OF_TASK
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self.path is None:
            return
        try:
            while kind is None and self._batch(self.count + 1).exists():
                self.count += 1
                self._remove(self._batch(self.count))
        finally:
            self.lock.__exit__()

    def following(self, axes: Mapping[str, NDArray[Any]], function: Any) -> Execution:
        """Return the execution of the next batch, whose points and function are given.

        A stored batch after the first with others is removed: an earlier one was resumed, and a
        task of it that had failed because a worker died has succeeded now.
        """
        self.count += 1
        store = None
        if self.path is not None:
            self.lock.check()
            store = self._batch(self.count)
            if self.count > 1 and store.exists() and has_marks(store):
                known = read_about(store)
                stored = read_axes(store, known)
                same = all(np.array_equal(stored[name], axes[name]) for name in axes)
                if not same or known["digest"] != identity_of(function).digest:
                    self._remove(store)
        return replace(self.execution, store=store, chunk=self.chunk, progress=False)

    def _batch(self, number: int) -> Path:
        assert self.path is not None
        return self.path / f"batch_{number}"

    def _remove(self, batch: Path) -> None:
        with translated(batch, "removed"):
            shutil.rmtree(batch)
