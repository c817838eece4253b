"""Special points of random block systems whose places are known in closed form.

Every system is a product of small blocks (a cubic with two folds, Hopf, transcritical and
pitchfork normal forms), each in its own unit of time over six decades, and of passive states
that they drive nonlinearly. Half of the systems of up to eight states are written in other
coordinates, so that no block is seen in the Jacobian.
"""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

import fastslow as fs

Array = NDArray[np.float64]

OVER = (-1.0, 1.0)

#: Largest error of a special point, in the parameter and in each state's unit.
NEAR = 1e-7

#: Numbers of states beyond twenty, one system in ten.
LARGE = (30, 45, 60, 200)

#: Numbers of states up to which half of the systems are written in other coordinates.
MIXED = 8

p = sp.Symbol("p")


def _decimal(value: float, digits: int = 4) -> sp.Rational:
    return sp.Rational(f"{value:.{digits}g}")


@dataclass(frozen=True)
class Block:
    """A normal form around ``place``, in a unit of time of its own.

    Parameters
    ----------
    kind : str
        "cubic", "hopf", "transcritical" or "pitchfork".
    rate, place, shape : Rational
        Rates are multiples of ``rate``. ``shape`` is the distance of the folds from the
        middle of the cubic, the frequency of the Hopf block, else the nonlinear coefficient.
    sign : int
        Of the change of stability (the cubic term, for a Hopf block).
    """

    kind: str
    rate: sp.Rational
    place: sp.Rational
    shape: sp.Rational
    sign: int

    @property
    def size(self) -> int:
        return 2 if self.kind == "hopf" else 1

    def rates(self, states: list[sp.Symbol]) -> list[sp.Expr]:
        x, shift, shape = states[0], p - self.place, self.shape
        if self.kind == "cubic":
            return [self.rate * (shift - x**3 + 3 * shape**2 * x)]
        if self.kind == "transcritical":
            return [self.rate * x * (self.sign * shift - shape * x)]
        if self.kind == "pitchfork":
            return [self.rate * x * (self.sign * shift - shape * x**2)]
        y = states[1]
        growth = shift - self.sign * (x**2 + y**2)
        return [self.rate * (growth * x - shape * y), self.rate * (shape * x + growth * y)]

    def sheets(self, value: Array, x: Array) -> list[tuple[Array, Array]]:
        """State and eigenvalue of every sheet but the cubic's; NaN where there is none."""
        shift = self.sign * (value - float(self.place)) * float(self.rate)
        zero = np.zeros_like(value)
        with np.errstate(invalid="ignore"):
            scaled = shift / float(self.rate * self.shape)
            if self.kind == "transcritical":
                return [(zero, shift), (scaled, -shift)]
            if self.kind == "pitchfork":
                root = np.sqrt(scaled)
                return [(zero, shift), (root, -2 * shift), (-root, -2 * shift)]
        return [(zero, shift)]


@dataclass(frozen=True)
class Special:
    """A special point: its code, the parameter and the states of the blocks there."""

    code: str
    value: float
    states: tuple[float, ...]


