"""Walls, thresholds, conditions and discontinuities that a motion touches exactly, or misses.

x = (t − 1)²/2 + e touches zero for e = 0, and crosses it at 1 ∓ √(−2 e) for e < 0.
"""

import pytest
import sympy as sp

import fastslow as fs

x, v, z, k, q = sp.symbols("x v z k q")
FALL = {x: v, v: 1}

MODELS = {
    "the wall of x < 0": fs.Model(FALL, resets={"x < 0": {v: v + 1}}),
    "the condition of an event": fs.Model(
        FALL | {z: k}, parameters={k: 0}, events={"e": fs.Event("x < 0", then={k: 1})}
    ),
    "the threshold of q": fs.Model(FALL | {z: q}, switches={q: (x < 0, x > 9)}),
    "the discontinuity x": fs.Model(FALL | {z: (1 - sp.sign(x)) / 2}),
}


def run_of(name, e):
    start = {"x": 0.5 + e, "v": -1.0, "z": 0.0, "q": 0.0}
    model = MODELS[name]
    return fs.simulate(model, {s: start[s] for s in (*model.states, *model.switches)}, t=(0, 2))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("e", [0.0, -1e-16])
def test_a_touch_to_rounding_is_named_and_crosses_nothing(name, e):
    run = run_of(name, e)
    (note,) = run.outcome.notes
    assert note.startswith(f"At t = 1 the motion touches {name} to rounding")
    assert note.endswith("decided by rounding.")
    assert run.outcome
    assert run.final_state["x"] == pytest.approx(0.5, abs=1e-12)
    assert run.final_state.get("z", 0.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("e", [1e-9, 1e-3, -1e-9, -1e-3])
def test_misses_and_crossings_are_not_named(name, e):
    run = run_of(name, e)
    assert not run.outcome.notes
    depth = (2 * max(-e, 0.0)) ** 0.5
    if name == "the wall of x < 0":
        assert len(run.resets) == (e < 0)
        # from x = 0 with v = 1 − √(−2 e)
        left = 1 + depth
        expected = (1 - depth) * left + left**2 / 2 if e < 0 else 0.5 + e
        assert run.final_state["x"] == pytest.approx(expected, rel=1e-9)
        return
    time_after = {"the discontinuity x": 2 * depth}.get(name, (1 + depth) * (e < 0))
    assert run.final_state["z"] == pytest.approx(time_after, abs=1e-9)
