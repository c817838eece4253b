"""Selection of the smooth motion that continues from a point on one or several interfaces."""

from __future__ import annotations

import numpy as np

from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.pointers import call_address, call_with
from fastslow.simulation.stepper.collocation import CollocationStep
from fastslow.simulation.stepper.polynomials import (
    EPSILON,
    ONE,
    ZERO,
    first_above_noise,
    first_nonzero,
)
from fastslow.simulation.stepper.scales import REACHED, own_length, step_length, unsaturated_length

#: Fraction of a step over which the beginning of a motion is judged: over a whole step limited
#: by stability, the last terms of the series are much larger than the motion itself.
BEGINNING = 1.0 / 16.0

#: Before this fraction of a step rounding errors are those of the terms up to the event.
EARLY = 1.0 / 64.0

#: Agreement of a mode with an interface on which it starts.
AGREES, WEAKLY_AGREES, UNDETERMINED, WEAKLY_DISAGREES, DISAGREES = 3, 2, 1, 0, -1

#: No mode agrees; several agree; no candidate has finite rates; the decision needs the
#: collocation code, which is not loaded; it needs a mode that is not formed.
NO_MODE, MANY_MODES, NOT_DEFINED, UNKNOWN_MODE, UNFORMED_MODE = -1, -2, -3, -4, -5

#: Of a model whose motions are formed during a run: no motion has been proposed; none has been
#: found to propose.
UNPROPOSED, NOT_FORMED = -1, -2

#: Step length returned if the step needs code that is not loaded.
MISSING = -1.0


@kernel
def expand(problem, run, mode, longest, W, scales, space, going_on):
    """Fill ``W`` with the polynomials in time of the motion from a point.

    The Taylor series, or a collocation polynomial where its coefficients are not known
    or not finite.

    Parameters
    ----------
    problem : Problem
    run : Run
        Gives the point.
    mode : int
    longest : float
        Maximum useful step length.
    W : float64 array
        Rows of coefficients, filled in.
    scales : float64 array, shape (2, rows)
        Error scales, see `step_length`.
    space : Collocation
    going_on : bool
        Whether this is a step of the run, which continues its last collocation step.

    Returns
    -------
    float
        Length on which the polynomials are valid, NaN if the rates are not finite, `MISSING`
        if collocation is needed and not loaded.
    """
    call_address(problem.series, mode, run.inputs, run.parameters, W)
    return expanded(problem, run, mode, longest, W, scales, space, going_on)


@kernel
def expanded(problem, run, mode, longest, W, scales, space, going_on):
    """`expand` with the series already in ``W``."""
    length = series_length(problem, mode, longest, W, scales)
    if going_on:
        space.memory[0] = 0.0
    if length > 0.0:
        return length
    return collocation_fallback(problem, run, mode, longest, W, scales, space, going_on)


@kernel
def series_length(problem, mode, longest, W, scales):
    """Length on which a series is valid, NaN if it is not finite."""
    rows, order = problem.n_states + problem.n_forcing + problem.n_interfaces, problem.order
    length = step_length(W, rows, order, problem.tol, scales)
    if problem.saturating.shape[1] == 0 or not length > 0.0:
        return length
    arguments, limits = problem.saturating, problem.saturations
    return unsaturated_length(W, order, mode, arguments, limits, length, longest)


@kernel
def collocation_fallback(problem, run, mode, longest, W, scales, space, going_on):
    """Call `collocate`; a separate function keeps the common case short."""
    if problem.collocation == 0:
        return MISSING
    step = CollocationStep(problem, run, mode, longest, W, scales, space, going_on)
    return call_with(problem.collocation, step)


@kernel
def scaled(W, row, order, h, b):
    """Scale the coefficients of one row to the step; return the sum of moduli beyond the first."""
    power = 1.0
    total = 0.0
    for k in range(order + 1):
        b[k] = W[row * (order + 1) + k] * power
        power *= h
        if k > 0:
            total += abs(b[k])
    return total


@kernel
def interface_noise(problem, run, j, gradient):
    """Rounding error of h, from the moduli of its terms; fills the gradient."""
    call_address(problem.series, problem.n_modes + j, run.inputs, run.parameters, gradient)
    return 8.0 * EPSILON * gradient[1]


@kernel
def neighbour_mode(signs, mode, j):
    """The mode on the other side of one interface, or the same mode if there is none."""
    for other in range(signs.shape[0]):
        alike = signs[mode, j] != 0 and signs[other, j] == -signs[mode, j]
        for i in range(signs.shape[1]):
            alike = alike and (i == j or signs[other, i] == signs[mode, i])
        if alike:
            return other
    return mode


