"""Curves of special points in two parameters, and what they meet, against closed forms."""

import pickle

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, v, w, p, q, rho, sigma = sp.symbols("x y z v w p q rho sigma")
u1, u2, p1, p2, p3 = sp.symbols("u1 u2 p1 p2 p3")


@pytest.fixture(scope="module")
def reactor():
    """AUTO's demo ab; its fold curve holds a BT point and a cusp, on which AUTO stops."""
    rate = p1 * (1 - u1) * sp.exp(u2)
    model = fs.Model(
        {u1: -u1 + rate, u2: -u2 + p2 * rate - p3 * u2}, parameters={p1: 0, p2: 14, p3: 2}
    )
    return fs.continue_equilibria(model, p1, (0, 0.2))


PLANE = {"p1": (0, 0.3), "p2": (8, 20)}


def test_reactor_folds_meet_bogdanov_takens_and_cusp(reactor):
    """Closed form (mpmath): BT at p1 = e^(−3/2)/2, p2 = 13.5; CP at p1 = e^(−2), p2 = 12."""
    curve = fs.continue_points(reactor.folds[0], ("p1", "p2"), over=PLANE)
    (bt,), (cusp,) = curve.special("BT"), curve.special("CP")
    assert [bt["p1"], bt["p2"]] == pytest.approx([np.exp(-1.5) / 2, 13.5], rel=1e-14)
    assert [cusp["p1"], cusp["p2"]] == pytest.approx([np.exp(-2), 12], rel=1e-14)
    assert np.abs(bt.eigenvalues).max() < 1e-7
    assert bt.residual < 1e-12
    assert cusp.accuracy < 1e-13
    # folds at u2 solve p3 + 1 = u2 (p2 - …): here −det J = 0 along all rows, and F = 0
    hot = curve["p1"] * (1 - curve["u1"]) * np.exp(curve["u2"])
    assert np.abs(hot - curve["u1"]).max() < 1e-13
    assert np.abs(curve["p2"] * hot - 3 * curve["u2"]).max() < 1e-12
    assert np.abs(np.prod(curve.eigenvalues, axis=1)).max() < 1e-11
    assert [o.code for o in curve.outcomes] == ["end of range"] * 2
    assert curve.values[[0, -1], 1].tolist() == [20, 20]


def test_reactor_hopf_curve_ends_in_neutral_saddles_at_the_same_point(reactor):
    curve = fs.continue_points(reactor.special("HB")[0], ("p1", "p2"), over=PLANE)
    (bt,) = curve.special("BT")
    assert [bt["p1"], bt["p2"]] == pytest.approx([np.exp(-1.5) / 2, 13.5], rel=1e-14)
    assert set(curve.codes) == {"HB", "NSD"}
    assert np.abs(curve.eigenvalues.sum(axis=1)).max() < 1e-11
    hopf = curve.codes == "HB"
    products = np.prod(curve.eigenvalues, axis=1).real
    assert np.all(products[hopf] > -1e-9)
    assert np.all(products[~hopf] < 1e-9)
    # l₁ changes sign at the generalized Hopf point
    (gh,) = curve.special("GH")
    row = curve.special_rows[curve.special.index(gh)]
    assert curve.coefficient[row - 1] * curve.coefficient[row + 1] < 0
    assert abs(curve.coefficient[row]) < 1e-12


def test_curves_start_from_a_bogdanov_takens_point(reactor):
    folds = fs.continue_points(reactor.folds[0], ("p1", "p2"), over=PLANE)
    (bt,) = folds.special("BT")
    hopf = fs.continue_points(bt, ("p1", "p2"), over=PLANE)
    assert hopf.code == "HB"
    assert len(hopf.special("GH")) == 1
    again = fs.continue_points(bt, ("p1", "p2"), over=PLANE, code="LP")
    assert [c["p2"] for c in again.special("CP")] == pytest.approx([12], rel=1e-14)
    (cusp,) = folds.special("CP")
    assert fs.continue_points(cusp, ("p1", "p2"), over=PLANE).special("BT")


