"""The compiled loop and the extended systems against closed forms and NumPy."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.continuation import engine
from fastslow.continuation.location import (
    branch_point,
    fold,
    hopf_or_neutral_saddle,
    newton,
    with_condition,
)
from fastslow.continuation.loops import loop
from fastslow.continuation.spaces import CompiledCurve, Condition, newton_space
from fastslow.diagrams.field import FrozenField
from fastslow.kernels.compiler.records import Matrix, Vector
from fastslow.kernels.loops import Loop, load_loop

pytestmark = pytest.mark.slow

#: The compiled elimination, of which loops are made.
SOLVE = Loop("fastslow.continuation.engine", "solve", {"matrix": Matrix, "right": Vector}, (bool,))


def solve(matrix, right):
    return load_loop(SOLVE)(matrix, right)


@settings(deadline=None)
@given(
    st.lists(st.floats(-10, 10), min_size=9, max_size=9),
    st.lists(st.floats(-10, 10), min_size=3, max_size=3),
)
def test_solve_agrees_with_numpy(entries, right):
    matrix = np.array(entries).reshape(3, 3) + 40 * np.eye(3)
    expected = np.linalg.solve(matrix, right)
    found = np.array(right)
    assert solve(matrix.copy(), found)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


def test_solve_reports_a_singular_matrix():
    assert not solve(np.ones((2, 2)), np.ones(2))
    assert not solve(np.full((2, 2), np.nan), np.ones(2))


def parabola(u):
    x, y, p = u
    value = np.array([p - x**2 + y, -y])
    return value, np.array([[-2 * x, 1.0, 1.0], [0.0, -1.0, 0.0]])


def test_fold_of_a_parabola_to_rounding():
    found = fold(parabola, np.array([0.1, 0.05, 0.02]), np.ones(3))
    assert found.converged
    np.testing.assert_allclose(found.u, 0, atol=1e-14)


def test_point_with_a_condition():
    found = with_condition(
        parabola, lambda u: (u[0] - 2, np.array([1.0, 0, 0])), np.array([1.0, 0, 1]), np.ones(3)
    )
    np.testing.assert_allclose(found.u, [2, 0, 4], atol=1e-14)
    assert found.converged
    assert found.residual < 1e-14


def test_no_solution_is_said_not_hidden():
    found = with_condition(
        parabola, lambda u: (u[2] + 1, np.array([0.0, 0, 1])), np.array([1.0, 0, 1]), np.ones(3)
    )
    assert not found.converged


@pytest.mark.parametrize("steps", [12, 50])
def test_what_is_still_a_thousandth_away_has_not_converged(steps):
    """To the double root of (x − 10⁶)² every step goes half the way: 2⁻¹² are left, or nothing."""

    def double(u):
        return np.array([(u[0] - 1e6) ** 2])

    def slope(u):
        return np.array([[2 * (u[0] - 1e6)]])

    z, _, converged, size = newton(double, np.array([1e6 + 1]), np.ones(1), slope, iterations=steps)
    assert converged == (steps == 50)
    assert abs(z[0] - 1e6) == pytest.approx(size, rel=1e-6, abs=1e-7)

    found = with_condition(
        lambda u: (u[1:], np.array([[0.0, 1.0]])),
        lambda u: (float(double(u)[0]), np.array([float(slope(u)[0, 0]), 0.0])),
        np.array([1e6 + 1, 0.5]),
        np.ones(2),
        iterations=steps,
    )
    assert found.converged == (steps == 50)


@pytest.mark.parametrize("steps", [12, 50])
def test_the_compiled_loop_tells_what_has_not_converged(steps):
    """The same root, of x' = (x − 10⁶)² + p in the plane p = 0."""
    x, p = sp.symbols("x p")
    field = FrozenField(fs.Model({x: (x - 10**6) ** 2 + p}, parameters={p: 0}), "p")
    compiled = field.compiled
    u, normal = np.array([1e6 + 1, 0.0]), np.array([0.0, 1.0])
    _, _, converged = loop("refine")(
        CompiledCurve(compiled.address, 0, field.values),
        u,
        np.ones(2),
        Condition(-1, normal, u.copy(), compiled.m),
        steps,
        newton_space(1, compiled.size),
    )
    assert converged == (steps == 50)
    assert abs(u[0] - 1e6) < (1e-6 if converged else 1e-3)


@pytest.mark.parametrize("damped", [False, True])
def test_newton_s_method_does_not_converge_where_the_slope_vanishes(damped):
    """x³ − 5 x² has a double root at 0, where a start is left alone, and one at 5."""
    x, p = sp.symbols("x p")
    field = FrozenField(fs.Model({x: x**3 - 5 * x**2 + p}, parameters={p: 0}), "p")
    starts, converged = from_starts(field, [[0.0], [4.9]], damped)
    assert converged.tolist() == [False, True]
    np.testing.assert_allclose(starts, [[0.0], [5.0]], atol=1e-12)


