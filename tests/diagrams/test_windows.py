"""Windows in the states: branches that leave them, by closed forms and NumPy's roots."""

import matplotlib as mpl
import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.solve import equations
from fastslow.diagrams.trace import tracing
from fastslow.diagrams.trace.across_regions import trace_across_regions
from tests.campaigns.windows import campaign

pytestmark = pytest.mark.slow

x, y, v, p = sp.symbols("x y v p")
TENTH = sp.Rational(1, 10)


def traced(rates, over=(-1, 1), **options):
    return fs.continue_equilibria(fs.Model(rates, parameters={p: 0.3}), p, over, **options)


def rows(diagram):
    return sum(map(len, diagram))


def codes(diagram):
    return [[o.code for o in branch.outcomes] for branch in diagram]


def test_a_sample_of_the_campaign_of_random_diagrams():
    report = campaign(2, seed=2)
    assert not report.failures, str(report)
    assert report.branches >= 3


# ---------------------------------------------------------------- to infinity

LEFT, END = "left the window", "end of range"


def test_a_quadratic_whose_root_goes_through_infinity():
    """x = (1 ± √(1 − 2p/5))/(2p): three curves, two of them with a pole at p = 0."""
    diagram = traced({x: p * x**2 - x + TENTH})
    assert codes(diagram) == [[END, LEFT], [END, END], [LEFT, END]]
    assert rows(diagram) < 600
    assert diagram.completeness == "complete"
    assert "x in [" in repr(diagram)
    for branch, side in zip(diagram, (1, -1, 1), strict=True):
        root = np.sqrt(1 - 0.4 * branch["p"])
        expected = 0.2 / (1 + root) if side < 0 else (1 + root) / (2 * branch["p"])
        np.testing.assert_allclose(branch["x"], expected, rtol=1e-13)
    low, high = diagram.window["x"]
    assert diagram[0]["x"][-1] == low
    assert diagram[2]["x"][0] == high


def test_a_hyperbola():
    diagram = traced({x: 1 - p * x})
    assert codes(diagram) == [[END, LEFT], [LEFT, END]]
    assert rows(diagram) < 600
    for branch in diagram:
        np.testing.assert_allclose(branch["x"] * branch["p"], 1, rtol=1e-13)
        assert branch.special("LP") == ()
        assert "may go to infinity" in str(branch.outcome)


def test_an_end_at_infinity_is_no_regular_end():
    (branch, _) = traced({x: 1 - p * x})
    assert not branch.outcome
    (branch, _) = traced({x: 1 - p * x}, window={x: (-50, 50)})
    assert branch.outcome
    assert branch["x"][-1] == -50


@pytest.mark.parametrize("state", [1e-6, 1e6])
@pytest.mark.parametrize("parameter", [1e-6, 1e6])
def test_the_default_window_has_no_units(state, parameter):
    X, P = x / state, p / parameter
    diagram = traced({x: P * X**2 - X + TENTH}, (-parameter, parameter))
    plain = traced({x: p * x**2 - x + TENTH})
    assert codes(diagram) == codes(plain)
    for branch, other in zip(diagram, plain, strict=True):
        assert len(branch) == len(other)
        np.testing.assert_allclose(branch["x"] / state, other["x"], rtol=1e-9)
        np.testing.assert_allclose(branch["p"] / parameter, other["p"], rtol=1e-9, atol=1e-15)


def test_bratu():
    """u'' + p exp(u) = 0: the upper branch goes to infinity as p → 0."""
    # at seven points, symmetric about the fourth
    states = sp.symbols("u1:5")
    padded = (0, *states, states[2])
    rates = {
        u: (padded[k] - 2 * u + padded[k + 2]) * 8**2 + p * sp.exp(u) for k, u in enumerate(states)
    }
    diagram = traced(rates, (0, 4))
    assert rows(diagram) < 900
    assert len(diagram.folds) == 1
    # Keller and Antman (1969): the fold of the boundary value problem is at 3.5138
    assert diagram.folds[0]["p"] == pytest.approx(3.51, abs=0.03)


