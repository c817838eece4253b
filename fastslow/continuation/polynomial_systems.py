"""All real solutions of square polynomial systems, independent of the units of the unknowns."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.loops import WORK, loop
from fastslow.continuation.ordering import in_order
from fastslow.continuation.spaces import (
    PAUSED,
    TABLE_FULL,
    Boxes,
    Isolated,
    Polynomials,
    Subdivision,
    isolation_space,
)

Array = NDArray[np.float64]

#: Maps exponents of the unknowns to the coefficient of their product.
Terms = Mapping[tuple[int, ...], Fraction | int]

#: Integer coefficients, to which every equation can be scaled.
IntegerTerms = Mapping[tuple[int, ...], int]

#: Solutions are searched up to this multiple of the unit of each unknown (see `units`), and
#: farther if coefficients differ by many decades.
FARTHEST = 1e9

#: Ratio to the largest unknown down to which another one is comparable.
COMPARABLE = 1e-3

#: Multiple of its unit below which an unknown is resolved absolutely, else relatively.
SMALLEST_RELATIVE = 1e-3

#: Width of boxes, relative as above, at which they are not divided further.
NARROWEST_BOX = 1e-12

#: Multiple solutions within boxes of this width, in units of their place, are one cluster.
RESOLUTION = 1e-5

#: Largest number of coefficients evaluated in the subdivision of one system, a few seconds.
BUDGET = 100_000_000

#: Smallest unit of an unknown.
SMALLEST = Fraction(1, 2**960)

#: Largest number of coefficients of one equation.
LARGEST_EQUATION = 20_000


@dataclass(frozen=True)
class Solutions:
    """Real solutions of a polynomial system.

    Parameters
    ----------
    simple : ndarray, shape (R, N)
        Solutions proved to exist and to be simple.
    clusters : ndarray, shape (C, 2, N)
        Boxes in which solutions that are multiple, closer to each other than
        the resolution, or near infinity are neither proved nor excluded.
    complete : bool
        Whether there is no solution elsewhere in the domain, and the boxes are as narrow as
        the resolution: in the unknowns with a range, or in all if none has one.
    """

    simple: Array
    clusters: Array
    complete: bool


def solve_polynomials(
    equations: Sequence[Terms],
    ranges: Mapping[int, tuple[float, float]] | None = None,
    *,
    bounds: Mapping[int, float] | None = None,
    within: Sequence[tuple[Terms, float, float]] = (),
) -> Solutions:
    """Isolate every real solution of N polynomial equations in N unknowns.

    Unknowns without a range are searched up to `FARTHEST` of their unit: where all are
    at most one unit, and for each of them where it is the largest. Its inverse is then the
    coordinate, with ratios to it in place of the comparable unknowns: solutions that tend to
    infinity are nearly straight in these coordinates.

    Parameters
    ----------
    equations : sequence of mapping
        Each from exponents of the N unknowns to an exact coefficient.
    ranges : mapping, optional
        Number of an unknown to the interval in which it is searched.
    bounds : mapping, optional
        Number of an unknown without a range to the largest modulus searched.
    within : sequence of (Terms, float, float)
        Functions and their ranges: solutions outside may be left out.

    Returns
    -------
    Solutions

    Examples
    --------
    A circle and a parabola, x² + y² = 2 and y = x²:

    >>> circle = {(2, 0): Fraction(1), (0, 2): Fraction(1), (0, 0): Fraction(-2)}
    >>> parabola = {(2, 0): Fraction(1), (0, 1): Fraction(-1)}
    >>> found = solve_polynomials([circle, parabola])
    >>> found.complete, np.round(found.simple, 12).tolist()
    (True, [[-1.0, 1.0], [1.0, 1.0]])
    """
    ranges, bounds = ranges or {}, bounds or {}
    count = len(equations)
    nothing, none = np.empty((0, count)), np.empty((0, 2, count))
    if any(len(e) == 0 for e in equations):
        return Solutions(nothing, none, False)
    if any(len(e) == 1 and not any(next(iter(e))) for e in equations):
        return Solutions(nothing, none, True)
    scales, sizes = units(equations, ranges)
    scaled = [_scaled(q, scales, sizes[k]) for k, q in enumerate(equations)]
    sides = [side for one in within for side in _sides(*one)]
    limiting = [_scaled(q, scales, _normalising(q, scales)) for q in sides]
    lost = any(abs(c) < np.finfo(float).tiny for q in (*scaled, *limiting) for c in q.values())
    if lost or not all(SMALLEST <= s <= 1 / SMALLEST for s in scales):
        # numbers that floating point does not represent
        return Solutions(nothing, none, False)
    free = [m for m in range(count) if m not in ranges and m not in bounds]
    limits = {m: tuple(float(Fraction(v) / scales[m]) for v in ranges[m]) for m in ranges}
    outer = {m: float(Fraction(v) / scales[m]) for m, v in bounds.items()}
    # coefficients far from one leave room for solutions far from their units
    reach = max(abs(math.log10(abs(c))) for q in scaled for c in q.values() if c)
    widest = 200.0 / max(1, *(sum(e) for q in scaled for e in q))
    farthest = 10.0 ** min(math.log10(FARTHEST) + reach, widest)
    nearest = 10.0 ** -min(-math.log10(SMALLEST_RELATIVE) + reach, widest)
    floor = np.array(
        [limits[m][1] - limits[m][0] if m in limits else nearest for m in range(count)]
    )
    simple: list[Array] = []
    clusters: list[Array] = []
    budget = BUDGET
    for chart in _charts(free):
        charted = [
            *(_charted(q, chart) for q in scaled),
            *(_charted(q, chart, even=True) for q in limiting),
        ]
        found = _isolated(charted, limits, outer, floor, chart, farthest, budget)
        if found is None:
            return Solutions(nothing, none, False)
        budget -= found[2]
        simple += [_back(x, chart) for x in found[0]]
        clusters += [_around(box, chart) for box in found[1]]
    kept = _distinct(_polished(scaled, simple), floor, 1e-10)
    for m, (low, high) in limits.items():
        slack = 1e-9 * floor[m]
        kept = kept[(kept[:, m] >= low - slack) & (kept[:, m] <= high + slack)]
    unit = np.array([float(s) for s in scales])
    merged = _merged(clusters, floor)
    return Solutions(
        kept[in_order(kept, np.ones(count))] * unit,
        merged * unit,
        # where powers overflow, not all of the range that the coefficients ask for is searched
        reach <= widest and (not clusters or _narrow(merged, floor, ranges)),
    )


def _narrow(boxes: Array, floor: Array, ranges: Mapping[int, object]) -> bool:
    """Check that boxes are narrower than the resolution in the decisive unknowns."""
    count = len(floor)
    decisive = np.array([m in ranges or not ranges for m in range(count)])
    wide = np.where(decisive, floor, 1.0) if ranges else np.ones(count)
    width = (boxes[:, 1] - boxes[:, 0]) / np.maximum(np.abs(boxes).max(axis=1), wide)
    return bool(np.all(width[:, decisive] <= RESOLUTION))


def _isolated(
    equations: Sequence[Mapping[tuple[int, ...], float]],
    limits: Mapping[int, tuple[float, ...]],
    bounds: Mapping[int, float],
    floor: Array,
    chart: tuple[int, ...],
    farthest: float,
    budget: int,
) -> tuple[Array, Array, int] | None:
    """Solutions, clusters and work in one chart; None if the budget is exceeded.

    After the equations, as many as unknowns, come functions that must not be negative.
    """
    count, rows = len(floor), len(equations)
    degrees = np.array([max(e[m] for q in equations for e in q) for m in range(count)])
    size = math.prod(int(d) + 1 for d in degrees)
    if size > LARGEST_EQUATION:
        return None
    power = np.zeros((rows, size))
    for k, terms in enumerate(equations):
        tensor = power[k].reshape(tuple(int(d) + 1 for d in degrees))
        for exponents, coefficient in terms.items():
            tensor[exponents] = coefficient
    intervals: list[list[tuple[float, ...]]] = []
    for m in range(count):
        if m in limits:
            intervals.append([limits[m]])
        elif m in chart:
            least = 1.0 / farthest if m == chart[0] else COMPARABLE
            intervals.append([(-1.0, -least), (least, 1.0)])
        else:
            outer = bounds.get(m, COMPARABLE * farthest if chart else 1.0)
            inner = min(float(floor[m]), 0.5 * outer)
            intervals.append([(-outer, -inner), (-inner, inner), (inner, outer)])
    boxes = list(itertools.product(*intervals))
    low, high = (np.array([[ends[k] for ends in box] for box in boxes]) for k in (0, 1))
    limit = budget // (rows * size)
    free = np.array([m not in limits for m in range(count)])
    inverse = chart[0] if chart else -1
    fixed = {*limits, *bounds, *chart}
    small = np.array([bool(chart) and m not in fixed for m in range(count)])
    capacity = 128 * count + 16
    shapes = ((rows, size), (rows,), (count,), (count,))
    stack = Boxes(*(np.empty((capacity, *shape)) for shape in shapes))
    solutions, clusters = np.empty((64, count)), np.empty((64, 2, count))
    progress = np.zeros(6, dtype=np.int64)
    space = isolation_space(count, rows, size, int(max(degrees)))
    polynomials = Polynomials(power, degrees)
    subdivision = Subdivision(
        low=low,
        high=high,
        logarithmic=free,
        floor=floor,
        tolerance=NARROWEST_BOX,
        budget=limit,
        large=inverse,
        small=small,
        share=COMPARABLE,
    )
    code = PAUSED
    while code != 0:
        # a box is examined by products of all coefficients with those of every unknown
        progress[5] = max(1, WORK // (4 * count * count * size))
        code = loop("isolate")(
            polynomials, subdivision, stack, Isolated(solutions, clusters, progress), space
        )
        if code == TABLE_FULL:
            solutions, clusters = (
                np.concatenate([table, np.empty_like(table)]) for table in (solutions, clusters)
            )
    _, _, found, unclear, evaluated_boxes, _ = progress.tolist()
    if evaluated_boxes > limit:
        return None
    return solutions[:found], clusters[:unclear], evaluated_boxes * rows * size


def _charts(free: Sequence[int]) -> list[tuple[int, ...]]:
    """Charts: the largest unknown and those comparable to it; first that without large ones."""
    charts: list[tuple[int, ...]] = [()]
    for largest in free:
        others = [m for m in free if m != largest]
        for count in range(len(others) + 1):
            charts += [(largest, *some) for some in itertools.combinations(others, count)]
    return charts


def _charted(
    terms: Mapping[tuple[int, ...], float], chart: tuple[int, ...], even: bool = False
) -> Mapping[tuple[int, ...], float]:
    """Transform an equation to a chart, times a power, or an even one, of its first coordinate."""
    if not chart:
        return terms
    degree = max(sum(powers[m] for m in chart) for powers in terms)
    degree += degree % 2 if even else 0
    found = {}
    for powers, coefficient in terms.items():
        changed = list(powers)
        changed[chart[0]] = degree - sum(powers[m] for m in chart)
        found[tuple(changed)] = coefficient
    return found


def _back(points: Array, chart: tuple[int, ...]) -> Array:
    """Transform points of a chart, shape (…, N), to the original unknowns."""
    x = np.array(points, dtype=float)
    if chart:
        x[..., list(chart)] /= points[..., chart[:1]]
        x[..., chart[0]] = 1.0 / points[..., chart[0]]
    return x


def _around(box: Array, chart: tuple[int, ...]) -> Array:
    """Enclosing box in the original unknowns of a box in a chart."""
    count = box.shape[1]
    sides = np.array(list(itertools.product((0, 1), repeat=count)))
    corners = _back(box[sides, np.arange(count)], chart)
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def units(
    equations: Sequence[Terms], ranges: Mapping[int, tuple[float, float]]
) -> tuple[list[Fraction], list[Fraction]]:
    """Scale unknowns and equations by powers of two so that coefficients are close to one.

    The logarithms of all coefficients and their differences within each equation are
    minimised in least squares (Morgan 1987, chapter 5). The solutions are independent of the
    units of the unknowns.

    Returns
    -------
    list of Fraction, list of Fraction
        Units of the unknowns, and factors of the equations.
    """
    count = len(equations)
    unknowns = len(next(iter(equations[0])))
    free = [m for m in range(unknowns) if m not in ranges]
    if count == unknowns == len(free) == 1:
        return _units_of_one(equations[0])
    rows: list[Array] = []
    values: list[Array] = []
    for k, terms in enumerate(equations):
        logs, exponents = [], []
        for powers, coefficient in terms.items():
            size = _log2(coefficient)
            for m, (low, high) in ranges.items():
                size += powers[m] * math.log2(max(abs(low), abs(high), 1e-300))
            logs.append(size)
            exponents.append([powers[m] for m in free])
        block = np.array(exponents, dtype=float).reshape(len(logs), len(free))
        marks = np.zeros((len(logs), count))
        marks[:, k] = 1.0
        rows.append(np.hstack([block, marks]))
        values.append(-np.array(logs))
        # the sum of squared differences of all pairs, as distances from their mean
        weight = math.sqrt(len(logs))
        rows.append(weight * np.hstack([block - block.mean(axis=0), 0.0 * marks]))
        values.append(-weight * (np.array(logs) - np.mean(logs)))
    found = np.linalg.lstsq(np.vstack(rows), np.hstack(values), rcond=1e-10)[0]
    exponents_of_two = [round(float(v)) for v in found]
    scales = [Fraction(1)] * unknowns
    for m, exponent in zip(free, exponents_of_two, strict=False):
        scales[m] = Fraction(2) ** exponent
    for m, (low, high) in ranges.items():
        largest = max(abs(low), abs(high))
        scales[m] = Fraction(2) ** round(math.log2(largest)) if largest > 0 else Fraction(1)
    return scales, [_normalising(terms, scales) for terms in equations]


def _normalising(terms: Terms, scales: Sequence[Fraction]) -> Fraction:
    """Return the power of two by which the largest coefficient in given units is close to one."""
    largest = max(
        _log2(c) + sum(p * _log2(s) for p, s in zip(powers, scales, strict=True))
        for powers, c in terms.items()
    )
    return Fraction(2) ** -round(largest)


def _sides(terms: Terms, low: float, high: float) -> list[Terms]:
    """Return two functions that are not negative where one is within a range."""
    zero = (0,) * len(next(iter(terms), ()))
    found = []
    for sign, bound in ((1, low), (-1, high)):
        side = {powers: sign * Fraction(c) for powers, c in terms.items()}
        side[zero] = side.get(zero, Fraction(0)) - sign * Fraction(bound)
        found.append({powers: c for powers, c in side.items() if c})
    return [side for side in found if any(any(powers) for powers in side)]


def _units_of_one(terms: Terms) -> tuple[list[Fraction], list[Fraction]]:
    """Scale one equation in one unknown by a linear fit of logarithms over exponents."""
    powers = [e for (e,) in terms]
    logs = [_log2(c) for c in terms.values()]
    power, log = sum(powers) / len(powers), sum(logs) / len(logs)
    variance = sum((e - power) ** 2 for e in powers)
    slope = sum((e - power) * (v - log) for e, v in zip(powers, logs, strict=True))
    unit = -slope / variance if variance else -log * power / (power**2 + 1.0)
    exponent = round(unit)
    largest = max(v + e * exponent for e, v in zip(powers, logs, strict=True))
    return [Fraction(2) ** exponent], [Fraction(2) ** -round(largest)]


def at_value(terms: Terms, unknown: int, value: Fraction) -> Terms:
    """Substitute a number for an unknown; the result is scaled by a positive integer.

    Examples
    --------
    >>> at_value({(1, 2): 3, (0, 1): 1}, 0, Fraction(1, 2))
    {(2,): 3, (1,): 2}
    """
    degree = max((powers[unknown] for powers in terms), default=0)
    numerator, denominator = value.numerator, value.denominator
    table = [numerator**k * denominator ** (degree - k) for k in range(degree + 1)]
    found: dict[tuple[int, ...], Fraction | int] = {}
    for powers, coefficient in terms.items():
        rest = (*powers[:unknown], *powers[unknown + 1 :])
        found[rest] = found.get(rest, 0) + coefficient * table[powers[unknown]]
    return {powers: c for powers, c in found.items() if c != 0}


def _log2(value: Fraction | int) -> float:
    return math.log2(abs(value.numerator)) - math.log2(value.denominator)


def _scaled(
    terms: Terms, scales: Sequence[Fraction], size: Fraction
) -> dict[tuple[int, ...], float]:
    """Coefficients of a scaled equation, rounded once."""
    shifts = [_log2_of_unit(s) for s in scales]
    shift = _log2_of_unit(size)
    found = {}
    for powers, c in terms.items():
        moved = shift + sum(s * p for s, p in zip(shifts, powers, strict=True))
        n, d = c.numerator, c.denominator
        # true division rounds once
        found[powers] = (n << moved) / d if moved >= 0 else n / (d << -moved)
    return found


def _log2_of_unit(unit: Fraction) -> int:
    """Binary logarithm of a power of two."""
    return unit.numerator.bit_length() - unit.denominator.bit_length()


def _polished(
    equations: Sequence[Mapping[tuple[int, ...], float]], points: Sequence[Array]
) -> list[Array]:
    """Refine simple solutions by Newton's method."""
    if len(equations) == 1:
        return [_polished_root(equations[0], float(point[0])) for point in points]
    # exponents (T, N) and coefficients (T,) of every equation
    system = [(np.array(list(q), dtype=np.int64), np.array(list(q.values()))) for q in equations]
    return [_polished_point(system, point) for point in points]


