"""Curves of special points of periodic orbits in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.diagrams.curves.point_curves import Plane
from fastslow.errors import ArgumentError
from fastslow.orbits.contacts import ContactEquations, near_touches
from fastslow.orbits.detection import multipliers_at
from fastslow.orbits.flows import fields
from fastslow.orbits.forcing import forcing_of
from fastslow.orbits.problem import OrbitProblem
from fastslow.orbits.segments import MARGIN, OrbitError, restarted
from fastslow.orbits.shooting import Shooting, sizes_of
from fastslow.orbits.special_points import Extended, multiplier_system, torus_system
from fastslow.orbits.variations import variations_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.point_branch import PointBranch
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.point_types import FOLD_OF_CYCLES, PERIOD_DOUBLING, TORUS
from fastslow.results.points import SpecialPoints

Array = NDArray[np.float64]

#: Rows after which the equations of an autonomous model get a new phase condition.
STRETCH = 20

#: Samples of an orbit for the ranges of its states.
SAMPLES = 400

#: Distance beyond an interface, as a fraction of the range of its function, that is rounding.
BEYOND = 1e-7


@dataclass(frozen=True, eq=False)
class Start:
    """A special point of an orbit in the equations of two chosen parameters.

    Parameters
    ----------
    code : str
    shooting : Shooting
        With both parameters of the plane chosen.
    u : ndarray, shape (N + 2,)
    sizes : ndarray, shape (n,)
        Range of every state along the orbit.
    angle : float
        Of the multipliers of TR.
    contact : (int, int, int), optional
        Segment, function and mode of a contact with an interface.
    """

    code: str
    shooting: Shooting
    u: Array
    sizes: Array
    angle: float = np.nan
    contact: tuple[int, int, int] | None = None


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
    """

    problem: OrbitProblem
    shooting: Shooting
    u: Array
    place: tuple[int, int, int] | None = None

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
        sizes = np.ptp(run(np.linspace(*run.span, SAMPLES))[: variations.n], axis=1)
        sizes = np.where(sizes > 0, sizes, 1.0)
        start = Start(point.code, both, u, sizes, point.angle, self.place)
        return traced(start, plane, " → ".join(point.orbit.itinerary), model.equations)


