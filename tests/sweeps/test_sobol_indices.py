"""Sobol indices against closed forms and SALib, their samples, stores and degenerate outputs."""

import re
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import fastslow as fs
from fastslow.sweeps.variance_shares import _outcome

SALib = pytest.importorskip("SALib", reason="SALib, of the extra 'sensitivity', is not installed")

pytestmark = pytest.mark.slow

ANGLES = dict.fromkeys("abc", (-np.pi, np.pi))


def ishigami(a, b, c):
    return {"y": np.sin(a) + 7 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)}


#: Of the g-function (Saltelli et al. 2010).
WEIGHTS = np.array([0, 1, 4.5, 9])


def g(**x):
    columns = np.array(list(x.values())).T
    return {"g": np.prod((np.abs(4 * columns - 2) + WEIGHTS) / (1 + WEIGHTS), axis=1)}


@pytest.fixture(scope="module")
def found():
    return fs.sobol(ishigami, ANGLES, 4096, vectorized=True, second_order=True, seed=1)


def test_the_ishigami_function_in_closed_form(found):
    # Ishigami and Homma 1990; two digits at n = 4096
    alone = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2
    pair = 0.01 * np.pi**8 * 8 / 225
    variance = alone + pair + 49 / 8
    np.testing.assert_allclose(found.first[0] * variance, [alone, 49 / 8, 0], atol=0.002 * variance)
    total = np.array([alone + pair, 49 / 8, pair])
    np.testing.assert_allclose(found.total[0] * variance, total, atol=0.002 * variance)
    a, b, c = range(3)
    assert found.second[0, a, c] == pytest.approx(pair / variance, abs=0.003)
    assert abs(found.second[0, [a, b], [b, c]]).max() < 0.003
    np.testing.assert_array_equal(found.second[0], found.second[0].T)
    assert found.second_error[0, a, c] > 0.003


def test_the_g_function_in_closed_form():
    # Saltelli et al. 2010, eqs. 21-26; three digits at n = 8192
    shares = 1 / (3 * (1 + WEIGHTS) ** 2)
    whole = np.prod(1 + shares)
    found = fs.sobol(g, {f"x{k}": (0, 1) for k in range(4)}, 8192, vectorized=True)
    np.testing.assert_allclose(found.first[0], shares / (whole - 1), atol=5e-4)
    total = shares / (1 + shares) * whole / (whole - 1)
    np.testing.assert_allclose(found.total[0], total, atol=5e-4)
    assert (np.abs(found.total[0] - total) < found.total_error[0]).all()
    assert found.second.shape == (1, 0, 0)


def test_the_same_numbers_as_salib(found):
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as sampling

    problem = {"num_vars": 3, "names": [*"abc"], "bounds": [[-np.pi, np.pi]] * 3}
    points = sampling.sample(problem, 4096, seed=1)
    known = analysis.analyze(problem, ishigami(*points.T)["y"], seed=1)
    names = {"first": "S1", "first_error": "S1_conf", "total": "ST", "total_error": "ST_conf"}
    for name, key in names.items():
        np.testing.assert_array_equal(getattr(found, name)[0], known[key])
    upper = np.triu_indices(3, 1)
    np.testing.assert_array_equal(found.second[0][upper], known["S2"][upper])
    np.testing.assert_array_equal(found.second_error[0][upper], known["S2_conf"][upper])
    np.testing.assert_array_equal([found.grid[name] for name in "abc"], points.T)


def test_the_gear(tmp_path):
    gear = fs.systems.harmonic_gear(omega=0.1)

    def motion(D, C):
        return fs.simulate_many(gear, [0, 0], parameters={"D": D, "C": C}, periods=1)

    over = {"D": (0.1, 0.2), "C": (2.5, 3.5)}
    keep = fs.Execution(keep=["maximum x", "minimum x"], store=tmp_path / "gear.zarr", chunk=16)
    found = fs.sobol(motion, over, 16, vectorized=True, execution=keep)
    assert found.outputs == ("maximum x", "minimum x")
    assert found["maximum x", "D"]["total"] > found["maximum x", "C"]["total"]
    assert found.outcome.code == "complete"
    # the store resumes, and the samples depend on the seed alone
    assert fs.sobol(motion, over, 16, vectorized=True, execution=keep).grid == found.grid
    with pytest.raises(fs.ArgumentError, match=r"is of another sweep"):
        fs.sobol(motion, over, 16, vectorized=True, seed=2, execution=keep)
    found.save(tmp_path / "gear.npz")
    again = fs.load(tmp_path / "gear.npz")
    assert again == found
    assert repr(again) == repr(found)


