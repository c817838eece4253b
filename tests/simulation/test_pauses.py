"""Compiled loops that pause go on as if they had not, to the last bit."""

import signal

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation import loops
from fastslow.simulation import pauses, run_tables
from fastslow.simulation.run_tables import RunMemory

pytestmark = pytest.mark.slow

x, v, y, w, t = sp.symbols("x v y w t")


def twisting():
    """Crossings that accumulate, from where both interfaces are slid along."""
    return fs.Model({x: v, v: -2 * sp.sign(x) - sp.sign(v)}), [1, 0], (0, 5)


def sticking():
    """Dry friction: phases of slip and of stick."""
    force = sp.Rational(3, 2) * sp.sin(t)
    return fs.Model({x: v, v: w - x - sp.sign(v)}, forcing={w: force}), [1, 0], (0, 30)


def stiff():
    """Implicit steps, then steps of Radau."""
    return fs.Model({x: -(10**7) * (x - y), y: -y}), [1, 2], (0, 40)


def special():
    """No Taylor series: steps by collocation."""
    return fs.Model({x: v, v: (1 - x**2) * v - x * sp.gamma(1 + x**2 / 4)}), [1, 0], (0, 10)


def gear():
    return fs.systems.harmonic_gear(), [0, 0], (0, 1500)


def chattering():
    """Impacts that accumulate, rest on a moving table, and a load given by a table."""
    height = sp.sin(2 * t) / 3
    speed = height.diff(t)
    resets = {x <= height: {v: speed - (v - speed) / 2}}
    load = fs.Tabulated([0, 5, 9, 20], [-1, -2, -1, -1])
    return fs.Model({x: v, v: w}, forcing={w: load}, resets=resets), [1, 0], (0, 20)


def dosed():
    """Events with a delay, of which several wait, that change a parameter and a state."""
    late = fs.Event(x > 0, {"k": -sp.Symbol("k"), x: x / 2}, delay=3)
    model = fs.Model({x: v, v: sp.Symbol("k") - x}, parameters={"k": 1}, events={"late": late})
    return model, [0, 1], (0, 40)


MODELS = (twisting, sticking, stiff, special, gear, chattering, dosed)


@pytest.fixture
def pausing(monkeypatch):
    """Pauses after every step, with nothing compiled late that is not asked for."""

    def start():
        monkeypatch.setattr(pauses, "FIRST_SLICE_WORK", 0.0)
        monkeypatch.setattr(pauses, "SLICE", 0.0)
        monkeypatch.setattr(pauses, "_addresses", {})
        monkeypatch.setattr(loops, "WORK", 0)

    return start


@pytest.mark.sample(3)
@pytest.mark.parametrize("system", MODELS, ids=lambda f: f.__name__)
def test_a_run_that_pauses_after_every_step_is_the_same(system, pausing, monkeypatch):
    model, start, span = system()
    one = fs.simulate(model, start, t=span, samples=50)
    pausing()
    # tables that are soon full
    monkeypatch.setattr("fastslow.simulation.run_tables._LEAST", 1)
    monkeypatch.setattr("fastslow.simulation.prepared_runs._memory", RunMemory())
    other = fs.simulate(model, start, t=span, samples=50)
    assert one.outcome == other.outcome
    assert one.method == other.method
    events = ("reset_table", "switch_table", "event_table")
    for name in ("end", "steps", "crossing_table", "series", *events):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.sampled[1], other.sampled[1])


def test_what_the_models_are_for():
    runs = {f: fs.simulate(f()[0], f()[1], t=f()[2]) for f in MODELS}
    assert len(runs[twisting].crossing_table) > 100
    assert not runs[twisting].outcome
    assert "|" in "".join(runs[sticking].modes[int(k)] for k in runs[sticking].steps[:, 2])
    assert "Radau" in runs[stiff].method
    assert "implicit" in runs[stiff].method
    assert "collocation" in runs[special].method
    assert len(runs[gear].crossing_table) > 4


