"""Models from files: the same runs bit for bit, without SymPy, and nothing else from a file."""

import copy
import json
import re
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.compiled import native, special
from fastslow.model.known_functions import CLOSED, ELEMENTARY, OPEN
from fastslow.results import arithmetic, files
from fastslow.results.storage import read_archive, write_archive
from tests.results.conftest import same

x, y, v, w, t, a, k, D = sp.symbols("x y v w t a k D")
GAP = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))


def gear():
    rates = {x: v, v: w - a * v - GAP}
    return fs.Model(rates, forcing={w: sp.cos(k * t)}, parameters={a: 0.1, k: 0.3, D: 0.5})


MODELS = {
    "gap": (gear(), [0.0, 0.0], {"D": 0.7, "k": 0.4}),
    "dry friction": (
        fs.Model({x: v, v: a * sp.sin(t) - x - sp.sign(v)}, parameters={a: 2.0}),
        [0.0, 1.0],
        {"a": 1.5},
    ),
    "several discontinuities": (
        fs.Model({x: y - sp.sign(x), y: -2 * sp.sign(y) - k * x}, parameters={k: 1.0}),
        [1.0, 0.5],
        {"k": 2.0},
    ),
    "no series": (
        fs.Model({x: v - sp.gamma(2 + x**2) * a, v: -x * v + sp.sign(x - 2)}, parameters={a: 0.1}),
        [0.1, 0.2],
        {"a": 0.2},
    ),
    "functions": (
        fs.Model(
            {
                x: -sp.log(2 + sp.sin(x * y)) + sp.sqrt(x**2 + a) / (1 + y**4),
                y: sp.exp(-(y**2)) * sp.tanh(a * x) - sp.atan2(y, 1 + x**2) + sp.airyai(x) / 3,
            },
            parameters={a: 1.3},
        ),
        [0.3, 0.4],
        {"a": 0.9},
    ),
    "slow state": (
        fs.Model({x: w + x - x**3}, slow={w: -a * x}, parameters={a: 0.05}),
        [1.0, 0.0],
        {"a": 0.1},
    ),
    "angle": (
        fs.Model({x: v, v: -sp.sin(x) - a * v + 1}, parameters={a: 0.2}, periodic={x: 2 * sp.pi}),
        [0.0, 2.0],
        {"a": 0.3},
    ),
    "states that vanish": (
        fs.Model({x: x * (a * sp.cos(t / 8) - y), y: y * (x - 1)}, parameters={a: 1.0}),
        [0.5, 2.0],
        {"a": 2.0},
    ),
}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("ending", [".npz", ".nc"])
def test_a_run_goes_on_from_a_file(name, ending, tmp_path):
    model, start, changes = MODELS[name]
    run = fs.simulate(model, start, t=(0, 20))
    run.save(tmp_path / f"run{ending}")
    again = fs.load(tmp_path / f"run{ending}")
    assert again == run
    stored = again.model
    assert stored.equations == model.equations
    assert same(fs.simulate(stored, start, t=(0, 20)), run)
    for method in ({"order": 12}, {"rtol": 1e-12}, {"implicit": False}):
        integration = fs.Integration(**method)
        one, other = (
            fs.simulate(
                m.with_parameters(changes), run.end[1:], t=(20, 30), integration=integration
            )
            for m in (model, stored)
        )
        assert same(one, other)


