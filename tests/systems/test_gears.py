"""Parameters of the harmonic gear under both scalings, against tabulated numbers."""

import math

import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real
from fastslow.systems import (
    gear_scales,
    harmonic_gear,
    harmonic_gear_from_physical,
    harmonic_gear_twist,
    harmonic_gear_two_inertias,
)
from fastslow.systems.geartrain import gear_scaling

# computed from the source's values with 40 digits, to all digits kept
CONSISTENT = {"A": "41.6666667", "B": "2.37197934", "C": "3.54545564", "D": "0.298869397"}
PRINTED = {"A": "12152.7778", "B": "40.5092593", "C": "60.5501824", "D": "5.10416667"}


@pytest.mark.parametrize(("scaling", "table"), [("consistent", CONSISTENT), ("printed", PRINTED)])
def test_parameters_to_all_digits(scaling, table):
    values = harmonic_gear_from_physical(scaling, omega=1.0).parameters
    assert {name: f"{values[name]:.9g}" for name in "ABCD"} == table
    assert f"{values['omega']:.9g}" == "0.0182252846"


def test_equivalent_inertia_and_damping():
    scales = gear_scales()
    assert f"{scales.inertia:.9g}" == "0.023915592"
    assert f"{scales.damping:.9g}" == "1.31222049"


def test_the_printed_formulas():
    values = harmonic_gear_from_physical("printed", k1=2500, T_m=7, T_am=31, J_o=0.03, k2=19000)
    p = values.parameters
    s = gear_scales("printed", J_o=0.03, k2=19000)
    j, c = s.inertia, s.damping
    assert p["A"] == pytest.approx(2500 * 19000 * j**2 / c**4, rel=1e-14)
    assert p["B"] == pytest.approx(19000 * j**2 * 7 / c**4, rel=1e-14)
    assert p["C"] == pytest.approx(19000 * j**3 * 31 / (c**4 * 0.03), rel=1e-14)


def test_the_slip_alone_explains_what_is_printed():
    """Printed A, B and C follow if θ_s is omitted, and only then."""
    found = gear_scaling()
    k1, k2, j, c, mean, wave, outer = map(real, ["k1", "k2", "J_eq", "C_eq", "T_m", "T_am", "J_o"])
    stiff = sp.sqrt(k2 * j / c**2)
    printed = {
        "A": k1 * k2 * j**2 / c**4,
        "B": k2 * j**2 * mean / c**4,
        "C": k2 * j**3 * wave / (c**4 * outer),
    }
    consistent = {
        "A": k1 * j / c**2,
        "B": stiff * j * mean / c**2,
        "C": stiff * j**2 * wave / (c**2 * outer),
    }
    positive = {s: sp.Symbol(s.name, positive=True) for s in (k1, k2, j, c, mean, wave, outer)}
    for name in "ABC":
        for values, expected in ((found.slip, printed), (found.consistent, consistent)):
            ratio = (values[name] / expected[name]).subs(positive)
            assert sp.simplify(ratio) == 1, name
    assert found.reproduced
    assert found.agrees
    assert found.reduced
    assert set(found.ratios) == {"A", "B", "C"}


def test_the_consistent_scaling_solves_the_physical_equation():
    s = gear_scales()
    p = harmonic_gear_from_physical(omega=0.7, phi=0.01).parameters
    theta, rate, time = 0.013, 0.2, 0.4
    torque = 10 + s.inertia / 2.4e-2 * 15 * math.sin(0.7 * time)
    physical = (torque - s.damping * rate - (3000 + 21000 * theta**2) * (theta - 0.01)) / s.inertia
    x, v = theta / s.angle, rate * s.time / s.angle
    load = p["B"] + p["C"] * math.sin(p["omega"] * time / s.time)
    scaled = load - v - (x**2 + p["A"]) * (x - p["D"])
    assert scaled * s.angle / s.time**2 == pytest.approx(physical, rel=1e-12)


