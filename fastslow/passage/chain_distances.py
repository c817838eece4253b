"""Distances of points from a polygonal curve, compiled."""

from __future__ import annotations

import math

import numpy as np

from fastslow.compiled.parts import unfused_part


@unfused_part
def count_below(chain, value, included):
    """How many vertices have a last coordinate below a value, or at it where that is included."""
    last = chain.shape[1] - 1
    low, high = 0, chain.shape[0]
    while low < high:
        middle = (low + high) // 2
        if chain[middle, last] < value or (included and chain[middle, last] == value):
            low = middle + 1
        else:
            high = middle
    return low


@unfused_part
def square_to_vertex(points, i, chain, k):
    """Square of the distance of a point from a vertex."""
    square = 0.0
    for j in range(chain.shape[1]):
        square += (points[j, i] - chain[k, j]) ** 2
    return square


@unfused_part
def nearness_to_chain(points, chain, radius, near):
    """How much nearer than a radius points are to a curve whose last coordinate does not fall.

    Parameters
    ----------
    points : ndarray, shape (d, N)
    chain : ndarray, shape (M, d)
        Vertices, evenly spaced.
    radius : float
    near : ndarray, shape (N,)
        Filled: the radius less the distance near the nearest vertex; −radius for a point
        that differs by the radius or more from every vertex in the last coordinate.
    """
    count, size = chain.shape
    last = size - 1
    for i in range(points.shape[1]):
        near[i] = -radius
        value = points[last, i]
        # a chord may reach farther than its ends: one vertex more on both sides
        first = max(count_below(chain, value - radius, False) - 1, 0)
        stop = min(count_below(chain, value + radius, True) + 1, count)
        if chain[first, last] >= value + radius or chain[stop - 1, last] <= value - radius:
            continue
        least, nearest = np.inf, -1
        # from the middle outwards, as far as the last coordinate alone leaves a vertex nearer
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
            # of vertices at the same distance the first
            if square <= least:
                least, nearest = square, k
        if nearest < 0:
            continue
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
        near[i] = radius - math.sqrt(least)
