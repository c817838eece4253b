"""Sets of equilibria within discontinuities, such as the sticking band of dry friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import real_number
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.result import LIVE, Result
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumSet(Result):
    """All equilibria of a Filippov field along some discontinuities, at one parameter value.

    Zero is in the convex hull of the fields around each of its points (Filippov
    1988): a block that sticks by dry friction stays anywhere in it.

    Parameters
    ----------
    states : tuple of str
    region : str
        The sliding motion, such as ``"S1|S2"``.
    interfaces : tuple of str
        Those that are slid along: the contacts that stick.
    dimension : int
        Of the set.
    parameters : mapping
    lower, upper : ndarray, shape (n,)
        Range of each state; infinite where the set has no end.
    corners : ndarray, shape (k, n)
        The two ends of a set of dimension 1; of one as large as the number of
        interfaces, the points at which every contact is about to slip.
    eigenvalues : ndarray of complex, shape (n,)
        In its middle, of the sliding motion: zeros along the set, and −∞ for each
        interface (+∞ where the fields point away).
    attracting : bool
        Whether the field on all sides points at the interfaces: the contact sticks.
    stable : bool
        Whether it attracts and what is not neutral along it decays.
    exact : bool
        Whether the ranges are sure; else they were found by search.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> block = fs.Model({x: v, v: -x - sp.sign(v) / 2})
    >>> (band,) = fs.equilibria(block).sets
    >>> band.lower + 0.0, band.upper + 0.0
    (array([-0.5,  0. ]), array([0.5, 0. ]))
    """

    states: tuple[str, ...]
    region: str
    interfaces: tuple[str, ...]
    dimension: int
    parameters: Mapping[str, float]
    lower: Array
    upper: Array
    corners: Array
    eigenvalues: NDArray[np.complex128]
    attracting: bool = True
    stable: bool = False
    exact: bool = True

    @property
    def equilibria(self) -> list[Equilibrium]:
        """Its corners, each one of a continuum unless the set is a single point."""
        return [
            Equilibrium(
                self.states,
                corner.copy(),
                dict(self.parameters),
                self.region,
                True,
                self.eigenvalues.copy(),
                continuum=self.dimension > 0,
            )
            for corner in self.corners
        ]

    @property
    def name(self) -> str:
        """The sliding motion and what it does: ``"S1|S2 (sticking)"``."""
        return set_name(self.region, self.attracting)

    def __getitem__(self, state: object) -> tuple[float, float]:
        """The range of a state."""
        if str(state) not in self.states:
            raise unknown_name("state", state, self.states)
        k = self.states.index(str(state))
        return float(self.lower[k]), float(self.upper[k])

    def __repr__(self) -> str:
        ranges = ", ".join(
            f"{name} = {low:.6g}" if low == high else f"{low:.6g} ≤ {name} ≤ {high:.6g}"
            for name, low, high in zip(self.states, self.lower, self.upper, strict=True)
        )
        where = ", ".join(f"{name} = 0" for name in self.interfaces)
        found = "" if self.exact else "; found by search"
        return (
            f"EquilibriumSet({ranges}; {self.name} on {where}, dimension {self.dimension}{found})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBand(Result):
    """An `EquilibriumSet` over a range of the parameter, with its edges as curves.

    Parameters
    ----------
    states : tuple of str
    parameter : str
    region : str
    interfaces : tuple of str
    dimension : int
    parameters : mapping
        The values of all other parameters.
    values : ndarray, shape (N,)
        Increasing values of the parameter.
    lower, upper : ndarray, shape (N, n)
        Range of each state.
    corners : ndarray, shape (N, k, n)
        The edges ``corners[:, j]`` as curves over the parameter.
    eigenvalues : ndarray of complex, shape (N, n)
    attracting : bool
    stable : ndarray of bool, shape (N,)
    exact : bool
    solver : callable, optional
        Solves for the set at a value; not kept in a file.
    """

    states: tuple[str, ...]
    parameter: str
    region: str
    interfaces: tuple[str, ...]
    dimension: int
    parameters: Mapping[str, float]
    values: Array
    lower: Array
    upper: Array
    corners: Array
    eigenvalues: NDArray[np.complex128]
    attracting: bool
    stable: NDArray[np.bool_]
    exact: bool = True
    solver: Callable[[float, Array], EquilibriumSet | None] | None = field(
        default=None, repr=False, metadata=LIVE
    )

    @property
    def name(self) -> str:
        """The sliding motion and what it does: ``"S1|S2 (sticking)"``."""
        return set_name(self.region, self.attracting)

    @property
    def edge(self) -> str:
        """What a motion that slips along its edge follows: ``"edge of S1|S2"``."""
        return f"edge of {self.region}"

    @property
    def range(self) -> tuple[float, float]:
        """The smallest and the largest value of the parameter."""
        return float(self.values[0]), float(self.values[-1])

    def at(self, **value: float) -> EquilibriumSet | None:
        """The set at one value of the parameter, None where there is none.

        With the model attached it is solved for; a band read from a file interpolates.

        Raises
        ------
        UnknownNameError
            If the name is not the band's parameter.
        ArgumentError
            For what is no number.
        """
        if list(value) != [self.parameter]:
            raise unknown_name("parameter", next(iter(value), None), [self.parameter])
        number = real_number(value[self.parameter])
        if number is None or not np.isfinite(number):
            raise ArgumentError(
                f"{self.parameter} = {value[self.parameter]!r}; expected a finite number"
            )
        return self.set_at(number)

    def set_at(self, number: float) -> EquilibriumSet | None:
        """As `at`, for a number."""
        if not self.values[0] <= number <= self.values[-1]:
            return None
        middle = self._between(0.5 * (self.lower + self.upper), number)
        solved = self.solver(number, middle) if self.solver is not None else None
        if solved is not None:
            return solved
        count, row = self.corners.shape[1], int(np.searchsorted(self.values, number))
        flat = self._between(self.corners.reshape(len(self.values), -1), number)
        return EquilibriumSet(
            self.states,
            self.region,
            self.interfaces,
            self.dimension,
            {**self.parameters, self.parameter: number},
            self._between(self.lower, number),
            self._between(self.upper, number),
            flat.reshape(count, len(self.states)),
            self.eigenvalues[row].copy(),
            self.attracting,
            bool(self.stable[row]),
            self.exact,
        )

    @property
    def is_stable(self) -> bool:
        """Whether it is stable all along."""
        return bool(self.stable.all())

    def between(self, low: float, high: float) -> EquilibriumBand | None:
        """The part between two values of the parameter, None where there is none."""
        first, last = max(low, self.range[0]), min(high, self.range[1])
        if not first < last:
            return None
        inside = self.values[(self.values > first) & (self.values < last)]
        values = np.concatenate([[first], inside, [last]])
        rows = np.minimum(np.searchsorted(self.values, values), len(self.values) - 1)
        flat = self.corners.reshape(len(self.values), -1)
        corners = np.array([self._between(flat, v) for v in values])
        return replace(
            self,
            values=values,
            lower=np.array([self._between(self.lower, v) for v in values]),
            upper=np.array([self._between(self.upper, v) for v in values]),
            corners=corners.reshape(len(values), *self.corners.shape[1:]),
            eigenvalues=self.eigenvalues[rows],
            stable=self.stable[rows],
        )

    def bounds(self, numbers: Array) -> tuple[Array, Array]:
        """Ranges of the states at values of the parameter, interpolated; NaN beyond its range."""
        numbers = np.asarray(numbers, dtype=float)
        inside = (numbers >= self.values[0]) & (numbers <= self.values[-1])
        found = []
        for table in (self.lower, self.upper):
            at = np.stack([np.interp(numbers, self.values, column) for column in table.T], axis=-1)
            found.append(np.where(inside[:, None], at, np.nan))
        return found[0], found[1]

    def _between(self, table: Array, number: float) -> Array:
        return np.array([np.interp(number, self.values, column) for column in table.T])

    def __repr__(self) -> str:
        low, high = self.range
        where = ", ".join(f"{name} = 0" for name in self.interfaces)
        found = "" if self.exact else "; found by search"
        return (
            f"EquilibriumBand({self.parameter} from {low:.6g} to {high:.6g}, {self.name} on "
            f"{where}, dimension {self.dimension}{found})"
        )


def set_name(region: str, attracting: bool) -> str:
    """A sliding motion at rest, in words.

    Examples
    --------
    >>> set_name("S1|S2", True), set_name("S1|S2", False)
    ('S1|S2 (sticking)', 'S1|S2 (escaping)')
    """
    return f"{region} ({'sticking' if attracting else 'escaping'})"
