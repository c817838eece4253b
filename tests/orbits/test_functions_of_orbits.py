"""Functions of flows, branches and their ends by themselves, against closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import fastslow as fs
from fastslow.orbits.ends.slowest_points import Saddle
from fastslow.orbits.find import candidates
from fastslow.orbits.flow import jumps, stepping
from fastslow.orbits.points.contacts import ContactEquations
from fastslow.orbits.trace import bifurcation_rows, branch_assembly, vanishing_cycles

ORDER = 20
A = np.array([[-0.5, 2.0], [-1.0, 0.3]])


def linear(time_dependent=False):
    """x' = A x + (0, t² + p): entries of f_z, f_t and f_p, and their series from t = 0.25."""
    entries = [[i, j, 2 * i + j, 1] for i in range(2) for j in range(2)]
    entries += [[1, 2, 4, 0], [1, 3, 5, 0]] if time_dependent else []
    W = np.zeros((7, ORDER + 1))
    W[:4, 0] = A.ravel()
    W[4, :2] = [0.5, 2.0]
    W[5, 0] = 1.0
    problem = SimpleNamespace(
        n=2,
        unknowns=4 if time_dependent else 2,
        order=ORDER,
        tol=1e-12,
        entries=np.array(entries),
        starts=np.array([0, len(entries)]),
    )
    return problem, W.ravel()


def test_derivatives_of_a_linear_flow_are_exponentials():
    problem, W = linear(True)
    X = np.full((ORDER + 1, 2, 4), np.nan)
    stepping.expand_derivatives(problem, 0, W, X)
    # the flow by time is that of (A, f_t) with f_t' = (0, 2), by the parameter that of (A, e₂)
    whole = np.zeros((5, 5))
    whole[:2, :2] = A
    whole[1, 2], whole[1, 4], whole[2, 3] = 1.0, 1.0, 1.0
    power = np.eye(5)
    for k in range(ORDER + 1):
        np.testing.assert_allclose(X[k, :, :2], power[:2, :2], atol=1e-15)
        np.testing.assert_allclose(X[k, :, 3], power[:2, 4], atol=1e-15)
        np.testing.assert_allclose(X[k, :, 2], power[:2, 2:4] @ [0.5, 2.0], atol=1e-15)
        power = power @ whole / (k + 1)


def test_steps_are_composed_to_slopes_and_factors():
    problem, W = linear(True)
    space = SimpleNamespace(
        X=np.zeros((ORDER + 1, 2, 4)),
        step=np.zeros((2, 4)),
        factor=np.eye(2),
        column=np.zeros(2),
    )
    stepping.expand_derivatives(problem, 0, W, space.X)
    slopes = np.zeros((2, 4))
    slopes[:, :2] = np.eye(2)
    for h in (0.3, 0.2):
        stepping.compose(space, slopes, h)
    np.testing.assert_allclose(space.factor, expm(0.5 * A), rtol=1e-13)
    np.testing.assert_allclose(slopes[:, :2], space.factor, rtol=1e-14)
    # of a parameter: ∫ exp(A s) e₂ ds over both steps
    np.testing.assert_allclose(
        slopes[:, 3], np.linalg.solve(A, (expm(0.5 * A) - np.eye(2)) @ [0.0, 1.0]), rtol=1e-13
    )


def test_integrals_of_the_trace():
    problem, W = linear()
    assert stepping.integral_of_trace(problem, 0, W, 0.7) == pytest.approx(-0.2 * 0.7)
    W = W.reshape(7, -1)
    W[3, 1], W[0, 2] = 6.0, 9.0
    found = stepping.integral_of_trace(problem, 0, W.ravel(), -0.5)
    assert found == pytest.approx(0.2 * 0.5 + 3 * 0.25 - 3 * 0.125)
    # the last two terms c t^(k+1)/(k+1) of the integral equal the tolerance
    assert stepping.trace_step(problem, 0, W.ravel(), 3.0) == 3.0
    for k in (ORDER - 1, ORDER):
        W[:4, ORDER - 1 :] = 0.0
        W[0, k], W[3, k] = 5.0, 2.0
        expected = (1e-12 * (k + 1) / 7.0) ** (1 / (k + 1))
        assert stepping.trace_step(problem, 0, W.ravel(), 3.0) == pytest.approx(expected)


