"""Long implicit steps through settled phases, where stability and not accuracy limits a series.

A step of Hermite and Obreshkov matches the Taylor series at its two ends: with
the Taylor coefficients Y_j at both, P of the first and Q of the second,

    sum_{j=0}^{Q} (-1)^j c_j(Q, P) h^j Y_j(y_1) = sum_{j=0}^{P} c_j(P, Q) h^j Y_j(y_0),
    c_j(q, p) = q! (q + p - j)! / ((p + q)! (q - j)!)

(Obreshkov 1940; Nedialkov and Jackson 1999, eq. 2.4), of order P + Q. Its
stability function is Padé's, L-stable for Q = P + 1 and P + 2 (Ehle 1973; Hairer
and Wanner 1996, thm. IV.4.12). The polynomial of degree P + Q + 1 that has the
same coefficients at both ends takes the place of the series of the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.decorators import part
from fastslow.kernels.pointers import call_address, call_with
from fastslow.kernels.records import Matrix, Tensor, Vector, zeros
from fastslow.kernels.taylor.modes import SHORT
from fastslow.simulation.stepper.events import find_event
from fastslow.simulation.stepper.matrices import (
    Spectrum,
    factorise_in_place,
    forgotten_in,
    solve_in_place,
    spectrum_for,
)
from fastslow.simulation.stepper.modes import MISSING
from fastslow.simulation.stepper.polynomials import EPSILON
from fastslow.simulation.stepper.radau import STAGES, Radau, RadauStep, accept, radau_for
from fastslow.simulation.stepper.scales import NOW, REACHED, ratio_of

#: Taylor coefficients that are matched at the beginning and at the end of a step.
P, Q = 2, SHORT

#: Order of a step, and degree of its polynomial, which its series must have at least.
SETTLED_ORDER = P + Q
DEGREE = P + Q + 1

#: A step must be this much longer than that of the series to be worth its cost, except
#: for the first ones, which damp what the series has left of fast motions.
PAYS = 3.0
DAMPING = 6

#: Steps of the series after a crossing before the first is tried; failures double it.
WAIT, LONGEST_WAIT = 4, 64

#: What marks such a step in the table of a run's steps, and one of Radau.
IMPLICIT, RADAU = 2, 3

#: How much at least a motion of the fast states decays within a step of the series for an
#: implicit one to forget it.
CONTRACTION = 0.01

#: How far at most a motion that does not decay so fast goes within an implicit step, |lambda| h:
#: those are followed, and not damped.
RESOLVED = 0.5

#: A step so much longer than that of the series is one of Radau: the middle coefficients at its
#: ends would be rounding, magnified.
RIGID = 300.0

#: Corrections this much smaller than what is allowed may be rounding, and are the last.
ROUNDED = 1e-2

#: Relative step of the differences that give the derivatives of the equation, and the least.
DIFFERENCE, TINY = 1e-7, 1e-150


def weights(q: int, p: int) -> tuple[float, ...]:
    """The factors c_j(q, p) of the Taylor coefficients, without signs.

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
    """From the coefficients of s**(P + 1) q(s) about s = 1 to those of q about s = 0."""
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
        As large as the series: the short series at the end of a step, and its polynomials.
    slopes : float64 array, shape (n_states, n_states + 1)
    jacobian : float64 array, shape (n_states, n_states)
    derivatives : float64 array, shape (Q, n_states, n_states)
    ahead : float64 array, shape (1 + n_states + n_forcing,)
    start, residual, moved, least : float64 arrays, shape (n_states,)
    rest : float64 array, shape (Q + 1,)
    spectrum : Spectrum
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
    spectrum: Spectrum
    radau: Radau


def implicit_for(n_states: int, n_forcing: int, n_interfaces: int, size: int) -> Implicit:
    """Work space for a model of these sizes, whose series is so large."""
    n = n_states
    return zeros(
        Implicit,
        *(size, size),
        (n, n + 1),
        (n, n),
        (Q, n, n),
        1 + n + n_forcing,
        *(n, n, n, n),
        Q + 1,
        spectrum_for(n),
        radau_for(n, n_forcing, n_interfaces, size),
    )


class Lengths(NamedTuple):
    """Lengths of an implicit step.

    Parameters
    ----------
    wanted, least : float
        The one to try first, and the least that is worth while.
    longest : float
        That of the series.
    remaining : float
        Time that is left.
    """

    wanted: float
    least: float
    longest: float
    remaining: float


class Series(NamedTuple):
    """Coefficients that an implicit step begins with, and those that it fills.

    Parameters
    ----------
    left : float64 array
        The series at its beginning, of which the first coefficients are used.
    right, poly : float64 arrays
        Filled: the short series at the end, and the polynomials of the step.
    work : float64 array
        As large; work space.
    """

    left: Vector
    right: Vector
    poly: Vector
    work: Vector


