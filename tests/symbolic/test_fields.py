"""Closed forms of models of several fields, against numbers at random parameter values."""

from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.errors import ModelError, UnknownNameError
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.symbolic.closed_forms.symmetries import free_directions
from fastslow.systems import harmonic_gear_two_inertias
from tests.symbolic import field_models

pytestmark = pytest.mark.slow

NAMES = (
    "wheelset",
    "boost_converter",
    "sir_with_capacity",
    "mckean",
    "toggle_switch",
    "quantity_named_q",
    "stommel",
    "rosenzweig_macarthur",
    "welander",
)

TRIALS = 20


@cache
def model(name):
    if name == "two_inertias":
        return harmonic_gear_two_inertias().frozen()
    return getattr(field_models, name)()


@cache
def derived(name):
    return fs.derive(model(name))


def random_values(form, derivation, generator):
    """Values of all symbols that a form leaves open, with the signs that are assumed."""
    everything = (*form.state.values(), *form.parameters.values(), *form.equations)
    signs = {a.lhs: 1 if isinstance(a, sp.Gt) else -1 for a in derivation.assumptions}
    symbols = set().union(*(e.free_symbols for e in everything), form.admissible.free_symbols)
    symbols |= set(signs) | {real(n) for n in (*derivation.states, *derivation.free)}
    symbols -= {real(n) for n in form.parameters}
    symbols -= {real(n) for n, e in form.state.items() if e != real(n)}
    return {
        s: sp.Float(float(np.exp(generator.normal())) * signs.get(s, generator.choice((-1, 1))), 30)
        for s in sorted(symbols, key=str)
    }


def placed(form, values):
    place = dict(values)
    for n, e in form.parameters.items():
        place[real(n)] = sp.N(e.subs(values), 30)
    for n, e in form.state.items():
        if e != real(n):
            place[real(n)] = sp.N(e.subs(values), 30)
    return place


def real_place(place):
    return all(v.is_number and v.is_finite and abs(sp.im(v)) < 1e-20 for v in place.values())


def numbers(expressions, place):
    return [mpmath.mpf(sp.re(sp.N(sp.sympify(e).subs(place), 25))) for e in expressions]


def points_of(derivation):
    for name, region in derivation.regions.items():
        for point in (*region.folds, *region.branch_points, *region.hopf):
            if not point.equations:
                yield name, point


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", NAMES)
def test_every_printed_point_is_one_where_its_conditions_hold(name):
    derivation, generator = derived(name), np.random.default_rng(14)
    for region, point in points_of(derivation):
        found = derivation[region]
        for _ in range(TRIALS):
            values = random_values(point, derivation, generator)
            place = placed(point, values)
            if not real_place(place) or point.exists.subs(values) != sp.true:
                continue
            residuals = numbers(found.rates.values(), place)
            size = max(1, *(abs(v) for v in place.values()))
            assert max(map(abs, residuals)) < 1e-15 * size**6
            matrix = np.array(found.jacobian.subs(place).evalf(25), dtype=complex)
            eigenvalues = np.linalg.eigvals(matrix)
            largest = max(1.0, np.abs(matrix).max())
            if point.code == "HB":
                pairs = [
                    abs(one + other)
                    for k, one in enumerate(eigenvalues)
                    for other in eigenvalues[k + 1 :]
                    if abs(one.imag) > 1e-7 * largest
                ]
                assert pairs, "an imaginary pair"
                assert min(pairs) < 1e-6 * largest
            else:
                assert np.abs(np.linalg.det(matrix)) < 1e-8 * largest ** len(matrix)
            break


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", NAMES)
def test_every_printed_boundary_equilibrium_is_one(name):
    derivation, generator = derived(name), np.random.default_rng(7)
    functions = {n: i.function for n, i in model(name).interfaces.items()}
    for point in derivation.boundary_equilibria:
        assert not point.equations
        seen = 0
        for _ in range(TRIALS):
            values = random_values(point, derivation, generator)
            place = placed(point, values)
            if not real_place(place) or point.admissible.subs(values) != sp.true:
                continue
            rates = derivation[point.regions[0]].rates.values()
            h = functions[point.interface]
            size = max(1, *(abs(v) for v in place.values()))
            assert max(map(abs, numbers([*rates, h], place))) < 1e-15 * size**4
            seen += 1
        assert seen, f"{point} is printed, but no values fulfil its conditions"


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", [*NAMES, "two_inertias"])
def test_lines_are_short_and_nothing_is_decided_that_is_printed_as_open(name):
    derivation = derived(name)
    lines = derivation.summary().splitlines()
    assert max(map(len, lines)) <= 200
    assert not any("False" in line or "True" in line for line in lines)
    assert len(derivation.to_latex()) > 0


def test_saturated_duty_needs_a_condition_on_parameters():
    (_, point) = derived("boost_converter").boundary_equilibria
    assert point.parameters == {"V_in": 0, "V_ref": 1 / real("k")}
    assert "V_ref = 1/k" in derived("boost_converter").summary()
    assert "i arbitrary" in derived("boost_converter").summary()


@pytest.mark.sample(0)
def test_no_boundary_equilibrium_with_a_root_of_a_negative_number():
    assert derived("wheelset").boundary_equilibria == ()


@pytest.mark.sample(0)
def test_the_frozen_quantity_is_solved_for_at_hopf_points():
    assert [list(p.parameters) for p in derived("wheelset")["S2"].hopf] == [["V"], ["V"]]
    ky, conicity, r0 = map(real, ("k_y", "lambda", "r_0"))
    speed = derived("wheelset")["S2"].hopf[0].parameters["V"]
    assert sp.simplify(speed**2 - ky * r0 / conicity) == 0


