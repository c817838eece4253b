"""Parts of sweeps by themselves: executors that break, orders of labels, cells of a map."""

from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

import fastslow as fs
from fastslow.errors import ArgumentError
from fastslow.sweeps import refinement, scheduling, variance_shares
from fastslow.sweeps.batch_stores import POINTS_OF_TASK, BatchStores
from fastslow.sweeps.scheduling import PER_WORKER, UNKNOWN, Lost


class Pool(ProcessPoolExecutor):
    """Computes in this process; each task of ``fatal`` breaks the pool so many times."""

    fatal: dict
    alone: list

    def __init__(self, *_, **__):
        self._max_workers, self._broken, self._mp_context = 2, False, None
        self._initializer, self._initargs = None, ()
        self.running = []

    def submit(self, call, argument):
        if self._broken:
            raise BrokenProcessPool("broken")
        future = Future()
        self.running.append((argument, future))
        if self.fatal.get(argument, 0):
            self.fatal[argument] -= 1
            self._broken = True
            for _, one in self.running:
                if not one.done():
                    one.set_exception(BrokenProcessPool("a process died"))
        else:
            future.set_result(call(argument))
        return future

    def shutdown(self, wait=True, *, cancel_futures=False):
        pass


@pytest.mark.parametrize(("times", "lost"), [(1, []), (2, [4]), (5, [4])])
def test_a_task_that_breaks_the_pool_twice_is_lost_and_no_other(monkeypatch, times, lost):
    monkeypatch.setattr(scheduling, "ProcessPoolExecutor", Pool)
    monkeypatch.setattr(Pool, "fatal", {4: times}, raising=False)
    tasks = [(k, k) for k in range(9)]
    found = dict(scheduling.completed(lambda k: k * k, tasks, Pool()))
    assert sorted(found) == list(range(9))
    assert [k for k, value in found.items() if isinstance(value, Lost)] == lost
    assert {k: v for k, v in found.items() if k not in lost} == {
        k: k * k for k in range(9) if k not in lost
    }


def test_a_bounded_number_of_tasks_is_in_flight():
    taken, done = [], []

    class Slow:
        _max_workers = 3

        def submit(self, call, argument):
            future = Future()
            done.append((future, argument))
            if len(done) >= PER_WORKER * 3:
                for one, value in done:
                    if not one.done():
                        one.set_result(value)
            return future

    def tasks():
        for k in range(12):
            taken.append(k)
            yield k, k

    following = scheduling.completed(None, tasks(), Slow())
    next(following)
    assert len(taken) == PER_WORKER * 3
    following.close()


def test_numbers_of_workers_of_executors_and_clusters():
    client = SimpleNamespace(nthreads=lambda: {"a": 2, "b": 3}, status="running")
    assert scheduling._workers(SimpleNamespace(_client=client)) == 5
    client.status = "closed"
    with pytest.raises(ArgumentError, match="Dask client is closed"):
        scheduling._workers(SimpleNamespace(_client=client))
    assert scheduling._workers(SimpleNamespace(_max_workers=4)) == 4
    assert scheduling._workers(SimpleNamespace()) == 0
    assert scheduling._Workers(SimpleNamespace())._most() == UNKNOWN
    assert scheduling._Workers(SimpleNamespace(_max_workers=4))._most() == 4 * PER_WORKER


def test_errors_of_workers_and_of_functions():
    assert scheduling._died(BrokenProcessPool())
    assert scheduling._died(type("KilledWorker", (Exception,), {})())
    assert not scheduling._died(ValueError())
    error = ValueError("its own")
    assert scheduling._explained(error, None) is error
    sent = scheduling._explained(TypeError("cannot pickle"), SimpleNamespace())
    assert "a SimpleNamespace cannot carry the function" in str(sent)

    class Shut:
        def submit(self, *_):
            raise RuntimeError("cannot schedule new futures after shutdown")

    with pytest.raises(ArgumentError, match="after shutdown; expected one that is open"):
        list(scheduling.completed(str, [(0, 0)], Shut()))


def test_labels_are_in_order_with_failures_last():
    labels, codes = refinement._coded(["b", refinement.FAILED, "a", "b", 2])
    assert labels == (2, "a", "b", refinement.FAILED)
    assert codes.tolist() == [2, 3, 1, 2, 0]
    with pytest.raises(ArgumentError, match="some labels are bools, some counts"):
        refinement._coded([True, 2])


@pytest.mark.parametrize("guard", [0, 1, 2])
def test_cells_of_a_map_tile_the_plane_around_a_line(guard):
    """Cells along x = 0.3 are the finest; with a guard so are those beside them."""
    fine = fs.Refinement(cells=(4, 4), levels=3, guard=guard, resolution=1e-6)
    found = fs.refined_map(lambda x, y: x > 0.3, {"x": (0, 1), "y": (0, 1)}, refinement=fine)
    cells = found.cells
    covered = np.zeros(found.shape, dtype=int)
    for i, j, size in cells.tolist():
        covered[i : i + size, j : j + size] += 1
        finest = i <= 0.3 * 32 < i + size
        if finest:
            assert size == 1
    assert (covered == 1).all()
    # a column of 32 finest cells, and with it those of the divided parents
    columns = np.unique(cells[cells[:, 2] == 1, 0])
    if guard < 2:
        assert columns.tolist() == [[8, 9], [6, 7, 8, 9, 10, 11]][guard]
    assert len(columns) >= 2 + 4 * guard
    edges = found.edges
    line = edges.places[:, 0] + edges.brackets.mean(axis=1)
    assert line / 32 == pytest.approx(0.3, abs=1e-6)
    assert (np.diff(edges.brackets, axis=1) <= 1e-6 * 32).all()


def test_outputs_are_scaled_by_powers_of_two_where_they_vary():
    scaled, reason = variance_shares._scaled(np.array([3e200, -1e200, 0.0]))
    assert (reason, np.abs(scaled).max()) == ("", pytest.approx(0.5 + 0.25, abs=0.25))
    assert np.log2(3e200 / scaled[0]) % 1 == 0
    assert variance_shares._scaled(np.array([1.0, np.nan, np.inf]))[1] == (
        "is not finite at 2 of 3 points"
    )
    assert variance_shares._scaled(np.full(4, 7.0))[1] == "does not vary"


def test_numbers_of_samples_that_are_no_powers_of_two_are_named():
    whole = SimpleNamespace(notes=(), outcome=True)
    assert variance_shares._outcome(whole, 64).notes == ()
    (note,) = variance_shares._outcome(whole, 100).notes
    assert note.startswith("n = 100 is not a power of 2")
    assert note.endswith("use 64 or 128.")


@pytest.mark.parametrize(("chunk", "expected"), [(None, POINTS_OF_TASK), (7, 7)])
def test_batches_of_an_executor_have_tasks_of_a_limited_size(chunk, expected):
    execution = fs.Execution(executor=Pool(), chunk=chunk)
    with BatchStores(execution) as stores:
        assert stores.following({}, None).chunk == expected
    with BatchStores(fs.Execution()) as stores:
        assert stores.following({}, None).chunk is None
