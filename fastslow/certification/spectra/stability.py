"""Stability proved along proved curves, and all folds and Hopf points on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.certification.boxes.krawczyk import KrawczykSpace
from fastslow.certification.boxes.linking import (
    COLUMNS,
    SHORTEST_ARC,
    Arcs,
    IntervalProblem,
    enclosed,
    halved,
)
from fastslow.certification.boxes.pruning import workspace
from fastslow.certification.spectra.linearisations import Linearisation, along_curves
from fastslow.certification.spectra.spectra import Spectra, spectra_of
from fastslow.results.point_types import BOUNDARY_EQUILIBRIUM, POINT_TYPES

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

#: Largest number of divisions of an arc.
ARC_DIVISIONS = 40

#: Largest number of undecided parts of one arc at once, and of those in which one eigenvalue is
#: proved to meet the imaginary axis at most once: more of them are not near isolated points.
MOST_PARTS, MOST_OF_ONE = 256, 64

#: Arcs whose eigenvalues are bounded at once.
_ARCS_AT_ONCE = 2048

#: Codes of the points at which one eigenvalue, or two, cross the imaginary axis.
_CODES = {one.unstable: code for code, one in POINT_TYPES.items() if one.certified and one.event}


@dataclass(frozen=True, eq=False)
class ProvedCrossing:
    """A proved point of a curve, the only one of its kind in boxes around arcs of the curve.

    Parameters
    ----------
    code : str
    low, high : ndarray, shape (N,)
        Bounds of the point in all unknowns.
    near_low, near_high : ndarray, shape (k, N)
        The boxes.
    interface : str
        The interface of a boundary equilibrium.
    """

    code: str
    low: Array
    high: Array
    near_low: Array
    near_high: Array
    interface: str = ""


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts of arcs, in order along each curve.

    Parameters
    ----------
    arcs : Arcs
    curve, arc : ndarray of int
        The numbers of curve and arc.
    kind, sign : ndarray of int
        See `Spectra`; the sign is that of the derivative in the direction of the curve.
    within : ndarray of int
        Number of the larger part for which the kind is proved, −1 if none.
    """

    arcs: Arcs
    curve: Whole
    arc: Whole
    kind: Whole
    sign: Whole
    within: Whole

    @classmethod
    def of(cls, curves: Sequence[Arcs]) -> _Parts:
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(arcs, name) for arcs in curves]) for name in COLUMNS
        }
        numbers = np.repeat(np.arange(len(curves)), [len(a.free) for a in curves])
        m = len(numbers)
        zero, none = np.zeros(m, dtype=np.int64), np.full(m, -1)
        return cls(Arcs(**columns), numbers, np.arange(m), zero, zero.copy(), none)

    def divided(self, chosen: NDArray[np.bool_]) -> tuple[_Parts, NDArray[np.bool_]]:
        """Halve the chosen parts."""
        arcs, halves = halved(self.arcs, chosen)
        copies = np.repeat(np.arange(len(chosen)), np.where(chosen, 2, 1))
        names = ("curve", "arc", "kind", "sign", "within")
        return _Parts(arcs, *(getattr(self, name)[copies] for name in names)), halves


@dataclass(frozen=True, eq=False)
class Examined:
    """Curves with their stability, and the points on them.

    Parameters
    ----------
    curves : tuple of Arcs
        Divided at the points, which are in arcs with −1 unstable eigenvalues.
    crossings : tuple of ProvedCrossing
        Folds, Hopf points and boundary equilibria.
    undecided : tuple of (ndarray, ndarray)
        Boxes in which others may be.
    """

    curves: tuple[Arcs, ...]
    crossings: tuple[ProvedCrossing, ...]
    undecided: tuple[tuple[Array, Array], ...]


