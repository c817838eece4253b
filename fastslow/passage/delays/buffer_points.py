"""Buffer point of a slow passage through a Hopf bifurcation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from fastslow.model.functions import numpy_function
from fastslow.model.structure import real
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.roots import sign_change

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Functions that are not analytic.
NOT_ANALYTIC = (sp.Piecewise, sp.Abs, sp.sign, sp.Max, sp.Min, sp.Heaviside, sp.floor, sp.ceiling)

#: Error control along a level curve, and largest distance of its end from the entry, relative to
#: its length.
LEVEL_RTOL, ARRIVED = 1e-8, 1e-3

#: Bisections for the first level whose curve is interrupted.
LEVEL_BISECTIONS = 22

#: Relative change of a state above which a branch depends on the parameter.
MOVES = 1e-9

#: Bisections for the level at which the pair becomes real.
LEVELS = 12


@dataclass(frozen=True)
class Buffer:
    """Level of the buffer point and its consequence.

    Parameters
    ----------
    level : float
        ∫ Re λ |dp| from the Hopf point to the buffer point; inf if no level curve up to
        the entry is interrupted, nan if it is not computed.
    words : str
        Consequence, or the reason why it is not computed or irrelevant.
    """

    level: float
    words: str


def buffer_of(mode: CriticalMode, level: float) -> Buffer:
    """Locate the buffer point of a constant drift up to a level ∫ Re λ |dp|.

    The motion about a branch that moves with the parameter is forced by its lag. Along
    the curve Re ψ(s) = c, ψ(s) = ∫ λ ds from the Hopf point, in the complex parameter, the
    forcing is transported from an entry to the exit at the same level c. The buffer point is
    at the first level c whose curve contains a zero or a singularity of λ and no longer
    connects exit and entry (Neishtadt 1988). Each curve is traced by ds/dψ = 1/λ together
    with the equilibrium.

    Parameters
    ----------
    mode : CriticalMode
        Critical mode of a Hopf point.
    level : float
        Level of the entry.

    Returns
    -------
    Buffer
    """
    reason = _not_computed(mode)
    if reason:
        return Buffer(math.nan, f"the buffer point is not computed, as {reason}")
    rows = [*mode.before.rows, *mode.behind.rows]
    if (np.ptp(mode.before.branch.state[rows], axis=0) <= MOVES * mode.unit).all():
        return Buffer(math.inf, "no buffer point, as the branch does not move")
    curve = LevelCurve(mode, _functions(mode))
    highest = level
    if not curve.focal(level):
        # levels up to where the pair becomes real
        low, high = 0.0, level
        for _ in range(LEVELS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if curve.focal(middle) else (low, middle)
        highest = low
    if not highest > 0.0:
        return Buffer(math.nan, "the buffer point is not computed")
    if curve.connects(highest):
        if highest < level:
            return Buffer(math.nan, "the buffer point is not computed, as the pair becomes real")
        return Buffer(math.inf, "the buffer point is beyond the exit")
    low, high = 0.0, highest
    for _ in range(LEVEL_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if curve.connects(middle) else (low, middle)
    at = mode.behind.where(low)
    name = mode.before.diagram.parameter
    words = (
        f"limited by the buffer point: earlier entries exit together at {name} = {at:.6g}, up to "
        "terms of the order of rate ln(1/rate); no error bound"
    )
    return Buffer(low, words)


def _not_computed(mode: CriticalMode) -> str:
    if mode.local is None or mode.before.diagram.corrector is None:
        return "there is no model"
    field = mode.local.field
    if len(field.modes) > 1:
        return "the model has interfaces"
    rates = field.rates(0)
    if any(rate.has(*NOT_ANALYTIC) for rate in rates):
        return "the rates are not analytic"
    return ""


def _functions(mode: CriticalMode) -> Callable[..., Any]:
    """Jacobian and parameter derivative as functions of complex states and parameter."""
    assert mode.local is not None
    field = mode.local.field
    names = [real(n) for n in (*field.model.states, field.parameter)]
    values = {n: sp.Float(v, 17) for n, v in field.model.values.items() if n not in names}
    rates = [rate.xreplace(values) for rate in field.rates(0)]
    # plain symbols, as real ones permit simplifications that fail for complex values
    plain = {n: sp.Dummy(n.name) for n in names}
    matrix = sp.Matrix([rate.xreplace(plain) for rate in rates])
    return numpy_function(list(plain.values()), matrix.jacobian(list(plain.values())))


@dataclass(frozen=True, eq=False)
class LevelCurve:
    """Curves of constant Re ψ from the exit to the entry of the same level.

    Parameters
    ----------
    mode : CriticalMode
    slopes : callable
        [F_x F_p] of complex arguments.
    """

    mode: CriticalMode
    slopes: Callable[..., Any]

    def ends(self, level: float) -> tuple[float, float]:
        """Entry and exit of a level on the real axis; nan if there is none."""
        before, behind = self.mode.before, self.mode.behind
        leave = behind.where(level)
        if -before.integral(before.end) < level:
            return math.nan, leave
        low, high = sorted((before.end, before.here))
        fine = 4e-16 * max(abs(low), abs(high))
        return sign_change(lambda p: -before.integral(p) - level, low, high, fine), leave

    def focal(self, level: float) -> bool:
        """Whether the eigenvalue is complex from the entry to the exit of a level."""
        enter, leave = self.ends(level)
        if not (math.isfinite(enter) and math.isfinite(leave)):
            return False
        modes = self.mode.modes(np.linspace(enter, leave, 33))
        return all(mode is not None and mode.value.imag > 0.0 for mode in modes)

    def connects(self, level: float) -> bool:
        """Whether the curve of a level connects its exit with its entry."""
        from scipy.integrate import solve_ivp

        enter, leave = self.ends(level)
        if not (math.isfinite(enter) and math.isfinite(leave)):
            return False
        points = np.linspace(enter, leave, 65)
        modes = self.mode.modes(points)
        turns = np.array([math.nan if m is None else m.value.imag for m in modes])
        fit = chebyshev.Chebyshev.fit(points, turns, 24)
        total = float(fit.integ()(leave) - fit.integ()(enter))
        last = [modes[-1].value if modes[-1] is not None else 1j]
        _, state = self.mode.behind.place(leave)
        n = len(state)

        def flow(_: float, z: Complex) -> Complex:
            table = np.array(self.slopes(*z[1:], z[0]), dtype=complex)
            jacobian, by_parameter = table[:, :n], table[:, n]
            values = np.linalg.eigvals(jacobian)
            last[0] = complex(values[np.argmin(np.abs(values - last[0]))])
            along = -1j * total / last[0]
            return np.r_[along, -np.linalg.solve(jacobian, by_parameter) * along]

        start = np.r_[leave, state].astype(complex)
        with np.errstate(all="ignore"):
            try:
                solved = solve_ivp(flow, (0.0, 1.0), start, rtol=LEVEL_RTOL, atol=1e-10,
                                   max_step=0.05)  # fmt: skip
            except (np.linalg.LinAlgError, ValueError, OverflowError, ZeroDivisionError):
                return False
        reached = complex(solved.y[0, -1])
        return bool(solved.success and abs(reached - enter) <= ARRIVED * abs(leave - enter))
