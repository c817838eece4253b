"""Normal forms of the return map at bifurcations of periodic orbits.

An orbit that is not closed satisfies G(x, y) = 0, with the unknowns x of multiple shooting and the
state y after one period. On a center manifold x = X(w), with the normal form w → ν(w) of the return
map, G(X(w), E X(ν(w))) = 0 for all w, where E takes the first state of x. Its Taylor coefficients
are linear equations with the matrices A(λ) = G_x + λ G_y E, whose solvability determines the
coefficients of ν (Kuznetsov & Meijer 2005), without products of matrices along the orbit. Second
and third derivatives of G are differences of its exact Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.zeros import TEST_ROUNDING as ZERO
from fastslow.orbits.flow.shooting import Linearised, Shooting
from fastslow.orbits.points.location import bordered, closing, returning, row_units

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Steps of the differences in units of the scales, the first of which is used if the fourth-order
#: and the sixth-order difference agree to the fraction `AGREEING_DIFFERENCES`, or to rounding.
DIFFERENCE_STEPS = (3e-3, 5e-4, 8e-5)
AGREEING_DIFFERENCES = 1e-6
SLOPE_ROUNDING = 1e-13

#: Multiples of the step, and weights of the differences for the first and the second derivative.
RANGE = range(-3, 4)
FIRST = np.array([-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60])
SECOND = np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90])
FOURTH_ORDER = np.array([0.0, -1 / 12, 4 / 3, -5 / 2, 4 / 3, -1 / 12, 0.0])


#: A resonant coefficient below this fraction of its terms is zero.
VANISHING_RESONANCE = 1e-8


@dataclass(frozen=True, eq=False)
class Perturbation:
    """A first or higher coefficient of X, and of the state after one period.

    Parameters
    ----------
    x : ndarray, shape (N,)
    y : ndarray, shape (n,)
    """

    x: Complex
    y: Complex

    @property
    def conjugate(self) -> Perturbation:
        return Perturbation(self.x.conj(), self.y.conj())


@dataclass(frozen=True, eq=False)
class ReturnMap:
    """The linearisation and higher derivatives of the equations at one orbit.

    All vectors and matrices are in units of the scales.

    Parameters
    ----------
    shooting : Shooting
    u : ndarray
        Unknowns of an orbit.
    scale : ndarray
        Their units.
    """

    shooting: Shooting
    u: Array
    scale: Array

    @cached_property
    def last(self) -> Linearised:
        return self.shooting.linearised(self.u)

    @cached_property
    def rows(self) -> Array:
        return row_units(self.shooting, self.last, self.scale)

    @property
    def size(self) -> int:
        return self.shooting.size

    def matrix(self, multiplier: complex) -> Complex:
        """A(λ), in which a perturbation returns multiplied by λ."""
        found = returning(self.shooting, self.last, multiplier)
        return np.asarray(found * self.scale[: self.size] / self.rows[:, None])

    @cached_property
    def back(self) -> Array:
        """G_y, shape (N, n)."""
        n = self.shooting.variations.n
        return closing(self.shooting, self.last) * self.scale[:n] / self.rows[:, None]

    def closed(self, x: Complex, multiplier: complex, more: Complex | float = 0.0) -> Perturbation:
        """The perturbation x with the state λ E x + more after one period."""
        n = self.shooting.variations.n
        return Perturbation(x, multiplier * x[:n] + more)

    def returned(self, x: Complex) -> Complex:
        """G_y E x."""
        return np.asarray(self.back @ x[: self.back.shape[1]])

    def critical(self, multiplier: complex) -> tuple[Complex, Complex]:
        """Right and left null vectors of A(λ), the first of length one."""
        v, w, _ = bordered(self.matrix(multiplier))
        return v / np.linalg.norm(v), w / np.linalg.norm(w)

    def solve(self, multiplier: complex, right: Complex) -> Complex:
        """Solve A(λ) x = right; if λ is a multiplier, for the shortest solution."""
        return np.asarray(np.linalg.lstsq(self.matrix(multiplier), right, rcond=1e-11)[0])

    def along(self, one: Perturbation) -> MapDerivatives:
        """First and second derivatives of G' along a real perturbation."""
        n, N, scale = self.shooting.variations.n, self.size, self.scale
        length = max(float(np.abs(one.x).max()), float(np.abs(one.y).max()))
        if length == 0.0:
            nothing = np.zeros((N, N + n))
            return MapDerivatives(nothing, nothing, 0.0)
        move = np.zeros(len(self.u))
        move[:N] = one.x.real * scale[:N] / length
        turned = (one.y - one.x[:n]).real * scale[:n] / length
        for step in DIFFERENCE_STEPS:
            table = np.array([self._slopes(k * step * move, k * step * turned) for k in RANGE])
            second, other = (np.tensordot(weights, table, 1) for weights in (SECOND, FOURTH_ORDER))
            allowed = (
                AGREEING_DIFFERENCES * np.abs(second).max() + SLOPE_ROUNDING * np.abs(table).max()
            )
            if np.abs(second - other).max() <= allowed:
                break
        first, more = np.tensordot(FIRST, table, 1), (length / step) ** 2
        rounding = 0.1 * SLOPE_ROUNDING * float(np.abs(table).max()) * more
        return MapDerivatives(first * length / step, second * more, rounding)

    def _slopes(self, move: Array, turned: Array) -> Array:
        """G' = (G_x, G_y) at a displaced orbit, the state after one period displaced further."""
        n, N, scale = self.shooting.variations.n, self.size, self.scale
        shooting = replace(self.shooting, winding=self.shooting.winding + turned)
        last = shooting.linearised(self.u + move)
        G_y = closing(shooting, last)
        G_x = last.jacobian[:, :N].copy()
        G_x[:, :n] -= G_y
        return np.asarray(np.hstack([G_x * scale[:N], G_y * scale[:n]]) / self.rows[:, None])

    def along_pair(self, one: Perturbation) -> tuple[MapDerivatives, MapDerivatives]:
        """Derivatives along the real and the imaginary part of a perturbation."""
        parts = [Perturbation(part(one.x), part(one.y)) for part in (np.real, np.imag)]
        return self.along(parts[0]), self.along(parts[1])


