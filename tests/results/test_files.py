"""Saving and loading: bit for bit, whole or not at all, and never running anything."""

import dataclasses
import json
import math
import os
import subprocess
import sys
import zipfile

import h5netcdf
import matplotlib.pyplot as plt
import numpy as np
import pytest

import fastslow as fs
from fastslow.results import files
from fastslow.results.branches import Branch
from fastslow.results.encoding import classes
from fastslow.results.outcome import Outcome
from fastslow.results.points import SpecialPoints
from fastslow.results.result import Result
from fastslow.results.storage import write_archive

FORMATS = [".npz", ".nc"]


@pytest.fixture(scope="module")
def results(gear):
    frozen = gear.frozen()
    diagram = fs.continue_equilibria(frozen, "w", over=(-2, 6))
    run = fs.simulate(gear, [0, 0], periods=1)
    other = fs.simulate(gear, [0, 0], periods=1, samples=7, dense=False)
    sweep = fs.bifurcation_sweep(gear, "C", [3.4, 3.5], [0, 0], settle=0, keep=1)
    many = fs.simulate_many(gear, [[0, 0], [1, 0]], parameters={"D": [0.2, 0.3]}, periods=1)
    short = fs.simulate_many(
        gear, [[0, 0]], periods=1, integration=fs.Integration(max_steps=5), samples=3
    )
    return {
        "diagram": diagram,
        "branch": diagram[0],
        "points": diagram.special,
        "point": diagram.boundary_equilibria[0],
        "equilibrium": diagram[0][0],
        "run": run,
        "samples": other,
        "overlay": fs.overlay(diagram, run),
        "ensemble": many,
        "short": short,
        "sweep": sweep,
        "section": run.section(interface="x - D"),
        "spectrum": run.spectrum("x"),
        "steady": run.steady(),
        "contacts": run.contacts(),
        "map": fs.refined_map(lambda a, b: a * b < 1, {"a": (0, 2), "b": (0, 2)}, levels=3),
        "load": fs.slow_load_criterion(gear, {"D": [0.5, 0.6], "C": 2.5}),
    }


@pytest.fixture(scope="module")
def curve():
    import sympy as sp

    x, p, q = sp.symbols("x p q")
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    return fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


KINDS = [
    "diagram", "branch", "points", "point", "equilibrium", "run", "samples", "overlay", "ensemble",
    "short", "sweep", "section", "spectrum", "steady", "contacts",
    "map", "load",
]  # fmt: skip


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("kind", KINDS)
def test_round_trip(results, same, tmp_path, kind, ending):
    result = results[kind]
    path = tmp_path / f"result{ending}"
    result.save(path)
    again = fs.load(path)
    assert same(result, again)
    assert repr(again) == repr(result)
    assert names_in(tmp_path) == [path.name]


@pytest.mark.parametrize("ending", FORMATS)
def test_round_trip_of_a_curve(curve, same, tmp_path, ending):
    curve.save(tmp_path / f"curve{ending}")
    again = fs.load(tmp_path / f"curve{ending}")
    assert same(curve, again)
    assert again.special("CP")[0].source is None


def test_round_trip_of_a_delay(same, tmp_path):
    model = fs.systems.cusp().frozen()
    fold = fs.continue_equilibria(model, "p", over=(-1, 1)).folds[0]
    delay = fs.predict_delay(fold, 1e-3)
    delay.save(tmp_path / "delay.npz")
    again = fs.load(tmp_path / "delay.npz")
    assert same(delay, again)
    assert again.delay == delay.delay


def test_every_public_result_can_be_saved():
    # a drift is an argument, which results keep
    public = [getattr(fs, n) for n in fs.__all__ if n in classes() and n != "Drift"]
    assert len(public) >= 12
    for kind in public:
        assert issubclass(kind, Result), kind
        assert classes()[kind.__name__] is kind


def test_names_of_results_are_unique():
    import ast
    from pathlib import Path

    names = [
        node.name
        for path in Path(files.__file__).parent.glob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    ]
    assert len(names) == len(set(names))


def test_what_is_in_a_file(results, tmp_path):
    results["run"].save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as archive:
        tree = json.loads(str(archive["fastslow"]))
        assert np.array_equal(archive["series"], results["run"].series)
    assert tree["format"] == files.FORMAT
    assert tree["library"] == fs.__version__
    kept = tree["result"]["fields"]
    assert "x' = v\nv' = -v + w - (A + x**2)" in kept["equations"]
    assert ["A", 41.67] in kept["parameters"]["mapping"]
    assert ["rtol", 1e-9] in kept["settings"]["mapping"]
    results["diagram"].save(tmp_path / "gear.nc")
    with h5netcdf.File(tmp_path / "gear.nc") as file:
        group = file["branches/0"]
        assert np.array_equal(group["parameter"][...], results["diagram"][0].parameter)
        assert np.array_equal(
            group["eigenvalues_imag"][...], results["diagram"][0].eigenvalues.imag
        )
    for kind in ("diagram", "ensemble", "sweep"):
        assert results[kind].equations
        assert results[kind].settings


