"""The flow of several segments with its derivatives by states, time and parameters."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.loops import loop
from fastslow.continuation.spaces import PAUSED, TABLE_FULL
from fastslow.kernels.compiler.records import zeros
from fastslow.kernels.loops import load_loop
from fastslow.orbits.flow.equations import FLOW, Linear, Newton, ShootingEquations
from fastslow.orbits.flow.stepping import (
    FACTORS,
    WORK,
    Factors,
    FlowProblem,
    FlowSegments,
    FlowWorkspace,
)
from fastslow.orbits.flow.variations import Variations
from fastslow.orbits.loops import SOLVE
from fastslow.simulation.stepper.scales import FORGETTING, rules_of

#: Error of a step relative to the size of each state and of each derivative.
TOLERANCE = 1e-16

#: Steps of one segment after which it is given up.
MAX_STEPS = 10**6

#: Work between two pauses, in multiplications: some hundredths of a second.
_WORK = 2**24

#: Initial size of the table of factors, per segment.
_FACTORS = 4


def newton_for(size: int, n: int, iterations: int, tolerance: float) -> Newton:
    """Space for Newton's method in a number of unknowns."""
    guess, normal, scale, right, step, tangent = np.zeros((6, size))
    return Newton(
        iterations,
        tolerance,
        guess=guess,
        normal=normal,
        scale=scale,
        matrix=np.zeros((size, size + 1)),
        right=right,
        step=step,
        tangent=tangent,
        numbers=np.zeros(7),
        product=np.zeros((n, n)),
    )


#: Arguments of the loop for the flow alone.
_NONE, _NOTHING = np.zeros(0, dtype=np.int64), np.zeros(0)
NO_EQUATIONS = ShootingEquations(
    *(0, 0, 0, 1.0, 0.0), *(_NONE,) * 4, *(_NOTHING,) * 4, _NONE, np.zeros((0, 0))
)
_EMPTY = (0, 0)
NO_LINEAR = zeros(Linear, *(0, 0), _EMPTY, _EMPTY, *(0, 0, 0), _EMPTY, _EMPTY)
NO_NEWTON = newton_for(0, 0, FLOW, 0.0)


@dataclass(frozen=True, eq=False)
class Flows:
    """Ends of K segments with their derivatives.

    Parameters
    ----------
    ends : ndarray, shape (K, n)
    slopes : ndarray, shape (K, n, n + 1 + P)
        Derivatives of the ends by the states at the beginning, the time at the beginning
        (with the duration fixed) and the chosen parameters. The derivative by the duration is
        the rate at the end.
    traces : ndarray, shape (K,)
        Integrals of the trace of f_z: log det of the derivatives by the states (Liouville).
    reached : ndarray, shape (K,)
        Completed durations; less than those requested where the rates are not finite or the
        steps too many or too small.
    factors : ndarray, shape (m, n, n)
        Matrices in order of time. Their product over a segment is its derivative by the states;
        none of them underflows or has a large condition, unless one step has.
    owners : ndarray of int64, shape (m,)
        Segment of each factor.
    """

    ends: NDArray[np.float64]
    slopes: NDArray[np.float64]
    traces: NDArray[np.float64]
    reached: NDArray[np.float64]
    factors: NDArray[np.float64]
    owners: NDArray[np.int64]

    def factors_of(self, segment: int) -> NDArray[np.float64]:
        """The factors of one segment, in order of time."""
        return self.factors[self.owners == segment]


def flow(
    variations: Variations,
    modes: NDArray[np.int64],
    states: NDArray[np.float64],
    times: NDArray[np.float64],
    durations: NDArray[np.float64],
    parameters: NDArray[np.float64],
    constants: NDArray[np.float64] | None = None,
    *,
    tol: float = TOLERANCE,
    max_steps: int = MAX_STEPS,
) -> Flows:
    """Integrate segments, each in one smooth motion, whose rates are continued past its borders.

    Parameters
    ----------
    variations : Variations
    modes : ndarray of int64, shape (K,)
        Motion of each segment.
    states : ndarray, shape (K, n)
    times, durations : ndarray, shape (K,)
        Time at the beginning, and duration: positive, zero or negative.
    parameters : ndarray
        From `Variations.parameter_array`.
    constants : ndarray, shape (K, m), optional
        Of models with clocks or tables, from `Variations.constants_at`.
    tol : float
        Error of a step relative to each state and to each derivative.
    max_steps : int
        Limit of each segment.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> from fastslow.orbits.flow.variations import variations_of
    >>> x, k = sp.symbols("x k")
    >>> decay = fs.Model({x: -k * x}, parameters={k: 2})
    >>> variations = variations_of(decay, ("k",))
    >>> some = np.zeros(1, dtype=int), np.ones((1, 1)), np.zeros(1), np.array([0.5])
    >>> flows = flow(variations, *some, variations.parameter_array(decay))
    >>> (flows.slopes[0, 0] * np.e).round(14).tolist()
    [1.0, 0.0, -0.5]
    >>> flows.traces.round(14).tolist()
    [-1.0]
    """
    problem = problem_of(variations, parameters, tol, max_steps)
    segments = segments_for(variations, modes, constants)
    segments.times[:], segments.durations[:], segments.ends[:] = times, durations, states
    segments.slopes[:, range(variations.n), range(variations.n)] = 1.0
    _, factors = completed(problem, NO_EQUATIONS, segments, NO_LINEAR, NO_NEWTON)
    return flows_of(segments, factors)


