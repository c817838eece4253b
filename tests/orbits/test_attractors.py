"""Attractors of an ensemble and their basins, against closed forms and quadrature."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

from .models import block_on_belt, gear_pair, v, x

pytestmark = pytest.mark.slow

BOX = {"x": (-2, 2), "v": (-2, 2)}


def subcritical(r=-0.1):
    """Radius ρ' = ρ (r + ρ² − ρ⁴): a stable focus inside an unstable and a stable circle."""
    R = x**2 + v**2
    growth = sp.Symbol("r") + R - R**2
    return fs.Model({x: -v + x * growth, v: x + v * growth}, parameters={"r": r})


@pytest.fixture(scope="module")
def circle():
    return fs.attractors(subcritical(), BOX, 400, 3)


@pytest.fixture(scope="module")
def gears():
    return fs.attractors(gear_pair(W=0.78), {"x": (-3, 3), "v": (-2, 2)}, 200, 1)


def test_equilibrium_inside_an_unstable_circle(circle):
    """The basin of the focus is the disc of radius ρ² = (1 − sqrt(1 + 4 r))/2."""
    cycle, focus = circle
    assert isinstance(cycle, fs.Orbit)
    assert isinstance(focus, fs.Equilibrium)
    assert cycle.period == pytest.approx(2 * np.pi, rel=1e-12)
    inside = (circle.starts**2).sum(axis=1) < (1 - np.sqrt(0.6)) / 2
    assert np.array_equal(circle.assigned == 1, inside)
    assert inside.sum() == 7
    assert circle.outcome.code == "settled"
    assert circle.unassigned == 0
    assert circle.fractions.sum() == 1
    assert circle.errors == pytest.approx(np.sqrt(7 * 393 / 400**3) * np.ones(2))


def test_boundary_of_the_basin(circle):
    plane = fs.basins(
        subcritical(), BOX, known=circle, refinement=fs.Refinement(cells=(16, 16), levels=3)
    )
    (line,) = plane.boundary("A1", "A2")
    radius = np.hypot(*line.points.T)
    assert radius == pytest.approx(np.sqrt((1 - np.sqrt(0.6)) / 2), abs=0.75 * 4 / 128)


def test_coexisting_motions_of_the_gear_pair(gears):
    """One motion without loss of contact and one that loses it on one side."""
    assert [len(one.itinerary) for one in gears] == [2, 1]
    assert all(one.stable and one.accuracy < 1e-12 for one in gears)
    for one in gears:
        again = fs.find_orbit(gear_pair(W=0.78), one)
        assert again(0.0) == pytest.approx(one(0.0), abs=1e-12)


def test_assignment_agrees_with_another_integrator(gears):
    """Three initial states by SciPy's DOP853 through 60 periods, one period at a time."""
    z, Fm, Fa, W = 0.05, 0.1, 0.05, 0.78

    def rates(t, y):
        force = np.sign(y[0]) * max(abs(y[0]) - 1, 0.0)
        return [y[1], -2 * z * y[1] - force + Fm + Fa * W**2 * np.sin(W * t)]

    period = 2 * np.pi / W
    for row in range(3):
        state = gears.starts[row]
        for _ in range(60):
            state = solve_ivp(rates, (0, period), state, method="DOP853", rtol=1e-8).y[:, -1]
        distances = [np.abs(one(0.0) - state).max() for one in gears]
        assert int(np.argmin(distances)) == gears.assigned[row]
        assert min(distances) < 1e-3


def test_period_two_motions_are_one_attractor():
    """Duffing's oscillator after the first period doubling in each well."""
    t = sp.Symbol("t")
    duffing = fs.Model({x: v, v: x - x**3 - 0.3 * v + 0.28 * sp.cos(1.2 * t)})
    found = fs.attractors(duffing, {"x": (-1.5, 1.5), "v": (-1, 1)}, 60, 2)
    multiples = found["multiple"]
    assert 2 in multiples
    for one in found:
        # no period is counted twice
        half = one(0.0) - one(one.period / 2)
        assert one.multiple == 1 or np.abs(half).max() > 1e-3
    assert len({tuple(np.round(np.sort(one["x"])[-3:], 6)) for one in found}) == len(found)


def test_stick_slip():
    found = fs.attractors(block_on_belt(), {"x": (-1, 1), "v": (-1, 1)}, 20)
    cycles = [one for one in found if isinstance(one, fs.Orbit)]
    assert len(cycles) == 1
    assert 0 in cycles[0].multipliers


