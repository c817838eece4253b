"""Crossings of random piecewise-linear systems against matrix exponentials.

Two states, two interfaces across which the rates jump, and a forcing. Between two
crossings the motion is linear with constant coefficients, so that the state at the
second one follows from that at the first by an exponential.
"""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from scipy.linalg import expm

import fastslow as fs

TOLERANCES = (1e-9, 1e-10, 1e-11, 5e-12, 1e-12)

#: Largest h at the end of a step along its own series, in units of the terms of h.
ROUNDING = 1e-12

#: Largest error of a state in units of what the tolerance allows, per step of the series.
PER_STEP = 10.0

#: States at which a motion is looked at between two crossings.
BETWEEN = 16


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    runs: int = 0
    crossings: int = 0
    segments: int = 0
    worst_h: float = 0.0
    worst_error: float = 0.0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.crossings} crossings of {self.runs} runs, {self.segments} "
            f"motions between them checked\n  largest h at a crossing, in units of its terms: "
            f"{self.worst_h:.1e}\n  largest error of a state, in units of the tolerance and per "
            f"step: {self.worst_error:.2f}\n  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


def piecewise_linear():
    """The model, and the names of its parameters in order."""
    x1, x2, t, w = sp.symbols("x1 x2 t w")
    names = [f"{a}{i}{j}" for a in "acg" for i in (1, 2) for j in (1, 2)]
    names += [f"{a}{i}" for a in "bdf" for i in (1, 2)] + ["omega"]
    p = {name: sp.Symbol(name) for name in names}
    h = [p[f"c{k}1"] * x1 + p[f"c{k}2"] * x2 - p[f"d{k}"] for k in (1, 2)]
    rates = {
        x: p[f"a{i}1"] * x1
        + p[f"a{i}2"] * x2
        + p[f"b{i}"]
        + p[f"g{i}1"] * sp.sign(h[0])
        + p[f"g{i}2"] * sp.sign(h[1])
        + p[f"f{i}"] * w
        for i, x in ((1, x1), (2, x2))
    }
    forcing = {w: sp.sin(p["omega"] * t)}
    return fs.Model(rates, forcing=forcing, parameters=dict.fromkeys(names, 1.0)), names


def values_of(rng, names):
    """Parameters of a system that turns, so that it crosses often."""
    values = dict(zip(names, rng.normal(size=len(names)), strict=True))
    values |= {"a11": 0.1 * rng.normal(), "a22": 0.1 * rng.normal() - 0.1}
    values |= {"a12": -rng.uniform(2, 6), "a21": rng.uniform(2, 6), "omega": rng.uniform(0.5, 3)}
    return values


class Linear:
    """One system, exactly: its matrix in a region, for the states (x, sin, cos, 1)."""

    def __init__(self, values):
        self.v = values

    def h(self, x, k):
        """An interface function, and the sum of the moduli of its terms."""
        terms = [self.v[f"c{k}1"] * x[0], self.v[f"c{k}2"] * x[1], -self.v[f"d{k}"]]
        return sum(terms), sum(map(abs, terms))

    def motion(self, signs):
        v, matrix = self.v, np.zeros((5, 5))
        for i in (1, 2):
            jumps = sum(v[f"g{i}{k}"] * signs[k - 1] for k in (1, 2))
            matrix[i - 1] = [v[f"a{i}1"], v[f"a{i}2"], v[f"f{i}"], 0.0, v[f"b{i}"] + jumps]
        matrix[2, 3], matrix[3, 2] = v["omega"], -v["omega"]
        return matrix

    def follow(self, signs, start, time, length):
        """States at even times between, the last at the end; and how much errors may grow."""
        z = np.array([*start, np.sin(self.v["omega"] * time), np.cos(self.v["omega"] * time), 1.0])
        matrix = self.motion(signs)
        little = expm(matrix * (length / BETWEEN))
        states = []
        for _ in range(BETWEEN):
            z = little @ z
            states.append(z[:2])
        growth = np.linalg.norm(expm(matrix[:2, :2] * length), 2)
        return np.array(states), max(1.0, growth)


def campaign(count=100_000, seed=0):
    """Check at least so many crossings."""
    rng = np.random.default_rng(seed)
    model, names = piecewise_linear()
    report = Report(seed)
    while report.crossings < count:
        values = values_of(rng, names)
        rtol = float(rng.choice(TOLERANCES))
        start = rng.normal(size=2) * 2
        one = model.with_parameters(values)
        run = fs.simulate(one, start, t=(0, 25), integration=fs.Integration(rtol=rtol))
        report.runs += 1
        sides = {name: tuple(region.signs.values()) for name, region in one.regions.items()}
        check(report, run, sides, Linear(values), start, rtol)
    return report


def check(report, run, sides, linear, start, rtol):
    """Every crossing of a run, and every motion in a region between two of them."""
    ends = run.steps[:, 0] + run.steps[:, 1]
    here, now, size = np.asarray(start), 0.0, np.abs(run.series[:, :2, 0]).max()
    where = f"seed {report.seed}, run {report.runs}, rtol {rtol:g}"
    names = list(run.interfaces)
    for crossing in run.crossings:
        report.crossings += 1
        time, side = crossing.time, crossing.from_region
        if "|" not in side and time > now:
            step = int(np.argmin(np.abs(ends - time)))
            k = 1 + names.index(crossing.interface)
            at_end = [np.polyval(row[::-1], run.steps[step, 1]) for row in run.series[step, :2]]
            value, terms = linear.h(at_end, k)
            report.worst_h = max(report.worst_h, abs(value) / terms)
            if abs(value) > ROUNDING * terms:
                report.failures.append(f"{where}: h = {value:.1e} at t = {time:.9g}")
            signs = sides[side]
            states, growth = linear.follow(signs, here, now, time - now)
            report.segments += 1
            steps = 1 + np.count_nonzero((ends > now) & (ends < time))
            error = np.abs(states[-1] - crossing.state[:2]).max()
            error /= max(rtol, 1e-15) * size * growth * steps
            report.worst_error = max(report.worst_error, error)
            if error > PER_STEP:
                report.failures.append(f"{where}: error {error:.1f} at t = {time:.9g}")
            for j, sign in enumerate(signs, start=1):
                value, terms = linear.h(states[:-1].T, j)
                if np.any(value * sign < -100 * rtol * size * np.max(terms)):
                    report.failures.append(f"{where}: a crossing was missed before {time:.9g}")
        here, now = np.array(crossing.state[:2]), time
