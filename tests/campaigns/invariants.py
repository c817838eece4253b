"""Invariants of diagrams and cycles of random systems (`tests.invariants`), and what is missing.

Systems of one to four states with polynomial, bounded and periodic rates, half of them
piecewise-smooth. Beside the invariants, equilibria that Newton's method finds from many starts,
with the rates evaluated as written, must be on a branch, and first Lyapunov coefficients must agree
with differences of the rates in 40 digits.
"""

from __future__ import annotations

import random
import signal
import time
from collections import Counter
from dataclasses import dataclass, field

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import NDArray

import fastslow as fs
from tests.invariants import violations

Array = NDArray[np.float64]

p = sp.Symbol("p")
STATES = sp.symbols("x y z u")
OVER = (-1.5, 1.5)
VALUES = (-1.1180339, -0.3141592, 0.2718281, 1.0823232)

#: Starts of Newton's method at each value, and the box of half the starts; others are ten times
#: farther away.
STARTS, BOX = 100, 3.0

#: Processor time of a diagram, and of its cycles, in seconds, after which it is counted as late.
LATE = 30

#: Largest relative difference of a first Lyapunov coefficient.
LYAPUNOV = 1e-6

#: One in so many diagrams with Hopf points has its cycles traced.
TRACED = 3


class _LateError(Exception):
    pass


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    systems: int = 0
    complete: Counter = field(default_factory=Counter)
    sizes: Counter = field(default_factory=Counter)
    points: Counter = field(default_factory=Counter)
    equilibria: int = 0
    missing_in_found: int = 0
    coefficients: int = 0
    cycles: int = 0
    late: list[str] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        kinds = ", ".join(
            f"{self.complete[key]} of {count} ({states}{', piecewise' if kinked else ''})"
            for (states, kinked), count in sorted(self.sizes.items())
            for key in [(states, kinked)]
        )
        points = ", ".join(f"{count} {code}" for code, count in self.points.most_common())
        text = (
            f"seed {self.seed}: {self.systems} systems; complete: {kinds}\n  points: {points}\n"
            f"  {self.equilibria} equilibria by Newton's method, {self.missing_in_found} missing "
            f"in diagrams that are only found; {self.coefficients} Lyapunov coefficients; "
            f"{self.cycles} branches of cycles\n  processor time: median "
            f"{np.median(self.seconds or [0]):.2f} s, largest {max(self.seconds or [0]):.1f} s; "
            f"late: {len(self.late)}\n  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {one}" for one in self.late + self.failures)])


def random_model(generator: random.Random) -> tuple[dict[sp.Symbol, sp.Expr], bool]:
    """Rates of a random system, and whether they are piecewise-smooth."""
    n = generator.choice((1, 2, 2, 2, 3, 3, 4))
    states = STATES[:n]

    def number() -> sp.Rational:
        return sp.Rational(generator.choice((-1, 1)) * generator.randint(1, 12), 6)

    def inner() -> sp.Expr:
        return generator.choice(states) - number() / 2

    def term() -> sp.Expr:
        kind = generator.randrange(8)
        one, other = generator.choice(states), generator.choice(states)
        if kind < 2:
            return number() * one * other
        if kind == 2:
            return number() * one**2 * other
        if kind == 3:
            return number() * sp.tanh(inner())
        if kind == 4:
            return number() * one / (1 + other**2)
        if kind == 5:
            return number() * sp.sin(inner())
        if kind == 6:
            return number() * sp.exp(-((inner()) ** 2))
        return number() * p * one

    def kink() -> sp.Expr:
        kind = generator.randrange(5)
        if kind == 0:
            return number() * sp.Abs(inner())
        if kind == 1:
            return number() * sp.Max(0, inner())
        if kind == 2:
            return number() * sp.Min(1, sp.Max(-1, inner()))
        if kind == 3:
            return number() / 2 * sp.sign(inner())
        return sp.Piecewise((number() * inner(), inner() > 0), (number(), True))

    rates = {}
    for k, state in enumerate(states):
        rate = number() * generator.choice((0, 1)) + (p if k == 0 else 0)
        rate += sum(number() * s for s in generator.sample(states, generator.randint(1, n)))
        rate += sum(term() for _ in range(generator.randint(1, 3)))
        if generator.random() < 0.7:
            rate -= generator.choice((1, 2)) * state**3 / 3
        rates[state] = rate
    kinked = generator.random() < 0.5
    if kinked:
        for _ in range(generator.randint(1, 2)):
            rates[generator.choice(states)] += kink()
    if generator.random() < 0.4:
        # rates over six decades
        rates = {s: sp.Integer(10) ** generator.randint(-3, 3) * r for s, r in rates.items()}
    return rates, kinked


