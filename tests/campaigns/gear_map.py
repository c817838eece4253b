"""The map of the gear over D × C/B, killed twice by SIGKILL and resumed with other executors.

Each gear runs over two slow periods, of which the first is dropped. The map is computed once
without interruption in a process of its own, on all of its cores. Then it begins on two worker
processes, is killed, is resumed on the threads of one process, is killed again, and ends on two
workers of Dask, or on two worker processes where Dask is not installed. The bytes of both stores
are compared. The count is that of gears, ``python -m tests.campaigns gear_map 1000000``.
"""

import json
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import fastslow as fs
from tests.benchmarks.bench_sweeps import large, motions, over
from tests.sweeps.interrupted import ROOT, content, executor_of, killed

#: Number of gears whose rate by `simulate_many` alone is compared.
ALONE = 10_000

#: Largest memory of the process above that of imports, in MB, and least part of that rate, which is
#: required from a number of gears on.
MEMORY, RATE, LARGE = 300, 0.9, 90_000

LAST = "dask" if find_spec("distributed") else "processes"


@dataclass
class Report:
    """Numbers of the unbroken run and of the resumed one, and what went wrong."""

    count: int
    lines: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def add(self, name, numbers):
        """Add the numbers of a run, and require bounded memory."""
        parts = (f"{value:.4g} {unit}" for unit, value in numbers.items())
        self.lines.append(f"{name}: {', '.join(parts)}")
        if numbers["MB above imports"] > MEMORY:
            self.failures.append(f"{name} took more than {MEMORY} MB")

    def __str__(self):
        lines = [f"{self.count:,} gears", *self.lines, *self.failures]
        return "\n".join([*lines, f"{len(self.failures)} failures"])


def memory(name):
    """Memory of this process, in MB: that of now, VmRSS, or its maximum, VmHWM."""
    return int(Path("/proc/self/status").read_text().split(f"{name}:")[1].split()[0]) / 1024


def run(path, kind, count):
    """Compute the map, or what is missing of it, and print what it took."""
    rows = round(count**0.5)
    # at least twenty tasks, of about 8000 points where there are many
    chunk = rows * max(1, min(rows // 20, 8192 // rows))
    with executor_of(kind) as executor:
        large(100, executor=executor, store=f"{path}.warm")  # compiled code
        before = memory("VmRSS")
        clock, begun = time.perf_counter(), time.process_time()
        grid = large(count, store=path, executor=executor, chunk=chunk)
        used, taken = time.process_time() - begun, time.perf_counter() - clock
    after = memory("VmHWM")
    assert grid.outcome, grid.outcome
    numbers = {"MB above imports": after - before, "s": taken}
    if kind == "none":
        D, ratio = (part.ravel() for part in np.meshgrid(*over(ALONE).values(), indexing="ij"))
        begun = time.process_time()
        motions(D, ratio)
        share = len(grid) / used * (time.process_time() - begun) / ALONE
        numbers |= {"s of processor time": used, "of the rate of simulate_many": share}
    print(json.dumps(numbers))


def process(path, kind, count):
    """The same in a process of its own."""
    code = f"from tests.campaigns.gear_map import run; run({str(path)!r}, {kind!r}, {count})"
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finished(path, kind, count):
    """The numbers of a run that is not interrupted."""
    text, _ = (one := process(path, kind, count)).communicate()
    if one.returncode:
        raise RuntimeError(f"the run on {kind} ended with code {one.returncode}")
    return json.loads(text.splitlines()[-1])


def killed_at(path, kind, count, share):
    """Kill the run once this share of what was missing is stored; return what is missing then."""
    begun = done(path)
    one = process(path, kind, count)
    while one.poll() is None and done(path) < begun + share * (count - begun):
        time.sleep(count / 1e6)
    killed(one)
    return count - done(path)


def done(path):
    """The number of points that are stored."""
    if not (path / "done" / "zarr.json").exists():
        return 0
    return int(fs.load(path).done.sum())


def campaign(count=100_000, seed=0):
    """Compute the map of so many gears without interruption, and with two kills."""
    report, chance = Report(len(over(count)["D"]) ** 2), random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        unbroken, path = Path(folder) / "unbroken.zarr", Path(folder) / "killed.zarr"
        numbers = finished(unbroken, "none", count)
        report.add("without interruption", numbers)
        if report.count >= LARGE and numbers["of the rate of simulate_many"] < RATE:
            report.failures.append(f"the rate is below {RATE:.0%} of that of simulate_many")
        for kind in ("processes", "none"):
            missing = killed_at(path, kind, report.count, chance.uniform(0.1, 0.6))
            report.lines.append(f"killed on {kind} with {missing:,} points missing")
            if not 0 < missing < report.count:
                report.failures.append("the kill came too early or too late")
        report.add(f"resumed on {LAST}", finished(path, LAST, count))
        if fs.load(path) != fs.load(unbroken) or content(path) != content(unbroken):
            report.failures.append("the bytes of the two stores differ")
    return report
