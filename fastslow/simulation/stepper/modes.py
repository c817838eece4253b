"""Which smooth motion goes on from a point on one or several interfaces."""

from __future__ import annotations

from fastslow.kernels.decorators import kernel
from fastslow.kernels.pointers import call_address, call_with
from fastslow.simulation.stepper.collocation import CollocationStep
from fastslow.simulation.stepper.polynomials import EPSILON, ONE, ZERO, first_nonzero, first_strong
from fastslow.simulation.stepper.scales import step_length

#: The part of a step over which the beginning of a motion is judged: over a whole one that
#: stability limits, the last terms of the series are much larger than the motion itself.
BEGINNING = 1.0 / 16.0

#: How well a mode agrees with an interface that it starts on.
AGREES, WEAKLY_AGREES, UNDETERMINED, WEAKLY_DISAGREES, DISAGREES = 3, 2, 1, 0, -1

#: No mode agrees; more than one does; the rates of none that could are finite; this is not known
#: before the code for collocation is there.
NO_MODE, MANY_MODES, NOT_DEFINED, UNKNOWN_MODE = -1, -2, -3, -4

#: The length of a step that needs code which is not there yet.
MISSING = -1.0


@kernel
def expand(problem, run, mode, longest, W, scales, space, going_on):
    """Fill ``W`` with polynomials of time from a point on.

    The Taylor series where there is one; else, where its coefficients are not
    known or not finite, a collocation polynomial.

    Parameters
    ----------
    problem : Problem
    run : Run
        Where.
    mode : int
    longest : float
        Longest step that is of use.
    W : float64 array
        Rows of coefficients, filled here.
    scales : float64 array, shape (2, rows)
        In which errors are measured, see `step_length`.
    space : Collocation
    going_on : bool
        Whether this is a step of the run, which goes on from the last one by collocation.

    Returns
    -------
    float
        How far the polynomials hold, NaN where the rates are not finite, `MISSING` where
        collocation is needed and is not there.
    """
    call_address(problem.series, mode, run.inputs, run.parameters, W)
    return expanded(problem, run, mode, longest, W, scales, space, going_on)


@kernel
def expanded(problem, run, mode, longest, W, scales, space, going_on):
    """`expand` where the series is there already."""
    rows = problem.n_states + problem.n_forcing + problem.n_interfaces
    length = step_length(W, rows, problem.order, problem.tol, scales)
    if going_on:
        space.memory[0] = 0.0
    if length > 0.0:
        return length
    return collocation_fallback(problem, run, mode, longest, W, scales, space, going_on)


@kernel
def collocation_fallback(problem, run, mode, longest, W, scales, space, going_on):
    """Call `collocate`: apart, so that the common case stays short."""
    if problem.collocation == 0:
        return MISSING
    step = CollocationStep(problem, run, mode, longest, W, scales, space, going_on)
    return call_with(problem.collocation, step)


@kernel
def scaled(W, row, order, h, b):
    """Scale the coefficients of one row to the step, and sum their moduli but the first."""
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
    """Size of h that is rounding error, from the moduli of its terms; fills the gradient."""
    call_address(problem.series, problem.n_modes + j, run.inputs, run.parameters, gradient)
    return 8.0 * EPSILON * gradient[1]


@kernel
def neighbour_mode(signs, mode, j):
    """The mode on the other side of one interface, the same mode where there is none."""
    for other in range(signs.shape[0]):
        alike = signs[mode, j] != 0 and signs[other, j] == -signs[mode, j]
        for i in range(signs.shape[1]):
            alike = alike and (i == j or signs[other, i] == signs[mode, i])
        if alike:
            return other
    return mode


