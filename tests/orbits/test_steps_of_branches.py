"""Rows of a branch follow each other: no row is on another branch."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.campaigns import cycles

pytestmark = pytest.mark.slow


def largest_step(branch):
    """Largest change from a row to the next one, of period, parameter and ranges of the states."""
    ranges = [branch[f"max({s}) - min({s})"] for s in branch.states]
    columns = np.array([branch.period, branch.values, *ranges])
    sizes = [branch.period.max(), np.ptp(branch.values), *(column.max() for column in ranges)]
    return float((np.abs(np.diff(columns)) / np.array(sizes)[:, None]).max())


@pytest.fixture(scope="module")
def valve():
    """Relief valve with impacts on its seat, after Licskó, Champneys & Hős (2009)."""
    x, v, p, q, k, r = sp.symbols("x v p q k r")
    rates = {x: v, v: -k * v - (x + 10) + p, p: 20 * (q - x * sp.sqrt(p))}
    return fs.Model(rates, parameters={q: 8, k: 1.25, r: 0.8}, resets={x <= 0: {v: -r * v}})


@pytest.mark.sample(1)
@pytest.mark.parametrize("q", [7.6, *np.random.default_rng(5).uniform(7.57, 8.4, 1)])
def test_valve(valve, q):
    """Through the grazing at q = 7.557, from cycles on either side of it to both ends."""
    model = valve.with_parameters(q=q)
    orbit = fs.find_orbit(model, fs.simulate(model, [0.5, 0, 12], t=(0, 200)))
    branch = fs.continue_orbits(orbit, "q", over=(0.2, 10))
    assert [o.code for o in branch.outcomes] == ["end of range", "Hopf point"]
    assert [point.code for point in branch.special] == ["PD", "PD", "GR"]
    assert branch["GR1"]["q"] == pytest.approx(7.557210972, abs=1e-8)
    assert largest_step(branch) < 0.06


@pytest.mark.sample(0)
def test_doubled_cycles_of_the_valve_end_where_they_repeat(valve):
    """Where an orbit of twice the period has one touch and one impact of speed zero, it repeats."""
    model = valve.with_parameters(q=5.9)
    orbit = fs.find_orbit(model, fs.simulate(model, [0.5, 0, 12], t=(0, 400)))
    doubled = fs.continue_orbits(orbit, "q", over=(0.2, 10))
    codes = [point.code for point in doubled.special]
    assert codes == ["PD", "GR", "PD", "GR"]
    assert [float(point["q"]) for point in doubled.special] == pytest.approx(
        [6.06651454, 5.701767358, 6.917097125, 7.557210972], abs=1e-8
    )
    fourfold = fs.continue_orbits(fs.find_orbit(model, doubled["PD2"]), "q", over=(0.2, 10))
    other = fs.continue_orbits(fourfold.at(q=7.2)[0], "q", over=(0.2, 10))
    for branch in (fourfold, other):
        found = sorted((float(point["q"]), point.code) for point in branch.special)
        assert [code for _, code in found] == ["GR", "PD", "GR"]
        assert found[0][0] == pytest.approx(6.899869624, abs=1e-8)
        # the orbit of the shorter period touches there too
        assert found[2][0] == pytest.approx(7.557210972, abs=1e-8)
    for branch in (doubled, fourfold, other):
        assert "repeats after a fraction" in str(branch.outcome)
        assert branch.values.max() == pytest.approx(7.557210972, abs=1e-8)


def test_sample_of_the_campaign_of_cycles():
    """One system of each kind, a Liénard oscillator, a belt that sticks, and a relay."""
    report = cycles.campaign(3, 2, rows=1)
    assert not report.failures
    assert report.rows >= 3
    assert report.worst < 1e-8
