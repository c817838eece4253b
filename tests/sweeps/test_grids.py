"""Sweeps over labelled axes: what the function may return, failures, executors, the grid."""

import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

import fastslow as fs
from fastslow.errors import ArgumentError, FastSlowError
from fastslow.results.base.outcome import Outcome
from fastslow.results.maps.tiles import default_tiles, tiles_of
from fastslow.sweeps.evaluation import Computed, joined
from fastslow.sweeps.function_digest import identity_of
from fastslow.sweeps.scheduling import Lost, completed

pytestmark = pytest.mark.slow

OVER = {"a": [0, 1, 2], "b": [0.5, 1.5, 2.5, 3.5]}


def outputs(a, b):
    """One output of each kind; no value at a = 2."""
    if a == 2 and b > 1:
        raise ValueError("a is two")
    return {"sum": a + b, "word": f"{a:g}" * int(a + 1), "both": [a, b], "less": a < b, "z": a * 1j}


def killed(a, b):
    """End the process of a worker at one point, while the other worker has a task."""
    if (a, b) == (1, 1.5):
        time.sleep(0.1)
        os._exit(1)
    if (a, b) == (1, 2.5):
        time.sleep(0.4)
    return a + b


@pytest.fixture(scope="module")
def grid():
    return fs.sweep(outputs, OVER)


def test_kinds_of_outputs(grid):
    assert grid.dims == ("a", "b")
    assert {name: grid[name].shape for name in grid.outputs} == {
        "sum": (3, 4), "word": (3, 4), "both": (3, 4, 2), "less": (3, 4), "z": (3, 4)
    }  # fmt: skip
    assert [grid[name].dtype.kind for name in grid.outputs] == ["f", "U", "f", "b", "c"]
    assert grid["word"][:, 0].tolist() == ["0", "11", "222"]
    assert grid["sum"][2, 0] == 2.5
    assert np.isnan(grid["sum"][2, 1:]).all()
    assert not grid["sum"].flags.writeable
    np.testing.assert_array_equal(grid["2*sum - a"][:2], 2 * grid["sum"][:2] - [[0], [1]])
    with pytest.raises(fs.ArgumentError, match="word is text; expressions are of numbers"):
        grid["word + 1"]
    with pytest.raises(fs.UnknownNameError, match="unknown column 'summ'; did you mean 'sum'"):
        grid["summ"]


def test_failures_are_counted_and_named(grid):
    assert len(grid.failures) == 3
    point, text = grid.failures[0]
    assert (dict(point), text) == ({"a": 2.0, "b": 1.5}, "ValueError: a is two")
    assert (grid.outcome.code, bool(grid.outcome), grid.missing) == ("points failed", False, ())
    assert "3 of 12 points failed" in repr(grid)
    with pytest.raises(ValueError, match="a is two") as caught:
        fs.sweep(outputs, OVER, execution=fs.Execution(errors="raise"))
    assert caught.value.__notes__ == ["at a = 2, b = 1.5"]


def test_queries(grid):
    assert dict(grid.at(a=1, b=1.5))["sum"] == 2.5
    assert [point["less"] for point in grid.at(a=[0, 1], b=0.5)] == [True, False]
    for values, message in (
        ({"a": 2, "b": 1.5}, "the point a = 2, b = 1.5 failed: ValueError"),
        ({"a": 0.9, "b": 1.5}, "a = 0.9 is not a value of this axis; the nearest are 0, 1"),
        ({"a": 1}, "expected a value of each of a, b"),
        ({"a": "1", "b": 1.5}, "expected a number"),
    ):
        with pytest.raises(fs.ArgumentError, match=message):
            grid.at(**values)
    part = grid.select(a=(1, 2), b=1.5)
    assert part.shape == (2, 1)
    assert [dict(point) for point, _ in part.failures] == [{"a": 2, "b": 1.5}]
    few = grid.select("sum > 2", less=True)
    assert few.paired
    assert few["a"].tolist() == [0, 0, 1, 1, 1]
    assert few.at(a=1, b=3.5)["sum"] == 4.5
    assert few.select(a=0)["b"].tolist() == [2.5, 3.5]
    assert len(grid.select(word="11")) == 4
    with pytest.raises(fs.UnknownNameError, match="unknown axis or output 'c'"):
        grid.select(c=1)
    with pytest.raises(fs.ArgumentError, match="sum is a number; select it by a condition"):
        grid.select(sum=1.0)
    with pytest.raises(fs.UnknownNameError, match="unknown word 'x'"):
        grid.select(word="x")
    with pytest.raises(fs.ArgumentError, match="no value of this axis is within"):
        grid.select(a=(5, 6))


