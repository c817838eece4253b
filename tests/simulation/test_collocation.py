"""Steps where no Taylor series exists, against closed forms, quadrature and SciPy."""

from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import gamma, j0

from fastslow.model.model import Model
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Execution, Integration

pytestmark = pytest.mark.slow

x, y, v, t, w = sp.symbols("x y v t w")
k, c, D = sp.symbols("k c D")
TOLERANCES = [10.0**-n for n in range(6, 12)]


@pytest.fixture(scope="module")
def decay():
    """Contracting, driven by a Bessel function that is also a slow quantity."""
    return Model({x: w - x}, forcing={w: sp.besselj(0, t)})


@pytest.fixture(scope="module")
def gap():
    """An oscillator with a gap, driven by a Bessel function."""
    side = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    return Model(
        {x: v, v: 3 * sp.besselj(0, t / 5) * sp.cos(t) - c * v - k * side},
        parameters={k: 5, c: 0.4, D: 0.25},
    )


@pytest.fixture(scope="module")
def hertz():
    """Contact by Hertz's law: its series does not exist where contact begins."""
    r = sp.Rational(3, 2)
    side = sp.Piecewise(((x - D) ** r, x > D), (-((-x - D) ** r), x < -D), (0, True))
    return Model({x: v, v: sp.sin(t) - c * v - k * side}, parameters={k: 10, c: 0.2, D: 0.25})


def pieces(rate, side_of, start, end, times):
    """A solution by SciPy, restarted at every change of sides of +-1/4."""
    found = np.empty((2, len(times)))
    now, u, crossings = 0.0, np.array(start, dtype=float), []
    side = side_of
    while now < end:
        edges = [lambda s, u: u[0] - 0.25, lambda s, u: u[0] + 0.25]
        for edge in edges:
            edge.terminal = True
        active = edges if side == 0 else edges[:1] if side > 0 else edges[1:]
        if side:
            active[0].direction = -side
        here = times[(times >= now)]
        run = solve_ivp(
            lambda s, u, side=side: rate(s, u, side),
            (now, end),
            u,
            "DOP853",
            dense_output=True,
            events=active,
            rtol=1e-13,
            atol=1e-14,
            max_step=0.25,
        )
        last = run.t[-1]
        chosen = here[here <= last]
        if len(chosen):  # SciPy's dense output takes no empty array
            found[:, np.isin(times, chosen)] = run.sol(chosen)
        now, u = last, run.y[:, -1]
        if run.status == 1:
            crossings.append(now)
            side = (1 if u[0] > 0 else -1) if side == 0 else 0
            # beyond the edge, by less than rounding matters
            u[0] = np.copysign(0.25, u[0]) + np.copysign(1e-15, u[1])
    return found, crossings


def grown(s):
    return mpmath.exp(s) * mpmath.j0(s)


@cache
def solution(until):
    """x of `decay` at nine times, by quadrature."""
    knots = [mpmath.linspace(0, s, 9)[1:] for s in np.linspace(0, until, 9)]
    return [float(mpmath.exp(-k[-1]) * (1 + mpmath.quad(grown, [0, *k]))) for k in knots]


@pytest.mark.parametrize("tol", TOLERANCES)
def test_error_follows_the_tolerance(decay, tol):
    run = simulate(decay, [1], t=(0, 20), integration=Integration(rtol=tol))
    times = np.linspace(0, 20, 9)
    assert np.abs(run(times)[0] - solution(20)).max() < 10 * tol
    fine = np.linspace(0, 20, 999)
    assert np.abs(run.dense_columns(fine)[1] - j0(fine)).max() < 10 * tol
    assert run.method == "collocation of order 12 (no Taylor recurrence for besselj)"
    assert run.method in repr(run)


