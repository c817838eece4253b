"""Defining systems: square systems of equations with a special point as a regular solution.

Every system contains F = 0, and blocks of further equations with as many unknowns and parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.certification.equations import ExactEquations
from fastslow.certification.points.balls import ball_function, flint
from fastslow.errors import ArgumentError
from fastslow.results.point_types import (
    BOGDANOV_TAKENS,
    BOUNDARY_EQUILIBRIUM,
    CUSP,
    DOUBLE_HOPF,
    FOLD,
    FOLD_ON_INTERFACE,
    GENERALIZED_HOPF,
    HOPF,
    HOPF_ON_INTERFACE,
    NEUTRAL_SADDLE,
    ZERO_HOPF,
)
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Assumed accuracy of points, relative to each unknown and absolute.
RELATIVE, ABSOLUTE = 1e-9, 1e-12


@dataclass(frozen=True, eq=False)
class Block:
    """Equations for further unknowns.

    Parameters
    ----------
    unknowns : tuple of Symbol
    rows : tuple of Expr
    start : ndarray
        Approximate values of the unknowns.
    nonzero : tuple of Symbol
        Unknowns that vanish in solutions that are not such points.
    """

    unknowns: tuple[sp.Symbol, ...] = ()
    rows: tuple[sp.Expr, ...] = ()
    start: Array = field(default_factory=lambda: np.empty(0))
    nonzero: tuple[sp.Symbol, ...] = ()


@dataclass(frozen=True, eq=False)
class Defined:
    """A square system of equations that defines a point.

    Parameters
    ----------
    whole : Block
        All unknowns, equations and starting values.
    position : tuple of Expr
        States, then parameters, in terms of the unknowns.
    regular : str
        The meaning of the regularity of the system.
    singular : callable
        Returns the meaning of a singular system.
    """

    whole: Block
    position: tuple[sp.Expr, ...]
    regular: str
    singular: Callable[[], str]


@dataclass(frozen=True, eq=False)
class Local:
    """The exact equations of the region of a point, and its Jacobian.

    Parameters
    ----------
    equations : ExactEquations
    point : SpecialPoint
    u : ndarray
        Approximate states and parameters.
    """

    equations: ExactEquations
    point: SpecialPoint
    u: Array

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        """The unknowns without the parameters."""
        return self.equations.unknowns[: len(self.equations.rows)]

    @property
    def symbolic(self) -> sp.Matrix:
        """F_x."""
        return sp.Matrix(self.equations.rows).jacobian(self.states)

    def along(self, rows: sp.Matrix, direction: sp.Matrix) -> sp.Matrix:
        """The directional derivative of a column by the states."""
        return rows.jacobian(self.states) * direction

    def values(self, rows: Sequence[sp.Expr], block: Block | None = None) -> Array:
        """Approximate values of expressions of states, parameters and the unknowns of a block.

        What the accuracy of the point does not distinguish from zero is zero.
        """
        more = block or Block()
        function = ball_function(rows, (*self.equations.unknowns, *more.unknowns))
        at = np.concatenate([self.u, more.start])
        arb = flint().arb
        balls = function([arb(v, RELATIVE * abs(v) + ABSOLUTE) for v in at.tolist()])
        return np.array([0.0 if b.contains(0) else float(b.mid()) for b in balls])

    def jacobian(self) -> Array:
        return self.values(list(self.symbolic)).reshape(self.symbolic.shape)

    def null_vectors(self) -> tuple[Array, Array]:
        """Approximate right and left null vectors v and ψ, of length one."""
        matrix = self.jacobian()
        sizes = np.linalg.norm(matrix, axis=1)
        sizes = np.where(sizes > 0, sizes, 1.0)
        left, _, right = np.linalg.svd(matrix / sizes[:, None])
        psi = left[:, -1] / sizes
        return right[-1], psi / np.linalg.norm(psi)


def defined(equations: ExactEquations, point: SpecialPoint, u: Array) -> Defined:
    """The defining system of a point, from the exact equations of its region.

    Parameters
    ----------
    equations : ExactEquations
    point : SpecialPoint
    u : ndarray
        States, then the parameters of the equations.

    Raises
    ------
    ArgumentError
        For a point without the eigenvalues of its code.
    """
    system = SYSTEMS[point.code]
    local = Local(equations, point, u)
    blocks = [Block(equations.unknowns, equations.rows, u), *(b(local) for b in system.blocks)]
    whole = Block(
        tuple(s for b in blocks for s in b.unknowns),
        tuple(r for b in blocks for r in b.rows),
        np.concatenate([b.start for b in blocks]),
        tuple(s for b in blocks for s in b.nonzero),
    )

    def singular() -> str:
        numbers = system.conditions(local) if system.conditions else {}
        measured = ", ".join(f"{words} = {value:.2g}" for words, value in numbers.items())
        return f"{system.singular}{measured and f' ({measured})'}"

    return Defined(whole, equations.unknowns, system.regular, singular)


def vector(name: str, n: int) -> sp.Matrix:
    """A column of symbols, with names that are not valid for states and parameters."""
    return sp.Matrix([sp.Symbol(f"({name}{k})", real=True) for k in range(n)])


def null_block(matrix: sp.Matrix, right: Array, name: str = "v") -> Block:
    """A v = 0, c·v = 1 with c an approximation of v."""
    v = vector(name, len(right))
    return Block(tuple(v), (*(matrix * v), _product(right, v) - 1), right / (right @ right))


def _product(numbers: Array, symbols: sp.Matrix) -> sp.Expr:
    return sum(sp.Rational(float(c)) * s for c, s in zip(numbers, symbols, strict=True))


def _null(local: Local) -> Block:
    return null_block(local.symbolic, local.null_vectors()[0])


def _boundary(local: Local) -> Block:
    """The interface function vanishes, h = 0."""
    point, equations = local.point, local.equations
    if point.interface not in equations.interfaces:
        raise ArgumentError(f"{point.label} has no interface '{point.interface}' in this model")
    return Block(rows=(equations.heights[equations.interfaces.index(point.interface)],))


def _pair(local: Local, number: int = 0) -> Block:
    """F_x (a + ib) = iω (a + ib), c·a = 1, c·b = 0 with c a unit vector."""
    values, vectors = np.linalg.eig(local.jacobian())
    upper = np.flatnonzero(values.imag > 0)
    if len(upper) <= number:
        raise ArgumentError(
            f"{local.point.label} cannot be proved: the Jacobian has {len(upper)} pairs of complex "
            f"eigenvalues there; expected a point with {number + 1}"
        )
    k = upper[np.argsort(np.abs(values.real[upper]))[number]]
    largest = int(np.argmax(np.abs(vectors[:, k])))
    q = vectors[:, k] / vectors[largest, k]
    mark = str(number or "")
    a, b = vector(f"a{mark} ", len(q)), vector(f"b{mark} ", len(q))
    omega = sp.Symbol(f"(omega{mark})", real=True)
    return Block(
        (*a, *b, omega),
        (
            *(local.symbolic * a + omega * b),
            *(local.symbolic * b - omega * a),
            a[largest] - 1,
            b[largest],
        ),
        np.concatenate([q.real, q.imag, [values[k].imag]]),
        (omega,),
    )


def _second_pair(local: Local) -> Block:
    return _pair(local, 1)


def _opposite(local: Local) -> Block:
    """F_x v = κ v, F_x w = −κ w, c·v = 1, d·w = 1."""
    values, vectors = np.linalg.eig(local.jacobian())
    sums = np.abs(values[:, None] + values).astype(float)
    real = (values.imag == 0) & (values.real != 0)
    sums[~(real[:, None] & real)] = np.inf
    if not np.isfinite(sums).any():
        raise ArgumentError(
            f"{local.point.label} cannot be proved: the Jacobian has no real eigenvalues of "
            "opposite signs there"
        )
    k, m = np.unravel_index(np.argmin(sums), sums.shape)
    one, two = (vectors[:, j].real for j in (k, m))
    v, w = vector("v", len(one)), vector("w", len(two))
    kappa = sp.Symbol("(kappa)", real=True)
    return Block(
        (*v, *w, kappa),
        (
            *(local.symbolic * v - kappa * v),
            *(local.symbolic * w + kappa * w),
            _product(one, v) - 1,
            _product(two, w) - 1,
        ),
        np.concatenate([one / (one @ one), two / (two @ two), [values[k].real]]),
        (kappa,),
    )


def _cusp(local: Local) -> Block:
    """F_x v = 0, c·v = 1, F_xᵀψ + g c = 0, d·ψ = 1, ψᵀF_xx(v, v) = 0; then g = 0."""
    right, left = local.null_vectors()
    null = null_block(local.symbolic, right)
    v, psi = sp.Matrix(null.unknowns), vector("psi", len(left))
    slack = sp.Symbol("(g)", real=True)
    border = sp.Matrix([sp.Rational(float(c)) for c in right])
    second = local.along(local.symbolic * v, v)
    return Block(
        (*null.unknowns, *psi, slack),
        (
            *null.rows,
            *(local.symbolic.T * psi + slack * border),
            _product(left, psi) - 1,
            (psi.T * second)[0],
        ),
        np.concatenate([null.start, left / (left @ left), [0.0]]),
    )


def _double_zero(local: Local) -> Block:
    """F_x v = 0, c·v = 1, F_x w = v, c·w = 0."""
    right, _ = local.null_vectors()
    null = null_block(local.symbolic, right)
    v, w = sp.Matrix(null.unknowns), vector("w", len(right))
    matrix = np.vstack([local.jacobian(), right])
    generalized = np.linalg.lstsq(matrix, np.append(null.start, 0.0), rcond=None)[0]
    return Block(
        (*null.unknowns, *w),
        (*null.rows, *(local.symbolic * w - v), _product(right, w)),
        np.concatenate([null.start, generalized]),
    )


def _generalized_hopf(local: Local) -> Block:
    """A pair q = a + ib, and l₁ = 0 (Kuznetsov 2004, eq. 5.34), with F_x = A.

    The unknowns ψ = m + ik, r, s solve Aᵀψ + iωψ + (g₁ + ig₂) c = 0 with ψ̄·q = 1, A r = B(q, q̄)
    and (2iω − A) s = B(q, q); then g₁ = g₂ = 0 and
    l₁ = Re ψ̄·[C(q, q, q̄) − 2 B(q, r) + B(q̄, s)] up to a positive factor.
    """
    pair = _pair(local)
    n, matrix = len(local.states), local.symbolic
    a, b = sp.Matrix(pair.unknowns[:n]), sp.Matrix(pair.unknowns[n : 2 * n])
    omega = pair.unknowns[-1]
    m, k, r, s_real, s_imag = (vector(name, n) for name in ("m", "k", "r", "s", "t"))
    slack = vector("g", 2)
    largest = int(np.argmax(pair.start[:n] ** 2 + pair.start[n : 2 * n] ** 2))
    border = sp.Matrix([int(j == largest) for j in range(n)])
    rates = sp.Matrix(local.equations.rows)

    def form(*directions: sp.Matrix) -> sp.Matrix:
        found = rates
        for direction in directions:
            found = local.along(found, direction)
        return found

    modulus, real_part, imaginary_part = (
        form(a, a) + form(b, b),
        form(a, a) - form(b, b),
        2 * form(a, b),
    )
    cubic_real = form(a, a, a) + form(a, b, b) - 2 * form(a, r)
    cubic_real += form(a, s_real) + form(b, s_imag)
    cubic_imag = form(a, a, b) + form(b, b, b) - 2 * form(b, r)
    cubic_imag += form(a, s_imag) - form(b, s_real)
    rows = (
        *(matrix.T * m - omega * k + slack[0] * border),
        *(matrix.T * k + omega * m + slack[1] * border),
        (m.T * a + k.T * b)[0] - 1,
        (m.T * b - k.T * a)[0],
        *(matrix * r - modulus),
        *(-matrix * s_real - 2 * omega * s_imag - real_part),
        *(-matrix * s_imag + 2 * omega * s_real - imaginary_part),
        (m.T * cubic_real + k.T * cubic_imag)[0],
    )
    numbers, frequency = local.jacobian(), pair.start[-1]
    values, vectors = np.linalg.eig(numbers.T)
    psi = vectors[:, int(np.argmin(np.abs(values + 1j * frequency)))]
    psi = psi / np.conj(psi.conj() @ (pair.start[:n] + 1j * pair.start[n : 2 * n]))
    squares = local.values([*modulus, *real_part, *imaginary_part], pair)
    steady = np.linalg.lstsq(numbers, squares[:n], rcond=None)[0]
    double = 2j * frequency * np.eye(n) - numbers
    forced = squares[n : 2 * n] + 1j * squares[2 * n :]
    second = np.linalg.lstsq(double, forced, rcond=None)[0]
    start = [pair.start, psi.real, psi.imag, steady, second.real, second.imag, np.zeros(2)]
    return Block(
        (*pair.unknowns, *m, *k, *r, *s_real, *s_imag, *slack),
        (*pair.rows, *rows),
        np.concatenate(start),
        pair.nonzero,
    )


def _of_fold(local: Local) -> dict[str, float]:
    """ψᵀF_p and ψᵀF_xx(v, v) for null vectors of length one."""
    right, left = local.null_vectors()
    v = vector("v", len(right))
    rates = sp.Matrix(local.equations.rows)
    second = local.along(local.along(rates, v), v)
    columns = local.values(
        [*rates.diff(local.equations.unknowns[-1]), *second], Block(tuple(v), (), right)
    )
    by_parameter, squares = columns.reshape(2, -1) @ left
    return {"derivative by the parameter": by_parameter, "quadratic coefficient": squares / 2}


def _of_pair(local: Local) -> dict[str, float]:
    """The frequency, and the derivative of the real part by the parameter along the branch."""
    matrix = local.jacobian()
    values, vectors = np.linalg.eig(matrix)
    k = int(np.argmin(np.where(values.imag > 0, np.abs(values.real), np.inf)))
    found = {"frequency": float(values[k].imag)}
    if np.linalg.cond(matrix) < 1 / RELATIVE:
        rates, last = sp.Matrix(local.equations.rows), local.equations.unknowns[-1]
        moved = vector("x'", len(values))
        columns = local.values(list(rates.diff(last)))
        change = np.asarray(-np.linalg.solve(matrix, columns), dtype=np.float64)
        slopes = local.symbolic.diff(last) + local.along(rates, moved).jacobian(local.states)
        total = local.values(list(slopes), Block(tuple(moved), (), change)).reshape(matrix.shape)
        speed = (np.linalg.pinv(vectors) @ total @ vectors)[k, k].real
        found["derivative of the real part by the parameter"] = float(speed)
    return found


def _of_boundary(local: Local) -> dict[str, float]:
    """The derivative of h along the branch, for the unit tangent."""
    rows = (*local.equations.rows, *_boundary(local).rows)
    unknowns = local.equations.unknowns
    matrix = local.values(list(sp.Matrix(rows).jacobian(unknowns))).reshape(-1, len(unknowns))
    tangent = np.linalg.svd(matrix[:-1])[2][-1]
    return {"derivative of the interface function along the branch": abs(matrix[-1] @ tangent)}


@dataclass(frozen=True)
class _System:
    """The blocks of the points of one code, and what regular and singular systems mean.

    The conditions are approximate values, of which one vanishes where the system is singular.
    """

    blocks: tuple[Callable[[Local], Block], ...]
    regular: str
    singular: str
    conditions: Callable[[Local], dict[str, float]] | None = None


#: Defining systems by the code of the point (Kuznetsov 2004, section 10.2).
SYSTEMS: dict[str, _System] = {
    FOLD: _System(
        (_null,),
        "a quadratic fold",
        "the quadratic coefficient or the derivative by the parameter vanishes, as at a cusp or a "
        "branch point",
        _of_fold,
    ),
    HOPF: _System(
        (_pair,),
        "a simple pair of imaginary eigenvalues, which crosses the axis with non-zero speed",
        "the frequency vanishes, or the eigenvalues do not cross the imaginary axis transversally",
        _of_pair,
    ),
    NEUTRAL_SADDLE: _System(
        (_opposite,),
        "two simple real eigenvalues, whose sum vanishes with non-zero speed",
        "an eigenvalue vanishes, or the sum of both does not vanish transversally",
    ),
    BOUNDARY_EQUILIBRIUM: _System(
        (_boundary,),
        "the branch crosses the interface transversally",
        "the branch is tangent to the interface, or the equilibrium is not isolated",
        _of_boundary,
    ),
    CUSP: _System(
        (_cusp,),
        "a cusp with a cubic coefficient that is not zero, unfolded by both parameters",
        "the cubic coefficient vanishes, or the parameters do not unfold the cusp transversally",
    ),
    BOGDANOV_TAKENS: _System(
        (_double_zero,),
        "a double zero eigenvalue with one eigenvector, unfolded by both parameters",
        "there are more zero eigenvalues or eigenvectors, or the parameters do not unfold them "
        "transversally",
    ),
    GENERALIZED_HOPF: _System(
        (_generalized_hopf,),
        "a simple pair of imaginary eigenvalues and l1 = 0; both parameters change real part and "
        "l1 independently",
        "the frequency vanishes, or the parameters do not change real part and l1 independently",
    ),
    ZERO_HOPF: _System(
        (_null, _pair),
        "a simple zero eigenvalue and a simple imaginary pair, unfolded by both parameters",
        "the frequency vanishes, or the parameters do not unfold the eigenvalues transversally",
    ),
    DOUBLE_HOPF: _System(
        (_pair, _second_pair),
        "two simple imaginary pairs, whose real parts both parameters change independently",
        "a frequency vanishes, or the parameters do not change the real parts independently",
    ),
    FOLD_ON_INTERFACE: _System(
        (_boundary, _null),
        "the curve of folds crosses the interface transversally; that the fold is quadratic is not "
        "included",
        "the curve of folds is tangent to the interface, or not regular",
    ),
    HOPF_ON_INTERFACE: _System(
        (_boundary, _pair),
        "the curve of Hopf points crosses the interface transversally; that the pair crosses the "
        "axis with non-zero speed as one parameter changes is not included",
        "the frequency vanishes, or the curve of Hopf points is tangent to the interface",
    ),
}

#: Codes of points of pseudo-equilibria that have these systems; the others use eigenvalues.
ON_DISCONTINUITY = (FOLD, BOUNDARY_EQUILIBRIUM, CUSP, FOLD_ON_INTERFACE)
