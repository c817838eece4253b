"""Source files for other programs: executed, compiled or parsed back."""

import math
import re
import shutil
import subprocess
from itertools import product

import mpmath
import numpy as np
import pytest
import sympy as sp

from fastslow.errors import ArgumentError, ModelError, UnknownNameError
from fastslow.exporters.formats import export
from fastslow.exporters.xpp import XPP_STEP, _in_order
from fastslow.model.known_functions import ELEMENTARY
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.simulation.one import simulate
from tests.symbolic.symbolic_models import auto_ab, gear, lorenz


def run(text):
    space = {}
    exec(compile(text, "exported", "exec"), space)
    return space


@pytest.mark.parametrize("model", [gear().frozen(), lorenz(), auto_ab().frozen()])
def test_numpy_source_gives_the_rates(model):
    for region in model.regions:
        space = run(export(model, "numpy", region=region)[f"{region}.py"])
        state = np.linspace(0.3, 0.7, len(model.states))
        parameters = {**space["PARAMETERS"], **dict.fromkeys(model.free, 0.4)}
        at = dict(zip(map(sp.Symbol, model.states), state, strict=True)) | {
            sp.Symbol(n): v for n, v in parameters.items()
        }
        named = {s.name: v for s, v in at.items()}
        expected = [
            float(e.subs({s: named[s.name] for s in e.free_symbols}))
            for e in model.regions[region].rates.values()
        ]
        assert space["rates"](0.0, state, parameters) == pytest.approx(expected, rel=1e-14)
        slope = np.empty((len(state), len(state)))
        for k, step in enumerate(1e-6 * np.eye(len(state))):
            upper = space["rates"](0.0, state + step, parameters)
            slope[:, k] = (upper - space["rates"](0.0, state - step, parameters)) / 2e-6
        assert space["jacobian"](0.0, state, parameters) == pytest.approx(slope, abs=1e-7)


def test_numpy_source_holds_the_forcing():
    space = run(export(gear(), "numpy", region="S2")["S2.py"])
    load = 2.372 + 3.546 * np.sin(0.01 * 30)
    assert space["rates"](30.0, [0.1, 0.2])[1] == pytest.approx(load - 0.2, rel=1e-15)
    assert space["interfaces"](0.0, [0.1, 0.2]) == pytest.approx([-0.15, 0.35])
    assert space["SIGNS"] == {"x - D": -1, "x + D": 1}


def test_xpp_file_parsed_back():
    fast = gear().frozen()
    text = export(fast, "xpp", region="S1", values={"w": 0.5})["S1.ode"]
    assert text.rstrip().endswith("done")
    lines = text.splitlines()
    parameters = dict(re.fullmatch(r"par (\w+)=(.*)", s).groups() for s in lines if s[:4] == "par ")
    assert {n: float(v) for n, v in parameters.items()} == {"w": 0.5, "A": 41.67, "D": 0.25}
    rates = dict(re.fullmatch(r"(\w+)'=(.*)", s).groups() for s in lines if "'=" in s)
    real = {s.name: s for s in fast.regions["S1"].rates["v"].free_symbols}
    for name, written in rates.items():
        back = sp.sympify(written.replace("^", "**"), locals=real)
        assert sp.expand(back - fast.regions["S1"].rates[name]) == 0


def test_xpp_names_are_apart_without_case():
    d, D, lam = sp.symbols("d D lambda")
    text = export(Model({d: D - lam * d}, parameters={D: 1, lam: 2}), "xpp")["S1.ode"]
    names = re.findall(r"^(?:par )?(\w+)'?=", text, flags=re.M)
    assert len({n.lower() for n in names}) == len(names) == 3


