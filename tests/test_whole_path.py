"""From the equations to the overlay figure, on two models that are not the gear."""

import numpy as np
import pytest
import sympy as sp
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, w, t, mu, omega = sp.symbols("x y w t mu omega")


def drawn(overlay):
    axes = Figure(figsize=(3.3, 2.5)).subplots()
    fs.plot.overlay(overlay, ax=axes)
    return len(axes.lines)


@pytest.fixture(scope="module")
def van_der_pol():
    """x'' − μ(1 − x²)x' + x = w with w slow: no interface, Hopf points at w = ±1."""
    return fs.Model(
        {x: y, y: mu * (1 - x**2) * y - x + w},
        forcing={w: 2 * sp.cos(omega * t)},
        parameters={mu: 1, omega: sp.Rational(1, 50)},
    )


def test_van_der_pol(van_der_pol):
    fast = van_der_pol.frozen()
    derivation = fs.derive(fast)
    (form,) = derivation["S1"].equilibria
    assert form.state["x"] == sp.Symbol("w", real=True)
    assert [e["x"] for e in fs.equilibria(fast, w=0.3)] == pytest.approx([0.3], abs=1e-15)

    diagram = fs.continue_equilibria(fast, "w", over=(-2.5, 2.5))
    hopf = diagram.special("HB")
    assert [p["w"] for p in hopf] == pytest.approx([-1, 1], abs=1e-13)

    run = fs.simulate(van_der_pol, [2, 0], periods=1, integration=fs.Integration(rtol=1e-11))
    assert run.outcome.success
    assert run.crossings == ()
    assert run.period == pytest.approx(100 * np.pi, rel=1e-14)

    def rates(time, s):
        return s[1], (1 - s[0] ** 2) * s[1] - s[0] + 2 * np.cos(time / 50)

    times = np.linspace(0, run.t[-1], 50)
    peer = solve_ivp(rates, (0, times[-1]), [2, 0], "DOP853", times, rtol=1e-12, atol=1e-12)
    # past w = 1 (t = 52) the followed focus is unstable: errors grow until the cycle is reached
    before = times < 60
    np.testing.assert_allclose(run(times[before]), peer.y[:, before], rtol=0, atol=1e-10)

    overlay = fs.overlay(diagram, run)
    assert {s.region for s in overlay.stable_branches} == {"S1"}
    assert len(overlay.stable_branches) == 2
    first = overlay.transitions[0]
    assert first.special.code == "HB"
    assert drawn(overlay) > 2


@pytest.fixture(scope="module")
def beam():
    """x'' + x'/2 + x + 3(x − 1)₊ + 5(x + 1)₋ = w: stiffer beyond x = 1 and x = −1."""
    stop = 3 * sp.Max(x - 1, 0) + 5 * sp.Min(x + 1, 0)
    return fs.Model(
        {x: y, y: w - y / 2 - x - stop},
        forcing={w: 6 * sp.sin(omega * t)},
        parameters={omega: sp.Rational(1, 100)},
    )


def test_piecewise_linear_with_two_interfaces(beam):
    assert set(beam.interfaces) == {"x - 1", "x + 1"}
    assert all(beam.continuous.values())
    fast = beam.frozen()
    derivation = fs.derive(fast)
    load = sp.Symbol("w", real=True)
    assert sp.expand(derivation["S1"].equilibria[0].state["x"] - (load + 3) / 4) == 0
    assert sp.expand(derivation["S3"].equilibria[0].state["x"] - (load - 5) / 6) == 0

    diagram = fs.continue_equilibria(fast, "w", over=(-7, 7))
    corners = diagram.boundary_equilibria
    assert [c["w"] for c in corners] == pytest.approx([-1, 1], abs=1e-14)
    assert {c.type for c in corners} == {"persistence"}
    assert corners[1].clarke.determinants == pytest.approx((4, 1), abs=1e-14)
    for value, state in ((-7, -2.0), (0.5, 0.5), (5, 2.0)):
        assert diagram.at(w=value)[0]["x"] == pytest.approx(state, abs=1e-14)

    run = fs.simulate(beam, [0, 0], periods=2, integration=fs.Integration(rtol=1e-12))
    assert [c.interface for c in run.crossings[:4]] == ["x - 1", "x - 1", "x + 1", "x + 1"]
    assert all(abs(abs(c.state[0]) - 1) < 1e-15 for c in run.crossings)

    def rates(time, s):
        stop = 3 * max(s[0] - 1, 0) + 5 * min(s[0] + 1, 0)
        return s[1], 6 * np.sin(time / 100) - s[1] / 2 - s[0] - stop

    times = np.linspace(0, 900, 60)
    peer = solve_ivp(rates, (0, 900), [0, 0], "DOP853", times, rtol=1e-11, atol=1e-12, max_step=0.2)
    np.testing.assert_allclose(run(times), peer.y, atol=1e-8)

    overlay = fs.overlay(diagram, run)
    assert {overlay.stable_branches[k].region for k in overlay.followed} == {"S1", "S2", "S3"}
    order = ["S2", "S1", "S2", "S3", "S2", "S1", "S2", "S3", "S2"]
    assert [
        overlay.transitions[0].from_branch,
        *(t.to_branch for t in overlay.transitions),
    ] == order
    # on S1, X = (w + 3)/4 solves x'' + x'/2 + 4x = w + 3 with lag −X'/8 + (1/64 − 1/4) X'' + …
    load, slope, bend = 6 * np.sin(1), 0.06 * np.cos(1), -6e-4 * np.sin(1)
    expected = (load + 3) / 4 - slope / 4 / 8 + (1 / 64 - 1 / 4) * bend / 4
    assert run(100.0)[0] == pytest.approx(expected, abs=1e-6)
    assert drawn(overlay) > 2
