"""Arguments, work spaces and return codes of the loops of this package."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import NamedTuple, ParamSpec, TypeVar

from fastslow.kernels.compiler.records import Flags, Integers, Matrix, Tensor, Vector, zeros

P = ParamSpec("P")
R = TypeVar("R")

#: Maximum number of work spaces of one kind that a thread keeps.
SPACES_KEPT = 8


def _kept(function: Callable[P, R]) -> Callable[P, R]:
    """Allocate a work space once per thread and size; no loop reads what another has left."""
    own = threading.local()

    @wraps(function)
    def kept(*args: P.args, **kwargs: P.kwargs) -> R:
        if not hasattr(own, "known"):
            own.known = {}
        known: dict[tuple[object, ...], R] = own.known
        if args not in known:
            if len(known) == SPACES_KEPT:
                known.clear()
            known[args] = function(*args, **kwargs)
        return known[args]

    return kept


#: Return codes of `trace`.
FULL, RANGE, INTERFACE, SMALL_STEP, WINDOW, CLOSED = range(6)

#: Instead of these, for a curve of which only the rows before its last folds are used.
MANY_FOLDS = 6

#: Return codes of a loop that is to be called again: work quota used up, or a table full.
PAUSED, TABLE_FULL = -1, -2


class CompiledCurve(NamedTuple):
    """A curve F(u) = 0: address of the generated function, number of the region, parameters."""

    address: int
    mode: int
    parameters: Vector


class CurveDomain(NamedTuple):
    """Domain of a curve.

    Parameters
    ----------
    signs : ndarray, shape (m,)
        Sign of each h in the region; 0 ignores an interface.
    weight : ndarray, shape (n + 1,)
        Inverse squares of the scales.
    lower, upper : float
        Range of the last component.
    low, high : ndarray, shape (n,)
        Window of the other components.
    middle : ndarray, shape (n,)
        Centre from which the distance of the others is measured; NaN if it is not.
    periods : ndarray, shape (n,)
        Period of each of the others, 0 without one.
    """

    signs: Vector
    weight: Vector
    lower: float
    upper: float
    low: Vector
    high: Vector
    middle: Vector
    periods: Vector


class Stepping(NamedTuple):
    """Step control; ``closing``: whether a return to the start ends the curve."""

    smallest: float
    largest: float
    turn: float
    tolerance: float
    iterations: int
    closing: bool


class Traced(NamedTuple):
    """Output of `trace`.

    Parameters
    ----------
    rows, tangents : ndarray, shape (N, n + 1)
        Points of the curve and unit tangents (in the weighted norm); the first row is input.
    in_use : ndarray, shape (1,)
        Current step length.
    progress : ndarray of int64, shape (2,)
        Number of rows, and number of steps until the next pause.
    """

    rows: Matrix
    tangents: Matrix
    in_use: Vector
    progress: Integers


class TraceSpace(NamedTuple):
    """Work space of `trace`."""

    out: Vector
    beside: Vector
    matrix: Matrix
    right: Vector
    guess: Vector
    turned: Vector
    middle_point: Vector
    h: Vector
    slope: Vector
    new_h: Vector
    new_slope: Vector
    local: Vector
    ends: Matrix
    kept: Vector
    moved: Vector


@_kept
def trace_space(n: int, m: int) -> TraceSpace:
    """Work space of `trace` for n states and m interfaces."""
    size, width = n + 1, n * (n + 2) + m * (n + 2)
    shapes = (width, width, (size, size), *[size] * 4, *[m] * 4, size, (4, size), *[size] * 2)
    return zeros(TraceSpace, *shapes)


class Limits(NamedTuple):
    """Limits of the tests that `correct` applies to a solution.

    Parameters
    ----------
    residual : float
        Largest residual, in natural units.
    correction : float
        Largest last Newton correction, in units of the scale.
    pole : float
        Largest effect of rounding of the state on the equations, in natural units.
    moved, farthest : float
        Largest displacement and modulus of the state, in units of the scale.
    beside : float
        Largest deviation of the last component, in units of its scale.
    """

    residual: float
    correction: float
    pole: float
    moved: float
    farthest: float
    beside: float


class Condition(NamedTuple):
    """The equation that `refine` solves with F = 0.

    Parameters
    ----------
    row : int
        Number of the switching function to vanish; -1 for the plane through ``point`` with
        ``normal``.
    normal, point : ndarray, shape (n + 1,)
    interfaces : int
        Number of switching functions.
    """

    row: int
    normal: Vector
    point: Vector
    interfaces: int


class RowTests(NamedTuple):
    """Output of `survey` at every row.

    Parameters
    ----------
    branching : ndarray, shape (N,)
        `signed_distance` of [F_x F_p; tangent], columns in units of the scale, rows in units
        of their largest entry there and ``reach`` of the scale ahead and behind: at a branch
        point in an invariant plane a whole row vanishes.
    turning : ndarray, shape (N,)
        The last component of the tangent in units of the scale. It is 0 where it is below
        ``vertical`` over the distance from zero, as a branch far away bends over lengths in
        proportion to it.
    jacobians : ndarray, shape (N, n, n)
    """

    branching: Vector
    turning: Vector
    jacobians: Tensor


class NewtonSpace(NamedTuple):
    """Work space of `newton_from`, `refine`, `correct` and `survey`.

    Mostly vectors of length n + 1.
    """

    out: Vector
    matrix: Matrix
    slopes: Matrix
    u: Vector
    right: Vector
    value: Vector
    terms: Vector
    largest: Vector
    beside: Vector
    constant: Vector


@_kept
def newton_space(n: int, width: int) -> NewtonSpace:
    """Newton work space for n states and ``width`` outputs of the generated function."""
    size = n + 1
    return zeros(NewtonSpace, width, (size, size), (size, size), *[size] * 7)


class Polynomials(NamedTuple):
    """Polynomial equations of `isolate`, then functions that must not be negative.

    Parameters
    ----------
    power : ndarray, shape (N + K, S)
        Power coefficients, the last unknown varying fastest, S = ∏ (degree + 1).
    degrees : ndarray of int, shape (N,)
        Maximum degree in each unknown.
    """

    power: Matrix
    degrees: Integers


class Subdivision(NamedTuple):
    """Boxes that `isolate` searches, and how they are divided.

    Parameters
    ----------
    low, high : ndarray, shape (B, N)
        The boxes.
    logarithmic : ndarray of bool, shape (N,)
        Unknowns whose intervals of one sign are divided at the geometric mean.
    floor : ndarray, shape (N,)
        Size of each unknown below which ``tolerance`` is absolute.
    tolerance : float
        Relative width of a box along one of the unknowns at which it is not divided further.
    budget : int
        Maximum number of boxes processed.
    large : int
        Number of the unknown that is the inverse of a large one, or -1.
    small : ndarray of bool, shape (N,)
        Unknowns that are searched up to ``share`` times the large one only.
    share : float
    """

    low: Matrix
    high: Matrix
    logarithmic: Flags
    floor: Vector
    tolerance: float
    budget: int
    large: int
    small: Flags
    share: float


class Isolated(NamedTuple):
    """Output of `isolate`.

    Parameters
    ----------
    solutions : ndarray, shape (R, N)
        One for each isolating box, accurate to the Krawczyk operator; some occur twice.
    clusters : ndarray, shape (C, 2, N)
        Undecided boxes, at the tolerance or at rounding, around multiple solutions and along
        solution sets that extend to infinity.
    progress : ndarray of int64, shape (6,)
        Initially zeros: boxes started, boxes waiting, solutions, clusters, and boxes processed,
        above the budget if it did not suffice; last the number to process before a pause.
    """

    solutions: Matrix
    clusters: Tensor
    progress: Integers


class Boxes(NamedTuple):
    """Waiting boxes: coefficients, their rounding errors, and the two corners."""

    coefficients: Tensor
    rounding: Matrix
    low: Matrix
    high: Matrix


class IsolationSpace(NamedTuple):
    """Work space of `isolate`; ``max_degree`` is the highest degree."""

    strides: Integers
    table: Matrix
    weights: Matrix
    enlarging: Tensor
    blossom: Vector
    conversion: Matrix
    jacobian: Matrix
    inverse: Matrix
    preconditioned: Matrix
    enlarged: Vector
    moduli: Vector
    rounding: Vector
    centre: Vector
    deviation: Vector
    scratch: Vector
    sizes: Vector


@_kept
def isolation_space(n: int, rows: int, size: int, max_degree: int) -> IsolationSpace:
    """Work space for n unknowns and ``size`` coefficients of each polynomial, ``rows`` of them."""
    square, d = (n, n), max_degree + 1
    tables = ((d, d), (n + 1, size), (n, d, d), d, (d, d))
    vectors = (size, size, n, n, n, d, rows)
    return zeros(IsolationSpace, n, *tables, square, square, (n, size), *vectors)
