"""The mode that becomes unstable at a special point: its amplitude, and what is of first order."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.passage.delays.growth_rates import Sheet
from fastslow.passage.delays.local_field import Site, site_of
from fastslow.results.angles import apart, periods_of
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Step of differences along the branch and along the lag, relative: the error is its square.
STEP = 1e-4

#: A state is zero along a branch that stays below this part of its unit.
ZERO = 1e-9

#: Gauss points on each side of the point for the terms of first order.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)

#: The change of amplitude where two eigenvalues meet, as an exponent: Airy's connection formulas
#: give at most ln 2, and as much for the width that is left out.
CONNECTION = 2.0 * math.log(2.0)


@dataclass(frozen=True, eq=False)
class Mode:
    """The critical mode at one equilibrium, states in their units.

    Parameters
    ----------
    region : str
    state : ndarray, shape (n,)
    jacobian : ndarray, shape (n, n)
    value : complex
        The eigenvalue.
    left, right : ndarray of complex, shape (n,)
        Eigenvectors with left @ right = 1, the right one of length one.
    lag : ndarray, shape (n,)
        J⁻¹ dX/dp: the slow manifold is at X + lag p' to first order.
    by_parameter : ndarray, shape (n,)
        Derivative of the rates by the parameter.
    separation : float
        Distance to the nearest eigenvalue that is not its conjugate.
    """

    region: str
    state: Array
    jacobian: Array
    value: complex
    left: NDArray[np.complex128]
    right: NDArray[np.complex128]
    lag: Array
    by_parameter: Array
    separation: float


@dataclass(frozen=True, eq=False)
class CriticalMode:
    """The critical mode along both sides of a special point.

    Parameters
    ----------
    point : SpecialPoint
    site : Site or None
        None for a point of a file, without a model; no mode is then computed.
    before, behind : Sheet
    unit : ndarray, shape (n,)
        Of the states.
    periods : ndarray, shape (n,)
        In the same units, 0 where a state has none.
    """

    point: SpecialPoint
    site: Site | None
    before: Sheet
    behind: Sheet
    unit: Array
    periods: Array

    def side(self, value: float) -> Sheet:
        ahead = self.behind.way * (value - self.behind.here) >= 0.0
        return self.behind if ahead else self.before

    def at(self, value: float) -> Mode | None:
        """The mode at a value of the parameter; None of a sliding motion or where it is not."""
        return self.modes(np.array([value]))[0]

    def modes(self, values: Array) -> list[Mode | None]:
        """The modes at values of the parameter, as `at`."""
        found: list[Mode | None] = [None] * len(values)
        ahead = self.behind.way * (values - self.behind.here) >= 0.0
        for sheet, on in ((self.behind, ahead), (self.before, ~ahead)):
            growth = sheet.rate(values)
            rows = np.flatnonzero(on & np.isfinite(growth))
            if self.site is None or not len(rows):
                continue
            regions, states = sheet.places(values[rows])
            for row, region, state in zip(rows.tolist(), regions, states, strict=True):
                found[row] = self._mode(str(region), state, float(values[row]), growth[row])
        return found

    def _mode(self, region: str, state: Array, value: float, growth: float) -> Mode | None:
        """The mode at an equilibrium whose critical eigenvalue has this real part."""
        assert self.site is not None
        number = self.site.region(region)
        if self.site.field.modes[number].sides is not None:
            return None
        jacobian, by_parameter = self._slopes(number, state, value)
        values, vectors = np.linalg.eig(jacobian)
        chosen = int(np.argmin(np.abs(values.real - growth) + np.where(values.imag < 0, 1e300, 0)))
        right = vectors[:, chosen] / np.linalg.norm(vectors[:, chosen])
        try:
            left = np.linalg.inv(vectors)[chosen] * np.linalg.norm(vectors[:, chosen])
            lag = np.linalg.solve(jacobian, -np.linalg.solve(jacobian, by_parameter))
        except np.linalg.LinAlgError:
            return None
        pair = complex(values[chosen])
        others = np.abs(values - pair)
        others[chosen] = np.inf
        if abs(pair.imag) > 0.0:
            # a pair that meets on the real axis is its own neighbour
            others = np.where(np.abs(values - pair.conjugate()) == 0.0, 2 * abs(pair.imag), others)
        return Mode(
            region, state / self.unit, jacobian, pair, left, right, lag, by_parameter,
            float(others.min(initial=np.inf)),
        )  # fmt: skip

    def _slopes(self, region: int, state: Array, value: float) -> tuple[Array, Array]:
        assert self.site is not None
        _, slopes, _, _ = self.site.field.evaluate(region, np.append(state, value))
        n = self.site.n
        return slopes[:, :n] * self.unit / self.unit[:, None], slopes[:, n] / self.unit

    def amplitude(self, state: Array, value: float, rate: float) -> float:
        """|left · (x − slow manifold)| of a state at a value of the parameter that drifts."""
        mode = self.at(value)
        if mode is None:
            return math.nan
        away = apart(state / self.unit, mode.state, self.periods) - mode.lag * rate
        return float(abs(mode.left @ away))

    def first_order(self, values: Array, rate: float) -> Array:
        """d/dp of the exponent's first-order terms: λ on the slow manifold, and the turning vector.

        nan within the width about a meeting of eigenvalues in which their mode is not defined.
        """
        steps = STEP * np.array([self.side(v).length for v in values.tolist()])
        modes = self.modes(np.concatenate([values, values - steps, values + steps]))
        count = len(values)
        return np.array(
            [
                self._first_order(
                    value, step, modes[k], modes[count + k], modes[2 * count + k], rate
                )
                for k, (value, step) in enumerate(zip(values, steps, strict=True))
            ]
        )

    def _first_order(
        self,
        value: float,
        step: float,
        mode: Mode | None,
        before: Mode | None,
        after: Mode | None,
        rate: float,
    ) -> float:
        """At one value, with the modes there and a step to both sides."""
        if self.site is None or mode is None or before is None or after is None:
            return math.nan
        change = abs(after.separation**2 - before.separation**2) / (2.0 * step)
        if change * abs(rate) > 2.0 * mode.separation**3:
            return math.nan
        number = self.site.region(mode.region)
        size = float(np.abs(mode.lag).max())
        bent = 0.0
        if size > 0.0:
            # as far as the states' own scale, not as far as they lag
            reach = STEP / size
            up, down = (
                self._slopes(number, (mode.state + s * reach * mode.lag) * self.unit, value)[0]
                for s in (1, -1)
            )
            bent = float((mode.left @ (up - down) @ mode.right).real / (2.0 * reach))
        turned = [math.log(abs(mode.left @ other.right)) for other in (before, after)]
        return bent - (turned[1] - turned[0]) / (2.0 * step)

    def exponent_error(self, start: float, stop: float, rate: float) -> float:
        """How much the exponent from one value to another may be off, to first order.

        Of what adds up to E along the way, a quarter of ∫ |dE| is allowed beside |E|: the
        terms of second order do not cancel as those of first order may.
        """
        here = self.behind.here
        halves = np.array([0.5 * (here - start), 0.5 * (stop - here)])[:, None]
        nodes = np.array([[start], [here]]) + halves * (1.0 + NODES)
        terms = (halves * WEIGHTS).ravel() * self.first_order(nodes.ravel(), rate)
        lost = bool(np.isnan(terms).any())
        total, size = float(np.nansum(terms)), float(np.nansum(np.abs(terms)))
        return abs(total) + 0.25 * size + (CONNECTION if lost else 0.0)


def critical_mode(
    diagram: Diagram,
    point: SpecialPoint,
    place: tuple[Branch, int],
    way: int,
    critical: complex,
    *,
    model: Model | None = None,
) -> CriticalMode:
    """The mode of an eigenvalue at a point, on both sides of it.

    Parameters
    ----------
    diagram : Diagram
    point : SpecialPoint
    place : (Branch, int)
        The branch and the row of the point.
    way : int
        +1 where the parameter rises.
    critical : complex
    model : Model, optional
        Of a point that carries none.
    """
    branch, row = place
    before, behind = (Sheet(diagram, branch, row, w, critical) for w in (-way, way))
    site = None
    if point.source is not None or model is not None:
        site = site_of(point, diagram.parameter, model)
    rows = [*before.rows, *behind.rows]
    size = np.abs(branch.state[rows]).max(axis=0)
    natural = np.ones_like(size) if site is None else site.unit
    # a state that is zero along the branch but for rounding has no size there
    unit = np.where(size > ZERO * natural, size, natural)
    unit = np.where(unit > 0, unit, 1.0)
    periods = np.zeros(len(unit))
    if site is not None:
        periods = periods_of(point.states, site.field.model.periodic) / unit
    return CriticalMode(point, site, before, behind, unit, periods)
