"""Curves of special points of periodic orbits in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.diagrams.curves.codimension_two import Candidate, TracedRows, search, solved_from
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.errors import ArgumentError
from fastslow.orbits.codimension_two import MULTIPLIER, Start, Tests
from fastslow.orbits.contacts import ContactEquations, near_touches
from fastslow.orbits.detection import multipliers_at
from fastslow.orbits.flows import fields
from fastslow.orbits.forcing import forcing_of
from fastslow.orbits.problem import OrbitProblem
from fastslow.orbits.segments import MARGIN, OrbitError, Segments, restarted
from fastslow.orbits.shooting import Shooting, sizes_of
from fastslow.orbits.special_points import (
    Extended,
    branch_point_system,
    multiplier_system,
    torus_system,
)
from fastslow.orbits.switching import without_segment
from fastslow.orbits.variations import variations_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.point_branch import PointBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import (
    ADDING_SLIDING,
    BRANCH_POINT_OF_CYCLES,
    DEGENERATE_GRAZING,
    FOLD_OF_CYCLES,
    GRAZING,
    GRAZING_DOUBLING,
    GRAZING_FOLD,
    GRAZING_SLIDING,
    GRAZING_TORUS,
    PERIOD_DOUBLING,
    RESONANCE_1,
    RESONANCE_2,
    TORUS,
    TWO_CONTACTS,
    point_name,
)
from fastslow.results.points import SpecialPoint, SpecialPoints

Array = NDArray[np.float64]

#: Rows after which the equations of an autonomous model get a new phase condition.
STRETCH = 20

#: Distance from the first point of a stretch, in units of the unknowns, beyond which an iterate of
#: Newton's method is given up.
FAR = 5.0

#: Samples of an orbit for the ranges of its states.
SAMPLES = 400

#: Distance beyond an interface, as a fraction of the range of its function, that is rounding.
BEYOND = 1e-7

#: Fraction of its size, or of its change with the parameters, below which a range is rounding.
CONSTANT = 1e-9

#: A state below this size that no parameter changes is zero.
NOTHING = 1e-14

#: Codes of contacts at which the orbit touches.
TOUCHING = (GRAZING, GRAZING_SLIDING, ADDING_SLIDING)

#: Distance of the angle of TR from 0 and π at which its curve is traced no further: folds of
#: cycles and period doublings satisfy its equations there.
NO_RESONANCE = 0.05

#: Sine of the angle below which a trace that fails is taken to end at a resonance.
NEAR_RESONANCE = 0.3

#: Unfolding, in units of the equations, above which there is no branch point.
UNFOLDED = 1e-7

#: What there is beyond the points at which curves end.
_ITINERARY = "beyond it the itinerary is another."
BEYOND_END = {
    RESONANCE_1: "beyond it there are neutral saddles.",
    RESONANCE_2: "beyond it there are neutral saddles.",
    GRAZING_FOLD: _ITINERARY,
    GRAZING_DOUBLING: _ITINERARY,
    GRAZING_TORUS: _ITINERARY,
    TWO_CONTACTS: _ITINERARY,
    DEGENERATE_GRAZING: "the touch meets a crossing.",
}


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
    """

    problem: OrbitProblem
    shooting: Shooting
    u: Array
    place: tuple[int, int, int] | None = None
    scale: Array | None = None
    tangent: Array | None = None

    def curve(self, point: SpecialOrbit, plane: Plane) -> PointBranch:
        """Trace the curve of the point in a plane.

        Raises
        ------
        ArgumentError
            For settings that curves of orbits do not have.
        """
        if plane.window or plane.marks:
            given = "window" if plane.window else "marks"
            raise ArgumentError(f"{given}= is for equilibria; a curve of orbits has none")
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
        values = both.parameters[variations.places]
        u = np.append(self.u[: both.size], values)
        run = point.orbit.trajectory
        sizes = _sizes(both, u, run(np.linspace(*run.span, SAMPLES))[: variations.n], plane)
        touching = point.code in TOUCHING
        start = Start(point.code, both, u, sizes, point.angle, self.place, touching)
        itinerary = " → ".join(point.orbit.itinerary)
        return traced(start, plane, itinerary, model.equations, tuple(run.interfaces))


def _sizes(shooting: Shooting, u: Array, states: Array, plane: Plane) -> Array:
    """Unit of every state: its range along the orbit.

    Of a constant state its size, and near zero its change in one period with the parameters.
    """
    slopes = shooting.linearised(u).flows.slopes[:, :, shooting.variations.n + 1 :]
    response = np.abs(slopes * (plane.upper - plane.lower)).max(axis=(0, 2))
    reach, size = np.ptp(states, axis=1), np.abs(states).max(axis=1)
    found = np.where(reach > CONSTANT * np.maximum(size, response), reach, size)
    found = np.where(found > CONSTANT * response, found, response)
    return np.where(found > NOTHING, found, 1.0)


