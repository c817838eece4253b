"""Equilibria at the two-folds of interfaces that are crossed at equal normal speeds."""

import numpy as np
import pytest
import sympy as sp
from matplotlib import pyplot
from scipy.integrate import solve_ivp

import fastslow as fs

x, y, z, c, p = sp.symbols("x y z c p")
S, infected = sp.symbols("S I")

#: Contact rate, recovery, births and deaths, and the prevalence from which on people vaccinate.
BETA, GAMMA, MU, LEVEL = 2.5, 1.0, 0.1, 0.03


def epidemic():
    """Return a model in which a part p of the newborn is vaccinated while I > LEVEL."""
    vaccinated = MU * p * sp.Heaviside(infected - LEVEL)
    rates = {S: MU - vaccinated - BETA * S * infected - MU * S}
    rates[infected] = BETA * S * infected - (GAMMA + MU) * infected
    return fs.Model(rates, parameters={p: 0.5})


def turn(distance):
    """Return the distance from the equilibrium after one turn, and its duration, by SciPy."""
    place = (GAMMA + MU) / BETA
    state, total = np.array([place + distance, LEVEL]), 0.0
    for part in (0.5, 0.0):

        def rates(_, u, part=part):
            s, i = u
            return [MU * (1 - part) - BETA * s * i - MU * s, BETA * s * i - (GAMMA + MU) * i]

        def level(_, u):
            return u[1] - LEVEL

        level.terminal = True
        # away from the interface first
        start = solve_ivp(rates, (0, 1e-3 * distance), state, rtol=1e-13, atol=1e-16).y[:, -1]
        run = solve_ivp(rates, (0, 10), start, events=level, rtol=1e-12, atol=1e-15)
        state, total = run.y[:, -1], total + run.t[-1] + 1e-3 * distance
    return state[0] - place, total


def test_a_vaccination_threshold_is_an_equilibrium_of_the_diagram():
    model = epidemic()
    diagram = fs.continue_equilibria(model, "p", (0, 1))
    (band,) = diagram.bands
    place = (GAMMA + MU) / BETA
    # 0 = (1 - α) f₁ + α f₂ with 0 ≤ α ≤ 1, from the boundary equilibrium on
    assert band.range == pytest.approx((0.23, 1.0), rel=1e-9)
    assert diagram.boundary_equilibria["p"] == pytest.approx([0.23], rel=1e-9)
    assert band.corners[:, 0] == pytest.approx(np.tile([place, LEVEL], (len(band.values), 1)))
    assert band.is_stable
    assert band.name == "S1|S2 (two-fold)"
    found = fs.equilibria(model)
    one = found.select("I > 0")[0]
    assert (one.stability, one.type, one.pseudo) == ("stable", "fused focus", True)
    assert "in S1|S2 (two-fold); stable fused focus" in repr(one)
    # the rate of decay, from the return map
    distance = 1e-4
    after, duration = turn(distance)
    rate = np.log(after / distance) / duration
    assert one.eigenvalues.real == pytest.approx([rate, 2 * rate], rel=5e-3)


def test_a_relay_oscillator_decays_at_a_third_of_its_friction():
    # energy |x| + v²/2 decays by c v², whose mean over a parabola is a third of the largest
    model = fs.Model({x: y, y: -sp.sign(x) - c * y}, parameters={c: 0.3})
    (one,) = fs.equilibria(model)
    assert one.state.tolist() == [0, 0]
    assert one.eigenvalues.real == pytest.approx([-0.1, -0.2], rel=1e-14)
    assert fs.equilibria(model, c=-0.3)[0].stability == "unstable"
    # a family of closed orbits
    (centre,) = fs.equilibria(model, c=0)
    assert (centre.stability, centre.type) == ("undecided", "undecided")


def test_curved_interfaces_and_other_units_do_not_change_the_rate():
    # x = X + Y²/2 in the relay oscillator
    rates = {x: y - y * (-sp.sign(x - y**2 / 2) - c * y), y: -sp.sign(x - y**2 / 2) - c * y}
    rates[x] = y + y * rates[y]
    (one,) = fs.equilibria(fs.Model(rates, parameters={c: 0.3}))
    assert one.eigenvalues.real == pytest.approx([-0.1, -0.2], rel=1e-12)
    scaled = {x: 1e6 * y, y: -1e-9 * sp.sign(x) - c * y}
    (one,) = fs.equilibria(fs.Model(scaled, parameters={c: 0.3}))
    assert one.eigenvalues.real == pytest.approx([-0.1, -0.2], rel=1e-12)


def test_motions_that_pass_a_two_fold_and_three_states():
    (saddle,) = fs.equilibria(fs.Model({x: y, y: sp.sign(x) - c * y}, parameters={c: 0.3}))
    assert (saddle.stability, saddle.type) == ("unstable", "pseudo-saddle")
    three = fs.Model({x: y, y: -sp.sign(x) - c * y + z, z: -z}, parameters={c: 0.3})
    (one,) = fs.equilibria(three)
    assert (one.stability, one.state.tolist()) == ("undecided", [0, 0, 0])
    # a force that exceeds both sides leaves none
    assert not fs.equilibria(fs.Model({x: y, y: 2 - sp.sign(x) - y}))


def test_the_contact_of_a_damper_is_no_equilibrium():
    # the damping jumps at x = 1, where it is zero at rest
    model = fs.Model({x: y, y: p - x - (2 + sp.sign(x - 1)) * y}, parameters={p: 0.5})
    found = fs.equilibria(model)
    assert (found.completeness, len(found), found.sets) == ("complete", 1, ())


def test_equilibria_at_two_folds_are_drawn_and_saved(tmp_path):
    diagram = fs.continue_equilibria(epidemic(), "p", (0, 1))
    drawn = fs.plot.diagram(diagram, y="I")
    labels = [line.get_label() for line in drawn.figure.axes[0].lines]
    assert "equilibrium set (two-fold)" in labels
    pyplot.close(drawn.figure)
    diagram.save(tmp_path / "one.npz")
    assert fs.load(tmp_path / "one.npz") == diagram
