"""Interrupts at random moments: SIGINT sent to a process that computes.

The process is sent one signal after the other, and each must come out of the call that was
under way as KeyboardInterrupt, within a second. After each the process computes something of
the same kind again, which must be what it was before the first.
"""

import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

#: Seconds from a signal to the exception, and how long an answer is waited for.
BOUND, PATIENCE = 1.0, 300.0

#: A second signal follows so often, and so many seconds later at most.
TWICE, APART = 0.25, 0.05

#: Seconds after which a signal is sent at the latest; longer for what takes its time.
LATEST = {"compilation": 8.0, "derive": 1.5}
USUAL = 0.6


def digest(*values):
    """Of arrays and texts, to the last bit."""
    found = hashlib.sha256()
    for value in values:
        found.update(value.tobytes() if isinstance(value, np.ndarray) else str(value).encode())
    return found.hexdigest()[:16]


class Calls:
    """What is interrupted, a method each: it returns a call, and one whose digest is compared."""

    def __init__(self, folder):
        import sympy as sp

        import fastslow as fs

        self.fs, self.sp, self.folder = fs, sp, Path(folder)
        self.gear = fs.systems.harmonic_gear()
        self.endless = fs.Integration(max_steps=10**9, max_crossings=10**9)

    def short_run(self):
        def run():
            found = self.fs.simulate(self.gear, [0, 0], periods=1)
            return digest(found.steps, found.crossing_table, found.series)

        return run, run

    def long_run(self):
        def run():
            self.fs.simulate(self.gear, [0, 0], t=(0, 1e9), dense=False, integration=self.endless)

        return run, self.short_run()[1]

    def long_run_with_series(self):
        def run():
            self.fs.simulate(self.gear, [0, 0], t=(0, 1e9), integration=self.endless)

        return run, self.short_run()[1]

    def _many(self, threads, until):
        starts = 0.01 * np.arange(32.0).reshape(16, 2)
        found = self.fs.simulate_many(
            self.gear,
            starts,
            t=(0, until),
            execution=self.fs.Execution(threads=threads),
            integration=self.endless,
        )
        return digest(found.final, found.minimum, found.hits)

    def ensemble_on_threads(self):
        return lambda: self._many(2, 1e9), lambda: self._many(2, 300)

    def ensemble(self):
        return lambda: self._many(1, 1e9), lambda: self._many(1, 300)

    def refined_map(self):
        def end(first, second):
            return [
                self.fs.simulate(self.gear, [a, b], t=(0, 150), dense=False).end[1] > 0
                for a, b in zip(first, second, strict=True)
            ]

        def run():
            over = {"x": (-0.5, 0.5), "v": (-0.5, 0.5)}
            found = self.fs.refined_map(
                end, over, refinement=self.fs.Refinement(cells=(3, 3), levels=2)
            )
            return digest(found.corners, found.codes)

        return run, run

    def bifurcation_sweep(self):
        def run(settle=20, count=5):
            found = self.fs.bifurcation_sweep(
                self.gear, "B", np.linspace(2, 2.4, count), [0, 0], settle=settle, keep=2
            )
            return digest(*(p.x for p in found.passes))

        return run, lambda: run(2, 2)

    def regime_map(self):
        def run(levels=1):
            over = {"B": (2.0, 2.6), "C": (3.0, 4.0)}
            found = self.fs.regime_map(
                self.gear, over, [0, 0], refinement=self.fs.Refinement(cells=(2, 2), levels=levels)
            )
            return digest(found.corners, found.codes, found.labels)

        return run, lambda: run(0)

    def lyapunov(self):
        gear = self.fs.systems.harmonic_gear(D=0.5, omega=1.3)

        def run(periods=120):
            found = self.fs.lyapunov(gear, [0, 0], periods=periods)
            return digest(found.values, found.blocks)

        return run, run

    def continuation(self):
        sp = self.sp
        B = sp.Symbol("B")
        cells = 5
        u = sp.symbols(f"u:{cells}")
        v = sp.symbols(f"v:{cells}")
        rates = {}
        for k in range(cells):
            left, right = max(k - 1, 0), min(k + 1, cells - 1)
            rates[u[k]] = 1 - (B + 1) * u[k] + u[k] ** 2 * v[k] + u[left] - 2 * u[k] + u[right]
            rates[v[k]] = B * u[k] - u[k] ** 2 * v[k] + 4 * (v[left] - 2 * v[k] + v[right])
        model = self.fs.Model(rates, parameters={B: 1})

        def run():
            settings = self.fs.Continuation(max_points=400)
            found = self.fs.continue_equilibria(model, "B", (1, 2.5), continuation=settings)
            return digest(*(branch.state for branch in found), repr(found))

        return run, run

    def _diagram(self):
        frozen = self.gear.frozen()
        return self.fs.continue_equilibria(frozen, frozen.free[0], over=(-2, 6))

    def equilibria(self):
        def run():
            frozen = self.gear.frozen().with_parameters({self.gear.frozen().free[0]: 2.0})
            return digest(*(e.state for e in self.fs.equilibria(frozen)))

        return run, run

    def derive(self):
        sp = self.sp
        x, v, w, k, D, t = sp.symbols("x v w k D t", real=True)

        def run():
            force = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
            model = self.fs.Model(
                {x: v, v: w - v - (x**2 + k) * force},
                forcing={w: sp.sin(t)},
                parameters={k: 40, D: 0.25},
            )
            return digest(self.fs.derive(model.frozen()).summary())

        return run, run

    def overlay(self):
        diagram = self._diagram()
        trajectory = self.fs.simulate(self.gear, [0, 0], periods=1)

        def run():
            return digest(self.fs.overlay(diagram, trajectory).summary())

        return run, run

    def file(self):
        trajectory = self.fs.simulate(self.gear, [0, 0], periods=1)
        folder = self.folder / "files"
        folder.mkdir()
        target = folder / "run.npz"
        trajectory.save(target)

        def check():
            # nothing beside it
            assert [path.name for path in folder.iterdir()] == [target.name]
            loaded = self.fs.load(target)
            return digest(loaded.steps, loaded.series)

        return lambda: trajectory.save(target), check

    def figure(self):
        import matplotlib

        matplotlib.use("agg")
        trajectory = self.fs.simulate(self.gear, [0, 0], periods=1)
        folder = self.folder / "figures"
        folder.mkdir()
        target = folder / "run.png"

        def run():
            from matplotlib import pyplot

            self.fs.plot.time_series(trajectory).save(target, dpi=60)
            pyplot.close("all")

        def check():
            run()
            assert [path.name for path in folder.iterdir()] == [target.name]
            return digest(target.read_bytes()[:8])

        return run, check

    def compilation(self):
        """A cache that is empty: to be given to a process of its own."""
        x, v = self.sp.symbols("x v")
        model = self.fs.Model({x: v, v: -x - v / 10})

        def run():
            found = self.fs.simulate(model, [1, 0], t=(0, 10))
            return digest(found.steps, found.series)

        return run, run


