"""Dense output by itself, as the result of an orbit holds it: one period, called at any time."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, t = sp.symbols("x v t")


@pytest.fixture(scope="module")
def period():
    """One period of x = cos t."""
    fine = fs.Integration(rtol=1e-13)
    return fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 2 * np.pi), integration=fine).dense


def test_times_are_taken_modulo_the_period(period):
    times = np.array([-7.0, -1e-20, 0.0, 1.0, 2 * np.pi, 20.0])
    assert period(period.modulo(times, 2 * np.pi))[0] == pytest.approx(np.cos(times), abs=1e-12)
    assert period.modulo(1.0, 2 * np.pi) == 1.0


def test_roots_of_an_expression(period):
    roots = period.roots("x**2 - v", 0.5)
    times = period.steps[roots.step, 0] + roots.part * period.steps[roots.step, 1]
    # cos² t + sin t = 1/2
    first = 2 * np.pi + np.arcsin((1 - np.sqrt(3)) / 2)
    assert times == pytest.approx([3 * np.pi - first, first], abs=1e-12)
    assert roots.direction.tolist() == [-1, 1]


def test_extremes_and_mean(period):
    assert period.extremes("x", (1.0, 4.0)) == pytest.approx((-1.0, np.cos(1.0)), abs=1e-12)
    assert period.mean("v", 0.0) == pytest.approx(0.0, abs=1e-12)


def test_the_run_has_the_same_values(period):
    assert period.columns_at([0.5]).shape == (2, 1)
    assert period.nodes[0].tolist() == [1.0, 0.0]
    assert period.nodes[-1] == pytest.approx([1.0, 0.0], abs=1e-12)


def test_a_run_of_another_process_has_the_same_bits():
    """It is evaluated by NumPy, and one that was computed here by compiled loops."""
    ball = fs.Model({x: v, v: sp.sin(3 * t) - 1}, resets={x <= 0: {v: -0.8 * v}})
    run = fs.simulate(ball, [1, 0], t=(0, 8))
    here, stored = run.dense, replace(run.dense, compiled=False)
    assert here.compiled
    assert not pickle.loads(pickle.dumps(run)).dense.compiled
    assert len(here.jump_times) == len(run.resets) == 3
    for one, other in zip(here.refined, stored.refined, strict=True):
        assert one.tobytes() == other.tobytes()
    few, many = np.array([7.0, 2.5, 2.5]), np.linspace(0.0, 8.0, 999)
    for times in (few, many, run.resets[1].time):
        assert here(times).tobytes() == stored(times).tobytes()
