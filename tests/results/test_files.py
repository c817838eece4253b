"""Saving and loading: bit for bit, whole or not at all, and never running anything."""

import dataclasses
import io
import json
import math
import os
import subprocess
import sys
import warnings
import zipfile

import h5netcdf
import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.branch.branch import Branch
from fastslow.results.io import files
from fastslow.results.io.encoding import classes
from fastslow.results.io.npz_netcdf import sealed, write_archive
from fastslow.results.points import SpecialPoints
from fastslow.results.trajectory.long_time.spectrum import Spectrum

pytestmark = pytest.mark.slow

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
        "steady": run.periodicity(),
        "contacts": run.contacts(),
        "map": fs.refined_map(
            lambda a, b: a * b < 1, {"a": (0, 2), "b": (0, 2)}, refinement=fs.Refinement(levels=3)
        ),
        "load": fs.systems.slow_load_criterion(gear, {"D": [0.5, 0.6], "C": 2.5}),
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
        tree = json.loads(archive["fastslow"].item())
        assert np.array_equal(archive["series"], results["run"].series)
    assert tree["format"] == files.FILE_FORMAT
    assert tree["library"] == fs.__version__
    kept = tree["result"]["fields"]
    assert "x' = v\nv' = -v + w - (A + x**2)" in kept["equations"]
    assert ["A", 41.67] in kept["parameters"]["entries"]
    assert ["rtol", 1e-9] in kept["settings"]["entries"]
    results["diagram"].save(tmp_path / "gear.nc")
    with h5netcdf.File(tmp_path / "gear.nc") as file:
        group = file["branches/0"]
        assert np.array_equal(group["values"][...], results["diagram"][0].values)
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
    results["overlay"].save(tmp_path / "overlay.npz")
    again = fs.load(tmp_path / "overlay.npz")
    drawing = fs.plot.overlay(again)
    assert drawing.ax is not None
    assert again.summary() == results["overlay"].summary()
    plt.close("all")


def archive(path, **arrays):
    tree = {"format": files.FILE_FORMAT, "library": "0", "result": None}
    text = arrays.pop("text", json.dumps({**tree, **arrays.pop("tree", {})}))
    path.write_bytes(write_archive(text, arrays))
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
    read(tmp_path / "foreign.npz", "not written by fastslow in format 2 or later")
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
        read(path, "has no checksum at its end: it is cut short, was changed by another program")


@pytest.mark.parametrize("ending", FORMATS)
def test_a_changed_bit_is_seen_wherever_it_is(results, tmp_path, ending):
    path = tmp_path / f"section{ending}"
    results["section"].save(path)
    whole = path.read_bytes()
    for at in [*range(8, len(whole), 97), len(whole) - 1]:
        changed = bytearray(whole)
        changed[at] ^= 1
        path.write_bytes(bytes(changed))
        read(path, "is damaged: its content is not|has no checksum at its end")


def test_other_programs_open_the_files(results, tmp_path):
    import xarray

    results["run"].save(tmp_path / "run.nc")
    with xarray.open_dataset(tmp_path / "run.nc") as data:
        assert np.array_equal(data["series"].values, results["run"].series)
        assert json.loads(str(data["fastslow"].values))["format"] == files.FILE_FORMAT
    results["diagram"].save(tmp_path / "gear.nc")
    with xarray.open_dataset(tmp_path / "gear.nc", group="branches/0") as data:
        assert data["region"].values.tolist() == results["diagram"][0].region.tolist()


def test_two_saves_write_the_same_bytes(results, tmp_path):
    for ending in FORMATS:
        results["diagram"].save(tmp_path / f"a{ending}")
        results["diagram"].save(tmp_path / f"b{ending}")
        assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()