@pytest.mark.sample(1)
@pytest.mark.parametrize("system", [twisting, special, gear], ids=lambda f: f.__name__)
def test_many_runs_that_pause_are_the_same(system, pausing):
    model, start, span = system()
    starts = np.array(start) + 0.01 * np.arange(20)[:, None]
    given = {"t": (span[0], 0.2 * span[1]), "samples": 7}
    one = fs.simulate_many(model, starts, execution=fs.Execution(threads=1), **given)
    pausing()
    for threads in (1, 2):
        other = fs.simulate_many(model, starts, execution=fs.Execution(threads=threads), **given)
        for name in ("minimum", "maximum", "final", "reached", "hits", "n_steps"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        np.testing.assert_array_equal(one.sampled[1], other.sampled[1])


def test_runs_of_many_steps_in_lanes_are_the_same(pausing, monkeypatch):
    """More steps than lanes are allowed at a time, and fewer than the run has."""
    model = fs.Model({x: v, v: -x})
    given = {"t": (0, 4000), "execution": fs.Execution(threads=1)}
    for most in (900, 1500, 10**6):
        integration = fs.Integration(max_steps=most)
        many = fs.simulate_many(model, [[1, 0], [2, 1]], integration=integration, **given)
        assert (many.n_steps <= most).all()
        with monkeypatch.context():
            pausing()
            other = fs.simulate_many(model, [[1, 0], [2, 1]], integration=integration, **given)
        np.testing.assert_array_equal(many.final, other.final)
        np.testing.assert_array_equal(many.n_steps, other.n_steps)


def test_a_diagram_that_pauses_after_every_step_is_the_same(pausing):
    rates = {x: w + x - x**3 / 3 - y, y: (x + sp.Rational(7, 10) - y) / 10}

    def traced():
        return fs.continue_equilibria(fs.Model(rates, parameters={w: 0}), "w", over=(-2, 2))

    one = traced()
    pausing()
    other = traced()
    assert repr(one) == repr(other)
    for branch, same in zip(one, other, strict=True):
        np.testing.assert_array_equal(branch.state, same.state)
        np.testing.assert_array_equal(branch.eigenvalues, same.eigenvalues)


def test_code_that_cannot_be_compiled_is_an_error(monkeypatch):
    def failing(*_):
        raise OSError("no space left on device")

    model, start, span = special()
    expected = fs.simulate(model, start, t=span)
    with monkeypatch.context() as patched:
        patched.setattr(pauses, "_addresses", {})
        patched.setattr(pauses, "load_address", failing)
        with pytest.raises(OSError, match="no space left"):
            fs.simulate(model, start, t=span)
        with pytest.raises(OSError, match="no space left"):
            fs.simulate_many(model, [start] * 8, t=span, execution=fs.Execution(threads=2))
    np.testing.assert_array_equal(fs.simulate(model, start, t=span).series, expected.series)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs POSIX signals")
def test_the_handler_of_a_signal_may_simulate():
    """The run that it interrupts has its memory for itself."""
    model, start, _ = gear()
    expected = fs.simulate(model, start, t=(0, 3000))
    seen = []

    def handler(number, frame):
        seen.append(fs.simulate(model, start, t=(0, 300)).end)

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 1e-3, 1e-2)
        runs = [fs.simulate(model, start, t=(0, 3000)) for _ in range(10)]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert seen
    for run in runs:
        np.testing.assert_array_equal(run.series, expected.series)
        np.testing.assert_array_equal(run.steps, expected.steps)


def test_a_run_whose_series_would_be_too_large_ends_with_an_outcome(monkeypatch):
    model = fs.Model({x: v, v: -x})
    monkeypatch.setattr(run_tables, "MOST_BYTES", 2**20)
    run = fs.simulate(model, [1.0, 0.0], t=(0, 1e5))
    assert run.outcome.code == "out of memory"
    assert not run.outcome.success
    assert run.series.nbytes <= 2**20
    assert run.series.nbytes > 2**19
    # what is stored is the solution, and another run continues it
    assert run.end[1] == pytest.approx(np.cos(run.end[0]), abs=1e-8)
    assert fs.simulate(model, run.final_state, t=(run.end[0], run.end[0] + 1)).outcome.success
    alone = fs.simulate(model, [1.0, 0.0], t=(0, 20000), dense=False, samples=3)
    assert alone.outcome.success