def test_damped_steps_converge_where_newton_s_method_cycles_or_leaves_the_domain():
    """Steep Hill functions x' = a/(1 + x**n) − x, and 2 arctan(x − 3), in closed form."""
    x, p = sp.symbols("x p")
    # a = s (1 + s**n) has the root s
    for n, root in ((10, 1.5), (20, 1.3), (7.3, 1.8)):
        level = root * (1 + root**n)
        field = FrozenField(fs.Model({x: level / (1 + x**n) - x + p}, parameters={p: 0}), "p")
        first = [[level * 10.0**k] for k in (-4, -1, 0, 2)]
        starts, converged = from_starts(field, first, True)
        assert converged.all()
        np.testing.assert_allclose(starts, root, rtol=1e-12)
        assert not from_starts(field, first, False)[1].any()
    field = FrozenField(fs.Model({x: p - sp.atan(x - 3)}, parameters={p: 0}), "p")
    first = [[-40.0], [2.0], [60.0]]
    starts, converged = from_starts(field, first, True)
    assert converged.all()
    np.testing.assert_allclose(starts, 3.0, rtol=1e-12)
    assert from_starts(field, first, False)[1].tolist() == [False, True, False]


def from_starts(field, starts, damped):
    compiled, states = field.compiled, np.array(starts)
    flags, converged = np.full(len(states), damped), np.zeros(len(states), dtype=bool)
    curve = CompiledCurve(compiled.address, 0, field.values)
    space = newton_space(1, compiled.size)
    loop("newton_from")(curve, states, flags, converged, 0.0, np.ones(1), 100, space)
    return states, converged


def spiral(u):
    """Linear focus with eigenvalues p ± 2i."""
    x, y, p = u
    value = np.array([p * x - 2 * y, 2 * x + p * y])
    return value, np.array([[p, -2.0, x], [2.0, p, y]])


def test_hopf_frequency():
    found = hopf_or_neutral_saddle(spiral, np.array([0.0, 0.0, 0.1]), np.ones(3), 3.5)
    np.testing.assert_allclose(found.u, 0, atol=1e-13)
    assert np.sqrt(found.extra[0]) == pytest.approx(2, abs=1e-12)


def transcritical(u):
    x, p = u
    return np.array([p * x - x**2]), np.array([[p - 2 * x, x]])


def test_transcritical_branch_point():
    found = branch_point(transcritical, np.array([0.05, 0.1]), np.ones(2))
    assert found.converged
    np.testing.assert_allclose(found.u, 0, atol=1e-13)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"step": 0}, "step = 0; expected a positive"),
        ({"max_turn": -1}, "max_turn = -1; expected a positive"),
        ({"starts": -1}, "starts = -1; expected an integer from 0"),
        ({"step": 1.0}, "min_step ≤ step ≤ max_step"),
    ],
)
def test_settings_are_checked(wrong, message):
    with pytest.raises(fs.FastSlowError, match=message):
        fs.Continuation(**wrong)


@pytest.mark.parametrize("gap", [1e-8, 1e-9])
def test_curves_that_nearly_cross_are_not_mixed_up(gap):
    """x² = (p/100)² + gap: both turn by a fiftieth at p = 0, within less than a step."""
    x, p = sp.symbols("x p")
    model = fs.Model({x: x**2 - p**2 / 10000 - gap}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", over=(-1, 1))
    assert len(diagram.branches) == 2
    for branch in diagram.branches:
        assert len(np.unique(np.sign(branch["x"]))) == 1
        assert np.ptp(branch["p"]) == 2


def test_a_cubic_that_falls_and_then_rises_may_dip_below_zero():
    """Against its values at many places, also where it is a parabola."""
    generator = np.random.default_rng(5)
    places = np.linspace(0, 1, 4001)
    seen = set()
    for k in range(400):
        h0, h1 = 10.0 ** generator.uniform(-4, 0, 2)
        s0, s1 = -generator.uniform(0, 3), generator.uniform(0, 3)
        if k % 4 == 0:
            h1 = h0 + (s0 + s1) / 2
        a, b = 2 * (h0 - h1) + s0 + s1, 3 * (h1 - h0) - 2 * s0 - s1
        least = (((a * places + b) * places + s0) * places + h0).min()
        if abs(least) > 1e-5 and h1 > 0:
            assert engine._dips(h0, s0, h1, s1) == (least < 0)
            seen.add((bool(least < 0), k % 4 == 0))
    assert len(seen) == 4


def test_two_crossings_of_an_interface_within_one_step_are_seen():
    """The branch x = p dips below h = (x − 0.5)² − 10⁻⁸ for 2·10⁻⁴ of its length only."""
    x, p = sp.symbols("x p")
    narrow = sp.Piecewise((1, (x - sp.Rational(1, 2)) ** 2 > sp.Rational(1, 10**8)), (2, True))
    model = fs.Model({x: (p - x) * narrow}, parameters={p: 0})
    assert len(model.interfaces) == 2
    diagram = fs.continue_equilibria(model, "p", (0, 1))
    values = [b["p"] for b in diagram.boundary_equilibria]
    np.testing.assert_allclose(values, [0.4999, 0.5001], atol=1e-13)


def test_a_work_space_is_made_once_for_every_thread():
    space = newton_space(3, 21)
    assert newton_space(3, 21) is space
    assert newton_space(3, 22) is not space
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(newton_space, 3, 21).result() is not space
