"""Compiled integration of the passage of a special point by Radau IIA steps.

The variables in one region are z = (x - x*, w - w*), with x' = F(x, w) by the compiled
function of a frozen model and w' by a drift. The steps are those of
`fastslow.simulation.stepper.radau` (Hairer and Wanner 1996, section IV.8), which follow a slow
manifold for any stiffness. Events are located by varying the length of the last step, and are
thus as accurate as the steps.

These are no calls of `fastslow.simulate`. As runs of the frozen model with w as a slow state and
``stop=``, 56 passages of folds, corners and gaps (among them a fold beside a mode of rate 1e9)
are as accurate (relative errors of at most 4e-13 at ``rtol=1e-13``; here at most 3e-11, with
median 3e-14), but take 35 times as long (12 to 77 times; 18 ms instead of 0.5 ms), and up to
0.3 s before the first one, for the compilation of that model. Here the field is the one that
continuation has compiled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

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
from fastslow.simulation.stepper.matrices import solve_in_place
from fastslow.simulation.stepper.polynomials import EPSILON
from fastslow.simulation.stepper.radau import (
    BETWEEN,
    POWERS,
    STAGES,
    VALUES,
    WITHIN,
    C,
    factorise_stages,
    newton_iteration,
)

#: Error tolerance within a step, where the order is STAGES + 1. At its end the order is
#: 2 STAGES, with about 1e-11 over a passage (Hairer and Wanner 1996, section IV.8).
STEP_TOLERANCE = 5e-10

#: Deviation, in a state's unit, below which the tolerance is absolute.
ABSOLUTE_BELOW = 1e-3

#: Largest last change of Newton's method, relative to the scale of a state.
NEWTON_CHANGE = 1e-13

#: Stagnating change of Newton's method, relative to the scale, that counts as rounding.
STAGNATION = 1e-8

#: Largest numbers of Newton iterations and of steps.
RADAU_ITERATIONS, RADAU_STEPS = 16, 200_000

#: Largest ratio of successive step lengths.
STEP_RATIO = 4.0

#: Events that end a passage besides interfaces: none, w = w*, an extremum of w, a level.
INTERFACES, PASSING, TURNING, LEVEL = range(4)

#: Status of a passage.
ENDED, TOO_LONG, FAILED = range(3)


class LocalMotion(NamedTuple):
    """Vector field of a region, for compiled code.

    Parameters
    ----------
    address, region : int
        Address of the frozen model's compiled function, and the region.
    parameters : ndarray
    width : int
        Length of the function's output.
    point : ndarray, shape (n + 1,)
        The special point (x*, w*).
    signs : ndarray
        Signs of the interface functions within the region.
    """

    address: int
    region: int
    parameters: Vector
    width: int
    point: Vector
    signs: Vector


class Law(NamedTuple):
    """Law of a drift, for compiled code; w' is the sum of the terms given.

    Parameters
    ----------
    rate, change : float
    gradient : ndarray, shape (n + 1,)
    breaks, coefficients : ndarray
        Piecewise Chebyshev table over time, empty for none.
    address : int
        Address of a compiled function, 0 for none.
    numbers : ndarray
        Its parameters.
    """

    rate: float
    change: float
    gradient: Vector
    breaks: Vector = np.empty(0)
    coefficients: Matrix = np.empty((0, 0))
    address: int = 0
    numbers: Vector = np.empty(0)


class PassageSpace(NamedTuple):
    """Workspace of compiled code.

    Parameters
    ----------
    out, inputs, slopes
        Output and input of the compiled functions.
    jacobian, factors, given, moved
        Linear systems of a step.
    stages, increments, kept : ndarray, shape (STAGES, n + 1)
        Rates and increments at the stages of a step, and increments of the last one.
    start, place, rates, scale, speeds : ndarray, shape (n + 1,)
    heights : ndarray, shape (STAGES, count + 1)
    here, floor, beyond : ndarray, shape (count + 1,)
        Values for the interfaces and the event.
    """

    out: Vector
    inputs: Vector
    slopes: Vector
    jacobian: Matrix
    factors: ComplexTensor
    given: ComplexVector
    moved: ComplexMatrix
    stages: Matrix
    increments: Matrix
    kept: Matrix
    start: Vector
    place: Vector
    rates: Vector
    scale: Vector
    speeds: Vector
    heights: Matrix
    here: Vector
    floor: Vector
    beyond: Vector


class RadauEnd(NamedTuple):
    """Event that ends a passage, for compiled code.

    Parameters
    ----------
    kind : int
        0 an interface only, 1 w = w*, 2 an extremum of w, 3 a level.
    number : int
        Index of the state that reaches a level.
    height : float
        Height of the level above the point.
    way : float
        Direction of the drift.
    """

    kind: int
    number: int
    height: float
    way: float


def space_for(n: int, count: int, width: int) -> PassageSpace:
    """Allocate the workspace for n states and a number of interfaces."""
    size, pairs = n + 1, len(VALUES)
    shapes = (width, size + 1, size + 2, (size, size), (pairs, size, size + 1), size, (pairs, size))
    stages, ends = [(STAGES, size)] * 3, [count + 1] * 3
    return zeros(PassageSpace, *shapes, *stages, *[size] * 5, (STAGES, count + 1), *ends)


@kernel
def pass_through(motion, law, end, z, times, unit, space):
    """Integrate within one region up to an event or an interface.

    Parameters
    ----------
    motion : LocalMotion
    law : Law
    end : RadauEnd
    z : ndarray, shape (n + 1,)
        (x - x*, w - w*) at the start, overwritten by the final value.
    times : ndarray, shape (2,)
        Start, overwritten by the final time, and latest time.
    unit : ndarray, shape (n + 1,)
        Units of z.
    space : PassageSpace

    Returns
    -------
    met : int
        Index of the interface that ended it, -1 for none.
    status : int
        ENDED, TOO_LONG or FAILED.
    """
    size, count = z.shape[0], motion.signs.shape[0]
    scale, rates, Z, kept = space.scale, space.speeds, space.increments, space.kept
    heights, here, floor = space.heights, space.here, space.floor
    for j in range(STAGES):
        for i in range(size):
            Z[j, i] = kept[j, i] = 0.0
    t, final = times[0], times[1]
    rates_at(motion, law, t, z, space, rates)
    heights_of(motion, end, z, rates, space, 1.0, here)
    out = space.out
    first = out.shape[0] - (out.shape[0] // (size + 1) - size + 1) * size
    for k in range(count):
        noise = 0.0
        for i in range(size):
            noise += abs(out[first + k * size + i] * (motion.point[i] + z[i]))
        # the interface just crossed is reached up to rounding
        floor[k] = min(here[k], 0.0) - 4.0 * EPSILON * noise
    floor[count] = 0.0
    sense = math.copysign(1.0, here[count])
    here[count] *= sense
    h = final - t
    for i in range(size):
        if rates[i] != 0.0:
            h = min(h, 0.01 * (abs(z[i]) + ABSOLUTE_BELOW * unit[i]) / abs(rates[i]))
    last, beyond = 0.0, space.beyond
    # bracket (low, high) of the length of the last step, with the values left and right of the
    # height that becomes negative
    low = high = left = right = 0.0
    met, side = -1, 0
    for _ in range(RADAU_STEPS):
        if met < 0:
            if not t < final:
                return -1, TOO_LONG
            h = min(h, final - t)
            if not t + 1e-3 * h > t:
                return -1, FAILED
            for i in range(size):
                noise = 64.0 * EPSILON * abs(motion.point[i]) / STEP_TOLERANCE
                scale[i] = max(abs(z[i]) + ABSOLUTE_BELOW * unit[i], noise)
            continued(kept, last, h, Z)
        else:
            fine = EPSILON * max(abs(t), abs(t + high))
            if not high - low > 2.0 * fine:
                other = another(beyond, floor, met)
                if other < 0:
                    for i in range(size):
                        z[i] += kept[STAGES - 1, i]
                    times[0] = t + high
                    return met if met < count else -1, ENDED
                met, side, low = other, 0, 0.0
                left, right = here[met] - floor[met], beyond[met] - floor[met]
                continue
            # an estimate at an end is moved inside, so that the other end moves
            h = min(max(between(low, high, left, right), low + fine), high - fine)
            for j in range(STAGES):
                for i in range(size):
                    Z[j, i] = kept[j, i] * h / high
        error = step(motion, law, end, t, z, h, sense, space)
        if met >= 0:
            if not error < np.inf:
                return -1, FAILED
            # regula falsi with the value at the retained end halved (Illinois)
            value = heights[STAGES - 1, met] - floor[met]
            if value <= 0.0:
                left = 0.5 * left if side > 0 else left
                high, right, side = h, value, 1
                low = low if value < 0.0 else h
                copied(Z, kept)
                for k in range(count + 1):
                    beyond[k] = heights[STAGES - 1, k]
            else:
                right = 0.5 * right if side < 0 else right
                low, left, side = h, value, -1
            continue
        if not error <= 1.0:
            known = error < np.inf
            h *= max(0.1, 0.9 * error ** (-1.0 / (STAGES + 1))) if known else 0.25
            last = last if known else 0.0
            continue
        stage = first_below(heights, floor)
        if stage < STAGES - 1:
            # shorten the step to that stage first
            h *= C[stage]
            continue
        copied(Z, kept)
        if stage < STAGES:
            for k in range(count + 1):
                beyond[k] = heights[stage, k]
            met = another(beyond, floor, -1)
            low, high, side = 0.0, h, 0
            left, right = here[met] - floor[met], beyond[met] - floor[met]
            continue
        for i in range(size):
            z[i] += Z[STAGES - 1, i]
            if not abs(z[i]) < np.inf:
                return -1, FAILED
        for k in range(count + 1):
            here[k] = heights[STAGES - 1, k]
        t = t + h
        times[0] = t
        last = h
        h *= min(STEP_RATIO, 0.9 * error ** (-1.0 / (STAGES + 1))) if error > 0.0 else STEP_RATIO
    return -1, FAILED


@kernel
def copied(values, into):
    """Copy the values of all stages."""
    for j in range(values.shape[0]):
        for i in range(values.shape[1]):
            into[j, i] = values[j, i]


@kernel
def first_below(heights, floor):
    """First stage at which a height is below its floor, STAGES if none."""
    for j in range(STAGES):
        if another(heights[j], floor, -1) >= 0:
            return j
    return STAGES


@kernel
def another(heights, floor, met):
    """Index of a height below its floor, other than ``met``; -1 if none."""
    found = -1
    for k in range(floor.shape[0]):
        if k != met and heights[k] < floor[k]:
            found = k
    return found


@kernel
def between(low, high, left, right):
    """Zero of the straight line through two values, or the midpoint."""
    found = (low * right - high * left) / (right - left) if right < left else low
    return found if low < found < high else 0.5 * (low + high)


@kernel
def continued(kept, last, h, Z):
    """Extrapolate the increments of the last step as initial guess of the next."""
    # the polynomial of the last step is not extrapolated far
    known = last > 0.0 and h <= 2.5 * last
    for i in range(Z.shape[1]):
        for j in range(STAGES):
            Z[j, i] = 0.0
        if not known:
            continue
        for k in range(STAGES - 1, -1, -1):
            coefficient = 0.0
            for m in range(STAGES):
                coefficient += POWERS[k, m] * kept[m, i]
            for j in range(STAGES):
                s = 1.0 + C[j] * h / last
                Z[j, i] += coefficient * (s ** (k + 1) - 1.0)


@kernel
def rates_at(motion, law, t, z, space, rates):
    """Evaluate the rates and all outputs of the compiled function at a point."""
    out, inputs, slopes = space.out, space.inputs, space.slopes
    size = z.shape[0]
    for i in range(size):
        inputs[i] = motion.point[i] + z[i]
    call_address(motion.address, motion.region, inputs, motion.parameters, out)
    for i in range(size - 1):
        rates[i] = out[i]
    speed = law.rate + law.change * t
    for i in range(size):
        speed += law.gradient[i] * z[i]
    if law.breaks.shape[0] > 1:
        speed += by_table(law.breaks, law.coefficients, t)
    if law.address != 0:
        inputs[size] = t
        call_address(law.address, 0, inputs, law.numbers, slopes)
        speed += slopes[0]
    rates[size - 1] = speed


@kernel
def by_table(breaks, coefficients, t):
    """Evaluate a piecewise Chebyshev sum by Clenshaw's algorithm."""
    low, high = 0, breaks.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if breaks[middle] <= t:
            low = middle
        else:
            high = middle
    s = (2.0 * t - breaks[low] - breaks[low + 1]) / (breaks[low + 1] - breaks[low])
    one = other = 0.0
    for k in range(coefficients.shape[1] - 1, 0, -1):
        one, other = 2.0 * s * one - other + coefficients[low, k], one
    return s * one - other + coefficients[low, 0]


