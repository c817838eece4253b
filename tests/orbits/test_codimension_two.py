"""Codimension-two points on curves of special points of orbits, against closed forms."""

from types import MappingProxyType

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.orbits.points.location import bordered

pytestmark = pytest.mark.slow

x, y, v, z, t, a, b, c, d, k, U, T = sp.symbols("x y v z t a b c d k U T", real=True)
TURN = 2 * np.pi
WIDE = fs.Continuation(step=0.02, max_step=0.08)


def rotated(first, second):
    """Rates of u = e^{it/2} w with w' = f(w) odd: the map of a period 2π is minus the flow of f."""
    W, V = sp.symbols("W V")
    parts = {x: (W + V) / 2, v: (W - V) / (2 * sp.I)}
    terms = sp.Poly(sp.expand((first + sp.I * second).subs(parts, simultaneous=True)), W, V).terms()
    u = x + sp.I * v
    rate = sp.I / 2 * u
    for (j, m), factor in terms:
        turn = (1 - j + m) // 2 * t
        rate += factor * (sp.cos(turn) + sp.I * sp.sin(turn)) * u**j * (x - sp.I * v) ** m
    return [sp.expand(part) for part in sp.expand(rate).as_real_imag()]


def curves(model, state, name, over, code, plane):
    """Curves in a plane from the points of a branch, one after the other."""
    branch = fs.continue_orbits(fs.find_orbit(model, state), name, over=over, continuation=WIDE)
    for point in branch.special(code):
        yield fs.continue_points(point, tuple(plane), plane, continuation=WIDE)


def check(point, atol=1e-11, /, **values):
    assert point.converged
    for name, value in values.items():
        assert point.parameters[name] == pytest.approx(value, abs=atol, rel=1e-11)


@pytest.fixture(scope="module")
def cycles():
    """r' = r (a + b s − s³)/T with s = r²/U² − 1, and a passive interface x = c.

    Folds of cycles at a = −2 s³, b = 3 s²; the orbit touches the interface at r = c.
    """
    s = (x**2 + y**2) / U**2 - 1
    radial = a + b * s - s**3
    rates = {x: x * radial - y, y: y * radial + x, z: sp.Abs(x - c) - z / 3}
    rates = {state: rate / T for state, rate in rates.items()}
    return fs.Model(rates, parameters={a: -0.05, b: 0.3, c: 1.2, U: 1, T: 1})


class TestFoldsOfCycles:
    plane = MappingProxyType({"a": (-0.2, 0.05), "b": (-0.1, 0.65)})

    @pytest.mark.sample(1)
    @pytest.mark.parametrize("unit", [1, 1e-6, 1e6])
    def test_cusp_and_grazing(self, cycles, unit):
        model = cycles.with_parameters(U=unit, c=1.2 * unit, T=1 / unit)
        given = model, np.array([1.2, 0, 1]) * unit, "a", (-0.08, -0.02), "LPC", self.plane
        (curve,) = curves(*given)
        assert [point.code for point in curve.special] == ["LPGR", "CPC"]
        check(curve.special[1], a=0, b=0)
        # s = 1.2² − 1 at the touch
        check(curve.special[0], a=-2 * 0.44**3, b=3 * 0.44**2)
        assert [outcome.code for outcome in curve.outcomes] == [
            "contact of the orbit",
            "end of range",
        ]
        assert all(outcome.success for outcome in curve.outcomes)
        assert curve.special_rows[0] == 0
        assert curve.special[0]["a"] == curve["a"][0]

    @pytest.mark.sample(0)
    def test_the_fold_on_the_other_side_of_the_grazing(self, cycles):
        """The segment beyond the interface vanishes at the same point."""
        model = cycles.with_parameters(b=0.65, a=-0.195)
        plane = {"a": (-0.5, 0.5), "b": (0.3, 0.7)}
        (curve,) = curves(model, [1.3, 0, 1], "a", (-0.21, -0.19), "LPC", plane)
        assert curve.region != "S2"
        check(curve.special("LPGR")[0], a=-2 * 0.44**3, b=3 * 0.44**2)

    def test_the_curve_of_grazings(self, cycles):
        (curve,) = curves(cycles, [1.2, 0, 1], "a", (-0.05, -0.04), "GR", self.plane)
        np.testing.assert_allclose(curve["a"], 0.44**3 - 0.44 * curve["b"], atol=1e-13)
        (point,) = curve.special
        assert point.code == "LPGR"
        assert point.interface == "x - c"
        check(point, a=-2 * 0.44**3, b=3 * 0.44**2)
        assert abs(point.eigenvalues - 1).min() < 1e-6

    def test_normal_form_of_a_cusp(self):
        """ρ' = −8 ρ³ at r = 1 + ρ, over one period."""
        s = x**2 + y**2 - 1
        radial = a + b * s - s**3
        model = fs.Model({x: x * radial - y, y: y * radial + x}, parameters={a: -0.05, b: 0.3})
        (curve,) = curves(model, [1.2, 0], "a", (-0.08, -0.04), "LPC", self.plane)
        (point,) = curve.special
        check(point, a=0, b=0)
        assert point.normal_form["c"] == pytest.approx(-8 * TURN, rel=1e-6)


