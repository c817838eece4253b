"""Random polynomial systems against all their real roots by exact elimination.

The roots come from python-flint: resultants over the rationals for every state, their real roots
in ball arithmetic, and of all combinations those at which every equation holds to 300 digits.
Nothing of it is shared with the library.
"""

from __future__ import annotations

import itertools
import random
import time
from collections import Counter
from dataclasses import dataclass, field

import flint
import numpy as np
import sympy as sp
from numpy.typing import NDArray

import fastslow as fs

NAMES = ("x", "y", "z")
OVER = (-2.0, 2.0)
VALUES = (-1.6180339, -0.4142135, 0.3183098, 1.2599210)
BITS = 1000

#: Part of the diagrams with two states that must be complete.
CLAIMED = 0.9

p = sp.Symbol("p")


@dataclass(frozen=True)
class System:
    """Rates in the states and p, with |x − c| in the first where it is piecewise."""

    rates: tuple[sp.Expr, ...]
    slope: int
    corner: sp.Rational
    units: tuple[sp.Rational, ...]

    @property
    def n(self) -> int:
        return len(self.rates)

    @property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        return tuple(sp.Symbol(name) for name in NAMES[: self.n])

    def model(self) -> fs.Model:
        x = self.symbols[0]
        kink = self.slope * sp.Abs(x - self.corner) if self.slope else 0
        rates = [self.rates[0] + kink, *self.rates[1:]]
        # a state in another unit: u = unit · x
        place = {s: s / unit for s, unit in zip(self.symbols, self.units, strict=True)}
        scaled = [
            sp.expand(unit * r.subs(place)) for r, unit in zip(rates, self.units, strict=True)
        ]
        return fs.Model(dict(zip(self.symbols, scaled, strict=True)), parameters={p: 0.3})


def random_system(generator: random.Random, n: int) -> System:
    """Degree at most 4 in the states (3 for three) and 2 in p, one in four with a corner."""
    symbols = [sp.Symbol(name) for name in NAMES[:n]]
    degree = generator.randint(1, 4 if n < 3 else 2 + (generator.random() < 0.3))
    powers = [m for m in itertools.product(range(degree + 1), repeat=n) if sum(m) <= degree]

    def coefficient() -> sp.Rational:
        sign = generator.choice((-1, 1))
        return sp.Rational(sign * generator.randint(1, 9), generator.randint(1, 9))

    rates = []
    for _ in range(n):
        chosen = generator.sample(powers, min(generator.randint(2, 9), len(powers)))
        rate = coefficient()
        for m in chosen:
            inner = sum(coefficient() * p**k for k in range(generator.randint(0, 2) + 1))
            rate += inner * sp.prod([s**e for s, e in zip(symbols, m, strict=True)])
        rates.append(sp.expand(rate))
    kinked = generator.random() < 0.25
    far = generator.random() < 0.25
    return System(
        tuple(rates),
        generator.choice((-2, -1, 1, 2)) if kinked else 0,
        sp.Rational(generator.randint(-9, 9), 7),
        tuple(sp.Integer(10) ** (generator.randint(-6, 6) if far else 0) for _ in range(n)),
    )


def cubic_system(generator: random.Random) -> System:
    """Three states that decay, with cubic couplings, p in one rate and a corner in another."""
    symbols = [sp.Symbol(name) for name in NAMES]
    powers = [m for m in itertools.product(range(4), repeat=3) if 2 <= sum(m) <= 3]

    def coefficient(most: int) -> sp.Rational:
        return sp.Rational(generator.randint(-most, most), 10)

    rates = []
    for k, state in enumerate(symbols):
        rate = coefficient(20) - state - sp.Rational(generator.randint(0, 7), 10) * state**3
        rate += sum(coefficient(10) * other for j, other in enumerate(symbols) if j != k)
        for m in generator.sample(powers, 3):
            rate += coefficient(10) * sp.prod([s**e for s, e in zip(symbols, m, strict=True)])
        rates.append(rate)
    rates[generator.randrange(3)] += p
    return System(
        tuple(map(sp.expand, rates)),
        generator.choice((-2, -1, 1, 2)),
        sp.Rational(generator.randint(-9, 9), 7),
        (sp.Integer(1),) * 3,
    )


