"""Pseudo-equilibria of discontinuous models against closed forms.

With f₁ on h > 0, f₂ on h < 0, a = ∇h·f₁ and b = ∇h·f₂ they solve b f₁ = a f₂ on h = 0.
"""

import pickle

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import fastslow as fs
from tests.samples import examples

pytestmark = pytest.mark.slow

x, y, z, p, v, w = sp.symbols("x y z p v w")


def switched(h, above, below, numbers=()):
    """The model over p with rates ``above`` where h > 0 and ``below`` elsewhere."""
    rates = {
        s: sp.Piecewise((f, h > 0), (g, True))
        for s, f, g in zip((x, y, z), above, below, strict=False)
    }
    return fs.Model(rates, parameters={p: 0, **dict.fromkeys(numbers, 1)})


k = sp.symbols("k1:9")

#: Boundary equilibria at p = 0 with T, D, c, e = k1, …, k4.
NORMAL_FORM = switched(x, (k[0] * x + y, p - k[1] * x), (k[2], k[3]), k[:4])

#: Affine fields of y beside the parabola x = y².
PARABOLA = switched(
    x - y**2,
    (k[0] + k[1] * y, k[2] + k[3] * y + p),
    (k[4] + k[5] * y, k[6] + k[7] * y + p),
    k,
)

#: A system with (x, y, p) → −(x, y, p), c, m, d, κ = k1, …, k4.
RELAY = fs.Model(
    {x: y - k[0] * sp.sign(x), y: p - k[3] * x - k[2] * y - k[1] * sp.sign(x)},
    parameters={p: 0, **dict.fromkeys(k[:4], 1)},
)


NONZERO = st.one_of(st.floats(0.25, 2), st.floats(-2, -0.25))


def regions(branch):
    return list(dict.fromkeys(branch.region.tolist()))


def turns(branch, point):
    """Whether the parameter turns back at a boundary equilibrium of the branch."""
    row = branch.special_rows[list(branch.special).index(point)]
    before = branch.values[row] - branch.values[row - 1]
    after = branch.values[row + 2] - branch.values[row + 1]
    return before * after < 0


# ---------------------------------------------------------------- the plane


