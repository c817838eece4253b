"""Equations that define folds, Hopf points, branch points and boundary equilibria.

In all of them z = (states, two parameters, extra unknowns), and each is a
regular system at a generic point (Kuznetsov 2004, chapter 10). The Jacobian
is scaled by the units of the states, so that null vectors are comparable.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.fields import FrozenField

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Defining(ABC):
    """What every kind of point has: a field with two varying parameters, a region, units.

    Parameters
    ----------
    field : FrozenField
        With two varying parameters.
    region : int
    unit : ndarray, shape (n,)
        Unit of every state.
    """

    field: FrozenField
    region: int
    unit: Array

    #: What the points are.
    code: ClassVar[str]

    @abstractmethod
    def start(self, u: Array) -> Array:
        """Give z for a point u = (states, parameters)."""

    @abstractmethod
    def residual(self, z: Array, guide: Array) -> Array:
        """Left-hand sides at points z of shape (…, N + 1), shape (…, N)."""

    @property
    def n(self) -> int:
        return self.field.n

    @property
    def width(self) -> int:
        """Length of (states, parameters)."""
        return self.n + 2

    def at(self, z: Array) -> tuple[Array, Array]:
        """Rates and their derivatives, states in their units, at points z of shape (…, N + 1)."""
        u = z[..., : self.width]
        rows = u.reshape(-1, self.width)
        rates, slopes, _, _ = self.field.at(self.region, rows)
        units = np.append(self.unit, np.ones(2))
        scaled = slopes * units / self.unit[:, None]
        lead = u.shape[:-1]
        return rates.reshape(*lead, self.n), scaled.reshape(*lead, self.n, self.width)

    def jacobian(self, z: Array) -> Array:
        """The state Jacobian in the units of the states, shape (…, n, n)."""
        return self.at(z)[1][..., : self.n]

    def renewed(self, z: Array) -> Array:
        return z

    def inside(self, z: Array, but: int | None = None) -> bool:
        """Whether a point lies in the closure of the region, one interface left aside."""
        heights = self.heights(z)
        if but is not None:
            heights[but] = 0.0
        return bool(np.all(heights >= -1e-9))

    def heights(self, z: Array) -> Array:
        """What bounds the region, positive inside and relative to its terms, at a point."""
        u = z[: self.width]
        _, _, h, gradients = self.field.at(self.region, u)
        size = np.maximum(1.0, np.abs(gradients) @ np.maximum(np.abs(u), 1.0))
        return np.asarray(self.field.signs[self.region] * h / size)


class Fold(Defining):
    """F = 0, J v = 0, |v| = 1; the extra unknowns are v."""

    code: ClassVar[str] = "LP"

    def start(self, u: Array) -> Array:
        _, _, right = np.linalg.svd(self.jacobian(u))
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


class Pair(Defining):
    """F = 0, (J² + κ) v = 0, |v| = 1, ⟨c, v⟩ = 0: two eigenvalues with sum zero.

    The extra unknowns are κ, v and c, a vector that completes v to the plane
    of the two and is carried along as it is. κ > 0 is a Hopf point with
    frequency √κ, κ < 0 a neutral saddle.
    """

    code: ClassVar[str] = "HB"

    def start(self, u: Array, squared: float | None = None) -> Array:
        """Give z for a point, with the pair whose product is nearest to ``squared``."""
        matrix = self.jacobian(u)
        if squared is None:
            values = np.linalg.eigvals(matrix)
            first, second = np.triu_indices(self.n, 1)
            sums, products = values[first] + values[second], values[first] * values[second]
            squared = float(products[np.argmin(np.abs(sums))].real)
        _, _, right = np.linalg.svd(matrix @ matrix + squared * np.eye(self.n))
        return np.concatenate([u, [squared], right[-1], right[-2]])

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
        matrix = self.jacobian(u)
        _, _, right = np.linalg.svd(matrix @ matrix + kappa * np.eye(n))
        # the other direction of the null plane, at right angles to v
        plane = right[-2:] - np.outer(right[-2:] @ v, v)
        other = plane[np.argmax(np.linalg.norm(plane, axis=1))]
        other = other / np.linalg.norm(other)
        if other @ z[w + 1 + n :] < 0:
            other = -other
        return np.concatenate([u, [kappa], v, other])


class Crossing(Defining):
    """F + βψ = 0, [F_x F_p]ᵀψ = 0, |ψ| = 1: a branch point over the first parameter.

    The extra unknowns are ψ and β. In a model without symmetry β does not stay
    zero: branch points are then isolated in the parameter plane.
    """

    code: ClassVar[str] = "BP"

    def start(self, u: Array) -> Array:
        left, _, _ = np.linalg.svd(self.at(u)[1][:, : self.n + 1])
        return np.concatenate([u, left[:, -1], [0.0]])

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
class OnInterface(Defining):
    """F = 0, h = 0: a boundary equilibrium; no extra unknowns."""

    code: ClassVar[str] = "BE"
    interface: int = 0

    def start(self, u: Array) -> Array:
        return u.copy()

    def residual(self, z: Array, guide: Array) -> Array:
        rows = z.reshape(-1, self.width)
        rates, _, h, _ = self.field.at(self.region, rows)
        both = np.column_stack([rates, h[:, self.interface]])
        return both.reshape(*z.shape[:-1], self.n + 1)
