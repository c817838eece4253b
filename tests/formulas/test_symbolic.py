"""Formulas as SymPy expressions: the same as written in SymPy, and nothing that it writes out."""

import pytest
import sympy as sp

import fastslow as fs
from fastslow.formulas.functions import FUNCTIONS
from fastslow.formulas.symbolic import read

x, v, k, D = sp.symbols("x v k D", real=True)


def symbol(name):
    return sp.Symbol(name, real=True)


@pytest.mark.parametrize(
    "expression",
    [
        x**2 + v,
        2 * (x + v) * k / 3 - sp.Float("0.1"),
        sp.Piecewise((x - D, x > D), (x + D, (x < -D) & (v > 0)), (0, True)),
        sp.Abs(x) * sp.sign(v) + sp.Heaviside(x - D) - sp.Max(x, v, 0) + sp.Min(x, v),
        sp.sqrt(x**2 + 1) ** sp.Rational(1, 3) * sp.exp(-x) / sp.pi,
        sp.atan2(x, v) + sp.log(x, 2) + sp.besselj(0, x) + sp.LambertW(x, -1),
        (x > D) & (v <= 0) | sp.Eq(x, v) | ~sp.Ne(x, k),
        sp.Mod(k, 2) + sp.floor(k) + sp.frac(k),
        sp.Piecewise((x, x > 1e-5), (sp.Float("1.5e10"), True)),
        sp.S.EulerGamma * 0 + sp.E**x,
    ],
)
def test_what_sympy_prints_is_read_as_it_was(expression):
    assert read(str(expression), symbol) == expression


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_every_function_is_there(name):
    if name == "Piecewise":
        return
    function = FUNCTIONS[name]
    arguments = ["x", "v"][: function.least]
    made = read(f"{name}({', '.join(arguments)})", symbol)
    assert made == getattr(sp, function.symbolic)(*map(symbol, arguments))


def test_decimals_are_floats_or_fractions():
    assert read("0.1*x", symbol) == sp.Float("0.1") * x
    assert read("0.1*x", symbol, exact=True) == x / 10
    assert read("3/2", symbol) == sp.Rational(3, 2)


def test_a_given_name_hides_a_constant():
    assert read("E*x", symbol) == sp.E * x
    assert read("E*x + pi", symbol, {"E", "x"}) == symbol("E") * x + sp.pi
    assert read("beta*lambda*S*N", symbol) == sp.prod(map(symbol, ["beta", "lambda", "S", "N"]))
    # a name that is no identifier is read where it stands alone
    assert read("x - D", symbol, {"x - D"}) == symbol("x - D")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("10**10**10", r"the exponent 10\*\*10 is larger than 64 in size"),
        ("(x**8)**9", "has the degree 72; expected at most 64"),
        ("x*" * 64 + "x", "has the degree 65"),
        ("10**64 * 10**64 * 10**64 * 10**64 * 10**64 * x", "has no finite real value"),
        ("x/0", "'x/0' has no finite real value"),
        ("x + 1/0", "'1/0' has no finite real value"),
        ("exp(exp(exp(100)))*x", "has no finite real value"),
        ("sqrt(-1)*x", "has no finite real value"),
        ("zeta(1)", "has no finite real value"),
        ("gamma(10**9)", r"gamma is given '10\*\*9'; expected a number of at most 64"),
        ("uppergamma(100000, x)", "uppergamma is given '100000'"),
        ("sqrt(-2 - x**2) > 0", "SymPy cannot read it"),
        ("Mod(x, 0)", "Modulo by zero"),
    ],
)
def test_what_sympy_would_write_out_or_not_read_is_refused(text, reason):
    with pytest.raises(fs.ArgumentError, match=reason):
        read(text, symbol)


def test_equations_as_text():
    text = fs.Model(
        {"x": "v", "v": "w - v - (x**2 + A)*Piecewise((x - D, x > D), (x + D, x < -D), (0, True))"},
        forcing={"w": "B + C*sin(omega*t)"},
        parameters={"A": 41.67, "B": 2.372, "C": 3.546, "D": 0.25, "omega": 0.01},
        regions={"upper": "x > D", "gap": "(x < D) & (x > -D)"},
    )
    gear = fs.systems.harmonic_gear()
    assert list(text.regions) == ["upper", "gap", "S1"]
    assert list(text.interfaces) == list(gear.interfaces)
    for mine, theirs in zip(text.regions.values(), gear.regions.values(), strict=True):
        assert mine.signs == theirs.signs


@pytest.mark.parametrize(
    "call",
    [
        lambda text: fs.Model({"x": f"-x + len({text})"}),
        lambda text: fs.Model({"x": "-x"}, forcing={"w": text}),
        lambda text: fs.Model({"x": "-x"}, slow={"w": text}),
        lambda text: fs.Model({"x": "-Abs(x)"}, interfaces={"edge": text}),
        lambda text: fs.Model({"x": "-Abs(x)"}, regions={"inside": text}),
        lambda text: fs.Model({"x": "sin(x)"}, periodic={"x": text}),
        lambda text: fs.Model({"x": "w - x"}, forcing={"w": "t"}).frozen({"w": text}),
        lambda text: fs.reduce_states({"x": text}, {"u": "x"}),
        lambda text: fs.compare_scalings({"A": text}, {"A": "k"}),
    ],
)
def test_text_is_never_run(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fs.ModelError, match="is not an expression"):
        call("open('canary', 'w')")
    assert list(tmp_path.iterdir()) == []


def test_names_are_compared_as_python_compares_them():
    model = fs.Model({"µ": "-ℌ*μ"}, parameters={"H": 2})
    assert model.states == ("μ",)
    assert model.rates["µ"] == -2 * symbol("μ") * symbol("H") / 2
    assert model.parameters["ℌ"] == model.with_parameters({"ℌ": 2}).parameters["H"] == 2.0
    with pytest.raises(fs.ModelError, match="is both a state and a state"):
        fs.Model({"µ": "1", "μ": "2"})


@pytest.mark.parametrize("name", ["", " ", "\ud800"])
def test_names_that_cannot_be_written_are_refused(name):
    with pytest.raises(fs.ModelError, match="expected a name of letters, such as x"):
        fs.Model({name: 1})


def test_a_remainder_of_one_in_a_product():
    state, rate = sp.symbols("x k")
    model = fs.Model({state: -sp.frac(rate) * state}, parameters={rate: 2.5})
    assert fs.simulate(model, [1.0], t=(0, 1))(1.0) == pytest.approx(sp.exp(-0.5).evalf())
