"""A trajectory compared with branches of periodic orbits of its frozen model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import text, validated
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import RowTable, at_values, named_value
from fastslow.results.orbits.functionals import split
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.followed_run import FollowedRun
from fastslow.results.overlay.transitions import (
    PHASES,
    Phases,
    StableBranch,
    Transitions,
)
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.steps.dense import DenseOutput
from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials
from fastslow.results.trajectory.steps.step_roots import find_roots
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: What an overlay of equilibria has and one of orbits has not, with the reason.
LEFT_OUT = (
    "delays are measured, not predicted: the laws of delay and of gap crossing are those of "
    "equilibria",
    "bursting is not classified: the states at one phase of the forcing have no spikes",
)


@dataclass(frozen=True, eq=False, repr=False)
class OrbitOverlay(FollowedRun, RowTable[StatePoint], Result):
    """A trajectory compared with branches of periodic orbits of its frozen model.

    The rows are the states of the run at whole periods of the fast forcing (strobes), which are
    compared with the orbits at the same phase and the same value of the slow quantity.
    ``overlay["distance"]`` is a column and ``overlay["x - w"]`` an expression; ``"max(x)"`` and
    ``"min(x)"`` are extremes of the run over the period of the orbits that begins at each strobe,
    NaN where the run ends before, and form its envelope. ``overlay[3]`` and iteration return the
    states at single strobes.

    Parameters
    ----------
    branches : tuple of OrbitBranch
        Over the slow quantity.
    run : Trajectory
    t, slow : ndarray, shape (N,)
        Times of the strobes, and the slow quantity there.
    state : ndarray, shape (N, n)
        States of the frozen model at those times.
    extent : ndarray, shape (n,)
        Unit of each state in distances: its range over the strobes of the run and over the
        stable orbits at the values of the slow quantity in the run.
    radius : float
        Distance, in those units, below which a state counts as near an orbit.
    stable_branches : tuple of StableBranch
        The stable slices of the branches with monotone parameter: ``"O1"``, ``"O2"`` and so on.
    followed : ndarray of int, shape (N,)
        Index into ``stable_branches``; −1 where none is followed.
    distance : ndarray, shape (N,)
        Distance from the followed orbit at the same phase (beyond a loss of stability from its
        unstable continuation, past a fold from the fold); where none is followed, from
        the nearest stable orbit, infinite if there is none.
    lag : ndarray, shape (N,)
        Time lag behind the followed branch X of strobed states, X(w(t − lag)) ≈ x(t); nan where
        no branch is followed, or where an earlier orbit is not much nearer.
    relaxation : ndarray, shape (N,)
        Relaxation time −T / log|μ| for the largest multiplier μ; nan where the orbit is not
        stable.
    phases : Phases
    transitions : Transitions
        Departures from stable branches, and passages of contacts with interfaces, resolved to
        one period; their delays are measured.
    period : float
        Period of the fast forcing.
    outcome : Outcome
        Whether the branches cover the run.
    """

    branches: tuple[OrbitBranch, ...]
    run: Trajectory
    t: Array
    slow: Array
    state: Array
    extent: Array
    radius: float
    stable_branches: tuple[StableBranch, ...]
    followed: NDArray[np.intp]
    distance: Array
    lag: Array
    relaxation: Array
    phases: Phases
    transitions: Transitions
    period: float
    outcome: Outcome

    _entry = "strobe"

    @property
    def parameter(self) -> str:
        """Name of the slow quantity, which is the parameter of the branches."""
        return self.branches[0].parameter

    @property
    def states(self) -> tuple[str, ...]:
        """States of the frozen model."""
        return self.branches[0].states

    @property
    def _followed_states(self) -> tuple[str, ...]:
        return self.states

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Columns: t, slow quantity, states, distance, lag, stable branch and type of phase."""
        return {**super().to_dict(), "phase": self._phase_types()}

    def _constants(self) -> Mapping[str, float]:
        return {**self.run.parameters, **self.branches[0].parameters}

    def _words(self) -> Mapping[str, tuple[str, ...]]:
        labels = tuple(s.label for s in self.stable_branches)
        return {"stable_branch": (*labels, ""), "phase": PHASES}

    def _read(self, key: Any) -> tuple[Any, dict[str, Callable[[], NDArray[Any]]]]:
        """A key with names in place of extremes, and the columns with these names."""
        columns = dict(self._columns())
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
        length = self.period * math.lcm(*(branch.multiple or 1 for branch in self.branches))
        last = self.run.span[1]
        whole = self.t + length <= last * (1.0 + 1e-12)
        begins, ends = self.t[whole], np.minimum(self.t[whole] + length, last)
        times, values = _turning_values(self.run.dense, argument)
        sign = 1.0 if which == "max" else -1.0
        at_ends = sign * np.array([_values_at(self.run.dense, argument, t) for t in (begins, ends)])
        found = np.full(len(self), np.nan)
        rows = zip(np.searchsorted(times, begins), np.searchsorted(times, ends), strict=True)
        inner = [(sign * values[first:stop]).max(initial=-np.inf) for first, stop in rows]
        found[whole] = sign * np.maximum(at_ends.max(axis=0), inner)
        found.flags.writeable = False
        return found

    def _item(self, row: int) -> StatePoint:
        number = int(self.followed[row])
        followed = None if number < 0 else self.stable_branches[number]
        time = float(self.t[row])
        return StatePoint(
            time,
            self.states,
            self.state[row].copy(),
            {self.parameter: float(self.slow[row])},
            str(self.run.regions_at(np.array([time]))[0]),
            self.run.parameters,
            parameter=self.parameter,
            stable_branch="" if followed is None else followed.label,
            branch=None if followed is None else followed.branch,
            distance=float(self.distance[row]),
        )

    def _rows(self, rows: Any) -> OrbitOverlay:
        """Return the overlay of some strobes, with the phases and transitions of their interval."""
        rows = np.arange(len(self))[rows]
        begin, end = self.t[rows[[0, -1]]].tolist() if len(rows) else (np.inf, -np.inf)
        return replace(self, **self._of_rows(rows, self.run, begin, end))

    @validated(stable_branch=text)
    def at(self, *, stable_branch: str | None = None, **value: Any) -> Any:
        """Return the strobes nearest to the passages of a column through a value.

        Parameters
        ----------
        stable_branch : str, optional
            Keep only those on the stable branch with this label; ``""`` for none.
        **value : float or array_like, shape (m,)
            Name of a state, the slow quantity or ``t``, e.g. ``w=0.1``.

        Returns
        -------
        list of StatePoint, or list of m such lists
            In order of time; a list for each value of an array.

        Raises
        ------
        UnknownNameError
            For an unknown column or stable branch.
        ArgumentError
            If the column does not take the value.
        """
        name, given = named_value("column", ("t", self.parameter, *self.states), value)
        labels = [s.label for s in self.stable_branches]
        if stable_branch and stable_branch not in labels:
            raise unknown_name("stable branch", stable_branch, labels)
        column = np.asarray(self[name])

        def query(level: float) -> list[StatePoint]:
            if not len(column) or not column.min() <= level <= column.max():
                ends = f"[{column.min():g}, {column.max():g}]" if len(column) else "of none"
                raise ArgumentError(f"{name} = {level:g} is outside the strobes' range {ends}")
            gap = column - level
            before = np.flatnonzero((gap[:-1] * gap[1:] < 0) | (gap[1:] == 0))
            nearest = before + (np.abs(gap[before + 1]) <= np.abs(gap[before]))
            rows = np.unique(np.r_[[0] if gap[0] == 0 else [], nearest].astype(int))
            points = [self._item(int(row)) for row in rows]
            return [p for p in points if stable_branch in (None, p.stable_branch)]

        return at_values(name, given, query)

    def shares(self) -> dict[str, float]:
        """Return the fraction of strobes on each stable branch; ``""`` for none."""
        labels = self.labels
        known = dict.fromkeys(["", *(s.label for s in self.stable_branches)])
        found = {label: float((labels == label).sum()) / max(len(self), 1) for label in known}
        return {label: share for label, share in found.items() if share > 0}

    def _groups(self) -> list[list[str]]:
        return [
            list(self._head()),
            list(self._followed()),
            list(self._events()),
            [f"  {s}" for s in LEFT_OUT],
        ]

    def _head(self) -> Iterator[str]:
        name, count = self.parameter, len(self.transitions)
        if not len(self):
            yield f"OrbitOverlay on {name}: no strobes"
            return
        yield (
            f"OrbitOverlay on {name}: {count} transition{'' if count == 1 else 's'}, "
            f"{len(self)} strobes {self.period:.6g} apart over t = {self.t[0]:g} to "
            f"{self.t[-1]:g}, {name} from {self.slow.min():.6g} to {self.slow.max():.6g}"
        )
        yield from self._endings()
        if not self.stable_branches:
            yield "  the branches have no stable orbit"

    def _followed(self) -> Iterator[str]:
        for label, share in self.shares().items():
            words = f"  on {label or 'no stable branch'}: {share:.1%} of the strobes"
            for one in self.stable_branches:
                if one.label == label:
                    words += f", {one.region}"
            yield words + self._lag(label)


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