def test_auto_files():
    files = export(gear().frozen(), "auto", region="S1", state={"x": 0.26})
    assert set(files) == {"S1.f90", "c.S1"}
    source = files["S1.f90"]
    assert source.count("END SUBROUTINE") == 6
    assert all(len(line) <= 132 for line in source.splitlines())
    assert "F(1) = U(2)" in source
    assert "PAR(2) = 41.67d0 ! A" in source
    constants = files["c.S1"]
    assert "NDIM = 2" in constants
    assert "1: 'w'" in constants


def test_constants_are_numbers_in_auto():
    x = sp.Symbol("x")
    source = export(Model({x: sp.sin(sp.pi * x) - x}), "auto")["S1.f90"]
    assert "  F(1) = -U(1) + sin(3.1415926535897932d0*U(1))" in source
    assert "parameter" not in source


def test_auto_leaves_its_own_parameters_alone():
    x = sp.Symbol("x")
    many = sp.symbols("k0:12")
    model = Model({x: sum(many) - x}, parameters=dict.fromkeys(many, 1.0))
    used = set(map(int, re.findall(r"PAR\((\d+)\)", export(model, "auto")["S1.f90"])))
    assert used == {*range(1, 10), 15, 16, 17}


@pytest.mark.skipif(shutil.which("gfortran") is None, reason="gfortran is not installed")
@pytest.mark.parametrize("model", [gear().frozen(), lorenz(), auto_ab().frozen()])
def test_auto_source_compiles(model, tmp_path):
    export(model, "auto", tmp_path, region="S1")
    subprocess.run(
        ["gfortran", "-c", "-Wall", "S1.f90", "-o", "S1.o"], cwd=tmp_path, check=True, timeout=60
    )


#: Smooth rates with each elementary function, and a state inside its domain.
BEYOND_ONE = {sp.acosh, sp.acoth, sp.asec, sp.acsc}
ELEMENTARY_RATES = [
    (f(*sp.sympify(["x", "y + 2"][: ELEMENTARY[f].arguments])), state)
    for f, state in ((f, 2.3 if f in BEYOND_ONE else 0.3) for f in ELEMENTARY)
]


def of_rate(function, state):
    """The function at (x, y) = (state, 0.4), to 30 digits, and its slope by x."""
    x, y = sp.symbols("x y")
    made = [sp.lambdify((x, y), e, "mpmath") for e in (function, function.diff(x))]
    return [float(one(mpmath.mpf(state), mpmath.mpf(0.4))) for one in made]


@pytest.mark.parametrize(("function", "state"), ELEMENTARY_RATES, ids=str)
def test_every_program_has_every_elementary_function(function, state):
    x, y = sp.symbols("x y")
    model = Model({x: function, y: -y})
    value, slope = of_rate(function, state)
    space = run(export(model, "numpy")["S1.py"])
    assert space["rates"](0, [state, 0.4])[0] == pytest.approx(value, rel=1e-14)
    assert space["jacobian"](0, [state, 0.4])[0, 0] == pytest.approx(slope, rel=1e-13)
    lines = export(model, "xpp")["S1.ode"].splitlines()
    (rate,) = (line.removeprefix("x'=") for line in lines if line.startswith("x'="))
    known = {"ln": sp.log, "x": sp.Float(state), "y": sp.Float(0.4)}
    names = set(re.findall(r"[a-z]\w*(?=\()", rate))
    assert names <= XPP_FUNCTIONS, rate
    assert float(sp.sympify(rate.replace("^", "**"), known)) == pytest.approx(value, rel=1e-13)
    source = re.sub(r"&\n\s*", "", export(model, "auto")["S1.f90"])
    known = {**vars(math), "U": {1: state, 2: 0.4}.__getitem__}
    for target, expected in (("F(1)", value), ("DFDU(1,1)", slope)):
        (written,) = re.findall(rf"^ *{re.escape(target)} = (.*)$", source, re.MULTILINE)
        text = re.sub(r"(?<=\d)d(?=[-\d])", "e", written)
        assert set(re.findall(r"[a-z]\w*(?=\()", text)) <= FORTRAN_FUNCTIONS, written
        assert eval(text, known) == pytest.approx(expected, rel=1e-13), written


