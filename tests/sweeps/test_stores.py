"""Stores of sweeps: what they contain, resuming after kills, locks, full disks, other sweeps."""

import errno
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.io import lock, zarr_store
from fastslow.results.io.store_checksums import read_attributes, verified_arrays, write_group
from fastslow.results.io.zarr_store import ZarrStore, translated
from fastslow.sweeps import scheduling
from fastslow.sweeps.collecting import Stored
from tests.campaigns.stores import campaign as damaged_stores
from tests.sweeps.interrupted import (
    OVER,
    ROOT,
    content,
    executor_of,
    killed_and_resumed,
    point,
)

pytestmark = pytest.mark.slow

zarr = pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")

quick = partial(point, seconds=0.0)


class Flag:
    """A flag that is no value of a function that reads it: a file, which exists where it is set."""

    def __init__(self, file):
        self.file = file

    def is_set(self):
        return self.file.exists()

    def set(self):
        self.file.touch()

    def clear(self):
        self.file.unlink()


def sweep(path, function=quick, over=OVER, **given):
    paired = given.pop("paired", False)
    given.setdefault("chunk", 10 if "b" in over and not paired else 1)
    return fs.sweep(function, over, paired=paired, execution=fs.Execution(store=path, **given))


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """The path of a store that was written without interruption, and its grid."""
    path = tmp_path_factory.mktemp("unbroken") / "map.zarr"
    return path, sweep(path, partial(point, seconds=0.01), chunk=5)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "map.zarr"


def test_a_store_is_the_same_grid_as_in_memory(path):
    grid = sweep(path, chunk=20)
    assert grid == fs.sweep(quick, OVER) == fs.load(path)
    assert list(path.parent.iterdir()) == [path]
    assert not grid["sum"].flags.writeable
    grid.save(path.with_name("grid.npz"))
    assert fs.load(path.with_name("grid.npz")) == grid
    part = grid.select(a=(2, 4))
    np.testing.assert_array_equal(part["word"], grid["word"][2:5])


def test_xarray_opens_a_store(unbroken):
    xarray = pytest.importorskip("xarray")
    path, grid = unbroken
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        data = xarray.open_zarr(path)
    assert data["sum"].dims == ("a", "b")
    assert data["both"].dims == ("a", "b", "both_axis1")
    assert data["done"].dims == ("a_task", "b_task")
    np.testing.assert_array_equal(data["sum"].sel(a=3), grid["sum"][3])
    assert data["word"].values.astype("U20").tolist() == grid["word"].tolist()
    assert str(data["failure"].sel(a=7, b=0).values) == "ValueError: no value"
    assert data.attrs["fastslow"]["versions"]["numpy"] == np.__version__


def test_paired_axes_in_a_store(path):
    over = {"a": [1, 1, 2], "b": [0.0, 0.5, 0.5]}
    grid = sweep(path, over=over, paired=True, chunk=2)
    assert grid == fs.load(path) == fs.sweep(quick, over, paired=True)
    xarray = pytest.importorskip("xarray")
    assert list(xarray.open_zarr(path).coords) == ["a", "b"]


def test_units_in_a_store(path):
    xarray = pytest.importorskip("xarray")
    execution, units = fs.Execution(store=path), {"a": "mm", "sum": "N m"}
    grid = fs.sweep(quick, OVER, units=units, execution=execution)
    assert fs.load(path) == grid == fs.sweep(quick, OVER, units=units)
    data = xarray.open_zarr(path)
    assert (data["a"].attrs, data["sum"].attrs) == ({"units": "mm"}, {"units": "N m"})
    with pytest.raises(fs.ArgumentError, match=r"units: a = mm, sum = N m, now a = m"):
        fs.sweep(quick, OVER, units={"a": "m"}, execution=execution)


def test_a_finished_store_is_not_computed_again(path):
    finished = Flag(path.with_name("finished"))

    def once(a):
        assert not finished.is_set()
        return a

    first = sweep(path, once, {"a": [1, 2, 3]})
    before = content(path)
    finished.set()
    assert sweep(path, once, {"a": [1, 2, 3]}) == first
    assert content(path) == before


def test_kills_at_random_moments_leave_the_same_bytes(unbroken, path):
    missing, grid = killed_and_resumed(path, seed=1, kinds=("threads",))
    assert grid == unbroken[1]
    assert content(path) == content(unbroken[0])
    assert missing[0] > 0


