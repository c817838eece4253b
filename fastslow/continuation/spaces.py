"""What the loops of this package are given and work in, and how they return."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import NamedTuple, ParamSpec, TypeVar

from fastslow.kernels.records import Integers, Matrix, Tensor, Vector, zeros

P = ParamSpec("P")
R = TypeVar("R")

#: Work spaces of one kind that a thread keeps.
KEPT = 8


def _kept(function: Callable[P, R]) -> Callable[P, R]:
    """Make a work space once for every thread and size: no loop reads what another has left."""
    own = threading.local()

    @wraps(function)
    def kept(*args: P.args, **kwargs: P.kwargs) -> R:
        if not hasattr(own, "known"):
            own.known = {}
        known: dict[tuple[object, ...], R] = own.known
        if args not in known:
            if len(known) == KEPT:
                known.clear()
            known[args] = function(*args, **kwargs)
        return known[args]

    return kept


#: How `trace` ends.
FULL, RANGE, INTERFACE, SMALL_STEP, WINDOW, CLOSED = range(6)

#: How a loop returns that is to be called again: its work is done, or a table is full.
PAUSED, TABLE_FULL = -1, -2


class CompiledCurve(NamedTuple):
    """The generated function of curves, the number of the region, and the parameters."""

    address: int
    mode: int
    parameters: Vector


class Region(NamedTuple):
    """Where a curve may go.

    Parameters
    ----------
    signs : ndarray, shape (m,)
        Sign of each h in the region; 0 leaves an interface out.
    weight : ndarray, shape (n + 1,)
        Inverse squares of the scales.
    lower, upper : float
        Range of the last component.
    low, high : ndarray, shape (n,)
        Window of the others.
    middle : ndarray, shape (n,)
        Where each of the others is not far away; NaN if it never is.
    periods : ndarray, shape (n,)
        Period of each of the others, 0 if there is none.
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
    """How steps are made; ``closing`` says whether a return to the start ends the curve."""

    smallest: float
    largest: float
    turn: float
    tolerance: float
    iterations: int
    closing: bool


class Traced(NamedTuple):
    """What `trace` fills in.

    Parameters
    ----------
    rows, tangents : ndarray, shape (N, n + 1)
        Points of the curve and unit tangents (in the weighted norm), the first of which is to
        be given.
    in_use : ndarray, shape (1,)
        The step.
    progress : ndarray of int64, shape (2,)
        How many rows there are, and how many steps are tried before the next pause.
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


@_kept
def trace_space(n: int, m: int) -> TraceSpace:
    """Work space for n states and m interfaces."""
    size, width = n + 1, n * (n + 2) + m * (n + 2)
    shapes = (width, width, (size, size), *[size] * 4, *[m] * 4, size)
    return zeros(TraceSpace, *shapes)


class Limits(NamedTuple):
    """What solves equations plainly, as `correct` tells.

    Parameters
    ----------
    residual : float
        Largest residual, in natural units.
    correction : float
        Last correction of Newton's method, in units of the scale.
    pole : float
        By how much rounding of the state changes the equations at most, in natural units.
    moved, farthest : float
        How far the state may move and be, in units of the scale.
    beside : float
        How far off the last component may be, in units of its scale.
    """

    residual: float
    correction: float
    pole: float
    moved: float
    farthest: float
    beside: float


class NewtonSpace(NamedTuple):
    """Work space of `newton_from`, `refine`, `correct` and `survey`.

    Vectors of n + 1 numbers, and others.
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
    """Work space for n states, and so many numbers that the generated function fills in."""
    size = n + 1
    return zeros(NewtonSpace, width, (size, size), (size, size), *[size] * 7)


class Boxes(NamedTuple):
    """Boxes that wait to be looked at: coefficients, their rounding, and the two corners."""

    coefficients: Tensor
    rounding: Matrix
    low: Matrix
    high: Matrix


class IsolationSpace(NamedTuple):
    """Work space of `isolate`; ``most`` is the highest degree."""

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
def isolation_space(n: int, size: int, most: int) -> IsolationSpace:
    """Work space for n unknowns and so many coefficients of each polynomial."""
    square, d = (n, n), most + 1
    tables = ((d, d), (n + 1, size), (n, d, d), d, (d, d))
    vectors = (size, size, n, n, n, d, n)
    return zeros(IsolationSpace, n, *tables, square, square, (n, size), *vectors)
