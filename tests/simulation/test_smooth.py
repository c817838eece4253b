"""Smooth and slow-fast systems against SciPy at tight tolerance and closed forms."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from fastslow.model.model import Model
from fastslow.simulation.one import simulate
from fastslow.simulation.run_tables import RunTables
from fastslow.simulation.settings import Integration

x, y, z, w, t = sp.symbols("x y z w t")


def test_van_der_pol_with_slow_forcing():
    a, e = sp.symbols("a e")
    model = Model(
        {x: y - x**3 / 3 + x, y: (w - x) / 10},
        forcing={w: a * sp.cos(e * t)},
        parameters={a: 0.8, e: 0.05},
    )
    run = simulate(model, [1, 0], periods=1, integration=Integration(rtol=1e-12))
    times = np.linspace(0, run.span[1], 50)
    reference = solve_ivp(
        lambda s, u: [
            u[1] - u[0] ** 3 / 3 + u[0],
            (0.8 * np.cos(0.05 * s) - u[0]) / 10,
        ],
        run.span,
        [1, 0],
        "DOP853",
        times,
        rtol=1e-13,
        atol=1e-13,
    )
    assert np.abs(run(times) - reference.y).max() < 1e-9
    assert run.regime is None
    assert run.itinerary == ("S1",)


def test_period_of_van_der_pol():
    # period 6.66328685932 at mu = 1, by high-precision integration
    model = Model({x: y, y: (1 - x**2) * y - x}, interfaces={"rest": y})
    run = simulate(model, [2, 0], t=(0, 80), integration=Integration(rtol=1e-13))
    peaks = [c.time for c in run.crossings if c.direction < 0]
    assert peaks[-1] - peaks[-2] == pytest.approx(6.66328685932, abs=2e-11)


def test_slow_state():
    e = sp.Symbol("e")
    model = Model({x: z - x}, slow={z: -e * z}, parameters={e: 0.01})
    run = simulate(model, {"z": 1.0, "x": 0.0}, t=(0, 100), integration=Integration(rtol=1e-13))
    times = np.linspace(0, 100, 11)
    slow = np.exp(-0.01 * times)
    fast = (slow - np.exp(-times)) / 0.99
    assert run.states == ("x", "z")
    assert np.abs(run(times) - [fast, slow]).max() < 1e-12
    assert np.abs(run["z"] - np.exp(-0.01 * run.t)).max() < 1e-12


@pytest.mark.parametrize("tol", [1e-6, 1e-8, 1e-10, 1e-12])
def test_error_follows_the_tolerance_on_a_contracting_region(tol):
    model = Model({x: -x + sp.cos(t)})
    run = simulate(model, [1], t=(0, 50), integration=Integration(rtol=tol))
    times = np.linspace(0, 50, 101)
    exact = (np.cos(times) + np.sin(times)) / 2 + np.exp(-times) / 2
    assert np.abs(run(times)[0] - exact).max() < tol


def test_order_is_free():
    model = Model({x: y, y: -x})
    for order in (6, 30):
        run = simulate(model, [1, 0], t=(0, 10), integration=Integration(rtol=1e-10, order=order))
        assert run(10.0) == pytest.approx([np.cos(10), -np.sin(10)], abs=1e-8)


def test_samples_are_what_the_series_says_however_many_a_step_has():
    model = Model({x: y, y: -x}, forcing={w: sp.sin(t)})
    for count in (2, 5, 40, 2000):
        for dense in (True, False):
            run = simulate(model, [1, 0], t=(0, 3), samples=count, dense=dense)
            assert len(run.steps) < 5
            exact = [np.cos(run.t), -np.sin(run.t), np.sin(run.t)]
            assert np.abs(run.sampled[1] - exact[: len(run.sampled[1])]).max() < 1e-8


def test_tables_are_as_large_as_those_of_the_last_run_and_cut_to_what_is_kept():
    model = Model({x: y, y: -x})
    long, short = (simulate(model, [1, 0], t=(0, end)) for end in (3000, 1))
    grown = []
    original = RunTables.with_space
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(RunTables, "with_space", lambda *a: grown.append(a) or original(*a))
        again = simulate(model, [1, 0], t=(0, 3000))
        assert grown
        grown.clear()
        once_more = simulate(model, [1, 0], t=(0, 3000))
        assert not grown
    assert again == once_more == long
    for run in (long, short, again, once_more):
        for table in (run.steps, run.crossing_table, run.series.base):
            assert table.base is None
            assert table.flags.owndata
            assert not table.flags.writeable
