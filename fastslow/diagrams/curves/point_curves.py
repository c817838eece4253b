"""Two-parameter continuation of special points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import (
    Name,
    finite,
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
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.settings import Continuation
from fastslow.diagrams.curves.codimension_two import along, coefficients, criteria
from fastslow.diagrams.curves.curve_ends import outcome_of
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.defining import (
    Crossing,
    DefiningSystem,
    Fold,
    OnInterface,
    Pair,
    TwoFold,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.model import Model
from fastslow.results.base.outcome import with_notes
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.point_branch import PointBranch, PointCorrector, PointCurves
from fastslow.results.branch.windows import StateWindow, state_window
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import (
    BOGDANOV_TAKENS,
    BOUNDARY_EQUILIBRIUM,
    BOUNDARY_EQUILIBRIUM_ON_TWO,
    BRANCH_POINT,
    FOLD,
    FOLD_ON_INTERFACE,
    HOPF,
    HOPF_ON_INTERFACE,
    NEUTRAL_SADDLE,
    POINT_TYPES,
    TWO_FOLD,
)
from fastslow.results.points import SpecialPoint, SpecialPoints

Array = NDArray[np.float64]

#: Fraction of its unit above which β breaks a branch point: there is no symmetry.
ISOLATED = 1e-7

#: A component of a tangent below this, in scaled units, does not determine its orientation.
LEVEL = 1e-3


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
    marks: Mapping[Any, Sequence[float]] | None = None,
) -> PointBranch: ...
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
    marks: Mapping[Any, Sequence[float]] | None = None,
) -> PointCurves: ...
@validated(
    point=instance(SpecialPoint, SpecialOrbit, Diagram),
    plane=items(formula),
    over=mapping,
    code=text,
    continuation=instance(Continuation),
    virtual=flag,
    window=mapping,
    marks=mapping,
)
def continue_points(
    point: SpecialPoint | SpecialOrbit | Diagram,
    plane: Sequence[Name],
    over: Mapping[Any, tuple[float, float]],
    *,
    code: str | None = None,
    continuation: Continuation | None = None,
    virtual: bool = True,
    window: Mapping[Any, tuple[float | None, float | None]] | None = None,
    marks: Mapping[Any, Sequence[float]] | None = None,
) -> PointBranch | PointCurves:
    """Trace a curve of special points in the plane of two parameters.

    Folds, Hopf points, branch points (in models with a symmetry), boundary equilibria and
    two-folds are continued as solutions of extended systems (Kuznetsov 2004, chapter 10).
    Codimension-two points are located: CP, BT, GH, ZH, HH, BF (boundary fold, on an
    interface) and BH (boundary Hopf).

    Parameters
    ----------
    point : SpecialPoint, SpecialOrbit or Diagram
        A point of a diagram or of another such curve; from a diagram all of its points, with
        each curve traced once. LPC, PD, TR, BPC (in models with a symmetry) and the contacts
        GR, GS, CS, SS and AS of a branch of periodic orbits, whose curve ends where the orbit
        touches another interface; located are CPC, GPD, CH, LPPD, LPNS, PDNS, NSNS, R1 to R4,
        LPGR, PDGR, NSGR, GRGR and DGR.
    plane : sequence of two str or Symbol
    over : mapping
        Range of both parameters, in their own units.
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
        Parameter to the values at which points UZ are computed.

    Returns
    -------
    PointBranch or PointCurves
        The curve; from a diagram the tuple of its curves.

    Raises
    ------
    ArgumentError
        If the point has no model (it was read from a file), is not on a curve in the plane or
        is outside the ranges; if a mark is outside the ranges, or a range is empty.
    UnknownNameError
        For a name that is not a parameter.

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
    names = _names(plane)
    lower, upper = _ranges(names, over)
    traced = Plane(
        names,
        lower,
        upper,
        continuation or Continuation(),
        virtual,
        window,
        _marks(marks, names, lower, upper),
    )
    if isinstance(point, Diagram):
        return _all(point, traced, code)
    if isinstance(point, SpecialOrbit):
        return _curve_of_orbits(point, traced, code)
    return _curve(point, traced, _curve_code(point, code))[0]


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
    marks : list of (int, float)
        Number of a parameter and its value.
    """

    names: tuple[str, str]
    lower: Array
    upper: Array
    continuation: Continuation
    virtual: bool
    window: Mapping[Any, Any] | None
    marks: list[tuple[int, float]]

    def holds(self, point: SpecialPoint | SpecialOrbit) -> bool:
        """Return whether a point is in the ranges of both parameters."""
        at = np.array([point.parameters.get(name, np.nan) for name in self.names])
        return bool(np.all((at >= self.lower) & (at <= self.upper)))

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        ends = zip(self.lower.tolist(), self.upper.tolist(), strict=True)
        return dict(zip(self.names, ends, strict=True))


def _curve_of_orbits(point: SpecialOrbit, plane: Plane, code: str | None) -> PointBranch:
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
    curve: PointBranch = point.source.curve(point, plane)
    return curve


def _all(diagram: Diagram, plane: Plane, code: str | None) -> PointCurves:
    """Trace the curves of all points of a diagram, each once."""
    kinds = {kind for one in POINT_TYPES.values() if not one.orbits for kind in one.curves}
    if code is not None and code not in kinds:
        raise unknown_name("curve", code, sorted(kinds))
    if diagram.parameter not in plane.names:
        raise ArgumentError(
            f"plane = {plane.names!r}; expected the diagram's parameter "
            f"{diagram.parameter} among them"
        )
    found: list[tuple[PointBranch, TracedRows[DefiningSystem]]] = []
    lost: list[SpecialPoint] = []
    starts = [
        (point, POINT_TYPES[point.code].curves[0])
        for branch in diagram.branches
        for point in branch.special
        if point.code in POINT_TYPES and POINT_TYPES[point.code].curves
    ]
    for point, kind in starts:
        if (code is not None and kind != code) or not plane.holds(point):
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
        if curve.outcome.code != "no branch point":
            found.append((curve, rows))
        else:
            lost.append(point)
    return PointCurves((curve for curve, _ in found), plane.names, tuple(lost))


def _passes(rows: TracedRows[DefiningSystem], point: SpecialPoint, code: str, plane: Plane) -> bool:
    """Return whether a traced curve contains a point of the same kind."""
    system = rows.system
    field = system.field
    if system.code != code:
        return False
    if isinstance(system, OnInterface) and point.interface != field.interfaces[system.interface]:
        return False
    number = _region_of(field, point, code)
    if isinstance(system, OnInterface) and field.continuous(str(point.interface)):
        # on the interface the equilibria of both sides coincide
        beyond = field.neighbour(system.region, system.interface)
        if number not in (system.region, beyond):
            return False
    elif number not in (system.region, _sliding_motion(field, system.region)):
        return False
    u = np.append(point.state, [point.parameters[name] for name in plane.names])
    return rows.passes(u)


def _sliding_motion(field: FrozenField, region: int) -> int:
    """Return the sliding motion with the same equations; a region itself."""
    sides = field.modes[region].sides
    return region if sides is None else region - 1 if sides.escaping else region + 1


def _curve(
    point: SpecialPoint, plane: Plane, code: str
) -> tuple[PointBranch, TracedRows[DefiningSystem]]:
    """Trace the curve of one kind through a point; return it with its rows."""
    system, landing, frame, within = first_row(point, plane, code)
    return _traced(system, landing, frame, point, plane, within)


def first_row(
    point: SpecialPoint, plane: Plane, code: str
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
    region = _region_of(field, point, code)
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
    system, start = _system(field, region, code, point, u, plane.upper - plane.lower)
    frame = _frame(system, start, (plane.lower, plane.upper), within)
    landing = curves.landed(system, start, frame)
    if landing is None:
        raise ArgumentError(
            f"the point {point.label} is not on a curve of {code} points of region "
            f"{field.regions[region]}: Newton's method did not converge from it"
        )
    return system, landing, frame, within


def _names(plane: Sequence[Name]) -> tuple[str, str]:
    names = [str(p) for p in plane]
    if len(names) != 2 or names[0] == names[1]:
        raise ArgumentError(f"plane = {tuple(names)!r}; expected two different parameters")
    return names[0], names[1]


def _ranges(names: tuple[str, str], over: Mapping[Any, tuple[float, float]]) -> tuple[Array, Array]:
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


def _marks(
    given: Mapping[Any, Any] | None, names: tuple[str, str], lower: Array, upper: Array
) -> list[tuple[int, float]]:
    """Return number of the parameter and value of every mark."""
    found = []
    for key, values in (given or {}).items():
        name = str(key)
        if name not in names:
            raise unknown_name("parameter in marks", name, names)
        k = names.index(name)
        for value in items(finite)(f"marks['{name}']", values):
            if not lower[k] <= value <= upper[k]:
                raise ArgumentError(
                    f"mark {name} = {value:g} is outside the range [{lower[k]:g}, {upper[k]:g}]"
                )
            found.append((k, float(value)))
    return found


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
    known = POINT_TYPES.get(point.code)
    possible = known.curves if known else ()
    if not possible:
        raise ArgumentError(
            f"a point {point.code} cannot be continued in two parameters; expected one of "
            f"{', '.join(c for c, t in POINT_TYPES.items() if t.curves and not t.orbits)}"
        )
    if code is None:
        return possible[0]
    if code not in possible:
        raise unknown_name(f"curve from {point.code}", code, possible)
    return code


def _model(point: SpecialPoint, names: tuple[str, str]) -> Model:
    if point.source is None:
        raise ArgumentError(
            f"the point {point.label} has no model (it was read from a file or another "
            "process); trace its diagram again and use its point"
        )
    model: Model = point.source.model
    known = (*model.parameters, *model.free)
    for name in names:
        if name not in known:
            raise unknown_name("parameter", name, known)
    whole = model.with_parameters({n: point.parameters[n] for n in known if n in point.parameters})
    return whole.with_free(names[0]).with_free(names[1])


def _region_of(field: FrozenField, point: SpecialPoint, code: str) -> int:
    """Return the region whose rates vanish.

    At a boundary equilibrium neither the sliding motion nor the one held against the wall.
    """
    numbers = [field.regions.index(r) for r in point.regions if r in field.regions]
    plain = [
        k
        for k in numbers
        if field.modes[k].sides is None
        and point.interface not in [field.interfaces[w] for w in field.modes[k].held]
    ]
    return plain[0] if code == BOUNDARY_EQUILIBRIUM and plain else numbers[0]


def _system(
    field: FrozenField, region: int, code: str, point: SpecialPoint, u: Array, span: Array
) -> tuple[DefiningSystem, Array]:
    """Return the defining system with its first z, with states in units of the diagram."""
    unit = np.maximum(np.abs(u[: field.n]), point.source.unit)
    if code == FOLD:
        fold = Fold(field, region, unit, span)
        return fold, fold.start(u)
    if code == HOPF:
        pair = Pair(field, region, unit, span)
        squared = point.frequency**2 if point.frequency is not None else None
        return pair, pair.start(u, 0.0 if point.code == BOGDANOV_TAKENS else squared)
    if code == BRANCH_POINT:
        crossing = Crossing(field, region, unit, span)
        return crossing, crossing.start(u)
    if code == TWO_FOLD:
        two_fold = TwoFold(field, region, unit, span)
        return two_fold, two_fold.start(u)
    if point.interface not in field.interfaces:
        raise ArgumentError(f"the point {point.label} is not on an interface of the model")
    edge = OnInterface(field, region, unit, span, field.interfaces.index(point.interface))
    return edge, edge.start(u)


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
    field, region, names = system.field, system.region, plane.names
    continuation, virtual = plane.continuation, plane.virtual
    inside = _inside(system, start)

    def stop(z: Array) -> bool:
        if isinstance(system, Crossing) and abs(z[-1]) > ISOLATED * frame.scale[-1]:
            return True
        return not virtual and inside and not _inside(system, z)

    def others(z: Array) -> Array:
        heights = system.heights(z)
        return np.delete(heights, system.interface if isinstance(system, OnInterface) else [])

    bounds = others if isinstance(system, OnInterface) else None
    if isinstance(system, TwoFold) and not virtual and inside:
        bounds = system.edges
    direction = _oriented(curves.tangent(system, start, frame), frame)
    rows, tangents, last = curves.follow(
        system, start, direction, frame, continuation, stop, bounds
    )
    first = last
    if last != curves.CLOSED:
        back, turned, first = curves.follow(
            system, start, -direction, frame, continuation, stop, bounds
        )
        rows = np.concatenate([back[:0:-1], rows])
        tangents = np.concatenate([-turned[:0:-1], tangents])
    watched = criteria(system, _adjacent_regions(system), plane.marks)
    coefficient = along(system, rows)
    identical: list[str] = []
    found = sorted(
        search(TracedRows(system, rows, frame, continuation), watched, identical),
        key=lambda f: (f.row, float((f.z - rows[f.row]) * frame.weight @ tangents[f.row])),
    )
    vanishing = [
        f"The test for {code} vanishes along the curve, to rounding: no such points are reported."
        for code in identical
    ]
    found = _distinct(found, frame)
    places = [f.row + 1 for f in found]
    if found:
        rows = np.insert(rows, places, [f.z for f in found], axis=0)
        own = [_tangent_at(system, f.z, tangents[f.row], frame) for f in found]
        tangents = np.insert(tangents, places, own, axis=0)
        coefficient = np.insert(coefficient, places, along(system, np.array([f.z for f in found])))
    spots = [place + k for k, place in enumerate(places)]
    if not virtual and inside:
        kept = _up_to_interfaces(found, spots, len(rows), first, last)
        rows, tangents, coefficient = rows[kept], tangents[kept], coefficient[kept]
        found = [f for f, k in zip(found, spots, strict=True) if kept.start <= k < kept.stop]
        spots = [k - kept.start for k in spots if kept.start <= k < kept.stop]
    ends = [
        _two_interfaces(system, rows[k])
        if s == curves.BOUND and isinstance(system, OnInterface)
        else None
        for s, k in ((first, 0), (last, -1))
    ]
    if ends[0] is not None:
        found, spots = [ends[0], *found], [0, *spots]
    if ends[1] is not None:
        found, spots = [*found, ends[1]], [*spots, len(rows) - 1]
    w, n = system.width, field.n
    admissible = np.array([_inside(system, z) for z in rows])
    codes = np.full(len(rows), system.code, dtype="<U3")
    if isinstance(system, Pair):
        codes[rows[:, w] < 0] = NEUTRAL_SADDLE
    counts: dict[str, int] = {}
    special = [
        _special(system, f, point, names, tangents[k], counts)
        for f, k in zip(found, spots, strict=True)
    ]
    whole = TracedRows(system, rows, frame, continuation)
    curve = PointBranch(
        field.model.states,
        names,
        system.code,
        codes,
        rows[:, :n].copy(),
        rows[:, n:w].copy(),
        tangents[:, :w].copy(),
        field.eigenvalues(region, rows[:, :w]),
        field.regions[region],
        admissible,
        coefficient,
        SpecialPoints(special),
        tuple(spots),
        (
            with_notes(outcome_of(first, system, rows[0], names, window), vanishing),
            with_notes(outcome_of(last, system, rows[-1], names, window), vanishing),
        ),
        last == curves.CLOSED,
        dict(field.model.parameters),
        field.model.equations,
        asdict(continuation),
        _corrector(whole, point, names),
    )
    return curve, whole


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
        code = NEUTRAL_SADDLE if isinstance(system, Pair) and z[system.width] < 0 else system.code
        residual = float(np.abs(system.residual(z, z)).max())
        criterion = Criterion(PointKind.of(code), lambda _: (0.0, 1.0), always, system.region)
        found = CurvePoint(row, criterion, z, residual, True, 0.0)
        made = _special(system, found, point, names, np.zeros(len(z)), {})
        lyapunov = along(system, z[None])[0] if code == HOPF else np.nan
        return replace(
            made,
            label=code,
            tangent=curves.tangent(system, z, rows.frame)[: system.width],
            lyapunov=None if np.isnan(lyapunov) else float(lyapunov),
            interface=point.interface if code in (BOUNDARY_EQUILIBRIUM, TWO_FOLD) else None,
        )

    return correct


def _oriented(direction: Array, frame: Frame) -> Array:
    """Orient by the first parameter, else by the second, else by the first state."""
    leading = (direction / frame.scale)[: frame.size]
    order = np.append(leading[-2:], leading[:-2])
    place = np.flatnonzero(np.abs(order) > LEVEL)
    return -direction if place.size and order[place[0]] < 0 else direction


def _up_to_interfaces(
    found: list[CurvePoint], spots: list[int], count: int, first: str, last: str
) -> slice:
    """Return the rows up to the points on an interface at which a curve was stopped."""
    on = [
        k
        for f, k in zip(found, spots, strict=True)
        if f.criterion.code in (FOLD_ON_INTERFACE, HOPF_ON_INTERFACE)
    ]
    start = on[0] if on and first == curves.STOPPED else 0
    stop = on[-1] + 1 if on and last == curves.STOPPED else count
    return slice(start, stop)


def _tangent_at(system: DefiningSystem, z: Array, before: Array, frame: Frame) -> Array:
    """Return the tangent at a point between rows, oriented as at the row before."""
    tangent = curves.tangent(system, z, frame)
    return tangent if (tangent * frame.weight) @ before >= 0 else -tangent


def _two_interfaces(system: OnInterface, z: Array) -> CurvePoint:
    """Return the end of a curve of boundary equilibria on a second interface."""
    field, region = system.field, system.region
    # the bounds of a sliding motion, of which one vanishes along the curve, are no interfaces
    count = len(field.interfaces)
    apart = np.abs(system.heights(z))[:count]
    apart[(field.signs[region][:count] == 0) | (np.arange(count) == system.interface)] = np.inf
    other = int(np.argmin(apart))
    criterion = Criterion(
        PointKind.of(BOUNDARY_EQUILIBRIUM_ON_TWO),
        lambda z: (float(system.heights(z)[other]), 1.0),
        always,
        region,
        system.interface,
        field.neighbour(region, other),
        f"on {field.interfaces[other]} as well",
    )
    residual = float(np.abs(np.append(system.residual(z, z), apart[other])).max())
    return CurvePoint(0, criterion, z, residual, True, 0.0)


def _inside(system: DefiningSystem, z: Array) -> bool:
    """Return whether a point is in the closure of its region, its own interface included."""
    return system.inside(z, system.interface if isinstance(system, OnInterface) else None)


def _adjacent_regions(system: DefiningSystem) -> list[int]:
    """Return the regions whose Jacobians are needed: both sides of a continuous interface."""
    if not isinstance(system, OnInterface):
        return []
    field, name = system.field, system.field.interfaces[system.interface]
    beyond = field.neighbour(system.region, system.interface)
    if beyond is None or not field.continuous(name):
        return [system.region]
    return [system.region, beyond]


def _distinct(found: list[CurvePoint], frame: Frame) -> list[CurvePoint]:
    """Remove points already found by another criterion, such as ZH at BT."""
    kept: list[CurvePoint] = []
    for point in found:
        width = frame.size
        near = any(
            np.abs((point.z - k.z) / frame.scale)[:width].max() < 1e-6
            and point.criterion is not k.criterion
            and {point.criterion.code, k.criterion.code} != {FOLD_ON_INTERFACE, HOPF_ON_INTERFACE}
            and (k.criterion.code == point.criterion.code or BOGDANOV_TAKENS in (k.criterion.code,))
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
    counts: dict[str, int],
) -> SpecialPoint:
    field, w, code = system.field, system.width, found.criterion.code
    u = found.z[:w]
    counts[code] = counts.get(code, 0) + 1
    interface = found.criterion.interface
    region = found.criterion.region
    beyond = found.criterion.beyond
    regions: tuple[str, ...] = (field.regions[region],)
    if beyond is not None:
        regions = (*regions, field.regions[beyond])
    data: dict[str, Any] = coefficients(system, found)
    return SpecialPoint(
        code=code,
        label=f"{code}{counts[code]}",
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
        admissible=_inside(system, found.z),
        source=replace(point.source, model=field.model),
        **data,
    )