@pytest.fixture(scope="module")
def flips():
    """Minus the flow of w'' = a w + b w' − c w³ − d w² w'.

    The orbit w = 0 has the multipliers −e^{2πλ}, λ² = a + b λ.
    """
    f = rotated(v, a * x + b * v - c * x**3 - d * x**2 * v)
    return fs.Model({x: f[0], v: f[1]}, parameters={a: -0.05, b: -0.1, c: 1, d: 1})


class TestFlips:
    def curve(self, model, name, code, **plane):
        state = np.zeros(len(model.states))
        (found,) = curves(model, state, name, (-0.1, 0.01), code, plane)
        return found

    @pytest.mark.sample(0)
    def test_period_doublings(self, flips):
        """The cubic coefficient vanishes with c."""
        curve = self.curve(flips, "a", "PD", a=(-0.1, 0.1), c=(-0.3, 1.1))
        (point,) = curve.special
        assert point.code == "GPD"
        check(point, 1e-9, a=0, c=0)
        assert "fifth order not computed" in point.degeneracy

    def test_grazing_period_doubling(self):
        """Beside it y = k (sin t − cos t)/2, which touches a passive interface y = 1."""
        f = rotated(a * x - x**3, -v)
        rates = {x: f[0], v: f[1], y: k * sp.sin(t) - y, z: sp.Abs(y - 1) - z / 3}
        model = fs.Model(rates, parameters={a: -0.05, k: 1})
        curve = self.curve(model, "a", "PD", a=(-0.1, 0.1), k=(0.9, 1.5))
        (point,) = curve.special
        assert point.code == "PDGR"
        check(point, a=0, k=np.sqrt(2))

    def test_resonance_on_the_curve_of_doublings(self, flips):
        curve = self.curve(flips, "a", "PD", a=(-0.1, 0.1), b=(-0.12, 0.05))
        (point,) = curve.special
        assert point.code == "R2"
        check(point, a=0, b=0)
        # the terms of the flow over one period T: C = −T², D + 3 C = T
        C, D = point.normal_form["C"], point.normal_form["D"]
        assert pytest.approx(-(TURN**2), rel=1e-7) == C
        assert pytest.approx(TURN, rel=1e-6) == D + 3 * C

    def test_resonances_of_a_torus(self, flips):
        """The multipliers are −e^{±2πi√−a}: 1:4 at a = −1/16, 1:3 at a = −1/36, 1:2 at a = 0."""
        curve = self.curve(flips, "b", "TR", a=(-0.07, 0.01), b=(-0.1, 0.1))
        assert {point.code for point in curve.special} == {"R4", "R3", "R2"}
        check(curve.special("R4")[0], a=-1 / 16, b=0)
        check(curve.special("R3")[0], a=-1 / 36, b=0)
        check(curve.special("R2")[0], a=0, b=0)
        assert {outcome.code for outcome in curve.outcomes} == {"resonance", "end of range"}
        assert curve.special("R2")[0].parameters["a"] in (curve["a"][0], curve["a"][-1])

    @pytest.mark.sample(0)
    def test_chenciner_point(self, flips):
        """The first Lyapunov coefficient is proportional to d."""
        curve = self.curve(flips, "b", "TR", b=(-0.1, 0.1), d=(-0.3, 1.1))
        (point,) = curve.special
        assert point.code == "CH"
        check(point, 1e-9, b=0, d=0)


