"""Two-folds on interfaces that are not solved in closed form, against interfaces x = level."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, w = sp.symbols("x v w")

#: Switching functions with the zeros listed, among them those at which an equilibrium may be.
SURFACES = {
    "sine": (sp.sin(x), (-np.pi, 0.0, np.pi)),
    "cosine": (sp.cos(x) - sp.Rational(1, 2), (-np.pi / 3, np.pi / 3)),
    "cubic": (x**3 + x - 1, (0.6823278038280193,)),
    "exponential": (sp.exp(x) - sp.Rational(9, 4), (float(np.log(2.25)),)),
}


def relay(surface, load, **more):
    """Return an oscillator with friction, pulled back by a relay that switches on a surface."""
    force = sp.Piecewise((1, surface > 0), (-1, True))
    return fs.Model({x: v, v: w - v - x - force}, parameters={w: load}, **more)


def at_two_folds(model, **options):
    return [e for e in fs.equilibria(model, **options) if e.at_two_fold]


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", SURFACES)
def test_two_folds_have_the_spectra_of_those_on_a_plane(name):
    surface, zeros = SURFACES[name]
    rng = np.random.default_rng(7)
    for load in rng.uniform(-1.5, 1.5, 3):
        found = {round(float(e.state[0]), 9): e for e in at_two_folds(relay(surface, load))}
        expected = {}
        for zero in zeros:
            rising = float(sp.diff(surface, x).subs(x, zero)) > 0
            plane = (x - zero) if rising else (zero - x)
            for one in at_two_folds(relay(plane, load)):
                expected[round(zero, 9)] = one
        assert found.keys() == expected.keys()
        for zero, one in expected.items():
            both = found[zero].eigenvalues, one.eigenvalues
            assert found[zero].stable == one.stable
            np.testing.assert_allclose(*both, rtol=1e-9)


def test_a_window_is_accepted_where_equilibria_are_at_two_folds():
    model = fs.Model({x: v, v: w - v - x - sp.sign(x)}, parameters={w: 0.3})
    (one,) = fs.equilibria(model, window={"x": (-3, 3)})
    assert one.at_two_fold
    assert one.state[0] == 0
    assert len(fs.equilibria(model, window={"x": (1, 3)})) == 0


def test_two_folds_of_an_angle_are_in_its_principal_range():
    model = relay(sp.cos(x) - sp.Rational(1, 2), 0.3)
    turning = fs.Model(
        {x: v, v: w - v - sp.Piecewise((1, sp.cos(x) > 0.5), (-1, True))},
        parameters={w: 0.3},
        periodic={x: 2 * sp.pi},
    )
    np.testing.assert_allclose(
        sorted(e.state[0] for e in at_two_folds(turning)), [-np.pi / 3, np.pi / 3], atol=1e-14
    )
    assert fs.equilibria(turning).completeness == fs.equilibria(model).completeness == "found"


def test_every_branch_of_two_folds_is_a_band():
    surface = (x - 1) * (x**2 + x + 3) * sp.exp(x) * (x + 1) * (x + 4)
    model = relay(surface, 0.0)
    bands = fs.continue_equilibria(model, "w", over=(-2.9, 2.9)).bands
    middles = sorted(float(b.lower[len(b.lower) // 2][0]) for b in bands)
    np.testing.assert_allclose(middles, [-1.0, 1.0], atol=1e-12)
    for band in bands:
        # |w − x| ≤ 1, the force of the relay
        zero = band.lower[0][0]
        np.testing.assert_allclose(
            [band.values[0], band.values[-1]], [zero - 1, zero + 1], atol=0.05
        )


def test_two_folds_that_meet_between_the_regular_values_are_two_bands():
    # exp(y) − y = p has two roots for p > 1; the weight of the upper one is 1 at y = 1/20
    y, p = sp.symbols("y p")
    twentieth = sp.Rational(1, 20)
    rates = {x: sp.exp(y) - y - p, y: 1 + y - twentieth - sp.sign(x)}
    upper, lower = fs.continue_equilibria(fs.Model(rates, parameters={p: 0}), "p", (0.3, 2)).bands
    np.testing.assert_allclose(upper.values[[0, -1]], [1, np.exp(0.05) - 0.05], rtol=1e-9)
    np.testing.assert_allclose(lower.values[[0, -1]], [1, 2], rtol=1e-12)
    for band, sign in ((upper, 1), (lower, -1)):
        height = band.lower[:, 1]
        assert (sign * height[2:] > 0).all()
        np.testing.assert_allclose(np.exp(height) - height, band.values, atol=1e-12)