def test_what_is_loaded_can_be_saved_again(tmp_path):
    run = fs.simulate(gear(), [0, 0], periods=2)
    run.save(tmp_path / "run.npz")
    fs.load(tmp_path / "run.npz").save(tmp_path / "again.npz")
    assert (tmp_path / "run.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()
    fs.load(tmp_path / "run.npz").model.save(tmp_path / "model.npz")
    assert fs.load(tmp_path / "model.npz") == run.model.stored


def test_a_diagram_is_simulated_from(tmp_path):
    diagram = fs.continue_equilibria(gear().frozen(), "w", (-1, 1))
    diagram.save(tmp_path / "diagram.npz")
    again = fs.load(tmp_path / "diagram.npz")
    start = again.at(w=0.8)[0].state + 0.1
    with pytest.raises(fs.ArgumentError, match="w of this frozen model has no value"):
        fs.simulate(again.model, start, t=(0, 10))
    one, other = (
        fs.simulate(d.model.with_parameters(w=0.8), start, t=(0, 10)) for d in (diagram, again)
    )
    assert same(one, other)


leaves = st.sampled_from([x, v, a, k, sp.Rational(1, 3), sp.Float(0.7), sp.Integer(2), sp.sin(t)])
functions = st.sampled_from([sp.sin, sp.tanh, sp.Abs, sp.atan, lambda e: 1 / (1 + e**2), sp.sign])
expressions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(inner, inner).map(lambda pair: pair[0] + pair[1]),
        st.tuples(inner, inner).map(lambda pair: pair[0] * pair[1]),
        st.tuples(functions, inner).map(lambda pair: pair[0](pair[1])),
        inner.map(lambda e: e**3),
    ),
    max_leaves=6,
)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(first=expressions, second=expressions)
def test_random_models(first, second, tmp_path_factory):
    try:
        model = fs.Model(
            {x: v - x + first, v: -x - v - v**3 + second}, parameters={a: 0.3, k: -1.2}
        )
        run = fs.simulate(model, [0.3, -0.2], t=(0, 3))
    except fs.ModelError:
        return
    path = tmp_path_factory.mktemp("random") / "run.npz"
    run.save(path)
    stored = fs.load(path).model
    assert same(fs.simulate(stored, [0.3, -0.2], t=(0, 3)), run)
    for name, value in (("a", 0.4), ("k", 0.5)):
        try:
            changed = stored.with_parameters({name: value})
        except fs.ModelError:
            # other regions
            continue
        other = fs.simulate(model.with_parameters({name: value}), [0.3, -0.2], t=(0, 3))
        assert same(fs.simulate(changed, [0.3, -0.2], t=(0, 3)), other)


WITHOUT = """
import sys
sys.modules["sympy"] = None
import fastslow as fs
for line in sys.stdin.read().splitlines():
    path, changes, other = eval(line)
    run = fs.load(path)
    model = run.model.with_parameters(changes)
    fs.simulate(model, run.end[1:], t=(20, 30)).save(other)
assert sys.modules["sympy"] is None
"""


def test_a_process_without_sympy_goes_on(tmp_path):
    lines, expected = [], {}
    for number, (model, start, changes) in enumerate(MODELS.values()):
        run = fs.simulate(model, start, t=(0, 20))
        path, other = (str(tmp_path / f"{name}{number}.npz") for name in ("run", "on"))
        run.save(path)
        lines.append(repr((path, changes, other)))
        expected[other] = fs.simulate(model.with_parameters(changes), run.end[1:], t=(20, 30))
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    for path, run in expected.items():
        assert same(fs.load(path), run)


