"""Axes, names and outputs that would be lost, rounded or mistaken without a word."""

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.io.zarr_store import ZarrStore

pytestmark = pytest.mark.slow


@pytest.fixture(params=["in memory", "in a store"])
def execution(request, tmp_path):
    if request.param == "in memory":
        return fs.Execution()
    pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")
    return fs.Execution(store=tmp_path / "map.zarr")


def swept(function, over, execution):
    """A grid, which its store or its file contains unchanged."""
    grid = fs.sweep(function, over, execution=execution)
    if execution.store is not None:
        assert fs.load(execution.store) == grid
    return grid


@pytest.mark.parametrize(
    "output",
    [
        np.zeros(0), np.zeros((2, 0)), np.array([], dtype=str), ["a", "bcd"], [["ü", ""]], [True],
        True, "text", "", 1.5, np.nan, -0.0, 1j, np.inf, 2**53,
    ],
)  # fmt: skip
def test_outputs_are_kept_exactly(output, execution, tmp_path):
    grid = swept(lambda a: {"x y": output}, {"a": [3]}, execution)
    kept, expected = grid["x y"], np.asarray(output)[None]
    assert kept.shape == expected.shape
    assert (kept.dtype.kind == "U") == (expected.dtype.kind == "U")
    np.testing.assert_array_equal(kept, expected)
    assert bool(grid.outcome)
    assert len(grid.missing) == 0
    grid.save(tmp_path / "grid.npz")
    assert fs.load(tmp_path / "grid.npz") == grid
    assert grid.to_xarray()["x y"].shape == expected.shape


def test_masked_values_are_no_numbers(execution):
    grid = swept(lambda a: np.ma.array([1, 2], mask=[True, False]), {"a": [1]}, execution)
    np.testing.assert_array_equal(grid["value"], [[np.nan, 2.0]])
    with pytest.raises(fs.ArgumentError, match="values: 1 of 2 values of an array is masked"):
        swept(lambda a: a, {"a": np.ma.array([1, 2], mask=[True, False])}, execution)


@pytest.mark.parametrize(
    ("output", "message"),
    [
        (2**53 + 1, "whole numbers are stored as floats, which are exact up to 2"),
        (np.array([-(2**60)]), "whole numbers are stored as floats"),
        (np.uint64(2**63), "whole numbers are stored as floats"),
        (np.ma.array(["x"], mask=[True]), "of masked arrays only numbers are accepted"),
        ("\udc80", "expected text in Unicode"),
        (np.array(["\udc80"], dtype=object), "expected text in Unicode"),
        ({"a": 1}, "an output with the name of an axis, a; rename it"),
        ({"done": 1}, "an output with the name done, which is used by the grid"),
        ({"..": 1}, r"an output with the name \.\., which is used"),
        ({"": 1}, "an output with the name '', which is used"),
        ({"__x": 1}, "an output with the name __x"),
        ({"µ": 1, "μ": 2}, "two outputs of one name, of μ"),
    ],
)
def test_outputs_that_cannot_be_kept(output, message, execution):
    with pytest.raises(fs.ArgumentError, match=message):
        fs.sweep(lambda a: output, {"a": [1, 2]}, execution=execution)


@pytest.mark.parametrize(
    ("over", "message"),
    [
        ({"a": [1, "b"]}, "expected numbers, text or bools, not a mixture"),
        ({"a": [True, 2]}, "expected numbers, text or bools, not a mixture"),
        ({"a": [False, 2.5]}, "expected numbers, text or bools, not a mixture"),
        ({"a": np.array([1, 2**63], dtype=np.uint64)}, "a has whole numbers of 2"),
        ({"µ": [1], "μ": [2]}, "μ is given twice"),
        ({"": [1]}, "the name '' is used by the grid"),
        ({"zarr.json": [1]}, r"the name zarr\.json is used by the grid"),
    ],
)
def test_axes_that_numpy_would_change(over, message, execution):
    with pytest.raises(fs.ArgumentError, match=message):
        fs.sweep(lambda **values: 1, over, execution=execution)


