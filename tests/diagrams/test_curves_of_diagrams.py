"""All curves of a diagram, values read off curves, and where curves meet interfaces."""

import pickle

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, p, q, c = sp.symbols("x y p q c")
u1, u2, p1, p2, p3 = sp.symbols("u1 u2 p1 p2 p3")
PLANE = {"p1": (0, 0.3), "p2": (8, 20)}


@pytest.fixture(scope="module")
def reactor():
    rate = p1 * (1 - u1) * sp.exp(u2)
    model = fs.Model(
        {u1: -u1 + rate, u2: -u2 + p2 * rate - p3 * u2}, parameters={p1: 0, p2: 14, p3: 2}
    )
    return fs.continue_equilibria(model, p1, (0, 0.2))


@pytest.fixture(scope="module")
def curves(reactor):
    return fs.continue_points(reactor, ("p1", "p2"), over=PLANE, marks={"p2": [16]})


def test_every_curve_of_a_diagram_is_traced_once(reactor, curves):
    """Two folds, a Hopf point and a neutral saddle: a curve of folds and one of pairs."""
    assert [k.code for k in curves] == ["LP", "HB"]
    assert len(repr(curves).split("\n")) == 3
    assert {k.code for k in curves.special} == {"BT", "CP", "GH", "UZ"}
    for curve in curves:
        for point in reactor.special(curve.code):
            met = curve.at(p2=14)
            assert min(abs(m["p1"] - point["p1"]) for m in met) < 1e-13
    (folds,) = fs.continue_points(reactor, ("p1", "p2"), over=PLANE, code="LP")
    assert folds.code == "LP"
    again = pickle.loads(pickle.dumps(curves))
    assert repr(again) == repr(curves)


def test_points_without_a_curve_are_said():
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    diagram = fs.continue_equilibria(model, "q", (-1, 1))
    found = fs.continue_points(diagram, ("q", "p"), over={"q": (-1, 1), "p": (-1, 1)})
    assert len(found) == 0
    assert {k.code for k in found.isolated} == {"BP"}
    assert "no curve from BP1" in repr(found)


def test_a_diagram_is_refused_in_a_plane_without_its_parameter(reactor):
    with pytest.raises(fs.ArgumentError, match="expected the diagram's parameter p1"):
        fs.continue_points(reactor, ("p2", "p3"), over={"p2": (8, 20), "p3": (1, 3)})
    with pytest.raises(fs.UnknownNameError, match="unknown curve 'XX'"):
        fs.continue_points(reactor, ("p1", "p2"), over=PLANE, code="XX")


def test_values_of_a_curve(curves):
    """Folds of the reactor at p2: u1 solves 3 = p2 u1 (1 − u1), p1 = u1 e^(−u2)/(1 − u1)."""
    folds = curves[0]
    found = folds.at(p2=15)
    roots = np.sort(np.roots([15, -15, 3]).real)
    assert found["u1"] == pytest.approx(roots, rel=1e-12)
    assert found["u2"] == pytest.approx(5 * roots, rel=1e-12)
    assert found["p1"] == pytest.approx(roots / (1 - roots) * np.exp(-5 * roots), rel=1e-12)
    assert [k.code for k in found] == ["LP", "LP"]
    assert folds.at(p2=11) == ()
    # at a mark the row itself
    assert folds.at(p2=16)["u1"] == pytest.approx(folds.special("UZ")["u1"], rel=1e-13)
    read = pickle.loads(pickle.dumps(folds)).at(p2=15)
    assert read["p1"] == pytest.approx(found["p1"], rel=1e-7)
    assert all("interpolated" in k.note for k in read)
    hopf = curves[1].at(p2=16)
    assert [k.code for k in hopf] == ["NSD", "HB"]
    assert hopf[1].lyapunov < 0
    with pytest.raises(fs.UnknownNameError, match="unknown curve parameter 'p3'"):
        folds.at(p3=1)
    with pytest.raises(fs.ArgumentError, match="expected a value of one of p1, p2, received none"):
        folds.at()