def test_a_diagram_loads_answers_and_plots_without_what_made_it(results, tmp_path):
    results["diagram"].save(tmp_path / "gear.npz")
    code = """
import sys
import fastslow as fs
diagram = fs.load(sys.argv[1])
(point,) = diagram.at(w=1.23)
print(point.interpolated, repr(point["x"]), diagram.bistable().shape, diagram["x**2"].shape)
print(diagram.nearest(x=0.3).region, len(diagram.select(stable=True).branches))
print(sorted({"sympy", "numba", "scipy", "matplotlib", "h5py", "pandas"} & set(sys.modules)))
fs.plot.diagram(diagram).save(sys.argv[2])
print(sorted({"sympy", "numba"} & set(sys.modules)))
"""
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "gear.npz", tmp_path / "gear.png"],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={**os.environ, "MPLBACKEND": "agg"},
    )
    assert done.returncode == 0, done.stderr
    first, second, third, fourth = done.stdout.splitlines()
    (solved,) = results["diagram"].at(w=1.23)
    assert first.startswith("True ")
    assert float(first.split()[1]) == pytest.approx(solved["x"], abs=1e-8)
    assert second == "S1 2"
    assert third == fourth == "[]"
    assert (tmp_path / "gear.png").stat().st_size > 1000


def test_a_loaded_overlay_is_drawn(results, tmp_path):
    results["overlay"].save(tmp_path / "lay.npz")
    again = fs.load(tmp_path / "lay.npz")
    drawing = fs.plot.overlay(again)
    assert drawing.ax is not None
    assert again.summary() == results["overlay"].summary()
    plt.close("all")


def archive(path, **arrays):
    tree = {"format": files.FORMAT, "library": "0", "result": None}
    text = arrays.pop("text", json.dumps({**tree, **arrays.pop("tree", {})}))
    write_archive(path, text, arrays)
    return path


def read(path, message):
    with pytest.raises(fs.FileError, match=message) as caught:
        fs.load(path)
    assert str(path) in str(caught.value)
    assert isinstance(caught.value, OSError)


def test_missing_and_foreign_files(results, tmp_path):
    read(tmp_path / "none.npz", "cannot be read: No such file or directory")
    read(tmp_path, "cannot be read: Is a directory")
    (tmp_path / "empty.npz").write_bytes(b"")
    read(tmp_path / "empty.npz", "is empty")
    (tmp_path / "text.npz").write_text("hello, this is text")
    read(tmp_path / "text.npz", r"is neither an \.npz archive nor NetCDF")
    np.savez(tmp_path / "foreign.npz", x=np.arange(3))
    read(tmp_path / "foreign.npz", "not written by fastslow")
    with h5netcdf.File(tmp_path / "foreign.nc", "w") as file:
        file.attrs["title"] = "another"
    read(tmp_path / "foreign.nc", "not written by fastslow")
    np.savez(tmp_path / "objects.npz", fastslow=np.array([{"a": 1}], dtype=object))
    read(tmp_path / "objects.npz", "not written by fastslow")
    with zipfile.ZipFile(tmp_path / "zip.npz", "w") as file:
        file.writestr("a.txt", "b")
    read(tmp_path / "zip.npz", "not written by fastslow")


@pytest.mark.parametrize("ending", FORMATS)
def test_files_cut_short_anywhere(results, tmp_path, ending):
    path = tmp_path / f"gear{ending}"
    results["diagram"].save(path)
    whole = path.read_bytes()
    for part in (8, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:part])
        read(path, "is cut short, damaged, or not written by fastslow")


def test_a_changed_byte_is_seen(results, tmp_path):
    path = tmp_path / "gear.npz"
    results["diagram"].save(path)
    whole = bytearray(path.read_bytes())
    at = whole.index(results["diagram"][0].state.tobytes()) + 100
    whole[at] ^= 1
    path.write_bytes(bytes(whole))
    read(path, "damaged")