@dataclass(frozen=True)
class System:
    """Blocks, and passive states that they drive.

    Parameters
    ----------
    blocks : tuple of Block
        The cubic, if there is one, comes first.
    passive : tuple
        (rate, frequency or 0, coefficient, kind of drive, two states that drive) each; one
        with a frequency has two states.
    units : tuple of Rational
        One for each state.
    mixed : tuple of (int, int, Rational)
        Multiples of one state that are added to another.
    """

    blocks: tuple[Block, ...]
    passive: tuple[tuple[sp.Rational, sp.Rational, sp.Rational, str, int, int], ...]
    units: tuple[sp.Rational, ...]
    mixed: tuple[tuple[int, int, sp.Rational], ...]

    @property
    def n(self) -> int:
        return len(self.units)

    def model(self) -> fs.Model:
        # x are the states of the blocks, u = unit · T x those of the model
        x = sp.symbols(f"x:{self.n}")
        rates: list[sp.Expr] = []
        for block in self.blocks:
            at = len(rates)
            rates += block.rates(list(x[at : at + block.size]))
        for rate, frequency, coefficient, kind, one, other in self.passive:
            z, at = x[len(rates)], len(rates)
            drive = {
                "product": x[one] * x[other],
                "square": x[one] ** 2 + x[other],
                "bounded": x[other] / (1 + x[one] ** 2),
            }[kind]
            rates.append(rate * (coefficient * drive - z))
            if frequency:
                rates[-1] -= rate * frequency * x[at + 1]
                rates.append(rate * (frequency * z - x[at + 1]))
        u = sp.symbols(f"u:{self.n}")
        place = [s / unit for s, unit in zip(u, self.units, strict=True)]
        for to, source, factor in reversed(self.mixed):
            place[to] -= factor * place[source]
        if self.mixed:
            for to, source, factor in self.mixed:
                rates[to] += factor * rates[source]
        known = dict(zip(x, place, strict=True))
        scaled = [unit * rate.xreplace(known) for unit, rate in zip(self.units, rates, strict=True)]
        return fs.Model(dict(zip(u, scaled, strict=True)), parameters={p: 0})

    def unmixed(self, states: Array) -> Array:
        """States of the blocks, from those of the model; shape (..., n)."""
        x = states / np.array([float(u) for u in self.units])
        for to, source, factor in reversed(self.mixed):
            x[..., to] -= float(factor) * x[..., source]
        return x

    def curves(self) -> Iterator[tuple[Array, Array, Array]]:
        """Every curve: the parameter, the blocks' states and their real eigenvalues, by rows.

        A Hopf block has states zero and no real eigenvalue.
        """
        fine = np.linspace(-2.5, 2.5, 20001)
        cubic = self.blocks[0] if self.blocks[0].kind == "cubic" else None
        if cubic is None:
            start = (fine, np.zeros((len(fine), 0)), np.zeros((len(fine), 0)))
        else:
            width = float(cubic.shape)
            value = float(cubic.place) + fine**3 - 3 * width**2 * fine
            slope = 3 * float(cubic.rate) * (width**2 - fine**2)
            start = (value, fine[:, None], slope[:, None])
        chosen = [start]
        for block in self.blocks[cubic is not None :]:
            extended = []
            for value, states, eigenvalues in chosen:
                for state, eigenvalue in block.sheets(value, fine):
                    column = np.column_stack([states] + [state] * block.size)
                    real = [] if block.kind == "hopf" else [eigenvalue]
                    extended.append((value, column, np.column_stack([eigenvalues, *real])))
            chosen = extended
        yield from chosen

    def special(self) -> list[Special]:
        """All folds, branch and Hopf points in closed form."""
        found = []
        cubic = self.blocks[0] if self.blocks[0].kind == "cubic" else None
        for block in self.blocks:
            if block is cubic:
                width = float(block.shape)
                at = [(float(block.place) - 2 * x**3, x) for x in (width, -width)]
                codes = "LP"
            else:
                at = [(float(block.place), x) for x in _on_cubic(cubic, float(block.place))]
                codes = "HB" if block.kind == "hopf" else "BP"
            for value, x in at:
                if not OVER[0] < value < OVER[1]:
                    continue
                states: list[tuple[float, ...]] = [()]
                for other in self.blocks:
                    if other is cubic:
                        own = [(x,)]
                    elif other is block:
                        own = [(0.0,) * block.size]
                    else:
                        sheets = other.sheets(np.array([value]), np.array([x]))
                        own = [(float(s[0]),) * other.size for s, _ in sheets if np.isfinite(s[0])]
                    states = [s + o for s in states for o in own]
                found += [Special(codes, value, s) for s in states]
        return found

    def neutral(self) -> list[float]:
        """Values of the parameter at neutral saddles, to the distance of the rows."""
        fixed = [-float(rate) for rate, frequency, *_ in self.passive if not frequency]
        found = []
        for value, states, moving in self.curves():
            inside = (value > OVER[0]) & (value < OVER[1]) & np.isfinite(states).all(axis=1)
            real = np.column_stack([moving, *[np.full(len(value), f) for f in fixed]])
            first, second = np.triu_indices(real.shape[1], 1)
            both = (first < moving.shape[1]) & (first != second)
            sums = real[:, first[both]] + real[:, second[both]]
            crossed = (sums[1:] * sums[:-1] < 0) & (inside[1:] & inside[:-1])[:, None]
            found += [float(v) for row in np.nonzero(crossed)[0] for v in [value[row]]]
        return found


