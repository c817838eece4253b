"""Periodic orbits: one period of the motion, with its Floquet multipliers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import Expression, Name, among, finite_numbers, formula, validated
from fastslow.errors import unknown_name
from fastslow.formulas.columns import evaluated
from fastslow.formulas.definitions import with_definitions
from fastslow.results.base.html import Cells
from fastslow.results.base.immutable import ImmutableSequence
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table
from fastslow.results.base.upper_layers import computed
from fastslow.results.orbits.functionals import PARTS, evaluate, split
from fastslow.results.stored.model import StoredModel
from fastslow.results.trajectory.events.crossings import Crossings, Segment
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.trajectory import Trajectory

#: A multiplier with |log|μ|| below this has modulus one to the accuracy of an orbit.
NEUTRAL_MULTIPLIER = 1e-9


class Itinerary(ImmutableSequence, tuple[str, ...]):
    """Regions of a closed curve in order: equal to every rotation of itself.

    Examples
    --------
    >>> Itinerary(["S1", "S2"]) == ("S2", "S1"), Itinerary(["S1", "S2"]) == ("S1",)
    (True, False)
    """

    def __new__(cls, regions: Iterable[str] = ()) -> Itinerary:
        return super().__new__(cls, regions)

    def _first(self) -> tuple[str, ...]:
        """The lexicographically first rotation."""
        plain = tuple(self)
        return min((plain[k:] + plain[:k] for k in range(len(plain))), default=())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, tuple):
            return NotImplemented
        return len(self) == len(other) and self._first() == Itinerary(other)._first()

    def __ne__(self, other: object) -> bool:
        equal = self.__eq__(other)
        return equal if equal is NotImplemented else not equal

    def __hash__(self) -> int:
        return hash(self._first())

    def __repr__(self) -> str:
        return repr(tuple(self))


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Table[StatePoint], Result):
    """A periodic orbit.

    ``orbit(t)`` returns the states at any time, modulo the period; for a forced model t is the
    time of the forcing, so that ``orbit(0.0)`` is the fixed point of the stroboscopic map.
    ``orbit["x"]`` is a column and ``orbit["x**2 + v"]`` an expression at the samples ``orbit.t``;
    ``orbit["max(x)"]``, ``min``, ``mean`` and ``rms`` (root mean square) are numbers, as are
    ``orbit["abs(multiplier_1)"]``, ``re`` and ``im``.

    Parameters
    ----------
    trajectory : Trajectory
        One period.
    period : float
    multiple : int or None
        Number of periods of the forcing; None without forcing.
    multipliers : ndarray of complex, shape (n,)
        Floquet multipliers, the largest modulus first. Without forcing one of them is 1, for
        perturbations along the orbit. NaN if no orbit was found.
    log_multipliers : ndarray, shape (n,)
        log |μ| in the same order, also where μ underflows; −inf for a multiplier that is
        exactly 0, as with sliding.
    trivial : int or None
        Index of the multiplier 1 of perturbations along the orbit; None with forcing.
    defect : float
        Largest difference of log |det M| from Liouville's formula, of every segment and without
        sliding of the orbit.
    residual : float
        Largest residual of the equations of the orbit, relative to the terms of each.
    accuracy : float
        Size of the last Newton correction, in units of the range of each state and of the
        period.
    outcome : Outcome
        ``"periodic"``, or the reason why no orbit was found.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, t = sp.symbols("x v t")
    >>> orbit = fs.find_orbit(fs.Model({x: v, v: sp.sin(t) - x - v}), [-1, 0])
    >>> orbit(0.0).round(12) + 0.0
    array([-1.,  0.])
    >>> round(orbit["max(x)"], 12), orbit.stability
    (1.0, 'stable')
    """

    trajectory: Trajectory
    period: float
    multiple: int | None
    multipliers: NDArray[np.complex128]
    log_multipliers: NDArray[np.float64]
    trivial: int | None
    defect: float
    residual: float
    accuracy: float
    outcome: Outcome

    _row = "t"
    _places = ("t",)

    @validated(name=formula)
    def gradient(self, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of the orbit with respect to a parameter.

        Parameters
        ----------
        name : str or Symbol

        Returns
        -------
        NamedMapping of float
            Of the states at the time ``orbit.t0``, the period, and the extremes ``min(x)``,
            ``max(x)`` of every state. Without forcing the change of the state at t0 is normal to
            the flow.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter.
        ArgumentError
            Where there is no derivative: at a fold of orbits, for a family of orbits, or for an
            orbit that touches an interface.
        ModelError
            For an orbit read from a file, which has no equations.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v, t, F = sp.symbols("x v t F")
        >>> model = fs.Model({x: v, v: F * sp.sin(t) - x - v}, parameters={F: 3})
        >>> orbit = fs.find_orbit(model, [-1, 0])
        >>> round(orbit.gradient("F")["max(x)"], 11)
        1.0
        """
        place = "fastslow.orbits.derivatives.orbit_gradients"
        found: NamedMapping[float] = computed(place, "gradient_of_orbit")(self, name)
        return found

    @property
    def states(self) -> tuple[str, ...]:
        """States, then slow states: the order of every state vector."""
        return self.trajectory.states

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: states, slow states, slow quantities."""
        return self.trajectory.columns

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameter values."""
        return self.trajectory.parameters

    @property
    def model(self) -> Any:
        """The model; for an orbit loaded from a file a `StoredModel`."""
        return self.trajectory.model

    @property
    def stored_model(self) -> StoredModel | None:
        """The model as stored in files."""
        return self.trajectory.stored_model

    @property
    def equations(self) -> str:
        """The model as text."""
        return self.trajectory.equations

    @property
    def t0(self) -> float:
        """Time of the first state of ``trajectory``, which is inside a segment."""
        return self.trajectory.span[0]

    @property
    def forced(self) -> bool:
        """True if the period is a multiple of that of a forcing."""
        return self.multiple is not None

    @cached_property
    def t(self) -> NDArray[np.float64]:
        """Times of the samples, dense enough for a plot, over one period."""
        return self.trajectory.t

    def __getitem__(self, key: Any) -> Any:
        """Return a column or expression at the samples, a number of the period, or a row.

        Raises
        ------
        UnknownNameError
            For a name that is neither a column nor a parameter.
        ArgumentError
            For text that is not an expression.
        """
        key = with_definitions(key, self.trajectory.definitions)
        text, functionals = split(key) if isinstance(key, str) else ("", {})
        if text == "period":
            return self.period
        if not functionals:
            return self.trajectory[key]
        numbers_of = {name: self._number(*one) for name, one in functionals.items()}
        return float(evaluated(text, {**self.parameters, "period": self.period, **numbers_of}))

    def _number(self, which: str, argument: str) -> float:
        """Return a functional of an expression, or a number of a multiplier.

        Parameters
        ----------
        which : str
            max, min, mean or rms; abs, re or im.
        argument : str
            An expression in columns, parameters and t; ``"multiplier_1"`` and so on.
        """
        if which not in PARTS:
            return evaluate(which, self.trajectory.dense, argument)
        names = [f"multiplier_{k + 1}" for k in range(len(self.multipliers))]
        if argument not in names:
            raise unknown_name("multiplier", argument, names)
        place = names.index(argument)
        value = self.multipliers[place]
        if which == "abs":
            return float(np.exp(self.log_multipliers[place]))
        return float(value.real if which == "re" else value.imag)

    @validated(t=finite_numbers)
    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the states at any times, modulo the period: shape (n, N), (n,) for one time."""
        dense = self.trajectory.dense
        return dense(dense.modulo(t, self.period))

    @validated(t=finite_numbers)
    def dense_columns(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return all columns at any times, modulo the period, shape (n + n_forcing, N)."""
        dense = self.trajectory.dense
        return dense.columns_at(dense.modulo(t, self.period))

    @property
    def stability(self) -> str:
        """``"stable"``, ``"unstable"``, ``"neutral"``, or ``"unknown"`` if no orbit was found.

        Without forcing the multiplier 1 of perturbations along the orbit is left out.
        """
        return stability_of_logs(self.log_multipliers, -1 if self.trivial is None else self.trivial)

    @property
    def stable(self) -> bool:
        return self.stability == "stable"

    @property
    def crossings(self) -> Crossings:
        """Crossings of interfaces within one period, in order of time."""
        return self.trajectory.crossings

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The time intervals in one region within one period; the last continues in the first."""
        return self.trajectory.segments

    @cached_property
    def itinerary(self) -> Itinerary:
        """The regions in order, equal up to rotation."""
        return itinerary_of(self.trajectory)

    @property
    def event_counts(self) -> str:
        """Numbers of crossings, resets, events and changes of switches in one period, in words."""
        run = self.trajectory
        resets = f", {len(run.resets)} resets" if run.reset_names else ""
        resets += f", {len(run.events)} events" if run.event_names else ""
        changes = f", {len(run.switches)} changes of switches" if run.switch_names else ""
        return f"{self.hits()} crossings{resets}{changes}"

    def extremes(self, name: Name) -> tuple[float, float]:
        """Return minimum and maximum of a column.

        Raises
        ------
        UnknownNameError
            For an unknown column.
        """
        return self.trajectory.extremes(name)

    @validated(direction=among(-1, 1, None))
    def hits(self, interface: Expression | None = None, *, direction: int | None = None) -> int:
        """Count crossings within one period, of one interface or of all.

        Parameters
        ----------
        interface : str or Expr, optional
        direction : int, optional
            Upwards (+1) or downwards (−1), by default both.

        Raises
        ------
        UnknownNameError
            For an unknown interface.
        """
        chosen = self.crossings(interface)
        return sum(c.direction != 0 and direction in (None, c.direction) for c in chosen)

    def _item(self, row: int) -> StatePoint:
        return self.trajectory[row]

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return time t, every column, and the region."""
        return self.trajectory.to_dict()

    def _cells(self) -> Cells:
        return self.crossings._cells()

    def __repr__(self) -> str:
        if not self.outcome and np.isnan(self.residual):
            return f"Orbit of {', '.join(self.columns)}: not found\n  {self.outcome}"
        if self.multiple is None:
            kind = ""
        else:
            kind = f" ({self.multiple} period{'s' * (self.multiple != 1)} of the forcing)"
        route = " → ".join(self.itinerary[:8]) + " → …" * (len(self.itinerary) > 8)
        moduli = ", ".join(map(_multiplier, self.multipliers[:6], self.log_multipliers[:6]))
        more = ", …" * (len(self.multipliers) > 6)
        free = "" if self.forced else " (1 along the orbit)"
        if self.trivial is not None and np.isnan(self.multipliers[self.trivial]):
            free = " (not resolved along the orbit)"
        lines = [
            f"Orbit of {', '.join(self.columns)}, period {self.period:.9g}{kind}, {self.stability}",
            f"  itinerary {route}, {self.event_counts}",
            f"  multipliers {moduli}{more}{free}",
            f"  residual {self.residual:.2g}, accuracy {self.accuracy:.2g}",
        ]
        if not self.outcome or self.outcome.notes:
            lines.append(f"  {self.outcome}")
        return "\n".join(lines)