@pytest.mark.parametrize("first", [0, 3])
def test_steps_end_where_the_last_terms_are_small_beside_the_leading_ones(first):
    """t^j exp(r t): the last terms are 1e-12 of the largest of the first four."""
    rate, X = 8.0, np.zeros((ORDER + 1, 1, 1))
    for k in range(ORDER + 1 - first):
        X[first + k, 0, 0] = rate**k / math.factorial(k)
    h = stepping.derivatives_step(X, 1, 1, ORDER, 1e-12, 10.0)
    terms = np.array([X[k, 0, 0] * h**k for k in range(ORDER + 1)])
    leading = terms[first : first + stepping.LEADING].max()
    assert terms[-2:].max() <= 2e-12 * leading * (1 + 1e-9)
    assert stepping.derivatives_step(X, 1, 1, ORDER, 1e-12, 2 * h) == pytest.approx(h, rel=0.1)
    assert terms[-2:].max() > 0.2e-12 * leading
    assert stepping.derivatives_step(X, 1, 1, ORDER, 1e-12, 0.5 * h) == 0.5 * h
    X[ORDER, 0, 0] = np.nan
    assert np.isnan(stepping.derivatives_step(X, 1, 1, ORDER, 1e-12, 1.0))


@pytest.mark.parametrize(
    ("factor", "ends"),
    [
        (np.diag([1e5, 1e5]), False),
        (np.diag([1e7, 1e7]), True),
        (np.diag([1e-5, 1e-5]), False),
        (np.diag([1e-7, 1e-7]), True),
        (np.diag([1e10, 1e-10]), False),
        ([[1.0, 1.0], [1.0, 1.021]], False),
        ([[1.0, 1.0], [1.0, 1.019]], True),
        ([[1e6, 1e6], [1e-6, 1.021e-6]], False),
        ([[1.0, 1.0], [1.0, 1.0]], True),
    ],
)
def test_factors_end_where_rounding_would_change_their_determinant(factor, ends):
    """The sum of |P_ij (P⁻¹)_ji| is 2 + 4/d for ((1, 1), (1, 1 + d)), and at most 200."""
    space = SimpleNamespace(
        factor=np.array(factor, float),
        lower=np.zeros((2, 3)),
        right=np.zeros(2),
        column=np.zeros(2),
    )
    assert stepping.is_unbalanced(space) == ends


def test_values_constants_and_factors():
    assert stepping.value_of(np.array([9.0, 1, 2, 3]), 1, 2, 0.5) == 2.75
    problem = SimpleNamespace(parameters=np.arange(5.0))
    segments = SimpleNamespace(constants=np.array([[7.0, 8], [9, 10]]))
    stepping.set_constants(problem, segments, 1)
    assert problem.parameters.tolist() == [0, 1, 2, 9, 10]
    factors = SimpleNamespace(owners=np.zeros(3, int), matrices=np.zeros((3, 2, 2)))
    progress = np.array([0, 1, 0, 0])
    stepping.put_factor(progress, factors, 5, factor := A.copy())
    assert (progress.tolist(), factors.owners.tolist()) == ([0, 2, 0, 0], [0, 5, 0])
    assert factors.matrices[1].tolist() == A.tolist()
    assert factor.tolist() == [[1, 0], [0, 1]]