def numbers(seed):
    """Coefficients of a cubic in x, of degree two in p, whose first one vanishes within (−1, 1)."""
    generator = np.random.default_rng(seed)
    table = generator.integers(-5, 6, (4, 3))
    table[0] = [4, int(generator.integers(-4, 5)), -1]
    return table


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(12))
def test_random_cubics_with_poles(seed):
    table = numbers(seed)
    rate = sum(int(c) * x ** (3 - i) * p ** (2 - j) for (i, j), c in np.ndenumerate(table))
    diagram = traced({x: rate})
    assert diagram.completeness == "complete"
    assert any(LEFT in ends for ends in codes(diagram))
    assert rows(diagram) < 400 * len(diagram)
    low, high = diagram.window["x"]
    for value in np.random.default_rng(seed).uniform(-1, 1, 40):
        roots = np.roots([np.polyval(c, value) for c in table])
        real = np.sort(roots.real[np.abs(roots.imag) < 1e-9 * np.maximum(1, abs(roots))])
        found = np.sort([e["x"] for e in diagram.at(p=value)])
        np.testing.assert_allclose(found, real[(real >= low) & (real <= high)], rtol=1e-6)


def test_what_comes_back_is_traced():
    """x = 1/((p − 1/4)² + 10⁻⁹) − 1/((p + 1/4)² + 10⁻⁹): both peaks are beyond the window."""
    tiny = sp.Rational(1, 10**9)
    first, second = (p - sp.Rational(1, 4)) ** 2 + tiny, (p + sp.Rational(1, 4)) ** 2 + tiny
    diagram = traced({x: first * second * x - second - first})
    assert diagram.completeness == "complete"
    assert sorted(codes(diagram)) == [[END, LEFT], [LEFT, END], [LEFT, LEFT]]
    assert diagram.at(p=0.0)[0]["x"] == pytest.approx(2 / (1 / 16 + 1e-9), rel=1e-12)


# ---------------------------------------------------------------- windows asked for


def test_a_window_cuts_a_fold():
    diagram = traced({x: p + x**2}, window={x: (-0.5, 0.25)})
    (branch,) = diagram
    assert branch["x"][[0, -1]].tolist() == [-0.5, 0.25]
    np.testing.assert_allclose(branch["p"][[0, -1]], [-0.25, -0.0625], atol=1e-15)
    assert codes(diagram) == [[LEFT, LEFT]]
    assert all(branch.outcomes)
    assert diagram.completeness == "complete"
    assert len(diagram.folds) == 1
    assert "x in [-0.5, 0.25]" in repr(diagram)


def test_a_window_at_the_fold_itself():
    (branch,) = traced({x: p + x**2}, window={x: (0, None)})
    assert branch["x"].min() == 0
    assert branch["x"].max() == 1
    assert len(branch) < 300


@pytest.mark.parametrize(("edge", "count"), [(0, 1), (1e-14, 1), (-1e-6, 2), (1e-6, 1)])
def test_an_edge_tangent_to_the_branch(edge, count):
    """x = −p² touches 0 and does not cross it; an edge just below cuts it in two."""
    diagram = traced({x: x + p**2}, window={x: (None, edge)})
    assert len(diagram) == count
    assert diagram.completeness == "complete"
    if count == 2:
        ends = sorted([diagram[0]["p"][-1], diagram[1]["p"][0]])
        np.testing.assert_allclose(ends, [-1e-3, 1e-3], rtol=1e-9)
    assert rows(diagram) < 400


def test_a_window_between_all_starts():
    """Of x² = −p only 0.5 ≤ x ≤ 0.6 is wanted, which no usual start is on."""
    diagram = traced({x: p + x**2}, window={"x": (0.5, 0.6)})
    np.testing.assert_allclose(np.sort(diagram[0]["p"][[0, -1]]), [-0.36, -0.25], atol=1e-15)