@kernel
def departs(problem, W, j, side, longest, scales, noise):
    """Whether a motion from an interface goes to one side at once, by its drift.

    Where the rates are continuous it does so in no other mode, as `choose_mode`
    would find by looking at them all.
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
    """How the motion away from an interface agrees with one side of it.

    The first coefficient (Lie derivative) of h above the noise decides; where
    there is none, the first that is not exactly zero leans; else it rests.
    """
    k = first_strong(b, ONE, order, noise)
    if k <= order:
        return AGREES if b[k] * side > 0.0 else DISAGREES
    k = first_nonzero(b, ONE, order)
    if k <= order:
        return WEAKLY_AGREES if b[k] * side > 0.0 else WEAKLY_DISAGREES
    return UNDETERMINED


@kernel
def choose_mode(problem, run, current, longest, W, scales, search, space):
    """The mode in which the solution goes on.

    Parameters
    ----------
    problem : Problem
        Where the rates are continuous there is one way on, and doubt is rounding.
    run : Run
        Where.
    current : int
        The mode before, preferred where the motion rests on the interface.
    longest : float
    scales : float64 array
        The step over which rounding is judged: its longest length, and in which scales.
    W : float64 array
        Work space.
    search : Search
        ``on`` says on which interfaces the point lies, ``side`` the sign of h for the
        others; ``noise`` holds the rounding error of each h and grows here.
    space : Collocation

    Returns
    -------
    int
        The mode, `NO_MODE`, `MANY_MODES`, `NOT_DEFINED` or `UNKNOWN_MODE`.
    """
    n_interfaces, n_modes, order = problem.n_interfaces, problem.n_modes, problem.order
    signs, continuous, on, b = problem.signs, problem.continuous, search.on, search.b
    side, noise = search.side, search.noise
    first_h = problem.n_states + problem.n_forcing
    drift = first_h + n_interfaces
    best, best_score, equals = NO_MODE, DISAGREES, 0
    broken, certain = False, True
    for j in range(n_interfaces):
        certain = certain and (continuous[j] or not on[j])
    if certain:
        # even the worst is then only as wrong as rounding
        best_score = DISAGREES - 1
    # two passes: every mode is judged over the same step, and by the largest rounding error
    shared = longest
    for judging in (False, True):
        for mode in range(n_modes):
            possible = True
            for j in range(n_interfaces):
                if not on[j] and signs[mode, j] != side[j]:
                    possible = False
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
                if not on[j]:
                    continue
                if signs[mode, j] != 0:
                    scaled(W, first_h + j, order, BEGINNING * shared, b)
                    score = min(score, agreement(b, order, noise[j], signs[mode, j]))
                else:
                    row, several = bounds_of(signs, mode, j, drift)
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
    if equals > 1 and best_score == AGREES and not certain:
        return MANY_MODES
    # one that disagrees is not taken in the place of one that is not known
    return NOT_DEFINED if broken and best_score <= DISAGREES else best


@kernel
def bounds_of(signs, mode, j, first):
    """The first of the two rows that bound sliding along an interface, and whether others slide.

    The rows follow one another in the order of the interfaces that are slid along.
    """
    before = count = ZERO
    for i in range(signs.shape[1]):
        if signs[mode, i] == 0:
            before += i < j
            count += 1
    return first + 2 * before, count > 1


@kernel
def sliding_agreement(W, row, several, order, h, noise, b):
    """Whether sliding goes on along an interface: its two bounds have opposite signs, now or next.

    Along a single interface these are the drifts on both sides, and both point at the
    interface, a < 0 < b; along several, the weight of one lies between −1 and 1 in
    either order of the signs. A drift that moves h by less than its noise decides as
    little here as it does of the motion to that side: where sliding ends, one of
    them goes on.
    """
    columns = order + 1
    small = 32.0 * EPSILON * (abs(W[row * columns]) + abs(W[(row + 1) * columns]))
    small = max(small, noise / h)
    turned = orientation(W, row, several, columns)
    for k in range(2):
        scaled(W, row + k, order, h, b)
        first = first_strong(b, ZERO, order, small)
        if first > order or b[first] * (2 * k - 1) * turned < 0.0:
            return DISAGREES
    return AGREES


@kernel
def orientation(W, row, several, columns):
    """−1 where the first of two bounds is the positive one, else 1."""
    return -1.0 if several and W[row * columns] > W[(row + 1) * columns] else 1.0
