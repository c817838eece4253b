"""Results cannot be changed from outside, and copies of them keep what they are."""

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Mapping

import numpy as np
import pandas
import pytest
import sympy as sp
import xarray

import fastslow as fs
from fastslow.continuation.loops import writeable
from fastslow.diagrams.trace import tracing
from fastslow.results.base.immutable import fixed
from fastslow.results.base.result import Saved
from tests.errors.subjects import results

pytestmark = pytest.mark.slow

#: Ways to the same result.
WAYS = {
    "itself": lambda result, folder: result,
    "copy": lambda result, folder: copy.copy(result),
    "deepcopy": lambda result, folder: copy.deepcopy(result),
    "pickle": lambda result, folder: pickle.loads(pickle.dumps(result)),
    "file": lambda result, folder: saved(result, folder / "one.npz"),
}

#: Queries that need no argument.
QUERIES = ("to_dict", "stable_intervals", "bistable", "hysteresis", "peaks", "stroboscopic")

#: Results by their names among the subjects of the tests of bad input.
NAMES = (
    "diagram", "branch", "fold", "equilibrium", "curve", "run", "overlay", "gap", "corner", "hopf",
    "many", "swept", "map", "section", "spectrum", "steady", "regimes", "motions", "exponents",
    "scaling", "load", "grid", "sobol",
)  # fmt: skip


def saved(result, path):
    if not isinstance(result, Saved):
        return result
    result.save(path)
    return fs.load(path)


def parts(value, kept):
    """What a value hands out, by how it is got, and whether the value keeps it."""
    if isinstance(value, Mapping):
        yield from ((f"[{key!r}]", value[key], kept) for key in value)
        return
    if isinstance(value, tuple | list):
        yield from ((f"[{k}]", item, kept) for k, item in enumerate(value[:3]))
    if not type(value).__module__.startswith("fastslow.results"):
        return
    fields = getattr(type(value), "__dataclass_fields__", {})
    yield from ((f".{name}", getattr(value, name), True) for name in fields)
    for name in dir(type(value)):
        member = inspect.getattr_static(type(value), name, None)
        if name.startswith("_") or name in fields:
            continue
        if name in QUERIES:
            yield f".{name}()", getattr(value, name)(), False
        elif not callable(member):
            try:
                yield f".{name}", getattr(value, name), False
            except (fs.ArgumentError, fs.ModelError):
                # an ensemble without samples has no times, and an overlay of a file no equations
                assert isinstance(value, fs.Ensemble | fs.Overlay)
    for name in (*getattr(value, "states", ()), getattr(value, "parameter", "")):
        for asked in (name, f"{name}**2"):
            try:
                yield f"[{asked!r}]", value[asked], False
            except (TypeError, fs.ArgumentError, fs.UnknownNameError):
                # not everything has columns or reads expressions
                continue
    if isinstance(value, fs.Trajectory | fs.Branch | fs.Diagram):
        yield "[0]", value[0], False
    if isinstance(value, fs.Trajectory):
        yield "()", value(np.array(value.span)), False
        yield "[:5]", value[:5], False


def walk(value, where, kept, seen, found):
    """Collect every array within reach that is writeable, and everything that can be changed."""
    if isinstance(value, np.ndarray):
        if value.flags.writeable:
            found.append(f"{where} is a writeable array")
        base = value.base
        while kept and isinstance(base, np.ndarray):
            if base.flags.writeable:
                found.append(f"{where} is a view of a writeable array")
            base = base.base
        return
    if kept and isinstance(value, dict | list | set):
        found.append(f"{where} is a {type(value).__name__}")
    ours = type(value).__module__.startswith("fastslow.results")
    if not ours and not isinstance(value, Mapping | tuple | list):
        return
    if ours:
        if id(value) in seen:
            return
        seen[id(value)] = value
        for name in ("anything", *getattr(type(value), "__dataclass_fields__", ())):
            try:
                setattr(value, name, None)
                found.append(f"{where}.{name} can be set")
            except AttributeError:
                pass
    for how, part, stays in parts(value, kept):
        walk(part, where + how, stays, seen, found)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", NAMES)
