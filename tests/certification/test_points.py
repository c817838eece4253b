"""Special points proved in ball arithmetic."""

import sys
from dataclasses import replace

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.certification.points import points
from fastslow.certification.points.balls import ball_function
from fastslow.certification.points.defining import defined
from fastslow.certification.points.listing import ProvedPoint, _with_point
from fastslow.model.removable import ExpQuotient
from tests.certification.systems import hodgkin_huxley

flint = pytest.importorskip("flint")

x, y, p = sp.symbols("x y p")


@pytest.fixture(scope="module")
def cubic():
    model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    return model, fs.continue_equilibria(model, "p", (-1, 1))


def test_a_fold_to_fifty_digits(cubic):
    model, diagram = cubic
    for fold, sign in zip(diagram.folds, (1, -1), strict=True):
        found = fs.prove(model, fold, digits=50).enclosure
        with mpmath.workdps(60):
            exact = {"x": -sign / mpmath.sqrt(3), "p": sign * 2 / mpmath.sqrt(27)}
            for name, value in exact.items():
                assert abs(mpmath.mpf(found[name]) - value) < mpmath.mpf(10) ** -49
                assert found.low[name] < value < found.high[name]
                assert np.nextafter(found.low[name], 1) == found.high[name]
        assert found.digits == 50
        assert found.unique_within > 0.05
        assert found.regular == "a quadratic fold"


@pytest.mark.sample(0)
def test_hopf_points_of_hodgkin_and_huxley():
    rates, unknowns, _ = hodgkin_huxley()
    *states, current = unknowns
    model = fs.Model(dict(zip(states, rates, strict=True)), parameters={current: 0})
    near = {"V": 5.3459, "m": 0.0973, "h": 0.4062, "n": 0.4018, "I": 9.7793}
    diagram = fs.continue_equilibria(model, "I", (9, 11), from_points=[near])
    (hopf,) = diagram.special("HB")
    found = fs.prove(model, hopf, digits=18).enclosure
    # a prototype with other code; mpmath.findroot of the determinant agrees
    assert found["I"] == "9.77933799539312633"
    assert found.digits == 18
    assert found.regular.startswith("a simple pair of imaginary eigenvalues")
    assert 1e-6 < found.unique_within < 1


def test_a_hopf_point_in_closed_form():
    # the normal form at p = 1/3, on a frequency of 2
    size = x**2 + y**2
    q = p - sp.Rational(1, 3)
    model = fs.Model({x: q * x - 2 * y - x * size, y: 2 * x + q * y - y * size}, parameters={p: 0})
    (hopf,) = fs.continue_equilibria(model, "p", (-1, 1)).special("HB")
    found = fs.prove(model, hopf, digits=40).enclosure
    assert found["p"] == "0." + 40 * "3"
    assert found["x"] == "0"


def test_boundary_equilibria():
    model = fs.Model({x: p - x - sp.Abs(x - 1) / 3}, parameters={p: 0})
    (corner,) = fs.continue_equilibria(model, "p", (-3, 3)).boundary_equilibria
    found = fs.prove(model, corner).enclosure
    assert (found["x"], found["p"]) == ("1.00000000000000", "1.00000000000000")


def moved_to(model, point):
    """Return a point as one of another model."""
    return replace(point, source=replace(point.source, model=model.with_free("p")))


def test_a_point_or_a_diagram_of_other_equations_is_refused(cubic):
    diagram = cubic[1]
    other = fs.Model({x: p + x - x**5}, parameters={p: 0})
    match = (
        r"other equations: received x' = .*x\*\*3.*; expected the .* of this model, x' = .*x\*\*5"
    )
    with pytest.raises(fs.ArgumentError, match=f"the point is of a model with {match}"):
        fs.prove(other, diagram.folds[0])
    with pytest.raises(fs.ArgumentError, match=f"the diagram is of a model with {match}"):
        fs.certify(other, diagram, window={x: (-2, 2)})