def test_loading_a_model_imports_no_compiler(tmp_path):
    fs.simulate(gear(), [0, 0], periods=1).save(tmp_path / "run.npz")
    code = (
        "import sys, fastslow as fs\n"
        f"model = fs.load({str(tmp_path / 'run.npz')!r}).model.with_parameters(D=0.6)\n"
        "print(sorted({'llvmlite', 'numba', 'sympy', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_period_and_the_gap_follow_the_parameters():
    gap = sp.Piecewise((k * x - D, k * x > D), (k * x + D, k * x < -D), (0, True))
    model = fs.Model({x: w - gap}, forcing={w: sp.sin(a * t)}, parameters={a: 2, D: 1, k: 1})
    stored = model.stored
    assert stored.period() == model.period()
    assert stored.with_parameters(a=0.3).period() == model.with_parameters(a=0.3).period()
    turned = fs.Model({x: w - gap}, forcing={w: sp.sin(a * t)}, parameters={a: 2, D: 1, k: -1})
    runs = [fs.simulate(m.stored, [0], t=(0, 1)) for m in (model, turned)]
    assert runs[0].gap == ("S3", "S2", "S1")
    assert runs[1].gap == fs.simulate(turned, [0], t=(0, 1)).gap == runs[0].gap[::-1]


def test_other_regions_are_refused():
    stored = gear().stored
    with pytest.raises(fs.ModelError, match="at D = 0 the model has other regions than stored"):
        stored.with_parameters(D=0)
    assert stored.with_parameters(D=0.6, k=3).parameters["D"] == 0.6
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'd'; did you mean 'D'"):
        stored.with_parameters(d=1)
    with pytest.raises(fs.ModelError, match="parameter D: expected a finite number"):
        stored.with_parameters(D="wide")
    # the sign of a factor of parameters decides what a condition means
    jump = fs.Model(
        {x: sp.Piecewise((1, k * (x**2 - v) > 0), (2, True)) - x, v: -v}, parameters={k: 1}
    )
    assert jump.stored.with_parameters(k=2).parameters["k"] == 2
    with pytest.raises(fs.ModelError, match="at k = -1"):
        jump.stored.with_parameters(k=-1)
    # at k = 0 the function would be affine
    bent = fs.Model({x: -sp.Abs(k * x**2 - D)}, parameters={k: 1, D: 0.1}).stored
    assert bent.with_parameters(D=0.2).parameters["D"] == 0.2
    with pytest.raises(fs.ModelError, match="regions are the same at k = 2 is not known"):
        bent.with_parameters(k=2)


def test_what_needs_equations_says_so():
    stored = gear().stored
    what = "stored as numbers, without its equations; build the Model from its equations"
    for call in (
        lambda: fs.continue_equilibria(stored, "w", (0, 1)),
        lambda: fs.simulate_many(stored, [[0, 0]], t=(0, 1)),
        lambda: fs.derive(stored),
    ):
        with pytest.raises(fs.ArgumentError, match=f"expected a Model, received a Stored.*{what}"):
            call()
    for name in ("frozen", "freed", "ramped", "rates", "to_latex"):
        with pytest.raises(AttributeError, match=f"a stored model has no {name}: .*{what}"):
            getattr(stored, name)
    with pytest.raises(AttributeError, match="no attribute 'frozn'"):
        stored.frozn  # noqa: B018


def test_an_overlay_of_a_loaded_run(tmp_path):
    diagram = fs.continue_equilibria(gear().frozen(), "w", (-1.2, 1.2))
    run = fs.simulate(gear().with_parameters(k=0.01), [0, 0], periods=1)
    run.save(tmp_path / "run.npz")
    again = fs.load(tmp_path / "run.npz")
    assert fs.overlay(diagram, again) is not None
    assert again.symbolic_model is None


def test_the_vocabulary_is_that_of_the_compiler():
    known = {**native._LIBRARY, **{n: count for n, (_, count) in native._INTRINSICS.items()}}
    assert arithmetic.MATHEMATICS.items() <= known.items()
    functions = {**special._VALUES, "sinc": 1, "polygamma": 2, "lambertw": 2}
    assert arithmetic.SPECIAL.items() <= functions.items()
    assert dict(arithmetic.SEVERAL) == special._SEVERAL
    templates = [*ELEMENTARY.values(), *CLOSED.values(), *OPEN.values()]
    for template in (*templates, "special.ellipeinc({}, {})"):
        count = len(set(re.findall(r"{\d?}", template))) if "{0}" in template else None
        count = count or template.count("{}")
        arithmetic.check_number(template.format(*("p0", "p1")[:count]), {"p0", "p1"})


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "p0.__class__",
        "[p0]",
        "p0[0]",
        "(lambda: p0)()",
        "p9",
        "9**9**9",
        "math.factorial(p0)",
        "math.sin(p0, p0)",
        "math.sin(*[p0])",
        "special.airy(p0, 7)",
        "special.airy(p0, p0)",
        "open(p0)",
        "p0 < 1.0",
        "1.0 if p0 else 2.0",
        "True",
        "p0; p0",
        "1j",
        "'p0'",
        f"{2**60}",
        "-" * 500 + "p0",
        "abs(" * 95 + "p0" + ")" * 95,
        "",
        None,
        5,
    ],
)
def test_other_text_is_refused(text):
    with pytest.raises(arithmetic.UnknownOperationError):
        arithmetic.check_number(text, {"p0"})


@pytest.mark.parametrize(
    "text",
    [
        "math.sin(p0)/2.0 - abs(p1)*3",
        "max(p0, p1, 0.5) if (p0 < p1) and not (p1 == 2.0) else min(p0, math.pi)",
        "math.pow(p0, 1.5) + math.atan2(p1, -p0)",
        "math.copysign(1, p1)",
        " + ".join(["p0"] * 500),
    ],
)
def test_text_has_the_value_that_python_gives(text):
    arithmetic.check_number(text, {"p0", "p1"})
    import math

    values = {"p0": 0.7, "p1": -1.3}
    expected = eval(text, {"math": math, **values})
    assert float(arithmetic.value_of(text, values)) == pytest.approx(expected, rel=1e-15)
    with pytest.raises(arithmetic.UnknownOperationError):
        arithmetic.value_of("special.gamma(p0)", values)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    path = tmp_path_factory.mktemp("stored") / "model.npz"
    gear().stored.save(path)
    return read_archive(path.read_bytes(), lambda text, arrays: json.loads(text))


