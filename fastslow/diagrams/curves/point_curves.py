"""Two-parameter continuation of special points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, overload

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import (
    Name,
    either,
    flag,
    formula,
    instance,
    interval,
    items,
    mapping,
    text,
    validated,
)
from fastslow.continuation import curves
from fastslow.continuation.curve_points import (
    Criterion,
    CurvePoint,
    TracedRows,
    always,
    search,
)
from fastslow.continuation.curves import Frame
from fastslow.continuation.endings import NO_BRANCH_POINT
from fastslow.continuation.marks import Mark, read_marks
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.arcs import arc
from fastslow.diagrams.curves.curve_ends import outcome_of
from fastslow.diagrams.curves.folded_curves import folded_curve
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem, PointInPlane
from fastslow.diagrams.points.kinds import CURVES, KINDS, criteria, curve_kind
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.outcome import with_notes
from fastslow.results.base.upper_layers import computed
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.point_branch import PointBranch, PointCorrector, PointCurves
from fastslow.results.branch.windows import StateWindow, state_window
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import BOUNDARY_EQUILIBRIUM_ON_TWO, POINT_TYPES
from fastslow.results.points import SpecialPoint, SpecialPoints
from fastslow.results.threshold_curves import ThresholdCurve
from fastslow.results.tipping import RateThreshold
from fastslow.symbolic.folded_points import FoldedFlow, FoldedPoint

Array = NDArray[np.float64]

#: Where curves of critical rates are traced.
RATE_CURVES = "fastslow.passage.tipping.rate_curves"

#: A component of a tangent below this, in scaled units, does not determine its orientation.
LEVEL_COMPONENT = 1e-3


@overload
def continue_points(
    point: SpecialPoint | SpecialOrbit,
    plane: Sequence[Name],
    over: Mapping[Any, tuple[float, float]],
    *,
    code: str | None = None,
    continuation: Continuation | None = None,
    virtual: bool = True,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    marks: Mapping[Any, Any] | None = None,
) -> PointBranch: ...
@overload
def continue_points(
    point: FoldedPoint,
    plane: Name | Sequence[Name],
    over: Mapping[Any, tuple[float, float]] | tuple[float, float],
    *,
    code: str | None = None,
    continuation: Continuation | None = None,
    virtual: bool = True,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    marks: Mapping[Any, Any] | None = None,
) -> PointBranch: ...
@overload
def continue_points(
    point: RateThreshold,
    plane: Sequence[Name],
    over: Mapping[Any, tuple[float, float]],
    *,
    code: str | None = None,
    continuation: Continuation | None = None,
    virtual: bool = True,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    marks: Mapping[Any, Any] | None = None,
) -> ThresholdCurve: ...
@overload
def continue_points(
    point: Diagram,
    plane: Sequence[Name],
    over: Mapping[Any, tuple[float, float]],
    *,
    code: str | None = None,
    continuation: Continuation | None = None,
    virtual: bool = True,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    marks: Mapping[Any, Any] | None = None,
) -> PointCurves: ...
@validated(
    point=instance(SpecialPoint, SpecialOrbit, Diagram, RateThreshold, FoldedPoint),
    plane=either(formula, items(formula)),
    over=either(interval, mapping),
    code=text,
    continuation=instance(Continuation),
    virtual=flag,
    window=mapping,
    marks=mapping,
)
def continue_points(
    point: SpecialPoint | SpecialOrbit | Diagram | RateThreshold | FoldedPoint,
    plane: Name | Sequence[Name],
    over: Mapping[Any, tuple[float, float]] | tuple[float, float],
    *,
    code: str | None = None,
    continuation: Continuation | None = None,
    virtual: bool = True,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    marks: Mapping[Any, Any] | None = None,
) -> PointBranch | PointCurves | ThresholdCurve:
    """Trace a curve of special points in the plane of two parameters.

    Folds, Hopf points, branch points (in models with a symmetry), boundary equilibria,
    two-folds and zeros of expressions (``marks=`` of `continue_equilibria`) are continued as
    solutions of extended systems (Kuznetsov 2004, chapter 10).
    Codimension-two points are located: CP, BT, GH, ZH, HH, BF (boundary fold, on an
    interface) and BH (boundary Hopf).

    Parameters
    ----------
    point : SpecialPoint, SpecialOrbit, Diagram, RateThreshold or FoldedPoint
        A point of a diagram or of another such curve; from a diagram all of its points, with
        each curve traced once. LPC, PD, TR, BPC (in models with a symmetry) and the contacts
        GR, GS, CS, SS and AS of a branch of periodic orbits, whose curve ends where the orbit
        touches another interface; located are CPC, GPD, CH, LPPD, LPNS, PDNS, NSNS, R1 to R4,
        LPGR, PDGR, NSGR, GRGR and DGR. A critical rate, with its rate in
        the plane. A folded singularity of `slow_flow` over one parameter, with FSN1 and FSN2,
        or over both slow variables: the fold curve, with FN, FS and FF. A canard point, FSN1
        and FSN2 over two parameters.
    plane : sequence of two str or Symbol
        Of folded singularities, one parameter or both slow variables.
    over : mapping
        Range of each parameter, in its own units; of one parameter also (low, high).
    code : str, optional
        Curve to trace from a codimension-two point: ``"LP"`` or ``"HB"`` from BT and ZH,
        ``"BE"`` or ``"LP"`` from BF, ``"BE"`` or ``"HB"`` from BH. From a diagram, the only
        kind of curves to trace.
    continuation : Continuation, optional
        Lengths in units of the ranges.
    virtual : bool
        Whether the curve continues beyond an interface with virtual points, which are marked
        in its rows.
    window : mapping, optional
        State to its range (low, high), as in `continue_equilibria`: a curve that leaves the
        window ends on its edge. By default the window of the point's diagram.
    marks : mapping, optional
        A parameter to the values at which points UZ are computed, and names to expressions in
        states and parameters whose zeros are points, as in `continue_equilibria`; of orbits in
        their numbers, as in `continue_orbits`.

    Returns
    -------
    PointBranch, PointCurves or ThresholdCurve
        The curve; from a diagram the tuple of its curves, of a critical rate its ThresholdCurve.

    Raises
    ------
    ArgumentError
        If the point has no model (it was read from a file), is not on a curve in the plane or
        is outside the ranges; if a mark is outside the ranges, or a range is empty.
    UnknownNameError
        For a name that is not a parameter.

    See Also
    --------
    fastslow.continue_equilibria, fastslow.continue_orbits, fastslow.plot.parameter_plane

    Examples
    --------
    >>> import sympy as sp
    >>> from fastslow.diagrams.trace.tracing import continue_equilibria
    >>> x, p, q = sp.symbols("x p q")
    >>> model = Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    >>> fold = continue_equilibria(model, "p", (-1, 1)).folds[0]
    >>> curve = continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    >>> [abs(round(c["q"], 12)) for c in curve.special("CP")]
    [0.0]
    """
    if isinstance(point, FoldedPoint) or isinstance(getattr(point, "source", None), FoldedFlow):
        return _on_folds(point, plane, over, code, continuation, virtual, window, marks)
    names = _names(plane)
    lower, upper = _ranges(names, over)
    columns = dict.fromkeys([*getattr(point, "states", ()), *names, *point.parameters])
    traced = Plane(
        names,
        lower,
        upper,
        continuation or Continuation(),
        virtual,
        window,
        (),
    )
    if isinstance(point, RateThreshold):
        curve: ThresholdCurve = computed(RATE_CURVES, "curve_of_rates")(point, traced)
        return curve
    if isinstance(point, SpecialOrbit):
        return _curve_of_orbits(point, traced, code, marks)
    traced = replace(traced, marks=read_marks(marks, traced.ranges, columns))
    if isinstance(point, Diagram):
        return _all(point, traced, code)
    wanted = _curve_code(point, code)
    _require_source(point)
    return _curve(point, traced, curve_kind(wanted))[0]


@dataclass(frozen=True, eq=False)
class Plane:
    """The parameter plane and the settings of a trace.

    Parameters
    ----------
    names : tuple of str
        Both parameters.
    lower, upper : ndarray, shape (2,)
        Their ranges.
    continuation : Continuation
    virtual : bool
        Whether curves continue beyond interfaces.
    window : mapping or None
        Requested ranges of states.
    marks : tuple of Mark
    """

    names: tuple[str, str]
    lower: Array
    upper: Array
    continuation: Continuation
    virtual: bool
    window: Mapping[Any, Any] | None
    marks: tuple[Mark, ...]

    def holds(self, point: SpecialPoint | SpecialOrbit) -> bool:
        """Return whether a point is in the ranges of both parameters."""
        at = np.array([point.parameters.get(name, np.nan) for name in self.names])
        return bool(np.all((at >= self.lower) & (at <= self.upper)))

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        ends = zip(self.lower.tolist(), self.upper.tolist(), strict=True)
        return dict(zip(self.names, ends, strict=True))


def _curve_of_orbits(
    point: SpecialOrbit, plane: Plane, code: str | None, marks: Mapping[Any, Any] | None
) -> PointBranch:
    """Trace the curve of a special point of periodic orbits."""
    possible = (point.code,) if point.mark else POINT_TYPES[point.code].curves
    if not possible:
        kinds = [c for c, t in POINT_TYPES.items() if t.curves and t.orbits]
        raise ArgumentError(
            f"a point {point.code} cannot be continued in two parameters; expected one of "
            f"{', '.join(kinds)}"
        )
    if code not in (None, *possible):
        raise unknown_name(f"curve from {point.code}", code, possible)
    if point.source is None:
        raise ArgumentError(
            f"the point {point.label} has no model (it was read from a file or another "
            "process); trace its branch again and use its point"
        )
    for name in plane.names:
        if name not in point.parameters:
            raise unknown_name("parameter", name, point.parameters)
    if point.parameter not in plane.names:
        raise ArgumentError(
            f"plane={plane.names!r}: expected the branch's parameter {point.parameter} among them"
        )
    if not plane.holds(point):
        at = ", ".join(f"{n} = {point.parameters[n]:g}" for n in plane.names)
        raise ArgumentError(f"the point {point.label} at {at} is outside over={plane.ranges}")
    curve: PointBranch = point.source.curve(point, plane, marks)
    return curve


def _all(diagram: Diagram, plane: Plane, code: str | None) -> PointCurves:
    """Trace the curves of all points of a diagram, each once."""
    named = (mark for mark in dict.fromkeys(p.mark for p in diagram.special) if mark)
    known = [*sorted(kind.code for kind in CURVES), *named]
    if code is not None and code not in known:
        raise unknown_name("curve", code, known)
    if diagram.parameter not in plane.names:
        raise ArgumentError(
            f"plane = {plane.names!r}; expected the diagram's parameter "
            f"{diagram.parameter} among them"
        )
    found: list[tuple[PointBranch, TracedRows[DefiningSystem]]] = []
    lost: list[SpecialPoint] = []
    starts = [
        (point, curve_kind(point.curves[0]))
        for branch in diagram.branches
        for point in branch.special
        if point.curves and code in (None, point.curves[0], point.mark)
    ]
    for point, kind in starts:
        if not plane.holds(point):
            continue
        if any(_passes(rows, point, kind, plane) for _, rows in found):
            continue
        try:
            curve, rows = _curve(point, plane, kind)
        except ArgumentError:
            if point.source is None:
                raise
            lost.append(point)
            continue
        if curve.outcome.code != NO_BRANCH_POINT.code:
            found.append((curve, rows))
        else:
            lost.append(point)
    return PointCurves((curve for curve, _ in found), plane.names, tuple(lost))


def _passes(
    rows: TracedRows[DefiningSystem], point: SpecialPoint, kind: CurveKind, plane: Plane
) -> bool:
    """Return whether a traced curve contains a point of the same kind."""
    u = np.append(point.state, [point.parameters[name] for name in plane.names])
    place = PointInPlane(
        rows.system.field, point, KINDS[point.code], u, rows.system.unit, rows.system.span
    )
    return kind.traced(rows.system, place) and rows.passes(u)


def _curve(
    point: SpecialPoint, plane: Plane, kind: CurveKind
) -> tuple[PointBranch, TracedRows[DefiningSystem]]:
    """Trace the curve of one kind through a point; return it with its rows."""
    system, landing, frame, within = first_row(point, plane, kind)
    return _traced(system, landing, frame, point, plane, within)


def first_row(
    point: SpecialPoint, plane: Plane, kind: CurveKind
) -> tuple[DefiningSystem, Array, Frame, StateWindow]:
    """The equations of the curve of one kind through a point, solved at it.

    Returns
    -------
    system : DefiningSystem
    z : ndarray
        The unknowns at the point.
    frame : Frame
    window : StateWindow

    Raises
    ------
    ArgumentError
        If the point has no model, is outside the plane, or is on no such curve.
    """
    names = plane.names
    model = _model(point, names)
    field = FrozenField(model, *names)
    u = np.append(point.state, [point.parameters[n] for n in names])
    if not plane.holds(point):
        raise ArgumentError(
            f"the point {point.label} at {names[0]} = {u[-2]:g}, {names[1]} = {u[-1]:g} is "
            f"outside over={plane.ranges}"
        )
    within = _window(point, plane.window)
    if not within.contains(point.state, point.source.unit):
        raise ArgumentError(
            f"the point {point.label} is outside the window {within}; window= sets other bounds"
        )
    unit = np.maximum(np.abs(u[: field.n]), point.source.unit)
    place = PointInPlane(field, point, KINDS[point.code], u, unit, plane.upper - plane.lower)
    system, start = kind.start(place)
    frame = _frame(system, start, (plane.lower, plane.upper), within)
    landing = curves.landed(system, start, frame)
    if landing is None:
        raise ArgumentError(
            f"the point {point.label} is not on a curve of {kind.code} points of region "
            f"{field.regions[system.region]}: Newton's method did not converge from it"
        )
    return system, landing, frame, within


def _on_folds(
    point: Any,
    plane: Name | Sequence[Name],
    over: Any,
    code: str | None,
    continuation: Continuation | None,
    virtual: bool,
    window: Mapping[Any, Any] | None,
    marks: Mapping[Any, Any] | None,
) -> PointBranch:
    """Trace the curve of a point of the slow flow; see `continue_points`."""
    names = tuple(map(str, _listed(plane)))
    if code not in (None, point.code):
        raise unknown_name(f"curve from {point.code}", code, [point.code])
    if marks:
        raise ArgumentError("marks: curves of folded points have no marks; use curve.at(...)")
    if not isinstance(over, Mapping):
        over = dict.fromkeys(names, over)
    ranges = _ranges(names, over)
    spans = dict(zip(names, np.column_stack(ranges).tolist(), strict=True))
    return folded_curve(point, names, spans, continuation or Continuation(), virtual, window)


def _listed(plane: Name | Sequence[Name]) -> Sequence[Name]:
    """Return one name as a sequence."""
    return (plane,) if isinstance(plane, str | sp.Symbol) else plane


def _names(plane: Name | Sequence[Name]) -> tuple[str, str]:
    names = [str(p) for p in _listed(plane)]
    if len(names) != 2 or names[0] == names[1]:
        raise ArgumentError(f"plane = {tuple(names)!r}; expected two different parameters")
    return names[0], names[1]


def _ranges(names: tuple[str, ...], over: Any) -> tuple[Array, Array]:
    if not isinstance(over, Mapping):
        raise ArgumentError(f"over = {over!r}; expected the range of each of {', '.join(names)}")
    given = {str(k): v for k, v in over.items()}
    for name in given:
        if name not in names:
            raise unknown_name("parameter in over", name, names)
    bounds = []
    for name in names:
        if name not in given:
            raise ArgumentError(f"over has no range for '{name}'")
        bounds.append(interval(f"over['{name}']", given[name]))
    table = np.array(bounds)
    return table[:, 0], table[:, 1]


def _window(point: SpecialPoint, given: Mapping[Any, Any] | None) -> StateWindow:
    """Return the requested window, completed by that of the point's diagram."""
    known: StateWindow = point.source.window
    asked = state_window(known.states, given)
    lower, upper, meant = list(known.lower), list(known.upper), list(known.given)
    for k, (low, high) in enumerate(asked.given):
        lower[k] = asked.lower[k] if low else lower[k]
        upper[k] = asked.upper[k] if high else upper[k]
        meant[k] = (low or meant[k][0], high or meant[k][1])
    return replace(known, lower=tuple(lower), upper=tuple(upper), given=tuple(meant))


