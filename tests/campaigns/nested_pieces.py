"""Random models with nested pieces: what is computed against the equations as they are written.

Absolute values, maxima, minima, signs and Piecewise are nested in each other in rates, forcings,
slow states, resets and switches. At times within the steps of runs, and at the points of diagrams,
certificates and orbits, the rates in use are compared with the given expressions, which plain
Python evaluates without rewriting them. Runs whose solution is unique are compared with SciPy.
"""

import math
import operator
import tempfile
from dataclasses import dataclass, field, replace
from random import Random

import numpy as np
import sympy as sp
from numpy.polynomial import polynomial
from scipy.integrate import solve_ivp

import fastslow as fs

t, x, y, z, lam, mu, q = sp.symbols("t x y z lam mu q")

#: Largest difference of a rate, and of a state at the end of a run, relative to their size.
RATES, ENDS = 1e-6, 2e-5

#: Distance in states and time at which another value counts as a piece that is next to a point.
BESIDE = 1e-7

#: Length of a run, and of one with an orbit.
SPAN, LONG = 2.5, 12 * math.pi

#: The functions and relations of expressions.
CALLS = {
    sp.Add: lambda *terms: math.fsum(terms),
    sp.Mul: lambda *factors: math.prod(factors),
    sp.Pow: operator.pow,
    sp.Abs: abs,
    sp.Max: max,
    sp.Min: min,
    sp.sign: lambda u: float(np.sign(u)),
    sp.Heaviside: lambda u, at_zero=0.5: float(np.heaviside(u, at_zero)),
    sp.sin: math.sin,
    sp.cos: math.cos,
    sp.StrictGreaterThan: operator.gt,
    sp.GreaterThan: operator.ge,
    sp.StrictLessThan: operator.lt,
    sp.LessThan: operator.le,
    sp.And: lambda *all_of: all(all_of),
    sp.ITE: lambda condition, one, other: one if condition else other,
    sp.Not: operator.not_,
    sp.Or: lambda *any_of: any(any_of),
}


def written(expression):
    """Return a function of values by name that evaluates an expression as it is written."""
    if isinstance(expression, fs.Tabulated):
        return lambda at: float(expression(at["t"]))
    if expression in (sp.true, sp.false):
        return lambda at: expression == sp.true
    if expression.is_Symbol:
        return lambda at: at[expression.name]
    if expression.is_number:
        number = float(expression)
        return lambda at: number
    if isinstance(expression, sp.Piecewise):
        pieces = [(written(value), written(condition)) for value, condition in expression.args]
        return lambda at: next(value(at) for value, condition in pieces if condition(at))
    call, arguments = CALLS[expression.func], [written(a) for a in expression.args]
    return lambda at: call(*(argument(at) for argument in arguments))


@dataclass
class Case:
    """The expressions of a model, as they are given."""

    rates: dict
    slow: dict
    forcing: dict
    parameters: dict
    resets: dict
    switches: dict
    smooth: bool
    start: list

    def model(self):
        given = self.forcing, self.slow, self.parameters, self.resets, self.switches
        names = "forcing", "slow", "parameters", "resets", "switches"
        return fs.Model(self.rates, **dict(zip(names, given, strict=True)))

    def states(self, start):
        """A start with the states of switches."""
        names = [*map(str, (*self.rates, *self.slow)), *map(str, self.switches)]
        return dict(zip(names, [*start, *(0 for _ in self.switches)], strict=True))

    def functions(self):
        """Rates of all states, and laws, as functions of values by name."""
        rates = [written(e) for e in (*self.rates.values(), *self.slow.values())]
        return rates, {str(n): written(e) for n, e in self.forcing.items()}