def _on_cubic(cubic: Block | None, value: float) -> list[float]:
    """States of the cubic at a value; 0 without one."""
    if cubic is None:
        return [0.0]
    roots = np.roots([1.0, 0.0, -3 * float(cubic.shape) ** 2, float(cubic.place) - value])
    return [float(r.real) for r in roots if abs(r.imag) < 1e-9]


def random_system(generator: random.Random, n: int) -> System:
    """One with n states: at most a cubic, two branching blocks and two Hopf blocks."""

    def rate() -> sp.Rational:
        return _decimal(10 ** generator.uniform(-3, 3))

    def block(kind: str) -> Block:
        shape = generator.uniform(0.3, 0.6) if kind == "cubic" else generator.uniform(0.5, 2.0)
        place = generator.uniform(-0.3, 0.3) if kind == "cubic" else generator.uniform(-0.9, 0.9)
        if kind == "hopf":
            shape = 10 ** generator.uniform(-1, 1)
        sign = generator.choice((-1, 1))
        return Block(kind, rate(), _decimal(place), _decimal(shape), sign)

    kinds = ["cubic"] if generator.random() < 0.6 else []
    kinds += ["hopf"] * generator.randint(1, 2 if n > 4 else 1)
    branching = generator.randint(0, 2 if n < 60 else 1)
    kinds += generator.choices(("transcritical", "pitchfork"), k=branching)
    blocks: list[Block] = []
    for kind in kinds:
        if sum(b.size for b in blocks) + 1 + (kind == "hopf") <= n:
            blocks.append(block(kind))
    used = active = sum(b.size for b in blocks)
    passive = []
    while used < n:
        turning = used + 2 <= n and generator.random() < 0.3
        kind = generator.choice(("product", "square", "bounded"))
        # passive states drive bounded terms alone, so that none grows with their number
        other = generator.randrange(used if kind == "bounded" else active)
        frequency = _decimal(10 ** generator.uniform(-1, 1)) if turning else sp.Integer(0)
        coefficient = _decimal(generator.choice((-1, 1)) * generator.uniform(0.2, 2))
        one = generator.randrange(active)
        passive.append((rate(), frequency, coefficient, kind, one, other))
        used += 1 + turning
    units = [sp.Integer(10) ** generator.randint(-3, 3) for _ in range(n)]
    mixed = []
    if n <= MIXED and generator.random() < 0.5:
        for _ in range(n):
            to, source = generator.sample(range(n), 2)
            mixed.append((to, source, sp.Rational(generator.choice((-2, -1, 1, 2)), 4)))
    return System(tuple(blocks), tuple(passive), tuple(units), tuple(mixed))


