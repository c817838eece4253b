"""A frozen model as numbers: rates, Jacobian, interfaces and eigenvalues at points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from fastslow.compiled.fields import CompiledField, compile_field, parameter_array
from fastslow.continuation.loops import loop
from fastslow.diagrams.modes import Mode, modes_of
from fastslow.errors import ModelError
from fastslow.model.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrozenField:
    """The frozen rates of every region over (states, varying parameters).

    In a Filippov model the sliding motions along its discontinuities follow the
    regions; "region" and its number then stand for either (see `Mode`).

    Parameters
    ----------
    model : Model
        With a value for every parameter but the one that varies.
    parameter : str
        The one that varies.
    second : str, optional
        One more that varies, along curves in a parameter plane.
    """

    model: Model
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

    @property
    def varying(self) -> tuple[str, ...]:
        """The parameters that vary, k of them."""
        return (self.parameter,) if self.second is None else (self.parameter, self.second)

    @cached_property
    def compiled(self) -> CompiledField:
        modes = [(mode.rates, mode.rows) for mode in self.modes]
        return compile_field(self.model, *self.varying, modes=modes)

    @cached_property
    def values(self) -> Array:
        """The parameter array of the compiled function."""
        return parameter_array(self.model, self.compiled)

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        return modes_of(self.model)

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

    @property
    def n(self) -> int:
        return len(self.model.states)

    def rates(self, region: int) -> list[sp.Expr]:
        """The rates of a region in SymPy, in the order of the states."""
        return list(self.modes[region].rates)

    def at(self, region: int, points: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """F (…, n), [F_x F_p] (…, n, n + k), h (…, m) and ∇h (…, m, n + k) at points u."""
        u = np.asarray(points, dtype=float)
        rows = np.atleast_2d(u)
        modes = np.full(len(rows), region, dtype=np.int64)
        out = loop("evaluate")(self.compiled.address, modes, rows, self.values, self.compiled.size)
        n, m, columns = self.n, self.compiled.m, self.n + self.compiled.k
        parts = np.split(out, np.cumsum([n, n * columns, m]), axis=1)
        lead = u.shape[:-1]
        return (
            parts[0].reshape(*lead, n),
            parts[1].reshape(*lead, n, columns),
            parts[2].reshape(*lead, m),
            parts[3].reshape(*lead, m, columns),
        )

    def curve(self, region: int, u: Array) -> tuple[Array, Array]:
        """F and its Jacobian at one point."""
        value, slopes, _, _ = self.at(region, u)
        return value, slopes

    def eigenvalues(self, region: int, points: ArrayLike) -> NDArray[np.complex128]:
        """Eigenvalues of the state Jacobian at points u, shape (…, n).

        Of a sliding motion those along the interface, and as the last one −∞
        (+∞ where it escapes): the interface is reached (left) in finite time.
        """
        finite = self.finite_eigenvalues(region, points)
        sides = self.modes[region].sides
        if sides is None:
            return finite
        across = np.full((*finite.shape[:-1], 1), np.inf if sides.escaping else -np.inf)
        return np.concatenate([finite, across.astype(complex)], axis=-1)

    def finite_eigenvalues(self, region: int, points: ArrayLike) -> NDArray[np.complex128]:
        """As `eigenvalues` without the infinite one, shape (…, n) or (…, n − 1)."""
        _, slopes, _, gradients = self.at(region, points)
        jacobian, sides = slopes[..., : self.n], self.modes[region].sides
        # at a two-fold the sliding field is 0/0
        finite = np.asarray(np.isfinite(jacobian).all(axis=(-1, -2)))[..., None]
        jacobian = np.where(finite[..., None], jacobian, 0.0)
        if sides is not None:
            normal = gradients[..., sides.interface, : self.n, None]
            # the columns of Q after the first span the interface's tangent space
            along = np.linalg.qr(normal, mode="complete")[0][..., 1:]
            jacobian = np.swapaxes(along, -1, -2) @ jacobian @ along
        return np.where(finite, np.linalg.eigvals(jacobian).astype(complex), np.nan)

    def slides_into(self, region: int, beyond: int, point: Array) -> int | None:
        """The sliding or escaping motion that an equilibrium of a region on an interface enters.

        None where both fields are tangent to it (a two-fold), or nothing slides.
        """
        for number, mode in enumerate(self.modes):
            if mode.sides is None or {mode.sides.above, mode.sides.below} != {region, beyond}:
                continue
            _, _, h, slopes = self.at(number, point)
            size = np.abs(slopes) @ np.maximum(np.abs(point), 1.0)
            # the drift of the region itself vanishes: the other one decides
            other = -1 if mode.sides.above == region else -2
            if self.signs[number, other] * h[other] > 1e-9 * max(size[other], 1e-300):
                return number
        return None

    def virtual(self, region: int, u: Array) -> bool:
        """Whether a zero of a region's rates lies outside it; of sliding, outside escaping too."""
        sides = self.modes[region].sides
        twins = [region]
        if sides is not None:
            twins.append(region - 1 if sides.escaping else region + 1)
        return not any(self.admissible(k, u) for k in twins)

    def admissible(self, region: int, u: Array, tolerance: float = 1e-9) -> bool:
        """Whether a point lies in the closure of a region."""
        _, _, h, slopes = self.at(region, u)
        size = np.maximum(1.0, np.abs(slopes) @ np.maximum(np.abs(u), 1.0))
        return bool(np.all(self.signs[region] * h >= -tolerance * size))

    def neighbour(self, region: int, interface: int) -> int | None:
        """The region across an interface, None if there is none."""
        if self.signs[region, interface] == 0:
            return None
        across = self.signs[region].copy()
        across[interface] *= -1
        found = np.flatnonzero((self.signs == across).all(axis=1))
        return int(found[0]) if found.size else None

    def tangent(self, region: int, u: Array, weight: Array) -> tuple[Array, bool]:
        """Null vector of [F_x F_p], unit in the weighted norm, and whether it is the only one."""
        _, slopes, _, _ = self.at(region, u)
        if not np.isfinite(slopes).all():
            return np.zeros(len(u)), False
        scale = 1.0 / np.sqrt(weight)
        _, singular, right = np.linalg.svd(slopes * scale)
        rows = np.abs(slopes * scale).max(initial=0.0)
        single = bool(singular[-1] > 1e-9 * max(rows, np.finfo(float).tiny))
        return right[-1] * scale, single