def test_the_frozen_quantity_is_solved_for_first():
    for form in derived("toggle_switch")["S1"].equilibria:
        assert list(form.parameters) == ["I"]
        assert form.verified


def test_another_parameter_on_request():
    (point,) = fs.derive(model("rosenzweig_macarthur"), parameter="a")["S1"].hopf
    assert list(point.parameters) == ["a"]
    h, e, m, capacity = map(real, "hemK")
    expected = (e + h * m) / (capacity * h * (e - h * m))
    assert sp.simplify(point.parameters["a"] - expected) == 0
    form = fs.derive(model("toggle_switch"), parameter=sp.Symbol("alpha_1"))["S1"].equilibria[0]
    assert list(form.parameters) == ["alpha_1"]
    with pytest.raises(UnknownNameError, match="did you mean 'alpha_1'"):
        fs.derive(model("toggle_switch"), parameter="alpha1")


def test_textbook_hopf_of_predator_and_prey():
    (hopf,) = derived("rosenzweig_macarthur")["S1"].hopf
    a, h, e, m = map(real, "ahem")
    assert sp.simplify(hopf.parameters["K"] - (e + h * m) / (a * h * (e - h * m))) == 0
    assert hopf.check == "exact"
    assert hopf.state["y"] != 0, "the neutral saddle without predators is no Hopf point"


@pytest.mark.sample(0)
def test_a_minimum_leaves_short_forms():
    second = derived("sir_with_capacity")["S2"].equilibria[1]
    d, g, eps, r, rate = map(real, ("d", "gamma", "epsilon", "r", "lambda"))
    assert second.state["S"] == (d + g + eps + r) / rate


def test_the_clarke_weight_has_a_name_of_its_own():
    (point,) = derived("quantity_named_q").boundary_equilibria
    assert point.clarke.weight != real("q")
    assert point.clarke.weight.name in derived("quantity_named_q").summary()


@pytest.mark.parametrize("numbers", [True, False])
def test_nested_maxima_keep_their_form(numbers):
    world = field_models.daisyworld(numbers=numbers)
    assert all(len(name) <= 40 for name in world.interfaces)
    assert all(len(str(i.function)) < 400 for i in world.interfaces.values())
    assert all(world.continuous.values())
    assert len(world.regions) == 8


def test_a_diagram_of_nested_maxima():
    world = field_models.daisyworld(numbers=True)
    diagram = fs.continue_equilibria(world, "L", over=(0.9, 1.1))
    assert diagram.completeness == "complete"
    (both,) = [p for p in diagram.at(L=1.0, stable=True) if p.state[0] > 1e-3 and p.state[1] > 1e-3]
    place = {real("L"): 1.0, real("a_w"): both.state[0], real("a_b"): both.state[1]}
    rates = world.rates.values()
    assert [float(e.subs(place)) for e in rates] == pytest.approx([0, 0], abs=1e-12)


def test_two_inertias_have_a_rigid_body_mode():
    fast = model("two_inertias")
    (free,) = free_directions(fast)
    n = real("N")
    assert free.shift == {"theta_o": 1, "theta_i": n}
    twist, speed = free.combinations.values()
    assert sp.simplify(twist - (real("theta_o") - real("theta_i") / n)) == 0
    assert sp.simplify(speed - (real("v_o") - real("v_i") / n)) == 0
    derivation = derived("two_inertias")
    assert derivation.boundary_equilibria == (), "T_m > 0 contradicts w = 0 and w = T_m"
    assert derivation["S2"].continua == ()
    assert "reduce_states" in derivation.summary()
    with pytest.raises(ModelError, match="reduce_states"):
        fs.equilibria(fast, w=10)
    diagram = fs.continue_equilibria(fast, "w", over=(0, 20))
    assert diagram.branches == ()
    assert "reduce_states" in str(diagram.outcome)
    assert not diagram.outcome


def test_the_reduction_that_is_offered_has_isolated_equilibria():
    fast = model("two_inertias")
    (free,) = free_directions(fast)
    rates = fs.reduce_states(fast.rates, free.combinations)
    used = set().union(*(e.free_symbols for e in rates.values()))
    values = {n: v for n, v in fast.parameters.items() if real(n) in used}
    law_of_load = {"w": sp.sin(field_models.t)}
    twist = Model(rates, forcing=law_of_load, parameters=values).frozen()
    assert free_directions(twist) == ()
    assert len(fs.equilibria(twist, w=10)) == 1


@pytest.mark.parametrize("seed", range(4))
def test_random_chains_of_masses_have_their_shift(seed):
    generator = np.random.default_rng(seed)
    count = int(generator.integers(2, 5))
    xs, vs = sp.symbols(f"x0:{count}"), sp.symbols(f"v0:{count}")
    rates = {}
    for k in range(count):
        force = -sum(
            (xs[k] - xs[j]) + sp.Rational(int(generator.integers(1, 5))) * (xs[k] - xs[j]) ** 3
            for j in (k - 1, k + 1)
            if 0 <= j < count
        )
        rates |= {xs[k]: vs[k], vs[k]: force}
    (free,) = free_directions(Model(rates))
    assert set(free.shift.values()) == {1}
    assert set(free.shift) == {str(x) for x in xs}
    # one mass held to the ground takes it away
    rates[vs[0]] -= xs[0]
    assert free_directions(Model(rates)) == ()
