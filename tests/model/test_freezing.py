"""The fast subsystem, periods, and immutability."""

import math
import pickle

import pytest
import sympy as sp

from fastslow import (
    Model,
    ModelError,
    Tabulated,
    UnknownNameError,
    continue_equilibria,
    equilibria,
    simulate,
)
from fastslow.model.equations import read_expression

x, y, v, t, w, z, g = sp.symbols("x y v t w z g")
A, C, D, omega = sp.symbols("A C D omega")


def forced(law, **values):
    return Model({x: w - x}, forcing={w: law}, parameters=values)


def test_parameters_of_the_law_leave(gear):
    fast = gear.frozen()
    assert fast.free == ("w",)
    assert set(fast.parameters) == {"A", "D"}
    assert list(fast.regions) == ["S1", "S2", "S3"]
    assert fast.period() is None


def test_a_value_for_the_slow_quantity(gear):
    assert gear.frozen().with_parameters(w=0.5).parameters["w"] == 0.5
    with pytest.raises(UnknownNameError, match="unknown parameter 'omega'"):
        gear.frozen().with_parameters(omega=0.5)


def test_slow_states_freeze():
    model = Model({x: y - x**3 / 3 + x}, slow={y: A * (D - x)}, parameters={A: 0.01, D: 0})
    assert model.frozen().free == ("y",)
    assert dict(model.frozen().parameters) == {}


def test_freezing_along_a_path():
    u1, u2 = sp.symbols("u1 u2")
    model = Model(
        {x: u1 + u2 * x - x**3},
        forcing={u1: sp.cos(2 * omega * t), u2: sp.cos(omega * t)},
        parameters={omega: 0.01},
    )
    assert model.frozen().free == ("u1", "u2")
    fast = model.frozen(slow={u1: 2 * g**2 - 1, u2: g})
    assert fast.free == ("g",)
    expected = 2 * g**2 - 1 + g * x - x**3
    assert sp.expand(sp.sympify(str(fast.rates["x"])) - expected) == 0
    with pytest.raises(UnknownNameError, match="unknown slow quantity 'u3'; did you mean"):
        model.frozen(slow={"u3": g})


def test_time_in_a_rate_cannot_be_frozen():
    with pytest.raises(ModelError, match="the rate of x depends on time explicitly"):
        Model({x: sp.sin(t) - x}).frozen()


@pytest.mark.parametrize(
    ("law", "period"),
    [
        (sp.sin(omega * t), 2 * math.pi / 0.1),
        (1 + sp.sin(omega * t) ** 2, math.pi / 0.1),
        (sp.sin(2 * omega * t) + sp.cos(3 * omega * t), 2 * math.pi / 0.1),
        (sp.sin(omega * t) * sp.sin(3 * omega * t), math.pi / 0.1),
        (sp.Abs(sp.sin(omega * t)), 2 * math.pi / 0.1),
        (sp.exp(sp.sin(omega * t)), 2 * math.pi / 0.1),
        (omega * t, None),
        (sp.sin(t) + sp.sin(sp.sqrt(2) * t), None),
        (sp.sin(t**2), None),
        (omega, None),
    ],
)
def test_period(law, period):
    found = forced(law, omega=0.1).period()
    assert found is None if period is None else found == pytest.approx(period, rel=1e-13)


def test_nothing_can_be_changed(gear):
    with pytest.raises(AttributeError):
        gear.states = ("y",)
    with pytest.raises(TypeError):
        gear.parameters["A"] = 2
    changed = gear.with_parameters({D: 0.5}, A=1)
    assert (changed.parameters["D"], changed.parameters["A"]) == (0.5, 1.0)
    assert (gear.parameters["D"], gear.parameters["A"]) == (0.25, 41.67)


def test_a_model_can_be_sent_to_another_process(gear):
    again = pickle.loads(pickle.dumps(gear))
    assert repr(again) == repr(gear)
    assert again.regions["S1"].rates == gear.regions["S1"].rates


def test_freezing_keeps_region_names():
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    model = Model(
        {x: w - gap},
        forcing={w: sp.sin(t)},
        parameters={D: 1},
        regions={"gap": sp.And(x < D, x > -D)},
    )
    assert list(model.regions) == list(model.frozen().regions) == ["S1", "gap", "S2"]


def driven(**laws):
    """A model with the given laws, each a term of the rate of x, and a slow load w = ω t."""
    return Model(
        {x: w - x + sum(sp.Symbol(name) for name in laws)},
        forcing={**laws, w: omega * t},
        parameters={omega: 0.001, A: 1.5},
    )