def test_cusp_of_the_normal_form():
    """x' = p + q x − x³: folds on p² = 4q³/27, the cusp at the origin with c = −1."""
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    curve = fs.continue_points(fold, (p, q), over={p: (-1, 1), q: (-1, 2)})
    assert np.abs(curve["p"] ** 2 - 4 * curve["q"] ** 3 / 27).max() < 1e-14
    (cusp,) = curve.special("CP")
    assert np.abs([cusp["p"], cusp["q"], cusp["x"]]).max() < 1e-12
    assert cusp.coefficient == pytest.approx(-1, rel=1e-12)
    # a = −3x along the folds
    assert curve.coefficient == pytest.approx(-3 * curve["x"], abs=1e-11)
    assert "cusp" in repr(curve)


def test_gear_folds_meet_the_interface(folded_gear):
    """Folds of S1 in (w, A): fold meets x = D at A = −D², w = 0; virtual cusp at x = D/3."""
    diagram = fs.continue_equilibria(folded_gear.frozen(), "w", (-0.3, 0.3))
    fold = next(f for f in diagram.folds if f["x"] > 0)
    curve = fs.continue_points(fold, ("w", "A"), over={"w": (-1, 1), "A": (-2, 2)})
    (corner,), (cusp,) = curve.special("BF"), curve.special("CP")
    assert [corner["w"], corner["A"], corner["x"]] == pytest.approx([0, -0.0625, 0.25], abs=1e-15)
    assert corner.interface == "x - D"
    assert corner.admissible
    assert [cusp["A"], cusp["x"]] == pytest.approx([0.0625 / 3, 0.25 / 3], rel=1e-12)
    assert not cusp.admissible
    assert np.all(curve.admissible == (curve["x"] >= 0.25 - 1e-9))
    # x = (D + √(D² − 3A))/3 on the admissible part
    real = curve.admissible
    closed = (0.25 + np.sqrt(0.0625 - 3 * curve["A"][real])) / 3
    assert curve["x"][real] == pytest.approx(closed, rel=1e-13)
    ending = fs.continue_points(fold, ("w", "A"), over={"w": (-1, 1), "A": (-2, 2)}, virtual=False)
    assert {o.code for o in ending.outcomes} == {"end of range", "left the region"}


def test_gear_folds_and_corners_over_the_gap(folded_gear):
    diagram = fs.continue_equilibria(folded_gear.frozen(), "w", (-0.3, 0.3))
    over = {"w": (-1, 1), "D": (0.01, 2)}
    (corner,) = fs.continue_points(diagram.folds[0], ("w", "D"), over=over).special("BF")
    assert [corner["w"], corner["D"]] == pytest.approx([0, np.sqrt(0.6)], abs=1e-14)
    # the same point on the curve of boundary equilibria, and both curves from it
    point = diagram.boundary_equilibria[0]
    edge = fs.continue_points(point, ("w", "A"), over={"w": (-1, 1), "A": (-2, 2)})
    (fold,) = edge.special("BF")
    assert [fold["w"], fold["A"]] == pytest.approx([0, -0.0625], abs=1e-15)
    assert edge["x"] == pytest.approx(np.full(len(edge), point["x"]), abs=1e-15)
    folds = fs.continue_points(fold, ("w", "A"), over={"w": (-1, 1), "A": (-2, 2)}, code="LP")
    assert folds.special("CP")
    back = fs.continue_points(fold, ("w", "A"), over={"w": (-1, 1), "A": (-2, 2)})
    assert back.code == "BE"


def test_boundary_equilibria_change_type_where_a_determinant_vanishes():
    """x' = p + q x + |x|: at x = 0 the slopes are q ± 1, a non-smooth fold for |q| < 1."""
    model = fs.Model({x: p + q * x + sp.Abs(x)}, parameters={p: 0, q: 0})
    (corner,) = fs.continue_equilibria(model, "p", (-1, 1)).boundary_equilibria
    assert corner.type == "non-smooth fold"
    curve = fs.continue_points(corner, ("p", "q"), over={"p": (-1, 1), "q": (-2, 2)})
    found = {f.regions[0]: f["q"] for f in curve.special("BF")}
    assert found == pytest.approx({"S1": -1, "S2": 1}, abs=1e-14)


