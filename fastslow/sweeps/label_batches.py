"""Batches of points at which an adaptive map evaluates its function, in memory or in a store."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import items
from fastslow.errors import ArgumentError, raised_by_handler
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.maps.adaptive_map import FAILED, Label, label_of
from fastslow.results.maps.grid import Grid
from fastslow.results.maps.tiles import WORKER_DIED, Tiles
from fastslow.simulation.settings import Execution, task_threads
from fastslow.sweeps.batch_stores import BatchStores
from fastslow.sweeps.collecting import Stored, usable
from fastslow.sweeps.evaluation import Computed, portable
from fastslow.sweeps.function_digest import identity_of, undigested_notes, versions
from fastslow.sweeps.scheduling import Lost, completed

#: Names of the outputs of a batch.
OUTPUTS = ("label", "type")

Floats = NDArray[np.float64]
Function = Callable[[Floats, Floats], Sequence[Any] | NDArray[Any]]

#: Labels from text, by the name of their type.
TYPES: dict[str, Callable[[str], Label]] = {"bool": "True".__eq__, "int": int, "str": str}


@dataclass(frozen=True)
class LabelFunction:
    """Evaluates a function at the points of a task, in the process of a worker."""

    function: Function
    threads: int | None

    def __call__(self, points: Floats) -> list[Any]:
        """Return the label, or the exception, at each of the points of shape (m, 2)."""
        with task_threads(self.threads):
            return self._values(points)

    def _values(self, points: Floats) -> list[Any]:
        try:
            values = self.function(points[:, 0].copy(), points[:, 1].copy())
        except Exception as error:
            if raised_by_handler(error):
                raise
            # bisect, so that a point that raises does not affect the others
            if len(points) > 1:
                half = len(points) // 2
                return self._values(points[:half]) + self._values(points[half:])
            return [portable(error)]
        values = list(items()("what the function returns", values))
        if len(values) != len(points):
            raise ArgumentError(
                f"the function returned {len(values)} labels for {len(points)} points"
            )
        return values


class Batches:
    """Evaluates batches of points; a store has a group for each batch.

    Parameters
    ----------
    function : callable
    names : (str, str)
    stores : BatchStores
    settings : mapping
        What determines the points of all batches.
    report : callable
        Called with numbers of evaluated points.
    """

    def __init__(
        self,
        function: Function,
        names: tuple[str, str],
        stores: BatchStores,
        settings: Mapping[str, Any],
        report: Callable[[int], object],
    ) -> None:
        self.call = LabelFunction(function, stores.execution.task_threads)
        self.names, self.stores, self.report = names, stores, report
        if stores.path is not None:
            for name in names:
                if name in OUTPUTS or not usable(name):
                    raise ArgumentError(f"over: a store of maps uses the name {name}; rename it")
            self.identity = identity = identity_of(function)
            self.about = {
                "paired": True,
                "function": identity.name,
                "equations": identity.equations,
                "settings": NamedMapping("setting", settings),
                "versions": NamedMapping("version", versions(identity)),
                "notes": undigested_notes(identity),
                "units": NamedMapping("unit"),
            }

    def evaluate(self, points: Floats) -> list[tuple[Label, str]]:
        """Return the label at each point, and the reason where it failed.

        Raises
        ------
        Exception
            The error at the first point, if every point of the first batch raises.
        """
        columns = zip(self.names, points.T.copy(), strict=True)
        axes: NamedMapping[Floats] = NamedMapping("axis", columns)
        execution = self.stores.following(axes, self.call.function)
        chunk = min(execution.chunk or len(points), len(points))
        tiles = Tiles((len(points),), (chunk,))
        if execution.store is None:
            return self._evaluate(points, tiles, execution)
        return self._evaluate_in(points, tiles, execution, axes)

    def _evaluate(
        self, points: Floats, tiles: Tiles, execution: Execution
    ) -> list[tuple[Label, str]]:
        tasks = ((k, points[tiles.points(k)]) for k in range(len(tiles)))
        found: dict[int, list[Any]] = {}
        for k, values in completed(self.call, tasks, execution.executor):
            if isinstance(values, Lost):
                values = [RuntimeError(WORKER_DIED)] * tiles.box(k)[0]
            found[k] = values
            self.report(len(values))
        values = [value for k in range(len(tiles)) for value in found[k]]
        errors = [value for value in values if isinstance(value, Exception)]
        if self.stores.count == 1 and len(errors) == len(points):
            raise errors[0]
        return [label_of(value) for value in values]

    def _evaluate_in(
        self, points: Floats, tiles: Tiles, execution: Execution, axes: NamedMapping[Floats]
    ) -> list[tuple[Label, str]]:
        """Evaluate a batch that is in the store, or the tasks of it that are missing."""
        assert execution.store is not None
        collector = Stored(
            execution.store,
            {**self.about, "axes": axes},
            tiles,
            identity=self.identity,
            chunk=execution.chunk,
            resume=execution.resume,
        )
        with collector:
            waiting = [k for k in range(len(tiles)) if not collector.finished(k)]
            self.report(len(points) - sum(tiles.box(k)[0] for k in waiting))
            tasks = ((k, points[tiles.points(k)]) for k in waiting)
            for k, values in completed(self.call, tasks, execution.executor):
                if isinstance(values, Lost):
                    collector.lose(k)
                else:
                    collector.add(k, _computed(values))
                self.report(tiles.box(k)[0])
        labels = _labels(collector.grid())
        if self.stores.count == 1 and all(label == FAILED for label, _ in labels):
            raise ArgumentError(f"the function failed at every point of a map: {labels[0][1]}")
        return labels


def _computed(values: list[Any]) -> Computed:
    """Return labels as outputs of text with the name of their type."""
    labels = [label_of(value) for value in values]
    outputs = {
        "label": np.array([str(label) for label, _ in labels]),
        "type": np.array([type(label).__name__ for label, _ in labels]),
    }
    failures = {k: reason for k, (label, reason) in enumerate(labels) if label == FAILED}
    return Computed(len(labels), outputs, failures)


def _labels(grid: Grid) -> list[tuple[Label, str]]:
    """Return the labels of a batch, and the reasons where they failed."""
    reasons = dict(zip(grid.failed.tolist(), grid.reasons, strict=True))
    labels: list[tuple[Label, str]] = [(FAILED, reasons.get(k, "")) for k in range(len(grid))]
    if grid.outputs:
        pairs = zip(grid["label"].tolist(), grid["type"].tolist(), strict=True)
        for k, (text, kind) in enumerate(pairs):
            if k not in reasons:
                labels[k] = TYPES[kind](text), ""
    return labels
