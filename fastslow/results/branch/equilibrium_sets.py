"""Sets of equilibria: on discontinuities, as under dry friction, and continua within regions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import ResultTable, at_values, named_value
from fastslow.results.points import STABILITIES, Equilibrium, coordinates
from fastslow.results.stored.operations import AT_TWO_FOLD

Array = NDArray[np.float64]

#: Columns of text and flags of a table of equilibria.
WORDS = ("region", "stability", "type")
FLAGS = ("stable", "admissible", "continuum")


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumSet(Result):
    """A set of equilibria that are not isolated, at one parameter value.

    On discontinuities of a Filippov system zero is in the convex hull of the adjacent vector
    fields at each of its points (Filippov 1988), as for a block held by dry friction. In a region
    the set is a line, plane, … of equilibria, between changes of their stability.

    Parameters
    ----------
    states : tuple of str
    region : str
        The sliding motion, such as ``"S1|S2"``.
    interfaces : tuple of str
        The interfaces of the sliding motion: the sticking contacts. Empty in a region.
    dimension : int
        Dimension of the set.
    parameters : mapping
    lower, upper : ndarray, shape (n,)
        Range of each state; infinite where the set is unbounded.
    corners : ndarray, shape (k, n)
        The two ends of a set of dimension 1; if the dimension equals the number of
        interfaces, the points at which every contact is about to slip.
    eigenvalues : ndarray of complex, shape (n,)
        Of the sliding motion at the middle of the set: zeros along the set, and for each
        interface −∞ if they attract, +∞ if not, NaN if this is undecided. At a two-fold the
        rates of the distances along and across the interface, which is its square; −∞ and +∞ for
        motions that pass.
    attracting : bool or None
        True if no motion near the interfaces leaves them (sticking), False if one does. At an
        intersection of interfaces this follows from the vector fields in all adjacent
        regions; None if they do not decide it to first order, as for a spiral with the return
        map 1.
    stable : bool
        True if the set is attracting and all eigenvalues that are not neutral decay.
    exact : bool
        True for exact ranges, False for ranges found by search.

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
    attracting: bool | None = True
    stable: bool = False
    exact: bool = True

    @property
    def equilibria(self) -> list[Equilibrium]:
        """The corners as equilibria, of a continuum unless the set is a single point."""
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
        return set_name(self)

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
        found = "" if self.exact else "; found by search"
        return (
            f"EquilibriumSet({ranges}; {self.name}{_where(self)}, dimension "
            f"{self.dimension}{found})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBand(Result):
    """An `EquilibriumSet` over an interval of the parameter, with its edges as curves.

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
    attracting : bool or None
    stable : ndarray of bool, shape (N,)
    exact : bool
    solver : callable, optional
        Solves for the set at a value; not saved to files.
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
    attracting: bool | None
    stable: NDArray[np.bool_]
    exact: bool = True
    solver: Callable[[float, Array], EquilibriumSet | None] | None = field(
        default=None, repr=False, metadata=LIVE
    )

    @property
    def name(self) -> str:
        """The sliding motion and what it does: ``"S1|S2 (sticking)"``."""
        return set_name(self)

    @property
    def edge(self) -> str:
        """Name of the edge, which a slipping motion follows: ``"edge of S1|S2"``."""
        return f"edge of {self.region}"

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of the parameter."""
        return float(self.values[0]), float(self.values[-1])

    def at(self, **value: Any) -> Any:
        """Return the set at values of the parameter, None if there is none.

        If the model is attached, the set is solved for; otherwise it is interpolated.

        Parameters
        ----------
        **value : float or array_like, shape (m,)
            The parameter by name, e.g. ``w=1.0``.

        Returns
        -------
        EquilibriumSet or None, or list of m of them

        Raises
        ------
        UnknownNameError
            If the name is not the parameter of the band.
        ArgumentError
            For a value that is not a finite number.
        """
        return at_values(*named_value("band parameter", [self.parameter], value), self.set_at)

    def set_at(self, number: float) -> EquilibriumSet | None:
        """Return the set at a number; see `at`."""
        if not self.values[0] <= number <= self.values[-1]:
            return None
        lower, upper = (np.where(np.isfinite(e), e, 0.0) for e in (self.lower, self.upper))
        middle = self._between(0.5 * (lower + upper), number)
        solved = self.solver(number, middle) if self.solver is not None else None
        if solved is not None:
            return solved
        count, row = self.corners.shape[1], int(np.searchsorted(self.values, number))
        flat = self._between(self.corners.reshape(len(self.values), -1), number)
        return EquilibriumSet(
            states=self.states,
            region=self.region,
            interfaces=self.interfaces,
            dimension=self.dimension,
            parameters={**self.parameters, self.parameter: number},
            lower=self._between(self.lower, number),
            upper=self._between(self.upper, number),
            corners=flat.reshape(count, len(self.states)),
            eigenvalues=self.eigenvalues[row].copy(),
            attracting=self.attracting,
            stable=bool(self.stable[row]),
            exact=self.exact,
        )

    @property
    def is_stable(self) -> bool:
        """True if the set is stable at all values."""
        return bool(self.stable.all())

    def between(self, low: float, high: float) -> EquilibriumBand | None:
        """Return the band between two values of the parameter, None if it is empty."""
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
        """Interpolate the ranges of the states at parameter values; NaN outside the band."""
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
        found = "" if self.exact else "; found by search"
        return (
            f"EquilibriumBand({self.parameter} from {low:.6g} to {high:.6g}, {self.name}"
            f"{_where(self)}, dimension {self.dimension}{found})"
        )


def _where(one: EquilibriumSet | EquilibriumBand) -> str:
    """Return the interfaces of a set, in words; empty in a region."""
    names = ", ".join(f"{name} = 0" for name in one.interfaces)
    return f" on {names}" if names else ""


def set_name(one: EquilibriumSet | EquilibriumBand) -> str:
    """Return the region or sliding motion of a set, and its `attraction_word`."""
    if one.region.endswith(AT_TWO_FOLD):
        return one.region
    return f"{one.region} ({attraction_word(one)})"


def attraction_word(one: EquilibriumSet | EquilibriumBand) -> str:
    """Return the word for a set: sticking, escaping, undecided, two-fold, or continuum."""
    if one.region.endswith(AT_TWO_FOLD):
        return "two-fold"
    if not one.interfaces:
        return "stable continuum" if bool(np.all(one.stable)) else "continuum"
    return "undecided" if one.attracting is None else "sticking" if one.attracting else "escaping"


class Equilibria(ResultTable[Equilibrium]):
    """The equilibria at given parameter values, as a table.

    ``select("x > 0", stable=True)`` returns some of them; see `fastslow.results.base.table.Table`.

    Attributes
    ----------
    completeness : str
        ``"complete"`` if it is proved that these are all equilibria, else ``"found"``.
    sets : tuple of EquilibriumSet
        Sets of equilibria on discontinuities (a block held by dry friction); their
        corners are items of the tuple, with ``continuum=True``.
    notes : tuple of str
        Sentences on equilibria on an interface whose stability one region does not decide.
    """

    completeness: str
    sets: tuple[EquilibriumSet, ...]
    notes: tuple[str, ...]

    def __new__(
        cls,
        items: Iterable[Equilibrium] = (),
        completeness: str = "found",
        sets: Sequence[EquilibriumSet] = (),
        notes: Sequence[str] = (),
    ) -> Equilibria:
        made = super().__new__(cls, items)
        made.completeness = completeness
        made.sets = tuple(sets)
        made.notes = tuple(notes)
        return made

    _row = "equilibrium"
    _entry = "equilibrium"

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"stability": STABILITIES}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return states, parameters, region, stability, type and properties."""
        words = {n: np.array([getattr(e, n) for e in self], dtype=str) for n in WORDS}
        flags = {n: np.array([getattr(e, n) for e in self], dtype=bool) for n in FLAGS}
        return {**coordinates(self), **words, **flags}

    def _heading(self) -> str:
        many = "equilibrium" if len(self) == 1 else "equilibria"
        return "\n  ".join([f"{len(self)} {many} ({self.completeness})", *self.notes])