def problem_of(
    variations: Variations,
    parameters: NDArray[np.float64],
    tol: float = TOLERANCE,
    max_steps: int = MAX_STEPS,
) -> FlowProblem:
    """A model with its error control, with a copy of its parameters."""
    n = variations.n
    return FlowProblem(
        series=variations.series,
        n=n,
        unknowns=variations.n_unknowns,
        order=variations.order,
        max_steps=max_steps,
        tol=tol,
        starts=variations.starts,
        entries=variations.entries,
        parameters=np.array(parameters, dtype=float),
        rules=_rules(n),
        n_rows=variations.n_rows,
        saturating=variations.saturating,
        saturations=variations.saturations,
    )


def segments_for(
    variations: Variations, modes: NDArray[np.int64], constants: NDArray[np.float64] | None
) -> FlowSegments:
    """Space for segments with these modes, and the constants of clocks and tables."""
    K, n, m = len(modes), variations.n, variations.constants
    along = np.zeros((K, m))
    if m:
        assert constants is not None
        along[:] = constants
    return FlowSegments(
        modes=np.array(modes, dtype=np.int64),
        constants=along,
        times=np.zeros(K),
        durations=np.zeros(K),
        ends=np.zeros((K, n)),
        slopes=np.zeros((K, n, variations.n_unknowns)),
        traces=np.zeros(K),
        reached=np.zeros(K),
        progress=np.zeros(6, dtype=np.int64),
    )


def flows_of(segments: FlowSegments, factors: Factors) -> Flows:
    """The flow of completed segments, in arrays of its own."""
    used = segments.progress[FACTORS]
    return Flows(
        segments.ends.copy(),
        segments.slopes.copy(),
        segments.traces.copy(),
        segments.reached.copy(),
        factors.matrices[:used].copy(),
        factors.owners[:used].copy(),
    )


def factors_for(segments: FlowSegments) -> Factors:
    """A table of factors of the usual size."""
    K, n = segments.ends.shape
    return zeros(Factors, _FACTORS * K, (_FACTORS * K, n, n))


def completed(
    problem: FlowProblem,
    equations: ShootingEquations,
    segments: FlowSegments,
    linear: Linear,
    newton: Newton,
    factors: Factors | None = None,
) -> tuple[int, Factors]:
    """Run the compiled loop to its end; return its code and the table of factors."""
    order, unknowns = problem.order, problem.unknowns
    space = _memory.of(problem.n_rows, order, problem.n, unknowns)
    if factors is None:
        factors = factors_for(segments)
    entries = int(np.diff(problem.starts).max(initial=1))
    steps = 1 + _WORK // (order**2 * (entries * unknowns + problem.n_rows))
    run, progress, code = load_loop(SOLVE), segments.progress, PAUSED
    while code in (PAUSED, TABLE_FULL):
        progress[WORK] = steps
        code = run(problem, equations, segments, factors, space, linear, newton)
        if code == TABLE_FULL:
            factors = Factors(*(np.concatenate([a, np.zeros_like(a)]) for a in factors))
    return code, factors


@cache
def _rules(n: int) -> NDArray[np.float64]:
    """Scale rules of n states: sizes follow each segment."""
    return np.asarray(rules_of(np.zeros(n), np.full(n, FORGETTING), 0, 0))


class _FlowMemory(threading.local):
    """Work space of the last sizes, for each thread."""

    sizes: tuple[int, ...] = ()
    space: FlowWorkspace

    def of(self, n_rows: int, order: int, n: int, unknowns: int) -> FlowWorkspace:
        """Work space of the loop."""
        if self.sizes != (n_rows, order, n, unknowns):
            steps, square = (order + 1, n, unknowns), (n, n)
            some = n_rows * (order + 1), steps, (2, n), 1 + n, steps[1:], square, (n, n + 1), n, n
            self.space, self.sizes = zeros(FlowWorkspace, *some), (n_rows, order, n, unknowns)
        return self.space


_memory = _FlowMemory()


