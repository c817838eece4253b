"""Special points of periodic orbits as solutions of extended systems.

With the equations F(u) = 0 of multiple shooting, whose last unknown is the parameter, and the
matrix A(μ) of their linearisation in which a perturbation returns multiplied by μ (A(1) is the
Jacobian F_x without the parameter's column), an orbit has the multiplier μ where A(μ) is singular:
μ = 1 is a fold (LPC), μ = -1 a period doubling (PD) and μ = e^{±iθ} a torus bifurcation (TR).
In an autonomous model the phase condition removes the multiplier of the orbit's tangent. The
scalar condition is g = 0 in the bordered system

    [[A, b], [cᴴ, 0]] (v, g) = (0, 1),

regular at generic points, with the derivatives g_u = -wᵀ A_u v (Govaerts 2000; Kuznetsov 2004,
section 10.2). At a branch point (BPC) all of F_u has a two-dimensional kernel, and F is unfolded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.marks import CENTRAL_DIFFERENCE
from fastslow.orbits.flow.shooting import (
    LONGEST_NEWTON_STEP,
    ORBIT_NEWTON_STEPS,
    Linearised,
    Shooting,
)

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: A Newton step below this size, in units of the scales, that no longer decreases is rounding.
STALLED_POINT_STEP = 1e-7

#: Step below which the residual may grow by a factor: off the orbits the derivative of the
#: condition is not exact.
GROWING_STEP, RESIDUAL_GROWTH = 1e-3, 4.0

#: Ratio of the eigenvalues of the branching equation below which it has no two directions.
BRANCHING_RATIO = 1e-4


#: Residual and Jacobian in units of the scales, and the null vector.
Extended = tuple[Array, Array, Complex]


@dataclass(frozen=True, eq=False)
class LocatedOrbit:
    """A solved special point.

    Parameters
    ----------
    u : ndarray
        Unknowns of the shooting equations, with the parameter.
    vector : ndarray of complex128, shape (N,)
        Perturbation of the unknowns that returns multiplied by the critical multiplier; real for
        LPC, PD and BPC.
    multiplier : complex
        The critical multiplier.
    residual : float
        Largest residual in units of the rows, and of the scalar condition.
    accuracy : float
        Size of the last Newton step in units of the scales.
    converged : bool
    """

    u: Array
    vector: Complex
    multiplier: complex
    residual: float
    accuracy: float
    converged: bool


def locate_fold(shooting: Shooting, u: Array, scale: Array) -> LocatedOrbit:
    """Solve for a fold of orbits (LPC).

    Parameters
    ----------
    shooting : Shooting
        With one chosen parameter.
    u : ndarray, shape (N + 1,)
        An orbit nearby.
    scale : ndarray, shape (N + 1,)
        Units of the unknowns.
    """
    return _with_multiplier(shooting, u, scale, 1.0)


def locate_doubling(shooting: Shooting, u: Array, scale: Array) -> LocatedOrbit:
    """Solve for a period doubling (PD); see `locate_fold`."""
    return _with_multiplier(shooting, u, scale, -1.0)


def _with_multiplier(shooting: Shooting, u: Array, scale: Array, multiplier: float) -> LocatedOrbit:
    system = multiplier_system(shooting, scale, multiplier)
    found, v, residual, accuracy, converged = solve_extended(system, u, scale)
    return LocatedOrbit(found, _unit(v), complex(multiplier), residual, accuracy, converged)


def locate_torus(shooting: Shooting, u: Array, scale: Array, angle: float) -> LocatedOrbit:
    """Solve for a torus bifurcation (TR) with multipliers e^{±iθ}, from an estimate of θ."""
    start, units = np.append(u, angle), np.append(scale, 1.0)
    system = torus_system(shooting, scale)
    found, v, residual, accuracy, converged = solve_extended(system, start, units)
    multiplier = complex(np.exp(1j * found[-1]))
    return LocatedOrbit(found[:-1], _unit(v), multiplier, residual, accuracy, converged)


def multiplier_system(
    shooting: Shooting, scale: Array, multiplier: float
) -> Callable[[Array], Extended]:
    """The equations of orbits with a real multiplier, at unknowns u with all parameters."""
    N = shooting.size
    near: list[Complex] = []

    def system(u: Array) -> Extended:
        last = shooting.linearised(u)
        rows = row_units(shooting, last, scale)
        matrix = returning(shooting, last, multiplier) * scale[:N] / rows[:, None]
        v, w, g = bordered(matrix.real, near)
        slope = _slope(shooting, u, scale, v, w / rows, multiplier)
        residual = np.append(last.residual / rows, g.real)
        jacobian = np.vstack([last.jacobian * scale / rows[:, None], slope.real * scale])
        return residual, jacobian, v * scale[:N]

    return system


def torus_system(shooting: Shooting, scale: Array) -> Callable[[Array], Extended]:
    """The equations of orbits with the multipliers e^{±iθ}, at unknowns (u, θ)."""
    N, n = shooting.size, shooting.variations.n
    near: list[Complex] = []

    def system(unknown: Array) -> Extended:
        u, multiplier = unknown[:-1], np.exp(1j * unknown[-1])
        last = shooting.linearised(u)
        rows = row_units(shooting, last, scale)
        matrix = returning(shooting, last, multiplier) * scale[:N] / rows[:, None]
        v, w, g = bordered(matrix, near)
        slope = _slope(shooting, u, scale, v, w / rows, multiplier) * scale
        turned = closing(shooting, last) @ (v * scale[:N])[:n]
        by_angle = -(w / rows) @ turned * 1j * multiplier
        F_u = last.jacobian * scale / rows[:, None]
        lower = np.array([[*slope.real, by_angle.real], [*slope.imag, by_angle.imag]])
        jacobian = np.vstack([np.column_stack([F_u, np.zeros(N)]), lower])
        return np.r_[last.residual / rows, g.real, g.imag], jacobian, v * scale[:N]

    return system


def locate_branch_point(shooting: Shooting, u: Array, scale: Array) -> LocatedOrbit:
    """Solve for a branch point of orbits (BPC), where two branches intersect."""
    start, units = np.append(u, 0.0), np.append(scale, 1.0)
    system = branch_point_system(shooting, scale)
    found, v, residual, accuracy, converged = solve_extended(system, start, units)
    residual = max(residual, abs(float(found[-1])))
    return LocatedOrbit(found[:-1], _unit(v), 1.0 + 0j, residual, accuracy, converged)


def branch_point_system(shooting: Shooting, scale: Array) -> Callable[[Array], Extended]:
    """The equations of branch points over the first parameter, at unknowns (u, β).

    β unfolds the equations, and vanishes at a branch point.
    """
    N = shooting.size
    reference: list[Array] = []

    def system(unknown: Array) -> Extended:
        u, unfolding = unknown[:-1], unknown[-1]
        last = shooting.linearised(u)
        rows = row_units(shooting, last, scale)
        every = last.jacobian * scale / rows[:, None]
        matrix = every[:, : N + 1]
        U, _, V = np.linalg.svd(matrix)
        b, c = U[:, -1], V[-2:]
        if not reference:
            reference.extend([b, c])
        # the same borders at neighbouring points
        left, _, right = np.linalg.svd(reference[1] @ c.T)
        b, c = b if b @ reference[0] >= 0 else -b, left @ right @ c
        whole = np.block([[matrix, b[:, None]], [c, np.zeros((2, 1))]])
        solved = np.linalg.solve(whole, np.vstack([np.zeros((N, 2)), np.eye(2)]))
        w = np.linalg.solve(whole.T, np.r_[np.zeros(N + 1), 1.0])[:N]
        g, kernel = solved[-1], solved[:-1].T
        left_null = (w / rows).astype(complex)
        slopes = [_slope(shooting, u, scale, v, left_null, 1.0).real * scale for v in kernel]
        lower = np.column_stack([slopes, np.zeros(2)])
        jacobian = np.vstack([np.column_stack([every, b]), lower])
        return (
            np.r_[last.residual / rows + unfolding * b, g],
            jacobian,
            (kernel[0] * scale[: N + 1])[:N],
        )

    return system


def is_branch_point(shooting: Shooting, point: LocatedOrbit, scale: Array) -> bool:
    """Check whether a solved fold is a branch point: the parameter's column is in the range."""
    last = shooting.linearised(point.u)
    matrix = last.jacobian * scale / row_units(shooting, last, scale)[:, None]
    sizes = np.linalg.svd(matrix, compute_uv=False)
    # in a canard explosion several singular values are small
    return bool(sizes[-1] < 1e-6 * sizes[-2])


