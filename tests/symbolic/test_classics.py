"""derive() on classics of the field, each against numbers found in another way."""

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real
from tests.symbolic.symbolic_models import derived

pytestmark = pytest.mark.slow


def evaluated(named, values):
    at = {real(n): v for n, v in values.items()}
    return {n: complex(sp.sympify(e).subs(at).evalf(20)).real for n, e in named.items()}


def numeric_jacobian(region, values):
    at = {real(n): v for n, v in values.items()}
    return np.array(region.jacobian.subs(at).evalf(17), dtype=float)


def test_cusp():
    # p = ±2/(3√3), x = ∓1/√3 at q = 1
    points = [evaluated({**f.state, **f.parameters}, {"q": 1}) for f in derived("cusp")["S1"].folds]
    points.sort(key=lambda p: p["p"])
    assert [p["p"] for p in points] == pytest.approx([-2 / 27**0.5, 2 / 27**0.5], rel=1e-15)
    assert [p["x"] for p in points] == pytest.approx([3**-0.5, -(3**-0.5)], rel=1e-15)


def test_duffing_folds_are_double_roots():
    for fold in derived("duffing")["S1"].folds:
        load = evaluated(fold.parameters, {"a": -1, "b": 1})["w"]
        roots = np.sort(np.roots([-1, 0, 1, load]).real)
        # a double root of a companion matrix is good to half the digits
        assert np.min(np.diff(roots)) < 1e-7
    assert "trace" in derived("duffing")["S1"].no_hopf


def test_van_der_pol_folds():
    found = {(f.state["x"], f.parameters["y"]) for f in derived("van_der_pol")["S1"].folds}
    assert found == {(1, -sp.Rational(2, 3)), (-1, sp.Rational(2, 3))}


def test_fitzhugh_nagumo_hopf():
    values = {"a": 0.7, "b": 0.8, "epsilon": 0.08}
    region = derived("fitzhugh_nagumo")["S1"]
    found = sorted(
        evaluated({**h.state, **h.parameters, "square": h.frequency_squared}, values)["I"]
        for h in region.hopf
    )
    # trace = 1 − v² − bε by bisection, then w and I from the nullclines
    v = float(mpmath.findroot(lambda s: 1 - s * s - 0.064, 1.0))
    expected = sorted((s + 0.7) / 0.8 - s + s**3 / 3 for s in (v, -v))
    assert found == pytest.approx(expected, rel=1e-13)
    for h in region.hopf:
        at = values | evaluated({**h.state, **h.parameters}, values)
        eigenvalues = np.linalg.eigvals(numeric_jacobian(region, at))
        assert eigenvalues.real == pytest.approx(0, abs=1e-14)
        square = evaluated({"s": h.frequency_squared}, values)["s"]
        assert eigenvalues.imag.max() ** 2 == pytest.approx(square, rel=1e-13)


def test_lorenz():
    region = derived("lorenz")["S1"]
    values = {"sigma": 10, "beta": sp.Rational(8, 3), "rho": 28}
    states = sorted(evaluated(e.state, values)["x"] for e in region.equilibria)
    assert states == pytest.approx([-(72**0.5), 0, 72**0.5], rel=1e-15, abs=0)
    hopf = [h.parameters["rho"] for h in region.hopf]
    sigma, beta = real("sigma"), real("beta")
    assert {e.subs({sigma: 10, beta: sp.Rational(8, 3)}) for e in hopf} == {sp.Rational(470, 19)}
    assert [p.parameters["rho"] for p in region.branch_points] == [1]
    assert region.equilibria[0].stability.conditions == (real("rho") < 1,)


