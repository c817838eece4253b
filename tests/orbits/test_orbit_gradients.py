"""Derivatives of periodic orbits and their special points, against closed forms and differences."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, t, F, w, c, k, D, mu, s, r = sp.symbols("x v t F w c k D mu s r")


def differences(model, orbit, name, step=1e-4):
    """Central differences of fourth order of the period and the extremes."""

    def at(shift):
        changed = model.with_parameters({name: model.parameters[name] + shift})
        found = fs.find_orbit(changed, orbit)
        ends = [found[f"{kind}({n})"] for n in found.states for kind in ("min", "max")]
        return np.array([found.period, *ends])

    near, far = at(step) - at(-step), at(2 * step) - at(-2 * step)
    return (8 * near - far) / (12 * step)


MODELS = {
    "van der Pol": (fs.Model({x: v, v: mu * (1 - x**2) * v - x}, parameters={mu: 1.5}), "mu"),
    "impacts": (
        fs.Model(
            {x: v, v: -x - c * v + F * sp.cos(w * t)},
            parameters={c: 0.2, F: 1, w: 1.3, s: 0.4, r: 0.5},
            resets={x >= s: {v: -r * v}},
        ),
        "r",
    ),
    "gear": (fs.systems.harmonic_gear(omega=1.3, D=0.3), "omega"),
}


@pytest.mark.parametrize("name", MODELS)
def test_orbits_against_differences(name):
    model, by = MODELS[name]
    orbit = fs.find_orbit(model, [0.2, 0.2])
    found = orbit.gradient(by)
    names = [f"{kind}({n})" for n in orbit.states for kind in ("min", "max")]
    values = [found["period"], *(found[n] for n in names)]
    np.testing.assert_allclose(values, differences(model, orbit, by), atol=1e-8)


def test_a_linear_oscillator_in_closed_form():
    model = fs.Model({x: v, v: F * sp.cos(w * t) - x - c * v}, parameters={F: 1, w: 1.3, c: 0.2})
    orbit = fs.find_orbit(model, [0, 0])
    gain = 1 / abs(1 - 1.69 + 0.26j)
    assert orbit.gradient("F")["max(x)"] == pytest.approx(gain, rel=1e-12)
    # d/dc of 1/|1 − w² + i c w|
    assert orbit.gradient("c")["max(x)"] == pytest.approx(-0.2 * 1.69 * gain**3, rel=1e-11)
    assert orbit.gradient("w")["period"] == pytest.approx(-2 * np.pi / 1.69, rel=1e-14)


@pytest.fixture(scope="module")
def bilinear():
    stop = sp.Max(x - D, 0)
    model = fs.Model(
        {x: v, v: -x - c * v - k * stop + F * sp.cos(w * t)},
        parameters={c: 0.1, F: 0.3, w: 0.8, k: 10, D: 1},
    )
    return fs.continue_orbits(fs.find_orbit(model, [0, 0]), "F", over=(0.1, 0.4))


def test_grazing_of_the_bilinear_oscillator_in_closed_form(bilinear):
    # F = D |1 − w² + i c w|
    (point,) = bilinear.special("GR")
    stiffness = abs(1 - 0.64 + 0.08j)
    assert point["F"] == pytest.approx(stiffness, rel=1e-12)
    assert point.gradient("D")["F"] == pytest.approx(stiffness, rel=1e-11)
    by_w = (-2 * 0.8 * (1 - 0.64) + 0.01 * 0.8) / stiffness
    assert point.gradient("w")["F"] == pytest.approx(by_w, rel=1e-11)
    assert point.gradient("k")["F"] == pytest.approx(0, abs=1e-11)


def test_period_doubling_is_homogeneous(bilinear):
    # all lengths in units of D
    (point,) = bilinear.special("PD")
    assert point.gradient("D")["F"] == pytest.approx(point["F"], rel=1e-9)


def test_where_there_is_no_derivative(bilinear, tmp_path):
    centre = fs.find_orbit(fs.Model({x: v, v: -k * x}, parameters={k: 1}), [1, 0])
    with pytest.raises(fs.errors.ArgumentError, match="not isolated"):
        centre.gradient("k")
    point = bilinear.special[0]
    with pytest.raises(fs.errors.UnknownNameError):
        point.gradient("z")
    with pytest.raises(fs.errors.ArgumentError, match="which is determined"):
        point.gradient("F")
    point.save(tmp_path / "p.npz")
    with pytest.raises(fs.errors.ArgumentError, match="no model"):
        fs.load(tmp_path / "p.npz").gradient("D")
