"""The slowest point of a cycle, and the equilibrium or pseudo-equilibrium near it.

On the interfaces on which a motion slides its rates f are tangential, so that the Jacobian f_x is
singular: the pseudo-equilibrium satisfies f = 0 and h = 0, and its eigenvalues are those of f_x in
the tangent space.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.find.orbit_curve import Row
from fastslow.orbits.flow.flows import Fields, fields
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.shooting import Shooting

Array = NDArray[np.float64]

#: Ratio of the smallest to the largest speed, in units of the ranges, below which a cycle is
#: slow near an equilibrium.
SLOW = 0.1

#: Number of Newton steps for an equilibrium, and the last one in units of the ranges; one below
#: `EQUILIBRIUM_STALLED` is the last too if it is not half of the one before, as by rounding where
#: the ranges are small.
EQUILIBRIUM_STEPS, EQUILIBRIUM_SOLVED, EQUILIBRIUM_STALLED = 20, 1e-12, 1e-8


class Slowest(NamedTuple):
    """The point of a cycle with the smallest speed: time, state and mode; ranges of the states."""

    time: float
    state: Array
    mode: int
    size: Array


class Saddle(NamedTuple):
    """An equilibrium with its Jacobian in units of the ranges.

    Parameters
    ----------
    state : ndarray, shape (n,)
    jacobian : ndarray, shape (m, m)
        In the tangent space of the interfaces on which the motion slides.
    eigenvalues : ndarray of complex128, shape (m,)
    drift : ndarray, shape (n,)
        Derivative of the state with respect to the parameter.
    tangents : ndarray, shape (n, m)
        Orthonormal basis of the tangent space; the identity without sliding.
    """

    state: Array
    jacobian: Array
    eigenvalues: NDArray[np.complex128]
    drift: Array
    tangents: Array

    @property
    def slides(self) -> bool:
        """Whether it is a pseudo-equilibrium."""
        return len(self.jacobian) < len(self.state)

    @property
    def leading(self) -> tuple[float, float]:
        """Real parts of the eigenvalues nearest to the imaginary axis: unstable and stable."""
        real = self.eigenvalues.real
        return float(real[real > 0].min()), float(real[real < 0].max())

    @property
    def is_saddle(self) -> bool:
        """Whether orbits approach it, along the interfaces or from beside them, and leave it."""
        real = self.eigenvalues.real
        approached = self.slides or (real < 0).any()
        return bool((real > 0).any() and approached and (real != 0).all())

    def distance(self, slow: Slowest) -> float:
        """Distance from the slowest point of a cycle, in units of the ranges."""
        return float(np.abs((self.state - slow.state) / slow.size).max())

    def unstable_flow(self, away: Array, time: float) -> Array:
        """Linear flow of a vector in the unstable eigenspace, onto which it is projected."""
        values, vectors = np.linalg.eig(self.jacobian)
        outward = values.real > 0
        parts = np.linalg.solve(vectors, away.astype(complex))[outward]
        return np.asarray((vectors[:, outward] @ (np.exp(values[outward] * time) * parts)).real)

    def spaces(self) -> tuple[Array, Array]:
        """Orthonormal bases of the left eigenspaces, unstable and stable, as rows."""
        values, vectors = np.linalg.eig(self.jacobian.T)
        return _real_rows(vectors[:, values.real > 0]), _real_rows(vectors[:, values.real < 0])


def _real_rows(vectors: NDArray[np.complex128]) -> Array:
    """Orthonormal real basis of the span of eigenvectors that come in conjugate pairs."""
    both = np.hstack([vectors.real, vectors.imag])
    return np.asarray(np.linalg.svd(both)[0][:, : vectors.shape[1]].T)


def slowest_of(problem: OrbitProblem, row: Row) -> Slowest | None:
    """The slowest point of a cycle, None if its speed varies little."""
    run, n = row.orbit.trajectory, problem.variations.n
    assert run.series is not None
    states, modes = run.series[:, :n, 0], run.steps[:, 2].astype(np.int64)
    values = row.shooting.parameters_at(row.u)
    rates = fields(problem.variations, modes, states, np.zeros(len(modes)), values).f
    size = row.sizes
    speeds = np.linalg.norm(rates / size, axis=1)
    least = int(np.argmin(speeds))
    if not speeds[least] < SLOW * speeds.max():
        return None
    return Slowest(float(run.steps[least, 0]), states[least].copy(), int(modes[least]), size)


def fields_at(problem: OrbitProblem, mode: int, state: Array, values: Array) -> Fields:
    """Rates and switching functions at one state."""
    return fields(problem.variations, np.array([mode]), state[None, :], np.zeros(1), values)


def with_value(shooting: Shooting, value: float) -> Array:
    """Parameter array at a value of the chosen parameter."""
    values = shooting.parameters.copy()
    values[shooting.variations.places] = value
    return values


def equilibrium_near(problem: OrbitProblem, slow: Slowest, values: Array) -> Saddle | None:
    """The equilibrium of the motion near a point; None without convergence."""
    state, n = slow.state.copy(), problem.variations.n
    on, before = np.flatnonzero(problem.variations.signs[slow.mode] == 0), np.inf
    for _ in range(EQUILIBRIUM_STEPS):
        known = fields_at(problem, slow.mode, state, values)
        jacobian, normals = known.f_u[0, :, :n] * slow.size, known.g_u[0, on, :n] * slow.size
        by_parameter = np.append(known.f_u[0, :, n + 1], known.g_u[0, on, n + 1])
        sides = np.stack([-np.append(known.f[0], known.g[0, on]), -by_parameter], axis=1)
        try:
            step, drift = _tangential(jacobian, normals, sides).T
        except np.linalg.LinAlgError:
            return None
        state = state + step * slow.size
        length = np.abs(step).max()
        if not np.isfinite(state).all() or length > 1.0:
            return None
        if length <= EQUILIBRIUM_SOLVED or EQUILIBRIUM_STALLED >= length >= 0.5 * before:
            tangents = np.linalg.svd(normals)[2][len(on) :].T if len(on) else np.eye(n)
            scaled = tangents.T @ (jacobian / slow.size[:, None]) @ tangents
            values_of = np.linalg.eigvals(scaled).astype(complex)
            return Saddle(state, scaled, values_of, drift * slow.size, tangents)
        before = length
    return None


def _tangential(jacobian: Array, normals: Array, sides: Array) -> Array:
    """Solutions of consistent equations for rates that are tangential to the interfaces.

    Each interface on which the motion slides makes one of the rates dependent on the others.
    """
    if not len(normals):
        return np.asarray(np.linalg.solve(jacobian, sides), dtype=float)
    rows = np.vstack([jacobian, normals])
    units = np.abs(rows).max(axis=1)
    units[units == 0] = 1.0
    found = np.linalg.lstsq(rows / units[:, None], sides / units[:, None], rcond=None)[0]
    return np.asarray(found, dtype=float)
