"""Equilibria, folds and Hopf points of random models, located numerically, in their derivations.

The models are x' = p - F(x), or x' = p - F(x) - y, y' = c (G(x) - y), with sums of trigonometric,
rational and exponential functions and powers with parameters as exponents. Numerically, folds and
Hopf points are zeros of derivatives along p = F + G, from a fine grid by bisection (SciPy).
"""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from scipy.optimize import brentq

import fastslow as fs
from fastslow.model.structure import real

#: Rows of the grid on which changes of sign are searched, and its end.
GRID, END = 3000, 7.3

#: Relative accuracy to which a closed form satisfies a numerical point.
CLOSE = 1e-6

#: Integers that are substituted for the counter of periods.
PERIODS = range(-12, 13)

X, Y, P, A, B, C, Q = map(real, ("x", "y", "p", "a", "b", "c", "q"))


@dataclass
class Report:
    """Points located numerically, those in the derivations, and those lost in silence."""

    located: int = 0
    explicit: int = 0
    implicit: int = 0
    named: int = 0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        lines = [
            f"{self.located} points located: {self.explicit} in closed form, {self.implicit} on "
            f"equations, {self.named} named as possibly missing, {len(self.failures)} lost"
        ]
        return "\n".join([*lines, *self.failures])


def random_function(rng):
    """Return a random function of x with parameters a, b and q."""
    number = lambda: sp.Rational(int(rng.integers(1, 7)), int(rng.integers(1, 5)))  # noqa: E731
    multiple, shift = int(rng.integers(1, 4)), number()
    kinds = [
        A * sp.sin(multiple * X),
        A * sp.cos(X) ** int(rng.integers(1, 4)) * sp.sin(X),
        A * sp.sin(X) / (B + 1 + sp.cos(X)),
        A * sp.cos(multiple * X + shift) + B * sp.sin(X) ** 2,
        A * sp.tan(X / 9) - B * sp.sin(X),
        A * X / (B + X**2),
        (A - X**2) / (1 + B * X**2),
        A * X**2 - number() * X**3,
        A * sp.exp(-number() * X**2),
        A * X * sp.exp(-X) - B * X,
        A * X**Q / (B + X**Q),
        X**Q - B * X,
        A * sp.tanh(X - number()) - B * X,
    ]
    picked = rng.choice(len(kinds), size=int(rng.integers(1, 3)), replace=False)
    return sp.Add(*(kinds[k] * (-1) ** int(rng.integers(2)) for k in picked))


def zeros_of(function, low):
    """Return the simple zeros of a function of x on the grid."""
    grid = np.linspace(low, END, GRID)
    with np.errstate(all="ignore"):
        values = np.broadcast_to(function(grid), grid.shape)
    found = []
    for k in np.flatnonzero(np.diff(np.sign(values)) != 0):
        if not np.all(np.isfinite(values[k : k + 2])):
            continue
        zero = brentq(function, grid[k], grid[k + 1], xtol=1e-15, rtol=1e-14)
        # a pole changes the sign as well
        if abs(function(zero)) < 1e-6 * (1 + abs(values[k]) + abs(values[k + 1])):
            found.append(float(zero))
    return found


class Checked:
    """Closed forms of one point, compiled."""

    def __init__(self, point):
        forms = {real(n): e for n, e in {**point.state, **point.parameters}.items()}
        self.complete = not point.equations
        terms = [sp.Add.make_args(e) for e in point.equations]
        used = (*forms.values(), *(t for some in terms for t in some))
        free = set().union(*(e.free_symbols for e in used))
        self.counters = [s for s in free if s.is_integer]
        self.names = [X, Y, P, A, B, C, Q, *self.counters]
        self.forms = tuple(forms)
        self._function = sp.lambdify(self.names, [list(forms.values()), *terms], "numpy")

    def at(self, place):
        """Return whether the closed forms and the equations hold at a numerical point."""
        known = [complex(place.get(s, 0.0)) for s in self.names[:7]]
        for number in PERIODS if self.counters else (0,):
            with np.errstate(all="ignore"):
                try:
                    values, *terms = self._function(*known, *[number] * len(self.counters))
                except ZeroDivisionError:
                    continue
                near = [
                    abs(value - place[s]) <= CLOSE * (1 + abs(place[s]))
                    for s, value in zip(self.forms, values, strict=True)
                ]
                near += [abs(sum(some)) <= CLOSE * (1 + max(map(abs, some))) for some in terms]
            if all(near):
                return True
        return False


def check(report, what, points, derived, place, notes):
    """Compare a numerical point with the closed forms of one kind."""
    report.located += 1
    on_equations = False
    for point in points:
        if point.at(place):
            if point.complete:
                report.explicit += 1
                return
            on_equations = True
    if on_equations:
        report.implicit += 1
    elif any("≠" in n or "missing" in n for n in notes):
        report.named += 1
    else:
        where = {str(s): round(float(e), 9) for s, e in place.items()}
        report.failures.append(f"{what} at {where}: {derived.summary()}")


def campaign(count=200, seed=0):
    """Derive random models and compare with points located numerically."""
    report = Report()
    for number in range(int(count)):
        rng = np.random.default_rng([int(seed), number])
        first, second = random_function(rng), random_function(rng)
        planar = bool(rng.integers(2))
        values = {A: 1 + rng.random(), B: 0.2 + rng.random(), C: 0.3 + rng.random()}
        values[Q] = 2 + 2 * rng.random()
        rates = {X: P - first - Y, Y: C * (second - Y)} if planar else {X: P - first}
        used = sorted(set().union(*(e.free_symbols for e in rates.values())) - {X, Y}, key=str)
        known = {s: values.get(s, sp.Integer(1)) for s in used}
        model = fs.Model(
            {str(s): e for s, e in rates.items()},
            parameters={str(s): float(v) for s, v in known.items()},
        )
        derived = fs.derive(model, assume={"p": "real"})
        (region,) = derived.regions.values()
        kinds = {
            "fold": (*region.folds, *region.branch_points),
            "Hopf": region.hopf,
            "equilibrium": region.equilibria,
        }
        forms = {kind: [Checked(point) for point in points] for kind, points in kinds.items()}
        curve = first + second if planar else first
        slope = sp.diff(curve, X)
        given = dict(values)
        low = 1e-3 if any(e.has(Q) for e in (first, second)) else -END
        tests = {"fold": slope}
        if planar:
            tests["Hopf"] = -sp.diff(first, X) - C
        for what, test in tests.items():
            function = sp.lambdify(X, test.subs(given), "numpy")
            for zero in zeros_of(function, low):
                place = {**given, X: zero, P: float(curve.subs(given).subs(X, zero))}
                place[Y] = float(second.subs(given).subs(X, zero))
                if what == "Hopf" and float(slope.subs(given).subs(X, zero)) < 1e-6:
                    continue
                check(report, what, forms[what], derived, place, region.notes)
        level = float(curve.subs(given).subs(X, 0.37 + low + rng.random()))
        function = sp.lambdify(X, curve.subs(given) - level, "numpy")
        for zero in zeros_of(function, low):
            place = {**given, X: zero, P: level, Y: float(second.subs(given).subs(X, zero))}
            check(report, "equilibrium", forms["equilibrium"], derived, place, region.notes)
    return report