@dataclass(eq=False)
class _System(curves.ExactSystem):
    """Extended equations in their own units, as a system of `curves`."""

    extended: Callable[[Array], Extended]
    scale: Array
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
            values, jacobian, _ = self.extended(z)
            self.known, self.key = (values, jacobian / self.scale), z.tobytes()
        return self.known


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of one direction of a curve."""

    states: list[Array]
    values: list[Array]
    tangents: list[Array]
    multipliers: list[NDArray[np.complex128]]
    outcome: Outcome
    closed: bool = False


def traced(start: Start, plane: Plane, region: str = "", equations: str = "") -> PointBranch:
    """Trace the curve of special points of orbits through one of them.

    Parameters
    ----------
    start : Start
    plane : Plane
        Both parameters, their ranges and the settings.
    region, equations : str
        The itinerary, and the model as text.

    Returns
    -------
    PointBranch
        Its states are those at the contact, else at the start of the orbit, which is moved away
        from events where necessary; its eigenvalues are the Floquet multipliers.
    """
    forwards = _direction(start, plane, 1.0)
    rows = forwards
    first = forwards.outcome
    if not forwards.closed:
        backwards = _direction(start, plane, -1.0)
        first = backwards.outcome
        rows = _Rows(
            backwards.states[:0:-1] + forwards.states,
            backwards.values[:0:-1] + forwards.values,
            [-along for along in backwards.tangents[:0:-1]] + forwards.tangents,
            backwards.multipliers[:0:-1] + forwards.multipliers,
            forwards.outcome,
        )
    variations, count = start.shooting.variations, len(rows.states)
    named = zip(variations.parameters, start.shooting.parameters.tolist(), strict=True)
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
        SpecialPoints([]),
        (),
        (first, rows.outcome),
        forwards.closed,
        {n: v for n, v in named if n not in plane.names},
        equations,
        asdict(plane.continuation),
    )


def _direction(start: Start, plane: Plane, sign: float) -> _Rows:
    """Trace a curve in one direction, in stretches with the same equations."""
    rows = _Rows([], [], [], [], Outcome("end of range", "", True))
    along: Array | None = None
    while True:
        system, frame, z = _equations(start, plane)
        landing = curves.landed(system, z, frame)
        if landing is None:
            return replace(rows, outcome=_lost(plane, start.u[-2:]))
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
        why: list[Outcome | None] = []

        def stop(z: Array, start: Start = start, why: list[Outcome | None] = why) -> bool:
            found = _stopped(start, z[: start.shooting.size + 2], plane)
            if isinstance(found, bool):
                return False
            why.append(found)
            return True

        table, tangents, status = curves.follow(system, landing, direction, frame, settings, stop)
        keep = slice(1 if rows.states else 0, len(table) - (bool(why) and why[0] is not None))
        for z, tangent in zip(table[keep], tangents[keep], strict=True):
            _add(rows, start, z[: N + 2], tangent)
        if why and why[0] is not None:
            return replace(rows, outcome=why[0])
        if status == curves.CLOSED:
            where = Outcome("closed loop", "the curve returned to its start: a closed loop.", True)
            return replace(rows, outcome=where, closed=True)
        if status in (curves.RANGE, curves.SMALL_STEP) or left <= STRETCH:
            return replace(rows, outcome=_ended(status, plane, table[-1][N : N + 2]))
        along = tangents[-1][N : N + 2] / frame.scale[N : N + 2]
        moved = _moved(start, table[-1])
        if moved is None:
            return replace(rows, outcome=_lost(plane, table[-1][N : N + 2]))
        start = moved


def _equations(start: Start, plane: Plane) -> tuple[_System, curves.Frame, Array]:
    """The extended equations with their frame and the first point."""
    shooting, u = start.shooting, start.u
    segments, period = shooting.unpack(u)
    K, N = len(segments), shooting.size
    spans = plane.upper - plane.lower
    scale = np.concatenate([np.tile(start.sizes, K), np.full(K + 1, period), spans])
    extended: Callable[[Array], Extended]
    if start.contact is not None:
        extended = ContactEquations(shooting, scale, *start.contact)
    elif start.code == TORUS:
        extended = torus_system(shooting, scale)
    else:
        multiplier = {FOLD_OF_CYCLES: 1.0, PERIOD_DOUBLING: -1.0}[start.code]
        extended = multiplier_system(shooting, scale, multiplier)
    z = np.append(u, start.angle) if start.code == TORUS else u
    units = np.append(scale, 1.0) if start.code == TORUS else scale
    # the length of a step does not depend on the number of segments
    lengths = units.copy()
    lengths[:N] *= np.sqrt(K)
    lower, upper = np.full(N + 2, -np.inf), np.full(N + 2, np.inf)
    lower[-2:], upper[-2:] = plane.lower, plane.upper
    return _System(extended, units), curves.Frame(N + 2, lengths, lower, upper), z


def _stopped(start: Start, u: Array, plane: Plane) -> Outcome | bool | None:
    """Outcome where a curve ends after a row; None to begin anew, False to go on."""
    segments, _ = start.shooting.unpack(u)
    where = ", ".join(f"{n} = {v:.6g}" for n, v in zip(plane.names, u[-2:], strict=True))
    inner = segments.durations[1:-1] if len(segments) > 2 else np.ones(1)
    # the segments at the start are two parts of one
    whole = segments.durations[0] + segments.durations[-1] if len(segments) > 1 else 1.0
    if min(inner.min(), whole) <= 0:
        return Outcome(
            "contact of the orbit",
            f"a segment of the orbit vanishes near {where}: it touches an interface there.",
            True,
        )
    touches = [one for one in near_touches(start.shooting, u) if one.clearance < -BEYOND]
    if touches:
        return Outcome(
            "contact of the orbit",
            f"the orbit touches an interface near {where}; beyond it the itinerary is another.",
            True,
        )
    near = min(segments.durations[0], segments.durations[-1]) < MARGIN * segments.period
    if len(segments) > 1 and near and start.contact is None:
        return None
    return False


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


def _add(rows: _Rows, start: Start, u: Array, tangent: Array) -> None:
    shooting = start.shooting
    n, N = shooting.variations.n, shooting.size
    place = np.arange(n)
    if start.contact is not None:
        place = ContactEquations(shooting, np.ones(len(u)), *start.contact).following
    rows.states.append(u[place].copy())
    rows.values.append(u[N : N + 2].copy())
    part = np.append(tangent[place], tangent[N : N + 2])
    rows.tangents.append(part / max(float(np.linalg.norm(part)), 1e-300))
    rows.multipliers.append(multipliers_at(shooting, u, shooting.linearised(u)).values)


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
