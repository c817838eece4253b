"""The table of all readings of the source, against the slow-load criterion and SciPy."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fastslow as fs
from analyses import readings
from analyses.cases import FASTEST, WIDTHS, gear
from fastslow.systems.gears import SCALINGS

pytestmark = pytest.mark.slow

EXPECTED = json.loads((Path(__file__).parent / "readings.json").read_text(encoding="utf-8"))


@pytest.mark.sample(2)
@pytest.mark.parametrize("column", readings.COLUMNS, ids=lambda column: "{}, {}={}".format(*column))
def test_every_answer_of_the_table(column):
    place = readings.COLUMNS.index(column)
    found = {
        number: readings.cell(answers) for number, answers in readings.decided(*column).items()
    }
    assert found == {n: cells[place] for n, cells in EXPECTED.items()}


def test_regimes_under_slow_loads_are_those_of_the_criterion():
    for scaling, end, reading in product(SCALINGS, readings.ENDS, readings.AMPLITUDES):
        for one in readings.motions("3", scaling, end * FASTEST, reading):
            p = one.model.parameters
            widest = fs.systems.slow_load_gap(
                p["B"], p["C"], p["omega"], stiffness=p["A"] + p["D"] ** 2, exact=True
            )
            crossed = "bilateral" if widest >= p["D"] else "meshed upper"
            assert one.regime == crossed
            assert widest == 0 or widest > WIDTHS[-1]


def test_a_motion_against_an_independent_solver():
    model = gear("consistent", 1.0, D=0.1)
    p = model.parameters

    def rates(t, z):
        x, v = z
        contact = np.sign(x) * max(abs(x) - p["D"], 0.0)
        return v, p["B"] + p["C"] * np.sin(t) - v - (x * x + p["A"]) * contact

    span = (0.0, 20 * np.pi)
    run = solve_ivp(rates, span, [0.0, 0.0], method="DOP853", rtol=1e-9, atol=1e-11, max_step=0.01)
    x = run.y[0][run.t > span[1] - 2 * np.pi]
    found = readings.motions("3", "consistent", 1.0, "a")[0]
    assert (found.low, found.high) == pytest.approx((x.min(), x.max()), abs=2e-5)
    assert x.min() < -p["D"] < p["D"] < x.max()
    assert found.regime == "bilateral"


def test_readings_for_which_a_claim_holds_are_named():
    assert readings.cell({"a": True, "p": True}) == "yes"
    assert readings.cell({"a": False, "p": False}) == "no"
    assert readings.cell({"1": True, "2": False, "φ": True}) == "1, φ"