def test_lorenz_hopf_curve_and_pitchforks():
    """ρ = σ(σ + β + 3)/(σ − β − 1); the pitchfork stays at ρ = 1 by symmetry."""
    beta = sp.Rational(8, 3)
    model = fs.Model(
        {x: sigma * (y - x), y: x * (rho - z) - y, z: x * y - beta * z},
        parameters={rho: 1, sigma: 10},
    )
    diagram = fs.continue_equilibria(model, "rho", (0, 30))
    curve = fs.continue_points(
        diagram.special("HB")[0], ("rho", "sigma"), over={"rho": (5, 60), "sigma": (5, 40)}
    )
    s, b = curve["sigma"], 8 / 3
    assert curve["rho"] == pytest.approx(s * (s + b + 3) / (s - b - 1), rel=1e-13)
    assert 0 < np.argmin(curve["rho"]) < len(curve) - 1
    forks = fs.continue_points(
        diagram.special("BP")[0], ("rho", "sigma"), over={"rho": (0, 5), "sigma": (1, 20)}
    )
    assert forks["rho"] == pytest.approx(np.ones(len(forks)), abs=1e-9)
    assert [o.code for o in forks.outcomes] == ["end of range"] * 2


def test_branch_points_without_symmetry_are_isolated():
    """x' = p + q x − x³ has a branch point over q at p = 0 alone."""
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    point = fs.continue_equilibria(model, "q", (-1, 1)).special("BP")[0]
    curve = fs.continue_points(point, ("q", "p"), over={"q": (-1, 1), "p": (-1, 1)})
    assert curve.outcome.code == "no branch point"
    assert "symmetry" in curve.outcome.message


