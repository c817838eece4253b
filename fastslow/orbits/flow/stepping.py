"""The compiled flow with its derivatives by states, time and parameters.

Along a step the derivatives X of the flow solve X' = f_z X, with f_t or f_p added in the columns
of time and of a parameter. Their Taylor coefficients follow from those of f_z,

    X_{k+1} = (1/(k+1)) sum_{j=0}^{k} A_j X_{k-j},    A = f_z.

Every step begins with X = I, and the step is no longer than the series of every entry of X allows
relative to its own leading terms: chosen by the states alone, steps through a settled phase would
lose the rates of contraction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fastslow.continuation.spaces import PAUSED, TABLE_FULL
from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.compiler.records import IntegerMatrix, Integers, Matrix, Tensor, Vector
from fastslow.simulation.stepper.matrices import factorise_in_place, solve_in_place
from fastslow.simulation.stepper.scales import (
    LEADING,
    REACHED,
    raise_sizes,
    remember_sizes,
    step_length,
    unsaturated_length,
)

#: Return code of a loop that is done; otherwise it is to be called again.
FINISHED = 0

#: Places of the progress: segment, factors in the table, steps in the segment, steps left, and
#: of the solution of equations whether a flow has begun, and Newton steps.
SEGMENT, FACTORS, STEPS, WORK, BEGUN, ITERATION = range(6)

#: A factor ends where the geometric mean of its multipliers leaves this range, or where rounding
#: of its entries would change its determinant by more than `CONDITION` times as much.
SMALLEST_FACTOR, LARGEST_FACTOR, CONDITION = 1e-6, 1e6, 100.0

#: Remainder of a series in units of the tolerance from which a step is shortened.
EXCESS = 2.0


class FlowProblem(NamedTuple):
    """A model with its error control; see `fastslow.orbits.flow.variations.Variations`.

    Parameters
    ----------
    series : int
    n, unknowns, order, max_steps : int
        Numbers of states, and of states, time and parameters; highest coefficient; most steps
        of a segment.
    tol : float
    starts : int64 array
    entries : int64 array, shape (n_entries, 4)
    parameters : float64 array
    rules : float64 array, shape (2, n)
        Error scale rules, from `fastslow.simulation.stepper.scales.rules_of`.
    n_rows : int
        Number of rows of the series.
    saturating : int64 array, shape (n_modes, k)
    saturations : float64 array, shape (n_modes, 4 k)
        See `fastslow.kernels.taylor.saturation.saturation_arrays`.
    """

    series: int
    n: int
    unknowns: int
    order: int
    max_steps: int
    tol: float
    starts: Integers
    entries: IntegerMatrix
    parameters: Vector
    rules: Matrix
    n_rows: int
    saturating: IntegerMatrix
    saturations: Matrix


class FlowSegments(NamedTuple):
    """Segments of smooth motion; the last five are updated from step to step.

    Parameters
    ----------
    modes : int64 array, shape (K,)
    constants : float64 array, shape (K, m)
        The last m parameters, of clocks and tables, along every segment.
    times, durations : float64 array, shape (K,)
        Time at the beginning, and duration, which may be negative.
    ends : float64 array, shape (K, n)
    slopes : float64 array, shape (K, n, unknowns)
    traces, reached : float64 array, shape (K,)
        Integral of the trace of f_z, and duration completed.
    progress : int64 array, shape (6,)
    """

    modes: Integers
    constants: Matrix
    times: Vector
    durations: Vector
    ends: Matrix
    slopes: Tensor
    traces: Vector
    reached: Vector
    progress: Integers


class Factors(NamedTuple):
    """Table of the matrices whose products are the derivatives by the states.

    Parameters
    ----------
    owners : int64 array, shape (space,)
        Segment of each factor.
    matrices : float64 array, shape (space, n, n)
    """

    owners: Integers
    matrices: Tensor


class FlowWorkspace(NamedTuple):
    """Work space, kept over pauses.

    Parameters
    ----------
    W : float64 array
        The series of the states and of the entries of the derivatives.
    X : float64 array, shape (order + 1, n, unknowns)
        Coefficients of the derivatives of the flow.
    scales : float64 array, shape (2, n)
    inputs : float64 array, shape (1 + n,)
    step : float64 array, shape (n, unknowns)
        Derivatives of a step.
    factor : float64 array, shape (n, n)
        Product of the derivatives since the last factor in the table.
    lower : float64 array, shape (n, n + 1)
    right, column : float64 array, shape (n,)
    """

    W: Vector
    X: Tensor
    scales: Matrix
    inputs: Vector
    step: Matrix
    factor: Matrix
    lower: Matrix
    right: Vector
    column: Vector


@kernel
def flow_segments(problem, segments, factors, space):
    """Integrate all segments with their derivatives, or until a pause.

    Returns
    -------
    int
        `FINISHED`, `PAUSED` or `TABLE_FULL`. Where ``reached`` is not the duration, the rates
        were not finite or the steps were too many or too small.
    """
    n, order, tol, rules = problem.n, problem.order, problem.tol, problem.rules
    progress, reached, ends = segments.progress, segments.reached, segments.ends
    W, scales, inputs = space.W, space.scales, space.inputs
    for k in range(progress[SEGMENT], segments.modes.shape[0]):
        progress[SEGMENT] = k
        set_constants(problem, segments, k)
        duration, mode = segments.durations[k], segments.modes[k]
        while reached[k] != duration and progress[STEPS] < problem.max_steps:
            if progress[WORK] <= 0:
                return PAUSED
            if progress[FACTORS] == factors.owners.shape[0]:
                return TABLE_FULL
            progress[WORK] -= 1
            inputs[0] = segments.times[k] + reached[k]
            for i in range(n):
                inputs[1 + i] = ends[k, i]
            call_address(problem.series, mode, inputs, problem.parameters, W)
            remaining = duration - reached[k]
            if progress[STEPS] == 0:
                for i in range(n):
                    scales[REACHED, i] = 0.0
                raise_sizes(W, n, order, tol, abs(remaining), rules, scales)
                set_to_identity(space.factor)
            h = min(abs(remaining), step_length(W, n, order, tol, scales))
            rows, limits = problem.saturating, problem.saturations
            h = unsaturated_length(W, order, mode, rows, limits, h, h)
            if not h > 0.0:
                break
            expand_derivatives(problem, mode, W, space.X)
            h = min(h, trace_step(problem, mode, W, h))
            h = derivatives_step(space.X, n, problem.unknowns, order, tol, h)
            last = h == abs(remaining)
            h = math.copysign(h, remaining)
            if h != h or (not last and reached[k] + h == reached[k]):
                break
            for i in range(n):
                ends[k, i] = value_of(W, i * (order + 1), order, h)
            segments.traces[k] += integral_of_trace(problem, mode, W, h)
            compose(space, segments.slopes[k], h)
            remember_sizes(rules, scales)
            reached[k] = duration if last else reached[k] + h
            progress[STEPS] += 1
            if last or is_unbalanced(space):
                put_factor(progress, factors, k, space.factor)
        if reached[k] != duration and progress[STEPS] > 0:
            if progress[FACTORS] == factors.owners.shape[0]:
                return TABLE_FULL
            put_factor(progress, factors, k, space.factor)
        progress[STEPS] = 0
    progress[SEGMENT] = segments.modes.shape[0]
    return FINISHED


@kernel
def set_constants(problem, segments, k):
    """Fill in the parameters that are constant along a segment."""
    count = segments.constants.shape[1]
    first = problem.parameters.shape[0] - count
    for j in range(count):
        problem.parameters[first + j] = segments.constants[k, j]


@kernel
def put_factor(progress, factors, k, factor):
    """Append a factor to the table, and begin the next one."""
    place = progress[FACTORS]
    factors.owners[place] = k
    for i in range(factor.shape[0]):
        for j in range(factor.shape[0]):
            factors.matrices[place, i, j] = factor[i, j]
    progress[FACTORS] = place + 1
    set_to_identity(factor)


@kernel
def set_to_identity(matrix):
    """Fill in the identity."""
    matrix[:] = 0.0
    for i in range(matrix.shape[0]):
        matrix[i, i] = 1.0


@kernel
def value_of(W, row, order, h):
    """Value of the series of a row at h."""
    value = W[row + order]
    for k in range(order - 1, -1, -1):
        value = value * h + W[row + k]
    return value


@kernel
def expand_derivatives(problem, mode, W, X):
    """Fill in the Taylor coefficients of the derivatives of the flow, from X = I."""
    n, unknowns, columns = problem.n, problem.unknowns, problem.order + 1
    entries = problem.entries
    X[:] = 0.0
    for i in range(n):
        X[0, i, i] = 1.0
    for k in range(problem.order):
        for e in range(problem.starts[mode], problem.starts[mode + 1]):
            i, u, row = entries[e, 0], entries[e, 1], entries[e, 2] * columns
            target = X[k + 1, i]
            if u >= n:
                target[u] += W[row + k]
            if u < n:
                for j in range(1 if entries[e, 3] else k + 1):
                    a = W[row + j]
                    source = X[k - j, u]
                    for c in range(unknowns):
                        target[c] += a * source[c]
        factor = 1.0 / (k + 1)
        for i in range(n):
            for c in range(unknowns):
                X[k + 1, i, c] *= factor


@kernel
def derivatives_step(X, n, unknowns, order, tol, h):
    """Shorten a step until the last terms of every entry are small against its leading ones.

    Of the leading terms the first nonzero one and the next `LEADING` - 1 count: larger later ones
    would cancel. Entries that begin with a power above half the order, of states that many others
    connect, are far smaller than those of the states between, and follow from these in the product
    of steps.
    """
    most = min(order - LEADING - 1, order // 2)
    for i in range(n):
        for c in range(unknowns):
            first = 0
            while first <= most and X[first, i, c] == 0.0:
                first += 1
            if first > most:
                continue
            short = True
            while short:
                power, size, place = h**first, 0.0, first
                for m in range(first, first + LEADING):
                    term = abs(X[m, i, c]) * power
                    power *= h
                    if not term <= size:
                        size, place = term, m
                short = False
                power = h ** (order - 1)
                for m in range(order - 1, order + 1):
                    term = abs(X[m, i, c]) * power
                    power *= h
                    if not term <= EXCESS * tol * size:
                        if not tol * size / term > 0.0:
                            return math.nan
                        h *= (tol * size / term) ** (1.0 / (m - place))
                        short = True
                        break
    return h


@kernel
def trace_step(problem, mode, W, h):
    """Step length for which the last terms of the integral of the trace are small against 1."""
    n, order = problem.n, problem.order
    length = h
    for k in range(order - 1, order + 1):
        total = 0.0
        for e in range(problem.starts[mode], problem.starts[mode + 1]):
            if problem.entries[e, 0] == problem.entries[e, 1] and problem.entries[e, 1] < n:
                total += W[problem.entries[e, 2] * (order + 1) + k]
        if total != 0.0:
            term = abs(total) / (k + 1)
            length = min(length, (problem.tol / term) ** (1.0 / (k + 1)))
    return length


@kernel
def integral_of_trace(problem, mode, W, h):
    """Integral of the trace of f_z over a step."""
    columns = problem.order + 1
    total = 0.0
    for e in range(problem.starts[mode], problem.starts[mode + 1]):
        if problem.entries[e, 0] == problem.entries[e, 1]:
            row = problem.entries[e, 2] * columns
            value = 0.0
            for k in range(problem.order, -1, -1):
                value = value * h + W[row + k] / (k + 1)
            total += value * h
    return total


@kernel
def compose(space, slopes, h):
    """Evaluate the derivatives of a step, and multiply the slopes and the factor by them."""
    X, step, column = space.X, space.step, space.column
    n, unknowns = step.shape
    order = X.shape[0] - 1
    for i in range(n):
        for c in range(unknowns):
            step[i, c] = X[order, i, c]
    for k in range(order - 1, -1, -1):
        for i in range(n):
            for c in range(unknowns):
                step[i, c] = step[i, c] * h + X[k, i, c]
    for c in range(unknowns):
        multiply_column(step, slopes, c, column)
        if c >= n:
            for i in range(n):
                slopes[i, c] += step[i, c]
    for c in range(n):
        multiply_column(step, space.factor, c, column)


@kernel
def multiply_column(step, target, c, column):
    """Multiply a column by the derivatives by the states."""
    n = column.shape[0]
    for i in range(n):
        column[i] = 0.0
        for j in range(n):
            column[i] += step[i, j] * target[j, c]
    for i in range(n):
        target[i, c] = column[i]


@kernel
def is_unbalanced(space):
    """Check whether the factor P is to end here.

    The sum of P_ij (P^-1)_ji, taken with moduli, bounds by how much rounding of the entries
    changes the determinant. It has no units.
    """
    factor, lower, right, column = space.factor, space.lower, space.right, space.column
    n = factor.shape[0]
    for i in range(n):
        for j in range(n):
            lower[i, j] = factor[i, j]
    if not factorise_in_place(lower, n):
        return True
    size = 1.0
    for i in range(n):
        size *= abs(lower[i, i]) ** (1.0 / n)
    condition = 0.0
    for j in range(n):
        for i in range(n):
            right[i] = 0.0
        right[j] = 1.0
        solve_in_place(lower, right, column, n)
        for i in range(n):
            condition += abs(column[i] * factor[j, i])
    return not (SMALLEST_FACTOR <= size <= LARGEST_FACTOR and condition <= CONDITION * n)