def test_an_exception_in_the_middle_keeps_what_is_done(path):
    class Interrupted(KeyboardInterrupt):
        pass

    stop = Flag(path.with_name("stop"))

    def interrupted(a, b):
        if (a, b) == (5, 0.0) and not stop.is_set():
            raise Interrupted
        return quick(a, b)

    with pytest.raises(Interrupted):
        sweep(path, interrupted)
    grid = fs.load(path)
    assert len(grid.missing) == 70
    assert grid.outcome.code == "incomplete"
    assert "70 of 120 points are missing" in repr(grid)
    with pytest.raises(fs.ArgumentError, match="the point a = 5, b = 0 is not computed yet"):
        grid.at(a=5, b=0.0)
    stop.set()
    assert sweep(path, interrupted).outcome.code == "points failed"


def test_another_sweep_is_refused(path):
    sweep(path)

    def other(a, b):
        return a

    for given, message in (
        ({"over": {**OVER, "a": [1, 2]}}, "axis a: 12 values from 0 to 11, now 1, 2"),
        ({"over": {**OVER, "a": OVER["a"] + 0.5}}, "axis a: 12 values from 0 to 11, now 12 val"),
        ({"over": {"b": OVER["b"], "a": OVER["a"]}}, "axes: a, b, now b, a"),
        ({"over": {"a": [1], "b": [0.5]}, "paired": True}, "paired: False, now True"),
        ({"function": other}, "function: tests.sweeps.interrupted.point, now .*other"),
        ({"function": partial(point, seconds=1e-9)}, "the code of .*point or values that it"),
        ({"keep": ["sum"]}, "settings: .* keep = None, now .* keep = sum"),
        ({"chunk": 5}, "tasks: 1, 10, now 1, 5"),
        ({"resume": False}, "exists; expected resume=True to continue it"),
    ):
        with pytest.raises(fs.ArgumentError, match=message):
            sweep(path, **given)
    about = read_attributes(path)["fastslow"]
    about["versions"]["numpy"] = "1.0"
    write_group(path, {"fastslow": about}, verified_arrays(path))
    with pytest.raises(fs.ArgumentError, match=r"versions: .* numpy = 1\.0, .* now"):
        sweep(path)
    about["format"] = 99
    write_group(path, {"fastslow": about}, ())
    for call in (sweep, fs.load):
        with pytest.raises(fs.FileError, match=r"in format 99 of stores.*upgrade it"):
            call(path)


def test_paths_that_are_no_stores(path):
    path.write_text("x")
    with pytest.raises(fs.FileError, match="is a file; expected the directory of a Zarr store"):
        sweep(path)
    path.unlink()
    (path / "inside").mkdir(parents=True)
    with pytest.raises(fs.FileError, match="is a directory without a Zarr group"):
        sweep(path)
    zarr.create_group(path, overwrite=True)
    for call in (sweep, fs.load):
        with pytest.raises(fs.FileError, match="was not written by a sweep of fastslow"):
            call(path)
    with pytest.raises(fs.FileError, match="No such file"):
        sweep(path / "nowhere" / "map.zarr")


def test_a_store_that_was_killed_before_its_marks(path):
    grid = sweep(path)
    write_group(path, {"fastslow": read_attributes(path)["fastslow"]}, ())
    with pytest.raises(fs.FileError, match="has no marks yet"):
        fs.load(path)
    assert sweep(path) == grid


def test_a_damaged_store(path):
    sweep(path)
    (path / "done" / "zarr.json").write_text("{")
    for call in (sweep, fs.load):
        with pytest.raises(fs.FileError, match="is damaged, or no store of a sweep"):
            call(path)


def test_damages_are_noticed_on_load_and_on_resume():
    """A sample of the campaign, in which some damages are mended and some refused."""
    report = damaged_stores(20, 3)
    assert not report.failures, str(report)
    assert len(report.outcomes) > 1


