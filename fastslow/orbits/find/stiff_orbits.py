"""Orbits of stiff models, from the return map of implicit runs.

The flow of `fastslow.orbits.flow.flows` takes explicit steps, whose number grows with the fastest
rate of contraction. Along an attracting slow manifold a run takes implicit steps instead; its
derivative X' = J(t) X is then integrated by collocation at the Radau nodes, which is L-stable
(Hairer and Wanner 1996, section IV.5), and Newton's method is applied to the return map.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from fastslow.orbits.flow.flows import fields
from fastslow.orbits.flow.multipliers import TRIVIAL_MULTIPLIER_ERROR, multipliers_of
from fastslow.orbits.flow.problem import ORBIT_SOLVED, OrbitProblem
from fastslow.orbits.flow.segments import SEGMENT_GROWTH
from fastslow.orbits.flow.shooting import STALLED_NEWTON_STEP, sizes_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Product of step and fastest rate of an explicit step, and number of such steps in one period
#: from which a model is stiff.
EXPLICIT, STIFF = 5.0, 20_000

#: Collocation points of a step.
COLLOCATION_POINTS = 10

#: Largest number of Newton steps.
STIFF_NEWTON_STEPS = 12


class Along(NamedTuple):
    """Derivatives along a run.

    Parameters
    ----------
    factors : ndarray, shape (N, n, n)
        Of the last state of every step by its first one.
    trace : float
        Integral of the trace of J.
    rates : ndarray, shape (N + 1, n)
        At the ends of the steps.
    """

    factors: Array
    trace: float
    rates: Array


def is_stiff(problem: OrbitProblem, run: Trajectory, since: float, period: float) -> bool:
    """Check whether explicit steps along one period of a smooth run would be too many."""
    if problem.variations.jumps.rows or problem.variations.constants or run.series is None:
        return False
    along = (run.steps[:, 0] >= since) & (run.steps[:, 0] < since + period)
    steps = run.steps[along]
    if not len(steps) or (steps[:, 2] != steps[0, 2]).any():
        return False
    n = problem.variations.n
    states = run.series[along, :n, 0]
    modes = steps[:, 2].astype(np.int64)
    slopes = fields(problem.variations, modes, states, steps[:, 0], problem.parameters).f_u
    if not np.isfinite(slopes).all():
        return False
    fastest = np.abs(np.linalg.eigvals(slopes[:, :, :n])).max(axis=1)
    lengths = np.diff(steps[:, 0], append=since + period)
    return bool(fastest @ lengths > EXPLICIT * STIFF)


def stiff_orbit(
    problem: OrbitProblem, run: Trajectory, since: float, period: float, winding: Array
) -> Orbit | None:
    """Solve for the orbit near one period of a run of a stiff model; None without convergence.

    Parameters
    ----------
    problem : OrbitProblem
    run : Trajectory
        With one smooth motion.
    since, period : float
    winding : ndarray, shape (n,)
        What the periodic states gain in one period.
    """
    n, forced = problem.variations.n, problem.forcing is not None
    mode = int(run.steps[-1, 2])
    times = run.steps[(run.steps[:, 0] >= since) & (run.steps[:, 0] < since + period), 0]
    states = run(times).T
    size = sizes_of(states, states)
    start = since
    if not forced:
        # on a slow manifold the state is determined best
        speeds = np.linalg.norm(_rates(problem, mode, states, times) / size, axis=1)
        start = float(times[np.argmin(speeds)])
    state, before = run(start), np.inf
    for _ in range(STIFF_NEWTON_STEPS):
        whole = problem.run(state, start, start + period)
        if not whole.outcome or (whole.steps[:, 2] != mode).any():
            return None
        along = derivatives_along(problem, whole)
        whole_slope = np.eye(n)
        for factor in along.factors:
            whole_slope = factor @ whole_slope
        scaled = whole_slope * size / size[:, None]
        if not np.linalg.norm(scaled) <= SEGMENT_GROWTH:
            return None
        gap = (whole.end[1:] - state - winding) / size
        matrix, right = scaled - np.eye(n), -gap
        if not forced:
            rates = along.rates[[0, -1]] / size
            direction = rates[0] / np.linalg.norm(rates[0])
            corner = np.append(direction, 0.0)
            matrix = np.vstack([np.column_stack([matrix, period * rates[1]]), corner])
            right = np.append(right, 0.0)
        # rows in units of their largest entries
        rows = np.abs(matrix).max(axis=1)
        step = np.linalg.lstsq(matrix / rows[:, None], right / rows, rcond=None)[0]
        correction = float(np.abs(step).max())
        if correction <= STALLED_NEWTON_STEP and (
            correction >= 0.25 * before or correction <= 1e-15
        ):
            return _orbit(problem, whole, along, float(np.abs(gap).max()), correction)
        if not correction < 1.0:
            return None
        state, before = state + step[:n] * size, correction
        period *= 1.0 if forced else 1.0 + float(step[n])
    return None


def derivatives_along(problem: OrbitProblem, run: Trajectory, pieces: int = 1) -> Along:
    """Derivatives along a run of one smooth motion.

    Parameters
    ----------
    problem : OrbitProblem
    run : Trajectory
    pieces : int
        Parts of equal length into which every step is divided.
    """
    nodes, matrix = _radau()
    assert run.series is not None
    n, mode = problem.variations.n, int(run.steps[-1, 2])
    starts = run.steps[:, 0]
    lengths = np.diff(starts, append=run.span[1])
    shares = (np.arange(pieces)[:, None] + nodes).reshape(-1) / pieces
    offsets = lengths[:, None] * shares
    powers = offsets[:, :, None] ** np.arange(run.series.shape[2])
    states = powers @ run.series[:, :n].transpose(0, 2, 1)
    times = (starts[:, None] + offsets).reshape(-1)
    modes = np.full(len(times), mode)
    points = states.reshape(-1, n)
    known = fields(problem.variations, modes, points, times, problem.parameters)
    slopes = known.f_u[:, :, :n].reshape(len(starts) * pieces, COLLOCATION_POINTS, n, n)
    h = np.repeat(lengths / pieces, pieces)
    blocks = matrix[None, :, :, None, None] * slopes[:, None] * h[:, None, None, None, None]
    whole = np.eye(COLLOCATION_POINTS * n) - blocks.transpose(0, 1, 3, 2, 4).reshape(
        -1, COLLOCATION_POINTS * n, COLLOCATION_POINTS * n
    )
    right = np.tile(np.eye(n), (COLLOCATION_POINTS, 1))
    factors = np.linalg.solve(whole, np.broadcast_to(right, (len(whole), *right.shape)))
    traces = np.trace(slopes, axis1=2, axis2=3) @ matrix[-1]
    first = _rates(problem, mode, run(np.array([run.span[0]])).T, np.array([run.span[0]]))
    rates = known.f.reshape(len(h), COLLOCATION_POINTS, n)[:, -1]
    last = np.asarray(factors[:, -n:], dtype=float)
    return Along(last, float(traces @ h), np.vstack([first, rates]))


def _orbit(
    problem: OrbitProblem, run: Trajectory, along: Along, residual: float, accuracy: float
) -> Orbit | None:
    """The solved orbit with its multipliers, of which the smallest follows from the trace."""
    forced = problem.forcing is not None
    if accuracy > ORBIT_SOLVED:
        return None
    found = []
    for one in (along, derivatives_along(problem, run, 2)):
        values, logs, trivial = multipliers_of(one.factors, 0, None if forced else one.rates)
        if trivial is not None and not abs(values[trivial] - 1.0) <= TRIVIAL_MULTIPLIER_ERROR:
            return None
        others = logs[:-1]
        last = values[-1]
        if trivial != len(logs) - 1 and last.imag == 0.0:
            logs = np.append(others, one.trace - others.sum())
            sign = np.prod(np.sign(values[:-1])).real
            values = np.append(values[:-1], sign * np.exp(logs[-1]))
        found.append((values, logs, trivial))
    (_, rough, _), (values, logs, trivial) = found
    period = float(run.span[1] - run.span[0])
    defect = float(np.abs((logs - rough) / np.maximum(1.0, np.abs(logs))).max())
    outcome = Outcome("periodic", f"periodic with T = {period:.9g}.", True)
    multiple = problem.multiple if forced else None
    return Orbit(
        trajectory=run,
        period=period,
        multiple=multiple,
        multipliers=values,
        log_multipliers=logs,
        trivial=trivial,
        defect=defect,
        residual=residual,
        accuracy=accuracy,
        outcome=outcome,
    )


def _rates(problem: OrbitProblem, mode: int, states: Array, times: Array) -> Array:
    modes = np.full(len(states), mode)
    return fields(problem.variations, modes, states, times, problem.parameters).f


@cache
def _radau() -> tuple[Array, Array]:
    """Radau nodes in (0, 1], and the integrals of their Lagrange polynomials up to each node."""
    series = np.zeros(COLLOCATION_POINTS + 1)
    series[-2:] = -1.0, 1.0
    nodes = np.sort(legendre.legroots(series).real)
    # the polynomial is singular in its root 1 alone
    nodes[-1] = 1.0
    values = legendre.legvander(nodes, COLLOCATION_POINTS - 1)
    integrals = np.column_stack(
        [
            legendre.legval(nodes, legendre.legint(row, lbnd=-1))
            for row in np.eye(COLLOCATION_POINTS)
        ]
    )
    return 0.5 * (nodes + 1.0), 0.5 * integrals @ np.linalg.inv(values)
