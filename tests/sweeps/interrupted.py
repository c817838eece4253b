"""A sweep in a process of its own, which is killed and resumed with another executor."""

import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

import fastslow as fs

ROOT = Path(__file__).parents[2]

#: Seconds of a point, and by how much longer it takes where it is to be killed.
SECONDS, SLOWER = 0.01, "6"

OVER = {"a": np.arange(12), "b": np.linspace(0.0, 1.0, 10)}


def point(a, b, seconds=SECONDS):
    """Wait, and return one output of each kind; some points have none."""
    time.sleep(seconds * int(os.environ.get("SLOWER", "1")))
    if (a, b) == (7, 0.0):
        raise ValueError("no value")
    return {"sum": a + b, "word": f"{a:g}" * int(1 + 9 * b), "both": [a, b], "less": a < 5 * b}


@contextmanager
def executor_of(kind):
    """A pool of two threads or processes, two workers of Dask, or this process."""
    if kind == "dask":
        from distributed import Client, LocalCluster

        with (
            LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client.get_executor()
    elif kind == "none":
        yield None
    else:
        with {"threads": ThreadPoolExecutor, "processes": ProcessPoolExecutor}[kind](2) as pool:
            yield pool


def run(path, kind="none", chunk=5):
    """The sweep with a store, from its beginning or resumed."""
    with executor_of(kind) as executor:
        execution = fs.Execution(executor=executor, store=path, chunk=chunk)
        return fs.sweep(point, OVER, execution=execution)


def started(path, kind):
    """The sweep in a process of its own, once it has stored a task."""
    code = f"from tests.sweeps.interrupted import run; run({str(path)!r}, {kind!r})"
    nowhere = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    command, marks = [sys.executable, "-c", code], path / "done" / "c"
    before = written(marks)
    slowly = os.environ | {"SLOWER": SLOWER}
    process = subprocess.Popen(command, cwd=ROOT, env=slowly, start_new_session=True, **nowhere)
    while process.poll() is None and written(marks) == before:
        time.sleep(0.005)
    return process


def written(folder):
    """When the chunks of an array were written."""
    return {file: file.stat().st_mtime_ns for file in folder.rglob("0") if file.is_file()}


def killed_and_resumed(
    path, seed, kinds=("threads", "none", "processes"), signals=(signal.SIGKILL,)
):
    """Kill the sweep at random moments, resume with another executor each time, and end it."""
    chance, missing = random.Random(seed), []
    for kind in kinds:
        process = started(path, kind)
        time.sleep(chance.uniform(0.0, 0.8))
        killed(process, chance.choice(signals))
        missing.append(len(fs.load(path).missing))
    return missing, run(path, chance.choice(kinds))


def killed(process, number=signal.SIGKILL):
    """Kill a process that has a session of its own, or interrupt it, then kill its workers."""
    process.send_signal(number)
    process.wait()
    with suppress(ProcessLookupError):  # workers that wait for their parent
        os.killpg(process.pid, signal.SIGKILL)


def content(path):
    """The bytes of every file of a store, but of the attributes of its group."""
    files = (file for file in Path(path).rglob("*") if file.is_file())
    return {
        str(file.relative_to(path)): file.read_bytes()
        for file in files
        if file != Path(path) / "zarr.json"
    }
