"""Compiled distances of points from a polygonal curve."""

from __future__ import annotations

import math

import numpy as np

from fastslow.kernels.compiler.decorators import unfused_kernel


@unfused_kernel
def count_below(chain, value, included):
    """Count the vertices whose last coordinate is below a value, or equal if included."""
    last = chain.shape[1] - 1
    low, high = 0, chain.shape[0]
    while low < high:
        middle = (low + high) // 2
        if chain[middle, last] < value or (included and chain[middle, last] == value):
            low = middle + 1
        else:
            high = middle
    return low


@unfused_kernel
def square_to_vertex(points, i, chain, k):
    """Squared distance of a point from a vertex."""
    square = 0.0
    for j in range(chain.shape[1]):
        square += (points[j, i] - chain[k, j]) ** 2
    return square


@unfused_kernel
def nearest_vertex(points, i, chain, first, stop):
    """Squared distance of a point from the nearest of some vertices, and its index."""
    last = chain.shape[1] - 1
    value = points[last, i]
    least, nearest = np.inf, -1
    # from the middle outwards, until the last coordinate alone exceeds the distance
    middle = min(max(count_below(chain, value, False), first), stop)
    for k in range(middle, stop):
        ahead = value - chain[k, last]
        if ahead * ahead > least:
            break
        square = square_to_vertex(points, i, chain, k)
        if square < least:
            least, nearest = square, k
    for k in range(middle - 1, first - 1, -1):
        ahead = value - chain[k, last]
        if ahead * ahead > least:
            break
        square = square_to_vertex(points, i, chain, k)
        # ties go to the first vertex
        if square <= least:
            least, nearest = square, k
    return least, nearest


@unfused_kernel
def nearness_of(points, i, chain, radius):
    """Radius minus the distance of one point from a curve."""
    count, size = chain.shape
    last = size - 1
    value = points[last, i]
    # a chord may be nearer than its ends: one vertex more on both sides
    first = max(count_below(chain, value - radius, False) - 1, 0)
    stop = min(count_below(chain, value + radius, True) + 1, count)
    if chain[first, last] >= value + radius or chain[stop - 1, last] <= value - radius:
        return -radius
    least, nearest = nearest_vertex(points, i, chain, first, stop)
    if nearest < 0:
        return -radius
    for k in range(max(nearest - 1, 0), min(nearest + 1, count - 1)):
        length = along = 0.0
        for j in range(size):
            chord = chain[k + 1, j] - chain[k, j]
            length += chord * chord
            along += (points[j, i] - chain[k, j]) * chord
        part = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
        square = 0.0
        for j in range(size):
            chord = chain[k + 1, j] - chain[k, j]
            square += (points[j, i] - chain[k, j] - part * chord) ** 2
        least = min(least, square)
    return radius - math.sqrt(least)


@unfused_kernel
def nearness_to_chain(points, chain, radius, near):
    """Radius minus the distances of points from a curve with nondecreasing last coordinate.

    Parameters
    ----------
    points : ndarray, shape (d, N)
    chain : ndarray, shape (M, d)
        Vertices, evenly spaced.
    radius : float
    near : ndarray, shape (N,)
        Output: the radius minus the distance near the nearest vertex; −radius for a point
        that differs by the radius or more from every vertex in the last coordinate.
    """
    for i in range(points.shape[1]):
        near[i] = nearness_of(points, i, chain, radius)


@unfused_kernel
def beside_chain(points, chain, radius, beside):
    """Points of a path nearer than a radius to a curve, consistent with `nearness_to_chain`.

    Most points are skipped, as the distance from the nearest vertex changes by no more than
    the displacement along the path.

    Parameters
    ----------
    points : ndarray, shape (d, N)
        In order along a path.
    chain : ndarray, shape (M, d)
    radius : float
    beside : ndarray of bool, shape (N,)
        Output.
    """
    count, size = chain.shape
    longest = 0.0
    for k in range(count - 1):
        square = 0.0
        for j in range(size):
            square += (chain[k + 1, j] - chain[k, j]) ** 2
        longest = max(longest, square)
    # the curve is nearer than its vertices by at most a chord; with a margin for rounding
    far, close = (radius + math.sqrt(longest)) * (1.0 + 1e-9), radius * (1.0 - 1e-9)
    seen, distance = 0, math.nan
    for i in range(points.shape[1]):
        moved = 0.0
        for j in range(size):
            moved += (points[j, i] - points[j, seen]) ** 2
        moved = math.sqrt(moved)
        if not (distance - moved > far or distance + moved < close):
            square, _ = nearest_vertex(points, i, chain, 0, count)
            seen, distance, moved = i, math.sqrt(square), 0.0
        if distance - moved > far:
            beside[i] = False
        elif distance + moved < close:
            beside[i] = True
        else:
            beside[i] = nearness_of(points, i, chain, radius) > 0.0
