"""The curve of periodic orbits over one parameter: its equations, units, and orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation import curves
from fastslow.continuation.settings import Continuation
from fastslow.orbits.find.correcting import (
    BlockCorrector,
    Corrected,
    ShootingCorrector,
    corrector_of,
)
from fastslow.orbits.flow.flows import fields, flow
from fastslow.orbits.flow.multipliers import Multipliers, multipliers_of_products
from fastslow.orbits.flow.problem import ORBIT_SOLVED, OrbitProblem
from fastslow.orbits.flow.segments import Segments
from fastslow.orbits.flow.shooting import (
    BlockInverse,
    Linearised,
    Shooting,
    ShootingSolution,
    sizes_beside_rest,
    sizes_of,
)
from fastslow.orbits.points.multiplier_signs import multipliers_at
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


#: Smallest tolerance of orbits with a completed chatter: the times of its last impacts, with the
#: speed v, are known to rounding divided by v.
CHATTER = 3e-8

#: Fractions of a step at which its states are sampled.
SAMPLES = np.linspace(0.0, 1.0, 9)


def states_along(run: Trajectory | OrbitArrays, n: int) -> Array:
    """The states of a run at several times of every step, shape (N, n)."""
    assert run.series is not None
    lengths = SAMPLES * run.steps[:, 1, None]
    powers = np.vander(lengths.reshape(-1), run.series.shape[2], increasing=True)
    states = powers.reshape(*lengths.shape, -1) @ run.series[:, :n].transpose(0, 2, 1)
    return np.asarray(states.reshape(-1, n))


@dataclass(frozen=True, eq=False)
class Row:
    """A row of a branch: the equations and unknowns of an orbit, with its special point.

    ``solved`` is given until the multipliers are computed, see `completed`. ``earlier`` are the
    equations and unknowns in which the orbit was computed, if its nodes or its start were changed
    for the following rows.
    """

    shooting: Shooting
    u: Array
    arrays: OrbitArrays
    slope: float
    point: SpecialOrbit | None = None
    solved: Corrected | None = None
    earlier: tuple[Shooting, Array] | None = None

    @cached_property
    def orbit(self) -> Orbit:
        return self.arrays.orbit()

    @property
    def value(self) -> float:
        return float(self.u[-1])

    @property
    def forms(self) -> tuple[Row, ...]:
        """The row in its equations, and in those in which it was computed."""
        if self.earlier is None:
            return (self,)
        shooting, u = self.earlier
        return self, replace(self, shooting=shooting, u=u, earlier=None)

    def continues(self, other: Row) -> bool:
        """Check whether the unknowns of another row have the same meaning."""
        one, two = self.shooting.form, other.shooting.form
        return one.start == two.start and self.is_alike(other)

    def is_alike(self, other: Row) -> bool:
        """Check whether another row has the same sequence of segments and events."""
        one, two = self.shooting.form, other.shooting.form
        return np.array_equal(one.modes, two.modes) and np.array_equal(one.ends, two.ends)

    @cached_property
    def extremes(self) -> Array:
        """Smallest and largest values of the states along the free run, shape (2, n)."""
        states = states_along(self.arrays, self.shooting.variations.n)
        return np.stack([states.min(axis=0), states.max(axis=0)])

    @cached_property
    def sizes(self) -> Array:
        """Units of the states: their ranges."""
        return sizes_of(self.extremes, self.extremes)

    @property
    def start(self) -> float:
        """Time of the first state of the unknowns; a free run may begin at another phase."""
        return 0.0 if self.shooting.forcing is not None else self.shooting.form.start

    @cached_property
    def halves(self) -> Array:
        """The states at the start and half a period later, shape (n, 2)."""
        return self.orbit(self.start + np.array([0.0, 0.5 * self.orbit.period]))

    @cached_property
    def range(self) -> float:
        """Largest range of a state along the orbit."""
        return float(np.ptp(self.extremes, axis=0).max())

    def mirrors(self, other: Row) -> bool:
        """Check whether the cycle begins half a turn apart from that of another row."""
        if len(self.u) != len(other.u):
            return False
        if not self._place @ other._place < 0:
            return False
        return bool(self._direction @ other._direction < 0)

    @property
    def _place(self) -> Array:
        """The first state beside the middle of the ranges, in their units."""
        n = self.shooting.variations.n
        return np.asarray((self.u[:n] - 0.5 * self.extremes.sum(axis=0)) / self.sizes)

    @cached_property
    def _direction(self) -> Array:
        """The rate at the first state."""
        return self.shooting.with_phase(self.u).direction


@dataclass(eq=False)
class CurveSystem(curves.ExtrapolatedSystem):
    """The equations of a branch for `curves`, with exact derivatives."""

    shooting: Shooting
    known: Linearised | None = None
    key: bytes = b""
    corrector: ShootingCorrector | BlockCorrector | None = None
    #: The last point that was solved for.
    point: Corrected | None = None

    def residual(self, z: Array, guide: Array) -> Array:
        if z.ndim > 1:
            return np.array([self.residual(one, guide) for one in z])
        return self._at(z, guide).residual

    def slopes(self, z: Array, guide: Array) -> Array:
        return self._at(z, guide).jacobian

    def null_vector(self, z: Array, scale: Array) -> Array | None:
        last = self._at(z, z)
        if last.blocks is None:
            return None
        inverse = BlockInverse.of(last, scale)
        return None if inverse is None else inverse.condensed.tangent()

    def solved(
        self, guess: Array, direction: Array, frame: curves.Frame, continuation: Continuation
    ) -> tuple[Array, int, Array] | None:
        return self.solved_from(guess, guess, direction, frame, continuation)

    def solved_from(
        self,
        start: Array,
        guess: Array,
        direction: Array,
        frame: curves.Frame,
        continuation: Continuation,
    ) -> tuple[Array, int, Array] | None:
        if self.corrector is None:
            least = CHATTER if self.shooting.chatters else 0.0
            limits = max(continuation.tolerance, least), continuation.max_iterations
            self.corrector = corrector_of(self.shooting, frame.scale, *limits)
        self.point = self.corrector(guess, direction, start)
        return None if self.point is None else self.point[:3]

    def _at(self, z: Array, guide: Array) -> Linearised:
        key = z.tobytes() + guide.tobytes()
        if self.known is None or key != self.key:
            self.known, self.key = self.shooting.with_phase(guide).linearised(z), key
        return self.known


@dataclass(frozen=True, eq=False)
class OrbitCurve:
    """Periodic orbits over a range of one parameter.

    Parameters
    ----------
    problem : OrbitProblem
        With the parameter chosen.
    name : str
    over : (float, float)
    template : Orbit
        One of them.
    """

    problem: OrbitProblem
    name: str
    over: tuple[float, float]
    template: Orbit

    def frame(self, shooting: Shooting, u: Array, run: Trajectory | OrbitArrays) -> curves.Frame:
        """Units of the unknowns: a step is a change of the orbit, averaged over segments.

        Parameters
        ----------
        shooting : Shooting
        u : ndarray
        run : Trajectory or OrbitArrays
            One period of an orbit nearby, for the ranges of the states.
        """
        segments, period = shooting.unpack(u)
        K, size = len(segments), shooting.size + 1
        n = shooting.variations.n
        scale = np.append(shooting.scales(segments, period), self.over[1] - self.over[0])
        along = states_along(run, n)
        scale[: K * n] = np.tile(sizes_beside_rest(along, shooting.changes_by_rates(u)), K)
        scale[: shooting.size] *= np.sqrt(K)
        lower, upper = np.full(size, -np.inf), np.full(size, np.inf)
        lower[-1], upper[-1] = self.over
        return curves.Frame(size, scale, lower, upper)

    def row(
        self, shooting: Shooting, u: Array, orbit: Orbit, slope: float, point: SpecialOrbit | None
    ) -> Row:
        """Return the row of an orbit."""
        arrays = OrbitArrays.of(orbit, self.template, self.name)
        return Row(shooting, u, arrays, slope, point)

    def confirmed(self, shooting: Shooting, solved: Corrected) -> Row | None:
        """Return the row of a solved point, None if a free run does not confirm it.

        Its slope and multipliers are not known.
        """
        if max(solved.residual, solved.accuracy) > ORBIT_SOLVED or solved.slowest <= 0:
            return None
        segments, period = shooting.unpack(solved.u)
        if (segments.durations <= 0).any():
            return None
        value = float(solved.u[-1])
        run = self.problem.confirmed(segments, period, {self.name: value})
        if run is None:
            return None
        multipliers, logs = _unknown(shooting.variations.n)
        arrays = OrbitArrays(
            template=self.template,
            parameter=self.name,
            value=value,
            period=period,
            multipliers=multipliers,
            log_multipliers=logs,
            trivial=None,
            errors=(solved.defect, solved.residual, solved.accuracy),
            span=(segments.start, float(run.place[0])),
            end=run.place[: 1 + shooting.variations.n],
            steps=run.steps,
            series=run.series,
            crossing_table=run.crossings,
            reset_table=run.resets,
        )
        return Row(shooting, solved.u, arrays, np.nan, solved=solved)

    def orbit(self, shooting: Shooting, u: Array, *, confirm: bool = True) -> Orbit:
        """Return the orbit of unknowns, with its multipliers, confirmed by a free run."""
        segments, period = shooting.unpack(u)
        here = self.problem.at(shooting.parameters_at(u))
        last = shooting.with_phase(u).linearised(u)
        solution = ShootingSolution(u, last, *_accuracy(shooting, last, segments, period))
        return here.orbit(segments, period, solution, confirm=confirm)


def _accuracy(
    shooting: Shooting, last: Linearised, segments: Segments, period: float
) -> tuple[float, float]:
    """Largest residual relative to its row, and correction in units of the scales."""
    N, scale = shooting.size, shooting.scales(segments, period)
    if last.blocks is not None:
        inverse = BlockInverse.of(last, np.append(scale, 1.0))
        if inverse is None:
            return np.inf, np.inf
        return inverse.residual(last.residual), float(np.abs(inverse.step(last.residual)).max())
    matrix = last.jacobian[:, :N] * scale
    rows = np.abs(matrix).max(axis=1)
    step = np.linalg.lstsq(
        np.column_stack([matrix, last.jacobian[:, N]]) / rows[:, None],
        -last.residual / rows,
        rcond=None,
    )[0]
    return float(np.abs(last.residual / rows).max()), float(np.abs(step).max())


@cache
def _unknown(n: int) -> tuple[NDArray[np.complex128], Array]:
    """Multipliers that are not known, and their logarithms."""
    return np.full(n, np.nan, dtype=complex), np.full(n, np.nan)


def completed(rows: Sequence[Row], slopes: Sequence[float]) -> list[Row]:
    """Rows of points solved with the same equations, with their slopes and multipliers."""
    if not rows:
        return []
    shooting = rows[0].shooting
    found: list[Multipliers | None] = [None] * len(rows)
    if shooting.forcing is not None and not shooting.slides:
        points = [row.solved for row in rows if row.solved is not None]
        if all(point.product is not None for point in points):
            columns = ("product", "scale", "liouville", "defect")
            tables = (np.array([getattr(point, name) for point in points]) for name in columns)
            found = multipliers_of_products(*tables)
    complete = []
    for row, slope, known in zip(rows, slopes, found, strict=True):
        if known is None:
            last = None if row.solved is None else row.solved.last
            if last is None:
                last = row.shooting.with_phase(row.u).linearised(row.u)
            known = multipliers_at(row.shooting, row.u, last)
        arrays = row.arrays._replace(
            multipliers=known.values,
            log_multipliers=known.logs,
            trivial=known.trivial,
            errors=(known.defect, *row.arrays.errors[1:]),
        )
        complete.append(Row(row.shooting, row.u, arrays, slope))
    return complete


#: Equations, unknowns and tangent of an orbit.
Beginning = tuple[Shooting, Array, Array]


def same_direction(known: Beginning, other: Beginning) -> Array:
    """Return the tangent of an orbit in the direction of that of the same orbit.

    Both have the same events, begun at another one of them or at another time, and other nodes.
    A perturbation along the orbit is a shift of the phase alone, and where the flow contracts
    that of a branch is smaller than rounding: perturbations across the orbit are compared, along
    all of it.
    """
    begin = known[0].form.start
    period = known[0].unpack(known[1])[1]
    edges = np.concatenate(
        [(one[0].unpack(one[1])[0].times[:-1] - begin) % period for one in (known, other)]
    )
    edges = np.append(np.sort(edges), period)
    middle = begin + 0.5 * (edges[:-1] + edges[1:])
    one, two = (_across(*each, middle) for each in (known, other))
    lengths, values = zip(*(each[2][each[0].size - 1 :] for each in (known, other)), strict=True)
    agreement = (one * two).sum() + np.prod(lengths) / period**2 + np.prod(values)
    return other[2] if agreement >= 0 else -other[2]


def _across(shooting: Shooting, u: Array, along: Array, times: Array) -> Array:
    """Derivatives of the states along a tangent at times, without what is along the orbit.

    In units of the states, shape (len(times), n).
    """
    variations, n, K = shooting.variations, shooting.variations.n, len(shooting.form)
    segments, period = shooting.unpack(u)
    at, start = shooting.parameters_at(u), segments.times[:-1]
    since = segments.start + (times - segments.start) % period
    rows = np.clip(np.searchsorted(start, since, side="right") - 1, 0, None)
    modes, constants = segments.modes[rows], segments.constants[rows]
    here = segments.states[rows], start[rows], since - start[rows]
    flows = flow(variations, modes, *here, at, constants)
    later = np.append(0.0, np.cumsum(along[K * n : K * (n + 1) - 1]))
    changes = np.column_stack([along[: K * n].reshape(K, n), later])[rows]
    changes = np.column_stack([changes, np.tile(along[shooting.size :], (len(rows), 1))])
    moved = (flows.slopes @ changes[:, :, None])[:, :, 0]
    size = shooting.scales(segments, period)[:n]
    rates = fields(variations, modes, flows.ends, since, at, constants).f / size
    length = np.maximum(np.linalg.norm(rates, axis=1, keepdims=True), np.finfo(float).tiny)
    rates, moved = rates / length, moved / size
    return np.asarray(moved - (moved * rates).sum(axis=1, keepdims=True) * rates)
