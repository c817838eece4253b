"""Proved curves that a diagram lacks, and the diagram with their branches."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.settings import Continuation
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError, IncompleteWarning
from fastslow.model.model import Model
from fastslow.results.angles import apart, copies, nearest_copy, periods_of
from fastslow.results.base.outcome import with_notes
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import ADDED, Diagram
from fastslow.results.certificates import Certificate, ProvedCurve

Array = NDArray[np.float64]

#: Why a proved curve is not added to the diagram.
NOT_SOLVED = "Newton's method does not converge from them."

#: Distance of a row of a branch from a proved arc, in units of the window, up to which it is on it.
ON_CURVE = 1e-7

#: Extent of arcs without rows, in units of the window, from which on a diagram lacks them.
LACKING = 2e-3

#: An end of a proved curve within this multiple of the step of a branch that continues beyond it
#: is on the branch.
END_STEPS = 1.5


def lacking(curve: ProvedCurve, diagram: Diagram) -> list[ProvedCurve]:
    """Return the arcs of a proved curve on which the diagram has no branch."""
    covered = np.zeros(len(curve.free), dtype=bool)
    window = np.ptp(np.vstack([curve.node_low, curve.node_high]), axis=0)
    unit = np.maximum(window, _size(diagram))
    for branch in diagram.branches:
        if branch.admissible:
            for shift in _shifts(branch, curve):
                _cover(curve, branch, shift, unit, covered)
    if covered.all() or not (covered | curve.decided).any():
        # all of it is within the width of a boundary equilibrium or the edge
        return []
    found = []
    ends = [0, *(np.flatnonzero(np.diff(covered)) + 1).tolist(), len(covered)]
    for first, last in pairwise(ends):
        if covered[first]:
            continue
        moved = np.ptp(curve.node_low[first : last + 1], axis=0) / unit
        if covered.any() and moved.max() <= LACKING:
            continue
        part = _slice(curve, first, last)
        if not _between_rows(part, diagram, unit):
            found.append(part)
    return found


def doubled(certificate: Certificate) -> str:
    """Return where the diagram has more equilibria than are proved, empty if nowhere.

    Between special points and ends of branches their number is constant, so that one value of the
    parameter is examined in each interval; none where the number is not decided.
    """
    diagram, name = certificate.diagram, certificate.parameter
    ends = [row for b in diagram.branches for row in (b[name][0], b[name][-1])]
    values = np.unique([*ends, *(point[name] for point in diagram.special()), *diagram.over])
    low, high = np.array([certificate.window[state] for state in diagram.states]).T
    periods = periods_of(diagram.states, diagram.periods)
    for one, two in pairwise(values.tolist()):
        middle = 0.5 * (one + two)
        with suppress(ArgumentError):
            proved = certificate.count(**{name: middle})
            rows = [row.state for row in _at(diagram, name, middle)]
            states = nearest_copy(np.reshape(rows, (-1, len(low))), 0.5 * (low + high), periods)
            found = int(((low <= states) & (states <= high)).all(axis=1).sum())
            if found > proved:
                return (
                    f"at {name} = {middle:.6g} the branches of the diagram have {found} equilibria "
                    f"of {proved}: some run along the same curve"
                )
    return ""


def _at(diagram: Diagram, name: str, value: float) -> list[Any]:
    """The equilibria of a diagram at a value; what it lacks is decided by the certificate."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteWarning)
        here: dict[str, Any] = {name: value}
        return diagram.at(**here)