def newton_equilibria(rates: dict[sp.Symbol, sp.Expr], value: float, seed: int) -> Array:
    """Return isolated regular equilibria at a value, from many starts; shape (k, n)."""
    states = [sp.Symbol(str(s), real=True) for s in rates]
    field_ = sp.Matrix(list(rates.values())).subs(p, value)
    field_ = field_.subs(dict(zip(rates, states, strict=True)))
    jacobian = field_.jacobian(states).replace(sp.DiracDelta, lambda *_: sp.Integer(0))
    f, df = (sp.lambdify(states, m, "numpy", cse=True) for m in (field_, jacobian))
    random_ = np.random.default_rng(seed)
    n, found = len(states), []
    for start in range(STARTS):
        z = random_.uniform(-BOX, BOX, n) * (10.0 if start % 2 else 1.0)
        with np.errstate(all="ignore"):
            for _ in range(40):
                try:
                    step = np.linalg.solve(np.array(df(*z), float), np.array(f(*z), float).ravel())
                except np.linalg.LinAlgError:
                    break
                if not np.isfinite(step).all():
                    break
                length = np.abs(step).max()
                z = z - step * min(1.0, 3.0 / max(length, 1e-300))
                if length <= 1e-13 * (1 + np.abs(z).max()):
                    matrix = np.array(df(*z), float)
                    rows = np.abs(matrix).max(axis=1, keepdims=True)
                    if np.isfinite(matrix).all() and np.linalg.cond(matrix / rows) < 1e8:
                        found.append(z)
                    break
    distinct: list[Array] = []
    for z in found:
        if all(np.abs(z - other).max() > 1e-7 * (1 + np.abs(z).max()) for other in distinct):
            distinct.append(z)
    return np.array(distinct).reshape(-1, n)


def lyapunov_by_differences(
    rates: dict[sp.Symbol, sp.Expr], point: fs.SpecialPoint, at: float
) -> float:
    """Return l₁ (Kuznetsov 2004, eq. 5.34) with differences of the rates in 40 digits, at p."""
    with mpmath.workdps(40):
        names = list(rates)
        f = sp.lambdify([*names, p], list(rates.values()), "mpmath")
        value = mpmath.mpf(at)
        x0 = mpmath.findroot(lambda *z: f(*z, value), [mpmath.mpf(v) for v in point.state])
        n = len(names)

        def rate(z: mpmath.matrix) -> mpmath.matrix:
            return mpmath.matrix(f(*z, value))

        e = [mpmath.matrix([1 if i == j else 0 for i in range(n)]) for j in range(n)]
        h = mpmath.mpf(10) ** -8
        cube = {}

        def taylor(v: mpmath.matrix) -> tuple[mpmath.matrix, mpmath.matrix, mpmath.matrix]:
            """First, second and third derivatives along a real direction."""
            key = tuple(v)
            if key not in cube:
                w = [rate(x0 + k * h * v) for k in (-2, -1, 0, 1, 2)]
                first = (w[0] - 8 * w[1] + 8 * w[3] - w[4]) / (12 * h)
                second = (-w[0] + 16 * w[1] - 30 * w[2] + 16 * w[3] - w[4]) / (12 * h**2)
                third = (-w[0] + 2 * w[1] - 2 * w[3] + w[4]) / (2 * h**3)
                cube[key] = first, second, third
            return cube[key]

        def b_real(u: mpmath.matrix, v: mpmath.matrix) -> mpmath.matrix:
            return (taylor(u + v)[1] - taylor(u - v)[1]) / 4

        def c_real(u: mpmath.matrix, v: mpmath.matrix, w: mpmath.matrix) -> mpmath.matrix:
            t = lambda z: taylor(z)[2]  # noqa: E731
            return (t(u + v + w) - t(u + v - w) - t(u - v + w) + t(u - v - w)) / 24

        parts = lambda q: [q.apply(mpmath.re), q.apply(mpmath.im)]  # noqa: E731

        def multilinear(form, *vectors):
            total = mpmath.matrix(n, 1)
            for choice in np.ndindex(*(2,) * len(vectors)):
                factor = mpmath.mpc(0, 1) ** sum(choice)
                chosen = [parts(v)[k] for v, k in zip(vectors, choice, strict=True)]
                total += factor * form(*chosen)
            return total

        a = mpmath.matrix(n, n)
        for j in range(n):
            column = taylor(e[j])[0]
            for i in range(n):
                a[i, j] = column[i]
        values, right = mpmath.eig(a)
        k = min(range(n), key=lambda k: abs(values[k] - mpmath.mpc(0, point.frequency)))
        omega = mpmath.im(values[k])
        q = right[:, k]
        q /= mpmath.sqrt(sum(abs(c) ** 2 for c in q))
        left_values, left = mpmath.eig(a.T)
        m = min(range(n), key=lambda m: abs(left_values[m] + mpmath.mpc(0, omega)))
        w = left[:, m]
        w /= mpmath.conj(sum(mpmath.conj(w[i]) * q[i] for i in range(n)))
        qc = q.apply(mpmath.conj)
        inner = lambda v: sum(mpmath.conj(w[i]) * v[i] for i in range(n))  # noqa: E731
        s = mpmath.lu_solve(a, multilinear(b_real, q, qc))
        shifted = mpmath.mpc(0, 2 * omega) * mpmath.eye(n) - a
        r = mpmath.lu_solve(shifted, multilinear(b_real, q, q))
        g = inner(multilinear(c_real, q, q, qc)) - 2 * inner(multilinear(b_real, q, s))
        g += inner(multilinear(b_real, qc, r))
        return float(mpmath.re(g) / (2 * omega))


