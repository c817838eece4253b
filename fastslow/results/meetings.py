"""Where two curves meet in the plane of two columns."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import instance
from fastslow.errors import ArgumentError, unknown_name

Array = NDArray[np.float64]

#: Meetings closer than this part of the extent of both curves are one.
SAME = 1e-8


class Curve(Protocol):
    """What is asked of a curve: its rows, and its unit tangents."""

    @property
    def points(self) -> Array:
        """Columns in the order of the tangents, shape (N, k)."""

    @property
    def point_names(self) -> tuple[str, ...]:
        """Their names."""

    @property
    def tangent(self) -> Array:
        """Shape (N, k)."""


def intersections(one: Curve, other: Curve, names: tuple[str, str]) -> Array:
    """Points common to two curves in a plane; see `Branch.intersections`."""
    instance(type(one))("other", other)
    if one is other:
        raise ArgumentError("expected another curve; every point of a curve is common with itself")
    if names[0] == names[1]:
        raise ArgumentError(f"expected two different columns, received {names[0]!r} twice")
    lines, slopes = [], []
    for curve in (one, other):
        for name in names:
            if name not in curve.point_names:
                raise unknown_name("column", name, curve.point_names)
        both = [curve.point_names.index(name) for name in names]
        chord = np.linalg.norm(np.diff(curve.points, axis=0), axis=1, keepdims=True)
        lines.append(curve.points[:, both])
        slopes.append((curve.tangent[:-1][:, both] * chord, curve.tangent[1:][:, both] * chord))
    scale = np.ptp(np.concatenate(lines), axis=0)
    scale[scale == 0] = 1.0
    lines = [line / scale for line in lines]
    i, j = _overlapping(lines[0], lines[1])
    part, meet = _met(lines[0], lines[1], i, j)
    i, j, part = i[meet], j[meet], part[meet]
    cubics = [
        _cubic(line[:-1][k], line[1:][k], before[k] / scale, after[k] / scale)
        for line, (before, after), k in zip(lines, slopes, (i, j), strict=True)
    ]
    part, points = _refined(cubics[0], cubics[1], part)
    order = np.argsort(i + part, kind="stable")
    distinct: list[Array] = []
    for point in points[order]:
        if all(np.abs(point - known).max() > SAME for known in distinct):
            distinct.append(point)
    return np.array(distinct).reshape(-1, 2) * scale


def _boxes(line: Array) -> list[tuple[Array, Array]]:
    """Bounding boxes of the steps of a line, of pairs of them, and so on up to one."""
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
    """Pairs of steps whose boxes overlap, from the top of both trees down."""
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


def _met(
    first: Array, second: Array, i: NDArray[np.intp], j: NDArray[np.intp]
) -> tuple[Array, NDArray[np.bool_]]:
    """Where on both steps straight lines meet (K, 2), and whether they do."""
    one, other = first[i + 1] - first[i], second[j + 1] - second[j]
    away = second[j] - first[i]
    area = _cross(one, other)
    slanted = np.abs(area) > 1e-12 * np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    part = np.column_stack([_cross(away, other), _cross(away, one)])
    part /= np.where(slanted, area, 1.0)[:, None]
    return part, slanted & (np.abs(part - 0.5) <= 0.5 + 1e-9).all(axis=1)


def _cubic(start: Array, end: Array, leaving: Array, arriving: Array) -> Array:
    """Coefficients of the cubics with these ends and slopes, shape (K, 4, 2)."""
    chord = end - start
    return np.stack(
        [start, leaving, 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord], axis=1
    )


def _value(cubic: Array, part: Array) -> tuple[Array, Array]:
    """Points and slopes of cubics, one each."""
    s = part[:, None]
    a, b, c, d = cubic.swapaxes(0, 1)
    return a + s * (b + s * (c + s * d)), b + s * (2 * c + s * 3 * d)


def _refined(one: Array, other: Array, part: Array) -> tuple[Array, Array]:
    """Meetings of cubics by Newton's method from those of the straight lines between their ends.

    Returns the part of the first step and the points; where Newton's method
    leaves the steps, those of the straight lines.
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
    good = (np.abs(now - 0.5) <= 0.6).all(axis=1) & (apart <= SAME)
    return np.where(good, now[:, 0], part[:, 0]), np.where(good[:, None], points, straight)