def branch_tangents(shooting: Shooting, u: Array, scale: Array) -> Array | None:
    """Tangents of the two branches that intersect at a branch point, in units of the scales.

    In the kernel (φ, ψ) of F_u they satisfy the algebraic branching equation
    wᵀF_uu (aφ + bψ)(aφ + bψ) = 0 with the left null vector w (Keller 1977; Govaerts 2000).

    Returns
    -------
    ndarray, shape (2, N + 1)
        Unit vectors; None without two real solutions.
    """
    last = shooting.linearised(u)
    rows = row_units(shooting, last, scale)
    U, _, V = np.linalg.svd(last.jacobian * scale / rows[:, None])
    left, kernel = (U[:, -1] / rows).astype(complex), V[-2:]
    second = np.array([_slope(shooting, u, scale, v, left, 1.0).real * scale for v in kernel])
    values, vectors = np.linalg.eigh(_symmetric(second @ kernel.T))
    if not -values[0] * values[1] > BRANCHING_RATIO**2 * np.abs(values).max() ** 2:
        return None
    # directions in which the quadratic form vanishes
    lengths = np.sqrt(np.abs(values[::-1]))
    both = np.array([vectors @ lengths, vectors @ (lengths * [1.0, -1.0])]) @ kernel
    return np.asarray(both / np.linalg.norm(both, axis=1)[:, None])


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))