class TestResonanceOne:
    """x' = v, v' = a + b v + x² + x v in shifted states: folds a = 0, tori b = √−a."""

    @pytest.fixture
    def model(self):
        S = sp.sin(t) / 10
        V = v - S
        return fs.Model(
            {x: V, v: a + b * V + x**2 + x * V + sp.cos(t) / 10}, parameters={a: -0.01, b: -0.05}
        )

    def test_both_curves(self, model):
        plane = {"a": (-0.012, 0.01), "b": (-0.1, 0.105)}
        (curve,) = curves(model, [-0.1, 0], "b", (-0.05, 0.11), "TR", plane)
        check(curve.special("R1")[0], a=0, b=0)
        assert curve.outcomes[-1].code == "resonance" or curve.outcomes[0].code == "resonance"
        (folds,) = curves(model, [-0.1, 0], "a", (-0.01, 0.01), "LPC", plane)
        (point,) = folds.special
        check(point, a=0, b=0)
        # over one period T of the flow: a = T², b − 2 a = T
        form = point.normal_form
        assert form["a"] == pytest.approx(TURN**2, rel=1e-7)
        assert form["b"] - 2 * form["a"] == pytest.approx(TURN, rel=1e-6)


class TestFoldFlip:
    """y' = b − y², and minus the flow of w' = (a + y) w − w³ beside it: both at a = b = 0."""

    def test_fold_flip(self):
        f = rotated(a * x - x**3, -v)
        half = (y * x * sp.sin(t) + y * v * (1 - sp.cos(t))) / 2
        rates = {x: f[0] + (y * x * (1 + sp.cos(t)) + y * v * sp.sin(t)) / 2, v: f[1] + half}
        model = fs.Model(rates | {y: b - y**2 + (x**2 + v**2) / 5}, parameters={a: -0.3, b: 0.04})
        plane = {"a": (-0.35, 0.1), "b": (-0.1, 0.2)}
        (folds,) = curves(model, [0, 0, 0.2], "b", (-0.01, 0.05), "LPC", plane)
        (point,) = folds.special
        assert point.code == "LPPD"
        check(point, a=0, b=0)
        # y = √b + w²/(10 √b) to second order: the cubic coefficient vanishes at √b = 1/10
        plane = {"a": (-0.22, -0.06), "b": (0.001, 0.1)}
        (flips,) = curves(model, [0, 0, 0.2], "a", (-0.3, -0.1), "PD", plane)
        assert [one.code for one in flips.special] == ["GPD"]
        check(flips.special[0], 1e-9, a=-0.1, b=0.01)
        assert "fifth order not computed" in flips.special[0].degeneracy
        # over one period T: a = T and e = T
        assert point.normal_form["a"] == pytest.approx(TURN, rel=1e-6)
        assert point.normal_form["e"] == pytest.approx(TURN, rel=1e-6)


def test_chenciner_point_with_quadratic_terms():
    """x'' = −ω² x + a x' + k x² + b x x' − x² x': the first coefficient is of b k − ω²."""
    rate = -0.09 * x + a * v + 0.3 * x**2 + b * x * v - x**2 * v
    model = fs.Model({x: v, v: rate, z: sp.cos(t) - z}, parameters={a: -0.05, b: 0.2})
    plane = {"a": (-0.05, 0.05), "b": (0.15, 0.35)}
    (curve,) = curves(model, [0, 0, 0.5], "a", (-0.05, 0.01), "TR", plane)
    assert [point.code for point in curve.special] == ["CH"]
    check(curve.special[0], 1e-9, a=0, b=0.3)


