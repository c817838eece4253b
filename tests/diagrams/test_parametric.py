"""Equations eliminated once for all values of the parameters, beside those of each value."""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.solve.critical import critical_values
from fastslow.diagrams.solve.exact_polynomials import polynomials_of
from fastslow.diagrams.solve.motion_equations import SlidingEquations, region_equations
from fastslow.diagrams.solve.parametric import eliminations_of

pytestmark = pytest.mark.slow

x, y, v, w, t, a, b, c, k = sp.symbols("x y v w t a b c k")

MODELS = {
    "gear": (
        {x: v, v: w - v - (x**2 + a) * sp.Piecewise((x - b, x > b), (x + b, x < -b), (0, True))},
        {a: 41.67, b: 0.25},
    ),
    "linear part": (
        {x: a * x + b * y - w, y: c * x + k * y - x**3},
        dict.fromkeys((a, b, c, k), 1),
    ),
    "quotient": ({x: y - a * x, y: w * x / (b + x**2) - c * y}, {a: 1, b: 2, c: 3}),
    "friction": ({x: v, v: w - a * x - b * x**3 - c * sp.sign(v)}, {a: 1, b: 0.5, c: 0.25}),
    "relay": ({x: y - a * x - c * sp.sign(x - k), y: w - b * x - y}, {a: 1, b: 2, c: 1, k: 0.5}),
    "cubic": ({x: a + w * x + b * x**2 - c * x**3}, {a: 0.1, b: 0.3, c: 1}),
}

#: Values with zeros, equal ones, other signs and sizes.
VALUES = (-2.0, 0.0, 0.5, 0.5, 1.0, 3.7e-4, 41.67)


def by_numbers(equations):
    """The same equations, eliminated with numbers for the parameters."""
    kind = type(equations)
    direct = type("Direct", (kind,), {"general": None})
    return direct(equations.field, equations.region)


def fields(name, count, seed):
    rates, parameters = MODELS[name]
    rng = np.random.default_rng(seed)
    model = fs.Model(rates, forcing={w: sp.sin(t)}, parameters=parameters).frozen()
    for _ in range(count):
        values = {str(p): float(rng.choice(VALUES)) for p in parameters}
        if name == "gear":
            # the dead zone has a width
            values["b"] = abs(values["b"]) + 0.1
        yield FrozenField(model.with_parameters(values).with_free("w"), "w")


def known(found, states, unit):
    """Whether every state is among others, but for rounding."""
    return all(any(np.allclose(s, o, rtol=1e-9, atol=1e-9 * unit) for o in states) for s in found)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", MODELS)
def test_equilibria_are_those_of_the_numbers(name):
    used = 0
    for field in fields(name, 12, 3):
        for equations in dict.fromkeys(region_equations(field)):
            direct = by_numbers(equations)
            used += equations.general is not None
            for value in (-1.3, 0.0, 0.4, 2.0):
                mine, sure = equations.solutions(value)
                theirs, certain = direct.solutions(value)
                assert sure >= certain
                if sure and certain:
                    unit = max(1.0, *(np.abs(s).max() for s in (*mine, *theirs)), 1.0)
                    assert known(mine, theirs, unit)
                    assert known(theirs, mine, unit)
                if direct.polynomials is not None:
                    assert equations.continuum(value) == direct.continuum(value)
            found, expected = (critical_values(e, -3.0, 3.0) for e in (equations, direct))
            if expected is not None and not direct.factors:
                assert found is not None
                np.testing.assert_allclose(
                    sorted(set(np.round(found, 7))), sorted(set(np.round(expected, 7)))
                )
    assert used


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", MODELS)
def test_results_do_not_depend_on_what_was_computed_before(name):
    def states(field):
        return [s.tolist() for e in region_equations(field) for s in e.solutions(0.4)[0]]

    forwards = list(fields(name, 3, 5))
    first = [states(field) for field in forwards]
    for cached in (eliminations_of, region_equations):
        cache = getattr(cached, "cache_clear", None)
        if cache is not None:
            cache()
    rates, parameters = MODELS[name]
    # in a model of other symbols nothing is known from before
    renamed = {s: sp.Symbol(f"{s}_{name[0]}") for s in parameters}
    model = fs.Model(
        {n: sp.sympify(r).subs(renamed) for n, r in rates.items()},
        forcing={w: sp.sin(t)},
        parameters={renamed[s]: value for s, value in parameters.items()},
    ).frozen()
    for field, expected in reversed(list(zip(forwards, first, strict=True))):
        values = {f"{n}_{name[0]}": value for n, value in field.model.parameters.items()}
        here = FrozenField(model.with_parameters(values).with_free("w"), "w")
        assert states(here) == expected


def test_a_choice_that_no_longer_holds_is_made_again():
    """With k = 0 no state follows from the first equation, and with a = b not from both."""
    model = fs.Model(
        {x: (a - b) * y + x - w, y: k * x - y + x**3},
        forcing={w: sp.sin(t)},
        parameters={a: 2, b: 1, k: 1},
    ).frozen()
    for values in ({}, {"a": 1.0}, {"k": 0.0}, {"a": 1.0, "k": 0.0}, {}):
        here = model.with_parameters(values)
        p = here.parameters
        for e in fs.equilibria(here, w=0.7):
            X, Y = e.state
            assert abs((p["a"] - p["b"]) * Y + X - 0.7) < 1e-12
            assert abs(p["k"] * X - Y + X**3) < 1e-12
        assert fs.equilibria(here, w=0.7).completeness == "complete"


def test_sliding_is_eliminated_too():
    rates, parameters = MODELS["relay"]
    model = fs.Model(rates, forcing={w: sp.sin(t)}, parameters=parameters).frozen()
    equations = region_equations(FrozenField(model.with_free("w"), "w"))
    sliding = [e for e in equations if isinstance(e, SlidingEquations)]
    assert sliding
    assert all(e.general is not None for e in sliding)
    # on x = k it is y = w - b k, where |y - a k| < c
    (found,) = fs.equilibria(model, w=1.5)
    assert found.region == "S1|S2"
    np.testing.assert_allclose(found.state, [0.5, 0.5], rtol=1e-14)


def test_polynomials_are_whole_multiples():
    family = polynomials_of([a * x / 3 + b**2, x - a], [x], [a, b])
    assert family is not None
    one, other = family.at([Fraction(1, 2), Fraction(2, 3)])
    # 3 · 2 · 3² times 1/6 x + 4/9, and x − 1/2
    assert one == {(1,): 9, (0,): 24}
    assert other == {(1,): 54, (0,): -27}
    assert polynomials_of([sp.sqrt(a) * x], [x], [a]) is None
    assert polynomials_of([sp.pi * x], [x], [a]) is None
