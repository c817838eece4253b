"""Several forcings as functions of one parameter: the overlay finds it along the run."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.slow_quantities import slow_quantity

pytestmark = pytest.mark.slow

x, t, g, w1, w2, omega = sp.symbols("x t g w1 w2 omega")


@pytest.fixture(scope="module")
def two_forcings():
    """x' = w1 + w2 x − x³ with w1 = cos 2θ, w2 = 1 + cos(θ)/2, θ = ω t."""
    return fs.Model(
        {x: w1 + w2 * x - x**3},
        forcing={w1: sp.cos(2 * omega * t), w2: 1 + sp.cos(omega * t) / 2},
        parameters={omega: 0.002},
    )


@pytest.fixture(scope="module")
def run(two_forcings):
    return fs.simulate(two_forcings, [1.0], periods=1)


@pytest.fixture(scope="module")
def polynomial(two_forcings):
    fast = two_forcings.frozen(slow={w1: 2 * g**2 - 1, w2: 1 + g / 2})
    return fs.continue_equilibria(fast, "g", over=(-1.1, 1.1))


def test_the_diagram_carries_its_path(polynomial):
    assert polynomial.path == {"w1": "2*g**2 - 1", "w2": "g/2 + 1"}


def test_the_parameter_is_found_from_the_forcing(polynomial, run):
    overlay = fs.overlay(polynomial, run)
    assert overlay.parameter == "g"
    assert overlay.slow == pytest.approx(np.cos(0.002 * overlay.t), abs=1e-13)
    assert overlay.outcome
    for t_ in overlay.transitions:
        assert t_.value == pytest.approx(np.cos(0.002 * t_.time), abs=1e-12)


def test_the_parameter_is_found_beyond_the_range_of_the_diagram(two_forcings, run):
    fast = two_forcings.frozen(slow={w1: 2 * g**2 - 1, w2: 1 + g / 2})
    narrow = fs.continue_equilibria(fast, "g", over=(-0.8, 0.8))
    found = slow_quantity(narrow, run).table
    assert found == pytest.approx(np.cos(0.002 * run.t), abs=1e-12)


def test_folds_are_those_of_the_cubic(polynomial):
    """On the path x³ = w1 + w2 x folds where w1² = 4 w2³/27."""
    for point in polynomial.folds:
        first, second = 2 * point["g"] ** 2 - 1, 1 + point["g"] / 2
        assert 27 * first**2 == pytest.approx(4 * second**3, abs=1e-10)


@pytest.mark.sample(0)
def test_another_parameter_of_the_same_path_gives_the_same_jumps(two_forcings, polynomial, run):
    """With w1 = cos 2h, w2 = 1 + cos(h)/2 the parameter h itself turns back at 0 and π."""
    fast = two_forcings.frozen(slow={w1: sp.cos(2 * g), w2: 1 + sp.cos(g) / 2})
    overlay = fs.overlay(fs.continue_equilibria(fast, "g", over=(0, 3.2)), run)
    one = [t_.time for t_ in fs.overlay(polynomial, run).transitions]
    assert len(one) == 4
    assert [t_.time for t_ in overlay.transitions] == pytest.approx(one, abs=0.01)
    middle = (overlay.t > 100) & (overlay.t < 1400)
    assert overlay.slow[middle] == pytest.approx(0.002 * overlay.t[middle], abs=1e-9)
    assert overlay.slow.min() == pytest.approx(0, abs=1e-4)
    # the nearest sample is up to half a step of the samples away
    assert overlay.slow.max() == pytest.approx(np.pi, abs=5e-3)


def test_a_run_off_the_path_is_refused(two_forcings, run):
    fast = two_forcings.frozen(slow={w1: g, w2: g / 2})
    diagram = fs.continue_equilibria(fast, "g", over=(-1, 1))
    with pytest.raises(fs.ArgumentError, match=r"leaves the path w(1 = g|2 = g/2), along"):
        fs.overlay(diagram, run)


def test_a_path_gone_over_twice_is_refused():
    model = fs.Model({x: w1 - x}, forcing={w1: sp.cos(t / 500) ** 2})
    diagram = fs.continue_equilibria(model.frozen(slow={w1: g**2}), "g", over=(-1, 1))
    run = fs.simulate(model, [1.0], periods=1)
    with pytest.raises(fs.ArgumentError, match="takes every value twice"):
        fs.overlay(diagram, run)


def test_a_parameter_that_is_no_slow_quantity_is_refused(two_forcings, run):
    fast = two_forcings.frozen().with_parameters(w1=0.1)
    held = fs.continue_equilibria(fast, "w2", over=(0, 2))
    overlay = fs.overlay(held, run)
    assert overlay.outcome.code == "another slow quantity"
    assert "w1 = 0.1 in the diagram, but varies from -" in overlay.summary()


@pytest.fixture(scope="module")
def gear_run():
    model = fs.systems.harmonic_gear()
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-20, 20))
    return slow_quantity(diagram, fs.simulate(model, [0.0, 0.0], t=(0.0, 50.0)))


def test_between_the_steps_it_has_the_bits_of_the_run(gear_run):
    run = gear_run.run
    times = np.sort(np.r_[np.linspace(*run.span, 500), run.step_starts])
    for asked in (times, times[::-1].copy(), times[77:78], times[:0]):
        value, state = gear_run.at(asked)
        columns = run.dense_columns(asked)
        assert value.tobytes() == columns[2].tobytes()
        assert state.T.tobytes() == columns[:2].tobytes()


@pytest.mark.parametrize("time", [-1e-9, 50.1, float("nan")])
def test_outside_the_run_there_is_none(gear_run, time):
    with pytest.raises(fs.ArgumentError, match="outside the run"):
        gear_run.at(np.array([1.0, time]))
