"""Impacts beside models that contain them: stiff stops, and a chain that reduces to one mass."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow import systems

x, v, y, u, t, A, F = sp.symbols("x v y u t A F")
FINE = fs.Integration(rtol=1e-13)
STIFFNESSES = np.array([1e4, 1e5, 1e6])


def order_of(errors):
    """Exponents of 1/A between successive stiffnesses."""
    return np.log(errors[:-1] / errors[1:]) / np.log(STIFFNESSES[1:] / STIFFNESSES[:-1])


def test_stiff_contact_in_the_rigid_limit():
    """It lasts π/√A, and its restitution is exp(−π/(2√A)) + O(1/A) under a constant load."""
    stop = fs.Model({x: v, v: F - v - A * sp.Max(x, 0)}, parameters={A: 1, F: 0.5})
    losses, lengths = [], []
    for stiffness in STIFFNESSES:
        contact = fs.simulate(
            stop.with_parameters(A=stiffness),
            [0.0, 1.0],
            t=(0, 4 / np.sqrt(stiffness)),
            integration=FINE,
        )
        (leaving,) = contact.crossings
        losses.append(abs(-leaving.state[1] - np.exp(-np.pi / (2 * np.sqrt(stiffness)))))
        lengths.append(leaving.time * np.sqrt(stiffness) / np.pi - 1)
    assert order_of(np.array(losses)) == pytest.approx([1, 1], abs=0.02)
    assert order_of(np.abs(lengths)) == pytest.approx([0.5, 0.5], abs=0.02)


def test_orbits_of_a_stiff_gear_approach_those_with_rigid_teeth():
    """Each contact lasts π/√A, so that the periodic motions differ by O(A^(−1/2))."""
    load = {"B": 0.3, "C": 1.5, "D": 0.25, "omega": 2.0}
    differences = []
    for stiffness in STIFFNESSES:
        rigid = systems.rigid_gear(**load, r=float(np.exp(-np.pi / (2 * np.sqrt(stiffness)))))
        stiff = systems.harmonic_gear(**load, A=stiffness)
        runs = [fs.simulate(m, [0.0, 0.0], periods=40, integration=FINE) for m in (rigid, stiff)]
        assert len(runs[0].resets) > 40
        assert [run.periodicity().multiple for run in runs] == [1, 1]
        differences.append(np.abs(runs[1].end[1:] - runs[0].end[1:]).max())
    assert order_of(np.array(differences)) == pytest.approx([0.5, 0.5], abs=0.05)


def test_a_symmetric_chain_is_one_mass():
    """Two masses that mirror each other meet in the middle, as one mass meets a wall there.

    The outer walls move, and both masses meet them at the same instant.
    """
    wall = sp.Rational(7, 10) + sp.sin(2 * t) / 10
    push = wall.diff(t)
    half, load = sp.Rational(1, 2), sp.cos(sp.Rational(13, 10) * t)
    one = fs.Model(
        {x: v, v: load - v / 10 - 2 * x},
        resets={x >= 0: {v: -v / 2}, x <= -wall: {v: -push - half * (v + push)}},
    )
    two = fs.Model(
        {x: v, v: load - v / 10 - x - (x - y) / 2, y: u, u: -load - u / 10 - y - (y - x) / 2},
        resets={
            x >= y: {v: (v + u) / 2 - (v - u) / 4, u: (v + u) / 2 + (v - u) / 4},
            x <= -wall: {v: -push - half * (v + push)},
            y >= wall: {u: push - half * (u - push)},
        },
    )
    single = fs.simulate(one, [-0.5, -2.0], t=(0, 30), integration=FINE)
    double = fs.simulate(two, [-0.5, -2.0, 0.5, 2.0], t=(0, 30), integration=FINE)
    times = np.linspace(0, 30, 400)
    assert double(times)[:2] == pytest.approx(single(times), abs=1e-10)
    assert double(times)[2:] == pytest.approx(-double(times)[:2], abs=1e-12)
    names = [list(one.resets), list(two.resets)]
    for a, b in ((0, 0), (1, 1), (1, 2)):
        both = [
            [e.time for e in run.resets(n[k])]
            for run, n, k in zip((single, double), names, (a, b), strict=True)
        ]
        assert len(both[0]) > 0
        assert both[1] == pytest.approx(both[0], abs=1e-11)


def test_energy_over_thousands_of_impacts():
    model = fs.Model({x: v, v: -x}, resets={x >= sp.Rational(3, 10): {v: -v}})
    settings = fs.Integration(rtol=1e-13, max_crossings=10**5)
    run = fs.simulate(model, [-1.0, 0.5], t=(0, 1e4), integration=settings, dense=False)
    assert len(run.resets) > 2500
    energies = (np.array([e.after for e in run.resets]) ** 2).sum(axis=1)
    assert energies == pytest.approx(1.25, abs=1e-14)
