"""Models from files: the same runs bit for bit, without SymPy."""

import subprocess
import sys

import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fastslow as fs
from tests.results.conftest import same
from tests.samples import examples

pytestmark = pytest.mark.slow

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


@pytest.mark.sample(3)
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


@settings(max_examples=examples(25), deadline=None, suppress_health_check=list(HealthCheck))
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
    with pytest.raises(fs.ModelError, match="at D = 0 the regions differ from the stored ones"):
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
    with pytest.raises(fs.ModelError, match="it is unknown whether the regions differ at k = 2"):
        bent.with_parameters(k=2)


def test_what_needs_equations_says_so():
    stored = gear().stored
    what = "stored as numbers, without its equations; build the Model from its equations"
    for call in (
        lambda: fs.equilibria(stored),
        lambda: fs.simulate_many(stored, [[0, 0]], t=(0, 1)),
        lambda: fs.derive(stored),
    ):
        with pytest.raises(fs.ArgumentError, match=f"expected a Model, received a Stored.*{what}"):
            call()
    for name in ("frozen", "with_ramp", "rates", "to_latex"):
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
