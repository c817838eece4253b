"""Impacts of random oscillators x'' + c x' + k x = f cos(w t) against matrix exponentials.

Between two impacts the motion is linear, so that the state before the second one follows from
that after the first. Each flight is compared from the library's own state, because impacts with
a small speed v amplify earlier errors like 1/v.
"""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
import sympy as sp
from scipy.linalg import expm

import fastslow as fs

#: Largest error of a flight in units of the states.
ALLOWED = 1e-11

#: Time span of a run, and states at which a flight is compared with the wall.
SPAN, BETWEEN = (0.0, 40.0), 64


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    runs: int = 0
    flights: int = 0
    rests: int = 0
    worst: float = 0.0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.flights} flights between impacts of {self.runs} runs, "
            f"{self.rests} rests\n  largest error of a flight, in units of the states: "
            f"{self.worst:.1e}\n  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


@cache
def impacting():
    """An oscillator with a stop at x = s."""
    x, v, t, c, k, f, w, s, r = sp.symbols("x v t c k f w s r")
    values = dict.fromkeys((c, k, f, w, s, r), 1)
    rates = {x: v, v: f * sp.cos(w * t) - c * v - k * x}
    return fs.Model(rates, parameters=values, resets={x >= s: {v: -r * v}})


def random_cases(count, seed):
    """Parameter values and initial states that meet the stop."""
    rng = np.random.default_rng(seed)
    cases = []
    for _ in range(count):
        values = {
            "c": rng.uniform(0, 0.3),
            "k": 10 ** rng.uniform(-1, 1),
            "f": rng.uniform(0.2, 2),
            "w": 10 ** rng.uniform(-0.3, 0.5),
            "s": rng.uniform(-0.3, 0.3),
            "r": rng.uniform(0.3, 1),
        }
        cases.append((values, [values["s"] - rng.uniform(0.1, 1), rng.uniform(-1, 1)]))
    return cases


def campaign(count=10_000, seed=1):
    """Check runs with at least so many flights."""
    report, batch = Report(seed), 0
    while report.flights < count and len(report.failures) < 20:
        for values, state in random_cases(10, seed * 1000 + batch):
            check(report, values, state)
        batch += 1
    return report


def check(report, values, state):
    """Check every flight of a run: it ends on the wall, at the right state, and not earlier."""
    run = fs.simulate(
        impacting().with_parameters(values),
        state,
        t=SPAN,
        integration=fs.Integration(rtol=1e-13),
    )
    report.runs += 1
    c, k, f, w, s, r = (values[n] for n in "ckfwsr")
    # of (x, v, cos w t, sin w t)
    matrix = np.array([[0, 1, 0, 0], [-k, -c, f, 0], [0, 0, 0, -w], [0, 0, w, 0]])
    size = 1 + np.abs(run.series[:, :2, 0]).max()
    rests = [one.start for one in run.segments if "at rest" in one.region]
    report.rests += len(rests)
    begins = [(SPAN[0], np.array(state)), *((e.time, e.after) for e in run.resets)]
    where = f"seed {report.seed}, run {report.runs}"
    for (begin, here), event in zip(begins, run.resets, strict=False):
        if begin in rests:
            continue
        whole = np.array([*here, np.cos(w * begin), np.sin(w * begin)])
        exact = expm(matrix * (event.time - begin)) @ whole
        error = np.abs(exact[:2] - event.before).max() / size
        report.worst, report.flights = max(report.worst, error), report.flights + 1
        if error > ALLOWED or abs(event.before[0] - s) > 1e-14 * size:
            report.failures.append(f"{where}: error {error:.1e} at t = {event.time:.9g}")
        if event.after[0] != s or event.after[1] not in (-r * event.before[1], 0.0):
            report.failures.append(f"{where}: reset to {event.after} at t = {event.time:.9g}")
        part = expm(matrix * ((event.time - begin) / BETWEEN))
        for _ in range(BETWEEN - 1):
            whole = part @ whole
            if whole[0] > s + ALLOWED * size:
                report.failures.append(f"{where}: an impact missed before {event.time:.9g}")
                break
