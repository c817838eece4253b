"""Ends of branches of cycles at which the period is infinite.

Near a homoclinic orbit of a saddle, whose eigenvalues nearest to the imaginary axis are λ_u > 0
and λ_s < 0, the period grows as T = -ln|p - p*| / min(λ_u, |λ_s|); on a cycle with a saddle-node
it grows as |p - p*|^(-1/2) (Kuznetsov 2004, sections 6.2 and 7.1). It grows logarithmically also
where a cycle reaches an equilibrium on an interface, and near a homoclinic orbit of a pseudo-saddle
with its eigenvalues in the interface.

The homoclinic orbit is solved for by multiple shooting with projection boundary conditions
(Beyn 1990): its start is in the unstable and its end in the stable eigenspace of the saddle, both
at a distance ε. The error of p* is of the order of ε²; ε is reduced to `NEAREST_DISTANCE`.

References
----------
W.-J. Beyn, The numerical computation of connecting orbits in dynamical systems, IMA Journal of
Numerical Analysis 10(3), 379-405, 1990.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import newton
from fastslow.orbits.endings import (
    BOUNDARY_EQUILIBRIUM_ON_CYCLE,
    HOMOCLINIC,
    HOMOCLINIC_TO_PSEUDO_SADDLE,
    HOMOCLINIC_WITH_RESETS,
    PERIOD_UNBOUNDED,
    SADDLE_NODE_ON_CYCLE,
)
from fastslow.orbits.ends.pseudo_saddles import pseudo_homoclinic
from fastslow.orbits.ends.slowest_points import (
    Saddle,
    Slowest,
    equilibrium_near,
    fields_at,
    slowest_of,
    with_value,
)
from fastslow.orbits.find.orbit_curve import OrbitCurve, Row
from fastslow.orbits.flow.equations import CLOSING, NODE
from fastslow.orbits.flow.events import OrbitError, functions_at
from fastslow.orbits.flow.problem import OrbitProblem, growth_of, same_itinerary
from fastslow.orbits.flow.segments import Segments, divided, winding_of
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points.kinds import CONNECTION
from fastslow.orbits.points.location import row_units, solve_extended
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_arrays import outcome_of
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Distance from an equilibrium, in units of the ranges, at which the period may be infinite, and at
#: which a branch ends whose growth of the period is not identified.
NEAR_SADDLE, AT_SADDLE = 0.05, 1e-7

#: Growth of the period over the rows that give its law: in units of 1/λ, and as a ratio.
SPREAD, PERIOD_RATIO = 0.2, 1.5

#: Relative difference of a measured rate or power of growth from its theory.
GROWTH_LAW_ERROR = 0.1

#: Ratio of the distance of p* to that expected from the growth of the period.
DISTANCE_RATIO = 2.0

#: Distance of the parameter from that of an infinite period, as a fraction of its range, at which a
#: branch ends: for a period that grows logarithmically, and for one that grows like a root.
LOGARITHMIC_END, ROOT_END = 1e-6, 1e-4

#: Distance ε of the ends from the saddle, in units of the ranges: the first one is at least
#: `FIRST_DISTANCE`, each following one smaller by the factor ε^(-1/2), at most `FACTOR`, the last
#: one at most `NEAREST_DISTANCE`.
FIRST_DISTANCE, FACTOR, NEAREST_DISTANCE = 1e-3, 100.0, 1e-6

#: Newton step, in units of the scales, that ends the solution at the nearest distance, at others.
LAST_STEP, STARTING_STEP = 1e-15, 1e-10

#: Error of the parameter, relative to the distance from which it was extrapolated, of a located
#: homoclinic orbit.
LOCATED = 1e-3


class PeriodGrowth(NamedTuple):
    """Growth of the period along the last rows of a branch.

    Parameters
    ----------
    rate, power : float
        Of the derivative dp/dT as exp(-rate T), and as T^power.
    slope : float
        dp/dT at the last row.
    """

    rate: float
    power: float
    slope: float


class BranchEnd(NamedTuple):
    """The end of a branch: its outcome, and the row of a homoclinic orbit if there is one.

    Where the end is ahead of the last row, the parameter there, and the distance from it, as a
    fraction of the range, at which the branch ends.
    """

    outcome: Outcome
    row: Row | None = None
    value: float = np.nan
    reach: float = np.inf


@dataclass(eq=False)
class InfinitePeriod:
    """Recognition of an infinite period along a branch of cycles.

    Parameters
    ----------
    curve : OrbitCurve
        Of an autonomous model.
    tried : float
        Distance from the saddle at which a homoclinic orbit was last solved for in vain.
    candidate : Outcome or None
        For a branch that ends at the last row: a cycle that passes a saddle closely, or the end
        that is ahead.
    ahead : BranchEnd or None
        The end towards which the period grows.
    """

    curve: OrbitCurve
    tried: float = np.inf
    candidate: Outcome | None = None
    ahead: BranchEnd | None = None

    def end(self, rows: Sequence[Row]) -> BranchEnd | None:
        """Return the end of the branch, if its period is recognised as infinite there.

        Parameters
        ----------
        rows : sequence of Row
            The rows traced so far.
        """
        last, self.candidate = rows[-1], None
        if (
            len(rows) < 3
            or not last.arrays.period > rows[-2].arrays.period > rows[-3].arrays.period
        ):
            self.ahead = None
            return None
        found = self.ahead or self._recognised(rows)
        if found is None or found.reach == np.inf:
            return found
        low, high = self.curve.over
        if abs(found.value - last.value) <= found.reach * (high - low):
            return found
        self.ahead, name = found, self.curve.name
        text = f"{found.outcome.message} The last cycle is at {name} = {last.value:.10g}."
        self.candidate = replace(found.outcome, message=text)
        return None

    def _recognised(self, rows: Sequence[Row]) -> BranchEnd | None:
        """The end towards which the period grows along the last rows."""
        last = rows[-1]
        slow = slowest_of(self.curve.problem, last)
        if slow is None:
            return None
        values = last.shooting.parameters_at(last.u)
        rest = equilibrium_near(self.curve.problem, slow, values)
        away = np.inf if rest is None else rest.distance(slow)
        if rest is None or away > NEAR_SADDLE:
            return self._saddle_node(rows, slow)
        rate = float(np.abs(rest.eigenvalues.real).min())
        if rate > 0:
            period = last.arrays.period
            growth = growth_of_period(rows, period - SPREAD / rate, 2.0 * SPREAD / rate)
            end = None if growth is None else self._logarithmic(last, slow, rest, growth, rate)
            if end is not None or self.candidate is not None:
                return end
        if not rest.is_saddle or away > FIRST_DISTANCE:
            return None
        name, value = self.curve.name, last.value
        saddle = "pseudo-saddle" if rest.slides else "saddle"
        self.candidate = PERIOD_UNBOUNDED.at(
            period=last.arrays.period,
            where=f"{name} = {value:.10g}",
            saddle=saddle,
            distance=away,
        )
        return BranchEnd(self.candidate) if away <= AT_SADDLE else None

    def _logarithmic(
        self, last: Row, slow: Slowest, rest: Saddle, growth: PeriodGrowth, rate: float
    ) -> BranchEnd | None:
        """The end at which the period grows logarithmically."""
        if not growth.rate > 0:
            return None
        end, away = None, rest.distance(slow)
        if not rest.slides:
            end = self._at_interface(last, slow, rest, growth)
        if end is not None:
            return end
        jumps = self.curve.problem.variations.jumps
        if jumps.resets or jumps.events:
            return self._extrapolated(last, rest, growth, away)
        if not rest.is_saddle:
            return None
        if abs(growth.rate / rate - 1.0) < GROWTH_LAW_ERROR and away < 0.1 * self.tried:
            self.tried = away
            solve = self._pseudo_homoclinic if rest.slides else self._homoclinic
            end = solve(last, slow, rest, growth.slope / rate)
        return end

    def _extrapolated(
        self, last: Row, rest: Saddle, growth: PeriodGrowth, away: float
    ) -> BranchEnd | None:
        """The end near a saddle in a model with jumps, for which no connection is solved for.

        Where the reset contracts, the passage of the saddle alone determines the period, which
        grows with the rate λ_u even if λ_u > |λ_s|. A reset may also be the only motion that
        approaches the equilibrium, as with one state.
        """
        real = rest.eigenvalues.real
        if not (real > 0).any() or not (real != 0).all():
            return None
        rates = np.array([real[real > 0].min(), np.abs(real).min()])
        if (
            away > FIRST_DISTANCE
            or not (np.abs(growth.rate / rates - 1.0) < GROWTH_LAW_ERROR).any()
        ):
            return None
        name, saddle = self.curve.name, "pseudo-saddle" if rest.slides else "saddle"
        jumps = self.curve.problem.variations.jumps
        if not rest.is_saddle:
            saddle = "repelling equilibrium"
        value = last.value + growth.slope / growth.rate
        self.candidate = HOMOCLINIC_WITH_RESETS.at(
            name=name,
            value=value,
            saddle=saddle,
            distance=away,
            jumps="resets" if jumps.resets else "events",
        )
        low, high = self.curve.over
        ahead = abs(growth.slope / growth.rate)
        return BranchEnd(self.candidate) if ahead <= LOGARITHMIC_END * (high - low) else None

    def _saddle_node(self, rows: Sequence[Row], slow: Slowest) -> BranchEnd | None:
        """The end at a saddle-node on the cycle."""
        last = rows[-1]
        period = last.arrays.period
        growth = growth_of_period(rows, period / PERIOD_RATIO, period * (1.0 - PERIOD_RATIO**-2))
        if growth is None or abs(growth.power / -3.0 - 1.0) > GROWTH_LAW_ERROR:
            return None
        expected = 0.5 * growth.slope * period
        found = saddle_node_near(self.curve.problem, last, slow)
        if found is None or not _is_expected(found[-1] - last.value, expected):
            return None
        name, value = self.curve.name, float(found[-1])
        sliding = (self.curve.problem.variations.signs[slow.mode] == 0).any()
        equilibria = "pseudo-equilibria" if sliding else "equilibria"
        outcome = SADDLE_NODE_ON_CYCLE.at(name=name, value=value, equilibria=equilibria)
        return BranchEnd(outcome, None, value, ROOT_END)

    def _at_interface(
        self, last: Row, slow: Slowest, rest: Saddle, growth: PeriodGrowth
    ) -> BranchEnd | None:
        """The end at an equilibrium on an interface, or where the state jumps."""
        problem, name = self.curve.problem, self.curve.name
        variations = problem.variations
        for interface in np.flatnonzero(variations.signs[slow.mode]).tolist():

            def equations(z: Array, interface: int = interface) -> Array:
                values = with_value(last.shooting, float(z[-1]))
                known = fields_at(problem, slow.mode, z[:-1], values)
                return np.append(known.f[0], known.g[0, interface])

            guess = np.append(rest.state, last.value)
            scale = np.append(slow.size, abs(growth.slope / growth.rate))
            z, _, converged, _ = newton(equations, guess, scale)
            if converged and _is_expected(z[-1] - last.value, growth.slope / growth.rate):
                surface = "the interface " * (interface < variations.interfaces)
                outcome = BOUNDARY_EQUILIBRIUM_ON_CYCLE.at(
                    name=name, value=z[-1], where=surface + variations.function_names[interface]
                )
                return BranchEnd(outcome, None, float(z[-1]), LOGARITHMIC_END)
        return None

    def _homoclinic(
        self, last: Row, slow: Slowest, saddle: Saddle, expected: float
    ) -> BranchEnd | None:
        """The end at a homoclinic orbit, if it is solved for."""
        try:
            point = homoclinic_orbit(self.curve, last, slow, saddle, abs(expected))
        except OrbitError:
            return None
        name = self.curve.name
        if point is None or not _is_expected(point[name] - last.value, expected):
            return None
        u = np.append(last.u[:-1], point[name])
        row = self.curve.row(last.shooting, u, point.orbit, 0.0, point)
        return BranchEnd(HOMOCLINIC.at(name=name, value=point[name]), row)

    def _pseudo_homoclinic(
        self, last: Row, slow: Slowest, saddle: Saddle, expected: float
    ) -> BranchEnd | None:
        """The end at a homoclinic orbit of a pseudo-saddle, if it is solved for."""
        if len(saddle.jacobian) != 1 or saddle.distance(slow) > FIRST_DISTANCE:
            return None
        value = pseudo_homoclinic(self.curve, last, slow, saddle, expected)
        if value is None or not _is_expected(value - last.value, expected):
            return None
        return BranchEnd(HOMOCLINIC_TO_PSEUDO_SADDLE.at(name=self.curve.name, value=value))


def _is_expected(shift: float, expected: float) -> bool:
    """Check that a point is ahead, about as far as the growth of the period predicts."""
    return bool(1.0 / DISTANCE_RATIO < shift / expected < DISTANCE_RATIO)


def growth_of_period(rows: Sequence[Row], middle: float, reach: float) -> PeriodGrowth | None:
    """Growth of the period from the last row, one with a period below ``middle``, and another one.

    The first row has a period that is smaller than that of the last one by ``reach``; None without
    such rows, or if the parameter does not converge.
    """
    last = rows[-1]
    chosen: list[Row] = []
    for row in reversed(rows[:-1]):
        if row.point is not None or row.arrays.period >= last.arrays.period:
            break
        if not chosen:
            chosen += [row] if row.arrays.period <= middle else []
        elif row.arrays.period <= last.arrays.period - reach:
            chosen.append(row)
            break
    if len(chosen) < 2:
        return None
    p = np.array([row.value for row in (chosen[1], chosen[0], last)])
    T = np.array([row.arrays.period for row in (chosen[1], chosen[0], last)])
    if not (np.diff(T) > 0).all():
        return None
    slopes, at = np.diff(p) / np.diff(T), 0.5 * (T[1:] + T[:-1])
    if not slopes[0] * slopes[1] > 0:
        return None
    fall = float(np.log(slopes[1] / slopes[0]))
    rate = -fall / float(at[1] - at[0])
    slope = float(slopes[1] * np.exp(-rate * (T[2] - at[1])))
    return PeriodGrowth(rate, fall / float(np.log(at[1] / at[0])), slope)


def saddle_node_near(problem: OrbitProblem, row: Row, slow: Slowest) -> Array | None:
    """State, null vector and parameter of a saddle-node near a point of a cycle.

    On the interfaces on which the motion slides, its rates and the null vector are tangential.
    """
    n = problem.variations.n
    values = row.shooting.parameters_at(row.u)
    here = fields_at(problem, slow.mode, slow.state, values)
    on = np.flatnonzero(problem.variations.signs[slow.mode] == 0)
    # of a basis in units of the ranges: tangents to the interfaces
    tangents = np.linalg.svd(here.g_u[0, on, :n] * slow.size)[2][len(on) :] / slow.size

    def equations(z: Array) -> Array:
        state, v = z[:n], z[n : 2 * n]
        known = fields_at(problem, slow.mode, state, with_value(row.shooting, float(z[-1])))
        rates, turned = tangents @ known.f[0], tangents @ (known.f_u[0, :, :n] @ v)
        borders = known.g[0, on], known.g_u[0, on, :n] @ v
        length = ((v / slow.size) ** 2).sum() - 1.0
        return np.concatenate([rates, borders[0], turned, borders[1], [length]])

    v = here.f[0] / np.linalg.norm(here.f[0] / slow.size)
    scale = np.concatenate([slow.size, slow.size, [abs(row.value) or 1.0]])
    z, _, converged, _ = newton(equations, np.concatenate([slow.state, v, [row.value]]), scale)
    return (
        z if converged and (np.abs(z[:n] - slow.state) <= NEAR_SADDLE * slow.size).all() else None
    )


@dataclass(frozen=True, eq=False)
class _Connection:
    """The equations of an orbit from near a saddle back to it.

    Parameters
    ----------
    problem : OrbitProblem
    shooting : Shooting
        Its closing and phase condition are replaced by those at the saddle.
    slow : Slowest
        Near the saddle.
    distance : float
        Of both ends from the saddle, in units of the ranges.
    scale : ndarray, shape (N + 1,)
        Units of the unknowns.
    """

    problem: OrbitProblem
    shooting: Shooting
    slow: Slowest
    distance: float
    scale: Array

    def saddle(self, u: Array) -> Saddle | None:
        """The saddle at the parameter of unknowns."""
        values = self.shooting.parameters_at(u)
        found = equilibrium_near(self.problem, self.slow, values)
        return found if found is not None and found.is_saddle else None

    def conditions(self, begin: Array, end: Array, saddle: Saddle) -> tuple[Array, Array, Array]:
        """Projection and distance conditions, with their derivatives by both ends."""
        unit, n = self.slow.size * self.distance, len(begin)
        out, back = (begin - saddle.state) / unit, (end - saddle.state) / unit
        unstable, stable = saddle.spaces()
        lengths = [0.5 * (out @ out - 1.0), 0.5 * (back @ back - 1.0)]
        by_begin, by_end = np.zeros((n + 2, n)), np.zeros((n + 2, n))
        by_begin[: len(stable)], by_end[len(stable) : n] = stable, unstable
        by_begin[n], by_end[n + 1] = out, back
        values = np.concatenate([stable @ out, unstable @ back, lengths])
        return values, by_begin / unit, by_end / unit

    def system(self, u: Array) -> tuple[Array, Array, NDArray[np.complex128]]:
        """Residual and Jacobian in units of the scales."""
        shooting, scale = self.shooting, self.scale
        K, n, N = len(shooting.form), shooting.variations.n, shooting.size
        last = shooting.linearised(u)
        closing = np.arange((K - 1) * n, K * n)
        kept = np.delete(np.arange(N - 1), closing)
        saddle = self.saddle(u)
        if saddle is None:
            return np.full(N + 1, np.nan), np.full((N + 1, N + 1), np.nan), np.zeros(0, complex)
        end = last.residual[closing] + u[:n]
        by_unknowns = last.jacobian[closing].copy()
        by_unknowns[:, :n] += np.eye(n)
        # the rate at the end, which is not at the start
        mode, values = int(shooting.form.modes[-1]), shooting.parameters_at(u)
        by_unknowns[:, K * (n + 1) - 1] = fields_at(self.problem, mode, end, values).f[0]
        known, by_begin, by_end = self.conditions(u[:n], end, saddle)
        slopes = by_end @ by_unknowns
        slopes[:, :n] += by_begin
        # the eigenspaces turn with the parameter by less than the saddle moves
        slopes[:, -1] -= (by_begin + by_end) @ saddle.drift
        rows = row_units(shooting, last, scale)[kept]
        values = np.concatenate([last.residual[kept] / rows, known])
        matrix = np.vstack([last.jacobian[kept] / rows[:, None], slopes]) * scale
        return values, matrix, np.zeros(0, dtype=complex)

    def longer(self, u: Array, factor: float) -> tuple[Shooting, Array]:
        """Equations and approximate unknowns with ends nearer to the saddle, by linear flow."""
        segments, period = self.shooting.unpack(u)
        n = self.shooting.variations.n
        found = self.saddle(u)
        assert found is not None
        last = self.shooting.linearised(u)
        K = len(segments)
        end = last.residual[(K - 1) * n : K * n] + segments.states[0] + self.shooting.winding
        unstable, stable = found.leading
        times = np.log(factor) / np.array([unstable, -stable])
        size = self.slow.size
        before = found.state + size * found.unstable_flow(
            (segments.states[0] - found.state) / size, -times[0]
        )
        ends = np.concatenate([[NODE], segments.ends[:-1], [NODE, CLOSING]])
        form = Segments(
            segments.start,
            np.concatenate([segments.modes[:1], segments.modes, segments.modes[-1:]]),
            ends,
            np.vstack([before, segments.states, end]),
            np.concatenate([times[:1], segments.durations, times[1:]]),
        )
        shooting = replace(self.shooting, form=form)
        guess = np.append(shooting.pack(form, period + times.sum())[: shooting.size], u[-1])
        return shooting, guess


def homoclinic_orbit(
    curve: OrbitCurve, last: Row, slow: Slowest, saddle: Saddle, unit: float
) -> SpecialOrbit | None:
    """Solve for the homoclinic orbit near a cycle of long period.

    Parameters
    ----------
    curve : OrbitCurve
    last : Row
        The cycle.
    slow : Slowest
    saddle : Saddle
        At the parameter of the cycle.
    unit : float
        Distance of the parameter, for its unit.

    Returns
    -------
    SpecialOrbit or None
        None without convergence, or if a free run has another itinerary.

    Raises
    ------
    OrbitError
        If too many segments are needed.
    """
    problem = curve.problem
    here = problem.at(last.shooting.parameters_at(last.u))
    run = here.run(slow.state, slow.time, slow.time + last.arrays.period)
    if not run.outcome:
        return None
    winding = winding_of(run, slow.time, last.arrays.period)
    away = float(np.linalg.norm((slow.state - saddle.state) / slow.size))
    distance = max(FIRST_DISTANCE, 2.0 * away)
    guess = _cut(here, run, saddle.state, winding, slow.size, distance)
    if guess is None:
        return None
    values = last.shooting.parameters_at(last.u)
    shooting = replace(last.shooting, parameters=values, form=guess, winding=winding)
    u = shooting.pack(shooting.form, shooting.form.period)
    for _ in range(6):
        growth = growth_of(shooting.linearised(u), shooting.form)
        finer = divided(shooting.form, growth, here.states_at)
        if finer is shooting.form:
            break
        shooting = replace(shooting, form=finer)
        u = shooting.pack(finer, finer.period)
    known, factor, near = [], FACTOR, slow._replace(state=saddle.state)
    while True:
        K, period = len(shooting.form), shooting.form.period
        scale = np.concatenate([np.tile(slow.size, K), np.full(K + 1, period), [unit]])
        connection = _Connection(problem, shooting, near, distance, scale)
        # the others are starting points, and tell how the parameter converges
        enough = LAST_STEP if distance <= NEAREST_DISTANCE else STARTING_STEP
        with np.errstate(all="ignore"):
            u, _, _, step, converged = solve_extended(connection.system, u, scale, enough)
        if not converged:
            return None
        known.append(float(u[-1]))
        if distance <= NEAREST_DISTANCE:
            break
        factor = min(FACTOR, distance**-0.5)
        shooting, u = connection.longer(u, factor)
        distance /= factor
    left = np.abs(connection.system(u)[0])
    left[-len(slow.size) - 2 :] *= distance
    # the error is of second order in the distance
    accuracy = abs(known[-1] - known[-2]) / factor
    if not accuracy <= LOCATED * unit:
        return None
    return _point(curve, connection, u, winding, (float(left.max()), max(step, accuracy / unit)))


def _cut(
    problem: OrbitProblem,
    run: Trajectory,
    saddle: Array,
    winding: Array,
    size: Array,
    distance: float,
) -> Segments | None:
    """The segments of a run between its first and last states at a distance from the saddle."""
    n, variations = problem.variations.n, problem.variations
    times, states = run.t, run.sampled_columns[:n].T
    out = np.linalg.norm((states - saddle) / size, axis=1) >= distance
    back = np.linalg.norm((states - winding - saddle) / size, axis=1) >= distance
    if not out.any() or not back.any():
        return None
    since, until = (
        float(times[np.argmax(out)]),
        float(times[len(times) - 1 - np.argmax(back[::-1])]),
    )
    mode = run.steps[:, 2].astype(np.int64)
    changes = np.flatnonzero(mode[1:] != mode[:-1]) + 1
    when = run.steps[changes, 0]
    inside = (when > since) & (when < until)
    changes, when = changes[inside], when[inside]
    first = mode[max(int(np.searchsorted(run.step_starts, since, side="right")) - 1, 0)]
    modes = np.r_[first, mode[changes]]
    if until <= since or modes[-1] != first:
        return None
    at = run(when).T.reshape(-1, n)
    ends = functions_at(run, when, modes[:-1], modes[1:], at, variations, problem.parameters)
    return Segments(
        since,
        modes,
        np.r_[ends, CLOSING].astype(np.int64),
        np.vstack([run(since), at]),
        np.diff(np.r_[since, when, until]),
    )


def _point(
    curve: OrbitCurve,
    connection: _Connection,
    u: Array,
    winding: Array,
    errors: tuple[float, float],
) -> SpecialOrbit | None:
    """The special point of a solved homoclinic orbit, confirmed by a free run."""
    shooting = connection.shooting
    here = curve.problem.at(shooting.parameters_at(u))
    segments, length = shooting.unpack(u)
    if (segments.durations <= 0).any():
        return None
    run = here.free_run(segments, length)
    saddle = equilibrium_near(here, connection.slow, here.parameters)
    if saddle is None or not run.outcome or not same_itinerary(run.steps, segments, length):
        return None
    signs = here.variations.signs[connection.slow.mode]
    known = fields_at(here, connection.slow.mode, saddle.state, here.parameters)
    if not (signs * known.g[0, : len(signs)] > 0)[signs != 0].all():
        return None
    n = here.variations.n
    nothing = np.full(n, np.nan)
    orbit = Orbit(
        *(run, np.inf, None, nothing.astype(complex), nothing, None),
        *(float("nan"), *errors, outcome_of(np.inf)),
    )
    return CONNECTION.point(
        *(curve.name, orbit, errors, True),
        saddle=saddle.state,
        saddle_quantity=sum(saddle.leading),
    )