class TestFurtherPairs:
    """Two uncoupled planar fields: a torus at a = 0 beside a bifurcation at b = 0."""

    plane = MappingProxyType({"a": (-0.1, 0.05), "b": (-0.1, 0.05)})

    def model(self, *rates):
        R = x**2 + v**2
        turning = {x: a * x - 0.3 * v - x * R, v: a * v + 0.3 * x - v * R}
        values = {a: -0.1, b: -0.1}
        return fs.Model(turning | dict(zip((y, z), rates, strict=True)), parameters=values)

    def test_double_torus(self):
        model = self.model(b * y - 0.7 * z + sp.cos(t) / 10, b * z + 0.7 * y)
        (curve,) = curves(model, [0, 0, 0, 0], "a", (-0.1, 0.02), "TR", self.plane)
        (point,) = curve.special
        assert point.code == "NSNS"
        check(point, a=0, b=0)

    def test_flip_torus_on_both_curves(self):
        first, second = rotated(b * x, -v)
        model = self.model(*(rate.subs({x: y, v: z}) for rate in (first, second)))
        for name, code in ("a", "TR"), ("b", "PD"):
            (curve,) = curves(model, [0, 0, 0, 0], name, (-0.1, 0.02), code, self.plane)
            assert [point.code for point in curve.special] == ["PDNS"]
            check(curve.special[0], a=0, b=0)


@pytest.mark.sample(0)
def test_a_curve_of_tori_through_minus_one_in_a_symmetric_model():
    """By x → −x the map is a square, and a pair passes −1 without a 1:2 resonance."""
    w = sp.Symbol("w")
    model = fs.Model({x: v, v: b * (1 - x**2) * v - x + a * sp.cos(w * t)},
                     parameters={b: 0.3, a: 1.5, w: 1.5})  # fmt: skip
    plane = {"w": (1, 2.1), "a": (0.1, 6)}
    (curve,) = curves(model, [1, 0], "a", (1.4, 2), "TR", plane)
    assert [point.code for point in curve.special][:1] == ["R1"]
    assert {outcome.code for outcome in curve.outcomes} == {"resonance", "end of range"}
    assert curve["w"].max() == pytest.approx(2.1)
    np.testing.assert_allclose(np.abs(curve.eigenvalues), 1, atol=1e-6)
    # −1 is on the curve
    assert curve.eigenvalues.real.min() < -0.99
    traces = {"R1": 2, "R3": -1, "R4": 0}
    # one point of each kind
    for point in {point.code: point for point in curve.special}.values():
        matrix, _ = return_map(vibration, point, 0.3)
        assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-9)
        assert np.trace(matrix) == pytest.approx(traces[point.code], abs=1e-9)


def vibration(time, state, p, damping):
    """Van der Pol's oscillator with its variations."""
    x, v, *columns = state
    slopes = np.array([[0, 1], [-1 - 2 * damping * x * v, damping * (1 - x**2)]])
    force = p["a"] * np.cos(p["w"] * time)
    return [v, damping * (1 - x**2) * v - x + force, *(slopes @ np.reshape(columns, (2, 2))).flat]


def hardening(time, state, p, damping):
    """Duffing's oscillator with its variations."""
    x, v, *columns = state
    slopes = np.array([[0, 1], [-1 - 3 * x**2, -damping]])
    force = p["a"] * np.cos(p["w"] * time)
    return [v, -damping * v - x - x**3 + force, *(slopes @ np.reshape(columns, (2, 2))).flat]


def return_map(rates, point, damping):
    """Jacobian of the return map at the orbit of a point, by Newton's method with DOP853.

    Also the map itself. The phase of the point is unknown: Newton's method begins at t = 0.
    """
    period = TURN / point["w"]

    def mapped(state, since=0.0, rtol=1e-13):
        given = (since, since + period), [*state, 1, 0, 0, 1], "DOP853"
        end = solve_ivp(rates, *given, args=(point, damping), rtol=rtol, atol=rtol / 10)
        return end.y[:2, -1], end.y[2:, -1].reshape(2, 2)

    state = point.state
    # the point is at a phase of its own
    phases = np.linspace(0, period, 24, endpoint=False)
    phase = min(phases, key=lambda s: np.abs(mapped(state, s, 1e-5)[0] - state).max())
    for _ in range(3):
        ahead, back = (mapped(state, phase + step)[0] for step in (1e-5, -1e-5))
        slope = (ahead - back) / 2e-5
        phase -= slope @ (mapped(state, phase)[0] - state) / (slope @ slope)
    assert np.abs(mapped(state, phase)[0] - state).max() < 1e-8
    return mapped(state, phase)[1], lambda z: mapped(z, phase)[0]