@kernel
def heights_of(motion, end, z, rates, space, sense, heights):
    """Interface functions, nonnegative within the region, and the event function."""
    out, size, count = space.out, z.shape[0], motion.signs.shape[0]
    first = (size - 1) * (size + 1)
    for k in range(count):
        heights[k] = motion.signs[k] * out[first + k]
    value = 1.0
    if end.kind == PASSING:
        value = end.way * z[size - 1]
    elif end.kind == TURNING:
        value = end.way * rates[size - 1]
    elif end.kind == LEVEL:
        value = z[end.number] - end.height
    heights[count] = sense * value if end.kind != INTERFACES else 1.0


@kernel
def step(motion, law, end, t, z, h, sense, space):
    """Compute one step: increments and heights at its stages, from an initial guess.

    Returns
    -------
    float
        Error relative to the tolerance, infinite if the equations are not solved.
    """
    out, slopes, jacobian, factors = space.out, space.slopes, space.jacobian, space.factors
    given, moved, F = space.given, space.moved, space.stages
    start, place, rates = space.start, space.place, space.rates
    scale, Z, heights = space.scale, space.increments, space.heights
    size = z.shape[0]
    rates_at(motion, law, t, z, space, start)
    n = size - 1
    for i in range(n):
        for k in range(size):
            jacobian[i, k] = out[n + i * size + k]
    for k in range(size):
        jacobian[n, k] = law.gradient[k] + (slopes[1 + k] if law.address != 0 else 0.0)
    if not factorise_stages(jacobian, h, factors):
        return np.inf
    before, done = np.inf, False
    for turn in range(RADAU_ITERATIONS):
        for j in range(STAGES):
            for i in range(size):
                place[i] = z[i] + Z[j, i]
            rates_at(motion, law, t + C[j] * h, place, space, F[j])
            if done:
                heights_of(motion, end, place, F[j], space, sense, heights[j])
        if done:
            break
        if not newton_iteration(F, h, factors, given, moved, Z):
            return np.inf
        largest = 0.0
        for i in range(size):
            for j in range(STAGES):
                largest = max(largest, abs(F[j, i]) / scale[i])
        done = largest <= NEWTON_CHANGE or (largest <= STAGNATION and largest > 0.3 * before)
        if not done and turn > 1 and not largest <= 0.9 * before:
            return np.inf
        before = largest
    if not done:
        return np.inf
    # largest defects of the rates, filtered by the method
    error = 0.0
    for which in range(2):
        s = BETWEEN if which == 1 else 0.0
        for i in range(size):
            value = slope = 0.0
            for k in range(STAGES - 1, -1, -1):
                coefficient = 0.0
                for j in range(STAGES):
                    coefficient += POWERS[k, j] * Z[j, i]
                value = (value + coefficient) * s
                slope = slope * s + (k + 1) * coefficient
            place[i], given[i] = z[i] + value, -slope / h
        if which == 1:
            rates_at(motion, law, t + s * h, place, space, rates)
        for i in range(size):
            given[i] += rates[i] if which == 1 else start[i]
        solve_in_place(factors[0], given, moved[0], size)
        for i in range(size):
            share = abs(moved[0, i].real) * (1.0 if which == 1 else WITHIN)
            if not share < np.inf:
                return np.inf
            error = max(
                error, share / (STEP_TOLERANCE * max(scale[i], abs(z[i] + Z[STAGES - 1, i])))
            )
    return error
