"""Defining systems of folds, Hopf points, branch points, boundary equilibria and two-folds.

The unknowns are z = (states, two parameters, extra unknowns), and each system is regular at a
generic point (Kuznetsov 2004, chapter 10). Rates and Jacobian are scaled by the units of the
states and the spans of the parameters; the only remaining unit is that of time, in which the
equations are homogeneous. The results do not depend on the units of a model or its time scale.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.curves import BOUND, STOPPED, System
from fastslow.continuation.zeros import TEST_ROUNDING
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.normal_forms import fold_form, forms_at, lyapunov_terms
from fastslow.diagrams.two_folds import weight_of
from fastslow.results.base.outcome import Outcome
from fastslow.results.point_types import (
    BOUNDARY_EQUILIBRIUM,
    BRANCH_POINT,
    FOLD,
    HOPF,
    NEUTRAL_SADDLE,
    TWO_FOLD,
)

Array = NDArray[np.float64]

#: Fraction of its unit above which β breaks a branch point: there is no symmetry.
ISOLATED = 1e-7

#: A point is on an interface if |h| is below this fraction of its terms.
ON_INTERFACE = 1e-9


class CurveTests(Protocol):
    """A kind of codimension-two points: its tests along each kind of curve."""

    def on_folds(self, system: FoldSystem, /) -> Iterator[Criterion]: ...

    def on_pairs(self, system: PairSystem, /) -> Iterator[Criterion]: ...

    def on_boundaries(self, system: InterfaceSystem, region: int, /) -> Iterator[Criterion]: ...


@dataclass(frozen=True, eq=False)
class DefiningSystem(System):
    """Base class: a field with two varying parameters, a region, and units.

    Parameters
    ----------
    field : FrozenField
        With two varying parameters.
    region : int
    unit : ndarray, shape (n,)
        Unit of every state.
    span : ndarray, shape (2,)
        Lengths of the ranges of both parameters.
    """

    field: FrozenField
    region: int
    unit: Array
    span: Array

    #: Code of the points, and whether they are on an interface by definition.
    code: ClassVar[str]
    on_interface: ClassVar[bool] = False

    @abstractmethod
    def start(self, u: Array) -> Array:
        """Return z for a point u = (states, parameters)."""

    @property
    def n(self) -> int:
        return self.field.n

    @property
    def width(self) -> int:
        """Length of (states, parameters)."""
        return self.n + 2

    @property
    def tested(self) -> int:
        return self.width

    @property
    def scales(self) -> Array:
        """Units of (states, parameters)."""
        return np.append(self.unit, self.span)

    def extras(self, z: Array) -> Array:
        """Units of the extra unknowns, given their values at a first point."""
        return np.ones(len(z) - self.width)

    def at(self, z: Array) -> tuple[Array, Array]:
        """Scaled rates and derivatives at z (…, N + 1)."""
        u = z[..., : self.width]
        rows = u.reshape(-1, self.width)
        rates, slopes, _, _ = self.field.evaluate(self.region, rows)
        scaled = slopes * self.scales / self.unit[:, None]
        lead = u.shape[:-1]
        return (rates / self.unit).reshape(*lead, self.n), scaled.reshape(*lead, self.n, self.width)

    def jacobian(self, z: Array) -> Array:
        """State Jacobian in units of the states, shape (…, n, n)."""
        return self.at(z)[1][..., : self.n]

    def balanced(self, z: Array) -> Array:
        """State Jacobian at one point, with rows scaled by those of [F_x F_p]."""
        slopes = self.at(z)[1]
        return np.asarray(slopes[:, : self.n] / row_sizes(slopes)[:, None])

    @property
    def own_interface(self) -> int | None:
        """The interface on which all points are, disregarded by `holds`."""
        return None

    def code_at(self, z: Array) -> str:
        """The code of a point of the curve."""
        return self.code

    def coefficient(self, z: Array) -> float:
        """Normal-form coefficient at a point, NaN without one."""
        return float("nan")

    def tests(self, kinds: Iterable[CurveTests]) -> Iterator[Criterion]:
        """Yield the tests of codimension-two points along the curve, kind by kind."""
        yield from ()

    def bounds(self, bounded: bool) -> Callable[[Array], Array] | None:
        """Return functions that are positive where the curve is defined, None without any.

        Parameters
        ----------
        bounded : bool
            Whether the curve ends where the points become virtual.
        """
        return None

    def lost(self, z: Array, scale: Array) -> bool:
        """Return whether a solution, or a direction from one, is no longer such a point."""
        return False

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        """Return the outcome of a curve with these equations, None for the usual one.

        Parameters
        ----------
        status : str
            Of the trace, see `curves`.
        z : ndarray
            Its last point.
        where : str
            The parameters there, as text.
        """
        return None

    def holds(self, z: Array) -> bool:
        """Return whether a point is in the closure of its region, its own interface included."""
        return self.inside(z, self.own_interface)

    def inside(self, z: Array, but: int | None = None) -> bool:
        """Return whether a point is in the closure of the region, disregarding one interface.

        For sliding this includes escaping, whose pseudo-equilibria satisfy the same equations.
        """
        heights = self.heights(z)
        if but is not None:
            heights[but] = 0.0
        if self.field.modes[self.region].sides is not None:
            drifts = heights[-2:]
            one_way = np.all(drifts >= -ON_INTERFACE) or np.all(drifts <= ON_INTERFACE)
            return bool(one_way and np.all(heights[:-2] >= -ON_INTERFACE))
        return bool(np.all(heights >= -ON_INTERFACE))

    def heights(self, z: Array) -> Array:
        """Bounds of the region at a point, positive inside and relative to their terms."""
        u = z[: self.width]
        _, _, h, gradients = self.field.evaluate(self.region, u)
        size = np.abs(gradients) @ np.maximum(np.abs(u), self.scales)
        return np.asarray(self.field.signs[self.region] * h / np.where(size > 0, size, 1.0))


def row_sizes(matrix: Array) -> Array:
    """Length of every row, 1 for zero rows; scaling by it balances fast and slow states."""
    size = np.linalg.norm(matrix, axis=1)
    return np.where(size > 0, size, 1.0)


class FoldSystem(DefiningSystem):
    """F = 0, J v = 0, |v| = 1; the extra unknowns are v."""

    code: ClassVar[str] = FOLD

    @property
    def tested(self) -> int:
        return self.width + self.n

    def tests(self, kinds: Iterable[CurveTests]) -> Iterator[Criterion]:
        return (criterion for kind in kinds for criterion in kind.on_folds(self))

    def coefficient(self, z: Array) -> float:
        """A of y' = β + a y²."""
        u = z[: self.width]
        raw = self.field.residual_and_jacobian(self.region, u)[1][:, : self.n]
        return fold_form(forms_at(self.field, self.region, u), raw, self.unit)

    def start(self, u: Array) -> Array:
        _, _, right = np.linalg.svd(self.balanced(u))
        return np.concatenate([u, right[-1]])

    def residual(self, z: Array, guide: Array) -> Array:
        rates, slopes = self.at(z)
        v = z[..., self.width :]
        null = np.einsum("...ij,...j->...i", slopes[..., : self.n], v)
        length = v @ guide[self.width :] - 1.0
        return np.concatenate([rates, null, length[..., None]], axis=-1)

    def renewed(self, z: Array) -> Array:
        v = z[self.width :]
        return np.concatenate([z[: self.width], v / np.linalg.norm(v)])


