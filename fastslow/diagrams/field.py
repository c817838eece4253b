"""A frozen model as numbers: rates, Jacobian, interfaces and eigenvalues at points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.continuation.location import REACH, Located, with_condition
from fastslow.continuation.loops import blocks, loop, writeable
from fastslow.continuation.spaces import Curve, Limits, newton_space
from fastslow.errors import ModelError
from fastslow.kernels.field_code import CompiledField, load_field, parameter_array
from fastslow.results.angles import periods_of, principal
from fastslow.results.branch.windows import StateWindow
from fastslow.results.stored.fields import FieldMode, StoredField
from fastslow.results.stored.model import INSTEAD, StoredModel
from fastslow.results.stored.unit_equations import UnitEquations, negligible

if TYPE_CHECKING:
    import sympy as sp

    from fastslow.diagrams.derived_fields import DerivedField
    from fastslow.model.model import Model

Array = NDArray[np.float64]

#: Stands for the varying parameter in a model that has none; no user's symbol has this name.
IDLE = "(none)"

_NONE = np.empty(0)

#: A point belongs to the closure of a region where every switching function is beyond zero by
#: less than this part of its terms: Newton's method leaves some 1e-15, ill conditioned ones 1e-11.
CLOSURE = 1e-9

#: A state below this part of its natural unit may be zero but for rounding.
DOUBTFUL = 1e-8

#: An equation whose terms are all below this part of the largest is empty but for rounding.
EMPTY = 1e-14

#: A tangent's share of the parameter, times the distance from zero in units of the states, below
#: which a segment is vertical to rounding.
VERTICAL = 1e-10

#: Of Newton's method at one point.
ITERATIONS = 40

#: A component of a state below this many times its rounding error counts as zero.
ROUNDING_ERRORS = 100.0


def require_frozen(model: Model | StoredModel, instead: str) -> None:
    """Raise unless a model is frozen; ``instead`` begins what to do with the frozen one."""
    for quantity in (*model.forcing, *model.slow_states):
        raise ModelError(f"'{quantity}' still varies in time; {instead} model.frozen() instead")


@dataclass(frozen=True, eq=False)
class Source:
    """Where a special point comes from: the frozen model, and the units of its states.

    Parameters
    ----------
    model : Model
    unit : ndarray, shape (n,)
    window : StateWindow
        In which its diagram was traced.
    """

    model: Model
    unit: Array
    window: StateWindow


@dataclass(frozen=True, eq=False)
class StoredFrozen:
    """What a stored model says of its frozen rates, with the part of `DerivedField`."""

    model: StoredModel
    varying: tuple[str, ...]

    def __post_init__(self) -> None:
        field = self.model.field
        if field is None or self.varying != (field.parameter,):
            known = f"{field.parameter} alone varies" if field else "no parameter varies"
            raise ModelError(f"in this model {known}: {INSTEAD}")
        for equations, along in zip(field.unit_equations, (False, True), strict=True):
            changed = [n for n in equations.fixed if self._changed(n)]
            gone = {n for n, v in self.model.parameters.items() if negligible(v)}
            if (
                changed
                or set(equations.gone) - {field.parameter} != gone
                or (along and field.parameter in equations.fixed)
            ):
                raise ModelError(f"the units of the states are not known: {INSTEAD}")

    def _changed(self, name: str) -> bool:
        return self.field.values.get(name) != self.model.parameters.get(name)

    @property
    def field(self) -> StoredField:
        field = self.model.field
        assert field is not None
        return field

    @property
    def modes(self) -> tuple[FieldMode, ...]:
        return self.field.modes

    @cached_property
    def compiled(self) -> CompiledField:
        field, n = self.field, len(self.model.states)
        address = load_field([mode.operations for mode in field.modes], n + 1, len(field.names))
        return CompiledField(address, field.names, n, len(field.modes[0].signs))

    def unit_equations(self, values: Mapping[str, float]) -> UnitEquations:
        return self.field.unit_equations[self.field.parameter in values]

    def derivatives(self, region: int) -> tuple[Sequence[tuple[int, ...]], Callable[..., Any]]:
        """Which second and third derivatives there are, and their values; see `DerivedField`."""
        found = self.modes[region].derivatives
        if found is None:
            raise ModelError(f"the normal form of a special point is not known: {INSTEAD}")
        return found.entries, found

    def levels(self) -> dict[str, tuple[str, float]]:
        """Interfaces that are a constant value of one state."""
        return self.field.interface_values(self.model.parameters)

    def path(self) -> dict[str, str]:
        """Of a model frozen along a path, each slow quantity as text."""
        return dict(self.field.path)


@dataclass(frozen=True)
class FrozenField:
    """The frozen rates of every region over (states, varying parameters).

    In a Filippov model the sliding motions along its discontinuities follow the
    regions; "region" and its number then stand for either (see `Mode`).

    Parameters
    ----------
    model : Model or StoredModel
        With a value for every parameter but the one that varies.
    parameter : str
        The one that varies.
    second : str, optional
        One more that varies, along curves in a parameter plane.
    """

    model: Any
    parameter: str
    second: str | None = None

    def __post_init__(self) -> None:
        names = (*self.model.free, *self.model.parameters)
        missing = [n for n in names if n not in (*self.model.parameters, *self.varying)]
        if missing:
            raise ModelError(
                f"the frozen slow quantity '{missing[0]}' has no value; give one, "
                f"as in with_parameters({missing[0]}=…)"
            )
        if isinstance(self.model, StoredModel):
            # what was not stored is said before anything is asked
            object.__setattr__(self, "source", StoredFrozen(self.model, self.varying))

    @property
    def varying(self) -> tuple[str, ...]:
        """The parameters that vary, k of them."""
        return (self.parameter,) if self.second is None else (self.parameter, self.second)

    @cached_property
    def source(self) -> DerivedField | StoredFrozen:
        """Where its numbers come from: the equations, or what was stored of them.

        Raises
        ------
        ModelError
            If what was stored does not hold for this parameter or these values.
        """
        if isinstance(self.model, StoredModel):
            return StoredFrozen(self.model, self.varying)
        from fastslow.diagrams.derived_fields import DerivedField

        return DerivedField(self.model, self.varying)

    @cached_property
    def compiled(self) -> CompiledField:
        return self.source.compiled

    @cached_property
    def values(self) -> Array:
        """The parameter array of the compiled function."""
        return parameter_array(self.model, self.compiled)

    @cached_property
    def modes(self) -> tuple[Any, ...]:
        """Every smooth motion, as `Mode`, or as `FieldMode` of a stored model."""
        return self.source.modes

    @cached_property
    def regions(self) -> tuple[str, ...]:
        """Names of all regions, then of the sliding motions."""
        return tuple(mode.name for mode in self.modes)

    @cached_property
    def interfaces(self) -> tuple[str, ...]:
        return tuple(self.model.interfaces)

    @cached_property
    def signs(self) -> NDArray[np.float64]:
        """Sign of every switching function in every region, shape (regions, m).

        The interfaces come first; a sliding motion is bounded by two more, its drifts.
        """
        rows = [mode.signs for mode in self.modes]
        return np.array(rows, dtype=float).reshape(len(rows), len(rows[0]))

    @cached_property
    def n(self) -> int:
        return len(self.model.states)

    @cached_property
    def units(self) -> Array:
        """Natural units of the states and of the varying parameters, shape (n + k,)."""
        return self.units_at(None)

    def units_at(self, size: float | None) -> Array:
        """The same where the (first) varying parameter is of a given size.

        Rates that are homogeneous leave the size of the states to that of the parameter.
        """
        octave = None if not size else round(math.log2(size))
        if octave not in self._units:
            names = (*self.model.states, *self.varying)
            values = dict(self.model.parameters)
            if octave is not None:
                values[self.parameter] = 2.0**octave
            units = self.source.unit_equations(values).units(names, values)
            self._units[octave] = np.array([units[n] for n in names])
        return self._units[octave]

    @cached_property
    def _units(self) -> dict[int | None, Array]:
        return {}

    def sizes(self, points: Sequence[tuple[int, Array]]) -> Array:
        """Unit of each state by equilibria known, or the natural one where all are zero.

        Parameters
        ----------
        points : sequence of (int, ndarray of shape (n + 1,))
            Regions and points u.
        """
        table = np.abs(np.reshape([u for _, u in points], (-1, self.n + 1)))
        largest = table.max(axis=0, initial=0.0)
        size, natural = largest[:-1], self.units_at(float(largest[-1]))[: self.n]
        doubtful = size <= DOUBTFUL * natural
        if doubtful.any():
            known = self.certain(points).any(axis=0)
            size = np.where(doubtful & ~known, natural, size)
        return size

    @cached_property
    def periods(self) -> Array:
        """The period of every state, 0 where it has none, shape (n,)."""
        return periods_of(self.model.states, self.model.periodic)

    def wrapped(self, state: Array) -> Array:
        """A state with angles in their principal range."""
        if not self.model.periodic:
            return np.array(state, dtype=float)
        return principal(state, self.periods)

    @cached_property
    def _layout(self) -> tuple[int, int, int, int, int, Callable[..., Array]]:
        """Layout of the compiled output, as `evaluate` reads it, and its evaluation at a point."""
        n, m, columns = self.n, self.compiled.m, self.n + self.compiled.k
        first = n + n * columns
        return n, m, columns, first, first + m, loop("value_at")

    def rates(self, region: int) -> list[sp.Expr]:
        """The rates of a region in SymPy, in the order of the states."""
        return list(self.modes[region].rates)

    def evaluate(self, region: int, points: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """F (…, n), [F_x F_p] (…, n, n + k), h (…, m) and ∇h (…, m, n + k) at points u."""
        u = writeable(np.asarray(points, dtype=float))
        n, m, columns, first, second, one = self._layout
        if u.ndim == 1:
            out = np.empty(second + m * columns)
            one(self.compiled.address, region, u, self.values, out)
            return (
                out[:n],
                out[n:first].reshape(n, columns),
                out[first:second],
                out[second:].reshape(m, columns),
            )
        rows = np.atleast_2d(u)
        modes = np.full(len(rows), region, dtype=np.int64)
        out = np.empty((len(rows), self.compiled.size))
        for s in blocks(len(rows), 16 * self.compiled.size):
            loop("evaluate")(self.compiled.address, modes[s], rows[s], self.values, out[s])
        lead = u.shape[:-1]
        return (
            out[:, :n].reshape(*lead, n),
            out[:, n:first].reshape(*lead, n, columns),
            out[:, first:second].reshape(*lead, m),
            out[:, second:].reshape(*lead, m, columns),
        )

    def residual_and_jacobian(self, region: int, u: Array) -> tuple[Array, Array]:
        """F and its Jacobian at one point."""
        value, slopes, _, _ = self.evaluate(region, u)
        return value, slopes

    def eigenvalues(self, region: int, points: ArrayLike) -> NDArray[np.complex128]:
        """Eigenvalues of the state Jacobian at points u, shape (…, n).

        Of a sliding motion those along the interface, and as the last one −∞
        (+∞ where it escapes): the interface is reached (left) in finite time.
        """
        return self.with_infinite(region, self.finite_eigenvalues(region, points))

    def finite_eigenvalues(self, region: int, points: ArrayLike) -> NDArray[np.complex128]:
        """As `eigenvalues` without the infinite one, shape (…, n) or (…, n − 1)."""
        _, slopes, _, gradients = self.evaluate(region, points)
        jacobian, sides = slopes[..., : self.n], self.modes[region].sides
        if sides is not None:
            normal = gradients[..., sides.interface, : self.n, None]
            # the columns of Q after the first span the interface's tangent space
            along = np.linalg.qr(normal, mode="complete")[0][..., 1:]
            # at a two-fold it is 0/0
            with np.errstate(invalid="ignore"):
                jacobian = np.swapaxes(along, -1, -2) @ jacobian @ along
        return self.spectrum(jacobian)

    def survey(
        self, region: int, points: Array, tangents: Array, scale: Array
    ) -> tuple[Array, Array, NDArray[np.complex128]]:
        """How far points are from a fold and a branch point, with signs, and finite eigenvalues.

        The first is the tangent's component along the parameter, 0 on a vertical segment; see
        `branching` for the second.
        """
        turning, branching, jacobians = self._surveyed(region, points, tangents, scale)
        if self.modes[region].sides is not None:
            return turning, branching, self.finite_eigenvalues(region, points)
        return turning, branching, self.spectrum(jacobians)

    def branching(self, region: int, points: Array, tangents: Array, scale: Array) -> Array:
        """How far [F_x F_p; tangent] is from singular, with its determinant's sign, at rows."""
        return self._surveyed(region, points, tangents, scale)[1]

    def _surveyed(
        self, region: int, points: Array, tangents: Array, scale: Array
    ) -> tuple[Array, Array, Array]:
        points = writeable(np.ascontiguousarray(points))
        tangents = writeable(np.ascontiguousarray(tangents))
        count = len(points)
        turning, branching = np.empty(count), np.empty(count)
        jacobians = np.empty((count, self.n, self.n))
        space = newton_space(self.n, self.compiled.size)
        curve = Curve(self.compiled.address, region, self.values)
        for s in blocks(count, 48 * self.compiled.size + 2 * self.n**3):
            loop("survey")(
                curve, points[s], tangents[s], scale, REACH, VERTICAL, branching[s], turning[s],
                jacobians[s], space,
            )  # fmt: skip
        return turning, branching, jacobians

    def with_infinite(self, region: int, finite: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Eigenvalues with the infinite one of a sliding motion."""
        sides = self.modes[region].sides
        if sides is None:
            return finite
        across = np.full((*finite.shape[:-1], 1), np.inf if sides.escaping else -np.inf)
        return np.concatenate([finite, across.astype(complex)], axis=-1)

    @staticmethod
    def spectrum(jacobian: Array) -> NDArray[np.complex128]:
        """Eigenvalues of matrices; NaN where one is not finite, as at a two-fold (0/0)."""
        if jacobian.shape[-1] == 2:
            flat = writeable(np.ascontiguousarray(jacobian).reshape(-1, 2, 2))
            found = np.empty((len(flat), 2), dtype=complex)
            loop("pairs")(flat, found)
            return found.reshape(jacobian.shape[:-1])
        finite = np.asarray(np.isfinite(jacobian).all(axis=(-1, -2)))[..., None]
        if jacobian.shape[-1] < 2:
            # one eigenvalue, or none where a motion slides in all directions
            return np.where(finite, np.diagonal(jacobian, axis1=-2, axis2=-1) + 0j, np.nan)
        n = jacobian.shape[-1]
        flat = np.where(finite[..., None], jacobian, 0.0).reshape(-1, n, n)
        values = np.empty((len(flat), n), dtype=complex)
        # some 25 n**3 products each
        for s in blocks(len(flat), 25 * n**3):
            values[s] = np.linalg.eigvals(flat[s])
        return np.where(finite, values.reshape(jacobian.shape[:-1]), np.nan)

    def refined(
        self,
        region: int,
        start: Array,
        scale: Array,
        *,
        row: int = -1,
        normal: Array | None = None,
        point: Array | None = None,
    ) -> Located:
        """Where the curve F = 0 meets h[row] = 0, or the plane through a point with a normal."""
        normal = writeable(start if normal is None else normal)
        point = writeable(start if point is None else point)
        u = start.copy()
        residual, size, converged = loop("refine")(
            Curve(self.compiled.address, region, self.values), u, scale, row, normal, point,
            self.compiled.m, ITERATIONS, newton_space(self.n, self.compiled.size),
        )  # fmt: skip
        if converged:
            return Located(u, residual, True, _NONE, size)

        def condition(u: Array) -> tuple[float, Array]:
            if row < 0:
                return float((u - point) @ normal), normal
            _, _, h, slopes = self.evaluate(region, u)
            return float(h[row]), slopes[row]

        # least-norm steps where the equations are singular
        return with_condition(
            lambda u: self.residual_and_jacobian(region, u), condition, start, scale
        )

    def solved(
        self, region: int, starts: Array, scales: Array, natural: Array, limits: Limits
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Where Newton's method at a fixed parameter leads, and what plainly is a solution.

        Parameters
        ----------
        region : int
        starts : ndarray, shape (N, n + 1)
            Points u.
        scales : ndarray, shape (N, n + 1)
            Their units.
        natural : ndarray, shape (N, n)
            Natural size of every rate there.
        limits : Limits

        Returns
        -------
        points : ndarray, shape (N, n + 1)
        plain : ndarray of bool, shape (N,)
        """
        points, plain = starts.copy(), np.empty(len(starts), dtype=bool)
        space = newton_space(self.n, self.compiled.size)
        curve = Curve(self.compiled.address, region, self.values)
        for s in blocks(len(starts), ITERATIONS * (16 * self.compiled.size + self.n**3)):
            loop("correct")(
                curve, points[s], scales[s], natural[s], limits, self.compiled.m, ITERATIONS,
                plain[s], space,
            )  # fmt: skip
        return points, plain

    def slides_into(self, region: int, beyond: int, point: Array, unit: Array) -> int | None:
        """The sliding or escaping motion that an equilibrium of a region on an interface enters.

        None where both fields are tangent to it (a two-fold), or nothing slides.
        """
        for number, mode in enumerate(self.modes):
            if mode.sides is None or {mode.sides.above, mode.sides.below} != {region, beyond}:
                continue
            _, _, h, slopes = self.evaluate(number, point)
            size = np.abs(slopes) @ np.maximum(np.abs(point), unit)
            # the drift of the region itself vanishes: the other one decides
            other = -1 if mode.sides.above == region else -2
            if self.signs[number, other] * h[other] > CLOSURE * size[other]:
                return number
        return None

    def virtual(self, region: int, u: Array, unit: Array | None = None) -> bool:
        """Whether a zero of a region's rates lies outside it; of sliding, outside escaping too."""
        sides = self.modes[region].sides
        twins = [region]
        if sides is not None:
            twins.append(region - 1 if sides.escaping else region + 1)
        return not any(self.admissible(k, u, unit) for k in twins)

    def admissible(self, region: int, u: Array, unit: Array | None = None) -> bool:
        """Whether a point lies in the closure of a region.

        ``unit`` of the states and the parameter says what a component that is zero
        but for rounding is compared with; the natural ones where it is not given.
        """
        _, _, h, slopes = self.evaluate(region, u)
        size = np.abs(slopes) @ np.maximum(np.abs(u), self.units if unit is None else unit)
        return bool(np.all(self.signs[region] * h >= -CLOSURE * size))

    def neighbour(self, region: int, interface: int) -> int | None:
        """The region across an interface, and across those that coincide with it, if any.

        None if there is none.
        """
        if self.signs[region, interface] == 0:
            return None
        for crossed in ([interface], self.coinciding[interface]):
            across = self.signs[region].copy()
            across[crossed] *= -1
            found = np.flatnonzero((self.signs == across).all(axis=1))
            if found.size:
                return int(found[0])
        return None

    @cached_property
    def coinciding(self) -> list[list[int]]:
        """For every interface those with its zero set at these parameter values, itself included.

        Told by their ratio at points in general position, as x − D and x + D at D = 0.
        """
        count = len(self.interfaces)
        points = _points(self.n + self.compiled.k) * self.units
        points *= 10.0 ** np.arange(0.0, -24.0, -4.0)[:, None]
        with np.errstate(all="ignore"):
            h = self.evaluate(0, points)[2][:, :count]
        products = h[:, :, None] * h[0][None, None, :]
        crossed = products - products.transpose(0, 2, 1)
        same = (np.abs(crossed) <= 1e-12 * np.abs(products)).all(axis=0)
        return [np.flatnonzero(same[k] | (np.arange(count) == k)).tolist() for k in range(count)]

    def certain(self, points: Sequence[tuple[int, Array]]) -> NDArray[np.bool_]:
        """Which states of equilibria, as `sizes` is given them, are more than rounding."""
        found = np.zeros((len(points), self.n), dtype=bool)
        for region in {region for region, _ in points}:
            rows = [k for k, (number, _) in enumerate(points) if number == region]
            table = np.array([points[k][1] for k in rows])
            found[rows] = np.abs(table[:, : self.n]) > ROUNDING_ERRORS * self._rounding(
                region, table
            )
        return found

    @np.errstate(all="ignore")
    def _rounding(self, region: int, table: Array) -> Array:
        """Bound on the error of each state at equilibria of a region, shape (N, n).

        |J⁻¹| (|F| + ε (|J| |x| + |F_p| |p|)), of what is left and of rounding, in the
        units of the states; infinite where J is singular.
        """
        rates, slopes, _, _ = self.evaluate(region, table)
        rounding = np.finfo(float).eps * (np.abs(slopes) @ np.abs(table)[:, :, None])
        left = np.abs(rates)[:, :, None] + rounding
        try:
            inverses = np.linalg.inv(slopes[:, :, : self.n])
        except np.linalg.LinAlgError:
            if len(table) > 1:
                return np.concatenate([self._rounding(region, row[None]) for row in table])
            return np.full((1, self.n), np.inf)
        return np.asarray((np.abs(inverses) @ left)[:, :, 0])

    def tangent(self, region: int, u: Array, weight: Array) -> tuple[Array, bool]:
        """Null vector of [F_x F_p], unit in the weighted norm, and whether it is the only one."""
        _, slopes, _, _ = self.evaluate(region, u)
        if not np.isfinite(slopes).all():
            return np.zeros(len(u)), False
        scale = 1.0 / np.sqrt(weight)
        matrix = slopes * scale / scale[: self.n, None]
        # equations of different time scales or units are regular together
        sizes = np.abs(matrix).max(axis=1, initial=0.0)
        least = max(EMPTY * sizes.max(initial=0.0), np.finfo(float).tiny)
        _, singular, right = np.linalg.svd(matrix / np.maximum(sizes, least)[:, None])
        return right[-1] * scale, bool(singular[-1] > 1e-9)


@cache
def _points(columns: int) -> Array:
    """Points in general position, shape (6, columns)."""
    return np.random.default_rng(0).normal(size=(6, columns))