@dataclass(frozen=True, eq=False)
class MapDerivatives:
    """Derivatives of G' = (G_x, G_y) along a real perturbation, each of shape (N, N + n).

    ``rounding`` is the size of errors of the second one.
    """

    first: Array
    second: Array
    rounding: float

    def bilinear(self, other: Perturbation) -> Complex:
        """B(p, q) for the perturbation p of this object."""
        return np.asarray(self.first @ np.concatenate([other.x, other.y]))

    def trilinear(self, other: Perturbation) -> Complex:
        """C(p, p, q) for the perturbation p of this object."""
        return np.asarray(self.second @ np.concatenate([other.x, other.y]))


def fold_terms(at: ReturnMap, q: Array | None = None) -> tuple[float, float]:
    """The quadratic term wᵀB(q, q) at a fold, and the size of its terms.

    Parameters
    ----------
    at : ReturnMap
    q : ndarray, shape (N,), optional
        A vector along which the null vector is oriented.
    """
    v, w, sign = oriented(at, 1.0)
    if q is not None and v.real @ q < 0:
        # w is oriented along v
        v, w = -v, -w
    one = at.closed(v, 1.0)
    along = at.along(one)
    bent = along.bilinear(one).real
    # errors of the first derivative are smaller by the step
    size = np.abs(bent) + DIFFERENCE_STEPS[0] * along.rounding / ZERO
    return sign * float(w.real @ bent), float(np.abs(w) @ size)


def oriented(at: ReturnMap, multiplier: float) -> tuple[Complex, Complex, float]:
    """Null vectors of A(±1), and the sign of the bordered determinant with both as borders."""
    matrix = at.matrix(multiplier).real
    v, w, _ = bordered(matrix)
    v, w = v / np.linalg.norm(v), w / np.linalg.norm(w)
    whole = np.block([[matrix, w.real[:, None]], [v.real[None], np.zeros((1, 1))]])
    return v, w, float(np.linalg.slogdet(whole)[0])


def overlap(at: ReturnMap, multiplier: float) -> tuple[float, float]:
    """Derivative of det A(λ) by λ at ±1 in units of the bordered determinant, and its unit.

    It vanishes where the multiplier is double.
    """
    v, w, sign = oriented(at, multiplier)
    back = at.returned(v).real
    return sign * float(w.real @ back), float(np.linalg.norm(back)) or 1.0