@settings(max_examples=examples(15), deadline=None)
@given(st.floats(-2, 2), NONZERO, NONZERO, NONZERO)
def test_normal_form_of_boundary_equilibria(t, d, c, e):
    """f₁ = (T x + y, p − D x), f₂ = (c, e): at p = 0 the subtype is that of e/D.

    Equilibrium x = p/D, pseudo-equilibrium y = c p/e with eigenvalue −e²/(c (e − p))
    (Kuznetsov, Rinaldi and Gragnani 2003; di Bernardo et al. 2008).
    """
    model = NORMAL_FORM.with_parameters(k1=t, k2=d, k3=c, k4=e)
    diagram = fs.continue_equilibria(model, p, (-0.1, 0.1))
    (branch,) = diagram.branches
    (point,) = diagram.boundary_equilibria
    assert np.abs([point["x"], point["y"], point["p"]]).max() < 1e-14
    assert point.type == ("persistence" if e / d > 0 else "non-smooth fold")
    assert turns(branch, point) == (e / d < 0)
    mode = "S1|S2" if c > 0 else "S1|S2 (escaping)"
    assert set(point.regions) == {"S1", mode}
    rows = branch.region == mode
    assert np.abs(branch["y"] - c * branch["p"] / e)[rows].max() < 1e-13
    expected = -(e**2) / (c * (e - branch["p"][rows]))
    assert np.abs(branch.eigenvalues[rows, 0] / expected - 1).max() < 1e-11
    assert np.all(branch.eigenvalues[rows, 1].real == (-np.inf if c > 0 else np.inf))
    kind = {True: "pseudo-node", False: "pseudo-saddle"}[bool((expected[0] < 0) == (c > 0))]
    value = float(branch["p"][rows][len(expected) // 2])
    assert {q.type for q in diagram.at(p=value) if q.pseudo} == {kind}


@pytest.fixture(scope="module")
def folded():
    """b f₁ = a f₂ is p = 2 − y − y²: a pseudo-saddle-node at y = −1/2, p = 9/4."""
    return fs.continue_equilibria(switched(x, (y - 2 - x, p + y**2), (1, -1)), p, (-6, 4))


def test_pseudo_saddle_node(folded):
    (fold,) = folded.folds
    assert fold.state == pytest.approx([0, -0.5], abs=1e-13)
    assert fold["p"] == pytest.approx(2.25, rel=1e-15)
    assert fold.regions == ("S1|S2",)
    # the sliding field along x = 0 is (p + y² + y − 2)/(3 − y): half its second derivative
    assert fold.coefficient == pytest.approx(2 / 7, rel=1e-9)
    lower, upper = sorted(folded.at(p=1), key=lambda e: e["y"])
    root = np.sqrt(1.25)
    assert (lower["y"], upper["y"]) == pytest.approx((-0.5 - root, -0.5 + root), rel=1e-14)
    assert (lower.type, upper.type) == ("pseudo-node", "pseudo-saddle")
    for point in (lower, upper):
        value = (2 * point["y"] + 1) / (3 - point["y"])
        assert point.eigenvalues[0].real == pytest.approx(value, rel=1e-12)


def test_pseudo_equilibria_end_at_the_region_whose_field_vanishes(folded):
    """At y = 2, p = −4, where α = 0, the branch goes on as the saddle x = y − 2, y² = −p."""
    (point,) = folded.boundary_equilibria
    assert (point["x"], point["y"], point["p"]) == pytest.approx((0, 2, -4), abs=1e-13)
    assert point.type == "persistence"
    (branch,) = [b for b in folded.branches if point in b.special]
    assert not turns(branch, point)
    outside = branch.region == "S1"
    assert np.abs(branch["y"] ** 2 + branch["p"])[outside].max() < 1e-12
    assert np.abs(branch["x"] - branch["y"] + 2)[outside].max() < 1e-13


def test_a_two_fold_ends_both_branches():
    """f₁ = (2 − eʸ, 1), f₂ = (y − p, −2): a = b = 0 at y = p = log 2."""
    model = switched(x, (2 - sp.exp(y), 1), (y - p, -2))
    diagram = fs.continue_equilibria(model, p, (0, 1.2))
    ends = {}
    for branch in diagram.branches:
        assert np.abs(branch["y"] - branch["p"] + 2 * (2 - np.exp(branch["y"]))).max() < 1e-12
        (name,) = regions(branch)
        ends[name] = [
            (o, s) for o, s in zip(branch.outcomes, (0, -1), strict=True) if o.code == "two-fold"
        ]
        for outcome, side in ends[name]:
            assert outcome.success
            assert "both fields are tangent to x = 0 at (x = 0, y = 0.693147" in outcome.message
            end = [branch["y"][side], branch["p"][side]]
            assert end == pytest.approx([np.log(2)] * 2, abs=1e-14)
            assert branch.special[side].residual < 1e-14
    assert {n: len(e) for n, e in ends.items()} == {"S1|S2": 1, "S1|S2 (escaping)": 1}


def test_the_eigenvalue_beside_a_two_fold():
    """f₁ = (−y, 1), f₂ = (y − p, −2): y = −p with eigenvalue 1/(3p), infinite at p = 0."""
    diagram = fs.continue_equilibria(switched(x, (-y, 1), (y - p, -2)), p, (-1, 1))
    assert diagram.completeness == "complete"
    for branch in diagram.branches:
        assert np.abs(branch["y"] + branch["p"]).max() < 1e-15
        inner = np.abs(branch["p"]) > 1e-6
        assert inner.sum() >= len(branch) - 1
        error = branch.eigenvalues[inner, 0] * 3 * branch["p"][inner] - 1
        assert np.abs(error).max() < 1e-12
    assert {e.type for e in diagram.at(p=-0.5)} == {"pseudo-node"}
    assert {(e.type, e.stability) for e in diagram.at(p=0.5)} == {("pseudo-node", "unstable")}


def test_equal_drifts_leave_nothing_to_slide():
    """Relay x' = v, v' = p − x − v/5 − sgn(x − 1)/4: both drifts are v, and motions turn there."""
    model = fs.Model({x: v, v: p - x - v / 5 - sp.sign(x - 1) / 4}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, p, (-1, 3))
    assert diagram.regions == ("S1", "S2")
    assert sorted(b["p"] for b in diagram.boundary_equilibria) == pytest.approx([0.75, 1.25])
    for branch in diagram.branches:
        assert "two-fold" in {o.code for o in branch.outcomes}
    (one,) = diagram.at(p=1)
    assert (one["x"], one["v"], one.type, one.stability) == (1, 0, "fused focus", "stable")
    # a third of the friction
    assert one.eigenvalues.real == pytest.approx([-1 / 15, -2 / 15], rel=1e-14)
    (band,) = diagram.bands
    assert band.range == pytest.approx((0.75, 1.25), rel=1e-9)


def test_dry_friction_rests_on_an_interval():
    """v' = p − x − μ sgn v: every |x − p| ≤ μ at v = 0 is a pseudo-equilibrium."""
    model = fs.Model({x: v, v: p - x - v / 5 - sp.Rational(3, 8) * sp.sign(v)}, parameters={p: 0})
    found = [e for e in fs.equilibria(model, p=1) if e.continuum]
    assert sorted(e["x"] for e in found) == pytest.approx([0.625, 1.375], abs=1e-15)
    assert all(e.pseudo and e.type == "non-hyperbolic" for e in found)


def test_a_corner_of_the_sliding_field():
    """A continuous interface y = 0 across sliding along x = 0: y' = p − |y| or p − y − |y|/2."""
    for tangential, kind in (
        (p - sp.Abs(y), "non-smooth fold"),
        (p - y - sp.Abs(y) / 2, "persistence"),
    ):
        rate = sp.Piecewise((y / 3 - 1, x > 0), (1, True))
        model = fs.Model({x: rate, y: tangential}, parameters={p: 0})
        diagram = fs.continue_equilibria(model, p, (-1, 1))
        (branch,) = diagram.branches
        (corner,) = diagram.boundary_equilibria
        assert corner.type == kind
        assert corner.regions == ("S2|S4", "S1|S3")
        assert abs(corner["p"]) < 1e-14
        assert turns(branch, corner) == (kind == "non-smooth fold")


def test_two_discontinuities_at_once_end_the_branch_in_words():
    model = fs.Model({x: -sp.sign(x) - x / 2, y: p - y - sp.sign(y) / 2 + x}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, p, (-2, 2))
    assert diagram.completeness == "found"
    outcomes = [o for b in diagram.branches for o in b.outcomes if not o.success]
    assert [o.code for o in outcomes] == ["discontinuous interface"] * 2
    assert all("two discontinuities intersect" in o.message for o in outcomes)
    assert sorted(b["p"] for b in diagram.boundary_equilibria) == pytest.approx([-0.5, 0.5])


@settings(max_examples=examples(12), deadline=None)
@given(st.floats(0.3, 2), st.floats(0.2, 1), st.floats(-1, 1), st.floats(0.3, 2))
def test_symmetry(c, m, d, stiffness):
    """(x, y, p) → −(x, y, p) maps a relay system's diagram to itself; y = c p/(c d + m)."""
    assume(abs(c * d + m) > 0.1)
    # x' = y − c speaks for y ~ c, the term d y beside m for y ~ m/d: the natural unit of y is
    # halfway between in logarithms, and at 1e-38 rounding in it is as large as y itself
    assume(d == 0 or abs(d) > 1e-30)
    model = RELAY.with_parameters(k1=c, k2=m, k3=d, k4=stiffness)
    diagram = fs.continue_equilibria(model, p, (-4, 4))
    for branch in diagram.branches:
        rows = branch.region == "S1|S2"
        assert np.abs(branch["y"] * (c * d + m) - c * branch["p"])[rows].max(initial=0) < 1e-12
        assert np.abs(branch["y"])[rows].max(initial=0) <= c * (1 + 1e-12)
        for point in branch.special("BE"):
            assert turns(branch, point) == (point.type == "non-smooth fold")
    for point in diagram.special:
        apart = [
            np.abs([q["x"] + point["x"], q["y"] + point["y"], q["p"] + point["p"]]).max()
            for q in diagram.special
            if q.code == point.code
        ]
        assert min(apart) < 1e-11


@pytest.mark.parametrize("d", [1e-45, 1e-120])
def test_a_term_far_below_rounding_does_not_hide_the_states(d):
    """The natural unit of y is 1e22 and more here: y = ±c at the points is not dust."""
    c, m = 1.3, 0.8
    model = RELAY.with_parameters(k1=c, k2=m, k3=d, k4=1)
    points = fs.continue_equilibria(model, p, (-4, 4)).special("BE")
    assert [(q["y"], q["p"]) for q in points] == [
        pytest.approx((side * c, side * m), rel=1e-14) for side in (-1, 1)
    ]


def test_a_boundary_fold_in_an_invariant_plane():
    """On p = 0 the row of x in F_x is (q − 2x, 0): at x = 0 all of it vanishes at q = 0."""
    rates = {x: x * (y + k[0] + p - x), y: sp.Piecewise((p - y, y > 0), (p - 2 * y, True))}
    model = fs.Model(rates, parameters={p: 0.3, k[0]: -0.7})
    points = fs.continue_equilibria(model, p, (-1, 1)).special("BE")
    (point,) = [q for q in points if abs(q["x"]) < 1e-12]
    curve = fs.continue_points(point, (p, k[0]), {p: (-1, 1), k[0]: (-1, 1)})
    folds = curve.special("BF")
    assert len(folds) >= 1
    assert all(abs(q["k1"]) < 1e-12 and abs(q["x"]) < 1e-12 for q in folds)


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", range(6))
def test_decimal_numbers_are_read_as_they_are_written(seed):
    """Coefficients as decimals and as fractions give the same diagram of a relay system."""
    generator = np.random.default_rng(seed)
    a, b, c, d, e = (round(float(v), 2) for v in generator.uniform(0.1, 1, 5))

    def diagram(write):
        k = [write(v) for v in (a, b, c, d, e)]
        mixing = sp.Piecewise((k[0], y - x > p), (k[1], True))
        rates = {x: k[2] - x - mixing * x, y: k[3] * (k[4] - y) - mixing * y}
        return fs.continue_equilibria(fs.Model(rates, parameters={p: -0.1}), p, (-1, 0.5))

    decimal, exact = diagram(float), diagram(lambda v: sp.Rational(str(v)))
    assert decimal.completeness == exact.completeness
    assert [q.label for q in decimal.special] == [q.label for q in exact.special]
    for one, other in zip(decimal.special, exact.special, strict=True):
        assert one["p"] == pytest.approx(other["p"], rel=1e-12, abs=1e-12)


# ---------------------------------------------------------------- curved interfaces


@settings(max_examples=examples(15), deadline=None)
# the sliding field has a pole at the natural unit of y
@example([-1, 0, 0, 0, 0, -4, 1, 8], 0)
@given(st.lists(st.integers(-8, 8), min_size=8, max_size=8), st.integers(-8, 8))
def test_pseudo_equilibria_on_a_parabola_satisfy_their_definition(numbers, value):
    """h = x − y² with affine fields: b f₁ = a f₂ is one polynomial in y, here by NumPy."""
    above, below = np.array(numbers, dtype=float).reshape(2, 2, 2) / 4
    shift = value / 8
    assume(np.any(above != below))
    model = PARABOLA.with_parameters(dict(zip(k, [*above.ravel(), *below.ravel()], strict=True)))
    poly = np.polynomial.Polynomial
    f1, f2 = ([poly(r[0]), poly([r[1][0] + shift, r[1][1]])] for r in (above, below))
    a, b = (f[0] - poly([0, 2]) * f[1] for f in (f1, f2))
    second = b * f1[1] - a * f2[1]
    assume(second.trim(1e-12).degree() >= 1)
    assume(np.abs((a - b).coef).max() > 0)
    roots = second.roots()
    apart = np.abs(roots[:, None] - roots[None, :])[np.triu_indices(len(roots), 1)]
    assume(apart.min(initial=1) > 1e-2)
    expected = [r.real for r in roots if abs(r.imag) < 1e-9 and a(r.real) * b(r.real) < 0]
    assume(all(abs(a(r) * b(r)) > 1e-3 for r in expected))
    assume(all(abs(r.imag) > 1e-3 or abs(r.imag) < 1e-9 for r in roots))
    assume(all(abs(a(r.real)) > 1e-3 and abs(b(r.real)) > 1e-3 for r in roots))
    found = [e for e in fs.equilibria(model, p=shift) if e.pseudo and not e.continuum]
    assert sorted(e["y"] for e in found) == pytest.approx(sorted(expected), abs=1e-9)
    for point in found:
        s = point["y"]
        share = a(s) / (a(s) - b(s))
        assert 0 < share < 1
        assert point["x"] == pytest.approx(s**2, abs=1e-12)
        weighted = [(1 - share) * g(s) + share * q(s) for g, q in zip(f1, f2, strict=True)]
        assert np.abs(weighted).max() < 1e-10
        assert point.region == ("S1|S2" if a(s) < 0 else "S1|S2 (escaping)")


def test_a_circle_as_interface():
    """Special points of f_s on x² + y² = 1, with their equations left over at rounding."""
    model = switched(x**2 + y**2 - 1, (p - x - y, x - y), (6 * x / 5 + y + p / 2, 2 * y - x))
    diagram = fs.continue_equilibria(model, p, (-3, 3))
    corners = diagram.boundary_equilibria
    # equilibrium of S1 at x = y = p/2: on the circle at p = ±√2
    assert {round(abs(b["p"]), 13) for b in corners if "S1" in b.regions} == {round(np.sqrt(2), 13)}
    assert corners
    for branch in diagram.branches:
        for point in branch.special("BE"):
            assert turns(branch, point) == (point.type == "non-smooth fold")
            assert point.residual < 1e-13
        on = np.array(["|" in r for r in branch.region.tolist()])
        assert np.abs(branch["x"] ** 2 + branch["y"] ** 2 - 1)[on].max(initial=0) < 1e-13


# ---------------------------------------------------------------- space


def test_hopf_point_of_a_sliding_field():
    """f₁ = (−2 + y, M₁ u), f₂ = (1 + z, M₂ u), u = (y, z): J = M₁/3 + 2 M₂/3 at u = 0.

    M₁ = ((p, −3), (3, p)) and M₂ = p make the eigenvalues p ± i; the normal form is
    held to that of the sliding field written out as a planar model.
    """
    first = (p * y - 3 * z - y**3, 3 * y + p * z)
    second = (p * y + y * z, p * z - z**3)
    model = switched(x, (y - 2 - x, *first), (1 + z, *second))
    origin = {x: 0, y: 0, z: 0, p: 0.1}
    diagram = fs.continue_equilibria(model, p, (-0.4, 0.4), from_points=[origin])
    hopf = next(h for h in diagram.special("HB") if abs(h["p"]) < 1e-12)
    assert np.abs(hopf.state).max() < 1e-14
    assert hopf.regions == ("S1|S2",)
    assert hopf.frequency == pytest.approx(1, rel=1e-12)
    a, b = y - 2, 1 + z
    planar = fs.Model(
        {s: (b * f - a * g) / (b - a) for s, f, g in zip((y, z), first, second, strict=True)},
        parameters={p: 0},
    )
    again = next(
        h
        for h in fs.continue_equilibria(
            planar, p, (-0.4, 0.4), from_points=[{y: 0, z: 0, p: 0.1}]
        ).special("HB")
        if abs(h["p"]) < 1e-12
    )
    assert hopf.lyapunov == pytest.approx(again.lyapunov, rel=1e-10)
    below = next(e for e in diagram.at(p=-0.25) if abs(e["y"]) < 1e-9)
    assert (below.type, below.stability) == ("pseudo-focus", "stable")
    assert sorted(below.eigenvalues[:2].imag) == pytest.approx([-1, 1], rel=1e-12)
    assert below.eigenvalues[:2].real == pytest.approx([-0.25] * 2, rel=1e-12)
    above = next(e for e in diagram.at(p=0.25) if abs(e["y"]) < 1e-9)
    assert (above.type, above.stability) == ("pseudo-saddle-focus", "unstable")


# ---------------------------------------------------------------- as data


def test_a_stored_diagram_reads_infinite_eigenvalues():
    diagram = fs.continue_equilibria(switched(x, (y - 2 - x, p + y**2), (1, -1)), p, (-6, 4))
    stored = pickle.loads(pickle.dumps(diagram))
    (point,) = [e for e in stored.at(p=-3.7) if e["y"] > 0]
    assert point.interpolated
    assert point.pseudo
    assert np.isfinite(point.eigenvalues[0])
    assert point.eigenvalues[1] == -np.inf


def test_continuous_models_have_no_further_modes(gear):
    diagram = fs.continue_equilibria(gear.frozen(), "w", (-1, 1))
    assert diagram.regions == ("S1", "S2", "S3")


def test_a_fold_of_pseudo_equilibria_in_two_parameters():
    """With f₂ = (1, −q) they solve y² + q y + p = 2 q: folds on p = 2 q + q²/4."""
    rates = ((y - 2 - x, p + y**2), (1, -k[0]))
    model = switched(x, *rates, k[:1])
    (fold,) = fs.continue_equilibria(model, p, (-6, 4)).folds
    curve = fs.continue_points(fold, (p, k[0]), over={p: (-9, 9), k[0]: (0.5, 2)})
    values = curve["k1"]
    assert np.ptp(values) == pytest.approx(1.5, abs=1e-12)
    assert np.abs(curve["p"] - 2 * values - values**2 / 4).max() < 1e-12
