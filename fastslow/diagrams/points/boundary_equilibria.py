"""Boundary equilibria: equilibria on an interface."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.location import Located, branch_point
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem, PointInPlane
from fastslow.diagrams.segments import ALONG_EDGE, Window
from fastslow.errors import ArgumentError
from fastslow.results.branch.windows import ON_EDGE
from fastslow.results.point_types import BOUNDARY_EQUILIBRIUM, POINT_TYPES

Array = NDArray[np.float64]


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

    def tests(self, kinds: Iterable[Any]) -> Iterator[Criterion]:
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


class BoundaryKind(CurveKind):
    """Boundary equilibria: equilibria on an interface."""

    system = InterfaceSystem

    def first_met(
        self, field: FrozenField, region: int, u: Array, tangents: Array, window: Window
    ) -> tuple[int, Array] | None:
        """Return the first switching function with a zero on the last step, and its zero."""
        before, after = u[-2], u[-1]
        signs = field.signs[region]
        _, _, h0, _ = field.evaluate(region, before)
        _, _, h1, _ = field.evaluate(region, after)
        length = float(np.linalg.norm((after - before) / window.scale))
        best: tuple[float, int, Array] | None = None
        for k in np.flatnonzero(signs * h1 < 0):
            part = float(np.clip(h0[k] / (h0[k] - h1[k]), 0.0, 1.0)) if h0[k] != h1[k] else 0.5
            found = self.met(field, region, int(k), before, after, part, window)
            ahead = float(((found.u - before) * window.weight) @ tangents[-2])
            if (
                found.converged
                and -1e-6 <= ahead <= 1.5 * length
                and (best is None or ahead < best[0])
            ):
                best = (ahead, int(k), found.u)
        return None if best is None else (best[1], best[2])

    def met(
        self,
        field: FrozenField,
        region: int,
        interface: int,
        before: Array,
        after: Array,
        part: float,
        window: Window,
    ) -> Located:
        """Solve for the boundary equilibrium F = 0, h = 0 near a part of a step.

        Where equilibria lie within the interface, as those of a species that is absent, all of them
        solve these equations: the curve meets them at a branch point.
        """
        found = field.refined(region, before + part * (after - before), window.scale, row=interface)
        if not found.converged:
            return found
        _, _, _, slopes = field.evaluate(region, found.u)
        tangent, single = field.tangent(region, found.u, window.weight)
        size = float(np.linalg.norm(slopes[interface] * window.scale))
        if single and abs(slopes[interface] @ tangent) > ALONG_EDGE * size:
            return found
        meeting = branch_point(
            lambda z: field.residual_and_jacobian(region, z), found.u, window.scale
        )
        if not (meeting.converged and meeting.extra[0] == 0):
            return found
        _, _, h, _ = field.evaluate(region, meeting.u)
        length = float(np.linalg.norm((after - before) / window.scale))
        near = window.distance(meeting.u, found.u) < length
        return meeting if near and abs(h[interface]) <= ON_EDGE * size else found

    def region(self, place: PointInPlane) -> int:
        """Return neither the sliding motion nor the one held against the wall."""
        field, interface = place.field, place.point.interface
        plain = [
            k
            for k in place.regions
            if field.modes[k].sides is None
            and interface not in [field.interfaces[w] for w in field.modes[k].held]
        ]
        return plain[0] if plain else place.regions[0]

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        field, point = place.field, place.point
        if point.interface not in field.interfaces:
            raise ArgumentError(f"the point {point.label} is not on an interface of the model")
        number = field.interfaces.index(point.interface)
        system = InterfaceSystem(field, self.region(place), place.unit, place.span, number)
        return system, system.start(place.u)

    def traced(self, system: DefiningSystem, place: PointInPlane) -> bool:
        number, field, name = system.own_interface, system.field, place.point.interface
        if number is None or name != field.interfaces[number]:
            return False
        if not field.continuous(str(name)):
            return super().traced(system, place)
        # on the interface the equilibria of both sides coincide
        return self.region(place) in (system.region, field.neighbour(system.region, number))


BOUNDARY_EQUILIBRIA = BoundaryKind(POINT_TYPES[BOUNDARY_EQUILIBRIUM])