def flip_terms(at: ReturnMap) -> tuple[float, float]:
    """The cubic term at a period doubling without its denominator, and the size of its terms."""
    v, w, sign = oriented(at, -1.0)
    one = at.closed(v, -1.0)
    along = at.along(one)
    second = at.solve(1.0, -0.5 * along.bilinear(one))
    terms = along.trilinear(one) / 6.0, along.bilinear(at.closed(second, 1.0))
    size = np.abs(terms[0]) + np.abs(terms[1]) + along.rounding / ZERO
    return -sign * float(w.real @ (terms[0] + terms[1]).real), float(np.abs(w) @ size)


def torus_terms(at: ReturnMap, angle: float) -> tuple[float, float]:
    """Re(μ̄ c) at a torus bifurcation, and the size of its terms.

    The normal form is w → μ w + c w²w̄; negative values are supercritical.
    """
    mu = complex(np.exp(1j * angle))
    v, w = at.critical(mu)
    terms, _, derivatives = _cubic(at, v, mu)
    scale = 1.0 / complex(w @ at.returned(v))
    parts = -np.conj(mu) * scale * (w @ terms.T)
    size = np.abs(terms).sum(axis=0) + sum(one.rounding for one in derivatives) / ZERO
    return float(parts.sum().real), float(np.abs(scale) * (np.abs(w) @ size))


def _cubic(
    at: ReturnMap, v: Complex, mu: complex
) -> tuple[Complex, Complex, tuple[MapDerivatives, MapDerivatives]]:
    """Terms of w²w̄ in the homological equation, the coefficient h₂₀, and the derivatives."""
    one = at.closed(v, mu)
    real, imaginary = at.along_pair(one)

    def bilinear(other: Perturbation) -> Complex:
        return real.bilinear(other) + 1j * imaginary.bilinear(other)

    h20 = -at.solve(mu**2, bilinear(one))
    h11 = -at.solve(1.0, bilinear(one.conjugate))
    second = at.closed(h20, mu**2)
    # B(q̄, ·) is the conjugate derivative
    mixed = real.bilinear(second) - 1j * imaginary.bilinear(second)
    cubic = real.trilinear(one) + imaginary.trilinear(one)
    return (
        np.array([0.5 * cubic, bilinear(at.closed(h11, 1.0)), 0.5 * mixed]),
        h20,
        (real, imaginary),
    )


def cusp_form(at: ReturnMap) -> dict[str, float]:
    """Coefficient c of w → w + c w³ at a cusp of cycles."""
    v, w = at.critical(1.0)
    one = at.closed(v, 1.0)
    along = at.along(one)
    second = at.solve(1.0, -0.5 * along.bilinear(one))
    terms = along.trilinear(one) / 6.0 + along.bilinear(at.closed(second, 1.0))
    return {"c": float((-(w @ terms) / (w @ at.returned(v))).real) / _length(at, v) ** 2}


def fold_flip_form(at: ReturnMap) -> dict[str, float]:
    """Coefficients a ≥ 0, b and e of (w₁ + a w₁² + b w₂², −w₂ + e w₁w₂) at a fold-flip."""
    (v1, w1), (v2, w2) = at.critical(1.0), at.critical(-1.0)
    one, two = at.closed(v1, 1.0), at.closed(v2, -1.0)
    first, second = at.along(one), at.along(two)
    fold, flip = w1 @ at.returned(v1), w2 @ at.returned(v2)
    a, b = -0.5 * (w1 @ first.bilinear(one)) / fold, -0.5 * (w1 @ second.bilinear(two)) / fold
    e = -(w2 @ first.bilinear(two)) / flip
    # of both orientations of v₁ that with positive a
    size1, size2 = _length(at, v1) * (1.0 if a.real >= 0 else -1.0), _length(at, v2)
    return {
        "a": float(a.real) / size1,
        "b": float(b.real) * size1 / size2**2,
        "e": float(e.real) / size1,
    }