class Drawn:
    """Random expressions; the number of pieces in one model is limited."""

    def __init__(self, seed):
        self.random = Random(seed)
        self.parameters = {}
        self.left = 4
        self.smooth = True

    def number(self, low=-1.5, high=1.5):
        """A fraction, or a parameter with this value."""
        value = sp.Rational(self.random.randint(round(16 * low), round(16 * high)), 16)
        if self.random.random() < 0.3:
            symbol = sp.Symbol(f"k{len(self.parameters)}")
            self.parameters[symbol] = float(value) + 0.01
            return symbol
        return value

    def affine(self, symbols):
        chosen = self.random.sample(symbols, min(len(symbols), self.random.randint(1, 2)))
        return self.number() + sp.Add(*(self.number() * s for s in chosen))

    def condition(self, symbols, depth):
        relation = self.random.choice([sp.Gt, sp.Ge, sp.Lt, sp.Le])
        one = relation(self.pieces(symbols, depth - 1), self.affine(symbols))
        if self.left > 0 and self.random.random() < 0.2:
            self.left -= 1
            junction = self.random.choice([sp.And, sp.Or])
            return junction(one, self.affine(symbols) > 0)
        return one

    def pieces(self, symbols, depth=2):
        """An expression with nested pieces, continuous unless ``smooth`` is cleared."""
        if depth == 0 or self.left <= 0:
            return self.affine(symbols)
        self.left -= 1
        kind = self.random.choice(["abs", "max", "min", "ramp", "sum", "jump", "sign", "step"])
        inner = self.pieces(symbols, depth - 1)
        if kind == "abs":
            return sp.Abs(inner)
        if kind in ("max", "min"):
            return (sp.Max if kind == "max" else sp.Min)(inner, self.affine(symbols))
        if kind == "ramp":
            corner = self.number()
            return sp.Piecewise((corner, inner < corner), (inner, True))
        if kind == "sum":
            return inner + self.number() * self.pieces(symbols, depth - 1)
        self.smooth = False
        if kind == "sign":
            return self.number() * sp.sign(inner)
        if kind == "step":
            return self.number() * sp.Heaviside(inner)
        return sp.Piecewise(
            (self.affine(symbols), self.condition(symbols, depth)), (self.affine(symbols), True)
        )

    def law(self):
        """A forcing: pieces in time, or a table."""
        kind = self.random.choice(["pieces", "ramp", "wave", "jump", "table"])
        rate, level = self.number(0.5, 2), self.number(0.25, 1.5)
        if kind == "table":
            times = np.cumsum([0, *(self.random.randint(3, 12) / 16 for _ in range(7))])
            values = [self.random.randint(-16, 16) / 16 for _ in times]
            times[-1] = max(times[-1], LONG)
            way = self.random.choice(["linear", "previous", "cubic"])
            return fs.Tabulated(times, values, interpolation=way)
        self.left -= 1
        if kind == "ramp":
            return sp.Min(rate * t, level)
        if kind == "wave":
            return sp.Max(sp.sin(rate * t + 1), level - 1)
        if kind == "jump":
            return sp.Piecewise((rate * t, t < level), (self.number(), True))
        return self.pieces([t], 2)

    def case(self):
        random = self.random
        states = [x, y][: random.randint(1, 2)]
        slow = [z] if random.random() < 0.25 else []
        forcing = {n: self.law() for n in [lam, mu][: random.choice([0, 1, 1, 1, 2])]}
        symbols = [*states, *slow, *forcing, *([] if forcing else [t])]
        start = [random.randint(-24, 24) / 16 + 0.003 for _ in (*states, *slow)]
        self.smooth = all(not isinstance(f, fs.Tabulated) for f in forcing.values())
        switches, resets = {}, {}
        if random.random() < 0.2:
            over = random.choice([x, *forcing])
            middle, width = self.number(), sp.Rational(random.randint(2, 12), 16)
            switches[q] = (over > middle + width, over < middle - width)
            symbols.append(q)
        rates = {s: self.pieces(symbols) - s for s in states}
        slow = {s: self.pieces(symbols, 1) / 10 for s in slow}
        if random.random() < 0.2:
            wall = sp.Rational(random.randint(-8, 8), 16) + random.choice([0, *forcing])
            values = {x: wall - self.number(0.5, 1)}
            if y in states:
                values[y] = self.pieces([y, *forcing], 1)
            resets[x >= wall] = values
            start[0] -= 4
        return Case(rates, slow, forcing, self.parameters, resets, switches, self.smooth, start)


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    models: int = 0
    points: int = 0
    beside: int = 0
    events: int = 0
    ended: int = 0
    compared: int = 0
    diagrams: int = 0
    rows: int = 0
    orbits: int = 0
    refused: int = 0
    undrawn: int = 0
    worst_rate: float = 0.0
    worst_end: float = 0.0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.models} models, {self.points} points of runs, {self.beside} "
            f"others beside an interface, {self.events} resets; {self.ended} runs ended before "
            f"the end of their time\n  largest difference of a rate: {self.worst_rate:.1e}\n  "
            f"{self.compared} runs compared with SciPy, largest difference at their end: "
            f"{self.worst_end:.1e}\n  {self.rows} rows of {self.diagrams} diagrams and their "
            f"certificates, {self.orbits} orbits, {self.refused} not found; {self.undrawn} models "
            f"not drawn\n  "
            f"failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


