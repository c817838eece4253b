"""Multiple shooting: the equations of a periodic orbit on a prescribed itinerary.

The unknowns are the first states and the durations of the segments, the period T, and on a
branch the parameter. The equations are, for each segment, that its end is the first state of
the next one (periodic states up to whole periods), and the condition at its end: an interface
function or a bound of sliding vanishes, the durations beside a node keep their ratio, or the
durations add up to T. In addition T is a multiple of the forcing's period, or without forcing
the start satisfies the phase condition f(z*)·(z - z*) = 0 with a reference state z*.

The rates of a region are continued beyond its borders, so that the equations are smooth where
an orbit grazes an interface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.records import zeros
from fastslow.orbits.flow.blocks import BLOCKS_FROM, Blocks, assembled
from fastslow.orbits.flow.condensed import NULL, Condensed
from fastslow.orbits.flow.equations import LINEARISE, Linear, ShootingEquations
from fastslow.orbits.flow.events import OrbitError
from fastslow.orbits.flow.flows import (
    NO_NEWTON,
    Fields,
    Flows,
    completed,
    fields,
    flows_of,
    problem_of,
    segments_for,
)
from fastslow.orbits.flow.forcing import Forcing
from fastslow.orbits.flow.segments import Segments
from fastslow.orbits.flow.stepping import Factors, FlowSegments
from fastslow.orbits.flow.variations import Variations
from fastslow.results.base.outcome import Outcome

Array = NDArray[np.float64]

#: Largest number of Newton steps for a single orbit.
ORBIT_NEWTON_STEPS = 40

#: Largest change in one Newton step, in units of the scales; longer steps are shortened.
LONGEST_NEWTON_STEP = 0.3

#: Smallest fraction of a Newton step.
SHORTEST_FRACTION = 1e-3

#: Newton step below which the iteration ends where steps cease to decrease.
STALLED_NEWTON_STEP = 1e-8

#: Residual to rounding. Corrections that do not decrease there are the accuracy of the orbit: in
#: a canard explosion the parameter hardly determines it.
EXACT = 1e-13

_LINEARISED = NO_NEWTON._replace(iterations=LINEARISE)

#: Size of a state, as a fraction of the terms of its rate times the period, that is rounding.
AT_REST = 1e-14

#: What is left of a state by a projection, as a fraction of it, that is rounding.
REMOVED = 1e-14


@dataclass(frozen=True, eq=False)
class Linearised:
    """Residual and Jacobian of the equations, with the flow and the fields they are made of.

    Of many unknowns there are blocks, and the Jacobian as one matrix only if it is asked for.
    """

    residual: Array
    matrix: Array | None
    flows: Flows
    fields: Fields
    blocks: Blocks | None = None

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the residual, shape (N, N + P)."""
        if self.matrix is not None:
            return self.matrix
        assert self.blocks is not None
        return self.blocks.dense()


