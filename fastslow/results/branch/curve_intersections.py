"""Intersections of two curves in the plane of two columns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.branch.table import BranchTable

Array = NDArray[np.float64]

#: Distance, as a fraction of the extent of both curves, below which a row is on the other
#: curve and two intersections are the same.
ON_OTHER_CURVE = 1e-6

#: Number of consecutive rows on the other curve from which both curves overlap; curves that
#: cross have at most one, and curves that touch have few.
OVERLAPPING_ROWS = 5

#: Two curves are the same if more than this fraction of the steps overlap.
SAME_CURVE_SHARE = 0.9

#: Number of rows by which overlapping curves are compared in other columns.
SAMPLED = 25

#: Sine of the angle from which the intersection of chords implies one of the curves.
WIDE = 0.2

#: A column is constant up to rounding if less than this fraction of its variation is in the
#: direction of its tangents.
ONWARD = 0.5

#: Distance of two cubics at an intersection, as a fraction of the extent of both curves.
AT_INTERSECTION = 1e-8


def intersections(one: BranchTable, other: BranchTable, names: tuple[str, str]) -> Array:
    """Compute the intersections of two curves in a plane; see `Branch.intersections`."""
    if one is other:
        raise ArgumentError("expected two different curves, received the same one twice")
    if names[0] == names[1]:
        raise ArgumentError(f"expected two different columns, received {names[0]!r} twice")
    lines, slopes = [], []
    for curve in (one, other):
        for name in names:
            if name not in curve.names:
                raise unknown_name("column", name, curve.names)
        both = [curve.names.index(name) for name in names]
        lines.append(curve.points[:, both])
        slopes.append(tuple(slope[:, both] for slope in step_slopes(curve)))
    scale = np.ptp(np.concatenate(lines), axis=0)
    scale[scale == 0] = 1.0
    lines = [line / scale for line in lines]
    i, j = _overlapping(lines[0], lines[1])
    along = _along(lines, [tuple(s / scale for s in pair) for pair in slopes], i, j)
    if along.size and along.mean() > SAME_CURVE_SHARE:
        plane = f"the curves coincide in the plane of {names[0]} and {names[1]}: they "
        apart_in = _differing(one, other)
        if apart_in:
            raise ArgumentError(
                f"{plane}differ only in {', '.join(apart_in)}; expected columns that differ"
            )
        raise ArgumentError(f"{plane}are one curve, traced twice; expected another curve")
    apart = ~along[i]
    i, j = i[apart], j[apart]
    part, crossing = _chord_intersections(lines[0], lines[1], i, j)
    i, j, part = i[crossing], j[crossing], part[crossing]
    cubics = [
        _cubic(line[:-1][k], line[1:][k], before[k] / scale, after[k] / scale)
        for line, (before, after), k in zip(lines, slopes, (i, j), strict=True)
    ]
    part, points, kept = _refined(cubics[0], cubics[1], part)
    part, points, i = part[kept], points[kept], i[kept]
    order = np.argsort(i + part, kind="stable")
    distinct: list[Array] = []
    for point in points[order]:
        if all(np.abs(point - known).max() > ON_OTHER_CURVE for known in distinct):
            distinct.append(point)
    return np.array(distinct).reshape(-1, 2) * scale


def _differing(one: BranchTable, other: BranchTable) -> list[str]:
    """Return the columns in which two curves that coincide in a plane differ.

    A row of one curve is on the other if its distance from a step is less than the length of
    the step, in units of the extents.
    """
    names = [name for name in one.names if name in other.names]
    first, second = (c.points[:, [c.names.index(name) for name in names]] for c in (one, other))
    unit = np.ptp(np.concatenate([first, second]), axis=0)
    unit[unit == 0] = 1.0
    rows = first[np.linspace(0, len(first) - 1, SAMPLED).astype(int)] / unit
    begin, chord = second[:-1] / unit, np.diff(second / unit, axis=0)
    length = np.linalg.norm(chord, axis=1)
    gap = rows[:, None] - begin
    part = (gap * chord).sum(axis=2) / np.maximum(length**2, 1e-300)
    gap -= np.clip(part, 0.0, 1.0)[..., None] * chord
    distance = np.linalg.norm(gap, axis=2)
    nearest = np.argmin(distance, axis=1)
    each = np.arange(len(rows))
    if np.mean(distance[each, nearest] > length[nearest]) <= 0.5:
        return []
    apart = np.median(np.abs(gap[each, nearest]), axis=0) > ON_OTHER_CURVE
    return [name for name, differs in zip(names, apart, strict=True) if differs]


def step_slopes(curve: BranchTable) -> tuple[Array, Array]:
    """Return the derivatives of every step's cubic at its two ends, each of shape (N − 1, k).

    They are the tangents scaled to the length of the chord in units of the columns' extents;
    the cubic is a function of the fraction of the step.
    """
    points = curve.points
    chords = np.diff(points, axis=0)
    unit = np.ptp(points, axis=0) if len(points) else np.ones(points.shape[1])
    # a column that is constant up to rounding does not follow its tangents
    onward = (chords * np.sign(curve.tangent[:-1] + curve.tangent[1:])).sum(axis=0)
    unit[onward <= ONWARD * np.abs(chords).sum(axis=0)] = np.inf
    tangents = curve.tangent / unit
    size = np.linalg.norm(tangents, axis=1, keepdims=True)
    tangents = tangents / np.where(size > 0, size, 1.0)
    length = np.linalg.norm(chords / unit, axis=1, keepdims=True)
    leaving, arriving = tangents[:-1] * length, tangents[1:] * length
    still = np.isinf(unit)
    unit[still] = 0.0
    return leaving * unit + chords * still, arriving * unit + chords * still


def _along(
    lines: list[Array],
    slopes: list[tuple[Array, ...]],
    i: NDArray[np.intp],
    j: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Mark the steps of the first curve that overlap the second, from candidate pairs of steps."""
    first, second = lines
    on = np.zeros(len(first), dtype=bool)
    cubics = _cubic(second[:-1][j], second[1:][j], slopes[1][0][j], slopes[1][1][j])
    chord = second[1:][j] - second[:-1][j]
    length = np.maximum((chord**2).sum(axis=1), 1e-300)
    for end in (0, 1):
        rows = i + end
        gap = first[rows] - second[:-1][j]
        part = np.clip((gap * chord).sum(axis=1) / length, 0.0, 1.0)
        for _ in range(4):
            # Newton's method for the foot of the perpendicular
            point, slope = _value(cubics, part)
            steep = np.maximum((slope**2).sum(axis=1), 1e-300)
            part = np.clip(part - ((point - first[rows]) * slope).sum(axis=1) / steep, 0.0, 1.0)
        near = np.abs(_value(cubics, part)[0] - first[rows]).max(axis=1) <= ON_OTHER_CURVE
        on[rows[near]] = True
    both = on[:-1] & on[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], both.astype(int), [0]])))
    for begin, end in edges.reshape(-1, 2):
        if end - begin < min(OVERLAPPING_ROWS, len(both)):
            both[begin:end] = False
    return both


