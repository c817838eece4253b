"""Normal-form coefficients of special points, from second and third derivatives of the rates."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField

Array = NDArray[np.float64]
Vector = NDArray[Any]  # real or complex


#: A column below this fraction of the rows of a singular matrix is zero to rounding.
NULL_COLUMN = 1e-13

#: Unit null vectors with a smaller product are orthogonal: the eigenvalue zero is double. Near
#: such a point eigenvalues and product are accurate to half the digits.
DOUBLE_ZERO = 1e-7


@dataclass(frozen=True, eq=False)
class Multilinear:
    """Non-zero derivatives of rates at one point, as multilinear forms.

    Parameters
    ----------
    n : int
        Number of rates and states.
    terms : mapping of int to (ndarray, ndarray)
        For k = 2, 3 the indices (i, j₁, …, jₖ), shape (m, k + 1), for every permutation of
        the j, and the values of ∂ᵏF_i/∂x_j₁…∂x_jₖ, shape (m,).
    """

    n: int
    terms: Mapping[int, tuple[NDArray[np.intp], Array]]

    @classmethod
    def dense(cls, *arrays: Array) -> Multilinear:
        """Create from dense arrays, shapes (n, n, n), (n, n, n, n) and so on."""
        places = [np.argwhere(array) for array in arrays]
        terms = {
            array.ndim - 1: (at, array[tuple(at.T)])
            for array, at in zip(arrays, places, strict=True)
        }
        return cls(len(arrays[0]), terms)

    def form(self, *vectors: Vector) -> Vector:
        """Evaluate B(q, r), C(q, r, s), …, shape (n,)."""
        indices, values = self.terms[len(vectors)]
        products: Vector = values
        for place, vector in enumerate(vectors, start=1):
            products = products * vector[indices[:, place]]
        result: Vector = np.zeros(self.n, dtype=products.dtype)
        np.add.at(result, indices[:, 0], products)
        return result


def forms_at(field: FrozenField, region: int, u: Array) -> Multilinear:
    """Evaluate the derivatives of a region's rates by the states at u = (states, parameters)."""
    model, n = field.model, field.n
    entries, values = field.source.derivatives(region)
    fixed = [v for p, v in model.parameters.items() if p not in field.varying]
    numbers = np.array(values(*u, *fixed), dtype=float)
    terms = {
        order: (places, numbers[rows])
        for order, (places, rows) in _permuted(tuple(entries)).items()
    }
    return Multilinear(n, terms)