def test_newer_and_wrong_contents(tmp_path):
    path = tmp_path / "x.npz"
    newer = {"format": files.FORMAT + 1, "library": "9.9"}
    read(archive(path, tree=newer), r"was written by fastslow 9\.9 in format 2; .* upgrade it")
    read(archive(path, text="{"), "not written by fastslow")
    read(archive(path, text="[]"), "not written by fastslow")
    outcome = {"class": "Outcome", "fields": {"code": "a", "message": "b", "success": True}}
    assert fs.load(archive(path, tree={"result": outcome})) == Outcome("a", "b", True)
    for result, message in [
        ({"class": "Popen", "fields": {}}, "holds a Popen, which this version does not know"),
        ({"class": "Outcome", "fields": {}}, "its Outcome lacks the field code"),
        ({**outcome, "fields": {**outcome["fields"], "x": 1}}, "has a field x, which this version"),
        ({"class": "Outcome"}, "does not read as a result"),
        ({"array": "a", "dtype": "<f8", "shape": [1]}, "does not read as a result|not written by"),
        ({"unheard": 1}, "it holds something unknown"),
        ({"numbers": [1.0], "dtype": "<f8", "shape": [2]}, "does not read as a result"),
        ({"numbers": [1.0], "dtype": "what", "shape": [1]}, "does not read as a result"),
        ({"float": "1"}, "does not read as a result"),
        ({"tuple": 3}, "does not read as a result"),
        ({"mapping": [1]}, "does not read as a result"),
    ]:
        read(archive(path, tree={"result": result}), message)
    wrong = {"array": "a", "dtype": "<f8", "shape": [3]}
    read(archive(path, tree={"result": wrong}, a=np.zeros(2)), "array a is not as its description")
    live = {"class": "SpecialPoint", "fields": {"source": 1}}
    read(archive(path, tree={"result": live}), "has a field source")


def test_saving_is_whole_or_not_at_all(results, tmp_path, monkeypatch):
    path = tmp_path / "gear.npz"
    results["section"].save(path)
    before = path.read_bytes()

    def broken(target, text, arrays):
        target.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(files.WRITERS, ".npz", broken)
    with pytest.raises(fs.FileError, match=r"gear\.npz cannot be written: No space left on device"):
        results["diagram"].save(path)
    assert path.read_bytes() == before
    assert names_in(tmp_path) == ["gear.npz"]


def test_where_nothing_can_be_saved(results, tmp_path):
    with pytest.raises(fs.ArgumentError, match=r"gear\.mat: expected a name that ends in \.npz or"):
        results["diagram"].save(tmp_path / "gear.mat")
    with pytest.raises(fs.ArgumentError, match="expected a name that ends in"):
        results["diagram"].save(tmp_path / "gear")
    with pytest.raises(fs.FileError, match="cannot be written: No such file or directory"):
        results["diagram"].save(tmp_path / "none" / "gear.npz")
    strange = dataclasses.replace(results["section"], rule=print)
    with pytest.raises(fs.ArgumentError, match="rule is a builtin_function_or_method, which no"):
        strange.save(tmp_path / "x.npz")
    strange = dataclasses.replace(results["section"], table=np.array([print], dtype=object))
    with pytest.raises(fs.ArgumentError, match="table is an array of object, which no file can"):
        strange.save(tmp_path / "x.npz")
    assert names_in(tmp_path) == []


def test_without_the_extra(results, tmp_path, monkeypatch):
    for name in ("h5netcdf", "pandas", "xarray"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(fs.MissingPackageError, match=r"needs h5netcdf, .*'fastslow\[data\]'"):
        results["diagram"].save(tmp_path / "gear.nc")
    with pytest.raises(fs.MissingPackageError, match="needs pandas"):
        results["diagram"].to_frame()
    with pytest.raises(fs.MissingPackageError, match="needs xarray"):
        results["run"].to_xarray()
    assert names_in(tmp_path) == []


def test_permissions_are_those_of_any_new_file(results, tmp_path):
    results["section"].save(tmp_path / "a.npz")
    (tmp_path / "b").write_text("")
    assert (tmp_path / "a.npz").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_payloads_of_nan_are_kept(same, tmp_path):
    odd = np.array([0x7FF8000000000001, 0xFFF8000000000000], dtype=np.uint64).view(np.float64)
    odd = np.append(odd, [math.nan, -0.0, math.inf, 5e-324])
    branch = Branch(
        ("x",), "p", odd[:, None], odd, np.column_stack([odd, odd]), odd[:, None] + 0j,
        np.full(6, "Σ–1"), SpecialPoints(), (), (Outcome("a", "ä", True),) * 2,
    )  # fmt: skip
    for ending in FORMATS:
        branch.save(tmp_path / f"odd{ending}")
        assert same(branch, fs.load(tmp_path / f"odd{ending}"))