def test_chaos_is_no_attractor_but_is_counted():
    y, z = sp.symbols("y z")
    lorenz = fs.Model({x: 10 * (y - x), y: x * (28 - z) - y, z: x * y - sp.Rational(8, 3) * z})
    found = fs.attractors(lorenz, {"x": (-2, 2), "y": (-2, 2), "z": (0, 20)}, 4)
    assert len(found) == 0
    assert found.unassigned == 1
    assert found.outcome.code == "not settled"
    assert not found.outcome
    assert "none of these: 100.0%" in repr(found)


def test_escape_is_counted():
    found = fs.attractors(fs.Model({x: x**3 - x}), {"x": (-2, 2)}, 100)
    (rest,) = found
    assert rest["x"] == 0
    assert np.array_equal(found.assigned == 0, np.abs(found.starts[:, 0]) < 1)


def test_fixed_states_and_default_attractors():
    plane = fs.basins(
        subcritical(),
        {"x": (-1, 1), "v": (-1, 1)},
        refinement=fs.Refinement(cells=(4, 4), levels=0),
    )
    assert plane.at(x=0.0, v=0.0) == "A2"
    found = fs.attractors(subcritical(), {"x": (-1, 1), "v": (0, 0)}, 20)
    assert (found.starts[:, 1] == 0).all()


def test_the_same_seed_gives_the_same_numbers(circle):
    again = fs.attractors(subcritical(), BOX, 400, 3, execution=fs.Execution(threads=1))
    assert np.array_equal(again.ends, circle.ends)
    assert np.array_equal(again.assigned, circle.assigned)


def test_files(circle, tmp_path):
    circle.save(tmp_path / "found.npz")
    loaded = fs.load(tmp_path / "found.npz")
    assert np.array_equal(loaded.assigned, circle.assigned)
    assert loaded["A1"](0.3) == pytest.approx(circle["A1"](0.3), rel=1e-15)
    assert repr(loaded) == repr(circle)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda m: fs.attractors(m, {"x": (0, 1)}), fs.ArgumentError, "no range of the initial"),
        (
            lambda m: fs.attractors(m, {**BOX, "u": (0, 1)}),
            fs.UnknownNameError,
            "unknown state 'u'",
        ),
        (lambda m: fs.attractors(m, BOX, 0), fs.ArgumentError, "n = 0; expected"),
        (lambda m: fs.attractors(m, {**BOX, "v": (1, 0)}), fs.ArgumentError, "did you mean"),
        (lambda m: fs.basins(m, {"x": (0, 1), "u": (0, 1)}), fs.UnknownNameError, "unknown state"),
        (lambda m: fs.basins(m, {"x": (0, 1)}), fs.ArgumentError, "state="),
    ],
)
def test_bad_input(call, error, message):
    with pytest.raises(error, match=message):
        call(subcritical())


def test_attractors_of_another_model(gears):
    with pytest.raises(fs.ArgumentError, match="attractors of x, v"):
        fs.basins(fs.Model({x: -x}), {"x": (0, 1)}, known=gears)


def test_a_state_that_vanishes_at_every_strobe():
    """x = −cos t attracts all states of x'' + x' + x = sin t; v is 0 whenever t is 2πk."""
    t = sp.Symbol("t")
    found = fs.attractors(fs.Model({x: v, v: sp.sin(t) - x - v}), BOX, 20)
    assert len(found) == 1
    assert found[0](0.0) == pytest.approx([-1, 0], abs=1e-12)


@pytest.mark.sample(2)
@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_units_of_states_and_time(size, rate):
    """Two wells at x = ±size, in units over twelve decades."""
    wells = fs.Model({x: rate * v, v: rate * (x - x**3 / size**2 - v / 2)})
    found = fs.attractors(wells, {"x": (-2 * size, 2 * size), "v": (-size, size)}, 40, 1)
    assert sorted(one["x"] / size for one in found) == pytest.approx([-1, 1], rel=1e-12)
    assert found.fractions == pytest.approx([0.5, 0.5])


@pytest.mark.sample(1)
@pytest.mark.parametrize("rate", [1e-6, 1e6])
def test_relaxation_oscillations_in_other_units_of_time(rate):
    fast = fs.Model({x: rate * v, v: rate * (10 * (1 - x**2) * v - x)})
    (cycle,) = fs.attractors(fast, {"x": (-1, 1), "v": (-1, 1)}, 20)
    # by SciPy's DOP853 at rtol = 1e-13
    assert cycle.period * rate == pytest.approx(19.07836956694, rel=1e-11)


def test_orbits_of_a_family_are_not_attractors():
    found = fs.attractors(fs.Model({x: v, v: -x}), BOX, 20)
    assert len(found) == 0
    assert "neutral orbit" in found.outcome.message
