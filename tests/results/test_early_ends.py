"""Results read off a run that ended early say so; a slow drift is no period; many times at once."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, w, t = sp.symbols("x v w t")
FORCED = fs.Model({x: v, v: sp.sin(t) - x - v})


@pytest.fixture(scope="module")
def cut():
    """Twenty periods asked for, less than seven integrated."""
    return fs.simulate(FORCED, [-1, 0], periods=20, integration=fs.Integration(max_steps=30))


def test_texts_of_results_say_that_the_run_ended_early(cut):
    assert not cut.outcome
    for result in (cut.periodicity(), cut.section("v"), cut.stroboscopic(), cut.spectrum("x")):
        assert "ended early" in repr(result)
    assert cut.section("v").ended == cut.spectrum("x").ended == "too many steps"


def test_an_overlay_says_that_its_run_ended_early():
    model = fs.systems.cusp(omega=0.002)
    diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.2, 1.2))
    short = fs.Integration(max_steps=20)
    overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1, integration=short))
    assert "the run ended early: stopped at t = " in overlay.summary()
    whole = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=1))
    assert "ended early" not in whole.summary()


def test_figures_say_that_the_run_ended_early(cut):
    figures = (
        fs.plot.time_series(cut, "x"),
        fs.plot.phase_portrait(cut),
        fs.plot.section(cut.section("v"), "t", "x"),
        fs.plot.spectrum(cut.spectrum("x")),
    )
    for drawn in figures:
        texts = [text.get_text() for text in drawn.ax.texts]
        assert texts.count("run ended early: too many steps") == 1
    whole = fs.plot.time_series(fs.simulate(FORCED, [-1, 0], periods=2), "x")
    assert not any("early" in text.get_text() for text in whole.ax.texts)
    plt.close("all")


def test_a_passage_near_a_fold_of_periodic_solutions_is_no_period():
    """The changes of some 1e-7 a period do not shrink: they add up to 1e-4 in 400 periods."""
    pair = fs.systems.gear_pair().with_parameters(Omega=0.7080315)
    fine = fs.Integration(rtol=1e-11)
    run = fs.simulate(pair, [0.70999929, 0.01880563], periods=400, integration=fine)
    steady = run.periodicity()
    assert steady.multiple is None
    assert steady.outcome.code == "drifting"
    assert not steady.outcome
    assert "hardly shrink" in repr(steady)


@pytest.mark.parametrize("damping", [0.02, 0.05, 0.3])
def test_what_is_left_to_the_periodic_solution(damping):
    """A damped linear oscillator approaches its response by exp(−damping t/2).

    The estimate is one of size: the distance turns while it decays.
    """
    model = fs.Model({x: v, v: sp.sin(t) - x - damping * v})
    run = fs.simulate(model, [0, 0], periods=int(5 / damping))
    steady = run.periodicity()
    assert steady.multiple == 1
    exact = np.array([-1 / damping, 0.0])
    apart = np.abs(steady.section.table[:2, -1] - exact).max() * damping / 2
    assert apart / 3 < steady.left < 3 * apart


@pytest.mark.parametrize("order", ["rising", "shuffled", "few"])
def test_many_times_at_once_are_the_same_as_each_alone(gear, order):
    run = fs.simulate(gear, [0, 0], periods=1)
    generator = np.random.default_rng(5)
    times = np.sort(generator.uniform(*run.span, 20 if order == "few" else 3000))
    if order == "shuffled":
        generator.shuffle(times)
    row = np.searchsorted(run.step_starts, times, side="right") - 1
    offset = times - run.steps[row, 0]
    # Horner's scheme, one time and column after the other
    expected = np.empty((len(run.columns), len(times)))
    for k, (step, h) in enumerate(zip(row, offset, strict=True)):
        value = run.series[step, :, -1]
        for power in range(run.series.shape[2] - 2, -1, -1):
            value = value * h + run.series[step, :, power]
        expected[:, k] = value
    found = run.dense.evaluate(row, offset)
    assert np.array_equal(found, expected)
    assert np.array_equal(run(times), expected[: len(run.states)])
