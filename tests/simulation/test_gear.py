"""The gear against trajectories computed elsewhere to many more digits."""

import json
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from fastslow.model.model import Model
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

# quadruple-precision Taylor series of order 40, tolerance 1e-30
P1 = json.loads((Path(__file__).parent / "gear_p1.json").read_text())
TIMES = [float(s["t"]) for s in P1["samples"]]
STATES = np.array([[float(s["x"]), float(s["v"])] for s in P1["samples"]]).T
REGIONS = {1: "S1", 0: "S2", -1: "S3"}
INTERFACES = {"+D": "x - D", "-D": "x + D"}


@pytest.mark.parametrize("tol", [1e-6, 1e-9, 1e-12])
def test_states_reach_the_tolerance(gear, tol):
    run = simulate(gear, [0, 0], periods=3, integration=Integration(rtol=tol))
    assert np.abs(run(TIMES) - STATES).max() < tol
    assert len(run.crossings) == 41


def test_states_and_crossings_to_rounding(gear):
    run = simulate(gear, [0, 0], periods=3, integration=Integration(rtol=1e-13), samples=TIMES)
    assert np.abs(np.array([run["x"], run["v"]]) - STATES).max() < 1e-12
    assert len(run.crossings) == len(P1["crossings"]) == 41
    for crossing, expected in zip(run.crossings, P1["crossings"], strict=True):
        speed = float(expected["v"])
        assert crossing.time == pytest.approx(float(expected["t"]), abs=1e-12 / abs(speed))
        assert crossing.state[1] == pytest.approx(speed, abs=1e-12)
        assert abs(crossing.state[0]) == 0.25
        assert crossing.interface == INTERFACES[expected["interface"]]
        assert crossing.to_region == REGIONS[expected["new_mode"]]
        assert crossing.direction == np.sign(speed)
        assert not crossing.tangential


def test_crossing_times_at_the_default_tolerance(gear):
    run = simulate(gear, [0, 0], periods=3)
    for crossing, expected in zip(run.crossings, P1["crossings"], strict=True):
        error = abs(crossing.time - float(expected["t"])) * abs(float(expected["v"]))
        assert error < 1e-10 * float(expected["t"])


def test_samples_are_the_dense_output(gear):
    times = np.linspace(0, 600 * np.pi, 3001)
    kept = simulate(gear, [0, 0], periods=3, samples=times)
    light = simulate(gear, [0, 0], periods=3, samples=times, dense=False)
    for name in ("x", "v", "w"):
        assert np.abs(light[name] - kept[name]).max() < 1e-13
    assert np.abs(kept(times) - [kept["x"], kept["v"]]).max() < 1e-12
    assert np.abs(kept["w"] - (2.372 + 3.546 * np.sin(0.01 * times))).max() < 1e-12
    assert [c.time for c in light.crossings] == [c.time for c in kept.crossings]


def test_signs_agree_with_the_region_at_every_step(gear):
    run = simulate(gear, [0, 0], periods=3)
    middle = run.steps[:, 0] + 0.5 * run.steps[:, 1]
    position = run(middle)[0]
    region = np.array(run.modes)[run.steps[:, 2].astype(int)]
    assert np.all((position > 0.25) == (region == "S1"))
    assert np.all((position < -0.25) == (region == "S3"))


def test_printed_scaling_has_825_crossings(gear):
    stiff = gear.with_parameters(A=12152.8, B=40.5, C=60.55)
    coarse = simulate(stiff, [0, 0], periods=3)
    fine = simulate(stiff, [0, 0], periods=3, integration=Integration(rtol=1e-13))
    assert len(coarse.crossings) == len(fine.crossings) == 825
    # the last crossings before the run ends, where all errors have come together
    late = [abs(a.time - b.time) for a, b in zip(coarse.crossings, fine.crossings, strict=True)]
    assert max(late) < 1e-6


# w at x = D and x = -D, by a Taylor series of order 40 with 34 digits (mpmath)
# and the closed form within the gap
PASSAGES = {
    1e-2: (-0.17676151190771, -0.20640905936503),
    1e-3: (-0.110244479002861, -0.114979384666563),
    1e-4: (-0.094100921486102, -0.094657783243077),
}


@pytest.mark.parametrize("speed", PASSAGES)
def test_slow_passage_through_the_gap(speed):
    x, v, t, w, A, D, e = sp.symbols("x v t w A D e")
    dead_zone = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    model = Model(
        {x: v, v: w - v - (x**2 + A) * dead_zone},
        forcing={w: sp.Rational(1, 5) - e * t},
        parameters={A: -0.6, D: 0.25, e: speed},
    )
    run = simulate(
        model, [0.9427182380145632, 0], t=(0, 0.42 / speed), integration=Integration(rtol=1e-13)
    )
    assert run.itinerary[:3] == ("S1", "S2", "S3")
    loads = [0.2 - speed * c.time for c in run.crossings[:2]]
    assert loads == pytest.approx(PASSAGES[speed], abs=2e-13)


def test_a_frozen_model_at_a_value(gear):
    frozen = gear.frozen().with_parameters(w=1.0)
    run = simulate(frozen, {"x": 0.0, "v": 0.0}, t=(0, 60))
    end = run(60.0)
    assert (end[0] ** 2 + 41.67) * (end[0] - 0.25) == pytest.approx(1.0, abs=1e-7)
    assert run.period is None
    assert run.regime is None


def test_regimes(gear):
    assert simulate(gear, [0, 0], periods=1).regime == "bilateral"
    meshed = gear.with_parameters(C=1.0)
    assert simulate(meshed, [0, 0], periods=2).regime == "meshed upper"
    mirrored = gear.with_parameters(B=-2.372, C=1.0)
    assert simulate(mirrored, [0, 0], periods=2).regime == "meshed lower"
    free = gear.with_parameters(B=0.0, C=0.0)
    assert simulate(free, [0.1, 0], t=(0, 50), period=50).regime == "free"
    wide = gear.with_parameters(D=50.0, B=2.0, C=2.3)
    assert simulate(wide, [50, 0], periods=2).regime == "unilateral upper"