def itinerary_of(run: Trajectory) -> Itinerary:
    """The regions of a trajectory over one period, in order."""
    regions = [segment.region for segment in run.segments]
    return Itinerary(regions[:-1] if len(regions) > 1 else regions)


def stability_of_logs(logs: NDArray[np.float64], trivial: int) -> str:
    """Return the stability from logarithms of multipliers, without that of index ``trivial``.

    Examples
    --------
    >>> stability_of_logs(np.array([0.0, -1.0]), 0), stability_of_logs(np.array([0.0, -1.0]), -1)
    ('stable', 'neutral')
    """
    kept = np.delete(logs, trivial) if trivial >= 0 else logs
    if np.isnan(kept).any():
        return "unknown"
    largest = float(kept.max(initial=-np.inf))
    return (
        "unstable"
        if largest > NEUTRAL_MULTIPLIER
        else "stable"
        if largest < -NEUTRAL_MULTIPLIER
        else "neutral"
    )


def _multiplier(value: complex, log: float) -> str:
    """A multiplier as text, or the logarithm of its modulus if it is tiny."""
    if np.isnan(value):
        return "unknown"
    if np.isfinite(log) and log < -36.0:
        return f"±exp({log:.4g})"
    if abs(value.imag) > 1e-9 * abs(value):
        return f"{value.real:.6g} {'+' if value.imag > 0 else '−'} {abs(value.imag):.6g}i"
    return f"{value.real:.6g}"
