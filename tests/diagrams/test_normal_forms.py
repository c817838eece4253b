"""Normal-form coefficients against other formulas and closed forms."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.diagrams.points.normal_forms import Multilinear, first_lyapunov, fold_form

x, y, z, p, q = sp.symbols("x y z p q")
u1, u2, p1 = sp.symbols("u1 u2 p1")


def planar(rates, u, jacobian, omega):
    """The coefficient a of Guckenheimer and Holmes (1983), eq. 3.4.11, by mpmath at 40 digits.

    In coordinates y with x = [Re v, −Im v] y for an eigenvector v of length one,
    where it is ω l₁/4.
    """
    values, vectors = np.linalg.eig(jacobian)
    v = vectors[:, np.argmin(np.abs(values - 1j * omega))]
    v = v / np.linalg.norm(v)
    frame = mpmath.matrix(np.column_stack([v.real, -v.imag]).tolist())
    inverse = frame**-1
    with mpmath.workdps(40):

        def moved(k):
            def function(a, b):
                place = frame * mpmath.matrix([a, b])
                value = mpmath.matrix(rates(*[c + d for c, d in zip(u, place, strict=True)]))
                return (inverse * value)[k]

            return function

        def d(k, i, j):
            return mpmath.diff(moved(k), (0, 0), (i, j))

        cubic = d(0, 3, 0) + d(0, 1, 2) + d(1, 2, 1) + d(1, 0, 3)
        square = (
            d(0, 1, 1) * (d(0, 2, 0) + d(0, 0, 2))
            - d(1, 1, 1) * (d(1, 2, 0) + d(1, 0, 2))
            - d(0, 2, 0) * d(1, 2, 0)
            + d(0, 0, 2) * d(1, 0, 2)
        )
        # here J = [[0, −ω], [ω, 0]], as in their equation
        return float(cubic / 16 + square / (16 * omega))


def test_first_lyapunov_coefficient_of_the_reactor():
    """To 12 digits of the planar formula."""
    rate = p1 * (1 - u1) * sp.exp(u2)
    model = fs.Model({u1: -u1 + rate, u2: -3 * u2 + 14 * rate}, parameters={p1: 0})
    (hopf,) = fs.continue_equilibria(model, p1, (0, 0.2)).special("HB")
    level = hopf["p1"]

    def rates(a, b):
        hot = level * (1 - a) * mpmath.exp(b)
        return [-a + hot, -3 * b + 14 * hot]

    hot = level * np.exp(hopf["u2"])
    slope = hot * (1 - hopf["u1"])
    jacobian = np.array([[-1 - hot, slope], [-14 * hot, -3 + 14 * slope]])
    a = planar(rates, hopf.state.tolist(), jacobian, hopf.frequency)
    assert hopf.lyapunov == pytest.approx(4 * a / hopf.frequency, rel=1e-11)
    assert hopf.criticality == "supercritical"


def test_lorenz_is_subcritical():
    """Lorenz at σ = 10, β = 8/3 (Marsden and McCracken 1976)."""
    rho = sp.Symbol("rho")
    model = fs.Model(
        {x: 10 * (y - x), y: x * (rho - z) - y, z: x * y - sp.Rational(8, 3) * z},
        parameters={rho: 1},
    )
    found = fs.continue_equilibria(model, "rho", (0, 30)).special("HB")
    assert {h.criticality for h in found} == {"subcritical"}
    # the symmetry (x, y) → −(x, y) keeps it
    assert found[0].lyapunov == pytest.approx(found[1].lyapunov, rel=1e-10)


@settings(max_examples=25)
@given(
    st.floats(-3, 3), st.floats(-3, 3), st.floats(0.2, 5), st.floats(0.01, 100), st.integers(0, 9)
)
def test_the_sign_does_not_depend_on_coordinates(a, b, omega, unit, seed):
    """Rescaling the states by a number divides l₁ by its square; a rotation keeps it."""
    generator = np.random.default_rng(seed)
    second = generator.standard_normal((2, 2, 2))
    second = second + second.transpose(0, 2, 1)
    third = np.zeros((2, 2, 2, 2))
    third[0, 0, 0, 0], third[1, 1, 1, 1] = a, b
    turn = np.array([[0.0, -omega], [omega, 0.0]])
    plain = first_lyapunov(Multilinear.dense(second, third), turn, omega)
    scaled = first_lyapunov(Multilinear.dense(second / unit, third / unit**2), turn, omega)
    assert scaled == pytest.approx(plain / unit**2, rel=1e-9, abs=1e-12 / unit**2)
    c, s = np.cos(0.7), np.sin(0.7)
    r = np.array([[c, -s], [s, c]])
    rotated = Multilinear.dense(
        np.einsum("ia,abc,bj,ck->ijk", r, second, r.T, r.T),
        np.einsum("ia,abcd,bj,ck,dl->ijkl", r, third, r.T, r.T, r.T),
    )
    assert first_lyapunov(rotated, r @ turn @ r.T, omega) == pytest.approx(
        plain, rel=1e-9, abs=1e-10
    )


def test_a_degenerate_hopf_point_says_so():
    """r' = p r − r⁵: the cubic terms vanish."""
    r2 = x**2 + y**2
    model = fs.Model({x: (p - r2**2) * x - y, y: x + (p - r2**2) * y}, parameters={p: 0})
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 1)).special("HB")
    assert hopf.lyapunov == 0
    assert hopf.criticality == "degenerate"
    assert "degenerate" in hopf.description


def test_a_linear_centre_is_degenerate():
    model = fs.Model({x: y, y: p * y - x}, parameters={p: 0})
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 1)).special("HB")
    assert hopf.criticality == "degenerate"


def test_fold_coefficient_in_two_states():
    """x' = p − x² + xy, y' = −y: q = (1, 0), p = (1, ·), a = −1."""
    second = np.zeros((2, 2, 2))
    second[0, 0, 0] = -2.0
    second[0, 0, 1] = second[0, 1, 0] = 1.0
    assert fold_form(Multilinear.dense(second, np.zeros((2,) * 4)), np.diag([0.0, -1.0])) == -1.0
