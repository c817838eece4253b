"""Relays with hysteresis in random linear systems against matrix exponentials.

One relay, or two that are coupled: the upper threshold of the first one depends on the second.
Between two changes the motion is linear, so that the state at the second one follows from that at
the first. Every run is repeated in an ensemble, and with the switches in reverse order.
"""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
import sympy as sp
from scipy.linalg import expm

import fastslow as fs

#: Largest error between two changes in units of the states.
ALLOWED = 1e-11

#: Time span of a run, and states at which the relations are checked between two changes.
SPAN, BETWEEN = (0.0, 20.0), 32

#: Names of the switches.
NAMES = ("q", "p")


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    runs: int = 0
    changes: int = 0
    together: int = 0
    worst: float = 0.0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.changes} changes of relays in {self.runs} runs, "
            f"{self.together} at the time of another one\n  largest error between two, in units "
            f"of the states: {self.worst:.1e}\n  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


@dataclass
class Case:
    """A system z' = A z + B s with s = ±1 and the output y = C z of every relay.

    Relay k changes to −1 above ``widths[k]`` and to 1 below its negative; the upper threshold of
    the first one is higher by ``shift`` while the second is 1.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    widths: np.ndarray
    shift: float

    def heights(self, state, values):
        """The watched functions."""
        found = []
        for k, (value, y) in enumerate(zip(values, self.C @ state, strict=True)):
            more = self.shift * values[1] if k == 0 and len(values) > 1 else 0.0
            found.append(y - self.widths[k] - more if value else -self.widths[k] - y)
        return np.array(found)

    def parameters(self):
        """Values of the parameters of `relays`."""
        blocks = {"A": self.A, "B": self.B, "C": self.C, "d": self.widths}
        values = {
            f"{name}{'_'.join(map(str, place))}": float(number)
            for name, block in blocks.items()
            for place, number in np.ndenumerate(block)
        }
        return {**values, "shift": self.shift}


@cache
def relays(n, m, reverse=False):
    """The model of n states with m relays."""
    z, s = sp.symbols(f"z:{n}"), sp.symbols(NAMES[:m])
    a, b, c = (
        [[sp.Symbol(f"{name}{i}_{j}") for j in range(count)] for i in range(rows)]
        for name, rows, count in (("A", n, n), ("B", n, m), ("C", m, n))
    )
    rates = {
        z[i]: sum(a[i][j] * z[j] for j in range(n))
        + sum(b[i][k] * (2 * s[k] - 1) for k in range(m))
        for i in range(n)
    }
    switches = {}
    for k in range(m):
        y, width = sum(c[k][j] * z[j] for j in range(n)), sp.Symbol(f"d{k}")
        more = sp.Symbol("shift") * s[1] if k == 0 and m > 1 else 0
        switches[s[k]] = (y < -width, y > width + more)
    used = set().union(*(rate.free_symbols for rate in rates.values()), {sp.Symbol("shift")})
    used |= {sp.Symbol(f"d{k}") for k in range(m)}.union(*(set(row) for row in c))
    values = dict.fromkeys(used - {*z, *s}, 1)
    order = reversed(switches) if reverse else switches
    return fs.Model(rates, parameters=values, switches={name: switches[name] for name in order})


def random_case(rng):
    """Return a stable system with negative feedback by all relays."""
    n, m = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    A = rng.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 10 ** rng.uniform(-2, 0)) * np.eye(n)
    B, C = rng.normal(size=(n, m)), rng.normal(size=(m, n))
    # the output follows the relay in the long run
    C *= np.sign(np.diag(C @ np.linalg.solve(-A, B)))[:, None]
    widths = np.abs(np.diag(C @ np.linalg.solve(A, B))) * 10 ** rng.uniform(-3, -0.5, m)
    return Case(A, B, C, widths, float(widths[0] * rng.uniform(0, 2)))


def campaign(count=10_000, seed=1):
    """Check runs with at least so many changes."""
    report, rng = Report(seed), np.random.default_rng(seed)
    while report.changes < count and len(report.failures) < 20:
        check(report, random_case(rng), rng)
    return report


def check(report, case, rng):
    """Check all changes of a run: at the right state, all that are due, and not earlier."""
    n, m = case.B.shape
    values = case.parameters()
    named = {f"z{i}": float(x) for i, x in enumerate(rng.normal(size=n))}
    start = {**named, **dict.fromkeys(NAMES[:m], int(rng.integers(2)))}
    fine = {"t": SPAN, "integration": fs.Integration(rtol=1e-13, max_crossings=300)}

    def model_of(reverse=False):
        whole = relays(n, m, reverse)
        return whole.with_parameters({k: v for k, v in values.items() if k in whole.parameters})

    run = fs.simulate(model_of(), start, **fine)
    report.runs += 1
    where = f"seed {report.seed}, run {report.runs}"

    def expect(true, what):
        if not true:
            report.failures.append(f"{where}: {what}")

    if run.outcome.code not in ("end of time", "too many crossings"):
        expect(False, str(run.outcome))
    other = fs.simulate(model_of(reverse=True), start, **fine)
    events, others = (
        sorted((s.time, s.switch, s.value) for s in one.switches) for one in (run, other)
    )
    same = np.array_equal(run.end, other.end) and events == others
    expect(same, "the order of the switches changes the run")
    many = fs.simulate_many(model_of(), {k: [x] * 3 for k, x in start.items()}, **fine)
    size = 1 + np.abs(run.series[:, :n, 0]).max()
    # steps in lanes round differently
    near = np.abs(many.final - run.end[1:]).max() <= 100 * ALLOWED * size
    counts = [[len(run.switches(s, value=v)) for v in (1, 0)] for s in NAMES[:m]]
    alike = np.array_equal(many.switches, np.tile(counts, (3, 1, 1)))
    expect(near and alike, "the ensemble differs")
    states = [int(run[name][0]) for name in NAMES[:m]]
    time, here = SPAN[0], np.array([start[f"z{i}"] for i in range(n)])
    for row, event in enumerate(run.switches):
        report.changes += 1
        rest = -np.linalg.solve(case.A, case.B @ (2.0 * np.array(states) - 1.0))
        exact = expm(case.A * (event.time - time)) @ (here - rest) + rest
        error = np.abs(exact - event.state).max() / size
        report.worst = max(report.worst, error)
        height = case.heights(event.state, states)[NAMES.index(event.switch)]
        cascade = event.time == time and row > 0
        report.together += cascade
        # in a cascade the relation is true, else it becomes true
        on_time = height >= -1e-13 * size if cascade else abs(height) <= 1e-13 * size
        expect(error <= ALLOWED and on_time, f"error {error:.1e} at t = {event.time:.9g}")
        part, state = expm(case.A * ((event.time - time) / BETWEEN)), here
        for _ in range(BETWEEN - 1):
            state = part @ (state - rest) + rest
            if event.time > time and case.heights(state, states).max() > ALLOWED * size:
                expect(False, f"a change missed before t = {event.time:.9g}")
                break
        states[NAMES.index(event.switch)] = event.value
        time, here = event.time, event.state
