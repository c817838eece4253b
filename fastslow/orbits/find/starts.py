"""Orbits that emanate from a special point: period doubling, branch point or Hopf point.

At a doubling the equations F(u) = 0 of multiple shooting over twice the period have a null vector
v that leaves the parameter unchanged. The orbit of the other branch solves F(u) = 0 and
v·(u - u*) = d at a small distance d, with the parameter unknown. The known branch meets this plane
at u* alone, to first order (Kuznetsov 2004, section 10.2). At a branch point v is the tangent of
the other branch, from the algebraic branching equation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.equations import CLOSING
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.flows import fields
from fastslow.orbits.flow.problem import OrbitProblem, growth_of
from fastslow.orbits.flow.segments import Segments, divided, segments_of, winding_of
from fastslow.orbits.flow.shooting import Shooting, ShootingSolution, sizes_of
from fastslow.orbits.points.kinds import SWITCHES
from fastslow.orbits.points.location import (
    branch_tangents,
    locate_branch_point,
    row_units,
    solve_extended,
)
from fastslow.results.angles import apart, periods_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Distances from the point in order of trial, in units of the ranges of the orbit.
DISTANCES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)

#: Amplitude of a cycle at a Hopf point: growth per radian of the cubic term of the normal form.
GROWTH_PER_RADIAN = 1e-4

#: Largest such amplitude in units of the state, where the cubic term is small.
LARGEST_AMPLITUDE = 0.1

#: Fractions of this amplitude in order of trial.
SHARES = (1.0, 0.3, 0.1, 0.03)

#: A parameter below this value has the unit 1.
ZERO_PARAMETER = 1e-9

#: Fraction of the distance by which the orbit differs from the known one.
DIFFERENT = 0.1


def orbit_from(problem: OrbitProblem, point: SpecialOrbit) -> Orbit:
    """Return the orbit of the other branch near a period doubling or a branch point.

    Parameters
    ----------
    problem : OrbitProblem
        At the point, with its parameter chosen; of twice the period for a doubling.
    point : SpecialOrbit

    Raises
    ------
    OrbitError
        If no orbit of another branch was found.
    """
    if SWITCHES[point.code].switches > 1:
        return _doubled(problem, point)
    return _branched(problem, point)


def _doubled(problem: OrbitProblem, point: SpecialOrbit) -> Orbit:
    """The orbit of twice the period beside a period doubling."""
    shooting, u = known_equations(problem, point.orbit, doubles=True)
    scale = _units(shooting, u, _ranges(problem, point))
    v = _null_vector(shooting, u, scale)
    n = problem.variations.n
    # how far the orbit is from its start after half its period, to first order
    jump = 2.0 * np.abs(v[:n]).max() * scale[:n]
    reason = "Newton's method does not converge"
    for distance in DISTANCES:
        found = _beside(problem, shooting, u, v, scale, distance)
        if found is None:
            continue
        orbit = found[1]
        if not orbit.outcome:
            reason = orbit.outcome.message
        elif _repeats(problem, orbit, DIFFERENT * distance * jump):
            reason = "the orbit repeats after half its period"
        else:
            return orbit
    raise _not_switched(point, reason)


def _branched(problem: OrbitProblem, point: SpecialOrbit) -> Orbit:
    """The orbit of the other branch beside a branch point, on either side of it."""
    source = point.source
    if source is None:
        shooting, u = known_equations(problem, point.orbit, doubles=False)
        scale = _units(shooting, u, _ranges(problem, point))
    else:
        shooting, u, scale = source.shooting, source.u, source.scale
    u = locate_branch_point(shooting, u, scale).u
    tangents = branch_tangents(shooting, u, scale)
    if tangents is None:
        raise _not_switched(point, "the branching equation has no two real solutions")
    if source is None or source.tangent is None:
        # a branch of lower symmetry turns
        known = int(np.argmax(np.abs(tangents[:, -1])))
    else:
        known = int(np.argmax(np.abs(tangents @ source.tangent)))
    other, along = tangents[1 - known], tangents[known]
    v = other / np.abs(other).max() * (1.0 if other[-1] >= 0 else -1.0)
    reason = "Newton's method does not converge"
    for distance in DISTANCES:
        for side in (v, -v):
            found = _beside(problem, shooting, u, side, scale, distance)
            if found is None:
                continue
            moved = (found[0] - u) / scale
            if not found[1].outcome:
                reason = found[1].outcome.message
            elif abs(moved @ along) >= abs(moved @ other):
                reason = "Newton's method returns to the known branch"
            else:
                return found[1]
    if source is None:
        reason += (
            "; the point was read from a file, which has no tangent of its branch: trace the "
            "branch again and use its point"
        )
    raise _not_switched(point, reason)


def _ranges(problem: OrbitProblem, point: SpecialOrbit) -> Array:
    """Ranges of the states along the orbit of a point."""
    run = point.orbit.trajectory.sampled_columns[: problem.variations.n].T
    return sizes_of(run, run)


def cycle_from(problem: OrbitProblem, point: SpecialPoint) -> Orbit:
    """Return the cycle near a Hopf point.

    The start is z* + a Re(q e^{iωt}) with the eigenvector q of iω; the amplitude is fixed, the
    parameter unknown.

    Parameters
    ----------
    problem : OrbitProblem
        At the point, with its parameter chosen.
    point : SpecialPoint

    Raises
    ------
    OrbitError
        If no cycle was found.
    """
    assert point.frequency is not None
    mode = problem.variations.modes.index(point.regions[0])
    state, q = np.asarray(point.state, dtype=float), _rotating(problem, mode, point)
    period = 2.0 * np.pi / point.frequency
    here = np.array([mode]), np.array([CLOSING]), state[None, :].copy(), np.array([period])
    at_rest = Segments(0.0, *here)
    n = problem.variations.n
    # an orthogonal pair in units of the amplitudes of the states
    units = np.maximum(np.abs(q), 1e-3 * np.abs(q).max())
    direction = q.imag / units**2 / np.linalg.norm(q.imag / units)
    shooting = Shooting(
        problem.variations, problem.parameters, at_rest, None, 1, np.zeros(n), direction
    )
    growth = growth_of(shooting.linearised(shooting.pack(at_rest, period)), at_rest)
    divisions = divided(at_rest, growth, lambda modes, states, *_: states)
    shooting = replace(shooting, form=divisions)
    u = shooting.pack(divisions, period)
    scale = _units(shooting, u, units)
    v = np.zeros(len(u))
    turned = np.exp(1j * point.frequency * divisions.times[:-1])
    v[: len(divisions) * n] = ((turned[:, None] * q).real / units).reshape(-1)
    reason = "Newton's method does not converge"
    for distance in SHARES:
        found = _beside(problem, shooting, u, v, scale, distance)
        if found is None:
            continue
        if found[1].outcome:
            return found[1]
        reason = found[1].outcome.message
    raise _not_switched(point, reason)


def _rotating(problem: OrbitProblem, mode: int, point: SpecialPoint) -> Complex:
    """Eigenvector of iω in the amplitude of the start, with orthogonal parts."""
    n = problem.variations.n
    rest = np.array([mode]), np.asarray(point.state, dtype=float)[None, :], np.zeros(1)
    jacobian = fields(problem.variations, *rest, problem.parameters).f_u[0, :, :n]
    values, vectors = np.linalg.eig(jacobian)
    assert point.frequency is not None
    q = vectors[:, np.argmin(np.abs(values - 1j * point.frequency))]
    units = np.maximum(np.abs(q), 1e-3 * np.abs(q).max())
    square = ((q / units) ** 2).sum()
    q = q * np.exp(-0.5j * np.angle(square))
    # growth |l₁| |w|² per radian of the cycle with z = z* + 2 Re(w q e^{iωt}); Kuznetsov (5.34)
    coefficient = abs(point.lyapunov or 0.0)
    amplitude = np.sqrt(GROWTH_PER_RADIAN / coefficient) if coefficient else 1.0
    size = np.abs(point.state).max() or 1.0
    return np.asarray(2.0 * min(amplitude, LARGEST_AMPLITUDE * size) * q)


def known_equations(problem: OrbitProblem, orbit: Orbit, doubles: bool) -> tuple[Shooting, Array]:
    """Equations and unknowns of the orbit of the point, for a doubling traversed twice."""
    run, period = orbit.trajectory, orbit.period
    winding = winding_of(run, orbit.t0, period)
    parts = problem.variations, problem.parameters
    segments = segments_of(run, orbit.t0, period, winding, *parts)
    single = problem
    if doubles:
        single = replace(problem, multiple=problem.multiple // 2)
    shooting, solution = single.solve(segments, period, winding, run)
    ranges = shooting.ranges
    segments, period = shooting.unpack(solution.u)
    if doubles:
        segments = twice(segments.without_nodes(), winding).with_constants(*parts)
        period, winding = 2 * period, 2 * winding
    while True:
        shooting = problem.shooting(segments, winding, ranges)
        u = shooting.pack(segments, period)
        growth = growth_of(shooting.linearised(u), segments, ranges)
        finer = divided(segments, growth, problem.states_at)
        if finer is segments:
            return shooting, u
        segments = finer


def twice(segments: Segments, winding: Array) -> Segments:
    """A closed curve without nodes, traversed twice."""
    last = len(segments) - 1
    # the last segment continues in the first one of the second time
    again = np.r_[last, np.arange(1, last + 1)] if last else np.array([], dtype=np.int64)
    first = np.arange(last) if last else np.array([0])
    order = np.r_[first, again].astype(np.int64)
    durations = segments.durations[order].copy()
    ends = segments.ends[order].copy()
    durations[last] += segments.durations[0]
    ends[last] = segments.ends[0]
    ends[-1] = CLOSING
    states = segments.states[order].copy()
    states[last + 1 :] += winding
    jumps = segments.jumps[order].copy()
    jumps[last] = segments.jumps[0]
    jumps[-1] = -1
    modes, constants = segments.modes[order], segments.constants[order]
    return Segments(segments.start, modes, ends, states, durations, jumps, constants)


def _units(shooting: Shooting, u: Array, size: Array) -> Array:
    """Units of the unknowns: ranges of the states, the period, and the size of the parameter."""
    K, period = len(shooting.form), shooting.unpack(u)[1]
    value = abs(u[-1])
    return np.r_[np.tile(size, K), np.full(K + 1, period), value if value > ZERO_PARAMETER else 1.0]


def _null_vector(shooting: Shooting, u: Array, scale: Array) -> Array:
    """The null vector at the known parameter in units of the scales, of length 1 in a state."""
    N, states = shooting.size, len(shooting.form) * shooting.variations.n
    last = shooting.linearised(u)
    matrix = last.jacobian[:, :N] * scale[:N] / row_units(shooting, last, scale)[:, None]
    v = np.linalg.svd(matrix)[2][-1]
    v = v / v[np.argmax(np.abs(v[:states]))]
    return np.append(v, 0.0)


def _beside(
    problem: OrbitProblem, shooting: Shooting, u: Array, v: Array, scale: Array, distance: float
) -> tuple[Array, Orbit] | None:
    """Solve for the orbit at a distance along a vector, with the parameter unknown."""

    def system(z: Array) -> tuple[Array, Array, NDArray[np.complex128]]:
        last = shooting.linearised(z)
        rows = row_units(shooting, last, scale)
        aside = v @ ((z - u) / scale - distance * v)
        matrix = np.vstack([last.jacobian * scale / rows[:, None], v])
        return np.append(last.residual / rows, aside), matrix, np.zeros(0, dtype=complex)

    z, _, residual, accuracy, converged = solve_extended(system, u + distance * v * scale, scale)
    z = shooting.on_interfaces(z)
    segments, period = shooting.unpack(z)
    if not converged or (segments.durations <= 0).any():
        return None
    here = problem.at(shooting.parameters_at(z))
    solution = ShootingSolution(z, shooting.linearised(z), residual, accuracy)
    return z, here.orbit(segments, period, solution)


def _repeats(problem: OrbitProblem, orbit: Orbit, least: Array) -> bool:
    """Check whether an orbit is at its start again after half its period."""
    begin = orbit.t0
    gained = orbit.trajectory(begin + 0.5 * orbit.period) - orbit.trajectory(begin)
    lengths = periods_of(orbit.states, orbit.trajectory.periods)
    return bool((np.abs(apart(gained, np.zeros(problem.variations.n), lengths)) <= least).all())


def _not_switched(point: SpecialOrbit | SpecialPoint, reason: str) -> OrbitError:
    return OrbitError(
        Outcome(
            "no other branch",
            f"no orbit of another branch was found near {point.label}: {reason.rstrip('.')}.",
            False,
        )
    )