@dataclass(frozen=True, eq=False)
class Shooting:
    """The equations of periodic orbits with the same sequence of segments.

    Parameters
    ----------
    variations : Variations
        With at most one chosen parameter, the last unknown.
    parameters : ndarray
        Parameter values in the order of the variations.
    form : Segments
        Start time, modes and ends; its first state and rate define the phase condition.
    forcing : Forcing or None
        None for autonomous models.
    multiple : int
        Number of periods of the forcing.
    winding : ndarray, shape (n,)
        What the periodic states gain in one period.
    direction : ndarray, shape (n,)
        The rate at the reference state, a unit vector in units of the scales; used without
        forcing.
    ranges : ndarray, shape (n,), optional
        Units of the states, by default the ranges of the first states of the segments, which are
        too few if there are few events and nodes.
    """

    variations: Variations
    parameters: Array
    form: Segments
    forcing: Forcing | None
    multiple: int
    winding: Array
    direction: Array
    ranges: Array | None = None

    @property
    def size(self) -> int:
        """Number of equations, and of unknowns without the parameter."""
        return len(self.form) * (self.variations.n + 1) + 1

    def pack(self, segments: Segments, period: float) -> Array:
        """Unknowns of a closed curve, with the parameter if there is one."""
        chosen = self.parameters[self.variations.places]
        return np.concatenate([segments.states.reshape(-1), segments.durations, [period], chosen])

    def unpack(self, u: Array) -> tuple[Segments, float]:
        """Closed curve and period of unknowns."""
        K, n = len(self.form), self.variations.n
        states, durations = u[: K * n].reshape(K, n), u[K * n : K * (n + 1)]
        form = self.form
        segments = replace(form, states=states, durations=durations)
        return segments, float(u[K * (n + 1)])

    def parameters_at(self, u: Array) -> Array:
        """Parameter array of unknowns."""
        values = self.parameters.copy()
        values[self.variations.places] = u[self.size :]
        return values

    def linearised(self, u: Array) -> Linearised:
        """Residual and Jacobian at unknowns."""
        if self.size >= BLOCKS_FROM:
            curve, period = self.unpack(u)
            known = self.equations, curve, period, self.parameters_at(u), self.forcing
            residual, blocks, flows, rates = assembled(self.variations, *known)
            return Linearised(residual, None, flows, rates, blocks)
        problem = problem_of(self.variations, self.parameters)
        form, linear = self.form, self.linear_at(u)
        segments = segments_for(self.variations, form.modes, form.constants)
        _, factors = completed(problem, self.equations, segments, linear, _LINEARISED)
        return self.linearisation(linear, segments, factors)

    def linearisation(self, linear: Linear, segments: FlowSegments, factors: Factors) -> Linearised:
        """What the compiled loop computed, in arrays of its own."""
        known = Fields.of(linear.known.copy(), self.variations)
        flows = flows_of(segments, factors)
        return Linearised(linear.residual.copy(), linear.jacobian.copy(), flows, known)

    def linear_at(self, u: Array) -> Linear:
        """Space for the equations at unknowns."""
        K, N, width = len(self.form), self.size, self.variations.field.size
        n, unknowns = self.variations.n, self.variations.n_unknowns
        after = n + n * unknowns, (n, unknowns), (n, unknowns)
        space = zeros(Linear, 0, N, (N, len(u)), (K, width), unknowns, width, *after)
        return space._replace(u=np.array(u, dtype=float))

    @cached_property
    def equations(self) -> ShootingEquations:
        """The equations as arguments of the compiled loop."""
        variations, forcing = self.variations, self.forcing
        held, across_held = self._held
        jumps = np.zeros(variations.field.m, dtype=np.int64)
        jumps[: len(variations.jumping)] = variations.jumping
        return ShootingEquations(
            field=variations.field.address,
            resets=variations.resets.address,
            period=0 if forcing is None else forcing.compiled.address,
            multiple=float(self.multiple),
            start=float(self.form.start),
            ends=np.array(self.form.ends, dtype=np.int64),
            numbers=np.array(self.form.jumps, dtype=np.int64),
            jumps=jumps,
            places=np.array(variations.places, dtype=np.int64),
            winding=np.array(self.winding, dtype=float),
            reference=self.form.states[0].copy(),
            direction=np.array(self.direction, dtype=float),
            durations=np.array(self.form.durations, dtype=float),
            held=held,
            across=across_held,
        )

    @property
    def _held(self) -> tuple[NDArray[np.int64], Array]:
        """Interfaces along which the orbit slides all the time, and directions across them."""
        held = self.variations.held_along(self.form.modes)
        if not len(held):
            return held, np.zeros((self.variations.n, 0))
        normals, _ = self._interfaces(self.form, 0, held, self.parameters)
        return held, across(normals, self._sizes(self.form))

    def on_interfaces(self, u: Array) -> Array:
        """Unknowns with the states exactly on the interfaces along which the orbit slides.

        Newton's method leaves rounding across them, which is no unit of a state that is zero there.
        """
        on = self._slides | (np.roll(self._slides, 1, axis=0) & (self.form.jumps < 0)[:, None])
        if not on.any():
            return u
        moved, n = u.copy(), self.variations.n
        segments, parameters = self.unpack(u)[0], self.parameters_at(u)
        for row in np.flatnonzero(on.any(axis=1)).tolist():
            known = self._interfaces(segments, row, np.flatnonzero(on[row]), parameters)
            k = slice(row * n, (row + 1) * n)
            moved[k] = projected(u[k], *known, self._sizes(segments))
        return moved

    @cached_property
    def _slides(self) -> NDArray[np.bool_]:
        """Whether each segment slides along each interface."""
        variations = self.variations
        return np.asarray(variations.signs[self.form.modes, : variations.interfaces] == 0)

    def _interfaces(
        self, segments: Segments, row: int, interfaces: NDArray[np.int64], parameters: Array
    ) -> tuple[Array, Array]:
        """Gradients and values of interface functions at the first state of a segment."""
        k, n = slice(row, row + 1), self.variations.n
        here = segments.modes[k], segments.states[k], segments.times[k], parameters
        known = fields(self.variations, *here, segments.constants[k])
        return known.g_u[0, interfaces, :n], known.g[0, interfaces]

    def _sizes(self, segments: Segments) -> Array:
        """Units of the states."""
        states = segments.states
        return sizes_of(states, states) if self.ranges is None else self.ranges

    def with_phase(self, guide: Array) -> Shooting:
        """The equations with the phase condition of a reference orbit."""
        if self.forcing is not None:
            return self
        segments, _ = self.unpack(guide)
        first = segments.modes[:1], segments.states[:1], np.zeros(1)
        at = self.parameters_at(guide), segments.constants[:1]
        rate = fields(self.variations, *first, *at).f[0]
        size = self._sizes(segments)
        speed = np.linalg.norm(rate / size)
        if speed == 0.0:
            raise OrbitError(Outcome("equilibrium", "the orbit starts at an equilibrium.", False))
        direction = rate / size**2 / speed
        return replace(self, form=segments, direction=direction)

    @cached_property
    def slides(self) -> bool:
        """Whether the orbit slides or rests in a segment."""
        return bool(self.variations.deficiency[self.form.modes].any())

    @property
    def chatters(self) -> bool:
        """Whether a rest on a wall begins with an impact."""
        lost = self.variations.deficiency[self.form.modes]
        return bool(((self.form.jumps >= 0) & (np.roll(lost, -1) > lost)).any())

    def slowest(self, known: Fields) -> float:
        """Smallest speed into a wall or a threshold of a switch, infinite without one."""
        return float(approach_speeds(self.form, known, self.variations).min(initial=np.inf))

    def changes_by_rates(self, u: Array) -> Array:
        """Changes of the states in one period by the terms of their rates, at unknowns."""
        (segments, period), variations = self.unpack(u), self.variations
        here = segments.modes, segments.states, segments.times[:-1], self.parameters_at(u)
        return changes_by_rates(variations, *here, segments.constants, period)

    def ranges_at(self, u: Array) -> Array:
        """Ranges of the states at unknowns; of those at rest see `sizes_beside_rest`."""
        return sizes_beside_rest(self.unpack(u)[0].states, self.changes_by_rates(u))

    def scales(self, segments: Segments, period: float) -> Array:
        """Unit of every unknown except the parameter: ranges of the states, and the period."""
        reach = self.ranges
        if reach is None:
            reach = sizes_of(segments.states, np.vstack([segments.states, self.form.states]))
        K = len(self.form)
        return np.concatenate([np.tile(reach, K), np.full(K + 1, period)])


