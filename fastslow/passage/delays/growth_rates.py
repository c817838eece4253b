"""Growth rate of the critical mode of a special point along its branch."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from fastslow.passage.roots import sign_change
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.interpolation import hermite

Array = NDArray[np.float64]

#: Chebyshev points on (−1, 1) in ascending order.
NODES = -np.cos(np.pi * (np.arange(15) + 0.5) / 15)

#: Matrix from values at the points to Chebyshev coefficients.
TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(NODES, len(NODES) - 1))

#: Bound of the last coefficients times the length of a piece, relative to the eigenvalues times
#: the length of the branch: the error of an integral.
RESOLVED_GROWTH = 1e-11

#: Length of the shortest piece relative to the branch: a splitting pair is a square root.
SHORTEST_PIECE = 1e-8

#: Length of the first piece relative to the branch.
FIRST_PIECE = 0.125


class Eigenvalue(NamedTuple):
    """Continued eigenvalue: value, position, and slope along the branch."""

    value: complex
    along: float
    slope: complex


@dataclass(frozen=True, eq=False)
class GrowthPiece:
    """Polynomial approximation of the growth rate on one parameter interval.

    Parameters
    ----------
    start, stop : float
        Parameter values, in the direction away from the point.
    rate, primitive : ndarray
        Chebyshev coefficients of Re λ and of its integral from the start, over (−1, 1).
    before : float
        ∫ Re λ |dp| from the point to the start.
    last : Eigenvalue
        Eigenvalue at the last Chebyshev point.
    """

    start: float
    stop: float
    rate: Array
    primitive: Array
    before: float
    last: Eigenvalue

    def _local(self, value: Array | float) -> Array | float:
        return (2.0 * value - self.start - self.stop) / (self.stop - self.start)

    def at(self, values: Array) -> Array:
        return np.asarray(chebyshev.chebval(self._local(values), self.rate))

    def integral(self, value: float) -> float:
        return float(self.before + chebyshev.chebval(self._local(value), self.primitive))


@dataclass(eq=False)
class BranchSide:
    """Side of a branch at a special point, up to the next reversal of the parameter.

    The critical eigenvalue is evaluated at equilibria of the model and approximated by
    polynomials on adaptively halved pieces, so that the result does not depend on the rows
    of the branch. Pieces are added on demand.

    Parameters
    ----------
    diagram : Diagram
    branch : Branch
    row : int
        Row of the special point.
    way : int
        +1 if the parameter increases away from the point.
    critical : complex
        Critical eigenvalue at the point, which is continued along the branch.
    """

    diagram: Diagram
    branch: Branch
    row: int
    way: int
    critical: complex
    rows: list[int] = field(default_factory=list)
    pieces: list[GrowthPiece] = field(default_factory=list)

    def __post_init__(self) -> None:
        values = self.branch.values
        step = self._direction(values)
        self.rows = [self.row]
        following = self.row + step
        while 0 <= following < len(values):
            change = self.way * (values[following] - values[following - step])
            if change < 0:
                break
            self.rows.append(following)
            following += step
        regions = self.branch.region[self.rows]
        joints = [k for k in range(1, len(self.rows)) if regions[k] != regions[k - 1]]
        interpolated = self.diagram.corrector is None
        # pieces lie in one region, or in one step if eigenvalues are known at its ends only
        breaks = range(1, len(self.rows)) if interpolated else joints
        self._breaks = sorted({self._along(values[self.rows[k]]) for k in breaks} | {self.length})
        self._steps = np.array([self._along(values[k]) for k in self.rows])
        self._numbers = np.array(self.rows)

    def _direction(self, values: Array) -> int:
        for step in (1, -1):
            beside = self.row + step
            if 0 <= beside < len(values) and self.way * (values[beside] - values[self.row]) > 0:
                return step
        return len(values)

    def _along(self, value: float) -> float:
        return float(self.way * (value - self.here))

    @property
    def here(self) -> float:
        """Parameter at the special point."""
        return float(self.branch.values[self.row])

    @property
    def end(self) -> float:
        """Parameter at the end of the side."""
        return float(self.branch.values[self.rows[-1]])

    @property
    def length(self) -> float:
        return self._along(self.end)

    def first_growth(self) -> float:
        """Largest real part of the eigenvalues next to the point."""
        return float(self.branch.eigenvalues[self.rows[:2][-1]].real.max())

    def rate(self, values: Array) -> Array:
        """Re λ at values of the parameter, nan for values not on this side, shape (N,)."""
        values = np.asarray(values, dtype=float)
        along = self.way * (values - self.here)
        found = np.full(values.shape, np.nan)
        inside = (along >= 0.0) & (along <= self.length)
        if not inside.any():
            return found
        self._extend_to(float(along[inside].max()))
        rows = np.flatnonzero(inside)
        # a joint belongs to the later piece
        starts = [self._along(piece.start) for piece in self.pieces]
        number = np.searchsorted(starts, along[rows], side="right") - 1
        rows = rows[np.argsort(number, kind="stable")]
        ends = np.cumsum(np.bincount(number, minlength=len(starts)))
        for piece, on in zip(self.pieces, np.split(rows, ends[:-1]), strict=True):
            if len(on):
                found[on] = piece.at(values[on])
        return found

    def integral(self, end: float) -> float:
        """∫ Re λ |dp| from the point to a value on the branch."""
        along = min(self._along(end), self.length)
        if not along > 0.0:
            return 0.0
        self._extend_to(along)
        ends = [self._along(piece.stop) for piece in self.pieces]
        return self.pieces[min(bisect_right(ends, along), len(ends) - 1)].integral(end)

    def where(self, target: float) -> float:
        """Parameter at which the integral from the point reaches a target, else nan."""
        if target <= 0 or not self.length > 0.0:
            return math.nan
        number = 0
        while True:
            if number == len(self.pieces) and not self._extend():
                return math.nan
            piece = self.pieces[number]
            # the integral may decrease within a piece
            for one, other in zip(*self._parts(piece), strict=True):
                if piece.integral(other) >= target:
                    missing = partial(_missing, piece, target)
                    fine = max(1e-15 * abs(piece.stop - piece.start), 4e-16 * abs(float(other)))
                    low, high = sorted((float(one), float(other)))
                    return sign_change(missing, low, high, fine)
            number += 1

    @staticmethod
    def _parts(piece: GrowthPiece) -> tuple[Array, Array]:
        """Intervals of a piece on which its integral is taken as monotone."""
        ends = np.linspace(piece.start, piece.stop, 9)
        return ends[:-1], ends[1:]

    def _extend_to(self, along: float) -> None:
        while not self.pieces or self._along(self.pieces[-1].stop) < along:
            if not self._extend():
                return

    def _extend(self) -> bool:
        """Add a piece; return False at the end of the side."""
        start = self._along(self.pieces[-1].stop) if self.pieces else 0.0
        if not start < self.length:
            return False
        pair = self.pieces[-1].last if self.pieces else Eigenvalue(self.critical, 0.0, 0.0)
        before = self.pieces[-1].integral(self.pieces[-1].stop) if self.pieces else 0.0
        stop = self._breaks[bisect_right(self._breaks, start)]
        width = FIRST_PIECE * self.length
        if self.pieces:
            width = 2.0 * abs(self.pieces[-1].stop - self.pieces[-1].start)
        while True:
            ahead = min(start + width, stop)
            if stop - ahead <= SHORTEST_PIECE * self.length:
                ahead = stop
            values, last = self._values(start, ahead, pair)
            coefficients = np.asarray(TO_COEFFICIENTS @ values)
            size = max(float(np.abs(values).max()), abs(last.value), np.finfo(float).tiny)
            short = ahead - start <= 2.0 * SHORTEST_PIECE * self.length
            left = float(np.abs(coefficients[-3:]).max()) * (ahead - start)
            if short or left <= RESOLVED_GROWTH * size * self.length:
                break
            width = 0.5 * (ahead - start)
        half = 0.5 * (ahead - start)
        primitive = np.asarray(half * chebyshev.chebint(coefficients, lbnd=-1), dtype=float)
        ends = [self.here + self.way * s for s in (start, ahead)]
        if ahead == self.length:
            ends[1] = self.end
        if self.pieces:
            ends[0] = self.pieces[-1].stop
        self.pieces.append(GrowthPiece(ends[0], ends[1], coefficients, primitive, before, last))
        return True

    def _values(self, start: float, stop: float, pair: Eigenvalue) -> tuple[Array, Eigenvalue]:
        """Re λ at the Chebyshev points of an interval, continued from one to the next."""
        found = np.empty(len(NODES))
        along = start + 0.5 * (stop - start) * (1.0 + NODES)
        spectra = self.eigenvalues(self.here + self.way * along)
        for k, values in enumerate(spectra):
            pair = following(values, pair, float(along[k]))
            found[k] = pair.value.real
        return found, pair

    def place(self, value: float) -> tuple[str, Array]:
        """Region and equilibrium at a value of the parameter."""
        regions, states = self.places(np.array([value]))
        return str(regions[0]), states[0]

    def places(self, values: Array) -> tuple[NDArray[np.str_], Array]:
        """Regions (N,) and equilibria (N, n) at values of the parameter."""
        regions, states, _ = self._solved(values)
        return regions, states

    def eigenvalues(self, values: Array) -> NDArray[np.complex128]:
        """Eigenvalues at values of the parameter, shape (N, n); interpolated without a model."""
        return self._solved(values)[2]

    def _solved(self, values: Array) -> tuple[NDArray[np.str_], Array, NDArray[np.complex128]]:
        """Regions, equilibria and eigenvalues at values of the parameter."""
        branch, rows = self.branch, self._rows_below(values)
        regions, states = branch.region[rows], hermite(branch.table, rows, values)
        low, high = branch.values[rows], branch.values[rows + 1]
        one, other = (np.sort_complex(branch.eigenvalues[rows + k]) for k in (0, 1))
        with np.errstate(invalid="ignore"):
            part = ((values - low) / (high - low))[:, None]
            spectra = np.asarray((1 - part) * one + part * other)
        if self.diagram.corrector is not None:
            for region in np.unique(regions):
                on = np.flatnonzero(regions == region)
                solved, found = self.diagram.corrector.many(str(region), states[on], values[on])
                known = ~np.isnan(solved).any(axis=1)
                states[on[known]], spectra[on[known]] = solved[known], found[known]
        return regions, states, spectra

    def _rows_below(self, values: Array) -> NDArray[np.intp]:
        """Lower row of the step that contains each value."""
        k = np.searchsorted(self._steps, self.way * (values - self.here), side="right")
        k = np.clip(k, 1, len(self.rows) - 1)
        while (level := (k > 1) & (self._steps[k] == self._steps[k - 1])).any():
            k = k - level
        return np.minimum(self._numbers[k - 1], self._numbers[k])


def _missing(piece: GrowthPiece, target: float, value: float) -> float:
    return piece.integral(value) - target


def following(values: NDArray[np.complex128], pair: Eigenvalue, along: float) -> Eigenvalue:
    """Continue an eigenvalue; of a pair that splits into two real ones, the larger.

    Real eigenvalues cross where one belongs to an invariant plane, so that the eigenvalue
    nearest to the extrapolated one is chosen.
    """
    upper = values[values.imag >= 0]
    step = along - pair.along
    apart = np.abs(upper - pair.value - pair.slope * step)
    chosen = complex(upper[np.argmin(apart)])
    if pair.value.imag > 0.0 and chosen.imag == 0.0:
        near = upper[(upper.imag == 0.0) & (apart <= 1.5 * apart.min())]
        chosen = complex(near[np.argmax(near.real)])
    slope = (chosen - pair.value) / step if step > 0.0 else pair.slope
    return Eigenvalue(chosen, along, slope)
