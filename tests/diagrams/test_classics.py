"""Classic systems against closed forms."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.solve import starts
from fastslow.results.branch.equilibrium_sets import Equilibria

pytestmark = pytest.mark.slow

x, y, z, p, q, rho, u1, u2, p1, p2, p3 = sp.symbols("x y z p q rho u1 u2 p1 p2 p3")


@pytest.fixture(scope="module")
def reactor():
    """AUTO's demo ab (Doedel and others), two reactions in sequence."""
    rate = p1 * (1 - u1) * sp.exp(u2)
    return fs.Model(
        {u1: -u1 + rate, u2: -u2 + p2 * rate - p3 * u2}, parameters={p1: 0, p2: 14, p3: 2}
    )


def test_reactor_folds_and_hopf_to_thirteen_digits(reactor):
    diagram = fs.continue_equilibria(reactor, p1, (0, 0.2))
    assert [f["p1"] for f in diagram.folds] == pytest.approx(
        [0.105738978271650651, 0.0889318461857728026], rel=1e-13
    )
    (hopf,) = diagram.special("HB")
    assert hopf["p1"] == pytest.approx(0.130900044820043325, rel=1e-13)
    assert np.abs(hopf.eigenvalues.real).max() < 1e-12
    assert hopf.frequency == pytest.approx(np.abs(hopf.eigenvalues.imag).max(), rel=1e-12)
    # between the folds the trace vanishes at a saddle: that is no Hopf point
    (saddle,) = diagram.special("NSD")
    assert np.sum(saddle.eigenvalues).real == pytest.approx(0, abs=1e-11)
    assert np.prod(saddle.eigenvalues).real < 0


def test_reactor_with_two_hopf_points(reactor):
    diagram = fs.continue_equilibria(reactor.with_parameters(p2=17, p3=3), p1, (0, 0.3))
    assert sorted(h["p1"] for h in diagram.special("HB")) == pytest.approx(
        [0.120865719509389, 0.217080509696289], rel=1e-13
    )
    assert sorted(f["p1"] for f in diagram.folds) == pytest.approx(
        [0.117014750426704, 0.121901160810783], rel=1e-13
    )


def test_reactor_at_a_value_is_found_by_search(reactor):
    found = fs.equilibria(reactor, p1=0.1)
    assert found.completeness == "found"
    assert [e["u1"] for e in found] == pytest.approx([0.21174286, 0.45304503, 0.82357777], abs=1e-8)


def test_cusp_folds():
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    bound = 2 / (3 * np.sqrt(3))
    assert [f["p"] for f in diagram.folds] == pytest.approx([bound, -bound], abs=1e-15)
    assert [f["x"] for f in diagram.folds] == pytest.approx(
        [-1 / np.sqrt(3), 1 / np.sqrt(3)], abs=1e-12
    )
    assert [f.coefficient for f in diagram.folds] == pytest.approx(
        [np.sqrt(3), -np.sqrt(3)], rel=1e-10
    )


def test_pitchfork_is_one_branch_point_and_no_fold():
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    diagram = fs.continue_equilibria(model, "q", (-1, 1))
    assert diagram.folds == ()
    assert len(diagram.branches) == 2
    assert {b.label for b in diagram.special("BP")} == {"BP1"}
    for point in diagram.special("BP"):
        assert np.abs([point["x"], point["q"]]).max() < 1e-9


def test_lorenz_hopf_and_pitchfork():
    model = fs.Model(
        {x: 10 * (y - x), y: x * (rho - z) - y, z: x * y - sp.Rational(8, 3) * z},
        parameters={rho: 1},
    )
    diagram = fs.continue_equilibria(model, "rho", (0, 30))
    assert [h["rho"] for h in diagram.special("HB")] == pytest.approx([470 / 19] * 2, rel=1e-13)
    # Hopf frequency at rho_H: ω² = β(σ + rho)
    omega = np.sqrt(8 / 3 * (10 + 470 / 19))
    assert [h.frequency for h in diagram.special("HB")] == pytest.approx([omega] * 2, rel=1e-11)
    assert diagram.special("BP")[0]["rho"] == pytest.approx(1, abs=1e-10)
    for value in (0.5, 2.0, 28.0):
        expected = [0.0]
        if value > 1:
            c = np.sqrt(8 / 3 * (value - 1))
            expected += [-c, c]
        found = [e["x"] for e in diagram.at(rho=value)]
        assert sorted(found) == pytest.approx(sorted(expected), abs=1e-13)