def real_roots(rates: list[sp.Expr], symbols: list[sp.Symbol]) -> NDArray[np.float64] | None:
    """All real roots; None where they are not isolated."""
    context = flint.fmpq_mpoly_ctx.get([str(s) for s in symbols], "lex")
    polynomials = []
    for rate in rates:
        terms = sp.Poly(rate, *symbols).terms()
        polynomials.append(
            context.from_dict({m: flint.fmpq(int(c.p), int(c.q)) for m, c in terms if c})
        )
    if any(f == 0 for f in polynomials):
        return None
    flint.ctx.prec = BITS
    candidates = []
    for k in range(len(symbols)):
        left = polynomials
        for other in range(len(symbols)):
            if other == k:
                continue
            having = [f for f in left if f.degrees()[other] > 0]
            if not having:
                # nothing determines that state
                return None
            pivot = min(having, key=lambda f: f.total_degree())
            rest = [f for f in left if f is not pivot]
            left = [
                f.resultant(pivot, str(symbols[other])) if f.degrees()[other] > 0 else f
                for f in rest
            ]
        (eliminant,) = left
        if eliminant == 0:
            return None
        coefficients = [flint.fmpq(0)] * (eliminant.degrees()[k] + 1)
        for m, c in eliminant.to_dict().items():
            coefficients[m[k]] = c
        values = []
        for factor, _ in flint.fmpq_poly(coefficients).numer().factor()[1]:
            values += [r.real for r, _ in factor.complex_roots() if r.imag == 0]
        candidates.append(values)
    found = []
    for point in itertools.product(*candidates):
        if all(_holds(f, point) for f in polynomials):
            found.append([float(x.mid()) for x in point])
    return np.array(found).reshape(-1, len(symbols))


def _holds(polynomial: flint.fmpq_mpoly, point: tuple[flint.arb, ...]) -> bool:
    total, size = flint.arb(0), flint.arb(0)
    for exponents, c in polynomial.to_dict().items():
        term = flint.arb(c)
        for x, e in zip(point, exponents, strict=True):
            term *= x**e
        total += term
        size += abs(term)
    return bool(abs(total).lower() <= size * flint.arb(10) ** -150)


def reference(system: System, value: float) -> NDArray[np.float64] | None:
    """All admissible equilibria at a value, in the system's units."""
    at = sp.Rational(value)
    rates = [r.subs(p, at) for r in system.rates]
    x = system.symbols[0]
    sides = (1, -1) if system.slope else (0,)
    found = []
    for side in sides:
        kink = side * system.slope * (x - system.corner)
        roots = real_roots([sp.expand(rates[0] + kink), *rates[1:]], list(system.symbols))
        if roots is None:
            return None
        found.append(roots[side * (roots[:, 0] - float(system.corner)) >= 0] if side else roots)
    return np.vstack(found) * np.array([float(u) for u in system.units])


@dataclass
class Counts:
    """What was compared, for one number of states."""

    systems: int = 0
    degenerate: int = 0
    claimed: int = 0
    expected: int = 0
    missing_claimed: int = 0
    missing_found: int = 0
    false: int = 0
    duplicated: int = 0
    lists_claimed: int = 0
    lists: int = 0
    seconds: float = 0.0
    worst: float = 0.0
    faults: list[str] = field(default_factory=list)


def _unmatched(
    these: NDArray[np.float64], those: NDArray[np.float64], unit: NDArray[np.float64]
) -> int:
    """How many of these have none among those within 1e-6 of their size."""
    count = 0
    for one in these:
        near = 1e-6 * np.maximum(np.abs(one), unit)
        count += not any(np.all(np.abs(one - other) <= near) for other in those)
    return count