@lru_cache
def _permuted(
    entries: tuple[tuple[int, ...], ...],
) -> dict[int, tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """For k = 2, 3 the indices of `Multilinear.terms`, and the entry of each."""
    found: dict[int, tuple[list[tuple[int, ...]], list[int]]] = {2: ([], []), 3: ([], [])}
    for row, index in enumerate(entries):
        places, rows = found[len(index) - 1]
        orders = set(itertools.permutations(index[1:]))
        places += [(index[0], *order) for order in orders]
        rows += [row] * len(orders)
    return {
        order: (
            np.array(places, dtype=np.intp).reshape(-1, order + 1),
            np.array(rows, dtype=np.intp),
        )
        for order, (places, rows) in found.items()
    }


def fold_form(forms: Multilinear, jacobian: Array, unit: Array | float = 1.0) -> float:
    """Quadratic coefficient a = ½⟨p, B(q, q)⟩ of a fold, |q| = 1, ⟨p, q⟩ = 1.

    Kuznetsov (2004), equation 5.26. Its sign depends on the orientation of q,
    whose largest component is positive. ``unit`` is the size of every state.
    """
    p, q = null_vectors(jacobian, unit)
    overlap = float(p @ q)
    # p and q are orthogonal at a Bogdanov-Takens point
    return float(0.5 * (p @ forms.form(q, q)).real / overlap) if overlap else np.nan


def cusp_form(forms: Multilinear, jacobian: Array, unit: Array | float = 1.0) -> float:
    """Cubic coefficient c of a cusp, y' = β₁ + β₂ y + c y³, |q| = 1, ⟨p, q⟩ = 1.

    c = ⟨p, C(q, q, q) + 3 B(q, h)⟩ / 6 with J h = −B(q, q) + ⟨p, B(q, q)⟩ q,
    ⟨p, h⟩ = 0 (Kuznetsov 2004, section 8.7.1). NaN if the eigenvalue zero is double.
    """
    p, q = null_vectors(jacobian, unit)
    overlap = float(p @ q)
    if abs(overlap) <= DOUBLE_ZERO * np.linalg.norm(p * unit) * np.linalg.norm(q / unit):
        return np.nan
    p = p / overlap
    bent = forms.form(q, q)
    h = solve_bordered(jacobian, p, q, -bent + (p @ bent) * q)
    cubic = forms.form(q, q, q) + 3.0 * forms.form(q, h)
    return float((p @ cubic).real / 6.0)


def solve_bordered(jacobian: Array, p: Array, q: Array, right: Array) -> Any:
    """Solve J h = r with ⟨p, h⟩ = 0, for the null vectors p, q of J and ⟨p, r⟩ = 0.

    Examples
    --------
    >>> p = q = np.array([1.0, 0.0])
    >>> solve_bordered(np.diag([0.0, -2.0]), p, q, np.array([0.0, 4.0])) + 0.0
    array([ 0., -2.])
    """
    bordered = np.block([[jacobian, q[:, None]], [p[None, :], np.zeros((1, 1))]])
    return np.linalg.solve(bordered, np.append(right, 0.0))[:-1]


def null_vectors(jacobian: Array, unit: Array | float = 1.0) -> tuple[Array, Array]:
    """Left and right unit null vectors; the largest component of the right one is positive.

    The matrix is balanced first, for accuracy independent of the units of the states. ``unit``,
    the size of every state, distinguishes rounding errors from small entries.

    Examples
    --------
    >>> _, q = null_vectors(np.array([[0.0, 1.0], [1e-17, -1.0]]))
    >>> [abs(round(c, 12)) for c in q.tolist()]
    [1.0, 0.0]
    """
    columns = np.array(np.broadcast_to(unit, len(jacobian)), dtype=float)
    rows = 1.0 / columns
    matrix = rows[:, None] * np.asarray(jacobian, dtype=float) * columns
    for _ in range(3):
        size = np.abs(matrix).max(axis=1)
        size[size == 0] = 1.0
        matrix, rows = matrix / size[:, None], rows / size
        size = np.abs(matrix).max(axis=0)
        # a column that is zero to rounding, as at a fold, is not scaled
        size[size < NULL_COLUMN] = 1.0
        matrix, columns = matrix / size, columns / size
    left, _, right = np.linalg.svd(matrix)
    p, q = rows * left[:, -1], columns * right[-1]
    p, q = p / np.linalg.norm(p), q / np.linalg.norm(q)
    return p, q if q[np.argmax(np.abs(q))] > 0 else -q


def first_lyapunov(forms: Multilinear, jacobian: Array, frequency: float) -> float:
    """First Lyapunov coefficient l₁ of a Hopf point, ⟨q, q⟩ = ⟨p, q⟩ = 1.

    Kuznetsov (2004), equation 5.34. In a plane with J = [[0, −ω], [ω, 0]] the
    coefficient a of Guckenheimer and Holmes (1983, equation 3.4.11) is ω l₁/2.
    NaN if another eigenvalue is 0 or 2iω, a pole of the coefficient.

    Examples
    --------
    >>> third = np.zeros((2, 2, 2, 2))  # of x' = −y − x³, y' = x
    >>> third[0, 0, 0, 0] = -6.0
    >>> forms = Multilinear.dense(np.zeros((2, 2, 2)), third)
    >>> round(first_lyapunov(forms, np.array([[0.0, -1.0], [1.0, 0.0]]), 1.0), 14)
    -0.75
    """
    value, size = lyapunov_terms(forms, jacobian, frequency)
    # zero to rounding: the Hopf point is degenerate
    return 0.0 if abs(value) <= 1e-12 * size else value


def lyapunov_at(field: FrozenField, region: int, u: Array, frequency: float) -> float:
    """First Lyapunov coefficient at a Hopf point, 0 where rounding of the point decides it."""

    def coefficient(v: Array) -> float:
        jacobian = field.residual_and_jacobian(region, v)[1][:, : field.n]
        return first_lyapunov(forms_at(field, region, v), jacobian, frequency)

    last_place = np.where(np.arange(len(u)) % 2, 1.0, -1.0) * np.finfo(float).eps
    value = coefficient(u)
    shifted = [coefficient(u * (1.0 + sign * last_place)) for sign in (1.0, -1.0)]
    return 0.0 if max(abs(one - value) for one in shifted) >= abs(value) else value


def lyapunov_terms(forms: Multilinear, jacobian: Array, frequency: float) -> tuple[float, float]:
    """First Lyapunov coefficient, and the sum of the absolute values of its terms."""
    n = len(jacobian)
    q = _eigenvector(jacobian, 1j * frequency)
    p = _eigenvector(jacobian.T, -1j * frequency)
    p = p / np.conj(np.vdot(p, q))
    conjugate = np.conj(q)
    try:
        straight = np.linalg.solve(jacobian, forms.form(q, conjugate))
        turning = np.linalg.solve(2j * frequency * np.eye(n) - jacobian, forms.form(q, q))
    except np.linalg.LinAlgError:
        return np.nan, np.nan
    terms = [
        np.vdot(p, forms.form(q, q, conjugate)),
        -2.0 * np.vdot(p, forms.form(q, straight)),
        np.vdot(p, forms.form(conjugate, turning)),
    ]
    unit = 2.0 * frequency
    return float(sum(terms).real / unit), float(sum(map(abs, terms)) / unit)


def _eigenvector(matrix: Array, value: complex) -> Vector:
    """Return the unit eigenvector of the eigenvalue nearest to a value."""
    values, vectors = np.linalg.eig(matrix)
    found: Vector = vectors[:, np.argmin(np.abs(values - value))]
    return found / np.linalg.norm(found)