def _curve_code(point: SpecialPoint, code: str | None) -> str:
    possible = point.curves
    if not possible:
        raise ArgumentError(
            f"a point {point.code} cannot be continued in two parameters; expected one of "
            f"{', '.join(c for c, t in POINT_TYPES.items() if t.curves and not t.orbits)}, or a "
            "zero of an expression given in marks="
        )
    if code is None:
        return possible[0]
    if code not in possible:
        raise unknown_name(f"curve from {point.code}", code, possible)
    return code


def _require_source(point: SpecialPoint) -> None:
    """Raise ArgumentError for a point without its model."""
    if point.source is None:
        raise ArgumentError(
            f"the point {point.label} has no model (it was read from a file or another "
            "process); trace its diagram again and use its point"
        )


def _model(point: SpecialPoint, names: tuple[str, str]) -> Model:
    _require_source(point)
    model: Model = point.source.model
    known = (*model.parameters, *model.free)
    for name in names:
        if name not in known:
            raise unknown_name("parameter", name, known)
    whole = model.with_parameters({n: point.parameters[n] for n in known if n in point.parameters})
    return whole.with_free(names[0]).with_free(names[1])


def _frame(
    system: DefiningSystem, start: Array, over: tuple[Array, Array], window: StateWindow
) -> Frame:
    scale = np.concatenate([system.scales, system.extras(start)])
    lower, upper = (
        np.concatenate([states, plane])
        for states, plane in zip((window.lower, window.upper), over, strict=True)
    )
    return Frame(system.width, scale, lower, upper)