def campaign(count=500, seed=0):
    """Check so many models."""
    report = Report(seed)
    while report.models < count:
        drawn = Drawn(1_000_000 * seed + report.models + report.undrawn)
        try:
            case = drawn.case()
        except RecursionError:
            # the evaluation of some nested conditions by SymPy does not end
            report.undrawn += 1
            continue
        check(report, case)
        report.models += 1
    return report


def check(report, case):
    """Check everything about one model."""
    where = f"seed {report.seed}, model {report.models}"
    try:
        model = case.model()
        runs(report, where, case, model)
        if not (case.resets or case.switches):
            if report.models % 4 == 0:
                diagrams(report, where, case, model)
            if report.models % 4 == 2:
                orbits(report, where, case)
    except fs.FastSlowError as error:
        report.failures.append(f"{where}: {type(error).__name__}: {error}")


def runs(report, where, case, model):
    """Check runs: alone, in an ensemble, with a model from a file, and backwards."""
    starts = [case.start, [value + 0.25 for value in case.start]]
    alone = [fs.simulate(model, case.states(start), t=(0, SPAN)) for start in starts]
    many = fs.simulate_many(
        model,
        {n: np.array([s[n] for s in map(case.states, starts)]) for n in case.states(starts[0])},
        t=(0, SPAN),
    )
    for run, final in zip(alone, many.final, strict=True):
        along(report, where, case, run)
        if run.outcome.success:
            compare(report, f"{where}, ensemble", final, end_of(run), 1e-9)
    run = alone[0]
    with tempfile.TemporaryDirectory() as folder:
        run.save(f"{folder}/run.npz")
        stored = fs.load(f"{folder}/run.npz").model
    again = fs.simulate(stored, case.states(case.start), t=(0, SPAN))
    if len(again.series) != len(run.series) or not (again.series == run.series).all():
        report.failures.append(f"{where}: another run with the model from a file")
    if case.smooth and not (case.resets or case.switches):
        if not run.outcome.success:
            report.failures.append(f"{where}: {run.outcome.reason}")
            return
        peer(report, where, case, run)
        back = fs.simulate(model, end_of(run), t=(SPAN, 0))
        compare(
            report, f"{where}, backwards", back.series[0, : len(case.start), 0], case.start, ENDS
        )


def along(report, where, case, run):
    """Compare laws and rates at a time within every step, and the values of resets."""
    rates, laws = case.functions()
    names, numbers = run.states, {str(n): v for n, v in case.parameters.items()}
    n, random = len(names), Random(report.models)
    report.ended += not run.outcome.success
    for (begin, length, mode, _), series in zip(run.steps, run.series, strict=True):
        if "|" in run.modes[int(mode)] or " at rest " in run.modes[int(mode)]:
            continue
        offset = length * random.uniform(0.1, 0.9)
        values = polynomial.polyval(offset, series.T)
        slopes = polynomial.polyval(offset, polynomial.polyder(series[:n].T))
        used = dict(zip((*names, *run.forcing), values, strict=True)) | numbers
        used["t"] = begin + offset
        expected = as_written(rates, laws, used)
        size = 1.0 + np.abs(expected)
        if any(
            (
                np.abs(as_written(rates, laws, used | {s: used[s] + d}) - expected) > 1e-4 * size
            ).any()
            for s in ("t", *names)
            for d in (BESIDE, -BESIDE)
        ):
            report.beside += 1
            continue
        report.points += 1
        worst = (
            np.abs(np.concatenate([slopes, values[n : n + len(laws)]]) - expected) / size
        ).max()
        report.worst_rate = max(report.worst_rate, worst)
        if not worst < RATES:
            report.failures.append(f"{where}: rates differ by {worst:.1e} at t = {used['t']:.9g}")
            return
        for condition in (*case.resets, *crossed_relations(case, used)):
            gap = written(sp.sympify(condition.lhs - condition.rhs))(used | lawful(laws, used))
            if gap * (1 if condition.gts == condition.lhs else -1) > BESIDE:
                report.failures.append(f"{where}: {condition} is true at t = {used['t']:.9g}")
                return
    for event in run.resets:
        report.events += 1
        before = dict(zip(names, event.before, strict=True)) | numbers | {"t": event.time}
        ((_, jump),) = case.resets.items()
        for name, after in zip(names, event.after, strict=True):
            known = jump.get(sp.Symbol(name), sp.Symbol(name))
            # a law may jump at this time
            near = [
                written(sp.sympify(known))(before | lawful(laws, before | {"t": event.time + d}))
                for d in (-BESIDE, 0.0, BESIDE)
            ]
            if min(abs(after - value) for value in near) > 1e-5 * (1 + abs(after)):
                report.failures.append(f"{where}: reset of {name} to {after} at {event.time:.9g}")


