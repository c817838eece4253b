"""Delays, attractors and maps by an executor and with a store, interrupted and resumed."""

import os
from functools import partial

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.delays import scaling_runs
from fastslow.results.io.lock import Lock
from fastslow.sweeps import grid_sweep, survey
from fastslow.sweeps.batch_stores import BatchStores
from fastslow.sweeps.scheduling import Lost
from tests.sweeps.interrupted import content, executor_of

pytestmark = pytest.mark.slow

pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")

x, v = sp.symbols("x v")

RATES = [1e-4, 3e-5, 1e-5, 1e-6]

#: Two wells, which attract from planes of initial states.
WELLS = fs.Model({x: v, v: x - x**3 - v / 2})


@pytest.fixture
def path(tmp_path):
    return tmp_path / "found.zarr"


@pytest.fixture(scope="module")
def delays():
    """The delays past the fold of the cusp, with the given execution."""
    fast = fs.systems.cusp().frozen()
    fold = fs.continue_equilibria(fast, "p", over=(-1, 1)).folds[0]

    def measured(rates=RATES, **given):
        execution = fs.Execution(**given)
        return fs.delay_scaling(fast, fold, rates, level={"x": 0.5}, execution=execution)

    return measured


def wells(seed=1, **given):
    """The attractors of 50 initial states."""
    box = {x: (-2, 2), v: (-1, 1)}
    return fs.attractors(WELLS, box, 50, seed, execution=fs.Execution(**given))


def interrupted_at(monkeypatch, module, name, count):
    """Let a function of a module raise from its call with a number."""
    function, calls = getattr(module, name), []

    def stopping(*given, **named):
        calls.append(1)
        if len(calls) >= count:
            raise KeyboardInterrupt
        return function(*given, **named)

    monkeypatch.setattr(module, name, stopping)


def test_delays_of_an_executor_and_of_a_resumed_store(delays, path, monkeypatch):
    alone, unbroken = delays(), path.with_name("unbroken.zarr")
    with executor_of("processes") as pool:
        assert delays(executor=pool) == alone
    assert delays(store=unbroken) == alone
    with monkeypatch.context() as patch:
        interrupted_at(patch, scaling_runs, "simulate", 3)
        with pytest.raises(KeyboardInterrupt):
            delays(store=path)
    assert [point["rate"] for point in fs.load(path).missing] == [1e-5, 1e-6]
    with executor_of("threads") as pool:
        assert delays(store=path, executor=pool) == alone
    assert content(path) == content(unbroken)
    np.testing.assert_array_equal(fs.load(path)["delay"], alone.delay)
    with pytest.raises(fs.ArgumentError, match=r"axis rate: 4 values from 1e-06 to 0\.0001, now"):
        delays([1e-4, 1e-5], store=path)


def test_a_rate_whose_run_fails_keeps_its_reason_in_a_store(delays, path):
    short = fs.Integration(max_steps=3)
    fast = fs.systems.cusp().frozen()
    fold = fs.continue_equilibria(fast, "p", over=(-1, 1)).folds[0]
    found = fs.delay_scaling(
        fast, fold, RATES, level={"x": 0.5}, integration=short, execution=fs.Execution(store=path)
    )
    assert not found.success.any()
    assert all("after 3 steps" in str(outcome) for outcome in found.outcomes)


def test_attractors_of_an_executor_and_of_a_resumed_store(path, monkeypatch):
    alone, unbroken = wells(), path.with_name("unbroken.zarr")
    assert len(alone) == 2
    with executor_of("processes") as pool:
        assert wells(executor=pool, chunk=20) == alone
    assert wells(store=unbroken, chunk=7) == alone
    with monkeypatch.context() as patch:
        interrupted_at(patch, survey, "final_states", 4)
        with pytest.raises(KeyboardInterrupt):
            wells(store=path, chunk=7)
    assert len(fs.load(path / "batch_1").missing) == 29
    with executor_of("threads") as pool:
        assert wells(store=path, executor=pool) == alone
    assert content(path) == content(unbroken)
    with pytest.raises(fs.ArgumentError, match="axis initial x: 50 values from"):
        wells(2, store=path)
    with pytest.raises(fs.FileError, match="is the store of an adaptive map or of attractors"):
        fs.load(path)


