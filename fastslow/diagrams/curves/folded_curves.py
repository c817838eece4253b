"""Curves of folded singularities and canard points, and folds of the critical manifold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.curve_points import Criterion, CurvePoint, TracedRows, always, search
from fastslow.continuation.curves import Frame
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.arcs import arc
from fastslow.diagrams.curves.curve_ends import outcome_of
from fastslow.diagrams.points.folded_singularities import (
    FOLD_CURVE,
    FOLDED_KINDS,
    FoldedConditions,
    FoldedKind,
    FoldedSystem,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.branch.point_branch import PointBranch, PointCorrector
from fastslow.results.branch.windows import StateWindow, state_window
from fastslow.results.point_types import point_name
from fastslow.results.points import SpecialPoint, SpecialPoints
from fastslow.symbolic.folded_points import FoldedFlow, FoldedPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FoldedStart:
    """A folded point from which a curve is traced.

    Parameters
    ----------
    flow : FoldedFlow
    code : str
    values : mapping
        Of the variables.
    parameters : mapping
    words : str
        The point in messages.
    """

    flow: FoldedFlow
    code: str
    values: Mapping[str, float]
    parameters: Mapping[str, float]
    words: str

    @classmethod
    def of(cls, point: FoldedPoint | SpecialPoint) -> FoldedStart:
        """Return the start at a point of `slow_flow` or of a curve of such points."""
        if isinstance(point, SpecialPoint):
            at = dict(zip(point.states, point.state.tolist(), strict=True))
            flow: FoldedFlow = point.source
            known = {**at, **point.parameters}
            values = {n: known[n] for n in (*flow.fast, *flow.slow)}
            parameters = {n: known[n] for n in flow.parameters}
            return cls(flow, point.code, values, parameters, f"the point {point.label}")
        if point.flow is None or not (point.code and point.values):
            why = point.note or "it has no code"
            raise ArgumentError(f"point: a {point.words}, which is not continued: {why}")
        flow = point.flow
        values = {n: point.values[n] for n in (*flow.fast, *flow.slow)}
        solved = {n: v for n, v in point.values.items() if n in flow.parameters}
        parameters = {**flow.parameters, **solved}
        return cls(flow, point.code, values, parameters, f"the {point_name(point.code)}")


def folded_curve(
    point: FoldedPoint | SpecialPoint,
    names: Sequence[str],
    over: Mapping[Any, Any],
    settings: Continuation,
    virtual: bool,
    window: Mapping[Any, Any] | None,
) -> PointBranch:
    """Trace the curve through a folded point; see `continue_points`.

    Parameters
    ----------
    point : FoldedPoint or SpecialPoint
    names : sequence of str
        What is free: one parameter, both slow variables, or two parameters.
    over : mapping
        Checked ranges by name.
    settings : Continuation
    virtual : bool
    window : mapping, optional
    """
    begin = FoldedStart.of(point)
    kind = _kind(begin, names)
    at = {**begin.parameters, **begin.values}
    for name in names:
        low, high = over[name]
        if not low <= at[name] <= high:
            raise ArgumentError(
                f"{begin.words} at {name} = {at[name]:g} is outside over = ({low:g}, {high:g})"
            )
    flow = replace(begin.flow, parameters=begin.parameters)
    system = FoldedSystem(
        FoldedConditions(flow, _null_vector(flow, begin.values)), kind, tuple(names), np.ones(0)
    )
    start = np.array([at[name] for name in system.names])
    span = np.array([over[name][1] - over[name][0] for name in names])
    system = replace(system, scale=_scale(system, start, span))
    within = state_window(system.states, window)
    ranges = np.array([over[name] for name in names]).T
    lower, upper = (
        np.append(states, free)
        for states, free in zip((within.lower, within.upper), ranges, strict=True)
    )
    frame = Frame(len(start), system.scale, lower, upper)
    landing = curves.landed(system, start, frame)
    if landing is None:
        raise ArgumentError(
            f"{begin.words} is not on a curve of {kind.code} points over {', '.join(names)}: "
            "Newton's method did not converge from it"
        )
    return _traced(system, landing, frame, begin, settings, virtual, within)


def _kind(begin: FoldedStart, names: Sequence[str]) -> FoldedKind:
    """Return what is traced over some names."""
    flow, kind = begin.flow, FOLDED_KINDS[begin.code]
    for name in names:
        if name not in (*flow.slow, *flow.parameters):
            raise unknown_name("parameter", name, [*flow.parameters, *flow.slow])
    if len(flow.slow) == 2 and set(names) == set(flow.slow):
        return FOLD_CURVE
    slow = [name for name in names if name in flow.slow]
    if slow or len(names) != kind.parameters:
        one = kind.parameters == 1
        expected = "one parameter, or both slow variables" if one else "two parameters"
        raise ArgumentError(f"plane = {', '.join(names)}; expected {expected} for {begin.words}")
    return kind


def _null_vector(flow: FoldedFlow, values: Mapping[str, float]) -> tuple[float, ...]:
    """Right null vector of f_x, in the units of its rows."""
    if len(flow.fast) == 1:
        return (1.0,)
    symbols = [*flow.x, *flow.y]
    at = dict(zip(symbols, (sp.Float(values[s.name], 17) for s in symbols), strict=True))
    matrix = flow.numbers(list(flow.f.jacobian(flow.x)), at).reshape(len(flow.x), -1)
    rows = np.abs(matrix).max(axis=1, keepdims=True)
    matrix = matrix / np.where(rows > 0, rows, 1.0)
    return tuple(np.linalg.svd(matrix)[2][-1].tolist())


def _scale(system: FoldedSystem, start: Array, span: Array) -> Array:
    """Units of the unknowns: their size, or what they change over the range, if that is larger."""
    slopes, free = system.slopes(start, start), len(span)
    rows = np.abs(slopes).max(axis=1, keepdims=True)
    along = np.linalg.svd(slopes / np.where(rows > 0, rows, 1.0))[2][-1]
    share = np.abs(along[-free:]) / span
    change = np.abs(along[:-free]) / share.max() if share.max() > 0 else np.zeros(len(start) - free)
    # a steep curve, as at a folded saddle-node, says nothing of the units
    change = np.where(change > 1e3 * np.abs(start[:-free]).max(initial=1e-3), 0.0, change)
    unit = np.maximum(np.abs(start[:-free]), change)
    return np.append(np.where(unit > 0, unit, 1.0), span)


def _traced(
    system: FoldedSystem,
    start: Array,
    frame: Frame,
    begin: FoldedStart,
    settings: Continuation,
    virtual: bool,
    window: StateWindow,
) -> PointBranch:
    bounds = system.heights if not virtual and system.holds(start) else None
    direction = curves.tangent(system, start, frame)
    direction = direction * (-1.0 if direction[system.n] < 0 else 1.0)
    whole = arc(system, start, direction, frame, settings, bounds=bounds)
    traced = TracedRows(system, whole.rows, frame, settings)
    identical: list[str] = []
    found = whole.in_order(list(search(traced, list(system.kind.tests(system)), identical)), frame)
    rows, tangents, spots = whole.with_points(system, found, frame)
    special: list[SpecialPoint] = []
    for one, k in zip(found, spots, strict=True):
        made = _special(system, one, begin, tangents[k])
        number = 1 + sum(other.code == made.code for other in special)
        special.append(replace(made, label=f"{made.code}{number}"))
    codes = [system.code_at(z) for z in rows]
    for point, k in zip(special, spots, strict=True):
        codes[k] = point.code if system.kind.parameters == 1 else codes[k]
    eigenvalues = np.array([system.kind.eigenvalues(system, z) for z in rows])
    flow = system.conditions.flow
    return PointBranch(
        states=system.states,
        parameter_names=system.free,
        code=system.kind.code,
        codes=np.array(codes, dtype="<U4"),
        state=rows[:, : system.n].copy(),
        values=rows[:, system.n :].copy(),
        tangent=tangents,
        eigenvalues=eigenvalues,
        region=flow.region,
        admissible=np.array([system.holds(z) for z in rows]),
        coefficient=np.array([system.kind.coefficient(system, z) for z in rows]),
        special=SpecialPoints(special),
        special_rows=tuple(spots),
        outcomes=(
            outcome_of(whole.first, system, rows[0], system.free, window, settings),
            outcome_of(whole.last, system, rows[-1], system.free, window, settings),
        ),
        closed=whole.closed,
        parameters={n: v for n, v in flow.parameters.items() if n not in system.free},
        equations=flow.equations,
        settings=asdict(settings),
        corrector=_corrector(TracedRows(system, rows, frame, settings), begin),
    )


def _special(
    system: FoldedSystem, found: CurvePoint, begin: FoldedStart, tangent: Array
) -> SpecialPoint:
    """Return a point of the curve."""
    z, flow = found.z, system.conditions.flow
    free = dict(zip(system.free, z[system.n :].tolist(), strict=True))
    parameters = {**begin.parameters, **free}
    eigenvalues = system.eigenvalues(z)
    return SpecialPoint(
        code=found.criterion.code,
        label=found.criterion.code,
        states=system.states,
        state=z[: system.n].copy(),
        parameters=parameters,
        regions=(flow.region,),
        eigenvalues=eigenvalues,
        tangent=tangent.copy(),
        residual=found.residual,
        converged=found.converged,
        accuracy=found.correction,
        admissible=system.holds(z),
        note=found.criterion.note,
        source=flow,
    )


def _corrector(rows: TracedRows[FoldedSystem], begin: FoldedStart) -> PointCorrector:
    system = rows.system

    def correct(row: int, part: float, name: str, value: float) -> SpecialPoint | None:
        z = rows.solved(row, part, system.names.index(name), value)
        if z is None:
            return None
        kind = PointKind.of(system.code_at(z) or system.kind.code)
        residual = float(np.abs(system.residual(z, z)).max())
        found = CurvePoint(
            row, Criterion(kind, lambda _: (0.0, 1.0), always), z, residual, True, 0.0
        )
        ratio = system.kind.coefficient(system, z)
        made = _special(system, found, begin, curves.tangent(system, z, rows.frame))
        return replace(made, coefficient=None if np.isnan(ratio) else ratio)

    return correct
