"""The law of delay at a smooth fold, against mpmath and the Airy solution."""

import math
import pickle
from dataclasses import replace

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.passage.delays.laws.fold_delays import (
    MATCHING,
    OMEGA_0,
    airy_passage,
    fold_delay,
    fold_form_of,
    jump_time,
    slow_part,
)
from fastslow.passage.delays.local_field import local_field_at

pytestmark = pytest.mark.slow

x, y, p, q = sp.symbols("x y p q")


def test_the_constants_to_sixteen_digits():
    with mpmath.workdps(25):
        omega = -mpmath.airyaizero(1)
        square = mpmath.airyai(-omega, derivative=1) ** 2

        def entropy(s):
            a = mpmath.airyai(-s)
            return a**2 * mpmath.log(a) if a > 0 else mpmath.mpf(0)

        cuts = [-25, -12, -6, -3, -1, 0, 1, 2, omega - mpmath.mpf("0.01"), omega]
        matching = (mpmath.quad(entropy, cuts) / square) - (mpmath.log(square) + 1) / 2
        assert float(omega) == OMEGA_0
        assert float(matching) == pytest.approx(MATCHING, abs=1e-15)


@pytest.mark.parametrize("eta", [-300.0, -1.0, 0.0, 0.5, 7.0, 1e4])
def test_the_airy_passage_solves_the_riccati_equation(eta):
    s = mpmath.mpf(airy_passage(eta))
    slope = mpmath.airyai(-s, derivative=1) / mpmath.airyai(-s)
    assert float(slope) == pytest.approx(eta, rel=1e-10, abs=1e-13)
    assert s < OMEGA_0
    assert airy_passage(math.inf) == OMEGA_0


def test_coefficients_of_the_cusp_in_closed_form(cusp_fold):
    """At x = −1/√3: a = √3, b = 1, c = −1, g = 0, and the whole term of order rate."""
    for exit_at in (-0.5, -0.2, 0.5, 0.9):
        law = fold_delay(cusp_fold, 1e-5, level={"x": exit_at})
        assert (law.quadratic, law.slope) == pytest.approx((math.sqrt(3), 1.0), abs=1e-14)
        assert (law.cubic, law.mixed) == pytest.approx((-1.0, 0.0), abs=1e-14)
        assert law.coefficients[0] == pytest.approx(OMEGA_0 * 3 ** (-1 / 6), abs=1e-14)
        assert law.coefficients[1] == pytest.approx(-1 / 9, abs=1e-14)
        # y' = a y² + c y³ is the whole of the jump: its time in closed form
        d, size = -1 / 3, math.sqrt(3) * (exit_at + 1 / math.sqrt(3))
        jump = -1 / size - d * math.log(size / (1 + d * size))
        constant = d * math.log(3) / 6 - d * MATCHING + jump
        assert law.coefficients[2] == pytest.approx(constant, abs=3e-6)
        assert "to the order of the rate" in law.validity


def test_the_quadratic_fold_is_the_airy_solution():
    """x' = p + x² has the solution −ε^(1/3) A'/A, so that delays are known at every level."""
    fold = fs.continue_equilibria(fs.Model({x: p + x**2}, parameters={p: -1}), "p", (-1, 1)).folds[
        0
    ]
    for level in (-0.001, 0.0, 0.01, 0.5, 20.0):
        for eps in (1e-3, 1e-6):
            law = fold_delay(fold, eps, level={"x": level})
            s = airy_passage(level / eps ** (1 / 3))
            assert law.delay == pytest.approx(eps ** (2 / 3) * s, rel=1e-9)
            assert law.value == law.delay
            assert law.delay_time == pytest.approx(law.delay / eps, rel=1e-15)
    free = fold_delay(fold, 1e-3)
    assert free.delay == free.leading == pytest.approx(OMEGA_0 * 1e-2, rel=1e-14)
    assert math.isnan(free.coefficients[2])


@settings(max_examples=15)
@given(st.floats(0.2, 5.0), st.floats(1e-9, 1e-2))
def test_the_leading_term_scales(cusp_fold, factor, eps):
    """Twice the rate, 2^(2/3) times the delay; time runs backwards for the mirrored fold."""
    one, other = (fold_delay(cusp_fold, e).leading for e in (eps, factor * eps))
    assert other / one == pytest.approx(factor ** (2 / 3), rel=1e-12)


@pytest.fixture(scope="module")
def sheared():
    """The cusp beside a state that follows it, in coordinates that mix both."""
    rest = x - y
    return fs.Model({x: p + rest - rest**3 + rest - 2 * y, y: rest - 2 * y}, parameters={p: -1})


