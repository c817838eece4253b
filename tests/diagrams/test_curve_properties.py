"""What holds for every curve of special points: its equations, traced once, values read off it."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation import curve_points
from tests.invariants import violations

pytestmark = pytest.mark.slow

x, y, p, q, a, b, d, E, alpha, R, k = sp.symbols("x y p q a b d E alpha R k")
u1, u2, p1, p2 = sp.symbols("u1 u2 p1 p2")
X, Y, Z, F, G = sp.symbols("X Y Z F G")


def reactor():
    """Two states with folds, Hopf points, BT, CP and GH (AUTO's demo ab)."""
    rate = p1 * (1 - u1) * sp.exp(u2)
    model = fs.Model(
        {u1: -u1 + rate, u2: -3 * u2 + p2 * rate}, parameters={p1: 0, p2: 14}
    )  # fmt: skip
    return model, {"p1": (0, 0.2)}, {"p1": (0, 0.3), "p2": (8, 20)}


def circulation():
    """Lorenz-84 (Shilnikov, Nicolis and Nicolis 1995), with folds and Hopf points."""
    rates = {
        X: -(Y**2) - Z**2 - X / 4 + F / 4,
        Y: X * Y - 4 * X * Z - Y + G,
        Z: 4 * X * Y + X * Z - Z,
    }
    return fs.Model(rates, parameters={F: 1, G: 0.8}), {"F": (0, 4)}, {"F": (0, 4), "G": (0.2, 3)}


def gear():
    """A tooth pair with clearance D = 1/4: folds, boundary equilibria, BF."""
    gap = sp.Piecewise((x - sp.Rational(1, 4), x > sp.Rational(1, 4)), (0, True))
    below = sp.Piecewise((x + sp.Rational(1, 4), x < -sp.Rational(1, 4)), (0, True))
    model = fs.Model({x: y, y: p - y - (x**2 + q) * (gap + below)}, parameters={p: 0, q: -0.2})
    return model, {"p": (-0.3, 0.3)}, {"p": (-1, 1), "q": (-2, 2)}


def ocean():
    """Stommel's boxes with the strength R of salt: |x − R s|, both folds and corners."""
    flow = sp.Abs(x - R * y)
    model = fs.Model(
        {x: 3 - x * (1 + flow), y: p - y * (k + flow)}, parameters={p: 1, k: 0.3, R: 1}
    )
    return model, {"p": (0.2, 2)}, {"p": (0, 4), "R": (-2, 4)}


def harvest():
    """Prey and predators that are harvested above alpha (Kuznetsov, Rinaldi, Gragnani 2003)."""
    eaten = a * x * y / (b + x)
    model = fs.Model(
        {x: x * (1 - x) - eaten, y: eaten - d * y - sp.Piecewise((E * y, y > alpha), (0, True))},
        parameters={a: 0.3556, b: 0.33, d: 0.0444, E: 0.2067, alpha: 1.2},
    )
    return model, {"alpha": (0.1, 3)}, {"b": (0.05, 1.2), "alpha": (0.1, 3.5)}


MODELS = (circulation, reactor, gear, harvest, ocean)


@pytest.fixture(scope="module", params=MODELS, ids=lambda make: make.__name__)
def traced(request):
    model, over, plane = request.param()
    ((name, ends),) = over.items()
    diagram = fs.continue_equilibria(model, name, ends)
    return model, diagram, fs.continue_points(diagram, tuple(plane), over=plane), plane


def defining(model, region, names):
    """Rates, Jacobian and sides of a region as functions of states and two parameters, by SymPy.

    Of sliding along one interface the rates are those of Filippov's field, with the state
    on the interface.
    """
    states = [sp.Symbol(s) for s in model.states]
    fixed = {sp.Symbol(n): v for n, v in model.parameters.items() if n not in names}

    def plain(expression):
        free = {s: sp.Symbol(s.name) for s in expression.free_symbols}
        return expression.subs(free).subs(fixed)

    def rates(one):
        return sp.Matrix([plain(model.regions[one].rates[s]) for s in model.states])

    sides = {name: plain(h.function) for name, h in model.interfaces.items()}
    arguments = [*states, *map(sp.Symbol, names)]
    if "|" not in region:
        field = rates(region)
        matrix = field.jacobian(states)
        return sp.lambdify(arguments, field), sp.lambdify(arguments, matrix), sides, arguments
    above, below = (rates(one) for one in region.split("|"))
    (h,) = sides.values()
    gradient = sp.Matrix([h]).jacobian(states)
    first, second = (gradient * above)[0], (gradient * below)[0]
    field = (second * above - first * below) / (second - first)
    # a change along the interface y = alpha: that of x alone
    slope = sp.diff(field[0], states[0])
    return sp.lambdify(arguments, sp.Matrix([*field, h])), sp.lambdify(arguments, slope), {}, None


def misses(model, curve, codes, rows):
    """How far points (states, parameters) are from satisfying the equations of a curve."""
    rates, matrix, sides, arguments = defining(model, curve.region, curve.parameter_names)
    first = dict(zip(arguments or (), curve.points[0], strict=False))
    # a curve of boundary equilibria keeps to the interface on which it begins
    edge = min(sides.values(), key=lambda h: abs(float(h.subs(first))), default=None)
    for code, row in zip(codes, rows, strict=True):
        yield np.abs(rates(*row)).max()
        jacobian = np.atleast_2d(np.array(matrix(*row), dtype=float))
        unit = max(1.0, np.abs(jacobian).max())
        if code == "LP":
            yield np.linalg.svd(jacobian)[1].min() / unit
        elif code in ("HB", "NSD"):
            values = np.linalg.eigvals(jacobian)
            i, j = np.triu_indices(len(values), 1)
            yield np.abs(values[i] + values[j]).min() / unit
        elif code == "BE":
            yield abs(float(edge.subs(dict(zip(arguments, row, strict=True)))))


def holds(curve, point, own, plane):
    """Whether a point of a diagram over the parameter `own` is on a curve."""
    (other,) = set(plane) - {own}
    return any(
        np.abs([*(f.state - point.state), *(f[name] - point[name] for name in plane)]).max() < 1e-9
        for f in curve.at(**{other: point[other]})
    )


@pytest.mark.sample(2)
def test_every_point_satisfies_its_equations(traced):
    model, diagram, curves, _ = traced
    assert {c.code for c in curves} >= {s.code for s in diagram.special() if s.code in "LP HB BE"}
    for curve in curves:
        size = max(1.0, np.abs(curve.points).max()) ** 2
        assert max(misses(model, curve, curve.codes, curve.points)) < 1e-9 * size


@pytest.mark.sample(2)
def test_values_read_off_a_curve_are_on_it_and_none_is_left_out(traced):
    model, _, curves, plane = traced
    random = np.random.default_rng(3)
    for curve in curves:
        for name in plane:
            column = curve[name]
            if np.ptp(column) < 1e-9 * max(1.0, np.abs(column).max()):
                continue
            for value in random.uniform(column.min(), column.max(), 4):
                found = curve.at(**{name: value})
                passed = np.count_nonzero(np.diff(np.sign(column - value)))
                # a pair may be passed between two rows, never a single one
                assert len(found) >= passed
                assert (len(found) - passed) % 2 == 0
                points = [[*f.state, *(f.parameters[n] for n in plane)] for f in found]
                size = max(1.0, np.abs(points).max()) ** 2
                codes = [f.code for f in found]
                assert max(misses(model, curve, codes, points)) < 1e-9 * size
                assert max(abs(f.parameters[name] - value) for f in found) < 1e-12


@pytest.mark.sample(2)
def test_every_curve_is_there_once(traced):
    """Each special point of the diagram lies on one curve, and no curve runs along another."""
    _, diagram, curves, plane = traced
    for code in {c.code for c in curves}:
        for point in diagram.special(code):
            assert (
                sum(
                    holds(curve, point, diagram.parameter, plane)
                    for curve in curves
                    if curve.code == code
                )
                == 1
            )
    for i, first in enumerate(curves):
        for second in curves[:i]:
            try:
                first.intersections(second)
            except fs.ArgumentError as error:
                # of two curves over each other the states differ
                assert "differ only in" in str(error)  # noqa: PT017


@pytest.mark.sample(2)
def test_two_traces_of_one_curve_do_not_meet(traced):
    _, diagram, curves, plane = traced
    seen = set()
    for point in diagram.special():
        if point.code not in ("LP", "HB", "BE") or point.code in seen:
            continue
        again = fs.continue_points(point, tuple(plane), over=plane)
        same = [c for c in curves if c.code == point.code and c.region == again.region]
        (own,) = (c for c in same if holds(c, point, diagram.parameter, plane))
        with pytest.raises(fs.ArgumentError, match="one curve, traced twice"):
            own.intersections(again)
        seen.add(point.code)
    assert seen


def test_curves_over_each_other_are_not_called_one():
    """Both edges of the gap are reached at p = 0 for every q, at x = D and x = −D."""
    model, over, plane = gear()
    corners = fs.continue_equilibria(model, "p", over["p"]).boundary_equilibria
    upper, lower = (
        fs.continue_points(next(c for c in corners if c["x"] * sign > 0), ("p", "q"), over=plane)
        for sign in (1, -1)
    )
    with pytest.raises(fs.ArgumentError, match="plane of p and q: they differ only in x"):
        upper.intersections(lower)
    assert upper.intersections(lower, "x", "q").shape == (0, 2)


def test_thresholds_at_which_harvesting_makes_a_fold_touch_the_edge_of_sliding():
    """Folds on the threshold at x = (1 − b)/2, α = (1 + b)²/(4a), where predators stay equal."""
    model, over, plane = harvest()
    (fold,) = fs.continue_equilibria(model, "alpha", over["alpha"]).folds
    ends = []
    for loss in (0.0444 + 0.2067, 0.0444):
        half = (0.3556 - loss) / (0.3556 + loss)
        ends.append((half, (1 + half) ** 2 / (4 * 0.3556)))
    assert np.ravel(ends) == pytest.approx([0.17224, 0.96608, 0.778, 2.2225], abs=5e-6)
    whole = fs.continue_points(fold, ("b", "alpha"), over=plane)
    assert whole["alpha"] == pytest.approx((1 + whole["b"]) ** 2 / (4 * 0.3556), rel=1e-11)
    edges = sorted((f["b"], f["alpha"]) for f in whole.special("BF"))
    assert np.ravel(edges) == pytest.approx(np.ravel(ends), rel=1e-11)
    between = (whole["b"] >= ends[0][0] - 1e-9) & (whole["b"] <= ends[1][0] + 1e-9)
    np.testing.assert_array_equal(whole.admissible, between)
    ending = fs.continue_points(fold, ("b", "alpha"), over=plane, virtual=False)
    assert [ending["b"].min(), ending["b"].max()] == pytest.approx([ends[0][0], ends[1][0]])
    assert ending.admissible.all()


def test_a_virtual_curve_of_stommels_boxes_is_bounded_and_double_zeros_raise_nothing():
    """Virtual folds at k → 1 go to infinity; at BT the quadratic term vanishes as well."""
    model, over, _ = ocean()
    diagram = fs.continue_equilibria(model, "p", over["p"])
    curve = fs.continue_points(diagram.folds[0], ("p", "k"), over={"p": (0, 4), "k": (0.01, 2)})
    # of 20,000 that it may have; how near it comes to k = 1 hangs on rounding
    assert len(curve) < 2000
    assert not curve.outcome.success
    (double,) = curve.special("BT")
    assert np.abs(double.eigenvalues).max() < 1e-5
    for cusp in curve.special("CP"):
        assert np.isnan(cusp.coefficient)
        assert np.abs(cusp.state - double.state).max() < 1e-6


def test_a_point_for_which_newton_fails_is_between_its_rows(monkeypatch):
    """As where Newton's method reaches another point, far away; the bracket is bisected."""
    model, over, plane = reactor()
    fold = fs.continue_equilibria(model, "p1", over["p1"]).folds[0]
    known = fs.continue_points(fold, tuple(plane), over=plane)
    keep = curve_points.solved_from

    def far(*given):
        found = keep(*given)
        return replace(found, z=found.z + 30.0, converged=False)

    monkeypatch.setattr(curve_points, "solved_from", far)
    bisected = fs.continue_points(fold, tuple(plane), over=plane)
    assert len(known.special) == len(bisected.special) > 1
    for one, other in zip(known.special, bisected.special, strict=True):
        assert (one.code, other.converged) == (other.code, False)
        for name in plane:
            assert one[name] == pytest.approx(other[name], rel=1e-6)


def test_the_invariants_notice_wrong_points_and_repeated_rows():
    model, over, plane = reactor()
    fold = fs.continue_equilibria(model, "p1", over["p1"]).folds[0]
    curve = fs.continue_points(fold, tuple(plane), over=plane)
    moved = curve.eigenvalues.copy()
    moved[3] += 0.5 * np.abs(moved).max()
    assert "has no critical value" in violations(replace(curve, eigenvalues=moved))[0]
    order = [*range(len(curve)), *range(len(curve) - 2, -1, -1)]
    names = ("codes", "state", "values", "tangent", "eigenvalues", "admissible", "coefficient")
    twice = replace(curve, **{name: getattr(curve, name)[order] for name in names})
    assert "again, at" in violations(twice)[0]