def test_an_isolated_loop_is_found_and_closed():
    model = fs.Model({x: p**2 + x**2 - 1}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    (loop,) = diagram.branches
    assert loop.closed
    assert loop.outcome.code == "closed loop"
    assert np.abs(loop["x"] ** 2 + loop["p"] ** 2 - 1).max() < 1e-14
    assert sorted(f["p"] for f in diagram.folds) == pytest.approx([-1, 1], abs=1e-14)
    assert sorted(e["x"] for e in diagram.at(p=0.6)) == pytest.approx([-0.8, 0.8], abs=1e-14)


def test_a_tiny_loop_is_found_because_its_critical_values_are_known():
    """A circle of radius 10⁻³ in a range of length 4."""
    loop = (p - sp.Rational(1, 3)) ** 2 + x**2 - sp.Rational(1, 10**6)
    diagram = fs.continue_equilibria(fs.Model({x: loop}, parameters={p: 0}), "p", (-2, 2))
    assert diagram.completeness == "complete"
    assert [b.closed for b in diagram.branches] == [True]
    assert sorted(f["p"] for f in diagram.folds) == pytest.approx(
        [1 / 3 - 1e-3, 1 / 3 + 1e-3], abs=1e-14
    )


def test_coverage_is_claimed_only_where_it_is_proved(reactor):
    assert fs.continue_equilibria(reactor, p1, (0, 0.2)).completeness == "found"
    cut = fs.continue_equilibria(
        fs.Model({x: p - x}, parameters={p: 0}),
        p,
        (0, 1),
        continuation=fs.Continuation(max_points=10),
    )
    assert cut.completeness == "found"
    cusp = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    assert fs.continue_equilibria(cusp, "p", (-1, 1)).completeness == "complete"


def test_non_smooth_fold_turns_the_branch_back():
    """x' = p + |x|: two equilibria for p < 0, none for p > 0 (Leine and Nijmeijer 2004)."""
    model = fs.Model({x: p + sp.Abs(x)}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    (branch,) = diagram.branches
    (corner,) = diagram.boundary_equilibria
    assert corner.type == "non-smooth fold"
    # q = 1 where x > 0, in whatever direction the branch is traced
    assert corner.clarke.regions == ("S1", "S2")
    assert corner.clarke.determinants == (1.0, -1.0)
    assert corner.clarke.q_zero == pytest.approx(0.5, abs=1e-15)
    assert branch.values.max() == pytest.approx(0, abs=1e-15)
    assert diagram.at(p=1.0) == []
    assert sorted(e["x"] for e in diagram.at(p=-1.0)) == pytest.approx([-1, 1], abs=1e-15)


def test_persistence_and_planar_clarke_hopf():
    """x' = y + g(x), y' = p − x with g of slope −1 and 1/2: the trace changes sign."""
    field = sp.Piecewise((x / 2, x > 0), (-x, True))
    planar = fs.Model({x: y + field, y: p - x}, parameters={p: 0})
    (corner,) = fs.continue_equilibria(planar, "p", (-1, 1)).boundary_equilibria
    assert corner.type == "persistence"
    assert [np.trace(j) for j in corner.clarke.jacobians] == [0.5, -1.0]
    assert corner.clarke.q_hopf == pytest.approx(2 / 3, abs=1e-15)
    (form,) = fs.derive(planar).boundary_equilibria
    assert form.clarke.regions == corner.clarke.regions
    assert form.clarke.q_hopf == sp.Rational(2, 3)
    assert [np.array(j, dtype=float).tolist() for j in form.clarke.jacobians] == (
        corner.clarke.jacobians.tolist()
    )


@pytest.mark.parametrize(("sign", "kind"), [(1, "persistence"), (-1, "non-smooth fold")])
def test_filippov_branches_go_on_as_pseudo_equilibria(sign, kind):
    """x' = p − x ∓ sgn x: at p = ±1 the equilibrium meets the sliding segment."""
    model = fs.Model({x: p - x - sign * sp.sign(x)}, parameters={p: 0})
    assert not model.continuous["x"]
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    assert {b.type for b in diagram.boundary_equilibria} == {kind}
    assert sorted(b["p"] for b in diagram.boundary_equilibria) == pytest.approx([-1, 1], abs=1e-14)
    (branch,) = diagram.branches
    mode = "S1|S2" if sign > 0 else "S1|S2 (escaping)"
    assert list(dict.fromkeys(branch.region.tolist())) == ["S2", mode, "S1"]
    assert np.abs(branch["x"][branch.region == mode]).max() == 0


def test_slowly_forced_van_der_pol():
    """x'' − μ(1 − x²)x' + x = w: equilibrium x = w, Hopf at w = ±1 with ω = 1."""
    w, t = sp.symbols("w t")
    model = fs.Model({x: y, y: (1 - x**2) * y - x + w}, forcing={w: 2 * sp.sin(t / 100)}).frozen()
    diagram = fs.continue_equilibria(model, "w", (-2, 2))
    assert [h["w"] for h in diagram.special("HB")] == pytest.approx([-1, 1], abs=1e-13)
    assert [h.frequency for h in diagram.special("HB")] == pytest.approx([1, 1], abs=1e-13)
    assert [e.stability for e in diagram.at(w=0)] == ["unstable"]
    assert diagram.at(w=1.5)[0].stable


def test_two_interfaces_with_different_slopes():
    """Piecewise linear, x' = w − x − 3(x − 1)₊ + 2(x + 1)₋: corners at w = 1 and w = −1."""
    w, t = sp.symbols("w t")
    pull = sp.Piecewise((3 * (x - 1), x > 1), (2 * (x + 1), x < -1), (0, True))
    model = fs.Model({x: w - x - pull}, forcing={w: 5 * sp.sin(t / 50)}).frozen()
    diagram = fs.continue_equilibria(model, "w", (-4, 5))
    assert [b["w"] for b in diagram.boundary_equilibria] == pytest.approx([-1, 1], abs=1e-14)
    assert {b.type for b in diagram.boundary_equilibria} == {"persistence"}
    values = {-4.0: -2.0, 0.5: 0.5, 5.0: 2.0}
    for load, state in values.items():
        assert [e["x"] for e in diagram.at(w=load)] == pytest.approx([state], abs=1e-14)


def test_badly_scaled_states():
    """The cusp with x in units of 10⁶ and p in units of 10⁻⁶."""
    a, b = 1e6, 1e-6
    model = fs.Model({x: a * (p / b + x / a - (x / a) ** 3)}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1e-6, 1e-6))
    bound = 2e-6 / (3 * np.sqrt(3))
    assert [f["p"] for f in diagram.folds] == pytest.approx([bound, -bound], rel=1e-12)


def test_twelve_states():
    names = sp.symbols("s0:12")
    rates = {s: names[k - 1] - s for k, s in enumerate(names)}
    rates[names[0]] = p + names[0] - names[0] ** 3 + (names[-1] - names[0]) / 10
    diagram = fs.continue_equilibria(fs.Model(rates, parameters={p: 0}), "p", (-1, 1))
    bound = 2 / (3 * np.sqrt(3))
    assert sorted(f["p"] for f in diagram.folds) == pytest.approx([-bound, bound], rel=1e-12)


def test_switching_at_branch_points_alone_finds_the_other_branches(monkeypatch):
    """Starts are kept off every state but x = 0; the circle x² + p² = 1 crosses there twice."""
    solve = starts.solve_at

    def at_zero(*given, **settings):
        found = solve(*given, **settings)
        return Equilibria([e for e in found if abs(e["x"]) < 1e-8], found.completeness)

    monkeypatch.setattr(starts, "solve_at", at_zero)
    model = fs.Model({x: x * (1 - p**2 - x**2)}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    assert len(diagram.branches) == 2
    loop = diagram.branches[1]
    assert loop.closed
    assert np.hypot(loop["x"], loop["p"]) == pytest.approx(np.ones(len(loop)), abs=1e-13)
    assert {b.label for b in diagram.special("BP")} == {"BP1", "BP2"}
    # the tangent of the other branch: along p on the circle, along x on the line
    for point in diagram.branches[0].special("BP"):
        assert np.abs(point.switch[1]) < 1e-6
    for point in loop.special("BP"):
        assert np.abs(point.switch[0]) < 1e-6


def test_transcritical_tangents():
    """x(p − 2x) = 0: slopes 0 and 1/2."""
    model = fs.Model({x: x * (p - 2 * x)}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    points = [point for branch in diagram.branches for point in branch.special("BP")]
    slopes = sorted(point.switch[0] / point.switch[1] for point in points)
    # of the two branches; the diagram lists the point once
    assert len(diagram.special("BP")) == 1
    assert {point.label for point in points} == {"BP1"}
    assert slopes == pytest.approx([0, 0.5], abs=1e-7)


@pytest.mark.sample(0)
def test_twenty_states():
    """A ring of twenty bistable cells, coupled so that all are alike: folds at ±2/√27."""
    names = sp.symbols("s0:20")
    rates = {
        s: p + s - s**3 + (names[k - 1] + names[(k + 1) % 20] - 2 * s) * 12
        for k, s in enumerate(names)
    }
    model = fs.Model(rates, parameters={p: 0})
    settings = fs.Continuation(starts=1)
    diagram = fs.continue_equilibria(model, "p", (-1, 1), continuation=settings)
    bound = 2 / (3 * np.sqrt(3))
    uniform = [f["p"] for f in diagram.folds if np.ptp(f.state) < 1e-9]
    assert sorted(uniform) == pytest.approx([-bound, bound], rel=1e-12)
    for branch in diagram.branches:
        values = np.array([field_of(branch.state[k], branch.values[k]) for k in range(len(branch))])
        assert np.abs(values).max() < 1e-11


def field_of(s, level):
    return level + s - s**3 + (np.roll(s, 1) + np.roll(s, -1) - 2 * s) * 12


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("unit", "time"), [(1e6, 1.0), (1e-6, 1.0), (1.0, 1e6), (1e6, 1e-6), (1e-6, 1e6)]
)
def test_badly_scaled(unit, time):
    """The reactor with u2 and p1 in units of 10⁶ or 10⁻⁶ and another unit of time."""
    a, b, c = u1, u2 / unit, p1 * unit
    rate = c * (1 - a) * sp.exp(b)
    model = fs.Model(
        {u1: time * (-a + rate), u2: unit * time * (-b + 14 * rate - 2 * b)}, parameters={p1: 0}
    )
    diagram = fs.continue_equilibria(model, p1, (0, 0.2 / unit))
    assert [f["p1"] * unit for f in diagram.folds] == pytest.approx(
        [0.105738978271650651, 0.0889318461857728026], rel=1e-12
    )
    (hopf,) = diagram.special("HB")
    assert hopf["p1"] * unit == pytest.approx(0.130900044820043325, rel=1e-12)
    assert hopf["u2"] / unit == pytest.approx(4.17704, rel=1e-5)
    assert all(p.converged for p in diagram.special)
    assert [o.code for o in diagram.branches[0].outcomes] == ["end of range"] * 2
