"""Numerical evaluation of frozen models: rates, Jacobians, switching functions, eigenvalues."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.continuation.location import SLOPE_OFFSET, Located, with_condition
from fastslow.continuation.loops import blocks, loop, writeable
from fastslow.continuation.spaces import CompiledCurve, Condition, Limits, RowTests, newton_space
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
    from fastslow.diagrams.modes import Sides
    from fastslow.model.model import Model

Array = NDArray[np.float64]

#: Placeholder for the varying parameter of a model without one; not a valid symbol name.
IDLE = "(none)"

_NONE = np.empty(0)

#: A point is in the closure of a region if no switching function has the wrong sign by more than
#: this fraction of its terms: Newton's method leaves some 1e-15, in ill-conditioned cases 1e-11.
CLOSURE = 1e-9

#: A state below this fraction of its natural unit may be zero to rounding.
DOUBTFUL = 1e-8

#: An equation whose terms are all below this fraction of the largest is empty to rounding.
EMPTY = 1e-14

#: Parameter component of a tangent, times the distance from zero in units of the states, below
#: which a segment is vertical to rounding.
VERTICAL = 1e-10

#: Iterations of Newton's method at one point.
NEWTON_ITERATIONS = 40

#: A component of a state below this multiple of its rounding error is zero.
ROUNDING_ERRORS = 100.0

#: Relative change of a state that rates must resolve.
RESOLVED_CHANGE = 0.1


def require_frozen(model: Model | StoredModel, action: str) -> None:
    """Raise ModelError unless a model is frozen; ``action`` is what to do with the frozen model."""
    full = f", or model.frozen(fast={list(model.slow_states)}) for the equilibria of the full model"
    for quantity in (*model.forcing, *model.slow_states):
        raise ModelError(
            f"'{quantity}' still varies in time; {action} model.frozen() instead"
            f"{'' if model.forcing else full}"
        )
    if model.period() is not None:
        raise ModelError(
            "the rates or resets depend on time explicitly, so that the model has no equilibria; "
            "find_orbit computes its periodic orbits"
        )


@dataclass(frozen=True, eq=False)
class Source:
    """Origin of a special point: its frozen model, units of the states, and window.

    Parameters
    ----------
    model : Model
    unit : ndarray, shape (n,)
    window : StateWindow
        Window in which its diagram was traced.
    """

    model: Model
    unit: Array
    window: StateWindow


@dataclass(frozen=True, eq=False)
class StoredFrozen:
    """The frozen rates of a stored model, with the interface of `DerivedField`."""

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
        """Return indices and function of second and third derivatives; see `DerivedField`."""
        found = self.modes[region].derivatives
        if found is None:
            raise ModelError(f"the normal form of a special point is not known: {INSTEAD}")
        return found.entries, found

    @property
    def walls(self) -> tuple[str, ...]:
        """The walls of resets, as equations."""
        return tuple(self.field.walls)

    def levels(self) -> dict[str, tuple[str, float] | tuple[str, float, int]]:
        """Return the interfaces at a constant value of one state."""
        return self.field.interface_values(self.model.parameters)

    def path(self) -> dict[str, str]:
        """Return each slow quantity as text, for a model frozen along a path."""
        return dict(self.field.path)


@dataclass(frozen=True)
class FrozenField:
    """The frozen rates of every region over (states, varying parameters).

    In a Filippov model the sliding motions along its discontinuities are numbered after the
    regions, and motions held against the walls of resets after these; "region" and its number
    then denote any of them (see `Mode`).

    Parameters
    ----------
    model : Model or StoredModel
        Model with values of all parameters except the varying ones.
    parameter : str
        The varying parameter.
    second : str, optional
        Second varying parameter, for curves in a parameter plane.
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
            # missing data raise at once
            object.__setattr__(self, "source", StoredFrozen(self.model, self.varying))

    @property
    def varying(self) -> tuple[str, ...]:
        """The varying parameters, k of them."""
        return (self.parameter,) if self.second is None else (self.parameter, self.second)

    @cached_property
    def source(self) -> DerivedField | StoredFrozen:
        """The source of its functions: the equations, or stored data.

        Raises
        ------
        ModelError
            If the stored data are not valid for this parameter or these values.
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
        return parameter_array(self.model, self.compiled.parameters)

    @cached_property
    def modes(self) -> tuple[Any, ...]:
        """Every smooth motion, as `Mode`, or for a stored model as `FieldMode`."""
        return self.source.modes

    @cached_property
    def regions(self) -> tuple[str, ...]:
        """Names of all regions, then of the sliding motions."""
        return tuple(mode.name for mode in self.modes)

    @cached_property
    def interfaces(self) -> tuple[str, ...]:
        """Names of the interfaces, then of the walls of resets."""
        return (*self.model.interfaces, *self.source.walls)

    def sides(self, region: int) -> Sides:
        """Return the regions on both sides of a sliding motion."""
        found: Sides | None = self.modes[region].sides
        assert found is not None
        return found

    def is_wall(self, interface: int) -> bool:
        """Return whether the number of an interface is that of a wall."""
        return interface >= len(self.model.interfaces)

    def surface(self, interface: int) -> str:
        """Return the equation of an interface or a wall."""
        name = self.interfaces[interface]
        return name if self.is_wall(interface) else f"{name} = 0"

    def continuous(self, interface: str) -> bool:
        """Return whether the rates are continuous across an interface; they are at a wall."""
        return interface not in self.model.interfaces or self.model.continuous[interface]

    @cached_property
    def signs(self) -> NDArray[np.float64]:
        """Sign of every switching function in every region, shape (regions, m).

        The interfaces come first, then walls; see `Mode` for the others.
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
        """Return `units` for a given size of the (first) varying parameter.

        For homogeneous rates the size of the states depends on that of the parameter.
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
        """Return the unit of each state given equilibria; the natural unit if all are zero.

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
        """Return a state with angles in their principal range."""
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
        """Return the symbolic rates of a region, in the order of the states."""
        return list(self.modes[region].rates)

    def evaluate(
        self, region: int | NDArray[np.int64], points: ArrayLike
    ) -> tuple[Array, Array, Array, Array]:
        """Evaluate F (…, n), [F_x F_p] (…, n, n + k), h (…, m) and ∇h (…, m, n + k) at points u.

        The region may be one for each row of a matrix of points.
        """
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
        out = self._outputs(np.full(len(rows), region, dtype=np.int64), rows)
        lead = u.shape[:-1]
        return (
            out[:, :n].reshape(*lead, n),
            out[:, n:first].reshape(*lead, n, columns),
            out[:, first:second].reshape(*lead, m),
            out[:, second:].reshape(*lead, m, columns),
        )

    def _outputs(self, regions: NDArray[np.int64], rows: Array) -> Array:
        """Return the compiled outputs at points u, each in its region."""
        out = np.empty((len(rows), self.compiled.size))
        for s in blocks(len(rows), 16 * self.compiled.size):
            loop("evaluate")(self.compiled.address, regions[s], rows[s], self.values, out[s])
        return out

    def evaluate_each(self, regions: NDArray[np.int64], points: Array) -> tuple[Array, Array]:
        """Evaluate F (N, n) and [F_x F_p] (N, n, n + k) at points u (N, n + k) in regions (N,)."""
        n, _, columns, first, *_ = self._layout
        out = self._outputs(regions, writeable(points))
        return out[:, :n], out[:, n:first].reshape(-1, n, columns)

    def residual_and_jacobian(self, region: int, u: Array) -> tuple[Array, Array]:
        """Evaluate F and [F_x F_p] at one point."""
        value, slopes, _, _ = self.evaluate(region, u)
        return value, slopes

    def eigenvalues(self, region: int, points: ArrayLike) -> NDArray[np.complex128]:
        """Eigenvalues of the state Jacobian at points u, shape (…, n).

        For a sliding motion those along the interface, followed by −∞ (+∞ for escaping): the
        interface is reached (left) in finite time. Held against walls, those of the constrained
        motion, followed by −∞ twice for every wall: after a completed sequence of impacts two
        multipliers are zero (Nordmark and Piiroinen 2009).
        """
        return self.with_infinite(region, self.finite_eigenvalues(region, points))

    def finite_eigenvalues(self, region: int, points: ArrayLike) -> NDArray[np.complex128]:
        """Eigenvalues without infinite ones, shape (…, n − number of constraints)."""
        _, slopes, _, gradients = self.evaluate(region, points)
        jacobian, fixed = slopes[..., : self.n], self.constraints(region)
        if fixed:
            normals = np.swapaxes(gradients[..., fixed, : self.n], -1, -2)
            # the other columns of Q span the tangent space of the constraints
            along = np.linalg.qr(normals, mode="complete")[0][..., len(fixed) :]
            # 0/0 at a two-fold
            with np.errstate(invalid="ignore"):
                jacobian = np.swapaxes(along, -1, -2) @ jacobian @ along
        return self.spectrum(jacobian)

    def survey(
        self, region: int, points: Array, tangents: Array, scale: Array
    ) -> tuple[Array, Array, NDArray[np.complex128]]:
        """Return signed test functions of folds and branch points, and the finite eigenvalues.

        The first is the parameter component of the tangent, 0 on a vertical segment; see
        `branching` for the second.
        """
        turning, branching, jacobians = self._surveyed(region, points, tangents, scale)
        if self.constraints(region):
            return turning, branching, self.finite_eigenvalues(region, points)
        return turning, branching, self.spectrum(jacobians)

    def branching(self, region: int, points: Array, tangents: Array, scale: Array) -> Array:
        """Distance of [F_x F_p; tangent] from singularity, with the sign of its determinant."""
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
        curve = CompiledCurve(self.compiled.address, region, self.values)
        for s in blocks(count, 48 * self.compiled.size + 2 * self.n**3):
            loop("survey")(
                curve, points[s], tangents[s], scale, SLOPE_OFFSET, VERTICAL,
                RowTests(branching[s], turning[s], jacobians[s]), space,
            )  # fmt: skip
        return turning, branching, jacobians

    def with_infinite(self, region: int, finite: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Append the infinite eigenvalues of a sliding or held motion."""
        sides, fixed = self.modes[region].sides, self.constraints(region)
        if not fixed:
            return finite
        escaping = sides is not None and sides.escaping
        across = np.full((*finite.shape[:-1], len(fixed)), np.inf if escaping else -np.inf)
        return np.concatenate([finite, across.astype(complex)], axis=-1)

    @staticmethod
    def spectrum(jacobian: Array) -> NDArray[np.complex128]:
        """Eigenvalues of matrices; NaN if a matrix is not finite, as at a two-fold (0/0)."""
        if jacobian.shape[-1] == 2:
            flat = writeable(np.ascontiguousarray(jacobian).reshape(-1, 2, 2))
            found = np.empty((len(flat), 2), dtype=complex)
            loop("eigenvalues_of_2x2")(flat, found)
            return found.reshape(jacobian.shape[:-1])
        finite = np.asarray(np.isfinite(jacobian).all(axis=(-1, -2)))[..., None]
        if jacobian.shape[-1] < 2:
            # one eigenvalue, or none for sliding in all directions
            return np.where(finite, np.diagonal(jacobian, axis1=-2, axis2=-1) + 0j, np.nan)
        n = jacobian.shape[-1]
        flat = np.where(finite[..., None], jacobian, 0.0).reshape(-1, n, n)
        values = np.empty((len(flat), n), dtype=complex)
        # about 25 n**3 products each
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
        """Solve F = 0 with h[row] = 0, or with the plane through a point with a normal."""
        normal = writeable(start if normal is None else normal)
        point = writeable(start if point is None else point)
        u = start.copy()
        residual, size, converged = loop("refine")(
            CompiledCurve(self.compiled.address, region, self.values), u, scale,
            Condition(row, normal, point, self.compiled.m), NEWTON_ITERATIONS,
            newton_space(self.n, self.compiled.size),
        )  # fmt: skip
        if converged:
            return Located(u, residual, True, _NONE, size)

        def condition(u: Array) -> tuple[float, Array]:
            if row < 0:
                return float((u - point) @ normal), normal
            _, _, h, slopes = self.evaluate(region, u)
            return float(h[row]), slopes[row]

        # least-norm steps if the equations are singular
        return with_condition(
            lambda u: self.residual_and_jacobian(region, u), condition, start, scale
        )

    def solved(
        self, region: int, starts: Array, scales: Array, natural: Array, limits: Limits
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Apply Newton's method at a fixed parameter, with a test of clear convergence.

        Parameters
        ----------
        region : int
        starts : ndarray, shape (N, n + 1)
            Starting points u.
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
        curve = CompiledCurve(self.compiled.address, region, self.values)
        for s in blocks(len(starts), NEWTON_ITERATIONS * (16 * self.compiled.size + self.n**3)):
            loop("correct")(
                curve, points[s], scales[s], natural[s], limits, NEWTON_ITERATIONS, plain[s], space
            )
        return points, plain

    def constraints(self, region: int) -> list[int]:
        """Return the rows that are zero in a motion: sliding h, held h and h' of every wall."""
        mode = self.modes[region]
        if mode.sides is not None:
            return [mode.sides.interface]
        count, rows = len(mode.held), self.compiled.m
        return [*mode.held, *range(rows - 2 * count, rows - count)]

    def contact_rows(self, region: int) -> list[int]:
        """Return the rows of the contact forces of a held motion, wall by wall."""
        held = self.modes[region].held
        return list(range(self.compiled.m - len(held), self.compiled.m))

    def contact_forces(self, region: int, u: Array) -> dict[str, float]:
        """Return the contact force of every wall against which a point is held."""
        held = self.modes[region].held
        if not held:
            return {}
        forces = self.evaluate(region, u)[2][self.contact_rows(region)]
        return {self.interfaces[k]: float(f) for k, f in zip(held, forces, strict=True)}

    def surface_of(self, region: int, row: int) -> int:
        """Return the interface or wall of a row; for a drift the one of the sliding motion."""
        mode = self.modes[region]
        if row < len(self.interfaces):
            return row
        if mode.sides is not None:
            return int(mode.sides.interface)
        return int(mode.held[self.contact_rows(region).index(row)])

    def bound_at(self, region: int, wall: int) -> int:
        """Return the row that bounds a motion at a wall: h, or held against it the force."""
        held = self.modes[region].held
        return self.contact_rows(region)[held.index(wall)] if wall in held else wall

    def slides_into(self, region: int, beyond: int, point: Array, unit: Array) -> int | None:
        """Return the sliding or escaping motion that an equilibrium on an interface enters.

        None if both fields are tangent to the interface (a two-fold), or without sliding.
        """
        for number, mode in enumerate(self.modes):
            if mode.sides is None or {mode.sides.above, mode.sides.below} != {region, beyond}:
                continue
            _, _, h, slopes = self.evaluate(number, point)
            size = np.abs(slopes) @ np.maximum(np.abs(point), unit)
            # the drift of the region itself vanishes: the sign of the other one decides
            other = -1 if mode.sides.above == region else -2
            if self.signs[number, other] * h[other] > CLOSURE * size[other]:
                return number
        return None

    def virtual(self, region: int, u: Array, unit: Array | None = None) -> bool:
        """Return whether a zero of the rates is outside its region (for sliding, escaping too)."""
        sides = self.modes[region].sides
        twins = [region]
        if sides is not None:
            twins.append(region - 1 if sides.escaping else region + 1)
        return not any(self.admissible(k, u, unit) for k in twins)

    def admissible(self, region: int, u: Array, unit: Array | None = None) -> bool:
        """Return whether a point is in the closure of a region.

        ``unit`` of the states and the parameter is the scale of rounding errors; by default
        the natural units.
        """
        _, _, h, slopes = self.evaluate(region, u)
        size = np.abs(slopes) @ np.maximum(np.abs(u), self.units if unit is None else unit)
        return bool(np.all(self.signs[region] * h >= -CLOSURE * size))

    def neighbour(self, region: int, interface: int) -> int | None:
        """Return the region across an interface and across those that coincide with it.

        At a wall the motion that is held against it, or no longer. None if there is no such
        region.
        """
        if self.is_wall(interface):
            return self._held_or_free(region, interface)
        if self.signs[region, interface] == 0:
            return None
        for crossed in ([interface], self.coinciding[interface]):
            across = self.signs[region].copy()
            across[crossed] *= -1
            found = np.flatnonzero((self.signs == across).all(axis=1))
            if found.size:
                return int(found[0])
        return None

    def _held_or_free(self, region: int, wall: int) -> int | None:
        """Return the motion that differs in whether it is held against a wall."""
        count, held = len(self.model.interfaces), {*self.modes[region].held} ^ {wall}
        signs = self.signs[region, :count]
        for number, mode in enumerate(self.modes):
            if mode.sides is None and {*mode.held} == held:
                # in contact some interfaces do not bound the motion
                other = self.signs[number, :count]
                if np.all((signs == other) | (signs * other == 0)):
                    return number
        return None

    @cached_property
    def coinciding(self) -> list[list[int]]:
        """Return for every interface those with the same zero set, itself included.

        For example x − D and x + D at D = 0; compared at points in general position.
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
        """Return which states of equilibria exceed rounding errors; argument as for `sizes`."""
        found = np.zeros((len(points), self.n), dtype=bool)
        for region in {region for region, _ in points}:
            rows = [k for k, (number, _) in enumerate(points) if number == region]
            table = np.array([points[k][1] for k in rows])
            found[rows] = np.abs(table[:, : self.n]) > ROUNDING_ERRORS * self._rounding(
                region, table
            )
            found[rows] &= ~self._unresolved(region, table, found[rows])
        return found

    @np.errstate(all="ignore")
    def _unresolved(self, region: int, table: Array, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return which of the states asked for, shape (N, n), the computed rates do not determine.

        Terms of a rate may cancel that are larger than its slopes show, as in exp(x) − 1: near
        zero it does not change with x as its slope says. States below `DOUBTFUL` of their
        natural unit are examined, with those that depend on them.
        """
        states, found = table[:, : self.n], np.zeros_like(asked)
        units = np.array([self.units_at(abs(value))[: self.n] for value in table[:, -1].tolist()])
        tiny = asked & (np.abs(states) <= DOUBTFUL * units)
        if not tiny.any():
            return found
        rows, columns = np.nonzero(tiny)
        moves = np.zeros((len(rows), self.n + 1))
        moves[np.arange(len(rows)), columns] = RESOLVED_CHANGE * states[rows, columns]
        _, slopes, _, _ = self.evaluate(region, table[rows])
        ahead, back = (self.evaluate(region, table[rows] + s * moves)[0] for s in (1, -1))
        changes = 0.5 * (ahead - back) - (slopes @ moves[:, :, None])[:, :, 0]
        inverses = np.abs(np.linalg.inv(slopes[:, :, : self.n]))
        errors = (inverses @ np.abs(changes)[:, :, None])[:, :, 0] / RESOLVED_CHANGE
        np.logical_or.at(found, rows, ~(2.0 * errors < np.abs(states[rows])))
        return found & tiny

    @np.errstate(all="ignore")
    def _rounding(self, region: int, table: Array) -> Array:
        """Bound on the error of each state at equilibria of a region, shape (N, n).

        |J⁻¹| (|F| + ε (|J| |x| + |F_p| |p|)), due to the residual and to rounding, in the
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
        """Null vector of [F_x F_p], of unit weighted norm, and whether it is unique."""
        _, slopes, _, _ = self.evaluate(region, u)
        if not np.isfinite(slopes).all():
            return np.zeros(len(u)), False
        scale = 1.0 / np.sqrt(weight)
        matrix = slopes * scale / scale[: self.n, None]
        # rows are scaled, since time scales and units of the equations differ
        sizes = np.abs(matrix).max(axis=1, initial=0.0)
        least = max(EMPTY * sizes.max(initial=0.0), np.finfo(float).tiny)
        _, singular, right = np.linalg.svd(matrix / np.maximum(sizes, least)[:, None])
        return right[-1] * scale, bool(singular[-1] > 1e-9)


@cache
def _points(columns: int) -> Array:
    """Return points in general position, shape (6, columns)."""
    return np.random.default_rng(0).normal(size=(6, columns))