def _traced(
    system: DefiningSystem,
    start: Array,
    frame: Frame,
    point: SpecialPoint,
    plane: Plane,
    window: StateWindow,
) -> tuple[PointBranch, TracedRows[DefiningSystem]]:
    bounded = not plane.virtual and system.holds(start)
    direction = _oriented(curves.tangent(system, start, frame), frame)

    def stop(z: Array) -> bool:
        return system.lost(z, frame.scale) or (bounded and not system.holds(z))

    bounds = system.bounds(bounded)
    traced_arc = arc(system, start, direction, frame, plane.continuation, stop, bounds)
    rows, tangents = traced_arc.rows, traced_arc.tangents
    identical: list[str] = []
    traced = TracedRows(system, rows, frame, plane.continuation)
    tests = criteria(system, plane.marks)
    found = _distinct(traced_arc.in_order(list(search(traced, tests, identical)), frame), frame)
    rows, tangents, spots = traced_arc.with_points(system, found, frame)
    if bounded:
        kept = _up_to_interfaces(found, spots, len(rows), traced_arc.first, traced_arc.last)
        rows, tangents = rows[kept], tangents[kept]
        found = [f for f, k in zip(found, spots, strict=True) if kept.start <= k < kept.stop]
        spots = [k - kept.start for k in spots if kept.start <= k < kept.stop]
    if system.own_interface is not None:
        if traced_arc.first == curves.BOUND:
            found, spots = [_two_interfaces(system, rows[0]), *found], [0, *spots]
        if traced_arc.last == curves.BOUND:
            found = [*found, _two_interfaces(system, rows[-1])]
            spots = [*spots, len(rows) - 1]
    special: list[SpecialPoint] = []
    for one, k in zip(found, spots, strict=True):
        special.append(_special(system, one, point, plane.names, tangents[k], special))
    vanishing = [
        f"The test for {words} vanishes along the curve, to rounding: no such points are reported."
        for words in identical
    ]
    first, last = (
        with_notes(
            outcome_of(status, system, z, plane.names, window, plane.continuation), vanishing
        )
        for status, z in ((traced_arc.first, rows[0]), (traced_arc.last, rows[-1]))
    )
    whole = TracedRows(system, rows, frame, plane.continuation)
    entries = {
        "special": SpecialPoints(special),
        "special_rows": tuple(spots),
        "outcomes": (first, last),
        "closed": traced_arc.closed,
    }
    return _branch(whole, tangents, point, plane, entries), whole


