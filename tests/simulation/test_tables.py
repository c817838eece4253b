"""Loads given by tables: knots met exactly, values to the tolerance, files, overlays."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from scipy.interpolate import CubicSpline, interp1d

import fastslow as fs

x, v, w = sp.symbols("x v w")
FINE = fs.Integration(rtol=1e-13, atol=1e-13)
rng = np.random.default_rng(3)
TIMES = np.cumsum(rng.uniform(0.1, 1.0, 25))
VALUES = rng.normal(size=25)
KINDS = ("linear", "cubic", "previous")


def table(kind):
    return fs.Tabulated(TIMES, VALUES, interpolation=kind)


def relaxing(kind):
    """x' = w − x."""
    return fs.Model({x: w - x}, forcing={w: table(kind)})


def scipy_values(kind):
    if kind == "cubic":
        return CubicSpline(TIMES, VALUES)
    return interp1d(TIMES, VALUES, kind=kind)


def exact(kind, state, until):
    """Variation of constants, by Gauss-Legendre quadrature between the knots."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    edges = [t for t in TIMES if t < until]
    for a, b in zip(edges, [*edges[1:], until], strict=True):
        t = a + (b - a) * (nodes + 1) / 2
        load = scipy_values(kind)(t)
        integral = weights @ (load * np.exp(t - b)) * (b - a) / 2
        state = state * np.exp(a - b) + integral
    return state


@pytest.mark.parametrize("kind", KINDS)
def test_values_agree_with_scipy(kind):
    at = rng.uniform(TIMES[0], TIMES[-1], 200)
    assert table(kind)(at) == pytest.approx(scipy_values(kind)(at), abs=1e-12)
    assert (table(kind)(TIMES) == VALUES).all()
    if kind == "cubic":
        slopes = CubicSpline(TIMES, VALUES).derivative()(at)
        assert table(kind)(at, derivative=1) == pytest.approx(slopes, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_solution_and_knots_are_exact(kind):
    run = fs.simulate(relaxing(kind), [0.3], t=(TIMES[0], TIMES[-1]), integration=FINE)
    assert run.outcome.success
    assert set(TIMES[:-1]) <= set(run.steps[:, 0])
    for until in (TIMES[7], 0.5 * (TIMES[9] + TIMES[10]), TIMES[-1]):
        assert run(until)[0] == pytest.approx(exact(kind, 0.3, until), abs=1e-13)
    inside = TIMES[:-1] + 0.3 * np.diff(TIMES)
    assert run.dense_columns(inside)[1] == pytest.approx(scipy_values(kind)(inside), abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("begin", [TIMES[6], 0.5 * (TIMES[6] + TIMES[7])])
def test_a_run_may_begin_at_any_knot_and_between(kind, begin):
    model = relaxing(kind)
    whole = fs.simulate(model, [0.3], t=(TIMES[0], TIMES[-1]), integration=FINE)
    rest = fs.simulate(model, whole(begin), t=(begin, TIMES[-1]), integration=FINE)
    assert rest.end == pytest.approx(whole.end, abs=1e-13)
    knots = set(TIMES[begin < TIMES][:-1])
    assert knots <= set(rest.steps[:, 0])


@pytest.mark.parametrize("kind", KINDS)
def test_ensembles_agree_with_single_runs_and_over_threads(kind):
    starts = rng.normal(size=(30, 1))
    span = (TIMES[0] + 0.05, TIMES[-1] - 0.05)
    one, two = (
        fs.simulate_many(
            relaxing(kind), starts, t=span, integration=FINE, execution=fs.Execution(threads=n)
        )
        for n in (1, 2)
    )
    assert one.final.tobytes() == two.final.tobytes()
    run = fs.simulate(relaxing(kind), starts[4], t=span, integration=FINE)
    assert one.final[4] == pytest.approx(run.end[1:], abs=1e-12)


def test_an_interface_that_jumps_with_the_table_changes_the_region_at_the_knot():
    """x' = −sign(x − w) with w = 0, 2, 0: the state is on one side, then on the other."""
    steps = fs.Tabulated([0, 1, 2, 3], [0, 2, -2, 0], interpolation="previous")
    model = fs.Model({x: sp.Piecewise((-1, x > w), (sp.Rational(1, 2), True))}, forcing={w: steps})
    run = fs.simulate(model, [1.5], t=(0, 3), integration=FINE)
    assert [(c.time, c.direction) for c in run.crossings] == [(1.0, -1), (2.0, 1)]
    assert run(1.0)[0] == pytest.approx(0.5, abs=1e-14)
    assert run.end[1:] == pytest.approx([0.0], abs=1e-14)


def test_sliding_along_an_interface_that_moves_with_a_table():
    """x' = −2 sign(x − w) stays at x = w while |w'| < 2, across the knots."""
    moving = fs.Tabulated([0, 1, 2], [0, 1, 0])
    model = fs.Model({x: -2 * sp.sign(x - w)}, forcing={w: moving})
    run = fs.simulate(model, [0.5], t=(0, 2), integration=FINE)
    assert run.itinerary == ("S1", "S1|S2")
    assert run([1.0, 1.5])[0] == pytest.approx([1.0, 0.5], abs=1e-13)