def test_the_law_does_not_depend_on_coordinates(sheared, cusp_fold):
    diagram = fs.continue_equilibria(sheared, "p", over=(-1, 1))
    fold = next(f for f in diagram.folds if f["y"] < 0)
    law, plain = fold_delay(fold, 1e-6), fold_delay(cusp_fold, 1e-6)
    assert law.coefficients[:2] == pytest.approx(plain.coefficients[:2], rel=1e-10)
    # y = (x − y)/2 on the slow branch; in the jump it follows late
    with_level = fold_delay(fold, 1e-6, level={"y": 0.25})
    late = fold_delay(cusp_fold, 1e-6, level={"x": 0.5})
    assert with_level.delay > late.delay
    assert with_level.delay == pytest.approx(late.delay, rel=0.02)


def test_a_parameter_that_also_bends_the_fold():
    """x' = p (1 + k x) + x²: the mixed coefficient is k."""
    k = sp.Symbol("k")
    model = fs.Model({x: p * (1 + k * x) + x**2}, parameters={p: -1, k: 0.7})
    fold = fs.continue_equilibria(model, "p", over=(-1, 1)).folds[0]
    form = fold_form_of(local_field_at(fold, "p", None))
    assert (form.a, form.b, form.c, form.g) == pytest.approx((1, 1, 0, 0.7), abs=1e-13)
    assert form.slowest == math.inf
    law = fold_delay(fold, 1e-6, level={"x": 10.0})
    assert law.coefficients[2] == pytest.approx(-0.35 - 0.1, abs=3e-6)


def test_a_point_from_a_file_needs_its_model(cusp, cusp_fold):
    stored = pickle.loads(pickle.dumps(cusp_fold))
    with pytest.raises(fs.ArgumentError, match="carries no model"):
        fold_delay(stored, 1e-3)
    whole = fs.systems.cusp()
    for model in (cusp, whole):
        law = fold_delay(stored, 1e-3, model=model, parameter="p")
        assert law.delay == fold_delay(cusp_fold, 1e-3).delay


def test_wrong_arguments(cusp_fold, corner):
    with pytest.raises(fs.ArgumentError, match=r"with p falling no stable branch .* rate > 0"):
        fold_delay(cusp_fold, -1e-3)
    for rate in (0, math.nan, "fast"):
        with pytest.raises(fs.ArgumentError, match="expected a finite rate of drift"):
            fold_delay(cusp_fold, rate)
    for level in (1.0, {}, {"x": 1, "y": 2}):
        with pytest.raises(fs.ArgumentError, match="expected one state and its value"):
            fold_delay(cusp_fold, 1e-3, level=level)
    with pytest.raises(fs.ArgumentError, match="level of x = inf; expected a finite number"):
        fold_delay(cusp_fold, 1e-3, level={"x": math.inf})
    with pytest.raises(fs.UnknownNameError, match="unknown state of the level 'z'"):
        fold_delay(cusp_fold, 1e-3, level={"z": 1})
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'r'"):
        fold_delay(cusp_fold, 1e-3, parameter="r")
    point = fs.continue_equilibria(corner, "p", over=(-1, 1)).boundary_equilibria[0]
    with pytest.raises(
        fs.ArgumentError, match=r"requires a point LP \(fold\); received BE1, a boundary"
    ):
        fold_delay(point, 1e-3)


def test_a_level_that_no_jump_reaches(cusp_fold):
    law = fold_delay(cusp_fold, 1e-4, level={"x": 5.0})
    assert law.delay == law.leading
    assert "no jump of the frozen model to x = 5 was found" in law.validity


def test_degenerate_folds(cusp_fold):
    """A cusp, a fold that the parameter does not unfold, an unstable one, a double zero."""
    at_cusp = replace(cusp_fold, state=np.zeros(1), parameters={"p": 0.0, "q": 0.0})
    with pytest.raises(fs.ArgumentError, match=r"quadratic coefficient vanishes \(a cusp\)"):
        fold_delay(at_cusp, 1e-3)
    k = sp.Symbol("k")
    model = fs.Model({x: p + x**2, y: q + k * y}, parameters={p: -1, q: 0, k: -1})
    fold = fs.continue_equilibria(model, "p", over=(-1, 1)).folds[0]
    with pytest.raises(fs.ArgumentError, match="is not unfolded by q"):
        fold_delay(fold, 1e-3, parameter="q")
    with pytest.raises(fs.ArgumentError, match="another eigenvalue has real part 1"):
        fold_delay(replace(fold, parameters={**fold.parameters, "k": 1.0}), 1e-3)
    takens = fs.Model({x: y, y: p + x**2 + k * y}, parameters={p: -1, k: -1})
    fold = fs.continue_equilibria(takens, "p", over=(-1, 1)).folds[0]
    with pytest.raises(fs.ArgumentError, match="double zero eigenvalue"):
        fold_delay(replace(fold, parameters={**fold.parameters, "k": 0.0}), 1e-3)