def test_rows_of_all_indices(found):
    rows = found.to_frame()
    assert rows["parameter"].tolist() == [*"abc"]
    assert rows["with c"][0] == found.second[0, 0, 2]
    assert "y, a with c: 0.24" in found.summary()
    assert found["y", "b"]["total"] == rows["total"][1]


def test_the_figure(found):
    drawn = fs.plot.sobol(found)
    np.testing.assert_array_equal(drawn.data["first order"][0][:, 1], found.first[0])
    np.testing.assert_array_equal(drawn.data["total"][0][:, 1], found.total[0])
    ends = [segment[:, 1] for segment in drawn.errors[1].get_segments()]
    np.testing.assert_allclose(np.ptp(ends, axis=1), 2 * found.total_error[0])
    flat = fs.sobol(lambda a: 1.0, {"a": (0, 1)}, 8)
    with pytest.raises(fs.ArgumentError, match="value has no indices to draw: all points are"):
        fs.plot.sobol(flat)
    empty = fs.sobol(lambda a: 1 / 0, {"a": (0, 1)}, 4)
    with pytest.raises(fs.ArgumentError, match="there are no outputs to draw: no indices, as 12"):
        fs.plot.sobol(empty)


def test_any_executor():
    def y(a):
        return 3 * a

    plain = fs.sobol(y, {"a": (0, 1)}, 8)
    with ThreadPoolExecutor(2) as pool:
        shared = fs.sobol(y, {"a": (0, 1)}, 8, execution=fs.Execution(executor=pool, chunk=6))
    assert shared == plain


def test_failed_points_leave_no_indices():
    def root(a, b):
        if a < 0.1:
            raise ValueError("a is too small.")
        return a + b

    found = fs.sobol(root, {"a": (0, 1), "b": (0, 1)}, 16)
    assert found.outcome.code == "points failed"
    assert not found.outcome
    assert re.search(
        r"no indices, as \d of 64 points failed. First failure, at a = 0.0.*: ValueError: a is too",
        repr(found),
    )
    assert np.isnan(found.first).all()
    assert len(found.grid.failures) > 1
    empty = fs.sobol(lambda a: 1 / 0, {"a": (0, 1)}, 4)
    assert (empty.outputs, empty.first.shape) == ((), (0, 1))
    assert repr(empty).startswith("SobolIndices of no output from 12 points")
    assert "as 12 of 12 points failed" in repr(empty)


def test_missing_points_leave_no_indices():
    grid = fs.sobol(lambda a: a, {"a": (0, 1)}, 4).grid
    done = np.arange(12) != 3
    outcome = _outcome(replace(grid, done=done), 4)
    assert (outcome.code, bool(outcome)) == ("incomplete", False)
    assert str(outcome) == "no indices, as 0 of 12 points failed and 1 are missing."


def test_outputs_without_indices():
    def outputs(a, b):
        return {
            "flat": 1e300,
            "gap": None if a > 0.5 else a,
            "tiny": 1e-300 * a,
            "large": 1e300 * b,
        }

    found = fs.sobol(outputs, {"a": (0, 1), "b": (0, 1)}, 64)
    assert found.outcome
    assert found.outcome.notes == (
        "flat does not vary: no indices.",
        "gap is not finite at 128 of 256 points: no indices.",
    )
    assert np.isnan(found.first[:2]).all()
    # in any units
    alone = fs.sobol(lambda a, b: a, {"a": (0, 1), "b": (0, 1)}, 64)
    np.testing.assert_allclose(found.first[2], alone.first[0], rtol=1e-12)
    assert found["large", "b"]["total"] == pytest.approx(1, abs=0.1)


def test_an_unbalanced_number_of_samples_is_noted():
    found = fs.sobol(lambda a: a, {"a": (0, 1)}, 6)
    (note,) = found.outcome.notes
    assert note == "n = 6 is not a power of 2: the samples are not balanced; use 4 or 8."
    assert note in repr(found)


def test_without_salib(monkeypatch):
    monkeypatch.setitem(sys.modules, "SALib", None)
    with pytest.raises(fs.MissingPackageError, match=r"needs SALib, .*'fastslow\[sensitivity\]'"):
        fs.sobol(ishigami, ANGLES, 4)
