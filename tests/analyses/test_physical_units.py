"""Sensitivities, energies of impacts and the rigid limit against independent computations."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fastslow as fs
from analyses import impact_energies, rigid_limit, sensitivities
from fastslow.systems.gears import gear_scales

pytestmark = pytest.mark.slow


def measured(**values):
    """Time in the gap, s, and transmission error, rad, of the dimensionless gear."""
    given = {**sensitivities.VALUES, **values}
    names = ("J_i", "J_o", "N", "xi", "K_HD", "k2")
    scales = gear_scales(**{name: given[name] for name in names})
    model = fs.systems.harmonic_gear_from_physical(**given)
    settings = fs.Integration(rtol=1e-12)
    run = fs.simulate(model, [0, 0], periods=2, integration=settings)
    since = 0.5 * run.span[1]
    met = [c for c in run.crossings if c.time > since]
    k = next(k for k, c in enumerate(met) if (c.to_region, met[k + 1].to_region) == ("S2", "S3"))
    low, high = run.extremes("x", since=since)
    return (met[k + 1].time - met[k].time) * scales.time, (high - low) * scales.angle


def test_relative_derivatives_against_differences_of_another_model():
    step = 1e-4
    for name in ("J_o", "xi", "K_HD", "k1", "phi", "T_am", "omega"):
        value = sensitivities.VALUES[name]
        ends = [np.log(measured(**{name: value * np.exp(s * step)})) for s in (-1, 1)]
        slopes = (ends[1] - ends[0]) / (2 * step)
        found = [
            sensitivities.relative()[q][name] for q in ("time in the gap", "transmission error")
        ]
        assert found == pytest.approx(slopes, abs=2e-6), name


def test_sums_fixed_by_the_units():
    assert sensitivities.imbalance() < 1e-8
    for slopes in sensitivities.relative().values():
        # they act by N² J_i and by ξ √K_HD only
        assert slopes["N"] == pytest.approx(2 * slopes["J_i"], abs=1e-8)
        assert slopes["xi"] == pytest.approx(2 * slopes["K_HD"], abs=1e-8)


def test_the_widest_gap_is_nearly_that_of_slow_theory():
    gap = sensitivities.relative()["widest gap"]
    B, C = 10.0, 15.0 * gear_scales().inertia / 2.4e-2
    root, arc = math.sqrt(C * C - B * B), math.acos(B / C)
    # d/dB of √(C² − B²) − B arccos(B/C) is −arccos(B/C), d/dC is √(C² − B²)/C
    whole = root - B * arc
    assert gap["T_m"] == pytest.approx(-B * arc / whole, rel=1e-3)
    assert gap["T_am"] == pytest.approx(root / whole, rel=1e-3)
    assert gap["omega"] == pytest.approx(-1, rel=1e-3)
    assert gap["xi"] == pytest.approx(-1, rel=1e-3)


def test_the_energy_of_an_impact_by_scipy():
    model = fs.systems.harmonic_gear_twist(omega=1.0)
    p = model.parameters
    found = impact_energies.period(15.0)
    swing = p["T_am"] * p["J_eq"] / p["J_o"]

    def rates(t, z):
        torque = (p["k1"] + p["k2"] * z[0] ** 2) * np.sign(z[0]) * max(abs(z[0]) - p["phi"], 0.0)
        return [z[1], (p["T_m"] + swing * np.sin(t) - p["C_eq"] * z[1] - torque) / p["J_eq"]]

    def lower(t, z):
        return z[0] + p["phi"]

    lower.terminal = True
    run = solve_ivp(
        rates, (2.0, 6.0), [0.0253, 0.0], method="DOP853", rtol=1e-11, atol=1e-13, max_step=2e-3,
        events=lower,
    )  # fmt: skip
    first = found.contacts[0]
    assert not first.upper
    assert run.t[-1] == pytest.approx(first.time, abs=1e-6)
    assert 0.5 * p["J_eq"] * run.y[1, -1] ** 2 == pytest.approx(first.energy, rel=1e-6)


def test_work_and_dissipation_of_a_period_are_equal():
    for T_am in (impact_energies.FIRST, *impact_energies.HEAVY):
        found = impact_energies.period(T_am)
        assert found.work == pytest.approx(found.dissipated, rel=1e-6)
        assert found.largest < found.work


def test_the_delay_of_a_rebound_in_the_rigid_limit():
    # x'' + x' = B + C sin(ω t) off the flank, from the impact on, and from π/√A later on
    elastic, rigid = rigid_limit.pairs()[-1]
    p = fs.systems.harmonic_gear_from_physical().parameters
    rebound = rigid.speed * math.exp(-math.pi / (2 * math.sqrt(rigid.A)))
    wait = math.pi / math.sqrt(rigid.A)

    def rates(t, z):
        return [z[1], p["B"] + p["C"] * np.sin(rigid_limit.OMEGA * t) - z[1]]

    def flank(t, z):
        return z[0] if t > start + 0.1 else 1.0

    flank.terminal = True
    ends = []
    for start in (rigid.first, rigid.first + wait):
        run = solve_ivp(
            rates, (start, start + 5), [0.0, rebound], method="DOP853", rtol=1e-12, atol=1e-14,
            events=flank, max_step=0.05,
        )  # fmt: skip
        ends.append(run.t[-1])
    assert ends[0] == pytest.approx(rigid.second, abs=1e-8)
    longer = (elastic.second - elastic.first) - (rigid.second - rigid.first)
    assert longer == pytest.approx(ends[1] - ends[0], rel=2e-3)
