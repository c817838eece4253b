"""Strobes of a run over forced orbits: its states at whole periods of the forcing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.results.base.table import check_values, inside, nearest_row
from fastslow.results.orbits.functionals import split
from fastslow.results.overlay.overlaid_rows import Columns, OverlaidRows
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.steps.dense import DenseOutput
from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials
from fastslow.results.trajectory.steps.step_roots import find_roots

Array = NDArray[np.float64]

#: What an overlay of equilibria has and one of orbits has not, with the reason.
LEFT_OUT = (
    "delays are measured, not predicted: the laws of delay and of gap crossing are those of "
    "equilibria",
    "bursting is not classified: the states at one phase of the forcing have no spikes",
)


@dataclass(frozen=True, eq=False)
class Strobes(OverlaidRows):
    """The strobes of a run, each of which stands for itself.

    Parameters
    ----------
    period : float
        Of the forcing.
    """

    period: float

    share_of = "strobes"

    def columns(self) -> Columns:
        of = self.of
        places = [(slice(None), k) for k in range(len(of.states))]
        states = {
            name: partial(of.state.__getitem__, place)
            for name, place in zip(of.states, places, strict=True)
        }
        own = {name: partial(getattr, of, name) for name in ("distance", "lag")}
        return {"t": lambda: of.t, of.parameter: lambda: of.slow, **states, **own}

    def read(self, key: Any) -> tuple[Any, Columns]:
        """A key with names in place of extremes, and the columns with these names."""
        columns = dict(self.columns())
        written, functionals = split(key) if isinstance(key, str) else (key, {})
        for own, (which, argument) in functionals.items():
            if which not in ("max", "min"):
                raise ArgumentError(
                    f"{which}({argument}) is a number of an orbit; a column of an overlay is "
                    f"max({argument}) or min({argument})"
                )
            columns[own] = partial(self._envelope, which, argument)
        return written, columns

    def _envelope(self, which: str, argument: str) -> Array:
        """Extremes of the run over the orbit period that begins at each strobe."""
        known = self._envelopes
        if (which, argument) not in known:
            known[which, argument] = self._extremes(which, argument)
        return known[which, argument]

    @cached_property
    def _envelopes(self) -> dict[tuple[str, str], Array]:
        return {}

    def _extremes(self, which: str, argument: str) -> Array:
        of, dense = self.of, self.of.run.dense
        length = self.period * math.lcm(*(branch.multiple or 1 for branch in of.branches))
        last = of.run.span[1]
        whole = of.t + length <= last * (1.0 + 1e-12)
        begins, ends = of.t[whole], np.minimum(of.t[whole] + length, last)
        times, values = _turning_values(dense, argument)
        sign = 1.0 if which == "max" else -1.0
        at_ends = sign * np.array([_values_at(dense, argument, t) for t in (begins, ends)])
        found = np.full(len(of), np.nan)
        rows = zip(np.searchsorted(times, begins), np.searchsorted(times, ends), strict=True)
        inner = [(sign * values[first:stop]).max(initial=-np.inf) for first, stop in rows]
        found[whole] = sign * np.maximum(at_ends.max(axis=0), inner)
        found.flags.writeable = False
        return found

    @property
    def names(self) -> tuple[str, ...]:
        return ("t", self.of.parameter, *self.of.states)

    def point(self, row: int) -> StatePoint:
        of = self.of
        number, time = int(of.followed[row]), float(of.t[row])
        followed = None if number < 0 else of.stable_branches[number]
        return StatePoint(
            time,
            of.states,
            of.state[row].copy(),
            {of.parameter: float(of.slow[row])},
            str(of.run.regions_at(np.array([time]))[0]),
            of.run.parameters,
            parameter=of.parameter,
            stable_branch="" if followed is None else followed.label,
            branch=None if followed is None else followed.branch,
            distance=float(of.distance[row]),
        )

    def points(self) -> Iterator[StatePoint]:
        return map(self.point, range(len(self.of)))

    def at(
        self, name: str, level: float, region: str | None, direction: int | None
    ) -> list[StatePoint]:
        """The strobes nearest to the passages of a column through a value."""
        column = np.asarray(self.columns()[name]())
        inside("overlay", name, level, (float(column.min()), float(column.max())))
        gap = column - level
        before = np.flatnonzero((gap[:-1] * gap[1:] < 0) | (gap[1:] == 0))
        nearest = before + (np.abs(gap[before + 1]) <= np.abs(gap[before]))
        rows = np.unique(np.r_[[0] if gap[0] == 0 else [], nearest].astype(int))
        points = [self.point(int(row)) for row in rows if direction in (None, _way(gap, row))]
        return [point for point in points if region in (None, point.region)]

    def nearest(self, values: Mapping[str, float]) -> StatePoint:
        columns = self.columns()
        check_values(values, columns, "column")
        return self.point(nearest_row(columns, values))

    def weights(self) -> Array:
        return np.ones(len(self.of))

    def part(self, start: int, stop: int) -> Mapping[str, Any]:
        return {}

    def count(self) -> str:
        return f", {len(self.of)} strobes {self.period:.6g} apart"

    def lacking(self) -> str:
        return "" if self.of.stable_branches else "the branches have no stable orbit"

    def named(self, label: str) -> str:
        return "".join(f", {s.region}" for s in self.of.stable_branches if s.label == label)

    def doubts(self) -> list[str]:
        return list(LEFT_OUT)


def _way(gap: Array, row: int) -> int:
    """Sign with which a column passes a value at a row; 0 where it is touched."""
    before, after = np.sign(gap[[max(row - 1, 0), min(row + 1, len(gap) - 1)]])
    return int(np.sign(after - before))


def _turning_values(dense: DenseOutput, argument: str) -> tuple[Array, Array]:
    """Times and values of a polynomial in columns where it may have extremes, in order of time.

    They are the starts of the steps, where a derivative may jump, and the zeros of the derivative.
    """
    line = dense.polynomials(argument).coefficients
    powers = np.arange(1, line.shape[1])
    roots = find_roots(StepPolynomials.of(line[:, 1:] * powers))
    starts, lengths = dense.steps[:, 0], dense.steps[:, 1]
    times = np.r_[starts, starts[roots.step] + roots.part * lengths[roots.step]]
    values = np.r_[line[:, 0], _horner(line[roots.step], roots.part)]
    order = np.argsort(times, kind="stable")
    return times[order], values[order]


def _values_at(dense: DenseOutput, argument: str, times: Array) -> Array:
    """Values of a polynomial in columns at times."""
    line = dense.polynomials(argument).coefficients
    rows = np.maximum(np.searchsorted(dense.step_starts, times, side="right") - 1, 0)
    return _horner(line[rows], (times - dense.steps[rows, 0]) / dense.steps[rows, 1])


def _horner(coefficients: Array, part: Array) -> Array:
    """Values of polynomials at one point each, shape (K,)."""
    value = np.zeros(len(part))
    for column in coefficients.T[::-1]:
        value = value * part + column
    return value