def test_models_with_tables_compare_and_are_saved(tmp_path):
    model = relaxing("cubic")
    other = fs.Model(
        {x: w - x}, forcing={w: fs.Tabulated(TIMES, 2 * VALUES, interpolation="cubic")}
    )
    assert model == relaxing("cubic") == pickle.loads(pickle.dumps(model)) != other
    assert model.stored != other.stored
    assert model.equations == "x' = w - x\nw = cubic_table(t)"
    run = fs.simulate(model, [0.0], t=(TIMES[0], TIMES[-1]))
    run.save(tmp_path / "run.npz")
    loaded = fs.load(tmp_path / "run.npz")
    assert loaded == run
    assert fs.simulate(loaded.model, [0.0], t=(TIMES[0], TIMES[-1])) == run


def test_overlay_of_a_table_is_that_of_its_formula():
    t = sp.Symbol("t")
    rate = w - x**3 + x
    table_of_line = fs.Tabulated([0, 10], [-2, 2])
    tabulated = fs.Model({x: rate}, forcing={w: table_of_line})
    formula = fs.Model({x: rate}, forcing={w: sp.Rational(2, 5) * t - 2})
    diagram = fs.continue_equilibria(formula.frozen(), "w", over=(-2, 2))
    one, other = (
        fs.overlay(diagram, fs.simulate(m, [-1.0], t=(0, 10))) for m in (tabulated, formula)
    )
    assert len(one.transitions) == 1
    assert one.delays == pytest.approx(other.delays, abs=1e-9)
    predicted = [o.transitions[0].predicted for o in (one, other)]
    assert predicted[0] == pytest.approx(predicted[1], rel=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: fs.Tabulated([0, 0], [1, 2]), r"times\[0\] = 0 is followed by 0"),
        (lambda: fs.Tabulated([0], [1]), "received 1 times; linear interpolation needs at least 2"),
        (lambda: fs.Tabulated([0, 1], [1]), "expected two lists of the same length"),
        (lambda: fs.Tabulated([0, 1], [1, np.nan]), r"values\[1\] = nan; expected a number"),
        (lambda: fs.Tabulated([0, 1e-320], [0, 1e300]), "the slopes of this table overflow"),
        (lambda: fs.Tabulated([0, 1], [1, 2], interpolation="cubic"), "needs at least 4"),
        (lambda: fs.Tabulated([0, 1], [1, 2], interpolation="spline"), "unknown interpolation"),
        (lambda: table("linear")(TIMES[-1] + 1), "is outside the table"),
        (lambda: fs.simulate(relaxing("linear"), [0], t=(0, 5)), "tables are not extrapolated"),
        (
            lambda: fs.simulate_many(relaxing("linear"), [0], t=(1, 99)),
            "tables are not extrapolated",
        ),
        (lambda: fs.simulate(relaxing("linear"), [0], periods=1), "has a common period"),
        (lambda: fs.find_orbit(relaxing("linear"), [0]), "a period only with periodic=True"),
        (lambda: fs.Model({x: table("linear")}), "expected an expression, received Tabulated"),
        (
            lambda: fs.export(relaxing("linear"), "numpy"),
            "table of values in time.*only simulations",
        ),
        (lambda: fs.find_orbit(relaxing("linear"), [0.0], period=1.0), "only with periodic=True"),
        (lambda: fs.Tabulated([0, 1], [0, 1], periodic=True), "begins with the value 0 and ends"),
    ],
)
def test_bad_input(call, words):
    with pytest.raises(fs.FastSlowError, match=words):
        call()


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "previous"])
def test_a_periodic_table_has_a_periodic_orbit_in_closed_form(interpolation):
    """x' = w − x with w of period 2: x(0) = ∫ exp(s − 2) w(s) ds / (1 − exp(−2)) over a period."""
    knots = np.array([0.0, 0.5, 1.2, 2.0])
    table = fs.Tabulated(knots, [0, 1, -0.5, 0], interpolation=interpolation, periodic=True)
    assert table.period == 2.0
    assert table([2.3, -3.7]) == pytest.approx(table(0.3), abs=1e-14)
    model = fs.Model({x: w - x}, forcing={w: table})
    assert model.period() == pytest.approx(2.0, rel=1e-15)
    points, weights = np.polynomial.legendre.leggauss(20)
    total = 0.0
    for begin, end in pairwise(knots):
        at = begin + 0.5 * (end - begin) * (points + 1)
        total += 0.5 * (end - begin) * weights @ (np.exp(at - 2) * table(at))
    start = total / (1 - np.exp(-2))
    orbit = fs.find_orbit(model, [0.5])
    assert orbit.outcome.success
    assert orbit(2.0 * np.ceil(orbit.t0 / 2))[0] == pytest.approx(start, abs=1e-14)
    assert orbit.multipliers[0] == pytest.approx(np.exp(-2), abs=1e-14)
    fine = fs.Integration(rtol=1e-13)
    run = fs.simulate(model, [start], t=(-4, 40), integration=fine)
    assert run(np.arange(-4, 41, 2.0))[0] == pytest.approx(start, abs=1e-12)
    assert set(np.round(knots[1:] + 10, 12)) <= set(np.round(run.steps[:, 0], 12))
    many = fs.simulate_many(model, [[start], [start + 1]], t=(-4, 0), integration=fine)
    assert many.final[:, 0] == pytest.approx([start, start + np.exp(-4)], abs=1e-12)
