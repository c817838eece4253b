"""Critical mode of a special point: amplitude and first-order terms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.passage.delays.growth_rates import BranchSide
from fastslow.passage.delays.local_field import LocalField, local_field_at
from fastslow.results.angles import apart, periods_of
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: Relative step of central differences along the branch and along the lag.
MODE_STEP = 1e-4

#: Largest size of a state, in its unit, that is zero along a branch.
ZERO_STATE = 1e-9

#: Gauss points on each side of the point for the first-order terms.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)

#: Bound of the exponent's change where two eigenvalues coalesce: at most ln 2 by Airy's
#: connection formulas, and as much for the excluded interval.
CONNECTION = 2.0 * math.log(2.0)


@dataclass(frozen=True, eq=False)
class EquilibriumMode:
    """Critical mode at one equilibrium, states in their units.

    Parameters
    ----------
    region : str
    state : ndarray, shape (n,)
    jacobian : ndarray, shape (n, n)
    value : complex
        The eigenvalue.
    left, right : ndarray of complex, shape (n,)
        Eigenvectors with left @ right = 1 and a right one of unit length.
    lag : ndarray, shape (n,)
        J⁻¹ dX/dp: the slow manifold is at X + lag p' to first order.
    by_parameter : ndarray, shape (n,)
        Derivative of the rates with respect to the parameter.
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
    """Critical mode along both sides of a special point.

    Parameters
    ----------
    point : SpecialPoint
    local : LocalField or None
        None for a point from a file without a model; modes are then not computed.
    before, behind : BranchSide
    unit : ndarray, shape (n,)
        Units of the states.
    periods : ndarray, shape (n,)
        Periods in the same units, 0 for a state without one.
    """

    point: SpecialPoint
    local: LocalField | None
    before: BranchSide
    behind: BranchSide
    unit: Array
    periods: Array

    def side(self, value: float) -> BranchSide:
        ahead = self.behind.way * (value - self.behind.here) >= 0.0
        return self.behind if ahead else self.before

    def at(self, value: float) -> EquilibriumMode | None:
        """Mode at a value of the parameter; None for sliding or beyond the branch."""
        return self.modes(np.array([value]))[0]

    def modes(self, values: Array) -> list[EquilibriumMode | None]:
        """Modes at values of the parameter, as `at`."""
        found: list[EquilibriumMode | None] = [None] * len(values)
        ahead = self.behind.way * (values - self.behind.here) >= 0.0
        for side, on in ((self.behind, ahead), (self.before, ~ahead)):
            growth = side.rate(values)
            rows = np.flatnonzero(on & np.isfinite(growth))
            if self.local is None or not len(rows):
                continue
            regions, states = side.places(values[rows])
            for row, region, state in zip(rows.tolist(), regions, states, strict=True):
                found[row] = self._mode(str(region), state, float(values[row]), growth[row])
        return found

    def _mode(
        self, region: str, state: Array, value: float, growth: float
    ) -> EquilibriumMode | None:
        """Mode at an equilibrium whose critical eigenvalue has a given real part."""
        assert self.local is not None
        number = self.local.region(region)
        if self.local.field.modes[number].sides is not None:
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
            # a pair that coalesces on the real axis is its own neighbour
            others = np.where(np.abs(values - pair.conjugate()) == 0.0, 2 * abs(pair.imag), others)
        return EquilibriumMode(
            region=region,
            state=state / self.unit,
            jacobian=jacobian,
            value=pair,
            left=left,
            right=right,
            lag=lag,
            by_parameter=by_parameter,
            separation=float(others.min(initial=np.inf)),
        )

    def _slopes(self, region: int, state: Array, value: float) -> tuple[Array, Array]:
        assert self.local is not None
        _, slopes, _, _ = self.local.field.evaluate(region, np.append(state, value))
        n = self.local.n
        return slopes[:, :n] * self.unit / self.unit[:, None], slopes[:, n] / self.unit

    def amplitude(self, state: Array, value: float, rate: float) -> float:
        """|left · (x − slow manifold)| of a state at a value of the drifting parameter."""
        mode = self.at(value)
        if mode is None:
            return math.nan
        away = apart(state / self.unit, mode.state, self.periods) - mode.lag * rate
        return float(abs(mode.left @ away))

    def first_order(self, values: Array, rate: float) -> Array:
        """d/dp of the exponent's first-order terms: λ on the slow manifold, rotation of the mode.

        nan in the interval about a coalescence of eigenvalues where the mode is undefined.
        """
        steps = MODE_STEP * np.array([self.side(v).length for v in values.tolist()])
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
        mode: EquilibriumMode | None,
        before: EquilibriumMode | None,
        after: EquilibriumMode | None,
        rate: float,
    ) -> float:
        """First-order term at one value, from the modes there and one step to both sides."""
        if self.local is None or mode is None or before is None or after is None:
            return math.nan
        change = abs(after.separation**2 - before.separation**2) / (2.0 * step)
        if change * abs(rate) > 2.0 * mode.separation**3:
            return math.nan
        number = self.local.region(mode.region)
        size = float(np.abs(mode.lag).max())
        bent = 0.0
        if size > 0.0:
            # a step on the scale of the states, not of the lag
            reach = MODE_STEP / size
            up, down = (
                self._slopes(number, (mode.state + s * reach * mode.lag) * self.unit, value)[0]
                for s in (1, -1)
            )
            bent = float((mode.left @ (up - down) @ mode.right).real / (2.0 * reach))
        turned = [math.log(abs(mode.left @ other.right)) for other in (before, after)]
        return bent - (turned[1] - turned[0]) / (2.0 * step)

    def exponent_error(self, start: float, stop: float, rate: float) -> float:
        """Error bound of the exponent between two values, to first order.

        The bound is |E| plus a quarter of ∫ |dE|, as the second-order terms do not cancel
        where the first-order terms E may.
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
    """Critical mode of an eigenvalue at a point, along both sides of the branch.

    Parameters
    ----------
    diagram : Diagram
    point : SpecialPoint
    place : (Branch, int)
        Branch and row of the point.
    way : int
        +1 for an increasing parameter.
    critical : complex
    model : Model, optional
        Model of a point that has none.
    """
    branch, row = place
    before, behind = (BranchSide(diagram, branch, row, w, critical) for w in (-way, way))
    local = None
    if point.source is not None or model is not None:
        local = local_field_at(point, diagram.parameter, model)
    rows = [*before.rows, *behind.rows]
    size = np.abs(branch.state[rows]).max(axis=0)
    natural = np.ones_like(size) if local is None else local.unit
    # a state that is zero along the branch up to rounding takes its natural unit
    unit = np.where(size > ZERO_STATE * natural, size, natural)
    unit = np.where(unit > 0, unit, 1.0)
    periods = np.zeros(len(unit))
    if local is not None:
        periods = periods_of(point.states, local.field.model.periodic) / unit
    return CriticalMode(point, local, before, behind, unit, periods)
