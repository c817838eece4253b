"""Corners and canards of piecewise-linear models, against closed forms and simulation."""

import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y = sp.symbols("x y")
a, s, k, eps, d = sp.symbols("a s k epsilon delta")

#: Slopes −1, s, and −1 or 1.
VALUES = {a: 0.1, s: 0.5, k: -1, eps: 0.01, d: 1}


@pytest.fixture(scope="module")
def zones():
    """ε x' = y + F(x) with slopes −1, s and k, y' = a − x."""
    slopes = sp.Piecewise((-x, x < 0), (s * x, x < d), (s * d + k * (x - d), True))
    return fs.Model({x: (y + slopes) / eps}, slow={y: a - x}, parameters=VALUES)


def corner(model, at=0.0):
    found = fs.slow_flow(model, parameter="a").corners
    return next(one for one in found if one.values["x"] == pytest.approx(at))


def test_what_the_slow_flow_does_at_corners(zones):
    """x' = −f_y g/f_x: (a − x)/(−s) on the side of slope s, (a − x) on that of slope −1."""
    one, other = corner(zones), corner(zones, 1.0)
    assert (one.code, one.passage, one.parameter, one.value) == ("BC", "jumps", "a", 0.0)
    speeds = {side.region: (side.attracting, side.speed) for side in one.sides}
    assert speeds == {"S3": (True, pytest.approx(-0.1)), "S2": (False, pytest.approx(-0.2))}
    assert (other.passage, other.value) == ("jumps", pytest.approx(1.0))
    # beyond the corner's own value the flow leaves it on both sides
    assert corner(zones.with_parameters(a=-0.1)).passage == "not reached"
    assert corner(zones.with_parameters(a=0)).passage == "corner-singular"
    assert corner(zones.with_parameters(s=0)).passage == "corner-singular"
    through = corner(zones.with_parameters(s=-2))
    assert (through.code, through.passage) == ("", "passes")
    assert "no folds" in fs.slow_flow(zones)["S1"].notes[0]


def extent(model, settled=60.0):
    run = fs.simulate(model, [0.0, 0.0], t=(0, 2 * settled))
    late = run["x"][run.t > settled]
    return float(late.max() - late.min())


@pytest.mark.parametrize("slope", [0.21, 0.5])
def test_two_zones_with_separated_rates_have_no_canard_but_the_whole_cycle(zones, slope):
    """s ≥ 2√ε = 0.2: super-explosion (Desroches et al. 2013)."""
    model = zones.with_parameters(s=slope)
    found = fs.find_canard(model, corner(model), "a")
    assert found.outcome.code == "no canard"
    assert "super-explosion" in str(found.outcome)
    assert "only at a = 0" in str(found.outcome)
    cycles = [extent(model.with_parameters(a=value)) for value in (1e-3, 2e-3)]
    assert cycles[0] > 1.0
    assert cycles[1] / cycles[0] == pytest.approx(1.0, abs=0.02)


def test_two_zones_without_separated_rates_have_a_cycle_in_proportion(zones):
    model = zones.with_parameters(s=0.1)
    with pytest.raises(fs.ArgumentError, match="The cycle grows in proportion to"):
        fs.find_canard(model, corner(model), "a")
    cycles = [extent(model.with_parameters(a=value)) for value in (1e-3, 2e-3)]
    assert cycles[0] < 0.1
    assert cycles[1] / cycles[0] == pytest.approx(2.0, rel=1e-3)


def test_three_zones_have_a_canard(zones):
    """With the slopes −1, 0 and 1 it is at a = δ/2, by symmetry."""
    even = zones.with_parameters({s: 0, k: 1, d: 0.1})
    found = fs.find_canard(even, corner(even), "a")
    assert abs(found.value - 0.05) <= found.accuracy < 1e-15
    model = even.with_parameters(s=0.05)
    canard = fs.find_canard(model, corner(model), "a")
    assert canard.outcome
    assert abs(canard.gap) < 1e-14
    # by simulation: runs beside it leave the repelling line to opposite sides, one for good
    start = [canard.attracting[name][0] for name in ("x", "y")]
    largest = []
    for distance in (1e-9, -1e-9):
        near = model.with_parameters(a=canard.value + distance)
        run = fs.simulate(near, start, t=(0, 20), stop="x > 5")
        largest.append(run["x"].max())
    assert min(largest) < 1 < 5 == pytest.approx(max(largest))


def test_bad_input(zones):
    with pytest.raises(fs.ArgumentError, match="expected a corner"):
        fs.find_canard(zones.with_parameters(s=-2), corner(zones.with_parameters(s=-2)), "a")
    with pytest.raises(fs.ArgumentError, match="section"):
        fs.find_canard(zones, corner(zones), "a", section="x")
    with pytest.raises(fs.ArgumentError, match="solved for a"):
        fs.find_canard(zones, corner(zones), "s")
    bent = fs.Model(
        {x: sp.Piecewise((y - x, x < 0), (y + x + x**2, True)) / eps},
        slow={y: a - x},
        parameters={a: 0, eps: 0.01},
    )
    with pytest.raises(fs.ArgumentError, match="not linear"):
        fs.find_canard(bent, corner(bent), "a")