def examined(
    problem: IntervalProblem,
    linear: Linearisation,
    interfaces: Sequence[str],
    curves: Sequence[Arcs],
) -> Examined:
    """Decide the number of unstable eigenvalues along curves, up to folds and Hopf points.

    Arcs are divided until no eigenvalue is on the imaginary axis, or one real eigenvalue or one
    pair crosses it at most once, with a derivative of its real part that is not zero. It does so
    if the numbers of unstable eigenvalues on both sides differ: a fold, which is quadratic, as the
    curve is regular and det F_x has a simple zero; or a Hopf point whose pair crosses the axis with
    non-zero speed. Arcs outside window and region are not examined.

    Parameters
    ----------
    problem : IntervalProblem
    linear : Linearisation
    interfaces : sequence of str
        Names of the functions that bound the region.
    curves : sequence of Arcs
    """
    if not curves:
        return Examined((), (), ())
    parts, boxes = _divided(problem, linear, _Parts.of(curves))
    found, crossings, undecided = [], [], []
    for number, curve in enumerate(curves):
        rows = np.flatnonzero(parts.curve == number)
        own = replace(parts.arcs.rows(rows), closed=curve.closed, ends=curve.ends)
        kinds, signs, within = parts.kind[rows], parts.sign[rows], parts.within[rows]
        if linear.neutral:
            # a second eigenvalue zero is no fold
            kinds = np.where(kinds == 1, 0, kinds)
        for run in _runs(own, own.unstable < 0):
            crossing = _crossing(own, run, kinds[run], signs[run], within[run], boxes)
            if crossing is not None:
                crossings.append(crossing)
            elif (own.unstable[run] < 0).any():
                undecided.append((own.low[run].min(axis=0), own.high[run].max(axis=0)))
        for run in _runs(own, own.position < 0) if problem.heights is not None else []:
            at = _boundary(problem, interfaces, own, run)
            if isinstance(at, ProvedCrossing):
                crossings.append(at)
            elif at is not None:
                undecided.append(at)
        found.append(_merged(own, parts.arc[rows]))
    return Examined(tuple(found), tuple(crossings), tuple(undecided))


def _divided(
    problem: IntervalProblem, linear: Linearisation, parts: _Parts
) -> tuple[_Parts, list[tuple[Array, Array]]]:
    """Divide arcs until their stability is decided; also boxes in which one eigenvalue crosses."""
    space = workspace(problem.program)
    boxes: list[tuple[Array, Array]] = []
    pending = parts.arcs.position != 0
    for _ in range(ARC_DIVISIONS):
        rows = np.flatnonzero(pending)
        if not len(rows):
            break
        arcs, kind, sign, within = parts.arcs, parts.kind, parts.sign, parts.within
        for start in range(0, len(rows), _ARCS_AT_ONCE):
            block = rows[start : start + _ARCS_AT_ONCE]
            found = _spectra(problem, linear, space, arcs, block)
            arcs.unstable[block] = found.unstable
            new = np.flatnonzero((found.kind > 0) & (kind[block] == 0))
            kind[block[new]] = found.kind[new]
            sign[block[new]] = found.sign[new] * arcs.forward[block[new]]
            within[block[new]] = len(boxes) + np.arange(len(new))
            boxes += [(arcs.low[k].copy(), arcs.high[k].copy()) for k in block[new]]
        extent = (arcs.high - arcs.low)[rows, arcs.free[rows]] / problem.unit[arcs.free[rows]]
        rows = rows[(arcs.unstable[rows] < 0) & (extent > SHORTEST_ARC)]
        crossing = within[rows] >= 0
        of_arc = np.bincount(parts.arc[rows[~crossing]], minlength=len(kind))
        of_one = np.bincount(within[rows[crossing]], minlength=len(boxes))
        many = of_arc[parts.arc[rows]] > MOST_PARTS
        many[crossing] = of_one[within[rows[crossing]]] > MOST_OF_ONE
        pending = np.zeros(len(kind), dtype=bool)
        pending[rows[~many]] = True
        parts, pending = parts.divided(pending)
    return parts, boxes


def _spectra(
    problem: IntervalProblem, linear: Linearisation, space: KrawczykSpace, arcs: Arcs, rows: Whole
) -> Spectra:
    """Bound the eigenvalues along some arcs, whose boxes are contracted."""
    free = arcs.free[rows]
    each = np.arange(len(rows))
    boxes = problem.enclosed(space, free, arcs.low[rows], arcs.high[rows])
    arcs.low[rows], arcs.high[rows] = boxes.low, boxes.high
    one, other = boxes.low[each, free], boxes.high[each, free]
    middle = 0.5 * one + 0.5 * other
    low, high = boxes.low.copy(), boxes.high.copy()
    low[each, free] = high[each, free] = middle
    points = problem.enclosed(space, free, low, high)
    centre = linear.at(points.low, points.high)
    slope, drift = linear.along(boxes)
    found = Spectra(np.full(len(rows), -1), *np.zeros((2, len(rows)), dtype=np.int64))
    size = len(linear.columns)
    bounded = np.isfinite(centre.size).all(axis=(1, 2)) & np.isfinite(slope.size).all(axis=(1, 2))
    good = np.flatnonzero(bounded & (drift != 0))
    if not size:
        found.unstable[good] = 0
    elif len(good):
        reach = np.maximum(middle - one, other - middle)[good] * (1.0 + 1e-15)
        unit = problem.unit[list(linear.columns)]
        bounds = spectra_of(centre.rows(good), slope.rows(good), reach, unit)
        found = found.replaced(good, bounds)
    escaping = (drift > 0) & (found.unstable >= 0)
    return replace(found, unstable=found.unstable + escaping)