@dataclass(eq=False)
class _System(curves.ExactSystem):
    """Extended equations in their own units, as a system of `curves`."""

    extended: Callable[[Array], Extended]
    scale: Array
    first: Array
    key: bytes = b""
    known: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)))

    def residual(self, z: Array, guide: Array) -> Array:
        if z.ndim > 1:
            return np.array([self.residual(one, guide) for one in z])
        return self._at(z)[0]

    def slopes(self, z: Array, guide: Array) -> Array:
        return self._at(z)[1]

    def _at(self, z: Array) -> tuple[Array, Array]:
        if z.tobytes() != self.key:
            size = len(z) - 1
            # a step that is too long
            values, jacobian = np.full(size, np.nan), np.full((size, len(z)), np.nan)
            if np.abs((z - self.first) / self.scale).max() < FAR:
                with suppress(np.linalg.LinAlgError):
                    values, jacobian, _ = self.extended(z)
            self.known, self.key = (values, jacobian / self.scale), z.tobytes()
        return self.known


@dataclass(eq=False)
class _Rows:
    """Rows of one direction of a curve."""

    states: list[Array] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)
    tangents: list[Array] = field(default_factory=list)
    multipliers: list[NDArray[np.complex128]] = field(default_factory=list)
    points: list[SpecialPoint | None] = field(default_factory=list)
    closed: bool = False

    def add(
        self, start: Start, z: Array, tangent: Array, point: SpecialPoint | None = None
    ) -> None:
        """Add a row."""
        shooting, u = start.smooth, z[: start.events]
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

    def before(self, other: _Rows) -> _Rows:
        """These rows reversed, followed by those of the other direction."""
        return _Rows(
            self.states[:0:-1] + other.states,
            self.values[:0:-1] + other.values,
            [-along for along in self.tangents[:0:-1]] + other.tangents,
            self.multipliers[:0:-1] + other.multipliers,
            self.points[:0:-1] + other.points,
        )

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


