"""Jacobians of equilibria as programs of interval arithmetic, motion by motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.certification.boxes.linking import CurveBoxes, enclosed
from fastslow.certification.equations import ExactEquations
from fastslow.certification.spectra.spectra import Balls, balls_of
from fastslow.kernels.intervals.printer import IntervalProgram, interval_program
from fastslow.model.differentiation import gradient
from fastslow.model.removable import with_removable

Array = NDArray[np.float64]

#: Relative rounding error of a sum of a few products.
_SUM_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The Jacobian of one motion in interval arithmetic.

    Parameters
    ----------
    elements : tuple of Expr
        Elements of the Jacobian, row by row, and when sliding the difference of the drifts
        ∇h·(f₁ − f₂)/2, which is negative where both fields point to the interface.
    unknowns : tuple of Symbol
    columns : tuple of int
        The unknowns of its columns.
    neutral : int
        Number of eigenvalues that are zero at all equilibria, because of a zero row or column;
        this row and column are left out.
    """

    elements: tuple[sp.Expr, ...]
    unknowns: tuple[sp.Symbol, ...]
    columns: tuple[int, ...]
    sliding: bool
    neutral: int

    @cached_property
    def program(self) -> IntervalProgram:
        """The elements in interval arithmetic, compiled where a curve is in the region."""
        return interval_program(self.elements, self.unknowns)

    def along(self, boxes: CurveBoxes) -> tuple[Balls, Array]:
        """Enclose the derivatives of the Jacobian along the curves in boxes.

        Also returns the signs of the difference of drifts, 0 where it is not decided, and −1 for
        regions.
        """
        below, above = enclosed(self.program, boxes.low, boxes.high)
        count = len(self.program.program.rows)
        entries = len(self.columns) ** 2
        by = boxes.tangent_low.shape[1]
        low, high = along_curves(
            below[:, count : count + entries * by].reshape(len(below), entries, by),
            above[:, count : count + entries * by].reshape(len(below), entries, by),
            boxes,
        )
        drift = -np.ones(len(low))
        if self.sliding:
            drift = np.where(below[:, entries] > 0, 1.0, np.where(above[:, entries] < 0, -1.0, 0.0))
        return self._matrices(low, high), drift

    def at(self, low: Array, high: Array) -> Balls:
        """Enclose the Jacobian over boxes."""
        below, above = enclosed(self.program, low, high)
        entries = len(self.columns) ** 2
        return self._matrices(below[:, :entries], above[:, :entries])

    def _matrices(self, low: Array, high: Array) -> Balls:
        n = len(self.columns)
        return balls_of(low.reshape(len(low), n, n), high.reshape(len(low), n, n))


def along_curves(low: Array, high: Array, boxes: CurveBoxes) -> tuple[Array, Array]:
    """Enclose derivatives by the free unknown, from those by all unknowns, shape (m, k, N)."""
    a, b = boxes.tangent_low[:, None], boxes.tangent_high[:, None]
    with np.errstate(all="ignore"):
        products = np.stack([low * a, low * b, high * a, high * b])
        small, large = products.min(axis=0), products.max(axis=0)
        more = _SUM_ROUNDING * np.maximum(np.abs(small), np.abs(large)).sum(axis=2) + 1e-290
        return small.sum(axis=2) - more, large.sum(axis=2) + more


def linearisation(equations: ExactEquations) -> Linearisation:
    """Return the Jacobian of a motion.

    On an interface h = 0 the sliding field f₁₂ has the weight s of f₁ that keeps ∇h·f₁₂ = 0. At
    a pseudo-equilibrium its Jacobian is (1 − f_s ∇h/(∇h·f_s)) f_x, here in the states without one
    for which h = 0 is solved.
    """
    unknowns = equations.unknowns
    rows = [with_removable(row) for row in equations.rows]
    if not equations.slides:
        kept = list(range(len(rows)))
        lines, drifts = [gradient(row, tuple(unknowns[:-1])) for row in rows], []
    else:
        n = len(rows) - 1
        states, weight = unknowns[:n], unknowns[n]
        normal = [rows[n].diff(state) for state in states]
        drift = sum(g * r.diff(weight) for g, r in zip(normal, rows[:n], strict=True))
        # the state for which h = 0 is solved, if possible one in which h is linear
        own = min(range(n), key=lambda k: (normal[k] == 0, not normal[k].is_number, k))
        jacobian = sp.Matrix(rows[:n]).jacobian(states)
        across = (sp.Matrix([normal]) * jacobian) / drift
        sliding = jacobian - sp.Matrix([row.diff(weight) for row in rows[:n]]) * across
        kept = [k for k in range(n) if k != own]
        lines = [
            tuple(sliding[i, k] - sliding[i, own] * normal[k] / normal[own] for k in kept)
            for i in kept
        ]
        drifts = [drift]
    neutral = 0
    while (empty := _empty_line(lines)) is not None:
        rest = [line for i, line in enumerate(lines) if i != empty]
        lines = [line[:empty] + line[empty + 1 :] for line in rest]
        del kept[empty]
        neutral += 1
    elements = (*chain.from_iterable(lines), *drifts)
    return Linearisation(elements, tuple(unknowns), tuple(kept), equations.slides, neutral)


def _empty_line(lines: Sequence[tuple[sp.Expr, ...]]) -> int | None:
    """Return the number of a row or column of zeros, None without one."""
    for k, (row, column) in enumerate(zip(lines, zip(*lines, strict=True), strict=True)):
        if all(e == 0 for e in row) or all(e == 0 for e in column):
            return k
    return None