def first_resonance(at: ReturnMap) -> dict[str, float]:
    """Coefficients a ≥ 0 and b of (w₁ + w₂, w₂ + a w₁² + b w₁w₂) at a 1:1 resonance."""
    v, w = at.critical(1.0)
    other = at.solve(1.0, -at.returned(v))
    n = at.shooting.variations.n
    one, two = at.closed(v, 1.0), Perturbation(other, other[:n] + v[:n])
    along, down = at.along(one), w @ at.returned(other)
    bent = along.bilinear(one)
    a = -0.5 * (w @ bent) / down
    h20 = 2.0 * at.solve(1.0, -0.5 * bent - a * at.returned(other))
    b = -(w @ (at.returned(h20) + along.bilinear(two))) / down
    size = _length(at, v) * (1.0 if a.real >= 0 else -1.0)
    return {"a": float(a.real) / size, "b": float(b.real) / size}


def second_resonance(at: ReturnMap) -> dict[str, float]:
    """Coefficients C and D of (−w₁ + w₂, −w₂ + C w₁³ + D w₁²w₂) at a 1:2 resonance."""
    v, w = at.critical(-1.0)
    other = at.solve(-1.0, -at.returned(v))
    n = at.shooting.variations.n
    one, two = at.closed(v, -1.0), Perturbation(other, v[:n] - other[:n])
    along, beside, down = at.along(one), at.along(two), w @ at.returned(other)
    h20 = -at.solve(1.0, along.bilinear(one))
    h11 = -at.solve(1.0, along.bilinear(two) - at.returned(h20))
    second, mixed = at.closed(h20, 1.0), at.closed(h11, 1.0, -h20[:n])
    terms = 0.5 * along.bilinear(second) + along.trilinear(one) / 6.0
    C = -(w @ terms) / down
    h30 = 6.0 * at.solve(-1.0, -terms - C * at.returned(other))
    rest = along.bilinear(mixed) + 0.5 * beside.bilinear(second) + 0.5 * along.trilinear(two)
    D = -(w @ (0.5 * at.returned(h30) + rest)) / down
    size = _length(at, v) ** 2
    return {"C": float(C.real) / size, "D": float(D.real) / size}


def third_resonance(at: ReturnMap) -> dict[str, float]:
    """Modulus of b in w → μ w + b w̄² + … at a 1:3 resonance."""
    mu = complex(np.exp(2j * np.pi / 3))
    v, w = at.critical(mu)
    one = at.closed(v, mu)
    real, imaginary = at.along_pair(one)
    bent = (real.bilinear(one) + 1j * imaginary.bilinear(one)).conj()
    down = complex(w @ at.returned(v))
    b, size = 0.5 * abs(complex(w @ bent)), 0.5 * float(np.abs(w) @ np.abs(bent))
    return {"b": (b if b > VANISHING_RESONANCE * size else 0.0) / abs(down) / _length(at, v)}


def fourth_resonance(at: ReturnMap) -> dict[str, float]:
    """Real and imaginary part of A = −i c / |d| for w → i w + c w²w̄ + d w̄³ at 1:4."""
    v, w = at.critical(1j)
    one = at.closed(v, 1j)
    terms, h20, (real, imaginary) = _cubic(at, v, 1j)
    down = w @ at.returned(v)
    c = -(w @ terms.sum(axis=0)) / down
    # (1 − i) q has the real part Re q + Im q
    both = at.along(Perturbation((1 - 1j) * one.x, (1 - 1j) * one.y))
    second = at.closed(h20, -1.0)
    cross = 0.5 * (both.trilinear(one) - real.trilinear(one) - imaginary.trilinear(one))
    cubed = real.trilinear(one) - imaginary.trilinear(one) + 2j * cross
    mixed = real.bilinear(second) + 1j * imaginary.bilinear(second)
    parts = np.array([cubed / 6.0, 0.5 * mixed]).conj()
    d = -(w @ parts.sum(axis=0)) / down
    size = float(np.abs(w) @ np.abs(parts).sum(axis=0)) / abs(complex(down))
    A = (
        -1j * c / abs(complex(d))
        if abs(complex(d)) > VANISHING_RESONANCE * size
        else np.nan + 1j * np.nan
    )
    return {"A_re": float(A.real), "A_im": float(A.imag)}


def _length(at: ReturnMap, v: Complex) -> float:
    """Length of the first state of a perturbation."""
    n = at.shooting.variations.n
    return float(np.linalg.norm(v[:n] * at.scale[:n]))