@dataclass(frozen=True, eq=False)
class Fields:
    """Rates and switching functions at K points, with derivatives by u = (z, t, parameters).

    Parameters
    ----------
    f : ndarray, shape (K, n)
    f_u : ndarray, shape (K, n, n + 1 + P)
    g : ndarray, shape (K, m)
        Interface functions, then the bounds of sliding (see `fastslow.model.motions.Motion`);
        zero beyond those of the mode.
    g_u : ndarray, shape (K, m, n + 1 + P)
    """

    f: NDArray[np.float64]
    f_u: NDArray[np.float64]
    g: NDArray[np.float64]
    g_u: NDArray[np.float64]

    @classmethod
    def of(cls, out: NDArray[np.float64], variations: Variations) -> Fields:
        """The outputs of a compiled field at K points."""
        n, u, m, K = variations.n, variations.n_unknowns, variations.field.m, len(out)
        first, second = n + n * u, n + n * u + m
        f_u, g_u = out[:, n:first].reshape(K, n, u), out[:, second:].reshape(K, m, u)
        return cls(out[:, :n], f_u, out[:, first:second], g_u)


def fields(
    variations: Variations,
    modes: NDArray[np.int64],
    states: NDArray[np.float64],
    times: NDArray[np.float64],
    parameters: NDArray[np.float64],
    constants: NDArray[np.float64] | None = None,
    *,
    drifts: bool = False,
) -> Fields:
    """Evaluate rates and switching functions with their derivatives.

    Parameters
    ----------
    variations : Variations
    modes : ndarray of int64, shape (K,)
    states : ndarray, shape (K, n)
    times : ndarray, shape (K,)
    parameters : ndarray
        From `Variations.parameter_array`.
    constants : ndarray, shape (K, m), optional
        Of models with clocks or tables, from `Variations.constants_at`.
    drifts : bool
        Return rates of change along the motions instead of the switching functions.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> from fastslow.orbits.flow.variations import variations_of
    >>> x, a, t = sp.symbols("x a t")
    >>> relay = fs.Model({x: -sp.sign(x - a) + t}, parameters={a: 0.5})
    >>> variations = variations_of(relay, ("a",))
    >>> point = np.zeros(1, dtype=int), np.array([[2.0]]), np.array([3.0])
    >>> found = fields(variations, *point, variations.parameter_array(relay))
    >>> found.f.tolist(), found.f_u.tolist(), found.g[0, :1].tolist(), found.g_u[0, :1].tolist()
    ([[2.0]], [[[0.0, 1.0, 0.0]]], [1.5], [[1.0, 0.0, -1.0]])
    """
    field, K = variations.drifts if drifts else variations.field, len(states)
    n, u = field.n, variations.n_unknowns
    points, out = np.empty((K, u)), np.zeros((K, field.size))
    points[:, :n], points[:, n], points[:, n + 1 :] = states, times, parameters[variations.places]
    numbers = np.array(modes, dtype=np.int64)
    for rows, values in alike(variations, parameters, constants, K):
        part = np.empty((len(rows), field.size))
        loop("evaluate")(field.address, numbers[rows], points[rows], values, part)
        out[rows] = part
    return Fields.of(out, variations)


def alike(
    variations: Variations,
    parameters: NDArray[np.float64],
    constants: NDArray[np.float64] | None,
    count: int,
) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Numbers of points with the same constants, and their parameters."""
    m = variations.constants
    if not m or not count:
        return [(np.arange(count), parameters)]
    assert constants is not None
    rows, which = np.unique(constants, axis=0, return_inverse=True)
    kept = parameters[: len(parameters) - m]
    return [
        (np.flatnonzero(which.reshape(-1) == k), np.append(kept, row)) for k, row in enumerate(rows)
    ]


def after_jumps(
    variations: Variations,
    numbers: NDArray[np.int64],
    states: NDArray[np.float64],
    times: NDArray[np.float64],
    parameters: NDArray[np.float64],
    constants: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States R after K jumps, with their derivatives R_u by u = (z, t, parameters).

    Parameters
    ----------
    variations : Variations
    numbers : ndarray of int64, shape (K,)
        Numbers of the jumps, -1 for the identity.
    states, times, parameters, constants
        As for `fields`.

    Returns
    -------
    states : ndarray, shape (K, n)
    slopes : ndarray, shape (K, n, n + 1 + P)
    """
    n, u, K = variations.n, variations.n_unknowns, len(states)
    found, slopes = np.array(states, dtype=float), np.tile(np.eye(n, u), (K, 1, 1))
    points = np.empty((K, u))
    points[:, :n], points[:, n], points[:, n + 1 :] = states, times, parameters[variations.places]
    for rows, values in alike(variations, parameters, constants, K):
        rows = rows[numbers[rows] >= 0]
        if not len(rows):
            continue
        out = np.empty((len(rows), n + n * u))
        loop("evaluate")(variations.resets.address, numbers[rows], points[rows], values, out)
        found[rows], slopes[rows] = out[:, :n], out[:, n:].reshape(-1, n, u)
    return found, slopes