def test_singular_points_name_what_fails():
    # a cusp is no regular fold
    model = fs.Model({x: p - x**3}, parameters={p: 0})
    near = fs.Model({x: p + x / 100 - x**3}, parameters={p: 0})
    fold = fs.continue_equilibria(near, "p", (-1, 1)).folds[0]
    with pytest.raises(fs.ArgumentError, match="the quadratic coefficient or the derivative"):
        fs.prove(model, moved_to(model, fold))
    pitchfork = fs.Model({x: x * (p - x**2)}, parameters={p: 0})
    origin = replace(fold, state=np.zeros(1), parameters={"p": 0.0})
    both = r"\(derivative by the parameter = 0, quadratic coefficient = 0\)"
    with pytest.raises(fs.ArgumentError, match=both):
        fs.prove(pitchfork, moved_to(pitchfork, origin))
    # the pair is tangent to the imaginary axis
    size = x**2 + y**2
    rates = {x: p * x - 2 * y - x * size, y: 2 * x + p * y - y * size}
    turning = fs.Model(rates, parameters={p: 0})
    (hopf,) = fs.continue_equilibria(turning, "p", (-1, 1)).special("HB")
    tangent = fs.Model({n: r.subs(p, p**3) for n, r in rates.items()}, parameters={p: 0})
    values = r"\(frequency = 2, derivative of the real part by the parameter = 0\)"
    with pytest.raises(fs.ArgumentError, match=values):
        fs.prove(tangent, moved_to(tangent, hopf))
    with pytest.raises(fs.ArgumentError, match="the Jacobian has 0 pairs of complex eigenvalues"):
        fs.prove(near, replace(fold, code="HB"))
    # a branch that is tangent to the interface
    bent = fs.Model({x: p**2 - x + sp.Abs(x) / 3}, parameters={p: 0})
    corner = replace(origin, code="BE", regions=("S1", "S2"), interface=next(iter(bent.interfaces)))
    along = "derivative of the interface function along the branch = 0"
    with pytest.raises(fs.ArgumentError, match=along):
        fs.prove(bent, moved_to(bent, corner))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"state": np.array([-0.5763])}, "has x = -0.57735 instead of -0.5763: the point is not"),
        ({"parameters": {"p": 0.2}}, "has p = 0.3849 instead of 0.2: the point is not accurate"),
        ({"state": np.array([np.nan])}, "LP1 has coordinates that are not finite"),
        ({"code": "EP"}, "LP1 has the code EP; expected a point of code LP, HB, NSD, BE, CP"),
        ({"code": "BE"}, "LP1 has no interface 'None'"),
        ({"code": "CP"}, "expected a point CP of a curve in two parameters"),
        ({"regions": ("S7",)}, "LP1 is a point of S7; expected a point of a region with isolated"),
    ],
)
def test_what_is_wrong_with_a_point_is_named(cubic, changes, match):
    model, diagram = cubic
    with pytest.raises(fs.ArgumentError, match=match):
        fs.prove(model, replace(diagram.folds[0], **changes))


def test_points_of_orbits_and_other_objects_are_refused(cubic):
    model, diagram = cubic
    for other in (diagram, diagram.at(p=0.9)[0], None):
        with pytest.raises(fs.ArgumentError, match="point: expected a SpecialPoint, received"):
            fs.prove(model, other)
    with pytest.raises(fs.ModelError, match="still varies in time"):
        fs.prove(fs.Model({x: p + x - x**3}, forcing={p: sp.sin(sp.Symbol("t"))}), diagram["LP1"])


def test_points_from_files_are_proved(tmp_path):
    model = fs.Model({x: p - x**2}, parameters={p: 0})
    fs.continue_equilibria(model, "p", (-1, 1)).save(tmp_path / "one.npz")
    again = fs.load(tmp_path / "one.npz")
    # whether p is free is not known, as its value is that of the model
    with pytest.raises(fs.ArgumentError, match="LP1 was read from a file, and has the same values"):
        fs.prove(model, again["LP1"])
    assert fs.prove(model.with_parameters(p=1), again["LP1"]).enclosure["p"] == "0"
    assert fs.certify(model, again, window={x: (-2, 2)}).points[0].enclosure["p"] == "0"