def test_hindmarsh_rose():
    region = derived("hindmarsh_rose")["S1"]
    values = {"a": 1, "b": 3, "c": 1, "d": 5, "I": 2}
    folds = sorted(evaluated({**f.state, **f.parameters}, values)["x"] for f in region.folds)
    # dz/dx = −3x² − 4x on the curve z = 3 − x³ − 2x²
    assert folds == pytest.approx(sorted(np.roots([-3, -4, 0])), rel=1e-14, abs=1e-15)
    hopf = sorted(
        (evaluated({**h.state, **h.parameters}, values) for h in region.hopf),
        key=lambda h: h["x"],
    )
    # trace −3x² + 6x − 1; at its smaller root the determinant is negative
    smaller, larger = np.sort(np.roots([-3, 6, -1]))
    assert hopf[-1]["x"] == pytest.approx(larger, rel=1e-14)
    assert hopf[-1]["z"] == pytest.approx(3 - larger**3 - 2 * larger**2, rel=1e-13)
    determinant = 3 * smaller**2 - 6 * smaller + 10 * smaller
    holds = [h.admissible for h in region.hopf]
    at = {real(n): v for n, v in values.items()}
    assert [bool(c.subs(at)) for c in holds] == [True, bool(determinant > 0)]


def test_chua():
    values = {"alpha": 9, "beta": 14.28, "m0": -8 / 7, "m1": -5 / 7}
    names = ("S1", "S2", "S3")
    found = [evaluated(derived("chua")[n].equilibria[0].state, values)["x"] for n in names]
    assert found == pytest.approx([1.5, 0, -1.5], rel=1e-14)
    (point, _) = derived("chua").boundary_equilibria
    assert point.parameters["m0"] == -1
    for name, slope in (("S1", -5 / 7), ("S2", -8 / 7)):
        region = derived("chua")[name]
        matrix = np.array([[-9 * (1 + slope), 9, 0], [1, -1, 1], [0, -14.28, 0]])
        coefficients = region.equilibria[0].stability.coefficients
        at = {real(n): v for n, v in values.items()}
        mine = [float(sp.sympify(a).subs(at)) for a in coefficients]
        assert mine == pytest.approx(np.poly(matrix), rel=1e-12)


def test_two_interfaces():
    values = {"a": 2, "b": 0.5}
    points = {
        (p.interface, p.regions): p
        for p in derived("two_interfaces").boundary_equilibria
        if p.possible is not False
    }
    persistent = points[("x - 1", ("S1", "S2"))]
    assert dict(persistent.parameters) == {"w": 2}
    assert persistent.type == "persistence"
    sides = [np.array([[-3.0, 1], [-1, -1]]), np.array([[-1.0, 1], [-1, -1]])]
    for weight in (0.0, 0.3, 1.0):
        matrix = weight * sides[0] + (1 - weight) * sides[1]
        mine = evaluated({"d": persistent.clarke.determinant}, {**values, "q": weight})["d"]
        assert mine == pytest.approx(np.linalg.det(matrix), rel=1e-14)
    other = points[("y", ("S2", "S4"))]
    assert dict(other.parameters) == {"w": 0}
    b = real("b")
    assert sp.simplify(other.test - 2 * (2 - b)) == 0
    assert sp.simplify(other.clarke.q_zero - (b - 2) / b) == 0


def test_stick_slip_on_a_moving_belt():
    outer, inner = derived("stick_slip")["S1"], derived("stick_slip")["S2"]
    k, mu, w = real("k"), real("mu"), real("w")
    assert sp.simplify(inner.equilibria[0].state["x"] - (w + mu) / k) == 0
    assert inner.equilibria[0].possible is True
    assert outer.equilibria[0].admissible == sp.false
    assert derived("stick_slip").boundary_equilibria == (), "the belt moves, the equilibrium rests"


def test_filippov_boundary_equilibria():
    points = {p.regions: p for p in derived("relay").boundary_equilibria}
    mu = real("mu")
    assert points[("S1", "S2")].parameters["w"] == 1 + mu
    assert points[("S2", "S1")].parameters["w"] == 1 - mu
    # H > 0 on the active side: CᵀN⁻¹E by numbers
    matrix = np.array([[0.0, 1], [-1, -0.1]])
    for (own, _), point in points.items():
        side = 1.0 if own == "S1" else -1.0
        jump = np.array([0, 2 * 0.5 * side])
        slope = np.array([side, 0]) @ np.linalg.solve(matrix, jump)
        assert evaluated({"t": point.test}, {"mu": 0.5, "d": 0.1})["t"] == pytest.approx(-slope)
        assert point.type == ("persistence" if slope < 0 else "non-smooth fold")
        assert point.verified