def test_a_fast_forcing_remains_a_function_of_time():
    model = driven(k=sp.cos(A * t))
    fast = model.frozen(fast=["k"])
    assert (fast.free, list(fast.forcing)) == (("w",), ["k"])
    assert dict(fast.parameters) == {"A": 1.5}
    assert fast.period() == pytest.approx(2 * math.pi / 1.5, rel=1e-15)
    assert fast.frozen(fast=["k"]) == fast
    assert model.frozen(fast=[sp.Symbol("k"), "k"]) == fast
    assert model.frozen().free == ("k", "w")


def test_a_frozen_model_with_a_fast_forcing_and_a_ramp_is_the_full_model():
    again = driven(k=sp.cos(A * t)).frozen(fast=["k"]).with_ramp("w", 0.001)
    assert set(again.forcing) == {"k", "w"}


def test_time_in_a_rate_remains():
    model = Model({x: w - x + sp.cos(t)}, forcing={w: omega * t}, parameters={omega: 0.001})
    fast = model.frozen(fast=["t"])
    assert fast.equations == "x' = w - x + cos(t)"
    assert (fast.free, fast.period()) == (("w",), 2 * math.pi)


SHARE = sp.Rational(3, 5)

#: Rectangular, sawtooth and measured stiffnesses of the period 2, but for the last.
PERIODIC = {
    "Mod": (sp.Piecewise((A, sp.Mod(t, 2) < 2 * SHARE), (1, True)), 2.0),
    "Mod with a phase": (sp.Piecewise((A, sp.Mod(t - sp.Rational(1, 3), 2) < 1), (1, True)), 2.0),
    "floor": (A * (sp.floor(t / 2) - sp.floor(t / 2 - SHARE)), 2.0),
    "floor beside time": (A * (t / 2 - sp.floor(t / 2)) ** 2, 2.0),
    "floor of a condition": (
        sp.Piecewise((A, t - 2 * sp.floor(t / 2) < 1), (1, True)),
        2.0,
    ),
    "ceiling": (1 + sp.ceiling(A * t) - A * t, 1 / 1.5),
    "frac": (sp.Piecewise((A, sp.frac(t / 2) < SHARE), (1, True)), 2.0),
    "sawtooth and sine": (A * sp.Mod(t, 2) + sp.sin(2 * sp.pi * t / 3), 6.0),
    "two sawtooths": (sp.Mod(t, 2) * sp.Mod(t, A), 6.0),
    "sign": (sp.sign(sp.sin(sp.pi * t)), 2.0),
    **{
        f"{kind} table": (
            Tabulated([0, 0.5, 1, 1.5, 2], [1, 2, 3, 2, 1], interpolation=kind, periodic=True),
            2.0,
        )
        for kind in ("linear", "cubic", "previous")
    },
}


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", PERIODIC)
def test_clocks_and_periodic_tables_remain_as_fast_terms(name):
    law, period = PERIODIC[name]
    parameters = {omega: 0.001}
    if isinstance(law, sp.Basic) and A in law.free_symbols:
        parameters[A] = 1.5
    k = sp.Symbol("k")
    model = Model({x: w - k * x}, forcing={k: law, w: omega * t}, parameters=parameters)
    fast = model.frozen(fast=["k"])
    assert (fast.free, list(fast.forcing)) == (("w",), ["k"])
    assert fast.period() == pytest.approx(period, rel=1e-14)
    alone = Model({x: sp.Rational(3, 10) - k * x}, forcing={k: law}, parameters=fast.parameters)
    runs = (simulate(one, [1], t=(3.7, 6.2)) for one in (fast.with_parameters(w=0.3), alone))
    first, second = (run["x"][-1] for run in runs)
    assert first == pytest.approx(second, rel=1e-11)
    if isinstance(law, sp.Basic):
        rates = Model({x: w - law * x}, forcing={w: omega * t}, parameters=parameters)
        assert rates.frozen(fast=["t"]).period() == pytest.approx(period, rel=1e-14)


def test_fast_with_a_path_and_slow_states():
    model = Model(
        {x: w + z - x + C},
        forcing={C: sp.cos(t), w: sp.cos(omega * t)},
        slow={z: -omega * z},
        parameters={omega: 0.001},
    )
    assert model.frozen(fast=[C]).free == ("w", "z")
    fast = model.frozen(slow={w: g, z: 2 * g}, fast=[C])
    assert fast.free == ("g",)
    assert fast.rates["x"] == read_expression("", "C + 3*g - x", "Cgx")
    with pytest.raises(ModelError, match=r"'w' is in slow= and in fast="):
        model.frozen(slow={w: g}, fast=[w])
    with pytest.raises(ModelError, match="'x' is a fast state already; expected slow states"):
        model.frozen(fast=["x"])


