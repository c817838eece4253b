"""Normal-form coefficients of special points, from derivatives of any order at many digits.

The multilinear forms B and C of the rates are differenced with a hundred
digits, so that what is left of the truncation is far below double precision.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.diagrams.fields import FrozenField
from fastslow.model.structure import real

Array = NDArray[np.float64]
Vector = NDArray[Any]  # real or complex

#: Digits of the evaluation, and the step that leaves forty of them after three differences.
DIGITS = 100
STEP = "1e-20"


@dataclass(frozen=True, eq=False)
class Multilinear:
    """Derivatives of smooth rates at a point, applied to vectors.

    Parameters
    ----------
    rates : callable
        n mpmath numbers to the n rates.
    state : ndarray, shape (n,)
    """

    rates: Callable[..., Any]
    state: Array

    def form(self, *vectors: Vector) -> Vector:
        """Apply the derivative of order k to k vectors: B(q, r), C(q, r, s), shape (n,)."""
        order = len(vectors)
        with mpmath.workdps(DIGITS):
            step = mpmath.mpf(STEP)
            base = [mpmath.mpf(float(x)) for x in self.state]
            moves = [[step * mpmath.mpc(complex(c)) for c in v] for v in vectors]
            total = [mpmath.mpc(0)] * len(base)
            # an even form is the same for the opposite signs, an odd one the opposite
            for signs in itertools.product((1, -1), repeat=order):
                place = [
                    x + sum(s * m[i] for s, m in zip(signs, moves, strict=True))
                    for i, x in enumerate(base)
                ]
                weight = int(np.prod(signs))
                total = [t + weight * r for t, r in zip(total, self.rates(*place), strict=True)]
            return np.array([complex(t / (2 * step) ** order) for t in total])


def multilinear(rates: list[sp.Expr], values: dict[str, float], names: list[str]) -> Any:
    """Give a function of mpmath numbers for rates at parameter values.

    Parameters
    ----------
    rates : list of sympy.Expr
        In real symbols.
    values : dict
        Parameter to value, kept exactly.
    names : list of str
        States, in the order of the rates.

    Examples
    --------
    >>> x = real("x")
    >>> at = Multilinear(multilinear([x**3], {}, ["x"]), np.array([2.0]))
    >>> one = np.ones(1, dtype=complex)
    >>> at.form(one, one).real.tolist(), at.form(one, one, one).real.tolist()
    ([12.0], [6.0])
    """
    numbers = {real(n): sp.Rational(v) for n, v in values.items()}
    exact = [sp.nsimplify(r, rational=True).subs(numbers) for r in rates]
    return sp.lambdify([real(n) for n in names], exact, "mpmath")


@lru_cache(maxsize=64)
def _compiled(field: FrozenField, region: int) -> Any:
    names = field.model.states
    rates = field.model.regions[field.regions[region]].rates
    values = {n: v for n, v in field.model.parameters.items() if n not in field.varying}
    moving = [*names, *field.varying]
    return multilinear([rates[n] for n in names], values, moving)


def forms_at(field: FrozenField, region: int, u: Array) -> Multilinear:
    """Give the derivatives of a region's rates by the states at u = (states, parameters)."""
    function, n = _compiled(field, region), field.n
    fixed = [float(v) for v in u[n:]]
    return Multilinear(lambda *x: function(*x, *fixed), u[:n])


def fold_form(forms: Multilinear, jacobian: Array) -> float:
    """Quadratic coefficient a = ½⟨p, B(q, q)⟩ of a fold, |q| = 1, ⟨p, q⟩ = 1.

    Kuznetsov (2004), equation 5.26. Its sign depends on the direction of q,
    which is taken with its largest component positive.
    """
    p, q = null_vectors(jacobian)
    return float(0.5 * (p @ forms.form(q, q)).real / (p @ q))


def cusp_form(forms: Multilinear, jacobian: Array) -> float:
    """Cubic coefficient c of a cusp, y' = β₁ + β₂ y + c y³, |q| = 1, ⟨p, q⟩ = 1.

    c = ⟨p, C(q, q, q) + 3 B(q, h)⟩ / 6 with J h = −B(q, q) + ⟨p, B(q, q)⟩ q,
    ⟨p, h⟩ = 0 (Kuznetsov 2004, section 8.7.1).
    """
    p, q = null_vectors(jacobian)
    p = p / (p @ q)
    n = len(q)
    bent = forms.form(q, q)
    bordered = np.block([[jacobian, q[:, None]], [p[None, :], np.zeros((1, 1))]])
    right = np.append(-bent + (p @ bent) * q, 0.0)
    h = np.linalg.solve(bordered, right)[:n]
    cubic = forms.form(q, q, q) + 3.0 * forms.form(q, h)
    return float((p @ cubic).real / 6.0)


def null_vectors(jacobian: Array) -> tuple[Array, Array]:
    """Left and right null vectors of length one, the right one's largest component positive."""
    left, _, right = np.linalg.svd(jacobian)
    q = right[-1]
    return left[:, -1], q if q[np.argmax(np.abs(q))] > 0 else -q


def first_lyapunov(forms: Multilinear, jacobian: Array, frequency: float) -> float:
    """First Lyapunov coefficient l₁ of a Hopf point, ⟨q, q⟩ = ⟨p, q⟩ = 1.

    Kuznetsov (2004), equation 5.34. In a plane with J = [[0, −ω], [ω, 0]] the
    coefficient a of Guckenheimer and Holmes (1983, equation 3.4.11) is ω l₁/2.
    NaN where another eigenvalue is 0 or 2iω, so that the coefficient has a pole.

    Examples
    --------
    >>> x, y = real("x"), real("y")
    >>> rates = [-y - x * (x**2 + y**2), x - y * (x**2 + y**2)]
    >>> forms = Multilinear(multilinear(rates, {}, ["x", "y"]), np.zeros(2))
    >>> round(first_lyapunov(forms, np.array([[0.0, -1.0], [1.0, 0.0]]), 1.0), 14)
    -2.0
    """
    n = len(jacobian)
    q = _eigenvector(jacobian, 1j * frequency)
    p = _eigenvector(jacobian.T, -1j * frequency)
    p = p / np.conj(np.vdot(p, q))
    conjugate = np.conj(q)
    try:
        straight = np.linalg.solve(jacobian, forms.form(q, conjugate))
        turning = np.linalg.solve(2j * frequency * np.eye(n) - jacobian, forms.form(q, q))
    except np.linalg.LinAlgError:
        return np.nan
    terms = (
        forms.form(q, q, conjugate) - 2.0 * forms.form(q, straight) + forms.form(conjugate, turning)
    )
    return float(np.vdot(p, terms).real / (2.0 * frequency))


def _eigenvector(matrix: Array, value: complex) -> Vector:
    """Give the eigenvector of length one that belongs to the eigenvalue nearest to a value."""
    values, vectors = np.linalg.eig(matrix)
    found: Vector = vectors[:, np.argmin(np.abs(values - value))]
    return found / np.linalg.norm(found)
