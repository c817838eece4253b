"""Runs backwards in time: against the forward run and SciPy, and where they are not unique."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

x, v, t, w, y = sp.symbols("x v t w y")
FINE = fs.Integration(rtol=1e-13)

GRID = np.arange(0.0, 12.0, 0.7)
GAP = sp.Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))


def loaded(interpolation):
    load = fs.Tabulated(GRID, np.sin(GRID), interpolation=interpolation)
    return fs.Model({x: v, v: w - x - v / 10}, forcing={w: load})


MODELS = {
    "smooth": fs.Model({x: v, v: -sp.sin(x)}),
    "piecewise, forced": fs.Model(
        {x: v, v: w - v / 20 - 3 * GAP}, forcing={w: sp.cos(1.3 * t) + 0.2}
    ),
    "discontinuous": fs.Model({x: v, v: sp.cos(1.3 * t) - 0.6 * sp.sign(x - 0.5) - x}),
    "table": loaded("linear"),
    "table of steps": loaded("previous"),
    "periodic table": fs.Model(
        {x: v, v: w - x - v / 10},
        forcing={w: fs.Tabulated([0.0, 1.0, 3.0], [0.0, 2.0, 0.0], periodic=True)},
    ),
    "clocks": fs.Model(
        {
            x: v,
            v: sp.Piecewise((1, sp.Mod(t, 2) > x), (-1, True)) - x - v / 10 + sp.floor(t / 3) / 10,
        }
    ),
    "invariant planes": fs.Model({x: x * (1 - v), v: v * (x - 1)}),
    "no series": fs.Model({x: v, v: -sp.gamma(2 + x**2) * x + w}, forcing={w: sp.sin(t)}),
}


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", MODELS)
def test_forwards_and_backwards(name):
    model, start = MODELS[name], [0.4, 0.2]
    last = 4.0 if name == "no series" else 10.3
    run = fs.simulate(model, start, t=(0.3, last), integration=FINE)
    back = fs.simulate(model, run.end[1:], t=(last, 0.3), integration=FINE)
    assert back.outcome.code == "end of time"
    assert str(back.outcome) == "reached t = 0.3, the end of the time span."
    assert back.span == run.span
    assert back(0.3) == pytest.approx(start, abs=1e-12)
    times = np.linspace(0.3, last, 50)
    assert back.dense_columns(times) == pytest.approx(run.dense_columns(times), abs=1e-12)
    assert (back.end == run.end).all()
    assert back.itinerary == run.itinerary
    assert [(c.interface, c.direction, c.from_region) for c in back.crossings] == [
        (c.interface, c.direction, c.from_region) for c in run.crossings
    ]
    pairs = zip(back.crossings, run.crossings, strict=True)
    assert max((abs(a.time - b.time) for a, b in pairs), default=0) < 1e-11
    if name in ("clocks", "piecewise, forced", "discontinuous"):
        assert len(run.crossings) > 1
    # consecutive steps share their ends
    steps = back.steps
    assert steps[1:, 0] == pytest.approx(steps[:-1, 0] + steps[:-1, 1], abs=1e-14)


def test_scipy():
    """Van der Pol's oscillator, whose cycle repels backwards."""
    model = fs.Model({x: v, v: (1 - x**2) * v - x})
    run = fs.simulate(model, [1.5, 0], t=(2, -8), integration=fs.Integration(rtol=1e-11))

    def rates(_, z):
        return [z[1], (1 - z[0] ** 2) * z[1] - z[0]]

    times = np.linspace(2, -8, 21)
    known = solve_ivp(
        rates, (2, -8), [1.5, 0], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times
    )
    assert run(times) == pytest.approx(known.y, abs=1e-9)
    assert run.t[0] == -8
    assert run.t[-1] == 2
    out = fs.simulate(model, [2.5, 0], t=(0, -9))
    assert out.outcome.code == "blow-up"
    assert -9 < out.span[0] < 0


def test_samples_stops_and_stored_models():
    model = MODELS["smooth"]
    given = {"t": (0, -5), "samples": [-4, -2, -1], "stop": "x - 1/2", "integration": FINE}
    run = fs.simulate(model, [1.0, 0.5], **given)
    assert run.outcome.code == "stopped"
    assert f"t = {run.span[0]:.10g}" in str(run.outcome)
    assert run(run.span[0])[0] == pytest.approx(0.5, abs=1e-14)
    assert run.t.tolist() == [t for t in (-4, -2, -1) if t >= run.span[0]]
    assert run.sampled[1] == pytest.approx(run(run.t), abs=1e-13)
    assert fs.simulate(model.stored, [1.0, 0.5], **given) == run
    plain = fs.simulate(model, [1.0, 0.5], t=(0, -5), samples=3, dense=False)
    assert plain.t.tolist() == [-5, -2.5, 0]
    assert not plain.is_dense


@pytest.mark.parametrize("side", [1, -1])
def test_a_motion_that_is_not_unique(side):
    """Sliding, and where it ends: what was computed until there is returned, on both sides."""
    friction = fs.Model({x: v, v: 0.9 * side * sp.sin(1.2 * t) - x - 0.5 * sp.sign(v)})
    run = fs.simulate(friction, [side, 0.0], t=(0, 20))
    (slide,) = (s for s in run.segments if s.region == "S1|S2")
    back = fs.simulate(friction, run.end[1:], t=(20, 0))
    assert back.outcome.code == "not unique"
    assert back.span[0] == pytest.approx(slide.end, abs=1e-6)
    assert f"at t = {back.span[0]:.10g} the backward motion" in str(back.outcome)
    times = np.linspace(slide.end + 0.01, 20, 30)
    assert back(times) == pytest.approx(run(times), abs=1e-7)
    middle = 0.5 * (slide.start + slide.end)
    back = fs.simulate(friction, run(middle), t=(middle, 0))
    assert back.outcome.code == "not unique"
    assert back.span == (middle, middle)


def test_resets_are_not_undone():
    ball = fs.Model({x: v, v: -1}, resets={x <= 0: {v: -v / 2}})
    with pytest.raises(fs.ModelError, match="a run backwards in time cannot undo the reset x <= 0"):
        fs.simulate(ball, [1, 0], t=(0, -1))
    q = sp.Symbol("q")
    heater = fs.Model({x: -x + 2 * (1 - q)}, switches={q: (x > 1.5, x < 0.5)})
    for model in (heater, heater.stored):
        with pytest.raises(fs.ModelError, match="backwards in time cannot undo the switch q"):
            fs.simulate(model, {"x": 1, "q": 0}, t=(0, -1))
    with pytest.raises(fs.ArgumentError, match=r"t = \(1, 1\)"):
        fs.simulate(MODELS["smooth"], [1, 0], t=(1, 1))


@pytest.mark.parametrize("kept", [{}, {"dense": False}, {"dense": False, "samples": [1.0, 2.0]}])
def test_the_final_state_is_the_one_reached(kept):
    spiral = fs.Model({x: v, v: -x - v / 5})
    start = {"x": 1.0, "v": 0.25}
    run = fs.simulate(spiral, start, t=(0, 3), integration=FINE)
    back = fs.simulate(spiral, run.final_state, t=(3, 0), integration=FINE, **kept)
    assert back.final_state == pytest.approx(start, abs=1e-11)
    if back.is_dense:
        (later,) = back.select(between=(1.0, 2.0))
        assert list(later.final_state.values()) == pytest.approx(run(1.0), abs=1e-11)
        (sooner,) = back.select(between=(0.0, 2.0))
        assert sooner.final_state == back.final_state