def test_left_eigenspaces_of_a_saddle():
    """Of a matrix with the eigenvalues 2, −1 and −3 ± 4i, the last two in one plane."""
    basis = np.random.default_rng(2).normal(size=(4, 4))
    blocks = np.diag([2.0, -1.0, -3.0, -3.0])
    blocks[2:, 2:] += [[0.0, 4.0], [-4.0, 0.0]]
    matrix = basis @ blocks @ np.linalg.inv(basis)
    saddle = Saddle(np.zeros(4), matrix, np.linalg.eigvals(matrix), np.zeros(4), np.eye(4))
    unstable, stable = saddle.spaces()
    assert (unstable.shape, stable.shape) == ((1, 4), (3, 4))
    for rows in (unstable, stable):
        np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-13)
    # biorthogonal to the right eigenvectors of the other part
    np.testing.assert_allclose(unstable @ basis[:, 1:], 0, atol=1e-12)
    np.testing.assert_allclose(stable @ basis[:, :1], 0, atol=1e-12)
    assert saddle.is_saddle
    away = basis @ [1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(
        saddle.unstable_flow(away, 0.5), np.exp(1.0) * basis[:, 0], rtol=1e-11
    )


def test_a_contact_at_a_reset_has_another_state_than_the_next_segment():
    shooting = SimpleNamespace(form=SimpleNamespace(jumps=np.array([-1, 0, 2])))
    known = {"scale": np.ones(3), "function": 0, "mode": 0}
    for segment, resets in ((0, False), (1, True), (2, True)):
        at = ContactEquations(shooting=shooting, segment=segment, **known)
        assert at.resets == resets
        beyond = ContactEquations(shooting=shooting, segment=segment, beyond=True, **known)
        assert not beyond.resets


class Cycle(SimpleNamespace):
    def mirrors(self, other):
        return self.phase * other.phase < 0


def cycles(*ranges):
    return [Cycle(range=abs(r), phase=np.sign(r)) for r in ranges]


@pytest.mark.parametrize(
    ("rows", "row", "point"),
    [
        ([1.0, 0.1], 9e-5, True),
        ([1.0, 0.1], 1.1e-4, False),
        # small from the beginning, and growing
        ([1.0, 5e-5], 9e-5, False),
        ([1.0, 0.1], -0.1, True),
        ([-1.0, 0.1], 0.2, False),
    ],
)
def test_cycles_that_are_points_or_mirrored(rows, row, point):
    assert vanishing_cycles.is_point(cycles(*rows), *cycles(row)) == point


@pytest.mark.parametrize(
    ("rows", "row", "passed"),
    [
        ([1.0, 0.4], -1.0, True),
        ([1.0, 0.6], -1.0, False),
        ([1.0, 0.4], -0.7, False),
        ([1.0, 0.4], 1.0, False),
        ([0.4], -1.0, False),
    ],
)
def test_a_hopf_point_is_passed_in_two_steps(rows, row, passed):
    assert vanishing_cycles.is_passed(cycles(*rows), *cycles(row)) == passed


def row_of(error, chatters=False, **fields):
    arrays = SimpleNamespace(errors=(0.0, 0.0, error))
    return SimpleNamespace(arrays=arrays, shooting=SimpleNamespace(chatters=chatters), **fields)


def test_the_orbits_that_rounding_limits_are_counted():
    rows = [row_of(1e-12), row_of(3e-9), row_of(2e-8), row_of(1.0, chatters=True)]
    (note,) = branch_assembly._limited_by_rounding(rows, 1e-10)
    assert "of 2 orbits, to at most 2e-08 of" in note
    assert "tolerance 1e-10" in note
    assert branch_assembly._limited_by_rounding(rows, 1e-7) == []


def test_places_of_rows_within_a_step():
    scale = np.array([1.0, 10.0])
    curve = SimpleNamespace(frame=lambda *_: SimpleNamespace(scale=scale))
    one, two = (row_of(0, u=np.array(u), value=u[-1]) for u in ([1.0, 0.0], [3.0, 20.0]))
    between = row_of(0, u=np.array([2.0, 5.0]), value=5.0)
    # steps (2, 2) and (1, 0.5) in units
    assert bifurcation_rows.place_of(curve, one, two, between) == pytest.approx(3 / 8)
    other = row_of(0, u=np.array([2.0, 0.0, 5.0]), value=5.0)
    assert bifurcation_rows.place_of(curve, one, two, other) == 0.25
    assert bifurcation_rows.place_of(curve, one, one, other) == 5.0


def test_the_angle_of_the_pair_nearest_to_the_unit_circle():
    signs = [SimpleNamespace(pair=p) for p in ((0.3, 1.0), None, (-0.1, 2.0), (0.2, 3.0))]
    assert bifurcation_rows._critical_angle(signs) == 2.0
    assert bifurcation_rows._critical_angle(signs[1:2]) == 0.5 * np.pi


def test_clocks_between_two_times():
    """Period 2 from 0.5, and period p0 = 3 from p1 = 1."""
    some = SimpleNamespace(tables=())
    codes, values = [("2.0", "0.5"), ("p0", "p1")], np.array([3.0, 1.0])
    found = jumps.constants_at(some, codes, np.array([0.0, 3.0, 4.6]), values)
    assert found.tolist() == [[-1, -1], [1, 0], [2, 1]]
    between = jumps.instants_between(some, codes, 0.5, 7.0, values)
    assert between == [(1.0, 1), (2.5, 0), (4.0, 1), (4.5, 0), (6.5, 0)]


@pytest.mark.parametrize(("period", "changes"), [(np.pi, [1.0, 0.0]), (2 * np.pi, [0.0, 0.0])])
def test_changes_over_the_last_period_are_in_units_of_the_ranges(period, changes):
    """x = 2 cos t, v = −2 sin t, of which the last period is a half or a whole turn."""
    x, v = sp.symbols("x v")
    run = fs.simulate(fs.Model({x: v, v: -x}), [2, 0], t=(0, 4 * np.pi))
    assert candidates.changes_over(run, period) == pytest.approx(changes, abs=1e-7)