def _runs(arcs: Arcs, wanted: NDArray[np.bool_]) -> list[Whole]:
    """Return runs of arcs that are not outside region and window, of a closed curve around it."""
    rows = np.arange(len(wanted))
    wanted = wanted & (arcs.position != 0)
    if arcs.closed and wanted[0] and wanted[-1] and not wanted.all():
        rows = np.roll(rows, -int(np.flatnonzero(~wanted)[0]))
    ends = np.flatnonzero(np.diff(np.concatenate([[0], wanted[rows].astype(int), [0]])))
    return [rows[a:b] for a, b in ends.reshape(-1, 2)]


def _beside(arcs: Arcs, run: Whole) -> tuple[int, int] | None:
    """Return the arcs before and after a run, None at an end of the curve."""
    m = len(arcs.free)
    before, after = int(run[0]) - 1, int(run[-1]) + 1
    if arcs.closed and len(run) < m:
        return before % m, after % m
    return None if before < 0 or after >= m else (before, after)


def _crossing(
    arcs: Arcs,
    run: Whole,
    kinds: Whole,
    signs: Whole,
    within: Whole,
    boxes: Sequence[tuple[Array, Array]],
) -> ProvedCrossing | None:
    """The fold or Hopf point in a run of arcs; None if there is none, or nothing is decided."""
    beside = _beside(arcs, run)
    if beside is None or (arcs.position[run] < 0).any():
        return None
    one, other = arcs.unstable[list(beside)].tolist()
    kind, sign = int(kinds[0]), int(signs[0])
    same = bool(kind and (kinds == kind).all() and (signs == sign).all())
    if not same or one < 0 or other < 0:
        return None
    if one == other:
        # strictly monotone with the same sign on both sides
        arcs.unstable[run] = one
        return None
    if other - one != sign * kind:
        return None
    near_low, near_high = (
        np.array(ends) for ends in zip(*(boxes[k] for k in {*within}), strict=True)
    )
    return ProvedCrossing(
        _CODES[kind], arcs.low[run].min(axis=0), arcs.high[run].max(axis=0), near_low, near_high
    )


def _merged(arcs: Arcs, numbers: Whole) -> Arcs:
    """Join consecutive parts of one arc with the same number of unstable eigenvalues."""
    changes = np.diff(numbers) | np.diff(arcs.unstable)
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1])
    if len(starts) == len(numbers):
        return arcs
    ends = np.append(starts[1:], len(numbers)) - 1
    joined = arcs.rows(starts)
    return replace(
        joined,
        low=np.minimum.reduceat(arcs.low, starts),
        high=np.maximum.reduceat(arcs.high, starts),
        last=arcs.last[ends],
    )


def _boundary(
    problem: IntervalProblem, interfaces: Sequence[str], arcs: Arcs, run: Whole
) -> ProvedCrossing | tuple[Array, Array] | None:
    """The boundary equilibrium in a run of arcs; None if there is none, their box if undecided.

    One function h vanishes at most once, as its derivative along the curve is not zero, and has
    different signs on both sides; the others have the signs that they have in the region.
    """
    low, high = arcs.low[run].min(axis=0), arcs.high[run].max(axis=0)
    assert problem.heights is not None
    space = workspace(problem.program)
    boxes = problem.enclosed(space, arcs.free[run], arcs.low[run], arcs.high[run])
    below, above = enclosed(problem.heights, boxes.low, boxes.high)
    n, width = len(problem.signs), low.shape[0]
    signs = np.array(problem.signs)
    zero = (below[:, :n] <= 0.0) & (above[:, :n] >= 0.0)
    beyond = (np.where(signs > 0, above[:, :n], -below[:, :n]) < 0.0).all(axis=0)
    if not zero.any() or beyond.any():
        # the edge of the window, or outside the region
        return None
    beside = _beside(arcs, run)
    vanishing = np.flatnonzero(zero.any(axis=0))
    inside = bool(((low >= problem.low) & (high <= problem.high)).all())
    if beside is None or len(vanishing) > 1 or not inside:
        return low, high
    k = int(vanishing[0])
    by = slice(n + k * width, n + (k + 1) * width)
    small, large = along_curves(below[:, None, by], above[:, None, by], boxes)
    forward = arcs.forward[run]
    slope = np.where(small[:, 0] > 0, forward, np.where(large[:, 0] < 0, -forward, 0))
    rows = list(beside)
    below, above = enclosed(problem.heights, arcs.low[rows], arcs.high[rows])
    ends = np.where(below[:, k] > 0, 1, np.where(above[:, k] < 0, -1, 0))
    if not slope[0] or (slope != slope[0]).any() or not ends.all():
        return low, high
    if ends[0] == ends[1]:
        return None
    return ProvedCrossing(
        BOUNDARY_EQUILIBRIUM, low, high, arcs.low[run], arcs.high[run], interfaces[k]
    )
