"""Branches of cycles of random piecewise-smooth systems against SciPy.

Liénard oscillators with a piecewise-linear characteristic, oscillators on a moving belt, which
stick, and linear systems of three states under a relay, which slide. Of every branch some rows are
integrated over one period from event to event, along the Filippov field where they slide; from any
row to the next one period, parameter and ranges change little.
"""

import warnings
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

#: Rows of a branch that are integrated.
ROWS = 3

#: Largest difference after one period, in units of the ranges and of the largest multiplier.
ALLOWED = 1e-7

#: Largest change from a row to the next one, in units of the largest values of the branch.
LEAP = 0.12

#: Duration after which an interface counts as left, and the largest number of pieces of a period.
LEFT, PIECES = 1e-9, 60

x, y, z, p = sp.symbols("x y z p")


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    systems: int = 0
    branches: int = 0
    rows: int = 0
    sliding: int = 0
    worst: float = 0.0
    leap: float = 0.0
    endings: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        ends = ", ".join(f"{count} {code}" for code, count in sorted(self.endings.items()))
        text = (
            f"seed {self.seed}: {self.rows} rows, {self.sliding} of them sliding, of "
            f"{self.branches} branches of cycles of {self.systems} systems\n"
            f"  largest difference after one period: {self.worst:.1e}\n"
            f"  largest change between rows: {self.leap:.3f}\n"
            f"  ends: {ends}\n  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


@dataclass
class Case:
    """A system with one interface h, its rates on both sides, and kinks where they are continuous.

    The rates are functions of the states and the parameter p.
    """

    name: str
    model: fs.Model
    start: list
    over: tuple
    interface: sp.Expr
    sides: tuple
    kinks: tuple = ()

    def compiled(self):
        """Interface with its gradient, both rates, and kinks as functions of (states, p)."""
        states = sp.symbols(self.model.states, real=True)
        plain = dict(zip(sp.symbols(self.model.states), states, strict=True))
        real = sp.Symbol("p", real=True)
        known = (*states, real)

        def function(expression):
            return sp.lambdify(known, sp.sympify(expression).subs({**plain, p: real}), "math")

        slopes = [sp.diff(self.interface, sp.Symbol(s)) for s in self.model.states]
        return (
            function(self.interface),
            [function(s) for s in slopes],
            [[function(rate) for rate in side] for side in self.sides],
            [function(kink) for kink in self.kinks],
        )


def lienard(rng):
    """Oscillator with a piecewise-linear characteristic of three slopes."""
    left, right = rng.uniform(0.3, 3, 2)
    middle, speed = -rng.uniform(0.2, 2), rng.uniform(0.1, 2)
    f = sp.Piecewise(
        (middle * -1 + left * (x + 1), x < -1),
        (middle * x, x < 1),
        (middle + right * (x - 1), True),
    )
    rates = (y - f, speed * (p - x))
    model = fs.Model(dict(zip((x, y), rates, strict=True)), parameters={p: 0.0})
    return Case(
        "lienard", model, [2.0, 0.1], (-1.5, 1.5), sp.Integer(1), (rates,) * 2, (x + 1, x - 1)
    )


def belt(rng):
    """Oscillator on a belt of speed p, with friction that falls and rises with the speed."""
    static, fall, rise = rng.uniform(0.5, 1.5), rng.uniform(0.5, 1.5), rng.uniform(0.2, 0.5)
    u = y - p

    def friction(sign):
        return sign * static - fall * u + rise * u**3

    sides = tuple((y, -x - friction(sign)) for sign in (1, -1))
    rate = sp.Piecewise((sides[0][1], u > 0), (sides[1][1], True))
    model = fs.Model({x: y, y: rate}, parameters={p: 0.5})
    return Case("belt", model, [static + 1.0, 0.0], (0.1, 2.0), u, sides)


def relay(rng):
    """Linear system of three states under a relay."""
    a = rng.uniform([0.2, 0.5, 0.5], [1.5, 2.0, 2.0])
    c = rng.uniform([0.2, -0.5, -0.2], [1.0, 0.5, 0.4])
    h = c[0] * x + c[1] * y + c[2] * z

    def side(sign):
        return (y, z, -a[0] * x - a[1] * y - a[2] * z - p * sign - 0.3 * sign * x)

    sides = side(1), side(-1)
    last = sp.Piecewise((sides[0][2], h > 0), (sides[1][2], True))
    model = fs.Model({x: y, y: z, z: last}, parameters={p: 1.0})
    return Case("relay", model, [1.0, 0.3, 0.2], (0.3, 3.0), h, sides)


def after_one_period(case, state, period, value, rtol=1e-12):
    """State after one period, from event to event; None if there are too many."""
    height, slopes, sides, kinks = case.compiled()

    def rates(side):
        return lambda t, s: [rate(*s, value) for rate in sides[side]]

    def drift(s, side):
        normal = [slope(*s, value) for slope in slopes]
        return float(np.dot(normal, [rate(*s, value) for rate in sides[side]]))

    def sliding(t, s):
        one, two = drift(s, 0), drift(s, 1)
        share = two / (two - one)
        return share * np.array(rates(0)(t, s)) + (1 - share) * np.array(rates(1)(t, s))

    jumps = case.sides[0] != case.sides[1]
    time, state = 0.0, np.array(state)
    first = height(*state, value)
    side = 0 if first > 0 else 1
    if jumps and abs(first) < 1e-10:
        side = _next_side(drift(state, 0), drift(state, 1), side)
    for _ in range(PIECES):
        begin = time
        if side == 2:
            functions = [lambda t, s: drift(s, 0), lambda t, s: drift(s, 1)]
            rate = sliding
        else:
            functions = [lambda t, s: height(*s, value)] if jumps else []
            functions += [lambda t, s, kink=kink: kink(*s, value) for kink in kinks]
            rate = rates(side)
        later = state + LEFT * period * np.array(rate(begin, state))
        signs = [one(begin, later) for one in functions]
        if side != 2 and jumps:
            # where sliding ends the motion leaves the interface along a tangent
            signs[0] = 1.0 - 2.0 * side
        known = zip(functions, signs, strict=True)
        events = [_after(one, begin + LEFT * period, sign) for one, sign in known]
        # short steps: an event is seen only if its sign differs at the ends of one
        settings = {"rtol": rtol, "atol": 1e-14, "method": "DOP853", "max_step": period / 300}
        run = solve_ivp(rate, (begin, period), state, events=events, **settings)
        time, state = float(run.t[-1]), run.y[:, -1]
        if run.status == 0:
            return state
        if side == 2:
            side = 0 if abs(drift(state, 0)) < abs(drift(state, 1)) else 1
        elif jumps and len(run.t_events[0]):
            side = _next_side(drift(state, 0), drift(state, 1), side)
    return None


def _next_side(one, two, side):
    """Side after the interface is met: through it, or sliding where both sides point to it."""
    if one < 0 < two:
        return 2
    return 1 if one < 0 else 0 if two > 0 else side


def _after(function, begin, sign):
    """An event of a function that has a known sign until a time."""

    def event(t, s):
        return function(t, s) if t > begin else sign

    event.terminal = True
    return event


def largest_step(branch):
    """Largest change from a row to the next one, of period, parameter and ranges of the states."""
    ranges = [branch[f"max({s}) - min({s})"] for s in branch.states]
    columns = np.array([branch.period, branch.values, *ranges])
    sizes = [branch.period.max(), np.ptp(branch.values) or 1.0, *(c.max() for c in ranges)]
    finite = np.isfinite(columns).all(axis=0)
    changes = np.abs(np.diff(columns[:, finite])) / np.array(sizes)[:, None]
    return float(changes.max(initial=0.0)) if np.isfinite(sizes).all() else 0.0


def check(case, branch, rng, report, rows=ROWS):
    """Integrate some rows of a branch."""
    report.branches += 1
    for outcome in branch.outcomes:
        report.endings[outcome.code] = report.endings.get(outcome.code, 0) + 1
    if len(branch) < 2:
        return
    leap = largest_step(branch)
    report.leap = max(report.leap, leap)
    if leap > LEAP:
        report.failures.append(f"{case.name}: a step of {leap:.2g} in {branch.outcomes}")
    plain = [k for k in range(len(branch)) if k not in set(branch.special_rows)]
    for k in rng.choice(plain, min(rows, len(plain)), replace=False).tolist():
        orbit = branch.orbits[k]
        value, begin = float(branch.values[k]), orbit.trajectory.steps[0, 0]
        state = orbit(begin)
        states = orbit.trajectory.sampled_columns[: len(state)]
        after = after_one_period(case, state, orbit.period, value)
        rough = after_one_period(case, state, orbit.period, value, rtol=1e-11)
        report.rows += 1
        report.sliding += any("|" in segment.region for segment in orbit.trajectory.segments)
        if after is None:
            report.failures.append(f"{case.name}: too many events at p = {value!r}")
            continue
        growth = max(1.0, float(np.exp(np.nanmax(orbit.log_multipliers))))
        # along a canard errors of the reference grow as well, and decay again
        own = 0.0 if rough is None else np.abs(after - rough)
        gap = np.maximum(np.abs(after - state) - own, 0.0) / np.ptp(states, axis=1)
        gap = float(gap.max()) / growth
        report.worst = max(report.worst, gap)
        if gap > ALLOWED:
            report.failures.append(f"{case.name}: {gap:.1e} at p = {value!r}, row {k}")


def campaign(count=60, seed=1, kinds=(lienard, belt, relay), rows=ROWS):
    """Trace the cycles of random systems."""
    report, rng = Report(seed), np.random.default_rng(seed)
    warnings.simplefilter("error")
    for number in range(count):
        case = kinds[number % len(kinds)](rng)
        report.systems += 1
        try:
            orbit = fs.find_orbit(case.model, case.start)
            diagram = fs.continue_equilibria(case.model, "p", over=case.over)
            branches = list(fs.continue_cycles(diagram))
            if orbit.outcome:
                branches.append(fs.continue_orbits(orbit, "p", over=case.over))
        except Exception as error:
            report.failures.append(f"{case.name}, system {number}: {type(error).__name__}: {error}")
            continue
        for branch in branches:
            check(case, branch, rng, report, rows)
    return report
