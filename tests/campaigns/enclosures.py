"""Interval enclosures of functions and their derivatives against 250 bits.

A program encloses a function of two unknowns and its derivatives over random boxes: thin and wide
ones, of sizes from 1e-12 to 1e12. Reference values at the corners and at random points inside are
computed with mpmath.
"""

from dataclasses import dataclass, field
from fractions import Fraction

import mpmath
import numpy as np
import sympy as sp

from fastslow.certification.loops import ENCLOSE
from fastslow.kernels.intervals.printer import interval_program
from fastslow.kernels.loops import load_loop

x, y = sp.symbols("x y")
g = (x + 40) / 10

#: Functions of which enclosures are tested.
ELEMENTARY = [
    x + y, x - y, x * y, x / y, 1 / x, x**2, x**3, x**4, x**7, x**-3, x**8 - y,
    sp.Rational(1, 3) * x, sp.pi * x + sp.sqrt(2) * y, sp.Float(0.1) * x + y,
    sp.sqrt(x), x ** sp.Rational(3, 2), x ** sp.Rational(1, 3), x**y, sp.log(x),
    sp.exp(x), sp.exp(-(x**2)), sp.sin(x), sp.cos(x), sp.tan(x), sp.atan(x), sp.asin(x),
    sp.acos(x), sp.sinh(x), sp.cosh(x), sp.tanh(x), sp.sech(x), sp.coth(x), sp.sec(x),
    sp.acosh(x + 1), sp.atanh(x), sp.acot(x), sp.asec(x + 1), sp.asech(x),
    x / (sp.exp(x) - 1), g / (1 - sp.exp(-g)), x * y / (1 + x**2), sp.exp(x) * sp.cos(y),
    (x + y) ** 3 - 3 * x * y, x**3 * y**2 - x * y + sp.Rational(7, 10),
]  # fmt: skip

BITS = 250


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    enclosures: int = 0
    failures: list[str] = field(default_factory=list)
    finite: int = 0

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.enclosures} enclosures, {self.finite} of them finite\n"
            f"  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


def boxes(rng, count):
    """Random boxes of two unknowns, shapes (count, 2)."""
    size = 10.0 ** rng.choice([-12, -3, -1, 0, 0, 0, 1, 2, 3, 12], (count, 2))
    middle = rng.uniform(-1, 1, (count, 2)) * size
    wide = 10.0 ** rng.choice([-np.inf, -15, -9, -3, -1, 0], (count, 2))
    radius = wide * np.abs(middle)
    return middle - radius, middle + radius


def points_in(rng, low, high):
    """Corners and a point of a box."""
    inside = np.clip(low + rng.random(2) * (high - low), low, high)
    return [low, high, inside]


def references(expression):
    """The function and its derivatives, at the precision of mpmath."""
    parts = [expression, *(expression.diff(u) for u in (x, y))]
    # a Float means its binary value
    exact = [e.xreplace({n: sp.Rational(n) for n in e.atoms(sp.Float)}) for e in parts]
    return [sp.lambdify((x, y), e, "mpmath") for e in exact]


def compiled(program, low, high):
    """Enclosures by the compiled program."""
    out = np.empty((len(low), 3)), np.empty((len(low), 3))
    load_loop(ENCLOSE)(program.program, low, high, program.registers(), *out)
    return out


def contains(low, high, value):
    """Whether an interval contains a number of many bits."""
    return (np.isneginf(low) or mpmath.mpf(low) <= value) and (
        np.isposinf(high) or value <= mpmath.mpf(high)
    )


def check(report, expression, rng, count, enclose=compiled):
    """Test enclosures of one function at so many boxes."""
    low, high = boxes(rng, count)
    program = interval_program([expression], [x, y])
    below, above = enclose(program, low, high)
    functions = references(expression)
    for k in range(count):
        report.finite += int(np.isfinite(below[k, 0]))
        for point in points_in(rng, low[k], high[k]):
            arguments = [mpmath.mpf(float(v)) for v in point]
            for j, function in enumerate(functions):
                value = value_of(function, arguments)
                if value is None:
                    continue
                report.enclosures += 1
                if not contains(below[k, j], above[k, j], value):
                    report.failures.append(
                        f"{expression}, derivative {j}: {mpmath.nstr(value, 20)} at "
                        f"{point.tolist()} is outside [{below[k, j]!r}, {above[k, j]!r}]"
                    )


def value_of(function, arguments):
    """A real value; None where the function has none."""
    try:
        value = mpmath.mpmathify(function(*arguments))
    except (ZeroDivisionError, ValueError, OverflowError):
        return None
    return value if isinstance(value, mpmath.mpf) and mpmath.isfinite(value) else None


def campaign(count=1_000_000, seed=0, expressions=ELEMENTARY):
    """Test at least so many enclosures."""
    rng = np.random.default_rng(seed)
    report = Report(seed)
    with mpmath.workprec(BITS):
        while report.enclosures < count:
            for expression in [*expressions, random_expression(rng)]:
                check(report, expression, rng, min(50, 1 + count // 400))
    return report


def random_expression(rng):
    """A sum of products of functions of linear combinations with random coefficients."""

    def linear():
        a, b, c = (sp.Rational(*Fraction(float(v)).as_integer_ratio()) for v in rng.normal(size=3))
        return a * x + b * y + c

    functions = [sp.exp, sp.sin, sp.cos, sp.tanh, sp.cosh, sp.atan, lambda e: e**3, lambda e: e**2]
    return sum(functions[rng.integers(len(functions))](linear()) * linear() / 3 for _ in range(3))