def operations(tree):
    return tree["result"]["fields"]["operations"]["fields"]


def motion(tree):
    return operations(tree)["motions"]["tuple"][0]["fields"]


def _rows(tree):
    motion(tree)["rates"]["tuple"][0] = 10**9


def _negative(tree):
    motion(tree)["outputs"]["tuple"][0] = -1


def _fraction(tree):
    motion(tree)["rates"]["tuple"][0] = 1.5


def _kind(tree):
    motion(tree)["nodes"]["tuple"][0]["tuple"][0] = "call"


def _place(tree):
    motion(tree)["nodes"]["tuple"][0]["tuple"][1] = 10**6


def _state(tree):
    motion(tree)["nodes"]["tuple"][0]["tuple"][1] = 0


def _operand(tree):
    node = next(n for n in motion(tree)["nodes"]["tuple"] if n["tuple"][0] == "sum")
    node["tuple"][2]["tuple"][0]["tuple"][1] = 77


def _text(tree):
    node = next(n for n in motion(tree)["nodes"]["tuple"] if n["tuple"][0] == "function")
    node["tuple"][2] = "open(r0)"


def _assignment(tree):
    node = next(n for n in motion(tree)["nodes"]["tuple"] if n["tuple"][0] == "function")
    node["tuple"][2] = "r3\nW[10**9] = 0.0"


def _gradient(tree):
    operations(tree)["gradients"]["tuple"][0]["tuple"][0]["tuple"][0] = "W[10**9]"


def _few_gradients(tree):
    operations(tree)["gradients"]["tuple"].pop()


def _sizes(tree):
    operations(tree)["sizes"]["tuple"][0] = 10**9


def _signs(tree):
    motion(tree)["signs"]["tuple"][0] = 2


def _names(tree):
    tree["result"]["fields"]["states"]["tuple"].append("z")


def _validity(tree):
    tree["result"]["fields"]["validity"]["fields"]["rows"]["tuple"][0]["tuple"][0] = "exec('')"


def _frequency(tree):
    tree["result"]["fields"]["validity"]["fields"]["frequencies"]["tuple"][0] = "p0.x"


def _traits(tree):
    tree["result"]["fields"]["traits"]["fields"]["rising"]["tuple"].append(1)


def _unknown(tree):
    operations(tree)["code"] = "ret"


FORGED = [
    _rows, _negative, _fraction, _kind, _place, _state, _operand, _text, _assignment, _gradient,
    _few_gradients, _sizes, _signs, _names, _validity, _frequency, _traits, _unknown,
]  # fmt: skip


@pytest.mark.parametrize("change", FORGED)
def test_a_forged_file_is_refused(change, tree, tmp_path):
    forged = copy.deepcopy(tree)
    change(forged)
    assert forged != tree
    (tmp_path / "model.npz").write_bytes(write_archive(json.dumps(forged), {}))
    with pytest.raises(fs.FileError):
        fs.load(tmp_path / "model.npz")


def _leaves(node, path=()):
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from _leaves(value, (*path, key))
    else:
        yield path


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_a_file_with_other_content_is_refused_or_is_arithmetic(data, tree, tmp_path_factory):
    """Whatever one leaf becomes: the file is refused, or what it holds compiles and runs."""
    forged = copy.deepcopy(tree)
    path = data.draw(st.sampled_from(list(_leaves(tree["result"]))))
    node = forged["result"]
    for key in path[:-1]:
        node = node[key]
    other = data.draw(
        st.sampled_from([0, 1, -1, 5, 10**12, 2.5, "", "p0", "r0", "math.pi", "+", None, True, []])
    )
    node[path[-1]] = other
    file = tmp_path_factory.mktemp("forged") / "model.npz"
    file.write_bytes(write_archive(json.dumps(forged), {}))
    try:
        model = files.load(file)
    except fs.FileError:
        return
    try:
        run = fs.simulate(model, [0.1, 0.2], t=(0, 1), integration=fs.Integration(max_steps=50))
    except fs.FastSlowError:
        return
    assert np.isfinite(run.end[0])
