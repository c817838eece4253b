"""The points at which the cycles of a branch shrink to an equilibrium.

Smooth cycles shrink at a Hopf point, whose eigenvalues ±iω have the period 2π/ω of the last cycle.
Cycles that cross an interface shrink to an equilibrium on it, in proportion to the distance of the
parameter (di Bernardo and others 2008, section 5.1), or to a point without one, as at a fused focus
(Kuznetsov, Rinaldi & Gragnani 2003). What is not located is a candidate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import newton
from fastslow.orbits.endings import BOUNDARY_EQUILIBRIUM, CYCLES_SHRINK, HOPF_POINT
from fastslow.orbits.ends.slowest_points import Slowest, equilibrium_near, fields_at, with_value
from fastslow.orbits.find.orbit_curve import OrbitCurve, Row
from fastslow.orbits.flow.flows import flow
from fastslow.orbits.flow.shooting import Shooting, sizes_of
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]

#: Range of a cycle, in units of the largest one of its branch, at which it is a point.
POINT = 1e-4

#: Range of a cycle, in units of those before and after it, at which a Hopf point may be passed.
PASSED = 0.5

#: Change of the durations of similar cycles, in units of the period, and of their shape.
SIMILAR_CYCLES = 0.1

#: Difference of the period of a cycle from 2π/ω, and growth per period, beside a Hopf point.
HOPF_PERIOD_ERROR = 0.1

#: Steps of the secant method for a Hopf point, its first one as a fraction of the range of the
#: parameter, and the last one.
SECANT_STEPS, FIRST_SECANT, LAST_SECANT = 30, 1e-6, 1e-13

#: Distance of an equilibrium on an interface from that expected, in units of the distance of the
#: last cycle.
EXPECTED_DISTANCES = 2.0


def is_point(rows: Sequence[Row], row: Row) -> bool:
    """Check whether the cycle after given rows is a point, or grows again mirrored beyond it."""
    last = rows[-1]
    if row.range < last.range and row.range <= POINT * max(one.range for one in rows):
        return True
    return row.mirrors(last)


def is_passed(rows: Sequence[Row], row: Row) -> bool:
    """Check whether the last cycle is beside a Hopf point, at which the phase turns.

    It turns in one step, which `is_point` sees, or in two.
    """
    if len(rows) < 2:
        return False
    *_, earlier, last = rows
    return last.range < PASSED * min(earlier.range, row.range) and row.mirrors(earlier)


def is_mirrored(shooting: Shooting, before: Array, after: Array) -> bool:
    """Check whether cycles shrink to a point, beyond which they are similar and mirrored.

    Near an equilibrium on an interface the motion is linear in each region, so that durations do
    not depend on the size.
    """
    (one, period), (two, _) = shooting.unpack(before), shooting.unpack(after)
    if (np.abs(one.durations - two.durations) > SIMILAR_CYCLES * period).any():
        return False
    if (two.durations <= 0).any():
        return False
    shapes = []
    for segments, u in ((one, before), (two, after)):
        known = segments.modes, segments.states, segments.times[:-1], 0.5 * segments.durations
        parameters = shooting.parameters_at(u), segments.constants
        middles = flow(shooting.variations, *known, *parameters).ends
        states = np.vstack([segments.states, middles])
        shapes.append(states - states.mean(axis=0))
    size = sizes_of(shapes[0], shapes[0])
    here, there = (shape / size for shape in shapes)
    aligned = np.linalg.norm(here) * np.linalg.norm(there)
    return bool(np.vdot(here, there) < -(1.0 - SIMILAR_CYCLES) * aligned)


def vanished(curve: OrbitCurve, rows: Sequence[Row]) -> Outcome:
    """Return the outcome of a branch whose cycles shrink to a point after the last row."""
    last, name = rows[-1], curve.name
    met = list(dict.fromkeys(c.interface for c in last.orbit.trajectory.crossings))
    middle, size = 0.5 * last.extremes.sum(axis=0), last.sizes
    if not met:
        value = _hopf_value(curve, last, middle, size)
        if value is not None:
            where = f"{name} = {value:.10g}"
            return HOPF_POINT.at(how=f"shrink to an equilibrium, a Hopf point, at {where}")
        where = f"near {name} = {last.value:.6g}"
        return CYCLES_SHRINK.at(
            where=f"{where}: a candidate for a Hopf point, which was not located"
        )
    value = last.value
    if len(rows) > 1:
        before = rows[-2]
        larger, smaller = before.range, last.range
        if smaller < larger:
            value += (value - before.value) * smaller / (larger - smaller)
    found = _boundary_value(curve, last, middle, size, value)
    if found is not None:
        return BOUNDARY_EQUILIBRIUM.at(interfaces=" and ".join(met), where=f"{name} = {found:.10g}")
    where = f"on {' and '.join(met)} near {name} = {value:.6g}"
    return CYCLES_SHRINK.at(where=f"{where}, where no equilibrium was located")


def _hopf_value(curve: OrbitCurve, row: Row, middle: Array, size: Array) -> float | None:
    """Parameter of the Hopf point beside a small cycle in one mode, by the secant method."""
    point = Slowest(0.0, middle, int(row.shooting.form.modes[0]), size)
    period, step = row.arrays.period, FIRST_SECANT * (curve.over[1] - curve.over[0])

    def growth(value: float) -> float | None:
        """Real part of the pair nearest to the period of the cycle."""
        rest = equilibrium_near(curve.problem, point, with_value(row.shooting, value))
        if rest is None:
            return None
        mismatch = np.abs(rest.eigenvalues.imag * period / (2.0 * np.pi) - 1.0)
        nearest = int(np.argmin(mismatch))
        return (
            float(rest.eigenvalues.real[nearest])
            if mismatch[nearest] <= HOPF_PERIOD_ERROR
            else None
        )

    before, value = row.value, row.value + step
    left, right = growth(before), growth(value)
    if left is None or abs(left) * period > HOPF_PERIOD_ERROR:
        return None
    for _ in range(SECANT_STEPS):
        if right is None:
            return None
        if right == 0.0 or abs(value - before) <= LAST_SECANT * max(abs(value), step):
            return value
        if left == right:
            break
        following = value - right * (value - before) / (right - left)
        before, left, value = value, right, following
        right = growth(value)
    return value if abs(value - before) <= 1e-9 * max(abs(value), step) else None


def _boundary_value(
    curve: OrbitCurve, row: Row, middle: Array, size: Array, value: float
) -> float | None:
    """Parameter at which a region of a small cycle has an equilibrium on its interface."""
    problem = curve.problem
    variations = problem.variations
    away = max(abs(value - row.value), FIRST_SECANT * (curve.over[1] - curve.over[0]))
    form = row.shooting.form
    for mode in dict.fromkeys(form.modes.tolist()):
        if (variations.signs[mode] == 0).any():
            continue
        for function in dict.fromkeys(form.ends[form.ends >= 0].tolist()):
            if function >= variations.interfaces:
                continue

            def equations(z: Array, mode: int = mode, function: int = function) -> Array:
                values = with_value(row.shooting, float(z[-1]))
                known = fields_at(problem, mode, z[:-1], values)
                return np.append(known.f[0], known.g[0, function])

            guess, scale = np.append(middle, value), np.append(size, away)
            z, _, converged, _ = newton(equations, guess, scale)
            if converged and (np.abs(z - guess) <= EXPECTED_DISTANCES * scale).all():
                return float(z[-1])
    return None