def hits_of(form: Segments, variations: Variations) -> NDArray[np.int64]:
    """Segments that end at a reset at a wall, a threshold of a switch, or an event."""
    resets = (form.jumps >= 0) & (form.ends < variations.first_instant)
    last = len(variations.continuous)
    changes = (form.ends >= variations.first_switch) & (form.ends < last)
    return np.flatnonzero(resets | changes)


def approach_speeds(form: Segments, known: Fields, variations: Variations) -> Array:
    """Speeds into walls, thresholds and conditions, from the fields at the ends of segments."""
    hits = hits_of(form, variations)
    slopes, n = known.g_u[hits, form.ends[hits]], variations.n
    return np.asarray((slopes[:, :n] * known.f[hits]).sum(axis=1) + slopes[:, n])


def projected(state: Array, normals: Array, heights: Array, units: Array) -> Array:
    """Return a state moved onto interfaces, with exact zeros for states that are zero there."""
    moved = state - across(normals, units) @ heights
    return np.where(np.abs(moved) <= REMOVED * np.abs(state), 0.0, moved)


def across(normals: Array, units: Array) -> Array:
    """Directions across interfaces, normal to them in units of the states, shape (n, C)."""
    scaled = normals * units
    return np.asarray(units[:, None] * np.linalg.pinv(scaled))


