"""Delayed loss of stability in a slow passage through a Hopf point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite, instance, positive, takes
from fastslow.errors import ArgumentError
from fastslow.passage.sites import WrongWay, drift, require_code
from fastslow.results.branches import Branch
from fastslow.results.delays import HopfExit
from fastslow.results.diagrams import Diagram
from fastslow.results.interpolation import hermite
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Beyond this decay, exp(−30) = 1e−13, rounding and noise outlive the memory of the entry.
MEMORY = 30.0

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


@takes(
    diagram=instance(Diagram),
    point=instance(SpecialPoint),
    entry=finite,
    rate=finite,
    gain=positive,
)
def hopf_exit(
    diagram: Diagram,
    point: SpecialPoint,
    entry: float,
    rate: float,
    *,
    gain: float = 1.0,
) -> HopfExit:
    """Where a trajectory that came to a sheet before a Hopf point leaves it behind the point.

    The amplitude falls as exp(∫ Re λ dp/rate) up to the Hopf point and grows as
    long again: without noise the exit solves

        ∫ Re λ(p) dp = rate · ln gain    from the entry to the exit,

    with the pair λ of the frozen equilibria along the branch (Neishtadt 1987; Baer,
    Erneux and Rinzel 1989). A decay beyond about 30 is forgotten in rounding, and
    the exit comes earlier than predicted. The buffer point, a bound on the delay
    for analytic rates that lies in complex time, is not looked for.

    Parameters
    ----------
    diagram : Diagram
        With the branch on both sides of the point.
    point : SpecialPoint
        A Hopf point of the diagram, code HB.
    entry : float
        The parameter where the trajectory comes to the sheet.
    rate : float
        Of the parameter, with its sign.
    gain : float
        Amplitude about the sheet at the exit by that at the entry.

    Returns
    -------
    HopfExit
        The delay is nan where the branch ends, turns or loses stability before.

    Raises
    ------
    ArgumentError
        For a point of another code or diagram, a rate of zero or towards the
        stable side, an entry that is not on the sheet before the point, or a gain
        that is not positive.

    References
    ----------
    A. I. Neishtadt, Differential Equations 23, 1385-1391, 1987. S. M. Baer,
    T. Erneux and J. Rinzel, SIAM J. Appl. Math. 49, 55-71, 1989.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y, p = sp.symbols("x y p")
    >>> rates = {x: p * x - y - x * (x**2 + y**2), y: x + p * y - y * (x**2 + y**2)}
    >>> diagram = fs.continue_equilibria(fs.Model(rates, parameters={p: 0}), "p", over=(-2, 2))
    >>> law = hopf_exit(diagram, diagram.special("HB")[0], entry=-1, rate=0.05)
    >>> round(law.value, 9), round(law.decay, 9)
    (1.0, 10.0)
    """
    require_code(point, "HB", "the exit after a Hopf point")
    speed = drift(rate)
    name = diagram.parameter
    branch, row = next(places(diagram, point))
    here, way = point[name], 1 if speed > 0 else -1
    values = branch.eigenvalues[row]
    turning = values[values.imag > 0]
    pair = complex(turning[np.argmin(np.abs(turning.real))])
    before = Sheet(diagram, branch, row, -way, pair)
    behind = Sheet(diagram, branch, row, way, pair)
    if before.first_growth() > 0:
        raise WrongWay(
            f"rate = {speed:g}: the sheet before {point.label} is not stable in this direction; "
            f"expected rate {'<' if speed > 0 else '>'} 0"
        )
    require_entry(before, point, entry)
    decay = -before.integral(entry) / abs(speed)
    exit_at = behind.where(abs(speed) * (decay + math.log(gain)))
    words = "the exit at the amplitude of the entry, the buffer point left aside"
    if math.isnan(exit_at):
        words = "none: the branch ends or turns before growth has made up for the decay"
    elif decay > MEMORY:
        words = (
            f"rounding decides: the amplitude falls by exp(−{decay:.0f}), below rounding and "
            "noise, and the exit comes earlier than this"
        )
    elif diagram.corrector is None:
        words += "; eigenvalues interpolated, as the diagram was read from a file"
    return HopfExit(
        point=point,
        parameter=name,
        rate=speed,
        delay=abs(exit_at - here),
        validity=words,
        entry=float(entry),
        decay=decay,
        gain=float(gain),
        forgotten=decay > MEMORY,
    )


def require_entry(before: Sheet, point: SpecialPoint, entry: float) -> None:
    """Raise unless an entry is on the sheet before a point."""
    name = before.diagram.parameter
    here = point[name]
    reached = before.ends[-1] if len(before.ends) else here
    low, high = sorted((reached, here))
    if not low <= entry <= high or entry == here:
        raise ArgumentError(
            f"entry = {entry:g}; expected a value of {name} on the sheet before {point.label}, "
            f"from {reached:g} to {here:g}"
        )


def places(diagram: Diagram, point: SpecialPoint) -> Iterator[tuple[Branch, int]]:
    """The branches of a diagram through a special point, each with its row."""
    found = False
    for branch in diagram.branches:
        for other, row in zip(branch.special, branch.special_rows, strict=True):
            alike = (other.code, other.states) == (point.code, point.states)
            if alike and diagram.parameters.items() <= point.parameters.items():
                apart = [other[n] - point[n] for n in (*other.states, diagram.parameter)]
                if np.abs(apart).max() <= 1e-9 * (1.0 + np.abs(point.state).max()):
                    found = True
                    yield branch, row
    if not found:
        raise ArgumentError(
            f"{point.label} is not a point of this diagram over {diagram.parameter}"
        )


@dataclass(eq=False)
class Sheet:
    """One side of a special point, as far as the parameter goes on in one direction.

    ``way`` is +1 where the parameter rises along it, ``critical`` the eigenvalue at the
    point that is followed along the branch.
    """

    diagram: Diagram
    branch: Branch
    row: int
    way: int
    critical: complex
    rows: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        values = self.branch.parameter
        step = self._direction(values)
        self.rows = [self.row]
        following = self.row + step
        while 0 <= following < len(values):
            change = self.way * (values[following] - values[following - step])
            if change < 0:
                break
            self.rows.append(following)
            following += step

    def _direction(self, values: Array) -> int:
        for step in (1, -1):
            beside = self.row + step
            if 0 <= beside < len(values) and self.way * (values[beside] - values[self.row]) > 0:
                return step
        return len(values)

    @property
    def ends(self) -> Array:
        return np.asarray(self.branch.parameter[self.rows[1:]])

    def first_growth(self) -> float:
        """Largest real part next to the point."""
        return float(self.branch.eigenvalues[self.rows[:2][-1]].real.max())

    def _steps(self) -> Iterator[tuple[int, float, float]]:
        values = self.branch.parameter
        for one, other in zip(self.rows[:-1], self.rows[1:], strict=True):
            if values[one] != values[other]:
                yield min(one, other), float(values[one]), float(values[other])

    def integral(self, end: float) -> float:
        """∫ Re λ |dp| from the point to a value on the sheet."""
        total, pair = 0.0, self.critical
        for row, start, stop in self._steps():
            last = self.way * (end - stop) <= 0
            part, pair = self._over(row, start, end if last else stop, pair)
            total += part
            if last:
                break
        return total

    def where(self, target: float) -> float:
        """The value at which the integral from the point reaches a target, nan if none does."""
        from scipy.optimize import brentq

        total, pair = 0.0, self.critical
        if target <= 0:
            return math.nan
        for row, start, stop in self._steps():
            part, following = self._over(row, start, stop, pair)
            if total + part >= target:
                missing = partial(self._missing, row, start, pair, target - total)
                return float(brentq(missing, start, stop, xtol=1e-15, rtol=1e-14))
            total, pair = total + part, following
        return math.nan

    def _missing(self, row: int, start: float, pair: complex, target: float, end: float) -> float:
        return self._over(row, start, end, pair)[0] - target

    def _over(self, row: int, start: float, end: float, pair: complex) -> tuple[float, complex]:
        """∫ Re λ |dp| within one step of the branch, and the eigenvalue at its last node."""
        half = 0.5 * (end - start)
        total = 0.0
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            pair = _next(self._eigenvalues(row, start + half * (1.0 + node)), pair)
            total += float(weight) * pair.real
        return abs(half) * total, pair

    def _eigenvalues(self, row: int, value: float) -> NDArray[np.complex128]:
        branch = self.branch
        if self.diagram.corrector is not None:
            state = hermite(branch, np.array([row]), np.array([value]))[0]
            solved = self.diagram.corrector(str(branch.region[row]), state, value)
            if solved is not None:
                return solved.eigenvalues
        low, high = branch.parameter[row], branch.parameter[row + 1]
        part = (value - low) / (high - low)
        both = np.sort_complex(branch.eigenvalues[row : row + 2])
        return np.asarray((1 - part) * both[0] + part * both[1])


def _next(values: NDArray[np.complex128], pair: complex) -> complex:
    """The eigenvalue that goes on from one; of two into which a pair splits, the larger."""
    upper = values[values.imag >= 0]
    apart = np.abs(upper - pair)
    near = upper[apart <= 1.5 * apart.min()]
    return complex(near[np.argmax(near.real)])