KINDS = [
    name for name, value in vars(Calls).items() if callable(value) and not name.startswith("_")
]


def child(folder):
    """Computes what it is told on standard input, and reports what comes out of each call."""
    # a shell starts what runs in the background with interrupts ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    calls = Calls(folder)
    known = {}

    def tell(**what):
        print(json.dumps(what), flush=True)

    tell(ready=os.getpid())
    for line in sys.stdin:
        kind, twice, comparing = json.loads(line)
        if kind not in known:
            run, check = getattr(calls, kind)()
            # an undisturbed process is what this one is before the first signal
            known[kind] = run, check, check() if kind != "compilation" else ""
        run, check, expected = known[kind]
        noted = []

        def note(error, noted=noted):
            noted.append((type(error).__name__, time.monotonic(), time.process_time()))

        try:
            try:
                tell(begun=kind)
                while True:
                    run()
            except BaseException as error:
                note(error)
                if twice:
                    time.sleep(2 * APART)
        except BaseException as error:
            note(error)
        found = check() if comparing else expected
        tell(caught=noted[0], others=noted[1:], same=found == expected, digest=found)


@dataclass
class Report:
    """What came of all signals."""

    rows: list = field(default_factory=list)
    failures: list = field(default_factory=list)

    def __str__(self):
        lines = [f"{len(self.rows)} interrupts, {len(self.failures)} failures"]
        for kind in dict.fromkeys(row[0] for row in self.rows):
            own = [row for row in self.rows if row[0] == kind]
            wall, busy = (max(row[k] for row in own) for k in (1, 2))
            lines.append(
                f"{kind}: {len(own)}, at most {wall:.3f} s and {busy:.3f} s of the processor"
            )
        return "\n".join([*lines, *map(str, self.failures)])