@kernel
def laws_after(problem, run, guess, longest, W, scales, search):
    """Find a mode with the laws of the slow quantities that are valid just after an instant.

    The law of a slow quantity differs between regions only across functions of time alone. Their
    sides do not depend on the laws, as those of other interfaces do, and are determined first.

    Parameters
    ----------
    problem : Problem
    run : Run
        Gives the point; its slow quantities are not used.
    guess : int
        The mode that is returned if it has these laws.
    longest : float
    W : float64 array
        Filled with the series of the mode that is returned.
    scales : float64 array
    search : EventSearch
        ``on``, ``side`` and ``noise`` are filled for functions of time alone; ``side`` is the one
        after the instant, 0 if it is not determined.

    Returns
    -------
    int
    """
    signs, on, side = problem.signs, search.on, search.side
    first_h, columns = problem.n_states + problem.n_forcing, problem.order + 1
    call_address(problem.series, guess, run.inputs, run.parameters, W)
    valid = True
    for j in range(problem.first_wall):
        if problem.of_time[j]:
            search.noise[j] = interface_noise(problem, run, j, search.gradient)
            height = search.gradient[0]
            on[j] = search.hit[j] or abs(height) <= search.noise[j]
            side[j] = 1 if height > 0.0 else -1
            if on[j]:
                side[j] = side_after(problem, W, (first_h + j) * columns, longest, search, j)
            valid = valid and side[j] * signs[guess, j] >= 0
    if valid:
        return guess
    for mode in range(signs.shape[0]):
        valid = True
        for j in range(problem.first_wall):
            known = problem.of_time[j]
            valid = valid and (not known or side[j] * signs[mode, j] >= 0)
        if valid:
            call_address(problem.series, mode, run.inputs, run.parameters, W)
            return mode
    return guess