def test_files_frames_and_datasets(grid, tmp_path):
    grid.save(tmp_path / "grid.npz")
    assert fs.load(tmp_path / "grid.npz") == grid
    frame = grid.to_frame()
    assert list(frame) == ["a", "b", "sum", "word", "both_1", "both_2", "less", "z", "failure"]
    assert frame["failure"].value_counts()["ValueError: a is two"] == 3
    data = grid.to_xarray()
    assert data["both"].dims == ("a", "b", "both_axis1")
    assert float(data["sum"].sel(a=1, b=2.5)) == 3.5
    assert int(data["computed"].sum()) == 9
    assert data.attrs["function"].endswith("test_grids.outputs")


def test_units_of_axes_and_outputs(tmp_path):
    units = {"a": "mm", "sum": "N m", "both": "1/s"}
    grid = fs.sweep(outputs, OVER, units=units)
    assert "a: 3 values from 0 to 2 in mm" in repr(grid)
    assert "both: an array of numbers of shape (2,) in 1/s" in repr(grid)
    data = grid.to_xarray()
    found = {str(name): array.attrs.get("units") for name, array in data.variables.items()}
    assert {name: unit for name, unit in found.items() if unit} == units
    assert grid.to_frame().attrs["units_sum"] == "N m"
    grid.save(tmp_path / "grid.nc")
    assert fs.load(tmp_path / "grid.nc").units == units == grid.select(a=(1, 2)).units


def test_paired_axes():
    over = {"a": [0, 1, 1], "b": [0.5, 0.5, 1.5]}
    grid = fs.sweep(outputs, over, paired=True)
    assert grid["sum"].tolist() == [0.5, 1.5, 2.5]
    assert grid.at(a=1, b=1.5)["sum"] == 2.5
    with pytest.raises(fs.ArgumentError, match=r"a = 0, b = 1\.5 is not one of the points"):
        grid.at(a=0, b=1.5)
    with pytest.raises(fs.ArgumentError, match="equally many values, received 3 of a, 2 of b"):
        fs.sweep(outputs, {**over, "b": [1, 2]}, paired=True)


def test_axes_keep_their_types():
    grid = fs.sweep(lambda n, s, f: f"{n!r} {s!r} {f!r}", {"n": [1], "s": ["x"], "f": [True]})
    assert grid["value"].item() == "1 'x' True"
    assert grid.at(n=1, s="x", f=True)["value"] == "1 'x' True"
    with pytest.raises(fs.ArgumentError, match="s = 'y' is not a value of this axis"):
        grid.at(n=1, s="y", f=True)


def test_results_are_kept_by_column():
    model = fs.systems.harmonic_gear(omega=0.1)

    def motions(D, C):
        return fs.simulate_many(model, [0, 0], parameters={"D": D, "C": C}, periods=1)

    over = {"D": [0.05, 0.2], "C": [2.3, 2.5, 2.7]}
    keep = fs.Execution(keep=["regime", "maximum x", "final"], chunk=2)
    grid = fs.sweep(motions, over, vectorized=True, execution=keep)
    D, C = (part.ravel() for part in np.meshgrid(*over.values(), indexing="ij"))
    many = motions(D, C)
    np.testing.assert_array_equal(grid["final"].reshape(6, 2), many.final)
    np.testing.assert_array_equal(grid["maximum x"].ravel(), many["maximum x"])
    assert grid["regime"].ravel().tolist() == many.regime.tolist()
    assert "x' = v" in grid.equations
    with pytest.raises(fs.ArgumentError, match="returned a Ensemble; name the columns to keep"):
        fs.sweep(motions, over, vectorized=True)
    with pytest.raises(fs.UnknownNameError, match="unknown column of Ensemble to keep 'regimes'"):
        fs.sweep(motions, over, vectorized=True, execution=fs.Execution(keep=["regimes"]))
    with pytest.raises(fs.UnknownNameError, match=r"unknown column 'width' \(known: "):
        fs.sweep(motions, over, vectorized=True, execution=fs.Execution(keep=["2*width"]))


