"""A frozen model as numbers: rates, Jacobian, interfaces and eigenvalues at points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.compiled.fields import CompiledField, compile_field, parameter_array
from fastslow.continuation.loops import loop
from fastslow.errors import ModelError
from fastslow.model.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrozenField:
    """The frozen rates of every region over (states, one parameter).

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
        return compile_field(self.model, *self.varying)

    @cached_property
    def values(self) -> Array:
        """The parameter array of the compiled function."""
        return parameter_array(self.model, self.compiled)

    @cached_property
    def regions(self) -> tuple[str, ...]:
        return tuple(self.model.regions)

    @cached_property
    def interfaces(self) -> tuple[str, ...]:
        return tuple(self.model.interfaces)

    @cached_property
    def signs(self) -> NDArray[np.float64]:
        """Sign of every interface function in every region, shape (regions, m)."""
        rows = [[r.signs[i] for i in self.interfaces] for r in self.model.regions.values()]
        return np.array(rows, dtype=float).reshape(len(rows), len(self.interfaces))

    @property
    def n(self) -> int:
        return len(self.model.states)

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
        """Eigenvalues of the state Jacobian at points u, shape (…, n)."""
        _, slopes, _, _ = self.at(region, points)
        return np.linalg.eigvals(slopes[..., : self.n]).astype(complex)

    def admissible(self, region: int, u: Array, tolerance: float = 1e-9) -> bool:
        """Whether a point lies in the closure of a region."""
        _, _, h, slopes = self.at(region, u)
        size = np.maximum(1.0, np.abs(slopes) @ np.maximum(np.abs(u), 1.0))
        return bool(np.all(self.signs[region] * h >= -tolerance * size))

    def neighbour(self, region: int, interface: int) -> int | None:
        """The region across an interface, None if there is none."""
        across = self.signs[region].copy()
        across[interface] *= -1
        found = np.flatnonzero((self.signs == across).all(axis=1))
        return int(found[0]) if found.size else None

    def tangent(self, region: int, u: Array, weight: Array) -> tuple[Array, bool]:
        """Null vector of [F_x F_p], unit in the weighted norm, and whether it is the only one."""
        _, slopes, _, _ = self.at(region, u)
        scale = 1.0 / np.sqrt(weight)
        _, singular, right = np.linalg.svd(slopes * scale)
        rows = np.abs(slopes * scale).max(initial=0.0)
        single = bool(singular[-1] > 1e-9 * max(rows, np.finfo(float).tiny))
        return right[-1] * scale, single