def test_generalized_hopf_of_the_bautin_normal_form():
    """r' = p r + q r³ − r⁵, θ' = 2: Hopf points at p = 0 with l₁ = q, GH at q = 0."""
    r2 = x**2 + y**2
    growth = p + q * r2 - r2**2
    model = fs.Model({x: growth * x - 2 * y, y: 2 * x + growth * y}, parameters={p: 0, q: 1})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    (hopf,) = diagram.special("HB")
    # a = q of Guckenheimer and Holmes, l₁ = 2a/ω
    assert hopf.lyapunov == pytest.approx(1, rel=1e-13)
    assert hopf.criticality == "subcritical"
    assert (
        fs.continue_equilibria(model.with_parameters(q=-1), "p", (-1, 1))
        .special("HB")[0]
        .criticality
        == "supercritical"
    )
    curve = fs.continue_points(hopf, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    (gh,) = curve.special("GH")
    assert np.abs([gh["p"], gh["q"]]).max() < 1e-14
    assert gh.frequency == pytest.approx(2, rel=1e-14)
    # |q| = 1: r = √2 |w|, so that c₂ = −4
    assert gh.normal_form["l2"] == pytest.approx(-2, rel=1e-12)
    assert curve.coefficient == pytest.approx(curve["q"], abs=1e-12)


def turned(rates):
    """The same system seen in other coordinates, so that no state decouples."""
    states = [x, y, z]
    matrix = sp.Matrix([[1, 1, 0], [0, 1, 2], [1, 0, 1]])
    inside = dict(zip(states, matrix.inv() * sp.Matrix(states), strict=True))
    old = sp.Matrix([r.subs(inside, simultaneous=True) for r in rates])
    return dict(zip(states, matrix * old, strict=True))


def test_zero_hopf():
    """x' = p + x², a pair q + x ± 2i: folds p = 0, Hopf p = −q², both through the origin."""
    model = fs.Model(
        turned([p + x**2 - y**2, (q + x) * y - 2 * z - y**3, 2 * y + (q + x) * z]),
        parameters={p: -1, q: sp.Rational(1, 2)},
    )
    over = {"p": (-0.4, 0.2), "q": (-0.3, 0.6)}
    # x = −1, y = z = 0 in the coordinates of `turned`
    start = {x: -1, y: 0, z: -1, p: -1}
    diagram = fs.continue_equilibria(model, "p", (-1, 0.5), from_points=[start])
    folds = fs.continue_points(diagram.folds[0], ("p", "q"), over=over)
    hopf = fs.continue_points(diagram.special("HB")[0], ("p", "q"), over=over)
    for curve in (folds, hopf):
        (point,) = curve.special("ZH")
        assert np.abs([point["p"], point["q"]]).max() < 1e-13
        assert point.frequency == pytest.approx(2, rel=1e-12)
        assert not curve.special("BT")
    assert hopf["p"] == pytest.approx(-(hopf["q"] ** 2), abs=1e-12)
    (point,) = folds.special("ZH")
    near = {"p": (-0.1, 0.1), "q": (-0.1, 0.1)}
    assert fs.continue_points(point, ("p", "q"), over=near).code == "HB"
    assert fs.continue_points(point, ("p", "q"), over=near, code="LP").code == "LP"


def test_two_real_eigenvalues_of_opposite_sign_are_no_zero_hopf():
    """x' = p + x² beside y' = (q + 1) y, z' = −z: at q = 0 the sum of two eigenvalues vanishes."""
    model = fs.Model(turned([p + x**2, (q + 1) * y, -z]), parameters={p: -1, q: -0.5})
    diagram = fs.continue_equilibria(model, "p", (-1, 0.5))
    curve = fs.continue_points(diagram.folds[0], ("p", "q"), over={"p": (-1, 1), "q": (-0.5, 1)})
    assert curve["q"].min() == -0.5
    assert curve["q"].max() == 1
    assert np.abs(curve["p"]).max() < 1e-13
    assert not curve.special("ZH")


def test_double_hopf():
    """Two oscillators with growth p and q, coupled by cubic terms: Hopf at p = 0 and q = 0."""
    a, b = x**2 + y**2, z**2 + v**2
    model = fs.Model(
        {
            x: (p - a - b / 2) * x - y,
            y: x + (p - a - b / 2) * y,
            z: (q - b - a / 3) * z - 3 * v,
            v: 3 * z + (q - b - a / 3) * v,
        },
        parameters={p: 0, q: -1},
    )
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 1)).special("HB")
    over = {"p": (-1, 1), "q": (-1.5, 1)}
    curve = fs.continue_points(hopf, ("p", "q"), over=over)
    assert np.abs(curve["p"]).max() < 1e-13
    (point,) = curve.special("HH")
    assert np.abs([point["p"], point["q"]]).max() < 1e-13
    assert point.frequency == pytest.approx(3, rel=1e-12)
    # frequencies 1 and 3 are in resonance
    assert point.normal_form == {}
    assert point.type == "resonant or degenerate"
    # from there the other pair is followed
    other = fs.continue_points(point, ("p", "q"), over=over)
    assert np.abs(other["q"]).max() < 1e-12
    assert other["p"].min() == -1


def test_hopf_on_an_interface():
    """x'' = (p − x²) x' − x + w − 2(x − 1)₊: trace zero at p = w² while x = w < 1."""
    model = fs.Model(
        {x: v, v: w - x + (p - x**2) * v - 2 * sp.Max(x - 1, 0)}, parameters={w: 0, p: 0.25}
    )
    diagram = fs.continue_equilibria(model, "w", (0, 0.9))
    (hopf,) = diagram.special("HB")
    assert hopf["w"] == pytest.approx(0.5, rel=1e-14)
    over = {"w": (0, 2), "p": (0.1, 3)}
    curve = fs.continue_points(hopf, ("w", "p"), over=over)
    (point,) = curve.special("BH")
    assert [point["w"], point["p"], point["x"]] == pytest.approx([1, 1, 1], rel=1e-13)
    assert point.interface == "x - 1"
    assert curve["p"] == pytest.approx(curve["w"] ** 2, rel=1e-12)
    # the boundary equilibria x = w = 1 for every p meet the Hopf points of both sides there
    (corner,) = fs.continue_equilibria(model, "w", (0, 2)).boundary_equilibria
    edge = fs.continue_points(corner, ("w", "p"), over=over)
    assert [b["p"] for b in edge.special("BH")] == pytest.approx([1, 1], rel=1e-13)
    assert {b.regions[0] for b in edge.special("BH")} == {"S1", "S2"}
    assert [b.frequency for b in edge.special("BH")] == pytest.approx(
        [1, np.sqrt(3)] if edge.special("BH")[0].regions[0] == "S2" else [np.sqrt(3), 1], rel=1e-12
    )


