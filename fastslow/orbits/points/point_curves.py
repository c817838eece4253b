"""Curves of special points of periodic orbits in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.curve_points import CurvePoint, search
from fastslow.continuation.directions import both_ways
from fastslow.continuation.endings import (
    CLOSED_LOOP,
    END_OF_RANGE,
    NO_BRANCH_POINT,
    STEP_TOO_SMALL,
    TOO_MANY_POINTS,
)
from fastslow.continuation.marks import ValueMark
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.orbits.endings import CONTACT_OF_ORBIT, END_NOT_LOCATED, NEWTON_FAILS, RESONANCE
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.flows import fields
from fastslow.orbits.flow.forcing import forcing_of
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.segments import restarted
from fastslow.orbits.flow.shooting import Shooting, sizes_of
from fastslow.orbits.flow.variations import variations_of
from fastslow.orbits.points.codimension_two import OrbitCodimensionTwo
from fastslow.orbits.points.contacts import ContactEquations
from fastslow.orbits.points.curve_tests import Start, Tests
from fastslow.orbits.points.kinds import KINDS
from fastslow.orbits.points.marked_equations import MarkOnCurve
from fastslow.orbits.points.marks import OrbitMark, OrbitNames, read_orbit_marks
from fastslow.orbits.points.multiplier_signs import multipliers_at
from fastslow.orbits.points.point_curve_ends import CurveEnd, end_at, end_point, past_resonance
from fastslow.orbits.points.point_equations import PointEquations, equations_of
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.branch.point_branch import PointBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.points import SpecialPoint, SpecialPoints

Array = NDArray[np.float64]

#: Rows after which the equations of an autonomous model get a new phase condition.
STRETCH = 20

#: Samples of an orbit for the ranges of its states.
RANGE_SAMPLES = 400

#: Fraction of its size, or of its change with the parameters, below which a range is rounding.
CONSTANT = 1e-9

#: A state below this size that no parameter changes is zero.
VANISHED_STATE = 1e-14

#: Sine of the angle below which a trace that fails is taken to end at a resonance.
NEAR_RESONANCE = 0.3


@dataclass(frozen=True, eq=False)
class PointSource:
    """The equations of a special point of orbits, from which its curve is traced.

    Parameters
    ----------
    problem : OrbitProblem
    shooting : Shooting
        With one chosen parameter.
    u : ndarray, shape (N + 1,)
    place : (int, int, int), optional
        Of a `Contact`.
    scale : ndarray, shape (N + 1,), optional
        Units of the unknowns.
    tangent : ndarray, shape (N + 1,), optional
        Of the branch on which a branch point was found, in these units.
    mark : OrbitMark, optional
        The expression that vanishes.
    """

    problem: OrbitProblem
    shooting: Shooting
    u: Array
    place: tuple[int, int, int] | None = None
    scale: Array | None = None
    tangent: Array | None = None
    mark: OrbitMark | None = None

    def curve(self, point: SpecialOrbit, plane: Plane, marks: Any) -> PointBranch:
        """Trace the curve of the point in a plane, with the points of marks.

        Raises
        ------
        ArgumentError
            For settings that curves of orbits do not have.
        """
        if plane.window:
            raise ArgumentError("window= is for equilibria; a curve of orbits has none")
        wanted = read_orbit_marks(marks, OrbitNames.of(point.orbit), plane.ranges)
        start, model = self.start(point, plane)
        itinerary = " → ".join(point.orbit.itinerary)
        names = self.shooting.variations.function_names
        return traced(start, plane, itinerary, model.equations, names, wanted)

    def start(self, point: SpecialOrbit, plane: Plane) -> tuple[Start, Model]:
        """The point as a point of a curve in a plane, and the model there."""
        model = self.problem.model.with_parameters(dict(point.parameters))
        variations = variations_of(model, plane.names)
        forcing = self.problem.forcing
        if forcing is not None:
            p = self.shooting.parameters_at(self.u)
            forcing = forcing_of(model, variations, forcing.period(p)[0])
        both = replace(
            self.shooting,
            variations=variations,
            forcing=forcing,
            parameters=self.shooting.parameters_at(self.u),
        )
        values = both.parameters
        u = np.append(self.u[: both.size], values[variations.places])
        run = point.orbit.trajectory
        sizes = _sizes(both, u, run(np.linspace(*run.span, RANGE_SAMPLES))[: variations.n], plane)
        kind = KINDS[point.code]
        problem = replace(
            self.problem, model=model, variations=variations, forcing=forcing, parameters=values
        )
        start = Start(
            kind,
            both,
            u,
            sizes,
            point.angle,
            contact=self.place,
            touching=kind.touching,
            mark=self.mark,
            problem=problem,
        )
        return start, model


def _sizes(shooting: Shooting, u: Array, states: Array, plane: Plane) -> Array:
    """Unit of every state: its range along the orbit.

    Of a constant state its size, and near zero its change in one period with the parameters.
    """
    slopes = shooting.linearised(u).flows.slopes[:, :, shooting.variations.n + 1 :]
    response = np.abs(slopes * (plane.upper - plane.lower)).max(axis=(0, 2))
    reach, size = np.ptp(states, axis=1), np.abs(states).max(axis=1)
    found = np.where(reach > CONSTANT * np.maximum(size, response), reach, size)
    found = np.where(found > CONSTANT * response, found, response)
    return np.where(found > VANISHED_STATE, found, 1.0)


@dataclass(eq=False)
class _Rows:
    """Rows of one direction of a curve."""

    states: list[Array] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)
    tangents: list[Array] = field(default_factory=list)
    multipliers: list[NDArray[np.complex128]] = field(default_factory=list)
    points: list[SpecialPoint | None] = field(default_factory=list)
    closed: bool = False
    #: How both ends came about.
    outcomes: tuple[Outcome, ...] = ()

    def ended(self, outcome: Outcome) -> _Rows:
        """These rows, with the outcome of their direction."""
        self.outcomes = (outcome, outcome)
        return self

    def add(
        self, start: Start, z: Array, tangent: Array, point: SpecialPoint | None = None
    ) -> None:
        """Add a row."""
        shooting, u = start.smooth, z[: start.width]
        n, N = shooting.variations.n, shooting.size
        place = np.arange(n)
        if start.contact is not None:
            place = ContactEquations(shooting, np.ones(len(u)), *start.contact).following
        along = np.append(tangent[place], tangent[N : N + 2])
        self.states.append(u[place].copy())
        self.values.append(u[N : N + 2].copy())
        self.tangents.append(along / max(float(np.linalg.norm(along)), 1e-300))
        self.multipliers.append(multipliers_at(shooting, u, shooting.linearised(u)).values)
        if point is not None:
            point = replace(
                point,
                state=self.states[-1],
                eigenvalues=self.multipliers[-1],
                tangent=self.tangents[-1],
            )
        self.points.append(point)

    def closing(self, fresh: int, spans: Array) -> int | None:
        """The row from ``fresh`` on before which the curve passes its first row again."""
        line = np.array(self.values) / spans
        ahead = line[1] - line[0] if len(line) > 1 else spans
        for k in range(max(fresh, 4), len(line)):
            chord = line[k] - line[k - 1]
            length = float(np.linalg.norm(chord))
            part = float((line[0] - line[k - 1]) @ chord) / (length**2 or 1.0)
            off = float(np.linalg.norm(line[k - 1] + part * chord - line[0]))
            same = float(chord @ ahead) > 0.9 * length * float(np.linalg.norm(ahead))
            left = float(np.abs(line[: k - 1] - line[0]).max()) > 3.0 * length
            if 0 < part <= 1 and off <= 0.1 * length and same and left:
                change = np.abs(self.multipliers[k] - self.multipliers[k - 1])
                gap = np.abs(self.multipliers[k] - self.multipliers[0])
                if (gap <= 2.0 * change + 1e-6 * np.abs(self.multipliers[0]) + 1e-9).all():
                    return k
        return None

    def close(self, row: int) -> None:
        """Replace the rows from a row on by the first one."""
        self.states[row:] = self.states[:1]
        self.values[row:] = self.values[:1]
        self.tangents[row:] = self.tangents[:1]
        self.multipliers[row:] = self.multipliers[:1]
        self.points[row:] = [None]
        self.closed = True


def _joined(back: _Rows | None, ahead: _Rows) -> _Rows:
    """The rows of one direction reversed, followed by those of the other."""
    if back is None:
        return ahead
    return _Rows(
        back.states[:0:-1] + ahead.states,
        back.values[:0:-1] + ahead.values,
        [-along for along in back.tangents[:0:-1]] + ahead.tangents,
        back.multipliers[:0:-1] + ahead.multipliers,
        back.points[:0:-1] + ahead.points,
        outcomes=(back.outcomes[1], ahead.outcomes[1]),
    )


def traced(
    start: Start,
    plane: Plane,
    region: str = "",
    equations: str = "",
    interfaces: tuple[str, ...] = (),
    marks: tuple[ValueMark | OrbitMark, ...] = (),
) -> PointBranch:
    """Trace the curve of special points of orbits through one of them.

    Parameters
    ----------
    start : Start
    plane : Plane
        Both parameters, their ranges and the settings.
    region, equations : str
        The itinerary, and the model as text.
    interfaces : tuple of str
        Names of the interfaces.
    marks : tuple
        Whose points are located on the curve.

    Returns
    -------
    PointBranch
        Its states are those at the contact, else at the start of the orbit, which is moved away
        from events where necessary; its eigenvalues are the Floquet multipliers.

    Raises
    ------
    ArgumentError
        If no curve of such points passes through the point.
    """
    variations = start.shooting.variations
    values = start.shooting.parameters[: len(variations.parameters)].tolist()
    named = zip(variations.parameters, values, strict=True)
    fixed = {n: v for n, v in named if n not in plane.names}
    on = "" if start.contact is None else _interface(interfaces, start.contact[1])
    about = _About(plane, variations.states, fixed, region, on, marks)
    rows = both_ways(lambda sign, _: _direction(start, about, sign), _joined)
    if not rows.states:
        raise ArgumentError(
            f"the point is not on a curve of {start.code} points over {plane.names[0]} and "
            f"{plane.names[1]}: Newton's method did not converge from it"
        )
    counts: dict[str, int] = {}
    special, places = [], []
    for k, point in enumerate(rows.points):
        if point is not None:
            counts[point.stem] = counts.get(point.stem, 0) + 1
            special.append(replace(point, label=f"{point.stem}{counts[point.stem]}"))
            places.append(k)
    count, multipliers = len(rows.states), np.array(rows.multipliers)
    if (
        start.contact is not None
        and 0 <= start.contact[1] - variations.interfaces < variations.walls
    ):
        # with speed zero the saltation matrix is unbounded
        multipliers[:] = np.nan
        special = [replace(point, eigenvalues=multipliers[0]) for point in special]
    return PointBranch(
        states=variations.states,
        parameter_names=plane.names,
        code=start.code,
        codes=np.full(count, start.code, dtype="<U3"),
        state=np.array(rows.states),
        values=np.array(rows.values),
        tangent=np.array(rows.tangents),
        eigenvalues=multipliers,
        region=region,
        admissible=np.ones(count, dtype=bool),
        coefficient=np.full(count, np.nan),
        special=SpecialPoints(special),
        special_rows=tuple(places),
        outcomes=(rows.outcomes[0], with_notes(rows.outcomes[1], about.vanishing)),
        closed=rows.closed,
        parameters=fixed,
        equations=equations,
        settings=asdict(plane.continuation),
        mark="" if start.mark is None else start.mark.name,
        expression="" if start.mark is None else start.mark.expression,
    )


def _interface(names: tuple[str, ...], function: int) -> str:
    return names[function] if function < len(names) else ""


@dataclass(frozen=True, eq=False)
class _About:
    """What the rows and points of a curve have in common."""

    plane: Plane
    states: tuple[str, ...]
    fixed: dict[str, float]
    region: str
    interface: str
    marks: tuple[ValueMark | OrbitMark, ...] = ()
    #: Notes on expressions that vanish along the curve.
    vanishing: list[str] = field(default_factory=list)

    def found(
        self, equations: PointEquations, tests: Tests, table: Array, first: bool
    ) -> Iterator[CurvePoint]:
        """Locate the codimension-two points between rows, and those of marks.

        A mark may be satisfied at the last row, and at the ``first`` one of the curve.
        """
        if len(table) < 2:
            return
        rows = equations.rows(table, self.plane)
        yield from search(rows, list(tests.criteria()))
        spans, identical = self.plane.upper - self.plane.lower, list[str]()
        kinds = [MarkOnCurve.given(mark) for mark in self.marks]
        wanted = [kind.criterion(equations.start, self.plane.names, spans) for kind in kinds]
        for point in search(rows, wanted, identical):
            # the first row of a stretch is the last one of that before
            if first or not np.array_equal(point.z, table[0]):
                yield point
        for words in identical:
            note = f"{words} along the curve, to rounding: no such points are reported."
            if note not in self.vanishing:
                self.vanishing.append(note)

    def point(self, tests: Tests, found: CurvePoint) -> SpecialPoint:
        """The located point, without what its row determines."""
        kind = found.criterion.kind
        values = map(float, found.z[tests.start.width - 2 : tests.start.width])
        return SpecialPoint(
            code=kind.code,
            label=kind.code,
            states=self.states,
            state=np.empty(0),
            parameters={**self.fixed, **dict(zip(self.plane.names, values, strict=True))},
            regions=(self.region,),
            eigenvalues=np.empty(0, dtype=complex),
            tangent=np.empty(0),
            residual=found.residual,
            converged=found.converged,
            interface=self.interface or None,
            accuracy=found.correction,
            note=found.criterion.note,
            **kind.form(tests, found),
        )


def _direction(start: Start, about: _About, sign: float) -> _Rows:
    """Trace a curve in one direction, in stretches with the same equations."""
    rows, plane = _Rows(), about.plane
    along: Array | None = None
    while True:
        equations, z = equations_of(start, plane)
        system, frame = equations.system, equations.frame
        landing = curves.landed(system, z, frame)
        if landing is None:
            return rows.ended(_lost(plane, start.u[-2:]))
        direction = curves.tangent(system, landing, frame)
        N = start.shooting.size
        if along is None:
            ahead = direction[N] if abs(direction[N]) > 1e-9 else direction[N + 1]
            direction = direction if ahead * sign >= 0 else -direction
        else:
            same = direction[N : N + 2] / frame.scale[N : N + 2] @ along
            direction = direction if same >= 0 else -direction
        left = plane.continuation.max_points - len(rows.states)
        settings = replace(plane.continuation, max_points=max(2, min(left, STRETCH)))
        ends: list[CurveEnd | None] = []

        def stop(z: Array, start: Start = start, ends: list[CurveEnd | None] = ends) -> bool:
            found = end_at(start, z)
            if isinstance(found, bool):
                return False
            ends.append(found)
            return True

        table, tangents, status = curves.follow(system, landing, direction, frame, settings, stop)
        end = ends[0] if ends else None
        kept = len(table) - (end is not None)
        fresh = len(rows.states)
        first = sign > 0 and not rows.states
        _collect(rows, equations, about, table[:kept], tangents[:kept], first)
        again = rows.closing(fresh, plane.upper - plane.lower)
        if status == curves.CLOSED and along is None:
            again = len(rows.states) - 1
        if again is not None:
            rows.close(again)
            return rows.ended(CLOSED_LOOP.at(curve="curve"))
        angle = start.kind.angle(table[-1])
        if end is None and status == curves.SMALL_STEP and np.isfinite(angle):
            near = abs(np.sin(angle)) < NEAR_RESONANCE
            end = CurveEnd("resonance") if near else None
            table = np.vstack([table, table[-1:]]) if near else table
        past = past_resonance(equations, plane, table, end)
        if past is not None:
            along = (past.u - table[-2][: N + 2])[N:] / frame.scale[N : N + 2]
            start = past
            continue
        if end is not None:
            return rows.ended(_finish(rows, equations, about, table, tangents[: len(table)], end))
        if status in (curves.RANGE, curves.SMALL_STEP) or left <= STRETCH:
            return rows.ended(_ended(status, plane, table[-1][N : N + 2]))
        along = tangents[-1][N : N + 2] / frame.scale[N : N + 2]
        moved = _moved(start, table[-1])
        if moved is None:
            return rows.ended(_lost(plane, table[-1][N : N + 2]))
        start = moved


def _collect(
    rows: _Rows,
    equations: PointEquations,
    about: _About,
    table: Array,
    tangents: Array,
    first: bool,
) -> None:
    """Add the rows of a stretch with the codimension-two points between them."""
    tests = equations.tests(table)
    found = sorted(
        about.found(equations, tests, table, first),
        key=lambda f: (
            f.row,
            float((f.z - table[f.row]) * equations.frame.weight @ tangents[f.row]),
        ),
    )
    for k, (z, tangent) in enumerate(zip(table, tangents, strict=True)):
        if k or not rows.states:
            rows.add(equations.start, z, tangent)
        for one in found:
            if one.row == k:
                rows.add(equations.start, one.z, tangent, about.point(tests, one))


def _finish(
    rows: _Rows,
    equations: PointEquations,
    about: _About,
    table: Array,
    tangents: Array,
    end: CurveEnd,
) -> Outcome:
    """Locate the point at which a curve ends between its last two rows, and add it."""
    plane, N = about.plane, equations.start.shooting.size
    good = table[-2] if len(table) > 1 else table[-1]
    where = _where(plane, good[N : N + 2])
    if end.kind == "unfolded":
        return NO_BRANCH_POINT.at(where=where)
    place = end_point(equations, plane, table, end)
    if place is None:
        reached = "reached a resonance" if end.kind == "resonance" else "touches an interface"
        what = "the curve" if end.kind == "resonance" else "the orbit"
        return END_NOT_LOCATED.at(what=f"{what} {reached}", where=where)
    at, found = place
    rows.add(at.start, found.z, tangents[-1], about.point(at.tests(found.z), found))
    kind = found.criterion.kind
    assert isinstance(kind, OrbitCodimensionTwo)
    where = _where(plane, found.z[at.start.width - 2 : at.start.width])
    ending = RESONANCE if end.kind == "resonance" else CONTACT_OF_ORBIT
    point = f"{kind.code} ({kind.record.name})"
    return ending.at(point=point, where=where, beyond=kind.beyond)


def _moved(start: Start, z: Array) -> Start | None:
    """The same point with the start of its orbit, and its phase condition, chosen anew."""
    N = start.shooting.size
    u, angle = z[: N + 2], start.kind.angle(z)
    shooting = start.shooting
    segments, period = shooting.unpack(u)
    p = shooting.parameters_at(u)
    if start.contact is None:
        try:
            segments = restarted(segments, period, shooting.winding, shooting.variations, p)
        except OrbitError:
            return None
    direction = shooting.direction
    if shooting.forcing is None:
        first = segments.modes[:1], segments.states[:1], np.zeros(1)
        rate = fields(shooting.variations, *first, p, segments.constants[:1]).f[0]
        size = np.maximum(start.sizes, sizes_of(segments.states, segments.states) * 1e-9)
        direction = rate / size**2 / np.linalg.norm(rate / size)
    moved = replace(shooting, form=segments, parameters=p, direction=direction)
    return replace(start, shooting=moved, u=moved.pack(segments, period), angle=angle)


def _where(plane: Plane, values: Array) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(plane.names, values, strict=True))


def _lost(plane: Plane, values: Array) -> Outcome:
    return STEP_TOO_SMALL.at(
        where=_where(plane, values),
        step=plane.continuation.min_step,
        why=NEWTON_FAILS,
    )


def _ended(status: str, plane: Plane, values: Array) -> Outcome:
    where = _where(plane, values)
    if status == curves.RANGE:
        return END_OF_RANGE.at(where=where)
    if status == curves.SMALL_STEP:
        return _lost(plane, values)
    return TOO_MANY_POINTS.at(curve="curve", count=plane.continuation.max_points, where=where)
