"""Roots of piecewise polynomials: all of them, each once.

The number of sign changes of the Bernstein coefficients bounds the number of roots
in an open interval, exactly for none and one (Descartes' rule of signs); intervals
with more are bisected. Adjacent steps share an end, so that a root there is found once; a
change of sign by a jump of the quantity is not a root.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials

Array = NDArray[np.float64]

#: Maximal number of bisections of an interval.
ROOT_BISECTIONS = 44

#: Difference between the end of a step and the beginning of the next, relative to the terms of
#: the quantity, above which it jumps.
STEP_JUMP = 1e-6

#: Distance of roots, as a fraction of a step, below which they may be a single tangency.
CLOSE_ROOTS = 1e-3


@dataclass(frozen=True, eq=False)
class StepRoots:
    """Roots in order of time.

    Parameters
    ----------
    step : ndarray of int, shape (K,)
    part : ndarray, shape (K,)
        The fraction of the step, 0 to 1.
    direction : ndarray of int, shape (K,)
        +1 if the quantity increases through zero, −1 if it decreases, 0 for a tangency.
    """

    step: NDArray[np.intp]
    part: Array
    direction: NDArray[np.int64]


@dataclass(frozen=True)
class Zero:
    """A root, or an interval of roots, with the signs on both sides.

    Its ends ``low`` and ``high`` are step + fraction. The sign is 0 beyond an end of the
    run at which the quantity is zero.
    """

    low: float
    high: float
    before: int
    after: int

    @property
    def long(self) -> bool:
        """True if the quantity is zero for a step or longer."""
        return self.high - self.low >= 1

    @property
    def middle(self) -> float:
        return (self.low + self.high) / 2

    @property
    def direction(self) -> int:
        """+1 if the quantity increases through zero, −1 if it decreases, 0 for a tangency."""
        after = self.after or -self.before
        return 0 if after == self.before else after


def find_roots(quantity: StepPolynomials) -> StepRoots:
    """Compute all roots along consecutive steps, except one at the beginning of the run.

    Parameters
    ----------
    quantity : StepPolynomials

    Returns
    -------
    StepRoots
        An interval on which the quantity is zero to rounding counts once, at its beginning
        (at its middle if it is shorter than a step).
    """
    found = [zero for zero in find_zeros(quantity) if zero.before != 0]
    where = np.array([zero.low if zero.long else zero.middle for zero in found])
    step = np.minimum(where.astype(np.intp), len(quantity.coefficients) - 1)
    direction = np.array([zero.direction for zero in found], dtype=np.int64)
    return StepRoots(step, where - step, direction)


def find_roots_modulo(line: StepPolynomials, level: float, period: float) -> StepRoots:
    """Return the roots of a periodic quantity at a level, modulo its period.

    The steps near each copy of the level, shifted by whole periods, follow those near
    the previous copy, joined by a linear step whose roots are discarded.
    """
    c = line.coefficients
    count = len(c)
    moved = np.abs(c[:, 1:]).sum(axis=1) + 1e-9 * period
    low = np.ceil((c[:, 0] - moved - level) / period)
    high = np.floor((c[:, 0] + moved - level) / period)
    # including their neighbours, so that a root between two steps is detected from both
    first, last = low.copy(), high.copy()
    for shifted, source in ((slice(1, None), slice(-1)), (slice(-1), slice(1, None))):
        first[shifted] = np.minimum(first[shifted], low[source])
        last[shifted] = np.maximum(last[shifted], high[source])
    copies = np.maximum(last - first + 1, 0).astype(np.intp)
    step = np.repeat(np.arange(count), copies)
    turn = first[step] + np.arange(len(step)) - np.repeat(np.cumsum(copies) - copies, copies)
    order = np.lexsort((step, turn))
    step, turn = step[order], turn[order]
    if not len(step):
        return StepRoots(step, np.empty(0), np.empty(0, dtype=np.int64))
    rows = c[step].copy()
    rows[:, 0] -= level + period * turn
    size = line.size[step] + np.abs(level + period * turn)
    gaps = np.flatnonzero((np.diff(step) != 1) | (np.diff(turn) != 0)) + 1
    between = np.zeros((len(gaps), c.shape[1]))
    between[:, 0] = rows[gaps - 1].sum(axis=1)
    between[:, 1] = rows[gaps, 0] - between[:, 0]
    rows, size = np.insert(rows, gaps, between, axis=0), np.insert(size, gaps, size[gaps])
    number = np.insert(step, gaps, -1)
    roots = find_roots(StepPolynomials(rows, size))
    found = number[roots.step]
    kept = (found >= 0) & ~((found == 0) & (roots.part == 0.0))
    order = np.lexsort((roots.part[kept], found[kept]))
    return StepRoots(found[kept][order], roots.part[kept][order], roots.direction[kept][order])


def find_zeros(quantity: StepPolynomials) -> list[Zero]:
    """Compute all roots along consecutive steps in order, including the ends of the run."""
    b = quantity.coefficients
    if not len(b):
        return []
    if b.shape[1] == 1:
        b = np.column_stack([b, np.zeros(len(b))])
    noise = 8.0 * np.finfo(float).eps * quantity.size
    # there is no root if the constant term dominates
    near = np.flatnonzero(np.abs(b[:, 0]) <= np.abs(b[:, 1:]).sum(axis=1) + noise)
    transform = to_bernstein(b.shape[1] - 1)
    bernstein = b[near] @ transform.T
    # the end of a step is the beginning of the next, except at resets
    ends = np.append(b[:, 0], b[-1] @ transform[-1])
    ends[np.abs(ends) <= np.append(noise, noise[-1])] = 0.0
    last = b @ transform[-1]
    last[np.abs(last) <= noise] = 0.0
    jump = np.abs(last[:-1] - b[1:, 0]) > STEP_JUMP * np.maximum(
        quantity.size[:-1], quantity.size[1:]
    )
    last[:-1], last[-1] = np.where(jump, last[:-1], ends[1:-1]), ends[-1]
    bernstein[:, 0], bernstein[:, -1] = ends[near], last[near]
    single, vague = _inside(bernstein, near, noise, b)
    at_end = 1 + np.flatnonzero(jump & (last[:-1] == 0.0))
    vague += [(float(j), float(j)) for j in (*np.flatnonzero(ends == 0.0), *at_end)]
    zeros = single + [
        Zero(low, high, _sign_beyond(b, noise, low, -1), _sign_beyond(b, noise, high, 1))
        for low, high in _joined(sorted(vague))
    ]
    return _merged(sorted(zeros, key=lambda z: z.low), b, noise)


@cache
def to_bernstein(n: int) -> Array:
    """Return the matrix from coefficients of powers up to n to Bernstein coefficients."""
    rows = [[comb(j, k) / comb(n, k) for k in range(n + 1)] for j in range(n + 1)]
    return np.array(rows)


@cache
def _halves(n: int) -> tuple[Array, Array]:
    """Return the matrices of de Casteljau's subdivision into the left and the right half."""
    left = np.array([[comb(j, k) / 2.0**j for k in range(n + 1)] for j in range(n + 1)])
    return left, np.ascontiguousarray(left[::-1, ::-1])