def test_a_resumed_store_names_damaged_tasks_that_it_computes_again(path):
    over = {"a": [1, 2, 3]}
    grid = sweep(path, double, over)
    (path / "value" / "c" / "1").unlink()
    with pytest.raises(fs.FileError, match=r"1 of 3 tasks .* the first in one of .*value/c/1"):
        fs.load(path)
    again = sweep(path, double, over)
    assert again["value"].tolist() == grid["value"].tolist()
    assert "Files of 1 tasks of the store were damaged" in str(again.outcome)
    assert fs.load(path) == sweep(path, double, over) == grid


def test_xarray_notices_a_flipped_bit(path):
    xarray = pytest.importorskip("xarray")
    sweep(path, double, {"a": [1, 2, 3]})
    chunk = path / "value" / "c" / "1"
    content = bytearray(chunk.read_bytes())
    content[-6] ^= 4
    chunk.write_bytes(content)
    with pytest.raises(ValueError, match="checksum"):
        xarray.open_zarr(path)["value"].load()


def test_loading_executes_nothing(path):
    """A function that is gone is not needed, and nothing is unpickled."""
    scope = {}
    exec("def gone(a): return 2 * a", scope)
    sweep(path, scope["gone"], {"a": [1, 2]})
    assert fs.load(path)["value"].tolist() == [2, 4]
    assert b"pickle" not in b"".join(file.read_bytes() for file in path.rglob("zarr.json"))


@contextmanager
def owner(path, **changes):
    """A lock file of another process."""
    mine = lock.Lock(path)
    made = {**json.loads(mine._content()), "token": "0123", **changes}
    mine.file.write_text(json.dumps(made))
    yield mine.file


def test_a_second_process_is_refused(path):
    sweep(path)
    sleeper = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    begun = lock._started(sleeper.pid)
    refusal = f"is in use by process {sleeper.pid} of .* on {socket.gethostname()}"
    with owner(path, process=sleeper.pid, started=begun) as file:
        with pytest.raises(fs.FileError, match=refusal):
            sweep(path)
        assert len(fs.load(path).missing) == 0
        sleeper.kill()
        sleeper.wait()
        sweep(path)
        assert not file.exists()
    sleeper.stdin.close()
    # the number of a dead process now belongs to another one
    with owner(path, process=os.getppid(), started="0") as file:
        sweep(path)
        assert not file.exists()


def test_locks_of_other_computers_and_of_this_process(path):
    sweep(path)
    with owner(path, host="elsewhere") as file:
        with pytest.raises(fs.FileError, match="on elsewhere; wait for it, or use another store"):
            sweep(path)
        os.utime(file, (0, 0))
        sweep(path)
        assert not file.exists()
    with lock.Lock(path), pytest.raises(fs.FileError, match="is in use by process"):
        sweep(path)
    with owner(path) as file:
        claim = file.with_name(f"{file.name}.0123")
        claim.touch()
        os.utime(file, (0, 0))
        with owner(path, host="elsewhere") as file:
            os.utime(file, (0, 0))
            with pytest.raises(fs.FileError, match="is being taken over by another process"):
                sweep(path)


def test_a_sweep_whose_lock_was_taken_over_stops(path, monkeypatch):
    monkeypatch.setattr(lock, "BEAT", 0.01)

    def robbed(a):
        if a == 3:
            with owner(path, host="elsewhere"):
                time.sleep(0.1)
        return a

    with pytest.raises(fs.FileError, match=r"was taken over by another process: .* on elsewhere"):
        sweep(path, robbed, {"a": [1, 2, 3, 4]})


@contextmanager
def small_disk(folder):
    """A disk of 400 kB."""
    disk = folder / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=400k", "none", str(disk)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no disk can be mounted here")
    try:
        yield disk
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_disk_that_is_read_only(tmp_path):
    with small_disk(tmp_path) as disk:
        grid = sweep(disk / "map.zarr", over={"a": [1, 2], "b": [0.0]})
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        for name in ("map.zarr", "new.zarr"):
            with pytest.raises(fs.FileError, match="cannot be written: Read-only file system"):
                sweep(disk / name, over={"a": [1, 2], "b": [0.0]})
        with pytest.raises(fs.FileError, match="cannot be written: Read-only file system"):
            fs.refined_map(
                lambda x, y: x > y,
                {"x": (0, 1), "y": (0, 1)},
                execution=fs.Execution(store=disk / "refined.zarr"),
            )
        assert fs.load(disk / "map.zarr") == grid