@kernel
def side_after(problem, W, row, longest, search, j):
    """Side of a zero of a function of time just after it, 0 if it is not determined."""
    order, b = problem.order, search.b
    if np.isnan(W[order]):
        # of such a series the first derivatives are known
        return ZERO + (W[row + 1] > 0.0) - (W[row + 1] < 0.0)
    length = min(longest, own_length(W, row, order, problem.tol))
    scaled(W, row // (order + 1), order, BEGINNING * length, b)
    k = first_above_noise(b, ONE, order, search.noise[j])
    if k > order:
        return ZERO
    return ONE if b[k] > 0.0 else -ONE


@kernel
def laws_jump(problem, run, W, scales):
    """Check whether a slow quantity jumps, by more than its error, to its value in a series."""
    found = False
    for i in range(problem.n_states, problem.n_states + problem.n_forcing):
        before, after = run.inputs[1 + i], W[i * (problem.order + 1)]
        size = max(scales[REACHED, i], abs(before), abs(after))
        found = found or abs(after - before) > problem.tol * size
    return found


@kernel
def departs(problem, W, j, side, longest, scales, noise):
    """Check by the drift whether a motion leaves an interface to one side at once.

    With continuous rates no other mode does, so that `choose_mode` would return the same.
    """
    first_h, order = problem.n_states + problem.n_forcing, problem.order
    rows = first_h + problem.n_interfaces
    length = min(longest, step_length(W, rows, order, problem.tol, scales))
    if not length > 0.0:
        return False
    drift = W[(first_h + j) * (order + 1) + 1]
    noise[j] = max(noise[j], 32.0 * EPSILON * abs(drift) * length)
    return drift * side * BEGINNING * length > noise[j]


@kernel
def agreement(b, order, noise, side):
    """Agreement of the motion from an interface with one side of it.

    The first coefficient (Lie derivative) of h above rounding decides; without one, the
    first nonzero coefficient decides weakly; otherwise it is undetermined.
    """
    k = first_above_noise(b, ONE, order, noise)
    if k <= order:
        return AGREES if b[k] * side > 0.0 else DISAGREES
    k = first_nonzero(b, ONE, order)
    if k <= order:
        return WEAKLY_AGREES if b[k] * side > 0.0 else WEAKLY_DISAGREES
    return UNDETERMINED


@kernel
def choose_mode(problem, run, current, W, scales, search, space, proposed):
    """Select the mode in which the solution continues.

    Parameters
    ----------
    problem : Problem
        With continuous rates the continuation is unique, and ambiguity is due to rounding.
    run : Run
        Gives the point.
    current : int
        The previous mode, preferred if the motion remains on the interface.
    W : float64 array
        Work space.
    scales : float64 array
        Error scales of the step over which rounding is judged.
    search : EventSearch
        ``on``: interfaces that contain the point; ``side``: sign of h for the others, and as by
        `laws_after`; ``noise``: rounding error of each h, increased here.
    space : Collocation
    proposed : int
        The mode that is proposed where motions are formed during a run, `UNPROPOSED` or
        `NOT_FORMED`.

    Returns
    -------
    int
        The mode, `NO_MODE`, `MANY_MODES`, `NOT_DEFINED`, `UNKNOWN_MODE` or `UNFORMED_MODE`.
    """
    n_interfaces, n_modes, order = problem.n_interfaces, problem.signs.shape[0], problem.order
    signs, continuous, on, b = problem.signs, problem.continuous, search.on, search.b
    side, noise = search.side, search.noise
    first_h = problem.n_states + problem.n_forcing
    drift = first_h + n_interfaces
    best, best_score, equals = NO_MODE, DISAGREES, 0
    broken, certain = False, True
    for j in range(n_interfaces):
        certain = certain and (continuous[j] or not on[j] or decided(problem, search, j))
    if certain:
        # then even the worst candidate is wrong by rounding only
        best_score = DISAGREES - 1
    # two passes: every mode is judged over the same step, and by the largest rounding error
    shared = longest = run.stop - run.begin
    for judging in (False, True):
        for mode in range(n_modes):
            possible = True
            for j in range(n_interfaces):
                given = not on[j] or decided(problem, search, j)
                if given and signs[mode, j] != side[j]:
                    possible = False
            if problem.forming > 0 and mode != proposed:
                # of the many motions formed so far, those next to the last one
                possible = possible and distance(signs, mode, current) < 2
            if not possible:
                continue
            length = expand(problem, run, mode, longest, W, scales, space, False)
            if length == MISSING:
                return UNKNOWN_MODE
            if not length > 0.0:
                broken = True
                continue
            if not judging:
                shared = min(shared, length)
                for j in range(n_interfaces):
                    drop = abs(W[(first_h + j) * (order + 1) + 1]) * min(length, longest)
                    noise[j] = max(noise[j], 32.0 * EPSILON * drop)
                continue
            score = AGREES
            for j in range(n_interfaces):
                if not on[j] or decided(problem, search, j):
                    continue
                if signs[mode, j] != 0:
                    scaled(W, first_h + j, order, BEGINNING * shared, b)
                    score = min(score, agreement(b, order, noise[j], signs[mode, j]))
                else:
                    row, several = bounds_of(problem, mode, j, drift)
                    length = BEGINNING * shared
                    score = min(
                        score, sliding_agreement(W, row, several, order, length, noise[j], b)
                    )
            if score > best_score:
                best, best_score, equals = mode, score, 1
            elif score == best_score and best != NO_MODE:
                equals += 1
                if mode == current:
                    best = mode
    if problem.forming > 0 and best_score < AGREES and proposed == UNPROPOSED:
        return UNFORMED_MODE
    if equals > 1 and best_score == AGREES and not certain:
        return MANY_MODES
    if best == NO_MODE and proposed >= 0 and not broken:
        # its signs are those of the motion up to rounding
        return proposed
    # a mode that disagrees does not replace one that cannot be evaluated
    return NOT_DEFINED if broken and best_score <= DISAGREES else best


@kernel
def distance(signs, mode, other):
    """Number of interfaces whose signs differ in two modes."""
    found = ZERO
    for i in range(signs.shape[1]):
        found += signs[mode, i] != signs[other, i]
    return found


@kernel
def all_formed(problem, current, j):
    """Check whether the modes that differ from one in the sign of interface j are all formed."""
    signs = problem.signs
    if current < 0 or j < 0:
        return False
    found = ZERO
    for mode in range(signs.shape[0]):
        found += distance(signs, mode, current) == (signs[mode, j] != signs[current, j])
    return found == (2 if problem.continuous[j] else 3)


@kernel
def decided(problem, search, j):
    """Check whether an interface is a function of time alone whose side is determined."""
    return j < problem.first_wall and problem.of_time[j] and search.side[j] != 0


@kernel
def bounds_of(problem, mode, j, first):
    """First of the two bound rows of an interface or wall, and whether they have either order.

    The rows are in the order of the sliding interfaces and walls. Filippov weights on several
    interfaces have either order.
    """
    signs = problem.signs
    before = count = ZERO
    for i in range(signs.shape[1]):
        if signs[mode, i] == 0:
            before += i < j
            count += 1
    return first + 2 * before, count > 1 and j < problem.first_wall


@kernel
def sliding_agreement(W, row, several, order, h, noise, b):
    """Check whether sliding continues: its two bounds have opposite signs, now or next.

    On a single interface these are the drifts on both sides, both towards the interface,
    a < 0 < b; on several, the Filippov weight of one is between −1 and 1 in either order
    of the signs. A drift that moves h by less than its rounding error does not decide.
    """
    columns = order + 1
    small = 32.0 * EPSILON * (abs(W[row * columns]) + abs(W[(row + 1) * columns]))
    small = max(small, noise / h)
    turned = orientation(W, row, several, columns)
    for k in range(2):
        scaled(W, row + k, order, h, b)
        first = first_above_noise(b, ZERO, order, small)
        if first > order or b[first] * (2 * k - 1) * turned < 0.0:
            return DISAGREES
    return AGREES


@kernel
def orientation(W, row, several, columns):
    """−1 if the first of two bounds is the positive one, else 1."""
    return -1.0 if several and W[row * columns] > W[(row + 1) * columns] else 1.0