def test_nothing_handed_out_can_be_changed(name, way, tmp_path):
    result = WAYS[way](results()[name], tmp_path)
    found = []
    walk(result, name, True, {}, found)
    assert not found, "\n".join(dict.fromkeys(found[:20]))


@pytest.mark.parametrize("name", NAMES)
def test_a_copy_is_equal_to_its_original(name, tmp_path):
    result = results()[name]
    for way, made in WAYS.items():
        again = made(result, tmp_path)
        assert again == result, way
        assert hash(again) == hash(result), way
        assert repr(again) == repr(result), way


def test_results_that_differ_are_not_equal():
    r = results()
    assert r["diagram"] != r["branch"]
    assert r["diagram"] == fs.continue_equilibria(r["fast"], "p", over=(-1, 1))
    assert r["diagram"] != fs.continue_equilibria(r["fast"], "p", over=(-1, 0.9))
    moved = np.nextafter(r["equilibrium"].state, np.inf)
    assert dataclasses.replace(r["equilibrium"], state=moved) != r["equilibrium"]
    assert {r["diagram"]: 1}[fs.continue_equilibria(r["fast"], "p", over=(-1, 1))] == 1


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy], ids=["copy", "deepcopy"])
def test_copies_still_solve(copied):
    diagram = results()["diagram"]
    for one in (diagram, diagram[0]):
        again = copied(one)
        assert again.corrector is one.corrector is not None
        for here, there in zip(again.at(p=0.123), one.at(p=0.123), strict=True):
            assert here.state == there.state
            assert not here.interpolated


def test_a_pickled_diagram_says_that_it_interpolates():
    diagram = results()["diagram"]
    again = pickle.loads(pickle.dumps(diagram))
    assert again.corrector is None
    (point,) = again.at(p=0.7)
    assert point.interpolated
    assert "interpolated" in repr(point)
    assert "interpolated" not in repr(diagram.at(p=0.7)[0])


def test_replaced_fields_are_read_only_too():
    branch = results()["branch"]
    state = branch.state + 1.0
    again = dataclasses.replace(branch, state=state, parameters={"q": 3.0})
    state[:] = 0.0
    assert (again.state == branch.state + 1.0).all()
    assert not again.state.flags.writeable
    with pytest.raises(TypeError):
        again.parameters["q"] = 4.0
    assert again.corrector is branch.corrector


def test_a_column_is_not_changed_in_place(tmp_path):
    diagram = results()["diagram"]
    x = diagram[0]["x"]
    before = diagram.at(p=0.3)[0]["x"]
    with pytest.raises(ValueError, match="read-only"):
        x -= x.mean()
    with pytest.raises(ValueError, match="read-only"):
        diagram[0].state[:, 0] = 0.0
    diagram.save(tmp_path / "one.npz")
    assert fs.load(tmp_path / "one.npz").at(p=0.3)[0]["x"] == pytest.approx(before, abs=1e-6)


def test_frames_and_datasets_are_copies():
    for name in ("branch", "diagram", "run", "many", "swept", "section", "spectrum", "curve"):
        result = results()[name]
        result = result[0] if isinstance(result, tuple) else result
        before = {key: np.array(values) for key, values in result.to_dict().items()}
        frame, data = result.to_frame(), result.to_xarray()
        assert isinstance(frame, pandas.DataFrame)
        assert isinstance(data, xarray.Dataset)
        for key, values in before.items():
            if values.dtype.kind == "f":
                frame[key] += 1.0
            if values.dtype.kind == "f" and key in data.data_vars:
                data[key].values[...] = 7.0
        for key, values in result.to_dict().items():
            np.testing.assert_array_equal(values, before[key])