def test_a_write_for_which_there_is_no_space(path, monkeypatch):
    """By an error of the system, where no disk can be mounted."""
    over, write = {"a": [1, 2, 3]}, ZarrStore.write

    def full(store, k, outputs, failures):
        if k == 1:
            with translated(store.path, "written", store._resumable()):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(store, k, outputs, failures)

    with monkeypatch.context() as patch:
        patch.setattr(ZarrStore, "write", full)
        with pytest.raises(fs.FileError, match=r"No space left on device; 1 of 3 tasks are stored"):
            sweep(path, double, over)
    assert [point["a"] for point in fs.load(path).missing] == [2, 3]
    assert sweep(path, double, over)["value"].tolist() == [2.0, 4.0, 6.0]


def double(a):
    return 2 * a


@pytest.mark.parametrize(
    ("owner", "name", "after", "kind"),
    [
        (ZarrStore, "create", False, "none"),
        (ZarrStore, "create", True, "none"),
        (ZarrStore, "write", False, "threads"),
        (ZarrStore, "write", True, "threads"),
        (ZarrStore, "mark", False, "none"),
        (ZarrStore, "_create_outputs", True, "none"),
        (zarr_store, "write_group", False, "none"),
        (zarr_store, "write_group", True, "none"),
        (ZarrStore, "flush", False, "none"),
        (ZarrStore, "flush", True, "none"),
        (lock.Lock, "check", False, "threads"),
        (lock.Lock, "_acquire", True, "none"),
        (Stored, "grid", False, "none"),
        (Stored, "_open", True, "none"),
        (scheduling, "wait", False, "threads"),
        (scheduling, "wait", True, "threads"),
    ],
)
def test_interrupts_at_each_place(path, monkeypatch, owner, name, after, kind):
    """The second call of a function is interrupted, or the only one."""
    expected = sweep(path.with_name("unbroken.zarr"), double, {"a": [1, 2, 3]})
    function, calls = getattr(owner, name), []
    once = name in ("create", "_acquire", "grid", "_open", "_create_outputs", "flush", "wait")

    def interrupted(*given, **named):
        calls.append(name)
        if len(calls) == 2 or once:
            if after:
                function(*given, **named)
            raise KeyboardInterrupt
        return function(*given, **named)

    with monkeypatch.context() as patch, executor_of(kind) as pool:
        patch.setattr(owner, name, interrupted)
        with pytest.raises(KeyboardInterrupt):
            sweep(path, double, {"a": [1, 2, 3]}, executor=pool)
    with executor_of(kind) as pool:
        assert sweep(path, double, {"a": [1, 2, 3]}, executor=pool) == expected
    assert content(path) == content(path.with_name("unbroken.zarr"))
    assert not path.with_name("map.zarr.lock").exists()


def test_a_disk_that_is_full(tmp_path):
    with small_disk(tmp_path) as disk:
        path, filler = disk / "map.zarr", disk / "filler"
        once, numbers = Flag(tmp_path / "once"), np.random.default_rng(1).random(64)

        def large(a):
            if a == 20 and not once.is_set():
                once.set()
                with suppress(OSError), filler.open("wb", buffering=0) as file:
                    while file.write(bytes(4096)):
                        pass
            return numbers + a

        with pytest.raises(fs.FileError, match=r"No space left on device; \d+ of 40 tasks are st"):
            sweep(path, large, {"a": np.arange(40)})
        assert 0 < len(fs.load(path).missing) < 40
        filler.unlink()
        grid = sweep(path, large, {"a": np.arange(40)})
        np.testing.assert_array_equal(grid["value"], numbers + np.arange(40)[:, None])
        assert not list(path.rglob("*.partial"))


def script_of_the_page(folder):
    """Write the script of the how-to, over fewer points, and import it."""
    page = (ROOT / "docs" / "how-to" / "clusters.md").read_text(encoding="utf-8")
    code = page.partition("This is `gears.py`")[2].split("```")[1].removeprefix("text\n")
    fewer = code.replace("400", "8").replace("250", "10").replace("keep=", "chunk=20, keep=")
    (folder / "gears.py").write_text(fewer, encoding="utf-8")
    return import_module("gears")