class PairSystem(DefiningSystem):
    """F = 0, (J² + κ) v = 0, |v| = 1, ⟨c, v⟩ = 0: two eigenvalues with sum zero.

    The extra unknowns are κ, v and c, a constant vector that with v spans the plane of both
    eigenvectors. κ > 0 is a Hopf point with frequency √κ, κ < 0 a neutral saddle.
    """

    code: ClassVar[str] = HOPF

    @property
    def tested(self) -> int:
        return self.width + 1

    def tests(self, kinds: Iterable[CurveTests]) -> Iterator[Criterion]:
        return (criterion for kind in kinds for criterion in kind.on_pairs(self))

    def code_at(self, z: Array) -> str:
        return NEUTRAL_SADDLE if z[self.width] < 0 else self.code

    def relative(self, z: Array) -> float:
        """κ in units of the squared rate of the pair."""
        rate = self.rate(z)
        return float(z[self.width]) / (rate**2 if rate > 0 else 1.0)

    def lyapunov(self, z: Array) -> tuple[float, float]:
        """First Lyapunov coefficient and the size of its terms; NaN at neutral saddles."""
        w, region = self.width, self.region
        if not z[w] > 0:
            return np.nan, np.nan
        raw = self.field.residual_and_jacobian(region, z[:w])[1][:, : self.n]
        return lyapunov_terms(forms_at(self.field, region, z[:w]), raw, float(np.sqrt(z[w])))

    def coefficient(self, z: Array) -> float:
        """l₁, 0 where it is a rounding error."""
        value, size = self.lyapunov(z)
        return 0.0 if abs(value) <= TEST_ROUNDING * size else value

    def start(self, u: Array, squared: float | None = None) -> Array:
        """Return z for a point, given the product of the pair.

        By default the pair is the one with the smallest relative sum.
        """
        if squared is None:
            values = np.linalg.eigvals(self.jacobian(u))
            first, second = (values[k] for k in np.triu_indices(self.n, 1))
            size = np.maximum(np.abs(first) + np.abs(second), np.finfo(float).tiny)
            squared = float((first * second).real[np.argmin(np.abs(first + second) / size)])
        plane = self._plane(u, squared)
        return np.concatenate([u, [squared], plane[0], plane[1]])

    def _plane(self, z: Array, kappa: float) -> Array:
        """Return two vectors that span the null space of J² + κ, shape (2, n)."""
        matrix = self.jacobian(z)
        square = matrix @ matrix + kappa * np.eye(self.n)
        # rows scaled by their terms, for accuracy with fast states
        size = (np.abs(matrix) @ np.abs(matrix)).sum(axis=1, keepdims=True) + abs(kappa)
        _, _, right = np.linalg.svd(square / np.where(size > 0, size, 1.0))
        return np.asarray(right[[-1, -2]])

    def rate(self, z: Array) -> float:
        """Rate of the pair: the norm of the Jacobian in its plane, at least √|κ|."""
        plane = np.linalg.qr(self._plane(z[: self.width], float(z[self.width])).T)[0]
        inner = plane.T @ self.jacobian(z) @ plane
        return float(max(np.linalg.norm(inner), np.sqrt(abs(z[self.width]))))

    def extras(self, z: Array) -> Array:
        units = np.ones(len(z) - self.width)
        rate = self.rate(z)
        units[0] = rate**2 if rate > 0 else 1.0
        return units

    def residual(self, z: Array, guide: Array) -> Array:
        rates, slopes = self.at(z)
        n, w = self.n, self.width
        matrix, kappa, v = slopes[..., :n], z[..., w], z[..., w + 1 : w + 1 + n]
        double = np.einsum("...ij,...jk,...k->...i", matrix, matrix, v) + kappa[..., None] * v
        ends = [
            v @ guide[w + 1 : w + 1 + n] - 1.0,
            v @ guide[w + 1 + n :],
        ]
        kept = z[..., w + 1 + n :] - guide[w + 1 + n :]
        return np.concatenate([rates, double, np.stack(ends, axis=-1), kept], axis=-1)

    def renewed(self, z: Array) -> Array:
        n, w = self.n, self.width
        u, kappa, v = z[:w], z[w], z[w + 1 : w + 1 + n]
        v = v / np.linalg.norm(v)
        # the direction of the null space orthogonal to v
        plane = self._plane(u, kappa)
        plane = plane - np.outer(plane @ v, v)
        other = plane[np.argmax(np.linalg.norm(plane, axis=1))]
        other = other / np.linalg.norm(other)
        if other @ z[w + 1 + n :] < 0:
            other = -other
        return np.concatenate([u, [kappa], v, other])