def test_exact_parameters_are_decimals():
    a = sp.Symbol("a")
    folds = []
    for value in (0.1, sp.Rational(1, 10)):
        model = fs.Model({x: p + a * x - x**3}, parameters={p: 0, a: value})
        fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
        folds.append(fs.prove(model, fold, digits=30).enclosure["p"])
    with mpmath.workdps(40):
        exact = 2 * (mpmath.mpf("0.1") / 3) ** 1.5
        assert all(abs(mpmath.mpf(value) - exact) < 1e-31 for value in folds)


def test_folds_of_pseudo_equilibria():
    # on x = 0, p = 2y − y² with the weight (p + 0)/2
    rates = {x: p - x - 2 * sp.sign(x) + x * y, y: x - 2 * y + p + y**2}
    model = fs.Model(rates, parameters={p: 0})
    found = fs.continue_equilibria(model, "p", (-3, 3), window={x: (-5, 5), y: (-5, 5)})
    fold = fs.prove(model, found["LP1"], digits=30).enclosure
    assert (fold["x"], fold["y"], fold["p"]) == ("0", "1." + 29 * "0", "1." + 29 * "0")
    # the end of the sliding segment, at weight −1
    corner = fs.prove(model, found["BE1"], digits=20).enclosure
    assert corner["y"] == "-0.73205080756887729353"


def test_points_of_other_models_are_refused(cubic):
    _, diagram = cubic
    fold = diagram.folds[0]
    other = fs.Model({y: p - y**2}, parameters={p: 0})
    with pytest.raises(fs.ArgumentError, match="the point has the states x and the model y"):
        fs.prove(other, fold)
    a = sp.Symbol("a")
    one = fs.Model({x: p + a * x - x**3}, parameters={p: 0, a: 1})
    fold = fs.continue_equilibria(one, "p", (-1, 1)).folds[0]
    with pytest.raises(fs.ArgumentError, match=r"the point has a = 1\.0 and the model 2\.0"):
        fs.prove(one.with_parameters(a=2), fold)


def test_without_python_flint_only_points_are_refused(cubic, monkeypatch):
    model, diagram = cubic
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(fs.MissingPackageError, match=r"pip install 'fastslow\[certified\]'"):
        fs.prove(model, diagram.folds[0])
    found = fs.certify(model, diagram, window={x: (-2, 2)})
    assert found.complete
    assert found.all_points
    assert [(p.label, p.enclosure) for p in found.points] == [("LP1", None), ("LP2", None)]
    assert "special points have no enclosures: " in repr(found)


def test_points_without_enclosure_are_named(cubic):
    model, diagram = cubic
    known = diagram[0].special
    # a point of another model
    moved = (replace(p, states=("y",)) if p.label == "LP1" else p for p in known)
    branch = replace(diagram[0], special=type(known)(moved))
    found = fs.certify(model, replace(diagram, branches=(branch,)), window={x: (-2, 2)})
    assert [point.label for point in found.points if point.enclosure] == ["LP2"]
    assert "; LP1 has no enclosure: " in repr(found)