def test_results_that_ended_early_are_failures():
    model = fs.systems.harmonic_gear(omega=0.1)
    short = fs.Integration(max_steps=3)

    def run(D):
        return fs.simulate(model.with_parameters(D=D), [0, 0], periods=1, integration=short)

    def many(D):
        sets = {"D": D}
        return fs.simulate_many(model, [0, 0], parameters=sets, periods=1, integration=short)

    for function, vectorized in ((run, False), (many, True)):
        keep = fs.Execution(keep=["n_steps" if vectorized else "span"])
        grid = fs.sweep(function, {"D": [0.1, 0.2]}, vectorized=vectorized, execution=keep)
        assert "after 3 steps; raise max_steps=" in grid.failures[1][1]


def test_a_point_that_raises_does_not_affect_others_of_its_array():
    def roots(a):
        if (a == 3).any():
            raise ValueError("three")
        return np.sqrt(a)

    grid = fs.sweep(roots, {"a": np.arange(9)}, vectorized=True)
    assert [(point["a"], text) for point, text in grid.failures] == [(3, "ValueError: three")]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(grid["value"])), [3])


@pytest.mark.parametrize("chunk", [1, 3, 4, 8])
def test_results_do_not_depend_on_executor_and_chunks(grid, chunk):
    with ThreadPoolExecutor(3) as pool:
        again = fs.sweep(outputs, OVER, execution=fs.Execution(executor=pool, chunk=chunk))
    assert again == grid


def test_points_are_evaluated_in_worker_processes(grid):
    with ProcessPoolExecutor(2) as pool:
        again = fs.sweep(outputs, OVER, execution=fs.Execution(executor=pool))
        assert again == grid
        with pytest.raises(fs.ArgumentError, match="put it into a module"):
            fs.sweep(lambda a: a, {"a": [1]}, execution=fs.Execution(executor=pool))
    with pytest.raises(fs.ArgumentError, match="after shutdown; expected one that is open"):
        fs.sweep(outputs, OVER, execution=fs.Execution(executor=pool))


def test_executors_that_are_none_or_shut_down():
    for given in (3, ThreadPoolExecutor):
        with pytest.raises(fs.ArgumentError, match=r"expected a concurrent\.futures\.Executor, su"):
            fs.Execution(executor=given)
    with ThreadPoolExecutor(1) as pool:
        pass
    shut = fs.Execution(executor=pool)
    over = {"x": (0, 1), "y": (0, 1)}
    with pytest.raises(fs.ArgumentError, match="after shutdown; expected one that is open"):
        fs.refined_map(lambda x, y: x > y, over, execution=shut)


@pytest.mark.parametrize("chunk", [2, 4])
def test_outputs_that_change_between_tasks(chunk):
    for function, message in (
        (lambda a, b: 1 if a < 2 else "x", "value is text at one point, a number at another"),
        (lambda a, b: [1] * (1 + (a > 1)), r"numbers of shape \(2,\) at one point, .*\(1,\) at"),
        (lambda a, b: {"x": 1} if a < 2 else {"y": 1}, "the outputs y at one point, x at another"),
    ):
        with pytest.raises(fs.ArgumentError, match=message):
            fs.sweep(function, OVER, execution=fs.Execution(chunk=chunk))


def test_a_parameter_that_the_model_does_not_have():
    gear = fs.systems.harmonic_gear(omega=0.1)

    def motions(E):
        return fs.simulate_many(gear, [0, 0], parameters={"E": E}, periods=1)

    execution = fs.Execution(keep=["regime"])
    grid = fs.sweep(motions, {"E": [0.1, 0.2]}, vectorized=True, execution=execution)
    assert "2 of 2 points failed" in repr(grid)
    assert "at E = 0.1: UnknownNameError: unknown parameter 'E'" in repr(grid)


def test_a_worker_that_dies_fails_its_task_after_two_tries():
    with ProcessPoolExecutor(2) as pool:
        grid = fs.sweep(killed, OVER, execution=fs.Execution(executor=pool, chunk=2))
    assert [dict(point) for point, _ in grid.failures] == [{"a": 1, "b": 0.5}, {"a": 1, "b": 1.5}]
    assert "died twice" in grid.failures[0][1]
    assert grid["value"][2, 3] == 5.5
    assert np.isnan(grid["value"]).sum() == 2


