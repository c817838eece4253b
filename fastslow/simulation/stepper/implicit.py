"""Long implicit steps where stability, not accuracy, limits the Taylor series.

A Hermite-Obreshkov step matches the Taylor series at its two ends: with
the Taylor coefficients Y_j at both, P of the first and Q of the second,

    sum_{j=0}^{Q} (-1)^j c_j(Q, P) h^j Y_j(y_1) = sum_{j=0}^{P} c_j(P, Q) h^j Y_j(y_0),
    c_j(q, p) = q! (q + p - j)! / ((p + q)! (q - j)!)

(Obreshkov 1940; Nedialkov and Jackson 1999, eq. 2.4), of order P + Q. Its
stability function is a Padé approximant, L-stable for Q = P + 1 and P + 2 (Ehle 1973; Hairer
and Wanner 1996, thm. IV.4.12). The polynomial of degree P + Q + 1 that has the
same coefficients at both ends replaces the series of the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address, call_with
from fastslow.kernels.compiler.records import Matrix, Tensor, Vector, zeros
from fastslow.kernels.taylor.modes import RATES, SHORT_ORDER
from fastslow.simulation.stepper.event_location import find_event
from fastslow.simulation.stepper.matrices import (
    EigenvalueSpace,
    factorise_in_place,
    solve_in_place,
    spectrum_for,
    undamped_modulus,
)
from fastslow.simulation.stepper.motion_selection import MISSING
from fastslow.simulation.stepper.polynomials import EPSILON, ZERO, horner
from fastslow.simulation.stepper.radau import (
    POWERS,
    RESOLVED_MODE,
    STAGES,
    C,
    Radau,
    RadauStep,
    accept,
    radau_for,
)
from fastslow.simulation.stepper.scales import NOW, REACHED, ratio_of, remains_saturated

#: Numbers of Taylor coefficients matched at the beginning and at the end of a step.
P, Q = 2, SHORT_ORDER

#: Order of a step, and degree of its polynomial, the minimum order of the series.
SETTLED_ORDER = P + Q
DEGREE = P + Q + 1

#: Ratio to the step of the series from which an implicit step pays, except for the first
#: ones, which damp the remaining fast transients.
PAYS = 3.0
DAMPING = 6

#: Series steps after a crossing before the first attempt; failures double the wait.
WAIT, LONGEST_WAIT = 4, 64

#: Codes of implicit and of Radau steps in the table of steps.
IMPLICIT, RADAU = 2, 3

#: Minimum decay of a fast mode within a series step for an implicit step to damp it.
CONTRACTION = 0.01

#: Ratio to the step of the series from which Radau steps are used: the middle coefficients at
#: the ends would be amplified rounding.
RIGID = 300.0

#: Corrections below this fraction of the allowed error may be rounding and end the iteration.
ROUNDED_CORRECTION = 1e-2

#: Relative step of the difference quotients of the equation, and its minimum.
QUOTIENT_STEP, TINY = 1e-7, 1e-150


def weights(q: int, p: int) -> tuple[float, ...]:
    """Factors c_j(q, p) of the Taylor coefficients, without signs.

    Examples
    --------
    >>> weights(1, 1)
    (1.0, 0.5)
    """
    whole = math.factorial(p + q)
    return tuple(
        math.factorial(q) * math.factorial(q + p - j) / (whole * math.factorial(q - j))
        for j in range(q + 1)
    )


_LEFT, _RIGHT = np.array(weights(P, Q)), np.array(weights(Q, P))
# the method of one order less that shares the end, whose difference estimates the error
_LESS_LEFT, _LESS_RIGHT = np.array(weights(P - 1, Q)), np.array(weights(Q, P - 1))

#: Largest value of s**(P + 1) (1 - s)**(Q + 1) on [0, 1].
_HUMP = (P + 1) ** (P + 1) * (Q + 1) ** (Q + 1) / (P + Q + 2) ** (P + Q + 2)


def _quotient() -> NDArray[np.float64]:
    """Matrix from the coefficients of s**(P + 1) q(s) about s = 1 to those of q about s = 0."""
    rows = np.eye(Q + 1)
    for _ in range(P + 1):
        for i in range(1, Q + 1):
            rows[i] -= rows[i - 1]
    for j in range(Q):
        for k in range(Q - 1, j - 1, -1):
            rows[k] -= rows[k + 1]
    return rows


_QUOTIENT = _quotient()
_BINOMIAL = np.array([[float(math.comb(k, i)) for i in range(P + 1)] for k in range(P + 1)])


class Implicit(NamedTuple):
    """Work space of implicit steps.

    Parameters
    ----------
    right, poly : float64 arrays
        Same size as the series: the short series at the end of a step, and its polynomials.
    slopes : float64 array, shape (n_states, n_states + 1)
    jacobian : float64 array, shape (n_states, n_states)
    derivatives : float64 array, shape (Q, n_states, n_states)
    ahead : float64 array, shape (1 + n_states + n_forcing,)
    start, residual, moved, least : float64 arrays, shape (n_states,)
    rest : float64 array, shape (Q + 1,)
    spectrum : EigenvalueSpace
    arguments : float64 array, shape (k, STAGES + 1)
        Of functions that saturate, at the points of a step.
    radau : Radau
    """

    right: Vector
    poly: Vector
    slopes: Matrix
    jacobian: Matrix
    derivatives: Tensor
    ahead: Vector
    start: Vector
    residual: Vector
    moved: Vector
    least: Vector
    rest: Vector
    spectrum: EigenvalueSpace
    arguments: Matrix
    radau: Radau


def implicit_for(
    n_states: int, n_forcing: int, n_interfaces: int, size: int, saturating: int
) -> Implicit:
    """Allocate the work space for a model of these sizes, whose series has ``size`` entries.

    It has at most ``saturating`` arguments of functions that saturate in a mode.
    """
    n = n_states
    return zeros(
        Implicit,
        right=size,
        poly=size,
        slopes=(n, n + 1),
        jacobian=(n, n),
        derivatives=(Q, n, n),
        ahead=1 + n + n_forcing,
        start=n,
        residual=n,
        moved=n,
        least=n,
        rest=Q + 1,
        spectrum=spectrum_for(n),
        arguments=(saturating, STAGES + 1),
        radau=radau_for(n, n_forcing, n_interfaces, size),
    )


class Lengths(NamedTuple):
    """Step lengths of an implicit step.

    Parameters
    ----------
    wanted, least : float
        First attempt, and the minimum that pays.
    longest : float
        Step length of the series.
    remaining : float
        Remaining time.
    """

    wanted: float
    least: float
    longest: float
    remaining: float


class Series(NamedTuple):
    """Coefficients at the beginning of an implicit step, and those it fills in.

    Parameters
    ----------
    left : float64 array
        The series at its beginning, of which the first coefficients are used.
    right, poly : float64 arrays
        Filled: the short series at the end, and the polynomials of the step.
    work : float64 array
        Work space of the same size.
    """

    left: Vector
    right: Vector
    poly: Vector
    work: Vector


@kernel
def long_step(problem, run, mode, lengths, series, scales, search, space):
    """Take an implicit step that pays and contains no event.

    Parameters
    ----------
    problem : Problem
    run : Run
    mode : int
    lengths : Lengths
    series : Series
    scales : float64 array, shape (2, rows)
        Error scales, those now at the beginning.
    search : EventSearch
    space : Implicit

    Returns
    -------
    length : float
        0 if no such step pays, `MISSING` if Radau steps are needed and not loaded.
    growth : float
        Growth factor for the next step.
    """
    inputs, on, signs = run.inputs, search.on, problem.signs
    wanted, least, longest, remaining = lengths
    poly, phase = series.poly, space.radau.phase
    for j in range(on.shape[0]):
        if on[j] or signs[mode, j] == 0:
            return 0.0, 1.0
    h = min(wanted, remaining)
    for _ in range(4):
        if not h >= least:
            return 0.0, 1.0
        if h < remaining:
            h = (inputs[0] + h) - inputs[0]
        error, power = -1.0, -1.0 / (P + Q)
        rigid = phase[0] > 0.0 or h > RIGID * longest
        if not rigid:
            error = implicit_step(
                problem, run, mode, CONTRACTION / longest, h, series, scales, space
            )
        if rigid or (error < 0.0 and CONTRACTION * h > RESOLVED_MODE * longest):
            found = call_radau(
                problem, run, mode, CONTRACTION / longest, h, series, scales, space.radau
            )
            if found == MISSING:
                return MISSING, 1.0
            if rigid or found <= 1.0:
                rigid, error, power = True, found, -1.0 / (STAGES + 1)
        error = abs(error)
        if error <= 1.0:
            s, j, _, _, _ = find_event(problem, run, mode, poly, h, search)
            if j < 0 and saturating_within(problem, run, mode, h, poly, space):
                h *= 0.5
            elif j < 0:
                if rigid:
                    accept(problem, run, mode, h, poly, series.right, space.radau)
                keep_forcing(problem, run, mode, h, series, scales)
                return h, min(4.0, 0.8 * max(error, 1e-9) ** power)
            else:
                # events are located by the series: end shortly before this one
                h *= 0.9 * s
        else:
            h *= max(0.2, 0.8 * error**power) if error < np.inf else 0.25
    return 0.0, 1.0


@kernel
def saturating_within(problem, run, mode, h, poly, space):
    """Check whether the argument of a saturating function may pass its transition in a step.

    As in `unsaturated_length`, for the polynomial through the arguments at the points of a
    Radau step.
    """
    rows, limits, found = problem.saturating, problem.saturations, space.arguments
    count = ZERO
    while count < rows.shape[1] and rows[mode, count] >= 0:
        count += 1
    if count == 0:
        return False
    columns, point, out = problem.order + 1, space.ahead, space.radau.out
    rates = RATES * (problem.n_modes + problem.n_interfaces) + mode
    for j in range(STAGES + 1):
        s = C[j - 1] * h if j > 0 else 0.0
        point[0] = run.inputs[0] + s
        for i in range(problem.n_states):
            point[1 + i] = horner(poly, i * columns, i * columns + problem.order, s)
        call_address(problem.series, rates, point, run.parameters, out)
        for k in range(count):
            found[k, j] = out[rows[mode, k] * columns]
    for k in range(count):
        change = 0.0
        for i in range(STAGES):
            value = 0.0
            for j in range(STAGES):
                value += POWERS[i, j] * (found[k, 1 + j] - found[k, 0])
            change += abs(value)
        if not remains_saturated(limits, mode, k, abs(found[k, 0]), change):
            return True
    return False


@kernel
def call_radau(problem, run, mode, rate, h, series, scales, space):
    """Call `radau_step`."""
    if problem.radau == 0:
        return MISSING
    step = RadauStep(
        problem=problem,
        run=run,
        mode=mode,
        rate=rate,
        h=h,
        right=series.right,
        poly=series.poly,
        scales=scales,
        space=space,
    )
    return call_with(problem.radau, step)


@kernel
def limited_by_stability(problem, W, h, scales):
    """Check whether stability limits a step: its middle terms are small beside the tolerance.

    A mode exp(lambda t) of amplitude a has the terms a z**k / k!, z = lambda h. If
    accuracy limits the step, the middle terms far exceed the last, which equals the
    tolerance; at the stability limit, |z| = order / e, all of them are close to it.
    """
    order = problem.order
    most = problem.tol * math.exp(0.5 * order)
    for k in range(order // 2 - 1, order // 2 + 1):
        power = h**k
        for i in range(problem.n_states + problem.n_forcing + problem.n_interfaces):
            if not abs(W[i * (order + 1) + k]) * power <= most * scales[NOW, i]:
                return False
    return True


@kernel
def implicit_step(problem, run, mode, rate, h, series, scales, space):
    """Take one implicit step, fill ``poly``, and return its error in units of ``tol``.

    Infinite if the equation is not solved, negative if it is not attempted because the fast
    states do not contract at the given rate: an implicit method would damp growing modes.
    """
    n, tol, inputs, parameters = problem.n_states, problem.tol, run.inputs, run.parameters
    n_forcing, n_interfaces = problem.n_forcing, problem.n_interfaces
    columns = problem.order + 1
    short = problem.n_modes + n_interfaces + mode
    W, right, poly = series.left, series.right, series.poly
    slopes, jacobian, derivatives = space.slopes, space.jacobian, space.derivatives
    ahead, start, residual, moved = space.ahead, space.start, space.residual, space.moved
    rest, least = space.rest, space.least
    ahead[0] = inputs[0] + h
    for i in range(n):
        row = i * columns
        ahead[1 + i] = W[row] + h * (W[row + 1] + h * (W[row + 2] + h * W[row + 3]))
        start[i] = matched(W, row, h, _LEFT)
    call_address(problem.series, short, ahead, parameters, right)
    for i in range(n):
        residual[i] = matched(right, i * columns, -h, _RIGHT) - start[i]
    for k in range(n):
        kept = ahead[1 + k]
        ahead[1 + k] = kept + max(QUOTIENT_STEP * max(scales[NOW, k], abs(kept)), TINY)
        step = ahead[1 + k] - kept
        call_address(problem.series, short, ahead, parameters, poly)
        for i in range(n):
            row = i * columns
            slopes[i, k] = (matched(poly, row, -h, _RIGHT) - start[i] - residual[i]) / step
            jacobian[i, k] = (poly[row + 1] - right[row + 1]) / step
            for j in range(Q):
                derivatives[j, i, k] = (poly[row + 1 + j] - right[row + 1 + j]) / step
        ahead[1 + k] = kept
    # also false for values that are not finite
    unresolved = undamped_modulus(jacobian, problem.n_fast, rate, space.spectrum) * h
    if unresolved > RESOLVED_MODE:
        # as an error of this order, so that the next attempt is short enough
        return -((unresolved / RESOLVED_MODE) ** (P + Q))
    if not unresolved >= 0.0 or not factorise_in_place(slopes, n):
        return np.inf
    # the accuracy of a state is limited by rounding of the others
    for i in range(n):
        noise = 0.0
        for k in range(n):
            if k != i:
                noise += abs(jacobian[i, k] * ahead[1 + k])
        least[i] = 8.0 * EPSILON * (noise / max(abs(jacobian[i, i]), 1.0 / h) + abs(ahead[1 + i]))
    before = np.inf
    for turn in range(8):
        solve_in_place(slopes, residual, moved, n)
        size = 0.0
        for i in range(n):
            ahead[1 + i] -= moved[i]
            allowed = allowed_of(tol, W[i * columns], ahead[1 + i], scales[REACHED, i], least[i])
            size = max(size, ratio_of(moved[i], allowed))
        call_address(problem.series, short, ahead, parameters, right)
        # at rounding, amplified by the condition of the equation, no further progress is possible
        done = size <= ROUNDED_CORRECTION
        if not done:
            if not size <= 0.5 * before or turn == 7:
                return np.inf
            # the rate of convergence is unknown before the second iteration
            ratio, before = size / before if turn > 0 else 0.1, size
            done = size * ratio <= 1e-6 * (1.0 - ratio)
        for i in range(n):
            residual[i] = matched(right, i * columns, -h, _RIGHT) - start[i]
        if done:
            break
    # the residual is mostly rounding of the states, amplified by stiff rates: correct the
    # coefficients at the end to those of the exact solution of the equation
    solve_in_place(slopes, residual, moved, n)
    for i in range(n):
        row = i * columns
        for j in range(Q):
            for k in range(n):
                right[row + 1 + j] -= derivatives[j, i, k] * moved[k]
    for i in range(n):
        row = i * columns
        residual[i] = matched(right, row, -h, _LESS_RIGHT) - matched(W, row, h, _LESS_LEFT)
    solve_in_place(slopes, residual, moved, n)
    error = 0.0
    for i in range(n):
        least[i] = allowed_of(tol, W[i * columns], ahead[1 + i], scales[REACHED, i], least[i])
        error = max(error, ratio_of(moved[i], least[i]))
    for i in range(n + n_forcing + n_interfaces):
        row = i * columns
        join(W, right, row, h, poly, rest)
        # the first unmatched coefficient estimates the error within the step
        power = h ** (P + 1)
        error_within = abs(W[row + P + 1] - poly[row + P + 1]) * power * _HUMP
        error = max(error, ratio_of(error_within, least[i] if i < n else tol * scales[NOW, i]))
        for k in range(P + Q + 2, columns):
            poly[row + k] = 0.0
    return error if error < np.inf else np.inf


@kernel
def allowed_of(tol, before, after, reached, least):
    """Error allowed in a state, from the smaller of its moduli at the ends of a step."""
    return max(tol * max(reached, min(abs(after), abs(before))), least)


@kernel
def keep_forcing(problem, run, mode, h, series, scales):
    """Keep the series of the slow quantities where it converges throughout a step.

    They do not depend on the states, so only the states need an implicit step.
    """
    n, n_forcing, order = problem.n_states, problem.n_forcing, problem.order
    poly, work = series.poly, series.work
    if n_forcing == 0:
        return
    call_address(problem.series, mode, run.inputs, run.parameters, work)
    for i in range(n, n + n_forcing):
        row = i * (order + 1)
        left = max(abs(work[row + order]) * h, abs(work[row + order - 1])) * h ** (order - 1)
        if left <= 1e-6 * problem.tol * scales[NOW, i]:
            for k in range(order + 1):
                poly[row + k] = work[row + k]


@kernel
def matched(W, row, h, factors):
    """Sum of c_j h**j Y_j over one row."""
    value = 0.0
    for j in range(factors.shape[0] - 1, -1, -1):
        value = value * h + factors[j] * W[row + j]
    return value


@kernel
def join(W, right, row, h, poly, rest):
    """Interpolate one row: the first coefficients of ``W`` at 0 and of ``right`` at h.

    The sum of the Taylor polynomial at 0 and of s**(P + 1) times a polynomial of degree Q,
    which matches the remaining coefficients at s = 1.
    """
    power = 1.0
    for i in range(Q + 1):
        rest[i] = right[row + i] * power
        power *= h
    power = 1.0
    for k in range(P + 1):
        poly[row + k] = W[row + k]
        term = W[row + k] * power
        for i in range(k + 1):
            rest[i] -= _BINOMIAL[k, i] * term
        power *= h
    scale = 1.0 / power
    for j in range(Q + 1):
        value = 0.0
        for i in range(Q + 1):
            value += _QUOTIENT[j, i] * rest[i]
        poly[row + P + 1 + j] = value * scale
        scale /= h