def test_names_with_spaces_and_slashes(execution):
    def ratio(**values):
        return {"C/B of it": values["C/B"], "b c": 1.0}

    grid = swept(ratio, {"C/B": [0.5, 1.5], "a b": ["x", "y"]}, execution)
    assert grid["C/B of it"].tolist() == [[0.5, 0.5], [1.5, 1.5]]
    assert grid.at(**{"C/B": 1.5, "a b": "y"})["C/B of it"] == 1.5
    if execution.store is not None:
        data = pytest.importorskip("xarray").open_zarr(execution.store)
        assert set(data.data_vars) == {"C∕B of it", "b c", "failure", "done", "checksum"}
        assert set(data.coords) == {"C∕B", "a b"}


def test_failures_without_a_text(execution):
    def silent(a):
        if a == 1:
            return Outcome("", "", False)
        raise ValueError("\udc80")

    grid = swept(silent, {"a": [1, 2]}, execution)
    assert [text for _, text in grid.failures] == [
        "failed without a reason",
        r"ValueError: \udc80",
    ]
    if execution.store is not None:
        xarray = pytest.importorskip("xarray")
        assert xarray.open_zarr(execution.store)["failure"].shape == (2,)


def test_the_nearest_value_of_an_axis():
    close = 1e6 + np.array([0.0, 1e-4, 2e-4])
    grid = fs.sweep(lambda a: a, {"a": close})
    for value in close:
        assert grid.at(a=value)["value"] == value
        assert grid.select(a=value)["a"].tolist() == [value]
    large = fs.sweep(lambda a: str(a), {"a": 2**60 + np.arange(4)})
    assert large.at(a=2**60 + 3)["value"] == str(2**60 + 3)
    with pytest.raises(fs.ArgumentError, match="is not a value of this axis"):
        large.at(a=2**60 + 7)
    twice = fs.sweep(lambda a: a, {"a": [1.0, 1.0, 2.0]}, paired=True)
    assert twice.select(a=1.0).shape == (2,)


def test_points_that_failed_satisfy_no_condition_on_outputs():
    def half(a):
        if a == 2:
            raise ValueError("two")
        return {"less": a < 1, "x": float(a)}

    grid = fs.sweep(half, {"a": [0, 1, 2, 3]})
    for condition in ("less < 1", "not (x < 1)"):
        assert grid.select(condition)["a"].tolist() == [1, 3]
    assert grid.select("a > 0")["a"].tolist() == [1, 2, 3]
    np.testing.assert_array_equal(grid["less + 1"], [2, 1, np.nan, 1])


@pytest.mark.parametrize("name", ["done", "label", "type"])
def test_names_of_maps_that_a_store_uses(name, tmp_path):
    pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")
    over, once = {name: (0, 1), "y": (0, 1)}, fs.Refinement(cells=(2, 2), levels=0)
    fs.refined_map(lambda x, y: x > y, over, refinement=once)
    stored = fs.Execution(store=tmp_path / "map.zarr")
    with pytest.raises(fs.ArgumentError, match=f"a store of maps uses the name {name}; rename it"):
        fs.refined_map(lambda x, y: x > y, over, refinement=once, execution=stored)


def test_columns_of_one_name():
    grid = fs.sweep(lambda a: {"x": [a, a], "x_1": a}, {"a": [1]})
    with pytest.raises(fs.ArgumentError, match="two columns would be x_1; rename this output"):
        grid.to_dict()


def test_names_on_a_disk_that_ignores_case(tmp_path, monkeypatch):
    pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")
    stored = fs.Execution(store=tmp_path / "map.zarr")
    create = ZarrStore._create_outputs

    def created(store, outputs):
        (store.path / "ZARR.JSON").touch()
        create(store, outputs)

    monkeypatch.setattr(ZarrStore, "_create_outputs", created)
    with pytest.raises(fs.ArgumentError, match="D and d would be one directory"):
        fs.sweep(lambda D: {"d": 1.0}, {"D": [1]}, execution=stored)


def test_too_many_points_and_too_large_tasks(monkeypatch):
    monkeypatch.setattr("os.sysconf", lambda name: 1000)  # a megabyte
    many = {"a": np.arange(1000), "b": np.arange(1000)}
    with pytest.raises(fs.ArgumentError, match=r"the marks of 1000000 points take 0\.002 GB, of"):
        fs.sweep(lambda a, b: 1, many)
    fewer = {"a": np.arange(300), "b": np.arange(1000)}
    chunk = fs.Execution(chunk=100_000)
    with pytest.raises(fs.ArgumentError, match=r"chunk = 100000: its points take 0\.0032 GB"):
        fs.sweep(lambda a, b: 1, fewer, execution=chunk)
