"""Published models of a folder, read, simulated and compared with SciPy.

``python -m tests.campaigns suites FOLDER [OUTPUT]`` reads every .ode file below a folder.
Each is read in a process of its own; its right-hand side is evaluated by
`tests.readers.xpp_reference`, and integrated by LSODA twice, with different tolerances: both
solutions are compared up to the time to which LSODA agrees with itself, which for a chaotic model
is short. OUTPUT is a table in Markdown, by file.
"""

import multiprocessing
import resource
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fastslow.errors import FastSlowError
from tests.readers.xpp_reference import Reference

#: Processor seconds of a file, longest time of a run, samples, and agreement asked for.
SECONDS, LONGEST, SAMPLES, TOLERANCE = 120, 200.0, 101, 1e-6


@dataclass
class Report:
    """Rows (file, states, verdict, remark)."""

    rows: list

    @property
    def failures(self):
        return [row for row in self.rows if row[2] in ("differs", "error")]

    def __str__(self):
        counts = Counter(row[2] for row in self.rows)
        lines = [f"{len(self.rows)} files: " + ", ".join(f"{v} {k}" for k, v in counts.items())]
        return "\n".join([*lines, *(f"{row[0]}: {row[2]}, {row[3]}" for row in self.failures)])

    def table(self):
        """The rows as a table in Markdown."""
        rows = [f"| {n} | {s or ''} | {v} | {r} |" for n, s, v, r in self.rows]
        return "\n".join(["| file | states | result | remark |", "|---|---|---|---|", *rows, ""])


def campaign(folder, output=None):
    """Return the report of a folder."""
    report = Report([])
    for path in sorted(Path(str(folder)).rglob("*.ode"), key=lambda p: (p.stat().st_size, p)):
        report.rows.append((path.relative_to(folder).as_posix(), *verdict_of(path)))
        if output:
            Path(output).write_text(report.table())
    return report


def verdict_of(path):
    """States, verdict and remark, from a process with a limit of processor time."""
    ours, theirs = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(target=answer, args=(path, theirs))
    process.start()
    theirs.close()
    found = [None, "unfinished", f"no answer in {SECONDS} s of processor time"]
    try:
        while True:
            found = ours.recv()
    except EOFError:
        process.join()
    return found


def answer(path, pipe):
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    try:
        states, verdict, remark = compared(path, pipe)
        if states:
            used = resource.getrusage(resource.RUSAGE_SELF)
            remark = f"{remark}; peak {used.ru_maxrss / 1024:.0f} MB"
        pipe.send([states, verdict, remark])
    except Exception as error:
        pipe.send([None, "error", f"{type(error).__name__}: {str(error)[:120]}"])


def compared(path, pipe):
    """States, verdict and remark of a file."""
    import fastslow as fs

    started = time.process_time()
    try:
        file = fs.read(path)
    except FastSlowError as error:
        reason = " ".join(str(error).split()).partition("; read the file")[0]
        return [None, "refused", reason.replace("|", "\\|")[:150]]
    states, reading = len(file.model.states), time.process_time() - started
    pipe.send([states, "unfinished", f"read; no run in {SECONDS} s of processor time"])
    start, end = file.t[0], min(file.t[1], file.t[0] + LONGEST)
    if file.model.resets or file.model.events or file.stops:
        run = fs.simulate(file.model, file.initial, t=(start, end), stop=file.stops)
        count = len(run.resets) + len(run.events)
        reached = f"{count} events to t = {run.span[1]:g}, which the reference does not know"
        verdict = "runs" if run.outcome.success else "cut short"
        return [states, verdict, reached if run.outcome.success else str(run.outcome)[:150]]
    reference = Reference(path.read_text("utf-8", "replace"), path.parent)
    assert len(reference.names) == states
    times = np.linspace(start, end, SAMPLES)
    one, other = (solution(reference, times, rtol) for rtol in (1e-11, 1e-10))
    scale = np.maximum(np.abs(one).max(axis=1), 1e-3)[:, None]
    rows = min(one.shape[1], other.shape[1])
    own = (np.abs(one[:, :rows] - other[:, :rows]) / scale).max(axis=0)
    bad = np.flatnonzero(~(own < TOLERANCE / 10))
    until = bad[0] if len(bad) else rows
    if until < 2:
        return [states, "read", "LSODA does not agree with itself"]
    started = time.process_time()
    span = (start, times[until - 1])
    run = fs.simulate(file.model, file.initial, t=span, samples=times[:until])
    spent = time.process_time() - started
    if not run.outcome.success:
        return [states, "cut short", str(run.outcome).replace("|", "\\|")[:150]]
    ours = np.array([run[n] for n in file.model.states])
    error = (np.abs(ours - one[:, :until]) / scale).max()
    verdict = "agrees" if error < TOLERANCE else "differs"
    took = f"read in {reading:.1f} s, run in {spent:.1f} s"
    return [states, verdict, f"{error:.1e} to t = {times[until - 1]:g}; {took}"]


def solution(reference, times, rtol):
    found = solve_ivp(
        reference.rates,
        (times[0], times[-1]),
        reference.start,
        "LSODA",
        times,
        rtol=rtol,
        atol=1e-12,
        max_step=(times[-1] - times[0]) / 500,
    )
    return found.y