def _between_rows(part: ProvedCurve, diagram: Diagram, unit: Array) -> bool:
    """Return whether the ends and the middle of arcs without rows are on branches."""
    middle = 0.5 * part.node_low + 0.5 * part.node_high
    periods = periods_of(diagram.states, diagram.periods)
    for *state, value in middle[[0, len(middle) // 2, -1]]:
        known = _at(diagram, part.parameter, float(np.clip(value, *diagram.over)))
        away = [
            np.abs(apart(e.state, state, periods) / unit[:-1]).max()
            for e in known
            if e.admissible and e.region.partition(" (")[0] == part.region
        ]
        if min(away, default=np.inf) > ON_CURVE:
            return False
    return True


def _size(diagram: Diagram) -> Array:
    """Extent of the diagram in each state and the parameter."""
    columns = [diagram[name] for name in diagram.states]
    sizes = [float(np.ptp(c)) if len(c) else 0.0 for c in columns]
    return np.array([*sizes, diagram.over[1] - diagram.over[0]]) + 1e-300


def _shifts(branch: Branch, curve: ProvedCurve) -> list[Array]:
    """Return the shifts of periodic states by whole periods with which a branch meets a curve."""
    choices = []
    for k, period in enumerate(periods_of(branch.states, branch.periods).tolist()):
        below = float(curve.node_low[:, k].min() - branch.state[:, k].max())
        above = float(curve.node_high[:, k].max() - branch.state[:, k].min())
        choices.append(copies(0.0, below, above, period))
    return [np.array([*shift, 0.0]) for shift in product(*choices)]


def _cover(
    curve: ProvedCurve, branch: Branch, shift: Array, unit: Array, covered: NDArray[np.bool_]
) -> None:
    """Mark the arcs between consecutive rows of a branch."""
    rows = (np.column_stack([branch.state, branch.values]) + shift) / unit
    names = np.char.partition(branch.region.astype(str), " (")[:, 0]
    low, high = curve.low.min(axis=0) / unit, curve.high.max(axis=0) / unit
    near = (np.maximum(low - rows, rows - high) <= ON_CURVE).all(axis=1) & (names == curve.region)
    if not near.any():
        return
    arcs = [
        _arc_of(curve, row * unit, unit) if close else -1
        for row, close in zip(rows, near.tolist(), strict=True)
    ]
    for k, (one, other) in enumerate(pairwise(arcs)):
        first, last = sorted((one, other))
        if first >= 0:
            if curve.closed and last - first > len(covered) // 2:
                covered[last:] = covered[: first + 1] = True
            else:
                covered[first : last + 1] = True
        elif last >= 0:
            # the branch continues beyond an end of the curve
            step = float(np.abs(rows[k + 1] - rows[k]).max())
            row = rows[k] if one == last else rows[k + 1]
            middle = (0.5 * curve.node_low + 0.5 * curve.node_high) / unit
            if np.abs(middle[0] - row).max() <= END_STEPS * step:
                covered[: last + 1] = True
            if np.abs(middle[-1] - row).max() <= END_STEPS * step:
                covered[last:] = True


def _arc_of(curve: ProvedCurve, row: Array, unit: Array) -> int:
    """Return the arc that a row is on, −1 if on none."""
    away = np.maximum(np.maximum(curve.low - row, row - curve.high) / unit, 0.0).max(axis=1)
    at = int(np.argmin(away))
    return at if away[at] <= ON_CURVE else -1


def _slice(curve: ProvedCurve, first: int, last: int) -> ProvedCurve:
    """Return consecutive arcs of a curve."""
    whole = first == 0 and last == len(curve.free)
    return replace(
        curve,
        low=curve.low[first:last],
        high=curve.high[first:last],
        free=curve.free[first:last],
        node_low=curve.node_low[first : last + 1],
        node_high=curve.node_high[first : last + 1],
        direction=curve.direction[first:last],
        decided=curve.decided[first:last],
        unstable=curve.unstable[first:last],
        closed=curve.closed and whole,
        ends=curve.ends if whole else ("edge", "edge"),
    )


def completed(
    model: Model,
    diagram: Diagram,
    missing: Sequence[ProvedCurve],
    ranges: Mapping[str, tuple[float, float]],
) -> Diagram:
    """Return the diagram with branches through the missing curves."""
    if not missing:
        return diagram
    known = [_middle(branch) for branch in diagram.branches if branch.admissible]
    given = [(curve.region, _representative(curve)) for curve in missing]
    more = [point for region, point in given if _solvable(diagram, region, point)]
    if len(more) < len(given):
        # rounding of the rates is larger than the distance of the curves
        lost = len(given) - len(more)
        note = f"{lost} of {len(given)} proved curves are not branches: {NOT_SOLVED}"
        diagram = replace(diagram, outcome=with_notes(diagram.outcome, [note]))
    if not more:
        return diagram
    points = known + more
    settings: dict[str, Any] = dict(diagram.settings)
    found = continue_equilibria(
        model,
        diagram.parameter,
        diagram.over,
        continuation=Continuation(**settings),
        window=_common_window(diagram, ranges),
        from_points=points,
    )
    virtual = tuple(b for b in diagram.branches if not b.admissible)
    outcome = ADDED if found.outcome.code == "from points" else found.outcome
    outcome = with_notes(outcome, [n for n in diagram.outcome.notes if n.endswith(NOT_SOLVED)])
    return replace(
        found, branches=(*found.branches, *virtual), bands=diagram.bands, outcome=outcome
    )


def _solvable(diagram: Diagram, region: str, point: Mapping[str, float]) -> bool:
    """Return whether Newton's method converges from a point of a proved curve."""
    if diagram.corrector is None:
        return True
    state = np.array([point[name] for name in diagram.states])
    return diagram.corrector(region, state, point[diagram.parameter]) is not None


def _common_window(
    diagram: Diagram, ranges: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """The smallest window that contains those of the diagram and the certificate.

    A periodic state that it contains as a whole, or that the diagram does not bound, has none.
    """
    window = diagram.window
    found = {}
    for k, name in enumerate(diagram.states):
        low, high = ranges[name]
        if window is not None and np.isfinite([window.lower[k], window.upper[k]]).all():
            low, high = min(low, window.lower[k]), max(high, window.upper[k])
        elif name in diagram.periods:
            continue
        if high - low <= diagram.periods.get(name, np.inf):
            found[name] = (low, high)
    return found


def _middle(branch: Branch) -> Mapping[str, float]:
    row = len(branch.values) // 2
    return {
        **{n: float(v) for n, v in zip(branch.states, branch.state[row], strict=True)},
        branch.parameter: float(branch.values[row]),
    }


def _representative(curve: ProvedCurve) -> Mapping[str, float]:
    """A point of a curve, where the parameter is monotone."""
    middle = 0.5 * curve.node_low + 0.5 * curve.node_high
    rows = np.flatnonzero(np.append(curve.direction, 0) != 0)
    row = rows[len(rows) // 2] if len(rows) else len(middle) // 2
    names = (*curve.states, curve.parameter)
    return {n: float(v) for n, v in zip(names, middle[row], strict=True)}