def test_workers_of_dask_and_one_that_is_killed(unbroken, path, monkeypatch):
    pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    # what workers import, before they begin
    monkeypatch.syspath_prepend(path.parent)
    monkeypatch.chdir(path.parent)
    gears = script_of_the_page(path.parent)
    alone, store = gears.regimes(), path.with_name("gears.zarr")
    expected = content(store)
    shutil.rmtree(store)
    with executor_of("dask") as executor:
        client = executor._client
        scale = 2.0
        grid = fs.sweep(
            lambda a: scale * a, {"a": [1, 2]}, execution=fs.Execution(executor=executor)
        )
        assert grid["value"].tolist() == [2.0, 4.0]
        held = threading.Lock()
        with pytest.raises(fs.ArgumentError, match="cannot carry the function to its workers"):
            fs.sweep(lambda a: held, {"a": [1]}, execution=fs.Execution(executor=executor))
        assert gears.regimes(executor) == alone
        assert content(store) == expected
        first = next(iter(client.run(os.getpid).values()))
        threading.Timer(0.3, os.kill, (first, signal.SIGKILL)).start()
        slow = partial(point, seconds=0.01)
        again = sweep(path, slow, chunk=5, executor=executor)
    assert again == unbroken[1]
    assert content(path) == content(unbroken[0])
    with pytest.raises(fs.ArgumentError, match="its Dask client is closed; expected one that is o"):
        sweep(path.with_name("closed.zarr"), slow, executor=executor)


def test_an_adaptive_map_resumes_inside_a_level(path):
    stop = Flag(path.with_name("stop"))

    def inside(x, y):
        if stop.is_set() and (abs(x - 0.7) < 0.05).any():
            raise KeyboardInterrupt
        if (y > 0.95).any():
            raise ValueError("too high")
        return np.where(x * x + y * y < 0.5, "in", "out")

    def refined(**given):
        return fs.refined_map(
            inside,
            {"x": (0, 1), "y": (0, 1)},
            refinement=fs.Refinement(cells=(4, 4), levels=3, resolution=0.01),
            execution=fs.Execution(**given),
        )

    unbroken = path.with_name("unbroken.zarr")
    found = refined(store=unbroken, chunk=24)
    assert found == refined()
    stop.set()
    with pytest.raises(KeyboardInterrupt):
        refined(store=path, chunk=24)
    stop.clear()
    (last,) = [batch for batch in path.glob("batch_*") if fs.load(batch).missing]
    assert 0 < len(fs.load(last).missing) < len(fs.load(last))
    with executor_of("threads") as pool:
        assert refined(store=path, executor=pool) == found
    assert content(path) == content(unbroken)
    with pytest.raises(fs.FileError, match="is the store of an adaptive map or of attractors: the"):
        fs.load(path)
    with pytest.raises(fs.FileError, match="is the store of a sweep; expected one with batches"):
        refined(store=path / "batch_1")
    with pytest.raises(fs.ArgumentError, match=r"is of another sweep .settings: "):
        fs.refined_map(inside, {"x": (0, 1), "y": (0, 2)}, execution=fs.Execution(store=path))
    counts = {"x": (0, 1), "y": (0, 1)}
    store = fs.Execution(store=path.with_name("counts.zarr"))
    once = fs.Refinement(cells=(2, 2), levels=1)
    numbers = fs.refined_map(lambda x, y: (3 * x).astype(int), counts, refinement=once)
    assert numbers == fs.refined_map(
        lambda x, y: (3 * x).astype(int), counts, refinement=once, execution=store
    )


def fragile(a):
    """End the process of a worker at one point, while the variable is set."""
    if a == 3 and "FRAGILE" in os.environ:
        os._exit(1)
    return a


def test_a_task_whose_worker_died_is_computed_when_the_sweep_is_resumed(path, monkeypatch):
    over = {"a": np.arange(6)}
    unbroken = path.with_name("unbroken.zarr")
    expected = sweep(unbroken, fragile, over)
    monkeypatch.setenv("FRAGILE", "1")
    with executor_of("processes") as pool:
        grid = sweep(path, fragile, over, executor=pool)
    assert [(dict(point), text[:12]) for point, text in grid.failures] == [
        ({"a": 3}, "the worker p")
    ]
    assert grid == fs.load(path)
    monkeypatch.delenv("FRAGILE")
    assert sweep(path, fragile, over) == expected
    assert content(path) == content(unbroken)