def _branch(
    traced: TracedRows[DefiningSystem],
    tangents: Array,
    point: SpecialPoint,
    plane: Plane,
    entries: Mapping[str, Any],
) -> PointBranch:
    """Return the table of a traced curve; ``entries`` are those besides its rows."""
    system, rows = traced.system, traced.z
    field, w, n = system.field, system.width, system.n
    return PointBranch(
        states=field.model.states,
        parameter_names=plane.names,
        code=system.code,
        codes=np.array([system.code_at(z) for z in rows], dtype="<U3"),
        state=rows[:, :n].copy(),
        values=rows[:, n:w].copy(),
        tangent=tangents[:, :w].copy(),
        eigenvalues=field.eigenvalues(system.region, rows[:, :w]),
        region=field.regions[system.region],
        admissible=np.array([system.holds(z) for z in rows]),
        coefficient=np.array([system.coefficient(z) for z in rows]),
        parameters=dict(field.model.parameters),
        equations=field.model.equations,
        settings=asdict(plane.continuation),
        mark=point.mark,
        expression=point.expression,
        corrector=_corrector(traced, point, plane.names),
        **entries,
    )


def _corrector(
    rows: TracedRows[DefiningSystem], point: SpecialPoint, names: tuple[str, str]
) -> PointCorrector:
    system = rows.system
    n = system.n

    def correct(row: int, part: float, name: str, value: float) -> SpecialPoint | None:
        entry = n + names.index(name)
        z = rows.solved(row, part, entry, value)
        if z is None:
            return None
        residual = float(np.abs(system.residual(z, z)).max())
        kind = PointKind.of(system.code_at(z))
        criterion = Criterion(kind, lambda _: (0.0, 1.0), always, system.region)
        found = CurvePoint(row, criterion, z, residual, True, 0.0)
        made = _special(system, found, point, names, np.zeros(len(z)), ())
        coefficient = system.coefficient(z)
        known = None if np.isnan(coefficient) else float(coefficient)
        entries = {kind.record.coefficient: known}
        return replace(
            made,
            label=kind.code,
            tangent=curves.tangent(system, z, rows.frame)[: system.width],
            coefficient=entries.get("coefficient"),
            lyapunov=entries.get("lyapunov"),
            interface=point.interface if system.on_interface else None,
        )

    return correct