def test_auto_ab():
    # folds and Hopf at p2 = 14, p3 = 2: closed form with mpmath, 18 digits
    values = {"p2": 14, "p3": 2}
    region = derived("auto_ab")["S1"]
    folds = sorted(evaluated(f.parameters, values)["p1"] for f in region.folds)
    assert folds == pytest.approx([0.0889318461857728026, 0.105738978271650651], rel=1e-14)
    at = {real(n): v for n, v in values.items()}
    hopf = [
        evaluated(h.parameters, values)["p1"]
        for h in region.hopf
        if float(sp.sympify(h.frequency_squared).subs(at)) > 0
    ]
    assert hopf == pytest.approx([0.130900044820043325], rel=1e-14)
    folds17 = sorted(evaluated(f.parameters, {"p2": 17, "p3": 3})["p1"] for f in region.folds)
    assert folds17 == pytest.approx([0.117014750426704, 0.121901160810783], rel=1e-13)


def test_morris_lecar_folds_are_singular():
    region = derived("morris_lecar")["S1"]
    form = region.equilibria[0]
    (fold,) = region.folds
    v = real("v")
    condition = sp.lambdify(v, fold.equations[0], "mpmath")
    grid = np.arange(-60.0, 60.0)
    (first, *_) = [p for p in grid if condition(p) * condition(p + 1) < 0]
    root = mpmath.findroot(condition, (first, first + 1), solver="anderson")
    # the saddle-node on an invariant circle of this parameter set is known to lie at I = 39.96
    load = fold.parameters["I"].subs(v, sp.Float(root, 20)).evalf(20)
    assert float(load) == pytest.approx(39.96, abs=0.01)
    values = {"v": sp.Float(root, 20), "n": form.state["n"].subs(v, sp.Float(root, 20))}
    determinant = np.linalg.det(numeric_jacobian(region, values))
    assert determinant == pytest.approx(0, abs=1e-14)
    assert form.verified


def test_four_states():
    region = derived("four_states")["S1"]
    values = {"a": 1, "b": 2, "c": 1, "d": 0.5}
    form = region.equilibria[0]
    at = values | {"x1": 0.7}
    load = evaluated(form.parameters, at)["w"]
    state = evaluated(form.state, at | {"w": load})
    matrix = numeric_jacobian(region, values | state)
    coefficients = [
        float(sp.sympify(c).subs({real(n): v for n, v in at.items()}))
        for c in form.stability.coefficients
    ]
    assert coefficients == pytest.approx(np.poly(matrix), rel=1e-12)
    # Routh-Hurwitz against eigenvalues
    tests = [
        float(sp.sympify(c).subs({real(n): v for n, v in at.items()}))
        for c in form.stability.routh_hurwitz
    ]
    assert (min(tests) > 0) == (np.linalg.eigvals(matrix).real.max() < 0)


@pytest.mark.parametrize(
    "name",
    [
        "cusp",
        "fitzhugh_nagumo",
        "hindmarsh_rose",
        "van_der_pol",
        "van_der_pol_relaxation",
        "bilinear_oscillator",
        "gear_pair",
        "harmonic_gear",
        "stick_slip",
    ],
)
def test_every_form_of_a_ready_made_system_is_verified_exactly(name):
    model = getattr(fs.systems, name)()
    assert fs.derive(model.frozen()).check == "exact"


def test_stability_between_two_hopf_points_reads_as_intervals():
    w = real("w")
    (form,) = fs.derive(fs.systems.van_der_pol().frozen())["S1"].equilibria
    assert form.stability.conditions == (sp.Or(w > 1, w < -1),)


def test_node_or_focus_of_the_gear():
    x, a, d = real("x"), real("A"), real("D")
    derivation = fs.derive(fs.systems.harmonic_gear().frozen())
    test = derivation["S1"].stability.focus_test
    assert sp.expand(test - (4 * (3 * x**2 - 2 * d * x + a) - 1)) == 0