class _Process:
    """A process that computes."""

    def __init__(self, folder, cache=None):
        environment = dict(os.environ)
        if cache is not None:
            environment["FASTSLOW_CACHE"] = str(cache)
        self.errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  read when the process ends
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.campaigns.interrupts", str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.errors, text=True,
            env=environment,
        )  # fmt: skip
        # the clock of another process, see clock_getcpuclockid(3)
        self.clock = (~self.process.pid << 3) | 2
        self.answer()

    def answer(self):
        # what computes on in spite of a signal would never answer
        watch = threading.Timer(PATIENCE, self.process.kill)
        watch.start()
        line = self.process.stdout.readline()
        watch.cancel()
        if not line:
            self.errors.seek(0)
            raise RuntimeError(
                f"the process ended, at the latest after {PATIENCE:g} s:\n"
                f"{self.errors.read()[-3000:]}"
            )
        return json.loads(line)

    def interrupt(self, kind, generator, comparing=True):
        """Interrupt one call; returns seconds, processor seconds, and what was reported."""
        twice = generator.random() < TWICE
        self.process.stdin.write(json.dumps([kind, twice, comparing]) + "\n")
        self.process.stdin.flush()
        self.answer()
        time.sleep(generator.uniform(0.002, LATEST.get(kind, USUAL)))
        busy, sent = time.clock_gettime(self.clock), time.monotonic()
        os.kill(self.process.pid, signal.SIGINT)
        if twice:
            time.sleep(generator.uniform(0.0, APART))
            os.kill(self.process.pid, signal.SIGINT)
        found = self.answer()
        _, when, used = found["caught"]
        return when - sent, used - busy, found

    def end(self):
        self.process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(PATIENCE)
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        with self.errors as file:
            file.seek(0)
            return file.read()


def campaign(count=105, seed=0, kinds=None):
    """Send so many signals, to calls of all kinds in turn."""
    generator = random.Random(seed)
    report = Report()
    chosen = [k for k in KINDS if k != "compilation"] if kinds is None else kinds
    with tempfile.TemporaryDirectory() as folder:
        computing = _Process(folder)
        compiling = _Process(folder, Path(folder) / "cache") if kinds is None else None
        for number in range(count):
            kind = chosen[number % len(chosen)]
            process, comparing = computing, True
            if compiling is not None and number % 15 == 14:
                kind, process, comparing = "compilation", compiling, False
            _note(report, kind, *process.interrupt(kind, generator, comparing))
        if compiling is not None:
            # compiled at last, and the same as where the cache was not empty
            ended = compiling.interrupt("compilation", generator)[2]["digest"]
            expected = computing.interrupt("compilation", generator)[2]["digest"]
            if ended != expected:
                report.failures.append(("compilation", "another result"))
        for process in filter(None, (computing, compiling)):
            ignored = process.end()
            if "Exception ignored" in ignored:
                report.failures.append(ignored)
    return report


def _note(report, kind, seconds, busy, found):
    report.rows.append((kind, seconds, busy))
    name = found["caught"][0]
    # on a machine that others use it is the time of its own that counts
    late = min(seconds, busy) > BOUND and kind != "compilation"
    others = {other[0] for other in found["others"]} - {"KeyboardInterrupt"}
    if name != "KeyboardInterrupt" or others or late or not found["same"]:
        report.failures.append((kind, round(seconds, 3), round(busy, 3), found))


if __name__ == "__main__":
    child(sys.argv[1])