def test_a_bounded_number_of_tasks_is_in_flight():
    taken, most = [], []

    def tasks():
        for k in range(20):
            taken.append(k)
            yield k, k

    with ThreadPoolExecutor(2) as pool:
        for count, (_, found) in enumerate(completed(lambda k: time.sleep(0.001), tasks(), pool)):
            assert not isinstance(found, Lost)
            most.append(len(taken) - count)
    assert max(most) == 4


def test_threads_of_a_task():
    def threads(a):
        return fs.Execution().workers

    with ThreadPoolExecutor(2) as pool:
        own = fs.sweep(threads, {"a": [0]}, execution=fs.Execution(executor=pool))["value"]
        given = fs.Execution(executor=pool, threads=3)
        assert own.tolist() == [1]
        assert fs.sweep(threads, {"a": [0]}, execution=given)["value"].tolist() == [3]
    assert fs.sweep(threads, {"a": [0]})["value"].tolist() == [fs.Execution().workers]


def test_an_interrupt_ends_the_sweep():
    begun = threading.Event()

    def interrupted(a):
        begun.set()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fs.sweep(interrupted, {"a": [0, 1]})
    assert begun.is_set()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda a, b: None, r"the function returned nothing \(None\)"),
        (lambda a, b: [1] * int(b), r"an array of numbers of shape \(0,\) at another"),
        (lambda a, b: 1 if a else "x", "value is a number at one point, text at another"),
        (lambda a, b: 1j if a else 1.0, r"return float\(…\) or complex\(…\)"),
        (lambda a, b: {"x": 1} if a else {"y": 1}, "returned the outputs x at one point, y at"),
        (lambda a, b: {}, "returned an empty mapping"),
        (lambda a, b: object(), "expected a number, text, a bool or an array"),
        (lambda a, b: {"x": [1, [2, 3]]}, "expected a number, text, a bool or an array"),
    ],
)
def test_outputs_that_are_refused(function, message):
    with pytest.raises(fs.ArgumentError, match=message):
        fs.sweep(function, OVER)


@pytest.mark.parametrize(
    ("over", "message"),
    [
        ({}, "expected the values of at least one axis"),
        ({"a": [], "b": [1]}, "values: a has no values"),
        ({"a": [0, 0], "b": [1]}, "values: a has the value 0 more than once"),
        ({"a": [np.nan], "b": [1]}, "a has values that are not finite"),
        ({"a": 1.0, "b": [1]}, "expected a sequence of numbers, text or bools"),
        ({"a": [[1.0]], "b": [1]}, "expected a sequence of numbers, text or bools"),
        ({"a": "xy", "b": [1]}, "a = 'xy'; expected several values"),
        ({"a": [1]}, "the function also needs values of b; received axes a"),
        ({"a": [1], "point": [1]}, "the name point is used by the grid"),
    ],
)
def test_axes_that_are_refused(over, message):
    with pytest.raises(fs.ArgumentError, match=message):
        fs.sweep(outputs, over)


def test_further_refusals():
    with pytest.raises(fs.UnknownNameError, match="unknown argument of the function 'aa'"):
        fs.sweep(outputs, {"aa": [1], "b": [1]})
    with pytest.raises(fs.UnknownNameError, match="unknown output to keep 'su'; did you mean"):
        fs.sweep(outputs, OVER, execution=fs.Execution(keep=["su"]))
    with pytest.raises(fs.ArgumentError, match="1 values of value for 12 points"):
        fs.sweep(lambda a, b: [1.0], OVER, vectorized=True)
    with pytest.raises(fs.ArgumentError, match="a single value of value for 12 points"):
        fs.sweep(lambda a, b: 1.0, OVER, vectorized=True)
    with pytest.raises(fs.ArgumentError, match="chunk = 5; expected at most one row of 4 points"):
        fs.sweep(outputs, OVER, execution=fs.Execution(chunk=5))
    large = {"a": range(10**6), "b": [1]}
    with pytest.raises(fs.ArgumentError, match=r"of a task of 1000 points take .* GB, of which"):
        fs.sweep(lambda a, b: np.broadcast_to(1.0, 10**9), large)
    with pytest.raises(fs.ArgumentError, match=r"the outputs of all points take .* GB, of which"):
        fs.sweep(lambda a, b: np.zeros(10**5), large, execution=fs.Execution(chunk=1))
    with pytest.raises(FastSlowError, match="the run failed"):
        fs.sweep(
            lambda a, b: Outcome("failed", "the run failed.", False),
            OVER,
            execution=fs.Execution(errors="raise"),
        )