#: Functions of XPPAUT (its manual, section on ODE files) and of Fortran 2008.
COMMON = re.findall(r"\w+", "sin cos tan asin acos atan atan2 sinh cosh tanh exp sqrt erf erfc")
XPP_FUNCTIONS = {*COMMON, "ln", "abs", "sign"}
FORTRAN_FUNCTIONS = {*COMMON, "log", "asinh", "acosh", "atanh"}


def test_names_of_functions_are_no_identifiers():
    erf, x = sp.symbols("erf x")
    model = Model({x: sp.erf(x) - erf * sp.asin(x)}, parameters={erf: 2})
    space = run(export(model, "numpy")["S1.py"])
    assert space["rates"](0, [0.5]) == pytest.approx([math.erf(0.5) - 2 * math.asin(0.5)])
    assert "x'=-erf_2*asin(x) + erf(x)" in export(model, "xpp")["S1.ode"]


def test_files_are_written(tmp_path):
    written = export(gear().frozen(), "numpy", tmp_path / "out")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["S1.py", "S2.py", "S3.py"]
    assert (tmp_path / "out" / "S2.py").read_text(encoding="utf-8") == written["S2.py"]


def test_bad_requests():
    with pytest.raises(UnknownNameError, match="did you mean 'numpy'"):
        export(gear(), "nunpy")
    with pytest.raises(UnknownNameError):
        export(gear(), "numpy", region="S9")
    with pytest.raises(UnknownNameError):
        export(gear(), "numpy", state={"y": 1})
    with pytest.raises(ArgumentError, match="frozen"):
        export(gear(), "auto")
    x = sp.Symbol("x")
    with pytest.raises(ArgumentError, match="gamma"):
        export(Model({x: -sp.gamma(x)}), "xpp")


def test_names_stay_in_their_comments():
    name = '"""\nimport os\n"""\\'
    state = sp.Symbol(name)
    model = Model({state: -state})
    (source,) = export(model, "numpy").values()
    space = {}
    exec(source, space)
    assert "os" not in space
    assert space["STATES"] == (name,)
    for target in ("xpp", "auto"):
        for text in export(model, target).values():
            assert not any(line.strip() == "import os" for line in text.splitlines())


def test_xpp_files_contain_events():
    x, v, t, T, r, q = sp.symbols("x v t T r q")
    model = Model(
        {x: v, v: q - x + sp.Mod(t, T)},
        parameters={T: 2, r: 0.6},
        resets={x >= 1: {v: -r * v}, sp.Eq(sp.Mod(t, T), 0): {x: x + 3, v: v / 2}},
        switches={q: (2 * x < -1, x > 0)},
    )
    lines = export(model, "xpp", state={"x": -2})["S1.ode"].splitlines()
    assert "v'=q + t - x - (T_2*flr(t/T_2))" in lines
    assert {"q'=0", "init q=1.0", "next0'=0", "init next0=2.0"} <= set(lines)
    events = [line for line in lines if line.startswith("global")]
    assert events == [
        "global 1 {x - 1} {v=-r*v}",
        "global 1 {t-next0} {x=x + 3;v=v/2;next0=next0+T_2}",
        "global 1 {-2*x - 1} {q=1}",
        "global 1 {x} {q=0}",
    ]
    given = export(model, "xpp", state={"x": -2, "q": 0})["S1.ode"]
    assert "init q=0.0" in given


def assigned(jump, start):
    """The state after the assignments of an event, one after the other."""
    state = dict(start)
    for name, expression in _in_order(jump):
        state[name] = expression.subs({real(n): v for n, v in state.items()})
    return {name: state[name] for name in start}