def _changes(bernstein: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Count the sign changes of each row, and return its first and last nonzero sign."""
    signs = np.sign(bernstein)
    rows, columns = np.arange(len(signs))[:, None], np.arange(signs.shape[1])
    # the number of the last column that is not zero, up to each; the first column without one
    known = np.maximum.accumulate(np.where(signs != 0.0, columns, 0), axis=1)
    filled = signs[rows, known]
    count = (filled[:, 1:] * filled[:, :-1] < 0.0).sum(axis=1)
    first = signs[rows[:, 0], (signs != 0.0).argmax(axis=1)]
    last = filled[:, -1]
    return count, first, last


def _inside(
    bernstein: Array, step: NDArray[np.intp], noise: Array, b: Array
) -> tuple[list[Zero], list[tuple[float, float]]]:
    """Return simple roots inside steps, and intervals that are zero to rounding.

    The Bernstein coefficients are those of the candidate steps.
    """
    low, width = np.zeros(len(step)), np.ones(len(step))
    left, right = _halves(b.shape[1] - 1)
    single: list[tuple[Array, ...]] = []
    vague: list[tuple[float, float]] = []
    for depth in range(ROOT_BISECTIONS + 1):
        count, first, last = _changes(bernstein)
        small = np.abs(bernstein).max(axis=1) <= noise[step]
        one = (count == 1) & ~small
        single.append((step[one], low[one], low[one] + width[one], first[one], last[one]))
        begin = (step + low)[small | ((count > 1) & (depth == ROOT_BISECTIONS))]
        vague += [(float(u), float(u) + 0.5**depth) for u in begin]
        more = (count > 1) & ~small
        if not more.any():
            break
        step, low, width = step[more], low[more], 0.5 * width[more]
        bernstein = np.vstack([bernstein[more] @ left.T, bernstein[more] @ right.T])
        # a midpoint that is zero to rounding is a separate root, of neither half
        zero = np.abs(bernstein[: len(step), -1]) <= noise[step]
        bernstein[: len(step), -1][zero] = bernstein[len(step) :, 0][zero] = 0.0
        vague += [(float(u), float(u)) for u in (step + low + width)[zero]]
        step, low, width = np.tile(step, 2), np.append(low, low + width), np.tile(width, 2)
    row, lower, upper, first, last = (np.concatenate(parts) for parts in zip(*single, strict=True))
    root = row + _refined(b[row.astype(np.intp)], lower, upper, first)
    found = zip(root.tolist(), first.tolist(), last.tolist(), strict=True)
    return [Zero(u, u, int(before), int(after)) for u, before, after in found], vague


def _joined(intervals: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Merge sorted intervals that touch or overlap."""
    kept: list[tuple[float, float]] = []
    for low, high in intervals:
        if kept and low <= kept[-1][1]:
            kept[-1] = kept[-1][0], max(high, kept[-1][1])
        else:
            kept.append((low, high))
    return kept


def _refined(b: Array, low: Array, high: Array, sign: Array) -> Array:
    """Refine roots by Newton's method, safeguarded by brackets with given sign at the lower end."""
    s = 0.5 * (low + high)
    for _ in range(100):
        value, slope = np.zeros(len(s)), np.zeros(len(s))
        for k in range(b.shape[1] - 1, -1, -1):
            slope = slope * s + value
            value = value * s + b[:, k]
        same = value * sign > 0
        low, high = np.where(same, s, low), np.where(same, high, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = s - value / slope
        # a root at an end of the bracket has converged if the correction is below rounding
        kept = ((low < new) & (new < high)) | (new == s)
        new = np.where(kept, new, 0.5 * (low + high))
        new = np.where(value == 0.0, s, new)
        done = np.abs(new - s) <= 2e-16 * new
        s = new
        if done.all():
            break
    return s


def _value(b: Array, u: float) -> tuple[int, float]:
    step = min(int(u), len(b) - 1)
    return step, float(np.polynomial.polynomial.polyval(u - step, b[step]))


def _sign_beyond(b: Array, noise: Array, u: float, side: int) -> int:
    """Return the first sign above rounding on one side, 0 if the run ends before."""
    reach = 2.0**-ROOT_BISECTIONS
    while True:
        at = u + side * reach
        if not 0.0 <= at <= len(b):
            at = 0.0 if side < 0 else float(len(b))
            step, value = _value(b, at)
            return int(np.sign(value)) if abs(value) > noise[step] else 0
        step, value = _value(b, at)
        if abs(value) > noise[step]:
            return int(np.sign(value))
        # at most half a step at once: the quantity may be zero over many steps
        reach += min(reach, 0.5)


def _merged(zeros: list[Zero], b: Array, noise: Array) -> list[Zero]:
    """Merge adjacent roots between which the quantity is zero to rounding."""
    kept: list[Zero] = []
    for zero in zeros:
        if kept:
            last = kept[-1]
            gap = zero.low - last.high
            if gap <= CLOSE_ROOTS:
                step, value = _value(b, last.high + 0.5 * gap)
                # contradictory signs are due to rounding
                doubt = last.after != zero.before or abs(value) <= 2.0 * noise[step]
                if gap <= 0.0 or doubt:
                    low, high = last.low, max(last.high, zero.high)
                    before, after = (
                        _sign_beyond(b, noise, u, side) for u, side in ((low, -1), (high, 1))
                    )
                    kept[-1] = Zero(low, high, before, after)
                    continue
        kept.append(zero)
    return kept
