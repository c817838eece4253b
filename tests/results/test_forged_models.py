"""Stored models in files made by hand: known operations on rows in range, and nothing else."""

import copy
import json

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fastslow as fs
from fastslow.results.io.npz_netcdf import read_archive, write_archive
from tests.samples import examples

pytestmark = pytest.mark.slow

x, v, w, t, a, k, D = sp.symbols("x v w t a k D")


def gear():
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    rates = {x: v, v: w - a * v - gap}
    return fs.Model(rates, forcing={w: sp.cos(k * t)}, parameters={a: 0.1, k: 0.3, D: 0.5})


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


@settings(max_examples=examples(300), deadline=None, suppress_health_check=list(HealthCheck))
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
        model = fs.load(file)
    except fs.FileError:
        return
    try:
        run = fs.simulate(model, [0.1, 0.2], t=(0, 1), integration=fs.Integration(max_steps=50))
    except fs.FastSlowError:
        return
    assert np.isfinite(run.end[0])