def test_a_window_between_all_starts_of_a_transcendental_model():
    """Of sinh² x = −p the part 0.52 ≤ x ≤ 0.55 lies between any values tried."""
    diagram = traced({x: p + sp.sinh(x) ** 2, y: x - y}, window={x: (0.52, 0.55)})
    (branch,) = diagram
    assert diagram.completeness == "found"
    np.testing.assert_allclose(
        np.sort(branch["p"][[0, -1]]), [-(np.sinh(0.55) ** 2), -(np.sinh(0.52) ** 2)], rtol=1e-12
    )


def test_a_window_that_excludes_all():
    diagram = traced({x: p + x**2}, window={x: (5, 6)})
    assert len(diagram) == 0
    assert diagram.completeness == "complete"
    assert diagram.window["x"] == (5, 6)


def test_a_second_state_and_no_bound():
    """y = 1/p follows x: its bound is met first, however far x may go."""
    diagram = traced({x: 1 - p * x, y: x / 2 - y}, window={y: (-3, 3), x: (-np.inf, np.inf)})
    np.testing.assert_allclose([b["y"][e] for b, e in zip(diagram, (-1, 0), strict=True)], [-3, 3])
    np.testing.assert_allclose(diagram[0]["p"][-1], -1 / 6, rtol=1e-14)


def test_a_vertical_branch():
    """At p = 0 all of y = 0, x is an equilibrium: the line ends on the edges."""
    diagram = traced({x: p * (1 - x), y: -y}, window={x: (-2, 3)})
    vertical = [b for b in diagram if np.ptp(b["x"]) > 1]
    for branch in vertical:
        assert sorted(branch["x"][[0, -1]].tolist()) == [-2, 3]


def test_in_a_filippov_model():
    """The pseudo-equilibria y = 2p of a switched plane end on the window's edge."""
    rates = {x: sp.Piecewise((-1, x > 0), (1, True)), y: 2 * p - y}
    diagram = traced(rates, window={y: (-0.5, 0.5)})
    (branch,) = diagram
    assert branch.regions == ("S1|S2",)
    np.testing.assert_allclose(branch["p"][[0, -1]], [-0.25, 0.25], atol=1e-15)
    assert codes(diagram) == [[LEFT, LEFT]]


def test_an_interface_and_an_edge_in_one_step():
    """|x| = p + 1/2 with the edge just before, at and behind the corner."""
    for edge in (-1e-4, 0.0, 1e-4):
        (branch,) = traced({x: p + sp.Rational(1, 2) - sp.Abs(x)}, window={x: (edge, None)})
        assert branch["x"].min() == edge
        assert set(branch.regions) == ({"S1", "S2"} if edge < 0 else {"S1"})


def test_equilibria_without_negative_concentrations():
    """Two competitors: of four equilibria those with both densities at least 0."""
    rates = {x: x * (1 - x - p * y), y: y * (1 - y - p * x)}
    model = fs.Model(rates, parameters={p: -2})
    assert len(fs.equilibria(model)) == 4
    kept = fs.equilibria(model, window={x: (0, None), "y": (0, None)})
    assert sorted(e.state.tolist() for e in kept) == [[0, 0], [0, 1], [1, 0]]
    diagram = fs.continue_equilibria(model, p, (-3, 3), window={x: (0, None), y: (0, None)})
    assert min(b.state.min() for b in diagram) >= -1e-14


def test_a_figure_is_scaled_to_the_finite_part():
    """The fold of x = p² − 1 is not squashed by the hyperbola x = 1/p; the lines are whole."""
    mpl.use("Agg")
    diagram = traced({x: (1 - p * x) * (x - p**2 + 1)})
    drawn = fs.plot.diagram(diagram)
    low, high = drawn.ax.get_ylim()
    assert -60 < low < -1
    assert 1 < high < 60
    assert max(np.nanmax(np.abs(line.get_ydata())) for line in drawn.lines) > 1e3
    assert "EP end point" not in drawn.data
    # a bound that was asked for is drawn to its edge
    low, high = fs.plot.diagram(traced({x: 1 - p * x}, window={x: (-500, 500)})).ax.get_ylim()
    assert low < -500 < 500 < high