def traced(
    start: Start,
    plane: Plane,
    region: str = "",
    equations: str = "",
    interfaces: tuple[str, ...] = (),
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
    named = zip(variations.parameters, start.shooting.parameters.tolist(), strict=True)
    fixed = {n: v for n, v in named if n not in plane.names}
    on = "" if start.contact is None else _interface(interfaces, start.contact[1])
    about = _About(plane, variations.states, fixed, region, on)
    rows, last = _direction(start, about, 1.0)
    first = last
    if not rows.closed:
        back, first = _direction(start, about, -1.0)
        rows = back.before(rows)
    if not rows.states:
        raise ArgumentError(
            f"the point is not on a curve of {start.code} points over {plane.names[0]} and "
            f"{plane.names[1]}: Newton's method did not converge from it"
        )
    counts: dict[str, int] = {}
    special, places = [], []
    for k, point in enumerate(rows.points):
        if point is not None:
            counts[point.code] = counts.get(point.code, 0) + 1
            special.append(replace(point, label=f"{point.code}{counts[point.code]}"))
            places.append(k)
    count = len(rows.states)
    return PointBranch(
        variations.states,
        plane.names,
        start.code,
        np.full(count, start.code, dtype="<U3"),
        np.array(rows.states),
        np.array(rows.values),
        np.array(rows.tangents),
        np.array(rows.multipliers),
        region,
        np.ones(count, dtype=bool),
        np.full(count, np.nan),
        SpecialPoints(special),
        tuple(places),
        (first, last),
        rows.closed,
        fixed,
        equations,
        asdict(plane.continuation),
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

    def point(self, tests: Tests, found: Candidate) -> SpecialPoint:
        """The located point, without what its row determines."""
        code = found.criterion.code
        form, missing = tests.normal_form(code, found.z)
        values = map(float, found.z[tests.start.events - 2 : tests.start.events])
        return SpecialPoint(
            code=code,
            label=code,
            states=self.states,
            state=np.empty(0),
            parameters={**self.fixed, **dict(zip(self.plane.names, values, strict=True))},
            regions=(self.region,),
            eigenvalues=np.empty(0, dtype=complex),
            tangent=np.empty(0),
            residual=found.residual,
            converged=found.converged,
            interface=self.interface or None,
            normal_form=form,
            degeneracy=missing,
            accuracy=found.correction,
        )


@dataclass(frozen=True, eq=False)
class _Equations:
    """The equations of a stretch of a curve, with their frame and tests."""

    start: Start
    system: _System
    frame: curves.Frame
    scale: Array

    def rows(self, z: Array, plane: Plane) -> TracedRows[_System]:
        return TracedRows(self.system, np.atleast_2d(z), self.frame, plane.continuation)

    def tests(self, z: Array) -> Tests:
        return Tests(self.start, self.scale, np.atleast_2d(z))


@dataclass(frozen=True, eq=False)
class _End:
    """A row after which a curve ends.

    Parameters
    ----------
    kind : str
        ``"vanishing"``, ``"touch"``, ``"resonance"`` or ``"unfolded"``.
    segment : int
    offset : float
    function : int
    """

    kind: str
    segment: int = -1
    offset: float = 0.0
    function: int = -1


def _direction(start: Start, about: _About, sign: float) -> tuple[_Rows, Outcome]:
    """Trace a curve in one direction, in stretches with the same equations."""
    rows, plane = _Rows(), about.plane
    along: Array | None = None
    while True:
        equations, z = _equations(start, plane)
        system, frame = equations.system, equations.frame
        landing = curves.landed(system, z, frame)
        if landing is None:
            return rows, _lost(plane, start.u[-2:])
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
        ends: list[_End | None] = []

        def stop(z: Array, start: Start = start, ends: list[_End | None] = ends) -> bool:
            found = _stopped(start, z)
            if isinstance(found, bool):
                return False
            ends.append(found)
            return True

        table, tangents, status = curves.follow(system, landing, direction, frame, settings, stop)
        end = ends[0] if ends else None
        kept = len(table) - (end is not None)
        fresh = len(rows.states)
        _collect(rows, equations, about, table[:kept], tangents[:kept])
        again = rows.closing(fresh, plane.upper - plane.lower)
        if status == curves.CLOSED and along is None:
            again = len(rows.states) - 1
        if again is not None:
            rows.close(again)
            return rows, Outcome(
                "closed loop", "the curve returned to its start: a closed loop.", True
            )
        if end is None and status == curves.SMALL_STEP and start.code == TORUS:
            near = abs(np.sin(table[-1][-1])) < NEAR_RESONANCE
            end = _End("resonance") if near else None
            table = np.vstack([table, table[-1:]]) if near else table
        past = _past_resonance(equations, plane, table, end)
        if past is not None:
            along = (past.u - table[-2][: N + 2])[N:] / frame.scale[N : N + 2]
            start = past
            continue
        if end is not None:
            return rows, _finish(rows, equations, about, table, tangents[: len(table)], end)
        if status in (curves.RANGE, curves.SMALL_STEP) or left <= STRETCH:
            return rows, _ended(status, plane, table[-1][N : N + 2])
        along = tangents[-1][N : N + 2] / frame.scale[N : N + 2]
        moved = _moved(start, table[-1])
        if moved is None:
            return rows, _lost(plane, table[-1][N : N + 2])
        start = moved


def _collect(
    rows: _Rows, equations: _Equations, about: _About, table: Array, tangents: Array
) -> None:
    """Add the rows of a stretch with the codimension-two points between them."""
    tests = equations.tests(table)
    watched = list(tests.criteria()) if len(table) > 1 else []
    found = sorted(
        search(equations.rows(table, about.plane), watched),
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


def _equations(start: Start, plane: Plane) -> tuple[_Equations, Array]:
    """The extended equations with their frame, and the first point."""
    shooting, u = start.shooting, start.u
    segments, period = shooting.unpack(u)
    K, N = len(segments), shooting.size
    spans = plane.upper - plane.lower
    scale = np.concatenate([np.tile(start.sizes, K), np.full(K + 1, period), spans])
    extended: Callable[[Array], Extended]
    more: list[float] = []
    if start.contact is not None:
        extended = ContactEquations(shooting, scale, *start.contact)
    elif start.code == TORUS:
        extended, more = torus_system(shooting, scale), [start.angle]
    elif start.code == BRANCH_POINT_OF_CYCLES:
        extended, more = branch_point_system(shooting, scale), [0.0]
    else:
        extended = multiplier_system(shooting, scale, MULTIPLIER[start.code])
    z, units = np.append(u, more), np.append(scale, np.ones(len(more)))
    # the length of a step does not depend on the number of segments
    lengths = units.copy()
    lengths[:N] *= np.sqrt(K)
    lower, upper = np.full(N + 2, -np.inf), np.full(N + 2, np.inf)
    lower[-2:], upper[-2:] = plane.lower, plane.upper
    frame = curves.Frame(N + 2, lengths, lower, upper)
    return _Equations(start, _System(extended, units, z), frame, scale), z


def _stopped(start: Start, z: Array) -> _End | bool | None:
    """What ends a curve at a row; None to begin a new stretch, False to continue."""
    u = z[: start.events]
    if start.code == TORUS and not NO_RESONANCE < z[-1] < np.pi - NO_RESONANCE:
        return _End("resonance")
    if start.code == BRANCH_POINT_OF_CYCLES and abs(z[-1]) > UNFOLDED:
        return _End("unfolded")
    segments, _ = start.shooting.unpack(u)
    inner = segments.durations[1:-1]
    # the segments at the start are two parts of one
    whole = segments.durations[0] + segments.durations[-1] if len(segments) > 1 else 1.0
    if whole <= 0 or inner.min(initial=1.0) <= 0:
        return _End("vanishing", int(np.argmin(inner)) + 1 if whole > 0 else 0)
    touches = [one for one in near_touches(start.shooting, u) if one.clearance < -BEYOND]
    if touches:
        last = min(touches, key=lambda one: one.clearance)
        return _End("touch", last.segment, last.offset, last.function)
    near = min(segments.durations[0], segments.durations[-1]) < MARGIN * segments.period
    if len(segments) > 1 and near and start.contact is None:
        return None
    return False


def _finish(
    rows: _Rows,
    equations: _Equations,
    about: _About,
    table: Array,
    tangents: Array,
    end: _End,
) -> Outcome:
    """Locate the point at which a curve ends between its last two rows, and add it."""
    plane, N = about.plane, equations.start.shooting.size
    good = table[-2] if len(table) > 1 else table[-1]
    where = _where(plane, good[N : N + 2])
    if end.kind == "unfolded":
        return Outcome(
            "no branch point",
            f"the branch point does not persist near {where}: without a symmetry it is isolated.",
            False,
        )
    place = _end_point(equations, plane, table, end)
    if place is None:
        kind = "reached a resonance" if end.kind == "resonance" else "touches an interface"
        what = "the curve" if end.kind == "resonance" else "the orbit"
        return Outcome(
            "end not located",
            f"{what} {kind} near {where}, where the curve ends; the point was not located.",
            False,
        )
    at, found = place
    rows.add(at.start, found.z, tangents[-1], about.point(at.tests(found.z), found))
    code = found.criterion.code
    where = _where(plane, found.z[at.start.events - 2 : at.start.events])
    words = f"ends at {code} ({point_name(code)}) at {where}; {BEYOND_END[code]}"
    if end.kind == "resonance":
        return Outcome("resonance", words, True)
    return Outcome("contact of the orbit", words, True)


def _past_resonance(
    equations: _Equations, plane: Plane, table: Array, end: _End | None
) -> Start | None:
    """The curve of TR beyond an angle 0 or π that is no resonance R1 or R2.

    The double multiplier has two eigenvectors there, as by a symmetry under which the return map
    is the square of another map. The equations are singular at that angle alone.
    """
    if end is None or end.kind != "resonance" or len(table) < 3:
        return None
    one, two, frame = table[-3], table[-2], equations.frame
    middle = np.pi * np.round(two[-1] / np.pi)
    turned, left = two[-1] - one[-1], middle - two[-1]
    if not turned * left > 0 or _end_point(equations, plane, table, end) is not None:
        return None
    chord = two - one
    length = float(np.sqrt(chord**2 @ frame.weight))
    guess = two + 2.0 * left / turned * chord
    found = curves.corrected(
        equations.system, guess, chord / (length or 1.0), frame, plane.continuation
    )
    if found is None or abs(found[0][-1] - guess[-1]) > 0.5 * abs(left):
        return None
    if np.sqrt((found[0] - guess) ** 2 @ frame.weight) > plane.continuation.max_step:
        return None
    # the conjugate multiplier
    angle = float(2.0 * middle - found[0][-1])
    return replace(equations.start, u=found[0][:-1], angle=abs(angle))


def _end_point(
    equations: _Equations, plane: Plane, table: Array, end: _End
) -> tuple[_Equations, Candidate] | None:
    """The equations and the point at which a curve ends."""
    start, good = equations.start, table[-2] if len(table) > 1 else table[-1]
    if end.kind == "touch":
        if len(table) < 2:
            return None
        tests = equations.tests(table[-2:])
        criterion = tests.touch(end.segment, end.offset, end.function)
        found = next(search(equations.rows(table[-2:], plane), [criterion]), None)
        return None if found is None or not found.converged else (equations, found)
    if end.kind == "resonance":
        fold = good[-1] < 0.5 * np.pi
        code = FOLD_OF_CYCLES if fold else PERIOD_DOUBLING
        u = good[:-1]
        if len(table) > 2:
            # the orbit is a smooth function of the square of the angle
            one, two = ((z[-1] if fold else np.pi - z[-1]) ** 2 for z in table[-3:-1])
            u = u + (good - table[-3])[:-1] * two / (one - two) if one > two else u
        other, wanted = replace(start, code=code, u=u), RESONANCE_1 if fold else RESONANCE_2
    else:
        merged = _merged(start, good[: start.events], end.segment)
        if merged is None:
            return None
        other, offset, function, wanted = merged
    near, z = _equations(other, plane)
    landing = curves.landed(near.system, z, near.frame)
    if landing is None:
        return None
    tests = near.tests(landing)
    if wanted:
        criterion = next(c for c in tests.criteria() if c.code == wanted)
    else:
        criterion = tests.touch(end.segment - 1, offset, function)
    unit = criterion.value(landing)[1] or 1.0
    found = solved_from(near.rows(landing, plane), landing, criterion, unit)
    gap = found.z[other.events - 2 : other.events] - good[start.events - 2 : start.events]
    apart = np.abs(gap / (plane.upper - plane.lower)).max()
    if not found.converged or apart > 2.0 * plane.continuation.max_step:
        return None
    return near, found


def _merged(start: Start, u: Array, gone: int) -> tuple[Start, float, int, str] | None:
    """The orbit without a segment that vanishes at a touch.

    Returns
    -------
    start : Start
    offset : float
        Of the touch in the segment before.
    function : int
    code : str
        DGR if the segment is between a touch and a crossing, else empty.
    """
    shooting, form = start.shooting, start.shooting.form
    segments, period = shooting.unpack(u)
    contact, K = start.contact, len(form)
    if start.touching and contact is not None and gone in (contact[0], contact[0] + 1):
        place, function, mode = contact
        before = gone == place
        if form.ends[place - 1 if before else gone] != function or (before and place == 0):
            return None
        segments, reference = _joined(segments, place), _joined(form, place)
        contact, code, offset = (place - before, function, mode), DEGENERATE_GRAZING, 0.0
    elif 0 < gone < K - 1 and form.modes[gone - 1] == form.modes[gone + 1]:
        function, code = int(form.ends[gone - 1]), ""
        offset = float(segments.durations[gone - 1] + 0.5 * segments.durations[gone])
        segments, reference = without_segment(segments, gone), without_segment(form, gone)
        if contact is not None:
            if contact[0] in (gone - 1, gone):
                return None
            contact = (contact[0] - 2 * (contact[0] > gone), *contact[1:])
    else:
        return None
    smaller = replace(shooting, form=reference)
    packed = np.append(smaller.pack(segments, period)[: smaller.size], u[-2:])
    return replace(start, shooting=smaller, u=packed, contact=contact), offset, function, code


def _joined(segments: Segments, k: int) -> Segments:
    """The segments with one of them joined with the next, of the same mode."""
    durations = segments.durations.copy()
    durations[k + 1] += durations[k]
    return Segments(
        segments.start,
        np.delete(segments.modes, k),
        np.delete(segments.ends, k),
        np.delete(segments.states, k + 1, axis=0),
        np.delete(durations, k),
    )


def _moved(start: Start, z: Array) -> Start | None:
    """The same point with the start of its orbit, and its phase condition, chosen anew."""
    N = start.shooting.size
    u, angle = z[: N + 2], float(z[-1]) if start.code == TORUS else np.nan
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
        rate = fields(shooting.variations, *first, p).f[0]
        size = np.maximum(start.sizes, sizes_of(segments.states, segments.states) * 1e-9)
        direction = rate / size**2 / np.linalg.norm(rate / size)
    moved = replace(shooting, form=segments, parameters=p, direction=direction)
    return replace(start, shooting=moved, u=moved.pack(segments, period), angle=angle)


def _where(plane: Plane, values: Array) -> str:
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(plane.names, values, strict=True))


def _lost(plane: Plane, values: Array) -> Outcome:
    return Outcome(
        "step too small", f"Newton's method did not converge near {_where(plane, values)}.", False
    )


def _ended(status: str, plane: Plane, values: Array) -> Outcome:
    where = _where(plane, values)
    if status == curves.RANGE:
        return Outcome("end of range", f"reached the end of the range at {where}.", True)
    if status == curves.SMALL_STEP:
        return _lost(plane, values)
    return Outcome(
        "too many points",
        f"the curve continues beyond {where}; increase Continuation(max_points=…) or max_step.",
        False,
    )