def solve_extended(
    system: Callable[[Array], Extended], start: Array, scale: Array, enough: float = 1e-15
) -> tuple[Array, Complex, float, float, bool]:
    """Solve by Newton's method; return unknowns, vector, residual, accuracy and convergence.

    It ends with a step, in units of the scale, that is ``enough``, or limited by rounding.
    """
    u: Array = start.copy()
    step: Array = np.zeros(len(start))
    before = np.inf, np.inf
    residual, size, vector, share = np.inf, np.inf, np.zeros(0, dtype=complex), 1.0
    for _ in range(ORBIT_NEWTON_STEPS):
        trial = u + share * step * scale
        try:
            values, jacobian, vector = system(trial)
            following = np.asarray(np.linalg.solve(jacobian, -values), dtype=np.float64)
            worse = not np.isfinite(following).all()
        except np.linalg.LinAlgError:
            worse = True
        allowed = max(residual, STALLED_POINT_STEP) * (
            RESIDUAL_GROWTH if size <= GROWING_STEP else 1.0
        )
        if worse or np.abs(values).max() > allowed:
            share *= 0.25
            continue
        u, step, share = trial, following, 1.0
        size, residual = float(np.abs(step).max()), float(np.abs(values).max())
        # such steps decrease two by two
        if size <= enough or (size <= STALLED_POINT_STEP and size >= 0.5 * max(before)):
            return u, vector, residual, size, True
        before = before[1], size
        share = min(1.0, LONGEST_NEWTON_STEP / size)
    return u, vector, residual, size, size <= STALLED_POINT_STEP**2


def returning(shooting: Shooting, last: Linearised, multiplier: complex) -> Complex:
    """The linearisation without the parameter in which a perturbation returns multiplied."""
    n = shooting.variations.n
    matrix = last.jacobian[:, : shooting.size].astype(complex)
    matrix[:, :n] += (multiplier - 1.0) * closing(shooting, last)
    return matrix


def closing(shooting: Shooting, last: Linearised) -> Array:
    """Derivatives of the equations by the state after one period, which is the first state."""
    K, n = len(shooting.form), shooting.variations.n
    block = np.zeros((shooting.size, n))
    block[(K - 1) * n : K * n] = -np.eye(n)
    end = int(shooting.form.ends[-1])
    if end >= 0:
        block[K * n + K - 1] = last.fields.g_u[K - 1, end, :n]
    return block


def _slope(
    shooting: Shooting, u: Array, scale: Array, v: Complex, w: Complex, multiplier: complex
) -> Complex:
    """Derivatives -wᵀ A_u v: minus that of wᵀ F_u along v, by central differences.

    Along v the state after one period moves by μ times as much as the first one.
    """
    n = shooting.variations.n
    total = np.zeros(len(u), dtype=complex)
    moved = np.zeros(len(u), dtype=complex)
    moved[: len(v)] = v * scale[: len(v)]
    turned = (multiplier - 1.0) * moved[:n]
    for unit, along, winding in ((1.0, moved.real, turned.real), (1j, moved.imag, turned.imag)):
        size = float(np.abs(along / scale).max())
        if size == 0.0:
            continue
        step = CENTRAL_DIFFERENCE / size
        ahead, behind = shooting, shooting
        if multiplier != 1.0:
            ahead, behind = (
                replace(shooting, winding=shooting.winding + sign * step * winding)
                for sign in (1.0, -1.0)
            )
        one, two = ahead.linearised(u + step * along), behind.linearised(u - step * along)
        total -= unit * (w @ (one.jacobian - two.jacobian)) / (2.0 * step)
    return total


def row_units(shooting: Shooting, last: Linearised, scale: Array) -> Array:
    """Units of the equations: of the states where segments meet, else the largest term.

    The rows of a closed orbit may vanish at a bifurcation, so that their terms give no unit.
    """
    rows = np.abs(last.jacobian * scale).max(axis=1)
    meeting = len(shooting.form) * shooting.variations.n
    rows[:meeting] = scale[:meeting]
    return np.asarray(rows)


def bordered(
    matrix: NDArray[np.inexact], near: list[Complex] | None = None
) -> tuple[Complex, Complex, complex]:
    """Solve [[A, b], [cᴴ, 0]] (v, g) = (0, 1) and its transpose for w; g vanishes with det A.

    The borders b and c are the singular vectors of the smallest singular value, with the phases
    of those in ``near``, which they replace there.
    """
    left, _, right = np.linalg.svd(matrix)
    N, b, c = len(left), left[:, -1], right[-1].conj()
    # the same phases at neighbouring points
    phases = [np.vdot(a, one) for a, one in zip(near or (b, c), (b, c), strict=True)]
    b, c = (a * (np.conj(s) / abs(s) if s else 1.0) for a, s in zip((b, c), phases, strict=True))
    if near is not None:
        near[:] = [b, c]
    whole = np.block([[matrix, b[:, None]], [c.conj()[None], np.zeros((1, 1))]])
    unit = np.r_[np.zeros(N), 1.0]
    solved, left = np.linalg.solve(whole, unit), np.linalg.solve(whole.T, unit)
    return solved[:N].astype(complex), left[:N].astype(complex), complex(solved[N])


def _unit(v: Complex) -> Complex:
    return v / np.linalg.norm(v) if len(v) else v
