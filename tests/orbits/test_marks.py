"""Zeros of expressions in the numbers of orbits, against closed forms."""

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

import fastslow as fs
from fastslow.continuation.settings import Continuation

pytestmark = pytest.mark.slow

x, v, c, w, t, F, m, k = sp.symbols("x v c w t F m k")

COARSE = Continuation(max_step=0.1)
LINEAR = fs.Model({x: v, v: F * sp.cos(w * t) - x - c * v}, parameters={c: 0.1, w: 1.3, F: 1})


def frequencies(amplitude):
    """Where F = A sqrt((1 - w²)² + c² w²), for F = 1 and c = 0.1."""
    return np.sort(np.sqrt(np.roots([1, 0.01 - 2, 1 - amplitude**-2]).real))


@pytest.fixture(scope="module")
def branch():
    marks = {
        "level": "max(x) - 3",
        "power": "rms(x)*sqrt(2) - 2",
        "odd": "max(x) + min(x)",
        "decay": "abs(multiplier_1) - 0.7",
        "peak": "max(x) - 1/(c*sqrt(1 - c**2/4))",
        "turn": "period - 2*pi/1.1",
        "jump": "Piecewise((-1, period < 5), (1, True)) + max(x)/100",
        "w": [1.5],
    }
    orbit = fs.find_orbit(LINEAR, [0, 0])
    return fs.continue_orbits(orbit, "w", (0.5, 2), marks=marks, continuation=COARSE)


class TestBranch:
    def test_zeros_are_located_to_rounding(self, branch):
        found = {name: [p["w"] for p in branch.special(name)] for name in ("level", "power")}
        np.testing.assert_allclose(found["level"], frequencies(3), rtol=1e-14)
        np.testing.assert_allclose(found["power"], frequencies(2), rtol=1e-14)
        # |μ| = exp(-c T / 2)
        assert branch["decay1"]["w"] == pytest.approx(0.1 * np.pi / np.log(1 / 0.7), rel=1e-14)
        assert branch["turn1"]["w"] == pytest.approx(1.1, rel=1e-14)
        assert branch["UZ1"]["w"] == 1.5

    def test_a_figure_has_an_entry_and_a_marker_for_each_mark(self, branch):
        drawn = fs.plot.response(branch, "max(x)")
        entries = [marker.get_label() for marker in drawn.markers]
        assert {"level (max(x) - 3 = 0)", "turn (period - 2*pi/1.1 = 0)"} < set(entries)
        assert len(entries) == len(set(entries)) == len({point.stem for point in branch.special})
        looks = {str(marker.get_marker()) for marker in drawn.markers}
        assert len(looks) == min(len(entries), 6)

    def test_points_are_rows_with_a_label_and_an_expression(self, branch):
        point = branch["level2"]
        assert (point.code, point.mark, point.expression) == ("UZ", "level", "max(x) - 3")
        assert point.words == "zero of max(x) - 3"
        assert point.converged
        assert abs(point["max(x)"] - 3) < 1e-14
        assert "level2 zero of max(x) - 3" in repr(branch.special)
        rows = np.array(branch.special_rows)
        assert (np.diff(rows) > 0).all()
        np.testing.assert_array_equal(branch.values[rows], [p["w"] for p in branch.special])
        assert (np.diff(branch.values) > 0).all()
        assert len(branch.select(code="level")) == 1
        assert "mark" in branch.special.to_dict()

    def test_a_zero_without_change_of_sign(self, branch):
        (point,) = branch.special("peak")
        assert point.type == "no change of sign"
        # a double zero is known to the square root of rounding
        assert point["w"] == pytest.approx(np.sqrt(1 - 0.005), abs=1e-7)

    def test_what_is_no_zero_is_said(self, branch):
        assert not {"odd", "jump"} & {point.mark for point in branch.special}
        words = " ".join(branch.outcomes[1].notes)
        assert "odd: max(x) + min(x) vanishes along the branch" in words
        assert "jump" in words
        assert "discontinuous" in words
        assert "vanishes along the branch" in repr(branch)

    def test_files(self, branch, tmp_path):
        branch.save(tmp_path / "branch.npz")
        loaded = fs.load(tmp_path / "branch.npz")
        assert loaded["level1"].expression == "max(x) - 3"
        assert loaded["level1"]["w"] == branch["level1"]["w"]


def test_zeros_at_the_first_row_and_at_special_points():
    model = fs.Model({x: v, v: F * sp.cos(t) - x / 4 - v}, parameters={F: 1})
    orbit = fs.find_orbit(model, [0, 0])
    branch = fs.continue_orbits(
        orbit, "F", (1, 2), marks={"low": "F - 1", "high": "F - 2"}, continuation=COARSE
    )
    assert [(p.label, p["F"]) for p in branch.special] == [("low1", 1.0), ("high1", 2.0)]
    assert branch.special_rows == (0, len(branch) - 1)


@pytest.fixture(scope="module")
def curve(branch):
    """The amplitude 3 of the linear oscillator, with marks."""
    marks = {"F": [1.0, 2.0, 3.0], "turn": "period - 2*pi/1.4", "own": "max(x) - 3", "w": [1.2]}
    marks["touch"] = "(w - 1.37)**2"
    over = {"w": (1.1, 2), "F": (0.2, 3)}
    return fs.continue_points(branch["level2"], ("w", "F"), over, continuation=COARSE, marks=marks)