def _oriented(direction: Array, frame: Frame) -> Array:
    """Orient by the first parameter, else by the second, else by the first state."""
    leading = (direction / frame.scale)[: frame.size]
    order = np.append(leading[-2:], leading[:-2])
    place = np.flatnonzero(np.abs(order) > LEVEL_COMPONENT)
    return -direction if place.size and order[place[0]] < 0 else direction


def _up_to_interfaces(
    found: list[CurvePoint], spots: list[int], count: int, first: str, last: str
) -> slice:
    """Return the rows up to the points on an interface at which a curve was stopped."""
    on = [k for f, k in zip(found, spots, strict=True) if f.criterion.kind.ends_curves]
    start = on[0] if on and first == curves.STOPPED else 0
    stop = on[-1] + 1 if on and last == curves.STOPPED else count
    return slice(start, stop)


def _two_interfaces(system: DefiningSystem, z: Array) -> CurvePoint:
    """Return the end of a curve of boundary equilibria on a second interface."""
    field, region = system.field, system.region
    # the bounds of a sliding motion, of which one vanishes along the curve, are no interfaces
    count = len(field.interfaces)
    apart = np.abs(system.heights(z))[:count]
    apart[(field.signs[region][:count] == 0) | (np.arange(count) == system.own_interface)] = np.inf
    other = int(np.argmin(apart))
    criterion = Criterion(
        PointKind.of(BOUNDARY_EQUILIBRIUM_ON_TWO),
        lambda z: (float(system.heights(z)[other]), 1.0),
        always,
        region,
        system.own_interface,
        field.neighbour(region, other),
        f"on {field.interfaces[other]} as well",
    )
    residual = float(np.abs(np.append(system.residual(z, z), apart[other])).max())
    return CurvePoint(0, criterion, z, residual, True, 0.0)


