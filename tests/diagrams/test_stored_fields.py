"""Diagrams from files: their branches traced again bit for bit, without SymPy."""

import json
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.results.io.encoding import encoded
from fastslow.results.io.files import FILE_FORMAT
from fastslow.results.io.npz_netcdf import write_archive
from tests.results.conftest import same
from tests.samples import examples

pytestmark = pytest.mark.slow

x, y, z, v, p, a = sp.symbols("x y z v p a")
R2 = x**2 + y**2

#: Model, range, and other parameter values.
MODELS = {
    "folds": (fs.Model({x: p + a * x - x**3}, parameters={p: 0, a: 1}), (-1, 1), {"a": 0.5}),
    "Hopf": (
        fs.Model(
            {
                x: p * x - y - x * R2 + sp.sin(x) * y / 4,
                y: x + p * y - y**3 + z**2,
                z: a * x * y - z,
            },
            parameters={p: 0, a: 0.3},
        ),
        (-1, 1),
        {"a": 0.4},
    ),
    "reactor": (
        fs.Model(
            {
                x: -x + p * (1 - x) * sp.exp(y / (1 + y / 20)),
                y: -y + 8 * p * (1 - x) * sp.exp(y / (1 + y / 20)) - a * y,
            },
            parameters={p: 0.1, a: 0.3},
        ),
        (0.01, 0.6),
        {"a": 0.25},
    ),
    "sliding": (
        fs.Model(
            {x: -x + p - sp.sign(y), y: x - y / 2 + sp.sign(y) * a}, parameters={p: 0, a: 0.3}
        ),
        (-2, 2),
        {"a": 0.4},
    ),
    "edges": (
        fs.Model({x: v, v: p - x - sp.Max(x - a, 0) - v}, parameters={p: 0, a: 0.5}),
        (-1, 2),
        {"a": 0.6},
    ),
    "angle": (
        fs.Model(
            {x: v, v: p - sp.sin(x) - a * v}, parameters={p: 0, a: 0.2}, periodic={x: 2 * sp.pi}
        ),
        (-0.9, 1.5),
        {"a": 0.3},
    ),
    "power": (
        fs.Model({x: p - x ** sp.Rational(3, 2) + sp.sqrt(x + a)}, parameters={p: 1, a: 2}),
        (0.5, 3),
        {"a": 3.0},
    ),
}
MODELS["gear"] = (fs.systems.harmonic_gear(A=-0.6).frozen(), (-0.5, 0.5), {"D": 0.24})