def sizes_of(states: Array, more: Array) -> Array:
    """Range of every state; for a constant one its size, or 1."""
    reach, size = np.ptp(more, axis=0), np.abs(states).max(axis=0)
    return np.where(reach > 1e-9 * size, reach, np.where(size > 0, size, 1.0))


def changes_by_rates(
    variations: Variations,
    modes: NDArray[np.int64],
    states: Array,
    times: Array,
    parameters: Array,
    constants: Array,
    period: float,
) -> Array:
    """Changes of the states in one period by the terms of their rates, if these did not cancel."""
    slopes = fields(variations, modes, states, times, parameters, constants).f_u
    terms = np.abs(slopes[:, :, : variations.n]) @ np.abs(states)[:, :, None]
    return np.asarray(period * terms[:, :, 0].max(axis=0))


def at_rest(states: Array, moved: Array) -> NDArray[np.bool_]:
    """Whether each state is zero to rounding, but not exactly.

    A single state says nothing: it may be at a zero of an oscillation.
    """
    reach, largest = np.ptp(states, axis=0), np.abs(states).max(axis=0)
    return np.asarray((reach > 0.0) & (largest <= AT_REST * moved))


def sizes_beside_rest(states: Array, moved: Array) -> Array:
    """Range of every state; of one at rest what the terms of its rate would change it by.

    The range of rounding is no unit, in which perturbations would grow beyond all bounds.
    """
    return np.where(at_rest(states, moved), moved, sizes_of(states, states))


class ShootingSolution(NamedTuple):
    """A solved orbit: unknowns, the last linearisation, and the accuracy reached."""

    u: Array
    last: Linearised
    residual: float
    accuracy: float
    isolated: bool = True


@np.errstate(all="ignore")
def solved(shooting: Shooting, guess: Array, scale: Array) -> ShootingSolution:
    """Solve for an orbit at fixed parameters by damped Newton iteration.

    A step is accepted if the simplified Newton correction at its end is shorter (natural
    monotonicity test, Deuflhard 2004).

    Parameters
    ----------
    shooting : Shooting
    guess : ndarray
    scale : ndarray, shape (N,)
        Units of the unknowns without the parameter.

    Raises
    ------
    OrbitError
        Without convergence.
    """
    u, N = guess.copy(), shooting.size
    last = shooting.linearised(u)
    before, damping = np.inf, 1.0
    for _ in range(ORBIT_NEWTON_STEPS):
        inverse = _inverse_of(last, N, scale)
        if inverse is None:
            raise OrbitError(
                Outcome(
                    "singular equations",
                    "the equations of the orbit are not finite at the guess, or became singular in "
                    "Newton's method; give a guess nearer to an orbit.",
                    False,
                )
            )
        step = inverse.step(last.residual)
        size = float(np.abs(step).max())
        if size <= STALLED_NEWTON_STEP and (size >= 0.25 * before or size <= 1e-15):
            u = shooting.on_interfaces(u)
            return ShootingSolution(
                u, last, inverse.residual(last.residual), size, inverse.is_isolated
            )
        damping = min(1.0, 2.0 * damping, LONGEST_NEWTON_STEP / size)
        while True:
            trial = u.copy()
            trial[:N] += damping * step * scale
            following = shooting.linearised(trial)
            after = float(np.abs(inverse.step(following.residual)).max())
            if after <= (1.0 - 0.25 * damping) * size or after <= STALLED_NEWTON_STEP:
                break
            damping *= 0.5
            if damping < SHORTEST_FRACTION:
                residual = inverse.residual(last.residual)
                if residual <= EXACT:
                    return ShootingSolution(u, last, residual, size, inverse.is_isolated)
                raise OrbitError(
                    Outcome(
                        "Newton's method did not converge",
                        f"Newton's method did not converge: corrections of {size:.2g} of the range "
                        "of the orbit do not decrease. Give a guess nearer to an orbit.",
                        False,
                    )
                )
        u, last, before = trial, following, size
    raise OrbitError(
        Outcome(
            "Newton's method did not converge",
            f"Newton's method did not converge within {ORBIT_NEWTON_STEPS} steps; the last one "
            f"changed the orbit by {size:.2g} of its range. Give a guess nearer to an orbit.",
            False,
        )
    )


