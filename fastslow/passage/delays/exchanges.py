"""Algebraic passage through a transcritical point of a branch that is not invariant."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.points.normal_forms import solve_bordered
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.delays.local_field import LocalField

Array = NDArray[np.float64]

#: Step of differences, relative to the units of the states and the parameter range.
FORM_STEP = 1e-4

#: Start of the passage before the point, in widths √(rate/β): transients decay by e^(−72).
WIDTHS_BEFORE = 12.0

#: End of the passage behind the point, in the same widths.
END = 12.0

#: Relative size of a vanishing quadratic term, as at a pitchfork.
VANISHES = 1e-6

#: Error control.
EXCHANGE_RTOL, ATOL = 1e-11, 1e-13

#: Size of a solution of the scaled normal form that counts as blow-up.
INFINITE = 1e6


@dataclass(frozen=True, eq=False)
class ExchangeForm:
    """Normal form y' = a y² + b y μ + c μ² on the center manifold, y along the critical vector.

    Parameters
    ----------
    a, b, c : float
    """

    a: float
    b: float
    c: float

    def slopes(self) -> tuple[float, float]:
        """Slopes m of the two branches y = m μ."""
        root = math.sqrt(self.b**2 - 4.0 * self.a * self.c)
        return (-self.b - root) / (2.0 * self.a), (-self.b + root) / (2.0 * self.a)

    def growth(self, slope: float) -> float:
        """Derivative by μ of the eigenvalue along a branch."""
        return 2.0 * self.a * slope + self.b


def passage_in_words(mode: CriticalMode, local: LocalField, rate: float) -> str:
    """Describe the passage of a branch point whose branches both depend on the parameter.

    The scaling y = √ε Y, μ = √ε τ removes the rate from the normal form. The solution of
    Y' = a Y² + b Y τ + c τ² that follows the attracting branch tends to the other branch if it
    is on its attracting side at τ = 0, and to infinity otherwise (Krupa and Szmolyan 2001,
    Nonlinearity 14, 1473-1491).
    """
    form = _form(mode, local)
    if form is None:
        return "the passage is algebraic in the rate; no law is implemented at a pitchfork"
    tau = blow_up(form, mode.behind.way)
    if math.isnan(tau):
        return (
            "it passes to the other branch without a delay, at a distance of the order of the "
            "square root of the rate"
        )
    delay = math.sqrt(abs(rate)) * tau
    return (
        "it leaves both branches by a jump, with a delay of the order of the square root of the "
        f"rate ({delay:.3g} in the normal form, without an error bound)"
    )


def _form(mode: CriticalMode, local: LocalField) -> ExchangeForm | None:
    """Quadratic normal form at the point; None at a pitchfork or for sliding motion."""
    region = local.region(str(mode.before.branch.region[mode.before.rows[-1]]))
    if local.field.modes[region].sides is not None:
        return None
    n, unit, u = local.n, mode.unit, local.u
    scale = float(np.ptp(mode.before.diagram.over))

    def slopes(y: Array, mu: float) -> tuple[Array, Array]:
        _, table, _, _ = local.field.evaluate(region, u + np.append(y * unit, mu))
        return table[:, :n] * unit / unit[:, None], table[:, n] / unit

    jacobian, by_parameter = slopes(np.zeros(n), 0.0)
    values, vectors = np.linalg.eig(jacobian)
    k = int(np.argmin(np.abs(values)))
    right = vectors[:, k].real / np.linalg.norm(vectors[:, k].real)
    values, vectors = np.linalg.eig(jacobian.T)
    left = vectors[:, int(np.argmin(np.abs(values)))].real
    left = left / (left @ right)
    # displacement with the parameter transverse to the critical vector
    along = solve_bordered(jacobian, left, right, -by_parameter)

    def derivative(y: Array, mu: float) -> tuple[Array, Array]:
        up, down = slopes(FORM_STEP * y, FORM_STEP * mu), slopes(-FORM_STEP * y, -FORM_STEP * mu)
        return (up[0] - down[0]) / (2 * FORM_STEP), (up[1] - down[1]) / (2 * FORM_STEP)

    by_right, _ = derivative(right, 0.0)
    by_mu, forced = derivative(along * scale, scale)
    a = 0.5 * float(left @ by_right @ right)
    b = float(left @ by_mu @ right) / scale
    c = 0.5 * float(left @ (by_mu @ along + forced)) / scale
    size = np.abs(left) @ np.abs(by_right) @ np.abs(right) + abs(b) * scale
    if abs(a) <= VANISHES * size or b * b - 4.0 * a * c <= 0.0:
        return None
    return ExchangeForm(a, b, c)


def blow_up(form: ExchangeForm, way: int) -> float:
    """τ of the blow-up of the scaled solution; nan if it tends to the other branch."""
    from scipy.integrate import solve_ivp

    # with μ = way |μ| the parameter increases
    form = ExchangeForm(form.a, form.b * way, form.c)
    old, new = sorted(form.slopes(), key=form.growth, reverse=True)
    width = 1.0 / math.sqrt(abs(form.growth(old)))

    def flow(tau: float, y: Array) -> list[float]:
        return [form.a * y[0] ** 2 + form.b * y[0] * tau + form.c * tau**2]

    def blows_up(tau: float, y: Array) -> float:
        return float(INFINITE * (1.0 + abs(old) + abs(new)) * width - abs(y[0]))

    blows_up.terminal = True  # type: ignore[attr-defined]
    begin = -WIDTHS_BEFORE * width
    start = [old * begin + old / (form.growth(old) * begin)]
    found = solve_ivp(
        flow,
        (begin, END * width),
        start,
        method="LSODA",
        rtol=EXCHANGE_RTOL,
        atol=ATOL,
        events=blows_up,
    )
    return float(found.t_events[0][0]) if len(found.t_events[0]) else math.nan
