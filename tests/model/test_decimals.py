"""Numbers of a model are decimals wherever exact arithmetic is used, also after saving."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.certification.equations import exact_equations
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.motion_equations import region_equations

pytestmark = pytest.mark.slow

R = sp.Rational
x, y, p, a, b, c = sp.symbols("x y p a b c")


def models(values):
    """One model with numbers as parameters, as floats in the rates, and as fractions in them."""
    rates = {x: p - a * x**3 + b * x * y, y: c * (x - b) - a * y * sp.Abs(x - a)}
    exact = {s: R(str(v)) for s, v in values.items()}
    return [
        fs.Model(rates, parameters={p: 0, **values}),
        *(
            fs.Model({s: r.subs(known) for s, r in rates.items()}, parameters={p: 0})
            for known in (values, exact)
        ),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_parameters_floats_and_fractions_are_one_model(seed):
    digits = np.random.default_rng(seed).integers(1, 10**5, 3)
    values = {s: int(n) / 10**4 for s, n in zip((a, b, c), digits, strict=True)}
    found = [[e.rows for e in exact_equations(m, "p")] for m in models(values)]
    symbols = sorted(found[0][0][0].free_symbols, key=str)
    for others in found[1:]:
        for one, other in zip(found[0], others, strict=True):
            assert all(
                sp.expand(e - f) == 0 and e.free_symbols <= {*symbols, *f.free_symbols}
                for e, f in zip(one, other, strict=True)
            )
    systems = [
        [[sorted(q.items()) for q in e.polynomials] for e in region_equations(FrozenField(m, "p"))]
        for m in models(values)
    ]

    def monic(system):
        return [[(k, R(n, q[-1][1])) for k, n in q] for q in system]

    for one, two, three in zip(*systems, strict=True):
        assert monic(one) == monic(two) == monic(three)


def test_conditions_on_decimals_hold_exactly():
    """In floating point 0.1 + 0.2 - 0.3 is 5.6e-17, with which y has no equilibrium."""
    model = fs.Model({x: p - x, y: (a + b - c) + y**2}, parameters={p: 0, a: 0.1, b: 0.2, c: 0.3})
    (found,) = fs.equilibria(model)
    # a double root, to half of the digits
    assert found.state == pytest.approx([0.0, 0.0], abs=1e-7)


def test_stored_certificates_are_about_the_same_decimals(tmp_path):
    """The fold is at p = 2 (a/3)^(3/2); the binary number 0.1 changes its 17th digit."""
    pytest.importorskip("flint")
    model = fs.Model({x: p + a * x - x**3}, parameters={p: 0, a: 0.1})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    proof = fs.certify(model, diagram, window={x: (-2, 2)})
    proof.save(tmp_path / "proof.npz")
    again = fs.load(tmp_path / "proof.npz")
    assert again.parameters == proof.parameters
    expected = sp.N(2 * (R(1, 10) / 3) ** R(3, 2), 40)
    assert len(proof.points) == len(again.points) == 2
    for point in (*proof.points, *again.points):
        exact = fs.prove(model, point, digits=30).enclosure
        assert abs(abs(R(exact["p"])) - expected) < 1e-29
        for sides in (point.enclosure, exact):
            assert R(sides.low["p"]) <= np.sign(point["p"]) * expected <= R(sides.high["p"])