class BranchPointSystem(DefiningSystem):
    """F + βψ = 0, [F_x F_p]ᵀψ = 0, |ψ| = 1: a branch point over the first parameter.

    The extra unknowns are ψ and β. In a model without symmetry β does not
    remain zero: branch points are then isolated in the parameter plane.
    """

    code: ClassVar[str] = BRANCH_POINT

    def lost(self, z: Array, scale: Array) -> bool:
        """Return whether β is not zero: without a symmetry the points do not persist."""
        return bool(abs(z[-1]) > ISOLATED * scale[-1])

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        if status != STOPPED:
            return None
        return Outcome(
            "no branch point",
            f"branch points do not persist beyond {where}: without a symmetry of the model "
            "they are isolated in this plane.",
            False,
        )

    def start(self, u: Array) -> Array:
        left, _, _ = np.linalg.svd(self.at(u)[1][:, : self.n + 1])
        return np.concatenate([u, left[:, -1], [0.0]])

    def extras(self, z: Array) -> Array:
        units = np.ones(len(z) - self.width)
        rate = np.abs(z[self.width : -1]) @ np.abs(self.at(z)[1]).sum(axis=1)
        units[-1] = rate if rate > 0 else 1.0
        return units

    def residual(self, z: Array, guide: Array) -> Array:
        rates, slopes = self.at(z)
        n, w = self.n, self.width
        psi, beta = z[..., w : w + n], z[..., -1:]
        null = np.einsum("...ij,...i->...j", slopes[..., : n + 1], psi)
        length = psi @ guide[w : w + n] - 1.0
        return np.concatenate([rates + beta * psi, null, length[..., None]], axis=-1)

    def renewed(self, z: Array) -> Array:
        n, w = self.n, self.width
        psi = z[w : w + n]
        return np.concatenate([z[:w], psi / np.linalg.norm(psi), z[-1:]])


