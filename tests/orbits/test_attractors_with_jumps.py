"""Attractors and basins of models with resets, kicks and clocks."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, t = sp.symbols("x v t")
c, r, s, om = sp.symbols("c r s omega")


@pytest.fixture(scope="module")
def impacting():
    return fs.Model(
        {x: v, v: sp.cos(om * t) - c * v - x},
        parameters={c: 0.1, r: 0.8, s: 0.5, om: 2.6},
        resets={x >= s: {v: -r * v}},
    )


def test_coexisting_motions_of_an_impact_oscillator(impacting):
    """A motion without impacts, known in closed form, and one with impacts."""
    found = fs.attractors(impacting, {x: (-2, 0.5), v: (-2, 2)}, 30)
    assert found.outcome.code == "settled"
    assert len(found) == 2
    free = next(a for a in found if not len(a.trajectory.resets))
    hitting = next(a for a in found if a is not free)
    amplitude = 1 / np.hypot(1 - 2.6**2, 0.1 * 2.6)
    assert free.trajectory.extremes("x")[1] == pytest.approx(amplitude, rel=1e-9)
    assert (hitting.multiple, len(hitting.trajectory.resets)) == (2, 1)
    # each initial state stays with the motion to which it was assigned
    period = 2 * np.pi / 2.6
    for index in range(0, 30, 6):
        run = fs.simulate(impacting, found.starts[index], t=(0, 300 * period), dense=False)
        attractor = found[int(found.assigned[index])]
        states = attractor(np.arange(attractor.multiple) * period)
        assert np.abs(states.T - run.end[1:]).max(axis=1).min() < 1e-7


def test_kicks_and_basins():
    """x' = x − x³ + kicks by −x/10: two orbits, mirrored, whose basins meet at 0."""
    model = fs.Model(
        {x: x - x**3, v: -v}, resets={sp.Eq(sp.Mod(t, 2), 0): {x: sp.Rational(9, 10) * x}}
    )
    found = fs.attractors(model, {x: (-2, 2), v: (-1, 1)}, 20)
    assert found.outcome.code == "settled"
    assert [a.multiple for a in found] == [1, 1]
    # x² = 1 / (1 + k exp(−2 t)), multiplied by 0.81 at 2
    decay = np.exp(-4)
    square = (0.81 - decay) / (1 - decay)
    assert sorted(a(0.0)[0] for a in found) == pytest.approx([-np.sqrt(square), np.sqrt(square)])
    assert (
        np.sign(found.starts[:, 0]) == [np.sign(found[k](0.0)[0]) for k in found.assigned]
    ).all()
    basin = fs.basins(
        model,
        {x: (-2, 2), v: (-1, 1)},
        known=found,
        refinement=fs.Refinement(cells=(5, 3), levels=1),
    )
    assert basin.shares["A1"] == pytest.approx(basin.shares["A2"], abs=1e-12)
    assert {basin.at(x=value, v=0.2) for value in (1, -1)} == {"A1", "A2"}


def test_a_clock():
    """x' = −x + p(t), p = 1 in the second half of every period: one orbit, of every state."""
    switched = sp.Piecewise((1, sp.Mod(t, 2) > 1), (0, True))
    found = fs.attractors(fs.Model({x: -x + switched}), {x: (-3, 3)}, 10)
    assert found.outcome.code == "settled"
    (orbit,) = found
    assert orbit(0.0) == pytest.approx([(1 - np.exp(-1)) / (1 - np.exp(-2))], abs=1e-10)


def test_starts_beyond_a_wall_reach_no_attractor(impacting):
    found = fs.attractors(impacting, {x: (0.4, 0.8), v: (0, 0)}, 8)
    beyond = found.starts[:, 0] > 0.5
    assert beyond.any()
    assert (found.assigned[beyond] == -1).all()
    assert (found.assigned[~beyond] >= 0).all()
    assert found.outcome.code == "not settled"


def test_switches():
    """A relay that holds both of its states, and one that oscillates."""
    q = sp.Symbol("q")
    held = fs.Model({x: -x + 2 * q - 1 + sp.cos(t) / 5, v: -v}, switches={q: (x > 0.5, x < -0.5)})
    found = fs.attractors(held, {x: (-2, 2), v: (-1, 1)}, 20)
    assert found.outcome.code == "settled"
    assert sorted(a(0.0)[0] for a in found) == pytest.approx([-0.9, 1.1], abs=1e-10)
    basin = fs.basins(
        held,
        {x: (-2, 2), v: (-1, 1)},
        known=found,
        state={"x": 0, "v": 0, "q": 1},
        refinement=fs.Refinement(cells=(4, 2), levels=0),
    )
    upper = found.labels[int(found[1](0.0)[0] > 0)]
    assert basin.at(x=0, v=0) == basin.at(x=2, v=0) == upper != basin.at(x=-2, v=0)
    thermostat = fs.Model({x: -x + 2 * (1 - q)}, switches={q: (x > 1.5, x < 0.5)})
    (orbit,) = fs.attractors(thermostat, {x: (-1, 3)}, 10)
    assert orbit.period == pytest.approx(2 * np.log(3), abs=1e-12)


def test_orbits_of_runs_that_end_at_events():
    """Each flight is one step: runs of a number of steps end at a reset or a change of a switch."""
    q = sp.Symbol("q")
    thermostat = fs.Model({x: -x + 2 * (1 - q)}, switches={q: (x > 1.5, x < 0.5)})
    fire = fs.Model({v: 1.3 - v}, resets={v >= 1: {v: 0}})
    for start in (1.6, 3.0, -1.0):
        assert fs.find_orbit(thermostat, {"x": start}).period == pytest.approx(2 * np.log(3))
    for start in (0.2, -3.0):
        assert fs.find_orbit(fire, [start]).period == pytest.approx(np.log(13 / 3))