@part
def long_step(problem, run, mode, lengths, series, scales, search, space):
    """An implicit step that pays and that ends before anything happens.

    Parameters
    ----------
    problem : Problem
    run : Run
    mode : int
    lengths : Lengths
    series : Series
    scales : float64 array, shape (2, rows)
        In which errors are measured, those now at the beginning.
    search : Search
    space : Implicit

    Returns
    -------
    length : float
        0 where no such step pays, `MISSING` where Radau's steps are needed and are not there.
    growth : float
        How much longer the next one may be.
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
        if rigid or (error < 0.0 and CONTRACTION * h > RESOLVED * longest):
            found = by_radau(
                problem, run, mode, CONTRACTION / longest, h, series, scales, space.radau
            )
            if found == MISSING:
                return MISSING, 1.0
            if rigid or found <= 1.0:
                rigid, error, power = True, found, -1.0 / (STAGES + 1)
        error = abs(error)
        if error <= 1.0:
            s, j, _, _, _ = find_event(problem, run, mode, poly, h, search)
            if j < 0:
                if rigid:
                    accept(problem, run, mode, h, poly, series.right, space.radau)
                keep_forcing(problem, run, mode, h, series, scales)
                return h, min(4.0, 0.8 * max(error, 1e-9) ** power)
            # the series goes through events; end a little before this one
            h *= 0.9 * s
        else:
            h *= max(0.2, 0.8 * error**power) if error < np.inf else 0.25
    return 0.0, 1.0


@part
def by_radau(problem, run, mode, rate, h, series, scales, space):
    """Call `radau_step`."""
    if problem.radau == 0:
        return MISSING
    step = RadauStep(problem, run, mode, rate, h, series.right, series.poly, scales, space)
    return call_with(problem.radau, step)


@part
def settled(problem, W, h, scales):
    """Whether a step is limited by stability: its middle terms are small beside what is allowed.

    A motion exp(lambda t) of size a has the terms a z**k / k!, z = lambda h. Where
    accuracy limits the step the middle ones far exceed the last, which is the
    tolerance; on the edge of stability, |z| = order / e, all of them are near it.
    """
    order = problem.order
    most = problem.tol * math.exp(0.5 * order)
    for k in range(order // 2 - 1, order // 2 + 1):
        power = h**k
        for i in range(problem.n_states + problem.n_forcing + problem.n_interfaces):
            if not abs(W[i * (order + 1) + k]) * power <= most * scales[NOW, i]:
                return False
    return True


@part
def implicit_step(problem, run, mode, rate, h, series, scales, space):
    """One implicit step, its polynomials put into ``poly``; returns its error in units of ``tol``.

    Infinite where the equation is not solved, and negative where it is not tried, because the
    fast states do not contract at the given rate: an implicit method would damp what grows.
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
        ahead[1 + k] = kept + max(DIFFERENCE * max(scales[NOW, k], abs(kept)), TINY)
        step = ahead[1 + k] - kept
        call_address(problem.series, short, ahead, parameters, poly)
        for i in range(n):
            row = i * columns
            slopes[i, k] = (matched(poly, row, -h, _RIGHT) - start[i] - residual[i]) / step
            jacobian[i, k] = (poly[row + 1] - right[row + 1]) / step
            for j in range(Q):
                derivatives[j, i, k] = (poly[row + 1 + j] - right[row + 1 + j]) / step
        ahead[1 + k] = kept
    # also says no where something is not finite
    unresolved = forgotten_in(jacobian, problem.n_fast, rate, space.spectrum) * h
    if unresolved > RESOLVED:
        # as an error of this order, so that the next attempt is as short as it must be
        return -((unresolved / RESOLVED) ** (P + Q))
    if not unresolved >= 0.0 or not factorise_in_place(slopes, n):
        return np.inf
    # a state is known no better than rounding of the others lets it be
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
        # rounding, magnified by the condition of the equation, is where it cannot go on
        done = size <= ROUNDED
        if not done:
            if not size <= 0.5 * before or turn == 7:
                return np.inf
            # nothing is known of the rate of convergence before the second turn
            ratio, before = size / before if turn > 0 else 0.1, size
            done = size * ratio <= 1e-6 * (1.0 - ratio)
        for i in range(n):
            residual[i] = matched(right, i * columns, -h, _RIGHT) - start[i]
        if done:
            break
    # what is left is mostly rounding of the states, which stiff rates magnify: the
    # coefficients at the end are those of the state that solves the equation exactly
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
        # the first coefficient that is not matched tells how far the motion within leaves it
        power = h ** (P + 1)
        error_within = abs(W[row + P + 1] - poly[row + P + 1]) * power * _HUMP
        error = max(error, ratio_of(error_within, least[i] if i < n else tol * scales[NOW, i]))
        for k in range(P + Q + 2, columns):
            poly[row + k] = 0.0
    return error if error < np.inf else np.inf


@part
def allowed_of(tol, before, after, reached, least):
    """The error that is allowed in a state, by its smaller value at both ends of a step."""
    return max(tol * max(reached, min(abs(after), abs(before))), least)


@part
def keep_forcing(problem, run, mode, h, series, scales):
    """Let the slow quantities keep their own series where it holds throughout a step.

    They do not depend on the states, so that only the states need be implicit.
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


@part
def matched(W, row, h, factors):
    """The sum of c_j h**j Y_j over one row."""
    value = 0.0
    for j in range(factors.shape[0] - 1, -1, -1):
        value = value * h + factors[j] * W[row + j]
    return value


@part
def join(W, right, row, h, poly, rest):
    """The polynomial with the first coefficients of ``W`` at 0 and of ``right`` at h, one row.

    It is the Taylor polynomial at 0 and s**(P + 1) times another one of degree Q:
    what the first leaves of the coefficients at s = 1, divided by that power.
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