def crossed_relations(case, used):
    """The relations that would change a switch in its present state."""
    return [relations[int(used[str(name)] > 0.5)] for name, relations in case.switches.items()]


def lawful(laws, used):
    """Values of the slow quantities by name."""
    return {name: law(used) for name, law in laws.items()}


def as_written(rates, laws, used):
    """Rates of all states, and slow quantities."""
    now = lawful(laws, used)
    return np.array([*(rate(used | now) for rate in rates), *now.values()])


def end_of(run):
    """The states at the end of a run."""
    return np.array([run[name][-1] for name in run.states])


def compare(report, where, found, expected, allowed):
    """Compare two states."""
    worst = (np.abs(found - expected) / (1 + np.abs(expected))).max()
    if not worst < allowed:
        report.failures.append(f"{where}: states differ by {worst:.1e}")
    return worst


def peer(report, where, case, run):
    """Compare the end of a run with SciPy."""
    rates, laws = case.functions()
    numbers = {str(n): v for n, v in case.parameters.items()}

    def slopes(time, state):
        used = dict(zip(run.states, state, strict=True)) | numbers | {"t": time}
        return as_written(rates, laws, used)[: len(state)]

    other = solve_ivp(
        slopes, (0, SPAN), case.start, "RK45", rtol=1e-8, atol=1e-9, max_step=SPAN / 100
    )
    report.compared += 1
    worst = compare(report, f"{where}, SciPy", end_of(run), other.y[:, -1], ENDS)
    report.worst_end = max(report.worst_end, worst)


def diagrams(report, where, case, model):
    """Check that rates vanish at the rows of a diagram and of its certificate."""
    if not case.forcing:
        return
    frozen = model.frozen()
    others = dict.fromkeys(frozen.free[1:], 0.3125)
    frozen = frozen.with_parameters(others)
    name = frozen.free[0]
    # slow states are frozen
    rates = case.functions()[0][: len(case.rates)]
    values = {str(n): v for n, v in case.parameters.items()} | others
    diagram = fs.continue_equilibria(frozen, name, over=(-1.03, 1.07))
    window = dict.fromkeys(frozen.states, (-4.03, 4.07))
    certificate = fs.certify(frozen, diagram, window=window)
    report.diagrams += 1
    names, rows = (*frozen.states, name), []
    for branch in diagram:
        columns = branch.to_dict()
        points = np.column_stack([columns[n] for n in names])
        rows += zip(points, columns["region"], strict=True)
    for curve in certificate.curves:
        if curve.admissible:
            rows += [(point, curve.region) for point in (curve.node_low + curve.node_high) / 2]
    for point, region in rows:
        used = values | dict(zip(names, map(float, point), strict=True))
        near = [used | {n: used[n] + d} for n in names for d in (BESIDE, -BESIDE)]
        here, *beside = (np.array([rate(one) for rate in rates]) for one in (used, *near))
        if "|" in region or any(np.abs(one - here).max() > 1e-4 for one in beside):
            continue
        report.rows += 1
        if np.abs(here).max() > 1e-8 * (1 + max(map(abs, used.values()))):
            report.failures.append(f"{where}: no equilibrium at {used} in {region}: {here}")
            return
    if case.smooth and frozen.states == ("x",):
        used = values | {name: 0.21875}
        grid = np.linspace(-4, 4.01, 4001)
        signs = np.sign([rates[0](used | {"x": place}) for place in grid])
        known = grid[:-1][signs[1:] * signs[:-1] < 0]
        given = fs.equilibria(frozen, **{name: used[name]})
        found = np.array([point["x"] for point in given])
        lost = [p for p in known if not np.any(np.abs(found - p) < 0.01)]
        if lost:
            report.failures.append(f"{where}: equilibria lack x = {lost[0]:.4g} at {used}")


def orbits(report, where, case):
    """Check the rates along a forced orbit."""
    if not case.forcing or case.slow:
        return
    laws = {lam: sp.Max(sp.sin(t), sp.Rational(-1, 3)), mu: sp.Abs(sp.cos(t) - sp.Rational(1, 4))}
    rates = {s: rate - 2 * s for s, rate in case.rates.items()}
    other = replace(case, rates=rates, forcing={n: laws[n] for n in case.forcing})
    run = fs.simulate(other.model(), case.start, t=(0, LONG))
    if not run.outcome.success or np.abs(end_of(run)).max() > 10:
        return
    try:
        orbit = fs.find_orbit(run.model, run)
    except fs.FastSlowError:
        report.refused += 1
        return
    report.orbits += 1
    along(report, f"{where}, orbit", other, orbit.trajectory)