@pytest.mark.parametrize("order", [4, 8, 12])
def test_order_is_free_up_to_twelve(decay, order):
    run = simulate(decay, [1], t=(0, 20), integration=Integration(rtol=1e-8, order=order))
    best = simulate(decay, [1], t=(0, 20), integration=Integration(rtol=1e-13))
    times = np.linspace(0, 20, 333)
    assert f"order {order} " in run.method
    assert np.abs(run(times) - best(times)).max() < 1e-7


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-11])
def test_every_step_keeps_the_tolerance_throughout(tol):
    model = Model({x: v, v: (1 - x**2) * v - x * sp.gamma(1 + x**2 / 4)})
    run = simulate(model, [2, 0], t=(0, 12), integration=Integration(rtol=tol))
    begin, length = run.steps[:, 0], run.steps[:, 1]
    for i in range(0, len(begin), max(1, len(begin) // 12)):
        inside = begin[i] + length[i] * np.linspace(0, 1, 9)
        inside[-1] = np.nextafter(inside[-1], begin[i])
        exact = solve_ivp(
            lambda s, u: [u[1], (1 - u[0] ** 2) * u[1] - u[0] * gamma(1 + u[0] ** 2 / 4)],
            (inside[0], inside[-1]),
            run(inside[0]),
            "DOP853",
            inside,
            rtol=1e-13,
            atol=1e-14,
        ).y
        assert (np.abs(run(inside) - exact) / (1 + np.abs(exact))).max() < 10 * tol


def test_gamma_in_the_rate_by_quadrature():
    # x' = 1 / gamma(1 + x^2) takes the integral of gamma(1 + x^2) from 0 to x to reach x
    run = simulate(
        Model({x: 1 / sp.gamma(1 + x**2)}), [0], t=(0, 4), integration=Integration(rtol=1e-12)
    )
    with mpmath.workdps(20):
        end = float(mpmath.quad(lambda u: mpmath.gamma(1 + u * u), [0, 1, run(4.0)[0]]))
    assert end == pytest.approx(4.0, abs=1e-11)


def test_functions_with_a_closed_derivative_keep_the_series():
    # y' = Ai(t), x'' = t x has the solution Ai; z = W(t) as z' = 1 / (exp z (1 + z))
    z = sp.Symbol("z")
    model = Model({x: v, v: t * x, y: sp.airyai(t), z: sp.LambertW(t) - z})
    with mpmath.workdps(25):
        ai, aip = mpmath.airyai(0), mpmath.airyai(0, derivative=1)
        run = simulate(
            model, [float(ai), float(aip), 0, 0], t=(0, 3), integration=Integration(rtol=1e-13)
        )
        end = run(3.0)
        assert run.method == "Taylor series of order 24"
        # the other solution Bi grows to 15 times rounding
        assert end[0] == pytest.approx(float(mpmath.airyai(3)), abs=2e-14)
        assert end[2] == pytest.approx(float(mpmath.quad(mpmath.airyai, [0, 3])), abs=1e-13)
        mean = mpmath.quad(lambda s: mpmath.exp(s - 3) * mpmath.lambertw(s), [0, 1, 3])
        assert end[3] == pytest.approx(float(mean.real), abs=1e-13)


def test_crossings_of_a_gap(gap):
    times = np.linspace(0, 30, 121)
    exact, crossings = pieces(
        lambda s, u, side: [
            u[1],
            3 * j0(s / 5) * np.cos(s) - 0.4 * u[1] - (5 * (u[0] - 0.25 * side) if side else 0.0),
        ],
        0,
        [0, 0],
        30,
        times,
    )
    for tol, digits in ((1e-6, 3e-5), (1e-9, 3e-8), (1e-12, 3e-10)):
        run = simulate(gap, [0, 0], t=(0, 30), integration=Integration(rtol=tol))
        assert np.abs(run(times) - exact).max() < digits
        assert [c.time for c in run.crossings] == pytest.approx(crossings, abs=digits)
        for crossing in run.crossings:
            assert abs(crossing.state[0]) == 0.25
    assert len(crossings) > 10


def test_a_crossing_time_by_quadrature():
    # x = int J0 passes 1 on its way up: Newton on the quadrature
    model = Model({x: sp.besselj(0, t)}, interfaces={"one": x - 1})
    run = simulate(model, [0], t=(0, 3), integration=Integration(rtol=1e-13))
    with mpmath.workdps(25):
        exact = mpmath.findroot(lambda s: mpmath.quad(mpmath.j0, [0, s]) - 1, 1.1)
    assert [c.time for c in run.crossings] == pytest.approx([float(exact)], abs=2e-13)


def test_sliding_and_its_exit():
    # slides on y = 0 until the field above, -J0(x), turns upwards at the first zero of J0
    above = sp.Piecewise((-sp.besselj(0, x), y > 0), (2, True))
    model = Model({x: sp.Piecewise((1, y > 0), (3, True)), y: above})
    run = simulate(model, [0, 0], t=(0, 3), integration=Integration(rtol=1e-12))
    assert run.itinerary == ("S1|S2", "S1")
    leave = run.crossings[0]
    with mpmath.workdps(20):
        zero = mpmath.besseljzero(0, 1)
        # alpha = a / (a - b) = J0 / (J0 + 2), x' = 1 + 2 alpha
        time = mpmath.quad(lambda u: (mpmath.j0(u) + 2) / (3 * mpmath.j0(u) + 2), [0, 1, zero])
    assert leave.state == pytest.approx([float(zero), 0.0], abs=1e-11)
    assert leave.time == pytest.approx(float(time), abs=1e-11)
    assert np.abs(run(np.linspace(0, leave.time, 9))[1]).max() == 0.0


def test_many_are_as_one(gap):
    many = simulate_many(
        gap, [[0, 0], [1, 0]], parameters={k: [5, 50]}, t=(0, 20), execution=Execution(threads=2)
    )
    for i, (start, stiff) in enumerate((([0, 0], 5), ([1, 0], 50))):
        one = simulate(gap.with_parameters(k=stiff), start, t=(0, 20))
        assert many.final[i].tolist() == one.end[1:].tolist()
    assert "collocation of order 12" in many.method
    assert many.method in repr(many)


def test_a_series_that_is_singular_where_contact_begins(hertz):
    times = np.linspace(0, 20, 81)
    exact, crossings = pieces(
        lambda s, u, side: [
            u[1],
            np.sin(s) - 0.2 * u[1] - side * 10 * max(side * u[0] - 0.25, 0.0) ** 1.5,
        ],
        0,
        [0, 0],
        20,
        times,
    )
    for tol, digits in ((1e-6, 1e-4), (1e-9, 1e-7), (1e-11, 1e-8)):
        run = simulate(hertz, [0, 0], t=(0, 20), integration=Integration(rtol=tol))
        assert np.abs(run(times) - exact).max() < digits
        assert [c.time for c in run.crossings] == pytest.approx(crossings, abs=digits)
    assert len(crossings) > 5
    assert run.method.startswith("Taylor series of order 16, ")
    assert run.method.endswith(" steps by collocation where it is singular")


@pytest.mark.parametrize("start", [(0.25, 0.0), (0.25, 0.5), (-0.25, -0.5), (0.25, -1e-9)])
def test_starts_on_an_interface(hertz, gap, start):
    for model in (hertz, gap):
        run = simulate(model, start, t=(0, 2), integration=Integration(rtol=1e-10))
        near = [start[0] + 1e-9 * np.sign(start[1] or 1), start[1]]
        other = simulate(model, near, t=(0, 2), integration=Integration(rtol=1e-10))
        assert run.outcome
        assert run(2.0) == pytest.approx(other(2.0), abs=1e-7)


def test_poles_end_a_run_with_an_outcome():
    # x falls into the pole of gamma at 0 from above
    run = simulate(Model({x: -sp.gamma(x)}), [0.5], t=(0, 5))
    assert run.outcome.code == "singular"
    assert run.span[1] < 1.0
    outside = simulate(Model({x: sp.loggamma(x)}), [-0.5], t=(0, 1))
    assert outside.outcome.code == "not finite at start"
