"""Zeros of an expression along a segment, including those without a change of sign.

The expression is sampled on cubic interpolants between the rows, since it may vary faster than the
branch; samples near a zero are replaced by points of the curve. A zero without a change of sign is
an extremum of the expression, located by bisection of its slope along the curve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import Located, with_condition
from fastslow.continuation.marks import ExpressionMark, Test, beyond_rounding, gradient, size_of
from fastslow.continuation.zeros import GOLDEN, TOUCH, Between, Bracket, minima, sign_changes
from fastslow.diagrams.points.on_branches import SegmentSurvey

Array = NDArray[np.float64]

#: Samples of a step.
STEP_SAMPLES = 8

#: A sample is replaced by a point of the curve if the expression there is below this multiple of
#: its change to a neighbour.
NEAR_EXTREMUM = 2.0

#: Bisections for an extremum.
EXTREMUM_BISECTIONS = 60

#: An extremum below this fraction is minimised again, since differences displace a kink.
KINK_EXTREMUM = 1e-6

#: The two tangents at the ends of a step bound a convex function from below; above this fraction of
#: its smaller value there is no zero.
BOUND = 0.5

#: Length of a step, in units of the window, over which differences blur a kink.
BLURRED_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class Nodes:
    """Samples of a segment: points, the row at or before each, and the values there."""

    u: Array
    rows: NDArray[np.intp]
    values: Array


@dataclass(frozen=True, eq=False)
class MarkedZero:
    """A zero after a row, or at it."""

    row: int
    located: Located
    at_row: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False)
class MarkSearch:
    """The search for the zeros of an expression on a segment.

    Parameters
    ----------
    survey : SegmentSurvey
    mark : ExpressionMark
    """

    survey: SegmentSurvey
    mark: ExpressionMark

    def value(self, points: Array) -> Array:
        """The expression at points, 0 where it is rounding errors."""
        return beyond_rounding(self._test, points, self._scale, self._size)

    @cached_property
    def _size(self) -> float:
        return size_of(self._test, self.survey.segment.u)

    @property
    def _scale(self) -> Array:
        return self.survey.window.scale

    @cached_property
    def _test(self) -> Test:
        frozen = self.survey.field
        names = (*frozen.model.states, frozen.parameter)
        return self.mark.test(names, frozen.model.parameters)

    @cached_property
    def _between(self) -> Between:
        return self.survey.between(self._along)

    def _along(self, u: Array, along: Array) -> float:
        return float(self.value(u))

    def zeros(self, *, first: bool, last: bool) -> Iterator[MarkedZero]:
        """Yield the zeros in no particular order.

        Parameters
        ----------
        first, last : bool
            Whether those at the first and the last row are included.
        """
        nodes = self._nodes()
        zero = np.flatnonzero(nodes.values == 0)
        crossed = set()
        for before, after in sign_changes(nodes.values):
            crossed |= {*range(before + 1, after)}
            yield from self._solved(nodes, before, after)
        for run in np.split(zero, np.flatnonzero(np.diff(zero) > 1) + 1):
            ends = {0: first, len(nodes.u) - 1: last}
            plateau = np.count_nonzero(run % STEP_SAMPLES == 0) > 1
            if len(run) and not plateau and not crossed & {*run.tolist()}:
                k = next((k for k in run.tolist() if k in ends), int(run[0]))
                if ends.get(k, True):
                    yield self._at_node(nodes, k, touches=k not in ends)
        lengths = np.linalg.norm(np.diff(nodes.u, axis=0) / self._scale, axis=1)
        for k in minima(nodes.values, lengths):
            yield from self._extremum(nodes, k)

    def _nodes(self) -> Nodes:
        """Sample the segment, with points of the curve where the expression is near zero."""
        segment = self.survey.segment
        u, count = segment.u, len(segment.u)
        parts = np.arange(STEP_SAMPLES) / STEP_SAMPLES
        h = self.survey.steps[:, None, None]
        chord = np.diff(u, axis=0)[:, None]
        leaving, arriving = (h * t[:, None] for t in (segment.tangents[:-1], segment.tangents[1:]))
        s = parts[None, :, None]
        bend, twist = 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord
        inner = u[:-1, None] + s * (leaving + s * (bend + s * twist))
        points = np.concatenate([inner.reshape(-1, u.shape[1]), u[-1:]])
        rows = np.append(np.repeat(np.arange(count - 1), STEP_SAMPLES), count - 1)
        values = self.value(points)
        change = np.abs(np.diff(values))
        larger = np.fmax(np.append(change, 0.0), np.append(0.0, change))
        sampled = np.arange(len(rows)) % STEP_SAMPLES > 0
        for k in np.flatnonzero(sampled & (np.abs(values) <= NEAR_EXTREMUM * larger)):
            row = int(rows[k])
            found = self._between(u[row], u[row + 1], float(parts[k % STEP_SAMPLES]))
            if found is not None:
                points[k], values[k] = found
        return Nodes(points, rows, values)

    def _located(self, u: Array) -> Located:
        """Apply Newton's method to the equations together with the expression."""

        def condition(u: Array) -> tuple[float, Array]:
            return float(self._test(u)), gradient(self._test, u, self._scale)

        located = with_condition(self.survey.curve, condition, u, self._scale)
        # at a multiple zero differences stop Newton's method beside it
        solved = located.converged and float(self.value(located.u)) == 0.0
        return replace(located, converged=solved)

    def _solved(self, nodes: Nodes, before: int, after: int) -> Iterator[MarkedZero]:
        row = int(nodes.rows[before])
        bracket = Bracket(
            row,
            (nodes.u[before], nodes.u[after]),
            (float(nodes.values[before]), float(nodes.values[after])),
        )
        located = self.survey.solved(bracket, self._along, self._located)
        if located is not None:
            yield MarkedZero(row, located)

    def _at_node(self, nodes: Nodes, k: int, *, touches: bool) -> MarkedZero:
        u, row = nodes.u[k], int(nodes.rows[k])
        at_row = bool(np.all(u == self.survey.segment.u[row]))
        note = self._touching(0.0) if touches else ""
        return MarkedZero(row, self.survey.at_rounding(u), at_row, note)

    def _touching(self, value: float) -> str:
        return f"{self.mark.expression} has no change of sign there, to rounding" + (
            f": its extremum is {value:.1g}" if value else ""
        )

    def _lowest(self, nodes: Nodes, k: int, sign: float) -> tuple[Array, float]:
        """Minimise the modulus after a node by golden sections."""
        a, b = nodes.u[k], nodes.u[k + 1]
        best = (a, float(abs(nodes.values[k])))
        for _ in range(2 * EXTREMUM_BISECTIONS):
            inner = [self._between(a, b, part) for part in (1.0 - GOLDEN, GOLDEN)]
            if inner[0] is None or inner[1] is None:
                break
            (c, fc), (d, fd) = inner[0], inner[1]
            best = min(best, (c, sign * fc), (d, sign * fd), key=lambda end: end[1])
            a, b = (a, d) if sign * fc < sign * fd else (c, b)
        return best

    def _slope(self, u: Array, chord: Array) -> float:
        """Derivative of the expression along the curve, over a chord of unit length."""
        return float(gradient(self._test, u, self._scale) @ self.survey.tangent(u, chord))

    def _extremum(self, nodes: Nodes, k: int) -> Iterator[MarkedZero]:
        """Yield one zero without a change of sign after a node, or the two zeros around it."""
        row, sign = int(nodes.rows[k]), float(np.sign(nodes.values[k]))
        ends = [(nodes.u[j], float(abs(nodes.values[j]))) for j in (k, k + 1)]
        largest = max(value for _, value in ends)
        chord = nodes.u[k + 1] - nodes.u[k]
        slopes = [sign * self._slope(u, chord) for u, _ in ends]
        if not slopes[0] < 0 < slopes[1]:
            return
        least = ends[0] if ends[0][1] < ends[1][1] else ends[1]
        for _ in range(EXTREMUM_BISECTIONS):
            (a, fa), (b, fb) = ends
            length = float(np.linalg.norm((b - a) / self._scale))
            meet = (fb - fa - slopes[1] * length) / (slopes[0] - slopes[1])
            if length > BLURRED_STEP and fa + slopes[0] * meet > BOUND * min(fa, fb):
                return
            found = self._between(a, b, 0.5)
            if found is None or np.all(found[0] == a) or np.all(found[0] == b):
                break
            middle, value = found[0], sign * found[1]
            if value < 0:
                for one, other in ((a, middle), (middle, b)):
                    values = (float(self.value(one)), float(self.value(other)))
                    bracket = Bracket(row, (one, other), values)
                    located = self.survey.solved(bracket, self._along, self._located)
                    if located is not None:
                        yield MarkedZero(row, located)
                return
            least = min(least, (middle, value), key=lambda end: end[1])
            slope = sign * self._slope(middle, chord)
            side = 0 if slope < 0 else 1
            ends[side], slopes[side] = (middle, value), slope
            if slope == 0:
                break
        if TOUCH * largest < least[1] <= KINK_EXTREMUM * largest:
            least = min(least, self._lowest(nodes, k, sign), key=lambda end: end[1])
        if least[1] <= TOUCH * largest:
            yield MarkedZero(
                row, self.survey.at_rounding(least[0]), note=self._touching(sign * least[1])
            )