@dataclass(frozen=True, eq=False)
class InterfaceSystem(DefiningSystem):
    """F = 0, h = 0: a boundary equilibrium; no extra unknowns."""

    code: ClassVar[str] = BOUNDARY_EQUILIBRIUM
    on_interface: ClassVar[bool] = True
    interface: int = 0

    @property
    def own_interface(self) -> int | None:
        return self.interface

    @property
    def adjacent(self) -> list[int]:
        """The regions whose Jacobians are needed: both sides of a continuous interface."""
        beyond = self.field.neighbour(self.region, self.interface)
        if beyond is None or not self.field.continuous(self.field.interfaces[self.interface]):
            return [self.region]
        return [self.region, beyond]

    def tests(self, kinds: Iterable[CurveTests]) -> Iterator[Criterion]:
        known = tuple(kinds)
        return (
            criterion
            for region in self.adjacent
            for kind in known
            for criterion in kind.on_boundaries(self, region)
        )

    def bounds(self, bounded: bool) -> Callable[[Array], Array] | None:
        return lambda z: np.delete(self.heights(z), self.interface)

    def start(self, u: Array) -> Array:
        return u.copy()

    def residual(self, z: Array, guide: Array) -> Array:
        rows = z.reshape(-1, self.width)
        rates, _, h, _ = self.field.evaluate(self.region, rows)
        both = np.column_stack([rates, h[:, self.interface]])
        return both.reshape(*z.shape[:-1], self.n + 1)


class TwoFoldSystem(DefiningSystem):
    """(1 − α) f₁ + α f₂ = 0, h = 0, a = b: a pseudo-equilibrium at which both drifts vanish.

    The first equation implies that the drifts a = ∇h·f₁ and b = ∇h·f₂ vanish if they are equal.
    The extra unknown is α; for 0 ≤ α ≤ 1 the fields point in opposite directions, and the point
    is on the boundary of sliding. Its region is the sliding motion, whose field is 0/0 there.
    """

    code: ClassVar[str] = TWO_FOLD
    on_interface: ClassVar[bool] = True

    def bounds(self, bounded: bool) -> Callable[[Array], Array] | None:
        return self.edges if bounded else None

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        if status != BOUND:
            return None
        share, sides = float(z[self.width]), self.field.sides(self.region)
        reason = f"beyond it the points leave {self.field.regions[self.region]}"
        for side, weight in ((sides.above, share), (sides.below, 1.0 - share)):
            if abs(weight) <= ON_INTERFACE:
                reason = (
                    f"it is an equilibrium of region {self.field.regions[side]} there, and "
                    "beyond it both fields point to the same side"
                )
        return Outcome("left the region", f"the two-fold is at {where}; {reason}.", True)

    def start(self, u: Array) -> Array:
        return np.append(u, weight_of(self.field, self.region, u))

    def residual(self, z: Array, guide: Array) -> Array:
        rows = z.reshape(-1, self.width + 1)
        u, share = rows[:, : self.width], rows[:, self.width :]
        sides = self.field.sides(self.region)
        above, _, h, gradients = self.field.evaluate(sides.above, u)
        below = self.field.evaluate(sides.below, u)[0]
        interface, n = sides.interface, self.n
        # the gradient is normalized, for independence of the unit of h
        edge = gradients[:, interface] * self.scales
        size = np.linalg.norm(edge[:, :n], axis=1, keepdims=True)
        size = np.where(size > 0, size, 1.0)
        first, second = above / self.unit, below / self.unit
        drifts = np.einsum("ij,ij->i", edge[:, :n] / size, first - second)
        both = np.column_stack(
            [(1.0 - share) * first + share * second, h[:, interface] / size[:, 0], drifts]
        )
        return both.reshape(*z.shape[:-1], self.n + 2)

    def edges(self, z: Array) -> Array:
        """α, 1 − α and the bounds by interfaces, positive at points of sliding."""
        share = z[self.width]
        return np.append([share, 1.0 - share], self.heights(z)[: len(self.field.interfaces)])

    def inside(self, z: Array, but: int | None = None) -> bool:
        """Return whether the fields point in opposite directions, within all other interfaces."""
        return bool(np.all(self.edges(z) >= -ON_INTERFACE))