def test_an_interrupt_between_members_of_an_archive_comes_out(tmp_path, monkeypatch):
    """It may come when a member is open and nobody has it yet; zipfile then refuses to close."""
    spectrum = Spectrum("x", "hann", (0.0, 1.0), np.arange(300.0), np.arange(300.0))

    def interrupted(archive, *args, **kwargs):
        archive._writing = True
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(zipfile.ZipFile, "open", interrupted)
        with pytest.raises(KeyboardInterrupt):
            spectrum.save(tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())
    spectrum.save(tmp_path / "a.npz")
    assert fs.load(tmp_path / "a.npz") == spectrum


def test_endings_in_capital_letters(results, same, tmp_path):
    for ending in (".NPZ", ".Nc"):
        results["section"].save(tmp_path / f"a{ending}")
        assert same(results["section"], fs.load(tmp_path / f"a{ending}"))


def sealed_archive(path, members, compression=zipfile.ZIP_STORED):
    """An archive made by hand, with a right checksum."""
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w", compression) as file:
        warnings.simplefilter("ignore")  # of names that occur twice
        file.comment = bytes(80)
        for name, content in members:
            file.writestr(name, content)
    path.write_bytes(sealed(stream.getvalue()[:-80]))
    return path


def member(array, header=None):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array)
    text = stream.getvalue()
    if header is not None:
        old = text[10:128]
        text = text[:10] + header.encode().ljust(len(old) - 1) + b"\n" + text[128:]
    return text


def tree_of(result):
    tree = {"format": files.FILE_FORMAT, "library": "0", "result": result}
    return member(np.array(json.dumps(tree).encode()))


def test_archives_made_by_hand_are_not_unpacked_beyond_their_size(tmp_path):
    """Each would take gigabytes, or has a member that reads in two ways."""
    path = tmp_path / "x.npz"
    node = {"array": "a", "dtype": "<f8", "shape": [3]}
    text, array = ("fastslow.npy", tree_of(node)), ("a.npy", member(np.arange(3.0)))
    assert fs.load(sealed_archive(path, [text, array])).tolist() == [0, 1, 2]

    def header(shape, descr="'<f8'"):
        fields = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"
        return ("a.npy", member(np.arange(3.0), fields))

    def array_again(count):
        return ("fastslow.npy", tree_of({"list": [node] * count}))

    read(sealed_archive(path, [text, header("(3000000000,)")]), "the size of a is not the one")
    read(sealed_archive(path, [text, header("(-1, -3)")]), "the size of a is not the one")
    read(sealed_archive(path, [text, header("(0, 9999999999999999999999)")]), "the size of a is")
    read(sealed_archive(path, [text, header("(3,)", "'|O'")]), "a is of type object")
    read(sealed_archive(path, [text, header("(3,)", "'<U0'")]), "a is of type <U0")
    read(sealed_archive(path, [text, header("(3,)", "[('x', '<f8')]")]), "a is of type")
    read(sealed_archive(path, [text, header("(3" + ",(" * 40)]), "damaged, or not written by")
    read(sealed_archive(path, [text, header('"""')]), "damaged, or not written by")
    read(sealed_archive(path, [text, array, array]), "holds a.npy twice")
    read(sealed_archive(path, [array_again(200), array]), "its arrays are larger than the file")
    bomb = [("fastslow.npy", member(np.zeros(10**6))), array]
    read(sealed_archive(path, bomb, zipfile.ZIP_DEFLATED), "fastslow.npy is compressed")
    deep = member(np.array(b'{"format": 2, "result": ' + b"[" * 10**5))
    read(sealed_archive(path, [("fastslow.npy", deep)]), "damaged, or not written by")
    nested = '{"list": [' * 3000 + "]}" * 3000
    nested = member(np.array(f'{{"format": 2, "result": {nested}}}'.encode()))
    read(sealed_archive(path, [("fastslow.npy", nested)]), "damaged, or not written by|cannot be")
    digits = member(np.array(b'{"format": 2, "result": ' + b"9" * 10**5 + b"}"))
    read(sealed_archive(path, [("fastslow.npy", digits)]), "damaged, or not written by")
    words = {"numbers": [1.0], "dtype": "<U100000000", "shape": [1]}
    read(sealed_archive(path, [("fastslow.npy", tree_of(words))]), "numbers of type <U100000000")
    nan = member(np.array(b'{"format": 2, "result": NaN}'))
    read(sealed_archive(path, [("fastslow.npy", nan)]), "holds NaN, which is no JSON")