def test_the_window_is_kept_in_a_file(tmp_path):
    diagram = traced({x: 1 - p * x}, window={x: (None, 50)})
    diagram.save(tmp_path / "hyperbola.npz")
    again = fs.load(tmp_path / "hyperbola.npz")
    assert again.window == diagram.window
    assert repr(again) == repr(diagram)
    assert again.window.given == ((False, True),)


def test_of_infinitely_many_equilibria_those_in_the_window():
    """Solutions of sin x = exp x beside mpmath; others are found as far as -1e14."""
    model = fs.Model({x: sp.sin(x) - sp.exp(x)})
    found = sorted(e["x"] for e in fs.equilibria(model, window={x: (-30, 5)}))
    exact = [mpmath.findroot(lambda s: mpmath.sin(s) - mpmath.exp(s), -k * mpmath.pi)
             for k in range(9, 0, -1)]  # fmt: skip
    np.testing.assert_allclose(found, np.array(exact, dtype=float), rtol=1e-13)


#: Rates and the values at which a branch leaves at x = 0 or y = 0, where it meets another one:
#: exact, and p tanh(p)² = 1.
INVARIANT = {
    "tanh": (
        {x: x * (sp.tanh(p) - x - y**2), y: y * (1 - y - x**2 * p)},
        [float(mpmath.findroot(lambda q: q * mpmath.tanh(q) ** 2 - 1, 1.3))],
    ),
    "exp": (
        {x: x * (1 - x**2 - p * y * sp.exp(-y)), y: y * (2 - y - x * p)},
        [2, np.exp(2) / 2],
    ),
    "quotient": (
        {
            x: x * (1 - x) * (x - sp.Rational(1, 5)) - p * x * y / (1 + 3 * x),
            y: y * (x / (1 + 3 * x) - p**2 / 4),
        },
        [0.5**0.5, 1],
    ),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", INVARIANT)
def test_a_branch_that_leaves_at_an_invariant_edge_ends_at_its_branch_point(name):
    """All points within the edge y = 0 solve F = 0 there: the branch ends where it meets them."""
    rates, exact = INVARIANT[name]
    diagram = traced(rates, (0.1, 4), window={x: (0, None), y: (0, None)})
    ends = []
    for branch in diagram:
        points = [q["p"] for q in branch.special("BP")]
        for row, outcome in zip((0, -1), branch.outcomes, strict=True):
            if outcome.code == "left the window":
                ends.append(branch.values[row])
                assert min(abs(ends[-1] - point) for point in points) < 1e-12
    assert sorted(ends) == pytest.approx(exact, abs=1e-13)
    assert not diagram.unexplained


@pytest.fixture
def traces(monkeypatch):
    """The starting points of all traces; fewer equilibria are searched for than by default."""
    found = []

    def counted(field, region, start, *given, **named):
        found.append(start)
        return trace_across_regions(field, region, start, *given, **named)

    monkeypatch.setattr(tracing, "trace_across_regions", counted)
    monkeypatch.setattr(equations, "MANY", 60)
    return found


def test_an_angle_that_is_not_declared_is_traced_once_per_curve(traces):
    """Equilibria far outside the window are copies of those near it: there were 3,600 traces."""
    x, v, p = sp.symbols("x v p")
    model = fs.Model({x: v, v: p - sp.sin(x) - v}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1.5, 1.5), window={x: (-9, 9)})
    (branch,) = diagram.branches
    assert branch["p"] == pytest.approx(np.sin(branch["x"]), abs=1e-12)
    assert [branch["x"].min(), branch["x"].max()] == [-9, 9]
    assert len(traces) < 100