@dataclass
class Report:
    """What was compared."""

    systems: int = 0
    most: int = 0
    expected: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("LP", "BP", "HB"), 0))
    missing: int = 0
    false: int = 0
    duplicated: int = 0
    unexplained: int = 0
    frequencies: int = 0
    neutral: int = 0
    neutral_expected: int = 0
    error: float = 0.0
    seconds: float = 0.0
    worst: float = 0.0
    faults: list[str] = field(default_factory=list)

    @property
    def failures(self) -> bool:
        """Whether a point is missing, false, listed twice or wrong, or a change unexplained."""
        wrong = (self.missing, self.false, self.duplicated, self.unexplained, self.frequencies)
        return any(wrong)

    def __str__(self) -> str:
        kinds = ", ".join(f"{count} {code}" for code, count in self.expected.items())
        lines = [
            f"{self.systems} systems of up to {self.most} states: of {kinds} {self.missing} "
            f"missing, {self.false} false, {self.duplicated} twice, {self.frequencies} with a "
            f"wrong frequency or criticality; {self.unexplained} changes unexplained; "
            f"{self.neutral} neutral saddles for {self.neutral_expected}; largest error "
            f"{self.error:.1e}; {self.seconds / max(self.systems, 1):.1f} s a system, at most "
            f"{self.worst:.0f}"
        ]
        return "\n".join(lines + [f"    {fault}" for fault in self.faults])


def compare(system: System, report: Report, name: str = "") -> None:
    """The special points of a diagram with those in closed form."""
    model = system.model()
    started = time.process_time()
    diagram = fs.continue_equilibria(model, "p", OVER)
    spent = time.process_time() - started
    report.systems += 1
    report.most = max(report.most, system.n)
    report.seconds += spent
    report.worst = max(report.worst, spent)
    report.unexplained += len(diagram.unexplained)
    faults = [str(change) for change in diagram.unexplained]
    active = sum(b.size for b in system.blocks)
    truth = system.special()
    for code in ("LP", "BP", "HB"):
        wanted = [s for s in truth if s.code == code]
        points = list(diagram.special(code))
        report.expected[code] += len(wanted)
        states = np.array([q.state for q in points]).reshape(-1, system.n)
        found = np.column_stack(
            [[q["p"] for q in points], system.unmixed(states)[:, :active]]
        ).reshape(-1, active + 1)
        expected = np.array([(s.value, *s.states) for s in wanted]).reshape(-1, active + 1)
        apart = np.abs(found[:, None] - expected[None]).max(axis=2)
        near = apart < NEAR
        missing = [wanted[k] for k in np.flatnonzero(~near.any(axis=0))]
        false = [points[k] for k in np.flatnonzero(~near.any(axis=1))]
        twice = int(np.maximum(near.sum(axis=0) - 1, 0).sum())
        report.missing += len(missing)
        report.false += len(false)
        report.duplicated += twice
        if near.any():
            report.error = max(report.error, float(apart[near].max()))
        faults += [f"missing {m}" for m in missing] + [f"false {q!r}" for q in false]
        faults += [f"{twice} {code} twice"] if twice else []
        if code == "HB":
            wrong = [points[k] for k, m in np.argwhere(near) if not _agrees(system, points[k])]
            report.frequencies += len(wrong)
            faults += [f"frequency or criticality of {q!r}" for q in wrong]
    report.neutral += len(diagram.special("NSD"))
    report.neutral_expected += len(system.neutral())
    report.faults += [f"{name} n = {system.n}: {fault}" for fault in faults]


def _agrees(system: System, point: fs.SpecialPoint) -> bool:
    """Whether the frequency and the sign of the coefficient are those of the block there."""
    blocks = [b for b in system.blocks if b.kind == "hopf"]
    block = min(blocks, key=lambda b: abs(float(b.place) - point["p"]))
    frequency = float(block.rate * block.shape)
    same = abs(point.frequency - frequency) <= 1e-6 * frequency
    return same and np.sign(point.lyapunov) == -block.sign


def campaign(count: int = 100, seed: int = 1, largest: int = 200) -> Report:
    """Random systems: one in ten of thirty to ``largest`` states, the others of at most 20."""
    generator = random.Random(seed)
    report = Report()
    for k in range(count):
        small = k % 10 != 9 or largest < LARGE[0]
        sizes = [size for size in LARGE if size <= largest]
        n = generator.randint(4, min(20, largest)) if small else sizes[k // 10 % len(sizes)]
        compare(random_system(generator, n), report, f"system {k} of seed {seed},")
    return report