def sealed_netcdf(path, make, result):
    """An HDF5 file made by hand, with a right checksum."""
    tree = {"format": files.FILE_FORMAT, "library": "0", "result": result}
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file["fastslow"] = np.frombuffer(json.dumps(tree).encode(), "S1")
        make(file)
    path.write_bytes(sealed(stream.getvalue()))
    return path


def test_netcdf_made_by_hand_is_not_read_beyond_its_size(tmp_path):
    path = tmp_path / "x.nc"
    node = {"array": "a", "dtype": "<f8", "shape": [3]}
    words = {"array": "a", "dtype": "<U100000000", "shape": []}
    (tmp_path / "secret").write_bytes(np.arange(3.0).tobytes())

    def put(**options):
        return lambda file: file.create_dataset("a", **options)

    plain = put(data=np.arange(3.0))
    assert fs.load(sealed_netcdf(path, plain, node)).tolist() == [0, 1, 2]
    stored = "a is not stored as fastslow stores"
    read(sealed_netcdf(path, put(data=np.zeros(10**6), compression=9), node), stored)
    read(sealed_netcdf(path, put(shape=(3 * 10**9,), dtype="f8"), node), stored)
    outside = put(shape=(3,), dtype="f8", external=[(str(tmp_path / "secret"), 0, 24)])
    read(sealed_netcdf(path, outside, node), stored)
    read(sealed_netcdf(path, put(data=np.array(["a"], dtype=object)), node), "a is of type object")
    read(sealed_netcdf(path, put(data=np.frombuffer(b"abc", "S1")), words), stored)
    read(sealed_netcdf(path, plain, {**node, "dtype": "|S900000000"}), "a is of type")
    read(sealed_netcdf(path, plain, {"list": [node] * 1000}), "its arrays are larger than the file")
    read(sealed_netcdf(path, lambda file: file.create_group("a"), node), "a is no variable")
    read(sealed_netcdf(path, lambda file: None, node), "a is missing or a link")
    with h5py.File(tmp_path / "other.nc", "w") as other:
        other["a"] = np.arange(3.0)

    def link(file):
        file["a"] = h5py.ExternalLink(str(tmp_path / "other.nc"), "/a")

    read(sealed_netcdf(path, link, node), "a is missing or a link")


def test_newer_and_wrong_contents(tmp_path):
    path = tmp_path / "x.npz"
    newer = {"format": files.FILE_FORMAT + 1, "library": "9.9"}
    read(archive(path, tree=newer), r"was written by fastslow 9\.9 in format 4; .* upgrade it")
    read(archive(path, tree={"format": 1}), r"in format 1; this is .* reads format 3$")
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
        ({"numbers": [1.0], "dtype": "what", "shape": [1]}, "holds numbers of type what"),
        ({"float": "1"}, "does not read as a result"),
        ({"tuple": 3}, "does not read as a result"),
        ({"mapping": [1]}, "does not read as a result"),
    ]:
        read(archive(path, tree={"result": result}), message)
    wrong = {"array": "a", "dtype": "<f8", "shape": [3]}
    read(archive(path, tree={"result": wrong}, a=np.zeros(2)), "array a is not as its description")
    live = {"class": "SpecialPoint", "fields": {"source": 1}}
    read(archive(path, tree={"result": live}), "has a field source")


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
    long = dataclasses.replace(results["run"], settings={"a" * 70000: np.arange(50.0)})
    with pytest.raises(fs.FileError, match="cannot be written"):
        long.save(tmp_path / "x.npz")
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