def compare(system: System, counts: Counts) -> None:
    """The list at every value, and the diagram at every value, with the reference."""
    truths = {v: reference(system, v) for v in VALUES}
    if any(t is None for t in truths.values()):
        counts.degenerate += 1
        return
    counts.systems += 1
    model = system.model()
    unit = 1e-3 * np.array([float(u) for u in system.units])
    started = time.process_time()
    diagram = fs.continue_equilibria(model, "p", OVER)
    spent = time.process_time() - started
    counts.seconds += spent
    counts.worst = max(counts.worst, spent)
    complete = diagram.completeness == "complete"
    counts.claimed += complete
    for value, truth in truths.items():
        listed = fs.equilibria(model, p=value)
        inside = truth[diagram.window.contains(truth)] if len(truth) else truth
        drawn = diagram.at(p=value)
        for points, wanted, sure in (
            (listed, truth, listed.completeness == "complete"),
            (drawn, inside, complete),
        ):
            states = np.array([e.state for e in points]).reshape(-1, system.n)
            missing = _unmatched(wanted, states, unit)
            false = _unmatched(states, truth, unit)
            pairs = sum(
                _unmatched(states[k : k + 1], states[:k], unit) == 0 for k in range(len(states))
            )
            counts.expected += len(wanted)
            counts.missing_claimed += missing if sure else 0
            counts.missing_found += 0 if sure else missing
            counts.false += false
            counts.duplicated += pairs
            if false or pairs or missing:
                kind = "list" if points is listed else "diagram"
                counts.faults.append(
                    f"{kind} at p = {value}: {missing} missing, {false} false, {pairs} twice "
                    f"({'complete' if sure else 'found'}); {system}"
                )
        counts.lists += 1
        counts.lists_claimed += listed.completeness == "complete"


@dataclass(frozen=True)
class Report:
    """Counts by number of states."""

    counts: dict[int, Counts]

    @property
    def failures(self) -> bool:
        """Whether anything is missing where completeness is claimed, false, or listed twice."""
        wrong = (c.missing_claimed + c.false + c.duplicated for c in self.counts.values())
        planar = self.counts.get(2)
        rare = planar is not None and planar.claimed < CLAIMED * planar.systems
        return any(wrong) or rare

    def __str__(self) -> str:
        lines = []
        for n, c in self.counts.items():
            lines.append(
                f"n = {n}: {c.systems} systems ({c.degenerate} more without isolated equilibria), "
                f"diagrams complete {c.claimed / max(c.systems, 1):.1%}, lists complete "
                f"{c.lists_claimed / max(c.lists, 1):.1%}; of {c.expected} equilibria "
                f"{c.missing_claimed} missing where complete, {c.missing_found} where found, "
                f"{c.false} false, {c.duplicated} twice; "
                f"{c.seconds / max(c.systems, 1):.2f} s a diagram, at most {c.worst:.1f}"
            )
            lines += [f"    {fault}" for fault in c.faults]
        return "\n".join(lines)


def campaign(count: int = 500, seed: int = 1, states: int | str = 0) -> Report:
    """Compare random systems, half of them with two states, or all with a number of states.

    The word ``cubics`` in place of the number stands for those of `cubic_system`.
    """
    generator = random.Random(seed)
    if isinstance(states, str):
        cubics = Counts()
        while cubics.systems < count:
            compare(cubic_system(generator), cubics)
        return Report({3: cubics})
    wanted = Counter({1: count // 4, 3: count // 4, 2: count - 2 * (count // 4)})
    if states:
        wanted = Counter({states: count})
    found = {n: Counts() for n in sorted(wanted)}
    for n, most in sorted(wanted.items()):
        while found[n].systems < most:
            compare(random_system(generator, n), found[n])
    return Report(found)
