"""Collocation steps, for rates without a Taylor series.

The polynomial of degree n through the state at the beginning of a step whose
derivative equals the rates at n Lobatto points (Hairer and Wanner 1996,
section IV.5, Lobatto IIIA) is of order n throughout the step and of order
2 n - 2 at its end. It is computed by fixed-point iteration, started from the polynomial
of the previous step, and replaces the series: rows of coefficients in time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.compiler.records import Matrix, Vector, zeros
from fastslow.simulation.stepper.lobatto import (
    AT_F,
    HIGHEST,
    INTEGRALS,
    LOWEST,
    TO_C,
    TO_F,
    WORST,
    C,
    F,
)
from fastslow.simulation.stepper.polynomials import EPSILON
from fastslow.simulation.stepper.problems import Problem, Run
from fastslow.simulation.stepper.scales import NOW

#: Maximum numbers of iterations in one attempt, and of attempts for one step.
COLLOCATION_ITERATIONS, ATTEMPTS = 40, 100

#: Fractions of the tolerance allowed for the error estimate and for the iteration error.
SHARE, COLLOCATION_REMAINDER = 0.5, 0.02


class Collocation(NamedTuple):
    """State carried between collocation steps, and work space.

    Parameters
    ----------
    memory : float64 array
        Whether the last step was a collocation step, the step length to try next, the last step's
        length, time and mode, then its rates; zeros at the beginning of a run.
    start, scale : float64 arrays, shape (n_rates,)
        Initial values and inverse scales of the quantities with known rates: the states and
        the switching functions.
    rates : float64 array, shape (n_rates, n)
    defect : float64 array, shape (n_rates, n + 1)
    values : float64 array, shape (n_forcing + n_bounds, n + 2)
    point : float64 array, shape (1 + n_states + n_forcing,)
    out : float64 array
        Same size as the series.
    states : float64 array, shape (n, n_states)
    work : float64 array, shape (n + 2,)
    """

    memory: Vector
    start: Vector
    scale: Vector
    rates: Matrix
    defect: Matrix
    values: Matrix
    point: Vector
    out: Vector
    states: Matrix
    work: Vector


def collocation_for(
    n_states: int, n_forcing: int, n_interfaces: int, order: int, n_rows: int
) -> Collocation:
    """Allocate the work space for a model of these sizes, whose series has ``n_rows`` rows."""
    n = min(order, HIGHEST)
    n_rates = n_states + n_interfaces
    # sliding along an interface has two bounds
    n_bounds = min(2 * n_interfaces, n_rows - n_rates - n_forcing)
    return zeros(
        Collocation,
        memory=5 + n_states * n,
        start=n_rates,
        scale=n_rates,
        rates=(n_rates, n),
        defect=(n_rates, n + 1),
        values=(n_forcing + n_bounds, n + 2),
        point=1 + n_states + n_forcing,
        out=n_rows * (order + 1),
        states=(n, n_states),
        work=n + 2,
    )


class CollocationStep(NamedTuple):
    """Arguments of `collocate`; see `modes.expand`."""

    problem: Problem
    run: Run
    mode: int
    longest: float
    W: Vector
    scales: Matrix
    space: Collocation
    going_on: bool


@kernel
def collocate(step):
    """Replace the values and rates in ``W`` by collocation polynomials; see `modes.expand`."""
    problem, run, mode, W, scales = step.problem, step.run, step.mode, step.W, step.scales
    space, memory, inputs = step.space, step.space.memory, step.run.inputs
    n_states, n_forcing, tol = problem.n_states, problem.n_forcing, problem.tol
    n_interfaces, columns = problem.n_interfaces, problem.order + 1
    first_h = n_states + n_forcing
    drift = first_h + n_interfaces
    n = min(problem.order, HIGHEST)
    table = n - LOWEST
    n_rates = n_states + n_interfaces
    start, scale, rates, values = space.start, space.scale, space.rates, space.values
    n_bounds = values.shape[0] - n_forcing
    finite = 0.0
    for i in range(n_rates):
        row = columns * (i if i < n_states else i + n_forcing)
        start[i], rates[i, 0] = W[row], W[row + 1]
        size = scales[NOW, i if i < n_states else i + n_forcing]
        scale[i] = 1.0 / size if size > 0.0 else 0.0
        finite += 0.0 * (W[row] + W[row + 1])
    for k in range(n_forcing):
        finite += 0.0 * W[(n_states + k) * columns]
    if finite != 0.0:
        return np.nan
    for k in range(space.out.shape[0]):
        space.out[k] = 0.0
    h = step.longest
    if step.going_on and memory[1] > 0.0:
        h = min(h, memory[1])
    else:
        h = min(h, first_length(problem, run, mode, h, W, space))
    done = False
    for _ in range(ATTEMPTS):
        if inputs[0] + h == inputs[0]:
            return np.nan
        predict(problem, inputs[0], mode, h, step.going_on, space)
        taken = iterate(problem, run, mode, h, space)
        if taken == 0:
            h *= 0.4
            continue
        # a state that starts at zero has no scale yet: use its change
        for i in range(n_rates):
            if scales[NOW, i if i < n_states else i + n_forcing] == 0.0:
                change = 0.0
                for j in range(1, n):
                    total = 0.0
                    for k in range(n):
                        total += TO_C[table, j, k] * rates[i, k]
                    change = max(change, abs(h * total))
                scale[i] = 1.0 / change if change > 0.0 else 0.0
        error = check(problem, run, mode, h, scales, space)
        if not error < np.inf:
            h *= 0.4
            continue
        growth = 4.0
        if error > 0.0:
            growth = min(4.0, 0.9 * (SHARE * tol / error) ** (1.0 / (n + 1)))
        if error <= SHARE * tol or error <= 8.0 * EPSILON:
            done = True
            break
        h *= max(growth, 0.1)
    if not done:
        return np.nan
    if taken > 12:
        growth = min(growth, 0.9)
    for k in range(drift + n_bounds):
        for j in range(2 if k < n_states else 1, columns):
            W[k * columns + j] = 0.0
    work = space.work
    for i in range(n_rates):
        row = columns * (i if i < n_states else i + n_forcing)
        to_powers(rates[i], C[table], n, work)
        power = 1.0
        for k in range(n):
            W[row + k + 1] = work[k] * power / (k + 1)
            power /= h
    for i in range(values.shape[0]):
        row = columns * (n_states + i if i < n_forcing else drift + i - n_forcing)
        to_powers(values[i], F[table], n + 1, work)
        power = 1.0
        for k in range(n + 1):
            W[row + k] = work[k] * power
            power /= h
    if step.going_on:
        memory[0], memory[1], memory[2], memory[3], memory[4] = 1.0, growth * h, h, inputs[0], mode
        for i in range(n_states):
            for k in range(n):
                memory[5 + i * n + k] = (k + 1) * W[i * columns + k + 1]
    return h


@kernel
def first_length(problem, run, mode, longest, W, space):
    """Estimate the first step length from the rates and their change (Hairer et al. 1993, II.4)."""
    n_states, order, inputs = problem.n_states, problem.order, run.inputs
    scale, point, out, columns = space.scale, space.point, space.out, order + 1
    rate = 0.0
    for i in range(n_states):
        rate = max(rate, abs(W[i * columns + 1]) * scale[i])
    short = min(1e-3 / rate, longest) if rate > 0.0 else 1e-3 * longest
    point[0] = inputs[0] + short
    for i in range(n_states):
        point[1 + i] = inputs[1 + i] + short * W[i * columns + 1]
    call_address(problem.series, mode, point, run.parameters, out)
    change = 0.0
    for i in range(n_states):
        difference = abs(out[i * columns + 1] - W[i * columns + 1]) / short
        change = max(change, (difference * scale[i]) ** 0.5)
    most = max(rate, change)
    length = 100.0 * short
    if most > 0.0:
        length = min(length, problem.tol ** (1.0 / (min(order, HIGHEST) + 1)) / most)
    return length if length > 0.0 else short


@kernel
def predict(problem, t, mode, h, going_on, space):
    """Predict the rates at the collocation points, from the previous step or as constants."""
    n_states, memory, rates = problem.n_states, space.memory, space.rates
    n = rates.shape[1]
    known = going_on and memory[2] > 0.0 and memory[4] == mode
    offset = t - memory[3] if known else 0.0
    # far beyond the previous step its polynomial is a poor predictor
    known = known and offset + h <= 2.5 * memory[2]
    table = n - LOWEST
    for i in range(rates.shape[0]):
        for j in range(1, n):
            rates[i, j] = rates[i, 0]
        if known and i < n_states:
            here = 0.0
            for j in range(n):
                s = offset + C[table, j] * h
                value = 0.0
                for k in range(n - 1, -1, -1):
                    value = value * s + memory[5 + i * n + k]
                if j == 0:
                    here = value
                else:
                    rates[i, j] += value - here


@kernel
def iterate(problem, run, mode, h, space):
    """Iterate the rates at the collocation points until the states there converge.

    Returns
    -------
    int
        Number of iterations, 0 without convergence.
    """
    n_states, n_forcing, inputs = problem.n_states, problem.n_forcing, run.inputs
    start, scale, rates, states = space.start, space.scale, space.rates, space.states
    point, out = space.point, space.out
    columns, n = problem.order + 1, rates.shape[1]
    table = n - LOWEST
    last = np.inf
    for count in range(COLLOCATION_ITERATIONS):
        change = 0.0
        for j in range(1, n):
            for i in range(n_states):
                total = 0.0
                for k in range(n):
                    total += TO_C[table, j, k] * rates[i, k]
                value = start[i] + h * total
                if count > 0:
                    change = max(change, abs(value - states[j, i]) * scale[i])
                states[j, i] = value
        if count > 0:
            if change <= max(COLLOCATION_REMAINDER * problem.tol, 4.0 * EPSILON):
                return count
            if not change < np.inf or (count > 2 and change > 0.9 * last):
                return 1 if change <= 64.0 * EPSILON else 0
            last = change
        for j in range(1, n):
            point[0] = inputs[0] + C[table, j] * h
            for i in range(n_states):
                point[1 + i] = states[j, i]
            call_address(problem.series, mode, point, run.parameters, out)
            for i in range(rates.shape[0]):
                row = columns * (i if i < n_states else i + n_forcing)
                rates[i, j] = out[row + 1]
    return 0


@kernel
def check(problem, run, mode, h, scales, space):
    """Estimate the error of a step from the defect between the collocation points.

    Slow quantities and sliding bounds are evaluated as well.

    Returns
    -------
    float
        The largest integral of the defect (rates minus derivatives of the polynomials),
        relative to the scales of the rows; not finite where the rates are not.
    """
    n_states, n_forcing, n_interfaces = problem.n_states, problem.n_forcing, problem.n_interfaces
    start, scale, rates, defect = space.start, space.scale, space.rates, space.defect
    values, point, out, inputs = space.values, space.point, space.out, run.inputs
    columns, n = problem.order + 1, rates.shape[1]
    table = n - LOWEST
    drift = n_states + n_forcing + n_interfaces
    error = finite = 0.0
    for j in range(n + 2):
        s = F[table, j] if j <= n else WORST[table]
        if j > n and n_forcing == 0:
            break
        point[0] = inputs[0] + s * h
        for i in range(n_states):
            total = 0.0
            if j <= n:
                for k in range(n):
                    total += TO_F[table, j, k] * rates[i, k]
            point[1 + i] = start[i] + h * total
        call_address(problem.series, mode, point, run.parameters, out)
        for k in range(values.shape[0]):
            row = n_states + k if k < n_forcing else drift + k - n_forcing
            values[k, j] = out[row * columns]
            finite += 0.0 * values[k, j] if k < n_forcing else 0.0
        if j > n:
            break
        for i in range(rates.shape[0]):
            row = columns * (i if i < n_states else i + n_forcing)
            slope = 0.0
            for k in range(n):
                slope += AT_F[table, j, k] * rates[i, k]
            defect[i, j] = out[row + 1] - slope
            finite += 0.0 * defect[i, j]
    for i in range(rates.shape[0]):
        for j in range(1, n + 1):
            total = 0.0
            for k in range(n + 1):
                total += INTEGRALS[table, j, k] * defect[i, k]
            error = max(error, abs(h * total) * scale[i])
    for k in range(n_forcing):
        # slow quantities depend on time alone, so the states there do not matter
        between = newton(values[k], F[table], n + 1, WORST[table], space.work)
        difference = abs(between - values[k, n + 1])
        size = max(scales[NOW, n_states + k], abs(values[k, n // 2]))
        if size > 0.0:
            error = max(error, difference / size)
    return error if finite == 0.0 else np.nan


@kernel
def newton(data, points, count, s, work):
    """Evaluate the interpolating polynomial at one point by Neville's scheme."""
    for k in range(count):
        work[k] = data[k]
    for level in range(1, count):
        for k in range(count - level):
            a, b = points[k], points[k + level]
            work[k] = ((s - b) * work[k] + (a - s) * work[k + 1]) / (a - b)
    return work[0]


@kernel
def to_powers(data, points, count, work):
    """Compute the power coefficients of the interpolating polynomial.

    Divided differences, summed by Horner's rule: rounding errors stay at the size of
    those of the data, whereas a matrix with large entries would cancel.
    """
    for k in range(count):
        work[k] = data[k]
    for level in range(1, count):
        for k in range(count - 1, level - 1, -1):
            work[k] = (work[k] - work[k - 1]) / (points[k] - points[k - level])
    for k in range(count - 2, -1, -1):
        # multiply the higher terms by s - points[k]
        for j in range(k, count - 1):
            work[j] -= points[k] * work[j + 1]