def examine(number: int, seed: int, report: Report) -> None:
    """Examine one system and add what was found to a report."""
    generator = random.Random(1_000_003 * seed + number)
    rates, kinked = random_model(generator)
    name = f"{number}: " + "; ".join(f"{s}' = {r}" for s, r in rates.items())
    kind = (len(rates), kinked)
    report.systems += 1
    report.sizes[kind] += 1
    model = fs.Model(rates, parameters={p: 0})
    start = time.process_time()
    try:
        diagram = _in_time(fs.continue_equilibria, model, "p", OVER)
    except _LateError:
        report.late.append(f"diagram of {name}")
        return
    except Exception as error:
        report.failures.append(f"{type(error).__name__}: {error}; {name}")
        return
    report.seconds.append(time.process_time() - start)
    report.complete[kind] += diagram.completeness == "complete"
    report.points.update(point.code for point in diagram.special)
    report.failures += [f"{one}; {name}" for one in violations(diagram)]
    for k, value in enumerate(VALUES):
        known = np.array([e.state for e in diagram.at(p=value)]).reshape(-1, len(rates))
        for z in newton_equilibria(rates, value, seed + k):
            if diagram.window is not None and not diagram.window.contains(z, np.ones(len(z))):
                continue
            report.equilibria += 1
            if (np.abs(known - z).max(axis=1, initial=0.0) < 1e-6 * (1 + np.abs(z).max())).any():
                continue
            if diagram.completeness == "complete":
                report.failures.append(f"complete, without {z} at p = {value}; {name}")
            else:
                report.missing_in_found += 1
    for point in diagram.special("HB"):
        if point.lyapunov is None or not np.isfinite(point.lyapunov) or "|" in point.regions[0]:
            continue
        # the formula may change by 0.2 % with the last place of p
        exact, beside = (
            lyapunov_by_differences(rates, point, at)
            for at in (point["p"], np.nextafter(point["p"], np.inf))
        )
        report.coefficients += 1
        bound = LYAPUNOV * (abs(exact) + 1e-6) + 4 * abs(beside - exact)
        if abs(point.lyapunov - exact) > bound:
            report.failures.append(f"{point.label}: l1 = {point.lyapunov}, not {exact}; {name}")
    if diagram.special("HB") and generator.randrange(TRACED) == 0:
        try:
            branches = _in_time(fs.continue_cycles, diagram)
        except _LateError:
            report.late.append(f"cycles of {name}")
        except Exception as error:
            report.failures.append(f"cycles: {type(error).__name__}: {error}; {name}")
        else:
            report.cycles += len(branches)
            report.failures += [f"{one}; {name}" for one in violations(branches)]


def _in_time(function, *arguments):
    """Call a function; raise _LateError past the limit of processor time."""

    def late(*_):
        raise _LateError

    signal.signal(signal.SIGPROF, late)
    # again every second: an exception within a finaliser is lost
    signal.setitimer(signal.ITIMER_PROF, LATE, 1.0)
    try:
        return function(*arguments)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def campaign(count: int = 1000, seed: int = 1) -> Report:
    """Examine so many random systems."""
    report = Report(seed)
    for number in range(count):
        examine(number, seed, report)
    return report