def test_slow_states_in_fast_remain_states():
    p, y = sp.symbols("p y")
    model = Model(
        {x: w + z + y - x}, forcing={w: sp.cos(t)}, slow={z: p - z, y: -y - x}, parameters={p: 2}
    )
    fast = model.frozen(fast=["y"])
    assert (fast.states, fast.slow_states, fast.free) == (("x", "y"), (), ("w", "z"))
    assert dict(fast.parameters) == {}
    assert model.frozen(fast=["z", "y"]).free == ("w",)
    forced = model.frozen(fast=["w", y])
    assert (forced.states, list(forced.forcing), forced.free) == (("x", "y"), ["w"], ("z",))
    assert model.frozen(slow={w: g, z: 2 * g}, fast=["y"]).free == ("g",)
    with pytest.raises(ModelError, match="'y' is in slow= and in fast="):
        model.frozen(slow={y: g}, fast=[y])
    with pytest.raises(UnknownNameError, match="unknown slow state or fast forcing 'q'"):
        model.frozen(fast=["q"])


def test_the_full_model_has_equilibria():
    p = sp.Symbol("p")
    model = Model({x: z - x}, slow={z: p - x * z}, parameters={p: 4})
    full = model.frozen(fast=["z"])
    assert {round(point["x"], 12) for point in equilibria(full)} == {-2.0, 2.0}
    diagram = continue_equilibria(full.with_free("p"), "p", over=(1, 4))
    assert diagram.at(p=2.25, stable=True)[0]["z"] == pytest.approx(1.5, abs=1e-12)


def test_interfaces_in_time_remain_where_fast_terms_switch():
    slow = sp.Piecewise((t, t < 5), (5, True))
    model = Model({x: w - x + sp.sign(sp.sin(t))}, forcing={w: slow})
    assert set(model.interfaces) == {"sin(t)", "t - 5"}
    assert list(model.frozen(fast=["t"]).interfaces) == ["sin(t)"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: driven(k=omega * t).frozen(fast=["k"]), r"k = omega\*t is not periodic in time"),
        (lambda: driven(k=omega).frozen(fast=["k"]), "k = omega does not depend on time"),
        (lambda: driven(k=sp.floor(t)).frozen(fast=["k"]), r"k = \(floor\(t\)\) is not periodic"),
        (
            lambda: driven(k=Tabulated([0, 1, 2], [1, 2, 1])).frozen(fast=["k"]),
            r"expected a table of one period, Tabulated\(..., periodic=True\)",
        ),
        (
            lambda: driven(k=sp.Mod(t, 1), v=sp.Mod(t, sp.sqrt(2))).frozen(fast=["k", "v"]),
            "the periods 1.41421356, 1 and no common one",
        ),
        (
            lambda: driven(k=sp.cos(t), v=sp.cos(sp.sqrt(2) * t)).frozen(fast=["k", "v"]),
            r"the periods 6\.28318531, 4\.44288294 and no common one",
        ),
        (
            lambda: Model({x: w - x + sp.cos(w * t)}, forcing={w: t}).frozen(fast=["t"]),
            "the frequency w of time in the rates depends on the slow quantity w",
        ),
        (
            lambda: Model({x: sp.sin(t) - x}).frozen(fast=["t"]),
            "all of t would remain, and no slow quantity is left to freeze",
        ),
        (
            lambda: Model({x: sp.sin(t) - x + w}, forcing={w: t}).frozen(),
            r'keep a fast periodic term by fast=\["t"\]',
        ),
    ],
)
def test_fast_terms_that_give_no_periodic_orbits(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def test_one_of_two_incommensurate_terms_may_be_fast():
    model = driven(k=sp.cos(t), v=sp.cos(sp.sqrt(2) * t))
    assert model.frozen(fast=["k"]).free == ("v", "w")


def test_a_model_with_a_fast_term_has_no_equilibria():
    fast = Model({x: sp.sin(t) - x + w}, forcing={w: t}).frozen(fast=["t"])
    with pytest.raises(ModelError, match="find_orbit computes its periodic orbits"):
        equilibria(fast, w=0.0)