def test_computations_in_threads_of_this_process_refuse_executors():
    gear = fs.systems.harmonic_gear()
    with ThreadPoolExecutor(1) as pool:
        for given in ({"executor": pool}, {"store": "a.zarr"}, {"errors": "raise"}):
            (name,) = given
            with pytest.raises(fs.ArgumentError, match=f"execution: {name}= is for fs.sweep"):
                fs.simulate_many(gear, [0, 0], periods=1, execution=fs.Execution(**given))


def test_tiles_cover_every_point_once():
    for shape in [(5,), (3, 4), (2, 3, 4), (1, 7)]:
        whole = np.arange(np.prod(shape)).reshape(shape)
        for tiles in [default_tiles(shape, n) for n in (1, 3, 7, 100)] + [tiles_of(shape, 2)]:
            rows = [np.r_[tiles.points(k)] for k in range(len(tiles))]
            np.testing.assert_array_equal(np.concatenate(rows), whole.ravel())
            for k, row in enumerate(rows):
                np.testing.assert_array_equal(whole[tiles.slices(k)].ravel(), row)
            marks = np.arange(len(tiles)).reshape(tiles.counts)
            spread = tiles.spread(marks).ravel()
            assert all((spread[row] == k).all() for k, row in enumerate(rows))


def test_the_identity_of_a_function():
    def scaled(c, power=2):
        return lambda a: c * a**power

    def other(c):
        return lambda a: c * a

    same = identity_of(scaled(2.0))
    assert identity_of(scaled(2.0)) == same
    digests = {
        identity_of(function).digest
        for function in (
            scaled(2.0), scaled(3.0), scaled(2.0, 3), other(2.0), partial(outputs, a=1),
            partial(outputs, a=2), outputs,
        )
    }  # fmt: skip
    assert len(digests) == 7
    gear = fs.systems.harmonic_gear()
    models = {identity_of(scaled(m)).digest for m in (gear, gear.with_parameters(D=0.3))}
    assert len(models) == 2
    defaults = [identity_of(lambda a, c=c: a * c).digest for c in (1, 2)]
    assert defaults[0] != defaults[1]

    def by_class(factor):
        class Scale:
            def __init__(self, a):
                self.a = a * factor

        return lambda a: Scale(a).a

    methods = [identity_of(by_class(factor)).digest for factor in (1, 2)]
    assert methods[0] != methods[1]
    hidden = identity_of(scaled(threading.Lock()))
    assert hidden.undigested == ("c (lock)",)
    lock = threading.Lock()
    grid = fs.sweep(lambda a: a if lock else None, {"a": [1]})
    assert "cannot verify that these values of the function are unchanged" in str(grid.outcome)
    assert bool(grid.outcome)


def test_parts_of_a_batch_have_outputs_of_one_kind():
    whole = Computed(2, {"y": np.array([1.0, 2.0])})
    failed = Computed(1, {}, {0: "no value"})
    both = joined([failed, whole])
    np.testing.assert_array_equal(both.outputs["y"], [np.nan, 1.0, 2.0])
    assert both.failures == {0: "no value"}
    with pytest.raises(ArgumentError, match="expected the same at all"):
        joined([whole, failed, Computed(1, {"y": np.array([True])})])


@pytest.mark.parametrize("vectorized", [False, True])
def test_what_the_handler_of_a_signal_raises_is_no_failure_of_a_point(vectorized):
    def late(number, frame):
        raise TimeoutError("too late")

    def slow(a):
        signal.raise_signal(signal.SIGINT)
        return a

    before = signal.signal(signal.SIGINT, late)
    try:
        with pytest.raises(TimeoutError, match="too late"):
            fs.sweep(slow, {"a": [0.0, 1.0]}, vectorized=vectorized)
    finally:
        signal.signal(signal.SIGINT, before)