def _boxes(line: Array) -> list[tuple[Array, Array]]:
    """Return a tree of bounding boxes: of the steps of a line, of pairs of steps, and so on."""
    low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    levels = [(low, high)]
    while len(low) > 1:
        if len(low) % 2:
            low = np.concatenate([low, np.full((1, 2), np.inf)])
            high = np.concatenate([high, np.full((1, 2), -np.inf)])
        low, high = np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])
        levels.append((low, high))
    return levels


def _overlapping(first: Array, second: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pairs of steps whose bounding boxes overlap, by descending both trees."""
    if len(first) < 2 or len(second) < 2:
        nothing = np.empty(0, dtype=np.intp)
        return nothing, nothing
    trees = _boxes(first), _boxes(second)
    depth = [len(tree) - 1 for tree in trees]
    pair = [np.zeros(1, dtype=np.intp), np.zeros(1, dtype=np.intp)]
    while max(depth) > 0:
        down = int(depth[1] > depth[0])
        depth[down] -= 1
        pair = [np.repeat(p, 2) for p in pair]
        pair[down] = 2 * pair[down] + np.tile([0, 1], len(pair[down]) // 2)
        real = pair[down] < len(trees[down][depth[down]][0])
        pair = [p[real] for p in pair]
        (low, high), (low2, high2) = (trees[k][depth[k]] for k in (0, 1))
        touch = (low[pair[0]] <= high2[pair[1]]) & (low2[pair[1]] <= high[pair[0]])
        pair = [p[touch.all(axis=1)] for p in pair]
    return pair[0], pair[1]


def _cross(one: Array, other: Array) -> Array:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def _chord_intersections(
    first: Array, second: Array, i: NDArray[np.intp], j: NDArray[np.intp]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the fractions of both steps at which their chords intersect, (K, 2), and a mask."""
    one, other = first[i + 1] - first[i], second[j + 1] - second[j]
    away = second[j] - first[i]
    area = _cross(one, other)
    slanted = np.abs(area) > 1e-12 * np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    part = np.column_stack([_cross(away, other), _cross(away, one)])
    part /= np.where(slanted, area, 1.0)[:, None]
    return part, slanted & (np.abs(part - 0.5) <= 0.5 + 1e-9).all(axis=1)


def _cubic(start: Array, end: Array, leaving: Array, arriving: Array) -> Array:
    """Return the coefficients of the cubics with given ends and slopes, shape (K, 4, 2)."""
    chord = end - start
    return np.stack(
        [start, leaving, 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord], axis=1
    )


def _value(cubic: Array, part: Array) -> tuple[Array, Array]:
    """Return the points and slopes of cubics at one fraction each."""
    s = part[:, None]
    a, b, c, d = cubic.swapaxes(0, 1)
    return a + s * (b + s * (c + s * d)), b + s * (2 * c + s * 3 * d)


def _refined(one: Array, other: Array, part: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Compute intersections of cubics by Newton's method from those of their chords.

    Returns the fraction of the first step, the points, and a mask of valid intersections;
    if Newton's method leaves the steps, those of chords at a large angle are valid.
    """
    begin, end = one[:, 0], one.sum(axis=1)
    straight = begin + part[:, :1] * (end - begin)
    now = part.copy()
    with np.errstate(all="ignore"):
        for _ in range(8):
            (p, dp), (q, dq) = _value(one, now[:, 0]), _value(other, now[:, 1])
            step = np.column_stack([_cross(q - p, dq), _cross(q - p, dp)])
            now = now + step / _cross(dp, dq)[:, None]
        points = _value(one, now[:, 0])[0]
        apart = np.abs(points - _value(other, now[:, 1])[0]).max(axis=1)
    good = (np.abs(now - 0.5) <= 0.6).all(axis=1) & (apart <= AT_INTERSECTION)
    chords = end - begin, other.sum(axis=1) - other[:, 0]
    size = np.linalg.norm(chords[0], axis=1) * np.linalg.norm(chords[1], axis=1)
    # chords at a small angle may intersect where the curves do not
    wide = np.abs(_cross(*chords)) > WIDE * size
    places = np.where(good, now[:, 0], part[:, 0])
    return places, np.where(good[:, None], points, straight), good | wide