def parameter(model):
    return "w" if "w" in model.free else "p"


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The diagram of each model, and its file."""
    folder, found = tmp_path_factory.mktemp("diagrams"), {}
    for name, (model, over, _) in MODELS.items():
        diagram = fs.continue_equilibria(model, parameter(model), over)
        diagram.save(folder / f"{name}.npz")
        found[name] = diagram, folder / f"{name}.npz"
    return found


def seed(diagram):
    branch = diagram.branches[0]
    return branch[len(branch) // 3]


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", MODELS)
def test_a_branch_is_traced_again_from_a_file(name, kept):
    (_, over, changes), (diagram, path) = MODELS[name], kept[name]
    again = fs.load(path)
    assert again == diagram
    one, other = (
        fs.continue_equilibria(
            d.model, d.parameter, over, from_points=[seed(d)], marks=[over[1] / 2]
        )
        for d in (diagram, again)
    )
    assert len(one.branches[0].special) > 1
    assert same(one, other)
    # points between rows are solved for, as ever
    for d in (one, other):
        middle = 0.5 * (over[0] + over[1])
        assert not any(e.interpolated for e in d.at(**{d.parameter: middle}))
    guess = dict(zip(again.states, seed(again).state, strict=True))
    guess[again.parameter] = seed(again).parameters[again.parameter]
    one, other = (
        fs.continue_equilibria(
            m.with_parameters(changes), again.parameter, over, from_points=[guess]
        )
        for m in (diagram.model, again.model)
    )
    assert same(one, other)


def test_what_was_traced_again_is_saved_again(kept, tmp_path):
    again = fs.load(kept["folds"][1])
    traced = fs.continue_equilibria(again.model, "p", (-1, 1), from_points=[seed(again)])
    traced.save(tmp_path / "traced.npz")
    last = fs.load(tmp_path / "traced.npz")
    assert last == traced
    assert last.model == again.model


WITHOUT = """
import sys
sys.modules["sympy"] = None
import fastslow as fs
for line in sys.stdin.read().splitlines():
    path, over, other = eval(line)
    diagram = fs.load(path)
    branch = diagram.branches[0]
    seeds = [branch[len(branch) // 3]]
    fs.continue_equilibria(diagram.model, diagram.parameter, over, from_points=seeds).save(other)
assert sys.modules["sympy"] is None
"""


def test_a_process_without_sympy_traces_branches(kept, tmp_path):
    lines, expected = [], {}
    for name, (diagram, path) in kept.items():
        over, other = MODELS[name][1], str(tmp_path / f"{name}.npz")
        lines.append(repr((str(path), over, other)))
        expected[other] = fs.continue_equilibria(
            diagram.model, diagram.parameter, over, from_points=[seed(diagram)]
        )
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    for path, diagram in expected.items():
        assert same(fs.load(path), diagram)


coefficients = st.integers(-3, 3).map(lambda k: sp.Rational(k, 2))
terms = [1, x, y, x * y, x**2, y**2, x**3, y**3, sp.sin(x), 1 / (2 + y**2)]


@settings(max_examples=examples(15), deadline=None, suppress_health_check=list(HealthCheck))
@given(
    first=st.lists(coefficients, min_size=len(terms), max_size=len(terms)),
    second=st.lists(coefficients, min_size=len(terms), max_size=len(terms)),
)
def test_random_models(first, second, tmp_path_factory):
    rates = [sum(c * e for c, e in zip(cs, terms, strict=True)) for cs in (first, second)]
    model = fs.Model({x: rates[0] + p - x, y: rates[1] - y + a * x}, parameters={p: 0, a: 0.1})
    guess = {"x": 0.2, "y": -0.1, "p": 0.1}

    def traced(model):
        return fs.continue_equilibria(model, "p", (-1, 1), from_points=[guess])

    try:
        diagram = traced(model)
    except fs.ArgumentError:
        assume(False)
    path = tmp_path_factory.mktemp("random") / "diagram.npz"
    diagram.save(path)
    assert same(traced(fs.load(path).model), diagram)


def test_what_takes_equations_is_refused(kept):
    stored = fs.load(kept["power"][1]).model
    start = {"x": 1.0, "p": 1.0}
    with pytest.raises(fs.ModelError, match="without the equations from which equilibria"):
        fs.continue_equilibria(stored, "p", (0.5, 3))
    with pytest.raises(fs.ModelError, match="build the Model from its equations"):
        fs.continue_equilibria(stored, "a", (0.5, 3), from_points=[start])
    with pytest.raises(fs.ModelError, match=r"no parameter varies: .* build the Model"):
        fs.continue_equilibria(MODELS["gear"][0].stored, "w", (0, 1), from_points=[{}])
    with pytest.raises(fs.ArgumentError, match="expected a Model, received a StoredModel: it was"):
        fs.equilibria(stored, p=1)
    # the parameter is an exponent: its natural unit takes equations
    bent = fs.Model({x: p - x**a}, parameters={p: 1, a: 1.5})
    diagram = fs.continue_equilibria(bent, "p", (0.5, 3))
    stored = diagram.stored_model
    assert len(fs.continue_equilibria(stored, "p", (0.5, 3), from_points=[start]).branches) == 1
    with pytest.raises(fs.ModelError, match="the units of the states are not known"):
        fs.continue_equilibria(stored.with_parameters(a=2), "p", (0.5, 3), from_points=[start])


def test_a_special_point_of_a_traced_branch_has_no_equations(kept):
    again = fs.load(kept["folds"][1])
    traced = fs.continue_equilibria(again.model, "p", (-1, 1), from_points=[seed(again)])
    with pytest.raises(fs.FastSlowError):
        fs.continue_points(traced.folds[0], "a", (0.1, 2))


@pytest.fixture(scope="module")
def tree_and_arrays(kept):
    arrays = {}
    result = encoded(kept["sliding"][0].stored_model, "", arrays)
    return {"format": FILE_FORMAT, "library": fs.__version__, "result": result}, arrays


def field(tree):
    return tree["result"]["fields"]["field"]["fields"]


def mode(tree, number=0):
    return field(tree)["modes"]["tuple"][number]["fields"]


def _place(tree):
    mode(tree)["operations"]["fields"]["outputs"]["tuple"][0]["tuple"][0] = 10**9


def _negative(tree):
    mode(tree)["operations"]["fields"]["outputs"]["tuple"][0]["tuple"][0] = -1


def _size(tree):
    mode(tree)["operations"]["fields"]["size"] += 1


def _output(tree):
    mode(tree)["operations"]["fields"]["outputs"]["tuple"][0]["tuple"][1] = "out[10**9]"


def _power(tree):
    mode(tree)["operations"]["fields"]["outputs"]["tuple"][0]["tuple"][1] = "9**9**9"


def _signs(tree):
    mode(tree)["signs"]["tuple"].append(1)


def _sides(tree):
    mode(tree, 2)["sides"]["fields"]["above"] = 77


def _interface(tree):
    mode(tree, 2)["sides"]["fields"]["interface"] = 5


def _entry(tree):
    mode(tree)["derivatives"] = {
        "class": "Derivatives",
        "fields": {
            "entries": {"tuple": [{"tuple": [0, 0, 99]}]},
            "shared": {"tuple": []},
            "texts": {"tuple": ["u0"]},
        },
    }


def _level(tree):
    field(tree)["levels"]["tuple"].append({"tuple": ["y", "y", "exit()", 0.0]})


def _parameter(tree):
    field(tree)["parameter"] = "nothing"


def _units(tree):
    field(tree)["unit_equations"]["tuple"][0]["fields"]["columns"]["tuple"].append("more")


FORGED = [
    _place, _negative, _size, _output, _power, _signs, _sides, _interface, _entry, _level,
    _parameter, _units,
]  # fmt: skip


def test_the_tree_is_that_of_a_model(tree_and_arrays, kept, tmp_path):
    tree, arrays = tree_and_arrays
    (tmp_path / "model.npz").write_bytes(write_archive(json.dumps(tree), arrays))
    assert fs.load(tmp_path / "model.npz") == kept["sliding"][0].stored_model


@pytest.mark.parametrize("change", FORGED)
def test_a_forged_field_is_refused(change, tree_and_arrays, tmp_path):
    tree, arrays = tree_and_arrays
    forged = json.loads(json.dumps(tree))
    change(forged)
    assert forged != tree
    (tmp_path / "model.npz").write_bytes(write_archive(json.dumps(forged), arrays))
    with pytest.raises(fs.FileError):
        fs.load(tmp_path / "model.npz")


def test_a_diagram_without_a_model_to_keep_is_kept(monkeypatch, tmp_path):
    diagram = fs.continue_equilibria(MODELS["folds"][0], "p", (-1, 1))

    def fails(self):
        raise TypeError("SymPy cannot tell")

    monkeypatch.setattr(type(diagram.corrector), "stored", property(fails))
    with pytest.warns(RuntimeWarning, match="model of this Diagram is not kept .* cannot tell"):
        diagram.save(tmp_path / "diagram.npz")
    again = fs.load(tmp_path / "diagram.npz")
    assert again == diagram
    assert again.model is None
    assert np.isfinite(again.branches[0].state).all()