def test_drawn_data_are_copies():
    drawn = fs.plot.diagram(results()["diagram"], x="p", y="x")
    before = {kind: [np.array(c) for c in curves] for kind, curves in drawn.data.items()}
    for curves in drawn.data.values():
        for curve in curves:
            assert not curve.flags.writeable
            assert curve.base is None
    for line in drawn.ax.lines:
        line.set_data([0.0], [0.0])
    assert before
    assert not np.array_equal(before[min(before)][0], drawn.data[min(before)][0])


def test_what_was_given_stays_with_who_gave_it():
    x, k, w, t = sp.symbols("x k w t")
    model = fs.Model({x: w - k * x}, forcing={w: sp.sin(t)}, parameters={k: 1})
    start, times = np.array([0.5]), np.linspace(0.0, 1.0, 5)
    run = fs.simulate(model, start, t=(0, 1), samples=times)
    asked = np.array([0.25, 0.5])
    values = run(asked)
    states, rates = np.array([[0.5], [1.0]]), np.array([1.0, 2.0])
    many = fs.simulate_many(model, states, parameters={"k": rates}, t=(0, 1), samples=times)
    swept = fs.bifurcation_sweep(model, "k", rates, start, settle=1, keep=1)
    over = np.array([-1.0, 1.0])
    diagram = fs.continue_equilibria(model.frozen(), "w", over)
    given = (start, times, asked, states, rates, over)
    kept = [np.array(x) for x in (run.t, run["x"], values, many.initial, many.t, swept.values)]
    for array in given:
        assert array.flags.writeable
        array[...] = 77.0
    now = (run.t, run["x"], values, many.initial, many.t, swept.values)
    for before, after in zip(kept, now, strict=True):
        np.testing.assert_array_equal(before, after)
    assert np.array_equal(many.parameters["k"], [1.0, 2.0])
    assert diagram.over == (-1.0, 1.0)


def test_a_view_of_foreign_memory_is_copied():
    memory = bytearray(np.arange(3.0).tobytes())
    view = np.frombuffer(memory)
    view.flags.writeable = False
    kept = fixed("state", view)
    memory[:8] = np.float64(9.0).tobytes()
    assert kept[0] == 0.0
    base = np.zeros(4)
    part = base[:2]
    part.flags.writeable = False
    kept = fixed("state", part)
    base[0] = 1.0
    assert kept[0] == 0.0


@pytest.mark.parametrize(
    "given",
    [{}, {"samples": 9}, {"samples": [0.5, 1.0], "dense": False}, {"periods": 1.0, "t": None}],
    ids=str,
)
def test_what_a_run_puts_together_is_fixed_already(given):
    """It is not looked at again, so that a short run is not held up by what it is made of."""
    x, w, t = sp.symbols("x w t")
    turn = sp.sin(sp.pi * x)
    model = fs.Model({x: w - sp.sign(turn)}, forcing={w: sp.sin(t)}, periodic={x: 2})
    few = fs.Integration(max_steps=3)
    for integration in (fs.Integration(), few):
        run = fs.simulate(model, [0.5], **({"t": (0, 6)} | given), integration=integration)
        content = vars(run)
        assert content.keys() == {entry.name for entry in dataclasses.fields(run)}
        assert all(fixed(name, value) is value for name, value in content.items())
        assert run == type(run)(**content)


def test_loops_take_copies_of_read_only_and_strided_arrays():
    diagram = results()["diagram"]
    branch, field = diagram[0], tracing._field(results()["fast"], "p")
    field.evaluate(0, branch.points), field.evaluate(0, branch.points[0])
    field.survey(0, branch.points, branch.tangent, np.ones(2))
    fs.overlay(diagram, results()["run"])
    for array in (branch.state, branch.state[:, ::-1], branch.state.T):
        copy = writeable(array)
        assert np.array_equal(copy, array)
        assert copy.flags.carray
        assert writeable(copy) is copy
