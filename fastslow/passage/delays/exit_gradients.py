"""Derivatives of exits by differentiation of the entry-exit integral under the integral."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.diagrams.curves.point_gradients import path_of
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.functions import numpy_function
from fastslow.model.structure import real
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.delays.delay_gradients import RATE, other_parameters
from fastslow.passage.delays.growth_rates import BranchSide
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.overlay.delays import EntryExit
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Name of the entry, by which an exit can be differentiated too.
ENTRY = "entry"

#: Gauss points on every piece of a branch.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)

#: Distance from a change of region at which growth rates on both of its sides are taken,
#: relative to the path.
BESIDE_REGION = 1e-10


def gradient_of_exit(delay: EntryExit, name: str) -> NamedMapping[float]:
    """Differentiate the entry-exit integral ∫ Re λ dw = rate ln(gain) under the integral.

    With g = Re λ along the branch, g(exit) d exit/dp = g(entry) d entry/dp − ∫ ∂g/∂p dw
    + d rate/dp ln(gain).
    """
    mode = delay.source
    if not isinstance(mode, CriticalMode) or mode.local is None:
        raise ArgumentError(
            "this exit has no branch of a model to integrate along (it was predicted along a run, "
            "or read from a file or another process); use fs.predict_delay with diagram= and entry="
        )
    if delay.lost:
        raise ArgumentError(f"the exit has no derivative: {delay.lost}")
    model, own = mode.local.field.model, delay.parameter
    integral = _Integral(mode, delay.entry, delay.value, name)
    at_exit = integral.growth(delay.value)
    critical = rate = entry = changed = 0.0
    if name in model.parameters and name != own:
        critical = path_of(delay.point, name).along[mode.local.n]
        changed = integral.derivative()
    elif name == RATE:
        rate = 1.0
    elif name == ENTRY:
        entry = integral.growth(delay.entry)
    elif name == own:
        raise ArgumentError(f"{name} is the parameter of the diagram, which drifts")
    else:
        raise unknown_name("parameter", name, (*other_parameters(model, own), RATE, ENTRY))
    exit_by = (entry - changed + rate * math.log(delay.gain)) / at_exit
    by = math.copysign(1.0, delay.rate) * (exit_by - critical)
    time = by / abs(delay.rate) - rate * delay.delay_time / delay.rate
    return NamedMapping("quantity", {"delay": by, "value": exit_by, "delay_time": time})


@dataclass(frozen=True, eq=False)
class _Integral:
    """The entry-exit integral along a branch.

    Parameters
    ----------
    mode : CriticalMode
    entry, exit : float
    name : str
        The parameter by which it is differentiated.
    """

    mode: CriticalMode
    entry: float
    exit: float
    name: str

    def growth(self, value: float) -> float:
        return float(self.mode.side(value).rate(np.array([value]))[0])

    def derivative(self) -> float:
        """∫ ∂(Re λ)/∂p dw, with the jumps of Re λ where the branch changes its region."""
        total = 0.0
        for low, high in self._pieces():
            half = 0.5 * (high - low)
            places = 0.5 * (high + low) + half * NODES
            total += half * float(WEIGHTS @ [self._changed(w) for w in places.tolist()])
        for joint in self._joints():
            here = joint[self.mode.behind.diagram.parameter]
            beside = BESIDE_REGION * (self.exit - self.entry)
            jump = self.growth(here - beside) - self.growth(here + beside)
            total += jump * path_of(joint, self.name).along[len(joint.states)]
        return total

    def _pieces(self) -> Iterator[tuple[float, float]]:
        """Intervals on which the growth rate is smooth, from the entry to the exit."""
        for side, end in ((self.mode.before, self.entry), (self.mode.behind, self.exit)):
            side.rate(np.array([end]))
            for piece in side.pieces:
                stop = piece.stop
                if side.way * (stop - end) > 0.0:
                    stop = end
                if side.way * (stop - piece.start) > 0.0:
                    yield (piece.start, stop) if end == self.exit else (stop, piece.start)

    def _joints(self) -> Iterator[SpecialPoint]:
        """Boundary equilibria between entry and exit."""
        parameter = self.mode.behind.diagram.parameter
        low, high = sorted((self.entry, self.exit))
        sides: tuple[BranchSide, ...] = (self.mode.before, self.mode.behind)
        for side in sides:
            rows = set(side.rows) - {side.row}
            for point, row in zip(side.branch.special, side.branch.special_rows, strict=True):
                between = int(row) in rows and low < point[parameter] < high
                if between and point.kind.two_rows:
                    yield point

    def _changed(self, value: float) -> float:
        """∂(Re λ)/∂p at a value of the slow quantity, along the branch."""
        found = self.mode.at(value)
        if found is None:
            raise ArgumentError("the branch is in a sliding region, where this is not computed")
        n, unit = self._local.n, self.mode.unit
        u = np.append(found.state * unit, value)
        region = self._local.region(found.region)
        jacobian, by_name, _ = self._functions(region)
        moved = -np.linalg.solve(jacobian(*u), by_name(*u).ravel())
        table = self._functions(region)[2](*u, *moved).reshape(n, n)
        return float((found.left @ (table * unit / unit[:, None]) @ found.right).real)

    @property
    def _local(self) -> Any:
        return self.mode.local

    @cached_property
    def _known(self) -> dict[int, tuple[Callable[..., Array], ...]]:
        return {}

    def _functions(self, region: int) -> tuple[Callable[..., Array], ...]:
        """J, F_p, and the change of J with p and the states, as functions of states and w."""
        if region not in self._known:
            field = self._local.field
            states = [real(n) for n in field.model.states]
            own, p = real(field.parameter), real(self.name)
            moved = [sp.Dummy(f"d{s}", real=True) for s in states]
            numbers = {k: v for k, v in field.model.values.items() if k != own}
            rates = sp.Matrix(field.rates(region))
            jacobian = rates.jacobian(states)
            changed = jacobian.diff(p)
            for state, by in zip(states, moved, strict=True):
                changed += by * jacobian.diff(state)
            tables = (
                (jacobian, [*states, own]),
                (rates.diff(p), [*states, own]),
                (changed, [*states, own, *moved]),
            )
            self._known[region] = tuple(
                _evaluated(table.xreplace(numbers), symbols) for table, symbols in tables
            )
        return self._known[region]


def _evaluated(table: Any, symbols: list[Any]) -> Callable[..., Array]:
    function, shape = numpy_function(symbols, list(table)), table.shape

    def evaluate(*values: float) -> Array:
        return np.array(function(*values), dtype=float).reshape(shape)

    return evaluate