@pytest.mark.sample(0)
def test_cusp_of_a_forced_oscillator():
    """Where the two folds of Duffing's response meet, against DOP853."""
    w = sp.Symbol("w")
    model = fs.Model({x: v, v: -v / 10 - x - x**3 + a * sp.cos(w * t)},
                     parameters={a: 0.12, w: 1.3})  # fmt: skip
    plane = {"w": (0.9, 1.4), "a": (0.03, 0.15)}
    curve = next(curves(model, [0.1, 0], "w", (1, 1.3), "LPC", plane))
    (point,) = curve.special
    assert point.code == "CPC"
    # both parameters are extreme there
    for name in ("w", "a"):
        assert curve[name].min() == pytest.approx(point[name], rel=1e-7)
    matrix, mapped = return_map(hardening, point, 0.1)
    values, vectors = np.linalg.eig(matrix)
    k = int(np.argmin(np.abs(values - 1)))
    assert values[k] == pytest.approx(1, abs=1e-8)
    q, left = vectors[:, k], np.linalg.inv(vectors)[k]
    z, h = point.state, 1e-2
    second = mapped(z + h * q) + mapped(z - h * q) - 2 * mapped(z)
    third = (
        mapped(z + 2 * h * q)
        - 2 * mapped(z + h * q)
        + 2 * mapped(z - h * q)
        - mapped(z - 2 * h * q)
    )
    assert abs(left @ second) / h**2 < 1e-3 * abs(left @ third) / h**3


class TestGrazings:
    """x = cos 2t + b cos t + d sin t touches a passive interface x = c."""

    @pytest.fixture
    def model(self):
        X = sp.cos(2 * t) + b * sp.cos(t) + d * sp.sin(t)
        rates = {x: sp.diff(X, t) - x + X, y: sp.Abs(x - c) - y / 2}
        return fs.Model(rates, parameters={b: 0.3, c: 1.5, d: 0.2})

    def test_degenerate_and_double_grazing(self, model):
        plane = {"b": (-0.5, 4), "c": (-6, 4)}
        both = list(curves(model, [0, 0], "c", (0.6, 1.6), "GR", plane))
        lower = next(curve for curve in both if "DGR" in {point.code for point in curve.special})
        # ẋ = ẍ = 0
        phase, height = 2.7643018812, 3.2139641144
        for _ in range(3):
            sin, cos, twice = np.sin(phase), np.cos(phase), (np.sin(2 * phase), np.cos(2 * phase))
            F = [-2 * twice[0] - height * sin + 0.2 * cos, -4 * twice[1] - height * cos - 0.2 * sin]
            J = [[F[1], -sin], [8 * twice[0] + height * sin - 0.2 * cos, -cos]]
            phase, height = np.array([phase, height]) - np.linalg.solve(J, F)
        level = np.cos(2 * phase) + height * np.cos(phase) + 0.2 * np.sin(phase)
        check(lower.special("DGR")[0], 1e-10, b=height, c=level)
        for curve in both:
            # both maxima are equal at b = 0: t = arcsin(0.05), and π minus it
            check(curve.special("GRGR")[0], b=0, c=1.005)
            for value, outcome in zip((0, -1), curve.outcomes, strict=True):
                assert outcome.success
                assert outcome.code in ("contact of the orbit", "end of range"), (value, outcome)


def test_borders_of_a_rotation():
    """The null vector (1, −i)/√2 has the bilinear square 0."""
    matrix = np.array([[-1j, -1.0], [1.0, -1j]])
    v, w, g = bordered(matrix)
    np.testing.assert_allclose([v @ v, g, *(matrix @ v), *(w @ matrix)], 0, atol=1e-14)
    assert np.linalg.norm(v) == pytest.approx(1, rel=1e-14)
