"""Critical rates of a shift: the rates between which a model tracks its branch and tips."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, formula, validated
from fastslow.errors import ArgumentError
from fastslow.results.base.display import Summarized
from fastslow.results.base.html import Cells
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import RowTable
from fastslow.results.base.upper_layers import computed
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.folded_canards import FoldedCanard
from fastslow.results.points import Equilibrium
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Where derivatives of critical rates are computed.
RATE_GRADIENTS = "fastslow.passage.tipping.rate_gradients"


@dataclass(frozen=True, eq=False, repr=False)
class RateThreshold(Result):
    """One critical rate: at it the run of the shift ends on an edge state.

    Parameters
    ----------
    parameter : str
        The rate.
    rate : float
        Its critical value.
    below, above : str
        Where runs end at slightly lower and slightly higher rates.
    edge : Equilibrium, optional
        The edge state of the future limit; None if it is no equilibrium.
    method : str
        ``"Newton"`` for the condition that the run lands on the stable manifold of the edge,
        ``"canard"`` for that of a ramp that it follows the repelling sheet beyond a folded saddle,
        or ``"bisection"`` between the ends of runs.
    start_error, end_error : float
        Truncation errors of both ends: the changes of the rate if the run begins earlier, and by
        the last prolongation of the run. 0 for a shift that starts from rest. After bisection
        ``end_error`` is its last interval, or the distance from the rate at which runs of a
        hundredfold tolerance end as they should on both sides, if that is larger; NaN for a ramp.
    expansion : float
        Derivative of the distance from the edge at the end of the run with respect to the rate:
        at a rate that is rounded to its last place the run leaves the edge by so many units.
    run : Trajectory
        The run at this rate, up to the time at which it is near the edge.
    parameters : mapping
        Of the model, with the critical rate.
    canard : FoldedCanard, optional
        Of a ramp that does not settle, with its state where the slow quantity passes the folded
        saddle.
    contraction : float
        K = ∫f_x dt along the part of the repelling sheet that was followed: the repelling slow
        manifold, and with it the rate, is defined up to exp(−K). NaN without a canard.
    limit : float
        The critical rate of the slow flow, to which that of a ramp tends as the ratio of the rates
        vanishes; NaN without a canard, and if it was not found.
    source : object, optional
        The condition, for `gradient` and `continue_points`; not saved to files.
    """

    parameter: str
    rate: float
    below: str
    above: str
    edge: Equilibrium | None
    method: str
    start_error: float
    end_error: float
    expansion: float
    run: Trajectory
    parameters: Mapping[str, float]
    canard: FoldedCanard | None = None
    contraction: float = np.nan
    limit: float = np.nan
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @validated(name=formula)
    def gradient(self, name: Name) -> float:
        """Compute the derivative of the critical rate with respect to another parameter.

        With ψᵀ(x(T) − x_e(T)) = 0 it is −∂/∂p divided by ∂/∂r of the left side. The derivatives of
        the run pass interfaces and resets by saltation matrices.

        Parameters
        ----------
        name : str or Symbol
            A parameter of the shift or of the rates.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter.
        ArgumentError
            For the rate itself; where the threshold run has no derivative, as it touches an
            interface or meets two at once; for a rate that was located by bisection, or read from
            a file.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, w, t, r, L = sp.symbols("x w t r L")
        >>> shift = {w: L * (1 + sp.tanh(L * r * t / 2)) / 2}
        >>> model = fs.Model({x: (x + w) ** 2 - 1}, forcing=shift, parameters={r: 1, L: 3})
        >>> found = fs.critical_rate(model, "r", (0.5, 2))
        >>> round(found.gradient("L"), 8)  # r = 4/(L (L - 2))
        -1.77777778
        """
        found: float = computed(RATE_GRADIENTS, "gradient_of_rate")(self, name)
        return found

    @property
    def _located(self) -> str:
        """The rate with its truncation errors; that of the start is unknown after bisection."""
        unknown = np.isnan(self.start_error)
        error = self.end_error if unknown else max(self.start_error, self.end_error)
        how = " by bisection" if unknown else ""
        known = f"± {error:.1g}{how}" if np.isfinite(error) else f"{how.strip()}, error not known"
        return f"{self.parameter} = {self.rate:.10g} {known}"

    def __repr__(self) -> str:
        if self.canard is not None:
            where = f"canard at {self.canard._values()}, K = {self.contraction:.3g}"
        else:
            where = "that is no equilibrium" if self.edge is None else self.edge._values()
            where = f"edge {where}"
        return (
            f"RateThreshold({self._located}; below it {self.below}, above it {self.above}; {where})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class CriticalRate(Summarized, RowTable[RateThreshold], Result):
    """All critical rates of a shift within a range of its rate.

    ``found.rate`` is the critical rate if there is one, ``found[0]`` the first of them.

    Parameters
    ----------
    parameter : str
        The rate.
    quantity : str
        The slow quantity that shifts.
    over : tuple of float
        The range of the rate that was searched.
    thresholds : tuple of RateThreshold
        By increasing rate.
    rates : ndarray, shape (m,)
        Rates at which a run was made first; two critical rates between neighbours may be missed.
    ends : ndarray of str, shape (m,)
        Where these runs end: ``"tracks"`` on the continuation of the branch, ``"tips to …"``.
    limits : tuple of float
        The slow quantity as t → −∞ (at the start, if the shift has one) and as t → ∞.
    origin : Equilibrium
        The stable equilibrium from which the shift starts.
    target : Equilibrium, optional
        The continuation of its branch at the end of the shift; None if the branch ends before.
    edges : tuple of Equilibrium
        Equilibria of the future limit whose stable manifold has codimension one.
    overshoot : bool
        Whether the shift goes beyond the end of the branch and returns.
    diagram : Diagram
        Of the frozen model, over the range of the shift.
    outcome : Outcome
        ``"critical rates"``, or why there is none.
    """

    parameter: str
    quantity: str
    over: tuple[float, float]
    thresholds: tuple[RateThreshold, ...]
    rates: Array
    ends: NDArray[np.str_]
    limits: tuple[float, float]
    origin: Equilibrium
    target: Equilibrium | None
    edges: tuple[Equilibrium, ...]
    overshoot: bool
    diagram: Diagram
    outcome: Outcome

    _row = "threshold"
    _entry = "critical rate"

    def __len__(self) -> int:
        return len(self.thresholds)

    @property
    def rate(self) -> float:
        """The critical rate, if there is exactly one.

        Raises
        ------
        ArgumentError
            If there is none, or several.
        """
        return self._only().rate

    @validated(name=formula)
    def gradient(self, name: Name) -> float:
        """Compute the derivative of the only critical rate; see `RateThreshold.gradient`."""
        return self._only().gradient(name)

    def _only(self) -> RateThreshold:
        if len(self) != 1:
            known = ", ".join(f"{one.rate:.6g}" for one in self.thresholds)
            raise ArgumentError(
                f"{len(self)} critical rates were found{': ' * bool(known)}{known}; expected one. "
                f"{self.outcome if not known else 'Take them by index, as in found[0]'}"
            )
        return self.thresholds[0]

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return rate, what is below and above it, edge, method, errors and expansion."""
        rows = self.thresholds
        columns: dict[str, NDArray[Any]] = {
            self.parameter: np.array([one.rate for one in rows], dtype=float),
            "below": np.array([one.below for one in rows], dtype=str),
            "above": np.array([one.above for one in rows], dtype=str),
            "method": np.array([one.method for one in rows], dtype=str),
        }
        for k, state in enumerate(self.origin.states):
            values = [np.nan if one.edge is None else float(one.edge.state[k]) for one in rows]
            columns[state] = np.array(values, dtype=float)
        for name in ("start_error", "end_error", "expansion"):
            columns[name] = np.array([getattr(one, name) for one in rows], dtype=float)
        return columns

    def _item(self, row: int) -> RateThreshold:
        return self.thresholds[row]

    def _rows(self, rows: slice | NDArray[np.intp]) -> CriticalRate:
        kept = np.arange(len(self))[rows]
        return replace(self, thresholds=tuple(self.thresholds[k] for k in kept))

    def _groups(self) -> list[list[str]]:
        count, (past, future) = len(self), self.limits
        low, high = self.over
        head = (
            f"CriticalRate of {self.quantity} from {past:.6g} to {future:.6g}: {count} "
            f"threshold{'' if count == 1 else 's'} with {self.parameter} in [{low:g}, {high:g}]"
        )
        rows = [f"  {one._located}: {one.below} | {one.above}" for one in self.thresholds]
        return [[head, f"  {self.outcome}"], rows]

    def _cells(self) -> Cells:
        rows = [
            [
                f"{one.rate:.10g}",
                one.below,
                one.above,
                "" if one.edge is None else one.edge._values(),
            ]
            for one in self.thresholds
        ]
        return Cells([self.parameter, "below", "above", "edge"], rows)
