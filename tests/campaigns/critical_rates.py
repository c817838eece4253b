"""Critical rates of random shifts in one and two states, against bisection of runs by SciPy.

Half of the models are piecewise-smooth: continuous with corners, or with a jump of the rates that
is crossed. The reference integrates the equations as plain Python, from the start to a corner of
the shift and beyond, and bisects the rate by the side of the saddle on which runs end.
"""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

x, v, t, w, r, D = sp.symbols("x v t w r D")

#: Relative error of a critical rate by bisection with SciPy.
BISECTED = 2e-8


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    shifts: int = 0
    thresholds: int = 0
    by_newton: int = 0
    largest: float = 0.0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.shifts} shifts with {self.thresholds} critical rates, "
            f"{self.by_newton} by Newton's method, largest relative difference {self.largest:.2g}\n"
            f"  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


def random_model(rng, number):
    """A bistable model in y = x − w, and the stable start on the right of its saddle."""
    y, ends = x - w, ((0.6, 1.4), (0.3, 0.7), (0.5, 2.0), (0.3, 1.0), (2.2, 4.0))
    a, b, c, d, reach = (round(float(rng.uniform(*one)), 3) for one in ends)
    if number % 2 == 0:
        force, right = -c * (y + 1) * (y - b + 0.5) * (y - a), a
    else:
        # slopes −c outside, 1 inside, continuous at both corners
        outer = (c * (b - y) + b, y > b), (-c * (y + b) - b, y < -b)
        force, right = sp.Piecewise(*outer, (y, True)), b + b / c
    planar = number % 4 >= 2
    rates = {x: v, v: force - d * v} if planar else {x: force}
    law = (D * (1 + sp.tanh(r * t)) / 2, sp.Max(0, sp.Min(r * t, D)))[(number // 4) % 2]
    model = fs.Model(rates, forcing={w: law}, parameters={r: 1, D: reach})
    return model, [right, 0.0] if planar else [right]


def ends_of(model, start):
    """Function of the rate for the side of the saddle, ±, on which a run of SciPy ends."""
    written = [model.rates[n] for n in model.states]
    known = {s: sp.Symbol(s.name) for rate in written for s in rate.free_symbols}
    arguments = (w, *map(sp.Symbol, model.states))
    rates = sp.lambdify(arguments, [rate.subs(known) for rate in written], "math")
    reach, smooth = model.parameters["D"], model.forcing["w"].has(sp.tanh)

    def end(rate):
        def field_of(time, state):
            if smooth:
                return rates(reach * (1 + np.tanh(rate * time)) / 2, *state)
            return rates(max(0.0, min(rate * time, reach)), *state)

        first, settled = (-18 / rate, 25 / rate) if smooth else (0.0, reach / rate)
        state = np.array(start, dtype=float)
        for begin, last in ((first, settled), (settled, settled + 80)):
            step = (last - begin) / 400 if last == settled else np.inf
            options = {"rtol": 3e-13, "atol": 1e-13, "max_step": step, "method": "DOP853"}
            state = solve_ivp(field_of, (begin, last), state, **options).y[:, -1]
        return np.sign(state[0] - reach)

    return end


def reference(model, start, low, high, count=49):
    """Critical rates by bisection of runs with SciPy."""
    end, found = ends_of(model, start), []
    grid = np.geomspace(low, high, count)
    ends = [end(rate) for rate in grid]
    for k in np.flatnonzero(np.diff(ends)):
        below, above = grid[k], grid[k + 1]
        while above - below > 1e-10 * above:
            middle = 0.5 * (below + above)
            below, above = (middle, above) if end(middle) == ends[k] else (below, middle)
        found.append(0.5 * (below + above))
    return found


def compared(number, seed, report, span=(0.1, 10.0)):
    """Compare the critical rates of one random shift."""
    rng = np.random.default_rng((seed, number))
    model, start = random_model(rng, number)
    found = fs.critical_rate(model, "r", span, branch=start)
    known = reference(model, start, *span)
    report.shifts += 1
    report.thresholds += len(known)
    report.by_newton += sum(one.method == "Newton" for one in found)
    rates = [one.rate for one in found]
    what = f"shift {number}: {rates} instead of {known}; {model.equations}"
    if len(rates) != len(known):
        report.failures.append(what)
        return
    for rate, other in zip(rates, known, strict=True):
        apart = abs(rate / other - 1)
        report.largest = max(report.largest, apart)
        if apart > BISECTED:
            report.failures.append(what)


def campaign(count=30, seed=0):
    report = Report(seed)
    for number in range(count):
        compared(number, seed, report)
    return report
