"""Critical rates of a shift that settles, and of a ramp that does not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, StateLike, formula, instance, interval, validated
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.tipping.ends_of_shifts import FutureSystem, ShiftRuns, is_edge
from fastslow.passage.tipping.ramp_rates import critical_rates_of_ramp
from fastslow.passage.tipping.rate_thresholds import RateBracket, thresholds_between
from fastslow.passage.tipping.shifts import Shift, shift_of
from fastslow.passage.tipping.tracked_branches import (
    TrackedBranch,
    stable_start,
    state_of,
    tracked_branch,
)
from fastslow.results.base.outcome import Outcome
from fastslow.results.points import Equilibrium
from fastslow.results.tipping import CriticalRate, RateThreshold
from fastslow.simulation.arguments import require_values
from fastslow.simulation.settings import Integration

Array = NDArray[np.float64]

#: Error control of the runs by which critical rates are bracketed.
BRACKETING = Integration(rtol=1e-11)

#: Rates at which runs are made first, and the ratio of the ends of a range from which they are
#: spaced evenly in their logarithm.
FIRST_RATES, LOGARITHMIC_RANGE = 49, 10.0

#: Values of the slow quantity between which the basins along the branch are compared.
BASIN_VALUES = 17


@validated(model=instance(Model), rate=formula, over=interval)
def critical_rate(
    model: Model,
    rate: Name,
    over: tuple[float, float],
    *,
    branch: Equilibrium | StateLike | None = None,
    edge: Equilibrium | StateLike | None = None,
) -> CriticalRate:
    """Compute the rates at which a shift of the slow quantity just makes a model tip.

    The shift settles: the slow quantity has a limit as t → ∞, and one as t → −∞ or a start from
    rest at t = 0. At a critical rate the solution that tends to the stable branch in the past ends
    on an edge state of the future (Wieczorek, Xie and Ashwin 2023). Its stable manifold has
    codimension one, so that this is one condition, ψᵀ(x(T) − x_e(T)) = 0 with the left eigenvector
    ψ of the unstable eigenvalue, solved by Newton's method with the sensitivities of the run for
    ever longer T.

    A ramp w₀ + c t that does not settle, of a model with one fast and one slow state, starts from
    rest at t = 0. At its critical rate the run is the canard of a folded saddle (Wieczorek, Ashwin,
    Luke and Cox 2011): it follows the repelling sheet for ever longer T.

    Parameters
    ----------
    model : Model
        With one slow quantity as a forcing; with one slow state for a ramp that does not settle.
    rate : str or Symbol
        A parameter of the forcing.
    over : (float, float)
        Range of the rate.
    branch : Equilibrium, mapping or sequence, optional
        The stable equilibrium from which the shift starts, or a state near it; needed if there
        are several.
    edge : Equilibrium, mapping or sequence, optional
        The only edge state to consider, or a state near it; by default all equilibria of the
        future limit with one unstable direction.

    Returns
    -------
    CriticalRate
        All critical rates in the range that separate the ends of the runs made; without any, its
        outcome gives the reason.

    Raises
    ------
    UnknownNameError
        For a rate that is no parameter.
    ModelError
        For a model without exactly one slow quantity as a forcing.
    ArgumentError
        For a rate that is no parameter of the forcing, a shift that neither settles nor is a ramp
        with a folded saddle, a start that
        is not on a stable branch, several of them without ``branch``, or an edge that is not one.

    See Also
    --------
    fastslow.tipping_map, fastslow.basin_instability, fastslow.edge_state, fastslow.minimal_shock

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, w, t, r, D = sp.symbols("x w t r D")
    >>> ramp = {w: sp.Min(r * t, D)}
    >>> model = fs.Model({x: sp.Abs(x + w) - 1}, forcing=ramp, parameters={r: 2, D: 2.7})
    >>> found = fs.critical_rate(model, "r", (1.2, 4))
    >>> print(f"r = {found.rate:.9f}; {found[0].below} below, {found[0].above} above")
    r = 2.130861957; tracks below, tips, unbounded above
    """
    require_values(model)
    name, (low, high) = str(rate), over
    if model.slow_states:
        if edge is not None:
            raise ArgumentError("edge: the threshold of a ramp is a canard; expected no edge")
        return critical_rates_of_ramp(model, name, over, _spaced(low, high), branch)
    shift = shift_of(model, name, low)
    for other in (0.5 * (low + high), high):
        _require_same_limits(shift, shift_of(model, name, other), name)
    frozen = model.frozen()
    start = stable_start(frozen, shift.name, shift.past, branch, "branch")
    diagram = continue_equilibria(frozen, shift.name, over=_range_of(shift))
    tracked = tracked_branch(frozen, diagram, start)
    future = FutureSystem.of(frozen.with_parameters({shift.name: shift.future}), BRACKETING)
    if edge is not None:
        future = future.with_edge(_edge_of(future, edge))
    target = tracked.point(shift.future)
    goal = future.index_of(target)
    runs = ShiftRuns(model, name, tracked, shift, BRACKETING, future)
    rates = _spaced(low, high)
    ends = runs.ends(rates)
    found: list[RateThreshold] = []
    for k in np.flatnonzero(np.diff(ends)).tolist():
        bracket = RateBracket(float(rates[k]), float(rates[k + 1]), int(ends[k]), int(ends[k + 1]))
        found += thresholds_between(runs, bracket, goal)
    least, most = shift.extent
    beyond = least < tracked.extent[0] or most > tracked.extent[1]
    words = np.array([future.words(int(one), goal) for one in ends], dtype=str)
    return CriticalRate(
        parameter=name,
        quantity=shift.name,
        over=(low, high),
        thresholds=tuple(found),
        rates=rates,
        ends=words,
        limits=(shift.past, shift.future),
        origin=start,
        target=target,
        edges=future.edges,
        overshoot=bool(beyond and target is not None),
        diagram=diagram,
        outcome=_outcome(found, tracked, shift, future, words, goal),
    )


def _range_of(shift: Shift) -> tuple[float, float]:
    low, high = shift.extent
    if low == high:
        raise ArgumentError(
            f"the shift {shift.name} = {shift.law} is constant; expected one that changes"
        )
    return low, high


def _require_same_limits(one: Shift, other: Shift, rate: str) -> None:
    for first, second in ((one.past, other.past), (one.future, other.future)):
        if abs(first - second) > 1e-6 * one.range:
            raise ArgumentError(
                f"the limits of {one.name} = {one.law} depend on {rate}: {first:.6g} and "
                f"{second:.6g}; expected a parameter that changes the time of the shift alone"
            )


def _edge_of(future: FutureSystem, given: Equilibrium | StateLike) -> Equilibrium:
    """The equilibrium of the future limit that is given as the edge."""
    state = state_of(future.model, given, "edge")
    listed = "; ".join(e._values() for e in future.edges) or "none"
    nearest = min(
        future.equilibria,
        key=lambda e: float(np.abs((e.state - state) / future.size).max()),
        default=None,
    )
    if nearest is None or not is_edge(nearest):
        what = "none" if nearest is None else repr(nearest)
        raise ArgumentError(
            f"edge: the equilibrium of the future limit nearest to it, {what}, is no edge state, "
            f"which has one unstable direction; expected one of {listed}"
        )
    return nearest


def _spaced(low: float, high: float) -> Array:
    if low > 0.0 and high / low >= LOGARITHMIC_RANGE:
        return np.geomspace(low, high, FIRST_RATES)
    return np.linspace(low, high, FIRST_RATES)


def _outcome(
    found: list[RateThreshold],
    tracked: TrackedBranch,
    shift: Shift,
    future: FutureSystem,
    words: NDArray[np.str_],
    goal: int | None,
) -> Outcome:
    """What was found, or why there is no critical rate."""
    runs = f"the ends of the runs at {len(words)} rates"
    induced = ""
    if tracked.point(shift.future) is None:
        end = tracked.ends[int(shift.future > tracked.extent[1])]
        value = tracked.extent[int(shift.future > tracked.extent[1])]
        induced = (
            f"the branch ends at {end}, {shift.name} = {value:.6g}, and the shift goes on to "
            f"{shift.future:.6g}: tipping is bifurcation-induced at every rate"
        )
    if found:
        count = "one critical rate separates"
        if len(found) > 1:
            count = f"{len(found)} critical rates separate"
        tail = f"; {induced}." if induced else "."
        return Outcome("critical rates", f"{count} {runs}{tail}", True)
    if induced:
        return Outcome("bifurcation-induced", f"no critical rate: {induced}.", True)
    if (words == "tracks").all():
        away = unstable_pair(tracked, shift, future)
        if away is None:
            if shift.returns:
                beyond = "the shift returns, and all runs return to the branch"
                return Outcome("basin stable", f"no critical rate in this range: {beyond}.", True)
            why = "the branch is basin stable: each of its states is in the basin of all later ones"
            return Outcome("basin stable", f"no critical rate, as {why}.", True)
        first, second = away
        return Outcome(
            "tracks at all rates",
            f"no critical rate in this range, where all runs track the branch; it is not basin "
            f"stable: the state at {shift.name} = {first:.6g} is outside the basin of that at "
            f"{second:.6g}, so that faster shifts may tip.",
            True,
        )
    return Outcome(
        "no change",
        f"no critical rate in this range: all runs end alike, {words[0]}; expected a range with "
        "lower and higher rates.",
        True,
    )


def unstable_pair(
    tracked: TrackedBranch, shift: Shift, future: FutureSystem
) -> tuple[float, float] | None:
    """Two values of the slow quantity, in order, between which the basin of the branch is left.

    The state of the branch at the first is outside the basin of that at the second; None if there
    is no such pair among `BASIN_VALUES` values along the shift.
    """
    values = shift.path(BASIN_VALUES)
    points = [tracked.point(value) for value in values.tolist()]
    for k in range(1, len(values)):
        here = points[k]
        if here is None:
            continue
        there = tracked.frozen.with_parameters({shift.name: float(values[k])})
        system = FutureSystem.of(there, future.integration)
        earlier = [j for j in range(k) if points[j] is not None]
        starts = np.array([points[j].state for j in earlier])  # type: ignore[union-attr]
        reached = system.reached(starts, np.zeros(len(starts), dtype=np.int64))
        outside = np.flatnonzero(reached != system.index_of(here))
        if len(outside):
            return float(values[earlier[int(outside[0])]]), float(values[k])
    return None