def test_forced_attractors_with_a_store(path):
    """States at the last periods are outputs too; some runs end in later batches."""
    t = sp.Symbol("t")
    duffing = fs.Model({x: v, v: x - x**3 - 0.3 * v + 0.28 * sp.cos(1.2 * t)})
    box = {"x": (-1.5, 1.5), "v": (-1, 1)}
    alone = fs.attractors(duffing, box, 10, 2)
    again = fs.attractors(duffing, box, 10, 2, execution=fs.Execution(store=path, chunk=3))
    assert again == alone
    first = fs.load(path / "batch_1")
    assert first["strobes"].shape == (10, 16, 2)
    np.testing.assert_array_equal(first["initial x"], alone.starts[:, 0])


def fragile(x, y, height):
    """Whether y < height; ends a worker at the corner 0, 0 while a variable is set."""
    if "FRAGILE" in os.environ and np.any(x + y == 0):
        os._exit(1)
    return y < height


@pytest.mark.sample(1)
@pytest.mark.parametrize(("height", "batches"), [(0.9, 3), (2.0, 1)])
def test_a_map_whose_worker_died_is_resumed(path, monkeypatch, height, batches):
    """The corners that failed are computed again; then later batches have other points, or none."""

    def mapped(path, executor=None):
        return fs.refined_map(
            partial(fragile, height=height),
            {"x": (0, 1), "y": (0, 1)},
            refinement=fs.Refinement(cells=(2, 2), levels=2, guard=0),
            execution=fs.Execution(store=path, executor=executor, chunk=3),
        )

    unbroken = path.with_name("unbroken.zarr")
    expected = mapped(unbroken)
    assert len(list(unbroken.glob("batch_*"))) == batches
    monkeypatch.setenv("FRAGILE", "1")
    with executor_of("processes") as pool:
        assert "failed" in mapped(path, pool).labels
    assert len(list(path.glob("batch_*"))) == 3
    monkeypatch.delenv("FRAGILE")
    assert mapped(path) == expected
    assert content(path) == content(unbroken)


def test_batches_of_another_function_are_computed_again(path):
    """As where a batch was resumed, and an attractor found in it changes the length of runs."""
    first, later = (partial(fragile, height=height) for height in (0.5, 0.9))
    axes = {"x": np.array([0.1, 0.7]), "y": np.array([0.2, 0.8])}

    def labels(function, count):
        found = []
        with BatchStores(fs.Execution(store=path)) as stores:
            for _ in range(count):
                execution = stores.following(axes, function)
                found.append(fs.sweep(function, axes, paired=True, execution=execution)["value"])
                function = later
        return found

    np.testing.assert_array_equal(labels(first, 2), [[True, False], [True, True]])
    later = partial(fragile, height=0.1)
    np.testing.assert_array_equal(labels(first, 2), [[True, False], [False, False]])
    with pytest.raises(fs.ArgumentError, match="is of another sweep"):
        labels(later, 1)


def test_a_second_process_on_a_directory_of_batches_is_refused(path):
    wells(store=path)
    over, once = {"x": (0, 1), "y": (0, 1)}, fs.Refinement(cells=(2, 2), levels=0)
    with Lock(path):
        with pytest.raises(fs.FileError, match="is in use by process"):
            wells(store=path)
        with pytest.raises(fs.FileError, match="is in use by process"):
            fs.refined_map(
                lambda x, y: x > y, over, refinement=once, execution=fs.Execution(store=path)
            )
    assert wells(store=path) == wells()


def test_basins_by_an_executor_find_the_same_attractors():
    over, once = {x: (-2, 2), v: (-1, 1)}, fs.Refinement(cells=(3, 3), levels=0)
    with executor_of("threads") as pool:
        by_threads = fs.basins(
            WELLS, over, refinement=once, execution=fs.Execution(executor=pool, chunk=60)
        )
    assert by_threads == fs.basins(WELLS, over, refinement=once)


def test_workers_that_died_leave_no_silence(delays, monkeypatch):
    t = sp.Symbol("t")
    forced = fs.Model({x: -x + sp.sin(t)})
    monkeypatch.setattr(
        grid_sweep, "completed", lambda call, tasks, executor: ((k, Lost()) for k, _ in tasks)
    )
    for found in (wells(), fs.attractors(forced, {"x": (-1, 1)}, 5)):
        assert found.outcome.code == "not settled"
        assert "the worker process died twice" in str(found.outcome)
    measured = delays()
    assert np.isnan(measured.delay).all()
    assert "the worker process died twice" in str(measured.outcomes[3])