class TestCurves:
    def test_amplitude_of_the_linear_oscillator(self, curve):
        exact = 3 * np.hypot(1 - curve["w"] ** 2, 0.1 * curve["w"])
        np.testing.assert_allclose(curve["F"], exact, atol=3e-14)
        assert all(curve.outcomes)
        assert (curve.mark, curve.expression) == ("level", "max(x) - 3")
        assert "level" in repr(curve)

    def test_marks_on_a_curve(self, branch, curve):
        # F = 3 sqrt((1 - w²)² + w²/100), which is 1 at the first point and 3 at one end
        found = [np.sqrt(np.roots([1, 0.01 - 2, 1 - (F / 3) ** 2]).real.max()) for F in (1, 2)]
        last = np.sqrt(2 - 0.01)
        exact = np.sort([*found, 1.2, 1.4, last])
        (touch,) = curve.special("touch")
        assert "no change of sign" in touch.note
        assert touch["w"] == pytest.approx(1.37, abs=1e-7)
        points = [point for point in curve.special("UZ") if point.mark != "touch"]
        np.testing.assert_allclose([point["w"] for point in points], exact, rtol=1e-11)
        assert curve["turn1"]["w"] == pytest.approx(1.4, rel=1e-14)
        assert (curve["turn1"].mark, curve["turn1"].expression) == ("turn", "period - 2*pi/1.4")
        assert "own" not in {point.mark for point in curve.special}
        assert "own (max(x) - 3 = 0) along the curve, to rounding" in " ".join(
            curve.outcomes[1].notes
        )
        with pytest.raises(fs.UnknownNameError, match="unknown number of an orbit"):
            fs.continue_points(
                branch["level2"], ("w", "F"), {"w": (1, 2), "F": (0.2, 3)}, marks={"far": "x - w"}
            )

    def test_period_of_van_der_pol(self):
        """x'' = m (1 - x²) x' - k x has the period T(m/√k)/√k."""
        model = fs.Model({x: v, v: m * (1 - x**2) * v - k * x}, parameters={m: 0.9, k: 1})
        orbit = fs.find_orbit(model, fs.simulate(model, [2, 0], t=(0, 40)))
        branch = fs.continue_orbits(
            orbit,
            "m",
            (0.8, 1.1),
            marks={"slow": "period - 6.7", "q": "log(abs(multiplier_2)) + 7"},
            continuation=COARSE,
        )
        point = branch["slow1"]
        assert np.exp(-7) == pytest.approx(branch["q1"].multipliers[1].real, rel=1e-11)
        assert point.orbit.period == pytest.approx(6.7, rel=1e-14)
        known = brentq(
            lambda mu: fs.find_orbit(model.with_parameters({m: mu}), orbit).period - 6.7, 0.8, 1.1
        )
        assert point["m"] == pytest.approx(known, rel=1e-12)
        curve = fs.continue_points(
            point, ("m", "k"), {"m": (0.8, 1.1), "k": (0.9, 1.1)}, continuation=COARSE
        )
        row = curve[len(curve) // 2]
        scaled = model.with_parameters({m: row["m"] / np.sqrt(row["k"]), k: 1})
        period = fs.find_orbit(scaled, orbit).period
        assert period / np.sqrt(row["k"]) == pytest.approx(6.7, rel=1e-12)


def test_cycles_of_the_normal_form_of_a_hopf_point():
    """The cycle has the radius √p, the period 2π and the multiplier exp(-4πp)."""
    p = sp.Symbol("p")
    square = x**2 + v**2
    model = fs.Model({x: p * x - v - x * square, v: x + p * v - v * square}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", over=(-0.5, 0.5))
    marks = {"radius": "max(x) - 0.5", "decay": "log(abs(multiplier_2)) + pi", "p": [0.3]}
    (cycles,) = fs.continue_cycles(diagram, continuation=COARSE, marks=marks)
    assert cycles["radius1"]["p"] == pytest.approx(0.25, rel=1e-13)
    assert cycles["decay1"]["p"] == pytest.approx(0.25, rel=1e-12)
    assert cycles["UZ1"]["p"] == 0.3
    with pytest.raises(fs.UnknownNameError, match="max\\(x\\)"):
        fs.continue_cycles(diagram, marks={"radius": "x - 0.5"})


@pytest.mark.parametrize(
    ("marks", "words"),
    [
        ({"LPC": "max(x) - 1"}, "is the code of a fold of cycles"),
        ({"level1": "max(x) - 1"}, "does not end with a digit"),
        ({"period": "max(x) - 1"}, "is that of period"),
        ({"level": "x - 1"}, "max\\(x\\)"),
        ({"level": "maxx - 1"}, "unknown number of an orbit"),
        ({"level": "max(y) - 1"}, "unknown"),
        ({"level": "abs(multiplier_3) - 1"}, "multiplier_2"),
        ({"level": "2*pi"}, "is constant"),
        ({"F": [1]}, "parameter in marks"),
        ({"w": [3]}, "outside the range"),
    ],
)
def test_wrong_marks(branch, marks, words):
    with pytest.raises(fs.FastSlowError, match=words):
        fs.continue_orbits(branch[0], "w", (0.5, 2), marks=marks)