@pytest.mark.parametrize("twisted", [0.03, 0.004, -0.021])
def test_two_inertias_and_their_twist_against_the_equations(twisted):
    # equations (2) and (5) written out by hand, with other values than the defaults
    J_i, J_o, N, k1, k2, phi, T_m = 5e-4, 0.03, 80.0, 2500.0, 19000.0, 0.012, 7.0
    given = {"J_i": J_i, "J_o": J_o, "N": N, "k1": k1, "k2": k2, "phi": phi, "T_m": T_m}
    s = gear_scales(J_i=J_i, J_o=J_o, N=N, k2=k2)
    theta_i, v_o, v_i, w = 0.7, 0.2, 3.0, 11.0
    gap = math.copysign(max(abs(twisted) - phi, 0.0), twisted)
    inside = s.damping * (v_o - v_i / N) + (k1 + k2 * twisted**2) * gap
    outer, inner = (w - inside) / J_o, (inside - T_m) / (N * J_i)
    state = {"theta_o": twisted + theta_i / N, "theta_i": theta_i, "v_o": v_o, "v_i": v_i, "w": w}
    region = "S1" if twisted > phi else "S3" if twisted < -phi else "S2"

    def rates(model, place):
        place = {**place, **model.parameters}
        place = {sp.Symbol(name, real=True): value for name, value in place.items()}
        return {n: float(r.subs(place)) for n, r in model.regions[region].rates.items()}

    found = rates(harmonic_gear_two_inertias(**given), state)
    expected = {"theta_o": v_o, "v_o": outer, "theta_i": v_i, "v_i": inner}
    assert found == pytest.approx(expected, rel=1e-12)
    # the torque of the twist: J_eq (w/J_o + T_m/(N² J_i))
    torque = s.inertia * (w / J_o + T_m / (N**2 * J_i))
    place = {"theta": twisted, "v": v_o - v_i / N, "w": torque}
    expected = {"theta": v_o - v_i / N, "v": outer - inner / N}
    assert rates(harmonic_gear_twist(**given), place) == pytest.approx(expected, rel=1e-12)


def test_the_twist_is_the_dimensionless_gear_in_its_scales():
    s, twist = gear_scales(), harmonic_gear_twist()
    one = fs.simulate(twist, [0, 0], t=(0, 30))
    other = fs.simulate(harmonic_gear_from_physical(), [0, 0], t=(0, 30 / s.time))
    assert len(one.crossings) == len(other.crossings) > 10
    for a, b in zip(one.crossings, other.crossings, strict=True):
        assert a.time == pytest.approx(b.time * s.time, rel=1e-7)
        assert a.state[1] == pytest.approx(b.state[1] * s.angle / s.time, rel=1e-5)


def test_gap_set_directly():
    assert harmonic_gear_from_physical().with_parameters(D=0.1).parameters["D"] == 0.1


def test_load_ratio_does_not_depend_on_the_scaling():
    one, other = (
        harmonic_gear_from_physical(s, T_am=1.0).parameters for s in ("consistent", "printed")
    )
    assert one["C"] / one["B"] == pytest.approx(0.099648300, rel=1e-8)
    assert other["C"] / other["B"] == pytest.approx(one["C"] / one["B"], rel=1e-14)


def test_regions_of_the_gear():
    gear = harmonic_gear()
    assert list(gear.regions) == ["S1", "S2", "S3"]
    assert list(gear.interfaces) == ["x - D", "x + D"]
    assert gear.regions["S2"].rates["v"] == sp.sympify(
        "w - v", {n: sp.Symbol(n, real=True) for n in "wv"}
    )
    assert gear.period() == pytest.approx(200 * math.pi, rel=1e-14)


def test_bad_values():
    with pytest.raises(fs.UnknownNameError, match="'printd'; did you mean 'printed'"):
        harmonic_gear_from_physical("printd")
    with pytest.raises(fs.ArgumentError, match="k2 = -1; expected a positive number"):
        harmonic_gear_from_physical(k2=-1)
