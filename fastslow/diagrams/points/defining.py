"""What the curves of special points in two parameters have in common: defining systems, and kinds.

The unknowns are z = (states, two parameters, extra unknowns), and each system is regular at a
generic point (Kuznetsov 2004, chapter 10). Rates and Jacobian are scaled by the units of the
states and the spans of the parameters; the only remaining unit is that of time, in which the
equations are homogeneous. The results do not depend on the units of a model or its time scale.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.curves import System
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.field import FrozenField
from fastslow.results.base.outcome import Outcome
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]

#: A point is on an interface if |h| is below this fraction of its terms.
ON_INTERFACE = 1e-9


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

    @property
    def region_name(self) -> str:
        """The region whose rates vanish."""
        return self.field.regions[self.region]

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

    def tests(self, kinds: Iterable[Any]) -> Iterator[Criterion]:
        """Yield the tests of points of codimension two along the curve, kind by kind.

        Parameters
        ----------
        kinds : iterable of CodimensionTwo
        """
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


@dataclass(frozen=True, eq=False)
class PointInPlane:
    """A special point in the plane of two parameters: where its defining system is set up.

    Parameters
    ----------
    field : FrozenField
        With both parameters varying.
    point : SpecialPoint
    kind : PointKind
        Its kind, such as BT for a curve of folds.
    u : ndarray, shape (n + 2,)
        States and parameters.
    unit : ndarray, shape (n,)
    span : ndarray, shape (2,)
        Lengths of the ranges of both parameters.
    """

    field: FrozenField
    point: SpecialPoint
    kind: PointKind
    u: Array
    unit: Array
    span: Array

    @property
    def regions(self) -> list[int]:
        """The regions of the point."""
        names = self.field.regions
        return [names.index(region) for region in self.point.regions if region in names]


class CurveKind(PointKind):
    """Base class: special points that are continued as a curve in two parameters."""

    system: ClassVar[type[DefiningSystem]]

    def region(self, place: PointInPlane) -> int:
        """Return the region whose rates vanish."""
        return place.regions[0]

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        """Return the defining system with its first unknowns."""
        system = self.system(place.field, self.region(place), place.unit, place.span)
        return system, system.start(place.u)

    def traced(self, system: DefiningSystem, place: PointInPlane) -> bool:
        """Return whether a curve of a system consists of such points, of the place's region."""
        if system.code != self.code:
            return False
        region, field = self.region(place), system.field
        sides = field.modes[system.region].sides
        twin = system.region
        if sides is not None:
            # the sliding motion with the same equations
            twin = system.region - 1 if sides.escaping else system.region + 1
        return region in (system.region, twin)