def _inverse_of(last: Linearised, N: int, scale: Array) -> _Inverse | BlockInverse | None:
    """What solves the linearised equations; None if they are not finite."""
    if last.blocks is None:
        return _Inverse.of(last, N, scale)
    parameters = np.ones(last.blocks.sizes[2])
    return BlockInverse.of(last, np.append(scale, parameters), fixed=True)


class BlockInverse(NamedTuple):
    """Condensed blocks in units of the unknowns, and the sizes of their rows."""

    condensed: Condensed
    rows: Array

    @classmethod
    def of(cls, last: Linearised, scale: Array, *, fixed: bool = False) -> BlockInverse | None:
        """Condense the equations, at fixed parameters or not.

        None if they are not finite, or a segment cannot be eliminated.
        """
        assert last.blocks is not None
        blocks = last.blocks.scaled(scale)
        blocks = blocks.without_parameters() if fixed else blocks
        rows, end = blocks.row_sizes()
        sizes = blocks.in_order(rows, end)
        if not (np.isfinite(last.residual).all() and np.isfinite(sizes).all() and sizes.all()):
            return None
        condensed = Condensed(blocks.over(rows, end))
        return cls(condensed, sizes) if condensed.is_regular else None

    @property
    def is_isolated(self) -> bool:
        """Whether the equations are independent."""
        return self.condensed.is_isolated

    def step(self, residual: Array) -> Array:
        """The Newton step."""
        return self.condensed.step(residual / self.rows)

    def step_in_plane(self, residual: Array, normal: Array, height: float) -> tuple[Array, Array]:
        """The Newton step with a given component along a normal, and the unit tangent along it."""
        along = self.condensed.tangent()
        along /= np.linalg.norm(along)
        along = along if along @ normal >= 0.0 else -along
        step = self.step(residual)
        with np.errstate(divide="ignore", invalid="ignore"):
            return step + (height - step @ normal) / (along @ normal) * along, along

    def residual(self, residual: Array) -> float:
        """Largest residual relative to its row."""
        return float(np.abs(residual / self.rows).max())


class _Inverse(NamedTuple):
    """Singular value decomposition of a Jacobian in units of the unknowns and of its rows."""

    left: Array
    sizes: Array
    right: Array
    rows: Array
    rank: int

    @classmethod
    def of(cls, last: Linearised, N: int, scale: Array) -> _Inverse | None:
        matrix = last.jacobian[:, :N] * scale
        rows = np.abs(matrix).max(axis=1)
        if not (np.isfinite(matrix).all() and np.isfinite(last.residual).all() and rows.all()):
            return None
        left, sizes, right = np.linalg.svd(matrix / rows[:, None])
        return cls(left, sizes, right, rows, int((sizes > NULL * sizes[0]).sum()))

    @property
    def is_isolated(self) -> bool:
        """Whether the equations are independent."""
        return self.rank == len(self.sizes)

    def step(self, residual: Array) -> Array:
        """The Newton step of least length: a family of orbits has null vectors."""
        r = self.rank
        return self.right[:r].T @ (self.left[:, :r].T @ (-residual / self.rows) / self.sizes[:r])

    def residual(self, residual: Array) -> float:
        """Largest residual relative to its row."""
        return float(np.abs(residual / self.rows).max())
