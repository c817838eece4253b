"""Impacts of random linear oscillators against matrix exponentials.

One mass with a stop, and two masses between three walls, one of which moves and one is the
other mass. Between two impacts the motion is linear, so that the state before the second one
follows from that after the first. Each flight is compared from the library's own state,
because impacts with a small speed v amplify earlier errors like 1/v.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import sympy as sp
from scipy.linalg import expm

import fastslow as fs

#: Largest error of a flight in units of the states.
ALLOWED = 1e-11

#: Time span of a run, and states at which a flight is compared with the walls.
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


@dataclass
class Case:
    """A model at random values, its matrix of (states, cos w t, sin w t), and its walls.

    ``overlap`` gives h of every wall from these numbers.
    """

    model: fs.Model
    values: dict[str, float]
    state: list[float]
    matrix: np.ndarray
    overlap: Callable


@cache
def impacting():
    """x'' + c x' + k x = f cos w t with a stop at x = s."""
    x, v, t, c, k, f, w, s, r = sp.symbols("x v t c k f w s r")
    values = dict.fromkeys((c, k, f, w, s, r), 1)
    rates = {x: v, v: f * sp.cos(w * t) - c * v - k * x}
    return fs.Model(rates, parameters=values, resets={x >= s: {v: -r * v}})


@cache
def chain():
    """Masses 1 and 2 between a fixed and a moving wall, which also hit each other."""
    x, u, y, v, t = sp.symbols("x u y v t")
    names = sp.symbols("k1 k2 k3 c f w L A r")
    k1, k2, k3, c, f, w, L, A, r = names
    edge = L + A * sp.sin(w * t)
    speed = edge.diff(t)
    rates = {
        x: u,
        u: f * sp.cos(w * t) - k1 * x - c * u - k3 * (x - y),
        y: v,
        v: (-k2 * y - c * v - k3 * (y - x)) / 2,
    }
    mean = (u + 2 * v) / 3
    resets = {
        x <= -1: {u: -r * u},
        x >= y: {u: mean - 2 * r * (u - v) / 3, v: mean + r * (u - v) / 3},
        y >= edge: {v: speed - r * (v - speed)},
    }
    values = {**dict.fromkeys(names, 1), r: 0.5}
    return fs.Model(rates, parameters=values, resets=resets)


def random_cases(count, seed):
    """Cases of the oscillator."""
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
        c, k, f, w, s, _ = values.values()
        matrix = np.array([[0, 1, 0, 0], [-k, -c, f, 0], [0, 0, 0, -w], [0, 0, w, 0]])
        state = [s - rng.uniform(0.1, 1), rng.uniform(-1, 1)]
        cases.append(Case(impacting(), values, state, matrix, lambda z, s=s: [z[0] - s]))
    return cases


def random_chains(count, seed):
    """Cases of the two masses."""
    rng = np.random.default_rng(seed)
    cases = []
    for _ in range(count):
        values = {
            "k1": 10 ** rng.uniform(-1, 1),
            "k2": 10 ** rng.uniform(-1, 1),
            "k3": rng.uniform(0, 1),
            "c": rng.uniform(0, 0.3),
            "f": rng.uniform(0, 5),
            "w": 10 ** rng.uniform(-0.3, 0.5),
            "L": rng.uniform(0.5, 1),
            "A": rng.uniform(0, 0.4),
            "r": rng.uniform(0.3, 1),
        }
        k1, k2, k3, c, f, w, L, A, _ = values.values()
        matrix = np.zeros((6, 6))
        matrix[0, 1] = matrix[2, 3] = 1
        matrix[1] = [-k1 - k3, -c, k3, 0, f, 0]
        matrix[3] = [k3 / 2, 0, -(k2 + k3) / 2, -c / 2, 0, 0]
        matrix[4, 5], matrix[5, 4] = -w, w
        state = [-0.5, rng.normal(), 0.2, rng.normal()]

        def overlap(z, L=L, A=A):
            return [-1 - z[0], z[0] - z[2], z[2] - L - A * z[5]]

        cases.append(Case(chain(), values, state, matrix, overlap))
    return cases


def campaign(count=10_000, seed=1):
    """Check runs with at least so many flights."""
    report, batch = Report(seed), 0
    while report.flights < count and len(report.failures) < 20:
        number = seed * 1000 + batch
        for case in (*random_cases(5, number), *random_chains(2, number)):
            check(report, case)
        batch += 1
    return report


def check(report, case):
    """Check every flight of a run: it ends on a wall, at the right state, and not earlier."""
    run = fs.simulate(
        case.model.with_parameters(case.values),
        case.state,
        t=SPAN,
        integration=fs.Integration(rtol=1e-13),
    )
    report.runs += 1
    w, names = case.values["w"], list(case.model.resets)
    where = f"seed {report.seed}, run {report.runs}"
    if not run.outcome.success:
        report.failures.append(f"{where}: {run.outcome}")
    size = 1 + np.abs(run.series[:, :, 0]).max()
    rests = [one for one in run.segments if "at rest" in one.region]
    report.rests += len(rests)
    begins = [(SPAN[0], np.array(case.state)), *((e.time, e.after) for e in run.resets)]
    for (begin, here), event in zip(begins, run.resets, strict=False):
        if any(rest.start < event.time and begin < rest.end for rest in rests):
            continue
        whole = np.array([*here, np.cos(w * begin), np.sin(w * begin)])
        exact = expm(case.matrix * (event.time - begin)) @ whole
        error = np.abs(exact[:-2] - event.before).max() / size
        report.worst, report.flights = max(report.worst, error), report.flights + 1
        before = np.array([*event.before, *exact[-2:]])
        gap = case.overlap(before)[names.index(event.reset)]
        if error > ALLOWED or abs(gap) > 1e-14 * size:
            report.failures.append(f"{where}: error {error:.1e} at t = {event.time:.9g}")
        part = expm(case.matrix * ((event.time - begin) / BETWEEN))
        for _ in range(BETWEEN - 1):
            whole = part @ whole
            if max(case.overlap(whole)) > ALLOWED * size:
                report.failures.append(f"{where}: an impact missed before {event.time:.9g}")
                break
