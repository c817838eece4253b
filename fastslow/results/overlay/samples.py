"""Samples of a run over equilibria, between which the run is known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.table import check_values
from fastslow.results.overlay.overlaid_rows import Columns, OverlaidRows
from fastslow.results.trajectory.queries.lookup import states_between_samples
from fastslow.results.trajectory.queries.nearest import nearest_on_line, units_of
from fastslow.results.trajectory.queries.state_at import StatePoint

Array = NDArray[np.float64]


class Samples(OverlaidRows):
    """The samples of a run, whose states at other times are those of the run."""

    share_of = "time"

    def columns(self) -> Columns:
        of = self.of
        own = {name: partial(getattr, of, name) for name in ("distance", "lag", "t")}
        return {**own, **of.run._columns(), "t": own["t"], of.parameter: lambda: of.slow}

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys([self.of.parameter, *self.of.run.columns, "t"]))

    def labels(self) -> NDArray[np.str_]:
        labels, bands = super().labels(), self.of.diagram.bands
        if self.of.band is None or not bands:
            return labels
        names = np.array([band.name for band in bands])
        edges = np.array([band.edge for band in bands])
        regions = np.array([band.region for band in bands])
        rests = self.of.run.regions_at(self.of.t) == regions[self.of.band]
        kept = np.where(rests, names[self.of.band], edges[self.of.band])
        return np.where(self.of.band >= 0, kept, labels)

    @property
    def known_labels(self) -> tuple[str, ...]:
        bands = (name for band in self.of.diagram.bands for name in (band.name, band.edge))
        return tuple(dict.fromkeys([*super().known_labels, *bands]))

    def point(self, row: int) -> StatePoint:
        return self._measured([self.of.run[row]])[0]

    def points(self) -> Iterator[StatePoint]:
        blocks = self.of.run.points_in_blocks()
        return chain.from_iterable(self._measured(block) for block in blocks)

    def at(
        self, name: str, level: float, region: str | None, direction: int | None
    ) -> list[StatePoint]:
        run = self.of.run
        if name in (*run.columns, "t"):
            return self._measured(run.at(region=region, direction=direction, **{name: level}))
        samples = run.t, self.of.slow
        found = states_between_samples(run._points_at, samples, name, level, direction)
        return self._measured([point for point in found if region in (None, point.region)])

    def nearest(self, values: Mapping[str, float]) -> StatePoint:
        run = self.of.run
        check_values(values, self.names, "column")
        if set(values) <= {*run.columns, "t"}:
            return self._measured([run.nearest(**values)])[0]
        columns = self.columns()
        table = np.column_stack([columns[name]() for name in values])
        scale = units_of(table)
        target = np.array([float(value) for value in values.values()])
        time, _ = nearest_on_line(self.of.t, table / scale, target / scale)
        (point,) = run._points_at(np.array([time]))
        return self._measured([replace(point, interpolated=time not in self.of.t)])[0]

    def _measured(self, points: list[StatePoint]) -> list[StatePoint]:
        """Add the stable branch followed and the distance from it to states of the run."""
        of, states = self.of, self.of.diagram.states
        times = np.array([point.time for point in points])
        row = np.clip(np.searchsorted(of.t, times, side="right") - 1, 0, len(of) - 1)
        after = np.minimum(row + 1, len(of) - 1)
        step = of.t[after] - of.t[row]
        part = np.where(step > 0, (times - of.t[row]) / np.where(step > 0, step, 1.0), 0.0)
        near, far = of.distance[row], of.distance[after]
        together = (of.followed[row] == of.followed[after]) & np.isfinite(near) & np.isfinite(far)
        distance = np.where(together, near + part * np.where(together, far - near, 0.0), near)
        slow = of.slow[row] + part * (of.slow[after] - of.slow[row])
        found, labels = [], self.labels()
        for k, point in enumerate(points):
            number = int(of.followed[row[k]])
            branch = None if number < 0 else of.stable_branches[number].branch
            names = (name for name in (*point.states, *point.slow) if name not in states)
            # the parameter of a path is no column of the run
            slow_ones = {of.parameter: float(slow[k]), **{name: point[name] for name in names}}
            found.append(
                replace(
                    point,
                    states=states,
                    state=np.array([point[name] for name in states]),
                    slow=slow_ones,
                    parameters={**of.diagram.parameters, **point.parameters},
                    parameter=of.parameter,
                    stable_branch=str(labels[row[k]]),
                    branch=branch,
                    distance=float(distance[k]),
                )
            )
        return found

    def weights(self) -> Array:
        return np.diff(self.of.t)

    def part(self, start: int, stop: int) -> Mapping[str, Any]:
        band = None if self.of.band is None else self.of.band[start:stop]
        return {"run": self.of.run[start:stop], "band": band}

    def count(self) -> str:
        return ""

    def lacking(self) -> str:
        if not self.of.stable_branches and not self.of.diagram.bands:
            return "the diagram has no stable branch"
        if not any(point.turns for point in self.of.diagram.special):
            return "the diagram has no fold"
        return ""

    def doubts(self) -> list[str]:
        laws = (t.law for t in self.of.transitions if t.law is not None and t.law.lost)
        return list(dict.fromkeys(f"{law.point.label}: {law.validity}" for law in laws))