def _distinct(found: list[CurvePoint], frame: Frame) -> list[CurvePoint]:
    """Remove points already found by another criterion, such as ZH at BT."""
    kept: list[CurvePoint] = []
    for point in found:
        width = frame.size
        near = any(
            np.abs((point.z - k.z) / frame.scale)[:width].max() < 1e-6
            and point.criterion is not k.criterion
            and k.criterion.kind.absorbs(point.criterion.kind)
            and k.criterion.region == point.criterion.region
            for k in kept
        )
        if not near:
            kept.append(point)
    return kept


def _special(
    system: DefiningSystem,
    found: CurvePoint,
    point: SpecialPoint,
    names: tuple[str, str],
    tangent: Array,
    before: Sequence[SpecialPoint],
) -> SpecialPoint:
    field, w, code = system.field, system.width, found.criterion.code
    u = found.z[:w]
    interface = found.criterion.interface
    region = found.criterion.region
    beyond = found.criterion.beyond
    regions: tuple[str, ...] = (field.regions[region],)
    if beyond is not None:
        regions = (*regions, field.regions[beyond])
    made = SpecialPoint(
        code=code,
        label=code,
        states=field.model.states,
        state=u[: field.n].copy(),
        parameters={
            **point.parameters,
            **dict(zip(names, map(float, u[field.n :]), strict=True)),
        },
        regions=regions,
        eigenvalues=field.eigenvalues(region, u),
        tangent=tangent[:w].copy(),
        residual=found.residual,
        converged=found.converged,
        interface=None if interface is None else field.interfaces[interface],
        accuracy=found.correction,
        note=found.criterion.note,
        admissible=system.holds(found.z),
        source=replace(point.source, model=field.model),
        **found.criterion.kind.form(system, found),
    )
    number = 1 + sum(other.stem == made.stem for other in before)
    return replace(made, label=f"{made.stem}{number}")