@pytest.mark.parametrize("eta", [-1.0, 0.3, 2.0])
def test_the_slow_part_to_first_order(eta):
    """Against SciPy: what is left is of second order in the terms."""
    terms = np.array([-0.3, 0.4, 0.2])

    def passed(size):
        c, g, r = size * terms

        def flow(s, z):
            y, m = z
            return [y**2 + m + c * y**3 + g * m * y - r * (m * y**2 + m**2), 1.0]

        def end(s, z):
            return z[0] - eta

        end.terminal = True
        # near the stable branch of the whole equation: far before it the terms would be large
        start = -9.65
        run = solve_ivp(
            flow, (start, 9), [-((-start) ** 0.5), start], events=end, method="LSODA", rtol=1e-12,
            atol=1e-13,
        )  # fmt: skip
        return run.y[1, -1]

    left = [passed(s) - slow_part(eta, tuple(s * terms)) for s in (0.02, 0.01)]
    assert left[0] / left[1] == pytest.approx(4, rel=0.15)
    assert abs(left[1]) < 2e-4


@pytest.mark.parametrize(("feedback", "level"), [(0.0, 0.7), (-40.0, "turn"), (-3.0, "turn")])
def test_the_time_of_a_jump_in_closed_form(feedback, level):
    """u' = p + u² + 3 u⁴, u = x + 4/3, p' = ε (1 + f u): ∫ (1 + f u)/(u² + 3 u⁴) du."""
    u = x + sp.Rational(4, 3)
    model = fs.Model({x: sp.expand(p + u**2 + 3 * u**4)}, parameters={p: -1})
    fold = fs.continue_equilibria(model, "p", over=(-0.5, 0.5)).folds[0]
    local = local_field_at(fold, None, None)
    drift = fs.Drift(1e-4, by_state={"x": 1e-4 * feedback})
    end = level if level != "turn" else -1.0 / feedback
    known = level if level == "turn" else (0, level)
    found = jump_time(local, fold_form_of(local), drift, feedback, known)
    root = np.sqrt(3.0)
    exact = -1.0 / end - root * np.arctan(root * end)
    exact += feedback * (np.log(end) - 0.5 * np.log(1.0 + 3.0 * end**2))
    # rounding of the fold by 1e-16 is magnified by 1/(3 Y³)
    assert found == pytest.approx(exact, rel=2e-7, abs=1e-6)


def test_no_law_where_the_other_states_are_slower_than_the_passage():
    """x'' = p + x² − x'/20: a light damping does not follow the center manifold of the fold."""
    model = fs.Model({x: y, y: p + x**2 - y / 20}, parameters={p: -1})
    (fold,) = fs.continue_equilibria(model, "p", over=(-1, 0.5)).folds
    slow = fold_delay(fold, 1e-8, level={"x": 1})
    assert "no law" not in slow.validity
    assert slow.error < slow.delay
    assert math.isnan(fold_delay(fold, 1e-4).delay)
    fast = fold_delay(fold, 1e-4, level={"x": 1})
    assert fast.validity.startswith("no law: the other states relax more slowly")
    ramp = model.with_ramp("p", 1e-4, from_value=-0.2)
    run = fs.simulate(ramp, [-(0.2**0.5), 0], t=(0, 1e4), stop="x - 1")
    assert fast.delay == pytest.approx(-0.2 + 1e-4 * run.t[-1], rel=0.05)


def test_a_stiff_escape_is_integrated_to_the_level_alone(monkeypatch):
    """With quadratic damping an escape from a well takes a number of steps proportional to x."""
    from fastslow.passage.delays.laws import fold_delays

    x, v, w = sp.symbols("x v w")
    model = fs.Model({x: v, v: w - v / 20 - v * sp.Abs(v) / 5 - x + x**3}, parameters={w: 0})
    fold = fs.continue_equilibria(model, "w", over=(0, 0.6)).folds[0]
    counts = []

    def counted(*given, **kwargs):
        run = fs.simulate(*given, **kwargs)
        counts.append(len(run.steps))
        return run

    monkeypatch.setattr(fold_delays, "simulate", counted)
    delay = fs.predict_delay(fold, 1e-4, level={"x": 2})
    assert 0 < delay.delay < 0.01
    assert max(counts) < 1000