def test_assignments_in_order_have_the_effect_of_all_at_once():
    """Every pattern of dependence between three values: without, in chains and in cycles."""
    names, numbers = ("x", "y", "z"), np.array([2, 3, 5])
    start = dict(zip(names, (7, 11, 13), strict=True))
    symbols = [real(n) for n in names]
    for pattern in product((0, 1), repeat=9):
        rows = np.reshape(pattern, (3, 3))
        jump = {
            n: sp.Integer(i) + sum(int(k) * s for k, s in zip(row * numbers, symbols, strict=True))
            for i, (n, row) in enumerate(zip(names, rows, strict=True))
        }
        before = dict(zip(symbols, start.values(), strict=True))
        at_once = {n: e.subs(before) for n, e in jump.items()}
        assert assigned(jump, start) == at_once
        graph = rows * (1 - np.eye(3, dtype=int))
        if not np.linalg.matrix_power(graph, 3).any():
            assert len(_in_order(jump)) == 3  # without a cycle, nothing is kept


#: Resets that read each other's states, a forcing, a clock whose instants end steps of 0.05.
EVENTS = (
    ({"x": 1, "y": 0, "z": "-y"}, {"x >= 1": {"x": "y - 2", "y": "x"}}, {}),
    ({"x": 1, "y": 0, "z": 0.5}, {"x >= 1": {"x": "z - 2", "y": "x - y", "z": "y/4"}}, {}),
    ({"x": 1, "y": "z", "z": 0}, {"x >= 1": {"x": "x - 2", "z": "x + y", "y": "z - x"}}, {}),
    ({"x": 1, "y": "w/10", "z": 0}, {"x >= 1": {"x": 0, "y": "w", "z": "y + w"}}, {"w": "sin(t)"}),
    ({"x": 1, "y": 0, "z": "y"}, {"x + w >= 1": {"x": -1, "y": "x"}}, {"w": "t/7"}),
    ({"x": 1, "y": 0, "z": "y"}, {"Eq(Mod(t, 1), 0)": {"x": "y", "y": "x"}}, {}),
)


@pytest.mark.skipif(shutil.which("xppaut") is None, reason="xppaut is not installed")
@pytest.mark.parametrize(("rates", "resets", "forcing"), EVENTS)
def test_events_in_xppaut(tmp_path, rates, resets, forcing):
    """XPPAUT interpolates events linearly, and writes seven digits."""
    model = Model(rates, resets=resets, forcing=forcing)
    start = {"x": 0, "y": 0.3, "z": 0.1}
    export(model, "xpp", tmp_path, state=start)
    command = ["xppaut", "S1.ode", "-silent", "-outfile", "out.dat"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=60, capture_output=True)
    rows = np.loadtxt(tmp_path / "out.dat", usecols=range(1, 4), max_rows=150)
    times = XPP_STEP * np.arange(150)
    run = simulate(model, [start[n] for n in model.states], t=(0, times[-1]), samples=times)
    away = np.abs(rows - np.column_stack([run[n] for n in model.states]))
    assert away.max() < 2e-3 if forcing else away.max() < 1e-5


def test_clocks_in_numpy_source():
    x, t, T = sp.symbols("x t T")
    model = Model({x: sp.Mod(t, T) - x}, parameters={T: 2})
    rates = run(export(model, "numpy")["S1.py"])["rates"]
    assert rates(3.5, [0.25]) == pytest.approx([1.25])


@pytest.mark.parametrize("target", ["numpy", "auto"])
def test_events_are_refused_where_the_target_has_none(target):
    x, v, q, t = sp.symbols("x v q t")
    walled = Model({x: v, v: -x}, resets={x >= 1: {v: -v}})
    with pytest.raises(ModelError, match=f"export to {target} would ignore the reset"):
        export(walled, target)
    relay = Model({x: q - x}, switches={q: (x < -1, x > 1)})
    with pytest.raises(ModelError, match=f"export to {target} would ignore the changes"):
        export(relay, target)
    with pytest.raises(ModelError, match="clock"):
        export(Model({x: sp.floor(t) - x}), "auto")