@np.errstate(all="ignore")
def _polished_point(system: Sequence[tuple[NDArray[np.int64], Array]], point: Array) -> Array:
    count = len(point)
    best, least = point, np.inf
    for _ in range(20):
        value, slopes = np.empty(count), np.empty((count, count))
        for k, (exponents, coefficients) in enumerate(system):
            value[k] = coefficients @ np.prod(point**exponents, axis=1)
            for m in range(count):
                lowered = exponents.copy()
                lowered[:, m] = np.maximum(lowered[:, m] - 1, 0)
                powers = np.prod(point**lowered, axis=1) * exponents[:, m]
                slopes[k, m] = coefficients @ powers
        try:
            step = np.linalg.solve(slopes, -value)
        except np.linalg.LinAlgError:
            return best
        size = float(np.abs(step).max())
        if not size < least:
            return best
        best, least = point + step, size
        point = best
    return best


def _polished_root(terms: Mapping[tuple[int, ...], float], near: float) -> Array:
    """Refine a root of one polynomial by Newton's method."""
    powers = [0.0] * (1 + max(e for (e,) in terms))
    for (exponent,), coefficient in terms.items():
        powers[exponent] = coefficient
    best = x = near
    least = math.inf
    for _ in range(20):
        value = slope = 0.0
        for coefficient in reversed(powers):
            slope = slope * x + value
            value = value * x + coefficient
        if slope == 0.0:
            break
        step = -value / slope
        if not abs(step) < least:
            break
        best, least = x + step, abs(step)
        x = best
    return np.array([best])


def _distinct(points: Sequence[Array], floor: Array, within: float) -> Array:
    """Remove duplicates of points up to a relative tolerance."""
    kept: list[Array] = []
    for point in points:
        near = within * np.maximum(np.abs(point), floor)
        if not any(np.all(np.abs(point - other) <= near) for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, len(floor))


def _merged(boxes: Sequence[Array], floor: Array) -> Array:
    """Merge touching boxes into enclosing boxes."""
    kept = np.empty((0, 2, len(floor)))
    for box in boxes:
        here = box
        while True:
            slack = 1e-9 * np.maximum(np.abs(here).max(axis=0), floor)
            touching = np.all(
                (kept[:, 0] <= here[1] + slack) & (here[0] <= kept[:, 1] + slack), axis=1
            )
            if not touching.any():
                break
            joined = np.vstack([here[None], kept[touching]])
            here = np.array([joined[:, 0].min(axis=0), joined[:, 1].max(axis=0)])
            kept = kept[~touching]
        kept = np.vstack([kept, here[None]])
    return kept
