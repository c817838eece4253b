"""Radau IIA steps, for problems so stiff that their Taylor coefficients are rounding.

The polynomial of degree s through the state at the beginning of a step whose
derivative equals the rates at the s Radau points (Hairer and Wanner 1996,
section IV.5) is of order 2 s - 1 at the end of the step and of order s within it,
and L-stable. In a Taylor coefficient of order k, rounding of the states is amplified
by p**k, where p is the fastest rate; in the stage increments it is amplified only once,
and the stage equations divide it by p again. The linear systems are decoupled by the
eigenvectors of the method (section IV.8).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.compiler.records import (
    ComplexMatrix,
    ComplexTensor,
    ComplexVector,
    Matrix,
    Vector,
    zeros,
)
from fastslow.kernels.taylor.modes import DIRECTIONAL, RATES
from fastslow.simulation.stepper.matrices import (
    EigenvalueSpace,
    eigenvalues_of,
    factorise_in_place,
    solve_in_place,
    spectrum_for,
)
from fastslow.simulation.stepper.polynomials import EPSILON
from fastslow.simulation.stepper.problems import Problem, Run
from fastslow.simulation.stepper.scales import NOW, REACHED, ratio_of

#: Number of stages, and order at the end of a step.
STAGES = 5
RADAU_ORDER = 2 * STAGES - 1

#: A mode is resolved for |lambda| h up to this, and damped if it decays by more.
RESOLVED_MODE = 0.5

#: Exponent of decay after which a mode is below rounding.
ERASED = 36.0

#: Rounding of a rate, in units of the last place of the sum of the moduli of its terms.
NOISE = 8.0

#: Maximum Newton iterations, and the fraction of the allowed error they may leave.
STAGE_ITERATIONS, STAGE_REMAINDER = 12, 1e-3


def _nodes() -> NDArray[np.float64]:
    """Radau IIA points c: roots of P_s - P_(s-1), mapped to [0, 1]."""
    rule = np.zeros(STAGES + 1)
    rule[STAGES], rule[STAGES - 1] = 1.0, -1.0
    roots = np.sort(legendre.legroots(rule).real)
    for _ in range(3):
        inner = roots[:-1]
        inner -= legendre.legval(inner, rule) / legendre.legval(inner, legendre.legder(rule))
    roots[-1] = 1.0
    return 0.5 * (1.0 + roots)


def _powers() -> NDArray[np.float64]:
    """Matrix from increments at the points to the coefficients of s, ..., s**STAGES."""
    return np.asarray(np.linalg.inv(C[:, None] ** np.arange(1, STAGES + 1)), dtype=np.float64)


def _modes() -> tuple[NDArray[np.complex128], ...]:
    """Eigenvalues of the inverse method, the real one first, with right and left vectors.

    One of each conjugate pair is kept, with its right vectors doubled.
    """
    powers = np.arange(1, STAGES + 1)
    # derivatives at the points from increments there: the inverse of the Runge-Kutta matrix
    inverse = (powers * C[:, None] ** (powers - 1)) @ POWERS
    values, right = np.linalg.eig(inverse)
    left = np.linalg.inv(right)
    real = np.flatnonzero(np.abs(values.imag) < 1e-8)
    kept = np.concatenate([real, np.flatnonzero(values.imag > 1e-8)])
    factor = np.where(np.arange(len(kept)) > 0, 2.0, 1.0)
    return values[kept], right[:, kept] * factor, left[kept]


def _interpolation() -> tuple[float, float]:
    """Place of the largest interpolation error, and its size.

    The size is the error within a step in units of the filtered defect at its beginning,
    for rates that do not depend on the state.
    """
    nodal = Polynomial.fromroots(C)
    s = np.linspace(0.0, 1.0, 4001)
    within = np.abs(nodal.integ()(s)).max()
    between = float(s[np.abs(s * nodal(s)).argmax()])
    return between, float(within / (abs(nodal(0.0)) / VALUES[0].real))


C = _nodes()
POWERS = _powers()
VALUES, OUT_OF, INTO = _modes()
BETWEEN, WITHIN = _interpolation()


class Radau(NamedTuple):
    """State carried through a phase of Radau steps, and work space.

    Parameters
    ----------
    phase : float64 array, shape (1 + 4 n_states,)
        Length of the last step, 0 at the beginning of a phase, and eigenvalues at both ends.
    jacobian : float64 array, shape (n_states, n_states)
    start, least, allowed : float64 arrays, shape (n_states,)
    increments, rates : float64 arrays, shape (STAGES, n_states)
    held : float64 array, shape (n_states + n_forcing + n_interfaces, STAGES + 1)
    point : float64 array, shape (1 + n_states + n_forcing,)
    out : float64 array
        Same size as the series.
    given : complex array, shape (n_states,)
    moved : complex array, shape (pairs, n_states)
    factors : complex array, shape (pairs, n_states, n_states + 1)
    spectrum : EigenvalueSpace
    """

    phase: Vector
    jacobian: Matrix
    start: Vector
    least: Vector
    allowed: Vector
    increments: Matrix
    rates: Matrix
    held: Matrix
    point: Vector
    out: Vector
    given: ComplexVector
    moved: ComplexMatrix
    factors: ComplexTensor
    spectrum: EigenvalueSpace


def radau_for(n_states: int, n_forcing: int, n_interfaces: int, size: int) -> Radau:
    """Allocate the work space for a model of these sizes, whose series has ``size`` entries."""
    n, pairs = n_states, len(VALUES)
    return zeros(
        Radau,
        phase=1 + 4 * n,
        jacobian=(n, n),
        start=n,
        least=n,
        allowed=n,
        increments=(STAGES, n),
        rates=(STAGES, n),
        held=(n + n_forcing + n_interfaces, STAGES + 1),
        point=1 + n + n_forcing,
        out=size,
        given=n,
        moved=(pairs, n),
        factors=(pairs, n, n + 1),
        spectrum=spectrum_for(n),
    )


class RadauStep(NamedTuple):
    """Arguments of `radau_step`.

    Parameters
    ----------
    problem : Problem
    run : Run
    mode : int
    rate : float
        Modes that decay faster are damped whatever the step length.
    h : float
    right : float64 array
        The polynomials of the last step of the phase.
    poly : float64 array
        Filled with those of this one.
    scales : float64 array
    space : Radau
        The eigenvalues at the end are filled in; see `accept`.
    """

    problem: Problem
    run: Run
    mode: int
    rate: float
    h: float
    right: Vector
    poly: Vector
    scales: Matrix
    space: Radau


@kernel
def radau_step(step):
    """Take one Radau step, fill ``poly``, and return the error in units of ``tol``.

    Returns
    -------
    float
        Infinite if the stage equations are not solved.
    """
    problem, run, mode, rate, h, right, poly, scales, space = step
    series, parameters, inputs = problem.series, run.parameters, run.inputs
    n, n_forcing, n_fast, tol = problem.n_states, problem.n_forcing, problem.n_fast, problem.tol
    columns = problem.order + 1
    number = problem.n_modes + problem.n_interfaces
    rows = n + n_forcing + problem.n_interfaces
    jacobian, start, Z, F = space.jacobian, space.start, space.increments, space.rates
    point, out, held, carried = space.point, space.out, space.held, space.phase
    least, allowed_in = space.least, space.allowed
    factors, given, moved = space.factors, space.given, space.moved
    first_increments(right, columns, carried[0], h, Z)
    for i in range(inputs.shape[0]):
        point[i] = inputs[i]
    jacobian_at(problem, run, mode, space)
    call_address(series, RATES * number + mode, point, parameters, out)
    for i in range(rows):
        held[i, 0] = out[i * columns]
    for i in range(n):
        start[i] = out[i * columns + 1]
    if not factorise_stages(jacobian, h, factors):
        return np.inf
    # the accuracy of a state is limited by rounding in the terms of the rates
    for i in range(n):
        noise = 0.0
        for k in range(n):
            noise += abs(jacobian[i, k] * inputs[1 + k])
        given[i] = NOISE * EPSILON * noise
    solve_in_place(factors[0], given, moved[0], n)
    for i in range(n):
        least[i] = abs(moved[0, i]) + NOISE * EPSILON * abs(inputs[1 + i])
        allowed_in[i] = max(tol * scales[NOW, i], least[i])
    before, done = np.inf, False
    for turn in range(STAGE_ITERATIONS):
        for j in range(STAGES):
            point[0] = inputs[0] + C[j] * h
            for i in range(n):
                point[1 + i] = inputs[1 + i] + Z[j, i]
            call_address(series, RATES * number + mode, point, parameters, out)
            for i in range(n):
                F[j, i] = out[i * columns + 1]
            for i in range(rows):
                held[i, 1 + j] = out[i * columns]
        if done:
            break
        if not newton_iteration(F, h, factors, given, moved, Z):
            return np.inf
        size = 0.0
        for i in range(n):
            for j in range(STAGES):
                size = max(size, ratio_of(F[j, i], allowed_in[i]))
        # at rounding no further progress is possible
        done = size <= STAGE_REMAINDER
        if not done:
            if (turn > 0 and not size <= 0.7 * before) or not size < np.inf:
                return np.inf
            ratio, before = size / before if turn > 0 else 0.5, size
            done = size * ratio <= STAGE_REMAINDER * (1.0 - ratio)
    if not done:
        return np.inf
    fill_polynomials(inputs, held, Z, h, columns, poly)
    # defects of the rates where they are largest, filtered by the method (Hairer and Wanner
    # 1996, eq. IV.8.19); for stiff rates the interpolation error remains
    error = 0.0
    for place in (0.0, BETWEEN):
        if place > 0.0:
            point[0] = inputs[0] + place * h
            for i in range(n):
                point[1 + i] = value_at(poly, i * columns, place * h)
            call_address(series, RATES * number + mode, point, parameters, out)
            for i in range(n):
                start[i] = out[i * columns + 1]
            for i in range(n, rows):
                row = i * columns
                allowed = tol * scales[NOW, i]
                defect = value_at(poly, row, place * h) - out[row]
                if not abs(defect) < np.inf:
                    return np.inf
                error = max(error, ratio_of(defect, allowed))
        for i in range(n):
            given[i] = start[i] - slope_at(poly, i * columns, place * h)
        solve_in_place(factors[0], given, moved[0], n)
        for i in range(n):
            after = abs(inputs[1 + i] + Z[STAGES - 1, i])
            allowed = tol * max(scales[REACHED, i], min(abs(inputs[1 + i]), after))
            share = moved[0, i].real * (1.0 if place > 0.0 else WITHIN)
            if not abs(share) < np.inf:
                return np.inf
            error = max(error, ratio_of(share, max(allowed, least[i])))
    if not error <= 1.0:
        return error if error < np.inf else np.inf
    point[0] = inputs[0] + h
    for i in range(n):
        point[1 + i] = inputs[1 + i] + Z[STAGES - 1, i]
    now, then = carried[1 : 1 + 2 * n], carried[1 + 2 * n :]
    if n_fast > 0:
        if not carried[0] > 0.0:
            sorted_eigenvalues(jacobian, n_fast, now, space.spectrum)
        jacobian_at(problem, run, mode, space)
        sorted_eigenvalues(jacobian, n_fast, then, space.spectrum)
        unresolved = unresolved_modulus(now, then, n_fast, rate, h) * h
        if not unresolved <= RESOLVED_MODE:
            # as an error of this order, so that the next attempt is short enough
            return (unresolved / RESOLVED_MODE) ** (STAGES + 1) if unresolved < np.inf else np.inf
    return error


@kernel
def first_increments(right, columns, last, h, Z):
    """Extrapolate the last polynomial to the stages; zeros at the beginning of a phase."""
    for j in range(STAGES):
        for i in range(Z.shape[1]):
            Z[j, i] = 0.0
            if last > 0.0:
                row = i * columns
                s = last + C[j] * h
                there = here = 0.0
                for k in range(STAGES, 0, -1):
                    there = (there + right[row + k]) * s
                    here = (here + right[row + k]) * last
                Z[j, i] = there - here


@kernel
def fill_polynomials(inputs, held, Z, h, columns, poly):
    """Fill in the polynomials of a step, in powers of time, from the increments at its stages."""
    n = Z.shape[1]
    for i in range(held.shape[0]):
        row = i * columns
        for k in range(columns):
            poly[row + k] = 0.0
        poly[row] = held[i, 0] if i >= n else inputs[1 + i]
        power = 1.0
        for k in range(STAGES):
            power *= h
            value = 0.0
            for j in range(STAGES):
                increment = Z[j, i] if i < n else held[i, 1 + j] - held[i, 0]
                value += POWERS[k, j] * increment
            poly[row + k + 1] = value / power


@kernel
def factorise_stages(jacobian, h, factors):
    """Factorise the linear systems of a step of length h; False if one is singular."""
    n = jacobian.shape[0]
    for m in range(VALUES.shape[0]):
        for i in range(n):
            for k in range(n):
                factors[m, i, k] = -jacobian[i, k]
            factors[m, i, i] += VALUES[m] / h
        if not factorise_in_place(factors[m], n):
            return False
    return True


@kernel
def newton_iteration(F, h, factors, given, moved, Z):
    """Correct the increments at the stages once (Hairer and Wanner 1996, section IV.8).

    Parameters
    ----------
    F : float64 array, shape (STAGES, n)
        Rates at the stages, overwritten by the changes of the increments.
    h : float
    factors : complex array
        From `factorise_stages`.
    given, moved : complex arrays
        Work space.
    Z : float64 array, shape (STAGES, n)
        Increments, corrected in place.

    Returns
    -------
    bool
        False if a change is not finite, as the rates may not be defined there.
    """
    n, half = Z.shape[1], VALUES.shape[0]
    for m in range(half):
        for i in range(n):
            value = 0.0j
            for j in range(STAGES):
                value += INTO[m, j] * (F[j, i] - VALUES[m] / h * Z[j, i])
            given[i] = value
        solve_in_place(factors[m], given, moved[m], n)
    for i in range(n):
        for j in range(STAGES):
            change = 0.0
            for m in range(half):
                change += (OUT_OF[j, m] * moved[m, i]).real
            if not abs(change) < np.inf:
                return False
            Z[j, i] += change
            F[j, i] = change
    return True


@kernel
def accept(problem, run, mode, h, poly, right, space):
    """Accept a step: values and rates at its end are written to ``right``."""
    n, point = problem.n_states, space.point
    for i in range(run.inputs.shape[0]):
        point[i] = run.inputs[i]
    point[0] += h
    for i in range(n):
        point[1 + i] = value_at(poly, i * (problem.order + 1), h)
    rates = RATES * (problem.n_modes + problem.n_interfaces) + mode
    call_address(problem.series, rates, point, run.parameters, right)
    space.phase[0] = h
    for i in range(2 * n):
        space.phase[1 + i] = space.phase[1 + 2 * n + i]


@kernel
def value_at(poly, row, s):
    """Evaluate the polynomial of one row."""
    value = 0.0
    for k in range(STAGES, -1, -1):
        value = value * s + poly[row + k]
    return value


@kernel
def slope_at(poly, row, s):
    """Evaluate the derivative of the polynomial of one row."""
    value = 0.0
    for k in range(STAGES, 0, -1):
        value = value * s + k * poly[row + k]
    return value


@kernel
def jacobian_at(problem, run, mode, space):
    """Jacobian of the rates at a point, column by column."""
    n, columns, out = problem.n_states, problem.order + 1, space.out
    directional = DIRECTIONAL * (problem.n_modes + problem.n_interfaces) + mode
    for k in range(n):
        for i in range(n):
            out[i * columns + 1] = 1.0 if i == k else 0.0
        call_address(problem.series, directional, space.point, run.parameters, out)
        for i in range(n):
            space.jacobian[i, k] = 2.0 * out[i * columns + 2]


@kernel
def sorted_eigenvalues(jacobian, n, found, spectrum):
    """Real parts of the eigenvalues in descending order, then their moduli; NaN if unknown."""
    if not eigenvalues_of(jacobian, n, spectrum):
        for i in range(found.shape[0]):
            found[i] = np.nan
        return
    values = spectrum.values
    for i in range(n):
        place = i
        while place > 0 and found[place - 1] < values[i].real:
            found[place], found[n + place] = found[place - 1], found[n + place - 1]
            place -= 1
        found[place], found[n + place] = values[i].real, abs(values[i])


@kernel
def unresolved_modulus(now, then, n, rate, h):
    """Largest eigenvalue modulus of the modes that a step must resolve.

    These are modes that decay neither at the given rate nor by the exponent `RESOLVED_MODE`
    within the step, or that decay now but will grow before they are below rounding. The
    ordered real parts are continuous in time.

    Parameters
    ----------
    now, then : float64 arrays, shape (2 n,)
        From `sorted_eigenvalues`, at the beginning and end of the step.
    """
    largest = 0.0
    for k in range(n):
        largest = max(largest, now[n + k], then[n + k])
    # uncertainty due to rounding of the others
    noise = 8.0 * n * EPSILON * largest
    followed = 0.0
    for k in range(n):
        modulus, real = max(now[n + k], then[n + k]), max(now[k], then[k])
        if not modulus < np.inf:
            return np.inf
        if modulus <= noise or real < -rate:
            continue
        rise = then[k] - now[k]
        erased = rise <= 0.0 or real * real * h >= 2.0 * ERASED * rise
        if not (-real * h >= RESOLVED_MODE and erased):
            followed = max(followed, modulus)
    return followed
