"""Collection of the outputs of a sweep in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from fastslow.results.maps.grid import FILL, Grid
from fastslow.results.maps.tiles import Tiles
from fastslow.sweeps.evaluation import Computed, check_kinds, require_memory
from fastslow.sweeps.scheduling import DIED

Array = NDArray[Any]


class Collector(Protocol):
    """Receives the outputs of tasks in any order."""

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
                self._check_memory(computed)
                self.kinds = computed.outputs
            check_kinds(computed.outputs, self.kinds)
            self.outputs[k] = computed.outputs
        rows = self.tiles.points(k)
        self.failures |= {rows.start + row: text for row, text in computed.failures.items()}
        self.done[rows] = True

    def lose(self, k: int) -> None:
        rows = self.tiles.points(k)
        self.failures |= dict.fromkeys(range(rows.start, rows.stop), DIED)

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
