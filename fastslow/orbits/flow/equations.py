"""The compiled equations of multiple shooting, and Newton's method in the plane of a prediction.

With the unknowns of `fastslow.orbits.flow.shooting`: the flow of all segments, the rates and
switching functions at their ends, residual and Jacobian, and a point of a branch with its tangent
and the product of the matrices along the orbit. One loop does each of these, because the flow is
most of its code.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address
from fastslow.kernels.compiler.records import Integers, Matrix, Vector
from fastslow.kernels.saltations import fill_saltation
from fastslow.orbits.flow.stepping import (
    BEGUN,
    FACTORS,
    FINISHED,
    ITERATION,
    SEGMENT,
    STEPS,
    flow_segments,
    multiply_column,
    set_constants,
    set_to_identity,
)
from fastslow.simulation.stepper.matrices import factorise_in_place, solve_in_place

#: Ends of segments that are no event: a node, after which a segment follows in the same mode with
#: a fixed ratio of the durations, and the closing of the orbit.
NODE, CLOSING = -1, -2

#: Return code beside those of the flow: Newton's method failed.
FAILED = -3

#: Instead of a number of iterations: the flow of given segments alone, and the linearisation.
FLOW, LINEARISE = -1, 0

#: Newton step after which the equations are not linearised again.
LINEARISED_STEP = 1e-13

#: Newton correction in units of the scales from which the iteration diverges.
DIVERGENT_CORRECTION = 1.0

#: Largest residual and last correction of a point.
POINT_RESIDUAL = 1e-6

#: Square of a growth beyond the range of numbers, or with rates that are not finite.
OVERFLOWING_GROWTH = 1e48

#: Rounding limits Newton's method where every residual is at most this fraction of its terms, 100
#: roundings, and a correction is not smaller than the second fraction of the previous one, both at
#: most the last number: convergence would be quadratic.
ROUNDED_RESIDUAL, STAGNANT, LARGEST_ROUNDED = 100.0 * 2.0**-52, 0.3, 1e-7

#: Places of the numbers of a point: iterations, largest residual, last correction, largest growth
#: along a segment, logarithm of the scale of the product, Liouville's logarithm of the
#: determinant, and the largest difference from it of a segment.
USED, RESIDUAL, ACCURACY, GROWTH, SCALE, LIOUVILLE, DEFECT = range(7)


class ShootingEquations(NamedTuple):
    """What the equations of multiple shooting depend on beside the flow.

    Parameters
    ----------
    field : int
        Address of rates and switching functions with derivatives.
    resets : int
        Address of the states after jumps with derivatives, 0 without jumps.
    period : int
        Address of the period of the forcing with derivatives, 0 without forcing.
    multiple, start : float
        Number of periods of the forcing; time of the first state.
    ends : int64 array, shape (K,)
    numbers : int64 array, shape (K,)
        The jump at the end of every segment, -1 for none.
    jumps : int64 array
        Of every switching function 1 if the rates are discontinuous there.
    places : int64 array, shape (P,)
        Indices of the chosen parameters in the parameter array.
    winding, reference, direction : float64 array, shape (n,)
    durations : float64 array, shape (K,)
        Their ratios at nodes.
    held : int64 array, shape (C,)
        Interfaces along which every segment slides. Each segment conserves their functions, so
        that no event requires them to vanish.
    across : float64 array, shape (n, C)
        Directions across these interfaces.
    """

    field: int
    resets: int
    period: int
    multiple: float
    start: float
    ends: Integers
    numbers: Integers
    jumps: Integers
    places: Integers
    winding: Vector
    reference: Vector
    direction: Vector
    durations: Vector
    held: Integers
    across: Matrix


class Linear(NamedTuple):
    """Unknowns, and the residual and Jacobian of the equations there.

    Parameters
    ----------
    u : float64 array, shape (N + P,)
    residual : float64 array, shape (N,)
    jacobian : float64 array, shape (N, N + P)
    known : float64 array, shape (K, width)
        Rates and switching functions at the ends of the segments.
    point : float64 array, shape (unknowns,)
    other : float64 array, shape (width,)
    reset : float64 array, shape (n + n * unknowns,)
        A state after a jump, with its derivatives.
    slopes, through : float64 array, shape (n, unknowns)
        Derivatives of that state by the state, time and parameters before the jump, and by the
        unknowns at the beginning of the segment.
    """

    u: Vector
    residual: Vector
    jacobian: Matrix
    known: Matrix
    point: Vector
    other: Vector
    reset: Vector
    slopes: Matrix
    through: Matrix


class Newton(NamedTuple):
    """Newton's method in the plane through a guess.

    Parameters
    ----------
    iterations : int
        Largest number, or `FLOW`, or `LINEARISE`.
    tolerance : float
        Correction in units of the scales at which a point is accepted.
    guess, normal, scale : float64 array, shape (N + 1,)
    matrix : float64 array, shape (N + 1, N + 2)
    right, step, tangent : float64 array, shape (N + 1,)
    numbers : float64 array, shape (7,)
    product : float64 array, shape (n, n)
        Product of all matrices along the orbit, divided by a scale.
    """

    iterations: int
    tolerance: float
    guess: Vector
    normal: Vector
    scale: Vector
    matrix: Matrix
    right: Vector
    step: Vector
    tangent: Vector
    numbers: Vector
    product: Matrix


@kernel
def solve_orbit(problem, equations, segments, factors, space, linear, newton):
    """Solve for a point of a branch, or linearise, or compute the flow alone.

    Returns
    -------
    int
        `FINISHED`, `FAILED`, or that of a pause of the flow.
    """
    progress = segments.progress
    while True:
        if progress[BEGUN] == 0 and newton.iterations != FLOW:
            begin(problem, equations, segments, linear)
        code = flow_segments(problem, segments, factors, space)
        if code != FINISHED or newton.iterations == FLOW:
            return code
        progress[BEGUN] = 0
        assemble(problem, equations, segments, linear)
        if newton.iterations == LINEARISE:
            return FINISHED
        if not improve(segments, linear, newton):
            return FAILED
        numbers = newton.numbers
        last = numbers[ACCURACY] <= LINEARISED_STEP or progress[ITERATION] > numbers[USED] > 0.0
        if last:
            if not max(numbers[RESIDUAL], numbers[ACCURACY]) <= POINT_RESIDUAL:
                return FAILED
            find_tangent(newton)
            numbers[GROWTH] = growth_along(problem.n, segments, factors, space, newton)
            multiply(problem, equations, segments, factors, space, linear, newton)
        elif numbers[USED] == 0.0 and progress[ITERATION] >= newton.iterations:
            return FAILED
        for j in range(linear.u.shape[0]):
            linear.u[j] += newton.step[j] * newton.scale[j]
        if last:
            return FINISHED


@kernel
def begin(problem, equations, segments, linear):
    """Fill in the segments at the beginning of the flow."""
    u, n, progress = linear.u, problem.n, segments.progress
    K, N = segments.modes.shape[0], linear.residual.shape[0]
    for i in range(equations.places.shape[0]):
        problem.parameters[equations.places[i]] = u[N + i]
    time = equations.start
    for k in range(K):
        for i in range(n):
            segments.ends[k, i] = u[k * n + i]
        set_to_identity(segments.slopes[k])
        segments.times[k], segments.durations[k] = time, u[K * n + k]
        segments.traces[k] = segments.reached[k] = 0.0
        time += u[K * n + k]
    progress[SEGMENT] = progress[FACTORS] = progress[STEPS] = 0
    progress[BEGUN] = 1


@kernel
def assemble(problem, equations, segments, linear):
    """Fill in residual and Jacobian."""
    n, u, F, J, point = problem.n, linear.u, linear.residual, linear.jacobian, linear.point
    known, slopes, unknowns = linear.known, segments.slopes, problem.unknowns
    K, N, whole = segments.modes.shape[0], F.shape[0], F.shape[0] - 1
    P = u.shape[0] - N
    first_g = n * (unknowns + 1)
    first_slope = known.shape[1] // (unknowns + 1) - n + first_g
    J[:] = 0.0
    total = 0.0
    for p in range(P):
        point[n + 1 + p] = u[N + p]
    for k in range(K):
        end, following, lengths = equations.ends[k], (k + 1) % K * n, K * n
        total += segments.durations[k]
        point[n] = equations.start + total
        set_constants(problem, segments, k)
        jump = equations.numbers[k]
        for i in range(n):
            point[i] = u[following + i]
            if k == K - 1:
                point[i] += equations.winding[i]
            if jump >= 0:
                point[i] = segments.ends[k, i]
        call_address(equations.field, segments.modes[k], point, problem.parameters, known[k])
        if jump >= 0:
            assemble_jump(problem, equations, segments, linear, k)
            continue
        for i in range(n):
            row = k * n + i
            F[row] = segments.ends[k, i] - point[i]
            for j in range(n):
                J[row, k * n + j] = slopes[k, i, j]
            J[row, following + i] -= 1.0
            for j in range(k):
                J[row, lengths + j] = slopes[k, i, n]
            J[row, lengths + k] = known[k, i]
            for p in range(P):
                J[row, N + p] = slopes[k, i, n + 1 + p]
        if k == K - 1:
            hold(equations, linear, k, first_g, first_slope)
        row = lengths + k
        if end >= 0:
            g = first_slope + end * unknowns
            F[row] = known[k, first_g + end]
            for j in range(n):
                J[row, following + j] = known[k, g + j]
            for j in range(k + 1):
                J[row, lengths + j] = known[k, g + n]
            for p in range(P):
                J[row, N + p] = known[k, g + n + 1 + p]
        elif end == NODE:
            mean = 0.5 * (equations.durations[k] + equations.durations[k + 1])
            own, other = equations.durations[k] / mean, equations.durations[k + 1] / mean
            F[row] = other * segments.durations[k] - own * segments.durations[k + 1]
            J[row, lengths + k], J[row, lengths + k + 1] = other, -own
        else:
            F[row] = total - u[whole]
            for j in range(K):
                J[row, lengths + j] = 1.0
            J[row, whole] = -1.0
    if equations.period != 0:
        forced, m = linear.other, equations.multiple
        call_address(equations.period, 0, point, problem.parameters, forced)
        F[whole] = u[whole] - m * forced[0]
        J[whole, whole] = 1.0
        for p in range(P):
            J[whole, N + p] = -m * forced[2 + n + p]
    else:
        F[whole] = 0.0
        for i in range(n):
            F[whole] += equations.direction[i] * (u[i] - equations.reference[i])
            J[whole, i] = equations.direction[i]


@kernel
def hold(equations, linear, k, first_g, first_slope):
    """Add the functions of the interfaces on which the orbit slides all the time to its closing.

    The end minus the start has no component across them, since they are conserved.
    """
    F, J, known = linear.residual, linear.jacobian, linear.known[k]
    n, unknowns = linear.slopes.shape
    K, N = equations.ends.shape[0], F.shape[0]
    for c in range(equations.held.shape[0]):
        end = equations.held[c]
        g = first_slope + end * unknowns
        for i in range(n):
            row, size = k * n + i, equations.across[i, c]
            F[row] += size * known[first_g + end]
            for j in range(n):
                J[row, j] += size * known[g + j]
            for j in range(K):
                J[row, K * n + j] += size * known[g + n]
            for p in range(J.shape[1] - N):
                J[row, N + p] += size * known[g + n + 1 + p]


@kernel
def evaluate_jump(problem, equations, linear, k):
    """Compute the state after the jump at the end of a segment, with its derivatives."""
    n, unknowns = linear.slopes.shape
    call_address(
        equations.resets, equations.numbers[k], linear.point, problem.parameters, linear.reset
    )
    for i in range(n):
        for c in range(unknowns):
            linear.slopes[i, c] = linear.reset[n + i * unknowns + c]


@kernel
def assemble_jump(problem, equations, segments, linear, k):
    """Fill in the rows of a segment that ends with a jump: R(z) is the next state, where h(z) = 0.

    With the state z at the end of the flow, of which the rates and switching functions are known.
    """
    n, u, F, J, known = problem.n, linear.u, linear.residual, linear.jacobian, linear.known[k]
    R, through, flow = linear.slopes, linear.through, segments.slopes[k]
    K, N, unknowns = segments.modes.shape[0], F.shape[0], problem.unknowns
    following, lengths, end = (k + 1) % K * n, K * n, equations.ends[k]
    first_g = n * (unknowns + 1)
    g = known.shape[0] // (unknowns + 1) - n + first_g + end * unknowns
    evaluate_jump(problem, equations, linear, k)
    for i in range(n + 1):
        row = k * n + i if i < n else lengths + k
        # derivatives by the first state, an earlier duration, the parameters, and the duration
        direct = R[i, n] if i < n else known[g + n]
        last = direct
        for c in range(unknowns):
            value = 0.0
            if c >= n:
                value = R[i, c] if i < n else known[g + c]
            for j in range(n):
                slope = R[i, j] if i < n else known[g + j]
                value += slope * flow[j, c]
            through[0, c] = value
        for j in range(n):
            slope = R[i, j] if i < n else known[g + j]
            last += slope * known[j]
        if i < n:
            F[row] = linear.reset[i] - u[following + i]
            if k == K - 1:
                F[row] -= equations.winding[i]
        else:
            F[row] = known[first_g + end]
        for j in range(n):
            J[row, k * n + j] = through[0, j]
        if i < n:
            J[row, following + i] -= 1.0
        for j in range(k):
            J[row, lengths + j] = through[0, n]
        J[row, lengths + k] = last
        for p in range(u.shape[0] - N):
            J[row, N + p] = through[0, n + 1 + p]


@kernel
def improve(segments, linear, newton):
    """Compute a Newton step; return whether it is finite."""
    u, F, J = linear.u, linear.residual, linear.jacobian
    scale, matrix, right, numbers = newton.scale, newton.matrix, newton.right, newton.numbers
    progress, N = segments.progress, F.shape[0]
    for k in range(segments.modes.shape[0]):
        if segments.reached[k] != segments.durations[k]:
            return False
    progress[ITERATION] += 1
    residual, rounded = 0.0, True
    for i in range(N + 1):
        largest = terms = 0.0
        for j in range(N + 1):
            value = newton.normal[j] if i == N else J[i, j]
            matrix[i, j] = value * scale[j]
            largest = max(largest, abs(matrix[i, j]))
            terms += abs(value * u[j])
        if i < N:
            right[i] = -F[i]
            rounded = rounded and abs(F[i]) <= ROUNDED_RESIDUAL * terms
        else:
            right[i] = 0.0
            for j in range(N + 1):
                right[i] += (newton.guess[j] - u[j]) * newton.normal[j]
        if not 0.0 < largest < math.inf:
            return False
        for j in range(N + 1):
            matrix[i, j] /= largest
        right[i] /= largest
        if i < N:
            residual = max(residual, abs(right[i]))
    if not factorise_in_place(matrix, N + 1):
        return False
    solve_in_place(matrix, right, newton.step, N + 1)
    size = 0.0
    for j in range(N + 1):
        if not abs(newton.step[j]) < math.inf:
            return False
        size = max(size, abs(newton.step[j]))
    if size > DIVERGENT_CORRECTION:
        return False
    previous = math.inf if progress[ITERATION] == 1 else numbers[ACCURACY]
    numbers[RESIDUAL], numbers[ACCURACY] = residual, size
    if progress[ITERATION] == 1:
        numbers[USED] = 0.0
    if numbers[USED] == 0.0:
        if size <= newton.tolerance:
            numbers[USED] = progress[ITERATION]
        elif rounded and STAGNANT * previous <= size and max(size, previous) <= LARGEST_ROUNDED:
            numbers[USED] = progress[ITERATION] - 1
    return True


@kernel
def find_tangent(newton):
    """The null vector of the Jacobian, a unit vector in units of the scales, along the normal."""
    right, along = newton.right, newton.tangent
    size = right.shape[0]
    for j in range(size):
        right[j] = 0.0
    right[size - 1] = 1.0
    solve_in_place(newton.matrix, right, along, size)
    square = 0.0
    for j in range(size):
        square += along[j] * along[j]
    length = math.sqrt(square)
    for j in range(size):
        along[j] *= newton.scale[j] / length


@kernel
def growth_along(n, segments, factors, space, newton):
    """Largest growth of a perturbation between two times of a segment.

    In units of the first state, see `fastslow.orbits.flow.problem.growth_of`.
    """
    unit, whole, step = newton.scale, space.factor, space.step
    K = segments.modes.shape[0]
    square = 0.0
    for k in range(K):
        square = max(square, norm_squared(segments.slopes[k], unit, n))
    used = segments.progress[FACTORS]
    for first in range(used):
        set_to_identity(whole)
        for place in range(first, used):
            if factors.owners[place] != factors.owners[first]:
                break
            for i in range(n):
                for j in range(n):
                    step[i, j] = factors.matrices[place, i, j]
            for c in range(n):
                multiply_column(step, whole, c, space.column)
            square = max(square, norm_squared(whole, unit, n))
    return math.sqrt(square)


@kernel
def norm_squared(matrix, unit, n):
    """Square of the Frobenius norm in units, `OVERFLOWING_GROWTH` if it is not finite."""
    square = 0.0
    for i in range(n):
        for j in range(n):
            value = matrix[i, j] * unit[j] / unit[i]
            square += value * value
    return square if square < math.inf else OVERFLOWING_GROWTH


@kernel
def multiply(problem, equations, segments, factors, space, linear, newton):
    """Multiply all matrices along the orbit, with Liouville's formula for their determinant."""
    n, product, numbers = problem.n, newton.product, newton.numbers
    step, column, lower, point = space.step, space.column, space.lower, linear.point
    K, N, unknowns = segments.modes.shape[0], linear.residual.shape[0], problem.unknowns
    first_slope = linear.known.shape[1] // (unknowns + 1) - n + n * (unknowns + 1)
    set_to_identity(product)
    numbers[SCALE] = numbers[LIOUVILLE] = numbers[DEFECT] = 0.0
    place = 0
    for p in range(linear.u.shape[0] - N):
        point[n + 1 + p] = linear.u[N + p]
    for k in range(K):
        total = 0.0
        while place < segments.progress[FACTORS] and factors.owners[place] == k:
            for i in range(n):
                for j in range(n):
                    step[i, j] = lower[i, j] = factors.matrices[place, i, j]
            if not factorise_in_place(lower, n):
                total = -math.inf
            for i in range(n):
                total += math.log(abs(lower[i, i]))
            numbers[SCALE] += multiply_by(step, product, column)
            place += 1
        numbers[DEFECT] = max(numbers[DEFECT], abs(total - segments.traces[k]))
        numbers[LIOUVILLE] += segments.traces[k]
        end, jump = equations.ends[k], equations.numbers[k]
        if end >= 0 and (jump >= 0 or equations.jumps[end] != 0):
            following, f, g = (k + 1) % K, linear.known[k], first_slope + end * unknowns
            for i in range(n):
                point[i] = segments.ends[k, i]
            point[n] = segments.times[k] + segments.durations[k]
            set_constants(problem, segments, k)
            if jump >= 0:
                evaluate_jump(problem, equations, linear, k)
            else:
                linear.slopes[:] = 0.0
                for i in range(n):
                    linear.slopes[i, i] = 1.0
            for i in range(n):
                point[i] = linear.u[following * n + i]
                if k == K - 1:
                    point[i] += equations.winding[i]
            set_constants(problem, segments, following)
            after, mode = linear.other, segments.modes[following]
            call_address(equations.field, mode, point, problem.parameters, after)
            fill_saltation(f[:n], after[:n], f[g : g + unknowns], linear.slopes, linear.through)
            if jump >= 0:
                for i in range(n):
                    for j in range(n):
                        lower[i, j] = linear.through[i, j]
                if not factorise_in_place(lower, n):
                    numbers[LIOUVILLE] = -math.inf
                for i in range(n):
                    numbers[LIOUVILLE] += math.log(abs(lower[i, i]))
            else:
                before = beyond = f[g + n]
                for i in range(n):
                    before += f[g + i] * f[i]
                    beyond += f[g + i] * after[i]
                numbers[LIOUVILLE] += math.log(abs(beyond / before))
            numbers[SCALE] += multiply_by(linear.through, product, column)


@kernel
def multiply_by(step, product, column):
    """Multiply a product by a matrix, and divide it by its largest entry; return its logarithm."""
    n = product.shape[0]
    size = 0.0
    for c in range(n):
        multiply_column(step, product, c, column)
        for i in range(n):
            size = max(size, abs(product[i, c]))
    if not size > 0.0:
        return 0.0
    for i in range(n):
        for c in range(n):
            product[i, c] /= size
    return math.log(size)