def test_a_value_passed_twice_within_one_step():
    """The folds x = 0, p = q² are lowest between two rows."""
    model = fs.Model({x: p - q**2 + x**2}, parameters={p: -0.1, q: 0.3})
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    curve = fs.continue_points(fold, (p, q), over={p: (-1, 1), q: (-0.9, 0.9)})
    for value in (1e-3, 1e-5):
        found = curve.at(p=value)
        assert np.sort(found["q"]) == pytest.approx([-np.sqrt(value), np.sqrt(value)], rel=1e-7)


def test_marks_are_met_exactly(curves):
    marks = curves[0].special("UZ")
    assert marks["p2"].tolist() == [16, 16]
    with pytest.raises(fs.ArgumentError, match="mark p2 = 30 is outside the range"):
        fs.continue_points(curves[0].special[0], ("p1", "p2"), over=PLANE, marks={"p2": [30]})


def test_a_curve_traced_twice_is_recognised(reactor, curves):
    other = fs.continue_points(reactor.folds[1], ("p1", "p2"), over=PLANE)
    with pytest.raises(fs.ArgumentError, match="one curve, traced twice"):
        curves[0].intersections(other)
    # folds and pairs touch at BT, which costs half the digits, and cross elsewhere
    (bt,) = curves[0].special("BT")
    met = curves[0].intersections(curves[1])
    apart = np.abs(met - [bt["p1"], bt["p2"]]).max(axis=1)
    assert apart.min() < 1e-5
    # a touch may be two intersections, by rounding
    assert np.count_nonzero(apart > 1e-3) == 2


@pytest.fixture(scope="module")
def sliding():
    """f₁ = (p + y, x − c), f₂ = (x, 1) on y = 0: pseudo-equilibria at p = x (x − c)."""
    return fs.Model(
        {
            x: sp.Piecewise((p + y, y > 0), (x, True)),
            y: sp.Piecewise((x - c, y > 0), (1, True)),
        },
        parameters={p: 0, c: 1},
    )


def test_a_fold_of_pseudo_equilibria_at_the_edge_of_sliding(sliding):
    """Folds at x = c/2, p = −c²/4; sliding needs x < c, so that they end at c = 0."""
    diagram = fs.continue_equilibria(sliding, "p", (-1, 1))
    over = {"p": (-1, 1), "c": (-1, 2)}
    (fold,) = diagram.folds
    whole = fs.continue_points(fold, ("p", "c"), over=over)
    ending = fs.continue_points(fold, ("p", "c"), over=over, virtual=False)
    for curve in (whole, ending):
        (point,) = curve.special("BF")
        assert np.abs([point["p"], point["c"], point["x"]]).max() < 1e-13
        assert point.regions == ("S1|S2", "S1")
        assert point.interface == "y"
    assert ending["c"].min() == pytest.approx(0, abs=1e-13)
    assert np.all(ending.admissible)
    assert not whole.admissible.all()
    # the boundary equilibria p = 0, x = c change from a non-smooth fold to persistence there
    (corner,) = diagram.boundary_equilibria
    edge = fs.continue_points(corner, ("p", "c"), over=over)
    (point,) = edge.special("BF")
    assert np.abs([point["p"], point["c"]]).max() < 1e-13
    folds = fs.continue_points(point, ("p", "c"), over=over, code="LP")
    assert folds.region == "S1|S2"
    assert folds["p"] == pytest.approx(-(folds["c"] ** 2) / 4, abs=1e-13)


def test_two_interfaces_meet():
    """Equilibria are on x = 0 where p = 0 and on y = 0 where q = x: on both at the origin."""
    model = fs.Model(
        {x: p + x + sp.Abs(x), y: q + 2 * y + sp.Abs(y) - x}, parameters={p: -0.5, q: 0.5}
    )
    diagram = fs.continue_equilibria(model, "p", (-1, 0.5))
    corner = next(b for b in diagram.boundary_equilibria if b.interface == "y")
    curve = fs.continue_points(corner, ("p", "q"), over={"p": (-1, 1), "q": (-1, 1)})
    (point,) = curve.special("BB")
    assert np.abs([*point.state, point["p"], point["q"]]).max() < 1e-14
    assert "on x as well" in point.note
    assert curve.special_rows[curve.special.index(point)] in (0, len(curve) - 1)
    assert "interfaces meet" in {o.code for o in curve.outcomes}