def test_copies_of_a_closed_curve_are_all_in_the_window(traces):
    """Closed curves p² = cos x − 1/2 about 0, ±2π and ±4π, the last cut at x = ±12."""
    x, v, p = sp.symbols("x v p")
    model = fs.Model({x: v, v: p**2 + sp.Rational(1, 2) - sp.cos(x) - v}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1.5, 1.5), window={x: (-12, 12)})
    middles = sorted(float(np.round(b["x"].mean() / np.pi)) for b in diagram.branches)
    assert middles == [-4, -2, 0, 2, 4]
    assert len(traces) < 150


def test_an_edge_that_contains_the_equilibria_leaves_the_diagram_complete():
    # a state that is zero at all equilibria, beside two polynomials that are not solved apart
    rates = {x: p - x**3 - x * y**2 + y, y: x**2 - y - y**3, v: -2 * v}
    diagram = traced(rates, window={"v": (0, 1)})
    assert diagram.completeness == "complete"
    assert [point.code for point in diagram.special("LP")] == ["LP", "LP"]


def test_a_branch_that_touches_an_edge_on_an_interface_goes_on():
    # oxidation of CO on platinum (Krischer, Eiswirth & Ertl 1992): slope 0 on both sides of u = 1/2
    u, w = x, y
    rest = (u**3 - 21 * u**2 / 20 + 3 * u / 10 - sp.Rational(13, 500)) / -sp.Rational(27, 2000)
    phase = sp.Piecewise((0, u <= sp.Rational(1, 5)), (rest, u < sp.Rational(1, 2)), (1, True))
    free = 585800 * 6.67e-5 * (1 - u) ** 2 * (1 - v) ** 2
    rates = {
        u: 313500 * p * (1 - u**3) - 10.21 * u - 283.8 * u * v,
        v: free * (0.6 * w + 0.4 * (1 - w)) - 283.8 * u * v,
        w: 1.61 * (phase - w),
    }
    window = dict.fromkeys(["x", "v", "y"], (0, 1))
    (branch,) = traced(rates, (3.83e-5, 3.84e-5), window=window)
    assert branch.range == (3.83e-5, 3.84e-5)
    assert [(q.code, q.type) for q in branch.special if q.code != "EP"] == [
        ("LP", None), ("BE", "persistence"), ("LP", None),
    ]  # fmt: skip


@pytest.mark.parametrize("rate", [1, 3, 0.1])
def test_a_branch_that_leaves_at_an_interface_has_the_type_of_its_determinants(rate):
    # they are −rate and rate, or of one sign
    for slope, expected in ((-1, "non-smooth fold"), (0.3, "persistence")):
        turning = sp.Piecewise((1 + slope * (x - 1), x > 1), (x, True))
        rates = {x: (p - turning) / 3, y: rate * (x - y)}
        (branch,) = traced(rates, (0.5, 2), window={"x": (0, 1)})
        (point,) = branch.special("BE")
        assert point.type == expected
        assert point.clarke.determinants[0] == pytest.approx(slope * rate / 3, abs=1e-14)


def test_a_curve_with_many_copies_of_its_equilibria_is_one_branch():
    # x = arcsin(p): copies of equilibria far away were inaccurate starts of further branches
    model = fs.Model({x: p - sp.sin(x)}, parameters={p: 0.5})
    coarse = fs.Continuation(max_step=0.1, starts=1)
    window = {x: (-8, 8)}
    diagram = fs.continue_equilibria(model, "p", (-2, 2), window=window, continuation=coarse)
    (branch,) = diagram.branches
    assert diagram.outcome.code == "searched"
    assert np.abs(np.sin(branch["x"]) - branch["p"]).max() < 1e-9
    turns = np.pi * np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5])
    assert np.sort(diagram.folds["x"]) == pytest.approx(turns[np.abs(turns) < 8], rel=1e-9)
