"""Plain steps of several trajectories at once, for the regions of one model.

A plain step is a Taylor step inside a region without any event. The recurrences are
those of `fastslow.kernels.taylor.series`; a step that is not certainly plain is left to
the loop of one trajectory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from llvmlite import ir

from fastslow.kernels.compiler.native import ENTRY, INTEGER
from fastslow.kernels.simd.functions import Mathematics, exp2, log2
from fastslow.kernels.simd.lanes import Lanes, Mask, Trace, Workspace, evaluated, polynomial

if TYPE_CHECKING:
    from fastslow.kernels.taylor.saturation import Saturation

#: Rows after time and states, followed by the smallest and largest values of the
#: states: compensation of the time, limit of the time, time of the next sample, usual
#: step length, steps allowed, steps until an implicit attempt; time, length and outcome
#: of the last step; and the interface just crossed, -1 for none.
LATE, LIMIT, NEXT, USUAL, ALLOWED, CALM, BEGAN, LENGTH, OUTCOME, LEFT = range(10)
LANE_ROWS = 10

#: Outcome of a step: not taken, taken, or taken with its series reported.
NOT_TAKEN, TAKEN, REPORTED = 0.0, 1.0, 2.0

#: A first step, or one after an event, shorter by this factor than the last one indicates a
#: state without a scale yet.
SUDDEN = 0.01

#: Smallest coefficient that limits a step, in units of its row's size, and the largest.
_SMALLEST, _LARGEST_TERM = 1e-250, 1e250


def plain_steps(
    module: ir.Module,
    regions: Sequence[Callable[..., None]],
    signs: Sequence[Sequence[int]],
    saturating: Sequence[Sequence[Saturation]],
    sizes: tuple[int, int, int, int],
) -> None:
    """Add a function for the plain steps of several trajectories to a module.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Its new function is called ``steps``.
    regions : sequence of callable
        Each fills a work space from inputs and parameters, as the series does.
    signs : sequence of sequence of int
        Side of every interface for each region.
    saturating : sequence of sequence of Saturation
        Arguments of functions that saturate, for each region.
    sizes : tuple of int
        (n_states, n_forcing, n_parameters, order).
    """
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), ENTRY), "steps")
    function.attributes.add("nounwind")
    mode, *pointers = function.args
    start, end = (function.append_basic_block(name) for name in ("start", "end"))
    switch = ir.IRBuilder(start).switch(mode, end)
    for number, region in enumerate(regions):
        before, step = (function.append_basic_block(name) for name in ("before", "step"))
        switch.add_case(ir.Constant(INTEGER, number), before)
        trace = Trace(ir.IRBuilder(before), ir.IRBuilder(step))
        kinds = signs[number], saturating[number]
        _step(trace, region, kinds, sizes, pointers, (step, end))
        trace.before.branch(step)
    ir.IRBuilder(end).ret_void()


def _step(
    trace: Trace,
    region: Callable[..., None],
    kinds: tuple[Sequence[int], Sequence[Saturation]],
    sizes: tuple[int, int, int, int],
    pointers: Sequence[Any],
    blocks: tuple[Any, Any],
) -> None:
    """Emit a step and the branch to the next one or to the end."""
    n, forcing, n_parameters, order = sizes
    lanes, parameters, W = pointers
    kept, (signs, saturating) = n + forcing, kinds

    def number(row: int) -> Lanes:
        return trace.load(lanes, 1 + n + row)

    inputs = [trace.load(lanes, i) for i in range(1 + n)]
    count = kept + len(signs)
    given = [trace.load(parameters, i, invariant=True) for i in range(n_parameters + 1 + 2 * count)]
    tolerance, rules = given[n_parameters], given[n_parameters + 1 :]
    rows, arguments = _series(trace, region, inputs, given, (count, saturating), order)
    reached = [number(LANE_ROWS + 2 * n + i) for i in range(count)]
    scales = [_larger(abs(row[0]), size) for row, size in zip(rows, reached, strict=True)]
    t, late, usual, allowed = inputs[0], number(LATE), number(USUAL), number(ALLOWED)
    calm = number(CALM) - 1.0
    longest, known = _length(rows, scales, tolerance, order)
    # a step between two floating-point times, as in the loop of one trajectory
    h = evaluated(evaluated(t + longest) - t)
    after = evaluated(t + h)
    taken = (longest < evaluated(number(LIMIT) - t) - late) & (h > 0.0) & (h <= 2.0 * usual)
    left = number(LEFT)
    taken &= (allowed >= 1.0) & known & ((left < 0.0) | (longest >= SUDDEN * usual))
    for one, argument in zip(saturating, arguments, strict=True):
        taken &= _unsaturated(one, argument, h)
    taken &= ~((calm <= 0.0) & _limited_by_stability(rows, scales, longest, tolerance, order))
    state = [polynomial(row, h) for row in rows[:n]]
    for value in (*state, *(row[k] for row in rows[n:kept] for k in (0, order))):
        taken &= value - value <= 0.0
    for condition in trace.conditions:
        taken &= condition
    extremes = [(number(LANE_ROWS + i), number(LANE_ROWS + n + i)) for i in range(n)]
    away, single = _nothing_happens(trace, rows[:n], extremes, rows[kept:], (signs, left), h)
    taken &= away
    plain = single & (after < number(NEXT))
    widened = taken & single
    for i, (value, (low, high)) in enumerate(zip(state, extremes, strict=True)):
        trace.store((widened & (value < low)).choose(value, low), lanes, 1 + n + LANE_ROWS + i)
        trace.store(
            (widened & (value > high)).choose(value, high), lanes, 1 + n + LANE_ROWS + n + i
        )
    for i, (new, old) in enumerate(zip((after, *state), inputs, strict=True)):
        trace.store(taken.choose(new, old), lanes, i)
    tenth = evaluated(0.1 * usual)
    results = {
        USUAL: taken.choose((h > tenth).choose(h, tenth), usual),
        ALLOWED: taken.choose(allowed - 1.0, allowed),
        CALM: taken.choose(calm, calm + 1.0),
        BEGAN: t,
        LENGTH: h,
        OUTCOME: taken.choose(plain.choose(TAKEN, REPORTED), NOT_TAKEN),
        LEFT: taken.choose(-1.0, left),
    }
    for place, result in results.items():
        trace.store(result, lanes, 1 + n + place)
    for i, size in enumerate(scales):
        left = _larger(rules[i], evaluated(rules[count + i] * size))
        trace.store(taken.choose(left, reached[i]), lanes, 1 + n + LANE_ROWS + 2 * n + i)
    _branch(trace, taken, plain, blocks, lambda: _report(trace, rows[:kept], W))


def _series(
    trace: Trace,
    region: Callable[..., None],
    inputs: list[Lanes],
    given: list[Lanes],
    wanted: tuple[int, Sequence[Saturation]],
    order: int,
) -> tuple[list[list[Lanes]], list[list[Lanes]]]:
    """Coefficients of states, slow quantities and switching functions, and of other arguments."""
    W = Workspace()
    region(inputs, given, W, Mathematics(trace))
    (count, saturating), columns = wanted, order + 1

    def row(i: int, last: int) -> list[Lanes]:
        return [trace.lanes(W[i * columns + k]) for k in range(last)]

    # the last coefficients of work rows may be missing
    arguments = [row(one.row, order) for one in saturating]
    return [row(i, columns) for i in range(count)], arguments


def _unsaturated(one: Saturation, argument: Sequence[Lanes], h: Lanes) -> Mask:
    """Mask of lanes in which an argument passes no transition, as in `unsaturated_length`."""
    size = abs(argument[0])
    change = evaluated(polynomial([abs(c) for c in argument[1:]], h) * h)
    allowed = evaluated(one.share * size) + one.change
    near_zero, far = evaluated(size + change) <= one.low, evaluated(size - change) >= one.high
    return (change <= evaluated(allowed)) | near_zero | far


def _larger(a: Lanes, b: Lanes) -> Lanes:
    return (a > b).choose(a, b)


def _length(
    rows: Sequence[Sequence[Lanes]], sizes: Sequence[Lanes], tolerance: Lanes, order: int
) -> tuple[Lanes, Mask]:
    """Step length for which the last three terms are within the tolerance, as in `step_length`.

    Returned with a mask: whether every moving row has a scale. A row that is identically
    zero has none and does not count: 0/0 is NaN, which fails every comparison.
    """
    # rows that differ in c_0 alone are judged by the smallest of their sizes
    smallest: dict[tuple[int, ...], tuple[Sequence[Lanes], Lanes]] = {}
    for row, size in zip(rows, sizes, strict=True):
        key = tuple(id(c) for c in row[order - 2 :])
        _, other = smallest.get(key, (row, size))
        smallest[key] = row, size if other is size else (size < other).choose(size, other)
    judged = [(row, 1.0 / size) for row, size in smallest.values()]
    shortest: Lanes | None = None
    known: Mask | None = None
    for k in (order, order - 1, order - 2):
        largest = tolerance.trace.lanes(_SMALLEST)
        for row, scale in judged:
            size = evaluated(abs(row[k]) * scale)
            largest = (size > largest).choose(size, largest)
        length = evaluated((tolerance - log2(largest)) * (1.0 / k))
        shortest = length if shortest is None else (length < shortest).choose(length, shortest)
        known = largest < _LARGEST_TERM if known is None else known & (largest < _LARGEST_TERM)
    assert shortest is not None
    assert known is not None
    return exp2(shortest), known


def _limited_by_stability(
    rows: Sequence[Sequence[Lanes]],
    sizes: Sequence[Lanes],
    h: Lanes,
    tolerance: Lanes,
    order: int,
) -> Mask:
    """Mask of lanes in which stability limits the step, as in `limited_by_stability`."""
    k = order // 2
    before = h
    for _ in range(k - 2):
        before = evaluated(before * h)
    most = exp2(evaluated(tolerance + 0.5 * order / math.log(2.0)))
    calm = h > 0.0
    for row, size in zip(rows, sizes, strict=True):
        allowed = evaluated(most * size)
        calm &= evaluated(abs(row[k - 1]) * before) <= allowed
        calm &= evaluated(abs(row[k]) * evaluated(before * h)) <= allowed
    return calm


def _nothing_happens(
    trace: Trace,
    states: Sequence[Sequence[Lanes]],
    extremes: Sequence[tuple[Lanes, Lanes]],
    interfaces: Sequence[Sequence[Lanes]],
    sides: tuple[Sequence[int], Lanes],
    h: Lanes,
) -> list[Mask]:
    """Masks: no interface is reached in a step, and all new extremes are at its ends.

    An interface just crossed does not count while the motion leaves it. The sums of the
    moduli of the terms decide for most steps, bounds by Bernstein coefficients for the
    others.
    """
    signs, left = sides

    def judged(bounds: _RowBounds) -> list[Mask]:
        away = single = h > 0.0
        for j, (sign, row) in enumerate(zip(signs, interfaces, strict=True)):
            least, most, _, one_sided = bounds(row)
            leaving = (left >= float(j)) & (left <= float(j)) & one_sided & (row[1] * sign > 0.0)
            away &= (row[0] > -least if sign > 0 else row[0] < -most) | leaving
        for row, (low, high) in zip(states, extremes, strict=True):
            least, most, monotone, _ = bounds(row)
            single &= ((row[0] + least >= low) & (row[0] + most <= high)) | monotone
        return [away, single]

    away, single = judged(_RowBounds(h, _by_moduli))
    return trace.refined(
        away & single, [away, single], lambda: judged(_RowBounds(h, _by_bernstein))
    )


_Judged = tuple[Lanes, Lanes, Mask, Mask]


class _RowBounds:
    """Bounds on the change of a row within a step, shared by rows that differ in c_0 alone."""

    def __init__(self, h: Lanes, rule: Callable[[Sequence[Lanes], Lanes], _Judged]) -> None:
        self.h, self.rule = h, rule
        self.known: dict[tuple[int, ...], _Judged] = {}

    def __call__(self, row: Sequence[Lanes]) -> _Judged:
        key = tuple(id(c) for c in row[1:])
        if key not in self.known:
            self.known[key] = self.rule(row, self.h)
        return self.known[key]


def _by_moduli(row: Sequence[Lanes], h: Lanes) -> _Judged:
    """Bounds of the change by moduli, and masks: monotone, of one sign."""
    first = evaluated(abs(row[1]) * h)
    rest = evaluated(polynomial([abs(c) for c in row[2:]], h) * evaluated(h * h))
    most = evaluated(first + rest)
    # k times the modulus of the k-th term is at most n times it
    return -most, most, first > rest * (len(row) - 1), first > rest


def _by_bernstein(row: Sequence[Lanes], h: Lanes) -> _Judged:
    """The same from the Bernstein coefficients of the step."""
    n = len(row) - 1
    power, values = h.trace.lanes(1.0), [h.trace.lanes(0.0)]
    for k in range(1, n + 1):
        power = evaluated(power * h)
        values.append(evaluated(row[k] * power * (1.0 / math.comb(n, k))))
    for level in range(1, n + 1):
        for j in range(n, level - 1, -1):
            values[j] = evaluated(values[j] + values[j - 1])
    least = most = values[0]
    rising = falling = above = below = h > 0.0
    for a, b in pairwise(values):
        above, below = above & (b > 0.0), below & (b < 0.0)
        least, most = (b < least).choose(b, least), (b > most).choose(b, most)
        rising, falling = rising & (b >= a), falling & (b <= a)
    return least, most, rising | falling, above | below


def _report(trace: Trace, rows: Sequence[Sequence[Lanes]], W: Any) -> None:
    """Store the coefficients for the caller."""
    for place, c in enumerate(c for row in rows for c in row):
        trace.store(c, W, place)


def _branch(
    trace: Trace, taken: Mask, plain: Mask, blocks: tuple[Any, Any], report: Callable[[], None]
) -> None:
    """Loop while every lane takes a plain step; else end, with a report where one is due."""
    step, end = blocks
    builder = trace.builder
    stop, reporting = (builder.append_basic_block(name) for name in ("stop", "report"))
    builder.cbranch((taken & plain).all_true(), step, stop)
    builder.position_at_end(stop)
    builder.cbranch((plain | ~taken).all_true(), end, reporting)
    builder.position_at_end(reporting)
    report()
    builder.branch(end)