def test_a_closed_curve_of_folds():
    """p² + q² + x² = 1: the folds over p are the circle x = 0."""
    model = fs.Model({x: p**2 + q**2 + x**2 - 1}, parameters={p: 0, q: 0})
    fold = fs.continue_equilibria(model, "p", (-2, 2)).folds[0]
    curve = fs.continue_points(fold, ("p", "q"), over={"p": (-2, 2), "q": (-2, 2)})
    assert curve.closed
    assert curve.outcome.code == "closed loop"
    assert np.hypot(curve["p"], curve["q"]) == pytest.approx(np.ones(len(curve)), abs=1e-13)
    assert np.ptp(np.unwrap(np.arctan2(curve["q"], curve["p"]))) == pytest.approx(2 * np.pi)


def test_bad_input(reactor):
    fold, end = reactor.folds[0], reactor.special("EP")[0]
    over = {"p1": (0, 0.3), "p2": (8, 20)}
    with pytest.raises(fs.FastSlowError, match="EP cannot be continued"):
        fs.continue_points(end, ("p1", "p2"), over=over)
    with pytest.raises(fs.FastSlowError, match="unknown parameter 'p4'; did you mean"):
        fs.continue_points(fold, ("p1", "p4"), over={"p1": (0, 1), "p4": (0, 1)})
    with pytest.raises(fs.FastSlowError, match="expected two different parameters"):
        fs.continue_points(fold, ("p1", "p1"), over=over)
    with pytest.raises(fs.FastSlowError, match="over has no range for 'p2'"):
        fs.continue_points(fold, ("p1", "p2"), over={"p1": (0, 1)})
    with pytest.raises(fs.FastSlowError, match="unknown parameter in over 'p5'"):
        fs.continue_points(fold, ("p1", "p2"), over={**over, "p5": (0, 1)})
    with pytest.raises(fs.FastSlowError, match="expected two finite numbers, the lower one first"):
        fs.continue_points(fold, ("p1", "p2"), over={"p1": (1, 0), "p2": (8, 20)})
    with pytest.raises(fs.FastSlowError, match="is outside over"):
        fs.continue_points(fold, ("p1", "p2"), over={"p1": (0, 0.01), "p2": (8, 20)})
    with pytest.raises(fs.FastSlowError, match="unknown curve from LP 'HB'"):
        fs.continue_points(fold, ("p1", "p2"), over=over, code="HB")
    with pytest.raises(fs.FastSlowError, match="has no model"):
        fs.continue_points(pickle.loads(pickle.dumps(fold)), ("p1", "p2"), over=over)
    curve = fs.continue_points(fold, ("p1", "p2"), over={"p1": (0.1, 0.11), "p2": (13, 15)})
    with pytest.raises(fs.FastSlowError, match="unknown column"):
        curve["p9"]
    with pytest.raises(fs.FastSlowError, match="unknown special point code"):
        curve.special("XX")


def test_boundary_equilibria_of_a_discontinuous_field():
    """x' = p − q x − sgn x: the equilibrium of x > 0 is on x = 0 at p = 1 for every q."""
    model = fs.Model({x: p - q * x - sp.sign(x)}, parameters={p: 0, q: 1})
    points = fs.continue_equilibria(model, "p", (-2, 2)).boundary_equilibria
    over = {"p": (-2, 2), "q": (0.5, 3)}
    for point in points:
        curve = fs.continue_points(point, ("p", "q"), over=over)
        assert np.abs(np.abs(curve["p"]) - 1).max() < 1e-14
        assert np.abs(curve["x"]).max() < 1e-15
        assert [o.code for o in curve.outcomes] == ["end of range"] * 2
