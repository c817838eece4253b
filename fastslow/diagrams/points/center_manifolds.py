"""Normal forms of codimension-two points on their center manifolds.

With critical eigenvectors q_i and amplitudes w_i the manifold is x = x₀ + Σ w_i q_i +
Σ h_α w^α and the flow on it ẇ_i = λ_i w_i + Σ g_{i,α} w^α. The coefficients solve the
homological equation F(x(w)) = x_w ẇ, degree by degree; g_{i,α} is non-zero for
λ·α = λ_i only (Kuznetsov 1999, 2004 section 8.7; Coullet and Spiegel 1983).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.normal_forms import null_vectors

if TYPE_CHECKING:
    import sympy as sp

    from fastslow.diagrams.points.jets import Jet, JetSpace

Array = NDArray[np.float64]
Power = tuple[int, ...]


#: Relative difference below which a combination of critical eigenvalues is resonant.
RESONANT = 1e-9

#: A coefficient below this fraction of the largest of its order is zero to rounding.
VANISHING_COEFFICIENT = 1e-10


class NoNormalForm(Exception):
    """Error for undefined coefficients, with the reason."""


@dataclass(frozen=True, eq=False)
class Manifold:
    """Critical eigenvalues with their eigenvectors and resonant monomials.

    Parameters
    ----------
    values : ndarray, shape (m,)
    right, left : ndarray, shape (n, m)
        Unit columns q_i and p_i, ⟨p_i, q_j⟩ = δ_ij.
    resonant : callable
        Function of exponents and the number of an amplitude, whether the monomial is resonant
        in its equation.
    """

    values: NDArray[np.complex128]
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]
    resonant: Callable[[Power, int], bool]


def generalized_hopf(
    field: FrozenField, region: int, u: Array, frequency: float
) -> dict[str, float]:
    """Second Lyapunov coefficient l₂ = Re c₂/ω of ẇ = iω w + c₁ w|w|² + c₂ w|w|⁴.

    Kuznetsov (2004), section 8.3.2, for a unit eigenvector.
    """
    manifold = _manifold(field, region, u, [1j * frequency, -1j * frequency], _hopf)
    g = _normal_form(field, region, u, manifold, 5)
    return {"l2": float(g[0][3, 2].real / frequency)}


def zero_hopf(
    field: FrozenField, region: int, u: Array, frequency: float, unit: Array | float = 1.0
) -> dict[str, float]:
    """Coefficients s, θ and E of a zero-Hopf point.

    For ẋ = x² + s r², ṙ = θ x r + E x² r up to scaling (Kuznetsov 2004, section 8.5; E is that
    of the amplitudes for unit eigenvectors): s = sign(ab), θ = Re e/(2a) and
    E = Re f + Re e (Re g/b + d/(2b) − 3c/(2a)) − a Re g/b in the Poincaré normal form
    ẇ₀ = a w₀² + b|w₁|² + c w₀³ + d w₀|w₁|², ẇ₁ = iω w₁ + e w₀w₁ + f w₀²w₁ + g w₁|w₁|².
    ``unit`` is the size of every state. Raises NoNormalForm if a or b vanishes.
    """
    manifold = _manifold(field, region, u, [0.0, 1j * frequency, -1j * frequency], _zero_hopf)
    zero, pair, _ = _normal_form(field, region, u, manifold, 3)
    a, b, c, d = (zero[p].real for p in ((2, 0, 0), (0, 1, 1), (3, 0, 0), (1, 1, 1)))
    e, f, g = (pair[p].real for p in ((1, 1, 0), (2, 1, 0), (0, 2, 1)))
    # with both amplitudes in units of the states
    one, two = (np.linalg.norm(manifold.right[:, k] / unit) for k in (0, 1))
    terms = {"a": abs(a) / one, "b": abs(b) * one / two**2, "e": abs(e) / one}
    for name in ("a", "b"):
        if terms[name] <= VANISHING_COEFFICIENT * max(terms.values()):
            raise NoNormalForm(f"s, theta and E undefined because {name} = 0")
    return {
        "s": float(np.sign(a * b)),
        "theta": float(e / (2.0 * a)),
        "E": float(f + e * (g / b + d / (2.0 * b) - 3.0 * c / (2.0 * a)) - a * g / b),
    }


def double_hopf(
    field: FrozenField,
    region: int,
    u: Array,
    frequencies: tuple[float, float],
    unit: Array | float = 1.0,
) -> dict[str, float]:
    """Coefficients p₁₁, p₁₂, p₂₁, p₂₂ with θ = p₁₂/p₂₂ and δ = p₂₁/p₁₁, faster pair first.

    For ṙ₁ = r₁ (p₁₁ r₁² + p₁₂ r₂²), ṙ₂ = r₂ (p₂₁ r₁² + p₂₂ r₂²) (Kuznetsov 2004,
    section 8.6, equations 8.89 and 8.90), for unit eigenvectors. If p₁₁ or p₂₂ vanishes
    θ and δ are omitted. ``unit`` is the size of every state.
    """
    fast, slow = sorted(frequencies, reverse=True)
    values = [1j * fast, -1j * fast, 1j * slow, -1j * slow]
    manifold = _manifold(field, region, u, values, _double_hopf)
    g = _normal_form(field, region, u, manifold, 3)
    p11, p12 = g[0][2, 1, 0, 0].real, g[0][1, 0, 1, 1].real
    p21, p22 = g[2][1, 1, 1, 0].real, g[2][0, 0, 2, 1].real
    numbers = {"p11": p11, "p12": p12, "p21": p21, "p22": p22}
    one, two = (np.linalg.norm(manifold.right[:, k] / unit) ** 2 for k in (0, 2))
    sizes = np.abs([p11 / one, p22 / two, p12 / two, p21 / one])
    if sizes[:2].min() > VANISHING_COEFFICIENT * sizes.max():
        numbers |= {"theta": p12 / p22, "delta": p21 / p11}
    return {name: float(value) for name, value in numbers.items()}


def bogdanov_takens(
    field: FrozenField, region: int, u: Array, unit: Array | float = 1.0
) -> dict[str, float]:
    """Coefficients a and b of ẇ₀ = w₁, ẇ₁ = a w₀² + b w₀w₁ at a Bogdanov-Takens point.

    a = ½ ⟨p₁, B(q₀, q₀)⟩, b = ⟨p₀, B(q₀, q₀)⟩ + ⟨p₁, B(q₀, q₁)⟩ with J q₀ = 0, J q₁ = q₀,
    Jᵀp₁ = 0, Jᵀp₀ = p₁, |q₀| = 1, ⟨q₀, q₁⟩ = 0, ⟨p₀, q₀⟩ = ⟨p₁, q₁⟩ = 1, ⟨p₀, q₁⟩ = 0
    (Kuznetsov 2005). Both change sign with the orientation of q₀, whose largest
    component is positive. ``unit`` is the size of every state.
    """
    n = field.n
    from fastslow.diagrams.points.jets import JetSpace

    matrix = field.residual_and_jacobian(region, u)[1][:, :n]
    left, q0 = null_vectors(matrix, unit)
    bordered = np.block([[matrix, left[:, None]], [q0[None, :], np.zeros((1, 1))]])
    q1 = np.linalg.solve(bordered, np.append(q0, 0.0))[:n]
    p1 = left / (left @ q1)
    p0 = np.linalg.solve(bordered.T, np.append(p1, 0.0))[:n]
    # the solution is determined up to multiples of p₁, fixed by ⟨p₀, q₁⟩ = 0
    p0 = p0 - (p0 @ q1) * p1
    space = JetSpace(2, 2)
    plane = np.outer(q0, space.variable(0)) + np.outer(q1, space.variable(1))
    image = _image(field, region, u, space, plane)
    square = 2.0 * image[:, space.number[2, 0]].real
    mixed = image[:, space.number[1, 1]].real
    return {"a": float(0.5 * p1 @ square), "b": float(p0 @ square + p1 @ mixed)}


def zero_hopf_case(form: dict[str, float]) -> str:
    """Describe the signs of s and θ; tori bifurcate if they differ (Kuznetsov 2004, sec. 8.5.2)."""
    if not form:
        return "resonant or degenerate"
    positive = form["theta"] > 0
    torus = ", with tori" if (form["s"] > 0) != positive else ""
    return f"s = {form['s']:+.0f}, θ {'>' if positive else '<'} 0{torus}"


def double_hopf_case(form: dict[str, float]) -> str:
    """Classify as simple (p₁₁p₂₂ > 0) or difficult, with the case in Kuznetsov 2004, sec. 8.6."""
    if "theta" not in form:
        return "resonant or degenerate"
    high = max(form["theta"], form["delta"])
    low = min(form["theta"], form["delta"])
    product = high * low
    if form["p11"] * form["p22"] > 0:
        if low > 0:
            return "simple, case I" if product > 1 else "simple, case II"
        if high > 0:
            return "simple, case III"
        return "simple, case IV" if product < 1 else "simple, case V"
    if low > 0:
        if product < 1:
            return "difficult, case III"
        return "difficult, case I" if low > 1 else "difficult, case II"
    if high > 0:
        return "difficult, case IV"
    return "difficult, case V" if product < 1 else "difficult, case VI"


def _hopf(power: Power, k: int) -> bool:
    return power[k] == power[1 - k] + 1


def _zero_hopf(power: Power, k: int) -> bool:
    return power[1] - power[2] == (0, 1, -1)[k]


def _double_hopf(power: Power, k: int) -> bool:
    first, second = power[0] - power[1], power[2] - power[3]
    return (first, second) == ((1, 0), (-1, 0), (0, 1), (0, -1))[k]


def _manifold(
    field: FrozenField,
    region: int,
    u: Array,
    wanted: list[complex],
    resonant: Callable[[Power, int], bool],
) -> Manifold:
    """Return right and dual left eigenvectors of the eigenvalues nearest to those wanted."""
    matrix = field.residual_and_jacobian(region, u)[1][:, : field.n]
    values, vectors = np.linalg.eig(matrix)
    duals, adjoint = np.linalg.eig(matrix.T)
    right = np.zeros((field.n, len(wanted)), dtype=complex)
    left = np.zeros_like(right)
    for k, value in enumerate(wanted):
        if k and wanted[k - 1] == np.conj(value) != value:
            right[:, k], left[:, k] = right[:, k - 1].conj(), left[:, k - 1].conj()
            continue
        q = vectors[:, np.argmin(np.abs(values - value))]
        right[:, k] = q / np.linalg.norm(q)
        p = adjoint[:, np.argmin(np.abs(duals - np.conj(value)))]
        left[:, k] = p / np.conj(np.vdot(p, right[:, k]))
    return Manifold(np.array(wanted, dtype=complex), right, left, resonant)


def _normal_form(
    field: FrozenField, region: int, u: Array, manifold: Manifold, degree: int
) -> list[dict[Power, complex]]:
    """Return the coefficients g_{i,α} of all resonant monomials up to a degree.

    Raises NoNormalForm if another eigenvalue is in resonance with the critical ones.
    """
    from fastslow.diagrams.points.jets import JetSpace

    n, m = manifold.right.shape
    space = JetSpace(m, degree)
    matrix = field.residual_and_jacobian(region, u)[1][:, :n]
    spectrum = np.linalg.eigvals(matrix)
    near = RESONANT * np.abs(manifold.values).max()
    amplitudes = np.array([space.variable(k) for k in range(m)])
    # jets of the manifold and of the flow on it
    shape = manifold.right @ amplitudes
    flow = manifold.values[:, None] * amplitudes
    found: list[dict[Power, complex]] = [{} for _ in range(m)]
    for order in range(2, degree + 1):
        image = _image(field, region, u, space, shape)
        moved = np.zeros_like(shape)
        for k in range(m):
            for i in range(n):
                moved[i] += space.product(space.derivative(shape[i], k), flow[k])
        places = [p for p in space.powers if sum(p) == order]
        rest = image - moved
        for power in places:
            at = space.number[power]
            right = rest[:, at].copy()
            kept = [k for k in range(m) if manifold.resonant(power, k)]
            for k in kept:
                value = complex(np.vdot(manifold.left[:, k], right))
                found[k][power] = value
                flow[k, at] = value
            for k in kept:
                right = right - found[k][power] * manifold.right[:, k]
            combined = complex(manifold.values @ np.array(power))
            if np.sum(np.abs(spectrum - combined) <= near) > len(kept):
                raise NoNormalForm(
                    f"undefined because of a resonance: {combined:.6g}, a sum of its critical "
                    "eigenvalues, is an eigenvalue"
                )
            left = combined * np.eye(n) - matrix
            columns, rows = manifold.right[:, kept], manifold.left[:, kept].conj().T
            bordered = np.block([[left, columns], [rows, np.zeros((len(kept), len(kept)))]])
            shape[:, at] = np.linalg.solve(bordered, np.append(right, np.zeros(len(kept))))[:n]
    return found


def _image(
    field: FrozenField, region: int, u: Array, space: JetSpace, shape: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return jets of the rates at u plus jets of the states, (n, m)."""
    from fastslow.model.structure import real

    n, model = field.n, field.model
    numbers = dict(model.parameters) | dict(zip(field.varying, u[n:].tolist(), strict=True))
    given: dict[sp.Symbol, Jet] = {real(k): space.constant(v) for k, v in numbers.items()}
    for name, value, jet in zip(model.states, u[:n], shape, strict=True):
        given[real(name)] = jet + space.constant(value)
    return np.array([space.evaluate(rate, given) for rate in field.rates(region)])