def test_certificates_prove_the_points_of_the_diagram(cubic, tmp_path):
    found = fs.certify(*cubic, window={x: (-2, 2)})
    assert [point.label for point in found.points] == ["LP1", "LP2"]
    assert found.diagram["LP1"].enclosure["p"] == "0.384900179459751"
    found.save(tmp_path / "one.npz")
    again = fs.load(tmp_path / "one.npz")
    assert again.diagram["LP1"].enclosure["p"] == "0.384900179459751"
    assert replace(again.points[0], enclosure=None) != again.points[0]


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_removable_quotients_in_balls(order):
    function = ball_function([ExpQuotient(x, sp.Integer(order))], [x])
    with flint.ctx.workprec(150), mpmath.workdps(50):
        for value in ("0.3", "-0.4", "2.5", "-7", "0.4999", "0.5001"):
            (ball,) = function([flint.arb(value)])
            exact = mpmath.diff(lambda t: t / mpmath.expm1(t), mpmath.mpf(value), order)
            assert abs(mpmath.mpf(ball.mid().str(45, radius=False)) - exact) < 1e-30
            assert ball.rel_accuracy_bits() > 120
        (around,) = function([flint.arb(0, 0.01)])
        assert around.contains([flint.arb(1), flint.arb(-0.5), flint.arb(1) / 6, 0][order])


def test_starting_values_of_defining_systems_satisfy_them(monkeypatch):
    """So that Newton's method has only rounding errors to remove."""
    found = []

    def kept(*given):
        found.append(defined(*given))
        return found[-1]

    monkeypatch.setattr(points, "defined", kept)
    y, q = sp.symbols("y q")
    models = {
        "LP": {x: 2 * y - x / 3, y: p - x**2 + 3 * y},
        "HB": {x: p * x - 3 * y - x**3, y: 2 * x + y / 5},
        "NSD": {x: p * x + 2 * y + x**2, y: 3 * x - y / 2},
        "BE": {x: p - x - 2 * sp.Abs(x - q) / 3, y: x - 2 * y},
    }
    for code, rates in models.items():
        model = fs.Model(rates, parameters={p: 0.1} | ({q: 0.3} if code == "BE" else {}))
        point = fs.continue_equilibria(model, "p", over=(-1, 1)).special(code)[0]
        fs.prove(model, point)
        whole = found[-1].whole
        values = sp.lambdify(whole.unknowns, whole.rows)(*whole.start)
        assert np.abs(np.array(values, dtype=float)).max() < 1e-8, code
    assert len(found) == len(models)


def test_points_of_other_kinds_regions_and_interfaces_are_at_no_distance(cubic):
    point = cubic[1].folds[0]
    u = np.append(point.state, point["p"])
    one = ProvedPoint(
        code="LP", region="S1", interface="", low=u, high=u, near_low=u[None], near_high=u[None]
    )

    def distance(proved, fold):
        return proved.distance(fold, "p", np.ones(2), np.zeros(2))

    assert distance(one, point) == 0
    assert distance(replace(one, near_low=u[None] + 2, near_high=u[None] + 3), point) == 2
    for other in (
        replace(one, code="HB"),
        replace(one, region="S2"),
        replace(one, interface="x - 1"),
    ):
        assert distance(other, point) == np.inf
    assert distance(one, replace(point, admissible=False)) == np.inf


@pytest.mark.parametrize("ahead", [0, 1])
def test_a_point_on_one_of_the_rows_beside_it_is_that_row(cubic, ahead):
    (branch,) = cubic[1].branches
    row = branch.special_rows[0] + 3
    at = row + ahead
    fold = branch.special[0]
    values = {"p": float(branch.values[at])}
    point = replace(fold, state=branch.state[at].copy(), parameters=values)
    found = _with_point(branch, row, point, np.ones(2), np.zeros(1))
    assert len(found) == len(branch)
    assert at in found.special_rows
    assert len(found.special_rows) == len(branch.special_rows) + 1
    # between them it has a row of its own
    between = replace(point, state=branch.state[row : row + 2].mean(axis=0))
    assert len(_with_point(branch, row, between, np.ones(2), np.zeros(1))) == len(branch) + 1


def test_what_has_no_ball_arithmetic_is_named():
    f = sp.Function("f")
    with pytest.raises(fs.ModelError, match=r"^the rates contain f, which has no ball"):
        ball_function([f(x)], [x])([flint.arb(1)])
    with pytest.raises(fs.ModelError, match=r"^the rates contain 'y', which has no ball"):
        ball_function([x + y], [x])([flint.arb(1)])
